"""Total displacement of a linkage: clearance and compliance superposed (Fig. 7c)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analytic.assembly import Assembly
from analytic.clearance import Displaced, Model, displaced
from analytic.compliance import Compliance, compliance


@dataclass(frozen=True)
class Total:
    """Both displacements of a linkage at N crank angles, and their sum."""

    clearance: Displaced
    compliance: Compliance

    def by_clearance(self, body: str, point: str = "com") -> np.ndarray:
        """Displacement x + iy (m) of a body's point by the joints' clearance, (N,) complex."""
        return self.clearance.configuration.motion.position(body, point) - self.clearance.ideal.motion.position(body, point)

    def displacement(self, body: str, point: str = "com") -> np.ndarray:
        """Displacement x + iy (m) of a body's point by clearance and compliance together, (N,) complex."""
        return self.by_clearance(body, point) + self.compliance.displacement(body, point)


def total_displacement(
    assembly: Assembly,
    theta: np.ndarray,
    omega: float = 1.0,
    *,
    model: Model = "first_order",
    inertia: bool = False,
    clearances: Mapping[str, float] | None = None,
) -> Total:
    """Superpose clearance (``model``) and the ideal configuration's compliance at crank angles theta (N,) rad.

    With ``first_order`` this is the paper's procedure.  Raises what :func:`analytic.clearance.displaced` and
    :func:`analytic.compliance.compliance` raise.
    """
    moved = displaced(assembly, theta, omega, model=model, inertia=inertia, clearances=clearances)
    return Total(moved, compliance(moved.ideal.motion, inertia))
