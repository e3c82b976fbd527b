"""What varies from one made linkage to another: the fields that ``[tolerances]`` name, and fits of pins.

A field is a dotted path: ``body.crank.mass``, ``body.coupler.points.B.x``, ``joint.B.clearance``,
``ground.points.E.y``, ``load.coupler.force.x`` (loads by their body, stops by their joint; where one has several, and
springs, by number from 1), ``drive.speed`` (of several ``drive.A.speed``), ``gravity.y``.  ``body.crank.length`` is the
distance between the two points of a body: its last moves along the line through both.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import dotted
from analytic.mechanism.checks import MechanismWarning
from analytic.mechanism.errors import MechanismError, brief
from analytic.mechanism.model import Mechanism
from analytic.mechanism.parts import Joint, Tolerance

# what may vary, by kind of part; of a vector its x and y each by itself
MAY_VARY: Mapping[str, tuple[str, ...]] = {
    "body": ("mass", "inertia", "com", "marker", "points", "length"),
    "joint": ("clearance", "friction", "pin_radius", "friction_torque", "static_torque", "friction_radius", "damping",
              "drag", "stiffness", "cubic", "rest_angle", "radial_stiffness"),
    "ground": ("points",),
    "load": ("force", "torque"),
    "spring": ("stiffness", "length", "damping"),
    "stop": ("from", "to", "stiffness", "damping"),
    "drive": ("speed",),
}  # fmt: skip
MOST_SIGMAS = 3.0  # of a normal distribution that has limits: they are so many standard deviations off its middle
# share of a normal distribution's standard deviation that is left when it is cut off there
CUT_OFF = math.sqrt(
    1
    - 2 * MOST_SIGMAS * math.exp(-(MOST_SIGMAS**2) / 2) / math.sqrt(2 * math.pi) / math.erf(MOST_SIGMAS / math.sqrt(2))
)


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
    source = Source(field, value(m, field), _field(m, field).unit, tolerance)
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


def value(m: Mechanism, name: str) -> float:
    """The number that a mechanism has in a field.  Raises MechanismError where there is none."""
    found = dotted.value(m, field := _field(m, name))
    if isinstance(found, str):
        raise _fault(name, f"the drive has no constant speed, but {found!r}; leave it out")
    what = field.place[-1]
    if not isinstance(found, float) or (what == "clearance" and found == 0):
        raise _fault(name, f"the file gives no {what} there; give it, then its tolerance")
    return found


def changed(m: Mechanism, values: Mapping[str, float]) -> Mechanism:
    """A checked copy with other numbers (SI) in some fields.  Raises MechanismError."""
    with warnings.catch_warnings():  # of what looks like a slip of units, which the file has told already
        warnings.simplefilter("ignore", MechanismWarning)
        return dotted.with_values(m, {_field(m, name): float(number) for name, number in values.items()})


def _field(m: Mechanism, name: str) -> dotted.Dotted:
    """The field of that name, of those that may vary.  Raises MechanismError."""
    try:
        field = dotted.find(m, name)
    except dotted.FieldError as error:
        if error.choices == ("x", "y"):
            raise _fault(name, "each coordinate varies by itself; end it with .x or .y") from None
        choices = ", ".join(error.choices) or "none"
        hint = f"name a point, one of {choices}, and x or y" if error.where == "points" else f"there are {choices}"
        raise _fault(name, f"did you mean {error.close!r}?" if error.close else hint) from None
    kind, *way = str(field.place[0]), *field.place[1:]
    fields = [step for step in way if isinstance(step, str)]
    if kind != "gravity" and (kind not in MAY_VARY or fields[0] not in MAY_VARY[kind]):
        of = f"of a {kind} is {', '.join(MAY_VARY[kind])}" if kind in MAY_VARY else f"is of {', '.join(MAY_VARY)}"
        raise _fault(name, f"what may vary {of}")
    return field


def _fault(name: str, why: str) -> MechanismError:
    return MechanismError(f"tolerances[{brief(name)}] is of no number of this mechanism; {why}")
