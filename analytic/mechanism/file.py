"""Mechanism files: TOML in, TOML out, and the cases that ship with the package.

Every fault of a file is raised as :class:`MechanismError` with one sentence: file, field, value, remedy.
"""

from __future__ import annotations

import difflib
import os
import reprlib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from analytic.mechanism import Mechanism
from analytic.mechanism.reading import ReadingError, parse_toml, read_toml

FAULTS = 5  # of a file that a message names
LONGEST = 100  # characters of a name or a value that a message quotes
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = LONGEST


class MechanismError(ValueError):
    """A mechanism file cannot be used; the message names file, field, value and remedy."""


def shipped_cases() -> list[str]:
    """Names of the mechanisms that ship with the package."""
    return sorted(
        p.name.removesuffix(".toml")
        for p in resources.files("analytic.mechanism").joinpath("cases").iterdir()
        if p.name.endswith(".toml")
    )


def load(case: str | Path) -> Mechanism:
    """Read a shipped case by name, or a TOML file by path.

    Raises MechanismError if there is no such file, or what it says is not a mechanism.  That its loops close is
    found when it is assembled (:mod:`analytic.kinematics.assembly`).
    """
    if str(case) in shipped_cases():
        return loads(
            resources.files("analytic.mechanism").joinpath("cases", f"{case}.toml").read_text(encoding="utf-8"),
            source=str(case),
        )
    if not os.path.lexists(case):
        close = difflib.get_close_matches(str(case), shipped_cases(), n=1)
        hint = f"; did you mean {close[0]!r}" if close else ""
        raise MechanismError(
            f"{brief(case)}: no such mechanism file or case{hint}; the cases are {', '.join(shipped_cases())}"
        )
    try:
        fields = read_toml(Path(case))
    except ReadingError as error:
        raise MechanismError(f"{case}: {error}; give a mechanism file") from None
    return _checked(fields, str(case))


def loads(text: str, source: str = "mechanism") -> Mechanism:
    """Mechanism from TOML text; ``source`` is its name in messages.  Raises MechanismError."""
    try:
        fields = parse_toml(text)
    except ReadingError as error:
        raise MechanismError(f"{source}: {error}") from None
    return _checked(fields, source)


def _checked(fields: Mapping[str, object], source: str) -> Mechanism:
    try:
        return Mechanism.model_validate(fields)
    except ValidationError as error:
        raise MechanismError(f"{source}: {'; '.join(describe(error, fields, Mechanism))}") from None


def dumps(mechanism: Mechanism) -> str:
    """TOML text that :func:`loads` turns into an equal mechanism; what was left out stays out."""
    import tomli_w

    fields = mechanism.model_dump(by_alias=True, exclude_none=True, exclude_unset=True, mode="json")
    return tomli_w.dumps(fields)


def describe(error: ValidationError, fields: Mapping[str, object], model: type[BaseModel]) -> list[str]:
    """One sentence for each of the first faults that pydantic found: field, value, and what is accepted."""
    told: dict[tuple[int | str, ...], list[Any]] = {}
    for fault in error.errors():
        told.setdefault(_place(fault["loc"], fields), []).append(fault)
    found = [_sentence(_where(place, fields), faults, model) for place, faults in list(told.items())[:FAULTS]]
    more = len(told) - FAULTS
    return [*found, f"and {more} fault{'s' * (more > 1)} more"] if more > 0 else found


def brief(name: object) -> str:
    """A name as it was given, cut short where it is long."""
    text = str(name)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def _value(value: object) -> str:
    try:
        return brief(_SHORT.repr(value))
    except ValueError:  # Python writes no number of more than 4300 digits
        return "a number of too many digits"


def _sentence(where: str, faults: list[Any], model: type[BaseModel]) -> str:
    """What is wrong in one place; a field that may hold several kinds of value has one fault for each kind."""
    fault = faults[0]
    message = " or ".join(dict.fromkeys(_asked(each) for each in faults))
    if fault["type"] == "extra_forbidden":
        accepted = _accepted(fault["loc"][:-1], model)
        close = difflib.get_close_matches(str(fault["loc"][-1]), accepted, n=1)
        remedy = f"did you mean {close[0]!r}" if close else f"the fields here are {', '.join(accepted)}"
        return f"{where} is not a field; {remedy}"
    if fault["type"] == "missing":
        return f"{where} is missing; add it"
    if fault["type"] == "value_error" and not fault["loc"]:
        return message
    return f"{where} = {_value(fault['input'])}: {message[0].lower()}{message[1:]}"


def _asked(fault: Any) -> str:
    limits = {"less_than_equal": ("le", "less"), "greater_than_equal": ("ge", "greater")}
    if fault["type"] in limits:
        key, words = limits[fault["type"]]
        return f"Input should be {words} than or equal to {fault['ctx'][key]:g}"
    return str(fault["msg"].removeprefix("Value error, "))


def _place(location: tuple[int | str, ...], fields: Mapping[str, object]) -> tuple[int | str, ...]:
    """A fault's location without the steps that only name which of several kinds of value pydantic tried."""
    here: Any = fields
    for k, step in enumerate(location):
        if isinstance(step, str) and not isinstance(here, Mapping):
            return location[:k]
        try:
            here = here[step]
        except (KeyError, IndexError, TypeError):
            here = {}
    return location


def _where(location: tuple[int | str, ...], fields: Mapping[str, object]) -> str:
    """``body[coupler].mass`` for ("body", 1, "mass")."""
    text = ""
    here: Any = fields
    for step in location:
        try:
            here = here[step]
        except (KeyError, IndexError, TypeError):
            here = {}
        if isinstance(step, int):
            name = here.get("name", step) if isinstance(here, Mapping) else step
            text += f"[{brief(name)}]"
        else:
            text += f".{brief(step)}" if text else brief(step)
    return text


def _accepted(location: tuple[int | str, ...], model: type[BaseModel]) -> list[str]:
    """Field names of the model that ``location`` leads to."""
    from typing import get_args

    for step in location:
        if isinstance(step, int):
            continue
        field = next((f for n, f in model.model_fields.items() if step in (n, f.alias)), None)
        pending = [field.annotation] if field else []
        while pending:
            kind = pending.pop()
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                model = kind
                break
            pending += get_args(kind)
    return [f.alias or n for n, f in model.model_fields.items() if not f.exclude]
