"""What any request must be, whichever engine it is put to: where it reports, and what says how its crank moves."""

from __future__ import annotations

import numpy as np

from sim_models.common.start import Course
from sim_models.engine import Request, Unsupported


def check_request(request: Request) -> None:
    """Raise Unsupported, saying what to give or to leave out, for a request that makes no run in any engine."""
    name, drive = request.mechanism.name, request.mechanism.drive
    if request.course is not None:
        if request.motion == "static" or drive is None or drive.speed == "free":
            raise Unsupported(
                f"{name}: only a drive that is not free follows a course; leave the course out of a static or released"
                " run"
            )
        if request.lead_in:
            raise Unsupported(f"{name}: a course leads in by itself; leave out lead_in = {request.lead_in:g} rad")
        Course.of(request)
    elif request.released:
        time = np.zeros(0) if request.time is None else np.asarray(request.time, float)
        if time.size == 0 or not np.all(time >= 0):
            raise Unsupported(f"{name}: a released linkage needs request.time, from 0 s on; it is {request.time}")
    elif request.motion == "driven" and request.mechanism.speed is None:
        raise Unsupported(
            f"{name}: a measured drive follows a course; give the request one, or drive.speed in rad/s, or 'free'"
        )
    elif request.crank_angle.size == 0:
        raise Unsupported(f"{name}: there is no crank angle to report at; give request.crank_angle, at least one")
