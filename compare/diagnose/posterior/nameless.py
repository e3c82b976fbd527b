"""What has no name: an unknown at a place as one group among the effects, so that no pile of effects stands for it.

Over a turn of the crank, in the time of a run and from run to run it may be anything: waves of the crank's angle and of
time, the longer the larger, with a level and a slope in every run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from compare.diagnose.propose.places import EFFECTS, Place
from compare.diagnose.propose.scene import Scene

WAVES = 12  # of a turn: the twelfth is as short as what a proposal's curve can show
# natural size (1 sigma) of its first wave, in the small amounts that each unknown itself states (``scales``)
NATURAL: Mapping[str, float] = {
    "torque": 100.0,  # a tenth of the torques that the rig carries
    "give": 10.0,  # 0.2 % of the longest link
    "length": 100.0,  # 0.1 % of it
    "bend": 100.0,
    "lag": 1000.0,  # 0.01 rad
}


@dataclass(frozen=True)
class Nameless:
    """An unknown at a place: what each of its waves, as large as it naturally is, does to readings (size, k) over their
    noise.
    """

    unknown: str
    where: str
    columns: np.ndarray = field(repr=False)

    @property
    def key(self) -> tuple[str, str]:
        """As effects have one."""
        return f"unknown_{self.unknown}", self.where


def nameless(scene: Scene) -> Iterator[Nameless]:
    """Every unknown that these data would show, beside what is named; not of a sensor, whose faults have names."""
    waves = None
    for place in scene.places():
        if place.unknown in NATURAL:
            waves = _waves(scene) if waves is None else waves
            size = NATURAL[place.unknown] * _scale(scene, place)
            yield Nameless(place.unknown, place.where, place.answers[:, None] * waves * size)


def _scale(scene: Scene, place: Place) -> float:
    return float(EFFECTS[place.unknown].scales(scene.rig, place.where)[0])


def _waves(scene: Scene) -> np.ndarray:
    """All waves (size, k) at all samples, the first of size 1."""
    runs, driven = scene.data.measured.runs, scene.rig.mechanism.driven
    angle = scene.spread(lambda signals: signals[f"{driven}_angle"])

    def samples(of: Callable[[int], np.ndarray]) -> np.ndarray:
        return np.concatenate([of(part.run)[part.used] for part in scene.data.parts])

    passed = samples(lambda run: (runs[run].time - runs[run].time[0]) / (runs[run].time[-1] - runs[run].time[0]))
    turns = [wave(k * angle) / k for k in range(1, WAVES + 1) for wave in (np.cos, np.sin)]
    slow = [wave(2 * np.pi * passed) for wave in (np.cos, np.sin)]
    run = samples(lambda run: np.full(runs[run].time.size, run))
    each = [(run == r) * line for r in range(len(runs)) for line in (1.0, 2 * passed - 1)]
    return np.column_stack([*turns, *slow, *each])
