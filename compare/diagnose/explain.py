"""Name the missing effects: keep what improves held-out data, try every rival, and say where the data cannot decide.

Sets of effects are compared by chi^2.  Where the final residual is more than noise, or is coloured, each sensor's
share of chi^2 is divided by its excess and by its correlation time, so that N samples count as many as are independent.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import cast

import numpy as np
from scipy.stats import chi2

from compare.diagnose import workmanship
from compare.diagnose.admission import foretold, held_out, tried
from compare.diagnose.fit import Fit, rank_of, without_columns
from compare.diagnose.intervals import Covariance, Interval, covariance, intervals
from compare.diagnose.noise import CLOSED, rms, sample_weights
from compare.diagnose.odds import odds_of
from compare.diagnose.predict import Term
from compare.diagnose.rattle.statistics import Statistics
from compare.diagnose.residuals import Data
from compare.diagnose.search import Search, a_parameter, without
from compare.diagnose.sensitivities import Screen
from compare.results.diagnosis import DiagnosisVerdict

TIE = 16.0  # of chi^2: two explanations closer than four sigmas are not told apart
RICHER = 0.01  # chance that a richer explanation does better by luck
RIVALS = 10  # fitted in full for each named effect and drive: a platform of three legs has twenty that do as well
EVEN = 1.05  # odds no larger are even
NEAREST = 3  # fitted at least where the screen holds only near a fit
SWAPS = 7  # of a named effect for a rival that does better
TRIED = 6  # further effects whose trial is told where something remains
STRUCTURE = 1e-6  # chance of as much structure in noise alone
BINS = 24
SLIGHT = 0.3  # of the noise: structure that is accepted
MODEL = 1.0  # the same beside named effects: models of contact and bending are not exact to the last micrometre


@dataclass(frozen=True)
class Named:
    """An effect that the data show."""

    term: Term
    parameters: dict[str, Interval]
    chi2_gain: float  # weighted decrease of chi^2 that it brings
    gap: tuple[float, float]  # before, after
    held_out: tuple[float, float]
    ties: tuple[tuple[Term, Fit], ...] = ()  # what explains the data as well in its place
    share: float = 0.0  # of the squared gap, before any effect: what it takes away when the effects are added in order
    odds: tuple[float, ...] = ()  # of each tie against this effect, by their evidence
    small_errors: tuple[tuple[Term, dict[str, Interval]], ...] = ()  # that do as well
    probability: float | None = None  # summed over the sets of effects that have it


@dataclass(frozen=True)
class Attempt:
    """An effect that takes something of the gap away and is not named; ``failed`` says which test it failed, by how
    much, and nothing where it is only improbable.
    """

    term: Term
    parameters: dict[str, Interval]
    share: float  # of the squared gap, beside the effects that are named
    gap: tuple[float, float]  # without it, with it
    failed: str


Judged = tuple[list[Named], list[tuple[float, int, Attempt]]]


@dataclass(frozen=True)
class Explanation:
    """What the data say."""

    base: Fit
    fit: Fit
    named: tuple[Named, ...]
    verdict: DiagnosisVerdict
    weights: np.ndarray = field(repr=False)  # (size,) of each sample
    structured: bool  # whether what is left is more than noise
    attempts: tuple[Attempt, ...] = ()  # what was tried and not named, best first
    statistics: Statistics | None = None  # by which a rig that rattles is judged, in place of its samples
    sets: Mapping[frozenset[tuple[str, str]], float] = field(default_factory=dict)  # how probable sets of effects are
    covariance: Covariance | None = field(default=None, repr=False)  # of all named parameters

    @cached_property
    def gap(self) -> tuple[float, float]:
        """Root mean square residual in units of noise, before and after."""
        return rms(self.base.residual), rms(self.fit.residual)


def explain(search: Search, fit: Fit) -> Explanation:
    """What a fit says: which of its effects stand, how large and how sure they are, what else explains the data, and
    the verdict.
    """
    data = search.fitter.data
    search.rivals = True
    attempts: list[Attempt] = []
    for last in (*(False,) * SWAPS, True):
        fit, weights, found, fell = pruned(search, fit)
        attempts += fell
        plain = None if last or search.late() else plainer(search, fit, weights)
        if plain is not None:
            fit = plain
            continue
        named = tuple(n if search.late() else rivalled(search, fit, weights, n) for n in found)
        tied = [rival for n in named for _, rival in n.ties]
        merged = [one for rival in tied if (one := merged_in(search, rival)) is not None]
        better = [rival for rival in (*tied, *merged) if search.beats(rival, fit)]
        if last or not better:
            break
        fit = min(better, key=lambda rival: float(weights @ rival.residual**2) + search.price(rival))
    fit, weights, named = unblamed(search, fit, weights, named)
    named = shared_out(search, fit, sorted(widened(search, weights, named), key=lambda n: -n.chi2_gain))
    if not search.late():
        named = tuple(with_bundle(search, fit, weights, n) for n in named)
    structured = has_structure(data, fit.residual, MODEL if named else SLIGHT)
    said = verdict(fit, named, structured)
    if said not in ("no gap", "explained") and not search.late():
        attempts += beside(search, fit, weights, {a.term.key for a in attempts})
    named_keys = {n.term.key for n in named}
    best: dict[tuple[str, str], Attempt] = {}
    for attempt in sorted(attempts, key=lambda a: -a.share):
        if attempt.term.key not in named_keys:
            best.setdefault(attempt.term.key, attempt)
    together = covariance(search.fitter, fit, weights)
    return Explanation(search.base, fit, named, said, weights, structured, tuple(best.values()), covariance=together)


def pruned(search: Search, fit: Fit) -> tuple[Fit, np.ndarray, list[Named], list[Attempt]]:
    """The fit without effects that bring too little, the weights of its samples, the effects that stay, and those that
    fell.
    """
    fell: list[Attempt] = []
    while True:
        weights = sample_weights(search.fitter.data, fit.residual)
        if search.judged is None or search.judged[0] is not fit:
            search.judged = fit, admitted(search, fit, weights)
        named, failing = cast(Judged, search.judged[1])
        if not failing:
            return fit, weights, named, fell
        _, weakest, attempt = min(failing, key=lambda f: f[0])
        fell.append(attempt)
        fit = search.with_terms(fit, search.screen(fit), without(fit, weakest)) or search.base
        if any(t.effect.leaps for t in fit.terms):
            fit = search.fitter.settled(fit)


def merged_in(search: Search, rival: Fit) -> Fit | None:
    """A fit without those of its effects that a richer one at the same place has in it; None where there is none."""
    terms = [rival.terms[i] for i in rival.named()]
    rest = [t for t in terms if not any(u.extends(t) for u in terms)]
    return search.with_terms(rival, search.screen(rival), rest) if len(rest) < len(terms) else None


def plainer(search: Search, fit: Fit, weights: np.ndarray) -> Fit | None:
    """A fit with the simple form of one of its effects that does not earn its further parameters; None where all do."""
    for i in fit.named():
        rich = fit.terms[i]
        values = rich.effect.values(search.rig, rich.where, fit.x[i], rich.variant)
        for simple in filter(rich.extends, search.cost):
            known = {p.name: values[p.name] for p in simple.effect.parameters}
            start = {t: x for t, x in zip(fit.terms, fit.x, strict=True) if t != rich}
            start[simple] = simple.effect.natural(search.rig, simple.where, known, simple.variant)
            plain = search.fitter.fit(list(start), start)
            more = len(rich.effect.parameters) - len(simple.effect.parameters)
            if plain is not None and not outdoes(search, weights, fit, plain, more):
                return plain
    return None


def shared_out(search: Search, fit: Fit, named: Sequence[Named]) -> tuple[Named, ...]:
    """The effects with each one's share of the squared gap, added one after the other as they are listed."""
    screen, before = search.screen(fit), search.base.chi2
    shares: dict[Term, float] = {}
    for k, n in enumerate(named):
        so_far = search.with_terms(fit, screen, [m.term for m in named[: k + 1]]) if k + 1 < len(named) else fit
        after = before if so_far is None else so_far.chi2
        shares[n.term] = (before - after) / max(search.base.chi2, 1e-300)
        before = after
    return tuple(replace(n, share=shares[n.term]) for n in named)


def beside(search: Search, fit: Fit, weights: np.ndarray, known: Collection[tuple[str, str]]) -> list[Attempt]:
    """What further effects would bring beside those of a fit, the best few, and why each is not named."""
    screen = search.screen(fit)
    own = [screen.terms.index(fit.terms[i]) for i in fit.named()]
    start = screen.gain(own)[0] if own else 0.0
    best: dict[tuple[str, str], tuple[float, int]] = {}
    for k, term in enumerate(screen.terms):
        if term.key not in known and k not in own and term.key not in {screen.terms[i].key for i in own}:
            gain = screen.gain(sorted([*own, k]))[0] - start
            best[term.key] = max(best.get(term.key, (-math.inf, k)), (gain, k))
    found = []
    for _, k in sorted(best.values(), reverse=True)[:TRIED]:
        more = search.with_terms(fit, screen, [*(fit.terms[i] for i in fit.named()), screen.terms[k]])
        if more is None:
            continue
        i = more.terms.index(screen.terms[k])
        trial = tried(search, more, fit, i, sample_weights(search.fitter.data, more.residual))
        if trial.gain <= 0 or more.bound[more.columns(i)].any():  # it brings nothing, or wants an unphysical value
            continue
        share = (fit.chi2 - more.chi2) / max(search.base.chi2, 1e-300)
        gap = rms(fit.residual), rms(more.residual)
        why = trial.failed or "with it, another of the effects would no longer be needed"
        found.append(Attempt(screen.terms[k], intervals(search.fitter, more, i, weights), share, gap, why))
    return found


def verdict(fit: Fit, named: Sequence[Named], structured: bool) -> DiagnosisVerdict:
    """One of the five verdicts."""
    closed = rms(fit.residual) <= CLOSED and not structured
    if not named:
        return "no gap" if closed else "unexplained"
    if not closed:
        return "partly explained"
    return "ambiguous" if any(n.ties for n in named) else "explained"


def has_structure(data: Data, residual: np.ndarray, slight: float = SLIGHT) -> bool:
    """Whether the residual's local means are more than noise, and more than ``slight`` of it (rms)."""
    for part in data.parts:
        r = residual[part.place]
        if r.size < 2 * BINS:
            continue
        scale = max(1.0, float(np.std(np.diff(r))) / math.sqrt(2))
        bins = np.array_split(r, BINS)
        means = np.array([b.mean() * math.sqrt(b.size) for b in bins]) / scale
        if chi2.sf(float(means @ means), BINS) < STRUCTURE and rms(np.array([b.mean() for b in bins])) > slight * scale:
            return True
    return False


# ------------------------------------------------------------------ admission


def admitted(search: Search, fit: Fit, weights: np.ndarray) -> Judged:
    """The effects of a fit with what each brings, and those that must not be named: how much each brings, and where it
    is in the fit.
    """
    screen, data = search.screen(fit), search.fitter.data
    found, failing = [], []
    told, held_with = foretold(data, fit, weights), rms(held_out(data, fit))
    for i in fit.named():
        less = search.with_terms(fit, screen, without(fit, i)) or search.base
        trial = tried(search, fit, less, i, weights, told)
        gap = rms(less.residual), rms(fit.residual)
        parameters = intervals(search.fitter, fit, i, weights)
        if trial.failed:
            share = (less.chi2 - fit.chi2) / max(search.base.chi2, 1e-300)
            failing.append((trial.gain, i, Attempt(fit.terms[i], parameters, share, gap, trial.failed)))
        held = rms(held_out(data, less)), held_with
        found.append(Named(fit.terms[i], parameters, trial.gain, gap, held))
    return found, failing


# ------------------------------------------------------------------ rivals


def rivalled(search: Search, fit: Fit, weights: np.ndarray, named: Named) -> Named:
    """The effect with every other one that explains the data as well in its place."""
    screen = search.screen(fit)
    i = fit.terms.index(named.term)
    others = without(fit, i)
    base = [screen.terms.index(t) for t in others]
    own = screen.gain(sorted([*base, screen.terms.index(named.term)]))[0]
    taken = {t.key for t in others} | {named.term.key}
    behind: dict[object, tuple[float, str, int]] = {}  # the best of variants that have equally many values
    for k, term in enumerate(screen.terms):
        if term.key not in taken and not term.effect.scatters:  # what only scatters stands for nothing else
            less = own - screen.gain(sorted([*base, k]))[0]
            alike = term.key, screen.edges[k + 1] - screen.edges[k]
            behind[alike] = min(behind.get(alike, (math.inf, "", k)), (less, term.label, k))
    margin = 2 * TIE / max(float(weights.min()), 1e-12) + 0.03 * named.chi2_gain / max(float(np.median(weights)), 1e-12)
    nearest = sorted(behind.values())
    close = [b for b in nearest if b[0] < margin][: RIVALS * len(search.rig.encoders)]
    ties: dict[tuple[str, str], tuple[Term, Fit]] = {}
    for _, _, k in close if len(close) > NEAREST or not search.nonlinear else nearest[:NEAREST]:
        rival = search.with_terms(fit, screen, [*others, screen.terms[k]])
        if (
            rival is not None
            and screen.terms[k].key not in ties
            and ties_with(search, screen, weights, fit, i, rival, screen.terms[k])
        ):
            ties[screen.terms[k].key] = screen.terms[k], rival
    kept = without_unearned(search, weights, list(ties.values()))
    return replace(named, ties=tuple(kept), odds=tuple(odds_of(search, rival, fit, weights) for _, rival in kept))


def without_unearned(search: Search, weights: np.ndarray, ties: Sequence[tuple[Term, Fit]]) -> list[tuple[Term, Fit]]:
    """Ties without those whose simpler form is one too and does as well."""

    def unearned(rich: Term, fit: Fit) -> bool:
        return any(
            rich.extends(simple)
            and not outdoes(search, weights, fit, other, len(rich.effect.parameters) - len(simple.effect.parameters))
            for simple, other in ties
        )

    return [(term, fit) for term, fit in ties if not unearned(term, fit)]


def unblamed(
    search: Search, fit: Fit, weights: np.ndarray, named: tuple[Named, ...]
) -> tuple[Fit, np.ndarray, tuple[Named, ...]]:
    """The fit, the weights of its samples and its effects; where a fault of a sensor is likelier than what it is tied
    with, the fault in its place: a rig is not blamed for what its sensors may have done.
    """
    found, instead = likelier(search, fit, weights, named)
    if not instead:
        return fit, weights, named
    terms = [found.terms[i] for i in found.named()]
    while True:
        there = sample_weights(search.fitter.data, found.residual)
        kept, failing = admitted(search, found, there)
        idle = [f for f in failing if found.terms[f[1]] not in instead.values()]
        if not idle:
            break
        terms.remove(found.terms[min(idle, key=lambda f: f[0])[1]])  # beside the faults it is not needed any more
        less = search.with_terms(found, search.screen(found), terms)
        if less is None:
            return fit, weights, named
        found = less
    return found, there, tuple(beside_blamed(search, found, there, n, fit, instead) for n in kept)


def likelier(search: Search, fit: Fit, weights: np.ndarray, named: Sequence[Named]) -> tuple[Fit, dict[Term, Term]]:
    """The fit with faults of sensors in place of what they are tied with and likelier than, and which of which."""
    suspects: dict[Term, list[Named]] = {}  # by fault of a sensor, what it is tied with
    for n in named:
        for (term, _), odds in zip(n.ties, n.odds, strict=False):
            if term.effect.sensor and (odds > EVEN or not n.term.effect.sensor):
                suspects.setdefault(term, []).append(n)
    found, instead = fit, dict[Term, Term]()
    for term, tied in sorted(suspects.items(), key=lambda item: -len(item[1])):
        blamed = [n.term for n in tied if n.term in found.terms]
        by_itself = max(
            (odds for n in tied for (t, _), odds in zip(n.ties, n.odds, strict=False) if t == term), default=0
        )
        if not blamed or (len(blamed) == 1 and by_itself <= EVEN):
            continue  # less likely than each by itself, in place of two at once it may be likelier
        others = [found.terms[i] for i in found.named() if found.terms[i] not in blamed and found.terms[i] != term]
        trial = search.with_terms(fit, search.screen(fit), [*others, term])
        if trial is not None and odds_of(search, trial, found, weights) > EVEN:
            found, instead = trial, instead | dict.fromkeys(blamed, term)
    return found, instead


def beside_blamed(
    search: Search, fit: Fit, weights: np.ndarray, named: Named, other: Fit, instead: Mapping[Term, Term]
) -> Named:
    """An effect with its rivals, those that it is named ``instead`` of, in another fit, among them."""
    found = rivalled(search, fit, weights, named)
    known = {t.key for t, _ in found.ties}
    blamed = [(old, other) for old, new in instead.items() if new == named.term and old.key not in known]
    odds = [odds_of(search, other, fit, weights)] * len(blamed)
    return replace(found, ties=(*blamed, *found.ties), odds=(*odds, *found.odds))


def widened(search: Search, weights: np.ndarray, named: Sequence[Named]) -> list[Named]:
    """The effects with intervals that hold whichever of the tied explanations of the others is true."""
    out = []
    for n in named:
        known = dict(n.parameters)
        for rival in (rival for other in named if other is not n for _, rival in other.ties):
            if n.term in rival.terms:
                there = intervals(search.fitter, rival, rival.terms.index(n.term), weights)
                for p, v in known.items():
                    known[p] = replace(v, low=min(v.low, there[p].low), high=max(v.high, there[p].high))
        out.append(replace(n, parameters=known))
    return out


def with_bundle(search: Search, fit: Fit, weights: np.ndarray, named: Named) -> Named:
    """A small effect with the few small errors of the rig that explain the data as well in its place."""
    less, more = (gap**2 for gap in named.gap)
    large = less - more >= workmanship.SMALL * rms(search.base.residual) ** 2
    if large or workmanship.size_of(search, fit, named.term) <= 1:
        return named
    terms, found = workmanship.bundle(search, fit, weights, named.term, TIE)
    values = tuple((t, intervals(search.fitter, found, found.terms.index(t), weights)) for t in terms)
    return replace(named, small_errors=values)


def ties_with(search: Search, screen: Screen, weights: np.ndarray, fit: Fit, i: int, rival: Fit, term: Term) -> bool:
    """Whether the data cannot tell a fit from one with a rival in place of its i-th term."""
    j = rival.terms.index(term)
    if rival.bound[rival.columns(j)].any() and not np.any(rival.x[j]):
        return False  # its value would be unphysical
    worse = float(weights @ (rival.residual**2 - fit.residual**2))
    mine, theirs = fit.jacobian[:, fit.columns(i)], rival.jacobian[:, rival.columns(j)]
    more = max(rank_of(theirs) - rank_of(mine), 0)
    share = a_parameter(weights.size)
    if term.effect.name in fit.terms[i].effect.special_case_of:  # the rival is richer
        return outdoes(search, weights, rival, fit, more)
    if fit.terms[i].effect.name in term.effect.special_case_of:  # this one is richer, and is the better one by more
        return worse < TIE + share
    contained = left_of(mine @ fit.x[i], rival.jacobian, weights) < 1.0
    return worse < TIE - (0.0 if contained else share * more)


def outdoes(search: Search, weights: np.ndarray, rich: Fit, simple: Fit, more: int) -> bool:
    """Whether a fit with so many more parameters earns them, and not because of how the engine differs from the
    model.
    """
    shift = search.fitter.data.shift
    better = (float(weights @ ((simple.residual + s) ** 2 - (rich.residual + s) ** 2)) for s in (0.0, shift))
    return min(better) > float(chi2.isf(RICHER, max(more, 1)))


def left_of(change: np.ndarray, columns: np.ndarray, weights: np.ndarray) -> float:
    """Sigmas that remain of a residual's change (size,) after projecting out columns (size, k)."""
    root = np.sqrt(weights)
    return float(np.linalg.norm(without_columns(change * root, columns * root[:, None])))
