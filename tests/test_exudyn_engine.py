"""Exudyn against the analytic model, an independent ordinary differential equation, and its own known traps."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.schedule import ScheduleError
from analytic.mechanism import Drive, Mechanism
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from engine_checks import exact_motion, fast_crank_rocker, many_impacts_against_the_ode
from linkages import inverted_slider, scotch_yoke, six_bar_driven_from_the_rocker
from marks import slow
from sim_models.engine import JointModel, Motion, SimulationError, Trace, Unsupported
from sim_models.exudyn.engine import ENGINE
from sim_models.exudyn.laws import hysteresis

pytestmark = pytest.mark.exudyn

PAPER_RANGE = np.radians(np.arange(20, 161, 5.0))
REAL: tuple[JointModel, ...] = ("massless-link", "spring-damper", "contact")


def run(
    mechanism: Mechanism, joint_model: JointModel, motion: Motion, degrees: np.ndarray | list[float], **options: object
) -> Trace:
    return ENGINE.simulate(request_of(mechanism, joint_model, motion, np.radians(degrees), **options))


def vector(signals: object, name: str) -> np.ndarray:
    return signals[f"{name}_x"] + 1j * signals[f"{name}_y"]


def reaction_errors(trace: Trace, mechanism: Mechanism, joint: str) -> tuple[float, float]:
    """Largest error of a reaction's direction (deg) and magnitude (%) against the analytic equilibrium."""
    clearances = dict(trace.clearance)
    moving = trace.motion == "driven"
    reference = displaced(
        Assembly(mechanism), trace.crank_angle, mechanism.speed or 1.0, inertia=moving, clearances=clearances
    )
    assert not reference.flags
    ratio = vector(trace.signals, f"reaction_{joint}") / vector(reference.signals(), f"reaction_{joint}")
    return float(np.degrees(np.abs(np.angle(ratio))).max()), float(100 * np.abs(np.abs(ratio) - 1).max())


# ---------------------------------------------------------------- statics


@pytest.mark.parametrize("clearance", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize(
    ("joint_model", "degrees", "percent"), [("ideal", 1e-11, 1e-11), ("massless-link", 1e-5, 1e-4)]
)
def test_rigid_static_models_reproduce_the_analytic_equilibrium(
    joint_model: JointModel, degrees: float, percent: float, clearance: float
) -> None:
    m = load("paper").with_clearances({"B": clearance})
    angle, size = reaction_errors(run(m, joint_model, "static", np.degrees(PAPER_RANGE)), m, "B")
    assert angle < degrees
    assert size < percent


@pytest.mark.parametrize("clearance", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("joint_model", ["spring-damper", "contact"])
def test_compliant_static_models_differ_from_rigid_contact_by_their_penetration(
    joint_model: JointModel, clearance: float
) -> None:
    m = load("paper").with_clearances({"B": clearance})
    trace = run(m, joint_model, "static", np.degrees(PAPER_RANGE))
    angle, size = reaction_errors(trace, m, "B")
    assert angle < 1e-3
    assert size < 0.01
    depth = np.abs(vector(trace.signals, "clearance_B")) - clearance
    np.testing.assert_allclose(1e8 * depth, np.abs(vector(trace.signals, "reaction_B")), rtol=1e-6)
    stiffer = m.with_joint("B", contact_stiffness=1e9)
    assert reaction_errors(run(stiffer, joint_model, "static", np.degrees(PAPER_RANGE)), m, "B")[0] < 0.2 * angle


@pytest.mark.parametrize("joint_model", REAL)
def test_clearance_in_several_joints_at_once_the_drive_joint_among_them(joint_model: JointModel) -> None:
    clearances = {"D": 1e-4, "F": 2e-4, "B": 1e-4, "G": 5e-5}
    m = load("six-bar").with_clearances(clearances)
    trace = run(m, joint_model, "static", np.arange(0.0, 360.0, 30.0))
    for joint in "DABECFG":
        angle, size = reaction_errors(trace, m, joint)
        assert angle < 0.005, joint
        assert size < 0.01, joint
    assert set(trace.journal) == set(clearances)
    assert all(path.shape == (12, 2) for path in trace.journal.values())


def test_a_light_linkage_presses_its_pins_less_deep_than_exudyn_differentiates() -> None:
    """Under its weight alone, 0.3 N; Exudyn's own step of 1e-8 m makes Newton's method go to and fro."""
    m = load("crank-rocker").replace(gravity=(0.0, -9.81)).with_clearances({"A": 1e-4, "B": 1e-4})
    trace = run(m, "contact", "static", np.arange(0.0, 360.0, 8.0))
    for joint in "DABE":
        degrees, percent = reaction_errors(trace, m, joint)
        assert degrees < 0.01
        assert percent < 0.01


def test_static_friction_and_springs_of_revolute_and_prismatic_joints() -> None:
    m = inverted_slider()
    degrees = np.arange(0.0, 360.0, 20.0)
    trace = run(m, "ideal", "static", degrees)
    expected = kinetostatics(kinematics(Assembly(m), np.radians(degrees), m.speed or 0.0), inertia=False).signals()
    for name in [*(f"reaction_{j}_{axis}" for j in "OASC" for axis in "xy"), "reaction_S_moment", "drive_torque"]:
        np.testing.assert_allclose(
            trace.signals[name], expected[name], atol=1e-11 * np.abs(expected[name]).max(), err_msg=name
        )


def test_statics_answers_in_the_order_of_the_question() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    asked = [120.0, 30.0, 30.0, 90.0]
    trace = run(m, "contact", "static", asked)
    alone = [run(m, "contact", "static", [a]).signals["reaction_B_x"][0] for a in asked]
    np.testing.assert_allclose(trace.signals["reaction_B_x"], alone, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("joint_model", REAL)
def test_a_pin_that_nothing_presses_has_no_static_equilibrium(joint_model: JointModel) -> None:
    m = load("crank-rocker").with_clearances({"B": 1e-4})
    with pytest.raises(SimulationError, match="nothing presses the pin of joint B"):
        run(m, joint_model, "static", [40.0])


# ---------------------------------------------------------------- driven


DRIVEN = {
    "crank-rocker": (load("crank-rocker"), (0.0, 360.0)),
    "slider-crank": (load("slider-crank"), (0.0, 360.0)),
    "six-bar": (load("six-bar"), (0.0, 360.0)),
    "six-bar from its rocker": (six_bar_driven_from_the_rocker(), (105.0, 125.0)),
    "inverted slider in reverse": (inverted_slider(), (0.0, 360.0)),
    "scotch yoke": (scotch_yoke(), (20.0, 160.0)),
}


@pytest.mark.parametrize("name", DRIVEN)
def test_ideal_driven_linkages_reproduce_kinetostatics(name: str) -> None:
    m, (low, high) = DRIVEN[name]
    degrees = np.linspace(low, high, 19)
    trace = run(m, "ideal", "driven", degrees)
    expected = kinetostatics(kinematics(Assembly(m), np.radians(degrees), m.speed or 0.0)).signals()
    force = max(np.abs(expected[k]).max() for k in expected if k.startswith("reaction") and not k.endswith("moment"))
    for signal, values in expected.items():
        if signal.startswith("clearance"):
            scale, rtol = 1.0, 1e-7  # m; constraints are kept on velocity, so that positions drift a little
        elif signal.startswith("reaction") and not signal.endswith("moment"):
            scale, rtol = force, 1e-5
        else:
            scale, rtol = max(np.abs(values).max(), 1e-3), 1e-5
        np.testing.assert_allclose(trace.signals[signal], values, rtol=0, atol=rtol * scale, err_msg=signal)


@pytest.mark.parametrize(
    ("joint_model", "clearance"),
    [
        ("massless-link", 1e-3),
        *slow(*(row for row in product(REAL, (1e-2, 1e-3, 1e-4)) if row != ("massless-link", 1e-3))),
    ],
)
def test_driven_paper_case_starts_and_stays_in_the_analytic_equilibrium(
    joint_model: JointModel, clearance: float
) -> None:
    m = load("paper").with_clearances({"B": clearance})
    trace = run(m, joint_model, "driven", np.degrees(PAPER_RANGE))
    angle, size = reaction_errors(trace, m, "B")
    assert angle < 0.05
    assert size < 0.5
    assert trace.free_share["B"] == 0.0
    np.testing.assert_allclose(trace.time, (PAPER_RANGE - PAPER_RANGE[0]) / m.speed)


def test_the_crank_turns_to_where_it_is_sent() -> None:
    """Index 2 with a position offset and no rate of it would leave the crank standing."""
    asked = [90.0, 30.0, 50.0, 30.0]
    trace = run(load("paper"), "ideal", "driven", asked)
    np.testing.assert_allclose(trace.signals["crank_angle"], np.radians(asked), atol=1e-12)
    np.testing.assert_allclose(trace.signals["crank_angular_velocity"], load("paper").speed, rtol=1e-12)


def test_a_lead_in_ends_where_a_direct_start_begins() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    led, direct = (run(m, "contact", "driven", [60.0, 62.0], lead_in=lead) for lead in (0.2, 0.0))
    np.testing.assert_allclose(
        np.abs(vector(led.signals, "reaction_B")), np.abs(vector(direct.signals, "reaction_B")), rtol=2e-4
    )
    assert led.journal["B"].shape == pytest.approx(direct.journal["B"].shape, abs=5)


# ---------------------------------------------------------------- released


def test_released_pendulum_with_friction_and_damping() -> None:
    m = load("pendulum").with_joint("O", friction_torque=0.02, damping=0.001)
    time = np.linspace(0, 1.5, 31)
    trace = ENGINE.simulate(request_of(m, "ideal", "driven", time=time))
    found = released(Assembly(m), time)
    expected, moving = found.reactions.signals(), ~found.turning
    assert moving.sum() >= time.size - 3
    np.testing.assert_allclose(trace.signals["pendulum_angle"], expected["pendulum_angle"], atol=3e-4)
    np.testing.assert_allclose(trace.signals["reaction_O_y"][moving], expected["reaction_O_y"][moving], atol=2e-3)
    assert not trace.signals["drive_torque"].any()


@pytest.mark.parametrize("joint_model", REAL)
def test_released_pendulum_hangs_a_clearance_lower(joint_model: JointModel) -> None:
    """A pin pressed against its bearing makes the pendulum a double one whose first link is the clearance."""
    m = load("pendulum").with_clearances({"O": 1e-4})
    time = np.linspace(0, 0.5, 11)
    trace = ENGINE.simulate(request_of(m, joint_model, "driven", time=time))
    expected = released(Assembly(m), time).reactions.signals()
    np.testing.assert_allclose(trace.signals["pendulum_angle"], expected["pendulum_angle"], atol=5e-3)
    np.testing.assert_allclose(np.abs(vector(trace.signals, "clearance_O")), 1e-4, rtol=0.01)
    assert trace.free_share["O"] == 0.0


# ---------------------------------------------------------------- contact


@pytest.mark.slow
@pytest.mark.parametrize("joint_model", ["spring-damper", "contact"])
def test_one_revolution_at_600_rpm_follows_the_differential_equation(joint_model: JointModel) -> None:
    m = fast_crank_rocker(2e-4, 300.0)
    degrees = np.arange(0.0, 361.0, 5.0)
    ode = exact_motion(m, np.radians(degrees), 1e-10)
    trace = run(m, joint_model, "driven", degrees, start="centred")
    np.testing.assert_allclose(trace.signals["coupler_angle"], ode.coupler, atol=2e-5)
    np.testing.assert_allclose(trace.signals["follower_angle"], ode.follower, atol=2e-5)
    fine = run(m, joint_model, "driven", degrees, start="centred", step=1e-5)
    np.testing.assert_allclose(vector(fine.signals, "reaction_B"), ode.force, atol=0.01 * np.abs(ode.force).max())


@pytest.mark.slow
@pytest.mark.parametrize("joint_model", ["spring-damper", "contact"])
def test_many_impacts_have_the_exact_statistics(joint_model: JointModel) -> None:
    """Exudyn's contact pulls as a pin leaves, which is free 4 to 6 % less (:mod:`sim_models.exudyn.engine`); on top of
    that comes the scatter of a few chaotic paths, which differ from processor to processor.
    """
    pulled = {"free share": 0.95} if joint_model == "contact" else {}
    for name, (simulated, exact) in many_impacts_against_the_ode(ENGINE, joint_model, step=1e-5).items():
        assert simulated == pytest.approx(pulled.get(name, 1.0) * exact, rel=0.05), name


@pytest.mark.parametrize("restitution", [0.9, 0.5, 0.2])
def test_contact_delivers_the_nominal_restitution(restitution: float) -> None:
    """Impact model 2 does; Hunt-Crossley (model 1) would deliver 0.909, 0.663, 0.547."""
    m = load("pendulum").with_clearances({"O": 1e-3}).with_joint("O", restitution=restitution, contact_stiffness=1e8)
    time = np.linspace(0, 0.02, 2001)
    trace = ENGINE.simulate(request_of(m, "contact", "driven", time=time, start="centred", step=2e-6))
    gap = vector(trace.signals, "clearance_O")
    touches = int(np.argmax(np.abs(gap) > 1e-3))
    leaves = touches + int(np.argmax(np.abs(gap[touches:]) <= 1e-3))
    speed = np.gradient(np.real(gap * np.conj(gap[touches] / abs(gap[touches]))), time)
    assert -speed[leaves + 2] / speed[touches - 3] == pytest.approx(restitution, rel=0.03)


@pytest.mark.parametrize(("e", "delivered"), [(0.9, 0.9), (0.7, 0.69997), (0.5, 0.50017), (0.3, 0.30422)])
def test_hysteresis_factor_satisfies_the_momentum_balance(e: float, delivered: float) -> None:
    """chi (1 + e') = ln[(1 + chi)/(1 - chi e')], with Carvalho-Martins' and (0.3) Gonthier's published e'."""
    chi = hysteresis(e)
    assert chi * (1 + delivered) == pytest.approx(math.log((1 + chi) / (1 - chi * delivered)), rel=3e-4)


def test_contact_friction_turns_the_displacement_by_atan_mu() -> None:
    m = load("paper").with_clearances({"B": 1e-4}).with_joint("B", friction=0.2, pin_radius=0.01)
    trace = run(m, "contact", "driven", [30.0, 45.0, 60.0])
    turned = np.angle(vector(trace.signals, "reaction_B") / vector(trace.signals, "clearance_B"))
    np.testing.assert_allclose(turned, -math.atan(0.2), rtol=1e-3)


# ---------------------------------------------------------------- traps


@pytest.mark.parametrize("motion", ["static", "driven"])
def test_no_run_passes_a_change_point(motion: Motion) -> None:
    with pytest.raises(AssemblyError, match="change point"):
        run(load("paper"), "contact", motion, [-10.0, 30.0])


@pytest.mark.parametrize("joint_model", ["spring-damper", "contact"])
@pytest.mark.parametrize("damping", [0.0, None])
def test_garbage_of_a_stiff_contact_and_a_long_step_is_an_error(joint_model: JointModel, damping: float | None) -> None:
    m = load("paper").with_clearances({"B": 1e-3}).with_joint("B", contact_stiffness=1e9)
    m = m if damping is None else m.with_joint("B", contact_damping=damping)
    with pytest.raises(SimulationError, match="smaller step"):
        run(m, joint_model, "driven", np.degrees(PAPER_RANGE), start="centred", step=3e-3)


def test_silent_and_nothing_left_on_disk(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import exudyn

    monkeypatch.chdir(tmp_path)
    before = exudyn.config.printToConsole
    run(load("paper").with_clearances({"B": 1e-3}), "contact", "driven", [30.0, 31.0])
    with pytest.raises(SimulationError):
        run(load("crank-rocker").with_clearances({"B": 1e-4}), "contact", "static", [40.0])
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())
    assert exudyn.config.printToConsole == before


def test_what_exudyn_does_not_do_is_refused_in_words() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    with pytest.raises(ScheduleError, match="no constant speed"):
        run(m.replace(drive=Drive(joint="D", speed="measured")), "ideal", "driven", [30.0])
    with pytest.raises(Unsupported, match="pin centred"):
        run(m, "massless-link", "driven", [30.0], start="centred")
    with pytest.raises(Unsupported, match="friction"):
        run(m.with_joint("B", friction=0.1), "contact", "static", [30.0])
    with pytest.raises(ScheduleError, match="no constant speed"):
        run(load("pendulum"), "ideal", "driven", [30.0])
    with pytest.raises(Unsupported, match="needs times to report at"):
        ENGINE.simulate(request_of(load("pendulum"), time=np.zeros(0)))
    with pytest.raises(Unsupported, match="no crank angle"):
        run(m, "ideal", "driven", [])


def test_settings_say_which_law_and_numbers_were_used() -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    settings = run(m, "contact", "driven", [30.0, 30.5]).settings
    assert settings["contact_stiffness"] == 1e7
    assert settings["restitution"]["B"] == pytest.approx(0.2984, abs=1e-3)  # of a damping ratio of 0.5, never pulling
    assert 0 < settings["step"] < 1e-4
    linear = run(m.with_joint("B", contact_damping=40.0), "contact", "driven", [30.0, 30.5]).settings
    assert linear["contact_damping"] == {"B": 40.0}
