"""Driven, released and static runs of somebody's MuJoCo model, in its own time step and with its own solver."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from analytic.kinematics.assembly import AssemblyError
from sim_models.common.start import check_steps
from sim_models.engine import Cause, Request, SettingValue, SimulationError, Trace
from sim_models.mjcf.linkage import EQUALITY, TheirLinkage
from sim_models.mjcf.planar import Planar
from sim_models.mjcf.plane import body_words
from sim_models.mjcf.start import DRY, rest
from sim_models.mjcf.steering import ModelSteering
from sim_models.run.grid import StepGrid
from sim_models.run.path import MotorPath
from sim_models.run.run import EngineRun, Observed, columns_of

STENCIL_SPACING = 1e-3  # rad between the places whose poses give the rates of the ideal linkage
CRANK_STENCIL = np.arange(-2, 3)  # those places
FIRST_SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12 * STENCIL_SPACING)  # 1/rad, and the second derivative
SECOND_SLOPE = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12 * STENCIL_SPACING**2)
SPACINGS_PER_KNOT = 4.0  # the instants of a stencil lie no farther apart than a fourth of the time between knots
LEAD = 6.0  # time constants of the softest loop
LEAD_HALVINGS = 8  # of a lead-in that is too long
TOO_FAST = 1.5  # times its top speed: a course that is drawn out too far
ROOM_TO_LOCK = 5e-3  # rad that are left to where the linkage locks
PARTED = 0.2  # of the linkage's size: a loop that opens by more is none
LIMIT_ROWS = (int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT), int(mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON))
MOST_NAMED = 3  # pairs of geoms, by name
RK4 = int(mujoco.mjtIntegrator.mjINT_RK4)


@dataclass(frozen=True)
class Touch:
    """Two geoms that touch: when ``first`` they were seen to, in words, and their largest ``force`` (N)."""

    first: str
    force: float


class TheirRun(EngineRun):
    """One request on its way to a trace, in a file's own model.  Raises AssemblyError where the linkage cannot follow
    its courses.
    """

    package = "mujoco"
    crank_by_time = True

    def __init__(self, name: str, request: Request, planar: Planar) -> None:
        super().__init__(replace(request, lead_in=0.0))  # how it leads in it finds itself
        self.engine, self.planar = name, planar
        driven = [self.mechanism.joint(joint) for joint in request.schedule.drives]
        self.link = TheirLinkage(self.assembly, planar, driven)
        self.motors = [request.schedule.drives[one.joint] for one in self.link.held]
        self.model, self.data = self.link.model, self.link.data
        self.timestep = float(self.model.opt.timestep)
        self.lag = 0.0 if int(self.model.opt.integrator) == RK4 else self.timestep / 2
        self.who = f"{name}: {self.mechanism.name}"
        self.most_contacts, self.most_limits, self.open = 0, 0, 0.0
        self.touching: dict[tuple[int, int], Touch] = {}  # by geoms
        self.began = 0.0  # s, the time at which a run begins
        # how fast (rad/s) the stencil of a crank's angles is passed, to be one of instants
        self.pace = max(self.path.top_speed, SPACINGS_PER_KNOT * STENCIL_SPACING / self.path.knot_spacing) or 1.0

    def attempt(self) -> Trace:
        return replace(super().attempt(), version=f"in MuJoCo {mujoco.__version__}")

    # ------------------------------------------------------------------ runs

    def rest(self, places: np.ndarray) -> Observed:
        """The equilibrium with the drives held at each place, by Newton's method on the model's own equations."""
        still, rows = np.zeros(self.model.nv), []
        for place in places.tolist():
            where = f"where its drives are at {place:.4g} s"
            if self.request.schedule.crank is not None:
                where = f"at crank angle {math.degrees(place):.4g} deg"
            if rest(self.link, self.link.placed(self.path.poses(place)), still, still, 0.0) is None:
                remedy = "look at the model there in MuJoCo's viewer"
                what = f"{self.who}: no equilibrium was found {where}"
                raise SimulationError(what, Cause.NO_EQUILIBRIUM, remedy)
            self.check_alone(where)
            self.note(where)
            rows.append(self.link.signals(still))
        return self.observed(columns_of(rows), {"step": None, "start": "equilibrium"})

    def march(self, times: np.ndarray) -> Observed:
        """Motors move from a state without transients, or what is let go from closed loops, through reports at times
        (N,) s.
        """
        path, alone = self.path, self.request.schedule.crank is not None
        lead = self.lead() if path.held else 0.0
        begin = self.began = path.begin - lead
        q, v = self.steady(begin) if path.held else self.ideal(begin)[:2]
        columns = self.stepped(q, v, times - begin, ModelSteering(self.link, self.motors, begin, self.lag))
        how: dict[str, SettingValue] = {
            "time_step": self.timestep,
            "start": "equilibrium" if path.held else "released",
        }
        if not alone:
            how["lead_in_time"] = lead
        elif path.held:
            how["lead_in"] = (self.mechanism.speed or 0.0) * lead
        else:
            columns = {"drive_torque": np.zeros(times.size), **columns}
        return self.observed(columns, how)

    def lead(self) -> float:
        """How long (s) before its motors begin a run does, on their courses drawn out backwards: until what its start
        has left in soft rows is gone, as far as motors then move no faster and the linkage can come from there; a crank
        turns once at most.
        """
        longest = self.settling()
        if isinstance(self.path, MotorPath):
            longest = min(longest, 2 * math.pi / self.path.top_speed)
        return next((lead for lead in longest / 2.0 ** np.arange(LEAD_HALVINGS) if self.can_come(lead)), 0.0)

    def can_come(self, lead: float) -> bool:
        """Whether the motors, and the linkage, can come from so long (s) before the motors' begin."""
        path = self.path
        before = path.begin - lead * np.array([0.5, 1.0])
        for motor in self.motors:
            if np.abs(motor.positions(before, 1)).max() > TOO_FAST * motor.top_speed:
                return False
        try:
            if isinstance(path, MotorPath):
                self.assembly.path(path.said(path.begin), path.said(before[1] - ROOM_TO_LOCK / path.top_speed))
            else:
                for time in before.tolist():
                    path.poses(time - 2 * STENCIL_SPACING / self.pace)
        except AssemblyError:
            return False
        return True

    def settling(self) -> float:
        """How long (s) it takes until what a start has left in soft rows is gone."""
        periods = self.model.eq_solref[self.model.eq_active0.astype(bool), 0] if self.model.neq else np.zeros(0)
        return LEAD * float(periods.max(initial=0.0))

    def steady(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and velocities in which the motors pass a time (s) without transients."""
        q, v, _ = self.ideal(time)
        around = [rest(self.link, *self.ideal(time + x), self.lag) for x in STENCIL_SPACING / self.pace * CRANK_STENCIL]
        known = np.array([each for each in around if each is not None])
        if len(known) < len(around):
            return q, v
        rate = FIRST_SLOPE @ known * self.pace
        rate[self.link.dofs] = v[self.link.dofs]
        return known[2], rate

    def ideal(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates, velocities and accelerations of the ideal linkage at a time (s), as if nothing moved freely."""
        q = np.array([self.link.placed(self.path.poses(time + x)) for x in STENCIL_SPACING / self.pace * CRANK_STENCIL])
        v, a = FIRST_SLOPE @ q * self.pace, SECOND_SLOPE @ q * self.pace**2
        steering = ModelSteering(self.link, self.motors, time)
        v[self.link.dofs], a[self.link.dofs] = (steering.at(np.zeros(1), order)[0] for order in (1, 2))
        return q[2], v, a

    # ------------------------------------------------------------------ steps

    def stepped(
        self, q: np.ndarray, v: np.ndarray, times: np.ndarray, steering: ModelSteering
    ) -> dict[str, np.ndarray]:
        """Signals (N,) at times (N,) s after the begin of a run, at true velocities v (nv,): those at the steps around
        each, joined by a cubic.

        Raises SimulationError: the run diverged, came apart, or would take too long.
        """
        m, d, dofs = self.model, self.data, self.link.dofs
        remedy = "give the file a larger timestep, or ask for less"
        check_steps(self.who, float(times[-1]), self.timestep, remedy=remedy)
        mujoco.mj_resetData(m, d)
        d.qpos[:], d.qvel[:] = q, v
        steering.touched = lambda step: self.touch(self.when(step))
        steering.start()
        d.qvel[:] -= self.lag * d.qacc
        d.qvel[dofs] = steering.at(np.zeros(1), 1, -self.lag)[0]
        grid = StepGrid.of(times, 0.0, self.timestep)
        rows: dict[int, dict[str, float]] = {}
        now = 0
        for k in grid.wanted:
            steering.advance(now, k)
            now = k
            steering.look(k)
            self.check(k * self.timestep)
            self.note(self.when(k))
            velocity = d.qvel + self.lag * d.qacc  # of the instant of the positions
            velocity[dofs] = steering.at(np.array([float(k)]), 1)[0]
            rows[k] = self.link.signals(velocity) | self.link.rates(velocity)
        return grid.columns(rows)

    def check(self, time: float) -> None:
        """Raise SimulationError for a run that is none."""
        d, when = self.data, f"{self.who}: at {time:.4g} s"
        own = "correct the model, or give it a smaller timestep"
        if d.warning.number.any() or not np.all(np.isfinite(d.qacc)):
            raised = [
                mujoco.mjtWarning(i).name.removeprefix("mjWARN_") for i in range(len(d.warning)) if d.warning[i].number
            ]
            raise SimulationError(
                f"{when} the run diverged ({', '.join(raised) or 'not a number'})", Cause.DIVERGED, own
            )
        parted = self.link.parted()
        if parted > PARTED * self.planar.size:
            raise SimulationError(f"{when} a loop is open by {parted:.3g} m", Cause.CAME_APART, own)

    def when(self, step: int) -> str:
        """When a step is, in words."""
        time = self.began + step * self.timestep
        return f"at {time:.4g} s" if time >= self.path.begin else "before its first report"

    def note(self, when: str) -> None:
        """Note how many contacts and limits act, and how far (m) loops are open."""
        self.touch(when)
        self.most_contacts = max(self.most_contacts, int(self.data.ncon))
        self.most_limits = max(self.most_limits, int(np.isin(self.data.efc_type, LIMIT_ROWS).sum()))
        self.open = max(self.open, self.link.parted())

    def touch(self, when: str) -> None:
        """Note which geoms touch and how hard (N)."""
        force = np.zeros(6)
        for i in range(self.data.ncon):
            contact = self.data.contact[i]
            if contact.efc_address < 0:  # near, and does not push
                continue
            mujoco.mj_contactForce(self.model, self.data, i, force)
            pair = int(contact.geom[0]), int(contact.geom[1])
            before = self.touching.get(pair, Touch(when, 0.0))
            self.touching[pair] = replace(before, force=max(before.force, float(np.linalg.norm(force[:3]))))

    def geom(self, number: int) -> str:
        """What a message calls a geom."""
        name = self.model.geom(number).name
        called = f"geom {name!r}" if name else f"the geom number {number + 1}"
        return f"{called} of {body_words(self.model, int(self.model.geom_bodyid[number]))}"

    def check_alone(self, where: str) -> None:
        """Raise SimulationError where contacts or limits would take part in an equilibrium, which is without them."""
        d = self.data
        others = d.efc_type[(d.efc_type != EQUALITY) & ~np.isin(d.efc_type, DRY)]
        if others.size:
            kind = mujoco.mjtConstraint(int(others[0])).name.removeprefix("mjCNSTR_").split("_")[0].lower()
            raise SimulationError(
                f"{self.who}: a {kind} of the model takes part {where}, which a static run leaves out",
                Cause.NO_EQUILIBRIUM,
                "take it out (of geoms by contype = conaffinity = 0), or run it driven",
            )

    def observed(self, columns: Mapping[str, np.ndarray], how: Mapping[str, SettingValue]) -> Observed:
        """What was seen, and how."""
        settings: dict[str, SettingValue] = {
            **how,
            "loops_open_by": self.open,
            "plane": str(self.planar.plane),
            "integrator": mujoco.mjtIntegrator(int(self.model.opt.integrator)).name.removeprefix("mjINT_"),
        }
        if self.most_contacts:
            settings["contacts"] = self.most_contacts
        if self.touching:
            hardest = sorted(self.touching.items(), key=lambda item: -item[1].force)
            settings["touching"] = "; ".join(
                f"{' with '.join(self.geom(k) for k in pair)}, up to {touch.force:.3g} N, first {touch.first}"
                for pair, touch in hardest[:MOST_NAMED]
            )
        if self.most_limits:
            settings["limits"] = self.most_limits
        return Observed(columns, settings)
