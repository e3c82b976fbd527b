"""Which crank angles a comparison looks at."""

from __future__ import annotations

import numpy as np

from analytic.assembly import Assembly, AssemblyError

STEP = np.radians(5.0)
CLEAR = np.radians(20.0)  # how far the default range keeps from a change point or the end of the crank's reach
FARTHEST = 1e6  # deg: the crank is followed there from where it is assembled
FREE_TIME = np.linspace(0.0, 2.0, 101)  # s, for a released linkage


class GridError(ValueError):
    """``--angles`` cannot be used; the message says what is accepted."""


def parse_angles(text: str) -> np.ndarray:
    """Crank angles (rad) from ``start:stop:step`` in degrees, stop included.  Raises GridError."""
    try:
        start, stop, step = (float(part) for part in text.split(":"))
    except ValueError:
        raise GridError(f"--angles {text}: give start:stop:step in degrees, such as 20:160:5") from None
    if not (np.isfinite([start, stop, step]).all() and step > 0 and stop >= start):
        raise GridError(f"--angles {text}: stop must not be below start, and step must be positive (degrees)")
    if max(abs(start), abs(stop)) > FARTHEST:
        raise GridError(f"--angles {text}: a crank angle (degrees) must not be beyond {FARTHEST:g}")
    if (stop - start) / step > 1e6:
        raise GridError(f"--angles {text}: that is more than a million angles; use a larger step")
    return np.radians(start + step * np.arange(int(np.floor((stop - start) / step + 1e-9)) + 1))


def chosen_angles(assembly: Assembly, text: str | None) -> np.ndarray:
    """Crank angles (rad) of ``--angles``, or the default ones; the linkage reaches them.  Raises GridError, or AssemblyError by default."""
    if text is None:
        theta = default_angles(assembly)
        assembly.path(theta.min(), theta.max())
        return theta
    theta = parse_angles(text)
    try:
        assembly.path(theta.min(), theta.max())
    except AssemblyError as error:
        raise GridError(f"--angles {text}: {error}") from None
    return theta


def turns_fully(assembly: Assembly) -> bool:
    """Whether the crank can make a whole revolution without meeting a change point."""
    try:
        assembly.path(assembly.start, assembly.start + 2 * np.pi)
    except AssemblyError:
        return False
    return True


def default_angles(assembly: Assembly) -> np.ndarray:
    """0 to 355 deg in steps of 5 where the crank turns fully, else its reach less 20 deg at either end (paper: 20 to 160)."""
    if turns_fully(assembly):
        return np.arange(72) * STEP
    ends = [_reach(assembly, sign) for sign in (-1.0, 1.0)]
    clear = min(CLEAR, (ends[1] - ends[0]) / 4)
    low, high = np.ceil((ends[0] + clear) / STEP - 0.01), np.floor((ends[1] - clear) / STEP + 0.01)
    return np.arange(low, high + 1) * STEP if high >= low else np.array([assembly.start])


def _reach(assembly: Assembly, sign: float) -> float:
    """Crank angle (rad) that can be reached in one direction from the assembly angle, by bisection."""
    near, far = 0.0, 2 * np.pi
    while far - near > 1e-4:
        middle = (near + far) / 2
        try:
            assembly.path(assembly.start, assembly.start + sign * middle)
            near = middle
        except AssemblyError:
            far = middle
    return float(assembly.start + sign * near)
