"""Where the labels of a drawing stand: within its area, where they cover least of curves, markers and each other.

The page's own figures, which ``chart.js`` draws, have the same rule.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

HIGH, BELOW = 11.0, 3.0  # px, of letters over and under their base line
APART, ROW = 3.0, 13.0  # px, between labels side by side, and from base line to base line
STACKED_WITHIN = 40.0  # px: points whose labels stand one under the other in the order of the points
STEP = 4.0  # px between looks along a curve


def _places(aside: float, over: float, under: float, line: float) -> np.ndarray:
    """Places (P, 3) beside a point: how far to the right (or left, or in the middle), the base line below the point,
    and what that costs.
    """
    found: list[tuple[float, float, float]] = []
    for k in range(14):
        rows = [(-over - line * k, 4.0 * k), (under + line * k, 4.0 * k + 1), *([] if k else [(4.0, 3.0)])]
        for row, cost in rows:
            for more in (0.0, 14.0, 30.0, 50.0):
                away = aside + np.sign(aside) * more
                found += [(away, row, cost + more / 5), (-away, row, cost + more / 5 + 0.5)]
            found.append((0.0, row + (-4 if row < 0 else 2), cost + 2 + 9 * (row == 4)))
    return np.array(found)


PEAK_PLACES, JOINT_PLACES = _places(9, 8, 18, 13), _places(-11, 10, 20, 15)


@dataclass(frozen=True)
class Label:
    """A label of some width (px) at a point (px), of a peak or of a joint; once placed, where it begins."""

    text: str
    wide: float
    at: complex
    peak: bool
    left: float = 0.0
    base: float = 0.0


@dataclass(frozen=True)
class Area:
    """What labels stand within (px): left, right, top and bottom."""

    left: float
    right: float
    top: float
    bottom: float


def placed(labels: Iterable[Label], area: Area, marks: np.ndarray, curves: np.ndarray) -> list[Label]:
    """The labels where they cover least of markers (M,) and of points along curves (N,), x + iy px, those of higher
    points first.
    """
    done: list[Label] = []
    for label in sorted(labels, key=lambda one: one.at.imag):
        side, up, cost = (PEAK_PLACES if label.peak else JOINT_PLACES).T
        begins = label.at.real + side - label.wide * np.where(side < 0, 1.0, np.where(side > 0, 0.0, 0.5))
        left = np.clip(begins, area.left + 2, max(area.left + 2, area.right - label.wide - 2))
        right, base = left + label.wide, label.at.imag + up
        cost = cost + 5000.0 * ((base - HIGH < area.top) | (base + BELOW > area.bottom))
        for other in done:
            meets = (other.left < right + APART) & (left < other.left + other.wide + APART)
            cost = cost + 500.0 * (meets & (np.abs(base - other.base) < ROW))
            near = meets | (abs(other.at.real - label.at.real) < STACKED_WITHIN)
            cost = cost + 60.0 * (near & (base <= other.base) & label.peak)
        for points, spare, each in ((marks, 5.0, 120.0), (curves, 1.0, 3.0)):
            x, y = points.real, points.imag
            across = (x > left[:, None] - spare) & (x < right[:, None] + spare)
            upright = (y > base[:, None] - HIGH - spare) & (y < base[:, None] + BELOW + spare)
            cost = cost + each * (across & upright).sum(axis=1)
        k = int(np.argmin(cost))
        done.append(replace(label, left=float(left[k]), base=float(base[k])))
    return done


def along(lines: Iterable[np.ndarray]) -> np.ndarray:
    """Points (N,), x + iy px, some px apart along lines (M,), NaN where these have a gap; one where several meet."""
    found: dict[tuple[int, int], complex] = {}
    for line in lines:
        for p, q in pairwise(line):
            count = min(300, int(np.ceil(abs(q - p) / STEP))) if np.isfinite(p + q) else 0
            for k in range(count):
                at = complex(p + (q - p) * k / count)
                found[round(at.real / STEP), round(at.imag / STEP)] = at
    return np.array(list(found.values()), complex)
