"""A linkage's one freedom in tables over the crank angle, and many such linkages released side by side.

The drive torque that a motion needs is

    M(theta) alpha + M'(theta)/2 omega^2 + c(theta) omega + f(theta) sign(omega) + g(theta).

Its five coefficients follow from kinetostatics at six states of each crank angle, once; a free motion is then a small
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
    """Coefficients over a revolution, (5, POINTS): M, M'/2, c, f, g at crank angles 2 pi i / POINTS."""

    table: np.ndarray

    def __repr__(self) -> str:
        return one_line(self, count(self.table.shape[1], "crank angle"))

    @classmethod
    def of(cls, assembly: Assembly) -> Freedom:
        """The freedom of a linkage whose crank turns fully.  Raises AssemblyError where it does not."""
        return cls(coefficients(assembly, np.arange(POINTS) * 2 * math.pi / POINTS))


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

    tables = np.stack([f.table for f in freedoms])  # (P, 5, POINTS)
    tables = np.ascontiguousarray(np.concatenate([tables[..., -1:], tables, tables[..., :2]], axis=-1))
    start = np.ascontiguousarray(start, float)
    longest = min(1e-3, math.radians(1.0) / max(1.0, float(np.abs(start[:, 1]).max())))
    out = np.empty((3, len(freedoms), time.size))
    integrate(tables, start, np.ascontiguousarray(time, float), longest, out)
    return out[0], out[1], out[2]
