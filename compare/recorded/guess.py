"""What the columns of a file are, guessed: time, the crank's encoder, and sensors that read what a linkage would make
them read.

A heading that is a signal's name with a unit is no guess.  Any other column is held against every signal of the nominal
model along the crank's motion: one that is a straight line in a signal, with the slope of a unit, is that signal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.columns import ANY_LAYOUT, Layout
from analytic.mechanism.one_line import shown
from analytic.mechanism.signals import Signal
from analytic.mechanism.units import SI, dimension
from compare.recorded.errors import DataError
from compare.recorded.every_column import Everything, every_column
from compare.recorded.headings import TIME, Naming, clocklike, fold, is_unit, unit_of, written_unit
from compare.recorded.likeness import NEAR_UNIT, UNKNOWN, Guess, by_model, zeroed
from compare.recorded.text import MIN_ROWS

HINTS = ("crank", "enc", "geber", "motor", "drive", "phi", "theta", "winkel", "angle", "pos")  # of an encoder's heading
LINES = (360, 400, 500, 512, 720, 1000, 1024, 1800, 2000, 2048, 2500, 3600, 4096, 5000, 8192, 9000, 10000)
ENCODER_COUNTS = tuple(n * edges for n in LINES for edges in (1, 4))  # of encoders' turns
BETTER = 0.3  # columns less that a less likely encoder must leave
EITHER = 0.1  # columns less that an encoder must leave that counts backward
OFF_SPEED = 0.05  # rad, by which a crank that turns at a speed may be off it


@dataclass(frozen=True)
class Guessed:
    """A file, or a part of one whose clock starts again: its columns, and the motion of the crank that they tell."""

    file: Path
    guesses: tuple[Guess, ...]
    values: Mapping[str, np.ndarray] = field(repr=False)  # SI, by signal
    notes: tuple[str, ...] = ()
    part: int | None = None


def guess(file: Path, mechanism: Mechanism, layout: Layout = ANY_LAYOUT, split: bool = False) -> list[Guessed]:
    """What the columns of a file are; with ``split``, of each part of one whose clock starts again.

    Raises DataError.
    """
    everything = every_column(file, mechanism, layout)
    names = Naming(mechanism, ANY_LAYOUT)
    clock = next((h for h in everything.columns if names.parted(h)[0] == TIME or clocklike(h)), None) if split else None
    if clock is None:
        return [_guessed(file, everything, mechanism)]
    starts = np.flatnonzero(np.diff(everything.columns[clock]) < 0) + 1
    pieces = [
        replace(everything, columns=dict(zip(everything.columns, piece, strict=True)))
        for piece in zip(*(np.split(values, starts) for values in everything.columns.values()), strict=True)
    ]
    long = [piece for piece in pieces if len(piece.columns[clock]) >= MIN_ROWS]
    return [replace(_guessed(file, p, mechanism), part=k if len(long) > 1 else None) for k, p in enumerate(long, 1)]


def _guessed(file: Path, everything: Everything, mechanism: Mechanism) -> Guessed:
    """What these columns are.  Raises DataError."""
    columns = everything.columns
    names = Naming(mechanism, ANY_LAYOUT)
    guesses: dict[str, Guess] = {}
    for heading, values in columns.items():
        guesses[heading] = _by_heading(heading, everything.units.get(heading), values, names)
    clock = next((g for g in guesses.values() if g.signal == TIME), None) or _clock(columns, guesses)
    if clock is None:
        raise DataError(f"{file.name}: has no column of time: none rises steadily; add one, such as 'time [s]'")
    guesses[clock.heading] = clock
    time = clock.si(columns[clock.heading])
    likely = _moving(columns, guesses, mechanism)
    crank = likely[0] if likely and likely[0] in guesses.values() else None
    tried = [by_model(columns, guesses, mechanism, time, each) for each in likely]
    if tried and crank is None and mechanism.cranked and min(each.left for each in tried) > BETTER:
        others = [zeroed(columns, guesses, mechanism, each) for each in likely]
        likely, tried = likely + others, tried + [by_model(columns, guesses, mechanism, time, each) for each in others]
    if tried:
        k = min(range(len(tried)), key=lambda i: tried[i].left + (i > 0) * BETTER + (likely[i].sign < 0) * EITHER)
        why = f"{likely[k].why}; so the other columns are nearest to the nominal model" if k else likely[k].why
        guesses[likely[k].heading] = replace(likely[k], why=why)
        guesses |= tried[k].guesses
    read = {g.signal.name: g.si(columns[heading]) for heading, g in guesses.items() if g.signal is not None}
    unread = tuple(Guess(heading, None, why="not numbers") for heading in everything.words)
    return Guessed(file, (*guesses.values(), *unread), read, everything.notes)


def _moving(columns: Mapping[str, np.ndarray], guesses: Mapping[str, Guess], mechanism: Mechanism) -> list[Guess]:
    """What the column of the motor may be: what its heading says, or several that are called like one.  Those of
    several motors have to say it.
    """
    encoder, *others = mechanism.encoders
    if others:
        return []
    named = next((g for g in guesses.values() if g.signal == encoder), None)
    return [named] if named else _encoders(columns, guesses, encoder)


def _by_heading(heading: str, below: str | None, values: np.ndarray, names: Naming) -> Guess:
    """The guess that a heading, and the unit ``below`` it, make by themselves."""
    signal, _, unit = names.parted(heading)
    unit = below if unit is None else unit
    if signal is None:
        return Guess(heading, None, why=UNKNOWN)
    if unit and not is_unit(unit, dimension(signal)):
        return Guess(heading, None, why=f"its unit {shown(unit)} is none of {dimension(signal)}")
    if unit:
        return Guess(heading, signal, unit, sure=True)
    return Guess(
        heading, signal, _likely(dimension(signal), values), why="its heading has no unit; guessed by its size"
    )


def _likely(kind: str, values: np.ndarray) -> str:
    """The unit that numbers of a kind are likely to be in."""
    size = float(np.nanmax(np.abs(values), initial=0.0))
    if kind == "time":
        step = float(np.nanmedian(np.diff(values)))
        return "s" if step < 0.2 else "ms" if step < 200 else "us"
    if kind == "angle":
        return "deg" if size > 4 * math.pi else "rad"
    if kind == "length":
        return "mm" if size > 10.0 else "m"
    return SI[kind]  # type: ignore[index]


def _clock(columns: Mapping[str, np.ndarray], guesses: Mapping[str, Guess]) -> Guess | None:
    """The column that rises steadily: time.  What is called like it goes first, and what has another unit never."""
    for heading in sorted(columns, key=lambda heading: not clocklike(heading)):
        values = columns[heading]
        step = np.diff(values)
        if guesses[heading].signal is not None or (unit_of(heading) and not written_unit(heading, "time")):
            continue
        if not clocklike(heading) and any(hint in fold(heading) for hint in HINTS):
            continue
        if np.all(step > 0) and np.std(step) < 0.2 * np.mean(step):
            unit = written_unit(heading, "time") or _likely("time", values)
            return Guess(heading, TIME, unit, why="it rises steadily")
    return None


def _encoders(columns: Mapping[str, np.ndarray], guesses: Mapping[str, Guess], signal: Signal) -> list[Guess]:
    """What the column that is called like an encoder may be, the likeliest first: its unit and direction."""
    free = {h: v for h, v in columns.items() if guesses[h].signal is None and np.ptp(v[np.isfinite(v)]) > 0}
    hinted = [h for h in free if any(hint in fold(h) for hint in HINTS)]
    for heading in hinted:
        values = free[heading]
        unit = written_unit(heading, dimension(signal))
        if unit:
            what = "crank" if signal.wraps else "slide"
            return _either_way([Guess(heading, signal, unit, why=f"called like an encoder of the {what}")])
        if not signal.wraps:  # counts of a travel say nothing of its size
            continue
        whole = np.all(values[np.isfinite(values)] == np.round(values[np.isfinite(values)]))
        if whole and np.ptp(values[np.isfinite(values)]) > 100:
            counts = _wraps(values)
            if counts:
                why = f"counts, {counts} to a turn by where they wrap"
                return _either_way([Guess(heading, signal, "deg", 360.0 / counts, why=why)])
            continue
        units = sorted(("deg", "rad", "rev"), key=lambda unit: unit != _likely("angle", values))
        odd = unit_of(heading)
        what = f"{shown(odd)} is no unit here, another" if odd else "unit"
        why = f"called like an encoder of the crank; {what} guessed"
        return _either_way([Guess(heading, signal, each, why=why) for each in units])
    return []


def _either_way(guesses: Sequence[Guess]) -> list[Guess]:
    """Encoders that count the motion forward, and those that count it backward."""
    return [*guesses, *(replace(each, sign=-1, why=f"{each.why}; it counts backward") for each in guesses)]


def _wraps(values: np.ndarray) -> int | None:
    """The counts of a turn of a column that starts again after each: what it falls short by, and the step in which it
    does.
    """
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    back = steps > 0.5 * np.nanmax(steps)
    if not back.any() or back.all() or np.nanmax(steps) < 0.5 * np.nanmax(np.abs(values)):
        return None
    about = float(np.median(steps[back]) + np.median(steps[~back]))
    nearest = min(ENCODER_COUNTS, key=lambda n: abs(n - about))
    return nearest if abs(nearest - about) / nearest < NEAR_UNIT else None
