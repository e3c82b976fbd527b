"""The step that a column's numbers are multiples of: a converter's, an encoder's counts, or the decimals of a file."""

from __future__ import annotations

import numpy as np

# parts of the smallest difference between two values that may be the step of a converter: no value need be one step
# from another
STEP_SHARES = 12
STEP_ACCURACY = 1e-6  # relative, by which the steps of a converter may miss being multiples of the smallest
MOST_RAMP_STEPS = 5000.0  # steps, from one sample of a ramp to the next, that are still told
CLIMBS = 4  # stairs, at least, by which their height is known
ESTIMATED_FROM = 50_000  # samples that noise is estimated from


def quantum(values: np.ndarray) -> float:
    """The step that all values are multiples apart of (a converter's, an encoder's counts, or the decimals in a file);
    0 if there is none.
    """
    present = values[np.isfinite(values)]
    present = present[stretches(present.size)]
    levels = np.sort(present)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-12 * np.max(np.abs(levels), initial=0.0)]
    if gaps.size == 0:
        return 0.0
    step = 0.0
    for share in range(1, STEP_SHARES + 1):
        multiples = gaps * share / gaps.min()
        if np.mean(np.abs(multiples - np.round(multiples)) < STEP_ACCURACY * multiples) > 0.9:
            step = float(gaps.min()) / share
            break
    ramp = gaps.max() < 1.5 * step and np.unique(present).size == present.size
    if ramp or step == 0:  # an encoder's gaps at constant speed are its speed's, of which its counts are a share
        step = _shared(gaps, 1e-12 * float(np.max(np.abs(levels))))
    return step if ramp else max(step, _stair(present, step))


def _shared(gaps: np.ndarray, exact: float) -> float:
    """The step that all gaps (N,) are multiples of within ``exact``, as those of 26 and of 27 counts are of one; 0 if
    they are all the same, or multiples of none that is worth its name.
    """
    step = least = float(gaps.min())
    for size in gaps.tolist():
        rest = abs(size - step * round(size / step))
        while rest > 10 * exact:  # Euclid's
            step, rest = rest, abs(step - rest * round(step / rest))
        if times := round(size / step):
            step = size / times  # what the numbers are off by would grow from gap to gap
        if step < least / MOST_RAMP_STEPS:
            return 0.0
    return step if step < least / 1.5 else 0.0


def _stair(present: np.ndarray, step: float) -> float:
    """The height of the stairs that a slow signal climbs one by one, even if decimals (of ``step``, or 0) blur it; 0 if
    it climbs none.
    """
    climbed = np.abs(np.diff(present))
    climbs = climbed > step / 2
    edge = np.concatenate([[False], climbs, [False]])
    alone = climbs & ~edge[:-2] & ~edge[2:]
    heights = climbed[alone]
    if heights.size < CLIMBS or np.sum(alone) < 0.9 * np.sum(climbs):
        return 0.0
    height = float(np.median(heights))
    return height if np.mean(np.abs(heights - height) < 0.1 * height) > 0.9 else 0.0


def stretches(n: int) -> np.ndarray:
    """Indices of all of n samples, or of ESTIMATED_FROM of them in a hundred stretches."""
    if n <= ESTIMATED_FROM:
        return np.arange(n)
    length = ESTIMATED_FROM // 100
    return (np.linspace(0, n - length, 100).astype(int)[:, None] + np.arange(length)).ravel()
