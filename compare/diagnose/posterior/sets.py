"""How probable the data make each set of effects, and the way to the probable ones.

With b_g ~ N(0, (w s_g)^2), s_g the natural size and w one of a grid of widths, the evidence of a set is closed:
log p = h'M^-1 h/2 - log|M|/2 - sum log w + log 2 Phi (of positive coordinates) + log prior, M = G + w^-2, with G and h
the products of its columns over their natural sizes.  Widths are taken at their mode and summed about it, one after the
other.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri, dtrtrs
from scipy.special import log_ndtr

from compare.diagnose.effects.each_run import repeats
from compare.diagnose.posterior.compress import Group, Products
from compare.diagnose.posterior.prior import MOST_EFFECTS, WIDTHS, Prior

MIDDLE = 5  # of the widths, from which their mode is sought
SETTLE = 4  # rounds of widths
WORTH = 12.0  # log: sets that are less probable than the best by more are not kept
LOOKED_AT = 8.0  # the same, of sets whose evidence is taken in full
NEIGHBOURS_OF = 6.0  # the same, of sets about whose neighbours are looked for
ABOUT = 12  # of them at most
EXACTLY = 1e-13
Set = tuple[int, ...]
Widths = Mapping[int, int]  # by group, which of the grid


@dataclass(frozen=True)
class Solved:
    """The products of a set at widths: columns, widths by column, products with the residual, its square, and the
    triangle of M.
    """

    at: np.ndarray
    widths: np.ndarray
    wanted: np.ndarray
    square: float
    factor: np.ndarray


class Sets:
    """Sets of groups of one linear problem; what was looked at is kept in ``known`` (log probability, up to one
    constant), with the widths of those that were taken in full in ``widths``.
    """

    def __init__(self, groups: Sequence[Group], products: Products, late: Callable[[], bool]) -> None:
        self.groups, self.products, self.late = groups, products, late
        self.known: dict[Set, float] = {}
        self.widths: dict[Set, Widths] = {}
        self.top = -math.inf
        self._log_odds = np.array([g.log_odds for g in groups])
        self._widths = np.stack([g.widths for g in groups]) if groups else np.zeros((0, WIDTHS.size))
        self._nothing = Prior.nothing(self._log_odds)
        families = {family: k for k, family in enumerate({g.family for g in groups})}
        self._of_rig = np.array([g.term is None or not g.term.effect.sensor for g in groups], bool)
        self._nameless = np.array([g.term is None for g in groups], bool)
        self._repeats = np.array([g.term is not None and repeats(g.term.effect, g.term.variant) for g in groups], bool)
        self.named_only = False  # whether sets with an unknown are passed over
        self._families = np.array([families[g.family] for g in groups], int)
        by_count: dict[int, list[int]] = {}
        for i, group in enumerate(groups):
            by_count.setdefault(len(group.at), []).append(i)
        self._blocks = [(np.array(ids), np.stack([groups[i].at for i in ids])) for ids in by_count.values()]

    # ---------------------------------------------------------------- one set

    def solved(self, chosen: Set, widths: Widths) -> Solved:
        """The linear problem of a set at these widths."""
        gram, wanted, square = self.products.gram, self.products.wanted, self.products.square
        at = np.concatenate([self.groups[i].at for i in chosen])
        width = np.concatenate([np.full(len(self.groups[i].at), WIDTHS[widths[i]]) for i in chosen])
        offsets = [self.groups[i].offset for i in chosen if self.groups[i].offset >= 0]
        if offsets:
            square += gram[np.ix_(offsets, offsets)].sum() - 2 * wanted[offsets].sum()
            wanted = wanted - gram[:, offsets].sum(axis=1)
        matrix = gram[np.ix_(at, at)]
        matrix[np.diag_indices_from(matrix)] = matrix.diagonal() * (1 + EXACTLY) + 1 / width**2
        return Solved(at, width, wanted, square, dpotrf(matrix, lower=1, clean=1)[0])

    def score(self, chosen: Set, widths: Widths | None = None) -> float:
        """Log probability of a set; its widths are sought from these."""
        if chosen in self.widths:
            return self.known[chosen]
        log = float(self._log_odds[list(chosen)].sum()) - self.products.log_volume / 2
        if not chosen:
            self.widths[chosen], self.known[chosen] = {}, log + self._nothing - self.products.square / 2
            return self.known[chosen]
        at_width = {i: (widths or {}).get(i, MIDDLE) for i in chosen}
        found = -math.inf
        for _ in range(SETTLE):
            found, better = self._at(chosen, at_width)
            if better == at_width:
                break
            at_width = better
        self.widths[chosen], self.known[chosen] = at_width, log + found
        self.top = max(self.top, log + found)
        return self.known[chosen]

    def _at(self, chosen: Set, widths: Widths) -> tuple[float, dict[int, int]]:
        """Log evidence of a set, each width summed about the others', and the best width of each."""
        solved = self.solved(chosen, widths)
        inverse = dtrtri(solved.factor, lower=1)[0]
        half = inverse @ solved.wanted[solved.at]
        mean, covariance = inverse.T @ half, inverse.T @ inverse
        log = float(half @ half - solved.square) / 2 - float(np.log(np.diag(solved.factor) * solved.widths).sum())
        ends = np.cumsum([0, *(len(self.groups[i].at) for i in chosen)])
        by_count: dict[int, list[int]] = {}
        for k, i in enumerate(chosen):
            by_count.setdefault(len(self.groups[i].at), []).append(k)
        better: dict[int, int] = {}
        for count, each in by_count.items():
            own = ends[each][:, None] + np.arange(count)
            block, average = covariance[own[:, :, None], own[:, None, :]], mean[own]
            precision = 1 / block if count == 1 else np.linalg.inv(block)
            width = np.array([widths[chosen[k]] for k in each])
            alone = precision - np.eye(count) / (WIDTHS[width] ** 2)[:, None, None]
            positive = np.stack([self.groups[chosen[k]].positive for k in each])
            odds = self._widths[[chosen[k] for k in each]]
            by_width = profiles(alone, np.einsum("nkl,nl->nk", precision, average), positive, odds)
            row = np.arange(len(each))
            log += float((summed(by_width) - by_width[row, width] + odds[row, width]).sum())
            if positive.any():
                ratio = average / np.sqrt(np.einsum("nkk->nk", block))
                log += float((math.log(2) + log_ndtr(ratio[positive])).sum())
            better |= {chosen[k]: int(best) for k, best in zip(each, by_width.argmax(axis=1), strict=True)}
        return log, better

    def coefficients(self, chosen: Set) -> dict[int, np.ndarray]:
        """By group, how much (k,) of its columns over their natural sizes a set has where it is most probable."""
        self.score(chosen)
        if not chosen:
            return {}
        solved = self.solved(chosen, self.widths[chosen])
        half = dtrtrs(solved.factor, solved.wanted[solved.at], lower=1)[0]
        mean = dtrtrs(solved.factor, half, lower=1, trans=1)[0]
        ends = np.cumsum([len(self.groups[i].at) for i in chosen])
        return dict(zip(chosen, np.split(mean, ends[:-1]), strict=True))

    # ---------------------------------------------------------------- from set to set

    def additions(self, chosen: Set) -> tuple[np.ndarray, np.ndarray]:
        """Log probability (groups,) of a set with each further group, nearly, and that group's best width."""
        before = self.score(chosen) - (0.0 if chosen else self._nothing)
        gram, wanted = self.products.gram, self.products.wanted
        inside = None
        if chosen:
            solved = self.solved(chosen, self.widths[chosen])
            both = dtrtrs(solved.factor, np.column_stack([gram[solved.at], solved.wanted[solved.at]]), lower=1)[0]
            inside, wanted = both[:, :-1], solved.wanted - both[:, :-1].T @ both[:, -1]
        log, width = np.full(len(self.groups), -np.inf), np.zeros(len(self.groups), int)
        barred = self._barred(chosen)
        for every, places in self._blocks:
            ids, at = every[~barred[every]], places[~barred[every]]
            if not ids.size:
                continue
            left, mine = gram[at[:, :, None], at[:, None, :]], wanted[at]
            if inside is not None:
                across = inside[:, at]
                left = left - np.einsum("snk,snl->nkl", across, across, optimize=True)
            gained = np.zeros(len(ids))
            for row, i in enumerate(ids):
                offset = self.groups[i].offset
                if offset >= 0:
                    shift = gram[offset, at[row]] - (
                        inside[:, offset] @ inside[:, at[row]] if inside is not None else 0
                    )
                    own = gram[offset, offset] - (inside[:, offset] @ inside[:, offset] if inside is not None else 0)
                    gained[row], mine[row] = wanted[offset] - own / 2, mine[row] - shift
            by_width = profiles(left, mine, np.stack([self.groups[i].positive for i in ids]), self._widths[ids])
            log[ids] = before + summed(by_width) + self._log_odds[ids] + gained
            width[ids] = by_width.argmax(axis=1)
        for i in np.flatnonzero(log > self.top - WORTH):
            self.known.setdefault(with_group(chosen, int(i)), float(log[i]))
        return log, width

    def _barred(self, chosen: Set) -> np.ndarray:
        """Which groups (groups,) cannot be added to a set."""
        barred = np.isin(self._families, self._families[list(chosen)])
        if self._of_rig[list(chosen)].sum() >= MOST_EFFECTS:
            barred |= self._of_rig
        # a law without a name shows in runs at several speeds as values that differ: a set has one of both
        if self._nameless[list(chosen)].any():
            barred |= self._repeats
        if self._repeats[list(chosen)].any():
            barred |= self._nameless
        return barred | self._nameless if self.named_only else barred

    def grown(self, chosen: Set, most: int) -> list[tuple[float, Set]]:
        """A set with one further group, the best of these taken in full."""
        log, width = self.additions(chosen)
        found = []
        for i in np.argsort(-log)[:most]:
            if log[i] > self.top - LOOKED_AT:
                larger = with_group(chosen, int(i))
                found.append((self.score(larger, {**self.widths[chosen], int(i): int(width[i])}), larger))
        return found

    def neighbours(self, chosen: Set, swaps: int, additions: int) -> list[tuple[float, Set]]:
        """A set with one group more, one less, or one in place of another."""
        found = self.grown(chosen, additions)
        for i in chosen:
            less = without(chosen, i)
            found.append((self.score(less, self.widths[chosen]), less))
            found += self.grown(less, swaps)
        return found

    def far_neighbours(self, chosen: Set) -> list[tuple[float, Set]]:
        """A set with two groups in place of one, or one in place of two."""
        found = []
        for i in chosen:
            less = without(chosen, i)
            log, width = self.additions(less)
            for j in np.argsort(-log)[:7]:
                other = with_group(less, int(j))
                if other != chosen and math.isfinite(log[j]):
                    self.score(other, {**self.widths[chosen], int(j): int(width[j])})
                    found += self.grown(other, 2)
            for j in less:
                if j < i:
                    fewer = without(less, j)
                    self.score(fewer, self.widths[chosen])
                    found += self.grown(fewer, 2)
        return found

    def climb(self, start: Set, thorough: bool) -> Set:
        """The best set that is reached from a start by one group more, less or another, and where nothing is gained by
        that by two for one.
        """
        best, log = start, self.score(start)
        self.top = max(self.top, log)
        while True:
            better = max(self.neighbours(best, 2, 3), default=(-math.inf, ()))
            if better[0] <= log + 1e-6 and thorough:
                better = max(self.far_neighbours(best), default=(-math.inf, ()))
            if better[0] <= log + 1e-6:
                break
            log, best = better
            if self.late():
                break
        return best

    def survey(self, about: Set) -> None:
        """Look at what is nearly as probable as the best."""
        heap, done = [(-self.score(about), about)], set[Set]()
        while heap and len(done) < ABOUT and not self.late():
            log, chosen = heapq.heappop(heap)
            if chosen in done:
                continue
            if -log < self.top - NEIGHBOURS_OF:
                break
            done.add(chosen)
            for each, other in self.neighbours(chosen, 3, 6):
                heapq.heappush(heap, (-each, other))
        self._settle()

    def _settle(self) -> None:
        """Take in full what was looked at only nearly and would be probable: a further effect may turn a coordinate
        of another to where it cannot be.
        """
        while not self.late():
            nearly = [chosen for chosen, log in self.known.items() if log > self.top - LOOKED_AT]
            nearly = [chosen for chosen in nearly if chosen not in self.widths]
            if not nearly:
                return
            for chosen in nearly:
                self.score(chosen)

    def named(self, chosen: Set) -> bool:
        """Whether nothing of a set is an unknown."""
        return not self._nameless[list(chosen)].any()

    def best(self, most: int = 1, named: bool = False) -> list[Set]:
        """The most probable sets that were taken in full, of all or of those without an unknown."""
        taken = [chosen for chosen in self.widths if self.named(chosen)] if named else list(self.widths)
        return sorted(taken, key=lambda chosen: -self.known[chosen])[:most]


def summed(logs: np.ndarray) -> np.ndarray:
    """Log of the sum over the last axis (n, k); scipy's checks take ten times as long for so few."""
    top = logs.max(axis=-1, keepdims=True)
    return np.asarray(np.log(np.exp(logs - top).sum(axis=-1)) + top[..., 0])


def profiles(left: np.ndarray, wanted: np.ndarray, positive: np.ndarray, odds: np.ndarray) -> np.ndarray:
    """Log (n, widths) of what each of n groups adds by its width, from what others leave of its products (n, k, k) and
    (n, k); which coordinates are positive, (n, k) bool, and the log odds of widths (n, widths).
    """
    if wanted.shape[1] == 1:
        values, turned = np.maximum(left[:, 0], 0.0), wanted
    else:
        values, vectors = np.linalg.eigh(left)
        values, turned = np.maximum(values, 0.0), np.einsum("nkl,nk->nl", vectors, wanted)
    curved = values[:, None] + 1 / WIDTHS[:, None] ** 2
    log = (turned[:, None] ** 2 / curved - np.log(curved * WIDTHS[:, None] ** 2)).sum(axis=2) / 2 + odds
    if not positive.any():
        return np.asarray(log)
    mean, variance = turned[:, None] / curved, 1 / curved
    if wanted.shape[1] > 1:
        mean = np.einsum("nkl,nml->nmk", vectors, mean)
        variance = np.einsum("nkl,nml->nmk", vectors**2, variance)
    return np.asarray(log + np.where(positive[:, None], math.log(2) + log_ndtr(mean / np.sqrt(variance)), 0.0).sum(2))


def with_group(chosen: Set, i: int) -> Set:
    """A set with a further group."""
    return tuple(sorted((*chosen, i)))


def without(chosen: Iterable[int], i: int) -> Set:
    """A set without one of its groups."""
    return tuple(j for j in chosen if j != i)
