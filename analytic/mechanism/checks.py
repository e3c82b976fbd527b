"""What must hold between the parts of a mechanism, and what looks like a slip of units.

Each check raises ValueError with one sentence that names the part, the field, the value and the remedy.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping
from typing import Protocol

from analytic.mechanism.parts import GROUND, SMALLEST, Body, Drive, Ground, Joint, Load
from analytic.mechanism.signals import signals

LARGEST_PLAUSIBLE_LENGTH = 20.0  # m; a linkage larger than this was probably entered in millimetres


class MechanismWarning(UserWarning):
    """Something in a mechanism is legal but looks like a mistake."""


class Mechanism(Protocol):
    """What the checks look at of :class:`analytic.mechanism.Mechanism`."""

    @property
    def name(self) -> str: ...
    @property
    def bodies(self) -> tuple[Body, ...]: ...
    @property
    def joints(self) -> tuple[Joint, ...]: ...
    @property
    def drive(self) -> Drive | None: ...
    @property
    def loads(self) -> tuple[Load, ...]: ...
    @property
    def assembly(self) -> Mapping[str, float]: ...
    @property
    def moving(self) -> dict[str, Body]: ...
    @property
    def parts(self) -> dict[str, Body | Ground]: ...
    @property
    def driven(self) -> str: ...
    def body(self, name: str) -> Body | Ground: ...
    def joint(self, name: str) -> Joint: ...


def check(m: Mechanism) -> None:
    """Everything below, in the order in which a reader would want to hear of it."""
    check_names(m)
    for joint in m.joints:
        check_joint(m, joint)
    check_drive(m)
    check_places(m)
    for body in m.bodies:
        check_body(m, body)
    warn_of_millimetres(m)
    warn_of_degrees(m)


def check_names(m: Mechanism) -> None:
    """Bodies and joints have names of their own, and so have their signals."""
    for kind, names in (("body", [GROUND, *(b.name for b in m.bodies)]), ("joint", [j.name for j in m.joints])):
        twice = [n for n in names if names.count(n) > 1]
        if twice:
            raise ValueError(f"{kind} {twice[0]!r} is defined twice; give each {kind} its own name ('ground' is taken)")
    if "world" in m.moving:
        raise ValueError("body 'world' has a name that engines give to the ground; call it something else")
    taken: dict[str, str] = {}
    for signal in signals(m.bodies, m.joints):
        if signal.name in taken:
            raise ValueError(
                f"signal {signal.name} would be one of {taken[signal.name]} and of {signal.owner}; give one of them"
                " another name"
            )
        taken[signal.name] = signal.owner


def check_joint(m: Mechanism, j: Joint) -> None:
    """A joint joins two bodies that have a point for it, and its fields suit its type."""
    where = f"joint {j.name!r}: "
    for name in j.bodies:
        if name not in m.parts:
            raise ValueError(f"{where}bodies names {name!r}; the bodies are {_list(m.parts)}")
        if j.name not in m.body(name).points:
            raise ValueError(
                f"{where}body {name!r} has no point {j.name!r}; its points are {_list(m.body(name).points)}"
            )
    if j.bodies[0] == j.bodies[1]:
        raise ValueError(f"{where}bodies are both {j.bodies[0]!r}; a joint connects two bodies")
    if j.prismatic:
        if j.axis is None or abs(complex(*j.axis)) == 0:
            raise ValueError(f"{where}axis is {j.axis}; a prismatic joint needs a direction [x, y] that is not zero")
        if j.clearance:
            raise ValueError(f"{where}clearance is {j.clearance}; only a revolute joint has one, leave it out")
        if j.friction and j.friction_torque:
            raise ValueError(
                f"{where}friction and friction_torque are both given; for a prismatic joint both mean N, keep one"
            )
    elif j.axis is not None or j.angle:
        raise ValueError(f"{where}axis and angle belong to a prismatic joint; leave them out of a revolute one")
    for name in j.bodies:
        body = m.moving.get(name)
        if body is not None and len(body.points) > 1 and 0 < body.length <= j.clearance:
            raise ValueError(
                f"{where}clearance = {j.clearance} m is not smaller than body {name!r} ({body.length:g} m); give the"
                " radial clearance in m"
            )


def check_drive(m: Mechanism) -> None:
    """The drive turns a body on the ground."""
    if m.drive is None:
        if not any(not j.prismatic and GROUND in j.bodies for j in m.joints):
            raise ValueError("no revolute joint connects a body to the ground; add one")
        return
    names = [j.name for j in m.joints]
    if m.drive.joint not in names:
        raise ValueError(f"drive.joint = {m.drive.joint!r} is not a joint; the joints are {_list(names)}")
    joint = m.joint(m.drive.joint)
    if joint.prismatic or GROUND not in joint.bodies:
        raise ValueError(f"drive.joint = {joint.name!r} must be a revolute joint on the ground")
    if m.drive.speed == 0:
        raise ValueError("drive.speed = 0; give the speed in rad/s, or 'free' (compare statics with --motion static)")


def check_places(m: Mechanism) -> None:
    """Loads and assembly angles name bodies and points that exist."""
    for load in m.loads:
        body = m.moving.get(load.body)
        if body is None:
            raise ValueError(
                f"load.body = {load.body!r} is not a moving body; the bodies are {_list(b.name for b in m.bodies)}"
            )
        if load.point != "com" and load.point not in body.points:
            raise ValueError(
                f"load.point = {load.point!r} is not a point of {load.body!r}; use com, {_list(body.points)}"
            )
    for name in m.assembly:
        if name not in m.moving:
            raise ValueError(f"assembly.{name} is not a moving body; the bodies are {_list(b.name for b in m.bodies)}")
    if m.driven not in m.assembly:
        raise ValueError(
            f"assembly.{m.driven} is missing; give the driven body's angle (rad) at which the linkage is assembled"
        )


def check_body(m: Mechanism, b: Body) -> None:
    """A body sits in joints, and has length where it turns between them."""
    if not b.points:
        raise ValueError(f"body {b.name!r} has no points; name one after each joint that it sits in")
    joints = [j for j in m.joints if b.name in j.bodies]
    if not joints:
        raise ValueError(f"body {b.name!r} sits in no joint; add one or leave the body out")
    pins = [b.point(j.name) for j in joints if not j.prismatic]
    if len(pins) > 1 and all(abs(p - pins[0]) < SMALLEST for p in pins):
        raise ValueError(
            f"body {b.name!r} has no length: all of its revolute joints sit at {pins[0].real, pins[0].imag}; move one"
        )


def warn_of_millimetres(m: Mechanism) -> None:
    """Warn of a length that no linkage has."""
    lengths = [(f"{b.name}.points.{n}", abs(complex(*p))) for b in m.parts.values() for n, p in b.points.items()]
    lengths += [(f"{b.name}.section", max(b.section)) for b in m.bodies]
    name, largest = max(lengths, key=lambda item: item[1])
    if largest > LARGEST_PLAUSIBLE_LENGTH:
        warnings.warn(
            f"{m.name}: {name} is {largest:g} m; lengths are in metres, was it meant in millimetres?",
            MechanismWarning,
            stacklevel=2,
        )


def warn_of_degrees(m: Mechanism) -> None:
    """Warn of an assembly angle of several turns."""
    turns = {b: a for b, a in m.assembly.items() if abs(a) > 4 * math.pi}
    if turns:
        body, angle = next(iter(turns.items()))
        warnings.warn(
            f"{m.name}: assembly.{body} is {angle:g} rad; angles are in radians, was it meant in degrees?",
            MechanismWarning,
            stacklevel=2,
        )


def _list(names: Iterable[str]) -> str:
    return ", ".join(names)
