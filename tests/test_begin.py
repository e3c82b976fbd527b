"""From logger files of bad habits to a measured.toml, the page of the data, and a diagnosis."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism.file import dumps, load
from analytic.paper.kinetostatics import kinetostatics
from commands import ROOT, compare
from compare.diagnose.data.measured import load_measured
from compare.recorded.errors import DataError
from compare.recorded.guess import guess

RIG = ROOT / "docs" / "example-rig"
NOMINAL = str(RIG / "nominal.toml")


def habits(folder: Path) -> list[str]:
    """Two runs of the example rig, as a logger in an office with decimal commas writes them."""
    names = []
    for run, pre in zip(load_measured(RIG).runs[:2], ("Logger 5\nStart;12:30\n", ""), strict=True):
        columns = {
            "Zeit (ms)": 1e3 * run.time,
            "Phi_deg": np.degrees(run.channels["crank_angle"].values) % 360,
            "Drehmoment": run.channels["drive_torque"].values,
            "Weg X": 1e3 * run.channels["follower_x"].values,
            "Temp": 20.0 + 0.1 * np.sin(0.1 * np.arange(run.time.size)),
            "Winkel F": -np.degrees(run.channels["follower_angle"].values),
        }
        rows = [";".join(f"{v:.8g}".replace(".", ",") for v in row) for row in zip(*columns.values(), strict=True)]
        names.append(f"{run.name} run.csv")
        (folder / names[-1]).write_text(pre + ";".join(columns) + "\n" + "\n".join(rows) + "\n")
    return names


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The folder with a measured.toml that was guessed, and its fields."""
    folder = tmp_path_factory.mktemp("begun")
    ended = compare("diagnose", "--init", *habits(folder), "--case", NOMINAL, cwd=folder)
    assert ended.returncode == 0, ended.stderr
    assert "5 guessed" in ended.stderr
    return folder, tomllib.loads((folder / "measured.toml").read_text())


def test_columns_are_matched_to_signals(begun: tuple[Path, dict[str, Any]]) -> None:
    """The torque, a position and an angle by the nominal model alone: their headings say nothing."""
    assert begun[1]["columns"] == {
        "Zeit (ms)": {"signal": "time", "unit": "ms"},
        "Phi_deg": {"signal": "crank_angle", "unit": "deg"},
        "Drehmoment": {"signal": "drive_torque", "unit": "N.m"},
        "Weg X": {"signal": "follower_x", "unit": "mm"},
        "Temp": "ignore",
        "Winkel F": {"signal": "follower_angle", "unit": "deg", "sign": -1},
    }


def test_speeds_and_directions_are_guessed(begun: tuple[Path, dict[str, Any]]) -> None:
    runs = begun[1]["run"]
    assert [run["name"] for run in runs] == ["forward run", "reverse run"]
    assert [run["drive_speed"] for run in runs] == pytest.approx([6.0, -12.0], rel=1e-4)
    assert [run["drive_angle"] for run in runs] == pytest.approx([0.0, 0.0], abs=1e-3)


def test_what_is_written_can_be_read_and_says_what_was_guessed(begun: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = begun
    text = (folder / "measured.toml").read_text()
    assert "guessed: 99" in text
    assert "# noise = { crank_angle = " in text
    found = load_measured(folder / "measured.toml")
    kept = load_measured(RIG).runs[0].channels["follower_angle"].values
    np.testing.assert_allclose(found.runs[0].channels["follower_angle"].values, kept, atol=1e-6)


def test_the_data_are_shown_and_nothing_is_diagnosed(begun: tuple[Path, dict[str, Any]]) -> None:
    folder, _ = begun
    ended = compare("diagnose", "measured.toml", "--check", "--out", "seen", cwd=folder)
    assert ended.returncode == 0, ended.stderr
    page = (folder / "seen" / "data.html").read_text()
    for words in ("What would show", "clearance in joint B", "position x of follower", "decimal commas", "<svg"):
        assert words in page
    fields = json.loads((folder / "seen" / "data.json").read_text())
    assert [run["drive"] for run in fields["runs"]] == ["speed", "speed"]
    assert fields["runs"][0]["signals"]["follower_angle"]["gap"] > 5


@pytest.mark.slow
@pytest.mark.mujoco
def test_the_diagnosis_of_guessed_files_finds_what_is_hidden(begun: tuple[Path, dict[str, Any]]) -> None:
    found = lc.diagnose(begun[0] / "measured.toml", others=False)
    assert found.verdict == "explained"
    assert {(e.name, e.where) for e in found.effects} == {("joint_clearance", "B"), ("viscous_friction", "E")}


def test_a_measured_toml_is_not_written_over(begun: tuple[Path, dict[str, Any]]) -> None:
    folder, fields = begun
    ended = compare("diagnose", "--init", "forward run.csv", "--case", NOMINAL, cwd=folder)
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)
    assert "is there already" in ended.stderr
    assert tomllib.loads((folder / "measured.toml").read_text()) == fields


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--init", "x.csv"], "give the nominal mechanism with --case"),
        (["--init", "none.csv", "--case", "paper"], "none.csv: no such file"),
        (["--init", "x.csv", "--case", "paper"], "has no column of time"),
        (["--init", "x.csv", "--case", "papper"], "did you mean 'paper'"),
        (["--init", "x.csv", "--case", "paper", "--adopt"], "--adopt: has no part in --init"),
        (["measured.toml", "--case", "paper"], "--case paper: belongs to --init"),
        (["a.toml", "b.toml"], "one measured.toml at a time"),
        (["measured.toml", "--check", "--budget", "3"], "--budget: has no part in --check"),
    ],
)
def test_what_cannot_be_begun_is_one_sentence(tmp_path: Path, arguments: list[str], says: str) -> None:
    (tmp_path / "x.csv").write_text("a,b\n" + "".join(f"{np.sin(k):.6f},{np.cos(k):.6f}\n" for k in range(40)))
    ended = compare("diagnose", *arguments, cwd=tmp_path)
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1), ended.stderr
    assert says in ended.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.csv"]


def test_counts_that_wrap_tell_their_turn_and_a_crank_that_swings_is_followed(tmp_path: Path) -> None:
    m = load("crank-rocker")
    (tmp_path / "rig.toml").write_text(dumps(m))
    time = np.arange(400) * 5e-3
    even, swinging = 6.0 * time, 2.0 + 0.5 * np.sin(6 * time)
    for name, angle in (("even", even), ("swing", swinging)):
        counts = np.floor(angle / (2 * np.pi) * 4096) % 4096
        signals = lc.analyse(m, angles=angle[::10]).signals if name == "even" else None
        extra = np.interp(time, time[::10], signals["follower_x"]) if signals else np.cos(time)
        rows = "".join(f"{t:.4f}\t{c:.0f}\t{x:.6f}\n" for t, c, x in zip(time, counts, extra, strict=True))
        (tmp_path / f"{name}.txt").write_text("t\tencoder\tpot\n" + rows)
    ended = compare("diagnose", "--init", "even.txt", "swing.txt", "--case", "rig.toml", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    fields = tomllib.loads((tmp_path / "measured.toml").read_text())
    assert fields["columns"]["encoder"]["scale"] == pytest.approx(360 / 4096)
    assert fields["run"][0]["drive_speed"] == pytest.approx(6.0, rel=1e-3)


TURN = np.linspace(0.0, 6.0, 500)  # s


def rows_of(path: Path, columns: dict[str, Any]) -> Path:
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    path.write_text("\n".join(lines) + "\n")
    return path


def cranked(theta: np.ndarray) -> np.ndarray:
    """The follower's angle (deg) of the crank-rocker at crank angles, to a hundredth."""
    moved = kinematics(Assembly(load("crank-rocker")), theta, 0.0, 0.0)
    return np.round(np.degrees(np.unwrap(moved.angle("follower"))), 2)


@pytest.mark.long_rows("backward", "radians")
@pytest.mark.parametrize(
    ("enc", "expected"),
    [
        (lambda theta: np.round(theta, 4), {"unit": "rad"}),
        (lambda theta: np.floor(theta / (2 * np.pi) * 4096).astype(int) % 4096, {"unit": "deg", "scale": 360 / 4096}),
        (lambda theta: np.round(-theta, 4), {"unit": "rad", "sign": -1}),
        (
            lambda theta: np.floor(1 - theta / (2 * np.pi) * 4096).astype(int) % 4096,
            {"unit": "deg", "scale": 360 / 4096, "sign": -1},
        ),
        pytest.param(
            lambda theta: np.round(np.degrees(theta) + 100, 2),
            {"unit": "deg", "offset": pytest.approx(-100, abs=0.1)},
            marks=pytest.mark.slow,
        ),
    ],
    ids=["radians", "counts", "backward", "counts backward", "another zero"],
)
def test_an_encoder_is_read_so_that_the_other_columns_fit(tmp_path: Path, enc: Any, expected: dict[str, Any]) -> None:
    theta = 0.3 + 5.0 * TURN
    path = rows_of(tmp_path / "a.csv", {"t_ms": 1e3 * TURN, "enc": enc(theta), "follower_angle_deg": cranked(theta)})
    found = tomllib.loads(lc.begin(path, "crank-rocker").text)
    assert found["columns"]["enc"] == {"signal": "crank_angle"} | expected
    assert found["run"][0]["drive_speed"] == pytest.approx(5.0, rel=1e-3)
    assert np.exp(1j * found["run"][0]["drive_angle"]) == pytest.approx(np.exp(0.3j), abs=3e-3)


def test_a_slider_crank_in_revolutions_and_volts_of_another_zero(tmp_path: Path) -> None:
    """Nothing but the motion of the slider says what 'Geber [U]' counts and from where, and what a volt is."""
    theta = 0.4 + 12.0 * TURN[:250]
    place = kinetostatics(kinematics(Assembly(load("slider-crank")), theta, 0.0, 0.0)).signals()["slider_x"]
    reach = place.max() - place.min()
    volts = 7 * (place - place.min()) / reach
    first = {"zeit_h": TURN[:250] / 3600, "Geber [U]": theta / (2 * np.pi) + 0.3, "Weg [V]": np.round(volts, 4)}
    second = {"zeit_h": TURN[:250] / 3600, "crank_angle [rad]": theta, "Weg [V]": TURN[:250] % 0.7}
    paths = [rows_of(tmp_path / "b.csv", second), rows_of(tmp_path / "a.csv", first)]
    found = tomllib.loads(lc.begin(paths, "slider-crank").text)["columns"]
    assert found["zeit_h"] == {"signal": "time", "unit": "h"}
    assert found["Geber [U]"] == {"signal": "crank_angle", "unit": "rev", "offset": pytest.approx(-0.3, abs=1e-3)}
    assert found["Weg [V]"] == {  # as the file says in which it can be told
        "signal": "slider_x",
        "unit": "m",
        "scale": pytest.approx(reach / 7, rel=1e-3),
        "offset": pytest.approx(place.min(), rel=1e-3),
    }


@pytest.mark.long_rows("x-looks of the other sign: .* a diagnosis refuses it")
@pytest.mark.parametrize(
    ("axes", "text"),
    [
        ("xy", "is about -1 times its prediction: is the load cell mounted upside down"),
        ("x", "looks of the other sign: .* a diagnosis refuses it"),  # no cell is mounted so
    ],
)
def test_a_load_cell_upside_down_is_asked_for(tmp_path: Path, axes: str, text: str) -> None:
    shutil.copytree(RIG, tmp_path / "rig")
    said = (RIG / "measured.toml").read_text()
    theta, rng = np.linspace(0.2, 12.0, 300), np.random.default_rng(3)
    signals = kinetostatics(kinematics(Assembly(load(NOMINAL)), theta, 6.0, 0.0)).signals()
    columns = {"time [s]": (theta - 0.2) / 6.0, "crank_angle [rad]": theta}
    for axis in axes:
        force = signals[f"reaction_A_{axis}"]
        columns[f"reaction_A_{axis} [N]"] = -force + 0.01 * np.std(force) * rng.standard_normal(force.size)
    rows_of(tmp_path / "rig" / "up.csv", columns)
    run = '[[run]]\nname = "up"\nfile = "up.csv"\ndrive_speed = 6.0\ndrive_angle = 0.2\n'
    (tmp_path / "rig" / "measured.toml").write_text(said[: said.index("[[run]]")] + run)
    faults = [fault for fault in lc.preview(tmp_path / "rig").faults if fault.kind == "sign"]
    assert len(faults) == len(axes)
    assert all(re.search(text, fault.text) for fault in faults)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(24))
def test_random_files_of_a_four_bar_are_read_as_they_were_written(tmp_path: Path, seed: int) -> None:
    """Encoders of any unit, direction and zero beside a torque that is wrong, a drifting temperature and noise."""
    rng = np.random.default_rng(seed)
    m, samples = load("crank-rocker"), int(rng.integers(150, 800))
    speed, turns = rng.uniform(3, 30) * rng.choice([-1, 1]), rng.choice([0.6, 1.2, 3.0])
    time = np.linspace(0, turns * 2 * np.pi / abs(speed), samples)
    theta = rng.uniform(0, 6) + speed * time + rng.choice([0.0, 0.1]) * np.sin(54 * time / time[-1])
    zero, sign = rng.choice([0.0, rng.uniform(-3, 3)]), rng.choice([-1, 1])
    read = sign * (theta - zero)
    units = {"deg": np.degrees(read), "rad": read, "rev": read / (2 * np.pi)}
    unit = rng.choice(list(units) if turns < 1 else [*units, "counts"])
    turn = {"deg": 360.0, "rad": 2 * np.pi, "rev": 1.0}
    values = np.floor(read / (2 * np.pi) * 4096) % 4096 if unit == "counts" else units[unit]
    values = values + (0.0 if unit == "counts" else rng.normal(0, 2e-5 * turn[unit], samples))
    enc = "enc" + f" [{unit}]" * (unit != "counts" and rng.random() < 0.5)
    signals = kinetostatics(kinematics(Assembly(m), theta, speed, 0.0)).signals()
    torque = signals["drive_torque"]
    follower = np.degrees(np.unwrap(signals["follower_angle"])) + rng.normal(0, 0.02, samples)
    columns = {
        rng.choice(["t [s]", "Zeit"]): time,
        enc: values,
        rng.choice(["Schwinge", "follower_angle [deg]"]): follower,
        "Moment": 1.1 * torque + 0.2 * np.std(torque) * np.sign(speed) + rng.normal(0, 0.02 * np.std(torque), samples),
        "Temp": 20 + np.cumsum(rng.normal(0, 0.02, samples)) + time / time[-1],
    }
    (found,) = guess(rows_of(tmp_path / "a.csv", columns), m)
    np.testing.assert_allclose(np.exp(1j * found.values["crank_angle"]), np.exp(1j * theta), atol=0.02)
    told = {g.heading: g.signal.name if g.signal else None for g in found.guesses}
    assert told["Temp"] is None
    assert told["Moment"] in (None, "drive_torque")
    assert "follower_angle" in told.values()


def test_what_is_not_recognised_says_what_is_nearest(tmp_path: Path) -> None:
    theta = 0.3 + 5.0 * TURN
    follower = cranked(theta) + 4 * np.sin(3 * theta)  # with a fault
    path = rows_of(tmp_path / "a.csv", {"time_s": TURN, "crank_deg": np.degrees(theta), "Weg": follower})
    assert '"Weg" = "ignore"    # not recognised: ignored until you say here what it is; 8' in (
        lc.begin(path, "crank-rocker").text
    )


@pytest.mark.parametrize(
    ("stamp", "says"),
    [
        (lambda t: f"2026-03-12T12:00:{t:09.6f}", "give time as a number, such as seconds since the run began"),
        (lambda t: f"{t:.3f} s", "give time as a number"),
    ],
)
def test_a_clock_that_is_no_number_is_not_passed_over(tmp_path: Path, stamp: Any, says: str) -> None:
    theta = 0.3 + 5.0 * TURN
    columns = {"Zeit": [stamp(t) for t in TURN], "phi [deg]": np.degrees(theta), "follower_angle_deg": cranked(theta)}
    with pytest.raises(DataError) as said:
        lc.begin(rows_of(tmp_path / "a.csv", columns), "crank-rocker")
    assert says in str(said.value)
    assert "line 2" in str(said.value)


def test_a_line_that_is_no_row_is_named(tmp_path: Path) -> None:
    path = rows_of(tmp_path / "a.csv", {"time_s": TURN, "crank_deg": 300 * TURN})
    path.write_text(path.read_text() + "end of record\n")
    with pytest.raises(DataError, match="line 502 has 1 cell and the header 2"):
        lc.begin(path, "crank-rocker")


@pytest.mark.slow
def test_the_preview_says_what_a_diagnosis_refuses(tmp_path: Path) -> None:
    text = (RIG / "measured.toml").read_text().replace('"nominal.toml"', json.dumps(NOMINAL))
    for file in RIG.glob("*.csv"):
        head, *rest = file.read_text().splitlines(keepends=True)
        (tmp_path / file.name).write_text(head.replace("follower_x [mm]", "follower_x [m]") + "".join(rest[::4]))
    (tmp_path / "measured.toml").write_text(text)
    found = [fault.text for fault in lc.preview(tmp_path).faults]
    assert any("it looks in mm" in said and "a diagnosis refuses it" in said for said in found), found


@pytest.mark.slow
def test_the_preview_of_a_real_rig_says_what_cannot_be_told_apart() -> None:
    found = lc.preview(RIG)
    sizes = {(v.name, v.where): v for v in found.visible}
    assert sizes["joint_clearance", "B"].size == pytest.approx(1.0e-6, rel=0.5)
    assert [(p.name, p.where) for p in sizes["joint_clearance", "D"].like] == [("joint_clearance", "A")]
    assert [(p.name, p.where) for p in found.invisible] == [("moment_of_inertia", "crank")]
    assert len(found.rows()) == sum(run.samples for run in found.runs)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="memory is read from /proc")
def test_a_long_file_is_begun_in_little_memory(tmp_path: Path) -> None:
    """A million rows, a column of which has no heading that says anything, and one of words."""
    time = np.linspace(0.0, 1000.0, 1_000_000)
    few = np.linspace(0.0, 5000.0, 200_001)
    follower = np.interp(5.0 * time, few, cranked(few))
    with (tmp_path / "long.csv").open("w") as file:
        file.write("time [s],enc,Weg,state\n")
        file.writelines(
            f"{t:.4f},{5 * t:.4f},{w:.3f},ok\n" for t, w in zip(time.tolist(), follower.tolist(), strict=True)
        )
    told = (
        "import linkage_crosscheck as lc; print(lc.begin('long.csv', 'crank-rocker').text);"
        "print(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])"
    )
    done = subprocess.run([sys.executable, "-c", told], cwd=tmp_path, capture_output=True, text=True, check=True)
    *text, peak = done.stdout.splitlines()
    assert float(peak) / 2**20 < 1.0  # GB
    assert any('"Weg" = { signal = "follower_angle", unit = "deg" }' in line for line in text)
