"""Which crank angles a comparison looks at."""

from __future__ import annotations

import numpy as np

from analytic.errors import Error

FARTHEST = 1e6  # deg: the crank is followed there from where it is assembled
MOST_TIMES = 100_000  # of a command line's grid
FREE_TIME = np.linspace(0.0, 2.0, 101)  # s, for a released linkage


class GridError(Error, ValueError):
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


def parse_times(text: str) -> np.ndarray:
    """Times (s) from ``start:stop:step``, stop included.  Raises GridError."""
    try:
        start, stop, step = (float(part) for part in text.split(":"))
    except ValueError:
        raise GridError(f"--times {text}: give start:stop:step in seconds, such as 0:1:0.02") from None
    if not (np.isfinite([start, stop, step]).all() and step > 0 and 0 <= start < stop):
        raise GridError(f"--times {text}: give a start of 0 or more, a later stop and a positive step (seconds)")
    if (stop - start) / step > MOST_TIMES:
        raise GridError(f"--times {text}: that is more than {MOST_TIMES} times; use a larger step")
    return np.asarray(start + step * np.arange(int(np.floor((stop - start) / step + 1e-9)) + 1))


def parse_workspace(text: str) -> tuple[tuple[float, float, int], tuple[float, float, int]]:
    """Lowest, highest and number of the x and of the y (m) of ``x0:x1:nx,y0:y1:ny``.  Raises GridError."""
    remedy = "give x0:x1:nx,y0:y1:ny in metres, such as -0.1:0.1:41,0:0.2:41"
    axes = [part.split(":") for part in text.split(",")]
    if [len(axis) for axis in axes] != [3, 3]:
        raise GridError(f"--workspace {text}: {remedy}")
    try:
        (x0, x1, nx), (y0, y1, ny) = ((float(a), float(b), int(n)) for a, b, n in axes)
    except ValueError:
        raise GridError(f"--workspace {text}: {remedy}") from None
    if not (np.isfinite([x0, x1, y0, y1]).all() and x1 > x0 and y1 > y0 and nx >= 2 and ny >= 2):
        raise GridError(f"--workspace {text}: each axis needs a higher end above its lower one, and two places or more")
    return (x0, x1, nx), (y0, y1, ny)
