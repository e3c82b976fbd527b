"""Faults of a mechanism, or of any model of fields, as sentences: place, field, value, remedy."""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pydantic import BaseModel, ValidationError

from analytic.errors import Error

MOST_FAULTS = 5  # of a file that a message names
LONGEST_QUOTE = 100  # characters of a name or a value that a message quotes
# a model's name, also of one that is checked as a whole, or the words that a field may be
KIND = re.compile(r"[A-Z][A-Za-z]+|(literal|function-after|dict)\[.*\]|constrained-[a-z]+")
VECTORS = {"gravity": "m/s^2", "force": "N", "com": "m", "marker": "m"}  # their units
_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = LONGEST_QUOTE


class MechanismError(Error, ValueError):
    """A mechanism, or its file, cannot be used; the message names where, field, value and remedy."""


def describe(error: ValidationError, fields: Mapping[str, object], model: type[BaseModel]) -> list[str]:
    """One sentence for each of the first faults that pydantic found: field, value, and what is accepted."""
    by_place: dict[tuple[int | str, ...], list[Any]] = {}
    for fault in error.errors():
        by_place.setdefault(_place(fault["loc"], fields), []).append(fault)
    within = {place[:k] for place in by_place for k in range(len(place))}
    for place in within & by_place.keys():  # a field says more than its table
        del by_place[place]
    sentences = [_sentence(_where(place, fields), faults, model) for place, faults in by_place.items()]
    return _first(sentences)


def together(*checks: Callable[[], None]) -> None:
    """Make checks that do not rely on each other.  Raises ValueError with a sentence for each of the first faults."""
    sentences: list[str] = []
    for check in checks:
        try:
            check()
        except ValueError as error:
            sentences.append(str(error))
    if sentences:
        raise ValueError("; ".join(_first(sentences)))


def _first(sentences: Sequence[str]) -> list[str]:
    """The first of the sentences, and how many more there are."""
    more = len(sentences) - MOST_FAULTS
    return [*sentences[:MOST_FAULTS], *([f"and {more} fault{'s' * (more > 1)} more"] if more > 0 else [])]


def brief(name: object) -> str:
    """A name as it was given, cut short where it is long."""
    text = str(name)
    return text if len(text) <= LONGEST_QUOTE else f"{text[:LONGEST_QUOTE]}..."


def quoted(value: object) -> str:
    """A value as Python writes it, cut short where it is long."""
    try:
        return brief(_SHORT.repr(value))
    except ValueError:  # Python writes no number of more than 4300 digits
        return "a number of too many digits"


def _sentence(where: str, faults: list[Any], model: type[BaseModel]) -> str:
    """What is wrong in one place; a field that may hold several kinds of value has one fault for each kind."""
    fault = faults[0]
    message = " or ".join(dict.fromkeys(_asked(each) for each in faults)).replace(" or Input should be ", " or ")
    if fault["type"] == "extra_forbidden":
        names = accepted(fault["loc"][:-1], model)
        close = difflib.get_close_matches(str(fault["loc"][-1]), names, n=1)
        remedy = f"did you mean {close[0]!r}" if close else f"the fields here are {', '.join(names)}"
        return f"{where} is not a field; {remedy}"
    if fault["type"] == "missing":
        return f"{where} is missing; add it"
    if fault["type"] == "value_error" and not fault["loc"]:
        return message
    if fault["type"] == "model_type":
        fields = ", ".join(accepted(fault["loc"], model))
        return f"{where} = {quoted(fault['input'])}: give a table with the fields {fields}"
    if fault["type"] == "value_error" and isinstance(fault["input"], Mapping) and fault["input"]:  # rightly a table
        words = ", ".join(f"{name} = {quoted(value)}" for name, value in fault["input"].items())
        return f"{where} with {brief(words)}: {message[0].lower()}{message[1:]}"
    return f"{where} = {quoted(fault['input'])}: {message[0].lower()}{message[1:]}"


def _asked(fault: Any) -> str:
    limits = {"less_than_equal": ("le", "less"), "greater_than_equal": ("ge", "greater")}
    if fault["type"] in limits:
        key, words = limits[fault["type"]]
        return f"Input should be {words} than or equal to {fault['ctx'][key]:g}"
    if fault["type"] == "tuple_type":
        field = "com" if "points" in fault["loc"][:-1] else fault["loc"][-1]
        return f"Input should be {f'[x, y] in {VECTORS[field]}' if field in VECTORS else 'a list, in brackets'}"
    if fault["type"] in ("dict_type", "mapping_type", "model_type"):
        return "Input should be a table"
    if fault["type"] == "too_long" and fault["ctx"].get("field_type") == "Tuple":
        return f"Input should be {fault['ctx']['max_length']} values, not {fault['ctx']['actual_length']}"
    if fault["type"] == "string_pattern_mismatch":
        return "Input should be a name, without @ and unprintable characters"
    comma = fault["type"] == "float_type" and isinstance(fault["input"], str) and "," in fault["input"]
    return f"{fault['msg'].removeprefix('Value error, ')}{', with a point in place of the comma' * comma}"


def _place(location: tuple[int | str, ...], fields: Mapping[str, object]) -> tuple[int | str, ...]:
    """A fault's location without the steps that only name which of several kinds of value pydantic tried."""
    here: Any = fields
    place: list[int | str] = []
    for step in location:
        if isinstance(step, str) and not isinstance(here, Mapping):
            break
        if isinstance(step, int) and isinstance(here, Mapping):  # one table in place of a list of them
            continue
        try:
            here = here[step]
        except (KeyError, IndexError, TypeError):
            if KIND.fullmatch(str(step)):
                continue
            here = {}
        place.append(step)
    return tuple(place)


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
            name = here.get("name", here.get("joint", step)) if isinstance(here, Mapping) else step
            text += f"[{brief(name)}]"
        else:
            text += f".{brief(step)}" if text else brief(step)
    return text


def accepted(location: tuple[int | str, ...], model: type[BaseModel]) -> list[str]:
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
