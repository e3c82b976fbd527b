"""A planar linkage as an Exudyn system: bodies, joints with their laws, springs, loads, drives, and sensors on them.

Bodies are ``RigidBody2D`` with their node at the centre of mass and zero reference coordinates, so that a node's
coordinates *are* the com's x, y (m) and the body's angle (rad) in the ground frame.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE, Joint, Load, Mechanism, Spring
from analytic.mechanism.parts import TINY
from analytic.mechanism.varying import NEVER, Fading, Seen
from sim_models.common.contact_laws import NamedLaw, bearing, contact_parameters, longest
from sim_models.common.fading import fading
from sim_models.common.mobility import stop_step
from sim_models.common.start import AT_REST, Pose
from sim_models.common.travel import travel
from sim_models.engine import JointModel, Motion, Request
from sim_models.exudyn.block import ExudynBlock
from sim_models.exudyn.compiled import add_forces
from sim_models.exudyn.laws import (
    CONTACT_CREEP,
    MINIMUM_IMPACT_SPEED,
    contact_restitution,
    hysteresis,
    joint_creep,
    named_laws,
)
from sim_models.exudyn.motor import RunMotor
from sim_models.exudyn.named_contact import End, Glance, Memory, Rub, at_pin, before_steps, push_back
from sim_models.exudyn.slide_motors import Slide

ROD_STIFFNESS = (
    1e10  # N/m of the static massless link: Exudyn's static Newton knows no geometric stiffness of a constraint
)


class ExudynModel:
    """A mechanism assembled as an Exudyn system, in a given pose; ``static`` and ``driven`` differ in joint laws and
    drive.

    ``start`` are the bodies' poses and rates; ``motor`` turns the crank, or one end of the spring of a compliant drive
    whose other end is the crank; without one the crank is held in statics, and free in motion.  ``drives`` are of
    linkages that no crank moves: by joint the motor that moves it or, in statics, that it is held.  Joints with
    clearance get the joint model, all others are ideal, or springs where their bearings are soft; ``contact_for`` says
    whose contact parameters an equilibrium uses that a driven run starts from.  Constraints may be ``redundant``.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        joint_model: JointModel,
        motion: Motion,
        start: Mapping[str, Pose],
        *,
        contact_for: Motion | None = None,
        motor: RunMotor | None = None,
        drives: Mapping[str, RunMotor | None] | None = None,
        redundant: bool = False,
    ) -> None:
        import exudyn
        import exudyn.itemInterface as items

        self.exu: Any = exudyn
        self.items = items
        self.m, self.joint_model, self.motion, self.redundant = mechanism, joint_model, motion, redundant
        self.clearance = Request(mechanism, joint_model).clearances
        if joint_model == "massless-link":  # a rod holds no block
            self.clearance = {name: c for name, c in self.clearance.items() if not mechanism.joint(name).prismatic}
        self.laws = {
            name: contact_parameters(mechanism, mechanism.joint(name), contact_for or motion) for name in self.clearance
        }
        self.named = named_laws(mechanism, joint_model, motion)
        self.glances: list[Glance] = []  # of laws by name that remember how fast what they push touched
        self.rubs: dict[str, Rub] = {}  # friction beside a law by name
        self.blocks: dict[str, ExudynBlock] = {}  # of prismatic joints with clearance
        self.bearings = {
            name: bearing(mechanism, mechanism.joint(name)) for name in Request(mechanism, joint_model).bearings
        }
        self.container = exudyn.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.clock, self.since = 0.0, 0.0  # s since the run's start, and that where the time of its motion is 0
        self.heading: Mapping[str, Pose] = {}  # of an equilibrium: bodies in the motion that loads oppose
        self._ground = self.mbs.AddObject(items.ObjectGround())
        self._ground_node = self.mbs.AddNode(items.NodePointGround())
        self._fixed = self._coordinate(self._ground_node, 0)
        self.nodes: dict[str, Any] = {}
        self._body: dict[str, Any] = {}
        self.sensors: dict[str, Any] = {}
        self.slide_laws: dict[str, Any] = {}  # the law of each prismatic joint that has one
        self.touching: list[str] = []  # joints with contact, in the order of their data
        self.com_force: dict[str, Any] = {}
        self.com_torque: dict[str, Any] = {}
        for body in mechanism.bodies:
            self._add_body(body.name, start[body.name])
        self.creep = joint_creep([motor] if motor else [] if drives is None else [*filter(None, drives.values())])
        self.released = motion == "driven" and motor is None and drives is None
        self._add_loads()
        for joint in mechanism.joints:
            self._add_joint(joint, start)
            self._add_joint_law(joint)
        self._add_periodic_torque()
        for spring in mechanism.springs:
            self._add_spring(spring)
        self.drive, self.compliant = None, False  # of a crank
        self.drives: dict[str, Any] | None = None  # by joint, where no crank moves the linkage
        self.held: dict[str, float] = {}  # position (rad, m) of each of those that is held
        if drives is None:
            self._add_drive(start, motor)
        else:
            self.drives = {name: self._add_own_drive(mechanism.joint(name), by) for name, by in drives.items()}
            self.hold(start)
        self.mbs.Assemble()
        if self.glances:
            self.mbs.SetPreStepUserFunction(before_steps(self.glances))

    @property
    def size(self) -> float:
        """Length (m) of the longest body."""
        return longest(self.m)

    def stiffness(self, joint: str) -> float:
        """Stiffness (N/m) of a joint with clearance once its gap is taken up, or of a soft bearing."""
        if joint in self.bearings:
            return self.bearings[joint].stiffness
        return ROD_STIFFNESS if self.joint_model == "massless-link" else self.laws[joint].stiffness

    # ---------------------------------------------------------------- building

    def _coordinate(self, node: Any, coordinate: int) -> Any:
        return self.mbs.AddMarker(self.items.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))

    def _add_body(self, name: str, pose: Pose) -> None:
        body = self.m.moving[name]
        arm = body.point(MASS_CENTRE) * cmath.exp(1j * pose.angle)
        com, velocity = pose.origin + arm, pose.velocity + 1j * pose.angular_velocity * arm
        node = self.mbs.AddNode(
            self.items.NodeRigidBody2D(
                initialCoordinates=[com.real, com.imag, pose.angle],
                initialVelocities=[velocity.real, velocity.imag, pose.angular_velocity],
            )
        )
        self.nodes[name] = node
        self._body[name] = self.mbs.AddObject(
            self.items.ObjectRigidBody2D(mass=body.mass, inertia=body.moment_of_inertia, nodeNumber=node)
        )
        for kind in ("Coordinates", "Coordinates_t", "Coordinates_tt"):
            self._sense(f"{kind} {name}", self.items.SensorNode, kind, nodeNumber=node)

    def _sense(self, key: str, sensor: Any, variable: str, **where: Any) -> None:
        variable_type = getattr(self.exu.OutputVariableType, variable)
        self.sensors[key] = self.mbs.AddSensor(
            sensor(**where, storeInternal=True, writeToFile=False, outputVariableType=variable_type)
        )

    def _marker(self, body: str, point: str, turn: float = 0.0) -> Any:
        """Marker at a body's point, its x axis turned by ``turn`` (rad) in the body."""
        z = self.m.body(body).point(point) - (0 if body == GROUND else self.m.body(body).point(MASS_CENTRE))
        c, s = math.cos(turn), math.sin(turn)
        place = np.array([[c, -s, 0, z.real], [s, c, 0, z.imag], [0, 0, 1, 0], [0, 0, 0, 1]])
        number = self._ground if body == GROUND else self._body[body]
        return self.mbs.AddMarker(self.items.MarkerBodyRigid(bodyNumber=number, localHT=place))

    def _add_loads(self) -> None:
        for body in self.m.bodies:
            weight = [body.mass * g for g in self.m.gravity]
            com = self._marker(body.name, MASS_CENTRE)
            self.com_force[body.name], self.com_torque[body.name] = self._add_load(com, weight, 0.0)
        for load in self.m.loads:
            force, torque = self._add_load(self._marker(load.body, load.point), load.force, load.torque)
            if load.varies:
                key = "loadVectorUserFunction"
                self.mbs.SetLoadParameter(force, key, self._now(load, lambda push, _: [push.real, push.imag, 0.0]))
                self.mbs.SetLoadParameter(torque, key, self._now(load, lambda _, turn: [0.0, 0.0, turn]))

    def fades(self, load: Load) -> Fading:
        """Below which velocities a load that opposes the motion fades: only where the linkage swings freely."""
        return fading(self.m, load) if self.released else NEVER

    def _now(self, load: Load, part: Callable[[complex, float], list[float]]) -> Callable[..., list[float]]:
        """A part of a load that varies, as Exudyn asks for it in every evaluation."""
        seen = Seen(self._turned, self._place, self._going, self._spin, lambda: self.clock)
        fades = self.fades(load)

        def now(mbs: Any, t: float, _: object) -> list[float]:
            if self.motion == "driven":
                self.clock = t + self.since
            force, torque = self.m.acting(load, seen, fades)
            return part(complex(force), float(torque))

        return now

    def _state(self, body: str) -> list[float]:
        return list(map(float, self.mbs.GetNodeOutput(self.nodes[body], self.exu.OutputVariableType.Coordinates)))

    def _rates(self, body: str) -> list[float]:
        """Velocities (m/s) and rate (rad/s) of a body: where a gap lets it go, of the begin of a step, as a load that
        turned round with them within it would leave the step without a solution.
        """
        known, of = self.exu.ConfigurationType, self.exu.OutputVariableType.Coordinates_t
        let_go = self.m.displaced and not self.released
        when = known.StartOfStep if let_go else known.Current
        return list(map(float, self.mbs.GetNodeOutput(self.nodes[body], of, configuration=when)))

    def _turned(self, body: str) -> float:
        return self._state(body)[2]

    def _arm(self, body: str, point: str) -> complex:
        """From a body's centre of mass to one of its points (m, ground frame)."""
        own = self.m.moving[body]
        return (own.point(point) - own.point(MASS_CENTRE)) * cmath.exp(1j * self._turned(body))

    def _place(self, body: str, point: str) -> complex:
        if body == GROUND:
            return self.m.ground.point(point)
        return complex(*self._state(body)[:2]) + self._arm(body, point)

    def _going(self, body: str, point: str) -> complex:
        """Velocity (m/s) of a body's point; of an equilibrium that of the motion in which it is sought."""
        if self.motion == "static":
            pose, at = self.heading[body], self.m.moving[body].point(point)
            return pose.velocity + 1j * pose.angular_velocity * at * cmath.exp(1j * pose.angle)
        u, v, spin = self._rates(body)
        return complex(u, v) + 1j * spin * self._arm(body, point)

    def _spin(self, body: str) -> float:
        if self.motion == "static":
            return self.heading[body].angular_velocity
        return self._rates(body)[2]

    def _add_load(self, marker: Any, force: Sequence[float], torque: float) -> tuple[Any, Any]:
        return (
            self.mbs.AddLoad(self.items.LoadForceVector(markerNumber=marker, loadVector=[*force, 0.0])),
            self.mbs.AddLoad(self.items.LoadTorqueVector(markerNumber=marker, loadVector=[0.0, 0.0, torque])),
        )

    def _add_spring(self, spring: Spring) -> None:
        """A spring between points; in statics its damper is a load (``ExudynLinkage.load_bodies``)."""
        self.mbs.AddObject(
            self.items.ObjectConnectorSpringDamper(
                markerNumbers=[self._marker(body, point) for body, point in spring.ends],
                referenceLength=spring.length,
                stiffness=spring.stiffness,
                damping=spring.damping if self.motion == "driven" else 0.0,
            )
        )

    def _add_joint(self, joint: Joint, start: Mapping[str, Pose]) -> None:
        if joint.prismatic and joint.name in self.clearance:
            self._add_block(joint)
            return
        if joint.prismatic:
            turn = cmath.phase(joint.direction)
            markers = [
                self._marker(joint.bodies[0], joint.name, turn),
                self._marker(joint.bodies[1], joint.name, turn - joint.angle),
            ]
            number = self.mbs.AddObject(
                self.items.ObjectJointGeneric(markerNumbers=markers, constrainedAxes=[0, 1, 0, 0, 0, 1])
            )
            self._sense(f"force {joint.name}", self.items.SensorObject, "ForceLocal", objectNumber=number)
            self._sense(f"moment {joint.name}", self.items.SensorObject, "TorqueLocal", objectNumber=number)
            return
        markers = [self._marker(body, joint.name) for body in joint.bodies]
        if joint.name in self.bearings:
            law = self.bearings[joint.name]
            stiffness, damping = [law.stiffness, law.stiffness, 0.0], [law.damping, law.damping, 0.0]
            spring = self.items.ObjectConnectorCartesianSpringDamper
            number = self.mbs.AddObject(spring(markerNumbers=markers, stiffness=stiffness, damping=damping))
        elif joint.name not in self.clearance:
            number = self.mbs.AddObject(self.items.ObjectJointRevolute2D(markerNumbers=markers))
        elif joint.name in self.named or self.joint_model == "spring-damper":
            number = self._add_one_sided(joint, markers)
        elif self.joint_model == "contact":
            spin = [start[body].angular_velocity if body != GROUND else 0.0 for body in joint.bodies]
            number = self._add_contact(
                joint, markers, joint.clearance - gap_at(self.m, start, joint.name), abs(spin[1] - spin[0])
            )
        else:
            number = self._add_rod(joint, markers)
        self._sense(f"force {joint.name}", self.items.SensorObject, "Force", objectNumber=number)

    def _add_contact(self, joint: Joint, markers: list[Any], separation: float, spin: float) -> Any:
        law, radius = self.laws[joint.name], joint.rim
        if joint.contact_damping is not None:
            impact = {"impactModel": 0, "contactDamping": law.damping}
        else:
            restitution = contact_restitution(self.m, joint, law)
            impact = {
                "impactModel": 2,
                "restitutionCoefficient": restitution,
                "minimumImpactVelocity": MINIMUM_IMPACT_SPEED,
            }
        data = [
            separation,
            spin * radius,
            self._impact_speed(joint, -separation),
            0.0,
        ]  # gap, sliding speed, impact speed
        node = self.mbs.AddNode(self.items.NodeGenericData(initialCoordinates=data, numberOfDataCoordinates=4))
        self.touching.append(joint.name)
        return self.mbs.AddObject(
            self.items.ObjectContactSphereSphere(
                markerNumbers=markers,
                nodeNumber=node,
                spheresRadii=[radius, radius + joint.clearance],
                isHollowSphere1=True,
                contactStiffness=law.stiffness,
                **impact,
                dynamicFriction=joint.friction,
                frictionProportionalZone=CONTACT_CREEP,
            )
        )

    def _impact_speed(self, joint: Joint, depth: float) -> float:
        """Impact speed (m/s) of a pin that starts pressed in by ``depth`` (m): its damping is then the Kelvin-Voigt
        one.
        """
        law = self.laws[joint.name]
        if depth <= 0 or law.damping == 0:
            return 0.0
        return law.stiffness * depth * hysteresis(contact_restitution(self.m, joint, law)) / law.damping

    def _add_one_sided(self, joint: Joint, markers: list[Any]) -> Any:
        """What pushes a pin back beyond its clearance and never pulls: a spring and damper, or a law by name."""
        law = self.named.get(joint.name, self.laws[joint.name])
        memory = None
        if isinstance(law, NamedLaw) and law.hysteresis:
            memory = Memory(self.exu.symbolic, joint.name, law)
        number = self.mbs.AddObject(
            self.items.ObjectConnectorSpringDamper(
                markerNumbers=markers, referenceLength=joint.clearance, stiffness=law.stiffness, damping=law.damping
            )
        )
        self._compile(number, lambda stretch, rate, *_: push_back(self.exu.symbolic, law, memory, stretch, rate))
        if memory is not None:
            self.glances.append(at_pin(self.exu, number, joint.clearance, memory))
        if isinstance(law, NamedLaw) and joint.friction and self.joint_model == "contact":
            self._add_rub(joint, law, memory)
        return number

    def _compile(self, number: Any, force: Callable[..., Any]) -> None:
        """Give a connector a force of its own in a function that Exudyn compiles, by travel, rate, stiffness, damping
        and offset, symbolic.
        """
        from exudyn.utilities import CreateSymbolicUserFunction

        def law(mbs: Any, t: Any, item: Any, travel: Any, rate: Any, k: Any, d: Any, rest: Any) -> Any:
            return force(travel, rate, k, d, rest)

        key = "springForceUserFunction"
        self.mbs.SetObjectParameter(number, key, law)
        self.mbs.SetObjectParameter(number, key, CreateSymbolicUserFunction(self.mbs, law, key, number))

    def _add_rub(self, joint: Joint, law: NamedLaw, memory: Memory | None) -> None:
        """Friction of a pin in its bearing beside a law by name."""
        rim = joint.rim + joint.clearance
        rub = Rub(law, memory, joint.clearance, joint.friction, rim, self._ends(joint))
        number = add_forces(self.exu, self.mbs, self.items, self._moving_nodes(joint), rub.force)
        self.rubs[joint.name] = rub
        self._sense(f"rub {joint.name}", self.items.SensorBody, "Force", bodyNumber=number)

    def _add_block(self, joint: Joint) -> None:
        """The walls of a guide against the corners of its block."""
        moving, law = self.motion == "driven", self.named.get(joint.name, self.laws[joint.name])
        pull = self._effort(joint, moving, self.creep * self.size)
        linear = joint.stiffness, joint.damping if moving else 0.0, joint.rest_angle
        own = (lambda travel, rate: pull(travel, rate, *linear)) if joint.has_law else None
        friction = joint.friction if self.joint_model == "contact" else 0.0
        block = ExudynBlock.of(self.exu, joint, law, self._ends(joint), own, friction)
        nodes = self._moving_nodes(joint)
        number = add_forces(self.exu, self.mbs, self.items, nodes, block.force)
        self.blocks[joint.name] = block
        if block.memories:
            self.glances.append(block.glance(self.exu, nodes))
        self._sense(f"walls {joint.name}", self.items.SensorBody, "Force", bodyNumber=number)

    def _moving_nodes(self, joint: Joint) -> list[Any]:
        return [self.nodes[body] for body in joint.bodies if body != GROUND]

    def _ends(self, joint: Joint) -> tuple[End, End]:
        """A joint's points in the coordinates of :meth:`_moving_nodes`."""
        moving = [body for body in joint.bodies if body != GROUND]
        first, second = (
            End(self.m.ground.point(joint.name), None)
            if body == GROUND
            else End(self.m.body(body).point(joint.name) - self.m.body(body).point(MASS_CENTRE), 3 * moving.index(body))
            for body in joint.bodies
        )
        return first, second

    def _add_rod(self, joint: Joint, markers: list[Any]) -> Any:
        if self.motion == "static":
            return self.mbs.AddObject(
                self.items.ObjectConnectorSpringDamper(
                    markerNumbers=markers, referenceLength=joint.clearance, stiffness=ROD_STIFFNESS
                )
            )
        return self.mbs.AddObject(self.items.ObjectConnectorDistance(markerNumbers=markers, distance=joint.clearance))

    def _add_joint_law(self, joint: Joint) -> None:
        """Friction, damping and spring of a joint.  At rest friction is a load, which ``_loads`` in ``equilibria.py``
        computes and ``ExudynLinkage.load_bodies`` applies.
        """
        moving = self.motion == "driven"
        damping, friction = (joint.damping, joint.coulomb) if moving else (0.0, 0.0)
        nonlinear = joint.cubic or joint.stops or (moving and (joint.drag or joint.stribeck_speed))
        if joint.prismatic:
            if joint.has_law and joint.name not in self.blocks:
                self._add_slide_law(joint, moving, bool(nonlinear or friction))
        elif nonlinear:
            kind = self.items.ObjectConnectorCoordinateSpringDamper
            self._add_own_law(
                joint, moving, self.creep, kind,
                markerNumbers=[self._angle(body) for body in joint.bodies],
                stiffness=joint.stiffness, offset=joint.rest_angle, damping=damping,
            )  # fmt: skip
        elif joint.stiffness or damping or friction:
            self.mbs.AddObject(
                self.items.ObjectConnectorCoordinateSpringDamperExt(
                    markerNumbers=[self._angle(body) for body in joint.bodies],
                    stiffness=joint.stiffness,
                    offset=joint.rest_angle,
                    damping=damping,
                    dynamicFrictionForce=friction,
                    frictionProportionalZone=self.creep if friction else 0.0,
                )
            )

    def _angle(self, body: str) -> Any:
        """Marker of a body's angle."""
        return self._fixed if body == GROUND else self._coordinate(self.nodes[body], 2)

    def _add_slide_law(self, joint: Joint, moving: bool, nonlinear: bool) -> None:
        """Spring and damper along a slide, and by its side what is not linear.  Two connectors: at rest friction is the
        constant ``force`` of the linear one, and one with a function of its own has none.
        """
        kind = self.items.ObjectConnectorLinearSpringDamper
        ends = {
            "markerNumbers": [
                self._marker(body, joint.name, cmath.phase(joint.direction) if k == 0 else 0.0)
                for k, body in enumerate(joint.bodies)
            ],
            "axisMarker0": [1.0, 0.0, 0.0],
        }
        linear = {"stiffness": joint.stiffness, "damping": joint.damping if moving else 0.0}
        number = self.mbs.AddObject(kind(**ends, **linear, offset=joint.rest_angle))
        self.slide_laws[joint.name] = number
        self._sense(f"law {joint.name}", self.items.SensorObject, "ForceLocal", objectNumber=number)
        if nonlinear:
            number = self._add_own_law(joint, moving, self.creep * self.size, kind, **ends, offset=joint.rest_angle)
            self._sense(f"nonlinear {joint.name}", self.items.SensorObject, "ForceLocal", objectNumber=number)

    def _add_own_law(self, joint: Joint, moving: bool, creep: float, kind: Any, **fields: object) -> Any:
        """A connector with a joint's law that is not linear, in a function that Exudyn compiles.  Friction fades where
        the joint is slower than ``creep`` (rad/s; prismatic: m/s).
        """
        number = self.mbs.AddObject(kind(**fields))
        self._compile(number, self._effort(joint, moving, creep))
        return number

    def _effort(self, joint: Joint, moving: bool, creep: float) -> Callable[[Any, Any, Any, Any, Any], Any]:
        """A joint's law: by travel, rate, stiffness, damping and rest, what draws the second body back, symbolic."""
        symbolic, cubic = self.exu.symbolic, joint.cubic
        drag, friction = (joint.drag, joint.coulomb) if moving else (0.0, 0.0)
        over = 2 * stop_step(self.m)  # s, in which a stop's damper sets in: see :meth:`Stop.push`
        excess, fades = (joint.stiction - joint.coulomb, joint.stribeck_speed) if moving else (0.0, None)

        def effort(travel: Any, rate: Any, k: Any, d: Any, rest: Any) -> Any:
            stretch = travel - rest
            force = k * stretch + d * rate
            for stop in joint.stops:
                for way, depth in stop.depths(travel):
                    spring, damping = stop.stiffness * symbolic.max(depth, 0.0), stop.damping if moving else 0.0
                    share = symbolic.min(symbolic.max(depth / (over * symbolic.abs(rate) + TINY) + 0.5, 0.0), 1.0)
                    force = force - way * symbolic.max(spring - share * way * damping * rate, 0.0)
            if cubic:
                force = force + cubic * stretch * stretch * stretch
            if drag:
                force = force + drag * symbolic.abs(rate) * rate
            if friction or fades:
                dry = symbolic.Real(friction)
                if fades:
                    dry = dry + excess * symbolic.exp(-(rate / fades) * (rate / fades))
                force = force + dry * symbolic.max(symbolic.min(rate / creep, 1.0), -1.0)
            return force

        return effort

    def _add_periodic_torque(self) -> None:
        """What turns the driven body over its angle, as a spring of a law of its own."""
        wave = self.m.periodic_torque
        if wave is None:
            return
        ends, sin = [self._fixed, self._angle(self.m.driven)], self.exu.symbolic.sin
        number = self.mbs.AddObject(self.items.ObjectConnectorCoordinateSpringDamper(markerNumbers=ends))
        amplitude, harmonic, phase = wave.amplitude, float(wave.harmonic), wave.phase
        self._compile(number, lambda angle, *_: -amplitude * sin(harmonic * angle + phase))

    def _add_drive(self, start: Mapping[str, Pose], motor: RunMotor | None) -> None:
        if self.motion == "driven" and motor is None:
            return
        connector = self.items.ObjectConnectorCoordinate
        crank = self._coordinate(self.nodes[self.m.driven], 2)
        if motor is None:
            self.drive = self.mbs.AddObject(
                connector(markerNumbers=[self._fixed, crank], offset=start[self.m.driven].angle)
            )
        else:
            stiffness = self.m.drive_stiffness
            self.compliant = stiffness is not None
            turned = self._add_shaft(motor) if self.compliant else crank
            speed = (
                {"offset": float(motor.rate(0.0))}
                if motor.steady
                else {"offsetUserFunction_t": _called(motor.speed_function())}
            )
            self.drive = self.mbs.AddObject(connector(markerNumbers=[self._fixed, turned], velocityLevel=True, **speed))
            if self.compliant:
                spring = self.items.ObjectConnectorCoordinateSpringDamper
                self.drive = self.mbs.AddObject(spring(markerNumbers=[crank, turned], stiffness=stiffness))
        self._sense("drive", self.items.SensorObject, "Force", objectNumber=self.drive)

    def _add_own_drive(self, joint: Joint, motor: RunMotor | None) -> Any:
        """A motor between the two bodies of a joint, or what holds them."""
        speed = None if motor is None else motor.speed_function()
        if joint.prismatic:
            number = self._add_slide_drive(joint, speed)
        else:
            connector, markers = self.items.ObjectConnectorCoordinate, [self._angle(body) for body in joint.bodies]
            moved = {"velocityLevel": True, "offsetUserFunction_t": _called(speed)} if speed else {}
            number = self.mbs.AddObject(connector(markerNumbers=markers, **moved))
        self._sense(f"drive {joint.name}", self.items.SensorObject, "Force", objectNumber=number)
        return number

    def _add_slide_drive(self, joint: Joint, speed: Callable[[float], float] | None) -> Any:
        """A motor along a slide: Exudyn's own joints cannot be moved where constraints are on velocity."""
        slide = Slide(joint.direction, self._ends(joint))
        coordinates = self.items.MarkerNodeCoordinates
        markers = [
            self.mbs.AddMarker(coordinates(nodeNumber=self._ground_node if body == GROUND else self.nodes[body]))
            for body in joint.bodies
        ]
        sizes = {f"scalingMarker{k}": np.zeros((1, 3)) for k, body in enumerate(joint.bodies) if body != GROUND}
        asked = slide.at_speed(speed) if speed else slide.at_rest(lambda: self.held[joint.name])
        return self.mbs.AddObject(
            self.items.ObjectConnectorCoordinateVector(
                markerNumbers=markers, **sizes, offset=[0.0],
                constraintUserFunction=asked, jacobianUserFunction=slide.jacobian(),
            )
        )  # fmt: skip

    def hold(self, start: Mapping[str, Pose]) -> None:
        """Hold what is held where it is in these poses."""
        if self.drives is None:
            if self.drive is not None:
                self.mbs.SetObjectParameter(self.drive, "offset", start[self.m.driven].angle)
            return
        if self.motion == "driven":
            return
        placed = {GROUND: AT_REST, **start}
        for name, number in self.drives.items():
            joint = self.m.joint(name)
            self.held[name], _ = travel(self.m, joint, *(placed[body] for body in joint.bodies))
            if not joint.prismatic:
                self.mbs.SetObjectParameter(number, "offset", self.held[name])

    def _add_shaft(self, motor: RunMotor) -> Any:
        """The motor's shaft, whose inertia its prescribed motion makes immaterial; marker of its angle."""
        angle, speed = float(motor.angle(0.0)), float(motor.rate(0.0))
        shaft = self.mbs.AddNode(self.items.Node1D(initialCoordinates=[angle], initialVelocities=[speed]))
        self.mbs.AddObject(self.items.ObjectRotationalMass1D(physicsInertia=1.0, nodeNumber=shaft))
        return self._coordinate(shaft, 0)


def _called(speed: Callable[[float], float]) -> Callable[[Any, float, int, float], float]:
    """A motor's speed as Exudyn asks for it."""
    return lambda mbs, t, item, offset: speed(t)


def point_at(mechanism: Mechanism, start: Mapping[str, Pose], body: str, point: str) -> complex:
    """A named point of a body in a pose (m, ground frame)."""
    if body == GROUND:
        return mechanism.ground.point(point)
    return start[body].origin + mechanism.body(body).point(point) * cmath.exp(1j * start[body].angle)


def gap_at(mechanism: Mechanism, start: Mapping[str, Pose], joint: str) -> float:
    """Distance (m) between a joint's two pin centres in these poses."""
    first, second = (point_at(mechanism, start, body, joint) for body in mechanism.joint(joint).bodies)
    return abs(first - second)
