"""Where a number comes from, in words: the equation or the model of its analytic side, and who pushes whom."""

from __future__ import annotations

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal

DRIVEN = "Eqs. 9-14, inertia forces and force balance of the {} linkage"
STATIC = "Eqs. 11-14, static force balance of the {} linkage"
GAP = {  # Eq. 8, by analytic model
    "first_order": "Eq. 8: the clearance along the ideal linkage's reaction",
    "equilibrium": "Eq. 8 along the displaced linkage's own reaction",
}
NO_CLEARANCE = "no clearance: zero"
SWUNG = "equation of motion of the released linkage, integrated"
BENT = "plus the elastic displacement of links and joints (Eqs. 1-7)"
FIRST_ORDER = "first order: reactions as without clearance"
TURNED = "the body's angle in the displaced linkage minus that in the ideal one"


def forces(motion: str, displaced: bool) -> str:
    """What a force was computed from."""
    return (STATIC if motion == "static" else DRIVEN).format("displaced" if displaced else "ideal")


def closure(displaced: bool) -> str:
    """What a position was computed from."""
    return f"loop closure of the {'displaced' if displaced else 'ideal'} linkage"


def acts(mechanism: Mechanism, signal: Signal) -> str:
    """Which body pushes which, for what belongs to a joint."""
    joint = next((j for j in mechanism.joints if j.name == signal.place), None)
    if joint is None or signal.kind not in ("reaction", "clearance"):
        return ""
    first, second = joint.bodies
    if signal.kind == "clearance":
        return f"{'angle' if signal.component == 'angle' else 'pin centre'} of {first} minus that of {second}"
    return f"{'moment' if signal.component == 'moment' else 'force'} of {first} on {second}"
