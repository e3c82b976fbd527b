"""How well the values of a fit are known: each by itself, and all together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.leaps import plausible
from compare.diagnose.least_squares import UNSEEN
from compare.diagnose.predict import Term
from compare.judge.statistics import NORMAL_95


@dataclass(frozen=True)
class Interval:
    """A reported parameter in SI with its 95 % interval; an open end is infinite."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Covariance:
    """The covariance (n, n) of reported parameters, SI; NaN where the data leave one open."""

    names: tuple[str, ...]
    values: np.ndarray = field(repr=False)


def intervals(fitter: Fitter, fit: Fit, i: int, weights: np.ndarray) -> dict[str, Interval]:
    """95 % intervals of a term's reported parameters, from the curvature of chi^2 in natural coordinates, and from its
    staircase where samples leap.
    """
    term, x, at = fit.terms[i], fit.x[i], fit.columns(i)
    spread, blind = (part[at] for part in _spread(fitter, fit, weights))
    own = spread[:, at]

    def interval(parameter: str, value: float, ends: Sequence[float], open_ended: bool) -> Interval:
        low, high = (-math.inf, math.inf) if open_ended else (min(*ends, value), max(*ends, value))
        return Interval(value, low, high, term.effect.unit(fitter.rig, term.where, parameter))

    best = _reported(fitter, term, x)
    low, high = fitter.bounds(term)
    out = {}
    for (p, v), slope in zip(best.items(), _slopes(fitter, term, x), strict=True):
        alone = np.flatnonzero(slope)
        if alone.size == 1:  # of one coordinate, which may be bent and have an end
            nudge = np.zeros(x.size)
            nudge[alone] = NORMAL_95 * math.sqrt(max(float(own[alone[0], alone[0]]), 0.0))
            ends = [_reported(fitter, term, np.clip(x + side * nudge, low, high))[p] for side in (-1, 1)]
            out[p] = interval(p, v, ends, bool(blind[alone[0]]))
            continue
        half = NORMAL_95 * math.sqrt(max(float(slope @ own @ slope), 0.0))
        out[p] = interval(p, v, [v - half, v + half], bool((blind & (slope != 0)).any()))
    if term.effect.leaps:
        less, more = (_reported(fitter, term, x * share) for share in plausible(fitter, fit, i, weights))
        out = {p: replace(o, low=min(o.low, less[p]), high=max(o.high, more[p])) for p, o in out.items()}
    return out


def covariance(fitter: Fitter, fit: Fit, weights: np.ndarray) -> Covariance:
    """The covariance of all reported parameters of a fit's effects, called ``effect@where.parameter``."""
    spread, blind = _spread(fitter, fit, weights)
    names, rows = list[str](), [np.zeros((0, blind.size))]
    for i in fit.named():
        term, x = fit.terms[i], fit.x[i]
        names += [f"{term.label}.{p}" for p in _reported(fitter, term, x)]
        slopes = _slopes(fitter, term, x)
        rows.append(np.zeros((len(slopes), blind.size)))
        rows[-1][:, fit.columns(i)] = slopes
    every = np.vstack(rows)
    values = every @ spread @ every.T
    unknown = (every[:, blind] != 0).any(axis=1)
    values[unknown], values[:, unknown] = math.nan, math.nan
    return Covariance(tuple(names), values)


def _spread(fitter: Fitter, fit: Fit, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The covariance (n, n) of a fit's natural coordinates, and which of them (n,) the data leave open."""
    sizes = np.concatenate(
        [np.zeros(0), *(np.asarray(t.effect.scales(fitter.rig, t.where, t.variant), float) for t in fit.terms)]
    )
    scaled = fit.jacobian * np.sqrt(weights)[:, None] * (sizes * np.linalg.norm(fit.jacobian, axis=0) > UNSEEN)
    norm = np.linalg.norm(scaled, axis=0)
    norm[norm == 0] = 1.0
    values, vectors = np.linalg.eigh((scaled / norm).T @ (scaled / norm))
    known = values > 1e-9
    spread = (vectors[:, known] / values[known]) @ vectors[:, known].T / np.outer(norm, norm)
    return spread, (np.abs(vectors[:, ~known]) > 1e-3).any(axis=1)


def _reported(fitter: Fitter, term: Term, x: np.ndarray) -> dict[str, float]:
    return term.effect.values(fitter.rig, term.where, x, term.variant)


def _slopes(fitter: Fitter, term: Term, x: np.ndarray) -> np.ndarray:
    """Derivatives (parameters, n) of reported parameters by natural coordinates."""
    scale = np.asarray(term.effect.scales(fitter.rig, term.where, term.variant), float)
    step = np.maximum(1e-4 * np.abs(x), 1e-3 * scale)
    best = np.array([*_reported(fitter, term, x).values()])
    moved = [np.array([*_reported(fitter, term, x + s).values()]) for s in np.diag(step)]
    return np.column_stack([(m - best) / h for m, h in zip(moved, step, strict=True)])
