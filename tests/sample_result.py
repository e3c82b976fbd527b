"""A result as a cross-check writes it: the analytic side computed, the simulated side with plausible, known errors."""

from __future__ import annotations

import math
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from compare.judge.signals import compared, with_derived
from compare.judge.statistics import compared_statistics
from compare.judge.tolerances import load_tolerances
from compare.results.crosscheck import CrossCheck
from test_contact_statistics import BOUNCES, CLEARANCE, bouncing, prescribed, springs, told

ERROR = {"ideal": 1e-7, "massless-link": 2e-6, "spring-damper": 3e-5, "contact": 4e-4}  # of a signal's peak
DELIVERED = {"rad": 2e-3, "N": 0.1, "m": 2e-5, "N.m": 0.02}  # tolerances


def sample_result(
    case: str = "paper",
    clearance: dict[str, float] | None = None,
    engines: tuple[str, ...] = ("mujoco",),
    wrong: str = "",
) -> dict[str, Any]:
    """A result of a shipped case; the signal ``wrong`` of the contact runs is 0.01 (SI) off and so disagrees."""
    return deepcopy(_made(case, None if clearance is None else tuple(clearance.items()), engines, wrong))


@cache
def _made(
    case: str, clearance: tuple[tuple[str, float], ...] | None, engines: tuple[str, ...], wrong: str
) -> dict[str, Any]:
    mechanism = load(case)
    assembly = Assembly(mechanism)
    theta = np.radians(np.arange(20.0, 161.0, 5.0) if case == "paper" else np.arange(0.0, 356.0, 5.0))
    sizes = mechanism.clearances if clearance is None else dict(clearance)
    omega = mechanism.speed or 1.0
    runs = []
    for level, engine in enumerate(engines):
        for joint_model, error in ERROR.items():
            loose = {} if joint_model == "ideal" else sizes
            answers = {
                m: displaced(assembly, theta, omega, model=m, clearances=loose) for m in ("first_order", "equilibrium")
            }
            signals = {m: with_derived(a.signals(), mechanism) for m, a in answers.items()}
            rng = np.random.default_rng(level + 1)
            analytic = signals["equilibrium"]
            simulated = {name: _disturbed(v, error * (1 + level), theta, rng) for name, v in analytic.items()}
            if joint_model == "contact" and wrong:
                simulated[wrong] = simulated[wrong] + 0.01 * np.sin(theta) ** 2
            judged = compared(mechanism.with_clearances(loose), loose)
            rows = [_discrepancy(s.name, s.unit, simulated[s.name] - analytic[s.name], theta) for s in judged]
            runs.append(
                {
                    "simulator": {"name": engine, "version": "4.0.0"},
                    "joint_model": joint_model,
                    "motion": "driven",
                    "clearance": dict(loose),
                    "analytic_model": "equilibrium",
                    "settings": {
                        "step": 1e-4,
                        "contact_stiffness": 1e8,
                        "contact_damping": 500.0,
                        "contact_law": "Kelvin-Voigt",
                    },
                    "crank_angle": theta.tolist(),
                    "time": ((theta - theta[0]) / omega).tolist(),
                    "flags": {str(i): why for i, why in answers["equilibrium"].flags.items()},
                    "analytic": {name: _listed(v) for name, v in analytic.items()},
                    "simulated": {name: _listed(v) for name, v in simulated.items()},
                    "discrepancies": rows,
                    "verdict": "disagrees" if any(r["verdict"] == "disagrees" for r in rows) else "agrees",
                    "journal": {j: _journal(analytic, j, c, joint_model) for j, c in loose.items()},
                    "free_share": dict.fromkeys(loose, 0.02 if joint_model == "contact" else 0.0),
                    "order_difference": {
                        s.name: _difference(
                            s.unit, signals["first_order"][s.name] - signals["equilibrium"][s.name], theta
                        )
                        for s in judged
                    },
                }
            )
    return {
        "schema": 1,
        "case": case,
        "verdict": "disagrees" if any(r["verdict"] == "disagrees" for r in runs) else "agrees",
        "runs": runs,
        **(between(engines, float(theta[3])) if len(engines) > 1 else {}),
        "failures": [],
        "command": f"compare --simulator {'all' if len(engines) > 1 else engines[0]} --case {case}",
        "versions": {"linkage-crosscheck": "0.1.0", "numpy": "2.4.0", "mujoco": "4.0.0"},
        "mechanism": mechanism.model_dump(by_alias=True, exclude_none=True, mode="json"),
        "warnings": [],
    }


def between(engines: tuple[str, ...], at: float) -> dict[str, Any]:
    """What only several engines say."""
    wide = {"max": 1e-4, "at_crank_angle": at, "between": list(engines[:2]), "joint_model": "ideal"}
    return {
        "spread": {"drive_torque": wide},
        "odd_one_out": engines[-1],
        "words": f"{engines[-1]} stands apart",
    }


def as_document(content: dict[str, Any]) -> CrossCheck:
    """The document of such a result."""
    return CrossCheck.model_validate(content)


def write_report(content: dict[str, Any], folder: Path) -> list[Path]:
    """Write such a result and its report; the files."""
    document = as_document(content)
    place = document.write(folder)
    return [place / name for name in document.files()]


def swinging() -> dict[str, Any]:
    """A free drive: the pendulum that ships, compared over time; its crank angle comes back to where it was."""
    mechanism = load("pendulum")
    time = np.linspace(0.0, 2.0, 101)
    analytic = with_derived(released(Assembly(mechanism), time).reactions.signals(), mechanism)
    rng = np.random.default_rng(3)
    simulated = {name: _disturbed(v, 1e-3, 6 * time, rng) for name, v in analytic.items()}
    theta = simulated["pendulum_angle"]
    rows = [_discrepancy(s.name, s.unit, simulated[s.name] - analytic[s.name], theta) for s in compared(mechanism, {})]
    result = sample_result()
    ideal = result["runs"][0] | {
        "crank_angle": theta.tolist(),
        "time": time.tolist(),
        "flags": {},
        "analytic": {name: _listed(v) for name, v in analytic.items()},
        "simulated": {name: _listed(v) for name, v in simulated.items()},
        "discrepancies": rows,
        "verdict": "disagrees" if any(r["verdict"] == "disagrees" for r in rows) else "agrees",
        "order_difference": {},
    }
    fields = {
        "case": "pendulum",
        "mechanism": mechanism.model_dump(by_alias=True, exclude_none=True, exclude_unset=True, mode="json"),
    }
    return result | fields | {"verdict": ideal["verdict"], "runs": [ideal]}


@cache
def _pressed() -> CrossCheck:
    """The same without what contact did."""
    content = sample_result("crank-rocker", {"B": CLEARANCE}, ("mujoco", "exudyn"))
    for run in content["runs"]:
        run["simulated"] = {name: _filled(values) for name, values in run["simulated"].items()}
    return as_document(content)


def rattling(louder: float = 1.0, turns: tuple[int, int] = (24, 24)) -> CrossCheck:
    """Two engines whose contact runs have a pin that goes from wall to wall in B, pressed as chance has it; the second
    ``louder``, each over some ``turns``.  Where the analytic model has no answer they have values all the same.
    """
    document = _pressed()
    runs = list(document.runs)
    for seed, (loud, n) in enumerate(zip((1.0, louder), turns, strict=True)):
        heights = loud * np.random.default_rng(seed).uniform(1.0, 1.2, 1 + BOUNCES * max(turns))

        def pressed(phase: np.ndarray, heights: np.ndarray = heights) -> np.ndarray:
            return heights[(phase * BOUNCES / math.tau).astype(int)] * springs(phase)

        k = next(i for i, r in enumerate(runs) if r.joint_model == "contact" and r.contact is None)
        runs[k] = runs[k].model_copy(update={"contact": told(prescribed(n, bouncing, pressed, 1500 * n))})
    held = compared_statistics(runs, load_tolerances())
    wrong = any(one.verdict == "disagrees" for one in held)
    verdict = "disagrees" if wrong else document.verdict
    return document.model_copy(update={"runs": tuple(runs), "statistics": held, "verdict": verdict})


def _disturbed(values: np.ndarray, error: float, theta: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    ripple = np.sin(7 * theta + rng.uniform(0, math.tau)) * (1 + 0.3 * rng.standard_normal(theta.size))
    return values + error * np.nanmax(np.abs(values)) * ripple if np.isfinite(values).any() else values


def _difference(unit: str, gap: np.ndarray, theta: np.ndarray) -> dict[str, Any]:
    if not np.isfinite(gap).any():
        return {"unit": unit, "max": None, "rms": None, "at_crank_angle": None}
    k = int(np.nanargmax(np.abs(gap)))
    return {
        "unit": unit,
        "max": float(gap[k]),
        "rms": float(np.sqrt(np.nanmean(gap**2))),
        "at_crank_angle": float(theta[k]),
    }


def _discrepancy(signal: str, unit: str, gap: np.ndarray, theta: np.ndarray) -> dict[str, Any]:
    found = _difference(unit, gap, theta)
    tolerance = DELIVERED[unit]
    kind = "angle" if unit == "rad" else "magnitude" if signal.endswith("_magnitude") else "value"
    within = found["max"] is None or abs(found["max"]) <= tolerance
    return {
        "signal": signal,
        "kind": kind,
        **found,
        "tolerance": tolerance,
        "verdict": "agrees" if within else "disagrees",
    }


def _filled(values: list[float | None]) -> list[float]:
    known = [k for k, v in enumerate(values) if v is not None]
    return list(np.interp(np.arange(len(values)), known, [v for v in values if v is not None]))


def _listed(values: np.ndarray) -> list[float | None]:
    return [float(v) if math.isfinite(v) else None for v in values]


def _journal(analytic: dict[str, np.ndarray], joint: str, radius: float, joint_model: str) -> dict[str, list[float]]:
    """From the centre to the rim and along it, with a decaying bounce that depends on the joint model."""
    x, y = analytic[f"clearance_{joint}_x"], analytic[f"clearance_{joint}_y"]
    known = np.isfinite(x)
    s = np.linspace(0.0, 1.0, 4000)
    direction = np.interp(s, np.linspace(0, 1, int(known.sum())), np.unwrap(np.arctan2(y[known], x[known])))
    bounce = {"massless-link": 0.0, "spring-damper": 0.15, "contact": 0.35}[joint_model]
    size = radius * (1 - np.exp(-s / 0.005)) * (1 - bounce * np.abs(np.sin(60 * s)) * np.exp(-s / 0.06))
    return {"x": _listed(size * np.cos(direction)), "y": _listed(size * np.sin(direction))}
