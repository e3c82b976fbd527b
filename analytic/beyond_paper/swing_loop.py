"""The integration loop of :func:`analytic.beyond_paper.freedom.swing`, compiled by numba once and kept on disk.

``table`` holds the coefficients of a linkage's freedom over a revolution as cubic B-splines, (points + 3, 9 + 2 n):
one neighbour before the first and two after the last.  A motion is a chain of steps of eighth order, as long as their
own estimate of their error allows; what is asked for within one lies on a polynomial of seventh degree.  That is DOP853
of Hairer, Norsett and Wanner ("Solving Ordinary Differential Equations I", II.5 and II.6), whose numbers scipy has.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from scipy.integrate import DOP853

FASTEST = math.pi / 2  # rad in the shortest step: what turns faster has run away, and is followed no more
RUN_AWAY = 1e5  # rad that a motion may go from where it starts: what goes farther has run away, too
ERROR = 1e-11  # rad, or rad/s (of faster rates their share), that a step may err by
FARTHEST = math.radians(10.0)  # that a crank may turn in a step: no bend of a coefficient is stepped over
GROWTH, CAUTION = 5.0, 0.9  # from step to step, at most; of the step that the estimate allows
CLOSER = 4  # steps of Newton to the moment at which the crank is at rest
END, ALL = 12, 16  # the evaluation at a step's end, of all with those for what lies within
SHARES = np.zeros((ALL, ALL))  # of a step, that each evaluation takes of those before
SHARES[:END, :END], SHARES[END, :END], SHARES[END + 1 :] = DOP853.A, DOP853.B, DOP853.A_EXTRA
MOMENTS = np.concatenate([DOP853.C, [1.0], DOP853.C_EXTRA])
FIFTH, THIRD, WITHIN = DOP853.E5, DOP853.E3, DOP853.D
Look = tuple[int, float, float, float, float]


@njit
def look(table: np.ndarray, theta: float) -> Look:
    """Where a crank angle (rad) is in a table: the first of four neighbours, and their weights."""
    points = table.shape[0] - 3
    at = (theta - 2 * math.pi * math.floor(theta / (2 * math.pi))) * (points / (2 * math.pi))
    i = min(int(at), points - 1)
    u = at - i
    v, u3 = 1 - u, u**3
    return i, v**3 / 6, (3 * u3 - 6 * u**2 + 4) / 6, (3 * (u + u**2 - u3) + 1) / 6, u3 / 6


@njit
def between(table: np.ndarray, c: int, at: Look) -> float:
    """Coefficient c at a crank angle."""
    i, before, here, after, beyond = at
    return before * table[i, c] + here * table[i + 1, c] + after * table[i + 2, c] + beyond * table[i + 3, c]


@njit
def resting(table: np.ndarray, at: Look, theta: float) -> float:
    """Torque (N.m) that the linkage at rest needs, its springs wound up by the turns so far."""
    turns = theta / (2 * math.pi)
    bends = between(table, 6, at) + turns * between(table, 7, at)
    return between(table, 4, at) + turns * (between(table, 5, at) + turns * bends)


@njit
def friction(table: np.ndarray, at: Look, omega: float) -> float:
    """Size (N.m) of the dry friction that a crank turns against."""
    size = between(table, 3, at)
    for c in range(9, table.shape[1], 2):
        size += between(table, c, at) * math.exp(-((between(table, c + 1, at) * omega) ** 2))
    return size


@njit
def direction(table: np.ndarray, theta: float, omega: float, push: float) -> float:
    """Sign of the motion, or of the one to come under a push (N.m); 0 where friction holds the crank."""
    if omega != 0:
        return math.copysign(1.0, omega)
    at = look(table, theta)
    rest = resting(table, at, theta) - push
    return 0.0 if abs(rest) <= friction(table, at, 0.0) else -math.copysign(1.0, rest)


@njit
def patience(table: np.ndarray, theta: float, push: float, slope: float) -> float:
    """How long (s) friction holds a crank at rest under a push (N.m) that grows by ``slope`` (N.m/s)."""
    if slope == 0:
        return np.inf
    at = look(table, theta)
    return max((resting(table, at, theta) - push) / slope + friction(table, at, 0.0) / abs(slope), 0.0)


@njit
def acceleration(table: np.ndarray, theta: float, omega: float, way: float, push: float) -> float:
    """Acceleration (rad/s^2) of the free crank under a push (N.m), friction against ``way``."""
    at = look(table, theta)
    m = between(table, 0, at)
    if not m > 0:
        return np.nan  # no linkage has such an inertia
    damped = (between(table, 2, at) + between(table, 8, at) * abs(omega)) * omega
    bent = between(table, 1, at) * omega**2
    return (push - bent - damped - friction(table, at, omega) * way - resting(table, at, theta)) / m


@njit(cache=True)
def coefficient(table: np.ndarray, c: int, theta: np.ndarray) -> np.ndarray:
    """Coefficient c at crank angles (N,) rad."""
    return np.array([between(table, c, look(table, angle)) for angle in theta])


@njit(cache=True)
def accelerations(table: np.ndarray, theta: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Accelerations (N,) rad/s^2 of the free crank in states (N,) rad and rad/s."""
    out = np.zeros(theta.size)
    for k in range(theta.size):
        out[k] = moving(table, theta[k], omega[k], 0.0)
    return out


@njit
def moving(table: np.ndarray, theta: float, omega: float, push: float) -> float:
    """Acceleration (rad/s^2) of the free crank under a push (N.m); zero where friction holds it."""
    way = direction(table, theta, omega, push)
    return acceleration(table, theta, omega, way, push) if way != 0 else 0.0


@njit
def evaluate(
    table: np.ndarray, way: float, h: float, push: float, slope: float, at: np.ndarray, begin: int, end: int
) -> None:
    """Angles, rates and accelerations ``at`` (3, 16) of a step over h (s) under a push (N.m) that grows by ``slope``
    (N.m/s), from one to another.
    """
    for s in range(begin, end):
        there, speed = 0.0, 0.0
        for j in range(s):
            there += SHARES[s, j] * at[1, j]
            speed += SHARES[s, j] * at[2, j]
        at[0, s], at[1, s] = at[0, 0] + h * there, at[1, 0] + h * speed
        at[2, s] = acceleration(table, at[0, s], at[1, s], way, push + MOMENTS[s] * h * slope)


@njit
def step(table: np.ndarray, way: float, h: float, push: float, slope: float, at: np.ndarray) -> float:
    """One step; the estimate of its error, over what it may be."""
    evaluate(table, way, h, push, slope, at, 1, END + 1)
    worst = 0.0
    for row in range(1, 3):
        fifth, third = 0.0, 0.0
        for s in range(END + 1):
            fifth += FIFTH[s] * at[row, s]
            third += THIRD[s] * at[row, s]
        if fifth != 0:
            least = ERROR if row == 1 else ERROR * max(1.0, abs(at[1, 0]))
            worst = max(worst, h / least * fifth**2 / math.hypot(fifth, 0.1 * third))
    return worst if abs(at[2, END]) < np.inf else np.inf


@njit
def move(
    table: np.ndarray, way: float, longest: float, shortest: float, push: float, slope: float, at: np.ndarray
) -> tuple[float, float]:
    """One step, of ``longest`` (s) or as much less as its error wants, but not less than ``shortest``; it ends where
    the crank comes to rest.  How long it was, and how long the next may be.
    """
    at[2, 0], h = acceleration(table, at[0, 0], at[1, 0], way, push), longest
    while True:
        error = step(table, way, h, push, slope, at)
        allowed = h * min(GROWTH, max(1 / GROWTH, CAUTION * max(error, 1e-10) ** -0.125))
        if error <= 1 or h <= shortest:
            break
        h = max(allowed, shortest)
    omega = at[1, 0]
    if omega == 0:
        return h, allowed
    if at[2, 0] * way < 0 < at[2, END] * way and at[1, END] * way > 0:  # slowest within: at rest in between?
        u = at[2, 0] / (at[2, 0] - at[2, END])
        chord = (at[1, END] - omega) * u * u * (3 - 2 * u)
        if (omega + chord + h * u * (1 - u) * (at[2, 0] * (1 - u) - at[2, END] * u)) * way <= 0:
            h *= u
            step(table, way, h, push, slope, at)
    if at[1, END] * way < 0:
        part = h
        for n in range(CLOSER + 1):
            steep = at[2, END] if n and at[2, END] * way < 0 else (at[1, END] - omega) / part
            part = min(max(part - at[1, END] / steep, 0.0), h)
            if part == 0:
                break
            step(table, way, part, push, slope, at)
        h, at[1, END] = part, 0.0
    return h, allowed


@njit
def bent(h: float, at: np.ndarray, row: int, curve: np.ndarray) -> None:
    """The polynomial (8,) of angles (row 0) or rates (1) within a step of h (s)."""
    change = at[row, END] - at[row, 0]
    curve[0], curve[1], curve[2] = at[row, 0], change, h * at[row + 1, 0] - change
    curve[3] = 2 * change - h * (at[row + 1, 0] + at[row + 1, END])
    for n in range(4):
        curve[4 + n] = 0.0
        for s in range(ALL):
            curve[4 + n] += h * WITHIN[n, s] * at[row + 1, s]


@njit
def tell(u: float, curve: np.ndarray) -> float:
    """A polynomial at a share u of a step."""
    said = 0.0
    for n in range(7, 0, -1):
        said = (said + curve[n]) * (u if n % 2 else 1 - u)
    return curve[0] + said


@njit
def follow(
    table: np.ndarray,
    start: np.ndarray,
    time: np.ndarray,
    push: np.ndarray,
    pushed: bool,
    shortest: float,
    out: np.ndarray,
) -> None:
    """Fill ``out`` (3, N) with angles, rates and accelerations of one motion; NaN from where it runs away."""
    at, curves = np.zeros((3, ALL)), np.zeros((2, 8))
    at[0, END], at[1, END], now, ahead, k, set_off = start[0], start[1], 0.0, shortest, 0, 0.0
    while k < time.size and time[k] <= 0:
        out[0, k], out[1, k], out[2, k] = start[0], start[1], moving(table, start[0], start[1], push[k])
        k += 1
    while k < time.size:
        end = k if pushed else time.size - 1  # until then the push grows along a straight line
        left = time[end] - now
        slope = (push[end] - push[end - 1]) / (time[end] - time[end - 1]) if pushed and end and left > 0 else 0.0
        here = push[end] - slope * left
        at[0, 0], at[1, 0] = at[0, END], at[1, END]
        way = set_off if set_off != 0 else direction(table, at[0, 0], at[1, 0], here)
        if way == 0:
            h = min(left, patience(table, at[0, 0], here, slope))
            set_off = math.copysign(1.0, slope) if h < left else 0.0
            at[2] = 0.0
        else:
            set_off, far = 0.0, max(shortest, min(ahead, FARTHEST / max(abs(at[1, 0]), 1e-9)))
            h, allowed = move(table, way, min(far, left), shortest, here, slope, at)
            ahead = allowed if far <= left else max(ahead, allowed)
        if not (abs(at[1, END]) * shortest < FASTEST and abs(at[0, END] - start[0]) < RUN_AWAY):
            out[:, k:] = np.nan
            return
        now = time[end] if h >= left else now + h
        if way != 0 and time[k] < now:
            evaluate(table, way, h, here, slope, at, END + 1, ALL)
            bent(h, at, 0, curves[0])
            bent(h, at, 1, curves[1])
        while k <= end and time[k] <= now:
            u = 1 - (now - time[k]) / h if way != 0 and time[k] < now else 1.0
            there, speed = (tell(u, curves[0]), tell(u, curves[1])) if u < 1 else (at[0, END], at[1, END])
            out[0, k], out[1, k], out[2, k] = there, speed, moving(table, there, speed, push[k])
            k += 1


@njit(cache=True)
def integrate(
    tables: np.ndarray,
    which: np.ndarray,
    start: np.ndarray,
    time: np.ndarray,
    ends: np.ndarray,
    shortest: np.ndarray,
    push: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill ``out`` (3, N) with angles, rates and accelerations of P motions, one after the other: of the linkage
    ``which`` (P,), released at ``start`` (P, 2), at the times (N,) s from ``ends[p]`` to ``ends[p + 1]``.  Steps of
    ``shortest`` (P,) s are not asked for their error; a motion is NaN from where it diverges.  At those times it is
    pushed by ``push`` (N,) N.m, in between along straight lines; by nothing where that is empty.
    """
    for p in range(which.size):
        own = slice(ends[p], ends[p + 1])
        pushes = push[own] if push.size else np.zeros(ends[p + 1] - ends[p])
        follow(tables[which[p]], start[p], time[own], pushes, push.size > 0, shortest[p], out[:, own])
