"""How slowly a linkage that swings freely must go before loads that oppose its motion fade, and its steps for that.

A force that turns round with a velocity would be thrown from one side to the other in every step at rest; in a released
run it rises from nothing over a short range of velocities instead, in which steps follow it.
"""

from __future__ import annotations

import math

from analytic.mechanism import MASS_CENTRE, Load, Mechanism
from analytic.mechanism.varying import NEVER, Fading
from sim_models.common.contact_laws import longest

FADES_BELOW = 2.5e-4  # of the velocity that the load would take from its body in a radian, or on the longest body's way
FADING_DECAY = 1.0  # of a velocity that the load takes in a step where it fades, at most


def fading(m: Mechanism, load: Load) -> Fading:
    """Below which velocity (m/s) and rate (rad/s) a load that opposes a released motion fades."""
    if not load.opposes:
        return NEVER
    force, torque = slowed(m, load)
    return Fading(FADES_BELOW * math.sqrt(force * longest(m)), FADES_BELOW * math.sqrt(torque))


def fading_step(m: Mechanism) -> float:
    """Longest step (s) that follows such loads where they fade; endless without one."""
    steps = [
        FADING_DECAY * below / change
        for load in m.loads
        for below, change in zip(fading(m, load), slowed(m, load), strict=True)
        if below
    ]
    return min(steps, default=math.inf)


def slowed(m: Mechanism, load: Load) -> tuple[float, float]:
    """By how much, at most, a load changes its point's velocity (m/s^2) and its body's rate (rad/s^2): as if the body
    were free, which its joints can only make less; endless for a body without mass.
    """
    body = m.moving[load.body]
    arm = abs(body.point(load.point) - body.point(MASS_CENTRE))
    force, torque = (load.largest * size for size in (abs(complex(*load.force)), abs(load.torque)))
    by_turning = arm**2 * _by(force, body.moment_of_inertia) if arm else 0.0
    return _by(force, body.mass) + by_turning, _by(torque, body.moment_of_inertia)


def _by(size: float, inertia: float) -> float:
    return 0.0 if not size else size / inertia if inertia else math.inf
