"""A linkage of beams in Exudyn: the elastic displacement of Eqs. 1-7 and the clearance of Eq. 8, both at once.

Links with a modulus of elasticity are large-displacement planar beams, so that reactions follow the deformed, displaced
linkage; the paper's superposition (Fig. 7c) is its first order.  Elements: ``euler-bernoulli`` is ANCFCable2D (no
shear, as Eqs. 2-3), ``timoshenko`` the geometrically exact beam with three nodes and shear factor 5/6.  The crank's
axis is held at the drive, weights and loads act at the com and at named points, and joints are the springs of Eq. 4 (or
rigid).  A joint with clearance and joint model ``contact`` is a journal in its bearing whose contact is as stiff as the
joint's spring.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from analytic.assembly import Assembly
from analytic.mechanism import GROUND, Body, Joint, Mechanism
from sim_models.contact_laws import PIN_RADIUS, STATIC_STIFFNESS
from sim_models.engine import Request, SimulationError, Unsupported
from sim_models.exudyn_equilibria import Equilibria
from sim_models.exudyn_model import silence, static_settings
from sim_models.start import Pose, poses

Element = Literal["euler-bernoulli", "timoshenko"]

SPAN_ELEMENTS = 4  # between two neighbouring points of a link; one is exact already for small displacements
SHEAR_FACTOR = 5 / 6  # of a rectangular section
POISSON = 0.3  # of a body without a shear modulus
ROUNDING = 3e-16  # m: what a position of this size is rounded to, so that a spring's force wavers by it times its stiffness
STIFFEST = 1e10  # N/m of a contact, at most: Exudyn differentiates it numerically, and Newton's method fails beyond
SOFTENING = tuple(10.0**-k for k in range(5, -1, -1))  # of the contact's stiffness, one solution after the other
BESIDE = 1e-6  # of a link's length: how far a point may lie beside its axis


@dataclass(frozen=True)
class FlexibleLinkage:
    """A flexible linkage in static equilibrium at one crank angle.  Complex numbers are x + iy in the ground frame."""

    theta: float  # rad
    displacement: Mapping[tuple[str, str], complex]  # m, by body and point (com included), from the ideal rigid linkage
    force: Mapping[str, complex]  # N, by joint: of the first body on the second
    gap: Mapping[str, complex]  # m, by joint: first pin centre minus second


def flexible_static(
    mechanism: Mechanism, theta: float, element: Element = "euler-bernoulli", joint_model: Literal["ideal", "contact"] = "ideal"
) -> FlexibleLinkage:
    """Equilibrium of a linkage of beams under its loads and weights, crank held at angle theta (rad).

    With ``contact`` every joint with clearance has it; with ``ideal`` clearances are ignored.  Raises Unsupported for
    prismatic joints, joint laws, compliant drives and links whose points do not lie on one line, SimulationError if no
    equilibrium is found, AssemblyError where the linkage cannot be assembled.
    """
    _refuse_what_is_not_modelled(mechanism)
    assembly = Assembly(mechanism)
    clearance = mechanism.clearances if joint_model == "contact" else {}
    with silence():
        gaps = _pressed(mechanism, assembly, theta, clearance)
        model = _Model(mechanism, element, clearance, poses(assembly, theta, gaps=lambda _: gaps))
        if not model.solve():
            raise SimulationError(
                f"exudyn {element} beams ({mechanism.name}): no static equilibrium found at crank angle {np.degrees(theta):.4g} deg; "
                "use a smaller clearance, keep clear of change points, or check youngs_modulus, section and the loads"
            )
        return model.result(theta, poses(assembly, theta))


def _pressed(m: Mechanism, assembly: Assembly, theta: float, clearance: Mapping[str, float]) -> dict[str, complex]:
    """Gaps (m) of the rigid linkage, its pins pressed into bearings that are soft at first."""
    if not clearance:
        return {}
    rigid = Equilibria(Request(m, "massless-link", "static"), assembly, m.speed or 1.0).at(theta)
    gaps = {}
    for name, size in clearance.items():
        force = complex(rigid.force[name][0])
        gaps[name] = (size + abs(force) / (SOFTENING[0] * _pin_stiffness(m.joint(name)))) * force / abs(force)
    return gaps


def _refuse_what_is_not_modelled(m: Mechanism) -> None:
    for joint in m.joints:
        if joint.prismatic:
            raise Unsupported(f"{m.name}: beams are joined by revolute joints only; joint {joint.name!r} is prismatic")
        if joint.stiffness or joint.coulomb:
            raise Unsupported(f"{m.name}: beams have no joint springs or friction; leave them out of joint {joint.name!r}")
    if m.drive is not None and m.drive.stiffness is not None:
        raise Unsupported(f"{m.name}: the crank of a linkage of beams is held rigidly; leave out drive.stiffness")
    for body in m.bodies:
        if body.youngs_modulus is None:
            continue
        if min(body.section) <= 0:
            raise Unsupported(f"{m.name}: body {body.name!r} is elastic but has section {body.section}; give its height and depth in m")
        start, axis = _axis(body)
        for name in (*body.points, "com"):
            beside = abs(((body.point(name) - start) * axis.conjugate()).imag)
            if beside > BESIDE * body.length:
                raise Unsupported(f"{m.name}: point {name!r} of body {body.name!r} lies {beside:g} m beside its axis; beams are straight")


def _axis(body: Body) -> tuple[complex, complex]:
    """Start (m) and unit direction of a straight body, in its frame."""
    points = [body.point(name) for name in body.points]
    start, end = max(((p, q) for p in points for q in points), key=lambda ends: abs(ends[1] - ends[0]))
    return start, (end - start) / abs(end - start)


def _pin_stiffness(joint: Joint) -> float:
    """Stiffness (N/m) of a pin pressed into its bearing: the contact's, else the joint's spring of Eq. 4, at most STIFFEST."""
    spring = joint.elasticity.translation if joint.elasticity is not None else STATIC_STIFFNESS
    return min(joint.contact_stiffness or spring, STIFFEST)


class _Model:
    """The linkage as an Exudyn system whose reference configuration is undeformed."""

    def __init__(self, mechanism: Mechanism, element: Element, clearance: Mapping[str, float], start: Mapping[str, Pose]) -> None:
        import exudyn
        import exudyn.itemInterface as items

        self.exu: Any = exudyn
        self.items, self.m, self.element, self.clearance = items, mechanism, element, clearance
        self.container = exudyn.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.fixed = self.mbs.AddMarker(items.MarkerNodeCoordinate(nodeNumber=self.mbs.AddNode(items.NodePointGround()), coordinate=0))
        self.marker: dict[tuple[str, str], Any] = {}
        ground = self.mbs.AddObject(items.ObjectGround())
        for name in mechanism.ground.points:
            self.marker[GROUND, name] = self._on_body(ground, mechanism.ground.point(name))
        for body in mechanism.bodies:
            (self._add_rigid if body.youngs_modulus is None else self._add_beams)(body, start[body.name])
        self.joint = {joint.name: self._add_joint(joint) for joint in mechanism.joints}
        for body in mechanism.bodies:
            self._push(body.name, "com", body.mass * complex(*mechanism.gravity), 0.0)
        for load in mechanism.loads:
            self._push(load.body, load.point, complex(*load.force), load.torque)
        self.mbs.Assemble()

    def _on_body(self, number: Any, place: complex) -> Any:
        return self.mbs.AddMarker(self.items.MarkerBodyRigid(bodyNumber=number, localPosition=[place.real, place.imag, 0.0]))

    def _add_rigid(self, body: Body, pose: Pose) -> None:
        node = self.mbs.AddNode(self.items.NodeRigidBody2D(initialCoordinates=[pose.origin.real, pose.origin.imag, pose.angle]))
        number = self.mbs.AddObject(self.items.ObjectRigidBody2D(mass=body.mass, inertia=body.moment_of_inertia or 1.0, nodeNumber=node))
        for name in (*body.points, "com"):
            self.marker[body.name, name] = self._on_body(number, body.point(name))
        if body.name == self.m.driven:
            self._hold(node, [(2, 1.0)], pose.angle)

    def _add_beams(self, body: Body, pose: Pose) -> None:
        start, axis = _axis(body)
        along = {name: ((body.point(name) - start) * axis.conjugate()).real for name in (*body.points, "com")}
        stops = sorted({round(x, 12) for x in along.values()})
        per_span = SPAN_ELEMENTS * (1 if self.element == "euler-bernoulli" else 2)  # the exact beam has a node in the middle
        stations = np.concatenate([np.linspace(a, b, per_span, endpoint=False) for a, b in pairwise(stops)] + [stops[-1:]])
        direction = axis * cmath.exp(1j * pose.angle)
        origin = pose.origin + start * cmath.exp(1j * pose.angle)
        nodes = [self._node(origin + x * direction, direction) for x in stations]
        step = 1 if self.element == "euler-bernoulli" else 2
        for k in range(0, len(nodes) - 1, step):
            self._element(body, nodes[k : k + step + 1], float(stations[k + step] - stations[k]))
        for name, x in along.items():
            self.marker[body.name, name] = self.mbs.AddMarker(self.items.MarkerNodeRigid(nodeNumber=nodes[int(np.argmin(np.abs(stations - x)))]))
        if body.name == self.m.driven:
            clamp = nodes[int(np.argmin(np.abs(stations - along[self.m.drive_joint.name])))]
            if self.element == "timoshenko":
                self._hold(clamp, [(2, 1.0)])
            else:  # the slope keeps its direction: no displacement of it across the axis
                self._hold(clamp, [(2, -direction.imag), (3, direction.real)])

    def _node(self, place: complex, direction: complex) -> Any:
        if self.element == "timoshenko":
            return self.mbs.AddNode(self.items.NodeRigidBody2D(referenceCoordinates=[place.real, place.imag, cmath.phase(direction)]))
        return self.mbs.AddNode(self.items.NodePoint2DSlope1(referenceCoordinates=[place.real, place.imag, direction.real, direction.imag]))

    def _element(self, body: Body, nodes: list[Any], length: float) -> None:
        height, depth = body.section
        modulus, area = body.youngs_modulus or 0.0, height * depth
        shear = body.shear_modulus or modulus / (2 * (1 + POISSON))
        common = {"nodeNumbers": nodes, "length": length, "massPerLength": body.mass / body.length}
        common |= {"bendingStiffness": modulus * depth * height**3 / 12, "axialStiffness": modulus * area}
        if self.element == "euler-bernoulli":
            self.mbs.AddObject(self.items.ObjectANCFCable2D(**common))
        else:
            inertia = body.mass / body.length * height**2 / 12
            self.mbs.AddObject(
                self.items.ObjectBeamGeometricallyExact2D(**common, crossSectionInertia=inertia, shearStiffness=SHEAR_FACTOR * shear * area)
            )

    def _hold(self, node: Any, parts: list[tuple[int, float]], value: float = 0.0) -> None:
        """Hold a sum of factors times coordinates of a node (one or two of them)."""
        (_, weight), *_ = parts = sorted(parts, key=lambda part: -abs(part[1]))
        markers = [self.mbs.AddMarker(self.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=c)) for c, _ in parts]
        if len(parts) == 1:
            self.mbs.AddObject(self.items.ObjectConnectorCoordinate(markerNumbers=[self.fixed, markers[0]], offset=value / weight))
        else:  # first + (second / weight) = 0, written as factor1 * second - first
            factor = -parts[1][1] / weight
            self.mbs.AddObject(self.items.ObjectConnectorCoordinate(markerNumbers=markers, factor1=factor, offset=value / weight))

    def _add_joint(self, joint: Joint) -> Any:
        markers = [self.marker[body, joint.name] for body in joint.bodies]
        if joint.name in self.clearance:
            radius = joint.pin_radius or PIN_RADIUS
            data = self.mbs.AddNode(self.items.NodeGenericData(initialCoordinates=[-1e-12, 0.0, 0.0, 0.0], numberOfDataCoordinates=4))
            return self.mbs.AddObject(
                self.items.ObjectContactSphereSphere(
                    markerNumbers=markers, nodeNumber=data, spheresRadii=[radius, radius + joint.clearance],
                    isHollowSphere1=True, contactStiffness=_pin_stiffness(joint),
                )
            )  # fmt: skip
        if joint.elasticity is not None:
            k = joint.elasticity.translation
            return self.mbs.AddObject(self.items.ObjectConnectorCartesianSpringDamper(markerNumbers=markers, stiffness=[k, k, 0.0]))
        return self.mbs.AddObject(self.items.ObjectJointRevolute2D(markerNumbers=markers))

    def _push(self, body: str, point: str, force: complex, torque: float) -> None:
        marker = self.marker[body, point]
        if force:
            self.mbs.AddLoad(self.items.LoadForceVector(markerNumber=marker, loadVector=[force.real, force.imag, 0.0]))
        if torque:
            self.mbs.AddLoad(self.items.LoadTorqueVector(markerNumber=marker, loadVector=[0.0, 0.0, torque]))

    def solve(self) -> bool:
        """Static equilibrium; contacts are soft at first and stiffen by turns, because Newton's method loses a stiff one's curvature."""
        stiffest = max([j.elasticity.translation for j in self.m.joints if j.elasticity is not None], default=0.0)
        settings = static_settings(1e-6 + ROUNDING * stiffest)
        try:
            for softer in SOFTENING if self.clearance else (1.0,):
                for name in self.clearance:
                    self.mbs.SetObjectParameter(self.joint[name], "contactStiffness", softer * _pin_stiffness(self.m.joint(name)))
                if not self.mbs.SolveStatic(settings, updateInitialValues=True, storeSolver=False):
                    return False
        except self.exu.exudynCPP.SolverError:
            return False
        return True

    def result(self, theta: float, ideal: Mapping[str, Pose]) -> FlexibleLinkage:
        place = {key: self._place(marker) for key, marker in self.marker.items()}
        displacement = {}
        for body in self.m.bodies:
            pose = ideal[body.name]
            for name in (*body.points, "com"):
                displacement[body.name, name] = place[body.name, name] - pose.origin - body.point(name) * cmath.exp(1j * pose.angle)
        gap = {j.name: place[j.bodies[0], j.name] - place[j.bodies[1], j.name] for j in self.m.joints}
        force = {}
        for joint in self.m.joints:
            value = self.mbs.GetObjectOutput(self.joint[joint.name], self.exu.OutputVariableType.Force)
            sign = 1.0 if joint.name not in self.clearance and joint.elasticity is None else -1.0
            force[joint.name] = sign * complex(value[0], value[1])
        return FlexibleLinkage(theta, displacement, force, gap)

    def _place(self, marker: Any) -> complex:
        x, y, _ = self.mbs.GetMarkerOutput(marker, self.exu.OutputVariableType.Position)
        return complex(x, y)
