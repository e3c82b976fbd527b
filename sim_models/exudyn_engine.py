"""Exudyn as a referee: static equilibria, driven and released motion, with ideal or real clearance joints.

``ideal`` is a RevoluteJoint2D; ``massless-link`` a DistanceConstraint as long as the clearance (in statics a rod of
1e10 N/m); ``spring-damper`` pushes with max(0, K d + C d') outside the gap; ``contact`` is a journal in its bearing
(ObjectContactSphereSphere): K d + C d' where the mechanism gives ``contact_damping``, else a restitution law.
That damping also pulls while the pin leaves, which the spring-damper's does not: with many impacts the pin is free 4-6 % less.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from analytic.assembly import Assembly
from sim_models.contact_laws import contact_parameters, lighter_mass
from sim_models.engine import (
    COMMON_EFFECTS,
    JOINT_MODELS,
    JointModel,
    Motion,
    Request,
    SimulationError,
    Trace,
    Unsupported,
    check_supported,
    installed_version,
)
from sim_models.exudyn_equilibria import Equilibria, Inertia
from sim_models.exudyn_linkage import Linkage
from sim_models.exudyn_model import MINIMUM_IMPACT_SPEED, contact_restitution, silence
from sim_models.exudyn_record import Judge, Record, join
from sim_models.start import Schedule, poses, schedule, substeps

TURN_PER_STEP = 2e-3  # rad of crank angle in a step, at most
SWING_PER_STEP = 5e-4  # rad, of a released linkage's time scale: it has no motor to keep its phase
STEPS_PER_PERIOD = 40  # of the lighter link on a contact's stiffness, or hanging on a massless link
INSTANT = 1e-9  # s, the first step of a run: its start is read with consistent reactions
STENCIL = 1e-3  # rad of crank angle, for the yield of a compliant drive


class Exudyn:
    """The engine; see :class:`sim_models.engine.Engine`."""

    name = "exudyn"
    package = "exudyn"
    supports: frozenset[tuple[JointModel, Motion]] = frozenset((model, motion) for model in JOINT_MODELS for motion in ("static", "driven"))
    effects = COMMON_EFFECTS | {"drive_compliance", "link_flexibility"}

    def simulate(self, request: Request) -> Trace:
        """Run one request.

        ``steady`` starts in the equilibrium of the same joint model under loads and inertia forces, moving as that
        equilibrium moves with the crank.  With a compliant drive angles are the driven body's, not the motor's.  Raises
        SimulationError, Unsupported or AssemblyError.
        """
        check_supported(self, request)
        _check_request(request)
        with silence():
            return Run(request).trace()

    def export(self, request: Request, folder: Path) -> list[Path]:
        """Write a request, and what came of it, as files that run in Exudyn alone.  Raises what :meth:`simulate` does."""
        from sim_models.exudyn_export import export

        check_supported(self, request)
        _check_request(request)
        with silence():
            return export(request, folder)


ENGINE = Exudyn()


def _check_request(request: Request) -> None:
    m = request.mechanism
    moving = request.motion == "driven"
    if moving and m.drive is not None and m.drive.speed == "measured":
        raise Unsupported(f"{m.name}: exudyn does not follow a measured drive; give drive.speed in rad/s, or 'free'")
    if moving and m.speed is None:
        if request.time is None or not request.time.size or request.time.min() < 0:
            raise Unsupported(f"{m.name}: a released linkage is asked for by time (s, from 0 on); give Request.time")
    elif not request.crank_angle.size:
        raise Unsupported(f"{m.name}: no crank angle is asked for; give Request.crank_angle")
    if request.joint_model == "massless-link" and moving and request.start == "centred" and m.clearances:
        raise Unsupported("exudyn: a massless link is as long as the clearance and cannot start with its pin centred; use start 'steady'")
    rubbing = [j.name for j in m.joints if j.clearance and j.friction]
    if rubbing and request.joint_model == "contact" and not moving:
        raise Unsupported(
            f"exudyn: contact friction (joint {rubbing[0]}) depends on the sliding speed and vanishes at rest; run it driven, or give friction_torque"
        )


class Run:
    """One request being run."""

    def __init__(self, request: Request) -> None:
        self.request, self.m = request, request.mechanism
        self.assembly = Assembly(self.m)
        self.clearance = self.m.clearances if request.joint_model != "ideal" else {}
        compliant = self.clearance if request.joint_model in ("spring-damper", "contact") else {}
        self.contact = {name: contact_parameters(self.m, self.m.joint(name), request.motion) for name in compliant}
        spring = self.m.drive is not None and self.m.drive.stiffness is not None and request.motion == "driven"
        stiffness = {name: law.stiffness for name, law in self.contact.items()}
        self.judge = Judge(self.m, self.clearance, stiffness, self.m.speed if spring else None)

    def trace(self) -> Trace:
        if self.request.motion == "static":
            return self.static()
        return self.released() if self.m.speed is None else self.driven()

    # ---------------------------------------------------------------- motions

    def static(self) -> Trace:
        equilibria = Equilibria(self.request, self.assembly, self.m.speed or 1.0)
        order = np.argsort(self.request.crank_angle, kind="stable")
        found = join([equilibria.at(float(theta)) for theta in self.request.crank_angle[order]])
        self.check(self.judge.finite(found), self.judge.joined(found), self.judge.in_assembly_mode(found, self.assembly))
        return self.report(found.rows(np.argsort(order)), found)

    def driven(self) -> Trace:
        plan = schedule(self.request)
        back = np.argsort(plan.order)
        start = float(plan.theta[0]) - math.copysign(self.request.lead_in, plan.speed)
        self.assembly.path(min(start, *plan.theta), max(start, *plan.theta))  # refuses a change point on the way
        linkage, longest = self.launch(start, plan.speed)
        if linkage.compliant:
            history = self.chase(linkage, plan, start, longest)
            passed = np.maximum.accumulate(math.copysign(1.0, plan.speed) * history.angle[self.m.driven])
            time = np.interp(math.copysign(1.0, plan.speed) * plan.theta, passed, history.time)
            sampled, first = history.at(time), int(np.searchsorted(history.time, time[0]))
            time -= time[0]
        else:
            history, marks = self.march(linkage, plan.time + self.request.lead_in / abs(plan.speed), longest)
            sampled, first, time = history.rows(marks), int(marks[0]), plan.time
        self.check(self.judge.energy(history), self.judge.in_assembly_mode(history, self.assembly))
        return self.report(sampled.rows(back), history.rows(slice(first, None)), time[back], longest)

    def released(self) -> Trace:
        time = np.asarray(self.request.time, float)
        order = np.argsort(time, kind="stable")
        linkage, longest = self.launch(self.assembly.start, 0.0)
        history, marks = self.march(linkage, time[order], longest)
        self.check(self.judge.energy(history))
        return self.report(history.rows(marks[np.argsort(order)]), history, time, longest)

    # ---------------------------------------------------------------- start

    def launch(self, theta: float, speed: float) -> tuple[Linkage, float]:
        """The linkage ready to go from crank angle theta (rad), and its longest step (s)."""
        r = self.request
        inertia = None if speed else self.release_accelerations()
        stiffness = self.m.drive.stiffness if self.m.drive is not None and speed else None
        pressing: dict[str, float] = {}
        if not stiffness and (not self.clearance or r.start == "centred"):
            start, wind_up = poses(self.assembly, theta, speed or r.start_speed), 0.0
        else:
            resting = r if r.start == "steady" else Request(self.m.with_clearances({}), motion="driven")
            equilibria = Equilibria(resting, self.assembly, speed, inertia)
            if speed and self.clearance and r.start == "steady":
                equilibria = Equilibria(resting, self.assembly, speed, moving_as=equilibria)
            here = equilibria.at(theta)
            pressing = {name: abs(force[0]) for name, force in here.force.items()}
            wind_up, crank_speed = 0.0, speed or r.start_speed
            if stiffness:  # the crank lags by torque / stiffness, and its speed by how the torque changes
                before, after = (equilibria.at(theta + k * STENCIL).drive_torque[0] for k in (-1, 1))
                wind_up = here.drive_torque[0] / stiffness
                crank_speed = speed / (1 + (after - before) / (2 * STENCIL * stiffness))
            start = poses(self.assembly, theta, crank_speed, equilibria.gaps)
        linkage = Linkage(self.m, r.joint_model, "driven", "turning" if speed else "free", start, speed=speed, wind_up=wind_up)
        return linkage, r.step or self.longest_step(linkage, speed, inertia, pressing)

    def release_accelerations(self) -> Inertia:
        """Accelerations of the ideal linkage as it is let go at rest."""
        linkage = Linkage(self.m, "ideal", "driven", "free", poses(self.assembly, self.assembly.start))
        self.advance(linkage, 0.0, INSTANT, 1)
        found = linkage.accelerations()
        return Inertia({name: a for name, (a, _) in found.items()}, {name: w for name, (_, w) in found.items()})

    def longest_step(self, linkage: Linkage, speed: float, inertia: Inertia | None, pressing: Mapping[str, float]) -> float:
        rate = abs(speed) if inertia is None else max(math.sqrt(abs(w)) for w in inertia.angular.values())
        steps = [(TURN_PER_STEP if inertia is None else SWING_PER_STEP) / max(rate, 1.0)]
        for name, clearance in linkage.clearance.items():
            stiffness = linkage.stiffness(name) if self.request.joint_model != "massless-link" else pressing[name] / clearance
            steps.append(2 * math.pi * math.sqrt(lighter_mass(self.m, self.m.joint(name)) / stiffness) / STEPS_PER_PERIOD)
        return min(steps)

    # ---------------------------------------------------------------- stepping

    def march(self, linkage: Linkage, times: np.ndarray, longest: float) -> tuple[Record, np.ndarray]:
        """Integrate from 0 through all times (s, sorted): every step, and the row of each time."""
        parts = [self.advance(linkage, 0.0, INSTANT, 1).rows(slice(0, 1))]
        marks, clock, last = [], INSTANT, 0
        for end in times:
            if end > clock:
                count, _ = substeps(end - clock, longest)
                parts.append(self.advance(linkage, clock, float(end), count).rows(slice(1, None)))
                clock, last = float(end), last + parts[-1].time.size
            marks.append(last)
        return join(parts), np.array(marks)

    def chase(self, linkage: Linkage, plan: Schedule, start: float, longest: float) -> Record:
        """Integrate until the driven body of a compliant drive has passed every angle."""
        ahead = math.copysign(1.0, plan.speed)
        chunk = max(abs(plan.theta[-1] - start), 0.1) / abs(plan.speed) / 20
        parts: list[Record] = []
        while not parts or ahead * (parts[-1].angle[self.m.driven][-1] - plan.theta[-1]) < 0:
            if len(parts) > 60:
                raise self.failure("the driven body falls ever farther behind its motor (drive.stiffness)")
            clock = len(parts) * chunk
            count, _ = substeps(chunk, longest)
            parts.append(self.advance(linkage, clock, clock + chunk, count).rows(slice(1 if parts else 0, None)))
        return join(parts)

    def advance(self, linkage: Linkage, begin: float, end: float, count: int) -> Record:
        if not linkage.advance(begin, end, count):
            raise self.failure(f"the integrator gave up between {begin:.6g} and {end:.6g} s (step {(end - begin) / count:.3g} s)")
        record = linkage.history()
        self.check(self.judge.finite(record), self.judge.joined(record))
        return record

    # ---------------------------------------------------------------- judging and reporting

    def failure(self, why: str) -> SimulationError:
        r = self.request
        return SimulationError(f"exudyn {r.joint_model} {r.motion} ({self.m.name}): {why}; use a smaller step or a softer, more damped contact")

    def check(self, *wrong: str | None) -> None:
        """Raise SimulationError with the first of the judge's objections."""
        for why in wrong:
            if why:
                raise self.failure(why)

    def report(self, sampled: Record, dense: Record, time: np.ndarray | None = None, step: float | None = None) -> Trace:
        """The trace: signals at the sampled instants, the pins' paths and free share over the dense record."""
        r = self.request
        free = dict.fromkeys(self.clearance, 0.0)
        if r.joint_model != "massless-link":
            free = {name: dense.free_share(name, clearance) for name, clearance in self.clearance.items()}
        return Trace(
            simulator=ENGINE.name, version=installed_version(ENGINE.package) or "unknown", joint_model=r.joint_model, motion=r.motion,
            crank_angle=np.array(r.crank_angle, float) if r.crank_angle.size else sampled.angle[self.m.driven].copy(), time=time,
            signals=sampled.signals(), clearance=dict(self.clearance), free_share=free,
            journal={name: np.column_stack([dense.gap[name].real, dense.gap[name].imag]) for name in self.clearance},
            settings=self.settings(step),
        )  # fmt: skip

    def settings(self, step: float | None) -> dict[str, Any]:
        r = self.request
        used: dict[str, Any] = {"solver": "static Newton" if r.motion == "static" else "trapezoidal rule, index 2", "step": step}
        laws = self.contact
        if not laws:
            return used
        joints = {name: self.m.joint(name) for name in laws}
        used["contact_stiffness"] = min(law.stiffness for law in laws.values())
        linear = {name for name, joint in joints.items() if r.joint_model == "spring-damper" or joint.contact_damping is not None}
        if linear:
            used["contact_law"] = "max(0, K d + C d')" if r.joint_model == "spring-damper" else "K d + C d'"
            used["contact_damping"] = {name: laws[name].damping for name in sorted(linear)}
        else:
            used["contact_law"] = "K d (1 + chi d'/v0), Carvalho-Martins 2019 (e > 1/3) or Gonthier et al. 2004"
            used["minimum_impact_speed"] = MINIMUM_IMPACT_SPEED
        bouncing = {name: contact_restitution(self.m, joints[name], laws[name]) for name in joints if name not in linear}
        return used | ({"restitution": bouncing} if bouncing else {})
