"""The seam: what a multibody engine is asked, what it must answer, and which engines there are.

An engine is one object that satisfies :class:`Engine`: built in, ``ENGINE`` in the module ``engine`` of a folder
``sim_models/<name>``, or anybody's, by an entry point of the group ``linkage_crosscheck.engines`` (see
docs/example-engine).  It imports its package only inside methods, so that looking up what is supported costs nothing
and needs nothing.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol, cast, get_args

import numpy as np

from analytic.mechanism import Mechanism
from sim_models.common.silence import silence, uninterrupted

JointModel = Literal["ideal", "massless-link", "spring-damper", "contact"]
Motion = Literal["driven", "static"]
Start = Literal["steady", "centred"]
Pair = tuple[JointModel, Motion]
JOINT_MODELS: tuple[JointModel, ...] = get_args(JointModel)
# What joints can do beside turning and sliding; an engine declares which of it is represented.
IN_JOINTS: frozenset[str] = frozenset({"coulomb_friction", "viscous_friction", "joint_spring"})
ENGINES: tuple[str, ...] = ("mujoco", "exudyn", "pybullet", "dart")  # built in
GROUP = "linkage_crosscheck.engines"  # of the entry points by which other packages offer theirs


class SimulationError(RuntimeError):
    """A run diverged, penetrated more than it should or did not settle; the message says which, where and the
    remedy.
    """


class SimulatorMissing(RuntimeError):
    """The engine's package is not installed, or its installation is broken; the message says which, and what to do."""


class Unsupported(ValueError):
    """The engine does not do what was asked; the message says what it does."""


@dataclass(frozen=True)
class Request:
    """One simulation: a mechanism, a joint model for its joints with clearance, a motion, and where to report.

    ``crank_angle`` (N,) rad is the driven body's angle wherever a report is wanted, in any order; for a free drive it
    is empty and ``time`` (N,) s after release is given instead: it starts at the assembly angles, the driven body at
    ``start_speed`` (rad/s).  With the ``ideal`` joint model clearances are ignored.

    ``start`` says how a driven run begins at its first angle: ``steady`` (no start-up transient: pins in contact,
    velocities to match) or ``centred`` (pins centred, velocities of the ideal linkage). ``course`` replaces the
    constant speed: times (M,) s, strictly increasing, and the motor's angles (M,) rad at them, which the motor follows
    on the cubic spline through them (:meth:`sim_models.common.start.Course.of`); reports are then at ``time`` (N,) s,
    within the course, and ``crank_angle`` is empty.  ``lead_in`` (rad) is how far the crank turns before its first
    angle.  ``step`` (s) replaces the engine's own choice.
    """

    mechanism: Mechanism
    joint_model: JointModel = "ideal"
    motion: Motion = "driven"
    crank_angle: np.ndarray = field(default_factory=lambda: np.zeros(0))
    time: np.ndarray | None = None
    start: Start = "steady"
    lead_in: float = 0.0
    start_speed: float = 0.0
    step: float | None = None
    course: tuple[np.ndarray, np.ndarray] | None = None
    assumed: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Rates:
    """How a body moves at the instants of a trace, ground frame.

    ``velocity`` (m/s) and ``acceleration`` (m/s^2) are (N,) complex, x + iy, of its centre of mass (not of its marker);
    ``angular_acceleration`` (N,) rad/s^2.  Zero in static runs.
    """

    velocity: np.ndarray
    acceleration: np.ndarray
    angular_acceleration: np.ndarray


@dataclass(frozen=True)
class Trace:
    """What a simulation saw, at the requested crank angles (or times) and in their order.

    ``signals`` maps a signal's name to (N,) values, SI units, ground frame: ``<body>_x``, ``<body>_y`` (com),
    ``<body>_angle`` (continued, not wrapped), ``<body>_angular_velocity``, ``reaction_<joint>_x``/``_y`` (N, force of
    the joint's first body on its second) and, for a prismatic joint, ``reaction_<joint>_moment`` (N.m, on the second
    body at its point), ``drive_torque`` (N.m, motor on crank), ``clearance_<joint>_x``/``_y`` (m, first pin centre
    minus second).  All belong to the same instant, and so do ``rates``, which every moving body has in a run of an
    engine's own; recorded data have none.

    ``journal`` maps each joint with clearance to its densely sampled path (M, 2) in m; ``free_share`` to the share of
    time (driven) or of angles (static) that its pin spent off the wall, by its distance
    (:func:`sim_models.common.journal.free_share`). ``settings`` are the numbers used.
    """

    simulator: str
    version: str
    joint_model: JointModel
    motion: Motion
    crank_angle: np.ndarray
    time: np.ndarray | None
    signals: Mapping[str, np.ndarray]
    clearance: Mapping[str, float] = field(default_factory=dict)
    journal: Mapping[str, np.ndarray] = field(default_factory=dict)
    free_share: Mapping[str, float] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    rates: Mapping[str, Rates] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, values in self.signals.items():
            if values.shape != self.crank_angle.shape:
                raise SimulationError(
                    f"{self.simulator}: {name} has {values.shape[0]} samples for {self.crank_angle.size} crank angles"
                )
            if not np.all(np.isfinite(values)):
                k = int(np.argmin(np.isfinite(values)))
                raise SimulationError(
                    f"{self.simulator} {self.joint_model} {self.motion}: {name} is {values[k]} at crank angle "
                    f"{np.degrees(self.crank_angle[k]):.4g} deg: the run diverged; use a smaller step or softer contact"
                )
            values.flags.writeable = False


class Engine(Protocol):
    """What every engine offers.  One that derives from this class need not write what it does not do.

    ``supports`` lists the (joint model, motion) pairs that :meth:`simulate` accepts; ``effects`` names what the engine
    can represent beside rigid bodies, gravity and loads: IN_JOINTS, and a drive that yields (``drive_compliance``).
    ``beams`` lists the pairs that a cross-check asks :meth:`simulate_flexible` for, empty where links do not bend;
    ``exports`` says whether its models can be exported.
    """

    name: str
    package: str  # importable module; of a built-in engine also the name of this project's extra that installs it
    supports: frozenset[Pair]
    effects: frozenset[str] = frozenset()
    beams: frozenset[Pair] = frozenset()
    exports: bool = False

    def simulate(self, request: Request) -> Trace:
        """Run one request.  Raises SimulationError, Unsupported, or analytic's AssemblyError for a bad start."""
        ...

    def simulate_flexible(self, request: Request) -> Trace:
        """Run one request in which bodies with a modulus of elasticity bend.  Raises what :meth:`simulate` does."""
        raise Unsupported(f"simulator {self.name!r} has rigid links only; leave flexible links out")

    def export(self, request: Request, folder: Path) -> list[Path]:
        """Write a request, and what came of it, into a folder as files that run in the bare engine.

        Raises what :meth:`simulate` does.
        """
        raise Unsupported(f"simulator {self.name!r}: its models cannot be exported")


@dataclass(frozen=True)
class Offers:
    """Engines of other packages: their entry points by name, and by name why one is left out, in a sentence."""

    points: Mapping[str, importlib.metadata.EntryPoint]
    refused: Mapping[str, str]


@functools.cache
def offers() -> Offers:
    """What the installed packages offer as engines, none of them imported."""
    points: dict[str, importlib.metadata.EntryPoint] = {}
    refused: dict[str, str] = {}
    for point in importlib.metadata.entry_points(group=GROUP):
        if point.name in ENGINES:
            refused[point.name] = (
                f"simulator {point.name!r} ({point.value}) has the name of a built-in one; rename its entry point"
            )
        elif point.name in points and points[point.name].value != point.value:
            refused[point.name] = f"simulator {point.name!r} is offered by two packages; remove one of them"
        else:
            points[point.name] = point
    return Offers(points, refused)


def engine_names() -> tuple[str, ...]:
    """Names of all engines, installed or not: the built-in ones, then those of other packages."""
    return (*ENGINES, *sorted(offers().points))


def declared(name: str) -> Engine:
    """The engine of that name as it declares itself, its package installed or not.

    Raises Unsupported for an unknown name, SimulatorMissing for an entry point that leads to no engine.
    """
    if name in ENGINES:
        return cast(Engine, importlib.import_module(f"sim_models.{name}.engine").ENGINE)
    point = offers().points.get(name)
    if point is None:
        raise Unsupported(f"simulator {name!r} is unknown; the simulators are {', '.join(engine_names())}")
    left_out = f"simulator {name!r} is left out: its entry point {point.value}"
    try:
        with silence(), uninterrupted():
            found = point.load()
    except Exception as error:  # noqa: BLE001 - somebody else's module raises whatever it likes
        raise SimulatorMissing(
            f"{left_out} cannot be imported ({_in_a_line(error)}); mend it or uninstall it"
        ) from None
    if getattr(found, "name", None) != name or not all(hasattr(found, part) for part in ("supports", "simulate")):
        raise SimulatorMissing(f"{left_out} is no engine of that name with package, supports and simulate")
    return cast(Engine, found)


def engine(name: str) -> Engine:
    """The engine of that name, its package imported.

    Raises Unsupported for an unknown name, SimulatorMissing if it is not installed or cannot be imported.
    """
    found = declared(name)
    extra = f"linkage-crosscheck[{name}]" if name in ENGINES else found.package
    if importlib.util.find_spec(found.package) is None:
        clone = f" (in a clone: pip install '.[{name}]')" if name in ENGINES else ""
        raise SimulatorMissing(f"simulator {name!r} is not installed; run: pip install '{extra}'{clone}")
    fault = broken(found.package)
    if fault:
        raise SimulatorMissing(
            f"simulator {name!r} is installed but cannot be imported ({fault}); mend that, or install it anew: "
            f"pip install --force-reinstall '{extra}'"
        )
    return found


@functools.cache
def broken(package: str) -> str:
    """Why an installed package cannot be imported, in its own words; empty if it can."""
    try:
        with silence(), uninterrupted():
            importlib.import_module(package)
    except Exception as error:  # noqa: BLE001 - a broken installation raises whatever it likes, and the other engines are to go on
        return _in_a_line(error)
    return ""


def _in_a_line(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def installed_version(package: str) -> str | None:
    """Version of an installed package, None if it is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def check_supported(chosen: Engine, request: Request) -> None:
    """Raise Unsupported, naming what the engine does instead, if it cannot run this request."""
    if (request.joint_model, request.motion) not in chosen.supports:
        does = ", ".join(sorted(f"{m} {motion}" for m, motion in chosen.supports))
        raise Unsupported(
            f"{chosen.name} does not simulate {request.joint_model} joints in {request.motion} motion; it does: {does}"
        )
