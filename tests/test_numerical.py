"""What steps alone may make of a run: Richardson's series in closed form, and engines against much shorter steps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.mechanism.file import load
from analytic.mechanism.signals import named
from asked import request_of
from compare.judge.numerical import COVERAGE, ORDERED, ROUNDING, UNORDERED, convergence
from sim_models.engine import engine

SHAPE = np.array([0.2, -1.0, 0.7])  # of an error over the samples
ROCKER = load("crank-rocker")
SIGNALS = named(ROCKER.bodies, ROCKER.joints, ROCKER.drives)
FORCE, ANGLE = SIGNALS["reaction_B_x"], SIGNALS["crank_angle"]


def series(order: float, size: float = 1e-3) -> list[np.ndarray]:
    """A method's values in steps 1, 1/2 and 1/4, of which the exact ones are 5."""
    return [5.0 + size * SHAPE * h**order for h in (1.0, 0.5, 0.25)]


@pytest.mark.parametrize("order", [0.7, 1.0, 1.5, 2.0])
def test_a_series_tells_its_order_and_its_error(order: float) -> None:
    found = convergence(FORCE, series(order))
    assert found.order == pytest.approx(order, abs=1e-6)
    safety = ORDERED if order >= 0.9 else UNORDERED
    assert COVERAGE * found.u_num == pytest.approx(safety * 1e-3, rel=1e-6)  # the exact error is 1e-3


def test_a_high_order_is_counted_as_two() -> None:
    found = convergence(FORCE, series(4.0))
    assert found.order == pytest.approx(4.0, abs=1e-6)
    assert COVERAGE * found.u_num == pytest.approx(ORDERED * 1e-3 * (15 / 16) * 4 / 3, rel=1e-6)


def test_differences_that_do_not_fall_have_no_order_and_the_larger_factor() -> None:
    rough = [5.0 + 1e-3 * SHAPE * sign for sign in (1.0, -1.0, 2.0)]
    found = convergence(FORCE, rough)
    assert found.order is None
    assert COVERAGE * found.u_num == pytest.approx(UNORDERED * 3e-3)


def test_half_steps_alone_have_no_order_and_the_larger_factor() -> None:
    found = convergence(FORCE, series(1.0)[:2])
    assert found.order is None
    assert COVERAGE * found.u_num == pytest.approx(UNORDERED * 0.5e-3)


def test_equal_values_leave_rounding_alone_and_angles_a_turn_apart_are_equal() -> None:
    turned = [np.full(3, 1.0), np.full(3, 1.0), np.full(3, 1.0 + 2 * np.pi)]
    found = convergence(ANGLE, turned)
    assert found.order is None
    assert 0 < found.u_num < 1e-13


ANGLES = np.array([0.5, 1.5, 4.0])


@pytest.mark.long_rows("exudyn")
@pytest.mark.parametrize("name", ["mujoco", "exudyn"])
def test_the_error_against_a_sixteenth_of_the_step_lies_within(name: str) -> None:
    """Of two engines with ideal joints; all of them, with every joint model, are in reports/trust.md."""
    run = lc.crosscheck(ROCKER, simulator=name, joint_model="ideal", angles=ANGLES, verify=True).runs[0]
    exact = engine(name).simulate(request_of(ROCKER, crank_angle=ANGLES, step=run.settings["step"] / 16)).signals
    told = [s for s in run.numerical if s in exact]
    shorter = ROUNDING * 16 * np.ptp(run.time) / run.settings["step"]  # to which those steps are known themselves
    errors = {s: np.abs(SIGNALS[s].apart(run.simulated[s], exact[s])).max() for s in told}
    known = {s: shorter * np.abs(exact[s]).max() for s in told}
    outside = [s for s in told if errors[s] > COVERAGE * run.numerical[s].u_num + known[s]]
    assert len(told) > 20
    assert len(outside) <= 0.05 * len(told), outside
    orders = [run.numerical[f"{body}_angle"].order for body in ("coupler", "follower")]
    assert orders == pytest.approx([2.0, 2.0], abs=0.1)  # loops are closed to second order


def test_a_difference_that_steps_may_make_is_not_judged(tmp_path: Path) -> None:
    """Exudyn's coupler is off by 3e-7 rad, which half the step shows to be its own; MuJoCo's reactions are off by more
    than its steps make, as it has soft constraints.
    """
    strict = tmp_path / "strict.toml"
    strict.write_text("[driven.ideal]\nposition = { absolute = 1e-11 }\nmagnitude = { relative = 1e-12 }\n")

    def verdicts(name: str, verify: bool) -> dict[str, str]:
        result = lc.crosscheck(
            "crank-rocker", simulator=name, joint_model="ideal", angles=ANGLES, tolerances=strict, verify=verify
        )
        return {d.signal: d.verdict for d in result.runs[0].discrepancies}

    assert verdicts("exudyn", False)["coupler_angle"] == "disagrees"
    assert verdicts("exudyn", True)["coupler_angle"] == "unjudged"
    assert verdicts("mujoco", True)["reaction_B_magnitude"] == "disagrees"
