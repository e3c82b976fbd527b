"""What an effect is: everything that is said of it stands in its own class, in one file of this folder.

A class has the effect's name, the kind of place where it can be, its words and parameters, what an engine must be able
to do to simulate it, the pure functions on the mechanism or on the readings of its sensors, and how the scoreboard
draws one.  ``values`` are the parameters as reported (SI); a search moves in *natural* coordinates x instead, in which
zero is "no effect" and the signals answer nearly linearly (1/E instead of E, say).

To add an effect, write its class and put it into the list ``EFFECTS`` at the end of the file.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.reach import usual_angles
from analytic.kinematics.schedule import Turning
from analytic.kinematics.structure import StructureError
from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal, named
from sim_models.engine import Engine

LANDING = "landing"  # beside the signals of a run: at which samples (N,) bool a crank lands in the gap of its drive
Place = Literal["linkage", "body", "ground point", "joint", "drive", "signal", "run"]
Values = Mapping[str, float]
Readings = Mapping[str, np.ndarray]


def landing_in(signal: str) -> str:
    """Beside the readings of a run: at which samples (N,) bool a landing shows in a signal, which may be late."""
    return f"{LANDING} in {signal}"


SAME_PHASE = math.sqrt(1 - 0.1**2)  # correlation of two waves, from which a tenth of one is left beside the other
STOPS = 73  # of a slide's travel, at which one looks where the joints are
ROCKS = 6.0  # rad: a joint whose angle changes by more in a turn of the crank turns around


@dataclass(frozen=True)
class Parameter:
    """A parameter as reported.

    ``unit`` is SI, empty for the unit of the signal where the effect is; ``quantity`` is what kind it is, for
    ``tolerance``; ``lowest`` is its smallest physical value.  A ``discrete`` one has whole values only, and values of a
    ``circular`` one that are a turn (rad) apart are the same.  People read a ``percent`` one in %.  ``more`` and
    ``less`` follow the size of a positive and of a negative value: ``longer than drawn``.
    """

    name: str
    unit: str
    quantity: str
    lowest: float = -math.inf
    discrete: bool = False
    circular: bool = False
    percent: bool = False
    more: str = ""
    less: str = ""


@dataclass(frozen=True)
class Rig:
    """What an effect needs to know of the rig to say where it can be and what would be a small amount of it."""

    mechanism: Mechanism  # nominal
    signals: tuple[str, ...]  # measured
    runs: tuple[str, ...]
    driven: tuple[str, ...]  # runs in which a motor follows a command
    following: tuple[str, ...] = ()  # runs that follow the measured crank angle
    length: float = 1.0  # m: the longest link; of what a slide moves, its travel
    force: float = 1.0  # N: the largest of weight, inertia force at the fastest speed, and loads
    speed: float = 1.0  # rad/s: the fastest run; of a slide the rate (1/s) at which it covers its travel
    noise: Mapping[str, float] = field(default_factory=dict)  # 1-sigma by signal
    recorded: Mapping[str, Sequence[str]] = field(default_factory=dict)  # signals by run, where not all are in all
    postures: Sequence[np.ndarray] = ()  # (k, STOPS) rad, m each: where the drives are in a run, of no crank
    timed: bool = False  # whether a run has a load over time: what comes back with each turn, not all that it does
    turned: Sequence[np.ndarray] = ()  # (N,) rad: where the crank is at the samples of a driven run, of each

    def told(self, harmonics: Iterable[int]) -> list[float]:
        """The harmonics of the crank's turn that the samples of some run tell from all lower ones: of one that is
        sampled less than twice a period, which comes back at the same phases, they see another, or a constant.
        """
        return [float(h) for h in harmonics if not self.turned or any(_told(h, theta) for theta in self.turned)]

    @cached_property
    def encoders(self) -> tuple[str, ...]:
        """The motors' encoders: of a crank's angle, or a slide's travel, or each driven joint's position."""
        return tuple(signal.name for signal in self.mechanism.encoders)

    @property
    def encoder(self) -> str:
        """The first of them."""
        return self.encoders[0]

    @property
    def turning(self) -> Sequence[str]:
        """The driven runs, if a crank is turned in them: none of a slide or of several drives."""
        return self.driven if self.mechanism.cranked else ()

    @property
    def repeating(self) -> Sequence[str]:
        """The driven runs of a crank, if each turn of all of them is as the one before."""
        return () if self.timed else self.turning

    @cached_property
    def known(self) -> Mapping[str, Signal]:
        """Every signal that the linkage can have, by name."""
        return named(self.mechanism.bodies, self.mechanism.joints, self.mechanism.drives, self.mechanism.sensors)

    @property
    def torque(self) -> float:
        """A torque (N.m) typical of the rig."""
        return self.force * self.length

    @cached_property
    def travels(self) -> Mapping[str, tuple[float, float]]:
        """Least and largest angle (rad; of a prismatic joint travel, m) of each joint that rocks or slides, over a turn
        of the crank as far as it can turn, or over what a slide or several drives do; none where the linkage cannot be
        moved.
        """
        m, found = self.mechanism, {}
        try:
            assembly = Assembly(m)
            inputs = self.postures or (usual_angles(assembly),)
            motions = [kinematics(assembly, each) for each in inputs]
        except (AssemblyError, StructureError):
            return {}
        for joint in m.joints:
            moved = np.concatenate([motion.relative(joint) for motion in motions])
            low, high = float(moved.min()), float(moved.max())
            if 0 < high - low < ROCKS:
                found[joint.name] = low, high
        return found


@dataclass(frozen=True)
class Draw:
    """What a random size of an effect is drawn with.

    ``turn`` (rad) is a random direction in the plane and ``sign`` 1 or -1; ``speeds`` (rad/s) are those of the runs, by
    name; ``motion`` gives every signal (N,) of the first run, of the nominal linkage.
    """

    rng: np.random.Generator
    turn: float
    sign: float
    speeds: Mapping[str, float]
    motion: Callable[[], Mapping[str, np.ndarray]]

    @property
    def direction(self) -> tuple[float, float]:
        """Components x and y of a unit vector in the random direction."""
        return math.cos(self.turn), math.sin(self.turn)


@dataclass(frozen=True)
class Growth:
    """Reported values as a function of one number: no effect at 0, a signature about linear in it, physical up to
    ``most``; no machine has less than ``least``.
    """

    values: Callable[[float], Values]
    most: float
    variant: float = 0.0
    least: float = 0.0


@dataclass(frozen=True)
class Hiding:
    """What a hidden set of the scoreboard must be like to have the effect.

    ``sensors`` are kinds of sensor that it needs (``encoder``, ``cell``); ``cases`` the shipped linkages that it is
    drawn on (None: any); ``commanded``, that no run follows its encoder; ``in_contact``, that the runs are slow enough
    for the pin of its joint to keep touching its bearing.  A set has at most one ``exclusive`` effect.
    ``makers`` are the engines that make data with it and how often each is drawn (None: any).  Links that bend
    ``need_beams``, and beams know the effects that go ``with_beams``, and all those of sensors.  ``sets`` is the kind
    of set that hides it: ``effects``, or ``machines``, of real ones (those of ``effects`` may be beside it); None where
    only the bench has it.
    """

    sensors: tuple[str, ...] = ()
    cases: tuple[str, ...] | None = None
    commanded: bool = False
    in_contact: bool = False
    exclusive: bool = False
    makers: Mapping[str, float] | None = None
    need_beams: bool = False
    with_beams: bool = False
    sets: Literal["effects", "machines"] | None = "effects"


def _told(harmonic: int, theta: np.ndarray) -> bool:
    """Whether samples at angles (N,) rad tell a harmonic from all lower ones.  Two harmonics are the same to them that
    differ, or add up, to one whose phase is always the same.
    """
    a_turn = 2 * math.pi / max(float(np.median(np.abs(np.diff(theta)))), 1e-300)
    others = np.arange(math.ceil(a_turn - 1), 2 * harmonic + 1)
    return not any(abs(np.exp(1j * n * theta).mean()) > SAME_PHASE for n in others)


class Effect(ABC):
    """A missing effect.  Subclasses say all that there is to say of it; everything it does is pure.

    ``label`` is what it is called and ``meaning`` what it means, each with ``{}`` for the place; ``found`` says it with
    its values, which have a ``{}`` after the place's (left out: they follow the meaning); ``special_case_of`` are
    richer effects, which must earn their further parameter against this one; ``needs`` the joint models and features
    that an engine must declare in motion to simulate it in full (:attr:`sim_models.engine.Capabilities.in_motion`).
    """

    name: ClassVar[str]
    place: ClassVar[Place] = "linkage"  # the kind of place where it can be
    label: ClassVar[str] = ""
    meaning: ClassVar[str] = ""
    found: ClassVar[str] = ""
    parameters: ClassVar[tuple[Parameter, ...]]
    special_case_of: ClassVar[tuple[str, ...]] = ()
    sensor: ClassVar[bool] = False  # of the measurement, not of the mechanism
    needs: ClassVar[frozenset[str]] = frozenset()
    leaps: ClassVar[bool] = False  # single samples leap as its values move: fits of it end where only leaps are left
    scatters: ClassVar[bool] = (
        False  # all that it does is scatter: no more than noise where the gap is closed without it
    )
    asked_for: ClassVar[bool] = False  # looked for only where it is asked for by its name
    # how many of its first natural coordinates say how much there is of it, where the others say how or where it is
    sized: ClassVar[int | None] = None
    limited: ClassVar[bool] = False  # its bounds are where no machine is: data that want more want something else
    hiding: ClassVar[Hiding] = Hiding()

    # ---------------------------------------------------------------- in words

    @classmethod
    def called(cls, where: str) -> str:
        """The effect at its place as a noun: ``clearance in joint B``."""
        return (cls.label or cls._plain()).format(where)

    @classmethod
    def says(cls, where: str) -> str:
        """What the effect at a place means: ``joint B has clearance``."""
        return (cls.meaning or cls._plain()).format(where)

    @classmethod
    def tells(cls, where: str, values: Sequence[str]) -> str:
        """The effect at a place with its values in words: ``the crank is 0.3 mm longer than drawn``."""
        if not cls.found:
            return f"{cls.says(where)}: {'; '.join(values)}"
        return cls.found.format(where, " and ".join(values))

    def sense(self, mechanism: Mechanism, where: str) -> int:
        """1 where a positive value is ``more`` of it, as nearly everywhere, else -1."""
        return 1

    @classmethod
    def _plain(cls) -> str:
        return f"{cls.name.replace('_', ' ')} at {{}}"

    # ---------------------------------------------------------------- who simulates it

    def simulated_by(self, engine: Engine) -> bool:
        """Whether an engine can simulate the effect in full; what sensors do is added to any engine's readings."""
        return self.needs <= engine.capabilities.in_motion

    # ---------------------------------------------------------------- where, and in which coordinates

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

    def combined(self, answers: np.ndarray) -> np.ndarray:
        """What the data see of independent amounts of the effect (size, k), from their answers to its probes."""
        return answers

    def amounts(self, rig: Rig, where: str, size: np.ndarray, variant: float = 0.0) -> np.ndarray:
        """How large (k,) these amounts are, in the probes' own, where natural coordinates are of a size (n,)."""
        main, each = self._main(rig, where, size, variant)
        return np.asarray(size[main] / each)

    def never_negative(self, rig: Rig, where: str, low: np.ndarray, variant: float = 0.0) -> np.ndarray:
        """Which of these amounts (k,) cannot be negative, where natural coordinates have these bounds (n,)."""
        main, _ = self._main(rig, where, np.asarray(self.scales(rig, where, variant), float), variant)
        alone = np.count_nonzero(self.probes(rig, where, variant), axis=1).max() == 1
        return np.asarray((low[main] >= 0) & alone)

    def from_amounts(self, rig: Rig, where: str, amounts: np.ndarray, variant: float = 0.0) -> np.ndarray:
        """Natural coordinates (n,) of so much (k,) of each of these amounts."""
        return self.start(rig, where, amounts, variant)

    def _main(self, rig: Rig, where: str, size: np.ndarray, variant: float) -> tuple[np.ndarray, np.ndarray]:
        """The natural coordinate that each probe (k,) is mostly of, and how much of it."""
        probes = self.probes(rig, where, variant)
        main = np.abs(probes / size).argmax(axis=1)
        return main, np.abs(probes[np.arange(len(probes)), main])

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

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        """Natural coordinates (n,) of reported values: the inverse of :meth:`values`."""
        return np.array([values[p.name] for p in self.parameters])

    def acts_by_itself(self, variant: float) -> bool:
        """Whether a variant does something even where all natural coordinates are zero, as a quarter turn does."""
        return False

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        """Smallest physical natural coordinates, (n,)."""
        return np.array([p.lowest for p in self.parameters])

    def highest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        """Largest physical natural coordinates, (n,)."""
        return np.full(len(self.scales(rig, where, variant)), math.inf)

    def impossible(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> bool:
        """Whether natural coordinates (n,) lie where no machine is: a body without inertia, one that is another."""
        beyond = (x <= self.lowest(rig, where, variant)) | (x >= self.highest(rig, where, variant))
        return self.limited and bool(np.any(beyond & (x != 0)))

    # ---------------------------------------------------------------- tolerances

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

    # ---------------------------------------------------------------- what it does

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        """The mechanism with the effect."""
        return mechanism

    def in_run(self, values: Values, run: str | None = None) -> Values:
        """Its values for the mechanism of a run, where it may have another in each: of a run without one, the mean."""
        return values

    def on_readings(self, readings: Readings, run: str, where: str, values: Values) -> Readings:
        """The sensors' readings (N,) by signal, with the effect."""
        return readings

    def delay(self, run: str, signal: str, where: str, values: Values) -> float:
        """Seconds by which a signal's readings are older than their time stamps."""
        return 0.0

    def lag(self, run: str, signal: str, where: str, values: Values) -> float:
        """Time constant (s) of a first-order filter behind which a signal is read."""
        return 0.0

    def drift(self, run: str, signal: str, where: str, values: Values) -> float:
        """Rate (the signal's unit/s) at which its readings creep away from the run's first sample."""
        return 0.0

    def motor(self, run: str, read: Turning, values: Values) -> Turning:
        """How the motor turns whose encoder reads this, in a run that follows it."""
        return read

    def extends(self, simple: Effect) -> bool:
        """Whether this is another effect with parameters more, which has to earn them: at nothing it is the other."""
        own, others = ({p.name for p in each.parameters} for each in (self, simple))
        return self.name in simple.special_case_of and others < own

    @property
    def misreads(self) -> bool:
        """Whether it says so."""
        return type(self).motor is not Effect.motor

    @property
    def mounts(self) -> bool:
        """Whether it changes the mechanism: its links, or how a sensor of its file is mounted."""
        return type(self).on_mechanism is not Effect.on_mechanism

    def behind(self, motor: Turning, values: Values) -> Turning | None:
        """How far (rad) the crank is behind a motor, with its rates, at the motor's angles; None where it is not."""
        return None

    def jitter(self, run: str, values: Values) -> float:
        """Root mean square error (s) of the time stamps of a run that follows the encoder."""
        return 0.0

    # ---------------------------------------------------------------- a random one

    def growth(self, rig: Rig, where: str, draw: Draw) -> Growth:
        """A random way for the effect to grow from nothing at a place, for the scoreboard."""
        raise NotImplementedError(f"{self.name}: Effect.growth has to say how one is drawn for the scoreboard")


class Reciprocal(Effect):
    """Effects of a compliance whose reported value is its reciprocal, a stiffness or modulus."""

    def blames(self, parameter: str) -> bool:
        return False

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.zeros(1)

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {self.parameters[0].name: 1.0 / max(float(x[0]), 1e-9 * self.scales(rig, where)[0])}

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        return 1 / super().natural(rig, where, values, variant)


class Wave(Effect):
    """Effects that go with an angle, amplitude sin(harmonic angle + phase).  Natural: a cos p, a sin p."""

    def measured_by(self, i: int) -> Parameter:
        return self.parameters[0]

    def lowest(self, rig: Rig, where: str, variant: float = 0.0) -> np.ndarray:
        return np.array([-math.inf, -math.inf])

    def values(self, rig: Rig, where: str, x: np.ndarray, variant: float = 0.0) -> dict[str, float]:
        return {"amplitude": math.hypot(x[0], x[1]), "harmonic": variant, "phase": math.atan2(x[1], x[0])}

    def natural(self, rig: Rig, where: str, values: Values, variant: float = 0.0) -> np.ndarray:
        return values["amplitude"] * np.array([math.cos(values["phase"]), math.sin(values["phase"])])
