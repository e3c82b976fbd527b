"""What a load may vary with over a motion, and its value where the linkage is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, cast

import numpy as np

from analytic.mechanism.parts import GROUND, Amount, Body, Joint
from analytic.mechanism.signals import SiUnit

Angle = Callable[[str], Amount]  # (rad) of a moving body
Point = Callable[[str, str], complex | np.ndarray]  # place (m, x + iy) of a body's point, or of the ground's


@dataclass(frozen=True)
class Quantity:
    """An angle (rad) of a body, x or y (m) of one, or the travel (m) of a slide."""

    kind: Literal["angle", "x", "y", "travel"]
    body: str = ""
    slide: Joint | None = None

    @property
    def unit(self) -> SiUnit:
        """Its unit."""
        return "rad" if self.kind == "angle" else "m"

    def value(self, angle: Angle[Amount], point: Point) -> Amount:
        """Its value, one or (N,), where bodies have these angles and points these places."""
        if self.kind == "angle":
            return angle(self.body)
        if self.slide is None:
            at = point(self.body, "com")
            return cast(Amount, np.real(at) if self.kind == "x" else np.imag(at))
        first, second = self.slide.bodies
        axis = self.slide.direction * np.exp(1j * (0.0 if first == GROUND else angle(first)))
        return cast(Amount, np.real(np.conj(axis) * (point(second, self.slide.name) - point(first, self.slide.name))))


def quantities(driven: str, bodies: Iterable[Body], joints: Iterable[Joint]) -> Iterator[tuple[str, Quantity]]:
    """Everything that a load of a linkage may vary with, by name; ``driven`` is its crank, if there is one."""
    if driven:
        yield "crank_angle", Quantity("angle", driven)
    for body in bodies:
        yield f"{body.name}_angle", Quantity("angle", body.name)
        yield f"{body.name}_x", Quantity("x", body.name)
        yield f"{body.name}_y", Quantity("y", body.name)
    for joint in joints:
        if joint.prismatic:
            yield f"position_{joint.name}", Quantity("travel", slide=joint)
