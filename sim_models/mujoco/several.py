"""Runs of a MuJoCo linkage whose joints follow courses, or that moves freely with more than a crank's freedom."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sim_models.common.failed_starts import own_start
from sim_models.common.travel import told_by, with_positions
from sim_models.engine import Request, Trace
from sim_models.mujoco.equilibrium import Equilibria
from sim_models.mujoco.mjcf import Setting
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.motor import AHEAD, AROUND, BESIDE, AlongCourses, spacing
from sim_models.mujoco.runs import GLIMPSES, RESTING, STATIC_STEP, MujocoRun, Run, State, scatter
from sim_models.mujoco.state import friction_torques, joint_forces, look, on_track, signals
from sim_models.mujoco.steady import derivative
from sim_models.run.path import CoursePath, Gaps, RestingPath

LARGEST_STEP = 2e-4  # s: loops that several motors hold give more than one behind a crank


class CoursesRun(Run):
    """A request with courses of its driven joints, or with none, where all moves freely.

    Raises AssemblyError where the linkage cannot follow them.
    """

    largest_step = LARGEST_STEP

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        self.path = self.courses = CoursePath(request, self.assembly)
        self.hold, self.follows = self.courses.held, bool(self.courses.motors)
        if self.follows:
            self.steering = self.motors = AlongCourses([*self.courses.motors.values()])
            self.steering.top_speed = self.courses.top_speed

    def passed(self) -> np.ndarray:
        return (
            np.linspace(self.courses.begin, float(self.request.schedule.time.max()), GLIMPSES)
            if self.courses.held
            else np.zeros(0)
        )

    def trace(self) -> Trace:
        """Run the request."""
        time = self.request.schedule.time
        order = np.argsort(time, kind="stable")
        with own_start("mujoco", self.request, self.assembly):
            q, v, step, how = self.begin()
            signals, log, step = self.run(
                self.courses.begin, (q, v), self.again, step, time[order], float(time.min()) - self.courses.begin
            )
        columns = {name: scatter(values, order) for name, values in signals.items()}
        return led(self, self.report(np.zeros(time.size), time, columns, log, {"step": step, "start": how}))

    def begin(self, step: float | None = None) -> tuple[np.ndarray, np.ndarray, float, str]:
        """Coordinates, velocities, step (s; the longest that is in order, where none is given) and kind of start."""
        begin = self.courses.begin
        near = self.near(begin)
        if not self.courses.held:
            return self.let_go(near, step)
        slides = {joint.name for joint in self.mechanism.joints if joint.prismatic}
        apart = min(spacing(c, near.ideal.size if n in slides else 1.0) for n, c in self.courses.motors.items())
        if self.courses.top_speed:
            apart = min(apart, BESIDE / self.courses.top_speed)
        q, v, step, how = self.settle(near, begin + apart * AHEAD, apart * AHEAD, 0, step)
        v[near.pressed.motors] = self.motors.at(near.pressed, np.array([begin]), 1)[0]
        return q, v, step, how

    def again(self, step: float) -> State:
        """Coordinates and velocities of the start where rows give as they do in such steps (s)."""
        return self.begin(step)[:2]

    def let_go(self, near: Equilibria, step: float | None) -> tuple[np.ndarray, np.ndarray, float, str]:
        """The same where something moves freely: there is no steady motion, but pins are pressed, and what is driven
        moves.
        """
        begin, pressed = self.courses.begin, near.pressed
        gaps = self.gaps_at_release(near) if self.laws else {}
        q = near.place(pressed, begin, gaps)
        v = np.zeros(q.size)
        if self.courses.top_speed:
            instants = AROUND * BESIDE / self.courses.top_speed
            around = np.array([near.place(pressed, begin + x, gaps) for x in instants])
            v = (derivative(instants) @ around)[2]
            v[pressed.motors] = self.motors.at(pressed, np.array([begin]), 1)[0]
        return q, v, self.longest_step(near, q) if step is None else step, "released"

    def gaps_at_release(self, near: Equilibria) -> Gaps:
        """Gaps (m) along the ideal linkage's reactions at the start, x where there is none; zero to start centred."""
        if self.centred:
            return {}
        setting = Setting("ideal", STATIC_STEP, self.hold, follows=self.follows, driven=self.courses.driven)
        link = MujocoLinkage(self.mechanism, {}, self.courses.poses(self.courses.begin), setting)
        link.data.qpos[:] = near.place(link, self.courses.begin)
        self.steering.place(link, self.courses.begin, 0.0)
        on_track(link)
        look(link)
        seen = signals(link, joint_forces(link, link.data.efc_force), friction_torques(link))
        return {name: near.rim(name, force or complex(1e-12)) for name, force in near.noted(seen).items()}


class RestingRun(Run):
    """A request for equilibria of a linkage that all of its drives hold where their courses have them.

    Raises AssemblyError where the linkage cannot be there.
    """

    def __init__(self, request: Request) -> None:
        super().__init__(request)
        self.path = RestingPath(request, self.assembly)

    def trace(self) -> Trace:
        """Run the request."""
        time = self.request.schedule.time
        with own_start("mujoco", self.request, self.assembly):
            columns, log = self.equilibria(time)
        return led(self, self.report(np.zeros(time.size), time, columns, log, RESTING))


def led(run: Run, trace: Trace) -> Trace:
    """A trace with the positions of its joints, and with what the run is told by as its crank angle."""
    trace = with_positions(run.mechanism, trace)
    return replace(trace, crank_angle=trace.signals[told_by(run.mechanism, run.assembly.structure)])


def run_of(request: Request) -> MujocoRun | CoursesRun | RestingRun:
    """A request on its way to a trace.  Raises AssemblyError."""
    if request.schedule.crank is not None:
        return MujocoRun(request)
    return (RestingRun if request.schedule.at_rest else CoursesRun)(request)
