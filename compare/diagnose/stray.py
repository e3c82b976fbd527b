"""What stays unexplained of a released linkage: a small torque on its freedom that nobody has named.

No motor corrects what such a torque does.  It changes the rate, with that the period, and the error grows with time;
the residuals of a fitted swing hold little of it, as the start and the values found have taken on what they could.
The torque at an angle q and a rate w is taken to be

    a_0 + a_1 cos q + a_2 sin q + a_3 cos 2q + a_4 sin 2q + a_5 sign w + a_6 w / W + a_7 w |w| / W^2 + u(t),

W the rms rate of the fitted swings.  The a, the same in all swings, are normal with mean zero and one standard
deviation; u is steady over a length of time, independent from one to the next, and has another.  A law that values
found do themselves, as damping does a_6, has their names already and is none of these.  With B(t) (2, 2), what
angle and rate at the start change of those at t, and the inertia M(t), a torque f(t) does to first order what a change
of the start would do that grows as

    c(t) = integral from 0 to t of B(r)^-1 (0, f(r) / M(r)) dr.

The residuals of fitted swings are then normal, of starts and values found that are free, of the torque, and of noise
with what else is alike over neighbouring samples.  The length is the likeliest one, and the two standard deviations
have their posterior, flat before the data.  So a and the values found have a mean and a covariance, which tell another
swing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from compare.diagnose.mixture import Discrepancy

LENGTHS = (16, 32, 64, 128, 256)  # of which so many fill the longest swing
FEWEST = 4  # samples of a length
SIZES = np.geomspace(1e-2, 1e7, 46)  # of a standard deviation, in what all torques of its kind together are known to
LAWS = 8  # of the state
RIDGE = 1e-9  # of a normalised column's square
SAME = 1e-4  # of a law's column: errors of the columns of values that do exactly what it does
LOST = 1e-6  # of the start's changes: motions that have come to rest together


@dataclass(frozen=True)
class Swing:
    """A swing of N samples: times (s), angle and rate of the driven body (2, N), M (N,), B (2, 2, N), and what each
    coordinate of the start (2, R, N) and a standard deviation of each value found (m, R, N) change of its R readings.
    """

    time: np.ndarray
    state: np.ndarray = field(repr=False)
    inertia: np.ndarray = field(repr=False)
    motion: np.ndarray = field(repr=False)
    start: np.ndarray = field(repr=False)
    values: np.ndarray = field(repr=False)

    @property
    def fastest(self) -> float:
        """Its largest rate (rad/s)."""
        return float(np.abs(self.state[1]).max())

    def torques(self, length: float) -> np.ndarray:
        """What 1 N.m over each length (s) in turn changes of the readings (k, R, N)."""
        since = self.time - self.time[0]
        begins = length * np.arange(max(1, math.ceil(since[-1] / length - 1e-9)))
        within = np.clip(since, begins[:, None], begins[:, None] + length)
        whole = self._grown(np.ones(since.size))
        return np.einsum("irn,ikn->krn", self.start, whole(within) - whole(begins)[..., None])

    def laws(self, pace: float) -> np.ndarray:
        """What 1 N.m of each law of the state changes of the readings (LAWS, R, N), W being a pace (rad/s)."""
        q, w = self.state[0], self.state[1] / pace
        told = (np.ones(q.size), np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q), np.sign(w), w, w * np.abs(w))
        since = self.time - self.time[0]
        return np.array([np.einsum("irn,in->rn", self.start, self._grown(each)(since)) for each in told])

    def _grown(self, torque: np.ndarray) -> CubicSpline:
        """The change of the start (2,) that a torque (N,) N.m has grown to since the start: c.

        A value found can do exactly what a law does.  To tell them apart by an error of this integral would be to know
        both, so it is one of a smooth course through the samples.
        """
        (a, b), (c, d) = self.motion
        whole = a * d - b * c
        there = np.abs(whole) > LOST
        kick = np.array([-b, a]) * there / np.where(there, whole, 1.0) * torque / self.inertia
        return CubicSpline(self.time - self.time[0], kick, axis=1).antiderivative()


@dataclass(frozen=True)
class Fitted:
    """A fitted swing with the residuals (R, N) of its readings, their noise (R,) and sensors."""

    swing: Swing
    residual: np.ndarray = field(repr=False)
    noise: Sequence[float]
    signals: Sequence[str]


@dataclass(frozen=True)
class Stray:
    """The torque that swings show whose rates are a ``pace`` (rad/s, rms) and ``fastest`` at most: the standard
    deviation ``size`` (N.m) of what is steady over a ``length`` (s), and mean (n,) and covariance (n, n) of its LAWS
    (N.m) and, after them, of what the values found are off, in their standard deviations.
    """

    size: float
    length: float
    pace: float
    fastest: float
    mean: np.ndarray = field(repr=False)
    covariance: np.ndarray = field(repr=False)

    def growth(self, swing: Swing) -> float:
        """How many times as large what goes with no law is in a swing: no force of a linkage grows faster than the
        square of its rate.
        """
        return max(1.0, swing.fastest / self.fastest) ** 2

    def foretold(self, swing: Swing) -> tuple[np.ndarray, np.ndarray]:
        """The mean and the variance (R, N) of what it changes of a swing's readings, beside the values found."""
        columns = np.concatenate([swing.laws(self.pace), swing.values])
        by_law = np.einsum("irn,ij,jrn->rn", columns, self.covariance, columns)
        size = self.size * self.growth(swing)
        return np.einsum("irn,i->rn", columns, self.mean), by_law + size**2 * np.sum(
            swing.torques(self.length) ** 2, axis=0
        )


def stray(swings: Sequence[Fitted], length: float | None = None) -> Stray:
    """The torque that fitted swings show, of the likeliest length or of this one (s)."""
    if length is not None:
        return _of_length(swings, length)[1]
    longest = max(float(np.ptp(each.swing.time)) for each in swings)
    shortest = FEWEST * max(float(np.median(np.diff(each.swing.time))) for each in swings)
    lengths = [longest / k for k in LENGTHS if longest / k >= shortest] or [longest / LENGTHS[0]]
    return max((_of_length(swings, length) for length in lengths), key=lambda found: found[0])[1]


def _of_length(swings: Sequence[Fitted], length: float) -> tuple[float, Stray]:
    """The logarithm of the likelihood of a length, and the torque."""
    pace = math.sqrt(float(np.mean(np.concatenate([each.swing.state[1] for each in swings]) ** 2)))
    fastest = max(each.swing.fastest for each in swings)
    pace, fastest = (each or 1.0 for each in (pace, fastest))  # of swings that stay at rest anything
    signals = [s for each in swings for s in each.signals]
    residuals = [r for each in swings for r in each.residual]
    noises = [noise**2 for each in swings for noise in each.noise]
    blocks, free, laws = _columns(swings, length, pace)
    variances = noises
    for _ in range(2):
        rows, wanted = _weighted(blocks, residuals, variances)
        known = rows.T @ rows
        x = np.linalg.solve(known + np.diag(RIDGE * np.diag(known) + 1e-300), rows.T @ wanted)
        left = [r - b @ x for r, b in zip(residuals, blocks, strict=True)]
        alike = {s: Discrepancy.of([each for each, of in zip(left, signals, strict=True) if of == s]) for s in signals}
        variances = [n + 2 * alike[s].samples * alike[s].size ** 2 for n, s in zip(noises, signals, strict=True)]
    rows, wanted = _weighted(blocks, residuals, variances)
    starts = np.linalg.qr(rows[:, :free])[0]
    rows, wanted = (each - starts @ (starts.T @ each) for each in (rows[:, free:], wanted))
    values = np.arange(laws, laws + len(swings[0].swing.values))
    at = np.append(np.flatnonzero(_unmade(rows[:, :laws], rows[:, values])), values)
    own = np.concatenate([rows[:, at], rows[:, values.size + laws :]], axis=1)
    log, size, told, spread = _sized(own, wanted, at.size - values.size, values.size)
    mean, covariance = np.zeros(laws + values.size), np.zeros((laws + values.size, laws + values.size))
    mean[at], covariance[np.ix_(at, at)] = told, spread
    log -= 0.5 * sum(np.isfinite(r).sum() * math.log(v) for r, v in zip(residuals, variances, strict=True))
    return log, Stray(size, length, pace, fastest, mean, covariance)


def _unmade(laws: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Which laws (k,), of these columns (N, k), no values do, of these (N, m)."""
    by = values / (np.linalg.norm(values, axis=0) + 1e-300)
    left = laws - by @ np.linalg.lstsq(by, laws, rcond=RIDGE)[0]
    return np.asarray(np.linalg.norm(left, axis=0) >= SAME * np.linalg.norm(laws, axis=0))


def _columns(swings: Sequence[Fitted], length: float, pace: float) -> tuple[list[np.ndarray], int, int]:
    """By reading what starts, laws, values and torques change (N, n), and how many starts and laws there are."""
    each = [s.swing.torques(length) for s in swings]
    shared = [np.concatenate([s.swing.laws(pace), s.swing.values]) for s in swings]
    free, m = 2 * len(swings), len(swings[0].swing.values)
    begins = free + len(shared[0]) + np.cumsum([0, *(len(t) for t in each)])
    blocks = []
    for k, (fitted, torques) in enumerate(zip(swings, each, strict=True)):
        for r in range(len(fitted.signals)):
            rows = np.zeros((fitted.residual.shape[1], begins[-1]))
            rows[:, 2 * k : 2 * k + 2] = fitted.swing.start[:, r].T
            rows[:, free : begins[0]] = shared[k][:, r].T
            rows[:, begins[k] : begins[k + 1]] = torques[:, r].T
            blocks.append(rows)
    return blocks, free, len(shared[0]) - m


def _weighted(
    blocks: Sequence[np.ndarray], residuals: Sequence[np.ndarray], variances: Sequence[float]
) -> tuple[np.ndarray, np.ndarray]:
    """Rows and what they are to tell, over their standard deviations, where there are readings."""
    parts = [
        (block[np.isfinite(r)] / math.sqrt(v), r[np.isfinite(r)] / math.sqrt(v))
        for block, r, v in zip(blocks, residuals, variances, strict=True)
    ]
    return np.concatenate([rows for rows, _ in parts]), np.concatenate([told for _, told in parts])


def _sized(rows: np.ndarray, wanted: np.ndarray, laws: int, values: int) -> tuple[float, float, np.ndarray, np.ndarray]:
    """The logarithm of the likelihood, the rms standard deviation of torques, and mean and covariance of laws and
    values, over what both standard deviations may be.
    """
    n = laws + values
    scale = np.linalg.norm(rows[:, :n], axis=0)
    scale[scale == 0] = 1.0  # of a body at rest no law of the rate says anything
    law, torque = rows[:, :n] / scale, rows[:, n:]
    known, vectors = np.linalg.eigh(torque.T @ torque)
    known = np.maximum(known, 0.0)
    across, pull = law.T @ torque @ vectors, vectors.T @ (torque.T @ wanted)
    s = SIZES[:, None] / math.sqrt(float(known.sum()) + 1e-300)  # of torques
    spread = 1 / (known + 1 / s**2)
    alone = 0.5 * np.sum(pull**2 * spread + np.log(spread / s**2), axis=1) + np.log(s[:, 0])
    told = law.T @ law - np.einsum("ik,sk,jk->sij", across, spread, across)
    pulls = law.T @ wanted - np.einsum("ik,sk,k->si", across, spread, pull)
    a = SIZES / math.sqrt(laws) / math.sqrt(float(np.mean(scale[:laws] ** 2)))  # of laws
    prior = np.full((a.size, n), RIDGE)
    prior[:, :laws] = 1 / (a[:, None] * scale[:laws]) ** 2
    precision = told[:, None] + prior[:, :, None] * np.eye(n)
    covariance = np.linalg.inv(precision)
    mean = np.einsum("saij,sj->sai", covariance, pulls)
    logs = (
        alone[:, None]
        + np.log(a)
        + 0.5 * (np.einsum("sai,si->sa", mean, pulls) - np.linalg.slogdet(precision)[1] + np.sum(np.log(prior), axis=1))
    )
    weights = np.exp(logs - logs.max())
    log = float(logs.max() + math.log(weights.sum()) - 0.5 * wanted @ wanted)
    weights /= weights.sum()
    middle = np.einsum("sa,sai->i", weights, mean)
    second = np.einsum("sa,saij->ij", weights, covariance + mean[..., :, None] * mean[..., None, :])
    size = math.sqrt(float(weights.sum(axis=1) @ s[:, 0] ** 2))
    return log, size, middle / scale, (second - np.outer(middle, middle)) / np.outer(scale, scale)
