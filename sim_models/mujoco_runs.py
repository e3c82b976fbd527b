"""Driven, released and static runs of a MuJoCo linkage."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from analytic.assembly import Assembly
from sim_models.contact_laws import DAMPING_RATIO, contact_parameters, damping_ratio, lighter_mass
from sim_models.engine import Request, SimulationError, Trace, Unsupported, installed_version
from sim_models.mujoco_equilibrium import Equilibria
from sim_models.mujoco_model import Contact, Linkage
from sim_models.mujoco_state import (
    advance,
    apart,
    check_warnings,
    friction_torques,
    gap,
    joint_forces,
    look,
    mobility,
    motor_torque,
    on_track,
    signals,
    stiffest_law,
)
from sim_models.start import poses, schedule, substeps

STATIC_STEP = 2.5e-5  # s; nothing steps in statics, but it makes the rigid rows stiff
LARGEST_STEP = 5e-4  # s
TURN_PER_STEP = {"ideal": 2e-3, "massless-link": 3e-4, "spring-damper": 6e-4, "contact": 6e-4}  # rad of the crank
SAMPLES = 600  # of a run's journal path, or somewhat more
SAMPLES_AT_REST = 150  # of a static run's
STENCIL = np.arange(-2, 3) * 0.01  # rad, crank angles whose equilibria give the rates of a steady start
BOUNCE = 0.4  # of a bounce's period/2 pi, for a step
FINE_BOUNCE = 0.1  # where the mechanism asks for a restitution
DEEPEST = 0.1  # of the clearance: penetration that is in order without asking; more must be what the stiffness allows
LOOSEST = 1e-5  # of the linkage's size, by which its rigid joints may come apart
STRETCH = 5e-3  # of the clearance, by which a massless link may change its length
HALVINGS = 5  # of the step, before a run with rigid joints coming apart is given up


def contact_laws(request: Request) -> dict[str, Contact]:
    """The law of each joint with clearance; none for ideal joints.

    ``contact`` in a driven run is hard (it bounces as its restitution says, whatever mass it carries) unless the
    mechanism gives a stiffness or damping; every other compliant joint is a spring and damper in SI units.
    """
    laws = {}
    for name in request.mechanism.clearances if request.joint_model != "ideal" else ():
        joint = request.mechanism.joint(name)
        law = contact_parameters(request.mechanism, joint, request.motion)
        hard = None
        if request.joint_model == "contact" and request.motion == "driven" and joint.contact_stiffness is None and joint.contact_damping is None:
            ratio = DAMPING_RATIO if joint.restitution is None else damping_ratio(joint.restitution)
            hard = math.sqrt(lighter_mass(request.mechanism, joint) / law.stiffness), ratio
        laws[name] = Contact(law.stiffness, law.damping, hard)
    return laws


@dataclass
class _Log:
    """Samples of a run: each clearance joint's gap (m) and force (N)."""

    gaps: dict[str, list[complex]]
    forces: dict[str, list[float]]

    @classmethod
    def of(cls, joints: Iterable[str]) -> _Log:
        """An empty log."""
        return cls({name: [] for name in joints}, {name: [] for name in joints})


@dataclass
class Record:
    """What a run stepped: the model, its state at the first ``time`` (s), then (steps, their size in s, whether signals were taken after them)."""

    link: Linkage
    time: float
    q: np.ndarray
    v: np.ndarray
    stages: list[tuple[int, float, bool]] = field(default_factory=list)


class _CameApart(SimulationError):
    """Rigid joints came apart: the step was too long."""


class Run:
    """One request on its way to a trace."""

    def __init__(self, request: Request) -> None:
        self.request, self.mechanism = request, request.mechanism
        drive = self.mechanism.drive
        self.released = request.motion == "driven" and request.time is not None and (drive is None or drive.speed == "free")
        if request.motion == "driven" and not self.released and self.mechanism.speed is None:
            speed = "no drive" if drive is None else f"drive.speed = {drive.speed!r}"
            raise Unsupported(f"{self.mechanism.name}: mujoco drives a crank at constant speed or releases it with times to report; this has {speed}")
        if not self.released and request.crank_angle.size == 0:
            raise Unsupported(f"{self.mechanism.name}: there is no crank angle to report at; give at least one")
        self.assembly = Assembly(self.mechanism)
        self.laws = contact_laws(request)
        self.speed = 0.0 if self.released else self.mechanism.speed or 1.0

    def trace(self) -> Trace:
        """Run the request."""
        if self.request.motion == "static":
            return self.static()
        return self.free() if self.released else self.driven()

    def near(self, theta: float, step: float = STATIC_STEP) -> Equilibria:
        """Equilibria near a crank angle, with rows as rigid as at this step."""
        return Equilibria(self.request, self.assembly, self.laws, self.speed, theta, step)

    def static(self) -> Trace:
        """Equilibrium at each crank angle, and between them for the journals' paths."""
        theta = self.request.crank_angle
        self.assembly.coordinates(theta)  # raises where the ideal linkage does not reach
        near = self.near(float(theta[0]))
        found = {at: near.at_rest(at) for at in theta.tolist()}
        log = _Log.of(self.laws)
        for at in _filled(theta).tolist() if self.laws else ():
            try:
                seen = found[at] if at in found else near.at_rest(at)
            except SimulationError:
                continue  # only requested angles must have an equilibrium; where there is none, the path has a gap
            for name in self.laws:
                log.gaps[name].append(complex(seen[f"clearance_{name}_x"], seen[f"clearance_{name}_y"]))
                log.forces[name].append(math.hypot(seen[f"reaction_{name}_x"], seen[f"reaction_{name}_y"]))
        rows = [found[at] for at in theta.tolist()]
        columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        return self.report(theta, None, columns, log, {"step": None, "start": "equilibrium"})

    def begin(self, theta: float) -> tuple[np.ndarray, np.ndarray, float, str]:
        """Coordinates, velocities, step (s) and kind of a driven run's start."""
        near = self.near(theta)
        angles = theta + STENCIL
        rate = _derivative(STENCIL) * self.speed
        q = np.array([near.place(near.ideal, at) for at in angles])
        states = zip(angles, q, rate @ q, rate @ rate @ q, strict=True)
        forces = [near.reactions(at, *state) for at, *state in states] if self.laws else [{}] * angles.size
        if self.centred:
            q, how = np.array([near.place(near.pressed, at) for at in angles]), "centred"
        else:
            gaps = [near.pressing(at, f) for at, f in zip(angles, forces, strict=True)]
            q, how = np.array([near.place(near.pressed, at, gap) for at, gap in zip(angles, gaps, strict=True)]), "equilibrium"
        step = self.longest_step(near, q[2])
        if how == "equilibrium":
            settled = self.near(theta, step).steady(angles, q, rate)
            q, how = (q, "pressed where the ideal linkage's reaction points") if settled is None else (settled, how)
        v = (rate @ q)[2]
        v[near.pressed.motor] = self.speed
        return q[2], v, step, how

    @property
    def centred(self) -> bool:
        """Whether pins start in the middle of their bearings; a massless link cannot."""
        return self.request.start == "centred" and bool(self.laws) and self.request.joint_model != "massless-link"

    def longest_step(self, near: Equilibria, q: np.ndarray) -> float:
        """A step (s) that resolves the crank's turning, each contact's bounce, its pin's swing on the rim, and the joint laws."""
        link = near.pressed
        if self.released:  # nothing holds the crank: pins are lighter
            link = Linkage(self.mechanism, self.laws, self.request.joint_model, poses(self.assembly, self.assembly.start), STATIC_STEP, hold=False)
        limits = [LARGEST_STEP]
        if self.speed:
            limits.append(TURN_PER_STEP[self.request.joint_model] / abs(self.speed))
        for name, law in list(self.laws.items()):
            ease = mobility(link, q, name)
            clearance = self.mechanism.joint(name).clearance
            bounce = BOUNCE if self.mechanism.joint(name).restitution is None else FINE_BOUNCE
            limits.append(0.6 / math.sqrt(max(near.forces.get(name, 0.0) * ease / clearance, 1e-12)))
            if law.hard:
                sag = near.forces.get(name, 0.0) * ease * law.hard[0] ** 2  # under the load that it starts with, were it a spring
                self.laws[name] = replace(law, margin=min(sag, 0.05 * clearance))
                limits.append(bounce * law.hard[0])
            elif self.request.joint_model != "massless-link":
                limits.append(2 * bounce / max(math.sqrt(law.stiffness * ease), law.damping * ease))
        return self.request.step or min(*limits, 0.5 / max(stiffest_law(link, q), 1e-9))

    def driven(self) -> Trace:
        """The crank at constant speed."""
        plan = schedule(self.request)
        self.assembly.coordinates(plan.theta)  # raises where the ideal linkage does not reach
        lead = self.request.lead_in / abs(self.speed)
        theta = float(plan.theta[0]) - self.speed * lead
        q, v, step, how = self.begin(theta)
        signals, log, step = self.run(theta, q, v, step, plan.time, lead)
        columns = {name: _scatter(values, plan.order) for name, values in signals.items()}
        settings = {"step": step, "start": how}
        return self.report(self.request.crank_angle, _scatter(plan.time, plan.order), columns, log, settings)

    def free(self) -> Trace:
        """Released at the assembly angles, at rest or with the request's speed."""
        time = np.asarray(self.request.time, float)
        order = np.argsort(time, kind="stable")
        if time.size == 0 or time[order[0]] < 0:
            raise Unsupported(f"{self.mechanism.name}: a released linkage needs times to report at, none of them before 0 s")
        theta = self.assembly.start
        near = self.near(theta)
        gaps = self.gaps_at_release(near, theta) if self.laws else {}
        q = near.place(near.pressed, theta, gaps)
        step = self.longest_step(near, q)
        around = np.array([near.place(near.pressed, theta + side, gaps) for side in STENCIL]) if self.request.start_speed else np.tile(q, (5, 1))
        v = (_derivative(STENCIL) @ around)[2] * self.request.start_speed
        signals, log, step = self.run(theta, q, v, step, time[order], float(time[order[0]]))
        columns = {name: _scatter(values, order) for name, values in signals.items()}
        settings = {"step": step, "start": f"released at {self.request.start_speed:g} rad/s"}
        return self.report(columns[f"{self.mechanism.driven}_angle"].copy(), time, columns, log, settings)

    def gaps_at_release(self, near: Equilibria, theta: float) -> dict[str, complex]:
        """Gaps (m) along the ideal linkage's reactions at the instant of release, x where there is none; zero to start centred."""
        link = Linkage(self.mechanism, {}, "ideal", poses(self.assembly, theta), STATIC_STEP, hold=False)
        look(link)
        forces = near.noted(signals(link, joint_forces(link, link.data.efc_force), {}, 0.0))
        return {} if self.centred else {name: near.rim(name, force or complex(1e-12)) for name, force in forces.items()}

    def run(
        self, theta: float, q: np.ndarray, v: np.ndarray, step: float, marks: np.ndarray, lead: float
    ) -> tuple[dict[str, np.ndarray], _Log, float]:
        """A run with the engine's own step, halved while rigid joints come apart; or with the request's."""
        for attempt in range(HALVINGS + 1):
            link = Linkage(self.mechanism, self.laws, self.request.joint_model, poses(self.assembly, theta), step, hold=not self.released)
            try:
                return *self.march(link, q, v, step, marks, lead), step
            except _CameApart:
                if self.request.step is not None or attempt == HALVINGS:
                    raise
                step /= 2
        raise AssertionError("unreachable: the last attempt returns or raises")

    def march(self, link: Linkage, q: np.ndarray, v: np.ndarray, step: float, marks: np.ndarray, lead: float) -> tuple[dict[str, np.ndarray], _Log]:
        """Step from mark to mark (s), after the lead-in (s); signals at the marks, samples of the journals between them."""
        m, d = link.model, link.data
        d.qpos[:], d.qvel[:] = q, v
        log = _Log.of(self.laws)
        columns: dict[str, list[float]] = {}
        lag = 0.5 if link.stepped else 0.0  # the velocities of semi-implicit Euler are half a step older than its positions
        on_track(link)
        self.record = Record(link, float(marks[0]) - lead, d.qpos.copy(), d.qvel.copy())
        look(link)
        d.qvel[:] -= lag * step * d.qacc
        span = lead + float(marks[-1] - marks[0])
        for k, interval in enumerate(np.diff(marks, prepend=marks[0] - lead).tolist()):
            count, m.opt.timestep = substeps(interval, step) if interval > 0 else (0, step)
            pieces = min(count, math.ceil(SAMPLES * interval / span)) if count else 1
            for piece in range(pieces):
                steps = count * (piece + 1) // pieces - count * piece // pieces
                self.record.stages.append((steps, m.opt.timestep, piece == pieces - 1))
                advance(link, steps)
                look(link)
                check_warnings(link, f"{self.mechanism.name}, {self.request.joint_model} joints, t = {d.time:.4g} s")
                forces = joint_forces(link, d.efc_force)
                self.check_together(apart(link), step)
                for name in self.laws if k or piece == pieces - 1 else ():
                    log.gaps[name].append(gap(link, name))
                    log.forces[name].append(abs(forces[name][0]))
            seen = signals(link, forces, friction_torques(link), motor_torque(link), d.qvel + lag * m.opt.timestep * d.qacc)
            for name, value in seen.items():
                columns.setdefault(name, []).append(value)
        self.check_depth(log)
        return {name: np.array(column) for name, column in columns.items()}, log

    def check_together(self, distance: float, step: float) -> None:
        """Raise _CameApart where rigid joints have come apart by more than is in order."""
        room = LOOSEST * max(b.length for b in self.mechanism.bodies)
        if self.request.joint_model == "massless-link":
            room = min([room, *(STRETCH * c for c in self.mechanism.clearances.values())])
        if distance > room:
            raise _CameApart(
                f"mujoco: {self.mechanism.name}, {self.request.joint_model} joints: a rigid joint came apart by {distance:.3g} m, "
                f"{room:.3g} m is in order (step {step:.3g} s); use a smaller step"
            )

    def check_depth(self, log: _Log) -> None:
        """Raise SimulationError where a pin went deeper into its bearing than its law lets it."""
        where = f"mujoco: {self.mechanism.name}, {self.request.joint_model} joints"
        for name, law in self.laws.items() if self.request.joint_model != "massless-link" else ():
            clearance = self.mechanism.joint(name).clearance
            deepest = float(np.abs(log.gaps[name]).max()) - clearance
            allowed = max(DEEPEST * clearance, 3 * max(log.forces[name]) / law.stiffness)
            if deepest > allowed:
                raise SimulationError(
                    f"{where}: the pin of joint {name!r} is {deepest:.3g} m deep in its bearing, {allowed:.3g} m is in order "
                    f"(clearance {clearance:g} m, stiffness {law.stiffness:g} N/m); use a smaller step or a stiffer contact"
                )

    def report(self, theta: np.ndarray, time: np.ndarray | None, signals: Mapping[str, np.ndarray], log: _Log, settings: Mapping[str, Any]) -> Trace:
        return Trace(
            simulator="mujoco",
            version=installed_version("mujoco") or "unknown",
            joint_model=self.request.joint_model,
            motion=self.request.motion,
            crank_angle=theta,
            time=time,
            signals=signals,
            clearance={name: self.mechanism.joint(name).clearance for name in self.laws},
            journal={name: np.array([[g.real, g.imag] for g in path]) for name, path in log.gaps.items()},
            free_share={name: float(np.mean(np.array(force) <= 0)) for name, force in log.forces.items()},
            settings={**self.law_settings(), **settings, "solver": "Newton, elliptic cone"},
        )

    def law_settings(self) -> dict[str, Any]:
        """What the joints with clearance were made of: the softest stiffness, each joint's damping, the law in words."""
        if not self.laws or self.request.joint_model == "massless-link":
            return {"contact_law": "massless link of fixed length, pulls and pushes"} if self.laws else {}
        soft = [law for law in self.laws.values() if not law.hard]
        words = {law.words for law in self.laws.values()}
        settings: dict[str, Any] = {"contact_law": "; ".join(sorted(words))}
        if soft:
            settings["contact_stiffness"] = min(law.stiffness for law in soft)
            damping = {name: law.damping for name, law in self.laws.items()}
            settings["contact_damping"] = next(iter(damping.values())) if len(set(damping.values())) == 1 else damping
        return settings


def _scatter(values: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Values in the request's order from values in the order of passing."""
    out = np.empty_like(values)
    out[order] = values
    return out


def _filled(theta: np.ndarray) -> np.ndarray:
    """The angles in order, with others between them: at least SAMPLES_AT_REST over their range."""
    theta = np.unique(theta)
    if theta.size < 2:
        return theta
    between = np.linspace(theta[0], theta[-1], SAMPLES_AT_REST)
    return np.unique(np.concatenate([theta, between]))


def _derivative(x: np.ndarray) -> np.ndarray:
    """Matrix (n, n) that differentiates the polynomial through values at x."""
    powers = np.arange(x.size)
    scale = np.abs(x).max()
    values = (x[:, None] / scale) ** powers
    slopes = powers[1:] * (x[:, None] / scale) ** (powers[1:] - 1) / scale
    return np.column_stack([np.zeros(x.size), slopes]) @ np.linalg.inv(values)
