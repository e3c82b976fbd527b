"""How much samples count whose residual is more than noise: less where it is slow, and where it comes back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from compare.diagnose.noise import correlation_time, lasting, recurrence, rms, sample_weights
from compare.diagnose.residuals import Data, cycles
from diagnosis_rigs import experiment, turn

CYCLES, EACH = 6, 200


def fast(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(EACH)


@pytest.mark.parametrize("shift", [0.0, 0.31])
def test_a_residual_that_comes_back_each_cycle_is_one_cycle(shift: float) -> None:
    cycle = shift + np.arange(CYCLES * EACH) / EACH
    whole = CYCLES - (shift > 0)
    assert recurrence(np.tile(fast(1), CYCLES), cycle) == pytest.approx(whole, rel=1e-9)


def test_cycles_that_differ_count_each_and_a_part_that_comes_back_counts_in_part() -> None:
    cycle, white = np.arange(CYCLES * EACH) / EACH, np.random.default_rng(2).standard_normal(CYCLES * EACH)
    assert recurrence(white, cycle) == pytest.approx(1.0, abs=0.15)
    half = np.tile(fast(3), CYCLES) + white  # half of its square: 1 + 5/2
    assert recurrence(half, cycle) == pytest.approx(3.5, rel=0.1)
    assert recurrence(white, np.full(white.size, -1.0)) == 1.0


def test_a_slow_residual_has_as_many_samples_as_its_correlation_leaves() -> None:
    rng, keeps = np.random.default_rng(4), 0.9
    r = np.zeros(20000)
    for k, new in enumerate(rng.standard_normal(r.size - 1), 1):
        r[k] = keeps * r[k - 1] + new
    assert correlation_time(r) == pytest.approx((1 + keeps) / (1 - keeps), rel=0.2)


def test_samples_of_a_turning_crank_count_by_size_slowness_and_turns() -> None:
    rig = experiment(
        replace(turn("slow", 4.0), time=np.linspace(0.0, 2.5 * math.pi, 600)), sensors={"drive_torque": 1e-3}
    )
    measured = rig.measured()
    (run,) = measured.runs
    data = Data(measured, {(run.name, s): c.noise for s, c in run.channels.items()})
    cycle = cycles(run, measured.mechanism)
    assert cycle is not None
    turns = abs(run.speed or 0.0) * (run.time[-1] - run.time[0]) / math.tau
    assert cycle[-1] == pytest.approx(turns)
    left = 3 * np.cos(math.tau * cycle)
    assert np.all(sample_weights(data, left / 10) == 1.0)  # no more than noise
    by_hand = 1 / (float(np.mean(left**2)) * correlation_time(left) * math.floor(turns))
    np.testing.assert_allclose(sample_weights(data, left), by_hand, rtol=0.02)


def test_of_an_engine_s_difference_what_rings_in_another_way_stays_in_the_noise() -> None:
    """Pins that strike are as far off in the nominal linkage, at other times; what a soft link bends lasts, and so does
    what an effect alone makes.
    """
    rng = np.random.default_rng(5)
    bent, ringing, again, much = (
        np.sin(np.arange(300) / 20),
        *(rng.standard_normal(300) for _ in range(2)),
        np.ones(300),
    )
    records = [slice(0, 300), slice(300, 600), slice(600, 900)]
    nominal = np.concatenate([bent, ringing, 0.1 * ringing])
    apart = np.concatenate([1.1 * bent, again, much])
    taken = lasting(apart, nominal, records)
    assert taken[records[0]] == pytest.approx(apart[records[0]])
    assert rms(taken[records[1]]) < 0.2
    assert taken[records[2]] == pytest.approx(much, abs=0.05)
