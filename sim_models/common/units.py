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
from typing import Any

import numpy as np

from analytic.kinematics.schedule import Course, DriveMotion, Schedule, Steady
from analytic.kinematics.structure import structure
from analytic.mechanism import Drive, Joint, Load, Mechanism
from analytic.mechanism.parts import MechanismPart
from analytic.mechanism.signals import named
from analytic.mechanism.units import SI as SI_UNITS
from analytic.mechanism.units import powers
from analytic.mechanism.written import (
    BODY,
    DRIVE,
    ELASTICITY,
    INITIAL,
    JOINT,
    LOAD,
    PRISMATIC,
    REVOLUTE,
    SPRING,
    STOPS,
)
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
SAID = (*(unit for unit in SI_UNITS.values() if any(powers(unit))), "J", "N/m", "N.m/rad", "kg", "kg.m^2")
_UNITS = "|".join(re.escape(unit) for unit in sorted(SAID, key=len, reverse=True))
WITH_UNIT = re.compile(rf"(?<![\w.])(-?\d+(?:\.\d+)?(?:e[+-]?\d+)?) ({_UNITS})(?![\w/^]|\.\w)")

_Value = Any  # a number, a pair, or points by name: what goes in comes out
ATTRIBUTES = {"from": "start", "to": "end"}  # of fields that are called otherwise in a file
SETTINGS = {
    "step": "s", "bounce_time": "s", "start_speed": "rad/s", "contact_stiffness": "N/m", "contact_damping": "N.s/m",
    "minimum_impact_speed": "m/s", "contact_margin": "m",
}  # fmt: skip


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

    def size(self, unit: str) -> float:
        """What the one of these units that stands for an SI unit is in SI."""
        length, mass, time = powers(unit)
        return float(self.length**length * self.mass**mass * self.time**time)

    def _from_si(self, value: _Value, unit: str) -> _Value:
        """A number, or those in a pair or a table, whose SI unit that is, in these units."""
        if isinstance(value, Mapping):
            return {name: self._from_si(each, unit) for name, each in value.items()}
        scale = self.size(unit)
        return (value[0] / scale, value[1] / scale) if isinstance(value, tuple) else value / scale

    def mechanism(self, m: Mechanism) -> Mechanism:
        """A mechanism in these units."""

        def fields(part: MechanismPart, units: Mapping[str, str]) -> dict[str, object]:
            """What is given of a part's fields, of which a file has these units."""
            named = {ATTRIBUTES.get(name, name): unit for name, unit in units.items()}
            given = {name: getattr(part, name) for name in named if name in part.model_fields_set}
            return {name: self._from_si(value, named[name]) for name, value in given.items() if value is not None}

        def joint(j: Joint) -> Joint:
            units = JOINT | (PRISMATIC if j.prismatic else REVOLUTE)
            if j.guide is not None:
                units = {name: unit for name, unit in units.items() if name != "friction"}  # a coefficient there
            new = fields(j, units) | {"fit": None}  # its clearance is known, and tables are in metres
            if j.elasticity is not None:
                new["elasticity"] = j.elasticity.model_copy(update=fields(j.elasticity, ELASTICITY))
            return j.model_copy(update=new)

        def drive(d: Drive) -> Drive:
            scaled = fields(d, DRIVE | ({} if isinstance(d.speed, str) else {"speed": rate_unit(m.joint(d.joint))}))
            if d.periodic_torque is not None:
                torque = self._from_si(d.periodic_torque.amplitude, "N.m")
                scaled["periodic_torque"] = d.periodic_torque.model_copy(update={"amplitude": torque})
            return d.model_copy(update=scaled)

        def load_in(load: Load) -> Load:
            unit = m.load_quantities[load.over].unit if load.over else "rad"
            scaled = load if unit == "rad" else load.scaled(self.time if unit == "s" else self.length)
            return scaled.model_copy(update=fields(load, LOAD))

        return m.replace(
            gravity=self._from_si(m.gravity, "m/s^2"),
            ground=m.ground.model_copy(update={"points": self._from_si(m.ground.points, "m")}),
            bodies=tuple(b.model_copy(update=fields(b, BODY)) for b in m.bodies),
            joints=tuple(joint(j) for j in m.joints),
            drives=tuple(drive(d) for d in m.drives),
            springs=tuple(s.model_copy(update=fields(s, SPRING)) for s in m.springs),
            stops=tuple(s.model_copy(update=fields(s, STOPS[rate_unit(m.joint(s.joint))])) for s in m.stops),
            loads=tuple(load_in(load) for load in m.loads),
            initial={
                INITIAL + name: self._from_si(rate, rate_unit(m.joint(name)))
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
            signals={name: values * self.size(known[name].unit) for name, values in t.signals.items()},
            rates={body: self._rates(rates) for body, rates in t.rates.items()},
            watched=None if t.watched is None else self._watched(t.watched),
            clearance={name: c * self.length for name, c in t.clearance.items()},
            journal={name: path * self.length for name, path in t.journal.items()},
            settings={name: self._setting(name, value) for name, value in t.settings.items()} | {"units": own},
        )

    def _watched(self, w: Watched) -> Watched:
        speed, rate, force, torque = (self.size(unit) for unit in ("m/s", "rad/s", "N", "N.m"))
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
        speed, acceleration, turning = (self.size(unit) for unit in ("m/s", "m/s^2", "rad/s^2"))
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
            return f"{float(number) * self.size(unit):.{max(3, digits)}g} {unit}"

        return name.join(WITH_UNIT.sub(in_si, part) for part in text.split(name))


SI = Units()


def rate_unit(joint: Joint) -> str:
    """The SI unit in which a joint moves."""
    return "m/s" if joint.prismatic else "rad/s"


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
