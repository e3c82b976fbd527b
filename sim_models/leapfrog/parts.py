"""Parts of a planar linkage as DART and PyBullet are given them: pins with clearance, and a tree of joint
coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from analytic.mechanism import GROUND, Body, Joint, Mechanism
from sim_models.common.contact_laws import KelvinVoigt
from sim_models.common.start import AT_REST, Pose
from sim_models.common.travel import travel
from sim_models.common.tree import Branch, grown, without_loops


def moving_body(m: Mechanism, name: str) -> Body:
    """The moving body of that name."""
    return next(body for body in m.bodies if body.name == name)


@dataclass(frozen=True)
class Pin:
    """A revolute joint with clearance (m) and what its contact is made of; without clearance, its soft bearing."""

    joint: Joint
    clearance: float
    contact: KelvinVoigt

    def spring(self, gap: complex, rate: complex) -> complex:
        """Force (N) on the second body of a soft bearing: K gap + C rate (m, m/s)."""
        return self.contact.stiffness * gap + self.contact.damping * rate

    def spring_damper(self, gap: complex, rate: complex) -> complex:
        """Force (N) on the second body: max(0, K d + C d') along the gap (m) outside the clearance."""
        reach = abs(gap)
        depth = reach - self.clearance
        if depth <= 0:
            return 0j
        normal = gap / reach
        size = self.contact.stiffness * depth + self.contact.damping * (
            rate.real * normal.real + rate.imag * normal.imag
        )
        return size * normal if size > 0 else 0j


def spanning_tree(m: Mechanism, joints: list[Joint]) -> tuple[list[Branch], list[Joint]]:
    """Branches from the ground outwards, made of these joints as far as they close no loop; and those left over.

    Prismatic joints come first, then the drive's, then those on the ground.  Where the drive's is not among them, no
    other may carry the driven body: it floats.
    """
    drive = m.drive_joint

    def preferred(some: list[Joint]) -> list[Joint]:
        return sorted(some, key=lambda j: (not j.prismatic, j is not drive, GROUND not in j.bodies))

    tree, rest = without_loops(m, preferred(joints))
    branches = grown(m, tree)
    hangs_by = next(b.joint for b in branches if b.child == m.driven)
    if hangs_by is not None and drive not in joints:
        standing, left = without_loops(m, preferred([*joints, drive]))
        if drive in standing:
            return grown(m, [j for j in standing if j is not drive], m.driven), left
    return branches, rest


def coordinates(m: Mechanism, branch: Branch, bodies: Mapping[str, Pose]) -> tuple[list[float], list[float]]:
    """A branch's coordinates and their rates: [travel], [relative angle], or [x, y, angle] of the body's frame."""
    here = bodies[branch.child]
    if branch.joint is None:
        rates = [here.velocity.real, here.velocity.imag, here.angular_velocity]
        return [here.origin.real, here.origin.imag, here.angle], rates
    if branch.joint.prismatic:
        a, b = (bodies.get(name, AT_REST) for name in branch.joint.bodies)
        way, rate = travel(m, branch.joint, a, b)
        return [way], [rate]
    base = bodies.get(branch.parent, AT_REST)
    return [here.angle - base.angle], [here.angular_velocity - base.angular_velocity]
