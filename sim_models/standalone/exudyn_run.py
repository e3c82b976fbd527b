"""A linkage with clearance in bare Exudyn: `python run.py` needs exudyn and numpy, and nothing else.

model.json    bodies, loads, joints, springs and drives, each to become an Exudyn item; how the linkage starts, and how
              it is stepped
expected.csv  what the cross-check got; this script writes its own to signals.csv and prints the largest differences

Numbers in model.json are in its "units", of m, kg and s each, which are 1 unless the linkage is far too large or small
for a solver's tolerances; signals are in SI units, and angles in rad.  reaction_<joint> is the force of the joint's
first body on its second.  A body's node is at its centre of mass, and its points are measured from there, "com" too: it
is where <body>_x and <body>_y are taken.
What closes a joint:
    pin             an ideal joint (RevoluteJoint2D)
    soft bearing    a spring and damper between the two pin centres (CartesianSpringDamper)
    slide           a prismatic joint, along the x axis of its two markers
    massless link   a constraint on the distance between the two pin centres, the clearance: it pulls and pushes, and on
                    velocity (index 2), as all constraints here, it keeps the distance of the start
    stiff rod       the same at rest, but a spring of 1e10 N/m: Exudyn's static solver overlooks how a constraint's
                    force turns
    spring-damper   between the pin centres; beyond the clearance it pulls with max(0, K d + C d'), within it is slack
    contact         a journal in its bearing: one sphere in another, hollow one
What moves or holds the linkage is "drive", which turns one crank, or "drives", each between the two bodies of its
joint; where there are none it moves freely.  Where joints hold a loop more than once ("redundant"), statics does not
determine every reaction: of those that balance, Exudyn's solver takes one.
"""

from __future__ import annotations

import cmath
import json
import math
import sys
from bisect import bisect
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import mul
from typing import Any

import exudyn
import exudyn.itemInterface as item
import numpy as np
from exudyn.utilities import CreateSymbolicUserFunction

from sim_models.standalone.alike import HERE, against, compare, share

Signals = dict[str, np.ndarray]
Speed = Callable[[float], float]  # over time
Travel = tuple[float, list[float]]  # with its derivative by coordinates
exu: Any = exudyn  # whose stubs leave out its symbolic functions


class System:
    """Exudyn's system, built item by item, with a sensor on every body, joint and drive."""

    def __init__(self) -> None:
        self.model = json.loads((HERE / "model.json").read_text(encoding="utf-8"))
        self.bodies, self.joints, self.static = (
            self.model["bodies"],
            self.model["joints"],
            self.model["motion"] == "static",
        )
        self.length, mass, self.time = (self.model["units"][of] for of in ("length", "mass", "time"))  # in SI
        self.force, self.torque = mass * self.length / self.time**2, mass * self.length**2 / self.time**2
        self.points = {name: body["points"] for name, body in {"ground": self.model["ground"], **self.bodies}.items()}
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.object: dict[str, Any] = {"ground": self.mbs.AddObject(item.ObjectGround())}
        self.node: dict[str, Any] = {}
        self.heading: dict[str, list[float]] = {}  # at rest: of each body in the motion that loads oppose
        self.sensor: dict[str, Any] = {}
        self.law: dict[str, Any] = {}  # of slides
        self.motors: dict[str, Any] = {}  # between bodies
        self.held: dict[str, float] = {}  # where each of them holds its joint at rest
        self.node["ground"] = self.mbs.AddNode(item.NodePointGround())
        self.still = self.coordinate(self.node["ground"], 0)
        for name, body in self.bodies.items():
            self.add_body(name, body)
        self.loads = [self.add_load(**load) for load in self.model["loads"]]  # first the weights, one for each body
        for name, joint in self.joints.items():
            self.add_slide(name, joint) if joint["closed_by"] == "slide" else self.add_pin(name, joint)
        if self.model["periodic_torque"]:
            self.add_wave(**self.model["periodic_torque"])
        for spring in self.model["springs"]:
            self.add_spring(**spring)
        self.motor = self.add_drive(**self.model["drive"]) if self.model["drive"] else None
        for name, drive in self.model["drives"].items():
            self.motors[name] = self.add_own_drive(name, self.joints[name], drive["course"])
        self.mbs.Assemble()

    def add_body(self, name: str, body: Mapping[str, Any]) -> None:
        """A body, with its node at its centre of mass."""
        node = self.mbs.AddNode(item.NodeRigidBody2D(initialCoordinates=body["start"], initialVelocities=body["rates"]))
        self.object[name] = self.mbs.AddObject(
            item.ObjectRigidBody2D(mass=body["mass"], inertia=body["inertia"], nodeNumber=node)
        )
        self.sense(f"place {name}", item.SensorNode, "Coordinates", nodeNumber=node)
        self.sense(f"speed {name}", item.SensorNode, "Coordinates_t", nodeNumber=node)
        self.node[name] = node

    def coordinate(self, node: Any, number: int) -> Any:
        """Marker of a node's coordinate."""
        return self.mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate=number))

    def angle(self, body: str) -> Any:
        """Marker of a body's angle."""
        return self.still if body == "ground" else self.coordinate(self.node[body], 2)

    def marker(self, body: str, point: str, turn: float = 0.0) -> Any:
        """Marker at a body's point, its axes turned in the body."""
        c, s, (x, y) = math.cos(turn), math.sin(turn), self.points[body][point]
        place = np.array([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]])
        return self.mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=self.object[body], localHT=place))

    def sense(self, name: str, kind: Any, variable: str, **where: Any) -> None:
        """Record a variable in every step."""
        of = getattr(exu.OutputVariableType, variable)
        self.sensor[name] = self.mbs.AddSensor(
            kind(**where, storeInternal=True, writeToFile=False, outputVariableType=of)
        )

    def add_load(
        self, body: str, point: str, force: list[float], torque: float, varies: Mapping[str, Any] | None = None
    ) -> tuple[Any, Any]:
        """A force fixed in direction, and a torque; of those that vary as much as acts at the time."""
        at = self.marker(body, point)
        push = self.mbs.AddLoad(item.LoadForceVector(markerNumber=at, loadVector=[*force, 0.0]))
        turn = self.mbs.AddLoad(item.LoadTorqueVector(markerNumber=at, loadVector=[0.0, 0.0, torque]))
        if varies:

            def acting(t: float) -> tuple[complex, float]:
                part = share(varies, partial(self.where, t))
                if not varies["opposes"]:
                    return complex(*force) * part, torque * part
                u, v, spin = self.going(body)
                velocity = complex(u, v) + 1j * spin * self.arm(body, point)
                return against(complex(*force) * part, torque * part, velocity, spin, varies["fades"])

            def pushed(mbs: Any, t: float, vector: Any) -> list[float]:
                return [acting(t)[0].real, acting(t)[0].imag, 0.0]

            def turned(mbs: Any, t: float, vector: Any) -> list[float]:
                return [0.0, 0.0, acting(t)[1]]

            self.mbs.SetLoadParameter(push, "loadVectorUserFunction", pushed)
            self.mbs.SetLoadParameter(turn, "loadVectorUserFunction", turned)
        return push, turn

    def where(self, t: float, over: Mapping[str, str]) -> float:
        """What a load varies over, at a time."""
        kind = over["kind"]
        if kind == "time":
            return t - self.model["time_0"]
        if kind == "travel":
            slide = self.joints[over["joint"]]
            q = [x for body in slide["bodies"] if body != "ground" for x in self.state(body)]
            return self.travel(over["joint"], slide)(q)[0]
        if kind == "angle":
            second, first = (self.state(b)[2] if b != "ground" else 0.0 for b in (over["body"], over["less"]))
            return second - first
        x, y, _ = self.state(over["body"])
        at = complex(x, y) + self.arm(over["body"], "com")
        return at.real if kind == "x" else at.imag

    def state(self, body: str, kind: str = "Coordinates", when: Any = exu.ConfigurationType.Current) -> list[float]:
        """A body's x, y and angle, or their rates."""
        of = getattr(exu.OutputVariableType, kind)
        return list(map(float, self.mbs.GetNodeOutput(self.node[body], of, configuration=when)))

    def arm(self, body: str, point: str) -> complex:
        """From a body's centre of mass to its point."""
        return complex(*self.points[body][point]) * cmath.exp(1j * self.state(body)[2])

    def going(self, body: str) -> list[float]:
        """Velocity of a body's centre of mass and its angular velocity; at rest as the drives would go on, and of the
        begin of a step where a gap lets it go.
        """
        when = exu.ConfigurationType.StartOfStep if self.model["let_go"] else exu.ConfigurationType.Current
        return self.heading[body] if self.heading else self.state(body, "Coordinates_t", when)

    def add_pin(self, name: str, joint: Mapping[str, Any]) -> None:
        """What closes a revolute joint; then the spring, damper and dry friction that it has besides."""
        numbers = {"markerNumbers": [self.marker(body, name) for body in joint["bodies"]], **joint["parameters"]}
        if "remembered" in joint:  # by a contact, from step to step: gap, sliding speed, speed of impact
            numbers["nodeNumber"] = self.mbs.AddNode(
                item.NodeGenericData(initialCoordinates=joint["remembered"], numberOfDataCoordinates=4)
            )
        closure = self.mbs.AddObject(getattr(item, joint["item"])(**numbers))
        if joint["closed_by"] == "spring-damper":

            def pull(mbs: Any, t: Any, number: Any, stretch: Any, rate: Any, k: Any, d: Any, force: Any) -> Any:
                return exu.symbolic.IfThenElse(
                    stretch > 0.0, exu.symbolic.max(k * stretch + d * rate, 0.0), exu.symbolic.Real(0.0)
                )

            self.set_force(closure, pull)
        self.sense(f"force {name}", item.SensorObject, "Force", objectNumber=closure)
        if "law" in joint:
            angles = [self.angle(body) for body in joint["bodies"]]
            curved = "curved" in joint
            plain = item.ObjectConnectorCoordinateSpringDamperExt
            kind = item.ObjectConnectorCoordinateSpringDamper if curved else plain
            law = self.mbs.AddObject(kind(markerNumbers=angles, **joint["law"]))
            if curved:
                self.bend(law, **joint["curved"])

    def add_slide(self, name: str, joint: Mapping[str, Any]) -> None:
        """A prismatic joint, and the spring, damper and dry friction along it; friction fades below the creep speed."""
        (first, second), along, angle = joint["bodies"], joint["direction"], joint["angle"]
        ends = [self.marker(first, name, along), self.marker(second, name, along - angle)]
        slide = self.mbs.AddObject(item.ObjectJointGeneric(markerNumbers=ends, constrainedAxes=[0, 1, 0, 0, 0, 1]))
        self.sense(f"force {name}", item.SensorObject, "ForceLocal", objectNumber=slide)
        self.sense(f"moment {name}", item.SensorObject, "TorqueLocal", objectNumber=slide)
        if "law" not in joint:
            return
        ends, kind = (
            [self.marker(first, name, along), self.marker(second, name)],
            item.ObjectConnectorLinearSpringDamper,
        )
        self.law[name] = self.mbs.AddObject(kind(markerNumbers=ends, axisMarker0=[1.0, 0.0, 0.0], **joint["law"]))
        self.sense(f"law {name}", item.SensorObject, "ForceLocal", objectNumber=self.law[name])
        if "curved" in joint:
            rest = joint["law"]["offset"]
            law = self.mbs.AddObject(kind(markerNumbers=ends, axisMarker0=[1.0, 0.0, 0.0], offset=rest))
            self.bend(law, **joint["curved"])
            self.sense(f"curved {name}", item.SensorObject, "ForceLocal", objectNumber=law)

    def bend(
        self,
        number: Any,
        cubic: float,
        drag: float,
        friction: float,
        static: float,
        stribeck_speed: float,
        creep: float,
        stops: Sequence[Sequence[float]],
    ) -> None:
        """Add to a joint's spring and damper what is not linear, its stops, each a spring and damper that push back
        beyond where it is and never pull, and its dry friction, which fades below the creep speed; with a Stribeck
        speed it falls from static friction to that of fast slip.
        """
        least, most, size = exu.symbolic.min, exu.symbolic.max, exu.symbolic.abs

        def law(mbs: Any, t: Any, number: Any, travel: Any, rate: Any, k: Any, d: Any, rest: Any) -> Any:
            stretch = travel - rest
            force = k * stretch + d * rate
            for way, place, stiffness, damping, over in stops:
                depth = way * (place - travel)
                share = least(most(depth / (over * size(rate) + 1e-300) + 0.5, 0.0), 1.0)
                force = force - way * most(stiffness * most(depth, 0.0) - share * way * damping * rate, 0.0)
            if cubic:
                force = force + cubic * stretch * stretch * stretch
            if drag:
                force = force + drag * size(rate) * rate
            if friction or stribeck_speed:
                dry = exu.symbolic.Real(friction)
                if stribeck_speed:
                    slow = exu.symbolic.exp(-(rate / stribeck_speed) * (rate / stribeck_speed))
                    dry = dry + (static - friction) * slow
                force = force + dry * most(least(rate / creep, 1.0), -1.0)
            return force

        self.set_force(number, law)

    def add_wave(self, body: str, amplitude: float, harmonic: int, phase: float) -> None:
        """A torque over a body's angle, as a spring of a law of its own."""

        def law(mbs: Any, t: Any, number: Any, angle: Any, rate: Any, k: Any, d: Any, rest: Any) -> Any:
            return -amplitude * exu.symbolic.sin(float(harmonic) * angle + phase)

        ends = [self.still, self.angle(body)]
        self.set_force(self.mbs.AddObject(item.ObjectConnectorCoordinateSpringDamper(markerNumbers=ends)), law)

    def add_spring(self, ends: list[list[str]], length: float, stiffness: float, damping: float) -> None:
        """A spring and damper between points of two bodies."""
        markers = [self.marker(body, point) for body, point in ends]
        self.mbs.AddObject(
            item.ObjectConnectorSpringDamper(
                markerNumbers=markers, referenceLength=length, stiffness=stiffness, damping=damping
            )
        )

    def set_force(self, number: Any, force: Any) -> None:
        """Give a connector a force of its own, compiled by Exudyn."""
        compiled = CreateSymbolicUserFunction(self.mbs, force, "springForceUserFunction", number)
        self.mbs.SetObjectParameter(number, "springForceUserFunction", compiled)

    def add_drive(
        self,
        offset: float = 0.0,
        course: dict[str, Any] | None = None,
        shaft: list[float] | None = None,
        stiffness: float = 0.0,
    ) -> Any:
        """The motor holds the crank at an angle (at rest), or turns it at a speed or along a course; or a shaft that
        has a spring to the crank.
        """
        crank = held = self.angle(self.model["crank"])
        if shaft is not None:
            node = self.mbs.AddNode(item.Node1D(initialCoordinates=shaft[:1], initialVelocities=shaft[1:]))
            self.mbs.AddObject(item.ObjectRotationalMass1D(physicsInertia=1.0, nodeNumber=node))
            held = self.coordinate(node, 0)
            self.sense("shaft", item.SensorNode, "Coordinates", nodeNumber=node)
        moved = {"offsetUserFunction_t": called(speed_along(**course))} if course else {"offset": offset}
        holding = item.ObjectConnectorCoordinate(
            markerNumbers=[self.still, held], velocityLevel=not self.static, **moved
        )
        motor = self.mbs.AddObject(holding)
        if shaft is not None:
            motor = self.mbs.AddObject(
                item.ObjectConnectorCoordinateSpringDamper(markerNumbers=[crank, held], stiffness=stiffness)
            )
        self.sense("drive", item.SensorObject, "Force", objectNumber=motor)
        return motor

    def add_own_drive(self, name: str, joint: Mapping[str, Any], course: dict[str, Any] | None) -> Any:
        """A motor between the two bodies of a joint, which turns or pushes the second along a course, or holds it."""
        bodies, speed = joint["bodies"], speed_along(**course) if course else None
        if joint["closed_by"] == "slide":
            motor = self.mbs.AddObject(self.pusher(name, bodies, self.travel(name, joint), speed))
        else:
            moved = {"velocityLevel": True, "offsetUserFunction_t": called(speed)} if speed else {}
            ends = [self.angle(body) for body in bodies]
            motor = self.mbs.AddObject(item.ObjectConnectorCoordinate(markerNumbers=ends, **moved))
        self.sense(f"drive {name}", item.SensorObject, "Force", objectNumber=motor)
        return motor

    def pusher(
        self, name: str, bodies: list[str], travel: Callable[[Sequence[float]], Travel], speed: Speed | None
    ) -> Any:
        """A constraint on a slide's travel, that it changes at a speed or is where it is held: Exudyn's own prismatic
        joints cannot be moved where constraints are on velocity.
        """

        def wrong(mbs: Any, t: float, number: int, q: Sequence[float], rate: Sequence[float], on_rate: bool) -> Any:
            where, gradient = travel(q)
            return [sum(map(mul, gradient, rate)) - speed(t) if speed else where - self.held[name]]

        def jacobian(mbs: Any, t: float, number: int, q: Sequence[float], rate: Sequence[float], on_rate: bool) -> Any:
            return [travel(q)[1]]

        moving = [f"scalingMarker{k}" for k, body in enumerate(bodies) if body != "ground"]
        ends = [self.mbs.AddMarker(item.MarkerNodeCoordinates(nodeNumber=self.node[body])) for body in bodies]
        return item.ObjectConnectorCoordinateVector(
            markerNumbers=ends,
            **dict.fromkeys(moving, np.zeros((1, 3))),
            offset=[0.0],
            constraintUserFunction=wrong,
            jacobianUserFunction=jacobian,
        )

    def travel(self, name: str, joint: Mapping[str, Any]) -> Callable[[Sequence[float]], Travel]:
        """Travel along a slide, and its derivative by x, y and angle of each of its bodies that moves."""
        first, second = (body != "ground" for body in joint["bodies"])
        along = cmath.exp(1j * joint["direction"])
        near, far = (complex(*self.points[body][name]) for body in joint["bodies"])

        def travel(q: Sequence[float]) -> Travel:
            x, y, angle = q[:3] if first else (0.0, 0.0, 0.0)
            u, v, turn = q[-3:] if second else (0.0, 0.0, 0.0)
            axis, arm = along * cmath.exp(1j * angle), far * cmath.exp(1j * turn)
            seen = complex(u - x, v - y) + arm  # the second body's point, from the first's centre
            gradient = [-axis.real, -axis.imag, (axis.conjugate() * seen).imag] if first else []
            gradient += [axis.real, axis.imag, -(axis.conjugate() * arm).imag] if second else []
            return (axis.conjugate() * seen).real - (along.conjugate() * near).real, gradient

        return travel

    def settings(self) -> Any:
        """Trapezoidal rule with constraints on velocity (index 2); at rest, Newton's method in one go.  No files."""
        s = exu.SimulationSettings()
        s.solution.file.write, s.solution.sensors.writePeriod = False, 0.0
        s.timeIntegration.generalizedAlpha.useIndex2Constraints = s.timeIntegration.generalizedAlpha.useNewmark = True
        s.timeIntegration.adaptiveStep, s.timeIntegration.discontinuous.useRecommendedStepSize = True, False
        s.staticSolver.useLoadFactor = s.staticSolver.adaptiveStep = False
        s.staticSolver.newton.maxIterations, s.staticSolver.newton.relativeTolerance = 100, 1e-12
        s.staticSolver.newton.absoluteTolerance = self.model["residual"]
        s.staticSolver.discontinuous.maxIterations, s.staticSolver.discontinuous.ignoreMaxIterations = 20, False
        if self.model["redundant"]:  # joints hold a loop more than once: what says nothing new is left out
            s.linearSolver.solverType, s.linearSolver.ignoreSingularJacobian = exu.LinearSolverType.EigenDense, True
        return s

    def stage(self, begin: float, end: float, steps: int, onward: bool) -> Any:
        """Settings for a number of equal steps, shorter where Newton's method stumbles over a contact.

        Steps ``onward`` start with the accelerations of the one before, which Exudyn does not know of a course.  No
        steps are a short one that settles what accelerations are: as Newmark's gamma of 1 has it, they are its change
        of velocity.
        """
        s = self.settings()
        time = s.timeIntegration
        time.startTime, time.endTime, time.numberOfSteps = begin, end, max(steps, 1)
        newmark = time.generalizedAlpha
        newmark.computeInitialAccelerations = bool(steps) and not onward
        if steps:
            time.minimumStepSize = (end - begin) / steps / self.model["halved"]
        else:
            newmark.newmarkBeta, newmark.newmarkGamma = 0.5, 1.0
        if onward:
            time.newton.relativeTolerance, time.newton.absoluteTolerance = 1e-12, self.model["residual"]
        return s

    def driven(self) -> Signals:
        """Step through every stage; the signals after those of them for which model.json asks."""
        parts: list[Signals] = []
        for stage in self.model["stages"]:
            if not self.mbs.SolveDynamic(self.stage(*stage), updateInitialValues=True, storeSolver=False):
                sys.exit(f"Exudyn gave up between {stage[0]} and {stage[1]} s")
            stored = {
                name: np.asarray(self.mbs.GetSensorStoredData(number))[bool(parts) :]
                for name, number in self.sensor.items()
            }
            parts.append(
                self.signals(
                    {name: values[:, 1:] for name, values in stored.items()}, next(iter(stored.values()))[:, 0]
                )
            )
        run = joined(parts)
        last = np.array(
            [0, *np.cumsum([part["time"].size for part in parts]) - 1]
        )  # row of the start, and the last of every stage
        return {name: values[last[self.model["after_stage"]]] for name, values in run.items()}

    def equilibria(self) -> Signals:
        """The signals of every equilibrium, found anew from where the bodies are put."""
        parts, initial = [], exu.ConfigurationType.Initial
        for row, near in enumerate(self.model["equilibria"]):
            self.mbs.systemData.SetODE2Coordinates(near["bodies"], initial)
            self.mbs.systemData.SetDataCoordinates(near["remembered"], initial)
            self.hold(near)
            self.heading = near["heading"]
            for (push, turn), (x, y, torque) in zip(
                self.loads, near["loads"], strict=False
            ):  # weight, friction and damping
                self.mbs.SetLoadParameter(push, "loadVector", [x, y, 0.0])
                self.mbs.SetLoadParameter(turn, "loadVector", [0.0, 0.0, torque])
            for name, force in near["slides"].items():
                self.mbs.SetObjectParameter(self.law[name], "force", force)
            if not any(self.at_rest(difference) for difference in (1e-7, 1e-8, 1e-9, 1e-10)):
                sys.exit(f"Exudyn finds no equilibrium for row {row} of expected.csv")
            now = {
                name: np.atleast_2d(np.asarray(self.mbs.GetSensorValues(number)))
                for name, number in self.sensor.items()
            }
            parts.append(self.signals(now, np.array([near.get("time", 0.0)])))
        return joined(parts)

    def hold(self, near: Mapping[str, Any]) -> None:
        """Hold the crank at its angle, or every driven joint where it is to be."""
        if self.motor is not None:
            self.mbs.SetObjectParameter(self.motor, "offset", near["crank_angle"])
        self.held = near.get("held", {})
        for name, where in self.held.items():
            if self.joints[name]["closed_by"] != "slide":
                self.mbs.SetObjectParameter(self.motors[name], "offset", where)

    def at_rest(self, difference: float) -> bool:
        """Newton's method, contacts differentiated by steps of that size (of a coordinate), which have to be smaller
        than they are deep.
        """
        s = self.settings()
        s.staticSolver.newton.numericalDifferentiation.relativeEpsilon = difference
        try:
            return bool(self.mbs.SolveStatic(s, storeSolver=False))
        except exu.exudynCPP.SolverError:
            return False

    def signals(self, seen: Mapping[str, np.ndarray], time: np.ndarray) -> Signals:
        """All signals in SI, from the sensors; their time is 0 when Exudyn's is ``time_0``.

        A constraint's force has one sign in Exudyn's static solver, the other in its dynamic one.
        """
        sign = 1.0 if self.static else -1.0
        out = self.crank(seen, sign) if self.model["crank"] else {}
        out["time"] = (time - self.model["time_0"]) * self.time
        for name, drive in self.model["drives"].items():
            size = self.force if self.joints[name]["closed_by"] == "slide" else self.torque
            out[drive["signal"]] = drive["sign"] * size * sign * seen[f"drive {name}"][:, 0]
        centre, turn = (
            {"ground": np.zeros(1, complex)},
            {"ground": np.ones(1, complex)},
        )  # the plane's vectors are complex, x + iy
        for body in self.bodies:
            (x, y, angle), rate = seen[f"place {body}"].T, seen[f"speed {body}"][:, 2]
            centre[body], turn[body] = x + 1j * y, np.exp(1j * angle)
            com = centre[body] + complex(*self.points[body]["com"]) * turn[body]
            out |= {
                f"{body}_x": self.length * com.real,
                f"{body}_y": self.length * com.imag,
                f"{body}_angle": angle,
                f"{body}_angular_velocity": rate / self.time,
            }
        for name, joint in self.joints.items():
            first, second = (centre[body] + complex(*self.points[body][name]) * turn[body] for body in joint["bodies"])
            value, how, gap = seen[f"force {name}"], joint["closed_by"], first - second
            axis = np.exp(1j * joint.get("direction", 0.0)) * turn[joint["bodies"][0]]
            if not self.model["crank"]:  # joints tell where the linkage is
                start, end = (out.get(f"{body}_angle", np.zeros(time.size)) for body in joint["bodies"])
                travel = -self.length * (gap * axis.conj()).real
                out[f"position_{name}"] = travel if how == "slide" else end - start
            if how == "slide":
                axial = -sum(seen[law][:, 0] for law in (f"law {name}", f"curved {name}") if law in seen)
                if name in self.model["drives"]:
                    axial = axial + sign * seen[f"drive {name}"][:, 0]
                force = (axial + 1j * sign * value[:, 1]) * axis
                out[f"reaction_{name}_moment"] = -self.torque * sign * seen[f"moment {name}"][:, 2]
            elif how == "massless link":  # its force is the tension
                force = value[:, 0] * gap / np.abs(gap)
            else:
                force = (sign if how == "pin" else -1.0) * (value[:, 0] + 1j * value[:, 1])
            for vector, signal in ((self.force * force, "reaction"), (self.length * gap, "clearance")):
                out |= {f"{signal}_{name}_x": vector.real, f"{signal}_{name}_y": vector.imag}
        return out

    def crank(self, seen: Mapping[str, np.ndarray], sign: float) -> Signals:
        """A crank's angle, or of one that is turned evenly through a spring its shaft's, and its motor's torque."""
        drive, angle = self.model["drive"], seen[f"place {self.model['crank']}"][:, 2]
        if drive is None:
            return {"crank_angle": angle, "drive_torque": np.zeros(angle.size)}
        if "shaft" in drive:
            behind = angle if "course" in drive else seen["shaft"][:, 0]
            return {"crank_angle": behind, "drive_torque": self.torque * seen["drive"][:, 0]}
        return {"crank_angle": angle, "drive_torque": self.torque * sign * seen["drive"][:, 0]}


def speed_along(times: list[float], cubics: list[list[float]]) -> Speed:
    """Speed over time along a course: from each of the times on the position is a cubic in what has passed since, its
    highest power first.
    """
    inner, rates = times[1:-1], [(3.0 * a, 2.0 * b, c) for a, b, c, _ in cubics]

    def speed(time: float) -> float:
        k = bisect(inner, time)
        (a, b, c), passed = rates[k], time - times[k]
        return (a * passed + b) * passed + c

    return speed


def called(speed: Speed) -> Callable[[Any, float, int, float], float]:
    """A speed over time as Exudyn asks for it."""
    return lambda mbs, t, number, offset: speed(t)


def joined(parts: list[Signals]) -> Signals:
    """Signals one part after the other."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def main() -> None:
    """Run, write signals.csv, and say how far it is from expected.csv."""
    exu.config.printToConsole = False
    system = System()
    found = system.equilibria() if system.static else system.driven()
    compare(system.model, f"Exudyn {exu.__version__}", found)


if __name__ == "__main__":
    main()
