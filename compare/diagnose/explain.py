"""Name the missing effects: keep what improves held-out data, try every rival, and say where the data cannot decide.

Sets of effects are compared by chi^2.  Where the final residual is more than noise, or is coloured, each sensor's
share of chi^2 is divided by its excess and by its correlation time, so that N samples count as many as are independent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from compare.diagnose.fit import FOLDS, Data, Fit, rank_of, without_columns
from compare.diagnose.noise import rms, sample_weights
from compare.diagnose.predict import Term
from compare.diagnose.search import Search, without
from compare.diagnose.sensitivities import Screen
from compare.results.diagnosis import Verdict

TIE = 16.0  # of chi^2: two explanations closer than four sigmas are not told apart
RICHER = 0.01  # chance that a richer explanation does better by luck
HELD_OUT = 9.0  # of chi^2 on held-out data that an effect must bring
CLOSED = 1.1  # of the noise floor: a gap that is closed
DOMINANT = 0.5  # share of the excess that an effect must remove where something else remains
RIVALS = 10  # fitted in full for each named effect
STRUCTURE = 1e-6  # chance of as much structure in noise alone
BINS = 24
SLIGHT = 0.3  # of the noise: structure that is accepted
MODEL = 1.0  # the same beside named effects: models of contact and bending are not exact to the last micrometre


@dataclass(frozen=True)
class Interval:
    """A reported parameter in SI with its 95 % interval; an open end is infinite."""

    value: float
    low: float
    high: float
    unit: str


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
    odds: tuple[float, ...] = ()  # of each tie against this effect, by likelihood


@dataclass(frozen=True)
class Attempt:
    """An effect that takes something of the gap away and is not named; ``failed`` says which test it failed, by how
    much.
    """

    term: Term
    parameters: dict[str, Interval]
    share: float  # of the squared gap, beside the effects that are named
    gap: tuple[float, float]  # without it, with it
    failed: str


@dataclass(frozen=True)
class Explanation:
    """What the data say."""

    base: Fit
    fit: Fit
    named: tuple[Named, ...]
    verdict: Verdict
    weights: np.ndarray = field(repr=False)  # (size,) of each sample
    structured: bool  # whether what is left is more than noise
    attempts: tuple[Attempt, ...] = ()  # what was tried and not named, best first

    @cached_property
    def gap(self) -> tuple[float, float]:
        """Root mean square residual in units of noise, before and after."""
        return rms(self.base.residual), rms(self.fit.residual)


def explain(search: Search, fit: Fit) -> Explanation:
    """What a fit says: which of its effects stand, how large and how sure they are, what else explains the data, and
    the verdict.
    """
    data = search.fitter.data
    for last in (False, False, True):
        fit, weights, found = pruned(search, fit)
        named = tuple(rivalled(search, fit, weights, n) for n in found)
        better = [rival for n in named for _, rival in n.ties if search.beats(rival, fit)]
        if last or not better:
            break
        fit = min(better, key=lambda rival: float(weights @ rival.residual**2) + search.price(rival))
    named = tuple(sorted(named, key=lambda n: -n.chi2_gain))
    structured = has_structure(data, fit.residual, MODEL if named else SLIGHT)
    return Explanation(search.base, fit, named, verdict(fit, named, structured), weights, structured)


def pruned(search: Search, fit: Fit) -> tuple[Fit, np.ndarray, list[Named]]:
    """The fit without effects that bring too little, the weights of its samples, and the effects that stay."""
    while True:
        weights = sample_weights(search.fitter.data, fit.residual)
        named, weak = admitted(search, fit, weights)
        if weak is None:
            return fit, weights, named
        fit = search.with_terms(fit, search.screen(fit), without(fit, weak)) or search.base


def verdict(fit: Fit, named: Sequence[Named], structured: bool) -> Verdict:
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


def admitted(search: Search, fit: Fit, weights: np.ndarray) -> tuple[list[Named], int | None]:
    """The effects of a fit with what each brings, and the position of the weakest that brings too little, if any."""
    screen = search.screen(fit)
    closed = rms(fit.residual) <= CLOSED
    found, failing = [], []
    for i in fit.named():
        term = fit.terms[i]
        less = search.with_terms(fit, screen, without(fit, i)) or search.base
        gain = float(weights @ (less.residual**2 - fit.residual**2))
        excess = less.chi2 - less.residual.size
        held = held_out(search.fitter.data, less), held_out(search.fitter.data, fit)
        gained = float(weights @ (held[0] ** 2 - held[1] ** 2))
        if gain < search.cost[term] or gained < HELD_OUT or (not closed and less.chi2 - fit.chi2 < DOMINANT * excess):
            failing.append((gain, i))
        found.append(
            Named(
                term,
                intervals(search, fit, i, weights),
                gain,
                (rms(less.residual), rms(fit.residual)),
                (rms(held[0]), rms(held[1])),
            )
        )
    return found, min(failing)[1] if failing else None


def held_out(data: Data, fit: Fit) -> np.ndarray:
    """Residual (size,) of each block with the coordinates refitted to all other blocks (about the fit, to first
    order).
    """
    columns = fit.jacobian[:, ~fit.bound]
    norm = np.linalg.norm(columns, axis=0)
    columns = columns[:, norm > 0] / norm[norm > 0]
    out = fit.residual.copy()
    for fold in range(FOLDS if columns.shape[1] else 0):
        rest, here = data.fold != fold, data.fold == fold
        matrix = columns[rest].T @ columns[rest] + 1e-9 * np.eye(columns.shape[1])
        out[here] -= columns[here] @ np.linalg.solve(matrix, columns[rest].T @ fit.residual[rest])
    return out


def intervals(search: Search, fit: Fit, i: int, weights: np.ndarray) -> dict[str, Interval]:
    """95 % intervals of a term's reported parameters, from the curvature of chi^2 in natural coordinates."""
    term, x, at = fit.terms[i], fit.x[i], fit.columns(i)
    scaled = fit.jacobian * np.sqrt(weights)[:, None]
    norm = np.linalg.norm(scaled, axis=0)
    norm[norm == 0] = 1.0
    values, vectors = np.linalg.eigh((scaled / norm).T @ (scaled / norm))
    known = values > 1e-9
    spread = (vectors[:, known] / values[known]) @ vectors[:, known].T / np.outer(norm, norm)
    blind = (np.abs(vectors[:, ~known]) > 1e-3).any(axis=1)[at] if (~known).any() else np.zeros(x.size, bool)
    covariance = spread[at, at]

    def reported(point: np.ndarray) -> dict[str, float]:
        return term.effect.values(search.rig, term.where, point, term.variant)

    def interval(parameter: str, value: float, ends: Sequence[float], open_ended: bool) -> Interval:
        low, high = (-math.inf, math.inf) if open_ended else (min(*ends, value), max(*ends, value))
        return Interval(value, low, high, term.effect.unit(search.rig, term.where, parameter))

    best = reported(x)
    low, high = search.fitter.bounds(term)
    if x.size == 1:
        half = 1.96 * math.sqrt(max(float(covariance[0, 0]), 0.0))
        ends = [reported(np.clip(x + side * half, low, high)) for side in (-1, 1)]
        return {p: interval(p, v, [e[p] for e in ends], bool(blind[0])) for p, v in best.items()}
    scale = np.asarray(term.effect.scales(search.rig, term.where, term.variant), float)
    step = np.maximum(1e-4 * np.abs(x), 1e-3 * scale)
    slopes = [reported(x + s) for s in np.diag(step)]
    out = {}
    for p, v in best.items():
        slope = np.array([(m[p] - v) / h for m, h in zip(slopes, step, strict=True)])
        half = 1.96 * math.sqrt(max(float(slope @ covariance @ slope), 0.0))
        out[p] = interval(p, v, [v - half, v + half], bool((blind & (slope != 0)).any()))
    return out


# ------------------------------------------------------------------ rivals


def rivalled(search: Search, fit: Fit, weights: np.ndarray, named: Named) -> Named:
    """The effect with every other one that explains the data as well in its place."""
    screen = search.screen(fit)
    i = fit.terms.index(named.term)
    others = without(fit, i)
    base = [screen.terms.index(t) for t in others]
    own = screen.gain(sorted([*base, screen.terms.index(named.term)]))[0]
    taken = {t.key for t in others} | {named.term.key}
    behind = []
    for k, term in enumerate(screen.terms):
        if term.key not in taken:
            behind.append((own - screen.gain(sorted([*base, k]))[0], term.label, k))
    margin = 2 * TIE / max(float(weights.min()), 1e-12) + 0.03 * named.chi2_gain / max(float(np.median(weights)), 1e-12)
    ties: dict[tuple[str, str], tuple[Term, Fit]] = {}
    for _, _, k in sorted(b for b in behind if b[0] < margin)[:RIVALS]:
        rival = search.with_terms(fit, screen, [*others, screen.terms[k]])
        if (
            rival is not None
            and screen.terms[k].key not in ties
            and ties_with(search, screen, weights, fit, i, rival, screen.terms[k])
        ):
            ties[screen.terms[k].key] = screen.terms[k], rival
    return Named(named.term, named.parameters, named.chi2_gain, named.gap, named.held_out, tuple(ties.values()))


def ties_with(search: Search, screen: Screen, weights: np.ndarray, fit: Fit, i: int, rival: Fit, term: Term) -> bool:
    """Whether the data cannot tell a fit from one with a rival in place of its i-th term."""
    j = rival.terms.index(term)
    if rival.bound[rival.columns(j)].any() and not np.any(rival.x[j]):
        return False  # its value would be unphysical
    worse = float(weights @ (rival.residual**2 - fit.residual**2))
    mine, theirs = fit.jacobian[:, fit.columns(i)], rival.jacobian[:, rival.columns(j)]
    more = max(rank_of(theirs) - rank_of(mine), 0)
    share = max(8.0, math.log(weights.size))  # of chi^2, that a further parameter must bring
    if term.effect.name in fit.terms[i].effect.special_case_of:  # the rival is richer: it must be better
        return -worse > float(chi2.isf(RICHER, max(more, 1)))
    if fit.terms[i].effect.name in term.effect.special_case_of:  # this one is richer, and is the better one by more
        return worse < TIE + share
    contained = left_of(mine @ fit.x[i], rival.jacobian, weights) < 1.0
    return worse < TIE - (0.0 if contained else share * more)


def left_of(change: np.ndarray, columns: np.ndarray, weights: np.ndarray) -> float:
    """Sigmas that remain of a residual's change (size,) after projecting out columns (size, k)."""
    root = np.sqrt(weights)
    return float(np.linalg.norm(without_columns(change * root, columns * root[:, None])))
