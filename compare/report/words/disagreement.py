"""Why a run of a cross-check disagrees: ``B loses contact for 7.9 % of the crank angles``; and which engine stands
apart.
"""

from __future__ import annotations

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal
from compare.judge.assumptions import Failing
from compare.judge.attribution import ANALYTIC, Attribution
from compare.quantities import quantities, shown
from compare.results.crosscheck import Because, Run

BESIDE = 20.0  # deg of the crank from where a reaction turns round


def because(run: Run, mechanism: Mechanism, failing: Failing) -> Because:
    """The assumption that fails in a run, as its document says it."""
    return Because(
        assumption=failing.assumption,
        joint=failing.joint,
        words=_because(run, mechanism, failing) + _braked(run, mechanism, failing),
    )


def _braked(run: Run, mechanism: Mechanism, failing: Failing) -> str:
    """Where a load that opposes the motion turns reactions round, and how often the worst signal is off there and
    elsewhere.
    """
    if failing.off is None or failing.turned is None or not failing.turned.any():
        return ""
    theta = np.degrees(run.crank_angle)
    at = theta[failing.turned]
    beside = np.any(np.abs((theta[:, None] - at + 180) % 360 - 180) <= BESIDE, axis=1)
    near, far = (f"{np.sum(failing.off & where)} of {np.sum(where)}" for where in (beside, ~beside))
    places = ", ".join(f"{angle:.4g}" for angle in at)
    return (
        f"; a load opposes the motion, and as it turns round reactions do (by {places} deg): pins cross their bearings,"
        f" strike and ring on; the {quantities(mechanism)[failing.apart].label} is off at {near} crank angles within"
        f" {BESIDE:g} deg of there, at {far} elsewhere; at rest no pin strikes: --motion static"
    )


def _because(run: Run, mechanism: Mechanism, failing: Failing) -> str:
    match failing.assumption:
        case "contact":
            return _contact_lost(run, mechanism, failing)
        case "first-order":
            apart = run.order_difference[failing.worst]
            (unit, factor), what = shown(apart.unit), quantities(mechanism)[failing.worst].label
            return (
                "the first order takes the ideal linkage's reactions (Eq. 8); in the displaced linkage"
                f" the {what} is up to {factor * abs(apart.max or 0.0):.2g} {unit.replace('·', '.')} off"
            )
        case "quasi-static":
            return _in_motion(failing)
        case "rigid":
            return (
                f"the contact yields by {1e6 * failing.give:.2g} um, which costs {failing.cost:.2g} tolerances;"
                " the analytic model presumes rigid contact"
            )
        case "unknown":
            return (
                "no assumption of the analytic model that was tested explains it (contact is kept; the costs of first"
                " order, of the gap's own motion and of the contact's give are within tolerance): suspect the"
                " simulation"
            )


def _in_motion(failing: Failing) -> str:
    """How a pin or block moves that does not rest where the equilibrium says."""
    if failing.rocks:
        lasts = {
            "for ever": "for ever, as nothing damps its contact",
            "for a while": "for a while after its friction turns round",
        }[failing.rocks]
        where = f"the block of {failing.joint} stays on its walls and rocks there {lasts}"
        return f"{where}; the analytic model has it at rest"
    if failing.swings:
        return "the pin stays in contact and swings along the rim; the analytic model presumes that it rests there"
    return f"the gap's own motion costs {failing.cost:.2g} tolerances; the analytic model corrects for it once"


def _contact_lost(run: Run, mechanism: Mechanism, failing: Failing) -> str:
    """Which joint loses contact for how long, and which others do."""
    turned = "the crank angles" if run.motion == "static" else "the motion that is compared"
    of = turned if mechanism.cranked else "the poses" if run.motion == "static" else "the motion"
    lost = {joint: f"{100 * share:.2g} %" for joint, share in run.free_share.items() if share > 0}
    also = "".join(f", {joint} for {share}" for joint, share in lost.items() if joint != failing.joint)
    share = lost[failing.joint or ""]
    return f"{failing.joint} loses contact for {share} of {of}{also}; the analytic model presumes contact"


def between_engines(attribution: Attribution) -> str:
    """Which engine stands apart, or the analytic model."""
    if not attribution.spread:
        nothing = "pins strike, so that averages are compared and no samples"
        return nothing if attribution.struck else "nothing could be compared"
    if attribution.clearest is None:
        differ = "they differ, and no single one stands apart"
        return differ if attribution.differ else "all agree within the tolerances"
    worst, odd = attribution.clearest, attribution.odd_one_out
    name = "the analytic model" if odd == ANALYTIC else odd
    by, others = (_said(worst.signal, value) for value in (worst.by, worst.others_spread))
    return f"{name} stands apart, most clearly in {worst.signal.name}: off by {by}, the others agree within {others}"


def _said(signal: Signal, value: float) -> str:
    return f"{np.degrees(value):.3g} deg" if signal.wraps else f"{value:.3g} {signal.unit}"
