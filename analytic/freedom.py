"""A linkage's one freedom in tables over the crank angle, and many such linkages released side by side.

The drive torque that a motion needs is  M(theta) alpha + M'(theta)/2 omega^2 + c(theta) omega + f(theta) sign(omega) + g(theta).
Its five coefficients are read off kinetostatics at six states of each crank angle, once; a free motion is then a small
ordinary differential equation, which is integrated for all linkages of a batch at the same time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analytic.assembly import Assembly, AssemblyError
from analytic.kinematics import kinematics
from analytic.kinetostatics import kinetostatics

POINTS = 720  # of a table over a revolution
FASTEST = 1e6  # rad/s; beyond it a motion has left its tables


@dataclass(frozen=True)
class Freedom:
    """Coefficients over a revolution, (5, POINTS): M, M'/2, c, f, g at crank angles 2 pi i / POINTS."""

    table: np.ndarray

    @classmethod
    def of(cls, assembly: Assembly) -> Freedom:
        """The freedom of a linkage whose crank turns fully.  Raises AssemblyError where it does not."""
        theta = np.arange(POINTS) * 2 * math.pi / POINTS

        def torque(omega: float, alpha: float = 0.0) -> np.ndarray:
            return kinetostatics(kinematics(assembly, theta, omega, alpha)).drive_torque

        g = torque(0.0)
        ahead, astern = torque(1.0) - g, torque(-1.0) - g
        twice = (torque(2.0) - torque(-2.0)) / 2
        once = (ahead - astern) / 2
        return cls(np.array([torque(0.0, 1.0) - g, (ahead + astern) / 2, twice - once, 2 * once - twice, g]))


def swing(freedoms: Sequence[Freedom], start: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (P, N) rad, rates (P, N) rad/s and accelerations (P, N) of P linkages released at ``start`` (P, 2), at times (N,) s from 0.

    Runge-Kutta of fourth order, at most 4 ms and half a degree a step; friction turns from one sign to the other within the
    speed that it takes away in one step.  Raises AssemblyError where a motion diverges.
    """
    tables = np.stack([f.table for f in freedoms]).transpose(1, 0, 2)  # (5, P, POINTS)
    tables = np.concatenate([tables[..., -1:], tables, tables[..., :2]], axis=-1)
    rows = np.arange(len(freedoms))
    state = np.array(start, float).T  # (2, P)
    longest = min(4e-3, math.radians(1.0) / max(1.0, float(np.abs(state[1]).max())))

    def acceleration(theta: np.ndarray, omega: np.ndarray, band: np.ndarray) -> np.ndarray:
        at = np.mod(theta, 2 * math.pi) * (POINTS / (2 * math.pi))
        i = np.minimum(at.astype(int), POINTS - 1)
        u = at - i
        before, here, after, beyond = (tables[:, rows, i + k] for k in range(4))
        m, half, c, f, g = here + u * (
            (after - before) / 2 + u * (before - 2.5 * here + 2 * after - beyond / 2 + u * (1.5 * (here - after) + (beyond - before) / 2))
        )
        return -(half * omega**2 + c * omega + f * np.clip(omega / band, -1, 1) + g) / m

    out = np.empty((3, len(freedoms), time.size))
    now = 0.0
    slowest = np.abs(tables[3]).max(axis=-1) / np.abs(tables[0]).min(axis=-1)
    for k, t in enumerate(time.tolist()):
        count = max(1, math.ceil((t - now) / longest - 1e-9)) if t > now else 0
        h = (t - now) / count if count else longest
        band = np.maximum(slowest * h, 1e-12)
        for _ in range(count):
            theta, omega = state
            a1 = acceleration(theta, omega, band)
            w2 = omega + h / 2 * a1
            a2 = acceleration(theta + h / 2 * omega, w2, band)
            w3 = omega + h / 2 * a2
            a3 = acceleration(theta + h / 2 * w2, w3, band)
            w4 = omega + h * a3
            a4 = acceleration(theta + h * w3, w4, band)
            state = np.array([theta + h / 6 * (omega + 2 * w2 + 2 * w3 + w4), omega + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)])
        now = t
        out[:2, :, k] = state
        out[2, :, k] = acceleration(*state, band)
        if not np.all(np.abs(state[1]) < FASTEST):
            raise AssemblyError(f"a released linkage diverges at {t:g} s; check its masses, springs and loads")
    return out[0], out[1], out[2]
