"""Exudyn with several drives, with freedoms that nothing drives, and with springs between points: against a referee in
maximal coordinates, Newton's and Lagrange's equations written here, and the balance of energy.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import load
from asked import request_of
from engine_checks import vector
from marks import slow
from maximal import Maximal
from several_linkages import CASES, KNOTS, SHIPPED, TIMES, Knots, referee, splines, sprung, third_bar, waved
from several_truths import (
    ARM,
    HANGING,
    SWINGING,
    G,
    agrees,
    close,
    double_pendulum,
    energy,
    gains_what_motors_give,
    gives_what_the_spring_takes,
    holds_by_its_stretch,
    pendulum_on_a_spring,
    pulls_each_as_the_other,
    rattled,
    resting,
    swung_on_its_spring,
    turned_round,
)
from sim_models.engine import JOINT_MODELS, Cause, JointModel, Motion, SimulationError, Trace, Unsupported
from sim_models.exudyn.engine import ENGINE

pytestmark = pytest.mark.exudyn

CLEARANCE_MODELS: tuple[JointModel, ...] = JOINT_MODELS[1:]
FIVE_BAR = load("five-bar")
NEAR = {"within": 1e-6, "motors": 3e-6, "rates": 3e-6}
DRIVEN_ARM = {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}


def run(m: Mechanism, courses: Knots, times: np.ndarray, model: JointModel = "ideal", **fields: object) -> Trace:
    return ENGINE.simulate(request_of(m, model, "driven", time=times, courses=courses, **fields))


# ---------------------------------------------------------------- ideal joints along courses


@pytest.mark.parametrize("name", [*SHIPPED, "parallelogram", *slow(*(n for n in CASES if "springs" in n))])
def test_every_drive_follows_its_course_with_the_forces_of_the_referee(name: str) -> None:
    m = CASES[name].with_clearances({})
    courses = waved(m)
    trace = run(m, courses, TIMES)
    agrees(m, trace, *referee(m, courses, TIMES), **NEAR)
    close(trace.crank_angle, splines(courses)[m.drives[0].joint](TIMES), 1e-7)


@pytest.mark.parametrize(
    ("case", "joints"), [("2r-arm", ("O", "K")), ("3-rpr", ("S1", "A2")), *slow(("five-bar", ("D", "A")))]
)
def test_it_does_not_matter_which_body_of_a_joint_is_its_first(case: str, joints: tuple[str, ...]) -> None:
    m = turned_round(load(case), *joints)
    trace = run(m, waved(m), TIMES)
    agrees(m, trace, *referee(m, waved(m), TIMES), **NEAR)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_gantry_is_pushed_as_newton_says(backwards: bool) -> None:
    """A carriage on a slope of the ground, a head across it: each motor carries all that is beyond, along its slide."""
    along = np.exp(0.3j)
    names = {"X": ("ground", "carriage"), "Y": ("carriage", "head")}
    joints = [
        {
            "name": name, "type": "prismatic", "bodies": bodies[::-1] if backwards else bodies,
            "axis": {"X": (along.real, along.imag), "Y": (0.0, 1.0)}[name],
            "angle": 0.3 if name == "X" else 0.0,
        }
        for name, bodies in names.items()
    ]  # fmt: skip
    if backwards:  # axes and angles are the other bodies' then
        joints[0] |= {"axis": (1.0, 0.0), "angle": -0.3}
    bodies = [
        {"name": "carriage", "points": {"X": (0.0, 0.0), "Y": (0.1, 0.0)}, "mass": 2.0, "inertia": 0.01},
        {"name": "head", "points": {"Y": (0.0, 0.0), "tool": (0.0, 0.1)}, "mass": 0.7, "inertia": 0.001},
    ]
    m = Mechanism.model_validate(
        {
            "name": "gantry", "gravity": (0.0, -G), "ground": {"points": {"X": (0.0, 0.0)}}, "body": bodies,
            "joint": joints, "drive": [{"joint": "X", "speed": 0.1}, {"joint": "Y", "speed": 0.1}],
            "load": [{"body": "head", "point": "tool", "force": (3.0, -4.0)}],
            "assembly": {"carriage": 0.3, "head": 0.3},
        }
    )  # fmt: skip
    courses = {"X": (KNOTS, 0.2 * np.sin(5 * KNOTS)), "Y": (KNOTS, 0.3 - 0.3 * np.cos(4 * KNOTS))}
    trace = run(m, courses, TIMES)
    x, y = (f(TIMES, 2) for f in splines(courses).values())
    x, y = (-x, -y) if backwards else (x, y)  # a joint's position is of its second body on its first
    head = 0.7 * (x * along + y * 1j * along + 1j * G) - (3.0 - 4.0j)
    both = head + 2.0 * (x * along + 1j * G)
    for name, force, axis in (("X", both, along), ("Y", head, 1j * along)):
        sign = -1.0 if backwards else 1.0
        close(vector(trace, f"reaction_{name}"), sign * force, 1e-6 * np.abs(both).max())
        close(trace.signals[f"drive_force_{name}"], sign * np.real(np.conj(axis) * force), 1e-6 * np.abs(both).max())


@pytest.mark.parametrize("off", [0.05, 2.0**-54, 0.0], ids=["eccentric", "balanced but for rounding", "balanced"])
def test_rotors_of_one_point_turn_on_their_pins(off: float) -> None:
    """Bodies without a length, whose pins are off by rounding: a reaction carries weight and centripetal force, a motor
    the moment of the weight.
    """
    pins, speeds = {"D": 0.1 + 0.2j, "E": 0.37 + 0.011j}, {"D": 1.0, "E": -0.7}
    bodies = [
        {"name": name, "points": {joint: at}, "mass": 1.0, "com": (at[0] + off, at[1]), "inertia": 3e-3}
        for name, joint, at in (("a", "D", (0.03, 0.07)), ("b", "E", (0.013, 0.17)))
    ]
    m = Mechanism.model_validate(
        {
            "name": "rotors", "gravity": (0.0, -G), "body": bodies, "assembly": {"a": 0.3, "b": 1.1},
            "ground": {"points": {joint: (at.real, at.imag) for joint, at in pins.items()}},
            "joint": [{"name": j, "type": "revolute", "bodies": ("ground", b)} for j, b in (("D", "a"), ("E", "b"))],
            "drive": [{"joint": joint, "speed": speed} for joint, speed in speeds.items()],
        }
    )  # fmt: skip
    begins = {"D": 0.3, "E": 1.1}
    trace = run(m, {joint: (KNOTS, begins[joint] + speed * KNOTS) for joint, speed in speeds.items()}, TIMES)
    for joint, speed in speeds.items():
        arm = off * np.exp(1j * (begins[joint] + speed * TIMES))
        close(vector(trace, f"reaction_{joint}"), 1j * G - speed**2 * arm, 1e-6 * G)
        close(trace.signals[f"drive_torque_{joint}"], G * arm.real, 1e-7)


def test_what_motors_give_is_what_the_linkage_gains_in_energy_and_loses_in_dampers() -> None:
    m, times = CASES["3-rpr with springs"], np.linspace(0.0, 0.2, 101)
    gains_what_motors_give(m, run(m, waved(m), times), waved(m), times)


def test_courses_may_begin_late_and_have_knots_of_their_own() -> None:
    at = Assembly(ARM).positions
    first, second = np.linspace(7.0, 7.6, 31), np.linspace(7.013, 7.6, 47)
    courses = {
        "O": (first, at["O"] + 0.4 * np.sin(3 * (first - 7))),
        "K": (second, at["K"] - 0.5 * np.sin(4 * second)),
    }
    times = np.array([7.4, 7.02, 7.58, 7.4])
    trace, motors, judge = run(ARM, courses, times), splines(courses), Maximal(ARM, ("O", "K"))
    np.testing.assert_array_equal(trace.time, times)
    home = judge.home(at)
    posed = [
        judge.driven_at(home, {n: (float(f(t)), float(f(t, 1)), float(f(t, 2))) for n, f in motors.items()})
        for t in times
    ]
    agrees(ARM, trace, judge, posed, **NEAR)


def test_a_crank_on_a_course_is_the_same_by_either_way() -> None:
    """Where the fastest body, not the crank, says how long a step is."""
    m = load("paper").with_clearances({})
    m = m.replace(drives=(Drive(joint="D", speed="measured"),))
    angle = np.radians(30.0) + 1.5 * KNOTS + 4.0 * KNOTS**2
    one = ENGINE.simulate(request_of(m, "ideal", "driven", time=TIMES[:5], course=(KNOTS, angle)))
    other = run(m, {"D": (KNOTS, angle)}, TIMES[:5])
    assert set(one.signals) == set(other.signals)
    for name, values in one.signals.items():
        close(other.signals[name], values, 2e-6 * max(1.0, np.abs(values).max()))


# ---------------------------------------------------------------- what nothing drives


def test_a_double_pendulum_swings_as_lagrange_says_and_keeps_its_energy() -> None:
    times = np.linspace(0.0, 0.6, 13)
    trace, right = run(SWINGING, {}, times), double_pendulum(SWINGING, times)
    for name, angle in zip(("upper-arm", "forearm"), right, strict=True):
        close(trace.signals[f"{name}_angle"], angle, 2e-6)
    assert np.ptp(energy(SWINGING, trace)) < 5e-6
    assert not [name for name in trace.signals if name.startswith("drive")]
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["upper-arm_angle"])


def test_a_forearm_hangs_freely_on_a_driven_arm() -> None:
    times = np.linspace(0.0, 0.6, 13)
    trace = run(HANGING, DRIVEN_ARM, times)
    right = double_pendulum(HANGING, times, 2.0)
    close(trace.signals["upper-arm_angle"], right[0], 1e-10)
    close(trace.signals["forearm_angle"], right[1], 1e-6)
    gained = CubicSpline(times, 2.0 * trace.signals["drive_torque"]).antiderivative()(times)
    assert energy(HANGING, trace)[-1] - energy(HANGING, trace)[0] == pytest.approx(float(gained[-1]), rel=1e-3)


def test_loops_with_one_drive_too_few_move_as_the_referee_says() -> None:
    m = FIVE_BAR.replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="E", speed="free")))
    at, times = Assembly(m).positions, np.linspace(0.0, 0.04, 5)
    course = {"D": (KNOTS, at["D"] + 2.0 * KNOTS)}
    trace, motor = run(m, course, times), CubicSpline(*course["D"])
    held = Maximal(m, ("D", "E"))
    start = held.driven_at(held.home(at), {"D": (at["D"], 2.0, 0.0), "E": (at["E"], 0.0, 0.0)})
    judge = Maximal(m, ("D",))
    posed = judge.released(start.q, start.rates, times, {"D": lambda t, order: float(motor(t, order))})
    agrees(m, trace, judge, posed, within=3e-6, motors=9e-6, rates=3e-6)


def test_a_motion_through_a_posture_that_holds_itself_twice_is_refused() -> None:
    """Let go, the five-bar's cranks fall outwards alike, until all bars lie in one line; with a push aside they miss
    it.
    """
    m, times = FIVE_BAR.replace(drives=()), np.linspace(0.0, 0.07, 8)
    with pytest.raises(SimulationError, match="stretched out") as failure:
        run(m, {}, times)
    assert failure.value.cause is Cause.DIVERGED
    m = m.replace(loads=(Load(body="left-arm", point="P", force=(7.0, -20.0)),))
    trace, judge = run(m, {}, times), Maximal(m, ())
    posed = judge.released(judge.home({}), np.zeros(12), times, {})
    agrees(m, trace, judge, posed, within=1e-4, motors=3e-4, places=1e-5, rates=3e-5)


# ---------------------------------------------------------------- clearance

PINS = {
    "five-bar": ("P",),
    "five-bar, two pins": ("A", "P"),
    "five-bar, driven": ("D",),
    "3-rrr": ("C1", "B2"),
    "3-rpr": ("C1",),
    "2r-arm": ("K",),
    "2r-arm, both": ("O", "K"),
}


@pytest.mark.parametrize(
    ("case", "model"),
    [
        ("five-bar", "contact"), ("five-bar, driven", "spring-damper"), ("2r-arm, both", "massless-link"),
        *slow(*((case, model) for case in PINS for model in CLEARANCE_MODELS)),
    ],
)  # fmt: skip
def test_pins_pressed_into_small_gaps_follow_courses_as_an_ideal_linkage_does(case: str, model: JointModel) -> None:
    """The rest is what gaps of 1e-5 m, and what a contact gives, do to links of 0.1 m and more; a pin that began off
    its motion would sway by ten times that.
    """
    m, loose = load(case.split(",")[0]), PINS[case]
    courses, times = waved(m), np.linspace(0.0, 0.1, 9)
    trace = run(m.with_clearances(dict.fromkeys(loose, 1e-5)), courses, times, model)
    assert trace.free_share == dict.fromkeys(loose, 0.0)
    _, posed = referee(m, courses, times)
    largest = max(abs(p.forces[j.name]) for p in posed for j in m.joints)
    for joint in m.joints:
        close(vector(trace, f"reaction_{joint.name}"), np.array([p.forces[joint.name] for p in posed]), 8e-4 * largest)
    for name in loose:
        force, gap = vector(trace, f"reaction_{name}"), vector(trace, f"clearance_{name}")
        assert np.abs(np.angle(gap / force)).max() < 1e-6
        assert np.abs(gap).min() > 0.999e-5


@pytest.mark.parametrize("model", [CLEARANCE_MODELS[0], *slow(*CLEARANCE_MODELS[1:])])
def test_pins_of_what_moves_freely_begin_pressed(model: JointModel) -> None:
    times = np.linspace(0.0, 0.3, 7)
    ideal = run(HANGING, DRIVEN_ARM, times)
    loose = run(HANGING.with_clearances({"K": 5e-5}), DRIVEN_ARM, times, model)
    assert loose.free_share == {"K": 0.0}
    close(loose.signals["forearm_angle"], ideal.signals["forearm_angle"], 1e-3)
    force, gap = vector(ideal, "reaction_K"), vector(loose, "clearance_K")
    assert abs(np.angle(gap[0] / force[0])) < 1e-6
    close(vector(loose, "reaction_K"), force, 2e-3 * np.abs(force).max())


@pytest.mark.slow
def test_a_pin_that_starts_centred_falls_and_bounces_as_its_equation_says() -> None:
    m = FIVE_BAR.with_joint("P", clearance=1e-4, contact_stiffness=1e6, contact_damping=60.0)
    courses, times = waved(m), np.linspace(0.0, 3e-3, 16)
    trace = run(m, courses, times, "spring-damper", start="centred", step=2e-6)
    gap, force, _ = rattled(m, courses, times)
    close(vector(trace, "clearance_P"), gap, 3e-7)  # a step in which contact begins or ends is of the first order
    close(vector(trace, "reaction_P"), force, 5e-3 * np.abs(force).max())


@pytest.mark.slow
@pytest.mark.parametrize("model", ["massless-link", "contact"])
def test_loops_that_hold_too_much_are_started_centred(model: JointModel) -> None:
    m = third_bar().with_clearances({"f2": 1e-3})
    courses = waved(m)
    with pytest.raises(SimulationError, match="start it centred") as failure:
        run(m, courses, TIMES, model)
    assert failure.value.cause is Cause.NO_START
    trace, ideal = run(m, courses, TIMES, "contact", start="centred"), run(m, courses, TIMES)
    torque = ideal.signals["drive_torque"]
    close(trace.signals["drive_torque"], torque, 0.02 * np.abs(torque).max())


# ---------------------------------------------------------------- loops that hold themselves twice, behind a crank


@pytest.mark.parametrize("motion", ["driven", "static"])
def test_a_third_bar_leaves_the_torque_of_a_crank_as_the_energy_says(motion: Motion) -> None:
    """The bars go round in circles alike: coupler and third bar without turning, at a constant speed without power."""
    m = third_bar().with_clearances({})
    theta = np.radians([30.0, 45.0, 60.0])
    trace = ENGINE.simulate(request_of(m, "ideal", motion, theta))
    fine = np.radians(np.linspace(29.0, 61.0, 257))
    held = resting(m, ENGINE.simulate(request_of(m, "ideal", "static", fine)))
    slope = CubicSpline(fine, held)(theta, 1)
    close(trace.signals["drive_torque"], slope, 2e-6 * np.abs(slope).max())


# ---------------------------------------------------------------- springs between points


@pytest.mark.parametrize("model", JOINT_MODELS)
def test_at_rest_a_spring_holds_by_its_stretch_and_its_damper_does_nothing(model: JointModel) -> None:
    holds_by_its_stretch(ENGINE, model, 61)


@pytest.mark.parametrize("model", ["ideal", *slow("massless-link", "spring-damper", "contact")])
def test_a_crank_that_turns_against_a_spring_and_its_damper_gives_what_they_take(model: JointModel) -> None:
    gives_what_the_spring_takes(ENGINE, model, np.radians(np.linspace(30.0, 45.0, 16)))


def test_a_pendulum_on_a_spring_swings_as_its_equation_says() -> None:
    m, times = pendulum_on_a_spring(), np.linspace(0.0, 0.6, 13)
    trace = ENGINE.simulate(request_of(m, "ideal", "driven", time=times))
    close(trace.signals[f"{m.bodies[0].name}_angle"], swung_on_its_spring(m, times), 1e-6)


@pytest.mark.parametrize("motion", ["driven", "static"])
def test_a_spring_between_two_moving_bodies_pulls_each_as_the_other(motion: Motion) -> None:
    pulls_each_as_the_other(ENGINE, motion)


def test_pins_begin_pressed_against_springs_and_their_dampers() -> None:
    m = sprung(ARM)
    courses, times = waved(m), np.linspace(0.0, 0.1, 5)
    trace = run(m.with_clearances({"K": 1e-5}), courses, times, "contact")
    _, posed = referee(m, courses, times)
    close(vector(trace, "reaction_K"), np.array([p.forces["K"] for p in posed]), 8e-4 * abs(posed[0].forces["K"]))
    assert trace.free_share == {"K": 0.0}


# ---------------------------------------------------------------- refusals


def test_what_cannot_be_followed_is_refused_in_words() -> None:
    courses = waved(load("3-rpr"))
    with pytest.raises(Unsupported, match="give each drive its course"):
        run(load("3-rpr"), {"S1": courses["S1"]}, TIMES)
    with pytest.raises(AssemblyError):
        run(load("3-rpr"), courses | {"S1": (KNOTS, courses["S1"][1] + 3.0 * KNOTS)}, TIMES)
    soft = load("paper").replace(drives=(Drive(joint="D", speed="measured", stiffness=500.0),))
    with pytest.raises(Unsupported, match="rigidly"):
        run(soft, {"D": (KNOTS, np.radians(30.0) + KNOTS)}, TIMES)
