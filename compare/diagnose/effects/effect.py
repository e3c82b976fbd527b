"""What an effect is: a name, places, parameters, and pure functions on the mechanism or on the readings of its sensors.

``values`` are the parameters as reported (SI); a search moves in *natural* coordinates x instead, in which zero is "no
effect" and the signals answer nearly linearly (1/E instead of E, say).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from analytic.mechanism import Mechanism

Values = Mapping[str, float]
Readings = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Parameter:
    """A parameter as reported: its unit, what kind of quantity it is (for ``tolerance``), and its smallest physical
    value.
    """

    name: str
    unit: str
    quantity: str
    lowest: float = -math.inf


@dataclass(frozen=True)
class Rig:
    """What an effect needs to know of the rig to say where it can be and what would be a small amount of it."""

    mechanism: Mechanism  # nominal
    signals: tuple[str, ...]  # measured
    runs: tuple[str, ...]
    driven: tuple[str, ...]  # runs in which a motor follows a command
    following: tuple[str, ...] = ()  # runs that follow the measured crank angle
    length: float = 1.0  # m: the longest link
    force: float = 1.0  # N: the largest of weight, inertia force at the fastest speed, and loads
    speed: float = 1.0  # rad/s: the fastest run
    noise: Mapping[str, float] = field(default_factory=dict)  # 1-sigma by signal

    @property
    def encoder(self) -> str:
        """The motor's encoder."""
        return f"{self.mechanism.driven}_angle"

    @property
    def torque(self) -> float:
        """A torque (N.m) typical of the rig."""
        return self.force * self.length


class Effect(ABC):
    """A missing effect.  Subclasses say what it does; everything it does is pure."""

    name: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    special_case_of: ClassVar[
        tuple[str, ...]
    ] = ()  # richer effects that must earn their extra parameter against this one
    sensor: ClassVar[bool] = False  # of the measurement, not of the mechanism
    needs_engine: ClassVar[bool] = (
        False  # only engines that declare it have it; the others are fields that each must honour
    )
    slow: ClassVar[bool] = (
        False  # costs the analytic model many times what the others do, and changes their signatures little
    )

    @abstractmethod
    def places(self, rig: Rig) -> Sequence[str]:
        """Where it can be."""

    @abstractmethod
    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        """A small amount of each natural coordinate."""

    def variants(self, rig: Rig, where: str) -> Sequence[float]:
        """Discrete choices that come before the coordinates (a harmonic, a quarter turn); one of them is enough for
        most.
        """
        return (0.0,)

    def probes(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        """(k, n) natural coordinates whose predictions, less the nominal's, span what this effect can do when small."""
        return np.diag(self.scales(rig, where, variant))

    def start(self, rig: Rig, where: str, coefficients: np.ndarray, variant: float = 0.0) -> np.ndarray:
        """Natural coordinates (n,) to start a fit from, given how much (k,) of each probe the data want."""
        return coefficients @ self.probes(rig, where, variant)

    def other_start(self, rig: Rig, where: str, x: np.ndarray) -> np.ndarray | None:
        """Another start beside x, for effects whose coordinates do not answer linearly."""
        return None

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        """SI unit of a reported parameter at a place; one of a single run is called ``offset@run``."""
        return next(p.unit for p in self.parameters if p.name == parameter.partition("@")[0])

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        """Reported values of natural coordinates."""
        return {p.name: float(v) for p, v in zip(self.parameters, x, strict=True)}

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        """Smallest physical natural coordinates, (n,)."""
        return np.array([p.lowest for p in self.parameters])

    def measured_by(self, i: int) -> Parameter:
        """The reported parameter whose tolerance bounds the i-th natural coordinate."""
        return self.parameters[min(i, len(self.parameters) - 1)]

    def middle(self, variant: float) -> float:
        """The reported parameter where the natural coordinate of a variant is zero, if a tolerance bounds it."""
        return 0.0

    def blames(self, parameter: str) -> bool:
        """Whether a tolerance on a parameter bounds its natural coordinate: where that is how far the parameter
        is off.
        """
        return True

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        """The mechanism with the effect."""
        return mechanism

    def on_readings(self, readings: Readings, run: str, where: str, values: Values) -> Readings:
        """The sensors' readings (N,) by signal, with the effect."""
        return readings

    def delay(self, run: str, signal: str, where: str, values: Values) -> float:
        """Seconds by which a signal's readings are older than their time stamps."""
        return 0.0


class Reciprocal(Effect):
    """Effects of a compliance whose reported value is its reciprocal, a stiffness or modulus."""

    def blames(self, parameter: str) -> bool:
        return False

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.zeros(1)

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {self.parameters[0].name: 1.0 / max(float(x[0]), 1e-9 * self.scales(rig, where)[0])}
