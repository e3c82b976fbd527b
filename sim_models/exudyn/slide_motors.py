"""The travel of a prismatic joint as a constraint of Exudyn's, for a motor along it."""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import mul

from sim_models.exudyn.named_contact import End

Constraint = Callable[[object, float, int, Sequence[float], Sequence[float], bool], list[float]]
Jacobian = Callable[[object, float, int, Sequence[float], Sequence[float], bool], list[list[float]]]
Coordinates = Sequence[float]  # com's x, y (m) and angle (rad) of each of the two bodies that moves


@dataclass(frozen=True)
class Slide:
    """A prismatic joint's travel (m), from the coordinates of the bodies that it joins.

    A force along it acts on the second body at its point, and opposite, there, on the first.
    """

    direction: complex  # in the first body
    ends: tuple[End, End]

    def _seen(self, q: Coordinates) -> tuple[complex, complex, complex]:
        """The axis, the second body's point as seen from the first's com, and as seen from its own."""
        (x, y, angle), (u, v, turn) = (
            (0.0, 0.0, 0.0) if end.row is None else q[end.row : end.row + 3] for end in self.ends
        )
        arm = self.ends[1].arm * cmath.exp(1j * turn)
        return self.direction * cmath.exp(1j * angle), complex(u - x, v - y) + arm, arm

    def travel(self, q: Coordinates) -> float:
        """The second body's point less the first's, along the axis (m)."""
        axis, seen, _ = self._seen(q)
        return (axis.conjugate() * seen).real - (self.direction.conjugate() * self.ends[0].arm).real

    def gradient(self, q: Coordinates) -> list[float]:
        """Its derivative by the coordinates."""
        axis, seen, arm = self._seen(q)
        first = [-axis.real, -axis.imag, (axis.conjugate() * seen).imag] if self.ends[0].row is not None else []
        second = [axis.real, axis.imag, -(axis.conjugate() * arm).imag] if self.ends[1].row is not None else []
        return first + second

    def jacobian(self) -> Jacobian:
        """The gradient as Exudyn asks for it."""
        return lambda mbs, t, item, q, q_t, rates: [self.gradient(q)]

    def at_speed(self, speed: Callable[[float], float]) -> Constraint:
        """The travel changes at a speed (m/s) over time (s)."""
        return lambda mbs, t, item, q, q_t, rates: [sum(map(mul, self.gradient(q), q_t)) - speed(t)]

    def at_rest(self, where: Callable[[], float]) -> Constraint:
        """The travel is held where it is told to be (m)."""
        return lambda mbs, t, item, q, q_t, rates: [self.travel(q) - where()]
