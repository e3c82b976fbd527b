"""Small errors that every rig has: whether a few of them together explain what a small effect is named for.

Where everything is a little off, one gain of a sensor may stand for three lengths and a pivot.
"""

from __future__ import annotations

import math

import numpy as np

from compare.diagnose.admission import WHOLE
from compare.diagnose.fit import Fit
from compare.diagnose.predict import Term
from compare.diagnose.search import Search, without
from compare.diagnose.sensitivities import BEAM, Screen

SMALL = WHOLE  # of the squared gap: effects with a larger share are no matter of workmanship
TOGETHER = (2, 3)  # errors in place of one effect
LEAST = 0.01  # of what workmanship leaves: a smaller error takes no part
FITTED = 3  # bundles of each size that are fitted in full


def bundle(search: Search, fit: Fit, weights: np.ndarray, term: Term, worse: float) -> tuple[tuple[Term, ...], Fit]:
    """Two or three errors of the rig, each no larger than workmanship allows, that explain the data as well in place of
    a term of a fit: at most ``worse`` of weighted chi^2 behind it.  Few before many; none where there are none.
    """
    screen = search.screen(fit)
    others = without(fit, fit.terms.index(term))
    base = [screen.terms.index(t) for t in others]
    taken = {t.key for t in others} | {term.key}
    small = [k for k, t in enumerate(screen.terms) if t.effect.workmanship and t.key not in taken]
    own = screen.gain(sorted([*base, screen.terms.index(term)]))[0]
    margin = 2 * worse / max(float(weights.min()), 1e-12)
    beam: list[tuple[float, tuple[int, ...]]] = [(0.0, ())]
    for size in range(1, max(TOGETHER) + 1):
        grown = {tuple(sorted((*chosen, k))) for _, chosen in beam for k in small if _new(screen, chosen, k)}
        ranked = sorted(((screen.gain(sorted([*base, *c]))[0], c) for c in grown), key=lambda item: (-item[0], item[1]))
        beam = ranked[:BEAM]
        if size not in TOGETHER:
            continue
        for gain, chosen in beam[:FITTED]:
            if gain < own - margin:
                break
            terms = tuple(screen.terms[k] for k in chosen)
            found = search.with_terms(fit, screen, [*others, *terms])
            if (
                found is not None
                and float(weights @ (found.residual**2 - fit.residual**2)) < worse
                and all(LEAST <= size_of(search, found, t) <= 1 for t in terms)
            ):
                return terms, found
    return (), fit


def size_of(search: Search, fit: Fit, term: Term) -> float:
    """The size of an effect of a fit over what workmanship leaves; infinite where it is no matter of workmanship."""
    if not term.effect.workmanship:
        return math.inf
    scales = np.asarray(term.effect.scales(search.rig, term.where, term.variant), float)
    return float(np.linalg.norm(fit.x[fit.terms.index(term)] / scales)) / term.effect.workmanship


def _new(screen: Screen, chosen: tuple[int, ...], k: int) -> bool:
    return screen.terms[k].key not in {screen.terms[i].key for i in chosen}
