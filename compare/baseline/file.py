"""A baseline file, one for each case and engine: TOML to be reviewed line by line."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, JsonValue, ValidationError

from analytic.mechanism.errors import describe
from analytic.mechanism.reading import ReadingError, parse_toml, read_text, read_toml
from compare.faults import OptionError

PLACE_COLUMNS = ("crank_angle [deg]", "time [s]")
# all other columns are places, and signals on request and sensors, which are judged each by itself
_OF_PINS = re.compile(
    r"reaction_.*_(angle \[deg\]|(magnitude|rms|peak) \[N\])|free_share_.* \[1\]|impacts_.* \[per turn\]"
)
UNDIRECTED = 0.02  # of a joint's peak force, below which its direction is left open (nan)


class BaselineError(OptionError):
    """A baseline file is missing, damaged or of another case; the message says what to do."""


@dataclass(frozen=True)
class StoredRun:
    """One run's table: ``rows`` (N, columns), or why there is none.  A column's unit is in its name; NaN is no
    direction.
    """

    name: str
    added: Mapping[str, JsonValue] = field(default_factory=dict)  # what the run has that its case has not
    columns: tuple[str, ...] = ()
    rows: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    skipped: str = ""

    @property
    def places(self) -> np.ndarray | None:
        """Where the rows are: crank angle (deg) or time (s); None for averages over the run."""
        return self.rows[:, 0] if self.columns and self.columns[0] in PLACE_COLUMNS else None


class _BaselinePart(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


_Limit = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class MovedLimits(_BaselinePart):
    """How far a number may be from the baseline's before it has moved."""

    angle: _Limit = 0.005  # deg; half of what must be seen
    magnitude: _Limit = 1e-4  # of the joint's largest force in the run; of any other signal but an angle by itself
    rms: _Limit = 0.15  # of the stored value, of averages but a share; other roundings spread them by 0.02 (1 sigma)
    free_share: _Limit = 0.25  # of time; other roundings spread it by 0.04 (1 sigma)


@dataclass(frozen=True)
class Baseline:
    """The content of a file."""

    case: str
    simulator: str
    version: str
    runs: tuple[StoredRun, ...]
    tolerance: MovedLimits = field(default_factory=MovedLimits)
    linkage: Mapping[str, JsonValue] = field(default_factory=dict)  # what its file says, by dotted names; of old: none


class _BaselineRun(_BaselinePart):
    name: str
    added: dict[str, JsonValue] = {}
    skipped: str = ""
    columns: list[str] = []
    rows: list[list[float]] = []


class _BaselineFile(_BaselinePart):
    format: Literal[1] = Field(alias="schema")
    case: str
    simulator: str
    version: str
    tolerance: MovedLimits
    linkage: dict[str, JsonValue] = {}
    runs: list[_BaselineRun] = Field(alias="run", min_length=1)


def owned(path: Path, case: str, simulator: str) -> None:
    """Refuse a file that says it is another baseline, be the rest of it damaged: its name is also this one's.  Raises
    BaselineError.
    """
    try:
        text = read_text(path)
    except ReadingError:
        return
    names = tuple(_named_in(text, name) for name in ("case", "simulator"))
    for mine, other in zip((case, simulator), names, strict=True):
        if other not in (mine, None):
            raise BaselineError(f"{path}: {_of_another(names[0] or case, names[1] or simulator, case, simulator)}")


def _named_in(text: str, name: str) -> str | None:
    """The value that a line of a file gives to this name; None where it gives none."""
    line = re.search(rf"(?m)^{name} *=.*$", text)
    try:
        return str(parse_toml(line[0])[name]) if line else None
    except ReadingError:
        return None


def _of_another(its_case: str, its_simulator: str, case: str, simulator: str) -> str:
    remedy = "both would have this file, so rename one of them, or keep this one in another folder with --baselines"
    return f"is the baseline of {its_case!r} in {its_simulator}, not of {case!r} in {simulator}; {remedy}"


def read(path: Path, case: str, simulator: str, again: str) -> Baseline:
    """The baseline of a case in an engine; ``again`` is the command that writes it anew.  Raises BaselineError."""
    remedy = f"write it with: {again}"
    if not os.path.exists(path):
        raise BaselineError(f"{path}: there is no such baseline; {remedy}")
    try:
        fields = read_toml(path)
    except ReadingError as error:
        raise BaselineError(f"{path}: {error}; restore it, or {remedy}") from None
    try:
        file = _BaselineFile.model_validate(fields)
    except ValidationError as error:
        raise BaselineError(
            f"{path}: {'; '.join(describe(error, fields, _BaselineFile))}; restore it, or {remedy}"
        ) from None
    if (file.case, file.simulator) != (case, simulator):
        raise BaselineError(f"{path}: {_of_another(file.case, file.simulator, case, simulator)}")
    faults = [f"run {run.name!r} {fault}" for run in file.runs for fault in _faults(run)]
    if faults:
        raise BaselineError(f"{path}: {faults[0]}; restore it, or {remedy}")
    runs = tuple(
        StoredRun(
            r.name, r.added, tuple(r.columns), np.array(r.rows, float).reshape(len(r.rows), len(r.columns)), r.skipped
        )
        for r in file.runs
    )
    return Baseline(case, simulator, file.version, runs, file.tolerance, file.linkage)


def _faults(run: _BaselineRun) -> Iterator[str]:
    """Faults of a run's table, a sentence each."""
    if not run.rows and not run.skipped:
        yield "has neither rows nor a reason ('skipped')"
    for k, row in enumerate(run.rows, 1):
        if len(row) != len(run.columns):
            yield f"has {len(row)} numbers for {len(run.columns)} columns in row {k}"
        for name, value in zip(run.columns, row, strict=False):
            if not math.isfinite(value) and not (math.isnan(value) and name.endswith("_angle [deg]")):
                yield f"has {name} = {value} in row {k}, which is no number"


def write(baseline: Baseline, check: str) -> str:
    """The text of a baseline file: a line for each crank angle, in aligned columns; ``check`` is the command that
    checks it.
    """
    t = baseline.tolerance
    lines = [
        f"# Reaction forces of {baseline.case} in {baseline.simulator}.",
        f"# To check them: {printable(check)}",
        (
            "# Written by `compare baseline update`.  A number that changes here is a force that moved: the change"
            " wants a reason."
        ),
        "schema = 1",
        f"case = {_string(baseline.case)}",
        f"simulator = {_string(baseline.simulator)}",
        f"version = {_string(baseline.version)}",
        "",
        "[tolerance]",
        f"angle = {t.angle:<10}     # deg",
        f"magnitude = {t.magnitude:<10} # of the joint's largest force in the run",
        f"rms = {t.rms:<10}       # of the stored value",
        f"free_share = {t.free_share}",
    ]
    if baseline.linkage:
        lines += ["", "[linkage] # whose forces these are, SI units"]
        lines += [f"{_string(name)} = {inline(value)}" for name, value in baseline.linkage.items()]
    for run in baseline.runs:
        lines += ["", "[[run]]", f"name = {_string(run.name)}"]
        if run.added:
            lines.append(f"added = {inline(run.added)}  # to the case, SI units")
        lines += (
            [f"skipped = {_string(run.skipped)}"]
            if run.skipped
            else [f"columns = {inline(run.columns)}", "rows = [", *_rows(run), "]"]
        )
    return "\n".join(lines) + "\n"


def _rows(run: StoredRun) -> list[str]:
    cells = [
        [_number(value, digits) for value in column] for column, digits in zip(run.rows.T, _decimals(run), strict=True)
    ]
    if run.places is not None:
        cells[0] = [f"{round(place, 6):.8g}" for place in run.places]
    widths = [max(map(len, column)) for column in cells]
    return [
        "  [" + ", ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) + "],"
        for row in zip(*cells, strict=True)
    ]


def by_itself(column: str) -> bool:
    """Whether a column is of a signal beside the reactions, whose own size is its scale."""
    return column not in PLACE_COLUMNS and not _OF_PINS.fullmatch(column)


def _decimals(run: StoredRun) -> list[int]:
    """Digits after the point, by column: 1e-4 deg, and the sixth digit of the run's largest force, or of what else the
    column has.
    """
    forces = [j for j, name in enumerate(run.columns) if name.endswith("[N]")]
    largest = dict.fromkeys(forces, float(np.max(run.rows[:, forces], initial=0.0)))
    alone = [j for j, name in enumerate(run.columns) if by_itself(name)]
    largest |= {j: float(np.max(np.abs(run.rows[:, j]))) for j in alone}
    return [max(0, 5 - math.floor(math.log10(largest[j]))) if largest.get(j) else 4 for j in range(len(run.columns))]


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace(
        "\x7f", "\\u007f"
    )  # but for this a JSON string is a TOML basic string


def printable(text: str) -> str:
    """Text that stays in its line of comment."""
    return "".join(c if c.isprintable() else _string(c)[1:-1] if c < " " else " " for c in text)


def inline(value: JsonValue | Sequence[JsonValue] | Mapping[str, JsonValue]) -> str:
    """A value as TOML, in one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {inline(item)}" for key, item in value.items()) + " }"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(map(inline, value)) + "]"
    return _string(value) if isinstance(value, str) else json.dumps(value) if isinstance(value, bool) else repr(value)
