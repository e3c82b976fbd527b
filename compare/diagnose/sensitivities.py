"""Which effects could make this residual: the sensitivity of the data to every candidate, and the best sets of them.

A sensitivity is how the readings of all runs answer to a little of an effect, in units of their noise.  With all of
them side by side, every set of effects is a small linear problem, so the best sets of each size are found before
anything is fitted.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from compare.diagnose.effects.effect import Effect, Rig
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.least_squares import UNSEEN, reluctance
from compare.diagnose.predict import Term

BEAM = 24  # sets of each size to which a further term is added
VISIBLE = 1e-6  # sigmas: an effect whose sensitivity is smaller in every sample is invisible


@dataclass(frozen=True)
class Sensitivity:
    """How the residual answers to a term: ``offset`` (size,) by its variant alone, ``columns`` (size, k) by its
    probes.
    """

    term: Term
    offset: np.ndarray
    columns: np.ndarray
    fitted: bool = False  # columns are derivatives by the natural coordinates at a fit

    def start(self, rig: Rig, coefficients: np.ndarray) -> np.ndarray:
        """Natural coordinates (n,) that belong to coefficients of the columns."""
        t = self.term
        return coefficients if self.fitted else t.effect.start(rig, t.where, coefficients, t.variant)


def candidates(rig: Rig, vocabulary: Mapping[str, Effect], asked: Collection[str] = ()) -> list[Term]:
    """Every effect at every place in every variant; of those that must be asked for, what is ``asked`` for by name or
    label.
    """
    found = []
    for effect in vocabulary.values():
        for where in effect.places(rig):
            terms = [Term(effect, where, variant) for variant in effect.variants(rig, where)]
            found += [t for t in terms if not effect.asked_for or {effect.name, t.label} & set(asked)]
    return found


def sensitivities(fitter: Fitter, base: Fit, terms: Sequence[Term]) -> dict[Term, Sensitivity]:
    """Sensitivities of all terms that the data can see, about a fit (mostly of the nominal model) that has none of
    them.
    """
    rig, found = fitter.rig, {}
    start = dict(zip(base.terms, base.x, strict=True))
    for term in terms:
        if term in start:
            continue
        probes = term.effect.probes(rig, term.where, term.variant)
        still = [np.zeros(probes.shape[1])] if term.effect.acts_by_itself(term.variant) else []
        points = [*still, *probes]
        residuals = fitter.residuals([*base.terms, term], [[*start.values(), p] for p in points])
        if any(r is None for r in residuals):
            continue
        kept = [r for r in residuals if r is not None]
        origin = kept[0] if still else base.residual
        columns = np.column_stack([r - origin for r in kept[len(still) :]])
        offset = origin - base.residual
        if np.abs(columns).max() > VISIBLE or np.abs(offset).max() > VISIBLE:
            found[term] = Sensitivity(term, offset, columns)
    return found


@dataclass(frozen=True)
class Columns:
    """Columns (size, n) of terms side by side, of unit length, with all their products."""

    sensitivities: Mapping[Term, Sensitivity]
    parts: tuple[np.ndarray, ...]  # the columns, in an order of their own
    order: np.ndarray  # (n,) where each is in that
    edges: np.ndarray  # (terms + 1,) where each term's begin
    norm: np.ndarray  # (n,) their length before
    scales: np.ndarray  # (n,) how many of the effect's own scales one of each is
    gram: np.ndarray  # (n, n)
    offsets: Mapping[int, tuple[np.ndarray, np.ndarray]]  # by term what its variant does by itself, and (n,) products

    @classmethod
    def of(cls, rig: Rig, found: Mapping[Term, Sensitivity], basis: np.ndarray) -> Columns:
        """The columns without what an orthonormal basis (size, b) tells of them."""
        columns = [s.columns - basis @ (basis.T @ s.columns) for s in found.values()]
        stacked = np.concatenate(columns, axis=1) if columns else np.zeros((len(basis), 0))
        scales = np.concatenate([np.zeros(0), *(_unit(rig, s) for s in found.values())])
        norm = np.linalg.norm(stacked, axis=0)
        rounding = scales * norm <= UNSEEN
        stacked[:, rounding] = 0.0
        norm[rounding] = 1.0
        stacked /= norm
        edges = np.cumsum([0, *(c.shape[1] for c in columns)])
        offsets = {i: (s.offset, stacked.T @ s.offset) for i, s in enumerate(found.values()) if s.offset.any()}
        return cls(found, (stacked,), np.arange(edges[-1]), edges, norm, scales, stacked.T @ stacked, offsets)

    def onto(self, vector: np.ndarray) -> np.ndarray:
        """Products (n,) with a vector (size,)."""
        return np.concatenate([part.T @ vector for part in self.parts])[self.order]

    def replaced(self, rig: Rig, own: Mapping[Term, Sensitivity]) -> Columns:
        """The same with other columns of some terms, or with more terms; products of the rest are known."""
        if not own:
            return self
        size = len(self.parts[0])
        more, found = Columns.of(rig, own, np.zeros((size, 0))), {**self.sensitivities, **own}
        before = {t: np.arange(*self.edges[i : i + 2]) for i, t in enumerate(self.sensitivities)}
        new = {t: len(self.norm) + np.arange(*more.edges[i : i + 2]) for i, t in enumerate(own)}
        each = [(before | new)[t] for t in found]
        pick = np.concatenate(each)
        across = np.array([self.onto(column) for column in more.parts[0].T]).reshape(len(more.norm), len(self.norm))
        gram = np.block([[self.gram, across.T], [across, more.gram]])[np.ix_(pick, pick)]
        place = {t: i for i, t in enumerate(found)}
        terms = list(self.sensitivities)
        kept = {place[terms[i]]: offset for i, offset in self.offsets.items() if terms[i] not in own}
        offsets = {i: (o, np.concatenate([known, more.onto(o)])[pick]) for i, (o, known) in kept.items()}
        for i, (o, known) in more.offsets.items():
            offsets[place[list(own)[i]]] = o, np.concatenate([self.onto(o), known])[pick]
        return Columns(
            found,
            (*self.parts, *more.parts),
            np.concatenate([self.order, sum(part.shape[1] for part in self.parts) + more.order])[pick],
            np.cumsum([0, *(e.size for e in each)]),
            np.concatenate([self.norm, more.norm])[pick],
            np.concatenate([self.scales, more.scales])[pick],
            gram,
            dict(sorted(offsets.items())),
        )


def _unit(rig: Rig, sensitivity: Sensitivity) -> np.ndarray:
    """How many of the effect's own scales one of each column is."""
    t = sensitivity.term
    own = t.effect.scales(rig, t.where, t.variant) if sensitivity.fitted else np.ones(sensitivity.columns.shape[1])
    return np.asarray(own, float)


class Screen:
    """The linear problem of all sensitivities: which sets of terms lower chi^2 most.

    ``residual`` is that of the model without any of the terms, less what every set has.
    """

    def __init__(self, rig: Rig, residual: np.ndarray, columns: Columns) -> None:
        self.rig, self.sensitivities, self.terms = rig, columns.sensitivities, list(columns.sensitivities)
        self.edges, self.norm, self.gram = columns.edges, columns.norm, columns.gram
        group = np.repeat(np.arange(len(self.terms)), np.diff(self.edges))
        self.reluctance = reluctance(columns.scales * self.norm, group)
        self.chi2 = float(residual @ residual)
        self.wanted = -columns.onto(residual)
        # what a variant does by itself changes the residual before any column does: by how much it gains, and what is
        # wanted then
        self.offsets = {
            i: (self.chi2 - float((residual + o) @ (residual + o)), told, o) for i, (o, told) in columns.offsets.items()
        }

    def gain(self, chosen: Sequence[int]) -> tuple[float, np.ndarray]:
        """Decrease of chi^2 by a set of terms, and the coefficients of their columns."""
        where = self.columns(chosen)
        wanted, extra = self.wanted[where], 0.0
        turned = [self.offsets[i] for i in chosen if i in self.offsets]
        for k, (gained, change, offset) in enumerate(turned):
            wanted = wanted - change[where]
            extra += gained - 2 * sum(float(offset @ other) for _, _, other in turned[:k])
        matrix = self.gram[np.ix_(where, where)] + np.diag(self.reluctance[where])
        solved = np.linalg.solve(matrix, wanted)
        return extra + float(wanted @ solved), solved / self.norm[where]

    def best_sets(
        self, rig: int, sensors: int, cost: Mapping[Term, float]
    ) -> Iterator[list[tuple[float, tuple[int, ...]]]]:
        """For each number of terms the sets that gain most net of their cost, best first, with at most so many effects
        of the rig and faults of ``sensors``.
        """
        beam: list[tuple[int, ...]] = [()]
        of_sensor = np.array([t.effect.sensor for t in self.terms])
        price = np.array([cost[t] for t in self.terms])
        for _ in range(rig + sensors):
            grown: dict[tuple[int, ...], float] = {}
            for chosen in beam:
                taken = {self.terms[i].key for i in chosen}
                full = {
                    kind
                    for kind, most in ((True, sensors), (False, rig))
                    if sum(of_sensor[list(chosen)] == kind) >= most
                }
                paid = float(price[list(chosen)].sum())
                for i, gain in enumerate(self.further(chosen)):
                    new = tuple(sorted((*chosen, i)))
                    if self.terms[i].key not in taken and of_sensor[i] not in full and new not in grown:
                        grown[new] = float(gain) - paid - price[i]
            best = sorted(((net, chosen) for chosen, net in grown.items()), key=lambda item: (-item[0], item[1]))[:BEAM]
            if not best:
                return
            yield best
            beam = [chosen for _, chosen in best]

    def further(self, chosen: Sequence[int]) -> np.ndarray:
        """Decrease of chi^2 (terms,) by a set and each further term: what the set leaves of the terms' columns is found
        once.
        """
        where = self.columns(chosen)
        gain, _ = self.gain(chosen) if chosen else (0.0, None)
        wanted = self.wanted.copy()
        for i in chosen:
            if i in self.offsets:
                wanted -= self.offsets[i][1]
        inside = self.gram[np.ix_(where, where)] + np.diag(self.reluctance[where])
        across = self.gram[where]
        solved = np.linalg.solve(inside, np.column_stack([across, wanted[where]])) if where.size else across
        left = wanted - across.T @ solved[:, -1] if where.size else wanted
        turned = [i for i in range(len(self.terms)) if i in self.offsets]
        if any(i in self.offsets for i in chosen):
            turned = list(range(len(self.terms)))
        out = np.empty(len(self.terms))
        for these, at in self.blocks:
            matrix = self.gram[at[:, :, None], at[:, None, :]] + np.eye(at.shape[1]) * (
                self.reluctance[at][:, :, None] + 1e-10
            )
            if where.size:
                matrix -= np.einsum("cki,ckj->kij", across[:, at], solved[:, :-1][:, at])
            out[these] = gain + np.einsum("ki,ki->k", left[at], np.linalg.solve(matrix, left[at][:, :, None])[:, :, 0])
        for i in turned:
            out[i] = -math.inf if i in chosen else self.gain(sorted((*chosen, i)))[0]
        return out

    @cached_property
    def blocks(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Terms (k,) that have equally many columns, and where these (k, n) are among all."""
        counts = np.diff(self.edges)
        by_count = [np.flatnonzero(counts == n) for n in np.unique(counts)]
        return [(these, self.edges[these][:, None] + np.arange(counts[these[0]])) for these in by_count]

    def columns(self, chosen: Sequence[int]) -> np.ndarray:
        """Where the columns of a set of terms are among all."""
        parts = [np.arange(self.edges[i], self.edges[i + 1]) for i in chosen]
        return np.concatenate(parts) if parts else np.zeros(0, int)

    def starts(self, chosen: Sequence[int]) -> dict[Term, np.ndarray]:
        """Natural coordinates of each term of a set at the linear optimum."""
        coefficients = self.gain(chosen)[1]
        out, at = {}, 0
        for i in chosen:
            k = int(self.edges[i + 1] - self.edges[i])
            out[self.terms[i]] = self.sensitivities[self.terms[i]].start(self.rig, coefficients[at : at + k])
            at += k
        return out
