"""Coulomb friction that grows with reactions, which depend on it in their turn: of pins, and of blocks in their guides.

A pin that is pressed by its reaction F is rubbed by a torque t = -s r |F|, s the sign of its slip and r the radius of
its friction circle.  One with clearance c touches its bearing where friction, mu N along the rim, and push N make F:
the angle of friction to the side of F.  It is rubbed at its radius r by s mu/sqrt(1 + mu^2) r |F|, and the bearing at
r + c.  A block is rubbed by a force t = -s mu sum(P) along its guide, P the pushes of its corners (see
:mod:`analytic.paper.guide`); one without clearance is that of a clearance that goes to 0.

Reactions answer linearly to every t: with each joint's load w_i, of which a size |w_i| rubs it, w_i = w0_i + sum of
D_ij t_j.  Newton's method from t = 0 finds t_i + s_i r_i |w_i| = 0.  The solution that grows out of r = 0 is the one
with a positive determinant of its derivative; where there is none the linkage locks itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.motion import Motion
from analytic.mechanism import Joint
from analytic.paper.guide import FLAT, BlockReactions, GuidedBlock

FRICTION_SETTLED = 1e-12  # of the largest load's friction: the last step that is worth taking
FRICTION_PASSES = 60  # of Newton's method


@dataclass(frozen=True)
class Rubbing:
    """A joint that rubs: its pin, with clearance (m) or without, or its block, which rests one ``way`` in its guide
    with the levers of its finite clearance; without one as its reaction asks it to, to first order.
    """

    joint: Joint
    block: GuidedBlock | None = None
    way: float | None = None
    clearance: float = 0.0

    @property
    def coefficient(self) -> float:
        """Friction (N.m; block: N) by N of the load."""
        if self.block is not None:
            return self.joint.friction
        if not self.clearance:
            return self.joint.load_coefficient
        return self.joint.friction_radius + self.joint.rim * self.beside

    @property
    def beside(self) -> float:
        """Sine of the angle of friction."""
        return math.sin(math.atan(self.joint.friction))

    @property
    def sides(self) -> tuple[float, float]:
        """What a unit of a pin's does on the first body and on the second."""
        return -1.0, 1.0 + self.clearance * self.beside / self.coefficient

    def load(self, reactions: BlockReactions) -> np.ndarray:
        """What presses it (N,) N, complex: the pin's reaction, or across a block and, over L/2, what turns it."""
        if self.block is None:
            return reactions.forces[self.joint.name]
        return self.block.pushed(reactions, None if self.way is None else self.block.aside(self.way))

    def toward(self, load: np.ndarray) -> np.ndarray:
        """Unit (N,) along which that rubs: the derivative of its size, complex."""
        if self.block is None:
            return np.asarray(load / np.maximum(np.abs(load), np.finfo(float).tiny))
        if self.way is None:
            flat = np.abs(load.real) >= np.abs(load.imag)
            return np.where(flat, np.copysign(1.0, load.real), 1j * np.copysign(1.0, load.imag))
        lever = 1.0 if abs(self.way) == FLAT else 1j * self.block.length / 2 / self.block.lever
        return np.full(load.shape, np.copysign(1.0, self.way) * lever, complex)


def lean(motion: Motion, joint: Joint) -> np.ndarray:
    """Angle (N,) rad by which a pin with clearance lies beside its reaction: that of the friction in its contact."""
    return math.atan(joint.friction) * motion.slip_sign(joint)


def friction(
    reactions: BlockReactions,
    units: Sequence[BlockReactions],
    rubbing: Sequence[Rubbing],
    grip: np.ndarray | float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Friction (joints, N) N.m, N on the second bodies of joints that rub, beside what gives these reactions without,
    and where (N,) there is none, as it locks the linkage.

    ``units`` are the reactions to a unit of each; ``grip`` is the share of the friction that acts.
    """
    motion, count = reactions.motion, len(rubbing)
    given = np.stack([each.load(reactions) for each in rubbing], axis=-1)
    answers = np.stack([np.stack([each.load(unit) for unit in units], axis=-1) for each in rubbing], axis=1)
    coefficient = np.array([each.coefficient for each in rubbing])
    radius = np.stack([each.coefficient * grip * motion.slip_sign(each.joint) for each in rubbing], axis=-1)
    known = np.isfinite(given).all(axis=1)
    given = np.where(known[:, None], given, 0.0)
    size = np.abs(given).max(axis=1)
    out = np.zeros((motion.theta.size, count))
    settled = np.zeros(motion.theta.size, bool)
    for _ in range(FRICTION_PASSES):
        load = given + np.einsum("nij,nj->ni", answers, out)
        toward = np.stack([each.toward(load[:, i]) for i, each in enumerate(rubbing)], axis=-1)
        miss = out + radius * (np.conj(toward) * load).real
        slope = np.eye(count) + radius[..., None] * (np.conj(toward)[..., None] * answers).real
        with np.errstate(all="ignore"):
            growing = np.linalg.det(slope) > 0
            change = np.linalg.solve(np.where(growing[:, None, None], slope, np.eye(count)), miss[..., None])[..., 0]
        out = out - change
        size = np.maximum(size, np.abs(load).max(axis=1))
        settled = (np.abs(change) / coefficient).max(axis=1) <= FRICTION_SETTLED * size
        settled &= growing
        if settled.all():
            break
    return out.T, ~settled & known
