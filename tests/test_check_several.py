"""Recorded results of several drives: what their positions' digits leave open, and whether their clock is right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Schedule, Turning
from compare.judge.reference import SIGMAS, reference
from marks import slow
from measured_files import written
from several_linkages import arm
from sim_models.engine import Motion

TIME = np.linspace(0.0, 0.4, 17)
RPR = ("position_S1 [m]", "position_S2 [m]", "position_S3 [m]", "platform_x [m]", "platform_angle [rad]")
FORCES = tuple(f"drive_force_S{leg} [N]" for leg in "123")
ARM = arm((2.0, -1.0), (1.234567, 1.583456))


def recorded(name: str = "3-rpr", time: np.ndarray = TIME) -> dict[str, np.ndarray]:
    own = lc.analyse(name, times=time).signals
    return {"time [s]": time} | {heading: own[heading.split()[0]] for heading in (*RPR, *FORCES)}


@pytest.mark.parametrize("digits", [4, *slow(3, 5, 6, 12)])
def test_what_the_digits_of_drives_leave_open_is_allowed_for(digits: int, tmp_path: Path) -> None:
    """Drives at constant speed step evenly: that they are rounded only their own motion tells."""
    assert lc.check(written(tmp_path / "own.csv", recorded(), digits), "3-rpr").verdict == "agrees"


@pytest.mark.slow
@pytest.mark.parametrize("digits", [3, 4, 5, 12])
def test_what_is_off_by_more_than_they_leave_open_disagrees(digits: int, tmp_path: Path) -> None:
    columns = recorded()
    columns["platform_x [m]"] = columns["platform_x [m]"] + 10.0 * 10.0 ** -min(digits, 4)
    assert lc.check(written(tmp_path / "off.csv", columns, digits), "3-rpr").verdict == "disagrees"


def test_steps_that_a_signal_has_of_a_rounded_encoder_are_not_its_own(tmp_path: Path) -> None:
    """A crank of a 3-RRR in three digits: where it is climbs stairs by its encoder, and is rounded besides."""
    time = np.linspace(0.0, 0.4, 41)
    own = lc.analyse("3-rrr", times=time).signals
    headings = [f"position_A{leg} [rad]" for leg in "123"]
    columns = {"time [s]": time} | {heading: own[heading.split()[0]] for heading in (*headings, "crank3_y [m]")}
    assert lc.check(written(tmp_path / "own.csv", columns, 3), "3-rrr").verdict == "agrees"


def test_so_it_is_at_rest(tmp_path: Path) -> None:
    own = lc.analyse("3-rpr", times=TIME, motion="static").signals
    columns = {"time [s]": TIME} | {heading: own[heading.split()[0]] for heading in (*RPR, *FORCES)}
    for digits in (3, 4):
        path = written(tmp_path / f"{digits}.csv", columns, digits)
        assert lc.check(path, "3-rpr", motion="static").verdict == "agrees"


@pytest.mark.parametrize("motion", ["driven", "static"])
def test_positions_leave_a_place_open_by_the_sum_of_what_each_drive_moves_it(motion: Motion) -> None:
    """The forearm's middle of an arm, by its angles: x = 0.1 cos D + 0.08 cos (D + A)."""
    assembly, off = Assembly(ARM), {"D": 4e-4, "A": 3e-4}
    at = {"D": 1.234567 + 2.0 * TIME, "A": 0.348889 - TIME}
    errors = assembly.inputs_at({name: np.full(TIME.size, each / SIGMAS) for name, each in off.items()})
    schedule = Schedule.along({name: (TIME, values) for name, values in at.items()}, TIME, at_rest=motion == "static")
    side = reference(assembly, schedule, "equilibrium", {}, None, Turning(errors, 0 * errors, 0 * errors))
    by_a = 0.08 * np.sin(at["D"] + at["A"])
    by_d = 0.1 * np.sin(at["D"]) + by_a
    wanted = np.abs(by_d) * off["D"] + np.abs(by_a) * off["A"]
    assert SIGMAS * side.unsure["fore_x"] == pytest.approx(wanted, abs=2e-8)  # m, second order of the angles
    assert SIGMAS * side.unsure["fore_angle"] == pytest.approx(7e-4)


def mended(folder: Path, warning: str) -> Path:
    """The map that a warning says."""
    lines = warning.partition(": say ")[2].removesuffix(" under [columns] of a map").split(" and ")
    path = folder / "columns.toml"
    path.write_text("\n".join(["[columns]", *lines]) + "\n")
    return path


def test_a_clock_by_which_no_drive_has_its_speed_is_told_though_all_agrees(tmp_path: Path) -> None:
    """Legs of 0.05, -0.03 and 0.02 m/s hardly accelerate anything, whatever the clock."""
    path = written(tmp_path / "ms.csv", recorded() | {"time [s]": 1e3 * TIME}, 9)
    result = lc.check(path, "3-rpr")
    assert result.verdict == "agrees"
    speeds, clock = result.warnings
    for leg, speed in enumerate((0.05, -0.03, 0.02), 1):
        words = f"joint S{leg} moves evenly, but at {speed / 1000:g} m/s where drive.speed = {speed:g}"
        assert words in speeds
    assert 'with time in ms drive.speed holds: say "time [s]" = { signal = "time", unit = "ms" } under' in clock
    assert lc.check(path, "3-rpr", map=mended(tmp_path, clock)).warnings == ()


def test_a_drive_that_does_not_keep_its_speed_is_told(tmp_path: Path) -> None:
    m, time = ARM, np.linspace(0.0, 0.4, 41)
    courses = {"D": 1.234567 + 2.0 * time, "A": 0.348889 - np.sin(time)}
    columns = {"time [s]": time} | {f"position_{name} [rad]": values for name, values in courses.items()}
    columns["fore_angle [rad]"] = courses["D"] + courses["A"]
    result = lc.check(written(tmp_path / "own.csv", columns, 12), m)
    assert result.verdict == "agrees"
    assert result.warnings == (
        "own: joint A does not turn evenly at drive.speed = -1 rad/s; its recorded course is followed, and drive.speed"
        " left out",
    )


def test_encoders_in_each_others_place_are_told_with_the_lines_that_mend_it(tmp_path: Path) -> None:
    m = ARM
    own = lc.analyse(m, times=TIME).signals
    headings = ("position_A [rad]", "position_D [rad]", "fore_x [m]", "drive_torque_D [N.m]", "drive_torque_A [N.m]")
    columns = {"time [s]": TIME} | {heading: own[heading.split()[0]] for heading in headings}
    first, second = headings[:2]
    path = written(tmp_path / "swap.csv", columns | {first: columns[second], second: columns[first]}, 9)
    result = lc.check(path, m)
    assert result.verdict == "disagrees"
    (told,) = [text for text in result.warnings if "under [columns] of a map" in text]
    assert "3 of 3 comparisons agree with position_D in the place of position_A and position_A in the place of" in told
    assert lc.check(path, m, map=mended(tmp_path, told)).verdict == "agrees"
