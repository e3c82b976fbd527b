"""The colour of noise: what wanders or hums is found, and what the rig may have done is not called noise."""

from __future__ import annotations

import math
from dataclasses import astuple, replace

import numpy as np
import pytest
from scipy.signal import lfilter

from compare.diagnose.colour import colours
from compare.diagnose.problem import Options, Problem
from compare.diagnose.residuals import Colour, Data
from diagnosis_rigs import experiment, four_bar, played
from tests.evidence.scoreboard.rigs import Experiment, Plan

SPEED, SAMPLES = 12.0, 600  # rad/s; three turns at 382 Hz
TIME = np.linspace(0.0, 3 * 2 * math.pi / SPEED, SAMPLES)
KEEPS, WANDER, HUM = 0.95, 2.0, 2.0


def rig(samples: int = SAMPLES, **sensors: float) -> Experiment:
    plans = [Plan(name, SPEED, 0.0, TIME[:samples], None) for name in ("first", "second")]
    return experiment(*plans, sensors=sensors or {"drive_torque": 1e-3, "follower_angle": 5e-5})


def data_of(rig: Experiment) -> Data:
    measured = rig.measured()
    noise = {(run.name, s): c.noise for run in measured.runs for s, c in run.channels.items()}
    return Data(measured, noise)


def wandering(rng: np.random.Generator, n: int) -> np.ndarray:
    """Noise (n,) of rms WANDER that keeps a share of itself from sample to sample."""
    steps = WANDER * math.sqrt(1 - KEEPS**2) * rng.standard_normal(n + 400)
    return np.asarray(lfilter([1.0], [1.0, -KEEPS], steps)[400:])


def with_part(data: Data, rng: np.random.Generator, added: dict[str, list[np.ndarray]]) -> np.ndarray:
    """White noise (size,), and what is added to a sensor in each run."""
    residual = rng.standard_normal(data.size)
    for part in data.parts:
        if part.signal in added:
            residual[part.place] += added[part.signal][part.run]
    return residual


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_that_wanders_and_hums_is_found_with_its_size(seed: int) -> None:
    data, rng = data_of(rig()), np.random.default_rng(seed)
    hum = [HUM * np.sin(2 * np.pi * 50 * TIME + phase) for phase in rng.uniform(0, 6, 2)]
    found = colours(data, with_part(data, rng, {"drive_torque": [wandering(rng, SAMPLES) + h for h in hum]}))
    assert set(found) == {"drive_torque"}, "the other sensor's noise is white"
    colour = found["drive_torque"]
    assert colour.hum == (50.0,)
    assert colour.amplitude == pytest.approx(HUM, rel=0.15)
    # the slowest part of what wanders looks like what repeats with the crank, and is taken out with it
    assert colour.total == pytest.approx(math.sqrt(1 + WANDER**2 + HUM**2 / 2), rel=0.25)
    assert 0.8 <= colour.keeps <= 0.98
    assert 1.0 <= colour.size < 1.6, "of the wander and the white part little is new in a sample"


def test_white_noise_has_no_colour_however_large() -> None:
    data = data_of(rig())
    assert colours(data, 3 * np.random.default_rng(1).standard_normal(data.size)) == {}


@pytest.mark.parametrize("harmonic", [1, 3, 7])
def test_what_repeats_with_the_crank_is_not_called_noise(harmonic: int) -> None:
    data, rng = data_of(rig()), np.random.default_rng(1)
    turns = [3 * np.sin(harmonic * SPEED * TIME + 0.4)] * 2
    assert colours(data, with_part(data, rng, {"drive_torque": turns})) == {}


def test_noise_is_found_beside_what_repeats_with_the_crank_and_without_it() -> None:
    data, rng = data_of(rig()), np.random.default_rng(1)
    wander = [wandering(rng, SAMPLES) for _ in range(2)]
    repeating = [w + 5 * np.sin(2 * SPEED * TIME) for w in wander]
    alone = colours(data, with_part(data, np.random.default_rng(2), {"drive_torque": wander}))
    beside = colours(data, with_part(data, np.random.default_rng(2), {"drive_torque": repeating}))
    assert set(beside) == set(alone) == {"drive_torque"}
    assert astuple(beside["drive_torque"])[:3] == pytest.approx(astuple(alone["drive_torque"])[:3])
    assert alone["drive_torque"].total == pytest.approx(math.sqrt(1 + WANDER**2), rel=0.25)


@pytest.mark.parametrize("warming", [math.inf, 0.3], ids=["evenly", "ever less"])
def test_what_repeats_with_the_crank_and_grows_is_not_called_noise(warming: float) -> None:
    """A belt that slips, and a link that warms up: the same fault, larger and larger."""
    data, rng = data_of(rig()), np.random.default_rng(1)
    elapsed = TIME / TIME[-1]
    grown = elapsed if math.isinf(warming) else -np.expm1(-elapsed / warming)
    parts = [6 * grown * (1 + np.cos(SPEED * TIME + 0.4) + np.sin(2 * SPEED * TIME))] * 2
    assert colours(data, with_part(data, rng, {"drive_torque": parts})) == {}


def test_a_line_between_the_crank_s_harmonics_is_not_called_noise() -> None:
    data, rng = data_of(rig()), np.random.default_rng(1)
    beat = [2 * np.sin(4.5 * SPEED * TIME + phase) for phase in (0.4, 2.0)]
    assert colours(data, with_part(data, rng, {"drive_torque": beat})) == {}


def test_what_two_sensors_share_is_not_called_noise() -> None:
    data, rng = data_of(rig()), np.random.default_rng(1)
    one, other = ([wandering(rng, SAMPLES) for _ in range(2)] for _ in range(2))
    apart = colours(data, with_part(data, rng, {"drive_torque": one, "follower_angle": other}))
    assert set(apart) == {"drive_torque", "follower_angle"}, "each by itself is noise"
    assert colours(data, with_part(data, rng, {"drive_torque": one, "follower_angle": one})) == {}


def test_a_run_of_one_turn_says_nothing_of_colours() -> None:
    short = rig(SAMPLES // 3)
    data, rng = data_of(short), np.random.default_rng(1)
    parts = {"drive_torque": [wandering(rng, SAMPLES // 3) for _ in range(2)]}
    assert colours(data, with_part(data, rng, parts)) == {}


def test_samples_of_coloured_noise_count_for_what_they_say_anew() -> None:
    """Many draws of such noise are white in the data's residual, the ends of the runs included."""
    n, draws, rng = 24, 6000, np.random.default_rng(5)
    colour = Colour(keeps=0.9, forgets=0.5, size=1.5, hum=(50.0,), amplitude=2.0)
    sigma = 1e-3
    data = data_of(rig(n, drive_torque=sigma)).coloured({"drive_torque": colour})
    turn, drawn = 2 * np.pi * 50 * TIME[:n], []
    for _ in range(draws):
        readings = []
        for _ in range(2):
            steps = colour.size * rng.standard_normal(n + 200)
            slow = lfilter([1.0, -colour.forgets], [1.0, -colour.keeps], steps)[200:]
            a, b = colour.amplitude * rng.standard_normal(2)
            readings.append({"drive_torque": -sigma * (slow + a * np.cos(turn) + b * np.sin(turn))})
        drawn.append(data.residual(readings))
    covariance = np.cov(np.array(drawn).T)
    assert np.abs(np.diag(covariance) - 1).max() < 0.1
    assert np.abs(covariance - np.diag(np.diag(covariance))).max() < 0.08
    plain = data.coloured({})
    assert np.mean([np.mean(plain.residual(readings) ** 2) for _ in range(1)]) > 1.5, "they are not white as they stand"


@pytest.mark.slow
def test_hum_is_told_before_any_search_though_a_torque_that_repeats_would_explain_it() -> None:
    """In both runs 50 Hz is at a harmonic of the crank."""
    speeds = [2 * math.pi * 50 / harmonic for harmonic in (23, -17)]
    plans = [Plan(f"{w:.3g}", w, 0.4, np.linspace(0.0, 8 * math.pi / abs(w), 700), None) for w in speeds]
    measured = played(experiment(*plans, sensors={"crank_angle": 5e-4, "follower_angle": 5e-4, "drive_torque": 0.02}))
    runs = []
    for run in measured.runs:
        torque = run.channels["drive_torque"]
        humming = replace(torque, values=torque.values + 0.03 * np.sin(2 * np.pi * 50 * run.time + 0.3))
        runs.append(replace(run, channels={**run.channels, "drive_torque": humming}))
    problem = Problem.of(replace(measured, runs=tuple(runs)), four_bar(), Options("mujoco", others=False, workers=1))
    begun = problem.begin_search(problem.data)
    found = colours(problem.data, begun.left)
    assert set(found) == {"drive_torque"}
    assert found["drive_torque"].hum == (50.0,)
    assert found["drive_torque"].amplitude == pytest.approx(1.5, rel=0.1), "of the noise"
    assert colours(problem.data, begun.survey(begun.base).left()) == {}, "the torque that repeats explains it"
