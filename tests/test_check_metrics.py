"""Validation metrics of results that are checked, against what is known of them beforehand."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy.stats import wasserstein_distance

import linkage_crosscheck as lc
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from compare.judge.metrics import metrics
from compare.report.crosscheck_terminal import METRICS_COLUMNS
from compare.report.trust import _row, checked
from compare.results.band import Metrics

THETA = np.linspace(0.0, math.tau, 73)[:-1]
ROCKER = load("crank-rocker")
BIAS = 2.0  # N
SD = 0.01  # of the drive's speed


def recorded(bias: float = 0.0) -> dict[str, np.ndarray]:
    """The analytic side at every 5 deg, with a reaction that reads too much."""
    found = lc.analyse(ROCKER, angles=THETA).signals
    force = np.array(found["reaction_E_y"]) + bias
    return {"crank_angle [rad]": THETA, "reaction_E_x [N]": np.array(found["reaction_E_x"]), "reaction_E_y [N]": force}


def of(results: dict[str, np.ndarray], mechanism: Mechanism = ROCKER) -> dict[str, Metrics]:
    return dict(lc.check(pd.DataFrame(results), mechanism, joint_model="ideal").runs[0].metrics)


def test_a_shift_is_the_mean_error_and_the_area() -> None:
    """And an error of the model's mean, as nothing else is off."""
    off, right = (of(recorded(BIAS))[f"reaction_E_{axis}"] for axis in "yx")
    assert off.error_mean == pytest.approx(-BIAS, abs=1e-6)
    assert off.error_rms == pytest.approx(BIAS, abs=1e-6)
    assert off.area == pytest.approx(BIAS, abs=1e-6)
    assert off.within == 0
    assert off.model_error[0] <= -BIAS + 1e-6
    assert off.model_error[1] < 0
    assert right.error_rms < 1e-6
    assert right.area < 1e-6


def test_noise_is_the_scatter_and_its_mean_is_known_better() -> None:
    """With 0.3 N of noise, known as such: 95 % within 2 u_val, and a mean as well known as by 2000 readings."""
    rng, noise = np.random.default_rng(3), 0.3
    exact = 5.0 * np.sin(np.linspace(0.0, math.tau, 2000))
    read = exact + noise * rng.standard_normal(exact.size)
    found = metrics("N", exact - read, read, noise)
    assert found is not None
    assert found.u_val == noise
    assert found.within == pytest.approx(0.954, abs=0.015)
    low, high = found.model_error
    assert high - low == pytest.approx(4 * noise / math.sqrt(2000))
    assert low < 0 < high


def test_the_area_needs_no_pairing_in_time() -> None:
    """Readings in another order have none; else it is Wasserstein's distance of the first order."""
    rng = np.random.default_rng(5)
    simulated, read = rng.standard_normal(200), 2.0 * rng.standard_normal(200) + 1.0
    mixed, apart = metrics("N", simulated[::-1] - simulated, simulated, 0.1), metrics("N", simulated - read, read, 0.1)
    assert mixed is not None
    assert apart is not None
    assert mixed.area == pytest.approx(0.0, abs=1e-12)
    assert apart.area == pytest.approx(wasserstein_distance(simulated, read))


def test_uncertainties_of_all_kinds_are_summed_as_squares_and_silence_is_left_out() -> None:
    error, read = np.array([0.1, np.nan, -0.1, 0.3]), np.array([1.0, 2.0, np.nan, 3.0])
    found = metrics("N", error, read, 0.3, calibration=0.4, u_num=1.2, u_input=math.sqrt(8.5**2 - 0.5**2 - 1.2**2))
    assert found is not None
    assert found.u_d == pytest.approx(0.5)
    assert found.u_val == pytest.approx(8.5)
    assert found.error_mean == pytest.approx(0.2)
    assert metrics("N", np.full(2, np.nan), np.ones(2), 0.3) is None


def test_where_nothing_of_the_uncertainty_is_known_no_reader_is_shown_metrics() -> None:
    """An error that is held against nothing would be outside of it always."""
    exact, rounded = recorded(), {name: np.round(values, 2) for name, values in recorded().items()}
    for results, shown in ((exact, False), (exact | {"reaction_E_x [N]": rounded["reaction_E_x [N]"]}, True)):
        found = lc.check(pd.DataFrame(results), ROCKER, joint_model="ideal")
        assert "reaction_E_x" in found.runs[0].metrics
        assert bool(checked(found.runs, {"reaction_E_x": "Fx"})) == shown


def test_a_terminal_shows_under_each_heading_the_metric_of_that_name() -> None:
    """Every metric has another size here, so that a column of another would show."""
    m = Metrics(
        unit="N", error_mean=1.0, error_rms=2.0, u_d=3.0, u_calibration=0.5, u_num=4.0, u_input=5.0, u_val=6.0,
        within=0.75, model_error=(8.0, 9.0), area=10.0, samples=4,
    )  # fmt: skip
    row = _row("force", m)
    assert [getattr(row, name) for name in METRICS_COLUMNS] == ["force", "N", "1", "2", "6", "75 %", "8 to 9", "10"]
    assert [*METRICS_COLUMNS.values()][4:] == ["u_val", "|E| <= 2 u_val", "model error", "area"]


def test_rounding_is_uniform() -> None:
    results = recorded()
    results["reaction_E_y [N]"] = np.round(results["reaction_E_y [N]"], 2)
    found = of(results)["reaction_E_y"]
    assert found.u_d == pytest.approx(0.005 / math.sqrt(3), rel=1e-3)
    assert found.error_rms == pytest.approx(found.u_d, rel=0.3)
    assert found.within == 1


def test_a_sensor_has_the_noise_that_measured_data_say() -> None:
    noise, speed = 0.3, ROCKER.speed
    assert speed is not None
    frame = pd.DataFrame(recorded() | {"time [s]": THETA / speed})
    frame["reaction_E_y [N]"] += noise * np.random.default_rng(3).standard_normal(THETA.size)
    data = lc.measured(ROCKER, {"run": frame}, noise={"reaction_E_y": noise})
    found = lc.check(data).runs[0].metrics["reaction_E_y"]
    assert found.u_d == pytest.approx(noise)
    assert found.error_rms == pytest.approx(noise, rel=0.25)
    assert found.within > 0.85
    assert found.model_error[0] < 0 < found.model_error[1]


def test_a_tolerance_of_speed_makes_inertia_forces_uncertain_by_twice_its_share() -> None:
    """Without gravity they go with its square: closed form."""
    light = ROCKER.replace(gravity=(0.0, 0.0), loads=())
    speed = light.speed
    assert speed is not None
    signals = lc.analyse(light, angles=THETA).signals
    results = {"crank_angle [rad]": THETA, "reaction_E_y [N]": np.array(signals["reaction_E_y"])}
    loose = light.replace(tolerances={"drive.speed": {"sd": SD * speed}})
    found = of(results, loose)["reaction_E_y"]
    peak = float(np.sqrt(np.mean(np.square(signals["reaction_E_y"]))))
    assert found.u_input == pytest.approx(2 * SD * peak, rel=1e-3)
    assert of(results, light)["reaction_E_y"].u_input < 1e-3 * found.u_input


def test_an_engine_beside_states_what_its_steps_make() -> None:
    found = lc.check(pd.DataFrame(recorded()), ROCKER, joint_model="ideal", simulator="exudyn", verify=True)
    check, beside = found.runs
    assert {m.u_num for m in check.metrics.values()} == {0.0}
    for name, each in beside.metrics.items():
        assert each.u_num == beside.numerical[name].u_num > 0
        assert each.error_rms < each.u_num + 1e-6


def test_verify_without_an_engine_is_said_to_be_left_out() -> None:
    found = lc.check(pd.DataFrame(recorded()), ROCKER, joint_model="ideal", verify=True)
    assert any("verify is left out" in warning for warning in found.warnings)
