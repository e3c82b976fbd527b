"""The motion behind an encoder's readings: the natural cubic smoothing spline, its smoothness by generalised
cross-validation.

Of all curves g that miss the readings as much, the spline has the least integral of g''^2 (Reinsch, Numer. Math. 10,
1967); with gamma its second derivatives, (R + lam Q'Q) gamma = Q'y and g = y - lam Q gamma.  The cross-validation is
Craven's and Wahba's (Numer. Math. 31, 1979). Time is counted in median sample intervals, so that nothing depends on its
unit, and lam is sought over all its decades: a search that starts in one place (SciPy's) ends in a straight line
through a motion that turns quickly.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import LinAlgError, solveh_banded

from compare.diagnose.data.quality import quantum

DECADES = np.linspace(
    -6.0, 10.0, 49
)  # log10 of lam: from every reading kept to what moves within about 2000 samples only
# random directions in which the freedom that a spline leaves to the readings is measured; all of fewer samples than FEW
PROBES = 8
FEW = 100
STAIRS = 0.5  # of the rms of rounding: a spline that misses its readings by less follows the stairs of the counts


class Smoother:
    """Smoothing splines on one clock: times (N,), increasing, N >= 5, in any unit."""

    def __init__(self, time: np.ndarray) -> None:
        self.time = time
        step = np.diff(time) / np.median(np.diff(time))
        inverse = 1 / step
        self._q = inverse[:-1], -inverse[:-1] - inverse[1:], inverse[1:]
        a, b, c = self._q
        self._stiff, self._rough = (
            np.zeros((3, time.size - 2)),
            np.zeros((3, time.size - 2)),
        )  # upper bands of R and of Q'Q
        self._stiff[2], self._stiff[1, 1:] = (step[:-1] + step[1:]) / 3, step[1:-1] / 6
        self._rough[2], self._rough[1, 1:], self._rough[0, 2:] = (
            a**2 + b**2 + c**2,
            b[:-1] * a[1:] + c[:-1] * b[1:],
            c[:-2] * a[2:],
        )

    def taken(self, values: np.ndarray, lam: float) -> np.ndarray:
        """What the spline of this lam takes away from values (N,) or (N, k)."""
        a, b, c = (q.reshape(-1, *[1] * (values.ndim - 1)) for q in self._q)
        bend = solveh_banded(self._rough + self._stiff / lam, a * values[:-2] + b * values[1:-1] + c * values[2:])
        out = np.zeros_like(values)
        out[:-2] += a * bend
        out[1:-1] += b * bend
        out[2:] += c * bend
        return out

    def lam(self, values: np.ndarray) -> float:
        """The smoothness that predicts left-out readings (N,) best; where that follows the stairs of coarse counts, the
        most that they allow.
        """
        n = values.size
        probes = np.eye(n) if n <= FEW else np.random.default_rng(0).choice([-1.0, 1.0], (n, PROBES))
        found = []
        for lam in 10**DECADES:
            try:
                left = self.taken(np.column_stack([values, probes]), float(lam))
            except LinAlgError:  # as smooth as numbers can have it on this clock
                break
            free = float(np.sum(probes * left[:, 1:]) / np.sum(probes**2))
            found.append((float(np.mean(left[:, 0] ** 2)), float(np.max(np.abs(left[:, 0]))), free))
        miss, worst, free = np.transpose(found)
        best, count = int(np.argmin(miss / free**2)), quantum(values)
        if miss[best] < STAIRS**2 * count**2 / 12:
            best = max(best, *np.flatnonzero((miss <= count**2 / 12) & (worst <= count)).tolist())
        return float(10 ** DECADES[best])

    def spline(self, values: np.ndarray, lam: float | None = None) -> CubicSpline:
        """The spline through values (N,), over the times of the clock."""
        return CubicSpline(
            self.time, values - self.taken(values, self.lam(values) if lam is None else lam), bc_type="natural"
        )
