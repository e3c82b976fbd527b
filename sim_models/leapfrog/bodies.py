"""What DART and PyBullet share: a linkage of planar bodies advanced by an engine's semi-implicit Euler step.

Both engines step ``v += a h; x += v h``.  Read as a leapfrog (velocities half a step before positions) that is second
order, and positions, forces and the mean of two velocities belong to the same instant; :class:`LeapfrogWorld` does the
reading, and applies what neither engine has: loads, joint laws, soft bearings and spring-damper clearance.  Forces keep
an error of first order in the step, because the engines reckon Coriolis forces with the velocities half a step before.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import GROUND, MASS_CENTRE, Joint
from sim_models.common.backlash import Flanks, side
from sim_models.common.contact_laws import bearing, contact_parameters
from sim_models.common.motor import motor_of
from sim_models.common.start import AT_REST, Pose
from sim_models.common.travel import travel
from sim_models.common.tree import Branch
from sim_models.engine import Cause, Request, SettingValue, SimulationError
from sim_models.leapfrog.courses import Grid
from sim_models.leapfrog.laws import JointLaws
from sim_models.leapfrog.parts import Pin
from sim_models.leapfrog.rates import centre_rates

HEEDED = 1e-7  # of the largest reaction that friction grows with: what it may still change by
HEEDINGS = 100  # times that friction is found anew from the reactions that it changes
T = TypeVar("T")
WARM_UP = 4  # steps towards the first instant


class LeapfrogWorld(ABC):
    """A linkage in an engine.  Points are complex (m), in a body's frame; velocities trail positions by half a step."""

    engine: str
    branch: Mapping[str, Branch]  # of every moving body
    one_sided = False  # whether its pins rest on rigid rims that they may leave
    by_rods = False  # whether what was last seen of such pins is that of rods of the clearance's length in their place
    settling = 1  # steps after which the engine's constraints exert what they should

    def __init__(self, request: Request) -> None:
        m = self.mechanism = request.mechanism
        self.request = request
        self.static, self.motor = request.motion == "static", motor_of(request)
        self.speed = m.speed or 0.0  # rad/s; its sign is the direction of friction and of the angles at rest, too
        self.drive_stiffness = m.drive_stiffness or 0.0  # N.m/rad; of a moving drive with backlash, its flanks'
        self.flanks: Flanks | None = None  # of a moving drive with backlash
        self.was_behind: float | None = None  # rad, its crank when the last step began
        self.held = (
            self.static or self.motor is not None
        )  # the crank's motion is prescribed: of a drive that yields, until the run begins
        self.assembly = Assembly(m)
        self.points = {(GROUND, name): m.ground.point(name) for name in m.ground.points}  # m, in the body's frame
        self.points |= {(b.name, name): b.point(name) for b in m.bodies for name in (*b.points, "com", MASS_CENTRE)}
        self.pins = {
            name: Pin(m.joint(name), clearance, contact_parameters(m, m.joint(name), request.motion))
            for name, clearance in request.clearances.items()
        }
        self.soft = {name: Pin(m.joint(name), 0.0, bearing(m, m.joint(name))) for name in request.bearings}
        self.laws = JointLaws(m, self.static, self.motor.top_speed if self.motor else abs(self.speed))
        self.grid: Grid | None = None  # of a moving run
        self.trailing = 0.0  # s by which velocities trail positions
        self.command = 0.0  # rad/s, the crank's in the next step
        self.spin_up = 0.0  # rad/s^2, the crank's while nothing is aimed at
        self.aim: float | None = (
            None  # rad: the crank's angle at the next step's end, or the angle now of a motor that it lags
        )
        self.motor_torque = 0.0  # N.m, of a drive that yields
        self.pin_forces: dict[str, complex] = {}
        self.pin_gaps: dict[str, complex] = {}  # m, of the driven pins as the last step began
        self.loads = {j.name: 0.0 for j in m.load_rubbed}  # N: reactions as last heeded, with which friction grows
        self.heeding = False  # whether every step heeds its own
        self.slide_forces: dict[str, complex] = {}  # of the prismatic joints' laws, on their second bodies

    # ---------------------------------------------------------------- what an engine provides

    @abstractmethod
    def place(self, bodies: Mapping[str, Pose]) -> None:
        """Put every moving body at its pose, velocities included; the driven body keeps its angular velocity."""

    @abstractmethod
    def pose(self, body: str) -> Pose:
        """A moving body's pose now."""

    def angle(self, body: str) -> float:
        """A moving body's angle (rad) now."""
        return self.pose(body).angle

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
    def hold(self, held: bool) -> None:
        """Prescribe the crank's motion from now on, or leave it to forces."""

    @abstractmethod
    def advance(self, h: float) -> None:
        """One step of the engine (s)."""

    @abstractmethod
    def reactions(self) -> tuple[dict[str, complex], dict[str, float], float]:
        """Of the last step: force of every joint, moment of every prismatic one, drive torque; see Trace.

        Without what :meth:`step` applied for a joint's law.
        """

    def close(self) -> None:  # noqa: B027
        """Give back what the engine holds."""

    def settled(self, evaluate: Callable[[], T], forces: Callable[[T], Mapping[str, complex]]) -> T:
        """What an evaluation gives once the friction in it is that of its own reactions (N).  Raises SimulationError
        where that does not settle.
        """
        for _ in range(HEEDINGS):
            found = evaluate()
            if not self.loads or self.heed(forces(found)):
                return found
        raise SimulationError(
            f"{self.engine}: {self.mechanism.name}: the friction that its reactions give does not settle: it is about"
            " to lock the linkage",
            Cause.NO_EQUILIBRIUM,
            "use a smaller friction_radius",
        )

    def before_observing(self) -> None:  # noqa: B027
        """Keep what reading the next step's reactions needs."""

    @property
    def compliant(self) -> bool:
        """Whether a pin's depth in its bearing is part of its equilibrium, rather than given."""
        return self.request.joint_model == "spring-damper"

    def settings(self) -> dict[str, SettingValue]:
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
        """Apply loads, joint laws, clearance forces and the motor at the positions now, and advance by h (s)."""
        self._load()
        self._steer(h)
        if self.heeding:
            self.before_observing()
        self.advance(h)
        if self.heeding:
            self.heed(self.reactions()[0])

    def _load(self) -> None:
        """Apply loads, joint laws and clearance forces at the positions now."""
        for load in self.mechanism.loads:
            if load.force != (0.0, 0.0):
                self.push(load.body, self.points[load.body, load.point], complex(*load.force))
            if load.torque:
                self.turn(load.body, load.torque)
        for joint in self.laws.joints:
            self._apply_law(joint)
        periodic, crank = self.mechanism.periodic_torque, self.mechanism.driven
        if periodic is not None:
            self.turn(crank, periodic.at(self.angle(crank)))
        if self.request.joint_model == "spring-damper":
            for name, pin in self.pins.items():
                self.pin_gaps[name], rate = self.gap(name)
                force = self.pin_forces[name] = pin.spring_damper(self.pin_gaps[name], rate)
                if force:
                    self.pull(pin.joint, force)
        for name, pin in self.soft.items():
            force = self.pin_forces[name] = pin.spring(*self.gap(name))
            self.pull(pin.joint, force)

    def heed(self, forces: Mapping[str, complex]) -> bool:
        """Take in the reactions (N) that the next steps' friction grows with; says whether they were known already."""
        now = {name: abs(forces[name]) for name in self.loads}
        change = max((abs(now[name] - load) for name, load in self.loads.items()), default=0.0)
        self.loads.update(now)
        return change <= HEEDED * max(now.values(), default=0.0)

    def _steer(self, h: float) -> None:
        """Give the crank the speed that takes it to its aim in the next step (s), or, where it lags a motor, the torque
        of that.
        """
        if self.aim is None:
            self.command += self.spin_up * h
        elif self.held:
            self.command = (self.aim - self.angle(self.mechanism.driven)) / h
        else:
            behind = self.aim - self.angle(self.mechanism.driven)
            self.motor_torque = self.drive_stiffness * behind
            if self.flanks is not None:
                rate = 0.0 if self.was_behind is None else (behind - self.was_behind) / h
                self.motor_torque, self.was_behind = self.flanks.torque(behind, rate, h), behind
            self.turn(self.mechanism.driven, self.motor_torque)

    def behind(self, torque: float) -> float:
        """How far (rad) the crank is behind a motor that gives it a torque (N.m) without end."""
        give = torque / self.drive_stiffness if self.drive_stiffness else 0.0
        return give + (side(torque) * self.mechanism.half_gap if self.mechanism.half_gap else 0.0)

    def pull(self, joint: Joint, force: complex) -> None:
        """Apply a force (N) on a joint's second body at its pin, and the opposite on the first."""
        first, second = joint.bodies
        self.push(second, self.points[second, joint.name], force)
        self.push(first, self.points[first, joint.name], -force)

    def _apply_law(self, j: Joint) -> None:
        first, second = j.bodies
        a, b = self._any_pose(first), self._any_pose(second)
        way, rate = travel(self.mechanism, j, a, b)
        if not j.prismatic:
            torque = self.laws.effort(j, way, rate, self.loads.get(j.name, 0.0))
            self.turn(second, torque)
            self.turn(first, -torque)
            return
        along = j.direction * np.exp(1j * a.angle)
        force = self.slide_forces[j.name] = self.laws.effort(j, way, rate) * along
        self.push(second, self.points[second, j.name], force)
        self.push(first, self.points[first, j.name] + way * j.direction, -force)

    def _any_pose(self, body: str) -> Pose:
        return AT_REST if body == GROUND else self.pose(body)

    def observe(self, h: float) -> dict[str, float]:
        """Advance by h (s) and return every signal, and every body's rates, at the instant from which the step
        started.
        """
        names = [b.name for b in self.mechanism.bodies]
        here = {name: self.pose(name) for name in names}
        gaps = {j.name: self.gap(j.name)[0] for j in self.mechanism.joints if not j.prismatic}
        self.before_observing()
        self.step(h)
        forces, moments, torque = self.reactions()
        lag = self.trailing / h
        out: dict[str, float] = {"drive_torque": torque if self.held else self.motor_torque}
        for name in names:
            com = here[name].origin + self.points[name, "com"] * np.exp(1j * here[name].angle)
            spin = here[name].angular_velocity * (1 - lag) + self.pose(name).angular_velocity * lag
            out |= {
                f"{name}_x": com.real,
                f"{name}_y": com.imag,
                f"{name}_angle": here[name].angle,
                f"{name}_angular_velocity": spin,
            }
        for name, gap in gaps.items():
            out |= {f"clearance_{name}_x": gap.real, f"clearance_{name}_y": gap.imag}
        for name, force in forces.items():
            force += self.slide_forces.get(name, 0j)  # a slide's reaction holds its friction, damper and spring too
            out |= {f"reaction_{name}_x": force.real, f"reaction_{name}_y": force.imag}
        out |= {f"reaction_{name}_moment": moment for name, moment in moments.items()}
        after = None if self.static else {name: self.pose(name) for name in names}
        return out | centre_rates(self.mechanism, self.branch.values(), here, after, h, self.trailing)

    def start(
        self,
        bodies: Mapping[str, Pose],
        h: float,
        spin_up: float = 0.0,
        aims: Sequence[float | None] = (None,) * WARM_UP,
    ) -> None:
        """Place the bodies and take their velocities half a step (s) back, as a leapfrog wants them.

        Engines close loops and contacts by the drift and speed at a step's beginning, so a few steps must have been
        made towards the poses for the next one to accelerate as it should.  ``spin_up`` is the crank's acceleration
        (rad/s^2), ``aims`` (WARM_UP,) are those of the steps towards the poses.
        """
        self.aim = None
        self.approach(bodies, h, spin_up)
        before = self.velocities()
        self.step(h)
        change = self.velocities() - before
        self.place(bodies)
        speeds = self.velocities()
        self.shift(-WARM_UP * h * (speeds - WARM_UP / 2 * change))
        self.set_velocities(speeds - (WARM_UP + 0.5) * change)
        self.spin_up = 0.0
        for self.aim in aims:
            self.step(h)
        self.trailing = h / 2

    def approach(self, bodies: Mapping[str, Pose], h: float, spin_up: float = 0.0) -> None:
        """Place the bodies a few steps (s) before these poses, and step; the crank accelerates by ``spin_up``
        (rad/s^2).
        """
        self.place(bodies)
        self.spin_up = spin_up
        self.command -= (self.settling - 1) * spin_up * h
        self.shift(-self.settling * h * self.velocities())
        for _ in range(self.settling):
            self.step(h)
