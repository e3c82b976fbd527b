"""What DART and PyBullet share: a linkage of planar bodies advanced by an engine's semi-implicit Euler step.

Both engines step ``v += a h; x += v h``.  Read as a leapfrog (velocities half a step before positions) that is second
order, and positions, forces and the mean of two velocities belong to the same instant; :class:`LeapfrogWorld` does the
reading, and applies what neither engine has: loads, springs between points, joint laws, soft bearings and spring-damper
clearance, of pins and of blocks in their guides.  Forces keep an error of first order in the step, because the engines
reckon Coriolis forces with the velocities half a step before.  With one crank that stays; where several motors, or
none, move a linkage it is made up for, because what moves freely would be led astray by it.
"""

from __future__ import annotations

import cmath
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence, Set
from functools import cached_property, partial
from typing import TypeVar

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Joint, Spring
from analytic.mechanism.signals import DRIVE_TORQUE, driving
from analytic.mechanism.varying import NEVER, Seen
from sim_models.common.backlash import Flanks, side
from sim_models.common.contact_laws import bearing, contact_parameters, longest, named_law
from sim_models.common.fading import fading
from sim_models.common.mobility import mobility
from sim_models.common.rates import rate_columns
from sim_models.common.start import AT_REST, Pose
from sim_models.common.track import Track
from sim_models.common.travel import travel
from sim_models.common.tree import Branch
from sim_models.engine import Cause, Request, SettingValue, SimulationError
from sim_models.leapfrog.balance import ForceBalance
from sim_models.leapfrog.block import LeapfrogBlock, Touch, law_settings
from sim_models.leapfrog.laws import JointLaws
from sim_models.leapfrog.parts import STILL, BranchMotion, Pin, Steered, coordinates, moving_body, spanning_tree, tracks
from sim_models.leapfrog.striking import LeapfrogStriking
from sim_models.run.grid import StepGrid
from sim_models.run.path import Path

FRICTION_LEFT = 1e-7  # of the largest reaction that friction grows with: what it may still change by
FRICTION_ROUNDS = 100  # times that friction is found anew from the reactions that it changes
T = TypeVar("T")
WARM_UP = 4  # steps towards the first instant


class LeapfrogWorld(ABC):
    """A linkage in an engine.  Points are complex (m), in a body's frame; velocities trail positions by half a step."""

    engine: str
    branches: list[Branch]  # of every moving body, parents first
    branch: Mapping[str, Branch]  # the same by body
    steered: tuple[Steered, ...] = ()  # what motors move, or, of a crank that is let go, would
    one_sided = False  # whether its pins rest on rigid rims that they may leave
    balances = False  # whether reactions are found by each body's balance
    looks_back = False  # whether what its motor exerts is read with the poses before the step
    settling = 1  # steps after which the engine's constraints exert what they should

    def __init__(self, request: Request, path: Path) -> None:
        m = self.mechanism = request.mechanism
        self.request, self.path = request, path
        self.static = request.motion == "static"
        self.speed = m.speed or 0.0  # rad/s; its sign is the direction of friction and of the angles at rest, too
        self.drive_stiffness = m.drive_stiffness or 0.0  # N.m/rad; of a moving drive with backlash, its flanks'
        self.flanks: Flanks | None = None  # of a moving drive with backlash
        self.was_behind: float | None = None  # rad, its crank when the last step began
        # Whether what motors move is prescribed: of a drive that yields, until the run begins
        self.held = self.static or not request.schedule.lets_go
        self.points = {(GROUND, name): m.ground.point(name) for name in m.ground.points}  # m, in the body's frame
        self.points |= {(b.name, name): b.point(name) for b in m.bodies for name in (*b.points, "com", MASS_CENTRE)}
        self.pins = {
            name: Pin(j, clearance, contact_parameters(m, j, request.motion), named_law(m, j, request.motion))
            for name, clearance in request.clearances.items()
            for j in [m.joint(name)]
            if not j.prismatic
        }
        self.blocks = {
            name: LeapfrogBlock.of(m, m.joint(name), request.motion, self._yields)
            for name in request.clearances
            if m.joint(name).prismatic
        }
        named = {name: pin.law for name, pin in self.pins.items() if pin.law is not None and self.compliant}
        self.striking = {
            name: LeapfrogStriking(law, self.pins[name].clearance, partial(self._yields, self.pins[name].joint))
            for name, law in named.items()
        }
        self.soft = {name: Pin(m.joint(name), 0.0, bearing(m, m.joint(name))) for name in request.bearings}
        self.crank = request.schedule.crank is not None  # whether a crank moves it, or would
        reach = moving_body(m, m.driven).length if self.crank else longest(m)
        driven = self.held and not self.static
        self.laws = JointLaws(m, self.static, path.top_speed if driven else abs(self.speed), reach)
        self.heading: Mapping[str, Pose] = {}  # at rest: bodies in the motion that dry friction and loads oppose
        self.fades = [NEVER if self.held else fading(m, load) for load in m.loads]
        self.clock = 0.0  # s, of the run
        self.grid: StepGrid | None = None  # of a moving run
        self.free = not (self.crank or path.held)  # in part
        # Whether inertia forces are put right (see _catch_up): not where pins need such short steps that it is no gain
        self.makes_up = not self.crank and (self.free or not self.loose)
        self.trailing = 0.0  # s by which velocities trail positions
        self.commands: list[float] = []  # rad/s, m/s, of what is steered in the next step
        self.spin_up: Sequence[float] = ()  # rad/s^2, m/s^2, the same while nothing is aimed at
        # rad, m: where what is steered is at the next step's end, or the angle now of a motor that the crank lags
        self.aim: Sequence[float] | None = None
        self.motor_torque = 0.0  # N.m, of a drive that yields
        self.pin_forces: dict[str, complex] = {}  # N, and of walls on blocks
        self.block_moments: dict[str, float] = {}  # N.m, of walls on blocks about their points
        self.touches: dict[str, tuple[Touch, ...]] = {}  # of walls and blocks
        # What walls do while a start is probed, whose steps are longer than such light corners would bear
        self.walls: dict[str, tuple[Touch, ...]] = {}
        self.block_seats: dict[str, complex] = {}  # m, and i times rad, as the last step began
        self.pin_gaps: dict[str, complex] = {}  # m, of the driven pins as the last step began
        self.loads = {j.name: 0.0 for j in m.load_rubbed}  # N: how hard they are pressed, as last heeded
        self.heeding = False  # whether every step heeds its own
        self.slide_forces: dict[str, complex] = {}  # of the prismatic joints' laws, on their second bodies
        self.late: dict[str, np.ndarray] = {}  # rates of each body's coordinates as the engine has them
        self.now: dict[str, Pose] = {}  # with velocities of this instant, where they are reckoned
        self.before: dict[str, Pose] = {}  # as the last step began that was to be read
        # force (N), and moment (N.m) about the centre of mass, on each body: for the next step, and in the last one
        self.applied: dict[str, tuple[complex, float]] = {}
        self.was_applied: dict[str, tuple[complex, float]] = {}
        self.last_step = 0.0  # s

    @property
    def loose(self) -> tuple[str, ...]:
        """The joints with clearance: pins, then blocks."""
        return (*self.pins, *self.blocks)

    @property
    def closed(self) -> list[Joint]:
        """The joints that are ideal."""
        return [j for j in self.mechanism.joints if j.name not in self.loose and j.name not in self.soft]

    # ---------------------------------------------------------------- what an engine provides

    @abstractmethod
    def place(self, bodies: Mapping[str, Pose]) -> None:
        """Put every moving body at its pose, velocities included; what is steered keeps its speed."""

    @abstractmethod
    def pose(self, body: str) -> Pose:
        """A moving body's pose now."""

    def angle(self, body: str) -> float:
        """A moving body's angle (rad) now."""
        return self.pose(body).angle

    @abstractmethod
    def coordinate(self, body: str) -> float:
        """Where a moving body is on what carries it (rad, m): the last of the coordinates of its branch, now."""

    @abstractmethod
    def gap(self, joint: str) -> tuple[complex, complex]:
        """First pin centre minus second (m) and its rate (m/s), now."""

    @abstractmethod
    def velocities(self) -> np.ndarray:
        """The engine's own velocities (n,)."""

    @abstractmethod
    def positions(self) -> np.ndarray:
        """The engine's own positions (n,), which :meth:`velocities` are the rates of."""

    @abstractmethod
    def columns(self, body: str) -> list[int]:
        """Which of them are the coordinates of a moving body's branch, in the order of
        :func:`sim_models.leapfrog.parts.coordinates`.
        """

    @abstractmethod
    def effort(self) -> float:
        """What the motor exerted on the driven body in the last step (N.m), as the engine has it, while it is held."""

    @abstractmethod
    def set_velocities(self, velocities: np.ndarray) -> None:
        """Replace the engine's own velocities (n,)."""

    @abstractmethod
    def shift(self, change: np.ndarray) -> None:
        """Move the engine's own positions by velocity times time (n,)."""

    @abstractmethod
    def press(self, body: str, point: complex, force: complex) -> None:
        """Apply a force (N, ground frame) at a point of a moving body during the next step."""

    @abstractmethod
    def twist(self, body: str, torque: float) -> None:
        """Apply a torque (N.m) on a moving body during the next step."""

    @abstractmethod
    def hold(self, held: bool) -> None:
        """Prescribe the motion of what is steered from now on, or leave it to forces."""

    @abstractmethod
    def advance(self, h: float) -> None:
        """One step of the engine (s)."""

    @abstractmethod
    def reactions(self) -> tuple[dict[str, complex], dict[str, float], dict[str, float]]:
        """Of the last step: force of every joint, moment of every prismatic one, what the motor in each driven joint
        exerts (N.m, N), none where it is let go; see Trace.

        Without what :meth:`step` applied for a joint's law.
        """

    def close(self) -> None:  # noqa: B027
        """Give back what the engine holds."""

    # ---------------------------------------------------------------- what it hangs on, and what moves it

    def hang(self, joints: list[Joint]) -> list[Joint]:
        """Let the bodies hang on the ground by these joints, as far as they close no loop; gives those left over."""
        m = self.mechanism
        driven = [m.drive_joint] if self.crank else [m.joint(name) for name in self.request.schedule.drives]
        self.branches, rest = spanning_tree(m, joints, driven)
        self.branch = {branch.child: branch for branch in self.branches}
        self.steered = tuple(Steered.of(joint, self.branches, self.crank) for joint in driven)
        self.commands = [0.0] * len(driven)
        return rest

    def spin_ups(self, path: Path, time: float) -> tuple[float, ...]:
        """Accelerations (rad/s^2, m/s^2) of what is steered, at a time (s) of a path."""
        now = np.array([time])
        return tuple(each.sign * float(path.drive(each.joint.name, now, 2)[0]) for each in self.steered)

    def aims(self, path: Path, times: np.ndarray) -> list[tuple[float, ...]]:
        """Where what is steered is (rad, m) on a path, at each of these times (N,) s."""
        along = [each.sign * path.drive(each.joint.name, times) for each in self.steered]
        return list(zip(*(where.tolist() for where in along), strict=True))

    def settled(self, evaluate: Callable[[], T], pressing: Callable[[T], Mapping[str, float]]) -> T:
        """What an evaluation gives once the friction in it is that of its own reactions, which press joints so hard
        (N).  Raises SimulationError where that does not settle.
        """
        for _ in range(FRICTION_ROUNDS):
            found = evaluate()
            if not self.loads or self.heed(pressing(found)):
                return found
        raise SimulationError(
            f"{self.engine}: {self.mechanism.name}: the friction that its reactions give does not settle: it is about"
            " to lock the linkage",
            Cause.NO_EQUILIBRIUM,
            f"use a smaller {' or '.join(joint.load_law for joint in self.mechanism.load_rubbed)}",
        )

    def before_observing(self) -> None:
        """Keep what reading the next step's reactions needs."""
        self.before = {body.name: self.pose(body.name) for body in self.mechanism.bodies}

    # ---------------------------------------------------------------- what acts on the bodies

    def push(self, body: str, point: complex, force: complex) -> None:
        """Apply a force (N, ground frame) at a point of a body during the next step; the ground takes it."""
        if body == GROUND:
            return
        self.press(body, point, force)
        if self.balances:
            arm = (point - self.points[body, MASS_CENTRE]) * cmath.exp(1j * self.angle(body))
            self._note(body, force, (arm.conjugate() * force).imag)

    def turn(self, body: str, torque: float) -> None:
        """Apply a torque (N.m) on a body during the next step; the ground takes it."""
        if body == GROUND:
            return
        self.twist(body, torque)
        if self.balances:
            self._note(body, 0j, torque)

    def _note(self, body: str, force: complex, moment: float) -> None:
        total, turning = self.applied.get(body, (0j, 0.0))
        self.applied[body] = total + force, turning + moment

    def take_note(self, h: float) -> None:
        """A step (s) is made now, with what was noted."""
        self.was_applied, self.applied, self.last_step = self.applied, {}, h

    def balanced(
        self, pins: Mapping[str, complex], tied: Set[str]
    ) -> tuple[dict[str, complex], dict[str, float], dict[str, float]]:
        """The reactions of the last step by each body's balance, given the forces (N) of ``pins`` that are not in the
        tree.  Those ``tied`` were not among what was noted.
        """
        after = {body.name: self.pose(body.name) for body in self.mechanism.bodies}
        motion = self.moved(self.before, after, self.last_step)
        balance = ForceBalance(self.mechanism, self.before, self.was_applied)
        forces, moments, efforts = balance.solve(self.branches, motion, pins, tied, self.steered)
        return forces, moments, efforts if self.held else {}

    @property
    def compliant(self) -> bool:
        """Whether a pin's depth in its bearing is part of its equilibrium, rather than given."""
        return self.request.joint_model == "spring-damper"

    def settings(self) -> dict[str, SettingValue]:
        """The numbers used, for Trace."""
        touching = self.pins | self.blocks
        return law_settings(self.mechanism, touching) if self.compliant and touching else {}

    # ---------------------------------------------------------------- stepping

    def step(self, h: float) -> None:
        """Apply loads, joint laws, clearance forces and the motor at the positions now, and advance by h (s)."""
        if self.makes_up and self.trailing:
            self._catch_up()
        self._load()
        self._steer(h)
        if self.heeding:
            self.before_observing()
        self.advance(h)
        if self.heeding:
            self.heed(self.pressing(*self.reactions()[:2]))

    def _load(self) -> None:
        """Apply loads, joint laws and clearance forces at the positions now."""
        for load, fades in zip(self.mechanism.loads, self.fades, strict=True):
            force, torque = self.mechanism.acting(load, self.seen, fades)
            if force:
                self.push(load.body, self.points[load.body, load.point], complex(force))
            if torque:
                self.turn(load.body, float(torque))
        for joint in self.laws.joints:
            self._apply_law(joint)
        for spring in self.mechanism.springs:
            self._apply_spring(spring)
        periodic = self.mechanism.periodic_torque
        if periodic is not None:
            crank = self.mechanism.driven
            self.turn(crank, periodic.at(self.angle(crank)))
        self._load_pins()

    def face(self, heading: Callable[[], Mapping[str, Pose]]) -> None:
        """Have friction, and loads that oppose the motion, act at rest against this one, whose direction matters."""
        self.laws.set_sliding(heading)
        if any(load.opposes for load in self.mechanism.loads):
            self.heading = heading()

    def _press_block(self, name: str, block: LeapfrogBlock) -> None:
        """Apply what walls do to a block's corners."""
        (first, second), total, moment = block.joint.bodies, 0j, 0.0
        a, b = self.base(first), self.base(second)
        self.block_seats[name], (_, point) = block.seat(a, b), block.places(a, b)
        self.touches[name] = self.walls[name] if self.walls else (*block.touches(a, b, self.trailing),)
        for touch in self.touches[name]:
            for body, pose, force in ((second, b, touch.force), (first, a, -touch.force)):
                self.push(body, (touch.at - pose.origin) * cmath.exp(-1j * pose.angle), force)
            total += touch.force
            moment += ((touch.at - point).conjugate() * touch.force).imag
        self.pin_forces[name], self.block_moments[name] = total, moment

    def _load_pins(self) -> None:
        for name, block in self.blocks.items():
            self._press_block(name, block)
        if self.request.joint_model == "spring-damper":
            for name, pin in self.pins.items():
                self.pin_gaps[name], rate = self.gap(name)
                striking = self.striking.get(name) if self.trailing else None  # before the run, nothing has struck
                if striking is None:
                    force = pin.spring_damper(self.pin_gaps[name], rate)
                else:
                    force = striking.push(self.pin_gaps[name], rate, self.trailing)
                self.pin_forces[name] = force
                if force:
                    self.pull(pin.joint, force)
        for name, pin in self.soft.items():
            force = self.pin_forces[name] = pin.spring(*self.gap(name))
            self.pull(pin.joint, force)

    def pressing(self, forces: Mapping[str, complex], moments: Mapping[str, float]) -> dict[str, float]:
        """How hard (N) the joints whose friction grows with it are pressed by these reactions (N) and moments (N.m), as
        the step began that was read last.
        """
        at, found = {GROUND: AT_REST, **self.before}, dict[str, float]()
        for joint in map(self.mechanism.joint, self.loads):
            first, second = (at[body] for body in joint.bodies)
            slip = self.laws.slip(joint, travel(self.mechanism, joint, first, second)[1])
            pressed = joint.pressed(forces[joint.name], moments.get(joint.name, 0.0), first.angle, slip)
            found[joint.name] = float(pressed)
        return found

    def heed(self, now: Mapping[str, float]) -> bool:
        """Take in how hard joints are pressed (N), with which the next steps' friction grows; says whether that was
        known already.
        """
        change = max((abs(now[name] - load) for name, load in self.loads.items()), default=0.0)
        self.loads.update(now)
        return change <= FRICTION_LEFT * max(now.values(), default=0.0)

    def _steer(self, h: float) -> None:
        """Give what is steered the speed that takes it to its aim in the next step (s), or a crank that lags its motor
        the torque of that.
        """
        if self.aim is None:
            for k, spin_up in enumerate(self.spin_up):
                self.commands[k] += spin_up * h
        elif self.held:
            for k, aim in enumerate(self.aim):
                self.commands[k] = (aim - self.coordinate(self.steered[k].child)) / h
        else:
            behind = self.aim[0] - self.angle(self.mechanism.driven)
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
        effort = self.laws.effort(j, way, rate, self.loads.get(j.name, 0.0))
        if not j.prismatic:
            self.turn(second, effort)
            self.turn(first, -effort)
            return
        along = j.direction * np.exp(1j * a.angle)
        force = self.slide_forces[j.name] = effort * along
        self.push(second, self.points[second, j.name], force)
        beside = 1j * self.blocks[j.name].seat(a, b).real if j.name in self.blocks else 0.0
        self.push(first, self.points[first, j.name] + (way + beside) * j.direction, -force)

    def _apply_spring(self, spring: Spring) -> None:
        ends = [self._point(*end) for end in spring.ends]
        (near, near_rate), (far, far_rate) = ends
        pull = spring.pull(far - near, 0j if self.static else far_rate - near_rate)
        for (body, point), force in zip(spring.ends, (pull, -pull), strict=True):
            self.push(body, self.points[body, point], force)

    @cached_property
    def seen(self) -> Seen[float]:
        """What its loads see of it; at rest the direction in which its drives go on."""

        def going(body: str) -> Pose:
            return self.heading[body] if self.static else self._any_pose(body)

        def velocity(body: str, point: str) -> complex:
            pose = going(body)
            return pose.velocity + 1j * pose.angular_velocity * self.points[body, point] * cmath.exp(1j * pose.angle)

        return Seen(
            self.angle,
            lambda *of: self._point(*of)[0],
            velocity,
            lambda body: going(body).angular_velocity,
            lambda: self.clock,
        )

    def _point(self, body: str, point: str) -> tuple[complex, complex]:
        """Place (m) and velocity (m/s) of a body's point, now."""
        pose = self._any_pose(body)
        arm = self.points[body, point] * np.exp(1j * pose.angle)
        return pose.origin + arm, pose.velocity + 1j * pose.angular_velocity * arm

    def _catch_up(self) -> None:
        """Reckon the velocities of this instant, which the engine has half a step late, and make up for the inertia
        forces that it gets wrong by that, at each body's centre of mass.
        """
        here = {body.name: self.pose(body.name) for body in self.mechanism.bodies}
        where = {branch.child: coordinates(self.mechanism, branch, here) for branch in self.branches}
        late = {name: np.array(rates) for name, (_, rates) in where.items()}
        rates = {name: rate + (rate - self.late.get(name, rate)) / 2 for name, rate in late.items()}
        self.late, self.now = late, {}
        was, turned = (
            tracks(self.points, self.branches, {name: (at, each[name]) for name, (at, _) in where.items()})
            for each in (late, rates)
        )
        for name, body in self.mechanism.moving.items():
            centre = self.points[name, MASS_CENTRE]
            wrong = turned[name].at(centre)[2] - was[name].at(centre)[2]
            self.press(name, centre, -body.mass * wrong)
            self.now[name] = turned[name].pose

    def base(self, body: str) -> Pose:
        """A body's pose as the engine has it, or the ground's."""
        return AT_REST if body == GROUND else self.pose(body)

    def _any_pose(self, body: str) -> Pose:
        return AT_REST if body == GROUND else self.now.get(body) or self.pose(body)

    def observe(self, h: float) -> dict[str, float]:
        """Advance by h (s) and return every signal, and every body's rates, at the instant from which the step
        started.
        """
        names = [b.name for b in self.mechanism.bodies]
        here = {name: self.pose(name) for name in names}
        gaps = {j.name: self.gap(j.name)[0] for j in self.mechanism.joints if not j.prismatic}
        self.before_observing()
        self.step(h)
        forces, moments, efforts = self.reactions()
        moments |= self.block_moments
        lag = self.trailing / h
        out = self._drives(efforts)
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
        for name, block in self.blocks.items():
            first, second = ({GROUND: AT_REST, **here}[body] for body in block.joint.bodies)
            seat = block.seat(first, second)
            gap = -1j * seat.real * block.along(first)
            out |= {f"clearance_{name}_x": gap.real, f"clearance_{name}_y": gap.imag}
            out[f"clearance_{name}_angle"] = -seat.imag
        for name, force in forces.items():
            force += self.slide_forces.get(name, 0j)  # a slide's reaction holds its friction, damper and spring too
            out |= {f"reaction_{name}_x": force.real, f"reaction_{name}_y": force.imag}
        out |= {f"reaction_{name}_moment": moment for name, moment in moments.items()}
        with np.errstate(over="ignore", invalid="ignore"):  # of a run that diverges; its trace says so
            after = {name: self.pose(name) for name in names}
            moved = dict.fromkeys(names, STILL) if self.static else self.moved(here, after, h)
            for name in names:
                _, velocity, acceleration = moved[name].at(self.points[name, MASS_CENTRE])
                out |= rate_columns(name, velocity, acceleration, moved[name].spin_up)
        return out

    def moved(self, before: Mapping[str, Pose], after: Mapping[str, Pose], h: float) -> dict[str, Track]:
        """Every body's track at the poses before a step of h (s), from those after it too: the rates of coordinates
        change evenly in the step.
        """
        motions: dict[str, BranchMotion] = {}
        for branch in self.branches:
            (where, old), (_, new) = (coordinates(self.mechanism, branch, poses) for poses in (before, after))
            changes = (np.array(new) - old) / h
            motions[branch.child] = where, old + self.trailing * changes, changes
        return tracks(self.points, self.branches, motions)

    def _drives(self, efforts: Mapping[str, float]) -> dict[str, float]:
        """The drives' signals: what the motor in each driven joint exerts (N.m, N)."""
        if not self.held and self.crank:
            return {DRIVE_TORQUE: self.motor_torque}
        driven = [each.joint for each in self.steered]
        signals = [DRIVE_TORQUE] if self.crank else [signal.name for signal in driving(driven)]
        sign = 1.0 if self.crank else self.mechanism.crank_sign
        return {signal: sign * efforts[joint.name] for signal, joint in zip(signals, driven, strict=bool(driven))}

    def start(
        self,
        bodies: Mapping[str, Pose],
        h: float,
        spin_up: Sequence[float] = (),
        aims: Sequence[Sequence[float] | None] = (None,) * WARM_UP,
    ) -> None:
        """Place the bodies and take their velocities half a step (s) back, as a leapfrog wants them.

        Engines close loops and contacts by the drift and speed at a step's beginning, so a few steps must have been
        made towards the poses for the next one to accelerate as it should.  ``spin_up`` holds the accelerations
        (rad/s^2, m/s^2) of what is steered, ``aims`` (WARM_UP,) are those of the steps towards the poses.
        """
        self.aim = None
        self.approach(bodies, h, spin_up)
        before = self.velocities()
        self.step(h)
        change = self.velocities() - before
        self.place(bodies)
        self.forget()
        self.walls = {}
        speeds = self.velocities()
        self.shift(-WARM_UP * h * (speeds - WARM_UP / 2 * change))
        self.set_velocities(speeds - (WARM_UP + 0.5) * change)
        self.spin_up = ()
        self.trailing = h / 2
        self.clock -= WARM_UP * h
        for self.aim in aims:
            self.step(h)
            self.clock += h

    @property
    def holding(self) -> list[Joint]:
        """The joints whose motors do not give way."""
        return [each.joint for each in self.steered] if self.held else []

    def _yields(self, joint: Joint, corner: complex = 0j) -> np.ndarray:
        """(2, 2) 1/kg: how a joint's gap accelerates under a force, or what of its block is so far (m) along it and
        across, as the bodies are now.
        """
        bodies = {body.name: self.pose(body.name) for body in self.mechanism.bodies}
        turned = cmath.exp(1j * (self.base(joint.bodies[1]).angle - joint.angle)) * joint.direction if corner else 0j
        return mobility(self.mechanism, bodies, joint, self.closed, self.holding, corner * turned)

    def forget(self) -> None:
        """Take the pins as just placed: none has touched its wall."""
        for each in (*self.striking.values(), *(s for block in self.blocks.values() for s in block.striking)):
            each.forget()

    def approach(self, bodies: Mapping[str, Pose], h: float, spin_up: Sequence[float] = ()) -> None:
        """Place the bodies a few steps (s) before these poses, and step; what is steered accelerates by ``spin_up``
        (rad/s^2, m/s^2).
        """
        self.place(bodies)
        self.forget()
        at = {GROUND: AT_REST, **bodies}
        for name, block in self.blocks.items():
            first, second = block.joint.bodies
            self.walls[name] = (*block.touches(at[first], at[second], 0.0),)
        self.spin_up = spin_up
        for k, each in enumerate(spin_up):
            self.commands[k] -= (self.settling - 1) * each * h
        self.shift(-self.settling * h * self.velocities())
        for _ in range(self.settling):
            self.step(h)
