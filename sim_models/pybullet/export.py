"""A request as files that run in PyBullet without this project: a URDF for each part, start.json, run.py, and what we
got, expected.csv.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, TypeVar
from xml.etree import ElementTree

import numpy as np

from analytic.kinematics.schedule import Course, Steady
from analytic.mechanism import GROUND, Joint, Spring
from analytic.mechanism.signals import driving
from sim_models.common.export_files import expected, head, lines, stops, varies, written
from sim_models.common.simulate import simulate
from sim_models.common.tree import Branch
from sim_models.engine import Engine, Request, Trace
from sim_models.pybullet.parts import Planned, flat
from sim_models.pybullet.run import BulletRun
from sim_models.pybullet.world import NO_SPEED_LIMIT, STRENGTH, BulletWorld
from sim_models.run.path import Path as MotionPath

NO_LIMIT = (1.0, -1.0)  # limits that Bullet takes for none
T = TypeVar("T")


class RecordedWorld(BulletWorld):
    """A world that keeps what it is made of, and the state and the steps that led to each report."""

    def __init__(self, request: Request, path: MotionPath) -> None:
        self.grown: dict[int, list[Planned]] = {}  # links of each multibody
        self.runs: list[dict[str, Any]] = []  # those with a report
        self.run: dict[str, Any] = {}
        self.observing = False
        super().__init__(request, path)
        self.names = dict(zip(self.freedoms, self._names(), strict=True))
        numbers = [
            self.p.getConstraintUniqueId(i, physicsClientId=self.client)
            for i in range(self.p.getNumConstraints(physicsClientId=self.client))
        ]
        self.constraints = {number: self.p.getConstraintInfo(number, physicsClientId=self.client) for number in numbers}

    def _names(self) -> list[str]:
        """Name of every link, in the order of the freedoms.  What carries a floating body has a dot in it, which no
        body's name has.
        """
        kept = {number: body for body, own in self.own.items() for number in own}
        kept |= {number: f"{joint}.strut" for joint, strut in self.struts.items() for number in strut.own}
        owners = [kept[number] for number in range(len(self.freedoms))]
        between = [".x", ".y", "", ".reach"]
        return [o + (between[owners[:k].count(o)] if owners.count(o) > 1 else "") for k, o in enumerate(owners)]

    def part(self, number: int) -> str:
        """Name of a multibody: that of its first body, or the strut's."""
        return self.names[number, 0].removesuffix(".x")

    def grow(self, links: list[Planned]) -> int:
        number = super().grow(links)
        self.grown[number] = links
        return number

    def _reset(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        super()._reset(positions, velocities)
        self._begin(positions.tolist(), velocities.tolist())

    def hold(self, held: bool) -> None:
        super().hold(held)
        self._begin(*self._read())

    def _begin(self, positions: list[float], velocities: list[float]) -> None:
        """Begin a run with this state."""
        state = list(zip(positions, velocities, strict=True))
        self.run = {"state": state, "friction_loads": dict(self.loads), "stages": []}

    def advance(self, h: float) -> None:
        super().advance(h)
        stages = self.run["stages"]
        if not self.observing and stages and stages[-1][1::2] == [h, self.heeding]:
            stages[-1][0] += 1
        else:
            stages.append([1, h, self.observing, self.heeding])

    def settled(self, evaluate: Callable[[], T], pressing: Callable[[T], Mapping[str, float]]) -> T:
        before = len(self.runs)
        found = super().settled(evaluate, pressing)
        del self.runs[before:-1]  # those with a friction that was not yet that of their reactions
        return found

    def observe(self, h: float) -> dict[str, float]:
        if not self.runs or self.runs[-1] is not self.run:
            self.runs.append(self.run | {"sliding": dict(self.laws.sliding), "heading": self._headings()})
            self.run = self.runs[-1]
        self.observing = True
        try:
            return super().observe(h)
        finally:
            self.observing = False

    def _headings(self) -> list[list[float]]:
        """Velocity of each load's point and its body's angular velocity, in the motion that loads oppose at rest."""
        if not self.heading:
            return []
        seen, loads = self.seen, self.mechanism.loads
        return [[*flat(complex(seen.velocity(x.body, x.point)))[:2], seen.spin(x.body)] for x in loads]


class RecordedRun(BulletRun):
    """A run in worlds that keep what they are made of."""

    world_class = RecordedWorld
    world: RecordedWorld

    def at_rest(self, motor: float) -> dict[str, float]:
        before = len(self.world.runs)
        row = super().at_rest(motor)
        del self.world.runs[before:-1]  # those against a motion without the gaps that loads then made
        return row


def write(engine: Engine, request: Request, folder: Path) -> list[Path]:
    """Run a request as its engine does, in units of the linkage's own and steps that make it plausible, and write what
    repeats it into an existing folder.  Raises what :func:`sim_models.common.simulate.simulate` does, and OSError.
    """
    parts: dict[str, str] = {}
    start: dict[str, Any] = {}
    order: list[int] = []

    def recorded(asked: Request) -> Trace:
        run = RecordedRun(asked)
        trace, world = run.trace(), run.world
        order[:] = _order(trace)
        parts.update({f"{world.part(number)}.urdf": urdf(world, number) for number in world.grown})
        start.update(_start(world, trace) | {"reports": _reports(world, trace)})
        return trace

    trace = simulate(engine, request, recorded)  # the last that was run
    if start["yielding"]:  # where the crank is, not its motor
        trace = replace(trace, crank_angle=trace.signals[f"{request.mechanism.driven}_angle"])
    files = parts | {
        "start.json": lines({**head(request, trace), **start}),
        "expected.csv": expected(trace, request, order),
    }
    return written(folder, files, "pybullet_run.py")


def urdf(world: RecordedWorld, number: int) -> str:
    """One multibody as URDF.  Every joint's frame is its child's; decimal numbers carry all the digits of a double."""
    robot = ElementTree.Element("robot", name=world.part(number))
    _link(robot, GROUND, 0j, 0.0, 0.0)
    for index, how in enumerate(world.grown[number]):
        name = world.names[number, index]
        _link(robot, name, how.com, how.mass, how.inertia)
        joint = ElementTree.SubElement(robot, "joint", name=name, type="prismatic" if how.slides else "continuous")
        ElementTree.SubElement(joint, "parent", link=world.names.get((number, how.parent), GROUND))
        ElementTree.SubElement(joint, "child", link=name)
        ElementTree.SubElement(joint, "origin", xyz=_numbers(flat(how.at)), rpy=_numbers([0.0, 0.0, how.fixed_angle]))
        ElementTree.SubElement(joint, "axis", xyz=_numbers(how.axis))
        if how.slides:
            lower, upper = NO_LIMIT if how.limits is None else how.limits
            ElementTree.SubElement(
                joint, "limit", lower=repr(float(lower)), upper=repr(float(upper)), effort="0", velocity="0"
            )
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode") + "\n"


def _link(robot: ElementTree.Element, name: str, com: complex, mass: float, inertia: float) -> None:
    inertial = ElementTree.SubElement(ElementTree.SubElement(robot, "link", name=name), "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(flat(com)), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(mass)))
    moment = repr(float(inertia))
    ElementTree.SubElement(inertial, "inertia", ixx=moment, ixy="0", ixz="0", iyy=moment, iyz="0", izz=moment)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(v)) for v in values)


def _start(world: RecordedWorld, trace: Trace) -> dict[str, Any]:
    """What the URDFs do not say."""
    m = world.mechanism
    physics = dict(world.physics)
    solver = physics.pop("constraintSolverType")
    names = [name for name in dir(world.p) if name.startswith("CONSTRAINT_SOLVER") and getattr(world.p, name) == solver]
    return {
        "solver": names[0],
        "physics": physics,
        "strength": STRENGTH,
        "fastest": NO_SPEED_LIMIT,
        "gravity": m.gravity,
        "parts": [world.part(number) for number in world.grown],
        "fixed_angles": {
            world.names[number, index]: how.fixed_angle
            for number, links in world.grown.items()
            for index, how in enumerate(links)
            if how.fixed_angle
        },
        "puts_right": world.makes_up and not world.static,
        "crank": m.driven if world.crank else None,
        "motors": _motors(world) if world.held else {},
        "yielding": _yielding(world) if world.drive_stiffness and not world.held else None,
        "bodies": {branch.child: _body(world, branch) for branch in world.branches},
        "joints": {j.name: _joint(world, j) for j in m.joints},
        "constraints": _constraints(world),
        "laws": {j.name: _law(world, j) for j in world.laws.joints},
        "periodic_torque": m.periodic_torque and m.periodic_torque.model_dump(),
        "springs": [_spring(world, spring) for spring in m.springs],
        "loads": [*_loads(world), *_weights(world)],
        "spring_dampers": {
            name: {"clearance": pin.clearance} | asdict(pin.contact)
            for name, pin in ((world.pins if world.compliant else {}) | world.soft).items()
        },
        "runs": [
            run | when | {"state": dict(zip(world.names.values(), run["state"], strict=True))}
            for run, when in zip(world.runs, _clock(world, trace), strict=True)
        ],
    }


def _from_com(world: RecordedWorld, body: str, point: str) -> list[float]:
    return flat(world.points[body, point] - world.links[body].centre)[:2]


def _clock(world: RecordedWorld, trace: Trace) -> list[dict[str, Any]]:
    """Of every run, the time (s) at which it begins, and how many steps are made before: at rest, up to its report."""
    if world.grid is not None:
        made = sum(stage[0] for stage in world.runs[0]["stages"])
        return [{"begin": world.grid.begin, "warm_up": made - 1 - world.grid.last}]
    begin = np.zeros(len(world.runs)) if trace.time is None else np.sort(trace.time)
    steps = [sum(steps for steps, _, asked, _ in run["stages"] if not asked) for run in world.runs]
    return [{"begin": t, "warm_up": n} for t, n in zip(begin.tolist(), steps, strict=True)]


def _motors(world: RecordedWorld) -> dict[str, dict[str, Any]]:
    """The motors by the link that each moves: the joint that it is in, and the sign of its position as the link's own
    joint in Bullet has it.
    """
    result: dict[str, dict[str, Any]] = {}
    signals = driving([each.joint for each in world.steered])
    for each, signal, speed in zip(world.steered, signals, world.commands, strict=True):
        gives = each.sign * (1.0 if world.crank else world.mechanism.crank_sign)
        how = {"joint": each.joint.name, "sign": each.sign, "gives": gives, "signal": signal.name, "speed": speed}
        result[each.child] = how | {"course": _course(world, each.joint.name)}
    return result


def _course(world: RecordedWorld, joint: str) -> dict[str, Any] | None:
    """The cubics that a joint's motor follows; None where it keeps its speed, or is at rest."""
    motor = None if world.static else world.request.motor if world.crank else world.request.schedule.drives[joint]
    return {"times": motor.knots.tolist(), "cubics": motor.spline.c.T.tolist()} if isinstance(motor, Course) else None


def _yielding(world: RecordedWorld) -> dict[str, Any]:
    """The motor behind a crank that lags it, and what is between them (N.m/rad)."""
    steady = world.request.motor
    course = _course(world, world.mechanism.drive_joint.name)
    if isinstance(steady, Steady):
        course = {"times": [0.0], "cubics": [[0.0, 0.0, steady.speed, steady.start]]}
    return {"stiffness": world.drive_stiffness, "course": course}


def _body(world: RecordedWorld, branch: Branch) -> dict[str, Any]:
    """What a body is carried by, and how; without a joint it floats."""
    joint = branch.joint.name if branch.joint else None
    return {"parent": branch.parent, "joint": joint, "marker": _from_com(world, branch.child, "com")}


def _spring(world: RecordedWorld, spring: Spring) -> dict[str, Any]:
    ends = [(body, _from_com(world, body, point)) for body, point in spring.ends]
    return {"ends": ends, "stiffness": spring.stiffness, "length": spring.length, "damping": spring.damping}


def _joint(world: RecordedWorld, j: Joint) -> dict[str, Any]:
    return {
        "bodies": {body: _from_com(world, body, j.name) for body in j.bodies},
        "slides": flat(j.direction)[:2] if j.prismatic else None,
    }


def _constraints(world: RecordedWorld) -> list[dict[str, Any]]:
    """Bullet's own account of every point constraint, and the joint whose force it carries, as it is or reversed."""
    ties = world.ties | {name: strut.tie for name, strut in world.struts.items()}
    carried = {tie.number: (name, tie.sign) for name, tie in ties.items()}
    result = []
    for number, info in world.constraints.items():
        first, second = (world.names.get(end, GROUND) for end in (info[0:2], info[2:4]))
        between = {"first": first, "second": second, "pivots": [info[6][:2], info[7][:2]]}
        result.append({"between": between, "carries": carried.get(number)})
    return result


def _law(world: RecordedWorld, j: Joint) -> dict[str, Any]:
    return {
        "friction": j.coulomb,
        "friction_radius": j.load_coefficient,
        "static": j.stiction,
        "stribeck_speed": j.stribeck_speed or 0.0,
        "fades_below": world.laws.fades_below[j.name],
        "damping": j.damping,
        "drag": j.drag,
        "stiffness": j.stiffness,
        "cubic": j.cubic,
        "rest": j.rest_angle,
        "stops": stops(j),
        "stops_set_in": world.laws.step,
    }


def _loads(world: RecordedWorld) -> list[dict[str, Any]]:
    return [
        {
            "link": load.body,
            "point": _from_com(world, load.body, load.point),
            "force": load.force,
            "torque": load.torque,
            "varies": varies(world.mechanism, load, fades) if load.varies else None,
        }
        for load, fades in zip(world.mechanism.loads, world.fades, strict=True)
    ]


def _weights(world: RecordedWorld) -> list[dict[str, Any]]:
    """What lifts the struts, which should be weightless."""
    return [
        {
            "link": world.names[strut.number, part],
            "point": [0.0, 0.0],
            "force": [-strut.mass * g for g in world.mechanism.gravity],
            "torque": 0.0,
        }
        for strut in world.struts.values()
        for part in range(2, strut.parts)
        if any(world.mechanism.gravity)
    ]


def _reports(world: RecordedWorld, trace: Trace) -> list[list[tuple[int, float]]]:
    """What each row of expected.csv is made of: samples, by their number, and their weights."""
    grid = world.grid
    if grid is None or trace.time is None:
        return [[(k, 1.0)] for k in range(trace.crank_angle.size)]
    number = {node: k for k, node in enumerate(grid.wanted)}
    once = np.unique(np.sort(trace.time), return_index=True)[1]
    mixed = [zip(grid.nodes[k].tolist(), grid.weights[k].tolist(), strict=True) for k in once]
    return [[(number[node], weight) for node, weight in row if weight] for row in mixed]


def _order(trace: Trace) -> list[int]:
    """Rows in the order of passing; what moves passes each instant once."""
    passed = trace.crank_angle if trace.time is None else trace.time
    order = np.argsort(passed, kind="stable") if trace.motion == "static" else np.unique(passed, return_index=True)[1]
    return [int(k) for k in order]
