"""Everything measured as one vector, each sample over its noise, be that white, of a colour, or shared by sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal, wrapped
from compare.diagnose.data.recording import Measured, MeasuredRun
from compare.diagnose.effects.effect import landing_in

FOLDS = 6
SEGMENTS = 18  # of a run; every FOLDS-th one is held out together
SPIKE = 3.5  # of the usual size (rms) of a sensor's residual: no sample in which a crank lands is off by more
TURNS = 3  # of every run, from which on whole revolutions can be held out


@dataclass(frozen=True)
class Part:
    """The samples of one sensor in one run, within the vector of all residuals."""

    run: int
    signal: str
    used: np.ndarray  # indices of the run's samples
    place: slice


@dataclass(frozen=True)
class Colour:
    """Noise of one sensor that is not white: white and slowly wandering parts, whose next sample keeps a share of this
    one and forgets a share of what was new in it, and hum of the mains.

    ``size`` is what is new in a sample, over the noise; ``hum`` are frequencies (Hz), ``amplitude`` theirs over the
    noise.
    """

    keeps: float
    forgets: float
    size: float
    hum: tuple[float, ...] = ()
    amplitude: float = 0.0

    def innovations(self, left: np.ndarray) -> np.ndarray:
        """What each sample (N,), or row (N, k), says beyond those before it, over what is new in one."""
        if not self.keeps:
            return left / self.size
        return np.asarray(lfilter([1.0, -self.keeps], [1.0, -self.forgets], left, axis=0)) / self.size

    @property
    def total(self) -> float:
        """Its rms over the noise, hum included."""
        return math.sqrt(self.size**2 + self.wander**2 + self.amplitude**2 / 2)

    @property
    def alike(self) -> float:
        """By how much more many neighbouring samples add up than white ones of the stated noise; hum cancels."""
        return (self.size * (1 - self.forgets) / (1 - self.keeps)) ** 2

    @property
    def wander(self) -> float:
        """Rms of what the samples before one foretell of it, over the noise."""
        return self.size * (self.keeps - self.forgets) / math.sqrt(1 - self.keeps**2) if self.keeps else 0.0


class Data:
    """Everything measured as one vector, each sample over its noise.

    ``shared`` (size, k), in units of noise, are errors that samples have in common: their covariance is 1 + shared
    shared^T.  ``colours`` are those of sensors whose noise is not white, by signal.
    """

    def __init__(
        self,
        measured: Measured,
        noise: Mapping[tuple[str, str], float],
        shared: np.ndarray | None = None,
        colours: Mapping[str, Colour] | None = None,
    ) -> None:
        self.measured, self.noise = measured, noise
        encoders = {encoder.name for encoder in measured.mechanism.encoders}
        self.colours = {} if colours is None else colours
        self.parts: list[Part] = []
        values, sigma, fold = [], [], []
        at = 0
        for r, run in enumerate(measured.runs):
            segment = np.minimum(np.arange(run.time.size) * SEGMENTS // run.time.size, SEGMENTS - 1) % FOLDS
            for signal, channel in run.channels.items():
                if run.drive == "measured" and signal in encoders:
                    continue  # what the run follows cannot also judge it
                used = np.flatnonzero(np.isfinite(channel.values))
                self.parts.append(Part(r, signal, used, slice(at, at + used.size)))
                at += used.size
                values.append(channel.values[used])
                sigma.append(np.full(used.size, noise[run.name, signal]))
                fold.append(segment[used])
        self.values, self.sigma, self.fold = (np.concatenate(x) for x in (values, sigma, fold))
        self.turn = self._turns()
        wraps = {name: signal.wraps for name, signal in measured.signals.items()}
        self.turning = np.concatenate([np.full(p.used.size, wraps[p.signal]) for p in self.parts])
        self.sudden = {name: _sudden(signal) for name, signal in measured.signals.items()}
        self.size = at
        self.shared = np.zeros((at, 0)) if shared is None else shared
        self.shift = np.zeros(at)  # what an engine's differing from the model takes off the residual
        self.log_volume = 0.0  # log of the determinant of what errors in the noise add to it
        basis, spread, _ = np.linalg.svd(
            self._told(np.column_stack([self.shared, self._records()])), full_matrices=False
        )
        # whitens what the sensors' errors have in common
        self._basis, self._less = basis, 1 / np.sqrt(1 + spread**2) - 1
        self._root: np.ndarray | None = None
        self._errors: tuple[np.ndarray, np.ndarray] | None = None

    def _records(self) -> np.ndarray:
        """Columns (size, k) of what all samples of a record have in common: where its noise had wandered to when it
        began, and hum, each as large as it is.
        """
        columns = []
        for part in self.parts:
            colour = self.colours.get(part.signal)
            if colour is None:
                continue
            time = self.measured.runs[part.run].time[part.used]
            waves = [colour.wander * colour.keeps ** np.arange(time.size)] if colour.keeps else []
            for frequency in colour.hum:
                turn = 2 * np.pi * frequency * time
                waves += [colour.amplitude * np.cos(turn), colour.amplitude * np.sin(turn)]
            for wave in waves:
                columns.append(np.zeros(self.size))
                columns[-1][part.place] = wave
        return np.column_stack(columns) if columns else np.zeros((self.size, 0))

    def _told(self, residual: np.ndarray) -> np.ndarray:
        """A residual (size,), or columns (size, k), where noise has a colour as what is new in each sample."""
        if not self.colours:
            return residual
        out = residual.copy()
        for part in self.parts:
            if part.signal in self.colours:
                out[part.place] = self.colours[part.signal].innovations(residual[part.place])
        return out

    def plain(self) -> Data:
        """The same data, every sample over its noise and beside nothing else."""
        return Data(self.measured, self.noise)

    def beside(self, errors: np.ndarray) -> Data:
        """The same data, to whose noise errors (size, k) belong that change its residual by these columns."""
        other = copy(self)
        basis, spread, _ = np.linalg.svd(errors, full_matrices=False)
        other._errors = basis, 1 / np.sqrt(1 + spread**2) - 1
        other.log_volume = float(np.log1p(spread**2).sum())
        other.shift = _without(self.shift, *other._errors)
        return other

    def weighed(self, weights: np.ndarray) -> Data:
        """The same data, of which the squares of samples count so much (size,)."""
        other = copy(self)
        other._root = np.sqrt(weights)
        other.shift = self.shift * other._root
        return other

    def seen_beside(self, residual: np.ndarray) -> np.ndarray:
        """A residual (size,), or columns (size, k), as samples count, without what errors in the noise may do."""
        residual = residual if self._root is None else (residual.T * self._root).T
        return residual if self._errors is None else _without(residual, *self._errors)

    def coloured(self, colours: Mapping[str, Colour]) -> Data:
        """The same data, the noise of these sensors of these colours."""
        return Data(self.measured, self.noise, self.shared, colours)

    def _turns(self) -> np.ndarray | None:
        """Which revolution of its run (one of FOLDS, in turn) a sample (size,) is in; None where a run makes less than
        TURNS or none is known.
        """
        found = []
        for part in self.parts:
            angle = turned(self.measured.runs[part.run], self.measured.mechanism)
            if angle is None or abs(angle[-1] - angle[0]) < TURNS * 2 * np.pi:
                return None
            found.append(np.floor(np.abs(angle[part.used] - angle[0]) / (2 * np.pi)).astype(int) % FOLDS)
        return np.concatenate(found)

    def until(self, share: float) -> Data:
        """The same data without what free runs did after a share of their time."""
        runs = []
        for run in self.measured.runs:
            early = run.time <= run.time[0] + share * (run.time[-1] - run.time[0])
            cut = {s: c.at(early) for s, c in run.channels.items()}
            runs.append(
                replace(run, time=run.time[early], channels=cut) if run.drive == "free" and run.push is None else run
            )
        kept = [
            run.time[part.used] <= runs[part.run].time[-1]
            for part in self.parts
            if (run := self.measured.runs[part.run])
        ]
        return Data(
            replace(self.measured, runs=tuple(runs)),
            self.noise,
            self.shared[np.concatenate(kept)],
            self.colours,
        )

    def shifted(self, difference: np.ndarray) -> Data:
        """The same data less a difference (size,) in units of noise."""
        other = copy(self)
        other.shift = self.shift + difference
        return other

    def residual(self, readings: Sequence[Mapping[str, np.ndarray]]) -> np.ndarray:
        """(measured - predicted) / noise, (size,); angles modulo a turn.  Where the model has no answer, straight lines
        between its answers are taken.

        What a landing crank does to forces and rates nobody foretells: under a hypothesis that has one land, such a
        sample is off by no more than SPIKE times what its sensor's others are off (rms) under the same.
        """
        predicted = np.concatenate([bridged(readings[p.run][p.signal])[p.used] for p in self.parts])
        difference = self.values - predicted
        difference[self.turning] = wrapped(difference[self.turning])
        left = difference / self.sigma
        lands = self.lands(readings)
        for part in self.parts:
            if lands[part.place].any():
                left[part.place] = _spared(left[part.place], lands[part.place])
        return self.seen_beside(self._white(self._told(left))) - self.shift

    def changed(
        self, before: Sequence[Mapping[str, np.ndarray]], after: Sequence[Mapping[str, np.ndarray]]
    ) -> np.ndarray:
        """By how much (size,) readings are more than before, over their noise; angles modulo a turn."""
        each = [after[p.run][p.signal][p.used] - before[p.run][p.signal][p.used] for p in self.parts]
        change = np.concatenate(each)
        change[self.turning] = wrapped(change[self.turning])
        return change / self.sigma

    def lands(self, readings: Sequence[Mapping[str, np.ndarray]]) -> np.ndarray:
        """Which samples (size,) are of a crank that lands, by a sensor that this makes jump."""
        landing = np.zeros(self.size, bool)
        for part in self.parts:
            lands = readings[part.run].get(landing_in(part.signal))
            if lands is not None and self.sudden[part.signal]:
                landing[part.place] = lands[part.used]
        return landing

    def columns(self, changes: np.ndarray) -> np.ndarray:
        """What columns (size, k) of readings over their noise do to the residual, but for the sign."""
        return self.seen_beside(self._white(self._told(changes)))

    def _white(self, residual: np.ndarray) -> np.ndarray:
        return _without(residual, self._basis, self._less) if self._less.size else residual


def _without(residual: np.ndarray, basis: np.ndarray, less: np.ndarray) -> np.ndarray:
    """A residual (size,), or columns (size, k), of which directions (size, m) count less."""
    return np.asarray(residual + basis @ ((basis.T @ residual).T * less).T)


def _sudden(signal: Signal) -> bool:
    """Whether an impact makes a signal jump."""
    return signal.kind in ("reaction", "drive", "rate") or signal.on_request


def _spared(left: np.ndarray, landing: np.ndarray) -> np.ndarray:
    """A sensor's residual (N,), no larger than usual times SPIKE where a crank lands (N,) bool."""
    others = left[~landing]
    most = SPIKE * max(1.0, math.sqrt(float(np.mean(others**2)))) if others.size else math.inf
    return np.where(landing, np.clip(left, -most, most), left)


def turned(run: MeasuredRun, mechanism: Mechanism) -> np.ndarray | None:
    """The angle (N,) rad of the crank in a driven run as commanded, or as its encoder has it; None where neither is, or
    no crank turns.
    """
    if run.drive == "speed" and run.speed is not None:
        return run.speed * run.time
    if run.drive == "free" or not mechanism.cranked or mechanism.encoder.name not in run.channels:
        return None
    return bridged(run.channels[mechanism.encoder.name].values)


def cycles(run: MeasuredRun, mechanism: Mechanism) -> np.ndarray | None:
    """How many cycles (N,) a driven run has made: turns of its crank, or ways of its first motor to and fro, of whole
    ones (-1 before and after); None of less than two, or where that is not known.
    """
    angle = turned(run, mechanism)
    if angle is not None and abs(angle[-1] - angle[0]) >= 4 * np.pi:
        return np.asarray(np.abs(angle - angle[0]) / (2 * np.pi))
    encoder = mechanism.encoders[0].name if mechanism.drives else ""
    if run.drive == "free" or encoder not in run.channels:
        return None
    place = bridged(run.channels[encoder].values)
    share = (place - place.min()) / max(float(np.ptp(place)), 1e-300)
    ends = np.flatnonzero(np.abs(share - 0.5) > 0.25)  # its outer quarters, which noise does not cross twice
    upper = share[ends] > 0.5
    begun = ends[1:][upper[1:] & ~upper[:-1]]
    if begun.size < 3:
        return None
    return np.interp(np.arange(place.size), begun, np.arange(begun.size), left=-1.0, right=-1.0)


def bridged(values: np.ndarray) -> np.ndarray:
    """Values (N,) with straight lines across NaN; without any number, a huge one that nothing fits."""
    known = np.isfinite(values)
    if known.all():
        return values
    if not known.any():
        return np.full(values.shape, 1e12)
    at = np.arange(values.size)
    return np.interp(at, at[known], values[known])
