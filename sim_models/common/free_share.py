"""How long a pin is off the wall of its bearing: one definition for every engine."""

from __future__ import annotations

import numpy as np

# of the clearance: a pin farther than this inside of the rim is off the wall; pressed pins may hover within it
OFF_WALL = 1e-3


def free_share(gaps: np.ndarray, clearance: float, time: np.ndarray | None = None) -> float:
    """Share of the time that a pin is off the wall, from its displacements (M,) complex m; contact is where it is, not
    a force.

    ``time`` (M,) s says when; left out, all displacements count alike.
    """
    free = np.abs(gaps) < clearance * (1 - OFF_WALL)
    if time is None or free.size < 2 or time[-1] == time[0]:
        return float(np.mean(free)) if free.size else 0.0
    return float(np.sum(np.diff(time) * (free[1:].astype(float) + free[:-1])) / (2 * (time[-1] - time[0])))
