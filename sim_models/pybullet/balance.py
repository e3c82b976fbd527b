"""Forces in the multibodies' own joints, which PyBullet does not report rightly: Newton and Euler for every body.

Each body's loads, weight, pins and children are known, and so are its accelerations: what is missing is its joint's.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE
from sim_models.planar.parts import AT_REST, Branch, moving_body

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
        """All joints' forces, prismatic joints' moments and the drive torque, given the pins' forces (N, on the second body)."""
        m = self.world.mechanism
        forces = dict(pins)
        moments: dict[str, float] = {}
        torque = 0.0
        for name, force in pins.items():
            if name in self.world.ties or name in self.world.struts:  # a spring-damper's was applied
                first, second = m.joint(name).bodies
                self._load(second, self.place(second, name), force)
                self._load(first, self.place(first, name), -force)
        motion = self.accelerations()
        for branch in reversed(self.world.branches):
            child, joint = branch.child, branch.joint
            acceleration, spin_up = motion[child]
            force = moving_body(m, child).mass * acceleration - self.force[child]
            about_com = moving_body(m, child).moment_of_inertia * spin_up - self.moment[child]
            if child == m.driven:
                torque = about_com - _cross(self.place(child, m.drive_joint.name) - self.place(child, MASS_CENTRE), force)
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

    def accelerations(self) -> dict[str, tuple[complex, float]]:
        """Acceleration of every com (m/s^2) and angular acceleration (rad/s^2)."""
        world = self.world
        change = (world.velocities() - world.velocities_before) / world.step_size
        rates = world.velocities_before + world.trailing * change
        found = {GROUND: (0j, 0.0, 0.0)}  # of the origin, and with the angular velocity
        for branch in world.branches:
            own = world.own[branch.child]
            found[branch.child] = self._carried(branch, change[own].tolist(), rates[own].tolist(), *found[branch.parent])
        return {
            body.name: (
                found[body.name][0] + self._swing(*found[body.name][1:]) * (self.place(body.name, MASS_CENTRE) - self.poses[body.name].origin),
                spin_up,
            )
            for body in world.mechanism.bodies
            for spin_up in [found[body.name][1]]
        }

    def _carried(self, branch: Branch, a: list[float], v: list[float], start: complex, spin_up: float, spin: float) -> tuple[complex, float, float]:
        """Acceleration of a body's origin, its angular acceleration and velocity, from its coordinates' and its parent's."""
        if branch.joint is None:
            return complex(a[0], a[1]), a[2], v[2]
        name = branch.joint.name
        base, here = self.poses.get(branch.parent, AT_REST), self.poses[branch.child]
        pin = self.place(branch.child, name)
        acceleration = start + self._swing(spin_up, spin) * (pin - base.origin)
        if branch.joint.prismatic:
            acceleration += (a[0] + 2j * spin * v[0]) * branch.axis * np.exp(1j * here.angle)
        else:
            spin_up, spin = spin_up + a[0], spin + v[0]
        return acceleration + self._swing(spin_up, spin) * (here.origin - pin), spin_up, spin

    @staticmethod
    def _swing(spin_up: float, spin: float) -> complex:
        return 1j * spin_up - spin**2


def _cross(a: complex, b: complex) -> float:
    return float(a.real * b.imag - a.imag * b.real)
