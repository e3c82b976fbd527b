"""What several commands take: choices, lists, clearances by joint, as they were typed."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compare.faults import OptionError, no_pin, reason

if TYPE_CHECKING:
    from analytic.mechanism import Mechanism


Json = Annotated[
    bool, typer.Option("--json", help="Print the result file (JSON) to standard output, and nothing else there.")
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print nothing to standard output; files are written as without it.")
]


Large = Annotated[
    bool, typer.Option("--large", help="Take clearances of more than a tenth of the shortest body at their joint.")
]


Times = Annotated[
    str | None,
    typer.Option(metavar="START:STOP:STEP", help="Times (s), of several drives or of one that turns no crank."),
]
CourseFile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Course of the drives: time and position_<joint> columns.")
]
PathFile = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Path of a platform: time and its <body>_x, _y, _angle columns.")
]


def place(text: str | Path) -> Path:
    """The path of an option.  Raises BadParameter for an empty one, which would be the current folder."""
    if not str(text).strip():
        raise typer.BadParameter("it is empty; name a folder, or give . for the current one")
    return Path(text)


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
    """The models of --analytic."""

    first_order = "first_order"
    equilibrium = "equilibrium"


def metres_by_joint(text: str, option: str, mechanism: Mechanism) -> dict[str, float]:
    """``B=1e-4,E=2e-4`` as metres by joint that may have clearance.  Raises OptionError."""
    pins = [j.name for j in mechanism.joints if not j.prismatic]
    found: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        if name in found:
            raise OptionError(f"{option} {text}: joint {name} is there twice; give each joint once")
        try:
            size = float(value)
        except ValueError:
            raise OptionError(f"{option} {part}: give JOINT=metres, such as {(pins or ['B'])[-1]}=1e-4") from None
        if name not in mechanism.may_be_loose:
            raise OptionError(f"{option} {part}: {no_pin(name, pins, mechanism)}")
        if not 0 <= size < float("inf"):
            raise OptionError(f"{option} {part}: give metres, 0 or more")
        found[name] = size
    return found


def steps_by_joint(text: str, option: str, mechanism: Mechanism) -> dict[str, float]:
    """``D=1e-4,E=1e-4`` as steps (rad, m) by driven joint.  Raises OptionError."""
    joints = [joint.name for joint in mechanism.motors]
    found: dict[str, float] = {}
    for part in listed_once(text, option):
        name, _, value = part.partition("=")
        if name not in joints:
            raise OptionError(f"{option} {part}: {name!r} is no driven joint; they are {', '.join(joints)}")
        try:
            step = float(value)
        except ValueError:
            step = -1.0
        if not 0 <= step < float("inf"):
            raise OptionError(f"{option} {part}: give rad, or m where the joint slides, of 0 or more")
        found[name] = step
    return found


def listed_once(text: str, option: str) -> list[str]:
    """The items of a list separated by commas.  Raises OptionError where one is there twice."""
    parts = [part.strip() for part in text.split(",")]
    twice = next((part for i, part in enumerate(parts) if part in parts[:i]), None)
    if twice is not None:
        raise OptionError(f"{option} {text}: {twice} is there twice; give each once")
    return parts


def load_case(case: str, clearance: str | None = None, *, large: bool) -> Mechanism:
    """The mechanism that a command line names, with the radial clearances of its option --clearance in place of its
    own.

    It is proven here that it can be assembled, where the file is known that says it, and that its clearances are small
    unless ``large`` ones are meant.  Raises MechanismError or OptionError.
    """
    from compare.arguments import linkage, refuse_large

    mechanism = linkage(case, large=large or clearance is not None)
    if clearance is None:
        return mechanism
    given = metres_by_joint(clearance, "--clearance", mechanism)
    try:
        found = mechanism.with_clearances(given)
    except ValueError as error:  # pydantic's is one
        raise OptionError(f"--clearance {clearance}: {reason(error)}") from None
    if not large:
        refuse_large(found, "clearance")
    return found


def said(sentences: Iterable[str]) -> None:
    """What is left out, on standard error."""
    for sentence in sentences:
        typer.echo(sentence, err=True)
