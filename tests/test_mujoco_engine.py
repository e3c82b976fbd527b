"""MuJoCo against the analytic model: both must say the same where both are right."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.schedule import Schedule, ScheduleError
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from asked import request_of
from linkages import inverted_slider, scotch_yoke, six_bar_driven_from_the_rocker
from marks import slow
from sim_models.engine import (
    JOINT_MODELS,
    JointModel,
    Motion,
    SimulationError,
    Trace,
    Unsupported,
    engine,
)
from sim_models.mujoco.engine import ENGINE

pytestmark = pytest.mark.mujoco

PAPER = load("paper")
RANGE = np.radians(np.arange(20.0, 161.0, 5.0))
TURN = np.radians(np.arange(0.0, 360.0, 5.0))
MOTIONS: tuple[Motion, ...] = ("static", "driven")
CLEARANCE_MODELS: tuple[JointModel, ...] = JOINT_MODELS[1:]
# largest error of the reaction at B: angle (deg), magnitude (%)
TOLERANCE = {
    ("ideal", "static"): (1e-3, 0.01), ("massless-link", "static"): (1e-3, 0.01),
    ("spring-damper", "static"): (0.01, 0.05), ("contact", "static"): (0.01, 0.05),
    ("ideal", "driven"): (1e-3, 0.01), ("massless-link", "driven"): (1e-3, 0.01),
    ("spring-damper", "driven"): (0.05, 0.5), ("contact", "driven"): (0.05, 0.5),
}  # fmt: skip


def at_speed(mechanism: Mechanism, **drive: float) -> Mechanism:
    assert mechanism.drive is not None
    return mechanism.replace(drive=mechanism.drive.model_copy(update=drive))


def expected(mechanism: Mechanism, model: JointModel, motion: Motion, theta: np.ndarray) -> dict[str, np.ndarray]:
    clearances = {} if model == "ideal" else mechanism.clearances
    found = displaced(
        Assembly(mechanism), theta, mechanism.speed or 1.0, inertia=motion == "driven", clearances=clearances
    )
    assert not found.flags
    return found.signals()


def error(trace: Trace, truth: dict[str, np.ndarray], prefix: str, skip: tuple[int, ...] = ()) -> float:
    """Largest error of the signals with this prefix, of the largest value among them; moments apart from forces."""
    worst = 0.0
    for moment in (False, True):
        names = [n for n in trace.signals if n.startswith(prefix) and n.endswith("_moment") == moment]
        peak = max((np.abs(truth[n]).max() for n in names), default=0.0)
        worst = max(
            [worst, *(np.abs(np.delete(trace.signals[n] - truth[n], skip)).max() / peak for n in names if peak > 1e-12)]
        )
    return worst


def vector(signals: Mapping[str, np.ndarray], kind: str, joint: str) -> np.ndarray:
    return signals[f"{kind}_{joint}_x"] + 1j * signals[f"{kind}_{joint}_y"]


def angle_error(trace: Trace, truth: dict[str, np.ndarray]) -> float:
    return max(float(np.abs(trace.signals[n] - truth[n]).max()) for n in trace.signals if n.endswith("_angle"))


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("model", JOINT_MODELS)
@pytest.mark.parametrize("clearance", [1e-3, *slow(1e-2, 1e-4)])
def test_reaction_of_the_paper_case_is_the_finite_gap_equilibrium(
    model: JointModel, motion: Motion, clearance: float
) -> None:
    mechanism = PAPER.with_clearances({"B": clearance})
    trace = ENGINE.simulate(request_of(mechanism, model, motion, RANGE))
    truth = expected(mechanism, model, motion, RANGE)
    seen, right = vector(trace.signals, "reaction", "B"), vector(truth, "reaction", "B")
    degrees, percent = TOLERANCE[model, motion]
    assert np.degrees(np.abs(np.angle(seen / right))).max() < degrees
    assert 100 * np.abs(np.abs(seen / right) - 1).max() < percent
    assert set(trace.signals) >= {n for n in truth if not n.endswith("_rotation")}


def test_published_reactions_of_the_paper_case() -> None:
    trace = ENGINE.simulate(request_of(PAPER, "ideal", "driven", np.radians([20.0, 30.0, 60.0, 90.0, 120.0, 160.0])))
    s = trace.signals
    np.testing.assert_allclose(
        s["reaction_B_x"], [68.7597, 43.3684, 14.4725, 0.0, -14.4725, -68.7597], rtol=1e-4, atol=1e-4
    )
    np.testing.assert_allclose(s["reaction_B_y"], [25.0265, 25.0387, 25.0671, 25.0775, 25.0671, 25.0265], rtol=1e-4)
    np.testing.assert_allclose(s["drive_torque"], [-9.3969, -8.6603, -5.0, 0.0, 5.0, 9.3969], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("rpm", [60, 300, 600, -600])
def test_crank_rocker_with_ideal_joints_over_a_revolution(rpm: float) -> None:
    mechanism = at_speed(load("crank-rocker"), speed=rpm * np.pi / 30)
    trace = ENGINE.simulate(request_of(mechanism, "ideal", "driven", TURN))
    truth = expected(mechanism, "ideal", "driven", TURN)
    assert error(trace, truth, "reaction") < 2e-4
    assert error(trace, truth, "drive_torque") < 3e-4
    assert angle_error(trace, truth) < 1e-7
    assert trace.time is not None
    np.testing.assert_allclose(np.diff(np.sort(trace.time)), np.radians(5.0) / abs(mechanism.speed or 0), rtol=1e-9)


@pytest.mark.parametrize("name", ["slider-crank", "six-bar", "inverted-slider", "scotch-yoke", "six-bar-from-G"])
@pytest.mark.parametrize("motion", MOTIONS)
def test_other_linkages_with_ideal_joints(name: str, motion: Motion) -> None:
    made = {
        "inverted-slider": inverted_slider,
        "scotch-yoke": scotch_yoke,
        "six-bar-from-G": six_bar_driven_from_the_rocker,
    }
    mechanism = made[name]() if name in made else load(name)
    mechanism = mechanism.replace(gravity=(1.0, -9.81))
    theta = Assembly(mechanism).start + np.radians(np.arange(-8.0, 8.1, 2.0)) if name == "six-bar-from-G" else TURN
    trace = ENGINE.simulate(request_of(mechanism, "ideal", motion, theta))
    truth = expected(mechanism, "ideal", motion, theta)
    assert error(trace, truth, "reaction") < (5e-4 if motion == "driven" else 1e-6)
    assert error(trace, truth, "drive_torque") < (5e-4 if motion == "driven" else 1e-6)
    assert angle_error(trace, truth) < 1e-5


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("model", CLEARANCE_MODELS)
@pytest.mark.parametrize("joints", ["E", *slow("A", "D", "AB", "DABE")])
def test_clearance_at_any_joint_and_at_several(model: JointModel, motion: Motion, joints: str) -> None:
    mechanism = PAPER.with_clearances(dict.fromkeys(joints, 1e-3 if len(joints) < 4 else 1e-4))
    theta = RANGE[::2]
    trace = ENGINE.simulate(request_of(mechanism, model, motion, theta))
    truth = expected(mechanism, model, motion, theta)
    limit = {"massless-link": 1e-4, "spring-damper": 3e-3, "contact": 1e-3}[model]
    assert error(trace, truth, "reaction") < limit
    stiffness = trace.settings.get("contact_stiffness", np.inf)
    for joint in joints:
        gap, right, force = (
            vector(trace.signals, "clearance", joint),
            vector(truth, "clearance", joint),
            vector(trace.signals, "reaction", joint),
        )
        assert np.abs(np.angle(gap / right)).max() < limit
        np.testing.assert_allclose(np.abs(gap), np.abs(right) + np.abs(force) / stiffness, rtol=1.5e-3)
    assert set(trace.journal) == set(trace.free_share) == set(joints)
    assert all(len(path) >= 100 for path in trace.journal.values())


@pytest.mark.slow
@pytest.mark.parametrize("model", CLEARANCE_MODELS)
def test_clearance_in_a_slider_crank_and_a_six_bar_at_rest(model: JointModel) -> None:
    slider_crank = load("slider-crank").replace(gravity=(0.0, -9.81), loads=(Load(body="slider", force=(-40.0, 3.0)),))
    for mechanism in (
        slider_crank.with_clearances({"B": 5e-4}),
        load("six-bar").with_clearances({"C": 1e-4, "F": 1e-4}),
    ):
        theta = TURN[1::6]
        trace = ENGINE.simulate(request_of(mechanism, model, "static", theta))
        truth = expected(mechanism, model, "static", theta)
        assert error(trace, truth, "reaction") < 1e-4
        assert error(trace, truth, "drive_torque") < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("model", CLEARANCE_MODELS)
def test_six_bar_with_two_clearances_in_motion(model: JointModel) -> None:
    mechanism = load("six-bar").with_clearances({"C": 1e-4, "F": 1e-4})
    theta = TURN[::4]
    trace = ENGINE.simulate(request_of(mechanism, model, "driven", theta))
    truth = expected(mechanism, model, "driven", theta)
    assert error(trace, truth, "reaction") < (2e-4 if model == "massless-link" else 5e-3)
    assert angle_error(trace, truth) < 3e-4


@pytest.mark.parametrize("model", JOINT_MODELS)
def test_the_crank_may_turn_backwards(model: JointModel) -> None:
    mechanism = at_speed(PAPER.with_clearances({"B": 1e-3}), speed=-(PAPER.speed or 0))
    trace = ENGINE.simulate(request_of(mechanism, model, "driven", RANGE[::4]))
    assert error(trace, expected(mechanism, model, "driven", RANGE[::4]), "reaction") < 1e-3
    assert trace.time is not None
    assert np.all(np.diff(trace.time) < 0)


@pytest.mark.parametrize("joint", "DABE")
@pytest.mark.parametrize(
    "law",
    [{"friction_torque": 0.05}, {"damping": 0.002}, {"stiffness": 0.5, "rest_angle": 0.3}],
    ids=lambda law: next(iter(law)),
)
@pytest.mark.parametrize("motion", MOTIONS)
def test_joint_laws_on_any_joint(joint: str, law: dict[str, float], motion: Motion) -> None:
    mechanism = load("crank-rocker").replace(gravity=(1.0, -9.81)).with_joint(joint, **law)
    theta = TURN[1::4]
    trace = ENGINE.simulate(request_of(mechanism, "ideal", motion, theta))
    truth = expected(mechanism, "ideal", motion, theta)
    assert error(trace, truth, "reaction") < 3e-4
    assert error(trace, truth, "drive_torque") < 3e-4


@pytest.mark.parametrize("model", CLEARANCE_MODELS)
def test_joint_laws_beside_clearance_at_rest(model: JointModel) -> None:
    mechanism = load("crank-rocker").replace(gravity=(1.0, -9.81)).with_joint("A", friction_torque=0.01)
    mechanism = mechanism.with_joint("B", clearance=1e-4, friction_torque=0.004, stiffness=0.1).with_joint(
        "E", stiffness=0.5, rest_angle=1.0
    )
    trace = ENGINE.simulate(request_of(mechanism, model, "static", TURN[1::4]))
    assert error(trace, expected(mechanism, model, "static", TURN[1::4]), "reaction") < 1e-4


@pytest.mark.parametrize(
    "law",
    [{"friction_torque": 2.0}, {"damping": 1.5}, {"stiffness": 100.0, "rest_angle": 0.1}],
    ids=lambda law: next(iter(law)),
)
@pytest.mark.parametrize("motion", MOTIONS)
def test_laws_and_loads_of_a_slider(law: dict[str, float], motion: Motion) -> None:
    mechanism = at_speed(load("slider-crank"), speed=20.0).with_joint("S", **law)
    mechanism = mechanism.replace(
        loads=(Load(body="slider", force=(-30.0, 5.0)), Load(body="rod", point="B", force=(3.0, 7.0), torque=0.2))
    )
    theta = TURN[1::4]
    trace = ENGINE.simulate(request_of(mechanism, "ideal", motion, theta))
    truth = expected(mechanism, "ideal", motion, theta)
    assert error(trace, truth, "reaction") < 3e-4
    assert error(trace, truth, "drive_torque") < 3e-4


def test_pendulum_swings_as_its_equation_says() -> None:
    instants = np.linspace(0.0, 1.0, 11)
    trace = ENGINE.simulate(request_of(load("pendulum"), time=instants[::-1]))
    truth = released(Assembly(load("pendulum")), instants).reactions.signals()
    for name in ("pendulum_angle", "pendulum_angular_velocity", "reaction_O_x", "reaction_O_y"):
        np.testing.assert_allclose(trace.signals[name][::-1], truth[name], atol=1e-7)
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["pendulum_angle"])
    np.testing.assert_array_equal(trace.signals["drive_torque"], 0.0)


def test_released_crank_rocker_falls_as_its_equation_says() -> None:
    mechanism = at_speed(load("crank-rocker").replace(gravity=(0.0, -9.81)), speed="free")
    instants = np.linspace(0.0, 0.3, 4)
    trace = ENGINE.simulate(request_of(mechanism, time=instants))
    truth = released(Assembly(mechanism), instants).reactions.signals()
    assert angle_error(trace, truth) < 2e-6
    assert error(trace, truth, "reaction") < 2e-4


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_drive_that_yields_lags_by_its_torque(motion: Motion) -> None:
    mechanism = at_speed(load("crank-rocker").replace(gravity=(0.0, -9.81)), stiffness=2000.0)
    trace = ENGINE.simulate(request_of(mechanism, "ideal", motion, TURN))
    lag = trace.crank_angle - trace.signals["crank_angle"]
    np.testing.assert_allclose(lag, trace.signals["drive_torque"] / 2000.0, atol=1e-9)
    assert np.abs(lag).max() > 1e-5
    rigid = ENGINE.simulate(request_of(load("crank-rocker").replace(gravity=(0.0, -9.81)), "ideal", motion, TURN))
    peak = np.abs(rigid.signals["drive_torque"]).max()
    assert np.abs(trace.signals["drive_torque"] - rigid.signals["drive_torque"]).max() < 0.01 * peak


def test_signals_come_in_the_order_asked_for_and_angles_are_not_wrapped() -> None:
    mechanism = at_speed(load("crank-rocker"), speed=10.0)
    theta = np.radians([700.0, 20.0, 380.0, 20.0])
    trace = ENGINE.simulate(request_of(mechanism, "ideal", "driven", theta))
    np.testing.assert_allclose(trace.signals["crank_angle"], theta, atol=1e-9)
    np.testing.assert_allclose(trace.signals["reaction_B_x"][1:], trace.signals["reaction_B_x"][1], rtol=1e-3)


def test_a_lead_in_comes_before_the_first_angle() -> None:
    mechanism = at_speed(load("crank-rocker"), speed=20.0)
    short, long = (
        ENGINE.simulate(request_of(mechanism, "ideal", "driven", TURN[:10], lead_in=lead)) for lead in (0.0, 2.0)
    )
    assert short.time is not None
    assert long.time is not None
    np.testing.assert_array_equal(short.time, long.time)
    np.testing.assert_allclose(short.signals["reaction_B_x"], long.signals["reaction_B_x"], rtol=1e-3, atol=1e-5)


def test_the_same_request_gives_the_same_bits() -> None:
    request = request_of(PAPER, "contact", "driven", RANGE[:5])
    first, second = (ENGINE.simulate(request) for _ in range(2))
    for name, values in first.signals.items():
        np.testing.assert_array_equal(values, second.signals[name])


def test_a_change_point_in_the_range_is_an_error() -> None:
    for motion in MOTIONS:
        with pytest.raises(AssemblyError, match="change point at crank angle 0"):
            ENGINE.simulate(request_of(PAPER, "ideal", motion, np.radians([-10.0, 20.0])))


def test_a_drive_without_speed_or_angles_is_refused() -> None:
    with pytest.raises(ScheduleError, match="its drive has no constant speed"):
        Schedule.at_angles(at_speed(PAPER, speed="measured"), RANGE)
    with pytest.raises(Unsupported, match="no crank angle"):
        ENGINE.simulate(request_of(PAPER, "ideal", "static"))
    with pytest.raises(Unsupported, match="cannot start with its pin centred"):
        ENGINE.simulate(request_of(load("paper"), "massless-link", "driven", TURN[:3], start="centred"))


def test_a_pin_that_nothing_presses_has_no_static_place() -> None:
    with pytest.raises(SimulationError, match=r"nothing presses the pin of joint 'B' at crank angle 20 deg"):
        ENGINE.simulate(request_of(PAPER.replace(loads=()), "contact", "static", RANGE))


@pytest.mark.slow
def test_a_slow_crank_is_not_moved_aside_by_reactions_in_minutes() -> None:
    """Two minutes under 50 N; the motor's armature of 1e9 kg.m^2 alone would gain 3e-5 rad in them."""
    theta = np.radians([20.0, 90.0, 160.0])
    trace = ENGINE.simulate(request_of(at_speed(PAPER, speed=0.02), "ideal", "driven", theta))
    np.testing.assert_allclose(trace.signals["crank_angle"], theta, rtol=0, atol=3e-7)
    truth = expected(at_speed(PAPER, speed=0.02), "ideal", "driven", theta)
    assert error(trace, truth, "reaction") < 1e-4


@pytest.mark.parametrize("joint_model", ["ideal", "contact"])
def test_a_mass_below_mujocos_least_is_refused_in_a_sentence(joint_model: JointModel) -> None:
    m = load("paper").with_body("crank", mass=1e-30).with_clearances({"B": 1e-3})
    with pytest.raises(Unsupported, match=r"body 'crank' has mass = 1e-30 kg, .* more than 1e-15"):
        ENGINE.simulate(request_of(m, joint_model, "driven", np.radians([40.0])))


def test_at_rest_a_mass_is_nothing_but_a_weight() -> None:
    """A crank a billion billionth as heavy as its neighbours changes no force of an equilibrium."""
    theta = np.radians([30.0, 90.0, 150.0])
    heavy, light = (
        ENGINE.simulate(
            request_of(
                load("paper").with_body("crank", mass=mass).with_clearances({"B": 1e-3}), "contact", "static", theta
            )
        ).signals
        for mass in (0.157, 1e-20)
    )
    for name in heavy:
        np.testing.assert_allclose(
            light[name], heavy[name], rtol=0, atol=1e-7 * max(1.0, np.abs(heavy[name]).max()), err_msg=name
        )


@pytest.mark.parametrize(
    ("name", "joint_model", "speed", "clearance"),
    [
        ("mujoco", "ideal", 1e-9, 1e-3),
        ("mujoco", "ideal", 1e-4, 1e-3),
        ("mujoco", "contact", 1.5, 1e-13),
        ("exudyn", "ideal", 1e-4, 1e-3),
        ("exudyn", "massless-link", 1.5, 1e-15),
        ("pybullet", "spring-damper", 1.5, 1e-13),
        ("dart", "contact", 1.5, 1e-13),
    ],
)
def test_a_run_without_end_is_refused_before_it_begins(
    name: str, joint_model: JointModel, speed: float, clearance: float
) -> None:
    m = at_speed(load("paper"), speed=speed).with_clearances({"B": clearance})
    with pytest.raises(
        SimulationError, match=r"would take .* steps of .* s, and .* are the most; ask for less, change drive\.speed"
    ):
        engine(name).simulate(request_of(m, joint_model, "driven", np.radians([20.0, 160.0])))


def test_too_long_a_step_is_an_error_not_a_number() -> None:
    mechanism = at_speed(load("crank-rocker").with_clearances({"B": 2e-4}), speed=60.0)
    for model in JOINT_MODELS:
        with pytest.raises(SimulationError, match="use a smaller step"):
            ENGINE.simulate(request_of(mechanism, model, "driven", TURN, step=2e-3))


@pytest.mark.parametrize("model", ["massless-link", "spring-damper", "contact"])
def test_a_released_pendulum_hangs_in_its_loose_pin(model: JointModel) -> None:
    loose = load("pendulum").with_clearances({"O": 5e-4})
    trace = ENGINE.simulate(request_of(loose, model, "driven", time=np.linspace(0.0, 0.5, 11)))
    ideal = ENGINE.simulate(request_of(loose, "ideal", "driven", time=np.linspace(0.0, 0.5, 11)))
    np.testing.assert_allclose(trace.signals["pendulum_angle"], ideal.signals["pendulum_angle"], atol=0.02)


def test_a_mechanism_of_any_name_runs() -> None:
    m, theta = load("crank-rocker"), np.array([0.1, 0.2])
    odd, plain = (
        ENGINE.simulate(request_of(each, crank_angle=theta)).signals["follower_angle"]
        for each in (m.replace(name='R&D "x" <1>'), m)
    )
    np.testing.assert_array_equal(odd, plain)
