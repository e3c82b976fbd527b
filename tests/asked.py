"""Requests and jobs as tests ask for them: at crank angles, along courses, or let go, in one line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from analytic.kinematics.schedule import Knots, Schedule
from analytic.mechanism import Mechanism
from compare.crosscheck import Job
from compare.judge.tolerances import Tolerances
from sim_models.engine import JointModel, Motion, Request


def scheduled(
    mechanism: Mechanism,
    motion: Motion = "driven",
    crank_angle: np.ndarray | None = None,
    time: np.ndarray | None = None,
    *,
    course: Knots | None = None,
    courses: Mapping[str, Knots] | None = None,
    start_speed: float = 0.0,
) -> Schedule:
    """Drives along ``courses`` by joint, a crank along a ``course`` or at angles (N,) rad, or else let go."""
    at_rest = motion == "static"
    if courses is not None:
        return Schedule.along(courses, np.zeros(0) if time is None else time, at_rest=at_rest)
    if course is not None and time is not None:
        return Schedule.of_crank(mechanism, course, time)
    if time is not None:
        return Schedule.released(mechanism, time, start_speed)
    return Schedule.at_angles(mechanism, np.zeros(0) if crank_angle is None else crank_angle, at_rest=at_rest)


def request_of(
    mechanism: Mechanism,
    joint_model: JointModel = "ideal",
    motion: Motion = "driven",
    crank_angle: np.ndarray | None = None,
    time: np.ndarray | None = None,
    *,
    course: Knots | None = None,
    courses: Mapping[str, Knots] | None = None,
    start_speed: float = 0.0,
    **options: Any,
) -> Request:
    """A request along such a schedule, with the other fields of a Request as options."""
    schedule = scheduled(mechanism, motion, crank_angle, time, course=course, courses=courses, start_speed=start_speed)
    return Request(mechanism, joint_model, schedule, **options)


def job_of(
    mechanism: Mechanism,
    simulators: Sequence[str],
    tolerances: Tolerances,
    motion: Motion = "driven",
    theta: np.ndarray | None = None,
    time: np.ndarray | None = None,
    *,
    courses: Mapping[str, Knots] | None = None,
    **options: Any,
) -> Job:
    """A cross-check along such a schedule, with the other fields of a Job as options."""
    schedule = scheduled(mechanism, motion, theta, time, courses=courses)
    return Job(mechanism, tuple(simulators), tolerances, schedule, **options)
