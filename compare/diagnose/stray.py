"""What stays unexplained of a released linkage: a small torque on its freedom that nobody has named.

No motor corrects what such a torque does.  It changes the rate, with that the period, and the error grows with time;
the residuals of a fitted swing hold little of it, as the start and the values found have taken on what they could.
So the torque is taken to be random: steady over a length of time, independent from one length to the next, of one
standard deviation s.  With B(t) (2, 2), what angle and rate at the start change of those at t, and the inertia M(t),
a torque u(t) does to first order what a change of the start would do that grows as

    c(t) = integral from 0 to t of B(r)^-1 (0, u(r) / M(r)) dr.

The residuals of fitted swings are then normal: starts and values found are free, torques have s, readings their noise
and what else is alike over neighbouring samples.  The length is the likeliest one, and s has its posterior, flat before
the data.  Of another swing s tells how far it strays; the values found are known as well as the torques leave them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from compare.diagnose.mixture import Discrepancy

LENGTHS = (16, 32, 64, 128, 256)  # of which so many fill the longest swing
FEWEST = 4  # samples of a length
SIZES = np.geomspace(1e-3, 1e6, 200)  # of s, in what a torque of all lengths is known to
RIDGE = 1e-9  # of a normalised column's square
LOST = 1e-6  # of the start's changes: motions that have come to rest together


@dataclass(frozen=True)
class Swing:
    """A swing of N samples: times (s), B (2, 2, N), M (N,), the fastest rate, and what each coordinate of the start
    (2, R, N) and a standard deviation of each value found (m, R, N) change of its R readings.
    """

    time: np.ndarray
    motion: np.ndarray = field(repr=False)
    inertia: np.ndarray = field(repr=False)
    rate: float
    start: np.ndarray = field(repr=False)
    values: np.ndarray = field(repr=False)

    def torques(self, length: float) -> np.ndarray:
        """What 1 N.m over each length (s) in turn changes of the readings (k, R, N)."""
        (a, b), (c, d) = self.motion
        whole = a * d - b * c
        kick = np.where(np.abs(whole) > LOST, 1.0, 0.0) * np.array([-b, a]) / np.where(whole == 0, 1.0, whole)
        kick, since = kick / self.inertia, self.time - self.time[0]
        areas = (kick[:, 1:] + kick[:, :-1]) / 2 * np.diff(since)
        grown = np.concatenate([np.zeros((2, 1)), np.cumsum(areas, axis=1)], axis=1)
        begins = length * np.arange(max(1, math.ceil(since[-1] / length - 1e-9)))
        within = np.clip(since, begins[:, None], begins[:, None] + length)
        changes = np.array([np.interp(within, since, each) - np.interp(begins, since, each)[:, None] for each in grown])
        return np.einsum("irn,ikn->krn", self.start, changes)


@dataclass(frozen=True)
class Fitted:
    """A fitted swing with the residuals (R, N) of its readings, their noise (R,) and sensors."""

    swing: Swing
    residual: np.ndarray = field(repr=False)
    noise: Sequence[float]
    signals: Sequence[str]


@dataclass(frozen=True)
class Stray:
    """A torque of standard deviation ``size`` (N.m), steady over a ``length`` (s), as swings show it that were as fast
    as a ``rate``; and the covariance (m, m) of the values found beside it, in standard deviations by the diagnosis.
    """

    size: float
    length: float
    rate: float
    spread: np.ndarray = field(repr=False)

    def growth(self, rate: float) -> float:
        """How many times as large it is in a swing as fast as a rate (rad/s): no force of a linkage grows faster than
        the square.
        """
        return max(1.0, rate / self.rate) ** 2

    def variance(self, swing: Swing) -> np.ndarray:
        """That of the readings (R, N) of a swing by the torque."""
        size = self.size * self.growth(swing.rate)
        return np.asarray(size**2 * np.sum(swing.torques(self.length) ** 2, axis=0))


def stray(swings: Sequence[Fitted]) -> Stray:
    """The torque that fitted swings show."""
    longest = max(float(np.ptp(each.swing.time)) for each in swings)
    shortest = FEWEST * max(float(np.median(np.diff(each.swing.time))) for each in swings)
    lengths = [longest / k for k in LENGTHS if longest / k >= shortest] or [longest / LENGTHS[0]]
    return max((_of_length(swings, length) for length in lengths), key=lambda found: found[0])[1]


def _of_length(swings: Sequence[Fitted], length: float) -> tuple[float, Stray]:
    """The logarithm of the likelihood of a length, and the torque."""
    blocks, torques = _columns(swings, length)
    signals = [s for each in swings for s in each.signals]
    residuals = [r for each in swings for r in each.residual]
    variances = [noise**2 for each in swings for noise in each.noise]
    noises = tuple(variances)
    for _ in range(2):
        rows, wanted = _weighted(blocks, residuals, variances)
        known = rows.T @ rows
        ridge = RIDGE * np.diag(known) + 1e-300
        x = np.linalg.solve(known + np.diag(ridge), rows.T @ wanted)
        left = [r - b @ x for r, b in zip(residuals, blocks, strict=True)]
        alike = {s: Discrepancy.of([each for each, of in zip(left, signals, strict=True) if of == s]) for s in signals}
        variances = [
            noise + 2 * alike[s].samples * alike[s].size ** 2 for noise, s in zip(noises, signals, strict=True)
        ]
    rows, wanted = _weighted(blocks, residuals, variances)
    log = -0.5 * sum(np.isfinite(r).sum() * math.log(v) for r, v in zip(residuals, variances, strict=True))
    size, known_by, more = _sized(rows, wanted, rows.shape[1] - torques)
    m, rate = len(swings[0].swing.values), max(each.swing.rate for each in swings)
    return log + more, Stray(size, length, rate, known_by[2 * len(swings) :, 2 * len(swings) :].reshape(m, m))


def _columns(swings: Sequence[Fitted], length: float) -> tuple[list[np.ndarray], int]:
    """By reading what starts, values and torques change (N, n), and how many torques there are."""
    each = [s.swing.torques(length) for s in swings]
    count, m = len(swings), len(swings[0].swing.values)
    begins = 2 * count + m + np.cumsum([0, *(len(t) for t in each)])
    blocks = []
    for k, (fitted, torques) in enumerate(zip(swings, each, strict=True)):
        for r in range(len(fitted.signals)):
            rows = np.zeros((fitted.residual.shape[1], begins[-1]))
            rows[:, 2 * k : 2 * k + 2] = fitted.swing.start[:, r].T
            rows[:, 2 * count : 2 * count + m] = fitted.swing.values[:, r].T
            rows[:, begins[k] : begins[k + 1]] = torques[:, r].T
            blocks.append(rows)
    return blocks, int(begins[-1] - begins[0])


def _weighted(
    blocks: Sequence[np.ndarray], residuals: Sequence[np.ndarray], variances: Sequence[float]
) -> tuple[np.ndarray, np.ndarray]:
    """Rows and what they are to tell, over their standard deviations, where there are readings."""
    parts = [
        (block[np.isfinite(r)] / math.sqrt(v), r[np.isfinite(r)] / math.sqrt(v))
        for block, r, v in zip(blocks, residuals, variances, strict=True)
    ]
    return np.concatenate([rows for rows, _ in parts]), np.concatenate([told for _, told in parts])


def _sized(rows: np.ndarray, wanted: np.ndarray, free: int) -> tuple[float, np.ndarray, float]:
    """The root mean square of s, the covariance (free, free) of what is free, and the logarithm of the likelihood."""
    scale = np.linalg.norm(rows[:, :free], axis=0) + 1e-300
    u, sizes, v = np.linalg.svd(rows[:, :free] / scale, full_matrices=False)
    told = sizes > math.sqrt(RIDGE)
    u, inverse = u[:, told], (v[told] / sizes[told, None]).T / scale[:, None]
    absorbed = u.T @ rows[:, free:]
    left, rest = rows[:, free:] - u @ absorbed, wanted - u @ (u.T @ wanted)
    known, vectors = np.linalg.eigh(left.T @ left)
    known = np.maximum(known, 0.0)
    pull = vectors.T @ (left.T @ rest)
    s = SIZES / math.sqrt(float(known.sum()) + 1e-300)
    spread = 1 / (known + 1 / s[:, None] ** 2)
    logs = 0.5 * np.sum(pull**2 * spread + np.log(spread / s[:, None] ** 2), axis=1) + np.log(s)
    weights = np.exp(logs - logs.max())
    more = float(logs.max() + math.log(weights.sum()) - 0.5 * rest @ rest)
    weights /= weights.sum()
    answer = inverse @ absorbed @ vectors
    return math.sqrt(float(weights @ s**2)), inverse @ inverse.T + (answer * (weights @ spread)) @ answer.T, more
