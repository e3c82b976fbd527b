"""Where a sensor saturates: equal extreme readings in a row that no turning point, rest or coarse sensor would show."""

from __future__ import annotations

import numpy as np

from compare.diagnose.data.quality import FLOOR, noise
from compare.recorded.quantum import quantum

PLATEAU = 4  # equal extreme samples in a row that a clipped sensor shows
STAYS = 0.25  # of the samples beside it that read as the one before: they climb stairs, and a plateau is one of them
DEGREE = 4  # of the polynomial that says how a signal would have gone on
BESIDE = 24  # samples on either side of a plateau that tell whether it is clipped


def clipped(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, list[float]]:
    """Samples (N,) bool at a level where the sensor saturates, and its levels, of which it may have one at either end.

    Equal extreme readings in a row are a clipped peak if the noise beside them would have made them differ, or if the
    signal comes and goes at a slope that carries it further than its rounding there; a rest, a turning point, or a peak
    of a coarse sensor, is none.
    """
    here = np.flatnonzero(np.isfinite(values))
    x = values[here]
    mask, levels = np.zeros(values.shape, bool), list[float]()
    if here.size < 2 * PLATEAU or np.ptp(x) == 0:
        return mask, levels
    plateaus = {extreme: _plateaus(x == extreme) for extreme in (x.max(), x.min())}
    flat = np.zeros(x.shape, bool)
    for first, last in (run for runs in plateaus.values() for run in runs):
        flat[first : last + 1] = True
    if np.sum(~flat) < 2 * PLATEAU:
        return mask, levels
    for extreme, runs in plateaus.items():
        if any(_saturates(time[here], x, flat, *run) for run in runs):
            levels.append(float(extreme))
            at = np.flatnonzero(x == extreme)
            mask[here[np.clip(np.concatenate([at - 1, at, at + 1]), 0, here.size - 1)]] = True
    return mask, levels


def _saturates(time: np.ndarray, x: np.ndarray, flat: np.ndarray, first: int, last: int) -> bool:
    """Whether a plateau of x (N,) is no turning point, by the noise and the rounding of the samples beside it."""
    sides = [
        side[~flat[side]]
        for side in (np.arange(max(0, first - BESIDE), first), np.arange(last + 1, min(x.size, last + 1 + BESIDE)))
    ]
    sides = [side for side in sides if side.size >= 2 * PLATEAU] or [np.flatnonzero(~flat)]
    sigma = min(noise(time[side], x[side]) for side in sides)
    near = np.unique(np.append(x[np.concatenate(sides)], x[first]))
    near = near[np.argsort(np.abs(near - x[first]))][: 2 * PLATEAU]
    step = max(
        quantum(near), float(np.min(np.abs(np.diff(near))))
    )  # a file of six digits is coarser at a high reading than at a low one
    stays = np.mean(
        np.concatenate([np.diff(x[side]) == 0 for side in sides])
    )  # values computed from counts lie unevenly
    if sigma > max(step, 10 * FLOOR * np.ptp(x)) and stays < STAYS:
        return True
    limit = max(2 * step, 3 * sigma)
    if (
        min(first, x.size - 1 - last) < PLATEAU
    ):  # at an end of the record a rest looks the same, but for the noise that a sensor at rest has
        noisy = sigma > 10 * max(quantum(x[~flat]), FLOOR * float(np.ptp(x)))
        return bool(noisy and stays < STAYS and _leaves(time, x, first, last) > limit)
    beyond, weight = _beyond(time, x, first, last)
    return beyond > limit * max(1.0, weight)


def _leaves(time: np.ndarray, x: np.ndarray, first: int, last: int) -> float:
    """How far a signal that goes on at the slope at the one edge of a plateau is beyond it in its middle."""
    after = (
        np.arange(last + 1, min(x.size, last + 1 + 2 * PLATEAU))
        if first < PLATEAU
        else np.arange(max(0, first - 2 * PLATEAU), first)
    )
    if after.size < PLATEAU:
        return 0.0
    edge = last if first < PLATEAU else first
    slope = np.polyfit((time[after] - time[edge]) / (time[last] - time[first]), x[after] - x[edge], 2)[1]
    return abs(float(slope)) / 2


def _plateaus(equal: np.ndarray) -> list[tuple[int, int]]:
    """First and last sample of each run of at least PLATEAU true ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(np.int8)))
    return [(first, end - 1) for first, end in edges.reshape(-1, 2).tolist() if end - first >= PLATEAU]


def _beyond(time: np.ndarray, x: np.ndarray, first: int, last: int) -> tuple[float, float]:
    """How far a signal would have gone beyond a plateau, and how many sigmas of the samples beside it one of that is.

    It is the less of two: a parabola with the slopes at both edges (0 for what comes hard and rests, as at a stop), and
    a polynomial of degree 4 through both sides, as flat as a pendulum turns at the top.
    """
    m = min(max(PLATEAU, (last - first) // 2), first, x.size - 1 - last)
    before, after, inside = np.arange(first - m, first), np.arange(last + 1, last + 1 + m), np.arange(first, last + 1)
    around = np.concatenate([before, after])
    middle, half = (time[after[-1]] + time[before[0]]) / 2, (time[after[-1]] - time[before[0]]) / 2
    s, y = (time - middle) / half, (x - x[first]) * np.sign(x[first] - np.mean(x[around]))
    come, go = (float(np.polyfit(s[side] - s[edge], y[side], 2)[1]) for side, edge in ((before, first), (after, last)))
    weights = np.vander(s[inside], DEGREE + 1) @ np.linalg.pinv(np.vander(s[around], DEGREE + 1))
    over = weights @ y[around]
    k = int(np.argmax(over))
    if come < 0 or go > 0:
        return 0.0, 1.0
    return min(float(over[k]), (come - go) * float(s[last] - s[first]) / 8), float(np.linalg.norm(weights[k]))
