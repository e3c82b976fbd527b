"""What a sampled number does between its samples: ends of parabolas, integrals."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

EVEN = 1e-9  # by which steps of an angle (rad) or a time (s) may differ that are even


def vertices(before: np.ndarray, here: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where parabolas through values (N,) and their neighbours on either side, evenly apart, have their ends: how far
    from here, in steps, and the values there.
    """
    slope, bend = (after - before) / 2, before + after - 2 * here
    with np.errstate(divide="ignore", invalid="ignore"):
        share = -slope / bend
        return share, here + slope * share / 2


def integral(values: np.ndarray, x: np.ndarray) -> float:
    """Of values (N,) over x (N,), by Simpson's rule wherever neighbours are evenly apart."""
    steps = np.diff(x)
    ends = [0, *(np.flatnonzero(np.abs(np.diff(steps)) > EVEN) + 1).tolist(), steps.size]
    total = 0.0
    for first, last in pairwise(ends):
        even = last - (last - first) % 2
        inner = 4 * values[first + 1 : even : 2].sum() + 2 * values[first + 2 : even : 2].sum()
        total += steps[first] / 3 * (values[first] + inner + values[even]) if even > first else 0.0
        total += steps[last - 1] * (values[last - 1] + values[last]) / 2 if last > even else 0.0
    return float(total)
