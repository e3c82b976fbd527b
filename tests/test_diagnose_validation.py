"""Validation runs: simulated with the nominal and the explained mechanism, and part of nothing else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analytic.mechanism.file import load
from compare.diagnose import engines
from compare.diagnose.data.recording import Measured, MeasuredError
from compare.diagnose.simulate import Task, simulate
from compare.diagnose.workflow import diagnose
from diagnosis_rigs import diagnosed, experiment, played, released, turn, wrong

LONGER = wrong("link_length", "coupler", length_error=1e-4)
RUNS = (turn("slow", 4.0), turn("fast-reverse", -12.0), turn("kept", 8.0))


def with_role(measured: Measured, *names: str) -> Measured:
    """The measurement with runs of these names for validation."""
    return replace(
        measured,
        runs=tuple(replace(run, role="validation") if run.name in names else run for run in measured.runs),
    )


def by_name(result: dict[str, Any], name: str) -> dict[str, Any]:
    """A run of a result."""
    return dict(next(run for run in result["runs"] if run["name"] == name))


def gaps(run: dict[str, Any], side: str) -> dict[str, float]:
    """Gap by signal."""
    return {name: channel[f"gap_{side}"] for name, channel in run["signals"].items()}


@pytest.mark.slow
def test_a_validation_run_changes_nothing_but_what_is_shown() -> None:
    whole = played(experiment(*RUNS), LONGER)
    without = diagnosed(replace(whole, runs=whole.runs[:2]))
    spoilt = dict(whole.runs[2].channels)
    torque = spoilt["drive_torque"]
    spoilt["drive_torque"] = replace(torque, values=torque.values + 0.5)  # what a fit would see
    runs = (*whole.runs[:2], replace(whole.runs[2], channels=spoilt, role="validation"))
    found = diagnosed(replace(whole, runs=runs))
    for field in (
        "verdict",
        "effects",
        "gap",
        "located",
        "candidates",
        "attempts",
        "engines",
        "explained",
        "statement",
    ):
        assert found[field] == without[field], field
    assert found["runs"][:2] == without["runs"]
    kept = found["runs"][2]
    assert (kept["name"], kept["role"], kept["held_out"]) == ("kept", "validation", None)
    before, after = gaps(kept, "before"), gaps(kept, "after")
    assert before["follower_angle"] > 3
    assert after["follower_angle"] == pytest.approx(1.0, abs=0.25)  # the explanation holds where nothing was fitted
    assert after["drive_torque"] == pytest.approx(0.5 / torque.noise, rel=0.05)
    said = found["steps"][-1]["text"][-1]
    assert said.startswith("Validation run kept, which nothing was fitted to, differs by")


@pytest.mark.slow
def test_values_of_other_runs_do_not_apply_to_a_validation_run() -> None:
    offsets = wrong("encoder_offset", "crank_angle", **{"offset@slow": 0.02, "offset@fast-reverse": -0.01})
    plans = [replace(plan, follows=True) for plan in RUNS]
    found = diagnosed(
        with_role(played(experiment(*plans), offsets), "kept"), only=("encoder_offset", "sensor_bias", "link_length")
    )
    (effect,) = found["effects"]
    assert effect["kind"] == "sensor"
    assert set(effect["parameters"]) == {"offset@slow", "offset@fast-reverse"}
    assert "Each run has its own encoder zero, 10 mrad too little to 20 mrad too much." in found["statement"]
    assert "In kept it was not applied, as there is no value for it." in found["statement"]
    kept = by_name(found, "kept")
    assert gaps(kept, "after") == gaps(kept, "before")  # its own zero is not off
    assert "crank_angle" not in kept["signals"]  # it follows its encoder, which cannot judge it
    assert max(gaps(kept, "after").values()) < 1.5


@pytest.mark.slow
def test_a_free_validation_run_begins_at_its_given_start() -> None:
    believed = load("pendulum")
    real = believed.with_joint("O", damping=2e-3)
    starts = [(0.3, 0.0), (-0.9, 0.0), (0.8, 1.0)]
    noise = {"pendulum_angle": 1e-3}
    whole = released(believed, real, noise, starts, np.linspace(0.0, 3.0, 301))
    given = {"pendulum_angle": 0.8, "pendulum_angular_velocity": 1.0}
    runs = (*whole.runs[:2], replace(whole.runs[2], start=given, role="validation"))
    found = diagnosed(replace(whole, runs=runs), only=("viscous_friction", "coulomb_friction", "gravity"))
    assert [effect["name"] for effect in found["effects"]] == ["viscous_friction"]
    kept = by_name(found, "swing-3")
    assert kept["drive"] == "free"
    assert kept["signals"]["pendulum_angle"]["after"][0] == pytest.approx(0.8, abs=1e-9)
    assert kept["signals"]["pendulum_angle"]["gap_before"] > 5
    assert kept["signals"]["pendulum_angle"]["gap_after"] == pytest.approx(1.0, abs=0.3)


@pytest.mark.slow
def test_a_free_validation_run_is_on_the_turn_of_the_fitted_ones() -> None:
    """A spring that the model lacks knows in which turn its joint is; the encoder of a validation run does not."""
    believed = load("pendulum")
    real = believed.with_joint("O", stiffness=3.0, rest_angle=-1.2, damping=2e-2)
    noise = {"pendulum_angle": 1e-3, "pendulum_angular_velocity": 1e-2}
    whole = released(believed, real, noise, [(-0.5, 0.0), (-1.9, 0.0), (-0.8, 1.0)], np.linspace(0.0, 2.0, 201))
    last = whole.runs[2]
    higher = {
        s: replace(c, values=c.values + 2 * np.pi) if s == "pendulum_angle" else c for s, c in last.channels.items()
    }
    given = {"pendulum_angle": -0.8 + 2 * np.pi, "pendulum_angular_velocity": 1.0}
    runs = (*whole.runs[:2], replace(last, channels=higher, start=given, role="validation"))
    found = diagnosed(replace(whole, runs=runs), only=("joint_spring", "viscous_friction"))
    assert {effect["name"] for effect in found["effects"]} == {"joint_spring", "viscous_friction"}
    kept = by_name(found, "swing-3")
    assert kept["signals"]["pendulum_angle"]["gap_before"] > 100
    assert kept["signals"]["pendulum_angle"]["gap_after"] < 3  # from the given start, which is exact here


@pytest.mark.slow
def test_a_validation_run_that_cannot_be_simulated_is_shown_as_such(monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(task: Task) -> object:
        return "the step is too long" if task.run.role == "validation" else simulate(task)

    monkeypatch.setattr(engines, "simulate", stopped)
    found = diagnosed(with_role(played(experiment(*RUNS), LONGER), "kept"), only=("link_length",))
    assert found["verdict"] == "explained"
    kept = by_name(found, "kept")
    assert kept["signals"]["follower_angle"]["gap_before"] is None
    assert set(kept["signals"]["follower_angle"]["after"]) == {None}
    assert "the engine could not simulate it" in found["steps"][-1]["text"][-1]


def test_at_least_one_run_is_fitted() -> None:
    whole = with_role(played(experiment()), "slow", "fast-reverse")
    with pytest.raises(MeasuredError, match=r"every run has role = 'validation', and nothing is left to fit"):
        diagnose(whole, "mujoco", others=False)
