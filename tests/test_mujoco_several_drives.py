"""MuJoCo with several drives, with freedoms that nothing drives, and with springs between points: against a referee in
maximal coordinates, against equations of motion written here, and against the balance of energy.
"""

from __future__ import annotations

from collections.abc import Mapping

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
from several_linkages import CASES, KNOTS, TIMES, Knots, referee, splines, third_bar, waved
from several_truths import (
    HANGING,
    SWINGING,
    agrees,
    close,
    double_pendulum,
    energy,
    gains_what_motors_give,
    gives_what_the_spring_takes,
    holds_by_its_stretch,
    on_the_rims,
    pendulum_on_a_spring,
    pulls_each_as_the_other,
    rattled,
    swung_on_its_spring,
    turned_round,
)
from sim_models.engine import JOINT_MODELS, Cause, JointModel, Motion, SimulationError, Trace, Unsupported
from sim_models.mujoco.engine import ENGINE

pytestmark = pytest.mark.mujoco

CLEARANCE_MODELS: tuple[JointModel, ...] = JOINT_MODELS[1:]
FIVE_BAR = load("five-bar")
LOOSE = 2e-4  # m
NEAR = {"within": 1e-5, "motors": 1e-5, "rates": 1e-5}
LATER = ("3-rrr with springs", "five-bar with springs")  # for the long suite


def run(m: Mechanism, courses: Knots, times: np.ndarray, model: JointModel = "ideal", **fields: object) -> Trace:
    return ENGINE.simulate(request_of(m, model, "driven", time=times, courses=courses, **fields))


# ---------------------------------------------------------------- ideal joints along courses


@pytest.mark.parametrize("name", [n for n in CASES if n not in LATER] + slow(*LATER))
def test_every_drive_follows_its_course_with_the_forces_of_the_referee(name: str) -> None:
    m = CASES[name].with_clearances({})
    courses = waved(m)
    trace = run(m, courses, TIMES)
    agrees(m, trace, *referee(m, courses, TIMES), **NEAR)
    first = m.drives[0].joint
    close(trace.crank_angle, splines(courses)[first](TIMES), 1e-10)


@pytest.mark.parametrize(
    ("case", "joints"), [("five-bar", ("D", "A")), ("2r-arm", ("O", "K")), ("3-rpr", ("S1", "A2"))]
)
def test_it_does_not_matter_which_body_of_a_joint_is_its_first(case: str, joints: tuple[str, ...]) -> None:
    m = turned_round(load(case), *joints)
    trace = run(m, waved(m), TIMES)
    agrees(m, trace, *referee(m, waved(m), TIMES), **NEAR)


def test_what_motors_give_is_what_the_linkage_gains_in_energy_and_loses_in_dampers() -> None:
    m, times = CASES["3-rpr with springs"], np.linspace(0.0, 0.3, 151)
    gains_what_motors_give(m, run(m, waved(m), times), waved(m), times)


@pytest.mark.parametrize("clock", [0.0, 5.0])
def test_reports_come_in_the_order_asked_for_at_the_times_of_the_courses_clock(clock: float) -> None:
    courses = {name: (knots + clock, at) for name, (knots, at) in waved(FIVE_BAR).items()}
    times = np.array([0.31, 0.0, 0.6, 0.005, 0.31])
    trace = run(FIVE_BAR, courses, times + clock)
    np.testing.assert_array_equal(trace.time, times + clock)
    for name, f in splines(waved(FIVE_BAR)).items():
        close(trace.signals[f"position_{name}"], f(times), 1e-9)
    assert trace.signals["drive_torque_D"][0] == pytest.approx(trace.signals["drive_torque_D"][4], rel=1e-5)


def test_a_linkage_a_thousand_times_smaller_and_a_million_times_lighter_runs_as_well() -> None:
    def shrunk(points: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        return {name: (x / 1e3, y / 1e3) for name, (x, y) in points.items()}

    small = FIVE_BAR.replace(
        ground=FIVE_BAR.ground.model_copy(update={"points": shrunk(FIVE_BAR.ground.points)}),
        bodies=tuple(
            b.model_copy(update={"points": shrunk(b.points), "mass": b.mass / 1e6, "section": (1e-5, 1e-5)})
            for b in FIVE_BAR.bodies
        ),
        loads=(Load(body="left-arm", point="P", force=(0.0, -2e-5)),),
    )
    soon = TIMES / 20  # its gravity is as fast as that of a linkage that is thirty times slower
    trace = run(small, waved(small), soon)
    agrees(small, trace, *referee(small, waved(small), soon), **NEAR)


def test_courses_that_cannot_be_followed_are_the_requests_fault() -> None:
    m, courses = load("3-rrr"), waved(load("3-rrr"))
    knots, at = courses["A1"]
    with pytest.raises(AssemblyError, match=r"A1 = .*(cannot be reached|change point)|change point at A1"):
        run(m, {**courses, "A1": (knots, at + 6 * knots)}, TIMES)


def test_a_drive_that_yields_is_refused() -> None:
    crank = load("crank-rocker")
    assert crank.drive is not None
    m = crank.replace(drive=crank.drive.model_copy(update={"stiffness": 50.0}))
    with pytest.raises(Unsupported, match="stiffness"):
        run(m, waved(m), TIMES)


# ---------------------------------------------------------------- nothing drives all of it


def test_a_double_pendulum_swings_as_lagrange_says_and_keeps_its_energy() -> None:
    m, times = SWINGING, np.linspace(0.0, 1.0, 21)
    trace, right = run(m, {}, times), double_pendulum(m, times)
    for name, angle in zip(("upper-arm", "forearm"), right, strict=True):
        close(trace.signals[f"{name}_angle"], angle, 1e-6)
    assert np.ptp(energy(m, trace)) < 1e-8
    assert not [name for name in trace.signals if name.startswith("drive")]
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["upper-arm_angle"])


def test_a_forearm_hangs_freely_on_a_driven_arm() -> None:
    m, times = HANGING, np.linspace(0.0, 0.6, 13)
    trace = run(m, {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}, times)
    right = double_pendulum(m, times, 2.0)
    close(trace.signals["upper-arm_angle"], right[0], 1e-10)
    close(trace.signals["forearm_angle"], right[1], 1e-6)
    gained = CubicSpline(times, 2.0 * trace.signals["drive_torque"]).antiderivative()(times)
    assert energy(m, trace)[-1] - energy(m, trace)[0] == pytest.approx(float(gained[-1]), rel=1e-3)


def test_loops_with_one_drive_too_few_move_as_the_referee_says() -> None:
    m = FIVE_BAR.replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="E", speed="free")))
    at, times = Assembly(m).positions, np.linspace(0.0, 0.04, 5)
    course = {"D": (KNOTS, at["D"] + 2.0 * KNOTS)}
    trace, motor = run(m, course, times), CubicSpline(*course["D"])
    held = Maximal(m, ("D", "E"))
    start = held.driven_at(held.home(at), {"D": (at["D"], 2.0, 0.0), "E": (at["E"], 0.0, 0.0)})
    judge = Maximal(m, ("D",))
    posed = judge.released(start.q, start.rates, times, {"D": lambda t, order: float(motor(t, order))})
    agrees(m, trace, judge, posed, within=3e-5, motors=3e-5, rates=1e-5)


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
        ("2r-arm", "contact"),
        *slow(*((case, model) for case in PINS for model in CLEARANCE_MODELS)),
    ],
)  # fmt: skip
def test_loose_pins_begin_pressed_and_stay_so(case: str, model: JointModel) -> None:
    m, loose = load(case.split(",")[0]), dict.fromkeys(PINS[case], LOOSE)
    courses, at = waved(m), np.linspace(0.0, 0.28, 9)
    trace = run(m.with_clearances(loose), courses, at, model)
    assert trace.settings["start"] == "equilibrium"
    assert trace.free_share == dict.fromkeys(loose, 0.0)
    hard = dict.fromkeys(loose, float(trace.settings.get("contact_stiffness", np.inf)))
    truth = on_the_rims(m.with_clearances(loose), courses, hard, at, 0.3)
    right = truth.signals()
    largest = max(np.abs(force).max() for force in truth.forces.values())
    most = max(np.abs(values).max() for name, values in right.items() if name.startswith("drive"))
    for name, values in right.items():
        if name.endswith("_angle"):
            close(trace.signals[name], values, 5e-6)
        elif name.startswith("reaction") and not name.endswith("moment"):
            close(trace.signals[name], values, 5e-4 * largest)
        elif name.startswith("drive"):
            close(trace.signals[name], values, 5e-4 * most)
        elif name.startswith("clearance") and name[:-2].removeprefix("clearance_") in loose:
            close(trace.signals[name], values, 2e-3 * LOOSE)


@pytest.mark.parametrize("model", slow("spring-damper", "contact"))
def test_a_pin_that_starts_centred_falls_and_bounces_as_its_equation_says(model: JointModel) -> None:
    m = FIVE_BAR.with_joint("P", clearance=1e-4, contact_stiffness=1e6, contact_damping=60.0)
    courses, times = waved(m), np.linspace(0.0, 6e-3, 31)
    trace = run(m, courses, times, model, start="centred", step=2e-6)
    gap, force, posed = rattled(m, courses, times)
    close(vector(trace, "clearance_P"), gap, 3e-7)  # a step in which contact begins or ends is of the first order
    close(vector(trace, "reaction_P"), force, 5e-3 * np.abs(force).max())
    close(trace.signals["drive_torque_D"], np.array([p.motors["D"] for p in posed]), 5e-3 * np.abs(force).max() * 0.1)


@pytest.mark.parametrize("model", ["spring-damper", "contact"])
def test_pins_of_what_moves_freely_begin_pressed(model: JointModel) -> None:
    m = HANGING
    times, course = np.linspace(0.0, 0.3, 7), {"O": (KNOTS, -1.2 + 2.0 * KNOTS)}
    ideal, loose = run(m, course, times), run(m.with_clearances({"K": 5e-5}), course, times, model)
    assert loose.free_share == {"K": 0.0}
    close(loose.signals["forearm_angle"], ideal.signals["forearm_angle"], 2e-3)
    force, gap = vector(ideal, "reaction_K")[0], vector(loose, "clearance_K")[0]
    assert abs(np.angle(gap / force)) < 1e-6


def test_loops_that_hold_too_much_are_started_centred() -> None:
    m = third_bar().with_clearances({"f2": 1e-3})
    courses = waved(m)
    with pytest.raises(SimulationError, match="start it centred") as failure:
        run(m, courses, TIMES, "contact")
    assert failure.value.cause is Cause.NO_START
    trace = run(m, courses, TIMES, "contact", start="centred")
    ideal = run(m, courses, TIMES)
    close(
        trace.signals["drive_torque"], ideal.signals["drive_torque"], 0.02 * np.abs(ideal.signals["drive_torque"]).max()
    )


# ---------------------------------------------------------------- springs between points


@pytest.mark.parametrize("model", ["ideal", "contact", *slow("massless-link", "spring-damper")])
def test_at_rest_a_spring_holds_by_its_stretch_and_its_damper_does_nothing(model: JointModel) -> None:
    holds_by_its_stretch(ENGINE, model, 121)


@pytest.mark.parametrize("model", ["ideal", "massless-link", *slow("spring-damper", "contact")])
def test_a_crank_that_turns_against_a_spring_and_its_damper_gives_what_they_take(model: JointModel) -> None:
    gives_what_the_spring_takes(ENGINE, model, np.radians(np.linspace(30.0, 60.0, 61)))


def test_a_pendulum_on_a_spring_swings_as_its_equation_says() -> None:
    m, times = pendulum_on_a_spring(), np.linspace(0.0, 1.0, 21)
    trace = ENGINE.simulate(request_of(m, "ideal", "driven", time=times))
    close(trace.signals[f"{m.bodies[0].name}_angle"], swung_on_its_spring(m, times), 1e-7)


@pytest.mark.parametrize("motion", ["driven", "static"])
def test_a_spring_between_two_moving_bodies_pulls_each_as_the_other(motion: Motion) -> None:
    pulls_each_as_the_other(ENGINE, motion)
