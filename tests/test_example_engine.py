"""Engines of other packages, and the documented example of one."""

from __future__ import annotations

import json
import os
import sys
import tomllib
from pathlib import Path
from unittest import mock

import pytest

import commands
from marks import slow
from sim_models.engine import offers

ROOT = Path(__file__).parents[1]
EXAMPLE = ROOT / "docs" / "example-engine"


def installed(folder: Path, name: str, value: str) -> Path:
    """A package that offers an engine, as pip leaves it in a folder."""
    info = folder / f"{name.replace('-', '_')}_package-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}-package\nVersion: 1.0\n", encoding="utf-8")
    (info / "entry_points.txt").write_text(f"[linkage_crosscheck.engines]\n{name} = {value}\n", encoding="utf-8")
    return folder


def compare(*arguments: str, cwd: Path, packages: Path) -> commands.Ended:
    """The command in this process, where the packages are installed for as long as it takes."""
    with mock.patch.object(sys, "path", [str(packages), str(EXAMPLE), *sys.path]):
        offers.cache_clear()
        try:
            return commands.compare(*arguments, cwd=cwd)
        finally:
            offers.cache_clear()


def compare_alone(*arguments: str, cwd: Path, packages: Path) -> commands.Ended:
    paths = [str(packages), str(EXAMPLE), os.environ.get("PYTHONPATH", "")]
    return commands.compare_alone(*arguments, cwd=cwd, PYTHONPATH=os.pathsep.join(filter(None, paths)))


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    ((name, value),) = project["entry-points"]["linkage_crosscheck.engines"].items()
    return installed(tmp_path_factory.mktemp("packages"), name, value)


def test_the_example_is_short() -> None:
    assert len((EXAMPLE / "multiplier_engine.py").read_text(encoding="utf-8").splitlines()) < 150


@pytest.mark.long_rows("driven-crank-rocker", "static-crank-rocker")
@pytest.mark.parametrize("case", ["paper", "crank-rocker", *slow("six-bar")])
@pytest.mark.parametrize("motion", ["driven", "static"])
def test_the_example_agrees_with_the_analytic_model(case: str, motion: str, packages: Path, tmp_path: Path) -> None:
    asked = ["--simulator", "multipliers", "--case", case, "--motion", motion, "--json", "--out", "out"]
    done = compare(*asked, cwd=tmp_path, packages=packages)
    assert done.returncode == 0, done.stderr
    (run,) = json.loads(done.stdout)["runs"]
    assert run["simulator"] == {"name": "multipliers", "version": "1.0"}
    assert run["joint_model"] == "ideal"
    assert max(abs(d["max"]) / d["tolerance"] for d in run["discrepancies"]) < 1e-6


def test_it_stands_beside_the_built_in_ones(packages: Path, tmp_path: Path) -> None:
    listed = json.loads(compare_alone("simulators", "--json", cwd=tmp_path, packages=packages).stdout)["simulators"]
    (mine,) = (engine for engine in listed if engine["name"] == "multipliers")
    assert mine["status"] == "installed"
    assert {s["joint_model"]: s["motions"] for s in mine["supports"]}["ideal"] == ["driven", "static"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["--case", "slider-crank"],
            "multipliers has no prismatic joints (for ideal joints in driven motion): leave out the prismatic",
        ),
        (["--joint", "contact"], "multipliers does not simulate contact joints in driven motion"),
        (["--flexible", "--motion", "static"], "'multipliers' has rigid links only"),
    ],
)
def test_what_it_does_not_do_is_refused(arguments: list[str], words: str, packages: Path, tmp_path: Path) -> None:
    done = compare("--simulator", "multipliers", *arguments, cwd=tmp_path, packages=packages)
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr


OFFERS = {
    "a module that is not there": (
        "mine",
        "nowhere:ENGINE",
        "simulator 'mine' is left out: its entry point nowhere:ENGINE",
    ),
    "no engine": ("mine", "json:dumps", "simulator 'mine' is left out: its entry point json:dumps is no engine"),
    "the name of a built-in one": (
        "exudyn",
        "json:dumps",
        "simulator 'exudyn' (json:dumps) has the name of a built-in",
    ),
}


@pytest.mark.parametrize("offer", ["a module that is not there", *slow("no engine", "the name of a built-in one")])
def test_an_offer_that_cannot_be_used_is_one_sentence(offer: str, tmp_path: Path) -> None:
    name, value, words = OFFERS[offer]
    packages = installed(tmp_path / "packages", name, value)
    asked = ["--simulator", "all", "--joint", "ideal", "--angles", "30:40:10", "--out", "out"]
    with commands.without("pybullet", "dartpy"):
        done = compare(*asked, cwd=tmp_path, packages=packages)
    assert done.returncode == 0, done.stderr
    (line,) = (line for line in done.stderr.splitlines() if words in line)
    assert line.startswith("left out: ")
    listed = compare("simulators", cwd=tmp_path, packages=packages)
    assert listed.returncode == 0, listed.stderr


WRONG = {
    "no signals": (
        "return replace(trace, signals={})",
        "its trace lacks reaction_D_x, reaction_D_y, reaction_A_x and 18 more signals; mend",
    ),
    "one signal less": (
        "return replace(trace, signals={n: v for n, v in trace.signals.items() if n != 'drive_torque'})",
        "its trace lacks drive_torque; mend",
    ),
    "rates of one body": (
        "return replace(trace, rates={'crank': trace.rates['crank']})",
        "its trace lacks rates of coupler, rates of follower; mend",
    ),
    "nothing": ("return None", "its answer is of type NoneType, not a Trace"),
    "a division by zero": (
        "return trace.crank_angle.size / 0",
        "it raised ZeroDivisionError (division by zero) at line ",
    ),
    "a key that is not there": ("return {}['mine']", "it raised KeyError ('mine') at line "),
    "no solution": (
        "return np.linalg.solve(np.zeros((2, 2)), np.ones(2))",
        "it raised LinAlgError (Singular matrix) at",
    ),
    "half of the angles": (
        "some = Schedule.at_angles(request.mechanism, request.schedule.crank_angle[:1])\n"
        "    return multiplier_engine.run(replace(request, schedule=some))",
        "its trace has 1 sample, and 2 were asked for",
    ),
}
BODY = """
from dataclasses import replace
import multiplier_engine
import numpy as np
from analytic.kinematics.schedule import Schedule
from sim_models.common.simulate import simulate

class Mine(multiplier_engine.MultiplierEngine):
    name = "mine"
    def simulate(self, request):
        return {answer}

def run(request):
    trace = multiplier_engine.run(request)
    {end}

ENGINE = Mine()
"""


@pytest.mark.parametrize("answer", ["simulate(self, request, run)", "run(request)"], ids=["checked", "on its own"])
@pytest.mark.parametrize("wrong", WRONG)
def test_an_engine_that_is_wrong_is_named_in_one_sentence(wrong: str, answer: str, tmp_path: Path) -> None:
    end, words = WRONG[wrong]
    packages = installed(tmp_path / "packages", "mine", "an_engine:ENGINE")
    (packages / "an_engine.py").write_text(BODY.format(answer=answer, end=end), encoding="utf-8")
    sys.modules.pop("an_engine", None)
    asked = ["--simulator", "mine", "--case", "crank-rocker", "--angles", "30:40:10"]
    for command in (asked, ["simulate", *asked]):
        done = compare(*command, "--out", command[0].strip("-"), cwd=tmp_path, packages=packages)
        assert done.returncode == 3, done.stderr
        (line,) = (text for text in done.stderr.splitlines() if not text.startswith("left out: "))
        assert line.startswith("compare: mine ideal driven (crank-rocker): the engine did not answer as it should: ")
        assert words in line
        assert "mend the engine, or use another simulator" in line
        if "raised" in words:
            assert "an_engine.py" in line
