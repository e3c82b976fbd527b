"""Signals: what a simulation, an analytic answer or a sensor says of a linkage, each by one name.

A name is never taken apart to learn what a signal is: :func:`signals` lists all that a linkage has, and
:func:`named` looks one up.  The names are those of the contract, such as ``reaction_B_x`` and ``crank_angle``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np

from analytic.mechanism.parts import Body, Drive, Joint, Sensor, SensorKind
from analytic.mechanism.units import SiUnit as SiUnit

SignalKind = Literal[
    "pose", "rate", "velocity", "acceleration", "rotation", "reaction", "clearance", "position", "joint_velocity",
    "joint_acceleration", "drive", "power", "sensor", "time", "load",
]  # fmt: skip
Component = Literal[
    "x", "y", "angle", "magnitude", "moment", "angular_velocity", "travel", "speed", "acceleration", "strain", "torque",
    "force", "power", "time",
]  # fmt: skip
# what a linkage has beside what every result holds: it is computed, written and shown where somebody asks for it
ON_REQUEST: frozenset[SignalKind] = frozenset(
    {"velocity", "acceleration", "joint_velocity", "joint_acceleration", "power", "sensor"}
)
# what a linkage does without clearance, whatever acts on it
OF_MOTION: frozenset[SignalKind] = frozenset(
    {"pose", "rate", "velocity", "acceleration", "rotation", "position", "joint_velocity", "joint_acceleration"}
)
DRIVE_TORQUE = "drive_torque"
REACTION: tuple[Component, ...] = ("angle", "magnitude", "x", "y")
POSE: tuple[Component, ...] = ("angle", "x", "y")
ONE_TURN = 2.02 * np.pi  # rad: an encoder that starts again after a turn spans no more, its own error with it
PRINTED_ROUNDING = 1e-9  # relative, by which angles that a file gives in degrees miss a part of a turn
AXES: tuple[Component, Component] = ("x", "y")
_UNITS: dict[tuple[SignalKind, Component], SiUnit] = {
    ("pose", "x"): "m",
    ("pose", "y"): "m",
    ("pose", "angle"): "rad",
    ("rate", "angular_velocity"): "rad/s",
    ("velocity", "x"): "m/s",
    ("velocity", "y"): "m/s",
    ("acceleration", "x"): "m/s^2",
    ("acceleration", "y"): "m/s^2",
    ("acceleration", "angle"): "rad/s^2",
    ("rotation", "angle"): "rad",
    ("reaction", "x"): "N",
    ("reaction", "y"): "N",
    ("reaction", "angle"): "rad",
    ("reaction", "magnitude"): "N",
    ("reaction", "moment"): "N.m",
    ("clearance", "x"): "m",
    ("clearance", "y"): "m",
    ("clearance", "angle"): "rad",
    ("position", "angle"): "rad",
    ("position", "travel"): "m",
    ("joint_velocity", "angle"): "rad/s",
    ("joint_velocity", "travel"): "m/s",
    ("joint_acceleration", "angle"): "rad/s^2",
    ("joint_acceleration", "travel"): "m/s^2",
    ("drive", "torque"): "N.m",
    ("drive", "force"): "N",
    ("power", "power"): "W",
    ("sensor", "travel"): "m",
    ("sensor", "speed"): "m/s",
    ("sensor", "acceleration"): "m/s^2",
    ("sensor", "angular_velocity"): "rad/s",
    ("sensor", "strain"): "1",
    ("sensor", "force"): "N",
    ("sensor", "torque"): "N.m",
    ("time", "time"): "s",
    ("load", "force"): "N",
    ("load", "torque"): "N.m",
}


_READS: dict[SensorKind, Component] = {
    "position": "travel",
    "velocity": "speed",
    "accelerometer": "acceleration",
    "gyro": "angular_velocity",
    "distance": "travel",
    "strain": "strain",
    "force": "force",
    "torque": "torque",
}


@dataclass(frozen=True)
class Signal:
    """One signal: a ``component`` of some ``kind`` of quantity at a ``place``: body, joint, or "" for the one drive.

    A load that is a column of a file has the column's heading for a place.
    """

    kind: SignalKind
    place: str
    component: Component

    @staticmethod
    @lru_cache(maxsize=4096)
    def of(kind: SignalKind, place: str, component: Component) -> Signal:
        """A signal, kept for the next call: results ask for the same ones again and again."""
        return Signal(kind, place, component)

    @cached_property
    def name(self) -> str:
        """The signal's name in files."""
        if self.kind in ("time", "load", "sensor"):
            return self.place or "time"
        if self.kind in ("drive", "power"):
            return f"drive_{self.component}_{self.place}" if self.place else f"drive_{self.component}"
        if self.kind in ("position", "joint_velocity", "joint_acceleration"):
            return f"{self.kind.removeprefix('joint_')}_{self.place}"
        if self.kind in ("velocity", "acceleration"):
            turning = self.component == "angle"
            return f"{self.place}_angular_{self.kind}" if turning else f"{self.place}_{self.kind}_{self.component}"
        if self.kind in ("reaction", "clearance"):
            return f"{self.kind}_{self.place}_{self.component}"
        return f"{self.place}_rotation" if self.kind == "rotation" else f"{self.place}_{self.component}"

    @property
    def unit(self) -> SiUnit:
        """SI unit."""
        return _UNITS[self.kind, self.component]

    @property
    def wraps(self) -> bool:
        """Whether two values that are a whole number of turns apart are the same."""
        return self.unit == "rad"

    @property
    def on_request(self) -> bool:
        """Whether results hold it only where somebody asks for it."""
        return self.kind in ON_REQUEST

    @property
    def of_joint(self) -> bool:
        """Whether its place is a joint."""
        joints = ("reaction", "clearance", "position", "joint_velocity", "joint_acceleration")
        return self.kind in joints or (self.kind == "drive" and bool(self.place))

    @property
    def owner(self) -> str:
        """The body, joint or drive that has the signal, for messages: ``joint 'B'``."""
        if self.of_joint:
            return f"joint {self.place!r}"
        if self.kind == "sensor":
            return f"sensor {self.place!r}"
        return f"body {self.place!r}" if self.place else "the drive"

    def sibling(self, component: Component) -> Signal:
        """Another component at the same place."""
        return Signal.of(self.kind, self.place, component)

    def apart(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """One series (N,) of this signal minus another; angles modulo a turn, in [-pi, pi)."""
        difference = np.asarray(one, float) - np.asarray(other, float)
        return wrapped(difference) if self.wraps else difference


POWER = Signal("power", "", "power")


def signals(
    bodies: Iterable[Body], joints: Iterable[Joint], drives: Iterable[Drive] = (), sensors: Iterable[Sensor] = ()
) -> Iterator[Signal]:
    """Every signal that a linkage of these bodies, joints, drives and sensors can have, joints first, in the order of a
    report.
    """
    known = {joint.name: joint for joint in joints}
    for joint in known.values():
        yield from (Signal.of("reaction", joint.name, component) for component in REACTION)
        if joint.prismatic:
            yield Signal.of("reaction", joint.name, "moment")
        yield from play(joint)
    for body in bodies:
        yield Signal.of("rotation", body.name, "angle")
        yield from (Signal.of("pose", body.name, component) for component in POSE)
        yield Signal.of("rate", body.name, "angular_velocity")
        yield from moving(body.name)
    for joint in known.values():
        yield from (position(joint), *slipping(joint))
    yield from driving([known[drive.joint] for drive in drives if drive.speed != "free"])
    yield POWER
    yield from map(reading, sensors)


def reading(sensor: Sensor) -> Signal:
    """What a sensor of the mechanism file reads: a signal by its name."""
    return Signal.of("sensor", sensor.name, _READS[sensor.kind])


def play(joint: Joint) -> Iterator[Signal]:
    """What a joint with clearance moves by: first pin centre minus second; of a block in its guide also the angle of
    the guide minus the block's.  None of a prismatic joint without ``guide``.
    """
    if not joint.prismatic or joint.guide is not None:
        yield Signal.of("clearance", joint.name, "x")
        yield Signal.of("clearance", joint.name, "y")
    if joint.guide is not None:
        yield Signal.of("clearance", joint.name, "angle")


def position(joint: Joint) -> Signal:
    """Where a joint is: its second body relative to its first, an angle, or a travel along its axis."""
    return Signal.of("position", joint.name, "travel" if joint.prismatic else "angle")


def moving(body: str) -> Iterator[Signal]:
    """How a body moves beside its angular velocity: velocity and acceleration of its marker, angular acceleration."""
    yield from (Signal.of("velocity", body, axis) for axis in AXES)
    yield from (Signal.of("acceleration", body, axis) for axis in AXES)
    yield Signal.of("acceleration", body, "angle")


def slipping(joint: Joint) -> tuple[Signal, Signal]:
    """Rate and acceleration of a joint's position."""
    component = position(joint).component
    return Signal.of("joint_velocity", joint.name, component), Signal.of("joint_acceleration", joint.name, component)


def driving(driven: Sequence[Joint]) -> list[Signal]:
    """What the motors in these joints give: ``drive_torque`` where there is one motor that turns (or none), else each
    joint its torque or force.
    """
    if not driven or (len(driven) == 1 and not driven[0].prismatic):
        return [Signal.of("drive", "", "torque")]
    return [Signal.of("drive", joint.name, "force" if joint.prismatic else "torque") for joint in driven]


def named(
    bodies: Iterable[Body], joints: Iterable[Joint], drives: Iterable[Drive] = (), sensors: Iterable[Sensor] = ()
) -> Mapping[str, Signal]:
    """Every signal of a linkage by name; the checks of a mechanism see to it that no two have one name."""
    return {signal.name: signal for signal in signals(bodies, joints, drives, sensors)}


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Angles (rad) of any shape brought into [-pi, pi) by whole turns."""
    return (np.asarray(angle, float) + np.pi) % (2 * np.pi) - np.pi


def turned_near(angle: np.ndarray | float, near: np.ndarray | float) -> np.ndarray:
    """Angles (rad) brought within half a turn of others by whole turns; shapes broadcast."""
    return np.asarray(angle + 2 * np.pi * np.rint((near - angle) / (2 * np.pi)))


def same_turn(angle: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """An angle (N,) rad brought at each sample by whole turns within half a turn of a reference (N,), between whose
    samples where it has none, so that their difference is the one judged; of other samples it stays.
    """
    known = np.flatnonzero(np.isfinite(reference))
    if not known.size or len(reference) != len(angle):
        return angle
    return turned_near(angle, np.interp(np.arange(len(angle)), known, reference[known]))


def continued(angle: np.ndarray) -> np.ndarray:
    """An angle (N,) rad without jumps by a turn between one number and the next; NaN stays."""
    out = np.array(angle, float)
    known = np.flatnonzero(np.isfinite(out))
    if np.any(np.abs(np.diff(out[known])) > np.pi):  # else np.unwrap, which takes long, would change nothing
        out[known] = np.unwrap(out[known])
    return out


def starts_again(angle: np.ndarray) -> bool:
    """Whether an angle (N,) rad of a file starts again after a turn: it stays within one, and steps by half of one or
    more.  An angle that leaves one turn is continuous.
    """
    known = angle[np.isfinite(angle)]
    return bool(
        known.size and np.ptp(known) <= ONE_TURN and np.any(np.abs(np.diff(known)) >= np.pi * (1 - PRINTED_ROUNDING))
    )


def unwound(angle: np.ndarray) -> np.ndarray:
    """An angle (N,) without jumps where it starts again after a turn, else as the file has it; NaN stays."""
    return continued(angle) if starts_again(angle) else np.array(angle, float)


def undirected(angle: np.ndarray) -> float:
    """The largest step (rad) of an angle (N,) that was continued, if it does not say which way it turned; else 0.

    Beyond a quarter of a turn every second sample alone would say the other way.
    """
    step = float(np.max(np.abs(np.diff(angle[np.isfinite(angle)])), initial=0.0))
    return step if step > np.pi / 2 * (1 + PRINTED_ROUNDING) else 0.0
