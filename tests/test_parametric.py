"""Sweeps over fields of a mechanism: the field that is meant, each point's numbers, and points without an answer."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import commands
import linkage_crosscheck as lc
from analytic.mechanism import Mechanism
from analytic.mechanism.dotted import FieldError, find, with_values
from analytic.mechanism.file import dumps, load, shipped_cases
from compare.faults import ArgumentError
from compare.parametric import values_of
from compare.report.sweep import panels, table
from compare.results.sweep import Sweep

RPM = math.pi / 30
ROCKER = load("crank-rocker")
PAPER = load("paper")


def column(result: Sweep, name: str) -> np.ndarray:
    """A column of the rows (N,), NaN where there is no number."""
    return np.array([row[name] for row in result.rows()], float)


# ---------------------------------------------------------------- which field


@pytest.mark.parametrize(
    ("case", "name", "unit", "value"),
    [
        ("paper", "drive.speed", "rad/s", lambda m: m.speed),
        ("paper", "drive.D.speed", "rad/s", lambda m: m.speed),
        ("paper", "joint.B.clearance", "m", lambda m: m.joint("B").clearance),
        ("paper", "joint.B.elasticity.translation", "N/m", lambda m: m.joint("B").elasticity.translation),
        ("paper", "body.crank.mass", "kg", lambda m: m.moving["crank"].mass),
        ("paper", "body.crank.section.depth", "m", lambda m: m.moving["crank"].section[1]),
        ("paper", "body.crank.points.A.x", "m", lambda m: m.moving["crank"].points["A"][0]),
        ("paper", "body.crank.length", "m", lambda m: m.moving["crank"].length),
        ("paper", "ground.points.E.x", "m", lambda m: m.ground.points["E"][0]),
        ("paper", "load.force.y", "N", lambda m: m.loads[0].force[1]),
        ("paper", "load.coupler.force.y", "N", lambda m: m.loads[0].force[1]),
        ("paper", "gravity.y", "m/s^2", lambda m: m.gravity[1]),
        ("paper", "drive.ripple.phase", "", None),
        ("five-bar", "drive.E.speed", "rad/s", lambda m: m.drives[1].speed),
        ("slider-crank", "joint.B.friction", "", lambda m: m.joint("B").friction),
    ],
)
def test_a_dotted_name_is_the_field_of_the_file_in_its_unit(case: str, name: str, unit: str, value: Any) -> None:
    mechanism = load(case)
    field = find(mechanism, name)
    if value is None:  # a table that is not there yet: what it needs besides is missing, and said
        with pytest.raises(lc.Error, match=r"drive\.ripple\.amplitude is missing"):
            with_values(mechanism, {field: 0.1})
        return
    assert field.unit == unit
    assert value(with_values(mechanism, {field: 0.03125})) == pytest.approx(0.03125, rel=1e-15)


def test_every_number_of_every_shipped_case_has_a_name_that_finds_it() -> None:
    """Each number of a file, set to itself, leaves the mechanism as it is."""
    from analytic.mechanism.model import as_written

    def leaves(node: Any, path: tuple[Any, ...]) -> Any:
        inner = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
        for key, value in inner:
            yield from leaves(value, (*path, key))
        if isinstance(node, float):
            yield path, node

    axes = {"section": ("height", "depth"), "guide": ("length", "height")}
    count = 0
    for case in shipped_cases():
        mechanism = load(case)
        fields: Any = as_written(mechanism)
        for path, number in leaves(fields, ()):
            table, *steps = path
            if steps and isinstance(steps[0], int) and table != "gravity":
                part = fields[table][steps[0]]
                steps[0] = part.get("name") or (part["joint"] if table == "drive" else str(steps[0] + 1))
            if steps and isinstance(steps[-1], int):
                steps[-1] = axes.get(steps[-2] if len(steps) > 1 else "", ("x", "y"))[steps[-1]]
            field = find(mechanism, ".".join([table, *map(str, steps)]))
            assert field.place == path
            assert with_values(mechanism, {field: number}) == mechanism
            count += 1
    assert count > 300


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("drive.sped", "'sped' is no field of a drive; did you mean 'speed'"),
        ("jiont.B.clearance", "'jiont' is no field of a mechanism file; did you mean 'joint'"),
        ("clearance", "'clearance' is no field of a mechanism file; give it as joint.NAME.clearance"),
        ("speed", "'speed' is no field of a mechanism file; give it as drive.speed"),
        ("joint.B.clearence", "did you mean 'clearance'"),
        ("joint.Q.clearance", "'Q' is no name of a joint; they are D, A, B, E"),
        ("body.crnak.mass", "did you mean 'crank'"),
        ("body.crank.com.x", "body.crank.com is left out; give it in the file first"),
        ("spring.stiffness", "paper has no spring"),
        ("gravity", "they are x, y"),
        ("name", "name: a name is no number; name a field that is one, such as drive.speed"),
        ("joint.B.name", "joint.B.name: a name is no number"),
        ("load.table", "a table of a load stays as the file has it; name its force or torque"),
        ("load.coupler.table.1", "a table of a load stays as the file has it"),
        ("body.crank.mass.x", "body.crank.mass has nothing inside, such as 'x'"),
    ],
)
def test_what_is_no_field_is_refused_in_a_sentence_with_the_nearest(name: str, said: str) -> None:
    with pytest.raises(FieldError, match=re.escape(said)):
        find(PAPER, name)
    with pytest.raises(ArgumentError, match=re.escape(said)):
        lc.sweep(PAPER, {name: [1.0]})


@pytest.mark.slow
def test_a_field_that_is_true_or_false_may_be_both() -> None:
    assert not PAPER.loads[0].opposes
    for word in ("true", "false"):
        assert with_values(PAPER, {find(PAPER, "load.opposes"): word}).loads[0].opposes is (word == "true")
    answer = lc.sweep(PAPER, {"load.opposes": "false,true"}, angles=np.radians([60.0]))
    assert not any(point.failure for point in answer.points)


def test_a_slip_in_a_notebook_is_told_with_what_was_meant() -> None:
    with pytest.raises(TypeError, match=r"sweep\(\) has no argument 'motoin'; did you mean 'motion'"):
        lc.sweep(PAPER, {"drive.speed": [1.0]}, motoin="static")
    with pytest.raises(KeyError, match="did you mean reaction_B_"):
        lc.analyse(PAPER, angles=[1.0])["reaction_B"]
    frame = lc.analyse(PAPER, angles=[1.0, 2.0]).to_dataframe()
    with pytest.raises(
        ArgumentError, match=r"measured: a DataFrame cannot be used; .* what lc\.measured makes of data"
    ):
        lc.diagnose(frame)


def test_a_longer_crank_has_twice_its_length_as_stroke() -> None:
    """In-line slider-crank: stroke = 2 r, whatever the rod (any textbook)."""
    mechanism = load("slider-crank")
    (slide,) = [joint.name for joint in mechanism.joints if joint.prismatic]
    for r in (0.03, 0.07):
        changed = with_values(mechanism, {find(mechanism, "body.crank.length"): r})
        travel = lc.analyse(changed, motion="static").extremes[f"position_{slide}"]
        assert travel.highest is not None
        assert travel.lowest is not None
        assert travel.highest - travel.lowest == pytest.approx(2 * r, rel=1e-6)


# ---------------------------------------------------------------- which values


def test_values_are_ranges_with_their_stop_lists_and_words_with_units() -> None:
    speed, gap, law = (find(PAPER, name) for name in ("drive.speed", "joint.B.clearance", "joint.B.contact_law"))
    ranged = values_of(speed, "30 rpm:300 rpm:30 rpm")
    assert ranged.written == tuple(30.0 * k for k in range(1, 11))
    assert ranged.head == "drive.speed (rpm)"
    np.testing.assert_allclose(np.array(ranged.values, float), RPM * np.arange(30, 301, 30), rtol=1e-14)
    assert values_of(gap, "0:0.3:0.1mm").written == (0.0, 0.1, 0.2, 0.3)
    assert values_of(gap, "0,0.1mm,0.2,0.3").written == (0.0, 0.1, 0.2, 0.3)
    mixed = values_of(gap, ["0.1 mm", 2e-4, "300 um"])
    assert (mixed.written_unit, mixed.written) == ("m", (pytest.approx(1e-4), 2e-4, pytest.approx(3e-4)))
    assert values_of(gap, np.array([1e-4, 2e-4])).values == (1e-4, 2e-4)
    assert values_of(law, "kelvin-voigt,hunt-crossley").values == ("kelvin-voigt", "hunt-crossley")
    assert values_of(speed, "free").values == ("free",)


def test_a_sweep_has_what_is_asked_for_and_where_each_peak_is() -> None:
    """Power is torque times speed: its peak is where the torque's is."""
    swept = lc.sweep("crank-rocker", {"drive.speed": [10.0, 20.0]}, signals="drive_power", workers=1)
    for point, speed in zip(swept.points, (10.0, 20.0), strict=True):
        found = point.numbers
        assert found["drive_power"] == pytest.approx(speed * (found["drive_torque"] or 0.0), rel=1e-9)
        assert found["drive_power_at"] == pytest.approx(found["drive_torque_at"], abs=1e-6)
        m = load("crank-rocker")
        row = lc.analyse(with_values(m, {find(m, "drive.speed"): speed})).extremes["drive_torque"]
        assert any(found["drive_torque_at"] == pytest.approx(at, abs=1e-9) for at in (row.highest_at, row.lowest_at))
    heads, _ = table(swept)
    assert heads[1] == "drive power (W)"


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ("30 rpm:300 rad/s:30 rpm", "several units; give one to all three"),
        ("30 rpm:300 rpm", "is no range; give start:stop:step"),
        ("3:1:1", "goes nowhere"),
        ("0:1:0", "goes nowhere"),
        ("0:1e9:1", "more than 100000 values"),
        ("1 kg", "unit 'kg', which is of another dimension"),
        ("1,1", "there twice"),
        ("nan", "give finite numbers"),
        ("", "is no number"),
        ([], "give finite numbers"),
        ([True], "cannot be used"),
        ({"a": 1}, "cannot be used"),
    ],
)
def test_values_that_cannot_be_used_are_refused_in_a_sentence(values: Any, said: str) -> None:
    with pytest.raises(ArgumentError, match=said) as fault:
        lc.sweep(PAPER, {"drive.speed": values})
    assert "\n" not in str(fault.value)


def test_what_no_point_could_use_is_refused_before_any_is_computed() -> None:
    with pytest.raises(ArgumentError, match="motion: 'flying' cannot be used"):
        lc.sweep(PAPER, {"drive.speed": [1.0]}, motion="flying")
    with pytest.raises(TypeError, match="simulator"):
        lc.sweep(PAPER, {"drive.speed": [1.0]}, simulator="mujoco")
    with pytest.raises(ArgumentError, match=r"fields: \{\} cannot be used; give values by field"):
        lc.sweep(PAPER, {})
    with pytest.raises(ArgumentError, match="asks: 'diagnose' cannot be used"):
        lc.sweep(PAPER, {"drive.speed": [1.0]}, "diagnose")  # type: ignore[arg-type]


# ---------------------------------------------------------------- the numbers


def test_without_loads_torque_and_reactions_grow_with_the_square_of_the_speed() -> None:
    """Inertia forces alone: everything is proportional to the speed squared."""
    result = lc.sweep(ROCKER, {"drive.speed": "60 rpm,120 rpm,240 rpm"}, workers=1)
    for name in ("drive_torque", "reaction_A_magnitude", "reaction_B_magnitude"):
        values = column(result, name)
        np.testing.assert_allclose(values / values[0], [1.0, 4.0, 16.0], rtol=1e-9)


def test_the_worst_case_of_clearance_is_proportional_to_it() -> None:
    """Eq. 8 is linear in the gaps."""
    fields = {"joint.B.clearance": "0.1mm:0.3mm:0.1mm"}
    result = lc.sweep(PAPER, fields, "accuracy", samples=2, outputs="follower.angle", workers=1)
    values = column(result, "worst_follower_angle")
    np.testing.assert_allclose(values / values[0], [1.0, 2.0, 3.0], rtol=1e-9)


def test_a_platform_s_accuracy_is_swept_over_its_motion_or_workspace(tmp_path: Path) -> None:
    """Of drives and pins everything is linear in the gaps; the worst case of 0.2 mm is twice that of 0.1 mm."""
    words = ["accuracy", "--case", "five-bar", "--set", "joint.P.clearance=0.1mm,0.2mm", "--workers", "1"]
    for more in (["--times", "0:0.2:0.1"], ["--workspace", "-0.02:0.02:3,0.12:0.16:3", "--output", "left-arm.P"]):
        done = commands.compare(*words, *more, "--out", more[0].strip("-"), cwd=tmp_path)
        assert done.returncode in (0, 1), done.stderr
        result = Sweep.read(tmp_path / more[0].strip("-") / "sweep.json")
        assert result.asks == "platform_accuracy"
        worst = [name for name in result.columns if name.startswith("worst_") and column(result, name)[0] > 0]
        assert worst
        for name in worst:
            np.testing.assert_allclose(column(result, name), column(result, name)[0] * np.array([1.0, 2.0]), rtol=1e-9)


def test_a_grid_has_a_row_for_each_combination_as_each_is_analysed_by_itself() -> None:
    speeds, gaps = [2.0, 5.0], [1e-4, 3e-4]
    result = lc.sweep("paper", {"drive.speed": speeds, "joint.B.clearance": gaps}, workers=2, model="first_order")
    assert [(row["drive.speed"], row["joint.B.clearance"]) for row in result.rows()] == [
        (speed, gap) for speed in speeds for gap in gaps
    ]
    assert result.holds
    for row in result.rows():
        turning = PAPER.replace(drive=PAPER.drives[0].model_copy(update={"speed": row["drive.speed"]}))
        alone = lc.analyse(turning, clearance={"B": float(str(row["joint.B.clearance"]))}, model="first_order")
        for joint in "DABE":
            highest = alone.extremes[f"reaction_{joint}_magnitude"].highest
            assert row[f"reaction_{joint}_magnitude"] == pytest.approx(highest, rel=1e-12)
        error = np.nanmax(np.abs(alone.errors["follower_angle"].equilibrium))
        assert abs(float(str(row["error_follower_angle"]))) == pytest.approx(error, rel=1e-12)
    assert result.units()["reaction_B_magnitude"] == "N"
    again = Sweep.model_validate(json.loads(result.to_json()))
    assert again.rows() == result.rows()
    frame = result.to_dataframe()
    assert len(frame) == 4


def test_a_clearance_given_beside_is_the_mechanism_s_own() -> None:
    result = lc.sweep("paper", {"drive.speed": [1.0]}, clearance={"B": 1e-4, "A": 1e-4}, workers=1)
    assert result.mechanism.clearances == {"A": 1e-4, "B": 1e-4}
    alone = lc.analyse(with_values(result.mechanism, {find(PAPER, "drive.speed"): 1.0}))
    assert column(result, "error_follower_angle")[0] == pytest.approx(
        max(alone.errors["follower_angle"].equilibrium, key=abs), rel=1e-12
    )


def test_a_point_that_does_not_assemble_says_so_and_the_others_stand(tmp_path: Path) -> None:
    words = ["analyse", "--case", "crank-rocker", "--set", "body.crank.length=0.05,0.3,0.06", "--out", "out"]
    done = commands.compare(*words, "--workers", "1", cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    result = Sweep.read(tmp_path / "out" / "sweep.json")
    assert [bool(point.failure) for point in result.points] == [False, True, False]
    assert result.points[1].failure.startswith("it does not close near the assembly angles")
    assert np.isnan(column(result, "drive_torque")[1])
    assert column(result, "drive_torque")[2] < column(result, "drive_torque")[0] < 0
    assert "it does not close" in done.stdout
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"sweep.json", "sweep.html", "sweep.csv", "sweep.svg"}
    page = (tmp_path / "out" / "sweep.html").read_text(encoding="utf-8")
    assert page.count("<tr>") == 1 + len(result.points)
    assert page.count("<figure>") == len(list(panels(result)))
    assert "it does not close" in page
    nothing = commands.compare(
        *words[:3], "--set", "body.crank.mass=-1,-2", "--workers", "1", "--out", "bad", cwd=tmp_path
    )
    assert nothing.returncode == 2
    assert "no point has an answer, the first because body[crank].mass = -1.0" in nothing.stderr


def test_an_argument_that_no_point_can_use_is_refused_as_without_fields(tmp_path: Path) -> None:
    words = ["paper", "--set", "drive.speed=1,2", "--limit", "reaktion_B=1N", "--workers", "1", "--out", "no"]
    commands.assert_refused(
        commands.compare(*words, cwd=tmp_path), "--limit reaktion_B=1N: reaktion_B is nothing of paper"
    )
    assert not list(tmp_path.iterdir())


def test_angles_without_an_equilibrium_are_a_remark_of_their_row() -> None:
    """A pin that nothing presses has no equilibrium: the load of 0 N."""
    still = PAPER.replace(drive=PAPER.drives[0].model_copy(update={"speed": 1e-9}))
    result = lc.sweep(still, {"load.force.y": [50.0, 0.0]}, clearance={"B": 1e-4}, motion="static", workers=1)
    whole, silent = result.points
    assert whole.whole
    assert silent.remark.startswith("no answer at ")
    assert not result.holds


@pytest.mark.mujoco
def test_a_cross_check_s_rows_have_the_verdict_and_the_largest_difference(tmp_path: Path) -> None:
    words = "--case paper --simulator mujoco --joint contact --motion static --analytic first_order".split()
    words += ["--set", "joint.B.clearance=0.001mm,1mm", "--angles", "30:150:60", "--workers", "1", "--out", "out"]
    done = commands.compare(*words, cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    result = Sweep.read(tmp_path / "out" / "sweep.json")
    assert [point.verdict for point in result.points] == ["agrees", "disagrees"]
    angles = np.radians([30.0, 90.0, 150.0])
    alone = lc.crosscheck(
        "paper", "mujoco", joint_model="contact", motion="static", analytic="first_order", angles=angles,
        clearance={"B": 1e-3},
    )  # fmt: skip
    worst = max((d for d in alone.runs[0].discrepancies if d.share), key=lambda d: d.share or 0.0)
    far = result.points[1].farthest
    assert far is not None
    assert (far.signal, far.max) == (worst.signal, pytest.approx(worst.max, rel=1e-9))
    assert result.rows()[1]["share"] == pytest.approx(worst.share, rel=1e-9)
    assert re.search(rf"0\.001 +agrees .*\n +1 +DISAGREES .*{worst.signal}, mujoco, contact", done.stdout)
    cases = [case for suite in result.judgements() for case in suite.cases]
    assert [bool(case.failure) for case in cases] == [False, True]
    assert cases[1].failure.startswith(f"disagrees: {worst.signal}, mujoco, contact: ")
    assert (tmp_path / "out" / "junit.xml").exists()


@pytest.mark.mujoco
def test_the_processes_of_a_cross_check_may_be_told_and_change_no_number(tmp_path: Path) -> None:
    words = "--simulator mujoco --motion static --angles 30:60:30 -q --workers".split()
    for workers in ("1", "2"):
        assert commands.compare(*words, workers, "--out", workers, cwd=tmp_path).returncode == 0
    one, two = ((tmp_path / name / "signals.csv").read_text(encoding="utf-8") for name in ("1", "2"))
    assert one == two


@pytest.mark.mujoco
def test_a_simulation_that_fails_is_status_3_and_the_others_stand(tmp_path: Path) -> None:
    words = "--case paper --simulator mujoco --joint contact --motion static --angles 30:40:10".split()
    words += ["--set", "joint.B.contact_stiffness=1e8,1e2", "--workers", "1", "--out", "out", "-q"]
    done = commands.compare(*words, "--clearance", "B=1e-4", cwd=tmp_path)
    result = Sweep.read(tmp_path / "out" / "sweep.json")
    good, soft = result.points
    assert (good.whole, good.verdict) == (True, "agrees")
    assert "50 N press the pin of joint 'B' 0.5 m into its bearing" in soft.failure  # 50 N / 1e2 N/m
    assert soft.engine_failed
    assert done.returncode == 3


def test_the_figure_has_a_panel_for_each_kind_of_number_and_at_most_six_curves(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    words = ["analyse", "--case", "paper", "--set", "drive.speed=30 rpm:90 rpm:30 rpm", "--workers", "1"]
    done = commands.compare(*words, "--plot", "sweep.png", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "sweep.png").stat().st_size > 10_000
    result = Sweep.read(tmp_path / "out" / "sweep.json")
    axes = result.plot().axes
    assert [axis.get_ylabel().partition("\n")[0] for axis in axes] == [
        "largest reaction", "largest of the drive", "largest error by clearance", "largest error by clearance",
        "worst case of clearance", "worst case of clearance",
    ]  # fmt: skip
    assert axes[-1].get_xlabel() == "drive.speed (rpm)"
    np.testing.assert_allclose(axes[0].lines[0].get_xdata(), [30.0, 60.0, 90.0])
    grid = lc.sweep("paper", {"drive.speed": [1.0, 2.0], "joint.B.clearance": np.linspace(1e-4, 9e-4, 9)}, workers=1)
    assert all(len(axis.lines) == 6 for axis in grid.plot().axes)
    assert (tmp_path / "out" / "sweep.svg").read_text(encoding="utf-8").count("<svg ") == 1 + len(axes)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["analyse", "--workers", "2"], "--workers: spreads the points of --set; give that, or leave it out"),
        (["analyse", "--set", "drive.speed"], "'drive.speed' has no values; give FIELD=START:STOP:STEP"),
        (["analyse", "--set", "drive.sped=1"], "'sped' is no field of a drive; did you mean 'speed'"),
        (["analyse", "--set", "drive.speed=1", "--set", "drive.speed=2"], "drive.speed is there twice"),
        (["accuracy", "--set", "drive.speed=1", "--times", "0:1:0.1", "--samples", "9"], "--samples is of linkages"),
        (["--simulator", "adams", "--set", "drive.speed=1"], "adams"),
    ],
)
def test_what_is_typed_wrongly_is_one_sentence_and_status_2(words: list[str], said: str, tmp_path: Path) -> None:
    done = commands.compare(*words, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_mechanism_of_ones_own_file_is_swept_too(tmp_path: Path) -> None:
    mine: Mechanism = PAPER.replace(name="mine")
    (tmp_path / "mine.toml").write_text(dumps(mine), encoding="utf-8")
    done = commands.compare("mine.toml", "--set", "gravity.y=0,-9.81 m/s^2", "--workers", "1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "mine" in done.stdout


def test_a_linkage_that_no_longer_turns_round_says_so_in_its_row() -> None:
    """A slider-crank with a rod shorter than its crank, which rocks about the dead centre; the paper's never turned."""
    swept = lc.sweep("slider-crank", {"body.rod.length": ["45 mm", "120 mm"]}, workers=1)
    short, long = swept.points
    assert short.remark.startswith("the crank does not turn round: looked at from -")
    assert (long.remark, swept.holds) == ("", False)
    assert not lc.sweep("paper", {"drive.speed": ["60 rpm"]}, workers=1).points[0].remark
    given = lc.sweep("slider-crank", {"body.rod.length": ["45 mm"]}, workers=1, angles="-20:20:5")
    assert not given.points[0].remark
