"""The colour of a sensor's noise: what wanders slowly, or hums with the mains, and does not come back with the crank.

Of what a fit leaves, a linkage's own faults repeat with the crank's angle; that is taken out first.  What stays is
noise if a white and a slowly wandering part (an autoregressive one of first order), beside hum, describe all of it, if
no two sensors share it, and if it is not rather a repeating part that grows (a link that warms up, a belt that slips).
Then each sample counts for what it says beyond those before it (generalised least squares); otherwise it is left as it
is, a disagreement.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from compare.diagnose.residuals import Colour, Data, Part, turned

TURNS = 1.5  # of every run, from which on what repeats with the crank can be told from what does not
HARMONICS = 10
GROWING = 3  # harmonics of a repeating part that grows
FEWEST = 60  # samples of a record
MAINS = (50.0, 60.0)  # Hz
HUM = 30.0  # of chi^2, that a mains frequency must bring
GAINED = 30.0  # of -2 log likelihood, that a colour must bring
LINE = 1e-4  # chance of as sharp a line in white noise
ALIKE = 6.0  # sigmas of the correlation between two sensors' noise that is none
SLOW = (0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999)  # what a wandering part keeps from sample to sample
SHARES = (0.0, 0.3, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99)


@dataclass(frozen=True)
class _Record:
    """What a fit leaves of one sensor in one run (N,), in units of noise, without what repeats with the crank."""

    part: Part
    left: np.ndarray
    time: np.ndarray
    angle: np.ndarray  # of the crank, rad
    repeating: np.ndarray  # (N, k) columns of what repeats with it


def colours(data: Data, residual: np.ndarray) -> dict[str, Colour]:
    """The colours of the sensors' noise by signal, as a fit's residual (size,) shows them; of those that are not
    white.
    """
    records: dict[str, list[_Record]] = {}
    for part in data.parts:
        record = _unrepeated(data, part, residual[part.place])
        if record is None:
            return {}
        records.setdefault(part.signal, []).append(record)
    found = {signal: colour for signal, each in records.items() if (colour := _colour(each)) is not None}
    return {signal: colour for signal, colour in found.items() if not _alike(signal, found, records)}


def _unrepeated(data: Data, part: Part, residual: np.ndarray) -> _Record | None:
    run = data.measured.runs[part.run]
    angle = turned(run, data.measured.mechanism)
    if angle is None or part.used.size < FEWEST:
        return None
    angle = angle[part.used]
    if np.ptp(angle) < TURNS * 2 * np.pi:
        return None
    most = min(HARMONICS, part.used.size // 20)
    repeating = np.column_stack([np.ones(angle.size), _waves(angle, most)])
    return _Record(part, _beside(repeating, residual), run.time[part.used], angle, repeating)


def _waves(angle: np.ndarray, most: int) -> np.ndarray:
    """Cosines and sines (N, 2 most) of the first harmonics of an angle (N,) rad."""
    turns = np.outer(angle, np.arange(1, most + 1))
    return np.column_stack([np.cos(turns), np.sin(turns)])


def _beside(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What columns (N, k) leave of values (N,)."""
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _colour(records: Sequence[_Record]) -> Colour | None:
    """The colour of one sensor's noise; None where it is white, or not noise alone."""
    hum = tuple(f for f in MAINS if sum(_power(r, f) / _white(r) for r in records) > HUM * len(records))
    rest = [_without(r, hum) for r in records]
    samples = sum(r.left.size - r.repeating.shape[1] - 2 * len(hum) for r in records)
    plain = sum(float(left @ left) for left in rest)
    tried = [
        (sum(_squares(left, keeps, keeps * share) for left in rest), keeps, keeps * share)
        for keeps in SLOW
        for share in SHARES
    ]
    least, keeps, forgets = min(tried)
    if samples * math.log(plain / least) < GAINED:
        keeps = forgets = 0.0
        least = plain
    if keeps == 0.0 and not hum:
        return None
    size = max(1.0, math.sqrt(least / samples))
    if any(_line(Colour(keeps, forgets, 1.0).innovations(left)) for left in rest):
        return None
    if keeps and _grows(records, keeps, forgets, hum):
        return None
    amplitude = max((math.sqrt(2 * _power(r, f) / r.left.size) for r in records for f in hum), default=0.0)
    return Colour(keeps, forgets, size, hum, amplitude)


def _white(record: _Record) -> float:
    """Mean square of the white part of what is left, as it differs from sample to sample; the noise's at least."""
    return max(1.0, float(np.var(np.diff(record.left))) / 2)


def _power(record: _Record, frequency: float) -> float:
    """Decrease of the sum of squares by a sine of a frequency (Hz)."""
    columns = _sine(record.time, frequency)
    return float(np.sum((record.left @ np.linalg.qr(columns)[0]) ** 2))


def _sine(time: np.ndarray, frequency: float) -> np.ndarray:
    turn = 2 * np.pi * frequency * time
    return np.column_stack([np.cos(turn), np.sin(turn)])


def _without(record: _Record, hum: Sequence[float]) -> np.ndarray:
    left = record.left
    for frequency in hum:
        basis = np.linalg.qr(_sine(record.time, frequency))[0]
        left = left - basis @ (basis.T @ left)
    return left


def _squares(left: np.ndarray, keeps: float, forgets: float) -> float:
    told = Colour(keeps, forgets, 1.0).innovations(left)
    return float(told @ told)


def _line(left: np.ndarray) -> bool:
    """Whether white noise would hardly have as sharp a line."""
    power = np.abs(np.fft.rfft(left - left.mean())[1:-1]) ** 2
    return bool(power.size and power.max() / power.mean() > math.log(power.size / LINE))


def _grows(records: Sequence[_Record], keeps: float, forgets: float, hum: Sequence[float]) -> bool:
    """Whether a repeating part that grows with time, evenly or ever less, and white noise tell more of what is left
    than a colour does, by Schwarz's criterion.
    """
    samples = sum(r.left.size for r in records)
    for degree in (1, 2):
        wandering = growing = 0.0
        for r in records:
            elapsed = ((r.time - r.time.mean()) / np.ptp(r.time))[:, None]
            waves = _waves(r.angle, GROWING)
            powers = [elapsed**k for k in range(1, degree + 1)]
            steady = np.column_stack([r.repeating, *powers, *(_sine(r.time, f) for f in hum)])
            wandering += _squares(_beside(steady, r.left), keeps, forgets)
            grown = _beside(np.column_stack([steady, *(power * waves for power in powers)]), r.left)
            growing += float(grown @ grown)
        numbers = 2 * GROWING * degree * len(records)
        if samples * math.log(wandering / growing) > numbers * math.log(samples):
            return True
    return False


def _alike(signal: str, found: Mapping[str, Colour], records: Mapping[str, Sequence[_Record]]) -> bool:
    """Whether another sensor's noise of the same run is correlated with this one's: then it is no noise."""
    for first, second in combinations(found, 2):
        if signal not in (first, second):
            continue
        for one in records[first]:
            for other in records[second]:
                if one.part.run == other.part.run and np.array_equal(one.part.used, other.part.used):
                    a, b = (found[s].innovations(_without(r, found[s].hum)) for r, s in ((one, first), (other, second)))
                    if abs(np.corrcoef(a, b)[0, 1]) * math.sqrt(a.size) > ALIKE:
                        return True
    return False
