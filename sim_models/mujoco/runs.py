"""Driven, released and static runs of a MuJoCo linkage."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import mujoco
import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.schedule import DriveMotion, Steady
from analytic.mechanism import Mechanism
from sim_models.common.backlash import HOLDS, Felt, Flanks, side
from sim_models.common.failed_starts import own_start
from sim_models.common.journal import free_share
from sim_models.common.rates import part_rates
from sim_models.engine import Cause, Request, SettingValue, SimulationError, Trace, Watched
from sim_models.mujoco.equilibrium import Equilibria
from sim_models.mujoco.laws import contact_laws, law_settings
from sim_models.mujoco.march import Log, march
from sim_models.mujoco.mjcf import Setting
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.motor import AlongCourse, AtConstantSpeed, Steering, steering
from sim_models.mujoco.state import (
    joint_forces,
    look,
    mobility,
    signals,
    stiffest_law,
)
from sim_models.mujoco.steady import STENCIL, Revolution, derivative
from sim_models.run.path import CrankPath, Gaps, Path

STATIC_STEP = 1.25e-5  # s; nothing steps in statics, but it makes the rigid rows stiff
LARGEST_STEP = 4e-4  # s
TURN_PER_STEP = {"ideal": 2e-3, "massless-link": 3e-4, "spring-damper": 6e-4, "contact": 6e-4}  # rad of the crank
SAMPLES_AT_REST = 150  # of a static run's
SOFT_PHASE = 0.4  # rad of a soft bearing's own vibration in a step
SECOND_ORDER_TURN = 2.4e-3  # the same where contact is of second order in the step
BOUNCE = 0.4  # of a bounce's period/2 pi, for a step
SECOND_ORDER_BOUNCE = 1.4  # where contact is of second order; at 2 a step is no longer stable
GLIMPSES = 9  # places of a run at which it is looked how light pins are
FINE_BOUNCE = 0.1  # where the mechanism asks for a restitution
FELT = 37  # instants of a run at which what a motor feels is asked for
STILL = 1e-8  # rad, what the flanks of a drive with backlash give where its equilibria are sought
LANDING = 0.2  # of the time constant of a crank's landing, for a step
HALVINGS = 5  # of the step, before a run with rigid joints coming apart is given up


RESTING: Mapping[str, SettingValue] = {"step": None, "start": "equilibrium"}  # settings of a static run
State = tuple[np.ndarray, np.ndarray]  # coordinates (nq,) and velocities (nv,)


class Run:
    """One request on its way to a trace, whatever moves it along its path."""

    path: Path
    largest_step = LARGEST_STEP  # s
    hold: bool  # whether motors hold all that they would in statics
    follows: bool  # whether they follow courses

    def __init__(self, request: Request) -> None:
        self.request, self.mechanism = request, request.mechanism
        self.flanks: Flanks | None = None  # of a drive with backlash; mechanism and request then have a spring for one
        self.steering = Steering()
        self.assembly = Assembly(self.mechanism)
        self.laws = contact_laws(request)
        self.watched: Watched | None = None

    def near(self, theta: float, step: float = STATIC_STEP) -> Equilibria:
        """Equilibria near a crank angle (rad), or a time (s) on courses, with rows as rigid as at this step."""
        return Equilibria(self.request, self.path, self.laws, theta, step)

    def settle(
        self, near: Equilibria, at: np.ndarray, instants: np.ndarray, here: int, step: float | None
    ) -> tuple[np.ndarray, np.ndarray, float, str]:
        """Coordinates and velocities without transients at the start, the step (s; the longest that is in order, where
        none is given) and what kind of start it is, from the places ``at`` on the path at instants (s), of which the
        start is number ``here``.
        """
        rate = derivative(instants)
        q = np.array([near.place(near.ideal, x) for x in at])
        states = zip(at, q, rate @ q, rate @ rate @ q, strict=True)
        forces = [near.reactions(x, *state) for x, *state in states] if self.laws else [{}] * at.size
        if self.centred:
            q, how = np.array([near.place(near.pressed, x) for x in at]), "centred"
        else:
            gaps = [near.pressing(x, f) for x, f in zip(at, forces, strict=True)]
            q, how = (
                np.array([near.place(near.pressed, x, gap) for x, gap in zip(at, gaps, strict=True)]),
                "equilibrium",
            )
        step = self.longest_step(near, q[here]) if step is None else step
        if how == "equilibrium":
            near = self.near(at[here], step)
            near.seat(forces[here])
            settled = near.steady(at, q, rate)
            q, how = (q, "pressed where the ideal linkage's reaction points") if settled is None else (settled, how)
        return q[here], (rate @ q)[here], step, how

    @property
    def centred(self) -> bool:
        """Whether pins start in the middle of their bearings."""
        return self.request.start == "centred" and bool(self.laws)

    def equilibria(self, along: np.ndarray) -> tuple[dict[str, np.ndarray], Log]:
        """Signals (N,) of the equilibria at places (N,) on the path, and a log of the pins' paths there and between.

        Raises SimulationError.
        """
        near = self.near(float(along[0]))
        found = {at: self.at_rest(near, at) for at in along.tolist()}
        log = Log.of(self.laws)
        for at in _filled(along).tolist() if self.laws else ():
            try:
                seen = found[at] if at in found else near.at_rest(at)
            except (SimulationError, AssemblyError):
                continue  # only where one is asked for must one be; where there is none, the path has a gap
            for name in self.laws:
                gap = complex(seen[f"clearance_{name}_x"], seen[f"clearance_{name}_y"])
                if name in near.pressed.blocks:
                    gap = complex(near.pressed.blocks[name].guide.reach(abs(gap), seen[f"clearance_{name}_angle"]))
                log.gaps[name].append(gap)
                log.forces[name].append(math.hypot(seen[f"reaction_{name}_x"], seen[f"reaction_{name}_y"]))
        rows = [found[at] for at in along.tolist()]
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}, log

    def at_rest(self, near: Equilibria, at: float) -> dict[str, float]:
        """Signals of the equilibrium with the motors where they are at a place on the path.  Raises SimulationError."""
        return near.at_rest(at)

    def light(self, near: Equilibria) -> MujocoLinkage:
        """The linkage as its pins feel it."""
        return near.pressed

    def passed(self) -> np.ndarray:
        """Places on the path from the start to the last report; none where nothing leads along it."""
        return np.zeros(0)

    def longest_step(self, near: Equilibria, q: np.ndarray) -> float:
        """A step (s) that resolves the crank's turning, each contact's bounce, its pin's swing on the rim, and the
        joint laws.
        """
        link = self.light(near)
        limits = [self.largest_step]
        places = [near.place(link, at) for at in self.passed()] if link.second_order else []
        if self.steering.top_speed:
            turn = SECOND_ORDER_TURN if places else TURN_PER_STEP[self.request.joint_model]
            limits.append(turn / self.steering.top_speed)
        for name, law in list(self.laws.items()):
            ease = mobility(link, q, name)
            clearance = self.mechanism.joint(name).clearance
            asked = law.named is not None or self.mechanism.joint(name).restitution is not None
            if name not in link.blocks:  # a block does not swing on its wall
                limits.append(0.6 / math.sqrt(max(near.forces.get(name, 0.0) * ease / clearance, 1e-12)))
            if law.hard:
                sag = (
                    near.forces.get(name, 0.0) * ease * law.hard[0] ** 2
                )  # under the load that it starts with, were it a spring
                self.laws[name] = replace(law, margin=min(sag, 0.05 * clearance))
                limits.append((FINE_BOUNCE if asked else BOUNCE) * law.hard[0])
            elif self.request.joint_model != "massless-link":
                ease = max([ease, *(mobility(link, place, name) for place in places)])
                part = FINE_BOUNCE if asked else SECOND_ORDER_BOUNCE if places else 2 * BOUNCE
                limits.append(part / max(math.sqrt(law.stiffness * ease), law.damping * ease))
        if self.flanks is not None and self.flanks.rigid:
            limits.append(LANDING * self.flanks.holds / HOLDS)
        for name, spring in link.soft.items():
            ease = mobility(link, q, name)
            limits.append(SOFT_PHASE / max(math.sqrt(spring.stiffness * ease), spring.damping * ease))
        return self.request.step or min(*limits, 0.5 / max(stiffest_law(link, q, self.flanks), 1e-9))

    def run(
        self, theta: float, state: State, begin: Callable[[float], State], step: float, marks: np.ndarray, lead: float
    ) -> tuple[dict[str, np.ndarray], Log, float]:
        """A run with the engine's own step, halved while rigid joints come apart, each time begun anew; or with the
        request's.
        """
        for attempt in range(HALVINGS + 1):
            setting = Setting(
                self.request.joint_model, step, self.hold, True, self.follows, self.flanks, self.path.driven
            )
            link = MujocoLinkage(self.mechanism, self.laws, self.path.poses(theta), setting)
            try:
                signals, log, self.record, self.watched = march(self.request, link, self.steering, state, marks, lead)
                return signals, log, step
            except SimulationError as error:
                apart = error.cause is Cause.CAME_APART
                if not apart or self.request.step is not None or attempt == HALVINGS:
                    raise
                step /= 2
                state = begin(step)
        raise AssertionError("unreachable: the last attempt returns or raises")

    @property
    def _journals(self) -> list[str]:
        """The joints with clearance whose pins have a path in their bearings."""
        return [name for name in self.laws if not self.mechanism.joint(name).prismatic]

    def wall(self, name: str) -> float:
        """How far (m) off its centre a pin begins to be pushed."""
        law = self.laws[name]
        return self.mechanism.joint(name).clearance - (law.margin if law.hard else 0.0)

    def report(
        self,
        theta: np.ndarray,
        time: np.ndarray | None,
        signals: Mapping[str, np.ndarray],
        log: Log,
        settings: Mapping[str, SettingValue],
    ) -> Trace:
        signals, rates = part_rates(signals)
        times = np.array(log.times) if log.times else None
        return Trace(
            simulator="mujoco",
            version=mujoco.__version__,
            joint_model=self.request.joint_model,
            motion=self.request.motion,
            crank_angle=theta,
            time=time,
            signals=signals,
            clearance=self.request.clearances,
            journal={name: np.array([[g.real, g.imag] for g in log.gaps[name]]) for name in self._journals},
            free_share={name: free_share(np.array(gaps), self.wall(name), times) for name, gaps in log.gaps.items()},
            settings={**law_settings(self.request, self.laws), **settings, "solver": "Newton, elliptic cone"},
            rates=rates,
            watched=self.watched,
        )


class MujocoRun(Run):
    """A request whose drive turns a crank, or is to let it go."""

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        self.motor = request.motor
        self.shift = 0.0  # rad, by which the motor leads a crank with backlash where the run begins, beside the spring
        self.hold = self.motor is not None
        self.follows = self.motor is not None and not self.motor.constant_speed
        self.direct(
            0.0 if request.schedule.lets_go else math.copysign(1.0, self.mechanism.speed or 1.0)
        )  # at rest, too

    def direct(self, direction: float) -> None:
        """Let the crank move in this direction (sign; 0: it stands)."""
        self.path = CrankPath(self.assembly, direction)

    def passed(self) -> np.ndarray:
        if self.motor is None:
            return np.zeros(0)
        last = float(self.request.schedule.time.max())
        return self.motor.positions(np.linspace(self.motor.begin, last, GLIMPSES))

    def light(self, near: Equilibria) -> MujocoLinkage:
        if self.motor is not None:
            return near.pressed
        # nothing holds the crank: pins are lighter
        setting = Setting(self.request.joint_model, STATIC_STEP, hold=False)
        return MujocoLinkage(self.mechanism, self.laws, self.path.poses(self.assembly.start), setting)

    def trace(self) -> Trace:
        """Run the request."""
        with own_start("mujoco", self.request, self.assembly):
            if self.mechanism.half_gap:
                self.give_flanks()
            if self.request.motion == "static":
                return self.static()
            return self.free() if self.motor is None else self.driven(self.motor)

    def give_flanks(self) -> None:
        """Make the flanks of a drive with backlash, and find the one that carries the crank at first."""
        m, schedule = self.mechanism, self.request.schedule
        angle = schedule.crank_angle
        motor = self.motor or Steady(float(angle[0]) if angle is not None else self.assembly.start)
        last = motor.begin + 1.0 if self.motor is None else float(schedule.time.max())
        times = np.linspace(motor.begin, last, FELT)
        near = Equilibria(
            replace(self.request, mechanism=_on_spring(m, 1.0), joint_model="ideal"),
            self.path, {}, motor.position(motor.begin), STATIC_STEP,
        )  # fmt: skip
        felt = np.array([near.felt(*at) for at in zip(*(motor.positions(times, n) for n in range(3)), strict=True)])
        self.flanks = Flanks.of(m, Felt(times, *felt.T), motor.top_speed or 1.0)
        rigid = float(np.abs(felt[:, 0]).max()) / STILL
        self.mechanism = _on_spring(m, max(rigid, 1.0) if self.flanks.rigid else self.flanks.stiffness)
        self.request = replace(self.request, mechanism=self.mechanism)
        self.shift = side(felt[0, 0]) * m.half_gap

    def static(self) -> Trace:
        """Equilibrium at each crank angle, and between them for the journals' paths."""
        theta = self.request.schedule.crank_angle
        assert theta is not None  # other poses are told by time, in a RestingRun
        columns, log = self.equilibria(theta)
        return self.report(theta, None, columns, log, RESTING)

    def at_rest(self, near: Equilibria, theta: float) -> dict[str, float]:
        """The same of a crank whose drive may have backlash."""
        if self.flanks is None:
            return near.at_rest(theta)
        for flank in (1.0, -1.0):
            seen = near.at_rest(theta - flank * self.flanks.half_gap)
            if side(seen["drive_torque"]) == flank:
                return seen
        raise near.failed(Cause.NO_EQUILIBRIUM, "the crank rests on neither flank of its drive", theta)

    def begin(
        self, steering: AtConstantSpeed | AlongCourse, step: float | None = None
    ) -> tuple[np.ndarray, np.ndarray, float, str]:
        """Coordinates, velocities, step (s; the longest that is in order, where none is given) and kind of a driven
        run's start.
        """
        angles, here = steering.stencil.angles - self.shift, steering.stencil.here
        near = self.near(angles[here])
        q, v, step, how = self.settle(near, angles, steering.stencil.instants, here, step)
        v[near.pressed.motor] = steering.motor.rate(steering.motor.begin)
        if self.flanks is not None:
            q[near.pressed.motor] += self.shift
            return q, v, step, how
        rigid = not (self.laws or near.pressed.soft)
        if near.pressed.description.compliant and rigid and steering.period is not None:
            setting = Setting("ideal", step, follows=self.follows)
            link = MujocoLinkage(self.mechanism, {}, self.path.poses(angles[here]), setting)
            revolution = Revolution(link, self.assembly, steering, steering.period)
            repeated = revolution.steady(q, v) if revolution.repeats() else None
            if repeated is not None:
                return *repeated, step, "equilibrium, the same a revolution later"
        return q, v, step, how

    def driven(self, motor: DriveMotion) -> Trace:
        """The motor turns, at constant speed or along its course.  Without crank angles in the request, those reported
        are the simulated ones.
        """
        time = self.request.schedule.time
        order = np.argsort(time, kind="stable")
        self.steering = turned = steering(motor)
        self.direct(turned.direction)
        q, v, step, how = self.begin(turned)

        def begin(step: float) -> tuple[np.ndarray, np.ndarray]:
            return self.begin(turned, step)[:2]  # where its rows give as they do in such steps

        lead = float(time.min()) - motor.begin
        signals, log, step = self.run(turned.stencil.theta, (q, v), begin, step, time[order], lead)
        columns = {name: scatter(values, order) for name, values in signals.items()}
        theta = self.request.schedule.crank_angle
        theta = columns[f"{self.mechanism.driven}_angle"].copy() if theta is None else theta
        return self.report(theta, time, columns, log, {"step": step, "start": how})

    def free(self) -> Trace:
        """Released at the assembly angles, at rest or with the request's speed."""
        time, speed = self.request.schedule.time, self.request.schedule.start_speed(self.mechanism)
        order = np.argsort(time, kind="stable")
        theta = self.assembly.start
        near = self.near(theta)
        gaps = self.gaps_at_release(near, theta) if self.laws else {}
        q = near.place(near.pressed, theta, gaps)
        step = self.longest_step(near, q)
        around = (
            np.array([near.place(near.pressed, theta + side, gaps) for side in STENCIL])
            if speed
            else np.tile(q, (5, 1))
        )
        v = (derivative(STENCIL) @ around)[2] * speed
        signals, log, step = self.run(theta, (q, v), lambda step: (q, v), step, time[order], float(time[order[0]]))
        columns = {name: scatter(values, order) for name, values in signals.items()}
        settings: dict[str, SettingValue] = {"step": step, "start": "released", "start_speed": speed}
        return self.report(columns[f"{self.mechanism.driven}_angle"].copy(), time, columns, log, settings)

    def gaps_at_release(self, near: Equilibria, theta: float) -> Gaps:
        """Gaps (m) along the ideal linkage's reactions at the instant of release, x where there is none; zero to start
        centred.
        """
        setting = Setting("ideal", STATIC_STEP, hold=False)
        link = MujocoLinkage(self.mechanism, {}, self.path.poses(theta), setting)
        look(link)
        forces = near.noted(signals(link, joint_forces(link, link.data.efc_force), {}))
        return {} if self.centred else {name: near.rim(name, force or complex(1e-12)) for name, force in forces.items()}


def scatter(values: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Values in the request's order from values in the order of passing."""
    out = np.empty_like(values)
    out[order] = values
    return out


def _filled(along: np.ndarray) -> np.ndarray:
    """Places on a path in order, with others between them: at least SAMPLES_AT_REST over their range."""
    along = np.unique(along)
    if along.size < 2:
        return along
    between = np.linspace(along[0], along[-1], SAMPLES_AT_REST)
    return np.unique(np.concatenate([along, between]))


def _on_spring(mechanism: Mechanism, stiffness: float) -> Mechanism:
    """The mechanism with a spring (N.m/rad) in place of its drive's backlash."""
    assert mechanism.drive is not None
    return mechanism.replace(drive=mechanism.drive.model_copy(update={"half_gap": 0.0, "stiffness": stiffness}))
