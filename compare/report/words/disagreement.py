"""Why a run of a cross-check disagrees: ``B loses contact for 7.9 % of the crank angles``; and which engine stands
apart.
"""

from __future__ import annotations

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal
from compare.judge.assumptions import Failing
from compare.judge.attribution import ANALYTIC, Attribution
from compare.results.crosscheck import Because, Run


def because(run: Run, mechanism: Mechanism, found: Failing) -> Because:
    """The assumption that fails in a run, as its document says it."""
    return Because(assumption=found.assumption, joint=found.joint, words=_because(run, mechanism, found))


def _because(run: Run, mechanism: Mechanism, found: Failing) -> str:
    match found.assumption:
        case "contact":
            return _contact_lost(run, mechanism, found)
        case "first-order":
            apart = run.order_difference[found.worst]
            return (
                "the first order takes the ideal linkage's reactions (Eq. 8); in the displaced linkage"
                f" {found.worst} is up to {abs(apart.max or 0.0):.2g} {apart.unit} elsewhere"
            )
        case "quasi-static":
            return _in_motion(found)
        case "rigid":
            return (
                f"the contact yields by {1e6 * found.give:.2g} um, which costs {found.cost:.2g} tolerances;"
                " the analytic model presumes rigid contact"
            )
        case "unknown":
            return (
                "no assumption of the analytic model that was tested explains it (contact is kept; the costs of first"
                " order, of the gap's own motion and of the contact's give are within tolerance): suspect the"
                " simulation"
            )


def _in_motion(found: Failing) -> str:
    """How a pin or block moves that does not rest where the equilibrium says."""
    if found.rocks:
        lasts = {
            "for ever": "for ever, as nothing damps its contact",
            "for a while": "for a while after its friction turns round",
        }[found.rocks]
        where = f"the block of {found.joint} stays on its walls and rocks there {lasts}"
        return f"{where}; the analytic model has it at rest"
    if found.swings:
        return "the pin stays in contact and swings along the rim; the analytic model presumes that it rests there"
    return f"the gap's own motion costs {found.cost:.2g} tolerances; the analytic model corrects for it once"


def _contact_lost(run: Run, mechanism: Mechanism, found: Failing) -> str:
    """Which joint loses contact for how long, and which others do."""
    turned = "the crank angles" if run.motion == "static" else "the motion that is compared"
    of = turned if mechanism.cranked else "the poses" if run.motion == "static" else "the motion"
    lost = {joint: f"{100 * share:.2g} %" for joint, share in run.free_share.items() if share > 0}
    also = "".join(f", {joint} for {share}" for joint, share in lost.items() if joint != found.joint)
    return (
        f"{found.joint} loses contact for {lost[found.joint or '']} of {of}{also}; the analytic model presumes contact"
    )


def between_engines(found: Attribution) -> str:
    """Which engine stands apart, or the analytic model."""
    if not found.spread:
        nothing = "pins strike, so that averages are compared and no samples"
        return nothing if found.struck else "nothing could be compared"
    if found.clearest is None:
        return "they differ, and no single one stands apart" if found.differ else "all agree within the tolerances"
    worst, name = found.clearest, "the analytic model" if found.odd_one_out == ANALYTIC else found.odd_one_out
    by, others = (_said(worst.signal, value) for value in (worst.by, worst.others_spread))
    return f"{name} stands apart, most clearly in {worst.signal.name}: off by {by}, the others agree within {others}"


def _said(signal: Signal, value: float) -> str:
    return f"{np.degrees(value):.3g} deg" if signal.wraps else f"{value:.3g} {signal.unit}"
