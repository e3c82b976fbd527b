"""Numerical uncertainties of engines' runs, held against the truth.

That is the run in steps a sixteenth as long, but where rounding has overtaken it: forces come from differences of
velocities over a step, so that their rounding grows as 1/h or 1/h^2.  It has where that run is farther from the one in
steps twice as long than that one is from the next.  There the analytic solution, which has no steps, is the truth for
ideal joints that do not give, and else the run in steps an eighth as long, if it is no farther from the one before than
the first two runs are from each other; where it is, nothing better is known, and the shortest steps stay.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, shipped_cases
from analytic.mechanism.signals import Signal, named
from compare.baseline.runs import not_run, setups
from compare.judge.numerical import COVERAGE, PARTS, ROUNDING, convergence
from compare.judge.reference import reference
from compare.judge.signals import with_derived
from compare.results.crosscheck import Numerical
from sim_models.engine import Request, SimulationError, Trace, declared, engine
from tests.evidence.results.trust import Stepped, Truth
from tests.evidence.validation.workspaces import digits

SHORTER = (*PARTS, 8, 16)  # parts of a step
RIGID = ("exudyn", "pybullet", "dart")  # whose ideal joints do not give, so that steps alone part them from the exact
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
    assert first.step is not None
    return row(name, case, request, [first, *(run(replace(request, step=first.step / n)) for n in SHORTER)])


@dataclass(frozen=True)
class Held:
    """A signal's numerical uncertainty, its errors in each step but the shortest (SI), that against the shortest steps,
    its peak, and what the truth is.
    """

    told: Numerical
    errors: tuple[float, ...]
    shortest: float
    peak: float
    truth: Truth

    def within(self, error: float) -> bool:
        """Whether an error (SI) is 2 u_num at most."""
        return error <= COVERAGE * self.told.u_num


def row(name: str, case: str, request: Request, traces: Sequence[Trace]) -> Stepped:
    """A run in its own steps and each of the shorter ones, held against the truth."""
    m, first = request.mechanism, traces[0]
    assert first.step is not None
    known = named(m.bodies, m.joints, m.drives)
    values = [with_derived(dict(trace.signals), m) for trace in traces]
    steps = max(float(np.ptp(first.time) / first.step), 1.0) if first.time is not None else 1.0
    exact = _exact(request) if request.joint_model == "ideal" and name in RIGID else {}
    both = [s for s in values[0] if s in known and all(s in each for each in values)]
    held = {s: against(known[s], [each[s] for each in values], exact.get(s), steps) for s in both}
    ordered = [one for one in held.values() if one.told.order is not None]
    return Stepped(
        simulator=name,
        joint_model=request.joint_model,
        case=case,
        step=first.step,
        signals=len(held),
        within=sum(one.within(one.errors[0]) for one in held.values()),
        within_shortest=sum(one.within(one.shortest) for one in held.values()),
        ordered=len(ordered),
        ordered_within=sum(one.within(one.errors[0]) for one in ordered),
        truth=dict(Counter(one.truth for one in held.values())),
        missed=sum(not one.within(one.errors[0]) for one in held.values() if one.truth != "doubt"),
        orders=_orders(m, {s: one.told for s, one in held.items()}),
        worst=max((one.errors[0] / (COVERAGE * one.told.u_num) for one in ordered), default=0.0),
        excess=(_excess(ordered), _excess(one for one in held.values() if one.told.order is None)),
        errors=_errors(m, held),
    )


def _excess(some: Iterable[Held]) -> tuple[float, ...]:
    """How many times as large as its error each one's 2 u_num is."""
    return tuple(digits(COVERAGE * one.told.u_num / one.errors[0]) for one in some if one.errors[0])


def _exact(request: Request) -> dict[str, np.ndarray]:
    """The analytic solution at a run's samples."""
    side = reference(Assembly(request.mechanism), request.schedule, "equilibrium", {})
    return with_derived(dict(side.signals), request.mechanism)


def against(signal: Signal, values: Sequence[np.ndarray], exact: np.ndarray | None, steps: float) -> Held:
    """A signal (N,) in a run's own steps and each of the shorter ones, with its ``exact`` values (N,) where the engine
    has no others in the limit; a run has so many ``steps``.
    """

    def apart(one: np.ndarray, other: np.ndarray) -> float:
        return float(np.nanmax(np.abs(signal.apart(one, other)), initial=0.0))

    peak = float(np.nanmax(np.abs(values[-1]), initial=0.0))
    first, eighth, last = (apart(values[k], values[k + 1]) for k in (0, -3, -2))
    truth: Truth = "sixteenth" if last <= min(eighth, first) else "eighth" if eighth <= first else "doubt"
    truth = truth if truth == "sixteenth" or exact is None else "analytic"
    true = exact if exact is not None and truth == "analytic" else values[-2 if truth == "eighth" else -1]
    added = ROUNDING * SHORTER[-1] * steps * peak  # to which the shortest steps are known themselves
    errors = [max(apart(each, true) - added * (truth != "analytic"), 0.0) for each in values[:-1]]
    shortest = max(apart(values[0], values[-1]) - added, 0.0)
    return Held(convergence(signal, values[: len(PARTS) + 1], steps), tuple(errors), shortest, peak, truth)


def _errors(m: Mechanism, held: Mapping[str, Held]) -> dict[str, tuple[float | None, ...]]:
    """Median errors by kind of signal, over the largest of that unit, of those that have an order."""
    known = named(m.bodies, m.joints, m.drives)
    largest: dict[str, float] = {}  # by unit: what is nothing in theory has no peak of its own
    for s, one in held.items():
        largest[known[s].unit] = max(largest.get(known[s].unit, 0.0), one.peak)
    found: dict[str, list[np.ndarray]] = {}
    for s, one in held.items():
        kind = KINDS.get(known[s].kind)
        if kind is not None and one.told.order is not None:
            found.setdefault(kind, []).append(np.array(one.errors) / largest[known[s].unit])
    return {kind: tuple(map(digits, np.median(each, axis=0))) for kind, each in found.items()}


def _orders(m: Mechanism, told: Mapping[str, Numerical]) -> dict[str, float | None]:
    """Median order by kind of signal, of those that have one."""
    known = named(m.bodies, m.joints, m.drives)
    found: dict[str, list[float]] = {}
    for s, numerical in told.items():
        kind = KINDS.get(known[s].kind)
        if kind is not None and numerical.order is not None:
            found.setdefault(kind, []).append(numerical.order)
    return {kind: median(each) for kind, each in found.items()}
