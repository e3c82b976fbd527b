"""Platforms on links that bend: clearance and compliance added up, against beams with real contact in their joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import along
from compare.judge.flexible import Beams
from compare.judge.reference import reference, with_flexible_links
from sim_models.engine import JointModel, Request
from tests.evidence.results.validation import Bent
from tests.evidence.validation.workspaces import Spiral, digits

PLATFORMS = {"five-bar": "left-arm", "3-rrr": "platform"}  # whose legs have moduli in the shipped cases
JOINTS: tuple[JointModel, ...] = ("ideal", "contact")


def bending(names: Sequence[str]) -> tuple[Bent, ...]:
    """Each platform with ideal joints, and loose in every pin, at rest under its own loads at poses along a spiral;
    nothing without Exudyn, which has the beams.
    """
    if "exudyn" not in names:
        return ()
    return tuple(_bent(case, body, joints) for case, body in PLATFORMS.items() for joints in JOINTS)


def _bent(case: str, body: str, joints: JointModel) -> Bent:
    spiral = Spiral(case, "static")
    m, schedule = spiral.mechanism if joints == "contact" else spiral.mechanism.ideal(), spiral.schedule
    assembly = Assembly(m)
    beams = Beams.of("exudyn").simulate(Request(m, joints, schedule)).signals
    side = reference(assembly, schedule, "equilibrium", m.clearances)
    ours = with_flexible_links(side, assembly, schedule).signals
    ideal = along(assembly, schedule).position(body)
    theirs, told = (s[f"{body}_x"] + 1j * s[f"{body}_y"] for s in (beams, ours))
    moved = np.abs(theirs - ideal)
    off = np.abs(told - theirs) / moved
    return Bent(
        case=case,
        joints=joints,
        poses=schedule.time.size,
        displacement=digits(moved.max()),
        off=digits(np.median(off)),
        off_worst=digits(off.max()),
    )
