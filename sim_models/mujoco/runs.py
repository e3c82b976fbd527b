"""Driven, released and static runs of a MuJoCo linkage: how they rest, start and choose their step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.kinematics.schedule import Steady
from analytic.mechanism import Mechanism
from sim_models.common.backlash import HOLDS, INSTANTS_FELT, Felt, Flanks, side
from sim_models.common.fading import fading_step
from sim_models.common.free_share import free_share
from sim_models.common.mobility import stop_step
from sim_models.engine import Cause, Request, SettingValue, SimulationError
from sim_models.mujoco.equilibrium import MujocoEquilibria
from sim_models.mujoco.laws import contact_laws, law_settings
from sim_models.mujoco.march import Log, march
from sim_models.mujoco.mjcf import Setting
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.motor import INSTANTS_AROUND, TURN_BETWEEN_INSTANTS, AlongCourse, AtConstantSpeed, steering
from sim_models.mujoco.state import friction_torques, joint_forces, look, mobility, on_track, signals, stiffest_law
from sim_models.mujoco.steady import ANGLES_AROUND, Revolution, derivative
from sim_models.run.path import Gaps
from sim_models.run.run import EngineRun, Observed, columns_of

STATIC_STEP = 1.25e-5  # s; nothing steps in statics, but it makes the rigid rows stiff
LARGEST_STEP = 4e-4  # s
LARGEST_STEP_OF_COURSES = 2e-4  # s: loops that several motors hold give more than one behind a crank
TURN_PER_STEP_BY_MODEL = {
    "ideal": 2e-3,
    "massless-link": 3e-4,
    "spring-damper": 6e-4,
    "contact": 6e-4,
}  # rad of the crank
SAMPLES_AT_REST = 150  # of a static run's
SOFT_PHASE = 0.4  # rad of a soft bearing's own vibration in a step
SECOND_ORDER_TURN = 2.4e-3  # rad of the crank where contact is of second order in the step
BOUNCE_PER_STEP = 0.4  # of a bounce's period/2 pi, for a step
SECOND_ORDER_BOUNCE = 1.4  # where contact is of second order; at 2 a step is no longer stable
PLACES_GLIMPSED = 9  # places of a run at which it is looked how light pins are
FINE_BOUNCE = 0.1  # where the mechanism asks for a restitution
FLANK_GIVE = 1e-8  # rad, what the flanks of a drive with backlash give where its equilibria are sought
LANDING_PER_STEP = 0.2  # of the time constant of a crank's landing, for a step
FAINTEST_PUSH = complex(1e-12)  # N along x: presses a pin that nothing presses as it is let go


@dataclass(frozen=True)
class Start:
    """How a run begins: coordinates (nq,) and velocities (nv,), the longest step (s), and what kind of start it is."""

    q: np.ndarray
    v: np.ndarray
    step: float
    kind: str


class MujocoRun(EngineRun):
    """One request on its way to a trace.  Raises AssemblyError where the linkage cannot follow its courses."""

    engine = package = "mujoco"

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        self.flanks: Flanks | None = None  # of a drive with backlash; mechanism and request then have a spring for one
        self.shift = 0.0  # rad, by which the motor leads a crank with backlash where the run begins, beside the spring
        self.motor = request.motor if request.schedule.crank else None
        self.steering = steering(self.motor, self.path)
        self.laws = contact_laws(request)

    def near(self, place: float, step: float = STATIC_STEP) -> MujocoEquilibria:
        """Equilibria near a place on the path, with rows as rigid as at this step (s)."""
        near = MujocoEquilibria(self.request, self.path, self.laws, place, step)
        near.ideal.data.time = near.pressed.data.time = (self.motor or self.request.schedule).begin
        return near

    def setting(self, rows: str, step: float = STATIC_STEP) -> Setting:
        """How the linkage is modelled in motion, its loose joints closed by these rows, at this longest step (s)."""
        follows = bool(self.request.schedule.courses)
        return Setting(rows, step, self.path.held, True, follows, self.flanks, self.path.driven)

    # ---------------------------------------------------------------- at rest

    def rest(self, places: np.ndarray) -> Observed:
        """Equilibria at places (N,) on the path, and between them for the paths of the pins."""
        if self.mechanism.half_gap:
            self.give_flanks()
        near = self.near(float(places[0]))
        rows = {place: self.at_rest(near, place) for place in places.tolist()}
        log = Log.of(self.laws)
        for place in _filled(places).tolist() if self.laws else ():
            try:
                row = rows[place] if place in rows else near.at_rest(place)
            except (SimulationError, AssemblyError):
                continue  # only where one is asked for must one be; where there is none, the path has a gap
            for name in self.laws:
                gap = complex(row[f"clearance_{name}_x"], row[f"clearance_{name}_y"])
                if name in near.pressed.blocks:
                    gap = complex(near.pressed.blocks[name].guide.reach(abs(gap), row[f"clearance_{name}_angle"]))
                log.gaps[name].append(gap)
                log.forces[name].append(math.hypot(row[f"reaction_{name}_x"], row[f"reaction_{name}_y"]))
        columns = columns_of([rows[place] for place in places.tolist()])
        return self.observed(columns, log, {"step": None, "start": "equilibrium"})

    def at_rest(self, near: MujocoEquilibria, place: float) -> dict[str, float]:
        """Signals of the equilibrium with the motors where they are at a place on the path; a crank with backlash rests
        on one of its flanks.  Raises SimulationError.
        """
        if self.flanks is None:
            return near.at_rest(place)
        for flank in (1.0, -1.0):
            row = near.at_rest(place - flank * self.flanks.half_gap)
            if side(row["drive_torque"]) == flank:
                return row
        raise near.failed(Cause.NO_EQUILIBRIUM, "the crank rests on neither flank of its drive", place)

    # ---------------------------------------------------------------- in motion

    def march(self, times: np.ndarray) -> Observed:
        """Start, and step through reports at times (N,) s."""
        if self.mechanism.half_gap:
            self.give_flanks()
        schedule, start = self.request.schedule, self.start()
        self.step = start.step
        place = self.steering.stencil.start if self.path.held else self.path.begin
        setting = self.setting(self.request.joint_model, start.step)
        link = MujocoLinkage(self.mechanism, self.laws, self.path.poses(place), setting)
        lead = float(times[0]) - (self.motor or schedule).begin
        columns, log, self.record, watched = march(self.request, link, self.steering, (start.q, start.v), times, lead)
        how: dict[str, SettingValue] = {"step": start.step, "start": start.kind}
        if schedule.crank is not None and schedule.lets_go:
            how["start_speed"] = schedule.start_speed(self.mechanism)
        return replace(self.observed(columns, log, how), watched=watched)

    def start(self) -> Start:
        """How the run begins: without transients where motors hold all of it, else as it is let go."""
        if not self.path.held:
            return self.let_go()
        stencil = self.steering.stencil
        near = self.near(stencil.start - self.shift)
        start = self.settled(near, stencil.places - self.shift, stencil.instants, stencil.here)
        schedule = self.request.schedule
        start.v[near.pressed.motors] = self.steering.rates(near.pressed, schedule.begin)
        if self.flanks is not None:
            start.q[near.pressed.motor] += self.shift
            return start
        rigid = not (self.laws or near.pressed.soft)
        if near.pressed.description.compliant and rigid and isinstance(self.steering, AtConstantSpeed | AlongCourse):
            return self.repeating(start, self.steering)
        return start

    def settled(self, near: MujocoEquilibria, places: np.ndarray, instants: np.ndarray, here: int) -> Start:
        """A start without transients: from the places (n,) on the path at instants (s), it being number ``here``."""
        rate = derivative(instants)
        q = np.array([near.place(near.ideal, place) for place in places])
        states = zip(places, q, rate @ q, rate @ rate @ q, strict=True)
        forces = [near.reactions(place, *state) for place, *state in states] if self.laws else [{}] * places.size
        gaps: list[Gaps] = [{}] * places.size
        if not self.centred:
            gaps = [near.pressing(place, force) for place, force in zip(places, forces, strict=True)]
        q = np.array([near.place(near.pressed, place, gap) for place, gap in zip(places, gaps, strict=True)])
        step, kind = self.longest_step(near, q[here]), "centred"
        if not self.centred:
            near = self.near(places[here], step)
            near.seat(forces[here])
            steady = near.steady(places, q, rate)
            kind = "pressed where the ideal linkage's reaction points" if steady is None else "equilibrium"
            q = q if steady is None else steady
        return Start(q[here], (rate @ q)[here], step, kind)

    def repeating(self, start: Start, turning: AtConstantSpeed | AlongCourse) -> Start:
        """The start in the motion of a crank on its spring that each revolution repeats, where there is one nearby."""
        if turning.period is None:
            return start
        link = MujocoLinkage(
            self.mechanism, {}, self.path.poses(turning.stencil.start), self.setting("ideal", start.step)
        )
        revolution = Revolution(link, self.assembly, turning, turning.period)
        repeated = revolution.steady(start.q, start.v) if revolution.repeats() else None
        return start if repeated is None else Start(*repeated, start.step, "equilibrium, the same a revolution later")

    def let_go(self) -> Start:
        """A start in which something moves freely: pins are pressed where the ideal linkage's reactions point, and what
        is driven moves, or a crank at the rate that it is given.
        """
        begin = self.path.begin
        near = self.near(begin)
        pressed = near.pressed
        gaps = self.gaps_at_release(near) if self.laws else {}
        q = near.place(pressed, begin, gaps)
        v = np.zeros(q.size)
        instants: np.ndarray | None = None
        speed = self.request.schedule.start_speed(self.mechanism) if self.request.schedule.crank else 0.0
        if speed:
            instants = ANGLES_AROUND
        elif self.path.top_speed:
            instants, speed = INSTANTS_AROUND * TURN_BETWEEN_INSTANTS / self.path.top_speed, 1.0
        if instants is not None:
            around = np.array([near.place(pressed, begin + x, gaps) for x in instants])
            v = (derivative(instants) @ around)[2] * speed
            v[pressed.motors] = self.steering.rates(pressed, begin)
        return Start(q, v, self.longest_step(near, q), "released")

    def gaps_at_release(self, near: MujocoEquilibria) -> Gaps:
        """Gaps (m) along the ideal linkage's reactions as it is let go; centred at zero, and x where there is none."""
        if self.centred:
            return {}
        begin = self.path.begin
        link = MujocoLinkage(self.mechanism, {}, self.path.poses(begin), self.setting("ideal"))
        link.data.qpos[:] = near.place(link, begin)
        self.steering.place(link, begin, 0.0)
        on_track(link)
        look(link)
        forces = near.noted(signals(link, joint_forces(link, link.data.efc_force), friction_torques(link)))
        return {name: near.rim(name, force or FAINTEST_PUSH) for name, force in forces.items()}

    @property
    def centred(self) -> bool:
        """Whether pins start in the middle of their bearings."""
        return self.request.start == "centred" and bool(self.laws)

    def longest_step(self, near: MujocoEquilibria, q: np.ndarray) -> float:
        """A step (s) that resolves the crank's turning, each contact's bounce, its pin's swing on the rim, and the
        joint laws.
        """
        link, last = near.pressed, float(self.request.schedule.time.max())
        limits = [LARGEST_STEP if self.path.driven is None else LARGEST_STEP_OF_COURSES]
        passed = self.steering.passed(last, PLACES_GLIMPSED) if link.second_order and self.path.held else np.zeros(0)
        places = [near.place(link, place) for place in passed]
        if top_speed := self.steering.top_speed or self.path.top_speed:
            turn = SECOND_ORDER_TURN if places else TURN_PER_STEP_BY_MODEL[self.request.joint_model]
            limits.append(turn / top_speed)
        if not self.path.held:
            limits += [stop_step(self.mechanism), fading_step(self.mechanism)]
        for name, law in list(self.laws.items()):
            ease = mobility(link, q, name)
            clearance = self.mechanism.joint(name).clearance
            asked = law.named is not None or self.mechanism.joint(name).restitution is not None
            if name not in link.blocks:  # a block does not swing on its wall
                limits.append(0.6 / math.sqrt(max(near.forces.get(name, 0.0) * ease / clearance, 1e-12)))
            if law.hard:
                # under the load that it starts with, were it a spring
                sag = near.forces.get(name, 0.0) * ease * law.hard[0] ** 2
                self.laws[name] = replace(law, margin=min(sag, 0.05 * clearance))
                limits.append((FINE_BOUNCE if asked else BOUNCE_PER_STEP) * law.hard[0])
            elif self.request.joint_model != "massless-link":
                ease = max([ease, *(mobility(link, place, name) for place in places)])
                part = FINE_BOUNCE if asked else SECOND_ORDER_BOUNCE if places else 2 * BOUNCE_PER_STEP
                limits.append(part / max(math.sqrt(law.stiffness * ease), law.damping * ease))
        if self.flanks is not None and self.flanks.rigid:
            limits.append(LANDING_PER_STEP * self.flanks.holds / HOLDS)
        for name, spring in link.soft.items():
            ease = mobility(link, q, name)
            limits.append(SOFT_PHASE / max(math.sqrt(spring.stiffness * ease), spring.damping * ease))
        return self.request.step or min(*limits, 0.5 / max(stiffest_law(link, q, self.flanks), 1e-9))

    def give_flanks(self) -> None:
        """Make the flanks of a drive with backlash, and find the one that carries the crank at first."""
        m, schedule = self.mechanism, self.request.schedule
        angle = schedule.crank_angle
        motor = self.motor or Steady(float(angle[0]) if angle is not None else self.assembly.start)
        last = float(schedule.time.max()) if self.motor else motor.begin + 1.0
        times = np.linspace(motor.begin, last, INSTANTS_FELT)
        on_spring = replace(self.request, mechanism=_on_spring(m, 1.0), joint_model="ideal")
        near = MujocoEquilibria(on_spring, self.path, {}, motor.position(motor.begin), STATIC_STEP)
        felt = np.array([near.felt(*at) for at in zip(*(motor.positions(times, n) for n in range(3)), strict=True)])
        self.flanks = Flanks.of(m, Felt(times, *felt.T), motor.top_speed or 1.0)
        rigid = float(np.abs(felt[:, 0]).max()) / FLANK_GIVE
        self.mechanism = _on_spring(m, max(rigid, 1.0) if self.flanks.rigid else self.flanks.stiffness)
        self.request = replace(self.request, mechanism=self.mechanism)
        self.shift = side(felt[0, 0]) * m.half_gap

    # ---------------------------------------------------------------- what came of it

    def observed(self, columns: Mapping[str, np.ndarray], log: Log, how: Mapping[str, SettingValue]) -> Observed:
        """What was seen, with the paths of the pins and the share of time that they are off their walls."""
        times = np.array(log.times) if log.times else None
        pins = [name for name in self.laws if not self.mechanism.joint(name).prismatic]
        return Observed(
            columns,
            {**law_settings(self.request, self.laws), **how, "solver": "Newton, elliptic cone"},
            {name: np.array([[gap.real, gap.imag] for gap in log.gaps[name]]) for name in pins},
            {name: free_share(np.array(gaps), self.wall(name), times) for name, gaps in log.gaps.items()},
        )

    def wall(self, name: str) -> float:
        """How far (m) off its centre a pin begins to be pushed."""
        law = self.laws[name]
        return self.mechanism.joint(name).clearance - (law.margin if law.hard else 0.0)


def _filled(along: np.ndarray) -> np.ndarray:
    """Places on a path in order, with others between them: at least SAMPLES_AT_REST over their range."""
    along = np.unique(along)
    if along.size < 2:
        return along
    between = np.linspace(along[0], along[-1], SAMPLES_AT_REST)
    return np.unique(np.concatenate([along, between]))


def _on_spring(mechanism: Mechanism, stiffness: float) -> Mechanism:
    """The mechanism with a spring (N.m/rad) in place of its drive's backlash."""
    return mechanism.with_drive(half_gap=0.0, stiffness=stiffness)
