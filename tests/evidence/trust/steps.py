"""Numerical uncertainties of engines' runs, held against runs in steps a sixteenth as long."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from statistics import median

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, shipped_cases
from analytic.mechanism.signals import named
from compare.baseline.runs import not_run, setups
from compare.judge.numerical import COVERAGE, PARTS, ROUNDING, convergence
from compare.judge.signals import with_derived
from compare.results.crosscheck import Numerical
from sim_models.engine import Request, SimulationError, declared, engine
from tests.evidence.results.trust import Stepped

SHORTEST = 16  # parts of a step
KINDS = {"pose": "position", "clearance": "position", "rate": "velocity", "reaction": "force", "drive": "force"}
SAMPLES = 24  # of a run, evenly taken


def requests(case: str) -> Iterator[Request]:
    """Each driven run of a shipped case as the baselines set it up, its contacts driven too, at a few samples."""
    for setup in setups(load(case)):
        if not setup.impacting and setup.request.motion == "driven":
            yield setup.request


def stepped(names: tuple[str, ...], cases: tuple[str, ...] = ()) -> Iterator[Stepped]:
    """Every driven run of these engines; one that fails in shorter steps is left out."""
    for case in cases or shipped_cases():
        for request in requests(case):
            for name in names:
                if not not_run(name, declared(name), request):
                    try:
                        yield _stepped(name, case, request)
                    except SimulationError:
                        continue


def _stepped(name: str, case: str, request: Request) -> Stepped:
    run = engine(name).simulate
    first = run(request)
    step = first.step
    assert step is not None
    every = [first, *(run(replace(request, step=step / part)) for part in (*PARTS, SHORTEST))]
    values = [with_derived(dict(trace.signals), request.mechanism) for trace in every]
    known = named(request.mechanism.bodies, request.mechanism.joints, request.mechanism.drives)
    steps = float(np.ptp(first.time) / step) if first.time is not None else 1.0
    told: dict[str, Numerical] = {}
    shares: dict[str, float] = {}
    for s in (s for s in values[0] if s in known and all(s in each for each in values)):
        told[s] = convergence(known[s], [each[s] for each in values[:3]], max(steps, 1.0))
        error = float(np.nanmax(np.abs(known[s].apart(values[0][s], values[3][s])), initial=0.0))
        exact = ROUNDING * SHORTEST * steps * float(np.nanmax(np.abs(values[3][s]), initial=0.0))
        shares[s] = max(error - exact, 0.0) / (COVERAGE * told[s].u_num) if told[s].u_num else 0.0
    ordered = [s for s in shares if told[s].order is not None]
    return Stepped(
        simulator=name,
        joint_model=request.joint_model,
        case=case,
        step=step,
        signals=len(told),
        within=sum(share <= 1 for share in shares.values()),
        ordered=len(ordered),
        ordered_within=sum(shares[s] <= 1 for s in ordered),
        orders=_orders(request.mechanism, told),
        worst=max((shares[s] for s in ordered), default=0.0),
    )


def _orders(m: Mechanism, told: Mapping[str, Numerical]) -> dict[str, float | None]:
    """Median order by kind of signal, of those that have one."""
    known = named(m.bodies, m.joints, m.drives)
    found: dict[str, list[float]] = {}
    for s, numerical in told.items():
        kind = KINDS.get(known[s].kind)
        if kind is not None and numerical.order is not None:
            found.setdefault(kind, []).append(numerical.order)
    return {kind: median(each) for kind, each in found.items()}
