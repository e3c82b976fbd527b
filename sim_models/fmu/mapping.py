"""The map of an FMU: which of its variables drive the linkage, and which are its signals.

    step = 1e-4                                 # s; left out: that of the FMU's default experiment
    [inputs]
    angle = "phi"                               # or { variable = "phi", unit = "deg", sign = -1, offset = 90 }
    speed = "omega"
    [columns]
    "R_B_x" = { signal = "reaction_B_x", unit = "N", sign = -1 }
    [parameters]
    "rod.m" = 0.21

With several drives, in place of ``[inputs]``, a table for each driven joint, of its position (second body on first):

    [drives.D]
    position = "phi1"
    speed = "omega1"

For an input as for a column, ``sign * scale * number + offset`` in ``unit`` is the quantity here.  Without a unit that
of the FMU holds, and SI where it has none.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import BeforeValidator, Field

from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.columns import ColumnMeaning, Conversion, MapPart, read_map
from analytic.mechanism.one_line import shown
from analytic.mechanism.signals import named
from analytic.mechanism.units import DIMENSIONS, SI, QuantityKind, UnitError, factor
from sim_models.fmu.description import REAL_KINDS, Fmu, FmuError, Variable

Moved = Literal["position", "speed", "acceleration", "start"]
Value = bool | int | float | str
Units = Mapping[str, float]  # of what no sensor reads, with their factors
MOVED_DIMENSIONS: Mapping[Moved, QuantityKind | Units] = {
    "position": "angle",
    "speed": "angular velocity",
    "acceleration": {"rad/s2": 1.0, "rad/s^2": 1.0, "deg/s2": math.radians(1.0), "deg/s^2": math.radians(1.0)},
    "start": "angle",
}
SLIDES: Mapping[Moved, QuantityKind | Units] = {
    "position": "length",
    "speed": {"m/s": 1.0, "mm/s": 1e-3},
    "acceleration": {"m/s2": 1.0, "m/s^2": 1.0, "mm/s2": 1e-3, "mm/s^2": 1e-3},
    "start": "length",
}
VARIABLES_LISTED = 30  # variables that a message lists


class Driven(Conversion):
    """A variable that the drive gives its value, and how its numbers are the quantity."""

    variable: Annotated[str, Field(min_length=1)]


def _named(given: Any) -> Any:
    return {"variable": given} if isinstance(given, str) else given


Input = Annotated[Driven, BeforeValidator(_named)]


class Inputs(MapPart):
    """The variables that say how the crank moves, as the driven body's angle and its rates."""

    angle: Input | None = None
    speed: Input | None = None
    acceleration: Input | None = None
    start_angle: Input | None = None


class Position(MapPart):
    """The variables that say how one of several driven joints moves: its second body on its first (rad, or m)."""

    position: Input | None = None
    speed: Input | None = None
    acceleration: Input | None = None
    start_position: Input | None = None


class MapFile(MapPart):
    """A map as it stands in its file.  ``step`` (s) is between communication points at most, ``lead_in`` (rad) how far
    the crank turns before its first angle.
    """

    inputs: Inputs | None = None
    drives: Mapping[str, Position] = {}
    columns: Annotated[Mapping[str, ColumnMeaning | Literal["ignore"]], Field(min_length=1)]
    parameters: Mapping[str, Value] = {}
    step: Annotated[float, Field(gt=0)] | None = None
    lead_in: Annotated[float, Field(ge=0, le=1e4)] = 0.0


@dataclass(frozen=True)
class MappedVariable:
    """A variable, and how its numbers are made SI: ``factor * (slope * number + offset)``."""

    variable: Variable
    slope: float
    offset: float
    factor: float

    def si(self, numbers: np.ndarray) -> np.ndarray:
        """Numbers (N,) of the FMU in SI."""
        return np.asarray(self.factor * (self.slope * numbers + self.offset))

    def number(self, si: np.ndarray) -> np.ndarray:
        """What the FMU is told (N,) for values in SI."""
        return np.asarray((si / self.factor - self.offset) / self.slope)


@dataclass(frozen=True)
class Map:
    """A map whose variables the FMU has; its columns and several drives wait for a mechanism (:meth:`signals`,
    :meth:`drives`).
    """

    fmu: Fmu
    path: Path
    file: MapFile
    inputs: Mapping[Moved, MappedVariable]  # of a crank
    parameters: tuple[tuple[Variable, Value], ...]

    @property
    def step(self) -> float | None:
        """Time (s) between communication points at most, if it is given."""
        return self.file.step or self.fmu.step

    def drives(self, mechanism: Mechanism, joints: Iterable[str]) -> dict[str, Mapping[Moved, MappedVariable]]:
        """The inputs of each of these driven joints of a mechanism.  Raises FmuError."""
        drives: dict[str, Mapping[Moved, MappedVariable]] = {}
        known = [joint.name for joint in mechanism.joints]
        for name in self.file.drives:
            if name not in known:
                why = f"{mechanism.name} has no such joint; they are {', '.join(known)}"
                raise FmuError(f"{self.path}: drives.{shown(name)}: {why}")
        for name in joints:
            if name not in self.file.drives:
                named = ", ".join(self.file.drives) or "no driven joint"
                why = f"{self.path}: drives: tells the FMU of {named}, but {mechanism.name} is driven in {name} too"
                raise FmuError(f"{why}; give [drives.{name}] with its position")
            kinds = SLIDES if mechanism.joint(name).prismatic else MOVED_DIMENSIONS
            drives[name] = _links(self.fmu, self.path, f"drives.{name}", _told(self.file.drives[name]), kinds)
        for name in self.file.drives:
            if name not in drives:
                driven = ", ".join(drives) or "no joint"
                raise FmuError(
                    f"{self.path}: drives.{shown(name)}: {mechanism.name} is driven in {driven}; leave it out"
                )
        return drives

    def signals(self, mechanism: Mechanism) -> dict[str, MappedVariable]:
        """Which variable is which signal of a mechanism.  Raises FmuError."""
        known = named(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)
        links: dict[str, MappedVariable] = {}
        for column, meaning in self.file.columns.items():
            if meaning == "ignore":
                continue
            where = f"{self.path}: columns.{shown(column)}"
            if meaning.frame not in (None, GROUND):
                raise FmuError(f"{where}: frame is of recorded columns; give the output of the ground's frame")
            if meaning.signal is None:
                raise FmuError(f"{where}: load is of recorded columns, and an FMU acts by itself; give its signal")
            if meaning.signal not in known:
                raise FmuError(
                    f"{where}: signal {shown(meaning.signal)} is none of {mechanism.name};"
                    f" {_hint(meaning.signal, known, 'its signals')}"
                )
            if meaning.signal in links:
                raise FmuError(f'{where}: signal {meaning.signal} has two columns; set one of them to "ignore"')
            signal, variable = known[meaning.signal], _variable(self.fmu, column, where)
            scale = _factor(where, meaning.unit, variable, DIMENSIONS[signal.unit])
            links[signal.name] = MappedVariable(variable, meaning.sign * meaning.scale, meaning.offset, scale)
        if not links:
            raise FmuError(f"{self.path}: columns: each of them is ignored; give at least one a signal")
        return links


def beside(fmu: Path) -> Path:
    """Where the map of an FMU is looked for: ``linkage.map.toml`` for ``linkage.fmu``."""
    return fmu.with_name(f"{fmu.stem}.map.toml")


def mapped(fmu: Fmu, path: Path) -> Map:
    """The map of an FMU.  Raises MapError for the file and FmuError for what the FMU does not have."""
    if not path.exists():
        raise FmuError(
            f'{path}: there is no such map; write one with [inputs] angle = "..." or speed = "..." (with several drives'
            ' for each a table [drives.<joint>] with its position = "..."), and [columns] "..."'
            f' = {{ signal = "reaction_B_x", unit = "N" }} (or name it with --map): the inputs of {fmu.path.name}'
            f" are {_listed(fmu.named('input'))}; its outputs {_listed(fmu.named('output'))}; its parameters"
            f" {_listed(fmu.named('parameter'))}"
        )
    file = read_map(path, MapFile)
    inputs = _inputs(fmu, path, file)
    for column, meaning in file.columns.items():
        if meaning != "ignore":
            _variable(fmu, column, f"{path}: columns.{shown(column)}")
    return Map(fmu, path, file, inputs, tuple(_parameters(fmu, path, file.parameters)))


def _inputs(fmu: Fmu, path: Path, file: MapFile) -> dict[Moved, MappedVariable]:
    """The inputs of a crank; of several drives none, but each is told where it is.  Raises FmuError."""
    if file.inputs is not None and file.drives:
        raise FmuError(f"{path}: has [inputs], of a crank, and [drives], of several; leave one of them out")
    inputs = {} if file.inputs is None else _links(fmu, path, "inputs", _told(file.inputs), MOVED_DIMENSIONS)
    if not file.drives and "position" not in inputs and not {"speed", "start"} <= set(inputs):
        raise FmuError(
            f"{path}: inputs: the FMU is not told where its crank is; give angle, or speed with start_angle, the"
            " variable that is its angle at the start"
        )
    taken: dict[str, str] = {}
    for name, drive in file.drives.items():
        given = _told(drive)
        if "position" not in given and not {"speed", "start"} <= set(given):
            raise FmuError(
                f"{path}: drives.{shown(name)}: the FMU is not told where it is; give position, or speed with"
                " start_position, the variable that is its position at the start"
            )
        for field, each in given.values():
            where = f"drives.{name}.{field}"
            _input(fmu, f"{path}: {where}", each.variable, field)
            if taken.setdefault(each.variable, where) != where:
                other = taken[each.variable]
                raise FmuError(
                    f"{path}: {where}: {shown(each.variable)} is that of {other} already; give each its own variable"
                )
    return inputs


def _told(given: Inputs | Position) -> dict[Moved, tuple[str, Driven]]:
    """What is given of a drive, each with the name of its field."""
    names: Mapping[str, Moved] = {"angle": "position", "start_angle": "start", "start_position": "start"}
    driven_by: dict[Moved, tuple[str, Driven]] = {}
    for field in type(given).model_fields:
        driven = getattr(given, field)
        if driven is not None:
            driven_by[names.get(field, cast("Moved", field))] = field, driven
    return driven_by


def _links(
    fmu: Fmu,
    path: Path,
    table: str,
    given: Mapping[Moved, tuple[str, Driven]],
    kinds: Mapping[Moved, QuantityKind | Units],
) -> dict[Moved, MappedVariable]:
    """The variables of a drive.  Raises FmuError."""
    links: dict[Moved, MappedVariable] = {}
    taken: dict[str, str] = {}
    for name, (field, driven) in given.items():
        where = f"{path}: {table}.{field}"
        variable = _input(fmu, where, driven.variable, field)
        if variable.name in taken:
            other = f"{table}.{taken[variable.name]}"
            raise FmuError(f"{where}: {shown(variable.name)} is that of {other} already; give each its own variable")
        taken[variable.name] = field
        scale = _factor(where, driven.unit, variable, kinds[name])
        links[name] = MappedVariable(variable, driven.sign * driven.scale, driven.offset, scale)
    return links


def _input(fmu: Fmu, where: str, name: str, field: str) -> Variable:
    """A variable that a drive sets: an input, but for where it starts.  Raises FmuError."""
    variable = _variable(fmu, name, where)
    if not field.startswith("start") and variable.causality != "input":
        hint = f"its inputs are {_listed(fmu.named('input'))}"
        raise FmuError(
            f"{where}: {shown(variable.name)} is no input of {fmu.path.name}, but {variable.causality}; {hint}"
        )
    return variable


def _parameters(fmu: Fmu, path: Path, given: Mapping[str, Value]) -> Iterator[tuple[Variable, Value]]:
    for name, value in given.items():
        where = f"{path}: parameters.{shown(name)}"
        variable = _known(fmu, name, where)
        wanted: tuple[type, ...] = (int,)
        if variable.kind in ("Real", "Float64", "Float32"):
            wanted = (int, float)
        elif variable.kind in ("Boolean", "String"):
            wanted = (bool,) if variable.kind == "Boolean" else (str,)
        if not isinstance(value, wanted) or (isinstance(value, bool) and bool not in wanted):
            raise FmuError(f"{where} = {shown(str(value))}: it is of kind {variable.kind}; give such a value")
        yield variable, value


def _variable(fmu: Fmu, name: str, where: str) -> Variable:
    """A variable that is a number.  Raises FmuError."""
    variable = _known(fmu, name, where)
    if variable.kind not in REAL_KINDS:
        raise FmuError(
            f"{where}: {shown(name)} of {fmu.path.name} is of kind {variable.kind}; give one that is Real or Float64"
        )
    return variable


def _known(fmu: Fmu, name: str, where: str) -> Variable:
    if name not in fmu.variables:
        hint = _hint(name, fmu.variables, "its variables")
        raise FmuError(f"{where}: {fmu.path.name} has no variable {shown(name)}; {hint}")
    return fmu.variables[name]


def _factor(where: str, given: str | None, variable: Variable, kind: QuantityKind | Units) -> float:
    """What a number of a variable is multiplied by to be SI, ``unit`` as given or as the FMU has it.  Raises
    FmuError.
    """
    if given is None:
        return _size(where, variable.unit, kind, f"{variable.name} of the FMU has") if variable.unit else 1.0
    size = _size(where, given, kind, "it has")
    declared = _declared(variable.unit, kind)
    if declared is not None and not math.isclose(declared, size, rel_tol=1e-9):
        raise FmuError(
            f"{where}: unit = {shown(given)}, but the FMU gives {variable.name} in {shown(variable.unit)}; leave"
            " unit out, or mend the FMU"
        )
    return size


def _declared(unit: str, kind: QuantityKind | Units) -> float | None:
    """The factor of a unit that an FMU declares: NaN if it is of another dimension, None if it says nothing here."""
    for each in (kind, *SI):
        try:
            size = _size("", unit, each, "")
        except FmuError:
            continue
        return size if each == kind else math.nan
    return None


def _size(where: str, unit: str, kind: QuantityKind | Units, said: str) -> float:
    if isinstance(kind, Mapping):
        if unit not in kind:
            accepted = " or ".join(each for each in kind if "^" not in each)
            raise FmuError(f"{where}: {said} unit {shown(unit)}; it is given in {accepted}")
        return kind[unit]
    try:
        return factor(unit, kind)
    except UnitError as error:
        raise FmuError(f"{where}: {said} {error}") from None


def _hint(name: str, known: Iterable[str], what: str) -> str:
    names = list(known)
    alike = [each for each in names if each.casefold() == name.casefold()]
    close = alike or difflib.get_close_matches(name, names, n=1)
    return f"did you mean {close[0]!r}" if close else f"{what} are {_listed(names)}"


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - VARIABLES_LISTED} more" if len(names) > VARIABLES_LISTED else ""
    return (", ".join(name[:80] for name in names[:VARIABLES_LISTED]) or "none") + more
