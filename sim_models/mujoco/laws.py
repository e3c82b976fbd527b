"""What the joints with clearance of a MuJoCo linkage are made of."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from sim_models.common.backlash import Flanks
from sim_models.common.contact_laws import (
    DAMPING_RATIO,
    KelvinVoigt,
    NamedLaw,
    contact_parameters,
    damping_ratio,
    lighter_mass,
    named_law,
    told_of,
)
from sim_models.engine import Request, SettingValue

SOFT, HARD = 1e-4, 0.9999  # the least and the greatest impedance that MuJoCo takes
UNDAMPED = 2e-2  # damping over the root of stiffness and mass, below which a cone's friction would give
RUBBING_DAMPING = (
    0.1  # damping ratio of a hard bounce, below which a cone's friction would follow what pushes and not what slides
)


@dataclass(frozen=True)
class WallContact:
    """Law of a clearance joint: stiffness (N/m) and damping (N.s/m), or ``hard``: period/2 pi (s) and damping ratio of
    a bounce.

    A hard contact counts from ``margin`` (m) before the rim: a pressed pin would otherwise flicker between in and out.
    A law that the mechanism calls by its name is ``named``, and never hard.
    """

    stiffness: float
    damping: float
    hard: tuple[float, float] | None = None
    margin: float = 0.0
    named: NamedLaw | None = None

    @property
    def words(self) -> str:
        """The law in words."""
        if self.named is not None:
            return self.named.words
        if self.hard is None:
            return "max(0, K d + C d') outside the gap"
        return f"hard, bounces at damping ratio {self.hard[1]:.3g}"


def contact_laws(request: Request) -> dict[str, WallContact]:
    """The law of each joint with clearance; none for ideal joints.

    ``contact`` in a driven run is hard (it bounces as its restitution says, whatever mass it carries) unless the
    mechanism gives a stiffness or damping, or a law by name; every other compliant joint is a spring and damper in SI
    units.  That of a block with friction is Kelvin and Voigt's by name, and so is that of a pin with friction and next
    to no damping: friction by that name is no softer for it.
    """
    laws, struck = {}, request.joint_model in ("contact", "spring-damper")
    for name in request.clearances:
        joint = request.mechanism.joint(name)
        law = contact_parameters(request.mechanism, joint, request.motion)
        stated = joint.contact_damping is not None or (
            joint.contact_stiffness is not None and name not in request.assumed
        )
        stated = stated or joint.radial_stiffness is not None
        undamped = law.damping < UNDAMPED * math.sqrt(law.stiffness * lighter_mass(request.mechanism, joint))
        if stated and struck and joint.rough and joint.contact_law is None and (joint.prismatic or undamped):
            joint = joint.model_copy(update={"contact_law": "kelvin-voigt"})
        named = named_law(request.mechanism, joint, request.motion) if struck else None
        if named is not None:
            laws[name] = WallContact(named.stiffness, named.damping, named=named)
            continue
        hard = None
        if request.joint_model == "contact" and request.motion == "driven" and not stated:
            ratio = DAMPING_RATIO if joint.restitution is None else damping_ratio(joint.restitution)
            hard = math.sqrt(lighter_mass(request.mechanism, joint) / law.stiffness), ratio
        laws[name] = WallContact(law.stiffness, law.damping, hard)
    return laws


def spring(
    law: WallContact | KelvinVoigt | Flanks, invweight: float, impedance: float = SOFT
) -> tuple[list[float], list[float]]:
    """solref and solimp of a row whose force is K d + C d'; the factor cancels MuJoCo's scaling by impedance, mass.

    With the least ``impedance`` its reference is the force; with another it has a mass of its own, impedance over the
    rest of it and over ``invweight`` (1/kg).
    """
    scale = (1 - impedance) * invweight
    return [-law.stiffness * scale, -law.damping * scale], [impedance, impedance, 1e-3, 0.5, 2]


def law_settings(request: Request, laws: Mapping[str, WallContact]) -> dict[str, SettingValue]:
    """What the joints with clearance were made of: the law in words, the softest stiffness, each joint's damping, a
    hard one's longest bounce (s) and, in a watched run, how far (m) before the rim it begins; of laws by name the
    restitution that is asked for, and delivered.
    """
    if not laws or request.joint_model == "massless-link":
        return {"contact_law": "massless link of fixed length, pulls and pushes"} if laws else {}
    soft = [law for law in laws.values() if not law.hard]
    words = {law.words for law in laws.values()}
    settings: dict[str, SettingValue] = {"contact_law": "; ".join(sorted(words))}
    bounces = [math.pi * law.hard[0] for law in laws.values() if law.hard]
    if bounces:
        settings["bounce_time"] = max(bounces)
        if request.watched:
            settings["contact_margin"] = {name: law.margin for name, law in laws.items()}
    if soft:
        settings["contact_stiffness"] = min(law.stiffness for law in soft)
    damping = {name: law.damping for name, law in laws.items() if law.named is None or not law.named.hysteresis}
    if soft and damping:
        settings["contact_damping"] = next(iter(damping.values())) if len(set(damping.values())) == 1 else damping
    named = {name: law.named for name, law in laws.items() if law.named is not None}
    return settings | told_of(request.mechanism, named)
