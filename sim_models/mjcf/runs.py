"""Driven, released and static runs of somebody's MuJoCo model, in its own time step and with its own solver."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.kinematics.schedule import Steady
from analytic.mechanism import GROUND, Joint
from sim_models.common.start import check_steps
from sim_models.engine import Cause, Request, SettingValue, SimulationError, Trace
from sim_models.mjcf.linkage import EQUALITY, TheirLinkage
from sim_models.mjcf.planar import Planar
from sim_models.mjcf.start import DRY, Rest, rest
from sim_models.mjcf.steering import Steering
from sim_models.run.path import CrankPath, Path

STENCIL = np.arange(-2, 3) * 1e-3  # rad, angles whose poses give the rates of the ideal linkage
SLOPE = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12e-3  # 1/rad, and the second derivative
BEND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12e-6
LEAD = 6.0  # time constants of the softest loop
MARGIN = 5e-3  # rad that are left to where the linkage locks
ON_TIME = 1e-6  # of a step: a report that is nearer to one is at it
PARTED = 0.2  # of the linkage's size: a loop that opens by more is none
LIMITS = (int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT), int(mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON))
RK4 = int(mujoco.mjtIntegrator.mjINT_RK4)


class TheirRun:
    """One request on its way to a trace, in a file's own model."""

    def __init__(self, name: str, request: Request, planar: Planar) -> None:
        self.name, self.request, self.planar = name, request, planar
        self.link = TheirLinkage(request.mechanism, planar, self.driven_joints())
        self.path: Path = CrankPath(self.link.assembly)
        self.model, self.data = self.link.model, self.link.data
        self.step = float(self.model.opt.timestep)
        self.lag = 0.0 if int(self.model.opt.integrator) == RK4 else self.step / 2
        self.who = f"{name}: {request.mechanism.name}"
        self.most_contacts, self.most_limits, self.open = 0, 0, 0.0

    def driven_joints(self) -> Sequence[Joint]:
        """The joints that motors hold."""
        return [self.request.mechanism.joint(name) for name in self.request.schedule.drives]

    def trace(self) -> Trace:
        """Run the request."""
        if self.request.motion == "static":
            return self.static()
        return self.free() if self.request.schedule.lets_go else self.driven()

    # ------------------------------------------------------------------ runs

    def static(self) -> Trace:
        """The equilibrium with the crank held at each angle, by Newton's method on the model's own equations."""
        still = np.zeros(self.model.nv)
        rows = []
        asked = self.angles()
        for theta in asked.tolist():
            q = self.link.placed(self.path.poses(theta))
            where = f"at crank angle {math.degrees(theta):.4g} deg"
            self.found(rest(self.link, q, still, still, 0.0), where)
            self.free_of_others(where)
            self.noted()
            rows.append(self.link.signals(still))
        return self.report(asked, None, rows, {"step": None, "start": "equilibrium"})

    def angles(self) -> np.ndarray:
        """The crank's angles (N,) rad that are asked for."""
        angles = self.request.schedule.crank_angle
        assert angles is not None  # what is told by time is in a TheirCoursesRun, or let go
        return angles

    def driven(self) -> Trace:
        """The crank turns at constant speed from the first report to the last, from a state without transients."""
        theta, speed = self.angles(), self.request.mechanism.speed
        assert speed is not None
        first = float(theta.min() if speed > 0 else theta.max())
        time, lead = self.request.schedule.time, self.lead(first, speed)
        begin = first - speed * lead
        sense = 1.0 if self.request.mechanism.drive_joint.bodies[0] == GROUND else -1.0  # of the joint to its crank
        motor = Steady(sense * begin, sense * speed)
        rows = self.march(*self.steady(begin, speed), time + lead, Steering(self.link, [motor], lag=self.lag))
        how: dict[str, SettingValue] = {"time_step": self.step, "start": "equilibrium", "lead_in": speed * lead}
        return self.report(theta, time, rows, how)

    def lead(self, first: float, speed: float) -> float:
        """How long (s) before its first report (rad) a run begins: until what its start has left in soft rows is gone,
        as far as the linkage lets its crank come from there.
        """
        longest = min(self.settling(), 2 * math.pi / abs(speed))
        for lead in (longest, longest / 2, longest / 4, longest / 8):
            try:
                self.link.assembly.path(*sorted((first, first - speed * lead - math.copysign(MARGIN, speed))))
            except AssemblyError:
                continue
            return lead
        return 0.0

    def settling(self) -> float:
        """How long (s) it takes until what a start has left in soft rows is gone."""
        periods = self.model.eq_solref[self.model.eq_active0.astype(bool), 0] if self.model.neq else np.zeros(0)
        return LEAD * float(periods.max(initial=0.0))

    def free(self) -> Trace:
        """Released at the assembly angles, at rest or with the request's speed."""
        start, time = self.link.assembly.start, self.request.schedule.time
        rate = self.request.schedule.start_speed(self.request.mechanism)
        q = np.array([self.link.placed(self.path.poses(start + side)) for side in STENCIL])
        rows = self.march(q[2], SLOPE @ q * rate, time, Steering(self.link))
        rows = [{"drive_torque": 0.0, **row} for row in rows]
        crank = np.array([row[f"{self.request.mechanism.driven}_angle"] for row in rows])
        return self.report(crank, time, rows, {"time_step": self.step, "start": "released"})

    def steady(self, theta: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and velocities in which the crank passes an angle (rad) at a speed (rad/s) without transients."""
        q, v, a = self.ideal(theta, speed)
        here = rest(self.link, q, v, a, self.lag)
        if here is None:
            return q, v
        beside = []
        for side in STENCIL:
            found = rest(self.link, *self.ideal(theta + side, speed), self.lag)
            if found is None:
                return here.q, v
            beside.append(found.q)
        rate = SLOPE @ np.array(beside) * speed
        rate[self.link.dofs] = v[self.link.dofs]
        return here.q, rate

    def ideal(self, theta: float, speed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates, velocities and accelerations of the ideal linkage at a crank angle."""
        q = np.array([self.link.placed(self.path.poses(theta + side)) for side in STENCIL])
        v, a = SLOPE @ q * speed, BEND @ q * speed**2
        a[self.link.dofs] = 0.0
        return q[2], v, a

    # ------------------------------------------------------------------ steps

    def march(self, q: np.ndarray, v: np.ndarray, time: np.ndarray, steering: Steering) -> list[dict[str, float]]:
        """Signals at times (N,) s after the begin of a run, at true velocities v (nv,): those at the steps around each,
        joined by a cubic.

        Raises SimulationError: the run diverged, came apart, or would take too long.
        """
        m, d, dofs = self.model, self.data, self.link.dofs
        last = float(time.max())
        check_steps(self.who, last, self.step, remedy="give the file a larger timestep, or ask for less")
        mujoco.mj_resetData(m, d)
        d.qpos[:], d.qvel[:] = q, v
        steering.start()
        d.qvel[:] -= self.lag * d.qacc
        d.qvel[dofs] = steering.at(np.zeros(1), 1, -self.lag)[0]
        wanted = sorted({k for at in time.tolist() for k in self.around(at)})
        seen: dict[int, dict[str, float]] = {}
        now = 0
        for k in wanted:
            steering.advance(now, k)
            now = k
            steering.look(k)
            self.check(k * self.step)
            self.noted()
            velocity = d.qvel + self.lag * d.qacc  # of the instant of the positions
            velocity[dofs] = steering.at(np.array([float(k)]), 1)[0]
            seen[k] = self.link.signals(velocity)
        return [self.joined(at, seen) for at in time.tolist()]

    def around(self, at: float) -> tuple[int, ...]:
        """The steps whose signals say what they are at a time (s)."""
        k = at / self.step
        if abs(k - round(k)) < ON_TIME:
            return (round(k),)
        first = max(math.floor(k) - 1, 0)
        return tuple(range(first, first + 4))

    def joined(self, at: float, seen: Mapping[int, Mapping[str, float]]) -> dict[str, float]:
        """Signals at a time (s) from those around it."""
        steps = self.around(at)
        if len(steps) == 1:
            return dict(seen[steps[0]])
        x = at / self.step
        weights = [math.prod((x - other) / (k - other) for other in steps if other != k) for k in steps]
        return {name: sum(w * seen[k][name] for w, k in zip(weights, steps, strict=True)) for name in seen[steps[0]]}

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

    def noted(self) -> None:
        """Note how many contacts and limits act, and how far (m) loops are open."""
        self.most_contacts = max(self.most_contacts, int(self.data.ncon))
        self.most_limits = max(self.most_limits, int(np.isin(self.data.efc_type, LIMITS).sum()))
        self.open = max(self.open, self.link.parted())

    def found(self, state: Rest | None, where: str) -> None:
        """Raise SimulationError where there is no equilibrium."""
        if state is None:
            raise SimulationError(
                f"{self.who}: no equilibrium was found {where}",
                Cause.NO_EQUILIBRIUM,
                "look at the model there in MuJoCo's viewer",
            )

    def free_of_others(self, where: str) -> None:
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

    def report(
        self, theta: np.ndarray, time: np.ndarray | None, rows: list[dict[str, float]], how: dict[str, SettingValue]
    ) -> Trace:
        """The trace of a run."""
        settings: dict[str, SettingValue] = {
            **how,
            "loops_open_by": self.open,
            "plane": str(self.planar.plane),
            "integrator": mujoco.mjtIntegrator(int(self.model.opt.integrator)).name.removeprefix("mjINT_"),
        }
        if self.most_contacts:
            settings["contacts"] = self.most_contacts
        if self.most_limits:
            settings["limits"] = self.most_limits
        return Trace(
            simulator=self.name,
            version=f"in MuJoCo {mujoco.__version__}",
            joint_model=self.request.joint_model,
            motion=self.request.motion,
            crank_angle=np.asarray(theta, float).copy(),
            time=None if time is None else np.asarray(time, float).copy(),
            signals={name: np.array([row[name] for row in rows]) for name in rows[0]},
            settings=settings,
        )
