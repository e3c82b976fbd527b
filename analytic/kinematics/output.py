"""Outputs: the numbers of a linkage that a user cares about, and what is wanted of a platform."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from analytic.kinematics.motion import Motion


@dataclass(frozen=True)
class Output:
    """One number that a user cares about: x or y of a body's point (m, ground frame), or a body's angle (rad).

    A body that bends has its angle where a sensor reads it: at its joint on the ground, else at its com.
    """

    body: str
    axis: Literal["x", "y", "angle"]
    point: str = "com"

    @property
    def name(self) -> str:
        """``coupler_x`` for a com as in the signals, ``coupler.B_x`` for another point, ``coupler_angle``."""
        return f"{self.place}_{self.axis}"

    @property
    def place(self) -> str:
        """``coupler`` or ``coupler.B``."""
        return self.body if self.point == "com" else f"{self.body}.{self.point}"

    @property
    def unit(self) -> Literal["m", "rad"]:
        """``m`` or ``rad``."""
        return "rad" if self.axis == "angle" else "m"

    def value(self, motion: Motion) -> np.ndarray:
        """The output (N,) itself."""
        return motion.angle(self.body) if self.axis == "angle" else self.part(motion.position(self.body, self.point))

    def rate(self, motion: Motion) -> np.ndarray:
        """Its velocity (N,)."""
        if self.axis == "angle":
            return motion.angular_velocity(self.body)
        return self.part(motion.velocity(self.body, self.point))

    @property
    def load(self) -> tuple[str, complex, float]:
        """A unit load along it: point, force (x + iy) and torque."""
        return (self.point, 0j, 1.0) if self.axis == "angle" else (self.point, 1.0 if self.axis == "x" else 1j, 0.0)

    def part(self, vector: np.ndarray) -> np.ndarray:
        """The component of vectors x + iy (any shape) along the output's axis."""
        return vector.real if self.axis == "x" else vector.imag
