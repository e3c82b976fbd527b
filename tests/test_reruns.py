"""A disagreement near its tolerance counts where it stays in a finer run, and only there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from asked import job_of, request_of
from compare.crosscheck import crosscheck_job
from compare.judge.reruns import HARDER
from compare.judge.tolerances import load_tolerances
from sim_models.common.contact_laws import STATIC_STIFFNESS
from sim_models.engine import Engine, Request, Trace, engine

TURN = np.radians(np.arange(0.0, 360.0, 30.0))


@dataclass
class Faulty:
    """MuJoCo with a fault in the direction of a reaction (rad), as large as ``fault`` says for a run's step (s)."""

    fault: Callable[[float], float]
    real: Engine
    steps: list[float]

    name = "mujoco"
    package = "mujoco"

    @property
    def capabilities(self) -> Any:
        return self.real.capabilities

    def simulate(self, request: Request) -> Trace:
        trace = self.real.simulate(request)
        self.steps.append(trace.settings["step"])
        turned = np.exp(1j * self.fault(self.steps[-1])) * (
            trace.signals["reaction_B_x"] + 1j * trace.signals["reaction_B_y"]
        )
        return replace(trace, signals={**trace.signals, "reaction_B_x": turned.real, "reaction_B_y": turned.imag})


def checked(fault: Callable[[float], float]) -> tuple[dict[str, Any], list[float]]:
    faulty = Faulty(fault, engine("mujoco"), [])
    return (
        crosscheck_job(
            job_of(load("crank-rocker"), ("mujoco",), load_tolerances(), theta=TURN), resolve=lambda name: faulty
        ),
        faulty.steps,
    )


def test_what_stays_in_a_finer_run_disagrees() -> None:
    result, steps = checked(lambda step: 5e-4)
    assert result.verdict == "disagrees"
    assert steps[1:] == [steps[0] / 2]
    assert result.runs[0].settings["refinements"] == 1


def test_what_goes_with_the_square_of_the_step_was_the_engines() -> None:
    result, steps = checked(lambda step: 5e-4 * (step / 6.37e-5) ** 2)
    assert result.verdict == "agrees"
    assert steps == [steps[0], steps[0] / 2]
    assert result.runs[0].settings["step"] == steps[1]


def test_what_falls_and_is_not_gone_makes_the_engine_no_referee() -> None:
    result, steps = checked(lambda step: 0.024 * step / 6.37e-5)
    np.testing.assert_allclose(steps, [steps[0], steps[0] / 2, steps[0] / 32])
    assert result.runs == ()
    (failure,) = result.failures
    assert "reaction_B_angle by 0.00075 rad is its own error: it was 16.0 times that in a coarser run" in failure.why


def test_a_last_run_is_as_fine_as_the_fall_before_it_asks_for() -> None:
    """Of 0.6 mrad a quarter is within the tolerance of 0.175 mrad."""
    result, steps = checked(lambda step: 1.2e-3 * step / 6.37e-5)
    assert result.verdict == "agrees"
    np.testing.assert_allclose(steps, [steps[0], steps[0] / 2, steps[0] / 8])


@pytest.mark.parametrize(("fault", "runs"), [(0.0, 1), (1.0, 1)])
def test_what_agrees_or_is_far_off_is_not_run_again(fault: float, runs: int) -> None:
    result, steps = checked(lambda step: fault)
    assert len(steps) == runs
    assert "refinements" not in result.runs[0].settings


def light_contact() -> Mechanism:
    """The paper's case with so little clearance that the contact's own give is some of it."""
    return load("paper").with_clearances({"B": 1e-3})


def test_a_contact_of_our_own_stiffness_is_made_harder_and_the_mechanisms_is_not() -> None:
    from compare.judge.reruns import finer

    request = request_of(light_contact(), "contact", "static", TURN[1:4])
    trace = engine("mujoco").simulate(request)
    harder = finer(request, trace)
    assert harder is not None
    assert harder.mechanism.joint("B").contact_stiffness == HARDER * STATIC_STIFFNESS
    again = engine("mujoco").simulate(harder)
    assert again.settings["contact_stiffness"] == HARDER * STATIC_STIFFNESS
    stated = replace(request, mechanism=request.mechanism.with_joint("B", contact_stiffness=1e8))
    assert finer(stated, trace) is None


@pytest.mark.slow
@pytest.mark.mujoco
def test_a_contact_that_hides_its_clearance_has_failed_if_it_is_the_mechanisms_and_is_made_harder_if_ours() -> None:
    """50 N on 1e5 N/m: half a millimetre and more, where the clearance is a hundredth of one."""
    m = load("paper").with_clearances({"B": 1e-5})
    theta = np.radians([30.0, 60.0, 120.0])
    soft = m.with_joint("B", contact_stiffness=1e5)
    result = crosscheck_job(job_of(soft, ("mujoco",), load_tolerances(), "static", theta, joint_model="contact"))
    assert result.runs == ()
    (failure,) = result.failures
    assert (
        "contact too soft for this load: the pin of joint B is seen 0.0005 m beyond its rim, 50 times its clearance"
        in failure.why
    )
    assert "give joint B contact_stiffness = 5.0e+07 (N/m) or more" in failure.why
    enough = m.with_joint("B", contact_stiffness=5.1e7)
    assert (
        crosscheck_job(job_of(enough, ("mujoco",), load_tolerances(), "static", theta, joint_model="contact")).verdict
        == "agrees"
    )
    ours = crosscheck_job(
        job_of(m.with_clearances({"B": 5e-7}), ("mujoco",), load_tolerances(), "static", theta, joint_model="contact")
    )
    assert ours.runs[0].settings["contact_stiffness"] == HARDER * STATIC_STIFFNESS
    assert ours.verdict == "agrees"
