"""Pins that strike their bearings under a contact law by name, row by row of MuJoCo's constraints.

A row's force is D (aref - a), never negative: D a mass, a how the penetration accelerates inwards, aref what we say.
Semi-implicit Euler's velocities are half a step h older than its positions, and K d + C d' wants both of one instant.
With D = C h/2 and aref = (K d + C d')/D the force is K d + C (d' + d'' h/2), which is that: of second order in the
step, and stable however much the law damps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_models.common.contact_laws import NamedLaw

UNDAMPED_ROW = 1e-6  # of the lighter link's mass: D of a row without damping
GRIP = 10.0  # the same of the rows of friction: slip that is less than a step's impulse through ten of it is held


def mean_of_touch(depth: float, since: float, step: float = 1.0) -> tuple[float, float]:
    """How deep (m) a pin is in its wall in the mean over the step that finds it there, so deep, ``since`` when (s, or
    in steps) it touched, and for what share of that step it is: from half a step before its instant to half a step
    after it, as far as there was contact.
    """
    there = since + step / 2
    return depth / since * there / 2, there / step


@dataclass
class MujocoStriking:
    """A pin under a law, from step to step; ``mass`` (kg) is that of the lighter link, ``friction`` Coulomb's.

    ``seen`` are the last three instants (s), the latest first, and how deep (m; negative: off the wall) it was then.
    """

    law: NamedLaw
    mass: float
    friction: float
    touched: float = 0.0  # m/s, the speed at which it last came to its wall
    since: float = math.inf  # s, how long it had been there at the instant that found it there
    seen: tuple[tuple[float, float], ...] = ()

    def see(self, time: float, depth: float) -> None:
        """Take in how deep (m) it is at a time (s), which may be looked at again."""
        if self.seen and self.seen[0][0] == time:
            return
        self.seen, before = ((time, depth), *self.seen[:2]), self.seen
        self.since = math.inf
        if depth > 0 and before and before[0][1] <= 0:
            self._touch()

    def _touch(self) -> None:
        """Find when, and how fast, it came to its wall in the last step: on a parabola through the last three depths,
        since a pin that swings around its bearing comes to the wall ever faster.
        """
        (now, depth), (before, free), *earlier = self.seen
        speed, bend = (depth - free) / (now - before), 0.0
        for time, deep in earlier:
            bend = (speed - (free - deep) / (before - time)) / ((now - time) / 2)
        self.since = depth / speed
        self.touched = max(speed + bend * ((now - before) / 2 - self.since), 0.0)

    def push(self, rate: float, step: float) -> tuple[float, float]:
        """Force (N) of the wall on a pin in it, at the rate (m/s) that its depth had half a step (s) ago, and D (kg) of
        its row.

        In the step that finds the pin at its wall the force is that of :func:`mean_of_touch`.
        """
        depth, share = self.seen[0][1], 1.0
        if self.since <= step:
            depth, share = mean_of_touch(depth, self.since, step)
        damping = share * self.law.damping_at(depth, self.touched)
        return share * self.law.stiffness * depth + damping * rate, max(damping * step / 2, UNDAMPED_ROW * self.mass)

    def rub(self, force: float, soft: float, slip: float, gain: float, step: float) -> tuple[float, float]:
        """By how much (m/s^2) the normal row's aref must differ for this force (N) to be exact beside friction, with
        this D (kg), slip (m/s) and how that changes (m/s^2), and mu of its cone.

        MuJoCo's cone gives D (aref - a + friction |a_t - aref_t|)/(1 + mu^2) where the pin slides.
        """
        mu = self.friction * math.sqrt(soft / (GRIP * self.mass))
        slides = GRIP * self.mass * abs(slip) > self.friction * force * step
        return (mu**2 * force / soft - self.friction * abs(slip / step + gain) if slides else 0.0), mu
