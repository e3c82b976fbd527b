"""How a driven run begins without a transient: as the quasi-static linkage moves around its first instant."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from sim_models.common.start import Pose
from sim_models.engine import Request
from sim_models.exudyn.equilibria import ExudynEquilibria
from sim_models.exudyn.linkage import Inertia
from sim_models.exudyn.motor import RunMotor
from sim_models.exudyn.sway import sway
from sim_models.run.path import Gaps, Path, Placed
from sim_models.run.record import Record

INSTANTS_OF_START = 7  # instants around the first, on whose polynomial rates and accelerations are taken
APART = 4e-3  # rad of crank angle from one to the next
APART_COMPLIANT = (
    0.05  # rad, of a compliant drive: far enough for the derivatives of derivatives that its sway is found by
)
INERTIA_PASSES = 2  # the second has the inertia forces of the first one's gaps
PASSES_COMPLIANT = 8  # at most
LAG_SETTLED = 1e-11  # rad by which a crank that has been found moves from one pass to the next


def instants(motor: RunMotor, compliant: bool = False) -> np.ndarray:
    """Times (s), the first instant among them: around it at constant speed, from it on along courses or where they
    reach far.
    """
    first = INSTANTS_OF_START // 2 if motor.steady and not compliant else 0
    return spaced(motor.top_speed, motor.end, APART_COMPLIANT if compliant else APART, first)


def spaced(top_speed: float, end: float, turn: float = APART, first: int = 0) -> np.ndarray:
    """Times (s), 0 the ``first`` of them, between which what is fastest (rad/s) turns by so much (rad), before the
    ``end`` (s).
    """
    spacing = min(turn / top_speed if top_speed else np.inf, end / (INSTANTS_OF_START - 1))
    return spacing * (np.arange(INSTANTS_OF_START) - first)


def derivative(time: np.ndarray) -> np.ndarray:
    """Matrix (N, N) from values at times (s) to the rates of the polynomial through them."""
    scale = np.ptp(time)
    powers = np.vander((time - time[0]) / scale, increasing=True)
    rates = np.zeros_like(powers)
    rates[:, 1:] = powers[:, :-1] * np.arange(1, time.size)
    return np.asarray(rates @ np.linalg.inv(powers)) / scale


def steady_start(
    equilibria: ExudynEquilibria, motor: RunMotor, stiffness: float | None
) -> tuple[dict[str, Pose], Record]:
    """Poses and rates of the linkage at the first instant, and the equilibrium with inertia forces that it passes
    there.

    The crank of a drive of ``stiffness`` (N.m/rad) moves as :func:`crank_behind` says.
    """
    time = instants(motor)
    crank = motor.angle(time)
    if stiffness is not None:
        ideal = ExudynEquilibria(Request(equilibria.m.tight()), equilibria.path, 0.0, equilibria.creep)
        crank = crank_behind(ideal, motor, stiffness, time)
    return passing(equilibria, time, crank)


def passing(equilibria: ExudynEquilibria, time: np.ndarray, crank: np.ndarray) -> tuple[dict[str, Pose], Record]:
    """Poses and rates, and the equilibrium with inertia forces, of a linkage that passes these places on its path
    (crank angles, rad; on courses, the times) at times (s), at that which is nearest to 0.

    Inertia forces are those of the motion with the gaps of the pass before; or the ideal linkage's, where those of the
    gaps would move the linkage by more than the gaps do themselves: large gaps at speed have no motion without swing.
    """
    here, rate = int(np.argmin(np.abs(time))), derivative(time)

    def moving(gaps: Sequence[Gaps]) -> tuple[dict[str, Pose], np.ndarray]:
        poses = _moving(_placed(equilibria.path, crank, gaps), rate, here)
        return poses, np.array([pose.angular_velocity for pose in poses.values()])

    gaps: Sequence[Gaps] = [{}] * time.size
    (start, spins), last = moving(gaps), np.inf
    for _ in range(INERTIA_PASSES):
        passed = _passed(equilibria, crank, gaps, rate)
        beside = [record.gaps(equilibria.displaced) for record in passed]
        moved, turning = moving(beside)
        change = float(np.abs(turning - spins).max())
        if change > last:
            break
        records, gaps, start, spins, last = passed, beside, moved, turning, change
    for name, law in equilibria.real.model.bearings.items():  # the damper of a soft bearing holds its share
        gap = np.array([record.gap[name][0] for record in records])
        held = law.damping / law.stiffness * (rate @ gap)
        gaps = [{**others, name: complex(at)} for others, at in zip(gaps, gap - held, strict=True)]
        start, _ = moving(gaps)
    return start, records[here]


def crank_behind(equilibria: ExudynEquilibria, motor: RunMotor, stiffness: float, time: np.ndarray) -> np.ndarray:
    """Angle (rad) at some times (s) near the first instant of the ideal linkage's crank on a drive of that stiffness
    (N.m/rad).

    Where revolution follows revolution, in the motion that they repeat.  Elsewhere in the motion without sway: the
    limit of crank = motor - torque / stiffness, with the torque of the crank's own motion, as far as it converges; the
    crank's natural frequency has to be well above that of its motion.
    """
    repeating = sway(equilibria, motor, stiffness)
    if repeating is not None:
        return motor.angle(time) - np.asarray(repeating(time))
    wide = instants(motor, compliant=True)
    rate, here, last = derivative(wide), int(np.argmin(np.abs(wide))), np.inf
    lag = np.zeros(INSTANTS_OF_START)
    for _ in range(PASSES_COMPLIANT):
        records = _passed(equilibria, motor.angle(wide) - lag, [{}] * INSTANTS_OF_START, rate)
        needed = np.array([record.drive_torque[0] for record in records]) / stiffness
        change = abs(needed[here] - lag[here])
        if change > last:  # the series of ever higher derivatives has begun to diverge
            break
        lag, last = needed, change
        if change < LAG_SETTLED:
            break
    return motor.angle(time) - np.asarray(BarycentricInterpolator(wide, lag)(time))


def _passed(equilibria: ExudynEquilibria, crank: np.ndarray, gaps: Sequence[Gaps], rate: np.ndarray) -> list[Record]:
    """Equilibria at every instant, under the inertia forces of the motion that passes them all."""
    linear, angular = {}, {}
    for name, (origin, angle) in _placed(equilibria.path, crank, gaps).items():
        centre = origin + equilibria.m.moving[name].centre * np.exp(1j * angle)
        linear[name], angular[name] = rate @ (rate @ centre), rate @ (rate @ angle)
    inertia = [Inertia.of(linear, angular, k) for k in range(crank.size)]
    each = zip(crank.tolist(), inertia, (rate @ crank).tolist(), strict=True)
    return [equilibria.at(*there) for there in each]


def _placed(path: Path, crank: np.ndarray, gaps: Sequence[Gaps]) -> Placed:
    """Every moving body at every instant."""
    poses = [path.poses(*there) for there in zip(crank.tolist(), gaps, strict=True)]
    return {
        name: (np.array([each[name].origin for each in poses]), np.array([each[name].angle for each in poses]))
        for name in poses[0]
    }


def _moving(placed: Placed, rate: np.ndarray, here: int) -> dict[str, Pose]:
    """Poses at one of the instants, with their rates."""
    return {
        name: Pose(complex(origin[here]), float(angle[here]), complex(rate[here] @ origin), float(rate[here] @ angle))
        for name, (origin, angle) in placed.items()
    }
