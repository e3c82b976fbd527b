"""Every engine in motion at a constant speed, and at rest: ideal linkages against the analytic model, the paper's case
with a loose pin, and how a run is asked for.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism import Drive, Load, Mechanism
from analytic.mechanism.file import load
from engine_checks import (
    LOOSE,
    PAPER_RANGE,
    ROOMY,
    assert_signals,
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
from linkages import inverted_slider, scotch_yoke, six_bar_driven_from_the_rocker
from marks import slow, slow_but
from sim_models.engine import (
    ENGINES,
    MOTIONS,
    Cause,
    JointModel,
    Motion,
    SimulationError,
)

PINS = declared_runs("driven", LOOSE)
TURN = np.arange(5.0, 360.0, 40.0)  # deg, away from where slides and pins turn back


def laws_in_every_joint() -> Mechanism:
    """Friction, a damper and a spring in each pin of the crank-rocker, no two alike."""
    m = load("crank-rocker")
    laws = {"D": (0.05, 2e-3, 0.5, 0.3), "A": (0.03, 1e-3, 0.2, -0.4), "B": (0.02, 3e-3, 0.3, 0.7),
            "E": (0.04, 4e-3, 0.7, 1.0)}  # fmt: skip
    for joint, (friction, damping, stiffness, rest) in laws.items():
        m = m.with_joint(joint, friction_torque=friction, damping=damping, stiffness=stiffness, rest_angle=rest)
    return m


def laws_of_a_slide() -> Mechanism:
    m = at_speed(load("slider-crank"), 20.0)
    m = m.with_joint("S", friction_torque=2.0, damping=1.5, stiffness=100.0, rest_angle=0.1)
    rod = Load(body="rod", point="B", force=(3.0, 7.0), torque=0.2)
    return m.replace(loads=(Load(body="slider", force=(-30.0, 5.0)), rod))


LINKAGES = {
    "crank-rocker": (load("crank-rocker"), TURN),
    "laws in every joint": (laws_in_every_joint(), TURN),
    "slider-crank": (load("slider-crank"), TURN),
    "laws of a slide": (laws_of_a_slide(), TURN),
    "six-bar": (load("six-bar"), TURN),
    "six-bar from its rocker": (six_bar_driven_from_the_rocker(), np.linspace(105.0, 125.0, 5)),
    "inverted slider in reverse": (inverted_slider(), TURN),
    "scotch yoke": (scotch_yoke(), np.linspace(20.0, 160.0, 5)),
}
# Of the largest of a signal's kind; angles (rad) and places (m).  At rest a solver's last digits are left; in motion a
# step's error: MuJoCo's loops are soft rows, DART and PyBullet step by leapfrog, Exudyn keeps velocities together.
WITHIN: dict[tuple[str, Motion], tuple[float, float, float]] = {
    ("mujoco", "static"): (1e-6, 1e-7, 1e-8), ("mujoco", "driven"): (3e-5, 3e-6, 1e-7),
    ("exudyn", "static"): (1e-11, 1e-11, 1e-11), ("exudyn", "driven"): (1e-5, 3e-6, 1e-7),
    ("pybullet", "static"): (3e-8, 1e-9, 1e-9), ("pybullet", "driven"): (1e-4, 3e-7, 1e-8),
    ("dart", "static"): (5e-7, 1e-9, 1e-9), ("dart", "driven"): (1e-4, 3e-7, 1e-8),
}  # fmt: skip
IDEAL: list[tuple[str, Motion, str]] = [
    (name, motion, case) for name in ENGINES for motion in MOTIONS for case in LINKAGES
]
SOON = [row for row in IDEAL if row[1] == "static" or row[0] in ("mujoco", "exudyn")]
SOON += [("dart", "driven", "crank-rocker"), ("dart", "driven", "six-bar from its rocker")]
SOON += [("pybullet", "driven", "slider-crank"), ("pybullet", "driven", "scotch yoke")]


@pytest.mark.long_rows(
    "pybullet-driven-slider-crank", "dart-driven-crank-rocker", "mujoco-driven-six-bar", "exudyn-driven-six-bar",
    "exudyn-driven-inverted slider in reverse", "pybullet-driven-scotch yoke", "exudyn-driven-laws of a slide",
    "exudyn-driven-crank-rocker", "exudyn-driven-slider-crank", "exudyn-driven-laws in every joint",
    "mujoco-driven-inverted slider in reverse", "mujoco-driven-laws in every joint", "mujoco-driven-laws of a slide",
    "mujoco-driven-crank-rocker", "mujoco-driven-slider-crank",
)  # fmt: skip
@pytest.mark.parametrize(("name", "motion", "case"), slow_but(SOON, IDEAL))
def test_ideal_linkages_have_the_analytic_reactions(name: str, motion: Motion, case: str) -> None:
    m, degrees = LINKAGES[case]
    m = m.replace(gravity=(1.0, -9.81))
    trace = run(name, m, "ideal", motion, degrees)
    relative, angle, place = WITHIN[name, motion]
    assert_signals(trace, ideal_signals(m, np.radians(degrees), motion), relative, angle, place)


@pytest.mark.parametrize("rpm", [-600, *slow(60, 300, 600)])
@pytest.mark.parametrize("name", slow_but(["mujoco", "exudyn"], ENGINES))
def test_a_crank_rocker_at_any_speed(name: str, rpm: float) -> None:
    m, theta = at_speed(load("crank-rocker"), rpm * np.pi / 30), np.arange(0.0, 360.0, 20.0)
    trace = run(name, m, "ideal", "driven", theta)
    assert_signals(trace, ideal_signals(m, np.radians(theta)), 2e-4, 1e-6 if name == "exudyn" else 1e-7)
    assert trace.time is not None
    np.testing.assert_allclose(np.diff(trace.time), np.radians(20.0) / (m.speed or 0.0), rtol=1e-9)


@pytest.mark.long_rows("pybullet", "dart")
@pytest.mark.parametrize("name", ENGINES)
def test_published_reactions_of_the_papers_case(name: str) -> None:
    s = run(name, load("paper"), "ideal", "driven", [20.0, 30.0, 60.0, 90.0, 120.0, 160.0]).signals
    x, y = [68.7597, 43.3684, 14.4725, 0.0, -14.4725, -68.7597], [25.0265, 25.0387, 25.0671, 25.0775, 25.0671, 25.0265]
    np.testing.assert_allclose(s["reaction_B_x"], x, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(s["reaction_B_y"], y, rtol=1e-4)
    np.testing.assert_allclose(s["drive_torque"], [-9.3969, -8.6603, -5.0, 0.0, 5.0, 9.3969], rtol=1e-4, atol=1e-4)


# ---------------------------------------------------------------- a loose pin that stays pressed

# Direction (deg) and magnitude (%) of the reaction at B, of the rigid equilibrium: contact in motion is as stiff as a
# step lets it be, and gives by so much.
PRESSED: dict[tuple[str, JointModel], tuple[float, float]] = {
    ("mujoco", "massless-link"): (1e-3, 0.01), ("mujoco", "spring-damper"): (0.05, 0.5),
    ("mujoco", "contact"): (0.05, 0.5), ("exudyn", "massless-link"): (0.05, 0.5),
    ("exudyn", "spring-damper"): (0.05, 0.5), ("exudyn", "contact"): (0.05, 0.5),
    ("pybullet", "spring-damper"): (0.01, 0.05), ("dart", "spring-damper"): (0.02, 0.06),
    ("dart", "contact"): (0.02, 0.06),
}  # fmt: skip


@pytest.mark.long_rows("exudyn-massless-link-0.001", "mujoco-contact-0.001", "mujoco-spring-damper-0.001")
@pytest.mark.parametrize("clearance", [1e-3, *slow(1e-2, 1e-4)])
@pytest.mark.parametrize(
    ("name", "model"), slow_but([row for row in PINS if row[0] == "mujoco"] + [("exudyn", "massless-link")], PINS)
)
def test_a_loose_pin_of_the_papers_case_starts_and_stays_in_equilibrium(
    name: str, model: JointModel, clearance: float
) -> None:
    m = load("paper").with_clearances({"B": clearance})
    trace = run(name, m, model, "driven", PAPER_RANGE)
    angle, size = reaction_errors(trace, m)
    assert angle < PRESSED[name, model][0]
    assert size < PRESSED[name, model][1]
    assert trace.free_share == {"B": 0.0}
    np.testing.assert_allclose(trace.time, np.radians(PAPER_RANGE - PAPER_RANGE[0]) / (m.speed or 0.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "model", "pin"), [*((*row, "B") for row in PINS), *((*row, "C") for row in PINS if row[0] == "mujoco")]
)
def test_a_six_bar_with_two_loose_pins(name: str, model: JointModel, pin: str) -> None:
    m = load("six-bar").with_clearances({pin: 1e-4, "F": 1e-4})
    trace = run(name, m, model, "driven", np.arange(10.0, 360.0, 25.0))
    for joint in "DABECFG":
        angle, size = reaction_errors(trace, m, joint)
        assert angle < 0.05, joint
        assert size < 0.2, joint
    truth = equilibrium(trace, m)
    places = [f"{body}_angle" for body in m.moving]
    assert max(np.abs(trace.signals[n] - truth[n]).max() for n in places) < 3e-4


@pytest.mark.slow
@pytest.mark.parametrize("joints", ["E", "A", "D", "AB", "DABE"])
@pytest.mark.parametrize("model", LOOSE)
def test_mujoco_has_clearance_at_any_joint_wherever_its_tree_is_cut(model: JointModel, joints: str) -> None:
    m = load("paper").with_clearances(dict.fromkeys(joints, 1e-3 if len(joints) < 4 else 1e-4))
    trace = run("mujoco", m, model, "driven", PAPER_RANGE)
    truth = equilibrium(trace, m)
    limit = {"massless-link": 1e-4, "spring-damper": 3e-3, "contact": 1e-3}[model]
    assert off(trace.signals, truth, is_force) < limit
    for joint in joints:
        assert np.abs(np.angle(vector(trace, f"clearance_{joint}") / vector(truth, f"clearance_{joint}"))).max() < limit
    assert set(trace.journal) == set(trace.free_share) == set(joints)
    assert all(len(path) >= 100 for path in trace.journal.values())


@pytest.mark.long_rows("pybullet-spring-damper")
@pytest.mark.parametrize(("name", "model"), slow_but([*ROOMY.items(), ("mujoco", "spring-damper")], PINS))
def test_angles_are_passed_in_the_drives_direction_and_answered_in_the_order_of_the_question(
    name: str, model: JointModel
) -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    m = m.replace(drive=Drive(joint="D", speed=-(m.speed or 0.0)))
    asked = np.array([60.0, 62.0, 60.0, 61.5])
    trace = run(name, m, model, "driven", asked, lead_in=0.05)
    np.testing.assert_allclose(trace.signals["crank_angle"], np.radians(asked), atol=1e-8)
    np.testing.assert_allclose(trace.signals["crank_angular_velocity"], m.speed or 0.0, rtol=1e-8)
    np.testing.assert_allclose(trace.time, np.radians(asked - 62.0) / (m.speed or 0.0), atol=1e-9)
    angle, size = reaction_errors(trace, m)
    assert angle < 0.05
    assert size < 0.2


@pytest.mark.long_rows("pybullet-spring-damper", "exudyn-contact", "dart-contact")
@pytest.mark.parametrize(("name", "model"), ROOMY.items())
def test_a_lead_in_ends_where_a_direct_start_begins_and_the_same_request_gives_the_same_bits(
    name: str, model: JointModel
) -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    led, direct, again = (run(name, m, model, "driven", [60.0, 61.0], lead_in=lead) for lead in (0.1, 0.0, 0.0))
    reaction = vector(direct, "reaction_B")
    np.testing.assert_allclose(vector(led, "reaction_B"), reaction, rtol=0, atol=2e-4 * np.abs(reaction).max())
    np.testing.assert_array_equal(led.time, direct.time)
    for signal, values in direct.signals.items():
        np.testing.assert_array_equal(again.signals[signal], values)


@pytest.mark.long_rows("exudyn")
@pytest.mark.parametrize("name", slow_but(["mujoco", "exudyn"], ENGINES))
def test_the_crank_turns_to_where_it_is_sent_and_its_angle_is_not_wrapped(name: str) -> None:
    m, asked = at_speed(load("crank-rocker"), 10.0), np.array([700.0, 20.0, 380.0, 20.0])
    trace = run(name, m, "ideal", "driven", asked)
    np.testing.assert_allclose(
        trace.signals["crank_angle"], np.radians(asked), atol=1e-12 if name == "exudyn" else 1e-9
    )
    np.testing.assert_allclose(trace.signals["crank_angular_velocity"], 10.0, rtol=1e-9)
    assert_signals(trace, ideal_signals(m, np.radians(asked)), 3e-4, 1e-6)


@pytest.mark.long_rows("pybullet")
@pytest.mark.parametrize("name", ENGINES)
def test_unequal_angles_change_no_force(name: str) -> None:
    """Steps of changing size would: an engine closes loops by the drift of the step before."""
    m, theta = load("crank-rocker"), np.sort(np.random.default_rng(5).uniform(0.0, 100.0, 25))
    assert_signals(run(name, m, "ideal", "driven", theta), ideal_signals(m, np.radians(theta)), 1e-4, 1e-6)


@pytest.mark.parametrize(("name", "model"), slow_but([("mujoco", "spring-damper")], PINS))
def test_reports_may_be_unevenly_spaced(name: str, model: JointModel) -> None:
    m = load("paper").with_clearances({"B": 1e-3})
    even = np.arange(30.0, 51.0, 10.0)
    uneven = np.sort(np.concatenate([even, even[:-1] + 0.0007, even[:-1] + 7.3]))
    seen, right = (run(name, m, model, "driven", degrees).signals for degrees in (uneven, even))
    pick = np.searchsorted(uneven, even)
    for signal in ("reaction_B_x", "reaction_B_y", "drive_torque", "follower_angular_velocity"):
        peak = np.abs(right[signal]).max()
        np.testing.assert_allclose(seen[signal][pick], right[signal], atol=1e-4 * peak, err_msg=signal)


@pytest.mark.parametrize("name", ENGINES)
def test_a_mechanism_of_any_name_runs(name: str) -> None:
    m = load("crank-rocker")
    odd, plain = (
        run(name, each, "ideal", "driven", [6.0, 7.0]).signals["follower_angle"]
        for each in (m.replace(name='R&D "x" <1>'), m)
    )
    np.testing.assert_array_equal(odd, plain)


# ---------------------------------------------------------------- runs that fail, and what they leave behind


@pytest.mark.long_rows("exudyn-spring-damper-0.0")
@pytest.mark.parametrize("damping", [0.0, *slow(None)])
@pytest.mark.parametrize(("name", "model"), declared_runs("driven", ("spring-damper", "contact")))
def test_garbage_of_a_stiff_contact_and_a_long_step_is_an_error(
    name: str, model: JointModel, damping: float | None
) -> None:
    m = load("paper").with_clearances({"B": 1e-3}).with_joint("B", contact_stiffness=1e9)
    m = m if damping is None else m.with_joint("B", contact_damping=damping)
    said = "is no evidence" if (name, model) == ("dart", "contact") else "use a smaller step"  # it is rigid, whatever K
    with pytest.raises(SimulationError, match=f"use a smaller step|{said}"):
        run(name, m, model, "driven", PAPER_RANGE, start="centred", step=3e-3)


@pytest.mark.long_rows("massless-link")
@pytest.mark.parametrize("model", ["ideal", "massless-link", "spring-damper", "contact"])
def test_mujoco_says_of_too_long_a_step_that_it_is(model: JointModel) -> None:
    m = at_speed(load("crank-rocker").with_clearances({"B": 2e-4}), 60.0)
    with pytest.raises(SimulationError, match="use a smaller step"):
        run("mujoco", m, model, "driven", TURN, step=2e-3)


@pytest.mark.parametrize(
    ("name", "model", "speed", "clearance"),
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
    name: str, model: JointModel, speed: float, clearance: float
) -> None:
    m = at_speed(load("paper"), speed).with_clearances({"B": clearance})
    with pytest.raises(
        SimulationError, match=r"would take .* steps of .* s, and .* are the most; ask for less, change drive\.speed"
    ):
        run(name, m, model, "driven", [20.0, 160.0])


@pytest.mark.long_rows("exudyn-contact", "pybullet-spring-damper")
@pytest.mark.parametrize(("name", "model"), ROOMY.items())
def test_an_engine_is_silent_and_leaves_nothing_on_disk(
    name: str, model: JointModel, capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a run that diverges too: MuJoCo, left alone, writes MUJOCO_LOG.TXT into the current folder."""
    monkeypatch.chdir(tmp_path)
    m = load("paper").with_clearances({"B": 1e-3})
    run(name, m, model, "driven", [30.0, 30.5])
    run(name, m, "contact", "static", [30.0])
    stiff = m.with_joint("B", contact_stiffness=1e9, contact_damping=0.0)
    with pytest.raises(SimulationError) as failure:
        run(name, stiff, "spring-damper", "driven", PAPER_RANGE, start="centred", step=3e-3)
    assert failure.value.cause is Cause.DIVERGED
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("name", "model"), declared_runs("driven", ("spring-damper", "contact")))
def test_contact_gives_way_where_it_is_not_pressed(name: str, model: JointModel) -> None:
    """Unloaded parallelogram with the pin centred: no force, no contact, the pin stays in its gap."""
    m = load("paper").replace(loads=()).with_clearances({"B": 1e-3})
    trace = run(name, m, model, "driven", [60.0, 60.5, 61.0], start="centred")
    assert trace.free_share["B"] == 1.0
    assert np.abs(trace.journal["B"]).max() < 1e-3
    np.testing.assert_allclose(trace.signals["reaction_B_x"], 0.0, atol=1e-12)
