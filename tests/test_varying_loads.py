"""Loads over part of the motion: a cutting stroke, gas over a piston's travel; by virtual work, and in each engine."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas
import pytest

import linkage_crosscheck as lc
from analytic.mechanism import Load, Mechanism, MechanismError
from analytic.mechanism.file import dumps, load, loads
from compare.diagnose.data.measured import MeasuredError
from compare.diagnose.data.measured_file import read_file
from engine_checks import CALM, agreed
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
    between = Load(body="crank", torque=1.0, over="position_A", table=((-math.pi, 0.0), (0.0, 1.0)))
    apart = np.angle(np.exp(1j * (rod - TURN)))  # the rod's angle less the crank's
    share = np.where(apart < 0, 1.0 + apart / math.pi, 1.0 - apart / math.pi)
    np.testing.assert_allclose(extra("static", between), -share, atol=1e-12)
    always = Load(body="crank", torque=1.0, over="crank_angle", start=0.0, end=math.tau)
    np.testing.assert_allclose(extra("static", always), -1.0, atol=1e-12)


def test_a_stretch_of_a_length_is_the_same_from_either_end() -> None:
    for ends in ((0.1, 0.15), (0.15, 0.1)):
        load_ = Load(body="slider", force=(-100.0, 0.0), over="position_S", start=ends[0], end=ends[1])
        np.testing.assert_allclose(load_.share(np.array([0.09, 0.1, 0.12, 0.15, 0.16]), False), [0, 1, 1, 0, 0])


@pytest.mark.parametrize("angular", [True, False])
def test_where_one_stretch_ends_and_another_begins_one_of_them_acts(angular: bool) -> None:
    """Split anywhere, also beside where a turn ends and a rounding away from where they meet, they act as one; also
    where the end is told a turn later than the beginning of the next.
    """
    ends = np.radians([20.0, 90.0, 160.0, 345.0, 372.0]) + (0.0 if angular else 1.0)
    parts = [Load(body="ram", force=(1.0, 0.0), over="x", start=a, end=b) for a, b in pairwise(ends.tolist())]
    whole = Load(body="ram", force=(1.0, 0.0), over="x", start=float(ends[0]), end=float(ends[-1]))
    at = np.concatenate([ends[1:-1], np.nextafter(ends[1:-1], 0.0), np.nextafter(ends[1:-1], 9.0), ends[:-1] + 1e-3])
    np.testing.assert_array_equal(sum(part.share(at, angular) for part in parts), np.ones(at.size))
    np.testing.assert_array_equal(whole.share(at, angular), np.ones(at.size))
    for degrees in range(5, 360, 5) if angular else ():
        meet = math.radians(degrees)
        before = parts[0].model_copy(update={"start": meet - 1.0 + math.tau, "end": math.radians(degrees + 360)})
        after = parts[0].model_copy(update={"start": meet, "end": meet + 1.0})
        seam = np.array([meet, math.radians(degrees - 360), meet - 1e-6, meet + 1e-6])
        np.testing.assert_array_equal(before.share(seam, True) + after.share(seam, True), np.ones(4))


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


@pytest.mark.long_rows("mujoco-ideal-driven")
@pytest.mark.parametrize(
    ("name", "model", "motion"),
    slow_but([("mujoco", "ideal", "driven"), ("pybullet", "ideal", "static")], CALM),
)
def test_every_engine_that_has_such_loads_agrees(name: str, model: JointModel, motion: Motion) -> None:
    steady = Load(body="slider", force=(-300.0, 0.0))  # the pin never leaves its side, whatever varies beside
    knee = Load(body="rod", torque=5.0, over="position_A", table=((-3.0, 0.0), (0.0, 1.0), (3.0, -1.0)))
    run = agreed(name, press(PUSH, TOOL, steady, knee, speed=12.0), model, motion, {"B": 5e-4}, TURN)
    torque = run.simulated["drive_torque"]
    assert np.ptp(torque) > 10  # the loads are felt


@pytest.mark.mujoco
def test_a_sample_at_which_a_load_begins_is_not_compared_and_says_why() -> None:
    edges = np.radians([185.0, 200.0, 215.0, 355.0, 370.0, 385.0])  # the stroke is from 200 to 10 degrees
    result = lc.crosscheck(press(TOOL, speed=12.0), simulator="mujoco", joint_model="ideal", angles=edges)
    (run,) = result.runs
    assert run.flags == dict.fromkeys(("1", "4"), "the load on crank begins or ends here")
    assert run.verdict == "agrees"


def test_links_that_bend_say_which_they_would_leave_out() -> None:
    bends = press(PUSH).with_body("rod", youngs_modulus=2e11, shear_modulus=8e10, section=(0.01, 0.01))
    with pytest.raises(Unsupported, match=r"no loads that vary .* over = 'position_S' of the load on 'slid"):
        lc.crosscheck(bends, simulator="exudyn", joint_model="ideal", motion="static", flexible=True, angles=TURN)


def test_a_motion_that_leaves_the_table_of_a_load_is_told() -> None:
    """The slider of the slider-crank goes from l - r = 0.07 m to l + r = 0.17 m, of which the samples miss the ends."""
    x, _ = travel(TURN)
    span = f"slider_x from 70 to 120 mm, and that goes from {1e3 * x.min():.4g} to {1e3 * x.max():.4g} mm"
    for last, told in ((0.17, False), (0.12, True)):
        gas = Load(body="slider", force=(-100.0, 0.0), over="slider_x", table=((0.07, 0.0), (last, 1.0)))
        said = " ".join(lc.analyse(press(gas), angles=TURN).warnings)
        assert (span in said) is told
        assert ("beyond its table" in said) is told


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


PRESSURE, AREA, HEAD, POLYTROPE = 2e5, 1e-3, 0.18, 1.3  # Pa and m2; m, where the piston would touch the head


def gas(x: np.ndarray) -> np.ndarray:
    """Force (N) of a compressor's gas on its piston at x (m): p V^n stays, from 2 bar at the lower dead centre."""
    return -PRESSURE * AREA * ((HEAD - (ROD - CRANK)) / (HEAD - x)) ** POLYTROPE


def compressor(folder: Path, rows: list[str], separator: str = ",") -> Path:
    """A file of the slider-crank, loaded as a table beside it says."""
    (folder / "gas.csv").write_text("\n".join(separator.join(row.split()) for row in rows) + "\n", encoding="utf-8")
    text = dumps(press()) + '\n[[load]]\nbody = "slider"\nover = "position_S"\ntable = "gas.csv"\n'
    (folder / "compressor.toml").write_text(text, encoding="utf-8")
    return folder / "compressor.toml"


def test_a_compressors_gas_in_a_file_asks_for_its_virtual_work(tmp_path: Path) -> None:
    at = np.linspace(0.065, 0.175, 1001)
    rows = [
        "force_x[kN] position_S[mm]",
        *(f"{f / 1e3!r} {x * 1e3!r}" for f, x in zip(gas(at).tolist(), at.tolist(), strict=True)),
    ]
    torque = lc.analyse(load(compressor(tmp_path, rows)), motion="static", angles=TURN)["drive_torque"]
    x, slope = travel(TURN)
    bent = (
        POLYTROPE * (POLYTROPE + 1) * np.abs(gas(x)) / (HEAD - x) ** 2 * (at[1] - at[0]) ** 2 / 8
    )  # off straight lines
    assert np.all(np.abs(torque + gas(x) * slope) <= 1.05 * bent * np.abs(slope) + 1e-10)
    assert np.abs(torque).max() > 5


def test_a_table_in_a_file_is_the_table_with_its_numbers(tmp_path: Path) -> None:
    rows = [
        "position_S_[mm] force_x_[N] force_y_(kN) torque_[N.mm]",
        "70 -900 0,1 500",
        "120 -1,5e2 0,2 -20",
        "170 -1e2 0 7",
    ]
    read = load(compressor(tmp_path, [row.replace("_[", "[").replace("_(", "(") for row in rows], ";"))
    at = (0.07, 0.12, 0.17)
    columns = {"force": [((1.0, 0.0), (-900.0, -150.0, -100.0)), ((0.0, 1.0), (100.0, 200.0, 0.0))]}
    columns["torque"] = [(1.0, (0.5, -0.02, 0.007))]
    over = {"body": "slider", "over": "position_S"}
    inline = [
        Load.model_validate(over | {field: unit, "table": tuple(zip(at, sizes, strict=True))})
        for field, each in columns.items()
        for unit, sizes in each
    ]
    for found, wanted in zip(read.loads, inline, strict=True):
        assert found.model_copy(update={"table": ()}) == wanted.model_copy(update={"table": ()})
        np.testing.assert_allclose(found.table, wanted.table, rtol=1e-15)
    assert loads(dumps(read)) == read  # a mechanism takes its table with it


def test_a_table_in_python_has_its_units_or_is_a_frame() -> None:
    at, sizes = [0.0, 90.0, 270.0], [500.0, -20.0, 7.0]
    known = Load(
        body="crank", torque=1.0, over="crank_angle", table=np.transpose([np.radians(at), np.divide(sizes, 1e3)])
    )
    frame = pandas.DataFrame({"crank_angle [deg]": at, "torque [N.mm]": sizes})
    ours = pandas.DataFrame({"crank_angle": np.radians(at), "torque": np.divide(sizes, 1e3)})
    ours.attrs["units"] = {"crank_angle": "rad", "torque": "N.m"}
    pairs = [(f"{angle} deg", size / 1e3) for angle, size in zip(at, sizes, strict=True)]
    given: list[dict[str, object]] = [{"table": table} for table in (frame, dict(frame), ours)]
    for each in [*given, {"torque": 1.0, "table": pairs}]:
        fields = {"body": "crank", "over": "crank_angle"} | each
        for found in (Load(**fields), load("slider-crank").replace(loads=[fields]).loads[0]):
            np.testing.assert_allclose(found.table, known.table, rtol=1e-12)
            assert (found.torque, found.force) == (1.0, (0.0, 0.0))
    both = {"position_S [mm]": [70, 90], "force_x [N]": [-900, -400], "torque [N.m]": [1, 2]}
    loaded = load("slider-crank").replace(loads=[{"body": "slider", "over": "position_S", "table": both}]).loads
    assert [each.table for each in loaded] == [((0.07, -900.0), (0.09, -400.0)), ((0.07, 1.0), (0.09, 2.0))]


@pytest.mark.parametrize(
    ("table", "why"),
    [
        ({"crank_angle": [0, 1], "torque [N.m]": [1, 2]}, "'crank_angle' has no unit; .*, in brackets behind its name"),
        ({"crank_angle [deg]": [0, 1], "torq [N.m]": [1, 2]}, r"table: column 'torq \[N.m\]' .*did you mean 'torque'"),
        ({"crank_angle [deg]": [1, 1], "torque [N.m]": [1, 2]}, "table: row 1: crank_angle does not increase"),
        ({"crank_angle [deg]": [1, 2], "torque [N.m]": [1, "b"]}, "table: its columns are no numbers"),
        ({"crank_angle [deg]": [1, 2], "torque [N.m]": [1, math.nan]}, "a finite number in every cell"),
        (
            {"crank_angle [deg]": [1, 2], "torque [N.m]": [1, 2], "force_x [N]": [1, 2]},
            "table has columns for 2 loads; give one, or the load as a dict in loads=",
        ),
        ("gas.csv", "table = 'gas.csv' is a file, .*; give its pairs, or a frame"),
        ([("0 deg", "2 N.m"), ("1 deg", 2)], "table.0..1. = '2 N.m': input should be a valid number"),
    ],
)
def test_a_table_in_python_that_cannot_be_is_refused(table: object, why: str) -> None:
    with pytest.raises(MechanismError, match=why):
        Load(body="crank", over="crank_angle", table=table)
    with pytest.raises(MechanismError, match="what position_S is measured in is not known here; give numbers in SI"):
        Load(body="slider", force=(1, 0), over="position_S", table=[("70 mm", 1), ("90 mm", 2)])


def test_a_table_over_the_crank_may_end_where_it_began(tmp_path: Path) -> None:
    path = compressor(tmp_path, ["crank_angle[deg] torque[N.m]", "0 1", "180 3", "360 1"])
    path.write_text(path.read_text(encoding="utf-8").replace("position_S", "crank_angle"), encoding="utf-8")
    (turned,) = load(path).loads
    np.testing.assert_allclose(turned.share(np.radians([0.0, 90.0, 270.0, 450.0]), True), [1.0, 2.0, 2.0, 2.0])


BAD_TABLES = {
    "position_S[mm] force_x[N]": "has 0 rows of numbers below its headings; give two at least",
    "position_S[mm] force_z[N]|70 1|80 2": r"'force_z\[N\]' is none of a load's over position_S; did you mean 'force_",
    "position_S[mm] force_x|70 1|80 2": "column 'force_x' has no unit; a force is given in N",
    "position_S[deg] force_x[N]|70 1|80 2": "'deg', which is of another dimension; a length is given in m",
    "force_y[N] force_x[N]|70 1|80 2": "give position_S once, and force_x, force_y or torque",
    "position_S[mm] force_x[N]|70 1|60 2": "line 3: position_S does not increase",
    "position_S[mm] force_x[N]|70 1|80": "line 3 has 1 cells, and 2 columns have headings",
    "position_S[mm] force_x[N]|70 1|80 nan": "line 3: 'nan' is not a finite number",
}


@pytest.mark.parametrize("rows", BAD_TABLES)
def test_what_is_wrong_in_a_table_is_named_with_its_line(tmp_path: Path, rows: str) -> None:
    with pytest.raises(MechanismError, match=f"compressor.toml: gas.csv.* {BAD_TABLES[rows]}"):
        load(compressor(tmp_path, rows.split("|")))


def test_a_run_of_measured_data_has_such_loads_too(tmp_path: Path) -> None:
    (tmp_path / "gas.csv").write_text("position_S[mm],force_x[N]\n70,-900\n80,-200\n", encoding="utf-8")
    (tmp_path / "measured.toml").write_text(
        'mechanism = "slider-crank"\n[[run]]\nname = "a"\nfile = "a.csv"\n'
        '[[run.load]]\nbody = "slider"\nover = "position_S"\ntable = "gas.csv"\n'
        '[[run.load]]\nbody = "crank"\ntorque = "2 kN.mm"\nover = "crank_angle"\nfrom = "200 deg"\nto = "10 deg"\n',
        encoding="utf-8",
    )
    (run,) = read_file(tmp_path / "measured.toml").runs
    gas_, stroke = run.loads or ()
    np.testing.assert_allclose(gas_.table, [[0.07, -900.0], [0.08, -200.0]], rtol=1e-15)
    assert (stroke.start, stroke.end, stroke.torque) == (*map(pytest.approx, STROKE), 2.0)
    (tmp_path / "gas.csv").unlink()
    with pytest.raises(MeasuredError, match=r"measured.toml: .*gas.csv cannot be read"):
        read_file(tmp_path / "measured.toml")


def test_a_table_in_a_file_needs_a_file_and_says_all(tmp_path: Path) -> None:
    path = compressor(tmp_path, ["position_S[mm] force_x[N]", "70 1", "80 2"])
    text = path.read_text(encoding="utf-8")
    with pytest.raises(MechanismError, match="is a file, which mechanisms that are no files themselves have not"):
        loads(text)
    (tmp_path / "both.csv").write_text("position_S [mm],force_x [N],force_y [N]\n70,1,1\n80,2,2\n", encoding="utf-8")
    path.write_text(text.replace('"gas.csv"', '"both.csv"\nopposes = true'), encoding="utf-8")
    with pytest.raises(MechanismError, match="of a load that opposes the size counts; keep one column"):
        load(path)
    for field, said in {'"position_B"': "'position_B'", '"position_S"\nforce = [1.0, 0.0]': "leave out force"}.items():
        path.write_text(text.replace('"position_S"', field), encoding="utf-8")
        with pytest.raises(MechanismError, match=said):
            load(path)
    (tmp_path / "gas.csv").unlink()
    path.write_text(text, encoding="utf-8")
    with pytest.raises(MechanismError, match=r"gas.csv cannot be read: there is no such file; give a CSV file with"):
        load(path)


FAULTS = {
    'over = "position_S"': "from and to, or a table",
    "from = 1.0\nto = 2.0": "has over and either",
    'over = "position_S"\nfrom = 1.0': "give both from and to",
    'over = "position_X"\nfrom = 1.0\nto = 2.0': "nothing that a load of this linkage varies over; they are",
    'over = "crank_angle"\nfrom = "40 deg"\nto = "40 deg"': "which is nowhere; give it a stretch",
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
    with pytest.raises(MechanismError, match=FAULTS[fields]) as error:
        loads(text)
    assert "{" not in str(error.value)  # what a table says, in its own words
