"""Schedules as they are asked for: of crank angles or times, of drives at constant speeds, of a file's course or path.

:func:`scheduled` makes the one that a question comes to.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from analytic.errors import warn
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.initial import set_off
from analytic.kinematics.inverse import splined
from analytic.kinematics.motion import kinematics
from analytic.kinematics.output import Output
from analytic.kinematics.reach import usual_angles
from analytic.kinematics.schedule import FEWEST_KNOTS, Knots, Schedule
from analytic.mechanism.errors import quoted
from analytic.mechanism.signals import Signal, position, turned_near
from compare.arguments import CAPACITY, warn_of_degrees
from compare.faults import ArgumentError
from compare.questions.analyse import AnalyseQuestion, RunQuestion
from compare.questions.crosscheck import CrosscheckQuestion
from compare.questions.option import Angles, Times
from compare.questions.shared import AnyPath
from compare.recorded.errors import DataError
from sim_models.engine import Motion

if TYPE_CHECKING:
    from compare.recorded.table import Table

MovedQuestion = CrosscheckQuestion | AnalyseQuestion | RunQuestion
USUAL_TIME = 1.0  # s, as far as the drives get
DEFAULT_TIMES = 50
SHORTEST_COURSE = 1e-3  # s
FARTHEST_ANGLE = 1e6  # deg: the crank is followed there from where it is assembled
SPARE = 0.9  # of the way to where the drives get no farther
LINE_KNOTS = 5  # knots of a straight line
FREE_TIME = np.linspace(0.0, 2.0, 101)  # s, for a released linkage


def scheduled(assembly: Assembly, question: MovedQuestion) -> Schedule:
    """The schedule of a question.

    A linkage that one crank moves is looked at where it is at crank ``angles``, by default its usual ones; one that is
    let go over time, if it may swing.  All others, and one of which ``times``, a ``course`` or a platform's ``path``
    are given, are looked at over time, their drives at their speeds or as the file has them.
    What runs free has the velocities of the file's ``initial`` at time 0.
    Raises ArgumentError, DataError, ScheduleError, or AssemblyError by default.
    """
    return set_off(assembly, _driven(assembly, question))


def _driven(assembly: Assembly, question: MovedQuestion) -> Schedule:
    """The same, what runs free at rest at time 0."""
    m, at_rest = assembly.mechanism, question.motion == "static"
    times, course, path = question.times, question.course, question.path
    if not assembly.structure.by_crank or not (times is None and course is None and path is None):
        _check_over_time(assembly, question.motion, question.angles)
        return over_time(assembly, at_rest, times, course, path)
    if m.speed is not None or at_rest:
        return Schedule.at_angles(m, crank_angles(assembly, question.angles), at_rest=at_rest)
    if question.angles is not None:
        raise ArgumentError("angles", f"{m.name} swings freely and is looked at over time; leave angles out")
    return Schedule.released(m, FREE_TIME)


def _rubs_freely(assembly: Assembly) -> bool:
    """Whether a crank swings against dry friction, which the analytic model follows in a released crank alone."""
    m = assembly.mechanism
    swings = assembly.structure.by_crank and not m.motors
    return swings and (any(joint.rubs for joint in m.joints) or any(load.opposes for load in m.loads))


def crank_angles(assembly: Assembly, given: object) -> np.ndarray:
    """Crank angles (N,) rad as given, or those at which one looks at the linkage by default; it reaches all of them.

    Raises ArgumentError, or AssemblyError by default.
    """
    if given is None:
        theta = usual_angles(assembly)
        assembly.path(theta.min(), theta.max())
        return theta
    theta = Angles().read(given, "angles")
    if theta.size > CAPACITY:
        raise ArgumentError("angles", f"{theta.size} angles cannot be used; give at most {CAPACITY}")
    farthest = float(theta[np.argmax(np.abs(theta))])
    if abs(farthest) > math.radians(FARTHEST_ANGLE):
        limit = f"{math.radians(FARTHEST_ANGLE):.6g} rad ({FARTHEST_ANGLE:g} deg)"
        raise ArgumentError("angles", f"{farthest:g} rad cannot be used; a crank angle must not be beyond {limit}")
    if not isinstance(given, str):  # a text says its unit, or is in degrees
        warn_of_degrees("angles", farthest)
    try:
        assembly.path(float(theta.min()), float(theta.max()))
    except AssemblyError as error:
        raise ArgumentError("angles", str(error)) from None
    return theta


def _check_over_time(assembly: Assembly, motion: Motion, angles: object) -> None:
    """Raises ArgumentError for crank angles where a linkage is looked at over time, and for an equilibrium of one that
    no drive holds.
    """
    name = f"{assembly.mechanism.name} is looked at over time"
    loose = assembly.structure.free_joints
    if motion == "static" and loose:
        what = f"no drive of {assembly.mechanism.name} holds joint {loose[0]!r}, so that there is no static motion"
        raise ArgumentError("motion", f"{what}; leave motion out, or give that joint a [[drive]] with a speed")
    if angles is not None:
        raise ArgumentError("angles", f"{name}, and has none of this; give times (s) in its place")


def over_time(
    assembly: Assembly,
    at_rest: bool = False,
    times: object = None,
    course: AnyPath | None = None,
    path: AnyPath | None = None,
) -> Schedule:
    """A schedule over time.  Raises ArgumentError or DataError."""
    if course is not None and path is not None:
        raise ArgumentError("path", f"{quoted(str(path))} is given beside a course; give one of them")
    asked = None
    if times is not None:
        asked = Times().read(times, "times")
        if asked.size > CAPACITY or np.any(asked < 0) or np.any(np.diff(asked) <= 0):
            raise ArgumentError("times", f"give at most {CAPACITY} times (s) from 0 on, each later than the one before")
    if path is not None:
        courses, rows = of_path(Path(path), assembly)
    elif course is not None:
        courses = of_file(Path(course), assembly)
        rows = next(iter(courses.values()))[0] if courses else np.zeros(0)
    elif asked is not None and not at_rest and _rubs_freely(assembly):
        return Schedule.released(assembly.mechanism, asked)
    else:
        return at_their_speeds(assembly, asked, at_rest)
    return Schedule.along(courses, times_within(courses, rows, asked), at_rest=at_rest)


def at_their_speeds(assembly: Assembly, time: np.ndarray | None, at_rest: bool = False) -> Schedule:
    """The drives at their constant speeds from the assembly on, looked at at times (N,) s, by default as far as they
    get.  Raises ArgumentError where a drive has no speed.
    """
    m = assembly.mechanism
    for drive in m.drives:
        if drive.speed == "measured":
            why = f"the drive of joint {drive.joint!r} follows measured data; give a file of its course, or it a speed"
            raise ArgumentError("course", why)
    speeds = m.drive_speeds
    end = float(time[-1]) if time is not None else _as_far(assembly, speeds)
    knots = np.linspace(0.0, max(end, SHORTEST_COURSE), LINE_KNOTS)
    courses = {name: (knots, assembly.positions[name] + speed * knots) for name, speed in speeds.items()}
    return Schedule.along(courses, np.linspace(0.0, end, DEFAULT_TIMES + 1) if time is None else time, at_rest=at_rest)


def _as_far(assembly: Assembly, speeds: Mapping[str, float]) -> float:
    """How long (s) all drives can go on, at most the usual time, less a tenth where they cannot."""
    if len(speeds) < len(assembly.structure.inputs):  # where it moves freely, nobody knows before
        return USUAL_TIME
    low, high, end = 0.0, USUAL_TIME, USUAL_TIME
    while high - low > SHORTEST_COURSE:
        try:
            time = np.linspace(0.0, end, DEFAULT_TIMES)
            assembly.follow(assembly.inputs_at({n: assembly.positions[n] + v * time for n, v in speeds.items()}))
            low = end
        except AssemblyError:
            high = end
        if low == USUAL_TIME:
            return USUAL_TIME
        end = (low + high) / 2
    return SPARE * low


def of_file(path: Path, assembly: Assembly) -> dict[str, Knots]:
    """The courses of a file of time and ``position_<joint>`` of every driven joint, angles in whatever turn.  Raises
    DataError.
    """
    from compare.recorded.table import read_table

    mechanism = assembly.mechanism
    table = read_table(path, mechanism, mappable=False)
    wanted = {joint.name: position(joint).name for joint in mechanism.motors}
    faults = [
        f"{path.name}: has no column {signal!r}; a course gives time and a position of each driven joint"
        for signal in wanted.values()
        if signal not in table.values
    ]
    for name, signal in wanted.items():
        if signal in table.values and not np.all(np.isfinite(table.values[signal])):
            faults.append(f"{path.name}: {signal} has empty cells; give joint {name} a position in every row")
    if not faults and table.time.size < FEWEST_KNOTS:
        faults.append(f"{path.name}: has {table.time.size} rows; a course needs at least {FEWEST_KNOTS}")
    if not faults and table.time[0] < 0:
        faults.append(f"{path.name}: begins at {table.time[0]:g} s; a course begins at 0 s or later")
    if faults:
        raise DataError(*faults)
    _warn(path, table, list(wanted.values()), "no position of a driven joint")
    courses = {name: table.course(signal, path.name) for name, signal in wanted.items()}
    return {name: (table.time, assembly.on_its_turn(name, values)) for name, values in courses.items()}


def of_path(path: Path, assembly: Assembly) -> tuple[dict[str, Knots], np.ndarray]:
    """The courses that move a platform along the cubic splines through a file's ``<body>_x``, ``<body>_y``,
    ``<body>_angle`` over time, as many as the linkage has inputs, each with a drive; and the times (R,) s of its rows.
    Raises DataError.
    """
    from compare.recorded.table import read_table

    m, s = assembly.mechanism, assembly.structure
    table = read_table(path, m, mappable=False)
    poses = [c.signal for c in table.columns if c.signal.kind == "pose"]
    free = s.free_joints
    faults = []
    if len(poses) != len(s.inputs):
        given = ", ".join(signal.name for signal in poses) or "none"
        faults.append(
            f"{path.name}: gives {len(poses)} of a body's x, y and angle ({given}); {m.name} has {len(s.inputs)}"
            " freedoms, give as many"
        )
    if free:
        faults.append(f"{m.name}: joint {free[0]!r} has no drive that could follow a path; give it one")
    faults += [
        f"{path.name}: {signal.name} has empty cells; give a pose in every row"
        for signal in poses
        if not np.all(np.isfinite(table.values[signal.name]))
    ]
    if not faults and table.time.size < FEWEST_KNOTS:
        faults.append(f"{path.name}: has {table.time.size} rows; a path needs at least {FEWEST_KNOTS}")
    if faults:
        raise DataError(*faults)
    _warn(path, table, [signal.name for signal in poses], "no x, y or angle of a body")
    wanted = [Output(signal.place, _axis(signal)) for signal in poses]
    home = kinematics(assembly, assembly.inputs[:, None])
    positions = []
    for coordinate, signal in zip(wanted, poses, strict=True):
        values, begins = table.course(signal.name, path.name), float(coordinate.value(home)[0])
        positions.append(values + (turned_near(values[0], begins) - values[0]) if signal.wraps else values)
    try:
        time, followed = splined(assembly, wanted, np.array(positions), table.time)
    except AssemblyError as error:
        raise DataError(f"{path.name}: {error}") from None
    moved = {s.coordinates[i].joint: s.signs[i] * followed.coordinates[i] for i in s.inputs}
    return {joint.name: (time, moved[joint.name]) for joint in m.motors}, table.time


def _warn(path: Path, table: Table, used: Collection[str], role: str) -> None:
    """Warn of what was made of a file, and of its signals that are not used, as they are none of this role."""
    from compare.recorded.headings import ignored_columns

    others = [table.headings[c.place] for c in table.columns if c.signal.name not in used]
    notes = [f"{path.name}: {ignored_columns(others, role)}"] if others else []
    for note in (*table.notes, *notes):
        warn(note)


def _axis(signal: Signal) -> Literal["x", "y", "angle"]:
    return "x" if signal.component == "x" else "y" if signal.component == "y" else "angle"


def times_within(courses: Mapping[str, Knots], rows: np.ndarray, time: np.ndarray | None) -> np.ndarray:
    """Times (N,) s at which one looks at courses, by default those (R,) of a file's rows, or fewer.  Raises
    ArgumentError for one outside of them.
    """
    begin = max((float(t[0]) for t, _ in courses.values()), default=0.0)
    end = min((float(t[-1]) for t, _ in courses.values()), default=np.inf)
    if time is None:
        return np.linspace(begin, end, DEFAULT_TIMES + 1) if rows.size > 4 * DEFAULT_TIMES else rows
    if time[0] < begin or time[-1] > end:
        said = f"{time[0]:g} to {time[-1]:g} s is not within the course, {begin:g} to {end:g} s"
        raise ArgumentError("times", said)
    return time
