"""The headings of a file's columns: which signal each is, in which unit, and what is made of those that are none.

A heading is ``signal [unit]``, ``signal (unit)`` or ``signal_unit``, in capitals or not, or whatever a map says it is.
What is no signal is ignored and said, unless it is so near to a signal's name that it may be one that is misspelt.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import Load, Mechanism, MechanismError
from analytic.mechanism.columns import ColumnMeaning, Layout, readable
from analytic.mechanism.one_line import shown
from analytic.mechanism.signals import Signal
from analytic.mechanism.units import QuantityKind, UnitError, dimension, factor
from compare.meant import marked

TIME = Signal("time", "", "time")
CLOCK = ("time", "t")  # what a column of time is called
# words in a heading of time, none of which is enough by itself
CLOCKS = (*CLOCK, "zeit", "timestamp", "stamp", "clock", "uhrzeit", "zeitstempel", "temps", "tempo", "tiempo")
AMBIGUOUS = "T"  # time if it has a unit of time, else as likely a temperature
ALIASES = ("crank_angle", "crank_angular_velocity")  # of the driven body's signals, whatever it is called
SIMILAR_NAME = 0.8  # of a signal's name: what is as near may be meant
WORD = 3  # letters of a word that tells a signal from another
SUFFIXES = {  # of headings such as time_ms and phi_deg
    "s": "s", "sec": "s", "ms": "ms", "us": "us", "min": "min", "h": "h", "rad": "rad", "mrad": "mrad", "deg": "deg",
    "rev": "rev", "rpm": "rpm", "m": "m", "mm": "mm", "um": "um", "n": "N", "kn": "kN", "nm": "N.m", "nmm": "N.mm",
}  # fmt: skip
BRACKETED = re.compile(r"([^\[\]()]*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))\s*")
BRACKETS = re.compile(r"\[[^\[\]]*\]|\([^()]*\)")


@dataclass(frozen=True)
class Column:
    """A column: its signal, the unit as written and its factor to SI; ``place`` is its index in the file, ``meaning``
    what a map makes of its readings, and ``heading`` what the file calls it.
    """

    signal: Signal
    unit: str
    factor: float
    place: int = 0
    meaning: ColumnMeaning | None = None
    heading: str = ""

    @property
    def title(self) -> str:
        """How messages call it."""
        return f"{self.signal.name} [{self.unit}]"

    @property
    def step(self) -> float:
        """How much of the signal (SI) is one of what the file has."""
        return self.factor * (abs(self.meaning.scale) if self.meaning else 1.0)

    def si(self, readings: np.ndarray) -> np.ndarray:
        """Readings (N,) in SI."""
        return (self.meaning.of(readings) if self.meaning else readings) * self.factor

    def readings(self, si: np.ndarray) -> np.ndarray:
        """The readings (N,) of a file for a signal in SI."""
        return self.meaning.read(si / self.factor) if self.meaning else si / self.factor


@dataclass(frozen=True)
class Headings:
    """What the columns of a file are; ``time`` is None where there is none.  ``used`` are entries of the map."""

    time: Column | None
    columns: tuple[Column, ...]
    notes: tuple[str, ...]
    faults: tuple[str, ...]
    cells: tuple[str, ...]
    used: frozenset[str]
    loads: tuple[Column, ...] = ()

    @property
    def all(self) -> list[Column]:
        """The columns that are read, time first, loads last."""
        return [*([self.time] if self.time else []), *self.columns, *self.loads]


class Naming:
    """The signals that a file of a mechanism may have, by whatever it may call them."""

    def __init__(self, mechanism: Mechanism, layout: Layout, mappable: bool = True, derived: bool = False) -> None:
        self.mechanism, self.layout, self.mappable = mechanism, layout, mappable
        rotations = [Signal("rotation", body.name, "angle") for body in mechanism.bodies] if derived else []
        self.known = {TIME.name: TIME, **readable(mechanism), **{signal.name: signal for signal in rotations}}
        self._folded: dict[str, Signal | None] = {}
        for name, signal in self.known.items():
            key = fold(name)
            self._folded[key] = None if key in self._folded else signal  # two that differ in capitals are themselves
        self._folded |= dict.fromkeys((key for key in CLOCK if key not in self._folded), TIME)

    def signal(self, name: str) -> Signal | None:
        """The signal of that name, as it may be written; None if there is none."""
        meant = canonical(name.strip(), self.mechanism)
        if meant in self.known:
            return self.known[meant]
        folded = canonical(fold(name), self.mechanism)
        return self._folded.get(fold(folded))

    def mapped(self, cell: str) -> str | None:
        """The entry of the map that a heading is, as written or but for its unit; None if there is none."""
        keys = (cell, cell.strip(), BRACKETS.sub("", cell).strip())
        return next((key for key in keys if key in self.layout.columns), None)

    def unloadable(self, load: Load) -> str:
        """Why the linkage cannot carry a load, in words; empty where it can."""
        try:
            self.mechanism.replace(loads=(load,))
        except MechanismError as error:
            return f"cannot act: {error}"
        return ""

    def parted(self, cell: str) -> tuple[Signal | None, str, str | None]:
        """The signal of a heading, its name and its unit; None for what there is not."""
        brackets = BRACKETED.fullmatch(cell)
        if brackets:
            unit = brackets[2] if brackets[2] is not None else brackets[3]
            signal, unit = self.signal(brackets[1]), (unit or "").strip()
            return (None if brackets[1] == AMBIGUOUS and not is_unit(unit, "time") else signal), brackets[1], unit
        name = cell.strip()
        plain, _, suffix = name.replace(" ", "_").rpartition("_")
        whole = self.signal(name) if name != AMBIGUOUS else None
        if whole is None and suffix.lower() in SUFFIXES and (signal := self.signal(plain)):
            return signal, plain, SUFFIXES[suffix.lower()]
        return whole, name, None

    def recognised(self, cell: str) -> bool:
        """Whether a heading is a signal's, or in the map."""
        return self.mapped(cell) is not None or self.parted(cell)[0] is not None

    def nearest(self, name: str) -> str | None:
        """The signal that a name which is none was probably meant to be; None if it is near to none."""
        called = fold(name)
        meant = {fold(known): known for known in self.known}
        meant |= {each: canonical(each, self.mechanism) for each in ALIASES}
        close = difflib.get_close_matches(called, list(meant), n=1, cutoff=SIMILAR_NAME)
        if close:
            return meant[close[0]] if meant[close[0]] in self.known else None
        words = {word for word in called.split("_") if len(word) >= WORD}
        return next((known for key, known in meant.items() if words and words <= set(key.split("_"))), None)


def is_unit(text: str, kind: QuantityKind) -> bool:
    """Whether a text is a unit of this kind."""
    try:
        factor(text, kind)
    except UnitError:
        return False
    return True


def fold(name: str) -> str:
    """A name without capitals, spaces and hyphens."""
    return re.sub(r"[\s\-/.:]+", "_", name.strip()).lower()


def unit_of(heading: str) -> str:
    """The unit in a heading's brackets."""
    brackets = BRACKETED.fullmatch(heading)
    return ((brackets[2] or brackets[3] or "") if brackets else "").strip()


def written_unit(heading: str, kind: QuantityKind) -> str:
    """The unit in a heading's brackets or at its end, if it is of this kind."""
    suffix = re.search(r"[_\s]([A-Za-z]+)$", heading.strip())
    unit = unit_of(heading) or (SUFFIXES.get(suffix[1].lower(), "") if suffix else "")
    return unit if is_unit(unit, kind) else ""


def clocklike(heading: str) -> bool:
    """Whether a column is called like time."""
    bare = BRACKETED.fullmatch(heading)
    words = re.split(r"[_\W\d]+", fold(bare[1] if bare else heading))
    return any(word in CLOCKS for word in words)


def canonical(signal: str, mechanism: Mechanism) -> str:
    """``crank_angle`` stands for the driven body's angle, ``crank_angular_velocity`` for its rate, unless another body
    is called crank.
    """
    if "crank" in mechanism.moving or not mechanism.cranked:
        return signal
    return f"{mechanism.driven}{signal.removeprefix('crank')}" if signal in ALIASES else signal


def read_headings(cells: Sequence[str], units: Mapping[int, str], names: Naming, where: str, timed: bool) -> Headings:
    """What the columns with these headings are; ``units`` are those of a row of units, by column, and ``where`` is the
    header's line.  With ``timed`` a file without time is at fault.
    """
    columns: list[Column] = []
    notes: list[str] = []
    faults: list[str] = []
    used: set[str] = set()
    ignored: list[str] = []
    for place, cell in enumerate(cells):
        at = f"{where}: column {place + 1}"
        entry = names.mapped(cell)
        if entry is not None:
            used.add(entry)
            meaning = names.layout.columns[entry]
            column = None if isinstance(meaning, str) else _mapped(at, place, cell, units, names, entry, meaning)
        else:
            column = _named(at, place, cell, units, names)
            if column is None:
                ignored.append(cell)
        if isinstance(column, Column):
            columns.append(column)
        elif column is not None:
            faults.append(column)
    if names.layout.optional:
        columns, doubled = _first_of_each(columns)
        ignored_twice = [cells[column.place] for column in doubled]
        notes += [ignored_columns(ignored_twice, "a signal that another column is too")] if doubled else []
    if ignored:
        notes.append(ignored_columns(ignored, "no signal of the linkage") + _of_a_load(ignored))
    faults += _twice(where, columns, cells, names)
    time = next((c for c in columns if c.signal == TIME), None)
    loads = tuple(c for c in columns if c.signal.kind == "load")
    others = tuple(c for c in columns if c.signal.kind not in ("time", "load"))
    if timed and time is None and not faults:
        faults.append(f"{where}: has no column of time among {_listed(cells)}; add 'time [s]', or say which it is")
    if not others and not faults:
        rest = [cell for cell in cells if time is None or cell != cells[time.place]]
        what = f"none of {_listed(rest)} is a signal of {names.mechanism.name!r}" if rest else "has no column but time"
        remedy = f"say in [columns] which they are, such as {_examples(names)}"
        faults.append(f"{where}: {what}; is it the header? if so, {remedy if names.mappable else 'rename its columns'}")
    return Headings(time, others, tuple(notes), tuple(faults), tuple(cells), frozenset(used), loads)


def _mapped(
    at: str, place: int, cell: str, units: Mapping[int, str], names: Naming, entry: str, meaning: ColumnMeaning
) -> Column | str:
    """A column that the map has, or what is wrong with it."""
    signal = names.signal(meaning.signal) if meaning.signal is not None else None
    if meaning.load is not None:
        fault = names.unloadable(meaning.load)
        if fault:
            return f"{at}, {shown(cell)}: columns.{shown(entry)[1:-1]}.load {fault}"
        signal = Signal("load", BRACKETS.sub("", cell).strip(), "force" if any(meaning.load.force) else "torque")
    elif signal is None and meaning.signal is not None:
        near = names.nearest(meaning.signal)
        remedy = f"did you mean {near!r}" if near else f"the signals are {', '.join(names.known)}"
        remedy = marked(meaning.signal, names.mechanism) or remedy
        return (
            f"{at}, {shown(cell)}: columns.{shown(entry)[1:-1]}.signal = {shown(meaning.signal)} is not a signal of"
            f" {names.mechanism.name!r}; {remedy}"
        )
    assert signal is not None
    unit = meaning.unit if meaning.unit is not None else names.parted(cell)[2] or units.get(place, "")
    return _column(at, place, cell, signal, unit, meaning)


def _named(at: str, place: int, cell: str, units: Mapping[int, str], names: Naming) -> Column | str | None:
    """A column by its own heading, what is wrong with it, or None if it is none of the linkage's."""
    if not cell.strip() or (BRACKETED.fullmatch(cell) is None and re.search(r"[\[\]]", cell)):
        return f"{at} is {shown(cell)}; write 'signal [unit]', such as 'crank_angle [deg]'"
    signal, name, unit = names.parted(cell)
    if signal is not None:
        return _column(at, place, cell, signal, unit if unit is not None else units.get(place, ""), None)
    point, near = marked(name, names.mechanism), names.nearest(name) if name else None
    if near is None and not point:
        return None
    remedy = f'say [columns] {shown(cell)} = "ignore"' if names.mappable else "leave the column out"
    meant = point or f"did you mean {near!r}"
    return (
        f"{at}, {shown(name)}, is not a signal of {names.mechanism.name!r}; {meant}; if it is something else, {remedy}"
    )


def _column(at: str, place: int, cell: str, signal: Signal, unit: str, meaning: ColumnMeaning | None) -> Column | str:
    if "," in unit:
        return (
            f"{at}: unit {shown(unit)} has a comma: it looks as if the file has decimal commas; save it with decimal"
            f" points, in units too ({shown(unit.replace(',', '.'))})"
        )
    try:
        return Column(signal, unit, factor(unit, dimension(signal)), place, meaning, cell.strip())
    except UnitError as error:
        return f"{at}, {signal.name!r}, has {error}"


def _examples(names: Naming) -> str:
    """A few signals that a file may have."""
    kinds = ("pose", "reaction")
    examples = [next((name for name, signal in names.known.items() if signal.kind == kind), "") for kind in kinds]
    return ", ".join(name for name in (*examples, "drive_torque") if name in names.known)


def _twice(where: str, columns: Sequence[Column], cells: Sequence[str], names: Naming) -> list[str]:
    """A fault for each signal that is there twice under one name.  ``crank_angle`` beside the driven body's own angle,
    as our own results have it, is looked at where its numbers are known.
    """
    places: dict[str, list[int]] = {}
    for column in columns:
        places.setdefault(column.signal.name, []).append(column.place)
    return [
        f"{where}: {name!r} is there {len(at)} times, in columns {', '.join(str(k + 1) for k in at)}; give each signal"
        " one column"
        for name, at in places.items()
        if len(at) > 1 and sorted(fold(names.parted(cells[k])[1]) for k in at) != _own_and_alias(name, names.mechanism)
    ]


def _first_of_each(columns: Sequence[Column]) -> tuple[list[Column], list[Column]]:
    """The first column of each signal, and the others."""
    first = list({column.signal.name: column for column in reversed(columns)}.values())
    return [c for c in columns if c in first], [c for c in columns if c not in first]


def _own_and_alias(signal: str, mechanism: Mechanism) -> list[str]:
    """The names of a signal: its own and its alias."""
    return sorted(fold(name) for name in {signal, *ALIASES} if canonical(name, mechanism) == signal)


def _of_a_load(cells: Sequence[str]) -> str:
    """What one may say of the first of these columns that is a force or a torque; empty without one."""
    push = next((cell.strip() for cell in cells for kind in ("force", "torque") if is_unit(unit_of(cell), kind)), None)
    return "" if push is None else f"; if {shown(push)} acts on it, [columns] may say so: load = {{ body = ..., ... }}"


def ignored_columns(cells: Sequence[str], what: str) -> str:
    """A sentence on columns with these headings that are not used."""
    return f"{_listed(cells)} {'is' if len(cells) == 1 else 'are'} {what}, and ignored"


def _listed(cells: Sequence[str], most: int = 6) -> str:
    more = f" and {len(cells) - most} more" if len(cells) > most else ""
    return ", ".join(shown(cell.strip()) for cell in cells[:most]) + more
