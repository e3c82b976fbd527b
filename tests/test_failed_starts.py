"""Starts that an engine cannot make: the run's failure, in words that help, and never the fault of an angle that nobody
asked for.
"""

from __future__ import annotations

import json
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import dumps, load
from asked import job_of, request_of
from commands import compare
from compare.crosscheck import crosscheck_job
from compare.domain_map.cell import examine
from compare.domain_map.map import MapPlan, cells
from compare.judge.tolerances import load_tolerances
from compare.report.words.validity import RPM
from sim_models.common.failed_starts import TooSoft, own_start
from sim_models.engine import Motion, Request, SimulationError, engine

ROCKER = load("crank-rocker").with_clearances({"B": 1e-4})
ANGLES = np.radians(np.arange(0.0, 360.0, 30.0))
SPRINGS = [
    ("mujoco", "driven"),
    ("exudyn", "driven"),
    ("pybullet", "driven"),
    ("dart", "driven"),
    ("mujoco", "static"),
    ("exudyn", "static"),
]


def soft(stiffness: float, clearance: float = 1e-4) -> Mechanism:
    return ROCKER.with_joint("B", clearance=clearance, contact_stiffness=stiffness)


def loaded(m: Mechanism) -> Mechanism:
    """With a torque that presses the pin at every crank angle, at rest too."""
    return m.replace(loads=(Load(body="follower", torque=-2.0),))


def request(m: Mechanism, motion: Motion, joint_model: str = "spring-damper") -> Request:
    return request_of(m, joint_model, motion, ANGLES, lead_in=2 * np.pi if motion == "driven" else 0.0)


@pytest.mark.parametrize(("name", "motion"), SPRINGS)
def test_a_contact_that_opens_beyond_a_link_is_too_soft_in_every_engine(name: str, motion: Motion) -> None:
    """100 N/m under 6 N (or 20 N at rest) give by more than half a link: no linkage is left of that length."""
    with pytest.raises(TooSoft) as caught:
        engine(name).simulate(request(loaded(soft(100.0)), motion))
    said = str(caught.value)
    assert said.startswith(f"{name} spring-damper {motion} (crank-rocker): contact too soft for this load: ")
    assert "give joint 'B' contact_stiffness = " in said
    if motion == "driven":
        assert "where the run starts that was asked for 0 to 330 deg" in said
    assert str(pickle.loads(pickle.dumps(caught.value))) == said


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mujoco", "exudyn", "dart"])
def test_the_stiffness_that_is_named_does(name: str) -> None:
    with pytest.raises(TooSoft) as caught:
        engine(name).simulate(request(soft(100.0), "driven"))
    named = re.search(r"contact_stiffness = (\S+) \(N/m\)", str(caught.value))
    assert named is not None
    trace = engine(name).simulate(request(soft(float(named[1])), "driven"))
    start = np.hypot(trace.signals["clearance_B_x"][0], trace.signals["clearance_B_y"][0])
    assert 1e-4 < start < 1.3e-4  # a tenth is for the load that the run starts with, which is not the largest


def test_the_figures_are_those_of_the_units_that_are_asked_for() -> None:
    with pytest.raises(TooSoft) as caught:
        engine("mujoco").simulate(request(soft(100.0), "driven"))
    stiffer = caught.value.of(soft(1000.0))
    assert "stiffness 1e+03 N/m" in str(stiffer)
    assert f"{10 * caught.value.times * 1e-4 * 100:.3g} N press" in str(stiffer)


def test_a_load_that_only_hides_the_clearance_is_simulated() -> None:
    """6 N on 1e5 N/m give by 0.06 mm, more than half of this clearance: the cross-check warns, and judges."""
    trace = engine("mujoco").simulate(request(soft(1e5), "driven"))
    assert trace.settings["contact_stiffness"] == 1e5


@pytest.mark.exudyn
@pytest.mark.slow
def test_one_engines_soft_start_leaves_the_other_runs_their_verdicts() -> None:
    job = job_of(soft(100.0, clearance=3e-3), ("mujoco", "exudyn"), load_tolerances(None), theta=ANGLES[:4])
    found = crosscheck_job(job)
    assert {(r.simulator.name, r.joint_model) for r in found.runs} >= {
        ("mujoco", "ideal"),
        ("exudyn", "ideal"),
        ("mujoco", "massless-link"),
    }
    assert {f.joint_model for f in found.failures} == {"spring-damper", "contact"}
    assert all("contact too soft for this load" in f.why for f in found.failures)


@pytest.mark.slow
@pytest.mark.mujoco
def test_the_command_writes_the_other_runs_and_leaves_with_status_3(tmp_path: Path) -> None:
    (tmp_path / "soft.toml").write_text(dumps(soft(100.0, clearance=3e-3)), encoding="utf-8")
    done = compare("--case", "soft.toml", "--simulator", "mujoco", "--angles", "0:90:30", "--out", "out", cwd=tmp_path)
    assert done.returncode == 3
    assert "contact too soft for this load" in done.stderr
    assert "cannot be reached" not in done.stderr
    written = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert {r["joint_model"]: r["verdict"] for r in written["runs"]}["ideal"] == "agrees"


@pytest.mark.mujoco
def test_an_absurd_speed_of_a_map_is_a_cell_that_failed_for_a_reason() -> None:
    grid = MapPlan(
        load("crank-rocker").with_joint("B", contact_stiffness=1e7),
        ("B",),
        (1e9 * RPM,),
        (1e-4,),
        ("mujoco",),
        "contact",
        load_tolerances(None),
    )
    (content,) = cells(grid)
    assert "contact too soft for this load" in examine(content)["failure"]


# ---------------------------------------------------------------- who asked for the angle


@pytest.mark.parametrize("name", ["mujoco", "exudyn", "pybullet", "dart"])
@pytest.mark.parametrize("motion", ["driven", "static"])
def test_an_angle_that_was_asked_for_and_is_out_of_reach_is_bad_input(name: str, motion: Motion) -> None:
    with pytest.raises(AssemblyError, match="change point at crank angle 0"):
        engine(name).simulate(request_of(load("paper"), "ideal", motion, np.radians([-10.0, 20.0])))


@pytest.mark.parametrize("name", ["mujoco", "exudyn", "pybullet", "dart"])
def test_rates_taken_from_beyond_a_change_point_are_the_runs_failure(name: str) -> None:
    """The paper's linkage locks at 0 deg; a run from 0.05 deg on takes its rates from both sides of that."""
    with pytest.raises(
        SimulationError, match=rf"{name} ideal driven \(paper\): the angles asked for can be reached.*change point"
    ):
        engine(name).simulate(request_of(load("paper"), "ideal", "driven", np.radians([0.05, 1.0])))


def test_what_is_not_asked_for_is_told_from_what_is() -> None:
    m = load("paper")
    assembly, asked = Assembly(m), request_of(m, crank_angle=np.radians([20.0, 30.0]))
    with (
        pytest.raises(
            SimulationError, match=r"mujoco ideal driven \(paper\): the angles asked for can be reached.*change point"
        ),
        own_start("mujoco", asked, assembly),
    ):
        assembly.coordinates(np.array([-0.1]))
    with pytest.raises(AssemblyError), own_start("mujoco", request_of(m, crank_angle=np.array([-0.1])), assembly):
        pytest.fail("it starts from an angle that cannot be reached")
