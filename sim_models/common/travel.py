"""How far, and how fast, the second body of a joint has moved against its first in what the joint leaves free."""

from __future__ import annotations

import numpy as np

from analytic.mechanism import Joint, Mechanism
from sim_models.common.start import Pose


def slide_travel(joint: Joint, apart: np.ndarray | complex, angle: np.ndarray | float) -> np.ndarray:
    """Travel (m) of a prismatic joint: its second body's point less its first's, ``apart`` (m, x + iy), along the axis.

    ``angle`` (rad) is the first body's; shapes broadcast.
    """
    return np.real(apart * np.conj(joint.direction * np.exp(1j * angle)))


def travel(m: Mechanism, joint: Joint, first: Pose, second: Pose) -> tuple[float, float]:
    """Angle (rad) of a joint's second body less its first's and its rate; of a prismatic joint, its travel (m) and
    rate.
    """
    if not joint.prismatic:
        return second.angle - first.angle, second.angular_velocity - first.angular_velocity
    p, q = (
        m.body(body).point(joint.name) * np.exp(1j * pose.angle)
        for body, pose in zip(joint.bodies, (first, second), strict=True)
    )
    offset = second.origin + q - first.origin  # from the first body's origin to the second's point
    slip = second.velocity + 1j * second.angular_velocity * q - first.velocity - 1j * first.angular_velocity * offset
    return float(slide_travel(joint, offset - p, first.angle)), float(slide_travel(joint, slip, first.angle))
