"""How noisy a residual is, and how much its samples count: less where they are noisier than stated, correlated, or
come back cycle after cycle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from analytic.mechanism.parts import TINY
from compare.diagnose.residuals import Data, cycles

CLOSED = 1.1  # of the noise floor: a gap that is closed
NOISY = 1.15  # mean square of a sensor's residual, above which it is more than its noise


def rms(residual: np.ndarray) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(residual**2))) if residual.size else 0.0


def lasting(apart: np.ndarray, nominal: np.ndarray, records: Sequence[slice]) -> np.ndarray:
    """What of an engine's difference from the analytic model (size,), over the noise, is to be taken off data whose
    noise has that of the nominal linkage (size,): of each record what is alike in both, and of the square of the rest
    what is more than the noise has.  Pins that strike and ring do so in another way after every change.
    """
    taken = np.zeros(apart.size)
    for here in records:
        alike = nominal[here] * (nominal[here] @ apart[here]) / max(nominal[here] @ nominal[here], TINY)
        rest = apart[here] - alike
        known = rms(nominal[here]) ** 2 / max(rms(rest) ** 2, TINY)
        taken[here] = alike + rest * max(0.0, 1.0 - known)
    return taken


def sample_weights(data: Data, residual: np.ndarray) -> np.ndarray:
    """What each sample's squared residual counts, (size,): one in white noise of the stated size, less in what
    is not.
    """
    out = np.ones(residual.size)
    for part in data.parts:
        r = residual[part.place]
        mean_square = float(np.mean(r**2)) if r.size else 0.0
        if mean_square > NOISY:
            run = data.measured.runs[part.run]
            cycle = cycles(run, data.measured.mechanism)
            again = 1.0 if cycle is None else recurrence(r, cycle[part.used])
            out[part.place] = 1 / (mean_square * correlation_time(r) * again)
    return out


def recurrence(r: np.ndarray, cycle: np.ndarray) -> float:
    """Cycles per independent cycle: the mean square of the mean cycle of a residual (n,), over what that of independent
    cycles would be; ``cycle`` (n,) are how many were made.
    """
    if cycle.size < 2:
        return 1.0
    whole = range(math.ceil(max(cycle.min(), 0.0)), math.floor(cycle.max() + max(np.median(np.diff(cycle)), 0.0)))
    each = [np.flatnonzero((cycle >= k) & (cycle < k + 1)) for k in whole]
    fewest = min((at.size for at in each), default=0)
    if len(each) < 2 or fewest < 2:
        return 1.0
    phase = (np.arange(fewest) + 0.5) / fewest
    folded = np.stack([np.interp(phase, cycle[at] - k, r[at]) for k, at in zip(whole, each, strict=True)])
    return max(1.0, len(each) * float(np.mean(folded.mean(axis=0) ** 2) / max(np.mean(folded**2), 1e-300)))


def correlation_time(r: np.ndarray) -> float:
    """Samples per independent sample: 1 + 2 sum of the autocorrelation up to its first zero."""
    n = r.size
    if n < 8:
        return 1.0
    spectrum = np.abs(np.fft.rfft(r, 2 * n)) ** 2
    correlation = np.fft.irfft(spectrum)[:n]
    if correlation[0] == 0:  # nothing is left at all
        return 1.0
    correlation = correlation / correlation[0]
    below = np.flatnonzero(correlation <= 0)
    return float(max(1.0, 1 + 2 * correlation[1 : int(below[0]) if below.size else n].sum()))
