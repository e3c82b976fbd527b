"""How sure a value is as which changes single samples leap: in chi^2 it has no parabola but a staircase.

Of backlash a sample in which the crank flies leaps as it lands, and how hard it lands nobody foretells.  One such
sample more or less is no evidence, and the curvature of chi^2 at one of its steps says nothing of the staircase.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import median_filter

from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.residuals import SPIKE

SHARES = np.linspace(0.6, 1.6, 21)  # of a value, at which chi^2 is looked at
LOOKS = 3  # each closer at what the one before leaves
STEPS = 20  # of a closer look, at least
CHI2_95 = 3.84  # of chi^2: 95 % of one number


def plausible(fitter: Fitter, fit: Fit, i: int, weights: np.ndarray) -> tuple[float, float]:
    """The smallest and the largest share of the i-th term's value that explains the data as well as the best does, but
    for a leap as large as those between them, or as one landing seen by every sensor.
    """
    landing = SPIKE**2 * len({part.signal for part in fitter.data.parts})
    shares, sizes = _staircase(fitter, fit, i, weights, SHARES)
    first, last = _within(sizes, CHI2_95 + landing)
    for _ in range(LOOKS - 1):
        shares, sizes = _staircase(fitter, fit, i, weights, _closer(shares[max(first - 1, 0) : last + 2]))
        first, last = _within(sizes, CHI2_95 + landing)
    steps = np.diff(sizes)
    leaps = np.abs(steps - median_filter(steps, 3, mode="nearest"))
    largest = float(leaps[first:last].max(initial=0.0))
    most = CHI2_95 + (min(largest, landing) if largest > CHI2_95 else 0.0)
    first, last = _within(sizes, most)
    limit = sizes.min() + most
    low, high = float(shares[first]), float(shares[last])
    if first > 0:
        low = float(np.interp(limit, sizes[[first, first - 1]], shares[[first, first - 1]]))
    if last < sizes.size - 1:
        high = float(np.interp(limit, sizes[[last, last + 1]], shares[[last, last + 1]]))
    return min(1.0, low), max(1.0, high)


def _staircase(
    fitter: Fitter, fit: Fit, i: int, weights: np.ndarray, shares: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Those of some shares of the i-th term's value that are possible, and chi^2 there, to which no sample adds more
    than one in which a crank lands may.
    """
    points = [[x * share if k == i else x for k, x in enumerate(fit.x)] for share in shares]
    found = fitter.residuals(fit.terms, points)
    told = [np.clip(np.sqrt(weights) * r, -SPIKE, SPIKE) for r in found if r is not None]
    return shares[[r is not None for r in found]], np.array([float(r @ r) for r in told])


def _closer(shares: np.ndarray) -> np.ndarray:
    """These shares, and as many evenly between each two as make the steps enough."""
    between = shares.size - 1
    each = math.ceil(STEPS / max(between, 1))
    return np.interp(np.arange(between * each + 1) / each, np.arange(shares.size), shares)


def _within(sizes: np.ndarray, most: float) -> tuple[int, int]:
    """The first and the last of the sizes that are no larger than the smallest by so much."""
    inside = np.flatnonzero(sizes <= sizes.min() + most)
    return int(inside[0]), int(inside[-1])
