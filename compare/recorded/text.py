"""A text file of columns: its encoding, the lines before its header, its separator, its decimal mark, and its numbers.

Blocks of lines go through numpy's reader; a block that it does not take is read again cell by cell, which finds its
faults or forgives them (blank lines, quotes).  So a long file is read at numpy's speed, and in memory that is bounded.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from analytic.mechanism.columns import Layout
from analytic.mechanism.one_line import count, shown
from analytic.mechanism.units import OFFERED
from compare.recorded.errors import DataError
from compare.recorded.headings import BRACKETS, Column, Naming, is_unit

CELLS = 10_000_000  # read at most; 80 MB of numbers
MIN_ROWS = 8  # at least
BLOCK_SIZE = 1 << 20  # characters read at a time
HEADER = 100_000  # characters; what has no line end in so many is no table
PREAMBLE = 200  # lines, at most, before a header that is to be found
DELIMITERS = (",", ";", "\t")
SAMPLED = 20  # rows by which the decimal mark is known
ENOUGH_FAULTS = 100  # faults of a file, after which no more are looked for
SAVE_WITH_POINTS = "save it with decimal points"
THOUSANDS = re.compile(r"[-+]?\d{1,3}(\.\d{3})+,\d+")
ABSENT = {"NAN", "NA", "N/A", "#N/A", "NULL", "NONE", "-", "--"}  # what programs write where there is nothing
COMMA = re.compile(r"[-+]?\d*,\d+(e[-+]?\d+)?", re.IGNORECASE)
CONTROL = re.compile(rb"[\x00-\x08\x0b\x0e-\x1f\x7f]")
UTF16 = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True)
class Header:
    """Where a file's header is, what its cells are, and how its rows are written.

    ``line`` is its number, ``first`` that of the first row; ``delimiter`` is None for white space.
    """

    line: int
    first: int
    cells: tuple[str, ...]
    units: dict[int, str]
    delimiter: str | None
    decimal: str
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Rows:
    """Readings (rows, columns) in the units of the file, NaN in an empty cell, and each row's number (rows,), of a line
    or whatever messages call a ``row``.
    """

    numbers: np.ndarray
    lines: np.ndarray
    faults: tuple[str, ...]
    row: str = "line"


@dataclass(frozen=True)
class Coding:
    """How a file's characters are coded, a note if that is not UTF-8, and how many lines it has."""

    name: str
    note: str
    lines: int


def coding(path: Path) -> Coding:
    """How a file is coded.  Raises DataError for what is no text, or has lines without end."""
    name, coded = path.name, "utf-8-sig"
    with path.open("rb") as file:
        head = file.read(BLOCK_SIZE)
        if not head.strip():
            raise DataError(
                f"{name}: is empty; it needs a header of 'signal [unit]' columns and at least {MIN_ROWS} rows"
            )
        if head[:2] in UTF16:
            coded = "utf-16"
        elif b"\0" in head or CONTROL.search(head):
            raise DataError(f"{name}: is not text but binary (or UTF-16 unmarked); save it as a CSV file in UTF-8")

        end = b"\n" if b"\n" in head else b"\r"
        ends = head.count(end) + sum(block.count(end) for block in iter(lambda: file.read(BLOCK_SIZE), b""))
    if path.stat().st_size > HEADER * (ends + 2):
        raise DataError(
            f"{name}: has lines longer than {HEADER} characters; give a CSV file with a header of 'signal [unit]'"
            " columns"
        )
    if coded == "utf-16" or _decodes(path, coded):
        return Coding(coded, "", ends)
    if not _decodes(path, "cp1252"):
        raise DataError(f"{name}: is not UTF-8 text; save it as a CSV file in UTF-8")
    return Coding("cp1252", f"{name}: is not UTF-8 text, and read as Windows-1252", ends)


def _decodes(path: Path, coded: str) -> bool:
    try:
        with path.open(encoding=coded, newline="") as file:
            for _ in iter(lambda: file.read(BLOCK_SIZE), ""):
                pass
    except UnicodeDecodeError:
        return False
    return True


def too_long(name: str, rows: int, columns: int) -> DataError:
    """The error of a file that has more numbers than are read."""
    keep = math.ceil(rows * columns / CELLS)
    return DataError(
        f"{name}: has {count(rows, 'row')} of {count(columns, 'column')}, and at most {CELLS // columns} such rows are"
        f" read; keep one row in {keep}, or cut the run down to the revolutions that matter"
    )


# ---------------------------------------------------------------- the header


def header(path: Path, coded: Coding, names: Naming) -> Header:
    """The header of a file: the line that has most headings of signals, or the one that the map says.  Raises
    DataError.
    """
    name, layout = path.name, names.layout
    with path.open(encoding=coded.name) as file:
        lines = [line.rstrip("\n") for line in islice(iter(lambda: file.readline(HEADER), ""), PREAMBLE + SAMPLED)]
        if layout.skip_rows is not None and layout.skip_rows >= len(lines):
            lines += [line.rstrip("\n") for line in islice(file, layout.skip_rows + SAMPLED - len(lines) + 1)]
    long = next((k for k, line in enumerate(lines, 1) if len(line) >= HEADER - 1), None)
    if long is not None:
        raise DataError(
            f"{name}: line {long} is longer than {HEADER} characters; give a CSV file with a header of 'signal [unit]'"
            " columns"
        )
    if layout.headings is not None:
        return _given(name, lines, layout)
    at = _header_line(name, lines, names)
    rest = [line for line in lines[at + 1 :] if line.strip()]
    delimiter = _delimiter(lines[at], rest, layout.delimiter)
    cells = _cells(lines[at], delimiter)
    while len(cells) > 1 and not cells[-1]:  # lines that end with a separator
        cells.pop()
    if all(_number(cell) is not None for cell in cells):
        raise DataError(
            f"{name}: line {at + 1} has numbers where the header should be; begin with a line such as 'time"
            ' [s],crank_angle [deg]\', or give the headings: --columns "time [s],crank_angle [deg]"'
        )
    notes = []
    if at and layout.skip_rows is None:
        skipped = "line of it is" if at == 1 else f"{at} lines of it are"
        notes.append(f"{name}: the first {skipped} skipped, as no header is there")
    below = at + 1 + next((k for k, line in enumerate(lines[at + 1 :]) if line.strip()), 0)
    units = _units(_cells(lines[below], delimiter) if below < len(lines) else [], len(cells))
    rows = [_cells(line, delimiter) for line in rest[bool(units) :][:SAMPLED]]
    decimal = layout.decimal or _decimal(rows, delimiter)
    if layout.separator is not None and len(cells) < 2:
        raise DataError(
            f"{name}: line {at + 1} has no {shown(layout.delimiter or '')} in it: {shown(lines[at].strip())}; leave"
            " separator out, or give that of the file"
        )
    if decimal == "," and layout.decimal is None:
        notes.append(f"{name}: its numbers are read with decimal commas")
    if decimal == ",":
        cells = [BRACKETS.sub(lambda unit: unit[0].replace(",", "."), cell) for cell in cells]
        units = {place: unit.replace(",", ".") for place, unit in units.items()}
    first = below + 2 if units else at + 2
    return Header(at + 1, first, tuple(cells), units, delimiter, decimal, tuple(notes))


def _given(name: str, lines: Sequence[str], layout: Layout) -> Header:
    """The header of a file that has none, whose headings are given."""
    headings = layout.headings or ()
    first = layout.skip_rows or 0
    rows = [line for line in lines[first:] if line.strip()]
    if not rows:
        raise DataError(f"{name}: has no row below its first {first} lines; give fewer skip_rows")
    delimiter = _delimiter(rows[0], rows[1:], layout.delimiter)
    cells = [_cells(row, delimiter) for row in rows[:SAMPLED]]
    if len(cells[0]) != len(headings):
        raise DataError(
            f"{name}: line {first + 1} has {count(len(cells[0]), 'cell')}, and {count(len(headings), 'heading')} are"
            " given for them; give each column one"
        )
    return Header(first, first + 1, headings, {}, delimiter, layout.decimal or _decimal(cells, delimiter), ())


def _header_line(name: str, lines: Sequence[str], names: Naming) -> int:
    """The index of the header among the first lines."""
    skip = names.layout.skip_rows
    if skip is not None:
        if skip >= len(lines) or not lines[skip].strip():
            raise DataError(
                f"{name}: skip_rows = {skip}, and line {skip + 1} is {'empty' if skip < len(lines) else 'not there'};"
                " give the number of lines before the header, 0 for none"
            )
        return skip
    first = next(k for k, line in enumerate(lines) if line.strip())
    scores = []
    for k, line in enumerate(lines[:PREAMBLE]):
        cells = _cells(line, _delimiter(line, [one for one in lines[k + 1 :] if one.strip()], names.layout.delimiter))
        headings = len(cells) > 1 and not all(_number(cell) is not None for cell in cells)
        scores.append(sum(names.recognised(cell) for cell in cells) if headings else 0)
    return int(np.argmax(scores)) if max(scores) else _above_numbers(lines, names.layout.delimiter, first)


def _above_numbers(lines: Sequence[str], given: str | None, first: int) -> int:
    """The index of the line above the first row of numbers, and above a row of units; ``first`` if there is none."""
    for k, line in enumerate(lines):
        delimiter = given or next((each for each in ("\t", ";", ",") if each in line), None)  # commas may be decimal
        cells = _cells(line, None if delimiter == " " else delimiter)
        if len(cells) < 2 or any(_number(cell.replace(",", ".") or "nan") is None for cell in cells):
            continue
        above = [i for i in range(k) if len(_cells(lines[i], delimiter)) == len(cells)]
        if not above:
            return first
        units = (
            len(above) > 1 and above[-1] == above[-2] + 1 and _units(_cells(lines[above[-1]], delimiter), len(cells))
        )
        return above[-2] if units else above[-1]
    return first


def _delimiter(line: str, rest: Sequence[str], given: str | None) -> str | None:
    """What stands between the cells of a header: what is given, else what it has most of, outside units."""
    if given is not None:
        return None if given == " " else given
    bare = BRACKETS.sub("", line)
    best = max(DELIMITERS, key=bare.count)
    if bare.count(best) or not rest:
        return best
    words = len(_cells(line, None))
    return None if words > 1 and words == len(_cells(rest[0], None)) else best


def _cells(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:  # white space, but for that before a unit in brackets
        return re.findall(r"[^\s\[\]()]+(?:\s*(?:\[[^\]]*\]|\([^)]*\)))?", line)
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]


def _units(cells: Sequence[str], columns: int) -> dict[int, str]:
    """The units of a row of units below the header, by column; empty where that is none."""
    bare = [cell.strip("[]() ") for cell in cells]
    numeric = any(_number(cell) is not None for cell in bare)
    if numeric or len(bare) < columns or not any(is_unit(cell, kind) for cell in bare for kind in OFFERED):
        return {}
    return {place: unit for place, unit in enumerate(bare) if unit not in ("", "-")}


def _decimal(rows: Sequence[Sequence[str]], delimiter: str | None) -> str:
    """The decimal mark of a file's first rows."""
    cells = [cell for row in rows for cell in row]
    commas = any(COMMA.fullmatch(cell) for cell in cells)
    points = any("." in cell and _number(cell) is not None for cell in cells)
    return "," if commas and not points and delimiter != "," else "."


# ---------------------------------------------------------------- the rows


def rows(path: Path, coded: Coding, top: Header, columns: Sequence[Column]) -> Rows:
    """The numbers of these columns, in their order.  Raises DataError where there are too many."""
    if coded.lines * len(columns) > CELLS:
        raise too_long(path.name, coded.lines - top.line, len(columns))
    reader = _RowReader(path.name, top, columns)
    parts: list[tuple[np.ndarray, np.ndarray]] = []
    with path.open(encoding=coded.name) as file:
        for _ in islice(iter(file.readline, ""), top.first - 1):
            pass
        for first, lines in _blocks(file, top.first):
            parts.append(reader.block(lines, first))
            if reader.enough:
                break
    numbers = np.concatenate([np.zeros((0, len(columns))), *(n for n, _ in parts)])
    return Rows(numbers, np.concatenate([np.zeros(0, int), *(k for _, k in parts)]), reader.all_faults())


def _blocks(file: io.TextIOBase, first: int) -> Iterator[tuple[int, list[str]]]:
    """Blocks of whole lines, each with the number of its first line."""
    while lines := file.readlines(BLOCK_SIZE):
        yield first, lines
        first += len(lines)


class _RowReader:
    """Reads blocks of lines, and keeps what is wrong with them."""

    def __init__(self, name: str, top: Header, columns: Sequence[Column]) -> None:
        self.name, self.header, self.columns = name, top, columns
        self.places = [c.place for c in columns]
        self.faults: list[str] = []
        self.cells: dict[tuple[int, str], list[str]] = {}  # at fault, by column and remedy

    @property
    def enough(self) -> bool:
        """Whether there are faults enough to stop."""
        return len(self.faults) + sum(map(len, self.cells.values())) >= ENOUGH_FAULTS

    def all_faults(self) -> tuple[str, ...]:
        """A sentence for each fault, one for all cells of a column that have the same."""
        sentences = []
        for (_, remedy), places in self.cells.items():
            more = "" if len(places) == 1 else f" (and so in {count(len(places) - 1, 'line')} more, at least)"
            sentences.append(f"{places[0]} {remedy}{more}")
        return (*sentences, *self.faults)

    def block(self, lines: list[str], first: int) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (rows, columns) of a block, in the units of the file, and the line number (rows,) of each row."""
        delimiter, width = self.header.delimiter, len(self.header.cells)
        try:
            text = "".join(lines)
            if '"' not in text and all(
                (len(line.split()) if delimiter is None else line.count(delimiter) + 1) == width for line in lines
            ):
                numbers = self._at_once(text)
                if numbers.shape == (len(lines), len(self.places)) and self._whole(numbers):
                    return numbers, np.arange(first, first + len(lines))
        except ValueError:  # said below, with line and column
            pass
        return self._cell_by_cell(lines, first)

    def _at_once(self, text: str) -> np.ndarray:
        delimiter = self.header.delimiter
        if self.header.decimal == ",":
            if "." in text:  # no decimal mark then
                raise ValueError
            text = text.replace(",", ".")
        if delimiter is not None:
            for before, after in ((delimiter, delimiter), (delimiter, "\n")):  # an empty cell is an absent value
                for _ in range(2):
                    text = text.replace(before + after, f"{before}nan{after}")
        if text.isspace():
            return np.zeros((0, 0))
        stream = io.StringIO(text)
        return np.loadtxt(stream, delimiter=delimiter, comments=None, ndmin=2, usecols=self.places)

    def _whole(self, numbers: np.ndarray) -> bool:
        return not (self._timed and not np.all(np.isfinite(numbers[:, 0]))) and not np.any(np.isinf(numbers))

    @property
    def _timed(self) -> bool:
        return self.columns[0].signal.kind == "time"

    def _cell_by_cell(self, lines: list[str], first: int) -> tuple[np.ndarray, np.ndarray]:
        readings, numbers, width = [], [], len(self.header.cells)
        for number, line in enumerate(lines, first):
            cells = _cells(line, self.header.delimiter)
            if not any(cells):
                continue
            if len(cells) > width and not any(cells[width:]):
                cells = cells[:width]
            if len(cells) != width:
                self.faults.append(self._miscounted(number, len(cells)))
                continue
            readings.append([self._value(number, column, cells[column.place]) for column in self.columns])
            numbers.append(number)
            if (
                self._timed
                and math.isnan(readings[-1][0])
                and _number(cells[self.columns[0].place] or "nan") is not None
            ):
                self.faults.append(f"{self.name}: line {number} has no time; give every row its time or delete the row")
            if self.enough:
                break
        return np.array(readings, float).reshape(-1, len(self.columns)), np.array(numbers, int)

    def _miscounted(self, number: int, cells: int) -> str:
        width = len(self.header.cells)
        commas = self.header.delimiter == "," and cells > width
        hint = f"; if the file has decimal commas, {SAVE_WITH_POINTS}, or with semicolons between its cells" * commas
        return (
            f"{self.name}: line {number} has {count(cells, 'cell')} and the header {width}; leave an absent cell empty"
            f" between its separators{hint}"
        )

    def _value(self, number: int, column: Column, cell: str) -> float:
        if not cell or cell.upper() in ABSENT:
            return math.nan
        cell = cell.replace("\u2212", "-")  # a minus sign, as typeset
        value = _number(cell.replace(",", ".") if self.header.decimal == "," and "." not in cell else cell)
        if value is not None and not math.isinf(value) and not (self.header.decimal == "," and "." in cell):
            return value
        where = f"{self.name}: line {number}, column {column.title!r}: {shown(cell)}"
        if self.header.decimal == "." and COMMA.fullmatch(cell):
            remedy = f'has a decimal comma; {SAVE_WITH_POINTS}, or say decimal = ","'
        elif THOUSANDS.fullmatch(cell):
            remedy = "has a point between thousands; write numbers without"
        elif value is not None and self.header.decimal == "," and "." in cell:
            remedy = 'has a decimal point, where commas are read as such; say decimal = "."'
        elif column.signal.kind == "time":
            remedy = "is not a finite number; give time as a number, such as seconds since the run began"
        else:
            remedy = "is not a finite number; leave the cell empty where there is no reading"
        self.cells.setdefault((column.place, remedy), []).append(where)
        return math.nan


def _number(cell: str) -> float | None:
    try:
        return None if "_" in cell else float(cell)
    except ValueError:
        return None
