"""How a crank moves, as its motor or behind it, or several joints, and the steps in which a run follows them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from numpy.polynomial import Polynomial

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import DriveMotion, Steady
from analytic.kinematics.structure import BlockRest
from sim_models.common.start import Pose, substeps
from sim_models.engine import Request
from sim_models.run.path import CoursePath, CrankPath, RestingPath

STENCIL = 1e-3  # rad of crank angle, for rates of positions and of the pins' equilibria
KNOT_SHARE = 0.125  # of the time between a course's knots: below it a course has nothing new to say
ON_GRID = 1e-6  # of a step: a report no farther from one is at it

Changes = Mapping[str, complex]  # by joint: a pin's gap (m); a block's height (m) and i times its tilt (rad)
NONE: Changes = MappingProxyType({})


@dataclass(frozen=True)
class Behind:
    """A crank that lags its motor by a polynomial (rad) in time (s)."""

    motor: DriveMotion
    lag: Polynomial

    constant_speed: ClassVar[bool] = False

    @property
    def top_speed(self) -> float:
        """The motor's largest angular velocity (rad/s), either way."""
        return self.motor.top_speed

    @property
    def knot_spacing(self) -> float:
        """Time (s) between the knots of the motor's course."""
        return self.motor.knot_spacing

    def position(self, time: float) -> float:
        """Angle (rad)."""
        return self.motor.position(time) - float(self.lag(time))

    def rate(self, time: float) -> float:
        """Angular velocity (rad/s)."""
        return self.motor.rate(time) - float(self.lag.deriv()(time))

    def acceleration(self, time: float) -> float:
        """Angular acceleration (rad/s^2)."""
        return self.motor.acceleration(time) - float(self.lag.deriv(2)(time))

    def positions(self, times: np.ndarray) -> np.ndarray:
        """Angles (N,) rad at times (N,) s."""
        return np.asarray(self.motor.positions(times) - self.lag(times))


Path = DriveMotion | Behind | CoursePath | RestingPath


def motion_of(request: Request, assembly: Assembly) -> DriveMotion | CoursePath | None:
    """What moves the linkage of a request that makes a run; None at rest, and where all of it moves freely.  Raises
    AssemblyError where a linkage cannot follow its courses.
    """
    if request.schedule.at_rest or request.schedule.lets_go:
        return None
    return request.motor if request.schedule.crank is not None else CoursePath(request, assembly)


def told_angle(path: Path, time: float) -> float:
    """A crank's angle (rad) at a time (s) of a path; of what is no crank NaN, and at rest that time."""
    if isinstance(path, RestingPath):
        return time
    return float("nan") if isinstance(path, CoursePath) else path.position(time)


def path_of(path: Path, joint: str) -> DriveMotion | Behind:
    """The path of one driven joint, which at rest goes nowhere."""
    if isinstance(path, RestingPath):
        return Steady(0.0)
    return path.motors[joint] if isinstance(path, CoursePath) else path


def duration(path: Path, angle: float, knots: float = KNOT_SHARE) -> float:
    """The time (s) in which a path turns by at most an angle (rad), and by at most a share of that between a course's
    ``knots``.
    """
    turning = angle / path.top_speed if path.top_speed else np.inf
    return min(turning, knots * path.knot_spacing)


def moving(
    assembly: Assembly, path: Path, time: float, gaps: Callable[[float], Changes] = lambda time: NONE
) -> dict[str, Pose]:
    """Pose of every moving body at a time (s) of a path, with gaps (m) that depend on the time.

    Rates are central differences in time (five points).
    """

    def at(moment: float) -> dict[str, Pose]:
        return still(assembly, path, moment, gaps(moment))

    here, apart = at(time), duration(path, STENCIL)
    if np.isinf(apart):
        return here
    around = [(weight / (12 * apart), at(time + k * apart)) for k, weight in ((-2, 1), (-1, -8), (1, 8), (2, -1))]
    return {
        name: Pose(
            pose.origin,
            pose.angle,
            sum((w * side[name].origin for w, side in around), 0j),
            sum(w * side[name].angle for w, side in around),
        )
        for name, pose in here.items()
    }


def still(assembly: Assembly, path: Path, time: float, gaps: Changes = NONE) -> dict[str, Pose]:
    """Pose of every moving body at a time (s) of a path, with these gaps (m), as if at rest.  Raises AssemblyError."""
    slides = {joint.name for joint in assembly.mechanism.joints if joint.prismatic}
    seats = {name: BlockRest(gap.real, gap.imag) if name in slides else gap for name, gap in gaps.items()}
    if isinstance(path, CoursePath | RestingPath):
        return path.poses(time, seats)
    return CrankPath(assembly).poses(path.position(time), seats)


def near(gaps: Changes, time: float, rate: Changes = NONE, bend: Changes = NONE) -> Callable[[float], Changes]:
    """Gaps (m) as a parabola in time about ``time`` (s), by their first two derivatives there."""
    return lambda t: {
        n: g + rate.get(n, 0j) * (t - time) + bend.get(n, 0j) * (t - time) ** 2 / 2 for n, g in gaps.items()
    }


@dataclass(frozen=True)
class Grid:
    """Equal steps from ``begin`` (s), and how reports between them follow from those around: a cubic through four.

    A step that changes spoils what an engine, which closes loops by the drift of the step before, makes of
    accelerations.
    """

    begin: float  # s
    step: float  # s
    lead: int  # steps before the first report
    nodes: np.ndarray  # (N, 4) steps whose beginnings a report is made of
    weights: np.ndarray  # (N, 4)
    beyond: int = 0  # steps after the last that a report needs

    @classmethod
    def of(cls, times: np.ndarray, begin: float, longest: float, early: bool, beyond: float = 0.0) -> Grid:
        """A grid of steps no longer than ``longest`` (s) for reports at times (N,) s, none before ``begin`` (s), that
        goes on ``beyond`` them (s).

        A grid that may begin up to a step ``early`` has a step at the first report, and at all that are equally far
        apart.
        """
        stops = np.unique(times)
        _, step = substeps(float(np.median(np.diff(stops))) if stops.size > 1 else longest, longest)
        lead = max(0, int(np.ceil((stops[0] - begin) / step - ON_GRID)))
        start = float(stops[0]) - lead * step if early else begin
        place = (times - start) / step
        close = np.abs(place - np.rint(place)) < ON_GRID
        place = np.where(close, np.rint(place), place)
        nodes = np.maximum(np.floor(place).astype(int) - 1, 0)[:, None] + np.arange(4)
        nodes = np.where(close[:, None], np.rint(place).astype(int)[:, None], nodes)
        weights = np.where(close[:, None], np.eye(4)[0], _lagrange(place - nodes[:, 0]))
        return cls(start, step, lead, nodes, weights, int(np.ceil(beyond / step - ON_GRID)))

    @property
    def reported(self) -> int:
        """The last step that a report needs."""
        return int(self.nodes.max())

    @property
    def last(self) -> int:
        """The last step."""
        return self.reported + self.beyond

    def rows(self, seen: Mapping[int, Mapping[str, float]]) -> list[dict[str, float]]:
        """Signals at the reports, from those at the steps."""
        names = list(seen[int(self.nodes[0, 0])])
        table = {k: np.array([row[name] for name in names]) for k, row in seen.items()}
        mixed = [
            sum(
                (w * table[k] for k, w in zip(nodes.tolist(), weights.tolist(), strict=True) if w), np.zeros(len(names))
            )
            for nodes, weights in zip(self.nodes, self.weights, strict=True)
        ]
        return [dict(zip(names, values.tolist(), strict=True)) for values in mixed]


def _lagrange(x: np.ndarray) -> np.ndarray:
    """(N, 4) weights of values at 0, 1, 2 and 3 in the cubic through them, at x (N,)."""
    return np.column_stack(
        [
            (1 - x) * (2 - x) * (3 - x) / 6,
            x * (2 - x) * (3 - x) / 2,
            x * (x - 1) * (3 - x) / 2,
            x * (x - 1) * (x - 2) / 6,
        ]
    )
