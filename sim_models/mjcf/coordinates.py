"""How a mechanism's signals relate to the coordinates, actuators and sensors of a MuJoCo model: a map of the columns of
a log that has them by their names in the file.

Columns are called after MuJoCo's arrays and what they are of: ``qpos_<joint>``, ``qvel_<joint>``, ``qacc_<joint>``,
``actuator_force_<actuator>``, ``sensordata_<sensor>``, the last with ``_x``, ``_y``, ``_z`` where it has three numbers.
"""

from __future__ import annotations

import cmath
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from analytic.mechanism import GROUND, Joint, Mechanism
from analytic.mechanism.signals import DRIVE_TORQUE, Signal, driving, position, slipping
from sim_models.mjcf.compiled import AT_JOINT
from sim_models.mjcf.drive import flywheel, switched_off
from sim_models.mjcf.match import Match, match
from sim_models.mjcf.parts import Frames
from sim_models.mjcf.planar import Planar

SENSOR = mujoco.mjtSensor
OF_JOINT = {int(SENSOR.mjSENS_JOINTPOS): "qpos", int(SENSOR.mjSENS_JOINTVEL): "qvel"}
FORCE, GYRO, ACTUATOR = int(SENSOR.mjSENS_FORCE), int(SENSOR.mjSENS_GYRO), int(SENSOR.mjSENS_ACTUATORFRC)
JOINT_FORCE = int(SENSOR.mjSENS_JOINTACTFRC)
ALIGNED = 1e-6  # rad: an axis of a sensor that is off a body's by less is that one
STEP = 1e-3  # rad, m: of a coordinate, by which its way is told; a tree's poses are exact forms of it
DIGITS = 12  # of an offset, in radians or metres
HEAD = """\
# What columns of {source} are, by MuJoCo's names in it.  For compare check --map, or [columns] of a measured.toml.
#{relations}
optional = true    # a log may have some of these alone; of several that are one signal the first is read

[columns]
"""


@dataclass(frozen=True)
class Relation:
    """A signal as ``scale`` times the column ``heading`` plus ``offset``, in SI; in a ``frame`` of a body that turns,
    or the ground's.
    """

    signal: str
    unit: str
    heading: str
    scale: float
    offset: float = 0.0
    frame: str = ""

    def __str__(self) -> str:
        sign = "-" if self.scale < 0 else ""
        size = "" if abs(self.scale) == 1.0 else f"{abs(self.scale):.12g} "
        plus = f" {'-' if self.offset < 0 else '+'} {abs(self.offset):.6g}" if self.offset else ""
        return f"{self.signal} = {sign}{size}{self.heading}{plus}" + f", in {self.frame}'s frame" * bool(self.frame)

    @property
    def inverse(self) -> str:
        """The column as the signal says it."""
        back = Relation(self.heading, self.unit, self.signal, 1.0 / self.scale, -self.offset / self.scale, self.frame)
        return str(back)

    @property
    def entry(self) -> str:
        """Its line of a map."""
        fields = [f"signal = {json.dumps(self.signal)}", f'unit = "{self.unit}"']
        fields += ["sign = -1"] * (self.scale < 0)
        fields += [f"scale = {abs(self.scale)!r}"] * (abs(self.scale) != 1.0)
        fields += [f"offset = {self.offset!r}"] if self.offset else []
        fields += [f"frame = {json.dumps(self.frame)}"] if self.frame else []
        return f"{json.dumps(self.heading)} = {{ {', '.join(fields)} }}"


def as_map(relations: Sequence[Relation], source: str, *, inverse: bool = False) -> str:
    """A map of the columns (TOML), with the relations in words at its head; of an export they say the columns."""
    said = "".join(f"\n#   {each.inverse if inverse else each}" for each in relations)
    return HEAD.format(source=source, relations=said) + "".join(f"{each.entry}\n" for each in relations)


def relations(mechanism: Mechanism, planar: Planar) -> tuple[Relation, ...]:
    """How the signals of a mechanism relate to a file that is its linkage.  Raises Unsupported where it is another."""
    return tuple(_Coordinates(mechanism, planar).all())


class _Coordinates:
    def __init__(self, mechanism: Mechanism, planar: Planar) -> None:
        self.mechanism, self.planar, self.m = mechanism, planar, planar.model
        self.match: Match = match(mechanism, planar)
        self.joints = {self.match.pins[j.name].joint: j for j in mechanism.joints if self.match.pins[j.name].joint >= 0}
        self.home = planar.at(planar.pose)

    def all(self) -> Iterator[Relation]:
        for j, joint in self.joints.items():
            yield from self.of_joint(joint, *(f"{array}_{self.name('joint', j)}" for array in ("qpos", "qvel", "qacc")))
        for i in range(self.m.nactuator):
            yield from self.of_actuator(i, f"actuator_force_{self.name('actuator', i)}")
        for i in range(self.m.nsensor):
            yield from self.of_sensor(i, f"sensordata_{self.name('sensor', i)}")

    def name(self, kind: str, number: int) -> str:
        """What the file calls it, or its number from 0."""
        return getattr(self.m, kind)(number).name or str(number)

    # ------------------------------------------------------------------ joints

    def of_joint(self, joint: Joint, qpos: str, qvel: str = "", qacc: str = "") -> Iterator[Relation]:
        """Where a joint is and how fast: of the crank by its body."""
        way, zero = self.form(joint)
        place, (rate, acceleration) = position(joint), slipping(joint)
        body = self.cranked(joint)
        if body:
            place, rate = Signal.of("pose", body, "angle"), Signal.of("rate", body, "angular_velocity")
            acceleration = Signal.of("acceleration", body, "angle")
        if qpos:
            yield Relation(place.name, place.unit, qpos, way, zero)
        for signal, heading in ((rate, qvel), (acceleration, qacc)):
            if heading:
                yield Relation(signal.name, signal.unit, heading, way)

    def cranked(self, joint: Joint) -> str:
        """The body by whose angle a joint is told: the crank that turns in it on the ground."""
        m = self.mechanism
        return (
            m.driven
            if m.cranked and GROUND in joint.bodies and m.driven in joint.bodies and not joint.prismatic
            else ""
        )

    def form(self, joint: Joint) -> tuple[float, float]:
        """A joint's position, or its crank's angle, is its coordinate times the first (1, -1) plus the second."""
        at = int(self.m.jnt_qposadr[self.match.pins[joint.name].joint])
        there = self.planar.pose.copy()
        there[at] += STEP
        here, moved = self.position(joint, self.home), self.position(joint, self.planar.at(there))
        apart = moved - here if joint.prismatic else math.remainder(moved - here, math.tau)
        way = math.copysign(1.0, apart)
        zero = here - way * float(self.planar.pose[at])
        if not joint.prismatic:  # on the turn of the mechanism's own assembly
            zero += math.tau * round((self.assembled(joint) - here) / math.tau)
        return way, round(zero, DIGITS) + 0.0

    def position(self, joint: Joint, frames: Frames) -> float:
        """Where a joint is (rad, m), its second body relative to its first; of the crank the body's angle."""
        body = self.cranked(joint)
        if body:
            return self.angle(body, frames)
        first, second = joint.bodies
        if not joint.prismatic:
            return self.angle(second, frames) - self.angle(first, frames)
        way = self.place(second, joint.name, frames) - self.place(first, joint.name, frames)
        return (way * (joint.direction * cmath.exp(1j * self.angle(first, frames))).conjugate()).real

    def assembled(self, joint: Joint) -> float:
        """Its angle in the mechanism's [assembly]."""
        angles = {GROUND: 0.0, **self.mechanism.assembly}
        body = self.cranked(joint)
        first, second = joint.bodies
        return angles[body] if body else angles.get(second, 0.0) - angles.get(first, 0.0)

    def angle(self, body: str, frames: Frames) -> float:
        """A body's angle (rad) in the mechanism's ground frame."""
        link, turn = self.match.links[body], self.match.frames[body].turn
        return frames.angles[link] + cmath.phase(turn) - cmath.phase(self.match.frames[GROUND].turn)

    def place(self, body: str, point: str, frames: Frames) -> complex:
        """Where a body's point (m) is in the mechanism's ground frame."""
        there = frames.place(self.match.links[body], self.match.frames[body].of(self.mechanism.body(body).point(point)))
        return self.match.frames[GROUND].back(there)

    # ------------------------------------------------------------------ actuators and sensors

    def of_actuator(self, i: int, heading: str) -> Iterator[Relation]:
        """What a drive gives, by its actuator, if that is the only one in its joint."""
        m = self.m
        own = [k for k in range(m.nactuator) if m.actuator_trntype[k] in AT_JOINT and not switched_off(m, k)]
        j = int(m.actuator_trnid[i, 0])
        if i in own and [int(m.actuator_trnid[k, 0]) for k in own].count(j) == 1:
            yield from self.of_drive(j, float(m.actuator_gear[i, 0]), heading)

    def of_drive(self, j: int, gear: float, heading: str) -> Iterator[Relation]:
        """What a motor in a joint gives, as its coordinate's force, which is ``gear`` times a column."""
        motors = self.mechanism.motors
        joint = self.joints.get(j)
        if joint is None or joint not in motors or flywheel(self.planar, self.match.pins[joint.name]):
            return  # what moves a flywheel is no drive's
        signal = driving(motors)[0 if len(motors) == 1 else motors.index(joint)]
        way = self.form(joint)[0]
        if signal.name == DRIVE_TORQUE and not self.cranked(joint) and self.mechanism.cranked:
            return
        yield Relation(signal.name, signal.unit, heading, way * gear)

    def of_sensor(self, i: int, heading: str) -> Iterator[Relation]:
        m = self.m
        kind, of = int(m.sensor_type[i]), int(m.sensor_objid[i])
        scaled = float(m.sensor_cutoff[i]) == 0.0  # a cutoff clips
        if not scaled:
            return
        if kind in OF_JOINT and of in self.joints:
            what = OF_JOINT[kind]
            yield from self.of_joint(
                self.joints[of], heading if what == "qpos" else "", heading if what == "qvel" else ""
            )
        elif kind == ACTUATOR:
            yield from self.of_actuator(of, heading)
        elif kind == JOINT_FORCE:
            yield from self.of_drive(of, 1.0, heading)
        elif kind == GYRO:
            yield from self.of_gyro(of, heading)
        elif kind == FORCE:
            yield from self.of_force(of, heading)

    def of_gyro(self, site: int, heading: str) -> Iterator[Relation]:
        """The rate of a body, by the axis of a gyro that lies across the plane."""
        link = self.planar.sites[site].link
        body = next((name for name, k in self.match.links.items() if k == link and name != GROUND), None)
        across = self.axes(site) @ self.planar.plane.normal
        for axis, along in zip("xyz", across.tolist(), strict=True):
            if body is not None and abs(along) > 1 - ALIGNED:
                yield Relation(f"{body}_angular_velocity", "rad/s", f"{heading}_{axis}", math.copysign(1.0, along))

    def axes(self, site: int) -> np.ndarray:
        """The axes (3, 3) of a site, a row each, in MuJoCo's world in the initial pose."""
        data = mujoco.MjData(self.m)
        data.qpos[:] = self.planar.pose
        mujoco.mj_kinematics(self.m, data)
        return data.site_xmat[site].reshape(3, 3).T

    def of_force(self, site: int, heading: str) -> Iterator[Relation]:
        """The reaction of a joint, by a force sensor in its child body, in that body's frame: what its parent exerts on
        the child, along the sensor's axes.
        """
        body, m = int(self.m.site_bodyid[site]), self.m
        joint = self.joints.get(int(m.body_jntadr[body])) if m.body_jntnum[body] else None
        if joint is None:
            return
        way = -1.0 if self.match.swapped(joint) else 1.0
        first, second = joint.bodies
        ours = first if self.match.swapped(joint) else second
        turned = cmath.exp(1j * (self.angle(ours, self.home) + cmath.phase(self.match.frames[GROUND].turn)))
        for name, axis in zip("xyz", self.axes(site), strict=True):
            along = self.planar.plane.flat(axis) / turned
            for component, unit in (("x", 1.0), ("y", 1j)):
                if abs(along - unit) < ALIGNED or abs(along + unit) < ALIGNED:
                    sign = way if abs(along - unit) < ALIGNED else -way
                    frame = "" if ours == GROUND else ours
                    yield Relation(f"reaction_{joint.name}_{component}", "N", f"{heading}_{name}", sign, frame=frame)
