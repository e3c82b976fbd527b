"""How the bodies of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld` move as a step starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from analytic.mechanism import MASS_CENTRE, Mechanism
from sim_models.common.rates import rate_columns
from sim_models.common.start import Pose
from sim_models.common.tree import Branch
from sim_models.leapfrog.parts import BranchMotion, coordinates
from sim_models.run.track import Track


def centre_rates(m: Mechanism, tracks: Mapping[str, Track]) -> dict[str, float]:
    """Rates of every body's centre of mass, for a Trace."""
    out: dict[str, float] = {}
    for name, body in m.moving.items():
        _, velocity, acceleration = tracks[name].at(body.point(MASS_CENTRE))
        out |= rate_columns(name, velocity, acceleration, tracks[name].spin_up)
    return out


def motions_between(
    m: Mechanism,
    branches: Iterable[Branch],
    before: Mapping[str, Pose],
    after: Mapping[str, Pose],
    h: float,
    trailing: float,
) -> dict[str, BranchMotion]:
    """Motions of branches at the poses before a step of h (s), from those after it too.

    A coordinate's rate changes evenly in the step; the velocities of the poses before are ``trailing`` (s) older than
    the poses.
    """
    motions: dict[str, BranchMotion] = {}
    for branch in branches:
        (where, old), (_, new) = coordinates(m, branch, before), coordinates(m, branch, after)
        changes = (np.array(new) - old) / h
        motions[branch.child] = where, old + trailing * changes, changes
    return motions
