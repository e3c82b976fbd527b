"""What a posterior says: the effects that stand, how probable and how large each is, what may be in its place, and the
verdict.

An effect is named where its probability, with that of what may be in its place, is ``NAMED_FROM`` or more.
Prediction of data left out can veto.  Of rigs that rattle it is :mod:`compare.diagnose.rattle.explained` that names.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from compare.diagnose.competing import competing
from compare.diagnose.explanation import (
    MODEL,
    SLIGHT,
    Attempt,
    Explanation,
    Named,
    has_structure,
    verdict,
)
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.intervals import Interval, covariance, intervals
from compare.diagnose.least_squares import ROUGHLY
from compare.diagnose.left_out import foretold, held_out
from compare.diagnose.noise import rms
from compare.diagnose.posterior.infer import Posterior, Weighed
from compare.diagnose.posterior.prior import CREDIBLE
from compare.diagnose.predict import Term

TIED = 0.01  # probability from which on something may be in an effect's place: of a hundred names one may be wrong
NAMED_FROM = 5 / 6  # probability, with what may be in its place: a false name costs as much as five missed ones
IMPROBABLE = ""  # no test failed: the effect is not probable enough
TOLD = 6  # effects that are not named, of which it is told how probable they are


@dataclass(frozen=True)
class Standing:
    """What is left of the most probable set: its fit, the same where samples count alike, and what fell, with why."""

    fit: Fit
    judged: Fit
    fell: tuple[tuple[Term, str], ...] = ()

    @property
    def named(self) -> list[Term]:
        """Its effects."""
        return [self.fit.terms[i] for i in self.fit.named()]


def explained(found: Posterior, base: Fit, late: Callable[[], bool]) -> Explanation:
    """The explanation of data by the most probable set; ``base`` is the nominal model's fit."""
    judge = found.judge
    base = at_judge(found, base)
    standing = stood(found, base)
    fit, weights = standing.judged, np.ones(judge.data.size)
    named = [named_effect(found, standing, base, i) for i in fit.named()]
    ordered = shared_out(judge, base, fit, sorted(named, key=lambda n: -n.chi2_gain))
    structured = has_structure(judge.data, fit.residual, MODEL if named else SLIGHT)
    said = verdict(fit, ordered, structured)
    attempts = [] if said in ("no gap", "explained") or late() else left_out(found, standing, base)
    together = covariance(found.fitter, standing.fit, weights)
    return Explanation(
        base, fit, ordered, said, weights, structured, tuple(attempts), sets=found.sets, covariance=together,
        competing=competing(found),
    )  # fmt: skip


# ---------------------------------------------------------------- what stands


def stood(found: Posterior, base: Fit) -> Standing:
    """The most probable set without what is not likely, is nothing at its bound, or does not foretell data left out."""
    standing = Standing(found.best.fit, found.judged)
    unlikely = []
    for term in standing.named:
        together = found.probability(term.key) + sum(found.instead(term.key).values())
        if together < NAMED_FROM:
            unlikely.append((term, IMPROBABLE))
    standing = fallen(found, base, standing, unlikely)
    while True:
        idle = [(t, "the data want it to be nothing, or beyond the physical") for t in at_nothing(standing.fit)]
        worse = idle or not_foretold(found, base, standing)[:1]
        if not worse:
            return standing
        standing = fallen(found, base, standing, worse)


def at_nothing(fit: Fit) -> list[Term]:
    """Effects that a fit leaves at a bound where they do nothing."""
    return [
        fit.terms[i] for i in fit.named() if fit.bound[fit.columns(i)].any() and not np.any(fit.x[i]) and fit.x[i].size
    ]


def not_foretold(found: Posterior, base: Fit, standing: Standing) -> list[tuple[Term, str]]:
    """Effects without which data left out are foretold better, the worst first."""
    data, weights = found.judge.data, np.ones(found.judge.data.size)
    whole, worse = foretold(found.fitter.data, standing.fit, weights), []
    for term in standing.named:
        less, _ = refitted(found, base, standing.fit, [t for t in standing.named if t != term])
        loss = whole - foretold(data, less, weights)
        if loss > 0:
            worse.append((loss, term))
    said = "data that it was not fitted to are foretold better without it (by {:.2g} of chi-squared)"
    return [(term, said.format(loss)) for loss, term in sorted(worse, key=lambda item: -item[0])]


def fallen(found: Posterior, base: Fit, standing: Standing, fell: Sequence[tuple[Term, str]]) -> Standing:
    """What stands without some of its effects."""
    if not fell:
        return standing
    kept = [t for t in standing.named if t not in {term for term, _ in fell}]
    return Standing(*refitted(found, base, standing.fit, kept, rough=0.0), (*standing.fell, *fell))


def refitted(found: Posterior, base: Fit, fit: Fit, kept: Collection[Term], rough: float = ROUGHLY) -> tuple[Fit, Fit]:
    """The fit of some of a fit's effects, and the same where samples count alike; one whose values are said is not
    ``rough``.
    """
    now = dict(zip(fit.terms, fit.x, strict=True))
    terms = [t for t in fit.terms if t in base.terms or t in kept]
    best = found.fitter.likeliest({t: found.best.sizes[t] for t in terms}, {t: now[t] for t in terms}, rough)
    if best is None:
        return found.fitter.again(base) or base, base
    return best, at_judge(found, best)


def at_judge(found: Posterior, fit: Fit) -> Fit:
    """A fit where samples count alike."""
    return found.judge.again(fit) or fit


# ---------------------------------------------------------------- what is said of an effect


def named_effect(found: Posterior, standing: Standing, base: Fit, i: int) -> Named:
    """An effect that stands, with what may be in its place."""
    fit, judged, term = standing.fit, standing.judged, standing.judged.terms[i]
    less = refitted(found, base, fit, [t for t in standing.named if t != term])[1]
    data = found.judge.data
    rivals = tied(found, standing, term)
    return Named(
        term,
        credible(found, fit, i),
        less.chi2 - judged.chi2,
        (rms(less.residual), rms(judged.residual)),
        (rms(held_out(data, less)), rms(held_out(data, judged))),
        tuple((rival, at_judge(found, each.fit)) for rival, each, _ in rivals),
        odds=tuple(share / max(found.probability(term.key), 1e-12) for _, _, share in rivals),
        probability=found.probability(term.key),
    )


def tied(found: Posterior, standing: Standing, term: Term) -> list[tuple[Term, Weighed, float]]:
    """What may credibly be in the place of an effect, with the most probable set that has it there, and its share."""
    others = {t.key for t in standing.named}
    ties = []
    for key, share in found.instead(term.key).items():
        having = [w for w in found.fitted if key in w.keys and term.key not in w.keys]
        if share < TIED or key in others or not having:
            continue
        best = max(having, key=lambda w: w.log)
        rival = next((t for t in best.fit.terms if t.key == key), None)
        ties += [] if rival is None else [(rival, best, share)]
    return ties


def credible(found: Posterior, fit: Fit, i: int) -> dict[str, Interval]:
    """The intervals of an effect's values, which hold in every credible set that has it."""
    term, weights = fit.terms[i], np.ones(fit.residual.size)
    known = intervals(found.fitter, fit, i, weights)
    for other in found.fitted:
        if other.keys != found.keys and found.sets.get(other.keys, 0.0) >= CREDIBLE and term in other.fit.terms:
            there = intervals(found.fitter, other.fit, other.fit.terms.index(term), weights)
            for p, v in known.items():
                known[p] = replace(v, low=min(v.low, there[p].low), high=max(v.high, there[p].high))
    return known


def shared_out(judge: Fitter, base: Fit, fit: Fit, named: Sequence[Named]) -> tuple[Named, ...]:
    """The effects with each one's share of the squared gap, added one after the other as they are listed."""
    now = dict(zip(fit.terms, fit.x, strict=True))
    told, before = list[Named](), base.chi2
    for k, n in enumerate(named):
        terms = [*base.terms, *(m.term for m in named[: k + 1])]
        so_far = fit if k + 1 == len(named) else judge.fit(terms, {t: now[t] for t in terms})
        after = before if so_far is None else so_far.chi2
        told.append(replace(n, share=(before - after) / max(base.chi2, 1e-300)))
        before = after
    return tuple(told)


# ---------------------------------------------------------------- what is not named


def left_out(found: Posterior, standing: Standing, base: Fit) -> list[Attempt]:
    """Effects that are not named, with how probable they are: those that fell, and the most probable of all others."""
    taken = {t.key for t in standing.named}
    attempts = [attempt(found, standing, base, found.best, term, why) for term, why in standing.fell]
    told = taken | {t.key for t, _ in standing.fell}
    for weighed in sorted(found.fitted, key=lambda w: -w.log):
        for i in weighed.fit.named():
            term = weighed.fit.terms[i]
            if term.key not in told and len(attempts) < TOLD:
                told.add(term.key)
                attempts.append(attempt(found, standing, base, weighed, term, IMPROBABLE))
    return attempts


def attempt(found: Posterior, standing: Standing, base: Fit, weighed: Weighed, term: Term, why: str) -> Attempt:
    """An effect that is not named, as the set has it in which it is most probable."""
    fit = weighed.fit
    now = dict(zip(fit.terms, fit.x, strict=True))
    more = found.judge.at(fit.terms, now) or standing.judged
    less = found.judge.at([t for t in fit.terms if t != term], now) or base
    share = (less.chi2 - more.chi2) / max(base.chi2, 1e-300)
    parameters = intervals(found.judge, more, more.terms.index(term), np.ones(more.residual.size))
    return Attempt(term, parameters, share, (rms(less.residual), rms(more.residual)), why)
