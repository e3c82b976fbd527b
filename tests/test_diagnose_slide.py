"""What a diagnosis says of a linkage that a motor moves along a slide, as a ball screw does.

The forces of these axes are closed forms of their motion, written here; those of the real one were measured by others
(MEASURED_DATA, see tests/test_real_data.py).
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analytic.mechanism.file import load
from asked import request_of
from compare.diagnose.begin import begin
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import Measured, MeasuredError
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.prepare import followed, nominal
from compare.diagnose.preview import preview
from compare.diagnose.workflow import diagnose
from compare.report.diagnosis_page import diagnosis_html, diagnosis_md
from compare.report.diagnosis_terminal import terminal_lines
from compare.report.preview import files
from compare.report.words.located import located
from compare.results.diagnosis import Diagnosis
from sim_models.engine import engine

MASS = 20.0  # kg
COUNT = 1e-6  # m, of the encoder
NOISE = 0.3  # N
OF_A_CRANK = {
    "drive_compliance", "drive_backlash", "speed_ripple", "periodic_torque", "encoder_harmonic", "joint_clearance",
    "joint_compliance", "link_flexibility",
}  # fmt: skip
NOMINAL = """name = "axis"

[ground]
points = {{ S = [0.0, 0.0] }}

[[body]]
name = "carriage"
points = {{ S = [0.0, 0.0] }}
mass = {mass}
com = [0.0, 0.05]
inertia = 0.1

[[joint]]
name = "S"
type = "prismatic"
bodies = [{bodies}]
axis = [1.0, 0.0]

[drive]
joint = "S"
speed = "measured"

[assembly]
carriage = 0.0
"""
MEASURED = """mechanism = "nominal.toml"

[[run]]
name = "strokes"
file = "run.csv"
{drive}
"""
Motion = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
Force = Callable[[np.ndarray, np.ndarray], np.ndarray]  # of travel (m) and speed (m/s) along the slide, N


def strokes(time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Travel (m), speed and acceleration (N,) of strokes of several lengths and speeds."""
    travel, speed, acceleration = np.zeros(time.size), np.zeros(time.size), np.zeros(time.size)
    for amplitude, period, phase in ((0.12, 1.5, 0.0), (0.05, 0.7, 0.3)):
        w = 2 * math.pi / period
        travel += amplitude * np.sin(w * time + phase)
        speed += amplitude * w * np.cos(w * time + phase)
        acceleration -= amplitude * w**2 * np.sin(w * time + phase)
    return travel, speed, acceleration


def from_rest(time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of strokes that begin so softly that before them the axis may have rested."""
    reach, w = 0.24, math.pi / 1.4
    sine, cosine = np.sin(w * time), np.cos(w * time)
    return (
        reach * sine**4,
        4 * reach * w * sine**3 * cosine,
        4 * reach * w**2 * (3 * sine**2 * cosine**2 - sine**4),
    )


def with_rests(time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of an axis that goes there, rests, comes back and rests, as a positioning axis does."""
    reach, stroke, rest = 0.24, 0.6, 0.4
    at, found = np.mod(time, 2 * (stroke + rest)), np.zeros((3, time.size))
    for start, sign in ((0.0, 1.0), (stroke + rest, -1.0)):
        u = np.clip((at - start) / stroke, 0.0, 1.0)
        found[0] += sign * reach * (10 * u**3 - 15 * u**4 + 6 * u**5)
        found[1] += sign * reach * 30 * u**2 * (1 - u) ** 2 / stroke
        found[2] += sign * reach * (60 * u - 180 * u**2 + 120 * u**3) / stroke**2
    return found[0], found[1], found[2]


def hardly(time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of an axis at rest between two counts of its encoder."""
    count = np.random.default_rng(0).integers(0, 2, time.size)
    return COUNT * count, np.zeros(time.size), np.zeros(time.size)


def nothing(travel: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """No force beside the carriage's inertia."""
    return np.zeros(travel.size)


def axis(
    folder: Path,
    against: Force = nothing,
    mass: float = MASS,
    bodies: str = '"ground", "carriage"',
    drive: str = 'drive = "measured"',
    motion: Motion = strokes,
    late: float = 0.0,
) -> Path:
    """The measured.toml of an axis whose motor has to overcome a force beside the inertia of a mass (kg); the force is
    read ``late`` (s).
    """
    time = np.arange(0.0, 4.2, 0.004)
    travel, speed, acceleration = motion(time - late)
    random = np.random.default_rng(3)
    force = mass * acceleration + against(travel, speed) + random.normal(0.0, NOISE, time.size)
    travel = motion(time)[0]
    sign = 1.0 if bodies.startswith('"ground"') else -1.0  # the motor's force is on the second body of its joint
    columns = np.column_stack([time, sign * np.round(travel / COUNT) * COUNT, sign * force])
    np.savetxt(
        folder / "run.csv",
        columns,
        fmt="%.7g",
        delimiter=",",
        comments="",
        header="time [s],position_S [m],drive_force_S [N]",
    )
    (folder / "nominal.toml").write_text(NOMINAL.format(mass=MASS, bodies=bodies), encoding="utf-8")
    (folder / "measured.toml").write_text(MEASURED.format(drive=drive), encoding="utf-8")
    return folder / "measured.toml"


def diagnosed(measured: Path | Measured) -> Diagnosis:
    return diagnose(measured, "mujoco", others=False, workers=1)


def sizes(result: Diagnosis) -> Mapping[tuple[str, str], Any]:
    """The named effects' parameters, by name and place."""
    return {(effect.name, effect.where): effect.parameters for effect in result.effects}


def worn(travel: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Viscous friction, dry friction and an offset; at rest what the motor holds is the offset alone."""
    return 30.0 * speed + 6.0 * np.sign(speed) - 2.5


@pytest.fixture(scope="module")
def worn_axis(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    return diagnosed(axis(tmp_path_factory.mktemp("worn"), worn))


@pytest.mark.slow
def test_both_frictions_and_the_offset_of_an_axis_are_named_with_their_sizes(worn_axis: Diagnosis) -> None:
    """The offset is a bias of the force, or a force on the carriage: with one sensor nobody can tell which."""
    found = sizes(worn_axis)
    assert worn_axis.verdict == "ambiguous", worn_axis.statement
    assert len(found) == 3, worn_axis.statement
    damping = found["viscous_friction", "S"]["damping"]
    friction = found["coulomb_friction", "S"]["friction_torque"]
    assert (damping.unit, friction.unit) == ("N.s/m", "N")
    assert damping.low < 30.0 < damping.high
    assert damping.value == pytest.approx(30.0, rel=0.01)
    assert friction.low < 6.0 < friction.high
    assert friction.value == pytest.approx(6.0, rel=0.01)
    (offset,) = (effect for effect in worn_axis.effects if effect.name not in ("viscous_friction", "coulomb_friction"))
    same = {(offset.name, offset.where), *((tie.name, tie.where) for tie in offset.ambiguous_with)}
    assert {("sensor_bias", "drive_force_S"), ("external_force", "carriage")} <= same
    bias = offset.parameters["bias" if offset.name == "sensor_bias" else "x"].value
    assert abs(bias) == pytest.approx(2.5, abs=0.05)


def test_the_engine_closes_the_gap_of_an_axis(worn_axis: Diagnosis) -> None:
    gap = worn_axis.gap
    assert gap.before is not None
    assert gap.after is not None
    assert gap.before > 10
    assert gap.after < 1.1
    assert worn_axis.explained.joint("S").damping == pytest.approx(30.0, rel=0.01)


def test_nothing_of_a_crank_is_considered_or_said_of_an_axis(worn_axis: Diagnosis) -> None:
    assert {candidate.name for candidate in worn_axis.candidates} & OF_A_CRANK == set()
    told = [
        diagnosis_md(worn_axis),
        *terminal_lines(worn_axis),
        *(text for step in worn_axis.steps for text in step.text),
    ]
    for text in told:
        assert "crank" not in text
        assert " deg" not in text.replace("S 0 deg", "")  # of its slide, which was left out
    page = diagnosis_html(worn_axis)
    assert "follows the measured slide" in page
    assert "crank angle" not in page.partition("<script")[0]


def test_where_an_axis_is_off_is_said_by_time_and_travel(worn_axis: Diagnosis) -> None:
    said = [located(worn_axis, place) for place in worn_axis.located]
    assert said
    for text in said:
        assert " s, at " in text
        assert text.endswith(" mm")
    place = worn_axis.located[0]
    run = worn_axis.runs[0]
    assert run.crank_angle.min() <= min(place.crank_angle_from, place.crank_angle_to)
    assert max(place.crank_angle_from, place.crank_angle_to) <= run.crank_angle.max()
    assert worn_axis.units()["crank_angle"] == "m"


def test_an_axis_that_lacks_nothing_has_no_gap(tmp_path: Path) -> None:
    result = diagnosed(axis(tmp_path))
    assert (result.verdict, result.effects) == ("no gap", ()), result.statement


@pytest.mark.slow
def test_an_axis_told_the_other_way_round_has_the_same_sizes(tmp_path: Path, worn_axis: Diagnosis) -> None:
    """The joint goes from the carriage to the ground: its travel and the motor's force have the other sign."""
    found, same = sizes(diagnosed(axis(tmp_path, worn, bodies='"carriage", "ground"'))), sizes(worn_axis)
    for key, name in ((("viscous_friction", "S"), "damping"), (("coulomb_friction", "S"), "friction_torque")):
        assert found[key][name].value == pytest.approx(same[key][name].value, rel=1e-3)


@pytest.mark.slow
def test_a_payload_on_an_axis_is_tied_with_the_gain_of_its_only_force(tmp_path: Path) -> None:
    """Beside a damper of unknown size the motor's force grows alike with the mass and with its own gain."""
    result = diagnosed(axis(tmp_path, lambda travel, speed: 30.0 * speed, mass=1.075 * MASS))
    found = sizes(result)
    assert result.verdict == "ambiguous", result.statement
    assert set(found) == {("viscous_friction", "S"), ("sensor_gain", "drive_force_S")}, result.statement
    gain = next(effect for effect in result.effects if effect.name == "sensor_gain")
    assert [(tie.name, tie.where) for tie in gain.ambiguous_with] == [("payload", "carriage")]
    assert gain.parameters["gain_error"].value == pytest.approx(0.075, abs=0.002)
    assert found["viscous_friction", "S"]["damping"].value == pytest.approx(30.0 / 1.075, rel=0.01)


@pytest.mark.slow
def test_a_spring_along_an_axis_is_named_with_its_rest(tmp_path: Path) -> None:
    result = diagnosed(axis(tmp_path, lambda travel, speed: 150.0 * (travel - 0.04)))
    found = sizes(result)
    assert set(found) == {("joint_spring", "S")}, result.statement
    spring = found["joint_spring", "S"]
    assert spring["stiffness"].value == pytest.approx(150.0, rel=0.02)
    assert (spring["stiffness"].unit, spring["rest_angle"].unit) == ("N/m", "m")
    assert spring["rest_angle"].value == pytest.approx(0.04, abs=1e-3)


@pytest.mark.slow
def test_drag_along_an_axis_is_named(tmp_path: Path) -> None:
    result = diagnosed(axis(tmp_path, lambda travel, speed: 25.0 * speed * np.abs(speed)))
    assert set(sizes(result)) == {("drag", "S")}, result.statement
    drag = sizes(result)["drag", "S"]["drag"]
    assert drag.unit == "N.s2/m2"
    assert drag.value == pytest.approx(25.0, rel=0.02)


@pytest.mark.slow
def test_what_an_axis_reads_at_rest_does_not_count(tmp_path: Path) -> None:
    """At rest dry friction holds whatever there is; readings of it would say that there is none."""
    result = diagnosed(axis(tmp_path, worn, motion=with_rests))
    found = sizes(result)
    (rest,) = (fault for fault in result.faults if fault.kind == "rest")
    assert (rest.signal, rest.samples) == ("drive_force_S", pytest.approx(445, abs=5))
    assert "dry friction may be anything there" in rest.text
    assert result.verdict == "ambiguous", result.statement  # but for what the offset is
    assert result.gap.after is not None
    assert result.gap.after < 1.1
    damping, friction = found["viscous_friction", "S"]["damping"], found["coulomb_friction", "S"]["friction_torque"]
    assert damping.low < 30.0 < damping.high
    assert friction.low < 6.0 < friction.high
    assert friction.value == pytest.approx(6.0, rel=0.02)


def test_an_axis_that_only_rests_is_refused(tmp_path: Path) -> None:
    measured = load_measured(axis(tmp_path, motion=hardly))
    with pytest.raises(MeasuredError, match="give a run in which it moves"):
        diagnosed(measured)


@pytest.mark.slow
def test_a_force_that_is_read_late_is_named_and_simulated(tmp_path: Path) -> None:
    """The engine is asked for a motion from before the first reading."""
    late = axis(tmp_path, lambda travel, speed: 30.0 * speed, motion=from_rest, late=0.004)
    result = diagnosed(late)
    found = sizes(result)
    assert set(found) == {("viscous_friction", "S"), ("sensor_delay", "drive_force_S")}, result.statement
    assert found["sensor_delay", "drive_force_S"]["delay"].value == pytest.approx(0.004, rel=0.02)
    assert result.gap.after == pytest.approx(1.0, abs=0.05), result.statement
    assert [engine.skipped for engine in result.engines if engine.name == "mujoco"] == [None]


@pytest.mark.parametrize("drive", ['drive = "free"', "drive_speed = 0.2"])
def test_other_runs_of_a_slide_are_refused_in_a_sentence(tmp_path: Path, drive: str) -> None:
    with pytest.raises(MeasuredError, match=r"the slide 'S', whose runs follow position_S; say drive = 'measured'"):
        load_measured(axis(tmp_path, drive=drive))


def test_a_run_of_a_slide_without_its_encoder_is_refused(tmp_path: Path) -> None:
    measured = axis(tmp_path)
    rows = (tmp_path / "run.csv").read_text(encoding="utf-8").replace("position_S [m]", "carriage_x [m]")
    (tmp_path / "run.csv").write_text(rows, encoding="utf-8")
    with pytest.raises(MeasuredError, match="has no column 'position_S'"):
        load_measured(measured)


def test_the_sizes_of_an_axis_are_told_by_its_travel(tmp_path: Path) -> None:
    courses, measured = followed(load_measured(axis(tmp_path)))
    rig, model = nominal(measured, measured.mechanism, courses)
    travel, speed, _ = strokes(measured.runs[0].time)
    assert rig.length == pytest.approx(np.ptp(travel), rel=1e-4)
    assert rig.speed * rig.length == pytest.approx(np.abs(speed).max(), rel=1e-3)
    assert rig.travels["S"] == pytest.approx((travel.min(), travel.max()), abs=1e-4)
    assert {name for name, effect in VOCABULARY.items() if effect.places(rig)} & OF_A_CRANK == set()
    read = model([[]])[0]
    assert read is not None
    assert np.abs(read[0]["position_S"] - travel).max() < 5 * COUNT


def test_an_axis_is_shown_before_its_diagnosis_over_its_travel(tmp_path: Path) -> None:
    page = files(preview(axis(tmp_path, worn)))["data.html"]
    assert "the slide goes from" in page
    assert "over travel" in page
    assert "crank" not in page.partition("<body")[2]


def test_a_measured_toml_for_an_axis_is_begun(tmp_path: Path) -> None:
    axis(tmp_path)
    text = begin(tmp_path / "run.csv", tmp_path / "nominal.toml", tmp_path).text
    assert 'drive = "measured"' in text
    assert "crank" not in text


def test_a_crank_and_a_slide_name_their_encoder_and_their_motor(tmp_path: Path) -> None:
    axis(tmp_path)
    slide, crank, arm = load(tmp_path / "nominal.toml"), load("crank-rocker"), load("2r-arm")
    assert (slide.encoder.name, slide.efforts[0].name, slide.sliding) == ("position_S", "drive_force_S", True)
    assert (crank.encoder.name, crank.efforts[0].name, crank.sliding) == ("crank_angle", "drive_torque", False)
    assert not arm.sliding
    with pytest.raises(ValueError, match="turns a crank or moves a slide on the ground"):
        _ = arm.encoder


PRESS = """name = "press"
gravity = [0.0, -9.81]
ground = { points = { S = [0.0, 0.0], O = [0.5, 0.3] } }
body = [
  { name = "carriage", points = { S = [0.0, 0.0], A = [0.0, 0.02] }, mass = 5.0, com = [0.0, 0.0], inertia = 0.01 },
  { name = "coupler", points = { A = [0.0, 0.0], B = [0.35, 0.0] }, mass = 1.2 },
  { name = "rocker", points = { O = [0.0, 0.0], B = [0.25, 0.0] }, mass = 0.9 },
]
joint = [
  { name = "S", type = "prismatic", bodies = ["ground", "carriage"], axis = [1.0, 0.0] },
  { name = "A", type = "revolute", bodies = ["carriage", "coupler"] },
  { name = "B", type = "revolute", bodies = ["coupler", "rocker"] },
  { name = "O", type = "revolute", bodies = ["ground", "rocker"] },
]
drive = { joint = "S", speed = "measured" }
assembly = { carriage = 0.0, coupler = 0.7, rocker = 2.5 }
"""


@pytest.mark.slow
@pytest.mark.dart
def test_friction_in_a_pin_of_a_linkage_that_a_slide_moves_is_named_there(tmp_path: Path) -> None:
    """DART plays what the motor, a load cell and an encoder of the rocker read."""
    (tmp_path / "nominal.toml").write_text(PRESS, encoding="utf-8")
    (tmp_path / "measured.toml").write_text(MEASURED.format(drive='drive = "measured"'), encoding="utf-8")
    time, random = np.arange(0.0, 3.0, 0.006), np.random.default_rng(1)
    travel = 0.11 + strokes(time)[0] / 2
    real = load(tmp_path / "nominal.toml").with_joint("O", friction_torque=0.8).with_joint("S", damping=25.0)
    knots = np.arange(-0.001, 3.001, 0.001)
    course = {"S": (knots - knots[0], 0.11 + strokes(knots)[0] / 2)}
    seen = engine("dart").simulate(request_of(real, "ideal", "driven", time=time - knots[0], courses=course)).signals
    read = {"drive_force_S [N]": 0.2, "rocker_angle [rad]": 1e-4, "reaction_O_x [N]": 0.1, "reaction_O_y [N]": 0.1}
    columns = {"time [s]": time, "position_S [m]": np.round(travel / COUNT) * COUNT}
    columns |= {
        title: seen[title.partition(" ")[0]] + random.normal(0.0, noise, time.size) for title, noise in read.items()
    }
    table, head = np.column_stack([*columns.values()]), ",".join(columns)
    np.savetxt(tmp_path / "run.csv", table, fmt="%.8g", delimiter=",", comments="", header=head)
    result = diagnosed(tmp_path / "measured.toml")
    assert result.verdict == "explained", result.statement
    found = sizes(result)
    assert set(found) == {("coulomb_friction", "O"), ("viscous_friction", "S")}, result.statement
    friction, damping = found["coulomb_friction", "O"]["friction_torque"], found["viscous_friction", "S"]["damping"]
    assert (friction.unit, damping.unit) == ("N.m", "N.s/m")
    assert friction.value == pytest.approx(0.8, rel=0.01)
    assert damping.value == pytest.approx(25.0, rel=0.01)


FOLDER = os.environ.get("MEASURED_DATA", "")


@pytest.mark.slow
@pytest.mark.skipif(not FOLDER, reason="MEASURED_DATA is not set: the folder with emps")
def test_a_real_ball_screw_lacks_both_frictions_and_an_offset() -> None:
    """Published (Janot, Gautier and Brunot): 203.5 N.s/m, 20.39 N, offset of the force -3.16 N."""
    result = diagnosed(Path(FOLDER) / "emps" / "measured.toml")
    found = sizes(result)
    assert found["viscous_friction", "S"]["damping"].value == pytest.approx(203.5, rel=0.02)
    assert found["coulomb_friction", "S"]["friction_torque"].value == pytest.approx(20.39, rel=0.05)
    (offset,) = (effect for effect in result.effects if effect.name not in ("viscous_friction", "coulomb_friction"))
    assert (offset.name, offset.where) == ("sensor_bias", "drive_force_S")
    assert ("external_force", "carriage") in {(tie.name, tie.where) for tie in offset.ambiguous_with}
    assert offset.parameters["bias"].value == pytest.approx(-3.16, abs=0.1)
    assert sum(effect.share for effect in result.effects if effect.share is not None) > 0.99
    assert result.gap.after < 10 < 100 < result.gap.before
    assert "friction force 20.4 N" in result.statement
    assert result.verdict == "partly explained", result.statement  # friction that changes along the screw remains
