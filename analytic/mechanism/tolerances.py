"""What varies from one made linkage to another: the fields that ``[tolerances]`` name, and fits of pins.

A field is a dotted path: ``body.crank.mass``, ``body.coupler.points.B.x``, ``joint.B.clearance``,
``ground.points.E.y``, ``load.coupler.force.x`` (loads by their body; where one has several, and springs, by number
from 1), ``drive.speed`` (of several ``drive.A.speed``), ``gravity.y``.  ``body.crank.length`` is the distance between
the two points of a body: its last moves along the line through both.
"""

from __future__ import annotations

import difflib
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from analytic.mechanism.checks import MechanismWarning
from analytic.mechanism.errors import MechanismError, brief
from analytic.mechanism.model import Mechanism
from analytic.mechanism.parts import Body, Joint, Load, Spring, Tolerance
from analytic.mechanism.written import unit_of_field

# what may vary, by kind of part; of a vector its x and y each by itself
MAY_VARY: Mapping[str, tuple[str, ...]] = {
    "body": ("mass", "inertia", "com", "marker", "points", "length"),
    "joint": ("clearance", "friction", "pin_radius", "friction_torque", "static_torque", "friction_radius", "damping",
              "drag", "stiffness", "cubic", "rest_angle", "radial_stiffness"),
    "ground": ("points",),
    "load": ("force", "torque"),
    "spring": ("stiffness", "length", "damping"),
    "drive": ("speed",),
}  # fmt: skip
VECTORS = ("com", "marker", "force")
MOST_SIGMAS = 3.0  # of a normal distribution that has limits: they are so many standard deviations off its middle
# share of a normal distribution's standard deviation that is left when it is cut off there
CUT_OFF = math.sqrt(
    1
    - 2 * MOST_SIGMAS * math.exp(-(MOST_SIGMAS**2) / 2) / math.sqrt(2 * math.pi) / math.erf(MOST_SIGMAS / math.sqrt(2))
)
P = TypeVar("P", Body, Joint, Load, Spring)


@dataclass(frozen=True)
class Source:
    """A number that varies: its field, the number that the file says, in ``unit`` (SI), and how it varies."""

    field: str
    nominal: float
    unit: str
    tolerance: Tolerance

    @property
    def group(self) -> str:
        """What it varies with: its group's name, or its own field."""
        return self.tolerance.group or self.field

    @property
    def mean(self) -> float:
        """The middle of its distribution."""
        limits = self.tolerance.limits
        return self.nominal if limits is None else (limits[0] + limits[1]) / 2

    @property
    def sd(self) -> float:
        """Standard deviation."""
        limits = self.tolerance.limits
        if limits is None:
            return self.tolerance.sd or 0.0
        half = (limits[1] - limits[0]) / 2
        of_half = {"uniform": 1 / math.sqrt(3), "triangular": 1 / math.sqrt(6), "normal": CUT_OFF / MOST_SIGMAS}
        return half * of_half[self.tolerance.shape]

    @property
    def ends(self) -> tuple[float, float]:
        """Its limits; of a normal distribution without any, three standard deviations to either side."""
        if self.tolerance.limits is not None:
            return self.tolerance.limits
        half = {"uniform": math.sqrt(3), "triangular": math.sqrt(6), "normal": MOST_SIGMAS}[
            self.tolerance.shape
        ] * self.sd
        return self.mean - half, self.mean + half

    def at(self, share: np.ndarray) -> np.ndarray:
        """The values (S,) below which these shares (S,) of all linkages lie."""
        low, high = self.ends
        if self.tolerance.shape == "uniform":
            return low + (high - low) * share
        if self.tolerance.shape == "triangular":
            below = np.minimum(share, 1 - share)
            out = (high - low) * np.sqrt(below / 2)
            return np.where(share < 0.5, low + out, high - out)
        from scipy.special import ndtr, ndtri

        if self.tolerance.limits is None:
            return self.mean + self.sd * ndtri(share)
        tail = float(ndtr(-MOST_SIGMAS))
        return self.mean + (high - low) / (2 * MOST_SIGMAS) * ndtri(tail + (1 - 2 * tail) * share)


def sources(m: Mechanism) -> tuple[Source, ...]:
    """Everything that varies: what ``[tolerances]`` name, and the clearances of joints with a fit, between whose limits
    values near the middle are the more likely (a bore and a pin that are each uniform between theirs give a trapezium).

    Raises MechanismError for a field that there is not, or that cannot be what its tolerance says.
    """
    return tuple(_checked(m, field, tolerance) for field, tolerance in _stated(m))


def _stated(m: Mechanism) -> Iterator[tuple[str, Tolerance]]:
    yield from m.tolerances.items()
    for joint in m.joints:
        field = f"joint.{joint.name}.clearance"
        if joint.fitted is None:
            continue
        if field in m.tolerances:
            raise MechanismError(
                f"tolerances[{field}] stands beside fit = {joint.fit!r} of that joint; leave one of them out"
            )
        yield field, Tolerance(limits=joint.fitted, distribution="triangular")


def _checked(m: Mechanism, field: str, tolerance: Tolerance) -> Source:
    where = f"tolerances[{brief(field)}]"
    source = Source(field, value(m, field), unit_of_field(field, {j.name for j in m.joints if j.prismatic}), tolerance)
    low, high = source.ends
    if tolerance.limits is not None and not low <= source.nominal <= high:
        raise MechanismError(
            f"{where} has limits {low:g} to {high:g} {source.unit}".rstrip()
            + f", but the file says {source.nominal:g}; limits are the smallest and the largest value, not deviations"
        )
    for end in (low, high):
        try:
            changed(m, {field: end})
        except MechanismError as error:
            what = "a limit" if tolerance.limits is not None else f"the file's {source.nominal:g} less or more 3 sd"
            raise MechanismError(f"{where} may be {end:g}, {what}, which cannot be: {error}") from None
    return source


def as_made(m: Mechanism) -> Mechanism:
    """One linkage as it was made: a copy without tolerances, and without fits that its clearances are beyond."""

    def fits(joint: Joint) -> bool:
        return joint.fitted is None or joint.fitted[0] <= joint.clearance <= joint.fitted[1]

    if not m.tolerances and all(map(fits, m.joints)):
        return m
    joints = (j if fits(j) else j.model_copy(update={"fit": None}) for j in m.joints)
    return m.replace(tolerances={}, joints=tuple(joints))


def value(m: Mechanism, field: str) -> float:
    """The number that a mechanism has in a field.  Raises MechanismError where there is none."""
    kind, name, what, *axis = _way(m, field)
    if kind == "gravity":
        return m.gravity[_axis(m, field, axis)]
    if kind == "drive":
        speed = next(d.speed for d in m.drives if d.joint == name)
        if isinstance(speed, str):
            raise _fault(m, field, f"the drive has no constant speed, but {speed!r}; leave it out")
        return speed
    part = _part(m, kind, name)
    if what == "length":
        a, b = _two_points(m, field, part)
        return abs(b - a)
    found = part.points[axis[0]] if what == "points" else getattr(part, what)
    if found is None or (what == "clearance" and found == 0):
        raise _fault(m, field, f"the file gives no {what} there; give it, then its tolerance")
    return float(found[_axis(m, field, axis[what == "points" :])] if isinstance(found, tuple) else found)


def changed(m: Mechanism, values: Mapping[str, float]) -> Mechanism:
    """A checked copy with other numbers (SI) in some fields.  Raises MechanismError."""
    with warnings.catch_warnings():  # of what looks like a slip of units, which the file has told already
        warnings.simplefilter("ignore", MechanismWarning)
        for field, number in values.items():
            m = _changed(m, field, float(number))
    return m


def _changed(m: Mechanism, field: str, number: float) -> Mechanism:
    kind, name, what, *axis = _way(m, field)
    if kind == "gravity":
        return m.replace(gravity=_put(m.gravity, _axis(m, field, axis), number))
    if kind == "drive":
        drives = (d.model_copy(update={"speed": number}) if d.joint == name else d for d in m.drives)
        return m.replace(drive=tuple(drives))
    part = _part(m, kind, name)
    if what == "points":
        points = {**part.points, axis[0]: _put(part.points[axis[0]], _axis(m, field, axis[1:]), number)}
        update: dict[str, Any] = {"points": points}
    elif what == "length":
        a, b = _two_points(m, field, part)
        end = a + number * (b - a) / abs(b - a)
        moved = {place: (end.real, end.imag) for place, p in part.points.items() if complex(*p) == b}
        update = {"points": {**part.points, **moved}}
    else:
        old = getattr(part, what)
        update = {what: _put(old, _axis(m, field, axis), number) if isinstance(old, tuple) else number}
    if kind == "ground":
        return m.replace(ground=m.ground.model_copy(update=update))
    if kind == "body":
        return m.with_body(name, **update)
    if kind == "joint":
        return m.with_joint(name, **update)
    plural = {"load": "loads", "spring": "springs"}[kind]
    parts = list(getattr(m, plural))
    parts[_numbered(m, kind)[name]] = type(part).model_validate(
        {**part.model_dump(exclude_unset=True, by_alias=True), **update}
    )
    return m.replace(**{plural: tuple(parts)})


def _put(pair: tuple[float, float], axis: int, number: float) -> tuple[float, float]:
    return (number, pair[1]) if axis == 0 else (pair[0], number)


def _way(m: Mechanism, field: str) -> list[str]:
    """Kind, name, field and what is within it; kind and axis of gravity.  Raises MechanismError."""
    kind, *way = field.split(".")
    if kind == "gravity":
        return [kind, "", "", *way]
    if kind not in MAY_VARY:
        raise _fault(m, field, f"a field begins with {', '.join(MAY_VARY)} or gravity, such as 'body.crank.mass'")
    if kind == "ground":
        way = ["ground", *way]
    elif kind == "drive" and len(way) == 1 and len(m.drives) == 1:
        way = [m.drives[0].joint, *way]
    there = _there(m, kind)
    if not way or way[0] not in there:
        close = difflib.get_close_matches(way[0] if way else "", there, n=1)
        raise _fault(m, field, f"did you mean {close[0]!r}?" if close else f"there are {', '.join(there) or 'none'}")
    if len(way) < 2 or way[1] not in MAY_VARY[kind]:
        close = difflib.get_close_matches(way[1] if len(way) > 1 else "", MAY_VARY[kind], n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise _fault(m, field, f"{hint}what may vary of a {kind} is {', '.join(MAY_VARY[kind])}")
    if way[1] == "points":
        points = _part(m, kind, way[0]).points
        if len(way) < 3 or way[2] not in points:
            raise _fault(m, field, f"name a point, one of {', '.join(points)}, and x or y")
    elif way[1] not in VECTORS and len(way) > 2:
        raise _fault(m, field, f"{way[1]} is one number; leave {'.'.join(way[2:])!r} out")
    return [kind, *way]


def _there(m: Mechanism, kind: str) -> Sequence[str]:
    """Names of the parts of a kind."""
    if kind in ("body", "joint"):
        return [part.name for part in (m.bodies if kind == "body" else m.joints)]
    if kind == "drive":
        return [drive.joint for drive in m.drives]
    return ["ground"] if kind == "ground" else list(_numbered(m, kind))


def _numbered(m: Mechanism, kind: str) -> dict[str, int]:
    """Index of each load or spring by its number from 1, and of a body's only load by that body."""
    if kind == "spring":
        return {str(k): k - 1 for k in range(1, len(m.springs) + 1)}
    of = [load.body for load in m.loads]
    return {body: k for k, body in enumerate(of) if of.count(body) == 1} | {str(k + 1): k for k in range(len(of))}


def _part(m: Mechanism, kind: str, name: str) -> Any:
    if kind in ("body", "ground"):
        return m.body(name)
    return m.joint(name) if kind == "joint" else (m.loads if kind == "load" else m.springs)[_numbered(m, kind)[name]]


def _two_points(m: Mechanism, field: str, body: Body) -> tuple[complex, complex]:
    """The two places of a body whose distance is its length."""
    places = list(dict.fromkeys(complex(*p) for p in body.points.values()))
    if len(places) != 2:
        raise _fault(
            m, field, f"a length is of a body with two points, and this has {len(places)}; give points.P.x or .y"
        )
    return places[0], places[1]


def _axis(m: Mechanism, field: str, axis: Sequence[str]) -> int:
    if len(axis) != 1 or axis[0] not in ("x", "y"):
        raise _fault(m, field, "each coordinate varies by itself; end it with .x or .y")
    return ("x", "y").index(axis[0])


def _fault(m: Mechanism, field: str, why: str) -> MechanismError:
    return MechanismError(f"tolerances[{brief(field)}] is of no number of this mechanism; {why}")
