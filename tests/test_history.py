"""``compare list`` and ``lc.runs``: earlier results, whatever else lies in their folder."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

import linkage_crosscheck as lc
from compare.cli.app import app
from compare.history import HEAD, WHOLE_FILE
from document_faults import faults

REPORTS = Path(__file__).parent.parent / "reports"


def left(folder: Path, name: str = "result.json", age: float = 0.0, **fields: object) -> Path:
    """A result that somebody has left, ``age`` days ago."""
    content = {"schema": 1, "case": "paper", "verdict": "agrees", "command": "compare --simulator mujoco"} | fields
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(json.dumps({k: v for k, v in content.items() if v is not None}), encoding="utf-8")
    os.utime(path, (1.7e9 - 86400 * age,) * 2)
    return path


def test_every_kind_is_found_newest_first_with_the_date_that_it_says(tmp_path: Path) -> None:
    left(tmp_path / "a", age=2)
    left(tmp_path / "b" / "inner", "diagnosis.json", age=1, case="gripper", verdict="explained")
    left(tmp_path / "c", "accuracy.json", verdict=None, date="2030-01-02T03:04:05+02:00")
    left(tmp_path / "d", "validity.json", age=3, verdict=None)
    found = lc.runs(tmp_path)
    assert [(run.kind, run.case, run.verdict, run.date[:10]) for run in found.runs] == [
        ("accuracy", "paper", None, "2030-01-02"),
        ("diagnosis", "gripper", "explained", "2023-11-13"),
        ("cross-check", "paper", "agrees", "2023-11-12"),
        ("validity", "paper", None, "2023-11-11"),
    ]
    assert found.runs[0].date == "2030-01-02T01:04:05+00:00"
    assert found.unreadable == ()
    assert faults(type(found), json.loads(found.to_json())) == []


@pytest.mark.mujoco
def test_what_a_command_has_just_left_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    lc.crosscheck("crank-rocker", angles=[0.5, 0.6]).write(Path("reports") / "mine")
    lc.accuracy("paper", angles=[0.5, 0.6], clearance={"B": 1e-4}, samples=100).write(Path("reports") / "how")
    lc.sweep("paper", {"drive.speed": [1.0]}, angles=[0.5, 0.6], workers=1).write(Path("reports") / "over")
    shown = CliRunner().invoke(app, ["list", "--json"])
    assert shown.exit_code == 0
    runs = json.loads(shown.output)["runs"]
    assert {(run["kind"], run["case"], run["verdict"]) for run in runs} == {
        ("cross-check", "crank-rocker", "agrees"),
        ("accuracy", "paper", None),
        ("sweep", "paper", None),
    }
    assert lc.runs().runs[0].file.startswith("reports")
    assert "Python" in CliRunner().invoke(app, ["list"]).output


def test_the_committed_reports_are_found_with_their_commands() -> None:
    found = lc.runs(REPORTS)
    assert len(found.runs) >= 3
    assert all(run.command.startswith("compare validity --case") for run in found.runs if run.kind == "validity")


DAMAGED = {
    "no JSON": ("{'schema': 1", "cannot be read as JSON"),
    "a list": ("[1, 2]", "holds a list"),
    "of another program": ('{"verdict": "agrees"}', "schema is missing"),
    "of another version": ('{"schema": 2, "case": "paper"}', "schema is 2"),
    "no case": ('{"schema": 1, "verdict": "agrees"}', "case is missing"),
    "a verdict of its own": ('{"schema": 1, "case": "paper", "verdict": 7}', "verdict is 7"),
    "empty": ("", "cannot be read as JSON"),
    "nested": ("[" * 100_000, "nested too deep"),
    "cut off": ('{"schema": 1, "case": "p", "verdict": "agrees", "command": "c", "runs": [' + "1, " * HEAD, "cut off"),
    "large and empty of what is needed": ('{"runs": [' + "1, " * (WHOLE_FILE // 2) + "1]}", "schema is missing"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_file_is_told_in_a_line_and_the_others_are_listed(name: str, tmp_path: Path) -> None:
    text, words = DAMAGED[name]
    left(tmp_path / "good")
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "result.json").write_text(text, encoding="utf-8")
    found = lc.runs(tmp_path)
    assert [run.file for run in found.runs] == [str(tmp_path / "good" / "result.json")]
    (line,) = found.unreadable
    assert line.startswith(str(tmp_path / "bad" / "result.json"))
    assert words in line
    shown = CliRunner().invoke(app, ["list", str(tmp_path)])
    assert shown.exit_code == 0
    assert words in " ".join(shown.output.split())


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names here")
def test_pipes_folders_and_links_that_go_round_do_no_harm(tmp_path: Path) -> None:
    left(tmp_path / "good")
    (tmp_path / "round").symlink_to(tmp_path, target_is_directory=True)
    (tmp_path / "folder" / "result.json").mkdir(parents=True)
    (tmp_path / "pipe").mkdir()
    os.mkfifo(tmp_path / "pipe" / "result.json")
    left(tmp_path / ".hidden")
    found = lc.runs(tmp_path)
    assert len(found.runs) == 1
    assert ["it is a folder" in line or "it is a pipe" in line for line in found.unreadable] == [True, True]


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    shown = CliRunner().invoke(app, ["list", str(tmp_path / "none")])
    assert shown.exit_code == 2
    assert "there is no such folder" in shown.output


def test_what_a_name_smuggles_moves_no_cursor(tmp_path: Path) -> None:
    left(tmp_path / "a", case="pa\x1b[2Jper", command="compare\n--case x")
    shown = CliRunner().invoke(app, ["list", str(tmp_path)])
    assert "\x1b" not in shown.output
    assert "compare\\n--case" in shown.output


@pytest.mark.slow
def test_large_files_and_thousands_of_others_are_passed_over_quickly(tmp_path: Path) -> None:
    runs = tmp_path / "sweep" / "runs"
    runs.mkdir(parents=True)
    for i in range(3000):
        (runs / f"{i:05}.json").touch()
    large = left(tmp_path / "large", runs=[[0.1234567] * 1000])
    with large.open("r+b") as file:  # 1 GB, most of it a hole
        file.truncate(10**9)
        file.seek(0, os.SEEK_END)
        file.write(b"}")
    began = time.perf_counter()
    (found,) = lc.runs(tmp_path).runs
    assert found.verdict == "agrees"
    assert time.perf_counter() - began < 2.0
