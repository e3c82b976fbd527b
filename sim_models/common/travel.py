"""How far, and how fast, the second body of a joint has moved against its first in what the joint leaves free."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from analytic.kinematics.structure import Structure
from analytic.mechanism import Body, Joint, Mechanism
from analytic.mechanism.signals import position
from sim_models.common.start import Pose
from sim_models.engine import Trace


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


def told_by(m: Mechanism, s: Structure) -> str:
    """The signal that a run is told by: the crank's angle, or without a crank the position of the first input."""
    return position(m.joint(s.coordinates[s.inputs[0]].joint)).name if m.several else m.encoder.name


def with_positions(m: Mechanism, trace: Trace) -> Trace:
    """A trace with the position of each joint beside its bodies' places, where it has those of both."""
    found = {position(j).name: where for j in m.joints if (where := position_of(m, j, trace.signals)) is not None}
    return replace(trace, signals={**trace.signals, **found})


def position_of(m: Mechanism, joint: Joint, signals: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """A joint's position (N,) rad or m from its bodies' signals; None where one is missing."""
    angles, places = [], []
    for name in joint.bodies:
        body = m.body(name)
        if not isinstance(body, Body):
            angles.append(np.zeros(1))
            places.append(np.array([body.point(joint.name)]))
            continue
        if any(f"{name}_{part}" not in signals for part in ("angle", "x", "y")):
            return None
        angles.append(signals[f"{name}_angle"])
        arm = (body.point(joint.name) - body.point("com")) * np.exp(1j * angles[-1])
        places.append(signals[f"{name}_x"] + 1j * signals[f"{name}_y"] + arm)
    if not joint.prismatic:
        return np.asarray(angles[1] - angles[0])
    return slide_travel(joint, places[1] - places[0], angles[0])
