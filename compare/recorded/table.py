"""A data file as a table: which signal each column is, numbers in SI, and every fault with its line and column."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.columns import ANY_LAYOUT, Layout
from analytic.mechanism.errors import describe
from analytic.mechanism.one_line import count, shown
from analytic.mechanism.signals import starts_again, undirected, unwound
from compare.recorded.body_frames import in_ground_frame
from compare.recorded.containers import chosen, opened
from compare.recorded.errors import DataError
from compare.recorded.formats import ColumnsByHeading
from compare.recorded.frames import FrameSource
from compare.recorded.headings import TIME, Column, Headings, Naming, read_headings
from compare.recorded.rounding import decimal, rounding
from compare.recorded.text import MIN_ROWS, Rows, coding, header, rows

LARGEST_READING = 1e30  # SI; nothing on a bench is as large, and its square is still a number
UNIT_ROUNDING = 1e-12  # of the largest number: what a change of unit rounds away
SHORTEST_STEP = 1e-12  # s, between two rows


@dataclass(frozen=True)
class Table:
    """``time`` (N,) s, strictly increasing, empty where there is none; ``values`` (N,) by signal in SI, NaN in an empty
    cell.  ``notes`` say what was made of the file, ``headings`` are all that it has, and ``used`` the entries of the
    map among them.  ``loads`` are columns (N,) that act: each as many times, or with as many N or N.m, as it says.
    """

    columns: tuple[Column, ...]  # time apart, which is the clock's
    time: np.ndarray
    values: dict[str, np.ndarray]
    notes: tuple[str, ...] = ()
    headings: tuple[str, ...] = ()
    used: frozenset[str] = frozenset()
    clock: Column | None = None
    loads: tuple[tuple[Column, np.ndarray], ...] = ()
    scatter: Mapping[str, float] = field(default_factory=dict)  # SI, by signal: how far readings are off at the most

    def at(self, rows: slice | np.ndarray) -> Table:
        """Some of its rows."""
        values = {name: each[rows] for name, each in self.values.items()}
        loads = tuple((column, each[rows]) for column, each in self.loads)
        return replace(self, time=self.time[rows] if self.time.size else self.time, values=values, loads=loads)

    def acting(self, file: str, time: np.ndarray) -> tuple[Load, ...]:
        """The loads that a ``file``'s columns are over times (N,) s of its rows; over empty cells on straight lines.

        Raises DataError for a column that is no load of these rows.
        """
        found = []
        for column, values in self.loads:
            here, at = np.isfinite(values), f"{file}: column {column.title!r}"
            if np.sum(here) < MIN_ROWS:
                raise DataError(f"{at} acts as a load and has {count(int(np.sum(here)), 'number')}; give {MIN_ROWS}")
            order = np.argsort(time[here], kind="stable")
            pairs = np.stack([time[here], values[here]], axis=1)[order]
            assert column.meaning
            assert column.meaning.load
            fields = column.meaning.load.model_dump(by_alias=True, exclude_unset=True)
            try:
                found.append(Load.model_validate({**fields, "over": "time", "table": pairs.tolist()}))
            except ValidationError as error:
                raise DataError(f"{at} is no load over time: {'; '.join(describe(error, fields, Load))}") from None
        return tuple(found)

    def rounding(self, signal: str) -> np.ndarray:
        """By how much a signal (N,) may be off as its numbers are rounded, or scatter, in SI; 0 for one that is not
        there.
        """
        if signal not in self.values:
            return np.zeros(next(iter(self.values.values())).shape)
        column = next(c for c in self.columns if c.signal.name == signal)
        rounded = column.step * rounding(column.readings(self.values[signal]))
        return np.maximum(rounded, self.scatter.get(signal, 0.0))

    def off(self, signal: str, exact: np.ndarray) -> float:
        """By how much a signal is off ``exact`` values (N,), SI, where that may be its last decimal; else 0.

        What moves evenly steps evenly, and its numbers alone do not show what they are rounded to.
        """
        column = next(c for c in self.columns if c.signal.name == signal)
        most = float(np.max(np.abs(column.signal.apart(self.values[signal], exact))))
        last = column.step * decimal(column.readings(self.values[signal]))
        return most if most <= last / 2 else 0.0

    def course(self, signal: str, file: str) -> np.ndarray:
        """A signal (N,) along the motion of a ``file``: an angle without jumps where it starts again after a turn.

        Raises DataError where its rows do not say which way it turned.
        """
        values = self.values[signal]
        column = next(c for c in self.columns if c.signal.name == signal)
        if not (column.signal.wraps and starts_again(values)):
            return values
        if step := undirected(continued := unwound(values)):
            raise DataError(
                f"{file}: {signal!r} stays within one turn and steps by {np.degrees(step):.4g} deg the shorter way,"
                " which does not say which way it turned; let it go on beyond a turn, or give it rows a quarter of a"
                " turn apart or less"
            )
        return continued


def read_table(
    source: Path | FrameSource,
    mechanism: Mechanism,
    layout: Layout = ANY_LAYOUT,
    *,
    timed: bool = True,
    mappable: bool = True,
    derived: bool = False,
    part: int | None = None,
) -> Table:
    """Read a data file, or a frame, of this mechanism; of a file whose clock starts again, the ``part`` that is meant,
    from 1.  With ``timed`` a file without time is refused; one that is not ``mappable`` has no map beside it that could
    say more of its columns; a program's may have ``derived`` signals, which no sensor reads.  Raises DataError with
    every fault that was found.
    """
    parts = read_parts(
        source, mechanism, layout, timed=timed, mappable=mappable, derived=derived, split=part is not None
    )
    if part is not None and part > len(parts):
        raise DataError(
            f"{source}: part = {part}, and its clock starts {count(len(parts), 'time')}; give 1 to {len(parts)}"
        )
    return parts[(part or 1) - 1]


def read_parts(
    source: Path | FrameSource,
    mechanism: Mechanism,
    layout: Layout = ANY_LAYOUT,
    *,
    timed: bool = True,
    mappable: bool = True,
    derived: bool = False,
    split: bool = False,
) -> list[Table]:
    """The same; with ``split``, each part of a file whose clock starts again as a table.  Raises DataError."""
    names = Naming(mechanism, layout, mappable and not isinstance(source, FrameSource), derived)
    if isinstance(source, FrameSource):
        return _of_columns(source.name, source.columns, names, timed, split)
    try:
        with opened(source) as data:
            if isinstance(data, Path):
                return _of_text(data, names, timed, split)
            return _of_columns(source.name, data, names, timed, split)
    except (UnicodeError, OSError) as error:
        why = error.strerror if isinstance(error, OSError) else "its characters cannot be decoded"
        raise DataError(
            f"{source}: cannot be read ({why}); check the path, its permissions and that it is text"
        ) from None


def _of_text(path: Path, names: Naming, timed: bool, split: bool) -> list[Table]:
    import csv

    try:
        coded = coding(path)
        top = header(path, coded, names)
        headings = read_headings(top.cells, top.units, names, f"{path.name}: line {top.line}", timed)
        read = rows(path, coded, top, headings.all) if headings.all else None
    except csv.Error as error:
        raise DataError(f"{path.name}: is not a CSV file ({error}); give rows of numbers separated by commas") from None
    if read is None:
        raise DataError(*headings.faults)
    notes = [note for note in (coded.note, *top.notes) if note]
    return _parts(path.name, headings, notes, read, timed, split, names.mechanism)


def _of_columns(name: str, columns: ColumnsByHeading, names: Naming, timed: bool, split: bool) -> list[Table]:
    """The tables of what is read by columns."""
    headings = read_headings(list(columns), {}, names, name, timed)
    cells = chosen(name, columns, [headings.cells[column.place] for column in headings.all])
    faults, numbers = [], []
    for column in headings.all:
        values = cells[headings.cells[column.place]]
        if isinstance(values, str):
            faults.append(f"{name}: column {column.place + 1}, {column.signal.name!r}, {values}; give numbers")
        elif np.any(np.isinf(values)):
            row = int(np.argmax(np.isinf(values))) + 1
            faults.append(f"{name}: row {row}, column {column.title!r}: {values[row - 1]} is not a finite number")
        else:
            numbers.append(values)
    if headings.faults or faults:
        raise DataError(*headings.faults, *faults)
    if headings.time is not None and np.any(np.isnan(numbers[0])):
        row = int(np.argmax(np.isnan(numbers[0]))) + 1
        raise DataError(f"{name}: row {row} has no time; give every row its time or delete the row")
    size = numbers[0].size
    read = Rows(np.column_stack(numbers), np.arange(1, size + 1), (), "row")
    return _parts(name, headings, [], read, timed, split, names.mechanism)


def _parts(
    name: str,
    headings: Headings,
    notes: Sequence[str],
    read: Rows,
    timed: bool,
    split: bool,
    mechanism: Mechanism,
) -> list[Table]:
    """What was read as a table, or as one for each start of its clock.  A last row that repeats the one before it, as
    loggers write that are stopped, is left out.  Raises DataError.
    """
    if headings.time is None or read.faults:
        return [_table(name, headings, notes, read, timed, mechanism)]
    starts = [0, *(np.flatnonzero(np.diff(read.numbers[:, 0]) < 0) + 1).tolist()] if split else [0]
    parts, said = [], list(notes)
    for first, last in zip(starts, [*starts[1:], len(read.numbers)], strict=True):
        rows = slice(first, last - _repeats(read.numbers[first:last]))
        if rows.stop < last:
            said.append(f"{name}: {read.row} {read.lines[last - 1]} repeats the one before it, and is left out")
        if len(starts) > 1 and rows.stop - first < MIN_ROWS:
            said.append(f"{name}: its clock starts again after {count(rows.stop - first, 'row')}, which are left out")
            continue
        parts.append(replace(read, numbers=read.numbers[rows], lines=read.lines[rows]))
    if len(parts) > 1:
        at = ", ".join(str(part.lines[0]) for part in parts)
        said.append(f"{name}: its clock starts again; it is split into {len(parts)} parts, from {read.row} {at}")
    return [_table(name, headings, said, part, timed, mechanism) for part in parts or [read]]


def _repeats(numbers: np.ndarray) -> bool:
    """Whether the last row (N, columns) is the same as the one before it, its time too."""
    return len(numbers) > MIN_ROWS and bool(np.array_equal(numbers[-1], numbers[-2], equal_nan=True))


def _table(name: str, headings: Headings, notes: Sequence[str], read: Rows, timed: bool, mechanism: Mechanism) -> Table:
    """What was read as a table.  Raises DataError."""
    wanted, faults = headings.all, [*headings.faults, *read.faults]
    fewest = MIN_ROWS if timed or headings.time else 1
    if len(read.numbers) < fewest and not read.faults:
        faults.append(f"{name}: has {count(len(read.numbers), 'row')} of numbers; at least {fewest} are needed")
    with np.errstate(over="ignore"):
        series = [c.si(read.numbers[:, k]) for k, c in enumerate(wanted)]
    values = {c.signal.name: numbers for c, numbers in zip(wanted, series, strict=True)}
    faults += [] if headings.faults else _differing(name, read, wanted, series)
    faults += _out_of_range(name, read, wanted, values)
    time, acting = values.pop(TIME.name, np.zeros(0)), tuple((c, values.pop(c.signal.name)) for c in headings.loads)
    if headings.time is not None and not faults:
        faults += _disorder(name, read, time, headings.time)
    if faults:
        raise DataError(*faults)
    remarks = [f"{name}: {note}" for note in headings.notes]
    remarks += [
        f"{name}: {c.title} acts as a load on {c.meaning.load.body}"
        for c in headings.loads
        if c.meaning and c.meaning.load
    ]
    columns = tuple({c.signal.name: c for c in headings.columns}.values())
    values, left = in_ground_frame(columns, values, mechanism, name)
    said = (*notes, *remarks)
    return Table(columns, time, values, said, headings.cells, headings.used, headings.time, acting, left)


def unused(where: str, entry: str, headings: Sequence[str]) -> str:
    """The fault of an entry of [columns] that no file has."""
    close = difflib.get_close_matches(entry, headings, n=1)
    remedy = f"did you mean {shown(close[0])}" if close else f"the headings are {', '.join(map(shown, headings[:12]))}"
    return f"{where}columns.{shown(entry)} is no heading of a data file; {remedy}"


def _differing(name: str, read: Rows, columns: Sequence[Column], series: Sequence[np.ndarray]) -> Iterator[str]:
    """A fault for each signal of two columns that are not alike, but for what their numbers are rounded to."""
    first: dict[str, int] = {}
    for k, column in enumerate(columns):
        other = first.setdefault(column.signal.name, k)
        open_by = sum(columns[i].step * rounding(read.numbers[:, i]) for i in (other, k))
        apart = np.abs(series[k] - series[other]) - UNIT_ROUNDING * np.nanmax(np.abs(series[k]), initial=0.0)
        if np.any(np.isnan(series[k]) != np.isnan(series[other])) or np.any(apart > open_by):
            at = f"columns {columns[other].place + 1} and {column.place + 1}"
            yield f"{name}: {at} are both {column.signal.name!r}, and differ; leave one of them out"


def _out_of_range(name: str, read: Rows, columns: Sequence[Column], values: Mapping[str, np.ndarray]) -> list[str]:
    """Readings that nothing on a bench has, the first of each column."""
    faults = []
    for k, column in enumerate(columns):
        wrong = np.flatnonzero(np.abs(values[column.signal.name]) > LARGEST_READING)
        if wrong.size:
            at = f"{name}: {read.row} {read.lines[wrong[0]]}, column {column.title!r}"
            faults.append(
                f"{at}: {read.numbers[wrong[0], k]:g} is no reading; leave the cell empty where there is none"
            )
    return faults


def _disorder(name: str, read: Rows, time: np.ndarray, column: Column) -> list[str]:
    """The first fault in the order of time: where it runs back, stays, or hardly moves."""
    stamps, steps = read.numbers[:, 0], np.diff(time)
    wrong = np.flatnonzero(steps < SHORTEST_STEP)
    if not wrong.size:
        return []
    k = int(wrong[0])
    at = f"{name}: {read.row} {read.lines[k + 1]}"
    more = f" (and {wrong.size - 1} more such rows)" if wrong.size > 1 else ""
    before, after = f"{stamps[k]:.10g} {column.unit}", f"{stamps[k + 1]:.10g} {column.unit}"
    if steps[k] > 0:
        return [f"{at}: {steps[k]:.3g} s after the row before{more}; check the unit of time"]
    if steps[k] == 0:
        return [f"{at} has the time of the row before, {after}{more}; delete the repeated row or give it its own time"]
    return [
        f"{at}: time runs back from {before} to {after}{more}; put the rows in order of time, one run in a"
        " file, and let a clock run on that starts again, or have it split (`split`)"
    ]
