"""How a motor moves, whichever engine it turns a linkage in: at constant speed, or along a course."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from sim_models.engine import Request

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


@dataclass(frozen=True)
class ConstantSpeed:
    """A motor at a constant speed (rad/s), at the angle theta (rad) at time 0; it begins to turn at ``begin`` (s)."""

    theta: float
    speed: float = 0.0
    begin: float = 0.0

    constant_speed: ClassVar[bool] = True
    end: ClassVar[float] = math.inf  # s
    knot_spacing: ClassVar[float] = math.inf  # s: there are no knots

    @property
    def top_speed(self) -> float:
        """The largest angular velocity (rad/s), either way."""
        return abs(self.speed)

    def angle(self, time: float) -> float:
        """Angle (rad) at a time (s)."""
        return self.theta + self.speed * time

    def rate(self, time: float) -> float:
        """Angular velocity (rad/s)."""
        return self.speed

    def acceleration(self, time: float) -> float:
        """Angular acceleration (rad/s^2)."""
        return 0.0

    def angles(self, times: np.ndarray, order: int = 0) -> np.ndarray:
        """Angles (N,) rad at times (N,) s, or their derivatives of that order (rad/s^order)."""
        return self.theta + self.speed * times if order == 0 else np.full_like(times, self.speed if order == 1 else 0.0)


@dataclass(frozen=True)
class Course:
    """A motor on a course: the cubic spline through its knots, from the first of them to the last."""

    spline: CubicSpline  # of the angle (rad) over the time (s)

    constant_speed: ClassVar[bool] = False

    @property
    def knots(self) -> np.ndarray:
        """Times (K,) s between which the course is a cubic."""
        return np.asarray(self.spline.x)

    @property
    def begin(self) -> float:
        """Time (s) of the first knot."""
        return float(self.spline.x[0])

    @property
    def end(self) -> float:
        """Time (s) of the last knot."""
        return float(self.spline.x[-1])

    @property
    def knot_spacing(self) -> float:
        """Median time (s) between knots."""
        return float(np.median(np.diff(self.knots)))

    @cached_property
    def top_speed(self) -> float:
        """The largest angular velocity (rad/s), either way."""
        return self.peak(1)

    def peak(self, order: int) -> float:
        """The largest size of a derivative of the angle (rad/s^order) at the knots and halfway between them."""
        x = self.knots
        return float(np.abs(self.spline(np.concatenate([x, (x[1:] + x[:-1]) / 2]), order)).max())

    def angle(self, time: float) -> float:
        """Angle (rad) at a time (s)."""
        return float(self.spline(time))

    def rate(self, time: float) -> float:
        """Angular velocity (rad/s)."""
        return float(self.spline(time, 1))

    def acceleration(self, time: float) -> float:
        """Angular acceleration (rad/s^2)."""
        return float(self.spline(time, 2))

    def angles(self, times: np.ndarray, order: int = 0) -> np.ndarray:
        """Angles (N,) rad at times (N,) s, or their derivatives of that order (rad/s^order)."""
        return np.asarray(self.spline(times, order))


Motor = ConstantSpeed | Course


def motor_of(request: Request) -> Motor | None:
    """The motor of a request that :func:`sim_models.common.requests.check_request` accepts; None at rest and when
    released.

    At constant speed, time 0 is when the motor passes the first of the crank angles, and a lead-in comes before it.
    """
    if request.motion == "static" or request.released:
        return None
    if request.course is not None:
        from scipy.interpolate import CubicSpline  # here: importing it takes a quarter of a second

        return Course(CubicSpline(*(np.asarray(x, float) for x in request.course)))
    theta, speed = np.asarray(request.crank_angle, float), request.mechanism.speed
    assert speed is not None  # only a course moves a measured drive
    return ConstantSpeed(float(theta.min() if speed > 0 else theta.max()), speed, -(request.lead_in / abs(speed)))


def motors_of(request: Request) -> dict[str, Course]:
    """The motors of a request with ``courses``, by driven joint: its position (rad, or m) over time."""
    from scipy.interpolate import CubicSpline  # here: importing it takes a quarter of a second

    courses = request.courses or {}
    return {name: Course(CubicSpline(*(np.asarray(x, float) for x in course))) for name, course in courses.items()}


def report_times(request: Request, motor: Motor | None) -> np.ndarray:
    """Times (N,) s of a moving run's reports, in the request's order: the motor's, or since the release."""
    if isinstance(motor, ConstantSpeed):
        return np.asarray((request.crank_angle - motor.theta) / motor.speed)
    return np.asarray(request.time, float)
