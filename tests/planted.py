"""An engine for tests: it answers as the analytic equilibrium does, but for a fault that is planted in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.paper.clearance import displaced
from sim_models.engine import Capabilities, JointModel, Motion, Request, Scope, Trace

Signals = dict[str, np.ndarray]
Fault = Callable[[Signals], Signals]


def truth(signals: Signals) -> Signals:
    """No fault."""
    return signals


def turned(joint: str, angle: float) -> Fault:
    """A reaction turned by an angle (rad)."""

    def fault(signals: Signals) -> Signals:
        force = (signals[f"reaction_{joint}_x"] + 1j * signals[f"reaction_{joint}_y"]) * np.exp(1j * angle)
        return signals | {f"reaction_{joint}_x": force.real, f"reaction_{joint}_y": force.imag}

    return fault


@dataclass(frozen=True)
class Planted:
    """An engine that answers what the self-consistent equilibrium says, and then spoils it."""

    fault: Fault = truth
    name: str = "planted"
    version: str = "1"
    package: str = "numpy"
    supports: frozenset[tuple[JointModel, Motion]] = field(
        default=frozenset({("ideal", "driven"), ("ideal", "static"), ("contact", "static")})
    )

    @property
    def capabilities(self) -> Capabilities:
        """What the engine declares: its runs."""
        return Capabilities(rigid=Scope.of(self.supports))

    def simulate(self, request: Request) -> Trace:
        """The answer to a request."""
        mechanism, sizes = request.mechanism, {} if request.joint_model == "ideal" else request.mechanism.clearances
        theta = request.schedule.crank_angle
        assert theta is not None  # it has nothing else
        found = displaced(
            Assembly(mechanism),
            theta,
            mechanism.speed or 1.0,
            inertia=request.motion == "driven",
            clearances=sizes,
        ).signals()
        signals = self.fault({name: np.array(v) for name, v in found.items() if not name.endswith("_rotation")})
        return Trace(
            self.name,
            self.version,
            request.joint_model,
            request.motion,
            theta,
            None,
            signals,
            clearance=sizes,
        )
