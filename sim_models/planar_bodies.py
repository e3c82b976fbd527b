"""What DART and PyBullet share: a linkage of planar bodies advanced by an engine's semi-implicit Euler step.

Both engines step ``v += a h; x += v h``.  Read as a leapfrog (velocities half a step before positions) that is second
order, and positions, forces and the mean of two velocities belong to the same instant; :class:`PlanarWorld` does the
reading, and applies what neither engine has: loads, joint laws and spring-damper clearance.  Forces keep an error of
first order in the step, because the engines reckon Coriolis forces with the velocities half a step before.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from analytic.assembly import Assembly
from analytic.mechanism import GROUND, Joint
from sim_models.contact_laws import contact_parameters
from sim_models.engine import Request, Unsupported
from sim_models.planar_parts import AT_REST, Branch, Pin, moving_body, travel_of
from sim_models.start import Pose, poses

PROBE = 1e-5  # s, the step from which accelerations are read
SLIDING_ZONE = 1e-3  # of the drive's speed: relative speed below which Coulomb friction fades out
FREE_SPEED = 1.0  # rad/s, in its place where nothing is driven
STEP_ANGLE = 2e-4  # rad of crank angle in a step, at most
FREE_STEP = 2e-5  # s
WARM_UP = 4  # steps towards the first instant
CONTACT_PHASE = 0.3  # rad of a contact's own oscillation in a step, at most
SWING_PHASE = 0.2  # rad of a pin's swing along its bearing in a step, at most
CONTACT_DECAY = 0.6  # of a contact's own relaxation in a step, at most


class PlanarWorld(ABC):
    """A linkage in an engine.  Points are complex (m), in a body's frame; velocities trail positions by half a step."""

    engine: str
    branch: Mapping[str, Branch]  # of every moving body
    settling = 1  # steps after which the engine's constraints exert what they should

    def __init__(self, request: Request) -> None:
        m = request.mechanism
        if m.drive is not None and m.drive.stiffness is not None:
            raise Unsupported(f"{self.engine} drives the crank rigidly: leave out drive.stiffness = {m.drive.stiffness:g} N.m/rad")
        if m.drive is not None and m.drive.speed == "measured" and request.motion == "driven":
            raise Unsupported(f"{self.engine} does not follow a measured drive; give drive.speed in rad/s, or 'free'")
        self.request = request
        self.mechanism = m
        self.static = request.motion == "static"
        self.speed = m.speed or 0.0
        self.held = self.static or m.speed is not None  # the crank's motion is prescribed
        self.assembly = Assembly(m)
        self.points = {(GROUND, name): m.ground.point(name) for name in m.ground.points}  # m, in the body's frame
        self.points |= {(b.name, name): b.point(name) for b in m.bodies for name in (*b.points, "com")}
        self.pins = {
            j.name: Pin(j, j.clearance, contact_parameters(m, j, request.motion))
            for j in m.joints
            if j.clearance > 0 and request.joint_model != "ideal"
        }
        rough = [pin.joint for pin in self.pins.values() if pin.joint.friction]
        if rough:
            raise Unsupported(
                f"{self.engine} has no friction in contact: leave out friction = {rough[0].friction:g} of joint {rough[0].name!r}, or use mujoco"
            )
        self.laws = [j for j in m.joints if j.coulomb or j.damping or j.stiffness]
        self.trailing = 0.0  # s by which velocities trail positions
        self.pin_forces: dict[str, complex] = {}
        self.slide_forces: dict[str, complex] = {}  # of the prismatic joints' laws, on their second bodies
        self.sliding: dict[str, float] = {}  # direction of each joint's sliding where nothing moves
        zone = SLIDING_ZONE * abs(self.speed or FREE_SPEED)
        self.zone = {j.name: zone * (moving_body(m, m.driven).length if j.prismatic else 1.0) for j in m.joints}

    # ---------------------------------------------------------------- what an engine provides

    @abstractmethod
    def place(self, bodies: Mapping[str, Pose]) -> None:
        """Put every moving body at its pose, velocities included; the driven body keeps its angular velocity."""

    @abstractmethod
    def pose(self, body: str) -> Pose:
        """A moving body's pose now."""

    @abstractmethod
    def gap(self, joint: str) -> tuple[complex, complex]:
        """First pin centre minus second (m) and its rate (m/s), now."""

    @abstractmethod
    def velocities(self) -> np.ndarray:
        """The engine's own velocities (n,)."""

    @abstractmethod
    def set_velocities(self, velocities: np.ndarray) -> None:
        """Replace the engine's own velocities (n,)."""

    @abstractmethod
    def shift(self, change: np.ndarray) -> None:
        """Move the engine's own positions by velocity times time (n,)."""

    @abstractmethod
    def push(self, body: str, point: complex, force: complex) -> None:
        """Apply a force (N, ground frame) at a point of a body during the next step; the ground takes it."""

    @abstractmethod
    def turn(self, body: str, torque: float) -> None:
        """Apply a torque (N.m) on a body during the next step; the ground takes it."""

    @abstractmethod
    def advance(self, h: float) -> None:
        """One step of the engine (s)."""

    @abstractmethod
    def reactions(self) -> tuple[dict[str, complex], dict[str, float], float]:
        """Of the last step: force of every joint, moment of every prismatic one, drive torque; see Trace.

        Without what :meth:`step` applied for a joint's law.
        """

    def coordinates(self, branch: Branch, bodies: Mapping[str, Pose]) -> tuple[list[float], list[float]]:
        """A branch's coordinates and their rates: [travel], [relative angle], or [x, y, angle] of the body's frame."""
        here = bodies[branch.child]
        if branch.joint is None:
            return [here.origin.real, here.origin.imag, here.angle], [here.velocity.real, here.velocity.imag, here.angular_velocity]
        if branch.joint.prismatic:
            a, b = (bodies.get(name, AT_REST) for name in branch.joint.bodies)
            travel, rate = travel_of(self.mechanism, branch.joint, a, b)
            return [travel], [rate]
        base = bodies.get(branch.parent, AT_REST)
        return [here.angle - base.angle], [here.angular_velocity - base.angular_velocity]

    def close(self) -> None:  # noqa: B027
        """Give back what the engine holds."""

    def before_observing(self) -> None:  # noqa: B027
        """Keep what reading the next step's reactions needs."""

    @property
    def compliant(self) -> bool:
        """Whether a pin's depth in its bearing is part of its equilibrium, rather than given."""
        return self.request.joint_model == "spring-damper"

    def settings(self) -> dict[str, Any]:
        """The numbers used, for Trace."""
        if not self.compliant or not self.pins:
            return {}
        contacts = [pin.contact for pin in self.pins.values()]
        return {
            "contact_law": "Kelvin-Voigt, max(0, K d + C d')",
            "contact_stiffness": min(c.stiffness for c in contacts),
            "contact_damping": max(c.damping for c in contacts),
        }

    # ---------------------------------------------------------------- stepping

    def step(self, h: float) -> None:
        """Apply loads, joint laws and clearance forces at the positions now, and advance by h (s)."""
        for load in self.mechanism.loads:
            if load.force != (0.0, 0.0):
                self.push(load.body, self.points[load.body, load.point], complex(*load.force))
            if load.torque:
                self.turn(load.body, load.torque)
        for joint in self.laws:
            self._apply_law(joint)
        if self.request.joint_model == "spring-damper":
            for name, pin in self.pins.items():
                force = self.pin_forces[name] = pin.spring_damper(*self.gap(name))
                if force:
                    self._pull(pin.joint, force)
        self.advance(h)

    def _pull(self, joint: Joint, force: complex) -> None:
        """Apply a force (N) on a joint's second body at its pin, and the opposite on the first."""
        first, second = joint.bodies
        self.push(second, self.points[second, joint.name], force)
        self.push(first, self.points[first, joint.name], -force)

    def _apply_law(self, j: Joint) -> None:
        first, second = j.bodies
        a, b = self._any_pose(first), self._any_pose(second)
        if not j.prismatic:
            torque = self._law(j, b.angle - a.angle, b.angular_velocity - a.angular_velocity)
            self.turn(second, torque)
            self.turn(first, -torque)
            return
        travel, rate = travel_of(self.mechanism, j, a, b)
        along = j.direction * np.exp(1j * a.angle)
        force = self.slide_forces[j.name] = self._law(j, travel, rate) * along
        self.push(second, self.points[second, j.name], force)
        self.push(first, self.points[first, j.name] + travel * j.direction, -force)

    def _law(self, j: Joint, position: float, rate: float) -> float:
        """Torque (N.m; prismatic: force, N) of friction, damper and spring on the second body."""
        slip = self.sliding.get(j.name, 0.0) if self.static else max(-1.0, min(1.0, rate / self.zone[j.name]))
        damping = 0.0 if self.static else j.damping * rate
        return -j.coulomb * slip - damping - j.stiffness * (position - j.rest_angle)

    def _any_pose(self, body: str) -> Pose:
        return AT_REST if body == GROUND else self.pose(body)

    def observe(self, h: float) -> dict[str, float]:
        """Advance by h (s) and return every signal at the instant from which the step started."""
        names = [b.name for b in self.mechanism.bodies]
        here = {name: self.pose(name) for name in names}
        gaps = {j.name: self.gap(j.name)[0] for j in self.mechanism.joints if not j.prismatic}
        self.before_observing()
        before = self.velocities()
        self.step(h)
        forces, moments, torque = self.reactions()
        lag = self.trailing / h
        out: dict[str, float] = {"drive_torque": torque}
        for name in names:
            com = here[name].origin + self.points[name, "com"] * np.exp(1j * here[name].angle)
            spin = here[name].angular_velocity * (1 - lag) + self.pose(name).angular_velocity * lag
            out |= {f"{name}_x": com.real, f"{name}_y": com.imag, f"{name}_angle": here[name].angle, f"{name}_angular_velocity": spin}
        for name, gap in gaps.items():
            out |= {f"clearance_{name}_x": gap.real, f"clearance_{name}_y": gap.imag}
        for name, force in forces.items():
            force += self.slide_forces.get(name, 0j)  # a slide's reaction holds its friction, damper and spring too
            out |= {f"reaction_{name}_x": force.real, f"reaction_{name}_y": force.imag}
        out |= {f"reaction_{name}_moment": moment for name, moment in moments.items()}
        if 0 < self.trailing != h / 2:  # the step's size has changed: trail by half the new one
            after = self.velocities()
            self.set_velocities(after + (after - before) * (lag - 0.5))
            self.trailing = h / 2
        return out

    def start(self, bodies: Mapping[str, Pose], h: float) -> None:
        """Place the bodies and take their velocities half a step (s) back, as a leapfrog wants them.

        Engines close loops and contacts by the drift and speed at a step's beginning, so a few steps must have been made
        towards the poses for the next one to accelerate as it should.
        """
        self.approach(bodies, h)
        before = self.velocities()
        self.step(h)
        change = self.velocities() - before
        self.place(bodies)
        speeds = self.velocities()
        self.shift(-WARM_UP * h * (speeds - WARM_UP / 2 * change))
        self.set_velocities(speeds - (WARM_UP + 0.5) * change)
        for _ in range(WARM_UP):
            self.step(h)
        self.trailing = h / 2

    def approach(self, bodies: Mapping[str, Pose], h: float) -> None:
        """Place the bodies a few steps (s) before these poses, and step."""
        self.place(bodies)
        self.shift(-self.settling * h * self.velocities())
        for _ in range(self.settling):
            self.step(h)

    def longest_step(self, theta: float, peaks: Mapping[str, float]) -> float:
        """Step (s) that follows the crank and every pin: its swing about the bearing, and its spring's oscillation.

        ``theta`` (rad) is the crank angle at which the pins' effective masses are taken, ``peaks`` their largest forces (N).
        """
        step = STEP_ANGLE / abs(self.speed) if self.speed else FREE_STEP
        for name, pin in self.pins.items():
            mass = self.pin_mass(pin.joint, theta)
            step = min(step, SWING_PHASE * math.sqrt(mass * pin.clearance / max(peaks[name], 1e-300)))
            if self.compliant:
                step = min(step, CONTACT_PHASE * math.sqrt(mass / pin.contact.stiffness), CONTACT_DECAY * mass / max(pin.contact.damping, 1e-300))
        return step

    def pin_mass(self, joint: Joint, theta: float) -> float:
        """Least effective mass (kg) that a joint's gap opposes to a force, at crank angle theta (rad)."""
        bodies = poses(self.assembly, theta)
        changes = []
        for force in [0j, *np.exp(1j * np.linspace(0, np.pi, 8, endpoint=False))]:
            self.place(bodies)
            self._pull(joint, complex(force))
            self.advance(PROBE)
            changes.append(self.gap(joint.name)[1])
        return PROBE / float(np.abs(np.array(changes[1:]) - changes[0]).max())

    # ---------------------------------------------------------------- equilibria

    def ideal_forces(self, theta: float, speed: float) -> dict[str, complex]:
        """Reactions (N) that a linkage of the same engine has with its pins centred."""
        self.approach(poses(self.assembly, theta, speed), PROBE)
        self.before_observing()
        self.step(PROBE)
        return self.reactions()[0]

    def set_sliding(self, theta: float) -> None:
        """Let static friction oppose the ideal motion in the drive's direction at this crank angle (rad)."""
        if not any(j.coulomb for j in self.laws):
            return
        moving = poses(self.assembly, theta, -1.0 if self.speed < 0 else 1.0) | {GROUND: AT_REST}
        for j in self.laws:
            a, b = (moving[name] for name in j.bodies)
            rate = travel_of(self.mechanism, j, a, b)[1] if j.prismatic else b.angular_velocity - a.angular_velocity
            self.sliding[j.name] = float(np.sign(round(rate, 9)))

    def gap_accelerations(self, bodies: Mapping[str, Pose]) -> dict[str, complex]:
        """Acceleration (m/s^2) of every pin's gap from these poses and velocities."""
        self.approach(bodies, PROBE)
        before = {name: self.gap(name)[1] for name in self.pins}
        self.step(PROBE)
        return {name: (self.gap(name)[1] - before[name]) / PROBE for name in self.pins}
