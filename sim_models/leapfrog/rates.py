"""How the bodies of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld` moved in a step, centred on the positions from
which it started.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Mechanism
from sim_models.common.rates import rate_columns
from sim_models.common.start import AT_REST, Pose
from sim_models.common.tree import Branch
from sim_models.leapfrog.parts import coordinates


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


def centre_rates(
    m: Mechanism,
    branches: Iterable[Branch],
    before: Mapping[str, Pose],
    after: Mapping[str, Pose] | None,
    h: float,
    trailing: float,
) -> dict[str, float]:
    """Rates of every body's centre of mass at the poses before a step, for a Trace; none at rest, without poses after.

    For the other arguments see :func:`body_rates`.
    """
    out: dict[str, float] = {}
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that diverges; its trace says so
        moved = {} if after is None else body_rates(m, branches, before, after, h, trailing)
        for name, pose in before.items():
            arm = m.body(name).point(MASS_CENTRE) * np.exp(1j * pose.angle)
            centre = moved.get(name, Turning()).carried(arm)
            out |= rate_columns(name, centre.velocity, centre.acceleration, centre.spin_up)
    return out


def body_rates(
    m: Mechanism,
    branches: Iterable[Branch],
    before: Mapping[str, Pose],
    after: Mapping[str, Pose],
    h: float,
    trailing: float,
) -> dict[str, Turning]:
    """Rates of every moving body's origin at the poses before a step of h (s), from those after it too.

    ``branches`` are parents first.  A coordinate's rate changes evenly in the step; the velocities of the poses before
    are ``trailing`` (s) older than the poses.
    """
    found = {GROUND: Turning()}
    for branch in branches:
        (_, old), (_, new) = coordinates(m, branch, before), coordinates(m, branch, after)
        change = (np.array(new) - np.array(old)) / h
        found[branch.child] = _carried(m, branch, before, found[branch.parent], old + trailing * change, change)
    return {name: found[name] for name in before}


def turning(
    m: Mechanism, branches: Iterable[Branch], at: Mapping[str, Pose], rates: Mapping[str, np.ndarray]
) -> dict[str, Turning]:
    """Rates of every moving body's origin at poses, by the rates of the coordinates, which do not change.

    ``branches`` are parents first.
    """
    found = {GROUND: Turning()}
    for branch in branches:
        rate = rates[branch.child]
        found[branch.child] = _carried(m, branch, at, found[branch.parent], rate, np.zeros_like(rate))
    return found


def _carried(
    m: Mechanism, branch: Branch, at: Mapping[str, Pose], parent: Turning, rate: np.ndarray, change: np.ndarray
) -> Turning:
    """A body's rates, from its parent's and those of its own coordinates."""
    if branch.joint is None and branch.parent != GROUND:
        return _adrift(branch, at, parent, rate, change)
    if branch.joint is None:
        return Turning(complex(rate[0], rate[1]), complex(change[0], change[1]), float(rate[2]), float(change[2]))
    name, here, base = branch.joint.name, at[branch.child], at.get(branch.parent, AT_REST)
    pin = here.origin + m.body(branch.child).point(name) * np.exp(1j * here.angle)
    on = parent.carried(pin - base.origin)  # the pin, as a point of the parent
    v, a = float(rate[0]), float(change[0])
    if branch.joint.prismatic:
        along = branch.axis * np.exp(1j * here.angle)
        on = Turning(on.velocity + v * along, on.acceleration + (a + 2j * on.spin * v) * along, on.spin, on.spin_up)
    else:
        on = Turning(on.velocity, on.acceleration, on.spin + v, on.spin_up + a)
    return on.carried(here.origin - pin)


def _adrift(branch: Branch, at: Mapping[str, Pose], parent: Turning, rate: np.ndarray, change: np.ndarray) -> Turning:
    """The same of a body that floats in the frame of another."""
    base = at[branch.parent]
    on, turned = parent.carried(at[branch.child].origin - base.origin), np.exp(1j * base.angle)
    slip, bend = complex(rate[0], rate[1]) * turned, complex(change[0], change[1]) * turned
    return Turning(
        on.velocity + slip,
        on.acceleration + bend + 2j * on.spin * slip,
        on.spin + float(rate[2]),
        on.spin_up + float(change[2]),
    )
