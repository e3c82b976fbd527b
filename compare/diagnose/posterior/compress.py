"""The linear problem of all effects about a fit, compressed into products: what every set is judged by.

About a fit the whitened residual is r = sum J_g b_g + noise over groups g: an effect at a place in one of its variants.
Rows count a little less where the fit is far off, by what a linear forecast then misses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.posterior.nameless import Nameless
from compare.diagnose.posterior.prior import WIDTH_ODDS, Prior
from compare.diagnose.predict import Term
from compare.diagnose.sensitivities import Sensitivity

FORECAST = 0.12  # of a fit's residual: what a linear forecast of it misses
ANY = ("unknown", "")  # the family of all unknowns: what two of them do, one at a third place does about as well
LOOSE = 1e-12  # of a column's own square, that keeps products positive
Name = tuple[str, str, float, tuple[int, ...]]  # of a group: effect, place, variant, coordinates


@dataclass(frozen=True)
class Group:
    """Columns that are there together: an effect at a place, or an unknown (no ``term``) at one.

    ``at`` are its columns among all, each over its natural ``size`` (k,); ``along`` says which of the effect's
    coordinates they are, () where it has all; ``offset`` is the column of what its variant does by itself, -1 where it
    does nothing.
    """

    key: tuple[str, str]
    family: tuple[str, str]  # of which a set has one at most
    term: Term | None
    at: np.ndarray
    size: np.ndarray
    log_odds: float
    positive: np.ndarray
    widths: np.ndarray = field(default_factory=WIDTH_ODDS.copy)  # log odds of each width
    offset: int = -1
    fitted: bool = False  # columns are derivatives by natural coordinates, not answers to probes
    along: tuple[int, ...] = ()

    @property
    def name(self) -> Name:
        """What tells a group from all others."""
        return (*self.key, 0.0 if self.term is None else self.term.variant, self.along)


@dataclass(frozen=True)
class Products:
    """Products of all groups' columns (n, n), with the residual (n,) and of that with itself, where errors everywhere
    of one size are part of the noise; ``log_volume`` is what that costs.
    """

    gram: np.ndarray = field(repr=False)
    wanted: np.ndarray = field(repr=False)
    square: float
    log_volume: float


class Compressed:
    """All groups about a fit; ``slight`` (size, d) is what errors of workmanship 1 do."""

    def __init__(
        self,
        fitter: Fitter,
        fit: Fit,
        prior: Prior,
        found: Mapping[Term, Sensitivity],
        unknown: Sequence[Nameless] = (),
    ) -> None:
        self.fit, self.prior, self.data = fit, prior, fitter.data
        self.groups: list[Group] = []
        self._columns: list[np.ndarray] = []
        slight, residual = [], fit.residual.copy()
        own = {fit.terms[i]: fit.jacobian[:, fit.columns(i)] for i in fit.named()}
        for term, columns in own.items():
            change, turned = columns @ fit.x[fit.terms.index(term)], _by_itself(fitter, fit, term)
            offset = None if turned is None else turned - change
            residual -= change if turned is None else turned
            size, odds, positive = prior.size(term), prior.log_odds(term), prior.positive(term)
            self._add(term.key, term, columns, size, odds, positive, offset, fitted=True)
            kept = term.effect.sized
            slight += [columns[:, :kept] * prior.slight(term)[:kept]] if prior.is_slight(term) else []
        for term, sensitivity in found.items():
            if term not in own:
                slight += self._added(term, sensitivity)
        for place in unknown:
            self._without_name(place, prior.nameless(len(unknown)))
        # a forecast is as far off as the fit is: its rows count a little less
        self._forecast = np.ones(residual.size)
        for part in self.data.parts:
            square = float(np.mean(fit.residual[part.place] ** 2)) if part.used.size else 1.0
            self._forecast[part.place] = 1 / (1 + FORECAST**2 * max(square - 1, 0.0))
        self.slight = np.column_stack([np.zeros((residual.size, 0)), *slight])
        count = sum(c.shape[1] for c in self._columns)
        every = np.column_stack([*self._columns, self.slight, -residual])
        always = [fit.jacobian[:, fit.columns(i)] for i in range(len(fit.terms)) if i not in fit.named()]
        if always:
            basis = np.linalg.qr(np.column_stack(always))[0]
            every -= basis @ (basis.T @ every)
        self._count, self._every = count, every

    def _add(
        self,
        key: tuple[str, str],
        term: Term,
        columns: np.ndarray,
        size: np.ndarray,
        log_odds: float,
        positive: np.ndarray,
        offset: np.ndarray | None = None,
        fitted: bool = False,
    ) -> None:
        at = sum(c.shape[1] for c in self._columns)
        places = np.arange(at, at + columns.shape[1])
        self._columns.append(columns * size)
        by_itself = -1
        if offset is not None and offset.any():
            self._columns.append(offset[:, None])
            by_itself = at + columns.shape[1]
        family, widths = self.prior.family(term), self.prior.widths(term)
        for along, odds in self.prior.along(term).items():
            own = list(along) or slice(None)
            self.groups.append(
                Group(
                    key,
                    family,
                    term,
                    places[own],
                    size[own],
                    log_odds + odds,
                    positive[own],
                    widths,
                    by_itself,
                    fitted,
                    along,
                )
            )

    def _added(self, term: Term, sensitivity: Sensitivity) -> list[np.ndarray]:
        """A term that the fit has not, by its answers to probes; what workmanship leaves of it (size, d)."""
        prior, effect = self.prior, term.effect
        columns = effect.combined(sensitivity.columns)
        place = prior.rig, term.where
        amounts = effect.amounts(*place, prior.size(term), term.variant)
        positive = effect.never_negative(*place, prior.bounds(term)[0], term.variant)
        self._add(term.key, term, columns, amounts, prior.log_odds(term), positive, sensitivity.offset)
        if not prior.is_slight(term):
            return []
        slight = effect.amounts(*place, prior.slight(term), term.variant)[: effect.sized]
        return [columns[:, : effect.sized] * slight]

    def _without_name(self, place: Nameless, log_odds: float) -> None:
        at, count = sum(c.shape[1] for c in self._columns), place.columns.shape[1]
        self._columns.append(place.columns)
        kept, size, positive = np.arange(at, at + count), np.ones(count), np.zeros(count, bool)
        self.groups.append(Group(place.key, ANY, None, kept, size, log_odds, positive))

    def columns(self, group: Group) -> np.ndarray:
        """What a group does (size, k), each column over its natural size."""
        at = np.cumsum([0, *(c.shape[1] for c in self._columns)])
        (i,) = np.flatnonzero(at == group.at[0])[-1:]
        return self._columns[i]

    def left(self, steady: bool = False) -> np.ndarray:
        """What all groups together leave (size,), each of about its natural size; with ``steady`` all but those with a
        harmonic of their own, one of which is near any hum.
        """
        columns, residual = self._every[:, : self._count], -self._every[:, -1]
        if steady:
            waving = [g.at for g in self.groups if g.term and any(p.discrete for p in g.term.effect.parameters)]
            columns = np.delete(columns, np.concatenate([np.zeros(0, int), *waving]), axis=1)
        matrix = columns.T @ columns + np.eye(columns.shape[1])
        return residual - columns @ np.linalg.solve(matrix, columns.T @ residual)

    def products(self, weights: np.ndarray) -> Callable[[float], Products]:
        """Of all groups, where samples count so much (size,), by the size of errors everywhere."""
        every = self._products(weights)
        n, last = self._count, len(every) - 1
        kept, out = np.r_[0:n, last], np.arange(n, last)

        def beside(workmanship: float) -> Products:
            inside, volume = every[np.ix_(kept, kept)], 0.0
            if workmanship and out.size:
                factor = self._factor(every, workmanship)
                across = np.linalg.solve(factor, every[np.ix_(out, kept)])
                inside = inside - across.T @ across
                volume = 2 * float(np.log(np.diag(factor)).sum()) + 2 * out.size * math.log(workmanship)
            return Products(inside[:n, :n], inside[:n, n], float(inside[n, n]), volume)

        return beside

    def _products(self, weights: np.ndarray) -> np.ndarray:
        scaled = self._every * np.sqrt(weights * self._forecast)[:, None]
        return scaled.T @ scaled

    def _factor(self, every: np.ndarray, workmanship: float) -> np.ndarray:
        """Triangle of the products of errors everywhere."""
        out = np.arange(self._count, len(every) - 1)
        return np.linalg.cholesky(every[np.ix_(out, out)] + np.diag(1 / workmanship**2 + LOOSE * every[out, out]))

    def coordinates(self, group: Group, coefficients: np.ndarray) -> np.ndarray:
        """Natural coordinates (n,) that belong to coefficients (k,) of a group's columns over their sizes."""
        t, amounts = group.term, coefficients * group.size
        if t is not None and group.along:
            amounts = np.zeros(self.prior.size(t).size)
            amounts[list(group.along)] = coefficients * group.size
        if t is None or group.fitted:
            return amounts
        return t.effect.from_amounts(self.prior.rig, t.where, amounts, t.variant)


def _by_itself(fitter: Fitter, fit: Fit, term: Term) -> np.ndarray | None:
    """What a term of a fit does in all (size,), where its variant does something whatever its coordinates are."""
    if not term.effect.acts_by_itself(term.variant):
        return None
    others = {t: x for t, x in zip(fit.terms, fit.x, strict=True) if t != term}
    (found,) = fitter.residuals(list(others), [list(others.values())])
    return None if found is None else fit.residual - found
