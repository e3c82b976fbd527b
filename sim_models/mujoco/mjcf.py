"""A linkage as MJCF: what is where in MuJoCo's model of it, and what its coordinates mean.

Bodies hang in a tree of ideal joints, every prismatic one among them; a body that only joints with clearance hold gets
two slides and a hinge to the world.  What the tree leaves open is closed by constraint rows:

    ideal joint             equality ``connect`` of two sites
    soft bearing            the same, its reference in N/m and N.s/m
    massless-link           equality on the length of a spatial tendon between the two pin centres: it pulls and pushes
    spring-damper           upper limit of that tendon, its reference in N/m and N.s/m
    contact                 one circle inside another through ``mj_addContact``

Joint friction, damping and springs are fixed tendons over the hinges, because a relative angle of any two bodies is a
linear form of the hinges.  Springs between points are spatial tendons.  Loads are actuators of constant force, fixed in
the world's directions.

It is text, and no ``MjSpec``, because the export is this text with all digits: ``MjSpec.to_xml`` prints six, which
moves its numbers by up to 3e-6 and opens closed pins by 3e-7 m (MuJoCo 4.0.0; tests/test_mujoco_traps.py).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np

from analytic.mechanism import GROUND, Joint, Mechanism
from sim_models.common.backlash import HOLDS, Flanks
from sim_models.common.start import AT_REST, Pose
from sim_models.common.travel import slide_travel
from sim_models.common.tree import Branch
from sim_models.mujoco.tree import spanning_tree

MOTOR_INERTIA = 1e9  # kg.m^2 of armature: so much that no reaction changes a motor's speed
RIGID_IMPEDANCE = "0.9999 0.9999 0.001 0.5 2"  # solimp of a rigid row; 0.9999 is MuJoCo's largest impedance
SMALLEST_INERTIA = 1e-14  # kg.m^2, for a point mass: MuJoCo accepts no less than 1e-15
# of the solver, which measures by the model's inertia, the motor's armature included: 1e-14 left 0.6 % of a light
# contact's force
SOLVER_TOLERANCE = 1e-24
RIGID_TIME_CONSTANT = (
    8.0  # time constant of rigid rows, in steps: at 4 the stages of a step leave 17 times the error in forces
)
LANDING_DAMPING = 1.2  # damping ratio of a crank that lands on a flank of its drive: no bounce
STICKING = 4.0  # of friction's rows, which are the sharper the shorter it is


def _numbers(*values: float) -> str:
    return " ".join(repr(float(v)) for v in values)


def _xy(z: complex) -> str:
    return _numbers(z.real, z.imag, 0.0)


@dataclass(frozen=True)
class Setting:
    """How a linkage is modelled in MuJoCo.

    ``rows`` says what closes the joints that are not ideal; with ``"spring"`` the spring-damper also pulls: a smooth
    stand-in, to find where the real one rests.  ``step`` (s) is the longest step, ``hold`` whether a motor sets the
    driven body's angle, ``follows`` whether along a course: the last actuators, one for each motor, then give it the
    acceleration (rad/s^2; of a slide m/s^2) that is their activation.  ``friction`` is whether the joints' own laws
    have theirs; ``flanks`` are those of a drive with backlash, which else is a spring in both directions: the smooth
    stand-in for one flank.  ``driven`` names the joints whose positions motors set, each along its course, where these
    are not a crank's.
    """

    rows: str
    step: float
    hold: bool = True
    friction: bool = True
    follows: bool = False
    flanks: Flanks | None = None
    driven: tuple[str, ...] | None = None

    @property
    def stepped(self) -> bool:
        """Whether steps are semi-implicit Euler's: what is stiff allows no larger, and RK4 has four times the work."""
        return self.rows in ("spring", "spring-damper", "contact")


class Description:
    """A mechanism in MuJoCo's own words: its MJCF, and what the coordinates of that mean.

    ``contacts`` names the joints that are not ideal, ``pose`` is the reference pose.
    """

    def __init__(
        self, mechanism: Mechanism, contacts: Collection[str], pose: Mapping[str, Pose], setting: Setting
    ) -> None:
        self.mechanism, self.closed_by, self.pose, self.setting = mechanism, tuple(contacts), pose, setting
        self.soft = tuple(j for j in mechanism.joints if j.radial_stiffness is not None and j.name not in contacts)
        # blocks with clearance hang in the tree: along their guides, across them and about their points
        self.blocks = frozenset(name for name in contacts if mechanism.joint(name).prismatic)
        cut = {*contacts, *(j.name for j in self.soft)} - self.blocks
        self.branches, self.closing = spanning_tree(mechanism, cut, setting.driven)
        self.stiffness = (mechanism.drive_stiffness or 0.0) if setting.hold and setting.driven is None else 0.0
        self.compliant = self.stiffness > 0  # N.m/rad between motor and crank
        self.place = {GROUND: AT_REST, **pose}
        self.forms, self.fixed_angle = self._angles()
        # driven joints, each with the branch that it, or in its place a floating body, makes
        self.driven = [
            (j, next(b for b in self.branches if {b.body.name, b.parent} == set(j.bodies)))
            for j in map(mechanism.joint, setting.driven or ())
        ]
        self.motors = self._motors()

    def _angles(self) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
        """Each body's angle as a sum of hinges, and the constant that prismatic joints add."""
        forms: dict[str, dict[str, float]] = {GROUND: {}}
        fixed_angle = {GROUND: 0.0}
        for b in self.branches:
            name = b.body.name
            forms[name], fixed_angle[name] = dict(forms[b.parent]), fixed_angle[b.parent]
            if b.joint is not None and b.joint.prismatic:
                fixed_angle[name] += b.fixed_angle
            if b.joint is None or not b.joint.prismatic or b.joint.name in self.blocks:
                forms[name][name] = 1.0
        return forms, fixed_angle

    def _motors(self) -> dict[str, float]:
        """The coordinates that motors set, each with the sign of what its motor says of it: a joint's position is the
        second body's on the first, whichever of them hangs on the other.
        """
        if self.setting.driven is None:
            crank = "drive:motor" if self.compliant else self.mechanism.driven
            return {crank: 1.0} if self.setting.hold else {}
        return {
            f"{b.body.name}:slide" if j.prismatic else b.body.name: (
                1.0 if j.prismatic or b.body.name == j.bodies[1] else -1.0
            )
            for j, b in self.driven
        }

    def mjcf(self) -> str:
        """The model as MJCF text."""
        m = self.mechanism
        solref, sticking = (
            _numbers(RIGID_TIME_CONSTANT * self.setting.step, 1),
            _numbers(STICKING * self.setting.step, 1),
        )
        integrator = "implicitfast" if self.setting.stepped else "RK4"
        closed = "".join(
            f'<connect name="{j.name}" site1="{j.name}:{j.bodies[1]}" site2="{j.name}:{j.bodies[0]}"/>'
            for j in (*self.closing, *self.soft)
        )
        return f"""<mujoco model={quoteattr(m.name)}>
<compiler angle="radian" inertiafromgeom="false"/>
<option timestep="{self.setting.step!r}" gravity="{_xy(complex(*m.gravity))}" integrator="{integrator}" cone="elliptic"
  impratio="100" jacobian="dense" solver="Newton" tolerance="{SOLVER_TOLERANCE!r}" iterations="30">
  <flag autoreset="disable" island="disable"/></option>
<default><equality solref="{solref}" solimp="{RIGID_IMPEDANCE}"/>
  <tendon solreffriction="{sticking}" solimpfriction="{RIGID_IMPEDANCE}"/></default>
<worldbody>{self._places(GROUND)}{self._children(GROUND)}{self._motor()}</worldbody>
<tendon>{self._links()}{"".join(self._law(j) for j in m.joints)}{self._drive_spring()}{self._springs()}</tendon>
<equality>{closed}{self._bars()}</equality>
<actuator>{"".join(self._load(i) for i, load in enumerate(m.loads) if not load.varies)}{self._course()}</actuator>
</mujoco>"""

    def coordinates(self, pose: Mapping[str, Pose], branches: list[Branch] | None = None) -> dict[str, float]:
        """Value of each MuJoCo joint (rad, m) in a pose."""
        at: dict[str, float] = {}
        everything = {GROUND: AT_REST, **pose}

        def pin(j: Joint, body: str) -> complex:
            return everything[body].origin + complex(np.exp(1j * everything[body].angle)) * self.mechanism.body(
                body
            ).point(j.name)

        for b in self.branches if branches is None else branches:
            name, here = b.body.name, everything[b.body.name]
            if b.joint is None:
                at |= self._afloat(name, here, everything[b.parent])
            elif b.joint.prismatic:
                first, second = (pin(b.joint, n) for n in b.joint.bodies)
                angle = everything[b.joint.bodies[0]].angle
                at[f"{name}:slide"] = float(slide_travel(b.joint, second - first, angle))
                if b.joint.name in self.blocks:
                    at[f"{name}:across"] = float(slide_travel(b.joint, (second - first) * -1j, angle))
                    at[name] = here.angle - everything[b.parent].angle - b.fixed_angle
            else:
                at[name] = here.angle - everything[b.parent].angle
        if self.compliant:
            at["drive:motor"] = everything[self.mechanism.driven].angle
        return at

    @staticmethod
    def _afloat(name: str, here: Pose, parent: Pose) -> dict[str, float]:
        """Coordinates of a body that floats from its parent, mostly the ground, and turns against it."""
        apart = here.origin - parent.origin
        if parent is not AT_REST:
            apart *= complex(np.exp(-1j * parent.angle))
        return {f"{name}:x": apart.real, f"{name}:y": apart.imag, name: here.angle - parent.angle}

    def across(self, j: Joint) -> dict[str, float]:
        """What a joint lets free, second body less first, as a linear form of coordinates: the angle but for a
        constant, or the travel.
        """
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
            f'<body name="{b.body.name}" pos="{_xy((here.origin - parent.origin) * turn)}"'
            f' quat="{_numbers(np.cos(half), 0, 0, np.sin(half))}">'
            f'<inertial pos="{_xy(b.body.centre)}" mass="{b.body.mass!r}"'
            f' diaginertia="{_numbers(inertia, inertia, inertia)}"/>'
            f"{self._freedom(b)}{self._places(b.body.name)}{self._children(b.body.name)}</body>"
        )

    def _freedom(self, b: Branch) -> str:
        name, here, at = b.body.name, self.place[b.body.name], self.coordinates(self.pose, [b])
        slides = {}
        if b.joint is None:
            along = np.exp(1j * (self.place[b.parent].angle - here.angle))
            slides = {f"{name}:x": along, f"{name}:y": 1j * along}
        elif b.joint.prismatic:
            axis = b.joint.direction * np.exp(1j * (self.place[b.joint.bodies[0]].angle - here.angle))
            slides = {f"{name}:slide": axis if b.is_second else -axis}
            if b.joint.name in self.blocks:
                slides[f"{name}:across"] = 1j * slides[f"{name}:slide"]
        text = "".join(
            f'<joint name="{n}" type="slide" axis="{_xy(axis)}" ref="{at[n]!r}"{self._armature(n)}/>'
            for n, axis in slides.items()
        )
        if name not in at:
            return text
        pin = 0j if b.joint is None else b.body.point(b.joint.name)
        guides = b.joint is not None and b.joint.name in self.blocks and not b.is_second
        if b.joint is not None and guides:  # it turns about the block's point, and then slides along its own guide
            pin += b.joint.direction * complex(at[f"{name}:slide"], at[f"{name}:across"])
        hinge = f'<joint name="{name}" type="hinge" axis="0 0 1" pos="{_xy(pin)}" ref="{at[name]!r}"'
        turns = f"{hinge}{self._armature(name)}/>"
        return turns + text if guides else text + turns

    def _armature(self, coordinate: str) -> str:
        return f' armature="{MOTOR_INERTIA!r}"' if coordinate in self.motors else ""

    def _places(self, name: str) -> str:
        """Sites at a body's points and where it is loaded, and a geom at each pin that touches."""
        body = self.mechanism.body(name)
        pins = [j for j in self.mechanism.joints if name in j.bodies]
        text = "".join(f'<site name="{point}:{name}" pos="{_xy(body.point(point))}"/>' for point in body.points)
        loads = {i: _xy(body.point(load.point)) for i, load in enumerate(self.mechanism.loads) if load.body == name}
        text += "".join(f'<site name="load{i}" pos="{at}"/>' for i, at in loads.items())
        text += "".join(
            f'<site name="spring:{i}:{name}" pos="{_xy(body.point(point))}"/>'
            for i, spring in enumerate(self.mechanism.springs)
            for end, point in spring.ends
            if end == name
        )
        text += (
            '<site name="world"/>'
            if name == GROUND
            else f'<site name="marker of {name}" pos="{_xy(body.point("com"))}"/>'
        )
        touching = {
            j.name: _xy(body.point(j.name)) for j in pins if j.name in self.closed_by and self.setting.rows == "contact"
        }
        return text + "".join(
            f'<geom name="{n}:{name}" size="0.01" pos="{at}" contype="0" conaffinity="0"/>'
            for n, at in touching.items()
        )

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
        law = f'stiffness="{self.stiffness!r}" springlength="0"'
        if (flanks := self.setting.flanks) is not None:
            law = f'limited="true" range="{-flanks.half_gap!r} {flanks.half_gap!r}"'
            if flanks.rigid:
                law += (
                    f' solreflimit="{_numbers(flanks.holds / HOLDS, LANDING_DAMPING)}" solimplimit="{RIGID_IMPEDANCE}"'
                )
        return f'<fixed name="drive:spring" {law}>{crank}</fixed>'

    def _links(self) -> str:
        if self.setting.rows == "contact":
            return ""
        limited = self.setting.rows == "spring-damper"
        limit = {
            n: f' limited="true" range="-1 {self.mechanism.joint(n).clearance!r}"' if limited else ""
            for n in self.closed_by
        }
        ends = {n: "".join(f'<site site="{n}:{b}"/>' for b in self.mechanism.joint(n).bodies) for n in self.closed_by}
        return "".join(f'<spatial name="{n}"{limit[n]}>{ends[n]}</spatial>' for n in self.closed_by)

    def _bars(self) -> str:
        if self.setting.rows not in ("massless-link", "spring"):
            return ""
        return "".join(f'<tendon name="{n}" tendon1="{n}"/>' for n in self.closed_by)

    def _springs(self) -> str:
        """Spatial tendon of each spring between points."""
        text = ""
        for i, spring in enumerate(self.mechanism.springs):
            law = f'stiffness="{spring.stiffness!r}" damping="{spring.damping!r}" springlength="{spring.length!r}"'
            ends = "".join(f'<site site="spring:{i}:{body}"/>' for body in spring.bodies)
            text += f'<spatial name="spring:{i}" {law}>{ends}</spatial>'
        return text

    def _law(self, j: Joint) -> str:
        """Fixed tendon of a joint's friction, damping and spring."""
        if not self.gives(j):
            return ""
        terms = "".join(f'<joint joint="{n}" coef="{c!r}"/>' for n, c in self.across(j).items() if c)
        loss = f' frictionloss="{j.stiction or float(j.rubs)!r}"' if self.setting.friction else ""
        return f'<fixed name="law:{j.name}" stiffness="{j.stiffness!r}" damping="{j.damping!r}"{loss}>{terms}</fixed>'

    def gives(self, j: Joint) -> bool:
        """Whether a joint has friction, damping or a spring, and moves: slides may keep its bodies from turning against
        each other.
        """
        return j.has_law and any(self.across(j).values())

    def _load(self, i: int) -> str:
        load = self.mechanism.loads[i]
        gear = _numbers(*load.force, 0, 0, 0, load.torque)
        return (
            f'<general name="load{i}" site="load{i}" refsite="world" gear="{gear}" biastype="affine" biasprm="1 0 0"/>'
        )

    def _course(self) -> str:
        """Actuator of each motor that follows a course."""
        return "".join(
            f'<general name="drive:course{k or ""}" joint="{joint}" dyntype="integrator" gainprm="{MOTOR_INERTIA!r}"/>'
            for k, joint in enumerate(self.motors)
            if self.setting.follows
        )
