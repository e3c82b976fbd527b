"""How noisy a residual is, and how much its samples count: less where they are noisier than stated, or correlated."""

from __future__ import annotations

import math

import numpy as np

from compare.diagnose.residuals import Data

CLOSED = 1.1  # of the noise floor: a gap that is closed
NOISY = 1.15  # mean square of a sensor's residual, above which it is more than its noise


def rms(residual: np.ndarray) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(residual**2))) if residual.size else 0.0


def sample_weights(data: Data, residual: np.ndarray) -> np.ndarray:
    """What each sample's squared residual counts, (size,): one in white noise of the stated size, less in what
    is not.
    """
    out = np.ones(residual.size)
    for part in data.parts:
        r = residual[part.place]
        mean_square = float(np.mean(r**2)) if r.size else 0.0
        if mean_square > NOISY:
            out[part.place] = 1 / (mean_square * correlation_time(r))
    return out


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
