"""One pin that bounces: what a contact law delivers of the restitution that it is asked for, in any engine."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from scipy.integrate import solve_ivp

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from sim_models.common.contact_laws import NamedLaw, named_law
from sim_models.engine import Engine, JointModel, Request, Trace

LAWS: tuple[ContactLaw, ...] = ("kelvin-voigt", "hunt-crossley", "lankarani-nikravesh", "flores", "gonthier")
ASKED = (0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
CLEARANCE, G = 5e-3, 9.81  # m, m/s^2
SPEED = math.sqrt(2 * G * CLEARANCE)  # m/s, at the wall
SAMPLES = 60


def hanging(law: ContactLaw | None, asked: float, stiffness: float) -> Mechanism:
    """A bar that falls straight down, by its clearance, with the pin that it hangs on: all of its mass strikes."""
    m = load("pendulum").with_joint(
        "O", clearance=CLEARANCE, restitution=asked, contact_stiffness=stiffness, contact_law=law
    )
    return m.replace(assembly={"pendulum": -math.pi / 2}, gravity=(0.0, -G))


def law_of(m: Mechanism, joint: str) -> NamedLaw:
    """The law of a joint that names one."""
    law = named_law(m, m.joint(joint), "driven")
    assert law is not None
    return law


def dropped(
    engine: Engine, m: Mechanism, model: JointModel = "contact", step: float | None = None, late: float = 0.0
) -> Trace:
    """Its fall and bounce, watched closely around the touch; reports come ``late`` (s)."""
    fall, period = SPEED / G, 2 * math.pi * math.sqrt(m.bodies[0].mass / law_of(m, "O").stiffness)
    time = fall + late + period * np.concatenate([np.linspace(0.0, 1.0, SAMPLES), [1.5, 2.0, 4.0, 8.0]])
    return engine.simulate(Request(m, model, "driven", time=time, start="centred", step=step))


def rebound(trace: Trace) -> float:
    """Speed at the wall after the touch, over that before it."""
    gap, speed = trace.signals["clearance_O_y"], trace.rates["pendulum"].velocity.imag
    back = (np.abs(gap) < CLEARANCE) & (speed > 0)
    k = int(np.argmax(back))
    assert back[k], "it has not come back"
    return math.sqrt(speed[k] ** 2 + 2 * G * (CLEARANCE - abs(gap[k]))) / SPEED


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
