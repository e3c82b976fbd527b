"""Bands of predictions: what parameters leave open to first order, a mixture over sets, and what stays unexplained.

Of the k-th set, of probability p_k, a signal is normal about y_k with variance

    s_k^2 = sum_j ((y_k(v + d_j) - y_k(v - d_j)) / 2)^2 + u_engines^2 + (g s)^2,

d_j the principal axes of the joint covariance of its values v, one standard deviation long (GUM, 5.2.2, with exact
differences in place of derivatives); the band is from the 2.5 % to the 97.5 % quantile of the mixture of these.
What stays unexplained is a process of mean zero.  Its variance is the covariance of neighbouring residuals, of which
white noise has none; its size grows by g away from the data (see :func:`growth`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

TAIL = 0.025
HALVINGS = 60  # of the interval in which a quantile lies: to rounding
SLOWEST = 24  # parts of a run, in each of which what stays unexplained is about the same: a dozen waves
CHANCE_SIGMAS = 2.0  # standard deviations, beyond which a covariance is no chance


@dataclass(frozen=True)
class Discrepancy:
    """What stays unexplained of a signal: its standard deviation ``size`` (SI), and over how many ``samples`` it
    stays alike.
    """

    size: float
    samples: int

    @classmethod
    def of(cls, residuals: Sequence[np.ndarray]) -> Discrepancy:
        """What the residuals (N,) of a signal in several runs, measured less simulated, SI, say of it.

        The covariance is the mean over neighbours up to a SLOWEST-th of a run apart; of those next to each other alone,
        where that is more and no chance.  Of white noise of variance v a mean of N products is zero with a standard
        deviation v / root N; of what is alike over n samples, by half, and then less as 2^(-k/n), the mean square has
        one of root (2 n / (N log 2)) of itself.  One of both is added, as what data cannot rule out.
        """
        whole = [r for r in residuals if np.isfinite(r).sum() > SLOWEST]
        if not whole:
            return cls(0.0, 0)
        shortest = min(r.size for r in whole)
        lags = [np.concatenate([_products(r, lag) for r in whole]) for lag in range(shortest // 2)]
        near = np.concatenate(lags[1 : 1 + max(1, shortest // SLOWEST)])
        variance, next_ones = float(np.mean(lags[0])), float(np.mean(lags[1]))
        shared, white = float(np.mean(near)), variance / math.sqrt(near.size)
        if next_ones > CHANCE_SIGMAS * variance / math.sqrt(lags[1].size):
            shared = max(shared, next_ones)
        alike = next((k for k, each in enumerate(lags) if k and float(np.mean(each)) < shared / 2), len(lags))
        shared = max(shared, 0.0)
        coloured = shared * math.sqrt(2 * alike / (lags[0].size * math.log(2)))
        return cls(math.sqrt(shared + math.hypot(white, coloured)), alike if shared else 0)


def _products(residual: np.ndarray, lag: int) -> np.ndarray:
    """Products (M,) of what lies so many samples apart, where both are known."""
    each = residual[lag:] * residual[: residual.size - lag]
    return each[np.isfinite(each)]


def growth(speed: float, speeds: Sequence[float], peak: float, peaks: float) -> float:
    """How many times what stays unexplained may be as large at a ``speed`` as in data at ``speeds`` (rad/s, sizes).

    Beyond the fastest, as the square of the speed: no force of a rigid linkage grows faster, and none of its
    deflections.  Below the slowest, up to twice: two errors that cancel there may not.  And as the signal itself grows
    from ``peaks``, its largest value in the data, to ``peak``.
    """
    if not speeds or not speed:
        return 1.0
    fast, slow = max(speeds), min(speeds)
    beyond = max(speed / fast, 1.0) ** 2 if fast else 1.0
    below = 2.0 - min(speed / slow, 1.0) if slow else 1.0
    larger = peak / peaks if peaks > 0 else 1.0
    return max(beyond, below, larger, 1.0)


def quantile(share: float, weights: np.ndarray, means: np.ndarray, sds: np.ndarray) -> np.ndarray:
    """The quantile (N,) of mixtures of normal distributions of weights (K,), means (K, N) and deviations (K, N)."""
    reach = 12.0 * sds.max(axis=0) + 1e-300
    low, high = means.min(axis=0) - reach, means.max(axis=0) + reach
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        below = below_it(middle, weights, means, sds) < share
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray((low + high) / 2)


def below_it(value: np.ndarray, weights: np.ndarray, means: np.ndarray, sds: np.ndarray) -> np.ndarray:
    """The share (N,) of such mixtures that lies below values (N,)."""
    return np.asarray(weights @ ndtr((value - means) / np.maximum(sds, 1e-300)))


def axes(values: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """The principal axes (m, n) of a covariance (n, n) of values (n,), each a standard deviation long.  A value that
    the data leave open (NaN) is taken to be known to its own size, by itself.
    """
    variance = np.diag(covariance).copy()
    left_open = ~np.isfinite(variance)
    variance[left_open] = values[left_open] ** 2
    sd = np.sqrt(np.maximum(variance, 0.0))
    seen = sd > 0
    correlation = np.eye(int(seen.sum()))
    both = np.nan_to_num(covariance[np.ix_(seen, seen)] / np.outer(sd[seen], sd[seen]))
    correlation[~np.eye(len(correlation), dtype=bool)] = both[~np.eye(len(correlation), dtype=bool)]
    lengths, vectors = np.linalg.eigh(correlation)
    known = lengths > 1e-9  # of a correlation's own eigenvalues, whose mean is 1
    found = np.zeros((int(known.sum()), values.size))
    found[:, seen] = (vectors[:, known] * np.sqrt(lengths[known])).T * sd[seen]
    return found
