"""A linkage with clearance in bare PyBullet: `python run.py` needs pybullet and numpy, and nothing else.

<part>.urdf   bodies that hang on the ground in a tree of hinges and slides; one that floats has two weightless slides
              and a hinge
start.json    the solver's settings, the point constraints that close loops, loads, springs, joint laws, clearances, the
              motors (a course is a cubic spline, highest power first, from each piece's first time), and the runs
expected.csv  what the cross-check got; this script writes its own to signals.csv and prints the largest differences

Numbers are in the "units" of start.json, of m, kg and s each, which are 1 unless the linkage is far too large or small
for a solver's tolerances; signals are in SI units and rad.  A vector in the plane is complex, x + iy; reaction_<joint>
is the force of the joint's first body on its second.  What holds a joint together:
    tree           a joint of a URDF; its force is what Newton and Euler leave over (PyBullet's sensors are wrong in
                   longer chains)
    constraint     one of Bullet's point constraints
    strut          a URDF of its own between the pins, as long as the clearance, or (contact) with a limit there
    spring-damper  beyond the clearance max(0, K d + C d') along the gap, applied here as an external force in each step
    soft bearing   K times the gap and C times its rate, applied in the same way
Bullet steps v += a h; x += v h.  A moving run reads that as a leapfrog: velocities belong to half a step before
positions.  Its steps are equal; what is asked for between two of them follows from four by a cubic.  Bullet reckons
Coriolis and centrifugal forces with those older velocities; forces at the centres of mass make up for that where what
moves freely would be led astray ("puts_right").
"""

from __future__ import annotations

import json
import math
from bisect import bisect_right
from cmath import exp
from collections.abc import Iterator, Mapping
from functools import partial
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np
import pybullet as p

from sim_models.standalone.alike import HERE, against, compare, share, stopped


class Link(NamedTuple):
    """A link of a multibody, and the joint that carries it, as Bullet tells them."""

    at: tuple[int, int]  # Bullet's numbers
    parent: str
    mass: float
    inertia: float
    com: complex  # in the link's frame, which is its joint's
    slides: complex | None  # direction, in the link's frame
    fixed_angle: float  # angle from its parent where the joint is at zero


class LinkState(NamedTuple):
    """Where a link is: its com, its joint's frame, its angle (in full turns, too), and the com's velocity and
    the spin.
    """

    com: complex = 0j
    hinge: complex = 0j
    angle: float = 0.0
    velocity: complex = 0j
    spin: float = 0.0


class Rates(NamedTuple):
    """How a link moves: its com's velocity and acceleration, its angular velocity and acceleration."""

    velocity: complex = 0j
    acceleration: complex = 0j
    spin: float = 0.0
    spin_up: float = 0.0


class World:
    """The linkage in PyBullet; its links are in the order of their trees, parents first."""

    def __init__(self) -> None:
        self.start: dict[str, Any] = json.loads((HERE / "start.json").read_text(encoding="utf-8"))
        self.length, mass, self.time = (self.start["units"][of] for of in ("length", "mass", "time"))  # in SI
        self.newton, self.torque = mass * self.length / self.time**2, mass * self.length**2 / self.time**2
        self.joints, self.bodies, self.motors = (self.start[what] for what in ("joints", "bodies", "motors"))
        self.static = self.start["motion"] == "static"
        self.links: dict[str, Link] = {}
        p.connect(p.DIRECT)
        p.setPhysicsEngineParameter(
            enableFileCaching=0, constraintSolverType=getattr(p, self.start["solver"]), **self.start["physics"]
        )
        p.setGravity(*self.start["gravity"], 0)
        for part in self.start["parts"]:
            self.load(part)
        numbers = [self.constrain(**how["between"]) for how in self.start["constraints"]]
        self.carriers = {
            n: how["carries"] for n, how in zip(numbers, self.start["constraints"], strict=True) if how["carries"]
        }
        self.trailing = 0.0  # s by which velocities trail positions
        self.motor_torque = 0.0  # on a crank that its motor does not hold
        self.late: np.ndarray | None = None  # the joints' velocities as Bullet had them a step ago
        for link, motor in self.motors.items():
            self.run_motor(link, motor["speed"])

    def load(self, part: str) -> None:
        """Load a URDF.  PyBullet would take moments of inertia from collision shapes, and damp and brake the joints:
        none of that here.
        """
        body = p.loadURDF(str(HERE / f"{part}.urdf"), useFixedBase=True, flags=p.URDF_USE_INERTIA_FROM_FILE)
        names = {-1: "ground"}
        for k in range(p.getNumJoints(body)):
            p.changeDynamics(body, k, linearDamping=0, angularDamping=0, jointDamping=0)
            p.changeDynamics(body, k, maxJointVelocity=self.start["fastest"])
            p.setJointMotorControl2(body, k, p.VELOCITY_CONTROL, force=0)
            joint, dynamics = p.getJointInfo(body, k), p.getDynamicsInfo(body, k)
            names[k] = joint[12].decode()
            slides = complex(*joint[13][:2]) if joint[2] == p.JOINT_PRISMATIC else None
            fixed_angle = self.start["fixed_angles"].get(names[k], 0.0)  # Bullet tells none beyond half a turn
            self.links[names[k]] = Link(
                (body, k), names[joint[16]], dynamics[0], dynamics[2][2], complex(*dynamics[3][:2]), slides, fixed_angle
            )

    def run_motor(self, link: str, speed: float) -> None:
        """Let the motor in the joint that carries a link run at a speed."""
        p.setJointMotorControl2(
            *self.links[link].at, p.VELOCITY_CONTROL, targetVelocity=speed, force=self.start["strength"]
        )

    def constrain(self, first: str, second: str, pivots: list[list[float]]) -> int:
        """Hold a point of one link and a point of another together, each given from its link's com."""
        ends = [self.links[name].at if name != "ground" else (-1, -1) for name in (first, second)]
        number = p.createConstraint(
            *ends[0], *ends[1], p.JOINT_POINT2POINT, [0, 0, 0], *([*point, 0] for point in pivots)
        )
        p.changeConstraint(number, maxForce=self.start["strength"])
        return number

    def coordinates(self) -> np.ndarray:
        """Position and velocity of every link's joint, in two rows."""
        return np.array([p.getJointState(*link.at)[:2] for link in self.links.values()]).T

    def look(self) -> None:
        """See where everything is.  Unless asked for it, Bullet would apply forces where the links were a step ago."""
        self.places = {"ground": LinkState()}
        for (name, link), turned in zip(self.links.items(), self.coordinates()[0], strict=True):
            com, *_, velocity, spin = p.getLinkState(*link.at, computeLinkVelocity=True, computeForwardKinematics=True)
            angle = self.places[link.parent].angle + link.fixed_angle + (turned if link.slides is None else 0.0)
            hinge = complex(*com[:2]) - link.com * exp(
                1j * angle
            )  # Bullet tells a link's frame in single precision, its com in double
            self.places[name] = LinkState(complex(*com[:2]), hinge, angle, complex(*velocity[:2]), spin[2])

    def point(self, body: str, point: list[float]) -> tuple[complex, complex]:
        """Position and velocity of a body's point, given from its com."""
        place = self.places[body]
        arm = complex(*point) * exp(1j * place.angle)
        return place.com + arm, place.velocity + 1j * place.spin * arm

    def pins(self, joint: str) -> list[tuple[complex, complex]]:
        """Position and velocity of a joint's pin on its first and on its second body."""
        return [self.point(body, point) for body, point in self.joints[joint]["bodies"].items()]

    def act(self, body: str, at: complex, force: complex, torque: float = 0.0) -> None:
        """Count a force at a place, and a torque, among what acts on a body."""
        self.force[body] += force
        self.moment[body] += torque + ((at - self.places[body].com).conjugate() * force).imag  # about the com

    def push(self, body: str, at: complex, force: complex, torque: float = 0.0) -> None:
        """Apply a force at a place, and a torque, in the next step, and count them."""
        self.act(body, at, force, torque)
        if body != "ground":
            self.press(body, at, force)
            p.applyExternalTorque(*self.links[body].at, [0, 0, torque], p.WORLD_FRAME)

    def press(self, body: str, at: complex, force: complex) -> None:
        """Apply a force at a place in the next step."""
        p.applyExternalForce(*self.links[body].at, [force.real, force.imag, 0], [at.real, at.imag, 0], p.WORLD_FRAME)

    def step(self, h: float, number: int) -> None:
        """Apply what acts on the bodies, run the motors so that they are on their courses at the step's end, and let
        Bullet make a step.
        """
        self.look()
        self.force, self.moment = dict.fromkeys(self.places, 0j), dict.fromkeys(self.places, 0.0)
        self.forces: dict[str, complex] = {}  # of joints, on their second bodies
        for joint, gap in self.start["spring_dampers"].items():
            self.apply_spring_damper(joint, gap)
        if self.start["puts_right"]:
            self.put_right()
        self.forces_of_laws = {joint: self.apply_law(joint, law) for joint, law in self.start["laws"].items()}
        for spring in self.start["springs"]:
            self.apply_spring(**spring)
        if self.start["crank"]:
            self.turn_crank(self.begin + number * h)
        for k, load in enumerate(self.start["loads"]):
            at, velocity = self.point(load["link"], load["point"])
            force, torque, spin = complex(*load["force"]), load["torque"], self.places[load["link"]].spin
            if how := load.get("varies"):
                part = share(how, partial(self.where, self.begin + number * h))
                force, torque = force * part, torque * part
                if how["opposes"]:
                    u, v, spin = self.heading[k] if self.heading else (velocity.real, velocity.imag, spin)
                    force, torque = against(force, torque, complex(u, v), spin, how["fades"])
            self.push(load["link"], at, force, torque)
        for link, motor in self.motors.items():
            if motor["course"]:
                aim = motor["sign"] * on_course(self.begin + (number + 1) * h, **motor["course"])
                self.run_motor(link, (aim - p.getJointState(*self.links[link].at)[0]) / h)
        p.setTimeStep(h)
        p.stepSimulation()

    def where(self, time: float, over: Mapping[str, str]) -> float:
        """What a load varies over, at a time."""
        kind = over["kind"]
        if kind == "time":
            return time
        if kind == "travel":
            return self.travel(over["joint"])[0]
        if kind == "angle":
            return self.places[over["body"]].angle - self.places[over["less"]].angle
        marker = self.point(over["body"], self.start["bodies"][over["body"]]["marker"])[0]
        return marker.real if kind == "x" else marker.imag

    def turn_crank(self, time: float) -> None:
        """A crank's torque over its angle, and that of a motor which it lags, whose drive yields."""
        crank, wave, soft = self.start["crank"], self.start["periodic_torque"], self.start["yielding"]
        here = self.places[crank]
        if wave:
            self.push(crank, here.com, 0j, wave["amplitude"] * math.sin(wave["harmonic"] * here.angle + wave["phase"]))
        if soft:
            self.motor_torque = soft["stiffness"] * (on_course(time, **soft["course"]) - here.angle)
            self.push(crank, here.com, 0j, self.motor_torque)

    def put_right(self) -> None:
        """Reckon the velocities of now, which Bullet has half a step late, and press against the inertia forces that it
        gets wrong by that.
        """
        late = self.coordinates()[1]
        now = late + (late - (late if self.late is None else self.late)) / 2
        self.late, still = late, np.zeros(late.size)
        before, rates = self.motion(late, still), self.motion(now, still)
        for body in self.bodies:
            wrong = rates[body].acceleration - before[body].acceleration
            self.press(body, self.places[body].com, -self.links[body].mass * wrong)
            self.places[body] = self.places[body]._replace(velocity=rates[body].velocity, spin=rates[body].spin)

    def apply_spring_damper(self, joint: str, gap: Mapping[str, float]) -> None:
        """What acts in a joint's clearance, or in its soft bearing."""
        first, second = self.joints[joint]["bodies"]
        (a, a_rate), (b, b_rate) = self.pins(joint)
        if gap["clearance"]:
            depth, normal = abs(a - b) - gap["clearance"], (a - b) / abs(a - b) if a != b else 0j
            size = gap["stiffness"] * depth + gap["damping"] * (normal.conjugate() * (a_rate - b_rate)).real
            force = size * normal if depth > 0 and size > 0 else 0j
        else:
            force = gap["stiffness"] * (a - b) + gap["damping"] * (a_rate - b_rate)
        self.forces[joint] = force
        self.push(second, b, force)
        self.push(first, a, -force)

    def apply_spring(self, ends: list[Any], stiffness: float, length: float, damping: float) -> None:
        """A spring, and a damper beside it, between points of two bodies."""
        (a, a_rate), (b, b_rate) = (self.point(body, point) for body, point in ends)
        along = (b - a) / abs(b - a) if a != b else 0j
        rate = 0.0 if self.static else (along.conjugate() * (b_rate - a_rate)).real
        pull = (stiffness * (abs(b - a) - length) + damping * rate) * along
        self.push(ends[0][0], a, pull)
        self.push(ends[1][0], b, -pull)

    def travel(self, joint: str) -> tuple[float, float, complex]:
        """Position of a joint, its rate, and the direction now in which it slides, if it does."""
        (first, second), slides = self.joints[joint]["bodies"], self.joints[joint]["slides"]
        a, b, ((p1, v1), (p2, v2)) = self.places[first], self.places[second], self.pins(joint)
        if not slides:
            return b.angle - a.angle, b.spin - a.spin, 0j
        along = complex(*slides) * exp(1j * a.angle)
        slip = v2 - v1 - 1j * a.spin * (p2 - p1)
        return ((p2 - p1) * along.conjugate()).real, (slip * along.conjugate()).real, along

    def apply_law(self, joint: str, law: Mapping[str, Any]) -> complex:
        """Dry friction, damper, spring and stops of a joint, on its second body: a force along a slide (returned), or a
        torque about a hinge.
        """
        (first, second), ((p1, _), (p2, _)) = self.joints[joint]["bodies"], self.pins(joint)
        travel, rate, along = self.travel(joint)
        stretch = travel - law["rest"]
        size = -law["stiffness"] * stretch - law["cubic"] * stretch**3
        size += stopped(law["stops"], travel, 0.0 if self.static else rate, law["stops_set_in"])
        grown = law["friction_radius"] * self.friction_loads.get(joint, 0.0)
        if self.static:  # friction acts against the drive
            size -= (law["static"] + grown) * self.sliding.get(joint, 0.0)
        else:
            fallen = math.exp(-((rate / law["stribeck_speed"]) ** 2)) if law["stribeck_speed"] else 0.0
            dry = law["friction"] + (law["static"] - law["friction"]) * fallen + grown
            size -= (
                dry * max(-1.0, min(1.0, rate / law["fades_below"])) + (law["damping"] + law["drag"] * abs(rate)) * rate
            )
        self.push(second, p2, size * along, 0.0 if along else size)
        self.push(first, p1 + travel * along, -size * along, 0.0 if along else -size)
        return size * along

    def report(self, h: float, number: int) -> dict[str, float]:
        """Make a step, and say how everything was at its beginning.  Forces in the trees follow body by body, tips
        first.
        """
        before = self.coordinates()[1]
        self.step(h, number)
        after, forces = self.coordinates()[1], self.forces
        for constraint, (joint, sign) in self.carriers.items():
            forces[joint] = sign * complex(*p.getConstraintState(constraint)[:2])
            for body, (at, _), side in zip(self.joints[joint]["bodies"], self.pins(joint), (-1, 1), strict=True):
                self.act(body, at, side * forces[joint])
        change = (after - before) / h
        motion = self.motion(before + self.trailing * change, change)
        out = {"time": (self.begin + number * h) * self.time, "drive_torque": self.motor_torque * self.torque}
        if self.start["crank"]:
            out["crank_angle"] = self.places[self.start["crank"]].angle
        for body, how in reversed(self.bodies.items()):
            marker = self.point(body, how["marker"])[0] * self.length
            out |= {f"{body}_x": marker.real, f"{body}_y": marker.imag}
            out |= {f"{body}_angle": self.places[body].angle, f"{body}_angular_velocity": motion[body].spin / self.time}
            out |= self.balance(body, motion[body])
        for joint in self.joints:
            gap = (self.pins(joint)[0][0] - self.pins(joint)[1][0]) * self.length
            force = (forces[joint] + self.forces_of_laws.get(joint, 0j)) * self.newton
            out |= {f"clearance_{joint}_x": gap.real, f"clearance_{joint}_y": gap.imag}
            out |= {f"reaction_{joint}_x": force.real, f"reaction_{joint}_y": force.imag}
            out[f"position_{joint}"] = self.travel(joint)[0] * (self.length if self.joints[joint]["slides"] else 1.0)
        return out

    def balance(self, body: str, moves: Rates) -> dict[str, float]:
        """What the joint that carries a body, and the motor in it, must exert for it to move so; what carries it bears
        that.
        """
        link, here, how, out = self.links[body], self.places[body], self.bodies[body], dict[str, float]()
        force = link.mass * (moves.acceleration - complex(*self.start["gravity"])) - self.force[body]
        moment = link.inertia * moves.spin_up - self.moment[body]  # about the com
        motor, joint = self.motors.get(body), how["joint"]
        if motor:
            at = self.point(body, self.joints[motor["joint"]]["bodies"][body])[0]
            effort = motor["gives"] * (moment - ((at - here.com).conjugate() * force).imag)
            if link.slides is not None:
                effort = ((link.slides * exp(1j * here.angle)).conjugate() * force).real
            out[motor["signal"]] = effort * (self.torque if link.slides is None else self.newton)
            if joint is None:  # the body floats, and only the motor acts between it and its parent
                self.act(how["parent"], here.com, 0j, -motor["gives"] * effort)
        if joint:
            at = self.pins(joint)[1][0]
            moment -= ((at - here.com).conjugate() * force).imag
            sign = 1 if list(self.joints[joint]["bodies"])[1] == body else -1
            self.forces[joint], out[f"reaction_{joint}_moment"] = sign * force, sign * moment * self.torque
            self.act(how["parent"], at, -force, -moment)
        return out

    def motion(self, rates: np.ndarray, change: np.ndarray) -> dict[str, Rates]:
        """How every link moves, from the joints' velocities and accelerations."""
        found = {"ground": Rates()}
        for (name, link), v, a in zip(self.links.items(), rates, change, strict=True):
            here, on = self.places[name], found[link.parent]
            arm = here.hinge - self.places[link.parent].com
            velocity = on.velocity + 1j * on.spin * arm
            acceleration = on.acceleration + (1j * on.spin_up - on.spin**2) * arm
            spin, spin_up = on.spin, on.spin_up
            if link.slides is None:
                spin, spin_up = spin + v, spin_up + a
            else:
                along = link.slides * exp(1j * here.angle)
                velocity, acceleration = velocity + v * along, acceleration + (a + 2j * spin * v) * along
            arm = here.com - here.hinge
            found[name] = Rates(
                velocity + 1j * spin * arm, acceleration + (1j * spin_up - spin**2) * arm, spin, spin_up
            )
        return found

    def run(self) -> Iterator[dict[str, float]]:
        """Every run's reports: a stage is a number of steps of one size, with or without a report at its beginning, and
        heeding the reactions with which friction grows, or not.
        """
        for run in self.start["runs"]:
            self.begin, number, self.sliding = run["begin"], -run["warm_up"], run["sliding"]
            self.heading: list[list[float]] = run["heading"]
            for name, (position, velocity) in run["state"].items():
                p.resetJointState(*self.links[name].at, position, velocity)
            self.trailing = 0.0 if self.static else run["stages"][0][1] / 2
            self.friction_loads = run["friction_loads"]
            for steps, h, asked, heeding in run["stages"]:
                for k in range(number, number + steps):
                    if asked and k == number:
                        yield self.report(h, k)
                    elif heeding:
                        self.report(h, k)
                    else:
                        self.step(h, k)
                    if heeding:
                        self.friction_loads = {joint: abs(self.forces[joint]) for joint in self.friction_loads}
                number += steps


def on_course(time: float, times: list[float], cubics: list[list[float]]) -> float:
    """Where a course is at a time."""
    k = min(max(bisect_right(times, time) - 1, 0), len(cubics) - 1)
    (a, b, c, d), s = cubics[k], time - times[k]
    return d + c * s + b * (s * s) + a * (s * s * s)


def main() -> None:
    """Run, write signals.csv, and say how far it is from expected.csv."""
    world = World()
    samples = list(world.run())
    found = {
        name: np.array([sum(weight * samples[k][name] for k, weight in report) for report in world.start["reports"]])
        for name in samples[0]
    }
    compare(world.start, f"PyBullet {version('pybullet')}", found)


if __name__ == "__main__":
    main()
