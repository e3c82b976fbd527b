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
from compare.diagnose.residuals import Colour, Data

WINDOWS = 36  # of a run or of a turn, over which residuals are averaged
TURNS = 3  # of a run, from which on what comes back with the crank's angle is told by the angle
FEWEST_WINDOWS = 6  # windows of a turn, at least
WINDOW_SIGMAS = 4.5  # sigmas of a window's mean
MOST_STRETCHES = 60  # stretches listed


@dataclass(frozen=True)
class Stretch:
    """A sensor off by ``size`` (its unit, measured minus simulated) between two crank angles (rad; travels of a slide,
    m).
    """

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
    colours: Mapping[str, Colour] | None = None,
) -> list[Stretch]:
    """Stretches where the residual (size,) is not noise, the surest first; ``angles`` are the runs' crank angles (N,)
    rad.  In runs of some turns first what every turn shows, then what else there is.

    ``spread`` (SI), by run and signal, is what the engines differ by: a stretch that is not larger is none.
    ``colours`` are of the sensors whose noise is known not to be white.
    """
    found, turns = [], data.measured.mechanism.cranked
    for part in data.parts:
        run = data.measured.runs[part.run]
        r, theta = residual[part.place], angles[run.name][part.used]
        if r.size < 2:
            continue
        sigma, unit = float(data.sigma[part.place][0]), run.channels[part.signal].signal.unit
        least = (spread or {}).get((run.name, part.signal), 0.0)
        bins = _turned(theta) if turns else []
        for at, begin, end, sure, when in _told(r, theta, bins, run.time[part.used], (colours or {}).get(part.signal)):
            size = float(r[at].mean()) * sigma
            if abs(size) > least:
                found.append(Stretch(run.name, part.signal, begin, end, size, unit, sure, when))
    return sorted(found, key=lambda s: -s.sigmas)[:MOST_STRETCHES]


def _told(
    r: np.ndarray, theta: np.ndarray, bins: Sequence[np.ndarray], time: np.ndarray, colour: Colour | None
) -> Iterator[tuple[np.ndarray, float, float, float, tuple[float, float] | None]]:
    """The samples of each stretch of a residual (N,) that is told, between which crank angles it is, its sigmas, and
    when; None where it is there in every turn, of which ``bins`` are the stretches.
    """
    windows = _in_time(r)
    rough = without_means(without_means(r, windows), bins)
    whiteness = correlation_time(rough) if rough.any() else 1.0
    whiteness = max(whiteness, min(colour.alike, colour.total**2 * r.size / WINDOWS)) if colour else whiteness
    of_turns = np.zeros(r.size)
    for first, last, at, sure in _stretches(r, bins, whiteness):
        if _of_every_turn(r, at, theta):
            of_turns[at] = r[at].mean()
            yield at, math.tau / len(bins) * first, math.tau / len(bins) * (last + 1), sure, None
    for _, _, at, sure in _stretches(r, windows, whiteness):
        mean = float(r[at].mean())
        if abs(mean - of_turns[at].mean()) > abs(mean) / 2:
            a, b = at[0], at[-1]
            yield at, float(theta[a]), float(theta[b]), sure, (float(time[a]), float(time[b]))


def _in_time(r: np.ndarray) -> list[np.ndarray]:
    """The samples of each window of a residual (N,), one after the other."""
    return np.array_split(np.arange(r.size), min(WINDOWS, r.size))


def _turned(theta: np.ndarray) -> list[np.ndarray]:
    """The samples in each stretch of the crank's angle, whichever turn they are in; none of a crank that makes few
    turns, turns back, or is read less than a few times a turn.
    """
    turns = float(theta[-1] - theta[0]) / math.tau
    if abs(turns) < TURNS or np.any(np.diff(theta) * turns < 0):
        return []
    for count in range(min(WINDOWS, int(theta.size / abs(turns))), FEWEST_WINDOWS - 1, -1):
        at = np.minimum((theta % math.tau / math.tau * count).astype(int), count - 1)
        bins = [np.flatnonzero(at == k) for k in range(count)]
        if all(b.size for b in bins):
            return bins
    return []


def _of_every_turn(r: np.ndarray, at: np.ndarray, theta: np.ndarray) -> bool:
    """Whether most turns show what samples ``at`` the same angles show on average, and not one of them alone."""
    turn = np.floor((theta[at] - theta[at[0]]) / math.tau)
    means = [float(r[at[turn == k]].mean()) for k in np.unique(turn)]
    mean = float(r[at].mean())
    return float(np.median(means)) * np.sign(mean) > abs(mean) / 2 and float(np.std(means)) < abs(mean)


def _stretches(
    r: np.ndarray, windows: Sequence[np.ndarray], whiteness: float
) -> Iterator[tuple[int, int, np.ndarray, float]]:
    """First and last window of each stretch of a residual (N,) that is not noise, its samples, and its sigmas.

    Windows that are not in the samples' order are those of a turn: they go around, and are counted on beyond the last.
    """
    if not windows:
        return
    z = np.array([r[w].mean() * math.sqrt(w.size / whiteness) for w in windows])
    sign, n = np.where(np.abs(z) > WINDOW_SIGMAS, np.sign(z), 0), len(windows)
    around = not np.array_equal(np.concatenate(windows), np.arange(r.size))
    start = next((k for k in range(n) if sign[k] != sign[k - 1]), 0) if around else 0
    for _, group in groupby(range(start, start + n), lambda k: sign[k % n]):
        alike = list(group)
        if sign[alike[0] % n]:
            at = np.concatenate([windows[k % n] for k in alike])
            yield alike[0], alike[-1], at, abs(float(r[at].mean())) * math.sqrt(at.size / whiteness)


def without_means(r: np.ndarray, windows: Sequence[np.ndarray]) -> np.ndarray:
    """A residual (N,) less its mean over each of some windows that have all of its samples."""
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
