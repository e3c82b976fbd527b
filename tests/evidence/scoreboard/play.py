"""One run of a rig, played by an engine."""

from __future__ import annotations

import numpy as np

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from sim_models.common.backlash import TURN_TO_LAND
from sim_models.engine import JointModel, Request, Trace, engine
from tests.evidence.scoreboard.outside import Course
from tests.evidence.scoreboard.rigs import Plan, Rejected, course_grid


def run(name: str, m: Mechanism, plan: Plan, time: np.ndarray, course: Course | None) -> Trace:
    """One simulation, clearance by contact (in Exudyn by a link as long as it, as stiff contact takes long).

    Raises Rejected where a pin leaves its bearing.
    """
    with_clearance: JointModel = "massless-link" if name == "exudyn" else "contact"
    joint_model: JointModel = with_clearance if m.clearances else "ideal"
    if m.several:
        grid = course_grid(plan, time)
        courses = {joint.name: (grid - grid[0], at) for joint, at in zip(m.motors, plan.command(grid), strict=True)}
        request = Request(m, joint_model, Schedule.along(courses, time - grid[0]))
    elif course is None:
        m = _driven(m, plan)
        turned = Schedule.at_angles(m, plan.command(time))
        request = Request(m, joint_model, turned, lead_in=TURN_TO_LAND if m.half_gap else 0.0)
    else:
        m, grid = _driven(m, plan), course_grid(plan, time)
        request = Request(m, joint_model, Schedule.of_crank(m, (grid, course(grid)), time))
    trace = engine(name).simulate_flexible(request) if m.bends else engine(name).simulate(request)
    if any(trace.free_share.values()):
        raise Rejected(f"a pin flies free in {plan.name}")
    return trace


def _driven(m: Mechanism, plan: Plan) -> Mechanism:
    """A linkage whose one motor turns at the speed of a plan, evenly."""
    assert m.drive is not None
    return m.replace(drive=m.drive.model_copy(update={"speed": plan.speed, "ripple": None}))
