"""Simulations that are wrong in one way each, run through the whole cross-check: every fault is found, and nothing else
is.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import usual_angles
from analytic.mechanism.file import load
from asked import job_of
from compare.crosscheck import crosscheck_job
from compare.judge.tolerances import Known, ToleranceError, load_tolerances
from planted import Fault, Planted, Signals, truth, turned
from sim_models.engine import JointModel, Motion

TOLERANCES = load_tolerances()


def result(
    case: str,
    motion: Motion,
    joint_model: JointModel,
    fault: Fault = truth,
    tolerances: Mapping[str, Any] = TOLERANCES,
    **job: Any,
) -> dict[str, Any]:
    mechanism = load(case)
    theta = usual_angles(Assembly(mechanism))
    asked = job_of(mechanism, ("planted",), tolerances, motion=motion, theta=theta, joint_model=joint_model, **job)
    return crosscheck_job(asked, resolve=lambda name: Planted(fault))


def shifted(signals: Signals, only: str = "") -> Signals:
    return {name: np.roll(values, 1) if only in name else values for name, values in signals.items()}


def swapped(one: str, other: str) -> Fault:
    def fault(signals: Signals) -> Signals:
        return {
            name.replace(f"_{one}_", "_?_").replace(f"_{other}_", f"_{one}_").replace("_?_", f"_{other}_"): v
            for name, v in signals.items()
        }

    return fault


def spoilt(signals: Signals, value: float) -> Signals:
    values = signals["reaction_B_x"]
    values[3] = value
    return signals


def noisy(signals: Signals) -> Signals:
    rng = np.random.default_rng(7)
    return {
        name: values + 1e-9 * np.abs(values).max() * rng.standard_normal(values.size)
        for name, values in signals.items()
    }


RUNS: list[tuple[str, Motion, JointModel]] = [
    ("paper", "static", "contact"),
    ("paper", "static", "ideal"),
    ("paper", "driven", "ideal"),
    ("crank-rocker", "driven", "ideal"),
    ("slider-crank", "driven", "ideal"),
    ("six-bar", "driven", "ideal"),
]
MATCHING: dict[str, Fault] = {
    "exact": truth,
    "with other last digits": noisy,
    "with its bodies a whole turn on": lambda s: {
        name: v + 2 * np.pi if name.endswith("_angle") else v for name, v in s.items()
    },
    "with reactions turned by a thousandth of a degree, half a tolerance at rest": turned("B", np.radians(0.0005)),
}
FAULTS: dict[str, Fault] = {
    "a reaction angle off by 0.02 deg": turned("B", np.radians(0.02)),
    "a reaction angle off by -0.02 deg": turned("B", np.radians(-0.02)),
    "a sign flipped": turned("B", np.pi),
    "a torque's sign flipped": lambda s: s | {"drive_torque": -s["drive_torque"]},
    "everything a sample late": shifted,
    "one reaction a sample late": lambda s: shifted(s, only="reaction_B"),
    "a NaN": lambda s: spoilt(s, np.nan),
    "an infinity": lambda s: spoilt(s, np.inf),
    "a missing signal": lambda s: {name: v for name, v in s.items() if name != "reaction_B_y"},
    "a swapped joint": swapped("A", "B"),
}


@pytest.mark.parametrize("run", RUNS, ids=" ".join)
@pytest.mark.parametrize("fault", MATCHING.values(), ids=MATCHING)
def test_a_matching_simulation_agrees(run: tuple[str, Motion, JointModel], fault: Fault) -> None:
    found = result(*run, fault)
    assert found.verdict == "agrees"
    assert found.failures == ()


@pytest.mark.parametrize("run", RUNS, ids=" ".join)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_simulation_is_caught(run: tuple[str, Motion, JointModel], fault: str) -> None:
    """By its numbers; one that has no numbers has failed, and is not judged."""
    found = result(*run, FAULTS[fault])
    failed = fault in ("a NaN", "an infinity", "a missing signal")
    assert (found.verdict, len(found.failures)) == (("unjudged", 1) if failed else ("disagrees", 0))


@pytest.mark.long_rows("paper static contact", "paper driven ideal", "paper static ideal", "six-bar driven ideal")
@pytest.mark.parametrize("run", RUNS, ids=" ".join)
def test_an_angle_off_by_two_hundredths_of_a_degree_is_found_at_its_joint_and_nowhere_else(
    run: tuple[str, Motion, JointModel],
) -> None:
    for joint in load(run[0]).joints:
        found = result(*run, turned(joint.name, np.radians(0.02)))
        wrong = [d for d in found.runs[0].discrepancies if d.verdict == "disagrees"]
        assert [d.signal for d in wrong] == [f"reaction_{joint.name}_angle"]
        assert wrong[0].max == pytest.approx(np.radians(0.02), rel=1e-6)


def test_what_is_missing_or_no_number_is_named() -> None:
    missing = result("paper", "static", "contact", FAULTS["a missing signal"]).failures
    assert [f.why for f in missing] == [
        "planted contact static (paper): the engine did not answer as it should: its trace lacks reaction_B_y; mend the"
        " engine, or use another simulator"
    ]
    (spoilt_run,) = result("paper", "static", "contact", FAULTS["a NaN"]).failures
    assert "reaction_B_x is nan at crank angle 35 deg" in spoilt_run.why


# -------------------------------------------------------------------- known differences, end to end


def first_order(known: tuple[Known, ...] = ()) -> dict[str, Any]:
    return result(
        "paper", "static", "contact", tolerances=TOLERANCES.model_copy(update={"known": known}), model="first_order"
    )


def declared(rows: list[dict[str, Any]], factor: float) -> tuple[Known, ...]:
    wrong = [row for row in rows if row.verdict == "disagrees"]
    return tuple(
        Known(
            case="paper",
            signal=row.signal,
            bound=factor * abs(row.max),
            reason="Eq. 8 at 10 mm",
            analytic_model=("first_order",),
        )
        for row in wrong
    )


def test_the_papers_first_order_agrees_once_its_differences_are_declared_and_bounded() -> None:
    rows = first_order().runs[0].discrepancies
    assert len(declared(rows, 1.0)) >= 10
    found = first_order(declared(rows, 3.0))
    assert found.verdict == "agrees"
    shown = [row for row in found.runs[0].discrepancies if row.verdict == "known"]
    assert len(shown) == len(declared(rows, 1.0))
    assert all(row.reason.startswith("Eq. 8 at 10 mm (bound") for row in shown)
    left = first_order(declared(rows, 0.9))
    assert left.verdict == "disagrees"
    assert all("has left its bound" in row.reason for row in left.runs[0].discrepancies if row.verdict == "disagrees")


def test_a_known_difference_that_is_not_there_fails() -> None:
    known = Known(case="paper", signal="reaction_B_angle", bound=0.2, reason="once it was so")
    found = result("paper", "static", "contact", tolerances=TOLERANCES.model_copy(update={"known": (known,)}))
    (row,) = (row for row in found.runs[0].discrepancies if row.verdict == "disagrees")
    assert (row.signal, found.verdict) == ("reaction_B_angle", "disagrees")
    assert "has vanished" in row.reason


def test_a_known_difference_of_a_signal_that_is_never_compared_is_refused() -> None:
    known = Known(case="paper", signal="reaction_Q_angle", bound=0.2, reason="misspelt")
    with pytest.raises(
        ToleranceError, match=r"'reaction_Q_angle' is not compared in paper; the signals are reaction_D_angle"
    ):
        result("paper", "static", "contact", tolerances=TOLERANCES.model_copy(update={"known": (known,)}))


@pytest.mark.parametrize(("push", "expected"), [(1e-7, "agrees"), (1e-4, "disagrees")])
def test_where_nothing_is_loaded_an_engines_rounding_agrees_and_a_force_does_not(push: float, expected: str) -> None:
    def pushed(signals: Signals) -> Signals:
        return {
            name: v + push * (name.startswith("reaction_") or name == "drive_torque") for name, v in signals.items()
        }

    found = result("crank-rocker", "static", "ideal", pushed)
    assert found.verdict == expected
    assert all(row.tolerance > 0 for row in found.runs[0].discrepancies)
    assert not any(row.kind == "angle" and row.signal.startswith("reaction_") for row in found.runs[0].discrepancies)
