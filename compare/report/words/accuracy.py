"""How accurate a linkage or a platform can be, in words: what the numbers are, and what to beware of."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from analytic.mechanism.one_line import count
from compare.quantities import plain, shown
from compare.results.accuracy import Accuracy
from compare.results.platform import PlatformAccuracy

FIELDS: Mapping[str, str] = {
    "total": "all together, to either side",
    "worst_case": "clearance, worst case to first order",
    "equilibrium": "clearance, finite gaps in equilibrium",
    "nominal": "clearance, first order (Eq. 8)",
    "resolution": "resolution of the drives",
    "compliance": "compliance",
}
NOTES = (
    "Clearance, worst case: the largest displacement to either side, wherever the pins lie, to first order. In"
    " equilibrium: every pin where its own reaction presses it, with finite gaps, which may be more; first order: along"
    " the ideal linkage's reactions (Eq. 8). Resolution: all drives half a step of their encoders off. All together:"
    " worst case, resolution and compliance.",
    "Dexterity is the condition number of the platform's velocity by its drives: infinite where it cannot move in some"
    " direction (first kind). Holding is that of the loops: infinite where its drives do not hold it (second kind).",
)


def notes(result: Accuracy) -> list[str]:
    """What the numbers of the table are, and what to beware of."""
    sizes = ", ".join(f"{joint} {1e3 * c:.4g} mm" for joint, c in result.clearance.items()) or "none"
    closed = "each closed again" if result.nonlinear else "to first order"
    notes = [
        "x and y in the ground frame; largest over the crank angles; worst case to either side, to first order"
        " (equilibrium, with finite gaps, may be more);"
        " sigma with contacts anywhere on the rim",
        (
            f"{result.case}: {result.motion}, clearance {sizes}; {count(result.samples, 'sample')} {closed},"
            f" seed {result.seed}"
        ),
    ]
    return [*notes, *cautions(result)]


def cautions(result: Accuracy) -> Iterator[str]:
    """What to beware of: crank angles without an answer or near a limit, and contacts that change sides."""
    of = count(result.crank_angle.size, "crank angle")
    others = " (the largest is of the others)"
    for what, reasons, told in (("no equilibrium", result.flags, others), ("cautions", result.cautions, "")):
        for first, why in list(reasons.items())[:1]:
            at = f"{math.degrees(result.crank_angle[int(first)]):.4g} deg"
            yield f"{what} at {len(reasons)} of {of}{told}; first {at}: {why}"
    places: dict[str, list[str]] = {}
    for change in result.side_changes:
        name = max(change.jump, key=lambda n: (result.outputs[n].unit == "m", abs(change.jump[n])))
        unit, factor = shown(result.outputs[name].unit)
        what = "changes side" if abs(change.turned) > math.pi / 2 else "is hardly loaded"
        where = f"the contact {what} at {math.degrees(change.crank_angle):.4g} deg: {name} jumps by"
        places.setdefault(where, []).append(f"{plain(change.jump[name] * factor)} {unit} in {change.joint}")
    yield from (f"{where} {', '.join(jumps)}" for where, jumps in places.items())


def facts(result: PlatformAccuracy) -> dict[str, str]:
    """What a platform's numbers are of."""
    sizes = ", ".join(f"{joint} {1e3 * size:.4g} mm" for joint, size in result.clearance.items()) or "none"
    steps = ", ".join(f"{joint} {_step(result, joint, step)}" for joint, step in result.encoder_step.items()) or "none"
    reached = int(result.reached.sum())
    where = f"{reached} of {result.reached.size}" if result.workspace else f"{reached}"
    conditions = {"radial clearance": sizes, "encoder steps": steps, "poses": where}
    if result.workspace is not None and result.workspace.angle is not None:
        conditions["angle"] = f"{math.degrees(result.workspace.angle):.5g} deg"
    return conditions


def _step(result: PlatformAccuracy, joint: str, step: float) -> str:
    unit, factor = shown("m" if result.mechanism.joint(joint).prismatic else "rad")
    return f"{plain(factor * step)} {unit}"
