"""Loads against the motion: a shaper's tool, a brake.  By the power that they take, and in each engine."""

from __future__ import annotations

import itertools
import math
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import linkage_crosscheck as lc
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Load, Mechanism, MechanismError
from analytic.mechanism.file import dumps, load, loads
from analytic.paper.clearance import displaced
from compare.quantities import quantities
from compare.report.peaks import acting, strokes, together
from engine_checks import CALM, agreed
from engines_here import missing
from marks import slow, slow_but
from sim_models.engine import JointModel, Motion, Unsupported

SHAPER = """
name = "shaper"
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "crank"] },
  { name = "A", type = "revolute", bodies = ["crank", "die"] },
  { name = "G", type = "prismatic", bodies = ["lever", "die"], axis = [1.0, 0.0] },
  { name = "Q", type = "revolute", bodies = ["ground", "lever"] },
  { name = "H", type = "prismatic", bodies = ["lever", "block"], axis = [1.0, 0.0] },
  { name = "B", type = "revolute", bodies = ["ram", "block"] },
  { name = "S", type = "prismatic", bodies = ["ground", "ram"], axis = [1.0, 0.0] },
]
[ground]
points = { O = [0.0, 0.0], Q = [0.0, -0.3], S = [0.0, 0.2] }
[[body]]
name = "crank"
points = { O = [0.0, 0.0], A = [0.1, 0.0] }
mass = 1.0
[[body]]
name = "die"
points = { A = [0.0, 0.0], G = [0.0, 0.0] }
mass = 0.2
inertia = 1e-4
[[body]]
name = "lever"
points = { Q = [0.0, 0.0], G = [0.0, 0.0], H = [0.0, 0.0] }
mass = 2.0
com = [0.25, 0.0]
inertia = 0.05
[[body]]
name = "block"
points = { H = [0.0, 0.0], B = [0.0, 0.0] }
mass = 0.2
inertia = 1e-4
[[body]]
name = "ram"
points = { B = [0.0, 0.0], S = [0.0, 0.0] }
mass = 5.0
inertia = 1e-2
[drive]
joint = "O"
speed = "60 rpm"
[assembly]
crank = 0.3
die = 1.27
lever = 1.27
block = 1.27
ram = 0.0
"""

WIPER = """
name = "wiper"
gravity = [0.0, 0.0]
body = [
  { name = "crank", points = { O = [0.0, 0.0], A = [0.04, 0.0] }, mass = 0.08 },
  { name = "coupler", points = { A = [0.0, 0.0], B = [0.3, 0.0] }, mass = 0.15 },
  { name = "rocker", points = { C = [0.0, 0.0], B = [0.06, 0.0] }, mass = 0.1 },
]
joint = [
  { name = "O", type = "revolute", bodies = ["ground", "crank"] },
  { name = "A", type = "revolute", bodies = ["crank", "coupler"], clearance = "0.05 mm" },
  { name = "B", type = "revolute", bodies = ["coupler", "rocker"], clearance = "0.05 mm" },
  { name = "C", type = "revolute", bodies = ["ground", "rocker"], clearance = "0.05 mm" },
]
load = [{ body = "rocker", torque = 3.0, opposes = true }]
drive = { joint = "O", speed = "45 rpm" }
assembly = { crank = 0.0, coupler = "10 deg", rocker = "100 deg" }
[ground]
points = { O = [0.0, 0.0], C = [0.31, 0.0] }
"""
RADIUS, BELOW, ABOVE = 0.1, 0.3, 0.2  # m: of the crank, from its pivot down to the lever's, and up to the ram
TURN = np.radians(np.arange(5.0, 360.0, 10.0))
CUT = math.radians(200.0), math.radians(340.0)
TOOL = Load(body="ram", force=(400.0, 0.0), opposes=True, over="crank_angle", start=CUT[0], end=CUT[1])
BRAKE = Load(body="lever", torque=20.0, opposes=True)


def shaper(*given: Load) -> Mechanism:
    """A crank whose die turns a slotted lever; a block in that moves the ram.  The ram goes back fast."""
    return loads(SHAPER).replace(loads=given)


def slope(theta: np.ndarray) -> np.ndarray:
    """How the ram (N,) m/rad moves with the crank: x = (above + below) r cos / (below + r sin), written out."""
    c, s = RADIUS * np.cos(theta), RADIUS * np.sin(theta)
    return -(ABOVE + BELOW) * (s * (BELOW + s) + c**2) / (BELOW + s) ** 2


def test_a_quick_return_says_its_stroke_and_how_much_longer_one_way_takes() -> None:
    """The lever turns back where the crank is square to it: 2 c tan(asin(r/b)) apart, pi +- 2 asin(r/b) of a turn."""
    lean = math.asin(RADIUS / BELOW)
    found = dict(strokes(lc.analyse(shaper(), angles=TURN)))
    slow, fast = (math.degrees(math.pi + 2 * way * lean) for way in (1, -1))
    travel = 2e3 * (ABOVE + BELOW) * math.tan(lean)
    assert found["S"] == f"{travel:.4g} mm, {slow:.4g} deg one way, {fast:.4g} deg back ({slow / fast:.2f}:1)"
    assert not list(strokes(lc.analyse(shaper(), angles=TURN[:20])))  # of no whole turn
    assert dict(strokes(lc.analyse(shaper(), angles="0:720:5"))) == found  # of two
    lc.analyse(shaper(), angles="0:720:5").print_to()


def test_a_rocker_says_how_far_it_swings() -> None:
    """Crank and coupler are in line at its ends: triangles of ground 120, rocker 100 and 170 or 70 mm."""
    far, near = (math.degrees(math.acos((0.12**2 + 0.1**2 - r**2) / (2 * 0.12 * 0.1))) for r in (0.17, 0.07))
    assert dict(strokes(lc.analyse("crank-rocker")))["follower"].startswith(f"{far - near:.4g} deg, ")


def extra(motion: Motion, *given: Load) -> np.ndarray:
    """The drive's torque (N,) that loads ask for."""
    with_them, without = (lc.analyse(shaper(*each), motion=motion, angles=TURN) for each in (given, ()))
    return np.asarray(with_them["drive_torque"] - without["drive_torque"])


@pytest.mark.parametrize("motion", ["static", "driven"])
def test_a_cut_takes_its_force_times_the_speed_of_the_tool(motion: Motion) -> None:
    """Less inertia, as the run without the tool has it; of the force the size alone counts."""
    acts = (TURN > CUT[0]) & (TURN < CUT[1])
    np.testing.assert_allclose(extra(motion, TOOL), 400.0 * acts * np.abs(slope(TURN)), atol=1e-11)
    turned = TOOL.model_copy(update={"force": (-240.0, 320.0)})
    np.testing.assert_allclose(extra(motion, turned), extra(motion, TOOL), atol=1e-11)


@pytest.mark.parametrize("motion", ["static", "driven"])
def test_a_tool_that_cuts_both_ways_turns_with_the_ram_and_says_nothing_where_that_turns(motion: Motion) -> None:
    both = Load(body="ram", force=(400.0, 0.0), opposes=True)
    np.testing.assert_allclose(extra(motion, both), 400.0 * np.abs(slope(TURN)), atol=1e-11)
    dead = math.asin(-RADIUS / BELOW)  # where the crank is square to the lever, the ram stands
    result = lc.analyse(shaper(both), motion=motion, angles=np.array([0.5, math.pi - dead, 4.0]))
    assert result.flags == {"1": "what the load on ram opposes stands or turns back here, and it has no direction"}


@pytest.mark.parametrize("seam", [200.0, 270.0, 300.0])
def test_cuts_that_follow_one_another_act_one_at_a_time_and_their_peak_is_that_of_one(seam: float) -> None:
    """Also where they meet, which is a sample, and where the first one's peak is: at the end of it, which it is not."""
    ends = (CUT[0], math.radians(seam), CUT[1]) if seam > 200.0 else (math.radians(180.0), *CUT)
    parts = [TOOL.model_copy(update={"start": a, "end": b}) for a, b in itertools.pairwise(ends)]
    light = [parts[0].model_copy(update={"force": (100.0, 0.0)}), parts[1]]
    angles = np.radians(np.arange(0.0, 360.0, 10.0))
    torque = [
        lc.analyse(shaper(*loads), motion="static", angles=angles).extremes["drive_torque"] for loads in (parts, light)
    ]
    near = np.linspace(ends[1], ends[2], 20001)
    largest = 400.0 * float(np.abs(slope(near)).max())
    assert torque[1].highest == pytest.approx(largest, rel=2e-4)
    whole = np.abs(slope(np.linspace(ends[0], ends[2], 20001)))
    assert torque[0].highest == pytest.approx(400.0 * float(whole.max()), rel=2e-4)


def test_a_stroke_is_known_whatever_loads_and_clearance_leave_without_an_answer_where_it_ends() -> None:
    """What opposes has no direction there, and pins cross their bearings."""
    cut = Load(body="ram", force=(400.0, 0.0), opposes=True)
    alone = dict(strokes(lc.analyse(shaper(), angles=TURN)))
    travel = 2 * (ABOVE + BELOW) * math.tan(math.asin(RADIUS / BELOW))
    lean = math.degrees(math.asin(RADIUS / BELOW))
    angles = np.radians(
        np.append(np.arange(0.0, 360.0, 10.0), [180.0 + lean, 360.0 - lean])
    )  # where the ram turns back
    for m in (shaper(cut), shaper(cut).with_clearances({"A": 5e-5, "Q": 5e-5})):
        result = lc.analyse(m, angles=np.sort(angles), limits={"stroke_S": "353:354 mm"})
        assert result.flags
        assert {name: said.replace(" without clearance", "") for name, said in strokes(result)} == alone
        assert result.limits["stroke_S"].verdict == "holds"
    given = lc.analyse(shaper(cut), motion="static").extremes["drive_torque"].mean
    assert given == pytest.approx(2 * 400.0 * travel / (2 * np.pi), rel=2e-3)  # of both strokes
    still = lc.analyse(shaper(cut), angles=np.sort(angles))
    assert np.isfinite(still["position_S"]).all()  # without clearance, whatever acts
    assert np.isnan(still["drive_torque"]).sum() == len(still.flags) == 2


def test_loads_at_one_place_are_drawn_together_and_where_there_is_no_answer_too() -> None:
    back = TOOL.model_copy(update={"force": (40.0, 0.0), "start": CUT[1], "end": CUT[0]})
    m = shaper(TOOL, back).with_clearances({"A": 5e-5})
    result = lc.analyse(m, angles=np.radians(np.arange(0.0, 360.0, 10.0)))
    assert result.flags
    drawn = together([each for each in acting(result) if each.label == "force on ram"])
    degrees = np.degrees(result.crank_angle).round()
    np.testing.assert_allclose(drawn, np.where((degrees >= 200) & (degrees < 340), 400.0, 40.0))


def test_a_load_that_begins_at_330_rad_is_asked_about() -> None:
    with pytest.warns(UserWarning, match=r'^shaper: from of the load on ram is 330 rad; .* Write "330 deg"$'):
        shaper(TOOL.model_copy(update={"start": 330.0, "end": 210.0}))


def test_a_brake_takes_its_torque_times_the_turning_of_its_body() -> None:
    x, c = (ABOVE + BELOW) * RADIUS * np.cos(TURN) / (BELOW + RADIUS * np.sin(TURN)), ABOVE + BELOW
    turning = slope(TURN) * c / (c**2 + x**2)  # of the lever, whose tangent is x over that
    np.testing.assert_allclose(extra("driven", BRAKE), 20.0 * np.abs(turning), atol=1e-11)


def test_a_drive_the_other_way_turns_it_round() -> None:
    back = shaper(TOOL).replace(drive={"joint": "O", "speed": -2 * math.pi})
    for motion in ("static", "driven"):
        torque = lc.analyse(back, motion=motion, angles=TURN)["drive_torque"]
        free = lc.analyse(back.replace(loads=()), motion=motion, angles=TURN)["drive_torque"]
        np.testing.assert_allclose(torque - free, -extra("static", TOOL), atol=1e-11)


@pytest.mark.long_rows("mujoco-ideal-driven")
@pytest.mark.parametrize(
    ("name", "model", "motion"),
    slow_but([("mujoco", "ideal", "driven"), ("pybullet", "ideal", "static")], CALM),
)
def test_every_engine_that_has_such_loads_agrees(name: str, model: JointModel, motion: Motion) -> None:
    steady = Load(body="ram", force=(0.0, -900.0))
    agreed(name, shaper(TOOL, BRAKE, steady), model, motion, {"A": 5e-4}, TURN)


@pytest.mark.parametrize("name", slow_but(["mujoco"], ["mujoco", "exudyn", "pybullet", "dart"]))
def test_at_rest_it_acts_against_the_motion_of_the_linkage_with_its_gaps(name: str) -> None:
    """A coupler's point goes along no line; with 1 mm of clearance its way is 0.3 degrees off."""
    if missing(name):
        pytest.skip(missing(name))
    given = Load(body="coupler", force=(0.0, -200.0)), Load(body="coupler", force=(120.0, 0.0), opposes=True)
    m = load("crank-rocker").replace(loads=given)
    result = lc.crosscheck(
        m, simulator=name, joint_model="spring-damper", motion="static", clearance={"B": 1e-3}, angles=TURN[::4]
    )
    (run,) = result.runs
    assert run.verdict == "agrees"
    near = {d.signal: abs(d.max) for d in run.discrepancies}
    assert near["drive_torque"] < 1e-3
    assert near["reaction_B_angle"] < 1e-3


@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("mujoco", "contact"),
        *slow(("mujoco", "spring-damper"), ("exudyn", "contact"), ("exudyn", "massless-link")),
        *slow(("dart", "contact"), ("pybullet", "spring-damper")),
    ],
)
def test_a_rocker_that_a_brake_stops_while_its_pins_cross_takes_what_the_brake_takes(
    name: str, model: JointModel
) -> None:
    """A wiper's blade.  In a turn the motor gives what the brake takes over the rocker's two strokes, but for blows
    that no sample sees; six gaps of 0.05 mm on a radius of 60 mm, at its transmission angles, change a stroke by less
    than 10 mrad.
    """
    if missing(name):
        pytest.skip(missing(name))
    wiper, turn = loads(WIPER), np.radians([5.0, *np.arange(361.0, 721.0)])
    result = lc.simulate(wiper, name, joint_model=model, motion="driven", angles=turn)
    stroke = np.ptp(np.asarray(result["rocker_angle"])[1:])
    given = np.mean(np.asarray(result["drive_torque"])[1:]) * 2 * np.pi
    assert given == pytest.approx(2 * 3.0 * stroke, rel=0.05)
    rigid = np.ptp(lc.analyse(wiper.ideal().replace(loads=()), angles=turn)["rocker_angle"])
    assert stroke == pytest.approx(rigid, abs=0.01)


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_wiper_that_disagrees_says_where_its_pins_cross_and_agrees_at_rest() -> None:
    """Reactions turn round with the rocker, whose dead centres are where crank and coupler are in line."""
    wiper = loads(WIPER)
    asked = {"simulator": "mujoco", "joint_model": "spring-damper", "revolutions": 0}
    driven, still = (lc.crosscheck(wiper, motion=motion, **asked) for motion in ("driven", "static"))
    (run,) = driven.runs
    assert run.because is not None
    said = re.search(r"reactions do \(by ([\d.]+), ([\d.]+) deg\)", run.because.words)
    assert said is not None, run.because.words
    ends = [math.acos((r**2 + 0.31**2 - 0.06**2) / (2 * r * 0.31)) for r in (0.34, 0.26)]  # of crank and coupler
    dead = [math.degrees(ends[0]), math.degrees(math.pi + ends[1])]
    assert all(0 <= float(at) - end <= 5.001 for at, end in zip(said.groups(), dead, strict=True)), (said[0], dead)
    worst = max((d for d in run.discrepancies if d.verdict == "disagrees"), key=lambda d: d.share or 0.0)
    assert f"; the {quantities(wiper)[worst.signal].label} is off at " in run.because.words
    assert "--motion static" in run.because.words
    assert still.verdict == "agrees"


@pytest.mark.long_rows("dart-driven", "pybullet-driven", "mujoco-driven")
@pytest.mark.parametrize("motion", ["driven", "static"])
@pytest.mark.parametrize("name", ["mujoco", "pybullet", "dart"])
def test_it_acts_at_a_point_that_no_joint_is_at(name: str, motion: Motion) -> None:
    """The tip of an arm that turns: its force times the arm's length, all round."""
    if missing(name):
        pytest.skip(missing(name))
    m = Mechanism.model_validate(
        {
            "name": "arm",
            "ground": {"points": {"O": (0.0, 0.0)}},
            "bodies": ({"name": "bar", "points": {"O": (0.0, 0.0), "T": (0.3, 0.0)}, "mass": 1.0},),
            "joints": ({"name": "O", "type": "revolute", "bodies": ("ground", "bar")},),
            "drive": {"joint": "O", "speed": 2 * math.pi},
            "loads": ({"body": "bar", "point": "T", "force": (5.0, 0.0), "opposes": True},),
            "assembly": {"bar": 0.0},
        }
    )
    result = lc.crosscheck(
        m, simulator=name, joint_model="ideal", motion=motion, angles=np.radians(np.arange(0, 360, 30))
    )
    assert result.verdict == "agrees", result
    torque = result.runs[0].simulated["drive_torque"]
    np.testing.assert_allclose(torque, 1.5, atol=2e-3)


@pytest.mark.exudyn
def test_a_light_press_whose_tool_takes_all_that_its_motor_gives_makes_no_energy() -> None:
    """Where the slider turns back a few nJ are left over: a quarter of what its links hold, and nothing of the work."""
    m = load("slider-crank").replace(loads=(Load(body="slider", force=(1000.0, 0.0), opposes=True),))
    light = [body.model_copy(update={"mass": 1e-3, "inertia": 1e-6}) for body in m.bodies]
    drive = m.drives[0].model_copy(update={"speed": 5.0})
    m = m.replace(bodies=tuple(light), drives=(drive,), gravity=(0.0, 0.0))
    result = lc.crosscheck(m, simulator="exudyn", joint_model="ideal", angles=np.radians(np.arange(170.0, 191.0, 5.0)))
    assert result.verdict == "agrees", result


@pytest.mark.parametrize("force", [5.0, 200.0])
def test_where_it_turns_a_reaction_round_no_peak_is_made_of_the_pin_that_crosses(force: float) -> None:
    """No gap has derivatives there: taken from its places at either side they would make kilonewtons of it."""
    m = load("crank-rocker").replace(loads=(Load(body="follower", point="B", force=(force, 0.0), opposes=True),))
    assembly, still = Assembly(m), []
    for begin, end in itertools.pairwise(np.linspace(0.0, 2 * math.pi, 721)):  # where the follower turns back
        rates = kinematics(assembly, np.array([begin, end]), 1.0).angular_velocity("follower")
        still += [begin - rates[0] * (end - begin) / (rates[1] - rates[0])] if rates[0] * rates[1] < 0 else []
    assert len(still) == 2
    near = np.add.outer(still, np.radians([-0.5, -0.2, -0.1, -0.05, 0.05, 0.1, 0.2, 0.5])).ravel()
    found, ideal = (displaced(assembly, near, m.speed, clearances=c) for c in ({"A": 1e-4}, {}))
    said = ~np.isin(np.arange(near.size), list(found.flags))
    assert said.any()
    assert any("crosses its bearing" in why for why in found.flags.values())
    for joint, reaction in found.reactions.forces.items():
        np.testing.assert_allclose(np.abs(reaction)[said], np.abs(ideal.reactions.forces[joint])[said], rtol=0.3)


@pytest.mark.parametrize("motion", ["driven", "static"])
def test_a_torque_that_opposes_is_drawn_against_the_turning_and_changes_its_sign(motion: Motion) -> None:
    m = load("crank-rocker").replace(loads=(Load(body="follower", torque=3.0, opposes=True),))
    rate = lc.analyse(m).signals["follower_angular_velocity"]
    (load_,) = acting(lc.analyse(m, motion=motion))
    clear = np.abs(rate) > 0.1 * np.max(np.abs(rate))
    np.testing.assert_array_equal(load_.size[clear], -3.0 * np.sign(rate[clear]))
    assert set(np.sign(rate[clear])) == {-1.0, 1.0}


def test_pins_that_cross_their_bearings_at_the_same_angles_are_one_warning_also_in_a_sweep() -> None:
    m = load("crank-rocker").replace(loads=(Load(body="follower", torque=3.0, opposes=True),))
    m = m.with_clearances(dict.fromkeys("DABE", 1e-5))
    (text,) = (text for text in lc.analyse(m).warnings if "crosses its bearing" in text)
    assert re.match(r"the reactions at A, B, D, E turn by up to 180 deg at 35\.\d+, 236\.4 deg: there each pin", text)
    swept = lc.sweep(m, {"body.coupler.length": [0.12, 0.121, 0.122]}, workers=1)
    turned = [text for text in swept.warnings if "crosses its bearing" in text]
    assert turned == [f"{text} (and with 2 other sets of numbers)"]


def test_a_released_wheel_is_braked_to_rest_and_held() -> None:
    """Without weight its rate falls evenly, by torque over moment of inertia, and then it stays."""
    brake = Load(body="pendulum", torque=0.01, opposes=True)
    m = load("pendulum").replace(gravity=(0.0, 0.0), loads=(brake,))
    body = m.bodies[0]
    slowing = 0.01 / (body.moment_of_inertia + body.mass * abs(body.centre) ** 2)
    stop, time = 5.0 / slowing, np.linspace(0.0, 8.0 / slowing, 32)  # none at the stop
    motion = released(Assembly(m), time, 0.0, 5.0)
    run = np.minimum(time, stop)
    np.testing.assert_allclose(motion.reactions.motion.theta, 5.0 * run - slowing * run**2 / 2, atol=1e-7)
    np.testing.assert_allclose(motion.reactions.motion.angular_velocity("pendulum"), 5.0 - slowing * run, atol=1e-7)
    assert motion.held.tolist() == (time > stop).tolist()


@pytest.mark.parametrize("brake", ["load", "joint"])
def test_what_swings_against_dry_friction_is_looked_at_at_times_that_are_given(brake: str) -> None:
    """It was refused, as if it had several freedoms; let go with 5 rad/s it falls evenly to rest, as above."""
    m = load("pendulum").replace(gravity=(0.0, 0.0), initial={"velocity_O": 5.0})
    body = m.bodies[0]
    slowing = 0.01 / (body.moment_of_inertia + body.mass * abs(body.centre) ** 2)
    by_load = m.replace(loads=(Load(body="pendulum", torque=0.01, opposes=True),))
    braked = by_load if brake == "load" else m.with_joint("O", friction_torque=0.01)
    time = np.linspace(0.0, 8.0 / slowing, 32)
    found, run = lc.analyse(braked, times=time), np.minimum(time, 5.0 / slowing)
    turned = found["pendulum_angle"] - found["pendulum_angle"][0]
    np.testing.assert_allclose(turned, 5.0 * run - slowing * run**2 / 2, atol=1e-7)


def test_a_weight_that_a_brake_holds_leaves_it_what_it_needs() -> None:
    brake = Load(body="pendulum", torque=1.0, opposes=True)
    m = load("pendulum").replace(loads=(brake,))
    motion = released(Assembly(m), np.array([0.0, 0.5]))
    assert motion.held.all()
    weight = m.bodies[0].mass * 9.81
    np.testing.assert_allclose(motion.reactions.forces["O"], 1j * weight, atol=1e-9)
    np.testing.assert_allclose(motion.reactions.drive_torque, 0.0, atol=1e-9)


ENGINES = ["mujoco", *(pytest.param(name, marks=pytest.mark.slow) for name in ("exudyn", "pybullet", "dart"))]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_pendulum_on_a_brake_loses_at_every_half_swing_what_the_brake_takes(engine: str) -> None:
    """Between two turning points the weight's work is that of the brake: m g l (cos a' - cos a) = M (a + a'), by which
    small swings are 2 M / (m g l) smaller each time."""
    if missing(engine):
        pytest.skip(missing(engine))
    brake, first = 0.0035, 0.15
    m = load("pendulum").replace(
        assembly={"pendulum": first - np.pi / 2}, loads=(Load(body="pendulum", torque=brake, opposes=True),)
    )
    weight = m.bodies[0].mass * 9.81 * abs(m.bodies[0].centre)
    turns = [first]
    while len(turns) < 4:
        last = turns[-1]
        lost = partial(lambda last, a: weight * (np.cos(a) - np.cos(last)) - brake * (last + a), last)
        turns.append(brentq(lost, 0.0, last))
    np.testing.assert_allclose(np.diff(turns), -2 * brake / weight, rtol=4e-3)
    time = np.arange(0.0, 1.4, 0.004)
    for swung in (
        released(Assembly(m), time).reactions.motion.theta,
        np.asarray(lc.simulate(m, engine, times=time)["pendulum_angle"]),
    ):
        off = swung + np.pi / 2
        peaks = [k for k in range(1, time.size - 1) if abs(off[k]) >= max(abs(off[k - 1]), abs(off[k + 1]))]
        np.testing.assert_allclose(np.abs(off[peaks]), turns[1:], atol=1e-4)
        assert np.all(np.diff(np.sign(off[peaks])))


@pytest.mark.parametrize("engine", ENGINES)
def test_a_slider_that_a_force_stops_stays_in_every_engine(engine: str) -> None:
    """It falls against a force on its slider, is held, and creeps by less than the range in which the force fades."""
    if missing(engine):
        pytest.skip(missing(engine))
    m = load("slider-crank")
    m = m.replace(gravity=(0.0, -9.81), drive=None, loads=(Load(body="slider", force=(3.0, 0.0), opposes=True),))
    time = np.linspace(0.0, 0.4, 9)
    known, found = released(Assembly(m), time), lc.simulate(m, engine, times=time)
    assert known.held.tolist() == [False] * 4 + [True] * 5
    creep = np.where(known.held, 0.005 * (time - 0.15), 0.0)
    assert np.all(np.abs(found["crank_angle"] - known.reactions.motion.theta) < 3e-4 + creep)
    for joint in ("O", "A"):
        seen = found[f"reaction_{joint}_x"] + 1j * found[f"reaction_{joint}_y"]
        np.testing.assert_allclose(seen[~known.held], known.reactions.forces[joint][~known.held], atol=0.02)


def test_what_no_engine_brakes_is_refused_by_name() -> None:
    five = load("five-bar")
    drives = five.drives[0], five.drives[1].model_copy(update={"speed": "free"})
    free = five.replace(drives=drives, loads=(Load(body=five.bodies[0].name, torque=1.0, opposes=True),))
    with pytest.raises((AssemblyError, Unsupported), match="opposes of the load on"):
        lc.analyse(free, times=np.array([0.0, 0.1]))
    m = load("slider-crank")
    m = m.replace(gravity=(0.0, -9.81), drive=None, loads=(Load(body="slider", torque=1.0, opposes=True),))
    with pytest.raises(Unsupported, match=r"opposes of the load on 'slider' needs the body's inertia; give it inertia"):
        lc.simulate(m, "mujoco", times=np.array([0.0, 0.1]))


def test_a_file_keeps_it_and_a_table_that_would_drive_is_refused() -> None:
    m = shaper(TOOL)
    assert "opposes = true" in dumps(m)
    assert loads(dumps(m)) == m
    with pytest.raises(MechanismError, match="opposes the motion has factors of 0 or more in its table"):
        Load(body="ram", force=(1.0, 0.0), opposes=True, over="crank_angle", table=((0.0, 1.0), (1.0, -1.0)))


def recorded(folder: Path, m: Mechanism, theta: np.ndarray, noise: float = 0.0) -> Path:
    """A file of what MuJoCo makes of a linkage at crank angles, in the order of passing."""
    seen, random = lc.simulate(m, "mujoco", angles=theta), np.random.default_rng(1)
    columns = {"time [s]": (theta - theta[0]) / (m.speed or 1.0), "crank_angle [rad]": seen["crank_angle"]}
    columns |= {f"{b.name}_angle [rad]": seen[f"{b.name}_angle"] for b in m.bodies[1:]}
    columns |= {"drive_torque [N.m]": seen["drive_torque"]}
    rows = np.column_stack(list(columns.values()))
    rows[:, 1:] += noise * random.normal(size=rows[:, 1:].shape)
    path = folder / "seen.csv"
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    return path


@pytest.mark.mujoco
def test_another_programs_results_are_held_to_it(tmp_path: Path) -> None:
    path = recorded(tmp_path, shaper(TOOL, BRAKE), TURN)
    assert lc.check(path, mechanism=shaper(TOOL, BRAKE)).verdict == "agrees"
    weaker = BRAKE.model_copy(update={"torque": 19.0})
    assert lc.check(path, mechanism=shaper(TOOL, weaker)).verdict == "disagrees"


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_diagnosis_with_such_loads_in_the_nominal_linkage_finds_what_is_missing(tmp_path: Path) -> None:
    given = (
        Load(body="coupler", force=(0.0, -40.0)),
        Load(body="follower", torque=1.5, opposes=True),
        Load(body="coupler", force=(20.0, 0.0), over="crank_angle", table=((0.0, 0.0), (2.0, 1.0), (5.0, 0.2))),
    )
    drive = load("crank-rocker").drives[0].model_copy(update={"speed": 6.0})
    nominal = load("crank-rocker").replace(loads=given, drives=(drive,))
    recorded(tmp_path, nominal.with_joint("E", damping=0.02), np.linspace(0.0, 2 * math.pi, 300), noise=6e-5)
    (tmp_path / "nominal.toml").write_text(dumps(nominal), encoding="utf-8")
    (tmp_path / "measured.toml").write_text(
        'mechanism = "nominal.toml"\n[[run]]\nname = "slow"\nfile = "seen.csv"\ndrive_speed = 6.0\ndrive_angle = 0.0\n',
        encoding="utf-8",
    )
    result = lc.diagnose(tmp_path / "measured.toml", simulator="mujoco")
    assert result.verdict == "explained"
    (effect,) = result.effects
    assert effect.key == "viscous_friction@E"
    assert effect.parameters["damping"].value == pytest.approx(0.02, rel=0.02)


def test_what_a_crank_s_sensors_read_as_a_brake_turns_round_is_left_out() -> None:
    """A quick return's lever turns back where the crank is square to it, twice in a turn; two samples either side."""
    told = lc.analyse(shaper(BRAKE), angles="0:720:2")
    speed = 2 * math.pi
    read = {"time [s]": told.crank_angle / speed, "crank_angle [rad]": told.crank_angle}
    read |= {"reaction_S_y [N]": told.signals["reaction_S_y"], "drive_torque [N.m]": told.signals["drive_torque"]}
    given = lc.preview(lc.measured(shaper(BRAKE), {"slow": read}, speed=speed, drive_angle=0.0))
    (left,) = (fault for fault in given.faults if fault.kind == "rest")
    assert left.text.startswith("run 'slow' is without its reaction_S_y in the 16 samples"), left.text
    lost = np.degrees(told.crank_angle[~np.isfinite(given.runs[0].signals["reaction_S_y"].measured)]) % 360
    lean = math.degrees(math.asin(RADIUS / BELOW))
    turns = np.array([180.0 + lean, 360.0 - lean])
    assert np.abs(lost[:, None] - turns).min(axis=1).max() <= 4.0
