"""The odds between two explanations of the same data: how probable each makes them."""

from __future__ import annotations

import math

import numpy as np

from compare.diagnose.effects.sensors import in_each_run
from compare.diagnose.fit import Fit
from compare.diagnose.noise import rms
from compare.diagnose.search import Search


def odds_of(search: Search, one: Fit, other: Fit, weights: np.ndarray) -> float:
    """How likely one fit is beside another, by their evidence."""
    return math.exp(min(evidence(search, one, weights) - evidence(search, other, weights), 40.0))


def evidence(search: Search, fit: Fit, weights: np.ndarray) -> float:
    """Logarithm of a fit's probability, but for a constant: what it leaves of weighted chi^2; how much of what its
    values might have been the data rule out (Laplace); and that each effect is one of many of the rig's, or of the
    sensors', that might have been.

    A value might have been as large as it is, and those of a sensor in each run as large as they are in all (rms).
    """
    width = np.abs(np.concatenate([*fit.x, np.zeros(0)]))
    for i, term in enumerate(fit.terms):
        if in_each_run(term.effect, term.variant):
            width[fit.columns(i)] = rms(fit.x[i])
    scaled = fit.jacobian * width * np.sqrt(weights)[:, None]
    ruled_out = np.linalg.slogdet(np.eye(width.size) + scaled.T @ scaled)[1] if width.size else 0.0
    many = {kind: len({t.key for t in search.cost if t.effect.sensor == kind}) for kind in (True, False)}
    one_of = sum(math.log(max(many[fit.terms[i].effect.sensor], 1)) for i in fit.named())
    return float(-(weights @ fit.residual**2) - ruled_out) / 2 - one_of
