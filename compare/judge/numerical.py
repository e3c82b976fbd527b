"""How far a run is off by the length of its steps: the grid convergence index of steps, half steps and quarter steps.

Roache, Verification and Validation in Computational Science and Engineering (1998), ch. 5; Celik et al., J. Fluids Eng.
130 (2008) 078001.  With values f3, f2, f1 at the samples of a run in steps h, h/2 and h/4, r = 2:

    p = ln(|f3 - f2| / |f2 - f1|) / ln r            observed order; root mean square over the samples
    U = Fs max|f3 - f2| r^p / (r^p - 1)             of the run in steps h, no less than Fs max|f3 - f1|
    u_num = U / 2                                   a standard uncertainty, as U is meant to hold 95 %

Fs = 1.25 where the order is that of a method within a tenth, 0.9 <= p, else 3 (Oberkampf and Roy, Verification and
Validation in Scientific Computing, 2010, 8.7); p counts as 2 where it is more, which lengthens U.  Where p is below
0.5, or quarter steps have no result, differences are no series, and U = 3 max(|f3 - f2|, |f2 - f1|, |f3 - f1|), three
times the data's range (Eca and Hoekstra, Computers & Fluids 38 (2009) 1580).  So it is where rounding is all that is
left, which forces, as differences over a step, have more of in shorter steps: U then bounds that of the shortest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal, named
from compare.judge.reruns import JudgedRun
from compare.quantities import number, shown
from compare.results.crosscheck import Discrepancy, Failure, Numerical, Run
from sim_models.engine import Request, Trace

PARTS = (2, 4)  # of the run's own step
ORDERED, UNORDERED = 1.25, 3.0  # safety factors
ASYMPTOTIC = 0.9  # of the lowest order that a method has, 1
LEAST_ORDER, MOST_ORDER = 0.5, 2.0  # below, differences do not fall as those of a method; above, counted as this
ROUNDING = float(np.finfo(float).eps)  # of a signal's largest value in each step, which add up
COVERAGE = 2.0  # standard uncertainties, of which 95 % are said to lie within


def convergence(signal: Signal, each: Sequence[np.ndarray], steps: float = 1.0) -> Numerical:
    """What the values (N,) SI of a signal in a run of so many ``steps``, in half the step and, if there, in quarter
    steps say of it.
    """
    apart = [signal.apart(a, b) for a, b in zip(each, [*each[1:], each[0]], strict=True)]
    size = [float(np.nanmax(np.abs(d), initial=0.0)) for d in apart]
    least = ROUNDING * steps * float(np.nanmax(np.abs(each[0]), initial=0.0))
    order = None
    if len(each) > 2 and min(size[:2]) > least:
        falls = [float(np.sqrt(np.nanmean(d**2))) for d in apart[:2]]
        order = math.log2(falls[0] / falls[1])
        order = order if order >= LEAST_ORDER else None
    if order is None:
        expanded = UNORDERED * max(size)
    else:
        grown = 2 ** min(order, MOST_ORDER)
        safety = ORDERED if order >= ASYMPTOTIC else UNORDERED
        expanded = safety * max(size[0] * grown / (grown - 1), size[2])
    return Numerical(unit=signal.unit, u_num=max(expanded, least) / COVERAGE, order=order)


def numerical(mechanism: Mechanism, runs: Sequence[Run]) -> dict[str, Numerical]:
    """The numerical uncertainty of each signal of a run, from it and runs in half and in quarter steps."""
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives)
    sides = [run.comparable for run in runs]
    steps = float(np.ptp(time) / step) if (time := runs[0].time) is not None and (step := _step(runs[0])) else 1.0
    names = [s for s in sides[0] if s in known and all(s in each for each in sides)]
    return {
        name: convergence(known[name], [each[name] for each in sides], max(steps, 1.0))
        for name in names
        if all(np.isfinite(each[name]).any() for each in sides)
    }


def _step(run: Run) -> float:
    step = run.settings.get("step")
    return float(step) if isinstance(step, int | float) else 0.0


def verified(
    mechanism: Mechanism,
    settled: Mapping[int, JudgedRun | Failure],
    requests: Mapping[int, Request],
    simulate: Callable[[Mapping[int, Request]], Mapping[int, Trace | Failure]],
    judge: Callable[[Trace], JudgedRun],
) -> dict[int, JudgedRun | Failure]:
    """The runs, each with its numerical uncertainty where it has steps, and judged by it."""
    stepping = {
        i: one.trace.step
        for i, one in settled.items()
        if isinstance(one, JudgedRun) and one.trace.step and one.run.motion == "driven"
    }
    finer: dict[int, list[Run]] = {i: [] for i in stepping}
    for part in PARTS:
        again = {
            i: replace(requests[i], step=step / part, watched=False, beyond=0.0)
            for i, step in stepping.items()
            if len(finer[i]) == PARTS.index(part)
        }
        for i, trace in (simulate(again) if again else {}).items():
            if isinstance(trace, Trace):
                finer[i].append(judge(trace).run)
    ended = dict(settled)
    for i, runs in finer.items():
        one = ended[i]
        if runs and isinstance(one, JudgedRun):
            ended[i] = replace(one, run=_judged_by(one.run, numerical(mechanism, [one.run, *runs])))
    return ended


def _judged_by(run: Run, found: Mapping[str, Numerical]) -> Run:
    """A run whose differences are not judged where steps alone may make them."""
    judged = tuple(_own(d, found.get(d.signal)) for d in run.discrepancies)
    left = {d.verdict for d in judged}
    verdict = run.verdict
    if verdict == "disagrees" and "disagrees" not in left:
        verdict = "unjudged"
    return run.model_copy(update={"numerical": dict(found), "discrepancies": judged, "verdict": verdict})


def _own(d: Discrepancy, by: Numerical | None) -> Discrepancy:
    if by is None or d.verdict != "disagrees" or d.reason or d.max is None or abs(d.max) > COVERAGE * by.u_num:
        return d
    unit, factor = shown(by.unit)
    why = f"it is within 2 u_num = {number(factor * COVERAGE * by.u_num)} {unit}, which the engine's own steps may make"
    return d.model_copy(update={"verdict": "unjudged", "reason": why})
