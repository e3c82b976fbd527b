"""A linkage of beams in Exudyn: the elastic displacement of Eqs. 1-7 and the clearance of Eq. 8, both at once.

Links with a modulus of elasticity are large-displacement planar beams, so that reactions follow the deformed, displaced
linkage; the paper's superposition (Fig. 7c) is its first order.  Elements are ANCFCable2D (Euler and Bernoulli's: no
shear, as Eqs. 2-3).  The crank's axis is held at the drive (of several drives, each holds its joint), weights and loads
act at the com and at named points, and joints are the springs of Eq. 4 (or rigid).  A joint with clearance and joint
model ``contact`` is a journal in its bearing whose contact is as stiff as the joint's spring.

:func:`flexible` is how a harness asks for flexible links: it answers a request, of a mechanism whose flexible bodies
have ``youngs_modulus``, as :meth:`sim_models.engine.Engine.simulate` does one for rigid links.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import GROUND, MASS_CENTRE, Joint
from analytic.mechanism.signals import driving, position, turned_near
from sim_models.common.contact_laws import pressed_to
from sim_models.common.failed_starts import own_start, where
from sim_models.common.free_share import free_share
from sim_models.engine import Cause, Request, SettingValue, SimulationError, Trace, Unsupported, installed_version
from sim_models.exudyn.beam_model import (
    BeamModel,
    Loads,
    Push,
    pin_stiffness,
    refuse_what_is_not_modelled,
    soft_stiffness,
)
from sim_models.exudyn.beam_motion import RigidMotion
from sim_models.exudyn.equilibria import ExudynEquilibria
from sim_models.exudyn.settings import console_off
from sim_models.run.judge import FLIPPED
from sim_models.run.path import CrankPath, RestingPath


def flexible(request: Request) -> Trace:
    """What a request's linkage shows with flexible links: an equilibrium at every crank angle, or instant of its
    courses.

    The motion is quasi-static: the crank is where the motor is, and in ``driven`` motion the links bear the inertia
    forces, dampers, springs and friction of the ideal rigid linkage, but do not vibrate; angular velocities are the
    rigid linkage's too.  A link on a ground joint has the angle of its section there, a floating one that of its
    section at the com; a joint's position is that of its two sections.  With ``contact`` joints with clearance have it,
    with ``ideal`` clearances are ignored.

    Raises Unsupported for other joint models, compliant and free drives and guides that yield; SimulationError where
    no equilibrium is found, AssemblyError where the linkage cannot be assembled.
    """
    beams = Beams(request)
    with console_off(), own_start("exudyn", request, beams.assembly):
        rows = [beams.signals(k) for k in range(beams.at.size)]
    signals = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    moving = request.motion == "driven"
    for body in request.mechanism.bodies:
        signals[f"{body.name}_angular_velocity"] = (
            beams.motion.angular_velocity(body.name) if moving else np.zeros(len(rows))
        )
    size = beams.clearance
    gaps = {name: np.column_stack([signals[f"clearance_{name}_{axis}"] for axis in "xy"]) for name in size}
    used: dict[str, SettingValue] = {
        "solver": "static Newton",
        "step": None,
        "links": "euler-bernoulli beams",
        "inertia": "rigid linkage" if moving else "none",
    }
    if size:
        used["contact_stiffness"] = min(pin_stiffness(request.mechanism.joint(name)) for name in size)
    return Trace(
        simulator="exudyn",
        version=installed_version("exudyn") or "unknown",
        joint_model=request.joint_model,
        motion=request.motion,
        crank_angle=beams.told.copy(),
        time=beams.time,
        signals=signals,
        clearance=dict(size),
        journal=gaps,
        free_share={name: free_share(np.hypot(*gaps[name].T), size[name]) for name in size},
        settings=used,
    )


class Beams:
    """A linkage of beams at every instant of a request; ``motion`` is the ideal rigid linkage's."""

    def __init__(self, request: Request) -> None:
        self.request, self.m = request, request.mechanism
        refuse_what_is_not_modelled(self.m)
        if request.joint_model not in ("ideal", "contact"):
            raise Unsupported(f"{self.m.name}: beams are joined by ideal joints or contact, not {request.joint_model}")
        schedule, self.clearance, self.moving = request.schedule, request.clearances, request.motion == "driven"
        self.assembly = Assembly(self.m)
        rubs = any(joint.rubs for joint in self.m.joints)  # at rest, rates only give friction its direction
        if schedule.crank is None:
            self.path: CrankPath | RestingPath = RestingPath(request, self.assembly)
            self.at: np.ndarray = schedule.time
            self.time: np.ndarray | None = self.at
            self.motion = RigidMotion(self.path, self.at, float(rubs))
            self.told, self.held = self.path.leading(self.at), [*schedule.drives]
        elif schedule.lets_go:
            raise Unsupported(f"{self.m.name}: beams move with their crank; a free drive has no angle to put it at")
        else:
            self.path, motor = CrankPath(self.assembly), schedule.crank_motion(self.m)
            self.time = schedule.time if self.moving else None
            self.at = motor.positions(schedule.time) if schedule.crank_angle is None else schedule.crank_angle
            rates = (motor.positions(schedule.time, order) if self.moving or rubs else 0.0 for order in (1, 2))
            self.motion = RigidMotion(self.path, self.at, *rates)
            self.told, self.held = self.at, [self.m.drive_joint.name]
        # N.m (N along a slide) on the second body
        self.law = {j.name: self.motion.law(j, self.moving) for j in self.m.joints}

    def signals(self, k: int) -> dict[str, float]:
        """All signals but the angular velocities, at one instant."""
        model = self.solved(k)
        out: dict[str, float] = {}
        for body in self.m.bodies:
            at = model.place(body.name, "com")
            angle = float(self.motion.angle(body.name)[k]) + self._turned(model, body.name, k)
            out |= {f"{body.name}_x": at.real, f"{body.name}_y": at.imag, f"{body.name}_angle": angle}
        for j in self.m.joints:
            where_it_is, force = self._position(model, j, k), model.force(j)
            if j.prismatic:
                force += self._along(j, k) + model.spring(j, where_it_is) * model.axis(j)
            out |= {f"reaction_{j.name}_x": force.real, f"reaction_{j.name}_y": force.imag}
            out[position(j).name] = where_it_is
            if j.prismatic:
                out[f"reaction_{j.name}_moment"] = model.moment(j)
            else:
                gap = model.place(j.bodies[0], j.name) - model.place(j.bodies[1], j.name)
                out |= {f"clearance_{j.name}_x": gap.real, f"clearance_{j.name}_y": gap.imag}
        driven = [self.m.joint(name) for name in self.held]
        return out | {
            signal.name: self.m.crank_sign * model.drive(j) for signal, j in zip(driving(driven), driven, strict=True)
        }

    def solved(self, k: int) -> BeamModel:
        """The linkage in equilibrium at one instant, in its assembly mode."""
        pressing = self._pressing(k)
        soft = {name: soft_stiffness(self.m.joint(name), abs(force)) for name, force in pressing.items()}
        gaps = {
            name: pressed_to(self.clearance[name], abs(force) / soft[name], force) for name, force in pressing.items()
        }
        start = self.path.poses(float(self.at[k]), gaps)
        loads = Loads(self._pushes(k), self._springs(k))
        model = BeamModel(self.m, self.clearance, start, loads, self.held)
        if not model.solve(
            soft, lambda: not any(abs(self._turned(model, body.name, k)) > FLIPPED for body in self.m.bodies)
        ):
            raise SimulationError(
                f"exudyn euler-bernoulli beams ({self.m.name}): no static equilibrium in the assembly mode found"
                f" {where(self.request, float(self.at[k]))}",
                Cause.NO_EQUILIBRIUM,
                "use a smaller clearance, keep clear of change points, or check youngs_modulus, section and the loads",
            )
        return model

    def _turned(self, model: BeamModel, body: str, k: int) -> float:
        """Angle (rad) of a link where it is read, from the ideal rigid one's."""
        turned = model.start[body].angle - self.motion.angle(body)[k]
        return float(turned_near(turned + model.rotation(body, self.m.angle_point(body)), 0.0))

    def _pressing(self, k: int) -> dict[str, complex]:
        """Forces (N) of the rigid linkage that press its pins into their bearings."""
        if not self.clearance:
            return {}
        if self.request.schedule.crank is not None:
            inertia = self.motion.inertia(k) if self.moving else None
            rigid = self._rods.at(float(self.at[k]), inertia, float(self.motion.angular_velocity(self.m.driven)[k]))
        else:
            rigid = self._rods.at(float(self.at[k]))
        return {name: complex(rigid.force[name][0]) for name in self.clearance}

    @cached_property
    def _rods(self) -> ExudynEquilibria:
        """The rigid linkage, each pin on a rod as long as its clearance."""
        resting = replace(self.request.schedule, at_rest=True)
        return ExudynEquilibria(Request(self.m, "massless-link", resting), self.path)

    def _position(self, model: BeamModel, joint: Joint, k: int) -> float:
        """Angle (rad) of a joint's second section less its first's; of a slide, its travel (m)."""
        first, second = joint.bodies
        if joint.prismatic:
            apart = model.place(second, joint.name) - model.place(first, joint.name)
            return float((apart * model.axis(joint).conjugate()).real)
        angles = [model.rotation(b, joint.name) + (model.start[b].angle if b != GROUND else 0.0) for b in joint.bodies]
        return float(turned_near(angles[1] - angles[0], self.motion.position(joint)[k]))

    def _springs(self, k: int) -> dict[str, tuple[float, float]]:
        """Stiffness of each joint's spring where the rigid linkage has it, and where that is."""
        places = {j: float(self.motion.position(j)[k]) for j in self.m.joints if j.springy}
        return {j.name: (j.stiffness + 3 * j.cubic * (at - j.rest_angle) ** 2, at) for j, at in places.items()}

    def _pushes(self, k: int) -> list[Push]:
        """Weights, loads, joint laws and inertia."""
        pushes: list[Push] = [(load.body, load.point, complex(*load.force), load.torque) for load in self.m.loads]
        if self.m.periodic_torque is not None:
            torque = float(self.m.periodic_torque.at(self.motion.angle(self.m.driven)[k]))
            pushes.append((self.m.driven, MASS_CENTRE, 0j, torque))
        inertia = self.motion.inertia(k) if self.moving else None
        for b in self.m.bodies:
            force, torque = b.mass * complex(*self.m.gravity), 0.0
            if inertia is not None:
                force -= b.mass * inertia.linear[b.name]
                torque = -b.moment_of_inertia * inertia.angular[b.name]
            pushes.append((b.name, MASS_CENTRE, force, torque))
        for j in self.m.joints:
            for body, sign in zip(j.bodies, (-1.0, 1.0), strict=True):
                if body != GROUND:
                    along, torque = (self._along(j, k), 0.0) if j.prismatic else (0j, float(self.law[j.name][k]))
                    pushes.append((body, j.name, sign * along, sign * torque))
        return pushes

    def _along(self, joint: Joint, k: int) -> complex:
        """Force (N) of a prismatic joint's spring, damper and friction on its second body."""
        return complex(self.law[joint.name][k] * joint.direction * np.exp(1j * self.motion.angle(joint.bodies[0])[k]))
