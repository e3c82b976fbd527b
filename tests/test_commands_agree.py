"""One case asked of several commands, from Python and from the command line, gets one set of numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.signals import named
from commands import compare
from marks import slow
from sim_models.engine import ENGINES, Motion, declared

GAPS = {  # of the two platforms of three legs one
    "paper": {"B": 1e-4}, "crank-rocker": {"B": 1e-4, "E": 5e-5}, "slider-crank": {"B": 1e-4}, "six-bar": {"F": 1e-4},
    "pendulum": {}, "2r-arm": {"K": 1e-4}, "five-bar": {"P": 1e-4}, "3-rpr": {"C1": 1e-4},
}  # fmt: skip
UNLOADED = ("crank-rocker", "slider-crank")  # at rest nothing presses their pins
QUICK = ("crank-rocker", "pendulum", "five-bar")  # the others are in the long suite
ANGLES, TIMES = (20, 80, 5), (0.0, 0.12, 0.01)  # deg, s


@dataclass(frozen=True)
class Asked:
    """One case: its motion, and whether its pins have clearance."""

    case: str
    motion: Motion
    loose: bool

    def __str__(self) -> str:
        return f"{self.case}, {self.motion}, {'clearance' if self.loose else 'ideal'}"

    @property
    def m(self) -> Mechanism:
        """The mechanism as it ships."""
        return load(self.case)

    @property
    def quick(self) -> bool:
        """Whether it is in the fast suite."""
        return self.case in QUICK and not (self.loose and self.m.several)

    @property
    def clearance(self) -> dict[str, float]:
        """m, by joint."""
        return GAPS[self.case] if self.loose else {}

    @property
    def joint(self) -> Any:
        """What joints with clearance are, in engines."""
        return "contact" if self.loose else "ideal"

    @property
    def grid(self) -> tuple[str, tuple[float, float, float]] | None:
        """Crank angles or times: start, stop, step; a pendulum that swings has its own."""
        if self.case == "pendulum":
            return ("angles", ANGLES) if self.motion == "static" else None
        return ("angles", ANGLES) if self.m.cranked else ("times", TIMES)

    @property
    def python(self) -> dict[str, Any]:
        """The question as arguments."""
        grid = {}
        if self.grid is not None:
            name, (start, stop, step) = self.grid
            at = start + step * np.arange(round((stop - start) / step) + 1)
            grid = {name: np.radians(at) if name == "angles" else at}
        return {"motion": self.motion, "clearance": self.clearance, **grid}

    @property
    def typed(self) -> list[str]:
        """The question as options."""
        grid = [] if self.grid is None else [f"--{self.grid[0]}", ":".join(map(str, self.grid[1]))]
        gaps = ",".join(f"{joint}={size}" for joint, size in self.clearance.items()) or f"{self.m.joints[0].name}=0"
        return ["--case", self.case, "--motion", self.motion, "--clearance", gaps, *grid]


EVERY = [
    asked
    for case in GAPS
    for motion in ("driven", "static")
    for loose in (False, True)
    if (asked := Asked(case, motion, loose)) and (not loose or GAPS[case])
    if not (loose and motion == "static" and case in UNLOADED)
]


def able(asked: Asked, engine: str) -> bool:
    """Whether an engine has these joints in this motion; DART finds no start of the unloaded crank-rocker's pins."""
    unpressed = engine == "dart" and asked.case == "crank-rocker" and asked.loose and asked.motion == "driven"
    return (asked.joint, asked.motion) in declared(engine).capabilities.runs and not unpressed


ANALYSED = [asked for asked in EVERY if asked.grid is not None]


def fast(table: list[Asked]) -> list[Any]:
    """A table whose rows are in the long suite but for some cases."""
    return [asked if asked.quick else slow(asked)[0] for asked in table]


DRIVEN = [asked for asked in ANALYSED if asked.loose and (asked.m.cranked or asked.motion == "driven")]


@cache
def analysed(asked: Asked) -> Any:
    return lc.analyse(asked.case, **asked.python)


@cache
def simulated(asked: Asked, engine: str = "mujoco") -> Any:
    return lc.simulate(asked.case, engine, joint_model=asked.joint, **asked.python)


@cache
def crosschecked(asked: Asked, engine: str = "mujoco") -> Any:
    found = lc.crosscheck(asked.case, engine, joint_model=asked.joint, revolutions=0, **asked.python)
    assert not found.failures, found.failures[0].why
    return found


def same(
    found: Mapping[str, np.ndarray], expected: Mapping[str, np.ndarray], m: Mechanism, within: float = 0.0
) -> set[str]:
    """The names of signals that two commands both have; fails where one differs by more than this share of the largest
    of its unit, or has a number where the other has none.
    """
    kinds = named(m.bodies, m.joints, m.drives, m.sensors)
    both = set(found) & set(expected)
    largest: dict[str, float] = {}
    for name in both:
        unit = kinds[name].unit
        largest[unit] = max(
            largest.get(unit, 1.0 if unit == "rad" else 0.0), np.nanmax(np.abs(expected[name]), initial=0.0)
        )
    for name in sorted(both):
        one, other = (np.asarray(side[name], float) for side in (found, expected))
        assert np.array_equal(np.isnan(one), np.isnan(other)), f"{name}: {one} and {other}"
        off = np.nanmax(np.abs(kinds[name].apart(one, other)), initial=0.0)
        assert off <= within * largest[kinds[name].unit], f"{name}: off by {off:.3g} of {largest[kinds[name].unit]:.3g}"
    return both


@pytest.mark.long_rows("crank-rocker, driven, clearance", "five-bar, driven, ideal", "five-bar, static, ideal")
@pytest.mark.parametrize("asked", fast(ANALYSED), ids=str)
def test_analyse_is_the_analytic_side_of_the_cross_check(asked: Asked) -> None:
    run = crosschecked(asked).runs[0]
    assert same(analysed(asked).signals, run.analytic, asked.m) == set(run.analytic)
    assert analysed(asked).flags == run.flags


@pytest.mark.long_rows(
    "crank-rocker, driven, clearance-mujoco", "five-bar, driven, ideal-mujoco", "pendulum, driven, ideal-mujoco",
    "crank-rocker, driven, ideal-mujoco", "five-bar, static, ideal-mujoco",
)  # fmt: skip
@pytest.mark.parametrize(
    ("asked", "engine"),
    [
        *((asked, "mujoco") for asked in EVERY if asked.quick),
        *slow(*((a, e) for a in EVERY for e in ENGINES if able(a, e) and (e == "mujoco") != a.quick)),
    ],
    ids=str,
)
def test_simulate_is_the_simulated_side_of_the_cross_check(asked: Asked, engine: str) -> None:
    run, found = crosschecked(asked, engine).runs[0], simulated(asked, engine)
    assert same(found.signals, run.simulated, asked.m) == set(found.signals)
    assert found.settings == run.settings


@pytest.mark.parametrize("asked", fast([a for a in ANALYSED if a.motion == "static"]), ids=str)
def test_nothing_turns_at_rest_by_either_side(asked: Asked) -> None:
    rates = [f"{body}_angular_velocity" for body in asked.m.moving]
    for side in (analysed(asked), simulated(asked)):
        assert not any(np.any(side.signals[rate]) for rate in rates)


# ---------------------------------------------------------------- files


@pytest.mark.long_rows(
    "crank-rocker, driven, clearance", "pendulum, driven, ideal", "five-bar, driven, ideal", "five-bar, static, ideal",
    "crank-rocker, driven, ideal",
)  # fmt: skip
@pytest.mark.parametrize("asked", fast(EVERY), ids=str)
def test_a_check_of_its_own_export_has_the_sides_and_verdicts_of_the_cross_check(asked: Asked, tmp_path: Path) -> None:
    files = lc.export(asked.case, "mujoco", folder=tmp_path, joint_model=asked.joint, **asked.python)
    table = next(file for file in files if file.name == "expected.csv")
    question = {"joint_model": asked.joint, "motion": asked.motion, "clearance": asked.clearance}
    run, expected = lc.check(table, asked.case, **question).runs[0], crosschecked(asked).runs[0]
    given = {
        name: values for name, values in run.simulated.items() if not np.all(np.isnan(values))
    }  # others are not there
    # a pin starts where rates of rates of its equilibria have it (1e-12 m of noise, by the linkage's unit of length),
    # and each time it bounces that grows: to 0.34 mN.m of 247 N.m at 5000 rpm
    within = 1e-5 if asked.loose and asked.motion == "driven" else 1e-6
    assert len(same(given, simulated(asked).signals, asked.m, within)) > 5 * len(asked.m.bodies)
    assert same(run.analytic, expected.analytic, asked.m, 1e-7) == set(
        expected.analytic
    )  # a course tells it to so much
    kept = {d.signal: d.verdict for d in run.discrepancies}
    verdicts = {d.signal: d.verdict for d in expected.discrepancies}
    followed = {f"{asked.m.driven}_angle"} if asked.m.cranked and asked.m.motors else set()
    assert {name: kept[name] for name in set(verdicts) - followed} == {
        name: verdicts[name] for name in set(verdicts) - followed
    }


@pytest.mark.long_rows(
    "five-bar, driven, ideal", "five-bar, static, ideal", "crank-rocker, driven, clearance",
    "crank-rocker, driven, ideal",
)  # fmt: skip
@pytest.mark.parametrize("asked", fast(ANALYSED), ids=str)
def test_a_check_of_the_analysis_finds_nothing_between_them(asked: Asked, tmp_path: Path) -> None:
    analysed(asked).write(tmp_path)
    question = {"joint_model": asked.joint, "motion": asked.motion, "clearance": asked.clearance}
    result = lc.check(tmp_path / "signals.csv", asked.case, **question)
    run = result.runs[0]
    assert run.verdict == "agrees"
    rows = np.isfinite(run.crank_angle)
    assert rows.sum() == analysed(asked).crank_angle.size  # flagged ones too
    same(run.analytic, analysed(asked).signals, asked.m, 1e-7)


# ---------------------------------------------------------------- what is derived


@pytest.mark.parametrize("asked", fast(DRIVEN), ids=str)
def test_accuracy_says_what_the_analysis_has_with_clearance_less_without(asked: Asked) -> None:
    arguments = asked.python
    if asked.m.cranked:
        found = lc.accuracy(asked.case, samples=2, **arguments)
    else:
        del arguments["motion"]
        found = lc.platform_accuracy(asked.case, **arguments)
    loose, ideal = analysed(asked).signals, analysed(Asked(asked.case, asked.motion, loose=False)).signals
    for name, output in found.outputs.items():
        moved = loose[name] - ideal[name]
        np.testing.assert_allclose(output.equilibrium, moved, atol=1e-13, err_msg=name)
        most = max(np.nanmax(np.abs(o.nominal)) for o in found.outputs.values() if o.unit == output.unit)
        assert np.nanmax(np.abs(output.nominal - moved)) <= 1e-2 * most, name  # of second order in the clearance


@pytest.mark.parametrize("joint_model", ["massless-link", *slow("spring-damper", "contact")])
def test_a_cell_of_a_map_is_the_cross_check_at_its_speed_and_clearance(joint_model: Any) -> None:
    m = load("paper").with_joint("B", clearance=1e-4, contact_stiffness=1e7, contact_damping=500.0)
    question = {"joint_model": joint_model, "revolutions": 0, "workers": 1}
    cell = lc.validity(m, speeds=m.speed, clearances=1e-4, **question).cells[0]
    run = lc.crosscheck(m, **question).runs[0]
    worst = cell.worst
    k = int(np.argmin(np.abs(run.crank_angle - worst.at_crank_angle)))
    assert cell.verdict == run.verdict
    assert worst.max == pytest.approx(run.simulated[worst.signal][k] - run.analytic[worst.signal][k], rel=1e-6)
    assert cell.free_share == run.free_share


def test_show_has_the_numbers_of_the_result() -> None:
    asked = Asked("crank-rocker", "driven", loose=True)
    result = crosschecked(asked)
    run, k = result.runs[0], 3
    for signal in ("reaction_B_magnitude", "drive_torque", "clearance_B_x", "follower_rotation"):
        shown = lc.show(result, signal, at=run.crank_angle[k]).runs[0]
        assert (shown.analytic.value, shown.simulated.value) == (run.analytic[signal][k], run.simulated[signal][k])


# ---------------------------------------------------------------- the command line


def series(values: Any) -> Any:
    """Numbers of a JSON document as Python has them."""
    return np.array([np.nan if value is None else value for value in values], float)


@pytest.mark.long_rows("crank-rocker, driven, clearance")
@pytest.mark.parametrize(
    "asked",
    [
        Asked("crank-rocker", "driven", loose=True),
        Asked("five-bar", "static", loose=False),
        *slow(*(asked for asked in ANALYSED if not asked.quick)),
    ],
    ids=str,
)
def test_the_command_line_has_pythons_numbers(asked: Asked, tmp_path: Path) -> None:
    def ended(*words: str) -> dict[str, Any]:
        done = compare(*words, *asked.typed, "--json", "--out", str(tmp_path / (words[0].strip("-"))), cwd=tmp_path)
        assert done.returncode in (0, 1), done.stderr
        return json.loads(done.stdout)

    joint = ["--joint", asked.joint]
    one = {name: series(v) for name, v in ended("analyse")["signals"].items()}
    assert same(one, analysed(asked).signals, asked.m) == set(one)
    one = {name: series(v) for name, v in ended("simulate", *joint)["signals"].items()}
    assert same(one, simulated(asked).signals, asked.m) == set(one)
    both = ended("--simulator", "mujoco", "--revolutions", "0", *joint)["runs"][0]
    expected = crosschecked(asked).runs[0]
    assert both["verdict"] == expected.verdict
    for side in ("analytic", "simulated"):
        one = {name: series(v) for name, v in both[side].items()}
        assert same(one, getattr(expected, side), asked.m) == set(one)
    if asked in DRIVEN and asked.m.cranked:
        outputs = ended("accuracy", "--samples", "2")["outputs"]
        for name, output in lc.accuracy(asked.case, samples=2, **asked.python).outputs.items():
            np.testing.assert_array_equal(series(outputs[name]["equilibrium"]), output.equilibrium, err_msg=name)
            np.testing.assert_array_equal(series(outputs[name]["total"]), output.total, err_msg=name)


def test_options_before_a_command_are_refused(tmp_path: Path) -> None:
    done = compare("--case", "crank-rocker", "analyse", "--angles", "0:10:5", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "compare: --case stands before analyse, which does not see it; write it after\n"


# ---------------------------------------------------------------- a signal under both its names


def test_a_signal_under_both_its_names_is_one_where_they_say_the_same(tmp_path: Path) -> None:
    lc.simulate("pendulum", "mujoco").write(tmp_path)
    file = tmp_path / "signals.csv"
    header, *rows = [line.split(",") for line in file.read_text(encoding="utf-8").splitlines()]
    assert {"crank_angle [rad]", "pendulum_angle [rad]"} <= set(header)
    assert lc.check(file, "pendulum").verdict == "agrees"
    at = header.index("crank_angle [rad]")
    degrees = [[*row[:at], f"{np.degrees(float(row[at])):.4f}", *row[at + 1 :]] for row in rows]
    other = [*header[:at], "crank_angle [deg]", *header[at + 1 :]]
    file.write_text("\n".join(",".join(row) for row in [other, *degrees]), encoding="utf-8")
    assert lc.check(file, "pendulum").verdict == "agrees"
    degrees[7][at] = f"{float(degrees[7][at]) + 0.001:.4f}"
    file.write_text("\n".join(",".join(row) for row in [other, *degrees]), encoding="utf-8")
    with pytest.raises(
        lc.Error, match=r"columns 1 and \d+ are both 'pendulum_angle', and differ; leave one of them out"
    ):
        lc.check(file, "pendulum")


@pytest.mark.long_rows("crank-rocker-0.03-mujoco")
@pytest.mark.parametrize("name", ["mujoco", "exudyn", *slow("pybullet", "dart")])
@pytest.mark.parametrize(("case", "until"), [("crank-rocker", 0.03), ("pendulum", 0.5)])
def test_over_time_the_crank_angle_is_the_driven_body_s_whichever_body_its_joint_names_first(
    case: str, until: float, name: str, tmp_path: Path
) -> None:
    """Driven and released; a check takes what the engine wrote."""
    m = load(case)
    joint = m.drive_joint
    m = m.with_joint(joint.name, bodies=joint.bodies[::-1])
    found = lc.simulate(m, name, times=np.linspace(0.0, until, 16))
    assert np.abs(found.crank_angle).max() > 0.01
    np.testing.assert_allclose(found.crank_angle, found.signals[f"{m.driven}_angle"], atol=1e-12)
    np.testing.assert_allclose(found.crank_angle, -found.signals[f"position_{joint.name}"], atol=1e-12)
    found.write(tmp_path)
    assert lc.check(tmp_path / "signals.csv", m).verdict == "agrees"
