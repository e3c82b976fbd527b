"""Static, driven and released runs of an Exudyn linkage: how they rest, start, choose their step and go on."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np

from analytic.mechanism import Joint
from analytic.mechanism.signals import DRIVE_TORQUE, driving
from sim_models.common.contact_laws import contact_parameters, lighter_mass
from sim_models.common.fading import fading_step
from sim_models.common.failed_starts import who
from sim_models.common.free_share import free_share
from sim_models.common.mobility import corner_mass, stop_step
from sim_models.common.start import Pose, check_steps, substeps
from sim_models.engine import JointModel, Request, Watched
from sim_models.exudyn.equilibria import ExudynEquilibria
from sim_models.exudyn.laws import joint_creep, law_settings
from sim_models.exudyn.linkage import ExudynLinkage, Inertia
from sim_models.exudyn.model import ExudynModel
from sim_models.exudyn.motor import BEGIN, INSTANT, SETTLING_TIME, RunMotor
from sim_models.exudyn.steady import passing, spaced, steady_start
from sim_models.exudyn.watch import watched
from sim_models.run.judge import Judge
from sim_models.run.path import CoursePath, Path
from sim_models.run.record import Record, join
from sim_models.run.run import EngineRun, Observed

TURN_PER_STEP = 2e-3  # rad of crank angle in a step, at most
TURN_PER_STEP_OF_COURSES = 1e-3  # rad of the fastest body: loops that several motors hold give more
SWING_PER_STEP = 5e-4  # rad, of a released linkage's time scale: it has no motor to keep its phase
MOST_STEPS_KEPT = 500_000  # all of which are kept
MOST_STEPS_BEYOND = 4_000_000  # of those after the reports, about 200 bytes are kept where they are watched
STEPS_PER_PERIOD = 40  # of the lighter link on a contact's stiffness, or hanging on a massless link
STEPS_PER_SPRING = 400  # of the lighter link on a spring between points, which nothing damps


class ExudynRun(EngineRun):
    """One request on its way to a trace.  Raises AssemblyError where the linkage cannot follow its courses.

    ``motors`` are all that move the linkage, by their loads' signals: the ``crank``'s, or ``drives``, which are by
    joint, and None where a crank moves the linkage or would.
    """

    engine = package = "exudyn"
    linkage: ExudynLinkage  # at work, of a march that has begun

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        m, schedule = request.mechanism, request.schedule
        self.crank = None if schedule.crank is None or request.motor is None else RunMotor.of(request.motor)
        self.motors = {} if self.crank is None else {DRIVE_TORQUE: self.crank}
        self.drives: dict[str, RunMotor] | None = None
        if isinstance(self.path, CoursePath):
            sizes = {joint.name: self.path.size for joint in m.joints if joint.prismatic}
            courses = schedule.courses.items()
            self.drives = {name: RunMotor.of(by, schedule.begin, sizes.get(name, 1.0)) for name, by in courses}
            signals = driving([m.joint(name) for name in self.drives])  # one of no motor, too
            self.motors = {signal.name: by for signal, by in zip(signals, self.drives.values(), strict=False)}
        self.begins = next((motor.begins for motor in self.motors.values()), 0.0)  # s of the run's clock
        self.since = float(-self.clock(np.zeros(1))[0])  # s of the schedule where the run's clock is 0
        stiffness = {
            name: contact_parameters(m, m.joint(name), request.motion).stiffness
            for name in request.clearances
            if request.joint_model != "massless-link"
        }
        self.who = who(self.engine, request)
        self.judge = Judge(self.engine, request, stiffness | request.bearings, self.motors, self.since)
        self.stages: list[tuple[float, float, int, bool]] = []  # that :meth:`advance` has gone through

    def make_path(self) -> Path:
        """Where the linkage is at each place; courses are told by the run's clock, and begin a moment after it."""
        schedule = self.request.schedule
        if schedule.crank is None and schedule.courses and not schedule.at_rest:
            return CoursePath(self.request, self.assembly, BEGIN - schedule.begin)
        return super().make_path()

    def clock(self, time: np.ndarray) -> np.ndarray:
        """Times (N,) s of the run at the schedule's."""
        return next((motor.clock(time) for motor in self.motors.values()), time)

    # ---------------------------------------------------------------- at rest

    def rest(self, places: np.ndarray) -> Observed:
        """Equilibria with the drives where they are at places (N,) on the path."""
        equilibria = ExudynEquilibria(self.request, self.path)
        record = join([equilibria.at(equilibria.crank(place)) for place in places.tolist()])
        timed = record if self.path.driven is None else replace(record, time=places)  # by which it is told
        self.judge.check_together(timed)
        self.judge.check_assembly_mode(timed, self.path)
        return self.observed(record, record)

    # ---------------------------------------------------------------- in motion

    def march(self, times: np.ndarray) -> Observed:
        """Start, and integrate through reports at times (N,) s, sorted, and on beyond them."""
        last = float(self.clock(times)[-1])
        if self.crank is not None and not self.crank.steady:
            self.assembly.path(*self.crank.range)  # raises where the crank cannot follow all of its course
        linkage, self.step = self.launch()
        beyond = self.request.beyond / abs(self.mechanism.speed or 1.0)
        check_steps(self.who, last, self.step, MOST_STEPS_KEPT)
        check_steps(self.who, beyond, self.step, MOST_STEPS_BEYOND)
        record, rows = self.through(linkage, self.clock(times))
        self.check_moved(record)
        since = record.rows(slice(int(rows[0]), None)) if self.motors else record
        watched_parts = []
        for part in chain([since], self.onward(linkage, last, beyond)):
            if self.request.watched and self.crank is not None:
                loose = [self.mechanism.joint(name) for name in self.request.clearances]
                watched_parts.append(watched(part, loose, self.crank, linkage.model.blocks))
        if watched_parts:
            watched_parts[0].time[rows - rows[0]] = times  # without the rounding of sums of steps
        return self.observed(record.rows(rows), since, join(watched_parts) if watched_parts else None)

    def through(self, linkage: ExudynLinkage, times: np.ndarray) -> tuple[Record, np.ndarray]:
        """Integrate from 0 through times (N,) s of the run's clock, sorted: every step, and the row of each time."""
        assert self.step is not None
        self.linkage, self.stages = linkage, []
        parts, clock = [self.advance(linkage, 0.0, INSTANT, 1).rows(slice(0, 1))], INSTANT
        stops, onward = np.unique(times), self.begins > 0
        if onward:
            parts, clock = [self.advance(linkage, clock, self.begins, 0).rows(slice(1, None))], self.begins
            for motor in self.motors.values():
                stops = np.union1d(stops, motor.knots_between(stops, self.step))
        ends, rows = [clock], [0]
        for end in stops[stops > clock].tolist():
            if onward and end - clock > 10 * SETTLING_TIME:
                self.advance(linkage, clock, clock + SETTLING_TIME, 0)
                clock += SETTLING_TIME
            count, _ = substeps(end - clock, self.step)
            parts.append(self.advance(linkage, clock, end, count, onward).rows(slice(1, None)))
            clock = end
            ends.append(clock)
            rows.append(rows[-1] + parts[-1].time.size)
        return join(parts), np.array(rows)[np.searchsorted(ends, times)]

    def onward(self, linkage: ExudynLinkage, begin: float, beyond: float) -> Iterator[Record]:
        """Every step of a time ``beyond`` (s) the reports, a revolution at a time: Exudyn keeps what its sensors see in
        one integration.
        """
        if not beyond:
            return
        assert self.step is not None
        pieces = math.ceil(self.request.beyond / (2 * math.pi) - 1e-9)
        for start, end in pairwise(np.linspace(begin, begin + beyond, pieces + 1).tolist()):
            record = self.advance(linkage, start, end, substeps(end - start, self.step)[0]).rows(slice(1, None))
            self.check_moved(record)
            yield record

    def advance(self, linkage: ExudynLinkage, begin: float, end: float, count: int, onward: bool = False) -> Record:
        """Integrate in ``count`` steps from time to time (s), or settle in one (count 0); ``onward`` starts with the
        accelerations of the step before.
        """
        if not (linkage.advance(begin, end, count, onward) if count else linkage.settle(begin, end)):
            raise self.judge.failure(
                f"the integrator gave up between {begin:.6g} s and {end:.6g} s (step"
                f" {(end - begin) / max(count, 1):.3g} s)"
            )
        self.stages.append((begin, end, count, onward))
        record = linkage.history()
        self.judge.check_together(record)
        return record

    def check_moved(self, record: Record) -> None:
        """Raise SimulationError where the linkage has not moved as one does."""
        if not self.path.held and self.drives is not None and self.request.joint_model in ("ideal", "massless-link"):
            self.judge.check_smooth(record)
        self.judge.check_energy(record)
        if self.path.held:
            self.judge.check_assembly_mode(record, self.path)

    # ---------------------------------------------------------------- start

    def launch(self) -> tuple[ExudynLinkage, float]:
        """The linkage ready to go, and its longest step (s): without transients where motors hold all of it, else as it
        is let go.
        """
        r, m, path, crank = self.request, self.mechanism, self.path, self.crank
        inertia = None if path.held else self.release_accelerations()
        place = path.begin if inertia else 0.0 if crank is None else float(crank.angle(0.0))
        speed = r.schedule.start_speed(m) if crank is None else float(crank.rate(0.0))
        start, pressing = path.moving(place, speed), dict[str, float]()
        stiffness = None if crank is None else m.drive_stiffness
        if stiffness is not None or ((r.clearances or r.bearings) and r.start == "steady"):
            resting = r if r.start == "steady" else Request(m.tight())
            equilibria = ExudynEquilibria(resting, path, 0.0, joint_creep([*self.motors.values()]))
            if crank is not None:
                start, here = steady_start(equilibria, crank, stiffness)
            elif inertia is None:
                time = spaced(path.top_speed, min(motor.end for motor in self.motors.values()))
                start, here = passing(equilibria, time, time)
            else:
                here = equilibria.at(place, inertia)
                start = path.moving(place, speed, here.gaps(equilibria.displaced))
            pressing = {name: abs(force[0]) for name, force in here.force.items()}
        if inertia is not None:
            start = self.before(start, inertia)
        linkage = self.modelled(r.joint_model, start)
        return linkage, r.step or self.longest_step(linkage, inertia, pressing)

    def modelled(self, joint_model: JointModel, start: Mapping[str, Pose]) -> ExudynLinkage:
        """The linkage with its motors, in these poses."""
        drives, redundant = self.drives, self.assembly.overheld
        model = ExudynModel(
            self.mechanism, joint_model, "driven", start, motor=self.crank, drives=drives, redundant=redundant
        )
        model.since = self.since
        return ExudynLinkage(model)

    def release_accelerations(self) -> Inertia:
        """Accelerations of the ideal linkage as it, or a part of it, is let go."""
        linkage = self.modelled("ideal", self.path.moving(self.path.begin - self.begins, 0.0))
        self.advance(linkage, 0.0, INSTANT, 1)
        if self.begins:
            self.advance(linkage, INSTANT, self.begins, 0)
        return linkage.inertia()

    def before(self, start: Mapping[str, Pose], inertia: Inertia) -> dict[str, Pose]:
        """Poses at time 0 of a run in which what moves freely is let go in these poses, where the courses begin."""
        poses, time = {}, self.begins
        for name, pose in start.items():
            spin, arm = pose.angular_velocity, self.mechanism.moving[name].centre * np.exp(1j * pose.angle)
            acceleration = inertia.linear[name] - (1j * inertia.angular[name] - spin**2) * arm
            poses[name] = Pose(
                pose.origin - time * pose.velocity,
                pose.angle - time * spin,
                complex(pose.velocity - time * acceleration),
                spin - time * inertia.angular[name],
            )
        return poses

    def longest_step(self, linkage: ExudynLinkage, inertia: Inertia | None, pressing: Mapping[str, float]) -> float:
        """The longest step (s) for motors, for what is let go with these accelerations, for springs and bearings, and
        for pins under these forces (N).
        """
        m, steps = self.mechanism, [motor.longest_step for motor in self.motors.values()]
        if self.crank is not None:
            steps.append(TURN_PER_STEP / max(self.crank.top_speed, 1.0))
        elif self.motors or self.path.top_speed:
            steps.append(TURN_PER_STEP_OF_COURSES / max(self.path.top_speed, 1.0))
        if inertia is not None:
            rate = max(math.sqrt(abs(w)) for w in inertia.angular.values())
            steps.append(SWING_PER_STEP / max(rate, 1.0))
        for spring in m.springs:
            mass = min(m.moving[name].mass for name in spring.bodies if name in m.moving)
            if spring.stiffness:
                steps.append(2 * math.pi * math.sqrt(mass / spring.stiffness) / STEPS_PER_SPRING)
        if inertia is not None:
            steps += [stop_step(m), fading_step(m)]
        for name in (*self.request.bearings, *self.request.clearances):
            joint, stiffness = m.joint(name), linkage.model.stiffness(name)
            if name in self.request.clearances and self.request.joint_model == "massless-link":
                stiffness = pressing[name] / joint.clearance
            corner = joint.prismatic and name in self.request.clearances
            mass = self.corner_mass(joint) if corner else lighter_mass(m, joint)
            steps.append(2 * math.pi * math.sqrt(mass / stiffness) / STEPS_PER_PERIOD)
        return min(steps)

    def corner_mass(self, joint: Joint) -> float:
        """Mass (kg) that a block's corners have for their walls, where the linkage is first closed."""
        m, loose = self.mechanism, {*self.request.clearances, *self.request.bearings}
        closed = [each for each in m.joints if each.name not in loose]
        held = [m.joint(name) for name in self.request.schedule.drives]
        return corner_mass(m, self.path.poses(self.path.begin), joint, closed, held)

    # ---------------------------------------------------------------- what came of it

    def observed(self, sampled: Record, dense: Record, every_step: Watched | None = None) -> Observed:
        """Signals at the sampled instants, the pins' paths and free share over the dense record; along courses a drive
        is between its joint's bodies, and a crank's torque is on the crank.
        """
        m, schedule, clearance = self.mechanism, self.request.schedule, self.request.clearances
        columns = sampled.columns(m)
        if schedule.crank is None and schedule.drives and m.crank_sign < 0:
            columns[DRIVE_TORQUE] = -columns[DRIVE_TORQUE]
        gaps = {name: dense.gap[name] for name in clearance if name not in dense.tilt}
        return Observed(
            columns,
            {
                "solver": "static Newton" if schedule.at_rest else "trapezoidal rule, index 2",
                "step": self.step,
                **law_settings(self.request),
            },
            {name: np.column_stack([gap.real, gap.imag]) for name, gap in gaps.items()},
            {name: free_share(dense.reach(m.joint(name)), size, dense.time) for name, size in clearance.items()},
            every_step,
        )
