"""Joints and sites of an MJCF file in its plane, and where its links are."""

from __future__ import annotations

import cmath
from dataclasses import dataclass


@dataclass(frozen=True)
class PlanarPin:
    """A joint of the linkage: number of its ``links``, where it sits in each (m, link frames), and its own laws.

    A slide's two points lie together in the initial pose, where a mechanism's slide that no loop holds begins; or they
    are those of its sites.
    ``joint`` or ``equality`` is its number in MuJoCo, the other one -1.  A slide has its ``axis`` (unit vector, first
    link's frame) and ``angle`` (rad, second link's less first's).  A hinge's coordinate grows by ``turn`` (1 or -1)
    with the second link's angle.
    """

    names: tuple[str, ...]
    links: tuple[int, int]
    points: tuple[complex, complex]
    joint: int = -1
    equality: int = -1
    slides: bool = False
    axis: complex = 0j
    angle: float = 0.0
    turn: float = 1.0

    @property
    def name(self) -> str:
        """What it is called."""
        return self.names[0]


@dataclass(frozen=True)
class Frames:
    """Where links are at one instant: origins (m, x + iy, ground frame) and angles (rad, within half a turn)."""

    origins: list[complex]
    angles: list[float]

    def place(self, link: int, point: complex) -> complex:
        """A link's point (m, link frame) in the ground frame."""
        return self.origins[link] + point * cmath.exp(1j * self.angles[link])

    def within(self, link: int, place: complex) -> complex:
        """A place in the ground frame as a link has it (m)."""
        return (place - self.origins[link]) * cmath.exp(-1j * self.angles[link])


@dataclass(frozen=True)
class Site:
    """A site: its number and name, and its link and place in it (m, link frame)."""

    number: int
    name: str
    link: int
    point: complex
