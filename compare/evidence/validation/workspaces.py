"""Platforms over their workspaces: how far clearance moves them, and how far the paper's Eq. 8 is off."""

from __future__ import annotations

import numpy as np

from analytic.mechanism.file import load
from compare.platform import Grid, platform_accuracy
from compare.results.platform import PlatformAccuracy
from compare.results.validation import OverWorkspace

CLEARANCE = 1e-4  # m, in every pin
SQUARE: Grid = ((-0.2, 0.2, 41), (-0.2, 0.2, 41))
WORKSPACES: dict[str, tuple[str, Grid]] = {
    "five-bar": ("left-arm.P", ((-0.1, 0.25, 41), (0.0, 0.3, 41))),
    "3-rrr": ("platform", SQUARE),
    "3-rpr": ("platform", SQUARE),
}
HELD = (5.0, 10.0)  # condition numbers of the loops up to which poses count


def workspaces() -> dict[str, tuple[OverWorkspace, ...]]:
    """By case: Eq. 8 against the self-consistent equilibrium with every pin loose, at rest over the workspace."""
    found = {}
    for case, (output, grid) in WORKSPACES.items():
        m = load(case)
        loose = m.with_clearances({joint.name: CLEARANCE for joint in m.joints if not joint.prismatic})
        told = platform_accuracy(loose, outputs=output, workspace=grid)
        found[case] = tuple(_held(told, limit) for limit in HELD)
    return found


def _held(told: PlatformAccuracy, limit: float) -> OverWorkspace:
    x, y = (next(d for d in told.outputs.values() if d.axis == axis) for axis in "xy")
    first_order, equilibrium = x.nominal + 1j * y.nominal, x.equilibrium + 1j * y.equilibrium
    (point,) = told.points.values()
    at = (told.holding < limit) & np.isfinite(equilibrium)
    off = np.abs(first_order - equilibrium)[at] / np.abs(equilibrium)[at]
    return OverWorkspace(
        holding=limit,
        poses=int(at.sum()),
        displacement=float(np.abs(equilibrium[at]).max()),
        farthest=float(point.farthest[at].max()),
        first_order=float(np.median(off)),
        first_order_worst=float(off.max()),
    )
