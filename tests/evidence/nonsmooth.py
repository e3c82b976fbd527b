"""An independent referee without stiffness: Moreau and Jean's time stepping, walls rigid, Newton's restitution and
Coulomb's friction.

A step knows no events.  Contacts that the middle of the step would violate are *active*; their impulses over the step
satisfy 0 <= u+ + e u- , p >= 0, one of them zero, and |p_t| <= mu p with slip against it, by projected Gauss-Seidel
sweeps.  Impacts, rest and flight are the same to it (Moreau 1988; Jean 1999; theta = 1/2).

A *system* is a function that fills, at an instant: mass matrix, generalised force, gaps (m, negative: in the
wall), and for each contact the row of its normal velocity (the gap's rate), that of its slip, and what moves on its own
of both.  Only the mechanism's numbers (:class:`tests.evidence.contact_ode.Loop`) come from elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload

from tests.evidence.contact_ode import Loop

SWEEPS = 2000  # of Gauss-Seidel, at most
SETTLED = 1e-12  # of the largest impulse or momentum: what the last sweep may change
ITERATIONS = 10  # of Newton's, of a linearised step with impulses
NEAR = 1e-10  # m: a contact that will be so near is active


class Place(NamedTuple):
    """What a system says at an instant: n coordinates, k contacts."""

    mass: np.ndarray  # (n, n)
    force: np.ndarray  # (n,)
    gap: np.ndarray  # (k,) m
    normal: np.ndarray  # (k, n)
    slip: np.ndarray  # (k, n)
    normal_moved: np.ndarray  # (k,) m/s
    slip_moved: np.ndarray  # (k,) m/s


# ---------------------------------------------------------------- systems


def journal(numbers, t, q, v, place):
    """A loop (:class:`tests.evidence.contact_ode.Loop`) with a rigid journal in a rigid bearing: one contact."""
    arm = numbers.arm * np.exp(1j * (numbers.theta + numbers.speed * t))
    e1 = np.exp(1j * q[0])
    p1 = numbers.reach1 * e1
    place.mass[0, 0], place.mass[1, 1] = numbers.inertia1, numbers.inertia2
    # the crank pin's acceleration acts on the first body as a weight does
    weight = numbers.mass1 * (numbers.gravity + numbers.speed**2 * arm)
    first = np.conj(e1) * numbers.push1 + np.conj(numbers.com1 * e1) * weight
    place.force[0] = first.imag + numbers.torque1
    if numbers.slides:
        p2, way2 = numbers.reach2 + numbers.axis * q[1], numbers.axis
        pull = np.conj(numbers.axis) * (numbers.force2 + numbers.mass2 * numbers.gravity)
        place.force[1] = pull.real
    else:
        e2 = np.exp(1j * q[1])
        p2 = numbers.reach2 * e2
        way2 = 1j * p2
        second = np.conj(e2) * numbers.push2 + np.conj(numbers.com2 * e2) * (numbers.mass2 * numbers.gravity)
        place.force[1] = second.imag + numbers.torque2
    apart = numbers.hub + arm + p1 - numbers.pivot - p2
    n = apart / abs(apart) if apart != 0 else 1 + 0j
    place.gap[0] = numbers.clearance - abs(apart)
    # both touch where the wall is: the pin's radius from its own centre, the bearing's from its own
    out1, out2 = numbers.rim - numbers.clearance, numbers.rim
    if numbers.bearing < 0:
        out1, out2 = -out2, -out1
    at1 = 1j * (p1 + n * out1)
    at2 = way2 if numbers.slides else 1j * (p2 + n * out2)
    knee = np.conj(n) * 1j * numbers.speed * arm
    along1, along2 = np.conj(n) * at1, np.conj(n) * at2
    place.normal[0, 0], place.normal[0, 1] = -along1.real, along2.real
    place.slip[0, 0], place.slip[0, 1] = along1.imag, -along2.imag
    place.normal_moved[0], place.slip_moved[0] = -knee.real, knee.imag


class Floor(NamedTuple):
    """A block on a level floor: mass (kg), gravity (m/s^2, downwards) and a push along it (N)."""

    mass: float
    gravity: float
    push: float


def block(numbers, t, q, v, place):
    """x and y of a block over a numbers."""
    place.mass[0, 0] = place.mass[1, 1] = numbers.mass
    place.force[0], place.force[1] = numbers.push, -numbers.mass * numbers.gravity
    place.gap[0] = q[1]
    place.normal[0, 1] = place.slip[0, 0] = 1.0


class Guide(NamedTuple):
    """A slider-crank whose block has play in its guide: lengths (m), masses (kg), inertias (kg.m^2) about the centres
    (middle of crank and rod; the block's pin), the block's half length and half height, play on either side (m).
    """

    crank: float
    rod: float
    masses: tuple[float, float, float]
    inertias: tuple[float, float, float]
    half_length: float
    half_height: float
    play: float
    gravity: float
    torque: float = 0.0  # N.m, on the block


def guided(numbers, t, q, v, place):
    """Angles of crank, rod and block; contacts: front and back upper corner, front and back lower one."""
    m1, m2, m3 = numbers.masses
    c1, s1, c2, s2, c3, s3 = np.cos(q[0]), np.sin(q[0]), np.cos(q[1]), np.sin(q[1]), np.cos(q[2]), np.sin(q[2])
    joint = (m2 / 2 + m3) * numbers.crank * numbers.rod
    place.mass[0, 0] = numbers.inertias[0] + (m1 / 4 + m2 + m3) * numbers.crank**2
    place.mass[1, 1] = numbers.inertias[1] + (m2 / 4 + m3) * numbers.rod**2
    place.mass[0, 1] = place.mass[1, 0] = joint * (c1 * c2 + s1 * s2)
    place.mass[2, 2] = numbers.inertias[2]
    turn = joint * (s1 * c2 - c1 * s2)
    place.force[0] = -turn * v[1] ** 2 - numbers.gravity * numbers.crank * (m1 / 2 + m2 + m3) * c1
    place.force[1] = turn * v[0] ** 2 - numbers.gravity * numbers.rod * (m2 / 2 + m3) * c2
    place.force[2] = numbers.torque
    height = numbers.crank * s1 + numbers.rod * s2
    for k in range(place.gap.size):
        side = 1.0 if k < 2 else -1.0  # upper or lower
        a, b = (numbers.half_length if k % 2 == 0 else -numbers.half_length), side * numbers.half_height
        place.gap[k] = numbers.half_height + numbers.play - side * (height + a * s3 + b * c3)
        place.normal[k, 0], place.normal[k, 1] = -side * numbers.crank * c1, -side * numbers.rod * c2
        place.normal[k, 2] = -side * (a * c3 - b * s3)
        place.slip[k, 0], place.slip[k, 1], place.slip[k, 2] = -numbers.crank * s1, -numbers.rod * s2, -a * s3 - b * c3


def fill(numbers, t, q, v, place):
    """What the system of these numbers says, into ``place``: compiled code finds it by their type."""
    SYSTEMS[type(numbers)](numbers, t, q, v, place)


SYSTEMS = {Loop: journal, Floor: block, Guide: guided}


@overload(fill)
def _fill(numbers, t, q, v, place):
    return SYSTEMS[numbers.instance_class]


# ---------------------------------------------------------------- steps


@dataclass(frozen=True)
class Steps:
    """Times (M + 1,) s, coordinates and rates (M + 1, n), gaps (M + 1, k) m, and impulses of the M steps: normal and
    along the wall (M, k) N.s.
    """

    time: np.ndarray
    q: np.ndarray
    v: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    rubbing: np.ndarray


def time_stepping(
    numbers: Loop | Floor | Guide,
    q: np.ndarray,
    v: np.ndarray,
    step: float,
    count: int,
    *,
    restitution: float,
    friction: float,
    linearised: bool = False,
    foresight: float = 0.5,
    project: bool = False,
) -> Steps:
    """``count`` steps of ``step`` (s) from coordinates and rates (n,).

    What is smooth goes by the midpoint, or, ``linearised``, by what Siconos 4 does: the implicit mean of both ends, by
    one iteration of Newton's from where the rates alone would lead (more where there are impulses), with the mass that
    the linkage has there.  That is of first order where the mass changes, and gains energy; contacts are active there
    that ``foresight`` steps at these rates would take into the wall.  With ``project`` coordinates are put back on the
    walls that a step ended within; without, what a step penetrates stays.
    """
    q, v, contacts = np.array(q, float), np.array(v, float), 4 if isinstance(numbers, Guide) else 1
    found = _march(
        numbers,
        contacts,
        q,
        v,
        float(step),
        count,
        float(restitution),
        float(friction),
        linearised,
        foresight,
        project,
    )
    steps = Steps(step * np.arange(count + 1), *found)
    assert np.isfinite(steps.q).all()
    return steps


@njit(cache=True)
def _solved(a, b):
    """x of a x = b, by elimination: a is a mass, so that no row need change its place."""
    a, b = a.copy(), b.copy()
    for i in range(b.size):
        for j in range(i + 1, b.size):
            share = a[j, i] / a[i, i]
            a[j] -= share * a[i]
            b[j] -= share * b[i]
    for i in range(b.size - 1, -1, -1):
        for j in range(i + 1, b.size):
            b[i] -= a[i, j] * b[j]
        b[i] /= a[i, i]
    return b


@njit(cache=True)
def _empty(n, k):
    return Place(
        np.zeros((n, n)), np.zeros(n), np.zeros(k), np.zeros((k, n)), np.zeros((k, n)), np.zeros(k), np.zeros(k)
    )


@njit(cache=True)
def _march(numbers, contacts, q, v, h, count, restitution, friction, linearised, foresight, project):
    n, k = q.size, contacts
    place = _empty(n, k)
    qs, vs, gaps = np.empty((count + 1, n)), np.empty((count + 1, n)), np.empty((count + 1, k))
    pushed, rubbed = np.zeros((count, k)), np.zeros((count, k))
    for i in range(count + 1):
        fill(numbers, i * h, q, v, place)
        qs[i], vs[i], gaps[i] = q, v, place.gap
        if i == count:
            break
        if linearised:
            active = np.flatnonzero(place.gap + foresight * h * (place.normal @ v + place.normal_moved) <= NEAR)
            laws = restitution, friction
            after = _implicit(numbers, i * h, q, v, h, place, active, laws, pushed[i], rubbed[i])
        else:
            half = v + h / 2 * _solved(place.mass, place.force)
            fill(numbers, (i + 0.5) * h, q + h / 2 * v, half, place)
            active = np.flatnonzero(place.gap <= NEAR)
            after = v + h * _solved(place.mass, place.force)
            if active.size:
                moved = restitution * (place.normal @ v + place.normal_moved)
                after = _struck(place, place.mass, active, moved, after, friction, pushed[i], rubbed[i])
        q = q + h / 2 * (v + after)
        v = after
        if project and active.size:
            q = _projected(numbers, (i + 1) * h, q, v, place, active)
    return qs, vs, gaps, pushed, rubbed


@njit(cache=True)
def _implicit(numbers, t, q, v, h, place, active, laws, pushed, rubbed):
    """Rates after a linearised step, from the place at its begin."""
    begin, bounced = place.force.copy(), laws[0] * (place.normal @ v + place.normal_moved)
    after, end = v, q + h * v
    for _ in range(ITERATIONS):
        fill(numbers, t + h, end, after, place)
        weight = place.mass + _stiff(numbers, t + h, end, after, h)
        residual = place.mass @ (after - v) - h / 2 * (begin + place.force)
        free = after - _solved(weight, residual)
        pushed[:], rubbed[:] = 0.0, 0.0
        last = after
        after = _struck(place, weight, active, bounced, free, laws[1], pushed, rubbed)
        end = q + h / 2 * (v + after)
        if pushed.max() == 0.0 or np.abs(after - last).max() <= SETTLED * np.abs(after).max():
            break
    return after


@njit(cache=True)
def _stiff(numbers, t, q, v, h):
    """What the forces' dependence on rates and coordinates adds to the mass in an implicit step (n, n)."""
    n = q.size
    added, one, other = np.zeros((n, n)), _empty(n, 0), _empty(n, 0)
    for j in range(n):
        for share, small, of_rates in ((h / 2, 1e-3, True), (h * h / 4, 1e-6, False)):
            up, down = (v if of_rates else q).copy(), (v if of_rates else q).copy()
            up[j] += small
            down[j] -= small
            if of_rates:
                fill(numbers, t, q, up, one)
                fill(numbers, t, q, down, other)
            else:
                fill(numbers, t, up, v, one)
                fill(numbers, t, down, v, other)
            added[:, j] -= share * (one.force - other.force) / (2 * small)
    return added


@njit(cache=True)
def _struck(place, weight, active, bounced, free, friction, pushed, rubbed):
    """Rates after the step, from those that it would end with off the walls, and the speeds that bounce back (k,)."""
    momentum = np.abs(weight @ free).max()
    v = free.copy()
    lean = np.empty((active.size, 2, v.size))  # change of rates for a unit impulse
    for j in range(active.size):
        lean[j, 0] = _solved(weight, place.normal[active[j]])
        lean[j, 1] = _solved(weight, place.slip[active[j]])
    for _ in range(SWEEPS):
        change = 0.0
        for j in range(active.size):
            c = active[j]
            normal, slip = place.normal[c], place.slip[c]
            wanted = np.dot(normal, v) + place.normal_moved[c] + bounced[c]
            push = max(0.0, pushed[c] - wanted / np.dot(normal, lean[j, 0]))
            change = max(change, abs(push - pushed[c]))
            v += lean[j, 0] * (push - pushed[c])
            pushed[c] = push
            sliding = np.dot(slip, v) + place.slip_moved[c]
            rub = rubbed[c] - sliding / np.dot(slip, lean[j, 1]) if friction > 0 else 0.0
            rub = min(max(rub, -friction * push), friction * push)
            change = max(change, abs(rub - rubbed[c]))
            v += lean[j, 1] * (rub - rubbed[c])
            rubbed[c] = rub
        if change <= SETTLED * max(pushed.max(), momentum):
            break
    return v


@njit(cache=True)
def _projected(numbers, t, q, v, place, active):
    """Coordinates whose active contacts are not within the wall, nearest by kinetic energy."""
    for _ in range(SWEEPS):
        fill(numbers, t, q, v, place)
        worst = 0.0
        for c in active:
            worst = min(worst, place.gap[c])
        if worst > -NEAR / 100:
            break
        for c in active:
            if place.gap[c] < 0:
                lean = _solved(place.mass, place.normal[c])
                q = q - lean * (place.gap[c] / np.dot(place.normal[c], lean))
                fill(numbers, t, q, v, place)
    return q


# ---------------------------------------------------------------- the same with walls that give


@njit(cache=True)
def compliant(numbers, contacts, q, v, h, count, every, stiffness, chi, friction, smooth):
    """States (M, 2 n) and gaps (M, k) every so many of ``count`` steps of Runge and Kutta's fourth order, where walls
    push with max(0, K d (1 + chi d'/v0)), v0 the speed of each contact's last touch, and friction comes on over the
    slip ``smooth`` (m/s).
    """
    n = q.size
    place = _empty(n, contacts)
    y = np.concatenate((q, v))
    out, gaps = np.empty((count // every + 1, 2 * n)), np.empty((count // every + 1, contacts))
    touched, touching = np.full(contacts, 1e9), np.zeros(contacts, np.bool_)
    k = np.empty((4, 2 * n))
    for i in range(count + 1):
        fill(numbers, i * h, y[:n], y[n:], place)
        for c in range(contacts):
            if place.gap[c] >= 0:
                touching[c] = False
            elif not touching[c]:
                touching[c] = True
                touched[c] = max(-np.dot(place.normal[c], y[n:]) - place.normal_moved[c], 1e-3)
        if i % every == 0:
            out[i // every], gaps[i // every] = y, place.gap
        for stage in range(4):
            at = y.copy() if stage == 0 else y + (h if stage == 3 else h / 2) * k[stage - 1]
            fill(numbers, i * h + (0.0, h / 2, h / 2, h)[stage], at[:n], at[n:], place)
            force = place.force.copy()
            for c in range(contacts):
                if place.gap[c] < 0:
                    rate = -np.dot(place.normal[c], at[n:]) - place.normal_moved[c]
                    push = max(0.0, -stiffness * place.gap[c] * (1 + chi * rate / touched[c]))
                    slip = np.dot(place.slip[c], at[n:]) + place.slip_moved[c]
                    force += push * place.normal[c] - friction * push * np.tanh(slip / smooth) * place.slip[c]
            k[stage, :n], k[stage, n:] = at[n:], _solved(place.mass, force)
        y = y + h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])
    return out, gaps
