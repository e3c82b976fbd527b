"""Blocks with clearance in their guides: four corners, each against one wall, through MuJoCo's contact solver."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from sim_models.engine import Cause, SimulationError
from sim_models.mujoco.model import MujocoBlock, MujocoLinkage


@dataclass(frozen=True)
class Seat:
    """Where a block is in its guide: unit vector along it, its point (m, x + iy), its height across (m), its tilt
    (rad).
    """

    along: complex
    point: complex
    height: float
    tilt: float


def seat(link: MujocoLinkage, block: MujocoBlock) -> Seat:
    """Where a block is, as the data's positions have it."""
    first, second = block.joint.bodies
    x, q = link.data.site_xpos, link.data.qpos
    guide, point = (complex(*x[site, :2]) for site in link.sites[block.joint.name])
    angles = [link.fixed_angle[body] + float(link.form[body] @ q) for body in (first, second)]
    along = block.joint.direction * complex(np.exp(1j * angles[0]))
    return Seat(along, point, ((point - guide) * along.conjugate()).imag, angles[1] - angles[0] - block.joint.angle)


def played(link: MujocoLinkage) -> dict[str, float]:
    """Signals of where blocks are in their guides."""
    out: dict[str, float] = {}
    for name, block in link.blocks.items():
        here = seat(link, block)
        gap = -here.height * 1j * here.along
        out[f"clearance_{name}_x"], out[f"clearance_{name}_y"] = gap.real, gap.imag
        out[f"clearance_{name}_angle"] = -here.tilt
    return out


def touch_walls(link: MujocoLinkage, always: bool = False) -> None:
    """Add the contact of each corner that has come to its wall, or of those that count as pressed."""
    for block in link.blocks.values():
        here = seat(link, block)
        turned, guide = complex(np.exp(1j * here.tilt)), block.guide
        for k, (side, corner) in enumerate(zip(guide.sides, guide.corners, strict=True)):
            arm = corner * turned
            room = guide.height / 2 + guide.clearance - side * (here.height + arm.imag)
            link.depth[block.key(k)] = -room
            if k not in block.pressed if always else room >= block.law.margin:
                continue
            con, at, out = block.contacts[k], here.point + here.along * arm, side * 1j * here.along
            con.dist, con.pos = room, (at.real, at.imag, 0.0)
            con.frame = (out.real, out.imag, 0.0, -out.imag, out.real, 0.0, 0.0, 0.0, 1.0)
            if mujoco.mj_addContact(link.model, link.data, con):
                raise SimulationError(
                    f"mujoco: no room for the contact of joint {block.joint.name!r}",
                    Cause.FAULTY,
                    "use fewer joints with clearance",
                )
            link.touching.append(block.key(k))


def ease(link: MujocoLinkage, block: MujocoBlock) -> float:
    """Largest acceleration (1/kg) of a corner against its wall by a unit force between them, as bodies now are."""
    m, d, here = link.model, link.data, seat(link, block)
    found = []
    for corner in block.guide.corners:
        at = here.point + here.along * corner * complex(np.exp(1j * here.tilt))
        sides = np.zeros((2, 3, m.nv))
        for jacobian, body in zip(sides, block.joint.bodies, strict=True):
            mujoco.mj_jac(m, d, jacobian, None, np.array([at.real, at.imag, 0.0]), link.body_id.get(body, 0))
        across = (sides[1] - sides[0])[:2]
        row = (-here.along.imag * across[0] + here.along.real * across[1])[None]
        eased = np.zeros_like(row)
        mujoco.mj_solveM(m, d, eased, row)
        found.append(float(row[0] @ eased[0]))
    return max(found)
