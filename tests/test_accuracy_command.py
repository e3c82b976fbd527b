"""``compare accuracy`` as a person runs it: its file, its table, its messages."""

from __future__ import annotations

import json
import re
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator

from analytic.mechanism.file import dumps, load, shipped_cases
from commands import Ended, assert_refused, compare

SCHEMA = json.loads(resources.files("compare").joinpath("schemas", "accuracy.json").read_text(encoding="utf-8"))
ALL = {
    "paper": "D=1e-4,A=1e-4,B=1e-4,E=1e-4",
    "crank-rocker": "B=2e-4,E=1e-4",
    "slider-crank": "B=5e-4",
    "six-bar": "C=1e-4,F=1e-4",
    "pendulum": "O=1e-3",
}


def accuracy(*arguments: str, cwd: Path) -> Ended:
    return compare("accuracy", *arguments, cwd=cwd)


def numbers(*arguments: str, cwd: Path) -> dict[str, Any]:
    done = accuracy(*arguments, "--json", cwd=cwd)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def series(values: list[float | None]) -> np.ndarray:
    return np.array([np.nan if v is None else v for v in values])


def test_the_schema_itself_is_valid() -> None:
    Draft202012Validator.check_schema(SCHEMA)
    assert set(ALL) <= set(shipped_cases())


@pytest.mark.long_rows("six-bar", "crank-rocker")
@pytest.mark.parametrize(("case", "clearance"), ALL.items(), ids=ALL)
def test_every_case_is_analysed_and_its_file_meets_the_schema(case: str, clearance: str, tmp_path: Path) -> None:
    found = numbers("--case", case, "--clearance", clearance, "--samples", "500", cwd=tmp_path)
    Draft202012Validator(SCHEMA).validate(found)
    assert found == json.loads(
        (
            tmp_path / "reports" / f"{case}-accuracy-{clearance.replace('=', '_')}-samples_500" / "accuracy.json"
        ).read_text(encoding="utf-8")
    )
    assert list(found["outputs"]) == [f"{b.name}_{axis}" for b in load(case).bodies for axis in ("x", "y", "angle")]
    n = len(found["crank_angle"])
    for row in found["outputs"].values():
        sizes = np.array([found["clearance"].get(joint, 0.0) for joint in row["sensitivity"]])
        np.testing.assert_allclose(row["worst_case"], sizes @ np.array(list(row["sensitivity"].values())), atol=1e-18)
        assert np.all(
            np.abs(series(row["nominal"]))[np.isfinite(series(row["nominal"]))]
            <= series(row["worst_case"]).max() * (1 + 1e-9) + 1e-18
        )
        assert {len(row[key]) for key in ("nominal", "equilibrium", "compliance", "total")} == {n}
        assert [row["equilibrium"][int(i)] for i in found["flags"]] == [None] * len(found["flags"])
        np.testing.assert_allclose(
            series(row["total"]), series(row["equilibrium"]) + series(row["compliance"]), rtol=1e-12
        )


def test_a_file_that_says_something_else_does_not_meet_the_schema(tmp_path: Path) -> None:
    found = numbers("--output", "coupler", "--samples", "100", cwd=tmp_path)
    for wrong in (
        found | {"schema": 2},
        found | {"motion": "fast"},
        {k: v for k, v in found.items() if k != "flags"},
        found | {"outputs": {"coupler_x": found["outputs"]["coupler_x"] | {"unit": "mm"}}},
    ):
        assert not Draft202012Validator(SCHEMA).is_valid(wrong)


@pytest.mark.slow
def test_20_000_samples_meet_the_formula_to_2_percent(tmp_path: Path) -> None:
    found = numbers("--clearance", ALL["paper"], "--clearance-tolerance", "D=5e-5,B=1e-4", cwd=tmp_path)
    assert found["samples"] == 20_000
    for name, row in found["outputs"].items():
        for spread in row["monte_carlo"].values():
            if name != "crank_angle":
                large = np.array(spread["formula"]) > 0.01 * max(spread["formula"])
                np.testing.assert_allclose(
                    np.array(spread["sigma"])[large], np.array(spread["formula"])[large], rtol=0.02
                )


def test_the_same_command_gives_the_same_numbers_and_another_seed_others(tmp_path: Path) -> None:
    once, again, other = (
        numbers("--output", "coupler", "--samples", "1000", "--seed", seed, cwd=tmp_path) for seed in ("1", "1", "2")
    )
    assert once["outputs"] == again["outputs"]
    for found in (once, other):
        found["sigma"] = found["outputs"]["coupler_y"]["monte_carlo"]["free"]["sigma"]
    assert once["sigma"] != other["sigma"]
    assert once["outputs"]["coupler_y"]["worst_case"] == other["outputs"]["coupler_y"]["worst_case"]


@pytest.mark.parametrize(
    ("output", "names"),
    [
        ("coupler", ["coupler_x", "coupler_y", "coupler_angle"]),
        ("coupler.B", ["coupler.B_x", "coupler.B_y"]),
        ("follower.angle", ["follower_angle"]),
        ("follower.angle,coupler.com", ["follower_angle", "coupler_x", "coupler_y"]),
    ],
)
def test_outputs_are_those_that_were_named(output: str, names: list[str], tmp_path: Path) -> None:
    found = numbers("--output", output, "--angles", "30:60:10", "--samples", "50", cwd=tmp_path)
    assert list(found["outputs"]) == names
    assert len(found["crank_angle"]) == 4


def test_a_point_that_only_one_body_has_needs_no_body(tmp_path: Path) -> None:
    found = numbers("--case", "pendulum", "--output", "tip", "--clearance", "O=1e-3", "--samples", "50", cwd=tmp_path)
    assert list(found["outputs"]) == ["pendulum.tip_x", "pendulum.tip_y"]
    assert found["motion"] == "static"  # released: no speed, no inertia
    np.testing.assert_allclose(found["outputs"]["pendulum.tip_y"]["equilibrium"], -1e-3, rtol=1e-9)  # it hangs lower


def test_without_clearance_there_are_sensitivities_all_the_same(tmp_path: Path) -> None:
    found = numbers("--case", "crank-rocker", "--output", "follower.angle", "--samples", "50", cwd=tmp_path)
    row = found["outputs"]["follower_angle"]
    assert found["clearance"] == {}
    assert max(row["worst_case"]) == 0
    assert min(min(values) for values in row["sensitivity"].values()) > 1


def test_the_table_is_in_millimetres_and_degrees(tmp_path: Path) -> None:
    done = accuracy("--clearance", ALL["paper"], "--motion", "static", "--samples", "1000", cwd=tmp_path)
    assert done.returncode == 0
    assert all(line.startswith("left out: ") for line in done.stderr.splitlines()), done.stderr
    (line,) = (line.split() for line in done.stdout.splitlines() if line.startswith("follower_angle"))
    assert line[:2] == ["follower_angle", "deg"]
    assert float(line[5]) == pytest.approx(
        np.degrees(4e-4 / (0.2 * np.sin(np.radians(20.0)))), rel=2e-3
    )  # worst case, at 20 deg
    assert line[6:8] == ["20", "deg"]
    assert done.stdout.isascii()
    assert "accuracy.html" in done.stdout


def test_unloaded_and_reversing_contacts_are_told(tmp_path: Path) -> None:
    m = load("paper").replace(loads=[{"body": "follower", "force": (0.0, 50.0)}])
    (tmp_path / "reversing.toml").write_text(dumps(m), encoding="utf-8")
    done = accuracy(
        "--case", "reversing.toml", "--clearance", "B=1e-4", "--motion", "static", "--samples", "50", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    assert re.search(r"the contact changes side at 90 deg: \w+ jumps by \S+ mm in B", done.stdout)
    others = "no equilibrium at 1 of 29 crank angles (the largest is of the others); first 90 deg: the reaction at B"
    assert f"{others} passes near zero" in done.stdout


BAD_INPUT = {
    "unknown joint": (["--clearance", "Q=1e-4"], ["--clearance Q=1e-4", "D, A, B, E"]),
    "no number": (["--clearance", "B"], ["--clearance B", "JOINT=metres"]),
    "negative": (["--clearance", "B=-1e-4"], ["--clearance B=-1e-4", "0 or more"]),
    "tolerance for no joint": (["--clearance-tolerance", "Q=1e-4"], ["--clearance-tolerance Q=1e-4", "D, A, B, E"]),
    "tolerance beyond the clearance": (
        ["--clearance", "B=1e-4", "--clearance-tolerance", "B=2e-4"],
        ["B=0.0002", "0.0001 m", "negative"],
    ),
    "unknown body": (["--output", "arm"], ["--output arm", "crank, coupler, follower"]),
    "unknown point": (["--output", "coupler.Z"], ["--output coupler.Z", "'Z'", "com, angle, A, B"]),
    "point of two bodies": (["--output", "B"], ["--output B", "coupler and follower", "coupler.B"]),
    "no speed": (["--case", "pendulum", "--motion", "driven"], ["--motion driven", "pendulum", "static"]),
    "change point": (["--angles", "20:200:5"], ["change point at crank angle 180 deg"]),
    "missing file": (["--case", "nowhere.toml"], ["nowhere.toml", "no such mechanism file"]),
    "clearance larger than a link": (["--clearance", "B=0.5"], ["joint 'B'", "0.5", "not smaller than body"]),
    "too few samples": (["--samples", "1"], ["--samples", "2"]),
    "a sample that cannot be closed": (
        ["--nonlinear", "--angles", "2:4:1", "--output", "coupler"],
        ["cannot be reached", "clearance"],
    ),
}


@pytest.mark.parametrize(("arguments", "words"), BAD_INPUT.values(), ids=BAD_INPUT)
def test_bad_input_gets_one_sentence_and_status_2(arguments: list[str], words: list[str], tmp_path: Path) -> None:
    done = accuracy(*arguments, "--out", "out", cwd=tmp_path)
    assert_refused(done, *words)
    assert done.stdout == ""
    assert not (tmp_path / "out" / "accuracy.json").exists()


def test_links_that_cannot_be_analysed_for_compliance_are_refused(tmp_path: Path) -> None:
    m = load("paper").with_body("coupler", section=(0.0, 0.0))
    (tmp_path / "thin.toml").write_text(dumps(m), encoding="utf-8")
    done = accuracy("--case", "thin.toml", cwd=tmp_path)
    assert_refused(done, "section")
