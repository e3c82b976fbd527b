"""How else the clock and the encoders of a file may be meant: in other units, or turning the other way."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from analytic.mechanism import Mechanism
from analytic.mechanism.columns import ColumnMeaning
from analytic.mechanism.signals import Signal
from analytic.mechanism.units import OFFERED, dimension, factor
from compare.recorded.headings import Column
from compare.recorded.table import Table

FIRST_ROWS = 200  # of a file, by which it is told
Change = tuple[Column, Column]  # a column as it is read, and as it may be meant


@dataclass(frozen=True)
class TableReading:
    """The first rows of a table, with some columns as they may be meant; with none, as they are read."""

    table: Table
    changes: tuple[Change, ...] = ()

    @classmethod
    def of(cls, table: Table) -> TableReading:
        """A table as it is read."""
        return cls(table.at(slice(FIRST_ROWS)))

    @property
    def words(self) -> str:
        """The meaning in words: ``crank_angle in deg and time in ms``."""
        return " and ".join(_words(*change) for change in self.changes)

    @property
    def lines(self) -> str:
        """The meaning as lines of a map."""
        return " and ".join(line(self.table, meant) for _, meant in self.changes)

    def encoders(self, mechanism: Mechanism) -> Iterator[TableReading]:
        """This table with an encoder in each other unit, and turning either way; of several one of them, all alike, or
        two in each other's place.
        """
        columns = [c for c in self.table.columns if c.signal in mechanism.encoders]
        meanings = [list(_meanings(c, (1, -1))) for c in columns]
        yield from (self._with(change) for changes in meanings for change in changes)
        if len(meanings) > 1:
            yield from (self._with(*changes) for changes in zip(*meanings, strict=True))
        for one, other in combinations(columns, 2):
            if one.signal.unit == other.signal.unit:
                yield self._with((one, _as(one, other.signal)), (other, _as(other, one.signal)))

    def clocks(self) -> Iterator[TableReading]:
        """This table with the clock in each other unit."""
        if self.table.clock is not None:
            yield from (self._with(change) for change in _meanings(self.table.clock, (1,)))

    def _with(self, *changes: Change) -> TableReading:
        time, values, columns = self.table.time, dict(self.table.values), list(self.table.columns)
        for read, meant in changes:
            if read is self.table.clock:
                time = meant.si(read.readings(time))
            else:
                values[meant.signal.name] = meant.si(read.readings(self.table.values[read.signal.name]))
                columns[columns.index(read)] = meant
        table = replace(self.table, time=time, values=values, columns=tuple(columns))
        return TableReading(table, (*self.changes, *changes))


def _meanings(column: Column, signs: Sequence[int]) -> Iterator[Change]:
    """A column in each other unit of its kind, with either of these signs."""
    kind = dimension(column.signal)
    for sign in signs:
        for unit in dict.fromkeys((column.unit, *OFFERED[kind])):
            if sign == -1 or factor(unit, kind) != column.factor:
                yield column, otherwise(column, unit, sign)


def otherwise(column: Column, unit: str, sign: int = 1, scale: float = 1.0) -> Column:
    """A column in this unit, times a sign and a scale."""
    before = column.meaning or ColumnMeaning(signal=column.signal.name)
    times = {"sign": sign * before.sign, "scale": scale * before.scale, "offset": sign * scale * before.offset}
    meaning = before.model_copy(update={"unit": unit, **times})
    return replace(column, unit=unit, factor=factor(unit, dimension(column.signal)), meaning=meaning)


def _as(column: Column, signal: Signal) -> Column:
    """A column as another signal."""
    before = column.meaning or ColumnMeaning(signal=column.signal.name, unit=column.unit)
    return replace(column, signal=signal, meaning=before.model_copy(update={"signal": signal.name}))


def line(table: Table, meant: Column) -> str:
    """The line of a map for a column that is meant so."""
    return f"{json.dumps(table.headings[meant.place].strip(), ensure_ascii=False)} = {_entry(meant)}"


def _words(read: Column, meant: Column) -> str:
    """``crank_angle in deg, of the other sign``, ``position_A in the place of position_B``."""
    if read.signal != meant.signal:
        return f"{meant.signal.name} in the place of {read.signal.name}"
    signs = [column.meaning.sign if column.meaning else 1 for column in (read, meant)]
    words = [f"in {meant.unit}"] * (meant.factor != read.factor) + ["of the other sign"] * (signs[0] != signs[1])
    return f"{meant.signal.name} {', '.join(words)}"


def _entry(meant: Column) -> str:
    """A column's entry in a map."""
    fields = {"signal": json.dumps(meant.signal.name), "unit": json.dumps(meant.unit)}
    if meant.meaning is not None:
        others = meant.meaning.model_dump(exclude_defaults=True, exclude=set(fields))
        fields |= {name: f"{value:.12g}" for name, value in others.items()}
    return f"{{ {', '.join(f'{name} = {value}' for name, value in fields.items())} }}"
