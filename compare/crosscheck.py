"""The cross-check: the analytic model and the engines' joint models at the same crank angles, and what differs."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from analytic.assembly import Assembly
from analytic.clearance import Displaced, Model, displaced
from analytic.mechanism import Mechanism
from analytic.released import released
from compare.discrepancy import Discrepancy, difference, judge
from compare.grid import turns_fully
from compare.signals import UNITS, compared, with_derived, with_rotations
from sim_models.engine import JOINT_MODELS, JointModel, Motion, Request, SimulationError, Trace, Unsupported, engine, installed_version

SCHEMA = 1
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Job:
    """What to cross-check.  ``theta`` (N,) rad are the crank angles; a released linkage has ``time`` (N,) s instead."""

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


@dataclass(frozen=True)
class Yardstick:
    """The analytic side at a run's samples: derived signals, the first order's, and flagged samples."""

    signals: Mapping[str, np.ndarray]
    order_difference: Mapping[str, Any]
    flags: Mapping[int, str]
    theta: np.ndarray


def crosscheck(job: Job, progress: Progress = lambda what, done, total: None) -> dict[str, Any]:
    """Run a job; the dict is the content of result.json (docs/contract of the files: compare/schemas/result.json).

    Raises SimulationError, SimulatorMissing, Unsupported or AssemblyError.
    """
    assembly = Assembly(job.mechanism)
    engines = [engine(name) for name in job.simulators]
    requests = [(chosen.name, request) for chosen in engines for request in _requests(job, assembly, chosen.supports)]
    if not requests:
        raise Unsupported(
            f"{', '.join(job.simulators)}: nothing to run; --joint {job.joint_model} needs a joint with clearance (--clearance JOINT=m)"
        )
    runs = []
    yardsticks: dict[tuple[bool, str], Yardstick] = {}
    for i, (name, request) in enumerate(requests):
        progress(f"{name} {request.joint_model}", i, len(requests))
        key = (request.joint_model == "ideal", request.motion)
        if key not in yardsticks:
            yardsticks[key] = _yardstick(job, assembly, ideal=key[0])
        runs.append(_run(job, yardsticks[key], engine(name).simulate(request)))
    progress("report", len(requests), len(requests))
    return {
        "schema": SCHEMA,
        "case": job.mechanism.name,
        "verdict": "agrees" if all(run["verdict"] == "agrees" for run in runs) else "disagrees",
        "command": job.command,
        "versions": _versions(runs),
        "mechanism": job.mechanism.model_dump(by_alias=True, exclude_none=True, exclude_unset=True, mode="json"),
        "warnings": list(job.warnings),
        "runs": runs,
    }


def _requests(job: Job, assembly: Assembly, supports: frozenset[tuple[JointModel, Motion]]) -> list[Request]:
    """The runs of one engine: ideal first; a joint model that it lacks is left out unless asked for by name."""
    clearances = job.mechanism.clearances
    released_drive = job.time is not None
    models = [m for m in JOINT_MODELS if (clearances and not released_drive) or m == "ideal"]
    if job.joint_model is None:
        models = [m for m in models if (m, job.motion) in supports]
    else:  # asked for by name: an engine that lacks it says so itself
        models = [m for m in models if m == job.joint_model]
    lead_in = 2 * np.pi if not released_drive and turns_fully(assembly) else 0.0
    return [
        Request(job.mechanism, model, job.motion, job.theta, job.time, lead_in=0.0 if model == "ideal" or job.motion == "static" else lead_in)
        for model in models
    ]


def _yardstick(job: Job, assembly: Assembly, ideal: bool) -> Yardstick:
    mechanism = job.mechanism
    if job.time is not None:
        free = released(assembly, job.time)
        return Yardstick(with_derived(free.signals(), mechanism), {}, {}, free.motion.theta)
    speed = mechanism.speed or 1.0
    inertia = job.motion == "driven"
    clearances: dict[str, float] = {} if ideal else mechanism.clearances

    def side(model: Model) -> tuple[Displaced, dict[str, np.ndarray]]:
        found = displaced(assembly, job.theta, speed, model=model, inertia=inertia, clearances=clearances)
        return found, with_derived(found.signals(), mechanism)

    found, signals = side(job.model)
    order: dict[str, Any] = {}
    if not ideal:
        _, first = side("first_order")
        _, full = side("equilibrium")
        for name, kind in compared(mechanism, clearances).items():
            apart = difference(first[name], full[name], kind in ("angle", "rotation", "position"))
            if apart is not None:
                order[name] = {"unit": UNITS[kind], "max": apart.max, "rms": apart.rms, "at_crank_angle": float(job.theta[apart.at])}
    return Yardstick(signals, order, found.flags, job.theta)


def _run(job: Job, yardstick: Yardstick, trace: Trace) -> dict[str, Any]:
    """One entry of ``runs``: both sides, flagged samples blanked on both, and the verdict."""
    mechanism = job.mechanism
    clearances = dict(trace.clearance)
    simulated = with_derived(trace.signals, mechanism)
    if clearances:
        ideal = {b.name: yardstick.signals[f"{b.name}_angle"] - yardstick.signals[f"{b.name}_rotation"] for b in mechanism.bodies}
        simulated = with_rotations(simulated, ideal)
    flagged = list(yardstick.flags)
    for values in simulated.values():
        values[flagged] = np.nan
    kinds = compared(mechanism, clearances)
    rules = job.tolerances[trace.motion][trace.joint_model]
    give = _give(trace, simulated, clearances)
    found = []
    for name, kind in kinds.items():
        joint = name.removeprefix("clearance_")[:-2]
        size = clearances.get(joint, max(clearances.values(), default=0.0))
        one = judge(name, kind, simulated, yardstick.signals, rules[kind], float(job.tolerances["floor"]), give, size)
        if one is not None:
            found.append(one)
    theta = trace.crank_angle if job.time is not None else job.theta
    run = {
        "simulator": {"name": trace.simulator, "version": trace.version},
        "joint_model": trace.joint_model,
        "motion": trace.motion,
        "clearance": clearances,
        "analytic_model": job.model,
        "settings": dict(trace.settings),
        "crank_angle": theta,
        "flags": {str(i): why for i, why in sorted(yardstick.flags.items())},
        "analytic": dict(yardstick.signals),
        "simulated": simulated,
        "discrepancies": [_public(d, theta) for d in found],
        "verdict": "disagrees" if any(d.verdict == "disagrees" for d in found) else "agrees",
        "order_difference": dict(yardstick.order_difference) if clearances else {},
        "journal": {name: {"x": path[:, 0], "y": path[:, 1]} for name, path in trace.journal.items()},
        "free_share": dict(trace.free_share),
    }
    if trace.time is not None:
        run["time"] = trace.time
    return run


def _give(trace: Trace, simulated: Mapping[str, np.ndarray], clearances: Mapping[str, float]) -> float:
    """How far (m) contact of the run's stiffness yields under its peak force."""
    stiffness = trace.settings.get("contact_stiffness")
    if not isinstance(stiffness, int | float) or not clearances:
        return 0.0
    return max(float(np.nanmax(simulated[f"reaction_{name}_magnitude"])) for name in clearances) / stiffness


def _public(d: Discrepancy, theta: np.ndarray) -> dict[str, Any]:
    return {
        "signal": d.signal, "kind": d.kind, "unit": d.unit, "max": d.max, "rms": d.rms,
        "at_crank_angle": float(theta[d.at]), "tolerance": d.tolerance, "verdict": d.verdict,
    }  # fmt: skip


def _versions(runs: list[dict[str, Any]]) -> dict[str, str]:
    packages = {name: installed_version(name) or "not installed" for name in ("linkage-crosscheck", "numpy")}
    return {"python": platform.python_version(), **packages, **{run["simulator"]["name"]: run["simulator"]["version"] for run in runs}}


__all__ = ["Job", "SimulationError", "crosscheck"]
