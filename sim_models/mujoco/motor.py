"""The motors of a driven run in MuJoCo: at constant speed, or along courses that they follow exactly.

At constant speed an armature that no reaction slows is enough, if over minutes it is put back now and then.  On a
course an actuator pushes that armature with its own inertia times an acceleration, which is an activation of the
actuator: a constant, or linear in time over a step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analytic.kinematics.schedule import Course, DriveMotion, Steady
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.state import advance
from sim_models.run.path import CoursePath, Path, direction

TURN_BETWEEN_INSTANTS = (
    0.01  # rad, about, that a motor turns between the instants whose equilibria give the rates of a steady start
)
INSTANTS_AROUND = np.arange(-2, 3)  # those instants at constant speed, where the motion has a past
INSTANTS_AHEAD = np.arange(7)  # and on a course, which has none
SHARE_OF_BEND = 0.05  # of the time in which a course's acceleration changes: no longer between two instants
NEGLIGIBLE_BEND = 1e-6  # of TURN_BETWEEN_INSTANTS: a turn by acceleration that is nothing but rounding
AS_BEFORE = 1e-5  # of its largest rate: a course that repeats itself, but for the ends of its spline
SHORTEST_CUBIC_STEP = 1e-3  # of the linkage's step
SAMPLES_OF_PERIOD = 100  # of a course that may repeat itself
ROUNDING_OF_TIME = 1e-9  # of a course's time
ARMATURE_DRIFT = (
    1e-7  # rad: how far reactions may move a motor's armature at constant speed, in minutes, before it is put back
)


@dataclass(frozen=True)
class Stencil:
    """Instants whose equilibria give the rates of a steady start: times (n,) s since the start, which is number
    ``here`` of them, and the places (n,) on the path then: angles (rad) of a crank's motor, or times (s) of courses.
    """

    instants: np.ndarray
    places: np.ndarray
    here: int

    @property
    def start(self) -> float:
        """The place at the start."""
        return float(self.places[self.here])


class Steering:
    """How motors' armatures are kept where their motion has them; without motors nothing is kept."""

    top_speed = 0.0  # rad/s
    stencil: Stencil

    def turn(self, link: MujocoLinkage, time: float, count: int) -> None:
        """Take steps from this time (s) on."""
        advance(link, count)

    def place(self, link: MujocoLinkage, time: float, lag: float) -> None:
        """Put the motors where they should be at this time (s), their velocity being ``lag`` (s) older."""

    def rates(self, link: MujocoLinkage, time: float) -> np.ndarray:
        """Rates (motors,) of the motors' coordinates at a time (s)."""
        return np.zeros(0)

    def passed(self, last: float, count: int) -> np.ndarray:
        """So many places on the path from the start to the time ``last`` (s); none where nothing leads along it."""
        return np.zeros(0)


class AtConstantSpeed(Steering):
    """Of a motor at constant speed, which is put back if it is ARMATURE_DRIFT."""

    def __init__(self, motor: Steady) -> None:
        self.motor, self.top_speed = motor, motor.top_speed
        theta = motor.position(motor.begin)
        self.stencil = Stencil(
            INSTANTS_AROUND * TURN_BETWEEN_INSTANTS / motor.speed, theta + INSTANTS_AROUND * TURN_BETWEEN_INSTANTS, 2
        )

    @property
    def period(self) -> float | None:
        """Time (s) in which the motor turns once, if it then turns as before; None if it does not."""
        return 2 * math.pi / self.top_speed

    def place(self, link: MujocoLinkage, time: float, lag: float) -> None:
        angle = self.motor.position(time)
        if abs(link.data.qpos[link.motor] - angle) > ARMATURE_DRIFT:
            link.data.qpos[link.motor], link.data.qvel[link.motor] = angle, self.motor.speed

    def rates(self, link: MujocoLinkage, time: float) -> np.ndarray:
        return np.array([self.motor.speed])

    def passed(self, last: float, count: int) -> np.ndarray:
        return self.motor.positions(np.linspace(self.motor.begin, last, count))


def spacing(motor: Course, size: float = 1.0) -> float:
    """Time (s) between the instants of a steady start on a course (rad; or m, of a linkage of this ``size``)."""
    top_speed, acceleration, jerk = (motor.peak(order) / size for order in (1, 2, 3))
    apart = (motor.end - motor.begin) / (2 * INSTANTS_AHEAD.size)
    if top_speed:
        apart = min(apart, TURN_BETWEEN_INSTANTS / top_speed)
    if acceleration * apart**2 > NEGLIGIBLE_BEND * TURN_BETWEEN_INSTANTS:
        apart = min(apart, SHARE_OF_BEND * acceleration / jerk) if jerk else apart
    return apart


class AlongCourses(Steering):
    """Of motors on courses, in the order of the linkage's; the path is told by their time."""

    def __init__(self, path: CoursePath) -> None:
        self.motors, self.begin, self.top_speed = [*path.motors.values()], path.begin, path.top_speed
        slides = {joint.name for joint in path.assembly.mechanism.joints if joint.prismatic}
        apart = min(spacing(each, path.size if name in slides else 1.0) for name, each in path.motors.items())
        if path.top_speed:
            apart = min(apart, TURN_BETWEEN_INSTANTS / path.top_speed)
        self.stencil = Stencil(apart * INSTANTS_AHEAD, path.begin + apart * INSTANTS_AHEAD, 0)

    def passed(self, last: float, count: int) -> np.ndarray:
        return np.linspace(self.begin, last, count)

    def rates(self, link: MujocoLinkage, time: float) -> np.ndarray:
        return self.at(link, np.array([time]), 1)[0]

    def at(self, link: MujocoLinkage, times: np.ndarray, order: int = 0) -> np.ndarray:
        """The motors' coordinates (N, motors) at times (N,) s, or their derivatives of that order."""
        return link.ways * np.column_stack([motor.positions(times, order) for motor in self.motors])

    def turn(self, link: MujocoLinkage, time: float, count: int) -> None:
        m, d = link.model, link.data
        h = m.opt.timestep
        times = time + h * np.arange(-1, count + 1)
        x = self.at(link, times)
        if link.setting.stepped:  # semi-implicit Euler: each rate is that between two positions
            d.qvel[link.motors] = (x[1] - x[0]) / h
            push, slope = np.diff(x, 2, axis=0) / h**2, np.zeros((count, len(self.motors)))
        else:  # the cubic with the course's angle and rate at either end of the step, which RK4 integrates exactly
            x, v = x[1:], self.at(link, times[1:], 1)
            mean = np.diff(x, axis=0) / h
            push, slope = (6 * mean - 4 * v[:-1] - 2 * v[1:]) / h, (6 * (v[:-1] + v[1:]) - 12 * mean) / h**2
            if h < SHORTEST_CUBIC_STEP * link.setting.step:  # so short that the cubic would be rounding
                push, slope = np.diff(v, axis=0) / h, np.zeros((count, len(self.motors)))
        acceleration, jerk = d.act, d.ctrl[-len(self.motors) :]
        for now, change in zip(push, slope, strict=True):
            acceleration[:], jerk[:] = now, change
            advance(link, 1)

    def place(self, link: MujocoLinkage, time: float, lag: float) -> None:
        d, now = link.data, np.array([time])
        acceleration = self.at(link, now, 2)[0]
        d.qpos[link.motors], d.act[:], d.ctrl[-len(self.motors) :] = self.at(link, now)[0], acceleration, 0.0
        d.qvel[link.motors] = self.at(link, now, 1)[0] - lag * acceleration


class AlongCourse(AlongCourses):
    """Of a crank's motor on a course; the path is told by its angle."""

    def __init__(self, motor: Course) -> None:
        self.motor, self.motors, self.top_speed = motor, [motor], motor.top_speed
        apart = spacing(motor)
        self.stencil = Stencil(apart * INSTANTS_AHEAD, motor.positions(motor.begin + apart * INSTANTS_AHEAD), 0)

    def passed(self, last: float, count: int) -> np.ndarray:
        return self.motor.positions(np.linspace(self.motor.begin, last, count))

    @cached_property
    def period(self) -> float | None:
        """Time (s) in which the motor turns once, if it then turns as before; None if it does not."""
        motor = self.motor
        begin, end, sign = motor.begin, motor.end, direction(motor)
        if sign == 0:
            return None
        once = np.sort(motor.spline.solve(motor.position(begin) + sign * 2 * math.pi))
        once = once[(once > begin) & (once - begin < (end - begin) * (1 + ROUNDING_OF_TIME))]
        if not once.size:
            return None
        again = np.linspace(once[0], max(end, once[0]), SAMPLES_OF_PERIOD)
        change = motor.positions(again, 1) - motor.positions(again - once[0] + begin, 1)
        return float(once[0]) - begin if np.abs(change).max() < AS_BEFORE * self.top_speed else None


def steering(motor: DriveMotion | None, path: Path) -> Steering:
    """What keeps the motor of a crank, or those of the courses that make a path, in their motion."""
    if isinstance(path, CoursePath):
        return AlongCourses(path) if path.motors else Steering()
    if motor is None:
        return Steering()
    return AtConstantSpeed(motor) if isinstance(motor, Steady) else AlongCourse(motor)
