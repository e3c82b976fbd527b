"""DART (dartpy 6.20): generalised coordinates on a spanning tree, the remaining pins closed by DART's own constraints.

Joints with clearance close nothing: their two pins are free, and a spring-damper or DART's contact solver keeps them
together.  Prismatic joints and those with motors are always in the tree; where a motor's own pin has clearance, its
body floats in the frame of the other one.  Notes on what DART does silently:

* ``getWrenchToChildBodyNode`` and the constraint forces belong to the positions *before* the step, in that child's
  frame;
* ``getConstraintForces`` forgets every tree of a skeleton but its first, so each tree is a skeleton of its own;
* a world puts slow bodies to sleep unless its deactivation options are switched off;
* contact shapes have a friction coefficient of 1 unless told otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic.mechanism import GROUND, Joint
from sim_models.common.start import Pose
from sim_models.common.tree import Branch
from sim_models.dart.contact import REBOUND, SHAPE_SPACING, Bearing, plane, rebound, vector
from sim_models.engine import Request, SettingValue
from sim_models.leapfrog.bodies import LeapfrogWorld
from sim_models.leapfrog.parts import coordinates, moving_body
from sim_models.run.path import Path, assembled

if TYPE_CHECKING:
    from dartpy.math import Isometry3

DRIFT_REMOVED = 1.0  # share of a closing pin's drift that DART removes in a step: all, so that no transient lingers
SETTLING_STEPS = 3  # steps in which a loop that was closed without drift gets the drift that belongs to its motion
DRIVE_STUB_MASS = (
    1e-12  # kg, kg.m^2: the body between a drive's two joints where the driven body's own pin has clearance
)


def placed(dart: ModuleType, at: complex, angle: float = 0.0) -> Isometry3:
    """A DART transform: turned by ``angle`` (rad) about z, then moved to ``at`` (m)."""
    c, s = np.cos(angle), np.sin(angle)
    frame = dart.math.Isometry3()
    frame.set_rotation([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    frame.set_translation(vector(at))
    return frame


class DartWorld(LeapfrogWorld):
    """A linkage as DART skeletons, one for each tree that stands on the ground."""

    engine = "dart"

    def __init__(self, request: Request, path: Path) -> None:
        super().__init__(request, path)
        self.balances = not self.crank
        self.settling = SETTLING_STEPS if request.joint_model == "ideal" else 1
        import dartpy as dart

        self.dart = dart
        self.world = dart.simulation.World()
        sleep = self.world.getDeactivationOptions()
        sleep.mEnabled = False
        self.world.setDeactivationOptions(sleep)
        self.world.setGravity([*self.mechanism.gravity, 0.0])
        self.skeletons: list[Any] = []
        self.nodes: dict[str, Any] = {}
        self.roots: dict[str, Any] = {}  # DART joints by the body they carry
        self.carriages: dict[str, Any] = {}  # those that carry a driven body whose own pin has clearance
        self.closing = self.hang(self.closed)
        for branch in self.branches:
            if branch.joint is not None:
                self._hang(branch, branch.joint)
            else:
                self._float(branch.child, branch.parent)
        for skeleton in self.skeletons:
            self.world.addSkeleton(skeleton)
        self.hold(self.held)
        self.bearings: dict[str, Bearing] = {}
        self.frames = {
            j.name: [self._frame(b, j.name) for b in j.bodies] for j in self.mechanism.joints if not j.prismatic
        }
        self._close()
        self.world.setCollisionDetector(dart.collision.DARTCollisionDetector())
        for skeleton in self.skeletons:
            skeleton.enableSelfCollisionCheck()
            skeleton.enableAdjacentBodyCheck()
        if request.joint_model == "contact":
            self.bearings = {name: self._bearing(name, SHAPE_SPACING * k) for k, name in enumerate(self.pins, 1)}
        if self.held and self.crank:
            driven = self.mechanism.driven
            alone = self.nodes[driven].getSkeleton().getNumDofs() == 1
            self.closes_driven = any(driven in joint.bodies for joint in self.closing)
            bears = any(driven in self.mechanism.joint(name).bodies for name in self.bearings)
            self.looks_back = alone and (self.closes_driven or bears)  # see _forgotten

    def settings(self) -> dict[str, SettingValue]:
        if not self.bearings:
            return super().settings()
        bounce = {name: bearing.restitution for name, bearing in self.bearings.items()}
        slowest = {name: REBOUND / share for name, share in bounce.items() if share and not self.static}
        law: dict[str, SettingValue] = {"contact_law": "rigid, Newton's restitution", "restitution": bounce}
        return law | ({"minimum_impact_speed": slowest} if slowest else {})

    # ---------------------------------------------------------------- building

    def _hang(self, branch: Branch, joint: Joint) -> None:
        """Hang a body on its parent by a tree joint whose DART coordinate is the child's angle, or the travel."""
        D, m = self.dart.dynamics, self.mechanism
        skeleton = self._new_skeleton() if branch.parent == GROUND else self.nodes[branch.parent].getSkeleton()
        if joint.prismatic:
            properties, create = D.PrismaticJointProperties(), skeleton.createPrismaticJointAndBodyNodePair
            properties.mAxis = vector(branch.axis)
        else:
            properties, create = D.RevoluteJointProperties(), skeleton.createRevoluteJointAndBodyNodePair
            properties.mAxis = np.array([0.0, 0.0, 1.0])
        properties.mT_ParentBodyToJoint = placed(self.dart, m.body(branch.parent).point(joint.name), branch.fixed_angle)
        properties.mT_ChildBodyToJoint = placed(self.dart, m.body(branch.child).point(joint.name))
        self._keep(branch.child, *create(self.nodes.get(branch.parent), properties))

    def _float(self, body: str, parent: str) -> None:
        """Give a body that no ideal joint ties to its parent its three freedoms; a driven one turns by its motor."""
        D, base = self.dart.dynamics, self.nodes.get(parent)
        skeleton = self._new_skeleton() if base is None else base.getSkeleton()
        if all(body != each.child for each in self.steered):
            self._keep(body, *skeleton.createPlanarJointAndBodyNodePair(None, D.PlanarJointProperties()))
            return
        self.carriages[body], between = skeleton.createTranslationalJoint2DAndBodyNodePair(
            base, D.TranslationalJoint2DProperties()
        )
        between.setInertia(D.Inertia(DRIVE_STUB_MASS, np.zeros(3), DRIVE_STUB_MASS * np.eye(3)))
        properties = D.RevoluteJointProperties()
        properties.mAxis = np.array([0.0, 0.0, 1.0])
        self._keep(body, *skeleton.createRevoluteJointAndBodyNodePair(between, properties))

    def _new_skeleton(self) -> Any:
        self.skeletons.append(self.dart.dynamics.Skeleton(f"tree {len(self.skeletons)}"))
        return self.skeletons[-1]

    def _keep(self, name: str, dart_joint: Any, node: Any) -> None:
        body = moving_body(self.mechanism, name)
        size = body.moment_of_inertia
        node.setInertia(self.dart.dynamics.Inertia(body.mass, vector(body.centre), np.diag([size, size, size])))
        self.nodes[name], self.roots[name] = node, dart_joint

    def _bearing(self, name: str, level: float) -> Bearing:
        pin = self.pins[name]
        first, second = (self.nodes[body] if body != GROUND else self._stand() for body in pin.joint.bodies)
        at, beside = (self.points[body, name] for body in pin.joint.bodies)
        bounce = rebound(self.mechanism, pin)
        return Bearing(self.dart.dynamics, pin, bounce, (first, second), (at, beside), level)

    def _stand(self) -> Any:
        """The ground as a DART body, for contact shapes."""
        ground = self.dart.dynamics.Skeleton("ground")
        _, node = ground.createWeldJointAndBodyNodePair()
        ground.setMobile(False)
        self.world.addSkeleton(ground)
        return node

    def _frame(self, body: str, point: str) -> Any:
        at = placed(self.dart, self.points[body, point])
        frame = self.nodes[body] if body != GROUND else self.dart.dynamics.Frame.World()
        return self.dart.dynamics.SimpleFrame(frame, f"{body} at {point}", at)

    def _close(self) -> None:
        """Tie the remaining pins, with the linkage assembled: DART takes their places from where the bodies are."""
        constraint = self.dart.constraint
        self.place(assembled(self.path.assembly))
        for joint in self.closing:
            at = self.frames[joint.name][0].getTransform().translation()
            nodes = [self.nodes[name] for name in joint.bodies if name != GROUND]
            pin = constraint.BallJointConstraint(*nodes, at)
            pin.setErrorReductionParameter(DRIFT_REMOVED)
            self.world.getConstraintSolver().addConstraint(pin)

    # ---------------------------------------------------------------- state

    def place(self, bodies: Mapping[str, Pose]) -> None:
        for branch in self.branches:
            positions, velocities = coordinates(self.mechanism, branch, bodies)
            if branch.child in self.carriages:
                self.carriages[branch.child].setPositions(positions[:2])
                self.carriages[branch.child].setVelocities(velocities[:2])
                positions, velocities = positions[2:], velocities[2:]
            self.roots[branch.child].setPositions(positions)
            self.roots[branch.child].setVelocities(velocities)
            for k, each in enumerate(self.steered):
                if each.child == branch.child:
                    self.commands[k] = velocities[-1]
        for name, bearing in self.bearings.items():
            bearing.arrive(self.gap(name)[0])

    def pose(self, body: str) -> Pose:
        node = self.nodes[body]
        return Pose(
            plane(node.getTransform().translation()),
            self.angle(body),
            plane(node.getLinearVelocity()),
            float(node.getAngularVelocity()[2]),
        )

    def angle(self, body: str) -> float:
        """A body's angle (rad), summed along the tree and so never wrapped."""
        angle = 0.0
        while body != GROUND:
            branch, root = self.branch[body], self.roots[body]
            angle += (
                branch.fixed_angle
                if branch.joint is not None and branch.joint.prismatic
                else root.getPosition(root.getNumDofs() - 1)
            )
            body = branch.parent
        return angle

    def coordinate(self, body: str) -> float:
        root = self.roots[body]
        return float(root.getPosition(root.getNumDofs() - 1))

    def gap(self, joint: str) -> tuple[complex, complex]:
        first, second = self.frames[joint]
        gap = first.getTransform().translation() - second.getTransform().translation()
        rate = first.getLinearVelocity() - second.getLinearVelocity()
        return plane(gap), plane(rate)

    def positions(self) -> np.ndarray:
        return np.concatenate([skeleton.getPositions() for skeleton in self.skeletons])

    def columns(self, body: str) -> list[int]:
        root = self.roots[body]
        tree = self.skeletons.index(root.getSkeleton())
        before = sum(skeleton.getNumDofs() for skeleton in self.skeletons[:tree])
        parts = [self.carriages[body], root] if body in self.carriages else [root]
        return [before + part.getIndexInSkeleton(k) for part in parts for k in range(part.getNumDofs())]

    def velocities(self) -> np.ndarray:
        return np.concatenate([skeleton.getVelocities() for skeleton in self.skeletons])

    def set_velocities(self, velocities: np.ndarray) -> None:
        for skeleton, part in zip(self.skeletons, self._parts(velocities), strict=True):
            skeleton.setVelocities(part)

    def shift(self, change: np.ndarray) -> None:
        for skeleton, part in zip(self.skeletons, self._parts(change), strict=True):
            skeleton.setPositions(skeleton.getPositions() + part)

    def _parts(self, values: np.ndarray) -> list[np.ndarray]:
        """Values (..., n) of all freedoms, tree by tree."""
        return np.split(values, np.cumsum([skeleton.getNumDofs() for skeleton in self.skeletons])[:-1], axis=-1)

    # ---------------------------------------------------------------- forces

    def press(self, body: str, point: complex, force: complex) -> None:
        self.nodes[body].addExtForce(vector(force), vector(point), False, True)

    def twist(self, body: str, torque: float) -> None:
        self.nodes[body].addExtTorque([0.0, 0.0, torque], False)

    def hold(self, held: bool) -> None:
        self.held = held
        for each in self.steered:
            root = self.roots[each.child]
            root.setActuatorType(self.dart.dynamics.VELOCITY if held else self.dart.dynamics.FORCE)
            root.setCommand(0, 0.0)

    def advance(self, h: float) -> None:
        if h != self.world.getTimeStep():
            self.world.setTimeStep(h)
        if self.held:
            for each, command in zip(self.steered, self.commands, strict=True):
                self.roots[each.child].setCommand(0, command)
        for name, bearing in self.bearings.items():
            lifted = bearing.lifted(self.gap(name)[0])
            if lifted:
                self.nudge(self.pins[name].joint, lifted)
        for name, bearing in self.bearings.items():
            self.pin_gaps[name] = self.gap(name)[0]
            bearing.face(self.pin_gaps[name])
        self.take_note(h)
        self.world.step(True)
        for name, bearing in self.bearings.items():
            self.pin_forces[name] = bearing.force(self.world.getLastCollisionResult().getContacts())

    def reactions(self) -> tuple[dict[str, complex], dict[str, float], dict[str, float]]:
        closing = self._closing_forces()
        if self.balances:
            return self.balanced(self.pin_forces | closing, {*closing, *self.bearings})
        forces = dict(self.pin_forces) | closing
        moments: dict[str, float] = {}
        torque = 0.0
        for name, joint in ((branch.child, branch.joint) for branch in self.branches):
            wrench = -self.roots[name].getWrenchToChildBodyNode()  # on the child, in its frame, about its pin
            force, moment = complex(wrench[3], wrench[4]) * np.exp(1j * self.before[name].angle), float(wrench[2])
            if name == self.mechanism.driven:
                missing = self._forgotten(forces)
                force, moment = force - missing[0], moment - missing[1]
                torque = moment
            if joint is None:
                continue
            if name == joint.bodies[0]:  # the second body takes the opposite, at its own point
                force = -force
                slip = self._place(joint.bodies[1], joint.name) - self._place(name, joint.name)
                moment = -moment - (np.conj(slip) * force).imag
            forces[joint.name] = force
            if joint.prismatic:
                moments[joint.name] = moment
        return forces, moments, {self.mechanism.drive_joint.name: torque} if self.held else {}

    def effort(self) -> float:
        moment = -float(self.roots[self.mechanism.driven].getWrenchToChildBodyNode()[2])
        if not self.looks_back:
            return moment
        closing = self._closing_forces() if self.closes_driven else {}
        return moment - self._forgotten(self.pin_forces | closing)[1]

    def _closing_forces(self) -> dict[str, complex]:
        """Forces of the pins that close loops, from the generalised forces that DART's constraints exerted."""
        if not self.closing:
            return {}
        generalised = np.concatenate([skeleton.getConstraintForces() for skeleton in self.skeletons])
        for name in self.bearings:
            force = self.pin_forces[name]
            generalised -= self.pin_jacobian(self.mechanism.joint(name), self.before).T @ [force.real, force.imag]
        rows = np.vstack([self.pin_jacobian(joint, self.before) for joint in self.closing])
        solved = np.linalg.lstsq(rows.T, generalised, rcond=None)[0]
        return {joint.name: complex(solved[2 * k], solved[2 * k + 1]) for k, joint in enumerate(self.closing)}

    def _forgotten(self, forces: Mapping[str, complex]) -> tuple[complex, float]:
        """Force, and moment about its pin, of DART's constraints on a driven body that nothing hangs on.

        DART passes constraint forces on only in skeletons that have a freedom of their own.
        """
        driven, pivot = self.mechanism.driven, self.mechanism.drive_joint.name
        if not self.held or self.nodes[driven].getSkeleton().getNumDofs() > 1:
            return 0j, 0.0
        total, moment = 0j, 0.0
        for joint in self.mechanism.joints:
            if driven in joint.bodies and (joint in self.closing or joint.name in self.bearings):
                force = forces[joint.name] if joint.bodies[1] == driven else -forces[joint.name]
                total += force
                moment += (np.conj(self._place(driven, joint.name) - self._place(driven, pivot)) * force).imag
        return total, moment

    def _place(self, body: str, point: str) -> complex:
        """Place (m) of a body's point before the step."""
        at = self.points[body, point]
        return at if body == GROUND else self.before[body].origin + at * np.exp(1j * self.before[body].angle)

    def nudge(self, joint: Joint, change: complex) -> None:
        """Move the linkage, what is driven apart, as little as changes a joint's gap by this much (m) and opens no
        loop.
        """
        turned = {body.name: Pose(0j, self.angle(body.name)) for body in self.mechanism.bodies}
        x, y = -self.pin_jacobian(joint, turned)
        rows = np.vstack([x * change.real + y * change.imag, *(self.pin_jacobian(j, turned) for j in self.closing)])
        for root in (self.roots[each.child] for each in self.steered if self.held):
            skeleton = self.skeletons.index(root.getSkeleton())
            self._parts(rows)[skeleton][..., root.getIndexInSkeleton(0)] = 0.0
        row, closed = rows[0], rows[1:]
        if self.closing:
            row = row - closed.T @ np.linalg.lstsq(closed.T, row, rcond=None)[0]
        self.shift(row * abs(change) ** 2 / (row @ row))

    def pin_jacobian(self, j: Joint, turned: Mapping[str, Pose]) -> np.ndarray:
        """(2, n): velocity of a joint's second pin minus the first's, by DART's velocities.

        Each body's share is turned from the body to the ground as it was in ``turned``: with poses before the step, the
        transpose is what a force of that instant does, as DART reckons it after the bodies have carried it along.
        """
        total = np.zeros((2, sum(skeleton.getNumDofs() for skeleton in self.skeletons)))
        for sign, body in zip((-1, 1), j.bodies, strict=True):
            if body != GROUND:
                node, at = self.nodes[body], vector(self.points[body, j.name])
                skeleton = node.getSkeleton()
                x, y, _ = skeleton.getLinearJacobian(node, at, node)
                share = sign * (x + 1j * y) * np.exp(1j * turned[body].angle)
                self._parts(total)[self.skeletons.index(skeleton)][:] += [share.real, share.imag]
        return total
