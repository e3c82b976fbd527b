"""Parameters of Exudyn's own laws of contact and friction, from a joint's."""

from __future__ import annotations

import math
from collections.abc import Sequence

from analytic.mechanism import Joint, Mechanism
from sim_models.common.contact_laws import (
    KelvinVoigt,
    NamedLaw,
    contact_parameters,
    lighter_mass,
    named_law,
    restitution,
    told_of,
)
from sim_models.engine import JointModel, Motion, Request, SettingValue
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


def named_laws(mechanism: Mechanism, joint_model: JointModel, motion: Motion) -> dict[str, NamedLaw]:
    """The laws that the mechanism names of joints with clearance in contact, where the linkage moves."""
    if joint_model not in ("contact", "spring-damper"):
        return {}
    laws = {name: named_law(mechanism, mechanism.joint(name), motion) for name in mechanism.clearances}
    return {name: law for name, law in laws.items() if law is not None}


def law_settings(request: Request) -> dict[str, SettingValue]:
    """What the joints with clearance were made of, for a trace's settings: laws in words, the softest stiffness, and
    damping and restitution by joint.
    """
    m, model = request.mechanism, request.joint_model
    if model == "massless-link" or not request.clearances:
        return {}
    joints = {name: m.joint(name) for name in request.clearances}
    contact = {name: contact_parameters(m, joint, request.motion) for name, joint in joints.items()}
    named = named_laws(m, model, request.motion)
    unnamed = {name: joint for name, joint in joints.items() if name not in named}
    one_sided = {name for name, joint in unnamed.items() if model == "spring-damper" or joint.prismatic}
    linear = one_sided | {name for name, joint in unnamed.items() if joint.contact_damping is not None}
    bouncing = {name: contact_restitution(m, joints[name], contact[name]) for name in unnamed if name not in linear}
    alike = {law.words for law in named.values()}
    words = ["max(0, K d + C d')"] * bool(one_sided) + ["K d + C d'"] * bool(linear - one_sided)
    words += ["K d (1 + chi d'/v0), Carvalho-Martins 2019 (e > 1/3) or Gonthier et al. 2004"] * bool(bouncing)
    words += [*alike] if len(alike) == 1 and not unnamed else [f"{name}: {law.words}" for name, law in named.items()]
    damping = {name: law.damping for name, law in sorted(named.items()) if not law.hysteresis}
    damping = {name: contact[name].damping for name in sorted(linear)} | (damping if any(damping.values()) else {})
    return {
        "contact_stiffness": min(law.stiffness for law in contact.values()),
        **({"contact_damping": damping} if damping else {}),
        **({"minimum_impact_speed": MINIMUM_IMPACT_SPEED} if bouncing else {}),
        "contact_law": "; ".join(words),
        **told_of(m, named),
        **({"restitution": bouncing | {name: law.asked for name, law in named.items()}} if bouncing else {}),
    }
