"""How much some runs and sensors would tell of what is missing: expected information, by draws of whole outcomes.

One effect at a place is missing, or a sensor errs, or nothing is wrong, as the prior has it; an effect is as large as
the prior has it, and errors of careful work are everywhere.  All that data y say of suspects with columns J over the
noise N stands in t = J' N^-1 y, of which the products G = J' N^-1 J are all that needs to be known: under a suspect
with columns a and amounts b, t is normal about G[:, a] b with covariance G, and its evidence against nothing is closed.
So an outcome is drawn without its samples, and judged exactly as a diagnosis with this prior would judge it.  (The
closed bound by pairs of Kolchinsky and Tracey, 2017, says nothing here: mixtures over three decades of size overlap.)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr, logsumexp

from compare.diagnose.plan.pool import Pool, Suspect
from compare.diagnose.posterior.prior import EXPECTED, NOTHING, WIDTH_ODDS, WIDTHS, WORKMANSHIP, WORKMANSHIP_ODDS
from compare.diagnose.posterior.sets import summed

Key = tuple[str, str]  # an effect's name and place
# root mean square of the prior's sizes of errors everywhere
CAREFUL = math.sqrt(float(np.exp(WORKMANSHIP_ODDS - logsumexp(WORKMANSHIP_ODDS)) @ WORKMANSHIP**2))
DRAWS = 8  # outcomes of each effect at a place, one in each part of its sizes
NOTHINGS = 12  # times as many outcomes in which nothing is wrong
MOST_COLUMNS = 256  # of a suspect
ROUNDING = 1e-9  # of a column's own square, that keeps products positive


@dataclass(frozen=True)
class Products:
    """Products of the columns of suspects with errors of careful work in the noise.

    ``suspects`` have their columns ``at`` in ``gram`` (n, n); ``probability`` (suspects,) is the prior's that each is
    what is wrong.  Faults of sensors that are not there are left out.
    """

    suspects: tuple[Suspect, ...]
    at: tuple[np.ndarray, ...]
    gram: np.ndarray = field(repr=False)
    probability: np.ndarray = field(repr=False)

    @property
    def keys(self) -> tuple[Key, ...]:
        """Every effect of the rig at its place, once."""
        return tuple(dict.fromkeys(s.term.key for s in self.suspects if s.rig))


def products(pool: Pool, runs: Sequence[int], sensors: Sequence[str], careful: float = CAREFUL) -> Products:
    """Of some runs, each with these sensors; errors of careful work are so large (1: as the prior's table has them)."""
    each = [np.sum([pool.gram[run, sensor] for sensor in sensors], axis=0) for run in runs]
    whole = np.sum(each, axis=0)
    seen = np.diag(whole) > 0
    own: list[tuple[int, int]] = []  # run and column of values that each run has of its own, behind all others
    shown: list[tuple[Suspect, np.ndarray]] = []
    for s in sorted(pool.suspects, key=lambda s: not s.rig):  # what is of the rig is drawn alike whatever is read
        if s.split:
            some = [(k, int(s.at[0])) for k, one in enumerate(each) if one[s.at[0], s.at[0]] > 0]
            at = np.arange(len(some)) + len(whole) + len(own)
            own += some if len(some) > 1 else []
            shown += [(s, at)] if len(some) > 1 else []
        elif s.rig or seen[s.at].any():  # a sensor that is not there has no faults
            shown.append((s, s.at))
    across = np.column_stack([np.zeros((len(whole), 0)), *(each[k][:, i] for k, i in own)])
    inner = np.array([[each[k][i, j] * (k == m) for m, j in own] for k, i in own]).reshape(len(own), len(own))
    gram = np.block([[whole, across], [across.T, inner]])
    kept = np.concatenate([np.zeros(0, int), *(at for _, at in shown)])
    small = np.arange(len(whole) - pool.slight, len(whole))
    small = small[seen[small] & (careful > 0)]
    inside = _beside(gram[np.ix_(kept, kept)], gram[np.ix_(small, kept)], gram[np.ix_(small, small)], careful)
    ends = np.cumsum([0, *(at.size for _, at in shown)])
    suspects = tuple(s for s, _ in shown)
    at_ = tuple(np.arange(*ends[k : k + 2]) for k in range(len(shown)))
    return Products(suspects, at_, inside, _probabilities(suspects))


def _beside(inside: np.ndarray, across: np.ndarray, small: np.ndarray, careful: float) -> np.ndarray:
    """Products (n, n) of columns where others (k,), each of the size ``careful``, are part of the noise."""
    if not small.size:
        return inside
    size = np.sqrt(np.diag(small) + careful**-2)
    noise = (small + np.eye(len(small)) / careful**2) / np.outer(size, size) + ROUNDING * np.eye(len(small))
    reduced = solve_triangular(np.linalg.cholesky(noise), across / size[:, None], lower=True)
    left = inside - reduced.T @ reduced
    kept = np.diag(left) > ROUNDING * np.diag(inside)  # the rest is no more than rounding
    return np.where(np.outer(kept, kept), left, 0.0)


def _probabilities(suspects: Sequence[Suspect]) -> np.ndarray:
    """Of each suspect (suspects,) being what is wrong; what is of the rig, and what is of sensors, together as probable
    as the prior expects of them, however many there are.
    """
    odds, rig = np.array([s.odds for s in suspects]), np.array([s.rig for s in suspects], bool)
    found = np.zeros(odds.size)
    for sensor, expected in EXPECTED.items():
        these = rig != sensor
        if these.any():
            share = expected / sum(EXPECTED.values())
            found[these] = (1 - NOTHING) * share * odds[these] / odds[these].sum()
    return found


@dataclass(frozen=True)
class Outcomes:
    """What is expected: ``bits`` of information about which effect of the rig is missing, if any is, of ``possible``
    ones.

    ``named`` (keys + 2, keys + 2) is how probable the data make each of the ``keys``, then a fault of a sensor, then
    nothing, on average where one of these is true.
    """

    keys: tuple[Key, ...]
    bits: float
    possible: float
    named: np.ndarray = field(repr=False)

    @property
    def told(self) -> float:
        """How probable the data make the effect of the rig that is missing, averaged over all."""
        return float(np.mean(np.diag(self.named)[: len(self.keys)])) if self.keys else 0.0


def outcomes(these: Products, draws: int = DRAWS, widths: Sequence[float] | None = None, seed: int = 0) -> Outcomes:
    """What is expected of the data of some runs; effects have these sizes, over their natural ones, or (None) those of
    the prior.  The same seed draws alike for all runs and sensors, so that these can be compared.
    """
    keys, left = these.keys, float(1 - these.probability.sum())
    sensor, nothing = len(keys), len(keys) + 1
    owner = np.array([*(keys.index(s.term.key) if s.rig else sensor for s in these.suspects), nothing])
    prior = np.bincount(owner, np.append(these.probability, left), nothing + 1)
    truth, weight, t = _drawn(these, draws, widths, seed)
    log = np.column_stack([_evidence(these, t) + np.log(these.probability), np.full(len(t), math.log(left))])
    posterior = np.exp(log - log.max(axis=1, keepdims=True))
    posterior /= posterior.sum(axis=1, keepdims=True)
    shares = np.zeros((nothing + 1, len(t)))
    np.add.at(shares, owner, posterior.T)
    true = owner[truth]
    mass = np.maximum(np.bincount(true, weight, nothing + 1), 1e-300)
    named = np.array([np.bincount(true, weight * share, nothing + 1) / mass for share in shares]).T
    # of the rig it is asked: a fault of a sensor, and nothing, are one answer
    asked = np.vstack([shares[:sensor], shares[sensor:].sum(axis=0)])
    possible = float(_entropy(np.append(prior[:sensor], prior[sensor:].sum())))
    return Outcomes(keys, possible - float(weight @ _entropy(asked)), possible, named)


def _entropy(shares: np.ndarray) -> np.ndarray:
    """What is not known (bits), where probabilities are these (n,), or (n, N)."""
    return np.asarray(-(shares * np.log2(np.maximum(shares, 1e-300))).sum(axis=0))


def _drawn(
    these: Products, draws: int, widths: Sequence[float] | None, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Outcomes: what is true (N,), index of a suspect or their number for nothing; how much each counts (N,); and what
    its data say (N, n).
    """
    chances = np.cumsum(np.exp(WIDTH_ODDS - logsumexp(WIDTH_ODDS)))
    of_key: dict[Key, list[int]] = {}
    for i, s in enumerate(these.suspects):
        of_key.setdefault(s.term.key, []).append(i)
    n = len(these.gram)
    truth, weight, means = [], [], []
    for key, members in of_key.items():
        rng = np.random.default_rng([seed, *key[0].encode(), *key[1].encode()])
        shares = these.probability[members]
        for k in range(draws):
            i = members[int(np.searchsorted(np.cumsum(shares), (k + 0.5) / draws * shares.sum()))]
            part = (k * 5 % draws + rng.random()) / draws  # sizes in another order than members
            width = float(WIDTHS[np.searchsorted(chances, part)]) if widths is None else widths[k % len(widths)]
            b = rng.standard_normal(MOST_COLUMNS)[: these.at[i].size]
            b = np.where(these.suspects[i].never_negative(b.size), np.abs(b), b)
            truth.append(i)
            weight.append(shares.sum() / draws)
            means.append(these.gram[:, these.at[i]] @ (width * b))
    nothing, left = NOTHINGS * draws, float(1 - these.probability.sum())
    truth += [len(these.suspects)] * nothing
    weight += [left / nothing] * nothing
    mean = np.vstack([np.reshape(means, (-1, n)), np.zeros((nothing, n))])
    noise = _noise(seed, 256 * (1 + n // 256), 1024 * (1 + len(mean) // 1024))[:n, : len(mean)]
    return np.array(truth), np.array(weight), mean + (_root(these.gram) @ noise).T


@lru_cache(maxsize=8)
def _noise(seed: int, columns: int, outcomes: int) -> np.ndarray:
    """Noise of unit size, in which a column's is the same however many others there are."""
    return np.random.default_rng(seed).standard_normal((columns, outcomes))


def _root(gram: np.ndarray) -> np.ndarray:
    """What noise becomes noise of this covariance by."""
    size = np.sqrt(np.diag(gram))
    unit = np.where(size > 0, size, 1.0)
    alike = gram / np.outer(unit, unit)
    try:
        root = np.linalg.cholesky(alike + ROUNDING * np.eye(len(gram)))
    except np.linalg.LinAlgError:  # products of columns that are nearly the same, less by rounding than they can be
        values, vectors = np.linalg.eigh(alike)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(root * size[:, None])


def _evidence(these: Products, t: np.ndarray) -> np.ndarray:
    """Log of how much more probable each suspect (N, suspects) makes outcomes (N, n) than nothing does, summed over its
    sizes.
    """
    found = np.empty((len(t), len(these.suspects)))
    sizes = np.array([a.size for a in these.at])
    odds = WIDTH_ODDS - logsumexp(WIDTH_ODDS)
    for size in np.unique(sizes):
        which = np.flatnonzero(sizes == size)
        at = np.array([these.at[i] for i in which])
        values, vectors = np.linalg.eigh(these.gram[at[:, :, None], at[:, None, :]])
        turned = np.einsum("gkl,ngk->ngl", vectors, t[:, at])
        positive = np.array([these.suspects[i].never_negative(size) for i in which])
        logs = []
        for width, log_odds in zip(WIDTHS, odds, strict=True):
            curved = np.maximum(values, 0.0) + 1 / width**2
            log = ((turned**2 / curved).sum(2) - np.log(curved * width**2).sum(1)) / 2 + log_odds
            if positive.any():
                some = positive.any(axis=1)
                mean = np.einsum("gkl,ngl->ngk", vectors[some], turned[:, some] / curved[some])
                spread = np.sqrt(np.einsum("gkl,gl->gk", vectors[some] ** 2, 1 / curved[some]))
                log[:, some] += np.where(positive[some], math.log(2) + log_ndtr(mean / spread), 0.0).sum(2)
            logs.append(log)
        found[:, which] = summed(np.moveaxis(np.array(logs), 0, -1))
    return found
