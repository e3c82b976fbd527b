"""Which link and joint of an MJCF file is which body and joint of a mechanism, and how their frames lie to each other.

Joints are matched as a graph, from the ground outward, and by where they sit in their bodies: names decide only where
several ways fit.  Masses, inertias and centres of mass take no part: they are what a cross-check is to find.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from analytic.mechanism import GROUND, Joint, Mechanism
from analytic.mechanism.parts import Body
from sim_models.engine import Unsupported
from sim_models.mjcf.parts import PlanarPin
from sim_models.mjcf.planar import Planar

LENGTHS_ALIKE = 1e-6  # of the linkage's size, or rad: lengths and angles that differ by more are others
MOST_TRIALS = 200_000  # assignments that are looked at


@dataclass(frozen=True)
class Frame:
    """How a body's frame lies in its link's: a point p (m) of the body is the link's ``shift + turn p``."""

    turn: complex
    shift: complex

    def of(self, point: complex) -> complex:
        """The link's point (m) of a body's."""
        return self.shift + self.turn * point

    def back(self, point: complex) -> complex:
        """The body's point (m) of a link's."""
        return (point - self.shift) / self.turn


@dataclass(frozen=True)
class Match:
    """Links by body, joints by joint, and frames by body, the ground among them."""

    links: Mapping[str, int]
    pins: Mapping[str, PlanarPin]
    frames: Mapping[str, Frame]

    def swapped(self, joint: Joint) -> bool:
        """Whether a joint's first body is the second link of its pin."""
        return self.pins[joint.name].links[0] != self.links[joint.bodies[0]]


@dataclass(frozen=True)
class _Spot:
    """Where a joint sits in a body and in its link: points (m), and directions of sliding (0 of a pin)."""

    joint: str
    ours: complex
    theirs: complex
    along: complex = 0j
    theirs_along: complex = 0j


def match(m: Mechanism, planar: Planar) -> Match:
    """The match of a mechanism and a file.  Raises Unsupported with what of the one the other lacks."""
    return _Matcher(m, planar).match()


class _Matcher:
    def __init__(self, m: Mechanism, planar: Planar) -> None:
        self.m, self.planar = m, planar
        self.near = LENGTHS_ALIKE * planar.size
        self.order = _outward(m)
        self.trials = 0
        self.said = planar.said

    def match(self) -> Match:
        self.counted()
        for found in self.ways({GROUND: 0}, {}, self.near):
            frames = self.frames(*found)
            if frames is not None:
                return Match(*found, frames)
        raise Unsupported(self.why())

    def counted(self) -> None:
        """Raise Unsupported where there are more joints or bodies in the one than in the other."""
        ours, theirs = self.m.joints, self.planar.pins
        for slides, kind in ((False, "hinge or connect"), (True, "slide")):
            here = [j.name for j in ours if j.prismatic == slides]
            there = [p.name for p in theirs if p.slides == slides]
            if len(here) != len(there):
                few, many, names = (
                    ("the case", self.said, there) if len(here) < len(there) else (self.said, "the case", here)
                )
                alone = [n for n in names if n not in (there if names is here else here)]
                which = f" ({', '.join(alone)})" if alone else ""
                raise Unsupported(
                    f"{self.said}: has {len(there)} joints that are a {kind}, the case {self.m.name} has {len(here)}:"
                    f" {few} lacks what {many} has{which}; describe the same linkage in both"
                )

    # ------------------------------------------------------------------ the graph

    def ways(
        self, links: dict[str, int], pins: dict[str, PlanarPin], near: float
    ) -> Iterator[tuple[dict[str, int], dict[str, PlanarPin]]]:
        """Every way to match the joints from the next one on, those of the same names first."""
        if len(pins) == len(self.order):
            yield dict(links), dict(pins)
            return
        joint = self.order[len(pins)]
        free = [p for p in self.planar.pins if p.slides == joint.prismatic and all(p is not q for q in pins.values())]
        for pin in sorted(free, key=lambda p: joint.name not in p.names):
            for ends in self.ends(pin, joint):
                self.trials += 1
                if self.trials > MOST_TRIALS:
                    return
                asked = dict(zip(joint.bodies, ends, strict=True))
                if not _agree(asked, links):
                    continue
                wider, more = links | asked, pins | {joint.name: pin}
                if all(self.rigid(body, wider, more, near) for body in joint.bodies):
                    yield from self.ways(wider, more, near)

    def ends(self, pin: PlanarPin, joint: Joint) -> list[tuple[int, int]]:
        """The links of a pin as a joint's first and second, the way their names have it first."""
        both = [pin.links, (pin.links[1], pin.links[0])]
        return sorted(both, key=lambda ends: -sum(
            self.planar.links[k].name == body for k, body in zip(ends, joint.bodies, strict=True)
        ))  # fmt: skip

    def rigid(self, body: str, links: Mapping[str, int], pins: Mapping[str, PlanarPin], near: float) -> bool:
        """Whether the pins that are matched lie as far apart in the body as in its link."""
        return next(self.unlike(self.spots(body, links, pins), near), None) is None

    def unlike(self, spots: list[_Spot], near: float) -> Iterator[tuple[_Spot, _Spot]]:
        """Pairs of pins that do not lie as far apart."""
        pins = [s for s in spots if not s.along]
        for i, one in enumerate(pins):
            for other in pins[:i]:
                if abs(abs(one.ours - other.ours) - abs(one.theirs - other.theirs)) > near:
                    yield other, one

    def spots(self, body: str, links: Mapping[str, int], pins: Mapping[str, PlanarPin]) -> list[_Spot]:
        """The matched joints of a body."""
        found = []
        for joint in self.m.joints:
            if body not in joint.bodies or joint.name not in pins:
                continue
            pin = pins[joint.name]
            side = 0 if pin.links[0] == links[body] else 1
            point = self.m.body(body).point(joint.name)
            along = theirs_along = 0j
            if joint.prismatic:
                along = joint.direction * (1 if body == joint.bodies[0] else cmath.exp(-1j * joint.angle))
                theirs_along = pin.axis * (1 if side == 0 else cmath.exp(-1j * pin.angle))
            found.append(_Spot(joint.name, point, pin.points[side], along, theirs_along))
        return found

    # ------------------------------------------------------------------ the frames

    def frames(self, links: Mapping[str, int], pins: Mapping[str, PlanarPin]) -> dict[str, Frame] | None:
        """How each body's frame lies in its link's; None where one does not fit."""
        found: dict[str, Frame] = {}
        bodies = dict.fromkeys([GROUND, *(b for j in self.order for b in j.bodies)])
        for body in bodies:
            fits = [f for f in self.fits(body, links, pins) if self.held(body, f, found, pins, links)]
            if not fits:
                return None
            found[body] = min(fits, key=lambda f: (self.miss(body, links[body], f), abs(cmath.phase(f.turn))))
        return found

    def miss(self, body: str, link: int, frame: Frame) -> float:
        """How far (m) a body's centre of mass is from its link's, where that decides."""
        part = self.m.body(body)
        if not isinstance(part, Body):
            return 0.0
        off = abs(frame.of(part.centre) - self.planar.links[link].centre)
        return off if off > self.near else 0.0

    def fits(self, body: str, links: Mapping[str, int], pins: Mapping[str, PlanarPin]) -> list[Frame]:
        """The frames in which a body's joints sit where its link has them."""
        spots = self.spots(body, links, pins)
        still = [s for s in spots if not s.along]
        lines = [s for s in spots if s.along]
        first = still[0] if still else lines[0]
        far = max(still, key=lambda s: abs(s.ours - first.ours), default=first)
        if abs(far.ours - first.ours) > self.near:
            turns = [(far.theirs - first.theirs) / (far.ours - first.ours)]
        elif lines:
            turns = [sign * lines[0].theirs_along / lines[0].along for sign in (1, -1)]
        else:
            turns = [self.turned(body, links[body], first)]
        frames = [self.moved(turn / abs(turn), first, lines) for turn in turns if turn]
        return [f for f in frames if all(self.sits(s, f) for s in spots)]

    def turned(self, body: str, link: int, pin: _Spot) -> complex:
        """The turn of a body that has one pin only: by its other named points, else by its centre of mass."""
        part, sites = self.m.body(body), {s.name.split(":")[0]: s for s in self.planar.sites if s.link == link}
        for name in part.points:
            at = part.point(name)
            if name in sites and abs(at - pin.ours) > self.near and abs(sites[name].point - pin.theirs) > self.near:
                return (sites[name].point - pin.theirs) / (at - pin.ours)
        if not isinstance(part, Body):
            return 1.0 + 0j
        arms = part.centre - pin.ours, self.planar.links[link].centre - pin.theirs
        return arms[1] / arms[0] if min(map(abs, arms)) > self.near else 1.0 + 0j

    def moved(self, turn: complex, first: _Spot, lines: list[_Spot]) -> Frame:
        """The frame of this turn in which the first joint sits; of two slides only, where both do."""
        shift = first.theirs - turn * first.ours
        for line in lines[1:] if first.along else ():
            across = (first.theirs_along * line.theirs_along.conjugate()).imag
            off = ((line.theirs - turn * line.ours - shift) * line.theirs_along.conjugate()).imag
            if abs(across) > LENGTHS_ALIKE:
                return Frame(turn, shift + first.theirs_along * off / across)
        return Frame(turn, shift)

    def sits(self, spot: _Spot, frame: Frame) -> bool:
        """Whether a joint sits where its link has it: at the point, or on the line."""
        off = spot.theirs - frame.of(spot.ours)
        if not spot.along:
            return abs(off) <= self.near
        parallel = abs((spot.theirs_along * (frame.turn * spot.along).conjugate()).imag) <= LENGTHS_ALIKE
        return parallel and abs((off * spot.theirs_along.conjugate()).imag) <= self.near

    def held(
        self,
        body: str,
        frame: Frame,
        known: Mapping[str, Frame],
        pins: Mapping[str, PlanarPin],
        links: Mapping[str, int],
    ) -> bool:
        """Whether the slides to bodies whose frames are known hold it at the angle that the mechanism has."""
        for joint in self.m.joints:
            if not joint.prismatic or body not in joint.bodies:
                continue
            turns = {**{b: f.turn for b, f in known.items()}, body: frame.turn}
            if not set(joint.bodies) <= set(turns):
                continue
            pin = pins[joint.name]
            angle = pin.angle if pin.links[0] == links[joint.bodies[0]] else -pin.angle
            first, second = (turns[b] for b in joint.bodies)
            if abs(cmath.exp(1j * joint.angle) - cmath.exp(1j * angle) * second / first) > LENGTHS_ALIKE:
                return False
        return True

    # ------------------------------------------------------------------ what is not alike

    def why(self) -> str:
        """What of the mechanism the file lacks, in a sentence."""
        self.trials = 0
        same = "; describe the same linkage in both (masses may differ)"
        for links, pins in self.ways({GROUND: 0}, {}, float("inf")):
            for body in links:
                for one, other in self.unlike(self.spots(body, links, pins), self.near):
                    here, there = abs(one.ours - other.ours), abs(one.theirs - other.theirs)
                    return (
                        f"{self.said}: on body {body!r} {one.joint} and {other.joint} are {there:.9g} m apart, and"
                        f" {here:.9g} m in the case {self.m.name}{same}"
                    )
            return f"{self.said}: its joints do not sit in its bodies as those of the case {self.m.name} do{same}"
        lost = next((j for j in self.m.joints if all(j.name not in p.names for p in self.planar.pins)), self.order[-1])
        names = ", ".join(p.name for p in self.planar.pins)
        return (
            f"{self.said}: no joint of it is {lost.name!r} of the case {self.m.name}, between {lost.bodies[0]} and"
            f" {lost.bodies[1]}; its joints are {names}{same}"
        )


def _agree(asked: Mapping[str, int], links: Mapping[str, int]) -> bool:
    """Whether bodies and links are still one to one."""
    for body, link in asked.items():
        if links.get(body, link) != link:
            return False
        if body not in links and link in links.values():
            return False
    return True


def _outward(m: Mechanism) -> list[Joint]:
    """The joints in an order in which each sits in a body that is known by then, from the ground outward."""
    known, order, left = {GROUND}, list[Joint](), list(m.joints)
    while left:
        joint = next((j for j in left if known & set(j.bodies)), left[0])
        left.remove(joint)
        order.append(joint)
        known |= set(joint.bodies)
    return order
