"""How bodies move that others carry through a tree of joints, at an instant or at many at once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from sim_models.common.start import Pose

_Values = Any  # a float or complex number, or an array (M,) of them: which of both goes in comes out


class Track(NamedTuple):
    """A body's origin (m, x + iy) and angle (rad), their rates and accelerations."""

    origin: _Values = 0j
    angle: _Values = 0.0
    velocity: _Values = 0j
    spin: _Values = 0.0
    acceleration: _Values = 0j
    spin_up: _Values = 0.0

    @classmethod
    def still(cls, count: int) -> Track:
        """The ground's, at so many instants."""
        return cls(*np.zeros((6, count)))

    @property
    def pose(self) -> Pose:
        """Where it is at one instant, and how fast."""
        return Pose(self.origin, self.angle, self.velocity, self.spin)

    @property
    def turned(self) -> _Values:
        """What turns a vector x + iy of its frame into the ground's."""
        return np.exp(1j * self.angle)

    def at(self, point: complex) -> tuple[_Values, _Values, _Values]:
        """Place (m), velocity (m/s) and acceleration (m/s^2) of a point (m) in the body's frame."""
        arm = point * self.turned
        pull = (1j * self.spin_up - self.spin * self.spin) * arm
        return self.origin + arm, self.velocity + 1j * self.spin * arm, self.acceleration + pull

    def carried(
        self, at: complex, point: complex, angle: _Values, spin: _Values = 0.0, spin_up: _Values = 0.0
    ) -> Track:
        """A body whose ``point`` (m) is held ``at`` one of this body's (m), turned against it by an angle (rad) with
        its rate and acceleration.
        """
        pin, velocity, acceleration = self.at(at)
        turned = Track(0j, self.angle + angle, 0j, self.spin + spin, 0j, self.spin_up + spin_up)
        arm, swing, pull = turned.at(point)
        return Track(pin - arm, turned.angle, velocity - swing, turned.spin, acceleration - pull, turned.spin_up)

    def slid(self, axis: complex, way: _Values, rate: _Values, change: _Values = 0.0) -> Track:
        """The body moved in its frame along an ``axis`` by a way (m) with its rate and acceleration; complex ones are
        along x + iy.
        """
        along = axis * self.turned
        velocity = rate + 1j * self.spin * way
        acceleration = change + 2j * self.spin * rate + (1j * self.spin_up - self.spin * self.spin) * way
        return self._replace(
            origin=self.origin + along * way,
            velocity=self.velocity + along * velocity,
            acceleration=self.acceleration + along * acceleration,
        )
