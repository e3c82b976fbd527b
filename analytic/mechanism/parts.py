"""What a planar linkage is described by: ground, bodies, joints, drives, springs and loads.

SI units and radians throughout.  Every object is frozen and checked when it is made; change one with
:meth:`Mechanism.replace`, which checks again.  Files are read and written in :mod:`analytic.mechanism.file`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Literal, Never, TypeVar, cast

import numpy as np
from pydantic import (
    AfterValidator,
    AliasChoices,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from analytic.mechanism.errors import MechanismError, describe
from analytic.mechanism.fits import play
from analytic.mechanism.one_line import own_names
from analytic.mechanism.written import by_itself_in_si

GROUND = "ground"
SMALLEST_NUMBER = 1e-100  # in any SI unit, of a divisor: the square of a quotient by a smaller one overflows
TINY = 1e-300  # what stands for 0 where it divides: a quotient by it is as good as endless
LONGEST_NAME = 100  # characters of a name: it is part of files' names, which may have 255 bytes


def as_tuple(value: object) -> object:
    """A list, or an array, as a tuple; anything else as it is."""
    value = value.tolist() if isinstance(value, np.ndarray) else value
    return tuple(value) if isinstance(value, list) else value


def one_or_many(value: object) -> object:
    """One thing, or several in a list, as a tuple; nothing as an empty one."""
    if value is None:
        return ()
    return as_tuple(value) if isinstance(value, list | tuple) else (value,)


def _named(value: object) -> object:
    if isinstance(value, str) and not (value.replace("-", "_").isidentifier() and len(value) <= LONGEST_NAME):
        raise ValueError(
            f"a name is made of letters, digits, '_' and '-', starts with a letter, and has at most {LONGEST_NAME}"
            " characters"
        )
    return value


def titled(value: object) -> object:
    """A mechanism's name, if it may be one.  Raises ValueError."""
    if isinstance(value, str) and not (value.strip() and value.isprintable() and len(value) <= LONGEST_NAME):
        raise ValueError(
            f"a mechanism's name is one line of text that can be printed, of at most {LONGEST_NAME} characters"
        )
    return value


def _directed(axis: tuple[float, float]) -> tuple[float, float]:
    if math.hypot(*axis) < SMALLEST_NUMBER:
        raise ValueError("an axis has a direction; give one such as [1.0, 0.0]")
    return axis


def _a_point(given: str) -> str:
    if given.count(".") != 1 or not all(given.split(".")):
        raise ValueError('a point of a body is written "<body>.<point>", such as "ground.O"')
    return given


def _divisible(value: float) -> float:
    if 0 < value < SMALLEST_NUMBER:
        raise ValueError(
            f"the number is too small to divide by; give at least {SMALLEST_NUMBER:g}, or 0 where that is accepted"
        )
    return value


def _heavy(value: object) -> object:
    """A mass, unless it is none.  Raises ValueError."""
    if isinstance(value, int | float) and value == 0 and not isinstance(value, bool):
        raise ValueError(
            "a moving body has mass; for one that counts as massless give little, such as"
            " 1e-6 kg (contact takes smaller steps the lighter it is)"
        )
    return value


FROM = Field(alias="from", validation_alias=AliasChoices("from", "from_"))  # which Python keeps for itself
ContactLaw = Literal["kelvin-voigt", "hunt-crossley", "lankarani-nikravesh", "flores", "gonthier"]
LARGEST_NUMBER = 1e40  # in any SI unit: beyond all linkages, and its powers that occur are still finite
FARTHEST_ANGLE = 1e4  # rad, of an assembly angle: 1600 turns
MASS_CENTRE = "centre of mass"  # name of that point of a body; "com" names its marker, which may lie elsewhere

Amount = TypeVar("Amount", float, np.ndarray)  # one, or many (N,)
Displacement = TypeVar("Displacement", complex, np.ndarray)  # one, or many (N,)
SiNumber = Annotated[float, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
Vector = Annotated[tuple[SiNumber, SiNumber], BeforeValidator(as_tuple)]
PartName = Annotated[str, BeforeValidator(_named)]
MOST_WAVES = 1000  # in a turn, of a motor's unevenness or of a torque
WIDEST_HALF_GAP = 0.5  # rad, half of a gap in a drive
SAME_POINT = 2.0**-30  # of a body's size: points that are nearer to each other are at one place
PIN_RADIUS = 0.01  # m, where the mechanism gives none; matters only with friction in contact
SiPositive = Annotated[float, Field(gt=0, le=LARGEST_NUMBER), AfterValidator(_divisible)]
Mass = Annotated[SiPositive, BeforeValidator(_heavy)]  # kg
SiNotNegative = Annotated[float, Field(ge=0, le=LARGEST_NUMBER)]


class MechanismPart(BaseModel):
    """Base of every part of a mechanism: frozen, strict, finite numbers only."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, populate_by_name=True)

    def __init__(self, *given: Never, **fields: object) -> None:
        """The part with these fields.  Raises MechanismError."""
        if given:
            name, first = type(self).__name__, next(iter(type(self).model_fields))
            how = f"write {name}({first}=...), or {name}(**fields) of a dict"
            raise MechanismError(f"{name}: fields are given by name; {how}")
        try:
            super().__init__(**fields)
        except ValidationError as error:
            raise MechanismError(f"{type(self).__name__}: {'; '.join(describe(error, fields, type(self)))}") from None

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]  # else it reads files too

    def __dir__(self) -> list[str]:
        return own_names(super().__dir__())

    @model_validator(mode="before")
    @classmethod
    def _in_si(cls, given: object) -> object:
        """Fields that are written with their unit as numbers in SI.  Raises UnitError."""
        return by_itself_in_si(cls.__name__.lower(), given) if isinstance(given, Mapping) else given


class Ground(MechanismPart):
    """The fixed link; ``points`` (m) are in the ground frame."""

    points: Mapping[PartName, Vector]

    name: Literal["ground"] = Field(default="ground", exclude=True)

    def point(self, name: str) -> complex:
        """A ground point as x + iy (m)."""
        return complex(*self.points[name])


class Body(MechanismPart):
    """A moving link.  ``points`` and ``com`` (m) are in the body's frame; a point is named after its joint.
    ``lc.fields("body")`` has the meaning, the unit and the default of each field.
    """

    name: PartName
    points: Mapping[PartName, Vector]
    mass: Mass  # kg, above 0
    com: Vector | None = None  # left out: the middle of the points
    marker: Vector | None = None  # where <body>_x, <body>_y and loads at "com" are taken; left out: the com
    section: Annotated[tuple[SiNotNegative, SiNotNegative], BeforeValidator(as_tuple)] = (
        0.0,
        0.0,
    )  # m, in-plane height, depth
    inertia: SiNotNegative | None = None  # kg.m^2 about the com; left out: a uniform bar
    youngs_modulus: SiPositive | None = None  # Pa; left out: rigid
    shear_modulus: SiPositive | None = None  # Pa

    @field_validator("marker", mode="before")
    @classmethod
    def _placed(cls, given: object, info: ValidationInfo) -> object:
        """Raises ValueError for the name of a point, as a marker would not move with that."""
        place = info.data.get("points", {}).get(given) if isinstance(given, str) else None
        if place is not None:
            raise ValueError(f"that is the name of a point; write where it is, marker = {list(place)}")
        return given

    def point(self, name: str) -> complex:
        """A body point as x + iy (m, body frame); ``"com"`` is the marker, MASS_CENTRE the centre of mass itself."""
        if name == MASS_CENTRE:
            return self.centre
        if name == "com":
            return self.centre if self.marker is None else complex(*self.marker)
        return complex(*self.points[name])

    @property
    def centre(self) -> complex:
        """The centre of mass (m, body frame): ``com``, or the middle of the points."""
        return self.middle if self.com is None else complex(*self.com)

    @property
    def middle(self) -> complex:
        """The middle of the points (m, body frame), of which those at one place count once."""
        xs, ys = zip(*self.points.values(), strict=True)
        near = SAME_POINT * max(max(xs) - min(xs), max(ys) - min(ys)) or 1.0
        places = {(round(x / near), round(y / near)): complex(x, y) for x, y in self.points.values()}
        return sum(places.values(), 0j) / len(places)

    @property
    def length(self) -> float:
        """The largest distance between two of the body's points (m)."""
        return _largest_distance([complex(*p) for p in self.points.values()])

    @property
    def moment_of_inertia(self) -> float:
        """Moment of inertia (kg.m^2) about the com: as given, or of a uniform bar, m (L^2 + h^2)/12 (Eq. 13,
        corrected).
        """
        if self.inertia is not None:
            return self.inertia
        return self.mass * (self.length**2 + self.section[0] ** 2) / 12


def _largest_distance(points: list[complex]) -> float:
    """The largest distance between two of the points (x + iy): rotating calipers, which turn once around their convex
    hull.
    """
    hull = _convex_hull(points)
    largest, far = 0.0, 1 % len(hull)
    for here, ahead in zip(hull, hull[1:] + hull[:1], strict=True):
        while _turn(ahead - here, hull[(far + 1) % len(hull)] - hull[far]) > 0:
            far = (far + 1) % len(hull)
        largest = max(largest, abs(here - hull[far]), abs(ahead - hull[far]))
    return largest


def _convex_hull(points: list[complex]) -> list[complex]:
    """Corners of the convex hull, anticlockwise (Andrew's monotone chain); of points on one line its two ends."""
    ordered = sorted(set(points), key=lambda p: (p.real, p.imag))
    if len(ordered) < 3:
        return ordered
    corners: list[complex] = []
    for way in (ordered, ordered[::-1]):
        chain: list[complex] = []
        for p in way:
            while len(chain) > 1 and _turn(chain[-1] - chain[-2], p - chain[-1]) <= 0:
                chain.pop()
            chain.append(p)
        corners += chain[:-1]
    return corners


def _turn(a: complex, b: complex) -> float:
    """Positive where ``b`` is turned anticlockwise from ``a`` (cross product)."""
    return a.real * b.imag - a.imag * b.real


class Elasticity(MechanismPart):
    """Stiffness of a joint as a six-dof spring (Eq. 4): N/m and N.m/rad; rotation about z stays free."""

    translation: SiPositive
    rotation: SiPositive


class Stop(MechanismPart):
    """A limit of a joint's travel ``from`` one position and ``to`` another, or one of these: a spring and damper that
    push the second body back where it is beyond, and never pull.
    """

    joint: PartName
    start: Annotated[SiNumber | None, FROM] = None  # rad (prismatic: m)
    end: Annotated[SiNumber | None, Field(alias="to")] = None
    stiffness: SiPositive  # N.m/rad (prismatic: N/m)
    damping: SiNotNegative = 0.0  # N.m.s/rad (prismatic: N.s/m)

    @model_validator(mode="after")
    def _check(self) -> Stop:
        if self.start is None and self.end is None:
            raise ValueError("a stop has from or to, or both")
        if self.start is not None and self.end is not None and self.start >= self.end:
            raise ValueError(f"from = {self.start:g} is not less than to = {self.end:g}; a joint moves between them")
        return self

    def depths(self, position: Amount) -> list[tuple[float, Amount]]:
        """How deep (rad; m) a position is in each of its ends, and the way in which that pushes the second body."""
        below = [] if self.start is None else [(1.0, self.start - position)]
        return below + ([] if self.end is None else [(-1.0, position - self.end)])

    def push(self, position: Amount, rate: Amount, over: float = 0.0) -> Amount:
        """Torque (N.m; prismatic: force, N) on the second body at a position (rad; m) and rate (rad/s; m/s).

        Its damper sets in at once, or ``over`` a time (s), half of it before: in steps as long, the impulse of a damper
        that sets in at once does not depend on where in a step it does.
        """
        total = 0.0 * position
        for way, depth in self.depths(position):
            share = np.clip(depth / np.maximum(over * abs(rate), TINY) + 0.5, 0.0, 1.0) if over else depth > 0
            spring = self.stiffness * np.maximum(depth, 0.0)
            total = total + way * np.maximum(spring - share * way * self.damping * rate, 0.0)
        return total

    def energy(self, position: Amount) -> Amount:
        """What its spring holds (J) at a position (rad; m)."""
        deep = [np.maximum(depth, 0.0) for _, depth in self.depths(position)]
        return self.stiffness / 2 * sum((each**2 for each in deep), 0.0 * position)


class Joint(MechanismPart):
    """A revolute or prismatic joint; its reaction is the force of the first body on the second.
    ``lc.fields("joint")`` has the meaning, the unit and the default of each field.
    """

    name: PartName
    type: Literal["revolute", "prismatic"]
    bodies: Annotated[tuple[PartName, PartName], BeforeValidator(as_tuple)]
    axis: Vector | None = None  # prismatic: direction of sliding in the first body's frame
    angle: SiNumber = 0.0  # rad, prismatic: the second body's angle minus the first's, in any turn
    clearance: Annotated[SiNotNegative, AfterValidator(_divisible)] = 0.0  # m, radial; prismatic: half the block's play
    guide: Annotated[tuple[SiPositive, SiPositive], BeforeValidator(as_tuple)] | None = (
        None  # m, prismatic: length, height
    )
    pin_radius: SiPositive | None = None  # m
    fit: str | None = (
        None  # ISO 286, of a pin of 2 pin_radius: "H7/g6"; its middle stands for a clearance that is left out
    )
    friction: SiNotNegative = 0.0  # Coulomb coefficient of pin or block; prismatic without guide: N, as friction_torque
    contact_stiffness: SiPositive | None = None  # N/m
    contact_damping: SiNotNegative | None = None  # N.s/m
    restitution: Annotated[float, Field(ge=0, le=1)] | None = None
    contact_law: ContactLaw | None = None  # how a pin in motion is pushed back; left out: each engine's own
    friction_torque: SiNotNegative = 0.0  # N.m (prismatic: N), constant Coulomb
    static_torque: SiNotNegative | None = None  # N.m (prismatic: N), dry friction of the slowest slip (Stribeck)
    stribeck_speed: SiPositive | None = None  # rad/s (prismatic: m/s), at which it has fallen most of the way
    friction_radius: SiNotNegative = 0.0  # m, of a revolute joint's friction circle: coefficient times pin radius
    damping: SiNotNegative = 0.0  # N.m.s/rad (prismatic: N.s/m)
    drag: SiNotNegative = 0.0  # N.m.s^2/rad^2 (prismatic: N.s^2/m^2)
    stiffness: SiNotNegative = 0.0  # N.m/rad (prismatic: N/m)
    cubic: SiNumber = 0.0  # N.m/rad^3 (prismatic: N/m^3), of a spring that is not linear
    rest_angle: SiNumber = 0.0  # rad (prismatic: m)
    elasticity: Elasticity | None = None
    radial_stiffness: SiPositive | None = None  # N/m, revolute: of a soft bearing; left out: rigid
    _stops: tuple[Stop, ...] = ()

    @property
    def stops(self) -> tuple[Stop, ...]:
        """The stops that its mechanism gives it."""
        private = self.__pydantic_private__ or {}  # at once: for a name, pydantic looks everywhere else first
        return cast("tuple[Stop, ...]", private["_stops"])

    def stopped(self, stops: tuple[Stop, ...]) -> Joint:
        """The joint with these stops in place of its own."""
        if stops == self._stops:
            return self
        joint = self.model_copy()
        joint._stops = stops
        return joint

    @field_validator("fit")
    @classmethod
    def _fits(cls, fit: str | None, given: ValidationInfo) -> str | None:
        if fit is not None and given.data.get("type") == "prismatic":
            raise ValueError("a fit is of a pin in its bore; give a prismatic joint its clearance (m, half the play)")
        if fit is not None and "pin_radius" in given.data:
            if given.data["pin_radius"] is None:
                raise ValueError("a fit is of a diameter; give the joint's pin_radius (m), too")
            play(fit, 2 * given.data["pin_radius"])
        return fit

    @model_validator(mode="after")
    def _in_the_middle_of_its_fit(self) -> Joint:
        limits = self.fitted
        if limits is not None and "clearance" not in self.model_fields_set:
            object.__setattr__(self, "clearance", sum(limits) / 2)
            self.model_fields_set.add("clearance")
        return self

    @property
    def fitted(self) -> tuple[float, float] | None:
        """The smallest and the largest radial clearance (m) of its ``fit``; None without one."""
        if self.fit is None or self.pin_radius is None:
            return None
        least, most = play(self.fit, 2 * self.pin_radius)
        return least / 2, most / 2

    @property
    def clearance_of_fit(self) -> bool:
        """Whether its clearance is the middle of its fit, which stands for one that is left out."""
        return self.fitted is not None and self.clearance == sum(self.fitted) / 2

    def fitted_anew(self, fields: Mapping[str, object]) -> bool:
        """Whether, with these fields, its clearance becomes the middle of another fit or of a fit of another pin."""
        refitted = bool({"fit", "pin_radius"} & {*fields}) and fields.get("fit", self.fit) is not None
        return refitted and self.clearance_of_fit and "clearance" not in fields

    @property
    def prismatic(self) -> bool:
        """Whether the joint slides."""
        return self.type == "prismatic"

    @property
    def inner(self) -> str:
        """The word for the joint's part that has the clearance."""
        return "block" if self.prismatic else "pin"

    @property
    def outer(self) -> str:
        """The word for what that part moves in."""
        return "guide" if self.prismatic else "bearing"

    @property
    def displaced(self) -> bool:
        """Whether its pin leaves the centre of its bearing: by clearance, or as the bearing is soft."""
        return self.clearance > 0 or self.radial_stiffness is not None

    @property
    def direction(self) -> complex:
        """Unit vector of sliding in the first body's frame, as x + iy."""
        axis = complex(*(self.axis or (1.0, 0.0)))
        return axis / abs(axis)

    @property
    def coulomb(self) -> float:
        """Dry friction of fast slip, all that there is without Stribeck's: N.m, or N for a prismatic joint."""
        return self.friction_torque or (self.friction if self.prismatic and self.guide is None else 0.0)

    @property
    def rough(self) -> bool:
        """Whether its contact has friction: of a pin with clearance in its bearing, or of a block's corners."""
        return self.friction > 0 and self.clearance > 0

    @property
    def rim(self) -> float:
        """Radius (m) at which the contact of a pin with clearance rubs it."""
        return self.pin_radius or PIN_RADIUS

    @property
    def jams_from(self) -> float:
        """Coefficient of friction at its block's corners, length over height, from which on a corner turns the block
        harder by its friction than its wall's push turns it back: the block cannot lie flat, tips, and may jam.
        """
        return math.inf if self.guide is None else self.guide[0] / self.guide[1]

    @property
    def stiction(self) -> float:
        """Dry friction at rest (N.m; prismatic: N): what holds the joint."""
        return self.coulomb if self.static_torque is None else self.static_torque

    @property
    def rubs(self) -> bool:
        """Whether there is dry friction."""
        return self.stiction > 0 or self.load_coefficient > 0

    @property
    def load_coefficient(self) -> float:
        """What dry friction (N.m; prismatic: N) grows with by N of what presses the joint: the radius (m) of a pin's
        friction circle, ``friction_radius`` or else ``friction`` times ``pin_radius``; of a block in its guide its
        coefficient.  With clearance the contact has its friction itself.
        """
        friction = 0.0 if self.clearance or (self.prismatic and self.guide is None) else self.friction
        return friction if self.prismatic else self.friction_radius or friction * (self.pin_radius or 0.0)

    @property
    def load_law(self) -> str:
        """The field that gives it that friction, in words."""
        return f"{'friction_radius' if self.friction_radius else 'friction'} of joint {self.name!r}"

    @property
    def damped(self) -> bool:
        """Whether something grows with the joint's speed."""
        return bool(self.damping or self.drag)

    @property
    def springy(self) -> bool:
        """Whether a spring acts."""
        return bool(self.stiffness or self.cubic)

    @property
    def has_law(self) -> bool:
        """Whether a torque (prismatic: a force) of the joint's own acts on its free motion."""
        return self.rubs or self.damped or self.springy or bool(self.stops)

    def dry(self, rate: Amount) -> Amount:
        """Size (N.m; prismatic: N) of dry friction at a rate (rad/s; m/s): Coulomb's, and above it what Stribeck's
        curve, exp(-(rate/stribeck_speed)^2), has left of static friction.
        """
        if self.stribeck_speed is None:
            return self.coulomb + 0 * rate
        return self.coulomb + (self.stiction - self.coulomb) * np.exp(-((rate / self.stribeck_speed) ** 2))

    def load_friction(self, load: Amount) -> Amount:
        """Size (N.m; prismatic: N) of the dry friction of a joint that is pressed so hard (N), see :meth:`pressed`."""
        return self.load_coefficient * load

    def pressed(
        self,
        force: complex | np.ndarray,
        moment: float | np.ndarray,
        angle: float | np.ndarray,
        slip: float | np.ndarray,
    ) -> np.ndarray:
        """How hard (N) a joint without clearance is pressed by its reaction, a force (N, x + iy) on its second body: a
        pin by all of it, a block by the sum of what walls push its corners, of the force N across and the ``moment`` M
        (N.m) about its point.

        ``angle`` (rad) is the first body's, ``slip`` the sign s of the sliding: friction acts at the corners too, and
        its moment is the walls' to bear, M + s mu (h/2) N.
        """
        if not self.prismatic or self.guide is None:
            return np.abs(force)
        length, height = self.guide
        across = (np.conj(1j * self.direction * np.exp(1j * angle)) * force).real
        turned = moment + slip * self.friction * height / 2 * across
        return np.maximum(np.abs(across), 2 / length * np.abs(turned))

    def damper(self, rate: Amount) -> Amount:
        """Torque (N.m; prismatic: force, N) of viscous friction and drag on the second body at a rate (rad/s; m/s)."""
        return -(self.damping + self.drag * abs(rate)) * rate

    def spring(self, position: Amount) -> Amount:
        """Torque (N.m; prismatic: force, N) of the spring on the second body at an angle (rad; travel, m)."""
        stretch = position - self.rest_angle
        return -(self.stiffness + self.cubic * stretch**2) * stretch

    def stop(self, position: Amount, rate: Amount, over: float = 0.0) -> Amount:
        """Torque (N.m; prismatic: force, N) of its stops on the second body at an angle (rad; travel, m) and rate;
        ``over`` as in :meth:`Stop.push`.
        """
        return sum((stop.push(position, rate, over) for stop in self.stops), 0.0 * position)

    def give(self, position: Amount, rate: Amount, over: float = 0.0) -> Amount:
        """The same of all that is no friction: spring, damper and stops."""
        pushed = self.stop(position, rate, over) if self.stops else 0.0
        return self.spring(position) + self.damper(rate) + pushed

    def stiffest(self, position: Amount | None = None) -> Amount | float:
        """Stiffness (N.m/rad; prismatic: N/m) of the stops that push at a position (rad; m), or of all of them."""
        if position is None:
            return sum((stop.stiffness for stop in self.stops), 0.0)
        return sum(
            (stop.stiffness * (depth > 0) for stop in self.stops for _, depth in stop.depths(position)), 0.0 * position
        )


class Ripple(MechanismPart):
    """Unevenness of a motor: its angle is the command plus amplitude (rad) times sin(harmonic * command + phase)."""

    amplitude: SiNumber
    harmonic: Annotated[int, Field(ge=1, le=MOST_WAVES)]
    phase: SiNumber = 0.0  # rad


class PeriodicTorque(MechanismPart):
    """A torque on the driven body over its angle, amplitude (N.m) times sin(harmonic * angle + phase): a motor's
    cogging, a tooth, a belt's joint.
    """

    amplitude: SiNumber
    harmonic: Annotated[int, Field(ge=1, le=MOST_WAVES)]
    phase: SiNumber = 0.0  # rad

    def at(self, angle: Amount) -> Amount:
        """The torque (N.m) at the driven body's angle (rad)."""
        return self.amplitude * np.sin(self.harmonic * angle + self.phase)


class Drive(MechanismPart):
    """A motor in a joint: a constant speed (rad/s; prismatic: m/s), ``"free"`` (released) or ``"measured"`` (follows
    data).
    """

    joint: PartName
    speed: SiNumber | Literal["free", "measured"]
    ripple: Ripple | None = None
    stiffness: SiPositive | None = None  # N.m/rad between motor and crank; left out: rigid
    # rad, backlash: the crank's play behind the motor, and as much ahead of it
    half_gap: Annotated[SiNotNegative, Field(le=WIDEST_HALF_GAP)] = 0.0
    periodic_torque: PeriodicTorque | None = None


ANGLE_DIGITS = 12  # after the point, of an angle (rad) within a turn at which a load begins or ends
PULSE = 0.01  # of the largest factor of a table: what comes and goes by less, an integrator may step over


class Table(tuple[Vector, ...]):
    """Pairs of value and factor; it keeps the arrays between which straight lines lie, as engines ask in every step."""

    def at(self, value: Amount, angular: bool) -> Amount:
        """Factors at values; over an angle every turn is alike."""
        if angular:
            return cast(Amount, np.interp(value % math.tau, *self._turn))
        return cast(Amount, np.interp(value, *self._line))

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:  # kept: a recorded load has thousands of pairs, and what it changes is looked up by it
        return super().__hash__()

    @property
    def narrowest(self) -> float:
        """Half the width of the narrowest rise and fall, or fall and rise, of more than a PULSE of the largest factor;
        endless without one.
        """
        if not self:
            return math.inf
        values, factors = self._line
        steps = np.diff(np.round(factors / (PULSE * np.abs(factors).max() or 1.0)))
        moved = np.flatnonzero(steps)
        turns = np.flatnonzero(np.diff(np.sign(steps[moved]), prepend=0.0))  # where it begins to rise, or to fall
        ends = np.append(turns[1:], moved.size) - 1
        widths = values[moved[ends[1:]] + 1] - values[moved[turns[:-1]]]
        return float(np.min(widths, initial=math.inf)) / 2

    @cached_property
    def _line(self) -> tuple[np.ndarray, np.ndarray]:
        values, factors = np.array(self, float).T
        return values, factors

    @cached_property
    def _turn(self) -> tuple[np.ndarray, np.ndarray]:
        values, factors = self._line
        order = np.argsort(values % math.tau, kind="stable")
        values, factors = (values % math.tau)[order], factors[order]
        around = np.concatenate([values[-1:] - math.tau, values, values[:1] + math.tau])
        return around, np.concatenate([factors[-1:], factors, factors[:1]])


def _of_turn(angle: np.ndarray | float) -> np.ndarray:
    """An angle (rad) within a turn, rounded: 420 and 60 degrees differ in the last digit there."""
    return np.asarray(np.round(np.mod(angle, math.tau), ANGLE_DIGITS) % round(math.tau, ANGLE_DIGITS))


class Load(MechanismPart):
    """A force (N, ground frame, fixed in direction) at a point of a body, or a torque (N.m) on it.

    It acts always, or ``over`` a quantity of the motion: ``crank_angle``, ``<body>_angle`` (rad, every turn alike),
    ``<body>_x``, ``<body>_y`` (m), ``position_<joint>`` (rad, every turn alike; of a slide m), or ``time`` (s since a
    run's start).  Then it acts ``from`` one value ``to`` another, or as many times as a ``table`` says: pairs of value
    and factor with straight lines between them, beyond them the nearest.

    If it ``opposes``, only its size is its own: the force acts against the velocity of its point, the torque against
    the angular velocity of its body, at rest against those of the drive's motion.
    """

    body: PartName
    point: PartName = "com"
    force: Vector = (0.0, 0.0)
    torque: SiNumber = 0.0
    over: str = ""
    start: Annotated[SiNumber | None, FROM] = None  # rad, m or s
    end: Annotated[SiNumber | None, Field(alias="to")] = None
    table: Annotated[tuple[Vector, ...], BeforeValidator(as_tuple), AfterValidator(Table)] = ()
    opposes: bool = False  # against the motion: of a tool that cuts, of a brake

    @model_validator(mode="after")
    def _check(self) -> Load:
        ends = (self.start is not None) + (self.end is not None)
        if ends == 1:
            raise ValueError("a load acts from one value to another: give both from and to")
        if bool(self.over) != bool(ends or self.table) or (ends and self.table):
            raise ValueError(
                "a load that varies has over and either from and to, or a table of pairs of value and factor"
            )
        if ends and self.start == self.end:
            raise ValueError(f"it acts from {self.start:g} to {self.end:g}, which is nowhere; give it a stretch")
        values = [value for value, _ in self.table]
        if self.table and (len(values) < 2 or any(b <= a for a, b in pairwise(values))):
            raise ValueError("table has two pairs of value and factor at least, values in increasing order")
        if self.opposes and any(factor < 0 for _, factor in self.table):
            raise ValueError("a load that opposes the motion has factors of 0 or more in its table; others drive it")
        return self

    @property
    def varies(self) -> bool:
        """Whether it is not the same throughout the motion."""
        return bool(self.over) or self.opposes

    def share(self, value: Amount, angular: bool) -> Amount:
        """How much of it acts at values of its quantity, every turn alike of one that is ``angular``; a stretch of a
        length is the same from either end.  Where one stretch ends and another begins, only that which begins acts.
        """
        turn = 2 * math.pi
        if self.table:
            return (self.table if isinstance(self.table, Table) else Table(self.table)).at(value, angular)
        start, end = self.start or 0.0, self.end or 0.0
        if not angular:
            return 1.0 * ((min(start, end) <= value) & (value < max(start, end)))
        if end - start >= turn:
            return value * 0.0 + 1.0
        here, first, last = (_of_turn(x) for x in (value, start, end))
        begun, open_yet = here >= first, here < last
        return cast("Amount", 1.0 * (begun & open_yet if first < last else begun | open_yet))

    @property
    def shortest_stretch(self) -> float:
        """The shortest stretch of its quantity (rad, m, s) in which it comes and goes; endless where it does not."""
        if self.start is not None and self.end is not None:
            return abs(self.end - self.start)
        return (self.table if isinstance(self.table, Table) else Table(self.table)).narrowest

    @property
    def largest(self) -> float:
        """The largest size of what it is multiplied by."""
        return max((abs(factor) for _, factor in self.table), default=1.0)

    def later(self, by: float) -> Load:
        """The same so much (s) later where it varies over time."""
        if self.over != "time":
            return self
        ends = {name: None if at is None else at + by for name, at in (("start", self.start), ("end", self.end))}
        return self.model_copy(update=ends | {"table": Table((at + by, factor) for at, factor in self.table)})

    def scaled(self, unit: float) -> Load:
        """The same with its quantity, which is no angle, in units of ``unit`` (m, s)."""
        ends = {name: None if at is None else at / unit for name, at in (("start", self.start), ("end", self.end))}
        return self.model_copy(update=ends | {"table": Table((at / unit, factor) for at, factor in self.table)})


SensorKind = Literal["position", "velocity", "accelerometer", "gyro", "distance", "strain", "force", "torque"]
_FIELDS_OF: dict[SensorKind, frozenset[str]] = {  # what each kind may be given beside name, kind, body and point
    "position": frozenset({"axis", "frame"}),
    "velocity": frozenset({"axis", "frame"}),
    "accelerometer": frozenset({"axis", "frame"}),
    "gyro": frozenset(),
    "distance": frozenset({"to"}),
    "strain": frozenset({"youngs_modulus"}),
    "force": frozenset({"axis", "frame"}),
    "torque": frozenset(),
}


class Sensor(MechanismPart):
    """What reads a moving body: at a ``point`` of it along an ``axis``, which is given in ``frame``."""

    name: PartName
    kind: SensorKind
    body: PartName
    point: Annotated[PartName | tuple[SiNumber, SiNumber], BeforeValidator(as_tuple)] = "com"
    axis: Annotated[Vector, AfterValidator(_directed)] = (1.0, 0.0)
    to: Annotated[str, AfterValidator(_a_point)] | None = None
    frame: PartName | None = None
    youngs_modulus: SiPositive | None = None  # Pa, of a strain; left out: the body's

    @model_validator(mode="after")
    def _check(self) -> Sensor:
        needless = sorted(({"axis", "to", "frame", "youngs_modulus"} & self.model_fields_set) - _FIELDS_OF[self.kind])
        if needless:
            raise ValueError(f"{' and '.join(needless)} says nothing of a sensor of kind {self.kind!r}; leave it out")
        if self.kind == "distance" and self.to is None:
            raise ValueError('a distance is measured to a point of another body; give to = "<body>.<point>"')
        if self.kind in ("force", "torque") and (not isinstance(self.point, str) or self.point == "com"):
            raise ValueError(f"a sensor of kind {self.kind!r} sits in a joint; give point = its name")
        if self.kind == "position" and self.frame == self.body:
            raise ValueError("a body does not move in its own frame; give frame another body, or leave it out: ground")
        return self

    @property
    def direction(self) -> complex:
        """The axis, of length 1, in its frame."""
        axis = complex(*self.axis)
        return axis / abs(axis)

    @property
    def seen_from(self) -> str:
        """The body (or the ground) in whose frame the axis is: its own, of a position the ground's."""
        return self.frame or (GROUND if self.kind == "position" else self.body)

    @property
    def joint(self) -> str:
        """The joint in which a load cell or a torque transducer sits."""
        return str(self.point)

    @property
    def far_end(self) -> tuple[str, str]:
        """Body and point to which a distance is measured."""
        body, _, point = str(self.to).partition(".")
        return body, point

    def modulus(self, body: Body) -> float | None:
        """Young's modulus (Pa) of the bar that a strain gauge is on."""
        return self.youngs_modulus or body.youngs_modulus

    def at(self, body: Body) -> complex:
        """Where it sits on its body (m, body frame)."""
        return body.point(self.point) if isinstance(self.point, str) else complex(*self.point)


class Tolerance(MechanismPart):
    """How a number of a mechanism varies from one made linkage to another: by its standard deviation about what the
    file says, or within limits, which are values themselves and no deviations.
    """

    sd: SiPositive | None = None  # standard deviation, in the unit of what it is of
    limits: Annotated[tuple[SiNumber, SiNumber], BeforeValidator(as_tuple)] | None = None  # smallest, largest value
    distribution: Literal["uniform", "triangular", "normal"] | None = None  # left out: normal of sd, uniform of limits
    group: str | None = None  # what varies together: all of a group are as far along their own distributions

    @model_validator(mode="after")
    def _check(self) -> Tolerance:
        if (self.sd is None) == (self.limits is None):
            raise ValueError("give a tolerance either sd or limits = [smallest, largest]")
        if self.limits is not None and self.limits[0] >= self.limits[1]:
            raise ValueError(f"limits = {list(self.limits)} are not in order; give [smallest, largest]")
        if self.group is not None and not self.group.strip():
            raise ValueError("group is empty; give it a name, or leave it out")
        return self

    @property
    def shape(self) -> Literal["uniform", "triangular", "normal"]:
        """Its distribution, as given or the usual one."""
        return self.distribution or ("uniform" if self.sd is None else "normal")


class Spring(MechanismPart):
    """A linear spring, with a damper beside it, between a point of one body and a point of another."""

    bodies: Annotated[tuple[PartName, PartName], BeforeValidator(as_tuple)]
    points: Annotated[tuple[PartName, PartName], BeforeValidator(as_tuple)]
    stiffness: SiNotNegative  # N/m
    length: SiNotNegative = 0.0  # m, unloaded
    damping: SiNotNegative = 0.0  # N.s/m

    @property
    def ends(self) -> tuple[tuple[str, str], tuple[str, str]]:
        """Body and point of either end."""
        return (self.bodies[0], self.points[0]), (self.bodies[1], self.points[1])

    def pull(self, apart: Displacement, rate: Displacement) -> Displacement:
        """Force (N, x + iy) on the first point, whose distance to the second is ``apart`` (m) and grows by ``rate``
        (m/s), both x + iy, second less first.
        """
        far = abs(apart)
        along = apart / np.maximum(far, SMALLEST_NUMBER)
        return (self.stiffness * (far - self.length) + self.damping * (along.conjugate() * rate).real) * along
