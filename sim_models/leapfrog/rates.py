"""How the bodies of a :class:`~sim_models.leapfrog.bodies.PlanarWorld` moved in a step, centred on the positions from
which it started.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE
from sim_models.common.rates import rate_columns
from sim_models.common.start import Pose
from sim_models.leapfrog.parts import AT_REST, Branch

if TYPE_CHECKING:
    from sim_models.leapfrog.bodies import PlanarWorld


@dataclass(frozen=True)
class Turning:
    """Rates of a body: velocity (m/s) and acceleration (m/s^2) of its origin, x + iy, angular velocity (rad/s) and
    acceleration (rad/s^2).
    """

    velocity: complex = 0j
    acceleration: complex = 0j
    spin: float = 0.0
    spin_up: float = 0.0

    def carried(self, arm: complex) -> Turning:
        """The same of a point that is this far (m, x + iy) from the origin."""
        turned, swing = 1j * self.spin * arm, (1j * self.spin_up - self.spin * self.spin) * arm
        return Turning(self.velocity + turned, self.acceleration + swing, self.spin, self.spin_up)


def centre_rates(world: PlanarWorld, before: Mapping[str, Pose], h: float) -> dict[str, float]:
    """Rates of every body's centre of mass at the poses before the last step, of h (s), for a Trace; none at rest."""
    out: dict[str, float] = {}
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that diverges; its trace says so
        moved = {} if world.static else body_rates(world, before, {name: world.pose(name) for name in before}, h)
        for name, pose in before.items():
            centre = moved.get(name, Turning()).carried(world.points[name, MASS_CENTRE] * np.exp(1j * pose.angle))
            out |= rate_columns(name, centre.velocity, centre.acceleration, centre.spin_up)
    return out


def body_rates(
    world: PlanarWorld, before: Mapping[str, Pose], after: Mapping[str, Pose], h: float
) -> dict[str, Turning]:
    """Rates of every moving body's origin at the poses before a step of h (s), from those after it too.

    A coordinate's rate changes evenly in the step; the velocities of the poses before are ``world.trailing`` (s) older
    than the poses.
    """
    found = {GROUND: Turning()}
    for branch in world.branch.values():
        (_, old), (_, new) = world.coordinates(branch, before), world.coordinates(branch, after)
        change = (np.array(new) - np.array(old)) / h
        found[branch.child] = _carried(
            world, branch, before, found[branch.parent], old + world.trailing * change, change
        )
    return {name: found[name] for name in before}


def _carried(
    world: PlanarWorld, branch: Branch, at: Mapping[str, Pose], parent: Turning, rate: np.ndarray, change: np.ndarray
) -> Turning:
    """A body's rates, from its parent's and those of its own coordinates."""
    if branch.joint is None:
        return Turning(complex(rate[0], rate[1]), complex(change[0], change[1]), float(rate[2]), float(change[2]))
    name, here, base = branch.joint.name, at[branch.child], at.get(branch.parent, AT_REST)
    pin = here.origin + world.points[branch.child, name] * np.exp(1j * here.angle)
    on = parent.carried(pin - base.origin)  # the pin, as a point of the parent
    v, a = float(rate[0]), float(change[0])
    if branch.joint.prismatic:
        along = branch.axis * np.exp(1j * here.angle)
        on = Turning(on.velocity + v * along, on.acceleration + (a + 2j * on.spin * v) * along, on.spin, on.spin_up)
    else:
        on = Turning(on.velocity, on.acceleration, on.spin + v, on.spin_up + a)
    return on.carried(here.origin - pin)
