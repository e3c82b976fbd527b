"""Every column of numbers that a file has, whatever it is called."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.columns import ANY_LAYOUT
from analytic.mechanism.one_line import shown
from analytic.mechanism.signals import Signal
from compare.recorded.errors import DataError
from compare.recorded.formats import reader
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


def every_column(file: Path, mechanism: Mechanism) -> Everything:
    """All that a file has.  Raises DataError, also where the column of time is none of numbers."""
    binary = reader(file)
    if binary is not None:
        all_of = binary(file)
        numbers = {name: v for name, v in all_of.items() if isinstance(v, np.ndarray)}
        return Everything(numbers, {}, tuple(name for name in all_of if name not in numbers), ())
    coded = coding(file)
    top = header(file, coded, Naming(mechanism, ANY_LAYOUT))
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
