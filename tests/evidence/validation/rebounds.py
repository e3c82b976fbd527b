"""What each law of contact delivers of the restitution that it is asked for: one pin that falls, in every engine."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from sim_models.common.contact_laws import damping_ratio, delivered, hysteresis, restitution
from sim_models.engine import Engine, JointModel, Request, Trace, Unsupported, check_supported, declared, engine
from tests.evidence.results.validation import Delivered

ASKED = (0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
STIFFNESS = 1e9  # N/m: the bar's weight does next to nothing while it strikes
CLEARANCE, G = 5e-3, 9.81  # m, m/s^2
SPEED = math.sqrt(2 * G * CLEARANCE)  # m/s, at the wall
SAMPLES = 60
FORMULA = "formula"  # its name among the engines
OWN = "its own, rigid"  # law of an engine that takes no other


def rebounds(names: Sequence[str], laws: Sequence[ContactLaw]) -> tuple[Delivered, ...]:
    """By law what its formula says, and what each engine delivers, in contact or else between pin centres; and what the
    rigid contact of an engine delivers that takes no law.
    """
    return tuple(row for law in laws for row in _of_law(names, law)) + tuple(_rigid(names))


def _of_law(names: Sequence[str], law: ContactLaw) -> Iterator[Delivered]:
    said = [restitution(damping_ratio(e)) if law == "kelvin-voigt" else delivered(hysteresis(law, e)) for e in ASKED]
    yield Delivered(law=law, simulator=FORMULA, joint_model=None, asked=ASKED, delivered=_three(said))
    for name in names:
        model = _model(name, hanging(law, 0.5))
        if model is not None:
            found = [rebound(dropped(engine(name), hanging(law, e), model)) for e in ASKED]
            yield Delivered(law=law, simulator=name, joint_model=model, asked=ASKED, delivered=_three(found))


def _rigid(names: Sequence[str]) -> Iterator[Delivered]:
    for name in names:
        if name == "dart":
            found = [rebound(dropped(engine(name), hanging(None, e))) for e in ASKED]
            yield Delivered(law=OWN, simulator=name, joint_model="contact", asked=ASKED, delivered=_three(found))


def _three(values: Sequence[float]) -> tuple[float | None, ...]:
    return tuple(round(value, 4) for value in values)


def _model(name: str, m: Mechanism) -> JointModel | None:
    """Where an engine takes a law."""
    models: tuple[JointModel, ...] = ("contact", "spring-damper")
    for model in models:
        try:
            check_supported(declared(name), Request(m, model, Schedule.released(m, np.zeros(1))))
        except Unsupported:
            continue
        return model
    return None


def hanging(law: ContactLaw | None, asked: float, stiffness: float = STIFFNESS) -> Mechanism:
    """A bar that falls straight down, by its clearance, with the pin that it hangs on: all of its mass strikes."""
    m = load("pendulum").with_joint(
        "O", clearance=CLEARANCE, restitution=asked, contact_stiffness=stiffness, contact_law=law
    )
    return m.replace(assembly={"pendulum": -math.pi / 2}, gravity=(0.0, -G))


def dropped(
    engine: Engine, m: Mechanism, model: JointModel = "contact", step: float | None = None, late: float = 0.0
) -> Trace:
    """Its fall and bounce in an engine, told closely around the touch; reports come ``late`` (s)."""
    stiffness = m.joint("O").contact_stiffness or STIFFNESS
    period = 2 * math.pi * math.sqrt(m.bodies[0].mass / stiffness)
    after = np.concatenate([np.linspace(0.0, 1.0, SAMPLES), [1.5, 2.0, 4.0, 8.0]])
    time = SPEED / G + late + period * after
    return engine.simulate(Request(m, model, Schedule.released(m, time), start="centred", step=step))


def rebound(trace: Trace) -> float:
    """Speed at the wall after the touch, over that before it; 0 where the pin stays."""
    gap, speed = trace.signals["clearance_O_y"], trace.rates["pendulum"].velocity.imag
    back = np.flatnonzero((np.abs(gap) < CLEARANCE) & (speed > 0))
    if not back.size:
        return 0.0
    k = int(back[-1])  # not the first: a rigid engine's samples near its impact are of a curve through it
    return math.sqrt(speed[k] ** 2 + 2 * G * (CLEARANCE - abs(gap[k]))) / SPEED
