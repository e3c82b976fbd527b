"""A baseline file, one for each case and engine: TOML to be reviewed line by line, and what has moved against it."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from analytic.mechanism_file import describe
from compare.faults import OptionError

PLACES = ("crank_angle [deg]", "time [s]")
SAME_PLACE = 1e-6  # deg, s
WEAK = 1e-3  # of the run's largest force: the size of a weaker joint's is held to that
NO_DIRECTION = 0.02  # of a joint's peak force, below which its direction is left open (nan)


class BaselineError(OptionError):
    """A baseline file is missing, damaged or of another case; the message says what to do."""


@dataclass(frozen=True)
class Run:
    """One run's table: ``rows`` (N, columns), or why there is none.  A column's unit is in its name; NaN is no direction."""

    name: str
    added: Mapping[str, Any] = field(default_factory=dict)  # what the run has that its case has not
    columns: tuple[str, ...] = ()
    rows: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    skipped: str = ""

    @property
    def places(self) -> np.ndarray | None:
        """Where the rows are: crank angle (deg) or time (s); None for averages over the run."""
        return self.rows[:, 0] if self.columns and self.columns[0] in PLACES else None


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


Limit = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Tolerance(_Part):
    """How far a number may be from the baseline's before it has moved."""

    angle: Limit = 0.005  # deg; half of what must be seen
    magnitude: Limit = 1e-4  # of the joint's largest force in the run
    rms: Limit = 0.15  # of the stored value; runs whose starts differ in rounding spread by 0.02 (1 sigma)
    free_share: Limit = 0.25  # these by 0.04


@dataclass(frozen=True)
class Baseline:
    """The content of a file."""

    case: str
    simulator: str
    version: str
    runs: tuple[Run, ...]
    tolerance: Tolerance = field(default_factory=Tolerance)


class _Run(_Part):
    name: str
    added: dict[str, Any] = {}
    skipped: str = ""
    columns: list[str] = []
    rows: list[list[float]] = []


class _File(_Part):
    format: Literal[1] = Field(alias="schema")
    case: str
    simulator: str
    version: str
    tolerance: Tolerance
    runs: list[_Run] = Field(alias="run", min_length=1)


def read(path: Path, case: str, simulator: str) -> Baseline:
    """The baseline of a case in an engine.  Raises BaselineError."""
    remedy = f"write it with: compare baseline update --case {case} --simulator {simulator}"
    try:
        fields = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BaselineError(f"{path}: there is no such baseline; {remedy}") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BaselineError(f"{path}: cannot be read as TOML ({error}); restore it, or {remedy}") from None
    try:
        file = _File.model_validate(fields)
    except ValidationError as error:
        raise BaselineError(f"{path}: {'; '.join(describe(error, fields, _File))}; restore it, or {remedy}") from None
    if (file.case, file.simulator) != (case, simulator):
        raise BaselineError(f"{path}: is the baseline of {file.case} in {file.simulator}, not of {case} in {simulator}; restore it, or {remedy}")
    faults = [f"run {run.name!r} {fault}" for run in file.runs for fault in _faults(run)]
    if faults:
        raise BaselineError(f"{path}: {faults[0]}; restore it, or {remedy}")
    runs = tuple(Run(r.name, r.added, tuple(r.columns), np.array(r.rows, float).reshape(len(r.rows), len(r.columns)), r.skipped) for r in file.runs)
    return Baseline(case, simulator, file.version, runs, file.tolerance)


def _faults(run: _Run) -> Iterator[str]:
    """What a table cannot be."""
    if not run.rows and not run.skipped:
        yield "has neither rows nor a reason ('skipped')"
    for k, row in enumerate(run.rows, 1):
        if len(row) != len(run.columns):
            yield f"has {len(row)} numbers for {len(run.columns)} columns in row {k}"
        for name, value in zip(run.columns, row, strict=False):
            if not math.isfinite(value) and not (math.isnan(value) and name.endswith("_angle [deg]")):
                yield f"has {name} = {value} in row {k}, which is no number"


def write(baseline: Baseline) -> str:
    """The text of a baseline file: a line for each crank angle, in aligned columns."""
    t = baseline.tolerance
    lines = [
        f"# Reaction forces of {baseline.case} in {baseline.simulator}.",
        f"# To check them: compare baseline check --case {baseline.case} --simulator {baseline.simulator}",
        "# Written by `compare baseline update`.  A number that changes here is a force that moved: the change wants a reason.",
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
    for run in baseline.runs:
        lines += ["", "[[run]]", f"name = {_string(run.name)}"]
        if run.added:
            lines.append(f"added = {_inline(run.added)}  # to the case, SI units")
        lines += [f"skipped = {_string(run.skipped)}"] if run.skipped else [f"columns = {_inline(run.columns)}", "rows = [", *_rows(run), "]"]
    return "\n".join(lines) + "\n"


def _rows(run: Run) -> list[str]:
    cells = [[_number(value, digits) for value in column] for column, digits in zip(run.rows.T, _decimals(run), strict=True)]
    if run.places is not None:
        cells[0] = [f"{round(place, 6):.8g}" for place in run.places]
    widths = [max(map(len, column)) for column in cells]
    return ["  [" + ", ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) + "]," for row in zip(*cells, strict=True)]


def _decimals(run: Run) -> list[int]:
    """Digits after the point, by column: 1e-4 deg, and the sixth digit of the run's largest force."""
    forces = [j for j, name in enumerate(run.columns) if name.endswith("[N]")]
    largest = float(np.max(run.rows[:, forces], initial=0.0))
    return [max(0, 5 - math.floor(math.log10(largest))) if j in forces and largest else 4 for j in range(len(run.columns))]


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # a JSON string is a TOML basic string


def _inline(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + " }"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return _string(value) if isinstance(value, str) else repr(value)


# -------------------------------------------------------------------- what has moved


@dataclass(frozen=True)
class Moved:
    """A column that moved: by how much (signed, now minus baseline) where that is most of the tolerance, and where else."""

    run: str
    signal: str
    unit: str
    by: float
    was: float
    tolerance: float
    at: str
    count: int
    of: int

    def __str__(self) -> str:
        where = f" at {self.at}; moved at {self.count} of {self.of}" if self.at else " over the run"
        unit = "" if self.unit == "1" else f" {self.unit}"
        if not math.isfinite(self.by):
            return f"{self.run}: {self.signal} has a direction on one side only{where}"
        return f"{self.run}: {self.signal} moved by {self.by:+.4g}{unit} from {self.was:.6g}{unit}{where} (tolerance {self.tolerance:.3g}{unit})"


def fits(stored: Sequence[Run], fresh: Sequence[Run]) -> str:
    """Why two sets of runs cannot be compared, or nothing."""
    if [run.name for run in stored] != [run.name for run in fresh]:
        return f"it has the runs {_listed(stored)}; the case now has {_listed(fresh)}"
    for old, new in zip(stored, fresh, strict=True):
        if json.loads(json.dumps(old.added)) != json.loads(json.dumps(new.added)):
            return f"run {old.name!r} was made with {_inline(old.added)}, and is now made with {_inline(new.added)}"
        if bool(old.skipped) != bool(new.skipped):
            return f"run {old.name!r} " + (f"was skipped ({old.skipped}) and now runs" if old.skipped else f"is skipped now: {new.skipped}")
        if old.columns != new.columns or old.rows.shape != new.rows.shape:
            return f"run {old.name!r} has other columns or another number of crank angles"
        if old.places is not None and new.places is not None and not np.allclose(old.places, new.places, rtol=0, atol=0.5e-4 + SAME_PLACE):
            return f"run {old.name!r} is at other crank angles"
    return ""


def _listed(runs: Sequence[Run]) -> str:
    return ", ".join(repr(run.name) for run in runs) or "none"


def moved(old: Run, new: Run, tolerance: Tolerance) -> list[Moved]:
    """Every column of a run that moved; the runs must fit."""
    largest = max((float(np.nanmax(old.rows[:, j])) for j, name in enumerate(old.columns) if name.endswith("_magnitude [N]")), default=0.0)
    found = []
    for j, column in enumerate(old.columns):
        if column in PLACES:
            continue
        signal, _, unit = column.removesuffix("]").partition(" [")
        by = new.rows[:, j] - old.rows[:, j]
        if unit == "deg":
            by = (by + 180) % 360 - 180
            by[_turned_up_or_lost(old.rows[:, j], new.rows[:, j], old.rows[:, j + 1])] = np.inf
        allowed = _allowed(signal, unit, old.rows[:, j], largest, tolerance)
        gone = np.flatnonzero(np.abs(by) > allowed)
        if gone.size:
            k = int(gone[np.argmax(np.abs(by[gone]))])
            found.append(Moved(old.name, signal, unit, float(by[k]), float(old.rows[k, j]), allowed, _place(old, k), gone.size, by.size))
    return found


def _turned_up_or_lost(old: np.ndarray, new: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Where (N,) only one side has a direction, though the stored force is not just at the limit of having one."""
    limit = NO_DIRECTION * size.max()
    return (np.isnan(old) != np.isnan(new)) & (np.abs(size - limit) > 0.01 * limit)


def _allowed(signal: str, unit: str, values: np.ndarray, largest: float, tolerance: Tolerance) -> float:
    if unit == "deg":
        return tolerance.angle
    if signal.endswith("_magnitude"):
        return tolerance.magnitude * max(float(values.max()), WEAK * largest)
    return tolerance.rms * float(values.max()) if signal.endswith("_rms") else tolerance.free_share


def _place(run: Run, k: int) -> str:
    if run.places is None:
        return ""
    return f"{run.places[k]:.6g} {'deg' if run.columns[0] == PLACES[0] else 's'}"
