"""Somebody's own MJCF file with several drives, or with what moves freely: against the analytic model by the command,
against a referee in maximal coordinates, and against equations of motion written elsewhere.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import linkage_crosscheck as lc
from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism import Drive, Mechanism
from analytic.mechanism.file import load
from asked import request_of
from compare.cli.app import app
from engine_checks import vector
from marks import slow, slow_but
from mjcf_files import PLAIN, written
from mjcf_several_files import ARM, FILES, FIVE_BAR, RK4, SLIDER_CRANK, STIFF, THREE_CRANKS, THREE_RPR, altered
from several_linkages import CASES, KNOTS, Knots, referee, splines, waved
from several_truths import G, agrees, close, double_pendulum, turned_round
from sim_models.engine import Motion, Trace, Unsupported, engine
from sim_models.mjcf.errors import MjcfError
from sim_models.mjcf.imported import imported

pytestmark = pytest.mark.mujoco
TIMES = np.linspace(0.0, 0.3, 16)
COMMAND = ("--times", "0:0.3:0.02")


def run(path: Path, m: Mechanism, courses: Knots, times: np.ndarray = TIMES, motion: Motion = "driven") -> Trace:
    return engine(f"mjcf:{path}").simulate(request_of(m, motion=motion, time=times, courses=courses))


def read(folder: Path, text: str) -> tuple[Path, Mechanism]:
    """A file in a folder, and the mechanism that it is."""
    path = written(folder, {"": text})
    return path, imported(path).mechanism


def imported_and_compared(path: Path, *more: str) -> tuple[int, dict]:
    """Exit status and result of a cross-check of a file with its import, by the commands."""
    case, out = path.parent / "case.toml", path.parent / "out"
    if not case.exists():
        done = CliRunner().invoke(app, ["import", str(path), "--out", str(case)])
        assert done.exit_code == 0, done.output
    asked = ["--case", str(case), "--simulator", f"mjcf:{path}", "--out", str(out), "--overwrite", "-q", *more]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code in (0, 1), done.output
    return done.exit_code, json.loads((out / "result.json").read_text(encoding="utf-8"))


def shares(result: dict) -> dict[str, float]:
    """By signal, how much of its tolerance the worst discrepancy takes."""
    (run,) = result["runs"]
    return {d["signal"]: abs(d["max"] or 0.0) / d["tolerance"] for d in run["discrepancies"]}


def as_table(path: Path, columns: dict[str, np.ndarray]) -> Path:
    """A CSV file of columns by heading."""
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, "%.17g", ",", header=",".join(columns), comments="")
    return path


# ---------------------------------------------------------------- by the commands

EFFORTS = {
    "five-bar": ("drive_torque_D", "drive_torque_E"),
    "3-rpr": ("drive_force_S1", "drive_force_S2", "drive_force_S3"),
    "arm": ("drive_torque_O", "drive_torque_K"),
}


@pytest.mark.parametrize("motion", ["driven", *slow("static")])
@pytest.mark.parametrize("name", slow_but(["five-bar", "arm"], FILES))
def test_a_file_agrees_with_its_import(name: str, motion: str, tmp_path: Path) -> None:
    path = written(tmp_path, {"": FILES[name]})
    status, result = imported_and_compared(path, *COMMAND, "--motion", motion)
    assert status == 0, shares(result)
    assert set(EFFORTS[name]) <= set(shares(result))
    assert max(shares(result).values()) < 0.2


BALL = '<geom type="sphere" size="0.005" mass="0.01" pos="0.08 0 0" contype="0" conaffinity="0"/>'
HEAVIER = {
    "five-bar": {'<site name="p1"': f'{BALL}<site name="p1"'},
    "3-rpr": {'mass="0.4"': 'mass="0.5"'},
    "arm": {'mass="0.9"': 'mass="0.95"'},
}


@pytest.mark.parametrize("name", slow_but(["five-bar"], FILES))
def test_a_mass_that_is_changed_in_the_file_is_found(name: str, tmp_path: Path) -> None:
    """Which agrees without the change, as the test above says."""
    path = written(tmp_path, {"": FILES[name]})
    done = CliRunner().invoke(app, ["import", str(path), "--out", str(path.parent / "case.toml")])
    assert done.exit_code == 0, done.output
    written(tmp_path, {"": altered(FILES[name], HEAVIER[name])})
    status, result = imported_and_compared(path, *COMMAND)
    assert status == 1
    assert result["verdict"] == "disagrees"
    assert min(shares(result)[effort] for effort in EFFORTS[name]) > 5.0
    assert max(share for name, share in shares(result).items() if not name.startswith(("reaction", "drive"))) < 1.0


def test_a_course_is_followed(tmp_path: Path) -> None:
    path, m = read(tmp_path, FIVE_BAR)
    courses = waved(m)
    table = {"time (s)": KNOTS} | {f"position_{n} (rad)": at for n, (_, at) in courses.items()}
    status, result = imported_and_compared(path, "--course", str(as_table(tmp_path / "course.csv", table)))
    assert status == 0, shares(result)
    close(np.array(result["runs"][0]["simulated"]["position_E"]), courses["E"][1], 1e-12)


def test_a_crank_follows_a_course_too(tmp_path: Path) -> None:
    option = '<option timestep="2e-4"/>' + STIFF
    path, m = read(tmp_path, altered(altered(PLAIN, {"<worldbody>": f"{option}<worldbody>"}), RK4))
    courses = waved(m)
    table = {"time (s)": KNOTS, "position_D (rad)": courses["D"][1]}
    status, result = imported_and_compared(path, "--course", str(as_table(tmp_path / "course.csv", table)))
    assert status == 0, shares(result)
    assert "drive_torque" in shares(result)


def test_a_slide_on_the_ground_is_driven(tmp_path: Path) -> None:
    """A slider-crank by its slide, whose axis is against the mechanism's, and with a damper."""
    path, m = read(tmp_path, SLIDER_CRANK)
    assert [(d.joint, d.speed) for d in m.drives] == [("S", -0.1)]
    trace = run(path, m, waved(m))
    agrees_with_the_referee(m, trace, waved(m), TIMES, 2e-5)
    assert lc.crosscheck(m, f"mjcf:{path}", times=TIMES).verdict == "agrees"


def test_a_platform_follows_a_path(tmp_path: Path) -> None:
    path, m = read(tmp_path, THREE_RPR)
    home = lc.analyse(m, times=np.array([0.0, 1e-3])).signals
    t = np.linspace(0.0, 0.3, 31)
    ways = {"x": ("m", 0.02 * np.sin(6 * t)), "y": ("m", 0.03 * t), "angle": ("rad", 0.1 * (1 - np.cos(5 * t)))}
    table = {"time (s)": t}
    table |= {f"platform_{n} ({unit})": home[f"platform_{n}"][0] + way for n, (unit, way) in ways.items()}
    status, result = imported_and_compared(path, "--path", str(as_table(tmp_path / "path.csv", table)))
    assert status == 0, shares(result)
    close(np.array(result["runs"][0]["simulated"]["platform_x"]), table["platform_x (m)"], 1e-6)


# ---------------------------------------------------------------- along courses, against the referee


def agrees_with_the_referee(m: Mechanism, trace: Trace, courses: Knots, times: np.ndarray, within: float) -> None:
    """Forces, moments and what motors do to a share of the largest one."""
    agrees(m, trace, *referee(m, courses, times), within=within, motors=within, rates=1e-4)
    for name in courses:
        close(trace.signals[f"position_{name}"], splines(courses)[name](times), 1e-11)


@pytest.mark.long_rows("3-rpr-RK4", "3-rpr-implicitfast", "3-rpr-Euler", "five-bar-RK4")
@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
@pytest.mark.parametrize("name", FILES)
def test_every_drive_follows_its_course_with_the_forces_of_the_referee(
    name: str, integrator: str, tmp_path: Path
) -> None:
    changes = RK4 if integrator == "RK4" else {"<option": f'<option integrator="{integrator}"'}
    path, m = read(tmp_path, altered(FILES[name], changes))
    courses = waved(m)
    trace = run(path, m, courses, TIMES)
    agrees_with_the_referee(m, trace, courses, TIMES, 2e-5 if integrator == "RK4" else 2e-4)
    close(trace.crank_angle, splines(courses)[m.drives[0].joint](TIMES), 1e-11)


@pytest.mark.long_rows("3-rpr-joints1")
@pytest.mark.parametrize(
    ("name", "joints"), [("five-bar", ("D", "A")), ("3-rpr", ("S1", "A2", "S2")), ("arm", ("O", "K"))]
)
def test_it_does_not_matter_which_body_of_a_joint_is_its_first(
    name: str, joints: tuple[str, ...], tmp_path: Path
) -> None:
    path, m = read(tmp_path, altered(FILES[name], RK4))
    m = turned_round(m, *joints)
    agrees_with_the_referee(m, run(path, m, waved(m)), waved(m), TIMES, 2e-5)


def test_a_run_does_not_depend_on_when_it_is_looked_at_nor_on_its_courses_clock(tmp_path: Path) -> None:
    path, m = read(tmp_path, FIVE_BAR)
    later = {name: (knots + 5.0, at) for name, (knots, at) in waved(m).items()}
    some = np.array([0.25, 0.0, 0.1004])
    few, many = run(path, m, later, some + 5.0), run(path, m, waved(m), np.sort(np.append(TIMES, some)))
    np.testing.assert_array_equal(few.time, some + 5.0)
    for name in ("drive_torque_D", "reaction_P_x", "left-arm_angle"):
        seen = [many.signals[name][list(np.sort(np.append(TIMES, some))).index(t)] for t in some]
        close(few.signals[name], np.array(seen), 1e-8 * np.abs(seen).max(), name)


@pytest.mark.long_rows("3-rpr")
@pytest.mark.parametrize("name", ["five-bar", "3-rpr"])
def test_soft_loops_start_without_a_transient(name: str, tmp_path: Path) -> None:
    """A row of MuJoCo's own gives way in 0.02 s: what a start leaves in it would bend forces in the first samples."""
    text = altered(FILES[name], {'<equality solref="8e-4 1" solimp="0.9999 0.9999 0.001 0.5 2"/>': ""})
    path, m = read(tmp_path, text)
    joint = "P" if name == "five-bar" else "C2"
    trace = run(path, m, waved(m), np.linspace(0.0, 0.1, 21))
    force = np.abs(vector(trace, f"reaction_{joint}"))
    close(np.diff(force, 3), np.zeros(18), 2e-3 * force.max())


# ---------------------------------------------------------------- what moves freely

HANGING = {'euler="0 0 0.5"': 'euler="0 0 -1.2"', 'euler="0 0 1.1"': 'euler="0 0 0.2"'}
LONG = np.linspace(0.0, 1.0, 21)


def test_a_double_pendulum_swings_as_lagrange_says_whatever_its_servos_are(tmp_path: Path) -> None:
    path, m = read(tmp_path, altered(ARM, RK4 | HANGING))
    m = m.replace(drives=(Drive(joint="O", speed="free"), Drive(joint="K", speed="free")))
    trace = run(path, m, {}, LONG)
    for name, angle in zip(("upper-arm", "forearm"), double_pendulum(m, LONG), strict=True):
        close(trace.signals[f"{name}_angle"], angle, 1e-7)
    assert not [name for name in trace.signals if name.startswith("drive")]
    np.testing.assert_array_equal(trace.crank_angle, trace.signals["upper-arm_angle"])


def test_without_motors_in_the_file_all_is_released(tmp_path: Path) -> None:
    text = altered(ARM, RK4 | HANGING)
    path = written(tmp_path, {"": text[: text.index("<actuator>")] + "</mujoco>"})
    status, result = imported_and_compared(path, "--times", "0:1:0.05")
    assert status == 0, shares(result)
    assert np.ptp(result["runs"][0]["simulated"]["position_K"]) > 0.3


def test_a_forearm_hangs_freely_on_a_driven_arm(tmp_path: Path) -> None:
    """What the motor gives is held to the analytic model; a servo of the elbow, a damper of 10 N.m.s/rad, is off."""
    path, m = read(tmp_path, altered(ARM, RK4 | HANGING))
    m = m.replace(drives=(Drive(joint="O", speed=2.0), Drive(joint="K", speed="free")))
    trace = run(path, m, {"O": (KNOTS, -1.2 + 2.0 * KNOTS)})
    right = double_pendulum(m, TIMES, 2.0)
    close(trace.signals["upper-arm_angle"], right[0], 1e-12)
    close(trace.signals["forearm_angle"], right[1], 1e-7)
    result = lc.crosscheck(m, f"mjcf:{path}", times=TIMES)
    assert result.verdict == "agrees"
    assert {"drive_torque"} <= {d.signal for d in result.runs[0].discrepancies}


def test_an_acrobot_s_shoulder_swings_as_its_elbow_is_driven(tmp_path: Path) -> None:
    path = written(tmp_path, {"": altered(ARM, RK4 | HANGING | {'<velocity joint="O" kv="10"/>': "", "2 1.5": "2"})})
    status, result = imported_and_compared(path, *COMMAND)
    assert status == 0, shares(result)
    assert {"upper-arm_angle", "drive_torque"} <= set(shares(result))
    assert np.ptp(result["runs"][0]["simulated"]["position_O"]) > 0.05


def test_loops_with_one_drive_too_few_move_as_the_analytic_model_says(tmp_path: Path) -> None:
    path, m = read(tmp_path, altered(FIVE_BAR, RK4))
    m = m.replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="E", speed="free")))
    result = lc.crosscheck(m, f"mjcf:{path}", times=np.linspace(0.0, 0.04, 9))
    assert result.verdict == "agrees", [(d.signal, d.max, d.tolerance) for d in result.runs[0].discrepancies]
    assert np.ptp(result.runs[0].simulated["position_E"]) > 0.05


# ---------------------------------------------------------------- what motors give


def test_held_at_rest_an_arm_s_motors_carry_its_weight(tmp_path: Path) -> None:
    path, m = read(tmp_path, ARM)
    trace = run(path, m, waved(m), motion="static")
    upper, fore = (trace.signals[f"{name}_angle"] for name in ("upper-arm", "forearm"))
    elbow = 0.9 * G * 0.19 * np.cos(fore)
    close(trace.signals["drive_torque_K"], elbow, 1e-9)
    close(trace.signals["drive_torque_O"], elbow + (0.8 * 0.13 + 0.9 * 0.3) * G * np.cos(upper), 1e-9)


def test_an_armature_in_the_elbow_is_found_in_what_its_motor_gives_and_nowhere_else(tmp_path: Path) -> None:
    plain, m = read(tmp_path, altered(ARM, RK4))
    without = run(plain, m, waved(m))
    path, _ = read(tmp_path, altered(ARM, RK4 | {'axis="0 0 -1"': 'axis="0 0 -1" armature="0.01"'}))
    trace = run(path, m, waved(m))
    more = trace.signals["drive_torque_K"] - without.signals["drive_torque_K"]
    close(more, 0.01 * splines(waved(m))["K"](TIMES, 2), 1e-6)
    close(trace.signals["drive_torque_O"], without.signals["drive_torque_O"], 1e-6)


def test_a_linkage_held_more_than_once_moves_and_its_motor_carries_it(tmp_path: Path) -> None:
    """Three cranks on a coupler: reactions are not determined, the drive's torque is."""
    path = written(tmp_path, {"": THREE_CRANKS})
    status, result = imported_and_compared(path, "--angles", "30:150:10")
    assert status == 0, shares(result)
    assert "drive_torque" in shares(result)
    assert not [signal for signal in shares(result) if signal.startswith("reaction")]


def test_an_export_of_three_cranks_that_carry_a_platform_agrees(tmp_path: Path) -> None:
    lc.export("3-rrr", "mujoco", folder=tmp_path / "out", times=TIMES[:3])
    result = lc.crosscheck("3-rrr", f"mjcf:{tmp_path / 'out' / 'model.xml'}", times=TIMES)
    assert result.verdict == "agrees", [(d.signal, d.max, d.tolerance) for d in result.runs[0].discrepancies]


# ---------------------------------------------------------------- springs between points

SPRING = (
    '<spatial name="t" stiffness="40" damping="2" springlength="0.1"><site site="wall"/><site site="hand"/></spatial>'
)
SITES = {
    "<worldbody>": '<worldbody><site name="wall" pos="-0.2 0.1 0"/>',
    'diaginertia="6e-3 6e-3 6e-3"/>': 'diaginertia="6e-3 6e-3 6e-3"/><site name="hand" pos="0.25 0.02 0"/>',
}


def with_tendon(tendon: str) -> str:
    """The arm with a tendon from the wall to its hand."""
    return altered(ARM, RK4 | SITES | {"<actuator>": f"<tendon>{tendon}</tendon><actuator>"})


def test_a_spring_between_points_is_read_and_pulls(tmp_path: Path) -> None:
    path, m = read(tmp_path, with_tendon(SPRING))
    (spring,) = m.springs
    assert (spring.bodies, spring.stiffness, spring.length, spring.damping) == (("ground", "forearm"), 40.0, 0.1, 2.0)
    assert [m.body(body).point(point) for body, point in spring.ends] == [-0.2 + 0.1j, 0.25 + 0.02j]
    trace = run(path, m, waved(m))
    agrees_with_the_referee(m, trace, waved(m), TIMES, 2e-5)
    without = run(path, m.replace(springs=()), waved(m))
    np.testing.assert_array_equal(without.signals["drive_torque_O"], trace.signals["drive_torque_O"])
    changes: list[tuple[Motion, dict[str, float]]] = [("driven", {"damping": 4.0}), ("static", {"stiffness": 41.0})]
    for motion, off in changes:
        assert lc.crosscheck(m, f"mjcf:{path}", times=TIMES, motion=motion).verdict == "agrees"
        other = m.replace(springs=(spring.model_copy(update=off),))
        assert lc.crosscheck(other, f"mjcf:{path}", times=TIMES, motion=motion).verdict == "disagrees"


@pytest.mark.parametrize("name", ["five-bar", *slow("3-rpr")])
def test_springs_survive_export_and_import(name: str, tmp_path: Path) -> None:
    m = CASES[f"{name} with springs"]
    lc.export(m, "mujoco", folder=tmp_path / "out", times=TIMES[:3])
    path = tmp_path / "out" / "model.xml"
    (spring,), (found,) = m.springs, imported(path).mechanism.springs
    assert found.model_copy(update={"points": spring.points}) == spring
    for read, mine in zip(found.ends, spring.ends, strict=True):
        assert imported(path).mechanism.body(read[0]).point(read[1]) == pytest.approx(m.body(mine[0]).point(mine[1]))
    result = lc.crosscheck(m, f"mjcf:{path}", times=TIMES)
    assert result.verdict == "agrees", [(d.signal, d.max, d.tolerance) for d in result.runs[0].discrepancies]


OTHER_TENDONS = {
    "slack": SPRING.replace('"0.1"', '"0 0.1"'),
    "dry": SPRING.replace("damping", "frictionloss"),
    "over three sites": SPRING.replace("<site", '<site site="hand2"/><site', 1),
    "out of the plane": SPRING.replace('"wall"', '"above"'),
}


@pytest.mark.parametrize("other", OTHER_TENDONS)
def test_a_tendon_that_is_no_spring_between_points_is_refused(other: str, tmp_path: Path) -> None:
    more = '<site name="above" pos="-0.2 0.1 0.1"/><site name="hand2" pos="0.3 0.1 0"/>'
    path = written(tmp_path, {"": altered(with_tendon(OTHER_TENDONS[other]), {"<worldbody>": f"<worldbody>{more}"})})
    with pytest.raises(MjcfError, match=r"tendon 't' .* nor a spring between two points of the plane"):
        imported(path)
    with pytest.raises(Unsupported, match="tendon 't' pulls between bodies"):
        run(path, imported(written(tmp_path / "plain", {"": ARM})).mechanism, waved(load("2r-arm")))


def test_springs_that_are_disabled_do_nothing(tmp_path: Path) -> None:
    path, m = read(
        tmp_path, altered(with_tendon(SPRING), {"/>\n  <worldbody": '><flag spring="disable"/></option>\n  <worldbody'})
    )
    (spring,) = m.springs
    assert (spring.stiffness, spring.damping) == (0.0, 2.0)
    assert lc.crosscheck(m, f"mjcf:{path}", times=TIMES).verdict == "agrees"


# ---------------------------------------------------------------- what is refused


def test_courses_that_cannot_be_followed_are_the_requests_fault(tmp_path: Path) -> None:
    path, m = read(tmp_path, THREE_RPR)
    courses = waved(m)
    with pytest.raises(AssemblyError, match="cannot be reached"):
        run(path, m, {**courses, "S1": (KNOTS, courses["S1"][1] + KNOTS)}, KNOTS)


def test_a_drive_s_joint_that_is_a_connect_is_refused_and_a_free_one_s_is_not(tmp_path: Path) -> None:
    text = altered(FIVE_BAR, RK4)
    path, m = read(tmp_path, text)
    m = m.replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="P", speed=1.0)))
    with pytest.raises(Unsupported, match="the drive's joint 'P' is a connect there"):
        lc.crosscheck(m, f"mjcf:{path}", times=TIMES[:3])
    path = written(tmp_path, {"": altered(text, {'<velocity joint="E" kv="10"/>': "", "2 1": "2"})})
    m = m.replace(drives=(Drive(joint="D", speed=2.0), Drive(joint="P", speed="free")))
    assert lc.crosscheck(m, f"mjcf:{path}", times=np.linspace(0.0, 0.04, 9)).verdict == "agrees"


def test_another_linkage_of_several_drives_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, {"": altered(FIVE_BAR, {'pos="0.12 0 0"': 'pos="0.121 0 0"'})})
    with pytest.raises(Unsupported, match=r"D and E are 0\.121 m apart, and 0\.12 m in the case five-bar"):
        lc.crosscheck("five-bar", f"mjcf:{path}")
