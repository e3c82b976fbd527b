"""The cross-check: the analytic model and the engines' joint models at the same crank angles, and what differs."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.mechanism import Mechanism
from analytic.paper.clearance import Model
from compare.judge.attribution import attribute
from compare.judge.closer import SOFT, Judged, beyond_rim, settle, stiff_enough
from compare.judge.discrepancy import Discrepancy, Rule, Scales, check_known, judge, known_differences
from compare.judge.flexible import Beams, softened
from compare.judge.grid import turns_fully
from compare.judge.reference import Yardstick, released_yardstick, with_flexible_links, yardstick
from compare.judge.signals import compared, missing, with_derived, with_rotations
from compare.runs import Failure, Resolve, simulate_all
from sim_models.engine import JOINT_MODELS, JointModel, Motion, Request, Trace, Unsupported, engine, installed_version

SCHEMA = 1
Progress = Callable[[str, int, int], None]
Measure = Callable[[Assembly, np.ndarray, Motion, Model, Mapping[str, float]], Yardstick]


@dataclass(frozen=True)
class Job:
    """What to cross-check.  ``theta`` (N,) rad are the crank angles; a released linkage has ``time`` (N,) s instead.

    ``as_it_is`` takes every run as it comes, where others are looked at more closely (:mod:`compare.judge.closer`).
    With ``flexible`` bodies that have a modulus of elasticity bend, in static motion; else all are rigid.
    """

    mechanism: Mechanism
    simulators: tuple[str, ...]
    tolerances: Mapping[str, Any]
    motion: Motion = "driven"
    theta: np.ndarray = field(default_factory=lambda: np.zeros(0))
    time: np.ndarray | None = None
    joint_model: JointModel | None = None
    model: Model = "equilibrium"
    command: str = ""
    warnings: tuple[str, ...] = ()
    workers: int = 1
    flexible: bool = False
    as_it_is: bool = False


def crosscheck(
    job: Job,
    progress: Progress = lambda what, done, total: None,
    resolve: Resolve | None = None,
    measure: Measure = yardstick,
) -> dict[str, Any]:
    """Run a job; the dict is the content of result.json.

    ``resolve`` and ``measure`` are where engines and the analytic side come from; tests plant faults there.  Raises
    SimulatorMissing, Unsupported or AssemblyError; a simulation that fails is listed under ``failures``.
    """
    check_known(job.tolerances, job.mechanism)
    resolve = resolve or (Beams.of if job.flexible else engine)
    assembly = Assembly(job.mechanism)
    tasks = [(name, request) for name in job.simulators for request in _requests(job, assembly, name, resolve)]
    if not tasks:
        raise Unsupported(
            f"{', '.join(job.simulators)}: nothing to run; --joint {job.joint_model} needs a joint with clearance"
            " (--clearance JOINT=m)"
        )
    sides = {
        ideal: _side(job, assembly, ideal, measure)
        for ideal in {request.joint_model == "ideal" for _, request in tasks}
    }
    outcomes: dict[int, Trace | Failure] = {}
    progress(" ".join(job.simulators), 0, len(tasks))
    for i, outcome in simulate_all(tasks, job.workers, resolve):
        outcomes[i] = outcome
        progress(f"{tasks[i][0]} {tasks[i][1].joint_model}", len(outcomes), len(tasks))
    traces = [_whole(outcomes[i], job.mechanism) for i in range(len(tasks))]
    failed = [f for f in traces if isinstance(f, Failure) and not f.unsupported]
    left_out = [f.why for f in traces if isinstance(f, Failure) and f.unsupported]
    if len(left_out) == len(tasks) or (left_out and len(job.simulators) == 1):
        raise Unsupported(left_out[0])

    def judge(t: Trace) -> Judged:
        return Judged(t, *_run(job, sides[t.joint_model == "ideal"], t))

    def simulate_again(requests: Mapping[int, Request]) -> dict[int, Trace | Failure]:
        order = list(requests)
        found = simulate_all([(tasks[i][0], requests[i]) for i in order], job.workers, resolve)
        return {order[k]: _whole(outcome, job.mechanism) for k, outcome in found}

    first = {i: judge(t) for i, t in enumerate(traces) if isinstance(t, Trace)}
    again = dict(enumerate(request for _, request in tasks))
    settled: Mapping[int, Judged | Failure] = (
        first if job.flexible or job.as_it_is else settle(first, again, simulate_again, judge)
    )
    failed += [one for one in settled.values() if isinstance(one, Failure)]
    judged = [(one.run, one.rules) for one in settled.values() if isinstance(one, Judged)]
    runs = [run for run, _ in judged]
    failures = [{"simulator": f.simulator, "joint_model": f.joint_model, "why": f.why} for f in failed]
    result: dict[str, Any] = {
        "schema": SCHEMA,
        "case": job.mechanism.name,
        "verdict": _verdict(runs, failures),
        "command": job.command,
        "versions": _versions(runs),
        "mechanism": job.mechanism.model_dump(by_alias=True, exclude_none=True, exclude_unset=True, mode="json"),
        "warnings": [*job.warnings, *(f"left out: {why}" for why in left_out), *_too_soft(runs)],
        "runs": runs,
        "failures": failures,
    }
    if len({run["simulator"]["name"] for run in runs}) > 1:
        result |= attribute(judged, job.mechanism)
    return result


def _requests(job: Job, assembly: Assembly, simulator: str, resolve: Resolve) -> list[Request]:
    """The runs of one engine: ideal first; a joint model that it lacks is left out unless it was asked for by name."""
    released = job.time is not None
    models = [m for m in JOINT_MODELS if m == "ideal" or (job.mechanism.clearances and not released)]
    if job.joint_model is not None:
        models = [m for m in models if m == job.joint_model]
    if job.joint_model is None or len(job.simulators) > 1:
        supports = resolve(simulator).supports
        models = [m for m in models if (m, job.motion) in supports]
    settle = 2 * np.pi if job.motion == "driven" and not released and turns_fully(assembly) else 0.0
    return [
        Request(job.mechanism, m, job.motion, job.theta, job.time, lead_in=0.0 if m == "ideal" else settle)
        for m in models
    ]


def _side(job: Job, assembly: Assembly, ideal: bool, measure: Measure) -> Yardstick:
    if job.time is not None:
        return released_yardstick(assembly, job.time)
    side = measure(assembly, job.theta, job.motion, job.model, {} if ideal else job.mechanism.clearances)
    return with_flexible_links(side, assembly, job.theta) if job.flexible else side


def _whole(outcome: Trace | Failure, mechanism: Mechanism) -> Trace | Failure:
    """A trace that lacks a signal is a failure."""
    lacks = missing(outcome.signals, mechanism, outcome.clearance) if isinstance(outcome, Trace) else []
    if not isinstance(outcome, Trace) or not lacks:
        return outcome
    return Failure(
        outcome.simulator,
        outcome.joint_model,
        f"{outcome.simulator} {outcome.joint_model}: the simulation reports no {', '.join(lacks)}",
    )


def _run(job: Job, side: Yardstick, trace: Trace) -> tuple[dict[str, Any], dict[str, Rule]]:
    """One entry of ``runs``: both sides, flagged samples blanked on both, and the verdict; and the rules by which it
    was judged.
    """
    simulated = with_derived(trace.signals, job.mechanism)
    if trace.clearance:
        simulated = with_rotations(simulated, side.ideal_angles)
    for values in simulated.values():
        values[list(side.flags)] = np.nan
    theta = trace.crank_angle if job.time is not None else job.theta
    rules = _rules(job, side, trace, simulated)
    found = _discrepancies(job, side, trace, simulated, rules)
    run = {
        "simulator": {"name": trace.simulator, "version": trace.version},
        "joint_model": trace.joint_model,
        "motion": trace.motion,
        "clearance": dict(trace.clearance),
        "analytic_model": job.model,
        "settings": dict(trace.settings),
        "crank_angle": theta,
        "flags": {str(i): why for i, why in sorted(side.flags.items())},
        "analytic": dict(side.signals),
        "simulated": simulated,
        "discrepancies": [_public(d, theta) for d in found],
        "verdict": "disagrees" if any(d.verdict == "disagrees" for d in found) else "agrees" if found else "unjudged",
        "order_difference": dict(side.order_difference),
        "journal": {name: {"x": path[:, 0], "y": path[:, 1]} for name, path in trace.journal.items()},
        "free_share": dict(trace.free_share),
    }
    if trace.time is not None:
        run["time"] = trace.time
    if len(side.flags) == theta.size:
        first, *others = dict.fromkeys(why for _, why in sorted(side.flags.items()))
        run["reason"] = (
            f"the analytic model has no answer at any crank angle: {first}"
            + f", and {len(others)} such reasons more" * bool(others)
        )
    return run, rules


def _verdict(runs: list[dict[str, Any]], failures: list[Any]) -> str:
    """Of the whole result: what is not judged does not agree."""
    verdicts = {run["verdict"] for run in runs}
    if failures or not runs or "disagrees" in verdicts:
        return "disagrees"
    return "unjudged" if "unjudged" in verdicts else "agrees"


def _rules(job: Job, side: Yardstick, trace: Trace, simulated: Mapping[str, np.ndarray]) -> dict[str, Rule]:
    """What each compared signal of a run may differ by."""
    clearances = dict(trace.clearance)
    give, scales = _give(trace.settings, clearances, simulated), Scales.of(side.signals, job.mechanism, side.peaks)
    rules = {}
    for name, kind in compared(job.mechanism, clearances).items():
        joint = name.removeprefix("clearance_")[:-2]
        gap = clearances.get(joint, min(clearances.values(), default=0.0))
        rules[name] = Rule.read(job.tolerances, trace.motion, trace.joint_model, kind, scales, give, gap)
    return softened(rules, side, clearances, job.mechanism) if job.flexible else rules


def _discrepancies(
    job: Job, side: Yardstick, trace: Trace, simulated: Mapping[str, np.ndarray], rules: Mapping[str, Rule]
) -> list[Discrepancy]:
    known = known_differences(
        job.tolerances, job.mechanism.name, trace.simulator, trace.joint_model, trace.motion, job.model
    )
    theta = job.theta if job.time is None else None
    judged = (judge(name, simulated, side.signals, rule, theta, known.get(name)) for name, rule in rules.items())
    return [one for one in judged if one is not None]


def _give(settings: Mapping[str, Any], clearances: Mapping[str, float], simulated: Mapping[str, np.ndarray]) -> float:
    """How far (m) contact of the run's stiffness yields under its peak force."""
    stiffness = settings.get("contact_stiffness")
    if not isinstance(stiffness, int | float) or not clearances:
        return 0.0
    return (
        max(float(np.nanmax(simulated[f"reaction_{name}_magnitude"], initial=0.0)) for name in clearances) / stiffness
    )


def _too_soft(runs: list[dict[str, Any]]) -> Iterator[str]:
    """A warning for each pin whose path was seen to go so far beyond its clearance that this is hidden, whatever its
    contact is made of.
    """
    for run in runs:
        for joint, depth in beyond_rim(run).items():
            clearance = run["clearance"][joint]
            if depth > SOFT * clearance:
                yield (
                    f"{run['simulator']['name']}, {run['joint_model']}: the pin of joint {joint} is seen"
                    f" {1e3 * depth:.2g} mm beyond its rim, {depth / clearance:.1f} times its clearance: too soft to"
                    f" see this clearance; {stiff_enough(run, joint)}"
                )


def _public(d: Discrepancy, theta: np.ndarray) -> dict[str, Any]:
    return {
        "signal": d.signal, "kind": d.kind, "unit": d.unit, "max": d.max, "rms": d.rms,
        "at_crank_angle": float(theta[d.at]) if d.at >= 0 else None, "tolerance": d.tolerance, "verdict": d.verdict,
    } | ({"reason": d.reason} if d.reason else {})  # fmt: skip


def _versions(runs: list[dict[str, Any]]) -> dict[str, str]:
    packages = {name: installed_version(name) or "not installed" for name in ("linkage-crosscheck", "numpy")}
    return {
        "python": platform.python_version(),
        **packages,
        **{run["simulator"]["name"]: run["simulator"]["version"] for run in runs},
    }
