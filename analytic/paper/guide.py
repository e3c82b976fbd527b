"""Where a block with clearance rests in its guide: Eq. 8 for a prismatic joint.

The block's point lies y off the middle of the guide and the block is turned by phi.  No corner enters a wall while

    |y| + (L/2) |sin phi| + (h/2) cos phi <= c + h/2,

which to first order is |y| + (L/2) |phi| <= c: a diamond with two flat and two tilted corners.  The guide pushes the
block with a force N normal to its axis and a moment M about the block's point.  With y and phi counted guide less block
(first body less second, as a pin's gap), these do the most work at a corner of the diamond:

    flat     y = c sign N, phi = 0: both corners of one side on one wall, where |M| < |N| L/2;
    tilted   y = 0, phi = 2 (c/L) sign M: one corner on each wall, at opposite ends, where |M| > |N| L/2.

With friction each corner that is pushed by P is rubbed by mu P along the guide, against its sliding, h/2 to the side of
the block's point; the force along is then -s mu sum(P), s the sign of the sliding, and the moment of the walls alone is
M + s mu (h/2) N, whichever corners they are.  That takes M's place above, and

    sum(P) = max(|N|, (2/L) |M + s mu (h/2) N|),

of which N and M in their turn depend on the force along the guide, linearly.  (Which corners bear what N and M ask of
them is what counts; with friction that is no question of work.)

With finite clearance the block tilts a little less or more than 2 c/L as its height is, and the lever of a tilted
block's corners is a little shorter than L/2: near the border it may rest either way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from analytic.kinematics.motion import Motion
from analytic.kinematics.structure import BlockRest, BlockRests
from analytic.mechanism import Joint, Mechanism, MechanismError

FLAT, TILTED = 1.0, 2.0  # how a block rests: times the sign of the force, or of the moment


class BlockReactions(Protocol):
    """What a block has to know of :class:`analytic.paper.kinetostatics.Reactions`."""

    @property
    def motion(self) -> Motion: ...
    @property
    def forces(self) -> Mapping[str, np.ndarray]: ...
    @property
    def moments(self) -> Mapping[str, np.ndarray]: ...


@dataclass(frozen=True)
class GuidedBlock:
    """The block of a prismatic joint with half the play ``clearance`` (m) in its guide."""

    joint: Joint
    clearance: float
    length: float  # m, along the axis
    height: float  # m

    @classmethod
    def of(cls, mechanism: Mechanism, name: str, clearance: float) -> GuidedBlock:
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

    def aside(self, how: float) -> float:
        """Distance (m) across from the block's point to where friction rubs it that rests ``how``."""
        return self.height / 2 + (self.clearance if abs(how) == TILTED else 0.0)

    def across(self, motion: Motion) -> np.ndarray:
        """Unit vector (N,) across the guide: the axis turned by a right angle."""
        along = motion.columns[motion.structure.body_column(self.joint.bodies[0])]
        return 1j * self.joint.direction * along

    def push(self, motion: Motion, force: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """Force (N,) N across the guide plus i times moment (N.m) over L/2: what these do of work on the block's place
        y + i (L/2) phi, each with each; of the joint's reaction, or of one to a unit load.
        """
        return (force * np.conj(self.across(motion))).real + 2j / self.length * moment

    def pushed(self, reactions: BlockReactions, aside: float | None = None) -> np.ndarray:
        """What :meth:`push` gives (N,) for the walls alone, without the moment of friction ``aside`` (m) of the block's
        point: half the height by default.
        """
        push = self.push(reactions.motion, reactions.forces[self.joint.name], reactions.moments[self.joint.name])
        if not self.joint.friction:
            return push
        aside = self.height / 2 if aside is None else aside
        return np.asarray(push + 2j / self.length * aside * self.rub(reactions.motion) * push.real)

    def rub(self, motion: Motion) -> np.ndarray:
        """Force (N,) along the guide that friction takes from the block, of a unit push of a wall: the coefficient with
        the sign of the sliding.
        """
        return self.joint.friction * motion.slip_sign(self.joint)

    def work(self, reactions: BlockReactions) -> tuple[np.ndarray, np.ndarray]:
        """Work (N,) N.m that force and moment do on the way from the middle to where they rest flat, and tilted."""
        push = self.clearance * self.pushed(reactions)
        return np.abs(push.real), np.abs(push.imag)

    def rests(self, reactions: BlockReactions) -> np.ndarray:
        """How (N,) the block rests under these reactions, to first order: FLAT or TILTED, with a sign."""
        push = self.pushed(reactions)
        flat = np.abs(push.real) >= np.abs(push.imag)
        return np.where(flat, FLAT * np.copysign(1.0, push.real), TILTED * np.copysign(1.0, push.imag))

    def stays(self, how: np.ndarray, reactions: BlockReactions) -> np.ndarray:
        """Whether (N,) all corners on which a block rests ``how`` (N,) push it, under these reactions of the linkage
        that it displaces.
        """
        ways = [self.pushed(reactions, self.aside(each)) for each in (FLAT, TILTED)]
        push = np.copysign(1.0, how) * np.where(np.abs(how) == FLAT, *ways)
        force, moment = push.real, self.length / 2 * push.imag
        flat = (force > 0) & (np.abs(moment) <= self.length / 2 * force)
        tilted = (moment > 0) & (self.lever * np.abs(force) <= moment)
        return np.where(np.abs(how) == FLAT, flat, tilted)

    def place(self, how: float, finite: bool) -> BlockRest:
        """Where the block rests, second body relative to first; tilted to first order, or ``finite``."""
        if abs(how) == FLAT:
            return BlockRest(-math.copysign(self.clearance, how), 0.0)
        return BlockRest(0.0, -math.copysign(self.tilt if finite else 2 * self.clearance / self.length, how))


def placed(blocks: Mapping[str, GuidedBlock], how: np.ndarray, finite: bool) -> BlockRests:
    """Where blocks rest that rest ``how`` (blocks,)."""
    return {name: block.place(each, finite) for (name, block), each in zip(blocks.items(), how.tolist(), strict=True)}


def direction(how: np.ndarray) -> np.ndarray:
    """Where (N,) blocks are that rest ``how`` (N,), as a unit of y + i (L/2) phi."""
    return np.copysign(1.0, how) * np.where(np.abs(how) == FLAT, 1.0, 1j)
