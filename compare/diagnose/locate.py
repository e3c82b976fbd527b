"""Where simulation and measurement disagree: stretches of crank angle in which a sensor leaves the noise floor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from analytic.mechanism.signals import Signal
from compare.diagnose.data.recording import Measured
from compare.diagnose.noise import correlation_time, rms
from compare.diagnose.residuals import Data

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
    unit: str  # SI
    sigmas: float  # of the stretch's mean, correlation accounted for
    time: tuple[float, float]  # s, at which it begins and ends


def locate(
    data: Data,
    residual: np.ndarray,
    angles: Mapping[str, np.ndarray],
    spread: Mapping[tuple[str, str], float] | None = None,
) -> list[Stretch]:
    """Stretches where the residual (size,) is not noise, the surest first; ``angles`` are the runs' crank angles (N,)
    rad.

    ``spread`` (SI), by run and signal, is what the engines differ by: a stretch that is not larger is none.
    """
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
            at = np.concatenate(windows[k : last + 1])
            mean = float(r[at].mean())
            size = mean * float(sigma[0])
            if sign[k] and abs(size) > (spread or {}).get((run.name, part.signal), 0.0):
                sure = abs(mean) * math.sqrt(at.size / whiteness)
                begin, end, unit = float(theta[at[0]]), float(theta[at[-1]]), run.channels[part.signal].signal.unit
                time = run.time[part.used[at[[0, -1]]]]
                when = float(time[0]), float(time[1])
                found.append(Stretch(run.name, part.signal, begin, end, size, unit, sure, when))
            k = last + 1
    return sorted(found, key=lambda s: -s.sigmas)[:MOST]


def spread(
    measured: Measured, said: Mapping[str, Sequence[Mapping[str, np.ndarray]]]
) -> dict[tuple[str, str], tuple[float, str]]:
    """Largest rms difference (SI) between two engines' readings, and which two, by run and signal."""
    found = {}
    for r, run in enumerate(measured.runs):
        for signal, channel in run.channels.items():
            pairs = [
                (rms_difference(channel.signal, said[a][r][signal], said[b][r][signal]), f"{a} and {b}")
                for a, b in combinations(said, 2)
            ]
            found[run.name, signal] = max(pairs, default=(0.0, ""))
    return found


def rms_difference(signal: Signal, a: np.ndarray, b: np.ndarray) -> float:
    """Root mean square of the difference between two readings (N,) of a signal, angles modulo a turn."""
    difference = signal.apart(a, b)
    return rms(difference[np.isfinite(difference)])


def _own_correlation(r: np.ndarray) -> float:
    """Correlation time (samples) of a residual's noise, after its means over windows are taken off."""
    rough = np.concatenate([w - w.mean() for w in np.array_split(r, min(WINDOWS, r.size))])
    return correlation_time(rough) if rough.any() else 1.0
