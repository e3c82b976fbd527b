"""The law by which a pin strikes its bearing: which restitution, stiffness and friction spread an engine's readings as
they were measured.

Laws are tried in the engine: some all over, then more about the best ones, and from there on where linear models of the
quantiles, through the trials nearby, say that they would be nearest to the measured ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import qmc

from compare.diagnose.rattle.statistics import Key, Readings, Statistics
from compare.diagnose.rattle.trial import misfit

SPREAD = 22  # laws that are tried all over the room
AGAIN = (8, 8)  # more of them about the best ones
ELITE = 5  # trials that count as best ones
WIDER = 1.4  # times as far as these are apart: new ones
LEAST_APART = (0.03, 0.04, 0.05, 0.03)  # of the coordinates, that these are drawn apart at least
WIDTHS = (0.3, 0.15, 0.07)  # of the coordinates: from how far trials enter linear models, and steps may go
ROUNDS = 10  # of these steps
GAIN = 0.015  # of the logarithm of the distance, that such a round must bring for another
SIDE = 0.06  # of each coordinate, to either side of the best trial: the last ones, for intervals
MIDDLE = 0.1  # of the coordinates: from how far trials tell on average where the statistics are nearest
TRIALS_ALIKE = 0.1  # of the logarithm of the distance: trials that close, or joints, are not told apart
TRIALS_APART = 2.0  # standard deviations, over groups of revolutions, by which they may be
TOLD, UNTOLD = 0.4, 0.7  # of a coordinate's answer: what trials that scatter may make of it, and what is all
RELUCTANT = 1e-2  # of all that they are off: where they answer less to a coordinate, it is left where it is
TINY = 0.05  # of what a sensor is off on average: less weighs no more
REWEIGHED = 12  # times, as what is off changes
SIZE = 0.2  # of the logarithm of a clearance: a unit of its coordinate
RUBS = 0.05  # a coefficient of friction from which on its ratio counts, below it its difference
SEED = 3


class Law(NamedTuple):
    """What a pin strikes with: restitution, stiffness (N/m) and coefficient of friction."""

    restitution: float
    stiffness: float
    friction: float


@dataclass(frozen=True)
class Room:
    """Where laws are looked for, by coordinates (4,): restitution, friction (logarithm), decades of stiffness from the
    ``usual`` one (N/m), and the logarithm of the clearance over ``size`` (m) in units of SIZE, which is 0 unless it
    ``moves``.
    """

    usual: float
    size: float
    moves: bool = False
    low: np.ndarray = field(default_factory=lambda: np.array([0.15, 0.0, -1.5, -1.5]))
    high: np.ndarray = field(default_factory=lambda: np.array([0.98, math.log1p(0.6 / RUBS), 0.5, 1.5]))

    @property
    def free(self) -> list[int]:
        """The coordinates that are looked for."""
        return [0, 1, 2, 3] if self.moves else [0, 1, 2]

    def at(self, x: np.ndarray) -> tuple[Law, float]:
        """The law and the clearance (m) of coordinates."""
        law = Law(float(x[0]), self.usual * 10 ** float(x[2]), RUBS * math.expm1(float(x[1])))
        return law, self.size * math.exp(SIZE * float(x[3]))

    def within(self, x: np.ndarray) -> np.ndarray:
        """Coordinates (4,) brought into their room."""
        inside = np.clip(x, self.low, self.high)
        return inside if self.moves else np.array([*inside[:3], 0.0])

    def spread(self, count: int, rng: np.random.Generator) -> list[np.ndarray]:
        """So many coordinates, evenly over the room; the clearance stays unless it moves."""
        even = qmc.Halton(4 if self.moves else 3, rng=rng).random(count)
        k = even.shape[1]
        return [np.array([*row, 0.0][:4]) for row in self.low[:k] + even * (self.high - self.low)[:k]]


Simulate = Callable[[Law, float], Readings | None]  # with a clearance (m)


@dataclass(frozen=True)
class Trial:
    """A law (coordinates (4,)) as the engine has it: how far ``apart`` its readings are from the measured ones by
    sensor, and what their quantiles are ``off``, (n,) each, of all revolutions and with each group left out; and the
    clearance (m) with which positions would reach as far as the measured ones, NaN where none is measured.
    """

    x: np.ndarray
    apart: Sequence[Mapping[Key, float]]
    off: Sequence[Mapping[Key, np.ndarray]]
    wants: float

    def misfit(self, keys: Iterable[Key] | None = None, without: int = 0) -> float:
        """Mean logarithm of the distances of some sensors (None: all)."""
        return misfit(self.apart[without], keys)

    def joined(self, group: int) -> np.ndarray:
        """All that it is off, one sensor after the other."""
        return np.concatenate(list(self.off[group].values()))

    def weights(self, off: np.ndarray, group: int = 0, even: bool = False) -> np.ndarray:
        """Weights of squares of what is off (all,), whose sum goes as the misfit does: the mean logarithm over sensors
        of mean absolute values; ``even`` within each sensor.
        """
        found, begin, sensors = [], 0, self.off[group]
        for each in sensors.values():
            size = np.abs(off[begin : begin + each.size])
            mean = max(float(size.mean()), TINY)
            least = float(np.mean(size**2)) / mean if even else TINY * mean
            size = np.full(each.size, least) if even else np.maximum(size, least)
            found.append(1 / (len(sensors) * each.size * mean * size))
            begin += each.size
        return np.concatenate(found)


class Model(NamedTuple):
    """What statistics are ``off`` (n,) and how they ``answer`` (n, k) to coordinates, by trials that are off that by
    ``left`` (n,), squared, each; ``unsure`` (k, k) is the covariance of an answer over that.
    """

    off: np.ndarray
    answers: np.ndarray
    left: np.ndarray
    unsure: np.ndarray

    def variances(self, weights: np.ndarray) -> np.ndarray:
        """Squares (k,) of how far each coordinate can go until the weighted squares are once more what they are; the
        farther, the more than half of its answer is what trials that scatter make of it.
        """
        squares = (self.answers.T * weights) @ self.answers + RELUCTANT**2 * np.eye(self.answers.shape[1])
        noise = float(weights @ self.left) * np.diag(self.unsure)
        told = np.clip((UNTOLD - noise / np.diag(squares)) / (UNTOLD - TOLD), RELUCTANT**2, 1.0)
        return np.asarray(np.diag(np.linalg.inv(squares)) / told)


@dataclass
class LawSearch:
    """Looks for the law in one joint."""

    statistics: Statistics
    simulate: Simulate
    room: Room
    late: Callable[[], bool] = lambda: False
    trials: list[Trial] = field(default_factory=list)
    middle: Trial | None = None  # where these say on average that the statistics are nearest

    def tried(self, x: np.ndarray) -> Trial | None:
        """A law as the engine has it; None where it has no answer."""
        x = self.room.within(x)
        law, size = self.room.at(x)
        readings = self.simulate(law, size)
        if readings is None:
            return None
        s, spread = self.statistics, self.statistics.spread(readings)
        pairs = [(spread.whole, s.measured.whole), *zip(spread.less, s.measured.less, strict=True)]
        reaches = [s.reaches(spread)[0][key] for key in s.places]
        wants = size * sum(m for m, _ in reaches) / sum(r for _, r in reaches) if reaches else math.nan
        trial = Trial(x, s.distances(spread), [s.off_by(own, measured) for own, measured in pairs], wants)
        self.trials.append(trial)
        return trial

    @property
    def best(self) -> Trial:
        """The nearest."""
        return min(self.trials, key=Trial.misfit)

    @property
    def answer(self) -> Trial:
        """What is found: where the trials on average say that the statistics are nearest, unless another is clearly
        nearer.  Of two that scatter each in its own way the smaller one is always nearer, the average is not.
        """
        best, middle = self.best, self.middle
        if middle is None:
            return best
        groups = [middle.misfit(None, 1 + g) - best.misfit(None, 1 + g) for g in range(self.statistics.groups)]
        alike = middle.misfit() - best.misfit() < max(TRIALS_ALIKE, TRIALS_APART * jackknifed(groups))
        return middle if alike else best

    def searched(self) -> bool:
        """Look for it; False where the engine has no answer to any."""
        rng = np.random.default_rng(SEED)
        for x in self.room.spread(SPREAD, rng):
            self.all([self.as_wanted(x)])
        if not self.trials:
            return False
        for count in AGAIN:
            self.all(self.drawn(count, rng))
        self.nearer()
        self.all([self.best.x + side * SIDE * np.eye(4)[k] for k in self.room.free for side in (-1, 1)])
        if not self.late():
            best = self.best
            self.middle = self.tried(best.x + self.step(best, 0, MIDDLE, even=True))
        return True

    def as_wanted(self, x: np.ndarray) -> np.ndarray:
        """Coordinates with the clearance that the best trial wants, with which positions reach as far as the measured
        ones, where it is looked for and they are measured.
        """
        if not (self.room.moves and self.statistics.places and self.trials):
            return x
        return np.array([*x[:3], math.log(self.best.wants / self.room.size) / SIZE])

    def all(self, at: Sequence[np.ndarray]) -> None:
        """Try some coordinates while there is time."""
        for x in at:
            if not self.late():
                self.tried(x)

    def drawn(self, count: int, rng: np.random.Generator) -> list[np.ndarray]:
        """So many new coordinates, spread about the best of the trials as these are among themselves."""
        best = sorted(self.trials, key=Trial.misfit)[:ELITE]
        weight = np.log(len(best) + 0.5) - np.log(np.arange(1, len(best) + 1))
        weight /= weight.sum()
        x = np.array([each.x for each in best])
        middle = weight @ x
        away = x - middle
        spread = (away.T * weight) @ away * WIDER**2 + np.diag(np.square(LEAST_APART))
        return [middle + step for step in rng.multivariate_normal(np.zeros(4), spread, count)]

    def nearer(self) -> None:
        """Step from the best trial to the least misfit of linear models through trials far and near, as long as one of
        these steps comes nearer.
        """
        for _ in range(ROUNDS):
            best = self.best
            self.all([best.x + self.step(best, 0, width) for width in WIDTHS])
            if best.misfit() - self.best.misfit() < GAIN:
                break

    def model(self, best: Trial, group: int, width: float, even: bool) -> Model:
        """What the statistics are off at the best trial and how they answer to each coordinate that is looked for, by
        the trials within a width of it: as that one is off itself, or ``even``, as these are on average.
        """
        away = np.array([each.x - best.x for each in self.trials])[:, self.room.free]
        off, own = np.array([each.joined(group) for each in self.trials]), best.joined(group)
        weight = np.exp(-0.5 * np.sum((away / width) ** 2, axis=1))
        terms = np.column_stack([away, np.ones(len(away))]) if even else away
        ridge = 1e-3 * width**2 * np.diag([*np.ones(away.shape[1]), 0.0][: terms.shape[1]])
        inverse = np.linalg.inv((terms.T * weight) @ terms + ridge)
        found = inverse @ (terms.T * weight) @ (off - own)
        left = weight @ (off - own - terms @ found) ** 2 / max(float(weight.sum()) - len(found), 0.5)
        k = away.shape[1]
        return Model(own + found[-1] if even else own, found[:k].T, left, inverse[:k, :k])

    def step(self, best: Trial, group: int, width: float, even: bool = False) -> np.ndarray:
        """From the best trial to the least misfit of a linear model, (4,), as far as that goes at most; of an ``even``
        one to the least squares.
        """
        free, room = self.room.free, self.room
        model = self.model(best, group, width, even)
        off, answers = model.off, model.answers
        low, high = np.maximum(room.low - best.x, -width)[free], np.minimum(room.high - best.x, width)[free]
        step = np.zeros(4)
        for _ in range(1 if even else REWEIGHED):
            root = np.sqrt(best.weights(off + answers @ step[free], group, even))
            rows = np.vstack([answers * root[:, None], RELUCTANT * np.eye(len(free))])
            wanted = np.concatenate([-off * root, np.zeros(len(free))])
            step[free] = lsq_linear(rows, wanted, (low - 1e-9, high + 1e-9)).x
        return step

    def scatter(self) -> np.ndarray:
        """Standard deviations (4,) of the coordinates that were found: by which leaving revolutions out moves them, and
        by which the statistics would be off once more what they are.
        """
        found, free = self.answer, self.room.free
        moved = [self.step(found, 1 + g, MIDDLE, even=True)[free] for g in range(self.statistics.groups)]
        drawn = (len(moved) - 1) * np.var(moved, axis=0)
        model = self.model(found, 0, MIDDLE, even=True)
        flat = model.variances(found.weights(model.off, even=True))
        wide = np.zeros(4)
        wide[free] = np.sqrt(drawn + flat)
        return wide


def jackknifed(values: Sequence[float]) -> float:
    """Standard deviation of a statistic whose values with each group left out in turn are these."""
    n = len(values)
    return math.sqrt((n - 1) * float(np.var(values))) if n > 1 else math.inf
