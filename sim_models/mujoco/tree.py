"""Which ideal joints of a MuJoCo linkage make the tree in which its bodies hang, and which close its loops."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace

from analytic.mechanism import GROUND, Joint, Mechanism
from sim_models.common.tree import Branch, grown, without_loops


def spanning_tree(
    mechanism: Mechanism, cut: set[str], driven: Collection[str] | None = None
) -> tuple[list[Branch], list[Joint]]:
    """Branches, parents first, and the ideal joints that are left to close loops; joints named in ``cut`` join nothing.

    Rows that close a loop give by a part of what their bodies would accelerate by, so the joints of far lighter bodies
    are in the tree.  A drive joint with clearance leaves the crank floating, its angle a coordinate.  ``driven`` names
    the joints that are driven where these are not a crank's: each is in the tree, or in its place its body floats from
    the other one's.
    """
    if driven is not None:
        return _driven_tree(mechanism, cut, driven)
    drive = mechanism.drive_joint
    preferred = sorted(
        (j for j in mechanism.joints if j.name not in cut or j.name == drive.name),
        key=lambda j: (
            not j.prismatic,
            j.name != drive.name,
            -_lightness(mechanism, j, {mechanism.driven}),
            GROUND not in j.bodies,
        ),
    )
    tree, closing = without_loops(mechanism, preferred)
    floating = mechanism.driven if drive.name in cut else None
    return grown(mechanism, [j for j in tree if j.name not in cut], floating), closing


def _driven_tree(mechanism: Mechanism, cut: set[str], driven: Collection[str]) -> tuple[list[Branch], list[Joint]]:
    """The same with these joints driven: they come before all others, and no loop is made of them alone."""
    on_ground = [j for j in mechanism.joints if j.name in driven and GROUND in j.bodies and not j.prismatic]
    held = {name for j in on_ground for name in j.bodies}
    preferred = sorted(
        (j for j in mechanism.joints if j.name not in cut or j.name in driven),
        key=lambda j: (
            j.name not in driven,
            not j.prismatic,
            -_lightness(mechanism, j, held),
            GROUND not in j.bodies,
        ),
    )
    tree, closing = without_loops(mechanism, preferred)
    branches = grown(mechanism, tree)
    return [replace(b, joint=None) if b.joint is not None and b.joint.name in cut else b for b in branches], closing


def _lightness(mechanism: Mechanism, joint: Joint, held: Collection[str]) -> int:
    """By how many hundredfolds a joint's lightest body is lighter than the heaviest of the linkage, those apart that
    a motor holds.
    """
    bodies = mechanism.moving
    lightest = min(
        (bodies[name].mass for name in joint.bodies if name in bodies and name not in held), default=math.inf
    )
    heaviest = max(body.mass for body in bodies.values())
    return max(0, int(math.log10(heaviest / lightest) // 2)) if lightest < heaviest else 0
