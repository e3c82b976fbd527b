"""Starts that fail: a contact too soft for its load, and poses that the run, not its request, asks of the linkage.

A run begins a little before its first crank angle, and with its pins where its loads press them.  A linkage that cannot
be assembled there is that run's failure.  One that cannot be assembled at the angles asked for is a fault of the
request.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import Mechanism
from sim_models.common.contact_laws import TOO_DEEP, contact_parameters, shortest_link
from sim_models.engine import CENTRED, Cause, Motion, Request, SimulationError

HIDING_GIVE = 0.5  # of the clearance: a contact that gives more may well be why there is no equilibrium
STIFF_GIVE = 0.1  # of the clearance: what a contact that is stiff enough gives
OVERHELD = ("leave out clearance: its loops hold more than they need, and its pins cannot lie just anywhere", CENTRED)
SAME_ANGLE = 1e-6  # rad: angles that are one and the same


class TooSoft(SimulationError):
    """Contact that gives by ``times`` its joint's clearance under the load of a start.

    The message is in the mechanism's units; :meth:`of` says the same of the same linkage in other units.
    """

    def __init__(self, who: str, mechanism: Mechanism, motion: Motion, joint: str, times: float, where: str) -> None:
        one = mechanism.joint(joint)
        clearance, stiffness = one.clearance, contact_parameters(mechanism, one, motion).stiffness
        super().__init__(
            f"{who}: contact too soft for this load: {times * clearance * stiffness:.3g} N press the {one.inner} of"
            f" joint {joint!r} {times * clearance:.3g} m into its {one.outer} {where} (clearance {clearance:g} m,"
            f" stiffness {stiffness:.3g} N/m)",
            Cause.TOO_SOFT,
            f"give joint {joint!r} contact_stiffness = {_rounded_up(times / STIFF_GIVE * stiffness):.1e} (N/m) or more,"
            " or a smaller load",
        )
        self.who, self.motion, self.joint, self.times, self.where = who, motion, joint, times, where
        self.mechanism = mechanism

    def __reduce__(self) -> tuple[Any, ...]:
        return TooSoft, (self.who, self.mechanism, self.motion, self.joint, self.times, self.where)

    def of(self, mechanism: Mechanism) -> TooSoft:
        """The same failure of the same linkage in other units."""
        return TooSoft(self.who, mechanism, self.motion, self.joint, self.times, self.where)


def _rounded_up(stiffness: float) -> float:
    """Two digits that are no less."""
    unit = 10.0 ** (math.floor(math.log10(stiffness)) - 1)
    return math.ceil(stiffness / unit) * unit


def check_stiff_enough(engine: str, request: Request, theta: float, forces: Mapping[str, float]) -> None:
    """Raise TooSoft where the ideal linkage's reactions (N) at a crank angle (rad) press a pin through its bearing."""
    m = request.mechanism
    for name, depth in _depths(request, forces).items():
        if not depth < TOO_DEEP * shortest_link(m, m.joint(name)):
            raise _too_soft(engine, request, theta, name, depth)


def why_no_equilibrium(
    engine: str, request: Request, theta: float, forces: Mapping[str, float]
) -> SimulationError | None:
    """TooSoft where contact that gives may be why no equilibrium was found under these reactions (N); None where it
    hardly gives.
    """
    m = request.mechanism
    times = {name: depth / m.joint(name).clearance for name, depth in _depths(request, forces).items()}
    worst = max(times, key=lambda name: times[name], default=None)
    if worst is None or times[worst] < HIDING_GIVE:
        return None
    return _too_soft(engine, request, theta, worst, times[worst] * m.joint(worst).clearance)


def _depths(request: Request, forces: Mapping[str, float]) -> dict[str, float]:
    """How far (m) each contact gives under its force (N)."""
    m = request.mechanism
    return {name: contact_parameters(m, m.joint(name), request.motion).give(force) for name, force in forces.items()}


def _too_soft(engine: str, request: Request, theta: float, joint: str, depth: float) -> TooSoft:
    m = request.mechanism
    return TooSoft(
        who(engine, request), m, request.motion, joint, depth / m.joint(joint).clearance, where(request, theta)
    )


def who(engine: str, request: Request) -> str:
    """What ran, as every failure begins."""
    return f"{engine} {request.joint_model} {request.motion} ({request.mechanism.name})"


def where(request: Request, theta: float) -> str:
    """A crank angle (rad) in words: one that was asked for, or one of the run's own; along courses, their start, and at
    rest on them a time (s).
    """
    schedule = request.schedule
    if schedule.crank is None:
        return f"at {theta:.4g} s" if schedule.at_rest else "at the start of its courses"
    here = f"at crank angle {np.degrees(theta):.4g} deg"
    asked = np.degrees(schedule.crank_angle) if schedule.crank_angle is not None else np.zeros(0)
    if asked.size == 0 or asked.min() - SAME_ANGLE <= np.degrees(theta) <= asked.max() + SAME_ANGLE:
        return here
    wanted = f"{asked[0]:.4g} deg" if asked.size == 1 else f"{asked.min():.4g} to {asked.max():.4g} deg"
    return f"{here}, where the run starts that was asked for {wanted}"


def no_start(
    engine: str, request: Request, cause: Cause, what: str, theta: float, remedy: str | tuple[str, ...] = ""
) -> SimulationError:
    """The error that says what went wrong at a crank angle (rad)."""
    return SimulationError(f"{who(engine, request)}: {what} {where(request, theta)}", cause, remedy)


@contextmanager
def own_start(engine: str, request: Request, assembly: Assembly) -> Iterator[None]:
    """Within this, a linkage that cannot be assembled raises SimulationError; AssemblyError at a crank angle, or along
    courses, that were asked for.
    """
    asked = _asked(request, assembly)
    if asked.size:
        assembly.coordinates(asked)
    try:
        yield
    except AssemblyError as error:
        raise SimulationError(
            f"{who(engine, request)}: the {'courses' if request.schedule.crank is None else 'angles'} asked for can be"
            " reached, but the run could not be started or held:"
            f" {error.what}",
            Cause.NO_START,
            OVERHELD if any(group.surplus for group in assembly.structure.groups) else "",
        ) from None


def _asked(request: Request, assembly: Assembly) -> np.ndarray:
    """Crank angles (rad) that a request names, the start of its lead-in among them, or inputs (n_inputs, N) along its
    courses; none of what moves freely.
    """
    schedule, m = request.schedule, request.mechanism
    if schedule.crank_angle is not None:
        theta, motor = schedule.crank_angle, request.motor
        return theta if motor is None else np.append(theta, motor.position(motor.begin))
    if assembly.left_free(schedule):
        return np.zeros(0)
    last = float(np.max(schedule.time))
    knots = np.unique(np.concatenate([course.knots for course in schedule.courses.values()]))
    times = np.union1d(schedule.time, knots[(knots >= schedule.begin) & (knots <= last)])
    return (
        schedule.crank_motion(m).positions(times) if schedule.crank else assembly.inputs_at(schedule.positions(times))
    )
