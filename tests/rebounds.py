"""One pin that bounces: what a contact law delivers of the restitution that it is asked for, in any engine."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from scipy.integrate import solve_ivp

from analytic.mechanism import Mechanism
from analytic.mechanism.parts import ContactLaw
from sim_models.common.contact_laws import NamedLaw, named_law
from sim_models.engine import Engine, JointModel
from tests.evidence.validation.rebounds import ASKED, SPEED, G, dropped, hanging, rebound
from tests.evidence.validation.striking import LAWS


def law_of(m: Mechanism, joint: str) -> NamedLaw:
    """The law of a joint that names one."""
    law = named_law(m, m.joint(joint), "driven")
    assert law is not None
    return law


def exact_rebound(m: Mechanism) -> float:
    """The same of the law's own differential equation, weight included."""
    law, mass = law_of(m, "O"), m.bodies[0].mass

    def rates(t: float, y: np.ndarray) -> list[float]:
        pressed = law.stiffness * y[0] * (1 + law.hysteresis * y[1] / SPEED) + law.damping * y[1]
        return [y[1], G - max(0.0, pressed) / mass]

    def out(t: float, y: np.ndarray) -> float:
        return float(y[0])

    out.terminal, out.direction = True, -1  # type: ignore[attr-defined]
    time = math.sqrt(mass / law.stiffness)
    found = solve_ivp(rates, (0.0, 300 * time), [1e-15, SPEED], "LSODA", events=out, rtol=1e-9, atol=1e-14)
    return float(-found.y_events[0][0][1] / SPEED)


def restitutions(
    engine: Engine, model: JointModel, stiffness: float = 1e9, asked: Iterable[float] = ASKED
) -> dict[ContactLaw, dict[float, tuple[float, float]]]:
    """By law and restitution asked for: what an engine delivers, and what the law's differential equation does."""
    return {
        law: {
            e: (rebound(dropped(engine, m, model)), exact_rebound(m))
            for e in asked
            for m in [hanging(law, e, stiffness)]
        }
        for law in LAWS
    }
