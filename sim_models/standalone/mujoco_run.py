"""A linkage with clearance in bare MuJoCo: `python run.py` needs mujoco and numpy, and nothing else.

model.xml     the linkage: bodies hang in a tree of hinges and slides, constraints close its loops
start.json    where it starts, how it is stepped, what closes each joint, and the few numbers for which MJCF has no
              attribute
expected.csv  what the cross-check got; this script writes its own to signals.csv and prints the largest differences

The model is in the "units" of start.json, of m, kg and s each, which are 1 unless the linkage is far too large or small
for a solver's tolerances; signals are in SI units and rad.  A vector in the plane is complex, x + iy; reaction_<joint>
is the force of the joint's first body on its second.  What closes a joint:
    connect         an ideal pin
    soft bearing    the same, whose solref is the spring and damper between the two pin centres
    massless link   a bar between the two pin centres, as long as the clearance: it pulls and pushes
    spring-damper   a cord between them, as long as the clearance; beyond it stretches with K and C, and it never pushes
    contact         a journal in a bearing: one contact point where the circles touch, handed to MuJoCo's contact solver
A motor is an armature so heavy that no reaction changes its speed.  Those that follow courses, piecewise cubics in
start.json, are pushed by actuators whose activation is the acceleration, and put where they belong at the end of every
stage.
"""

from __future__ import annotations

import cmath
import json
import math
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

from sim_models.standalone.alike import HERE, against, compare, share, stopped

ROW = mujoco.mjtConstraint  # what a row of the solver stands for
Forces = dict[str, tuple[complex, complex]]  # by joint: on its second body (N), and the point where it acts (m)


class Simulation:
    """MuJoCo's model and data, and what their names stand for: bodies, parents first, and joints, with (first, second)
    body.
    """

    def __init__(self) -> None:
        self.start = json.loads((HERE / "start.json").read_text(encoding="utf-8"))
        self.length, mass, self.time = (self.start["units"][of] for of in ("length", "mass", "time"))  # in SI
        self.force, self.torque = mass * self.length / self.time**2, mass * self.length**2 / self.time**2
        self.bodies, self.joints, self.contacts = (self.start[part] for part in ("bodies", "joints", "contacts"))
        self.seen: dict[str, tuple[float, float, float]] = {}  # when a journal was looked at, its depth, that before
        self.model = mujoco.MjModel.from_xml_path(str(HERE / "model.xml"))
        for field, values in self.start["after_compiling"].items():
            getattr(self.model, field)[:] = values
        self.data = mujoco.MjData(self.model)
        self.motors = [self.model.joint(motor["coordinate"]).id for motor in self.start["motors"]]
        self.courses = [motor["course"] for motor in self.start["motors"] if motor["course"]]  # of all motors, or none
        laws = {self.model.tendon(name).id: law for name, law in self.start["curved_laws"].items()}
        self.curved, self.wave = laws, self.start["periodic_torque"]
        self.varying: dict[str, dict[str, Any]] = self.start["varying_loads"]
        self.heading: dict[str, list[float]] = {}  # at rest: of the point and the body of loads that oppose the motion

    def feel(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Springs and dampers that are not linear, dry friction that falls with speed, and a torque over an angle."""
        dry = {}
        for t, law in self.curved.items():
            size, rate = self.bent(t)
            data.qfrc_passive[:] += size * np.array(law["form"])
            if law["friction"]:
                fast, slow, speed = law["friction"]
                dry[t] = fast + (slow - fast) * math.exp(-((rate / speed) ** 2))
        if self.wave:
            data.qfrc_passive[:] += self.wave_torque() * np.array(self.wave["form"])
        for site, force, torque in self.loads():
            vectors = [force.real, force.imag, 0.0], [0.0, 0.0, torque], data.site_xpos[site]
            mujoco.mj_applyFT(model, data, *vectors, model.site_bodyid[site], data.qfrc_passive)
        for row in np.flatnonzero(data.efc_type == int(ROW.mjCNSTR_FRICTION_TENDON)):
            data.efc_frictionloss[row] = dry.get(int(data.efc_id[row]), data.efc_frictionloss[row])

    def loads(self) -> Iterator[tuple[int, complex, float]]:
        """Site, force and torque of each load that varies, now."""
        for name, load in self.varying.items():
            site, part = self.model.site(name).id, share(load, self.where)
            force, torque = complex(*load["force"]) * part, load["torque"] * part
            if load["opposes"]:
                u, v, spin = self.heading.get(name) or self.going(site)
                force, torque = against(force, torque, complex(u, v), spin, load["fades"])
            yield site, force, torque

    def going(self, site: int) -> list[float]:
        """Velocity of a site and angular velocity of its body."""
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_SITE, site, velocity, 0)
        return [float(velocity[3]), float(velocity[4]), float(velocity[2])]

    def where(self, over: Mapping[str, str]) -> float:
        """What a load varies over, now."""
        kind = over["kind"]
        if kind == "time":
            return float(self.data.time)
        if kind == "travel":
            return self.position(over["joint"]) / self.length
        if kind == "angle":
            return self.angle(over["body"]) - self.angle(over["less"])
        return float(self.data.site_xpos[self.model.site(f"marker of {over['body']}").id, "xy".index(kind)])

    def bent(self, t: int) -> tuple[float, float]:
        """What of a joint's law is not linear, and the joint's rate."""
        law, rate = self.curved[t], float(self.data.ten_velocity[t])
        stretch = float(self.data.ten_length[t] - self.model.tendon_lengthspring[t, 0])
        size = -law["cubic"] * stretch**3 - law["drag"] * abs(rate) * rate
        return size + stopped(law["stops"], stretch + law["rest"], rate, self.model.opt.timestep), rate

    def wave_torque(self) -> float:
        """The torque over the driven body's angle."""
        angle = self.wave["angle"] + float(np.array(self.wave["form"]) @ self.data.qpos)
        return self.wave["amplitude"] * math.sin(self.wave["harmonic"] * angle + self.wave["phase"])

    def pins(self, joint: str) -> list[complex]:
        """Centres of a joint's pin on its first and on its second body."""
        return [
            complex(*self.data.site_xpos[self.model.site(f"{joint}:{body}").id, :2])
            for body in self.joints[joint]["bodies"]
        ]

    def soft(self, joint: str) -> bool:
        """Whether its bearing is soft: its two pins are apart."""
        return bool(self.joints[joint]["closed_by"] == "soft bearing")

    def rows(self, kind: int, number: int) -> np.ndarray:
        """Forces in the solver's rows of one constraint."""
        return self.data.efc_force[(self.data.efc_type == kind) & (self.data.efc_id == number)]

    def first_half(self) -> list[str]:
        """First half of a step (mj_step2 is the other), with a contact point for each journal that has left its gap;
        the joints in contact.
        """
        mujoco.mj_step1(self.model, self.data)
        touching = []
        for joint, law in self.contacts.items():
            journal, bearing = self.pins(joint)
            gap = self.gap(joint)
            if self.seen.get(joint, (math.nan,))[0] != self.data.time:
                before = self.seen.get(joint, (0.0, math.inf))[1]
                self.seen[joint] = self.data.time, gap - law["clearance"], before
            if gap <= law["clearance"] - law["margin"]:
                continue
            normal, point = (journal - bearing) / gap, mujoco.MjContact()
            at = bearing + normal * law["bearing_radius"]
            depth, point.solref, point.solimp = self.wall(joint, law, gap - law["clearance"])
            point.solreffriction = law["solreffriction"]
            point.dist, point.pos = -depth, (at.real, at.imag, 0)
            point.frame = (
                -normal.real,
                -normal.imag,
                0,
                normal.imag,
                -normal.real,
                0,
                0,
                0,
                1,
            )  # its x axis: the push on the journal
            point.geom = [self.model.geom(f"{joint}:{body}").id for body in reversed(self.joints[joint]["bodies"])]
            point.flex = point.elem = point.vert = [-1, -1]
            point.dim, point.friction = 3 if law["friction"] else 1, [law["friction"]] * 2 + [0, 0, 0]
            mujoco.mj_addContact(self.model, self.data, point)
            touching.append(joint)
        if touching:
            mujoco.mj_makeConstraint(self.model, self.data)
            mujoco.mj_referenceConstraint(self.model, self.data)
        for i, joint in enumerate(touching):
            friction, row = self.contacts[joint]["friction"], self.data.contact[i].efc_address
            if friction:  # MuJoCo's convex cone lifts sliding surfaces at friction times slip: taken back
                self.data.efc_aref[row] -= friction * abs(self.data.efc_aref[row + 1])
            if self.contacts[joint]["hard"]:
                self.follow(joint, row)
        return touching

    def follow(self, joint: str, row: int) -> None:
        """Have a hard contact accelerate the journal as it and the bearing go: MuJoCo holds J a to its reference, and
        leaves out how J changes on the way.
        """
        model, data, journal, bearing = self.model, self.data, *self.pins(joint)
        normal, changes = (journal - bearing) / self.gap(joint), np.zeros((6, model.nv))
        for half, body in zip((changes[:3], changes[3:]), self.joints[joint]["bodies"], strict=True):
            site = model.site(f"{joint}:{body}").id
            mujoco.mj_jacDot(model, data, half, None, data.site_xpos[site], model.site_bodyid[site])
        ways = np.array([normal.real, normal.imag, 0, -normal.real, -normal.imag, 0])
        step = model.opt.timestep  # velocities are those of half a step ago
        bend = float(ways @ changes @ (data.qvel + step * data.qacc))
        data.efc_aref[row] += bend * (1 - float(data.efc_KBIP[row, 1]) * step / 2)

    def gap(self, joint: str) -> float:
        """How far a journal is from the middle of its bearing."""
        journal, bearing = self.pins(joint)
        return math.hypot((journal - bearing).real, (journal - bearing).imag)

    def wall(self, joint: str, law: dict[str, Any], depth: float) -> tuple[float, list[float], list[float]]:
        """How deep a journal is, and its contact's solref and solimp.

        A soft wall's row has the mass that makes its damping that of this instant, velocities being half a step older;
        where the journal has come to it within the last step, the force is the mean over the step's time.
        """
        if law["soft"] is None:
            return depth, law["solref"], law["solimp"]
        part, before = 1.0, self.seen[joint][2]
        if before <= 0 < depth:
            there = depth / (depth - before)
            part, depth = there + 0.5, depth * (there + 0.5) / (2 * there)
        stiffness, damping, weight = law["soft"]  # the last is MuJoCo's 1/kg of the two bodies
        mass = weight * part * damping * self.model.opt.timestep / 2
        impedance = min(max(mass / (1 + mass), 1e-4), 0.9999)
        scale = part * (1 - impedance) * weight
        return depth, [-stiffness * scale, -damping * scale], [impedance, impedance, *law["solimp"][2:]]

    def evaluate(self) -> Forces:
        """Accelerations and forces at the present state, without a step; the forces of the joints that close loops."""
        touching = self.first_half()
        mujoco.mj_fwdActuation(self.model, self.data)
        mujoco.mj_fwdAcceleration(self.model, self.data)
        mujoco.mj_fwdConstraint(self.model, self.data)
        mujoco.mj_rnePostConstraint(self.model, self.data)
        forces: Forces = {}
        for joint, how in self.joints.items():
            first, second = self.pins(joint)
            along = (first - second) / abs(first - second) if first != second else 0j
            if how["closed_by"] in ("connect", "soft bearing"):
                forces[joint] = complex(*self.rows(ROW.mjCNSTR_EQUALITY, self.model.equality(joint).id)[:2]), second
            elif how["closed_by"] == "massless link":
                forces[joint] = -along * self.rows(ROW.mjCNSTR_EQUALITY, self.model.equality(joint).id)[0], second
            elif how["closed_by"] == "spring-damper":  # a slack cord has no row
                forces[joint] = along * self.rows(ROW.mjCNSTR_LIMIT_TENDON, self.model.tendon(joint).id).sum(), second
            elif joint in touching:
                point = self.data.contact[touching.index(joint)]
                normal, *sliding = self.data.efc_force[point.efc_address :][: point.dim]
                forces[joint] = along * complex(normal, sliding[0] if sliding else 0.0), complex(*point.pos[:2])
            elif how["closed_by"] == "contact":
                forces[joint] = 0j, second
        return forces

    def own_torque(self, joint: str) -> float:
        """Spring, damper and dry friction of a joint's own law, on its second body."""
        t = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_TENDON, f"law:{joint}")
        if t < 0:
            return 0.0
        spring = self.model.tendon_stiffness[t] * (self.data.ten_length[t] - self.model.tendon_lengthspring[t, 0])
        return (
            (self.bent(t)[0] if t in self.curved else 0.0)
            + self.rows(ROW.mjCNSTR_FRICTION_TENDON, t).sum()
            - spring
            - self.model.tendon_damping[t] * self.data.ten_velocity[t]
        )

    def signals(self, forces: Forces, velocity: np.ndarray, friction: Mapping[str, float]) -> dict[str, float]:
        """All signals.  Forces in the joints of the tree follow from Newton's and Euler's equations, body by body, tips
        first.
        """
        model, data = self.model, self.data
        out = self.places(velocity) | dict.fromkeys(self.start["efforts"], 0.0)
        force_on, moment_on = dict.fromkeys(("ground", *self.bodies), 0j), dict.fromkeys(("ground", *self.bodies), 0.0)

        def act(body: str, force: complex, at: complex, torque: float = 0.0) -> None:
            force_on[body] += force
            moment_on[body] += torque + (at.conjugate() * force).imag  # about the ground's origin

        for given in self.applied():
            act(*given)
        for joint, (force, at) in forces.items():
            first, second = self.joints[joint]["bodies"]
            torque = self.own_torque(joint) + friction.get(joint, 0.0)
            touches = self.joints[joint]["closed_by"] == "contact"
            act(first, -force, at if touches else self.pins(joint)[0], -torque)  # at its own pin
            act(second, force, at, torque)
            out |= self.reaction(joint, force)
        for body, how in reversed(self.bodies.items()):
            number, motion, joint, drive = model.body(body).id, np.zeros(6), how["joint"], how["drive"]
            mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_BODY, number, motion, 0)  # gravity is in it
            inertia = model.body_mass[number] * complex(*motion[3:5])
            force = inertia - force_on[body]
            moment = model.body_inertia[number, 2] * motion[2] - moment_on[body]
            moment += (complex(*data.xipos[number, :2]).conjugate() * inertia).imag
            if joint is not None:
                sign, at = 1 if self.joints[joint]["bodies"][1] == body else -1, self.pins(joint)[1]
                act(how["parent"], -force, 0j, -moment)
                moment -= (at.conjugate() * force).imag
                out |= self.reaction(joint, sign * force) | {f"reaction_{joint}_moment": sign * moment * self.torque}
                moment -= sign * (self.own_torque(joint) + friction.get(joint, 0.0))
            elif drive:  # only joints with clearance hold this body, but a motor turns it
                act(how["parent"], 0j, 0j, -moment)
            if drive:
                out[drive["signal"]] = self.effort(drive, force, moment, friction)
        return out

    def reaction(self, joint: str, force: complex) -> dict[str, float]:
        """Signals of the force of a joint's first body on its second."""
        return {f"reaction_{joint}_x": force.real * self.force, f"reaction_{joint}_y": force.imag * self.force}

    def applied(self) -> Iterator[tuple[str, complex, complex, float]]:
        """Body, force, where it acts, and torque: of loads, springs between points, and what turns the crank over its
        angle.
        """
        model, data = self.model, self.data
        for i in range(model.nu - len(self.courses)):  # loads are actuators of constant force
            site, (fx, fy, *_, torque) = model.actuator_trnid[i, 0], model.actuator_gear[i]
            yield model.body(model.site_bodyid[site]).name, complex(fx, fy), complex(*data.site_xpos[site, :2]), torque
        for name, (first, second) in self.start["springs"].items():
            near, far = (complex(*data.site_xpos[model.site(f"{name}:{body}").id, :2]) for body in (first, second))
            t = model.tendon(name).id
            stretch = abs(far - near) - model.tendon_lengthspring[t, 0]
            pull = model.tendon_stiffness[t] * stretch + model.tendon_damping[t] * data.ten_velocity[t]
            force = pull * (far - near) / (abs(far - near) or 1.0)
            yield first, force, near, 0.0
            yield second, -force, far, 0.0
        for site, force, torque in self.loads():
            yield model.body(model.site_bodyid[site]).name, force, complex(*data.site_xpos[site, :2]), torque
        if self.wave:
            yield self.wave["body"], 0j, 0j, self.wave_torque()

    def effort(self, drive: Mapping[str, Any], force: complex, moment: float, friction: Mapping[str, float]) -> float:
        """What a motor gives its joint's second body, of the force on the body farther out, and the moment that joint
        and law leave over: the torque; along a slide the force, less the slide's own law.
        """
        if not drive["slides"]:
            return float(drive["sign"] * moment * self.torque)
        axis, joint = complex(*drive["axis"]) * cmath.exp(1j * self.angle(drive["first"])), drive["joint"]
        along = float(drive["sign"] * (axis.conjugate() * force).real)
        return (along - self.own_torque(joint) - friction.get(joint, 0.0)) * self.force

    def places(self, velocity: np.ndarray) -> dict[str, float]:
        """Signals of where everything is, and how fast it turns."""
        model, data = self.model, self.data
        out = {"time": data.time * self.time}
        if self.start["told_by"]:
            out["crank_angle"] = data.qpos[model.joint(self.start["told_by"]).id]
        for body, how in self.bodies.items():
            hinges = [model.joint(name).id for name in how["hinges"]]
            out[f"{body}_x"], out[f"{body}_y"] = data.site_xpos[model.site(f"marker of {body}").id, :2] * self.length
            out[f"{body}_angle"] = self.angle(body)
            out[f"{body}_angular_velocity"] = velocity[hinges].sum() / self.time
        for joint, how in self.joints.items():
            gap = self.pins(joint)[0] - self.pins(joint)[1] if how["clearance"] or self.soft(joint) else 0j
            out[f"clearance_{joint}_x"], out[f"clearance_{joint}_y"] = gap.real * self.length, gap.imag * self.length
            out[f"position_{joint}"] = self.position(joint)
        return out

    def angle(self, body: str) -> float:
        """Angle of a body."""
        how = self.bodies.get(body, {"fixed_angle": 0.0, "hinges": []})  # the ground's
        return float(how["fixed_angle"] + sum(self.data.qpos[self.model.joint(name).id] for name in how["hinges"]))

    def position(self, joint: str) -> float:
        """Angle of a joint's second body on its first; of a slide, which is always one of the tree, its travel."""
        if not self.joints[joint]["slides"]:
            first, second = (self.angle(body) for body in self.joints[joint]["bodies"])
            return second - first
        body = next(name for name, how in self.bodies.items() if how["joint"] == joint)
        return float(self.data.qpos[self.model.joint(f"{body}:slide").id] * self.length)

    def driven(self) -> Iterator[dict[str, float]]:
        """Step from the start; the signals wherever they were asked for.

        Forces are evaluated at the end of every stage, asked for or not: a step begins with the accelerations that were
        found last, and the first with those of the start.
        """
        model, data, start = self.model, self.data, self.start
        data.time, data.qpos[:], data.qvel[:] = start["time"], start["qpos"], start["qvel"]
        data.qacc[:] = start["qacc"]
        half = (
            0.5 if start["half_step"] else 0.0
        )  # semi-implicit Euler holds velocities half a step older than its positions
        time, lag = data.time, half * model.opt.timestep
        self.place(time, lag)
        for steps, model.opt.timestep, asked in start["stages"]:
            data.qvel[:] += (lag - half * model.opt.timestep) * data.qacc
            lag = half * model.opt.timestep
            for _ in self.pushes(time, steps):
                if self.contacts:
                    self.first_half()
                    mujoco.mj_step2(model, data)
                else:
                    mujoco.mj_step(model, data)
            time += steps * model.opt.timestep
            self.place(time, lag)
            forces = self.evaluate()
            if asked:
                yield self.signals(forces, data.qvel + lag * data.qacc, {})

    def along(self, times: np.ndarray, order: int = 0) -> np.ndarray:
        """The motors' coordinates (N, motors) on their courses at times (N,), or their derivatives of that order."""
        found = []
        for course in self.courses:
            knots, pieces = np.array(course["times"]), np.array(course["cubics"])  # highest power first
            piece = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(pieces) - 1)
            value, power = np.zeros(len(times)), np.ones(len(times))
            for k, coefficient in enumerate(pieces[piece].T[::-1]):  # in this order: a push has the rounding, over h^2
                if k >= order:
                    value, power = value + coefficient * power * math.perm(k, order), power * (times - knots[piece])
            found.append(value)
        return np.column_stack(found)

    def place(self, time: float, lag: float) -> None:
        """Put the motors where they belong on their courses, velocities being ``lag`` older; one at constant speed, if
        reactions have moved it.
        """
        data, start, now = self.data, self.start, np.array([time])
        if self.courses:
            acceleration = self.along(now, 2)[0]
            data.qpos[self.motors], data.act[:], data.ctrl[-len(self.courses) :] = self.along(now)[0], acceleration, 0.0
            data.qvel[self.motors] = self.along(now, 1)[0] - lag * acceleration
            return
        for motor in self.motors:
            speed = start["qvel"][motor]
            angle = start["qpos"][motor] + speed * (time - start["time"])
            if abs(data.qpos[motor] - angle) > 1e-7:
                data.qpos[motor], data.qvel[motor] = angle, speed

    def pushes(self, time: float, steps: int) -> Iterator[None]:
        """Set, before each step, what keeps motors on their courses: an acceleration, or two, at either end of
        the step.
        """
        if not self.courses:
            yield from [None] * steps
            return
        h = self.model.opt.timestep
        times = time + h * np.arange(-1, steps + 1)
        x, v = self.along(times), self.along(times[1:], 1)
        if self.start["half_step"]:  # each velocity is that between two positions
            self.data.qvel[self.motors] = (x[1] - x[0]) / h
            push, change = np.diff(x, 2, axis=0) / h**2, np.zeros((steps, len(self.motors)))
        elif h < self.start["shortest"]:  # of positions there would be nothing but rounding
            push, change = np.diff(v, axis=0) / h, np.zeros((steps, len(self.motors)))
        else:  # the cubic with the course's angle and rate at either end
            mean = np.diff(x[1:], axis=0) / h
            push, change = (6 * mean - 4 * v[:-1] - 2 * v[1:]) / h, (6 * (v[:-1] + v[1:]) - 12 * mean) / h**2
        for k in range(steps):
            self.data.act[:], self.data.ctrl[-len(self.courses) :] = push[k], change[k]
            yield

    def static(self) -> Iterator[dict[str, float]]:
        """The signals of each equilibrium.  That it is one is MuJoCo's word: the largest acceleration it finds there is
        printed.
        """
        largest = 0.0
        for state in self.start["equilibria"]:
            self.data.time, self.data.qpos[:] = state.get("time", 0.0), state["qpos"]
            self.heading = state["heading"]
            self.data.qfrc_applied[:] = state["dry_friction"]  # which acts against the drives' directions
            forces = self.evaluate()
            for joint, part in state["sliding"].items():
                forces[joint] = forces[joint][0] * complex(1, part), forces[joint][1]
            largest = max(largest, np.abs(self.data.qacc).max())
            yield self.signals(forces, self.data.qvel, state["joint_friction"])
        print(f"largest acceleration at rest: {largest:.2g} m/s^2 or rad/s^2")


def main() -> None:
    """Run, write signals.csv, and say how far it is from expected.csv."""
    simulation = Simulation()
    if simulation.curved or simulation.wave or simulation.varying:
        mujoco.set_mjcb_passive(simulation.feel)  # in every evaluation of a step; no model can be compiled meanwhile
    rows = list(simulation.static() if simulation.start["motion"] == "static" else simulation.driven())
    mujoco.set_mjcb_passive(None)
    if any(warning.number for warning in simulation.data.warning):
        sys.exit("MuJoCo warned: this run is not valid")
    found = {name: np.array([row[name] for row in rows], float) for name in rows[0]}
    compare(simulation.start, f"MuJoCo {mujoco.__version__}", found)


if __name__ == "__main__":
    main()
