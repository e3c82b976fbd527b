"""The best runs and sensors for a budget: one after the other by what each gains for its price, then exchanged."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from compare.diagnose.plan.information import outcomes, products
from compare.diagnose.plan.pool import Pool
from compare.progress import Progress

Part = int | str  # a run by its place in the pool, or a sensor by its signal
Parts = frozenset[Part]
PROMISING = 16  # parts that gained most when one was added, which are tried in place of others
ROUNDS = 3  # of exchanges
FINE = 1e-3  # bits: what outcomes that are drawn alike cannot tell apart


@dataclass(frozen=True)
class Step:
    """What one more part brings: ``bits`` of information with all parts up to it."""

    part: Part
    bits: float


@dataclass(frozen=True)
class Chosen:
    """The runs, by their places in the pool, the sensors, and in which order they were worth most."""

    runs: tuple[int, ...]
    sensors: tuple[str, ...]
    steps: tuple[Step, ...]
    spent: float


class Chooser:
    """Chooses parts within the budget; what was drawn for some parts is kept."""

    def __init__(self, pool: Pool, progress: Progress) -> None:
        self.pool, self.progress = pool, progress
        self.price: Mapping[Part, float] = {i: run.price for i, run in enumerate(pool.runs)} | {
            s.signal: s.price for s in pool.bench.sensors
        }
        self.free: Parts = frozenset[Part](s.signal for s in pool.bench.sensors if not s.price)
        self._bits: dict[Parts, float] = {}

    def best(self) -> Chosen:
        """The best parts that were found."""
        parts, gained = self._added(self.free, self.price)
        likely = sorted(gained, key=lambda part: -gained[part])[:PROMISING]
        for k in range(ROUNDS):
            self.progress("exchanging runs and sensors", k, ROUNDS)
            swaps = [self._added((parts - {out}) | {part}, likely)[0] for out in parts - self.free for part in likely]
            better = max((s for s in swaps if self._usable(s)), key=self.bits, default=parts)
            if self.bits(better) <= self.bits(parts) + FINE:
                break
            parts = better
        return self._ordered(parts)

    def bits(self, parts: Parts) -> float:
        """Information that is expected of some parts; none without a run and a sensor."""
        runs, sensors = split(parts)
        if not runs or not sensors:
            return 0.0
        if parts not in self._bits:
            self.progress(f"{len(self._bits)} sets of runs and sensors weighed", len(self._bits), None)
            self._bits[parts] = outcomes(products(self.pool, runs, sensors)).bits
        return self._bits[parts]

    def cost(self, parts: Iterable[Part]) -> float:
        """Price of some parts together."""
        return sum(self.price[part] for part in parts)

    def _usable(self, parts: Parts) -> bool:
        return self.cost(parts) <= self.pool.bench.budget * (1 + 1e-9)

    def _added(self, parts: Parts, among: Iterable[Part]) -> tuple[Parts, dict[Part, float]]:
        """Parts with more of others, as far as the budget goes; and what each gained at best for its price.

        A part gains the less the more there are: of those that gained less before than another does now, none is tried.
        """
        among, rates = list(among), dict[Parts, float]()
        gained = dict[Part, float]()
        while self._usable(parts):
            best: Parts = frozenset()
            for more in sorted(self._affordable(parts, among), key=lambda more: -rates.get(more, math.inf)):
                if best and rates[best] >= rates.get(more, math.inf):
                    break
                rates[more] = self._rate(parts, more)
                gained |= {part: max(rates[more], gained.get(part, 0.0)) for part in more}
                best = more if not best or rates[more] > rates[best] else best
            if not best:
                break
            parts |= best
        return parts, gained

    def _affordable(self, parts: Parts, among: Iterable[Part]) -> Iterator[Parts]:
        """Each part that can be added; a first run comes with a first sensor, if none is free."""
        runs, sensors = split(parts)
        new = [part for part in among if part not in parts]
        if not runs and not sensors:
            pairs = ((r, s) for r in new for s in new if isinstance(r, int) and isinstance(s, str))
            singles: list[Parts] = [frozenset[Part](pair) for pair in pairs]
        elif not runs or not sensors:
            singles = [frozenset({part}) for part in new if isinstance(part, str) == bool(runs)]
        else:
            singles = [frozenset({part}) for part in new]
        return (more for more in singles if self._usable(parts | more))

    def _rate(self, parts: Parts, more: Parts) -> float:
        return (self.bits(parts | more) - self.bits(parts)) / self.cost(more)

    def _ordered(self, parts: Parts) -> Chosen:
        """Parts in the order in which each gains most for its price, those that go together at once."""
        here, steps = self.free, list[Step]()
        while here != parts:
            more = max(self._affordable(here, parts), key=lambda more: self._rate(here, more))
            here = here | more
            steps += [Step(part, self.bits(here)) for part in sorted(more, key=str)]
        order = [step.part for step in steps]
        runs = tuple(part for part in order if isinstance(part, int))
        sensors = tuple(s.signal for s in self.pool.bench.sensors if s.signal in parts)
        return Chosen(runs, sensors, tuple(steps), self.cost(parts))


def split(parts: Iterable[Part]) -> tuple[list[int], list[str]]:
    """Runs, and sensors, in order."""
    parts = list(parts)
    return sorted(p for p in parts if isinstance(p, int)), sorted(p for p in parts if isinstance(p, str))
