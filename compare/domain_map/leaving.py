"""Where a pin first leaves its bearing, by the analytic model: the reaction turns faster than the pin can follow.

A pin on the rim lies at the gap g = c exp(i gamma).  The joint's reaction is that of the linkage whose gap moves so,
which to first order in the gap is

    F = F0 + K g + C g' + M g'',

with F0 the ideal linkage's and K, C, M (2 x 2, over the crank angle) found by :mod:`analytic.paper.kinetostatics`.  A
smooth rim takes no force along itself.  That gives gamma an equation of its own,

    0 = F . t,    t = i exp(i gamma),        or, with one mass m at the pin,    m c gamma'' = -|F0| sin(gamma - gamma0):

a pendulum of length c that hangs in the reaction's direction gamma0 and swings at sqrt(|F0| / (m c)).  What holds it is
N = F . n, n = exp(i gamma), which is |F0| cos(gamma - gamma0) + m c gamma'^2: contact is lost where N comes to 0.  A
pin that followed at once would never leave; one that is late does, where the reaction passes near zero and turns.
What counts is how fast the reaction turns there over how fast the pin swings, and where an earlier turn left it
swinging: nothing damps it on the rim.

On walls that yield F is the contact's own force, and g moves in both directions: the same coefficients, two equations
in place of one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import Gap, kinematics
from analytic.kinematics.reach import turns_fully
from analytic.mechanism import Mechanism
from analytic.paper.kinetostatics import kinetostatics
from compare.domain_map.pin_motion import CrankWay, Wall, on_a_rim, on_a_wall
from compare.results.validity import Leaving
from sim_models.common.contact_laws import NamedLaw, contact_parameters, named_law

WAY_POINTS = 1440  # of the crank's way, between which the coefficients are linear
GAP_NUDGE = 1e-6  # of the longest body: the gap by which the coefficients are found
RUN_TURNS = 2  # of a crank that turns fully: a run is judged in its second
BOUND_HALVINGS = 6


@dataclass(frozen=True)
class Reaction:
    """A joint's reaction over the crank's way, to first order in its gap."""

    way: CrankWay

    @cached_property
    def start(self) -> tuple[complex, complex]:
        """F0 (N) where the crank begins, and its rate (N/s)."""
        way = self.way
        at = round((way.begin - way.origin) / way.spacing) % WAY_POINTS
        rates = np.gradient(way.terms[0], way.spacing, edge_order=2) * way.speed
        return complex(way.terms[0, at]), complex(rates[at])

    def leaves(self, clearance: float, law: NamedLaw | None = None) -> float | None:
        """Crank angle (rad) at which a pin with that clearance (m) first leaves; None: it stays.

        It begins on its wall where F0 presses it, and moves as F0 turns.  Without a ``law`` the wall is rigid.
        """
        force, rate = self.start
        outwards, turning = force / abs(force), (rate / force).imag
        if law is None:
            angle = on_a_rim(self.way, clearance, math.atan2(force.imag, force.real), turning)
        else:
            gap = (clearance + abs(force) / law.stiffness) * outwards
            growing = (rate * outwards.conjugate()).real / law.stiffness
            wall = Wall(law.stiffness, law.damping, law.stiffness * law.hysteresis / law.slowest)
            angle = on_a_wall(self.way, wall, clearance, gap, 1j * turning * gap + growing * outwards)
        return None if math.isnan(angle) else float(angle)


def reaction(mechanism: Mechanism, joint: str, theta: np.ndarray) -> Reaction:
    """The reaction of a joint of a linkage driven at constant speed, all its joints ideal but for this one's gap.

    The crank's way is that of a run at the angles theta (N,) rad: along them, or TURNS of them, the second of which
    begins at the first, where it turns fully.  Raises AssemblyError.
    """
    ideal, speed = Assembly(mechanism.ideal()), mechanism.speed
    assert speed is not None
    around = turns_fully(ideal)
    low, high = (float(theta[0]), float(theta[0]) + 2 * math.pi) if around else (float(theta.min()), float(theta.max()))
    at = np.linspace(low, high, WAY_POINTS + 1)
    size = GAP_NUDGE * (max(body.length for body in mechanism.bodies) or 1.0)
    rate = 1e3 * abs(speed)  # of a gap that changes by itself in 1e-3 rad: its inertia tells
    nudges = [way * size * rate**order * np.eye(3)[order] for order in range(3) for way in (1, -1, 1j, -1j)]
    gap = Gap(*np.repeat(np.array([np.zeros(3), *nudges]).T, at.size, axis=1))
    reactions = kinetostatics(kinematics(ideal, np.tile(at, 13), speed, 0.0, {joint: gap}))
    forces = reactions.forces[joint].reshape(13, at.size)
    slopes = [(forces[k] - forces[k + 1]) / (2 * size * rate ** (k // 4)) for k in range(1, 13, 2)]
    turn = math.copysign(RUN_TURNS * 2 * math.pi if around else high - low, speed)
    begin = low - math.copysign(2 * math.pi, speed) if around else low if speed > 0 else high
    return Reaction(CrankWay(np.array([forces[0], *slopes]), low, float(at[1] - at[0]), begin, turn, speed))


def reactions(mechanism: Mechanism, theta: np.ndarray) -> dict[str, Reaction]:
    """The reaction of each joint with clearance; none where one is not determined, the linkage cannot be closed, or one
    is a block's: it leaves corner by corner, and turns on the others.
    """
    if mechanism.loose_guides:
        return {}
    try:
        by_joint = {name: reaction(mechanism, name, theta) for name in mechanism.clearances}
    except AssemblyError:
        return {}
    return by_joint if all(np.all(np.isfinite(one.way.terms)) for one in by_joint.values()) else {}


def leaving(mechanism: Mechanism, theta: np.ndarray) -> Leaving | None:
    """Where the first of a linkage's pins leaves, each taken by itself; None where that is not known."""
    by_joint = reactions(mechanism, theta)
    if not by_joint:
        return None
    sizes = mechanism.clearances
    rigid = [one.leaves(sizes[name]) for name, one in by_joint.items()]
    yielding = [one.leaves(sizes[name], contact_law(mechanism, name)) for name, one in by_joint.items()]
    way = -1.0 if (mechanism.speed or 0.0) < 0 else 1.0

    def first(angles: list[float | None]) -> float | None:
        return min((angle for angle in angles if angle is not None), key=lambda angle: way * angle, default=None)

    return Leaving(rigid=first(rigid), yielding=first(yielding))


def contact_law(mechanism: Mechanism, joint: str) -> NamedLaw:
    """The law of a joint's contact; that of Kelvin and Voigt where the joint names none."""
    one = mechanism.joint(joint)
    made = contact_parameters(mechanism, one, "driven")
    voigt = NamedLaw("kelvin-voigt", made.stiffness, made.damping, 0.0, math.inf, math.nan)
    return named_law(mechanism, one, "driven") or voigt


def boundary(
    mechanism: Mechanism, theta: np.ndarray, clearances: tuple[float, ...], left: tuple[bool, ...], rigid: bool
) -> float | None:
    """The clearance (m) from which on a pin leaves, between those of the increasing ``clearances`` at which it has not
    and has first ``left``: the first of them where it leaves there already; None: it leaves at none.

    Nearby a pin that swings along its rim may leave at one clearance and stay at the next: this is one of such bounds.
    ``mechanism`` has its joints' clearances, of whatever size.
    """
    if not any(left):
        return None
    k = left.index(True)
    if k == 0:
        return clearances[0]
    kept, lost = clearances[k - 1], clearances[k]
    by_joint = reactions(mechanism, theta)
    laws = {name: None if rigid else contact_law(mechanism, name) for name in by_joint}
    for _ in range(BOUND_HALVINGS):
        middle = math.sqrt(kept * lost)
        if any(one.leaves(middle, laws[name]) is not None for name, one in by_joint.items()):
            lost = middle
        else:
            kept = middle
    return lost
