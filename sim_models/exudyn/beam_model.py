"""A linkage of beams as an Exudyn system whose reference configuration is undeformed, and its static equilibrium."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Body, Joint, Mechanism, Spring
from analytic.mechanism.bars import division
from analytic.mechanism.signals import turned_near
from sim_models.common.start import AT_REST, Pose
from sim_models.common.travel import travel
from sim_models.engine import Unsupported
from sim_models.exudyn.linkage import DIFFERENCES
from sim_models.exudyn.settings import static_settings

SPAN_ELEMENTS = 4  # between two neighbouring points of a link; one is exact already for small displacements
ROUNDING_OF_BEAMS = (
    3e-16  # m: what a position of this size is rounded to, so that a spring's force wavers by it times its stiffness
)
STIFFEST_PIN = 1e10  # N/m of a contact, at most: Exudyn differentiates it numerically, and Newton's method fails beyond
SOFT_DEPTH = 0.1  # of the clearance, to which a pin is pressed into a bearing that is soft at first
STIFFENING = 0.25  # of the way from soft to stiff bearings, one solution after the other; halved where there is none
SMALLEST_STIFFENING = 1 / 64
ARM = 1e-12  # of a link's length: a point that is nearer to its bar is on it

Push = tuple[str, str, complex, float]  # body, point, force (N) and torque (N.m)


@dataclass(frozen=True)
class Loads:
    """What acts on a linkage of beams, where the rigid one is: ``pushes``, and by joint what its spring adds to that as
    beams let it go elsewhere: stiffness there (N.m/rad, N/m), and position there (rad, m).
    """

    pushes: Sequence[Push] = ()
    springs: Mapping[str, tuple[float, float]] = field(default_factory=dict)


def refuse_what_is_not_modelled(m: Mechanism) -> None:
    """Raise Unsupported, naming the body or joint, for what :class:`BeamModel` cannot be made of."""
    for joint in m.joints:
        if joint.prismatic and joint.elasticity is not None:
            raise Unsupported(
                f"{m.name}: the guides of a linkage of beams are rigid; leave out elasticity of joint {joint.name!r}"
            )
    if m.drive_stiffness is not None:
        raise Unsupported(f"{m.name}: the crank of a linkage of beams is held rigidly; leave out drive.stiffness")
    for body in m.bodies:
        if not is_flexible(body):
            continue
        if min(body.section) <= 0:
            raise Unsupported(
                f"{m.name}: body {body.name!r} is elastic but has section {body.section}; give its height and depth"
                " in m"
            )


def is_flexible(body: Body) -> bool:
    """Whether a body is made of beams: it has a modulus of elasticity, and a length."""
    return body.youngs_modulus is not None and body.length > 0


def pin_stiffness(joint: Joint) -> float:
    """Stiffness (N/m) of a pin pressed into its bearing: the contact's, else the joint's spring of Eq. 4, at most
    STIFFEST_PIN; without either STIFFEST_PIN, as the usual contact at rest gives like a link that is pulled.
    """
    spring = joint.elasticity.translation if joint.elasticity is not None else STIFFEST_PIN
    return min(joint.contact_stiffness or spring, STIFFEST_PIN)


def soft_stiffness(joint: Joint, force: float) -> float:
    """Stiffness (N/m) of a bearing that this force (N) makes yield by a part of its clearance: Newton's method finds
    its way on its rim.
    """
    return min(pin_stiffness(joint), force / (SOFT_DEPTH * joint.clearance))


class BeamModel:
    """The linkage as an Exudyn system whose reference configuration is undeformed, under these loads and its springs
    between points, with the joints that are ``held`` by drives where they are in ``start``.

    A link is the bars of :func:`analytic.mechanism.bars.division`: one along a straight link, a star welded at its hub
    otherwise; a point that is not on a bar is carried by a rigid arm, and so are the guide and the slider of a
    prismatic joint, which do not bend.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        clearance: Mapping[str, float],
        start: Mapping[str, Pose],
        loads: Loads,
        held: Collection[str],
    ) -> None:
        import exudyn
        import exudyn.itemInterface as items

        self.exu: Any = exudyn
        self.items, self.m, self.clearance, self.start = items, mechanism, clearance, start
        self.held, self._springs = held, loads.springs
        self._initial = exudyn.ConfigurationType.Initial
        self.container = exudyn.SystemContainer()
        self.mbs = self.container.AddSystem()
        self._marker: dict[tuple[str, str], Any] = {}
        self._arm: dict[tuple[str, str], complex] = {}  # m, in the body, from a point's section to the point
        self._rigid: dict[str, Any] = {}
        self._carriers: dict[tuple[str, str], Any] = {}
        self._axial: list[float] = []  # N/m, of the elements
        self._section: dict[tuple[str, str], tuple[Any, complex]] = {}  # a point's node, and its direction, undeformed
        ground = self._rigid[GROUND] = self.mbs.AddObject(items.ObjectGround())
        for name in mechanism.ground.points:
            self._marker[GROUND, name] = self._on_body(ground, mechanism.ground.point(name))
        for body in mechanism.bodies:
            (self._add_beams if is_flexible(body) else self._add_rigid)(body, start[body.name])
        self._joint = {joint.name: self._add_joint(joint) for joint in mechanism.joints}
        self._drive = {j.name: self._add_drive(j) for j in mechanism.joints if j.name in held and not j.prismatic}
        for name in loads.springs:
            self._add_joint_spring(mechanism.joint(name))
        for spring in mechanism.springs:
            self._add_spring(spring)
        for push in loads.pushes:
            self._push(*push)
        self.mbs.Assemble()

    def _on_body(self, number: Any, place: complex, turn: float = 0.0) -> Any:
        c, s = math.cos(turn), math.sin(turn)
        frame = np.array([[c, -s, 0, place.real], [s, c, 0, place.imag], [0, 0, 1, 0], [0, 0, 0, 1]])
        return self.mbs.AddMarker(self.items.MarkerBodyRigid(bodyNumber=number, localHT=frame))

    def _add_rigid(self, body: Body, pose: Pose) -> None:
        node = self.mbs.AddNode(
            self.items.NodeRigidBody2D(initialCoordinates=[pose.origin.real, pose.origin.imag, pose.angle])
        )
        number = self.mbs.AddObject(
            self.items.ObjectRigidBody2D(mass=body.mass, inertia=body.moment_of_inertia or 1.0, nodeNumber=node)
        )
        for name in _points(body):
            self._marker[body.name, name] = self._on_body(number, body.point(name))
            self._section[body.name, name] = node, cmath.exp(1j * pose.angle)
        self._rigid[body.name] = number

    def _add_beams(self, body: Body, pose: Pose) -> None:
        parts, turn = division(body), cmath.exp(1j * pose.angle)
        sections: dict[
            int, list[tuple[Any, complex]]
        ] = {}  # Exudyn's node and its direction, by node of the frame, for each bar that meets there
        for i, j in parts.bars:
            length = abs(parts.nodes[j] - parts.nodes[i])
            direction = (parts.nodes[j] - parts.nodes[i]) / length * turn
            nodes = self._beam(body, pose.origin + parts.nodes[i] * turn, direction, length)
            sections.setdefault(i, []).append((nodes[0], direction))
            sections.setdefault(j, []).append((nodes[-1], direction))
        for hub in sections.values():
            for other in hub[1:]:
                self._weld(hub[0], other)
        for name, (k, arm) in parts.places.items():
            self._section[body.name, name] = sections[k][0]
            self._arm[body.name, name] = arm
            if self._aside(body.name, name):
                self._marker[body.name, name] = self._part(body.name, name)
            else:
                node = self.items.MarkerNodeRigid(nodeNumber=sections[k][0][0])
                self._marker[body.name, name] = self.mbs.AddMarker(node)

    def _beam(self, body: Body, start: complex, direction: complex, length: float) -> list[Any]:
        """Nodes of a straight beam, made of equal elements.  Beams that go on as one have none in common: a slope that
        two elements share would make them stretch alike, whatever pulls between them.
        """
        stations = np.linspace(0, length, SPAN_ELEMENTS + 1)
        nodes = [self._node(start + x * direction, direction) for x in stations]
        for ends in pairwise(nodes):
            self._element(body, [*ends], length / SPAN_ELEMENTS)
        return nodes

    def _weld(self, *sections: tuple[Any, complex]) -> None:
        """Join two sections in the same place rigidly, at the angle that they have."""
        ends = [self.mbs.AddMarker(self.items.MarkerNodeRigid(nodeNumber=node)) for node, _ in sections]
        self._keep_angle(ends, [direction for _, direction in sections], [1, 1, 0, 0, 0, 1])

    def _keep_angle(self, ends: list[Any], directions: list[complex], axes: list[int]) -> Any:
        """A constraint along these axes that keeps the angle between two markers, of ``directions`` undeformed."""
        turn = _turn(directions[0] / directions[1])
        return self.mbs.AddObject(
            self.items.ObjectJointGeneric(markerNumbers=ends, constrainedAxes=axes, rotationMarker1=turn)
        )

    def _node(self, place: complex, direction: complex) -> Any:
        return self.mbs.AddNode(
            self.items.NodePoint2DSlope1(referenceCoordinates=[place.real, place.imag, direction.real, direction.imag])
        )

    def _element(self, body: Body, nodes: list[Any], length: float) -> None:
        height, depth = body.section
        modulus, area = body.youngs_modulus or 0.0, height * depth
        self._axial.append(modulus * area / length)
        self.mbs.AddObject(
            self.items.ObjectANCFCable2D(
                nodeNumbers=nodes, length=length, massPerLength=body.mass / body.length,
                bendingStiffness=modulus * depth * height**3 / 12, axialStiffness=modulus * area,
            )
        )  # fmt: skip

    def _add_joint(self, joint: Joint) -> Any:
        if joint.prismatic:
            return self._add_slide(joint)
        markers = [self._marker[body, joint.name] for body in joint.bodies]
        if joint.name in self.clearance:
            radius = joint.rim
            data = self.mbs.AddNode(
                self.items.NodeGenericData(initialCoordinates=[-1e-12, 0.0, 0.0, 0.0], numberOfDataCoordinates=4)
            )
            return self.mbs.AddObject(
                self.items.ObjectContactSphereSphere(
                    markerNumbers=markers, nodeNumber=data, spheresRadii=[radius, radius + joint.clearance],
                    isHollowSphere1=True, contactStiffness=pin_stiffness(joint),
                )
            )  # fmt: skip
        if joint.elasticity is not None:
            k = joint.elasticity.translation
            return self.mbs.AddObject(
                self.items.ObjectConnectorCartesianSpringDamper(markerNumbers=markers, stiffness=[k, k, 0.0])
            )
        return self.mbs.AddObject(self.items.ObjectJointRevolute2D(markerNumbers=markers))

    def _add_slide(self, joint: Joint) -> Any:
        """A prismatic joint; a drive that holds it holds the second body's point on the first."""
        held, placed = joint.name in self.held, {GROUND: AT_REST, **self.start}
        far = travel(self.m, joint, *(placed[body] for body in joint.bodies))[0] if held else 0.0
        turns = cmath.phase(joint.direction), cmath.phase(joint.direction) - joint.angle
        ends = [
            self._part(body, joint.name, shift, turn)
            for body, shift, turn in zip(joint.bodies, (far * joint.direction, 0j), turns, strict=True)
        ]
        return self.mbs.AddObject(
            self.items.ObjectJointGeneric(markerNumbers=ends, constrainedAxes=[int(held), 1, 0, 0, 0, 1])
        )

    def _part(self, body: str, point: str, shift: complex = 0j, turn: float = 0.0) -> Any:
        """Marker of what is rigidly at a body's point, ``shift`` (m) from it and turned (rad), both in the body."""
        if body in self._rigid:
            return self._on_body(self._rigid[body], self.m.body(body).point(point) + shift, turn)
        if (body, point) not in self._carriers:
            self._carriers[body, point] = self._carrier(body, point)
        return self._on_body(self._carriers[body, point], self._arm[body, point] + shift, turn)

    def _carrier(self, body: str, point: str) -> Any:
        """A rigid body, along the axes of a body of beams, on the section that carries a point."""
        node, direction = self._section[body, point]
        angle, along = self.start[body].angle, cmath.exp(1j * self.start[body].angle)
        place = self.start[body].origin + (self.m.body(body).point(point) - self._arm[body, point]) * along
        moving = self.mbs.AddNode(self.items.NodeRigidBody2D(initialCoordinates=[place.real, place.imag, angle]))
        number = self.mbs.AddObject(self.items.ObjectRigidBody2D(mass=1.0, inertia=1.0, nodeNumber=moving))  # at rest
        ends = [self.mbs.AddMarker(self.items.MarkerNodeRigid(nodeNumber=node)), self._on_body(number, 0j)]
        self._keep_angle(ends, [direction, along], [1, 1, 0, 0, 0, 1])
        return number

    def _add_spring(self, spring: Spring) -> None:
        ends = [self._part(*end) for end in spring.ends]
        connector = self.items.ObjectConnectorSpringDamper
        self.mbs.AddObject(connector(markerNumbers=ends, referenceLength=spring.length, stiffness=spring.stiffness))

    def _add_joint_spring(self, joint: Joint) -> None:
        """What a joint's spring gives beside its push, which is that of the rigid linkage's position."""
        stiffness, at = self._springs[joint.name]
        if joint.prismatic:
            turns = (cmath.phase(joint.direction), 0.0)
            ends = [self._part(body, joint.name, turn=turn) for body, turn in zip(joint.bodies, turns, strict=True)]
            kind = self.items.ObjectConnectorLinearSpringDamper
            self.mbs.AddObject(kind(markerNumbers=ends, axisMarker0=[1.0, 0.0, 0.0], stiffness=stiffness, offset=at))
            return
        first, second = joint.bodies
        turned = (self._angle(second) - self._angle(first)) - at  # of the undeformed linkage, from there
        z = self._direction(first, joint.name) / self._direction(second, joint.name) * cmath.exp(1j * turned)
        self.mbs.AddObject(
            self.items.ObjectConnectorTorsionalSpringDamper(
                markerNumbers=[self._marker[body, joint.name] for body in joint.bodies],
                stiffness=stiffness,
                rotationMarker1=_turn(z),
            )
        )

    def spring(self, joint: Joint, position: float) -> float:
        """What a joint's spring gives (N.m, N) on the second body at a position (rad, m), beside its push."""
        stiffness, at = self._springs.get(joint.name, (0.0, 0.0))
        return -stiffness * (position - at)

    def _add_drive(self, joint: Joint) -> Any:
        """What holds the angle of a revolute joint: between the sections there."""
        ends = [self._marker[body, joint.name] for body in joint.bodies]
        return self._keep_angle(ends, [self._direction(body, joint.name) for body in joint.bodies], [0, 0, 0, 0, 0, 1])

    def _direction(self, body: str, point: str) -> complex:
        """Direction of a point's marker, undeformed: of its section, or of a rigid body or arm."""
        if body in self._rigid or self._aside(body, point):
            return cmath.exp(1j * self._angle(body))
        return self._section[body, point][1]

    def _aside(self, body: str, point: str) -> bool:
        """Whether a point of a body of beams is beside its bar, on a rigid arm."""
        return abs(self._arm[body, point]) > ARM * self.m.moving[body].length

    def _push(self, body: str, point: str, force: complex, torque: float) -> None:
        """A force (N) at a point and a torque (N.m)."""
        marker = self._marker[body, point]
        if force:
            self.mbs.AddLoad(self.items.LoadForceVector(markerNumber=marker, loadVector=[force.real, force.imag, 0.0]))
        if torque:
            self.mbs.AddLoad(self.items.LoadTorqueVector(markerNumber=marker, loadVector=[0.0, 0.0, torque]))

    def solve(self, soft: Mapping[str, float], upright: Callable[[], bool]) -> bool:
        """Static equilibrium; False if there is none that is ``upright``.

        Contacts stiffen from ``soft`` (N/m, by joint) on, because Newton's method loses a stiff one's curvature.
        """
        stiff = {name: pin_stiffness(self.m.joint(name)) for name in self.clearance}

        def solved(share: float) -> bool:
            for name, number in stiff.items():
                self.mbs.SetObjectParameter(
                    self._joint[name], "contactStiffness", soft[name] * (number / soft[name]) ** share
                )
            differences = DIFFERENCES if stiff else DIFFERENCES[:1]
            return any(self._solve(difference, upright) for difference in differences)

        if all(soft[name] == number for name, number in stiff.items()):
            return solved(1.0)
        share, step = 0.0, STIFFENING
        if not solved(share):
            return False
        while share < 1.0:
            if solved(min(share + step, 1.0)):
                share += step
            elif step > SMALLEST_STIFFENING:
                step /= 2
            else:
                return False
        return True

    def _solve(self, difference: float, upright: Callable[[], bool]) -> bool:
        """Static equilibrium near where the linkage is; False, and back there, if there is none that is ``upright``."""
        state = self.mbs.systemData
        kept = state.GetSystemState(self._initial)
        try:
            settings = static_settings(self._residual, difference)
            if self.mbs.SolveStatic(settings, updateInitialValues=True, storeSolver=False) and upright():
                return True
        except self.exu.exudynCPP.SolverError:
            pass
        state.SetSystemState(kept, self._initial)
        return False

    @property
    def _residual(self) -> float:
        """Force (N) that a solution may leave unbalanced."""
        springs = [j.elasticity.translation for j in self.m.joints if j.elasticity is not None]
        springs += [pin_stiffness(self.m.joint(name)) for name in self.clearance]
        return 1e-8 + ROUNDING_OF_BEAMS * max([*springs, *self._axial], default=0.0)

    # ---------------------------------------------------------------- reading

    def place(self, body: str, point: str) -> complex:
        """Where a body's point is (m)."""
        x, y, _ = self.mbs.GetMarkerOutput(self._marker[body, point], self.exu.OutputVariableType.Position)
        return complex(x, y)

    def rotation(self, body: str, point: str) -> float:
        """Rotation (rad) of the section that carries a body's point, from the pose in which it started, undeformed."""
        if body == GROUND:
            return 0.0
        node, direction = self._section[body, point]
        moved = self.mbs.GetNodeOutput(node, self.exu.OutputVariableType.Coordinates)
        if body in self._rigid:
            return float(turned_near(moved[2] - cmath.phase(direction), 0.0))
        return cmath.phase(1 + complex(moved[2], moved[3]) / direction)

    def axis(self, joint: Joint) -> complex:
        """Direction of a prismatic joint's axis."""
        first = joint.bodies[0]
        return joint.direction * cmath.exp(1j * (self._angle(first) + self.rotation(first, joint.name)))

    def _angle(self, body: str) -> float:
        """Angle (rad) of an undeformed body."""
        return 0.0 if body == GROUND else self.start[body].angle

    def force(self, joint: Joint) -> complex:
        """Force (N) of a joint's first body on its second; of a prismatic joint, what its guide carries, and what a
        drive gives that holds it.
        """
        if joint.prismatic:
            value = self.mbs.GetObjectOutput(self._joint[joint.name], self.exu.OutputVariableType.ForceLocal)
            return complex(self.drive(joint) if joint.name in self.held else 0.0, float(value[1])) * self.axis(joint)
        value = self.mbs.GetObjectOutput(self._joint[joint.name], self.exu.OutputVariableType.Force)
        sign = 1.0 if joint.name not in self.clearance and joint.elasticity is None else -1.0
        return sign * complex(value[0], value[1])

    def moment(self, joint: Joint) -> float:
        """Moment (N.m) of a prismatic joint on its second body, at that body's point."""
        return -float(self.mbs.GetObjectOutput(self._joint[joint.name], self.exu.OutputVariableType.TorqueLocal)[2])

    def drive(self, joint: Joint) -> float:
        """Torque (N.m), or force along a slide (N), on the second body of a joint of the drive that holds it."""
        kinds = self.exu.OutputVariableType
        if joint.prismatic:
            return float(self.mbs.GetObjectOutput(self._joint[joint.name], kinds.ForceLocal)[0])
        return -float(self.mbs.GetObjectOutput(self._drive[joint.name], kinds.TorqueLocal)[2])


def _turn(z: complex) -> np.ndarray:
    """Rotation by the angle of a number of length 1, (3, 3)."""
    return np.array([[z.real, -z.imag, 0.0], [z.imag, z.real, 0.0], [0.0, 0.0, 1.0]])


def _points(body: Body) -> tuple[str, ...]:
    return (*body.points, "com", MASS_CENTRE)
