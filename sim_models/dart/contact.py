"""A journal in a bearing for DART's own contact solver."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from analytic.mechanism import GROUND, Mechanism
from sim_models.common.contact_laws import PIN_RADIUS, lighter_mass, restitution
from sim_models.leapfrog.parts import Pin

if TYPE_CHECKING:
    from sim_models.dart.world import DartWorld

RIM = 1e-9  # of the clearance: how far inside the rim a pin counts as touching
# of the clearance: a pin pressed to the rim in the last step that is no farther inside has not been lifted off
HOLD = 1e-2
SEAT = 1e-5  # the same: farther inside than this, by the curvature of a step, it is put back on the rim
TOUCH = 1e-13  # m, penetration that makes DART see a contact
ANVIL = 0.1  # m, radius of the sphere that stands in for the bearing where the journal meets it
FLOOR = 1.0  # m along z between the shapes of one joint and the next, which must not meet


def vector(z: complex) -> np.ndarray:
    """A planar vector x + iy in DART's three dimensions."""
    return np.array([z.real, z.imag, 0.0])


def plane(v: Any) -> complex:
    """The planar part x + iy of a DART vector."""
    x, y, _ = v.tolist()
    return complex(x, y)


class Bearing:
    """A journal in a bearing for DART's contact solver: a sphere on the second body, an anvil on the first.

    The anvil, a larger sphere, is put where the journal meets its circle before each step, so the contact has the place
    and the normal of a circle in a circle at the positions from which DART starts the step.  What happens in contact is
    DART's: no speed into the bearing, and Newton's restitution above 0.1 m/s.  Friction is left out (DART's default is
    1).
    """

    def __init__(self, world: DartWorld, name: str, floor: int) -> None:
        self.world, self.pin = world, world.pins[name]
        dynamics = world.dart.dynamics
        joint = self.pin.joint
        self.reach = (joint.pin_radius or PIN_RADIUS) + ANVIL
        self.restitution = rebound(world.mechanism, self.pin)
        self.level = FLOOR * floor
        self.first, second = (world.nodes[body] if body != GROUND else world.stand() for body in joint.bodies)
        self.centre, at = (world.points[body, name] for body in joint.bodies)
        self.anvil = self.first.createShapeNode(dynamics.SphereShape(ANVIL))
        self.journal = second.createShapeNode(dynamics.SphereShape(self.reach - ANVIL))
        for shape, bounce in ((self.anvil, 1.0), (self.journal, self.restitution)):
            shape.createCollisionAspect()
            shape.createDynamicsAspect()
            shape.getDynamicsAspect().setFrictionCoeff(0.0)
            shape.getDynamicsAspect().setRestitutionCoeff(bounce)
        self.journal.setRelativeTranslation([at.real, at.imag, self.level])

    def arrive(self) -> None:
        """Take note of where the pin was placed."""
        self.held = abs(self.world.gap(self.pin.joint.name)[0]) > self.pin.clearance * (1 - RIM)

    def seat(self) -> None:
        """Put a pin back on the rim from which the curvature of the steps, not a force, has taken it."""
        gap = self.world.gap(self.pin.joint.name)[0]
        inside = self.pin.clearance - abs(gap)
        if self.held and SEAT < inside / self.pin.clearance < HOLD:
            self.world.nudge(self.pin.joint, inside * gap / abs(gap))

    def face(self) -> None:
        """Put the anvil where the journal meets its circle, or out of the way where it does not."""
        gap = self.world.pin_gaps[self.pin.joint.name] = self.world.gap(self.pin.joint.name)[0]
        depth = abs(gap) - self.pin.clearance
        touching = depth > -self.pin.clearance * (HOLD if self.held else RIM)
        outwards = gap + gap / abs(gap) * (self.reach - max(depth, TOUCH)) if touching else 2 * self.reach + 0j
        turned = self.first.getTransform().rotation()[:2, 0].tolist()
        at = self.centre - outwards * complex(turned[0], -turned[1])
        self.anvil.setRelativeTranslation([at.real, at.imag, self.level])

    def force(self) -> complex:
        """Contact force (N) on the second body in the last step."""
        total = 0j
        for contact in self.world.world.getLastCollisionResult().getContacts():
            if abs(contact.point[2] - self.level) < FLOOR / 2:
                on_first = contact.collisionObject1.getShapeFrame() == self.journal
                total += plane(contact.force) * (1 if on_first else -1)
        self.held = total != 0
        return total


def rebound(mechanism: Mechanism, pin: Pin) -> float:
    """Restitution of a joint's contact: as given, or what its stiffness and damping deliver to the lighter link."""
    if pin.joint.restitution is not None:
        return pin.joint.restitution
    mass = lighter_mass(mechanism, pin.joint)
    return restitution(pin.contact.damping / (2 * np.sqrt(pin.contact.stiffness * mass)))
