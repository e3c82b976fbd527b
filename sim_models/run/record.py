"""What the sensors on every body, joint and drive of an engine saw, instant by instant."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np

from analytic.kinematics.structure import BlockRest
from analytic.mechanism import GROUND, MASS_CENTRE, Joint, Mechanism
from analytic.mechanism.signals import DRIVE_TORQUE
from sim_models.common.guide import Guide
from sim_models.common.rates import RATE_COLUMNS
from sim_models.common.travel import slide_travel
from sim_models.engine import Watched


@dataclass(frozen=True)
class Record:
    """What the sensors saw at M instants.  Complex numbers are x + iy in the ground frame."""

    time: np.ndarray  # s (M,)
    com: Mapping[str, np.ndarray]  # m (M,) complex, by body: its centre of mass
    angle: Mapping[str, np.ndarray]  # rad (M,)
    velocity: Mapping[str, np.ndarray]  # m/s (M,) complex
    angular_velocity: Mapping[str, np.ndarray]  # rad/s (M,)
    acceleration: Mapping[str, np.ndarray]  # m/s^2 (M,) complex
    angular_acceleration: Mapping[str, np.ndarray]  # rad/s^2 (M,)
    gap: Mapping[str, np.ndarray]  # m (M,) complex, by revolute joint: first pin centre minus second; by block, across
    height: Mapping[str, np.ndarray]  # m (M,) by block with clearance: of its point across its guide
    tilt: Mapping[str, np.ndarray]  # rad (M,) by block with clearance
    force: Mapping[str, np.ndarray]  # N (M,) complex, by joint: of the first body on the second
    moment: Mapping[str, np.ndarray]  # N.m (M,) by prismatic joint: on the second body at its point
    drives: Mapping[str, np.ndarray]  # N.m, or N, (M,) of each motor, by its signal's name

    @property
    def drive_torque(self) -> np.ndarray:
        """Torque (M,) N.m of the only motor."""
        return self.drives[DRIVE_TORQUE]

    def rows(self, index: slice | np.ndarray) -> Record:
        """Some of the instants."""
        return _each([self], lambda parts: parts[0][index])

    def reach(self, joint: Joint) -> np.ndarray:
        """How far (M,) m a pin, or a block's corner that is farthest out, is from where it is in the middle."""
        guide = Guide.of(joint) if joint.name in self.tilt else None
        if guide is None:
            return np.abs(self.gap[joint.name])
        return np.asarray(guide.reach(self.height[joint.name], self.tilt[joint.name]))

    def gaps(self, joints: Iterable[str]) -> dict[str, complex | BlockRest]:
        """Where the pins and blocks of these joints are, at the only instant."""
        return {
            name: BlockRest(float(self.height[name][0]), float(self.tilt[name][0]))
            if name in self.tilt
            else complex(self.gap[name][0])
            for name in joints
        }

    def columns(self, m: Mechanism) -> dict[str, np.ndarray]:
        """Every signal of a Trace and every rate of a body (:mod:`sim_models.common.rates`), by name."""
        out = dict(self.drives)
        for body, v in self.velocity.items():
            marker, a = self.point(m, body, "com"), self.acceleration[body]
            rates = v.real, v.imag, a.real, a.imag, self.angular_acceleration[body]
            out |= {f"{body}_x": marker.real, f"{body}_y": marker.imag}
            out |= {f"{body}_angle": self.angle[body], f"{body}_angular_velocity": self.angular_velocity[body]}
            out |= zip((f"{body}: {name}" for name in RATE_COLUMNS), rates, strict=True)
        for quantity, vectors in (("reaction", self.force), ("clearance", self.gap)):
            for joint, vector in vectors.items():
                out |= {f"{quantity}_{joint}_x": vector.real, f"{quantity}_{joint}_y": vector.imag}
        out |= {f"reaction_{joint}_moment": moment for joint, moment in self.moment.items()}
        out |= {f"clearance_{joint}_angle": -tilt for joint, tilt in self.tilt.items()}
        return out

    def point(self, m: Mechanism, body: str, point: str) -> np.ndarray:
        """Path (M,) m of a body's named point."""
        return located(m, self.com, self.angle, body, point)

    def axis(self, joint: Joint) -> np.ndarray:
        """Direction (M,) of a prismatic joint's axis."""
        first = joint.bodies[0]
        return np.asarray(joint.direction * np.exp(1j * (0.0 * self.time if first == GROUND else self.angle[first])))

    def position(self, m: Mechanism, joint: Joint) -> np.ndarray:
        """Angle (M,) rad of a joint's second body less its first's; of a prismatic one, its travel (m)."""
        first, second = joint.bodies
        angle = {GROUND: np.zeros(self.time.size), **self.angle}
        if not joint.prismatic:
            return angle[second] - angle[first]
        apart = self.point(m, second, joint.name) - self.point(m, first, joint.name)
        return slide_travel(joint, apart, angle[first])


Series = TypeVar("Series", Record, Watched)


def join(records: Sequence[Series]) -> Series:
    """Records one after the other in time, which is the last axis of their arrays."""
    return _each(records, lambda parts: np.concatenate(parts, axis=-1))


def _each(records: Sequence[Series], change: Callable[[list[np.ndarray]], np.ndarray]) -> Series:
    """One record, each of whose arrays, and arrays in mappings, is made of those of all ``records``."""
    made: list[Any] = []
    for f in fields(records[0]):
        parts = [getattr(record, f.name) for record in records]
        single = isinstance(parts[0], np.ndarray)
        made.append(change(parts) if single else {name: change([p[name] for p in parts]) for name in parts[0]})
    return type(records[0])(*made)


def located(
    m: Mechanism, com: Mapping[str, np.ndarray], angle: Mapping[str, np.ndarray], body: str, point: str
) -> np.ndarray:
    """Path (m, (M,) complex) of a body's named point."""
    if body == GROUND:
        return np.full_like(next(iter(com.values())), m.ground.point(point))
    return com[body] + (m.body(body).point(point) - m.body(body).point(MASS_CENTRE)) * np.exp(1j * angle[body])
