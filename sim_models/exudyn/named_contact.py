"""Contact laws by name in Exudyn: functions that it compiles, and the memory of how fast a pin came to its wall.

Exudyn's own contact of spheres pulls as a pin leaves; these do not.  The force max(0, K d (1 + chi d'/v0)) acts between
the pin centres (ObjectConnectorSpringDamper as long as the clearance), friction where the pin touches
(ObjectGenericODE2 on the nodes of the two bodies).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic.mechanism.parts import TINY
from sim_models.common.contact_laws import KelvinVoigt, NamedLaw
from sim_models.exudyn.laws import CONTACT_CREEP

_Exu = Any  # an object of Exudyn's, or a number of its symbolic functions


class Memory:
    """How a law with hysteresis remembers its touch: ``gain`` (s/m) is chi/v0, a variable in compiled functions.

    What starts on its wall has come there as slowly as the law reckons with.
    """

    def __init__(self, symbolic: _Exu, name: str, law: NamedLaw) -> None:
        self.law = law
        self.gain = symbolic.Real(f"gain {name}", law.hysteresis / law.slowest)

    def see(self, depth: float, rate: float) -> None:
        """Depth (m) and its rate (m/s) at the start of a step: off the wall, it may be the one in which it touches."""
        if depth <= 0:
            self.gain.SetValue(self.law.hysteresis / max(rate, self.law.slowest))


Glance = Callable[[_Exu], None]  # at a system, of a memory


def at_pin(exu: _Exu, number: int, clearance: float, memory: Memory) -> Glance:
    """How a pin's memory sees the connector of this number, whose pin has this clearance (m)."""
    apart, rate = exu.OutputVariableType.Displacement, exu.OutputVariableType.Velocity

    def look(mbs: _Exu) -> None:
        (x, y, _), (u, v, _) = (mbs.GetObjectOutput(number, kind).tolist() for kind in (apart, rate))
        distance = math.hypot(x, y)
        memory.see(distance - clearance, (x * u + y * v) / max(distance, TINY))

    return look


def before_steps(glances: Sequence[Glance]) -> Callable[[_Exu, float], bool]:
    """What Exudyn does before each step."""

    def look(mbs: _Exu, t: float) -> bool:
        for glance in glances:
            glance(mbs)
        return True

    return look


def push_back(symbolic: _Exu, law: KelvinVoigt | NamedLaw, memory: Memory | None, stretch: _Exu, rate: _Exu) -> _Exu:
    """The force (N) of a pin so far (m) beyond its clearance, at this rate (m/s), symbolic."""
    if memory is not None:
        return symbolic.max(law.stiffness * symbolic.max(stretch, 0.0) * (1.0 + memory.gain * rate), 0.0)
    pushed = symbolic.max(law.stiffness * stretch + law.damping * rate, 0.0)
    return symbolic.IfThenElse(stretch > 0.0, pushed, symbolic.Real(0.0))


@dataclass(frozen=True)
class End:
    """A joint's end in a body: the pin centre ``arm`` (m) from the centre of mass, in the body's frame, which is at
    ``row`` of the coordinates; of the ground, the pin's place (m), and None.
    """

    arm: complex
    row: int | None


@dataclass(frozen=True)
class Rub:
    """Coulomb friction of a pin in its bearing, at the rim (radius ``rim``, m, about the second's pin centre); it
    fades where the pin slides more slowly than CONTACT_CREEP.
    """

    law: NamedLaw
    memory: Memory | None
    clearance: float
    friction: float
    rim: float
    ends: tuple[End, End]

    def force(self, symbolic: _Exu, q: _Exu, q_t: _Exu) -> _Exu:
        """Generalised forces (N, N, N.m of each moving body) at these coordinates and rates, symbolic.

        An expression is computed as often as it is written: hence what all have in common stands before a vector.
        """
        (a1, b1, x1, y1, u1, v1, w1), (a2, b2, x2, y2, u2, v2, w2) = (_pin(symbolic, end, q, q_t) for end in self.ends)
        x, y, u, v = x1 - x2, y1 - y2, u1 - u2, v1 - v2
        apart = symbolic.max(symbolic.sqrt(x * x + y * y), TINY)
        rate, sliding = (x * u + y * v) / apart, (x * v - y * u) / apart
        push = push_back(symbolic, self.law, self.memory, apart - self.clearance, rate)
        slip = sliding + (w1 - w2) * self.rim - w1 * apart
        fading = symbolic.max(symbolic.min(slip * (1 / CONTACT_CREEP), 1.0), -1.0)
        first = [-y, x, a1 * x + b1 * y + (self.rim - apart) * apart]  # across the gap, times its length
        second = [y, -x, -(a2 * x + b2 * y + self.rim * apart)]
        moved = [
            part for end, parts in zip(self.ends, (first, second), strict=True) if end.row is not None for part in parts
        ]
        return symbolic.Vector(moved) * (push * fading * (-self.friction) / apart)

    def on_second(self, sensed: np.ndarray) -> np.ndarray:
        """Force (M,) N, complex, on the second body, from Exudyn's generalised ones (M, size), which it has to the
        left of its equations.
        """
        row, sign = reading(self.ends)
        return np.asarray(sign * (sensed[:, row] + 1j * sensed[:, row + 1]))


def reading(ends: tuple[End, End]) -> tuple[int, float]:
    """Where generalised forces between two bodies have that on the second, or else on the first, and its sign."""
    first, second = (end.row for end in ends)
    return (first or 0, 1.0) if second is None else (second, -1.0)


def _pin(symbolic: _Exu, end: End, q: _Exu, q_t: _Exu) -> tuple[_Exu, ...]:
    """A pin centre's x, y (m) from its body's centre of mass and from the origin, the rates of these (m/s), and its
    body's angular velocity (rad/s), symbolic.
    """
    x, y = end.arm.real, end.arm.imag
    if end.row is None:
        still = symbolic.Real(0.0)
        return still, still, symbolic.Real(x), symbolic.Real(y), still, still, still
    c, s, w = symbolic.cos(q[end.row + 2]), symbolic.sin(q[end.row + 2]), q_t[end.row + 2]
    a, b = x * c - y * s, x * s + y * c
    return a, b, q[end.row] + a, q[end.row + 1] + b, q_t[end.row] - w * b, q_t[end.row + 1] + w * a, w
