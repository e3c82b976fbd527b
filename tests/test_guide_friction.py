"""Coulomb friction at the corners of a block with clearance: by hand, in the analytic model, MuJoCo and Exudyn."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import Load, Mechanism, MechanismError
from analytic.mechanism.file import load, loads
from analytic.paper.clearance import displaced
from analytic.paper.guide import FLAT, TILTED
from compare.crosscheck import crosscheck, warn_of_friction
from compare.domain_map.validity import validity
from compare.judge.assumptions import failing_assumption
from compare.judge.discrepancy import Scales, load_tolerances, run_rules
from compare.judge.rocking import rocking as left_rocking
from compare.judge.signals import with_derived
from compare.results.validity import Cell
from marks import slow
from sim_models.engine import JointModel, Motion, Request, Unsupported, declared, engine
from test_guide_contact import ANGLES, FALLING, LOADS, STIFFNESS, check, slider_crank

MU = 0.2
BOTH = pytest.mark.parametrize("name", ["mujoco", "exudyn"])

# ------------------------------------------------------------------ by hand


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
    asked = Request(m, "contact", time=time, start="centred", courses={"O": (knots, knots)}, step=1e-5)
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


@pytest.mark.parametrize("turning", [10.0, -10.0])
@pytest.mark.parametrize("aside", [0.0, 0.0475, 0.07])
@pytest.mark.parametrize("engine_too", [False, pytest.param(True, marks=pytest.mark.mujoco)])
def test_friction_shifts_the_load_between_corners_and_may_tilt_a_block(
    aside: float, turning: float, engine_too: bool
) -> None:
    """4.75 cm aside of its point a block of 10 cm rests flat as it slides one way, and tilts as it slides the other."""
    m = loaded(aside, turning)
    theta = np.radians([20.0, 70.0, 130.0, 200.0, 290.0, 340.0])
    across, along, how = by_hand(m, aside, theta)
    assert {0.0: {FLAT}, 0.0475: {FLAT, TILTED}, 0.07: {TILTED}}[aside] == set(how.tolist())
    if engine_too:
        seen = engine("mujoco").simulate(Request(m, "contact", "static", theta)).signals
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

RUNS = [("mujoco", "static", load) for load in LOADS]
LONG = [(name, "driven", load) for name in ("mujoco", "exudyn") for load in LOADS]


@pytest.mark.parametrize(("name", "motion", "load"), [*RUNS, *slow(*LONG)])
def test_engines_and_the_analytic_model_have_the_same_friction(name: str, motion: Motion, load: str) -> None:
    """But for what corners give where they are springs: 6 % of the clearance."""
    pytest.importorskip(name)
    m = slider_crank(load).with_joint("S", friction=MU)
    if motion == "static":
        m = m.with_joint("S", contact_stiffness=STIFFNESS)
    asked = Request(m, "contact", motion, ANGLES, lead_in=0.5 if motion == "driven" else 0.0)
    seen = dict(engine(name).simulate(asked).signals)
    found = displaced(Assembly(m), ANGLES, 10.0, inertia=motion == "driven")
    assert np.nanmax(np.abs(found.signals()["reaction_S_x"])) > 5.0
    check(seen, found.signals(), set(found.flags), 3e-3 if name == "mujoco" else 0.06)


def test_friction_that_locks_the_linkage_says_so() -> None:
    m = loaded(0.0, -10.0).with_joint("S", friction=4.0)
    with pytest.raises(AssemblyError, match="friction at its block's corners locks the linkage at crank angle"):
        displaced(Assembly(m), np.radians([20.0, 70.0, 130.0]), -10.0, inertia=False)


def test_two_kinds_of_friction_that_grow_with_reactions_are_refused() -> None:
    m = loaded(0.0, 10.0).with_joint("B", friction_radius=1e-3)
    with pytest.raises(AssemblyError, match="friction_radius of joint 'B' and friction of the block of 'S' both grow"):
        displaced(Assembly(m), np.radians([20.0]), 10.0, inertia=False)


@pytest.mark.parametrize(("name", "motion"), [("mujoco", "static"), ("mujoco", "driven"), ("exudyn", "driven")])
def test_a_motor_along_the_guide_gives_what_friction_takes(name: str, motion: Motion) -> None:
    """mu m g, of a block that it moves at an even speed; the guide's force has both, and so none along."""
    pytest.importorskip(name)
    m = loads(FALLING.replace('joint = "S"\nspeed = "free"', 'joint = "S"\nspeed = 0.1'))
    m = m.with_joint(
        "S", clearance=1e-4, friction=MU, contact_law="kelvin-voigt", contact_stiffness=1e7, restitution=0.2
    )
    found = crosscheck(m, name, joint_model="contact", motion=motion, times=np.linspace(0.01, 0.1, 4), workers=1)
    (run,) = found.runs
    assert run.verdict == "agrees"
    for side in (run.analytic, run.simulated):
        np.testing.assert_allclose(side["drive_force_S"], MU * 0.5 * 9.81, rtol=1e-6)
        np.testing.assert_allclose(side["reaction_S_x"], 0.0, atol=1e-8)


@BOTH
@pytest.mark.parametrize("mu", [1.8, 2.1])
def test_a_block_lies_flat_up_to_its_length_over_its_height_and_tips_beyond(name: str, mu: float) -> None:
    """Its corners' couple mu N h/2 against N L/2, the most that its weight on the corner in front can do: drawn at an
    even speed it lies flat below mu = L/h = 2, and above goes over to where corners of both walls hold it.
    """
    pytest.importorskip(name)
    m = loads(FALLING.replace('joint = "S"\nspeed = "free"', 'joint = "S"\nspeed = 0.1'))
    m = m.with_joint("S", clearance=1e-4, friction=mu, contact_law="kelvin-voigt", contact_stiffness=1e7)
    m = m.with_joint("S", restitution=0.2)
    assert m.joint("S").jams_from == 2.0
    time, knots = np.array([0.05, 0.1]), np.linspace(0.0, 0.11, 5)
    asked = Request(m, "contact", time=time, courses={"O": (knots, knots), "S": (knots, 0.1 * knots)})
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
    trace = engine(name).simulate(Request(m, "contact", "driven", theta, lead_in=0.1))
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
    assert failing_assumption(planted, rocking(), load_tolerances()) is None


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
        (cell,) = validity(m, speeds=[m.speed or 0.0], clearances=[1e-4], simulators=name, workers=1).cells
        assert isinstance(cell, Cell)
        assert (cell.cause, cell.swings) == ("quasi-static", True)


# ------------------------------------------------------------------ who has it


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
        engine(name).simulate(Request(m, "contact", motion, ANGLES))


def test_exudyn_has_no_friction_at_rest() -> None:
    pytest.importorskip("exudyn")
    m = slider_crank("flat").with_joint("S", friction=MU)
    with pytest.raises(Unsupported, match=r"friction in contact .*: leave out friction = 0.2 of joint 'S'"):
        engine("exudyn").simulate(Request(m, "contact", "static", ANGLES))


@pytest.mark.mujoco
@pytest.mark.parametrize("fields", [{"contact_stiffness": 1e7, "contact_damping": 0.0}, {"restitution": 0.5}])
def test_a_law_without_a_name_rubs_as_hard(fields: dict[str, float]) -> None:
    m = slider_crank("flat").with_joint("S", friction=MU, **fields)
    seen = engine("mujoco").simulate(Request(m, "contact", "driven", ANGLES[3:6])).signals
    np.testing.assert_allclose(np.abs(seen["reaction_S_x"] / seen["reaction_S_y"]), MU, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_cross_check_tells_what_friction_of_a_block_takes() -> None:
    m = slider_crank("tilted", speed=30.0).with_joint("S", friction=MU, contact_law="kelvin-voigt", restitution=0.5)
    m = m.with_joint("S", contact_stiffness=1e7)
    found = crosscheck(m, "mujoco", joint_model="contact", revolutions=1, angles=ANGLES[::10], workers=1)
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
    with pytest.warns(match="friction of S is in contact joints only; the other joint models leave it out"):
        found = crosscheck(m, "dart", motion="static", angles=ANGLES[::10], workers=1)
    assert found.verdict == "agrees"
    assert np.abs(found.runs[-1].analytic["reaction_S_x"]).max() < 1e-9


def test_friction_without_clearance_does_nothing_and_says_so() -> None:
    pytest.importorskip("mujoco")
    m = load("slider-crank").with_clearances({}).with_joint("S", friction=MU)
    with pytest.warns(match=r"friction of joint S does nothing, as S has no clearance.*friction_torque \(N\)"):
        crosscheck(m, "mujoco", joint_model="ideal", motion="static", angles=ANGLES[:2], workers=1)
