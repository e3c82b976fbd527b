"""Ties between a fault of a sensor and an effect of the rig: which is said first, and with which odds."""

from __future__ import annotations

import pytest

from diagnosis_rigs import Result, diagnosed, experiment, named, played, turn, wrong
from marks import slow
from tests.evidence.scoreboard.sizes import Planted

RUNS = (turn("slow", 4.0), turn("fast", 9.0), turn("reverse", -6.0))
NOISE = {"crank_angle": 5e-5, "follower_angle": 5e-5, "drive_torque": 5e-3}
# zeros that are nearly as the sign of the speed
LIKE_FRICTION = {"bias@slow": 0.0133, "bias@fast": 0.0105, "bias@reverse": -0.0119}


def told(*hidden: Planted, seed: int = 1) -> Result:
    return diagnosed(played(experiment(*RUNS, sensors=NOISE), *hidden, seed=seed))


def first_and_ties(result: Result) -> tuple[tuple[str, str], dict[tuple[str, str], float]]:
    (effect,) = (e for e in result["effects"] if e["ambiguous_with"])
    return (effect["name"], effect["where"]), {(t["name"], t["where"]): t["odds"] for t in effect["ambiguous_with"]}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, *slow(2)])
def test_zeros_of_a_torque_sensor_that_look_like_friction_are_named_first_where_they_are_likelier(seed: int) -> None:
    first, ties = first_and_ties(told(wrong("sensor_bias", "drive_torque", **LIKE_FRICTION), seed=seed))
    assert first == ("sensor_bias", "drive_torque")
    assert ties["coulomb_friction", "D"] < 1


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_friction_at_the_crank_is_named_first_though_zeros_of_each_run_fit_as_well(seed: int) -> None:
    result = told(wrong("coulomb_friction", "D", friction_torque=0.012), seed=seed)
    assert named(result)[0] == ("coulomb_friction", "D")
    assert all(t["odds"] < 1 for e in result["effects"] for t in e["ambiguous_with"] if t["name"] == "sensor_bias")
