"""The course of a run that follows its encoder: within its noise and counts, whatever the unit of time, or it is said
where not.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from analytic.mechanism.file import dumps
from analytic.mechanism.signals import Signal
from compare.diagnose import prepare
from compare.diagnose.data import quality
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import Channel, MeasuredRun
from compare.diagnose.data.smooth import Smoother
from compare.diagnose.data.thin import missed, picked
from compare.evidence.scoreboard.rigs import Plan
from diagnosis_rigs import diagnosed, experiment, readings, wrong
from measured_files import RunTable, write_measured

COUNTS = (None, 200, 2000)  # per revolution
NOISE = (0.0, 1e-4, 1e-2)  # rad


def turning(samples: int, degrees: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Sample numbers (N,) and angles (N,) rad of a crank that turns so far in a sample, at a speed that varies by up to
    a quarter.
    """
    k = np.arange(samples)
    turn = math.radians(degrees) * k + seed
    return k, turn + 0.15 * np.sin(turn) + 0.05 * np.sin(2 * turn + 1)


def read(angle: np.ndarray, counts: int | None, noise: float, seed: int = 0) -> tuple[np.ndarray, float]:
    """What an encoder reads of angles (N,) rad, and how far (rms, rad) it is off."""
    seen = angle + noise * np.random.default_rng(seed).standard_normal(angle.size)
    step = 2 * math.pi / counts if counts else 0.0
    return np.round(seen / step) * step if step else seen, math.hypot(noise, step / math.sqrt(12), 1e-7)


def run_of(time: np.ndarray, values: np.ndarray) -> MeasuredRun:
    channel = Channel(Signal("pose", "crank", "angle"), values, quality.noise(time, values), False, "rad")
    return MeasuredRun("a", time, {"crank_angle": channel}, "measured", None, None, {}, None, False, "a.csv")


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize(
    "rate", [0.05, 50.0, 5e3, 5e7]
)  # samples per unit of time: ms and Hz, s and Hz, fast, h and Hz
@pytest.mark.parametrize("degrees", [0.02, 0.5, 6.0, 12.0, 22.0])
def test_a_course_keeps_to_its_encoder_within_noise_and_counts(rate: float, degrees: float) -> None:
    k, angle = turning(400, degrees)
    time = 1000.0 + k / rate
    for counts in COUNTS:
        for noise in NOISE:
            values, off = read(angle, counts, noise)
            off = math.hypot(off, math.radians(degrees) * rate * np.spacing(time[-1]) / math.sqrt(12))  # of its clock
            run = run_of(time, values)
            course = prepare.course(run, "crank_angle")
            found = course.at(time).theta
            assert rms(found - values) < 1.15 * off, (counts, noise)
            assert rms(found - angle) < 1.15 * off, (counts, noise)
            assert prepare.strayed(run, "crank_angle", course) is None, (counts, noise)


@pytest.mark.parametrize(("degrees", "counts"), [(22.0, None), (22.0, 200), (6.0, 2000), (0.1, 200)])
def test_twenty_thousand_samples_do_not_flatten_it(degrees: float, counts: int | None) -> None:
    k, angle = turning(20_000, degrees)
    values, off = read(angle, counts, 1e-3)
    assert rms(Smoother(k / 50, values).course(k / 50) - angle) < off


def test_the_unit_of_time_and_its_zero_do_not_count() -> None:
    k, angle = turning(300, 3.0)
    values, _ = read(angle, 1000, 2e-3)
    first = Smoother(k * 1.0, values)
    for scale in (1e-6, 0.02, 1e3, 3.6e6):
        other = Smoother(k * scale + 7 * scale, values)
        assert other.reach == first.reach
        np.testing.assert_allclose(other.course(k * scale + 7 * scale), first.course(k * 1.0), rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_a_clock_that_stutters_is_followed_too(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.choice([1e-4, 0.02, 0.02, 0.021, 0.2], 400, p=[0.05, 0.5, 0.3, 0.1, 0.05]))
    turn = 4 * time
    angle = turn + 0.15 * np.sin(turn)
    values, off = read(angle, 2000, 2e-3, seed)
    run = run_of(time, values)
    course = prepare.course(run, "crank_angle")
    assert rms(course.at(time).theta - angle) < off
    assert prepare.strayed(run, "crank_angle", course) is None


@pytest.mark.parametrize("decimals", [12, 2])
def test_stairs_of_a_slow_coarse_encoder_are_not_climbed(decimals: int) -> None:
    """A count every hundred samples or so: a course that follows each of them has the crank jerk by 6e4 rad/s^2."""
    time = np.arange(4000) / 5e3
    angle = 0.3 * time + 0.01 * np.sin(8 * time)
    step = 360 / 1024
    values = np.radians(np.round(np.round(np.degrees(angle) / step) * step, decimals))
    assert quality.quantum(values) == pytest.approx(math.radians(step), rel=0.02)
    course = prepare.course(run_of(time, values), "crank_angle").at(time)
    inside = slice(200, -200)
    assert np.abs(course.theta - values).max() <= 0.6 * math.radians(step)
    assert rms((course.omega - (0.3 + 0.08 * np.cos(8 * time)))[inside]) < 0.01 * 0.3
    assert np.abs(course.alpha[inside]).max() < 3 * 0.64


@pytest.mark.parametrize("share", [2, 3, 5, 7])
def test_counts_are_found_though_no_two_readings_are_one_apart(share: int) -> None:
    step = 2 * math.pi / 500
    jumps = np.random.default_rng(share).choice([share, share + 1], 200)
    assert quality.quantum(np.cumsum(jumps) * step) == pytest.approx(step)
    assert quality.quantum(np.arange(200) * share * step) == 0  # evenly: that is the speed's step
    assert quality.quantum(np.cumsum(np.random.default_rng(1).uniform(share, share + 1, 200))) == 0


def test_a_slip_that_no_course_can_follow_is_said_with_run_signal_place_and_size() -> None:
    k, angle = turning(400, 2.0)
    time = k / 50
    values, _ = read(angle + np.where(k > 250, 0.4, 0.0), 360, 5e-3)
    run = run_of(time, values)
    fault = prepare.strayed(run, "crank_angle", prepare.course(run, "crank_angle"))
    assert fault is not None
    assert (fault.run, fault.signal, fault.kind) == ("a", "crank_angle", "course")
    assert fault.samples < 20
    for word in ("run 'a'", "misses crank_angle by up to", "deg", "near 5 s", "noise and counts"):
        assert word in fault.text


def test_a_straight_line_through_a_varying_motion_is_said() -> None:
    k, angle = turning(400, 12.0)
    time = k / 50
    run = run_of(time, angle)
    straight = prepare.course(run_of(time, np.polyval(np.polyfit(time, angle, 1), time)), "crank_angle")
    fault = prepare.strayed(run, "crank_angle", straight)
    assert fault is not None
    assert fault.samples > 300


def test_thinning_knows_a_fast_motion_that_it_would_lose_from_one_that_it_keeps() -> None:
    for degrees, lost in ((1.0, False), (40.0, True)):
        k, angle = turning(3000, degrees)
        run = run_of(k / 50, read(angle, 2000, 0.0)[0])
        assert (missed(run, picked(run, 4), "crank_angle") > 0) == lost


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Thirteen uneven turns of the crank-rocker at 50 Hz, 12 deg a sample, an encoder of 1000 counts."""
    speed = math.radians(12) * 50
    sensors = dict.fromkeys(("crank_angle", "follower_angle", "coupler_angle"), 1e-3)
    rig = experiment(Plan("coarse", speed, 0.4, np.arange(400) / 50, None, True), sensors=sensors)
    (seen,) = readings(rig, wrong("speed_ripple", "drive", amplitude=0.15, harmonic=1.0, phase=0.3))
    step = 360 / 1000
    columns = {f"{s} [deg]": np.degrees(v) for s, v in seen.items()}
    columns["crank_angle [deg]"] = np.round(columns["crank_angle [deg]"] / step) * step
    run = RunTable("coarse", rig.plans[0].time, columns, {"drive": "measured"})
    return write_measured(tmp_path_factory.mktemp("coarse"), dumps(rig.nominal), [run])


@pytest.mark.slow
def test_a_run_that_follows_a_coarse_encoder_is_replayed_as_it_was(coarse: Path) -> None:
    result = diagnosed(load_measured(coarse))
    assert (result["verdict"], result["effects"], result["faults"]) == ("no gap", [], []), result["statement"]
    assert result["gap"]["before"] < 1.1


@pytest.mark.slow
def test_a_slipping_encoder_is_among_the_faults_of_the_diagnosis(coarse: Path, tmp_path: Path) -> None:
    lines = (coarse.parent / "coarse.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    slipped = [[t, repr(float(a) + 40 * (k > 200)), *rest] for k, (t, a, *rest) in enumerate(rows)]
    (tmp_path / "coarse.csv").write_text("\n".join([lines[0], *(",".join(row) for row in slipped)]) + "\n")
    for name in ("measured.toml", "nominal.toml"):
        (tmp_path / name).write_text((coarse.parent / name).read_text())
    result = diagnosed(load_measured(tmp_path / "measured.toml"))
    assert "course" in [f["kind"] for f in result["faults"]]
    assert result["verdict"] != "no gap"
