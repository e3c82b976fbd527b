"""Where a simulation begins, and in how many steps it goes on: poses of the assembled linkage, and equal steps.

The only analytic knowledge an engine is given is the assembly: a closed linkage to start from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim_models.engine import Cause, SimulationError

MOST_STEPS = 1_500_000  # of a run whose steps pass through Python or are all kept: a minute or two


@dataclass(frozen=True)
class Pose:
    """A body's origin (m, ground frame, x + iy) and angle (rad), and their rates."""

    origin: complex
    angle: float
    velocity: complex = 0j
    angular_velocity: float = 0.0


AT_REST = Pose(0j, 0.0)  # the ground


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
