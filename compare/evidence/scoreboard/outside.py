"""Faults that have no name in the vocabulary: a diagnosis must report them as unexplained.

The motor of a rigid linkage prescribes how it moves, so that reactions and drive torque are linear in whatever torques
act on it: a law that no engine has is run exactly as (undisturbed) + torque(t) x (run with a unit torque -
undisturbed).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from analytic.mechanism import GROUND, Load, Mechanism
from analytic.mechanism.signals import wrapped
from compare.evidence.scoreboard.rigs import Experiment, Plan, ideal

KINDS = ("cracked tooth", "stick-slip", "nonlinear spring", "periodic torque", "bent link")
Course = Callable[[np.ndarray], np.ndarray]  # motor angle (rad) at times (s)
Simulate = Callable[[Mechanism, Plan, np.ndarray, Course | None], Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class Outside:
    """A fault outside the vocabulary: ``size`` scales it, ``shape`` are the other numbers that it has."""

    kind: str
    where: str
    size: float
    shape: dict[str, float]

    def signals(self, nominal: Mechanism, plan: Plan, time: np.ndarray, simulate: Simulate) -> dict[str, np.ndarray]:
        """Signals (N,) at times (N,) s of a run, by engine or analytically as ``simulate`` does it; the encoder reads
        the motor.
        """
        m = nominal if plan.loads is None else nominal.replace(loads=plan.loads)
        if self.kind == "cracked tooth":
            return dict(simulate(m, plan, time, lambda t: plan.command(t) + self._bump(plan.command(t))))
        if self.kind == "bent link":
            return dict(simulate(self._bent(m), plan, time, None))
        still, pushed = simulate(m, plan, time, None), simulate(self._with_unit_torque(m), plan, time, None)
        torque = self._torque(m, time, still)
        return {s: still[s] + torque * (pushed[s] - still[s]) for s in still}

    def _bump(self, angle: np.ndarray) -> np.ndarray:
        beside = wrapped(angle - self.shape["angle"])
        return np.asarray(self.size * np.exp(-0.5 * (beside / self.shape["width"]) ** 2))

    def _bent(self, m: Mechanism) -> Mechanism:
        """The last point of the body beside its axis; mass, marker and loads where they were."""
        body = m.moving[self.where]
        last = list(body.points)[-1]
        x, y = body.points[last]
        com = (body.centre.real, body.centre.imag)
        return m.with_body(
            self.where, com=com, inertia=body.moment_of_inertia, points={**body.points, last: (x, y + self.size)}
        )

    def _with_unit_torque(self, m: Mechanism) -> Mechanism:
        """1 N.m on the second body of the joint and back on its first; on a body alone where there is no such joint."""
        loads = [*m.loads]
        if self.where in m.moving:
            return m.replace(loads=(*loads, Load(body=self.where, torque=1.0)))
        first, second = m.joint(self.where).bodies
        loads += [Load(body=b, torque=t) for b, t in ((first, -1.0), (second, 1.0)) if b != GROUND]
        return m.replace(loads=tuple(loads))

    def _torque(self, m: Mechanism, time: np.ndarray, signals: Mapping[str, np.ndarray]) -> np.ndarray:
        if self.kind == "periodic torque":
            return np.asarray(self.size * np.sin(self.shape["rate"] * time + self.shape["phase"]))
        angle, rate = _relative(m, self.where, signals)
        if self.kind == "nonlinear spring":
            return np.asarray(-self.size * ((angle - self.shape["rest"]) / self.shape["travel"]) ** 3)
        slow = np.exp(-((rate / self.shape["stribeck_rate"]) ** 2))
        return np.asarray(-self.size * (1 + self.shape["excess"] * slow) * np.tanh(rate / self.shape["sharp_rate"]))


def _relative(m: Mechanism, joint: str, signals: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """A joint's angle (rad) and rate (rad/s), second body less first."""
    first, second = m.joint(joint).bodies
    angle, rate = (
        signals[f"{second}_{part}"] - (signals[f"{first}_{part}"] if first != GROUND else 0.0)
        for part in ("angle", "angular_velocity")
    )
    return angle, rate


def draw_outside(kind: str, experiment: Experiment, rng: np.random.Generator) -> Outside:
    """A fault of a kind, of a size that is scaled afterwards."""
    m = experiment.nominal
    signals = ideal(m, experiment.plans[0])
    rocking = [
        j.name
        for j in m.joints
        if not j.prismatic and j.name != m.drive_joint.name and np.ptp(np.sign(_relative(m, j.name, signals)[1])) > 1
    ]
    if kind == "cracked tooth":
        return Outside(kind, "drive", 1e-3, {"angle": rng.uniform(-math.pi, math.pi), "width": rng.uniform(0.12, 0.25)})
    if kind == "bent link":
        floating = [b.name for b in m.bodies if b.length > 0 and b.name != m.driven]
        where = str(rng.choice(floating))
        return Outside(kind, where, 1e-3 * m.moving[where].length, {})
    if kind == "periodic torque":
        rocker = [b.name for b in m.bodies if b.name != m.driven and b.length > 0]
        rate = abs(experiment.plans[0].speed) * rng.uniform(4.2, 4.8)
        return Outside(kind, str(rng.choice(rocker)), 1e-3, {"rate": rate, "phase": rng.uniform(-math.pi, math.pi)})
    where = str(rng.choice(rocking))
    angle, turning = _relative(m, where, signals)
    if kind == "nonlinear spring":
        return Outside(kind, where, 1e-3, {"rest": float(angle.mean()), "travel": float(np.ptp(angle) / 2)})
    fast = float(np.abs(turning).max())
    return Outside(kind, where, 1e-3, {"stribeck_rate": 0.35 * fast, "excess": 2.0, "sharp_rate": 0.01 * fast})


def resized(outside: Outside, factor: float) -> Outside:
    """The same fault, ``factor`` times as large."""
    return replace(outside, size=outside.size * factor)
