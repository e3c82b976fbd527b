"""A block with clearance in its guide: where its corners are, and how far they are from the walls.

The block is on the second body of a prismatic joint, about its point; the guide's walls are on the first.  Across is
the joint's axis turned by a right angle.  The block's height y (m) is its point's across, from the line through the
first's point; its tilt (rad) is its angle beyond that at which the joint would hold it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

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
