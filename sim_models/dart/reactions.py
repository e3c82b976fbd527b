"""Forces in the joints of a DART world, for the instant from which it made its last step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from analytic.mechanism import GROUND

if TYPE_CHECKING:
    from sim_models.dart.world import DartWorld


def reactions(world: DartWorld) -> tuple[dict[str, complex], dict[str, float], float]:
    """All joints' forces (N, on the second body), prismatic joints' moments and the drive torque (N.m)."""
    forces = dict(world.pin_forces) | closing_forces(world)
    moments: dict[str, float] = {}
    torque = 0.0
    for name, joint in ((branch.child, branch.joint) for branch in world.branches):
        wrench = -world.roots[name].getWrenchToChildBodyNode()  # on the child, in its frame, about its pin
        force, moment = complex(wrench[3], wrench[4]) * np.exp(1j * world.before[name].angle), float(wrench[2])
        if name == world.mechanism.driven:
            missing = _forgotten(world, forces)
            force, moment = force - missing[0], moment - missing[1]
            torque = moment
        if joint is None:
            continue
        if name == joint.bodies[0]:  # the second body takes the opposite, at its own point
            force = -force
            slip = _place(world, joint.bodies[1], joint.name) - _place(world, name, joint.name)
            moment = -moment - (np.conj(slip) * force).imag
        forces[joint.name] = force
        if joint.prismatic:
            moments[joint.name] = moment
    return forces, moments, torque if world.held else 0.0


def closing_forces(world: DartWorld) -> dict[str, complex]:
    """Forces of the pins that close loops, from the generalised forces that DART's constraints exerted."""
    if not world.closing:
        return {}
    generalised = np.concatenate([skeleton.getConstraintForces() for skeleton in world.skeletons])
    for name in world.bearings:
        force = world.pin_forces[name]
        generalised -= world.pin_jacobian(world.mechanism.joint(name), world.before).T @ [force.real, force.imag]
    rows = np.vstack([world.pin_jacobian(joint, world.before) for joint in world.closing])
    solved = np.linalg.lstsq(rows.T, generalised, rcond=None)[0]
    return {joint.name: complex(solved[2 * k], solved[2 * k + 1]) for k, joint in enumerate(world.closing)}


def _forgotten(world: DartWorld, forces: Mapping[str, complex]) -> tuple[complex, float]:
    """Force, and moment about its pin, of DART's constraints on a driven body that nothing hangs on.

    DART passes constraint forces on only in skeletons that have a freedom of their own.
    """
    driven, pivot = world.mechanism.driven, world.mechanism.drive_joint.name
    if not world.held or world.nodes[driven].getSkeleton().getNumDofs() > 1:
        return 0j, 0.0
    total, moment = 0j, 0.0
    for joint in world.mechanism.joints:
        if driven in joint.bodies and (joint in world.closing or joint.name in world.bearings):
            force = forces[joint.name] if joint.bodies[1] == driven else -forces[joint.name]
            total += force
            moment += (np.conj(_place(world, driven, joint.name) - _place(world, driven, pivot)) * force).imag
    return total, moment


def _place(world: DartWorld, body: str, point: str) -> complex:
    """Place (m) of a body's point before the step."""
    at = world.points[body, point]
    return at if body == GROUND else world.before[body].origin + at * np.exp(1j * world.before[body].angle)
