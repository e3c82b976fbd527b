"""Parts of a planar linkage as DART and PyBullet are given them: pins with clearance, and a tree of joint
coordinates.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analytic.mechanism import GROUND, Body, Joint, Mechanism
from sim_models.common.contact_laws import KelvinVoigt, NamedLaw
from sim_models.common.start import AT_REST, Pose
from sim_models.common.track import Track
from sim_models.common.travel import travel
from sim_models.common.tree import Branch, grown, without_loops


def moving_body(m: Mechanism, name: str) -> Body:
    """The moving body of that name."""
    return next(body for body in m.bodies if body.name == name)


@dataclass(frozen=True)
class Pin:
    """A revolute joint with clearance (m), what its contact is made of, and the law that the mechanism names for it;
    without clearance, its soft bearing.
    """

    joint: Joint
    clearance: float
    contact: KelvinVoigt
    law: NamedLaw | None = None

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


@dataclass(frozen=True)
class Steered:
    """A moving body that the motor in a joint moves against what carries it, and the sign of its coordinate there."""

    joint: Joint
    child: str
    sign: float  # of the joint's position, second body relative to first, as that coordinate grows

    @classmethod
    def of(cls, joint: Joint, branches: Sequence[Branch], crank: bool) -> Steered:
        """That of a driven joint; a ``crank`` is told by its own angle, whichever of the joint's bodies it is."""
        child = next(b.child for b in branches if b.joint == joint or {b.child, b.parent} == set(joint.bodies))
        return cls(joint, child, 1.0 if crank or joint.prismatic or joint.bodies[1] == child else -1.0)


def spanning_tree(m: Mechanism, joints: list[Joint], driven: Sequence[Joint]) -> tuple[list[Branch], list[Joint]]:
    """Branches from the ground outwards, made of these joints as far as they close no loop; and those left over.

    Prismatic joints come first, then those ``driven``, then those on the ground.  Where one driven is not among them,
    no other may carry the body that it turns: it floats, on the ground or in the frame of the joint's other body.
    """

    def preferred(some: list[Joint]) -> list[Joint]:
        return sorted(some, key=lambda j: (not j.prismatic, j not in driven, GROUND not in j.bodies))

    tree, rest = without_loops(m, preferred(joints))
    branches = grown(m, tree)
    carried = {branch.child for branch in branches if branch.joint is not None}
    loose = [
        j for j in driven if j not in joints and (len(driven) > 1 or GROUND not in j.bodies or carried & {*j.bodies})
    ]
    standing, left = without_loops(m, preferred([*joints, *loose]))
    afloat = [j for j in loose if j in standing]
    if not afloat:
        return branches, rest
    branches = grown(m, [*afloat, *(j for j in standing if j not in afloat)])
    return [replace(branch, joint=None) if branch.joint in afloat else branch for branch in branches], left


def coordinates(m: Mechanism, branch: Branch, bodies: Mapping[str, Pose]) -> tuple[list[float], list[float]]:
    """A branch's coordinates and their rates: [travel], [relative angle], or [x, y, angle] of the body's frame in its
    parent's.
    """
    here = bodies[branch.child]
    if branch.joint is None:
        if branch.parent != GROUND:
            here = _seen_from(bodies[branch.parent], here)
        rates = [here.velocity.real, here.velocity.imag, here.angular_velocity]
        return [here.origin.real, here.origin.imag, here.angle], rates
    if branch.joint.prismatic:
        a, b = (bodies.get(name, AT_REST) for name in branch.joint.bodies)
        way, rate = travel(m, branch.joint, a, b)
        return [way], [rate]
    base = bodies.get(branch.parent, AT_REST)
    return [here.angle - base.angle], [here.angular_velocity - base.angular_velocity]


def _seen_from(base: Pose, pose: Pose) -> Pose:
    """A pose in the frame of a body that moves, and its rates there."""
    apart, back = pose.origin - base.origin, cmath.exp(-1j * base.angle)
    slip = pose.velocity - base.velocity - 1j * base.angular_velocity * apart
    return Pose(apart * back, pose.angle - base.angle, slip * back, pose.angular_velocity - base.angular_velocity)


Coordinates = (
    Sequence[complex] | Sequence[np.ndarray] | np.ndarray
)  # of a branch, as :func:`coordinates` has them: (k,), or (k, M)
BranchMotion = tuple[Coordinates, ...]  # of a branch: its coordinates, their rates, and perhaps accelerations
Points = Mapping[tuple[str, str], complex]  # m, by body and name, in the body's frame
STILL = Track()


def tracks(
    points: Points, branches: Iterable[Branch], motions: Mapping[str, BranchMotion], ground: Track = STILL
) -> dict[str, Track]:
    """The track of every body, and of the ground, by the motions of their branches, parents first."""
    out = {GROUND: ground}
    for branch in branches:
        out[branch.child] = hung(points, branch, out[branch.parent], *motions[branch.child])
    return out


def hung(
    points: Points,
    branch: Branch,
    base: Track,
    where: Coordinates,
    rates: Coordinates,
    changes: Coordinates = (0.0, 0.0, 0.0),
) -> Track:
    """A branch's child on its parent's track, by its coordinates (see :func:`coordinates`), their rates and
    accelerations.
    """
    if branch.joint is None:
        flat = (each[0] + 1j * each[1] for each in (where, rates, changes))
        return base.slid(1.0, *flat).carried(0j, 0j, where[2], rates[2], changes[2])
    at, point = points[branch.parent, branch.joint.name], points[branch.child, branch.joint.name]
    if branch.joint.prismatic:
        return base.carried(at, point, branch.fixed_angle).slid(branch.axis, where[0], rates[0], changes[0])
    return base.carried(at, point, where[0], rates[0], changes[0])
