"""Where a linkage is along the motion that its motors give it: over the angle of its crank, or over the time of several
courses.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.structure import Rest
from sim_models.common.contact_laws import longest
from sim_models.common.guide import opened
from sim_models.common.held import HeldPath
from sim_models.common.start import Pose, poses
from sim_models.engine import Request
from sim_models.exudyn.motor import RunMotor

if TYPE_CHECKING:
    from sim_models.exudyn.record import Record

Gaps = Mapping[str, complex | Rest]  # by joint: a pin's gap (m), first minus second, or where a block rests
NO_GAPS: Gaps = {}
GLIMPSES = 400  # instants of courses, at least, between which it is looked how fast they turn the bodies
ASIDE = 1e-3  # s, or rad or m of the fastest motor: from an instant to its neighbours, for rates


class Path(Protocol):
    """A motion, told by one number: a crank's angle (rad), or a run's time (s) on courses."""

    assembly: Assembly
    held: tuple[str, ...] | None  # joints whose positions it tells; None: the crank's

    @property
    def start(self) -> float:
        """Where on it the linkage is first closed."""

    def poses(self, at: float, gaps: Gaps = NO_GAPS) -> dict[str, Pose]:
        """Pose of every moving body with these gaps (m) of its joints, as if at rest.  Raises AssemblyError."""

    def moving(self, at: float, speed: float, gaps: Gaps = NO_GAPS) -> dict[str, Pose]:
        """The same with rates; ``speed`` (rad/s) is a crank's.  Raises AssemblyError."""

    def turned(self, record: Record, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Angles (rows,) rad that the ideal linkage's bodies have at some instants of a run.  Raises AssemblyError."""


def redundant(assembly: Assembly) -> bool:
    """Whether joints hold a linkage more than once, so that constraints say the same thing twice."""
    return any(group.surplus for group in assembly.structure.groups)


class CrankPath:
    """A crank that turns."""

    held: tuple[str, ...] | None = None

    def __init__(self, assembly: Assembly) -> None:
        self.assembly = assembly

    @property
    def start(self) -> float:
        """The assembly angle (rad)."""
        return self.assembly.start

    def poses(self, at: float, gaps: Gaps = NO_GAPS) -> dict[str, Pose]:
        """At a crank angle (rad)."""
        return self.moving(at, 0.0, gaps)

    def moving(self, at: float, speed: float, gaps: Gaps = NO_GAPS) -> dict[str, Pose]:
        """At a crank angle (rad) that changes at ``speed`` (rad/s)."""
        linkage, own = opened(self.assembly, gaps)
        return poses(linkage, at, speed, lambda _: own)

    def turned(self, record: Record, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Where the crank is as it was recorded."""
        crank = record.angle[self.assembly.mechanism.driven]
        found = [poses(self.assembly, float(crank[k])) for k in rows]
        return {name: np.array([each[name].angle for each in found]) for name in record.angle}


class CoursePath:
    """Joints that each follow a course, over the run's time (s); what else may move is where the assembly has it.

    Raises AssemblyError where the linkage cannot follow them.  ``top_speed`` is that of the body that turns fastest, in
    rad/s, or that goes fastest, in lengths of the longest body per second; of what moves freely it knows nothing.
    """

    steady: ClassVar[bool] = False

    def __init__(self, request: Request, assembly: Assembly) -> None:
        self.assembly, m, size = assembly, request.mechanism, longest(request.mechanism)
        courses, first = request.schedule.courses, request.schedule.begin
        self.motors = {
            name: RunMotor.of(motor, first, size if m.joint(name).prismatic else 1.0) for name, motor in courses.items()
        }
        self.still = {name: at for name, at in assembly.positions.items() if name not in courses}
        self.held: tuple[str, ...] | None = tuple(assembly.positions)
        self.knots = np.unique(np.concatenate([np.zeros(0), *(motor.path.x for motor in self.motors.values())]))
        self.top_speed = self._fastest(size, self.clock(request.schedule.time))

    @property
    def start(self) -> float:
        """Time (s) of the run when the courses begin, or what moves freely is let go."""
        return next((motor.begins for motor in self.motors.values()), 0.0)

    @property
    def end(self) -> float:
        """Time (s) of the run when the first of the courses ends."""
        return min((motor.end for motor in self.motors.values()), default=float("inf"))

    def clock(self, time: np.ndarray) -> np.ndarray:
        """Times of the run (s) at a request's (s)."""
        return next((motor.clock(time) for motor in self.motors.values()), time)

    def poses(self, at: float, gaps: Gaps = NO_GAPS) -> dict[str, Pose]:
        """At a time (s)."""
        origins, angles = self._placed(self._positions(np.array([at])), gaps)
        bodies = self.assembly.structure.bodies
        return {name: Pose(complex(origins[b, 0]), float(angles[b, 0])) for b, name in enumerate(bodies) if b}

    def moving(self, at: float, speed: float, gaps: Gaps = NO_GAPS) -> dict[str, Pose]:
        """At a time (s), by central differences along the motion (five points) that goes on as it does then."""
        rates = dict.fromkeys(self.still, 0.0) | {n: float(motor.rate(at)) for n, motor in self.motors.items()}
        h = ASIDE / max(1.0, *(abs(rate) for rate in rates.values()))
        times = h * np.arange(-2, 3)
        origins, angles = self._placed(
            {name: where[0] + rates[name] * times for name, where in self._positions(np.array([at])).items()}, gaps
        )
        weights = np.array([1, -8, 0, 8, -1]) / (12 * h)
        return {
            name: Pose(complex(origins[b, 2]), float(angles[b, 2]), complex(origins[b] @ weights), angles[b] @ weights)
            for b, name in enumerate(self.assembly.structure.bodies)
            if b
        }

    def turned(self, record: Record, rows: np.ndarray) -> dict[str, np.ndarray]:
        """At the recorded times, reached along the courses."""
        times = record.time[rows]
        way = self._way(times)
        _, angles = self._placed(self._positions(way), NO_GAPS)
        asked = np.searchsorted(way, times)
        return {name: angles[b, asked] for b, name in enumerate(self.assembly.structure.bodies) if b}

    def _positions(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """Position (N,) rad, m of every input's joint."""
        still = {name: np.full(times.size, where) for name, where in self.still.items()}
        return still | {name: motor.angle(times) for name, motor in self.motors.items()}

    def _placed(self, positions: Mapping[str, np.ndarray], gaps: Gaps) -> tuple[np.ndarray, np.ndarray]:
        """Origins (bodies, N) m, complex, and angles (bodies, N) rad."""
        inputs = self.assembly.inputs_at(positions)
        linkage, own = opened(self.assembly, gaps)
        gap = {name: np.full(inputs.shape[1], value) for name, value in own.items()}
        s, u = linkage.structure, linkage.coordinates(inputs, gap)
        angles = [u[list(turned)].sum(axis=0) + held for turned, held in zip(s.turned, s.held_at, strict=True)]
        return s.origins @ linkage.columns(u, gap), np.array(angles)

    def _way(self, times: np.ndarray) -> np.ndarray:
        """Times (s) between which the courses hardly bend: those asked for, the knots, and many more."""
        last = float(times.max())
        knots = self.knots[(self.knots >= self.start) & (self.knots <= last)]
        return np.unique(np.concatenate([times, knots, np.linspace(self.start, last, GLIMPSES)]))

    def _fastest(self, size: float, reports: np.ndarray) -> float:
        """The top speed up to the last report; where something moves freely, of the motors."""
        if self.still or reports.max() <= self.start:
            self.poses(self.start)
            return max((motor.top_speed for motor in self.motors.values()), default=0.0)
        times = self._way(reports)
        origins, angles = self._placed(self._positions(times), NO_GAPS)
        apart = np.diff(times)
        whole = apart > 0.1 * apart.max()  # over shorter ones differences are rounding
        ways = np.concatenate([np.abs(np.diff(origins)) / size, np.abs(np.diff(angles))])
        return float((ways[:, whole] / apart[whole]).max())


class RestingPath:
    """A linkage that its drives hold where their courses have them, told by the time (s) on these."""

    def __init__(self, request: Request, assembly: Assembly) -> None:
        self.assembly, self.along = assembly, HeldPath(request, assembly)
        self.held: tuple[str, ...] | None = self.along.names

    @property
    def start(self) -> float:
        """Time (s) of the first of them."""
        return self.along.begin

    def poses(self, at: float, gaps: Gaps = NO_GAPS) -> dict[str, Pose]:
        """At a time (s)."""
        return self.along.poses(at, gaps)

    def moving(self, at: float, speed: float, gaps: Gaps = NO_GAPS) -> dict[str, Pose]:
        """At a time (s), going on as the courses then do, the fastest drive at ``speed`` (rad/s, or lengths of the
        longest body per second).
        """
        return self.along.moving(at, speed, gaps)

    def turned(self, record: Record, rows: np.ndarray) -> dict[str, np.ndarray]:
        """At the recorded times."""
        return {name: angle for name, (_, angle) in self.along.place(record.time[rows]).items()}
