"""Tolerance files: the shipped one, a user's laid over it, and the differences that are declared as known.

``tolerances.toml`` says what each field means.  Every fault of a file is a :class:`ToleranceError`: file, field, value,
remedy.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, create_model, model_validator

from analytic.errors import Error
from analytic.mechanism import Mechanism
from analytic.mechanism.errors import describe
from analytic.mechanism.reading import ReadingError, read_toml
from analytic.mechanism.units import UnitError
from analytic.mechanism.written import number
from analytic.paper.clearance import Model
from compare.judge.signals import LINE_OF, ToleranceKind, compared
from compare.results.contact import STATISTICS, UNITS, StatisticName
from sim_models.engine import ENGINES, JOINT_MODELS, MOTIONS, JointModel, Motion, scheme_of

Allowance = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, lt=1)]
NonEmptyText = Annotated[str, Field(min_length=1)]
Several = BeforeValidator(
    lambda value: (value,) if isinstance(value, str) else tuple(value) if isinstance(value, list) else value
)
SCALARS = ("floor", "noise", "rest")
UNITS_OF: Mapping[str, tuple[str, ...]] = {  # a line's; of one for signals of several units each of these
    "angle": ("rad",), "magnitude": ("N",), "displacement": ("m",), "rotation": ("rad",), "torque": ("N.m", "N", "W"),
    "position": ("rad",), "place": ("m",), "velocity": ("rad/s", "m/s"), "acceleration": ("m/s^2", "rad/s^2"),
    **{name: (unit,) for name, unit in UNITS.items()},
}  # fmt: skip


class ToleranceError(Error, ValueError):
    """A tolerance file cannot be used; the message says why."""


class _TolerancePart(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Line(_TolerancePart):
    """What one kind of signal may differ by: ``absolute`` in its SI unit, ``relative`` to its peak, ``window`` in rad
    of crank angle.
    """

    absolute: Allowance = 0.0
    relative: Allowance = 0.0
    window: Annotated[float, Field(ge=0, le=0.0175)] = 0.0  # a degree is no longer a matter of timing

    @model_validator(mode="after")
    def _says_something(self) -> Line:
        if not self.model_fields_set & {"absolute", "relative"}:
            raise ValueError("give absolute, relative, or both")
        return self


def _table(name: str, fields: Iterable[str], value: type[BaseModel]) -> type[_TolerancePart]:
    """The model of a file's table with these fields, each of which may be left out."""
    optional: dict[str, Any] = {
        field.replace("-", "_"): (value | None, Field(default=None, alias=field)) for field in fields
    }
    return create_model(name, __base__=_TolerancePart, **optional)


_Lines = _table("_Lines", (kind for kind in get_args(ToleranceKind) if kind not in LINE_OF), Line)
_Models = _table("_Models", JOINT_MODELS, _Lines)
_Statistics = _table("_Statistics", STATISTICS, Line)


class Known(_TolerancePart):
    """A difference that is there for a stated reason: it must exceed the ordinary tolerance and stay within ``bound``.

    ``bound`` is in the signal's SI unit.  The selectors take one name or several; one that is left out holds for all.
    """

    case: NonEmptyText
    signal: NonEmptyText
    reason: NonEmptyText
    bound: Annotated[float, Field(gt=0)] | str  # with its unit, which :func:`checked_known` reads
    simulator: Annotated[tuple[NonEmptyText, ...], Several] = ()
    joint_model: Annotated[tuple[JointModel, ...], Several] = ()
    motion: Annotated[tuple[Motion, ...], Several] = ()
    analytic_model: Annotated[tuple[Model, ...], Several] = ()

    @property
    def largest(self) -> float:
        """The bound in SI."""
        return float(self.bound)

    def applies(self, case: str, **run: str) -> bool:
        """Whether this is about a run of that case with these selectors."""
        return case == self.case and all(
            not getattr(self, name) or value in getattr(self, name) for name, value in run.items()
        )


class _ToleranceFile(_TolerancePart):
    floor: Fraction | None = None
    noise: Fraction | None = None
    rest: Allowance | None = None
    static: _Models | None = None  # type: ignore[valid-type]
    driven: _Models | None = None  # type: ignore[valid-type]
    statistics: _Statistics | None = None  # type: ignore[valid-type]
    known: list[Known] = []


class Tolerances(_TolerancePart):
    """What every kind of signal of every run may differ by; ``known`` are differences that are declared."""

    floor: Fraction
    noise: Fraction
    rest: Allowance
    static: Mapping[JointModel, Mapping[ToleranceKind, Line]]
    driven: Mapping[JointModel, Mapping[ToleranceKind, Line]]
    statistics: Mapping[StatisticName, Line] = {}
    known: Annotated[tuple[Known, ...], Several] = ()

    def line(self, motion: Motion, joint_model: JointModel, kind: ToleranceKind) -> Line:
        """The line of a kind of signal in a run.  Raises ToleranceError where there is none."""
        lines = self.static if motion == "static" else self.driven
        try:
            return lines[joint_model][kind]
        except KeyError as error:
            place = f"{motion}.{joint_model}.{kind}"
            raise ToleranceError(f"the tolerance file has no {error.args[0]!r} (looking for {place}); add it") from None

    def only(self, motion: Motion, joint_model: JointModel) -> Tolerances:
        """Those of one joint model and motion, without the known differences: all that one run depends on."""
        lines = self.static if motion == "static" else self.driven
        here = {joint_model: lines[joint_model]} if joint_model in lines else {}
        sides = {"static": here if motion == "static" else {}, "driven": here if motion == "driven" else {}}
        return self.model_copy(update=sides | {"known": ()})


def load_tolerances(path: Path | None = None, called: str = "--tolerance") -> Tolerances:
    """The shipped tolerances, with a file's laid over them.  Raises ToleranceError, which calls the file's option or
    argument as ``called`` says.

    A line that the file gives replaces the shipped line whole, and its known differences come after the shipped ones.
    """
    with resources.as_file(resources.files("compare.judge").joinpath("tolerances.toml")) as file:
        shipped = _read(file, "compare/judge/tolerances.toml")
    return _joined(shipped, _read(path, f"{called} {path}") if path else _ToleranceFile())


def _read(path: Path, name: str) -> _ToleranceFile:
    try:
        fields = read_toml(path)
    except ReadingError as error:
        raise ToleranceError(f"{name}: {error}; give a TOML file like compare/judge/tolerances.toml") from None
    try:
        checked = _ToleranceFile.model_validate(_in_si(fields, ""))
    except UnitError as error:
        raise ToleranceError(f"{name}: {error}") from None
    except ValidationError as error:
        raise ToleranceError(f"{name}: {'; '.join(describe(error, fields, _ToleranceFile))}") from None
    for i, known in enumerate(checked.known):
        for simulator in known.simulator:
            if simulator not in ENGINES and not scheme_of(simulator)[0]:
                raise ToleranceError(
                    f"{name}: known[{i}].simulator = {simulator!r}: there is no such simulator; they are"
                    f" {', '.join(ENGINES)}"
                )
    return checked


def _in_si(table: Mapping[str, object], where: str, units: tuple[str, ...] = ()) -> dict[str, object]:
    """A table of the file, its numbers that are written with a unit in SI.  Raises UnitError, which names the field."""
    out = dict(table)
    own = {"absolute": units, "window": ("rad",), "rest": ("m/s^2",)}
    for name, value in table.items():
        if isinstance(value, Mapping):
            out[name] = _in_si(value, f"{where}{name}.", UNITS_OF.get(name, ()))
        elif isinstance(value, str) and own.get(name):
            out[name] = _number(f"{where}{name}", value, *own[name])
    return out


def _number(where: str, given: float | str, *units: str) -> float:
    try:
        return number(given, *units)
    except UnitError as error:
        raise UnitError(f"{where} = {given!r} has {error}") from None


def _joined(shipped: _ToleranceFile, over: _ToleranceFile) -> Tolerances:
    numbers = {
        name: value if (value := getattr(over, name)) is not None else getattr(shipped, name) for name in SCALARS
    }
    lines = {motion: {**_lines(getattr(shipped, motion))} for motion in MOTIONS}
    for motion in MOTIONS:
        for model, given in _lines(getattr(over, motion)).items():
            lines[motion][model] = {**lines[motion].get(model, {}), **given}
    tables: list[BaseModel | None] = [shipped.statistics, over.statistics]
    statistics = {name: getattr(table, name) for table in tables if table for name in table.model_fields_set}
    known = (*shipped.known, *over.known)
    return Tolerances.model_validate({**numbers, **lines, "statistics": statistics, "known": known})


def _lines(models: BaseModel | None) -> dict[str, dict[str, Line]]:
    """The lines of a motion that a file gives, by joint model and kind."""
    return {
        name.replace("_", "-"): {kind: getattr(lines, kind) for kind in lines.model_fields_set}
        for name in (models.model_fields_set if models else ())
        if (lines := getattr(models, name)) is not None
    }


def known_differences(
    tolerances: Tolerances, case: str, simulator: str, joint_model: str, motion: str, analytic_model: str
) -> dict[str, Known]:
    """Known differences of a run by signal; where several are about the same one, the last counts."""
    run = {"simulator": simulator, "joint_model": joint_model, "motion": motion, "analytic_model": analytic_model}
    return {known.signal: known for known in tolerances.known if known.applies(case, **run)}


def checked_known(tolerances: Tolerances, mechanism: Mechanism) -> Tolerances:
    """The same with the bounds of known differences of this case in SI.  Raises ToleranceError for one whose signal is
    never compared, or whose bound is in no unit of it.
    """
    every = (*compared(mechanism, ()), *compared(mechanism, mechanism.may_be_loose))
    signals = {signal.name: signal for signal in every}
    known = []
    for i, each in enumerate(tolerances.known):
        if each.case == mechanism.name and each.signal not in signals:
            raise ToleranceError(
                f"tolerance file: known.signal = {each.signal!r} is not compared in {mechanism.name}; the signals are"
                f" {', '.join(signals)}"
            )
        if each.case == mechanism.name and isinstance(each.bound, str):
            try:
                bound = _number(f"known[{i}].bound", each.bound, signals[each.signal].unit)
            except UnitError as error:
                raise ToleranceError(f"tolerance file: {error}") from None
            if bound <= 0:
                raise ToleranceError(f"tolerance file: known[{i}].bound = {each.bound!r}; give more than 0")
            each = each.model_copy(update={"bound": bound})
        known.append(each)
    return tolerances.model_copy(update={"known": tuple(known)})
