"""Where simulation and measurement disagree: stretches of crank angle in which a sensor leaves the noise floor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby

import numpy as np

from analytic.mechanism.signals import Signal
from compare.diagnose.data.recording import Measured
from compare.diagnose.noise import correlation_time, rms
from compare.diagnose.residuals import Data

WINDOWS = 36  # of a run or of a turn, over which residuals are averaged
TURNS = 3  # of a run, from which on what comes back with the crank's angle is told by the angle
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
    time: tuple[float, float] | None  # s, at which it begins and ends; None where it is there in every turn


def locate(
    data: Data,
    residual: np.ndarray,
    angles: Mapping[str, np.ndarray],
    spread: Mapping[tuple[str, str], float] | None = None,
) -> list[Stretch]:
    """Stretches where the residual (size,) is not noise, the surest first; ``angles`` are the runs' crank angles (N,)
    rad.  In runs of some turns first what every turn shows, then what else there is.

    ``spread`` (SI), by run and signal, is what the engines differ by: a stretch that is not larger is none.
    """
    found = []
    for part in data.parts:
        run = data.measured.runs[part.run]
        r, sigma, theta = residual[part.place], data.sigma[part.place], angles[run.name][part.used]
        if r.size < 2:
            continue
        unit, least = run.channels[part.signal].signal.unit, (spread or {}).get((run.name, part.signal), 0.0)
        bins = _turned(theta)
        if bins:
            for first, last, mean, sure in _stretches(r, bins):
                begin, end = (math.tau / len(bins) * k for k in (first, last + 1))
                if abs(size := mean * float(sigma[0])) > least:
                    found.append(Stretch(run.name, part.signal, begin, end, size, unit, sure, None))
            r = _less_means(r, bins)
        windows = np.array_split(np.arange(r.size), min(WINDOWS, r.size))
        for first, last, mean, sure in _stretches(r, windows):
            a, b = windows[first][0], windows[last][-1]
            when = float(run.time[part.used[a]]), float(run.time[part.used[b]])
            if abs(size := mean * float(sigma[0])) > least:
                found.append(Stretch(run.name, part.signal, float(theta[a]), float(theta[b]), size, unit, sure, when))
    return sorted(found, key=lambda s: -s.sigmas)[:MOST]


def _turned(theta: np.ndarray) -> list[np.ndarray]:
    """The samples in each stretch of the crank's angle, whichever turn they are in; none of a crank that makes few
    turns, or turns back.
    """
    turns = float(theta[-1] - theta[0]) / math.tau
    if abs(turns) < TURNS or np.any(np.diff(theta) * turns < 0):
        return []
    count = max(1, min(WINDOWS, int(theta.size / abs(turns))))
    at = np.minimum((theta % math.tau / math.tau * count).astype(int), count - 1)
    bins = [np.flatnonzero(at == k) for k in range(count)]
    return bins if all(b.size for b in bins) else []


def _stretches(r: np.ndarray, windows: Sequence[np.ndarray]) -> Iterator[tuple[int, int, float, float]]:
    """First and last window of each stretch of a residual (N,) that is not noise, its mean there, and its sigmas.

    Windows that are not in the samples' order are those of a turn: they go around, and are counted on beyond the last.
    """
    rough = _less_means(r, windows)
    whiteness = correlation_time(rough) if rough.any() else 1.0
    z = np.array([r[w].mean() * math.sqrt(w.size / whiteness) for w in windows])
    sign, n = np.where(np.abs(z) > SURE, np.sign(z), 0), len(windows)
    around = not np.array_equal(np.concatenate(windows), np.arange(r.size))
    start = next((k for k in range(n) if sign[k] != sign[k - 1]), 0) if around else 0
    for _, group in groupby(range(start, start + n), lambda k: sign[k % n]):
        alike = list(group)
        if sign[alike[0] % n]:
            at = np.concatenate([windows[k % n] for k in alike])
            mean = float(r[at].mean())
            yield alike[0], alike[-1], mean, abs(mean) * math.sqrt(at.size / whiteness)


def _less_means(r: np.ndarray, windows: Sequence[np.ndarray]) -> np.ndarray:
    """A residual (N,) less its means over windows."""
    out = r.copy()
    for w in windows:
        out[w] -= r[w].mean()
    return out


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
