"""Coulomb friction at the corners of a block with clearance: by hand, in the analytic model, MuJoCo and Exudyn."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analytic.beyond_paper.freedom import Freedom
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Load, Mechanism, MechanismError
from analytic.mechanism.file import load, loads
from analytic.paper.clearance import Model, displaced, faint_reactions
from analytic.paper.compliance import compliance
from analytic.paper.guide import FLAT, TILTED
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from compare.accuracy import accuracy
from compare.analyse import analyse, simulate
from compare.arguments import warn_of_friction
from compare.check import check
from compare.crosscheck import crosscheck
from compare.domain_map.validity import validity
from compare.export import export
from compare.judge.assumptions import failing_assumption
from compare.judge.discrepancy import Scales, run_rules
from compare.judge.rocking import rocking as left_rocking
from compare.judge.signals import with_derived
from compare.judge.tolerances import load_tolerances
from compare.results.validity import Cell
from marks import slow
from sim_models.engine import JointModel, Motion, Unsupported, declared, engine
from test_guide_contact import ANGLES, FALLING, LOADS, STIFFNESS, slider_crank
from test_guide_contact import check as assert_alike

MU = 0.2
BOTH = pytest.mark.parametrize("name", ["mujoco", "exudyn"])

# ------------------------------------------------------------------ by hand


@pytest.mark.long_rows("mujoco")
@BOTH
def test_a_block_slides_down_its_guide_and_bears_on_the_corners_in_front(name: str) -> None:
    """A weight N that presses it takes mu N of what pulls it along; the couple of mu N at its lower corners, h/2 below
    its centre, is borne by (mu N / 2) h / L more on those in front than without, and as much less behind.
    """
    pytest.importorskip(name)
    pulling, pressing, length, height, stiffness = 5.0, 9.81, 0.1, 0.05, 1e7
    m = loads(FALLING.replace("[0.0, -9.81]", f"[{pulling}, {-pressing}]"))
    m = m.with_joint("S", clearance=1e-5, contact_law="kelvin-voigt", contact_stiffness=stiffness, restitution=0.1)
    m = m.with_joint("S", friction=MU)
    time = np.array([0.03, 0.04, 0.05])
    knots = np.linspace(0.0, 0.06, 5)
    asked = request_of(m, "contact", time=time, start="centred", courses={"O": (knots, knots)}, step=1e-5)
    seen = engine(name).simulate(asked).signals
    speed = np.diff(seen["block_x"]) / 0.01
    assert (speed[1] - speed[0]) / 0.01 == pytest.approx(pulling - MU * pressing, rel=2e-4)
    weight = 0.5 * pressing
    np.testing.assert_allclose(seen["block_angle"], -MU * weight * height / (stiffness * length**2), rtol=1e-3)
    np.testing.assert_allclose(seen["reaction_S_x"], -MU * weight, rtol=1e-4)


def loaded(aside: float, turning: float, clearance: float = 1e-7) -> Mechanism:
    """The shipped slider-crank without weight, a force of 50 N pressing its block ``aside`` (m) of its point."""
    m = load("slider-crank")
    points = {"B": (0.0, 0.0), "S": (0.0, 0.0), "F": (aside, 0.0)}
    slider = m.body("slider").model_copy(update={"points": points, "com": (0.0, 0.0)})
    drive = m.drives[0].model_copy(update={"speed": turning})
    pressing = Load(body="slider", point="F", force=(0.0, -50.0))
    m = m.replace(bodies=(*m.bodies[:2], slider), drive=drive, gravity=(0.0, 0.0), loads=(pressing,))
    m = m.with_clearances({"S": clearance})
    return m.with_joint("S", friction=MU, friction_torque=0.0, damping=0.0, stiffness=0.0, contact_stiffness=1e10)


def by_hand(m: Mechanism, aside: float, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force (N,) N across on that block, force along, and how it rests, by the equilibrium of block and weightless rod:
    R is along the rod, R_x = -f, N = 50 - R_y, and f = -s mu N flat, -s mu (2/L) |M| tilted, M = 50 d + s mu (h/2) N.
    """
    crank, rod = m.body("crank").length, m.body("rod").length
    length, height = m.joint("S").guide or (0.0, 0.0)
    angle = np.arcsin(-crank * np.sin(theta) / rod)
    sign = -np.sign(crank * (np.sin(theta) - np.cos(theta) * np.tan(angle))) * np.sign(m.speed or 1.0)
    slope = MU * sign * np.tan(angle)
    flat = 50 / (1 + slope)
    lean = np.abs(50 * aside + sign * MU * height / 2 * flat) > flat * length / 2
    tilted = 50 * (1 - slope * 2 * aside / length) / (1 + slope * sign * MU * height / length)
    moment = 50 * aside + sign * MU * height / 2 * tilted
    across = np.where(lean, tilted, flat)
    along = -sign * MU * np.where(lean, 2 / length * moment, flat)
    return across, along, np.where(lean, TILTED, FLAT)


@pytest.mark.mujoco
@pytest.mark.parametrize("turning", [10.0, -10.0])
@pytest.mark.parametrize(
    ("engine_too", "aside"),
    [(False, 0.0), (False, 0.0475), (False, 0.07), *slow((True, 0.0), (True, 0.0475), (True, 0.07))],
)
def test_friction_shifts_the_load_between_corners_and_may_tilt_a_block(
    aside: float, turning: float, engine_too: bool
) -> None:
    """4.75 cm aside of its point a block of 10 cm rests flat as it slides one way, and tilts as it slides the other."""
    m = loaded(aside, turning)
    theta = np.radians([20.0, 70.0, 130.0, 200.0, 290.0, 340.0])
    across, along, how = by_hand(m, aside, theta)
    assert {0.0: {FLAT}, 0.0475: {FLAT, TILTED}, 0.07: {TILTED}}[aside] == set(how.tolist())
    if engine_too:
        seen = engine("mujoco").simulate(request_of(m, "contact", "static", theta)).signals
        tilts = np.abs(seen["clearance_S_angle"]) > 1e-6
    else:
        found = displaced(Assembly(m), theta, turning, inertia=False)
        assert not found.flags
        seen, tilts = found.signals(), np.abs(found.rests["S"]) == TILTED
    np.testing.assert_array_equal(tilts, how == TILTED)
    np.testing.assert_allclose(seen["reaction_S_y"], across, rtol=1e-4)
    np.testing.assert_allclose(seen["reaction_S_x"], along, rtol=1e-4)
    np.testing.assert_allclose(seen["reaction_S_moment"], 50 * aside, atol=5e-5)


# ------------------------------------------------------------------ engines and the analytic model

RUNS = [("mujoco", "static", "either")]
LONG = [("mujoco", "static", load) for load in LOADS if load != "either"]
LONG += [(name, "driven", load) for name in ("mujoco", "exudyn") for load in LOADS]


@pytest.mark.parametrize(("name", "motion", "load"), [*RUNS, *slow(*LONG)])
def test_engines_and_the_analytic_model_have_the_same_friction(name: str, motion: Motion, load: str) -> None:
    """But for what corners give where they are springs: 6 % of the clearance."""
    pytest.importorskip(name)
    m = slider_crank(load).with_joint("S", friction=MU)
    if motion == "static":
        m = m.with_joint("S", contact_stiffness=STIFFNESS)
    asked = request_of(m, "contact", motion, ANGLES, lead_in=0.5 if motion == "driven" else 0.0)
    seen = dict(engine(name).simulate(asked).signals)
    found = displaced(Assembly(m), ANGLES, 10.0, inertia=motion == "driven")
    assert np.nanmax(np.abs(found.signals()["reaction_S_x"])) > 5.0
    assert_alike(seen, found.signals(), set(found.flags), 3e-3 if name == "mujoco" else 0.06)


def test_friction_that_locks_the_linkage_says_so() -> None:
    m = loaded(0.0, -10.0).with_joint("S", friction=4.0)
    with pytest.raises(AssemblyError, match="friction that its reactions give locks the linkage at crank angle"):
        displaced(Assembly(m), np.radians([20.0, 70.0, 130.0]), -10.0, inertia=False)


SHORT_ROD = """
name = "short rod"
ground = { points = { D = [0.0, 0.0], S = [0.0, 0.0] } }
body = [
  { name = "crank", points = { D = [0.0, 0.0], A = [0.1, 0.0] }, mass = 0.2 },
  { name = "rod", points = { A = [0.0, 0.0], B = [0.105, 0.0] }, mass = 0.2 },
  { name = "slider", points = { B = [0.0, 0.0], S = [0.0, 0.0] }, mass = 0.3, inertia = 1e-4 },
]
joint = [
  { name = "D", type = "revolute", bodies = ["ground", "crank"] },
  { name = "A", type = "revolute", bodies = ["crank", "rod"] },
  { name = "B", type = "revolute", bodies = ["rod", "slider"] },
  { name = "S", type = "prismatic", bodies = ["ground", "slider"], axis = [1.0, 0.0], guide = [0.05, 0.02] },
]
drive = { joint = "D", speed = -1.0 }
load = [{ body = "slider", force = [-50.0, 0.0] }]
assembly = { crank = 0.2, rod = -0.1903, slider = 0.0 }
"""


@pytest.mark.parametrize("model", ["equilibrium", "first_order"])
def test_friction_that_locks_a_linkage_elsewhere_is_no_matter_here(model: Model) -> None:
    """A weightless rod at the angle b: R cos b = 50 + mu R sin b; it locks where tan b = 1/mu, near 70 deg of crank."""
    m = loads(SHORT_ROD).with_joint("S", clearance=1e-4, friction=0.5)
    theta = np.radians([10.0, 15.0, 20.0])
    found = displaced(Assembly(m), theta, -1.0, inertia=False, model=model)
    assert not found.flags
    if model == "equilibrium":
        np.testing.assert_allclose(found.reactions.drive_torque, [-1.855, -2.898, -4.031], atol=5e-4)
    gap = -1e-4 if model == "equilibrium" else 0.0  # by which the block is off the middle of its guide
    lean = np.arcsin((0.1 * np.sin(theta) - gap) / 0.105)
    torque = -50.0 / (np.cos(lean) - 0.5 * np.sin(lean)) * 0.1 * np.sin(theta + lean)
    np.testing.assert_allclose(found.reactions.drive_torque, torque, rtol=1e-9)
    with pytest.raises(AssemblyError, match="locks the linkage at crank angle 70 deg"):
        displaced(Assembly(m), np.radians([10.0, 70.0]), -1.0, inertia=False, model=model)


def test_pins_may_rest_in_their_clearance_where_friction_locks_a_linkage_elsewhere() -> None:
    """What is too faint to have a direction is told by reactions that no friction makes grow beyond measure."""
    m = loads(SHORT_ROD).with_clearances({"B": 1e-5}).with_joint("S", friction=0.5)
    theta = np.radians([10.0, 15.0, 20.0])
    found = displaced(Assembly(m), theta, -1.0, inertia=False)
    assert not found.flags
    lean = np.arcsin(0.1 * np.sin(theta) / 0.105)
    torque = -50.0 / (np.cos(lean) - 0.5 * np.sin(lean)) * 0.1 * np.sin(theta + lean)
    np.testing.assert_allclose(found.reactions.drive_torque, torque, rtol=1e-3)
    lean = np.arcsin(0.1 / 0.105)
    faint = faint_reactions(Assembly(m), np.array([-1.0]), np.zeros(1), False)["B"]
    assert faint == pytest.approx(0.01 * 50.0 / np.cos(lean), rel=1e-3)  # of the smooth linkage, at 90 deg


@pytest.mark.long_rows("mujoco-static")
@pytest.mark.parametrize(("name", "motion"), [("mujoco", "static"), *slow(("mujoco", "driven")), ("exudyn", "driven")])
def test_a_motor_along_the_guide_gives_what_friction_takes(name: str, motion: Motion) -> None:
    """mu m g, of a block that it moves at an even speed; the guide's force has both, and so none along."""
    pytest.importorskip(name)
    m = loads(FALLING.replace('joint = "S", speed = "free"', 'joint = "S", speed = 0.1'))
    m = m.with_joint(
        "S", clearance=1e-4, friction=MU, contact_law="kelvin-voigt", contact_stiffness=1e7, restitution=0.2
    )
    found = crosscheck(m, name, joint_model="contact", motion=motion, times=np.linspace(0.01, 0.1, 4), workers=1)
    (run,) = found.runs
    assert run.verdict == "agrees"
    for side in (run.analytic, run.simulated):
        np.testing.assert_allclose(side["drive_force_S"], MU * 0.5 * 9.81, rtol=1e-6)
        np.testing.assert_allclose(side["reaction_S_x"], 0.0, atol=1e-8)


@pytest.mark.parametrize("name", ["exudyn", *slow("mujoco")])
@pytest.mark.parametrize("mu", [1.8, 2.1])
def test_a_block_lies_flat_up_to_its_length_over_its_height_and_tips_beyond(name: str, mu: float) -> None:
    """Its corners' couple mu N h/2 against N L/2, the most that its weight on the corner in front can do: drawn at an
    even speed it lies flat below mu = L/h = 2, and above goes over to where corners of both walls hold it.
    """
    pytest.importorskip(name)
    m = loads(FALLING.replace('joint = "S", speed = "free"', 'joint = "S", speed = 0.1'))
    m = m.with_joint("S", clearance=1e-4, friction=mu, contact_law="kelvin-voigt", contact_stiffness=1e7)
    m = m.with_joint("S", restitution=0.2)
    assert m.joint("S").jams_from == 2.0
    time, knots = np.array([0.05, 0.1]), np.linspace(0.0, 0.11, 5)
    asked = request_of(m, "contact", time=time, courses={"O": (knots, knots), "S": (knots, 0.1 * knots)})
    seen = engine(name).simulate(asked).signals
    assert abs(seen["clearance_S_angle"][-1]) == pytest.approx(0.002 if mu > 2 else 0.0, abs=2e-5)


@pytest.mark.slow
@pytest.mark.exudyn
def test_a_block_that_jams_is_told_of_before_it_comes_apart_and_after() -> None:
    m = rocking(2.05).with_joint("S", contact_law=None, contact_stiffness=None)
    with pytest.warns(match=r"friction = 2.05 of joint S is no less than its block is longer than high \(2\)"):
        found = crosscheck(m, "exudyn", joint_model="contact", revolutions=1, workers=1)
    (failure,) = found.failures
    assert "; or give joint S friction below 2, its block's length over its height" in failure.why


def test_a_block_at_rest_or_with_less_friction_is_not_said_to_jam() -> None:
    cases: tuple[tuple[float, Motion], ...] = ((5.0, "static"), (1.9, "driven"))
    for mu, motion in cases:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warn_of_friction(rocking(mu), "contact", motion)


def rocking(mu: float = 0.1) -> Mechanism:
    """The slider-crank whose weight presses a block between walls that yield: flores with 1e6 N/m, at 100 rpm."""
    m = load("slider-crank").replace(gravity=(0.0, -9.81))
    slider = m.body("slider").model_copy(update={"inertia": 2e-4})
    drive = m.drives[0].model_copy(update={"speed": 100 * np.pi / 30})
    m = m.replace(bodies=(*m.bodies[:2], slider), drive=drive).with_clearances({"S": 1e-4})
    return m.with_joint("S", friction=mu, restitution=0.5, contact_law="flores", contact_stiffness=1e6)


@BOTH
def test_after_a_reversal_a_block_turns_into_its_walls_as_fast_as_they_give(name: str) -> None:
    """Friction's couple mu N h/2 has turned round, and the block lags behind, overdamped, by C/K = 1.6 delta/v0, where
    a corner is delta = N/(2 K) deep; its moment of reaction, which the analytic model has as 0, is what that takes.
    """
    pytest.importorskip(name)
    m, theta = rocking(), np.radians([0.5, 1.0, 1.5, 2.0])
    trace = engine(name).simulate(request_of(m, "contact", "driven", theta, lead_in=0.1))
    moment, across = trace.signals["reaction_S_moment"], trace.signals["reaction_S_y"]
    speed = trace.settings["minimum_impact_speed"]
    assert isinstance(speed, float)
    lag = 1.6 * across / 2e6 / speed
    falls = np.exp(-np.diff(theta) / (m.speed or 0.0) / ((lag[1:] + lag[:-1]) / 2))
    np.testing.assert_allclose(moment[1:] / moment[:-1], falls, rtol=0.01)
    assert not displaced(Assembly(m), theta, m.speed or 0.0).signals()["reaction_S_moment"].any()
    told = left_rocking(Assembly(m), m.joint("S"), theta, m.speed or 0.0, across)
    np.testing.assert_allclose(np.abs(moment), told, rtol=0.1)


@pytest.mark.parametrize(("mu", "joint_model"), [(0.1, "contact"), (0.0, "contact"), (0.1, "spring-damper")])
def test_a_block_s_moment_is_judged_by_what_friction_turns_it_by(mu: float, joint_model: JointModel) -> None:
    """5e-3 of mu F h/2; without friction it has no moment, and is judged by the mass of the linkage."""
    m, theta = rocking(mu), np.radians([5.0, 10.0])
    found = displaced(Assembly(m), theta, m.speed or 0.0).signals()
    both = with_derived(found, m)
    scales = Scales.of(both, m)
    rules = run_rules(load_tolerances(None), m, "driven", joint_model, m.clearances, scales, 0.0)
    allowed = rules["reaction_S_moment"].tolerance(both)
    least = 1e-5 * scales.mass * scales.length
    by_friction = 5e-3 * mu * both["reaction_S_magnitude"].max() * 0.05 / 2 if joint_model == "contact" else 0.0
    np.testing.assert_allclose(allowed, max(by_friction, least), rtol=1e-9)
    assert (by_friction > 30 * least) == (by_friction > 0)


@pytest.mark.slow
@BOTH
def test_a_block_that_turns_into_soft_walls_agrees_and_one_that_has_not_yet_does_not(name: str) -> None:
    pytest.importorskip(name)
    for degrees, verdict in (([5.0, 10.0], "agrees"), ([0.5, 5.0], "disagrees")):
        found = crosscheck(rocking(), name, joint_model="contact", angles=np.radians(degrees), workers=1)
        assert found.verdict == verdict
        off = [d.signal for run in found.runs for d in run.discrepancies if d.verdict == "disagrees"]
        assert off == ["reaction_S_moment"] * (verdict == "disagrees")
    (run,) = found.runs
    assert run.because is not None
    assert (run.because.assumption, run.because.joint) == ("quasi-static", "S")
    assert "rocks there for a while after its friction turns round" in run.because.words
    wrong = run.simulated["reaction_S_moment"] + np.array([0.0, 2e-4])  # which nothing that rocks has left at 5 deg
    planted = run.model_copy(update={"simulated": {**run.simulated, "reaction_S_moment": wrong}})
    schedule = Schedule.at_angles(rocking(), np.radians(degrees))
    assert failing_assumption(planted, rocking(), load_tolerances(), schedule) is None


@pytest.mark.slow
@BOTH
def test_a_block_that_nothing_damps_rocks_for_ever_and_that_is_why_it_disagrees(name: str) -> None:
    pytest.importorskip(name)
    m = rocking().with_joint("S", contact_law=None, restitution=None, contact_damping=0.0, contact_stiffness=1e7)
    (run,) = crosscheck(m, name, joint_model="contact", revolutions=1, workers=1).runs
    assert run.verdict == "disagrees"
    assert run.because is not None
    assert "rocks there for ever, as nothing damps its contact" in run.because.words
    if name == "mujoco":
        (cell,) = validity(m, speeds=[m.speed or 0.0], clearances=[1e-4], simulator=name, workers=1).cells
        assert isinstance(cell, Cell)
        assert (cell.cause, cell.swings) == ("quasi-static", True)


# ------------------------------------------------------------------ without clearance

PRESS = """
name = "press"
ground = { points = { O = [0.0, 0.0], S = [0.0, 0.0] } }
body = [
  { name = "crank", points = { O = [0.0, 0.0], A = [0.2, 0.0] }, mass = 1e-6 },
  { name = "rod", points = { A = [0.0, 0.0], B = [0.8, 0.0] }, mass = 1e-6 },
  { name = "slider", points = { B = [0.0, 0.0], S = [0.0, 0.0] }, mass = 1e-6 },
]
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "crank"] },
  { name = "A", type = "revolute", bodies = ["crank", "rod"] },
  { name = "B", type = "revolute", bodies = ["rod", "slider"] },
  { name = "S", type = "prismatic", bodies = ["ground", "slider"], axis = [1, 0], guide = [0.1, 0.05], friction = 0.1 },
]
drive = { joint = "O", speed = -1.0 }
load = [{ body = "slider", force = [-100.0, 0.0] }]
assembly = { crank = 0.96, rod = -0.2, slider = 0.0 }
"""
AT_55 = np.radians([55.0])
BLOCKS = [pytest.param(name, marks=getattr(pytest.mark, name)) for name in ("mujoco", "pybullet", "dart")]


def pressed_by_hand() -> tuple[float, float]:
    """Force (N) across on the block at 55 deg, and the crank's torque (N.m): N = R sin b, R cos b = 100 + mu N."""
    lean = np.arcsin(0.2 * np.sin(AT_55[0]) / 0.8)
    rod = 100.0 / (np.cos(lean) - 0.1 * np.sin(lean))
    return rod * np.sin(lean), -0.2 * rod * np.sin(AT_55[0] + lean)


def test_a_block_without_clearance_rubs() -> None:
    across, torque = pressed_by_hand()
    assert (across, torque) == (pytest.approx(20.922 / (1 - 0.02092), rel=2e-4), pytest.approx(-19.18, abs=0.005))
    found = analyse(loads(PRESS), motion="static", angles=AT_55)
    assert not any("friction" in text for text in found.warnings)
    assert found.signals["drive_torque"][0] == pytest.approx(torque, rel=1e-9)
    assert found.signals["reaction_S_y"][0] == pytest.approx(across, rel=1e-9)
    assert found.signals["reaction_S_x"][0] == pytest.approx(-0.1 * across, rel=1e-9)
    smooth = analyse(loads(PRESS).with_joint("S", friction=0.0), motion="static", angles=AT_55)
    assert smooth.signals["drive_torque"][0] == pytest.approx(-18.78, abs=0.005)


@pytest.mark.parametrize("name", BLOCKS)
def test_engines_rub_a_block_without_clearance_and_commands_agree(name: str, tmp_path: Path) -> None:
    across, torque = pressed_by_hand()
    m = loads(PRESS)
    seen = simulate(m, name, motion="static", angles=AT_55)
    assert seen.signals["drive_torque"][0] == pytest.approx(torque, rel=1e-6)
    assert seen.signals["reaction_S_y"][0] == pytest.approx(across, rel=1e-6)
    (run,) = crosscheck(m, name, motion="static", angles=AT_55, workers=1).runs
    assert run.verdict == "agrees"
    assert run.analytic["drive_torque"][0] == pytest.approx(torque, rel=1e-9)
    (tmp_path / "press.csv").write_text(f"crank_angle [deg],drive_torque [N.m]\n55,{float(torque)!r}\n")
    assert check(tmp_path / "press.csv", m, motion="static").verdict == "agrees"
    (tmp_path / "press.csv").write_text("crank_angle [deg],drive_torque [N.m]\n55,-18.78\n")
    assert check(tmp_path / "press.csv", m, motion="static").verdict == "disagrees"


@pytest.mark.parametrize("moving", [True, False])
def test_a_block_with_clearance_tends_to_one_without(moving: bool) -> None:
    m, theta = loaded(0.0475, 10.0).with_clearances({}), np.radians([20.0, 70.0, 130.0, 200.0, 290.0, 340.0])
    ideal = kinetostatics(kinematics(Assembly(m), theta, 10.0), moving).drive_torque
    for clearance in (1e-5, 1e-6, 1e-7):
        found = displaced(Assembly(m.with_clearances({"S": clearance})), theta, 10.0, inertia=moving)
        off = np.abs(found.reactions.drive_torque - ideal).max()
        assert 0 < off < 30.0 * clearance / 1e-5 * 1e-3


@pytest.mark.parametrize("turning", [10.0, -10.0])
@pytest.mark.parametrize("aside", [0.0, 0.0475, 0.07])
@pytest.mark.parametrize("name", ["", *BLOCKS])
def test_a_block_without_clearance_is_rubbed_on_the_corners_that_bear_it(
    aside: float, turning: float, name: str
) -> None:
    m = loaded(aside, turning).with_clearances({})
    theta = np.radians([20.0, 70.0, 130.0, 200.0, 290.0, 340.0])
    across, along, _ = by_hand(m, aside, theta)
    if name:
        seen = engine(name).simulate(request_of(m, "ideal", "static", theta)).signals
    else:
        seen = kinetostatics(kinematics(Assembly(m), theta, turning), inertia=False).signals()
    np.testing.assert_allclose(seen["reaction_S_y"], across, rtol=1e-5)
    np.testing.assert_allclose(seen["reaction_S_x"], along, rtol=1e-5)
    np.testing.assert_allclose(seen["reaction_S_moment"], 50 * aside, atol=5e-5)


def rough_all_over() -> Mechanism:
    """A slider-crank whose pins and block all rub by a coefficient."""
    m = load("slider-crank").replace(gravity=(0.0, -9.81)).with_joint("S", friction=0.2, friction_torque=0.0)
    for name in "OAB":
        m = m.with_joint(name, friction=0.1, pin_radius=0.01)
    return m


def test_the_drive_pays_what_pins_and_block_take() -> None:
    """Over a turn kinetic and potential energy come back: its work is the friction's, of the reactions' sizes."""
    m = rough_all_over()
    theta = np.arange(3600) * 2 * np.pi / 3600 + 1e-4
    found = kinetostatics(kinematics(Assembly(m), theta, m.speed or 1.0))
    work = np.mean(found.drive_torque) * 2 * np.pi
    slips = {name: found.motion.slip(m.joint(name)) / (m.speed or 1.0) for name in "OABS"}
    across, moment = found.forces["S"].imag, found.moments["S"]
    walls = moment + np.sign(slips["S"]) * 0.2 * 0.05 / 2 * across  # of a block of 0.1 m by 0.05 m
    corners = np.abs(across / 2 - walls / 0.1) + np.abs(across / 2 + walls / 0.1)
    lost = {name: 0.1 * 0.01 * np.abs(found.forces[name]) for name in "OAB"} | {"S": 0.2 * corners}
    paid = {name: np.mean(lost[name] * np.abs(slips[name])) * 2 * np.pi for name in lost}
    assert work == pytest.approx(sum(paid.values()), rel=1e-3)
    assert min(paid.values()) > 0.01 * work
    for name, size in lost.items():
        np.testing.assert_allclose(np.abs(found.rubbed[name]), size, atol=1e-12 * size.max())


@pytest.mark.parametrize("name", BLOCKS)
@pytest.mark.parametrize("motion", [*slow("driven"), "static"])
def test_engines_rub_all_pins_and_the_block_at_once(name: str, motion: Motion) -> None:
    m, theta = rough_all_over(), np.radians(np.arange(5.0, 365.0, 20.0))
    expected = kinetostatics(kinematics(Assembly(m), theta, m.speed or 1.0), motion == "driven").signals()
    seen = engine(name).simulate(request_of(m, "ideal", motion, theta)).signals
    for signal in ("drive_torque", "reaction_S_x", "reaction_S_y", "reaction_B_x"):
        largest = np.abs(expected[signal]).max()
        np.testing.assert_allclose(seen[signal], expected[signal], atol=5e-4 * largest, err_msg=signal)


def test_a_springy_drive_yields_to_the_friction_of_a_block_too() -> None:
    """Rigid links held by a spring: compliance turns the crank back by the drive torque over the stiffness."""
    m = rough_all_over()
    m = m.replace(drive=m.drives[0].model_copy(update={"stiffness": 1e4}))
    motion = kinematics(Assembly(m), np.radians([20.0, 70.0, 130.0, 200.0]), m.speed or 1.0)
    turned = compliance(motion).rotation("crank", "A")
    np.testing.assert_allclose(turned, -kinetostatics(motion, inertia=False).drive_torque / 1e4, atol=1e-15)


# ------------------------------------------------------------------ who has it


@pytest.mark.exudyn
def test_what_has_no_friction_of_blocks_refuses_it(tmp_path: Path) -> None:
    m = loads(PRESS)
    words = r"no friction of blocks without clearance in their guides.*: leave out friction = 0.1 of joint 'S'"
    with pytest.raises(Unsupported, match=words):
        simulate(m, "exudyn", motion="static", angles=AT_55)
    for name in ("mujoco", "pybullet"):
        pytest.importorskip(name)
        with pytest.raises(Unsupported, match=words.replace("guides", "guides in its exports")):
            export(m, name, folder=tmp_path / name, motion="static", angles=AT_55)
    for swings in (released, Freedom.of):
        arguments = (np.linspace(0.0, 0.1, 3),) if swings is released else ()
        with pytest.raises(AssemblyError, match="friction of joint 'S' is given, and the analytic model knows no"):
            swings(Assembly(m), *arguments)


def test_the_coefficient_is_a_block_s_and_newtons_are_a_slide_s() -> None:
    m = load("slider-crank")
    assert m.with_joint("S", friction=MU, friction_torque=3.0).joint("S").coulomb == 3.0
    assert m.with_joint("S", guide=None, friction=5.0).joint("S").coulomb == 5.0
    with pytest.raises(MechanismError, match="friction = 20 of a block with a guide is the coefficient at its corners"):
        m.with_joint("S", friction=20.0)
    with pytest.raises(MechanismError, match="without guide both mean N, keep one"):
        m.with_joint("S", guide=None, friction=MU, friction_torque=3.0)


@pytest.mark.parametrize(("name", "motion"), [("dart", "static"), ("dart", "driven"), ("pybullet", "static")])
def test_engines_whose_contact_has_no_block_refuse_its_friction(name: str, motion: Motion) -> None:
    pytest.importorskip(declared(name).package)
    m = slider_crank("flat").with_joint("S", friction=MU)
    with pytest.raises(Unsupported, match=r"friction in contact .*: leave out friction = 0.2 of joint 'S'"):
        engine(name).simulate(request_of(m, "contact", motion, ANGLES))


def test_exudyn_has_no_friction_at_rest() -> None:
    pytest.importorskip("exudyn")
    m = slider_crank("flat").with_joint("S", friction=MU)
    with pytest.raises(Unsupported, match=r"friction in contact .*: leave out friction = 0.2 of joint 'S'"):
        engine("exudyn").simulate(request_of(m, "contact", "static", ANGLES))


@pytest.mark.mujoco
@pytest.mark.parametrize("fields", [{"restitution": 0.5}, *slow({"contact_stiffness": 1e7, "contact_damping": 0.0})])
def test_a_law_without_a_name_rubs_as_hard(fields: dict[str, float]) -> None:
    m = slider_crank("flat").with_joint("S", friction=MU, **fields)
    seen = engine("mujoco").simulate(request_of(m, "contact", "driven", np.radians([39.0, 45.0]))).signals
    np.testing.assert_allclose(np.abs(seen["reaction_S_x"] / seen["reaction_S_y"]), MU, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_cross_check_tells_what_friction_of_a_block_takes() -> None:
    m = slider_crank("tilted", speed=30.0).with_joint("S", friction=MU, contact_law="kelvin-voigt", restitution=0.5)
    m = m.with_joint("S", contact_stiffness=1e7)
    found = crosscheck(m, "mujoco", joint_model="contact", revolutions=1, angles=ANGLES[::5], workers=1)
    (run,) = found.runs
    assert run.verdict == "agrees"
    assert run.contact is not None
    value = {name: one.value or 0.0 for name, one in run.contact.joints["S"].statistics.items()}
    assert value["friction_loss"] == pytest.approx(MU * value["wear"], rel=1e-3)
    assert value["friction_loss"] > 1.0
    energy = run.contact.energy
    assert energy is not None
    assert abs(energy.missing or 0.0) < 1e-5 * value["friction_loss"]


def test_other_joint_models_leave_it_out_on_both_sides() -> None:
    pytest.importorskip(declared("dart").package)
    m = slider_crank("tilted", speed=30.0).with_joint("S", friction=MU)
    found = crosscheck(m, "dart", motion="static", angles=ANGLES[::5], workers=1)
    assert "left out: friction of joint S, as only contact joints rub in their clearance" in found.warnings
    assert found.verdict == "agrees"
    assert np.abs(found.runs[-1].analytic["reaction_S_x"]).max() < 1e-9


@pytest.mark.slow
@pytest.mark.mujoco
def test_every_command_says_which_joint_models_leave_friction_out_and_what_radius_it_assumes(tmp_path: Path) -> None:
    m = load("crank-rocker").replace(gravity=(0.0, -9.81)).with_clearances({"B": 1e-4}).with_joint("B", friction=0.1)
    others = "left out: friction of joint B, as only contact joints rub in their clearance"
    assumed = "joint B has friction and no pin_radius; its contact rubs at 10 mm, which is assumed"
    angles = np.radians([20.0, 40.0])
    (tmp_path / "torque.csv").write_text("crank_angle [deg],drive_torque [N.m]\n20,0\n40,0\n")

    def told(said: Sequence[str]) -> set[str]:
        text = " ".join(said)
        return {name for name, sentence in (("other", others), ("assumed", assumed)) if sentence in text}

    static: dict[str, Any] = {"motion": "static", "angles": angles}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a result has them
        assert told(analyse(m, **static).warnings) == {"assumed"}
        assert told(accuracy(m, angles=angles, samples=2).warnings) == {"assumed"}
        assert told(simulate(m, "mujoco", **static).warnings) == {"other"}
        assert told(simulate(m, "mujoco", joint_model="contact", **static).warnings) == {"assumed"}
        assert told(crosscheck(m, "mujoco", joint_model="contact", **static).warnings) == {"assumed"}
        assert told(crosscheck(m, "mujoco", workers=1, **static).warnings) == {"other", "assumed"}
        assert told(check(tmp_path / "torque.csv", m, motion="static").warnings) == {"assumed"}
        export(m, "mujoco", folder=tmp_path / "out", joint_model="massless-link", **static)
        assert told([(tmp_path / "out" / "run.py").read_text(encoding="utf-8")]) == {"other"}
        grid = {"speeds": [60.0], "clearances": [1e-4], "joint_model": "contact", "workers": 1, "revolutions": 0}
        assert told(validity(m, simulator="mujoco", **grid).warnings) == {"assumed"}


def test_a_coefficient_of_a_pin_without_clearance_acts_at_its_radius() -> None:
    m = load("crank-rocker")
    for fields in ({"friction": 0.1}, {"friction": 0.1, "pin_radius": 0.02, "friction_radius": 1e-3}):
        given = m.with_joint("B", **fields)
        assert given.joint("B").load_coefficient == given.joint("B").friction_radius
        unused = "friction and pin_radius" if len(fields) > 1 else "friction"
        for ask in (analyse, simulate):
            said = ask(given, motion="static", angles=[1.0]).warnings
            assert any(f"left out: {unused} of joint B, as a pin without clearance rubs by" in text for text in said)
    rough = m.with_joint("B", friction=0.1, pin_radius=0.01)
    theta = np.radians([20.0, 140.0])
    same = m.with_joint("B", friction_radius=1e-3)
    torques = [kinetostatics(kinematics(Assembly(each), theta, 1.0), False).drive_torque for each in (rough, same)]
    np.testing.assert_array_equal(*torques)
    assert rough.with_friction_circle("B", 2e-3) == m.with_joint(
        "B", friction=0.0, pin_radius=0.01, friction_radius=2e-3
    )
    loose = rough.with_clearances({"B": 1e-4})
    assert (loose.load_rubbed, loose.tight().joint("B").friction, loose.ideal().joint("B").friction) == ([], 0.0, 0.0)
    assert rough.ideal().joint("B").friction == 0.1
