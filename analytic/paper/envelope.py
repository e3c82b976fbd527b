"""What small clearances do to an output of a linkage, to first order: sensitivity, nominal displacement, worst case,
spread.

Open a small gap g_i (first pin centre minus second) in each joint with the crank held.  By virtual work a unit load
along an output d does work R_i . g_i, with R_i the reaction that this load alone causes in joint i of the ideal
linkage, so

    displacement of the output = sum_i R_i . g_i.

All that follows is made of R_i; |R_i| is the output's sensitivity to joint i (m/m, or rad/m for an angle).  It is
found by the other half of the same duality, as the velocity of the output while the gap opens at unit rate. Arrays of R
are (joints, N) complex: its ground-frame components as x + iy, at N crank angles.

A block in its guide goes as a pin, with y + i (L/2) phi for its gap and N + i M/(L/2) for R
(:mod:`analytic.paper.guide`), but that its gap is bound by a square on its corner, not a circle: its sensitivity is the
larger component of R.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly, CrankTable
from analytic.kinematics.motion import Gap, Motion, kinematics
from analytic.kinematics.output import Output
from analytic.paper.guide import GuidedBlock
from analytic.paper.kinetostatics import Reactions, reactions_to

DIRECTIONS = np.exp(1j * np.linspace(0.0, np.pi, 91)[:-1])  # where the search for the farthest point starts
ASCENTS = 30  # towards the farthest point


def unit_reactions(
    assembly: Assembly,
    theta: np.ndarray,
    outputs: Iterable[Output],
    path: CrankTable | None = None,
    blocks: Iterable[GuidedBlock] = (),
) -> dict[Output, np.ndarray]:
    """R (joints, N) of every revolute joint, in the structure's order of pins, and then of these blocks, for each
    output at crank angles theta (N,) rad.

    In N/N for a point, in N/(N.m) for an angle.  Raises AssemblyError as :func:`analytic.kinematics.motion.kinematics`
    does.
    """
    closed = np.zeros(np.shape(theta), complex)
    opening = [
        [kinematics(assembly, theta, gaps={pin: Gap(closed, closed + d)}, path=path) for d in (1.0, 1j)]
        for pin in assembly.structure.pins
    ]
    by_output = {d: [d.rate(along_x) + 1j * d.rate(along_y) for along_x, along_y in opening] for d in outputs}
    every = tuple(blocks)
    if every:
        still = kinematics(assembly, theta, path=path)
        for d, rows in by_output.items():
            forces, moments, _ = reactions_to(still, d.body, *d.load)
            rows += [block.push(still, forces[block.joint.name], moments[block.joint.name]) for block in every]
    return {d: np.array(rows) for d, rows in by_output.items()}


def displacement(reactions: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    """Displacement (N,) of an output by gaps (joints, N) m: sum R . g."""
    return np.sum(reactions.real * gaps.real + reactions.imag * gaps.imag, axis=0)


def sizes(reactions: np.ndarray, blocks: int = 0) -> np.ndarray:
    """Sensitivities (joints, N): |R| of pins, of the last so many, which are blocks, the larger component."""
    pins, rest = np.split(reactions, [len(reactions) - blocks])
    return np.concatenate([np.abs(pins), np.maximum(np.abs(rest.real), np.abs(rest.imag))])


def worst_case(reactions: np.ndarray, clearances: np.ndarray, blocks: int = 0) -> np.ndarray:
    """Largest displacement (N,) of an output, to either side, that clearances (joints,) m allow: sum c |R|; the last
    ``blocks`` joints are blocks.
    """
    return clearances @ sizes(reactions, blocks)


def farthest(along_x: np.ndarray, along_y: np.ndarray, clearances: np.ndarray, blocks: int = 0) -> np.ndarray:
    """Farthest displacement (N,) complex of a point that clearances (joints,) allow; its opposite is as far.

    The displacements that are possible are the Minkowski sum of one ellipse a joint, whose farthest point along a
    direction is known.  Following that point's own direction can only lead farther out, so it climbs to a local
    maximum; starting all round finds the largest.
    """
    far_out = clearances[:, None, None]

    def support(direction: np.ndarray) -> np.ndarray:
        """The farthest point (starts, N) along each direction (starts, N)."""
        pull = along_x[:, None] * direction.real + along_y[:, None] * direction.imag  # R along the direction
        gaps = far_out * pull / np.maximum(np.abs(pull), np.finfo(float).tiny)
        if blocks:
            gaps[-blocks:] = far_out[-blocks:] * corner(pull[-blocks:])
        return displacement(along_x[:, None], gaps) + 1j * displacement(along_y[:, None], gaps)

    start = np.broadcast_to(DIRECTIONS[:, None], (DIRECTIONS.size, along_x.shape[1]))
    far = support(start)
    best = np.argmax(np.abs(far), axis=0)
    far = far[best, np.arange(best.size)][None]
    for _ in range(ASCENTS):
        far = support(far / np.maximum(np.abs(far), np.finfo(float).tiny))
    return far[0]


def corner(pull: np.ndarray) -> np.ndarray:
    """The corner of a block's square, as a unit of y + i (L/2) phi, that is farthest along a pull, any shape."""
    flat = np.abs(pull.real) >= np.abs(pull.imag)
    return np.asarray(np.where(flat, np.copysign(1.0, pull.real), 1j * np.copysign(1.0, pull.imag)))


def rim_spread(reactions: np.ndarray, mean_square: np.ndarray) -> np.ndarray:
    """Standard deviation (N,) of an output whose contacts are anywhere on the rim, of blocks in any corner:
    sigma^2 = 1/2 sum E[c^2] |R|^2.
    """
    return np.sqrt(0.5 * mean_square @ np.abs(reactions) ** 2)


def condition(motion: Motion) -> np.ndarray:
    """Condition number (N,) of the worst Assur group's loop Jacobian, each unknown scaled to unit effect.

    Of a dyad it is cot(mu/2), mu the acute angle between its two sides (three pins: the transmission angle).
    """
    worst = np.ones(motion.theta.size)
    for jacobian in motion.jacobians.values():
        matrix = np.concatenate([jacobian.real, jacobian.imag], axis=1).transpose(2, 1, 0)
        scaled = matrix / np.linalg.norm(matrix, axis=1, keepdims=True)
        worst = np.maximum(worst, np.linalg.cond(scaled))
    return worst


def transmission(condition_number: np.ndarray) -> np.ndarray:
    """Margin to the nearest change point: 1 at best, 0 at one.  The sine of a dyad's transmission angle."""
    return 2 / (condition_number + 1 / condition_number)


@dataclass(frozen=True)
class ContactSideChange:
    """A crank angle at which a reaction passes (near) zero and its pin crosses to another side of the bearing."""

    joint: str
    crank_angle: float  # rad, where the reaction is smallest
    before: float  # rad, last crank angle at which the reaction had a clear direction
    after: float  # rad, first one
    reaction: float  # N, at crank_angle
    turned: float  # rad, change of the contact's direction
    jump: complex  # m, what its gap changes by


def side_changes(
    sweep: Reactions, clearances: Mapping[str, float], faint: Mapping[str, float], whole_turn: bool = False
) -> list[ContactSideChange]:
    """Changes of side along a sweep of closely spaced, increasing crank angles, in their order.

    Each is a stretch on which the reaction passes near zero (is ``faint``, N), or a step on which it turns more than a
    right angle.  The stretch after the last angle ends at the first one if the sweep is a ``whole_turn`` (less its
    closing angle).
    """
    changes = []
    n = sweep.motion.theta.size
    theta = np.concatenate([sweep.motion.theta, sweep.motion.theta + 2 * np.pi])
    for joint in (name for name, size in clearances.items() if size > 0):
        force = np.tile(sweep.forces[joint], 2)
        strength = np.abs(force[:n])
        clear = np.flatnonzero(strength > faint[joint])
        if whole_turn and clear.size:
            clear = np.append(clear, clear[0] + n)
        contact = force[clear] / np.abs(force[clear])
        turned = np.angle(contact[1:] * np.conj(contact[:-1]))
        for k in np.flatnonzero((np.diff(clear) > 1) | (np.abs(turned) > np.pi / 2)):
            a, b = clear[k], clear[k + 1]
            least = _smallest_on_chords(force[a : b + 1], theta[a : b + 1])
            jump = complex(clearances[joint] * (contact[k + 1] - contact[k]))
            changes.append(
                ContactSideChange(joint, least[0], float(theta[a]), float(theta[b]), least[1], float(turned[k]), jump)
            )
    return sorted(changes, key=lambda change: change.crank_angle)


def _smallest_on_chords(force: np.ndarray, theta: np.ndarray) -> tuple[float, float]:
    """Where (rad) and how small (N) a reaction gets, taken as linear between neighbouring crank angles."""
    step = np.diff(force)
    share = np.clip(-(np.conj(step) * force[:-1]).real / np.maximum(np.abs(step) ** 2, np.finfo(float).tiny), 0.0, 1.0)
    size = np.abs(force[:-1] + share * step)
    k = int(np.argmin(size))
    return float(theta[k] + share[k] * (theta[k + 1] - theta[k])), float(size[k])
