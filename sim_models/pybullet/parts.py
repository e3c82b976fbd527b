"""Multibodies that a linkage in PyBullet is made of: links, ties between them, and struts in place of clearance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sim_models.common.contact_laws import lighter_mass
from sim_models.common.start import Pose
from sim_models.leapfrog.parts import AT_REST

if TYPE_CHECKING:
    from sim_models.pybullet.world import BulletWorld

TRIFLE = 1e-9  # kg, kg.m^2: bodies between the joints of a floating one
RIM = 1e-9  # of the clearance: how far beyond its limit a strut at rest is, lest rounding leave it short of it
SLIDE_X, SLIDE_Y, HINGE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Link:
    """A link of a Bullet multibody and the place of its com (m, in the body's frame)."""

    body: int
    index: int
    centre: complex = 0j


@dataclass(frozen=True)
class Tie:
    """A point constraint that carries the force of a joint's first body on its second, times ``sign``."""

    number: int
    sign: int


def flat(z: complex) -> list[float]:
    """A planar vector x + iy in Bullet's three dimensions."""
    return [z.real, z.imag, 0.0]


def floating(parent: int, number: int, com: complex, heavy: Mapping[str, float]) -> list[dict[str, Any]]:
    """Links of a body that floats in the plane: two slides and a hinge, the first two next to weightless."""
    between = {"mass": TRIFLE, "inertia": TRIFLE, "at": 0j, "twist": 0.0, "com": 0j}
    slides = [
        between | {"parent": parent, "slides": True, "axis": SLIDE_X},
        between | {"parent": number, "slides": True, "axis": SLIDE_Y},
    ]
    return [
        *slides,
        {**heavy, "at": 0j, "twist": 0.0, "com": com, "parent": number + 1, "slides": False, "axis": HINGE},
    ]


class Strut:
    """A weightless bar from a joint's first pin to its second: as long as the clearance, or, for contact, at most that.

    Where nothing moves its mass plays no part, so it is as heavy as the lighter link: a light one would spoil the
    solver.
    """

    def __init__(self, world: BulletWorld, name: str) -> None:
        self.world, self.pin = world, world.pins[name]
        self.mass = lighter_mass(world.mechanism, self.pin.joint)  # of each part
        part = {"mass": self.mass, "inertia": self.mass * self.pin.clearance**2}
        links = floating(-1, 0, 0j, part)
        tip = self.pin.clearance + 0j
        if world.request.joint_model == "contact":
            limits = -self.pin.clearance, self.pin.clearance * (1 - RIM)
            links += [
                {
                    **part,
                    "parent": 2,
                    "at": 0j,
                    "twist": 0.0,
                    "com": 0j,
                    "slides": True,
                    "axis": SLIDE_X,
                    "limits": limits,
                }
            ]
            tip = 0j
        begin, self.parts = len(world.freedoms), len(links)
        self.number = number = world.grow(links)
        self.own = list(range(begin, len(world.freedoms)))
        if world.request.joint_model == "contact":
            world.call("changeDynamics", number, 3, jointLowerLimit=limits[0], jointUpperLimit=limits[1])
        first, second = self.pin.joint.bodies
        ends = [world.points[body, name] for body in (first, second)]
        world.tie(world.links[first], ends[0], Link(number, 2), 0j)
        self.tie = world.tie(Link(number, len(links) - 1), tip, world.links[second], ends[1])

    def bear_up(self) -> None:
        """Carry its own weight during the next step."""
        weight = self.mass * complex(*self.world.mechanism.gravity)
        for part in range(2, self.parts) if weight else ():
            at = self.world.call("getLinkState", self.number, part, computeForwardKinematics=True)[0]
            self.world.call("applyExternalForce", self.number, part, flat(-weight), at, self.world.p.WORLD_FRAME)

    def coordinates(self, bodies: Mapping[str, Pose]) -> tuple[list[float], list[float]]:
        """Its coordinates and their rates, between the pins of bodies at these poses."""
        ends = []
        for body in self.pin.joint.bodies:
            pose = bodies.get(body, AT_REST)
            arm = self.world.points[body, self.pin.joint.name] * np.exp(1j * pose.angle)
            ends.append((pose.origin + arm, pose.velocity + 1j * pose.angular_velocity * arm))
        (p, p_rate), (q, q_rate) = ends
        angle = float(np.angle(q - p)) if q != p else 0.0
        rate = (q_rate - p_rate) * np.exp(-1j * angle)
        spin = rate.imag / abs(q - p) if q != p else 0.0
        return [p.real, p.imag, angle, abs(q - p)][: len(self.own)], [p_rate.real, p_rate.imag, spin, rate.real][
            : len(self.own)
        ]
