"""A linkage as a MuJoCo model: what is where in it, and what its rows and coordinates mean.

Bodies hang in a tree of ideal joints, every prismatic one among them; a body that only joints with clearance hold gets
two slides and a hinge to the world.  What the tree leaves open is closed by constraint rows:

    ideal joint             equality ``connect`` of two sites
    massless-link           equality on the length of a spatial tendon between the two pin centres: it pulls and pushes
    spring-damper           upper limit of that tendon, its reference in N/m and N.s/m
    contact                 one circle inside another through ``mj_addContact``

Joint friction, damping and springs are fixed tendons over the hinges, because a relative angle of any two bodies is a
linear form of the hinges.  Loads are actuators of constant force, fixed in the world's directions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np

from analytic.mechanism import GROUND, Body, Joint, Mechanism
from sim_models.contact_laws import PIN_RADIUS
from sim_models.mujoco.laws import Contact
from sim_models.mujoco.tree import Branch, spanning_tree
from sim_models.start import Pose

MOTOR_INERTIA = 1e9  # kg.m^2 of armature: so much that no reaction changes a motor's speed
RIGID = "0.9999 0.9999 0.001 0.5 2"  # solimp of a rigid row; 0.9999 is MuJoCo's largest impedance
SOFT = 1e-4  # impedance of a row that is a spring and damper: MuJoCo's smallest, so that its reference is the force
LIGHT = 1e2  # 1/kg times the lighter link's mass: makes the virtual mass of such a row 1e-6 of that link's
SMALLEST_INERTIA = 1e-10  # kg.m^2, for a point mass: MuJoCo accepts no zero
SETTLING = 4.0  # time constant of rigid rows, in steps

ROW = mujoco.mjtConstraint
CONTACT_ROWS = (ROW.mjCNSTR_CONTACT_FRICTIONLESS, ROW.mjCNSTR_CONTACT_ELLIPTIC)


@dataclass(frozen=True)
class Part:
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
    twist: float  # rad
    form: np.ndarray  # angle less twist, over qpos


def _numbers(*values: float) -> str:
    return " ".join(repr(float(v)) for v in values)


def _xy(z: complex) -> str:
    return _numbers(z.real, z.imag, 0.0)


class Linkage:
    """MuJoCo's model and data of a mechanism, and how to talk to them in the mechanism's words.

    ``contacts`` names the joints that are not ideal; ``rows`` what closes them.  ``pose`` is the reference pose, ``step``
    (s) the longest step, ``hold`` whether a motor sets the driven body's angle, ``follows`` whether along a course: its last actuator
    then gives it the acceleration (rad/s^2) that is its activation.  With ``rows="spring"`` the spring-damper also pulls: a
    smooth stand-in, to find where the real one rests.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        contacts: Mapping[str, Contact],
        rows: str,
        pose: Mapping[str, Pose],
        step: float,
        hold: bool = True,
        friction: bool = True,
        follows: bool = False,
    ) -> None:
        self.mechanism, self.contacts, self.rows, self.pose = mechanism, contacts, rows, pose
        self.branches, self.closing = spanning_tree(mechanism, set(contacts))
        self.stiffness = (mechanism.drive.stiffness or 0.0) if hold and mechanism.drive is not None and mechanism.drive.speed != "free" else 0.0
        self.compliant = self.stiffness > 0  # N.m/rad between motor and crank
        self.hold, self.friction, self.step, self.follows = hold, friction, step, follows
        self.stepped = rows in ("spring-damper", "contact")  # semi-implicit Euler: what is stiff allows no larger step, and RK4 four times the work
        self.place = {GROUND: Pose(0j, 0.0), **pose}
        self.forms, self.twist = self._angles()
        self.model = m = mujoco.MjModel.from_xml_string(self.mjcf())
        self.data = mujoco.MjData(m)
        self._name_things()
        self._set_laws()

    # ---------------------------------------------------------------- description

    def _angles(self) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
        """Each body's angle as a sum of hinges, and the constant that prismatic joints add."""
        forms: dict[str, dict[str, float]] = {GROUND: {}}
        twist = {GROUND: 0.0}
        for b in self.branches:
            name = b.body.name
            forms[name], twist[name] = dict(forms[b.parent]), twist[b.parent]
            if b.joint is not None and b.joint.prismatic:
                twist[name] += b.joint.angle if b.is_second else -b.joint.angle
            else:
                forms[name][name] = 1.0
        return forms, twist

    def mjcf(self) -> str:
        """The model as MJCF text."""
        m = self.mechanism
        solref = _numbers(SETTLING * self.step, 1)
        integrator = "implicitfast" if self.stepped else "RK4"
        closed = "".join(f'<connect name="{j.name}" site1="{j.name}:{j.bodies[1]}" site2="{j.name}:{j.bodies[0]}"/>' for j in self.closing)
        return f"""<mujoco model={quoteattr(m.name)}>
<compiler angle="radian" inertiafromgeom="false"/>
<option timestep="{self.step!r}" gravity="{_xy(complex(*m.gravity))}" integrator="{integrator}" cone="elliptic" impratio="100"
  jacobian="dense" solver="Newton" tolerance="1e-14" iterations="30"><flag autoreset="disable" island="disable"/></option>
<default><equality solref="{solref}" solimp="{RIGID}"/><tendon solreffriction="{solref}" solimpfriction="{RIGID}"/></default>
<worldbody>{self._places(GROUND)}{self._children(GROUND)}{self._motor()}</worldbody>
<tendon>{self._links()}{"".join(self._law(j) for j in m.joints)}{self._drive_spring()}</tendon>
<equality>{closed}{self._bars()}</equality>
<actuator>{"".join(self._load(i) for i in range(len(m.loads)))}{self._course()}</actuator>
</mujoco>"""

    def coordinates(self, pose: Mapping[str, Pose], branches: list[Branch] | None = None) -> dict[str, float]:
        """Value of each MuJoCo joint (rad, m) in a pose."""
        at: dict[str, float] = {}
        everything = {GROUND: Pose(0j, 0.0), **pose}

        def pin(j: Joint, body: str) -> complex:
            return everything[body].origin + complex(np.exp(1j * everything[body].angle)) * self.mechanism.body(body).point(j.name)

        for b in self.branches if branches is None else branches:
            name, here = b.body.name, everything[b.body.name]
            if b.joint is None:
                at |= {f"{name}:x": here.origin.real, f"{name}:y": here.origin.imag, name: here.angle}
            elif b.joint.prismatic:
                first, second = (pin(b.joint, n) for n in b.joint.bodies)
                axis = b.joint.direction * np.exp(1j * everything[b.joint.bodies[0]].angle)
                at[f"{name}:slide"] = float(((second - first) * np.conj(axis)).real)
            else:
                at[name] = here.angle - everything[b.parent].angle
        if self.compliant:
            at["drive:motor"] = everything[self.mechanism.driven].angle
        return at

    def across(self, j: Joint) -> dict[str, float]:
        """What a joint lets free, second body less first, as a linear form of coordinates: the angle but for a constant, or the travel."""
        if j.prismatic:
            return {f"{next(b.body.name for b in self.branches if b.joint is j)}:slide": 1.0}
        first, second = (self.forms[b] for b in j.bodies)
        return {n: second.get(n, 0.0) - first.get(n, 0.0) for n in {**first, **second}}

    def _children(self, parent: str) -> str:
        return "".join(self._body(b) for b in self.branches if b.parent == parent)

    def _body(self, b: Branch) -> str:
        here, parent = self.place[b.body.name], self.place[b.parent]
        turn = np.exp(-1j * parent.angle)
        half = (here.angle - parent.angle) / 2
        inertia = max(b.body.moment_of_inertia, SMALLEST_INERTIA)
        return (
            f'<body name="{b.body.name}" pos="{_xy((here.origin - parent.origin) * turn)}" quat="{_numbers(np.cos(half), 0, 0, np.sin(half))}">'
            f'<inertial pos="{_xy(b.body.centre)}" mass="{b.body.mass!r}" diaginertia="{_numbers(inertia, inertia, inertia)}"/>'
            f"{self._freedom(b)}{self._places(b.body.name)}{self._children(b.body.name)}</body>"
        )

    def _freedom(self, b: Branch) -> str:
        name, here, at = b.body.name, self.place[b.body.name], self.coordinates(self.pose, [b])
        motor = f' armature="{MOTOR_INERTIA!r}"' if self.hold and not self.compliant and name == self.mechanism.driven else ""
        slides = {}
        if b.joint is None:
            slides = {f"{name}:x": np.exp(-1j * here.angle), f"{name}:y": 1j * np.exp(-1j * here.angle)}
        elif b.joint.prismatic:
            axis = b.joint.direction * np.exp(1j * (self.place[b.joint.bodies[0]].angle - here.angle))
            slides = {f"{name}:slide": axis if b.is_second else -axis}
        text = "".join(f'<joint name="{n}" type="slide" axis="{_xy(axis)}" ref="{at[n]!r}"/>' for n, axis in slides.items())
        if name not in at:
            return text
        pin = 0j if b.joint is None else b.body.point(b.joint.name)
        return f'{text}<joint name="{name}" type="hinge" axis="0 0 1" pos="{_xy(pin)}" ref="{at[name]!r}"{motor}/>'

    def _places(self, name: str) -> str:
        """Sites at a body's pins and load points, and a geom at each pin that touches."""
        body = self.mechanism.body(name)
        pins = [j for j in self.mechanism.joints if name in j.bodies]
        text = "".join(f'<site name="{j.name}:{name}" pos="{_xy(body.point(j.name))}"/>' for j in pins)
        loads = {i: _xy(body.point(load.point)) for i, load in enumerate(self.mechanism.loads) if load.body == name}
        text += "".join(f'<site name="load{i}" pos="{at}"/>' for i, at in loads.items())
        text += '<site name="world"/>' if name == GROUND else f'<site name="marker of {name}" pos="{_xy(body.point("com"))}"/>'
        touching = {j.name: _xy(body.point(j.name)) for j in pins if j.name in self.contacts and self.rows == "contact"}
        return text + "".join(f'<geom name="{n}:{name}" size="0.01" pos="{at}" contype="0" conaffinity="0"/>' for n, at in touching.items())

    def _motor(self) -> str:
        if not self.compliant:
            return ""
        at = self.place[self.mechanism.driven].angle
        hinge = f'<joint name="drive:motor" type="hinge" axis="0 0 1" armature="{MOTOR_INERTIA!r}" ref="{at!r}"/>'
        return f'<body name="drive:motor"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{hinge}</body>'

    def _drive_spring(self) -> str:
        if not self.compliant:
            return ""
        crank = f'<joint joint="{self.mechanism.driven}" coef="1"/><joint joint="drive:motor" coef="-1"/>'
        return f'<fixed name="drive:spring" stiffness="{self.stiffness!r}" springlength="0">{crank}</fixed>'

    def _links(self) -> str:
        if self.rows == "contact":
            return ""
        limited = self.rows == "spring-damper"
        limit = {n: f' limited="true" range="-1 {self.mechanism.joint(n).clearance!r}"' if limited else "" for n in self.contacts}
        ends = {n: "".join(f'<site site="{n}:{b}"/>' for b in self.mechanism.joint(n).bodies) for n in self.contacts}
        return "".join(f'<spatial name="{n}"{limit[n]}>{ends[n]}</spatial>' for n in self.contacts)

    def _bars(self) -> str:
        if self.rows not in ("massless-link", "spring"):
            return ""
        return "".join(f'<tendon name="{n}" tendon1="{n}"/>' for n in self.contacts)

    def _law(self, j: Joint) -> str:
        """Fixed tendon of a joint's friction, damping and spring."""
        if not (j.coulomb or j.damping or j.stiffness):
            return ""
        terms = "".join(f'<joint joint="{n}" coef="{c!r}"/>' for n, c in self.across(j).items() if c)
        loss = f' frictionloss="{j.coulomb!r}"' if self.friction else ""
        return f'<fixed name="law:{j.name}" stiffness="{j.stiffness!r}" damping="{j.damping!r}"{loss}>{terms}</fixed>'

    def _load(self, i: int) -> str:
        load = self.mechanism.loads[i]
        gear = _numbers(*load.force, 0, 0, 0, load.torque)
        return f'<general name="load{i}" site="load{i}" refsite="world" gear="{gear}" biastype="affine" biasprm="1 0 0"/>'

    def _course(self) -> str:
        joint = "drive:motor" if self.compliant else self.mechanism.driven
        return f'<general name="drive:course" joint="{joint}" dyntype="integrator" gainprm="{MOTOR_INERTIA!r}"/>' if self.follows else ""

    # ---------------------------------------------------------------- numbers that MJCF has no attribute for

    def _name_things(self) -> None:
        m, joints = self.model, self.mechanism.joints
        self.names = [m.joint(i).name for i in range(m.njnt)]  # every joint has one coordinate: qpos and qvel have the same index
        self.index = {name: i for i, name in enumerate(self.names)}
        self.sites = {j.name: (m.site(f"{j.name}:{j.bodies[0]}").id, m.site(f"{j.name}:{j.bodies[1]}").id) for j in joints}
        self.driven = self.mechanism.driven if self.hold else ""
        self.body_id = {b.name: m.body(b.name).id for b in self.mechanism.bodies}
        self.motor = self.index["drive:motor" if self.compliant else self.mechanism.driven] if self.hold else -1
        self.pins = [j.name for j in joints if not j.prismatic]
        self.form = {b: self.vector(form) for b, form in self.forms.items()}
        self.laws = {j.name: m.tendon(f"law:{j.name}").id for j in joints if j.coulomb or j.damping or j.stiffness}

        bars = self.contacts if self.rows in ("massless-link", "spring") else ()
        self.row_id = {name: m.equality(name).id for name in (*(j.name for j in self.closing), *bars)}  # of equalities
        self.load_sites = [m.site(f"load{i}").id for i in range(len(self.mechanism.loads))]
        self.outward = [self._part(b) for b in reversed(self.branches)]  # tips first

        self.size = max(b.length for b in self.mechanism.bodies) or 1.0  # m
        self.touching: list[str] = []  # joints in contact, in the order of MuJoCo's contacts
        self.radii = {n: (j.clearance, (j.pin_radius or PIN_RADIUS) + j.clearance) for n in self.contacts for j in [self.mechanism.joint(n)]}
        self.friction_forms = {j.name: j.coulomb * self.vector(self.across(j)) for j in joints if j.coulomb}

    def _part(self, b: Branch) -> Part:
        name = b.body.name
        joint = "" if b.joint is None else b.joint.name
        sign = 1.0 if b.is_second else -1.0
        slides = b.joint is not None and b.joint.prismatic
        marker = self.model.site(f"marker of {name}").id
        inertia = b.body.moment_of_inertia
        return Part(name, b.parent, joint, sign, slides, self.body_id[name], marker, b.body.mass, inertia, self.twist[name], self.form[name])

    def vector(self, form: Mapping[str, float]) -> np.ndarray:
        """A form (or a set of coordinates) as an array in MuJoCo's order (nq,)."""
        return np.array([form.get(n, 0.0) for n in self.names])

    def _set_laws(self) -> None:
        m = self.model
        for name, t in self.laws.items():
            j = self.mechanism.joint(name)
            rest = j.rest_angle if j.prismatic else j.rest_angle - self.twist[j.bodies[1]] + self.twist[j.bodies[0]]
            m.tendon_lengthspring[t] = rest
        self.touch = {name: self._touch(name) for name in self.contacts} if self.rows == "contact" else {}
        if self.rows in ("massless-link", "spring"):
            for name in self.contacts:
                e, t = m.equality(name).id, m.tendon(name).id
                m.eq_data[e, 0] = self.mechanism.joint(name).clearance - m.tendon_length0[t]
                m.tendon_invweight0[t] = self._lightness(name) * (LIGHT if self.rows == "spring" else 1)
                if self.rows == "spring":
                    m.eq_solref[e], m.eq_solimp[e] = self._spring(name, m.tendon_invweight0[t])
        if self.rows == "spring-damper":
            for name in self.contacts:
                t = m.tendon(name).id
                m.tendon_invweight0[t] = LIGHT * self._lightness(name)
                m.tendon_solref_lim[t], m.tendon_solimp_lim[t] = self._spring(name, m.tendon_invweight0[t])

    def _lightness(self, name: str) -> float:
        return sum(1 / b.mass for b in map(self.mechanism.body, self.mechanism.joint(name).bodies) if isinstance(b, Body))

    def _spring(self, name: str, invweight: float) -> tuple[list[float], list[float]]:
        """solref and solimp of a row whose force is K d + C d' (the factor cancels MuJoCo's scaling by impedance and mass)."""
        c = self.contacts[name]
        scale = (1 - SOFT) * invweight
        return [-c.stiffness * scale, -c.damping * scale], [SOFT, SOFT, 1e-3, 0.5, 2]

    def _touch(self, name: str) -> Any:
        m, j, law = self.model, self.mechanism.joint(name), self.contacts[name]
        con = mujoco.MjContact()
        con.dim = 3 if j.friction else 1
        con.friction = [j.friction, j.friction, 0, 0, 0]
        geoms = [m.geom(f"{name}:{b}").id for b in (j.bodies[1], j.bodies[0])]  # the second body holds the bearing, the first the journal
        con.geom = geoms
        con.flex = con.elem = con.vert = [-1, -1]
        if law.hard:
            period, ratio = law.hard
            con.solref, con.solimp = [period / ratio, ratio], [float(x) for x in RIGID.split()]
        else:
            con.solref, con.solimp = self._spring(name, float(m.body_invweight0[m.geom_bodyid[geoms], 0].sum()))
        return con
