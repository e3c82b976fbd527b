"""Loads over part of the motion: a cutting stroke, gas over a piston's travel; by virtual work, and in each engine."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism import Load, Mechanism, MechanismError
from analytic.mechanism.file import dumps, load, loads
from engine_checks import declared_runs
from engines_here import missing
from marks import slow_but
from sim_models.common.units import Units
from sim_models.engine import JointModel, Motion, Unsupported

CRANK, ROD = 0.05, 0.12
GAS = ((0.07, 900.0), (0.09, 400.0), (0.13, 150.0), (0.17, 100.0))  # m, N: an expansion that never ends
STROKE = math.radians(200.0), math.radians(10.0)  # over the end of the turn
TURN = np.radians(np.arange(2.5, 360.0, 15.0))  # no sample at an end of the stroke
PUSH = Load(body="slider", force=(-1.0, 0.0), over="position_S", table=tuple((x, size) for x, size in GAS))
TOOL = Load(body="crank", torque=2.0, over="crank_angle", start=STROKE[0], end=STROKE[1])


def press(*given: Load, speed: float = 3.0) -> Mechanism:
    """The slider-crank, turning slowly, with these loads."""
    drive = load("slider-crank").drives[0].model_copy(update={"speed": speed})
    return load("slider-crank").replace(drives=(drive,), loads=given)


def travel(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the slider is (N,) m, and how that changes with the crank (m/rad), written out."""
    beside = np.sqrt(ROD**2 - (CRANK * np.sin(theta)) ** 2)
    return CRANK * np.cos(theta) + beside, -CRANK * np.sin(theta) * (1 + CRANK * np.cos(theta) / beside)


def extra(motion: Motion, *given: Load) -> np.ndarray:
    """The drive's torque (N,) that loads ask for."""
    with_them, without = (lc.analyse(press(*each), motion=motion, angles=TURN) for each in (given, ()))
    return np.asarray(with_them["drive_torque"] - without["drive_torque"])


@pytest.mark.parametrize("motion", ["static", "driven"])
def test_gas_over_the_pistons_travel_asks_for_its_virtual_work(motion: Motion) -> None:
    x, slope = travel(TURN)
    force = -np.interp(x, *zip(*GAS, strict=True))
    np.testing.assert_allclose(extra(motion, PUSH), -force * slope, atol=1e-12 * 900)


@pytest.mark.parametrize("motion", ["static", "driven"])
def test_a_stroke_acts_between_its_ends_through_the_end_of_the_turn(motion: Motion) -> None:
    degrees = np.degrees(TURN)
    acts = (degrees >= 200.0) | (degrees <= 10.0)
    assert 0 < acts.sum() < acts.size
    np.testing.assert_allclose(extra(motion, TOOL), -2.0 * acts, atol=1e-11)


def test_a_place_or_an_angle_of_a_body_will_do_as_well() -> None:
    x, slope = travel(TURN)
    by_place = Load(body="slider", force=(-100.0, 0.0), over="slider_x", start=0.1, end=0.15)
    inside = (x >= 0.1) & (x <= 0.15)
    np.testing.assert_allclose(extra("static", by_place), 100.0 * inside * slope, atol=1e-12 * 100)
    turned = Load(body="crank", torque=1.0, over="rod_angle", table=((-0.5, 0.0), (0.5, 1.0)))
    rod = np.arcsin(-CRANK * np.sin(TURN) / ROD)
    np.testing.assert_allclose(extra("static", turned), -(rod + 0.5), atol=1e-12)
    always = Load(body="crank", torque=1.0, over="crank_angle", start=0.0, end=math.tau)
    np.testing.assert_allclose(extra("static", always), -1.0, atol=1e-12)


def test_a_stretch_of_a_length_is_the_same_from_either_end() -> None:
    for ends in ((0.1, 0.15), (0.15, 0.1)):
        load_ = Load(body="slider", force=(-100.0, 0.0), over="position_S", start=ends[0], end=ends[1])
        np.testing.assert_allclose(load_.share(np.array([0.09, 0.1, 0.12, 0.15, 0.16]), False), [0, 1, 1, 1, 0])


def test_a_table_over_the_crank_goes_on_from_turn_to_turn() -> None:
    turned = Load(body="crank", torque=3.0, over="crank_angle", table=((1.0, 1.0), (5.0, 0.0)))
    gap = math.tau - 4.0
    angle = np.array([1.0, 3.0, 5.0, 5.0 + gap / 2, 1.0 + math.tau, 3.0 - math.tau])
    np.testing.assert_allclose(turned.share(angle, True), [1.0, 0.5, 0.0, 0.5, 1.0, 0.5])


def test_clearance_is_taken_up_where_the_load_presses() -> None:
    """With the gas alone the pin of the slider lies on the side that the rod pushes from."""
    loose = press(PUSH).with_clearances({"B": 1e-4})
    result = lc.analyse(loose, motion="static", angles=TURN)
    gap = np.hypot(result["clearance_B_x"], result["clearance_B_y"])
    known = np.isfinite(gap)
    assert known.mean() > 0.8
    np.testing.assert_allclose(gap[known], 1e-4, rtol=1e-9)
    force = np.arctan2(result["reaction_B_y"], result["reaction_B_x"])[known]
    lies = np.arctan2(result["clearance_B_y"], result["clearance_B_x"])[known]
    np.testing.assert_allclose(np.angle(np.exp(1j * (force - lies))), 0.0, atol=1e-6)


RUNS = [
    (name, model, motion)
    for motion in ("driven", "static")
    for name, model in declared_runs(motion)
    if name != "exudyn" and (motion == "static" or model == "ideal")
]


@pytest.mark.parametrize(
    ("name", "model", "motion"), slow_but([("mujoco", "ideal", "driven"), ("pybullet", "ideal", "static")], RUNS)
)
def test_every_engine_that_has_such_loads_agrees(name: str, model: JointModel, motion: Motion) -> None:
    if missing(name):
        pytest.skip(missing(name))
    clearance = {} if model == "ideal" else {"B": 1e-4}
    steady = Load(body="slider", force=(-300.0, 0.0))  # the pin never leaves its side, whatever varies beside
    result = lc.crosscheck(
        press(PUSH, TOOL, steady, speed=12.0),
        simulator=name,
        joint_model=model,
        motion=motion,
        clearance=clearance,
        angles=TURN,
    )
    (run,) = result.runs
    assert run.verdict == "agrees", [(d.signal, d.max, d.tolerance) for d in run.discrepancies if d.verdict != "agrees"]
    torque = run.simulated["drive_torque"]
    assert np.ptp(torque) > 10  # the loads are felt


@pytest.mark.mujoco
def test_a_sample_at_which_a_load_begins_is_not_compared_and_says_why() -> None:
    edges = np.radians([185.0, 200.0, 215.0, 355.0, 370.0, 385.0])  # the stroke is from 200 to 10 degrees
    result = lc.crosscheck(press(TOOL, speed=12.0), simulator="mujoco", joint_model="ideal", angles=edges)
    (run,) = result.runs
    assert run.flags == dict.fromkeys(("1", "4"), "the load on crank begins or ends here")
    assert run.verdict == "agrees"


def test_an_engine_without_such_loads_says_which_it_would_leave_out() -> None:
    with pytest.raises(Unsupported, match=r"exudyn has no loads that vary .* over = 'position_S' of the load on 'slid"):
        lc.simulate(press(PUSH), "exudyn")


def test_an_export_says_so_too(tmp_path: Path) -> None:
    with pytest.raises(Unsupported, match=r"mujoco has no loads that vary over the motion in its exports"):
        lc.export(press(PUSH), "mujoco", folder=tmp_path / "out")


def test_a_file_keeps_its_loads() -> None:
    m = press(PUSH, TOOL)
    text = dumps(m)
    assert 'over = "position_S"' in text
    assert "from = " in text
    assert loads(text) == m


def test_units_of_length_change_what_a_length_is_and_no_angle() -> None:
    scaled = Units(length=0.5, mass=2.0, time=0.25).mechanism(press(PUSH, TOOL))
    push, tool = scaled.loads
    assert [x for x, _ in push.table] == [2 * x for x, _ in GAS]
    assert [y for _, y in push.table] == [y for _, y in GAS]
    assert (tool.start, tool.end) == STROKE


FAULTS = {
    'over = "position_S"': "from and to, or a table",
    "from = 1.0\nto = 2.0": "has over and either",
    'over = "position_S"\nfrom = 1.0': "give both from and to",
    'over = "position_B"\nfrom = 1.0\nto = 2.0': "nothing that a load of this linkage varies over; they are",
    'over = "crank_angle"\ntable = [[1.0, 0.0]]': "two pairs of value and factor at least",
    'over = "crank_angle"\ntable = [[1.0, 0.0], [1.0, 1.0]]': "in increasing order",
    'over = "crank_angle"\ntable = [["90 deg", 0.0], ["500 deg", 1.0]]': "longer than a turn of crank_angle",
    'over = "crank_angel"\nfrom = "20 deg"\nto = "30 deg"': "nothing that a load of this linkage varies over; they are",
    'from = "20 deg"\nto = "30 deg"': "has over and either",
    'over = "crank_angle"\nfrom = 0.0\nto = 1.0\ntable = [[0.0, 1.0], [1.0, 1.0]]': "either from and to, or a table",
}


@pytest.mark.parametrize("fields", FAULTS)
def test_what_does_not_fit_is_named_with_what_would(fields: str) -> None:
    text = dumps(load("slider-crank")) + f'\n[[load]]\nbody = "slider"\nforce = [-1.0, 0.0]\n{fields}\n'
    with pytest.raises(MechanismError, match=FAULTS[fields]):
        loads(text)
