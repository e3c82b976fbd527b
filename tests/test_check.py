"""Recorded results of any program, held against the analytic model: ``lc.check`` and ``compare check``.

The files are written from references in which the analytic side has no part: a pendulum's closed form, Lagrange
multipliers in maximal coordinates, an engine; or they come from a commercial program (MEASURED_DATA).
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkage_crosscheck as lc
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps, load
from commands import compare
from compare.faults import ArgumentError
from compare.recorded.errors import DataError
from compare.results.crosscheck import CrossCheck
from marks import slow
from multiplier_oracle import Oracle

FOLDER = os.environ.get("MEASURED_DATA", "")
REAL = pytest.mark.skipif(not FOLDER, reason="MEASURED_DATA is not set: the folder with adams-fourbar, adams-pendulum")
FOUR_BAR = load("crank-rocker").with_clearances({})
ARM = load("pendulum")
MOTOR = ARM.replace(name="driven pendulum", drive={"joint": "O", "speed": "measured"})
MASS, LENGTH, GRAVITY = 0.2355, 0.3, 9.81
INERTIA = MASS * (LENGTH**2 / 3 + (0.01**2) / 12)  # kg.m^2 about the pin


def pendulum(
    time: np.ndarray, theta: np.ndarray, omega: np.ndarray, alpha: np.ndarray, mass: float = 1.0
) -> dict[str, np.ndarray]:
    """A bar on a pin in closed form, of so many times the mass: signals by heading."""
    turn = np.exp(1j * theta)
    com = LENGTH / 2 * turn
    acceleration = (1j * alpha - omega**2) * com
    force = mass * MASS * (acceleration + 1j * GRAVITY)
    return {
        "time [s]": time,
        "crank_angle [rad]": theta,
        "pendulum_x [m]": com.real,
        "pendulum_y [m]": com.imag,
        "pendulum_angular_velocity [rad/s]": omega,
        "reaction_O_x [N]": force.real,
        "reaction_O_y [N]": force.imag,
        "drive_torque [N.m]": mass * (INERTIA * alpha + MASS * GRAVITY * LENGTH / 2 * np.cos(theta)),
    }


def swung(samples: int = 600, mass: float = 1.0) -> dict[str, np.ndarray]:
    """The pendulum behind a motor that swings and drifts for 3 s."""
    time = np.linspace(0.0, 3.0, samples)
    theta = 0.8 * np.sin(4 * time) + 0.3 * time**2
    omega, alpha = 3.2 * np.cos(4 * time) + 0.6 * time, -12.8 * np.sin(4 * time) + 0.6
    return pendulum(time, theta, omega, alpha, mass)


def written(path: Path, columns: Mapping[str, np.ndarray], digits: int = 12) -> Path:
    rows = [
        ",".join(columns),
        *(",".join(f"{v:.{digits}g}" for v in row) for row in zip(*columns.values(), strict=True)),
    ]
    path.write_text("\n".join(rows) + "\n")
    return path


def turning(m: Mechanism = FOUR_BAR, degrees: float = 2.0) -> dict[str, np.ndarray]:
    """A four-bar at the speed of its drive, by multipliers: signals by heading."""
    oracle = Oracle(m)
    theta, poses = (values[:: round(degrees / 2.0)] for values in oracle.walk(oracle.start + 2 * np.pi))
    found = oracle.solve(theta, poses, True)
    speed = m.speed or 1.0
    columns = {"time [s]": theta / speed, "crank_angle [deg]": np.degrees(theta)}
    for joint, force in found.forces.items():
        columns |= {f"reaction_{joint}_x [N]": force.real, f"reaction_{joint}_y [N]": force.imag}
    columns |= {f"{body}_x [mm]": 1e3 * place.real for body, place in found.places.items() if body != "ground"}
    columns |= {
        f"{body}_angle [rad]": angle for body, angle in found.angles.items() if body not in (m.driven, "ground")
    }
    return columns | {"drive_torque [N.m]": found.torque}


def worst(result: CrossCheck, simulator: str) -> dict[str, float]:
    """The largest difference of each recorded signal, over its peak in the run."""
    run = result.run(simulator)
    found = {}
    for name, values in run.simulated.items():
        if np.any(np.isfinite(values)):
            apart = np.abs(result.signals[name].apart(values, run.analytic[name]))
            scale = 1.0 if result.signals[name].wraps else np.nanmax(np.abs(run.analytic[name]))
            found[name] = float(np.nanmax(apart) / scale)
    return found


# ---------------------------------------------------------------- few digits, other units


@pytest.mark.parametrize("digits", [3, 4, 6])
def test_what_a_file_is_rounded_to_is_allowed(tmp_path: Path, digits: int) -> None:
    """Significant digits: the last of a force of 100 N is worth ten of those of 10 N."""
    result = lc.check(written(tmp_path / "short.csv", turning(), digits), FOUR_BAR)
    assert result.verdict == "agrees"


def test_a_crank_of_few_counts_is_where_its_time_says_and_that_is_said(tmp_path: Path) -> None:
    columns = turning()
    columns["crank_angle [deg]"] = 0.7 * np.floor(columns["crank_angle [deg]"] / 0.7 + 0.5)
    result = lc.check(written(tmp_path / "coarse.csv", columns), FOUR_BAR)
    assert result.verdict == "agrees"
    assert any("angles are rounded, by up to 0.3 deg" in text for text in result.warnings), result.warnings
    assert max(off for signal, off in worst(result, "coarse").items() if signal != "crank_angle") < 2e-3


def test_a_wrong_torque_is_found_in_a_file_of_three_digits(tmp_path: Path) -> None:
    columns = turning()
    columns["drive_torque [N.m]"] = 1.05 * columns["drive_torque [N.m]"]
    result = lc.check(written(tmp_path / "short.csv", columns, 3), FOUR_BAR)
    assert [d.signal for d in result.run("short").discrepancies if d.verdict == "disagrees"] == ["drive_torque"]


@pytest.mark.parametrize(
    ("column", "factor", "says"),
    [
        ("drive_torque [N.m]", 1e3, "drive_torque is 1000 times the analytic side's: it looks in newton millimetres"),
        ("drive_torque [N.m]", -1.0, "it looks of the other sign; say sign = -1 in a map"),
        ("reaction_B_x [N]", -1.0, "it looks of the other sign or is the force on the other body"),
        (
            "crank_angle [deg]",
            math.pi / 180,
            "evenly, but at 0.54831 rad/s where drive.speed = 31.4159: is its angle",
        ),
        ("time [s]", 1e3, "is its time in milliseconds, read as seconds?"),
    ],
)
def test_a_column_in_another_unit_is_told(tmp_path: Path, column: str, factor: float, says: str) -> None:
    columns = turning()
    columns[column] = factor * columns[column]
    result = lc.check(written(tmp_path / "odd.csv", columns), FOUR_BAR)
    assert result.verdict == "disagrees"
    assert [text for text in result.warnings if says in text], result.warnings


@pytest.mark.parametrize("given", [{}, [], 3, None, {"": "a.csv"}, {"x": 3}], ids=str)
def test_results_that_are_no_files_are_one_sentence(given: Any) -> None:
    with pytest.raises(ArgumentError) as said:
        lc.check(given, FOUR_BAR)
    assert len(str(said.value)) < 200
    assert "give" in str(said.value)


# ---------------------------------------------------------------- driven, on a course, released, at rest


def test_a_course_is_followed_exactly_where_it_is_dense(tmp_path: Path) -> None:
    result = lc.check(written(tmp_path / "other.csv", swung()), MOTOR)
    assert result.verdict == "agrees"
    assert max(worst(result, "other").values()) < 2e-6
    compared = {d.signal for d in result.run("other").discrepancies}
    assert {"reaction_O_angle", "reaction_O_magnitude", "drive_torque", "pendulum_x", "pendulum_y"} == compared


def test_a_wrong_mass_in_the_other_program_is_found(tmp_path: Path) -> None:
    """It must disagree: a check that cannot fail is none."""
    result = lc.check(written(tmp_path / "other.csv", swung(mass=1.01)), MOTOR)
    off = {d.signal: d.verdict for d in result.run("other").discrepancies}
    assert result.verdict == "disagrees"
    assert off["reaction_O_magnitude"] == off["drive_torque"] == "disagrees"
    assert off["pendulum_x"] == "agrees"


@pytest.mark.parametrize("samples", [20, 30, 40, 120, 400])
def test_a_coarse_course_says_how_exact_it_is(tmp_path: Path, samples: int) -> None:
    """What it allows on top covers the error that it makes; with a dense course nothing is said."""
    result = lc.check(written(tmp_path / "coarse.csv", swung(samples), digits=9), MOTOR)
    run = result.run("coarse")
    exact = swung(samples)
    error = np.abs(run.analytic["drive_torque"] - exact["drive_torque [N.m]"]).max() / INERTIA
    known = run.settings["acceleration_known_to"]
    assert isinstance(known, float)
    assert error < known
    assert result.verdict == "agrees"
    assert any("is recorded every" in text for text in result.warnings) == (samples < 100)


def test_a_wrong_mass_is_found_in_a_file_of_few_digits(tmp_path: Path) -> None:
    columns = swung(400, mass=1.02)
    rounded = {name: np.round(values, 4) for name, values in columns.items()}
    assert lc.check(written(tmp_path / "a.csv", rounded), MOTOR).verdict == "disagrees"
    good = {name: np.round(values, 4) for name, values in swung(400).items()}
    assert lc.check(written(tmp_path / "b.csv", good), MOTOR).verdict == "agrees"


@pytest.mark.parametrize("left_out", ["", "time [s]", "crank_angle [deg]"])
def test_a_crank_that_turns_evenly_needs_its_angle_or_its_time(tmp_path: Path, left_out: str) -> None:
    columns = {name: values for name, values in turning().items() if name != left_out}
    result = lc.check(written(tmp_path / "even.csv", columns), FOUR_BAR)
    assert result.verdict == "agrees"
    assert all(text.startswith("left out: ") for text in result.warnings)
    assert max(worst(result, "even").values()) < 1e-9
    assert not result.over_time


def test_a_crank_that_does_not_turn_as_its_drive_says_is_followed_and_that_is_said(tmp_path: Path) -> None:
    columns = turning()
    columns["time [s]"] = columns["time [s]"] * 1.02
    result = lc.check(written(tmp_path / "slow.csv", columns), FOUR_BAR)
    assert any("turns evenly, but at" in text and "rad/s where drive.speed = " in text for text in result.warnings)
    assert result.verdict == "disagrees"


def test_rows_at_rest_are_equilibria(tmp_path: Path) -> None:
    m = FOUR_BAR.replace(gravity=(0.0, -9.81))
    oracle = Oracle(m)
    theta, poses = oracle.walk(oracle.start + 2 * np.pi)
    found = oracle.solve(theta, poses, False)
    columns = {"crank_angle [deg]": np.degrees(theta), "drive_torque [N.mm]": 1e3 * found.torque}
    columns |= {"reaction_B_x [N]": found.forces["B"].real, "reaction_B_y [N]": found.forces["B"].imag}
    result = lc.check(written(tmp_path / "rest.csv", columns), m, motion="static")
    assert result.verdict == "agrees"
    assert max(worst(result, "rest").values()) < 1e-9


def released(start: float, rate: float) -> dict[str, np.ndarray]:
    time = np.linspace(0.5, 2.5, 401)

    def motion(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -MASS * GRAVITY * LENGTH / 2 * np.cos(state[0]) / INERTIA]

    theta, omega = solve_ivp(motion, (0.5, 2.5), [start, rate], "DOP853", time, rtol=1e-12, atol=1e-12).y
    columns = pendulum(time, theta, omega, -MASS * GRAVITY * LENGTH / 2 * np.cos(theta) / INERTIA)
    return {name: values for name, values in columns.items() if name != "drive_torque [N.m]"}


def test_a_released_linkage_begins_where_the_file_begins(tmp_path: Path) -> None:
    result = lc.check(written(tmp_path / "free.csv", released(-0.4, 2.0)), ARM)
    assert result.verdict == "agrees"
    assert max(worst(result, "free").values()) < 1e-7
    assert "pendulum_angle" in {d.signal for d in result.run("free").discrepancies}


def test_a_pin_in_contact_is_judged_with_its_clearance(tmp_path: Path) -> None:
    m = load("paper").with_clearances({"B": 1e-4})
    angles = np.radians(np.arange(20.0, 161.0, 5.0))
    made = lc.crosscheck(m, "mujoco", joint_model="contact", angles=angles).run("mujoco", "contact")
    columns = {"crank_angle [rad]": angles}
    for name, unit in (("reaction_B_x", "N"), ("reaction_B_y", "N"), ("clearance_B_x", "m"), ("clearance_B_y", "m")):
        columns[f"{name} [{unit}]"] = made.simulated[name]
    path = written(tmp_path / "contact.csv", columns)
    result = lc.check(path, m)
    run = result.run("contact", "contact")
    assert (result.verdict, run.clearance) == ("agrees", {"B": 1e-4})
    assert {d.signal for d in run.discrepancies} == {
        "reaction_B_angle", "reaction_B_magnitude", "clearance_B_x", "clearance_B_y",
    }  # fmt: skip
    assert lc.check(path, m, clearance={"B": 2e-4}).verdict == "disagrees"


# ---------------------------------------------------------------- several files, engines beside


def test_engines_beside_and_a_file_that_is_wrong_stands_apart(tmp_path: Path) -> None:
    right = written(tmp_path / "right.csv", swung(150))
    wrong = written(tmp_path / "wrong.csv", swung(150, mass=1.05))
    result = lc.check([right, wrong], MOTOR, simulators="mujoco")
    assert [run.simulator.name for run in result.runs] == ["right", "wrong", "mujoco"]
    assert [run.verdict for run in result.runs] == ["agrees", "disagrees", "agrees"]
    assert result.odd_one_out == "wrong"
    assert "pendulum_x" in {d.signal for d in result.run("mujoco").discrepancies}


def test_tables_in_other_units_have_the_same_samples_and_of_other_rows_it_is_said(tmp_path: Path) -> None:
    """What minutes of nine digits and revolutions are rounded to parts no two programs."""
    right, wrong = swung(150), swung(150, mass=1.05)
    wrong["time [min]"] = wrong.pop("time [s]") / 60
    angle = next(name for name in wrong if "angle" in name)
    wrong["crank_angle [rev]"] = wrong.pop(angle) / (2 * np.pi if "rad" in angle else 360)
    files = [written(tmp_path / "right.csv", right), written(tmp_path / "wrong.csv", wrong, 9)]
    assert lc.check(files, MOTOR, simulators="mujoco").odd_one_out == "wrong"
    halved = written(tmp_path / "half.csv", {name: values[::2] for name, values in wrong.items()})
    result = lc.check([files[0], halved], MOTOR, simulators="mujoco")
    assert result.odd_one_out is None
    assert any(text.startswith("half: has other samples than right") for text in result.warnings)


def test_a_table_of_a_few_equilibria_is_checked(tmp_path: Path) -> None:
    columns = {name: values[:: len(values) // 3] for name, values in turning().items() if not name.startswith("time")}
    columns = {name: values for name, values in columns.items() if "angle" in name}
    assert lc.check(written(tmp_path / "few.csv", columns), FOUR_BAR, motion="static").verdict == "agrees"


def test_a_table_of_equilibria_that_is_taken_as_driven_is_told(tmp_path: Path) -> None:
    m = FOUR_BAR.replace(loads=[{"body": "follower", "point": "B", "force": (40.0, 10.0)}])
    run = lc.simulate(m, "mujoco", motion="static", angles=np.radians(np.arange(10.0, 360.0, 25.0)))
    columns = {"crank_angle [rad]": run.crank_angle, "drive_torque [N.m]": run.signals["drive_torque"]}
    path = written(tmp_path / "still.csv", columns)
    result = lc.check(path, m)
    assert result.verdict == "disagrees"
    assert "still: agrees with the linkage at rest; say --motion static" in result.warnings
    assert lc.check(path, m, motion="static").verdict == "agrees"


def test_files_are_called_as_the_mapping_says_or_by_their_folders(tmp_path: Path) -> None:
    for program in ("adams", "simscape"):
        (tmp_path / program).mkdir()
        written(tmp_path / program / "run.csv", swung(100))
    files = [tmp_path / "adams" / "run.csv", tmp_path / "simscape" / "run.csv"]
    assert [run.simulator.name for run in lc.check(files, MOTOR).runs] == ["adams/run", "simscape/run"]
    named = lc.check({"Adams 2024": files[0], "Simscape": files[1]}, MOTOR)
    assert [run.simulator.name for run in named.runs] == ["Adams 2024", "Simscape"]


@pytest.mark.parametrize("kind", ["angles", *slow("released")])
def test_engines_simulate_what_the_file_has(tmp_path: Path, kind: str) -> None:
    columns, m = (turning(degrees=10.0), FOUR_BAR) if kind == "angles" else (released(-0.4, 2.0), ARM)
    result = lc.check(written(tmp_path / "a.csv", columns), m, simulators="mujoco,exudyn")
    assert result.verdict == "agrees", result.runs
    assert result.words == "all agree within the tolerances"


# ---------------------------------------------------------------- another program, its own headings


@REAL
def test_adams_four_bar() -> None:
    """MSC Adams' torque over 2000 samples, the ends included: within 0.02 % of its peak."""
    folder = Path(FOLDER) / "adams-fourbar"
    result = lc.check(folder / "run.csv", folder / "nominal.toml")
    assert result.verdict == "agrees"
    assert result.run("run").crank_angle.size == 2000
    assert worst(result, "run")["drive_torque"] < 2e-4


@REAL
def test_adams_pendulum() -> None:
    """MSC Adams' released pendulum: positions, velocities and reactions within 0.02 % of each peak."""
    folder = Path(FOLDER) / "adams-pendulum"
    result = lc.check(folder / "run.csv", folder / "nominal.toml")
    off = worst(result, "run")
    assert result.verdict == "agrees"
    assert set(off) >= {"arm_x", "arm_y", "arm_angle", "arm_angular_velocity", "reaction_O_x", "reaction_O_y"}
    assert max(share for name, share in off.items() if name != "reaction_O_angle") < 2e-4


@REAL
@pytest.mark.slow
@pytest.mark.parametrize("case", ["adams-fourbar", "adams-pendulum"])
def test_every_engine_agrees_with_adams(case: str) -> None:
    folder = Path(FOLDER) / case
    result = lc.check(folder / "run.csv", folder / "nominal.toml", simulators="all")
    assert result.verdict == "agrees"
    assert result.odd_one_out is None


def test_a_map_tells_what_the_columns_are(tmp_path: Path) -> None:
    columns = swung(100)
    own = {
        "Time": 1e3 * columns["time [s]"],
        "MOTION_1": -np.degrees(columns["crank_angle [rad]"]),
        "JOINT_1.FX": -columns["reaction_O_x [N]"],
        "JOINT_1.FY": -columns["reaction_O_y [N]"],
        "cpu": columns["time [s]"],
    }
    (tmp_path / "map.toml").write_text(
        '[columns]\n"Time" = { signal = "time", unit = "ms" }\n'
        '"MOTION_1" = { signal = "crank_angle", unit = "deg", sign = -1 }\n'
        '"JOINT_1.FX" = { signal = "reaction_O_x", unit = "N", sign = -1 }\n'
        '"JOINT_1.FY" = { signal = "reaction_O_y", unit = "N", sign = -1 }\n"cpu" = "ignore"\n'
    )
    result = lc.check(written(tmp_path / "adams.csv", own), MOTOR, map=tmp_path / "map.toml")
    assert result.verdict == "agrees"
    assert set(worst(result, "adams")) >= {"reaction_O_x", "reaction_O_angle"}


# ---------------------------------------------------------------- the command


@pytest.fixture
def case(tmp_path: Path) -> Path:
    path = tmp_path / "case.toml"
    path.write_text(dumps(MOTOR))
    return path


def test_the_command_writes_what_a_cross_check_writes(tmp_path: Path, case: Path) -> None:
    written(tmp_path / "good.csv", swung(120))
    ended = compare("check", "good.csv", "--case", str(case), cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    folder = tmp_path / "reports" / "driven-pendulum-good"
    assert {"result.json", "report.html", "report.md", "junit.xml", "signals.csv"} <= {p.name for p in folder.iterdir()}
    fields: dict[str, Any] = json.loads((folder / "result.json").read_text())
    assert fields["runs"][0]["simulator"] == {"name": "good", "version": "recorded"}
    assert "follows a recorded course" in (folder / "report.html").read_text()
    shown = compare("show", str(folder / "result.json"), "--signal", "drive_torque", "--at", "1.0", cwd=tmp_path)
    assert "file = good.csv" in shown.stdout
    written(tmp_path / "bad.csv", swung(120, mass=1.1))
    assert compare("check", "bad.csv", "--case", str(case), "--quiet", cwd=tmp_path).returncode == 1


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"crank_angle [rad]": 1, "drive_torque [N.m]": 1}, "has no column of time"),
        ({"time [s]": 1, "drive_torque [N.m]": 1}, "nothing else says where the crank is"),
        ({"time [s]": 1, "crank_angle [rad]": 1}, "has no signal beside 'pendulum_angle'"),
        ({"time [s]": 1, "crank_angle [rad]": 1, "torque [N.m]": 1}, "did you mean 'drive_torque'"),
        ({"time [s]": 1, "crank_angle [rad]": 1, "drive_torque": 1}, "no unit"),
        ({"time [s]": 1, "crank_angle [rad]": 1, "reaction_A_x [N]": 1}, "did you mean 'reaction_O_x'"),
    ],
)
def test_bad_files_are_one_sentence_and_nothing_is_written(
    tmp_path: Path, case: Path, columns: Mapping[str, float], says: str
) -> None:
    samples = np.linspace(0.0, 1.0, 40)
    written(tmp_path / "x.csv", dict.fromkeys(columns, samples))
    ended = compare("check", "x.csv", "--case", str(case), cwd=tmp_path)
    assert ended.returncode == 2
    assert ended.stderr.startswith("compare: x.csv: ")
    assert says in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert not (tmp_path / "reports").exists()


def test_an_angle_that_the_linkage_does_not_reach_names_the_file(tmp_path: Path) -> None:
    columns = {"crank_angle [deg]": np.linspace(0, 700, 60), "drive_torque [N.m]": np.ones(60)}
    with pytest.raises(DataError, match=r"x\.csv: .*check the angles, their unit and their sign"):
        lc.check(written(tmp_path / "x.csv", columns), load("paper").with_clearances({}))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[columns]\n"x" = 3', "columns"),
        ("[column]\n", "column is not a field; did you mean 'columns'"),
        ("columns = [", "cannot be read as TOML"),
        ('[columns]\n"nothing" = "ignore"', "columns.'nothing' is no heading of a data file"),
    ],
)
def test_a_bad_map_is_one_sentence(tmp_path: Path, case: Path, text: str, says: str) -> None:
    written(tmp_path / "x.csv", swung(50))
    (tmp_path / "map.toml").write_text(text)
    ended = compare("check", "x.csv", "--case", str(case), "--map", "map.toml", cwd=tmp_path)
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)
    assert says in ended.stderr


def test_results_have_baselines_like_any_engine(tmp_path: Path, case: Path) -> None:
    written(tmp_path / "adams.csv", swung(200))
    same = ("--case", str(case), "--results", "adams.csv", "--baselines", "kept")
    assert compare("baseline", "update", *same, cwd=tmp_path).returncode == 0
    assert (tmp_path / "kept" / "driven-pendulum-adams.toml").is_file()
    assert compare("baseline", "check", *same, cwd=tmp_path).returncode == 0
    written(tmp_path / "adams.csv", swung(200, mass=1.001))
    moved = compare("baseline", "check", *same, "--quiet", cwd=tmp_path)
    assert moved.returncode == 1
    written(tmp_path / "adams.csv", swung(100))
    other = compare("baseline", "check", *same, "--quiet", cwd=tmp_path)
    assert (other.returncode, other.stderr.count("\n")) == (2, 1)
    assert "is at other crank angles" in other.stderr or "another number of crank angles" in other.stderr
    unnamed = compare("baseline", "check", "--results", "adams.csv", cwd=tmp_path)
    assert (unnamed.returncode, unnamed.stderr.count("\n")) == (2, 1)
