"""Data left out: chance foretells nothing, a clear effect does; and values per run beside common ones."""

from __future__ import annotations

import numpy as np
import pytest

from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.explanation import Named
from compare.diagnose.fit import Fit
from compare.diagnose.left_out import foretold
from compare.diagnose.predict import Term
from compare.diagnose.residuals import Data
from compare.report.words.statement import parted
from diagnosis_rigs import assert_recovered, diagnosed, experiment, named, played, turn, wrong

RUNS = 4
RIG = experiment(*(turn(f"run-{k}", 4.0 + k) for k in range(RUNS)), sensors={"drive_torque": 1e-3})
BIAS = VOCABULARY["sensor_bias"]
SIGNAL = "drive_torque"


# ---------------------------------------------------------------- data left out


def data() -> Data:
    measured = RIG.measured()
    return Data(measured, {(r.name, s): c.noise for r in measured.runs for s, c in r.channels.items()})


def biased(data: Data, residual: np.ndarray, each_run: bool) -> Fit:
    """A bias of the sensor fitted to a residual, one value or one for each run."""
    columns = np.zeros((data.size, RUNS if each_run else 1))
    for part in data.parts:
        columns[part.place, part.run if each_run else 0] = -1.0  # what is predicted goes off
    x = -np.linalg.lstsq(columns, residual, rcond=None)[0]
    term = Term(BIAS, SIGNAL, float(each_run))
    return Fit((term,), (x,), residual + columns @ x, columns, np.zeros(x.size, bool))


def brings(data: Data, residual: np.ndarray, each_run: bool) -> tuple[float, float]:
    """Decrease of chi^2 by a bias, and on data left out."""
    weights, nothing = np.ones(data.size), Fit((), (), residual, np.zeros((data.size, 0)), np.zeros(0, bool))
    fit = biased(data, residual, each_run)
    return nothing.chi2 - fit.chi2, foretold(data, nothing, weights) - foretold(data, fit, weights)


@pytest.mark.parametrize("seed", range(10))
def test_chance_in_a_value_per_run_foretells_nothing(seed: int) -> None:
    """Whole runs are left out: what a run's own value gains in its run it must pay with not having been foretold."""
    found = data()
    gain, ahead = brings(found, np.random.default_rng(seed).standard_normal(found.size), each_run=True)
    assert gain > 0, "fitted to all data, it always gains"
    assert ahead < 0


@pytest.mark.parametrize("each_run", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_a_clear_effect_is_foretold(seed: int, each_run: bool) -> None:
    found, rng = data(), np.random.default_rng(seed)
    residual = rng.standard_normal(found.size)
    sizes = rng.choice([-1, 1], RUNS) * rng.uniform(0.7, 1.5, RUNS) if each_run else np.full(RUNS, 0.5)
    for part in found.parts:
        residual[part.place] += sizes[part.run]
    gain, ahead = brings(found, residual, each_run)
    assert 9.0 < ahead < gain, "three sigma"


# ---------------------------------------------------------------- values per run


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("sensor_bias", {"bias@slow": 0.012, "bias@middle": -0.006, "bias@fast": 0.003}),
        ("sensor_drift", {"drift@slow": 0.01, "drift@middle": -0.02, "drift@fast": 0.05}),
    ],
)
def test_faults_of_a_sensor_with_a_value_for_each_run_are_recovered(name: str, values: dict[str, float]) -> None:
    rig = experiment(turn("slow", 4.0), turn("middle", 8.0), turn("fast", -12.0))
    fault = wrong(name, SIGNAL, **values)
    assert_recovered(diagnosed(played(rig, fault), only=("sensor_bias", "sensor_drift", "payload")), fault)


@pytest.mark.slow
def test_a_common_bias_is_one_value() -> None:
    rig = experiment(turn("slow", 4.0), turn("middle", 8.0), turn("fast", -12.0))
    fault = wrong("sensor_bias", SIGNAL, bias=0.005)
    found = diagnosed(played(rig, fault), only=("sensor_bias", "sensor_drift", "payload"))
    assert named(found) == [("sensor_bias", SIGNAL)]
    assert set(found["effects"][0]["parameters"]) == {"bias"}


# ---------------------------------------------------------------- what is told at length


@pytest.mark.parametrize(
    ("shares", "slight"),
    [([0.9, 0.004, 0.002], []), ([0.9, 0.05, 0.004, 0.02, 0.002], [2, 4]), ([0.005] * 5, [1, 2, 3, 4])],
)
def test_a_paragraph_tells_what_takes_part_in_the_gap_and_lists_the_rest(
    shares: list[float], slight: list[int]
) -> None:
    found = [Named(Term(BIAS, str(k)), {}, 100.0, (2.0, 1.0), (2.0, 1.0), share=v) for k, v in enumerate(shares)]
    told, rest = parted(found)
    assert [int(n.term.where) for n in rest] == slight
    assert sorted([*told, *rest], key=found.index) == found
