"""Multibodies that a linkage in PyBullet is made of: links, ties between them, and struts in place of clearance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sim_models.common.start import AT_REST, Pose
from sim_models.leapfrog.parts import Pin

GHOST_MASS = 1e-9  # kg, kg.m^2: bodies between the joints of a floating one
BEYOND_LIMIT = 1e-9  # of the clearance: how far beyond its limit a strut at rest is, lest rounding leave it short of it
SLIDE_X, SLIDE_Y, HINGE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class TreeLink:
    """A link of a Bullet multibody and the place of its com (m, in the body's frame)."""

    body: int
    index: int
    centre: complex = 0j


@dataclass(frozen=True)
class Planned:
    """A link of a multibody to be made, and the joint that carries it."""

    mass: float  # kg
    inertia: float  # kg.m^2 about the com
    parent: int  # number of the link that carries it, -1 for the base
    slides: bool
    axis: tuple[float, float, float]
    at: complex = 0j  # m, the joint in the parent's joint's frame
    fixed_angle: float = 0.0  # rad, its frame from the parent's
    com: complex = 0j  # m, in the joint's frame
    limits: tuple[float, float] | None = None  # m, of a slide; None for none


@dataclass(frozen=True)
class Tie:
    """A point constraint that carries the force of a joint's first body on its second, times ``sign``."""

    number: int
    sign: int


def flat(z: complex) -> list[float]:
    """A planar vector x + iy in Bullet's three dimensions."""
    return [z.real, z.imag, 0.0]


def floating(parent: int, number: int, com: complex, mass: float, inertia: float, at: complex = 0j) -> list[Planned]:
    """Links of a body of this mass (kg) and moment of inertia (kg.m^2) that floats in the plane: two slides and a
    hinge, the first two next to weightless.  Its frame is in one that is ``at`` (m) in the parent's joint's.
    """
    return [
        Planned(GHOST_MASS, GHOST_MASS, parent, True, SLIDE_X, at),
        Planned(GHOST_MASS, GHOST_MASS, number, True, SLIDE_Y),
        Planned(mass, inertia, number + 1, False, HINGE, com=com),
    ]


def carried(base: Pose, own: Pose) -> Pose:
    """A pose in the frame of a body that moves, in the ground's."""
    turned = np.exp(1j * base.angle)
    arm, slip = own.origin * turned, own.velocity * turned
    velocity = base.velocity + 1j * base.angular_velocity * arm + slip
    return Pose(base.origin + arm, base.angle + own.angle, velocity, base.angular_velocity + own.angular_velocity)


def strut_links(pin: Pin, mass: float, one_sided: bool) -> tuple[list[Planned], complex]:
    """Links of a strut whose parts have this mass (kg), and where on the last of them its second end is (m)."""
    inertia = mass * pin.clearance**2
    links = floating(-1, 0, 0j, mass, inertia)
    if not one_sided:
        return links, pin.clearance + 0j
    limits = -pin.clearance, pin.clearance * (1 - BEYOND_LIMIT)
    return [*links, Planned(mass, inertia, 2, True, SLIDE_X, limits=limits)], 0j


@dataclass(frozen=True)
class Strut:
    """A weightless bar from a joint's first pin to its second: as long as the clearance, or, for contact, at most that.

    Where nothing moves its mass plays no part, so it is as heavy as the lighter link: a light one would spoil the
    solver.
    """

    pin: Pin
    ends: tuple[complex, complex]  # m, the pin centres in their bodies' frames
    mass: float  # kg, of each part
    number: int  # of its multibody
    parts: int  # of its links
    own: list[int]  # numbers of its freedoms
    tie: Tie  # at its second end

    def coordinates(self, bodies: Mapping[str, Pose]) -> tuple[list[float], list[float]]:
        """Its coordinates and their rates, between the pins of bodies at these poses."""
        ends = []
        for body, end in zip(self.pin.joint.bodies, self.ends, strict=True):
            pose = bodies.get(body, AT_REST)
            arm = end * np.exp(1j * pose.angle)
            ends.append((pose.origin + arm, pose.velocity + 1j * pose.angular_velocity * arm))
        (p, p_rate), (q, q_rate) = ends
        angle = float(np.angle(q - p)) if q != p else 0.0
        rate = (q_rate - p_rate) * np.exp(-1j * angle)
        spin = rate.imag / abs(q - p) if q != p else 0.0
        return [p.real, p.imag, angle, abs(q - p)][: len(self.own)], [p_rate.real, p_rate.imag, spin, rate.real][
            : len(self.own)
        ]
