"""What one tiny step of an engine tells of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld`: forces,
accelerations, and the inertia that its pins and its motor feel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from analytic.mechanism import Joint
from sim_models.common.start import Pose
from sim_models.leapfrog.bodies import LeapfrogWorld

PROBE = 1e-5  # s, the step


def forces_at(
    world: LeapfrogWorld, bodies: Mapping[str, Pose], spin_up: Sequence[float]
) -> tuple[dict[str, complex], dict[str, float], dict[str, float]]:
    """Reactions (N), moments of slides (N.m), and what the motor in each driven joint exerts (N.m, N), in these poses,
    with these velocities and accelerations (rad/s^2, m/s^2) of what is steered.
    """

    def probed() -> tuple[dict[str, complex], dict[str, float], dict[str, float]]:
        world.approach(bodies, PROBE, spin_up)
        world.before_observing()
        world.step(PROBE)
        return world.reactions()

    return world.settled(probed, lambda found: world.pressing(*found[:2]))


def gap_accelerations(world: LeapfrogWorld, bodies: Mapping[str, Pose], spin_up: Sequence[float]) -> dict[str, complex]:
    """Acceleration (m/s^2) of every pin's gap, and of every block's height and (times i, rad/s^2) tilt, from these
    poses, velocities and accelerations (rad/s^2, m/s^2) of what is steered.
    """
    world.approach(bodies, PROBE, spin_up)
    before = _rates(world)
    world.step(PROBE)
    return {name: (rate - before[name]) / PROBE for name, rate in _rates(world).items()}


def _rates(world: LeapfrogWorld) -> dict[str, complex]:
    """Rate of every pin's gap (m/s), and of every block's height (m/s) and i times its tilt (rad/s)."""
    pins = {name: world.gap(name)[1] for name in world.pins | world.soft}
    return pins | {
        name: block.rate(*(world.base(body) for body in block.joint.bodies)) for name, block in world.blocks.items()
    }


def pin_mass(world: LeapfrogWorld, joint: Joint, bodies: Mapping[str, Pose]) -> float:
    """Least effective mass (kg) that a joint's gap opposes to a force, in these poses."""
    changes = []
    for force in [0j, *np.exp(1j * np.linspace(0, np.pi, 8, endpoint=False))]:
        world.place(bodies)
        world.pull(joint, complex(force))
        world.advance(PROBE)
        changes.append(world.gap(joint.name)[1])
    return PROBE / float(np.abs(np.array(changes[1:]) - changes[0]).max())


def drive_inertia(world: LeapfrogWorld, bodies: Mapping[str, Pose]) -> float:
    """Moment of inertia (kg.m^2) that the linkage opposes to its motor, in these poses."""
    spins = []
    world.hold(False)
    for torque in (0.0, 1.0):
        world.place(bodies)
        world.turn(world.mechanism.driven, torque)
        world.advance(PROBE)
        spins.append(world.pose(world.mechanism.driven).angular_velocity)
    world.hold(True)
    return PROBE / (spins[1] - spins[0])
