"""Tables of loads in CSV files or data frames: ``table = "gas.csv"`` of a ``[[load]]`` becomes loads with the same
numbers inline.
"""

from __future__ import annotations

import csv
import difflib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analytic.mechanism.reading import ReadingError, read_text
from analytic.mechanism.units import DIMENSIONS, QuantityKind, SiUnit, UnitError, factor

HEADING = re.compile(r"\s*([^\[\]()]*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))?\s*")
UNIT_LOADS: Mapping[str, tuple[QuantityKind, Mapping[str, object]]] = {
    "force_x": ("force", {"force": [1.0, 0.0]}),
    "force_y": ("force", {"force": [0.0, 1.0]}),
    "torque": ("torque", {"torque": 1.0}),
}  # what a column is a factor of


def with_tables(
    load: Mapping[str, object], unit: SiUnit | None, folder: Path | None, called: str
) -> list[dict[str, object]]:
    """A load whose table is a file, relative to ``folder``, or a frame, as one load for each of its columns beside that
    of ``over``, in this ``unit``; any other load as it is.  Raises ReadingError.
    """
    file, over = load.get("table"), load.get("over")
    if not (isinstance(file, str) or is_frame(file)):
        return [dict(load)]
    where = f"{called}.table".lstrip(".") + f" = {file!r}" * isinstance(file, str)
    if folder is None and isinstance(file, str):
        raise ReadingError(
            f"{where} is a file, which mechanisms that are no files themselves have not; give its pairs, or a frame"
        )
    if unit is None or not isinstance(over, str):
        is_read = "needs over" if over is None else f"is read over {over!r}"
        raise ReadingError(
            f"{where} {is_read}; give over = crank_angle, <body>_angle, <body>_x, <body>_y, position_<joint> or time"
        )
    given = [name for name in ("force", "torque", "from", "to") if name in load]
    if given:
        raise ReadingError(f"{where} says all of the load; leave out {' and '.join(given)}, or give pairs in its place")
    kind = DIMENSIONS[unit]
    values, columns = (
        _read(folder / file, over, kind) if folder and isinstance(file, str) else _framed(where, file, over, kind)
    )
    if load.get("opposes") and {"force_x", "force_y"} <= columns.keys():
        raise ReadingError(
            f"{where} has force_x and force_y, and of a load that opposes the size counts; keep one column"
        )
    rest = {name: value for name, value in load.items() if name != "table"}
    return [
        {**rest, **UNIT_LOADS[name][1], "table": [list(pair) for pair in zip(values, column, strict=True)]}
        for name, column in columns.items()
    ]


def is_frame(given: object) -> bool:
    """Whether something has columns by heading: a data frame, or numbers by heading."""
    return hasattr(given, "keys") and hasattr(given, "__getitem__")


def _framed(called: str, frame: Any, over: str, kind: QuantityKind) -> tuple[list[float], dict[str, list[float]]]:
    """The same of a frame, whose columns have their unit in their heading or in its ``attrs["units"]``."""
    units = getattr(frame, "attrs", {}).get("units", {})
    columns = _columns(called, [f"{h} [{units[h]}]" if units.get(h) else str(h) for h in frame], over, kind)
    try:
        rows = [list(row) for row in zip(*(np.asarray(frame[h], float).tolist() for h in frame), strict=True)]
    except (TypeError, ValueError):
        raise ReadingError(f"{called}: its columns are no numbers, as many in each; give every cell one") from None
    if len(rows) < 2 or not np.all(np.isfinite(rows)):
        raise ReadingError(f"{called}: give two rows at least, a finite number in every cell")
    return _by_name(called, columns, rows, over, lambda k: f"row {k}")


def _read(path: Path, over: str, kind: QuantityKind) -> tuple[list[float], dict[str, list[float]]]:
    """The values (K,) of a quantity, increasing, and forces (N) and torques (N.m) at them, by name."""
    try:
        text = read_text(path)
    except ReadingError as error:
        raise ReadingError(
            f"{path} {error}; give a CSV file with the columns {over} and force_x, force_y or torque"
        ) from None
    first = text.split("\n", 1)[0]
    separator = next((mark for mark in ";\t" if mark in first), ",")
    rows = [(n, row) for n, row in enumerate(csv.reader(text.splitlines(), delimiter=separator), 1) if any(row)]
    if len(rows) < 3:
        raise ReadingError(
            f"{path.name}: has {max(len(rows) - 1, 0)} rows of numbers below its headings; give two at least"
        )
    (_, headings), *numbers = rows
    columns = _columns(path.name, headings, over, kind)
    read = [[_number(path.name, n, cell, separator) for cell in row] for n, row in numbers]
    for n, row in numbers:
        if len(row) != len(columns):
            raise ReadingError(f"{path.name}: line {n} has {len(row)} cells, and {len(columns)} columns have headings")
    return _by_name(path.name, columns, read, over, lambda k: f"line {numbers[k][0]}")


def _columns(file: str, headings: Sequence[str], over: str, kind: QuantityKind) -> list[tuple[str, float]]:
    """The names of columns, each with its factor to SI."""
    columns = [_column(file, heading, over, kind) for heading in headings]
    names = [name for name, _ in columns]
    if over not in names or len(names) < 2 or len({*names}) < len(names):
        raise ReadingError(
            f"{file}: has the columns {', '.join(names)}; give {over} once, and force_x, force_y or torque, each"
            " once at most"
        )
    return columns


def _by_name(
    file: str,
    columns: Sequence[tuple[str, float]],
    read: Sequence[Sequence[float]],
    over: str,
    row: Callable[[int], str],
) -> tuple[list[float], dict[str, list[float]]]:
    """Rows of numbers as columns in SI, what they are over first, which has to increase from ``row`` to row."""
    values = [each[[name for name, _ in columns].index(over)] for each in read]
    for k in range(1, len(values)):
        if values[k] <= values[k - 1]:
            raise ReadingError(f"{file}: {row(k)}: {over} does not increase; put the rows in order, each value once")
    by_name = {
        name: [scale * value for value in column]
        for (name, scale), column in zip(columns, zip(*read, strict=True), strict=True)
    }
    return by_name.pop(over), by_name


def _column(file: str, heading: str, over: str, kind: QuantityKind) -> tuple[str, float]:
    """The name of a column and its factor to SI."""
    kinds = {over: kind} | {name: kind for name, (kind, _) in UNIT_LOADS.items()}
    parted = HEADING.fullmatch(heading)
    name = parted[1] if parted else heading
    if name not in kinds:
        close = difflib.get_close_matches(name, kinds, n=1)
        remedy = f"did you mean {close[0]!r}" if close else f"they are {', '.join(kinds)}"
        raise ReadingError(f"{file}: column {heading.strip()!r} is none of a load's over {over}; {remedy}")
    try:
        return name, factor(((parted and (parted[2] or parted[3])) or "").strip(), kinds[name])
    except UnitError as error:
        where = ", in brackets behind its name" * (parted is None or not (parted[2] or parted[3]))
        raise ReadingError(f"{file}: column {heading.strip()!r} has {error}{where}") from None


def _number(file: str, line: int, cell: str, separator: str) -> float:
    try:
        value = float(cell.replace(",", ".") if separator == ";" else cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ReadingError(f"{file}: line {line}: {cell.strip()!r} is not a finite number; give every cell one")
    return value
