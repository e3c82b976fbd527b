"""Blocks with clearance in their guides, in a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld`: a spring and a damper
of each corner against its wall, or its contact law by name.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from analytic.mechanism import Joint, Mechanism
from sim_models.common.contact_laws import KelvinVoigt, NamedLaw, contact_parameters, named_law, told_of
from sim_models.common.guide import Guide
from sim_models.common.start import Pose
from sim_models.engine import Motion, SettingValue
from sim_models.leapfrog.parts import Pin
from sim_models.leapfrog.striking import LeapfrogStriking

Yields = Callable[[Joint, complex], np.ndarray]  # (2, 2) 1/kg, now, of a corner so far (m) along a block and across


@dataclass(frozen=True)
class Touch:
    """A wall against a corner, by its number: where it is (m), and the force (N) on the block."""

    corner: int
    at: complex
    force: complex


@dataclass(frozen=True)
class LeapfrogBlock:
    """The block of a joint: its guide, what its corners' contact is made of, the law that the mechanism names for it,
    and how each corner strikes under that.  ``points`` (m) are the joint's, in the frames of its bodies.
    """

    joint: Joint
    guide: Guide
    contact: KelvinVoigt
    law: NamedLaw | None
    points: tuple[complex, complex]
    striking: tuple[LeapfrogStriking, ...]

    @classmethod
    def of(cls, m: Mechanism, joint: Joint, motion: Motion, yields: Yields) -> LeapfrogBlock:
        """That of a joint."""
        guide, law = Guide.of(joint), named_law(m, joint, motion)
        assert guide is not None  # a mechanism with clearance in a prismatic joint has it
        first, second = (m.body(body).point(joint.name) for body in joint.bodies)
        striking = [] if law is None else [LeapfrogStriking(law, 0.0, partial(yields, joint, z)) for z in guide.corners]
        return cls(joint, guide, contact_parameters(m, joint, motion), law, (first, second), tuple(striking))

    def along(self, first: Pose) -> complex:
        """Unit vector along the guide, ground frame."""
        return self.joint.direction * cmath.exp(1j * first.angle)

    def places(self, first: Pose, second: Pose) -> tuple[complex, complex]:
        """The joint's two points (m, ground frame)."""
        near, far = (
            pose.origin + point * cmath.exp(1j * pose.angle)
            for pose, point in zip((first, second), self.points, strict=True)
        )
        return near, far

    def seat(self, first: Pose, second: Pose) -> complex:
        """Height (m) across the guide, and i times tilt (rad)."""
        near, far = self.places(first, second)
        height = ((far - near) * self.along(first).conjugate()).imag
        return complex(height, second.angle - first.angle - self.joint.angle)

    def rate(self, first: Pose, second: Pose) -> complex:
        """The rates of these (m/s, rad/s)."""
        _, far = self.places(first, second)
        slip = _velocity(second, far) - _velocity(first, far)
        return complex((slip * self.along(first).conjugate()).imag, second.angular_velocity - first.angular_velocity)

    def touches(self, first: Pose, second: Pose, trailing: float) -> Iterator[Touch]:
        """Walls that press corners, in the next step; velocities are ``trailing`` (s) older than places in a run."""
        near, far = self.places(first, second)
        along, back = self.along(first), self.along(first).conjugate()
        turned = along * cmath.exp(1j * (second.angle - first.angle - self.joint.angle))
        room = self.guide.height / 2 + self.guide.clearance
        for k, (side, corner) in enumerate(zip(self.guide.sides, self.guide.corners, strict=True)):
            at = far + turned * corner
            depth, normal = side * ((at - near) * back).imag - room, -side * 1j * along
            if depth <= 0 and not (self.striking and trailing):
                continue
            rate = _velocity(first, at) - _velocity(second, at)
            if self.striking and trailing:
                force = self.striking[k].press(depth, normal, rate, trailing)
            else:
                into = (rate * normal.conjugate()).real
                force = max(0.0, self.contact.stiffness * depth + self.contact.damping * into) * normal
            if force:
                yield Touch(k, at, force)


def law_settings(mechanism: Mechanism, pins: Mapping[str, Pin | LeapfrogBlock]) -> dict[str, SettingValue]:
    """The contact laws of pins and blocks, for a trace's settings."""
    laws = {name: pin.law for name, pin in pins.items() if pin.law is not None}
    words = {
        name: "Kelvin-Voigt, max(0, K d + C d')" if pin.law is None else pin.law.words for name, pin in pins.items()
    }
    alike = len(set(words.values())) == 1
    damped = [pin.contact.damping for pin in pins.values() if pin.law is None or pin.law.damping]
    return {
        "contact_law": next(iter(words.values())) if alike else "; ".join(f"{n}: {law}" for n, law in words.items()),
        "contact_stiffness": min(pin.contact.stiffness for pin in pins.values()),
        **({"contact_damping": max(damped)} if damped else {}),
        **told_of(mechanism, laws),
    }


def _velocity(pose: Pose, at: complex) -> complex:
    """Velocity (m/s) of what of a body is at a place (m)."""
    return pose.velocity + 1j * pose.angular_velocity * (at - pose.origin)
