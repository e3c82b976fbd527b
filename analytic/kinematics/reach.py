"""How far the crank of a linkage turns, and its usual crank angles: those that are taken where nobody chooses others.

Both depend on the linkage alone.  So do its largest forces at the usual angles, whichever angles are asked for.
"""

from __future__ import annotations

import numpy as np

from analytic.kinematics.assembly import PATH_STEP, Assembly, AssemblyError

USUAL_STEP = np.radians(5.0)  # between usual crank angles
USUAL_MARGIN = np.radians(20.0)  # how far the usual angles keep from a change point or the end of the crank's reach
SAME_DIRECTION = 1e-6  # rad, of a body's direction
REACH_PRECISION = 1e-4  # rad, of the end of the reach


def turns_fully(assembly: Assembly) -> bool:
    """Whether the crank can make a whole revolution, without a change point, that brings the linkage back.

    A group of four bodies may come back in another assembly mode, and its next revolution then differs.
    """
    if _beyond(assembly, 2 * np.pi) is not None:
        return False
    round_trip = assembly.start + np.array([0.0, 2 * np.pi])
    before, after = assembly.columns(assembly.path(*round_trip).near(round_trip))[: len(assembly.structure.bodies)].T
    return bool(np.abs(after - before).max() < SAME_DIRECTION)


def usual_angles(assembly: Assembly) -> np.ndarray:
    """Crank angles (rad): 0 to 355 deg in steps of 5 where it turns fully, else its reach less 20 deg at either end
    (paper: 20 to 160).
    """
    if turns_fully(assembly):
        return np.arange(72) * USUAL_STEP
    ends = [_reach(assembly, sign) for sign in (-1.0, 1.0)]
    clear = min(USUAL_MARGIN, (ends[1] - ends[0]) / 4)
    low, high = np.ceil((ends[0] + clear) / USUAL_STEP - 0.01), np.floor((ends[1] - clear) / USUAL_STEP + 0.01)
    return np.arange(low, high + 1) * USUAL_STEP if high >= low else np.array([assembly.start])


def _reach(assembly: Assembly, sign: float) -> float:
    """Crank angle (rad) that can be reached in one direction from the assembly angle.

    A path fails at a change point or at a step where a loop does not close.  The end is just before the former;
    bisection narrows the latter.
    """
    near, far = 0.0, 2 * np.pi
    failed = _beyond(assembly, sign * far)
    if failed is None:
        return float(assembly.start + sign * far)
    far = abs(failed - assembly.start)
    for before in (far - REACH_PRECISION, far - PATH_STEP):
        if before > 0 and _beyond(assembly, sign * before) is None:
            near = before
            break
        far = max(before, 0.0)
    while far - near > REACH_PRECISION:
        middle = (near + far) / 2
        near, far = (middle, far) if _beyond(assembly, sign * middle) is None else (near, middle)
    return float(assembly.start + sign * near)


def _beyond(assembly: Assembly, turn: float) -> float | None:
    """Crank angle (rad) at which the way to so far (rad) from the assembly angle ends; None where it does not."""
    try:
        assembly.path(assembly.start, assembly.start + turn)
    except AssemblyError as error:
        return error.at
    return None
