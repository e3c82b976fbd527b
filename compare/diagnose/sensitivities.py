"""Which effects could make this residual: the sensitivity of the data to every candidate.

A sensitivity is how the readings of all runs answer to a little of an effect, in units of their noise.  With all of
them side by side, every set of effects is a small linear problem.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from compare.diagnose.effects.effect import Effect, Rig
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.predict import Term

VISIBLE = 1e-6  # sigmas: an effect whose sensitivity is smaller in every sample is invisible


@dataclass(frozen=True)
class Sensitivity:
    """How the residual answers to a term: ``offset`` (size,) by its variant alone, ``columns`` (size, k) by its
    probes.
    """

    term: Term
    offset: np.ndarray
    columns: np.ndarray

    def start(self, rig: Rig, coefficients: np.ndarray) -> np.ndarray:
        """Natural coordinates (n,) that belong to coefficients of the columns."""
        t = self.term
        return t.effect.start(rig, t.where, coefficients, t.variant)


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
