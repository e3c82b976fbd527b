"""Coulomb friction at the corners of blocks with clearance: reactions and friction that depend on each other.

See :mod:`analytic.paper.guide` for where friction acts.  The force f along a guide is -s mu sum(P), s the sign of the
block's sliding and P the pushes of its corners.  These follow from the guide's force N across and moment M, which
answer linearly to every f: so f solves linear equations, for as long as each block stays on the same corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.kinematics.motion import Motion
from analytic.paper.guide import FLAT, TILTED, Block
from analytic.paper.kinetostatics import Reactions, kinetostatics, of_springs

PASSES = 8  # of which corners these are, where nobody says


def rubbed(motion: Motion, inertia: bool, blocks: Sequence[Block], how: np.ndarray | None = None) -> Reactions:
    """The reactions of a motion (:func:`kinetostatics`) with the friction of those blocks that have some, which rest
    ``how`` (blocks,); left out, as these reactions ask them to.

    Raises AssemblyError where friction locks the linkage, or where joints have other friction that grows with
    reactions.
    """
    found = kinetostatics(motion, inertia)
    rough = [k for k, block in enumerate(blocks) if block.joint.friction]
    if not rough:
        return found
    some = [blocks[k] for k in rough]
    _check_alone(motion, some)
    units = [of_springs(motion, {block.joint.name: np.ones(motion.theta.size)}, ()) for block in some]
    total = found
    for _ in range(1 if how is not None else PASSES):
        given = [block.rests(total) if how is None else how[k] for k, block in zip(rough, some, strict=True)]
        ways = [np.broadcast_to(way, motion.theta.shape) for way in given]
        total = _added(found, units, _along(motion, some, ways, how is not None, found, units))
    return total


def _check_alone(motion: Motion, rough: Sequence[Block]) -> None:
    m = motion.structure.mechanism
    if m.load_rubbed:
        raise AssemblyError(
            f"{m.name}: friction_radius of joint {m.load_rubbed[0].name!r} and friction of the block of"
            f" {rough[0].joint.name!r} both grow with reactions, and the analytic model knows one of them at a time",
            remedy="leave one of them out",
        )


def _along(
    motion: Motion,
    rough: Sequence[Block],
    ways: Sequence[np.ndarray],
    finite: bool,
    found: Reactions,
    units: Sequence[Reactions],
) -> np.ndarray:
    """Force (blocks, N) N of friction along the guides of blocks that rest in these ``ways`` (N,), with the levers of a
    ``finite`` clearance or to first order.  Raises AssemblyError.
    """
    size = len(rough)
    slope, given = np.zeros((motion.theta.size, size, size)), np.zeros((motion.theta.size, size))
    for i, (block, way) in enumerate(zip(rough, ways, strict=True)):
        given[:, i] = block.rub(motion) * _pressed(block, way, finite, found)
        for j, unit in enumerate(units):
            slope[:, i, j] = block.rub(motion) * _pressed(block, way, finite, replace(unit, motion=motion))
    slope += np.eye(size)
    with np.errstate(all="ignore"):
        locked = ~(np.linalg.det(slope) > 0) & np.isfinite(given).all(axis=1)
    if locked.any():
        at, names = float(motion.theta[locked][0]), " or ".join(repr(block.joint.name) for block in rough)
        raise AssemblyError(
            f"{motion.structure.mechanism.name}: the friction at its block's corners locks the linkage at crank angle"
            f" {np.degrees(at):.6g} deg",
            at,
            f"make friction of joint {names} smaller, or keep clear of that angle",
        )
    return -np.linalg.solve(slope, given[..., None])[..., 0].T


def _pressed(block: Block, way: np.ndarray, finite: bool, found: Reactions) -> np.ndarray:
    """Sum (N,) N of the pushes of the corners on which a block rests, under these reactions: a linear function."""
    sign, flat = np.copysign(1.0, way), np.abs(way) == FLAT
    lever = block.lever if finite else block.length / 2
    pushes = [block.pushed(found, block.aside(each) if finite else None) for each in (FLAT, TILTED)]
    return np.asarray(sign * np.where(flat, pushes[0].real, pushes[1].imag * block.length / 2 / lever))


def _added(found: Reactions, units: Sequence[Reactions], force: np.ndarray) -> Reactions:
    """Reactions with those to forces (blocks, N) N along guides, from theirs to a unit of each."""

    def total(given: np.ndarray, parts: Sequence[np.ndarray]) -> np.ndarray:
        return np.asarray(given + sum(f * part for f, part in zip(force, parts, strict=True)))

    return replace(
        found,
        forces={name: total(each, [u.forces[name] for u in units]) for name, each in found.forces.items()},
        moments={name: total(each, [u.moments[name] for u in units]) for name, each in found.moments.items()},
        drive_torque=total(found.drive_torque, [u.drive_torque for u in units]),
        drive_loads={
            name: total(each, [u.drive_loads[name] for u in units]) for name, each in found.drive_loads.items()
        },
        efforts=total(found.efforts, [u.efforts for u in units]),
    )
