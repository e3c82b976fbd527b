"""A field of a mechanism by its dotted name, as its file nests it: ``drive.speed``, ``joint.B.clearance``,
``body.crank.points.A.x``, ``load.coupler.force.y``; and mechanisms that differ in such fields.

A part is named by its name, a drive or a stop by its joint, a load by its body, a spring by its number in the file,
from 1; where there is one of a kind, its name may be left out.  ``body.<name>.length`` is no field of a file: it moves
the last of the two places at which a body has points.
"""

from __future__ import annotations

import copy
import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ValidationError

from analytic.mechanism.errors import MechanismError, accepted, describe, quoted
from analytic.mechanism.model import Mechanism, as_written
from analytic.mechanism.parts import Body, Drive, Joint, Load
from analytic.mechanism.written import WAVES, si_unit

TABLES = ("gravity", "ground", "body", "joint", "drive", "spring", "stop", "load", "sensor", "assembly", "initial")
# what names a part of each; where that is not one part's alone, and of springs, its number does
CALLED = {
    "body": "name", "joint": "name", "drive": "joint", "load": "body", "spring": "", "stop": "joint", "sensor": "name",
}  # fmt: skip
NUMBERED = ("load", "spring", "stop")
WITHIN = ("elasticity", *WAVES)  # fields that are tables
STEPS = {"section": ("height", "depth"), "guide": ("length", "height")}  # other lists are x, y and z
NO_NUMBERS = {
    "name": "a name is no number; name a field that is one, such as drive.speed",
    "table": "a table of a load stays as the file has it; name its force or torque, of which it has factors",
}  # fields that are given in a file alone
FROM_NOTHING = ("gravity", "force")  # lists that are zero where they are left out
LENGTH = "length"


class FieldError(MechanismError):
    """A dotted name is no field; the message says which name was meant, or which there are.

    Of what has no such name: ``where`` it was looked for, the ``choices`` there, and the one that is ``close``, if any.
    """

    def __init__(self, message: str, where: str = "", choices: Sequence[str] = (), close: str = "") -> None:
        super().__init__(message)
        self.where, self.choices, self.close = where, tuple(choices), close


@dataclass(frozen=True)
class Dotted:
    """A field: its dotted name, the steps to it in a mechanism's file, and the SI unit of its number."""

    name: str
    place: tuple[str | int, ...]
    unit: str


def by_name(mechanism: Mechanism) -> dict[str, object]:
    """What a mechanism has that is not left out, by dotted names; a list of numbers, and a table of a load, whole."""
    out: dict[str, object] = {}
    fields = mechanism.model_dump(by_alias=True, exclude_none=True, exclude_defaults=True, mode="json")
    for table, value in fields.items():
        parts = value if table in CALLED and isinstance(value, list) else [value]
        for k, part in enumerate(parts, 1):
            called = CALLED.get(table) if table not in NUMBERED else ""
            place = table if called is None or len(parts) == 1 else f"{table}.{part[called] if called else k}"
            own = {n: v for n, v in part.items() if n != called} if called else part
            out |= dict(_leaves(place, own))
    return out


def _leaves(place: str, value: object) -> Iterator[tuple[str, object]]:
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _leaves(f"{place}.{name}", inner)
    else:
        yield place, value


def find(mechanism: Mechanism, name: str) -> Dotted:
    """The field of a mechanism that a dotted name means.  Raises FieldError."""
    fields: dict[str, Any] = as_written(mechanism)
    if name in NO_NUMBERS:
        raise FieldError(f"{name}: {NO_NUMBERS[name]}")
    _whole(name, fields)
    table, rest = _step(name, name, TABLES, "a mechanism file")
    place: tuple[str | int, ...] = (table,)
    here: Any = fields.get(table)
    if table in CALLED:
        if isinstance(here, list):
            index, rest = _part(name, rest, table, here)
            place, here = (*place, index), here[index]
        elif here is None:
            raise FieldError(f"{name}: {mechanism.name} has no {table}")
        else:  # one table in place of a list of them
            rest = rest.removeprefix(f"{here[CALLED[table]]}.")
        lengths = [LENGTH] if table == "body" else []
        field, rest = _step(name, rest, [*accepted(place, Mechanism), *lengths], f"a {table}")
        if field in NO_NUMBERS:
            raise FieldError(f"{name}: {NO_NUMBERS[field]}")
        place, here = (*place, field), here.get(field) if field not in lengths else math.nan
        if lengths and field == LENGTH and len(_ends(fields["body"][int(place[1])])) != 2:
            raise FieldError(f"{name}: a body of two points has one length; give points.<point>.x and y of this one")
        if field in WITHIN:
            field, rest = _step(name, rest, accepted(place, Mechanism), f"the {field}")
            place, here = (*place, field), (here or {}).get(field)
    elif table == "ground":
        point, rest = _step(name, rest.removeprefix("points."), list(here["points"]), "the ground's points")
        place, here = (table, "points", point), here["points"][point]
    return Dotted(name, _inside(name, place, here, rest), "m" if place[-1] == LENGTH else si_unit(fields, place))


def _whole(name: str, fields: Mapping[str, Any]) -> None:
    """Raises FieldError for a body's or a joint's field by the part's name alone."""
    for kind in ("body", "joint") if name.partition(".")[0] not in TABLES else ():
        if any(name.startswith(f"{part['name']}.") for part in fields[kind]):
            whole = f"{kind}.{name}"
            raise FieldError(f"{name}: did you mean {whole!r}", close=whole)


def with_values(mechanism: Mechanism, values: Mapping[Dotted, float | str]) -> Mechanism:
    """A checked copy with other values (SI) of these fields.  Raises MechanismError."""
    fields: dict[str, Any] = copy.deepcopy(as_written(mechanism))
    for field, given in values.items():
        value = {"true": True, "false": False}.get(given, given) if isinstance(given, str) else given
        if field.place[0] == "body" and field.place[-1] == LENGTH:
            _lengthen(fields["body"][int(field.place[1])], value, field.name)
            continue
        here: Any = fields
        for k, step in enumerate(field.place[:-1]):
            if isinstance(here, dict) and step not in here:
                here[step] = [0.0, 0.0] if isinstance(field.place[k + 1], int) else {}
            here = here[step]
        here[field.place[-1]] = value
    for k, joint in enumerate(mechanism.joints):
        if joint.fitted_anew({str(f.place[2]): given for f, given in values.items() if f.place[:2] == ("joint", k)}):
            del fields["joint"][k]["clearance"]
    try:
        return Mechanism.model_validate(fields, context=mechanism.doubts)
    except ValidationError as error:
        raise MechanismError(f"{mechanism.name}: {'; '.join(describe(error, fields, Mechanism))}") from None


def value(mechanism: Mechanism, field: Dotted) -> object:
    """What a mechanism has in a field (SI), also where its file leaves it out."""
    here: Any = mechanism.model_dump(by_alias=True, mode="json")
    steps = field.place
    if steps[0] == "body" and steps[-1] == LENGTH:
        a, b = _ends(here["body"][steps[1]])
        return math.dist(a, b)
    for step in steps:
        here = here[step]
    return here


def _lengthen(body: dict[str, Any], length: float | str, name: str) -> None:
    """Move the last of a body's two points along their line, so that they are this far apart."""
    if isinstance(length, str) or not 0 < length < math.inf:
        raise MechanismError(f"{name} = {quoted(length)}; give metres, more than 0")
    (x, y), (u, v) = last = _ends(body)
    share = length / (math.hypot(u - x, v - y) or math.nan)
    end = [x + share * (u - x), y + share * (v - y)]
    body["points"] |= {point: end for point, at in body["points"].items() if tuple(at) == last[1]}


def _ends(body: Mapping[str, Any]) -> list[tuple[float, float]]:
    """The places at which a body has points."""
    return list(dict.fromkeys((float(x), float(y)) for x, y in body["points"].values()))


def _part(name: str, rest: str, table: str, parts: Sequence[Mapping[str, Any]]) -> tuple[int, str]:
    """The index of the part of a table that is meant, and what is left of the name."""
    called = [str(part.get(CALLED[table], "")) for part in parts]
    keys = {str(k): k - 1 for k in range(1, len(parts) + 1)} if table in NUMBERED else {}
    keys |= {each: k for k, each in enumerate(called) if each and called.count(each) == 1}
    if len(parts) == 1 and not any(rest == key or rest.startswith(f"{key}.") for key in keys):
        return 0, rest
    key, rest = _step(name, rest, list(keys), f"a {table}", "no name of")
    return keys[key], rest


def _inside(name: str, place: tuple[str | int, ...], here: object, rest: str) -> tuple[str | int, ...]:
    """The whole place of a number, through points and the components of a list."""
    while True:
        if here is None and place[-1] in FROM_NOTHING:
            here = [0.0, 0.0]
        if isinstance(here, Mapping):
            step, rest = _step(name, rest, list(here), str(place[-1]))
            place, here = (*place, step), here[step]
        elif isinstance(here, list):
            steps = STEPS.get(str(place[-1]), ("x", "y", "z"))[: len(here)]
            step, rest = _step(name, rest, steps, str(place[-1]), "no component of")
            place, here = (*place, steps.index(step)), None
        elif rest:
            what = "is left out; give it in the file first" if here is None else f"has nothing inside, such as {rest!r}"
            raise FieldError(f"{name}: {name.removesuffix(f'.{rest}')} {what}")
        else:
            return place


def _step(name: str, rest: str, choices: Sequence[str], where: str, no: str = "no field of") -> tuple[str, str]:
    """The first of some names in what is left of a dotted name, names with dots too, and what is left then."""
    fitting = [each for each in choices if rest == each or rest.startswith(f"{each}.")]
    if fitting:
        best = max(fitting, key=len)
        return best, rest[len(best) + 1 :]
    first = rest.partition(".")[0]
    close = difflib.get_close_matches(first, choices, n=1)
    remedy = f"did you mean {close[0]!r}" if close and first else f"they are {', '.join(choices)}"
    if choices is TABLES:  # a field of a part, without the part
        parts: dict[str, type[BaseModel]] = {"joint": Joint, "body": Body, "drive": Drive, "load": Load}
        own = [table for table, part in parts.items() if first in part.model_fields]
        remedy = f"give it as {own[0]}.{'NAME.' * (own[0] != 'drive')}{first}" if own else remedy
    said = f"{first!r} is {no} {where}" if first else f"{where} has several numbers; name one"
    raise FieldError(f"{name}: {said}; {remedy}", where, choices, close[0] if close and first else "")
