"""An independent referee for momentum exchange: a single loop with clearance in one pin as an ordinary differential
equation with event location.

The crank turns at constant speed; the first body turns on the crank's pin, the second turns on a ground pivot or slides
along the ground, and the pin between the two has clearance.  That leaves two freedoms: the first body's angle and the
second's angle or travel, each with Euler's (or Newton's) equation of its own; only the contact joins them.  Touching,
leaving, the deepest point, force that comes to nothing, and slip that comes to rest are found by bisection on the step
in which they happen, so that every step is smooth and of the order of the method, Dormand and Prince's fifth.

Coulomb's friction is exact: it slips with mu N or it sticks, with the force that keeps it there.  Nothing is shared
with the engines or the analytic model but the mechanism's numbers and the constants of the law
(:class:`sim_models.common.contact_laws.NamedLaw`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from analytic.mechanism import GROUND, Body, Mechanism
from sim_models.common.contact_laws import NamedLaw, named_law
from sim_models.engine import Watched

# ---------------------------------------------------------------- the linkage's numbers


class Loop(NamedTuple):
    """A linkage in SI units; points as x + iy.  The first body hangs on the crank, the second on the ground.

    Bodies' own vectors are in their frames, from the point that they hang on: ``reach`` to the pin with clearance,
    ``com`` to the centre of mass.  ``inertia`` is about that point (a slide's is its mass).  ``push`` is the sum of
    conj(arm) times force over a body's loads: its imaginary part turns the body.  ``bearing`` is 1 where the
    second body has the bearing and the first one the pin, as the joint's order says, else -1.  ``stop`` is where one of
    the second body begins (rad), its stiffness and damping; it pushes back with max(0, K d + C d').
    """

    theta: float
    speed: float
    hub: complex
    arm: complex
    crank_push: complex
    crank_torque: float
    reach1: complex
    com1: complex
    mass1: float
    inertia1: float
    push1: complex
    force1: complex
    torque1: float
    slides: bool
    pivot: complex
    axis: complex
    reach2: complex
    com2: complex
    mass2: float
    inertia2: float
    push2: complex
    force2: complex
    torque2: float
    gravity: complex
    bearing: int
    clearance: float
    rim: float
    friction: float
    stiffness: float
    damping: float
    hysteresis: float
    slowest: float
    stop: tuple[float, float, float]


class State(NamedTuple):
    """Angle (rad) of the first body, angle or travel (rad, m) of the second, and their rates."""

    first: float
    second: float
    first_rate: float
    second_rate: float


@dataclass(frozen=True)
class Names:
    """Who is who in a loop."""

    crank: str
    first: str
    second: str
    joint: str


def names_of(mechanism: Mechanism) -> Names:
    """The crank, the body on it, the body on the ground, and the pin between these two."""
    crank = mechanism.driven
    joint = next(j for j in mechanism.joints if not {GROUND, crank} & set(j.bodies))
    knee = next(j for j in mechanism.joints if crank in j.bodies and GROUND not in j.bodies)
    first = next(name for name in knee.bodies if name != crank)
    second = next(name for name in joint.bodies if name != first)
    assert len(mechanism.bodies) == 3
    assert len(mechanism.joints) == 4
    return Names(crank, first, second, joint.name)


def loop_of(mechanism: Mechanism, theta: float = 0.0, law: NamedLaw | None = None) -> Loop:
    """The loop from crank angle ``theta`` (rad) on; ``law`` replaces the one that the mechanism names."""
    who = names_of(mechanism)
    joint, speed = mechanism.joint(who.joint), mechanism.speed
    law = law or named_law(mechanism, joint, "driven")
    assert law is not None, "the joint has no contact_law"
    assert speed is not None
    assert not mechanism.springs
    assert not any(j.rubs or j.damped or j.springy for j in mechanism.joints), "nothing else may act in the joints"
    hub = next(j.name for j in mechanism.joints if set(j.bodies) == {GROUND, who.crank})
    base = next(j for j in mechanism.joints if set(j.bodies) == {GROUND, who.second})
    knee = next(j.name for j in mechanism.joints if set(j.bodies) == {who.crank, who.first})
    crank, first, second = (mechanism.moving[name] for name in (who.crank, who.first, who.second))
    pivot, hung, axis, facing = mechanism.ground.point(base.name), second.point(base.name), 0j, 1 + 0j
    if base.prismatic:
        # travel of the second body's point along the axis fixed in the ground; that body keeps its angle
        assert base.bodies[0] == GROUND
        axis, facing = base.direction, complex(np.exp(1j * base.angle))
    gravity = complex(*mechanism.gravity)
    push0, _, torque0 = _loads(mechanism, crank, crank.point(hub))
    push1, force1, torque1 = _loads(mechanism, first, first.point(knee))
    push2, force2, torque2 = _loads(mechanism, second, hung)
    weigh = (crank.centre - crank.point(hub)).conjugate() * crank.mass * gravity
    com1, com2 = first.centre - first.point(knee), second.centre - hung
    clearance, stop = joint.clearance, (math.inf, 0.0, 0.0)
    for one in mechanism.stops:
        assert (one.joint, one.start, base.bodies, base.prismatic) == (base.name, None, (GROUND, who.second), False)
        assert one.end is not None
        stop = one.end, one.stiffness, one.damping
    return Loop(
        theta, speed, mechanism.ground.point(hub), crank.point(knee) - crank.point(hub), push0 + weigh, torque0,
        first.point(joint.name) - first.point(knee), com1, first.mass,
        first.moment_of_inertia + first.mass * abs(com1) ** 2, push1, force1, torque1,
        base.prismatic, pivot, axis, (second.point(joint.name) - hung) * facing, com2 * facing, second.mass,
        second.mass if base.prismatic else second.moment_of_inertia + second.mass * abs(com2) ** 2,
        push2, force2, torque2,
        gravity, 1 if joint.bodies[0] == who.first else -1,
        clearance, joint.rim + clearance, joint.friction,
        law.stiffness, law.damping, law.hysteresis, law.slowest, stop,
    )  # fmt: skip


def _loads(mechanism: Mechanism, body: Body, hung: complex) -> tuple[complex, complex, float]:
    """Sum of conj(arm) force, of force (N), and of torque (N.m) of a body's loads, arms from where it hangs."""
    own = [load for load in mechanism.loads if load.body == body.name]
    pushes = ((body.point(load.point) - hung).conjugate() * complex(*load.force) for load in own)
    return sum(pushes, 0j), sum((complex(*load.force) for load in own), 0j), sum((load.torque for load in own), 0.0)


# ---------------------------------------------------------------- how it starts


def centred(mechanism: Mechanism, loop: Loop, nudge: complex = 0j) -> State:
    """The ideal linkage's posture and velocities at the loop's crank angle, with the pin ``nudge`` (m) off centre."""
    first, second = _assembled(mechanism, loop, nudge)
    return State(first, second, *_rates(loop, first, second, 0j))


def pressed(mechanism: Mechanism, loop: Loop, nudge: complex = 0j) -> State:
    """Pin on the wall where the ideal linkage's reaction presses it, and as deep; it turns on as that reaction does."""
    step = 1e-5

    def gap(theta: float) -> complex:
        there = loop._replace(theta=theta)
        force = ideal_reaction(mechanism, there)
        return (loop.clearance + abs(force) / loop.stiffness) * force / abs(force)

    first, second = _assembled(mechanism, loop, gap(loop.theta) + nudge)
    drift = (gap(loop.theta + step) - gap(loop.theta - step)) / (2 * step) * loop.speed
    return State(first, second, *_rates(loop, first, second, drift))


def ideal_reaction(mechanism: Mechanism, loop: Loop) -> complex:
    """Force (N) of the first body on the second at the loop's crank angle, where the pin fits."""
    first, second = _assembled(mechanism, loop, 0j)
    ahead = 1e-5 / abs(loop.speed)
    at = [_assembled(mechanism, loop._replace(theta=loop.theta + k * loop.speed * ahead), 0j) for k in (-1, 1)]
    before, after = (_rates(loop._replace(theta=loop.theta + k * loop.speed * ahead), *at[j], 0j)
                     for j, k in enumerate((-1, 1)))  # fmt: skip
    turn1, turn2 = ((b - a) / (2 * ahead) for a, b in zip(before, after, strict=True))
    own1, own2 = _own(loop, 0.0, first, second, 0.0)
    p1, p2 = loop.reach1 * np.exp(1j * first), _lever2(loop, second)
    # Q1 - p1 x F = I1 a1 and Q2 + (way of the second pin) . F = I2 a2
    left = np.array([[p1.imag, -p1.real], [p2.real, p2.imag]])
    fx, fy = np.linalg.solve(left, [loop.inertia1 * turn1 - own1, loop.inertia2 * turn2 - own2])
    return complex(fx, fy)


def _lever2(loop: Loop, second: float) -> complex:
    return loop.axis if loop.slides else 1j * loop.reach2 * np.exp(1j * second)


def _assembled(mechanism: Mechanism, loop: Loop, gap: complex) -> tuple[float, float]:
    """Coordinates that leave the pins ``gap`` (m) apart at the loop's crank angle, followed from the assembly's."""
    who, assembly = names_of(mechanism), mechanism.assembly
    first, second = assembly[who.first], 0.0 if loop.slides else assembly[who.second]
    begin = assembly[who.crank]
    steps = 1 + int(abs(loop.theta - begin) / 0.05)
    for k in range(steps + 1):
        theta = begin + (loop.theta - begin) * k / steps
        knee = loop.hub + loop.arm * np.exp(1j * theta)
        if loop.slides and k == 0:
            reach = knee + loop.reach1 * np.exp(1j * first) - loop.pivot - loop.reach2
            second = (reach * loop.axis.conjugate()).real
        for _ in range(60):
            p1, own = loop.reach1 * np.exp(1j * first), _lever2(loop, second)
            pin2 = loop.pivot + (loop.reach2 + loop.axis * second if loop.slides else own / 1j)
            r = knee + p1 - pin2 - gap
            left = np.array([[(1j * p1).real, -own.real], [(1j * p1).imag, -own.imag]])
            turn = np.linalg.solve(left, [-r.real, -r.imag])
            first, second = first + turn[0], second + turn[1]
            if abs(r) < 1e-15 * abs(loop.reach1):
                break
        assert abs(r) < 1e-12 * abs(loop.reach1), "the linkage does not close"
    return float(first), float(second)


def _rates(loop: Loop, first: float, second: float, drift: complex) -> tuple[float, float]:
    """Rates at which the pins part by ``drift`` (m/s)."""
    knee = 1j * loop.speed * loop.arm * np.exp(1j * loop.theta)
    p1, own = 1j * loop.reach1 * np.exp(1j * first), _lever2(loop, second)
    found = np.linalg.solve([[p1.real, -own.real], [p1.imag, -own.imag]], [(drift - knee).real, (drift - knee).imag])
    return float(found[0]), float(found[1])


# ---------------------------------------------------------------- the equations

FLIGHT, PRESSED, RELEASED = 0, 1, 2  # off the wall; pushed back; in the wall, but no force (it does not pull)
FIRST, SECOND, FIRST_RATE, SECOND_RATE = range(4)
IMPULSE_X, IMPULSE_Y, IMPULSE, SQUEEZED, RUBBED, MOTOR, OTHERS = range(4, 11)  # integrals over time
SIZE = 11


@njit(cache=True)
def _cross(a, b):
    return a.real * b.imag - a.imag * b.real


@njit(cache=True)
def _dot(a, b):
    return a.real * b.real + a.imag * b.imag


@njit(cache=True)
def _own(loop, t, first, second, second_rate):
    """Generalised forces of weight, loads, the stop and the moving crank pin on either coordinate."""
    e1 = np.exp(1j * first)
    knee = -(loop.speed**2) * loop.arm * np.exp(1j * (loop.theta + loop.speed * t))  # its acceleration
    own1 = _cross(e1, loop.push1) + _cross(loop.com1 * e1, loop.mass1 * (loop.gravity - knee)) + loop.torque1
    if loop.slides:
        return own1, _dot(loop.axis, loop.force2 + loop.mass2 * loop.gravity)
    e2 = np.exp(1j * second)
    begin, stiffness, damping = loop.stop
    stop = max(0.0, stiffness * (second - begin) + damping * second_rate) if second > begin else 0.0
    return own1, _cross(e2, loop.push2) + _cross(loop.com2 * e2, loop.mass2 * loop.gravity) + loop.torque2 - stop


@njit(cache=True)
def _meeting(loop, t, y):
    """Gap (m), its direction, depth (m; negative: off the wall) and rate (m/s), slip (m/s), and velocity of either body
    where they touch for a unit rate (m or m/s).
    """
    arm = loop.arm * np.exp(1j * (loop.theta + loop.speed * t))
    p1 = loop.reach1 * np.exp(1j * y[FIRST])
    p2 = loop.reach2 + loop.axis * y[SECOND] if loop.slides else loop.reach2 * np.exp(1j * y[SECOND])
    way2 = loop.axis if loop.slides else 1j * p2
    gap = loop.hub + arm + p1 - loop.pivot - p2
    parting = 1j * loop.speed * arm + 1j * p1 * y[FIRST_RATE] - way2 * y[SECOND_RATE]
    size = abs(gap)
    n = gap / size if size > 0 else 1 + 0j
    # from either pin centre to where they touch, along n
    to1, to2 = (loop.rim - size, loop.rim) if loop.bearing > 0 else (-loop.rim, size - loop.rim)
    turn2 = 0.0 if loop.slides else y[SECOND_RATE]
    slip = _cross(n, parting) + y[FIRST_RATE] * to1 - turn2 * to2
    at1 = 1j * (p1 + n * to1)
    at2 = loop.axis if loop.slides else 1j * (p2 + n * to2)
    return gap, n, size - loop.clearance, _dot(n, parting), slip, at1, at2


@njit(cache=True)
def _push(loop, depth, rate, touched):
    """The law's force (N) before it is kept from pulling."""
    return loop.stiffness * depth * (1 + loop.hysteresis * rate / touched) + loop.damping * rate


@njit(cache=True)
def _slip_rate(loop, t, y, gap, n, depth_rate, turn1, turn2):
    """How fast (m/s^2) slip grows at these accelerations of the coordinates."""
    arm = loop.arm * np.exp(1j * (loop.theta + loop.speed * t))
    p1 = loop.reach1 * np.exp(1j * y[FIRST])
    apart = -(loop.speed**2) * arm + (1j * turn1 - y[FIRST_RATE] ** 2) * p1
    parting = 1j * loop.speed * arm + 1j * p1 * y[FIRST_RATE]
    if loop.slides:
        apart -= loop.axis * turn2
        parting -= loop.axis * y[SECOND_RATE]
        spin2, spun2 = 0.0, 0.0
    else:
        p2 = loop.reach2 * np.exp(1j * y[SECOND])
        apart -= (1j * turn2 - y[SECOND_RATE] ** 2) * p2
        parting -= 1j * p2 * y[SECOND_RATE]
        spin2, spun2 = y[SECOND_RATE], turn2
    size = abs(gap)
    grown = _cross(n, apart) - _cross(n, parting) / size * depth_rate
    if loop.bearing > 0:
        return grown + turn1 * (loop.rim - size) - spun2 * loop.rim - y[FIRST_RATE] * depth_rate
    return grown - turn1 * loop.rim + spun2 * (loop.rim - size) - spin2 * depth_rate


@njit(cache=True)
def _holding(loop, t, y, push):
    """Friction (N, on the second body) that would keep the slip from growing."""
    gap, n, _, rate, _, at1, at2 = _meeting(loop, t, y)
    own1, own2 = _own(loop, t, y[FIRST], y[SECOND], y[SECOND_RATE])
    turn1, turn2 = (own1 - _dot(at1, push * n)) / loop.inertia1, (own2 + _dot(at2, push * n)) / loop.inertia2
    free = _slip_rate(loop, t, y, gap, n, rate, turn1, turn2)
    along = 1j * n
    more1, more2 = turn1 - _dot(at1, along) / loop.inertia1, turn2 + _dot(at2, along) / loop.inertia2
    return -free / (_slip_rate(loop, t, y, gap, n, rate, more1, more2) - free)


@njit(cache=True)
def _force(loop, t, y, mode, slide, touched):
    """Force (N) of the first body on the second, its normal part, and friction's along the wall."""
    if mode != PRESSED:
        return 0j, 0.0, 0.0
    _, n, depth, rate, _, _, _ = _meeting(loop, t, y)
    push = _push(loop, depth, rate, touched)
    rub = 0.0
    if loop.friction > 0:
        rub = slide * loop.friction * push if slide != 0 else _holding(loop, t, y, push)
    return (push + 1j * rub) * n, push, rub


@njit(cache=True)
def _derivative(loop, t, y, mode, slide, touched, out):
    """Rates of all that is integrated; returns the force (N) on the second body and the motor's torque (N.m)."""
    force, push, rub = _force(loop, t, y, mode, slide, touched)
    _, _, _, rate, slip, at1, at2 = _meeting(loop, t, y)
    own1, own2 = _own(loop, t, y[FIRST], y[SECOND], y[SECOND_RATE])
    turn1, turn2 = (own1 - _dot(at1, force)) / loop.inertia1, (own2 + _dot(at2, force)) / loop.inertia2
    crank = np.exp(1j * (loop.theta + loop.speed * t))
    arm, e1 = loop.arm * crank, np.exp(1j * y[FIRST])
    c1 = loop.com1 * e1
    moved = loop.mass1 * (-(loop.speed**2) * arm + (1j * turn1 - y[FIRST_RATE] ** 2) * c1)
    carried = moved - loop.mass1 * loop.gravity - loop.force1 + force  # of the crank on the first body
    weighed = _cross(crank, loop.crank_push) + loop.crank_torque
    torque = _cross(arm, carried) - weighed
    # power of weights and loads: on the crank, on the first body as it is carried and as it turns, on the second
    others = weighed * loop.speed + _dot(1j * loop.speed * arm, loop.mass1 * loop.gravity + loop.force1)
    others += y[FIRST_RATE] * (_cross(e1, loop.push1) + _cross(c1, loop.mass1 * loop.gravity) + loop.torque1)
    others += y[SECOND_RATE] * own2
    out[FIRST], out[SECOND] = y[FIRST_RATE], y[SECOND_RATE]
    out[FIRST_RATE], out[SECOND_RATE] = turn1, turn2
    out[IMPULSE_X], out[IMPULSE_Y], out[IMPULSE] = force.real, force.imag, push
    out[SQUEEZED], out[RUBBED] = push * rate, rub * slip
    out[MOTOR], out[OTHERS] = torque * loop.speed, others
    return force, torque


# ---------------------------------------------------------------- steps and events

A = np.array([
    [0, 0, 0, 0, 0],
    [1 / 5, 0, 0, 0, 0],
    [3 / 40, 9 / 40, 0, 0, 0],
    [44 / 45, -56 / 15, 32 / 9, 0, 0],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
])  # fmt: skip
B = np.array([35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84])
C = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1])
BISECTIONS = 50
LARGEST_DECAY = 0.5  # of a step, in times of the contact's damping: what the method bears, and well so


@njit(cache=True)
def _step(loop, t, y, h, mode, slide, touched, k, mid, out):
    """One step of Dormand and Prince's fifth order from y to out."""
    for stage in range(6):
        for i in range(SIZE):
            mid[i] = y[i]
            for j in range(stage):
                mid[i] += h * A[stage, j] * k[j, i]
        _derivative(loop, t + C[stage] * h, mid, mode, slide, touched, k[stage])
    for i in range(SIZE):
        out[i] = y[i]
        for stage in range(6):
            out[i] += h * B[stage] * k[stage, i]


@njit(cache=True)
def _happened(loop, t, y, mode, slide, touched, inward):
    """Whether the step that ends here went beyond what its mode allows."""
    _, _, depth, rate, slip, _, _ = _meeting(loop, t, y)
    if mode == FLIGHT:
        return depth > 0
    push = _push(loop, depth, rate, touched)
    turned_or_left = inward and rate < 0
    if mode == RELEASED:
        return turned_or_left or depth < 0 or push > 0
    turned_or_left = turned_or_left or push < 0 or depth < 0  # where both factors of a push are negative, it is not
    if turned_or_left or loop.friction == 0:
        return turned_or_left
    return slide * slip < 0 if slide != 0 else abs(_holding(loop, t, y, push)) > loop.friction * push


@njit(cache=True)
def _largest_step(loop, t, y, mode, touched, fine):
    """The step (s) that contact allows: a share of half its period, and of its damping's time."""
    if mode == FLIGHT:
        return np.inf
    _, n, depth, _, _, at1, at2 = _meeting(loop, t, y)
    lightness = _dot(at1, n) ** 2 / loop.inertia1 + _dot(at2, n) ** 2 / loop.inertia2
    decay = (loop.damping + loop.stiffness * max(depth, 0.0) * loop.hysteresis / touched) * lightness
    step = math.pi / math.sqrt(loop.stiffness * lightness) / fine
    return min(step, LARGEST_DECAY / decay) if decay > 0 else step


@njit(cache=True)
def _sign(x):
    return 1 if x > 0 else -1


@njit(cache=True)
def _slides(loop, t, y, push):
    """The friction that begins where slip is at rest: 0 if it sticks, else the sign of the slip that it cannot hold."""
    hold = _holding(loop, t, y, push)
    return 0 if abs(hold) <= loop.friction * push else _sign(hold)


@njit(cache=True)
def _next(loop, t, y, mode, slide, touched, inward):
    """Mode, direction of friction, speed of touching, and whether the pin goes in, after something has happened."""
    _, _, depth, rate, slip, _, _ = _meeting(loop, t, y)
    if mode == FLIGHT:
        return PRESSED, _sign(slip), max(rate, loop.slowest), True
    inward = inward and rate > 0
    push = _push(loop, depth, rate, touched)
    if depth <= 0:
        return FLIGHT, 0, touched, False
    if push < 0:
        return RELEASED, 0, touched, inward
    if mode == RELEASED and push > 0:
        return PRESSED, _sign(slip), touched, inward
    if mode == PRESSED and loop.friction > 0 and (slide == 0 or slide * slip < 0):
        slide = _slides(loop, t, y, push)
    return mode, slide, touched, inward


@njit(cache=True)
def _first(loop, y):
    """The same at the start: a run that starts in contact has never touched, and reckons with the slowest touch."""
    _, _, depth, rate, slip, _, _ = _meeting(loop, 0.0, y)
    if depth <= 0:
        return FLIGHT, 0, loop.slowest, False
    push = _push(loop, depth, rate, loop.slowest)
    if push < 0:
        return RELEASED, 0, loop.slowest, rate > 0
    slide = _sign(slip) if slip != 0 or loop.friction == 0 else _slides(loop, 0.0, y, push)
    return PRESSED, slide, loop.slowest, rate > 0


@njit(cache=True)
def _advance(loop, t, until, y, state, fine, work):
    """One step, at most to ``until``, or to what happens in it: y is moved there; returns its time, and whether
    something happened.
    """
    mode, slide, touched, inward = state
    k, mid, new = work
    h = min(until - t, _largest_step(loop, t, y, mode, touched, fine))
    end = until if h == until - t else t + h
    _step(loop, t, y, h, mode, slide, touched, k, mid, new)
    happened = _happened(loop, t + h, new, mode, slide, touched, inward)
    if happened:
        low, high = 0.0, h
        for _ in range(BISECTIONS):
            h = (low + high) / 2
            _step(loop, t, y, h, mode, slide, touched, k, mid, new)
            if _happened(loop, t + h, new, mode, slide, touched, inward):
                high = h
            else:
                low = h
        _step(loop, t, y, high, mode, slide, touched, k, mid, new)
        end = t + high
    y[:] = new
    return end, happened


@njit(cache=True)
def _run(loop, start, time, fine, most):
    """States (M, SIZE), forces (M,) N and torques (M,) N.m at instants, and touches: rows of begin, end, speed, deepest
    and the integrals at either end.
    """
    states, torques = np.empty((time.size, SIZE)), np.empty(time.size)
    forces, touches, count = np.empty(time.size, np.complex128), np.zeros((most, 4 + 2 * SIZE)), 0
    y, work = np.zeros(SIZE), (np.zeros((6, SIZE)), np.zeros(SIZE), np.zeros(SIZE))
    y[0], y[1], y[2], y[3] = start
    state = _first(loop, y)
    if state[0] != FLIGHT:
        _begin(touches[0], loop, 0.0, y)
    for sample in range(time.size):
        t = time[max(sample - 1, 0)]
        while t < time[sample]:
            t, happened = _advance(loop, t, time[sample], y, state, fine, work)
            if happened:
                before, state = state[0], _next(loop, t, y, *state)
                if before == FLIGHT:
                    _begin(touches[count], loop, t, y)
                else:
                    touches[count, 3] = max(touches[count, 3], _meeting(loop, t, y)[2])
                    if state[0] == FLIGHT:
                        touches[count, 1], touches[count, 4 + SIZE :] = t, y
                        count += 1
                        if count == most:
                            return states[:sample], forces[:sample], torques[:sample], touches
            elif not state[3] and state[0] != FLIGHT:
                state = (state[0], state[1], state[2], _meeting(loop, t, y)[3] > 0)
        states[sample] = y
        forces[sample], torques[sample] = _derivative(loop, t, y, state[0], state[1], state[2], work[0][0])
    if state[0] != FLIGHT:
        touches[count, 4 + SIZE :] = y
        count += 1
    return states, forces, torques, touches[:count]


@njit(cache=True)
def _begin(row, loop, t, y):
    """A touch begins; NaN until it ends."""
    _, _, depth, rate, _, _, _ = _meeting(loop, t, y)
    row[0], row[1], row[2], row[3] = t, np.nan, max(rate, 0.0), depth
    row[4 : 4 + SIZE] = y


# ---------------------------------------------------------------- results


@dataclass(frozen=True)
class Impacts:
    """Every touch of a run, (M,), SI units: when the pin came to the wall and left it (NaN: it did not), crank angle
    (rad) and speed (m/s) of touching, deepest point (m), impulse (N.s, of the normal force; vector: of the whole force
    on the second body), and energy (J) that contact took, squeezing and rubbing.  ``before`` and ``after`` are the
    integrated states (M, SIZE) at the touch and at the leave.
    """

    time: np.ndarray
    left: np.ndarray
    crank: np.ndarray
    approach: np.ndarray
    deepest: np.ndarray
    impulse: np.ndarray
    vector: np.ndarray
    squeezed: np.ndarray
    rubbed: np.ndarray
    before: np.ndarray
    after: np.ndarray

    @property
    def lost(self) -> np.ndarray:
        """Energy (J) that contact took."""
        return self.squeezed + self.rubbed


@dataclass(frozen=True)
class ContactMotion:
    """A run: what is watched, on a uniform grid (M,), its touches, gap (m, joint's first pin centre less its second),
    crank angle (rad) and states (M, SIZE).
    """

    loop: Loop
    watched: Watched
    crank: np.ndarray
    gap: np.ndarray
    states: np.ndarray
    impacts: Impacts

    @property
    def lost(self) -> np.ndarray:
        """Energy (J) that contact has taken so far, with what is stored in it, (M,)."""
        return self.states[:, SQUEEZED] + self.states[:, RUBBED]


def contact_step(loop: Loop, share: float = 1 / 24) -> float:
    """A share of half a period (s) of the lightest contact that the loop can have."""
    by_turn = abs(loop.reach1) ** 2 / loop.inertia1
    by_second = 1 / loop.inertia2 if loop.slides else abs(loop.reach2) ** 2 / loop.inertia2
    return math.pi / math.sqrt(loop.stiffness * (by_turn + by_second)) * share


def simulate(
    mechanism: Mechanism,
    loop: Loop,
    start: State,
    turn: float,
    *,
    step: float | None = None,
    fine: float = 40.0,
    most: int = 100_000,
) -> ContactMotion:
    """The loop from ``start`` until the crank has turned by ``turn`` (rad), or the pin has left the wall
    ``most`` times.

    It is watched every ``step`` (s), which is the longest step too; contact is stepped through in at least ``fine``
    steps for half a period.
    """
    duration = turn / abs(loop.speed)
    count = max(2, round(duration / (step or contact_step(loop))) + 1)
    time = np.linspace(0.0, duration, count)
    states, forces, torques, touches = _run(loop, tuple(start), time, fine, most)
    time = time[: len(states)]
    assert np.isfinite(states).all()
    watched = _watched(mechanism, loop, time, states, forces, torques)
    theta = loop.theta + loop.speed * time
    pin1, pin2 = _pins(loop, theta, states)
    before, after = touches[:, 4 : 4 + SIZE], touches[:, 4 + SIZE :]
    gain = after - before
    impacts = Impacts(
        touches[:, 0], touches[:, 1], loop.theta + loop.speed * touches[:, 0], touches[:, 2], touches[:, 3],
        gain[:, IMPULSE], gain[:, IMPULSE_X] + 1j * gain[:, IMPULSE_Y], gain[:, SQUEEZED], gain[:, RUBBED],
        before, after,
    )  # fmt: skip
    return ContactMotion(loop, watched, theta, loop.bearing * (pin1 - pin2), states, impacts)


def _pins(loop: Loop, theta: np.ndarray, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (M,) m of the first and of the second body's pin centre."""
    first, second = states[:, FIRST], states[:, SECOND]
    own2 = loop.reach2 + loop.axis * second if loop.slides else loop.reach2 * np.exp(1j * second)
    return loop.hub + loop.arm * np.exp(1j * theta) + loop.reach1 * np.exp(1j * first), loop.pivot + own2


def _watched(
    mechanism: Mechanism, loop: Loop, time: np.ndarray, states: np.ndarray, forces: np.ndarray, torques: np.ndarray
) -> Watched:
    who = names_of(mechanism)
    theta = loop.theta + loop.speed * time
    first, second, first_rate, second_rate = (states[:, i].copy() for i in range(4))
    crank = mechanism.moving[who.crank]
    hub = next(j.name for j in mechanism.joints if set(j.bodies) == {GROUND, who.crank})
    held = (crank.centre - crank.point(hub)) * np.exp(1j * theta)
    knee = loop.arm * np.exp(1j * theta)
    com1 = loop.com1 * np.exp(1j * first)
    if loop.slides:
        base = next(j for j in mechanism.joints if set(j.bodies) == {GROUND, who.second})
        place2, velocity2 = loop.pivot + loop.com2 + loop.axis * second, loop.axis * second_rate
        angle2, spin2 = np.full(time.shape, base.angle), np.zeros(time.shape)
    else:
        com2 = loop.com2 * np.exp(1j * second)
        place2, velocity2, angle2, spin2 = loop.pivot + com2, 1j * second_rate * com2, second, second_rate

    def by_body(of_crank: np.ndarray, of_first: np.ndarray, of_second: np.ndarray) -> Mapping[str, np.ndarray]:
        return {who.crank: of_crank, who.first: of_first, who.second: of_second}

    return Watched(
        time,
        by_body(loop.hub + held, loop.hub + knee + com1, place2),
        by_body(1j * loop.speed * held, 1j * loop.speed * knee + 1j * first_rate * com1, velocity2),
        by_body(theta, first, angle2),
        by_body(np.full(time.shape, loop.speed), first_rate, spin2),
        {who.joint: loop.bearing * forces},
        torques,
    )


def kinetic(loop: Loop, time: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Kinetic energy (M,) J of the first and the second body (the crank's is constant)."""
    knee = 1j * loop.speed * loop.arm * np.exp(1j * (loop.theta + loop.speed * time))
    w1, w2 = states[:, FIRST_RATE], states[:, SECOND_RATE]
    com1 = 1j * loop.com1 * np.exp(1j * states[:, FIRST])
    carried = loop.mass1 * (abs(knee) ** 2 / 2 + (knee.conjugate() * com1).real * w1)
    return carried + loop.inertia1 * w1**2 / 2 + loop.inertia2 * w2**2 / 2
