"""A linkage's one freedom in tables over the crank angle, and many such linkages released side by side.

The drive torque that a motion needs is

    M(theta) alpha + M'(theta)/2 omega^2 + c(theta) omega + f(theta) sign(omega) + g(theta).

Its five coefficients follow from kinetostatics at six states of each crank angle, once; springs that a turn of the
crank winds up make g larger by h(theta) with each turn; a free motion is then a small
ordinary differential equation, which is integrated for all linkages of a batch at the same time.  At rest friction
holds whatever is no larger than itself: |g| <= f.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism.one_line import count, one_line
from analytic.paper.kinetostatics import kinetostatics

POINTS = 720  # of a table over a revolution


@dataclass(frozen=True)
class Freedom:
    """Coefficients over a revolution, (6, POINTS): M, M'/2, c, f, g at crank angles 2 pi i / POINTS, and h, by which g
    grows with each turn.
    """

    table: np.ndarray

    def __repr__(self) -> str:
        return one_line(self, count(self.table.shape[1], "crank angle"))

    @classmethod
    def of(cls, assembly: Assembly) -> Freedom:
        """The freedom of a linkage whose crank turns fully.  Raises AssemblyError where it does not."""
        theta = np.arange(POINTS) * 2 * math.pi / POINTS
        first = coefficients(assembly, theta)
        wound = np.zeros(POINTS)
        if any(joint.stiffness for joint in assembly.mechanism.joints):
            wound = coefficients(assembly, theta + 2 * math.pi)[4] - first[4]
        return cls(np.vstack([first, wound]))

    def inertia(self, theta: np.ndarray) -> np.ndarray:
        """M (kg.m^2) at crank angles (N,) rad."""
        from analytic.beyond_paper.swing_loop import coefficient

        return np.asarray(coefficient(padded(self.table), 0, np.ascontiguousarray(theta, float)))

    def acceleration(self, theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """Acceleration (rad/s^2) of the free crank at angles theta (N,) rad and rates omega (N,) rad/s."""
        from analytic.beyond_paper.swing_loop import accelerations

        state = (np.ascontiguousarray(theta, float), np.ascontiguousarray(omega, float))
        return np.asarray(accelerations(padded(self.table), *state))


def padded(table: np.ndarray) -> np.ndarray:
    """A table (6, POINTS) with one neighbour before the first and two after the last, wound up by the turn between."""
    before, after = table[:, -1:].copy(), table[:, :2].copy()
    before[4] -= before[5]
    after[4] += after[5]
    return np.ascontiguousarray(np.concatenate([before, table, after], axis=1))


def coefficients(assembly: Assembly, theta: np.ndarray) -> np.ndarray:
    """M, M'/2, c, f, g (5, N) at crank angles theta (N,) rad.  Raises AssemblyError where the linkage does not reach
    them.
    """
    omega, alpha = np.array([0.0, 0.0, 1.0, -1.0, 2.0, -2.0]), np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    states = np.tile(theta, omega.size), np.repeat(omega, theta.size), np.repeat(alpha, theta.size)
    g, pushed, ahead, astern, faster, reverse = kinetostatics(kinematics(assembly, *states)).drive_torque.reshape(
        omega.size, -1
    )
    once, twice = (ahead - astern) / 2, (faster - reverse) / 2
    return np.array([pushed - g, (ahead + astern) / 2 - g, twice - once, 2 * once - twice, g])


def swing(
    freedoms: Sequence[Freedom], start: np.ndarray, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (P, N) rad, rates (P, N) rad/s and accelerations (P, N) of P linkages released at ``start`` (P, 2), at
    times (N,) s from 0.

    Runge-Kutta of fourth order, at most 1 ms and one degree a step; a step in which the crank comes to rest is parted
    there, where friction turns with it or holds it.  A motion that diverges is NaN from there on.
    """
    from analytic.beyond_paper.swing_loop import integrate  # which takes a second to compile

    tables = np.stack([padded(f.table) for f in freedoms])  # (P, 6, POINTS + 3)
    start = np.ascontiguousarray(start, float)
    longest = min(1e-3, math.radians(1.0) / max(1.0, float(np.abs(start[:, 1]).max())))
    out = np.empty((3, len(freedoms), time.size))
    integrate(tables, start, np.ascontiguousarray(time, float), longest, out)
    return out[0], out[1], out[2]
