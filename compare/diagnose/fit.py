"""The least-squares fit of a set of effects to all residuals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from compare.diagnose.effects.effect import Rig
from compare.diagnose.least_squares import ROUGHLY, SETTLED, STEPS, Descent
from compare.diagnose.predict import Hypothesis, StartOfRun, Term, pieces
from compare.diagnose.residuals import Data

STEP = 0.01  # of the noise (rms), by which a difference step may change the readings of free motions
COARSE = 10.0  # times as large a step as wanted is still good enough
REFINED = 4  # times
# of chi^2: what a step may gain in fits to be compared, and of those by leaps of single samples, and in the last one
COMPARED, LEAP, LAST_LEAP = 0.1, 1.0, 0.05
# of a value that leaps, from where its descent ends again
NEARBY = (0.6, 0.7, 0.75, 0.8, 0.88, 0.94, 0.97, 0.98, 0.99, 1.01, 1.02, 1.03, 1.06, 1.13, 1.25, 1.4, 1.6)


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

    def impossible(self, rig: Rig) -> list[Term]:
        """Its effects that lie where no machine is."""
        each = zip(self.terms, self.x, strict=True)
        return [t for t, x in each if t.effect.impossible(rig, t.where, x, t.variant)]

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
    """The natural coordinates (n,) of some terms, one after the other: their bounds, their scales, and which are starts
    of free runs.
    """

    def __init__(self, terms: Sequence[Term], rig: Rig, bounds: Bounds) -> None:
        scales = [np.asarray(t.effect.scales(rig, t.where, t.variant), float) for t in terms]
        limits = [bounds(t) for t in terms]
        self.terms = terms
        self.scale, self.low, self.high = joined(scales), joined([b[0] for b in limits]), joined([b[1] for b in limits])
        begins = [np.full(s.size, isinstance(t.effect, StartOfRun)) for s, t in zip(scales, terms, strict=True)]
        self.begins = joined(begins).astype(bool)
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
    """Fits sets of terms to data."""

    def __init__(self, model: Predicts, data: Data, rig: Rig, bounds: Bounds) -> None:
        self.model, self.data, self.rig, self.bounds = model, data, rig, bounds
        self._shares: dict[tuple[Term, int], float] = {}  # of its scale, which a difference step of a coordinate is

    def on(self, data: Data) -> Fitter:
        """The same of other data."""
        return Fitter(self.model, data, self.rig, self.bounds)

    def residuals(self, terms: Sequence[Term], points: Sequence[Sequence[np.ndarray]]) -> list[np.ndarray | None]:
        """Residuals at each point; None where it is impossible."""
        found = self.model([hypothesis(self.rig, terms, x) for x in points])
        return [None if f is None else self.data.residual(f) for f in found]

    def fit(self, terms: Sequence[Term], start: Mapping[Term, np.ndarray]) -> Fit | None:
        """The best fit of a set of terms from a start; None where none is possible."""
        key = _sorted(terms)
        return self._fit(key, self._within(key, [np.array(start[t], float) for t in key]))

    def likeliest(
        self,
        sizes: Mapping[Term, np.ndarray],
        start: Mapping[Term, np.ndarray],
        rough: float = ROUGHLY,
        beside: Fit | None = None,
    ) -> Fit | None:
        """The fit of terms that are of about these sizes (1 sigma of each coordinate; infinite: any) from a start; None
        where none is possible.  It ends early where no straight line leads below one ``beside`` it, from another start.
        """
        key = _sorted(sizes)
        point = self._within(key, [np.array(start[t], float) for t in key])
        size = joined([sizes[t] for t in key])
        beaten = np.inf if beside is None else beside.chi2 + float(np.sum((joined(beside.x) / size) ** 2))
        return self._fit(key, point, rough=rough, size=size, beaten=beaten)

    def nearest(self, starts: Sequence[Mapping[Term, np.ndarray]]) -> int:
        """Which of some starts of the same terms leaves least."""
        key = _sorted(starts[0])
        points = [self._within(key, [np.array(start[t], float) for t in key]) for start in starts]
        return _least(self.residuals(key, points)) if len(points) > 1 else 0

    def _within(self, terms: Sequence[Term], x: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Coordinates moved within their bounds."""
        return [np.clip(xi, *self.bounds(t)) for t, xi in zip(terms, x, strict=True)]

    def at(self, terms: Sequence[Term], x: Mapping[Term, np.ndarray]) -> Fit | None:
        """The fit of a set of terms that stays where it starts."""
        key = _sorted(terms)
        return self._fit(key, [np.array(x[t], float) for t in key], steps=0)

    def again(self, fit: Fit) -> Fit | None:
        """A fit of other data as it stands in these; None where it is impossible."""
        return self.at(fit.terms, dict(zip(fit.terms, fit.x, strict=True)))

    def nearby(self, fit: Fit) -> dict[Term, np.ndarray]:
        """The coordinates of a fit, or some that are nearby and leave less: leaps end a descent before its time."""
        starts = [list(fit.x)]
        for k, term in enumerate(fit.terms):
            if term.effect.leaps:
                starts += [[x * share if i == k else x for i, x in enumerate(fit.x)] for share in NEARBY]
        tried = self.residuals(fit.terms, starts) if len(starts) > 1 else [fit.residual]
        return dict(zip(fit.terms, starts[_least(tried)], strict=True))

    def _fit(
        self,
        terms: tuple[Term, ...],
        x: Sequence[np.ndarray],
        steps: int = STEPS,
        rough: float = ROUGHLY,
        size: np.ndarray | None = None,
        beaten: float = np.inf,
    ) -> Fit | None:
        """The fit from a start; ``size`` is how large (1 sigma) coordinates (n,) are expected to be, None: any."""
        space, n = Space(terms, self.rig, self.bounds), self.data.size

        def residual(point: np.ndarray) -> np.ndarray | None:
            found = self.residuals(terms, [space.parted(point)])[0]
            return found if found is None or size is None else np.concatenate([found, point / size])

        def jacobian(point: np.ndarray, here: np.ndarray) -> np.ndarray:
            columns = self.jacobian(space, point, here[:n])
            return columns if size is None else np.vstack([columns, np.diag(1 / size)])

        leaps = any(t.effect.leaps for t in terms)
        settled = (LEAP if leaps else COMPARED) if rough else LAST_LEAP if leaps else SETTLED
        edges = space.low, space.high, space.scale, space.group
        found = Descent(residual, jacobian, *edges, rough, settled, beaten).from_point(joined(x), steps)
        if found is None:
            return None
        return Fit(terms, tuple(space.parted(found.point)), found.residual[:n], found.jacobian[:n], found.bound)

    def jacobian(self, space: Space, point: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Derivatives (size, n) of the residual by forward differences (backward at an upper bound).

        A free motion may answer to a coordinate's own scale as nothing linear does: there steps are as small as needed.
        """
        if any(isinstance(t.effect, StartOfRun) for t in space.terms):
            return self._finely(space, point, residual)
        steps = np.where(point + space.scale > space.high, -1.0, 1.0) * space.scale
        return self._differences(space, point, np.diag(steps), residual)

    def _finely(self, space: Space, point: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """The same with steps that change the residual by STEP (rms), but none larger than the coordinate's scale."""
        own = [(t, k) for t, e in zip(space.terms, space.parted(point), strict=True) for k in range(e.size)]
        shares = np.array([self._shares.get(key, 1.0) for key in own])
        columns, left = np.zeros((self.data.size, point.size)), np.ones(point.size, bool)
        for _ in range(REFINED):
            steps = np.where(point + shares * space.scale > space.high, -1.0, 1.0) * shares * space.scale
            begun = left & space.begins
            columns[:, begun] = self._begun(space, point, steps)[:, begun]
            columns[:, left & ~begun] = self._differences(space, point, np.diag(steps)[left & ~begun], residual)
            change = np.sqrt(np.mean(columns**2, axis=0)) * space.scale
            wanted = np.minimum(1.0, STEP / np.maximum(change, 1e-300))
            left = wanted < shares / COARSE
            shares = wanted
            if not left.any():
                break
        self._shares |= dict(zip(own, shares.tolist(), strict=True))
        return columns

    def _begun(self, space: Space, point: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Change (size, n) of the residual by the starts of free runs, zero by all else.  What a piece does no other
        does: two motions, one with all angles off and one with all rates, tell of every piece.
        """
        place = np.flatnonzero(space.begins)
        each = [np.isin(np.arange(point.size), place[order::2]) * steps for order in range(2)]
        found = self.model([hypothesis(self.rig, space.terms, space.parted(point + off)) for off in (0.0, *each)])
        columns = np.zeros((self.data.size, point.size))
        for order, there in enumerate(found[1:]):
            if there is not None and found[0] is not None:
                changed = self.data.changed(found[0], there)
                for at, touched in zip(place[order::2], self._touched(space), strict=True):
                    columns[touched, at] = changed[touched] / steps[at]
        columns[:, place] = -self.data.columns(columns[:, place])
        return columns

    def _touched(self, space: Space) -> Iterator[np.ndarray]:
        """Which samples (size,) each piece of each free run has, in the order of its starts."""
        measured, parts = self.data.measured, self.data.parts
        for term in (t for t in space.terms if isinstance(t.effect, StartOfRun)):
            (k,) = (k for k, run in enumerate(measured.runs) if run.name == term.where)
            for piece in pieces(measured.runs[k].time.size, StartOfRun.pieces(term.variant)):
                touched = np.zeros(self.data.size, bool)
                for part in (part for part in parts if part.run == k):
                    touched[part.place] = (part.used >= piece.start) & (part.used < piece.stop)
                yield touched

    def _differences(self, space: Space, point: np.ndarray, steps: np.ndarray, here: np.ndarray) -> np.ndarray:
        """Change (size, k) of the residual by each of the steps (k, n) from a point, where it is ``here``, by the
        length of the step; zero where a step is impossible.
        """
        found = self.residuals(space.terms, [space.parted(point + step) for step in steps])
        columns = np.zeros((self.data.size, len(steps)))
        for k, (residual, length) in enumerate(zip(found, steps.sum(axis=1), strict=True)):
            if residual is not None:
                columns[:, k] = (residual - here) / length
        return columns


def _least(residuals: Sequence[np.ndarray | None]) -> int:
    """Which of some residuals is least; None is more than any."""
    return int(np.argmin([np.inf if r is None else float(r @ r) for r in residuals]))


def _sorted(terms: Iterable[Term]) -> tuple[Term, ...]:
    """Terms in the order in which every fit has them."""
    return tuple(sorted(terms, key=lambda t: (t.label, t.variant)))
