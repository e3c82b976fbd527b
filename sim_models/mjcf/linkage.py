"""Somebody's MuJoCo model in a mechanism's words: its coordinates in a pose, its signals in a state.

Reactions are MuJoCo's own: of a joint in the tree the interaction force ``cfrc_int`` of its child body, which
``mj_rnePostConstraint`` gives about the tree's centre of mass, less what an actuator on a site beyond the joint gives,
which is not in it (what a tendon between sites gives is); of a ``connect`` its rows' ``efc_force``, which acts on the
equality's first body.  A drive's torque or force is what the equation of motion of its joint leaves over.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import GROUND, MASS_CENTRE, Joint
from analytic.mechanism.parts import Body
from analytic.mechanism.signals import driving
from sim_models.common.rates import rate_columns
from sim_models.common.start import AT_REST, Pose
from sim_models.engine import Unsupported
from sim_models.mjcf.compiled import AT_JOINT
from sim_models.mjcf.drive import AT_SITE, flywheel, gravity, steady_force, switched_off, throttled
from sim_models.mjcf.laws import TendonLaw, acts, law, point_spring
from sim_models.mjcf.match import Match, match
from sim_models.mjcf.parts import Frames, PlanarPin
from sim_models.mjcf.planar import Planar
from sim_models.run.path import assembled

# Times the whole linkage's inertia, or mass: the armature that stands for a motor.  What reactions accelerate of it is
# made up for (Steering); a larger one MuJoCo's solvers, which measure by the forces that accelerate inertias, do not
# solve with: at 1e6 they stop at once and leave reactions of a 3-RPR a hundredth off (Newton, tolerance 1e-8).
MOTOR = 1e3
FRAME = int(mujoco.mjtObj.mjOBJ_XBODY)
EQUALITY = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
TENDON_FRICTION = int(mujoco.mjtConstraint.mjCNSTR_FRICTION_TENDON)
NO_SPRINGS, NO_DAMPERS = int(mujoco.mjtDisableBit.mjDSBL_SPRING), int(mujoco.mjtDisableBit.mjDSBL_DAMPER)


@dataclass(frozen=True)
class Held:
    """A joint that a motor holds: its position (rad, m; second body relative to the first) is ``way`` (1 or -1) times
    its coordinate in MuJoCo less ``zero``; what the motor gives is reported as ``signal``, times ``sign``.
    """

    signal: str
    joint: str
    dof: int
    way: float
    zero: float
    sign: float


class TheirLinkage:
    """A mechanism's match in a file, with its motors: the model's own numbers but for the ``driven`` joints.

    These get an armature, by which they are kept on their courses, and lose their own actuators; what is released only
    loses these, and a motor's armature.  Raises Unsupported where the file is not the
    mechanism's linkage, or has what its forces cannot be read with.
    """

    def __init__(self, assembly: Assembly, planar: Planar, driven: Sequence[Joint]) -> None:
        mechanism = self.mechanism = assembly.mechanism
        self.assembly, self.planar, self.model = assembly, planar, planar.model
        self.match: Match = match(mechanism, planar)
        self.data = mujoco.MjData(self.model)
        self.model.opt.jacobian = int(mujoco.mjtJacobian.mjJAC_DENSE)  # the same numbers, as a matrix
        self.armature = np.zeros(self.model.nv)  # that stands for motors, beside the file's own
        self.impose(driven)
        self.laws: list[TendonLaw] = []
        self.check_readable()
        self.home = planar.at(planar.pose)
        self.spin = planar.spin
        home = assembled(self.assembly)
        at_start = self.wanted(home)
        self.turns = {
            id(pin): round((self.apart(pin, at_start) - self.planar.relative(pin, self.home)) / (2 * math.pi))
            for pin in planar.pins
            if not pin.slides
        }
        start = self.placed(home)
        self.zero = {
            body: self.ours(body, at_start[self.match.links[body]][1])
            - float(self.spin[self.match.links[body]] @ start)
            for body in mechanism.moving
        }
        self.held = self.holding(driven, start)
        self.dofs = np.array([one.dof for one in self.held], int)

    # ------------------------------------------------------------------ what is imposed

    def impose(self, driven: Sequence[Joint]) -> None:
        """Put the motors in, in the place of the file's own; drives that move freely have none."""
        m = self.model
        links = self.planar.links[1:]
        mass = sum(link.mass for link in links)
        whole = mass * self.planar.size**2 + sum(link.inertia for link in links)
        for joint in self.driveable():
            pin, holds = self.match.pins[joint.name], joint in driven
            if holds and pin.joint < 0:
                raise Unsupported(
                    f"{self.planar.said}: the drive's joint {joint.name!r} is a connect there, which nothing can turn;"
                    " make it a hinge, and close the loop in another joint"
                )
            if pin.joint < 0:
                continue
            for i in range(m.nactuator):
                if int(m.actuator_trntype[i]) in AT_JOINT and int(m.actuator_trnid[i, 0]) == pin.joint:
                    m.actuator_gainprm[i] = m.actuator_biasprm[i] = 0.0
            dof = int(m.jnt_dofadr[pin.joint])
            if flywheel(self.planar, pin):
                m.dof_armature[dof] = 0.0
            if holds:
                self.armature[dof] = MOTOR * (mass if pin.slides else whole)
        m.dof_armature += self.armature

    def driveable(self) -> list[Joint]:
        """The joints of all drives, those that move freely among them; without a drive, the crank's."""
        m = self.mechanism
        if not m.drives:
            return [m.drive_joint] if m.cranked else []
        return [m.joint(drive.joint) for drive in m.drives]

    def holding(self, driven: Sequence[Joint], start: np.ndarray) -> list[Held]:
        """How the driven joints' positions are told by coordinates, which are ``start`` (nq,) at the assembly."""
        found: list[Held] = []
        for joint, signal in zip(driven, driving(driven) if driven else [], strict=True):
            dof = int(self.model.jnt_dofadr[self.match.pins[joint.name].joint])
            way = self.way(joint)
            backwards = self.mechanism.cranked and joint.bodies[0] != GROUND  # what turns a crank is told of the crank
            zero = float(start[dof]) - way * self.assembly.positions[joint.name]
            found.append(Held(signal.name, joint.name, dof, way, zero, -1.0 if backwards else 1.0))
        return found

    def way(self, joint: Joint) -> float:
        """1 where a joint's position grows with its coordinate in MuJoCo, else -1."""
        pin = self.match.pins[joint.name]
        swapped = -1.0 if self.match.swapped(joint) else 1.0
        if not pin.slides:
            return pin.turn * swapped
        first = joint.bodies[0]
        axis = pin.axis if swapped > 0 else pin.axis * cmath.exp(-1j * pin.angle)
        along = self.match.frames[first].turn * joint.direction
        return math.copysign(1.0, (axis * along.conjugate()).real) * swapped

    def check_readable(self) -> None:
        """Raise Unsupported for forces that MuJoCo does not tell to which body they belong."""
        m, said = self.model, self.planar.said
        lifted = m.body_gravcomp.any() and self.planar.plane.flat(gravity(m))
        if lifted or m.opt.density or m.opt.viscosity:
            field = "gravcomp" if lifted else "option.density or viscosity"
            raise Unsupported(f"{said}: has {field}, whose forces are in no reaction that can be read; take it out")
        for i in range(m.nactuator):
            joint, site = int(m.actuator_trntype[i]) in AT_JOINT, int(m.actuator_trntype[i]) == AT_SITE
            refsite = int(m.actuator_trnid[i, 1])
            if joint or (site and (refsite < 0 or self.planar.sites[refsite].link == 0)):
                if site and not switched_off(m, i) and steady_force(m, i) != 0.0 and throttled(m, i) is not None:
                    raise Unsupported(
                        f"{said}: a joint's actuatorfrcrange limits what actuator {m.actuator(i).name!r} gives, with"
                        " which no reaction can be read; take one of them out"
                    )
                continue
            raise Unsupported(
                f"{said}: actuator {m.actuator(i).name!r} acts on a tendon, a body or between bodies, which no reaction"
                " can be read with; take it out"
            )
        for t in range(m.ntendon):
            found = law(self.planar, t)
            if found is not None and not found.pin.slides:
                self.laws.append(found)
            elif found is None and acts(m, t) and point_spring(self.planar, t) is None:
                raise Unsupported(
                    f"{said}: tendon {m.tendon(t).name!r} pulls between bodies, which no reaction can be read with;"
                    " take its spring, damper, friction and limit out"
                )

    # ------------------------------------------------------------------ coordinates

    def wanted(self, pose: Mapping[str, Pose]) -> dict[int, tuple[complex, float]]:
        """Origin (m) and angle (rad) of each link, in the plane of the file, for a pose of the mechanism."""
        ground = self.match.frames[GROUND]
        found = {}
        for body, link in self.match.links.items():
            frame, here = self.match.frames[body], AT_REST if body == GROUND else pose[body]
            angle = here.angle - cmath.phase(frame.turn) + cmath.phase(ground.turn)
            origin = ground.of(here.origin + frame.back(0j) * cmath.exp(1j * here.angle))
            found[link] = (origin, 0.0 if body == GROUND else angle)
        return found

    def ours(self, body: str, angle: float) -> float:
        """A body's angle (rad) from its link's."""
        return angle + cmath.phase(self.match.frames[body].turn) - cmath.phase(self.match.frames[GROUND].turn)

    def apart(self, pin: PlanarPin, wanted: Mapping[int, tuple[complex, float]]) -> float:
        """A joint's angle (rad) or travel (m) for links so placed."""
        (at, angle), (other, turned) = (wanted[k] for k in pin.links)
        if not pin.slides:
            return turned - angle
        way = other + pin.points[1] * cmath.exp(1j * turned) - at - pin.points[0] * cmath.exp(1j * angle)
        return (way * (pin.axis * cmath.exp(1j * angle)).conjugate()).real

    def placed(self, pose: Mapping[str, Pose]) -> np.ndarray:
        """MuJoCo's coordinates (nq,) in a pose of the mechanism."""
        wanted, q = self.wanted(pose), self.planar.pose.copy()
        for pin in self.planar.pins:
            if pin.joint < 0:
                continue
            way = self.apart(pin, wanted) - self.planar.relative(pin, self.home)
            if not pin.slides:
                way = pin.turn * (way - 2 * math.pi * self.turns[id(pin)])
            q[self.model.jnt_qposadr[pin.joint]] += way
        return q

    # ------------------------------------------------------------------ signals

    def rows(self, equality: int) -> np.ndarray:
        """The rows of an equality, as indices."""
        d = self.data
        return np.flatnonzero((d.efc_type == EQUALITY) & (d.efc_id == equality))

    def to_ground(self, vector: complex) -> complex:
        """A vector of the file's plane in the mechanism's ground frame."""
        return vector / self.match.frames[GROUND].turn

    def pushed(self) -> list[tuple[int, complex, float]]:
        """What actuators on sites and tendons over hinges give: body, force (N) and moment (N.m) about the plane's
        origin.
        """
        m, d, flat = self.model, self.data, self.planar.plane.flat
        found = []
        for i in range(m.nactuator):
            if int(m.actuator_trntype[i]) != AT_SITE or not d.actuator_force[i]:
                continue
            site, refsite = (int(k) for k in m.actuator_trnid[i])
            turned = d.site_xmat[site if refsite < 0 else refsite].reshape(3, 3)
            wrench = m.actuator_gear[i].reshape(2, 3) @ turned.T * d.actuator_force[i]
            force = flat(wrench[0])
            moment = float(self.planar.plane.normal @ wrench[1]) + _cross(flat(d.site_xpos[site]), force)
            found.append((int(m.site_bodyid[site]), force, moment))
        return found + [pair for one in self.laws for pair in self.couple(one)]

    def couple(self, one: TendonLaw) -> list[tuple[int, complex, float]]:
        """What a tendon that is the law of a hinge gives its two links."""
        d, t = self.data, one.tendon
        pull = self.push_along(t) + float(d.efc_force[(d.efc_type == TENDON_FRICTION) & (d.efc_id == t)].sum())
        first, second = (self.planar.links[k].root for k in one.pin.links)
        return [(second, 0j, one.scale * pull), (first, 0j, -one.scale * pull)]

    def push_along(self, t: int) -> float:
        """What a tendon's spring and damper do to lengthen it, as MuJoCo's tendon force."""
        m, d = self.model, self.data
        off, stretch = m.opt.disableflags, float(d.ten_length[t] - m.tendon_lengthspring[t, 0])
        spring = 0.0 if off & NO_SPRINGS else float(m.tendon_stiffness[t]) * stretch
        damper = 0.0 if off & NO_DAMPERS else float(m.tendon_damping[t] * d.ten_velocity[t])
        return -spring - damper

    def between(self, pin: PlanarPin, pushed: list[tuple[int, complex, float]]) -> tuple[complex, float]:
        """Force (N) of a joint's first link on its second, and moment (N.m) about the plane's origin."""
        m, d, plane = self.model, self.data, self.planar.plane
        if pin.joint < 0:
            rows = self.rows(pin.equality)
            force = plane.flat(d.efc_force[rows[:3]]) if rows.size else 0j
            return force, 0.0
        child = int(m.jnt_bodyid[pin.joint])
        torque, force3 = d.cfrc_int[child].reshape(2, 3)
        force = plane.flat(force3)
        moment = float(plane.normal @ torque) + _cross(plane.flat(d.subtree_com[m.body_rootid[child]]), force)
        for body, push, turn in pushed:
            if self.beyond(body, child):
                force, moment = force - push, moment - turn
        return force, moment

    def beyond(self, body: int, child: int) -> bool:
        """Whether a body hangs on another, or is it."""
        while body > child:
            body = int(self.model.body_parentid[body])
        return body == child

    def efforts(self) -> dict[str, float]:
        """Torque (N.m) or force (N) of each motor on its joint's second body, of a crank's on the crank."""
        if not self.held:
            return {}
        m, d = self.model, self.data
        inertia = np.zeros(m.nv)
        mujoco.mj_mulM(m, d, inertia, d.qacc)
        rows = d.efc_J.reshape(d.nefc, m.nv).T @ d.efc_force
        left = inertia - self.armature * d.qacc + d.qfrc_bias - d.qfrc_passive - d.qfrc_actuator - rows
        return {one.signal: float(one.sign * one.way * left[one.dof]) for one in self.held}

    def signals(self, velocity: np.ndarray) -> dict[str, float]:
        """All signals of the state in the data, whose forces MuJoCo has computed; ``velocity`` (nv,) is of the same
        instant as the positions.
        """
        mujoco.mj_rnePostConstraint(self.model, self.data)
        pushed, frames = self.pushed(), self.planar.frames(self.data)
        out = self.efforts()
        for joint in self.mechanism.joints:
            pin = self.match.pins[joint.name]
            force, moment = self.between(pin, pushed)
            sign = -1.0 if self.match.swapped(joint) else 1.0
            at = self.to_ground(sign * force)
            out[f"reaction_{joint.name}_x"], out[f"reaction_{joint.name}_y"] = at.real, at.imag
            if joint.prismatic:
                second = joint.bodies[1]
                point = self.match.frames[second].of(self.mechanism.body(second).point(joint.name))
                place = frames.place(self.match.links[second], point)
                out[f"reaction_{joint.name}_moment"] = sign * (moment - _cross(place, force))
            else:
                gap = self.to_ground(sign * self.gap(pin, frames))
                out[f"clearance_{joint.name}_x"], out[f"clearance_{joint.name}_y"] = gap.real, gap.imag
        for name, body in self.mechanism.moving.items():
            out |= self.pose_of(name, body, frames, velocity)
        return out

    def gap(self, pin: PlanarPin, frames: Frames) -> complex:
        """The first link's pin centre less the second's (m)."""
        if pin.joint >= 0:
            return 0j
        return frames.place(pin.links[0], pin.points[0]) - frames.place(pin.links[1], pin.points[1])

    def pose_of(self, name: str, body: Body, frames: Frames, velocity: np.ndarray) -> dict[str, float]:
        """Where a body is, and how fast it turns."""
        k = self.match.links[name]
        at = self.match.frames[GROUND].back(frames.place(k, self.marker(name, body)))
        return {
            f"{name}_x": at.real,
            f"{name}_y": at.imag,
            f"{name}_angle": self.zero[name] + float(self.spin[k] @ self.data.qpos),
            f"{name}_angular_velocity": float(self.spin[k] @ velocity),
        }

    def marker(self, name: str, body: Body) -> complex:
        """Where a body's marker is (m, frame of its link): the file's centre of mass, where it has no other."""
        own = self.planar.links[self.match.links[name]].centre
        return own if body.marker is None else self.match.frames[name].of(complex(*body.marker))

    def rates(self, velocity: np.ndarray) -> dict[str, float]:
        """The bodies' rates in the state in the data, as :mod:`sim_models.common.rates` calls them: MuJoCo's
        accelerations at ``velocity`` (nv,), which is of the same instant as the positions.
        """
        m, d, found = self.model, self.data, np.zeros(6)
        told, frames, weight = d.qvel.copy(), self.planar.frames(d), gravity(m)
        d.qvel[:] = velocity
        mujoco.mj_comVel(m, d)
        mujoco.mj_rnePostConstraint(m, d)
        out: dict[str, float] = {}
        for name, body in self.mechanism.moving.items():
            k = self.match.links[name]
            root, spin = self.planar.links[k].root, float(self.spin[k] @ velocity)
            arm = frames.place(k, self.marker(name, body)) - frames.origins[k]
            mass_centre = (body.point(MASS_CENTRE) - body.point("com")) * cmath.exp(1j * frames.angles[k])
            arm += self.match.frames[name].turn * mass_centre
            mujoco.mj_objectVelocity(m, d, FRAME, root, found, 0)
            speed = self.planar.plane.flat(found[3:]) + 1j * spin * arm
            mujoco.mj_objectAcceleration(m, d, FRAME, root, found, 0)  # less gravity's
            turning = float(self.planar.plane.normal @ found[:3])
            push = self.planar.plane.flat(found[3:] + weight) + (1j * turning - spin**2) * arm
            out |= rate_columns(name, self.to_ground(speed), self.to_ground(push), turning)
        d.qvel[:] = told
        mujoco.mj_comVel(m, d)
        return out

    def parted(self) -> float:
        """How far (m) the pins of the loops' connects have come apart."""
        frames = self.planar.frames(self.data)
        return max((abs(self.gap(pin, frames)) for pin in self.planar.pins), default=0.0)


def _cross(a: complex, b: complex) -> float:
    return (a.conjugate() * b).imag
