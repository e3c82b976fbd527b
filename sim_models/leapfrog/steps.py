"""How short the steps of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld` must be."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sim_models.common.fading import fading_step
from sim_models.common.mobility import corner_mass, stop_step
from sim_models.leapfrog.block import LeapfrogBlock
from sim_models.leapfrog.bodies import LeapfrogWorld
from sim_models.leapfrog.parts import Pin
from sim_models.leapfrog.poses import duration
from sim_models.leapfrog.probe import drive_inertia, pin_mass
from sim_models.run.path import Path

STEP_ANGLE = 2e-4  # rad of crank angle in a step, at most
FREE_STEP = 2e-5  # s, of a crank that is let go
FREE_STEP_MADE_UP = 5e-5  # s, of what moves freely where the inertia forces' error of first order is made up for
DRIVE_PHASE = 0.2  # rad of the crank's oscillation on its motor in a step, at most
CONTACT_PHASE = 0.3  # rad of a contact's own oscillation in a step, at most
SWING_PHASE = 0.2  # rad of a pin's swing along its bearing in a step, at most
# The same of laws by name, whose restitution is then within 0.006 of what they deliver.
NAMED_PHASE, NAMED_DECAY = 0.2, 0.4
CONTACT_DECAY = 0.6  # of a contact's own relaxation in a step, at most


def contact_step(pin: Pin | LeapfrogBlock, mass: float) -> float:
    """Step (s) that follows a pin, or a corner, of this effective mass (kg) in its spring.  A law with hysteresis is as
    much stiffer as it pushes harder at the speed of touching.
    """
    law = pin.law
    if law is not None:
        harder = mass / (law.stiffness * (1 + law.hysteresis))
        return min(NAMED_PHASE * math.sqrt(harder), NAMED_DECAY * mass / max(law.damping, 1e-300))
    return min(
        CONTACT_PHASE * math.sqrt(mass / pin.contact.stiffness),
        CONTACT_DECAY * mass / max(pin.contact.damping, 1e-300),
    )


def longest_step(world: LeapfrogWorld, path: Path, peaks: Mapping[str, float]) -> float:
    """Step (s) that follows what motors move and every pin: its swing about the bearing, and its spring's oscillation.

    The pins' effective masses are taken where the ``path`` begins; ``peaks`` are their largest forces (N).
    """
    step = duration(path, STEP_ANGLE)
    if world.free:
        step = min(step, FREE_STEP_MADE_UP)
    elif not path.held:
        step = FREE_STEP
    if world.flanks is not None:
        step = min(step, DRIVE_PHASE * world.flanks.quickest)
    elif world.drive_stiffness:
        step = min(step, DRIVE_PHASE * math.sqrt(drive_inertia(world, path.poses(path.begin)) / world.drive_stiffness))
    if not path.held:
        step = min(step, stop_step(world.mechanism), fading_step(world.mechanism))
    bodies = path.poses(path.begin) if world.loose or world.soft else {}
    for name, pin in world.pins.items():
        mass = pin_mass(world, pin.joint, bodies)
        step = min(step, SWING_PHASE * math.sqrt(mass * pin.clearance / max(peaks[name], 1e-300)))
        if world.compliant:
            step = min(step, contact_step(pin, mass))
    for block in world.blocks.values():
        mass = corner_mass(world.mechanism, bodies, block.joint, world.closed, world.holding)
        step = min(step, contact_step(block, mass))
    for pin in world.soft.values():
        mass, law = pin_mass(world, pin.joint, bodies), pin.contact
        step = min(step, CONTACT_PHASE * math.sqrt(mass / law.stiffness), CONTACT_DECAY * mass / law.damping)
    return step
