"""The example rig of the README: its files are what its script makes, and the diagnosis finds what was put in."""

from __future__ import annotations

import csv
import runpy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compare.diagnose import slips
from compare.diagnose.data.measured import load_measured
from compare.diagnose.workflow import diagnose

RIG = Path(__file__).parent.parent / "docs" / "example-rig"
FILES = ("forward.csv", "reverse.csv", "lifted.csv")


@pytest.fixture(scope="module")
def script() -> dict[str, Any]:
    return runpy.run_path(str(RIG / "make.py"))


def table(path: Path) -> tuple[list[str], np.ndarray]:
    """Header and numbers (N, columns) of a data file."""
    header, *rows = csv.reader(path.read_text(encoding="utf-8").splitlines())
    return header, np.array(rows, float)


@pytest.mark.slow
def test_making_the_files_again_gives_the_same_but_for_a_last_digit(script: dict[str, Any], tmp_path: Path) -> None:
    script["make"](tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(FILES)
    last_digit = np.array([1e-8, *(10.0**-decimals for _, _, decimals in script["COLUMNS"].values())])
    for name in FILES:
        (header, committed), (again, made) = table(RIG / name), table(tmp_path / name)
        assert again == header
        assert committed.shape == (script["SAMPLES"], 7)
        assert np.all(np.abs(made - committed) < 1.5 * last_digit)


def test_a_last_digit_is_a_small_part_of_the_noise(script: dict[str, Any]) -> None:
    for run in load_measured(RIG / "measured.toml").runs:
        assert list(run.channels) == list(script["COLUMNS"])
        for signal, (_, size, decimals) in script["COLUMNS"].items():
            assert 10.0**-decimals * size < 0.02 * run.channels[signal].noise


def test_the_files_are_small_and_without_faults() -> None:
    assert sum(p.stat().st_size for p in RIG.iterdir() if p.is_file()) < 150_000
    assert load_measured(RIG / "measured.toml").faults == ()


def test_what_the_engineer_is_given_does_not_tell_the_answer(script: dict[str, Any]) -> None:
    given = load_measured(RIG / "measured.toml").mechanism
    assert given.clearances == {}
    assert [joint.damping for joint in given.joints] == [0.0] * 4
    assert script["CLEARANCE"] == {"B": 1.5e-4}
    assert script["DAMPING"] == {"E": 4e-3}


@pytest.mark.slow
def test_the_diagnosis_names_both_effects_and_their_size(script: dict[str, Any]) -> None:
    found = diagnose(load_measured(RIG / "measured.toml"), "mujoco", others=False, workers=1)
    assert found.verdict == "explained"
    assert found.gap.before > 10
    assert found.gap.after < 1.1
    parameters = {(e.name, e.where): e.parameters for e in found.effects}
    assert set(parameters) == {("joint_clearance", "B"), ("viscous_friction", "E")}
    clearance, damping = (
        parameters["joint_clearance", "B"]["radial_clearance"],
        parameters["viscous_friction", "E"]["damping"],
    )
    assert clearance.low < script["CLEARANCE"]["B"] < clearance.high
    assert damping.low < script["DAMPING"]["E"] < damping.high
    assert found.explained.clearances == {"B": clearance.value}


@pytest.mark.slow
def test_a_sensor_that_is_late_by_three_rows_is_pointed_at_and_no_engine_is_blamed() -> None:
    """Of one run only: no effect is that, clearance leaves the gap as it is, and MuJoCo does as the model does."""
    measured = load_measured(RIG / "measured.toml")
    first = measured.runs[0]
    channel = first.channels["follower_angle"]
    late = replace(channel, values=np.concatenate([np.full(3, np.nan), channel.values[:-3]]))
    false = replace(first, channels={**first.channels, "follower_angle": late})
    result = diagnose(replace(measured, runs=(false, *measured.runs[1:])), "mujoco", others=False, workers=1)
    assert result.verdict == "unexplained"
    assert {(stretch.run, stretch.signal) for stretch in result.located[:3]} == {("forward", "follower_angle")}
    assert not any("mujoco" in note or "bounce" in note for note in result.notes)
    assert all(record.gap_after is not None for run in result.runs for record in run.signals.values())


@pytest.mark.parametrize("speed", [6.1, 6.3, 8.0])
def test_a_commanded_speed_that_is_wrong_is_told_of_a_rig_that_lacks_something_too(speed: float) -> None:
    """What a clearance leaves of a sensor is alike over many samples, and no sign that it has another speed."""
    measured = load_measured(RIG / "measured.toml")
    false = replace(measured.runs[0], speed=speed)
    (slip,) = slips.driven(replace(measured, runs=(false, *measured.runs[1:])), measured.mechanism)
    assert slip.kind == "speed"
    assert float(slip.field.removeprefix("drive_speed = ")) == pytest.approx(6.0, rel=1e-3)
