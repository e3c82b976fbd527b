"""The sets of effects that compete to be what is missing, each with its values and how well they are known together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.intervals import Covariance, covariance
from compare.diagnose.posterior.infer import TOLD_FROM, Posterior

NOTHING = 1e-6  # of a coordinate's scale
Keys = frozenset[tuple[str, str]]


@dataclass(frozen=True)
class Competing:
    """A set's values (SI) by ``effect@where.parameter``, and their covariance."""

    values: Mapping[str, float]
    covariance: Covariance = field(repr=False)


def competing(found: Posterior) -> dict[Keys, Competing]:
    """The likely sets that were fitted in full, by their effects; of one that was fitted in several forms the best.

    One in which an effect came out as nothing (a spring of no stiffness, which is a constant force) has no values.
    """
    told: dict[Keys, Competing | None] = {}
    for weighed in sorted(found.fitted, key=lambda w: -w.log):
        if weighed.keys not in told and found.sets.get(weighed.keys, 0.0) >= TOLD_FROM:
            there = all(_there(found.fitter, weighed.fit, i) for i in weighed.fit.named())
            told[weighed.keys] = together(found.fitter, weighed.fit) if there else None
    return {keys: each for keys, each in told.items() if each is not None}


def together(fitter: Fitter, fit: Fit) -> Competing:
    """The reported values of a fit's effects, and their covariance."""
    values: dict[str, float] = {}
    for i in fit.named():
        term = fit.terms[i]
        reported = term.effect.values(fitter.rig, term.where, fit.x[i], term.variant)
        values |= {f"{term.label}.{name}": value for name, value in reported.items()}
    return Competing(values, covariance(fitter, fit, np.ones(fit.residual.size)))


def _there(fitter: Fitter, fit: Fit, i: int) -> bool:
    """Whether an effect of a fit is more than nothing, if it cannot be negative."""
    term = fit.terms[i]
    amount = fitter.bounds(term)[0] == 0
    scale = np.asarray(term.effect.scales(fitter.rig, term.where, term.variant), float)
    return not amount.any() or bool((fit.x[i][amount] > NOTHING * scale[amount]).any())
