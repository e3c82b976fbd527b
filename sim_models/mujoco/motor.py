"""The motor of a driven run in MuJoCo: at constant speed, or along a course that it follows exactly.

At constant speed an armature that no reaction slows is enough, if over minutes it is put back now and then.  On a
course an actuator pushes that armature with its own inertia times an acceleration, which is an activation of the
actuator: a constant, or linear in time over a step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim_models.common.start import Course
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.state import advance

BESIDE = 0.01  # rad, about, that a motor turns between the instants whose equilibria give the rates of a steady start
AROUND = np.arange(-2, 3)  # those instants at constant speed, where the motion has a past
AHEAD = np.arange(7)  # and on a course, which has none
BEND = 0.05  # of the time in which a course's acceleration changes: no longer between two instants
STRAIGHT = 1e-6  # of BESIDE: a turn by acceleration that is nothing but rounding
AS_BEFORE = 1e-5  # of its largest rate: a course that repeats itself, but for the ends of its spline
SAMPLES = 100  # of a course that may repeat itself
ROUNDING = 1e-9  # of a course's time
ASIDE = 1e-7  # rad: how far reactions may move a motor's armature at constant speed, in minutes, before it is put back
STANDSTILL = 1e-9  # of a course's largest rate or acceleration: nothing


@dataclass(frozen=True)
class Motor:
    """How a motor moves, and how it begins.

    ``instants`` and ``angles`` (n,) are times (s, since the start) and the motor's angles (rad) then, close to the
    start, which is number ``here`` of them.  ``direction`` is the sign of the rate at the start, or of the rate to
    come; 0 for a motor that stands.
    """

    angles: np.ndarray
    instants: np.ndarray
    here: int
    direction: float
    fastest: float  # rad/s, at any time
    begin: float = 0.0  # s
    course: Course | None = None

    @classmethod
    def at_speed(cls, theta: float, speed: float, begin: float = 0.0) -> Motor:
        """Constant speed (rad/s), beginning at the angle theta (rad) and a time (s)."""
        return cls(theta + AROUND * BESIDE, AROUND * BESIDE / speed, 2, math.copysign(1.0, speed), abs(speed), begin)

    @classmethod
    def along(cls, course: Course) -> Motor:
        """Along a course, from its first time on."""
        knots = course.spline.x
        times = np.sort(np.concatenate([knots, (knots[1:] + knots[:-1]) / 2]))
        rate, acceleration, jerk = (float(np.abs(course.spline(times, order)).max()) for order in (1, 2, 3))
        apart = float(knots[-1] - knots[0]) / (2 * AHEAD.size)
        if rate:
            apart = min(apart, BESIDE / rate)
        if acceleration * apart**2 > STRAIGHT * BESIDE:
            apart = min(apart, BEND * acceleration / jerk) if jerk else apart
        instants = apart * AHEAD
        begin = float(knots[0])
        leading = [
            x
            for x, peak in ((course.rate(begin), rate), (course.acceleration(begin), acceleration))
            if abs(x) > STANDSTILL * peak
        ]
        direction = math.copysign(1.0, leading[0]) if leading else 0.0
        return cls(course.spline(begin + instants), instants, 0, direction, rate, begin, course)

    @cached_property
    def period(self) -> float | None:
        """Time (s) in which the motor turns once, if it then turns as before; None if it does not."""
        if self.course is None:
            return 2 * math.pi / self.fastest
        if self.direction == 0:
            return None
        spline, end = self.course.spline, float(self.course.spline.x[-1])
        once = np.sort(spline.solve(float(spline(self.begin)) + self.direction * 2 * math.pi))
        once = once[(once > self.begin) & (once - self.begin < (end - self.begin) * (1 + ROUNDING))]
        if not once.size:
            return None
        again = np.linspace(once[0], max(end, once[0]), SAMPLES)
        change = spline(again, 1) - spline(again - once[0] + self.begin, 1)
        return float(once[0]) - self.begin if np.abs(change).max() < AS_BEFORE * self.fastest else None

    @property
    def speed(self) -> float:
        """Rate (rad/s) at the start."""
        return self.direction * self.fastest if self.course is None else self.course.rate(self.begin)

    def turn(self, link: MujocoLinkage, time: float, count: int) -> None:
        """Take steps from this time (s) on."""
        m, d = link.model, link.data
        if self.course is None:
            advance(link, count)
            return
        h = m.opt.timestep
        times = time + h * np.arange(-1, count + 1)
        x = self.course.spline(times)
        if link.stepped:  # semi-implicit Euler: each rate is that between two positions
            d.qvel[link.motor] = (x[1] - x[0]) / h
            push, slope = np.diff(x, 2) / h**2, np.zeros(count)
        else:  # the cubic with the course's angle and rate at either end of the step, which RK4 integrates exactly
            x, v = x[1:], self.course.spline(times[1:], 1)
            mean = np.diff(x) / h
            push, slope = (6 * mean - 4 * v[:-1] - 2 * v[1:]) / h, (6 * (v[:-1] + v[1:]) - 12 * mean) / h**2
        acceleration, jerk = d.act, d.ctrl[-1:]
        for now, change in zip(push.tolist(), slope.tolist(), strict=True):
            acceleration[0], jerk[0] = now, change
            advance(link, 1)

    def place(self, link: MujocoLinkage, time: float, lag: float) -> None:
        """Put the motor where it should be at this time (s), its velocity being ``lag`` (s) older; at constant speed,
        if it is ASIDE.
        """
        if self.course is None:
            angle = float(self.angles[self.here]) + self.speed * (time - self.begin) if self.fastest else 0.0
            if self.fastest and abs(link.data.qpos[link.motor] - angle) > ASIDE:
                link.data.qpos[link.motor], link.data.qvel[link.motor] = angle, self.speed
            return
        d, acceleration = link.data, self.course.acceleration(time)
        d.qpos[link.motor], d.act[0], d.ctrl[-1] = self.course.angle(time), acceleration, 0.0
        d.qvel[link.motor] = self.course.rate(time) - lag * acceleration
