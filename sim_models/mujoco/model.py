"""A linkage compiled by MuJoCo: its model and data, with what MJCF has no attribute for, and where in them everything
is.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

import mujoco
import numpy as np

from analytic.mechanism import GROUND, Body, Joint, Mechanism
from analytic.mechanism.signals import driving
from analytic.mechanism.varying import NEVER, Seen
from sim_models.common.contact_laws import bearing, lighter_mass
from sim_models.common.fading import fading
from sim_models.common.guide import Guide
from sim_models.common.start import Pose
from sim_models.common.tree import Branch
from sim_models.engine import Unsupported
from sim_models.mujoco.laws import RUBBING_DAMPING, WallContact, spring
from sim_models.mujoco.mjcf import RIGID_IMPEDANCE, Description, Setting
from sim_models.mujoco.passive import Passive
from sim_models.mujoco.rim import Rim, memory
from sim_models.mujoco.striking import MujocoStriking

LIGHT = 1e2  # 1/kg times the lighter link's mass: makes the virtual mass of such a row 1e-6 of that link's

LEAST_FRICTION = float(np.finfo(float).tiny)  # N, N.m: dry friction of a row, which without any would not be there

ROW = mujoco.mjtConstraint
SITE = mujoco.mjtObj.mjOBJ_SITE


def _curved(j: Joint) -> bool:
    """Whether a joint has a law that a tendon has no words for."""
    return bool(j.cubic or j.drag or j.stribeck_speed or j.stops)


@dataclass(frozen=True)
class Friction:
    """Coulomb friction of a contact, a pin's or a corner's: its joint, its coefficient, and the sign by which the
    contact's slip in MuJoCo's row goes with the joint's rate.
    """

    joint: str
    coefficient: float
    way: float = 1.0


@dataclass(frozen=True)
class TreeDrive:
    """A motor between a body and its parent in the tree: the signal of what it gives its joint, and that joint."""

    signal: str
    joint: Joint
    sign: float  # 1 if the body is the joint's second, or the crank, else -1


@dataclass(frozen=True)
class TreePart:
    """What the balance of one body needs, by MuJoCo's numbers."""

    name: str
    parent: str
    joint: str  # in the tree; empty for a floating body
    sign: float  # 1 if the body is the joint's second, else -1
    slides: bool
    number: int
    marker: int  # site
    mass: float  # kg
    inertia: float  # kg.m^2
    fixed_angle: float  # rad
    form: np.ndarray  # angle less fixed_angle, over qpos
    drive: TreeDrive | None  # of the motor between it and its parent


@dataclass
class MujocoBlock:
    """The block of a joint: its guide, the law of its corners, and MuJoCo's contact of each of these.

    ``pressed`` are the corners that touch where all that has clearance counts as pressed.
    """

    joint: Joint
    guide: Guide
    law: WallContact
    contacts: list[mujoco.MjContact]
    pressed: tuple[int, ...] = field(default=())

    def key(self, corner: int) -> str:
        """The name of a corner's contact."""
        return f"{self.joint.name}:{corner}"


class Watching(Protocol):
    """What takes in every step, at its begin and at its end."""

    def begin(self) -> None: ...
    def end(self) -> None: ...


class MujocoLinkage:
    """MuJoCo's model and data of a mechanism, and how to talk to them in the mechanism's words.

    ``contacts`` has the contact law of every joint that is not ideal, ``pose`` is the reference pose.
    """

    def __init__(
        self, mechanism: Mechanism, contacts: Mapping[str, WallContact], pose: Mapping[str, Pose], setting: Setting
    ) -> None:
        self.mechanism, self.setting = mechanism, setting
        self.contacts = {name: law for name, law in contacts.items() if not mechanism.joint(name).prismatic}
        self.description = Description(mechanism, contacts, pose, setting)
        light = [b for b in mechanism.bodies if b.mass <= mujoco.mjMINVAL]
        if light:
            what = (
                f"body {light[0].name!r} has mass = {light[0].mass:g} kg, of which MuJoCo wants more than"
                f" {mujoco.mjMINVAL:g} kg"
            )
            raise Unsupported(f"mujoco: {what}; give it a mass that matters, or use another simulator")
        self.model = m = mujoco.MjModel.from_xml_string(self.description.mjcf())
        self.data = mujoco.MjData(m)
        self.places = memory(self.data.site_xpos.reshape(-1))  # m, x y z of one site after the other
        self.heading: Mapping[str, Pose] = {}  # at rest: bodies in the motion that loads oppose
        self.seen = Seen(self.angle, self.place, self.going, self.spin, lambda: float(self.data.time))
        # where no motor holds the linkage, a load that opposes its motion fades
        self.fades = [NEVER if setting.hold else fading(mechanism, load) for load in mechanism.loads]
        self.loaded = [  # what each load is now
            (load, partial(mechanism.acting, load, self.seen, fade))
            for load, fade in zip(mechanism.loads, self.fades, strict=True)
        ]
        self._name_things()
        self._set_laws()
        self.blocks = {name: self._block(name, law) for name, law in contacts.items() if name not in self.contacts}
        keys = [(block, block.key(k)) for block in self.blocks.values() for k in range(4)]
        self.rubs |= {key: block.joint.rough for block, key in keys}
        self.striking |= {
            key: MujocoStriking(block.law.named, lighter_mass(mechanism, block.joint), block.joint.friction)
            for block, key in keys
            if block.law.named is not None
        }
        self.cones += [key for _, key in keys if self.rubs[key] and key not in self.striking]
        walls = [(block, k, side) for block in self.blocks.values() for k, side in enumerate(block.guide.sides)]
        self.frictions = {name: Friction(name, mechanism.joint(name).friction) for name in self.contacts}
        self.frictions |= {b.key(k): Friction(b.joint.name, b.joint.friction, side) for b, k, side in walls}
        crank = mechanism.driven if mechanism.periodic_torque else GROUND
        curved = [j for j in mechanism.joints if j.name in self.laws and _curved(j)]
        laws = {self.laws[j.name]: (j, self.between(j)) for j in curved}
        self.loads = {j.name: 0.0 for j in mechanism.load_rubbed}  # N: how hard they are pressed, as last heeded
        # those whose rows give it, by their tendon's number, each with what it grows by
        rows = [j for j in mechanism.load_rubbed if j.name in self.laws and setting.friction]
        self.growing = {self.laws[j.name]: (j, j.load_coefficient) for j in rows}
        for t, (j, _) in self.growing.items():
            m.tendon_frictionloss[t] = max(j.stiction, LEAST_FRICTION)
        varying = {
            site: acting for site, (load, acting) in zip(self.load_sites, self.loaded, strict=True) if load.varies
        }
        angle, form = self.fixed_angle[crank], self.form[crank]
        passive = Passive(laws, self.loads, mechanism.periodic_torque, angle, form, varying)
        self.passive = passive if laws or mechanism.periodic_torque or varying else None
        self.present: np.ndarray | None = None  # velocities of this instant, where the data's are older
        self.watch: Watching | None = None

    @property
    def kept(self) -> bool:
        """Whether every step passes through Python."""
        return bool(self.rims or self.blocks or self.striking) or self.watch is not None

    def _name_things(self) -> None:
        m, joints = self.model, self.mechanism.joints
        self.names = [
            m.joint(i).name for i in range(m.njnt)
        ]  # every joint has one coordinate: qpos and qvel have the same index
        self.index = {name: i for i, name in enumerate(self.names)}
        self.sites = {
            j.name: (m.site(f"{j.name}:{j.bodies[0]}").id, m.site(f"{j.name}:{j.bodies[1]}").id) for j in joints
        }
        self.driven = self.mechanism.driven if self.setting.hold and self.setting.driven is None else ""
        self.body_id = {b.name: m.body(b.name).id for b in self.mechanism.bodies}
        self.motors = [self.index[name] for name in self.description.motors]
        self.ways = np.array([*self.description.motors.values()])  # signs of their joints' positions
        self.motor = self.motors[0] if self.motors else -1  # a crank's
        self.moved = np.setdiff1d(np.arange(m.nv), self.motors)  # coordinates that no motor sets
        self.pins = [j.name for j in joints if not j.prismatic]
        self.fixed_angle = self.description.fixed_angle
        self.form = {b: self.vector(form) for b, form in self.description.forms.items()}
        self.laws = {j.name: m.tendon(f"law:{j.name}").id for j in joints if self.description.gives(j)}

        bars = self.contacts if self.setting.rows in ("massless-link", "spring") else ()
        self.row_id = {
            name: m.equality(name).id
            for name in (*(j.name for j in (*self.description.closing, *self.description.soft)), *bars)
        }  # of equalities
        self.soft = {j.name: bearing(self.mechanism, j) for j in self.description.soft}
        self.markers = {b.name: m.site(f"marker of {b.name}").id for b in self.mechanism.bodies}
        self.load_sites = [m.site(f"load{i}").id for i in range(len(self.mechanism.loads))]
        self.springs = [
            (spring, m.tendon(f"spring:{i}").id, [m.site(f"spring:{i}:{body}").id for body in spring.bodies])
            for i, spring in enumerate(self.mechanism.springs)
        ]  # each with its tendon, and the sites of its ends
        self.drives = self._drives()
        crank = ["drive_torque"] if self.setting.driven is None else []  # zero, where nothing drives it
        self.efforts = [drive.signal for drive in self.drives.values()] or crank
        self.outward = [self._part(b) for b in reversed(self.description.branches)]  # tips first

        self.tendon = {name: m.tendon(name).id for name in self.contacts if self.setting.rows == "spring-damper"}
        self.depth: dict[str, float] = {}  # m, of each block's corner in its wall; negative where it is off
        self.rubs = {n: self.setting.rows == "contact" and self.mechanism.joint(n).friction > 0 for n in self.contacts}
        self.striking = {
            name: MujocoStriking(law.named, lighter_mass(self.mechanism, j), j.friction if self.rubs[name] else 0.0)
            for name, law in self.contacts.items()
            for j in [self.mechanism.joint(name)]
            if law.named is not None
        }
        self.size = max(b.length for b in self.mechanism.bodies) or 1.0  # m
        self.touching: list[str] = []  # joints in contact, in the order of MuJoCo's contacts
        self.radii = {n: (j.clearance, j.rim + j.clearance) for n in self.contacts for j in [self.mechanism.joint(n)]}
        self.rubbing = [(j, self.between(j)) for j in joints if j.rubs]  # each with the form of its coordinate

    def _drives(self) -> dict[str, TreeDrive]:
        """The motors, by the body of the two that is farther out."""
        if self.setting.driven is None:
            return {self.driven: TreeDrive("drive_torque", self.mechanism.drive_joint, 1.0)} if self.driven else {}
        driven = self.description.driven
        names = [signal.name for signal in driving([joint for joint, _ in driven])] if driven else []
        crank = self.mechanism.crank_sign
        return {
            b.body.name: TreeDrive(name, joint, crank * (1.0 if b.body.name == joint.bodies[1] else -1.0))
            for name, (joint, b) in zip(names, driven, strict=True)
        }

    def _part(self, b: Branch) -> TreePart:
        name = b.body.name
        joint = "" if b.joint is None else b.joint.name
        sign = 1.0 if b.is_second else -1.0
        slides = b.joint is not None and b.joint.prismatic
        inertia = b.body.moment_of_inertia
        return TreePart(
            name,
            b.parent,
            joint,
            sign,
            slides,
            self.body_id[name],
            self.markers[name],
            b.body.mass,
            inertia,
            self.fixed_angle[name],
            self.form[name],
            self.drives.get(name),
        )

    def vector(self, form: Mapping[str, float]) -> np.ndarray:
        """A form (or a set of coordinates) as an array in MuJoCo's order (nq,)."""
        return np.array([form.get(n, 0.0) for n in self.names])

    def angle(self, body: str) -> float:
        """A body's angle (rad)."""
        return self.fixed_angle[body] + float(self.form[body] @ self.data.qpos)

    def place(self, body: str, point: str) -> complex:
        """Where (m) a body's marker is, ``com``, or a point of it, or the ground's at a joint."""
        return complex(*self.data.site_xpos[self._site(body, point), :2].tolist()) + self._arm(body, point)

    def _site(self, body: str, point: str) -> int:
        """The site of a point at a joint; of any other the body's marker."""
        if point not in self.sites:
            return self.markers[body]
        return self.sites[point][self.mechanism.joint(point).bodies.index(body)]

    def _arm(self, body: str, point: str) -> complex:
        """From the site to the point (m)."""
        part = self.mechanism.moving.get(body)
        if part is None or point == "com" or point in self.sites:
            return 0j
        return (part.point(point) - part.centre) * cmath.exp(1j * self.angle(body))

    def going(self, body: str, point: str) -> complex:
        """Velocity (m/s) of that point; at rest as the drives go on."""
        if body in self.heading:
            pose, at = self.heading[body], self.mechanism.body(body).point(point)
            return pose.velocity + 1j * pose.angular_velocity * at * cmath.exp(1j * pose.angle)
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(self.model, self.data, SITE, self._site(body, point), velocity, 0)
        return complex(velocity[3], velocity[4]) + 1j * self.spin(body) * self._arm(body, point)

    def spin(self, body: str) -> float:
        """A body's angular velocity (rad/s); at rest as the drives go on."""
        return self.heading[body].angular_velocity if body in self.heading else float(self.form[body] @ self.data.qvel)

    def placed(self, pose: Mapping[str, Pose]) -> np.ndarray:
        """Coordinates (nq,) in a pose."""
        return self.vector(self.description.coordinates(pose))

    def between(self, joint: Joint) -> np.ndarray:
        """What a joint lets free, as a linear form (nq,) of coordinates (:meth:`Description.across`)."""
        return self.vector(self.description.across(joint))

    def _set_laws(self) -> None:
        m = self.model
        for name, t in self.laws.items():
            j = self.mechanism.joint(name)
            rest = (
                j.rest_angle
                if j.prismatic
                else j.rest_angle - self.fixed_angle[j.bodies[1]] + self.fixed_angle[j.bodies[0]]
            )
            m.tendon_lengthspring[t] = rest
        walls = self.contacts if self.setting.rows == "contact" else {}
        self.rims = {
            name: Rim(m, self.data, self.mechanism.joint(name), self.sites[name], law, self._touch(name, law))
            for name, law in walls.items()
        }
        self.second_order = bool(walls) and all(rim.second_order for rim in self.rims.values()) and not self.tendon
        self.cones = [name for name in walls if self.rubs[name] and name not in self.striking]
        if self.setting.rows in ("massless-link", "spring"):
            for name in self.contacts:
                e, t = m.equality(name).id, m.tendon(name).id
                m.eq_data[e, 0] = self.mechanism.joint(name).clearance - m.tendon_length0[t]
                m.tendon_invweight0[t] = self._lightness(name) * (LIGHT if self.setting.rows == "spring" else 1)
                if self.setting.rows == "spring":
                    m.eq_solref[e], m.eq_solimp[e] = self._spring(name, m.tendon_invweight0[t])
        for name, law in self.soft.items():
            e, bodies = m.equality(name).id, m.site_bodyid[list(self.sites[name])]
            invweight = max(float(m.body_invweight0[bodies, 0].sum()), mujoco.mjMINVAL)
            m.eq_solref[e], m.eq_solimp[e] = spring(law, invweight)
        flanks = self.setting.flanks
        if flanks is not None and not flanks.rigid:
            t = m.tendon("drive:spring").id
            m.tendon_solref_lim[t], m.tendon_solimp_lim[t] = spring(flanks, float(m.tendon_invweight0[t]))
        if self.setting.rows == "spring-damper":
            for name in self.contacts:
                t = m.tendon(name).id
                m.tendon_invweight0[t] = LIGHT * self._lightness(name)
                m.tendon_solref_lim[t], m.tendon_solimp_lim[t] = self._spring(name, m.tendon_invweight0[t])

    def _lightness(self, name: str) -> float:
        return sum(
            1 / b.mass for b in map(self.mechanism.body, self.mechanism.joint(name).bodies) if isinstance(b, Body)
        )

    def _spring(self, name: str, invweight: float) -> tuple[list[float], list[float]]:
        return spring(self.contacts[name], invweight)

    def _block(self, name: str, law: WallContact) -> MujocoBlock:
        """The block of a prismatic joint with clearance."""
        joint = self.mechanism.joint(name)
        guide = Guide.of(joint)
        assert guide is not None  # a mechanism with clearance in a prismatic joint has it
        return MujocoBlock(joint, guide, law, [self._touch(name, law) for _ in guide.corners])

    def _touch(self, name: str, law: WallContact) -> mujoco.MjContact:
        m, j = self.model, self.mechanism.joint(name)
        con = mujoco.MjContact()
        friction = j.friction
        con.dim = 3 if friction else 1
        con.friction = [friction, friction, 0, 0, 0]
        geoms = [
            m.geom(f"{name}:{b}").id for b in (j.bodies[1], j.bodies[0])
        ]  # the second body holds the bearing, the first the journal
        con.geom = geoms
        con.flex = con.elem = con.vert = [-1, -1]
        if law.hard:
            period, ratio = law.hard
            con.solref, con.solimp = [period / ratio, ratio], [float(x) for x in RIGID_IMPEDANCE.split()]
            if friction and ratio < RUBBING_DAMPING:
                con.solreffriction = [period / RUBBING_DAMPING, RUBBING_DAMPING]
        else:
            con.solref, con.solimp = spring(law, float(m.body_invweight0[m.geom_bodyid[geoms], 0].sum()))
        return con
