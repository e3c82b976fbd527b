"""Forces in the joints of a tree by Newton and Euler for every body, where an engine does not report them rightly.

Each body's loads, weight, pins and children are known, and so are its accelerations: what is missing is its joint's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Mechanism
from sim_models.common.start import Pose
from sim_models.common.track import Track
from sim_models.common.tree import Branch
from sim_models.leapfrog.parts import Steered, moving_body


class ForceBalance:
    """A step that was just made, seen from the ``poses`` before it."""

    def __init__(
        self, mechanism: Mechanism, poses: Mapping[str, Pose], applied: Mapping[str, tuple[complex, float]]
    ) -> None:
        """``applied`` is the force (N) and the moment (N.m, about the com) that was put on each body in the step."""
        self.mechanism, self.poses = mechanism, poses
        self.force: dict[str, complex] = {}  # N on each body
        self.moment: dict[str, float] = {}  # N.m about its com
        for body in mechanism.bodies:
            force, moment = applied.get(body.name, (0j, 0.0))
            self.force[body.name] = force + body.mass * complex(*mechanism.gravity)
            self.moment[body.name] = moment

    def solve(
        self,
        branches: Sequence[Branch],
        motion: Mapping[str, Track],
        pins: Mapping[str, complex],
        tied: Set[str],
        steered: Sequence[Steered],
    ) -> tuple[dict[str, complex], dict[str, float], dict[str, float]]:
        """All joints' forces, prismatic joints' moments, and what the motors exert in the joints by which they steer.

        ``branches`` are parents first, ``motion`` is of the bodies, ``pins`` the pins' forces (N, on the
        second body), of which those ``tied`` are not among what was applied.
        """
        m = self.mechanism
        forces = dict(pins)
        moments: dict[str, float] = {}
        efforts: dict[str, float] = {}
        moved = {each.child: each for each in steered}
        for name, force in pins.items():
            if name in tied:
                first, second = m.joint(name).bodies
                self._load(second, self.place(second, name), force)
                self._load(first, self.place(first, name), -force)
        for branch in reversed(branches):
            child, joint = branch.child, branch.joint
            body = moving_body(m, child)
            _, _, acceleration = motion[child].at(body.point(MASS_CENTRE))
            force = body.mass * acceleration - self.force[child]
            about_com = body.moment_of_inertia * motion[child].spin_up - self.moment[child]
            if child in moved:
                effort = efforts[moved[child].joint.name] = self._effort(branch, moved[child], force, about_com)
                if joint is None and branch.parent != GROUND:
                    self.moment[branch.parent] -= moved[child].sign * effort
            if joint is None:
                continue
            pin = self.place(joint.bodies[1], joint.name)
            moment = about_com - _cross(pin - self.place(child, MASS_CENTRE), force)
            forces[joint.name] = force if branch.is_second else -force
            if joint.prismatic:
                moments[joint.name] = moment if branch.is_second else -moment
            self._load(branch.parent, pin, -force, -moment)
        return forces, moments, efforts

    def _effort(self, branch: Branch, by: Steered, force: complex, about_com: float) -> float:
        """What a motor exerts in its joint (N.m, N), by all that the joint exerts on the body that it steers: a force
        (N), and a moment (N.m) about the centre of mass.
        """
        child = branch.child
        if by.joint.prismatic:
            along = branch.axis * np.exp(1j * self.poses[child].angle)
            return float((np.conj(along) * force).real)
        return by.sign * (about_com - _cross(self.place(child, by.joint.name) - self.place(child, MASS_CENTRE), force))

    def _load(self, body: str, at: complex, force: complex, moment: float = 0.0) -> None:
        if body != GROUND:
            self.force[body] += force
            self.moment[body] += moment + _cross(at - self.place(body, MASS_CENTRE), force)

    def place(self, body: str, point: str) -> complex:
        """Place (m) of a body's point."""
        at = self.mechanism.body(body).point(point)
        return at if body == GROUND else self.poses[body].origin + at * np.exp(1j * self.poses[body].angle)


def _cross(a: complex, b: complex) -> float:
    return float(a.real * b.imag - a.imag * b.real)
