"""Blocks with clearance in their guides: each corner's push max(0, K d + C d'), or that of a law by name, and beside it
the joint's own law along the guide, in a function that Exudyn compiles.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic.mechanism import Joint
from sim_models.common.contact_laws import KelvinVoigt, NamedLaw
from sim_models.common.guide import Guide
from sim_models.exudyn.laws import CONTACT_CREEP
from sim_models.exudyn.named_contact import End, Glance, Memory, push_back, reading

_Exu = Any  # an object of Exudyn's, or a number of its symbolic functions
Effort = Callable[[_Exu, _Exu], _Exu]  # a joint's law, by travel and rate


@dataclass(frozen=True)
class BlockMotion:
    """Where a block is, as seen from its guide, in numbers or symbols: unit vector along the guide; the second body's
    centre of mass from the first's, along and across (m), and the rates of these (m/s); cosine and sine of the
    block's tilt, and its rate (rad/s).
    """

    along: tuple[_Exu, _Exu]
    far: _Exu
    aside: _Exu
    going: _Exu
    sinking: _Exu
    cos: _Exu
    sin: _Exu
    turning: _Exu

    def turned(self, arm: complex) -> tuple[_Exu, _Exu]:
        """An arm (m) of the block, along its axis and across, as it lies along the guide and across."""
        return arm.real * self.cos - arm.imag * self.sin, arm.real * self.sin + arm.imag * self.cos


@dataclass(frozen=True)
class ExudynBlock:
    """The block of a joint: its guide, the law of its corners, how these remember their touch if they do, and the
    joint's points in the two bodies.

    ``friction`` is Coulomb's in the contact, which fades where a corner slides more slowly than CONTACT_CREEP.  ``own``
    is the joint's own law, by travel (m) and rate (m/s) the force (N) by which it draws the block back, if it
    has one; ``steady`` a force (N) along the guide on the block, a variable in compiled functions.
    """

    joint: Joint
    guide: Guide
    law: KelvinVoigt | NamedLaw
    memories: tuple[Memory, ...]
    ends: tuple[End, End]
    own: Effort | None
    steady: _Exu
    friction: float = 0.0

    @classmethod
    def of(
        cls,
        exu: _Exu,
        joint: Joint,
        law: KelvinVoigt | NamedLaw,
        ends: tuple[End, End],
        own: Effort | None,
        friction: float = 0.0,
    ) -> ExudynBlock:
        """That of a joint."""
        guide = Guide.of(joint)
        assert guide is not None  # a mechanism with clearance in a prismatic joint has it
        memories: list[Memory] = []
        if isinstance(law, NamedLaw) and law.hysteresis:
            memories = [Memory(exu.symbolic, f"{joint.name}:{k}", law) for k in range(4)]
        steady = exu.symbolic.Real(f"steady {joint.name}", 0.0)
        return cls(joint, guide, law, tuple(memories), ends, own, steady, friction)

    @property
    def _near(self) -> complex:
        """The guide's point (m) from the first body's centre of mass, along the joint's axis and across."""
        return self.ends[0].arm * self.joint.direction.conjugate()

    @property
    def _foot(self) -> complex:
        """The block's point (m) from the second body's centre of mass, along the joint's axis and across."""
        return self.ends[1].arm * self.joint.direction.conjugate() * cmath.exp(1j * self.joint.angle)

    def seen(self, functions: _Exu, q: Sequence[_Exu], q_t: Sequence[_Exu]) -> BlockMotion:
        """Where it is at these coordinates (m, rad) and rates; ``functions`` have cosine and sine."""
        d, (first, second) = self.joint.direction, self.ends
        (x1, y1, a1, u1, v1, w1), (x2, y2, a2, u2, v2, w2) = (
            (0.0,) * 6 if end.row is None else tuple(each[end.row + k] for each in (q, q_t) for k in range(3))
            for end in (first, second)
        )
        c, s = (1.0, 0.0) if first.row is None else (functions.cos(a1), functions.sin(a1))
        ax, ay = d.real * c - d.imag * s, d.real * s + d.imag * c
        x, y, u, v = x2 - x1, y2 - y1, u2 - u1, v2 - v1
        tilt = a2 - a1 - self.joint.angle
        far = ax * x + ay * y
        aside = ax * y - ay * x
        going, sinking = ax * u + ay * v + w1 * aside, ax * v - ay * u - w1 * far
        return BlockMotion((ax, ay), far, aside, going, sinking, functions.cos(tilt), functions.sin(tilt), w2 - w1)

    def corners(self, block: BlockMotion) -> list[tuple[float, _Exu, _Exu, _Exu]]:
        """Of each corner, which wall it is before (1: that across), how far it is along the guide from the second
        body's centre of mass (m), how deep in the wall (m), and the rate (m/s).
        """
        corners = []
        for side, corner in zip(self.guide.sides, self.guide.corners, strict=True):
            along, across = block.turned(self._foot + corner)
            depth = side * (block.aside + across - self._near.imag) - (self.guide.height / 2 + self.guide.clearance)
            corners.append((side, along, depth, side * (block.sinking + block.turning * along)))
        return corners

    def force(self, symbolic: _Exu, q: _Exu, q_t: _Exu) -> _Exu:
        """Generalised forces (N, N, N.m of each moving body) at these coordinates and rates, symbolic."""
        block = self.seen(symbolic, q, q_t)
        (x, y), (along, across) = block.along, block.turned(self._foot)
        total = symbolic.Vector([0.0] * 3 * sum(end.row is not None for end in self.ends))
        for k, (side, reach, depth, rate) in enumerate(self.corners(block)):
            push = push_back(symbolic, self.law, self.memories[k] if self.memories else None, depth, rate)
            away = [side * y, -side * x, -side * reach]
            total = total + self._vector(symbolic, [-side * y, side * x, side * (block.far + reach)], away) * push
            if self.friction:
                _, aside = block.turned(self._foot + self.guide.corners[k])
                slip = block.going - block.turning * aside
                fading = symbolic.max(symbolic.min(slip * (1 / CONTACT_CREEP), 1.0), -1.0)
                back = self._vector(symbolic, [x, y, -(block.aside + aside)], [-x, -y, aside])
                total = total + back * (push * fading * self.friction)
        if self.own is not None:
            pull = self.own(block.far + along - self._near.real, block.going - block.turning * across)
            on_first = self._vector(symbolic, [x, y, -(block.aside + across)], [-x, -y, across])
            total = total + on_first * (pull - self.steady)
        return total

    def rubbing(self, block: BlockMotion) -> np.ndarray:
        """Friction (4, M) of each corner along the guide on the second body, of a unit push of its wall, where the
        block is as ``seen`` in arrays (M,).
        """
        slips = [block.going - block.turning * block.turned(self._foot + z)[1] for z in self.guide.corners]
        return -self.friction * np.clip(np.array(slips) / CONTACT_CREEP, -1.0, 1.0)

    def _vector(self, symbolic: _Exu, first: list[_Exu], second: list[_Exu]) -> _Exu:
        """What acts on the two bodies, of those that move."""
        both = zip(self.ends, (first, second), strict=True)
        return symbolic.Vector([part for end, parts in both if end.row is not None for part in parts])

    def glance(self, exu: _Exu, nodes: list[_Exu]) -> Glance:
        """How the corners' memories see them."""
        kinds = exu.OutputVariableType.Coordinates, exu.OutputVariableType.Coordinates_t

        def look(mbs: _Exu) -> None:
            q, q_t = ([x for node in nodes for x in mbs.GetNodeOutput(node, kind).tolist()] for kind in kinds)
            for memory, (_, _, depth, rate) in zip(self.memories, self.corners(self.seen(np, q, q_t)), strict=True):
                memory.see(depth, rate)

        return look

    def on_second(self, sensed: np.ndarray, arms: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Force (M,) N, complex, on the second body and moment (M,) N.m about the block's point, from Exudyn's
        generalised forces (M, size), which it has to the left of its equations; ``arms`` (M,) m, complex, are from each
        body's centre of mass to the point.
        """
        row, sign = reading(self.ends)
        arm = arms[0] if self.ends[1].row is None else arms[1]
        force = sign * (sensed[:, row] + 1j * sensed[:, row + 1])
        return force, sign * sensed[:, row + 2] - np.imag(np.conj(arm) * force)
