"""measured.toml as written: its fields, and the keys that ``tolerance`` may have."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from analytic.mechanism import Load, Mechanism, MechanismError, Sensor
from analytic.mechanism.columns import Layout, Meaning, readable
from analytic.mechanism.errors import describe
from analytic.mechanism.file import load, shipped_cases
from analytic.mechanism.one_line import shown
from analytic.mechanism.reading import ReadingError, read_toml
from analytic.mechanism.units import SiUnit, UnitError
from analytic.mechanism.written import number, runs_in_si, sensors_in_si
from compare.diagnose.data.recording import MeasuredError
from compare.diagnose.data.wanted import ContextTable
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.recorded.headings import canonical
from compare.recorded.table import LARGEST_READING

LINE = 500  # characters of a message
DIGITS = "has a whole number of too many digits, which cannot be read; write it as a decimal"
QUANTITIES = (
    "mass",
    "length",
    "inertia",
    "force",
    "torque",
    "angle",
    "time",
    "damping",
    "stiffness",
    "clearance",
    "modulus",
    "gain",
    "gravity",
)
PARAMETERS = [(effect, p) for effect, e in VOCABULARY.items() for p in e.parameters]


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


NotNegative = Annotated[float, Field(ge=0)]
Number = Annotated[float, Field(gt=-LARGEST_READING, lt=LARGEST_READING)]
Name = Annotated[str, Field(min_length=1, max_length=1000, pattern=r"^\P{Cc}*$")]
RunName = Annotated[
    str, Field(max_length=200, pattern=r"^[^@\s\p{Cc}]([^@\p{Cc}]*[^@\s\p{Cc}])?$")
]  # offset@run is how a diagnosis names a value of one run


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Entry(_Part):
    """A ``[[run]]`` as written."""

    name: RunName
    file: Name
    part: Annotated[int, Field(ge=1, le=10_000)] | None = None  # of a file whose clock starts again, from 1
    drive_speed: Number | None = None
    drive_angle: Number | None = None
    drive: Literal["measured", "free", "torque"] | None = None
    start: Mapping[str, Number] | None = None
    loads: Annotated[tuple[Load, ...] | None, BeforeValidator(_as_tuple), Field(alias="load")] = None
    noise: Mapping[str, Annotated[float, Field(gt=0, lt=LARGEST_READING)]] = Field(default_factory=dict)
    from_rest: bool = False
    role: Literal["fit", "validation"] = "fit"
    columns: Mapping[str, Meaning] = Field(default_factory=dict)  # of its file alone


class Said(Layout):
    """What is said of measured data, wherever they are; how data files are written is said at the top."""

    tolerance: Mapping[str, NotNegative | Mapping[str, NotNegative]] = Field(default_factory=dict)
    prior: Mapping[str, Annotated[float, Field(gt=0, lt=LARGEST_READING)]] = Field(default_factory=dict)
    sensors: Annotated[tuple[Sensor, ...], BeforeValidator(_as_tuple), Field(alias="sensor")] = ()
    runs: Annotated[tuple[Entry, ...], BeforeValidator(_as_tuple), Field(alias="run", min_length=1)]
    context: ContextTable | None = None


class MeasuredFile(Said):
    """measured.toml as written."""

    mechanism: Name


S = TypeVar("S", bound=Said)


def read_file(path: Path) -> MeasuredFile:
    """The file's fields, checked one by one.  Raises MeasuredError."""
    try:
        fields = read_toml(path)
    except ReadingError as error:
        raise MeasuredError(f"{path}: {error}; give a measured.toml") from None
    name = fields.get("mechanism")
    mechanism = cache(lambda: nominal(path, str(name)))
    return checked(path.name, fields, MeasuredFile, mechanism if isinstance(name, str) else None, path.parent)


def nominal(path: Path, name: str) -> Mechanism:
    """The mechanism that a measured.toml names: a file relative to it, or a shipped case.  Raises MeasuredError."""
    file = path.parent / name
    try:
        return load(file if file.is_file() or name not in shipped_cases() else name)
    except OSError as error:
        raise MeasuredError(
            f"{path.name}: mechanism = {shown(name)} cannot be read ({error.strerror}); check the path"
        ) from None
    except MechanismError as error:
        raise MeasuredError(f"{path.name}: mechanism = {name!r}: {error}") from None


def checked(
    source: str,
    fields: Mapping[str, object],
    model: type[S],
    mechanism: Callable[[], Mechanism] | None,
    folder: Path | None,
) -> S:
    """Fields as written, checked one by one; the ``mechanism`` is made where a unit is that of its signal, and tables
    of loads are files in a ``folder``.  Raises MeasuredError.
    """

    def unit_of(name: str) -> SiUnit | None:
        if mechanism is None:
            return None
        read = readable(m := mechanism()).get(canonical(name, m)) or m.load_quantities.get(name)
        return None if read is None else read.unit

    try:
        if "run" in fields:
            fields = {**fields, "run": runs_in_si(fields["run"], unit_of, folder)}
        if "sensor" in fields:
            fields = {**fields, "sensor": sensors_in_si(fields["sensor"])}
        if "tolerance" in fields:
            fields = {**fields, "tolerance": tolerance_in_si(fields["tolerance"])}
        return model.model_validate(fields)
    except (UnitError, ReadingError) as error:
        raise MeasuredError(f"{source}: {error}") from None
    except ValidationError as error:
        raise MeasuredError(f"{source}: {_described(error, fields, model)}") from None


def _described(error: ValidationError, fields: Mapping[str, object], model: type[Said]) -> str:
    """Its faults in a line of a length that can be read."""
    try:
        text = "; ".join(describe(error, fields, model))
    except ValueError:  # Python's limit on the digits that it prints
        return DIGITS
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return text if len(text) <= LINE else f"{text[: LINE // 2]} ... {text[-LINE // 2 :]}"


def tolerance_in_si(given: object, within: str = "") -> object:
    """``[tolerance]`` in SI; what has several units, such as a stiffness, is in the one that fits.  Raises UnitError,
    which names the field.
    """
    if not isinstance(given, Mapping):
        return given
    out: dict[object, object] = dict(given)
    for name, value in given.items():
        key = f"{within}{name}"
        if isinstance(value, str):
            units = [p.unit for effect, p in PARAMETERS if key in (f"{effect}.{p.name}", p.name, p.quantity)]
            try:
                out[name] = number(value, *dict.fromkeys(unit for unit in units if unit)) if any(units) else value
            except UnitError as error:
                raise UnitError(f"tolerance.{key} = {value!r} has {error}") from None
        elif not within:
            out[name] = tolerance_in_si(value, f"{key}.")
    return out


def tolerances(source: str, given: Mapping[str, float | Mapping[str, float]]) -> dict[str, float]:
    """Tolerances (SI) by quantity, parameter or effect.parameter; ``effect = { parameter = x }`` is
    ``"effect.parameter" = x``.

    Raises MeasuredError for a key that is none of them.
    """
    flat: dict[str, float] = {}
    for key, value in given.items():
        flat |= {f"{key}.{k}": v for k, v in value.items()} if isinstance(value, Mapping) else {key: value}
    quantities = dict.fromkeys([*QUANTITIES, *(p.quantity for _, p in PARAMETERS)])
    known = [*quantities, *(p.name for _, p in PARAMETERS), *(f"{effect}.{p.name}" for effect, p in PARAMETERS)]
    for key in flat:
        if key not in known:
            close = difflib.get_close_matches(key, known, n=1)
            remedy = (
                f"did you mean {close[0]!r}"
                if close
                else f"use a quantity ({', '.join(quantities)}), a parameter or effect.parameter"
            )
            raise MeasuredError(
                f"{source}: tolerance.{key} is neither a quantity nor a parameter of an effect; {remedy}"
            )
        meant = [(effect, p) for effect, p in PARAMETERS if key in (f"{effect}.{p.name}", p.name, p.quantity)]
        if flat[key] and meant and not any(VOCABULARY[effect].blames(p.name) for effect, p in meant):
            raise MeasuredError(
                f"{source}: tolerance.{key} = {flat[key]:g} bounds nothing; give 0 to rule {meant[0][0]} out, or leave"
                " it out"
            )
    return flat
