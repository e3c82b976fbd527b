"""What any request must be, whichever engine it is put to: where it reports, and what says how its crank moves."""

from __future__ import annotations

import numpy as np

from analytic.kinematics.structure import structure
from sim_models.engine import Request, Unsupported


def check_request(request: Request) -> None:
    """Raise Unsupported, saying what to give or to leave out, for a request that makes no run in any engine."""
    name = request.mechanism.name
    _check_links(request)
    _check_blocks(request)
    _check_bearings(request)
    _check_beyond(request)
    if request.courses is not None:
        _check_courses(request)
        return
    drive = request.mechanism.drive
    if request.course is not None:
        if request.motion == "static" or drive is None or drive.speed == "free":
            raise Unsupported(
                f"{name}: only a drive that is not free follows a course; leave the course out of a static or released"
                " run"
            )
        if request.lead_in:
            raise Unsupported(f"{name}: a course leads in by itself; leave out lead_in = {request.lead_in:g} rad")
        _check_course(request)
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


def _check_beyond(request: Request) -> None:
    """Raise Unsupported where a run is to go on after its reports, or to be watched, that no crank's speed moves."""
    turned = request.motion == "driven" and request.course is None and request.courses is None and not request.released
    if not turned and (request.beyond or request.watched):
        what = f"beyond = {request.beyond:g} rad" if request.beyond else "watched"
        raise Unsupported(
            f"{request.mechanism.name}: only a crank that turns at its drive's speed goes on beyond its reports, and is"
            f" watched; leave out {what}"
        )
    if not request.beyond >= 0:
        raise Unsupported(f"{request.mechanism.name}: beyond = {request.beyond:g} rad is negative; give 0 or more")


def _check_bearings(request: Request) -> None:
    """Raise Unsupported for soft bearings of a released linkage, or where there is a massless link."""
    m = request.mechanism
    both = [name for name in request.clearances if name in m.soft_bearings]
    if request.released and m.soft_bearings:
        name = next(iter(m.soft_bearings))
        raise Unsupported(
            f"{m.name}: a released linkage has no soft bearings, in which it would sway; leave out radial_stiffness ="
            f" {m.soft_bearings[name]:g} of joint {name!r}"
        )
    if request.joint_model == "massless-link" and both:
        raise Unsupported(
            f"{m.name}: a massless link does not give; leave out radial_stiffness of joint {both[0]!r}, or use joint"
            " model spring-damper or contact"
        )


def _check_courses(request: Request) -> None:
    """Raise Unsupported where courses and drives do not go together, or reports are outside of them."""
    m, courses = request.mechanism, request.courses or {}
    driven = [joint.name for joint in m.motors]
    if sorted(courses) != sorted(driven):
        raise Unsupported(
            f"{m.name}: there are courses of {', '.join(courses) or 'no joint'}, and drives at"
            f" {', '.join(driven) or 'none'}; give each drive its course"
        )
    _check_held(request)
    crank = {"stiffness": m.drive_stiffness, "half_gap": m.half_gap, "periodic_torque": m.periodic_torque}
    for field, given in (crank | {"ripple": m.drives[0].ripple if m.drives else None}).items():
        if given:
            raise Unsupported(f"{m.name}: a drive follows a course of its own rigidly; leave out drive.{field}")
    report = np.zeros(0) if request.time is None else np.asarray(request.time, float)
    if request.crank_angle.size or not report.size or not np.all(report >= 0):
        raise Unsupported(f"{m.name}: courses need report times, from 0 s on, in time, and no crank_angle")
    for course in courses.values():
        _check_spline(m.name, *course, report)


def _check_held(request: Request) -> None:
    """Raise Unsupported where an equilibrium is asked of a linkage that nothing holds."""
    if request.motion == "static" and (loose := structure(request.mechanism).free_joints):
        raise Unsupported(
            f"{request.mechanism.name}: no drive holds joint {loose[0]!r} at rest; use motion 'driven', or give it a"
            " drive and a course"
        )


def _check_course(request: Request) -> None:
    """Raise Unsupported where times, angles or reports do not make a course."""
    name = request.mechanism.name
    if request.course is None or request.time is None or request.crank_angle.size:
        raise Unsupported(f"{name}: a course needs course = (times, angles), report times in time, and no crank_angle")
    _check_spline(name, *request.course, np.asarray(request.time, float))


def _check_spline(name: str, time: np.ndarray, angle: np.ndarray, report: np.ndarray) -> None:
    """Raise Unsupported where times and positions make no spline, or reports lie outside of it."""
    time, angle = np.asarray(time, float), np.asarray(angle, float)
    whole = time.ndim == 1 and time.shape == angle.shape and time.size >= 4
    if not (whole and np.all(np.diff(time) > 0) and np.all(np.isfinite(angle))):
        raise Unsupported(
            f"{name}: a course is at least four strictly increasing times with an angle each; it has {time.size} times"
        )
    if report.size == 0 or report.min() < time[0] or report.max() > time[-1]:
        raise Unsupported(
            f"{name}: reports are wanted outside the course, which lasts from {time[0]:g} to {time[-1]:g} s"
        )


def _check_blocks(request: Request) -> None:
    """Raise Unsupported for blocks in motion that may turn in their guides, and have nothing to oppose to it."""
    m = request.mechanism
    for joint in (
        m.joint(name) for name in m.loose_guides if name in request.clearances and request.motion == "driven"
    ):
        light = [name for name in joint.bodies if name in m.moving and not m.moving[name].moment_of_inertia]
        if light:
            raise Unsupported(
                f"{m.name}: in joint {joint.name!r} body {light[0]!r} may turn by its clearance, and has no moment of"
                " inertia; give its inertia (kg.m^2)"
            )


def _check_links(request: Request) -> None:
    """Raise Unsupported for massless links that are to start shorter than they are, or to hold a block."""
    blocks = [name for name in request.mechanism.loose_guides if name in request.clearances]
    if request.joint_model == "massless-link" and blocks:
        raise Unsupported(
            f"{request.mechanism.name}: a massless link holds a pin, and joint {blocks[0]!r} is a block in a guide;"
            " use joint model contact"
        )
    centred = request.motion == "driven" and request.start == "centred" and request.clearances
    if request.joint_model == "massless-link" and centred:
        raise Unsupported(
            f"{request.mechanism.name}: a massless link is as long as the clearance and cannot start with its pin"
            " centred; use start 'steady'"
        )
