"""Runs folded over whole revolutions of the crank, and whether what is measured comes back in each of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from compare.diagnose.data.recording import Measured, MeasuredRun

TURNS = 3  # whole revolutions of a run, at least, from which statistics are taken
FEWEST = 24  # samples of a revolution, at least
BINS = 24  # of the crank's angle, at most
EACH = 6  # samples of a revolution in a bin, at least
STANDS_OUT = 6.0  # sigmas, by which a sample leaves what is usual at its angle
OFTEN = 0.01  # share of a run's samples that do so in two sensors at once
PEAKED = 5.0  # fourth moment over the squared variance of a sensor that is struck; of noise 3, of hum less


@dataclass(frozen=True)
class Turns:
    """The whole revolutions of a run: ``turn`` (N,) counts them from 0, -1 beyond the last whole one; ``phase`` (N,) is
    the crank's angle in its revolution, in [0, 1), and ``gone`` (N,) how many revolutions it has turned, either way.
    """

    turn: np.ndarray
    phase: np.ndarray
    gone: np.ndarray

    @classmethod
    def of(cls, angle: np.ndarray) -> Turns:
        """Those of a crank's angles (N,) rad that go one way."""
        gone = np.abs(angle - angle[0]) / (2 * math.pi)
        turn = np.floor(gone).astype(int)
        whole = math.floor(float(gone[-1]) + 1.0 / max(angle.size / max(float(gone[-1]), 1e-9), 1.0))
        return cls(np.where(turn < whole, turn, -1), (angle / (2 * math.pi)) % 1.0, gone)

    @classmethod
    def enough(cls, angle: np.ndarray) -> Turns | None:
        """Those of a crank's angles (N,) rad, if they go one way in enough revolutions of enough samples each."""
        steps = np.diff(angle)
        if angle.size <= TURNS * FEWEST or not (np.all(steps > 0) or np.all(steps < 0)):
            return None
        turns = cls.of(angle)
        return turns if turns.count >= TURNS and np.sum(turns.turn >= 0) >= FEWEST * turns.count else None

    @cached_property
    def count(self) -> int:
        """How many there are."""
        return int(self.turn.max()) + 1

    @cached_property
    def bins(self) -> int:
        """Into how many parts of a revolution its samples go."""
        each = int(np.sum(self.turn >= 0)) / max(self.count, 1)
        return int(np.clip(each // EACH, 4, BINS))

    def table(self, turns: Sequence[int] | None = None) -> np.ndarray:
        """Indices (bins, most) of the samples of each bin in all revolutions, or in these; -1 where there is none."""
        here = np.flatnonzero(self.turn >= 0 if turns is None else np.isin(self.turn, turns))
        at = np.minimum((self.phase[here] * self.bins).astype(int), self.bins - 1)
        order = np.argsort(at, kind="stable")
        counts = np.bincount(at, minlength=self.bins)
        found = np.full((self.bins, max(int(counts.max(initial=0)), 1)), -1)
        found[np.repeat(np.arange(self.bins), counts), _within(counts)] = here[order]
        return found

    def middles(self) -> np.ndarray:
        """Index (bins,) of the sample of the first revolution that is nearest to the middle of each bin."""
        here = np.flatnonzero(self.turn == 0)
        apart = np.abs(self.phase[here] * self.bins - 0.5 - np.arange(self.bins)[:, None])
        return here[np.argmin(apart, axis=1)]

    def folded(self, values: np.ndarray) -> np.ndarray:
        """Values (N,) at even phases of each revolution, (count, n); what is absent is filled in between."""
        here = np.isfinite(values)
        n = int(np.sum(self.turn >= 0)) // self.count
        return np.interp((np.arange(n * self.count) + 0.5) / n, self.gone[here], values[here]).reshape(self.count, n)

    def folded_known(self, values: np.ndarray, turns: Sequence[int]) -> np.ndarray:
        """The same (most, n) of those of these revolutions in which values are known."""
        known = np.bincount(self.turn[(self.turn >= 0) & np.isfinite(values)], minlength=self.count)
        whole = known > known.max() / 2
        return self.folded(values)[[t for t in turns if whole[t]]]


def _within(counts: np.ndarray) -> np.ndarray:
    """0, 1, ... within each of some groups, one after the other."""
    return np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def rattles(measured: Measured, turns: Mapping[str, Turns], sensors: Mapping[str, Sequence[str]]) -> bool:
    """Whether a run shows what pins do that strike: two sensors or more are thrown off what is usual at that angle of
    the crank at the same instant, again and again and by far.  Noise, hum and spikes of one sensor do not.
    """
    return any(_struck(run, turns[run.name], sensors[run.name]) for run in measured.runs if run.name in turns)


def _struck(run: MeasuredRun, turns: Turns, sensors: Sequence[str]) -> bool:
    thrown = []
    for signal in sensors:
        channel = run.channels[signal]
        if np.isfinite(channel.raw).sum() < FEWEST:
            continue
        each = turns.folded(channel.raw)
        off = each - np.median(each, axis=0)
        spread = float(np.mean(off**2))
        if spread == 0 or float(np.mean(off**4)) < PEAKED * spread**2:
            continue
        thrown.append(np.abs(off) > STANDS_OUT * max(channel.noise, 0.25 * math.sqrt(spread)))
    return len(thrown) > 1 and float(np.mean(np.sum(thrown, axis=0) >= 2)) > OFTEN
