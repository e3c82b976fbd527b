"""What an effect must do to be named: each failure is told, chance foretells nothing, values per run are charged."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from compare.diagnose.admission import HELD_OUT, Trial, foretold
from compare.diagnose.effects.effect import Rig
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.explain import Named
from compare.diagnose.fit import Fit
from compare.diagnose.predict import Term
from compare.diagnose.problem import Options, Problem
from compare.diagnose.residuals import Data
from compare.diagnose.search import costs
from compare.diagnose.sensitivities import candidates
from compare.diagnose.workmanship import bundle, size_of
from compare.report.words.statement import parted
from diagnosis_rigs import assert_recovered, diagnosed, experiment, named, played, turn, wrong

PASSES = Trial(400.0, 30.0, 300.0, 0.8, 0.7, ("drive_torque",), closed=False)
RUNS = 4
RIG = experiment(*(turn(f"run-{k}", 4.0 + k) for k in range(RUNS)), sensors={"drive_torque": 1e-3})
BIAS = VOCABULARY["sensor_bias"]
SIGNAL = "drive_torque"


# ---------------------------------------------------------------- a trial and its failures


def test_an_effect_that_passes_every_test_fails_none() -> None:
    assert PASSES.failed == ""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"gain": 16.0}, ("it is worth 4 sigma", "chance alone", "5.48 sigma")),
        ({"gain": -4.0}, ("it is worth -2 sigma",)),
        ({"foretold": 4.0}, ("does not foretell data that it was not fitted to (2 sigma, 3 sigma are asked)",)),
        (
            {"sensors": (), "left": 0.2, "share": 0.03},
            ("3 % of the weighted disagreement away (5 % are asked)", "20 % of what the others leave", "larger"),
        ),
        (
            {"sensors": (), "left": 0.002, "share": 0.4},
            ("0.2 % of what the others leave (1 % is asked)", "half of any sensor's", "something larger remains"),
        ),
    ],
)
def test_each_failure_is_told_in_a_sentence(change: dict[str, object], said: tuple[str, ...]) -> None:
    failed = replace(PASSES, **change).failed  # type: ignore[arg-type]
    assert failed.startswith("it ")
    for part in said:
        assert part in failed


@pytest.mark.parametrize("change", [{"closed": True}, {"sensors": ("drive_torque",)}, {"left": 0.6}])
def test_a_small_share_is_enough_where_the_gap_closes_or_a_sensor_or_what_is_left_is_halved(
    change: dict[str, object],
) -> None:
    small = replace(PASSES, sensors=(), left=0.2, share=0.03)
    assert small.failed
    assert replace(small, **change).failed == ""  # type: ignore[arg-type]


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
    assert HELD_OUT < ahead < gain


# ---------------------------------------------------------------- values per run


def test_a_value_per_run_costs_more_than_a_common_one_and_more_than_a_parameter() -> None:
    rig: Rig = RIG.rig
    terms = candidates(rig, VOCABULARY)
    cost = costs(terms, rig, 2000)
    for name in ("sensor_bias", "sensor_drift"):
        common, each = (cost[Term(VOCABULARY[name], SIGNAL, v)] for v in (0.0, 1.0))
        gravity = cost[next(t for t in terms if t.effect.name == "gravity")]  # two parameters
        single = cost[next(t for t in terms if t.effect.name == "load_torque")]  # one
        assert each - common > RUNS * (gravity - single) * 0.99, "each value is charged as a further parameter, or more"
        assert each > common + RUNS * math.log(2000)


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


# ---------------------------------------------------------------- small errors of the rig together


@pytest.mark.slow
def test_small_errors_that_do_as_well_as_a_gain_are_told_with_their_values() -> None:
    """Two links a tenth of a millimetre off read as a gain of the coupler's angle; a gain of 2 % does not."""
    rig = experiment(sensors={"crank_angle": 4e-5, "coupler_angle": 6e-5, "drive_torque": 8e-3})
    off = wrong("link_length", "coupler", length_error=8e-5), wrong("link_length", "follower", length_error=-6e-5)
    friction = wrong("viscous_friction", "B", damping=0.05)
    for truth, imitated in ((off, True), ((wrong("sensor_gain", "coupler_angle", gain_error=0.02),), False)):
        problem = Problem.of(played(rig, friction, *truth), rig.nominal, Options("mujoco", others=False, workers=1))
        wanted = [t for t in problem.terms if t.key not in problem.ruled_out]
        search = problem.prepared(problem.data, costs(wanted, problem.rig, problem.data.size), wanted, free=False)
        labels = ("sensor_gain@coupler_angle", "viscous_friction@B")
        fit = search.with_terms(search.base, search.screen(search.base), [t for t in wanted if t.label in labels])
        assert fit is not None
        (gain,) = (t for t in fit.terms if t.effect.name == "sensor_gain")
        terms, found = bundle(search, fit, np.ones(problem.data.size), gain, 16.0)
        assert bool(terms) == imitated
        if imitated:
            assert all(0.01 <= size_of(search, found, t) <= 1 for t in terms)
            assert found.chi2 < fit.chi2 + 16


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
