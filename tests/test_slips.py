"""Data that are not what they say are recognised, with a line that mends them; genuine effects are none of that."""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas
import pytest
import tomli_w

import linkage_crosscheck as lc
from analytic.mechanism.dotted import find, with_values
from analytic.mechanism.file import load
from compare.diagnose import slips
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import Fault, MeasuredError
from compare.diagnose.effects.bodies import ComOffset, LinkLength, MomentOfInertia, PivotPosition
from compare.diagnose.effects.effect import Effect, Rig
from compare.diagnose.effects.joints import CoulombFriction
from compare.diagnose.effects.sensors import EncoderHarmonic, EncoderOffset, SensorGain
from compare.diagnose.problem import Options, Problem
from diagnosis_rigs import experiment, four_bar, played, turn, wrong
from marks import slow_but
from tests.evidence.scoreboard.rigs import Experiment
from tests.evidence.scoreboard.sizes import Planted
from tests.false_data import FalseData, make

SEEDS = range(60)
QUICK = (2,)  # the long suite has each kind, also in runs that follow their encoder
GOOD = range(200, 220)


def told(made: FalseData) -> list[Fault]:
    """The faults of the data that a set's files are told to have."""
    try:
        found = load_measured(made.path)
    except MeasuredError as error:
        return [Fault("", "", "refused", 0, str(error))]
    said = slips.as_faults(slips.driven(found, found.mechanism.rigid()), found.runs)
    return [*said, *(fault for fault in found.faults if fault.kind == "stamps")]


@pytest.mark.parametrize("seed", slow_but(QUICK, SEEDS))
def test_what_data_are_not_is_told_with_its_sensors_and_runs(seed: int, tmp_path: Path) -> None:
    made = make(seed, tmp_path)
    faults = told(made)
    assert {fault.kind for fault in faults} <= {made.kind, "refused"}
    text = "; ".join(fault.text for fault in faults)
    assert all(signal in text for signal in made.signals)
    assert all(repr(run) in text or "every run" in text for run in made.runs)
    assert "say " in text or made.kind == "stamps"


@pytest.mark.mujoco
def test_a_motor_off_its_speed_is_told_beside_a_longer_rod_and_friction_that_hide_it() -> None:
    """They are off in every turn alike, and by more than a tenth of what the speed is; a rig with them alone is
    diagnosed.
    """
    nominal = load("slider-crank").replace(gravity=(0.0, -9.81))
    rig = nominal.with_joint("O", friction_torque=0.05)
    rig = with_values(rig, {find(rig, "body.rod.length"): 0.1203})
    rng, speeds = np.random.default_rng(5), {"slow": 10.0, "fast": 30.0}

    def frame(speed: float) -> pandas.DataFrame:
        time = np.linspace(0.0, 3 * math.tau / speed, 700)
        run = lc.simulate(rig.with_drive(speed=speed), "mujoco", angles=np.mod(speed * time, math.tau))
        noise = {"crank_angle": 3e-4, "drive_torque": 0.01, "slider_x": 1e-5}
        seen = {name: run[name] + rng.normal(0.0, size, time.size) for name, size in noise.items()}
        seen["crank_angle"] = speed * time + rng.normal(0.0, 3e-4, time.size)
        names = {"crank_angle": "crank_angle [rad]", "drive_torque": "drive_torque [N.m]", "slider_x": "slider_x [m]"}
        return pandas.DataFrame({"time [s]": time, **{names[name]: values for name, values in seen.items()}})

    for fast, kinds in ((1.002, {"speed"}), (0.99, {"speed"}), (1.0, set())):
        frames = {name: frame(fast * speed) for name, speed in speeds.items()}
        given = lc.measured(nominal, frames, speed=speeds, drive_angle=0.0)
        found = slips.driven(given, nominal.rigid())
        assert {slip.kind for slip in found} == kinds
        for slip in found:
            told_speed = float(slip.field.removeprefix("drive_speed = "))
            assert told_speed == pytest.approx(fast * speeds[slip.run.name], rel=2e-5)
            assert "in every turn alike" in slip.text


@pytest.mark.parametrize("seed", slow_but((204,), GOOD))
def test_data_with_nothing_false_are_not_refused(seed: int, tmp_path: Path) -> None:
    assert told(make(seed, tmp_path, good=True)) == []


@pytest.mark.parametrize("seed", slow_but((4,), [3, 4, 7, 10, 14, 18, 20, 22, 25, 29, 34, 50]))
def test_the_line_that_is_said_mends_the_data(seed: int, tmp_path: Path) -> None:
    made = make(seed, tmp_path)
    file = tomllib.loads(made.path.read_text(encoding="utf-8"))
    for fault in told(made):
        for line, where in re.findall(r"say (.*?) (under \[columns\]|in \[\[run\]\](?: and|, | '[^']*')*)", fault.text):
            if where == "under [columns]":
                for one in line.split(" and "):
                    file.setdefault("columns", {}).update(tomllib.loads(one))
            for run in file["run"]:
                if repr(run["name"]) in where:
                    run.update(tomllib.loads(line))
    made.path.write_text(tomli_w.dumps(file), encoding="utf-8")
    assert told(made) == []


# ---------------------------------------------------------------- genuine effects

RIG = experiment()
FOLLOWS = experiment(turn("slow", 4.0, follows=True), turn("fast-reverse", -12.0, follows=True))
SLOWLY = experiment(turn("slow", 0.2), turn("reverse", -0.3), mechanism=four_bar(loads=()))  # weight is all its torque
OFF = math.radians(1.0)


@pytest.mark.long_rows(
    "-link_length@follower", "-encoder_offset@crank_angle1", "-speed_ripple@drive", "-sensor_delay@follower_angle",
    "-payload@follower", "-link_length@coupler", "-sensor_gain@crank_angle", "-sensor_bias@reaction_E_x",
    "-encoder_harmonic@crank_angle", "-clock_offset@slow", "-sensor_frame@E1", "-sensor_frame@E0",
)  # fmt: skip
@pytest.mark.parametrize(
    ("rig", "effect"),
    [
        (RIG, wrong("encoder_offset", "crank_angle", offset=OFF)),
        (FOLLOWS, wrong("encoder_offset", "crank_angle", offset=10 * OFF)),
        (RIG, wrong("encoder_harmonic", "crank_angle", amplitude=5e-3, harmonic=1.0, phase=0.4)),
        (RIG, wrong("sensor_gain", "drive_torque", gain_error=0.02)),
        (RIG, wrong("sensor_gain", "crank_angle", gain_error=0.002)),
        (RIG, wrong("sensor_bias", "reaction_E_x", bias=2.0)),
        (RIG, wrong("sensor_delay", "follower_angle", delay=0.01)),
        (RIG, wrong("sensor_frame", "E", rotation=math.pi)),
        (RIG, wrong("sensor_frame", "E", rotation=math.pi / 2)),
        (RIG, wrong("clock_offset", "slow", offset=0.02)),
        (RIG, wrong("speed_ripple", "drive", amplitude=5e-3, harmonic=1.0, phase=0.4)),
        (RIG, wrong("link_length", "coupler", length_error=2e-3)),
        (FOLLOWS, wrong("link_length", "follower", length_error=-5e-3)),
        (RIG, wrong("external_force", "coupler", x=-10.0, y=60.0)),
        (RIG, wrong("payload", "follower", mass=1.0, along=0.0, normal=0.0)),
        (SLOWLY, wrong("gravity", "linkage", x=0.0, y=0.0)),
    ],
    ids=lambda value: f"{value.name}@{value.where}" if isinstance(value, Planted) else "",
)
def test_a_genuine_effect_is_not_taken_for_data_that_are_not_what_they_say(rig: Experiment, effect: Planted) -> None:
    found = played(rig, effect)
    assert slips.driven(found, found.mechanism) == []


def test_a_sensor_that_reads_nothing_but_noise_is_not_connected() -> None:
    found, rng = played(RIG), np.random.default_rng(1)
    runs = []
    for run in found.runs:
        torque, stuck = run.channels["drive_torque"], run.channels["follower_angle"]
        noise = torque.noise * rng.standard_normal(run.time.size)
        silent = {
            "drive_torque": replace(torque, values=noise),
            "follower_angle": replace(stuck, values=np.full(run.time.size, 1.2)),
        }
        runs.append(replace(run, channels={**run.channels, **silent}))
    faults = slips.as_faults(slips.driven(replace(found, runs=tuple(runs)), found.mechanism), runs)
    assert [(fault.signal, fault.kind) for fault in faults] == [
        (s, "silent") for s in ("drive_torque", "follower_angle")
    ]
    assert faults[0].text.startswith("drive_torque of every run reads nothing but noise: it is not connected, or")
    assert faults[0].text.endswith('say "drive_torque [N.m]" = "ignore" under [columns]')


def test_what_a_mended_column_leaves_is_over_the_noise_that_is_stated() -> None:
    found = played(RIG)
    for run in found.runs:
        torque = run.channels["drive_torque"]
        wrong = replace(torque, values=1000.0 * torque.values, noise_given=True)
        false = replace(run, channels={**run.channels, "drive_torque": wrong})
        (slip,) = slips.driven(replace(found, runs=(false,)), found.mechanism)
        assert (slip.signal, slip.kind) == ("drive_torque", "unit")
        assert slip.off > 1e3
        assert 0.5 < slip.left < 2.0


# ---------------------------------------------------------------- what these samples cannot tell, and what cannot be


@pytest.mark.parametrize(
    ("effect", "x"),
    [(MomentOfInertia(), -1.0), (ComOffset(), 1.0), (LinkLength(), -0.5), (PivotPosition(), 0.5), (SensorGain(), -1.0)],
    ids=lambda value: getattr(value, "name", ""),
)
def test_what_lies_where_no_machine_is_explains_nothing(effect: Effect, x: float) -> None:
    rig = Rig(load("crank-rocker"), ("crank_angle", "drive_torque"), ("a",), ("a",))
    where = effect.places(rig)[-1]
    low, high = effect.lowest(rig, where), effect.highest(rig, where)
    end = low if x < 0 else high
    assert effect.impossible(rig, where, end)
    assert not effect.impossible(rig, where, 0.9 * end)
    assert not effect.impossible(rig, where, np.zeros(end.size))


def test_a_joint_may_be_without_friction_that_its_model_has() -> None:
    rig = Rig(load("crank-rocker").with_joint("E", friction_torque=0.1), ("drive_torque",), ("a",), ("a",))
    friction = CoulombFriction()
    assert not friction.impossible(rig, "E", friction.lowest(rig, "E"))


@pytest.mark.parametrize(
    ("a_turn", "turns", "most"),
    [(10.0, 100.0, 4), (7.0, 30.0, 3), (20.0, 40.0, 9), (10.37, 100.0, 24), (360.0, 1.0, 24), (360.0, 0.1, 24)],
)
def test_a_wave_that_the_samples_of_a_turn_cannot_tell_is_no_candidate(a_turn: float, turns: float, most: int) -> None:
    theta = 0.3 + 2 * math.pi / a_turn * np.arange(round(a_turn * turns))
    rig = Rig(load("crank-rocker"), ("crank_angle",), ("a",), ("a",), turned=(theta,))
    assert EncoderHarmonic().variants(rig, "crank_angle") == list(range(1, most + 1))


def test_a_zero_is_within_half_a_turn() -> None:
    effect = EncoderOffset()
    rig = Rig(load("crank-rocker"), ("crank_angle",), ("a",), ("a",))
    assert effect.values(rig, "crank_angle", np.array([-70.0]))["offset"] == pytest.approx(-70.0 + 22 * math.pi)


def test_no_length_is_negative_and_no_centre_of_mass_far_from_its_body() -> None:
    problem = Problem.of(played(RIG), RIG.nominal, Options("mujoco", others=False, workers=1))
    for term in problem.terms:
        low, high = problem.fitter.bounds(term)
        if isinstance(term.effect, LinkLength):
            assert high[0] == -low[0] <= problem.mechanism.moving[term.where].length / 2
        if isinstance(term.effect, ComOffset | PivotPosition):
            assert np.all(np.isfinite(low) & np.isfinite(high))
