"""The few laws of a dictionary that tell an unknown, with their coefficients: forward selection, shapes refined, each
term paying its price, and all of them foretelling data that they were not fitted to.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise

import numpy as np
from scipy.optimize import minimize

from compare.diagnose.noise import sample_weights
from compare.diagnose.propose.laws import Candidate, State
from compare.diagnose.propose.places import Place
from compare.diagnose.residuals import Data

MOST_LAWS = 3  # laws together
REFINED = 4  # laws, of those that gain most, that are fitted with their shapes
HELD_OUT = 9.0  # of chi^2, that each must bring on data left out
FURTHER = 0.25  # of what those before it leave beyond the noise there, that each but the first must bring
SAME = 1e-6  # of its own length: what is left of a column that others tell already
NOTHING = 1e-100  # length of a column that is zero
EVALUATIONS = 60  # of each shape


@dataclass(frozen=True)
class Told:
    """Laws with their coefficients (k,), their covariance (k, k) in units of the noise, and what they leave."""

    laws: tuple[Candidate, ...]
    coefficients: np.ndarray
    covariance: np.ndarray = field(repr=False)
    left: np.ndarray = field(repr=False)  # (size,)

    @property
    def chi2(self) -> float:
        """Sum of squares of what is left."""
        return float(self.left @ self.left)

    @property
    def terms(self) -> tuple[str, ...]:
        """What each coefficient is of."""
        return tuple(term for law in self.laws for term in law.terms)


@dataclass(frozen=True)
class Regression:
    """A residual (size,) of data that laws of the state at a place are to tell: ``free`` (size, f) are columns that
    every explanation has, ``folds`` masks (size,) of data left out.
    """

    data: Data
    residual: np.ndarray
    state: State
    place: Place
    free: np.ndarray
    folds: Sequence[np.ndarray]

    def best(self, candidates: Iterable[Candidate], most: int = MOST_LAWS) -> Told:
        """The laws, no more than so many, that tell the residual for the least; none where nothing does."""
        known = _Known.of({c: self.columns(c) for c in candidates}, self.residual.size)
        count = len({c.law.name for c in known.candidates})
        best = self.told(())
        while len(best.laws) < most:
            begun = (self.told((*best.laws, c)) for c in islice(self._nearest(known, best), REFINED))
            found = [self._refined(each) for each in begun]
            if not found:
                break
            weights = self.weights(min(found, key=lambda t: t.chi2))
            found = [self._pruned(each, weights, count) for each in found]
            better = min(found, key=lambda t: self.cost(t, weights, count))
            pays = self.cost(better, weights, count) < self.cost(best, weights, count)
            left = self.held_out(best, weights)
            worth = FURTHER * (left - float(weights.sum())) if best.laws else 0.0
            if not pays or left - self.held_out(better, weights) < max(HELD_OUT, worth):
                break
            best = better
        return best

    def weights(self, told: Told) -> np.ndarray:
        """What each sample counts (size,) beside laws: less where more than noise is left."""
        return sample_weights(self.data, told.left)

    def cost(self, told: Told, weights: np.ndarray, count: int) -> float:
        """Weighted chi^2 and what the laws' numbers cost, chosen from so many laws."""
        numbers = sum(len(c.terms) + len(c.shape) for c in told.laws)
        price = numbers * math.log(self.residual.size) + 2 * len(told.laws) * math.log(max(count, 2))
        return float(weights @ told.left**2) + price

    def columns(self, c: Candidate) -> np.ndarray:
        """What the data see of a law, (size, k)."""
        return self.data.columns(c.columns(self.state) * self.place.answers[:, None])

    def told(self, laws: tuple[Candidate, ...], columns: Sequence[np.ndarray] | None = None) -> Told:
        """Laws fitted."""
        matrix = np.column_stack([self.free, *(columns or [self.columns(c) for c in laws])])
        x, covariance = solved(matrix, self.residual)
        own = slice(self.free.shape[1], None)
        return Told(laws, x[own], covariance[own, own], self.residual - matrix @ x)

    def _nearest(self, known: _Known, best: Told) -> Iterator[Candidate]:
        """The candidates, one a law, beside what is told already: those that gain most first."""
        taken = {c.law.name for c in best.laws}
        basis = np.linalg.qr(np.column_stack([self.free, *(self.columns(c) for c in best.laws)]))[0]
        told = (known.rows @ basis).T
        wanted = known.rows @ best.left - told.T @ (basis.T @ best.left)
        gains: dict[str, tuple[float, Candidate]] = {}
        for c, at, gram in zip(known.candidates, known.places, known.grams, strict=True):
            if c.law.name in taken:
                continue
            left = gram - told[:, at].T @ told[:, at]
            if np.all(left.diagonal() <= SAME**2 * gram.diagonal()):
                continue
            gain = float(wanted[at] @ _solved(left, wanted[at])[0])
            if gain > gains.get(c.law.name, (0.0, c))[0]:
                gains[c.law.name] = gain, c
        yield from (c for _, c in sorted(gains.values(), key=lambda g: -g[0]))

    def _refined(self, found: Told) -> Told:
        """The same laws with their shapes where they tell most, a step beyond their grids at most."""
        shapes = np.array([x for c in found.laws for x in c.shape])
        if not shapes.size:
            return found
        steps = np.array([x for c in found.laws for x in c.law.steps(self.state)])
        grids = [grid for c in found.laws for grid in c.law.grid(self.state)]
        low, high = (np.array([end(grid) for grid in grids]) for end in (min, max))

        def laws(at: np.ndarray) -> tuple[Candidate, ...]:
            numbers = iter(np.clip(shapes + at * steps, low - steps, high + steps).tolist())
            return tuple(Candidate(c.law, tuple(islice(numbers, len(c.shape)))) for c in found.laws)

        simplex = np.vstack([np.zeros(shapes.size), np.eye(shapes.size)])
        options = {"initial_simplex": simplex, "maxfev": EVALUATIONS * shapes.size, "xatol": 1e-3, "fatol": 0.1}
        free, given = self.free.T @ self.free, self.free.T @ self.residual

        def gained(at: np.ndarray) -> float:
            """Decrease of chi^2, negative."""
            own = np.column_stack([self.columns(c) for c in laws(at)])
            across, wanted = self.free.T @ own, np.concatenate([given, own.T @ self.residual])
            return -float(wanted @ _solved(np.block([[free, across], [across.T, own.T @ own]]), wanted)[0])

        end = minimize(gained, simplex[0], method="Nelder-Mead", options=options)
        better = self.told(laws(end.x))
        return better if better.chi2 < found.chi2 else found

    def _pruned(self, found: Told, weights: np.ndarray, count: int) -> Told:
        """The laws without any that does not pay."""
        while len(found.laws) > 1:
            fewer = [self.told(tuple(c for c in found.laws if c is not out)) for out in found.laws]
            least = min(fewer, key=lambda t: self.cost(t, weights, count))
            if self.cost(least, weights, count) >= self.cost(found, weights, count):
                break
            found = least
        return found

    def held_out(self, found: Told, weights: np.ndarray) -> float:
        """Weighted chi^2 of each fold by coefficients that are fitted to the others."""
        matrix = np.column_stack([self.free, *(self.columns(c) for c in found.laws)])
        total = 0.0
        for out in self.folds:
            x, _ = solved(matrix[~out], self.residual[~out])
            total += float(weights[out] @ (self.residual[out] - matrix[out] @ x) ** 2)
        return total


@dataclass(frozen=True)
class _Known:
    """Columns of candidates, one below the other as rows (n, size): where each one's are, and their products (k, k)."""

    candidates: Sequence[Candidate]
    rows: np.ndarray
    places: Sequence[slice]
    grams: Sequence[np.ndarray]

    @classmethod
    def of(cls, found: Mapping[Candidate, np.ndarray], size: int) -> _Known:
        """Those of these columns."""
        edges = np.cumsum([0, *(own.shape[1] for own in found.values())]).tolist()
        places = [slice(*ends) for ends in pairwise(edges)]
        rows = np.concatenate([np.zeros((0, size)), *(own.T for own in found.values())])
        return cls(list(found), rows, places, [rows[at] @ rows[at].T for at in places])


def solved(matrix: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares coefficients (k,) and their covariance (k, k) in units of the residual's own noise."""
    return _solved(matrix.T @ matrix, matrix.T @ right)


def _solved(gram: np.ndarray, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same by products (k, k) of the columns, and (k,) with the right side."""
    norm = np.sqrt(np.maximum(gram.diagonal(), 0.0))
    norm = np.where(norm > NOTHING, norm, 1.0)
    if norm.size == 1:
        inverse = np.where(gram > NOTHING**2, 1.0, 0.0)
    else:
        inverse = np.linalg.pinv(gram / np.outer(norm, norm), rcond=1e-10, hermitian=True)
    return inverse @ (wanted / norm) / norm, inverse / np.outer(norm, norm)
