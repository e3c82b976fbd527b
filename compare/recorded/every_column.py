"""Every column of numbers that a file has, whatever it is called."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.columns import ANY_LAYOUT, Layout
from analytic.mechanism.one_line import shown
from analytic.mechanism.signals import Signal
from compare.recorded.containers import Part, opened
from compare.recorded.errors import DataError
from compare.recorded.formats import ColumnsByHeading
from compare.recorded.headings import TIME, Column, Naming, clocklike, written_unit
from compare.recorded.text import CELLS, Coding, Header, Rows, coding, header, rows

LEAST_READINGS = 16  # rows with a number, by which a column is one of numbers


@dataclass(frozen=True)
class Everything:
    """The ``columns`` (N,) of numbers by their headings, NaN where there is none, the ``units`` of a row of units, the
    headings of columns of ``words``, and what was made of the file.
    """

    columns: dict[str, np.ndarray]
    units: dict[str, str]
    words: tuple[str, ...]
    notes: tuple[str, ...]


def every_column(file: Path, mechanism: Mechanism, layout: Layout = ANY_LAYOUT) -> Everything:
    """All that a file has.  Raises DataError, also where the column of time is none of numbers."""
    with opened(file) as data:
        if not isinstance(data, Path):
            return _of_columns(file.name, data)
        return _of_text(data, Naming(mechanism, layout))


def _of_columns(name: str, data: ColumnsByHeading) -> Everything:
    """All of what is read by columns, of as many rows as its clock or most of it; of a long one every second, third ...
    row.
    """
    every = max(1, math.ceil(sum(data.sizes.values()) / CELLS)) if isinstance(data, Part) else 1
    read = {
        heading: values[::every].copy() if isinstance(values, np.ndarray) else values
        for heading, values in data.items()
    }
    sizes = {heading: values.size for heading, values in read.items() if isinstance(values, np.ndarray)}
    rows = next((n for heading, n in sizes.items() if clocklike(heading)), max(sizes.values(), default=0))
    numbers = {h: v for h, v in read.items() if isinstance(v, np.ndarray) and v.size == rows}
    notes = (f"{name}: one row in {every} is looked at",) if every > 1 else ()
    if not numbers or rows < LEAST_READINGS:
        raise DataError(f"{name}: has no column of {LEAST_READINGS} numbers among {', '.join(map(shown, [*read][:6]))}")
    return Everything(numbers, {}, tuple(heading for heading in read if heading not in numbers), notes)


def _of_text(file: Path, names: Naming) -> Everything:
    """All of a file of text."""
    coded = coding(file)
    top = header(file, coded, names)
    columns: dict[str, np.ndarray] = {}
    words, faults = list[str](), list[str]()
    twice = next((cell for cell in top.cells if cell.strip() and top.cells.count(cell) > 1), None)
    if twice is not None:
        places = [str(k) for k, cell in enumerate(top.cells, 1) if cell == twice]
        raise DataError(
            f"{file.name}: line {top.line}: columns {' and '.join(places)} are both {shown(twice)}; rename one of them"
        )
    for place, cell, read in _columns(file, coded, top):
        if not read.faults and np.isfinite(read.numbers).sum() >= LEAST_READINGS:
            columns[cell] = read.numbers[:, 0]
            continue
        words.append(cell)
        faults += read.faults[:1]
        if clocklike(cell):
            clock_faults = rows(file, coded, top, [Column(TIME, written_unit(cell, "time") or "s", 1.0, place)]).faults
            if clock_faults:
                raise DataError(clock_faults[0])
    if not columns:
        if faults and faults.count(faults[0]) == len(top.cells):
            raise DataError(faults[0])  # a line that is no row
        raise DataError(
            f"{file.name}: has no column of numbers under its header {', '.join(map(shown, top.cells[:6]))}"
        )
    units = {top.cells[place]: unit for place, unit in top.units.items()}
    return Everything(columns, units, tuple(words), tuple(note for note in (coded.note, *top.notes) if note))


def _columns(file: Path, coded: Coding, top: Header) -> Iterator[tuple[int, str, Rows]]:
    """Each column of a file by itself, read with as many others as may be at once."""
    every = [Column(Signal("reaction", cell, "x"), "", 1.0, place) for place, cell in enumerate(top.cells)]
    together = max(1, CELLS // max(coded.lines, 1))

    def read(columns: Sequence[Column]) -> Rows:
        return rows(file, coded, top, columns)

    for first in range(0, len(every), together):
        group = every[first : first + together]
        for column, alone in zip(group, _apart(read, group, read(group)), strict=True):
            yield column.place, top.cells[column.place], alone


def _apart(read: Callable[[Sequence[Column]], Rows], group: Sequence[Column], together: Rows) -> Iterator[Rows]:
    """Columns that were read together, by themselves: where one is at fault, the halves are read again."""
    if not together.faults or len(group) == 1:
        yield from (Rows(together.numbers[:, [k]], together.lines, together.faults) for k in range(len(group)))
        return
    halves = group[: len(group) // 2], group[len(group) // 2 :]
    again = [read(half) for half in halves]
    if again[0].faults[:1] == again[1].faults[:1] == together.faults[:1]:  # a line that is no row, for all of them
        yield from [together] * len(group)
        return
    for half, part in zip(halves, again, strict=True):
        yield from _apart(read, half, part)
