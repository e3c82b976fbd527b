"""How far the joints of a MuJoCo run may come apart, and go into each other, before it is no result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sim_models.engine import SMALLER_STEP, Cause, Request, SimulationError
from sim_models.mujoco.laws import WallContact
from sim_models.mujoco.model import MujocoLinkage

DEEPEST_PENETRATION = (
    0.1  # of the clearance: penetration that is in order without asking; more must be what the stiffness allows
)
LOOSEST = 1e-5  # of the linkage's size, by which its rigid joints may come apart
# rad, by which that may turn any body: soft rows give by the square of the step, and poor transmission angles magnify
# it
MOST_TURNED = 2e-6
STRETCH = 1e-3  # of the clearance, by which a massless link may change its length
WHIRLS = (
    SMALLER_STEP,
    "use spring-damper or contact joints, as a massless link whirls where its load turns round",
    "give smaller loads or a slower drive",
)


def room_apart(request: Request, link: MujocoLinkage) -> float:
    """The distance (m) by which rigid joints may come apart."""
    links = link.contacts if request.joint_model == "massless-link" else ()
    return min([LOOSEST * link.size, *(STRETCH * request.mechanism.joint(name).clearance for name in links)])


def check_together(request: Request, distance: float, room: float, step: float) -> None:
    """Raise SimulationError (CAME_APART) where rigid joints have come apart by more than is in order."""
    if distance > room:
        raise SimulationError(
            f"mujoco: {request.mechanism.name}, {request.joint_model} joints: a rigid joint came apart by"
            f" {distance:.3g} m, {room:.3g} m is in order (step {step:.3g} s)",
            Cause.CAME_APART,
            WHIRLS if request.joint_model == "massless-link" else (),
        )


def check_closed(request: Request, turn: float, step: float) -> None:
    """Raise SimulationError (CAME_APART) where rigid joints have given so far that a body would have to turn by more
    than is in order (rad) to close them.
    """
    if turn > MOST_TURNED:
        raise SimulationError(
            f"mujoco: {request.mechanism.name}, {request.joint_model} joints: the rigid joints have given so far that a"
            f" body is {turn:.3g} rad off, {MOST_TURNED:.3g} rad is in order (step {step:.3g} s)",
            Cause.CAME_APART,
            (SMALLER_STEP, "give smaller loads or a slower drive"),
        )


def check_depth(
    request: Request,
    laws: Mapping[str, WallContact],
    gaps: Mapping[str, Sequence[complex]],
    forces: Mapping[str, Sequence[float]],
) -> None:
    """Raise SimulationError where a pin or a block's corner went deeper into its wall than its law lets it; from
    samples of gaps (m) and forces (N).
    """
    for name, law in laws.items() if request.joint_model != "massless-link" else ():
        joint = request.mechanism.joint(name)
        clearance = joint.clearance
        deepest = float(np.abs(gaps[name]).max()) - clearance
        allowed = max(DEEPEST_PENETRATION * clearance, 3 * max(forces[name]) / law.stiffness)
        if deepest > allowed:
            raise SimulationError(
                f"mujoco: {request.mechanism.name}, {request.joint_model} joints: the {joint.inner} of joint"
                f" {name!r} is {deepest:.3g} m deep in its {joint.outer}, {allowed:.3g} m is in order (clearance"
                f" {clearance:g} m, stiffness {law.stiffness:g} N/m)",
                Cause.TOO_DEEP,
            )
