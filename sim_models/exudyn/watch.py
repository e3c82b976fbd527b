"""What is watched of a run: every step of its record, and how the walls push pins and the corners of blocks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from analytic.mechanism import GROUND, Joint
from sim_models.common.guide import Guide
from sim_models.engine import Watched
from sim_models.exudyn.block import ExudynBlock
from sim_models.exudyn.motor import RunMotor
from sim_models.run.record import Record


def watched(record: Record, loose: Iterable[Joint], motor: RunMotor, blocks: Mapping[str, ExudynBlock]) -> Watched:
    """A record with the forces of contact in these joints, on its crank's motor's own clock."""
    force, corners, rubbing = dict[str, np.ndarray](), dict[str, np.ndarray](), dict[str, np.ndarray]()
    for joint in loose:
        name, guide = joint.name, Guide.of(joint)
        force[name] = record.force[name]
        if guide is not None:
            across = 1j * record.axis(joint)
            pushed = np.real(force[name] * np.conj(across))
            unit = _rubbing(record, blocks[name]) if blocks[name].friction else None
            corners[name] = guide.shares(pushed, record.moment[name], record.height[name], record.tilt[name], unit)
            force[name] = guide.across(corners[name]) * across
            if unit is not None:
                rubbing[name] = unit * corners[name]
                force[name] = force[name] - 1j * across * rubbing[name].sum(axis=0)
    return Watched(
        time=record.time + motor.first - motor.begins,
        place=record.com,
        velocity=record.velocity,
        angle=record.angle,
        angular_velocity=record.angular_velocity,
        force=force,
        torque=record.drive_torque,
        corners=corners,
        rubbing=rubbing,
    )


def _rubbing(record: Record, block: ExudynBlock) -> np.ndarray:
    """Friction (4, M) on a block's corners along its guide, of a unit push of their walls."""
    moving = [body for body in block.joint.bodies if body != GROUND]
    parts = [((record.com[b], record.angle[b]), (record.velocity[b], record.angular_velocity[b])) for b in moving]
    q, rates = ([x for at, turn in each for x in (at.real, at.imag, turn)] for each in zip(*parts, strict=True))
    return block.rubbing(block.seen(np, q, rates))
