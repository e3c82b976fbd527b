"""Recorded results of any program, held against the analytic model: ``lc.check`` and ``compare check``.

The files are written from references in which the analytic side has no part: a pendulum's closed form, Lagrange
multipliers in maximal coordinates, an engine; or they come from a commercial program (MEASURED_DATA).
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import linkage_crosscheck as lc
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps, load
from analytic.mechanism.signals import Signal, named
from commands import compare
from compare.faults import ArgumentError
from compare.recorded.errors import DataError
from compare.results.crosscheck import CrossCheck
from marks import slow
from multiplier_oracle import Oracle

FOLDER = os.environ.get("MEASURED_DATA", "")
REAL = pytest.mark.skipif(not FOLDER, reason="MEASURED_DATA is not set: the folder with adams-fourbar, adams-pendulum")
FOUR_BAR = load("crank-rocker").with_clearances({})
FOLLOWED = FOUR_BAR.replace(drive={"joint": FOUR_BAR.drive_joint.name, "speed": "measured"})
ARM = load("pendulum")
MOTOR = ARM.replace(name="driven pendulum", drive={"joint": "O", "speed": "measured"})
MASS, LENGTH, GRAVITY = 0.2355, 0.3, 9.81
INERTIA = MASS * (LENGTH**2 / 3 + (0.01**2) / 12)  # kg.m^2 about the pin


def pendulum(
    time: np.ndarray, theta: np.ndarray, omega: np.ndarray, alpha: np.ndarray, mass: float = 1.0
) -> dict[str, np.ndarray]:
    """A bar on a pin in closed form, of so many times the mass: signals by heading."""
    turn = np.exp(1j * theta)
    com = LENGTH / 2 * turn
    acceleration = (1j * alpha - omega**2) * com
    force = mass * MASS * (acceleration + 1j * GRAVITY)
    return {
        "time [s]": time,
        "crank_angle [rad]": theta,
        "pendulum_x [m]": com.real,
        "pendulum_y [m]": com.imag,
        "pendulum_angular_velocity [rad/s]": omega,
        "reaction_O_x [N]": force.real,
        "reaction_O_y [N]": force.imag,
        "drive_torque [N.m]": mass * (INERTIA * alpha + MASS * GRAVITY * LENGTH / 2 * np.cos(theta)),
    }


def swung(samples: int = 600, mass: float = 1.0) -> dict[str, np.ndarray]:
    """The pendulum behind a motor that swings and drifts for 3 s."""
    time = np.linspace(0.0, 3.0, samples)
    theta = 0.8 * np.sin(4 * time) + 0.3 * time**2
    omega, alpha = 3.2 * np.cos(4 * time) + 0.6 * time, -12.8 * np.sin(4 * time) + 0.6
    return pendulum(time, theta, omega, alpha, mass)


def written(path: Path, columns: Mapping[str, np.ndarray], digits: int = 12) -> Path:
    rows = [
        ",".join(columns),
        *(",".join(f"{v:.{digits}g}" for v in row) for row in zip(*columns.values(), strict=True)),
    ]
    path.write_text("\n".join(rows) + "\n")
    return path


@cache
def turn() -> tuple[np.ndarray, np.ndarray]:
    """A full turn of the four-bar's crank from where it is assembled, every 2 deg: angles (N,) rad and poses."""
    oracle = Oracle(FOUR_BAR)
    return oracle.walk(oracle.start + 2 * np.pi)


def turning(degrees: float = 10.0) -> dict[str, np.ndarray]:
    """The four-bar at the speed of its drive, by multipliers: signals by heading."""
    theta, poses = (values[:: round(degrees / 2.0)] for values in turn())
    found = Oracle(FOUR_BAR).solve(theta, poses, True)
    columns = {"time [s]": theta / (FOUR_BAR.speed or 1.0), "crank_angle [deg]": np.degrees(theta)}
    for joint, force in found.forces.items():
        columns |= {f"reaction_{joint}_x [N]": force.real, f"reaction_{joint}_y [N]": force.imag}
    columns |= {f"{body}_x [mm]": 1e3 * place.real for body, place in found.places.items() if body != "ground"}
    columns |= {
        f"{body}_angle [rad]": angle for body, angle in found.angles.items() if body not in (FOUR_BAR.driven, "ground")
    }
    return columns | {"drive_torque [N.m]": found.torque}


def remarks(result: CrossCheck) -> list[str]:
    """What is said beside the verdict, but for what of the linkage is left out."""
    return [text for text in result.warnings if not text.startswith("left out: ")]


def worst(result: CrossCheck, simulator: str) -> dict[str, float]:
    """The largest difference of each recorded signal, over its peak in the run."""
    run = result.run(simulator)
    found = {}
    for name, values in run.simulated.items():
        if np.any(np.isfinite(values)):
            apart = np.abs(result.signals[name].apart(values, run.analytic[name]))
            scale = 1.0 if result.signals[name].wraps else np.nanmax(np.abs(run.analytic[name]))
            found[name] = float(np.nanmax(apart) / scale)
    return found


# ---------------------------------------------------------------- few digits, other units


@pytest.mark.parametrize("digits", [3, *slow(4, 6)])
def test_what_a_file_is_rounded_to_is_allowed(tmp_path: Path, digits: int) -> None:
    """Significant digits: the last of a force of 100 N is worth ten of those of 10 N."""
    result = lc.check(written(tmp_path / "short.csv", turning(), digits), FOUR_BAR)
    assert result.verdict == "agrees"


def test_a_crank_of_few_counts_is_where_its_time_says_and_that_is_said(tmp_path: Path) -> None:
    columns = turning(2.0)
    columns["crank_angle [deg]"] = 0.7 * np.floor(columns["crank_angle [deg]"] / 0.7 + 0.5)
    result = lc.check(written(tmp_path / "coarse.csv", columns), FOUR_BAR)
    assert result.verdict == "agrees"
    assert any("angles are rounded, by up to 0.3 deg" in text for text in result.warnings), result.warnings
    assert max(off for signal, off in worst(result, "coarse").items() if signal != "crank_angle") < 2e-3


@pytest.mark.parametrize("step", [7.5, *slow(5.0, 10.0, np.degrees(0.1))])
def test_a_crank_of_steps_beyond_a_sample_s_turn_is_where_its_time_says(tmp_path: Path, step: float) -> None:
    """Samples of a clock, 4 deg apart: none of these angles is as the time says, and none was chosen."""
    columns = turning(4.0)
    exact = np.degrees(FOUR_BAR.speed or 1.0) * columns["time [s]"]
    columns["crank_angle [deg]"] = step * np.round(exact / step)
    result = lc.check(written(tmp_path / "coarse.csv", columns), FOUR_BAR)
    run = result.run("coarse")
    assert "disagrees" not in {d.verdict for d in run.discrepancies}
    assert np.allclose(np.degrees(run.crank_angle), exact, atol=0.1 * step)  # nearer than half of a step
    assert "acceleration_known_to" not in run.settings
    assert any("coarse: its crank's angles are rounded, by up to " in text for text in result.warnings)
    assert not any("evenly" in text for text in remarks(result))


@pytest.mark.slow
def test_a_crank_of_steps_beyond_a_sample_s_turn_that_turns_unevenly_is_followed(tmp_path: Path) -> None:
    """A swing of 20 deg about an even turning is no rounding to 5 deg."""
    columns = turning(4.0)
    swinging = columns["crank_angle [deg]"] + 20 * np.sin(np.radians(columns["crank_angle [deg]"]))
    columns["crank_angle [deg]"] = 5 * np.round(swinging / 5)
    warnings = lc.check(written(tmp_path / "coarse.csv", columns), FOUR_BAR).warnings
    assert any("does not turn evenly at drive.speed" in text for text in warnings)


def test_a_wrong_torque_is_found_in_a_file_of_three_digits(tmp_path: Path) -> None:
    columns = turning()
    columns["drive_torque [N.m]"] = 1.05 * columns["drive_torque [N.m]"]
    result = lc.check(written(tmp_path / "short.csv", columns, 3), FOUR_BAR)
    assert [d.signal for d in result.run("short").discrepancies if d.verdict == "disagrees"] == ["drive_torque"]


@pytest.mark.long_rows(
    "drive_torque [[]N.m]-1000.0--1000 times the analytic side's: it looks in N.mm, but is read in N.m: say",
)  # fmt: skip
@pytest.mark.parametrize(
    ("column", "factor", "heading", "says"),
    [
        ("drive_torque [N.m]", 1e3, "", "1000 times the analytic side's: it looks in N.mm, but is read in N.m: say"),
        ("reaction_B_x [N]", -1.0, "", "it looks of the other sign or is the force on the other body"),
        *slow(
            ("reaction_B_x [N]", 1.0, "reaction_B_x [kN]", "it looks in N, but is read in kN"),
            ("follower_angle [rad]", np.pi / 180, "", "it looks converted from deg twice, but is read in rad"),
            ("drive_torque [N.m]", -1.0, "", "it looks of the other sign: say"),
            ("reaction_B_x [N]", 1e-3, "", "it looks in kN, but is read in N"),
            ("coupler_x [mm]", 1e-3, "", "it looks in m, but is read in mm"),
            ("follower_x [mm]", 1.0, "follower_x [m]", "it looks in mm, but is read in m"),
        ),
    ],
)
def test_a_column_in_another_unit_is_told_with_the_line_that_mends_it(
    tmp_path: Path, column: str, factor: float, heading: str, says: str
) -> None:
    columns = turning()
    columns[heading or column] = factor * columns.pop(column)
    path = written(tmp_path / "odd.csv", columns)
    result = lc.check(path, FOUR_BAR)
    assert result.verdict == "disagrees"
    (told,) = [text for text in result.warnings if says in text]
    mended = tmp_path / "columns.toml"
    mended.write_text(f"[columns]\n{told.partition(': say ')[2].removesuffix(' under [columns] of a map')}\n")
    assert lc.check(path, FOUR_BAR, map=mended).verdict == "agrees"


def test_the_line_of_a_map_keeps_what_the_map_said_of_the_column(tmp_path: Path) -> None:
    columns = turning()
    columns["T"] = -(columns.pop("drive_torque [N.m]") - 0.25) / 2
    entry = '"T" = {{ signal = "drive_torque", unit = "N.m", scale = 2.0, offset = {}, sign = {} }}'
    (tmp_path / "wrong.toml").write_text(f"[columns]\n{entry.format(-0.25, 1)}\n")
    path = written(tmp_path / "odd.csv", columns)
    (told,) = remarks(lc.check(path, FOUR_BAR, map=tmp_path / "wrong.toml"))
    assert 'say "T" = { signal = "drive_torque", unit = "N.m", scale = 2, offset = 0.25, sign = -1 } under' in told


OTHERWISE = {  # a clock or a crank that is not what its heading says: column, factor, heading, what a map has to say
    "crank in degrees": ("crank_angle [deg]", 1.0, "crank_angle [rad]", 'signal = "crank_angle", unit = "deg"'),
    "crank in radians": ("crank_angle [deg]", np.pi / 180, "crank_angle [deg]", 'signal = "crank_angle", unit = "rad"'),
    "crank in turns": ("crank_angle [deg]", 1 / 360, "crank_angle [deg]", 'signal = "crank_angle", unit = "rev"'),
    "crank reversed": ("crank_angle [deg]", -1.0, "crank_angle [deg]", 'crank_angle", unit = "deg", sign = -1'),
    "clock in ms": ("time [s]", 1e3, "time [s]", 'signal = "time", unit = "ms"'),
    "clock in s": ("time [s]", 1.0, "time [ms]", 'signal = "time", unit = "s"'),
}
QUICK = ("crank in degrees",)


@pytest.mark.parametrize("speed", ["measured", *slow("even")])
@pytest.mark.parametrize("what", [*QUICK, *slow(*(what for what in OTHERWISE if what not in QUICK))])
def test_a_clock_or_a_crank_that_is_meant_otherwise_is_told_with_the_line_that_mends_it(
    tmp_path: Path, what: str, speed: str
) -> None:
    column, factor, heading, says = OTHERWISE[what]
    m = FOLLOWED if speed == "measured" else FOUR_BAR
    columns = {heading if name == column else name: values for name, values in turning().items()}
    columns[heading] = factor * columns[heading]
    path = written(tmp_path / "odd.csv", columns)
    result = lc.check(path, m)
    compared = len(result.run("odd").discrepancies)
    assert result.verdict == "disagrees"
    (told,) = [text for text in result.warnings if "under [columns] of a map" in text]
    assert told.startswith(f"odd: {compared} of {compared} comparisons agree with {heading.split()[0]}")
    assert says in told
    assert not any("times the analytic side's" in text for text in result.warnings)
    mended = tmp_path / "columns.toml"
    mended.write_text(f"[columns]\n{told.partition(': say ')[2].removesuffix(' under [columns] of a map')}\n")
    assert lc.check(path, m, map=mended).verdict == "agrees"


@pytest.mark.slow
def test_a_clock_and_a_crank_that_are_both_meant_otherwise_are_told_together(tmp_path: Path) -> None:
    columns = {"time [s]": np.zeros(0), "crank_angle [rad]": np.zeros(0), **turning()}
    columns["crank_angle [rad]"] = columns.pop("crank_angle [deg]")
    columns["time [s]"] = 1e3 * columns["time [s]"]
    (told,) = remarks(lc.check(written(tmp_path / "odd.csv", columns), FOLLOWED))
    assert 'agree with crank_angle in deg and time in ms, 0 as it is read: say "crank_angle [rad]" = {' in told


@pytest.mark.parametrize(("step", "asked"), [(5.0, True), (7.5, True), (68.75493, True), (5.729578, False)])
def test_angles_that_look_like_degrees_are_asked_about_though_nothing_agrees_in_degrees_either(
    step: float, asked: bool, tmp_path: Path
) -> None:
    """The torque is another linkage's; three turns in steps of 0.1 rad may be meant."""
    angle = np.radians(np.arange(0.0, 1080.0, step))
    read = angle if not asked else np.degrees(angle)
    path = written(tmp_path / "odd.csv", {"crank_angle [rad]": read, "drive_torque [N.m]": np.sin(3 * angle)})
    result = lc.check(path, "crank-rocker")
    assert result.verdict == "disagrees"
    told = [text for text in result.warnings if "was it meant in degrees?" in text]
    assert len(told) == asked
    for text in told:
        assert text.startswith(
            f"odd: crank_angle goes to {read[-1]:.5g} rad, beyond two turns; was it meant in degrees?"
        )
        assert '"crank_angle [rad]" = { signal = "crank_angle", unit = "deg" } under [columns] of a map' in text


def test_a_crank_in_degrees_that_the_linkage_does_not_reach_is_told_in_the_refusal(tmp_path: Path) -> None:
    m = load("paper").with_clearances({})
    angles = np.radians(np.arange(20.0, 161.0, 5.0))
    run = lc.simulate(m, "mujoco", motion="static", angles=angles)
    columns = {"crank_angle [rad]": np.degrees(angles), "follower_angle [rad]": run.signals["follower_angle"]}
    with pytest.raises(DataError) as said:
        lc.check(written(tmp_path / "odd.csv", columns), m, motion="static")
    assert 'say "crank_angle [rad]" = { signal = "crank_angle", unit = "deg" } under [columns]' in str(said.value)


@pytest.mark.parametrize("column", ["drive_torque [N.m]", *slow("reaction_B_y [N]")])
def test_a_wrong_force_is_no_matter_of_the_clock_or_the_crank(tmp_path: Path, column: str) -> None:
    columns = turning()
    columns[column] = 1.1 * columns[column]
    result = lc.check(written(tmp_path / "odd.csv", columns), FOLLOWED)
    assert result.verdict == "disagrees"
    assert remarks(result) == []


# ---------------------------------------------------------------- what a file cannot tell


def test_a_column_that_agrees_only_as_its_allowance_hides_the_signal_is_not_judged(tmp_path: Path) -> None:
    """A torque of no more than its sign, in newton metres, is known to 1 N.m; the true one has a peak of 0.43 N.m."""
    columns = turning()
    torque = columns["drive_torque [N.m]"]
    exact = lc.check(written(tmp_path / "exact.csv", columns), FOUR_BAR)
    columns["drive_torque [N.m]"] = np.sign(torque)
    coarse = lc.check(written(tmp_path / "coarse.csv", columns), FOUR_BAR)
    assert np.abs(torque).max() == pytest.approx(0.4277, abs=1e-4)
    assert exact.verdict == "agrees"
    assert coarse.verdict == coarse.run("coarse").verdict == "unjudged"
    (hidden,) = [d for d in coarse.run("coarse").discrepancies if d.verdict != "agrees"]
    assert (hidden.signal, hidden.verdict) == ("drive_torque", "unjudged")
    assert hidden.tolerance is not None
    assert hidden.tolerance > 0.4277
    assert hidden.reason.startswith("not told apart: the allowance is larger than the signal (at most 0.42")


def test_a_coarse_column_whose_signal_is_larger_than_its_step_still_agrees(tmp_path: Path) -> None:
    columns = turning()
    columns["drive_torque [N.m]"] = np.round(columns["drive_torque [N.m]"], 1)
    result = lc.check(written(tmp_path / "coarse.csv", columns), FOUR_BAR)
    assert result.verdict == "agrees"


def test_a_torque_that_a_coarse_course_leaves_open_by_more_than_itself_is_not_judged(tmp_path: Path) -> None:
    """With a course of eight rows the right torque agreed, and so did none."""
    for size in (1.0, 0.0):
        columns = {name: values for name, values in swung(8).items() if not name.startswith("reaction")}
        columns["drive_torque [N.m]"] = size * columns["drive_torque [N.m]"]
        result = lc.check(written(tmp_path / "eight.csv", columns), MOTOR)
        verdicts = {d.signal: d.verdict for d in result.run("eight").discrepancies}
        assert (verdicts["drive_torque"], verdicts["pendulum_x"]) == ("unjudged", "agrees")
        assert result.verdict == "unjudged"


def test_a_zero_torque_has_no_per_cent_of_its_peak(tmp_path: Path) -> None:
    """A bar that turns evenly about its centre of mass needs no torque; a few rounded angles leave that open."""
    balanced = Mechanism.model_validate(
        {
            "name": "balanced",
            "ground": {"points": {"O": (0.0, 0.0)}},
            "body": [{"name": "bar", "points": {"O": (0.0, 0.0), "tip": (0.2, 0.0)}, "com": (0.0, 0.0), "mass": 0.5}],
            "joint": [{"name": "O", "type": "revolute", "bodies": ["ground", "bar"]}],
            "drive": {"joint": "O", "speed": "measured"},
            "assembly": {"bar": 0.0},
        }
    )
    time = np.linspace(0.0, 1.0, 18)
    columns = {"time [s]": time, "crank_angle [rad]": np.round(5 * time, 2), "drive_torque [N.m]": 0 * time}
    (told,) = lc.check(written(tmp_path / "few.csv", columns), balanced).warnings
    assert "% of its peak" not in told
    assert "and so drive_torque to " in told
    assert "N.m, more than its peak; that much is allowed on top" in told


def test_the_speed_of_a_crank_is_said_not_to_be_judged(tmp_path: Path) -> None:
    own = ("time [s]", "crank_angle [rad]", "pendulum_angular_velocity [rad/s]")
    columns = {name: values for name, values in swung(100).items() if name in own}
    alone = lc.check(written(tmp_path / "own.csv", columns), MOTOR)
    says = "pendulum_angular_velocity is not judged: the motion of the pendulum is prescribed, and the analytic side"
    assert alone.verdict == alone.run("own").verdict == "unjudged"
    assert alone.run("own").reason.startswith(says)
    beside = lc.check(written(tmp_path / "all.csv", swung(100)), MOTOR)
    assert beside.verdict == "agrees"
    assert [text for text in beside.warnings if text.startswith(f"all: {says}")]


def test_columns_that_nothing_is_held_against_are_said(tmp_path: Path) -> None:
    columns = turning()
    columns |= {f"position_{joint} [rad]": columns["follower_angle [rad]"] for joint in ("A", "B", "E")}
    columns |= {f"clearance_B_{axis} [m]": 0 * columns["follower_angle [rad]"] for axis in ("x", "y")}
    (said,) = remarks(lc.check(written(tmp_path / "more.csv", columns), FOUR_BAR))
    assert said == (
        "more: position_A, position_B, position_E, clearance_B_x and 1 more are not judged: a run with ideal joints is"
        " judged on other signals"
    )


def test_cells_without_a_number_are_one_sentence_of_all_columns(tmp_path: Path) -> None:
    columns = turning()
    forces = [name for name in columns if name.startswith(("reaction", "drive_torque"))]
    for name in forces:
        columns[name] = columns[name].copy()
        columns[name][[3, 8]] = np.nan
    result = lc.check(written(tmp_path / "gaps.csv", columns), FOUR_BAR)
    first, rows = ", ".join(name.split()[0] for name in forces[:4]), columns["time [s]"].size
    assert remarks(result) == [
        f"gaps: {first} and {len(forces) - 4} more are absent in 2 of {rows} rows, which are left out"
    ]
    columns[forces[0]][5] = np.nan
    (told,) = remarks(lc.check(written(tmp_path / "gaps.csv", columns), FOUR_BAR))
    assert f"are absent in 2 to 3 of {rows} rows" in told


@pytest.mark.parametrize("given", [{}, [], 3, None, {"": "a.csv"}, {"x": 3}], ids=str)
def test_results_that_are_no_files_are_one_sentence(given: Any) -> None:
    with pytest.raises(ArgumentError) as said:
        lc.check(given, FOUR_BAR)
    assert len(str(said.value)) < 200
    assert "give" in str(said.value)


# ---------------------------------------------------------------- what each column is held to


PAPER = load("paper").with_clearances({"B": 1e-4})
ANGLES = np.radians(np.arange(20.0, 161.0, 10.0))


def named_of(m: Mechanism) -> Mapping[str, Signal]:
    return named(m.bodies, m.joints, m.drives, m.sensors)


def off(result: CrossCheck) -> list[str]:
    return [d.signal for run in result.runs for d in run.discrepancies if d.verdict == "disagrees"]


def test_a_body_that_does_not_turn_is_judged_by_the_rate_of_what_does(tmp_path: Path) -> None:
    """The coupler of a parallelogram translates: an engine's rounding is no rate, a 1/1000 of the crank's rate is."""
    m = load("paper").with_clearances({})
    rates = {"coupler_angular_velocity [rad/s]": 1e-13 * np.cos(7 * ANGLES)}
    columns = {"crank_angle [rad]": ANGLES, "follower_angular_velocity [rad/s]": np.full(ANGLES.shape, m.speed)}
    result = lc.check(written(tmp_path / "still.csv", columns | rates, 17), m)
    tolerance = {d.signal: d.tolerance for d in result.run("still").discrepancies}
    assert result.verdict == "agrees"
    assert tolerance["coupler_angular_velocity"] == pytest.approx(1e-4 * np.pi / 2, rel=1e-6)
    rates = {"coupler_angular_velocity [rad/s]": np.full(ANGLES.shape, 1e-3 * np.pi / 2)}
    assert off(lc.check(written(tmp_path / "off.csv", columns | rates, 17), m)) == ["coupler_angular_velocity"]


def test_a_direction_alone_is_judged(tmp_path: Path) -> None:
    """Without the size of its force it was judged nowhere, and agreed whatever it said."""
    columns = turning()
    angle = np.angle(columns["reaction_B_x [N]"] + 1j * columns["reaction_B_y [N]"])
    for more, expected in ((0.0, []), (1e-2, ["reaction_B_angle"])):
        alone = {"crank_angle [deg]": columns["crank_angle [deg]"], "reaction_B_angle [rad]": angle + more}
        result = lc.check(written(tmp_path / "gamma.csv", alone), FOUR_BAR)
        assert [d.signal for d in result.run("gamma").discrepancies] == ["reaction_B_angle"]
        assert off(result) == expected


def test_a_force_between_two_walls_points_one_way_or_the_other_whatever_turn_it_is_told_in(tmp_path: Path) -> None:
    """A slide's reaction along +-y jumps by half a turn, which may be told either way round.  Its two values are no
    steps of rounding: they were taken to be known to a quarter of a turn.
    """
    m = load("slider-crank")
    found = lc.analyse(m).signals
    here = np.isfinite(found["reaction_S_angle"])
    rows = np.flatnonzero(here)[:34]
    assert len(set(np.sign(np.sin(found["reaction_S_angle"][rows])))) == 2
    for told, expected in ((0.0, []), (0.01, ["reaction_S_angle"]), (np.pi, ["reaction_S_angle"])):
        direction = np.angle(np.exp(1j * (found["reaction_S_angle"][rows] + told)))
        columns = {"crank_angle [rad]": found["crank_angle"][rows], "reaction_S_angle [rad]": direction}
        columns["reaction_S_magnitude [N]"] = found["reaction_S_magnitude"][rows]
        result = lc.check(written(tmp_path / "walls.csv", columns), m, joint_model="ideal")
        assert off(result) == expected
        assert not [text for text in result.warnings if "times the analytic side's" in text]


@cache
def resting() -> Mapping[str, np.ndarray]:
    """MuJoCo's paper linkage at rest on walls of 1e8 N/m: signals by name."""
    return lc.simulate(PAPER, "mujoco", joint_model="contact", motion="static", angles=ANGLES).signals


def in_contact() -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Its table by heading; and the sizes (N,) of the force on its walls."""
    signals = resting()
    units = {
        "follower_angle": "rad",
        "reaction_B_x": "N",
        "reaction_B_y": "N",
        "clearance_B_x": "m",
        "clearance_B_y": "m",
    }
    columns = {f"{name} [{unit}]": signals[name] for name, unit in units.items()}
    return {"crank_angle [rad]": ANGLES, **columns}, np.hypot(signals["reaction_B_x"], signals["reaction_B_y"])


def test_what_a_wall_gives_is_allowed_and_said(tmp_path: Path) -> None:
    """A pin goes into its wall by force over stiffness; how stiff that was is in no table."""
    columns, force = in_contact()
    gap = np.hypot(columns["clearance_B_x [m]"], columns["clearance_B_y [m]"])
    np.testing.assert_allclose(gap - 1e-4, force / 1e8, rtol=1e-3)
    path = written(tmp_path / "contact.csv", columns)
    result = lc.check(path, PAPER, motion="static")
    run = result.run("contact")
    allowed = {d.signal: d.tolerance for d in run.discrepancies}
    assert (result.verdict, run.settings["contact_stiffness"]) == ("agrees", 1e8)
    assert allowed["clearance_B_x"] == pytest.approx(1e-3 * 1e-4 + force.max() / 1e8, rel=1e-3)
    hard = lc.check(path, PAPER.with_joint("B", contact_stiffness=1e10), motion="static")
    assert hard.run("contact").settings["contact_stiffness"] == 1e10
    assert {"clearance_B_x", "follower_rotation"} & set(off(hard))
    ideal = lc.check(path, PAPER, motion="static", joint_model="massless-link")
    assert "contact_stiffness" not in ideal.run("contact").settings


@pytest.mark.slow
def test_walls_that_give_more_than_the_clearance_tell_nothing_of_it(tmp_path: Path) -> None:
    columns, _ = in_contact()
    columns |= {f"clearance_B_{axis} [m]": 0 * ANGLES for axis in ("x", "y")}
    path = written(tmp_path / "nothing.csv", columns)
    assert {"clearance_B_x", "clearance_B_y"} == set(off(lc.check(path, PAPER, motion="static")))
    soft = lc.check(path, PAPER.with_joint("B", contact_stiffness=1e5), motion="static")
    verdicts = {d.signal: d.verdict for d in soft.run("nothing").discrepancies}
    assert verdicts["clearance_B_x"] == verdicts["clearance_B_y"] == soft.verdict == "unjudged"


def test_a_rotation_is_judged_as_a_body_s_angle_is(tmp_path: Path) -> None:
    """The ideal follower of the parallelogram is parallel to the crank."""
    columns, _ = in_contact()
    angle = columns.pop("follower_angle [rad]")
    for share, expected in ((1.0, []), (1.5, ["follower_rotation"])):
        turned = {"follower_rotation [rad]": share * (angle - ANGLES)}
        result = lc.check(written(tmp_path / "turned.csv", columns | turned), PAPER, motion="static")
        assert off(result) == expected
        assert remarks(result) == []


@pytest.mark.long_rows("measured")
@pytest.mark.parametrize("speed", [load("paper").speed, "measured"])
def test_a_table_of_our_own_has_no_column_that_is_no_signal(tmp_path: Path, speed: float | str) -> None:
    found = lc.analyse(PAPER).signals
    columns = {f"{name} [{named_of(PAPER)[name].unit}]": values for name, values in found.items()}
    columns |= {"time [s]": (found["crank_angle"] - found["crank_angle"][0]) / PAPER.speed}
    m = PAPER.replace(drive={"joint": "D", "speed": speed})
    result = lc.check(written(tmp_path / "ours.csv", columns, 17), m)
    assert result.verdict == "agrees"
    assert not [text for text in result.warnings if "no signal of the linkage" in text]
    assert any("crank_angular_velocity and crank_rotation are not judged: the motion" in t for t in result.warnings)


@pytest.mark.parametrize("column", ["follower_rotation", *slow("reaction_B_magnitude", "reaction_B_angle")])
def test_a_column_that_says_something_else_than_those_it_follows_from_is_refused(tmp_path: Path, column: str) -> None:
    """The other columns were judged, and it was not."""
    columns, force = in_contact()
    turned = np.unwrap(np.angle(columns["reaction_B_x [N]"] + 1j * columns["reaction_B_y [N]"]))
    more = {
        "follower_rotation [rad]": columns["follower_angle [rad]"] - ANGLES,
        "reaction_B_magnitude [N]": force,
        "reaction_B_angle [rad]": turned,
    }
    path = written(tmp_path / "both.csv", columns | more)
    assert lc.check(path, PAPER, motion="static").verdict == "agrees"
    wrong = {name: (1.1 if name.startswith(column) else 1.0) * values for name, values in more.items()}
    with pytest.raises(DataError, match=rf"both\.csv: {column} is off by .* from what .*; leave one of them out"):
        lc.check(written(path, columns | wrong), PAPER, motion="static")


# ---------------------------------------------------------------- driven, on a course, released, at rest


def test_a_course_is_followed_exactly_where_it_is_dense(tmp_path: Path) -> None:
    result = lc.check(written(tmp_path / "other.csv", swung()), MOTOR)
    assert result.verdict == "agrees"
    assert max(worst(result, "other").values()) < 2e-6
    compared = {d.signal for d in result.run("other").discrepancies}
    assert {"reaction_O_angle", "reaction_O_magnitude", "drive_torque", "pendulum_x", "pendulum_y"} == compared


def test_a_wrong_mass_in_the_other_program_is_found(tmp_path: Path) -> None:
    """It must disagree: a check that cannot fail is none."""
    result = lc.check(written(tmp_path / "other.csv", swung(mass=1.01)), MOTOR)
    off = {d.signal: d.verdict for d in result.run("other").discrepancies}
    assert result.verdict == "disagrees"
    assert off["reaction_O_magnitude"] == off["drive_torque"] == "disagrees"
    assert off["pendulum_x"] == "agrees"


@pytest.mark.parametrize("samples", [20, 120, *slow(30, 40, 400)])
def test_a_coarse_course_says_how_exact_it_is(tmp_path: Path, samples: int) -> None:
    """What it allows on top covers the error that it makes; with a dense course nothing is said."""
    result = lc.check(written(tmp_path / "coarse.csv", swung(samples), digits=9), MOTOR)
    run = result.run("coarse")
    exact = swung(samples)
    error = np.abs(run.analytic["drive_torque"] - exact["drive_torque [N.m]"]).max() / INERTIA
    known = run.settings["acceleration_known_to"]
    assert isinstance(known, float)
    assert error < known
    assert result.verdict == "agrees"
    assert any("is recorded every" in text for text in result.warnings) == (samples < 100)


def test_a_wrong_mass_is_found_in_a_file_of_few_digits(tmp_path: Path) -> None:
    columns = swung(400, mass=1.02)
    rounded = {name: np.round(values, 4) for name, values in columns.items()}
    assert lc.check(written(tmp_path / "a.csv", rounded), MOTOR).verdict == "disagrees"
    good = {name: np.round(values, 4) for name, values in swung(400).items()}
    assert lc.check(written(tmp_path / "b.csv", good), MOTOR).verdict == "agrees"


@pytest.mark.parametrize("left_out", ["", "time [s]", "crank_angle [deg]"])
def test_a_crank_that_turns_evenly_needs_its_angle_or_its_time(tmp_path: Path, left_out: str) -> None:
    columns = {name: values for name, values in turning().items() if name != left_out}
    result = lc.check(written(tmp_path / "even.csv", columns), FOUR_BAR)
    assert result.verdict == "agrees"
    begins = (
        "even: does not say where its crank is; at time 0 it is taken to be at 0 deg, where the linkage is assembled"
    )
    assert remarks(result) == [begins] * (left_out == "crank_angle [deg]")
    assert max(worst(result, "even").values()) < 1e-9
    assert not result.over_time


def test_where_a_crank_is_taken_to_begin_is_said_of_a_clock_that_is_late(tmp_path: Path) -> None:
    """A clock 0.05 s late, at 2 rad/s from 0.5 rad: every signal is off, as the crank is not where it is assembled."""
    m = ARM.replace(name="turning", drive={"joint": "O", "speed": 2.0}, assembly={"pendulum": 0.5})
    time = np.linspace(0.0, 3.0, 200)
    columns = pendulum(time, 0.5 + 2.0 * (time - 0.05), np.full(200, 2.0), np.zeros(200))
    del columns["crank_angle [rad]"], columns["pendulum_angular_velocity [rad/s]"]
    result = lc.check(written(tmp_path / "late.csv", columns), m)
    assert {d.verdict for d in result.run("late").discrepancies} == {"disagrees"}
    says = "late: does not say where its crank is; at time 0 it is taken to be at 28.65 deg, where the linkage"
    assert f"{says} is assembled" in result.warnings


def test_a_crank_that_does_not_turn_as_its_drive_says_is_followed_and_that_is_said(tmp_path: Path) -> None:
    columns = turning()
    columns["time [s]"] = columns["time [s]"] * 1.02
    result = lc.check(written(tmp_path / "slow.csv", columns), FOUR_BAR)
    assert any("turns evenly, but at" in text and "rad/s where drive.speed = " in text for text in result.warnings)
    assert result.verdict == "disagrees"


def test_rows_at_rest_are_equilibria(tmp_path: Path) -> None:
    m = FOUR_BAR.replace(gravity=(0.0, -9.81))
    theta, poses = turn()
    found = Oracle(m).solve(theta, poses, False)
    columns = {"crank_angle [deg]": np.degrees(theta), "drive_torque [N.mm]": 1e3 * found.torque}
    columns |= {"reaction_B_x [N]": found.forces["B"].real, "reaction_B_y [N]": found.forces["B"].imag}
    result = lc.check(written(tmp_path / "rest.csv", columns), m, motion="static")
    assert result.verdict == "agrees"
    assert max(worst(result, "rest").values()) < 1e-9


def released(start: float, rate: float) -> dict[str, np.ndarray]:
    time = np.linspace(0.5, 2.5, 401)

    def motion(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -MASS * GRAVITY * LENGTH / 2 * np.cos(state[0]) / INERTIA]

    theta, omega = solve_ivp(motion, (0.5, 2.5), [start, rate], "DOP853", time, rtol=1e-12, atol=1e-12).y
    columns = pendulum(time, theta, omega, -MASS * GRAVITY * LENGTH / 2 * np.cos(theta) / INERTIA)
    return {name: values for name, values in columns.items() if name != "drive_torque [N.m]"}


def test_a_released_linkage_begins_where_the_file_begins(tmp_path: Path) -> None:
    result = lc.check(written(tmp_path / "free.csv", released(-0.4, 2.0)), ARM)
    assert result.verdict == "agrees"
    assert max(worst(result, "free").values()) < 1e-7
    assert "pendulum_angle" in {d.signal for d in result.run("free").discrepancies}


def test_a_pin_in_contact_is_judged_with_its_clearance(tmp_path: Path) -> None:
    m = load("paper").with_clearances({"B": 1e-4})
    angles = np.radians(np.arange(20.0, 161.0, 5.0))
    made = lc.crosscheck(m, "mujoco", joint_model="contact", angles=angles).run("mujoco", "contact")
    columns = {"crank_angle [rad]": angles}
    for name, unit in (("reaction_B_x", "N"), ("reaction_B_y", "N"), ("clearance_B_x", "m"), ("clearance_B_y", "m")):
        columns[f"{name} [{unit}]"] = made.simulated[name]
    path = written(tmp_path / "contact.csv", columns)
    result = lc.check(path, m)
    run = result.run("contact", "contact")
    assert (result.verdict, run.clearance) == ("agrees", {"B": 1e-4})
    assert {d.signal for d in run.discrepancies} == {
        "reaction_B_angle", "reaction_B_magnitude", "clearance_B_x", "clearance_B_y",
    }  # fmt: skip
    assert lc.check(path, m, clearance={"B": 2e-4}).verdict == "disagrees"


# ---------------------------------------------------------------- several files, engines beside


def test_engines_beside_and_a_file_that_is_wrong_stands_apart(tmp_path: Path) -> None:
    right = written(tmp_path / "right.csv", swung(150))
    wrong = written(tmp_path / "wrong.csv", swung(150, mass=1.05))
    result = lc.check([right, wrong], MOTOR, simulator="mujoco")
    assert [run.simulator.name for run in result.runs] == ["right", "wrong", "mujoco"]
    assert [run.verdict for run in result.runs] == ["agrees", "disagrees", "agrees"]
    assert result.odd_one_out == "wrong"
    assert "pendulum_x" in {d.signal for d in result.run("mujoco").discrepancies}


def test_tables_in_other_units_have_the_same_samples_and_of_other_rows_it_is_said(tmp_path: Path) -> None:
    """What minutes of nine digits and revolutions are rounded to parts no two programs."""
    right, wrong = swung(150), swung(150, mass=1.05)
    wrong["time [min]"] = wrong.pop("time [s]") / 60
    angle = next(name for name in wrong if "angle" in name)
    wrong["crank_angle [rev]"] = wrong.pop(angle) / (2 * np.pi if "rad" in angle else 360)
    files = [written(tmp_path / "right.csv", right), written(tmp_path / "wrong.csv", wrong, 9)]
    assert lc.check(files, MOTOR, simulator="mujoco").odd_one_out == "wrong"
    halved = written(tmp_path / "half.csv", {name: values[::2] for name, values in wrong.items()})
    result = lc.check([files[0], halved], MOTOR, simulator="mujoco")
    assert result.odd_one_out is None
    assert any(text.startswith("half: has other samples than right") for text in result.warnings)


@pytest.mark.parametrize("left_out", ["", *slow("time [s]")])
def test_who_stands_apart_is_asked_of_angles_as_of_times(tmp_path: Path, left_out: str) -> None:
    """The torque is 1.1 times the right one, in a table of crank angles as in one with times."""
    columns = {name: values for name, values in turning().items() if name != left_out}
    columns["drive_torque [N.m]"] = 1.1 * columns["drive_torque [N.m]"]
    result = lc.check(written(tmp_path / "theirs.csv", columns), FOUR_BAR, simulator="mujoco")
    assert result.odd_one_out == "theirs"
    assert result.words.startswith("theirs stands apart, most clearly in drive_torque: off by -0.0428 N.m")
    assert result.spread["drive_torque"].max == pytest.approx(0.0428, abs=1e-4)
    assert remarks(result) == []


def test_tables_of_one_motion_are_compared_whether_they_have_times_or_not(tmp_path: Path) -> None:
    timed = turning()
    files = [written(tmp_path / "timed.csv", timed)]
    files.append(written(tmp_path / "angles.csv", {n: v for n, v in timed.items() if n != "time [s]"}))
    result = lc.check(files, FOUR_BAR)
    assert (result.verdict, result.words, remarks(result)) == ("agrees", "all agree within the tolerances", [])


def test_tables_with_the_same_times_of_another_motion_are_not_compared(tmp_path: Path) -> None:
    time = np.linspace(0.0, 3.0, 150)
    files = []
    for name, size in (("wide", 0.8), ("narrow", 0.5)):
        theta, rate = size * np.sin(4 * time), 4 * size * np.cos(4 * time)
        files.append(written(tmp_path / f"{name}.csv", pendulum(time, theta, rate, -16 * theta)))
    result = lc.check(files, MOTOR)
    assert [run.verdict for run in result.runs] == ["agrees", "agrees"]
    assert result.spread == {}
    assert any(text.startswith("narrow: has other samples than wide") for text in result.warnings)


def test_a_crank_at_its_speed_is_held_to_it_beside_one_that_is_not(tmp_path: Path) -> None:
    """The table of angles was held to a crank at 1 rad/s, and disagreed by 987 times its forces."""
    columns = turning()
    files = [written(tmp_path / "angles.csv", {n: v for n, v in columns.items() if n != "time [s]"})]
    files.append(written(tmp_path / "slow.csv", {**columns, "time [s]": 1.02 * columns["time [s]"]}))
    result = lc.check(files, FOUR_BAR)
    assert [run.verdict for run in result.runs] == ["agrees", "disagrees"]


def test_a_table_of_a_few_equilibria_is_checked(tmp_path: Path) -> None:
    columns = {name: values[:: len(values) // 3] for name, values in turning().items() if not name.startswith("time")}
    columns = {name: values for name, values in columns.items() if "angle" in name}
    assert lc.check(written(tmp_path / "few.csv", columns), FOUR_BAR, motion="static").verdict == "agrees"


def test_a_table_of_equilibria_that_is_taken_as_driven_is_told(tmp_path: Path) -> None:
    m = FOUR_BAR.replace(loads=[{"body": "follower", "point": "B", "force": (40.0, 10.0)}])
    run = lc.simulate(m, "mujoco", motion="static", angles=np.radians(np.arange(10.0, 360.0, 25.0)))
    columns = {"crank_angle [rad]": run.crank_angle, "drive_torque [N.m]": run.signals["drive_torque"]}
    path = written(tmp_path / "still.csv", columns)
    result = lc.check(path, m)
    assert result.verdict == "disagrees"
    assert "still: agrees with the linkage at rest; compare it in static motion" in result.warnings
    assert lc.check(path, m, motion="static").verdict == "agrees"


def test_files_are_called_as_the_mapping_says_or_by_their_folders(tmp_path: Path) -> None:
    for program in ("adams", "simscape"):
        (tmp_path / program).mkdir()
        written(tmp_path / program / "run.csv", swung(100))
    files = [tmp_path / "adams" / "run.csv", tmp_path / "simscape" / "run.csv"]
    assert [run.simulator.name for run in lc.check(files, MOTOR).runs] == ["adams/run", "simscape/run"]
    named = lc.check({"Adams 2024": files[0], "Simscape": files[1]}, MOTOR)
    assert [run.simulator.name for run in named.runs] == ["Adams 2024", "Simscape"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["angles", *slow("released")])
def test_engines_simulate_what_the_file_has(tmp_path: Path, kind: str) -> None:
    columns, m = (turning(), FOUR_BAR) if kind == "angles" else (released(-0.4, 2.0), ARM)
    result = lc.check(written(tmp_path / "a.csv", columns), m, simulator="mujoco,exudyn")
    assert result.verdict == "agrees", result.runs
    assert result.words == "all agree within the tolerances"


# ---------------------------------------------------------------- another program, its own headings


@REAL
def test_adams_four_bar() -> None:
    """MSC Adams' torque over 2000 samples, the ends included: within 0.02 % of its peak."""
    folder = Path(FOLDER) / "adams-fourbar"
    result = lc.check(folder / "run.csv", folder / "nominal.toml")
    assert result.verdict == "agrees"
    assert result.run("run").crank_angle.size == 2000
    assert worst(result, "run")["drive_torque"] < 2e-4


@REAL
def test_adams_pendulum() -> None:
    """MSC Adams' released pendulum: positions, velocities and reactions within 0.02 % of each peak."""
    folder = Path(FOLDER) / "adams-pendulum"
    result = lc.check(folder / "run.csv", folder / "nominal.toml")
    off = worst(result, "run")
    assert result.verdict == "agrees"
    assert set(off) >= {"arm_x", "arm_y", "arm_angle", "arm_angular_velocity", "reaction_O_x", "reaction_O_y"}
    assert max(share for name, share in off.items() if name != "reaction_O_angle") < 2e-4


@REAL
@pytest.mark.slow
@pytest.mark.parametrize("case", ["adams-fourbar", "adams-pendulum"])
def test_every_engine_agrees_with_adams(case: str) -> None:
    folder = Path(FOLDER) / case
    result = lc.check(folder / "run.csv", folder / "nominal.toml", simulator="all")
    assert result.verdict == "agrees"
    assert result.odd_one_out is None


def test_a_map_tells_what_the_columns_are(tmp_path: Path) -> None:
    columns = swung(100)
    own = {
        "Time": 1e3 * columns["time [s]"],
        "MOTION_1": -np.degrees(columns["crank_angle [rad]"]),
        "JOINT_1.FX": -columns["reaction_O_x [N]"],
        "JOINT_1.FY": -columns["reaction_O_y [N]"],
        "cpu": columns["time [s]"],
    }
    (tmp_path / "map.toml").write_text(
        '[columns]\n"Time" = { signal = "time", unit = "ms" }\n'
        '"MOTION_1" = { signal = "crank_angle", unit = "deg", sign = -1 }\n'
        '"JOINT_1.FX" = { signal = "reaction_O_x", unit = "N", sign = -1 }\n'
        '"JOINT_1.FY" = { signal = "reaction_O_y", unit = "N", sign = -1 }\n"cpu" = "ignore"\n'
    )
    result = lc.check(written(tmp_path / "adams.csv", own), MOTOR, map=tmp_path / "map.toml")
    assert result.verdict == "agrees"
    assert set(worst(result, "adams")) >= {"reaction_O_x", "reaction_O_angle"}


# ---------------------------------------------------------------- the command


@pytest.fixture
def case(tmp_path: Path) -> Path:
    path = tmp_path / "case.toml"
    path.write_text(dumps(MOTOR))
    return path


def test_the_command_writes_what_a_cross_check_writes(tmp_path: Path, case: Path) -> None:
    written(tmp_path / "good.csv", swung(120))
    ended = compare("check", "good.csv", "--case", str(case), cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    folder = tmp_path / "reports" / "case-good"
    assert {"result.json", "report.html", "report.md", "junit.xml", "signals.csv"} <= {p.name for p in folder.iterdir()}
    fields: dict[str, Any] = json.loads((folder / "result.json").read_text())
    assert fields["runs"][0]["simulator"] == {"name": "good", "version": "recorded"}
    assert "follows a recorded course" in (folder / "report.html").read_text()
    shown = compare("show", str(folder / "result.json"), "--signal", "drive_torque", "--at", "1.0", cwd=tmp_path)
    assert "file = good.csv" in shown.stdout
    written(tmp_path / "bad.csv", swung(120, mass=1.1))
    assert compare("check", "bad.csv", "--case", str(case), "--quiet", cwd=tmp_path).returncode == 1


def test_a_signal_that_is_not_judged_is_told_everywhere_and_ends_with_status_1(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(dumps(FOUR_BAR))
    columns = turning()
    columns["drive_torque [N.m]"] = np.sign(columns["drive_torque [N.m]"])
    written(tmp_path / "coarse.csv", columns)
    ended = compare("check", "coarse.csv", "--case", "case.toml", "--out", "out", cwd=tmp_path)
    assert ended.returncode == 1, ended.stderr
    assert "crank-rocker: NOT JUDGED" in ended.stdout
    assert "1 of 14 comparisons in 1 of 1 run is not judged: drive torque (coarse, ideal):" in " ".join(
        ended.stdout.split()
    )
    told = {name: (tmp_path / "out" / name).read_text() for name in ("junit.xml", "report.md", "report.html")}
    assert all("not told apart: the allowance is larger than the signal" in text for text in told.values())
    assert 'tests="14" failures="1"' in told["junit.xml"]
    assert 'type="not judged"' in told["junit.xml"]


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"crank_angle [rad]": 1, "drive_torque [N.m]": 1}, "has no column of time"),
        ({"time [s]": 1, "drive_torque [N.m]": 1}, "nothing else says where the crank is"),
        ({"time [s]": 1, "crank_angle [rad]": 1}, "has no signal beside 'pendulum_angle'"),
        ({"time [s]": 1, "crank_angle [rad]": 1, "torque [N.m]": 1}, "did you mean 'drive_torque'"),
        ({"time [s]": 1, "crank_angle [rad]": 1, "drive_torque": 1}, "no unit"),
        ({"time [s]": 1, "crank_angle [rad]": 1, "reaction_A_x [N]": 1}, "did you mean 'reaction_O_x'"),
    ],
)
def test_bad_files_are_one_sentence_and_nothing_is_written(
    tmp_path: Path, case: Path, columns: Mapping[str, float], says: str
) -> None:
    samples = np.linspace(0.0, 1.0, 40)
    written(tmp_path / "x.csv", dict.fromkeys(columns, samples))
    ended = compare("check", "x.csv", "--case", str(case), cwd=tmp_path)
    assert ended.returncode == 2
    assert ended.stderr.startswith("compare: x.csv: ")
    assert says in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert not (tmp_path / "reports").exists()


def test_an_angle_that_the_linkage_does_not_reach_names_the_file(tmp_path: Path) -> None:
    columns = {"crank_angle [deg]": np.linspace(0, 700, 60), "drive_torque [N.m]": np.ones(60)}
    with pytest.raises(DataError, match=r"x\.csv: .*check the angles, their unit and their sign"):
        lc.check(written(tmp_path / "x.csv", columns), load("paper").with_clearances({}))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[columns]\n"x" = 3', "columns"),
        ("[column]\n", "column is not a field; did you mean 'columns'"),
        ("columns = [", "cannot be read as TOML"),
        ('[columns]\n"nothing" = "ignore"', "columns.'nothing' is no heading of a data file"),
    ],
)
def test_a_bad_map_is_one_sentence(tmp_path: Path, case: Path, text: str, says: str) -> None:
    written(tmp_path / "x.csv", swung(50))
    (tmp_path / "map.toml").write_text(text)
    ended = compare("check", "x.csv", "--case", str(case), "--map", "map.toml", cwd=tmp_path)
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)
    assert says in ended.stderr


def test_results_have_baselines_like_any_engine(tmp_path: Path, case: Path) -> None:
    written(tmp_path / "adams.csv", swung(200))
    same = ("--case", str(case), "--results", "adams.csv", "--baselines", "kept")
    assert compare("baseline", "update", *same, cwd=tmp_path).returncode == 0
    assert (tmp_path / "kept" / "driven-pendulum-adams.toml").is_file()
    assert compare("baseline", "check", *same, cwd=tmp_path).returncode == 0
    written(tmp_path / "adams.csv", swung(200, mass=1.001))
    moved = compare("baseline", "check", *same, "--quiet", cwd=tmp_path)
    assert moved.returncode == 1
    written(tmp_path / "adams.csv", swung(100))
    other = compare("baseline", "check", *same, "--quiet", cwd=tmp_path)
    assert (other.returncode, other.stderr.count("\n")) == (2, 1)
    assert "is at other crank angles" in other.stderr or "another number of crank angles" in other.stderr
    unnamed = compare("baseline", "check", "--results", "adams.csv", cwd=tmp_path)
    assert (unnamed.returncode, unnamed.stderr.count("\n")) == (2, 1)
