"""How sure a value is as which changes single samples leap: in chi^2 it has no parabola but a staircase.

Of backlash a sample in which the crank flies leaps as it lands, and how hard it lands nobody foretells.  One such
sample more or less is no evidence, and the curvature of chi^2 at one of its steps says nothing of the staircase.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter

from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.residuals import SPIKE

SHARES = np.linspace(0.6, 1.6, 21)  # of a value, at which chi^2 is looked at
SURE = 3.84  # of chi^2: 95 % of one number


def plausible(fitter: Fitter, fit: Fit, i: int, weights: np.ndarray) -> tuple[float, float]:
    """The smallest and the largest share of the i-th term's value that explains the data as well as the best does, but
    for a leap as large as those between them, or as one landing seen by every sensor.
    """
    points = [[x * share if k == i else x for k, x in enumerate(fit.x)] for share in SHARES]
    found = fitter.residuals(fit.terms, points)
    shares = SHARES[[r is not None for r in found]]
    sizes = np.array([float(weights @ r**2) for r in found if r is not None])
    if sizes.size < 3:
        return 1.0, 1.0
    steps = np.diff(sizes)
    leaps = np.abs(steps - median_filter(steps, 3, mode="nearest"))
    landing = SPIKE**2 * len({part.signal for part in fitter.data.parts})

    first, last = _within(sizes, SURE + landing)
    largest = float(leaps[first:last].max(initial=0.0))
    most = SURE + (min(largest, landing) if largest > SURE else 0.0)
    first, last = _within(sizes, most)
    limit = sizes.min() + most
    low, high = float(shares[first]), float(shares[last])
    if first > 0:
        low = float(np.interp(limit, sizes[[first, first - 1]], shares[[first, first - 1]]))
    if last < sizes.size - 1:
        high = float(np.interp(limit, sizes[[last, last + 1]], shares[[last, last + 1]]))
    return min(1.0, low), max(1.0, high)


def _within(sizes: np.ndarray, most: float) -> tuple[int, int]:
    """The first and the last of the sizes that are no larger than the smallest by so much."""
    inside = np.flatnonzero(sizes <= sizes.min() + most)
    return int(inside[0]), int(inside[-1])
