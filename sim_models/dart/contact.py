"""A journal in a bearing for DART's own contact solver."""

from __future__ import annotations

from collections.abc import Iterable
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analytic.mechanism import Mechanism
from sim_models.common.contact_laws import lighter_mass, restitution
from sim_models.leapfrog.parts import Pin

if TYPE_CHECKING:
    from dartpy.collision import Contact
    from dartpy.dynamics import BodyNode

REBOUND = 0.1  # m/s, DART's own: a pin that would leave its rim more slowly stays there
TOUCHING_RIM = 1e-9  # of the clearance: how far inside the rim a pin counts as touching
# of the clearance: a pin pressed to the rim in the last step that is no farther inside has not been lifted off
HOLD = 1e-2
BACK_ON_RIM = 1e-5  # the same: farther inside than this, by the curvature of a step, it is put back on the rim
TOUCH = 1e-13  # m, penetration that makes DART see a contact
ANVIL = 0.1  # m, radius of the sphere that stands in for the bearing where the journal meets it
SHAPE_SPACING = 1.0  # m along z between the shapes of one joint and the next, which must not meet


def vector(z: complex) -> np.ndarray:
    """A planar vector x + iy in DART's three dimensions."""
    return np.array([z.real, z.imag, 0.0])


def plane(v: NDArray[np.float64]) -> complex:
    """The planar part x + iy of a DART vector (3,)."""
    x, y, _ = v.tolist()
    return complex(x, y)


class Bearing:
    """A journal in a bearing for DART's contact solver: a sphere on the second body, an anvil on the first.

    The anvil, a larger sphere, is put where the journal meets its circle before each step, so the contact has the place
    and the normal of a circle in a circle at the positions from which DART starts the step.  What happens in contact is
    DART's: no speed into the bearing, and Newton's restitution where that gives a rebound faster than REBOUND.
    Friction is left out (DART's default is 1).
    """

    def __init__(
        self,
        dynamics: ModuleType,
        pin: Pin,
        rebound: float,
        bodies: tuple[BodyNode, BodyNode],
        points: tuple[complex, complex],
        level: float,
    ) -> None:
        """``bodies`` are the joint's two in DART, ``points`` (m) their pin centres in their frames, ``rebound`` is the
        restitution, ``level`` (m) the place of the shapes along z.
        """
        self.pin, self.restitution, self.level = pin, rebound, level
        self.reach = pin.joint.rim + ANVIL
        self.first, second = bodies
        self.centre, at = points
        self.held = False  # whether the journal was pressed to the rim in the last step
        self.anvil = self.first.createShapeNode(dynamics.SphereShape(ANVIL))
        self.journal = second.createShapeNode(dynamics.SphereShape(self.reach - ANVIL))
        for shape, bounce in ((self.anvil, 1.0), (self.journal, self.restitution)):
            shape.createCollisionAspect()
            shape.createDynamicsAspect()
            shape.getDynamicsAspect().setFrictionCoeff(0.0)
            shape.getDynamicsAspect().setRestitutionCoeff(bounce)
        self.journal.setRelativeTranslation([at.real, at.imag, self.level])

    def arrive(self, gap: complex) -> None:
        """Take note of where the pin was placed (m)."""
        self.held = abs(gap) > self.pin.clearance * (1 - TOUCHING_RIM)

    def lifted(self, gap: complex) -> complex:
        """By how much (m) the curvature of the steps, not a force, has taken a pin with this gap (m) off its rim."""
        inside = self.pin.clearance - abs(gap)
        return inside * gap / abs(gap) if self.held and BACK_ON_RIM < inside / self.pin.clearance < HOLD else 0j

    def face(self, gap: complex) -> None:
        """Put the anvil where the journal, with this gap (m), meets its circle, or out of the way where it does not."""
        depth = abs(gap) - self.pin.clearance
        touching = depth > -self.pin.clearance * (HOLD if self.held else TOUCHING_RIM)
        outwards = gap + gap / abs(gap) * (self.reach - max(depth, TOUCH)) if touching else 2 * self.reach + 0j
        turned = self.first.getTransform().rotation()[:2, 0].tolist()
        at = self.centre - outwards * complex(turned[0], -turned[1])
        self.anvil.setRelativeTranslation([at.real, at.imag, self.level])

    def force(self, contacts: Iterable[Contact]) -> complex:
        """Contact force (N) on the second body in the last step, among DART's ``contacts`` of it."""
        total = 0j
        for contact in contacts:
            if abs(contact.point[2] - self.level) < SHAPE_SPACING / 2:
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
