"""One equilibrium of a linkage of beams in Exudyn, with the displacement of every named point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from sim_models.engine import Request
from sim_models.exudyn.beams import Beams
from sim_models.exudyn.settings import console_off


@dataclass(frozen=True)
class FlexibleLinkage:
    """A flexible linkage in static equilibrium at one crank angle.  Complex numbers are x + iy in the ground frame."""

    theta: float  # rad
    displacement: Mapping[tuple[str, str], complex]  # m, by body and point (com included), from the ideal rigid linkage
    force: Mapping[str, complex]  # N, by joint: of the first body on the second
    gap: Mapping[str, complex]  # m, by joint: first pin centre minus second


def flexible_static(
    mechanism: Mechanism,
    theta: float,
    joint_model: Literal["ideal", "contact"] = "ideal",
) -> FlexibleLinkage:
    """Equilibrium of a linkage of beams under its loads and weights, crank held at angle theta (rad).

    With ``contact`` every joint with clearance has it; with ``ideal`` clearances are ignored.  Raises what
    :func:`sim_models.exudyn.beams.flexible` does.
    """
    schedule = Schedule.at_angles(mechanism, np.array([theta]), at_rest=True)
    at_rest = Beams(Request(mechanism, joint_model, schedule))
    with console_off():
        model = at_rest.solved(0)
        named = [(b.name, point) for b in mechanism.bodies for point in (*b.points, "com")]
        moved = {
            (body, point): model.place(body, point) - at_rest.motion.place(body, point)[0] for body, point in named
        }
        force = {joint.name: model.force(joint) for joint in mechanism.joints}
        gap = {
            joint.name: model.place(joint.bodies[0], joint.name) - model.place(joint.bodies[1], joint.name)
            for joint in mechanism.joints
        }
    return FlexibleLinkage(theta, {key: complex(value) for key, value in moved.items()}, force, gap)
