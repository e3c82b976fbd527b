"""How a driven run begins without a transient: as the quasi-static linkage moves around its first instant."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from analytic.kinematics.structure import Rest
from analytic.mechanism import Mechanism
from sim_models.common.start import Pose
from sim_models.engine import Request
from sim_models.exudyn.equilibria import Equilibria
from sim_models.exudyn.linkage import Inertia
from sim_models.exudyn.motor import RunMotor
from sim_models.exudyn.sway import sway
from sim_models.run.path import Path
from sim_models.run.record import Record

NODES = 7  # instants around the first, on whose polynomial rates and accelerations are taken
APART = 4e-3  # rad of crank angle from one to the next
APART_COMPLIANT = (
    0.05  # rad, of a compliant drive: far enough for the derivatives of derivatives that its sway is found by
)
PASSES = 2  # the second has the inertia forces of the first one's gaps
PASSES_COMPLIANT = 8  # at most
STILL = 1e-11  # rad by which a crank that has been found moves from one pass to the next


def instants(motor: RunMotor, compliant: bool = False) -> np.ndarray:
    """Times (s), the first instant among them: around it at constant speed, from it on along courses or where they
    reach far.
    """
    first = NODES // 2 if motor.steady and not compliant else 0
    return spaced(motor.top_speed, motor.end, APART_COMPLIANT if compliant else APART, first)


def spaced(top_speed: float, end: float, turn: float = APART, first: int = 0) -> np.ndarray:
    """Times (s), 0 the ``first`` of them, between which what is fastest (rad/s) turns by so much (rad), before the
    ``end`` (s).
    """
    spacing = min(turn / top_speed if top_speed else np.inf, end / (NODES - 1))
    return spacing * (np.arange(NODES) - first)


def derivative(time: np.ndarray) -> np.ndarray:
    """Matrix (N, N) from values at times (s) to the rates of the polynomial through them."""
    scale = np.ptp(time)
    powers = np.vander((time - time[0]) / scale, increasing=True)
    rates = np.zeros_like(powers)
    rates[:, 1:] = powers[:, :-1] * np.arange(1, time.size)
    return np.asarray(rates @ np.linalg.inv(powers)) / scale


def steady_start(equilibria: Equilibria, motor: RunMotor, stiffness: float | None) -> tuple[dict[str, Pose], Record]:
    """Poses and rates of the linkage at the first instant, and the equilibrium with inertia forces that it passes
    there.

    The crank of a drive of ``stiffness`` (N.m/rad) moves as :func:`crank_behind` says.
    """
    time = instants(motor)
    crank = motor.angle(time)
    if stiffness is not None:
        ideal = Equilibria(_ideal(equilibria), equilibria.path, 0.0, equilibria.creep)
        crank = crank_behind(ideal, motor, stiffness, time)
    return passing(equilibria, time, crank)


def passing(equilibria: Equilibria, time: np.ndarray, crank: np.ndarray) -> tuple[dict[str, Pose], Record]:
    """Poses and rates, and the equilibrium with inertia forces, of a linkage that passes these places on its path
    (crank angles, rad; on courses, the times) at times (s), at that which is nearest to 0.

    Inertia forces are those of the motion with the gaps of the pass before; or the ideal linkage's, where those of the
    gaps would move the linkage by more than the gaps do themselves: large gaps at speed have no motion without swing.
    """
    here, rate = int(np.argmin(np.abs(time))), derivative(time)
    gaps: list[dict[str, complex | Rest]] = [{} for _ in time]
    spins, last = _spins(equilibria.path, crank, gaps, rate, here), np.inf
    for _ in range(PASSES):
        passed = _passed(equilibria, crank, gaps, rate)
        beside = [record.gaps(equilibria.displaced) for record in passed]
        turning = _spins(equilibria.path, crank, beside, rate, here)
        change = float(np.abs(turning - spins).max())
        if change > last:
            break
        found, gaps, spins, last = passed, beside, turning, change
    for name, law in equilibria.real.model.bearings.items():  # the damper of a soft bearing holds its share
        held = law.damping / law.stiffness * (rate @ (seen := np.array([record.gap[name][0] for record in found])))
        gaps = [gap | {name: complex(at)} for gap, at in zip(gaps, seen - held, strict=True)]
    return _moving(equilibria.path, crank, gaps, rate, here), found[here]


def _ideal(equilibria: Equilibria) -> Request:
    return Request(equilibria.m.tight())


def crank_behind(equilibria: Equilibria, motor: RunMotor, stiffness: float, time: np.ndarray) -> np.ndarray:
    """Angle (rad) at some times (s) near the first instant of the ideal linkage's crank on a drive of that stiffness
    (N.m/rad).

    Where revolution follows revolution, in the motion that they repeat.  Elsewhere in the motion without sway: the
    limit of crank = motor - torque / stiffness, with the torque of the crank's own motion, as far as it converges; the
    crank's natural frequency has to be well above that of its motion.
    """
    repeating = sway(equilibria, motor, stiffness)
    if repeating is not None:
        return motor.angle(time) - repeating.behind(time)
    wide = instants(motor, compliant=True)
    rate, here, last = derivative(wide), int(np.argmin(np.abs(wide))), np.inf
    lag = np.zeros(NODES)
    for _ in range(PASSES_COMPLIANT):
        found = _passed(equilibria, motor.angle(wide) - lag, [{} for _ in wide], rate)
        needed = np.array([record.drive_torque[0] for record in found]) / stiffness
        change = abs(needed[here] - lag[here])
        if change > last:  # the series of ever higher derivatives has begun to diverge
            break
        lag, last = needed, change
        if change < STILL:
            break
    return motor.angle(time) - np.asarray(BarycentricInterpolator(wide, lag)(time))


def _passed(
    equilibria: Equilibria, crank: np.ndarray, gaps: list[dict[str, complex | Rest]], rate: np.ndarray
) -> list[Record]:
    """Equilibria at every instant, under the inertia forces of the motion that passes them all."""
    inertia, turning = _inertia(equilibria.m, _places(equilibria.path, crank, gaps), rate), rate @ crank
    return [equilibria.at(float(theta), a, float(w)) for theta, a, w in zip(crank, inertia, turning, strict=True)]


def _places(path: Path, crank: np.ndarray, gaps: list[dict[str, complex | Rest]]) -> list[dict[str, Pose]]:
    """Poses at every instant."""
    return [path.poses(float(theta), gap) for theta, gap in zip(crank, gaps, strict=True)]


def _inertia(m: Mechanism, places: list[dict[str, Pose]], rate: np.ndarray) -> list[Inertia]:
    """Accelerations at every instant."""
    linear, angular = {}, {}
    for body in m.bodies:
        angle = np.array([place[body.name].angle for place in places])
        centre = np.array([place[body.name].origin for place in places]) + body.centre * np.exp(1j * angle)
        linear[body.name], angular[body.name] = rate @ (rate @ centre), rate @ (rate @ angle)
    return [
        Inertia({b: complex(a[k]) for b, a in linear.items()}, {b: float(w[k]) for b, w in angular.items()})
        for k in range(len(places))
    ]


def _spins(
    path: Path, crank: np.ndarray, gaps: list[dict[str, complex | Rest]], rate: np.ndarray, here: int
) -> np.ndarray:
    """Angular velocities (bodies,) rad/s at one of the instants."""
    return np.array([pose.angular_velocity for pose in _moving(path, crank, gaps, rate, here).values()])


def _moving(
    path: Path, crank: np.ndarray, gaps: list[dict[str, complex | Rest]], rate: np.ndarray, here: int
) -> dict[str, Pose]:
    """Poses at one of the instants, with their rates."""
    places = _places(path, crank, gaps)
    moving = {}
    for name, pose in places[here].items():
        origin, angle = (np.array([getattr(place[name], part) for place in places]) for part in ("origin", "angle"))
        moving[name] = Pose(pose.origin, pose.angle, complex(rate[here] @ origin), float(rate[here] @ angle))
    return moving
