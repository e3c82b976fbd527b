"""The tree of ideal joints in which bodies hang on the ground: how it is split off from loops, and how it grows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import GROUND, Body, Joint, Mechanism


@dataclass(frozen=True)
class Branch:
    """A body and what it hangs on: its parent by a joint, or the ground with all three freedoms (no joint)."""

    body: Body
    parent: str
    joint: Joint | None

    @property
    def child(self) -> str:
        """The body's name."""
        return self.body.name

    @property
    def is_second(self) -> bool:
        """Whether the body is its joint's second."""
        return self.joint is not None and self.joint.bodies[1] == self.body.name

    @property
    def fixed_angle(self) -> float:
        """Angle (rad) of the child minus its parent's that a prismatic joint keeps."""
        if self.joint is None or not self.joint.prismatic:
            return 0.0
        return self.joint.angle if self.is_second else -self.joint.angle

    @property
    def axis(self) -> complex:
        """Direction in the child's frame along which it moves as a prismatic joint's travel grows."""
        assert self.joint is not None
        return self.joint.direction * np.exp(-1j * self.fixed_angle) if self.is_second else -self.joint.direction


def without_loops(m: Mechanism, joints: Iterable[Joint]) -> tuple[list[Joint], list[Joint]]:
    """Of joints in order of preference those that close no loop with the ones before, and those that do."""
    part = {name: name for name in m.parts}
    tree: list[Joint] = []
    rest: list[Joint] = []
    for joint in joints:
        a, b = (part[name] for name in joint.bodies)
        (rest if a == b else tree).append(joint)
        part = {name: b if p == a else p for name, p in part.items()}
    return tree, rest


def grown(m: Mechanism, tree: Iterable[Joint], floating: str | None = None) -> list[Branch]:
    """A branch for each moving body, parents first, by the joints of a ``tree``.

    What no joint ties to the ground floats: a body named as ``floating`` in any case and before all others.
    """
    left, placed, branches, moving = list(tree), {GROUND}, list[Branch](), m.moving
    while len(branches) < len(moving):
        joint = None if floating else next((j for j in left if len(placed & set(j.bodies)) == 1), None)
        if joint is not None:
            left.remove(joint)
            child, parent = sorted(joint.bodies, key=lambda name: name in placed)
        else:
            adrift = [name for name in moving if name not in placed]
            child, parent = floating or (m.driven if m.cranked and m.driven in adrift else adrift[0]), GROUND
            floating = None
        branches.append(Branch(moving[child], parent, joint))
        placed.add(child)
    return branches
