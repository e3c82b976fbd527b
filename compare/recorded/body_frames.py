"""Columns that a file has in the frame of a body that moves, as a load cell has that is screwed to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.structure import StructureError
from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.one_line import shown
from analytic.mechanism.signals import AXES, Signal
from compare.recorded.errors import DataError
from compare.recorded.headings import Column
from compare.recorded.rounding import rounding

Vector = tuple[Column, Column]
Values = dict[str, np.ndarray]


def in_ground_frame(
    columns: Sequence[Column], values: Mapping[str, np.ndarray], m: Mechanism, file: str
) -> tuple[Values, dict[str, float]]:
    """Values (N,) by signal with those that have a ``frame`` turned into the ground's, by its body's own angle where
    the file has it, else by where the linkage has the body at the motors' positions; and how far (SI) the digits leave
    the turned ones open.  Raises DataError with every fault.
    """
    faults, out, left = list(_misplaced(columns, m, file)), dict(values), dict[str, float]()
    if faults:
        raise DataError(*faults)
    for x, y in vectors(columns):
        frame, other = _frame(x), _frame(y)
        if frame != other:
            raise DataError(f"{file}: {x.signal.name} has frame = {shown(frame)} and {y.signal.name} {shown(other)}")
        if frame != GROUND:
            first, second = x.signal.name, y.signal.name
            turned = (values[first] + 1j * values[second]) * np.exp(1j * _angle(values, m, frame, file))
            out |= {first: turned.real, second: turned.imag}
            steps = [c.step * np.max(rounding(c.readings(values[c.signal.name])), initial=0.0) for c in (x, y)]
            left |= dict.fromkeys((first, second), float(np.hypot(*steps)))
    return out, left


def vectors(columns: Sequence[Column]) -> Iterator[Vector]:
    """The columns of x and y of each vector that there are both of."""
    by_signal = {column.signal: column for column in columns}
    for signal, column in by_signal.items():
        if _is_vector(signal) and signal.component == "x" and (other := by_signal.get(signal.sibling("y"))):
            yield column, other


def _is_vector(signal: Signal) -> bool:
    return signal.kind in ("reaction", "velocity", "acceleration") and signal.component in AXES


def _frame(column: Column) -> str:
    return (column.meaning.frame if column.meaning else None) or GROUND


def _misplaced(columns: Sequence[Column], m: Mechanism, file: str) -> Iterator[str]:
    """What is wrong with the frames that a map gives, in sentences."""
    pairs = {column.signal for pair in vectors(columns) for column in pair}
    for column in columns:
        signal = column.signal
        if column.meaning is None or column.meaning.frame is None:
            continue
        at = f"{file}: column {shown(column.heading)}: frame = {shown(column.meaning.frame)}"
        if column.meaning.frame not in m.parts:
            yield f"{at} is no body; the bodies are {', '.join(m.parts)}"
        elif not _is_vector(signal):
            yield f"{at} turns x and y of a force, a velocity or an acceleration; leave it out of {signal.name}"
        elif signal not in pairs:
            other = signal.sibling("y" if signal.component == "x" else "x").name
            yield f"{at} turns x and y together; give the column of {other}, too"


def _angle(values: Mapping[str, np.ndarray], m: Mechanism, body: str, file: str) -> np.ndarray:
    """A body's angle (N,) rad in the rows of a file; NaN where its motors' positions have no number."""
    own, encoders = Signal.of("pose", body, "angle").name, [signal.name for signal in m.encoders]
    if own in values:
        return values[own]
    where = f"{file}: frame = {shown(body)}"
    if missing := [name for name in encoders if name not in values]:
        raise DataError(f"{where} needs to know how {body} is turned; give a column of {' or '.join([own, *missing])}")
    read = np.stack([values[name] for name in encoders])
    known = np.all(np.isfinite(read), axis=0)
    angle = np.full(known.shape, np.nan)
    try:
        assembly = Assembly(m.ideal())
        placed = dict(zip((joint.name for joint in m.motors), read[:, known], strict=True)) if m.several else {}
        angle[known] = kinematics(assembly, assembly.inputs_at(placed) if placed else read[0, known]).angle(body)
    except (AssemblyError, StructureError) as error:
        raise DataError(f"{where}: {error}; give a column of {own}") from None
    return angle
