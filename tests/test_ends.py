"""How the command ends where it is not let finish: nobody reads what it prints, Ctrl-C; and what it says once."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any
from unittest import mock
from xml.etree import ElementTree

import pytest

import linkage_crosscheck as lc
from analytic.mechanism.checks import MechanismWarning
from analytic.mechanism.file import dumps, load
from commands import compare, evidence
from compare.crosscheck import Interrupted
from compare.simulations import simulate_all
from marks import slow

ROOT = Path(__file__).parents[1]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}
posix = pytest.mark.skipif(os.name != "posix", reason="signals and pipes of POSIX")


def started(*arguments: str, cwd: Path, stdout: int = subprocess.PIPE) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-m", "compare", *arguments],
        cwd=cwd,
        env=ENVIRONMENT,
        stdout=stdout,
        stderr=subprocess.PIPE,
    )


@pytest.mark.long_rows("analyse", "cases")
@posix
@pytest.mark.parametrize(
    "arguments",
    [
        ["cases"],
        ["--help"],
        ["analyse", "--json", "--out", "out"],
        *slow(["--simulator", "mujoco", "--joint", "contact", "--analytic", "first_order", "--angles", "30:60:30"]),
    ],
    ids=lambda a: a[0],
)
def test_a_reader_that_goes_away_is_no_verdict(arguments: list[str], tmp_path: Path) -> None:
    reads, writes = os.pipe()
    os.close(reads)
    done = started(*arguments, cwd=tmp_path, stdout=writes)
    os.close(writes)
    _, said = done.communicate(timeout=120)
    assert done.returncode == 128 + signal.SIGPIPE, said
    assert b"Traceback" not in said
    assert b"Broken" not in said


@pytest.mark.parametrize(
    "arguments",
    [
        ["--simulator", "mujoco", "--out"],
        ["analyse", "--out"],
        ["simulate", "--out"],
        ["accuracy", "--out"],
        ["validity", "--speeds", "60", "--clearances", "1e-4", "--out"],
        ["diagnose", "measured.toml", "--out"],
        ["export", "--simulator", "mujoco", "--out"],
        ["baseline", "update", "--baselines"],
        ["baseline", "check", "--junit"],
    ],
    ids=lambda a: " ".join((a[0], a[-1])),
)
@pytest.mark.parametrize("empty", ["", " "])
def test_an_empty_folder_name_is_refused(arguments: list[str], empty: str, tmp_path: Path) -> None:
    done = compare(*arguments, empty, cwd=tmp_path)
    assert done.returncode == 2
    assert "it is empty; name a folder, or give . for the current one" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "line", ["scoreboard show 7 --out", "scoreboard update --reports", "validation update --reports"]
)
def test_an_empty_folder_name_is_refused_for_evidence_too(line: str, tmp_path: Path) -> None:
    done = evidence(*line.split(), "", cwd=tmp_path)
    assert done.returncode == 2
    assert "it is empty; name a folder, or give . for the current one" in done.stderr
    assert not list(tmp_path.iterdir())


INTERRUPTED = {
    "cross-check": ("compare.crosscheck.crosscheck_job", ["--simulator", "mujoco"], "compare: stopped\n"),
    "accuracy": ("compare.accuracy.accuracy", ["accuracy"], "compare: stopped\n"),
    "export": ("compare.export.exported", ["export", "--simulator", "mujoco"], "compare: stopped\n"),
    "validity": (
        "compare.domain_map.validity.mapped",
        ["validity", "--speeds", "60", "--clearances", "1e-4"],
        "compare: stopped; the same command goes on where it stopped\n",
    ),
}


@pytest.mark.parametrize("what", INTERRUPTED)
@pytest.mark.parametrize("there", [False, True], ids=["new folder", "old folder"])
def test_an_interrupt_is_one_line_and_leaves_no_empty_folder(what: str, there: bool, tmp_path: Path) -> None:
    place, arguments, said = INTERRUPTED[what]
    if there:
        (tmp_path / "deep" / "out").mkdir(parents=True)
    with mock.patch(place, side_effect=KeyboardInterrupt):
        done = compare(*arguments, "--out", "deep/out", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", said)
    assert (tmp_path / "deep" / "out").exists() is there
    assert (tmp_path / "deep").exists() is there


@pytest.mark.mujoco
def test_a_cross_check_that_is_stopped_reports_the_runs_that_had_ended(tmp_path: Path) -> None:
    def stopped(*asked: Any) -> Iterator[tuple[int, Any]]:
        yield from islice(simulate_all(*asked), 2)
        raise KeyboardInterrupt

    words = ["paper", "--simulator", "mujoco", "--motion", "static", "--out", "out"]
    with mock.patch("compare.crosscheck.simulate_all", stopped):
        done = compare(*words, "--angles", "20:80:20", cwd=tmp_path)
    assert done.returncode == 130
    assert done.stderr.endswith("compare: stopped; the result has the runs that had ended, as they came\n")
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert [run["joint_model"] for run in result["runs"]] == ["ideal", "massless-link"]
    assert [(one["joint_model"], one["why"]) for one in result["failures"]] == [
        (model, f"mujoco {model} static: stopped before it ended") for model in ("spring-damper", "contact")
    ]
    assert result["verdict"] != "agrees"
    assert "not judged: mujoco contact static: stopped before it ended" in done.stdout
    assert "2 of 4 runs were stopped before the end." in done.stdout
    suites = ElementTree.parse(tmp_path / "out" / "junit.xml").getroot()
    assert (suites.get("failures"), suites.get("errors"), suites.get("skipped")) == ("0", "0", "2")
    assert {each.get("message") for each in suites.iter("skipped")} == {one["why"] for one in result["failures"]}
    assert "stopped before it ended" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


@pytest.mark.mujoco
def test_a_run_that_is_being_made_again_as_somebody_stops_it_is_as_it_first_came() -> None:
    calls: list[Any] = []

    def stopped(*asked: Any) -> Iterator[tuple[int, Any]]:
        calls.append(asked)
        if len(calls) > 1:
            raise KeyboardInterrupt
        return simulate_all(*asked)

    with mock.patch("compare.crosscheck.simulate_all", stopped), pytest.raises(Interrupted) as interrupted:
        lc.crosscheck("crank-rocker", "mujoco", joint_model="spring-damper", clearance=1e-4, angles="0:350:10")
    (run,) = interrupted.value.result.runs
    assert "refinements" not in run.settings
    assert run.verdict == "disagrees"


def test_a_scoreboard_says_that_it_goes_on(tmp_path: Path) -> None:
    with mock.patch("tests.evidence.scoreboard.check.update_scoreboard", side_effect=KeyboardInterrupt):
        done = evidence("scoreboard", "update", "--reports", "board", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (130, "compare: stopped; the same command goes on where it stopped\n")


@posix
@pytest.mark.slow
@pytest.mark.mujoco
def test_a_map_that_is_interrupted_from_the_keyboard_goes_on(tmp_path: Path) -> None:
    arguments = [
        "validity",
        "--case",
        "crank-rocker",
        "--speeds",
        "60,120,300,600,900",
        "--clearances",
        "1e-5,2e-5,5e-5,1e-4,2e-4,5e-4",
    ]
    running = started(*arguments, "--out", "out", "--workers", "1", cwd=tmp_path)
    until = time.monotonic() + 300
    while not list((tmp_path / "out" / "runs").glob("*.json")) and time.monotonic() < until:
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130
    assert said.decode() == "compare: stopped; the same command goes on where it stopped\n"
    assert list((tmp_path / "out" / "runs").glob("*.json"))


@pytest.mark.long_rows("--simulator", "analyse")
@pytest.mark.mujoco
@pytest.mark.parametrize(
    "arguments",
    [
        ["--simulator", "mujoco", "--joint", "massless-link", "--motion", "static", "--angles", "30:60:30"],
        ["analyse", "--motion", "static"],
        ["simulate", "--motion", "static"],
        ["accuracy", "--motion", "static", "--samples", "20"],
        *slow(["validity", "--speeds", "60", "--clearances", "1e-4", "--workers", "1"]),
        ["export", "--simulator", "mujoco", "--motion", "static", "--angles", "30:60:30"],
    ],
    ids=lambda a: a[0],
)
def test_a_warning_is_said_once(arguments: list[str], tmp_path: Path) -> None:
    paper = load("paper")
    with pytest.warns(MechanismWarning):
        long = paper.with_body("coupler", points=dict(paper.moving["coupler"].points) | {"tip": (21.0, 0.0)})
    (tmp_path / "long.toml").write_text(dumps(long), encoding="utf-8")
    done = compare(*arguments, "--case", "long.toml", "--out", "out", cwd=tmp_path)
    warned = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert len([line for line in warned if "was it meant in millimetres?" in line]) == 1, done.stderr
    assert len(set(warned)) == len(warned)
