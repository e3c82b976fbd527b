"""Every engine at rest, held to the analytic equilibrium: the paper's case, pins in several joints, laws of joints."""

from __future__ import annotations

import numpy as np
import pytest

from analytic.mechanism import Drive, Load
from analytic.mechanism.file import load
from engine_checks import (
    LOOSE,
    PAPER_RANGE,
    at_speed,
    declared_runs,
    equilibrium,
    ideal_signals,
    is_force,
    off,
    reaction_errors,
    run,
    vector,
)
from marks import slow, slow_but
from sim_models.engine import ENGINES, JointModel, SimulationError

ALL = declared_runs("static")
PINS = declared_runs("static", LOOSE)
SEVERAL = {"D": 1e-4, "F": 2e-4, "B": 1e-4, "G": 5e-5}
# Of the reaction at B against the rigid equilibrium: direction (deg), magnitude (%).  MuJoCo's rows are soft, rigid
# contact of DART and PyBullet is a constraint solved step by step; what is pressed into a spring is off by its depth.
WITHIN: dict[tuple[str, JointModel], tuple[float, float]] = {
    ("mujoco", "ideal"): (1e-3, 0.01), ("mujoco", "massless-link"): (1e-3, 0.01),
    ("mujoco", "spring-damper"): (1e-3, 0.01), ("mujoco", "contact"): (1e-3, 0.01),
    ("exudyn", "ideal"): (1e-11, 1e-11), ("exudyn", "massless-link"): (1e-5, 1e-4),
    ("exudyn", "spring-damper"): (1e-3, 0.01), ("exudyn", "contact"): (1e-3, 0.01),
    ("pybullet", "ideal"): (1e-8, 1e-7), ("pybullet", "massless-link"): (1e-7, 1e-7),
    ("pybullet", "spring-damper"): (1e-3, 5e-3), ("pybullet", "contact"): (1e-7, 1e-7),
    ("dart", "ideal"): (1e-6, 1e-5), ("dart", "spring-damper"): (1e-3, 5e-3), ("dart", "contact"): (1e-5, 1e-4),
}  # fmt: skip
RIGID = {("pybullet", "massless-link"), ("pybullet", "contact"), ("dart", "contact")}  # to 1e-6 of the clearance


@pytest.mark.long_rows(
    "mujoco-spring-damper-0.001", "mujoco-contact-0.001", "mujoco-massless-link-0.001", "pybullet-contact-0.001",
    "dart-spring-damper-0.001", "pybullet-spring-damper-0.001",
)  # fmt: skip
@pytest.mark.parametrize("clearance", [1e-3, *slow(1e-2, 1e-4)])
@pytest.mark.parametrize(("name", "model"), ALL)
def test_the_reaction_of_the_papers_case_is_that_of_its_finite_gap(
    name: str, model: JointModel, clearance: float
) -> None:
    m = load("paper").with_clearances({"B": clearance})
    trace = run(name, m, model, "static", PAPER_RANGE)
    angle, size = reaction_errors(trace, m)
    assert angle < WITHIN[name, model][0]
    assert size < WITHIN[name, model][1]
    if model == "ideal":
        return
    gap, force = vector(trace, "clearance_B"), vector(trace, "reaction_B")
    assert trace.free_share == {"B": 0.0}
    if (name, model) in RIGID:
        np.testing.assert_allclose(np.abs(gap), clearance, rtol=1e-6 if name == "dart" else 1e-8)
    elif model != "massless-link":
        depth = np.abs(gap) - clearance
        np.testing.assert_allclose(1e8 * depth, np.abs(force), rtol=1e-6)
        np.testing.assert_allclose(np.angle(force / gap), 0.0, atol=1e-8)
        stiffer = m.with_joint("B", contact_stiffness=1e9)
        assert reaction_errors(run(name, stiffer, model, "static", PAPER_RANGE), m)[0] < 0.2 * angle


@pytest.mark.long_rows("mujoco-contact", "dart-spring-damper", "dart-contact")
@pytest.mark.parametrize(
    ("name", "model"),
    slow_but([row for row in PINS if row[0] in ("exudyn", "dart") or row == ("mujoco", "contact")], PINS),
)
def test_clearance_in_several_joints_at_once_the_drive_joint_among_them(name: str, model: JointModel) -> None:
    m = load("six-bar").with_clearances(SEVERAL)
    trace = run(name, m, model, "static", np.arange(0.0, 360.0, 60.0))
    for joint in "DABECFG":
        angle, size = reaction_errors(trace, m, joint)
        assert angle < 0.005, joint
        assert size < 0.01, joint
    assert set(trace.journal) == set(trace.free_share) == set(SEVERAL)
    assert all(path.shape[1] == 2 for path in trace.journal.values())


@pytest.mark.long_rows("mujoco-contact-E")
@pytest.mark.parametrize("joints", ["E", *slow("D", "DABE")])
@pytest.mark.parametrize(("name", "model"), slow_but([("mujoco", "contact"), ("exudyn", "massless-link")], PINS))
def test_clearance_at_any_joint_of_the_papers_case(name: str, model: JointModel, joints: str) -> None:
    m = load("paper").with_clearances(dict.fromkeys(joints, 1e-3 if len(joints) < 4 else 1e-4))
    trace = run(name, m, model, "static", PAPER_RANGE)
    truth = equilibrium(trace, m)
    within = 1e-4 if model == "massless-link" or (name, model) in RIGID else 2e-4  # of what a contact gives
    assert off(trace.signals, truth, is_force) < within
    stiffness = float(str(trace.settings.get("contact_stiffness", np.inf)))
    for joint in joints:
        gap, right, force = (vector(each, f"{kind}_{joint}") for each, kind in (
            (trace, "clearance"), (truth, "clearance"), (trace, "reaction")))  # fmt: skip
        assert np.abs(np.angle(gap / right)).max() < within
        np.testing.assert_allclose(np.abs(gap), np.abs(right) + np.abs(force) / stiffness, rtol=1.5e-3)


@pytest.mark.parametrize("case", slow("slider-crank", "six-bar"))
@pytest.mark.parametrize(("name", "model"), PINS)
def test_clearance_in_linkages_under_weight(name: str, model: JointModel, case: str) -> None:
    push = {"slider-crank": (Load(body="slider", force=(-40.0, 3.0)),), "six-bar": load("six-bar").loads}[case]
    gaps = {"slider-crank": {"B": 5e-4}, "six-bar": {"C": 1e-4, "F": 1e-4}}[case]
    m = load(case).replace(gravity=(0.0, -9.81), loads=push).with_clearances(gaps)
    trace = run(name, m, model, "static", np.arange(5.0, 360.0, 30.0))
    truth = equilibrium(trace, m)
    assert off(trace.signals, truth, is_force) < 1e-4
    assert off(trace.signals, truth, lambda n: n == "drive_torque") < 1e-4


@pytest.mark.long_rows("mujoco-massless-link", "mujoco-spring-damper", "mujoco-contact", "pybullet-contact")
@pytest.mark.parametrize(("name", "model"), PINS)
def test_laws_of_joints_beside_clearance(name: str, model: JointModel) -> None:
    m = load("crank-rocker").replace(gravity=(1.0, -9.81)).with_joint("A", friction_torque=0.01)
    m = m.with_joint("B", clearance=1e-4, friction_torque=0.004, stiffness=0.1)
    m = m.with_joint("E", stiffness=0.5, rest_angle=1.0)
    trace = run(name, m, model, "static", np.arange(5.0, 360.0, 100.0))
    truth = equilibrium(trace, m)
    assert off(trace.signals, truth, is_force) < 1e-4


@pytest.mark.parametrize(("name", "model"), PINS)
def test_a_pin_that_nothing_presses_has_no_place(name: str, model: JointModel) -> None:
    with pytest.raises(SimulationError, match=r"nothing presses the pin of joint '?B'?.* at crank angle 40 deg"):
        run(name, load("crank-rocker").with_clearances({"B": 1e-4}), model, "static", [40.0])


@pytest.mark.long_rows("mujoco", "pybullet")
@pytest.mark.parametrize("name", ENGINES)
def test_angles_are_answered_in_the_order_of_the_question(name: str) -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    asked = [120.0, 30.0, 30.0, 90.0]
    trace = run(name, m, "contact", "static", asked)
    alone = [run(name, m, "contact", "static", [a]).signals["reaction_B_x"][0] for a in asked[2:]]
    np.testing.assert_allclose(trace.signals["reaction_B_x"][2:], alone, rtol=1e-6)
    np.testing.assert_allclose(trace.crank_angle, np.radians(asked), atol=1e-12)


@pytest.mark.parametrize("name", ENGINES)
def test_a_mass_is_nothing_but_a_weight(name: str) -> None:
    """A crank a billion billionth as heavy as its neighbours changes no force of an equilibrium."""
    heavy, light = (
        run(name, load("paper").with_body("crank", mass=mass).with_clearances({"B": 1e-3}), "contact", "static", [40.0])
        for mass in (0.157, 1e-20)
    )
    for signal, values in heavy.signals.items():
        peak = max(1.0, np.abs(values).max())
        np.testing.assert_allclose(light.signals[signal], values, rtol=0, atol=1e-7 * peak, err_msg=signal)


@pytest.mark.parametrize("name", ENGINES)
@pytest.mark.parametrize("model", ["ideal", *slow("contact")])
def test_a_crank_is_behind_its_motor_by_torque_over_stiffness(name: str, model: JointModel) -> None:
    """And the linkage is where a rigid drive would hold it with the crank there."""
    rigid = load("paper").with_clearances({"B": 1e-3} if model == "contact" else {})
    asked = np.array([40.0, 90.0, 130.0])
    found = run(name, at_speed(rigid, rigid.speed or 1.0, stiffness=300.0), model, "static", asked).signals
    lag = np.radians(asked) - found["crank_angle"]
    assert np.abs(lag).max() > 0.01
    np.testing.assert_allclose(lag, found["drive_torque"] / 300.0, atol=1e-7)
    held = run(name, rigid, model, "static", np.degrees(found["crank_angle"])).signals
    for signal in ("follower_angle", "coupler_angle", "drive_torque"):
        np.testing.assert_allclose(found[signal], held[signal], atol=1e-6)
    if model == "ideal":
        right = ideal_signals(rigid, found["crank_angle"], "static")["drive_torque"]
        np.testing.assert_allclose(found["drive_torque"], right, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", ENGINES)
def test_a_crank_without_a_motor_is_where_it_was_asked_for(name: str) -> None:
    pendulum, asked = load("pendulum"), np.degrees([0.5, 0.2, 0.9])
    free, yielding = (
        run(name, pendulum.replace(drive=Drive(joint="O", speed=speed, stiffness=200.0)), "ideal", "static", asked)
        for speed in ("free", 1.0)
    )
    np.testing.assert_allclose(free.signals["pendulum_angle"], np.radians(asked), rtol=0, atol=1e-9)
    assert np.abs(yielding.signals["pendulum_angle"] - np.radians(asked)).min() > 1e-4
