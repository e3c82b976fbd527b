"""Bad data through the command: one sentence on standard error, the right exit status, no traceback, nothing
half-written.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from commands import compare, without
from diagnosis_rigs import experiment, readings
from marks import slow
from tests.evidence.scoreboard.hidden import Hidden
from tests.evidence.scoreboard.record import write_data

RIG = experiment()
RUN = "slow.csv"
Table = list[list[str]]  # header first


@dataclass(frozen=True)
class Ended:
    """How the command ended."""

    status: int
    out: str
    err: str
    folder: Path


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Data with nothing wrong."""
    folder = tmp_path_factory.mktemp("good")
    write_data(Hidden(0, "effects", RIG, "exudyn", "mujoco"), readings(RIG), folder)
    return folder


def copied(good: Path, folder: Path) -> Path:
    for file in good.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    return folder


def diagnosed(folder: Path) -> Ended:
    out = folder / "out"
    with without("exudyn", "pybullet", "dartpy"):  # their simulations of the explanation say nothing of the data
        done = compare(
            "diagnose", str(folder / "measured.toml"), "--workers", "1", "--json", "--out", str(out), cwd=folder
        )
    return Ended(done.returncode, done.stdout, done.stderr, out)


def assert_refused(ended: Ended, *words: str) -> None:
    assert ended.status == 2, ended.err or ended.out[:300]
    assert ended.out == ""
    assert ended.err.count("\n") == 1, ended.err
    assert ended.err.startswith("compare: ")
    assert "Traceback" not in ended.err
    assert "Error" not in ended.err
    for word in words:
        assert word in ended.err
    assert not ended.folder.exists()


def edited(folder: Path, change: Callable[[Table], None]) -> None:
    """One data file, changed as a table."""
    path = folder / RUN
    table = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()]
    change(table)
    path.write_text("\n".join(",".join(row) for row in table) + "\n", encoding="utf-8")


def column(table: Table, signal: str) -> int:
    return next(k for k, cell in enumerate(table[0]) if cell.split(" ")[0] == signal)


# ---------------------------------------------------------------- refused


def in_degrees(table: Table) -> None:
    k = column(table, "follower_angle")
    for row in table[1:]:
        row[k] = f"{np.degrees(float(row[k])):.12g}"


def swapped(table: Table) -> None:
    x, y = column(table, "reaction_E_x"), column(table, "reaction_E_y")
    for row in table[1:]:
        row[x], row[y] = row[y], row[x]


def back_in_time(table: Table) -> None:
    table[20][0] = table[10][0]


def one_sample(table: Table) -> None:
    del table[2:]


def no_time(table: Table) -> None:
    table[7][0] = "nan"


def infinite(table: Table) -> None:
    table[7][2] = "inf"


def headless(table: Table) -> None:
    del table[0]


def renamed(table: Table) -> None:
    table[0][column(table, "follower_angle")] = "folower_angle [rad]"


def all_empty(table: Table) -> None:
    for row in table[1:]:
        row[1:] = ["nan"] * (len(row) - 1)


@pytest.mark.long_rows("in_degrees-")
@pytest.mark.mujoco
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (in_degrees, [RUN, "follower_angle", "it looks in deg", "rad"]),
        (swapped, [RUN, "reaction_E_x and reaction_E_y", "swapped"]),
        (back_in_time, [RUN, "line 21", "time runs back"]),
        (one_sample, [RUN, "1 row"]),
        (no_time, [RUN, "line 8", "no time"]),
        (infinite, [RUN, "line 8", "'inf'", "not a finite number"]),
        (headless, [RUN, "line 1", "header"]),
        (renamed, [RUN, "'folower_angle'", "did you mean 'follower_angle'"]),
        (all_empty, [RUN, "slow", "usable"]),
    ],
    ids=lambda value: value.__name__ if callable(value) else "",
)
def test_a_table_that_cannot_be_what_it_says_is_refused(
    change: Callable[[Table], None], words: list[str], good: Path, tmp_path: Path
) -> None:
    edited(copied(good, tmp_path), change)
    assert_refused(diagnosed(tmp_path), *words)


@pytest.mark.parametrize(
    ("data", "word"),
    [(b"", "empty"), (bytes(range(256)) * 40, "binary"), (b"\x89PNG\r\n\x1a\n\xff\xfe" * 50, "UTF-8")],
    ids=["empty", "binary", "picture"],
)
def test_a_file_that_is_no_table_is_refused(data: bytes, word: str, good: Path, tmp_path: Path) -> None:
    (copied(good, tmp_path) / RUN).write_bytes(data)
    assert_refused(diagnosed(tmp_path), RUN, word)


@pytest.mark.parametrize("file", ["nominal.toml", RUN, "measured.toml"])
def test_a_file_that_is_missing_is_named(file: str, good: Path, tmp_path: Path) -> None:
    (copied(good, tmp_path) / file).unlink()
    assert_refused(diagnosed(tmp_path), file, "no such")


def test_a_folder_instead_of_a_file(good: Path, tmp_path: Path) -> None:
    copied(good, tmp_path)
    (tmp_path / "measured.toml").unlink()
    (tmp_path / "measured.toml").mkdir()
    assert_refused(diagnosed(tmp_path), "measured.toml")


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ('name = "slow"', 'name = "slow', "measured.toml"),
        ("drive_speed = 4.0", "drive_speed = 400.0", "drive_speed = 400"),  # a hundred times too fast
        ("drive_speed = 4.0", "drive_speed = -4.0", "negate drive_speed"),
        ("drive_speed = 4.0", "drive_sped = 4.0", "did you mean 'drive_speed'"),
        ('mechanism = "nominal.toml"', 'mechanism = "elsewhere.toml"', "elsewhere.toml"),
    ],
)
def test_a_description_that_cannot_be_is_refused(old: str, new: str, word: str, good: Path, tmp_path: Path) -> None:
    path = copied(good, tmp_path) / "measured.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    assert_refused(diagnosed(tmp_path), word)


@pytest.mark.mujoco
def test_an_out_that_is_a_file_is_refused(good: Path, tmp_path: Path) -> None:
    copied(good, tmp_path)
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    ended = diagnosed(tmp_path)
    assert ended.status == 2
    assert "out" in ended.err
    assert ended.err.count("\n") == 1
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"


# ---------------------------------------------------------------- handled, and said


def constant(table: Table) -> None:
    k = column(table, "reaction_E_x")
    for row in table[1:]:
        row[k] = "1.25"


def with_nans(table: Table) -> None:
    k = column(table, "follower_angle")
    for row in table[10:60]:
        row[k] = "nan"


def with_holes(table: Table) -> None:
    k = column(table, "follower_angle")
    for row in table[10:60]:
        row[k] = ""


def with_a_gap(table: Table) -> None:
    del table[40:70]


def with_a_spike(table: Table) -> None:
    table[50][column(table, "follower_angle")] = "2.9"


@pytest.mark.mujoco
@pytest.mark.parametrize(
    ("change", "kinds"),
    [
        *slow((constant, ["constant"]), (with_nans, []), (with_holes, []), (with_a_gap, ["gap"])),
        (with_a_spike, ["outliers"]),
    ],
    ids=lambda value: value.__name__ if callable(value) else "",
)
def test_what_can_be_mended_is_mended_and_said(
    change: Callable[[Table], None], kinds: list[str], good: Path, tmp_path: Path
) -> None:
    edited(copied(good, tmp_path), change)
    ended = diagnosed(tmp_path)
    assert ended.status == 0, ended.err
    assert ended.err == ""
    result = json.loads(ended.out)
    assert result["verdict"] == "no gap"
    assert result["effects"] == []
    assert [f["kind"] for f in result["faults"]] == kinds
    assert all(f["text"] and f["run"] == "slow" for f in result["faults"])
    json.dumps(result, allow_nan=False)


@pytest.mark.mujoco
def test_absent_samples_stay_absent_in_the_result(good: Path, tmp_path: Path) -> None:
    edited(copied(good, tmp_path), with_nans)
    run = json.loads(diagnosed(tmp_path).out)["runs"][0]
    values = run["signals"]["follower_angle"]["measured"]
    assert [k for k, v in enumerate(values) if v is None] == list(range(9, 59))
    assert len(values) == len(run["time"]) == 120
