"""Contact parameters that every engine shares: Kelvin-Voigt stiffness and damping of a clearance joint.

A journal that penetrates its bearing by d at rate d' is pushed back with max(0, K d + C d').
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from analytic.mechanism import Body, Joint, Mechanism
from sim_models.engine import Motion

STATIC_STIFFNESS = 1e8  # N/m, where the mechanism gives none and nothing moves
DRIVEN_STIFFNESS = 1e7  # N/m, where the mechanism gives none and the crank turns
DAMPING_RATIO = 0.5  # of the lighter link on that stiffness, where the mechanism gives neither damping nor restitution
PIN_RADIUS = 0.01  # m, where the mechanism gives none; matters only with friction


@dataclass(frozen=True)
class KelvinVoigt:
    """Contact stiffness (N/m) and damping (N.s/m) outside the gap."""

    stiffness: float
    damping: float


def contact_parameters(mechanism: Mechanism, joint: Joint, motion: Motion) -> KelvinVoigt:
    """What a joint's contact is made of: as the mechanism says, or this project's defaults.

    Damping comes from ``contact_damping``, else from ``restitution`` (delivered, for the lighter of the two links
    bouncing alone), else from DAMPING_RATIO.
    """
    stiffness = joint.contact_stiffness or (STATIC_STIFFNESS if motion == "static" else DRIVEN_STIFFNESS)
    if joint.contact_damping is not None:
        return KelvinVoigt(stiffness, joint.contact_damping)
    ratio = DAMPING_RATIO if joint.restitution is None else damping_ratio(joint.restitution)
    return KelvinVoigt(stiffness, 2 * ratio * math.sqrt(stiffness * lighter_mass(mechanism, joint)))


def lighter_mass(mechanism: Mechanism, joint: Joint) -> float:
    """Mass (kg) of the lighter moving link at a joint."""
    links = [mechanism.body(name) for name in joint.bodies]
    return min(body.mass for body in links if isinstance(body, Body))


def restitution(ratio: float) -> float:
    """Restitution that a Kelvin-Voigt contact of this damping ratio delivers when it never pulls.

    The journal leaves where the force vanishes, not where the penetration does (Schwager and Poeschel 2007, Eq. 15 ff.).
    """
    if ratio < 1:
        root = math.sqrt(1 - ratio**2)
        return math.exp(-ratio / root * (math.pi - math.atan2(2 * ratio * root, 1 - 2 * ratio**2)))
    if ratio == 1:
        return math.exp(-2)
    root = math.sqrt(ratio**2 - 1)
    return math.exp(-ratio / root * math.log((ratio + root) / (ratio - root)))


def damping_ratio(delivered: float) -> float:
    """Damping ratio of a Kelvin-Voigt contact that delivers this restitution (0 < e <= 1); 0 gives a ratio of 20 (e = 0.0006)."""
    low, high = 0.0, 20.0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if restitution(middle) > delivered else (low, middle)
    return (low + high) / 2


def hertz_stiffness(bearing_radius: float, journal_radius: float, youngs_modulus: float, poisson: float = 0.3) -> float:
    """Generalised stiffness K (N/m^1.5) of a journal in a bearing of the same material, F = K d^1.5.

    The radii (m) subtract because the bearing is hollow (Lankarani and Nikravesh 1990, Eq. 7).  For ``contact_stiffness``
    linearise it at the working load: dF/dd = 1.5 K^(2/3) F^(1/3).  Raises ValueError unless the journal fits.
    """
    if not 0 < journal_radius < bearing_radius:
        raise ValueError(f"journal_radius = {journal_radius} m does not fit into bearing_radius = {bearing_radius} m; make it smaller")
    flexibility = 2 * (1 - poisson**2) / youngs_modulus
    return 4 / (3 * flexibility) * math.sqrt(bearing_radius * journal_radius / (bearing_radius - journal_radius))
