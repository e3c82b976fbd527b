"""The integration loop of :func:`analytic.beyond_paper.freedom.swing`, compiled by numba once and kept on disk.

``table`` holds the coefficients of a linkage's freedom over a revolution, (7 + 2 n, points + 3): one neighbour before
the first and two after the last.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

FASTEST = math.pi / 2  # rad a step: what turns faster has run away, and no step of it is followed any more
MOST_RESTS = 4  # of the crank within a step, at most
SECANTS = 2  # to the moment at which the crank is at rest


@njit
def between(table: np.ndarray, c: int, theta: float) -> float:
    """Coefficient c at a crank angle (rad): the cubic through four neighbours."""
    points = table.shape[1] - 3
    at = (theta - 2 * math.pi * math.floor(theta / (2 * math.pi))) * (points / (2 * math.pi))
    i = min(int(at), points - 1)
    u = at - i
    before, here, after, beyond = table[c, i], table[c, i + 1], table[c, i + 2], table[c, i + 3]
    curve = before - 2.5 * here + 2 * after - beyond / 2 + u * (1.5 * (here - after) + (beyond - before) / 2)
    return here + u * ((after - before) / 2 + u * curve)


@njit
def resting(table: np.ndarray, theta: float) -> float:
    """Torque (N.m) that the linkage at rest needs, its springs wound up by the turns so far."""
    wound = between(table, 5, theta)
    return between(table, 4, theta) + (math.floor(theta / (2 * math.pi)) * wound if wound != 0 else 0.0)


@njit
def friction(table: np.ndarray, theta: float, omega: float) -> float:
    """Size (N.m) of the dry friction that a crank turns against."""
    size = between(table, 3, theta)
    for c in range(7, table.shape[0], 2):
        size += between(table, c, theta) * math.exp(-((between(table, c + 1, theta) * omega) ** 2))
    return size


@njit
def direction(table: np.ndarray, theta: float, omega: float, push: float) -> float:
    """Sign of the motion, or of the one to come under a push (N.m); 0 where friction holds the crank."""
    if omega != 0:
        return math.copysign(1.0, omega)
    rest = resting(table, theta) - push
    return 0.0 if abs(rest) <= friction(table, theta, 0.0) else -math.copysign(1.0, rest)


@njit
def acceleration(table: np.ndarray, theta: float, omega: float, way: float, push: float) -> float:
    """Acceleration (rad/s^2) of the free crank under a push (N.m), friction against ``way``."""
    m, half, damping = between(table, 0, theta), between(table, 1, theta), between(table, 2, theta)
    if not m > 0:
        return np.nan  # no linkage has such an inertia
    damped = (damping + between(table, 6, theta) * abs(omega)) * omega
    return (push - half * omega**2 - damped - friction(table, theta, omega) * way - resting(table, theta)) / m


@njit(cache=True)
def coefficient(table: np.ndarray, c: int, theta: np.ndarray) -> np.ndarray:
    """Coefficient c at crank angles (N,) rad."""
    return np.array([between(table, c, angle) for angle in theta])


@njit(cache=True)
def accelerations(table: np.ndarray, theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Accelerations (N,) rad/s^2 of the free crank in states (N,) rad and rad/s."""
    out = np.zeros(theta.size)
    for k in range(theta.size):
        way = direction(table, theta[k], omega[k], 0.0)
        if way != 0:
            out[k] = acceleration(table, theta[k], omega[k], way, 0.0)
    return out


@njit
def step(
    table: np.ndarray, theta: float, omega: float, way: float, h: float, push: float, slope: float
) -> tuple[float, float]:
    """One step of Runge-Kutta over h (s) under a push (N.m) that grows by ``slope`` (N.m/s)."""
    middle, end = push + h / 2 * slope, push + h * slope
    a1 = acceleration(table, theta, omega, way, push)
    w2 = omega + h / 2 * a1
    a2 = acceleration(table, theta + h / 2 * omega, w2, way, middle)
    w3 = omega + h / 2 * a2
    a3 = acceleration(table, theta + h / 2 * w2, w3, way, middle)
    w4 = omega + h * a3
    a4 = acceleration(table, theta + h * w3, w4, way, end)
    return theta + h / 6 * (omega + 2 * w2 + 2 * w3 + w4), omega + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


@njit
def move(table: np.ndarray, theta: float, omega: float, h: float, push: float, slope: float) -> tuple[float, float]:
    """Angle and rate h (s) later; the step is parted where the crank comes to rest."""
    for _ in range(MOST_RESTS):
        way = direction(table, theta, omega, push)
        if way == 0:
            return theta, 0.0
        there, speed = step(table, theta, omega, way, h, push, slope)
        if speed * way >= 0 or omega == 0:
            return there, speed
        part = h * omega / (omega - speed)
        for _ in range(SECANTS):
            there, speed = step(table, theta, omega, way, part, push, slope)
            part *= omega / (omega - speed)
        part = min(part, h)
        theta, omega, h = step(table, theta, omega, way, part, push, slope)[0], 0.0, h - part
        push += part * slope
    return theta, omega


@njit(cache=True)
def integrate(
    tables: np.ndarray,
    which: np.ndarray,
    start: np.ndarray,
    time: np.ndarray,
    ends: np.ndarray,
    longest: np.ndarray,
    push: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill ``out`` (3, N) with angles, rates and accelerations of P motions, one after the other: of the linkage
    ``which`` (P,), released at ``start`` (P, 2), at the times (N,) s from ``ends[p]`` to ``ends[p + 1]``.  Steps are of
    ``longest`` (P,) s or less; a motion is NaN from where it diverges.  At those times it is pushed by ``push`` (N,)
    N.m, in between along straight lines.
    """
    for p in range(which.size):
        table = tables[which[p]]
        theta, omega, now = start[p, 0], start[p, 1], 0.0
        for k in range(ends[p], ends[p + 1]):
            count = math.ceil((time[k] - now) / longest[p] - 1e-9) if time[k] > now else 0
            h = (time[k] - now) / count if count else longest[p]
            before = push[k - 1] if count and k > ends[p] else push[k]
            slope = (push[k] - before) / (count * h) if count else 0.0
            for n in range(count):
                theta, omega = move(table, theta, omega, h, before + n * h * slope, slope)
            now = time[k]
            if not abs(omega) * longest[p] < FASTEST:
                out[:, k : ends[p + 1]] = np.nan
                break
            way = direction(table, theta, omega, push[k])
            out[0, k], out[1, k] = theta, omega
            out[2, k] = acceleration(table, theta, omega, way, push[k]) if way != 0 else 0.0
