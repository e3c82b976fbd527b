"""How the drives of a linkage move that is no crank's: at constant speeds, or along courses that a file gives; and when
one looks.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.inverse import Coordinate, splined
from analytic.kinematics.motion import kinematics
from analytic.mechanism.signals import Signal, position, turned_near
from compare.judge.grid import GridError
from compare.recorded.errors import DataError
from compare.recorded.headings import left_alone
from sim_models.common.held import GLIMPSES, STANDSTILL
from sim_models.common.motor import Course

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

    from analytic.mechanism import Mechanism
    from compare.recorded.table import Table

MOST_TIMES = 100_000
USUAL = 1.0  # s, as far as the drives get
SAMPLES = 50
SHORTEST = 1e-3  # s
SPARE = 0.9  # of the way to where the drives get no farther
KNOTS = 5  # of a straight line
LEAST = 4  # rows of a file of courses: a cubic spline needs as many


@dataclass(frozen=True)
class Courses:
    """By driven joint the times (M,) s and positions (M,) rad, m of its course, the cubic spline through them; nothing
    of what moves freely.  ``rows`` (R,) s are those of a file whose courses have more than these.
    """

    knots: Mapping[str, tuple[np.ndarray, np.ndarray]]
    rows: np.ndarray | None = None

    @property
    def splines(self) -> dict[str, CubicSpline]:
        """The courses as functions of time and order of derivative."""
        from scipy.interpolate import CubicSpline

        return {name: CubicSpline(*course) for name, course in self.knots.items()}

    def directions(self, time: np.ndarray) -> dict[str, np.ndarray]:
        """Rates (N,) rad/s, m/s at times (N,) s, by joint; 0 of a drive that is about to stand."""
        found = {}
        for name, spline in self.splines.items():
            rate = np.asarray(spline(time, 1))
            found[name] = np.where(np.abs(rate) > STANDSTILL * Course(spline).top_speed, rate, 0.0)
        return found

    def until(self, time: np.ndarray) -> np.ndarray:
        """Times (M,) s of the way along the courses to the last of times (N,) s, these and the knots among them."""
        begin, last = max(float(t[0]) for t, _ in self.knots.values()), float(time.max())
        knots = np.concatenate([t for t, _ in self.knots.values()])
        every = np.concatenate([time, knots, np.linspace(begin, last, GLIMPSES)])
        return np.unique(every[(every >= begin) & (every <= last)])

    def at(self, time: np.ndarray) -> dict[str, np.ndarray]:
        """Positions (N,) at times (N,) s, by joint."""
        return {name: np.asarray(spline(time)) for name, spline in self.splines.items()}


def parse_times(text: str) -> np.ndarray:
    """Times (s) from ``start:stop:step``, stop included.  Raises GridError."""
    try:
        start, stop, step = (float(part) for part in text.split(":"))
    except ValueError:
        raise GridError(f"--times {text}: give start:stop:step in seconds, such as 0:1:0.02") from None
    if not (np.isfinite([start, stop, step]).all() and step > 0 and 0 <= start < stop):
        raise GridError(f"--times {text}: give a start of 0 or more, a later stop and a positive step (seconds)")
    if (stop - start) / step > MOST_TIMES:
        raise GridError(f"--times {text}: that is more than {MOST_TIMES} times; use a larger step")
    return np.asarray(start + step * np.arange(int(np.floor((stop - start) / step + 1e-9)) + 1))


def speeds_of(mechanism: Mechanism) -> dict[str, float]:
    """The speeds (rad/s, m/s) of the drives that have one, by joint, as rates of its position."""
    sign = mechanism.crank_sign
    return {drive.joint: sign * drive.speed for drive in mechanism.drives if not isinstance(drive.speed, str)}


def at_their_speeds(assembly: Assembly, time: np.ndarray | None) -> tuple[np.ndarray, Courses]:
    """Times (N,) s, by default as far as the drives get, and the courses at the drives' constant speeds from the
    assembly on.  Raises GridError where a drive has no speed.
    """
    m = assembly.mechanism
    for drive in m.drives:
        if drive.speed == "measured":
            raise GridError(
                f"{m.name}: the drive of joint {drive.joint!r} follows measured data; give a file of its course"
                " (--course), or the drive a speed"
            )
    speeds = speeds_of(m)
    end = float(time[-1]) if time is not None else _as_far(assembly, speeds)
    knots = np.linspace(0.0, max(end, SHORTEST), KNOTS)
    courses = Courses({name: (knots, assembly.positions[name] + speed * knots) for name, speed in speeds.items()})
    return (np.linspace(0.0, end, SAMPLES + 1) if time is None else time), courses


def _as_far(assembly: Assembly, speeds: Mapping[str, float]) -> float:
    """How long (s) all drives can go on, at most the usual time, less a tenth where they cannot."""
    if len(speeds) < len(assembly.structure.inputs):  # where it moves freely, nobody knows before
        return USUAL
    low, high, end = 0.0, USUAL, USUAL
    while high - low > SHORTEST:
        try:
            time = np.linspace(0.0, end, SAMPLES)
            assembly.follow(assembly.inputs_at({n: assembly.positions[n] + v * time for n, v in speeds.items()}))
            low = end
        except AssemblyError:
            high = end
        if low == USUAL:
            return USUAL
        end = (low + high) / 2
    return SPARE * low


def of_file(path: Path, assembly: Assembly) -> Courses:
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
    if not faults and table.time.size < LEAST:
        faults.append(f"{path.name}: has {table.time.size} rows; a course needs at least {LEAST}")
    if not faults and table.time[0] < 0:
        faults.append(f"{path.name}: begins at {table.time[0]:g} s; a course begins at 0 s or later")
    if faults:
        raise DataError(*faults)
    _warn(path, table, list(wanted.values()), "no position of a driven joint")
    courses = {name: table.course(signal, path.name) for name, signal in wanted.items()}
    return Courses({name: (table.time, assembly.on_its_turn(name, values)) for name, values in courses.items()})


def of_path(path: Path, assembly: Assembly) -> Courses:
    """The courses that move a platform along the cubic splines through a file's ``<body>_x``, ``<body>_y``,
    ``<body>_angle`` over time, as many as the linkage has inputs, each with a drive.  Raises DataError.
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
    if not faults and table.time.size < LEAST:
        faults.append(f"{path.name}: has {table.time.size} rows; a path needs at least {LEAST}")
    if faults:
        raise DataError(*faults)
    _warn(path, table, [signal.name for signal in poses], "no x, y or angle of a body")
    wanted = [Coordinate(signal.place, _axis(signal)) for signal in poses]
    home = kinematics(assembly, assembly.inputs[:, None])
    told = []
    for coordinate, signal in zip(wanted, poses, strict=True):
        values, begins = table.course(signal.name, path.name), float(coordinate.value(home)[0])
        told.append(values + (turned_near(values[0], begins) - values[0]) if signal.wraps else values)
    try:
        time, found = splined(assembly, wanted, np.array(told), table.time)
    except AssemblyError as error:
        raise DataError(f"{path.name}: {error}") from None
    moved = {s.coordinates[i].joint: s.signs[i] * found.coordinates[i] for i in s.inputs}
    return Courses({joint.name: (time, moved[joint.name]) for joint in m.motors}, table.time)


def _warn(path: Path, table: Table, used: Collection[str], role: str) -> None:
    """Warn of what was made of a file, and of its signals that are not used, as they are none of this role."""
    others = [table.headings[c.place] for c in table.columns if c.signal.name not in used]
    notes = [f"{path.name}: {left_alone(others, role)}"] if others else []
    for note in (*table.notes, *notes):
        warnings.warn(note, stacklevel=4)


def _axis(signal: Signal) -> Literal["x", "y", "angle"]:
    return "x" if signal.component == "x" else "y" if signal.component == "y" else "angle"


def times_within(courses: Courses, time: np.ndarray | None) -> np.ndarray:
    """Times (N,) s at which one looks at courses, by default their own.  Raises GridError for one outside of them."""
    begin = max((float(t[0]) for t, _ in courses.knots.values()), default=0.0)
    end = min((float(t[-1]) for t, _ in courses.knots.values()), default=np.inf)
    if time is None:
        own = next(iter(courses.knots.values()))[0] if courses.rows is None else courses.rows
        return np.linspace(begin, end, SAMPLES + 1) if own.size > 4 * SAMPLES else np.asarray(own)
    if time[0] < begin or time[-1] > end:
        raise GridError(f"--times {time[0]:g} to {time[-1]:g} s is not within the course, {begin:g} to {end:g} s")
    return time
