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
WORTH_A_LOOK = 0.3  # of the logarithm of the distance: joints that far from the best are looked at no more
CLOSER = (0.8, 1.0, 1.25)  # times the best size so far, tried with all revolutions where no position is measured
THERE = 0.04  # of the logarithm of a size: no trial is made nearer to the last
AGAIN = 4  # trials on the way there, at most
WORSE = 0.1  # of the logarithm of the distance: where one restitution does so much worse, no larger one is tried
FARTHER = 0.5  # of the same: joints that far behind the best are not tried with its law of contact
FARTHEST = 0.25  # of the logarithm of a size: trials that far from it say nothing of it

Simulate = Callable[[Term, float, int | None], Readings | None]  # clearance (m), revolutions of each run (None: all)


@dataclass(frozen=True)
class Tried:
    """A clearance (m) in a joint as the engine has it, with how far each sensor's readings are from the measured ones:
    of all revolutions, and with each group of revolutions left out; and how far these and those reach.
    """

    term: Term
    size: float
    apart: Sequence[Mapping[Key, float]]
    reach: Sequence[Mapping[Key, tuple[float, float]]] = ()

    def wants(self, keys: Iterable[Key], without: int = 0) -> float:
        """The clearance (m) with which readings of positions would reach as far as the measured ones do.

        How far they are apart says less: of two that scatter each in its own way the smaller one is always nearer.
        """
        reaches = [self.reach[without][key] for key in keys]
        return self.size * sum(measured for measured, _ in reaches) / sum(simulated for _, simulated in reaches)

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
    others: Callable[[Term], Sequence[Term]] = lambda term: ()  # the same clearance with other laws of contact
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
                distances, reaches = self.statistics.distances(spread), self.statistics.reaches(spread)
                self.done[key] = Tried(term, size, distances, reaches)
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
        near = sorted((each for each in best.values() if each.misfit() < nearest + WORTH_A_LOOK), key=Tried.misfit)
        found: list[list[Tried]] = []
        for each in near:
            closest = min((tried[0].misfit() for tried in found), default=math.inf)
            tried = self.closer(each, closest + WORTH_A_LOOK)
            found += [tried] if tried else []
        found.sort(key=lambda tried: tried[0].misfit())
        return self.bounced(found) if found else []

    def closer(self, first: Tried, farthest: float = math.inf) -> list[Tried]:
        """Trials of a joint with all revolutions about its best size so far, the best first; a single one where that
        shows the joint to be ``farthest`` off or more.
        """
        places = self.statistics.places
        found = self.approached(first.term, self.size(first), farthest) if places else self.about(first)
        return sorted(found, key=Tried.misfit)

    def bounced(self, found: Sequence[list[Tried]]) -> list[list[Tried]]:
        """Trials of joints, the best joint first, and those in which impacts give back otherwise: of the best joint
        until that does worse, and of others that are near with what does best there.
        """
        best, usual = list(found[0]), found[0][0].term
        for other in self.others(usual):
            tried = self.again(best[0], other)
            if not tried or self.late():
                break
            worse = tried[0].misfit() - best[0].misfit()
            best = sorted(
                best + (self.approached(other, self.size(tried[0])) if worse < 0 else tried), key=Tried.misfit
            )
            if worse > WORSE:
                break
        law = list(self.others(usual)).index(best[0].term) if best[0].term != usual else None
        rivals = []
        for tried in found[1:]:
            if law is not None and tried[0].misfit() < best[0].misfit() + FARTHER and not self.late():
                tried = sorted(tried + self.again(tried[0], self.others(tried[0].term)[law]), key=Tried.misfit)
            rivals.append(tried)
        return sorted([best, *rivals], key=lambda tried: tried[0].misfit())

    def again(self, tried: Tried, other: Term) -> list[Tried]:
        """A trial with all revolutions of another law, of the size that this one wants."""
        return self.all(other, [self.size(tried)], None)

    def size(self, tried: Tried) -> float:
        """The clearance (m) that a trial wants where positions are measured, else its own."""
        return tried.wants(self.statistics.places) if self.statistics.places else tried.size

    def approached(self, term: Term, size: float, farthest: float = math.inf) -> list[Tried]:
        """Trials with all revolutions, from a size to that with which positions reach as far as the measured ones; a
        single one where that is ``farthest`` off or more.
        """
        found: list[Tried] = []
        for _ in range(AGAIN):
            found += self.all(term, [size], None)
            if not found or self.late() or found[0].misfit() > farthest:
                break
            size = min(self.size(found[-1]), self.largest(term))
            if min(abs(math.log(each.size / size)) for each in found) < THERE:
                break
        return found

    def about(self, first: Tried) -> list[Tried]:
        """Trials with all revolutions about a size, to either side of the least misfit."""
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
        return found


def reaching(tried: Sequence[Tried], places: Sequence[Key], without: int = 0) -> float:
    """The size (m) with which positions reach as far as the measured ones: the mean of what the trials want that have
    the best one's law and are near it.
    """
    best = tried[0].wants(places)
    near = [each for each in tried if each.term == tried[0].term and abs(math.log(each.size / best)) < FARTHEST]
    return math.exp(float(np.mean([math.log(each.wants(places, without)) for each in near or tried[:1]])))


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
