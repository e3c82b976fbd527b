"""A trace's bodies, joints and forces at its instants, in the mechanism's words, for those who check what a run must be."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Body, Joint
from sim_models.contact_laws import PIN_RADIUS, contact_parameters
from sim_models.engine import Request, Trace

FADING = 1e-2  # of the largest angular speed: slower joints may have let their Coulomb friction fade


class Seen:
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
        return np.zeros(self.count, complex) if body == GROUND else self.trace.rates[body].velocity + 1j * self.spin(body) * arm

    def acceleration(self, body: str, arm: np.ndarray) -> np.ndarray:
        """Acceleration (N,) m/s^2 of such a point."""
        if body == GROUND:
            return np.zeros(self.count, complex)
        return self.trace.rates[body].acceleration + (1j * self.spin_up(body) - self.spin(body) ** 2) * arm

    @property
    def still(self) -> bool:
        """Whether nothing moves."""
        return self.trace.motion == "static"

    @cached_property
    def size(self) -> float:
        """Length (m) of the longest body."""
        return max(body.length for body in self.m.bodies)

    # ---------------------------------------------------------------- forces

    def reaction(self, joint: Joint) -> np.ndarray:
        """A joint's reaction (N,) N on its second body."""
        return self.vector(f"reaction_{joint.name}")

    def gap(self, joint: Joint) -> np.ndarray:
        """First pin centre minus second (N,) m."""
        first, second = joint.bodies
        return self.place(first, joint.name) - self.place(second, joint.name)

    def acts_at(self, joint: Joint, body: str) -> np.ndarray:
        """Where a joint's reaction acts on one of its bodies (N,) m: at its own pin, a slide's at the second's
        point, friction's where the pin touches.
        """
        second = self.place(joint.bodies[1], joint.name)
        if joint.prismatic:
            return second
        if self.rubs(joint):
            gap = self.gap(joint)
            return second + gap / np.maximum(np.abs(gap), 1e-300) * ((joint.pin_radius or PIN_RADIUS) + joint.clearance)
        return self.place(body, joint.name)

    def rubs(self, joint: Joint) -> bool:
        """Whether the joint's contact has friction."""
        return joint.name in self.trace.clearance and self.trace.joint_model == "contact" and joint.friction > 0

    def kink(self, joint: Joint) -> np.ndarray:
        """Force (N,) N that a contact may have at another instant of the step in which its pin touches the rim, or leaves it; 0 elsewhere.

        There an engine may have solved the step with the one, and report the other.
        """
        step = self.trace.settings.get("step")
        if joint.name not in self.trace.clearance or self.still or not step:
            return np.zeros(self.count)
        gap = self.gap(joint)
        moved = step * np.abs(self.slip(joint))
        stiffness = contact_parameters(self.m, joint, self.request.motion).stiffness
        return np.where(np.abs(np.abs(gap) - joint.clearance) <= moved, stiffness * moved, 0.0)

    def law(self, joint: Joint) -> tuple[np.ndarray, np.ndarray]:
        """Torque (N,) N.m of a revolute joint's spring, damper and friction on its second body, and what of it (N,) is not known.

        Friction is not known at rest, or near a reversal of the joint, where engines let it fade or stick.
        """
        first, second = joint.bodies
        rate = self.spin(second) - self.spin(first)
        torque = -joint.stiffness * (self.angle(second) - self.angle(first) - joint.rest_angle) - joint.damping * rate
        known = np.abs(rate) > FADING * self.pace
        return torque - np.where(known, joint.coulomb * np.sign(rate), 0.0), np.where(known, 0.0, joint.coulomb)

    @cached_property
    def pace(self) -> float:
        """The largest angular speed (rad/s) in the run; infinite at rest."""
        return np.inf if self.still else max(float(np.abs(self.spin(b.name)).max(initial=0.0)) for b in self.m.bodies)

    @cached_property
    def drive_torque(self) -> np.ndarray:
        """Torque (N,) N.m of the motor on the driven body."""
        return self.signal("drive_torque")

    def slip(self, joint: Joint, rate: Callable[[str, np.ndarray], np.ndarray] | None = None) -> np.ndarray:
        """Velocity (or another ``rate``) (N,) of a joint's second body less its first, where its reaction acts on them."""
        first, second = (
            (rate or self.velocity)(body, self.acts_at(joint, body) - (self.place(body, MASS_CENTRE) if body != GROUND else 0.0))
            for body in joint.bodies
        )
        return second - first
