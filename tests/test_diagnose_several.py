"""What a diagnosis says of a linkage whose several drives follow their encoders: effects and encoders at each drive.

The forces of the arm are a closed form of its motion, written here; all other data come from another engine than the
one that diagnoses, or were recorded by others (MEASURED_DATA, see tests/test_parallel_robot.py).
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps, load
from asked import request_of
from commands import compare
from compare.diagnose.begin import begin
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import MeasuredError
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.predict import Term
from compare.diagnose.prepare import followed, nominal
from compare.diagnose.preview import preview
from compare.diagnose.workflow import diagnose
from compare.report.diagnosis_page import diagnosis_html, diagnosis_md
from compare.report.words.effects import own_values
from compare.results.diagnosis import Diagnosis, Estimate
from diagnosis_rigs import valued
from measured_files import RunTable, write_measured
from several_linkages import third_bar
from sim_models.engine import engine
from tests.evidence.published.parallel_robot import FOLDER

DATA = Path(os.environ.get("MEASURED_DATA", "")) / FOLDER
HERE = pytest.mark.skipif(
    not (os.environ.get("MEASURED_DATA") and DATA.is_dir()), reason="MEASURED_DATA is not set: the folder of real rigs"
)
TIME = np.linspace(0.0, 3.0, 451)
KNOTS = np.linspace(0.0, 3.0, 1501)
ENCODER = {"rad": 2e-5, "m": 2e-6}
PLACE = 2e-5  # m
SHARE = 0.005  # of its half range, of a motor's torque or force
WAYS = ((2.0, 1.0), (5.0, 0.6))  # rad/s and amplitude of the runs
REACH = {"rad": 0.25, "m": 0.01}
FOLLOWS = {"drive": "measured"}


def position(m: Mechanism, joint: str) -> str:
    return f"position_{joint} [{'m' if m.joint(joint).prismatic else 'rad'}]"


def motor(m: Mechanism, joint: str) -> str:
    return f"drive_force_{joint} [N]" if m.joint(joint).prismatic else f"drive_torque_{joint} [N.m]"


def swung(m: Mechanism, way: tuple[float, float]) -> dict[str, CubicSpline]:
    """Every drive to and fro about the assembly, each at a rate of its own."""
    at, (rate, amplitude) = Assembly(m).positions, way
    courses = {}
    for i, joint in enumerate(m.motors):
        reach = amplitude * REACH["m" if joint.prismatic else "rad"]
        wave = np.sin(rate * (1 + 0.3 * i) * KNOTS + 0.4 * i) - math.sin(0.4 * i)
        courses[joint.name] = CubicSpline(KNOTS, at[joint.name] + reach * wave)
    return courses


def bench(
    folder: Path,
    case: str,
    maker: str,
    truth: Mechanism,
    offsets: Mapping[str, float] | None = None,
    seen: Sequence[str] = (),
    ways: Sequence[tuple[float, float]] = WAYS,
) -> Path:
    """measured.toml of a case that is in truth another, in an engine: its motors, and where some bodies are; encoders
    read ``offsets`` (rad, m) too much.
    """
    m, runs, random = load(case), [], np.random.default_rng(5)
    for k, way in enumerate(ways):
        courses = swung(m, way)
        knots = {name: (KNOTS, course(KNOTS)) for name, course in courses.items()}
        model = "contact" if truth.clearances else "ideal"
        trace = engine(maker).simulate(request_of(truth, model, "driven", time=TIME, courses=knots))
        columns = {}
        for joint in m.motors:
            unit = "m" if joint.prismatic else "rad"
            read = courses[joint.name](TIME) + (offsets or {}).get(joint.name, 0.0)
            columns[position(m, joint.name)] = read + random.normal(0.0, ENCODER[unit], TIME.size)
            heading = motor(m, joint.name)
            given = trace.signals[heading.split(" ")[0]]
            columns[heading] = given + random.normal(0.0, SHARE * np.ptp(given) / 2, TIME.size)
        for signal in seen:
            columns[f"{signal} [m]"] = trace.signals[signal] + random.normal(0.0, PLACE, TIME.size)
        runs.append(RunTable(f"run{k}", TIME, columns, FOLLOWS))
    return write_measured(folder, dumps(m), runs)


def diagnosed(measured: Path) -> Diagnosis:
    return diagnose(measured, "mujoco", others=False, workers=1)


def sizes(result: Diagnosis) -> Mapping[tuple[str, str], Any]:
    return {(effect.name, effect.where): effect.parameters for effect in result.effects}


# ---------------------------------------------------------------- an arm in closed form

DAMPING, LOST, SIGN = 0.05, 0.012, -1  # N.m.s/rad in the elbow; rad that the shoulder's encoder reads too little


def of_an_arm(m: Mechanism, courses: Mapping[str, CubicSpline]) -> dict[str, np.ndarray]:
    """Torques (N,) of a two-link arm by Lagrange's equations, its elbow damped."""
    (shoulder, elbow), (upper, fore) = (courses[j](TIME) for j in ("O", "K")), (m.moving[b] for b in m.moving)
    rates = [np.array([courses[j](TIME, k) for j in ("O", "K")]) for k in (1, 2)]
    length, a, b = 0.3, upper.com[0], fore.com[0]
    (w1, w2), (q1, q2), g = rates[0], rates[1], 9.81
    c, s = np.cos(elbow), np.sin(elbow)
    m11 = upper.inertia + fore.inertia + upper.mass * a**2 + fore.mass * (length**2 + b**2 + 2 * length * b * c)
    m12 = fore.inertia + fore.mass * (b**2 + length * b * c)
    m22 = fore.inertia + fore.mass * b**2
    turned = fore.mass * length * b * s
    heavy = fore.mass * g * b * np.cos(shoulder + elbow)
    lifted = (upper.mass * a + fore.mass * length) * g * np.cos(shoulder) + heavy
    first = m11 * q1 + m12 * q2 - turned * (2 * w1 * w2 + w2**2) + lifted
    return {"O": first, "K": m12 * q1 + m22 * q2 + turned * w1**2 + heavy + DAMPING * w2}


def arm(folder: Path, **fields: Any) -> Path:
    """measured.toml of the arm; ``fields`` of its run replace that it follows its encoders."""
    m, random = load("2r-arm").replace(loads=()), np.random.default_rng(8)
    courses, columns = swung(m, WAYS[1]), {}
    for name, torque in of_an_arm(m, courses).items():
        read = courses[name](TIME) + (SIGN * LOST if name == "O" else 0.0)
        columns[position(m, name)] = read + random.normal(0.0, ENCODER["rad"], TIME.size)
        columns[motor(m, name)] = torque + random.normal(0.0, 2e-3, TIME.size)
    return write_measured(folder, dumps(m), [RunTable("swing", TIME, columns, fields or FOLLOWS)])


def test_the_arm_s_data_in_a_check_miss_its_damped_elbow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By smooth courses through encoders that scatter, and by as much as its sensors' noise."""
    monkeypatch.setattr(sys.modules[__name__], "LOST", 0.0)
    measured = load_measured(arm(tmp_path))
    (run,) = lc.check(measured).runs
    assert {each.signal: each.verdict for each in run.discrepancies} == {
        "drive_torque_O": "agrees",
        "drive_torque_K": "disagrees",
    }
    damped = measured.mechanism.with_joint("K", damping=DAMPING)
    assert lc.check(replace(measured, mechanism=damped)).verdict == "agrees"


@pytest.fixture(scope="module")
def worn_arm(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    return diagnosed(arm(tmp_path_factory.mktemp("arm")))


@pytest.mark.mujoco
def test_a_damped_elbow_and_the_shoulder_s_encoder_are_named_with_their_sizes(worn_arm: Diagnosis) -> None:
    """The zero of the shoulder's encoder is a turn of gravity too: without a look at the arm nobody can tell which."""
    found = sizes(worn_arm)
    assert worn_arm.gap.before is not None
    assert worn_arm.gap.before > 10
    assert worn_arm.gap.after == pytest.approx(1.0, abs=0.1), worn_arm.statement
    damping = found["viscous_friction", "K"]["damping"]
    assert damping.value == pytest.approx(DAMPING, rel=0.02)
    assert damping.low < DAMPING < damping.high
    (other,) = (effect for effect in worn_arm.effects if effect.name != "viscous_friction")
    same = {(other.name, other.where), *((tie.name, tie.where) for tie in other.ambiguous_with)}
    assert ("encoder_offset", "position_O") in same, worn_arm.statement


@pytest.mark.mujoco
def test_an_effect_that_has_no_place_in_these_runs_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(MeasuredError, match=r"only drive_backlash is asked for: it has no place in these runs"):
        diagnose(arm(tmp_path), "mujoco", only=["drive_backlash"], others=False, workers=1)


@pytest.mark.mujoco
def test_no_page_of_several_drives_speaks_of_a_crank(worn_arm: Diagnosis) -> None:
    assert "crank" not in diagnosis_md(worn_arm)
    page = diagnosis_html(worn_arm).partition("<script")[0]
    assert "follows the measured drives" in page
    assert "crank" not in page
    assert "crank_angle" not in worn_arm.rows()[0]
    assert worn_arm.units()["position_O"] == "rad"
    np.testing.assert_array_equal([row["position_O"] for row in worn_arm.rows()], worn_arm.runs[0].crank_angle)


def test_the_arm_is_shown_before_its_diagnosis_and_begun_by_its_headings(tmp_path: Path) -> None:
    measured = load_measured(arm(tmp_path))
    shown = preview(measured)
    assert {name for name, seen in shown.runs[0].signals.items() if seen.gap is None} == {"position_O", "position_K"}
    done = compare("diagnose", "measured.toml", "--check", "--out", "data", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "position of O" in done.stdout
    assert "crank" not in done.stdout
    text = begin([tmp_path / "swing.csv"], tmp_path / "nominal.toml", tmp_path).text
    assert 'drive = "measured"    # the only kind of run of several drives' in text
    assert "[columns]" not in text


def test_a_rig_of_several_drives_knows_its_joints_travels_and_speeds(tmp_path: Path) -> None:
    courses, measured = followed(load_measured(arm(tmp_path)))
    rig, model = nominal(measured, measured.mechanism, courses)
    assert rig.encoders == ("position_O", "position_K")
    wave = swung(measured.mechanism, WAYS[1])
    for joint in ("O", "K"):
        low, high = rig.travels[joint]
        assert (low, high) == pytest.approx((wave[joint](TIME).min(), wave[joint](TIME).max()), abs=0.02)
    assert rig.speed == pytest.approx(max(np.abs(wave[j](TIME, 1)).max() for j in wave), rel=1e-2)
    read = model([[]])[0]
    assert read is not None
    for encoder in rig.encoders:
        assert np.abs(read[0][encoder] - measured.runs[0].channels[encoder].values).max() < 5 * ENCODER["rad"]


REFUSED = {
    "an angle": ({"drive": "measured", "drive_angle": 2.0}, r"drive_angle = 2 belongs to a drive_speed"),
    "not said": ({"noise": {"drive_torque_O": 0.01}}, r"say drive = 'measured'"),
    "free": ({"drive": "free"}, r"is free, and '2r-arm' is driven in O and K, whose runs follow position_O and"),
    "a speed": ({"drive_speed": 1.0}, r"is driven at 1, and"),
    "a start": ({"drive": "measured", "start": {"forearm_angle": 1.0}}, r"start belongs to drive = 'free'"),
}


@pytest.mark.parametrize("how", REFUSED)
def test_runs_that_do_not_follow_their_encoders_are_refused_in_a_sentence(how: str, tmp_path: Path) -> None:
    fields, words = REFUSED[how]
    with pytest.raises(MeasuredError, match=words):
        load_measured(arm(tmp_path, **fields))


def test_an_encoder_that_is_missing_or_stands_still_is_named(tmp_path: Path) -> None:
    path = arm(tmp_path)
    text = (tmp_path / "swing.csv").read_text(encoding="utf-8")
    (tmp_path / "swing.csv").write_text(text.replace("position_K [rad]", "forearm_x [m]"), encoding="utf-8")
    with pytest.raises(MeasuredError, match=r"swing\.csv has no column 'position_K'; add the encoder$"):
        load_measured(path)
    rows = text.splitlines()
    k = rows[0].split(",").index("position_K [rad]")
    still = [",".join("0.5" if i == k else cell for i, cell in enumerate(row.split(","))) for row in rows[1:]]
    (tmp_path / "swing.csv").write_text("\n".join([rows[0], *still]), encoding="utf-8")
    with pytest.raises(MeasuredError, match=r"'position_K' in swing\.csv does not move; each drive has to: check the"):
        load_measured(path)


def test_a_drive_that_is_left_free_is_named(tmp_path: Path) -> None:
    path = arm(tmp_path)
    text = (tmp_path / "nominal.toml").read_text(encoding="utf-8")
    (tmp_path / "nominal.toml").write_text(text.replace("speed = -2.0", 'speed = "free"'), encoding="utf-8")
    with pytest.raises(MeasuredError, match=r"has 2 freedoms, and motors in O; .* give each a \[\[drive\]\]"):
        load_measured(path)
    (tmp_path / "nominal.toml").write_text(dumps(load("2r-arm").replace(drives=())), encoding="utf-8")
    measured = path.read_text(encoding="utf-8").replace('"measured"', '"free"')
    path.write_text(measured, encoding="utf-8")
    with pytest.raises(MeasuredError, match=r"'2r-arm' has 2 freedoms; a diagnosis of several follows a motor in each"):
        load_measured(path)


def test_zeros_of_each_run_say_of_which_encoder_they_are() -> None:
    values = {f"offset@run{k}": Estimate(value=x, low=x, high=x, unit="rad") for k, x in enumerate((-0.006, 0.003))}
    result = SimpleNamespace(mechanism=load("five-bar"), runs=())
    error = valued("encoder_offset", "position_E", values)
    own = own_values(result, error)  # type: ignore[arg-type]
    assert own is not None
    assert own.called == "encoder zero for E position"


@pytest.mark.slow
def test_reactions_that_statics_does_not_determine_are_left_out_of_a_redundant_rig(tmp_path: Path) -> None:
    m = third_bar()
    turn = np.radians(20.0 + 30.0 * TIME)
    found = lc.analyse(m, angles=turn)
    random = np.random.default_rng(4)
    columns = {"crank_angle [rad]": turn}
    for signal, unit in (("drive_torque", "N.m"), ("coupler_x", "m")):
        noise = 1e-3 * np.ptp(found.signals[signal])
        columns[f"{signal} [{unit}]"] = found.signals[signal] + random.normal(0.0, noise, TIME.size)
    columns["reaction_c2_x [N]"] = random.normal(0.0, 1.0, TIME.size)
    turning = {"drive_speed": math.radians(30.0), "drive_angle": math.radians(20.0)}
    measured = load_measured(write_measured(tmp_path, dumps(m), [RunTable("turn", TIME, columns, turning)]))
    shown = preview(measured)
    assert set(shown.runs[0].signals) == {"crank_angle", "drive_torque", "coupler_x"}
    assert any("statics does not determine this reaction" in fault.text for fault in shown.faults)
    rig, model = nominal(measured, m, {})
    length = Term(VOCABULARY["link_length"], "bar")
    assert "bar" in length.effect.places(rig)
    assert model([[(length, {"length_error": 1e-3})]]) == [None]  # its loops do not close


# ---------------------------------------------------------------- one drive between moving bodies


@pytest.mark.slow
@pytest.mark.pybullet
@pytest.mark.mujoco
@pytest.mark.parametrize("bodies", [("coupler", "crank"), ("crank", "coupler")])
def test_a_drive_between_moving_bodies_is_followed_whichever_is_told_first(
    bodies: tuple[str, str], tmp_path: Path
) -> None:
    """A four-bar whose motor sits on its crank and turns the coupler; the follower's pin is damped."""
    m = load("crank-rocker").with_clearances({}).rigid()
    pin = m.joint("A").model_copy(update={"bodies": bodies})
    joints = tuple(pin if joint.name == "A" else joint for joint in m.joints)
    m = m.replace(name="motor on the crank", joints=joints, drives=({"joint": "A", "speed": "measured"},))
    course = CubicSpline(KNOTS, Assembly(m).positions["A"] + 0.2 * np.sin(2.0 * KNOTS))
    truth = m.with_joint("E", damping=0.2)
    asked = request_of(truth, "ideal", "driven", time=TIME, courses={"A": (KNOTS, course(KNOTS))})
    torque = engine("pybullet").simulate(asked).signals["drive_torque"]
    random = np.random.default_rng(2)
    columns = {
        "position_A [rad]": course(TIME) + random.normal(0.0, ENCODER["rad"], TIME.size),
        "drive_torque [N.m]": torque + random.normal(0.0, SHARE * np.ptp(torque) / 2, TIME.size),
    }
    result = diagnosed(write_measured(tmp_path, dumps(m), [RunTable("swing", TIME, columns, FOLLOWS)]))
    found = {(tie.name, tie.where) for effect in result.effects for tie in (effect, *effect.ambiguous_with)}
    assert ("viscous_friction", "E") in found, result.statement
    assert result.gap.after == pytest.approx(1.0, abs=0.1)


# ---------------------------------------------------------------- platforms, from other engines


def loaded(m: Mechanism, body: str, share: float) -> Mechanism:
    """A body heavier by a share."""
    heavier = m.moving[body].model_copy(update={"mass": m.moving[body].mass * (1 + share)})
    return m.replace(bodies=tuple(heavier if b.name == body else b for b in m.bodies))


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.mujoco
def test_friction_of_a_five_bar_and_one_of_its_encoders_are_named(tmp_path: Path) -> None:
    truth = load("five-bar").with_joint("A", friction_torque=0.05)
    seen = ("right-arm_x", "right-arm_y")
    result = diagnosed(bench(tmp_path, "five-bar", "exudyn", truth, {"E": 0.01}, seen))
    found = sizes(result)
    assert set(found) == {("encoder_offset", "position_E"), ("coulomb_friction", "A")}, result.statement
    assert found["encoder_offset", "position_E"]["offset"].value == pytest.approx(0.01, rel=0.01)
    assert found["coulomb_friction", "A"]["friction_torque"].value == pytest.approx(0.05, rel=0.02)
    assert result.gap.after is not None
    assert result.gap.after < 2.0  # MuJoCo's dry friction is soft where sliding reverses


@pytest.mark.slow
@pytest.mark.dart
@pytest.mark.mujoco
def test_clearance_of_a_five_bar_is_named_with_its_size(tmp_path: Path) -> None:
    truth = load("five-bar").with_clearances({"P": 3e-4})
    result = diagnosed(bench(tmp_path, "five-bar", "dart", truth, seen=("right-arm_x", "right-arm_y")))
    assert set(sizes(result)) == {("joint_clearance", "P")}, result.statement
    gap = sizes(result)["joint_clearance", "P"]["radial_clearance"]
    assert gap.low < 3e-4 < gap.high
    assert gap.value == pytest.approx(3e-4, rel=0.05)
    assert result.verdict in ("explained", "ambiguous")


@pytest.mark.slow
@pytest.mark.mujoco
@pytest.mark.parametrize(("case", "maker"), [("3-rrr", "dart"), ("3-rpr", "pybullet")])
def test_a_payload_on_a_platform_and_a_pin_s_damping_are_named(case: str, maker: str, tmp_path: Path) -> None:
    truth = loaded(load(case).with_joint("C3", damping=0.05), "platform", 0.15)
    ways = WAYS[1:] if case == "3-rrr" else WAYS  # whose three loops take the longest to close
    result = diagnosed(bench(tmp_path, case, maker, truth, seen=("platform_x", "platform_y"), ways=ways))
    found = sizes(result)
    assert set(found) == {("payload", "platform"), ("viscous_friction", "C3")}, result.statement
    assert found["payload", "platform"]["mass"].value == pytest.approx(0.06, rel=0.02)
    assert found["viscous_friction", "C3"]["damping"].value == pytest.approx(0.05, rel=0.02)
    assert result.gap.after == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.mujoco
def test_a_faint_zero_of_an_encoder_is_among_all_that_a_platform_s_legs_might_be(tmp_path: Path) -> None:
    """Some twenty lengths, pivots, clearances and zeros of its three legs move a platform as far, some less likely."""
    result = diagnosed(bench(tmp_path, "3-rrr", "exudyn", load("3-rrr"), {"A1": -3e-5}, ("platform_y",), WAYS[1:]))
    (effect,) = result.effects
    same = {(effect.name, effect.where), *((tie.name, tie.where) for tie in effect.ambiguous_with)}
    assert ("encoder_offset", "position_A1") in same, result.statement
    assert len(same) > 5


@pytest.mark.slow
@pytest.mark.exudyn
@pytest.mark.mujoco
def test_a_five_bar_that_lacks_nothing_has_no_gap(tmp_path: Path) -> None:
    result = diagnosed(bench(tmp_path, "five-bar", "exudyn", load("five-bar"), seen=("right-arm_x", "right-arm_y")))
    assert (result.verdict, result.effects) == ("no gap", ()), result.statement


# ---------------------------------------------------------------- by another program


def robot(folder: Path, mass: float, zero: float) -> Path:
    """measured.toml of the parallel robot, its platform of this mass (kg) in the nominal file, which reads M2 with this
    zero (rad).
    """
    text = (DATA / "nominal.toml").read_text(encoding="utf-8")
    (folder / "nominal.toml").write_text(text.replace("mass = 6.0", f"mass = {mass}"), encoding="utf-8")
    (folder / "run.csv").write_bytes((DATA / "run.csv").read_bytes())
    column = f'"position_M2 [rad]" = {{ signal = "position_M2", unit = "rad", offset = {zero!r} }}'
    run = '[[run]]\nname = "pick"\nfile = "run.csv"\ndrive = "measured"\n'
    path = folder / "measured.toml"
    path.write_text(f'mechanism = "nominal.toml"\n[columns]\n{column}\n{run}', encoding="utf-8")
    return path


@HERE
@pytest.mark.slow
@pytest.mark.mujoco
def test_a_robot_of_another_program_has_no_gap(tmp_path: Path) -> None:
    result = diagnosed(robot(tmp_path, 6.0, math.pi))
    assert (result.verdict, result.effects) == ("no gap", ()), result.statement
    assert any("near 2.50" in fault.text for fault in result.faults)  # a corner of its course is told
