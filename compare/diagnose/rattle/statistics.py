"""What of a run survives chaos: how a sensor's readings are spread in each part of a revolution, over revolutions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from analytic.mechanism.one_line import count
from analytic.mechanism.signals import wrapped
from compare.diagnose.data.recording import Measured, MeasuredRun
from compare.diagnose.rattle.turns import Turns

QUANTILES = np.array([0.1, 0.25, 0.5, 0.75, 0.9])
GROUPS = 8  # of revolutions, at most, that are left out in turn
SEED = 1  # of the noise that is added to simulated readings
DEEP = 5.0  # of the noise: forces up to that are told apart as they are, larger ones by their ratio
PEAK = 3.0 / 0.6745  # of the median: what stands out like that is a peak
LEAST_SPREAD = 0.02  # of a logarithm: how far what is told of blows is apart at least
ALIKE = 1.6  # times how far two recordings of one rig are apart: statistics that are explained

Key = tuple[str, str]  # run and signal
Readings = Sequence[Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class Spread:
    """The readings of each sensor less what is foretold without clearance, as quantiles (bins, 5) in SI by run and
    signal: of all revolutions, and with each group of revolutions left out.  Rows of :func:`blows` follow those of an
    accelerometer.
    """

    whole: Mapping[Key, np.ndarray]
    less: Sequence[Mapping[Key, np.ndarray]]


@dataclass(frozen=True)
class Statistics:
    """How readings of all runs are spread, and how far one recording's are from another's.

    ``foretold`` are the readings (N,) by signal that deviations are taken from; ``turns`` the runs' revolutions by name
    and ``sensors`` what is judged of each; ``measured`` is the recording itself and ``floor`` by sensor how far two
    recordings of one rig are apart in its quantiles and, of an accelerometer, in its blows.
    """

    data: Measured
    foretold: Readings
    turns: Mapping[str, Turns]
    sensors: Mapping[str, Sequence[str]]
    measured: Spread = field(init=False, repr=False)
    floor: Mapping[Key, Sequence[float]] = field(init=False)

    def __post_init__(self) -> None:
        own = [{s: c.raw for s, c in run.channels.items()} for run in self.data.runs]
        object.__setattr__(self, "measured", self.spread(own, simulated=False))
        odd, even = (self._quantiles(self._deviations(own, None), half) for half in (self._half(1), self._half(0)))
        floor = {}
        for key in odd:
            sizes = [float(np.mean(np.abs(part))) / math.sqrt(2) for part in self._parts(key, odd[key], even[key])]
            floor[key] = [max(size, least) for size, least in zip(sizes, (1e-12, LEAST_SPREAD), strict=False)]
        object.__setattr__(self, "floor", floor)

    def _half(self, rest: int) -> dict[str, list[int]]:
        return {name: list(range(rest, each.count, 2)) for name, each in self.turns.items()}

    @property
    def revolutions(self) -> int:
        """Of all runs together."""
        return sum(each.count for each in self.turns.values())

    @property
    def groups(self) -> int:
        """Of revolutions, that are left out in turn."""
        return min(GROUPS, *(each.count for each in self.turns.values()))

    def says(self) -> str:
        """By what kind of evidence it is that something is named."""
        return f"from statistics over {count(self.revolutions, 'revolution')}"

    def spread(self, readings: Readings, simulated: bool = True) -> Spread:
        """Of readings by run; to ``simulated`` ones the sensors' noise is added.  A run may be told in part: NaN."""
        noise = np.random.default_rng(SEED) if simulated else None
        off = self._deviations(readings, noise)
        left_out = [
            {name: [t for t in range(each.count) if t % self.groups != g] for name, each in self.turns.items()}
            for g in range(self.groups)
        ]
        return Spread(self._quantiles(off, None), [self._quantiles(off, kept) for kept in left_out])

    def _deviations(self, readings: Readings, noise: np.random.Generator | None) -> dict[Key, np.ndarray]:
        found = {}
        for run, read, foretold in zip(self.data.runs, readings, self.foretold, strict=True):
            for signal in self.sensors.get(run.name, ()):
                channel, values = run.channels[signal], np.asarray(read[signal], float)
                if noise is not None:
                    values = values + channel.noise * noise.standard_normal(values.size)
                off = values - foretold[signal]
                found[run.name, signal] = wrapped(off) if channel.signal.wraps else off
        return found

    def _quantiles(
        self, off: Mapping[Key, np.ndarray], kept: Mapping[str, Sequence[int]] | None
    ) -> dict[Key, np.ndarray]:
        tables = {name: each.table(None if kept is None else kept[name]) for name, each in self.turns.items()}
        found = {key: quantiles(values, tables[key[0]]) for key, values in off.items()}
        for key, values in off.items():
            if self._run(key[0]).channels[key[1]].signal.unit == "m/s^2":
                chosen = range(self.turns[key[0]].count) if kept is None else kept[key[0]]
                found[key] = np.vstack([found[key], blows(self.turns[key[0]].folded_known(values, chosen))])
        return found

    def told(self, key: Key, quantiles: np.ndarray) -> np.ndarray:
        """Quantiles as they are compared: a position's over its noise; what jumps so that peaks, which no contact law
        is known well enough for, count by their ratio.  Rows of blows are so already.
        """
        channel, bins = self._run(key[0]).channels[key[1]], self.turns[key[0]].bins
        if not self.jumps(key):
            return quantiles / channel.noise
        told = np.arcsinh(quantiles[:bins] / (self._usual(key) + DEEP * channel.noise))
        return np.vstack([told, quantiles[bins:]])

    def _parts(self, key: Key, one: np.ndarray, other: np.ndarray) -> list[np.ndarray]:
        """What is told of two recordings apart (n,): in quantiles, and of an accelerometer in blows."""
        apart, bins = self.told(key, one) - self.told(key, other), self.turns[key[0]].bins
        return [known for part in (apart[:bins], apart[bins:]) if (known := part[np.isfinite(part)]).size]

    @property
    def places(self) -> list[Key]:
        """The sensors of positions."""
        return [key for key in self.floor if not self.jumps(key)]

    def jumps(self, key: Key) -> bool:
        """Whether what a sensor reads jumps where a pin strikes: forces, accelerations, strains, rates; all but
        positions, which alone are off in proportion to a clearance.
        """
        return self._run(key[0]).channels[key[1]].signal.unit not in ("m", "rad")

    def _usual(self, key: Key) -> float:
        """The usual size of what a sensor reads without clearance."""
        index = [run.name for run in self.data.runs].index(key[0])
        return float(np.median(np.abs(self.foretold[index][key[1]])))

    def _run(self, name: str) -> MeasuredRun:
        return next(run for run in self.data.runs if run.name == name)

    def apart(self, other: Mapping[Key, np.ndarray], own: Mapping[Key, np.ndarray]) -> dict[Key, float]:
        """How far quantiles are from each other, by sensor, over how far two recordings of one rig are; of an
        accelerometer the geometric mean of that and of the same of its blows.
        """
        found = {}
        for key, floor in self.floor.items():
            parts = zip(self._parts(key, other[key], own[key]), floor, strict=False)
            sizes = [max(float(np.mean(np.abs(part))) / f, 1e-6) for part, f in parts]
            found[key] = math.exp(float(np.mean(np.log(sizes))))
        return found

    def off_by(self, other: Mapping[Key, np.ndarray], own: Mapping[Key, np.ndarray]) -> dict[Key, np.ndarray]:
        """What quantiles, and blows, are off others, (n,) by sensor, over how far two recordings of one rig are
        apart.
        """
        return {
            key: np.concatenate([p / f for p, f in zip(self._parts(key, other[key], own[key]), floor, strict=False)])
            for key, floor in self.floor.items()
        }

    def distances(self, spread: Spread) -> list[dict[Key, float]]:
        """How far simulated readings are from the measured ones, by sensor: of all revolutions, and with each group
        left out of both.
        """
        pairs = zip(spread.less, self.measured.less, strict=True)
        return [self.apart(spread.whole, self.measured.whole), *(self.apart(s, m) for s, m in pairs)]

    def reaches(self, spread: Spread) -> list[dict[Key, tuple[float, float]]]:
        """How far measured and simulated readings reach from what is foretold without clearance, by sensor: sums of
        what is told of all quantiles; of all revolutions, and with each group left out of both.
        """
        pairs = [(spread.whole, self.measured.whole), *zip(spread.less, self.measured.less, strict=True)]
        return [{key: (self._reach(key, m), self._reach(key, s)) for key in self.floor} for s, m in pairs]

    def _reach(self, key: Key, quantiles: Mapping[Key, np.ndarray]) -> float:
        return float(np.nansum(np.abs(self.told(key, quantiles[key]))))

    def gap(self, readings: Readings) -> float:
        """How far simulated readings are from the measured ones, as the geometric mean over sensors; 1 is how far two
        recordings of one rig are.
        """
        return math.exp(float(np.mean(np.log(list(self.gaps(readings).values())))))

    def gaps(self, readings: Readings) -> dict[Key, float]:
        """The same by sensor."""
        return self.apart(self.simulated(readings), self.measured.whole)

    def off(self, signal: str, readings: Readings) -> float | None:
        """How far simulated quantiles of a sensor are from the measured ones (rms, SI); None where it is not judged."""
        found = self.simulated(readings)
        each = [
            (found[key] - self.measured.whole[key])[: self.turns[key[0]].bins].ravel()
            for key in self.floor
            if key[1] == signal
        ]
        return float(np.sqrt(np.nanmean(np.concatenate(each) ** 2))) if each else None

    def simulated(self, readings: Readings) -> dict[Key, np.ndarray]:
        """Quantiles of simulated readings, to which the sensors' noise is added."""
        return self._quantiles(self._deviations(readings, np.random.default_rng(SEED)), None)


def quantiles(values: np.ndarray, table: np.ndarray) -> np.ndarray:
    """QUANTILES (bins, 5) of values (N,) at the indices of each row (bins, most), -1 for none; NaN of no values."""
    sorted_ = np.sort(np.where(table < 0, np.nan, values[table]), axis=1)
    last = np.sum(np.isfinite(sorted_), axis=1) - 1
    at = QUANTILES * np.maximum(last, 0)[:, None]
    low = np.floor(at).astype(int)
    high = np.minimum(low + 1, np.maximum(last, 0)[:, None])
    row = np.arange(table.shape[0])[:, None]
    return np.asarray(sorted_[row, low] + (at - low) * (sorted_[row, high] - sorted_[row, low]))


def blows(each: np.ndarray) -> np.ndarray:
    """What blows make of deviations (count, n) at even phases of some revolutions, as logarithms in rows of five, NaN
    beyond the last: their rms, the root of their kurtosis, their peaks in a revolution, and the rms of each octave of
    their spectrum from once a revolution on.
    """
    size, square = np.abs(each), float(np.mean(each**2))
    inner = size[:, 1:-1]
    peaks = (inner >= size[:, :-2]) & (inner > size[:, 2:]) & (inner > PEAK * np.median(size))
    power = np.mean(np.abs(np.fft.rfft(each, axis=1)) ** 2, axis=0)[1:]
    first = 2 ** np.arange(int(math.log2(power.size)) + 1) - 1
    octaves = np.add.reduceat(power, first) / np.diff([*first, power.size])
    with np.errstate(divide="ignore", invalid="ignore"):
        shape = np.log([square, np.mean(each**4) / np.square(square), (1 + np.sum(peaks) / len(each)) ** 2, *octaves])
    told = np.where(np.isfinite(shape), shape / 2, math.nan)
    return np.concatenate([told, np.full(-told.size % len(QUANTILES), math.nan)]).reshape(-1, len(QUANTILES))
