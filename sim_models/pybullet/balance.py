"""Forces in the multibodies' own joints, which PyBullet does not report rightly: Newton and Euler for every body.

Each body's loads, weight, pins and children are known, and so are its accelerations: what is missing is its joint's.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE
from sim_models.leapfrog.parts import moving_body
from sim_models.leapfrog.rates import body_rates

if TYPE_CHECKING:
    from sim_models.pybullet.world import BulletWorld


class Balance:
    """The step that a world has just made, seen from the positions before it."""

    def __init__(self, world: BulletWorld) -> None:
        self.world = world
        self.poses = world.before
        self.force: dict[str, complex] = {}  # N on each body
        self.moment: dict[str, float] = {}  # N.m about its com
        for body in world.mechanism.bodies:
            applied, moment = world.was_applied.get(body.name, (0j, 0.0))
            self.force[body.name] = applied + body.mass * complex(*world.mechanism.gravity)
            self.moment[body.name] = moment

    def solve(self, pins: Mapping[str, complex]) -> tuple[dict[str, complex], dict[str, float], float]:
        """All joints' forces, prismatic joints' moments and the drive torque, given the pins' forces (N, on the second
        body).
        """
        m = self.world.mechanism
        forces = dict(pins)
        moments: dict[str, float] = {}
        torque = 0.0
        for name, force in pins.items():
            if name in self.world.ties or name in self.world.struts:  # a spring-damper's was applied
                first, second = m.joint(name).bodies
                self._load(second, self.place(second, name), force)
                self._load(first, self.place(first, name), -force)
        after = {body.name: self.world.pose(body.name) for body in m.bodies}
        motion = body_rates(self.world, self.poses, after, self.world.step_size)
        for branch in reversed(self.world.branches):
            child, joint = branch.child, branch.joint
            centre = motion[child].carried(self.place(child, MASS_CENTRE) - self.poses[child].origin)
            force = moving_body(m, child).mass * centre.acceleration - self.force[child]
            about_com = moving_body(m, child).moment_of_inertia * centre.spin_up - self.moment[child]
            if child == m.driven:
                torque = about_com - _cross(
                    self.place(child, m.drive_joint.name) - self.place(child, MASS_CENTRE), force
                )
            if joint is None:
                continue
            pin = self.place(joint.bodies[1], joint.name)
            moment = about_com - _cross(pin - self.place(child, MASS_CENTRE), force)
            forces[joint.name] = force if branch.forward else -force
            if joint.prismatic:
                moments[joint.name] = moment if branch.forward else -moment
            self._load(branch.parent, pin, -force, -moment)
        return forces, moments, torque

    def _load(self, body: str, at: complex, force: complex, moment: float = 0.0) -> None:
        if body != GROUND:
            self.force[body] += force
            self.moment[body] += moment + _cross(at - self.place(body, MASS_CENTRE), force)

    def place(self, body: str, point: str) -> complex:
        """Place (m) of a body's point."""
        at = self.world.points[body, point]
        return at if body == GROUND else self.poses[body].origin + at * np.exp(1j * self.poses[body].angle)


def _cross(a: complex, b: complex) -> float:
    return float(a.real * b.imag - a.imag * b.real)
