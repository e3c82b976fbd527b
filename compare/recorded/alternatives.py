"""How else the columns of a file may be meant: in other units, of the other sign, as another signal."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.columns import ColumnMeaning
from analytic.mechanism.signals import Signal
from analytic.mechanism.units import OFFERED, QuantityKind, dimension, factor
from compare.recorded.headings import Column
from compare.recorded.table import Table

FIRST_ROWS = 200  # of a file, by which it is told
REVERSED = "of the other sign"
LIKE_UNIT = 0.03  # relative, by which a channel's slope on its prediction may miss a conversion of units
LIKE_MODEL = 0.99  # correlation of readings with their prediction, but for noise, from which the slope is of their unit
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
        return " and ".join(line(meant) for _, meant in self.changes)

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
                yield self._with((one, read_as(one, other.signal)), (other, read_as(other, one.signal)))

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


def looks(
    kind: QuantityKind, unit: str, model: np.ndarray, measured: np.ndarray, noise: float = 0.0
) -> tuple[float, str] | None:
    """By what measured values (N,), read in this unit, are the model's (N,), and what they look, if that is a
    conversion of this kind of quantity: in another unit, converted twice, or of the other sign.  ``noise`` is theirs.
    """
    if any(np.std(each) <= each.size * np.finfo(float).eps * np.abs(each).max() for each in (model, measured)):
        return None  # constant, but for rounding
    told = 1 - noise**2 / float(np.var(measured))  # the share of their variance that is not noise
    chance = 3 * (1 - told) / math.sqrt(model.size)
    if told < 0.5 or abs(np.corrcoef(model, measured)[0, 1]) < LIKE_MODEL * math.sqrt(told) - chance:
        return None
    slope = float(np.polyfit(model, measured, 1)[0])
    if abs(slope - 1) < LIKE_UNIT:
        return None
    others = [(each, factor(each, kind)) for each in (*OFFERED[kind], *("rev/s",) * (kind == "angular velocity"))]
    read = factor(unit, kind)
    conversions = {f"in {each}": read / size for each, size in others} | {REVERSED: -1.0}
    if read == 1:
        conversions |= {f"converted from {each} twice": size for each, size in others}
    off = LIKE_UNIT + 3 * noise / float(np.std(model)) / math.sqrt(model.size) / abs(slope)
    alike = (what for what, of in conversions.items() if abs(slope / of - 1) < off)
    return next(((slope, what) for what in alike), None)


def mended(column: Column, what: str) -> Column:
    """A column meant as it looks."""
    how, *words = what.split()
    if what == REVERSED:
        return otherwise(column, column.unit, -1)
    if how == "in":
        return otherwise(column, words[0])
    return otherwise(column, column.unit, scale=1 / factor(words[1], dimension(column.signal)))


def otherwise(column: Column, unit: str, sign: int = 1, scale: float = 1.0, less: float = 0.0) -> Column:
    """A column in this unit, times a sign and a scale, and ``less`` so much (of the unit)."""
    before = column.meaning or ColumnMeaning(signal=column.signal.name)
    times = {"sign": sign * before.sign, "scale": scale * before.scale, "offset": sign * scale * before.offset - less}
    meaning = before.model_copy(update={"unit": unit, **times})
    return replace(column, unit=unit, factor=factor(unit, dimension(column.signal)), meaning=meaning)


def less(column: Column, much: float) -> str:
    """The line of a map for a column that reads so much (SI) too much."""
    return line(otherwise(column, column.unit, less=float(f"{much / column.factor:.6g}")))


def swapped(one: Column | None, other: Column | None) -> tuple[str, ...]:
    """The lines of a map for two columns that are in each other's place, as their numbers are."""
    if one is None or other is None:
        return ()
    return line(read_as(one, other.signal, other.unit)), line(read_as(other, one.signal, one.unit))


def read_as(column: Column, signal: Signal, unit: str | None = None) -> Column:
    """A column as another signal, of another kind in this unit."""
    before = column.meaning or ColumnMeaning(signal=column.signal.name, unit=column.unit)
    if unit is not None:
        column, before = replace(column, unit=unit), before.model_copy(update={"unit": unit})
    return replace(column, signal=signal, meaning=before.model_copy(update={"signal": signal.name}))


def line(meant: Column) -> str:
    """The line of a map for a column that is meant so."""
    return f"{json.dumps(meant.heading, ensure_ascii=False)} = {_entry(meant)}"


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
        fields |= {n: json.dumps(v) if isinstance(v, str) else f"{v:.12g}" for n, v in others.items()}
    return f"{{ {', '.join(f'{name} = {value}' for name, value in fields.items())} }}"
