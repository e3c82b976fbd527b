"""Where a simulation begins, and in how many steps it goes on: poses of the assembled linkage, and equal steps.

The only analytic knowledge an engine is given is the assembly: a closed linkage to start from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from analytic.kinematics.assembly import Assembly
from sim_models.engine import Cause, SimulationError

MOST_STEPS = 1_500_000  # of a run whose steps pass through Python or are all kept: a minute or two

Gaps = Callable[[float], Mapping[str, complex]]  # gap (m) of each joint, first pin minus second, at a crank angle


@dataclass(frozen=True)
class Pose:
    """A body's origin (m, ground frame, x + iy) and angle (rad), and their rates."""

    origin: complex
    angle: float
    velocity: complex = 0j
    angular_velocity: float = 0.0


AT_REST = Pose(0j, 0.0)  # the ground


def poses(assembly: Assembly, theta: float, speed: float = 0.0, gaps: Gaps = lambda theta: {}) -> dict[str, Pose]:
    """Pose of every moving body with the crank at theta (rad), turning at ``speed`` (rad/s).

    ``gaps`` may depend on the crank angle; rates are central differences over it (five points, 1e-3 rad).
    """
    here = _placed(assembly, theta, gaps)
    if speed == 0:
        return {name: Pose(origin, angle) for name, (origin, angle) in here.items()}
    h = 1e-3
    around = [_placed(assembly, theta + k * h, gaps) for k in (-2, -1, 1, 2)]
    result = {}
    for name, (origin, angle) in here.items():
        rate = [
            sum(w * side[name][i] for w, side in zip((1, -8, 8, -1), around, strict=True)) / (12 * h) * speed
            for i in (0, 1)
        ]
        result[name] = Pose(origin, angle, complex(rate[0]), float(np.real(rate[1])))
    return result


def poses_along(assembly: Assembly, positions: Mapping[str, float], rates: Mapping[str, float]) -> dict[str, Pose]:
    """Pose of every moving body of the ideal linkage with its inputs' joints at positions (rad, m) and rates (rad/s,
    m/s), second body relative to first; inputs that are left out are as at the assembly, at rest.

    Rates are central differences along the motion (five points).
    """
    at = assembly.positions | dict(positions)
    moving = {name: rates.get(name, 0.0) for name in at}
    h = 1e-3 / max(1.0, *map(abs, moving.values()))
    times = h * np.arange(-2, 3)
    inputs = assembly.inputs_at({name: where + moving[name] * times for name, where in at.items()})
    sides = _bodies(assembly, inputs, {})
    weights = np.array([1, -8, 0, 8, -1]) / (12 * h)
    return {
        name: Pose(complex(origin[2]), float(angle[2]), complex(origin @ weights), float(angle @ weights))
        for name, (origin, angle) in sides.items()
    }


def _placed(assembly: Assembly, theta: float, gaps: Gaps) -> dict[str, tuple[complex, float]]:
    gap = {name: np.array([value]) for name, value in gaps(theta).items()}
    found = _bodies(assembly, np.array([theta]), gap)
    return {name: (complex(origin[0]), float(angle[0])) for name, (origin, angle) in found.items()}


def _bodies(
    assembly: Assembly, inputs: np.ndarray, gap: Mapping[str, np.ndarray]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Origin (N,) m, complex, and angle (N,) rad of every moving body at inputs."""
    s = assembly.structure
    u = assembly.coordinates(inputs, gap)
    origins = s.origins @ assembly.columns(u, gap)
    still = np.zeros(u.shape[1])
    angles = [sum((u[i] for i in turned), still) + held for turned, held in zip(s.turned, s.held_at, strict=True)]
    return {name: (origins[b], angles[b]) for b, name in enumerate(s.bodies) if b}


def substeps(interval: float, longest: float) -> tuple[int, float]:
    """Number and size (s) of equal steps, none longer than ``longest``, that make up an interval."""
    count = max(1, int(np.ceil(interval / longest - 1e-9)))
    return count, interval / count


def check_steps(who: str, time: float, longest: float, most: int = MOST_STEPS, remedy: str = "") -> None:
    """Raise SimulationError if a run of a time (s) in steps no longer than ``longest`` (s) would take too many.
    ``who`` runs what; ``remedy`` is what helps, if it is not what usually does.
    """
    count = time / longest
    if not count <= most:
        raise SimulationError(
            f"{who}: {time:.3g} s would take {count:.2g} steps of {longest:.2g} s, and {most:g} are the most",
            Cause.TOO_MANY_STEPS,
            remedy,
        )
