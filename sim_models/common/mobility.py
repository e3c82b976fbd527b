"""How readily the gap of a joint with clearance gives way to a force, in a linkage of rigid bodies."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from analytic.mechanism import MASS_CENTRE, Joint, Mechanism
from sim_models.common.contact_laws import longest
from sim_models.common.guide import Guide
from sim_models.common.start import AT_REST, Pose

TRIFLE_OF_MASS = 1e-6  # of a body's mass on the longest body: a slide's block may have no moment of inertia
SINGULAR_ROWS = 1e-9  # of the largest: what a joint asks that others ask already


def mobility(
    m: Mechanism,
    bodies: Mapping[str, Pose],
    joint: Joint,
    closed: Iterable[Joint],
    held: Iterable[Joint],
    aside: complex = 0j,
) -> np.ndarray:
    """(2, 2) 1/kg, ground frame: acceleration of a joint's second pin from its first under a force on the second, and
    the opposite on the first, in these poses; or of what of the two bodies is ``aside`` (m, ground frame) of it.

    The joints ``closed`` stay so, and the motors in those ``held`` do not give way.  All others are loose.
    """
    least = TRIFLE_OF_MASS * longest(m) ** 2
    sizes = [(body.mass, body.mass, max(body.moment_of_inertia, least * body.mass)) for body in m.bodies]
    free = 1 / np.ravel(sizes)
    apart = _apart(m, bodies, joint, aside)
    rows = [row for each in closed for row in _closing(m, bodies, each)] + [_moving(m, bodies, each) for each in held]
    bare = apart * free @ apart.T
    if not rows:
        return np.asarray(bare)
    ties = np.array(rows)
    ties /= np.sqrt(ties * ties @ free)[:, None]
    between = ties * free @ apart.T
    return np.asarray(
        bare - between.T @ np.linalg.pinv(ties * free @ ties.T, rcond=SINGULAR_ROWS, hermitian=True) @ between
    )


STOP_PHASE = 5e-3  # of what swings freely on a stop, in a step, at most
STOP_DECAY = 1e-3  # of its rate that the stop's damper takes in a step: the square of it is what a rebound is off by


def stop_step(m: Mechanism) -> float:
    """Longest step (s) with which what swings freely strikes the stops of its joints; endless without stops."""
    longest_step = math.inf
    for joint in m.joints:
        if joint.stops:
            inertia, damping = joint_inertia(m, joint), sum(stop.damping for stop in joint.stops)
            phase = STOP_PHASE * math.sqrt(inertia / joint.stiffest())
            longest_step = min(longest_step, phase, STOP_DECAY * inertia / damping if damping else math.inf)
    return longest_step


def joint_inertia(m: Mechanism, joint: Joint) -> float:
    """Inertia (kg.m^2; prismatic: kg) of a joint's two bodies in its own free motion, each about the joint and both
    otherwise free: by what stops of the joint are stepped.  A body with no moment of inertia about a pin is held by
    another joint, and gives no way; endless where both are.
    """
    ease = 0.0
    for body in (m.moving[name] for name in joint.bodies if name in m.moving):
        arm = abs(body.point(MASS_CENTRE) - body.point(joint.name))
        ease += 1 / ((body.mass if joint.prismatic else body.moment_of_inertia + body.mass * arm**2) or math.inf)
    return 1 / ease if ease else math.inf


def _apart(m: Mechanism, bodies: Mapping[str, Pose], joint: Joint, aside: complex = 0j) -> np.ndarray:
    """(2, 3 bodies): velocity of a joint's second body less the first's where the second's point is, or ``aside`` (m,
    ground frame) of it, by the velocities (x, y) of all mass centres and the bodies' angular velocities.
    """
    second = joint.bodies[1]
    at = bodies.get(second, AT_REST)
    place = at.origin + m.body(second).point(joint.name) * np.exp(1j * at.angle) + aside
    rows = np.zeros((2, 3 * len(m.bodies)))
    for k, body in enumerate(m.bodies):
        if body.name in joint.bodies:
            here = bodies[body.name]
            arm = place - here.origin - body.point(MASS_CENTRE) * np.exp(1j * here.angle)
            sign = 1.0 if body.name == second else -1.0
            rows[:, 3 * k : 3 * k + 3] = sign * np.array([[1.0, 0.0, -arm.imag], [0.0, 1.0, arm.real]])
    return rows


def _turning(m: Mechanism, joint: Joint) -> np.ndarray:
    """(3 bodies,): angular velocity of a joint's second body less the first's, by the same."""
    signs = {joint.bodies[0]: -1.0, joint.bodies[1]: 1.0}
    return np.array([part for body in m.bodies for part in (0.0, 0.0, signs.get(body.name, 0.0))])


def corner_mass(
    m: Mechanism, bodies: Mapping[str, Pose], joint: Joint, closed: Iterable[Joint], held: Iterable[Joint]
) -> float:
    """Mass (kg) that the walls of a guide feel at the corner of its block that gives way most, in these poses."""
    guide, along = Guide.of(joint), _along(bodies, joint)
    assert guide is not None  # a mechanism with clearance in a prismatic joint has it
    n, closed, held = np.array([-along.imag, along.real]), [*closed], [*held]
    return 1 / max(float(n @ mobility(m, bodies, joint, closed, held, along * z) @ n) for z in guide.corners)


def _along(bodies: Mapping[str, Pose], joint: Joint) -> complex:
    """Direction of a slide, ground frame."""
    return complex(joint.direction * np.exp(1j * bodies.get(joint.bodies[0], AT_REST).angle))


def _closing(m: Mechanism, bodies: Mapping[str, Pose], joint: Joint) -> list[np.ndarray]:
    """What does not move in a closed joint, by the same."""
    x, y = _apart(m, bodies, joint)
    if not joint.prismatic:
        return [x, y]
    across = 1j * _along(bodies, joint)
    return [across.real * x + across.imag * y, _turning(m, joint)]


def _moving(m: Mechanism, bodies: Mapping[str, Pose], joint: Joint) -> np.ndarray:
    """What a motor in a joint moves, by the same."""
    if not joint.prismatic:
        return _turning(m, joint)
    (x, y), along = _apart(m, bodies, joint), _along(bodies, joint)
    return np.asarray(along.real * x + along.imag * y)
