"""Residuals in units of noise, and the least-squares fit of a set of effects to them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from compare.diagnose.data.recording import Measured
from compare.diagnose.effects.effect import Rig
from compare.diagnose.predict import Model, StartOfRun, Term, wrapped

STEPS = 30  # of a fit, at most
RELUCTANCE = 1e-3  # chi^2 that a coordinate pays for a step of its own scale: nothing for what the data see
ENOUGH = 0.01  # decrease of chi^2 below which a fit has settled
STEP_OF_SCALE = 1.0  # difference step, in the effects' own scales
FOLDS = 6
SEGMENTS = 18  # of a run; every FOLDS-th one is held out together


@dataclass(frozen=True)
class Part:
    """The samples of one sensor in one run, within the vector of all residuals."""

    run: int
    signal: str
    used: np.ndarray  # indices of the run's samples
    place: slice


class Data:
    """Everything measured as one vector, each sample over its noise.

    ``shared`` (size, k), in units of noise, are errors that samples have in common: their covariance is 1 + shared
    shared^T.
    """

    def __init__(
        self, measured: Measured, noise: Mapping[tuple[str, str], float], encoder: str, shared: np.ndarray | None = None
    ) -> None:
        self.measured, self.noise, self.encoder = measured, noise, encoder
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
        self.turning = np.concatenate([np.full(p.used.size, p.signal.endswith("_angle")) for p in self.parts])
        self.size = at
        self.shared = np.zeros((at, 0)) if shared is None else shared
        basis, spread, _ = np.linalg.svd(self.shared, full_matrices=False)
        self._basis, self._less = (
            basis,
            1 / np.sqrt(1 + spread**2) - 1,
        )  # whitens what the sensors' errors have in common

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
            replace(self.measured, runs=tuple(runs)), self.noise, self.encoder, self.shared[np.concatenate(kept)]
        )

    def shifted(self, difference: np.ndarray) -> Data:
        """The same data less a difference (size,) in units of noise."""
        other = copy(self)
        other.values = self.values - difference * self.sigma  # a whitened difference, which is near enough
        return other

    def residual(self, readings: Sequence[Mapping[str, np.ndarray]]) -> np.ndarray:
        """(measured - predicted) / noise, (size,); angles modulo a turn.  Where the model has no answer it is
        bridged.
        """
        predicted = np.concatenate([bridged(readings[p.run][p.signal])[p.used] for p in self.parts])
        difference = self.values - predicted
        difference[self.turning] = wrapped(difference[self.turning])
        return self._white(difference / self.sigma)

    def _white(self, residual: np.ndarray) -> np.ndarray:
        return residual + self._basis @ (self._less * (self._basis.T @ residual)) if self.shared.shape[1] else residual


def bridged(values: np.ndarray) -> np.ndarray:
    """Values with straight lines across what is not a number; all NaN becomes a huge number, so that nothing
    fits it.
    """
    known = np.isfinite(values)
    if known.all():
        return values
    if not known.any():
        return np.full(values.shape, 1e12)
    at = np.arange(values.size)
    return np.interp(at, at[known], values[known])


@dataclass(frozen=True)
class Fit:
    """A set of effects and the coordinates at which the data like it best."""

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


def hypothesis(rig: Rig, terms: Iterable[Term], x: Iterable[np.ndarray]) -> list[tuple[Term, dict[str, float]]]:
    """Terms with their values."""
    return [(t, t.effect.values(rig, t.where, xi, t.variant)) for t, xi in zip(terms, x, strict=True)]


Bounds = Callable[[Term], tuple[np.ndarray, np.ndarray]]


class Fitter:
    """Fits sets of terms; every fit is kept."""

    def __init__(self, model: Model, data: Data, rig: Rig, bounds: Bounds) -> None:
        self.model, self.data, self.rig, self.bounds = model, data, rig, bounds
        self._fits: dict[tuple[Term, ...], Fit | None] = {}

    def residuals(self, terms: Sequence[Term], points: Sequence[Sequence[np.ndarray]]) -> list[np.ndarray | None]:
        """Residuals at each point; None where it is impossible."""
        found = self.model([hypothesis(self.rig, terms, x) for x in points])
        return [None if f is None else self.data.residual(f) for f in found]

    def fit(self, terms: Sequence[Term], *starts: Mapping[Term, np.ndarray]) -> Fit | None:
        """The best fit of a set of terms from the start that the data like best; None where none is possible."""
        key = _sorted(terms)
        if key not in self._fits:
            points = [self._within(key, [np.array(start[t], float) for t in key]) for start in starts]
            tried = self.residuals(key, points) if len(points) > 1 else [np.zeros(1)]
            sizes = [np.inf if r is None else float(r @ r) for r in tried]
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

    def _fit(self, terms: tuple[Term, ...], x: list[np.ndarray], steps: int = STEPS) -> Fit | None:
        limits = [self.bounds(t) for t in terms]
        low, high = (np.concatenate([b[k] for b in limits]) if limits else np.zeros(0) for k in (0, 1))
        scale = (
            np.concatenate([np.asarray(t.effect.scales(self.rig, t.where, t.variant), float) for t in terms])
            if terms
            else np.zeros(0)
        )
        sizes = np.cumsum([len(xi) for xi in x])[:-1]
        point = np.clip(np.concatenate(x) if x else np.zeros(0), low, high)

        def parted(p: np.ndarray) -> list[np.ndarray]:
            return np.split(p, sizes) if terms else []

        residual = self.residuals(terms, [parted(point)])[0]
        if residual is None:
            return None
        jacobian, stale = self.jacobian(terms, point, residual, scale, high, parted), False
        damping = 0.0
        for _ in range(steps if point.size else 0):
            trial = point + _step(jacobian, residual, low - point, high - point, damping, scale)
            expected = float(residual @ residual - np.sum((residual + jacobian @ (trial - point)) ** 2))
            if expected < ENOUGH:
                if not stale:
                    break
                jacobian, stale = self.jacobian(terms, point, residual, scale, high, parted), False
                continue
            new = self.residuals(terms, [parted(trial)])[0]
            gained = -np.inf if new is None else float(residual @ residual - new @ new)
            if new is None or gained <= 0:
                if stale:
                    jacobian, stale = self.jacobian(terms, point, residual, scale, high, parted), False
                elif damping > 1e6:
                    break
                else:
                    damping = max(damping * 10, 1e-3)
                continue
            point, residual = trial, new
            damping = 0.0 if damping < 1e-3 else damping / 10
            stale = True
            if gained < 0.9 * expected:
                jacobian, stale = self.jacobian(terms, point, residual, scale, high, parted), False
        if stale:
            jacobian = self.jacobian(terms, point, residual, scale, high, parted)
        gradient = jacobian.T @ residual
        bound = ((point <= low) & (gradient >= 0)) | ((point >= high) & (gradient <= 0))
        return Fit(terms, tuple(parted(point)), residual, jacobian, bound)

    def jacobian(
        self,
        terms: Sequence[Term],
        point: np.ndarray,
        residual: np.ndarray,
        scale: np.ndarray,
        high: np.ndarray,
        parted: Callable[[np.ndarray], list[np.ndarray]],
    ) -> np.ndarray:
        """Derivatives (size, n) of the residual by forward differences (backward at an upper bound).

        Those of all but the slow effects are taken in the linkage without the slow ones: exact to first order in these.
        """
        if not point.size:
            return np.zeros((self.data.size, 0))
        steps = np.where(point + STEP_OF_SCALE * scale > high, -1.0, 1.0) * STEP_OF_SCALE * scale
        slow = np.concatenate([np.full(len(xi), t.effect.slow) for t, xi in zip(terms, parted(point), strict=True)])
        quick = [k for k, t in enumerate(terms) if not t.effect.slow]
        columns = np.zeros((self.data.size, point.size))
        for mine in (slow, ~slow):
            within = range(len(terms)) if mine is slow or not slow.any() else quick
            points = [point, *(point + step for step in np.diag(steps)[mine])] if mine.any() else []
            here = [[parted(p)[k] for k in within] for p in points]
            found = self.residuals([terms[k] for k in within], here[1:] if mine is slow or not slow.any() else here)
            origin = residual if mine is slow or not slow.any() else (found.pop(0) if found else None)
            for at, r in zip(np.flatnonzero(mine), found, strict=True):
                if r is not None and origin is not None:
                    columns[:, at] = (r - origin) / steps[at]
        return columns


def _sorted(terms: Iterable[Term]) -> tuple[Term, ...]:
    """Terms in the order in which a fit has them, whoever asks."""
    return tuple(sorted(terms, key=lambda t: (t.label, t.variant)))


def _step(
    jacobian: np.ndarray, residual: np.ndarray, low: np.ndarray, high: np.ndarray, damping: float, scale: np.ndarray
) -> np.ndarray:
    """Least-squares step (n,) within bounds: what would leave them stops there, and the others make up for it."""
    gradient = jacobian.T @ residual
    step = np.zeros(gradient.size)
    free = ~(((low >= 0) & (gradient > 0)) | ((high <= 0) & (gradient < 0))) & (np.linalg.norm(jacobian, axis=0) > 0)
    while free.any():
        step[free] = -_solve(jacobian[:, free], residual + jacobian[:, ~free] @ step[~free], damping, scale[free])
        beyond = free & ((step < low) | (step > high))
        if not beyond.any():
            break
        step = np.clip(step, low, high)
        free &= ~beyond
    return step


def _solve(jacobian: np.ndarray, residual: np.ndarray, damping: float, scale: np.ndarray) -> np.ndarray:
    """Least squares with columns scaled to unit length; what the data hardly see pays for going far (in its own
    scale).
    """
    norm = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian / norm
    matrix = scaled.T @ scaled + np.diag(damping + RELUCTANCE / (scale * norm) ** 2)
    return np.linalg.solve(matrix, scaled.T @ residual) / norm
