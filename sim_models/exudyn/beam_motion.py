"""How the rigid linkage moves, for the loads that beams bear and what is read beside them: from the assembly's poses
alone.

Rates and accelerations are differences over five poses, a crank's as those of :mod:`sim_models.run.path`, so
that beams owe nothing to the analytic kinematics and kinetostatics that they are compared with.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Joint
from sim_models.common.travel import slide_travel
from sim_models.exudyn.linkage import Inertia
from sim_models.run.path import Path

# rad from one crank angle to the next (of several drives, of the fastest): a second derivative's rounding and the
# cut-off fifth order weigh about the same
POSE_SPACING = 2e-3
FIRST_DERIVATIVE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12 * POSE_SPACING)
SECOND_DERIVATIVE = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12 * POSE_SPACING**2)
POSES_ASIDE = POSE_SPACING * np.arange(-2.0, 3.0)
JOINT_STANDSTILL = (
    1e-9  # of the crank's rate (of a slide: times the longest link): the rate of a joint that does not move
)

Placed = Mapping[str, tuple[np.ndarray, np.ndarray]]  # origin (N,) m, complex, and angle (N,) rad by body


class RigidMotion:
    """The ideal rigid linkage at N instants, with a ``rate`` and ``acceleration`` of what its poses are told by.

    ``around`` are the origin (N,) m, complex, and angle (N,) rad of every moving body at five places in a row,
    POSE_SPACING apart, the instants in their middle.  Arrays are (N,), vectors complex in the ground frame.
    """

    def __init__(
        self, path: Path, at: np.ndarray, rate: np.ndarray | float = 0.0, acceleration: np.ndarray | float = 0.0
    ) -> None:
        """At places (N,) on a path: crank angles with the crank's rate (rad/s) and acceleration (rad/s^2), or times
        whose rate is that of the fastest drive.  Raises AssemblyError where it cannot be assembled; if it moves, two
        POSE_SPACING around, too.
        """
        moves = bool(np.any(rate) or np.any(acceleration))
        around = [path.placed(at, beside=float(aside) * moves) for aside in POSES_ASIDE]
        self.m = path.assembly.mechanism
        names = [body.name for body in self.m.bodies]
        still = np.zeros((len(around), at.size))
        self._rate, self._acceleration = (np.broadcast_to(np.asarray(x, float), at.shape) for x in (rate, acceleration))
        self._origin = {name: np.array([placed[name][0] for placed in around]) for name in names} | {GROUND: still}
        self._angle = {name: np.array([placed[name][1] for placed in around]) for name in names} | {GROUND: still}

    def place(self, body: str, point: str) -> np.ndarray:
        """Position (m) of a body's point."""
        return self._place(body, point)[2]

    def angle(self, body: str) -> np.ndarray:
        """Angle (rad) of a body or the ground, continued from the assembly angle."""
        return self._angle[body][2]

    def angular_velocity(self, body: str) -> np.ndarray:
        """Angular velocity (rad/s) of a body."""
        return self._in_time(self._angle[body])[0]

    def inertia(self, k: int) -> Inertia:
        """Accelerations of the bodies at one instant."""
        return Inertia.of(self._linear, self._turning, k)

    def law(self, joint: Joint, moving: bool) -> np.ndarray:
        """Torque (N.m; prismatic: force along the slide, N) on a joint's second body of its spring, friction and, if
        ``moving``, damper.
        """
        travel = self._travel(joint)
        rate = self._in_time(travel)[0]
        longest = max(body.length for body in self.m.bodies) if joint.prismatic else 1.0
        rate = np.where(np.abs(rate) < JOINT_STANDSTILL * longest * np.abs(self._rate), 0.0, rate)
        slip = rate if moving else np.zeros_like(rate)
        return joint.spring(travel[2]) + joint.damper(slip) - joint.dry(slip) * np.sign(rate)

    def position(self, joint: Joint) -> np.ndarray:
        """Where a joint is: angle (rad) of its second body less its first's, or travel (m) of a slide."""
        return np.asarray(self._travel(joint)[2])

    @cached_property
    def _linear(self) -> dict[str, np.ndarray]:
        return {b.name: self._in_time(self._place(b.name, MASS_CENTRE))[1] for b in self.m.bodies}

    @cached_property
    def _turning(self) -> dict[str, np.ndarray]:
        return {b.name: self._in_time(self._angle[b.name])[1] for b in self.m.bodies}

    def _place(self, body: str, point: str) -> np.ndarray:
        """(5, N) places (m) of a point."""
        return np.asarray(self._origin[body] + self.m.parts[body].point(point) * np.exp(1j * self._angle[body]))

    def _travel(self, joint: Joint) -> np.ndarray:
        """(5, N) relative angles (rad), or travels (m) of a slide."""
        first, second = joint.bodies
        if not joint.prismatic:
            return self._angle[second] - self._angle[first]
        apart = self._place(second, joint.name) - self._place(first, joint.name)
        return slide_travel(joint, apart, self._angle[first])

    def _in_time(self, around: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First and second derivative (N,) by time of what is (5, N) around the crank angles."""
        first, second = FIRST_DERIVATIVE @ around, SECOND_DERIVATIVE @ around
        return first * self._rate, second * self._rate**2 + first * self._acceleration
