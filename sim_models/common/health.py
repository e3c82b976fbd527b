"""What must be true of a run whatever the model: a run of which it is not has failed, and is no referee.

A run is held to the mechanism that it was asked for, by its trace alone:

``pins``        ideal pins coincide, and so do their velocities and accelerations; the clearance signals are where the pins are;
``slides``      a prismatic joint keeps its angle, and its second body's point the line;
``crank``       the driven body is where a rigid drive has it, and as fast;
``bearing``     a pin is inside its bearing, or on its rim;
``line``        a pin without friction is pushed along its displacement, by nothing while it is free;
``force``       every body's loads, weight and reactions make up its mass times its acceleration;
``moment``      and their moments about its centre of mass its moment of inertia times its angular acceleration;
``power``       and what loads, weight, drive and joints give is what changes the linkage's kinetic energy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import MASS_CENTRE, Body, Joint
from sim_models.common.seen import Seen
from sim_models.engine import Request, SimulationError, Trace

SHORT = 1e-3  # of the longest body: a lever by which forces make up for none
REST = 1e-5  # m/s^2: forces that give the whole linkage's mass no more are nothing


class Implausible(SimulationError):
    """A run of which something is not true that must be; the message says what, where, how far and the remedy."""


@dataclass(frozen=True)
class Miss:
    """By how much (N,) a run misses what must be true; ``scale`` is what that is measured by, ``what`` it is in words."""

    check: str
    what: str
    size: np.ndarray
    scale: float
    unit: str
    floor: float = 0.0  # what is nothing

    @property
    def share(self) -> np.ndarray:
        """The miss as a share (N,) of its scale."""
        return self.size / self.scale if self.scale > 0 else np.where(self.size > 0, np.inf, 0.0)


@dataclass
class Sum:
    """A sum of vectors or numbers (N,), and of their sizes."""

    total: np.ndarray
    sizes: np.ndarray

    @classmethod
    def of(cls, count: int) -> Sum:
        """An empty sum."""
        return cls(np.zeros(count, complex), np.zeros(count))

    def add(self, values: np.ndarray | complex, size: np.ndarray | float | None = None) -> None:
        """Add to it; ``size`` is that of the parts of what is added, where they may cancel."""
        self.total = self.total + values
        self.sizes = self.sizes + (np.abs(values) if size is None else size)

    @property
    def peak(self) -> float:
        """The largest sum of sizes."""
        return float(self.sizes.max(initial=0.0))


def _cross(a: np.ndarray, b: np.ndarray | complex) -> np.ndarray:
    return np.asarray((np.conj(a) * b).imag)


def _dot(a: np.ndarray, b: np.ndarray | complex) -> np.ndarray:
    return np.asarray((np.conj(a) * b).real)


# -------------------------------------------------------------------- checks


def balances(seen: Seen) -> Iterator[Miss]:
    """Force and moment balance of every body."""
    m = seen.m
    for body in m.bodies:
        name, rates = body.name, seen.trace.rates[body.name]
        force, moment = Sum.of(seen.count), Sum.of(seen.count)
        unsure, turning = np.zeros(seen.count), np.zeros(seen.count)  # what of them is not known

        def act(push: np.ndarray | complex, arm: np.ndarray, turn: np.ndarray | float = 0.0, force: Sum = force, moment: Sum = moment) -> None:
            force.add(push)
            moment.add(_cross(arm, push) + turn, np.abs(arm) * np.abs(push) + np.abs(turn))

        centre = seen.place(name, MASS_CENTRE)
        act(-body.mass * (rates.acceleration - complex(*m.gravity)), 0 * centre, -body.moment_of_inertia * rates.angular_acceleration)
        for load in m.loads:
            if load.body == name:
                act(complex(*load.force), seen.arm(name, load.point), load.torque)
        for joint in m.joints:
            if name not in joint.bodies:
                continue
            sign = 1.0 if joint.bodies[1] == name else -1.0
            turn = seen.signal(f"reaction_{joint.name}_moment") if joint.prismatic else 0.0
            if not joint.prismatic:
                turn, hidden = seen.law(joint)
                turning = turning + hidden
            arm = seen.acts_at(joint, name) - centre
            act(sign * seen.reaction(joint), arm, sign * turn)
            kink = seen.kink(joint)
            unsure, turning = unsure + kink, turning + kink * np.abs(arm)
        if name == m.driven:
            act(0.0, 0 * centre, seen.drive_torque)
        floor = REST * sum(b.mass for b in m.bodies)
        yield Miss(
            "force",
            f"the forces on body {name!r} do not make up its mass times its acceleration",
            np.maximum(np.abs(force.total) - unsure, 0.0),
            force.peak,
            "N",
            floor,
        )
        size, scale = np.maximum(np.abs(moment.total) - turning, 0.0), moment.peak + SHORT * seen.size * force.peak
        what = f"the moments on body {name!r} do not make up its moment of inertia times its angular acceleration"
        yield Miss("moment", what, size, scale, "N.m", floor * seen.size)


def power(seen: Seen) -> Iterator[Miss]:
    """Power balance of the whole linkage."""
    m, flow, unknown = seen.m, Sum.of(seen.count), np.zeros(seen.count)
    for body in m.bodies:
        rates = seen.trace.rates[body.name]
        flow.add(-body.mass * _dot(rates.acceleration, rates.velocity))
        flow.add(-body.moment_of_inertia * rates.angular_acceleration * seen.spin(body.name))
        flow.add(body.mass * _dot(rates.velocity, complex(*m.gravity)))
    for load in m.loads:
        flow.add(_dot(seen.velocity(load.body, seen.arm(load.body, load.point)), complex(*load.force)))
        flow.add(load.torque * seen.spin(load.body))
    flow.add(seen.drive_torque * seen.spin(m.driven))
    for joint in m.joints:
        first, second = joint.bodies
        if not joint.prismatic:
            torque, hidden = seen.law(joint)
            rate = seen.spin(second) - seen.spin(first)
            flow.add(torque * rate)
            unknown = unknown + hidden * np.abs(rate)
        if joint.prismatic or joint.name in seen.trace.clearance:
            rate = seen.slip(joint)
            flow.add(_dot(seen.reaction(joint), rate))
            unknown = unknown + seen.kink(joint) * np.abs(rate)
    what = "what loads, weight, drive and joints give is not what changes the linkage's kinetic energy"
    yield Miss(
        "power", what, np.maximum(np.abs(flow.total) - unknown, 0.0), flow.peak, "W", REST * sum(b.mass for b in m.bodies) * seen.pace * seen.size
    )


def pins(seen: Seen) -> Iterator[Miss]:
    """Ideal pins that come apart, and clearance signals that are not where the pins are."""
    m, moves = seen.m, seen.trace.rates and not seen.still
    for joint in m.joints:
        if joint.prismatic:
            continue
        gap = seen.gap(joint)
        if joint.name in seen.trace.clearance:
            off = np.abs(gap - seen.vector(f"clearance_{joint.name}"))
            yield Miss("signal", f"the displacement of joint {joint.name!r} is not that of its pins", off, seen.trace.clearance[joint.name], "m")
            continue
        yield Miss("pins", f"the pins of joint {joint.name!r} come apart", np.abs(gap), seen.size, "m")
        if moves:
            yield from parting(seen, joint, lambda change: np.abs(change))


def parting(seen: Seen, joint: Joint, part: Callable[[np.ndarray], np.ndarray]) -> Iterator[Miss]:
    """Velocities and accelerations by which a joint that is closed opens."""
    speeds, accelerations = fastest(seen)
    yield Miss("parting", f"the pins of joint {joint.name!r} move apart", part(seen.slip(joint)), speeds, "m/s")
    yield Miss("jolt", f"the pins of joint {joint.name!r} accelerate apart", part(seen.slip(joint, seen.acceleration)), accelerations, "m/s^2")


def fastest(seen: Seen) -> tuple[float, float]:
    """The largest speed (m/s) and acceleration (m/s^2) of the bodies."""
    every = [seen.trace.rates[b.name] for b in seen.m.bodies]
    speed = max(float((np.abs(r.velocity) + seen.size * np.abs(seen.spin(b.name))).max()) for r, b in zip(every, seen.m.bodies, strict=True))
    turned = [seen.size * (np.abs(r.angular_acceleration) + seen.spin(b.name) ** 2) for r, b in zip(every, seen.m.bodies, strict=True)]
    return speed, max(float((np.abs(r.acceleration) + t).max()) for r, t in zip(every, turned, strict=True))


def slides(seen: Seen) -> Iterator[Miss]:
    """Slides that leave their line or turn."""
    for joint in seen.m.joints:
        if not joint.prismatic:
            continue
        first, second = joint.bodies
        turned = np.abs(np.exp(1j * (seen.angle(second) - seen.angle(first) - joint.angle)) - 1)
        yield Miss("turned", f"the bodies of slide {joint.name!r} turn against each other", turned, 1.0, "rad")
        off = np.abs(_cross(joint.direction * np.exp(1j * seen.angle(first)), -seen.gap(joint)))
        yield Miss("pins", f"the block of slide {joint.name!r} leaves its line", off, seen.size, "m")


def crank(seen: Seen) -> Iterator[Miss]:
    """A rigidly driven crank that is not where, or not as fast, as its motor."""
    r, m, name = seen.request, seen.m, seen.m.driven
    if m.drive is None or (m.drive.speed == "free" and not seen.still) or r.course is not None:
        return
    behind = seen.drive_torque / m.drive.stiffness if m.drive.stiffness else 0.0
    off = np.abs(np.exp(1j * (seen.angle(name) + behind - r.crank_angle)) - 1)
    yield Miss("crank", f"the crank {name!r} is not where its motor has it", off, 1.0, "rad")
    if not m.drive.stiffness and not seen.still and m.speed:
        yield Miss("speed", f"the crank {name!r} does not turn as its motor", np.abs(seen.spin(name) - m.speed), abs(m.speed), "rad/s")
        if seen.trace.rates:
            yield Miss("evenness", f"the crank {name!r} does not turn evenly", np.abs(seen.spin_up(name)), m.speed**2, "rad/s^2")


def bearings(seen: Seen) -> Iterator[Miss]:
    """Pins that are not in their bearings, or pushed otherwise than by them."""
    for name, clearance in seen.trace.clearance.items():
        joint, gap = seen.m.joint(name), seen.gap(seen.m.joint(name))
        path = np.concatenate([np.hypot(*seen.trace.journal[name].T), np.abs(gap)]) if name in seen.trace.journal else np.abs(gap)
        deep = path - clearance
        if seen.trace.joint_model == "massless-link":
            yield Miss("rod", f"the massless link of joint {name!r} changes its length", np.abs(deep), clearance, "m")
        else:
            links = [b.length for b in map(seen.m.body, joint.bodies) if isinstance(b, Body) and b.length]
            yield Miss("bearing", f"the pin of joint {name!r} leaves its bearing", np.maximum(deep, 0.0), min(links, default=seen.size), "m")
        force, reach = seen.reaction(joint), np.maximum(np.abs(gap), 1e-300)
        if not seen.rubs(joint):
            across = np.abs(_cross(gap, force)) / reach
            yield Miss("line", f"the force of joint {name!r} is not along its pin's displacement", across, float(np.abs(force).max()), "N")
        if seen.trace.joint_model != "massless-link":
            loose = np.where(np.abs(gap) < 0.9 * clearance, np.abs(force), 0.0)
            yield Miss("loose", f"the free pin of joint {name!r} is pushed", loose, float(np.abs(force).max()), "N")


LIMITS = {
    "pins": 1e-5, "signal": 1e-6, "parting": 1e-5, "jolt": 1e-3, "turned": 1e-6, "crank": 1e-6, "speed": 1e-6, "evenness": 1e-5,
    "bearing": 0.1, "rod": 5e-3, "line": 1e-4, "loose": 1e-4, "force": 1e-4, "moment": 1e-4, "power": 1e-4,
}  # fmt: skip


def check(request: Request, trace: Trace) -> None:
    """Raise Implausible where a run is not what it must be."""
    for miss in misses(request, trace):
        allowed = max(LIMITS[miss.check] * miss.scale, miss.floor)
        worst = int(np.argmax(miss.size))
        if not miss.size[worst] <= allowed:
            at = f"crank angle {np.degrees(trace.crank_angle[worst]):.4g} deg" if worst < trace.crank_angle.size else "a moment between reports"
            raise Implausible(
                f"{trace.simulator} {trace.joint_model} {trace.motion} ({request.mechanism.name}): {miss.what} at {at}: by {miss.size[worst]:.3g} "
                f"{miss.unit}, and {allowed:.3g} {miss.unit} is in order; the run is no evidence: use a smaller step, or another simulator"
            )


def misses(request: Request, trace: Trace) -> Iterator[Miss]:
    """Everything that must be true of a run, and by how much it misses it."""
    seen = Seen(request, trace)
    for part in (pins, slides, crank, bearings):
        yield from part(seen)
    if trace.rates:
        yield from balances(seen)
        if not seen.still:
            yield from power(seen)
