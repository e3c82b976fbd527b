"""Force, moment and power balances of a trace."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import MASS_CENTRE, Body
from sim_models.common.seen import Miss, Seen, cross, dot

SHORT = 1e-3  # of the longest body: the lever that forces are granted which have none


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


def balances(seen: Seen) -> Iterator[Miss]:
    """Force and moment balance of every body, and power balance of the whole where it moves."""
    for body in seen.m.bodies:
        force, moment = balance(seen, body)
        what = f"what acts on body {body.name!r} does not make up its"
        yield Miss("force", f"{what} mass times its acceleration", force.left, force.peak, "N", seen.nothing)
        lever = moment.peak + SHORT * seen.size * force.peak
        yield Miss(
            "moment",
            f"{what} moment of inertia times its angular acceleration",
            moment.left,
            lever,
            "N.m",
            seen.nothing * seen.size,
        )
    if not seen.still:
        flow = power(seen)
        what = "what acts on the linkage is not what changes its kinetic energy"
        yield Miss(
            "power",
            what,
            flow.left,
            flow.peak,
            "W",
            seen.nothing * seen.size * seen.pace + seen.largest * seen.rounding,
        )


def balance(seen: Seen, body: Body) -> tuple[Sum, Sum]:
    """Forces (N) on a body, and their moments (N.m) about its centre of mass, those of its inertia among them."""
    m, name, rates = seen.m, body.name, seen.trace.rates[body.name]
    force, moment, centre = Sum.of(seen.count), Sum.of(seen.count), seen.place(name, MASS_CENTRE)
    force.add(body.mass * (complex(*m.gravity) - rates.acceleration))
    moment.add(-body.moment_of_inertia * rates.angular_acceleration)
    for load in m.loads:
        if load.body == name:
            push, arm = complex(*load.force), seen.arm(name, load.point)
            force.add(push)
            moment.add(cross(arm, push) + load.torque, np.abs(arm) * abs(push) + abs(load.torque))
    for end, point, pull in seen.springs():
        if end == name:
            lever = seen.place(end, point) - centre
            force.add(pull)
            moment.add(cross(lever, pull), np.abs(lever) * np.abs(pull))
    for joint in m.joints:
        if name in joint.bodies:
            sign = 1.0 if joint.bodies[1] == name else -1.0
            reaction, arm, kink = sign * seen.reaction(joint), seen.acts_at(joint, name) - centre, seen.kink(joint)
            turn, hidden = seen.turning(joint)
            force.add(reaction, unknown=kink)
            moment.add(
                cross(arm, reaction) + sign * turn,
                np.abs(arm) * np.abs(reaction) + np.abs(turn),
                hidden + kink * np.abs(arm),
            )
    if name in (turned := seen.driving()):
        moment.add(turned[name])
    return force, moment


def power(seen: Seen) -> Sum:
    """Powers (W) of inertia, weight, loads, drive and joints.  Ideal pins give none; a clearance's, a soft bearing's
    and a slide's force does, by its slip.
    """
    m, flow = seen.m, Sum.of(seen.count)
    for body in m.bodies:
        rates = seen.trace.rates[body.name]
        flow.add(-body.mass * dot(rates.acceleration, rates.velocity))
        flow.add(body.mass * dot(rates.velocity, complex(*m.gravity)))
        flow.add(-body.moment_of_inertia * rates.angular_acceleration * seen.spin(body.name))
    for load in m.loads:
        flow.add(dot(seen.velocity(load.body, seen.arm(load.body, load.point)), complex(*load.force)))
        flow.add(load.torque * seen.spin(load.body))
    for turned, torque in seen.driving().items():
        flow.add(torque * seen.spin(turned))
    for end, point, push in seen.springs():
        flow.add(dot(push, seen.velocity(end, seen.arm(end, point))))
    for joint in m.joints:
        first, second = joint.bodies
        turning, (turn, hidden) = seen.spin(second) - seen.spin(first), seen.turning(joint)
        flow.add(turn * turning, unknown=hidden * np.abs(turning))
        if joint.prismatic or joint.name in seen.trace.clearance or joint.name in seen.request.bearings:
            slip = seen.slip(joint)
            flow.add(dot(seen.reaction(joint), slip), unknown=seen.kink(joint) * np.abs(slip))
    return flow
