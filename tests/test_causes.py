"""Why a simulation has no result is a value with its remedy, from the engine to the document."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism.file import load
from asked import job_of, request_of
from compare.crosscheck import crosscheck
from compare.judge.tolerances import load_tolerances
from compare.results.crosscheck import Failure
from compare.simulations import simulate
from sim_models.common.failed_starts import TooSoft
from sim_models.engine import CENTRED, ELSEWHERE, Cause, SimulationError, engine
from tests.evidence.validation.scales import Scale, linkage

PAPER = load("paper").with_clearances({"B": 1e-3})
ANGLES = np.radians([30.0, 60.0])


@pytest.mark.parametrize("cause", Cause)
def test_every_cause_has_words_and_a_remedy(cause: Cause) -> None:
    assert cause.words
    assert cause.remedy
    assert str(SimulationError("paper: it failed", cause)) == f"paper: it failed; {cause.remedy}"


@pytest.mark.parametrize("cause", Cause)
@pytest.mark.parametrize("offers", [(), ("motion",)])
def test_a_command_is_told_of_no_option_that_it_lacks(cause: Cause, offers: tuple[str, ...]) -> None:
    """None has a step or a start, and a map no motion; a remedy is left for each."""
    told = SimulationError("it failed", cause).said(offers)
    assert told.startswith("it failed; ")
    assert ("--motion" in told) == (cause is Cause.TOO_MANY_STEPS and bool(offers))
    assert "smaller step" not in told
    assert "centred" not in told


def test_a_map_is_not_told_to_leave_an_angle_out_and_a_cross_check_is() -> None:
    error = SimulationError("it failed", Cause.NO_EQUILIBRIUM, ("use a smaller clearance", ELSEWHERE, CENTRED))
    job = job_of(PAPER, ("mujoco",), load_tolerances())
    assert error.said(job.offers) == "it failed; use a smaller clearance, or leave the angle out"
    assert error.said(replace(job, as_it_is=True).offers) == "it failed; use a smaller clearance"
    assert str(error) == "it failed; use a smaller clearance, or leave the angle out, or start it centred"


def test_a_failure_of_its_own_kind_has_its_own_remedy() -> None:
    error = SimulationError("paper: it failed", Cause.TOO_DEEP, "push less", "(numbers in SI)")
    assert str(error) == "paper: it failed; push less (numbers in SI)"
    assert str(SimulationError("it failed")) == "it failed"


@pytest.mark.parametrize(
    "error",
    [
        SimulationError("it failed", Cause.DIVERGED, "push less", "(numbers in SI)"),
        TooSoft("mujoco", PAPER, "static", "B", 2.0, "at 30 deg"),
        AssemblyError("it cannot be reached", 0.5, "choose another"),
    ],
)
def test_failures_pass_between_processes(error: Exception) -> None:
    """Simulations run in processes of their own, which hand their failures over pickled."""
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is type(error)
    assert str(back) == str(error)
    assert vars(back).keys() == vars(error).keys()


RUNS = {
    Cause.UNPRESSED: request_of(PAPER.replace(loads=[]), "contact", "static", ANGLES),
    Cause.TOO_SOFT: request_of(PAPER.with_joint("B", contact_stiffness=1e2), "spring-damper", "static", ANGLES),
    Cause.TOO_MANY_STEPS: request_of(
        PAPER.replace(drive={"joint": "D", "speed": 1e-5}), "spring-damper", "driven", ANGLES
    ),
    Cause.UNSUPPORTED: request_of(PAPER, "ideal", "driven"),
}


@pytest.mark.parametrize("name", ["mujoco", "exudyn", "pybullet", "dart"])
@pytest.mark.parametrize("cause", RUNS)
def test_an_engine_says_the_cause(name: str, cause: Cause) -> None:
    request = RUNS[cause]
    if (request.joint_model, request.motion) not in engine(name).capabilities.runs:
        pytest.skip(f"{name} has no {request.joint_model} joints in {request.motion} motion")
    found = simulate(name, request)
    assert isinstance(found, Failure)
    assert found.cause is cause
    assert found.unsupported == (cause is Cause.UNSUPPORTED)


@pytest.mark.mujoco
def test_the_cause_is_kept_in_other_units_and_in_the_result() -> None:
    small = linkage(Scale(length=1e-6, speed=1e-3, mass_ratio=1.0))
    (failure,) = crosscheck(small, simulator="mujoco", joint_model="ideal").failures
    assert failure.cause is Cause.TOO_MANY_STEPS
    assert "numbers in units of" not in failure.why
    assert Cause.TOO_MANY_STEPS.remedy in failure.why
    assert Cause.TOO_MANY_STEPS.remedy.endswith("use --motion static")


def test_an_assembly_that_fails_says_its_remedy_apart() -> None:
    with pytest.raises(AssemblyError) as caught:
        Assembly(load("paper")).coordinates(np.radians([180.0]))
    assert caught.value.remedy
    assert caught.value.remedy not in caught.value.what
