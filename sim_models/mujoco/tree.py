"""Which ideal joints of a MuJoCo linkage make the tree in which its bodies hang, and which close its loops."""

from __future__ import annotations

import math

from analytic.mechanism import GROUND, Joint, Mechanism
from sim_models.common.tree import Branch, grown, without_loops


def spanning_tree(mechanism: Mechanism, cut: set[str]) -> tuple[list[Branch], list[Joint]]:
    """Branches, parents first, and the ideal joints that are left to close loops; joints named in ``cut`` join nothing.

    Rows that close a loop give by a part of what their bodies would accelerate by, so the joints of far lighter bodies
    are in the tree.  A drive joint with clearance leaves the crank floating, its angle a coordinate.
    """
    drive = mechanism.drive_joint
    preferred = sorted(
        (j for j in mechanism.joints if j.name not in cut or j.name == drive.name),
        key=lambda j: (not j.prismatic, j.name != drive.name, -_lightness(mechanism, j), GROUND not in j.bodies),
    )
    tree, closing = without_loops(mechanism, preferred)
    floating = mechanism.driven if drive.name in cut else None
    return grown(mechanism, [j for j in tree if j.name not in cut], floating), closing


def _lightness(mechanism: Mechanism, joint: Joint) -> int:
    """By how many hundredfolds a joint's lightest body is lighter than the heaviest of the linkage; the driven one is
    held by its motor.
    """
    bodies = mechanism.moving
    lightest = min(
        (bodies[name].mass for name in joint.bodies if name in bodies and name != mechanism.driven), default=math.inf
    )
    heaviest = max(body.mass for body in bodies.values())
    return max(0, int(math.log10(heaviest / lightest) // 2)) if lightest < heaviest else 0
