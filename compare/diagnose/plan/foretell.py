"""What a plan will tell: how well each effect of the rig would be known, and what it leaves inseparable."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from compare.diagnose import prepare
from compare.diagnose.data.recording import Measured
from compare.diagnose.fit import Fitter
from compare.diagnose.intervals import Interval, intervals
from compare.diagnose.plan.information import CAREFUL, Key, Outcomes, Products
from compare.diagnose.plan.pool import Pool, Suspect
from compare.diagnose.posterior.prior import CREDIBLE, SLIGHT
from compare.diagnose.predict import Model, Term
from compare.diagnose.problem import silent
from compare.diagnose.residuals import Data
from compare.diagnose.sensitivities import Sensitivity, sensitivities
from compare.progress import Progress

TOGETHER = 3  # further effects that a combination is of, at most
SEEN = 1.0  # sigma of all samples together, from which on something shows
LARGEST = 10.0  # times its natural size, that an effect of a combination may have


@dataclass(frozen=True)
class Known:
    """How well an effect would be known if it is of about its natural size: its parameters with 95 % intervals, where
    the rig is as drawn otherwise, and where errors of careful work are everywhere.
    """

    alone: Mapping[str, Interval]
    careful: Mapping[str, Interval]


def known(
    pool: Pool, runs: Sequence[int], sensors: Sequence[str], terms: Sequence[Term], progress: Progress = silent
) -> dict[Term, Known]:
    """How well each of some terms would be known in some runs with these sensors; those that the model cannot make at
    their natural size are left out.
    """
    fitter = fitter_of(pool, runs, sensors)
    errors = _errors(pool, fitter, [t for t in (s.term for s in pool.suspects) if t.effect.name in SLIGHT])
    careful, alike = fitter.data.beside(errors), np.ones(fitter.data.size)
    found = {}
    for k, term in enumerate(terms):
        progress("how well each effect would be known", k, len(terms))
        size = np.clip(pool.prior.size(term), *fitter.bounds(term))
        # the interval of what leaps is looked for in data
        fit = None if term.effect.leaps else fitter.at((term,), {term: size})
        if fit is not None:
            beside = replace(fit, jacobian=careful.seen_beside(fit.jacobian))
            found[term] = Known(intervals(fitter, fit, 0, alike), intervals(fitter, beside, 0, alike))
    return found


def fitter_of(pool: Pool, runs: Sequence[int], sensors: Sequence[str]) -> Fitter:
    """The fitter of some runs of a pool as their nominal readings, each sample over its noise."""
    chosen = [pool.measured.runs[i] for i in runs]
    made = tuple(replace(r, channels={s: c for s, c in r.channels.items() if s in sensors}) for r in chosen)
    measured = Measured(pool.measured.mechanism, made, pool.bench.tolerance, (), pool.measured.source)
    noise = {key: size for key, size in pool.noise.items() if key in measured.sensors}
    model = Model(measured, pool.rig, measured.mechanism, {})
    return Fitter(model, Data(measured, noise), pool.rig, prepare.bounds(pool.rig, pool.bench.tolerance))


def _errors(pool: Pool, fitter: Fitter, terms: Sequence[Term]) -> np.ndarray:
    """What errors of careful work do to each sample (size, k)."""
    base = fitter.at((), {})
    assert base is not None  # the nominal mechanism has made the runs
    found = sensitivities(fitter, base, list(dict.fromkeys(terms)))
    columns = [_small(pool, term, seen) for term, seen in found.items()]
    return CAREFUL * np.column_stack([np.zeros((fitter.data.size, 0)), *columns])


def _small(pool: Pool, term: Term, seen: Sensitivity) -> np.ndarray:
    effect = term.effect
    amounts = effect.amounts(pool.rig, term.where, pool.prior.slight(term), term.variant)
    return (effect.combined(seen.columns) * amounts)[:, : effect.sized]


# ---------------------------------------------------------------- what stays together


def groups(found: Outcomes) -> list[tuple[Key, ...]]:
    """Effects that these outcomes hardly part: one may be in another's place, by more than the prior calls credible."""
    n = len(found.keys)
    shares = found.named[:n, :n]
    alike = np.maximum(shares, shares.T) >= CREDIBLE
    left, out = set(range(n)), []
    while left:
        group, front = set[int](), {min(left)}
        while front:
            group |= front
            front = {j for i in front for j in np.flatnonzero(alike[i]).tolist()} - group
        left -= group
        out += [tuple(found.keys[i] for i in sorted(group))] if len(group) > 1 else []
    return out


Amounts = Mapping[tuple[Term, str], float]  # of a parameter of a term, in SI


def combinations(pool: Pool, these: Products) -> list[Amounts]:
    """Effects that together do nothing that all samples would show: each by an amount, one of them by its natural size.

    Found column by column: those that take most of it away, up to TOGETHER, until less than one sigma is left.
    """
    own = [i for i, s in enumerate(these.suspects) if _plain(pool, s)]
    columns = [(i, k) for i in own for k in range(these.at[i].size)]
    at = np.array([these.at[i][k] for i, k in columns], int)
    gram = these.gram[np.ix_(at, at)]
    found: dict[frozenset[int], dict[int, float]] = {}
    for c in np.argsort(-np.diag(gram)).tolist():
        share = _hidden_by(gram, c, [these.suspects[i].term.key for i, _ in columns]) if gram[c, c] > SEEN else None
        if share and not any(set(share) >= known for known in found):
            found[frozenset(share)] = share
    return [dict(_amount(pool, these, columns[c], share) for c, share in one.items()) for one in found.values()]


def _hidden_by(gram: np.ndarray, c: int, keys: Sequence[Key]) -> dict[int, float] | None:
    """Amounts of a column and a few others, which together do not show; None where there are none."""
    chosen: list[int] = []
    for _ in range(TOGETHER):
        taken = {keys[c], *(keys[i] for i in chosen)}
        free = [i for i in range(len(gram)) if keys[i] not in taken and gram[i, i] > 0]
        if not free:
            return None
        left = _left(gram, c, chosen, free)
        chosen.append(free[int(np.argmin(left))])
        if left.min() < SEEN:
            shares = -np.linalg.solve(_stiffened(gram[np.ix_(chosen, chosen)]), gram[chosen, c])
            needed = {
                i: share for i, share in zip(chosen, shares.tolist(), strict=True) if share**2 * gram[i, i] > SEEN
            }
            return {c: 1.0, **needed} if max(map(abs, needed.values()), default=math.inf) <= LARGEST else None
    return None


def _left(gram: np.ndarray, c: int, chosen: Sequence[int], free: Sequence[int]) -> np.ndarray:
    """What is left of the square of a column beside the chosen ones and each of the free ones."""
    found = []
    for i in free:
        at = [*chosen, i]
        found.append(gram[c, c] - gram[c, at] @ np.linalg.solve(_stiffened(gram[np.ix_(at, at)]), gram[at, c]))
    return np.array(found)


def _stiffened(gram: np.ndarray) -> np.ndarray:
    return gram + 1e-9 * np.diag(np.diag(gram))


def _plain(pool: Pool, suspect: Suspect) -> bool:
    """Whether each column of a suspect is one of its parameters, as reported."""
    t = suspect.term
    size = pool.prior.size(t)
    if suspect.split or not suspect.rig or t.variant or size.size != suspect.at.size:
        return False
    probes, values = t.effect.probes(pool.rig, t.where), t.effect.values(pool.rig, t.where, size)
    return (
        probes.shape == (size.size,) * 2
        and np.allclose(probes, np.diag(np.diag(probes)))
        and np.allclose(list(values.values()), size, rtol=1e-9)
    )


def _amount(pool: Pool, these: Products, column: tuple[int, int], share: float) -> tuple[tuple[Term, str], float]:
    """A share of the natural size of a column as a parameter."""
    i, k = column
    t = these.suspects[i].term
    return (t, t.effect.parameters[k].name), share * float(pool.prior.size(t)[k])
