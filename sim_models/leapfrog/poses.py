"""Poses along a path of a linkage whose pins are off centre, by differences in time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from analytic.kinematics.structure import BlockRest
from sim_models.common.start import Pose
from sim_models.run.path import Path, Poses

TURN_OF_STENCIL = 1e-3  # rad of crank angle, for rates of positions and of the pins' equilibria
KNOT_SHARE = 0.125  # of the time between a course's knots: below it a course has nothing new to say

Changes = Mapping[str, complex]  # by joint: a pin's gap (m); a block's height (m) and i times its tilt (rad)
NO_CHANGES: Changes = MappingProxyType({})


def duration(path: Path, angle: float, knots: float = KNOT_SHARE) -> float:
    """The time (s) in which a path turns by at most an angle (rad), and by at most a share of that between a course's
    ``knots``.
    """
    turning = angle / path.top_speed if path.top_speed else np.inf
    return min(turning, knots * path.knot_spacing)


def moving(path: Path, time: float, gaps: Callable[[float], Changes] = lambda time: NO_CHANGES) -> Poses:
    """Pose of every moving body at a time (s) of a path, with gaps (m) that depend on the time.

    Rates are central differences in time (five points).
    """

    def at(moment: float) -> Poses:
        return still(path, moment, gaps(moment))

    here, apart = at(time), duration(path, TURN_OF_STENCIL)
    if np.isinf(apart):
        return here
    around = [(weight / (12 * apart), at(time + k * apart)) for k, weight in ((-2, 1), (-1, -8), (1, 8), (2, -1))]
    return {
        name: Pose(
            pose.origin,
            pose.angle,
            sum((w * side[name].origin for w, side in around), 0j),
            sum(w * side[name].angle for w, side in around),
        )
        for name, pose in here.items()
    }


def still(path: Path, place: float, gaps: Changes = NO_CHANGES) -> Poses:
    """Pose of every moving body at a place on a path, with these gaps (m), as if at rest.  Raises AssemblyError."""
    slides = {joint.name for joint in path.assembly.mechanism.joints if joint.prismatic}
    return path.poses(place, {n: BlockRest(gap.real, gap.imag) if n in slides else gap for n, gap in gaps.items()})


def near(
    gaps: Changes, time: float, rate: Changes = NO_CHANGES, bend: Changes = NO_CHANGES
) -> Callable[[float], Changes]:
    """Gaps (m) as a parabola in time about ``time`` (s), by their first two derivatives there."""
    return lambda t: {
        n: g + rate.get(n, 0j) * (t - time) + bend.get(n, 0j) * (t - time) ** 2 / 2 for n, g in gaps.items()
    }
