"""Which turn an angle of a file belongs to: what goes on beyond a turn is followed as it is written, what starts again
after one is continued, and what does not say which way it turned is refused.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism.file import load
from compare.recorded.errors import DataError
from measured_files import written
from several_linkages import arm

ARM = arm((40.0, 7.0), (1.3, 0.0))
ROWS = np.arange(8)
BETWEEN = {  # deg by row, as a file tells it, and as it is followed
    "200 a row, on beyond a turn": (200.0 * ROWS, 200.0 * ROWS),
    "370 a row": (370.0 * ROWS, 370.0 * ROWS),
    "-200 a row": (-200.0 * ROWS, -200.0 * ROWS),
    "60 a row from 0 to 360": (60.0 * ROWS % 360, 60.0 * ROWS),
    "-60 a row from -180 to 180": ((180 - 60.0 * ROWS) % 360 - 180, -60.0 * ROWS),
    "90 a row from 0 to 360": (90.0 * ROWS % 360, 90.0 * ROWS),
    "swings by 170": (170.0 * (ROWS % 2), 170.0 * (ROWS % 2)),
}


@pytest.mark.parametrize("told", BETWEEN)
def test_what_goes_on_beyond_a_turn_is_followed_as_written_and_what_starts_again_is_continued(
    told: str, tmp_path: Path
) -> None:
    angles, wanted = (np.radians(degrees) for degrees in BETWEEN[told])
    columns = {"time [s]": 0.1 * ROWS, "position_A [rad]": np.radians(ROWS)}
    arm = lc.analyse(
        ARM, course=written(tmp_path / "arm.csv", {**columns, "position_D [rad]": angles}), times=0.1 * ROWS
    )
    crank = lc.analyse(
        "crank-rocker",
        course=written(tmp_path / "crank.csv", {"time [s]": 0.1 * ROWS, "position_D [rad]": angles}),
        times=0.1 * ROWS,
    )
    path = {"time [s]": 0.1 * ROWS, "upper_angle [rad]": np.radians(ROWS), "fore_angle [rad]": angles}
    along = lc.analyse(ARM, path=written(tmp_path / "path.csv", path), times=0.1 * ROWS)
    for angle in (arm.signals["position_D"], crank.signals["crank_angle"], along.signals["fore_angle"]):
        assert angle - angle[0] == pytest.approx(wanted, abs=1e-9)


UNTOLD = {"200 a row": 200.0 * ROWS % 360, "0 and 180": 180.0 * (ROWS % 2), "0 and 200, held": 200.0 * (ROWS // 3 % 2)}


@pytest.mark.parametrize("told", UNTOLD)
def test_an_angle_within_a_turn_that_does_not_say_which_way_it_turned_is_refused(told: str, tmp_path: Path) -> None:
    angle, time = UNTOLD[told], 0.1 * ROWS
    columns = {"time [s]": time, "position_D [deg]": angle, "position_A [deg]": 0 * time}
    course = written(tmp_path / "c.csv", columns)
    with pytest.raises(DataError, match=r"c\.csv: 'position_D' stays within one turn and steps by 1[68]0 deg"):
        lc.analyse(ARM, course=course)
    path = written(tmp_path / "p.csv", {"time [s]": time, "upper_angle [deg]": 0 * time, "fore_angle [deg]": angle})
    with pytest.raises(DataError, match="'fore_angle' stays within one turn"):
        lc.analyse(ARM, path=path)
    with pytest.raises(DataError, match="'position_D' stays within one turn"):
        lc.check(written(tmp_path / "r.csv", {**columns, "upper_x [m]": 0 * time}), ARM)
    recorded = {"time [s]": time, "crank_angle [deg]": angle, "drive_torque [N.m]": 0 * time}
    with pytest.raises(DataError, match="'crank_angle' stays within one turn"):
        lc.check(written(tmp_path / "k.csv", recorded), "crank-rocker")


def test_a_crank_that_starts_again_after_a_turn_is_known_by_the_speed_of_its_drive(tmp_path: Path) -> None:
    """120 degrees from row to row say which way it turned where its drive's speed does."""
    m = load("crank-rocker")
    assert m.speed is not None
    angles = np.radians(120.0) * ROWS + 0.2
    angle = angles % (2 * np.pi)
    torque = lc.analyse(m, angles=angle).signals["drive_torque"]
    columns = {"time [s]": angles / m.speed, "crank_angle [rad]": angle, "drive_torque [N.m]": torque}
    assert lc.check(written(tmp_path / "c.csv", columns), m).verdict == "agrees"


def test_a_check_of_ones_own_results_agrees_though_a_drive_turns_on_by_more_than_half_a_turn(tmp_path: Path) -> None:
    m, time = ARM, np.linspace(0.0, 1.5, 16)
    own = lc.analyse(m, times=time).signals
    columns = {"time [s]": time} | {
        f"{name} [{unit}]": own[name]
        for name, unit in (("position_D", "rad"), ("position_A", "rad"), ("fore_x", "m"), ("drive_torque_D", "N.m"))
    }
    assert np.diff(own["position_D"]) == pytest.approx(4.0)
    assert lc.check(written(tmp_path / "own.csv", columns), m).verdict == "agrees"
