"""The search's budget, and noise that is stated too large: what is said where nothing, or not all, was looked for."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest

import linkage_crosscheck as lc
from commands import compare
from compare.diagnose.data.recording import Measured
from diagnosis_rigs import diagnosed, experiment, named, played, told, wrong

EXAMPLE = Path(__file__).parents[1] / "docs" / "example-rig"
PAYLOAD = wrong("payload", "coupler", mass=0.03, along=0.02, normal=0.015)


@pytest.mark.slow
def test_a_budget_ends_the_search_with_the_best_so_far() -> None:
    began = time.monotonic()
    found = told(lc.diagnose(EXAMPLE, budget=0.5, others=False, workers=1))
    spent = time.monotonic() - began
    assert found["complete"] is False
    assert "The budget of 0.5 s ended the search: this is the best so far" in found["statement"]
    assert found["effects"], "the best so far is named"
    assert found["gap"]["after"] < found["gap"]["before"]
    assert spent < 8.0, "preparing, one step of the search, and a simulation before and after; all of it takes longer"


@pytest.mark.slow
def test_a_search_that_ends_by_itself_is_complete() -> None:
    found = diagnosed(played(experiment(), PAYLOAD), only=("payload", "gravity"), budget=600)
    assert found["complete"] is True
    assert "budget" not in found["statement"]


@pytest.mark.parametrize("budget", ["0", "-3", "nan", "inf"])
def test_a_budget_of_nothing_is_refused_in_one_sentence(tmp_path: Path, budget: str) -> None:
    ended = compare("diagnose", str(EXAMPLE), f"--budget={budget}", "--out", str(tmp_path / "out"), cwd=tmp_path)
    assert ended.returncode == 2
    assert ended.stdout == ""
    said = ended.stderr.strip()
    assert "budget" in said
    assert len(said.splitlines()) == 1, said
    assert not (tmp_path / "out").exists()


def overstated(measured: Measured, times: float) -> Measured:
    """The same readings, their noise stated so many times too large."""
    runs = [
        replace(run, channels={s: replace(c, noise=times * c.noise) for s, c in run.channels.items()})
        for run in measured.runs
    ]
    return replace(measured, runs=tuple(runs))


@pytest.mark.slow
def test_noise_that_is_stated_too_large_names_nothing_and_is_told() -> None:
    gain = wrong("sensor_gain", "drive_torque", gain_error=0.003)
    measured = played(experiment(), gain)
    assert ("sensor_gain", "drive_torque") in named(diagnosed(measured, only=("sensor_gain",)))
    found = diagnosed(overstated(measured, 3.0), only=("sensor_gain",))
    assert (found["verdict"], found["effects"]) == ("no gap", [])
    assert found["gap"]["before"] == found["gap"]["after"] < 0.5
    steps = {step["title"]: step["text"] for step in found["steps"]}
    (note,) = [sentence for sentence in steps["Isolate"] if "overstated" in sentence]
    assert "give a smaller noise, or none, to look closer" in note


@pytest.mark.slow
def test_noise_that_is_overstated_does_not_hide_a_sensor_that_is_off() -> None:
    """One sensor is off by more than its noise, all others are ten times better than stated."""
    gain = wrong("sensor_gain", "drive_torque", gain_error=0.0025)
    measured = overstated(played(experiment(), gain), 10.0)
    runs = [
        replace(
            run,
            channels={s: replace(c, noise=c.noise / 10) if s == "drive_torque" else c for s, c in run.channels.items()},
        )
        for run in measured.runs
    ]
    found = diagnosed(replace(measured, runs=tuple(runs)), only=("sensor_gain",))
    assert found["gap"]["before"] < 0.9
    assert found["verdict"] != "no gap"
    assert [(e["name"], e["where"]) for e in found["effects"]] == [("sensor_gain", "drive_torque")]
