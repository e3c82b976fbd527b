"""The tree of ideal joints in which the bodies of a MuJoCo linkage hang, and the joints that close its loops."""

from __future__ import annotations

import math
from dataclasses import dataclass

from analytic.mechanism import GROUND, Body, Joint, Mechanism


@dataclass(frozen=True)
class Branch:
    """How a body hangs in the tree: on a parent by a joint, or floating (no joint)."""

    body: Body
    parent: str
    joint: Joint | None

    @property
    def is_second(self) -> bool:
        """Whether the body is its joint's second."""
        return self.joint is not None and self.joint.bodies[1] == self.body.name


def spanning_tree(mechanism: Mechanism, cut: set[str]) -> tuple[list[Branch], list[Joint]]:
    """Branches, parents first, and the ideal joints that are left to close loops; joints named in ``cut`` join nothing.

    Rows that close a loop give by a part of what their bodies would accelerate by, so the joints of far lighter bodies
    are in the tree.
    """
    part = {name: name for name in (GROUND, *(b.name for b in mechanism.bodies))}
    drive = mechanism.drive_joint
    edges, closing = [], []
    for joint in sorted(
        mechanism.joints,
        key=lambda j: (not j.prismatic, j.name != drive.name, -_lightness(mechanism, j), GROUND not in j.bodies),
    ):
        if joint.name in cut and joint.name != drive.name:
            continue
        a, b = (part[name] for name in joint.bodies)
        if a == b:
            closing.append(joint)
        else:
            edges += (
                [joint] if joint.name not in cut else []
            )  # a drive joint with clearance leaves the crank floating, its angle a coordinate
            part = {name: b if p == a else p for name, p in part.items()}
    branches: list[Branch] = []
    placed = {GROUND}
    roots = [mechanism.driven] if drive.name in cut else []
    waiting = roots + [b.name for b in mechanism.bodies if b.name not in roots]
    while waiting:
        via = next((j for j in edges if len(placed & set(j.bodies)) == 1), None)
        if via is None or (waiting[0] in roots):
            child, parent, via = waiting[0], GROUND, None
        else:
            edges.remove(via)
            parent, child = sorted(via.bodies, key=lambda name: name not in placed)
        body = mechanism.body(child)
        assert isinstance(body, Body)
        branches.append(Branch(body, parent, via))
        placed.add(child)
        waiting.remove(child)
    return branches, closing


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
