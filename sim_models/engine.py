"""The seam: what a multibody engine is asked, what it must answer, and which engines there are.

An engine is one object that satisfies :class:`Engine`: built in, ``ENGINE`` in the module ``engine`` of a folder
``sim_models/<name>``; anybody's, by an entry point of the group ``linkage_crosscheck.engines`` (see
docs/example-engine); or made of somebody's model file, by a name such as ``fmu:linkage.fmu``.  It imports its package
only inside methods, so that looking up what is supported costs nothing and needs nothing.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import importlib.util
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Literal, Protocol, cast, get_args

import numpy as np

from analytic.errors import Error
from analytic.kinematics.schedule import Course, DriveMotion, Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from sim_models.common.silence import silence, uninterrupted

JointModel = Literal["ideal", "massless-link", "spring-damper", "contact"]
Motion = Literal["driven", "static"]
Start = Literal["steady", "centred"]
Feature = Literal[
    "prismatic", "coulomb_friction", "stribeck_friction", "load_friction", "guide_friction", "viscous_friction", "drag",
    "joint_spring", "nonlinear_spring", "contact_friction", "drive_compliance", "backlash", "periodic_torque",
    "soft_bearing", "course", "released", "several_drives", "point_spring",
    "contact_law", "guide_clearance", "varying_load", "stop",
]  # fmt: skip
Pair = tuple[JointModel, Motion]
SettingValue = str | bool | int | float | None | Mapping[str, float]
JOINT_MODELS: tuple[JointModel, ...] = get_args(JointModel)
MOTIONS: tuple[Motion, ...] = get_args(Motion)
FEATURES: tuple[Feature, ...] = get_args(Feature)
IN_WORDS: Mapping[Feature, str] = {
    "prismatic": "prismatic joints",
    "coulomb_friction": "Coulomb friction of joints",
    "stribeck_friction": "Stribeck friction of joints",
    "load_friction": "friction of joints that grows with their reactions",
    "guide_friction": "friction of blocks without clearance in their guides",
    "viscous_friction": "dampers in joints",
    "drag": "drag in joints",
    "joint_spring": "springs in joints",
    "nonlinear_spring": "springs in joints that are not linear",
    "contact_friction": "friction in contact",
    "drive_compliance": "drives that yield",
    "backlash": "drives with backlash",
    "periodic_torque": "torques over the crank angle",
    "soft_bearing": "soft bearings",
    "course": "courses of a motor",
    "released": "released linkages",
    "several_drives": "motions of several freedoms, or of drives that turn no crank",
    "point_spring": "springs between points",
    "contact_law": "contact laws by name",
    "guide_clearance": "clearance in prismatic joints",
    "varying_load": "loads that vary over the motion",
    "stop": "stops of joints",
}
MOVING: frozenset[Feature] = frozenset(
    {"viscous_friction", "drag", "course", "released", "contact_law"}
)  # only what moves has them
TOUCHING: Mapping[Feature, frozenset[JointModel]] = {
    "contact_friction": frozenset({"contact"}),
    "contact_law": frozenset({"contact", "spring-damper"}),
    "guide_clearance": frozenset({"contact", "spring-damper"}),
}  # only these joint models have them
ENGINES: tuple[str, ...] = ("mujoco", "exudyn", "pybullet", "dart")  # built in
# Engines that are somebody's own model: ``mjcf:linkage.xml`` is opened by the module behind the scheme, which has the
# PACKAGE that it needs and ``opened(what)``, an Engine of that whole name.
SCHEMES: Mapping[str, str] = {"mjcf": "sim_models.mjcf.engine", "fmu": "sim_models.fmu.engine"}
MAPPED: tuple[str, ...] = ("fmu",)  # schemes whose files want a map
SEPARATOR = "::"  # in such a name, between the model file and its map
ENDINGS: Mapping[str, str] = {"mjcf": ".xml", "fmu": ".fmu"}  # of their files
EXTRAS: Mapping[str, str] = {"fmpy": "fmu"}  # that install a package, where it is not of its name
GROUP = "linkage_crosscheck.engines"  # of the entry points by which other packages offer theirs


class Cause(StrEnum):
    """Why there is no result, by name in files; ``words`` say it without a run's numbers, ``remedy`` what may help."""

    DIVERGED = "diverged"
    CAME_APART = "came apart"
    TOO_DEEP = "too deep"
    TOO_SOFT = "too soft"
    UNPRESSED = "unpressed"
    NO_EQUILIBRIUM = "no equilibrium"
    PULLED = "pulled"
    NO_START = "no start"
    TOO_MANY_STEPS = "too many steps"
    OFF_COURSE = "off course"
    RESONANCE = "resonance"
    IMPLAUSIBLE = "implausible"
    NOT_CONVERGED = "not converged"
    OVERFLOW = "overflow"
    FAULTY = "faulty"
    UNSUPPORTED = "unsupported"

    @property
    def words(self) -> str:
        """What happened, in words."""
        return _CAUSES[self][0]

    @property
    def remedies(self) -> tuple[str, ...]:
        """What may help, each by itself, in words."""
        return _CAUSES[self][1:]

    @property
    def remedy(self) -> str:
        """All that may help, in words."""
        return helpful(self.remedies)


SMALLER_STEP, CENTRED, AT_REST = "use a smaller step", "start it centred", "use --motion static"
ELSEWHERE = "leave the angle out"
NEEDS = {
    SMALLER_STEP: "step",
    CENTRED: "start",
    AT_REST: "motion",
    ELSEWHERE: "angles",
}  # a remedy that not all who ask for a run can take


def helpful(remedies: Iterable[str], offers: Collection[str] | None = None) -> str:
    """Remedies in words: those for which ``offers``, the names of what may be asked, have what they need; None: all."""
    return ", or ".join(each for each in remedies if offers is None or NEEDS.get(each) in (None, *offers))


_CAUSES: Mapping[Cause, tuple[str, ...]] = {
    Cause.DIVERGED: (
        "the run diverged",
        SMALLER_STEP,
        "give it a softer or more damped contact or a slower drive",
        "use another simulator",
    ),
    Cause.CAME_APART: (
        "joints came apart",
        SMALLER_STEP,
        "give smaller loads or a slower drive",
        "use another simulator",
    ),
    Cause.TOO_DEEP: ("a pin went too deep into its bearing", SMALLER_STEP, "give it a stiffer contact"),
    Cause.TOO_SOFT: ("contact is too soft for the load", "give a larger contact_stiffness (N/m), or a smaller load"),
    Cause.UNPRESSED: ("nothing presses a pin", "give the linkage a load or gravity", ELSEWHERE, CENTRED),
    Cause.NO_EQUILIBRIUM: ("no equilibrium was found", ELSEWHERE, "check the loads, or use a smaller clearance"),
    Cause.PULLED: ("in the only equilibrium found a pin is pulled, not pressed", ELSEWHERE, "check the loads"),
    Cause.NO_START: (
        "the run could not be started or held",
        "use a smaller clearance or a stiffer contact, or keep clear of where the linkage locks",
    ),
    Cause.TOO_MANY_STEPS: (
        "it would take more steps than an engine is let take",
        "ask for less, change drive.speed, use a larger clearance or a softer contact",
        AT_REST,
    ),
    Cause.OFF_COURSE: ("the crank left its course", SMALLER_STEP, "give a slower drive", "use another simulator"),
    Cause.RESONANCE: (
        "the crank has no steady motion on its drive",
        "it is near a resonance: give a stiffer drive or a slower one",
    ),
    Cause.IMPLAUSIBLE: (
        "it breaks what must be true of every run",
        "this run is no evidence: use another simulator",
    ),
    Cause.NOT_CONVERGED: ("finer runs still change, or fail", "use another simulator"),
    Cause.OVERFLOW: ("numbers too large or too small to compute with", "check masses, lengths, loads and drive.speed"),
    Cause.FAULTY: ("the engine did not answer as it should", "install it anew, or use another simulator"),
    Cause.UNSUPPORTED: ("the engine does not do it", "use another simulator"),
}


class SimulationError(Error, RuntimeError):
    """A simulation has no result: ``what`` happened and where, the ``cause`` if it is known, and the remedy.

    ``remedy`` is this failure's own, or several of which each may help; left out, it is its cause's.  A ``note`` ends
    the message.
    """

    def __init__(
        self, what: str, cause: Cause | None = None, remedy: str | tuple[str, ...] = "", note: str = ""
    ) -> None:
        super().__init__(what, cause, remedy, note)
        self.what, self.cause, self.note = what, cause, note
        own = (remedy,) if isinstance(remedy, str) else remedy
        self.remedies = own if any(own) else () if cause is None else cause.remedies

    @property
    def remedy(self) -> str:
        """All that may help, in words; empty where nothing is known to."""
        return helpful(self.remedies)

    def __str__(self) -> str:
        return self.said()

    def said(self, offers: Collection[str] | None = None) -> str:
        """The message for somebody who may ask for what is named in ``offers``; None is one who makes a Request."""
        remedy = helpful(self.remedies, offers)
        said = f"{self.what}; {remedy}" if remedy else self.what
        return f"{said} {self.note}" if self.note else said


class SimulatorMissing(Error, RuntimeError):
    """The engine's package is not installed, or its installation is broken; the message says which, and what to do."""


class Unsupported(Error, ValueError):
    """The engine does not do what was asked; the message says what it does."""

    cause = Cause.UNSUPPORTED


@dataclass(frozen=True)
class Request:
    """One simulation: a mechanism, a joint model for its joints with clearance, and a schedule: how it is moved and
    where to report.  With the ``ideal`` joint model clearances are ignored.

    ``start`` says how a driven run begins at its first instant: ``steady`` (no start-up transient: pins in contact,
    velocities to match) or ``centred`` (pins centred, velocities of the ideal linkage; no massless link can be).
    Of a crank that turns evenly ``lead_in`` (rad) is how far it turns before its first angle, ``beyond`` (rad) how far
    it turns after its last one, and ``watched`` asks for every step from the first angle on (:class:`Watched`).
    ``step`` (s) replaces the engine's own choice.  ``assumed`` names the joints whose contact stiffness is the
    project's default.
    """

    mechanism: Mechanism
    joint_model: JointModel = "ideal"
    schedule: Schedule = field(default_factory=Schedule)
    start: Start = "steady"
    lead_in: float = 0.0
    step: float | None = None
    assumed: frozenset[str] = frozenset()
    beyond: float = 0.0
    watched: bool = False

    @property
    def motion(self) -> Motion:
        """Whether the linkage moves, or rests."""
        return self.schedule.motion

    @property
    def motor(self) -> DriveMotion | None:
        """How the motor of a crank has its angle (rad) go on, from its lead-in on; None at rest, and where it is let
        go.
        """
        if self.schedule.at_rest or self.schedule.lets_go:
            return None
        motor = self.schedule.crank_motion(self.mechanism)
        return motor if isinstance(motor, Course) else replace(motor, begin=-(self.lead_in / motor.top_speed))

    @property
    def clearances(self) -> dict[str, float]:
        """Radial clearance (m) of each joint that has one in this run; none where joints are ideal."""
        return {} if self.joint_model == "ideal" else self.mechanism.clearances

    @property
    def bearings(self) -> dict[str, float]:
        """Radial stiffness (N/m) of each soft bearing without clearance in this run: a spring between pin centres.

        With clearance it is what the pin's contact is made of.
        """
        return {name: k for name, k in self.mechanism.soft_bearings.items() if name not in self.clearances}


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
class Watched:
    """Every step of a driven run from its first report on, whether anybody asked for a report there or not: (M,)
    instants, SI units, ground frame.

    ``time`` (s) is the trace's.  By moving body: ``place`` (m) and ``velocity`` (m/s) of its centre of mass, complex,
    ``angle`` (rad, continued) and ``angular_velocity`` (rad/s); by joint with clearance: the ``force`` (N, complex) of
    contact of its first body on its second, of a block that of the walls across its guide and of friction along it; by
    block: ``corners`` (4, M) N, how hard its wall pushes each corner, in the order of
    :attr:`sim_models.common.guide.Guide.corners`, and ``rubbing`` (4, M) N, friction of each along the guide on the
    second body, where its contact has some.
    ``torque`` (N.m) is the motor's on the driven body.  All at the same instants.
    """

    time: np.ndarray
    place: Mapping[str, np.ndarray]
    velocity: Mapping[str, np.ndarray]
    angle: Mapping[str, np.ndarray]
    angular_velocity: Mapping[str, np.ndarray]
    force: Mapping[str, np.ndarray]
    torque: np.ndarray
    corners: Mapping[str, np.ndarray] = field(default_factory=dict)
    rubbing: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Trace:
    """What a simulation saw, at the requested crank angles (or times) and in their order; of a linkage without a crank
    ``crank_angle`` is the position of the first input (see :attr:`analytic.kinematics.structure.Structure.inputs`).

    ``signals`` maps a signal's name to (N,) values, SI units, ground frame: ``<body>_x``, ``<body>_y`` (of its
    marker: its com, where it has no other), ``<body>_angle`` (continued, not wrapped), ``<body>_angular_velocity``,
    ``reaction_<joint>_x``/``_y`` (N, force of the joint's first body on its second) and, for a prismatic joint,
    ``reaction_<joint>_moment`` (N.m, on the second body at its point), ``drive_torque`` (N.m, motor on crank),
    ``clearance_<joint>_x``/``_y`` (m, first pin centre minus second). All belong to the same instant, and so do
    ``rates``, which every moving body has in a run of an engine's own. A ``recorded`` trace is what a file holds:
    signals may be missing in it, and samples NaN.

    ``journal`` maps each joint with clearance to its densely sampled path (M, 2) in m; ``free_share`` to the share
    of time (driven) or of angles (static) that its pin spent off the wall, by its distance
    (:mod:`sim_models.common.free_share`). ``settings`` are the numbers used, a mapping by joint where each has its
    own. ``watched`` is every step, where the request asked for it and the engine watches such runs.
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
    settings: Mapping[str, SettingValue] = field(default_factory=dict)
    rates: Mapping[str, Rates] = field(default_factory=dict)
    recorded: bool = False
    watched: Watched | None = None

    def __post_init__(self) -> None:
        for name, values in self.signals.items():
            if values.shape != self.crank_angle.shape:
                raise SimulationError(
                    f"{self.simulator}: {name} has {count(values.shape[0], 'sample')} for"
                    f" {count(self.crank_angle.size, 'crank angle')}",
                    Cause.FAULTY,
                )
            if not self.recorded and not np.all(np.isfinite(values)):
                k = int(np.argmin(np.isfinite(values)))
                raise SimulationError(
                    f"{self.simulator} {self.joint_model} {self.motion}: {name} is {values[k]} at crank angle "
                    f"{np.degrees(self.crank_angle[k]):.4g} deg: the run diverged",
                    Cause.DIVERGED,
                )
            values.flags.writeable = False

    @property
    def step(self) -> float | None:
        """The time step (s); None where nothing steps."""
        step = self.settings.get("step")
        return float(step) if isinstance(step, int | float) else None


@dataclass(frozen=True)
class Scope:
    """What an engine does: the pairs of joint model and motion that it runs, and the features that each may have.

    A feature that is not there with a pair is refused.  What makes no sense with a pair, such as a course at rest, is
    nobody's (:func:`sensible`).
    """

    runs: frozenset[Pair]
    features: frozenset[tuple[Feature, Pair]]

    @classmethod
    def of(
        cls, runs: Iterable[Pair], features: Iterable[Feature] = FEATURES, but: Iterable[tuple[Feature, Pair]] = ()
    ) -> Scope:
        """These runs, each with all of these features as far as they make sense, ``but`` for some."""
        pairs = frozenset(runs)
        every = {(feature, pair) for feature in features for pair in pairs if sensible(feature, pair)}
        return cls(pairs, frozenset(every - set(but)))

    def at_rest(self) -> Scope:
        """What of it is static."""
        runs = frozenset(pair for pair in self.runs if pair[1] == "static")
        return Scope(runs, frozenset((feature, pair) for feature, pair in self.features if pair in runs))


def sensible(feature: Feature, pair: Pair) -> bool:
    """Whether a run of this joint model and motion can have a feature at all."""
    model, motion = pair
    return (motion == "driven" or feature not in MOVING) and model in TOUCHING.get(feature, JOINT_MODELS)


@dataclass(frozen=True)
class Capabilities:
    """What an engine declares, once: what it simulates with rigid links, what with links that bend, what it exports."""

    rigid: Scope
    beams: Scope | None = None
    export: Scope | None = None

    @property
    def runs(self) -> frozenset[Pair]:
        """Pairs of joint model and motion that are simulated with rigid links."""
        return self.rigid.runs

    @property
    def in_motion(self) -> frozenset[str]:
        """What effects may need of an engine: joint models and features in motion, links that bend
        (``link_flexibility``).
        """
        names: set[str] = {model for model, motion in self.runs if motion == "driven"}
        names |= {feature for feature, (_, motion) in self.rigid.features if motion == "driven"}
        return frozenset(names | ({"link_flexibility"} if self.beams is not None else set()))


class Engine(Protocol):
    """What every engine offers.  One that derives from this class need not write what it does not do."""

    name: str
    package: str  # importable module; of a built-in engine also the name of this project's extra that installs it
    capabilities: Capabilities

    def simulate(self, request: Request) -> Trace:
        """Run one request.  Raises SimulationError, Unsupported, or analytic's AssemblyError for a bad start."""
        ...

    def simulate_flexible(self, request: Request) -> Trace:
        """Run one request in which bodies with a modulus of elasticity bend.

        Raises what :meth:`simulate` does, and Unsupported beyond ``capabilities.beams``.
        """
        raise Unsupported(f"simulator {self.name!r} has rigid links only; leave flexible links out")

    def export(self, request: Request, folder: Path) -> list[Path]:
        """Write a request, and what came of it, into a folder as files that run in the bare engine.

        Raises what :meth:`simulate` does, Unsupported beyond ``capabilities.export``, and OSError.
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


def scheme_of(name: str) -> tuple[str, str]:
    """The scheme and the path of a name such as ``mjcf:linkage.xml``; two empty texts of any other name."""
    scheme, colon, path = name.partition(":")
    return (scheme.casefold(), path) if colon and scheme.casefold() in SCHEMES else ("", "")


def declared(name: str) -> Engine:
    """The engine of that name as it declares itself, its package installed or not (but for somebody's own model).

    Raises Unsupported for an unknown name, SimulatorMissing for an entry point that leads to no engine, and what a
    scheme's ``opened`` raises.
    """
    if name in ENGINES:
        return cast(Engine, importlib.import_module(f"sim_models.{name}.engine").ENGINE)
    scheme, path = scheme_of(name)
    if scheme:
        return cast(Engine, importlib.import_module(SCHEMES[scheme]).opened(path))
    point = offers().points.get(name)
    if point is None:
        meant = next(
            (f"did you mean '{each}:{name}'; " for each, ending in ENDINGS.items() if name.endswith(ending)), ""
        )
        raise Unsupported(f"simulator {name!r} is unknown; {meant}the simulators are {', '.join(engine_names())}")
    left_out = f"simulator {name!r} is left out: its entry point {point.value}"
    try:
        with silence(), uninterrupted():
            offered = point.load()
    except Exception as error:  # noqa: BLE001 - somebody else's module raises whatever it likes
        raise SimulatorMissing(
            f"{left_out} cannot be imported ({_in_a_line(error)}); mend it or uninstall it"
        ) from None
    if not _is_engine(name, offered):
        raise SimulatorMissing(f"{left_out} is no engine of that name with package, capabilities and simulate")
    return cast(Engine, offered)


def _is_engine(name: str, offered: object) -> bool:
    """Whether somebody's object is an engine of that name."""
    parts = {part: getattr(offered, part, None) for part in ("name", "package", "capabilities", "simulate")}
    return (
        parts["name"] == name
        and isinstance(parts["package"], str)
        and isinstance(parts["capabilities"], Capabilities)
        and callable(parts["simulate"])
    )


def engine(name: str) -> Engine:
    """The engine of that name, its package imported.

    Raises Unsupported for an unknown name, SimulatorMissing if it is not installed or cannot be imported, and what a
    scheme's ``opened`` raises.
    """
    scheme, _ = scheme_of(name)
    if scheme:
        _check_installed(scheme, str(importlib.import_module(SCHEMES[scheme]).PACKAGE))
        return declared(name)
    engine = declared(name)
    _check_installed(name, engine.package)
    return engine


def _check_installed(name: str, package: str) -> None:
    """Raise SimulatorMissing if an engine's package is not installed or cannot be imported."""
    own = name if name in ENGINES else EXTRAS.get(package, package) if name in SCHEMES else ""
    extra = f"linkage-crosscheck[{own}]" if own else package
    if importlib.util.find_spec(package) is None:
        clone = f" (in a clone: pip install '.[{own}]')" if own else ""
        raise SimulatorMissing(f"simulator {name!r} is not installed; run: pip install '{extra}'{clone}")
    fault = broken(package)
    if fault:
        raise SimulatorMissing(
            f"simulator {name!r} is installed but cannot be imported ({fault}); mend that, or install it anew: "
            f"pip install --force-reinstall '{extra}'"
        )


@functools.cache
def broken(package: str) -> str:
    """Why an installed package cannot be imported, in its own words; empty if it can."""
    try:
        with silence(), uninterrupted():
            importlib.import_module(package)
    except Exception as error:  # noqa: BLE001 - a broken installation raises whatever it likes
        return _in_a_line(error)
    return ""


def _in_a_line(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


@functools.cache
def installed_version(package: str) -> str | None:
    """Version of an installed package, None if it is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def needed(request: Request) -> dict[Feature, str]:
    """The features that a request has, and of each what of it the request would have to leave out."""
    m = request.mechanism
    moving, touching = request.motion == "driven", request.joint_model == "contact"
    asked_for: dict[Feature, str] = {}
    for joint in m.joints:
        at = f"of joint {joint.name!r}"
        soft = joint.radial_stiffness
        rubs, grows = touching and joint.rough, bool(joint.load_coefficient)
        circle = joint.friction_radius
        grown = f"friction_radius = {circle:g} {at}" if circle else f"friction = {joint.friction:g} {at}"
        block = joint.prismatic and joint.name in request.clearances
        named = moving and joint.contact_law is not None and joint.name in request.clearances
        asked: tuple[tuple[Feature, bool, str], ...] = (
            ("prismatic", joint.prismatic, f"the prismatic joint {joint.name!r}"),
            ("coulomb_friction", bool(joint.coulomb), f"friction_torque = {joint.coulomb:g} {at}"),
            ("stribeck_friction", joint.static_torque is not None, f"static_torque = {joint.stiction:g} {at}"),
            ("load_friction", grows and not joint.prismatic, grown),
            ("guide_friction", grows and joint.prismatic, grown),
            ("viscous_friction", moving and bool(joint.damping), f"damping = {joint.damping:g} {at}"),
            ("drag", moving and bool(joint.drag), f"drag = {joint.drag:g} {at}"),
            ("joint_spring", bool(joint.stiffness), f"stiffness = {joint.stiffness:g} {at}"),
            ("nonlinear_spring", bool(joint.cubic), f"cubic = {joint.cubic:g} {at}"),
            ("contact_friction", rubs, f"friction = {joint.friction:g} {at}"),
            ("soft_bearing", soft is not None, f"radial_stiffness = {soft or 0:g} {at}"),
            ("contact_law", named, f"contact_law = {joint.contact_law!r} {at}"),
            ("guide_clearance", block, f"clearance = {joint.clearance:g} m {at}"),
        )
        asked_for |= {feature: what for feature, has, what in asked if has and feature not in asked_for}
    if m.drive_stiffness:
        asked_for["drive_compliance"] = f"drive.stiffness = {m.drive_stiffness:g}"
    if m.half_gap:
        asked_for["backlash"] = f"drive.half_gap = {m.half_gap:g}"
    if m.periodic_torque is not None:
        asked_for["periodic_torque"] = f"drive.periodic_torque.amplitude = {m.periodic_torque.amplitude:g}"
    asked_for |= _of_forces(m)
    if request.schedule.crank is None:
        asked_for["several_drives"] = "what is not a crank's drive"
    elif request.schedule.courses:
        asked_for["course"] = "a course"
    elif request.schedule.lets_go:
        asked_for["released"] = "the release, with a drive.speed in rad/s"
    return asked_for


def _of_forces(m: Mechanism) -> dict[Feature, str]:
    """The same of a mechanism's loads, springs and stops."""
    asked_for: dict[Feature, str] = {}
    if m.varying_load is not None:
        how = f"over = {m.varying_load.over!r}" if m.varying_load.over else "opposes = true"
        asked_for["varying_load"] = f"{how} of the load on {m.varying_load.body!r}"
    if m.stops:
        asked_for["stop"] = f"the [[stop]] of joint {m.stops[0].joint!r}"
    if m.springs:
        asked_for["point_spring"] = f"the [[spring]] between {' and '.join(m.springs[0].bodies)}"
    return asked_for


def check_supported(chosen: Engine, request: Request) -> None:
    """Raise Unsupported, naming what the engine does instead, if it cannot simulate this request with rigid links."""
    _check(chosen.name, "", chosen.capabilities.rigid, request)


def check_flexible(chosen: Engine, request: Request) -> None:
    """Raise Unsupported, naming what the engine does instead, if it cannot simulate it with links that bend."""
    if chosen.capabilities.beams is None:
        raise Unsupported(f"simulator {chosen.name!r} has rigid links only; leave flexible links out")
    _check(chosen.name, " among links that bend", chosen.capabilities.beams, request)


def check_exported(chosen: Engine, request: Request) -> None:
    """Raise Unsupported, naming what the engine does instead, if it cannot simulate and export this request."""
    check_supported(chosen, request)
    if chosen.capabilities.export is None:
        raise Unsupported(f"simulator {chosen.name!r}: its models cannot be exported")
    _check(chosen.name, " in its exports", chosen.capabilities.export, request)


def _check(name: str, where: str, scope: Scope, request: Request) -> None:
    pair = request.joint_model, request.motion
    runs = f"{request.joint_model} joints in {request.motion} motion"
    if pair not in scope.runs:
        does = ", ".join(sorted(f"{model} {motion}" for model, motion in scope.runs))
        raise Unsupported(f"{name} does not simulate {runs}{where}; it does: {does}")
    for feature, what in needed(request).items():
        if (feature, pair) not in scope.features and sensible(feature, pair):
            lacks = f"{name} has no {IN_WORDS[feature]}{where} (for {runs})"
            raise Unsupported(f"{lacks}: leave out {what}, or use another simulator")
