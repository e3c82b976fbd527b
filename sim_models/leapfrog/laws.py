"""Friction, dampers and springs of the joints, which neither DART nor PyBullet has as the mechanism means them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from analytic.mechanism import GROUND, Joint, Mechanism
from sim_models.common.start import AT_REST, Pose
from sim_models.common.travel import travel

SLIDING_ZONE = 1e-3  # of the drive's speed: relative speed below which Coulomb friction fades out
FREE_SPEED = 1.0  # rad/s, in its place where nothing is driven


class JointLaws:
    """The laws of the ``joints`` that have one.

    In motion friction fades out where a joint is slower than ``fades_below`` (rad/s; prismatic: m/s), a part of the
    drive's ``top_speed`` (rad/s), at a ``reach`` (m) where it slides.  At rest (``static``) nothing is damped, and
    friction has the direction of ``sliding``.
    """

    def __init__(self, m: Mechanism, static: bool, top_speed: float, reach: float) -> None:
        self.mechanism, self.static = m, static
        self.joints = [j for j in m.joints if j.has_law]
        self.sliding: dict[str, float] = {}
        self.step = 0.0  # s, of the run
        zone = SLIDING_ZONE * (top_speed or FREE_SPEED)
        self.fades_below = {j.name: zone * (reach if j.prismatic else 1.0) for j in m.joints}

    def effort(self, j: Joint, position: float, rate: float, load: float = 0.0) -> float:
        """Torque (N.m; prismatic: force, N) on the joint's second body at its angle (rad; travel, m) and rate, pressed
        by a ``load`` (N).
        """
        slip = self.slip(j, rate)
        if self.static:
            return float(j.give(position, 0.0)) - (j.stiction + j.load_friction(load)) * slip
        return float(j.give(position, rate, self.step)) - (j.dry(rate) + j.load_friction(load)) * slip

    def slip(self, j: Joint, rate: float) -> float:
        """The sign of a joint's sliding at its rate (rad/s, m/s), or a part of it where friction fades."""
        return self.sliding.get(j.name, 0.0) if self.static else max(-1.0, min(1.0, rate / self.fades_below[j.name]))

    def set_sliding(self, motion: Callable[[], Mapping[str, Pose]]) -> None:
        """Let friction at rest oppose a motion of the ideal linkage, of which only the direction matters."""
        if not any(j.rubs for j in self.joints):
            return
        moving = {**motion(), GROUND: AT_REST}
        for j in self.joints:
            a, b = (moving[name] for name in j.bodies)
            self.sliding[j.name] = float(np.sign(round(travel(self.mechanism, j, a, b)[1], 9)))
