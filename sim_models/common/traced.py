"""A trace's bodies, joints and forces at its instants, in the mechanism's words, for those who check what a run must
be.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Body, Joint, Load
from analytic.mechanism.parts import TINY
from analytic.mechanism.signals import driving, wrapped
from analytic.mechanism.varying import NEVER, Seen
from sim_models.common.contact_laws import contact_parameters, longest
from sim_models.common.fading import fading
from sim_models.common.guide import Guide
from sim_models.engine import Request, Trace

FADING = 1e-2  # of the largest angular speed: slower joints may have let their Coulomb friction fade
REST = 1e-5  # m/s^2: forces that give the whole linkage's mass no more are nothing
EDGE_ROUNDING = 1e-9  # of 1 rad, m or s and what a load varies over: nearer to an end, rounding decides
ROUNDING_OF_SIZE = 1e-12


def cross(a: np.ndarray, b: np.ndarray | complex) -> np.ndarray:
    """Moment of b at an arm a, (N,)."""
    return np.asarray((np.conj(a) * b).imag)


def dot(a: np.ndarray, b: np.ndarray | complex) -> np.ndarray:
    """Inner product of vectors a and b, (N,)."""
    return np.asarray((np.conj(a) * b).real)


@dataclass(frozen=True)
class Miss:
    """By how much (N,) a run misses what must be true of it: ``what`` in words, ``scale`` is what that is a share of.

    What is below ``floor`` is nothing.  An entry beyond the trace's instants is of a pin's path between them.
    """

    check: str
    what: str
    size: np.ndarray
    scale: float
    unit: str
    floor: float = 0.0

    @property
    def share(self) -> float:
        """The largest miss as a share of its scale; none where it is nothing."""
        worst = float(self.size.max(initial=0.0))
        return 0.0 if worst <= self.floor else worst / self.scale if self.scale > 0 else np.inf


class TracedLinkage:
    """A trace at its N instants.  Complex numbers are x + iy in the ground frame."""

    def __init__(self, request: Request, trace: Trace) -> None:
        self.request, self.trace, self.m = request, trace, request.mechanism
        self.count = trace.crank_angle.size

    def signal(self, name: str) -> np.ndarray:
        """A signal (N,)."""
        return self.trace.signals[name]

    def vector(self, name: str) -> np.ndarray:
        """A vector (N,) of two signals."""
        return self.signal(f"{name}_x") + 1j * self.signal(f"{name}_y")

    def angle(self, body: str) -> np.ndarray:
        """A body's angle (N,) rad."""
        return np.zeros(self.count) if body == GROUND else self.signal(f"{body}_angle")

    def spin(self, body: str) -> np.ndarray:
        """Its angular velocity (N,) rad/s."""
        return np.zeros(self.count) if body == GROUND or self.still else self.signal(f"{body}_angular_velocity")

    def spin_up(self, body: str) -> np.ndarray:
        """Its angular acceleration (N,) rad/s^2."""
        return np.zeros(self.count) if body == GROUND else self.trace.rates[body].angular_acceleration

    def arm(self, body: str, point: str, origin: str = MASS_CENTRE) -> np.ndarray:
        """From one of a body's points, or the ground's origin, to another (N,) m."""
        here = self.m.body(body)
        start = here.point(origin) if isinstance(here, Body) else 0j
        return (here.point(point) - start) * np.exp(1j * self.angle(body))

    def place(self, body: str, point: str) -> np.ndarray:
        """Where a body's point is (N,) m."""
        return self.arm(body, point, "com") + (0.0 if body == GROUND else self.vector(body))

    def velocity(self, body: str, arm: np.ndarray) -> np.ndarray:
        """Velocity (N,) m/s of a point of a body at an arm (N,) m from its centre of mass."""
        return (
            np.zeros(self.count, complex)
            if body == GROUND
            else self.trace.rates[body].velocity + 1j * self.spin(body) * arm
        )

    def going(self, body: str, point: str) -> np.ndarray:
        """Velocity (N,) m/s of a body's point."""
        return self.velocity(body, self.arm(body, point))

    def acceleration(self, body: str, arm: np.ndarray) -> np.ndarray:
        """Acceleration (N,) m/s^2 of such a point."""
        if body == GROUND:
            return np.zeros(self.count, complex)
        return self.trace.rates[body].acceleration + (1j * self.spin_up(body) - self.spin(body) ** 2) * arm

    @property
    def time(self) -> np.ndarray:
        """Time (N,) s of its instants, of a run that moves."""
        return np.zeros(self.count) if self.trace.time is None else self.trace.time

    @property
    def still(self) -> bool:
        """Whether nothing moves."""
        return self.trace.motion == "static"

    @property
    def moves(self) -> bool:
        """Whether the bodies move, and the trace has their rates."""
        return bool(self.trace.rates) and not self.still

    @property
    def held(self) -> bool:
        """Whether a motor says where the crank is."""
        return self.still or not self.request.schedule.lets_go

    @cached_property
    def driven(self) -> list[Joint]:
        """The joints that are held or moved by a motor, a crank's first."""
        return [self.m.joint(name) for name in self.request.schedule.drives]

    @cached_property
    def size(self) -> float:
        """Length (m) of the longest body."""
        return longest(self.m)

    # ---------------------------------------------------------------- forces

    def load(self, load: Load) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Force (N,) N and torque (N,) N.m of a load, and what of each (N,) is not known: the way of one that opposes
        the motion, at rest, and where its point or its body turns back within a step or half of one.
        """
        none = np.zeros(self.count)
        seen = Seen(self.angle, self.place, self.going, self.spin, lambda: self.time)
        force, torque = (part + none for part in self.m.acting(load, seen))
        if not load.opposes:
            edge = self._edges(load, seen)
            return force, torque, np.where(edge, abs(complex(*load.force)), 0.0), np.where(edge, abs(load.torque), 0.0)
        rates = rises = none, none
        if not self.still:
            rates = np.abs(self.going(load.body, load.point)), self.spin(load.body)
            rises = self.acceleration(load.body, self.arm(load.body, load.point)), self.spin_up(load.body)
        fades = NEVER if self.held else fading(self.m, load)
        step = 2 * (self.trace.step or 0.0) if self.m.displaced else 0.0  # in which what a gap lets go may turn back
        slow = [
            np.abs(rate) <= np.maximum(max(FADING * np.abs(rate).max(initial=0.0), below), step * np.abs(rise))
            for rate, below, rise in zip(rates, fades, rises, strict=True)
        ]
        always = load.model_copy(update={"opposes": False})
        sizes = (np.abs(part) + none for part in self.m.acting(always, seen))
        unsure, hidden = (np.where(here, size, 0.0) for here, size in zip(slow, sizes, strict=True))
        return np.where(slow[0], 0.0, force), np.where(slow[1], 0.0, torque), unsure, hidden

    def _edges(self, load: Load, seen: Seen[np.ndarray]) -> np.ndarray:
        """Where (N,) a load begins or ends, and rounding decides whether it acts."""
        ends = [end for end in (load.start, load.end) if end is not None]
        if not ends:
            return np.zeros(self.count, bool)
        value, unit = self.m.load_quantities[load.over].value(seen), self.m.load_quantities[load.over].unit
        away = [wrapped(value - end) if unit == "rad" else value - end for end in ends]
        return np.asarray(np.min(np.abs(away), axis=0) <= EDGE_ROUNDING * (1.0 + np.abs(value)))

    def springs(self) -> Iterator[tuple[str, str, np.ndarray]]:
        """Body, point and force (N,) N on it of each end of a spring between points."""
        for spring in self.m.springs:
            near, far = spring.ends
            rates = (
                [0.0, 0.0]
                if self.still
                else [self.velocity(body, self.arm(body, point)) for body, point in (near, far)]
            )
            pull = spring.pull(self.place(*far) - self.place(*near), rates[1] - rates[0])
            yield *near, pull
            yield *far, -pull

    def reaction(self, joint: Joint) -> np.ndarray:
        """A joint's reaction (N,) N on its second body."""
        return self.vector(f"reaction_{joint.name}")

    def gap(self, joint: Joint) -> np.ndarray:
        """First pin centre minus second (N,) m."""
        first, second = joint.bodies
        return self.place(first, joint.name) - self.place(second, joint.name)

    def turned(self, joint: Joint) -> np.ndarray:
        """Angle (N,) rad by which a prismatic joint's bodies have turned against each other."""
        first, second = joint.bodies
        return wrapped(self.angle(second) - self.angle(first) - joint.angle)

    def guide(self, joint: Joint) -> Guide | None:
        """The guide of a joint whose block has clearance in this run."""
        return Guide.of(joint) if joint.prismatic and joint.name in self.trace.clearance else None

    def across(self, joint: Joint) -> np.ndarray:
        """Unit vector (N,) across a prismatic joint's axis."""
        return 1j * joint.direction * np.exp(1j * self.angle(joint.bodies[0]))

    def acts_at(self, joint: Joint, body: str) -> np.ndarray:
        """Where a joint's reaction acts on one of its bodies (N,) m: at its own pin, a slide's at the second's
        point, friction's where the pin touches.
        """
        second = self.place(joint.bodies[1], joint.name)
        if joint.prismatic:
            return second
        if self.rubs(joint):
            gap = self.gap(joint)
            return second + gap / np.maximum(np.abs(gap), TINY) * (joint.rim + joint.clearance)
        return self.place(body, joint.name)

    def rubs(self, joint: Joint) -> bool:
        """Whether the joint's contact has friction."""
        return joint.name in self.trace.clearance and self.trace.joint_model == "contact" and joint.friction > 0

    def kink(self, joint: Joint) -> np.ndarray:
        """Force (N,) N that a contact may have at another instant of the step in which its pin touches the rim, or
        leaves it, and the stops of a slide at another instant of any step; 0 elsewhere.

        There an engine may have solved the step with the one, and report the other.
        """
        step, limited = self.trace.step, np.zeros(self.count)
        if joint.prismatic and joint.stops and self.moves:
            along = -1j * self.across(joint)
            apart = self.place(joint.bodies[1], joint.name) - self.place(joint.bodies[0], joint.name)
            moving = [dot(along, self.slip(joint, of)) for of in (self.velocity, self.acceleration)]
            limited = self._striking(joint, dot(along, apart), *moving)
        if (
            joint.name not in self.trace.clearance
            or self.trace.joint_model == "massless-link"
            or self.still
            or not step
        ):
            return limited
        gap, guide = self.gap(joint), self.guide(joint)
        stiffness = contact_parameters(self.m, joint, self.request.motion).stiffness
        if guide is not None:  # of whichever corners
            first, second = joint.bodies
            spin = np.abs(self.spin(second) - self.spin(first))
            inwards = step * (np.abs(dot(self.across(joint), self.slip(joint))) + guide.length / 2 * spin)
            near = np.abs(guide.reach(dot(self.across(joint), gap), self.turned(joint)) - joint.clearance) <= inwards
            return limited + np.where(near, 2 * stiffness * inwards, 0.0)
        inwards = step * np.abs(dot(gap, self.slip(joint))) / np.maximum(np.abs(gap), TINY)
        return np.where(np.abs(np.abs(gap) - joint.clearance) <= inwards, stiffness * inwards, 0.0)

    def turning(self, joint: Joint) -> tuple[np.ndarray, np.ndarray]:
        """Torque (N,) N.m of a joint on its second body beside its force's, and what of it (N,) is not known.

        A slide's moment; a pin's spring, damper and friction.  That is not known at rest, or near a reversal, where
        engines let it fade or stick.
        """
        if joint.prismatic:
            return self.signal(f"reaction_{joint.name}_moment"), np.zeros(self.count)
        first, second = joint.bodies
        rate = self.spin(second) - self.spin(first)
        torque = joint.give(self.angle(second) - self.angle(first), 0.0 * rate if self.still else rate)
        known = np.abs(rate) > FADING * self.pace
        by_load = joint.load_friction(np.abs(self.reaction(joint)))
        dry = (joint.dry(rate) + by_load) * np.sign(rate)
        hidden = np.where(known, 0.0, joint.stiction + by_load)
        if joint.stops:
            hidden = hidden + self._striking(
                joint, self.angle(second) - self.angle(first), rate, self.spin_up(second) - self.spin_up(first)
            )
        return torque - np.where(known, dry, 0.0), hidden

    def _striking(self, joint: Joint, position: np.ndarray, rate: np.ndarray, rise: np.ndarray) -> np.ndarray:
        """Torque or force (N,) that dampers of a joint's stops may have at another instant of a step: all of theirs
        where it strikes them, and what its acceleration ``rise`` (N,) gives them in a step where they push.
        """
        step, unknown = self.trace.step or 0.0, np.zeros(self.count)
        for stop in joint.stops:
            for _, depth in stop.depths(position):
                struck = np.abs(depth) <= 2 * np.abs(rate) * step
                speed = np.where(struck, np.abs(rate), np.where(depth > 0, np.abs(rise) * step, 0.0))
                unknown = unknown + stop.damping * speed
        return unknown

    def driving(self) -> dict[str, np.ndarray]:
        """Torques (N,) N.m that motors, and what else turns a crank over its angle, exert on bodies.

        A slide's motor acts along its axis, where its force is part of the reaction.
        """
        found: dict[str, np.ndarray] = {}
        if self.request.schedule.crank is not None or (self.m.cranked and self.driven):
            torque, periodic = self.signal("drive_torque"), self.m.periodic_torque
            found[self.m.driven] = torque if periodic is None else torque + periodic.at(self.angle(self.m.driven))
            return found
        for joint, signal in zip(self.driven, driving(self.driven) if self.driven else (), strict=True):
            if not joint.prismatic:
                first, second = joint.bodies
                found[second] = found.get(second, 0.0) + self.signal(signal.name)
                found[first] = found.get(first, 0.0) - self.signal(signal.name)
        return found

    @cached_property
    def pace(self) -> float:
        """The largest angular speed (rad/s) in the run; infinite at rest."""
        return np.inf if self.still else max(float(np.abs(self.spin(b.name)).max(initial=0.0)) for b in self.m.bodies)

    @property
    def placed(self) -> bool:
        """Whether the trace says where every body is."""
        return all(f"{b.name}_{each}" in self.trace.signals for b in self.m.bodies for each in ("x", "y", "angle"))

    @property
    def nothing(self) -> float:
        """The force (N) that gives the whole linkage's mass an acceleration of REST: as good as none."""
        return REST * sum(b.mass for b in self.m.bodies)

    @cached_property
    def fastest(self) -> tuple[float, float]:
        """The largest speed (m/s) and acceleration (m/s^2) in the linkage, or thereabouts; where it is pressed, of its
        mass by its largest force.
        """
        rates = [(self.trace.rates[b.name], self.spin(b.name)) for b in self.m.bodies]
        speed = max(float((np.abs(r.velocity) + self.size * np.abs(spin)).max(initial=0.0)) for r, spin in rates)
        turned = [np.abs(r.acceleration) + self.size * (np.abs(r.angular_acceleration) + spin**2) for r, spin in rates]
        pressed = self.largest / sum(b.mass for b in self.m.bodies)
        return speed, max(pressed, *(float(each.max(initial=0.0)) for each in turned))

    @cached_property
    def largest(self) -> float:
        """The largest reaction (N)."""
        return max(float(np.abs(self.reaction(joint)).max(initial=0.0)) for joint in self.m.joints)

    @property
    def rounding(self) -> float:
        """A speed (m/s) that is as good as none: rounding of the linkage's size in a step."""
        step = self.trace.step
        return ROUNDING_OF_SIZE * self.size / step if step else 0.0

    def slip(self, joint: Joint, rate: Callable[[str, np.ndarray], np.ndarray] | None = None) -> np.ndarray:
        """Velocity (or another ``rate``) (N,) of a joint's second body less its first, where its reaction acts
        on them.
        """
        first, second = (
            (rate or self.velocity)(
                body, self.acts_at(joint, body) - (self.place(body, MASS_CENTRE) if body != GROUND else 0.0)
            )
            for body in joint.bodies
        )
        return second - first
