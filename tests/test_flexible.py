"""``--flexible``: beams in the engine against the paper's superposition of compliance on clearance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import commands
from analytic.mechanism.file import dumps, load
from asked import job_of
from compare.crosscheck import crosscheck_job
from compare.judge.flexible import Beams
from compare.judge.tolerances import load_tolerances
from sim_models.engine import Request, Trace

pytestmark = pytest.mark.exudyn

THETA = np.radians(np.arange(20.0, 161.0, 20.0))


def checked(resolve: Any = None, **changes: Any) -> dict[str, Any]:
    """The paper's case with flexible links at rest."""
    mechanism = load("paper").with_clearances({"B": 1e-3})
    fields = {"mechanism": mechanism, "motion": "static", "theta": THETA, "flexible": True} | changes
    return crosscheck_job(job_of(simulators=("exudyn",), tolerances=load_tolerances(None), **fields), resolve=resolve)


def outside(run: dict[str, Any]) -> set[str]:
    return {d.signal for d in run.discrepancies if d.verdict != "agrees"}


@pytest.mark.parametrize("joint_model", ["ideal", "contact"])
def test_beams_and_superposition_agree_on_where_the_bodies_are(joint_model: Any) -> None:
    (run,) = checked(joint_model=joint_model).runs
    assert not outside(run)
    assert {"coupler_x", "coupler_y", "follower_y"} <= {d.signal for d in run.discrepancies}
    (rigid,) = checked(joint_model=joint_model, flexible=False).runs
    sagged = np.abs(np.array(run.simulated["coupler_y"]) - np.array(rigid.simulated["coupler_y"])).max()
    allowed = next(d.tolerance for d in run.discrepancies if d.signal == "coupler_y")
    assert sagged > 1e-3  # m: 50 N on these links
    assert allowed < sagged / 20


class Softer:
    """An engine whose links are a tenth softer than it is told."""

    def __init__(self, name: str) -> None:
        self.beams = Beams.of(name)
        self.name, self.package, self.capabilities = self.beams.name, self.beams.package, self.beams.capabilities

    def simulate(self, request: Request) -> Trace:
        m = request.mechanism
        for body in m.bodies:
            if body.youngs_modulus is not None:
                m = m.with_body(body.name, youngs_modulus=0.9 * body.youngs_modulus)
        return self.beams.simulate(replace(request, mechanism=m))


def test_links_a_tenth_softer_on_one_side_are_noticed() -> None:
    (run,) = checked(Softer, joint_model="ideal").runs
    assert {"coupler_y", "follower_angle"} <= outside(run)
    assert not {name for name in outside(run) if name.startswith("reaction_")}  # forces hardly change


def test_small_loads_leave_little_to_allow() -> None:
    light = load("paper").replace(loads=tuple(x.model_copy(update={"force": (0.0, 0.5)}) for x in load("paper").loads))
    (run,) = checked(joint_model="ideal", mechanism=light).runs
    assert not outside(run)
    tolerances = {d.signal: d.tolerance for d in run.discrepancies}
    assert tolerances["reaction_B_magnitude"] < 3e-4  # N, of 0.7
    assert tolerances["coupler_y"] < 2e-8  # m, of 1e-5


def test_a_linkage_that_nothing_loads_agrees() -> None:
    found = checked(joint_model="ideal", mechanism=load("crank-rocker"))
    assert found.verdict == "agrees"
    assert all(d.tolerance > 0 for d in found.runs[0].discrepancies)


def compare(*arguments: str, cwd: Path) -> commands.Ended:
    return commands.compare(*arguments, "--out", "out", "--angles", "30:150:60", cwd=cwd)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["--simulator", "pybullet", "--motion", "static"],
            ["'pybullet' has rigid links only", "links bend in exudyn"],
        ),
        (["--simulator", "exudyn"], ["--flexible: flexible links are compared at rest", "static motion"]),
        (
            ["--simulator", "exudyn", "--motion", "static", "--joint", "massless-link", "--clearance", "B=1e-4"],
            ["massless-link", "contact static"],
        ),
    ],
)
def test_what_cannot_bend_is_refused_in_one_sentence(arguments: list[str], words: list[str], tmp_path: Path) -> None:
    done = compare(*arguments, "--flexible", cwd=tmp_path)
    commands.assert_refused(done, *words)


def test_a_linkage_without_a_modulus_is_refused(tmp_path: Path) -> None:
    stiff = load("paper")
    for body in stiff.bodies:
        stiff = stiff.with_body(body.name, youngs_modulus=None)
    (tmp_path / "stiff.toml").write_text(dumps(stiff), encoding="utf-8")
    done = compare("--simulator", "exudyn", "--motion", "static", "--case", "stiff.toml", "--flexible", cwd=tmp_path)
    assert done.returncode == 2
    assert "no body of paper has a youngs_modulus" in done.stderr


@pytest.mark.mujoco
def test_all_simulators_are_those_that_bend(tmp_path: Path) -> None:
    done = compare("--simulator", "all", "--motion", "static", "--clearance", "B=0", "--flexible", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "left out: simulator 'mujoco' has rigid links only" in done.stderr
    for page in ("report.html", "report.md"):
        text = (tmp_path / "out" / page).read_text(encoding="utf-8")
        assert "compliance of links and joints superposed" in text, page
