"""A watched run in the words of contact: how each pin moves in its bearing and each block in its guide, how walls push
them, and the run's energy.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Joint, Mechanism
from analytic.mechanism.varying import Seen
from sim_models.common.free_share import OFF_WALL
from sim_models.common.guide import Guide
from sim_models.engine import Watched

NO_GAP = 1e-300  # m, in place of a gap of nothing
SLOW_TURNING = 1e-2  # of a joint's fastest turning: friction is not reckoned with below, where engines let it fade


def dot(a: np.ndarray, b: np.ndarray | complex) -> np.ndarray:
    """Inner product of vectors a and b, (M,)."""
    return np.asarray((np.conj(a) * b).real)


def integral(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Integral (M,) of values (M,) over time (M,) s from the first instant, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2 * np.diff(time))])


@dataclass(frozen=True)
class ContactHistory:
    """A pin in its bearing, or a block's corner before its wall, over a run, (M,) instants.

    ``reach`` (m) is how far out it is, and at the wall the ``clearance``; ``rate`` (m/s) how fast that grows, ``push``
    (N) the normal force, ``rub`` (N) friction on the second body along the wall and ``slip`` (m/s) how the second body
    slides there on the first.  ``wall`` (m) is where it begins to be pushed, ``stiffness`` (N/m) the wall's; 0 if it is
    none.
    """

    reach: np.ndarray
    rate: np.ndarray
    push: np.ndarray
    rub: np.ndarray
    slip: np.ndarray
    clearance: float
    wall: float
    stiffness: float

    @property
    def free(self) -> np.ndarray:
        """Where (M,) it is off its wall, as :func:`sim_models.common.free_share.free_share` has it."""
        return self.reach < self.wall * (1 - OFF_WALL)

    @property
    def touching(self) -> np.ndarray:
        """Where (M,) it is at its wall or pushed."""
        return (self.reach >= self.wall) | (self.push > 0)

    @property
    def depth(self) -> np.ndarray:
        """How deep (M,) m it is in its wall; 0 where it is off."""
        return np.maximum(self.reach - self.clearance, 0.0)

    @property
    def stored(self) -> np.ndarray:
        """Energy (M,) J that the wall's spring has taken up, and gives back."""
        return self.stiffness * self.depth**2 / 2

    @property
    def size(self) -> np.ndarray:
        """Size (M,) N of the force."""
        return np.asarray(np.hypot(self.push, self.rub))


@dataclass(frozen=True)
class JointPlay:
    """What has clearance in one joint, over a run: a pin, which is one contact, or a block, each corner of which is.

    ``gap`` (m) is (M,) complex: of a pin the first pin centre minus the second; of a block its height across the guide,
    and i times its tilt times half its length: where the two together are as much as the clearance, a corner is at
    its wall.
    """

    gap: np.ndarray
    drift: np.ndarray  # m/s, complex: rate of the gap
    contacts: tuple[ContactHistory, ...]

    @property
    def clearance(self) -> float:
        """How far (m) it can go."""
        return self.contacts[0].clearance

    @property
    def wall(self) -> float:
        """Where (m) it begins to be pushed."""
        return self.contacts[0].wall

    @property
    def reach(self) -> np.ndarray:
        """How far out (M,) m it is: of a block, its corner that is farthest out."""
        return np.asarray(np.max([touch.reach for touch in self.contacts], axis=0))

    @property
    def free(self) -> np.ndarray:
        """Where (M,) nothing of it is at its wall."""
        return np.all([touch.free for touch in self.contacts], axis=0)

    @property
    def size(self) -> np.ndarray:
        """Size (M,) N of the largest of its forces."""
        return np.asarray(np.max([touch.size for touch in self.contacts], axis=0))


class WatchedRun:
    """A watched run of a linkage with a crank, at its M instants.  Complex numbers are x + iy in the ground frame."""

    def __init__(self, mechanism: Mechanism, watched: Watched) -> None:
        self.m, self.watched, self.time = mechanism, watched, watched.time
        self.turned = np.abs(watched.angle[mechanism.driven] - watched.angle[mechanism.driven][0])  # rad

    def arm(self, body: str, point: str) -> np.ndarray:
        """From a body's centre of mass, or the ground's origin, to one of its points, (M,) m."""
        if body == GROUND:
            return np.full(self.time.size, self.m.ground.point(point))
        here = self.m.moving[body]
        return (here.point(point) - here.point(MASS_CENTRE)) * np.exp(1j * self.watched.angle[body])

    def place(self, body: str, point: str) -> np.ndarray:
        """Where a body's point is, (M,) m."""
        return self.arm(body, point) + (0.0 if body == GROUND else self.watched.place[body])

    def velocity(self, body: str, arm: np.ndarray) -> np.ndarray:
        """Velocity (M,) m/s of a body at an arm (M,) m from its centre of mass."""
        if body == GROUND:
            return np.zeros(self.time.size, complex)
        return self.watched.velocity[body] + 1j * self.spin(body) * arm

    def going(self, body: str, point: str) -> np.ndarray:
        """Velocity (M,) m/s of a body's point."""
        return self.velocity(body, self.arm(body, point))

    def spin(self, body: str) -> np.ndarray:
        """Angular velocity (M,) rad/s of a body."""
        return np.zeros(self.time.size) if body == GROUND else self.watched.angular_velocity[body]

    def angle(self, body: str) -> np.ndarray:
        """Angle (M,) rad of a body."""
        return np.zeros(self.time.size) if body == GROUND else self.watched.angle[body]

    def course(self, joint: Joint, margin: float = 0.0, stiffness: float = 0.0) -> JointPlay:
        """What has clearance in a joint; it begins to be pushed a ``margin`` (m) before its wall of this ``stiffness``
        (N/m).
        """
        guide = Guide.of(joint)
        return self._pin(joint, margin, stiffness) if guide is None else self._block(joint, guide, margin, stiffness)

    def _pin(self, joint: Joint, margin: float, stiffness: float) -> JointPlay:
        first, second = joint.bodies
        arms = [self.arm(body, joint.name) for body in joint.bodies]
        gap = self.place(first, joint.name) - self.place(second, joint.name)
        drift = self.velocity(first, arms[0]) - self.velocity(second, arms[1])
        outwards = gap / np.maximum(np.abs(gap), NO_GAP)
        rim = outwards * (joint.rim + joint.clearance)
        slip = self.velocity(second, arms[1] + rim) - self.velocity(first, arms[0] - gap + rim)
        force = self.watched.force[joint.name]
        touch = ContactHistory(
            reach=np.abs(gap),
            rate=dot(outwards, drift),
            push=dot(outwards, force),
            rub=dot(1j * outwards, force),
            slip=dot(1j * outwards, slip),
            clearance=joint.clearance,
            wall=joint.clearance - margin,
            stiffness=stiffness,
        )
        return JointPlay(gap, drift, (touch,))

    def _block(self, joint: Joint, guide: Guide, margin: float, stiffness: float) -> JointPlay:
        first, second = joint.bodies
        along, arm = joint.direction * np.exp(1j * self.angle(first)), self.arm(second, joint.name)
        apart = self.place(second, joint.name) - self.place(first, joint.name)
        height, tilt = dot(1j * along, apart), self.angle(second) - self.angle(first) - joint.angle
        below, turned = self.arm(first, joint.name) + apart, along * np.exp(1j * tilt)

        def moving(corner: complex) -> np.ndarray:
            """Velocity (M,) m/s of what is so far (m) from the block's point, over the guide's material there."""
            away = corner * turned
            return self.velocity(second, arm + away) - self.velocity(first, below + away)

        corners = self.watched.corners[joint.name]
        rubbing = self.watched.rubbing.get(joint.name, np.zeros_like(corners))
        touches = [
            ContactHistory(
                reach=depth + joint.clearance,
                rate=dot(np.sign(corner.imag) * 1j * along, moving(corner)),
                push=push,
                rub=rub,
                slip=dot(along, moving(corner)),
                clearance=joint.clearance,
                wall=joint.clearance - margin,
                stiffness=stiffness,
            )
            for corner, depth, push, rub in zip(
                guide.corners, guide.depths(height, tilt), corners, rubbing, strict=True
            )
        ]
        turning = guide.length / 2 * (self.spin(second) - self.spin(first))
        drift = dot(1j * along, moving(0j)) + 1j * turning
        return JointPlay(height + 1j * guide.length / 2 * tilt, drift, tuple(touches))

    # ---------------------------------------------------------------- energy

    @cached_property
    def kinetic(self) -> np.ndarray:
        """Kinetic energy (M,) J of all bodies."""
        w = self.watched
        return np.sum(
            [
                (b.mass * np.abs(w.velocity[b.name]) ** 2 + b.moment_of_inertia * w.angular_velocity[b.name] ** 2) / 2
                for b in self.m.bodies
            ],
            axis=0,
        )

    @cached_property
    def motor(self) -> np.ndarray:
        """Power (M,) W of the motor."""
        return self.watched.torque * self.spin(self.m.driven)

    @cached_property
    def applied(self) -> np.ndarray:
        """Power (M,) W of gravity, loads, springs between points and what turns the crank over its angle."""
        m, w = self.m, self.watched
        power = sum((b.mass * dot(w.velocity[b.name], complex(*m.gravity)) for b in m.bodies), np.zeros(self.time.size))
        for load in m.loads:
            force, torque = m.acting(load, Seen(self.angle, self.place, self.going, self.spin, lambda: self.time))
            power = power + dot(self.going(load.body, load.point), force) + torque * self.spin(load.body)
        for spring in m.springs:
            near, far = spring.ends
            moving = [self.velocity(body, self.arm(body, point)) for body, point in (near, far)]
            pull = spring.pull(self.place(*far) - self.place(*near), moving[1] - moving[0])
            power = power + dot(moving[0] - moving[1], pull)
        if m.periodic_torque is not None:
            power = power + m.periodic_torque.at(self.angle(m.driven)) * self.spin(m.driven)
        return power

    @cached_property
    def joints(self) -> np.ndarray | None:
        """Power (M,) W that springs, dampers and friction of the joints take; None where friction grows with reactions
        that were not watched.
        """
        power = np.zeros(self.time.size)
        for joint in self.m.joints:
            if not joint.has_law:
                continue
            if joint.load_coefficient:
                return None
            position, rate = self._moved(joint)
            dry = joint.dry(rate) * np.clip(rate / (SLOW_TURNING * float(np.abs(rate).max()) or 1.0), -1, 1)
            power = power - (joint.give(position, rate) - dry) * rate
        return power

    def _moved(self, joint: Joint) -> tuple[np.ndarray, np.ndarray]:
        """Position (M,) rad, m of a joint and its rate."""
        first, second = joint.bodies
        if not joint.prismatic:
            return self.angle(second) - self.angle(first), self.spin(second) - self.spin(first)
        along = joint.direction * np.exp(1j * self.angle(first))
        apart = self.place(second, joint.name) - self.place(first, joint.name)
        there = self.arm(first, joint.name) + apart  # the first body's material where the second's point is
        slip = self.velocity(second, self.arm(second, joint.name)) - self.velocity(first, there)
        return dot(along, apart), dot(along, slip)


def taken(courses: Mapping[str, JointPlay]) -> np.ndarray:
    """Power (M,) W that the contacts take, by normal forces and by friction; what walls store is among it."""
    touches = [touch for course in courses.values() for touch in course.contacts]
    return np.sum([touch.push * touch.rate - touch.rub * touch.slip for touch in touches], axis=0)
