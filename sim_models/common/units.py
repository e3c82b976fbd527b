"""Each linkage is simulated in units of its own, so that an engine meets a micromechanism and a crane as it meets a
bench model.

Engines have numbers of their own in them: a smallest inertia, a softness, a tolerance, a step.  They suit links of some
decimetres and some hundred grams that turn in a fraction of a second.  A linkage far from that is given to its engine
in other units of length, mass and time, powers of two of SI's, in which it is such a linkage; what comes back is put
into SI again.  Nothing but the exponents of the numbers changes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import overload

import numpy as np

from analytic.kinematics.schedule import Course, DriveMotion, Schedule, Steady
from analytic.kinematics.structure import structure
from analytic.mechanism import Body, Drive, Joint, Load, Mechanism, Spring, Stop
from analytic.mechanism.signals import named
from analytic.mechanism.units import POWERS
from analytic.mechanism.units import Powers as Dimension
from analytic.mechanism.written import INITIAL
from sim_models.common.contact_laws import default_stiffness, heaviest, longest, power_of_two, turning_rate
from sim_models.common.failed_starts import TooSoft
from sim_models.common.weights import with_equal_masses
from sim_models.engine import Cause, Rates, Request, SettingValue, SimulationError, Trace, Unsupported, Watched

# What an engine is at home with, in SI: where a linkage lies within, its units are SI's; else it is brought to the
# middle.
LENGTHS = (2.0**-6, 2.0**2)  # m, longest distance between two points of a body
MASSES = (2.0**-7, 2.0**5)  # kg, the heaviest body
RATES = (2.0**0, 2.0**7)  # 1/s, of the crank, or at which loads would turn the linkage

# Units of numbers in messages
SAID: dict[str, Dimension] = {
    **{unit: powers for unit, powers in POWERS.items() if any(powers)},
    "J": POWERS["N.m"],
    "N/m": (0, 1, -2),
    "N.m/rad": POWERS["N.m"],
    "kg": (0, 1, 0),
    "kg.m^2": (2, 1, 0),
}
_UNITS = "|".join(re.escape(unit) for unit in sorted(SAID, key=len, reverse=True))
WITH_UNIT = re.compile(rf"(?<![\w.])(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?) ({_UNITS})(?![\w/^]|\.\w)")

Pair = tuple[float, float]
DIMENSIONLESS: Dimension = (0, 0, 0)
LENGTH: Dimension = (1, 0, 0)
TIME_DIMENSION: Dimension = (0, 0, 1)
SPEED_DIMENSION: Dimension = (1, 0, -1)
ACCELERATION: Dimension = (1, 0, -2)
RATE: Dimension = (0, 0, -1)
TURNING_DIMENSION: Dimension = (0, 0, -2)
FORCE_DIMENSION: Dimension = (1, 1, -2)
TORQUE_DIMENSION: Dimension = (2, 1, -2)
PRESSURE: Dimension = (-1, 1, -2)
STIFFNESS: Dimension = (0, 1, -2)
DAMPING: Dimension = (0, 1, -1)

BODY = {
    "mass": (0, 1, 0),
    "com": LENGTH,
    "marker": LENGTH,
    "section": LENGTH,
    "inertia": (2, 1, 0),
    "youngs_modulus": PRESSURE,
    "shear_modulus": PRESSURE,
}
JOINT_DIMENSIONS = {
    "clearance": LENGTH,
    "guide": LENGTH,
    "pin_radius": LENGTH,
    "contact_stiffness": STIFFNESS,
    "contact_damping": DAMPING,
}
REVOLUTE = {
    "radial_stiffness": STIFFNESS,
    "friction_torque": TORQUE_DIMENSION,
    "static_torque": TORQUE_DIMENSION,
    "stribeck_speed": RATE,
    "friction_radius": LENGTH,
    "damping": (2, 1, -1),
    "drag": (2, 1, 0),
    "stiffness": TORQUE_DIMENSION,
    "cubic": TORQUE_DIMENSION,
}
PRISMATIC = {
    "friction": FORCE_DIMENSION,
    "friction_torque": FORCE_DIMENSION,
    "static_torque": FORCE_DIMENSION,
    "stribeck_speed": SPEED_DIMENSION,
    "damping": DAMPING,
    "drag": (-1, 1, 0),
    "stiffness": STIFFNESS,
    "cubic": (-2, 1, -2),
    "rest_angle": LENGTH,
}
GUIDED = {name: dimension for name, dimension in PRISMATIC.items() if name != "friction"}  # a coefficient there
STOP = {"stiffness": TORQUE_DIMENSION, "damping": (2, 1, -1)}
SLIDE_STOP = {"start": LENGTH, "end": LENGTH, "stiffness": STIFFNESS, "damping": DAMPING}
SPRING = {"stiffness": STIFFNESS, "length": LENGTH, "damping": DAMPING}
SETTINGS = {
    "step": TIME_DIMENSION,
    "bounce_time": TIME_DIMENSION,
    "start_speed": RATE,
    "contact_stiffness": STIFFNESS,
    "contact_damping": DAMPING,
    "minimum_impact_speed": SPEED_DIMENSION,
    "contact_margin": LENGTH,
}


@dataclass(frozen=True)
class Units:
    """Units of length (m), mass (kg) and time (s)."""

    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @classmethod
    def of(cls, request: Request) -> Units:
        """The units of a request's linkage and motion."""
        m = request.mechanism
        rate = max(turning_rate(m, request.motion), fastest(request))
        return cls(power_of_two(longest(m), LENGTHS), power_of_two(heaviest(m), MASSES), 1 / power_of_two(rate, RATES))

    def size(self, dimension: Dimension) -> float:
        """What one of these units is in SI."""
        length, mass, time = dimension
        return float(self.length**length * self.mass**mass * self.time**time)

    @overload
    def from_si(self, value: float, dimension: Dimension) -> float: ...

    @overload
    def from_si(self, value: Pair, dimension: Dimension) -> Pair: ...

    def from_si(self, value: float | Pair, dimension: Dimension) -> float | Pair:
        """A number, or a pair of them, in these units."""
        scale = self.size(dimension)
        return (value[0] / scale, value[1] / scale) if isinstance(value, tuple) else value / scale

    def mechanism(self, m: Mechanism) -> Mechanism:
        """A mechanism in these units."""

        def points(of: Mapping[str, Pair]) -> dict[str, Pair]:
            return {name: self.from_si(at, LENGTH) for name, at in of.items()}

        def fields(
            part: Body | Joint | Drive | Load | Spring | Stop, dimensions: Mapping[str, Dimension]
        ) -> dict[str, object]:
            given = {
                name: getattr(part, name)
                for name in dimensions
                if name in part.model_fields_set and getattr(part, name) is not None
            }
            return {name: self.from_si(value, dimensions[name]) for name, value in given.items()}

        def joint(j: Joint) -> Joint:
            new = fields(
                j, JOINT_DIMENSIONS | (REVOLUTE if not j.prismatic else PRISMATIC if j.guide is None else GUIDED)
            )
            if j.elasticity is not None:
                translation, rotation = (
                    self.from_si(getattr(j.elasticity, name), d)
                    for name, d in (("translation", STIFFNESS), ("rotation", TORQUE_DIMENSION))
                )
                new["elasticity"] = j.elasticity.model_copy(update={"translation": translation, "rotation": rotation})
            return j.model_copy(update=new | {"fit": None})  # its clearance is known, and tables are in metres

        def drive(d: Drive) -> Drive:
            speed = (
                {} if isinstance(d.speed, str) else {"speed": SPEED_DIMENSION if m.joint(d.joint).prismatic else RATE}
            )
            scaled = fields(d, {"stiffness": TORQUE_DIMENSION} | speed)
            if d.periodic_torque is not None:
                torque = self.from_si(d.periodic_torque.amplitude, TORQUE_DIMENSION)
                scaled["periodic_torque"] = d.periodic_torque.model_copy(update={"amplitude": torque})
            return d.model_copy(update=scaled)

        def load_in(load: Load) -> Load:
            unit = m.load_quantities[load.over].unit if load.over else "rad"
            scaled = load if unit == "rad" else load.scaled(self.time if unit == "s" else self.length)
            return scaled.model_copy(update=fields(load, {"force": FORCE_DIMENSION, "torque": TORQUE_DIMENSION}))

        return m.replace(
            gravity=self.from_si(m.gravity, ACCELERATION),
            ground=m.ground.model_copy(update={"points": points(m.ground.points)}),
            bodies=tuple(b.model_copy(update=fields(b, BODY) | {"points": points(b.points)}) for b in m.bodies),
            joints=tuple(joint(j) for j in m.joints),
            drives=tuple(drive(d) for d in m.drives),
            springs=tuple(s.model_copy(update=fields(s, SPRING)) for s in m.springs),
            stops=tuple(
                s.model_copy(update=fields(s, SLIDE_STOP if m.joint(s.joint).prismatic else STOP)) for s in m.stops
            ),
            loads=tuple(load_in(load) for load in m.loads),
            initial={
                INITIAL + name: self.from_si(rate, SPEED_DIMENSION if m.joint(name).prismatic else RATE)
                for name, rate in m.initial_velocities.items()
            },
        )

    def request(self, r: Request) -> Request:
        """A request in these units."""
        return replace(
            r,
            mechanism=self.mechanism(r.mechanism),
            schedule=self.schedule(r.mechanism, r.schedule),
            step=None if r.step is None else r.step / self.time,
        )

    def schedule(self, m: Mechanism, s: Schedule) -> Schedule:
        """A schedule of mechanism ``m`` in these units."""
        size = {j.name: self.length if j.prismatic else 1.0 for j in m.joints}

        def motor(name: str, own: DriveMotion) -> DriveMotion:
            if isinstance(own, Course):
                return Course(own.knots / self.time, own.values / size[name])
            return Steady(own.start / size[name], own.speed * self.time / size[name], own.begin / self.time)

        return replace(
            s,
            time=s.time / self.time,
            drives={name: motor(name, own) for name, own in s.drives.items()},
            rates={name: rate * self.time / size[name] for name, rate in s.rates.items()},
        )

    def trace(self, m: Mechanism, t: Trace) -> Trace:
        """A trace of these units, of mechanism ``m``, in SI.  Raises SimulationError for a signal that it has not."""
        known = named(m.bodies, m.joints, m.drives, m.sensors)
        unknown = sorted(set(t.signals) - set(known))
        if unknown:
            raise SimulationError(
                f"{t.simulator}: {m.name} has no signal {unknown[0]!r}", Cause.FAULTY, "leave it out of the trace"
            )
        own = {"length": self.length, "mass": self.mass, "time": self.time}
        told = 1.0
        if t.time is not None and not m.cranked:
            s = structure(m)
            told = self.length if s.unit(s.inputs[0]) == "m" else 1.0
        return replace(
            t,
            crank_angle=t.crank_angle * told,
            time=None if t.time is None else t.time * self.time,
            signals={name: values * self.size(POWERS[known[name].unit]) for name, values in t.signals.items()},
            rates={body: self._rates(rates) for body, rates in t.rates.items()},
            watched=None if t.watched is None else self._watched(t.watched),
            clearance={name: c * self.length for name, c in t.clearance.items()},
            journal={name: path * self.length for name, path in t.journal.items()},
            settings={name: self._setting(name, value) for name, value in t.settings.items()} | {"units": own},
        )

    def _watched(self, w: Watched) -> Watched:
        speed, rate, force, torque = (self.size(d) for d in (SPEED_DIMENSION, RATE, FORCE_DIMENSION, TORQUE_DIMENSION))
        return Watched(
            w.time * self.time,
            {body: at * self.length for body, at in w.place.items()},
            {body: v * speed for body, v in w.velocity.items()},
            dict(w.angle),
            {body: spin * rate for body, spin in w.angular_velocity.items()},
            {joint: f * force for joint, f in w.force.items()},
            w.torque * torque,
            {joint: f * force for joint, f in w.corners.items()},
            {joint: f * force for joint, f in w.rubbing.items()},
        )

    def _rates(self, r: Rates) -> Rates:
        speed, acceleration, turning = (self.size(d) for d in (SPEED_DIMENSION, ACCELERATION, TURNING_DIMENSION))
        return Rates(r.velocity * speed, r.acceleration * acceleration, r.angular_acceleration * turning)

    def _setting(self, name: str, value: SettingValue) -> SettingValue:
        if name not in SETTINGS:
            return value
        size = self.size(SETTINGS[name])
        if isinstance(value, Mapping):
            return {key: each * size for key, each in value.items()}
        return value * size if isinstance(value, int | float) else value

    def said(self, text: str, name: str) -> str:
        """A message in which each number with its unit is in these units, in SI; its digits are as many, or three.  The
        linkage's name may have a number and a unit of its own.
        """

        def in_si(found: re.Match[str]) -> str:
            number, unit = found.groups()
            digits = len(number.split("e")[0].lstrip("-0.").replace(".", ""))
            return f"{float(number) * self.size(SAID[unit]):.{max(3, digits)}g} {unit}"

        return name.join(WITH_UNIT.sub(in_si, part) for part in text.split(name))


SI = Units()


def in_own_units(run: Callable[[Request], Trace], request: Request, seconds: bool = False) -> Trace:
    """Run a request in its linkage's own units, of time in ``seconds`` if that is wanted; the trace is in SI, with the
    units in its settings.

    Joints with clearance that say nothing of their stiffness are given the project's default first.  Raises what the
    run raises; each number with a unit in a message of its SimulationError or Unsupported is in SI, too.
    """
    whole = with_stiffness(request)
    if request.motion == "static":
        whole = replace(whole, mechanism=with_equal_masses(whole.mechanism))
    units = replace(Units.of(whole), **({"time": 1.0} if seconds else {}))
    if units == SI:
        return units.trace(whole.mechanism, run(whole))
    try:
        return units.trace(whole.mechanism, run(units.request(whole)))
    except TooSoft as error:
        raise error.of(whole.mechanism) from None
    except SimulationError as error:
        said = units.said(error.what, whole.mechanism.name)
        raise SimulationError(said, error.cause, error.remedies, error.note) from error
    except Unsupported as error:
        raise Unsupported(units.said(str(error), whole.mechanism.name)) from error


def with_stiffness(request: Request) -> Request:
    """The request with a contact stiffness in every joint with clearance; ``assumed`` names those that had none."""
    m = request.mechanism
    soft = [
        name
        for name in request.clearances
        if m.joint(name).contact_stiffness is None and m.joint(name).radial_stiffness is None
    ]
    if not soft:
        return request
    stiffness = default_stiffness(m, request.motion)
    for name in soft:
        m = m.with_joint(name, contact_stiffness=stiffness)
    return replace(request, mechanism=m, assumed=frozenset(soft))


def fastest(request: Request) -> float:
    """The largest rate (rad/s) that a request prescribes beside the drive's constant speed: of a course, or at
    release.

    A slide's is what it travels over the longest body, and how soon it gains its speed where that is sooner: an axis
    may be any number of lengths long.
    """
    if request.motion == "static":  # in which nothing is fast
        return 0.0
    m, rates = request.mechanism, request.schedule.rates
    rate = max((abs(r) / (longest(m) if m.joint(n).prismatic else 1.0) for n, r in rates.items()), default=0.0)
    for joint, course in request.schedule.courses.items():
        time, angle = course.knots, course.values
        slides = request.mechanism.joint(joint).prismatic
        if slides:
            angle = angle / longest(request.mechanism)
        if time.shape == angle.shape and time.size > 1 and np.all(np.diff(time) > 0):
            speed = np.diff(angle) / np.diff(time)
            rate = max(rate, float(np.abs(speed).max()))
            if slides and speed.size > 1 and speed.any():
                gained = np.abs(np.diff(speed)) / (time[2:] - time[:-2])
                rate = max(rate, float(2.0 * gained.max() / np.abs(speed).max()))
    return rate if math.isfinite(rate) else 0.0
