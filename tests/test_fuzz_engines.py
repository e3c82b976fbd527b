"""Random linkages through every engine, by the shipped tolerances: each run agrees, or is a failure in a sentence.

More of them: ``FUZZ_ENGINES=300 pytest tests/test_fuzz_engines.py -m slow`` (``FUZZ_FIRST`` is the first number);
``FUZZ_OUT`` is a folder for the linkages of runs that disagree, ``FUZZ_SCALES=wide`` leaves the human scale.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps
from asked import job_of
from compare.crosscheck import crosscheck_job
from compare.judge.tolerances import load_tolerances
from multiplier_oracle import LeftOut, Oracle
from random_linkages import HUMAN, WIDE, seeded
from sim_models.engine import ENGINES, JointModel, Motion, SimulatorMissing, Unsupported, declared, engine

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::analytic.mechanism.MechanismWarning")]

FIRST, LINKAGES = int(os.environ.get("FUZZ_FIRST", "0")), int(os.environ.get("FUZZ_ENGINES", "20"))
RANGES = WIDE if os.environ.get("FUZZ_SCALES") == "wide" else HUMAN
CONDITION = 30.0  # of the oracle's constraints, at every angle
DRAWS = 8  # seeds for each linkage
SHORTEST = np.radians(15.0)  # of crank
SAMPLES = 7
RUNS: tuple[tuple[JointModel, Motion], ...] = (("ideal", "driven"), ("contact", "static"))


def grid(m: Mechanism) -> np.ndarray | None:
    """Crank angles (N,) rad about the assembly angle at which the linkage is well conditioned; None if there are too
    few.
    """
    oracle = Oracle(m.with_clearances({}))
    theta, q = oracle.walk(np.radians(40.0))
    good = oracle.condition(q, theta) < CONDITION
    here = int(np.argmin(np.abs(theta - oracle.start)))
    if not good[here]:
        return None
    low = here - int(np.argmin(good[here::-1])) + 1 if not good[: here + 1].all() else 0
    high = here + int(np.argmin(good[here:])) - 1 if not good[here:].all() else theta.size - 1
    return np.linspace(theta[low], theta[high], SAMPLES) if theta[high] - theta[low] >= SHORTEST else None


def outcomes(m: Mechanism, theta: np.ndarray) -> Iterator[tuple[str, str, str]]:
    """(engine and run, verdict, why) of every engine that is installed."""
    for name in ENGINES:
        for model, motion in RUNS:
            if (model, motion) not in declared(name).capabilities.runs or (model != "ideal" and not m.clearances):
                continue
            run = f"{name} {model} {motion}"
            try:
                engine(name)
                result = crosscheck_job(job_of(m, (name,), load_tolerances(), motion, theta, joint_model=model))
            except SimulatorMissing:
                continue
            except (Unsupported, AssemblyError) as why:
                yield run, "refused", str(why)
                continue
            if result.failures:
                yield run, "failed", result.failures[0].why
                continue
            (one,) = result.runs
            differ = [
                f"{d.signal} {d.max:+.3g} {d.unit} ({d.tolerance:.3g}) at {np.degrees(d.at_crank_angle):.2f} deg"
                for d in one.discrepancies
                if d.verdict == "disagrees"
            ]
            yield run, one.verdict, "; ".join(differ) or one.reason


def conditioned(number: int) -> tuple[int, Mechanism, np.ndarray]:
    """The first of some seeds whose linkage is well conditioned: seed, linkage, crank angles."""
    for seed in range(number * DRAWS, (number + 1) * DRAWS):
        m = seeded(seed, RANGES)
        try:
            theta = grid(m)
        except LeftOut:
            continue
        if theta is not None:
            return seed, m, theta
    pytest.skip(f"none of {DRAWS} linkages is well conditioned about its assembly angle")


@pytest.mark.parametrize("number", range(FIRST, FIRST + LINKAGES))
def test_no_engine_disagrees_with_the_analytic_model(number: int) -> None:
    seed, m, theta = conditioned(number)
    wrong = []
    for run, verdict, why in outcomes(m, theta):
        assert verdict in ("agrees", "unjudged", "failed", "refused", "disagrees"), verdict
        if verdict in ("failed", "refused", "unjudged"):
            assert why.strip(), f"{run} {verdict} without a sentence"
        if verdict == "disagrees":
            wrong.append(f"{run}: {why}")
    if wrong and (folder := os.environ.get("FUZZ_OUT")):
        head = "".join(
            f"# {line}\n" for line in [f"angles (deg): {' '.join(f'{a:.4f}' for a in np.degrees(theta))}", *wrong]
        )
        Path(folder, f"linkage-{seed}.toml").write_text(head + dumps(m), encoding="utf-8")
    assert not wrong, "\n".join(wrong)
