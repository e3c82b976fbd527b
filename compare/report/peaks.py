"""What a mechanical engineer reads off first: how large each reaction becomes and where, the drive's peaks, how far
each body and slide moves, and the error by clearance with the joint that has most of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.parts import TINY
from analytic.mechanism.signals import continued
from compare.quantities import Quantity, drive_signals, plain, quantities, shown
from compare.report.summary import Abscissa, Sampled, abscissa, by_reason
from compare.results.analysis import Analysis, Extremes, Simulation
from compare.results.looked_at import ByClearance
from compare.strokes import STROKE
from compare.strokes import strokes as all_strokes

NOTHING = 1e-9  # of what belongs to it (a reaction, a length): smaller is rounding
LEAST_PART = 5e-3  # of the worst case: what a joint does that is less is not listed
SHOWN_PARTS = 3  # joints of an error on a terminal
GOOD = 40.0  # deg: the transmission angle below which textbooks call a linkage poor (Norton, Design of Machinery)


class Of(Sampled, Protocol):
    """What has a value of a mechanism at each sample."""

    @property
    def mechanism(self) -> Mechanism: ...


class ErrorByJoint(ByClearance, Protocol):
    """What clearance does to an output, to first order by joint as well."""

    @property
    def by_joint(self) -> Mapping[str, np.ndarray]: ...


class Erring(Of, Protocol):
    """What has the error of each output, and the sine (N,) of the transmission angle where there is one."""

    @property
    def errors(self) -> Mapping[str, ErrorByJoint]: ...
    @property
    def transmission(self) -> np.ndarray | None: ...


@dataclass(frozen=True)
class End:
    """A highest or lowest value of a signal in its quantity's unit, and where (deg, s) it is."""

    value: float
    at: float


@dataclass(frozen=True)
class Peak:
    """The highest and the lowest value of a signal."""

    quantity: Quantity
    highest: End
    lowest: End

    @property
    def largest(self) -> End:
        """That of the two which is larger in size."""
        return max(self.highest, self.lowest, key=lambda end: abs(end.value))

    @property
    def ends(self) -> tuple[End, ...]:
        """Both where the signal changes its sign, else the larger one."""
        both = self.highest.value > 0 > self.lowest.value
        return (self.highest, self.lowest) if both else (self.largest,)

    def row(self, unit: str) -> tuple[str, ...]:
        """As a table has it: name, unit, highest and lowest value, each with its place in a unit."""
        least = NOTHING * abs(self.largest.value)
        ends = ((0.0 if abs(end.value) < least else end.value, end.at) for end in (self.highest, self.lowest))
        cells = (cell for value, at in ends for cell in (plain(value, 4), f"{plain(at, 4)} {unit}"))
        return self.quantity.label, self.quantity.unit, *cells


def peak(result: Analysis | Simulation, quantity: Quantity, sought: str = "") -> Peak:
    """The highest and lowest value of a signal, between the samples too where they were looked for there, under the
    name ``sought`` where that is another.
    """
    found = result.extremes.get(sought or quantity.signal) if isinstance(result, Analysis) else None
    if found is not None and None not in (found.highest, found.highest_at, found.lowest, found.lowest_at):
        ends = ((found.highest, found.highest_at), (found.lowest, found.lowest_at))
        return Peak(quantity, *(End(quantity.factor * (v or 0.0), place(result, at or 0.0)) for v, at in ends))
    values, x = quantity.factor * result.signals[quantity.signal], over(result).values
    high, low = int(np.nanargmax(values)), int(np.nanargmin(values))
    return Peak(quantity, End(float(values[high]), x[high]), End(float(values[low]), x[low]))


def place(result: Of, at: float) -> float:
    """A crank angle (rad), or a time (s) of a result that is over times, as its samples are plotted over them."""
    x = over(result)
    if result.time is None:
        return math.degrees(at)
    return at if x.of_time else float(np.interp(at, result.time, x.values))


def peaks(result: Analysis | Simulation) -> Iterator[Peak]:
    """Of each joint's reaction, of what the drives give, of how bodies turn that do not turn round, and of slides, and
    of what was asked for beside; nothing that is zero, or stays where it is, throughout.
    """
    mechanism, known = result.mechanism, quantities(result.mechanism)
    reactions = [f"reaction_{joint.name}_magnitude" for joint in mechanism.joints]
    force = max((_size(result, name) for name in reactions), default=0.0)
    length = max((body.length for body in mechanism.bodies), default=0.0) or 1.0
    scale = {"N": force, "N·m": force * length, "mm": length, "deg": 1.0}
    moments = [f"reaction_{joint.name}_moment" for joint in mechanism.joints if joint.prismatic]
    driven = mechanism.driven if mechanism.cranked and mechanism.motors else ""  # let go, it swings
    turning = [f"{body.name}_angle" for body in mechanism.bodies if body.name != driven]
    sliding = [f"position_{joint.name}" for joint in mechanism.joints if joint.prismatic]
    for name in (*reactions, *moments, *drive_signals(mechanism)):
        if _size(result, name) > NOTHING * scale[known[name].unit]:
            yield peak(result, known[name])
    for name in (*turning, *sliding):
        if _range(result, name) > NOTHING * scale[known[name].unit]:
            yield peak(result, known[name])
    yield from (peak(result, known[name]) for name in on_request(result) if _size(result, name))


def on_request(result: Analysis | Simulation) -> list[str]:
    """The signals that a result holds because somebody asked for them."""
    return [name for name, signal in result.kinds.items() if signal.on_request]


def _size(result: Analysis | Simulation, name: str) -> float:
    """The largest size of a signal (SI); 0 of one that there is not."""
    values = result.signals.get(name, np.zeros(0))
    return float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0


def _range(result: Analysis | Simulation, name: str) -> float:
    """How far a signal goes (SI); nowhere where there is none."""
    values = result.signals.get(name, np.zeros(0))
    return float(np.nanmax(values) - np.nanmin(values)) if np.isfinite(values).any() else 0.0


def over(result: Of) -> Abscissa:
    """What a result's samples are plotted over."""
    return abscissa(result, result.mechanism)


def unanswered(result: Analysis) -> list[tuple[list[int], str]]:
    """Samples without an answer by reason, how far each is off left out but for the first."""
    kinds = {at: re.sub(r" \([^()]*\)", "", why) for at, why in result.flags.items()}
    return [(at, result.flags[str(at[0])]) for at in by_reason(kinds).values()]


@dataclass(frozen=True)
class ErrorPeak:
    """The largest displacement of an output by clearance, in ``unit``: in equilibrium, in the worst case, and the
    joints' parts of the first-order displacement where they are together the largest, the largest part first.
    """

    name: str
    unit: str
    equilibrium: float | None
    at: str
    worst: float
    worst_at: str
    parts: tuple[tuple[str, float], ...]

    @property
    def by_joint(self) -> str:
        """The joints with the largest parts, and these; how many more there are."""
        more = len(self.parts) - SHOWN_PARTS
        parts = [f"{joint} {plain(part, 3, True)}" for joint, part in self.parts[:SHOWN_PARTS]]
        return ", ".join([*parts, *([f"{more} more"] if more > 0 else [])]) or "-"


def error_peaks(result: Erring) -> Iterator[ErrorPeak]:
    """The largest error of each output that has any."""
    at = over(result).at
    for name, error in result.errors.items():
        unit, factor = shown(error.unit)
        worst = factor * error.worst_case
        if not np.nanmax(worst, initial=0.0) > NOTHING:
            continue
        there = factor * error.equilibrium
        k, w = _largest(there), _largest(worst)
        parts = {} if k is None else {joint: factor * float(part[k]) for joint, part in error.by_joint.items()}
        ordered = sorted(parts.items(), key=lambda item: -abs(item[1]))
        known = tuple((joint, part) for joint, part in ordered if abs(part) > LEAST_PART * np.nanmax(worst))
        largest, place = (None, "-") if k is None else (float(there[k]), at(k))
        most, most_at = (0.0, "-") if w is None else (float(worst[w]), at(w))
        yield ErrorPeak(name, unit, largest, place, most, most_at, known)


def _largest(values: np.ndarray) -> int | None:
    return int(np.nanargmax(np.abs(values))) if np.isfinite(values).any() else None


def transmission_angle(result: Erring) -> np.ndarray | None:
    """The transmission angle (N,) deg, at most 90; None where the linkage has none."""
    return None if result.transmission is None else np.degrees(np.arcsin(np.clip(result.transmission, 0.0, 1.0)))


def poor(result: Erring) -> str:
    """Where the transmission angle is poor, in words; empty where it is good throughout, or unknown."""
    angle = transmission_angle(result)
    if angle is None or not (angle < GOOD).any():
        return ""
    x, below = over(result), np.flatnonzero(angle < GOOD)
    stretches = np.split(below, np.flatnonzero(np.diff(below) > 1) + 1)
    said = [x.at(s[0]) if s.size == 1 else f"{plain(x.values[s[0]], 4)} to {x.at(s[-1])}" for s in stretches]
    return ", ".join(said)


def strokes(result: Analysis) -> Iterator[tuple[str, str]]:
    """Each slide and each body on the ground that goes to and fro once in a turn of the crank: how far, and for which
    part of the turn one way and back.
    """
    known, ideal = quantities(result.mechanism), " without clearance" * bool(result.clearance)
    for stroke in all_strokes(result):
        ends = peak(result, known[stroke.signal], f"{STROKE}{stroke.what}")
        travel = f"{plain(ends.highest.value - ends.lowest.value, 4)} {known[stroke.signal].unit}{ideal}"
        ways = (plain(math.degrees(way), 4) for way in (stroke.long, stroke.short))
        yield stroke.what, f"{travel}, {' deg one way, '.join(ways)} deg back ({stroke.ratio:.2f}:1)"


def mean_torque(result: Analysis) -> float | None:
    """The mean (N.m) over a turn of what turns a crank that has a speed; None where that is not known, or not asked."""
    torque = result.extremes.get("drive_torque")
    if not over(result).around or result.motion != "driven" or torque is None or torque.mean is None:
        return None
    largest = max(abs(torque.highest or 0.0), abs(torque.lowest or 0.0))
    return torque.mean if abs(torque.mean) > NOTHING * largest else 0.0


def effective(result: Analysis) -> Iterator[tuple[Quantity, float]]:
    """The root mean square, in the quantity's unit, of what each drive gives over a turn or over time, where known."""
    for quantity, found in _averaged(result):
        if found.rms is not None:
            yield quantity, quantity.factor * found.rms


def unaveraged(result: Analysis) -> Iterator[tuple[Quantity, str]]:
    """What each drive gives whose mean and root mean square are not known over a turn or over time, with where the
    model has no answer.
    """
    unit = over(result).unit
    for quantity, found in _averaged(result):
        if found.gap is not None:
            first, last = (plain(place(result, end), 4) for end in found.gap)
            yield quantity, f"no answer from {first} to {last} {unit}"


def _averaged(result: Analysis) -> Iterator[tuple[Quantity, Extremes]]:
    x, given = over(result), drive_signals(result.mechanism)
    for quantity in (each.quantity for each in peaks(result) if x.around or x.of_time):
        if quantity.signal in given and quantity.signal in result.extremes:
            yield quantity, result.extremes[quantity.signal]


def power_ends(result: Analysis | Simulation) -> dict[str, list[End]]:
    """The highest and the lowest power (W) of each motor; of a crank that turns evenly where its torque is that."""
    x, speed = over(result).values, result.mechanism.speed
    ends = {}
    for name, each in powers(result).items():
        if name == "power" and isinstance(speed, float):
            torque = peak(result, quantities(result.mechanism)["drive_torque"])
            ends[name] = [End(end.value * speed, end.at) for end in (torque.highest, torque.lowest)]
        else:
            ends[name] = [End(float(each[k]), float(x[k])) for k in (int(np.nanargmax(each)), int(np.nanargmin(each)))]
    return ends


def parts_of(error: ErrorByJoint) -> dict[str, np.ndarray]:
    """What each joint does to an output, those that do anything."""
    least = NOTHING * np.nanmax(error.worst_case, initial=0.0)
    return {joint: part for joint, part in error.by_joint.items() if np.nanmax(np.abs(part), initial=0.0) > least}


def powers(result: Analysis | Simulation) -> dict[str, np.ndarray]:
    """What the motor of a crank gives (N,) W, or what each of several gives whose speed is known; none of one that
    gives nothing.
    """
    m, signals = result.mechanism, result.signals
    if result.motion != "driven" or (m.cranked and m.speed is None):
        return {}
    rate = {body.name: signals.get(f"{body.name}_angular_velocity") for body in m.bodies}
    found: dict[str, np.ndarray] = {}
    for drive in m.drives:
        first, second = (rate.get(body, np.zeros(1)) for body in m.joint(drive.joint).bodies)
        steady = drive.speed if isinstance(drive.speed, float) else None
        if m.cranked:
            speed, given = rate[m.driven], "drive_torque"
        elif m.joint(drive.joint).prismatic:
            speed, given = None, f"drive_force_{drive.joint}"
        else:
            speed, given = None if first is None or second is None else second - first, f"drive_torque_{drive.joint}"
        moved, pushed = speed if speed is not None else steady, signals.get(given)
        if moved is not None and pushed is not None and _size(result, given) > 0:
            found["power" if m.cranked else drive.joint] = pushed * moved
    return {name: watts for name, watts in found.items() if np.isfinite(watts).any()}


@dataclass(frozen=True)
class Acting:
    """A load of the linkage: its size (N,) N or N.m over the motion, and the unit vectors (N,) of its force."""

    load: Load
    label: str
    unit: str
    size: np.ndarray
    way: np.ndarray


def acting(result: Analysis | Simulation) -> Iterator[Acting]:
    """The loads, each with how much of it acts; those whose quantity the result has."""
    m = result.mechanism
    for load in m.loads:
        share = np.ones(len(over(result).values))
        if load.over:
            values = m.load_values(load, result.signals, _time(result))
            values = result.crank_angle if load.over == "crank_angle" else values  # also where there is no answer
            if values is None:
                continue
            share = np.asarray(load.share(values, m.load_quantities[load.over].kind == "angle"))
            share = np.where(np.isfinite(values), share, np.nan)
        size, way = math.hypot(*load.force), _way(result, load) if load.opposes else np.ones(share.size)
        if size:
            way = way * (1.0 if load.opposes else complex(*load.force) / size)
            at = "" if load.point == "com" else f" at {load.point}"
            yield Acting(load, f"force on {load.body}{at}", "N", size * share, way)
        if load.torque:
            torque = load.torque * share
            if load.opposes:
                rate = result.signals.get(f"{load.body}_angular_velocity", np.zeros(1))
                still = not np.any(rate)
                rate = _moved(result, continued(result.signals[f"{load.body}_angle"])) if still else rate
                torque = -np.abs(torque) * np.sign(rate)
            yield Acting(load, f"torque on {load.body}", "N·m", torque, way)


def together(loads: Sequence[Acting]) -> np.ndarray:
    """What loads at one place come to: the size (N,) of their force, or their torque with its sign."""
    sizes = np.array([each.size for each in loads])
    alone = np.count_nonzero(sizes, axis=0) <= 1  # whichever way it acts, also where that is not known
    if loads[0].unit != "N":
        return np.asarray(sizes.sum(axis=0))
    return np.where(alone, sizes.sum(axis=0), np.abs(sum(each.size * each.way for each in loads)))


def _time(result: Analysis | Simulation) -> np.ndarray | None:
    """The time (N,) s since the run's start; None of what rests."""
    x, speed = over(result), result.mechanism.speed
    if x.of_time or result.motion == "static" or speed is None:
        return np.asarray(x.values) if x.of_time else None
    return np.abs(result.crank_angle - (np.min if speed > 0 else np.max)(result.crank_angle)) / abs(speed)


def _way(result: Analysis | Simulation, load: Load) -> np.ndarray:
    """Unit vectors (N,) against the motion of a load's point, from sample to sample."""
    m, signals = result.mechanism, result.signals
    body, turn = m.moving[load.body], np.exp(1j * signals[f"{load.body}_angle"])
    arm = body.point(load.point) - body.point("com")
    path = signals[f"{load.body}_x"] + 1j * signals[f"{load.body}_y"] + arm * turn
    moved = _moved(result, path)
    way = np.full(moved.shape, np.nan, complex)  # unknown where the motion is
    return np.divide(-moved, np.maximum(np.abs(moved), TINY), out=way, where=np.isfinite(moved))


def _moved(result: Analysis | Simulation, path: np.ndarray) -> np.ndarray:
    """Which way (N,) a place or an angle goes as the drive goes on, from sample to sample."""
    if path.size < 2:
        return np.zeros_like(path)
    forth = 1.0 if over(result).of_time else result.mechanism.speed or 1.0
    return np.gradient(path) * np.gradient(over(result).values) * forth
