"""Measured data: ``measured.toml`` and its CSV files as runs of channels in SI, checked, with the noise of every
sensor.

What cannot be used is refused with one sentence (file, line or field, value, remedy); what can be mended is, and
recorded as a :class:`Fault`.
"""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.structure import StructureError
from analytic.mechanism import Load, Mechanism, MechanismError
from analytic.mechanism.assumed import Assumed
from analytic.mechanism.columns import Layout
from analytic.mechanism.one_line import count, shown
from analytic.mechanism.signals import undirected, unwound, wrapped
from compare.diagnose.data.clipping import clipped
from compare.diagnose.data.measured_file import Entry, Said, nominal, read_file, tolerances
from compare.diagnose.data.quality import FLOOR, evened, gaps, noise, outliers, switched, unwrapped
from compare.diagnose.data.recording import Channel, Drive, Fault, Measured, MeasuredError, MeasuredRun, same_numbers
from compare.diagnose.data.thin import frozen, held, missed, picked
from compare.diagnose.data.wanted import wanted
from compare.faults import unusable
from compare.progress import progress_bar
from compare.recorded.alternatives import less, swapped
from compare.recorded.errors import DataError
from compare.recorded.frames import FrameSource
from compare.recorded.headings import TIME, Column, canonical
from compare.recorded.smooth import Smoother
from compare.recorded.table import LARGEST_READING, Table, read_table, unused
from compare.recorded.text import MIN_ROWS

ASTRAY = math.radians(20.0)  # an encoder that far from its command throughout is no offset but a wrong drive_angle
MULTIPLE = 2.0  # of the command, or its inverse: an encoder that turns beyond is not of this run
OF_EACH = "a diagnosis of several follows a motor in each: give each a [[drive]] with a speed, or 'measured'"
SAMPLES = 20_000  # of a run that are kept; more would tell little and take long to simulate
# Ratios of the measured to the commanded speed that are a slip of units, and whose.
SLIPS = {
    -1.0: "negate drive_speed or the column",
    math.pi / 180: "drive_speed looks like deg/s; give rad/s",
    180 / math.pi: "the column looks like degrees; put its unit right",
    math.pi / 30: "drive_speed looks like rpm; give rad/s",
    2 * math.pi: "drive_speed looks like turns per second; give rad/s",
    0.5 / math.pi: "the column looks like turns; put its unit right",
    1e-3: "time looks like ms; put its unit right",
}


def data_of(measured: Measured | str | Path) -> Measured:
    """Measured data, or those of a measured.toml.  Raises ArgumentError, MeasuredError."""
    if isinstance(measured, Measured):
        return measured
    if isinstance(measured, str | os.PathLike):
        return load_measured(measured)
    raise unusable("measured", measured, "a path, or what lc.measured makes of data frames")


@progress_bar(what="read measured data")
def load_measured(path: str | Path) -> Measured:
    """Read measured.toml, the mechanism and the data files that it names, relative to it.  Raises MeasuredError."""
    if not isinstance(path, str | os.PathLike):
        raise MeasuredError(f"{shown(str(path))} is no path; give that of a measured.toml, or of its folder")
    path = Path(path)
    path = path / "measured.toml" if os.path.isdir(path) else path
    file = read_file(path)
    return recorded(str(path), path.name, file, nominal(path, file.mechanism), lambda name: path.parent / name)


def recorded(
    source: str, called: str, file: Said, mechanism: Mechanism, data: Callable[[str], Path | FrameSource]
) -> Measured:
    """What is said of runs as a recording of a ``source`` that is ``called`` so; ``data`` has their data by ``file``.

    Raises MeasuredError.
    """
    names = [entry.name for entry in file.runs]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise MeasuredError(
            f"{called}: run {twice!r} is there {names.count(twice)} times; give each run a name of its own"
        )
    if all(entry.role == "validation" for entry in file.runs):
        raise MeasuredError(
            f"{called}: every run has role = 'validation' ({', '.join(names)}), and nothing is left to fit; leave"
            " role out of at least one"
        )
    if file.sensors:
        try:
            mechanism = mechanism.replace(sensors=(*mechanism.sensors, *file.sensors))
        except MechanismError as error:
            raise MeasuredError(f"{called}: {error}") from None
    tolerance = tolerances(called, file.tolerance)
    tables = _Tables(data, mechanism, file)
    read: list[tuple[MeasuredRun, list[Fault]]] = []
    wrong: list[str] = []
    for entry in file.runs:
        try:
            read.append(_run(called, entry, mechanism, tables))
        except DataError as error:
            wrong += error.faults
    wrong += tables.unused(called, file.runs) if not wrong else []
    if wrong:
        raise MeasuredError(*dict.fromkeys(wrong))
    return Measured(
        mechanism,
        tuple(run for run, _ in read),
        tolerance,
        tuple(f for _, faults in read for f in faults) + tuple(_repeated([run for run, _ in read])),
        source,
        tuple(
            each for entry, (run, _) in zip(file.runs, read, strict=True) for each in _assumed(entry, run, mechanism)
        ),
        file.prior,
        wanted(called, file.context, mechanism),
    )


def _assumed(entry: Entry, run: MeasuredRun, mechanism: Mechanism) -> Iterator[Assumed]:
    """What a run takes on of how it is driven, or let go."""
    where = f"run[{run.name}]"
    if run.speed is not None and entry.drive_speed is None:
        yield Assumed(f"{where}.drive_speed", run.speed, "rad/s", "drive.speed of the mechanism")
    if run.angle is not None and entry.drive_angle is None:
        yield Assumed(f"{where}.drive_angle", run.angle, "rad", "the driven body's angle of [assembly]")
    given = {canonical(name, mechanism) for name in entry.start or {}}
    for name, value in run.start.items():
        if name not in given:
            unit = "rad" if name == mechanism.encoder.name else "rad/s"
            yield Assumed(f"{where}.start.{name}", value, unit, "as its readings begin, else assembled and at rest")


class _Tables:
    """The data of a measured.toml by its files, each read once, and the entries of [columns] that they have."""

    def __init__(self, data: Callable[[str], Path | FrameSource], mechanism: Mechanism, layout: Layout) -> None:
        self._data, self._mechanism, self._layout = data, mechanism, layout
        self._read: dict[tuple[str, str], Table] = {}

    def __call__(self, entry: Entry) -> Table:
        """The table of a run's file, as the run's own columns mean it.  Raises DataError."""
        key = entry.file, f"{entry.part} {entry.columns!r}"
        if key not in self._read:
            columns = {**self._layout.columns, **entry.columns}
            layout = self._layout.model_copy(update={"columns": columns})
            self._read[key] = read_table(self._data(entry.file), self._mechanism, layout, part=entry.part)
        return self._read[key]

    def ignored(self, entry: Entry) -> set[str]:
        """Signals whose columns a run has and is not to have: what is said of their noise stays without a use."""
        columns = {**self._layout.columns, **entry.columns}
        headings = (heading for heading, meaning in columns.items() if meaning == "ignore")
        return {canonical(heading.partition("[")[0].strip(), self._mechanism) for heading in headings}

    def unused(self, name: str, runs: Sequence[Entry]) -> list[str]:
        """A fault for each entry of [columns] that no file has, and of a run's that its own has not."""
        used = {entry for table in self._read.values() for entry in table.used}
        headings = list(dict.fromkeys(heading for table in self._read.values() for heading in table.headings))
        entries = () if self._layout.optional else self._layout.columns
        faults = [unused(f"{name}: ", entry, headings) for entry in entries if entry not in used]
        for run in runs:
            table = self(run)
            where = f"{name}: run {run.name!r}: "
            faults += [unused(where, entry, table.headings) for entry in run.columns if entry not in table.used]
        return faults


def _run(called: str, entry: Entry, mechanism: Mechanism, tables: _Tables) -> tuple[MeasuredRun, list[Fault]]:
    """A run and what was wrong with it."""
    where = f"{called}: run {entry.name!r}"
    meant = {
        field: {canonical(k, mechanism): v for k, v in named.items()}
        for field in ("noise", "start")
        if (named := getattr(entry, field))
    }
    entry = entry.model_copy(update=meant)
    drive, speed, angle = _command(where, entry, mechanism)
    _check_fields(where, entry, mechanism, drive)
    table = tables(entry)
    for signal in entry.noise:
        if signal not in table.values and signal not in tables.ignored(entry):
            raise MeasuredError(
                f"{where}: noise.{signal} is not a column of {entry.file}; the columns are {', '.join(table.values)}"
            )
    encoders = [encoder.name for encoder in mechanism.encoders]
    followed = encoders if drive == "measured" else []
    _check_encoders(where, entry, mechanism, followed, table.values)
    faults = [Fault(entry.name, TIME.name, "columns", 0, note) for note in table.notes]
    faults += _of_start(entry, mechanism)
    faults += _gap_fault(entry.name, table.time)
    for encoder in followed:
        table, absent = _held(entry.name, table, encoder)
        faults += absent
    channels: dict[str, Channel] = {}
    for column in table.columns:
        command = (
            angle + speed * table.time
            if column.signal.name in encoders and angle is not None and speed is not None
            else None
        )
        channel, found = _channel(entry, column, table, command)
        faults += found
        if channel is not None:
            channels[column.signal.name] = channel
    _check_encoders(where, entry, mechanism, followed, table.values, channels)
    if followed and mechanism.several:
        assembly = Assembly(mechanism)
        for joint, encoder in zip(mechanism.motors, followed, strict=True):
            values = frozen(assembly.on_its_turn(joint.name, unwound(channels[encoder].values)))
            channels[encoder] = replace(channels[encoder], values=values)
    push = _push(where, entry, mechanism, channels) if entry.drive == "torque" else None
    if not set(channels) - set(followed):
        told = f" ({faults[-1].text})" if faults else ""
        beside = f" besides {'its encoders' if len(followed) > 1 else 'the encoder'}" if followed else ""
        raise MeasuredError(f"{where}: {entry.file} has no usable signal{beside}{told}; add a sensor")
    if speed is not None and encoders[0] in channels:
        _check_speed(where, entry.file, table.time, channels, encoders[0], speed, angle or 0.0)
    let_go = drive == "free" and push is None
    start, unsure = _start(entry, mechanism, table.time, channels) if let_go else ({}, {})
    run = MeasuredRun(
        entry.name,
        table.time,
        channels,
        drive,
        speed,
        angle,
        start,
        _acting(where, entry, mechanism, table, drive),
        entry.from_rest,
        entry.file,
        entry.role,
        table.clock,
        push,
        unsure=unsure,
    )
    run, rounded = evened(run)
    return _thinned(where, run, encoders, [*faults, *rounded])


def _check_encoders(
    where: str,
    entry: Entry,
    mechanism: Mechanism,
    followed: Sequence[str],
    columns: Mapping[str, np.ndarray],
    moving: Mapping[str, object] | None = None,
) -> None:
    """Every encoder that a run follows has a column, and moves."""
    instead = " or give drive_speed" if mechanism.cranked else ""
    still = "each drive has to: check the encoder, give another run" if mechanism.several else "check the encoder"
    for encoder in followed:
        if encoder not in columns:
            raise MeasuredError(
                f"{where}: drive is measured, but {entry.file} has no column {encoder!r}; add the encoder{instead}"
            )
        if not np.isfinite(columns[encoder]).any():
            raise MeasuredError(
                f"{where}: drive is measured, but {encoder!r} in {entry.file} is empty; fill it in{instead}"
            )
        if moving is not None and encoder not in moving:
            raise MeasuredError(
                f"{where}: drive is measured, but {encoder!r} in {entry.file} does not move; {still}{instead}"
            )


def _command(where: str, entry: Entry, mechanism: Mechanism) -> tuple[Drive, float | None, float | None]:
    """Kind of drive, speed (rad/s) and angle at time 0 (rad): the run's, or else the mechanism's own."""
    if entry.drive is not None and entry.drive_speed is not None:
        raise MeasuredError(
            f"{where}: drive = {entry.drive!r} and drive_speed = {entry.drive_speed:g} exclude each other; keep one"
        )
    if entry.drive_speed == 0:
        raise MeasuredError(
            f"{where}: drive_speed = 0; give the commanded speed in rad/s, or drive = 'measured' or 'free'"
        )
    if mechanism.several:
        return _followed(where, entry, mechanism), None, None
    _check_freedoms(where, mechanism)
    own = "free" if mechanism.drive is None else mechanism.drive.speed
    said = entry.drive or (own if entry.drive_speed is None else entry.drive_speed)
    if said == "torque":
        _check_pushed(where, mechanism)
        return "free", None, None
    if mechanism.sliding and said != "measured":
        how = "free" if said == "free" else f"driven at {said:g} m/s"
        raise MeasuredError(
            f"{where}: is {how}, and {mechanism.name!r} is moved along the slide {mechanism.encoder.place!r}, whose"
            f" runs follow {mechanism.encoder.name}; say drive = 'measured'"
        )
    if said != "free" and mechanism.drive is None:
        raise MeasuredError(
            f"{where}: is driven, but {mechanism.name!r} has no [drive]; add one, or say drive = 'free'"
        )
    if said == "free" or said == "measured":
        if entry.drive_angle is not None:
            raise MeasuredError(
                f"{where}: drive_angle = {entry.drive_angle:g} belongs to a drive_speed, and the drive is {said}; leave"
                " it out"
            )
        return said, None, None
    return (
        "speed",
        float(said),
        mechanism.assembly[mechanism.driven] if entry.drive_angle is None else entry.drive_angle,
    )


def _check_pushed(where: str, mechanism: Mechanism) -> None:
    """A motor whose torque is the input moves one crank or slide on the ground, and nothing yields in between."""
    drive = mechanism.drive
    if drive is None or "ground" not in mechanism.input_joint.bodies:
        raise MeasuredError(
            f"{where}: drive = 'torque' is of a motor between the ground and a crank or slide, and {mechanism.name!r}"
            " has none; give it a [[drive]], or say drive = 'measured'"
        )
    if drive.stiffness is not None or drive.half_gap:
        raise MeasuredError(
            f"{where}: drive = 'torque' is of a rigid drive, and that of {mechanism.name!r} yields or has backlash; say"
            " drive = 'measured'"
        )


def _push(where: str, entry: Entry, mechanism: Mechanism, channels: dict[str, Channel]) -> Channel:
    """The motor's torque (or force), which is taken out of the sensors.  Raises MeasuredError without one, or without
    an encoder.
    """
    effort, encoder = mechanism.efforts[0].name, mechanism.encoder.name
    for name, what in ((effort, "what its motor gives"), (encoder, "where it is")):
        if name not in channels:
            raise MeasuredError(
                f"{where}: drive = 'torque', and {entry.file} has no usable column {name!r}, {what}; add it, or say"
                " drive = 'measured' or 'free'"
            )
    return channels.pop(effort)


def _followed(where: str, entry: Entry, mechanism: Mechanism) -> Literal["measured"]:
    """The drive of a run in which several move, or one that is no crank's: it follows its encoders."""
    moved = " and ".join(drive.joint for drive in mechanism.drives)
    encoders = " and ".join(encoder.name for encoder in mechanism.encoders)
    if entry.drive != "measured":
        said = f"driven at {entry.drive_speed:g}" if entry.drive_speed is not None else entry.drive or "not said to be"
        raise MeasuredError(
            f"{where}: is {said}, and {mechanism.name!r} is driven in {moved}, whose runs follow {encoders}; say"
            " drive = 'measured'"
        )
    if entry.drive_angle is not None:
        raise MeasuredError(
            f"{where}: drive_angle = {entry.drive_angle:g} belongs to a drive_speed, and the drive is measured; leave"
            " it out"
        )
    idle = [drive.joint for drive in mechanism.drives if drive.speed == "free"]
    freedoms = len(Assembly(mechanism).structure.inputs)
    if idle or freedoms > len(mechanism.motors):
        raise MeasuredError(
            f"{where}: {mechanism.name!r} has {freedoms} freedoms, and motors in"
            f" {' and '.join(j.name for j in mechanism.motors) or 'none'}; {OF_EACH}"
        )
    return "measured"


def _check_freedoms(where: str, mechanism: Mechanism) -> None:
    """A linkage that one crank moves, or nothing, has one freedom."""
    try:
        freedoms = len(Assembly(mechanism).structure.inputs)
    except (AssemblyError, StructureError):
        return  # that is told when it is to move
    if freedoms > 1:
        raise MeasuredError(f"{where}: {mechanism.name!r} has {freedoms} freedoms; {OF_EACH}")


def _check_fields(where: str, entry: Entry, mechanism: Mechanism, drive: Drive) -> None:
    """Fields that go with the drive, and names that the mechanism has."""
    if entry.start is not None and (drive != "free" or entry.drive == "torque"):
        raise MeasuredError(
            f"{where}: start belongs to drive = 'free', and the drive is {entry.drive or drive}; leave it out"
        )
    if entry.from_rest and drive == "free":
        raise MeasuredError(f"{where}: from_rest belongs to a driven run, and the drive is free; give start instead")
    for applied in entry.loads or ():
        if not all(abs(value) < LARGEST_READING for value in (*applied.force, applied.torque)):
            raise MeasuredError(
                f"{where}: load on {shown(applied.body)} has {applied.force} N and {applied.torque} N.m; give what is"
                f" below {LARGEST_READING:g}"
            )
    states = [f"{body}_{part}" for body in mechanism.moving for part in ("angle", "angular_velocity")]
    for name in entry.start or {}:
        if name not in states:
            close = difflib.get_close_matches(name, states, n=1)
            remedy = f"did you mean {close[0]!r}" if close else f"use {', '.join(states)}"
            raise MeasuredError(f"{where}: start.{name} is not a state; {remedy}")
    given = entry.start or {}
    if (
        given
        and drive == "free"
        and f"{mechanism.driven}_angle" not in given
        and not set(given) <= {f"{mechanism.driven}_angular_velocity"}
    ):
        raise MeasuredError(
            f"{where}: start has {', '.join(given)}; give {mechanism.driven}_angle, from which the others follow"
        )
    try:
        mechanism.replace(loads=entry.loads or ())
    except MechanismError as error:
        raise MeasuredError(f"{where}: {error}") from None


def _acting(where: str, entry: Entry, mechanism: Mechanism, table: Table, drive: Drive) -> tuple[Load, ...] | None:
    """The loads of a run: its own in place of the mechanism's, and columns that are loads beside them.  Raises
    MeasuredError or DataError for one over time where nothing in a diagnosis can follow it.
    """
    recorded = table.acting(entry.file, table.time)
    loads = (*(mechanism.loads if entry.loads is None else entry.loads), *recorded)
    timed = next((load for load in loads if load.over == "time"), None)
    springy = any(each.stiffness is not None or each.half_gap for each in mechanism.drives)
    if timed is not None and (drive == "free" or springy):
        why = "is free" if drive == "free" else "has a drive that yields"
        raise MeasuredError(
            f"{where}: {why}, and the load on {shown(timed.body)} varies over time, which a diagnosis follows in runs"
            " behind a rigid motor; give over = crank_angle, or leave the run out"
        )
    return loads if recorded else entry.loads


def _of_start(entry: Entry, mechanism: Mechanism) -> list[Fault]:
    """What is said of a run's start and is not used."""
    texts = []
    if entry.from_rest:
        texts.append(
            f"run {entry.name!r} starts from rest and is simulated in steady motion: leave its start-up out of the"
            " file, or it will look like a fault"
        )
    own = {f"{mechanism.driven}_{part}" for part in ("angle", "angular_velocity")} if entry.start else set()
    for name in set(entry.start or {}) - own:
        texts.append(f"start.{name} of run {entry.name!r} follows from {mechanism.driven}_angle, and is not used")
    return [Fault(entry.name, TIME.name, "start", 0, text) for text in sorted(texts)]


def _channel(
    entry: Entry, column: Column, table: Table, command: np.ndarray | None
) -> tuple[Channel | None, list[Fault]]:
    """A column as a channel, without what is faulty in it; None if nothing is left."""
    run, signal, values = entry.name, column.signal.name, table.values[column.signal.name]
    faults: list[Fault] = []

    def fault(kind: str, samples: int, text: str) -> None:
        faults.append(Fault(run, signal, kind, samples, f"{signal} of run {run!r} {text}"))

    if column.signal.wraps:
        values, jumps = unwrapped(values, command)
        if jumps:
            fault("wrapped", jumps, f"jumps by a turn {count(jumps, 'time')}; it is continued instead")
    full, levels = clipped(table.time, values)
    if np.any(full):
        ends = " and ".join(f"{level / column.factor:.5g}" for level in levels)
        text = f"is clipped at {ends} {column.unit} in {100 * np.mean(full):.2g} % of its samples, which are left out"
        fault("clipped", int(np.sum(full)), text)
        values = np.where(full, math.nan, values)
    given = entry.noise.get(signal)
    held = switched(values) if column.signal.kind in ("drive", "reaction") else 0.0
    estimate = held or noise(table.time, values)
    spikes = outliers(table.time, values, max(estimate, given or 0.0))
    isolated = None
    if spikes.size:
        first = table.time[spikes[0]]
        fault(
            "outliers",
            spikes.size,
            f"has {spikes.size} isolated spike{'s' * (spikes.size > 1)}, the first at {first:.6g} s, left out",
        )
        isolated = np.full(values.size, math.nan)
        isolated[spikes] = values[spikes]
        isolated.flags.writeable = False
        values = np.where(np.isfinite(isolated), math.nan, values)
        estimate = held or noise(table.time, values)
    if column.signal.wraps and jumps and command is None and (step := undirected(values)):
        fault("wrapped", jumps, f"steps by {np.degrees(step):.4g} deg and may have turned the longer way round")
    present = values[np.isfinite(values)]
    if present.size < MIN_ROWS:
        fault(
            "absent",
            values.size,
            f"has {present.size} usable samples, and at least {MIN_ROWS} are needed; it is left out",
        )
        return None, faults
    if np.ptp(present) == 0:
        fault(
            "constant",
            present.size,
            f"is {present[0] / column.factor:.6g} {column.unit} throughout; a sensor that does not move is left out",
        )
        return None, faults
    if given is not None and estimate > 3 * max(given, FLOOR * float(np.ptp(present))):
        fault(
            "noise",
            present.size,
            f"scatters by {estimate / column.factor:.3g} {column.unit} from line to line, and a noise of"
            f" {given / column.factor:.3g} {column.unit} is given; the given one is used",
        )
    read = frozen(values), given or estimate, given is not None
    return Channel(column.signal, *read, column.unit, isolated, column), faults


def _gap_fault(run: str, time: np.ndarray) -> list[Fault]:
    count, samples, longest = gaps(time)
    text = (
        f"run {run!r} has {count} gap{'s' * (count > 1)} in time, the longest {longest:.4g} s; nothing is assumed in"
        " between"
    )
    return [Fault(run, "time", "gap", samples, text)] if count else []


def once(measured: Measured) -> Measured:
    """A measurement without the runs that are the recording of another one once more."""
    again = {fault.run for fault in measured.faults if fault.kind == "repeated"}
    return replace(measured, runs=tuple(run for run in measured.runs if run.name not in again)) if again else measured


def _repeated(runs: Sequence[MeasuredRun]) -> Iterator[Fault]:
    """Runs that are the recording of another one once more: its noise is the same to the last digit."""
    first: list[MeasuredRun] = []
    for run in runs:
        one = next((one for one in first if _same_recording(one, run)), None)
        if one is None:
            first.append(run)
        else:
            text = f"has the very numbers of run {one.name!r}: one recording counts once, and this one is left out"
            yield Fault(run.name, "time", "repeated", run.time.size, f"run {run.name!r} {text}")


def _same_recording(one: MeasuredRun, other: MeasuredRun) -> bool:
    """Whether all that both runs have is the same to the last digit: a stated noise may be too large to judge by."""
    both = [(one.channels[s].values, other.channels[s].values) for s in one.channels.keys() & other.channels.keys()]
    return bool(both) and all(np.array_equal(a, b, equal_nan=True) and np.isfinite(a).any() for a, b in both)


def _held(run: str, table: Table, encoder: str) -> tuple[Table, list[Fault]]:
    """The table without the rows in which nobody knows where the drive was."""
    keep = held(table.time, table.values[encoder])
    if np.all(keep):
        return table, []
    lost = np.flatnonzero(~keep)
    text = (
        f"run {run!r} follows {encoder}, which is absent for a while from {table.time[lost[0]]:.6g} s;"
        f" {count(lost.size, 'row')}"
        " without it are left out"
    )
    return table.at(keep), [Fault(run, encoder, "absent", lost.size, text)]


def _check_speed(
    where: str, file: str, time: np.ndarray, channels: Mapping[str, Channel], name: str, speed: float, angle: float
) -> None:
    """The encoder does not contradict the command by a clean factor, by a multiple, or by a large angle."""
    encoder = channels[name]
    found = _rate(time, encoder.values)
    here = np.isfinite(encoder.values)
    away = float(np.median(wrapped(encoder.values[here] - angle - speed * time[here])))
    if abs(found / speed - 1) < 0.03 and abs(away) > ASTRAY:
        text = f"{name} in {file} is {math.degrees(away):.4g} deg ahead of its command throughout"
        zero = "" if encoder.column is None else f", or, if its zero is elsewhere, say {less(encoder.column, away)}"
        raise MeasuredError(f"{where}: {text}; check drive_angle = {angle:g} rad, which is the angle at time 0{zero}")
    if (other := _instead(time, channels, name, speed)) and abs(found / speed - 1) > 0.03:
        text = f"drive_speed = {speed:g} rad/s, and the numbers in {other} turn so, not those in {name}"
        lines = ", ".join(swapped(channels[name].column, channels[other].column))
        raise MeasuredError(
            f"{where}: {text}: the columns look swapped in {file}; say columns = {{ {lines} }} in the run"
        )
    for ratio, remedy in SLIPS.items():
        if abs(found / speed / ratio - 1) < 0.03:
            text = (
                f"drive_speed = {speed:g} rad/s, but {name} in {file} turns at {found:.5g} rad/s,"
                f" {found / speed:.4g} times as fast"
            )
            raise MeasuredError(f"{where}: {text}; {remedy}")
    if not 1 / MULTIPLE < found / speed < MULTIPLE:
        text = f"drive_speed = {speed:g} rad/s, but {name} in {file} turns at {found:.5g} rad/s"
        twin = next((s for s, c in channels.items() if s != name and same_numbers(encoder, c)), None)
        if twin is None:
            raise MeasuredError(f"{where}: {text}; put the one right that is wrong")
        column = channels[name].column
        heading = name if column is None else column.heading
        raise MeasuredError(
            f"{where}: {name} and {twin} are the same numbers, one column there twice: {text}; say"
            f' "{heading}" = "ignore" under [columns] if that is the copy, or put the one right that is wrong'
        )


def _rate(time: np.ndarray, values: np.ndarray) -> float:
    """How fast values (N,) change with time (N,), from samples far apart, so that a coarse encoder has moved."""
    here = np.flatnonzero(np.isfinite(values))
    lag = max(1, here.size // 2)
    return float(np.median((values[here[lag:]] - values[here[:-lag]]) / (time[here[lag:]] - time[here[:-lag]])))


def _instead(time: np.ndarray, channels: Mapping[str, Channel], name: str, speed: float) -> str | None:
    """The sensor whose column has numbers that turn at a speed (rad/s) as those in an encoder's column should."""
    column = channels[name].column
    for other, channel in channels.items():
        if other != name and column is not None and channel.column is not None:
            turned = channel.values * (column.factor / channel.column.factor)
            if abs(_rate(time, turned) / speed - 1) < 0.03 and not same_numbers(channels[name], channel):
                return other
    return None


def _start(
    entry: Entry, mechanism: Mechanism, time: np.ndarray, channels: Mapping[str, Channel]
) -> tuple[dict[str, float], dict[str, float]]:
    """State at the first sample: as given; left out, the driven body's on smooth courses through its readings, the rate
    from whichever sensor tells it better, with how far noise puts that off; or assembled and at rest without any.
    """
    angle, rate = mechanism.encoder.name, f"{mechanism.driven}_angular_velocity"
    found, unsure = {angle: mechanism.assembly[mechanism.driven], rate: 0.0}, {}
    if angle in channels:
        found[angle], found[rate], unsure[rate] = _first(time, channels[angle], 1)
        if rate in channels:
            value, _, off = _first(time, channels[rate], 0)
            found[rate], unsure[rate] = (value, off) if off < unsure[rate] else (found[rate], unsure[rate])
    given = dict(entry.start or {})
    return found | given, {s: off for s, off in unsure.items() if s not in given}


def _first(time: np.ndarray, channel: Channel, order: int) -> tuple[float, float, float]:
    """A channel's value and rate at the first sample, on a smooth course through its readings, and how far its
    derivative of that order may be off.
    """
    known = np.isfinite(channel.values)
    smoother = Smoother(time[known], channel.values[known])
    unsure = smoother.uncertainty(smoother.answers(time[:1])[order], smoother.sigma)
    value, rate = (float(smoother.course(time[:1], k)[0]) for k in (0, 1))
    return value, rate, float(unsure[0])


def _thinned(
    where: str, run: MeasuredRun, encoders: Sequence[str], faults: list[Fault]
) -> tuple[MeasuredRun, list[Fault]]:
    """The run with about SAMPLES samples at most, evenly picked; noise and faults were found with all of them."""
    every = math.ceil(run.time.size / SAMPLES)
    thin = picked(run, every)
    if every == 1:
        return thin, faults
    for encoder in encoders if run.drive == "measured" else ():
        error = missed(run, thin, encoder)
        if error == 0:
            continue
        raise MeasuredError(
            f"{where}: {run.time.size} samples are more than the {SAMPLES} that can be used, and one in {every} does"
            f" not hold the motion of {encoder} ({error:.2g} {run.channels[encoder].signal.unit} off); cut the run into"
            " shorter ones"
        )
    text = f"run {run.name!r} has {run.time.size} samples; one in {every} is used, their noise is estimated from all"
    return thin, [*faults, Fault(run.name, "time", "thinned", run.time.size - thin.time.size, text)]
