"""How short the steps of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld` must be, and the inertia that its pins
and its motor feel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from analytic.mechanism import Joint
from sim_models.common.start import poses
from sim_models.leapfrog.bodies import PROBE, LeapfrogWorld
from sim_models.leapfrog.courses import duration

STEP_ANGLE = 2e-4  # rad of crank angle in a step, at most
FREE_STEP = 2e-5  # s
DRIVE_PHASE = 0.2  # rad of the crank's oscillation on its motor in a step, at most
CONTACT_PHASE = 0.3  # rad of a contact's own oscillation in a step, at most
SWING_PHASE = 0.2  # rad of a pin's swing along its bearing in a step, at most
CONTACT_DECAY = 0.6  # of a contact's own relaxation in a step, at most


def longest_step(world: LeapfrogWorld, theta: float, peaks: Mapping[str, float]) -> float:
    """Step (s) that follows the crank and every pin: its swing about the bearing, and its spring's oscillation.

    ``theta`` (rad) is the crank angle at which the pins' effective masses are taken, ``peaks`` their largest forces
    (N).
    """
    step = FREE_STEP if world.motor is None else duration(world.motor, STEP_ANGLE)
    if world.drive_stiffness:
        step = min(step, DRIVE_PHASE * math.sqrt(drive_inertia(world, theta) / world.drive_stiffness))
    for name, pin in world.pins.items():
        mass = pin_mass(world, pin.joint, theta)
        step = min(step, SWING_PHASE * math.sqrt(mass * pin.clearance / max(peaks[name], 1e-300)))
        if world.compliant:
            step = min(
                step,
                CONTACT_PHASE * math.sqrt(mass / pin.contact.stiffness),
                CONTACT_DECAY * mass / max(pin.contact.damping, 1e-300),
            )
    return step


def pin_mass(world: LeapfrogWorld, joint: Joint, theta: float) -> float:
    """Least effective mass (kg) that a joint's gap opposes to a force, at crank angle theta (rad)."""
    bodies = poses(world.assembly, theta)
    changes = []
    for force in [0j, *np.exp(1j * np.linspace(0, np.pi, 8, endpoint=False))]:
        world.place(bodies)
        world.pull(joint, complex(force))
        world.advance(PROBE)
        changes.append(world.gap(joint.name)[1])
    return PROBE / float(np.abs(np.array(changes[1:]) - changes[0]).max())


def drive_inertia(world: LeapfrogWorld, theta: float) -> float:
    """Moment of inertia (kg.m^2) that the linkage opposes to its motor, at crank angle theta (rad)."""
    spins = []
    world.hold(False)
    for torque in (0.0, 1.0):
        world.place(poses(world.assembly, theta))
        world.turn(world.mechanism.driven, torque)
        world.advance(PROBE)
        spins.append(world.pose(world.mechanism.driven).angular_velocity)
    world.hold(True)
    return PROBE / (spins[1] - spins[0])
