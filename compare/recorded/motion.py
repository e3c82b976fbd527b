"""How a linkage moves in a file of results: at which crank angles, along which course, or from where it was let go."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d

from analytic.beyond_paper.drive import Motor
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.schedule import Knots, Schedule, Turning
from analytic.mechanism import Mechanism
from compare.judge.reference import SIGMAS
from compare.recorded.smooth import Smoother

TURNING_PARTS = ("theta", "omega", "alpha")  # of a turning
EVEN_TURNING = 1e-6  # rad: a crank that is off an even turning by no more turns evenly
COARSEST = 0.02  # rad, half of the step of an encoder: of rows at uneven times angles farther apart are chosen
SPEED_ACCURACY = 1e-5  # relative: so near is a speed the drive's own
FINER = 4  # knots of a course that an engine follows, to a sample
COURSE_KNOTS = 500  # at least
COURSE_MARGIN = 1e-6  # of a course's length, beyond its ends
LEAST_SAMPLES = 5  # angles by which a course is known
LEFT_BY_COURSE = 2.0  # times what positions are rounded to, that a smooth course through them may be off
GAINS = 1.18, 6.0  # rms error of a cubic spline's derivatives at its knots, a step apart, for one of 1 in those
PLACED_EXACTLY = 1e-9  # rad, m: a freedom that is assembled so near to where it is let go begins there
NEIGHBOURS = 7  # samples around one, whose errors may be its own
ROUNDINGS = 4  # draws of what positions are rounded to, by which is told how far that moves what runs free


@dataclass(frozen=True)
class RecordedMotion:
    """A motion of the crank over time: at each sample as it was recorded, how exactly it is known (rms), and its course
    in between.
    """

    time: np.ndarray
    moving: Turning
    errors: Turning
    course: Motor

    def smooth(self) -> RecordedMotion:
        """The motion that an engine follows: at each sample on its course."""
        return replace(self, moving=self.course.at(self.time))

    @property
    def knots(self) -> tuple[np.ndarray, np.ndarray]:
        """The course as times (M,) s and angles (M,)."""
        margin = COURSE_MARGIN * float(self.time[-1] - self.time[0])
        count = max(FINER * self.time.size, COURSE_KNOTS)
        knots = np.linspace(self.time[0] - margin, self.time[-1] + margin, count)
        return knots, self.course.at(knots).theta

    def schedule(self, mechanism: Mechanism) -> Schedule:
        """The schedule of its course."""
        return Schedule.of_crank(mechanism, self.knots, self.time)


@dataclass(frozen=True)
class RecordedDrives:
    """A motion of several drives over time, by joint: positions (rad, m) as recorded, and courses in between."""

    time: np.ndarray
    drives: Mapping[str, RecordedMotion]

    def smooth(self) -> RecordedDrives:
        """The motion that an engine follows: each drive on its course."""
        return RecordedDrives(self.time, {name: one.smooth() for name, one in self.drives.items()})

    @property
    def knots(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """The courses as times (M,) s and positions (M,) by joint."""
        return {name: one.knots for name, one in self.drives.items()}

    def inputs(self, assembly: Assembly, of: Literal["moving", "errors"]) -> Turning:
        """The inputs as they were recorded, (n_inputs, N), or how exactly they are known."""
        parts = ({name: getattr(getattr(one, of), part) for name, one in self.drives.items()} for part in TURNING_PARTS)
        return Turning(*(assembly.inputs_at(part) for part in parts))

    def schedule(self, at_rest: bool) -> Schedule:
        """The schedule of its courses, or of rest in the poses that were recorded."""
        poses = {name: (self.time, one.moving.theta) for name, one in self.drives.items()}
        return Schedule.along(poses if at_rest else self.knots, self.time, at_rest=at_rest)


@dataclass(frozen=True)
class ReleaseState:
    """A state (rad, rad/s; of a slide m, m/s) from which a crank or a freedom is let go, how exactly it is known,
    whether its rate is recorded, and its position.
    """

    angle: float
    rate: float
    errors: tuple[float, float] = (0.0, 0.0)
    recorded: bool = False
    placed: bool = True


@dataclass(frozen=True)
class RecordedRelease:
    """A motion in which freedoms are let go as the table begins, by joint, beside drives on recorded courses (K,) s,
    from its first instant on, and (K,) rad, m.
    """

    driven: RecordedDrives
    start: Mapping[str, ReleaseState]
    courses: Mapping[str, Knots]

    @classmethod
    def of(cls, driven: RecordedDrives, start: Mapping[str, ReleaseState]) -> RecordedRelease:
        """The motion whose courses begin with the table."""
        first, last, count = driven.time[0], driven.time[-1], max(FINER * driven.time.size, COURSE_KNOTS)
        knots = np.linspace(0.0, (last - first) * (1 + COURSE_MARGIN), count)
        courses = {name: (knots, one.course.at(first + knots).theta) for name, one in driven.drives.items()}
        return cls(driven, start, courses)

    @property
    def schedule(self) -> Schedule:
        """The schedule of its courses and rates, from the table's first instant on."""
        rates = {name: state.rate for name, state in self.start.items()}
        return replace(Schedule.along(self.courses, self.driven.time - self.driven.time[0]), rates=rates)

    def inputs(self, assembly: Assembly) -> np.ndarray:
        """The inputs (n_inputs, 1) as it begins."""
        here = {name: np.array([state.angle]) for name, state in self.start.items()}
        return assembly.inputs_at(here | {name: values[:1] for name, (_, values) in self.courses.items()})

    def assembled(self, mechanism: Mechanism) -> Mechanism:
        """The linkage assembled where it is let go.  Raises AssemblyError on the way there, and where a slide would
        have to begin elsewhere than where the linkage is assembled.
        """
        assembly = Assembly(mechanism)
        moved = mechanism.replace(assembly={**mechanism.assembly, **_placed(assembly, self.inputs(assembly))})
        home = Assembly(moved).positions
        for name, state in self.start.items():
            if abs(home[name] - state.angle) > PLACED_EXACTLY + SIGMAS * state.errors[0]:
                raise AssemblyError(
                    f"{mechanism.name}: joint {name!r} slides freely from {state.angle:g} m on, and engines let it go"
                    f" where the linkage is assembled, at {home[name]:g} m",
                    remedy="leave simulators out, or move the joint's points in the mechanism file",
                )
        return moved

    def others(self) -> Iterator[RecordedRelease]:
        """The same with each thing that is not known exactly off by its rms error: where and how fast each freedom
        begins, and each drive's course, by what its positions are rounded to and by how far apart they are.
        """
        for name, state in self.start.items():
            where, fast = state.errors
            for off in (replace(state, angle=state.angle + where), replace(state, rate=state.rate + fast)):
                if off != state:
                    yield replace(self, start={**self.start, name: off})
        time, draw = self.driven.time, np.random.default_rng(0)  # the same every time
        half = np.unique(np.append(np.arange(0, time.size, 2), time.size - 1))
        for name, one in self.driven.drives.items():
            (knots, values), at, rounded = self.courses[name], one.moving.theta, SIGMAS * one.errors.theta
            noises = rounded * draw.uniform(-1.0, 1.0, (ROUNDINGS if rounded.any() else 0, time.size))
            others = [(time, at + noise, 2 * rounded, ROUNDINGS**-0.5) for noise in noises]
            if half.size >= LEAST_SAMPLES:
                others.append((time[half], at[half], rounded[half], 1.0 / SIGMAS))
            for instants, seen, allowed, share in others:
                course = followed_as_given(instants, seen, allowed).course.at(time[0] + knots).theta
                yield replace(self, courses={**self.courses, name: (knots, values + share * (course - values))})


def off_by(time: np.ndarray, rounded: np.ndarray, late: np.ndarray, rate: np.ndarray | float) -> np.ndarray:
    """How far (N,) rad a crank's angles may be off that are ``rounded`` by so much, at times (N,) s ``late`` by
    so much, where it turns at this rate (rad/s).

    Rows at even times are a clock's: their angles are rounded however far apart they are.
    """
    off, steps = rounded + np.abs(rate) * late, np.diff(time)
    clocked = np.allclose(steps, steps.mean(), rtol=EVEN_TURNING, atol=2 * float(late.max()))
    return off if clocked else np.minimum(off, COARSEST)


def followed(time: np.ndarray, angle: np.ndarray, rounded: np.ndarray) -> RecordedMotion:
    """The motion through a crank's angles (N,) rad at times (N,) s: the angles themselves, rate and acceleration of a
    smooth course through them, and how far what they are ``rounded`` to (N,) and how far apart they are leave these
    open.

    The latter is what a course through every second of them makes of it.  No course knows of what is faster than its
    samples.
    """
    smoother = Smoother(time, angle)
    course, half = smoother.course, np.unique(np.append(np.arange(0, time.size, 2), time.size - 1))
    coarser = Smoother(time[half], angle[half]).course if half.size >= LEAST_SAMPLES else course
    errors = []
    for order, answers in enumerate(smoother.answers(time)):
        noise = smoother.uncertainty(answers, smoother.sigma)
        apart = np.abs(coarser(time, order) - course(time, order))
        errors.append(maximum_filter1d(noise, NEIGHBOURS) + maximum_filter1d(apart, NEIGHBOURS) / SIGMAS)
    errors[0] = rounded / SIGMAS
    motor = Motor(course)
    return RecordedMotion(time, replace(motor.at(time), theta=angle), Turning(*errors), motor)


def followed_as_given(time: np.ndarray, position: np.ndarray, rounded: np.ndarray) -> RecordedMotion:
    """The motion of a program's drive, whose positions (N,) are as exact as they are written.

    A smooth course is taken where it leaves no more than they are ``rounded`` to; where it leaves more, they have
    corners, or a motion of their own from sample to sample, and the course is the cubic spline through them.
    """
    smooth = followed(time, position, rounded)
    if np.abs(position - smooth.course.at(time).theta).max() <= LEFT_BY_COURSE * float(rounded.max()):
        return smooth
    course, half = CubicSpline(time, position), np.unique(np.append(np.arange(0, time.size, 2), time.size - 1))
    coarser = CubicSpline(time[half], position[half])
    step, errors = np.gradient(time), [rounded / SIGMAS]
    for order, gain in enumerate(GAINS, 1):
        apart = np.abs(coarser(time, order) - course(time, order))
        errors.append(gain * rounded / math.sqrt(3.0) / step**order + maximum_filter1d(apart, NEIGHBOURS) / SIGMAS)
    motor = Motor(course)
    return RecordedMotion(time, motor.at(time), Turning(*errors), motor)


def evenly(
    time: np.ndarray, angle: np.ndarray, speed: float, rounded: np.ndarray, late: np.ndarray
) -> tuple[np.ndarray, float] | None:
    """Angles (N,) rad at times (N,) s of a crank that turns evenly at this speed (rad/s), and how exactly they are
    known (rad, rms); None if it does not turn evenly.

    They are ``rounded`` by so much (N,) rad, and their times by ``late`` (N,) s: whichever says less leaves it to the
    other.
    """
    since = time - time[0]
    slope, zero = np.polyfit(since, angle, 1)
    line = zero + slope * since
    off = float(np.abs(angle - line).max())
    known = float(rounded.max()), abs(slope) * float(late.max())
    if off > EVEN_TURNING + 2 * float(off_by(time, rounded, late, slope).max()):
        return None
    if abs(slope - speed) * float(since[-1]) > SPEED_ACCURACY * abs(speed) * float(since[-1]) + 2 * off:
        return None
    if off <= EVEN_TURNING:
        return angle, 0.0
    return (angle, min(known[0], off) / SIGMAS) if known[0] <= known[1] else (line, off / SIGMAS)


def released_from(mechanism: Mechanism, angle: float) -> Mechanism:
    """The linkage let go at this angle (rad) of its driven body: assembled there, with no motor."""
    placed = _placed(Assembly(mechanism), np.array([[angle]]))
    drive = {"joint": mechanism.drive_joint.name, "speed": "free", "periodic_torque": mechanism.periodic_torque}
    return mechanism.replace(assembly=placed | {mechanism.driven: angle}, drive=drive)


def _placed(assembly: Assembly, inputs: np.ndarray) -> dict[str, float]:
    """Angles (rad) of the bodies where the inputs are (n_inputs, 1)."""
    u, s = assembly.coordinates(inputs), assembly.structure
    return {s.bodies[b]: float(u[i, 0] + s.held_at[b]) for i, c in enumerate(s.coordinates) for b in c.bodies if b}
