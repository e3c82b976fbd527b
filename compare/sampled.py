"""What a sampled number does between its samples: ends of parabolas, integrals."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

UNEVEN = 0.2  # of how a signal bends at a peak: where it bends by so much more or less beside it, it is no parabola
EVEN = 1e-9  # by which steps of an angle (rad) or a time (s) may differ that are even; of a step: rounding error


def vertices(around: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of a curve through values (N + 4,) evenly apart, two of them before the first and two after the last, by the
    parabola through each (N,) and its neighbours: how far its end is, in steps, the value there, and 1 of a highest,
    -1 of a lowest, 0 where there is none near by: the curve goes on, jumps or has a corner.
    """
    before, here, after = around[1:-3], around[2:-2], around[3:-1]
    bends = np.diff(around, 2)
    slope, bend = (after - before) / 2, bends[1:-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(np.abs(slope) > EVEN * np.abs(bend), -slope / bend, 0.0)
        other = np.maximum(np.abs(bends[:-2] - bend), np.abs(bends[2:] - bend))
        near = (other < UNEVEN * np.abs(bend)) & (np.abs(share) <= 0.5)
        return share, here + slope * share / 2, np.where(near, -np.sign(bend), 0.0)


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
