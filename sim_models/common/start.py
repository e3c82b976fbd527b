"""Where a simulation begins and where it reports: poses of the assembled linkage, and times of the crank's angles.

The only analytic knowledge an engine is given is the assembly: a closed linkage to start from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from analytic.kinematics.assembly import Assembly
from sim_models.engine import Cause, Request, SimulationError, Unsupported

MOST_STEPS = 1_500_000  # of a run whose steps pass through Python or are all kept: a minute or two

Gaps = Callable[[float], Mapping[str, complex]]  # gap (m) of each joint, first pin minus second, at a crank angle


@dataclass(frozen=True)
class Pose:
    """A body's origin (m, ground frame, x + iy) and angle (rad), and their rates."""

    origin: complex
    angle: float
    velocity: complex = 0j
    angular_velocity: float = 0.0


AT_REST = Pose(0j, 0.0)  # the ground


def poses(assembly: Assembly, theta: float, speed: float = 0.0, gaps: Gaps = lambda theta: {}) -> dict[str, Pose]:
    """Pose of every moving body with the crank at theta (rad), turning at ``speed`` (rad/s).

    ``gaps`` may depend on the crank angle; rates are central differences over it (five points, 1e-3 rad).
    """
    here = _placed(assembly, theta, gaps)
    if speed == 0:
        return {name: Pose(origin, angle) for name, (origin, angle) in here.items()}
    h = 1e-3
    around = [_placed(assembly, theta + k * h, gaps) for k in (-2, -1, 1, 2)]
    result = {}
    for name, (origin, angle) in here.items():
        rate = [
            sum(w * side[name][i] for w, side in zip((1, -8, 8, -1), around, strict=True)) / (12 * h) * speed
            for i in (0, 1)
        ]
        result[name] = Pose(origin, angle, complex(rate[0]), float(np.real(rate[1])))
    return result


def _placed(assembly: Assembly, theta: float, gaps: Gaps) -> dict[str, tuple[complex, float]]:
    s = assembly.structure
    gap = {name: np.array([value]) for name, value in gaps(theta).items()}
    u = assembly.coordinates(np.array([theta]), gap)
    origins = s.origins @ assembly.columns(u, gap)
    angles = {b: u[i, 0] + s.held_at[b] for i, c in enumerate(s.coordinates) for b in c.bodies}
    return {name: (complex(origins[b, 0]), float(angles.get(b, s.held_at[b]))) for b, name in enumerate(s.bodies) if b}


@dataclass(frozen=True)
class Course:
    """A motor's prescribed motion: angle (rad), rate (rad/s) and acceleration (rad/s^2) at any time (s) of it."""

    spline: Any  # scipy's CubicSpline

    @classmethod
    def of(cls, request: Request) -> Course:
        """The course of a request.  Raises Unsupported where times, angles or reports do not make one."""
        name = request.mechanism.name
        if request.course is None or request.time is None or request.crank_angle.size:
            raise Unsupported(
                f"{name}: a course needs course = (times, angles), report times in time, and no crank_angle"
            )
        time, angle = (np.asarray(x, float) for x in request.course)
        if (
            time.ndim != 1
            or time.shape != angle.shape
            or time.size < 4
            or not np.all(np.diff(time) > 0)
            or not np.all(np.isfinite(angle))
        ):
            raise Unsupported(
                f"{name}: a course is at least four strictly increasing times with an angle each; it has {time.size}"
                " times"
            )
        report = np.asarray(request.time, float)
        if report.size == 0 or report.min() < time[0] or report.max() > time[-1]:
            raise Unsupported(
                f"{name}: reports are wanted outside the course, which lasts from {time[0]:g} to {time[-1]:g} s"
            )
        from scipy.interpolate import (
            CubicSpline,
        )  # here, because it takes a quarter of a second that most runs can do without

        return cls(CubicSpline(time, angle))

    def angle(self, time: float) -> float:
        """Angle (rad)."""
        return float(self.spline(time))

    def rate(self, time: float) -> float:
        """Angular velocity (rad/s)."""
        return float(self.spline(time, 1))

    def acceleration(self, time: float) -> float:
        """Angular acceleration (rad/s^2)."""
        return float(self.spline(time, 2))


@dataclass(frozen=True)
class Schedule:
    """When a driven run passes each requested crank angle, in the order in which it does."""

    order: np.ndarray  # (N,) indices into the request's angles
    theta: np.ndarray  # (N,) rad, in the order of passing
    time: np.ndarray  # (N,) s since the first of them
    speed: float  # rad/s


def schedule(request: Request) -> Schedule:
    """Times of a driven run's crank angles.  Raises Unsupported if the drive has no constant speed."""
    speed = request.mechanism.speed
    if speed is None:
        raise Unsupported(f"{request.mechanism.name}: the drive has no constant speed to run at")
    order = np.argsort(request.crank_angle if speed > 0 else -request.crank_angle, kind="stable")
    theta = request.crank_angle[order]
    return Schedule(order, theta, (theta - theta[0]) / speed, speed)


def substeps(interval: float, longest: float) -> tuple[int, float]:
    """Number and size (s) of equal steps, none longer than ``longest``, that make up an interval."""
    count = max(1, int(np.ceil(interval / longest - 1e-9)))
    return count, interval / count


def check_steps(who: str, time: float, longest: float, most: int = MOST_STEPS) -> None:
    """Raise SimulationError if a run of a time (s) in steps no longer than ``longest`` (s) would take too many.
    ``who`` runs what.
    """
    count = time / longest
    if not count <= most:
        raise SimulationError(
            f"{who}: {time:.3g} s would take {count:.2g} steps of {longest:.2g} s, and {most:g} are the most",
            Cause.TOO_MANY_STEPS,
        )
