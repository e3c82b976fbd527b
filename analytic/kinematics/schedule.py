"""When one looks at a linkage, and what its drives do meanwhile: the one type for every motion.

A :class:`Schedule` is made where a motion is asked for, of crank angles, times, a course, a platform's path, or data.
The analytic model walks along it, and an engine runs it.  A crank angle is no motion of its own: it is what instants
are called by where a crank turns evenly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from analytic.errors import Error
from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import angles, one_line

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

COURSE_INSTANTS = 400  # instants of courses, at least, by which a linkage is followed
STANDING_RATE = 1e-6  # of a course's largest rate: a drive that is no faster stands, but for the ringing of its spline
FEWEST_KNOTS = 4  # of a course, at least: a cubic spline needs as many


@dataclass(frozen=True)
class Turning:
    """Angle (rad), angular velocity (rad/s) and acceleration (rad/s^2) of a shaft, (N,); or the inputs of a linkage,
    (n_inputs, N) rad or m.
    """

    theta: np.ndarray
    omega: np.ndarray
    alpha: np.ndarray

    def __repr__(self) -> str:
        return one_line(self, angles(self.theta, "moment"))


class ScheduleError(Error, ValueError):
    """A linkage cannot be moved so; the message says what to give."""


@dataclass(frozen=True)
class Steady:
    """A drive at a constant ``speed`` (rad/s, m/s) from ``start`` (rad, m) at time 0; a run begins at ``begin`` (s)."""

    start: float
    speed: float = 0.0
    begin: float = 0.0

    constant_speed: ClassVar[bool] = True
    end: ClassVar[float] = math.inf  # s
    knot_spacing: ClassVar[float] = math.inf  # s: there are no knots

    @property
    def top_speed(self) -> float:
        """The largest rate (rad/s, m/s), either way."""
        return abs(self.speed)

    def position(self, time: float) -> float:
        """Position (rad, m) at a time (s)."""
        return self.start + self.speed * time

    def rate(self, time: float) -> float:
        """Rate (rad/s, m/s) at a time (s)."""
        return self.speed

    def acceleration(self, time: float) -> float:
        """Acceleration (rad/s^2, m/s^2) at a time (s)."""
        return 0.0

    def positions(self, times: np.ndarray, order: int = 0) -> np.ndarray:
        """Positions (N,) rad, m at times (N,) s, or their derivatives of that order."""
        if order == 0:
            return self.start + self.speed * times
        return np.full_like(times, self.speed if order == 1 else 0.0)

    def reversed(self) -> Steady:
        """The drive's motion with the joint's bodies the other way round."""
        return Steady(-self.start, -self.speed, self.begin)


@dataclass(frozen=True)
class Course:
    """A drive on a course from its first knot to its last: the cubic spline through ``values`` (K,) rad, m at ``knots``
    (K,) s.
    """

    knots: np.ndarray
    values: np.ndarray

    constant_speed: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for name in ("knots", "values"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), float))

    @cached_property
    def spline(self) -> CubicSpline:
        """The position as a function of time and order of derivative."""
        from scipy.interpolate import CubicSpline  # here: importing it takes a quarter of a second

        return CubicSpline(self.knots, self.values)

    @property
    def begin(self) -> float:
        """Time (s) of the first knot."""
        return float(self.knots[0])

    @property
    def end(self) -> float:
        """Time (s) of the last knot."""
        return float(self.knots[-1])

    @property
    def knot_spacing(self) -> float:
        """Median time (s) between knots."""
        return float(np.median(np.diff(self.knots)))

    @cached_property
    def top_speed(self) -> float:
        """The largest rate (rad/s, m/s), either way."""
        return self.peak(1)

    def peak(self, order: int) -> float:
        """The largest size of a derivative of that order at the knots and halfway between them."""
        x = self.knots
        return float(np.abs(self.spline(np.concatenate([x, (x[1:] + x[:-1]) / 2]), order)).max())

    def position(self, time: float) -> float:
        """Position (rad, m) at a time (s)."""
        return float(self.spline(time))

    def rate(self, time: float) -> float:
        """Rate (rad/s, m/s) at a time (s)."""
        return float(self.spline(time, 1))

    def acceleration(self, time: float) -> float:
        """Acceleration (rad/s^2, m/s^2) at a time (s)."""
        return float(self.spline(time, 2))

    def positions(self, times: np.ndarray, order: int = 0) -> np.ndarray:
        """Positions (N,) rad, m at times (N,) s, or their derivatives of that order."""
        return np.asarray(self.spline(times, order))

    def reversed(self) -> Course:
        """The drive's motion with the joint's bodies the other way round."""
        return Course(self.knots, -self.values)


DriveMotion = Steady | Course
Knots = tuple[np.ndarray, np.ndarray]  # times (K,) s, and positions (K,) rad, m at them


@dataclass(frozen=True)
class Schedule:
    """Instants ``time`` (N,) s at which one looks at a linkage, in any order, and how its drives move.

    ``drives`` says by joint how its position goes on (second body relative to first: rad, m).  Joints with freedoms
    that have none start as the assembly has them, at ``rates`` (rad/s, m/s; at rest where there is none), and move
    freely.  A linkage ``at_rest`` is held by its drives in the pose of each instant; friction acts against the way in
    which these go on.

    ``crank`` is the joint of the crank that alone moves the linkage, or would if it were not let go; None where others
    do, or several.  ``crank_angle`` (N,) rad are the instants as they were asked for, where a crank turns evenly.
    """

    time: np.ndarray = field(default_factory=lambda: np.zeros(0))
    drives: Mapping[str, DriveMotion] = field(default_factory=dict)
    at_rest: bool = False
    rates: Mapping[str, float] = field(default_factory=dict)
    crank: str | None = None
    crank_angle: np.ndarray | None = None

    # ---------------------------------------------------------------- how it is made

    @classmethod
    def at_angles(cls, m: Mechanism, theta: np.ndarray, *, at_rest: bool = False) -> Schedule:
        """A crank that turns at its drive's speed, looked at where it is at angles (N,) rad; time counts from when it
        passes the first of them.  At rest only the direction is left of a speed, forward without one.  Raises
        ScheduleError for a drive that has no speed.
        """
        theta, speed = np.asarray(theta, float), m.speed
        if speed is None and not at_rest:
            raise ScheduleError(
                f"{m.name}: its drive has no constant speed, so that its crank's angle tells no time; give times and a"
                " course, or drive.speed in rad/s"
            )
        speed, sign = speed or 1.0, m.crank_sign
        first = float(theta.min() if speed > 0 else theta.max()) if theta.size else 0.0
        drives = {m.drive_joint.name: Steady(sign * first, sign * speed)}
        return cls((theta - first) / speed, drives, at_rest, crank=m.drive_joint.name, crank_angle=theta)

    @classmethod
    def of_crank(cls, m: Mechanism, course: Knots, time: np.ndarray) -> Schedule:
        """A crank on a course of its angle (rad), looked at at times (N,) s."""
        joint, (knots, angles) = m.drive_joint.name, course
        return replace(cls.along({joint: (knots, m.crank_sign * np.asarray(angles, float))}, time), crank=joint)

    @classmethod
    def released(cls, m: Mechanism, time: np.ndarray, rate: float = 0.0) -> Schedule:
        """A linkage of one crank that is let go, its crank at a rate (rad/s), looked at at times (N,) s after that."""
        crank = m.drive_joint.name
        return cls(np.asarray(time, float), rates={crank: m.crank_sign * rate} if rate else {}, crank=crank)

    @classmethod
    def along(cls, courses: Mapping[str, Knots], time: np.ndarray, *, at_rest: bool = False) -> Schedule:
        """Drives on courses by joint, looked at at times (N,) s; with an empty mapping all moves freely."""
        return cls(np.asarray(time, float), {name: Course(*course) for name, course in courses.items()}, at_rest)

    # ---------------------------------------------------------------- what it is

    @property
    def motion(self) -> Literal["driven", "static"]:
        """Whether the linkage moves, or rests."""
        return "static" if self.at_rest else "driven"

    @property
    def lets_go(self) -> bool:
        """Whether no drive moves the linkage."""
        return not self.drives

    @property
    def turns_evenly(self) -> bool:
        """Whether a crank turns at a constant speed, or rests where that would bring it."""
        return self.crank_angle is not None

    @property
    def courses(self) -> dict[str, Course]:
        """The drives that follow courses, by joint."""
        return {name: motion for name, motion in self.drives.items() if isinstance(motion, Course)}

    @property
    def begin(self) -> float:
        """Time (s) at which all courses have begun; 0 without."""
        return max((motion.begin for motion in self.drives.values()), default=0.0)

    @property
    def end(self) -> float:
        """Time (s) at which the first of the courses ends."""
        return min((motion.end for motion in self.drives.values()), default=math.inf)

    def crank_motion(self, m: Mechanism) -> DriveMotion:
        """The crank's angle (rad) over time."""
        position = self.drives[m.drive_joint.name]
        return position if m.crank_sign > 0 else position.reversed()

    def start_speed(self, m: Mechanism) -> float:
        """The rate (rad/s) of a crank that is let go."""
        return m.crank_sign * self.rates.get(self.crank or "", 0.0)

    def positions(self, time: np.ndarray | None = None, order: int = 0) -> dict[str, np.ndarray]:
        """Positions (N,) rad, m of the driven joints at times (N,) s, by default its own; or their derivatives."""
        time = self.time if time is None else time
        return {name: motion.positions(time, order) for name, motion in self.drives.items()}

    def turned_to(self, m: Mechanism, theta: np.ndarray) -> Schedule:
        """This schedule of a crank that turns evenly, looked at where that is at other angles (N,) rad."""
        motion = self.crank_motion(m)
        return replace(self, time=(theta - motion.position(0.0)) / motion.rate(0.0), crank_angle=theta)

    def later(self, after: Sequence[float]) -> Schedule:
        """This schedule, looked at so much (s) later in turn than at each of its instants."""
        return replace(self, time=np.add.outer(self.time, np.asarray(after)).ravel(), crank_angle=None)

    def directions(self, time: np.ndarray) -> dict[str, np.ndarray]:
        """Rates (N,) rad/s, m/s of the driven joints at times (N,) s; 0 of a drive that is about to stand."""
        rates = self.positions(time, 1)
        return {
            name: np.where(np.abs(rate) > STANDING_RATE * self.drives[name].top_speed, rate, 0.0)
            for name, rate in rates.items()
        }

    def until(self, time: np.ndarray) -> np.ndarray:
        """Times (M,) s of the way along the courses to the last of times (N,) s, these and the knots among them."""
        begin, last = self.begin, float(time.max())
        knots = [course.knots for course in self.courses.values()]
        every = np.concatenate([time, *knots, np.linspace(begin, last, COURSE_INSTANTS)])
        return np.unique(every[(every >= begin) & (every <= last)])
