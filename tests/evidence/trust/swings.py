"""Swings of a pendulum on which a small torque acts that has no name, foretold from other swings of it.

The truth is integrated by scipy and shares nothing with the model: a damper; drag that grows with the square of the
rate; and a cable that pulls until it is taut, which no effect says.  Damping, inertia and centre of mass may be named.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import solve_ivp

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import named
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.workflow import diagnose
from compare.results.diagnosis import Diagnosis
from tests.evidence.results.trust import Swung

MASS, ARM, OWN, GRAVITY = 0.15, 0.15, 1.1e-4, 9.81  # kg, m, kg.m^2, m/s^2
INERTIA, WEIGHT = OWN + MASS * ARM**2, MASS * GRAVITY * ARM
TIME = np.arange(900) / 100.0
NOISE = {"pendulum_angle": 1e-4, "pendulum_angular_velocity": 5e-3}
NAMED = ("viscous_friction@O", "moment_of_inertia@pendulum", "com_offset@pendulum")
PENDULUM = Mechanism.model_validate(
    {
        "name": "pendulum",
        "gravity": (0.0, -GRAVITY),
        "ground": {"points": {"O": (0.0, 0.0)}},
        "body": [
            {
                "name": "pendulum",
                "points": {"O": (0.0, 0.0), "tip": (0.2, 0.0)},
                "mass": MASS,
                "com": (ARM, 0.0),
                "inertia": OWN,
            }
        ],
        "joint": [{"name": "O", "type": "revolute", "bodies": ("ground", "pendulum")}],
        "drive": {"joint": "O", "speed": "free"},
        "assembly": {"pendulum": -1.0},
    }
)


@dataclass(frozen=True)
class Hidden:
    """What acts on the pendulum beside its weight: N.m.s/rad, N.m.s^2/rad^2, N.m at most, and where (rad) it is 0."""

    damping: float
    drag: float
    cable: float
    rest: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Hidden:
        """One of the sizes that a bench has."""
        damping = 2e-4 * math.exp(0.3 * rng.standard_normal())
        drag = rng.uniform(0.1, 0.5) * damping / 6.0  # as large a share of it at 6 rad/s
        return cls(damping, drag, WEIGHT * rng.uniform(-3e-3, 3e-3), -math.pi / 2 + rng.uniform(-1.0, 1.0))

    def swing(self, angle: float, rate: float) -> np.ndarray:
        """Angle and rate (2, N) at TIME of a swing that starts there."""

        def slope(_: float, state: np.ndarray) -> tuple[float, float]:
            q, w = state
            lost = self.damping * w + self.drag * w * abs(w) + self.cable * math.tanh(3 * (q - self.rest))
            return w, -(WEIGHT * math.cos(q) + lost) / INERTIA

        return np.asarray(solve_ivp(slope, (0.0, TIME[-1]), (angle, rate), "DOP853", TIME, rtol=1e-10, atol=1e-10).y)


def diagnosed(seed: int, fitted: int) -> Diagnosis:
    """The diagnosis of so many swings, and of a further one that is foretold from them."""
    rng, known, runs = np.random.default_rng(seed), named(PENDULUM.bodies, PENDULUM.joints), list[MeasuredRun]()
    hidden = Hidden.drawn(rng)
    for k in range(fitted + 1):
        moved = hidden.swing(-math.pi / 2 + rng.uniform(0.7, 1.5), rng.uniform(-3.0, 3.0))
        read = {s: v + NOISE[s] * rng.standard_normal(v.size) for s, v in zip(NOISE, moved, strict=True)}
        channels = {s: Channel(known[s], v, NOISE[s], True, known[s].unit) for s, v in read.items()}
        start = {s: float(v[0]) for s, v in read.items()}
        run = MeasuredRun(f"swing {k + 1}", TIME, channels, "free", None, None, start, None, False, "")
        runs.append(run if k < fitted else replace(run, role="validation"))
    measured = Measured(PENDULUM, tuple(runs), {}, (), "swings")
    return diagnose(measured, "mujoco", others=False, workers=1, only=NAMED)


def swings(fitted: int, seeds: Iterator[int]) -> Iterator[Swung]:
    """A row for each seed."""
    for seed in seeds:
        run = diagnosed(seed, fitted).runs[-1]
        for signal, band in run.prediction.items():
            record = run.signals[signal]
            yield Swung(
                seed=seed,
                fitted=fitted,
                signal=signal,
                readings=band.covered,
                width=float(np.nanmedian(band.high - band.low) / np.nanmax(np.abs(record.measured))),
                off=record.gap_after,
            )
