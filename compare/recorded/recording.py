"""A table of results as a recording of a linkage: how it moves in it, and which rows are looked at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.initial import set_off
from analytic.kinematics.schedule import Schedule, Turning
from analytic.kinematics.structure import Structure
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.one_line import count
from analytic.mechanism.signals import position, turned_near, unwound
from compare.faults import ArgumentError
from compare.judge.reference import SIGMAS
from compare.recorded.errors import DataError
from compare.recorded.motion import (
    LEAST_SAMPLES,
    RecordedDrives,
    RecordedMotion,
    RecordedRelease,
    ReleaseState,
    evenly,
    followed,
    followed_as_given,
    off_by,
)
from compare.recorded.rounding import rounding
from compare.recorded.table import Table
from sim_models.engine import JointModel, Motion

KEPT_SAMPLES = 20_000  # of a file that are kept: more would tell little, and make a page that no browser opens


@dataclass(frozen=True)
class Recording:
    """A file of results: who wrote it, its table, and how the linkage moves in it."""

    name: str
    file: str
    table: Table
    theta: np.ndarray
    moved: RecordedMotion | RecordedDrives | RecordedRelease | ReleaseState | None = None
    error: float = 0.0  # rad, rms, of angles of a crank that turns evenly
    replaced: tuple[Load, ...] | None = None  # what acts in place of the mechanism's loads, over the table's time

    @property
    def drives(self) -> Mapping[str, RecordedMotion]:
        """By joint the drives whose recorded courses are followed, of several freedoms."""
        moved = self.moved.driven if isinstance(self.moved, RecordedRelease) else self.moved
        return moved.drives if isinstance(moved, RecordedDrives) else {}

    @property
    def starts(self) -> list[ReleaseState]:
        """From where its crank, or its freedoms, are let go."""
        if isinstance(self.moved, RecordedRelease):
            return list(self.moved.start.values())
        return [self.moved] if isinstance(self.moved, ReleaseState) else []

    @property
    def time(self) -> np.ndarray | None:
        """Its samples' times (N,) s; None where they belong to crank angles."""
        return self.table.time if self.table.time.size else None

    def schedule(self, mechanism: Mechanism, at_rest: bool) -> Schedule:
        """Its motion, or rest in its poses."""
        if isinstance(self.moved, RecordedMotion):
            return self.moved.schedule(mechanism)
        if isinstance(self.moved, RecordedDrives):
            return self.moved.schedule(at_rest)
        if isinstance(self.moved, RecordedRelease):
            return self.moved.schedule
        if isinstance(self.moved, ReleaseState):
            return Schedule.released(mechanism, self.table.time - self.table.time[0], self.moved.rate)
        return Schedule.at_angles(mechanism, self.theta, at_rest=at_rest)

    def loads(self, m: Mechanism, at_rest: bool) -> tuple[Load, ...]:
        """What acts on a mechanism in it, over its schedule's time.  Raises DataError for columns where it rests."""
        file, schedule = Path(self.file).name, self.schedule(m, at_rest)
        if schedule.at_rest and self.table.loads:
            titles = " and ".join(repr(column.title) for column, _ in self.table.loads)
            raise DataError(
                f"{file}: {titles} {'act as loads' if len(self.table.loads) > 1 else 'acts as a load'} over time, which"
                ' rows at rest have not; ask for motion = "driven", or say a [[load]] over the crank\'s angle'
            )
        if self.replaced is None:
            return (*m.loads, *self.table.acting(file, schedule.time))
        return tuple(load.later(float(schedule.time[0] - self.table.time[0])) for load in self.replaced)

    def moving(self, assembly: Assembly, at_rest: bool) -> tuple[Turning | None, Turning | None]:
        """Its inputs as they were recorded, where the schedule has others, and how exactly they are known (rms)."""
        if isinstance(self.moved, RecordedMotion):
            return self.moved.moving, self.moved.errors
        if isinstance(self.moved, RecordedDrives):
            return None if at_rest else self.moved.inputs(assembly, "moving"), self.moved.inputs(assembly, "errors")
        if isinstance(self.moved, ReleaseState):
            start, error = (
                np.array([[*each, 0.0]]).T for each in ((self.moved.angle, self.moved.rate), self.moved.errors)
            )
            return Turning(*start), Turning(*error)
        if isinstance(self.moved, RecordedRelease):
            start = self.moved.inputs(assembly)
            return Turning(start, *np.zeros((2, *start.shape))), None
        return None, Turning(np.full(self.theta.shape, self.error), *np.zeros((2, 1))) if self.error else None


def recording(
    name: str, file: str, table: Table, mechanism: Mechanism, motion: Motion, joint_model: JointModel
) -> Recording:
    """A table with the motion of the linkage in it.  Raises DataError or ArgumentError."""
    if not Assembly(mechanism).structure.by_crank:
        return _of_drives(name, file, table, mechanism, motion, joint_model)
    encoder, where = mechanism.encoder.name, Path(file).name
    table = _kept(table)
    angle = table.values.get(encoder)
    released = mechanism.drive is None or mechanism.drive.speed == "free"
    if not set(table.values) - {encoder}:
        raise DataError(f"{where}: has no signal beside {encoder!r}; add what is to be compared, such as drive_torque")
    if motion == "driven" and released:
        _check_ideal(mechanism, joint_model, 'drive.speed = "measured" in the mechanism file')
        start = _start(table, mechanism)
        return Recording(name, file, table, table.values.get(encoder, np.zeros(table.time.size)), start)
    if angle is None:
        return _at_its_speed(name, file, table, mechanism, motion)
    if np.any(np.isnan(angle)):
        raise DataError(f"{where}: {encoder!r} has empty cells; give the crank's angle in every row, or leave rows out")
    angle = unwound(angle) if mechanism.encoder.wraps else angle
    if motion == "static" or not table.time.size:
        return Recording(name, file, table, angle)
    if table.time.size < LEAST_SAMPLES:
        raise DataError(f"{where}: has {count(table.time.size, 'row')}; a course is known from {LEAST_SAMPLES} on")
    rounded, late = table.rounding(encoder), rounding(table.time)
    if mechanism.speed is not None and (turned := evenly(table.time, angle, mechanism.speed, rounded, late)):
        return Recording(name, file, table, turned[0], error=turned[1])
    angle = table.course(encoder, where)
    course = followed(table.time, angle, off_by(table.time, rounded, late, np.gradient(angle, table.time)))
    return Recording(name, file, table, course.moving.theta, course)


def _at_its_speed(name: str, file: str, table: Table, mechanism: Mechanism, motion: Motion) -> Recording:
    """A file without the crank's angle: it turns at the drive's speed from where it is assembled."""
    if mechanism.speed is None or motion == "static" or not table.time.size:
        heading = "crank_angle [deg]"
        raise DataError(
            f"{Path(file).name}: has no column {mechanism.encoder.name!r}, and nothing else says where the crank is;"
            f" add {heading!r}, or say in a map which column it is"
        )
    return Recording(name, file, table, mechanism.assembly[mechanism.driven] + mechanism.speed * table.time)


def _start(table: Table, mechanism: Mechanism) -> ReleaseState:
    """The state that a released linkage begins in: as recorded, else as it is assembled, as fast as its file says."""
    angles, rates = (table.values.get(f"{mechanism.driven}_{part}") for part in ("angle", "angular_velocity"))
    assembly, swing = Assembly(mechanism), Schedule.released(mechanism, np.zeros(1))
    assembled = assembly.start
    angle = assembled if angles is None or np.isnan(angles[0]) else float(turned_near(float(angles[0]), assembled))
    told = rates is not None and bool(np.isfinite(rates[0]))
    rate = float(rates[0]) if rates is not None and told else set_off(assembly, swing).start_speed(mechanism)
    rounded = [float(table.rounding(f"{mechanism.driven}_{part}")[0]) for part in ("angle", "angular_velocity")]
    return ReleaseState(angle, rate, (rounded[0] / SIGMAS, rounded[1] / SIGMAS), told)


def _check_ideal(mechanism: Mechanism, joint_model: JointModel, remedy: str) -> None:
    """Raise ArgumentError for a motion that is let go with clearance."""
    if joint_model != "ideal":
        raise ArgumentError(
            "joint_model",
            f"{mechanism.name} swings freely and is compared with ideal joints, as the analytic model has no"
            f" clearance in a free motion; give `clearance` 0, or {remedy}",
        )


def _of_drives(
    name: str, file: str, table: Table, mechanism: Mechanism, motion: Motion, joint_model: JointModel
) -> Recording:
    """A table of a linkage that no single crank moves: each driven joint's position is followed, and freedoms that
    nothing drives are let go as the table begins.
    """
    table, where, assembly = _kept(table), Path(file).name, Assembly(mechanism)
    s = assembly.structure
    if s.free and motion == "static":
        loose = f"joint {s.free_joints[0]!r} of {mechanism.name} moves freely"
        raise DataError(
            f"{where}: {loose}, and a freedom that no drive holds has no static motion; check driven motion"
        )
    if s.free:
        _check_ideal(mechanism, joint_model, "each freedom a drive in the mechanism file")
    joints = [s.coordinates[i].joint for i in s.inputs if s.coordinates[i].joint not in s.free_joints]
    wanted = {joint: position(mechanism.joint(joint)).name for joint in joints}
    faults = [
        f"{where}: has no column {signal!r}, and nothing else says where joint {joint!r} is; add it, or say in a map"
        " which column it is"
        for joint, signal in wanted.items()
        if signal not in table.values
    ]
    faults += [
        f"{where}: {signal!r} has empty cells; give joint {joint!r} a position in every row, or leave rows out"
        for joint, signal in wanted.items()
        if signal in table.values and np.any(np.isnan(table.values[signal]))
    ]
    if not faults and not set(table.values) - set(wanted.values()):
        faults.append(f"{where}: has no signal beside {', '.join(wanted.values())}; add what is to be compared")
    if not faults and table.time.size < LEAST_SAMPLES:
        faults.append(f"{where}: has {count(table.time.size, 'row')}; a course is known from {LEAST_SAMPLES} on")
    if faults:
        raise DataError(*faults)
    late, speeds, drives = rounding(table.time), mechanism.drive_speeds, {}
    for joint, signal in wanted.items():
        values = assembly.on_its_turn(joint, table.course(signal, where))
        rounded = table.rounding(signal)
        moving = followed_as_given(table.time, values, rounded + np.abs(np.gradient(values, table.time)) * late)
        if joint in speeds:
            even = assembly.positions[joint] + speeds[joint] * table.time
            rounded = np.maximum(rounded, table.off(signal, even))
        # a row's positions are those of its other signals, however late its time is
        errors = replace(moving.errors, theta=rounded / SIGMAS)
        drives[joint] = replace(moving, moving=replace(moving.moving, theta=values), errors=errors)
    driven = RecordedDrives(table.time, drives)
    if not s.free:
        return Recording(name, file, table, next(iter(drives.values())).moving.theta, driven)
    first = next(iter(drives.values())).moving.theta if drives else np.zeros(table.time.size)
    return Recording(name, file, table, first, RecordedRelease.of(driven, _begins(table, assembly, driven)))


def _begins(table: Table, assembly: Assembly, driven: RecordedDrives) -> dict[str, ReleaseState]:
    """The state that each freedom begins in, by joint: where positions and bodies' angles say, as fast as their rates;
    without these as the file's ``initial``, else as its positions begin.
    """
    s, start = assembly.structure, {}
    courses = {joint: (table.time - table.time[0], one.moving.theta) for joint, one in driven.drives.items()}
    rates = set_off(assembly, Schedule.along(courses, np.zeros(1))).rates
    inputs = {s.coordinates[i].joint: i for i in s.inputs}
    places, speeds = ({inputs[n]: _known(s.signs[inputs[n]], one, of) for n, one in driven.drives.items()}
                      for of in ("theta", "omega"))  # fmt: skip
    for joint in s.free_joints:
        signal = position(assembly.mechanism.joint(joint)).name
        if signal in table.values:
            places[inputs[joint]] = s.signs[inputs[joint]] * table.values[signal], table.rounding(signal)
    _add_turned(places, table, s, "angle")
    _add_turned(speeds, table, s, "angular_velocity")
    for joint in s.free_joints:
        i, home = inputs[joint], assembly.positions[joint]
        values, rounded = places.get(i, (np.array([np.nan]), np.zeros(1)))
        placed, sign = bool(np.isfinite(values[0])), s.signs[i]
        at = float(assembly.on_its_turn(joint, sign * values)[0]) if placed else home
        rate, slip = speeds.get(i, (np.array([np.nan]), np.zeros(1)))
        fast, off, told = float(sign * rate[0]), float(slip[0]), bool(np.isfinite(rate[0]))
        if not told:
            fast, off = rates.get(joint, 0.0), 0.0
            if joint not in rates and np.isfinite(values).all() and values.size >= LEAST_SAMPLES:
                way = sign * (values if not s.coordinates[i].bodies else unwound(values))
                moving = followed_as_given(table.time, way, rounded)
                fast, off = float(moving.moving.omega[0]), float(SIGMAS * moving.errors.omega[0])
        start[joint] = ReleaseState(at, fast, (float(rounded[0]) / SIGMAS, off / SIGMAS), told, placed)
    return start


Readings = tuple[np.ndarray, np.ndarray]  # values (N,), and what they may be off by (N,)


def _known(sign: float, one: RecordedMotion, of: Literal["theta", "omega"]) -> Readings:
    """Positions or rates (N,) of a drive's coordinate, and what they may be off by."""
    return sign * getattr(one.moving, of), SIGMAS * getattr(one.errors, of)


def _add_turned(known: dict[int, Readings], table: Table, s: Structure, part: str) -> None:
    """Add to the known coordinates, or their rates, those by which alone a body turns that is in the table."""
    more = True
    while more:
        more = False
        for b, body in enumerate(s.bodies):
            left, name = [i for i in s.turned[b] if i not in known], f"{body}_{part}"
            if len(left) == 1 and left[0] in s.inputs and name in table.values:
                others = [known[i] for i in s.turned[b] if i in known]
                held = s.held_at[b] if part == "angle" else 0.0
                values = table.values[name] - held - sum(values for values, _ in others)
                known[left[0]] = values, table.rounding(name) + sum(rounded for _, rounded in others)
                more = True


def _kept(table: Table) -> Table:
    """A table with no more rows than can be looked at: every second, third ..."""
    rows = next(iter(table.values.values())).size
    every = -(-rows // KEPT_SAMPLES)
    if every == 1:
        return table
    note = f"of {rows} rows one in {every} is compared"
    return replace(table.at(slice(None, None, every)), notes=(*table.notes, note))
