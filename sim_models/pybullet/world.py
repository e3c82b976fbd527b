"""PyBullet (3.2.7): every body a multibody of its own joints, every pin between bodies one of Bullet's point
constraints.

A body with a joint on the ground, a slide, or a joint with a motor has that joint's coordinate; any other floats on two
slides and a hinge, so that all motion stays in the plane.  Clearance joints are a spring-damper, or in static motion a
weightless strut between the pins: of the clearance's length (massless link), or free to be shorter (contact).
Contact's pins rest where those rods do, if all of them pull; and where Bullet does not hold the one-sided struts there,
it is the rods that are read.  What PyBullet does silently:

* ``changeDynamics(localInertiaDiagonal=...)`` is dropped when it comes with damping or maxJointVelocity in one call;
* joints start with a damping and a velocity motor, and speeds are clamped;
* a force in WORLD_FRAME takes its arm from where the link was a step ago, unless its kinematics are asked for anew;
* ``getConstraintState`` belongs to the positions *before* the step, and joint force sensors are wrong in longer chains,
  so forces in the multibodies' own joints follow from each body's balance with Bullet's accelerations.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE
from sim_models.common.contact_laws import lighter_mass, longest
from sim_models.common.start import AT_REST, Pose
from sim_models.common.tree import Branch
from sim_models.engine import Cause, Request, SettingValue, SimulationError
from sim_models.leapfrog.bodies import LeapfrogWorld
from sim_models.leapfrog.parts import coordinates, moving_body
from sim_models.pybullet.parts import HINGE, Planned, Strut, Tie, TreeLink, carried, flat, floating, strut_links
from sim_models.run.path import Path

SOLVER_ITERATIONS = 200  # of the direct solver, at most; a residual of 1e-20 ends them sooner
SWEEPS = 5000  # of the sequential solver, always: a small residual once ended it, 16 % short of the force
SOFTNESS = 1e-10  # Bullet's globalCFM: enough to keep its direct solver regular
JOINT_ERROR_REDUCTION = (
    1.0  # share of a pin's drift that Bullet removes in a step where it moves: all, so that no transient lingers
)
STRENGTH = 1e12  # N, N.m: what pins and the motor can take
NO_SPEED_LIMIT = 1e9  # rad/s, m/s: in place of Bullet's clamp
SETTLING_STEPS = 3  # steps in which the direct solver's softness and what it undoes in the next step die away


class BulletWorld(LeapfrogWorld):
    """A linkage in a PyBullet client of its own."""

    engine = "pybullet"
    balances = True

    def __init__(self, request: Request, path: Path) -> None:
        super().__init__(request, path)
        import pybullet

        self.p = pybullet
        self.client = pybullet.connect(pybullet.DIRECT)
        self.one_sided = request.joint_model == "contact" and bool(self.pins)
        direct = (
            request.joint_model != "contact"
        )  # Bullet's direct solver fails with three one-sided limits, the sequential one with some four
        solver = pybullet.CONSTRAINT_SOLVER_LCP_DANTZIG if direct else pybullet.CONSTRAINT_SOLVER_LCP_SI
        effort = {
            "numSolverIterations": SOLVER_ITERATIONS if direct else SWEEPS,
            "solverResidualThreshold": 1e-20 if direct else 0.0,
        }
        rigidity = {"globalCFM": SOFTNESS, "erp": 0.0 if self.static else JOINT_ERROR_REDUCTION, "contactERP": 0.0}
        self.physics = {"numSubSteps": 0, "constraintSolverType": solver, **effort, **rigidity}
        self.p.setPhysicsEngineParameter(**self.physics, physicsClientId=self.client)
        m = self.mechanism
        self.p.setGravity(*m.gravity, 0.0, physicsClientId=self.client)
        ideal = self.closed
        trunk = [j for j in ideal if j.prismatic or GROUND in j.bodies or j.name in request.schedule.drives]
        rest = self.hang(trunk)
        self.multibodies: list[int] = []
        self.freedoms: list[tuple[int, int]] = []  # Bullet's joints, body and link
        self.own: dict[str, list[int]] = {}  # numbers of the freedoms of each body and strut
        self.links = {GROUND: TreeLink(-1, -1)}
        self._plant()
        self.ties = {j.name: self._tie(j.name, *j.bodies) for j in ideal if j in rest or j not in trunk}
        self.struts = {
            name: self._strut(name) for name in self.pins if request.joint_model in ("massless-link", "contact")
        }
        self.step_size = 0.0
        self.commanded: list[float] = []  # rad/s, m/s, what the motors were last told
        self.settling = 1 if self.compliant else SETTLING_STEPS
        self.poses: dict[str, Pose] = {}
        self.state: tuple[list[float], list[float]] | None = None

    def close(self) -> None:
        self.p.disconnect(physicsClientId=self.client)

    def settings(self) -> dict[str, SettingValue]:
        laws = {
            "contact": "rigid, one-sided limit of a strut",
            "massless-link": "rigid, a strut of the clearance's length",
        }
        return {"contact_law": laws[self.request.joint_model]} if self.struts else super().settings()

    # ---------------------------------------------------------------- building

    def _plant(self) -> None:
        """One multibody for each tree that stands on the ground."""
        children: dict[str, list[Branch]] = {}
        for branch in self.branches:
            children.setdefault(branch.parent, []).append(branch)
        for trunk in children[GROUND]:
            grown, waiting = [], [(trunk, -1)]
            links: list[Planned] = []
            while waiting:
                branch, parent = waiting.pop(0)
                grown.append((branch, len(links)))
                links += self._links_of(branch, parent, len(links))
                waiting += [(twig, len(links) - 1) for twig in children.get(branch.child, [])]
            number = self.grow(links)
            for branch, first in grown:
                last = first + (2 if branch.joint is None else 0)
                self.links[branch.child] = TreeLink(number, last, self.points[branch.child, MASS_CENTRE])
                self.own[branch.child] = [self.freedoms.index((number, k)) for k in range(first, last + 1)]

    def _links_of(self, branch: Branch, parent: int, number: int) -> list[Planned]:
        """Links of a body on a ``parent`` link, the first of which gets this ``number``."""
        m, joint = self.mechanism, branch.joint
        body = moving_body(m, branch.child)
        mass, inertia = body.mass, body.moment_of_inertia
        if self.static and any(branch.child in block.joint.bodies for block in self.blocks.values()):
            inertia = inertia or mass * longest(m) ** 2  # plays no part at rest, but Bullet wants one
        root = self.branch[branch.parent].joint if branch.parent != GROUND else None
        # Bullet's frame of the parent sits at the parent's own joint
        corner = 0j if root is None else m.body(branch.parent).point(root.name)
        if joint is None:
            return floating(parent, number, body.centre, mass, inertia, -corner)
        at = m.body(branch.parent).point(joint.name) - corner
        axis = (branch.axis.real, branch.axis.imag, 0.0) if joint.prismatic else HINGE
        com = body.centre - body.point(joint.name)
        return [Planned(mass, inertia, parent, joint.prismatic, axis, at, branch.fixed_angle, com)]

    def grow(self, links: list[Planned]) -> int:
        """Make a multibody on a fixed base; returns its number.  Its joints are appended to the freedoms."""
        p = self.p
        number = self.p.createMultiBody(
            baseMass=0,
            linkMasses=[k.mass for k in links],
            linkCollisionShapeIndices=[-1] * len(links),
            linkVisualShapeIndices=[-1] * len(links),
            linkPositions=[flat(k.at) for k in links],
            linkOrientations=[p.getQuaternionFromEuler([0, 0, k.fixed_angle]) for k in links],
            linkInertialFramePositions=[flat(k.com) for k in links],
            linkInertialFrameOrientations=[[0, 0, 0, 1]] * len(links),
            linkParentIndices=[k.parent + 1 for k in links],
            linkJointAxis=[k.axis for k in links],
            linkJointTypes=[p.JOINT_PRISMATIC if k.slides else p.JOINT_REVOLUTE for k in links],
            physicsClientId=self.client,
        )
        for index, link in enumerate(links):
            self.p.changeDynamics(
                number, index, linearDamping=0, angularDamping=0, jointDamping=0, physicsClientId=self.client
            )
            self.p.changeDynamics(number, index, maxJointVelocity=NO_SPEED_LIMIT, physicsClientId=self.client)
            self.p.changeDynamics(
                number, index, localInertiaDiagonal=[link.inertia] * 3, physicsClientId=self.client
            )  # alone, or it is dropped
            self.p.setJointMotorControl2(number, index, p.VELOCITY_CONTROL, force=0, physicsClientId=self.client)
            kept = self.p.getDynamicsInfo(number, index, physicsClientId=self.client)[2][2]
            if not np.isclose(kept, link.inertia, rtol=1e-12, atol=0):
                raise SimulationError(
                    f"pybullet: a link's moment of inertia is {kept:g} kg.m^2 where {link.inertia:g} kg.m^2 was set",
                    Cause.FAULTY,
                )
            self.freedoms.append((number, index))
        self.multibodies.append(number)
        return number

    def _tie(self, point: str, first: str, second: str) -> Tie:
        """Hold a point of two bodies together."""
        at = [self.points[name, point] for name in (first, second)]
        return self.tie(self.links[first], at[0], self.links[second], at[1])

    def tie(self, first: TreeLink, p: complex, second: TreeLink, q: complex) -> Tie:
        """Hold point p of one link and point q of another together."""
        sign = 1
        if first.body < 0:
            first, p, second, q, sign = second, q, first, p, -1
        p, q = p - first.centre, q - second.centre
        number = self.p.createConstraint(
            first.body,
            first.index,
            second.body,
            second.index,
            self.p.JOINT_POINT2POINT,
            [0, 0, 0],
            flat(p),
            flat(q),
            physicsClientId=self.client,
        )
        self.p.changeConstraint(number, maxForce=STRENGTH, physicsClientId=self.client)
        return Tie(number, sign)

    def _strut(self, name: str) -> Strut:
        """Put a strut between a joint's pins."""
        pin = self.pins[name]
        mass = lighter_mass(self.mechanism, pin.joint)
        links, tip = strut_links(pin, mass, self.one_sided)
        begin = len(self.freedoms)
        number = self.grow(links)
        if links[-1].limits is not None:
            lower, upper = links[-1].limits
            self.p.changeDynamics(number, 3, jointLowerLimit=lower, jointUpperLimit=upper, physicsClientId=self.client)
        first, second = pin.joint.bodies
        at, beside = (self.points[body, name] for body in (first, second))
        self.tie(self.links[first], at, TreeLink(number, 2), 0j)
        tie = self.tie(TreeLink(number, len(links) - 1), tip, self.links[second], beside)
        own = list(range(begin, len(self.freedoms)))
        return Strut(pin, (at, beside), mass, number, len(links), own, tie)

    # ---------------------------------------------------------------- state

    def place(self, bodies: Mapping[str, Pose]) -> None:
        positions, velocities = np.zeros(len(self.freedoms)), np.zeros(len(self.freedoms))
        for branch in self.branches:
            own = self.own[branch.child]
            positions[own], velocities[own] = coordinates(self.mechanism, branch, bodies)
        for strut in self.struts.values():
            positions[strut.own], velocities[strut.own] = strut.coordinates(bodies)
        self._reset(positions, velocities)
        self.commands = [float(velocities[self.own[each.child][-1]]) for each in self.steered]
        if self.held:
            self._run_motors()

    def hold(self, held: bool) -> None:
        self.held = held
        self._run_motors()

    def _run_motors(self) -> None:
        for each, command in zip(self.steered, self.commands, strict=True):
            body, index = self.freedoms[self.own[each.child][-1]]
            self.p.setJointMotorControl2(
                body,
                index,
                self.p.VELOCITY_CONTROL,
                targetVelocity=command,
                force=STRENGTH if self.held else 0.0,
                physicsClientId=self.client,
            )
        self.commanded = list(self.commands)

    def _reset(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        for (body, index), q, v in zip(self.freedoms, positions.tolist(), velocities.tolist(), strict=True):
            self.p.resetJointState(body, index, q, v, self.client)
        self.state = None

    def _read(self) -> tuple[list[float], list[float]]:
        """Positions and velocities of all freedoms."""
        if self.state is None:
            states = [self.p.getJointState(body, index, self.client) for body, index in self.freedoms]
            self.state = [s[0] for s in states], [s[1] for s in states]
            self.poses = {GROUND: AT_REST}
        return self.state

    def positions(self) -> np.ndarray:
        return np.array(self._read()[0])

    def columns(self, body: str) -> list[int]:
        return self.own[body]

    def velocities(self) -> np.ndarray:
        return np.array(self._read()[1])

    def set_velocities(self, velocities: np.ndarray) -> None:
        self._reset(np.array(self._read()[0]), velocities)

    def shift(self, change: np.ndarray) -> None:
        positions, velocities = self._read()
        self._reset(np.array(positions) + change, np.array(velocities))

    def pose(self, body: str) -> Pose:
        positions, velocities = self._read()  # first: it forgets poses that are out of date
        if body not in self.poses:
            own = self.own[body]
            self.poses[body] = self._pose(self.branch[body], [positions[i] for i in own], [velocities[i] for i in own])
        return self.poses[body]

    def _pose(self, branch: Branch, q: list[float], v: list[float]) -> Pose:
        """A body's pose from its coordinates and its parent's pose."""
        if branch.joint is None:
            own = Pose(complex(q[0], q[1]), q[2], complex(v[0], v[1]), v[2])
            return own if branch.parent == GROUND else carried(self.pose(branch.parent), own)
        base = self.pose(branch.parent)
        name = branch.joint.name
        slides = branch.joint.prismatic
        angle, spin = (
            (base.angle + branch.fixed_angle, base.angular_velocity)
            if slides
            else (base.angle + q[0], base.angular_velocity + v[0])
        )
        e = cmath.exp(1j * angle)
        arm = self.points[branch.parent, name] * cmath.exp(1j * base.angle)
        along = e * branch.axis if slides else 0j
        arm += along * q[0]
        hold = self.points[branch.child, name] * e
        velocity = base.velocity + 1j * base.angular_velocity * arm + along * v[0] - 1j * spin * hold
        return Pose(base.origin + arm - hold, angle, velocity, spin)

    def coordinate(self, body: str) -> float:
        return self._read()[0][self.own[body][-1]]

    def gap(self, joint: str) -> tuple[complex, complex]:
        ends = []
        for body in self.mechanism.joint(joint).bodies:
            pose = self.pose(body)
            arm = self.points[body, joint] * cmath.exp(1j * pose.angle)
            ends.append((pose.origin + arm, pose.velocity + 1j * pose.angular_velocity * arm))
        return ends[0][0] - ends[1][0], ends[0][1] - ends[1][1]

    # ---------------------------------------------------------------- forces

    def press(self, body: str, point: complex, force: complex) -> None:
        pose, link = self.pose(body), self.links[body]
        at = pose.origin + point * cmath.exp(1j * pose.angle)
        self.p.applyExternalForce(
            link.body,
            link.index,
            (force.real, force.imag, 0.0),
            (at.real, at.imag, 0.0),
            self.p.WORLD_FRAME,
            self.client,
        )

    def twist(self, body: str, torque: float) -> None:
        link = self.links[body]
        self.p.applyExternalTorque(link.body, link.index, (0.0, 0.0, torque), self.p.WORLD_FRAME, self.client)

    def advance(self, h: float) -> None:
        if h != self.step_size:
            self.p.setTimeStep(h, physicsClientId=self.client)
            self.step_size = h
        if self.held and self.commands != self.commanded:
            self._run_motors()
        for strut in self.struts.values():
            self._bear_up(strut)
        self.take_note(h)
        self.p.stepSimulation(self.client)
        for number in self.multibodies:
            self.p.getLinkState(
                number, 0, False, True, self.client
            )  # moves the frames that forces are applied in to the new positions
        self.state = None
        for name, strut in self.struts.items():
            self.pin_forces[name] = self.tension(strut.tie)

    def _bear_up(self, strut: Strut) -> None:
        """Carry a strut's own weight during the next step."""
        weight = strut.mass * complex(*self.mechanism.gravity)
        for part in range(2, strut.parts) if weight else ():
            at = self.p.getLinkState(strut.number, part, computeForwardKinematics=True, physicsClientId=self.client)[0]
            self.p.applyExternalForce(
                strut.number, part, flat(-weight), at, self.p.WORLD_FRAME, physicsClientId=self.client
            )

    def effort(self) -> float:
        body, index = self.freedoms[self.own[self.mechanism.driven][-1]]
        return float(self.p.getJointState(body, index, self.client)[3])

    def tension(self, tie: Tie) -> complex:
        """Force (N) of a tie on its second body in the last step."""
        x, y, *_ = self.p.getConstraintState(tie.number, self.client)
        return tie.sign * complex(x, y)

    def reactions(self) -> tuple[dict[str, complex], dict[str, float], dict[str, float]]:
        forces = self.pin_forces | {name: self.tension(tie) for name, tie in self.ties.items()}
        return self.balanced(forces, {*self.ties, *self.struts})  # a spring-damper's force was applied
