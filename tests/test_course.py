"""The course of a run that follows its encoder: within its noise and counts, whatever the unit of time, or it is said
where not.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Turning
from analytic.mechanism.file import dumps
from analytic.mechanism.signals import Signal
from compare.diagnose import courses, prepare
from compare.diagnose.data import quality
from compare.diagnose.data.measured import load_measured
from compare.diagnose.data.recording import Channel, MeasuredRun
from compare.diagnose.data.thin import missed, picked
from compare.diagnose.predict import Model, derived
from compare.diagnose.residuals import Data
from compare.recorded.smooth import Smoother
from diagnosis_rigs import diagnosed, experiment, readings, wrong
from marks import slow
from measured_files import RunTable, write_measured
from tests.evidence.scoreboard.rigs import Plan

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


@pytest.mark.long_rows("6.0-0.05", "6.0-50000000.0", "0.5-50000000.0", "0.02-0.05")
@pytest.mark.parametrize(
    "rate", [0.05, *slow(50.0, 5e3), 5e7]
)  # samples per unit of time: ms and Hz, s and Hz, fast, h and Hz
@pytest.mark.parametrize("degrees", [0.02, 0.5, 6.0, *slow(12.0, 22.0)])
def test_a_course_keeps_to_its_encoder_within_noise_and_counts(rate: float, degrees: float) -> None:
    k, angle = turning(400, degrees)
    time = 1000.0 + k / rate
    for counts in COUNTS:
        for noise in NOISE:
            values, off = read(angle, counts, noise)
            off = math.hypot(off, math.radians(degrees) * rate * np.spacing(time[-1]) / math.sqrt(12))  # of its clock
            run = run_of(time, values)
            course = courses.course(run, "crank_angle")
            found = course.at(time).theta
            assert rms(found - values) < 1.15 * off, (counts, noise)
            assert rms(found - angle) < 1.15 * off, (counts, noise)
            assert courses.strayed(run, "crank_angle", course) is None, (counts, noise)


@pytest.mark.slow
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
    course = courses.course(run, "crank_angle")
    assert rms(course.at(time).theta - angle) < off
    assert courses.strayed(run, "crank_angle", course) is None


@pytest.mark.parametrize("decimals", [12, 2])
def test_stairs_of_a_slow_coarse_encoder_are_not_climbed(decimals: int) -> None:
    """A count every hundred samples or so: a course that follows each of them has the crank jerk by 6e4 rad/s^2."""
    time = np.arange(4000) / 5e3
    angle = 0.3 * time + 0.01 * np.sin(8 * time)
    step = 360 / 1024
    values = np.radians(np.round(np.round(np.degrees(angle) / step) * step, decimals))
    assert quality.quantum(values) == pytest.approx(math.radians(step), rel=0.02)
    course = courses.course(run_of(time, values), "crank_angle").at(time)
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
    fault = courses.strayed(run, "crank_angle", courses.course(run, "crank_angle"))
    assert fault is not None
    assert (fault.run, fault.signal, fault.kind) == ("a", "crank_angle", "course")
    assert fault.samples < 20
    for word in ("run 'a'", "misses crank_angle by up to", "deg", "near 5 s", "noise and counts"):
        assert word in fault.text


def test_a_straight_line_through_a_varying_motion_is_said() -> None:
    k, angle = turning(400, 12.0)
    time = k / 50
    run = run_of(time, angle)
    straight = courses.course(run_of(time, np.polyval(np.polyfit(time, angle, 1), time)), "crank_angle")
    fault = courses.strayed(run, "crank_angle", straight)
    assert fault is not None
    assert fault.samples > 300


def test_thinning_knows_a_fast_motion_that_it_would_lose_from_one_that_it_keeps() -> None:
    for degrees, lost in ((1.0, False), (40.0, True)):
        k, angle = turning(3000, degrees)
        run = run_of(k / 50, read(angle, 2000, 0.0)[0])
        assert (missed(run, picked(run, 4), "crank_angle") > 0) == lost


Motion = tuple[np.ndarray, Turning]


def adams() -> Motion:
    """The crank of a published four-bar: its acceleration is greatest at the start and not zero at the end."""
    time = np.arange(2000) * 0.005
    return time, Turning(1.2 - 1.2 * np.cos(2 * time), 2.4 * np.sin(2 * time), 4.8 * np.cos(2 * time))


def swings(samples: int = 2000, seconds: float = 8.0) -> Motion:
    """Five harmonics of a quarter hertz; no turn."""
    time = np.arange(samples) * seconds / samples
    rng = np.random.default_rng(3)
    rate = np.arange(1, 6) * math.pi / 2
    size, phase = rng.standard_normal(5) / np.arange(1, 6), rng.uniform(0, 6, 5)
    turn = np.multiply.outer(time, rate) + phase
    return time, Turning(np.sin(turn) @ size, np.cos(turn) @ (size * rate), -np.sin(turn) @ (size * rate**2))


def uneven(samples: int, degrees: float, share: float = 0.05) -> Motion:
    """A crank at 50 Hz whose speed varies by a share twice a turn and by half of it once, and slowly by a hundredth."""
    time = np.arange(samples) / 50
    speed, slow = math.radians(degrees) * 50, 4.0 / time[-1]
    mean = speed * (time + 0.01 * np.sin(slow * time) / slow)
    rate, bend = speed * (1 + 0.01 * np.cos(slow * time)), -speed * 0.01 * slow * np.sin(slow * time)
    wave, slope, curve = _ripple(mean, ((1, share / 2, 0.3), (2, share, 1.1)))
    return time, Turning(mean + wave, rate * (1 + slope), bend * (1 + slope) + rate**2 * curve)


def belted(samples: int, degrees: float, share: float = 0.07) -> Motion:
    """A crank at 50 Hz behind a belt that creeps slowly, two hundredths forth and back; its motor varies by a share
    three times in each of its own turns.
    """
    time = np.arange(samples) / 50
    speed, slow = math.radians(degrees) * 50, 4.0 / time[-1]
    wave, slope, curve = _ripple(speed * time, ((3, share, 0.3),))
    creep, bend = speed * 0.02 * np.cos(slow * time), -speed * 0.02 * slow * np.sin(slow * time)
    theta = speed * (time + 0.02 * np.sin(slow * time) / slow) + wave
    return time, Turning(theta, speed * (1 + slope) + creep, speed**2 * curve + bend)


def _ripple(turn: np.ndarray, parts: tuple[tuple[int, float, float], ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Waves (N,) over an angle, and their first and second derivative by it; of each the number in a turn, the share of
    the speed, the phase.
    """
    n, share, phase = (np.array(column)[:, None] for column in zip(*parts, strict=True))
    angle = n * turn + phase
    return (
        np.sum(share / n * np.sin(angle), axis=0),
        np.sum(share * np.cos(angle), axis=0),
        np.sum(-share * n * np.sin(angle), axis=0),
    )


# motion, noise (rad), counts a turn, jitter of the time stamps (of an interval), and how far the acceleration may be
# off (rms, of its own rms) inside and over the five samples at either end
KINDS = {
    "printed": (adams(), 0.0, None, 0.0, 2e-5, 5e-4),
    "swings, fine": (swings(), 1e-6, None, 0.0, 1e-4, 3e-3),
    "swings, white": (swings(), 1e-4, None, 0.0, 2e-3, 5e-2),
    "crank, fine": (uneven(500, 4.0), 2e-5, None, 0.0, 4e-4, 2e-3),
    "crank, white": (uneven(1000, 1.0), 1e-3, None, 0.0, 1e-2, 3e-2),
    "crank, 4096 counts": (uneven(250, 25.0), 0.0, 4096, 0.0, 4e-3, 5e-3),
    "crank, 1000 counts": (uneven(120, 12.0), 0.0, 1000, 0.0, 2e-2, 4e-2),
    "crank, jitter": (uneven(250, 22.0), 0.0, 1000, 0.01, 5e-2, 6e-2),
    "belt, jitter": (belted(150, 23.0), 0.0, 1000, 0.02, 8e-2, 1e-1),
    "crank, sixty samples": (uneven(60, 20.0), 0.0, 2048, 0.01, 1e-1, 1e-1),
}


@pytest.mark.parametrize("kind", KINDS)
def test_acceleration_is_found_inside_and_at_the_ends(kind: str) -> None:
    (time, true), noise, counts, jitter, inside, ends = KINDS[kind]
    late = jitter * time[1] * np.random.default_rng(5).standard_normal(time.size)
    values, _ = read(true.theta + true.omega * late + true.alpha * late**2 / 2, counts, noise, seed=6)
    if kind == "printed":
        values = np.radians([float(f"{value:.7g}") for value in np.degrees(values)])
    found = courses.course(run_of(time, values), "crank_angle").at(time)
    off = (found.alpha - true.alpha) / rms(true.alpha)
    assert rms(off[5:-5]) < inside
    assert rms(np.concatenate([off[:5], off[-5:]])) < ends
    assert rms((found.omega - true.omega) / rms(true.omega)) < inside
    assert rms(found.theta - true.theta) < rms(values - true.theta)


@pytest.mark.parametrize("samples", [60, 400], ids=["part of a turn", "turns"])
def test_a_course_tells_angle_rate_and_acceleration_at_once_as_one_after_the_other(samples: int) -> None:
    k, angle = turning(samples, 5.0)
    course = Smoother(0.01 * k, angle + 3e-4 * np.random.default_rng(4).standard_normal(k.size)).course
    assert bool(course.waves.size) == (samples > 60), "harmonics are of turns that repeat"
    time = np.linspace(-0.02, 0.01 * samples, 501)
    for order, values in enumerate(course.moved(time)):
        assert values == pytest.approx(course(time, order), rel=1e-9, abs=1e-9)


def test_a_course_goes_on_beyond_its_ends_with_the_acceleration_that_it_has_there() -> None:
    time, true = swings()
    course = Smoother(time, true.theta).course
    for end, beyond in ((time[0], time[0] - 0.05), (time[-1], time[-1] + 0.05)):
        assert course(np.array([beyond]), 2) == pytest.approx(course(np.array([end]), 2))
        speed = course(np.array([end]), 1) + course(np.array([end]), 2) * (beyond - end)
        assert course(np.array([beyond]), 1) == pytest.approx(speed)


SIGMAS = {"crank_angle": 1e-3, "follower_angle": 1e-4, "drive_torque": 1e-3}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "draws"),
    [
        pytest.param(uneven(120, 12.0), 150, id="crank"),
        pytest.param(uneven(200, 5.0), 500, marks=pytest.mark.slow, id="longer crank"),
        pytest.param(swings(200, 4.0), 500, marks=pytest.mark.slow, id="swings"),
    ],
)
def test_what_sensors_share_is_what_new_noise_of_the_encoder_does_to_them(motion: Motion, draws: int) -> None:
    """Each redraw of the encoder's noise has its course found anew, how stiff it is included."""
    time, true = motion
    rig = experiment(Plan("r", 10.0, 0.4, time, None, True), sensors=SIGMAS)
    seen = derived(Assembly(rig.nominal), true) | {"crank_angle": true.theta}
    floor = {("r", signal): sigma for signal, sigma in SIGMAS.items()}
    draw = np.random.default_rng(0)
    misses = []
    for _ in range(draws):
        encoder = true.theta + SIGMAS["crank_angle"] * draw.standard_normal(time.size)
        measured = rig.measured([seen | {"crank_angle": encoder}])
        model = Model(measured, rig.rig, rig.nominal, {"r": courses.course(measured.runs[0], "crank_angle")})
        readings = model([[]])[0]
        assert readings is not None
        misses.append(Data(measured, floor).residual(readings))
        if len(misses) == 1:
            shared = prepare.shared(measured, floor, model)
    found, expected = np.std(misses, axis=0), np.sqrt(np.sum(shared**2, axis=1))
    for part in Data(measured, floor).parts:
        for some in (slice(10, -10), np.r_[0:5, -5:0]):
            assert rms(expected[part.place][some]) == pytest.approx(rms(found[part.place][some]), rel=0.15)


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
