"""The one description of a planar linkage: bodies, joints, drive, loads and assembly mode.

SI units and radians throughout.  Every object is frozen and checked when it is made; change one with
:meth:`Mechanism.replace`, which checks again.  Files are read and written in :mod:`analytic.mechanism_file`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

GROUND = "ground"
LARGEST_PLAUSIBLE_LENGTH = 20.0  # m; a linkage larger than this was probably entered in millimetres


class MechanismWarning(UserWarning):
    """Something in a mechanism is legal but looks like a mistake."""


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _named(value: Any) -> Any:
    if isinstance(value, str) and not value.replace("-", "_").isidentifier():
        raise ValueError("a name is made of letters, digits, '_' and '-', and starts with a letter")
    return value


Vector = Annotated[tuple[float, float], BeforeValidator(_as_tuple)]
Name = Annotated[str, BeforeValidator(_named)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, populate_by_name=True)


class Ground(_Part):
    """The fixed link; ``points`` (m) are in the ground frame."""

    points: Mapping[Name, Vector]

    name: Literal["ground"] = Field(default=GROUND, exclude=True)

    def point(self, name: str) -> complex:
        """A ground point as x + iy (m)."""
        return complex(*self.points[name])


class Body(_Part):
    """A moving link.  ``points`` and ``com`` (m) are in the body's frame; a point is named after its joint."""

    name: Name
    points: Mapping[Name, Vector]
    mass: Positive  # kg
    com: Vector | None = None  # left out: the middle of the points
    section: Annotated[tuple[NotNegative, NotNegative], BeforeValidator(_as_tuple)] = (0.0, 0.0)  # m, in-plane height, depth
    inertia: NotNegative | None = None  # kg.m^2 about the com; left out: a uniform bar
    youngs_modulus: Positive | None = None  # Pa; left out: rigid
    shear_modulus: Positive | None = None  # Pa

    def point(self, name: str) -> complex:
        """A body point, or ``"com"``, as x + iy (m, body frame)."""
        return self.centre if name == "com" else complex(*self.points[name])

    @property
    def centre(self) -> complex:
        """The centre of mass (m, body frame): ``com``, or the middle of the points."""
        if self.com is not None:
            return complex(*self.com)
        return sum((complex(*p) for p in self.points.values()), 0j) / len(self.points)

    @property
    def length(self) -> float:
        """The largest distance between two of the body's points (m)."""
        points = [complex(*p) for p in self.points.values()]
        return max(abs(p - q) for p in points for q in points)

    @property
    def moment_of_inertia(self) -> float:
        """Moment of inertia (kg.m^2) about the com: as given, or of a uniform bar, m (L^2 + h^2)/12 (Eq. 13, corrected)."""
        if self.inertia is not None:
            return self.inertia
        return self.mass * (self.length**2 + self.section[0] ** 2) / 12


class Elasticity(_Part):
    """Stiffness of a joint as a six-dof spring (Eq. 4): N/m and N.m/rad; rotation about z stays free."""

    translation: Positive
    rotation: Positive


class Joint(_Part):
    """A revolute or prismatic joint; its reaction is the force of the first body on the second."""

    name: Name
    type: Literal["revolute", "prismatic"]
    bodies: Annotated[tuple[Name, Name], BeforeValidator(_as_tuple)]
    axis: Vector | None = None  # prismatic: direction of sliding in the first body's frame
    angle: float = 0.0  # rad, prismatic: the second body's angle minus the first's
    clearance: NotNegative = 0.0  # m, radial
    pin_radius: Positive | None = None  # m
    friction: NotNegative = 0.0  # revolute: Coulomb coefficient in contact; prismatic: N, as friction_torque
    contact_stiffness: Positive | None = None  # N/m
    contact_damping: NotNegative | None = None  # N.s/m
    restitution: Annotated[float, Field(ge=0, le=1)] | None = None
    friction_torque: NotNegative = 0.0  # N.m (prismatic: N), constant Coulomb
    damping: NotNegative = 0.0  # N.m.s/rad (prismatic: N.s/m)
    stiffness: NotNegative = 0.0  # N.m/rad (prismatic: N/m)
    rest_angle: float = 0.0  # rad (prismatic: m)
    elasticity: Elasticity | None = None

    @property
    def prismatic(self) -> bool:
        """Whether the joint slides."""
        return self.type == "prismatic"

    @property
    def direction(self) -> complex:
        """Unit vector of sliding in the first body's frame, as x + iy."""
        axis = complex(*(self.axis or (1.0, 0.0)))
        return axis / abs(axis)

    @property
    def coulomb(self) -> float:
        """Constant Coulomb friction: N.m, or N for a prismatic joint."""
        return self.friction_torque or (self.friction if self.prismatic else 0.0)


class Drive(_Part):
    """The motor: a constant speed (rad/s), ``"free"`` (released) or ``"measured"`` (follows data)."""

    joint: Name
    speed: float | Literal["free", "measured"]
    stiffness: Positive | None = None  # N.m/rad between motor and crank; left out: rigid


class Load(_Part):
    """A force (N, ground frame, fixed in direction) at a point of a body, or a torque (N.m) on it."""

    body: Name
    point: Name = "com"
    force: Vector = (0.0, 0.0)
    torque: float = 0.0


class Mechanism(_Part):
    """A planar linkage.  Raises :class:`pydantic.ValidationError` where it contradicts itself."""

    name: str
    gravity: Vector = (0.0, 0.0)  # m/s^2
    ground: Ground
    bodies: Annotated[tuple[Body, ...], BeforeValidator(_as_tuple), Field(alias="body", min_length=1)]
    joints: Annotated[tuple[Joint, ...], BeforeValidator(_as_tuple), Field(alias="joint", min_length=1)]
    drive: Drive | None = None
    loads: Annotated[tuple[Load, ...], BeforeValidator(_as_tuple), Field(alias="load")] = ()
    assembly: Mapping[Name, float] = Field(default_factory=dict)  # rad

    def body(self, name: str) -> Body | Ground:
        """The body, or the ground, of that name (KeyError if there is none)."""
        return self._by_name[name]

    def joint(self, name: str) -> Joint:
        """The joint of that name (KeyError if there is none)."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise KeyError(name)

    @property
    def _by_name(self) -> dict[str, Body | Ground]:
        return {GROUND: self.ground, **{b.name: b for b in self.bodies}}

    @property
    def drive_joint(self) -> Joint:
        """The joint that turns the driven body; without a drive, the first revolute joint on the ground."""
        if self.drive is not None:
            return self.joint(self.drive.joint)
        return next(j for j in self.joints if not j.prismatic and GROUND in j.bodies)

    @property
    def driven(self) -> str:
        """Name of the driven body: the crank."""
        first, second = self.drive_joint.bodies
        return second if first == GROUND else first

    @property
    def speed(self) -> float | None:
        """The drive's constant speed (rad/s), or None if it has none."""
        return self.drive.speed if self.drive is not None and isinstance(self.drive.speed, float) else None

    @property
    def clearances(self) -> dict[str, float]:
        """Radial clearance (m) of each joint that has one."""
        return {j.name: j.clearance for j in self.joints if j.clearance > 0}

    def replace(self, **fields: Any) -> Mechanism:
        """A checked copy with top-level fields replaced."""
        return Mechanism.model_validate({name: fields.get(name, getattr(self, name)) for name in type(self).model_fields})

    def with_joint(self, name: str, **fields: Any) -> Mechanism:
        """A checked copy with fields of one joint replaced."""
        return self.replace(joints=_edited(self.joints, name, fields))

    def with_body(self, name: str, **fields: Any) -> Mechanism:
        """A checked copy with fields of one body replaced."""
        return self.replace(bodies=_edited(self.bodies, name, fields))

    def with_clearances(self, clearances: Mapping[str, float]) -> Mechanism:
        """A checked copy with exactly these radial clearances (m); every other joint is ideal."""
        unknown = sorted(set(clearances) - {j.name for j in self.joints})
        if unknown:
            raise ValueError(f"clearance names joint {unknown[0]!r}; the joints are {_list(j.name for j in self.joints)}")
        joints = tuple(j.model_copy(update={"clearance": float(clearances.get(j.name, 0.0))}) for j in self.joints)
        return self.replace(joints=tuple(Joint.model_validate(j.model_dump()) for j in joints))

    @model_validator(mode="after")
    def _check(self) -> Mechanism:
        _check_names(self)
        for joint in self.joints:
            _check_joint(self, joint)
        _check_drive(self)
        _check_places(self)
        for body in self.bodies:
            _check_body(self, body)
        _warn_of_millimetres(self)
        return self


def _edited(parts: tuple[Any, ...], name: str, fields: Mapping[str, Any]) -> tuple[Any, ...]:
    if name not in [p.name for p in parts]:
        raise KeyError(name)
    return tuple(type(p).model_validate({**p.model_dump(), **fields}) if p.name == name else p for p in parts)


def _list(names: Any) -> str:
    return ", ".join(names)


def _check_names(m: Mechanism) -> None:
    for kind, names in (("body", [GROUND, *(b.name for b in m.bodies)]), ("joint", [j.name for j in m.joints])):
        twice = [n for n in names if names.count(n) > 1]
        if twice:
            raise ValueError(f"{kind} {twice[0]!r} is defined twice; give each {kind} its own name ('ground' is taken)")


def _check_joint(m: Mechanism, j: Joint) -> None:
    where = f"joint {j.name!r}: "
    for name in j.bodies:
        if name not in m._by_name:
            raise ValueError(f"{where}bodies names {name!r}; the bodies are {_list(m._by_name)}")
        if j.name not in m.body(name).points:
            raise ValueError(f"{where}body {name!r} has no point {j.name!r}; its points are {_list(m.body(name).points)}")
    if j.bodies[0] == j.bodies[1]:
        raise ValueError(f"{where}bodies are both {j.bodies[0]!r}; a joint connects two bodies")
    if j.prismatic:
        if j.axis is None or abs(complex(*j.axis)) == 0:
            raise ValueError(f"{where}axis is {j.axis}; a prismatic joint needs a direction [x, y] that is not zero")
        if j.clearance:
            raise ValueError(f"{where}clearance is {j.clearance}; only a revolute joint has one, leave it out")
        if j.friction and j.friction_torque:
            raise ValueError(f"{where}friction and friction_torque are both given; for a prismatic joint both mean N, keep one")
    elif j.axis is not None or j.angle:
        raise ValueError(f"{where}axis and angle belong to a prismatic joint; leave them out of a revolute one")
    for name in j.bodies:
        body = m.body(name)
        if isinstance(body, Body) and len(body.points) > 1 and 0 < body.length <= j.clearance:
            raise ValueError(
                f"{where}clearance = {j.clearance} m is not smaller than body {name!r} ({body.length:g} m); give the radial clearance in m"
            )


def _check_drive(m: Mechanism) -> None:
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


def _check_places(m: Mechanism) -> None:
    for load in m.loads:
        body = m._by_name.get(load.body)
        if not isinstance(body, Body):
            raise ValueError(f"load.body = {load.body!r} is not a moving body; the bodies are {_list(b.name for b in m.bodies)}")
        if load.point != "com" and load.point not in body.points:
            raise ValueError(f"load.point = {load.point!r} is not a point of {load.body!r}; use com, {_list(body.points)}")
    for name in m.assembly:
        if name not in m._by_name or name == GROUND:
            raise ValueError(f"assembly.{name} is not a moving body; the bodies are {_list(b.name for b in m.bodies)}")
    if m.driven not in m.assembly:
        raise ValueError(f"assembly.{m.driven} is missing; give the driven body's angle (rad) at which the linkage is assembled")


def _check_body(m: Mechanism, b: Body) -> None:
    if not b.points:
        raise ValueError(f"body {b.name!r} has no points; name one after each joint that it sits in")
    joints = [j for j in m.joints if b.name in j.bodies]
    if not joints:
        raise ValueError(f"body {b.name!r} sits in no joint; add one or leave the body out")
    pins = [b.point(j.name) for j in joints if not j.prismatic]
    if len(pins) > 1 and all(abs(p - pins[0]) == 0 for p in pins):
        raise ValueError(f"body {b.name!r} has no length: all of its revolute joints sit at {pins[0].real, pins[0].imag}; move one")


def _warn_of_millimetres(m: Mechanism) -> None:
    lengths = [(f"{b.name}.points.{n}", abs(complex(*p))) for b in m._by_name.values() for n, p in b.points.items()]
    lengths += [(f"{b.name}.section", max(b.section)) for b in m.bodies]
    name, largest = max(lengths, key=lambda item: item[1])
    if largest > LARGEST_PLAUSIBLE_LENGTH:
        warnings.warn(f"{m.name}: {name} is {largest:g} m; lengths are in metres, was it meant in millimetres?", MechanismWarning, stacklevel=2)
    turns = {b: a for b, a in m.assembly.items() if abs(a) > 4 * math.pi}
    if turns:
        body, angle = next(iter(turns.items()))
        warnings.warn(f"{m.name}: assembly.{body} is {angle:g} rad; angles are in radians, was it meant in degrees?", MechanismWarning, stacklevel=2)
