"""A block with clearance in its guide: where its corners are, and how far they are from the walls.

The block is on the second body of a prismatic joint, about its point; the guide's walls are on the first.  Across is
the joint's axis turned by a right angle.  The block's height y (m) is its point's across, from the line through the
first's point; its tilt (rad) is its angle beyond that at which the joint would hold it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.structure import BlockRest
from analytic.mechanism import Joint
from analytic.mechanism.parts import Amount


@dataclass(frozen=True)
class Guide:
    """A guide with half the play ``clearance`` (m) for a block of this length along the axis and height (m)."""

    length: float
    height: float
    clearance: float

    @classmethod
    def of(cls, joint: Joint) -> Guide | None:
        """That of a joint; None of one without clearance, or without a block."""
        return cls(*joint.guide, joint.clearance) if joint.guide is not None and joint.clearance > 0 else None

    @property
    def corners(self) -> tuple[complex, ...]:
        """Where the four corners are from the block's point (m): along the axis, and across."""
        a, b = self.length / 2, self.height / 2
        return (complex(-a, -b), complex(a, -b), complex(-a, b), complex(a, b))

    @property
    def sides(self) -> tuple[float, ...]:
        """Which wall each is before: 1 that across, -1 the other."""
        return tuple(1.0 if corner.imag > 0 else -1.0 for corner in self.corners)

    @property
    def tilt(self) -> float:
        """Angle (rad) at which opposite corners touch both walls: (L/2) sin phi + (h/2) cos phi = c + h/2."""
        across = math.hypot(self.length, self.height) / 2
        return math.asin((self.clearance + self.height / 2) / across) - math.atan2(self.height, self.length)

    def reach(self, height: Amount, tilt: Amount) -> Amount:
        """How far (m) the corner that is farthest out is from where it is in the middle; on the wall it is the
        clearance.
        """
        turned = self.length / 2 * np.abs(np.sin(tilt)) - self.height / 2 * (1 - np.cos(tilt))
        return abs(height) + turned

    def depths(self, height: Amount, tilt: Amount) -> np.ndarray:
        """How deep (4, ...) m each corner is in its wall; negative where it is off."""
        out = zip(self.sides, self.corners, strict=True)
        across = [s * (height + z.real * np.sin(tilt) + z.imag * np.cos(tilt)) for s, z in out]
        return np.array(across) - self.height / 2 - self.clearance

    def across(self, corners: np.ndarray) -> np.ndarray:
        """Force (...) N across on the block, of walls that push its corners so hard (4, ...) N."""
        return np.asarray(corners[0] + corners[1] - corners[2] - corners[3])

    def levers(self, tilt: np.ndarray, rubbing: np.ndarray | None = None) -> np.ndarray:
        """Moment (4, M) m about the block's point of a unit force across on each corner, and of the force along the
        guide that goes with it: ``rubbing`` (4, M) of a unit push of the wall, none left out.
        """
        cos, sin = np.cos(tilt), np.sin(tilt)
        along = np.array([z.real * cos - z.imag * sin for z in self.corners])
        if rubbing is None:
            return along
        out = np.array([s * (z.real * sin + z.imag * cos) for s, z in zip(self.sides, self.corners, strict=True)])
        return np.asarray(along + out * rubbing)

    def shares(
        self,
        across: np.ndarray,
        moment: np.ndarray,
        height: np.ndarray,
        tilt: np.ndarray,
        rubbing: np.ndarray | None = None,
    ) -> np.ndarray:
        """How hard (4, M) N walls push the corners that are in them, from the force (M,) N across on the block and its
        moment (M,) N.m about the block's point, and how friction goes with that (see :meth:`levers`).  At either end of
        the block one of two corners can be at its wall.
        """
        depths, along = self.depths(height, tilt), self.levers(tilt, rubbing)
        ends = [np.where(depths[k] > depths[k + 2], along[k], along[k + 2]) for k in (0, 1)]
        front = (moment - across * ends[0]) / (ends[1] - ends[0])
        up = np.array([across - front, front])
        return np.where(depths > 0, np.maximum([*up, *-up], 0.0), 0.0)

    def hardest(self, across: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """How hard (M,) N the wall of the corner that is pressed most pushes a block under a force (M,) N across and a
        moment (M,) N.m about its point, whichever corners that takes.
        """
        return (np.abs(across) + 2 * np.abs(moment) / self.length) / 2

    def push(self, across: float, moment: float) -> complex:
        """Force (N) across and i times a moment (N.m) about the block's point over half the length."""
        return complex(across, 2 * moment / self.length)

    def corners_at(self, push: complex) -> tuple[int, int]:
        """Which corners a wall presses under a force (N) across and i times a moment (N.m) over half the length: both
        of one side, or two at opposite ends and walls.
        """
        if abs(push.real) >= abs(push.imag):
            return (0, 1) if push.real > 0 else (2, 3)
        return (1, 2) if push.imag > 0 else (0, 3)

    def rest(self, push: complex, give: float = 0.0) -> BlockRest:
        """Where those hold the block, ``give`` (m) inside the wall."""
        wide = Guide(self.length, self.height, self.clearance + give)
        if abs(push.real) >= abs(push.imag):
            return BlockRest(-math.copysign(wide.clearance, push.real), 0.0)
        return BlockRest(0.0, -math.copysign(wide.tilt, push.imag))


def opened(assembly: Assembly, gaps: Mapping[str, complex | BlockRest] | None) -> tuple[Assembly, dict[str, complex]]:
    """The linkage with those blocks where they rest, and the gaps (m) of pins among ``gaps``."""
    found = gaps or {}
    rests = {name: gap for name, gap in found.items() if isinstance(gap, BlockRest)}
    return assembly.resting(rests), {name: gap for name, gap in found.items() if not isinstance(gap, BlockRest)}
