"""What any request must be, whichever engine it is put to: where it reports, and what says how its crank moves."""

from __future__ import annotations

import math

import numpy as np

from analytic.kinematics.schedule import FEWEST_KNOTS
from analytic.kinematics.structure import structure
from sim_models.common.fading import slowed
from sim_models.engine import Request, Unsupported


def check_request(request: Request) -> None:
    """Raise Unsupported, saying what to give or to leave out, for a request that makes no run in any engine."""
    m, schedule = request.mechanism, request.schedule
    _check_links(request)
    _check_blocks(request)
    _check_bearings(request)
    _check_loads(request)
    _check_beyond(request)
    if m.initial and not (schedule.at_rest or schedule.rates):
        raise Unsupported(f"{m.name}: the schedule has no rates for its initial velocities; give it Schedule.rates")
    if schedule.turns_evenly:
        if not schedule.time.size:
            raise Unsupported(f"{m.name}: there is no crank angle to report at; give the schedule at least one")
    elif not schedule.time.size or (not np.all(schedule.time >= 0) and (schedule.lets_go or schedule.crank is None)):
        when = "a released linkage" if schedule.lets_go else "a motion over time"
        raise Unsupported(f"{m.name}: {when} needs times to report at, from 0 s on; they are {schedule.time}")
    elif schedule.crank is None:
        _check_courses(request)
    elif schedule.courses:
        _check_course(request)


def _check_beyond(request: Request) -> None:
    """Raise Unsupported where a run is to go on after its reports, or to be watched, that no crank's speed moves."""
    turned = request.schedule.turns_evenly and not request.schedule.at_rest
    if not turned and (request.beyond or request.watched):
        what = f"beyond = {request.beyond:g} rad" if request.beyond else "watched"
        raise Unsupported(
            f"{request.mechanism.name}: only a crank that turns at its drive's speed goes on beyond its reports, and is"
            f" watched; leave out {what}"
        )
    if not request.beyond >= 0:
        raise Unsupported(f"{request.mechanism.name}: beyond = {request.beyond:g} rad is negative; give 0 or more")


def _check_loads(request: Request) -> None:
    """Raise Unsupported for loads that oppose a motion that may come to rest, where nothing says what they are, and
    for loads over time in a run that has none."""
    m = request.mechanism
    if m.timed_load is not None and request.schedule.at_rest:
        raise Unsupported(
            f"{m.name}: the load on {m.timed_load.body!r} varies over time, which a run at rest has not; use motion"
            " 'driven', or give over = crank_angle"
        )
    load = next((load for load in m.loads if load.opposes), None)
    schedule = request.schedule
    swings = schedule.lets_go and schedule.crank is not None
    if load is not None and not swings and len(structure(m).inputs) > len(schedule.drives):
        raise Unsupported(
            f"{m.name}: opposes of the load on {load.body!r} needs a drive of each freedom, or a single crank that"
            " swings freely; leave it out, or give a joint friction_torque"
        )
    for load in (load for load in m.loads if load.opposes and swings):
        if math.inf in slowed(m, load):
            raise Unsupported(
                f"{m.name}: in a released run opposes of the load on {load.body!r} needs the body's inertia; give it"
                f" {'inertia (kg.m^2)' if m.moving[load.body].mass else 'a mass (kg)'}"
            )


def _check_bearings(request: Request) -> None:
    """Raise Unsupported for soft bearings of a released linkage, or where there is a massless link."""
    m = request.mechanism
    both = [name for name in request.clearances if name in m.soft_bearings]
    if request.schedule.lets_go and m.soft_bearings:
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
    m, schedule = request.mechanism, request.schedule
    driven = [joint.name for joint in m.motors]
    if sorted(schedule.drives) != sorted(driven):
        raise Unsupported(
            f"{m.name}: there are courses of {', '.join(schedule.drives) or 'no joint'}, and drives at"
            f" {', '.join(driven) or 'none'}; give each drive its course"
        )
    if schedule.at_rest and (loose := structure(m).free_joints):
        raise Unsupported(
            f"{m.name}: no drive holds joint {loose[0]!r} at rest; use motion 'driven', or give it a drive and a course"
        )
    crank = {"stiffness": m.drive_stiffness, "half_gap": m.half_gap, "periodic_torque": m.periodic_torque}
    for field, given in (crank | {"ripple": m.drives[0].ripple if m.drives else None}).items():
        if given:
            raise Unsupported(f"{m.name}: a drive follows a course of its own rigidly; leave out drive.{field}")
    _check_splines(request)


def _check_course(request: Request) -> None:
    """Raise Unsupported for a crank that is to follow a course and cannot."""
    drive = request.mechanism.drive
    if drive is None or drive.speed == "free":
        raise Unsupported(
            f"{request.mechanism.name}: only a drive that is not free follows a course; leave the course out of a"
            " released run"
        )
    if request.lead_in:
        raise Unsupported(
            f"{request.mechanism.name}: a course leads in by itself; leave out lead_in = {request.lead_in:g} rad"
        )
    _check_splines(request)


def _check_splines(request: Request) -> None:
    """Raise Unsupported where times and positions make no spline, or reports lie outside of it."""
    name, report = request.mechanism.name, request.schedule.time
    for course in request.schedule.courses.values():
        time, position = course.knots, course.values
        whole = time.ndim == 1 and time.shape == position.shape and time.size >= FEWEST_KNOTS
        if not (whole and np.all(np.diff(time) > 0) and np.all(np.isfinite(position))):
            raise Unsupported(
                f"{name}: a course is at least four strictly increasing times with a position each; it has"
                f" {time.size} times"
            )
        if report.min() < time[0] or report.max() > time[-1]:
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
