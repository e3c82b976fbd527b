"""What goes to and fro once in a turn of the crank, without clearance: how far, and how long it takes each way."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from analytic.mechanism.signals import wrapped
from analytic.paper.superposition import whole_turn
from compare.quantities import going
from compare.results.analysis import Analysis, Extremes

STROKE = "stroke_"  # with a slide's or a body's name after it: its travel, or its angle, without clearance


@dataclass(frozen=True)
class Stroke:
    """A slide, or a body that rocks, with the signal of its place, its ends, and the crank angles (rad) that it takes
    one way and back, the longer way first.
    """

    what: str
    signal: str
    ends: Extremes
    long: float
    short: float

    @property
    def ratio(self) -> float:
        """How many times as long the slow way takes as the quick one."""
        return self.long / self.short


def strokes(result: Analysis) -> Iterator[Stroke]:
    """Each slide and each body on the ground that goes to and fro once in a turn."""
    x = result.crank_angle
    if result.time is not None or not whole_turn(x):
        return
    turns = max(1, round(abs(x[-1] - x[0]) / math.tau))
    for what, signal in going(result.mechanism).items():
        values = result.signals[signal][np.isfinite(result.signals[signal])]
        way = np.diff(values, append=values[:1])
        way = np.sign(wrapped(way) if result.kinds[signal].unit == "rad" else way)
        way = way[way != 0]
        ends = result.extremes.get(f"{STROKE}{what}")
        known = ends is not None and None not in (ends.highest, ends.highest_at, ends.lowest, ends.lowest_at)
        if ends is not None and known and np.sum(way != np.roll(way, 1)) == 2 * turns:
            up = ((ends.highest_at or 0.0) - (ends.lowest_at or 0.0)) % math.tau
            yield Stroke(what, signal, ends, max(up, math.tau - up), min(up, math.tau - up))
