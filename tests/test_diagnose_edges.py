"""Measurements at the edge of what a diagnosis is given: free runs beside driven ones, late clocks, sensors of
different rates, tolerances of nothing, a coarse encoder, bodies without a length.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import dumps, load
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import Measured, MeasuredError, MeasuredRun
from compare.diagnose.data.thin import picked
from compare.diagnose.effects.effect import Rig
from compare.diagnose.experiment_design import Variations
from compare.diagnose.prepare import thinned
from compare.quantities import SUPERSCRIPT
from compare.report.words.located import located
from compare.results.diagnosis import Located
from diagnosis_rigs import (
    SENSORS,
    assert_recovered,
    diagnosed,
    experiment,
    four_bar,
    named,
    played,
    released,
    turn,
    wrong,
)
from marks import slow
from measured_files import RunTable, write_measured
from sample_diagnosis import as_document, sample_diagnosis

PENDULUM = load("pendulum")
TIME = np.linspace(0.0, 3.0, 150)
STARTS = [(0.2, 0.0), (-2.5, 1.0)]
PLAIN = {raised: plain for plain, raised in SUPERSCRIPT.items()}


def swings(real: Mechanism = PENDULUM) -> Measured:
    return released(PENDULUM, real, {"pendulum_angle": 1e-3}, STARTS, TIME)


def statuses(result: dict[str, object], name: str) -> set[str]:
    rows = [c for c in result["candidates"] if c["name"] == name]
    return {c["status"] for c in rows}


# ---------------------------------------------------------------- free runs


@pytest.mark.slow
def test_a_tolerance_on_angles_does_not_bind_where_a_free_run_starts() -> None:
    result = diagnosed(replace(swings(), tolerance={"angle": 1e-3}))
    assert (result["verdict"], result["effects"]) == ("no gap", [])


@pytest.mark.slow
def test_a_free_run_of_a_large_swing_without_a_gap_is_off_nowhere() -> None:
    """Where it starts is fitted to all of it, and what is located is off from that."""
    result = diagnosed(released(PENDULUM, PENDULUM, {"pendulum_angle": 1e-3}, [(1.45, 0.0)], np.linspace(0, 3, 600)))
    assert (result["verdict"], result["located"]) == ("no gap", [])
    (isolated,) = (step["text"][0] for step in result["steps"] if step["title"] == "Isolate")
    within = isolated.rsplit("within ", 1)[1].split()[0].translate(PLAIN)
    assert float(within.replace("\N{MULTIPLICATION SIGN}10", "e")) < 0.05


@pytest.mark.slow
def test_the_zero_of_the_only_sensor_of_a_pendulum_is_a_cause_like_any_other() -> None:
    data = swings()
    off = tuple(
        replace(r, channels={s: replace(c, values=c.values + 0.02) for s, c in r.channels.items()}) for r in data.runs
    )
    result = diagnosed(replace(data, runs=off), only=("encoder_offset", "viscous_friction", "moment_of_inertia"))
    assert_recovered(result, wrong("encoder_offset", "pendulum_angle", offset=0.02))


def test_a_clock_that_does_not_begin_at_zero_changes_nothing(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    angle = 0.3 * np.cos(6.0 * TIME) + 1e-3 * rng.standard_normal(TIME.size)
    found = []
    for late in (0.0, 50.0):
        run = RunTable("swing", TIME + late, {"pendulum_angle [rad]": angle}, {"drive": "free"})
        found.append(load_measured(write_measured(tmp_path / f"{late:g}", dumps(PENDULUM), [run])).runs[0].start)
    assert found[1] == pytest.approx(found[0], abs=1e-6)
    assert found[1]["pendulum_angle"] == pytest.approx(0.3, abs=0.01)


@pytest.mark.slow
def test_clearance_is_found_in_driven_runs_though_another_run_is_free() -> None:
    truth = wrong("joint_clearance", "B", radial_clearance=3e-4)
    data = played(experiment(turn("slow", 4.0, samples=60), turn("fast", 9.0, samples=60)), truth, source="mujoco")
    free = released(
        four_bar(),
        four_bar(),
        {s: SENSORS[s] for s in ("crank_angle", "follower_angle")},
        [(1.2, 0.0)],
        np.linspace(0, 0.2, 20),
    )
    result = diagnosed(replace(data, runs=(*data.runs, *free.runs)), only=("joint_clearance", "viscous_friction"))
    assert_recovered(result, truth)
    assert any("free, joints are taken without clearance" in text for step in result["steps"] for text in step["text"])


def test_a_start_needs_the_driven_bodys_angle(tmp_path: Path) -> None:
    columns = {"follower_angle [rad]": 1.0 + 0.1 * np.sin(TIME)}
    run = RunTable("swing", TIME, columns, {"drive": "free", "start": {"follower_angle": 1.0}})
    with pytest.raises(MeasuredError, match="give crank_angle, from which the others follow"):
        load_measured(write_measured(tmp_path, dumps(load("crank-rocker")), [run]))


@pytest.mark.slow
def test_a_pendulum_whose_pivot_is_its_only_point_has_a_size() -> None:
    bob = PENDULUM.bodies[0]
    lone = PENDULUM.with_body(
        "pendulum", points={"O": bob.points["O"]}, com=(bob.centre.real, bob.centre.imag), inertia=bob.moment_of_inertia
    )
    assert lone.bodies[0].length == 0
    result = diagnosed(replace(swings(), mechanism=lone))
    assert result["verdict"] == "no gap"


# ---------------------------------------------------------------- samples


def two_rates(drive: str = "speed") -> MeasuredRun:
    """A run in which the follower's sensor is read at one row in four, never at the rows that a thinning by two or four
    would keep.
    """
    data = played(experiment(turn("slow", 4.0, samples=1200)))
    run = data.runs[0]
    sparse = np.where(np.arange(run.time.size) % 4 == 1, run.channels["follower_angle"].values, math.nan)
    return replace(
        run,
        drive=drive,
        channels={**run.channels, "follower_angle": replace(run.channels["follower_angle"], values=sparse)},
    )


@pytest.mark.long_rows("2")
@pytest.mark.parametrize("every", [2, 4, 8])
def test_thinning_leaves_its_share_of_every_sensor(every: int) -> None:
    run = two_rates()
    thin = picked(run, every)
    for signal, channel in run.channels.items():
        full, left = (int(np.isfinite(c.values).sum()) for c in (channel, thin.channels[signal]))
        assert left >= full / every / 2, signal
    assert thin.time.size <= 2 * run.time.size / every
    assert np.all(np.diff(thin.time) > 0)


def test_a_course_that_needs_its_samples_is_not_thinned(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("compare.diagnose.prepare.SAMPLES", 100)
    run = two_rates("measured")
    wobbly = run.channels["crank_angle"].values + 1e-2 * np.sin(2 * np.pi * np.arange(run.time.size) / 10)
    shaken = replace(run, channels={**run.channels, "crank_angle": replace(run.channels["crank_angle"], values=wobbly)})
    for each, kept in ((run, False), (shaken, True)):
        found = thinned(Measured(four_bar(), (each,), {}, (), "rig"))
        assert (found.runs[0].time.size == each.time.size) is kept
        assert bool(found.faults) is not kept


@pytest.mark.parametrize("step", [1.0, 3.6])
def test_a_coarse_encoder_turns_as_it_is_told_to(step: float, tmp_path: Path) -> None:
    time = np.linspace(0.0, 2 * np.pi / 6.0, 999)
    coarse = step * np.round(np.degrees(0.4 + 6.0 * time) / step)
    columns = {"crank_angle [deg]": coarse, "follower_angle [rad]": np.sin(time)}
    run = RunTable("slow", time, columns, {"drive_speed": 6.0, "drive_angle": 0.4})
    assert load_measured(write_measured(tmp_path, dumps(load("crank-rocker")), [run])).runs[0].speed == 6.0


def test_crank_angle_stands_for_the_driven_bodys_angle_whatever_its_name(tmp_path: Path) -> None:
    columns = {"crank_angle [deg]": np.degrees(0.3 * np.cos(6.0 * TIME))}
    run = RunTable(
        "swing", TIME, columns, {"drive": "free", "start": {"crank_angle": 0.3}, "noise": {"crank_angle": 1e-3}}
    )
    found = load_measured(write_measured(tmp_path, dumps(PENDULUM), [run])).runs[0]
    assert set(found.channels) == {"pendulum_angle"}
    assert found.channels["pendulum_angle"].noise == 1e-3
    assert found.start["pendulum_angle"] == 0.3


# ---------------------------------------------------------------- tolerances


@pytest.mark.long_rows("tolerance0-speed_ripple")
@pytest.mark.parametrize(
    ("tolerance", "name"),
    [
        ({"speed_ripple.amplitude": 0.0}, "speed_ripple"),
        *slow(
            ({"joint_spring.stiffness": 0.0}, "joint_spring"),
            ({"drive_compliance.stiffness": 0.0}, "drive_compliance"),
            ({"payload.mass": 0.0}, "payload"),
        ),
        ({"sensor_frame.rotation": 0.0}, "sensor_frame"),
    ],
)
def test_a_tolerance_of_nothing_rules_an_effect_out_and_the_report_says_so(
    tolerance: dict[str, float], name: str
) -> None:
    data = replace(
        played(experiment(turn("slow", 4.0)), wrong("link_length", "follower", length_error=1e-4)), tolerance=tolerance
    )
    result = diagnosed(data, only=(name, "link_length"))
    assert statuses(result, name) == {"excluded"}
    assert named(result) == [("link_length", "follower")]


@pytest.mark.slow
def test_a_load_cell_is_not_mounted_farther_round_than_the_tolerance() -> None:
    data = played(experiment(turn("slow", 4.0)), wrong("sensor_frame", "E", rotation=math.pi / 2))
    assert named(diagnosed(data, only=("sensor_frame",))) == [("sensor_frame", "E")]
    assert named(diagnosed(replace(data, tolerance={"rotation": 0.1}), only=("sensor_frame",))) == []


@pytest.mark.parametrize("key", ["drive_compliance.stiffness", "youngs_modulus", "rest_angle"])
def test_a_tolerance_that_would_bound_nothing_is_refused(key: str, tmp_path: Path) -> None:
    columns = {"follower_angle [rad]": np.sin(TIME)}
    run = RunTable("slow", TIME, columns, {"drive_speed": 4.0})
    with pytest.raises(MeasuredError, match="bounds nothing"):
        load_measured(write_measured(tmp_path, dumps(load("crank-rocker")), [run], {key: 5.0}))


# ---------------------------------------------------------------- words


@pytest.mark.slow
def test_a_run_that_is_proposed_has_a_name_that_no_run_has() -> None:
    down = Load(body="coupler", point="com", force=(0.0, -50.0))
    rig = experiment(
        turn("reversed-load", 4.0),
        turn("fast", 6.5),
        mechanism=four_bar(gravity=0.0, loads=(down,)),
        sensors={"follower_angle": 6e-5},
    )
    result = diagnosed(
        played(rig, wrong("joint_clearance", "B", radial_clearance=4e-4), source="dart"),
        only=("joint_clearance", "link_length"),
    )
    assert result["verdict"] == "ambiguous", result["statement"]
    advice = next(e["would_separate"] for e in result["effects"] if "[[run]]" in e["would_separate"])
    (proposed,) = tomllib.loads(advice[advice.index("[[run]]") :])["run"]
    assert proposed["name"] not in {"reversed-load", "fast"}
    assert proposed["file"] not in {"reversed-load.csv", "fast.csv"}


@pytest.mark.parametrize(("other", "asked"), [(6.5, True), (-12.0, False)])
def test_a_drive_that_has_run_both_ways_is_not_asked_to_run_the_other_way(other: float, asked: bool) -> None:
    data = played(experiment(turn("one", 4.0), turn("other", other), sensors={"follower_angle": 6e-5}))
    known = Rig(data.mechanism, ("follower_angle",), ("one", "other"), ())
    tried = [trial.words for trial in Variations(data.runs[0], known, {4.0, other}).all()]
    assert ("run the drive the other way" in tried) == asked
    assert "run at 2 times the speed" in tried


def test_a_located_deviation_has_the_sign_of_its_size_whatever_the_next_turn_brings() -> None:
    angle = np.linspace(0.0, 4 * np.pi, 200)
    before = np.zeros(200)
    measured = np.where(angle < 2 * np.pi, 1.0, -2.0)
    document = as_document(sample_diagnosis(runs=1, samples=200))
    (run,) = document.runs
    torque = next(iter(run.signals.values())).model_copy(
        update={"unit": "N.m", "measured": measured, "before": before, "after": before}
    )
    two_turns = run.model_copy(
        update={"name": "two turns", "drive": "speed", "crank_angle": angle, "signals": {"drive_torque": torque}}
    )
    document = document.model_copy(update={"runs": (two_turns,)})
    place = next(iter(document.located)).model_copy(
        update={"run": "two turns", "signal": "drive_torque", "unit": "N.m"}
    )

    def said(start: float, end: float, size: float) -> str:
        here: Located = place.model_copy(update={"crank_angle_from": start, "crank_angle_to": end, "size": size})
        return located(document, here)

    assert "drive torque in run two turns is too high by 1 N" in said(1.0, 2.0, 1.0)
    assert "drive torque in run two turns is too low by 2 N" in said(1.0 + 2 * np.pi, 2.0 + 2 * np.pi, -2.0)
