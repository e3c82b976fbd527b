"""The analytic side of a comparison: every signal at the run's crank angles, and where the model has no answer."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.reach import usual_angles
from analytic.mechanism.one_line import count, one_line
from analytic.mechanism.signals import named
from analytic.paper.clearance import Displaced, Model, displaced
from analytic.paper.compliance import compliance
from analytic.paper.kinetostatics import friction_turns
from analytic.paper.superposition import superposed
from compare.judge.discrepancy import difference, largest
from compare.judge.signals import UNITS, compared, kind_of, with_derived
from compare.results.crosscheck import OrderDifference
from sim_models.engine import Motion

REVERSAL = 5e-3  # rad of crank before and after a joint's sliding reverses, where simulations preslide or are in a step


@dataclass(frozen=True)
class Reference:
    """Analytic signals (N,), NaN where flagged; ``ideal_angles`` (rad) are the bodies' without clearance.

    ``order_difference`` says for each compared signal how far the paper's first order is from the equilibrium;
    ``elastic`` (m) is the largest elastic displacement of any point, 0 with rigid links.  ``peaks`` are the signals'
    largest sizes at the linkage's usual crank angles; a signal without one is judged by its peak in the run.
    """

    signals: Mapping[str, np.ndarray]
    ideal_angles: Mapping[str, np.ndarray]
    order_difference: Mapping[str, OrderDifference]
    flags: Mapping[int, str]
    elastic: float = 0.0
    peaks: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        samples = count(max((values.size for values in self.signals.values()), default=0), "sample")
        flagged = f"{len(self.flags)} flagged" if self.flags else ""
        return one_line(self, count(len(self.signals), "signal"), samples, flagged)


def reference(
    assembly: Assembly, theta: np.ndarray, motion: Motion, model: Model, clearances: Mapping[str, float]
) -> Reference:
    """The analytic model at crank angles theta (N,) rad with these clearances (m; none for ideal joints)."""
    mechanism = assembly.mechanism
    speed = mechanism.speed or 1.0  # without a speed only statics is left, where its sign is all that matters

    def at(angles: np.ndarray, model: Model) -> Displaced:
        return displaced(assembly, angles, speed, model=model, inertia=motion == "driven", clearances=clearances)

    models: tuple[Model, ...] = ("equilibrium", "first_order") if clearances else (model,)
    sides = {each: at(theta, each) for each in models}
    found = sides[model]
    signals = {each: with_derived(side.signals(), mechanism) for each, side in sides.items()}
    order: dict[str, OrderDifference] = {}
    for signal in compared(mechanism, clearances) if clearances else ():
        apart = signal.apart(*(signals[each][signal.name] for each in ("first_order", "equilibrium")))
        if (most := difference(apart)) is not None:
            unit, where = UNITS[kind_of(signal)], float(theta[most.at])
            order[signal.name] = OrderDifference(unit=unit, max=most.max, rms=most.rms, at_crank_angle=where)
    ideal = {body.name: found.ideal.motion.angle(body.name) for body in mechanism.bodies}
    turning = friction_turns(found.ideal.motion, REVERSAL if motion == "driven" else 0.0)
    usual = usual_angles(assembly)
    peaks = {}
    if np.array_equal(usual, theta):
        peaks = largest(signals[model])
    else:
        with suppress(AssemblyError):  # the displaced linkage does not reach all of them
            peaks = largest(with_derived(at(usual, model).signals(), mechanism))
    side = Reference(signals[model], ideal, order, found.flags, peaks=peaks)
    return _without({i: why for i, why in _reversals(turning).items() if i not in found.flags}, side)


def with_flexible_links(side: Reference, assembly: Assembly, theta: np.ndarray) -> Reference:
    """The analytic side at rest with the elastic displacement of the ideal linkage added: the paper's superposition
    (Fig. 7c, :func:`analytic.paper.superposition.superposed`).  Reactions keep their values and their peaks.
    """
    m = assembly.mechanism
    found = compliance(kinematics(assembly, theta, m.speed or 1.0))
    known = named(m.bodies, m.joints)
    peaks = {name: peak for name, peak in side.peaks.items() if known[name].kind in ("reaction", "drive")}
    return replace(
        side,
        signals=superposed(side.signals, found),
        peaks=peaks,
        elastic=max(float(np.abs(found.displacement(*place)).max()) for place in found.motions),
    )


def released_reference(assembly: Assembly, time: np.ndarray) -> Reference:
    """The analytic motion of a linkage released at rest, at times (N,) s."""
    found = released(assembly, time)
    mechanism, reactions = assembly.mechanism, found.reactions
    ideal = {body.name: reactions.motion.angle(body.name) for body in mechanism.bodies}
    signals = with_derived(reactions.signals(), mechanism)
    rubbing = [joint.name for joint in mechanism.joints if joint.rubs]
    why = f"at rest, where nothing says how friction in {' and '.join(rubbing)} share what they hold"
    flags = {int(i): why for i in np.flatnonzero(found.held)} if len(rubbing) > 1 else {}
    flags |= {
        int(i): "the linkage turns back here, and its friction has no direction" for i in np.flatnonzero(found.turning)
    }
    return _without(flags, Reference(signals, ideal, {}, {}))


def _reversals(turning: Mapping[str, np.ndarray]) -> dict[int, str]:
    """Why there is no answer where a joint's friction has no direction, by sample."""
    return {
        int(i): f"the sliding at {joint} reverses here, and its friction has no direction"
        for joint, here in turning.items()
        for i in np.flatnonzero(here)
    }


def _without(flags: Mapping[int, str], side: Reference) -> Reference:
    """A side with NaN at the samples that are flagged."""
    if not flags:
        return side
    silent = list(flags)
    signals = {name: np.array(values) for name, values in side.signals.items()}
    for values in signals.values():
        values[silent] = np.nan
    return replace(side, signals=signals, flags={**side.flags, **flags})
