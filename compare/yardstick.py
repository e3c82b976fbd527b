"""The analytic side of a comparison: every signal at the run's crank angles, and where the model has no answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic.assembly import Assembly
from analytic.clearance import Model, displaced
from analytic.released import released
from compare.discrepancy import ANGULAR, difference
from compare.signals import UNITS, compared, with_derived
from sim_models.engine import Motion


@dataclass(frozen=True)
class Yardstick:
    """Analytic signals (N,), NaN where flagged; ``ideal_angles`` (rad) are the bodies' without clearance.

    ``order_difference`` says for each compared signal how far the paper's first order is from the equilibrium.
    """

    signals: Mapping[str, np.ndarray]
    ideal_angles: Mapping[str, np.ndarray]
    order_difference: Mapping[str, Any]
    flags: Mapping[int, str]


def yardstick(assembly: Assembly, theta: np.ndarray, motion: Motion, model: Model, clearances: Mapping[str, float]) -> Yardstick:
    """The analytic model at crank angles theta (N,) rad with these clearances (m; none for ideal joints)."""
    mechanism = assembly.mechanism
    speed = mechanism.speed or 1.0  # without a speed only statics is left, where its sign is all that matters
    sides = {}
    for each in ("equilibrium", "first_order") if clearances else (model,):
        sides[each] = displaced(assembly, theta, speed, model=each, inertia=motion == "driven", clearances=clearances)
    found = sides[model]
    signals = {each: with_derived(side.signals(), mechanism) for each, side in sides.items()}
    order: dict[str, Any] = {}
    for name, kind in compared(mechanism, clearances).items() if clearances else ():
        apart = difference(signals["first_order"][name], signals["equilibrium"][name], kind in ANGULAR)
        if apart is not None:
            order[name] = {"unit": UNITS[kind], "max": apart.max, "rms": apart.rms, "at_crank_angle": float(theta[apart.at])}
    ideal = {body.name: found.ideal.motion.angle(body.name) for body in mechanism.bodies}
    return Yardstick(signals[model], ideal, order, found.flags)


def released_yardstick(assembly: Assembly, time: np.ndarray) -> Yardstick:
    """The analytic motion of a linkage released at rest, at times (N,) s."""
    found = released(assembly, time)
    ideal = {body.name: found.motion.angle(body.name) for body in assembly.mechanism.bodies}
    return Yardstick(with_derived(found.signals(), assembly.mechanism), ideal, {}, {})
