"""Where simulation and measurement disagree: stretches of crank angle in which a sensor leaves the noise floor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from compare.diagnose.fit import Data
from compare.diagnose.worth import correlation_time

WINDOWS = 36  # of a run, over which residuals are averaged
SURE = 4.5  # sigmas of a window's mean
MOST = 60  # stretches listed


@dataclass(frozen=True)
class Stretch:
    """A sensor off by ``size`` (its unit, measured minus simulated) between two crank angles (rad)."""

    run: str
    signal: str
    begin: float
    end: float
    size: float
    sigmas: float  # of the stretch's mean, correlation accounted for


def locate(data: Data, residual: np.ndarray, angles: dict[str, np.ndarray]) -> list[Stretch]:
    """Stretches where the residual (size,) is not noise, the surest first; ``angles`` are the runs' crank angles (N,) rad."""
    found = []
    for part in data.parts:
        run = data.measured.runs[part.run]
        r, sigma, theta = residual[part.place], data.sigma[part.place], angles[run.name][part.used]
        if r.size < 2:
            continue
        windows = np.array_split(np.arange(r.size), min(WINDOWS, r.size))
        whiteness = _own_correlation(r)
        z = np.array([r[w].mean() * math.sqrt(w.size / whiteness) for w in windows])
        sign = np.where(np.abs(z) > SURE, np.sign(z), 0)
        k = 0
        while k < len(windows):
            last = k
            while sign[k] and last + 1 < len(windows) and sign[last + 1] == sign[k]:
                last += 1
            if sign[k]:
                at = np.concatenate(windows[k : last + 1])
                mean = float(r[at].mean())
                sure = abs(mean) * math.sqrt(at.size / whiteness)
                found.append(Stretch(run.name, part.signal, float(theta[at[0]]), float(theta[at[-1]]), mean * float(sigma[0]), sure))
            k = last + 1
    return sorted(found, key=lambda s: -s.sigmas)[:MOST]


def _own_correlation(r: np.ndarray) -> float:
    """Correlation time of a residual's noise, its slow part taken away by windows' means."""
    rough = np.concatenate([w - w.mean() for w in np.array_split(r, min(WINDOWS, r.size))])
    return correlation_time(rough) if rough.any() else 1.0
