"""Static equilibria in Exudyn, and the quasi-static ones that a driven run starts from without a transient."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.optimize import newton

from analytic.kinematics.structure import BlockRest
from analytic.mechanism import GROUND, MASS_CENTRE, Joint
from sim_models.common.contact_laws import pressed_to
from sim_models.common.failed_starts import check_stiff_enough, no_start, why_no_equilibrium
from sim_models.common.guide import Guide
from sim_models.common.start import AT_REST, Pose
from sim_models.common.travel import travel
from sim_models.engine import CENTRED, ELSEWHERE, Cause, Request, SimulationError
from sim_models.exudyn.block import ExudynBlock
from sim_models.exudyn.laws import CONTACT_CREEP
from sim_models.exudyn.linkage import ExudynLinkage, Inertia
from sim_models.exudyn.model import ExudynModel, point_at
from sim_models.run.path import Gaps, Path
from sim_models.run.record import Record

PACE = 1.0  # rad/s of a drive at rest, which only has a direction
LAST_CORRECTION = 1e-12  # rad: last correction of a crank's angle behind a compliant drive
RUBBINGS = 200  # times that friction is found anew from the forces that it changes
NO_LOAD = 1e-9  # of the largest reaction: a smaller one has no direction

Loads = tuple[
    dict[str, complex], dict[str, float], dict[str, float]
]  # force at each com (N), torque on each body (N.m), force along each slide (N)


class ExudynEquilibria:
    """Equilibria of a joint model held somewhere on its path, at rest or (d'Alembert) with the inertia forces of a
    motion.

    Friction and dampers are evaluated on the ideal linkage's motion there, at a ``speed`` (rad/s) of the crank, or of
    the fastest drive, by default the one that it has or PACE; friction fades below ``creep`` (rad/s), as in a run.
    From the ideal linkage's reactions rods are placed, from theirs the real joints.
    """

    def __init__(self, request: Request, path: Path, speed: float | None = None, creep: float = 0.0) -> None:
        m = request.mechanism
        if speed is None:
            speed = (m.speed if path.driven is None else None) or PACE
        self.request, self.m, self.path, self.speed, self.creep = request, m, path, speed, creep
        self.pace = speed  # rad/s, at which it is looked for last
        motor = request.motor if path.driven is None else None
        self.clock = motor.begin if motor else request.schedule.begin  # s
        home = path.poses(path.begin)
        common: dict[str, Any] = {"redundant": path.assembly.overheld}
        common["drives"] = None if path.driven is None else dict.fromkeys(path.assembly.positions)
        self.ideal = ExudynLinkage(ExudynModel(m, "ideal", "static", home, **common))
        self.clearance = request.clearances
        self.displaced = (*self.clearance, *request.bearings)  # joints whose pins leave their bearings' centres
        self.rods = self.real = self.ideal
        if self.clearance:
            self.rods = ExudynLinkage(ExudynModel(m, "massless-link", "static", home, **common))
            real = ExudynModel(m, request.joint_model, "static", home, contact_for=request.motion, **common)
            self.real = ExudynLinkage(real)

    def at(self, theta: float, inertia: Inertia | None = None, speed: float | None = None) -> Record:
        """Equilibrium at a place on the path: a crank angle (rad), or a time (s).  A record of one instant.  Raises
        SimulationError.

        With ``inertia`` the linkage moves: its inertia forces act, and its dampers.
        """
        speed = self.speed if speed is None else speed
        loads, self.pace = self._loads(theta, inertia, speed), speed
        ideal = self._solve(self.ideal, theta, {}, loads)
        if not self.clearance:
            return ideal
        springs = (
            {}
            if self.request.joint_model == "massless-link"
            else {name: abs(ideal.force[name][0]) for name in self.clearance}
        )
        check_stiff_enough("exudyn", self.request, theta, springs)
        rods = self._solve(self.rods, theta, self._taken_up(self.rods, ideal, theta), loads)
        ways = {} if inertia is None else self._ways(theta, speed)
        rates = {name: rate for name, (_, rate) in ways.items()}
        try:
            smooth = self._solve(self.real, theta, self._taken_up(self.real, rods, theta), loads)
        except SimulationError as error:
            raise why_no_equilibrium("exudyn", self.request, theta, springs) or error from None
        record = self._rubbed(theta, smooth, loads, rates)
        for name in self.clearance:
            if name in record.tilt:  # walls never pull
                continue
            if np.real(record.force[name][0] * np.conj(record.gap[name][0])) <= 0:
                raise self._failure(Cause.PULLED, f"the pin of joint {name} would have to be pushed, not pulled", theta)
        return record

    def crank(self, theta: float) -> float:
        """Angle (rad) at which the crank rests with the motor at ``theta``: behind by the torque over the drive's
        stiffness; of other drives, the place itself.  Raises SimulationError.
        """
        stiffness = self.m.drive_stiffness
        if stiffness is None or self.path.driven is not None:
            return theta
        try:
            return float(
                newton(
                    lambda angle: angle - theta + self.at(float(angle)).drive_torque[0] / stiffness,
                    theta,
                    tol=LAST_CORRECTION,
                )
            )
        except RuntimeError:
            raise self._failure(
                Cause.NO_EQUILIBRIUM, f"a drive of {stiffness:g} N.m/rad holds the crank nowhere near", theta
            ) from None

    def _rubbed(self, theta: float, smooth: Record, loads: Loads, rates: Mapping[str, float]) -> Record:
        """The equilibrium near a ``smooth`` one in which contacts that slip at these ``rates`` rub; where none is, as
        of a block that its friction tips, the smooth one, from which the run finds its way.
        """
        rough = [j for j in self.m.joints if j.rough and rates and self.request.joint_model == "contact"]
        record, before = smooth, np.zeros(0)
        for _ in range(RUBBINGS if rough else 0):
            force, torque, slide = dict(loads[0]), dict(loads[1]), loads[2]
            rubs = [(j, *each) for j in rough for each in self._rubs(j, record, rates[j.name])]
            for joint, push, at in rubs:
                for body, sign in zip(joint.bodies, (-1.0, 1.0), strict=True):
                    if body != GROUND:
                        force[body] += sign * push
                        torque[body] += sign * float(((at - record.com[body][0]).conjugate() * push).imag)
            now = np.array([push for _, push, _ in rubs])
            if now.size == before.size and np.abs(now - before).max() <= NO_LOAD * np.abs(now).max():
                return record
            before = now
            try:
                record = self._solve(self.real, theta, record.gaps(self.displaced), (force, torque, slide))
            except SimulationError:
                break
        return smooth

    def _rubs(self, joint: Joint, record: Record, rate: float) -> Iterator[tuple[complex, complex]]:
        """Friction (N) on a joint's second body, and where (m), of each contact that slips at a ``rate`` (rad/s, m/s)
        under what presses it, as it is in a run.
        """
        second, name = joint.bodies[1], joint.name
        at, force = complex(record.point(self.m, second, name)[0]), complex(record.force[name][0])
        guide, reach = Guide.of(joint) if joint.prismatic else None, joint.rim + joint.clearance
        slip = rate if joint.prismatic else rate * reach
        share = -joint.friction * float(np.clip(slip / CONTACT_CREEP, -1.0, 1.0))
        if guide is None:
            yield 1j * share * force, at + reach * force / abs(force)
            return
        along = complex(record.axis(joint)[0])
        across, tilt = np.imag(record.force[name] * np.conj(along)), record.tilt[name]
        pushes = guide.shares(across, record.moment[name], record.height[name], tilt)
        for corner, push in zip(guide.corners, pushes[:, 0].tolist(), strict=True):
            yield share * push * along, at + along * corner * np.exp(1j * tilt[0])

    def _taken_up(self, linkage: ExudynLinkage, near: Record, theta: float) -> dict[str, complex | BlockRest]:
        """Gaps (m) where the reactions of a neighbouring equilibrium press every pin, and where they press blocks."""
        scale = max(abs(force[0]) for force in near.force.values())
        gaps: dict[str, complex | BlockRest] = {}
        for name, clearance in linkage.model.clearance.items():
            block = linkage.model.blocks.get(name)
            force = complex(near.force[name][0]) if block is None else self._push(block, near)
            if abs(force) <= NO_LOAD * scale or scale == 0:
                pressed = f"the {self.m.joint(name).inner} of joint {name}"
                what = f"nothing presses {pressed}, so its equilibrium is undetermined"
                raise self._failure(Cause.UNPRESSED, what, theta)
            give = abs(force) / linkage.model.stiffness(name)
            gaps[name] = pressed_to(clearance, give, force) if block is None else block.guide.rest(force, give / 2)
        return gaps | near.gaps(self.request.bearings)

    def _push(self, block: ExudynBlock, near: Record) -> complex:
        """Force (N) across on a block and i times its moment over half its length (see :meth:`Guide.push`)."""
        name = block.joint.name
        across = np.imag(near.force[name] * np.conj(near.axis(block.joint)))
        return block.guide.push(float(across[0]), float(near.moment[name][0]))

    def _solve(self, linkage: ExudynLinkage, theta: float, gaps: Gaps, loads: Loads) -> Record:
        linkage.place(self.path.poses(theta, gaps))
        linkage.model.clock = self.clock
        if any(load.opposes for load in self.m.loads):
            linkage.model.heading = self.path.moving(theta, self.pace, gaps)
        linkage.load_bodies(*loads)
        if not linkage.solve_static():
            raise self._failure(Cause.NO_EQUILIBRIUM, "Newton's method finds no equilibrium", theta)
        return linkage.now()

    def _failure(self, cause: Cause, what: str, theta: float) -> SimulationError:
        remedy = () if cause is Cause.UNPRESSED else ("use a smaller clearance", ELSEWHERE, CENTRED)
        return no_start("exudyn", self.request, cause, what, theta, remedy)

    def _loads(self, theta: float, inertia: Inertia | None, speed: float) -> Loads:
        """Weight, inertia, friction and damping: force and torque on every body, force along every slide."""
        moving, m = inertia is not None, self.m
        force, torque = {}, {}
        for b in m.bodies:
            acceleration, turning = (inertia.linear[b.name], inertia.angular[b.name]) if inertia else (0j, 0.0)
            force[b.name] = b.mass * (complex(*m.gravity) - acceleration)
            torque[b.name] = -b.moment_of_inertia * turning
        slide = {}
        if moving and any(spring.damping for spring in m.springs):
            self._add_dampers(self.path.moving(theta, speed), force, torque)
        damped = any(j.rubs or (moving and (j.damped or j.stops)) for j in m.joints)
        ways = self._ways(theta, speed) if damped else {}
        for j in m.joints:
            law = 0.0
            if ways:
                position, rate = ways[j.name]
                slip = rate if moving else 0.0
                law = j.damper(slip) - j.dry(slip) * self._direction(j, rate)
                law += float(j.stop(position, slip) - j.stop(position, 0.0))
            if j.prismatic:
                slide[j.name] = law
            else:
                for body, sign in zip(j.bodies, (-1.0, 1.0), strict=True):
                    if body != GROUND:
                        torque[body] += sign * law
        return force, torque, slide

    def _add_dampers(self, moving: Mapping[str, Pose], force: dict[str, complex], torque: dict[str, float]) -> None:
        """What the dampers beside springs between points exert in this motion."""
        placed = {GROUND: AT_REST, **moving}
        for spring in self.m.springs:
            places = [point_at(self.m, moving, *end) for end in spring.ends]
            rates = [
                placed[body].velocity + 1j * placed[body].angular_velocity * (at - placed[body].origin)
                for (body, _), at in zip(spring.ends, places, strict=True)
            ]
            apart, rate = places[1] - places[0], rates[1] - rates[0]
            push = spring.pull(apart, rate) - spring.pull(apart, 0j)
            for (body, _), at, sign in zip(spring.ends, places, (1.0, -1.0), strict=True):
                if body != GROUND:
                    force[body] += sign * push
                    arm = at - point_at(self.m, moving, body, MASS_CENTRE)
                    torque[body] += sign * float((arm.conjugate() * push).imag)

    def _direction(self, joint: Joint, rate: float) -> float:
        """Sign of a joint's rate, or the part of it that friction has reached."""
        creep = self.creep * (self.ideal.model.size if joint.prismatic else 1.0)
        return float(np.clip(rate / creep, -1.0, 1.0)) if creep else float(np.sign(rate))

    def _ways(self, theta: float, speed: float) -> dict[str, tuple[float, float]]:
        """Angle (rad) and rate (rad/s), or travel (m) and rate (m/s), of every joint of the ideal linkage."""
        moving = self.path.moving(theta, speed) | {GROUND: AT_REST}
        ways = {j.name: travel(self.m, j, *(moving[body] for body in j.bodies)) for j in self.m.joints}
        return {n: (at, 0.0 if abs(rate) < 1e-9 * abs(speed) else rate) for n, (at, rate) in ways.items()}
