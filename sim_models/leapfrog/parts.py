"""Parts of a planar linkage as DART and PyBullet are given them: pins with clearance, and a tree of joint
coordinates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import GROUND, Body, Joint, Mechanism
from sim_models.common.contact_laws import KelvinVoigt
from sim_models.common.start import AT_REST, Pose
from sim_models.common.travel import travel


def moving_body(m: Mechanism, name: str) -> Body:
    """The moving body of that name."""
    return next(body for body in m.bodies if body.name == name)


@dataclass(frozen=True)
class Pin:
    """A revolute joint with clearance (m) and what its contact is made of."""

    joint: Joint
    clearance: float
    contact: KelvinVoigt

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


@dataclass(frozen=True)
class Branch:
    """A body and what it hangs on: its parent by a tree joint, or the ground with all three freedoms (no joint)."""

    child: str
    parent: str
    joint: Joint | None

    @property
    def forward(self) -> bool:
        """Whether the child is the joint's second body."""
        return self.joint is not None and self.child == self.joint.bodies[1]

    @property
    def fixed_angle(self) -> float:
        """Angle (rad) of the child minus its parent's that a prismatic joint keeps."""
        if self.joint is None or not self.joint.prismatic:
            return 0.0
        return self.joint.angle if self.forward else -self.joint.angle

    @property
    def axis(self) -> complex:
        """Direction in the child's frame along which it moves as a prismatic joint's travel grows."""
        assert self.joint is not None
        return self.joint.direction * np.exp(-1j * self.fixed_angle) if self.forward else -self.joint.direction


def spanning_tree(m: Mechanism, joints: list[Joint]) -> tuple[list[Branch], list[Joint]]:
    """Branches from the ground outwards, made of these joints as far as they close no loop; and those left over.

    Prismatic joints come first, then the drive's, then those on the ground.
    """
    part = {name: name for name in (GROUND, *(b.name for b in m.bodies))}
    tree: list[Joint] = []
    rest: list[Joint] = []
    for joint in sorted(joints, key=lambda j: (not j.prismatic, j is not m.drive_joint, GROUND not in j.bodies)):
        a, b = (part[name] for name in joint.bodies)
        (rest if a == b else tree).append(joint)
        part = {name: b if p == a else p for name, p in part.items()}
    placed = {GROUND}
    branches: list[Branch] = []
    while len(branches) < len(m.bodies):
        next_joint = next((j for j in tree if len(placed & set(j.bodies)) == 1), None)
        if next_joint is not None:
            child, parent = sorted(next_joint.bodies, key=lambda name: name in placed)
        else:
            adrift = [b.name for b in m.bodies if b.name not in placed]
            child, parent = m.driven if m.driven in adrift else adrift[0], GROUND
        branches.append(Branch(child, parent, next_joint))
        placed.add(child)
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
