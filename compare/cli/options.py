"""What several commands take: choices, engines by name, clearances by joint."""

from __future__ import annotations

import os
import warnings
from enum import StrEnum
from typing import TYPE_CHECKING

import typer

from compare.faults import OptionError, reason

if TYPE_CHECKING:
    from analytic.mechanism import Mechanism


class JointChoice(StrEnum):
    """The joint models of --joint."""

    ideal = "ideal"
    massless_link = "massless-link"
    spring_damper = "spring-damper"
    contact = "contact"


class MotionChoice(StrEnum):
    """The motions of --motion."""

    driven = "driven"
    static = "static"


class ModelChoice(StrEnum):
    """The yardsticks of --analytic."""

    first_order = "first_order"
    equilibrium = "equilibrium"


def metres_by_joint(text: str, option: str, mechanism: Mechanism) -> dict[str, float]:
    """``B=1e-4,E=2e-4`` as metres by revolute joint.  Raises OptionError."""
    pins = [j.name for j in mechanism.joints if not j.prismatic]
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        if name in found:
            raise OptionError(f"{option} {text}: joint {name} is there twice; give each joint once")
        try:
            size = float(value)
        except ValueError:
            raise OptionError(f"{option} {part}: give JOINT=metres, such as {pins[-1]}=1e-4") from None
        if name not in pins:
            raise OptionError(
                f"{option} {part}: {name!r} is not a revolute joint of {mechanism.name}; they are {', '.join(pins)}"
            )
        if not 0 <= size < float("inf"):
            raise OptionError(f"{option} {part}: give metres, 0 or more")
        found[name] = size
    return found


def listed_once(text: str, option: str) -> list[str]:
    """The items of a list separated by commas.  Raises OptionError where one is there twice."""
    parts = [part.strip() for part in text.split(",")]
    twice = next((part for i, part in enumerate(parts) if part in parts[:i]), None)
    if twice is not None:
        raise OptionError(f"{option} {text}: {twice} is there twice; give each once")
    return parts


def load_case(case: str, clearance: str | None = None) -> Mechanism:
    """The mechanism that a command line names, with the radial clearances of its option --clearance in place of its
    own.

    It is proven here that it can be assembled, where the file is known that says it.  Raises MechanismError or
    OptionError.
    """
    from analytic.kinematics.assembly import Assembly, AssemblyError
    from analytic.kinematics.structure import StructureError
    from analytic.mechanism.file import MechanismError, load

    mechanism = load(case)
    try:
        Assembly(mechanism)
    except (AssemblyError, StructureError) as error:
        raise MechanismError(f"{case}: {error}") from None
    if clearance is None:
        return mechanism
    given = metres_by_joint(clearance, "--clearance", mechanism)
    try:
        return mechanism.with_clearances(given)
    except ValueError as error:  # pydantic's is one
        raise OptionError(f"--clearance {clearance}: {reason(error)}") from None


def engines_named(name: str) -> tuple[str, ...]:
    """The engine of that name, or for ``all`` every installed one, saying which are left out.

    Raises Unsupported for an unknown name, SimulatorMissing where none is installed.
    """
    from sim_models.engine import ENGINES, SimulatorMissing, engine

    if name != "all":
        return (engine(name).name,)
    found = []
    for each in ENGINES:
        try:
            found.append(engine(each).name)
        except SimulatorMissing as missing:
            typer.echo(f"left out: {missing}", err=True)
    if not found:
        raise SimulatorMissing(f"no simulator is installed; run: pip install 'linkage-crosscheck[{ENGINES[0]}]'")
    return tuple(found)


def rigidly_and_evenly_driven(mechanism: Mechanism) -> Mechanism:
    """The mechanism with a drive as cross-checks have it; warns of what its own has besides."""
    drive = mechanism.drive
    for field, checks in (("stiffness", "are rigid"), ("ripple", "turn evenly")):
        if drive is not None and getattr(drive, field) is not None:
            warnings.warn(f"{mechanism.name}: cross-checks {checks}; drive.{field} is left out", stacklevel=3)
            drive = drive.model_copy(update={field: None})
    return mechanism if drive is mechanism.drive else mechanism.replace(drive=drive)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
