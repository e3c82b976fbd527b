"""Platforms over their workspaces: how far clearance moves them, and how far the paper's Eq. 8 is off; in engines with
real contact too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.inverse import inverse
from analytic.kinematics.motion import Motion, kinematics
from analytic.kinematics.output import Output
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.paper.clearance import Model, displaced
from compare.arguments import cores
from compare.platform import platform_accuracy
from compare.questions.accuracy import WorkspaceGrid
from compare.results.crosscheck import Failure
from compare.results.platform import PlatformAccuracy
from compare.simulations import simulate_all
from sim_models.engine import MOTIONS, Request, SimulationError, Trace, declared
from sim_models.engine import Motion as MotionName
from tests.evidence.results.validation import InEngine, OverWorkspace

CLEARANCE = 1e-4  # m, in every pin
SQUARE: WorkspaceGrid = ((-0.2, 0.2, 41), (-0.2, 0.2, 41))
WORKSPACES: dict[str, tuple[str, WorkspaceGrid]] = {
    "five-bar": ("left-arm.P", ((-0.1, 0.25, 41), (0.0, 0.3, 41))),
    "3-rrr": ("platform", SQUARE),
    "3-rpr": ("platform", SQUARE),
}
HELD = (5.0, 10.0)  # condition numbers of the loops up to which poses count
SPIRALS = {"five-bar": 0.05, "3-rrr": 0.06, "3-rpr": 0.06}  # m, as far as an engine moves a platform from its assembly
POSE: tuple[Literal["x", "y", "angle"], ...] = ("x", "y", "angle")
TURNS, LASTING, KNOTS, EVERY = 2, 6.0, 161, 8  # s; a pose is looked at every eighth knot


def workspaces() -> dict[str, tuple[OverWorkspace, ...]]:
    """By case: Eq. 8 against the self-consistent equilibrium with every pin loose, at rest over the workspace."""
    found = {}
    for case, (output, grid) in WORKSPACES.items():
        told = platform_accuracy(loose(load(case)), outputs=output, workspace=grid)
        found[case] = tuple(_held(told, limit) for limit in HELD)
    return found


def loose(m: Mechanism) -> Mechanism:
    """Every pin with clearance."""
    return m.with_clearances({joint.name: CLEARANCE for joint in m.joints if not joint.prismatic})


def _held(told: PlatformAccuracy, limit: float) -> OverWorkspace:
    x, y = (next(d for d in told.outputs.values() if d.axis == axis) for axis in "xy")
    first_order, equilibrium = x.nominal + 1j * y.nominal, x.equilibrium + 1j * y.equilibrium
    (point,) = told.points.values()
    at = (told.holding < limit) & np.isfinite(equilibrium)
    off = np.abs(first_order - equilibrium)[at] / np.abs(equilibrium)[at]
    return OverWorkspace(
        holding=limit,
        poses=int(at.sum()),
        displacement=float(np.abs(equilibrium[at]).max()),
        farthest=float(point.farthest[at].max()),
        first_order=float(np.median(off)),
        first_order_worst=float(off.max()),
    )


# ---------------------------------------------------------------- in engines


def in_engines(names: Sequence[str], cases: Sequence[str] = tuple(SPIRALS)) -> dict[str, tuple[InEngine, ...]]:
    """By case: the platform with every pin loose at poses along a spiral, in every engine with contact: at rest, and
    moved slowly from one to the next.

    Raises SimulationError where an engine fails.
    """
    able = [
        (motion, name)
        for motion in MOTIONS
        for name in names
        if ("several_drives", ("contact", motion)) in declared(name).capabilities.rigid.features
    ]
    moved = [(case, name, Spiral(case, motion)) for case in cases for motion, name in able]
    tasks = [(name, spiral.request()) for _, name, spiral in moved]
    found: dict[int, InEngine] = {}
    for k, outcome in simulate_all(tasks, cores()):
        case, name, spiral = moved[k]
        if isinstance(outcome, Failure):
            raise SimulationError(f"{case} along a spiral in {name}, {spiral.motion}: {outcome.why}")
        found[k] = spiral.told(outcome)
    return {case: tuple(found[k] for k in sorted(found) if moved[k][0] == case) for case in cases}


class Spiral:
    """A platform's slow way from where it is assembled outwards, at the angle that it has there, driven along it or at
    rest in poses of it.
    """

    def __init__(self, case: str, motion: MotionName) -> None:
        self.motion: MotionName = motion
        self.mechanism = loose(load(case))
        self.assembly = Assembly(self.mechanism)
        s, (body, _, point) = self.assembly.structure, WORKSPACES[case][0].partition(".")
        pose = tuple(Output(body, axis, point or "com") for axis in POSE)
        self.wanted = pose[: len(s.inputs)]
        home = kinematics(self.assembly, self.assembly.inputs[:, None])
        share = np.linspace(0.0, 1.0, KNOTS)
        share = share**3 * (10 - 15 * share + 6 * share**2)  # begins and ends at rest
        poses = np.stack([np.full(KNOTS, float(w.value(home)[0])) for w in self.wanted])
        out = SPIRALS[case] * share * np.exp(2j * np.pi * TURNS * share)
        poses[0] += out.real
        poses[1] += out.imag
        along, time = inverse(self.assembly, self.wanted, poses).coordinates, np.linspace(0.0, LASTING, KNOTS)
        courses = {s.coordinates[i].joint: (time, s.signs[i] * along[i]) for i in s.inputs}
        self.schedule = Schedule.along(courses, time[EVERY::EVERY], at_rest=motion == "static")

    def request(self) -> Request:
        """What an engine is asked for."""
        return Request(self.mechanism, "contact", self.schedule)

    def told(self, trace: Trace) -> InEngine:
        """How far the analytic side is off an engine."""
        engine = self.simulated(trace.signals)
        off = {
            model: np.abs(self.analytic(model) - engine) / np.abs(engine) for model in ("equilibrium", "first_order")
        }
        return InEngine(
            simulator=trace.simulator,
            motion=self.motion,
            poses=engine.size,
            equilibrium=digits(np.median(off["equilibrium"])),
            equilibrium_worst=digits(off["equilibrium"].max()),
            first_order=digits(np.median(off["first_order"])),
            first_order_worst=digits(off["first_order"].max()),
            flies=digits(max(trace.free_share.values(), default=0.0)),
        )

    def simulated(self, signals: Mapping[str, np.ndarray]) -> np.ndarray:
        """Displacement (N,) of the platform's point, x + iy (m), in an engine."""
        body, point = self.wanted[0].body, self.wanted[0].point
        b = self.mechanism.moving[body]
        arm = 0.0 if point == "com" else b.point(point) - b.centre
        place = signals[f"{body}_x"] + 1j * signals[f"{body}_y"] + arm * np.exp(1j * signals[f"{body}_angle"])
        inputs = self.assembly.inputs_at(self.schedule.positions())
        return place - self.place(kinematics(self.assembly, inputs))

    def analytic(self, model: Model) -> np.ndarray:
        """The same by the analytic model, with the inertia of the motion where there is one."""
        theta, omega, alpha = (self.assembly.inputs_at(self.schedule.positions(order=order)) for order in range(3))
        if self.motion == "static":
            omega, alpha = np.zeros_like(omega), np.zeros_like(alpha)
        found = displaced(self.assembly, theta, omega, alpha=alpha, model=model)
        return self.place(found.configuration.motion) - self.place(found.ideal.motion)

    def place(self, motion: Motion) -> np.ndarray:
        """Where the platform's point is (N,), x + iy (m)."""
        x, y = (w.value(motion) for w in self.wanted[:2])
        return x + 1j * y


def digits(value: float, count: int = 2) -> float:
    """A number to two digits, or to so many."""
    return float(f"{value:.{count - 1}e}")
