"""Force, moment and power balances of a trace."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import MASS_CENTRE, Body
from sim_models.common.traced import Miss, TracedLinkage, cross, dot

LEAST_LEVER = 1e-3  # of the longest body: the lever that forces are granted which have none


@dataclass
class Sum:
    """A sum of vectors or numbers (N,), of their sizes, and of what of them is not known."""

    total: np.ndarray
    sizes: np.ndarray
    unknown: np.ndarray

    @classmethod
    def of(cls, count: int) -> Sum:
        """An empty sum."""
        return cls(np.zeros(count, complex), np.zeros(count), np.zeros(count))

    def add(
        self, values: np.ndarray | complex, size: np.ndarray | float | None = None, unknown: np.ndarray | float = 0.0
    ) -> None:
        """Add to it; ``size`` is that of the parts of what is added, where they may cancel."""
        self.total = self.total + values
        self.sizes = self.sizes + (np.abs(values) if size is None else size)
        self.unknown = self.unknown + unknown

    @property
    def left(self) -> np.ndarray:
        """What is left of the sum (N,) beyond what is not known."""
        return np.maximum(np.abs(self.total) - self.unknown, 0.0)

    @property
    def peak(self) -> float:
        """The largest sum of sizes."""
        return float(self.sizes.max(initial=0.0))


def balances(linkage: TracedLinkage) -> Iterator[Miss]:
    """Force and moment balance of every body, and power balance of the whole where it moves."""
    for body in linkage.m.bodies:
        force, moment = balance(linkage, body)
        what = f"what acts on body {body.name!r} does not make up its"
        yield Miss("force", f"{what} mass times its acceleration", force.left, force.peak, "N", linkage.nothing)
        lever = moment.peak + LEAST_LEVER * linkage.size * force.peak
        yield Miss(
            "moment",
            f"{what} moment of inertia times its angular acceleration",
            moment.left,
            lever,
            "N.m",
            linkage.nothing * linkage.size,
        )
    if not linkage.still:
        flow = power(linkage)
        what = "what acts on the linkage is not what changes its kinetic energy"
        yield Miss(
            "power",
            what,
            flow.left,
            flow.peak,
            "W",
            linkage.nothing * linkage.size * linkage.pace + linkage.largest * linkage.rounding,
        )


def balance(linkage: TracedLinkage, body: Body) -> tuple[Sum, Sum]:
    """Forces (N) on a body, and their moments (N.m) about its centre of mass, those of its inertia among them."""
    m, name, rates = linkage.m, body.name, linkage.trace.rates[body.name]
    force, moment, centre = Sum.of(linkage.count), Sum.of(linkage.count), linkage.place(name, MASS_CENTRE)
    force.add(body.mass * (complex(*m.gravity) - rates.acceleration))
    moment.add(-body.moment_of_inertia * rates.angular_acceleration)
    for load in m.loads:
        if load.body == name:
            (push, turn, unsure, hidden), arm = linkage.load(load), linkage.arm(name, load.point)
            force.add(push, unknown=unsure)
            size = np.abs(arm) * np.abs(push) + np.abs(turn)
            moment.add(cross(arm, push) + turn, size, np.abs(arm) * unsure + hidden)
    for end, point, pull in linkage.springs():
        if end == name:
            lever = linkage.place(end, point) - centre
            force.add(pull)
            moment.add(cross(lever, pull), np.abs(lever) * np.abs(pull))
    for joint in m.joints:
        if name in joint.bodies:
            sign = 1.0 if joint.bodies[1] == name else -1.0
            reaction, arm, kink = (
                sign * linkage.reaction(joint),
                linkage.acts_at(joint, name) - centre,
                linkage.kink(joint),
            )
            turn, hidden = linkage.turning(joint)
            force.add(reaction, unknown=kink)
            moment.add(
                cross(arm, reaction) + sign * turn,
                np.abs(arm) * np.abs(reaction) + np.abs(turn),
                hidden + kink * np.abs(arm),
            )
    if name in (turned := linkage.driving()):
        moment.add(turned[name])
    return force, moment


def power(linkage: TracedLinkage) -> Sum:
    """Powers (W) of inertia, weight, loads, drive and joints.  Ideal pins give none; a clearance's, a soft bearing's
    and a slide's force does, by its slip.
    """
    m, flow = linkage.m, Sum.of(linkage.count)
    for body in m.bodies:
        rates = linkage.trace.rates[body.name]
        flow.add(-body.mass * dot(rates.acceleration, rates.velocity))
        flow.add(body.mass * dot(rates.velocity, complex(*m.gravity)))
        flow.add(-body.moment_of_inertia * rates.angular_acceleration * linkage.spin(body.name))
    for load in m.loads:
        push, turn, unsure, hidden = linkage.load(load)
        moving, spin = linkage.going(load.body, load.point), linkage.spin(load.body)
        flow.add(dot(moving, push), unknown=np.abs(moving) * unsure)
        flow.add(turn * spin, unknown=np.abs(spin) * hidden)
    for turned, torque in linkage.driving().items():
        flow.add(torque * linkage.spin(turned))
    for end, point, push in linkage.springs():
        flow.add(dot(push, linkage.velocity(end, linkage.arm(end, point))))
    for joint in m.joints:
        first, second = joint.bodies
        turning, (turn, hidden) = linkage.spin(second) - linkage.spin(first), linkage.turning(joint)
        flow.add(turn * turning, unknown=hidden * np.abs(turning))
        if joint.prismatic or joint.name in linkage.trace.clearance or joint.name in linkage.request.bearings:
            slip = linkage.slip(joint)
            flow.add(dot(linkage.reaction(joint), slip), unknown=linkage.kink(joint) * np.abs(slip))
    return flow
