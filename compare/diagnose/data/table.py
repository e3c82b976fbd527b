"""A data file as a table: header of ``signal [unit]``, numbers in SI, every fault with its line and column.

Blocks of lines go through numpy's reader; a block that it does not take is read again cell by cell, which finds the
fault or forgives it (blank lines, quotes).  So a long file is read at numpy's speed, and in memory that is bounded by
CELLS.
"""

from __future__ import annotations

import csv
import difflib
import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from analytic.mechanism.signals import Signal
from compare.diagnose.data.recording import LARGEST, MeasuredError, shown
from compare.diagnose.data.units import UnitError, dimension, factor, listed, readable

CELLS = 10_000_000  # read at most; 80 MB of numbers
ROWS = 8  # at least
BLOCK = 1 << 20  # characters read at a time
SHORTEST = 1e-12  # s, between two rows
HEADER = 100_000  # characters; what has no line end in so many is no table
TIME = Signal("time", "", "time")
POINTS = "save it with decimal points"
DELIMITERS = (",", ";", "\t")


@dataclass(frozen=True)
class Column:
    """A column's header: the signal, its unit as written, and the factor to SI."""

    signal: Signal
    unit: str
    factor: float


@dataclass(frozen=True)
class Table:
    """``time`` (N,) s, strictly increasing, and ``values`` (N,) by signal in SI, NaN in an empty cell."""

    columns: tuple[Column, ...]  # time apart
    time: np.ndarray
    values: dict[str, np.ndarray]


def read_table(path: Path, mechanism: Mechanism) -> Table:
    """Read a data file of this mechanism.  Raises MeasuredError."""
    try:
        if not path.is_file():
            raise MeasuredError(f"{path}: no such file; give the path of the CSV file, relative to measured.toml")
        _check_size(path)
        with path.open(encoding="utf-8-sig") as file:
            return _read(path.name, file, mechanism)
    except UnicodeDecodeError as error:
        raise MeasuredError(
            f"{path.name}: is not UTF-8 text (byte 0x{error.object[error.start]:02x}); save it as a CSV file in UTF-8"
        ) from None
    except csv.Error as error:
        raise MeasuredError(
            f"{path.name}: is not a CSV file ({error}); give rows of numbers separated by commas"
        ) from None
    except OSError as error:
        raise MeasuredError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from None


def _check_size(path: Path) -> None:
    """Not empty, not binary, not larger than can be held: known before a number is read."""
    with path.open("rb") as file:
        head = file.read(BLOCK)
        if not head.strip():
            raise MeasuredError(
                f"{path.name}: is empty; it needs a header of 'signal [unit]' columns and at least {ROWS} rows"
            )
        if b"\0" in head:
            raise MeasuredError(f"{path.name}: is not text but binary (or UTF-16); save it as a CSV file in UTF-8")
        line = head.split(b"\n", 1)[0]
        columns = 1 + max(line.count(d.encode()) for d in DELIMITERS)
        rows = head.count(b"\n") + sum(block.count(b"\n") for block in iter(lambda: file.read(BLOCK), b"")) - 1
    if path.stat().st_size > HEADER * (rows + 2):
        raise MeasuredError(
            f"{path.name}: has lines longer than {HEADER} characters; give a CSV file with a header of 'signal [unit]'"
            " columns"
        )
    if rows * columns > CELLS:
        keep = math.ceil(rows * columns / CELLS)
        raise MeasuredError(
            f"{path.name}: has {count(rows, 'row')} of {count(columns, 'column')}, and at most"
            f" {CELLS // columns} such rows are read; keep one row in {keep}, or cut the"
            f" run down to the revolutions that matter"
        )


def _read(name: str, file: TextIO, mechanism: Mechanism) -> Table:
    header = file.readline(HEADER)
    if len(header) == HEADER:
        raise MeasuredError(
            f"{name}: line 1 is longer than {HEADER} characters; give a CSV file with a header of 'signal [unit]'"
            " columns"
        )
    delimiter = max(DELIMITERS, key=re.sub(r"\[[^\[\]]*\]", "", header).count)  # a comma may be in a unit
    time, columns = _columns(name, header, delimiter, mechanism)
    names = [f"time [{time.unit}]", *(f"{c.signal.name} [{c.unit}]" for c in columns)]
    blocks = [_block(name, lines, first, delimiter, names) for first, lines in _blocks(file)]
    numbers = np.concatenate([b for b, _ in blocks]) if blocks else np.zeros((0, len(names)))
    if len(numbers) < ROWS:
        raise MeasuredError(f"{name}: has {count(len(numbers), 'row')} of numbers; at least {ROWS} are needed")
    stamps = numbers[:, 0]
    lines = np.concatenate([n for _, n in blocks])
    _check_order(name, stamps, lines, time.unit)
    _check_range(name, numbers, lines, names, np.array([time.factor, *(c.factor for c in columns)]))
    return Table(
        columns, stamps * time.factor, {c.signal.name: numbers[:, k] * c.factor for k, c in enumerate(columns, 1)}
    )


def _columns(name: str, header: str, delimiter: str, mechanism: Mechanism) -> tuple[Column, tuple[Column, ...]]:
    """The header's columns: time, and the others."""
    cells = [cell.strip() for cell in next(csv.reader([header], delimiter=delimiter))]
    if all(_number(cell) is not None for cell in cells):
        raise MeasuredError(
            f"{name}: line 1 has numbers where the header should be; begin with a line such as 'time [s],crank_angle"
            " [deg]'"
        )
    _check_points(name, header)
    columns = [_column(name, k, cell, mechanism) for k, cell in enumerate(cells, 1)]
    signals = [c.signal.name for c in columns]
    if signals[0] != "time":
        raise MeasuredError(f"{name}: line 1: column 1 is {cells[0]!r}; the first column must be 'time [s]'")
    twice = next((s for s in signals if signals.count(s) > 1), None)
    if twice is not None:
        raise MeasuredError(
            f"{name}: line 1: {twice!r} is there {signals.count(twice)} times; give each signal one column"
        )
    if len(columns) == 1:
        raise MeasuredError(f"{name}: line 1: has no column but time; add the measured signals, separated by commas")
    return columns[0], tuple(columns[1:])


def _check_points(name: str, header: str) -> None:
    """No unit with a comma, as of a file in which every point has become one.  Raises MeasuredError."""
    unit = re.search(r"\[([^\[\],]*,[^\[\],]*)\]", header)
    if unit:
        raise MeasuredError(
            f"{name}: line 1: unit {shown(unit[1])} has a comma: it looks as if the file has decimal commas;"
            f" {POINTS}, in units too ({shown(unit[1].replace(',', '.'))})"
        )


def _column(name: str, k: int, cell: str, mechanism: Mechanism) -> Column:
    found = re.fullmatch(r"([^\[\]]*?)\s*(?:\[([^\[\]]*)\])?", cell)
    if found is None or not found[1]:
        raise MeasuredError(
            f"{name}: line 1: column {k} is {shown(cell)}; write 'signal [unit]', such as 'crank_angle [deg]'"
        )
    signal, unit = canonical(found[1], mechanism), (found[2] or "").strip()
    known = {TIME.name: TIME, **readable(mechanism)}
    if signal not in known:
        raise MeasuredError(
            f"{name}: line 1: column {k}, {shown(signal)}, is not a signal of {mechanism.name!r};"
            f" {suggestion(signal, mechanism)}"
        )
    try:
        return Column(known[signal], unit, factor(unit, dimension(known[signal])))
    except UnitError as error:
        raise MeasuredError(f"{name}: line 1: column {k}, {signal!r}, has {error}") from None


def canonical(signal: str, mechanism: Mechanism) -> str:
    """``crank_angle`` stands for the driven body's angle, ``crank_angular_velocity`` for its rate, unless another body
    is called crank.
    """
    if "crank" in mechanism.moving:
        return signal
    parts = ("angle", "angular_velocity")
    return {f"crank_{part}": f"{mechanism.driven}_{part}" for part in parts}.get(signal, signal)


def suggestion(signal: str, mechanism: Mechanism) -> str:
    """What a signal that the mechanism does not have was probably meant to be."""
    close = difflib.get_close_matches(signal, ["time", *readable(mechanism)], n=1)
    return f"did you mean {close[0]!r}" if close else f"its signals are {listed(readable(mechanism))}"


def _blocks(file: TextIO) -> Iterator[tuple[int, list[str]]]:
    """Blocks of whole lines after the header, each with the number of its first line."""
    first = 2
    while lines := file.readlines(BLOCK):
        yield first, lines
        first += len(lines)


def _block(
    name: str, lines: list[str], first: int, delimiter: str, names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (rows, columns) of a block, in the units of the file, and the line number (rows,) of each row."""
    try:
        text = "".join(lines)
        for before, after in ((delimiter, delimiter), (delimiter, "\n")):  # an empty cell is an absent value
            text = text.replace(before + after, f"{before}nan{after}").replace(before + after, f"{before}nan{after}")
        numbers = (
            np.loadtxt(io.StringIO(text), delimiter=delimiter, comments=None, ndmin=2)
            if not text.isspace()
            else np.zeros((0, 0))
        )
        if (
            numbers.shape == (len(lines), len(names))
            and np.all(np.isfinite(numbers[:, 0]))
            and not np.any(np.isinf(numbers))
        ):
            return numbers, np.arange(first, first + len(lines))
    except ValueError:  # said below, with line and column
        pass
    return _cell_by_cell(name, lines, first, delimiter, names)


def _cell_by_cell(
    name: str, lines: list[str], first: int, delimiter: str, names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    rows, numbers = [], []
    for number, line in enumerate(lines, first):
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
        if not any(cells):
            continue
        where = f"{name}: line {number}"
        if len(cells) != len(names):
            hint = f"; if the file has decimal commas, {POINTS}" if delimiter == "," and len(cells) > len(names) else ""
            raise MeasuredError(
                f"{where} has {count(len(cells), 'cell')} and the header {len(names)}; leave an absent cell empty"
                f" between commas{hint}"
            )
        rows.append([_value(f"{where}, column {column!r}", cell) for column, cell in zip(names, cells, strict=True)])
        numbers.append(number)
        if not math.isfinite(rows[-1][0]):
            raise MeasuredError(f"{where} has no time; give every row its time or delete the row")
    return np.array(rows, float).reshape(-1, len(names)), np.array(numbers, int)


def _value(where: str, cell: str) -> float:
    if not cell:
        return math.nan
    value = _number(cell)
    if value is None and re.fullmatch(r"[-+]?\d+,\d+(e[-+]?\d+)?", cell, re.IGNORECASE):
        raise MeasuredError(f"{where}: {shown(cell)} has a decimal comma; {POINTS}")
    if value is None or math.isinf(value):
        raise MeasuredError(
            f"{where}: {shown(cell)} is not a finite number; leave the cell empty where there is no reading"
        )
    return value


def _number(cell: str) -> float | None:
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None


def _check_range(name: str, numbers: np.ndarray, lines: np.ndarray, names: Sequence[str], factors: np.ndarray) -> None:
    """No reading that nothing on a bench has, and no two at once."""
    wrong = np.argwhere(np.abs(numbers) > LARGEST / factors)
    if wrong.size:
        row, k = wrong[0]
        raise MeasuredError(
            f"{name}: line {lines[row]}, column {names[k]!r}: {numbers[row, k]:g} is no reading; leave the cell empty"
            " where there is none"
        )
    short = np.flatnonzero(np.diff(numbers[:, 0]) < SHORTEST / factors[0])
    if short.size:
        step = float(np.diff(numbers[:, 0])[short[0]]) * float(factors[0])
        raise MeasuredError(
            f"{name}: line {lines[short[0] + 1]}: {step:.3g} s after the row before; check the unit of time"
        )


def _check_order(name: str, stamps: np.ndarray, lines: np.ndarray, unit: str) -> None:
    wrong = np.flatnonzero(np.diff(stamps) <= 0)
    if wrong.size == 0:
        return
    k = int(wrong[0])
    before, after = f"{stamps[k]:.10g} {unit}", f"{stamps[k + 1]:.10g} {unit}"
    if stamps[k + 1] == stamps[k]:
        raise MeasuredError(
            f"{name}: line {lines[k + 1]} has the time of the row before, {after}; delete the repeated row or give it"
            " its own time"
        )
    raise MeasuredError(
        f"{name}: line {lines[k + 1]}: time runs back from {before} to {after}; put the rows in order of time, one run"
        " in a file"
    )
