"""A linkage's one freedom in tables over the crank angle, and many such linkages released side by side.

The drive torque that a motion needs is  M(theta) alpha + M'(theta)/2 omega^2 + c(theta) omega + f(theta) sign(omega) + g(theta).
Its five coefficients are read off kinetostatics at six states of each crank angle, once; a free motion is then a small
ordinary differential equation, which is integrated for all linkages of a batch at the same time.  At rest friction holds whatever
is no larger than itself: |g| <= f.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.paper.kinetostatics import kinetostatics

POINTS = 720  # of a table over a revolution
FASTEST = 1e6  # rad/s; beyond it a motion has left its tables


@dataclass(frozen=True)
class Freedom:
    """Coefficients over a revolution, (5, POINTS): M, M'/2, c, f, g at crank angles 2 pi i / POINTS."""

    table: np.ndarray

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
    tables = np.stack([f.table for f in freedoms])  # (P, 5, POINTS)
    tables = np.ascontiguousarray(np.concatenate([tables[..., -1:], tables, tables[..., :2]], axis=-1))
    start = np.ascontiguousarray(start, float)
    longest = min(1e-3, math.radians(1.0) / max(1.0, float(np.abs(start[:, 1]).max())))
    out = np.empty((3, len(freedoms), time.size))
    _integrator()(tables, start, np.ascontiguousarray(time, float), longest, out)
    return out[0], out[1], out[2]


@cache
def _integrator() -> Callable[[np.ndarray, np.ndarray, np.ndarray, float, np.ndarray], None]:
    """The integration loop, compiled on first use."""
    from numba import njit

    per_radian, points, fastest = POINTS / (2 * math.pi), POINTS, FASTEST

    def between(table: np.ndarray, c: int, theta: float) -> float:
        at = (theta - 2 * math.pi * math.floor(theta / (2 * math.pi))) * per_radian
        i = min(int(at), points - 1)
        u = at - i
        before, here, after, beyond = (
            table[c, i],
            table[c, i + 1],
            table[c, i + 2],
            table[c, i + 3],
        )  # cubic through four neighbours
        curve = before - 2.5 * here + 2 * after - beyond / 2 + u * (1.5 * (here - after) + (beyond - before) / 2)
        return here + u * ((after - before) / 2 + u * curve)

    between = njit(between)

    def direction(table: np.ndarray, theta: float, omega: float) -> float:
        if omega != 0:
            return math.copysign(1.0, omega)
        friction, rest = between(table, 3, theta), between(table, 4, theta)
        return 0.0 if abs(rest) <= friction else -math.copysign(1.0, rest)

    direction = njit(direction)

    def acceleration(table: np.ndarray, theta: float, omega: float, way: float) -> float:
        m, half, damping = between(table, 0, theta), between(table, 1, theta), between(table, 2, theta)
        friction, rest = between(table, 3, theta), between(table, 4, theta)
        return -(half * omega**2 + damping * omega + friction * way + rest) / m

    acceleration = njit(acceleration)

    def step(table: np.ndarray, theta: float, omega: float, way: float, h: float) -> tuple[float, float]:
        a1 = acceleration(table, theta, omega, way)
        w2 = omega + h / 2 * a1
        a2 = acceleration(table, theta + h / 2 * omega, w2, way)
        w3 = omega + h / 2 * a2
        a3 = acceleration(table, theta + h / 2 * w2, w3, way)
        w4 = omega + h * a3
        a4 = acceleration(table, theta + h * w3, w4, way)
        return theta + h / 6 * (omega + 2 * w2 + 2 * w3 + w4), omega + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    step = njit(step)

    def move(table: np.ndarray, theta: float, omega: float, h: float) -> tuple[float, float]:
        for _ in range(4):  # rests within a step, at most
            way = direction(table, theta, omega)
            if way == 0:
                return theta, 0.0
            there, speed = step(table, theta, omega, way, h)
            if speed * way >= 0 or omega == 0:
                return there, speed
            part = h * omega / (omega - speed)
            for _ in range(2):  # secants to where the crank is at rest
                there, speed = step(table, theta, omega, way, part)
                part *= omega / (omega - speed)
            part = min(part, h)
            theta, omega, h = step(table, theta, omega, way, part)[0], 0.0, h - part
        return theta, omega

    move = njit(move)

    def integrate(tables: np.ndarray, start: np.ndarray, time: np.ndarray, longest: float, out: np.ndarray) -> None:
        for p in range(tables.shape[0]):
            table = tables[p]
            theta, omega, now = start[p, 0], start[p, 1], 0.0
            for k in range(time.size):
                count = math.ceil((time[k] - now) / longest - 1e-9) if time[k] > now else 0
                h = (time[k] - now) / count if count else longest
                for _ in range(count):
                    theta, omega = move(table, theta, omega, h)
                now = time[k]
                if not abs(omega) < fastest:
                    out[:, p, k:] = np.nan
                    break
                way = direction(table, theta, omega)
                out[0, p, k], out[1, p, k] = theta, omega
                out[2, p, k] = acceleration(table, theta, omega, way) if way != 0 else 0.0

    return njit(integrate)
