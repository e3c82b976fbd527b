"""Residuals in units of noise, and the least-squares fit of a set of effects to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.signal import lfilter

from analytic.mechanism.signals import wrapped
from compare.diagnose.data.recording import Measured, MeasuredRun
from compare.diagnose.effects.effect import Rig
from compare.diagnose.least_squares import ROUGHLY, STEPS, Descent
from compare.diagnose.predict import Hypothesis, StartOfRun, Term

STEP_OF_SCALE = 1.0  # difference step, in the effects' own scales
FOLDS = 6
SEGMENTS = 18  # of a run; every FOLDS-th one is held out together
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
        encoder: str,
        shared: np.ndarray | None = None,
        colours: Mapping[str, Colour] | None = None,
    ) -> None:
        self.measured, self.noise, self.encoder = measured, noise, encoder
        self.colours = {} if colours is None else colours
        self.parts: list[Part] = []
        values, sigma, fold = [], [], []
        at = 0
        for r, run in enumerate(measured.runs):
            segment = np.minimum(np.arange(run.time.size) * SEGMENTS // run.time.size, SEGMENTS - 1) % FOLDS
            for signal, channel in run.channels.items():
                if run.drive == "measured" and signal == encoder:
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
        self.size = at
        self.shared = np.zeros((at, 0)) if shared is None else shared
        self._shift = np.zeros(0)
        basis, spread, _ = np.linalg.svd(
            self._told(np.column_stack([self.shared, self._records()])), full_matrices=False
        )
        # whitens what the sensors' errors have in common
        self._basis, self._less = basis, 1 / np.sqrt(1 + spread**2) - 1

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

    def coloured(self, colours: Mapping[str, Colour]) -> Data:
        """The same data, the noise of these sensors of these colours."""
        return Data(self.measured, self.noise, self.encoder, self.shared, colours)

    def _turns(self) -> np.ndarray | None:
        """Which revolution of its run (one of FOLDS, in turn) a sample (size,) is in; None where a run makes less than
        TURNS or none is known.
        """
        found = []
        for part in self.parts:
            angle = turned(self.measured.runs[part.run], self.encoder)
            if angle is None or abs(angle[-1] - angle[0]) < TURNS * 2 * np.pi:
                return None
            found.append(np.floor(np.abs(angle[part.used] - angle[0]) / (2 * np.pi)).astype(int) % FOLDS)
        return np.concatenate(found)

    def until(self, share: float) -> Data:
        """The same data without what free runs did after a share of their time."""
        runs = []
        for run in self.measured.runs:
            early = run.time <= run.time[0] + share * (run.time[-1] - run.time[0])
            cut = {s: replace(c, values=c.values[early]) for s, c in run.channels.items()}
            runs.append(replace(run, time=run.time[early], channels=cut) if run.drive == "free" else run)
        kept = [
            run.time[part.used] <= runs[part.run].time[-1]
            for part in self.parts
            if (run := self.measured.runs[part.run])
        ]
        return Data(
            replace(self.measured, runs=tuple(runs)),
            self.noise,
            self.encoder,
            self.shared[np.concatenate(kept)],
            self.colours,
        )

    def shifted(self, difference: np.ndarray) -> Data:
        """The same data less a difference (size,) in units of noise."""
        other = copy(self)
        other._shift = difference if not self._shift.size else self._shift + difference
        return other

    def residual(self, readings: Sequence[Mapping[str, np.ndarray]]) -> np.ndarray:
        """(measured - predicted) / noise, (size,); angles modulo a turn.  Where the model has no answer, straight lines
        between its answers are taken.
        """
        predicted = np.concatenate([bridged(readings[p.run][p.signal])[p.used] for p in self.parts])
        difference = self.values - predicted
        difference[self.turning] = wrapped(difference[self.turning])
        white = self._white(self._told(difference / self.sigma))
        return white - self._shift if self._shift.size else white

    def _white(self, residual: np.ndarray) -> np.ndarray:
        return residual + self._basis @ (self._less * (self._basis.T @ residual)) if self._less.size else residual


def turned(run: MeasuredRun, encoder: str) -> np.ndarray | None:
    """The angle (N,) rad of the crank in a driven run as commanded, or as its encoder has it; None where neither is."""
    if run.drive == "speed" and run.speed is not None:
        return run.speed * run.time
    if run.drive == "free" or encoder not in run.channels:
        return None
    return bridged(run.channels[encoder].values)


def bridged(values: np.ndarray) -> np.ndarray:
    """Values (N,) with straight lines across NaN; without any number, a huge one that nothing fits."""
    known = np.isfinite(values)
    if known.all():
        return values
    if not known.any():
        return np.full(values.shape, 1e12)
    at = np.arange(values.size)
    return np.interp(at, at[known], values[known])


@dataclass(frozen=True, eq=False)
class Fit:
    """A set of effects and the coordinates at which it explains the data best."""

    terms: tuple[Term, ...]
    x: tuple[np.ndarray, ...]  # natural coordinates by term
    residual: np.ndarray = field(repr=False)
    jacobian: np.ndarray = field(
        repr=False
    )  # (size, n): change of the residual, all coordinates in order; not of those at a bound
    bound: np.ndarray = field(repr=False)  # (n,) whether a coordinate lies on its physical bound

    @property
    def chi2(self) -> float:
        """Sum of squared residuals."""
        return float(self.residual @ self.residual)

    @cached_property
    def rank(self) -> int:
        """Number of coordinates that the data can tell apart."""
        return rank_of(self.jacobian[:, ~self.bound])

    def named(self) -> list[int]:
        """Positions of the terms that are effects, not starts of runs."""
        return [i for i, t in enumerate(self.terms) if not isinstance(t.effect, StartOfRun)]

    def columns(self, i: int) -> slice:
        """Columns of the i-th term's coordinates."""
        begin = sum(x.size for x in self.x[:i])
        return slice(begin, begin + self.x[i].size)

    def values(self, rig: Rig) -> list[tuple[Term, dict[str, float]]]:
        """The hypothesis."""
        return hypothesis(rig, self.terms, self.x)


def rank_of(jacobian: np.ndarray) -> int:
    """Rank of columns, each scaled to unit length; columns that nothing answers to do not count."""
    norm = np.linalg.norm(jacobian, axis=0)
    seen = jacobian[:, norm > 0] / norm[norm > 0]
    return int(np.sum(np.linalg.eigvalsh(seen.T @ seen) > 1e-9)) if seen.size else 0


def without_columns(vector: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """A vector (size,) without what columns (size, k) can take away from it."""
    norm = np.linalg.norm(columns, axis=0)
    seen = columns[:, norm > 0] / norm[norm > 0]
    if not seen.shape[1]:
        return vector
    return vector - seen @ np.linalg.solve(seen.T @ seen + 1e-10 * np.eye(seen.shape[1]), seen.T @ vector)


def hypothesis(rig: Rig, terms: Iterable[Term], x: Iterable[np.ndarray]) -> list[tuple[Term, dict[str, float]]]:
    """Terms with their values."""
    return [(t, t.effect.values(rig, t.where, xi, t.variant)) for t, xi in zip(terms, x, strict=True)]


Bounds = Callable[[Term], tuple[np.ndarray, np.ndarray]]


class Space:
    """The natural coordinates (n,) of some terms, one after the other: their bounds, their scales, and which belong to
    slow effects.
    """

    def __init__(self, terms: Sequence[Term], rig: Rig, bounds: Bounds) -> None:
        scales = [np.asarray(t.effect.scales(rig, t.where, t.variant), float) for t in terms]
        limits = [bounds(t) for t in terms]
        self.terms = terms
        self.scale, self.low, self.high = joined(scales), joined([b[0] for b in limits]), joined([b[1] for b in limits])
        self.slow = joined([np.full(s.size, t.effect.slow) for s, t in zip(scales, terms, strict=True)]).astype(bool)
        self.group = joined([np.full(size.size, k) for k, size in enumerate(scales)]).astype(int)
        self._edges = np.cumsum([s.size for s in scales])[:-1]

    def parted(self, point: np.ndarray) -> list[np.ndarray]:
        """Coordinates (n,) by term."""
        return np.split(point, self._edges) if self.terms else []


def joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays one after the other; an empty one of none."""
    return np.concatenate(parts) if parts else np.zeros(0)


class Predicts(Protocol):
    """What says, for each hypothesis, what every run reads (N,) by signal; None where it is impossible."""

    def __call__(self, hypotheses: Sequence[Hypothesis]) -> list[list[dict[str, np.ndarray]] | None]: ...


class Fitter:
    """Fits sets of terms; every fit is kept."""

    def __init__(self, model: Predicts, data: Data, rig: Rig, bounds: Bounds) -> None:
        self.model, self.data, self.rig, self.bounds = model, data, rig, bounds
        self._fits: dict[tuple[Term, ...], Fit | None] = {}

    def residuals(self, terms: Sequence[Term], points: Sequence[Sequence[np.ndarray]]) -> list[np.ndarray | None]:
        """Residuals at each point; None where it is impossible."""
        found = self.model([hypothesis(self.rig, terms, x) for x in points])
        return [None if f is None else self.data.residual(f) for f in found]

    def fit(self, terms: Sequence[Term], *starts: Mapping[Term, np.ndarray]) -> Fit | None:
        """The best fit of a set of terms from the start with the smallest residual; None where none is possible.

        A set is fitted once; of free motions again from a start that is better than what was reached from another.
        """
        key = _sorted(terms)
        known, free = self._fits.get(key), any(isinstance(t.effect, StartOfRun) for t in key)
        if key in self._fits and not free:
            return known
        points = [self._within(key, [np.array(start[t], float) for t in key]) for start in starts]
        tried = self.residuals(key, points) if len(points) > 1 or free else [np.zeros(1)]
        sizes = [np.inf if r is None else float(r @ r) for r in tried]
        if known is None or min(sizes) < known.chi2:
            self._fits[key] = self._fit(key, points[int(np.argmin(sizes))])
        return self._fits[key]

    def _within(self, terms: Sequence[Term], x: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Coordinates moved within their bounds."""
        return [np.clip(xi, *self.bounds(t)) for t, xi in zip(terms, x, strict=True)]

    def done(self) -> list[Fit]:
        """Every fit so far."""
        return [f for f in self._fits.values() if f is not None]

    def at(self, terms: Sequence[Term], x: Mapping[Term, np.ndarray]) -> Fit | None:
        """The fit of a set of terms that stays where it starts."""
        key = _sorted(terms)
        return self._fit(key, [np.array(x[t], float) for t in key], steps=0)

    def settled(self, fit: Fit) -> Fit:
        """A fit taken to its very minimum; it replaces the one that was close enough to be compared."""
        found = self._fit(fit.terms, fit.x, rough=0.0) or fit
        self._fits[fit.terms] = found
        return found

    def _fit(
        self, terms: tuple[Term, ...], x: Sequence[np.ndarray], steps: int = STEPS, rough: float = ROUGHLY
    ) -> Fit | None:
        space = Space(terms, self.rig, self.bounds)

        def residual(point: np.ndarray) -> np.ndarray | None:
            return self.residuals(terms, [space.parted(point)])[0]

        def jacobian(point: np.ndarray, here: np.ndarray) -> np.ndarray:
            return self.jacobian(space, point, here)

        found = Descent(residual, jacobian, space.low, space.high, space.scale, space.group, rough).from_point(
            joined(x), steps
        )
        if found is None:
            return None
        return Fit(terms, tuple(space.parted(found.point)), found.residual, found.jacobian, found.bound)

    def jacobian(self, space: Space, point: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Derivatives (size, n) of the residual by forward differences (backward at an upper bound).

        Those of all but the slow effects are taken in the linkage without the slow ones: exact to first order in these.
        """
        columns = np.zeros((self.data.size, point.size))
        steps = np.where(point + STEP_OF_SCALE * space.scale > space.high, -1.0, 1.0) * STEP_OF_SCALE * space.scale
        slow, every = space.slow, list(range(len(space.terms)))
        if slow.any():
            columns[:, slow] = self._differences(space, every, point, np.diag(steps)[slow], residual)
        if not slow.all():
            quick = [k for k in every if not space.terms[k].effect.slow]
            origin = None if slow.any() else residual
            columns[:, ~slow] = self._differences(space, quick, point, np.diag(steps)[~slow], origin)
        return columns

    def _differences(
        self, space: Space, kept: Sequence[int], point: np.ndarray, steps: np.ndarray, origin: np.ndarray | None
    ) -> np.ndarray:
        """Change (size, k) of the residual of the kept terms by each of the steps (k, n) from a point, by the length of
        the step; zero where a step is impossible.  ``origin`` is the residual at the point, None if not known.
        """
        points = [point + step for step in steps]
        points = [point, *points] if origin is None else points
        found = self.residuals([space.terms[k] for k in kept], [[space.parted(p)[k] for k in kept] for p in points])
        if origin is None:
            origin, found = found[0], found[1:]
        columns = np.zeros((self.data.size, len(steps)))
        for k, (residual, length) in enumerate(zip(found, steps.sum(axis=1), strict=True)):
            if residual is not None and origin is not None:
                columns[:, k] = (residual - origin) / length
        return columns


def _sorted(terms: Iterable[Term]) -> tuple[Term, ...]:
    """Terms in the order in which every fit has them."""
    return tuple(sorted(terms, key=lambda t: (t.label, t.variant)))
