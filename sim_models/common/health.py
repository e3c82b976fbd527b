"""What must be true of every run, whatever the model: a run that breaks it has failed, and is no evidence.

A run is held to the mechanism that it was asked for (its masses and inertias, never the engine's), by its trace alone.
Each check has a scale of the run's own, of which CHECK_LIMITS says the share that may be missed, of static runs, of
moving ones with ideal joints, and with clearances.  "Left" is the largest share that good runs have left: the shipped
cases, the linkages of the tests, their joint models and motions, released and compliant cranks, courses, joint
friction, friction in contact, pins that fly, by every engine.

========== ================================================================== ======= ==================================
check      what must be true                                                  left    scale
========== ================================================================== ======= ==================================
pins       ideal pins coincide, a slide's block is on its line                3e-7    the longest body
closure    no body would have to turn, the crank held, for that               3e-6    a radian; positions are judged to
                                                                                      1e-5
turned     a slide keeps its angle                                            1e-15   a radian
signal     a displacement is that of its pins                                 3e-12   the clearance
crank      the crank is where its motor has it, or as far behind as it yields 4e-9    a radian
speed      and as fast as a rigid one                                         2e-6    the motor's speed
evenness   and even                                                           6e-9    its square
parting    closed joints stay closed: velocities                              1e-5    the largest speed
jolt       and accelerations                                                  9e-3    the largest, or the largest
                                                                                      reaction over the mass
rod        a massless link keeps its length                                   6e-3    the clearance
give       a soft bearing gives by force over stiffness                       1e-6    its largest force
bearing    a pin is in its bearing (whether too deep to see it, is a warning) 4e-3    the shorter of its bodies
line       a pin is pushed along its displacement; not with contact friction  2e-5    its largest force
loose      and not at all while it is free                                    0       the same
force      the forces on a body give its mass its acceleration                8e-5    the sum of their sizes, at its
                                                                                      largest
moment     and their moments its inertia its angular acceleration             2e-5    the same, and a thousandth of the
                                                                                      longest lever
power      all forces together change the kinetic energy                      7e-5    the same
========== ================================================================== ======= ==================================

DART and PyBullet leave most of the balances, by their first order in the step; MuJoCo most of what joints give, by its
soft rows. Forces are judged to 1e-4 (static), 1e-3 (ideal) and 5e-3 (clearance) of their peak.  Not checked, because
there is nothing to hold them to:

* what is below REST times the linkage's mass (:mod:`sim_models.common.traced`): the verdict does not see it either;
* the direction of Coulomb friction at rest and near a reversal: up to the whole of it may be missing in a moment;
* forces in the very step in which a pin touches its rim or leaves it: up to stiffness times the way of that step may be
  missing;
* how stiff a contact is, and what it gives back: engines have their own laws;  energy over time: reports are too far
  apart;
* links that bend, and traces that do not say where every body is; those without rates are not asked for balances.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from analytic.mechanism import GROUND, Joint
from analytic.mechanism.parts import TINY
from analytic.mechanism.signals import position, wrapped
from sim_models.common.balances import balances
from sim_models.common.contact_laws import TOO_DEEP, bearing, shortest_link
from sim_models.common.traced import REST, ROUNDING_OF_SIZE, Miss, TracedLinkage, cross, dot
from sim_models.engine import Cause, Request, SimulationError, Trace

DAMPERS = 2.0  # a soft bearing's dampers at most, over what its force is off its spring's
FREE_OF_RIM = 0.1  # of the clearance, inside of the rim: a pin farther inside touches nothing in any engine
LANDING, TOUCHED = 0.5, 1e-4  # of half a drive's gap, and rad, beyond it: a crank's depth in its flank as it lands
# of a moving run's instants: where pins fly they touch and leave, and one such instant does not make the run wrong
RARE = 5e-3
# Of one equation of small displacements: its right side (N,), and by body how x and y (complex) and the angle enter it.
Row = tuple[np.ndarray | float, dict[str, tuple[complex | np.ndarray, np.ndarray | float]]]
SINGULAR_ROWS = 1e-9  # of the largest: a singular value of closed joints that says nothing


class Implausible(SimulationError):
    """A run of which something is not true that must be; the message says what, where, by how much, and the remedy."""


@dataclass(frozen=True)
class Limit:
    """The share by which a check may be missed in static runs, and in moving ones of ideal joints and of clearances."""

    static: float
    ideal: float
    clearance: float

    def of(self, trace: Trace) -> float:
        """The share for a trace."""
        return self.static if trace.motion == "static" else self.clearance if trace.clearance else self.ideal


CHECK_LIMITS = {
    "pins": Limit(1e-6, 1e-5, 1e-5),
    "closure": Limit(1e-6, 5e-6, 5e-5),
    "turned": Limit(1e-6, 1e-6, 1e-6),
    "signal": Limit(1e-6, 1e-6, 1e-6),
    "crank": Limit(1e-6, 1e-6, 1e-6),
    "speed": Limit(1e-5, 1e-5, 1e-5),
    "evenness": Limit(1e-5, 1e-5, 1e-5),
    "parting": Limit(1e-5, 1e-5, 1e-4),
    "jolt": Limit(1e-3, 1e-3, 2e-2),
    "rod": Limit(1e-3, 1e-2, 1e-2),
    "give": Limit(1e-5, 3e-4, 3e-4),
    "bearing": Limit(TOO_DEEP, TOO_DEEP, TOO_DEEP),
    "line": Limit(1e-5, 3e-4, 3e-4),
    "loose": Limit(1e-5, 3e-4, 3e-4),
    "force": Limit(2e-5, 3e-4, 3e-4),
    "moment": Limit(2e-5, 3e-4, 3e-4),
    "power": Limit(2e-5, 3e-4, 3e-4),
}


def check(request: Request, trace: Trace) -> None:
    """Raise Implausible for a run that is not what it must be."""
    for miss in misses(request, trace):
        limit = CHECK_LIMITS[miss.check].of(trace)
        if not _spared(miss, trace).share <= limit:
            worst, allowed = int(np.argmax(miss.size)), max(limit * miss.scale, miss.floor)
            at = _instant(request, trace, worst)
            raise Implausible(
                f"{trace.simulator} {trace.joint_model} {trace.motion} ({request.mechanism.name}): {miss.what} at {at}:"
                f" {miss.size[worst]:.3g} {miss.unit} are missed, {allowed:.3g} are in order",
                Cause.IMPLAUSIBLE,
            )


def _instant(request: Request, trace: Trace, sample: int) -> str:
    """Which sample that is, in words; one beyond the reports is of the pins' paths."""
    if sample >= trace.crank_angle.size:
        return "a crank angle between reports"
    if request.schedule.crank is None and trace.time is not None:
        return f"{trace.time[sample]:.4g} s"
    return f"crank angle {np.degrees(trace.crank_angle[sample]):.4g} deg"


def _spared(miss: Miss, trace: Trace) -> Miss:
    """A miss but for the RARE instants at which an engine may have solved a step with a pin on the rim, and reported it
    off, or the reverse.
    """
    spare = int(RARE * miss.size.size) if trace.clearance and trace.motion == "driven" else 0
    return replace(miss, size=np.sort(miss.size)[: miss.size.size - spare]) if spare else miss


def misses(request: Request, trace: Trace) -> Iterator[Miss]:
    """What must be true of a run, and by how much it is missed; only what the trace has the signals for."""
    linkage = TracedLinkage(request, trace)
    if not linkage.placed:
        return
    for part in (pins, slides, closure, crank, motors, bearings):
        yield from part(linkage)
    if trace.rates:
        yield from balances(linkage)


def pins(linkage: TracedLinkage) -> Iterator[Miss]:
    """Ideal pins that come apart, and clearance signals that are not where the pins are."""
    for joint in linkage.m.joints:
        if joint.prismatic:
            continue
        gap = linkage.gap(joint)
        if joint.name in linkage.trace.clearance:
            off = np.abs(gap - linkage.vector(f"clearance_{joint.name}"))
            yield Miss(
                "signal",
                f"the displacement of joint {joint.name!r} is not that of its pins",
                off,
                linkage.trace.clearance[joint.name],
                "m",
            )
            continue
        if joint.name in linkage.request.bearings:
            yield from soft_bearing(linkage, joint, gap)
            continue
        what = f"the pins of joint {joint.name!r}"
        yield Miss("pins", f"{what} come apart", np.abs(gap), linkage.size, "m")
        if linkage.moves:
            speed, acceleration = linkage.fastest
            yield Miss("parting", f"{what} move apart", np.abs(linkage.slip(joint)), speed, "m/s", linkage.rounding)
            yield Miss(
                "jolt",
                f"{what} accelerate apart",
                np.abs(linkage.slip(joint, linkage.acceleration)),
                acceleration,
                "m/s^2",
                REST,
            )


def soft_bearing(linkage: TracedLinkage, joint: Joint, gap: np.ndarray) -> Iterator[Miss]:
    """A pin that does not give in its soft bearing as its force has it, but for what dampers do to a moving one."""
    force, stiffness = linkage.reaction(joint), linkage.request.bearings[joint.name]
    off, peak = np.abs(force - stiffness * gap), float(np.abs(force).max(initial=0.0))
    if linkage.moves:
        damping = bearing(linkage.m, joint).damping
        off = np.maximum(off - DAMPERS * damping * np.abs(linkage.slip(joint)), 0.0)
    what = f"the bearing of joint {joint.name!r} does not give as it is stiff"
    yield Miss("give", what, off, peak, "N", linkage.nothing)
    what = f"the displacement of joint {joint.name!r} is not that of its pins"
    told = np.abs(gap - linkage.vector(f"clearance_{joint.name}"))
    yield Miss("signal", what, told, float(np.abs(gap).max(initial=0.0)), "m", ROUNDING_OF_SIZE * linkage.size)


def slides(linkage: TracedLinkage) -> Iterator[Miss]:
    """Slides that leave their line or turn."""
    for joint in linkage.m.joints:
        if not joint.prismatic:
            continue
        if joint.name in linkage.trace.clearance:
            yield from played(linkage, joint)
            continue
        first = joint.bodies[0]
        along, what = joint.direction * np.exp(1j * linkage.angle(first)), f"slide {joint.name!r}"
        yield Miss("turned", f"the bodies of {what} turn against each other", np.abs(linkage.turned(joint)), 1.0, "rad")
        yield Miss(
            "pins", f"the block of {what} leaves its line", np.abs(cross(along, linkage.gap(joint))), linkage.size, "m"
        )
        if linkage.moves:
            slip, spin, (speed, acceleration) = linkage.slip(joint), linkage.spin(first), linkage.fastest
            yield Miss(
                "parting",
                f"the block of {what} moves off its line",
                np.abs(cross(along, slip)),
                speed,
                "m/s",
                linkage.rounding,
            )
            off = cross(along, linkage.slip(joint, linkage.acceleration)) - 2 * spin * dot(along, slip)
            yield Miss(
                "jolt", f"the block of {what} accelerates off its line", np.abs(off), acceleration, "m/s^2", REST
            )


def played(linkage: TracedLinkage, joint: Joint) -> Iterator[Miss]:
    """Clearance signals that are not where a block is in its guide."""
    across, size = linkage.across(joint), linkage.trace.clearance[joint.name]
    off = np.abs(dot(across, linkage.gap(joint)) * across - linkage.vector(f"clearance_{joint.name}"))
    what = f"of joint {joint.name!r} is not that of its block"
    yield Miss("signal", f"the displacement {what}", off, size, "m")
    turned = np.abs(wrapped(linkage.turned(joint) + linkage.signal(f"clearance_{joint.name}_angle")))
    yield Miss("signal", f"the tilt {what}", turned * linkage.size, size, "m")


def closure(linkage: TracedLinkage) -> Iterator[Miss]:
    """Angles by which bodies would have to turn for the closed joints to close, the crank held where there is a motor.

    At a poor transmission angle a small miss of a pin turns bodies far.
    """
    place = {b.name: 3 * k for k, b in enumerate(linkage.m.bodies)}
    loose = {*linkage.trace.clearance, *linkage.request.bearings}
    found = [row for joint in linkage.m.joints if joint.name not in loose for row in _closing(linkage, joint)]
    for joint in linkage.driven:
        found += _holding(linkage, joint)
    if not found:
        return
    rows = np.zeros((linkage.count, len(found), 3 * len(place)))  # of x and y over the longest body, and angle, of each
    missed = np.empty((linkage.count, len(found), 1))
    for i, (miss, terms) in enumerate(found):
        missed[:, i, 0] = miss
        for name, (towards, turning) in terms.items():
            if name != GROUND:
                k, axis = place[name], np.asarray(towards)
                rows[:, i, k], rows[:, i, k + 1], rows[:, i, k + 2] = axis.real, axis.imag, turning
    turn = np.linalg.pinv(rows, rcond=SINGULAR_ROWS) @ missed
    for body in linkage.m.bodies:
        what = f"body {body.name!r} would have to turn for the joints to close"
        yield Miss("closure", what, np.abs(turn[:, place[body.name] + 2, 0]), 1.0, "rad")


def _closing(linkage: TracedLinkage, joint: Joint) -> Iterator[Row]:
    """What a closed joint asks of the small displacements of its bodies."""
    (first, second), gap = joint.bodies, linkage.gap(joint) / linkage.size
    a, b = (linkage.arm(name, joint.name) / linkage.size for name in joint.bodies)
    axes: list[complex | np.ndarray] = [1.0 + 0j, 1j]
    if joint.prismatic:
        a = a - gap
        axes = [1j * joint.direction * np.exp(1j * linkage.angle(first))]
        yield -linkage.turned(joint), {first: (0j, -1.0), second: (0j, 1.0)}
    for axis in axes:
        yield -dot(gap, axis), {first: (-axis, -cross(a, axis)), second: (axis, cross(b, axis))}


def _holding(linkage: TracedLinkage, joint: Joint) -> Iterator[Row]:
    """What the motor of a joint asks of them, which holds the joint where it is."""
    first, second = joint.bodies
    if not joint.prismatic:
        yield 0.0, {first: (0j, -1.0), second: (0j, 1.0)}
        return
    axis = joint.direction * np.exp(1j * linkage.angle(first))
    b = linkage.arm(second, joint.name) / linkage.size
    a = linkage.arm(first, joint.name) / linkage.size - linkage.gap(joint) / linkage.size
    yield 0.0, {first: (-axis, -cross(a, axis)), second: (axis, cross(b, axis))}


def motors(linkage: TracedLinkage) -> Iterator[Miss]:
    """Joints that are not where their motors' courses have them."""
    if linkage.request.schedule.crank is not None or linkage.trace.time is None:
        return
    for name, motor in linkage.request.schedule.drives.items():
        joint = linkage.m.joint(name)
        off, size = (
            linkage.signal(position(joint).name) - motor.positions(linkage.trace.time),
            linkage.size if joint.prismatic else 1.0,
        )
        yield Miss(
            "crank",
            f"joint {name!r} is not where its motor has it",
            np.abs(off),
            size,
            "m" if joint.prismatic else "rad",
        )


def crank(linkage: TracedLinkage) -> Iterator[Miss]:
    """A crank that is not where, or not as fast, as its motor."""
    motor = linkage.request.schedule.crank_angle
    if motor is None:
        return
    m, name = linkage.m, linkage.m.driven
    stiffness = m.drive_stiffness
    behind = linkage.signal("drive_torque") / stiffness if stiffness else 0.0
    off = np.abs(np.exp(1j * (linkage.angle(name) + behind - motor)) - 1)
    free = (1 + LANDING) * m.half_gap + TOUCHED if m.half_gap else 0.0
    yield Miss("crank", f"the crank {name!r} is not where its motor has it", np.maximum(off - free, 0.0), 1.0, "rad")
    if not stiffness and not m.half_gap and not linkage.still and m.speed:
        yield Miss(
            "speed",
            f"the crank {name!r} does not turn as its motor",
            np.abs(linkage.spin(name) - m.speed),
            abs(m.speed),
            "rad/s",
        )
        if linkage.moves:
            yield Miss(
                "evenness",
                f"the crank {name!r} does not turn evenly",
                np.abs(linkage.spin_up(name)),
                m.speed**2,
                "rad/s^2",
                REST / linkage.size,
            )


def guides(linkage: TracedLinkage, joint: Joint, clearance: float) -> Iterator[Miss]:
    """Blocks that are not in their guides, or that walls push which they do not touch."""
    guide = linkage.guide(joint)
    assert guide is not None  # a mechanism with clearance in a prismatic joint has it
    across, what = linkage.across(joint), f"joint {joint.name!r}"
    reach = guide.reach(dot(across, linkage.gap(joint)), linkage.turned(joint))
    deep = np.maximum(reach - clearance, 0.0)
    yield Miss("bearing", f"the block of {what} leaves its guide", deep, min(joint.guide or ()), "m")
    force, moment = (
        np.abs(dot(across, linkage.reaction(joint))),
        np.abs(linkage.signal(f"reaction_{joint.name}_moment")),
    )
    pushed, peak = force + moment / guide.length, float(np.abs(linkage.reaction(joint)).max(initial=0.0))
    loose = np.where(reach < (1 - FREE_OF_RIM) * clearance, pushed, 0.0)
    yield Miss(
        "loose", f"the free block of {what} is pushed", loose, max(peak, float(pushed.max())), "N", linkage.nothing
    )


def bearings(linkage: TracedLinkage) -> Iterator[Miss]:
    """Pins that are not in their bearings, or pushed otherwise than by them."""
    for name, clearance in linkage.trace.clearance.items():
        joint = linkage.m.joint(name)
        if joint.prismatic:
            yield from guides(linkage, joint, clearance)
            continue
        gap, force, what = linkage.gap(joint), linkage.reaction(joint), f"joint {name!r}"
        path = np.hypot(*linkage.trace.journal[name].T) if name in linkage.trace.journal else np.zeros(0)
        deep, peak = np.concatenate([np.abs(gap), path]) - clearance, float(np.abs(force).max(initial=0.0))
        if linkage.trace.joint_model == "massless-link":
            yield Miss("rod", f"the massless link of {what} changes its length", np.abs(deep), clearance, "m")
        else:
            yield Miss(
                "bearing",
                f"the pin of {what} leaves its bearing",
                np.maximum(deep, 0.0),
                shortest_link(linkage.m, joint),
                "m",
            )
            loose = np.where(np.abs(gap) < (1 - FREE_OF_RIM) * clearance, np.abs(force), 0.0)
            yield Miss("loose", f"the free pin of {what} is pushed", loose, peak, "N", linkage.nothing)
        if not linkage.rubs(joint):
            across = np.abs(cross(gap, force)) / np.maximum(np.abs(gap), TINY)
            yield Miss(
                "line", f"the force of {what} is not along its pin's displacement", across, peak, "N", linkage.nothing
            )
