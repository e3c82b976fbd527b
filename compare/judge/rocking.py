"""How long a block rocks on walls that yield, after the friction at its corners has turned round.

Where its sliding reverses, friction's couple mu N h/2 changes its sign, and the block turns to where its corners bear
the other one.  Two of them on a wall are a spring k = K L^2/2 and a damper c = C L^2/2 of its turning,

    I phi'' + c phi' + k phi = couple,

and its reaction's moment, which is 0 at rest, is I phi'': of a couple that steps by S

    S (I/k) (s1^2 s2 exp(s1 t) - s2^2 s1 exp(s2 t)) / (s1 - s2),    s1, s2 = (-c +- sqrt(c^2 - 4 I k)) / (2 I).

Without damping that never ends, and each reversal adds to it.
"""

from __future__ import annotations

import math

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.kinematics.reach import turns_fully
from analytic.mechanism import GROUND, Joint, Mechanism
from sim_models.common.contact_laws import contact_parameters, named_law

WAY = 720  # places along a turn between which the rate of sliding is linear


def rocking(assembly: Assembly, joint: Joint, theta: np.ndarray, speed: float, across: np.ndarray) -> np.ndarray:
    """Up to which moment (N,) N.m a block is still rocking at crank angles theta (N,) rad of a crank that turns at
    ``speed`` (rad/s), pressed by a force (N,) N ``across``; infinite where nothing damps it, 0 where nothing turns it.
    """
    if joint.guide is None or not joint.friction:
        return np.zeros(theta.shape)
    length, height = joint.guide
    stiffness, damping = _walls(assembly.mechanism, joint, across)
    spring, damper = stiffness * length**2 / 2, damping * length**2 / 2
    inertia = 1 / sum(1 / assembly.mechanism.moving[b].moment_of_inertia for b in joint.bodies if b != GROUND)
    root = np.sqrt((damper**2 - 4 * inertia * spring).astype(complex))
    fast, slow = (-damper - root) / (2 * inertia), (-damper + root) / (2 * inertia)
    since, step = _since_reversal(assembly, joint, theta, speed), joint.friction * np.abs(across) * height
    with np.errstate(all="ignore"):
        terms = [one**2 * other / (slow - fast) * np.exp(one * since) for one, other in ((slow, fast), (fast, slow))]
        kept = np.exp(slow.real * math.tau / abs(speed) / 2)  # of it, until the next reversal
        moment = step * inertia / spring * (abs(terms[0]) + abs(terms[1])) / (1 - kept)
    return np.asarray(np.where(step > 0, moment, 0.0))


def undamped(mechanism: Mechanism, joint: Joint) -> bool:
    """Whether nothing damps the contact of a joint."""
    return not _walls(mechanism, joint, np.ones(1))[1].any()


def _walls(mechanism: Mechanism, joint: Joint, across: np.ndarray) -> tuple[float, np.ndarray]:
    """Stiffness (N/m) of a corner's wall and its damping (N,) N.s/m, where a block lies flat under a force (N,) N."""
    law, made = named_law(mechanism, joint, "driven"), contact_parameters(mechanism, joint, "driven")
    if law is not None and law.hysteresis:
        return law.stiffness, np.abs(across) / 2 * law.hysteresis / law.slowest
    return made.stiffness, np.full(across.shape, made.damping)


def _since_reversal(assembly: Assembly, joint: Joint, theta: np.ndarray, speed: float) -> np.ndarray:
    """Time (N,) s since a joint's sliding last reversed; infinite where it has not on the way to a sample."""
    way = math.copysign(1.0, speed)
    low, high = (way * theta).min() - (math.tau if turns_fully(assembly) else 0.0), (way * theta).max()
    places = np.linspace(low, high, max(2, math.ceil((high - low) / math.tau * WAY)))
    rate = kinematics(assembly, way * places, speed).slip(joint)
    at = np.flatnonzero(rate[1:] * rate[:-1] < 0)
    reversals = places[at] + (places[at + 1] - places[at]) * rate[at] / (rate[at] - rate[at + 1])
    last = np.searchsorted(reversals, way * theta) - 1
    before = np.append(reversals, -np.inf)[last]  # of -1, none, the last
    return (way * theta - before) / abs(speed)
