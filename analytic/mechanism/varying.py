"""What a load may vary with over a motion, and its force where the linkage is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, cast

import numpy as np

from analytic.mechanism.parts import GROUND, TINY, Amount, Body, Joint, Load
from analytic.mechanism.signals import SiUnit

Vectors = complex | np.ndarray  # x + iy, one or (N,)


class Fading(NamedTuple):
    """Velocity (m/s) of its point and rate (rad/s) of its body, below which a load that opposes them fades out."""

    velocity: float = 0.0
    spin: float = 0.0


NEVER = Fading()


@dataclass(frozen=True)
class Seen(Generic[Amount]):
    """A linkage as its loads see it, at one instant or at N: by body its ``angle`` (rad) and ``spin`` (rad/s), by body
    and point its ``place`` (m) and ``velocity`` (m/s, of which only the direction matters), and the ``time`` (s).
    """

    angle: Callable[[str], Amount]
    place: Callable[[str, str], Vectors]
    velocity: Callable[[str, str], Vectors]
    spin: Callable[[str], Amount]
    time: Callable[[], Amount]


@dataclass(frozen=True)
class Quantity:
    """An angle (rad) of a body, ``less`` that of another where it is a joint's, x or y (m) of a body, the travel (m)
    of a slide, or the time (s) since a run's start.
    """

    kind: Literal["angle", "x", "y", "travel", "time"]
    body: str = ""
    slide: Joint | None = None
    less: str = GROUND

    @property
    def unit(self) -> SiUnit:
        """Its unit."""
        return "rad" if self.kind == "angle" else "s" if self.kind == "time" else "m"

    def value(self, seen: Seen[Amount]) -> Amount:
        """Its value, one or (N,), where a linkage is seen."""
        if self.kind == "angle":
            turned = seen.angle(self.body) if self.body != GROUND else 0.0 * seen.angle(self.less)
            return turned if self.less == GROUND else turned - seen.angle(self.less)
        if self.kind == "time":
            return seen.time()
        if self.slide is None:
            at = seen.place(self.body, "com")
            return cast(Amount, np.real(at) if self.kind == "x" else np.imag(at))
        first, second = self.slide.bodies
        axis = self.slide.direction * np.exp(1j * (0.0 if first == GROUND else seen.angle(first)))
        apart = seen.place(second, self.slide.name) - seen.place(first, self.slide.name)
        return cast(Amount, np.real(np.conj(axis) * apart))


def quantities(driven: str, bodies: Iterable[Body], joints: Iterable[Joint]) -> Iterator[tuple[str, Quantity]]:
    """Everything that a load of a linkage may vary with, by name; ``driven`` is its crank, if there is one."""
    yield "time", Quantity("time")
    if driven:
        yield "crank_angle", Quantity("angle", driven)
    for body in bodies:
        yield f"{body.name}_angle", Quantity("angle", body.name)
        yield f"{body.name}_x", Quantity("x", body.name)
        yield f"{body.name}_y", Quantity("y", body.name)
    for joint in joints:
        first, second = joint.bodies
        turned = Quantity("angle", second, less=first)
        yield f"position_{joint.name}", Quantity("travel", slide=joint) if joint.prismatic else turned


def acting(
    load: Load, quantity: Quantity | None, seen: Seen[Amount], fading: Fading = NEVER
) -> tuple[Vectors, Amount | float]:
    """Force (N, x + iy) and torque (N.m) of a load, one or (N,), that varies over a ``quantity`` if over any.

    One that opposes has no direction where its point, or its body, does not move: there it is none, and in proportion
    less below the velocities of its ``fading``.
    """
    share = 1.0 if quantity is None else load.share(quantity.value(seen), quantity.kind == "angle")
    force, torque = complex(*load.force), load.torque
    if not load.opposes:
        return force * share, torque * share
    along = seen.velocity(load.body, load.point) if force else 0j
    spin = seen.spin(load.body) if torque else 0.0
    turn = np.clip(spin / fading.spin, -1.0, 1.0) if fading.spin else np.sign(spin)
    way = along / np.maximum(np.abs(along), fading.velocity or TINY)
    return -abs(force) * share * way, -abs(torque) * share * turn
