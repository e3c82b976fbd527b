"""The motor of a driven run in Exudyn, whose clock starts at 0, and the steps that keep to its motion."""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PPoly

from analytic.kinematics.schedule import DriveMotion, Steady

INSTANT = 1e-9  # s, the first step of a run: it puts velocities right that are only nearly consistent
SETTLING_TIME = 1e-7  # s, the step after which accelerations are consistent, where Exudyn does not know the motor's
BEGIN = INSTANT + SETTLING_TIME  # s of a run's clock, at which its courses begin
KNOT_NEAR_REPORT = 0.1  # of a step: how near a report a knot may be for the step to pass over it
DRIFT = 5e-8  # rad that the trapezoidal rule may be off a course
OF_SCATTER = 1e-3  # of a noisy course's scatter, that it may be off


@dataclass(frozen=True)
class RunMotor:
    """A motor on the clock of an Exudyn run: its angle (rad; on a slide, its travel, m) over that time (s) is a
    piecewise polynomial.

    A course begins a moment after the run does, so that its first report is of a settled linkage.  ``size`` (m) makes a
    slide's travel comparable to an angle; it is 1 of a motor that turns.
    """

    motor: DriveMotion
    path: PPoly
    first: float  # s of the motor's own time when the run's motion begins
    begins: float  # s of the run at that moment
    size: float = 1.0

    @classmethod
    def of(cls, motor: DriveMotion, first: float | None = None, size: float = 1.0) -> RunMotor:
        """On the clock of a run, whose motion begins with the motor's or, on a course, at its time ``first`` (s)."""
        if isinstance(motor, Steady):
            return cls(motor, PPoly([[motor.speed], [motor.position(motor.begin)]], [0.0, 1.0]), motor.begin, 0.0)
        begins, first = BEGIN, motor.begin if first is None else first
        return cls(motor, PPoly(motor.spline.c, motor.knots - first + begins), first, begins, size)

    def clock(self, time: np.ndarray) -> np.ndarray:
        """Times of the run (s) at the motor's own times (s)."""
        return time - self.first + self.begins

    @property
    def steady(self) -> bool:
        """Whether the speed is constant."""
        return self.motor.constant_speed

    def angle(self, time: np.ndarray | float) -> np.ndarray:
        """Angle (rad) at times (s)."""
        return np.asarray(self.path(time))

    def rate(self, time: np.ndarray | float) -> np.ndarray:
        """Angular velocity (rad/s) at times (s)."""
        return np.asarray(self.path(time, 1))

    def knots_between(self, times: np.ndarray, step: float) -> np.ndarray:
        """Knots (s) before the last of these times (s, sorted), but for those that nearly coincide with one of them.

        A step over a knot, where the jerk jumps, would leave the trapezoidal rule's accelerations alternating ever
        after; so would, by rounding, a step far shorter than ``step`` (s).
        """
        knots = self.path.x[self.path.x < times[-1]]
        after = np.searchsorted(times, knots)
        nearest = np.minimum(np.abs(times[after] - knots), np.abs(times[np.maximum(after - 1, 0)] - knots))
        return np.asarray(knots[nearest > KNOT_NEAR_REPORT * step])

    @property
    def top_speed(self) -> float:
        """The largest angular velocity (rad/s), either way."""
        return self.motor.top_speed / self.size

    @property
    def end(self) -> float:
        """Time of the run (s) when the motion ends; infinite at constant speed."""
        return math.inf if self.steady else float(self.path.x[-1])

    @property
    def range(self) -> tuple[float, float]:
        """Least and largest angle (rad) of a course."""
        angles = self.angle(np.linspace(self.begins, self.end, 8 * len(self.path.x)))
        return float(angles.min()), float(angles.max())

    @property
    def longest_step(self) -> float:
        """Step (s) with which the trapezoidal rule stays on the course: it loses h^2/12 of what the acceleration
        changes by.

        A course with scatter, which sixth differences show, need not be followed closer than to a part of that.
        """
        change, rough = float(np.ptp(self.path(self.path.x, 2))), np.diff(self.angle(self.path.x), 6)
        scatter = float(np.sqrt(np.mean(rough**2) / math.comb(12, 6))) if rough.size else 0.0
        allowed = max(DRIFT * self.size, OF_SCATTER * scatter)
        return float(np.sqrt(12 * allowed / change)) if change else float("inf")

    def speed_function(self) -> Callable[[float], float]:
        """Angular velocity (rad/s) at a time (s), fast."""
        inner = self.path.x[1:-1].tolist()
        pieces = list(zip(self.path.x[:-1].tolist(), *self.path.derivative().c.tolist(), strict=True))

        def speed(time: float) -> float:
            start, *coefficients = pieces[bisect(inner, time)]
            value = 0.0
            for c in coefficients:
                value = value * (time - start) + c
            return value

        return speed
