"""A pick-and-place robot with two motors, held more often than it needs, by MSC Adams: not in this repository
(:mod:`tests.evidence.published.parallel_robot`).
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from sim_models.engine import ENGINES, declared, engine
from tests.evidence.published.parallel_robot import AT_REST, EVERY, FOLDER, recorded

DATA = Path(os.environ.get("MEASURED_DATA", ""))
HERE = pytest.mark.skipif(
    not (os.environ.get("MEASURED_DATA") and (DATA / FOLDER).is_dir()),
    reason="MEASURED_DATA is not set: the folder of real rigs",
)
SEVERAL = [
    name for name in ENGINES if ("several_drives", ("ideal", "driven")) in declared(name).capabilities.rigid.features
]


@HERE
def test_at_the_start_the_torques_are_adams_within_a_tenth_of_a_newton_metre() -> None:
    """131.237 N.m, at rest for an instant."""
    robot = recorded(DATA)
    found = robot.at_the_start()
    for name, torque in robot.torque.items():
        assert np.abs(found.drive_loads[name] - torque[robot.early]).max() < 0.1, name
    assert abs(abs(robot.torque["M1"][0]) - AT_REST) < 1e-3


@HERE
def test_in_motion_the_torques_are_adams_within_one_percent_of_the_peak() -> None:
    robot = recorded(DATA)
    found = robot.in_motion()
    for name, torque in robot.torque.items():
        assert np.abs(found.drive_loads[name] - torque)[robot.clear].max() < 0.01 * robot.peak, name
    assert len(found.undetermined) == 16  # one stress of its own reaches every joint


@HERE
@pytest.mark.slow
@pytest.mark.parametrize("name", SEVERAL)
def test_engines_give_adams_torques_at_the_start_and_within_one_percent_of_the_peak(name: str) -> None:
    robot = recorded(DATA)
    start = engine(name).simulate(robot.request_at_the_start())
    for joint, torque in robot.torque.items():
        assert np.abs(start.signals[f"drive_torque_{joint}"] - torque[robot.early]).max() < 0.1, joint
    trace = engine(name).simulate(robot.request())
    for joint, torque in robot.torque.items():
        off = trace.signals[f"drive_torque_{joint}"] - torque[robot.clear][::EVERY]
        assert np.abs(off).max() < 0.01 * robot.peak, joint


@HERE
@pytest.mark.slow
def test_the_recorded_torques_are_checked_as_any_programs(tmp_path: Path) -> None:
    columns = tmp_path / "columns.toml"
    columns.write_text(
        '[columns]\n"position_M2 [rad]" = { signal = "position_M2", unit = "rad", offset = 3.141592653589793 }\n',
        encoding="utf-8",
    )
    found = lc.check(DATA / FOLDER / "run.csv", DATA / FOLDER / "nominal.toml", map=columns)
    assert found.verdict == "agrees"
    assert {d.signal for d in found.runs[0].discrepancies} == {"drive_torque_M1", "drive_torque_M2"}
    assert any("statics does not determine the reactions" in warning for warning in found.warnings)
    # without the map nothing closes: the crank would be on the other side of its pivot
    with pytest.raises(lc.Error):
        lc.check(DATA / FOLDER / "run.csv", DATA / FOLDER / "nominal.toml")
