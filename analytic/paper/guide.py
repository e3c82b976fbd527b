"""Where a block with clearance rests in its guide: Eq. 8 for a prismatic joint.

The block's point lies y off the middle of the guide and the block is turned by phi.  No corner enters a wall while

    |y| + (L/2) |sin phi| + (h/2) cos phi <= c + h/2,

which to first order is |y| + (L/2) |phi| <= c: a diamond with two flat and two tilted corners.  The guide pushes the
block with a force N normal to its axis and a moment M about the block's point.  With y and phi counted guide less block
(first body less second, as a pin's gap), these do the most work at a corner of the diamond:

    flat     y = c sign N, phi = 0: both corners of one side on one wall, where |M| < |N| L/2;
    tilted   y = 0, phi = 2 (c/L) sign M: one corner on each wall, at opposite ends, where |M| > |N| L/2.

With finite clearance the block tilts a little less or more than 2 c/L as its height is, and the lever of a tilted
block's corners is a little shorter than L/2: near the border it may rest either way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analytic.kinematics.motion import Motion
from analytic.kinematics.structure import Rest, Rests
from analytic.mechanism import Joint, Mechanism, MechanismError
from analytic.paper.kinetostatics import Reactions

FLAT, TILTED = 1.0, 2.0  # how a block rests: times the sign of the force, or of the moment


@dataclass(frozen=True)
class Block:
    """The block of a prismatic joint with half the play ``clearance`` (m) in its guide."""

    joint: Joint
    clearance: float
    length: float  # m, along the axis
    height: float  # m

    @classmethod
    def of(cls, mechanism: Mechanism, name: str, clearance: float) -> Block:
        """The block of a joint with that clearance (m).  Raises MechanismError without ``guide``."""
        joint = mechanism.joint(name)
        if joint.guide is None:
            raise MechanismError(
                f"{mechanism.name}: joint {name!r} has no guide; give it guide = [length, height] (m) of its block"
            )
        return cls(joint, clearance, *joint.guide)

    @cached_property
    def tilt(self) -> float:
        """Angle (rad) at which opposite corners touch both walls: (L/2) sin phi + (h/2) cos phi = c + h/2."""
        across = math.hypot(self.length, self.height) / 2
        return math.asin((self.clearance + self.height / 2) / across) - math.atan2(self.height, self.length)

    @property
    def lever(self) -> float:
        """Distance (m) along the axis from the block's point to the corners that touch when it is tilted."""
        return (self.length * math.cos(self.tilt) - self.height * math.sin(self.tilt)) / 2

    def across(self, found: Reactions) -> np.ndarray:
        """Force (N,) N of the guide on the block, or of the joint's first body on its second, normal to the axis."""
        return (found.forces[self.joint.name] * np.conj(self.normal(found.motion))).real

    def normal(self, motion: Motion) -> np.ndarray:
        """Unit vector (N,) across the guide: the axis turned by a right angle."""
        along = motion.columns[motion.structure.body_column(self.joint.bodies[0])]
        return 1j * self.joint.direction * along

    def work(self, found: Reactions) -> tuple[np.ndarray, np.ndarray]:
        """Work (N,) N.m that force and moment do on the way from the middle to where they rest flat, and tilted."""
        lean = 2 * self.clearance / self.length
        return self.clearance * np.abs(self.across(found)), lean * np.abs(found.moments[self.joint.name])

    def rests(self, found: Reactions) -> np.ndarray:
        """How (N,) the block rests under these reactions, to first order: FLAT or TILTED, with a sign."""
        flat, tilted = self.work(found)
        force, moment = self.across(found), found.moments[self.joint.name]
        return np.where(flat >= tilted, FLAT * np.copysign(1.0, force), TILTED * np.copysign(1.0, moment))

    def stays(self, how: np.ndarray, found: Reactions) -> np.ndarray:
        """Whether (N,) all corners on which a block rests ``how`` (N,) push it, under these reactions of the linkage
        that it displaces.
        """
        force, moment = (
            np.copysign(1.0, how) * self.across(found),
            np.copysign(1.0, how) * found.moments[self.joint.name],
        )
        flat = (force > 0) & (np.abs(moment) <= self.length / 2 * force)
        tilted = (moment > 0) & (self.lever * np.abs(force) <= moment)
        return np.where(np.abs(how) == FLAT, flat, tilted)

    def place(self, how: float, finite: bool) -> Rest:
        """Where the block rests, second body relative to first; tilted to first order, or ``finite``."""
        if abs(how) == FLAT:
            return Rest(-math.copysign(self.clearance, how), 0.0)
        return Rest(0.0, -math.copysign(self.tilt if finite else 2 * self.clearance / self.length, how))


def placed(blocks: Mapping[str, Block], how: np.ndarray, finite: bool) -> Rests:
    """Where blocks rest that rest ``how`` (blocks,)."""
    return {name: block.place(each, finite) for (name, block), each in zip(blocks.items(), how.tolist(), strict=True)}
