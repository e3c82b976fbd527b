"""Validation runs: never fitted, simulated by the chosen engine with the nominal and with the explained mechanism.

They take part in nothing else: not in the noise, the screening, the verdict or the gap.  Values that an effect has for
each run are those of the fitted runs, and do not apply.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from compare.diagnose import prepare
from compare.diagnose.data.recording import Fault, Measured, MeasuredError, MeasuredRun
from compare.diagnose.engines import Engines
from compare.diagnose.predict import Hypothesis, Model, StartOfRun
from compare.diagnose.problem import Problem, Verified
from compare.diagnose.simulate import Simulated


@dataclass(frozen=True)
class Validated:
    """A validation run with what the chosen engine says of it, and the crank angle (N,) rad over which it is shown."""

    run: MeasuredRun
    before: Simulated
    after: Simulated
    crank_angle: np.ndarray
    encoders: tuple[str, ...]


@dataclass(frozen=True)
class Validation:
    """The validation runs of a diagnosis, and what was wrong with their data beside what was found on reading them."""

    runs: tuple[Validated, ...] = ()
    faults: tuple[Fault, ...] = ()


def parted(measured: Measured) -> tuple[Measured, Measured]:
    """The measurement with the runs that are fitted alone, and with the validation runs alone.  Raises MeasuredError
    where none is fitted.
    """
    fitted, others = (
        replace(measured, runs=tuple(run for run in measured.runs if run.role == role))
        for role in ("fit", "validation")
    )
    if not fitted.runs:
        raise MeasuredError(
            f"{measured.source}: every run has role = 'validation', and nothing is left to fit; leave role out of at"
            " least one"
        )
    return fitted, others


def validated(problem: Problem, found: Verified, others: Measured) -> Validation:
    """The validation runs, each simulated by itself; a free one starts from its given start, a measured one follows its
    encoder.
    """
    explained = [
        (term, values)
        for term, values in found.explanation.fit.values(problem.rig)
        if not isinstance(term.effect, StartOfRun)
    ]
    if not others.runs:
        return Validation()
    courses, thinned = prepare.followed(prepare.thinned(others))
    models = [Model(replace(thinned, runs=(run,)), problem.rig, problem.mechanism, courses) for run in thinned.runs]
    return Validation(
        tuple(_validated(problem, explained, model) for model in models), thinned.faults[len(others.faults) :]
    )


def _validated(problem: Problem, explained: Hypothesis, model: Model) -> Validated:
    starts = prepare.starts(model.measured)
    start = [(t, t.effect.values(problem.rig, t.where, x)) for t, x in starts.items()]
    model = Model(prepare.unturned(model.measured, model, starts), model.rig, model.mechanism, model.courses)
    engines = Engines(model, problem.simulator, 1)
    before, after = (
        engines.simulate(hypothesis, (problem.simulator,))[problem.simulator]
        for hypothesis in (start, [*start, *explained])
    )
    (run,) = model.measured.runs
    return Validated(run, before, after, _crank_angle(model, run, start), problem.rig.encoders)


def _crank_angle(model: Model, run: MeasuredRun, start: Hypothesis) -> np.ndarray:
    """The motor's angle (N,) rad; in a free run the driven body's, or where it starts if the analytic model has no
    answer.
    """
    if run.drive != "free":
        return np.atleast_2d(model.motor(run, model.mechanism).at(run.time).theta)[0]
    moved = model.released(run, [start])[0]
    return np.full(run.time.size, model.starts(run, start)[0][0]) if moved is None else moved[model.rig.encoder]
