"""What the links and joints of an MJCF file are called in a mechanism, where names are identifiers of their own."""

from __future__ import annotations

import itertools
import re
import string
from collections.abc import Iterator, Mapping, Sequence

import mujoco

from analytic.mechanism import GROUND
from analytic.mechanism.parts import LONGEST_NAME
from sim_models.mjcf.parts import Frames, PlanarPin, Site

Points = tuple[complex, complex]
TAKEN = {GROUND, "world", "com"}


def plain(name: str) -> str:
    """A name with what a mechanism's has not replaced by underscores; empty where nothing is left."""
    found = re.sub(r"[^\w-]", "_", name, flags=re.ASCII).strip("_-")[: LONGEST_NAME - 8]
    return f"n{found}" if found[:1].isdigit() else found


def free(name: str, taken: set[str]) -> str:
    """The name, with a number behind it where it is taken; it is then taken."""
    numbered = (f"{name}-{i}" for i in itertools.count(2))
    found = next(n for n in itertools.chain([name], numbered) if n not in taken)
    taken.add(found)
    return found


def letters() -> Iterator[str]:
    """A, B, ... Z, A1, B1 ..."""
    yield from string.ascii_uppercase
    yield from (f"{letter}{k}" for k in itertools.count(1) for letter in string.ascii_uppercase)


class Names:
    """The names of a model, given out one after the other."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.m = model
        self.bodies = set(TAKEN)
        self.joints = set(TAKEN)

    def title(self, stem: str) -> str:
        """What the mechanism is called: as the model is, or the file."""
        raw = self.m.names[: self.m.names.find(b"\0")].decode("utf-8", "replace").strip()
        name = raw if raw and raw != "MuJoCo Model" else stem
        return "".join(c if c.isprintable() else "_" for c in name).strip()[:LONGEST_NAME] or "linkage"

    def body(self, body: int) -> str:
        """The name of a link whose first body this is."""
        return free(plain(self.m.body(body).name) or f"link{body}", self.bodies)

    def of_pins(
        self, sites: Sequence[Site], pins: Sequence[PlanarPin], frames: Frames, near: float
    ) -> list[tuple[tuple[str, ...], Points | None]]:
        """Every name that each joint goes by, the one that it gets first; and where two sites of that name place it.

        That is the name of a pair of sites ``name:link`` in it, its own, that of a site at it (nearer than ``near``,
        m), or else a letter.
        """
        in_link: dict[int, list[Site]] = {}
        for site in sites:
            in_link.setdefault(site.link, []).append(site)
        pairs = [_pair(in_link, pin, frames, near, _looped(pin, pins)) for pin in pins]
        others = [_candidates(in_link, pin, near) for pin in pins]
        chosen: list[str] = []
        for pair, named in zip(pairs, others, strict=True):
            name = next((n for n in ([pair[0]] if pair else []) + named if n not in self.joints), "")
            self.joints.add(name)
            chosen.append(name)
        alphabet = (letter for letter in letters() if letter not in self.joints)
        chosen = [name or next(alphabet) for name in chosen]
        return [
            (tuple(dict.fromkeys((name, *named))), pair[1] if pair else None)
            for name, named, pair in zip(chosen, others, pairs, strict=True)
        ]


def _candidates(in_link: Mapping[int, Sequence[Site]], pin: PlanarPin, near: float) -> list[str]:
    """A joint's own name, and those of the sites at it."""
    at = [
        site.name.split(":")[0]
        for link, point in zip(pin.links, pin.points, strict=True)
        for site in in_link.get(link, ())
        if abs(site.point - point) <= near
    ]
    return [name for name in dict.fromkeys(map(plain, (*pin.names, *at))) if name]


def _looped(pin: PlanarPin, pins: Sequence[PlanarPin]) -> bool:
    """Whether a joint is in a loop: its links hang together without it."""
    others, near = [other for other in pins if other is not pin], {pin.links[0]}
    while more := {k for other in others if near & set(other.links) for k in other.links} - near:
        near |= more
    return pin.links[1] in near


def _pair(
    in_link: Mapping[int, Sequence[Site]], pin: PlanarPin, frames: Frames, near: float, looped: bool
) -> tuple[str, Points | None] | None:
    """The name that two sites ``name:link`` give a joint which they sit in, one in each of its links; and their points,
    but for a slide in no loop whose points they would set apart.
    """
    first, second = (
        {plain(site.name.split(":")[0]): site.point for site in in_link.get(link, ()) if ":" in site.name}
        for link in pin.links
    )
    for name, point in first.items():
        if not name or name not in second:
            continue
        off, across = _off(pin, frames, (point, second[name]))
        if across <= near:
            return name, (point, second[name]) if looped or off <= near else None
    return None


def _off(pin: PlanarPin, frames: Frames, points: Points) -> tuple[float, float]:
    """How far (m) two points, one in each link, are from being a joint's: together, and on the line of its slide."""
    if not pin.slides:
        off = max(abs(p - own) for p, own in zip(points, pin.points, strict=True))
        return off, off
    first, second = pin.links
    way = frames.within(first, frames.place(second, points[1])) - points[0]
    return abs(way), abs((way * pin.axis.conjugate()).imag)
