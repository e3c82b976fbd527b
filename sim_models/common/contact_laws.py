"""Contact parameters that every engine shares: stiffness and damping of a clearance joint, and laws by name.

A journal that penetrates its bearing by d at rate d' is pushed back with max(0, K d + C d') (Kelvin and Voigt), or with
max(0, K d (1 + chi d'/v0)), v0 being the speed at which it touched.  No law pulls.  What each law delivers of the
restitution that it is asked for is :func:`delivered`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from analytic.mechanism import Body, Joint, Mechanism
from analytic.mechanism.assumed import Assumed
from analytic.mechanism.parts import SAME_POINT, ContactLaw
from sim_models.engine import Motion, Request, SettingValue

STATIC_STIFFNESS = 1e8  # N/m, where the mechanism gives none and nothing moves
DRIVEN_STIFFNESS = 1e7  # N/m, where the mechanism gives none and the crank turns
SUITED = (
    2.0**0,
    2.0**14,
)  # N/m, of force over length of the linkages that these suit; for others they are harder or softer in proportion
NO_GIVE = 1e30  # N/m, of those
TURN_BY_GIVE = 1.75e-4  # rad, 0.01 deg: what a wall's give under weights and loads may turn a link by, the least that a
# cross-check of contact allows a direction (static.contact in compare/judge/tolerances.toml)
DAMPING_RATIO = 0.5  # of the lighter link on that stiffness, where the mechanism gives neither damping nor restitution
BEARING_RATIO = 0.01  # the same of a soft bearing
TOO_DEEP = 0.1  # of the shortest link at a joint: a pin that is deeper in its bearing is in none
SLOWEST_TOUCH = 1e-3  # of the linkage's length times its rate: slower touches are damped as one of that speed


@dataclass(frozen=True)
class KelvinVoigt:
    """Contact stiffness (N/m) and damping (N.s/m) outside the gap."""

    stiffness: float
    damping: float

    def give(self, force: float) -> float:
        """How far (m) it yields under a steady force (N)."""
        return force / self.stiffness


@dataclass(frozen=True)
class NamedLaw:
    """A law of contact by its name: stiffness (N/m), damping (N.s/m, of Kelvin and Voigt alone), hysteresis factor chi
    (of the others), and the least speed of touching (m/s) that these reckon with.

    ``asked`` is the restitution that the mechanism asks for, or its damping's.
    """

    name: ContactLaw
    stiffness: float
    damping: float
    hysteresis: float
    slowest: float
    asked: float

    def size(self, depth: float, rate: float, touched: float) -> float:
        """Force (N) of a pin that is this deep (m; negative: off the wall) at this rate (m/s), and that touched the
        wall at the speed ``touched`` (m/s).
        """
        if depth <= 0:
            return 0.0
        return max(0.0, self.stiffness * depth + self.damping_at(depth, touched) * rate)

    def damping_at(self, depth: float, touched: float) -> float:
        """Damping (N.s/m) of a pin that is this deep (m) and touched at that speed (m/s)."""
        if self.name == "kelvin-voigt":
            return self.damping
        return self.stiffness * max(depth, 0.0) * self.hysteresis / max(touched, self.slowest)

    @property
    def words(self) -> str:
        """The law, as results tell it."""
        if self.name == "kelvin-voigt":
            return "kelvin-voigt: max(0, K d + C d')"
        return f"{self.name}: max(0, K d (1 + {self.hysteresis:.4g} d'/v0))"


def named_law(mechanism: Mechanism, joint: Joint, motion: Motion) -> NamedLaw | None:
    """The law of a joint's contact that the mechanism names; None where it leaves that to the engine, or at rest.

    What it is made of is :func:`contact_parameters`.  Without a ``restitution`` the laws with hysteresis are asked for
    that of DAMPING_RATIO.
    """
    if joint.contact_law is None or motion == "static":
        return None
    made = contact_parameters(mechanism, joint, motion)
    if joint.restitution is not None:
        asked = joint.restitution
    else:
        asked = restitution(made.damping / (2 * math.sqrt(made.stiffness * lighter_mass(mechanism, joint))))
    voigt = joint.contact_law == "kelvin-voigt"
    return NamedLaw(
        joint.contact_law,
        made.stiffness,
        made.damping if voigt else 0.0,
        0.0 if voigt else hysteresis(joint.contact_law, asked),
        SLOWEST_TOUCH * longest(mechanism) * turning_rate(mechanism, motion),
        asked,
    )


def told_of(mechanism: Mechanism, laws: Mapping[str, NamedLaw]) -> dict[str, SettingValue]:
    """For a trace's settings, of joints whose laws are named: restitution asked for and delivered, and the least speed
    (m/s) of touching that laws reckon with.  Kelvin's and Voigt's law delivers to the lighter link bouncing alone.
    """
    if not laws:
        return {}
    ratios = {
        name: law.damping / (2 * math.sqrt(law.stiffness * lighter_mass(mechanism, mechanism.joint(name))))
        for name, law in laws.items()
    }
    bent = [law.slowest for law in laws.values() if law.hysteresis]
    return {
        "restitution": {name: law.asked for name, law in laws.items()},
        "restitution_delivered": {
            name: restitution(ratios[name]) if law.name == "kelvin-voigt" else delivered(law.hysteresis)
            for name, law in laws.items()
        },
        **({"minimum_impact_speed": min(bent)} if bent else {}),
    }


def hysteresis(law: ContactLaw, asked: float) -> float:
    """Factor chi in F = K d (1 + chi d'/v0) of a law that is asked for a restitution.

    Hunt and Crossley 1975, Lankarani and Nikravesh 1990, Flores et al. 2011, Gonthier et al. 2004.
    """
    match law:
        case "hunt-crossley":
            return 1.5 * (1 - asked)
        case "lankarani-nikravesh":
            return 0.75 * (1 - asked**2)
        case "flores":
            return 1.6 * (1 - asked) / asked
        case "gonthier":
            return (1 - asked**2) / asked
        case _:
            return 0.0


def delivered(chi: float) -> float:
    """Restitution e that F = K d^n (1 + chi d'/v0) delivers, whatever K, n, the mass and the speed: the root of
    chi (1 + e) = ln[(1 + chi)/(1 - chi e)].
    """
    if chi <= 0:
        return 1.0
    low, high = 0.0, min(1.0, 1 / chi)
    for _ in range(80):
        e = (low + high) / 2
        left = math.log1p(chi) - math.log1p(-chi * e) if chi * e < 1 else math.inf
        low, high = (e, high) if left < chi * (1 + e) else (low, e)
    return (low + high) / 2


def contact_parameters(mechanism: Mechanism, joint: Joint, motion: Motion) -> KelvinVoigt:
    """What a joint's contact is made of: as the mechanism says, or this project's defaults; a soft bearing's, of that.

    Damping comes from ``contact_damping``, else from ``restitution`` (delivered, for the lighter of the two links
    bouncing alone), else from DAMPING_RATIO.
    """
    stiffness = joint.radial_stiffness or joint.contact_stiffness or default_stiffness(mechanism, motion)
    if joint.contact_damping is not None:
        return KelvinVoigt(stiffness, joint.contact_damping)
    ratio = DAMPING_RATIO if joint.restitution is None else damping_ratio(joint.restitution)
    return KelvinVoigt(stiffness, 2 * ratio * math.sqrt(stiffness * lighter_mass(mechanism, joint)))


def assumed_of_contact(
    mechanism: Mechanism, loose: Iterable[str], settings: Mapping[str, SettingValue]
) -> tuple[Assumed, ...]:
    """What the contact of a run's ``loose`` joints is made of that the mechanism does not say, as far as an engine has
    used it, which the run's ``settings`` tell.
    """
    return tuple(each for name in loose for each in _assumed_at(mechanism.joint(name), settings))


def _assumed_at(joint: Joint, settings: Mapping[str, SettingValue]) -> Iterator[Assumed]:
    where = f"joint[{joint.name}]"

    def used(name: str) -> float | None:
        value = settings.get(name)
        found = value.get(joint.name) if isinstance(value, Mapping) else value
        return found if isinstance(found, float) else None

    stiffness, damping, bounce = used("contact_stiffness"), used("contact_damping"), used("restitution")
    if used("pin_radius") is not None and joint.pin_radius is None:
        yield Assumed(f"{where}.pin_radius", joint.rim, "m", "the arm of the friction in its contact")
    if stiffness is not None and joint.contact_stiffness is None and joint.radial_stiffness is None:
        yield Assumed(f"{where}.contact_stiffness", stiffness, "N/m", "a hard wall for the forces of the linkage")
    if joint.contact_damping is not None or joint.restitution is not None:
        return
    half = f"damping of {DAMPING_RATIO:g} of critical, of the lighter link"
    if bounce is not None or used("bounce_time") is not None:
        yield Assumed(f"{where}.restitution", bounce or restitution(DAMPING_RATIO), "1", f"what {half} gives back")
    elif damping is not None:
        yield Assumed(f"{where}.contact_damping", damping, "N.s/m", half)


def rims(request: Request) -> dict[str, SettingValue]:
    """For a trace's settings: the radius (m) of each pin that rubs in its bearing's contact."""
    joints = [request.mechanism.joint(name) for name in request.clearances if request.joint_model == "contact"]
    found = {j.name: j.rim for j in joints if j.rough and not j.prismatic}
    return {"pin_radius": found} if found else {}


def bearing(mechanism: Mechanism, joint: Joint) -> KelvinVoigt:
    """What stands between the pin centres of a soft bearing without clearance: its spring, and a damper that lets the
    linkage's sway in it die away but takes next to no force from a steady motion.
    """
    stiffness = joint.radial_stiffness or math.inf
    return KelvinVoigt(stiffness, 2 * BEARING_RATIO * math.sqrt(stiffness * lighter_mass(mechanism, joint)))


def default_stiffness(mechanism: Mechanism, motion: Motion) -> float:
    """Contact stiffness (N/m) of a joint that gives none.

    A linkage whose forces over its length lie outside SUITED has it multiplied by the power of two that brings them
    into the middle.  Under the weights and loads that the linkage carries no wall gives more than TURN_BY_GIVE of the
    shortest link.  What it carries is in its file; what its motion adds is not, and no wall changes with the speed.
    """
    ordinary = STATIC_STIFFNESS if motion == "static" else DRIVEN_STIFFNESS
    scaled = ordinary * power_of_two(
        sum(b.mass for b in mechanism.bodies) * turning_rate(mechanism, motion) ** 2, SUITED
    )
    return min(max(scaled, carried(mechanism) / (TURN_BY_GIVE * shortest(mechanism))), NO_GIVE)


def carried(mechanism: Mechanism) -> float:
    """Size (N) of all weights and loads of a linkage; of a torque, on an arm as long as its body."""
    weights = sum(b.mass for b in mechanism.bodies) * math.hypot(*mechanism.gravity)
    arms = {b.name: b.length or longest(mechanism) for b in mechanism.bodies}
    return weights + sum(math.hypot(*load.force) + abs(load.torque) / arms[load.body] for load in mechanism.loads)


def turning_rate(mechanism: Mechanism, motion: Motion) -> float:
    """Rate (rad/s) of a linkage's motion: its drive's, or that at which gravity and loads would turn it where that is
    faster, or it rests.
    """
    mass, length = sum(b.mass for b in mechanism.bodies), longest(mechanism)
    force = sum(math.hypot(*load.force) + abs(load.torque) / length for load in mechanism.loads)
    speeds = [
        abs(drive.speed) / (length if mechanism.joint(drive.joint).prismatic else 1.0)
        for drive in mechanism.drives
        if isinstance(drive.speed, float)
    ]
    driven = max(speeds, default=0.0) if motion == "driven" else 0.0
    return max(driven, math.sqrt((math.hypot(*mechanism.gravity) + force / mass) / length))


def longest(mechanism: Mechanism) -> float:
    """Length (m) of the longest body; of one with a single point, from there to its centre of mass, if it is elsewhere
    by more than rounding; if no body has a length, 1 m.
    """
    return max(_length(body) for body in mechanism.bodies) or 1.0


def _length(body: Body) -> float:
    """The largest distance (m) of a body's points from each other and from its centre of mass."""
    centre, points = body.centre, [body.point(name) for name in body.points]
    length = max(body.length, *(abs(point - centre) for point in points))
    return length if length > SAME_POINT * max(map(abs, (centre, *points))) else 0.0


def shortest(mechanism: Mechanism) -> float:
    """Length (m) of the shortest body that has one; if none has, of the longest."""
    return min((b.length for b in mechanism.bodies if b.length > 0), default=longest(mechanism))


def shortest_link(mechanism: Mechanism, joint: Joint) -> float:
    """Length (m) of the shortest body at a joint that has one; if none has, of the longest of the linkage."""
    lengths = [b.length for b in mechanism.bodies if b.name in joint.bodies and b.length > 0]
    return min(lengths, default=longest(mechanism))


def pressed_to(clearance: float, give: float, force: complex) -> complex:
    """Gap (m) of a pin that a force (N) presses to its rim and, as far as that gives (m), beyond."""
    return (clearance + give) * force / abs(force)


def heaviest(mechanism: Mechanism) -> float:
    """Mass (kg) of the heaviest body."""
    return max(b.mass for b in mechanism.bodies)


def power_of_two(value: float, within: tuple[float, float]) -> float:
    """The power of two by which a value must be divided to lie in the middle of a range; 1 where it lies within, or is
    0.
    """
    low, high = within
    if low <= value <= high or value == 0:
        return 1.0
    return 2.0 ** round(math.log2(value / math.sqrt(low * high)))


def lighter_mass(mechanism: Mechanism, joint: Joint) -> float:
    """Mass (kg) of the lighter moving link at a joint."""
    links = [mechanism.body(name) for name in joint.bodies]
    return min(body.mass for body in links if isinstance(body, Body))


def restitution(ratio: float) -> float:
    """Restitution that a Kelvin-Voigt contact of this damping ratio delivers when it never pulls.

    The journal leaves where the force vanishes, not where the penetration does (Schwager and Poeschel 2007, Eq. 15
    ff.).
    """
    if ratio < 1:
        root = math.sqrt(1 - ratio**2)
        return math.exp(-ratio / root * (math.pi - math.atan2(2 * ratio * root, 1 - 2 * ratio**2)))
    if ratio == 1:
        return math.exp(-2)
    root = math.sqrt(ratio**2 - 1)
    return math.exp(-ratio / root * math.log((ratio + root) / (ratio - root)))


def damping_ratio(delivered: float) -> float:
    """Damping ratio of a Kelvin-Voigt contact that delivers this restitution (0 < e <= 1); 0 gives a ratio of 20 (e =
    0.0006).
    """
    low, high = 0.0, 20.0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if restitution(middle) > delivered else (low, middle)
    return (low + high) / 2


def hertz_stiffness(bearing_radius: float, journal_radius: float, youngs_modulus: float, poisson: float = 0.3) -> float:
    """Generalised stiffness K (N/m^1.5) of a journal in a bearing of the same material, F = K d^1.5.

    The radii (m) subtract because the bearing is hollow (Lankarani and Nikravesh 1990, Eq. 7).  For
    ``contact_stiffness`` linearise it at the working load: dF/dd = 1.5 K^(2/3) F^(1/3).  Raises ValueError unless the
    journal fits.
    """
    if not 0 < journal_radius < bearing_radius:
        raise ValueError(
            f"journal_radius = {journal_radius} m does not fit into bearing_radius = {bearing_radius} m; make it"
            " smaller"
        )
    flexibility = 2 * (1 - poisson**2) / youngs_modulus
    return 4 / (3 * flexibility) * math.sqrt(bearing_radius * journal_radius / (bearing_radius - journal_radius))
