"""What one unknown can be at every sample, and how it is solved for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

import numpy as np

from analytic.kinematics.schedule import Turning
from analytic.mechanism import GROUND, Load, Mechanism
from compare.diagnose.effects.bodies import LinkLength, body_of, end_of
from compare.diagnose.effects.effect import Effect, Parameter, Rig, Values
from compare.diagnose.effects.joints import JointClearance
from compare.diagnose.propose.laws import UNKNOWNS
from compare.diagnose.residuals import Data
from compare.results.diagnosis import Unknown

SOFT = 1e-6  # of a typical stiffness: a spring this soft, wound up far, is a constant torque
FAINT = 1e-6  # of the largest answer of a run: samples that answer less say nothing


class Torque(Effect):
    """A torque (N.m; prismatic: force, N) in a joint on its second body, and back on its first."""

    name = "unknown_torque"
    place = "joint"
    parameters = (Parameter("torque", "N.m", "torque"),)

    def places(self, rig: Rig) -> Sequence[str]:
        return [j.name for j in rig.mechanism.joints]

    def unit(self, rig: Rig, where: str, parameter: str) -> str:
        return "N" if rig.mechanism.joint(where).prismatic else "N.m"

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-3 * (rig.force if rig.mechanism.joint(where).prismatic else rig.torque),)

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        joint, torque = mechanism.joint(where), values["torque"]
        if joint.prismatic:
            stiffness = joint.stiffness or SOFT
            return mechanism.with_joint(where, stiffness=stiffness, rest_angle=joint.rest_angle + torque / stiffness)
        first, second = joint.bodies
        pair = tuple(Load(body=b, torque=t) for b, t in ((first, -torque), (second, torque)) if b != GROUND)
        return mechanism.replace(loads=(*mechanism.loads, *pair))


class Bend(LinkLength):
    """A link whose last point lies beside its axis (m)."""

    name = "unknown_bend"

    def on_mechanism(self, mechanism: Mechanism, where: str, values: Values) -> Mechanism:
        body = body_of(mechanism, where)
        last = end_of(mechanism, body)
        x, y = body.points[last]
        straight = super().on_mechanism(mechanism, where, {"length_error": 0.0})
        return straight.with_body(where, points={**body.points, last: (x, y + values["length_error"])})


class Lag(Effect):
    """A crank that is behind its encoder (rad)."""

    name = "unknown_lag"
    place = "drive"
    parameters = (Parameter("lag", "rad", "angle"),)

    def places(self, rig: Rig) -> Sequence[str]:
        return ["drive"] if rig.turning else []

    def scales(self, rig: Rig, where: str, variant: float = 0.0) -> Sequence[float]:
        return (1e-5,)

    def behind(self, motor: Turning, values: Values) -> Turning | None:
        none = np.zeros_like(motor.theta)
        return Turning(none + values["lag"], none, none)


EFFECTS: Mapping[Unknown, Effect] = {
    "torque": Torque(),
    "give": JointClearance(),
    "length": LinkLength(),
    "bend": Bend(),
    "lag": Lag(),
}
RELATIVES: Mapping[Unknown, frozenset[str]] = {  # effects that are an unknown of this kind themselves
    **dict.fromkeys(get_args(Unknown), frozenset[str]()),
    "torque": frozenset(
        {
            "coulomb_friction",
            "stribeck_friction",
            "load_friction",
            "viscous_friction",
            "drag",
            "joint_spring",
            "nonlinear_spring",
        }
    ),
    "give": frozenset({"joint_clearance", "joint_compliance"}),
}


@dataclass(frozen=True)
class Place:
    """One unknown at one place: its ``size`` is a small amount of it (SI), ``answers`` (size,) how the residual's
    samples answer to one of it, over their noise.
    """

    unknown: Unknown
    where: str
    unit: str
    answers: np.ndarray

    @property
    def key(self) -> tuple[Unknown, str]:
        """What tells places apart."""
        return self.unknown, self.where

    @property
    def words(self) -> str:
        """The place as a noun."""
        return UNKNOWNS[self.unknown].format(self.where)


@dataclass(frozen=True)
class Recovered:
    """An unknown solved for at each sample of each run, one number (N,) a time, and its one sigma; NaN where no sensor
    answers.  ``chi2`` is what all of them leave, ``free`` how many samples' worth of freedom remain.
    """

    values: tuple[np.ndarray, ...]
    sigma: tuple[np.ndarray, ...]
    chi2: float
    free: int

    @property
    def noise(self) -> float:
        """chi^2 for each degree of freedom; one where the place is right."""
        return self.chi2 / self.free if self.free > 0 else 1.0


def recovered(data: Data, place: Place, residual: np.ndarray) -> Recovered:
    """The unknown at each sample that leaves the least of a residual (size,), measured less predicted over noise."""
    values, sigma, gained, used = [], [], 0.0, 0
    for r, run in enumerate(data.measured.runs):
        wanted, square = np.zeros(run.time.size), np.zeros(run.time.size)
        for part in data.parts:
            if part.run == r:
                wanted[part.used] += place.answers[part.place] * residual[part.place]
                square[part.used] += place.answers[part.place] ** 2
        seen = square > FAINT * max(float(square.max(initial=0.0)), 1e-300)
        safe = np.where(seen, square, 1.0)
        values.append(np.where(seen, wanted / safe, np.nan))
        sigma.append(np.where(seen, 1 / np.sqrt(safe), np.nan))
        gained += float(np.sum(wanted[seen] ** 2 / square[seen]))
        used += int(seen.sum())
    return Recovered(tuple(values), tuple(sigma), float(residual @ residual) - gained, data.size - used)
