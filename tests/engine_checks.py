"""What the conformance table asks of every engine: rows by what engines declare, runs, and errors against the analytic
model and against an ordinary differential equation.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

import linkage_crosscheck as lc
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from analytic.paper.kinetostatics import kinetostatics
from asked import request_of
from compare.results.crosscheck import Run
from engines_here import missing
from sim_models.common.free_share import free_share
from sim_models.engine import (
    ENGINES,
    JOINT_MODELS,
    Engine,
    Feature,
    JointModel,
    Motion,
    Trace,
    declared,
    engine,
)
from tests.evidence.contact_ode import FIRST, SECOND, centred, loop_of, simulate

LOOSE: tuple[JointModel, ...] = JOINT_MODELS[1:]  # joint models whose pins have clearance
ROOMY: dict[str, JointModel] = {  # of each engine, one of them that moves and has a contact law
    "mujoco": "contact",
    "exudyn": "contact",
    "pybullet": "spring-damper",
    "dart": "contact",
}
PAPER_RANGE = np.arange(20.0, 161.0, 20.0)  # deg
Signals = Mapping[str, np.ndarray]


def declared_runs(
    motion: Motion, models: Iterable[JointModel] = JOINT_MODELS, feature: Feature | None = None
) -> list[tuple[str, JointModel]]:
    """Engines and joint models that declare this motion, with this feature."""
    found: list[tuple[str, JointModel]] = []
    for name in ENGINES:
        scope = declared(name).capabilities.rigid
        for model in models:
            pair = (model, motion)
            if pair in scope.runs if feature is None else (feature, pair) in scope.features:
                found.append((name, model))
    return found


CALM: list[tuple[str, JointModel, Motion]] = [
    (name, model, motion)
    for motion in ("driven", "static")
    for name, model in declared_runs(motion)
    if motion == "static" or model == "ideal"
]  # pins in motion may lift off


def agreed(
    name: str,
    mechanism: Mechanism,
    joint_model: JointModel,
    motion: Motion,
    clearance: Mapping[str, float],
    angles: object,
) -> Run:
    """The run of an engine, asserted to agree with the analytic model; ``clearance`` (m) is not of ideal joints."""
    if missing(name):
        pytest.skip(missing(name))
    loose = {} if joint_model == "ideal" else clearance
    result = lc.crosscheck(
        mechanism, simulator=name, joint_model=joint_model, motion=motion, clearance=loose, angles=angles
    )
    (run,) = result.runs
    assert run.verdict == "agrees", [(d.signal, d.max, d.tolerance) for d in run.discrepancies if d.verdict != "agrees"]
    return run


def run(
    name: str, mechanism: Mechanism, joint_model: JointModel, motion: Motion, degrees: object, **options: object
) -> Trace:
    return engine(name).simulate(request_of(mechanism, joint_model, motion, np.radians(degrees), **options))


def at_speed(m: Mechanism, speed: float | str, **drive: object) -> Mechanism:
    """The mechanism with its crank driven so (rad/s, or in a word)."""
    return m.with_drive(speed=speed, **drive)


def vector(trace: Trace | Signals, name: str) -> np.ndarray:
    signals = trace.signals if isinstance(trace, Trace) else trace
    return np.asarray(signals[f"{name}_x"] + 1j * signals[f"{name}_y"])


# ---------------------------------------------------------------- the analytic model


def equilibrium(trace: Trace, mechanism: Mechanism) -> Signals:
    """The analytic signals of a run, its pins with clearance where their own reactions press them."""
    found = displaced(
        Assembly(mechanism),
        trace.crank_angle,
        mechanism.speed or 1.0,
        inertia=trace.motion == "driven",
        clearances=dict(trace.clearance),
    )
    assert not found.flags
    return found.signals()


def reaction_errors(trace: Trace, mechanism: Mechanism, joint: str = "B") -> tuple[float, float]:
    """Largest error of a reaction's direction (deg) and magnitude (%) against the analytic equilibrium."""
    ratio = vector(trace, f"reaction_{joint}") / vector(equilibrium(trace, mechanism), f"reaction_{joint}")
    return float(np.degrees(np.abs(np.angle(ratio))).max()), float(100 * np.abs(np.abs(ratio) - 1).max())


def is_force(name: str) -> bool:
    return name.startswith("reaction") and name.endswith(("_x", "_y"))


def off(seen: Signals, right: Signals, kind: Callable[[str], bool]) -> float:
    """Largest error of the signals of a kind, of the largest value among them."""
    names = [name for name in right if kind(name)]
    return float(max(np.abs(seen[n] - right[n]).max() for n in names) / max(np.abs(right[n]).max() for n in names))


def assert_signals(
    trace: Trace, truth: Signals, relative: float, angle: float, place: float = 0.0, still: float = 1e-6
) -> None:
    """Every signal: angles to ``angle`` (rad), places and gaps to ``place`` (m; 0: as angles), forces to
    ``relative`` of the largest reaction, moments, torques and rates of their own largest value; at rest rates are 0.
    """
    largest = max(np.abs(values).max() for name, values in truth.items() if is_force(name))
    for name, values in truth.items():
        if name.endswith(("_magnitude", "_rotation")) or (name.startswith("reaction") and name.endswith("_angle")):
            continue
        right = values
        if name.endswith("velocity") and trace.motion == "static":
            right, allowed = np.zeros(values.size), still
        elif is_force(name):
            allowed = relative * largest
        elif name.startswith(("reaction", "drive")) or name.endswith("velocity"):
            allowed = relative * max(float(np.abs(values).max()), 0.1)
        else:
            allowed = place or angle if name.endswith(("_x", "_y")) else angle
        np.testing.assert_allclose(trace.signals[name], right, rtol=0, atol=allowed, err_msg=name)


def ideal_signals(m: Mechanism, theta: np.ndarray, motion: Motion = "driven") -> Signals:
    """The ideal linkage at crank angles (N,) rad, at the drive's speed or at rest."""
    return kinetostatics(kinematics(Assembly(m), theta, m.speed or 1.0), inertia=motion == "driven").signals()


# ---------------------------------------------------------------- the equation of motion of a loose pin


def fast_crank_rocker(clearance: float, damping: float) -> Mechanism:
    """600 rpm, K = 1e6 N/m."""
    m = load("crank-rocker").with_joint("B", clearance=clearance, contact_stiffness=1e6, contact_damping=damping)
    return at_speed(m, 20 * np.pi)


LONGEST_STEP = 2e-5  # s, of the referee off the wall


class ExactMotion(NamedTuple):
    """Angles (rad); the gap (m) in joint B, first pin less second; the force (N) of its first body on the second."""

    crank: np.ndarray
    coupler: np.ndarray
    follower: np.ndarray
    gap: np.ndarray
    force: np.ndarray


def exact_motion(m: Mechanism, theta: np.ndarray) -> ExactMotion:
    """The referee's motion at crank angles (rad) evenly apart, from a centred pin at angle 0."""
    loop = loop_of(m.with_joint("B", contact_law="kelvin-voigt"))
    apart = float(theta[1] / loop.speed)
    parts = int(np.ceil(apart / LONGEST_STEP))
    found = simulate(m, loop, centred(m, loop), float(theta[-1]), step=apart / parts)
    every = found.crank, found.states[:, FIRST], found.states[:, SECOND], found.gap, found.watched.force["B"]
    return ExactMotion(*(values[::parts] for values in every))


STARTS = range(3)  # of a chaotic motion: paths whose clearances differ by a millionth


@cache
def chaotic(start: int) -> tuple[Mechanism, ExactMotion]:
    """One of the STARTS, and its exact motion over 22 revolutions."""
    m = fast_crank_rocker(5e-4 * (1 + 1e-6 * start), 30.0)
    return m, exact_motion(m, np.linspace(0.0, 44 * np.pi, 22 * 3600 + 1))


def many_impacts_against_the_ode(
    engine: Engine, joint_model: JointModel = "spring-damper", step: float | None = None
) -> dict[str, tuple[float, float]]:
    """Simulated and exact rms force (N) and free share over revolutions 3 to 22: 0.5 mm, C = 30 N.s/m.

    The motion is chaotic, and the free share of one path scatters by 2 % from start to start: means over several.
    """
    theta = np.linspace(4 * np.pi, 44 * np.pi, 7201)
    rms: list[list[float]] = []
    free: list[list[float]] = []
    for k in STARTS:
        m, exact = chaotic(k)
        later = exact.crank >= theta[0] - 1e-9
        trace = engine.simulate(
            request_of(m, joint_model, "driven", theta, start="centred", lead_in=4 * np.pi, step=step)
        )
        forces = vector(trace, "reaction_B"), exact.force[later]
        rms.append([float(np.sqrt(np.mean(np.abs(f) ** 2))) for f in forces])
        free.append([trace.free_share["B"], free_share(exact.gap[later], m.joint("B").clearance)])
    means = {"rms force": np.mean(rms, axis=0).tolist(), "free share": np.mean(free, axis=0).tolist()}
    return {name: (simulated, exact) for name, (simulated, exact) in means.items()}
