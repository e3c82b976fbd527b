"""The one description of a planar linkage: bodies, joints, drives, springs, loads and assembly mode.

SI units and radians throughout.  Every object is frozen and checked when it is made; change one with
:meth:`Mechanism.replace`, which checks again.  Files are read and written in :mod:`analytic.mechanism.file`.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, partial
from numbers import Real
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, field_serializer, model_validator

from analytic.errors import warn
from analytic.mechanism.checks import (
    MechanismWarning,
    check_assembly,
    check_body,
    check_drives,
    check_initial,
    check_joint,
    check_loads,
    check_names,
    check_sensors,
    check_springs,
    check_stops,
    doubts,
)
from analytic.mechanism.errors import MechanismError, brief, describe, quoted, together
from analytic.mechanism.one_line import clearances, count, one_line
from analytic.mechanism.parts import (
    FARTHEST_ANGLE,
    GROUND,
    Amount,
    Body,
    Drive,
    Ground,
    Joint,
    Load,
    MechanismPart,
    PartName,
    PeriodicTorque,
    Sensor,
    SiNumber,
    Spring,
    Stop,
    Tolerance,
    Vector,
    as_tuple,
    one_or_many,
    titled,
)
from analytic.mechanism.signals import Signal, driving, position
from analytic.mechanism.varying import NEVER, Fading, Quantity, Seen, Vectors, acting, quantities
from analytic.mechanism.written import INITIAL, in_si
from analytic.writing import write_atomically

P = TypeVar("P", Body, Joint)
ONE_CRANK = "what is asked for is of linkages with one drive, which turns a crank on the ground"
ONE_INPUT = "what is asked for is of linkages with one drive, which turns a crank or moves a slide on the ground"


def _in_quotes(given: object) -> object:
    """Tolerances by field, if each is written in quotes: else TOML takes it for tables.  Raises ValueError."""
    for name, value in given.items() if isinstance(given, Mapping) else ():
        if isinstance(value, Mapping) and value and "." not in name:
            raise ValueError(
                f"{brief(f'{name}.{next(iter(value))}')} is no field by itself; write each field whole and in quotes,"
                ' such as "body.crank.mass" = { sd = 0.01 }'
            )
    return given


class Mechanism(MechanismPart):
    """A planar linkage: ``ground``, each ``body`` and ``joint``, its ``drive`` and so on, as in a mechanism file.

    Numbers are SI, texts have their unit.  ``lc.fields()`` has the meaning, the unit and the default of each field.
    Raises MechanismError where it contradicts itself.
    """

    name: Annotated[str, BeforeValidator(titled)]
    gravity: Vector = (0.0, 0.0)  # m/s^2
    ground: Ground
    bodies: Annotated[tuple[Body, ...], BeforeValidator(as_tuple), Field(alias="body", min_length=1)]
    joints: Annotated[tuple[Joint, ...], BeforeValidator(as_tuple), Field(alias="joint", min_length=1)]
    # a file's [drive], or its [[drive]] one after the other
    drives: Annotated[tuple[Drive, ...], BeforeValidator(one_or_many), Field(alias="drive")] = ()
    springs: Annotated[tuple[Spring, ...], BeforeValidator(as_tuple), Field(alias="spring")] = ()
    stops: Annotated[tuple[Stop, ...], BeforeValidator(as_tuple), Field(alias="stop")] = ()
    loads: Annotated[tuple[Load, ...], BeforeValidator(as_tuple), Field(alias="load")] = ()
    sensors: Annotated[tuple[Sensor, ...], BeforeValidator(as_tuple), Field(alias="sensor")] = ()
    assembly: Mapping[PartName, Annotated[float, Field(ge=-FARTHEST_ANGLE, le=FARTHEST_ANGLE)]] = Field(
        default_factory=dict
    )  # rad
    # by the field that varies, such as "body.crank.mass"
    tolerances: Annotated[Mapping[str, Tolerance], BeforeValidator(_in_quotes)] = Field(default_factory=dict)
    initial: Mapping[str, SiNumber] = Field(default_factory=dict)  # velocity_<joint>: rad/s, m/s of one that runs free

    @model_validator(mode="before")
    @classmethod
    def _in_si(cls, given: object) -> object:
        """Fields that are written with their unit as numbers in SI.  Raises UnitError, ReadingError."""
        if not isinstance(given, Mapping):
            return given
        as_filed = {n: f.alias for n, f in cls.model_fields.items() if f.alias and f.alias not in given}
        return in_si({as_filed.get(str(name)) or str(name): value for name, value in given.items()})

    def body(self, name: str) -> Body | Ground:
        """The body, or the ground, of that name (KeyError if there is none)."""
        if name not in self.parts:
            raise KeyError(f"{name}: no such body; they are {', '.join(self.parts)}")
        return self.parts[name]

    def joint(self, name: str) -> Joint:
        """The joint of that name (KeyError if there is none)."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise KeyError(f"{name}: no such joint; they are {', '.join(joint.name for joint in self.joints)}")

    @property
    def moving(self) -> dict[str, Body]:
        """The moving bodies by name."""
        return {b.name: b for b in self.bodies}

    @property
    def parts(self) -> dict[str, Body | Ground]:
        """The ground and the moving bodies by name."""
        return {GROUND: self.ground, **self.moving}

    @property
    def drive(self) -> Drive | None:
        """The only drive; None without one.  Raises MechanismError where there are several."""
        if len(self.drives) > 1:
            driven = ", ".join(drive.joint for drive in self.drives)
            raise MechanismError(f"{self.name}: drive is given {len(self.drives)} times ({driven}); {ONE_CRANK}")
        return self.drives[0] if self.drives else None

    @property
    def motors(self) -> list[Joint]:
        """The joints that a motor moves, in the order of the drives."""
        return [self.joint(drive.joint) for drive in self.drives if drive.speed != "free"]

    @property
    def cranked(self) -> bool:
        """Whether it moves by a crank: a body that turns on the ground, by its only drive or without any."""
        if not self.drives:
            return any(not j.prismatic and GROUND in j.bodies for j in self.joints)
        joint = self.joint(self.drives[0].joint)
        return len(self.drives) == 1 and not joint.prismatic and GROUND in joint.bodies

    @property
    def crank_sign(self) -> float:
        """Sign of the crank's angle in its joint's position, and of the torque on the crank in that on the joint's
        second body: -1 where the crank is the joint's first body, else 1, also where there is no crank.
        """
        return -1.0 if self.cranked and self.drive_joint.bodies[1] == GROUND else 1.0

    @property
    def sliding(self) -> bool:
        """Whether it moves by a slide: its only drive moves a body along the ground, as a ball screw does."""
        if len(self.drives) != 1:
            return False
        joint = self.joint(self.drives[0].joint)
        return joint.prismatic and GROUND in joint.bodies

    @property
    def several(self) -> bool:
        """Whether it moves by neither crank nor slide: by several drives, or one between moving bodies."""
        return not (self.cranked or self.sliding)

    @property
    def input_joint(self) -> Joint:
        """The joint that moves all else: the crank's, or the slide's.  Raises MechanismError where there is neither."""
        if self.sliding:
            return self.joint(self.drives[0].joint)
        if self.drives and not self.cranked:
            driven = ", ".join(drive.joint for drive in self.drives)
            raise MechanismError(f"{self.name}: is driven in {driven}; {ONE_INPUT}")
        return self.drive_joint

    @property
    def encoder(self) -> Signal:
        """Where the motor of its only drive is: the crank's angle (rad), or the slide's travel (m).  Raises
        MechanismError where there is neither.
        """
        joint = self.input_joint
        return position(joint) if self.sliding else Signal.of("pose", self.driven, "angle")

    @property
    def encoders(self) -> tuple[Signal, ...]:
        """Where its motors are: :attr:`encoder` of a crank or a slide, else the position of each joint that has one."""
        return tuple(position(joint) for joint in self.motors) if self.several else (self.encoder,)

    @property
    def efforts(self) -> tuple[Signal, ...]:
        """What the motors give: the crank's torque (N.m), the slide's force (N), or each joint's."""
        return tuple(driving(self.motors if self.several else [self.input_joint]))

    @property
    def drive_joint(self) -> Joint:
        """The joint that turns the crank; without a drive, the first revolute joint on the ground.  Raises
        MechanismError where there is no crank.
        """
        if self.drive is not None:
            joint = self.joint(self.drive.joint)
            if self.cranked:
                return joint
            raise MechanismError(f"{self.name}: drive.joint = {joint.name!r} turns no body on the ground; {ONE_CRANK}")
        for joint in self.joints:
            if not joint.prismatic and GROUND in joint.bodies:
                return joint
        raise MechanismError(f"{self.name}: no revolute joint connects a body to the ground; {ONE_CRANK}")

    @property
    def driven(self) -> str:
        """Name of the driven body: the crank.  Raises MechanismError where there is none."""
        first, second = self.drive_joint.bodies
        return second if first == GROUND else first

    def angle_point(self, body: str) -> str:
        """Point at which the angle of a moving body is read, where it bends: its joint on the ground, else its com."""
        return next((j.name for j in self.joints if body in j.bodies and GROUND in j.bodies), "com")

    @property
    def periodic_torque(self) -> PeriodicTorque | None:
        """What turns the crank over its angle beside the motor; None where nothing does."""
        return self.drives[0].periodic_torque if self.drives else None  # several have none

    @property
    def drive_stiffness(self) -> float | None:
        """Stiffness (N.m/rad) between motor and crank; None where the crank is rigidly on its motor, or has none."""
        return None if not self.drives or self.drives[0].speed == "free" else self.drives[0].stiffness

    @property
    def varying_load(self) -> Load | None:
        """The first load that is not the same throughout the motion; None where every load is constant."""
        return next((load for load in self.loads if load.varies), None)

    @cached_property
    def load_quantities(self) -> Mapping[str, Quantity]:
        """What a load may vary with, by name."""
        return dict(quantities(self.driven if self.cranked else "", self.bodies, self.joints))

    @property
    def timed_load(self) -> Load | None:
        """The first load that varies over time; None where none does."""
        return next((load for load in self.loads if load.over == "time"), None)

    @property
    def shortest_stretch(self) -> float:
        """The shortest time (s) in which a load that varies over time does what it does; endless without one."""
        return min((load.shortest_stretch for load in self.loads if load.over == "time"), default=math.inf)

    def acting(self, load: Load, seen: Seen[Amount], fading: Fading = NEVER) -> tuple[Vectors, Amount | float]:
        """Force (N, x + iy) and torque (N.m) of a load, one or (N,), where the linkage is seen; below the velocities of
        its ``fading`` one that opposes the motion is less.
        """
        return acting(load, self.load_quantities[load.over] if load.over else None, seen, fading)

    def load_values(
        self, load: Load, signals: Mapping[str, np.ndarray], time: np.ndarray | None = None
    ) -> np.ndarray | None:
        """What a load varies over, (N,) rad, m or s, of these signals at times (N,) s; None where they have it not."""
        if load.over == "time":
            return time
        return signals.get(f"{self.driven}_angle" if load.over == "crank_angle" else load.over)

    @property
    def half_gap(self) -> float:
        """Half the backlash (rad) between motor and crank; none without a motor."""
        return 0.0 if not self.drives or self.drives[0].speed == "free" else self.drives[0].half_gap

    @property
    def speed(self) -> float | None:
        """The crank's constant speed (rad/s), or None if it has none."""
        return (
            self.drives[0].speed if self.cranked and self.drives and isinstance(self.drives[0].speed, float) else None
        )

    @property
    def initial_velocities(self) -> dict[str, float]:
        """The velocities (rad/s, m/s) of ``initial`` by joint, second body relative to first."""
        return {name.removeprefix(INITIAL): value for name, value in self.initial.items()}

    @property
    def drive_speeds(self) -> dict[str, float]:
        """The speeds (rad/s, m/s) of the drives that have one, by joint, as rates of its position."""
        sign = self.crank_sign
        return {drive.joint: sign * drive.speed for drive in self.drives if not isinstance(drive.speed, str)}

    @property
    def clearances(self) -> dict[str, float]:
        """Clearance (m) of each joint that has one: radial, or half the play of a block in its guide."""
        return {j.name: j.clearance for j in self.joints if j.clearance > 0}

    @property
    def may_be_loose(self) -> list[str]:
        """The joints that may have clearance: those that turn, and blocks whose size is known in their guides."""
        return [j.name for j in self.joints if not j.prismatic or j.guide is not None]

    def without_contact_friction(self) -> Mechanism:
        """A copy whose joints with clearance have no friction but their own laws'."""
        off = {"friction": 0.0}
        return self.replace(joints=tuple(j.model_copy(update=off) if j.rough else j for j in self.joints))

    @property
    def loose_guides(self) -> dict[str, float]:
        """Half the play (m) of each block that has some in its guide."""
        return {j.name: j.clearance for j in self.joints if j.clearance > 0 and j.prismatic}

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
        """The joints whose friction grows with their reaction, but for that in the contact of those with clearance."""
        return [j for j in self.joints if j.load_coefficient]

    @property
    def bends(self) -> bool:
        """Whether any link has a modulus of elasticity."""
        return any(b.youngs_modulus is not None for b in self.bodies)

    def rigid(self) -> Mechanism:
        """A checked copy with the moduli of its links left out; strain gauges keep those of theirs."""
        gauges = {s.name: s.modulus(self.moving[s.body]) for s in self.sensors if s.kind == "strain"}
        sensors = [
            s.model_copy(update={"youngs_modulus": gauges[s.name]}) if s.name in gauges else s for s in self.sensors
        ]
        return self.replace(bodies=tuple(_rigid(b) for b in self.bodies), sensors=sensors)

    def ideal(self) -> Mechanism:
        """A checked copy whose joints have neither clearance (see :meth:`tight`) nor soft bearings."""
        stiff = {"radial_stiffness": None}
        joints = self.tight().joints
        return self.replace(joints=tuple(j.model_copy(update=stiff) if j.displaced else j for j in joints))

    def tight(self) -> Mechanism:
        """A checked copy whose joints have no clearance, and so no contact, nor its friction: the ideal linkage of
        these joints, which :meth:`with_clearances` does not give, as pins and blocks rub without clearance too.
        """
        return self.without_contact_friction().with_clearances({})

    def replace(self, **fields: object) -> Mechanism:
        """A checked copy with top-level fields replaced, by their names here or in a file.  Raises MechanismError."""
        names = {name: field.alias or name for name, field in type(self).model_fields.items()}
        asked = {alias: getattr(self, name) for name, alias in names.items()}  # as a file says it, and so a message
        for name, value in fields.items():
            if names.get(name, name) not in asked:
                remedy = changed_by(name) or f"its fields are {', '.join(names)}"
                raise MechanismError(f"{self.name}: a mechanism has no field {brief(name)!r} to replace; {remedy}")
            asked[names.get(name, name)] = value
        try:
            return Mechanism.model_validate(asked, context=self.doubts)
        except ValidationError as error:
            raise MechanismError(f"{self.name}: {'; '.join(describe(error, asked, Mechanism))}") from None

    def with_joint(self, name: str, **fields: object) -> Mechanism:
        """A checked copy with fields of one joint replaced.  Raises MechanismError."""
        return self.replace(joints=self._edited("joint", self.joints, name, fields))

    def with_drive(self, **fields: object) -> Mechanism:
        """A checked copy with fields of its only drive replaced, such as ``speed="60 rpm"``; one that has none is given
        one that follows data.  Raises MechanismError.
        """
        drive = self.drive or Drive(joint=self.input_joint.name, speed="measured")
        return self.replace(drive=drive.model_dump(exclude_unset=True) | fields)

    def with_friction_circle(self, name: str, radius: float) -> Mechanism:
        """A checked copy with a pin's friction circle of this radius (m), in place of one by a coefficient.  Raises
        MechanismError.
        """
        smooth = {} if self.joint(name).rough else {"friction": 0.0}
        return self.with_joint(name, friction_radius=radius, **smooth)

    def with_body(self, name: str, **fields: object) -> Mechanism:
        """A checked copy with fields of one body replaced.  Raises MechanismError."""
        return self.replace(bodies=self._edited("body", self.bodies, name, fields))

    def with_clearances(self, clearances: Mapping[str, float]) -> Mechanism:
        """A checked copy with exactly these clearances (m); every other joint is ideal.  Raises
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
        if isinstance(part, Joint) and part.fitted_anew(fields):
            del asked["clearance"]
        try:
            return type(part).model_validate(asked)
        except ValidationError as error:
            faults = "; ".join(f"{kind}[{part.name}].{fault}" for fault in describe(error, asked, type(part)))
            raise MechanismError(f"{self.name}: {faults}") from None

    def to_toml(self) -> str:
        """The text of a mechanism file that ``lc.load`` turns into an equal mechanism; what was left out stays out."""
        import tomli_w

        return tomli_w.dumps({name: value for name, value in as_written(self).items() if value not in (None, [], {})})

    def write(self, path: str | Path) -> Path:
        """Write the mechanism as a TOML file, in place of one that is there; its path.  Raises OutputError."""
        return write_atomically(Path(path), self.to_toml())

    @field_serializer("drives")
    def _as_in_a_file(self, drives: tuple[Drive, ...]) -> Drive | tuple[Drive, ...] | None:
        """One drive as itself, none as None: what a mechanism was before it could have several."""
        return drives if len(drives) > 1 else drives[0] if drives else None

    def __repr__(self) -> str:
        links, joints = count(len(self.bodies), "moving link"), count(len(self.joints), "joint")
        drives = [f"drive {drive.joint} {self._pace(drive)}" for drive in self.drives] or ["no drive"]
        return one_line(self, self.name, links, joints, *drives, clearances(self.clearances))

    def _pace(self, drive: Drive) -> str:
        if isinstance(drive.speed, str):
            return drive.speed
        return f"at {drive.speed:.4g} {'m/s' if self.joint(drive.joint).prismatic else 'rad/s'}"

    def __str__(self) -> str:
        return repr(self)

    @cached_property
    def doubts(self) -> list[str]:
        """What to ask about numbers that look like millimetres or degrees."""
        return doubts(self.name, self.parts, self.joints, self.assembly, self.loads, self.load_quantities)

    @model_validator(mode="after")
    def _check(self, info: ValidationInfo) -> Mechanism:
        """Each check relies on the ones before it, but for those that are made together.  What was asked
        about the mechanism that this is a copy of, the context, is not asked again, nor where a result takes it.
        """
        check_names(self.bodies, self.joints, self.sensors)
        together(
            *(partial(check_joint, joint, self.parts) for joint in self.joints),
            lambda: check_drives(self.drives, self.joints),
        )
        together(
            lambda: check_initial(self.initial, self.joints, self.motors),
            lambda: check_loads(self.loads, self.moving, self.load_quantities),
            lambda: check_springs(self.springs, self.parts, self.joints),
            lambda: check_stops(self.stops, self.joints),
            lambda: check_sensors(self.sensors, self.parts, self.joints, self.drives),
            lambda: check_assembly(self.assembly, self.moving, self.driven if self.cranked else None),
            *(partial(check_body, body, self.joints) for body in self.bodies),
        )
        limited = [j.stopped(tuple(stop for stop in self.stops if stop.joint == j.name)) for j in self.joints]
        object.__setattr__(self, "joints", _in_their_turns(limited, self.assembly))
        for doubt in [] if "doubts" in vars(self) else self.doubts:
            if doubt not in (info.context or ()):
                warn(doubt, MechanismWarning)
        return self


def _in_their_turns(joints: Sequence[Joint], assembly: Mapping[str, float]) -> tuple[Joint, ...]:
    """The joints, slides' angles by as many whole turns larger as ``assembly`` (rad) has their bodies apart.

    A body that it does not name lies in the turn that its slide's own angle gives it.
    """
    about, turned = {GROUND: 0.0, **assembly}, {joint.name: joint for joint in joints}
    slides = [joint for joint in joints if joint.prismatic]
    while slide := next((joint for joint in slides if {*joint.bodies} & {*about}), None):
        slides.remove(slide)
        first, second = slide.bodies
        if first not in about:
            about[first] = about[second] - slide.angle
        turns = round((about.setdefault(second, about[first] + slide.angle) - about[first] - slide.angle) / math.tau)
        if turns:
            turned[slide.name] = slide.model_copy(update={"angle": slide.angle + turns * math.tau})
    return tuple(turned.values())


def _known(mechanism: Mechanism, kind: str, parts: Sequence[Body | Joint], names: Iterable[str]) -> None:
    """Raises MechanismError for a name that no part has."""
    there = [part.name for part in parts]
    for name in names:
        if name not in there:
            close = difflib.get_close_matches(str(name), there, n=1)
            hint = f"did you mean {close[0]!r}? They" if close else "they"
            raise MechanismError(f"{mechanism.name}: no {kind} {quoted(name)}; {hint} are {', '.join(there)}")


def changed_by(field: str) -> str:
    """How a field of a mechanism's part is changed, in words; empty of what is none."""
    parts: dict[str, type[MechanismPart]] = {"with_drive(": Drive, "with_joint(NAME, ": Joint, "with_body(NAME, ": Body}
    own = next((call for call, part in parts.items() if field in part.model_fields), None)
    return f"it is changed by {own}{field}=...)" if own else ""


def _as_float(value: object) -> object:
    """A number of any kind, numpy's too, as a float; what is none as it is, for the field's own check."""
    return float(value) if isinstance(value, Real) and not isinstance(value, bool) else value


def _rigid(body: Body) -> Body:
    return Body.model_validate(body.model_dump(exclude_unset=True, exclude={"youngs_modulus", "shear_modulus"}))


def as_written(mechanism: Mechanism) -> dict[str, object]:
    """A mechanism as its TOML file has it, plain data: what was left out stays out."""
    return mechanism.model_dump(by_alias=True, exclude_none=True, exclude_unset=True, mode="json")
