"""The one description of a planar linkage: bodies, joints, drive, loads and assembly mode.

SI units and radians throughout.  Every object is frozen and checked when it is made; change one with
:meth:`Mechanism.replace`, which checks again.  Files are read and written in :mod:`analytic.mechanism.file`.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from numbers import Real
from typing import Annotated, TypeVar

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from analytic.mechanism.checks import (
    check_assembly,
    check_body,
    check_drive,
    check_joint,
    check_loads,
    check_names,
    warn_of_degrees,
    warn_of_millimetres,
)
from analytic.mechanism.errors import MechanismError, brief, describe, quoted
from analytic.mechanism.one_line import clearances, count, one_line
from analytic.mechanism.parts import (
    FARTHEST,
    GROUND,
    Body,
    Drive,
    Ground,
    Joint,
    Load,
    Name,
    Part,
    PeriodicTorque,
    Vector,
    as_tuple,
    titled,
)

P = TypeVar("P", Body, Joint)


class Mechanism(Part):
    """A planar linkage.  Raises MechanismError where it contradicts itself."""

    name: Annotated[str, BeforeValidator(titled)]
    gravity: Vector = (0.0, 0.0)  # m/s^2
    ground: Ground
    bodies: Annotated[tuple[Body, ...], BeforeValidator(as_tuple), Field(alias="body", min_length=1)]
    joints: Annotated[tuple[Joint, ...], BeforeValidator(as_tuple), Field(alias="joint", min_length=1)]
    drive: Drive | None = None
    loads: Annotated[tuple[Load, ...], BeforeValidator(as_tuple), Field(alias="load")] = ()
    assembly: Mapping[Name, Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]] = Field(default_factory=dict)  # rad

    def body(self, name: str) -> Body | Ground:
        """The body, or the ground, of that name (KeyError if there is none)."""
        return self.parts[name]

    def joint(self, name: str) -> Joint:
        """The joint of that name (KeyError if there is none)."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise KeyError(name)

    @property
    def moving(self) -> dict[str, Body]:
        """The moving bodies by name."""
        return {b.name: b for b in self.bodies}

    @property
    def parts(self) -> dict[str, Body | Ground]:
        """The ground and the moving bodies by name."""
        return {GROUND: self.ground, **self.moving}

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

    def angle_point(self, body: str) -> str:
        """Point at which the angle of a moving body is read, where it bends: its joint on the ground, else its com."""
        return next((j.name for j in self.joints if body in j.bodies and GROUND in j.bodies), "com")

    @property
    def periodic_torque(self) -> PeriodicTorque | None:
        """What turns the driven body over its angle beside the motor; None where nothing does."""
        return None if self.drive is None else self.drive.periodic_torque

    @property
    def drive_stiffness(self) -> float | None:
        """Stiffness (N.m/rad) between motor and crank; None where the crank is rigidly on its motor, or has none."""
        return None if self.drive is None or self.drive.speed == "free" else self.drive.stiffness

    @property
    def half_gap(self) -> float:
        """Half the backlash (rad) between motor and crank; none without a motor."""
        return 0.0 if self.drive is None or self.drive.speed == "free" else self.drive.half_gap

    @property
    def speed(self) -> float | None:
        """The drive's constant speed (rad/s), or None if it has none."""
        return self.drive.speed if self.drive is not None and isinstance(self.drive.speed, float) else None

    @property
    def clearances(self) -> dict[str, float]:
        """Radial clearance (m) of each joint that has one."""
        return {j.name: j.clearance for j in self.joints if j.clearance > 0}

    @property
    def soft_bearings(self) -> dict[str, float]:
        """Radial stiffness (N/m) of each joint whose bearing is soft."""
        return {j.name: j.radial_stiffness for j in self.joints if j.radial_stiffness is not None}

    @property
    def displaced(self) -> bool:
        """Whether any pin leaves the centre of its bearing."""
        return any(j.displaced for j in self.joints)

    @property
    def load_rubbed(self) -> list[Joint]:
        """The joints whose friction grows with their reaction."""
        return [j for j in self.joints if j.friction_radius]

    @property
    def bends(self) -> bool:
        """Whether any link has a modulus of elasticity."""
        return any(b.youngs_modulus is not None for b in self.bodies)

    def rigid(self) -> Mechanism:
        """A checked copy with the moduli of its links left out."""
        return self.replace(bodies=tuple(_rigid(b) for b in self.bodies))

    def ideal(self) -> Mechanism:
        """A checked copy whose joints have neither clearance nor soft bearings."""
        tight = {"clearance": 0.0, "radial_stiffness": None}
        return self.replace(joints=tuple(j.model_copy(update=tight) if j.displaced else j for j in self.joints))

    def replace(self, **fields: object) -> Mechanism:
        """A checked copy with top-level fields replaced.  Raises MechanismError."""
        known = type(self).model_fields
        for name in fields:
            if name not in known:
                meant = next((own for own, field in known.items() if field.alias == name), None)
                remedy = f"{name!r} is a file's word for {meant}" if meant else f"its fields are {', '.join(known)}"
                raise MechanismError(f"{self.name}: a mechanism has no field {brief(name)!r} to replace; {remedy}")
        asked = {name: fields.get(name, getattr(self, name)) for name in known}
        try:
            return Mechanism.model_validate(asked)
        except ValidationError as error:
            raise MechanismError(f"{self.name}: {'; '.join(describe(error, asked, Mechanism))}") from None

    def with_joint(self, name: str, **fields: object) -> Mechanism:
        """A checked copy with fields of one joint replaced.  Raises MechanismError."""
        return self.replace(joints=self._edited("joint", self.joints, name, fields))

    def with_body(self, name: str, **fields: object) -> Mechanism:
        """A checked copy with fields of one body replaced.  Raises MechanismError."""
        return self.replace(bodies=self._edited("body", self.bodies, name, fields))

    def with_clearances(self, clearances: Mapping[str, float]) -> Mechanism:
        """A checked copy with exactly these radial clearances (m); every other joint is ideal.  Raises
        MechanismError.
        """
        if not isinstance(clearances, Mapping):
            raise MechanismError(
                f"{self.name}: clearances = {quoted(clearances)}; give metres by joint, as {{'B': 1e-4}}"
            )
        _known(self, "joint", self.joints, clearances)
        return self.replace(
            joints=tuple(
                self._with_fields("joint", j, {"clearance": _as_float(clearances.get(j.name, 0.0))})
                for j in self.joints
            )
        )

    def _edited(self, kind: str, parts: tuple[P, ...], name: str, fields: Mapping[str, object]) -> tuple[P, ...]:
        _known(self, kind, parts, [name])
        return tuple(self._with_fields(kind, p, fields) if p.name == name else p for p in parts)

    def _with_fields(self, kind: str, part: P, fields: Mapping[str, object]) -> P:
        asked = {**part.model_dump(exclude_unset=True), **fields}
        try:
            return type(part).model_validate(asked)
        except ValidationError as error:
            told = "; ".join(f"{kind}[{part.name}].{fault}" for fault in describe(error, asked, type(part)))
            raise MechanismError(f"{self.name}: {told}") from None

    def __repr__(self) -> str:
        links, joints = count(len(self.bodies), "moving link"), count(len(self.joints), "joint")
        speed = f"at {self.speed:.4g} rad/s" if self.speed is not None else self.drive.speed if self.drive else ""
        drive = f"drive {self.drive.joint} {speed}" if self.drive is not None else "no drive"
        return one_line(self, self.name, links, joints, drive, clearances(self.clearances))

    def __str__(self) -> str:
        return repr(self)

    @model_validator(mode="after")
    def _check(self) -> Mechanism:
        """Each check relies on the ones before it."""
        check_names(self.bodies, self.joints)
        for joint in self.joints:
            check_joint(joint, self.parts)
        check_drive(self.drive, self.joints)
        check_loads(self.loads, self.moving)
        check_assembly(self.assembly, self.moving, self.driven)
        for body in self.bodies:
            check_body(body, self.joints)
        warn_of_millimetres(self.name, self.parts)
        warn_of_degrees(self.name, self.assembly)
        return self


def _known(mechanism: Mechanism, kind: str, parts: Sequence[Body | Joint], names: Iterable[str]) -> None:
    """Raises MechanismError for a name that no part has."""
    there = [part.name for part in parts]
    for name in names:
        if name not in there:
            close = difflib.get_close_matches(str(name), there, n=1)
            hint = f"did you mean {close[0]!r}? They" if close else "they"
            raise MechanismError(f"{mechanism.name}: no {kind} {quoted(name)}; {hint} are {', '.join(there)}")


def _as_float(value: object) -> object:
    """A number of any kind, numpy's too, as a float; what is none as it is, for the field's own check."""
    return float(value) if isinstance(value, Real) and not isinstance(value, bool) else value


def _rigid(body: Body) -> Body:
    return Body.model_validate(body.model_dump(exclude_unset=True, exclude={"youngs_modulus", "shear_modulus"}))
