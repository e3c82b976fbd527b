"""Pins that strike their bearings, and corners their walls, under a contact law by name, stepped by a leapfrog.

A law wants depth and rate of one instant, and the leapfrog's rates are half a step old.  The rate now is reckoned from
the last two, with the force of this step implicit in it: second order in the step, and stable however much the law
damps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from sim_models.common.contact_laws import NamedLaw

FRESH = 200  # steps at the wall after which it is found anew how a pin yields


@dataclass
class LeapfrogStriking:
    """A pin with this clearance (m) under a law, from step to step."""

    law: NamedLaw
    clearance: float
    yields: Callable[[], np.ndarray]  # gives (2, 2) 1/kg, now: how its gap accelerates under a force
    touched: float = 0.0  # m/s, the speed at which it last came to its wall
    off: bool = False  # whether it was off its wall in the last step
    rate: complex | None = None  # m/s, as the last step had it
    force: complex = 0j  # N, in the last step
    mobility: np.ndarray = field(default_factory=lambda: np.zeros((2, 2)))  # 1/kg, as it was some steps ago
    age: int = 0  # of that, in steps at the wall

    def forget(self) -> None:
        """Begin anew, with a pin that has touched nothing."""
        self.touched, self.off, self.rate, self.force = 0.0, False, None, 0j

    def push(self, gap: complex, rate: complex, trailing: float) -> complex:
        """Force (N) on the second body with this gap (m), in the next step of a run; see :meth:`press`."""
        reach = abs(gap)
        return self.press(reach - self.clearance, gap / (reach or 1.0), rate, trailing)

    def press(self, depth: float, normal: complex, rate: complex, trailing: float) -> complex:
        """Force (N) on the second body so deep (m; negative: off) in a wall that pushes it along a unit vector, in the
        next step of a run.

        The rate (m/s), of the first body less the second's, is ``trailing`` (s) older, which is half of the step.

        In the step that finds the pin at its wall, which it reached at an instant between, the force is the mean over
        the step's time: from half a step before the gap's instant to half a step after it, as far as there was contact.
        """
        if self.rate is None:  # it rests on its wall, if it is there
            self.rate, self.force, self.age = rate, self.law.stiffness * max(depth, 0.0) * normal, 0
        change, self.rate = (rate - self.rate) / 2, rate
        if depth <= 0:
            self.off, self.force = True, 0j
            return 0j
        mobility = trailing * self._mobility(normal)
        now, share = _dot(rate + change + mobility * self.force, normal), 1.0
        if self.off:
            self.off, self.touched = False, max(now, 0.0)
            if now > 0:
                since = min(depth / now, 2 * trailing) + trailing
                depth, share = now * since / 2, since / (2 * trailing)
        damping = self.law.damping_at(depth, self.touched)
        size = share * (self.law.stiffness * depth + damping * now) / (1 + share * mobility * damping)
        self.force = max(0.0, size) * normal
        return self.force

    def _mobility(self, normal: complex) -> float:
        """How the gap accelerates along a unit vector under a force along it (1/kg)."""
        if self.off or self.age % FRESH == 0:
            self.mobility, self.age = self.yields(), 0
        self.age += 1
        n = np.array([normal.real, normal.imag])
        return float(n @ self.mobility @ n)


def _dot(a: complex, b: complex) -> float:
    return a.real * b.real + a.imag * b.imag
