"""Where bodies are at many instants at once, each carried by another through a tree of joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Track:
    """A body's origin (m, x + iy) and angle (rad), and their rates, at (M,) instants."""

    origin: np.ndarray
    angle: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    @classmethod
    def still(cls, count: int) -> Track:
        """The ground's, at so many instants."""
        return cls(*np.zeros((4, count)))

    def at(self, point: complex) -> tuple[np.ndarray, np.ndarray]:
        """Place (m) and velocity (m/s) of a point (m) in the body's frame."""
        arm = point * np.exp(1j * self.angle)
        return self.origin + arm, self.velocity + 1j * self.spin * arm

    def carried(self, at: complex, point: complex, angle: np.ndarray | float, spin: np.ndarray | float = 0.0) -> Track:
        """A body whose ``point`` (m) is held ``at`` one of this body's (m), turned against it by an angle (rad) at a
        rate (rad/s).
        """
        pin, velocity = self.at(at)
        turned = Track(np.zeros_like(pin), self.angle + angle, np.zeros_like(pin), self.spin + spin)
        arm, swing = turned.at(point)
        return Track(pin - arm, turned.angle, velocity - swing, turned.spin)

    def slid(self, axis: complex, way: np.ndarray, rate: np.ndarray) -> Track:
        """The body moved in its frame along an ``axis``, (M,) m at a rate (M,) m/s; complex ones are along x + iy."""
        along = axis * np.exp(1j * self.angle)
        velocity = self.velocity + (rate + 1j * self.spin * way) * along
        return Track(self.origin + along * way, self.angle, velocity, self.spin)
