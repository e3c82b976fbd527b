"""Random planar linkages that close by construction: poses first, then lengths and frames from the poses.

A linkage begins with a crank on the ground; dyads and groups of four bodies are added to it, each pinned to (or sliding
on) what is there already.  A manipulator begins with a platform on one to three legs, and has no drives yet.  Where
every joint is in the ground frame is chosen; the points of the bodies follow from random body frames.  Every choice
goes through :class:`Choice`, so that hypothesis shrinks a linkage to a plain one, and a seed makes the same linkage
again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from hypothesis import strategies as st

from analytic.mechanism import Mechanism

NOTCHES = 1000  # to either side of a choice's simplest value


class Choice(Protocol):
    """Where random numbers come from."""

    def whole(self, low: int, high: int) -> int:
        """An integer from low to high; low is the simplest."""
        ...


@dataclass(frozen=True)
class Seeded:
    """Choices of a seeded generator, for runs in bulk."""

    rng: np.random.Generator

    def whole(self, low: int, high: int) -> int:
        return int(self.rng.integers(low, high, endpoint=True))


@dataclass(frozen=True)
class Drawn:
    """Choices of hypothesis."""

    draw: st.DrawFn

    def whole(self, low: int, high: int) -> int:
        return self.draw(st.integers(low, high))


@dataclass(frozen=True)
class Ranges:
    """From what a linkage is chosen: powers of ten unless it says otherwise, (smallest, simplest, largest)."""

    length: tuple[float, float, float] = (
        -6.0,
        0.0,
        0.8,
    )  # of the crank, m; a linkage is up to some five times as large
    speed: tuple[float, float, float] = (-3.0, 0.0, 3.0)  # rad/s
    mass: tuple[float, float, float] = (-6.0, 0.0, 3.0)  # kg, of the whole linkage
    spread: float = 4.5  # of a body's mass to either side of that
    gravity: tuple[float, float, float] = (-3.0, 0.0, 2.0)  # m/s^2
    load: tuple[float, float, float] = (-2.0, 0.0, 2.0)  # over weight and inertia force
    clearance: tuple[float, float, float] = (-6.0, -3.0, -1.5)  # over the crank's length
    groups: tuple[int, int] = (0, 3)
    friction: bool = True
    soft: bool = False  # bearings in place of clearance
    curved: bool = False  # drag, Stribeck's friction, springs that are not linear, a torque over the crank angle


WIDE = Ranges()
ARMS = Ranges(length=(-2.0, -0.5, 0.5), speed=(-1.0, 0.0, 1.0), mass=(-1.0, 0.0, 1.0), spread=0.7, friction=False)
HUMAN = Ranges(
    length=(-1.3, -1.0, -0.7), speed=(0.0, 1.0, 1.5), mass=(-1.0, 0.0, 0.5), spread=0.5, gravity=(0.0, 0.99, 1.0),
    load=(-1.0, 0.0, 0.7), clearance=(-3.0, -2.5, -2.0), groups=(1, 2), friction=False,
)  # fmt: skip


def seeded(seed: int, ranges: Ranges = WIDE) -> Mechanism:
    """The linkage of that seed."""
    return linkage(Seeded(np.random.default_rng(seed)), ranges, f"linkage {seed}")


@st.composite
def linkages(draw: st.DrawFn, ranges: Ranges = WIDE) -> Mechanism:
    """Random linkages that shrink to a lone crank of 1 m at 1 rad/s."""
    return linkage(Drawn(draw), ranges, "drawn linkage")


def linkage(choice: Choice, ranges: Ranges = WIDE, name: str = "random linkage") -> Mechanism:
    """A random linkage that is assembled at its assembly angles, up to a little by which those are off."""
    frame = _Skeleton(choice)
    frame.crank()
    for _ in range(choice.whole(*ranges.groups)):
        (frame.dyad, frame.dyad, frame.dyad, frame.dyad, frame.three_legs, frame.square)[choice.whole(0, 5)]()
    return Mechanism.model_validate({"name": name} | _Flesh(choice, ranges, frame).fields())


def manipulator(seed: int, ranges: Ranges = ARMS) -> Mechanism:
    """That seed's platform, which moves in three ways, assembled exactly at its assembly angles and driven nowhere."""
    choice = Seeded(np.random.default_rng(seed))
    frame = _Skeleton(choice)
    frame.platform(choice.whole(1, 3))
    for _ in range(choice.whole(0, 1)):
        frame.dyad()
    if _chance(choice, 25):
        frame.twin()
    name = f"manipulator {seed}"
    return Mechanism.model_validate({"name": name} | _Flesh(choice, ranges, frame).fields())


def polar(choice: Choice, small: float, simple: float, large: float) -> complex:
    """A vector of random direction."""
    return real(choice, small, simple, large) * turn(choice)


def turn(choice: Choice) -> complex:
    """A random unit vector."""
    return complex(np.exp(1j * real(choice, -math.pi, 0.0, math.pi)))


def real(choice: Choice, low: float, simple: float, high: float) -> float:
    """A number from low to high; ``simple`` is what it shrinks to."""
    notch = _either(choice, choice.whole(0, NOTCHES)) / NOTCHES
    return simple + notch * (high - simple if notch > 0 else simple - low)


def power(choice: Choice, low: float, simple: float, high: float) -> float:
    """A power of ten."""
    return float(10 ** real(choice, low, simple, high))


def _either(choice: Choice, value: int) -> int:
    return -value if choice.whole(0, 1) else value


def _chance(choice: Choice, percent: int) -> bool:
    return choice.whole(0, 99) >= 100 - percent


@dataclass
class _Skeleton:
    """Bodies and joints of a linkage whose crank is 1 long, where they are in the ground frame."""

    choice: Choice
    poses: dict[str, tuple[complex, complex]] = field(
        default_factory=lambda: {"ground": (0j, 1 + 0j)}
    )  # origin, x axis
    places: dict[str, dict[str, complex]] = field(default_factory=lambda: {"ground": {}})
    joints: list[dict[str, Any]] = field(default_factory=list)

    def crank(self) -> None:
        self.body("crank")
        pivot = polar(self.choice, 0.0, 0.0, 1.0)
        self.pin("ground", "crank", pivot)
        self.places["crank"]["tip"] = pivot + turn(self.choice)

    def dyad(self) -> None:
        """Two bodies and three joints, of which one or two may be prismatic."""
        c = self.choice
        ground = self.pick(list(self.poses))
        other = self.pick([b for b in self.poses if b != ground])
        at = self.anchor(other)
        base = polar(c, 0.3, 2.0, 4.0)
        inner = at + base * real(c, 0.3, 1.0, 3.0) * np.exp(1j * _either(c, 1) * real(c, 0.26, 1.05, 2.88))
        slides = (0, 0, 0, 0, 1, 2, 4, 3, 5, 6)[c.whole(0, 9)]  # one bit a joint
        first, second = self.body(), self.body()
        for k, (a, b, z) in enumerate(((other, first, at), (first, second, inner), (ground, second, at + base))):
            self.join(bool(slides >> k & 1), a, b, z)

    def three_legs(self) -> None:
        """A triad: a ternary link on three legs."""
        c = self.choice
        middle = self.anchor("crank") + polar(c, 0.5, 1.5, 3.0)
        plate = self.body()
        holders = ["crank", "ground", *(self.pick([*self.poses][:-1]) for _ in range(1))]
        for k, holder in enumerate(holders):
            knee = middle + real(c, 0.3, 0.6, 1.5) * np.exp(1j * (2 * math.pi * k / 3 + real(c, -0.8, 0.0, 0.8)))
            leg = self.body()
            slides = (0, 0, 0, 0, 1, 2)[c.whole(0, 5)]
            self.join(bool(slides & 1), plate, leg, knee)
            self.join(bool(slides & 2), holder, leg, knee + polar(c, 0.5, 1.2, 3.0))

    def platform(self, legs: int) -> None:
        """A link on RRR, RPR, PRR or RRP legs from the ground, or from another leg."""
        c = self.choice
        middle = polar(c, 0.0, 1.0, 2.0)
        plate = self.body("platform")
        for k in range(legs):
            holder = self.pick([b for b in self.poses if b != plate]) if k and _chance(c, 30) else "ground"
            knee = middle + real(c, 0.3, 0.6, 1.5) * np.exp(1j * (2 * math.pi * k / legs + real(c, -0.8, 0.0, 0.8)))
            foot = knee + polar(c, 0.8, 1.5, 3.0)
            elbow = (knee + foot) / 2 + polar(c, 0.3, 0.7, 1.5)
            slides = (0, 0, 2, 1, 4)[c.whole(0, 4)]  # one bit a joint
            upper, lower = self.body(), self.body()
            for j, (a, b, z) in enumerate(((holder, upper, foot), (upper, lower, elbow), (lower, plate, knee))):
                self.join(bool(slides >> j & 1), a, b, z)

    def twin(self) -> None:
        """A second link on the two pins of one: one more than the linkage needs.  What it joins has other pins too."""
        pins: dict[str, set[complex]] = {b: set() for b in self.poses}
        near = {b: [j for j in self.joints if b in j["bodies"]] for b in self.poses if b != "ground"}
        for joint in (j for j in self.joints if j["type"] == "revolute"):
            for b in joint["bodies"]:
                pins[b].add(self.places[b][joint["name"]])
        held = {b: {other for j in own for other in j["bodies"]} - {"ground"} for b, own in near.items()}
        rods = [b for b, own in near.items() if len(own) == 2 and all(len(pins[other]) > 1 for other in held[b])]
        if rods:
            rod, twin = self.pick(rods), self.body()
            for joint in near[rod]:
                other = next(b for b in joint["bodies"] if b != rod)
                self.pin(other, twin, self.places[rod][joint["name"]])

    def square(self) -> None:
        """Four bodies in a loop of their own, two opposite ones of which hang on the rest."""
        c = self.choice
        names = [self.body() for _ in range(4)]
        holders = [self.pick(["crank", *list(self.poses)[:-4]]), "ground"]
        at = self.anchor(holders[0])
        middle = at + polar(c, 0.5, 1.5, 3.0)
        corners = [
            middle + real(c, 0.4, 0.7, 1.5) * np.exp(1j * (math.pi * k / 2 + real(c, -0.5, 0.0, 0.5))) for k in range(4)
        ]
        for k in range(4):
            self.join(_chance(c, 10), names[k], names[(k + 1) % 4], corners[k])
        self.pin(holders[0], names[0], at)
        self.pin(holders[1], names[2], middle + polar(c, 0.5, 1.5, 3.0))

    def body(self, name: str = "") -> str:
        name = name or f"link{len(self.poses) - 1}"
        self.poses[name] = (polar(self.choice, 0.0, 0.0, 1.0), turn(self.choice))
        self.places[name] = {}
        return name

    def pick(self, some: list[Any]) -> Any:
        return some[self.choice.whole(0, len(some) - 1)]

    def anchor(self, body: str) -> complex:
        """A place on a body for a new joint: where it has a point already, or beside that."""
        there = [z for name, z in self.places[body].items() if (body, name) != ("crank", "J0")][::-1]
        at = self.pick(there)
        slides = any(
            j["type"] == "prismatic" and body in j["bodies"] for j in self.joints
        )  # with two pins in one place it would have no length
        lone = body != "ground" and len(self.places[body]) == 1
        return at + polar(self.choice, 0.3, 0.5, 2.0) if slides or lone or _chance(self.choice, 60) else at

    def join(self, slides: bool, first: str, second: str, z: complex) -> None:
        (self.slide if slides else self.pin)(first, second, z)

    def pin(self, first: str, second: str, z: complex) -> None:
        name = f"J{len(self.joints)}"
        bodies = [second, first] if self.choice.whole(0, 1) else [first, second]
        self.places[first][name] = self.places[second][name] = z
        self.joints.append({"name": name, "type": "revolute", "bodies": bodies})

    def slide(self, first: str, second: str, z: complex) -> None:
        name, along = f"J{len(self.joints)}", turn(self.choice)
        first, second = (second, first) if self.choice.whole(0, 1) else (first, second)
        self.places[first][name] = z
        self.places[second][name] = z + real(self.choice, -1.0, 0.0, 1.0) * along
        axis = along / self.poses[first][1] * real(self.choice, 0.5, 1.0, 2.0)
        turned = np.angle(self.poses[second][1]) - np.angle(self.poses[first][1])
        angle = float(turned + 2 * math.pi * (len(self.joints) % 3 - 1))  # in a turn that is not the assembly's
        self.joints.append(
            {"name": name, "type": "prismatic", "bodies": [first, second], "axis": pair(axis), "angle": angle}
        )


@dataclass
class _Flesh:
    """Sizes, masses, loads and joint laws on a skeleton."""

    choice: Choice
    ranges: Ranges
    skeleton: _Skeleton

    def fields(self) -> dict[str, Any]:
        c, r, s = self.choice, self.ranges, self.skeleton
        self.length, self.mass, speed = power(c, *r.length), power(c, *r.mass), power(c, *r.speed)
        gravity = power(c, *r.gravity) * turn(c) if _chance(c, 70) else 0j
        self.force = self.mass * (abs(gravity) + self.length * speed**2)
        self.speed = speed
        cranked = "crank" in s.poses
        drive = self.drive(speed) if cranked else None
        driven = {b for j in s.joints if drive and j["name"] == drive["joint"] for b in j["bodies"]}
        return {
            "gravity": pair(gravity),
            "ground": {"points": self.points("ground")},
            "body": [self.body(b) for b in s.poses if b != "ground"],
            "joint": [self.laws(j) for j in s.joints],
            "drive": drive or [],
            "load": [self.load() for _ in range(c.whole(0, 3))],
            "spring": [] if cranked else [self.spring() for _ in range(c.whole(0, 2))],
            "assembly": {
                b: float(np.angle(x)) + (cranked and b not in driven) * real(c, -0.01, 0.0, 0.01)
                for b, (_, x) in s.poses.items()
                if b != "ground"
            },
        }

    def points(self, body: str) -> dict[str, list[float]]:
        origin, x = self.skeleton.poses[body]
        return {name: pair(self.length * (z - origin) / x) for name, z in self.skeleton.places[body].items()}

    def body(self, name: str) -> dict[str, Any]:
        c = self.choice
        body: dict[str, Any] = {
            "name": name,
            "points": self.points(name),
            "mass": self.mass * power(c, -self.ranges.spread, 0.0, self.ranges.spread),
        }
        if _chance(c, 50):
            body["com"] = pair(self.length * polar(c, 0.0, 0.5, 2.0))
        if _chance(c, 20):
            body["marker"] = pair(self.length * polar(c, 0.0, 0.5, 2.0))
        if _chance(c, 30):
            body["section"] = [self.length * power(c, -3.0, -1.0, 0.0), self.length * power(c, -3.0, -1.0, 0.0)]
        if _chance(c, 50):
            body["inertia"] = body["mass"] * self.length**2 * power(c, -2.0, -1.0, 1.0)
        elif len(body["points"]) < 2:  # a bar without length
            body["inertia"] = body["mass"] * self.length**2 / 12
        return body

    def laws(self, joint: dict[str, Any]) -> dict[str, Any]:
        """A joint's spring, damper, friction and clearance; where it slides, they are forces."""
        c, slides = self.choice, joint["type"] == "prismatic"
        unit, size = self.force * (1.0 if slides else self.length), self.length if slides else 1.0
        laws: dict[str, Any] = {}
        if _chance(c, 25):
            laws |= {"stiffness": unit / size * power(c, -2.0, 0.0, 1.0), "rest_angle": size * real(c, -3.0, 0.0, 3.0)}
        if _chance(c, 25):
            laws["damping"] = unit / size / self.speed * power(c, -2.0, 0.0, 1.0)
        if self.ranges.friction and _chance(c, 15):
            laws["friction_torque"] = unit * power(c, -2.0, 0.0, 1.0)
        if self.ranges.curved and _chance(c, 30):
            laws["cubic"] = _either(c, 1) * unit / size**3 * power(c, -2.0, -1.0, 0.0)
        if self.ranges.curved and _chance(c, 30):
            laws["drag"] = unit / (size * self.speed) ** 2 * power(c, -2.0, 0.0, 1.0)
        if self.ranges.curved and _chance(c, 30):
            laws["static_torque"] = laws.get("friction_torque", 0.0) + unit * power(c, -2.0, 0.0, 1.0)
            laws["stribeck_speed"] = size * self.speed * power(c, -1.0, -0.3, 0.0)
        if self.ranges.curved and not slides and _chance(c, 30):
            laws["friction_radius"] = self.length * power(c, -4.0, -2.0, -1.0)
        if not slides and _chance(c, 35):
            size = self.length * power(c, *self.ranges.clearance)
            laws |= {"radial_stiffness": self.force / size} if self.ranges.soft else {"clearance": size}
        return joint | laws

    def load(self) -> dict[str, Any]:
        c = self.choice
        body = self.skeleton.pick([b for b in self.skeleton.poses if b != "ground"])
        load: dict[str, Any] = {"body": body, "point": self.skeleton.pick(["com", *self.skeleton.places[body]])}
        size = self.force * power(c, *self.ranges.load)
        return load | (
            {"torque": _either(c, 1) * size * self.length} if _chance(c, 30) else {"force": pair(size * turn(c))}
        )

    def spring(self) -> dict[str, Any]:
        """Between points of two bodies that lie apart, not in one joint, with a damper beside it."""
        c = self.choice
        points = [(b, name, z) for b, own in self.skeleton.places.items() for name, z in own.items()]
        one = self.skeleton.pick(points)
        ends = [one, self.skeleton.pick([p for p in points if not {*p[:2]} & {*one[:2]} and abs(p[2] - one[2]) > 0.1])]
        law = {"stiffness": self.force / self.length, "damping": 0.3 * self.force / self.length / self.speed}
        bodies, names, _ = zip(*ends, strict=True)
        return {"bodies": bodies, "points": names, "length": self.length * power(c, -1.0, 0.0, 0.5)} | law

    def drive(self, speed: float) -> dict[str, Any]:
        """At the crank, or at another pin on the ground, which makes other groups of the same joints."""
        on_ground = [j["name"] for j in self.skeleton.joints if j["type"] == "revolute" and "ground" in j["bodies"]]
        joint = on_ground[0] if not _chance(self.choice, 15) else self.skeleton.pick(on_ground)
        drive: dict[str, Any] = {"joint": joint, "speed": _either(self.choice, 1) * speed}
        if self.ranges.curved and _chance(self.choice, 30):
            torque = self.force * self.length * power(self.choice, -2.0, 0.0, 1.0)
            drive["periodic_torque"] = {"amplitude": torque, "harmonic": 3, "phase": real(self.choice, -3.0, 0.0, 3.0)}
        return drive


def pair(z: complex) -> list[float]:
    """[x, y] of a planar vector x + iy."""
    return [float(np.real(z)), float(np.imag(z))]
