"""DART and PyBullet where several motors drive a linkage, or none all of it, and with springs between points: against
the referee in maximal coordinates, Lagrange's equations, and energy.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import Drive, Mechanism, Spring
from analytic.mechanism.file import load, loads
from asked import request_of
from engine_checks import vector
from marks import slow
from maximal import Maximal, Posed
from several_linkages import CASES, KNOTS, Knots, referee, splines, waved
from several_truths import (
    ARM,
    HANGING,
    SWINGING,
    close,
    double_pendulum,
    energy,
    on_the_rims,
    pendulum_on_a_spring,
    swung_on_its_spring,
    turned_round,
)
from sim_models.engine import Engine, JointModel, Motion, Request, Trace, Unsupported

ENGINES = ("dart", "pybullet")
FIVE_BAR = load("five-bar")
TIMES = np.linspace(0.023, 0.203, 7)  # s; between knots: at one, a step's mean acceleration is not the course's
LOOSE = 2e-4  # m
SLOW_CASES = ("five-bar", "five-bar with springs", "3-rrr with springs", "2r-arm with springs", "3-rpr")
GANTRY = """
name = "gantry"
gravity = [0.0, -9.81]
ground = { points = { X = [0.1, 0.2] } }
body = [
    { name = "bridge", points = { X = [0.0, 0.0], Y = [0.05, 0.1] }, mass = 2.0, inertia = 0.02 },
    { name = "head", points = { Y = [0.0, 0.02], R = [0.03, 0.0] }, mass = 0.7, com = [0.04, 0.01], inertia = 3e-3 },
    { name = "tool", points = { R = [0.0, 0.0], T = [0.1, 0.0] }, mass = 0.3, com = [0.04, 0.01], inertia = 1e-3 },
]
joint = [
    { name = "X", type = "prismatic", bodies = ["ground", "bridge"], axis = [1.0, 0.2] },
    { name = "Y", type = "prismatic", bodies = ["head", "bridge"], axis = [0.3, 1.0], angle = 0.3 },
    { name = "R", type = "revolute", bodies = ["tool", "head"] },
]
drive = [{ joint = "X", speed = 0.2 }, { joint = "Y", speed = -0.1 }, { joint = "R", speed = 1.0 }]
assembly = { bridge = 0.0, head = -0.3, tool = 0.5 }
"""


def engine(name: str) -> Engine:
    found: Engine = importlib.import_module(f"sim_models.{name}.engine").ENGINE
    return found


@pytest.fixture(params=ENGINES)
def leapfrog(request: pytest.FixtureRequest) -> Engine:
    return engine(request.param)


def agrees(m: Mechanism, trace: Trace, judge: Maximal, posed: list[Posed], within: float = 1e-5) -> None:
    """Angles to 1e-6 rad and places to that of the longest body; what is determined of forces and moments to a share of
    the largest reaction, of the motors' to a share of their largest.
    """
    size = max(body.length for body in m.bodies) or 1.0
    largest = max(abs(p.forces[j.name]) for p in posed for j in m.joints)
    for body in m.bodies:
        k = judge.index[body.name]
        close(trace.signals[f"{body.name}_angle"], np.array([p.q[k + 2] for p in posed]), 1e-6, body.name)
        close(vector(trace, body.name), np.array([judge.point(p.q, body.name, "com") for p in posed]), 1e-6 * size)
        bends = np.array([p.accelerations[k : k + 2] @ (1, 1j) for p in posed])
        close(body.mass * trace.rates[body.name].acceleration, body.mass * bends, within * largest, body.name)
    for name in {j.name for j in m.joints} - posed[0].undetermined:
        right = np.array([p.forces[name] for p in posed])
        close(vector(trace, f"reaction_{name}"), right, within * largest, f"reaction_{name}")
    for name in posed[0].moments:
        right = np.array([p.moments[name] for p in posed])
        close(trace.signals[f"reaction_{name}_moment"], right, within * largest * size, name)
    for name, signal in drive_signals(m, posed[0].motors).items():
        right = np.array([p.motors[name] for p in posed])
        close(trace.signals[signal], right, within * np.abs(right).max(), signal)


def drive_signals(m: Mechanism, driven: Mapping[str, object]) -> dict[str, str]:
    """What the motor in each driven joint gives, by its name in a trace."""
    if len(driven) == 1 and not m.joint(next(iter(driven))).prismatic:
        return dict.fromkeys(driven, "drive_torque")
    return {name: f"drive_{'force' if m.joint(name).prismatic else 'torque'}_{name}" for name in driven}


def moved(
    chosen: Engine, m: Mechanism, courses: Knots, model: JointModel = "ideal", times: np.ndarray = TIMES
) -> Trace:
    return chosen.simulate(request_of(m, model, "driven", time=times, courses=courses))


def driven_at(m: Mechanism, **speeds: float) -> Mechanism:
    """The mechanism with these drives in place of its own."""
    return m.replace(drives=tuple(Drive(joint=joint, speed=speed) for joint, speed in speeds.items()))


# ---------------------------------------------------------------- ideal joints along courses


@pytest.mark.parametrize("name", [*(n for n in CASES if n not in SLOW_CASES), *slow(*SLOW_CASES)])
def test_every_drive_follows_its_course_with_the_forces_of_the_referee(leapfrog: Engine, name: str) -> None:
    m = CASES[name].with_clearances({})
    courses = waved(m)
    trace = moved(leapfrog, m, courses)
    agrees(m, trace, *referee(m, courses, TIMES))
    first = m.drives[0].joint
    close(trace.crank_angle, splines(courses)[first](TIMES), 1e-9)
    np.testing.assert_array_equal(trace.time, TIMES)


@pytest.mark.parametrize(
    "m",
    [
        loads(GANTRY, "gantry"),
        turned_round(driven_at(FIVE_BAR, D=1.0, A=-0.7), "A"),
        *slow(
            turned_round(load("3-rpr"), "S1", "A2"),
            turned_round(ARM, "O", "K"),
            driven_at(FIVE_BAR, A=1.0, P=-0.7),
            driven_at(load("3-rrr"), A1=0.5, B1=0.3, C1=0.2),
            driven_at(load("3-rpr"), S1=0.03, A2=0.1, C3=0.2),
        ),
    ],
    ids=lambda m: f"{m.name} at {' '.join(d.joint for d in m.drives)}",
)
def test_a_motor_may_be_in_any_joint_whichever_body_is_its_first(leapfrog: Engine, m: Mechanism) -> None:
    courses = waved(m)
    agrees(m, moved(leapfrog, m, courses), *referee(m, courses, TIMES))


def test_reports_come_in_the_order_asked_for_on_the_clock_of_the_courses(leapfrog: Engine) -> None:
    courses = waved(FIVE_BAR)
    later = {name: (knots + 5.0, at) for name, (knots, at) in courses.items()}
    times = np.array([0.1, 0.0, 0.13, 0.0031, 0.1])
    trace, right = moved(leapfrog, FIVE_BAR, later, times=times + 5.0), referee(FIVE_BAR, courses, np.sort(times))[1]
    np.testing.assert_array_equal(trace.time, times + 5.0)
    torque = np.array([p.motors["E"] for p in right])[np.argsort(np.argsort(times, kind="stable"))]
    close(trace.signals["drive_torque_E"], torque, 1e-5 * np.abs(torque).max())
    close(trace.signals["position_D"], splines(courses)["D"](times), 1e-8)


def test_friction_takes_what_the_motors_give_beside_the_energy(leapfrog: Engine) -> None:
    """Power of motors less that of dry friction is the growth of the energy."""
    m, friction = FIVE_BAR, 0.05
    for joint in ("A", "P"):
        m = m.with_joint(joint, friction_torque=friction)
    times = np.linspace(0.0, 0.2, 81)
    trace = moved(leapfrog, m, waved(m), times=times)
    power = sum(trace.signals[f"drive_torque_{name}"] * course(times, 1) for name, course in splines(waved(m)).items())
    spin = {j: np.gradient(trace.signals[f"position_{j}"], times, edge_order=2) for j in ("A", "P")}
    given = power - friction * sum(np.abs(rate) for rate in spin.values())
    gained = np.concatenate([[0.0], np.cumsum((given[1:] + given[:-1]) / 2 * np.diff(times))])
    held = energy(m, trace)
    assert friction * np.abs(spin["P"]).min() > 0.01 * np.abs(power).max()
    close(held - held[0], gained, 1e-4 * np.ptp(held))


# ---------------------------------------------------------------- nothing drives all of it


def test_a_double_pendulum_swings_as_lagrange_says_and_keeps_its_energy(leapfrog: Engine) -> None:
    m, times = SWINGING, np.linspace(0.0, 0.5, 11)
    trace = moved(leapfrog, m, {}, times=times)
    for name, angle in zip(("upper-arm", "forearm"), double_pendulum(m, times), strict=True):
        close(trace.signals[f"{name}_angle"], angle, 1e-6)
    assert np.ptp(energy(m, trace)) < 1e-6
    assert not [name for name in trace.signals if name.startswith("drive")]
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["upper-arm_angle"])


def test_a_forearm_hangs_freely_on_a_driven_arm(leapfrog: Engine) -> None:
    m, times = HANGING, np.linspace(0.0, 0.3, 61)
    trace = moved(leapfrog, m, {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}, times=times)
    for name, angle in zip(("upper-arm", "forearm"), double_pendulum(m, times, 2.0), strict=True):
        close(trace.signals[f"{name}_angle"], angle, 1e-6)
    power = 2.0 * trace.signals["drive_torque"]
    gained = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(times))])
    held = energy(m, trace)
    close(held - held[0], gained, 1e-4 * np.ptp(held))


def test_a_loop_with_one_drive_too_few_moves_as_the_referee_says(leapfrog: Engine) -> None:
    m = FIVE_BAR.replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="E", speed="free")))
    at, times = Assembly(m).positions, np.linspace(0.0, 0.04, 5)
    course = {"D": (KNOTS, at["D"] + 2.0 * KNOTS)}
    motor, held, judge = splines(course)["D"], Maximal(m, ("D", "E")), Maximal(m, ("D",))
    start = held.driven_at(held.home(at), {"D": (at["D"], 2.0, 0.0), "E": (at["E"], 0.0, 0.0)})
    posed = judge.released(start.q, start.rates, times, {"D": lambda t, order: float(motor(t, order))})
    agrees(m, moved(leapfrog, m, course, times=times), judge, posed, 2e-5)


# ---------------------------------------------------------------- clearance


PINS = {
    "five-bar": {"P": LOOSE},
    "five-bar, driven pins": {"D": LOOSE, "A": LOOSE},
    "3-rrr": {"C1": LOOSE, "B2": LOOSE},
    "3-rpr": {"C1": LOOSE, "A2": LOOSE},
    "2r-arm": {"K": LOOSE},
    "2r-arm, both": {"O": LOOSE, "K": LOOSE},
}
MODELS: list[tuple[str, JointModel]] = [("dart", "spring-damper"), ("dart", "contact"), ("pybullet", "spring-damper")]


RIMS: list[tuple[str, JointModel, str]] = [
    ("dart", "contact", "five-bar, driven pins"),
    ("dart", "spring-damper", "2r-arm, both"),
    ("pybullet", "spring-damper", "2r-arm"),
]
MORE_RIMS = [row for name, model in MODELS for case in PINS if (row := (name, model, case)) not in RIMS]


@pytest.mark.parametrize(("name", "model", "case"), [*RIMS, *slow(*MORE_RIMS)])
def test_loose_pins_begin_pressed_and_stay_so(name: str, model: JointModel, case: str) -> None:
    m = load(case.split(",")[0])
    m = turned_round(driven_at(m, D=1.0, A=-0.4), "A") if case == "five-bar, driven pins" else m
    m, courses, times = m.with_clearances(PINS[case]), waved(m), np.linspace(0.0, 0.15, 6)
    for joint in m.clearances:
        m = m.with_joint(joint, contact_stiffness=1e6)
    trace = moved(engine(name), m, courses, model, times)
    assert trace.free_share == dict.fromkeys(m.clearances, 0.0)
    hard = {"spring-damper": 1e6, "contact": np.inf}[model]
    truth = on_the_rims(m, courses, dict.fromkeys(m.clearances, hard), times, 0.24)
    right, largest = truth.signals(), max(np.abs(force).max() for force in truth.forces.values())
    most = max(np.abs(values).max() for signal, values in right.items() if signal.startswith("drive"))
    for signal, values in right.items():
        if signal.endswith("_angle"):
            close(trace.signals[signal], values, 2e-6, signal)
        elif signal.startswith("reaction") and not signal.endswith("moment"):
            close(trace.signals[signal], values, 5e-4 * largest, signal)
        elif signal.startswith("drive"):
            close(trace.signals[signal], values, 5e-4 * most, signal)
    for joint in m.clearances:
        close(np.angle(vector(trace, f"clearance_{joint}") / vector(trace, f"reaction_{joint}")), np.zeros(6), 1e-4)


@pytest.mark.slow
def test_a_pin_put_back_on_its_rim_opens_no_other_loop() -> None:
    m, times = load("3-rrr").with_clearances({"C1": LOOSE}), np.linspace(0.0, 1.0, 11)  # s: held badly towards the end
    at = Assembly(m).positions
    courses = {d.joint: (times, at[d.joint] + float(d.speed) * times) for d in m.drives}
    asked = request_of(m, "contact", "driven", time=times, courses=courses)
    coarse, fine = (engine("dart").simulate(replace(asked, step=step)) for step in (2e-4, 1e-4))
    largest = max(np.abs(vector(fine, f"reaction_{joint.name}")).max() for joint in m.joints)
    for joint in m.joints:
        name = f"reaction_{joint.name}"
        close(vector(coarse, name), vector(fine, name), 5e-5 * largest, name)


@pytest.mark.parametrize(("name", "model"), MODELS)
def test_pins_of_what_moves_freely_begin_pressed(name: str, model: JointModel) -> None:
    m, times, course = HANGING, np.linspace(0.0, 0.15, 4), {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}
    loose = moved(engine(name), m.with_clearances({"K": 1e-5}), course, model, times)
    assert loose.free_share == {"K": 0.0}
    close(loose.signals["forearm_angle"], double_pendulum(m, times, 2.0)[1], 1e-4)


# ---------------------------------------------------------------- springs between points


def on_springs(m: Mechanism) -> Mechanism:
    """The paper's four-bar with a spring between two moving bodies, and one on the ground."""
    springs = (
        Spring(bodies=("crank", "follower"), points=("A", "E"), stiffness=300.0, length=0.2, damping=30.0),
        Spring(bodies=("ground", "coupler"), points=("E", "com"), stiffness=60.0, length=0.1, damping=40.0),
    )
    return m.replace(springs=springs)


@pytest.mark.parametrize("motion", ["driven", "static"])
def test_springs_pull_a_cranks_linkage_as_the_referee_says(leapfrog: Engine, motion: Motion) -> None:
    m, theta = on_springs(load("paper").with_clearances({})), np.radians([30.0, 45.0, 60.0])
    trace, judge = leapfrog.simulate(request_of(m, "ideal", motion, theta)), Maximal(m, ("D",))
    speed = 0.0 if motion == "static" else float(m.speed or 0.0)
    q = judge.home({"D": m.assembly["crank"]})
    posed = [judge.driven_at(q, {"D": (float(angle), speed, 0.0)}) for angle in theta]
    largest, late = max(abs(force) for p in posed for force in p.forces.values()), 5e-5  # dampers lag by half a step
    for joint in m.joints:
        right = np.array([p.forces[joint.name] for p in posed])
        close(vector(trace, f"reaction_{joint.name}"), right, late * largest, joint.name)
    torque = np.array([p.motors["D"] for p in posed])
    close(trace.signals["drive_torque"], torque, late * np.abs(torque).max())


SPRUNG: list[tuple[str, JointModel, Motion]] = [
    ("dart", "spring-damper", "driven"),
    ("pybullet", "contact", "static"),
]
MORE_SPRUNG: list[tuple[str, JointModel, Motion]] = [
    ("dart", "spring-damper", "static"),
    ("dart", "contact", "driven"),
    ("dart", "contact", "static"),
    ("pybullet", "spring-damper", "driven"),
    ("pybullet", "spring-damper", "static"),
    ("pybullet", "massless-link", "static"),
]


@pytest.mark.parametrize(("name", "model", "motion"), [*SPRUNG, *slow(*MORE_SPRUNG)])
def test_springs_pull_loose_linkages_as_tight_ones(name: str, model: JointModel, motion: Motion) -> None:
    m, theta = on_springs(load("paper")), np.radians([30.0, 32.0, 34.0])
    tight, loose = (
        engine(name).simulate(request_of(m.with_clearances(gaps), joint_model, motion, theta))
        for gaps, joint_model in (({}, "ideal"), ({"B": 1e-6}, model))
    )
    bare = engine(name).simulate(request_of(m.replace(springs=()).with_clearances({}), "ideal", motion, theta))
    torque = {id(t): t.signals["drive_torque"] for t in (tight, loose, bare)}
    assert np.abs(torque[id(tight)] - torque[id(bare)]).min() > 1.0
    close(torque[id(loose)], torque[id(tight)], 2e-4 * np.abs(torque[id(tight)]).max())


def test_a_pendulum_that_is_let_go_on_a_spring_swings_as_its_equation_says(leapfrog: Engine) -> None:
    m, times = pendulum_on_a_spring(), np.linspace(0.0, 0.3, 7)
    angle, right = f"{m.bodies[0].name}_angle", swung_on_its_spring(m, times)
    seen: Callable[[Request], Trace] = leapfrog.simulate
    close(seen(request_of(m, time=times)).signals[angle], right, 2e-5)  # of the first order in its steps
    close(seen(request_of(m, time=times, courses={})).signals[angle], right, 1e-6)


# ---------------------------------------------------------------- what is refused


def test_courses_that_the_linkage_cannot_follow_are_the_requests_fault(leapfrog: Engine) -> None:
    m = load("3-rrr")
    courses = waved(m)
    knots, at = courses["A1"]
    with pytest.raises(AssemblyError):
        moved(leapfrog, m, {**courses, "A1": (knots, at + 30 * knots)})


def test_a_drive_that_yields_follows_no_course_beside_others(leapfrog: Engine) -> None:
    m = load("crank-rocker")
    m = m.replace(drives=(m.drives[0].model_copy(update={"stiffness": 50.0}),))
    with pytest.raises(Unsupported, match=r"leave out drive\.stiffness"):
        moved(leapfrog, m, waved(m))
