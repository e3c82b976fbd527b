"""What the functions that a person calls take: a linkage, engines, clearances, angles, numbers and names, checked.

Each function that checks an argument takes whatever was given, and raises ArgumentError with one sentence: the
argument, the value and what is accepted.
The types of :mod:`compare.questions` say which argument is checked by which.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from numbers import Real
from os import PathLike
from pathlib import Path

import numpy as np

from analytic.errors import warn
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.structure import StructureError
from analytic.mechanism import Joint, Mechanism
from analytic.mechanism.errors import MechanismError, quoted
from analytic.mechanism.file import load
from analytic.mechanism.signals import named
from analytic.mechanism.units import UnitError
from analytic.mechanism.written import quantity
from analytic.paper.clearance import Model
from compare.faults import EVERY_PIN, ArgumentError, DegreesWarning, no_pin, unusable
from compare.judge.tolerances import Tolerances, load_tolerances
from compare.meant import marked
from sim_models.engine import (
    MAPPED,
    SEPARATOR,
    JointModel,
    Motion,
    SimulatorMissing,
    engine,
    engine_names,
    offers,
    scheme_of,
)

Linkage = Mechanism | str | Path
"""A mechanism, the name of a shipped case, or the path of a mechanism file."""
Simulators = str | Sequence[str]
"""Names of engines, one or several, or with commas between them; ``all`` is every one that is installed."""
Numbers = float | str | Sequence[float | str] | np.ndarray
"""One number, or several; in SI, or texts with a unit: ``"60 rpm"``."""
Names = str | Sequence[str]
"""One name, or several."""
ToleranceFile = Tolerances | str | PathLike[str]
"""Tolerances, or a file of them."""
Metres = Mapping[str, float | str] | float | str
"""Radial clearance by joint, or one for every pin: metres, or a text with its unit."""

Values = str | float | Sequence[float | str] | np.ndarray
"""Values of a field: a number (SI), a text with a unit, a range ``start:stop:step``, several with commas, a list."""

EVERY_SIGNAL = "all"  # of those on request
MOST_LIKELY_DEGREES = 4 * math.pi  # rad; angles beyond two turns were probably given in degrees
CAPACITY = 1_000_000  # crank angles, and samples of a Monte Carlo: what a memory holds
SMALL_CLEARANCE = 0.1  # of a body's length: a clearance up to this is small, as the paper's displacements are


def numbers(given: object, called: str, unit: str) -> np.ndarray:
    """Finite numbers (N,), N at least one, of one number or of a flat list of them; in this SI unit where they are
    texts with one, ``"60 rpm"`` or ``"60 rpm, 600 rpm"``.  Raises ArgumentError.
    """
    parts = given.split(",") if isinstance(given, str) else given
    several = list(parts) if isinstance(parts, Iterable) and not isinstance(parts, bytes | np.ndarray) else parts
    if isinstance(several, list) and unit:
        several = [in_unit(each, unit, called) if isinstance(each, str) else each for each in several]
    try:
        values = np.asarray(several)
    except ValueError:  # lists of several lengths
        values = np.array(None)
    truth = isinstance(several, list) and any(isinstance(each, bool | np.bool_) for each in several)
    if truth or values.ndim > 1 or not values.size or values.dtype.kind not in "iuf" or not np.all(np.isfinite(values)):
        given = given.tolist() if isinstance(given, np.ndarray) else given
        raise unusable(called, given, f"one number ({unit}) or a flat list of finite ones, as numpy.arange makes")
    return values.astype(float).reshape(-1)


def number(given: object, called: str, unit: str) -> float:
    """One number, in this SI unit where it is a text with one.  Raises ArgumentError."""
    found = in_unit(given, unit, called) if isinstance(given, str) else given
    if isinstance(found, Real) and not isinstance(found, bool):
        return float(found)
    raise unusable(called, given, f"one number ({unit})")


def looks_like_degrees(angle: float) -> bool:
    """Whether an angle (rad) is one that was probably given in degrees."""
    return MOST_LIKELY_DEGREES < abs(angle) < math.inf


def warn_of_degrees(called: str, angle: float) -> None:
    """Warn of an angle (rad) that was probably given in degrees."""
    if looks_like_degrees(angle):
        text = f"{called}: {angle:g} rad is beyond two turns; angles are in radians; was it meant in degrees?"
        warn(f'{text} Write np.radians(...), or a text, "{angle:g} deg"', DegreesWarning)


def names(given: object, called: str, least: int = 0) -> tuple[str, ...]:
    """Names, each once, at least so many, in a list or a text with commas.  Raises ArgumentError."""
    parts = [part.strip() for part in given.split(",")] if isinstance(given, str) else given
    given_names = tuple(parts) if isinstance(parts, Iterable) else None
    if given_names is None or len(given_names) < least or not all(isinstance(each, str) for each in given_names):
        raise unusable(called, given, "one name or a list of names")
    return tuple(dict.fromkeys(given_names))


def on_request(given: object, mechanism: Mechanism, motion: Motion, *, usual: bool = False) -> tuple[str, ...]:
    """The signals beside the usual ones that are asked for: by name, or ``all``; the mechanism's sensors always are,
    and the ``usual`` ones that are named where they are wanted too.  Raises ArgumentError.
    """
    sensors = tuple(sensor.name for sensor in mechanism.sensors)
    if given is None:
        return sensors
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)
    more = tuple(name for name, signal in known.items() if signal.on_request)
    if motion == "static":
        raise ArgumentError("signals", "nothing moves in static motion; ask for driven motion, or leave signals out")
    asked = names(given, "signals")
    for name in asked if asked != (EVERY_SIGNAL,) else ():
        if name not in known:
            near = get_close_matches(name, known, n=1)
            remedy = f"give {EVERY_SIGNAL!r}, or some of {', '.join(more)}"
            if near:
                remedy = f"did you mean {near[0]!r}{'' if usual or near[0] in more else ', which is always there'}"
            remedy = marked(name, mechanism) or remedy
            raise ArgumentError("signals", f"{quoted(name)} is no signal of {mechanism.name}; {remedy}")
    beside = more if asked == (EVERY_SIGNAL,) else [name for name in asked if usual or name in more]
    return tuple(dict.fromkeys([*sensors, *beside]))


def path(given: object, called: str) -> Path:
    """A path.  Raises ArgumentError."""
    if isinstance(given, str | PathLike):
        return Path(given)
    raise unusable(called, given, "a path")


def laid_over(given: object) -> Tolerances:
    """Tolerances as given, or the shipped ones with those of a file laid over them.  Raises ArgumentError or
    ToleranceError.
    """
    if isinstance(given, Tolerances):
        return given
    if given is None or isinstance(given, str | PathLike):
        return load_tolerances(None if given is None else Path(given), "tolerances")
    raise unusable("tolerances", given, "the path of a tolerance file")


def linkage(given: Linkage, clearance: Metres | None = None, *, large: bool) -> Mechanism:
    """The mechanism that is meant, with these clearances in place of its own if any are given; proven to assemble.

    Raises MechanismError with what was given, or ArgumentError for a clearance that no joint can have, or that only a
    person can want who allows ``large`` ones.
    """
    mechanism = given if isinstance(given, Mechanism) else load(given)
    try:
        Assembly(mechanism)
    except (AssemblyError, StructureError) as error:
        raise MechanismError(str(error) if isinstance(given, Mechanism) else f"{given}: {error}") from None
    loosened = mechanism if clearance is None else with_clearance(mechanism, clearance)
    if not large:
        refuse_large(loosened, "mechanism" if clearance is None else "clearance")
    return loosened


def refuse_large(mechanism: Mechanism, called: str) -> None:
    """Raises ArgumentError for a clearance of more than a tenth of the shortest length that meets in its joint.

    These are the lengths of the moving bodies, but for those that have none, of a block in its guide, and the radius
    of the pin, where it is stated.
    """
    for joint in mechanism.joints:
        if not joint.clearance:
            continue
        lengths = {f"body {name!r}": mechanism.moving[name].length for name in joint.bodies if name in mechanism.moving}
        if joint.guide is not None:
            lengths["its block"] = joint.guide[0]
        lengths["its pin's radius"] = joint.pin_radius or 0.0
        size, what = min(((size, what) for what, size in lengths.items() if size > 0), default=(math.inf, ""))
        if joint.clearance > SMALL_CLEARANCE * size and not math.isclose(joint.clearance, SMALL_CLEARANCE * size):
            raise ArgumentError(
                called,
                f"joint {joint.name!r} has clearance = {joint.clearance:g} m, more than a tenth of {what} ({size:g} m);"
                " give the radial clearance in m, or `large` where so much is meant",
            )


def with_clearance(mechanism: Mechanism, clearance: Metres, called: str = "clearance") -> Mechanism:
    """The mechanism with exactly these clearances (m).  Raises ArgumentError."""
    try:
        return mechanism.with_clearances(metres(clearance, mechanism, called))
    except MechanismError as error:
        raise ArgumentError(called, str(error)) from None


def loose(mechanism: Mechanism, joint_model: JointModel | None) -> None:
    """Raises ArgumentError for a joint model that needs clearance where no joint has any."""
    if joint_model not in (None, "ideal") and not mechanism.clearances:
        why = f"{joint_model} joints need clearance; {mechanism.name} has none; give `clearance` (m by joint)"
        raise ArgumentError("joint_model", why)


def warn_of_friction(
    mechanism: Mechanism, joint_model: JointModel | None, motion: Motion, *, engines: bool = True
) -> None:
    """Warn of the radius that is assumed of a pin that rubs in its clearance, and of blocks that jam in an engine.

    Friction that is left out is in :mod:`compare.omissions`.
    """
    if joint_model not in (None, "contact"):
        return
    name = mechanism.name
    for joint in jamming(mechanism) if engines and motion == "driven" else []:
        text = f"{name}: friction = {joint.friction:g} of joint {joint.name} is no less than its block is"
        lever = f"longer than high ({joint.jams_from:g}), and turns it harder than its walls turn it back"
        warn(f"{text} {lever}: it tips, and may bounce, jam or come apart")
    for joint in mechanism.joints:
        if joint.rough and not joint.prismatic and joint.pin_radius is None:
            text = f"{name}: joint {joint.name} has friction and no pin_radius; its contact rubs at"
            warn(f"{text} {1e3 * joint.rim:g} mm, which is assumed")


def jamming(mechanism: Mechanism) -> list[Joint]:
    """The blocks with clearance whose corners rub so hard that they may jam."""
    return [joint for joint in mechanism.joints if joint.rough and joint.friction >= joint.jams_from]


def metres(given: object, mechanism: Mechanism, called: str) -> dict[str, float]:
    """Lengths (m) by joint that may have clearance, checked.  Raises ArgumentError."""
    pins = [j.name for j in mechanism.joints if not j.prismatic]
    given = in_unit(given, "m", called) if isinstance(given, str) else given
    if isinstance(given, Real) and not isinstance(given, bool):
        given = {EVERY_PIN: given}
    if isinstance(given, Mapping) and EVERY_PIN in given:
        given = {**dict.fromkeys(pins, given[EVERY_PIN]), **{j: c for j, c in given.items() if j != EVERY_PIN}}
    if not isinstance(given, Mapping):
        example = {(pins or ["B"])[-1]: 1e-4}
        raise unusable(called, given, f"metres by joint, such as {example}")
    clearances = {}
    for name, size in given.items():
        if name not in mechanism.may_be_loose:
            raise ArgumentError(called, no_pin(name, pins, mechanism))
        size = in_unit(size, "m", called) if isinstance(size, str) else size
        if not isinstance(size, Real) or isinstance(size, bool) or not 0 <= float(size) < math.inf:
            raise ArgumentError(called, f"{name} = {quoted(size)}; give metres, 0 or more")
        clearances[name] = float(size)
    return clearances


def in_unit(written: str, unit: str, called: str) -> float | str:
    """A quantity that is written with its unit, in this one; what is none as it is.  Raises ArgumentError."""
    try:
        found = quantity(written, unit)
    except UnitError as error:
        raise ArgumentError(called, f"{written!r} has {error}") from None
    return written if found is None else found


def engines(given: Simulators) -> tuple[tuple[str, ...], list[str]]:
    """The engines that are meant, and of ``all`` those that are left out and why, a sentence each.

    Raises ArgumentError, Unsupported for an unknown name, SimulatorMissing where none is installed.
    """
    if not every_one(given):
        return tuple(engine(name).name for name in _engine_names(given)), []
    installed, left_out = [], []
    for name in engine_names():
        try:
            installed.append(engine(name).name)
        except SimulatorMissing as missing:
            left_out.append(f"left out: {missing}")
    left_out += [f"left out: {why}" for why in offers().refused.values()]
    if not installed:
        raise SimulatorMissing(f"no simulator is installed; run: pip install 'linkage-crosscheck[{engine_names()[0]}]'")
    return tuple(installed), left_out


def with_map(given: Simulators, columns: PathLike[str] | str | None) -> Simulators:
    """The simulators, those that are somebody's model file with this map of its columns.  Raises ArgumentError."""
    if columns is None:
        return given
    mapped = tuple(
        name if scheme_of(name)[0] not in MAPPED or SEPARATOR in name else f"{name}{SEPARATOR}{columns}"
        for name in _engine_names(given)
    )
    if mapped == _engine_names(given):
        accepted = " or ".join(f"{each}:FILE" for each in MAPPED)
        raise ArgumentError("map", f"{columns} belongs to no simulator; give one that takes a map, {accepted}")
    return mapped


def every_one(given: Simulators) -> bool:
    """Whether every engine that is installed is meant.  Raises ArgumentError."""
    return _engine_names(given) == ("all",)


def modelling(name: str) -> str:
    """The name of an engine that models what it is given.  Raises ArgumentError for somebody's model, which stays as
    it is.
    """
    if scheme_of(name)[0]:
        why = f"{name}: is one model as it is, and here each run has its own; give one of {', '.join(engine_names())}"
        raise ArgumentError("simulator", why)
    return name


def one_engine(given: object) -> str:
    """The name of one engine, in the letters that it is called by.  Raises ArgumentError."""
    if not isinstance(given, str):
        raise unusable("simulator", given, f"one of {', '.join(engine_names())}")
    return _as_called(given)


def _engine_names(given: object) -> tuple[str, ...]:
    """The names of engines, each once; ``all`` stands alone.  Raises ArgumentError."""
    texts = (given,) if isinstance(given, str) else names(given, "simulator")
    parts = [part for text in texts for part in _parted(text)]
    called = tuple(dict.fromkeys(_as_called(part) for part in parts))
    if not all(called) or not called or ("all" in called and len(called) > 1):
        raise unusable("simulator", given, f"one or several of {', '.join(engine_names())}, or all by itself")
    return called


def _parted(text: str) -> Iterator[str]:
    """The names of a list separated by commas; the path of a file that exists keeps those that it has."""
    left = text.split(",")
    while left:
        count = 1
        if scheme_of(left[0].strip())[0]:
            whole = range(len(left), 1, -1)
            count = next((k for k in whole if os.path.exists(scheme_of(",".join(left[:k]).strip())[1])), 1)
        yield ",".join(left[:count]).strip()
        left = left[count:]


def _as_called(name: str) -> str:
    """The name of an engine that is this one but for capitals; any other name as it is, a path above all."""
    scheme, path = scheme_of(name)
    if scheme:
        return f"{scheme}:{path}"
    known = {each.casefold(): each for each in (*engine_names(), "all")}
    return known.get(name.casefold(), name)


def rigidly_and_evenly_driven(mechanism: Mechanism) -> Mechanism:
    """The mechanism with a drive as cross-checks have it; warns of what its own has besides."""
    if not mechanism.cranked:
        return mechanism
    drive = mechanism.drive
    fields = (
        ("stiffness", "have a rigid drive", None),
        ("ripple", "turn evenly", None),
        ("half_gap", "have no backlash", 0.0),
    )
    for field, checks, none in fields:
        if drive is not None and getattr(drive, field) != none:
            warn(f"{mechanism.name}: cross-checks {checks}; drive.{field} is left out")
            drive = drive.model_copy(update={field: none})
    return mechanism if drive is mechanism.drive else mechanism.replace(drive=drive)


def idle(mechanism: Mechanism, model: Model, joint_model: JointModel | None = None) -> list[str]:
    """A sentence on a choice of analytic model that changes nothing, as no joint is displaced."""
    if model == "first_order" and (joint_model == "ideal" or not mechanism.displaced):
        return [f"{mechanism.name}: first_order is the equilibrium itself where no joint has clearance"]
    return []


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def noted() -> Iterator[list[str]]:
    """Warnings that are given within, as sentences, whatever a person has chosen to be shown; each is given again when
    it ends.  A command, which takes degrees, has none of those that ask for radians.
    """
    sentences: list[str] = []
    in_degrees = any(action == "ignore" and kind is DegreesWarning for action, _, kind, *_ in warnings.filters)
    caught: list[warnings.WarningMessage] = []
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            if in_degrees:
                warnings.simplefilter("ignore", DegreesWarning)
            yield sentences
    finally:  # what is refused may be refused for what a warning says
        for each in caught:
            if not issubclass(each.category, RuntimeWarning):
                sentences.append(str(each.message))
            warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
