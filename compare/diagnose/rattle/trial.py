"""Clearance tried joint by joint in the engine: which size of it spreads the sensors' readings most as they were."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from compare.diagnose.predict import Term
from compare.diagnose.rattle.statistics import Key, Readings, Statistics

FIRST = 2  # revolutions of each run, in which all joints are tried
AROUND = (0.75, 1.2)  # times the size that mean positions want, tried first
COARSE = (2e-4, 8e-4, 3.2e-3, 1.3e-2)  # of the shortest link: sizes tried first where no position is measured
NEAR = 0.3  # of the logarithm of the distance: joints that far from the best are looked at no more
CLOSER = (0.8, 1.0, 1.25)  # times the best size so far, tried with all revolutions

Simulate = Callable[[Term, float, int | None], Readings | None]  # clearance (m), revolutions of each run (None: all)


@dataclass(frozen=True)
class Tried:
    """A clearance (m) in a joint as the engine has it, with how far each sensor's readings are from the measured ones:
    of all revolutions, and with each group of revolutions left out.
    """

    term: Term
    size: float
    apart: Sequence[Mapping[Key, float]]

    def misfit(self, keys: Iterable[Key] | None = None, without: int = 0) -> float:
        """Mean logarithm of the distances of some sensors (None: all)."""
        return misfit(self.apart[without], keys)


def misfit(apart: Mapping[Key, float], keys: Iterable[Key] | None = None) -> float:
    """Mean logarithm of the distances of some sensors (None: all): each counts by what share of its distance goes."""
    return float(np.mean([math.log(apart[key]) for key in (apart if keys is None else keys)]))


@dataclass
class Trials:
    """Tries clearance in joints, each size once."""

    statistics: Statistics
    simulate: Simulate
    shortest: float  # m, of the links
    largest: Callable[[Term], float]  # m, that may be blamed
    late: Callable[[], bool] = lambda: False
    done: dict[tuple[Term, float, int | None], Tried | None] = field(default_factory=dict)

    def tried(self, term: Term, size: float, turns: int | None) -> Tried | None:
        """A clearance as the engine has it; None where it has no answer."""
        size = float(f"{min(size, self.largest(term)):.3g}")
        key = term, size, turns
        if key not in self.done:
            readings = self.simulate(*key)
            self.done[key] = None
            if readings is not None:
                spread = self.statistics.spread(readings)
                self.done[key] = Tried(term, size, self.statistics.distances(spread))
        return self.done[key]

    def all(self, term: Term, sizes: Iterable[float], turns: int | None) -> list[Tried]:
        """Those sizes that the engine has an answer for."""
        found = (self.tried(term, size, turns) for size in sizes)
        return [each for each in found if each is not None]

    def searched(self, wanted: Mapping[Term, float | None], nominal: float) -> list[list[Tried]]:
        """Every joint's trials with all revolutions, the best joint first and each joint's best size first; none where
        the first ones show no joint to be nearer than the nominal mechanism, whose misfit is given.

        ``wanted`` are the joints with the size (m) that mean positions want, None where none is measured.
        """
        first = {
            term: self.all(term, [f * size for f in AROUND] if size else [f * self.shortest for f in COARSE], FIRST)
            for term, size in wanted.items()
        }
        best = {term: min(tried, key=Tried.misfit) for term, tried in first.items() if tried}
        nearest = min((each.misfit() for each in best.values()), default=math.inf)
        if nearest > nominal:
            return []
        found = [self.closer(each) for each in best.values() if each.misfit() < nearest + NEAR]
        return sorted((tried for tried in found if tried), key=lambda tried: tried[0].misfit())

    def closer(self, first: Tried) -> list[Tried]:
        """Trials of a joint with all revolutions about its best size so far, the best first."""
        found = self.all(first.term, [f * first.size for f in CLOSER], None)
        for _ in range(3):
            if len(found) < 3 or self.late():
                break
            sizes = sorted(each.size for each in found)
            best = min(found, key=Tried.misfit).size
            if sizes[0] < best < sizes[-1]:
                break
            found += self.all(first.term, [best * (0.7 if best == sizes[0] else 1.4)], None)
        if len(found) >= 3:
            found += self.all(first.term, [least(found, lambda each: each.misfit())], None)
        return sorted(found, key=Tried.misfit)


def least(tried: Sequence[Tried], misfit: Callable[[Tried], float]) -> float:
    """The size (m) of the least misfit, by the parabola through all trials near the best one."""
    best = min(tried, key=misfit)
    near = sorted(tried, key=lambda each: abs(math.log(each.size / best.size)))[:5]
    x = np.log([each.size / best.size for each in near])
    if np.unique(x).size < 3:
        return best.size
    curve = np.polyfit(x, [misfit(each) for each in near], 2)
    if curve[0] <= 0:
        return best.size
    return best.size * math.exp(float(np.clip(-curve[1] / (2 * curve[0]), x.min(), x.max())))


def wanted(measured: Mapping[Key, np.ndarray], a_little: Mapping[Key, np.ndarray], sigma: Mapping[Key, float]) -> float:
    """How many times as large as ``a_little`` a clearance is whose mean displacements are the measured ones: medians
    (bins,) of positions by sensor, over the noise, by least absolute deviations.
    """
    m = np.concatenate([measured[key] / sigma[key] for key in a_little])
    a = np.concatenate([a_little[key] / sigma[key] for key in a_little])
    here = np.isfinite(m) & np.isfinite(a) & (a != 0)
    if not here.any():
        return 0.0
    ratio, weight = m[here] / a[here], np.abs(a[here])
    order = np.argsort(ratio)
    share = np.cumsum(weight[order])
    return float(ratio[order][np.searchsorted(share, share[-1] / 2)])
