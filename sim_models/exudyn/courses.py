"""Runs of an Exudyn linkage whose joints follow courses, or that moves freely with more than a crank's freedom."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from analytic.mechanism.signals import driving
from sim_models.common.failed_starts import own_start, who
from sim_models.common.start import Pose
from sim_models.engine import Cause, JointModel, Request, SimulationError, Trace
from sim_models.exudyn.equilibria import Equilibria
from sim_models.exudyn.laws import joint_creep
from sim_models.exudyn.linkage import ExudynLinkage, Inertia
from sim_models.exudyn.model import ExudynModel
from sim_models.exudyn.motor import BEGIN, INSTANT, RunMotor
from sim_models.exudyn.record import Record, join, travel
from sim_models.exudyn.runs import Run, swing_step
from sim_models.exudyn.steady import passing, spaced
from sim_models.run.path import CoursePath, RestingPath

PACE = 1.0  # rad/s of the fastest drive of an equilibrium, which only has a direction
TURN_PER_STEP = 1e-3  # rad of the fastest body in a step, at most: loops that several motors hold give more


class CoursesRun(Run):
    """A request with courses of its driven joints, or with none, where all moves freely.

    Raises AssemblyError where the linkage cannot follow them.
    """

    path: CoursePath

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        first, courses = request.schedule.begin, request.schedule.courses
        self.path = CoursePath(request, self.assembly, ahead=BEGIN - first if courses else 0.0)
        slides = {joint.name for joint in self.m.joints if joint.prismatic}
        self.drives = {
            name: RunMotor.of(course, first, self.path.size if name in slides else 1.0)
            for name, course in courses.items()
        }
        self.motors = [*self.drives.values()]
        signals = driving([self.m.joint(name) for name in self.drives])
        named = {signal.name: motor for signal, motor in zip(signals, self.motors, strict=False)}  # none: one signal
        self.judge = replace(self.judge, motors=named)

    def trace(self) -> Trace:
        """Run the request."""
        time = self.request.schedule.time
        passed = time + self.path.ahead
        order = np.argsort(passed, kind="stable")
        with own_start("exudyn", self.request, self.assembly):
            linkage, longest = self.launch()
            history, marks = self.march(linkage, passed[order], longest, self.motors)
            self.check_moved(history)
        seen = history.rows(slice(int(marks[0]), None)) if self.motors else history
        return self.report(history.rows(marks[np.argsort(order)]), seen, time, longest)

    def check_moved(self, history: Record) -> None:
        """Raise SimulationError where the linkage has not moved as one does."""
        if self.path.held:
            self.check(self.judge.in_assembly_mode(history, self.path))
        elif self.request.joint_model in ("ideal", "massless-link"):
            jump = self.judge.abrupt(history)
            if jump:
                raise SimulationError(
                    f"{who('exudyn', self.request)}: {jump}",
                    Cause.DIVERGED,
                    "ask for times before that, or use another simulator",
                )
        self.check(self.judge.energy(history))

    def launch(self) -> tuple[ExudynLinkage, float]:
        """The linkage ready to go, and its longest step (s)."""
        r, path = self.request, self.path
        inertia = self.release_accelerations() if not path.held else None
        start, pressing = path.moving(path.begin if inertia else 0.0), dict[str, float]()
        if (self.clearance or self.bearings) and r.start == "steady":
            equilibria = Equilibria(r, path, 0.0, joint_creep(self.motors))
            if inertia is None:
                time = spaced(path.top_speed, path.schedule.end + path.ahead)
                start, here = passing(equilibria, time, time)
            else:
                here = equilibria.at(path.begin, inertia)
                gaps = here.gaps(equilibria.displaced)
                start = path.moving(path.begin, gaps=gaps)
            pressing = {name: abs(force[0]) for name, force in here.force.items()}
        if inertia is not None:
            start = self.before(start, inertia)
        steps = [motor.longest_step for motor in self.motors]
        steps += [TURN_PER_STEP / max(path.top_speed, 1.0)] if self.motors else []
        steps += [swing_step(inertia)] if inertia else []
        linkage = self.linkage(r.joint_model, start)
        return linkage, r.step or self.longest_step(linkage, steps, pressing)

    def linkage(self, joint_model: JointModel, start: Mapping[str, Pose]) -> ExudynLinkage:
        """The linkage with its motors."""
        return ExudynLinkage(
            ExudynModel(self.m, joint_model, "driven", start, drives=self.drives, redundant=self.redundant)
        )

    def before(self, start: Mapping[str, Pose], inertia: Inertia) -> dict[str, Pose]:
        """Poses at time 0 of a run in which what moves freely is let go in these poses, where the courses begin."""
        found, time = {}, self.path.begin
        for name, pose in start.items():
            spin, arm = pose.angular_velocity, self.m.moving[name].centre * np.exp(1j * pose.angle)
            acceleration = inertia.linear[name] - (1j * inertia.angular[name] - spin**2) * arm
            found[name] = Pose(
                pose.origin - time * pose.velocity,
                pose.angle - time * spin,
                complex(pose.velocity - time * acceleration),
                spin - time * inertia.angular[name],
            )
        return found

    def release_accelerations(self) -> Inertia:
        """Accelerations of the ideal linkage as it, or a part of it, is let go."""
        linkage = self.linkage("ideal", self.path.moving(0.0))
        self.advance(linkage, 0.0, INSTANT, 1)
        if self.motors:
            self.advance(linkage, INSTANT, self.path.begin, 0)
        return linkage.inertia()

    def leading(self, sampled: Record) -> np.ndarray:
        """What the run is told by (N,) rad, m."""
        return first_input(self, sampled)


class RestingRun(Run):
    """A request for equilibria of a linkage that all of its drives hold where their courses have them.

    Raises AssemblyError where the linkage cannot be there.
    """

    path: RestingPath

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        self.path = RestingPath(request, self.assembly)
        self.judge = replace(self.judge, motors={})  # instants are told by time

    def trace(self) -> Trace:
        """Run the request."""
        time = self.request.schedule.time
        order = np.argsort(time, kind="stable")
        with own_start("exudyn", self.request, self.assembly):
            equilibria = Equilibria(self.request, self.path, PACE)
            found = join([equilibria.at(float(at)) for at in time[order]])
            timed = replace(found, time=time[order])
            self.check(self.judge.finite(timed), self.judge.joined(timed))
            self.check(self.judge.in_assembly_mode(timed, self.path))
        return self.report(found.rows(np.argsort(order)), found, time)

    def leading(self, sampled: Record) -> np.ndarray:
        """What the run is told by (N,) rad, m."""
        return first_input(self, sampled)


def first_input(run: Run, sampled: Record) -> np.ndarray:
    """The crank's angle (N,) rad, or without a crank the position (rad, m) of the first input's joint."""
    s = run.assembly.structure
    return run.m.crank_sign * travel(run.m, sampled, run.m.joint(s.coordinates[s.inputs[0]].joint))
