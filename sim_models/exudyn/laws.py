"""Parameters of Exudyn's own laws of contact and friction, from a joint's."""

from __future__ import annotations

import math
from collections.abc import Sequence

from analytic.mechanism import Joint, Mechanism
from sim_models.common.contact_laws import KelvinVoigt, lighter_mass, restitution
from sim_models.exudyn.motor import RunMotor

MINIMUM_IMPACT_SPEED = 1e-2  # m/s: slower touches are damped as one of this speed
CONTACT_CREEP = 1e-3  # m/s, sliding speed below which contact friction falls to zero
JOINT_CREEP = (
    1e-3  # of the drive's top speed (a free drive: 1 rad/s), below which a joint's Coulomb friction falls to zero
)


def contact_restitution(mechanism: Mechanism, joint: Joint, law: KelvinVoigt) -> float:
    """Restitution of a joint's contact: as given, or what its Kelvin-Voigt damping delivers for the lighter link.

    Kept in (0.01, 1], because Exudyn's law divides by it.
    """
    if joint.restitution is not None:
        return max(joint.restitution, 0.01)
    return max(restitution(law.damping / (2 * math.sqrt(law.stiffness * lighter_mass(mechanism, joint)))), 0.01)


def hysteresis(e: float) -> float:
    """Factor chi of Exudyn's impactModel 2, F = K d (1 + chi d'/v0), for restitution e.

    Carvalho and Martins (2019) for e > 1/3, Gonthier et al. (2004) below.
    """
    return 1.5 * (1 - e) * (11 - e) / (1 + 9 * e) if e > 1 / 3 else (1 - e**2) / e


def joint_creep(motors: Sequence[RunMotor]) -> float:
    """Angular velocity (rad/s) of a joint below which its Coulomb friction falls to zero."""
    return JOINT_CREEP * (max((motor.top_speed for motor in motors), default=0.0) or 1.0)
