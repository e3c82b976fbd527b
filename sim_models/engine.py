"""The seam: what a multibody engine is asked, what it must answer, and which engines there are.

An engine is a folder ``sim_models/<name>`` whose module ``engine`` has one object ``ENGINE`` that satisfies
:class:`Engine`.  It imports its package only inside methods, so that looking up what is supported costs nothing and
needs nothing.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol, cast, get_args

import numpy as np

from analytic.mechanism import Mechanism
from sim_models.common.silence import silence, uninterrupted

JointModel = Literal["ideal", "massless-link", "spring-damper", "contact"]
Motion = Literal["driven", "static"]
Start = Literal["steady", "centred"]
JOINT_MODELS: tuple[JointModel, ...] = get_args(JointModel)
# What the effects of the project's vocabulary need of an engine.  These are fields of the mechanism that every engine
# must honour; the others an engine declares for itself.
COMMON_EFFECTS: frozenset[str] = frozenset(
    {
        "gravity", "payload", "com_offset", "moment_of_inertia", "link_length", "pivot_position", "joint_clearance",
        "coulomb_friction", "viscous_friction", "joint_spring", "external_force", "load_torque",
    }
)  # fmt: skip
ENGINES: tuple[str, ...] = ("mujoco", "exudyn", "pybullet", "dart")


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
    """What every engine offers.

    ``supports`` lists the (joint model, motion) pairs that :meth:`simulate` accepts; ``effects`` names what the engine
    can represent beside ideal links and joints: COMMON_EFFECTS, and for instance ``drive_compliance`` or
    ``link_flexibility``.
    """

    name: str
    package: str  # importable module; also the name of this project's extra that installs it
    supports: frozenset[tuple[JointModel, Motion]]
    effects: frozenset[str]

    def simulate(self, request: Request) -> Trace:
        """Run one request.  Raises SimulationError, Unsupported, or analytic's AssemblyError for a bad start."""
        ...


def engine(name: str) -> Engine:
    """The engine of that name, its package imported.

    Raises Unsupported for an unknown name, SimulatorMissing if it is not installed or cannot be imported.
    """
    if name not in ENGINES:
        raise Unsupported(f"simulator {name!r} is unknown; the simulators are {', '.join(ENGINES)}")
    found = declared(name)
    if importlib.util.find_spec(found.package) is None:
        raise SimulatorMissing(
            f"simulator {name!r} is not installed; run: pip install 'linkage-crosscheck[{name}]' (in a clone: pip"
            f" install '.[{name}]')"
        )
    fault = broken(found.package)
    if fault:
        raise SimulatorMissing(
            f"simulator {name!r} is installed but cannot be imported ({fault}); mend that, or install it anew: "
            f"pip install --force-reinstall 'linkage-crosscheck[{name}]'"
        )
    return found


@functools.cache
def broken(package: str) -> str:
    """Why an installed package cannot be imported, in its own words; empty if it can."""
    try:
        with silence(), uninterrupted():
            importlib.import_module(package)
    except Exception as error:  # noqa: BLE001 - a broken installation raises whatever it likes, and the other engines are to go on
        return " ".join(f"{type(error).__name__}: {error}".split())
    return ""


def engine_names() -> tuple[str, ...]:
    """Names of the engines that there are, installed or not."""
    return ENGINES


def declared(name: str) -> Engine:
    """The engine's declaration, installed or not."""
    return cast(Engine, importlib.import_module(f"sim_models.{name}.engine").ENGINE)


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
