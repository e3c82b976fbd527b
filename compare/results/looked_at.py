"""Signals of results, looked at one by one: the name that was meant, the largest value of each, their picture."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import TYPE_CHECKING

import numpy as np

from analytic.mechanism.signals import Signal
from compare.presentation import picture
from compare.results.document import Row, pictured

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Curves:
    """Signals (N,) by name, SI, of one side at crank angles (N,) rad and times (N,) s, or one of them; ``title`` says
    whose, ``swings`` that they are drawn over the time.
    """

    title: str
    signals: Mapping[str, np.ndarray]
    crank_angle: np.ndarray | None
    time: np.ndarray | None
    swings: bool

    def peaks(self, kinds: Mapping[str, Signal], known: Mapping[str, tuple[float, float]]) -> Iterator[Row]:
        """A row for each signal that has a number: its largest value, with its sign, and where that is; at its crank
        angle (rad), or time (s), where it is ``known`` between the samples too.
        """
        for name, values in self.signals.items():
            if name in kinds and np.any(np.isfinite(values)):
                at = int(np.nanargmax(np.abs(values)))
                where = {"crank_angle": self.crank_angle, "time": self.time}
                places = {over: float(x[at]) for over, x in where.items() if x is not None}
                largest, first = known.get(name, (float(values[at]), None))
                if first is not None:
                    places = self._between(first)
                yield {"signal": name, "unit": kinds[name].unit, "largest": largest, **places}

    @property
    def over(self) -> np.ndarray:
        """What it is drawn over (N,): the crank angle (deg), or the time (s)."""
        x = self.time if self.swings else self.crank_angle
        assert x is not None  # a side has what it is drawn over
        return x if self.swings else np.degrees(x)

    def _between(self, at: float) -> dict[str, float]:
        if self.time is None:
            return {"crank_angle": at}
        turned = {} if self.crank_angle is None else {"crank_angle": float(np.interp(at, self.time, self.crank_angle))}
        return turned | {"time": at}


def no_signal(name: str, those: Collection[str]) -> KeyError:
    """What is raised where a name is no signal of those that there are: it says which was meant."""
    near = get_close_matches(name, those, n=3)
    hint = f"did you mean {' or '.join(near)}?" if near else f"they are {', '.join(those)}"
    return KeyError(f"{name}: no such signal; {hint}")


def plotted(case: str, curves: Sequence[Curves], names: Sequence[str], kinds: Mapping[str, Signal]) -> Figure:
    """A matplotlib figure of signals, one below the other, each with what every side has.

    Raises KeyError with the near names, ImportError with the remedy where matplotlib is not installed.
    """
    there = list(dict.fromkeys(name for side in curves for name in side.signals if name in kinds))
    for name in names:
        if name not in there:
            raise no_signal(name, there)
    return pictured(lambda figure: picture("signals")(case, curves, [kinds[name] for name in names], figure), "plot")
