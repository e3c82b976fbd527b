"""Effects that may have another value in each run: a zero that is set anew, a bearing that warms up, a clamp that
slips.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from compare.diagnose.effects.effect import Effect, Rig, Values


class EachRun(Effect):
    """Effects of one number, with one value, or one for each run (``offset@run``)."""

    each_run = 1.0  # the variant with a value of its own for each run
    varies: ClassVar[bool] = True  # whether it has that variant

    def runs(self, rig: Rig, where: str) -> Sequence[str]:
        """The runs in which it shows."""
        return rig.runs

    @abstractmethod
    def scale(self, rig: Rig, where: str) -> float:
        """A small amount of the value."""

    def nominal(self, rig: Rig, where: str) -> float:
        """The value of the nominal mechanism."""
        return 0.0

    def variants(self, rig: Rig, where: str) -> Sequence[float]:
        # the noise of free runs is what all effects together leave: values for each run of the rig would be part of it
        told = self.varies and (self.sensor or set(rig.driven) == set(rig.runs))
        return (0.0, self.each_run) if told and len(self.runs(rig, where)) > 1 else (0.0,)

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (self.scale(rig, where),) * (len(self.runs(rig, where)) if variant == self.each_run else 1)

    def least(self, rig: Rig, where: str) -> float:
        """Smallest physical natural coordinate."""
        return -math.inf

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.full(len(self.scales(rig, where, variant)), self.least(rig, where))

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        name, nominal = self.parameters[0].name, self.nominal(rig, where)
        if variant == self.each_run:
            return {f"{name}@{run}": nominal + float(v) for run, v in zip(self.runs(rig, where), x, strict=True)}
        return {name: nominal + float(x[0])}

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        return np.array(list(values.values())) - self.nominal(rig, where)

    def value(self, run: str, values: Values) -> float:
        """The value (SI) in a run."""
        name = self.parameters[0].name
        return values.get(name, values.get(f"{name}@{run}", 0.0))

    def in_run(self, values: Values, run: str | None = None) -> Values:
        name = self.parameters[0].name
        if self.sensor or name in values:
            return values
        return {name: values.get(f"{name}@{run}", float(np.mean(list(values.values()))))}


def in_each_run(effect: Effect, variant: float) -> bool:
    """Whether an effect has a value of its own for each run."""
    return isinstance(effect, EachRun) and effect.varies and variant == EachRun.each_run


def repeats(effect: Effect, variant: float) -> bool:
    """Whether an effect of the rig differs from run to run."""
    return not effect.sensor and in_each_run(effect, variant)
