"""Where a linkage is along the motion that its motors give it: over the angle of its crank, or the time of courses.

The one thing of the analytic model that an engine is given is the assembly: where the bodies are at a place on this
path, with their joints' gaps taken up.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping

import numpy as np
from numpy.polynomial import Polynomial

from analytic.kinematics.assembly import Assembly, Walk
from analytic.kinematics.schedule import COURSE_INSTANTS, Course, DriveMotion, Steady
from analytic.kinematics.structure import BlockRest, Structure
from analytic.mechanism import Mechanism
from sim_models.common.contact_laws import longest
from sim_models.common.guide import opened
from sim_models.common.start import Pose
from sim_models.engine import Request

TURN_ASIDE = 1e-4  # rad of a crank, or of what turns fastest: to where the linkage comes from and goes
# rad, or longest bodies, of the fastest drive (s of one that is slower than 1/s): to neighbours, for rates
TURN_BESIDE = 1e-3
PLACES_BESIDE = np.arange(-2, 3)  # those neighbours
SLOPE_OF_QUARTIC = np.array([1, -8, 0, 8, -1]) / 12  # of the rate of the quartic through values there
FACED = 1e-3  # of a gap, by which it may still differ from that with which the direction of a motion was found
MOTOR_STANDSTILL = 1e-9  # of a course's largest rate or acceleration: nothing

Poses = dict[str, Pose]  # of every moving body
Placed = dict[str, tuple[np.ndarray, np.ndarray]]  # of every moving body: origin (N,) m, complex, and angle (N,) rad
Gaps = Mapping[str, complex | BlockRest]  # by joint: a pin's gap (m), first minus second, or where a block rests
NO_GAPS: Gaps = {}


class Path(ABC):
    """A motion, told by one number: a crank's angle (rad), or a time (s).

    ``driven`` are the joints that follow courses, None where a crank is turned; ``held`` says that nothing is left to
    move freely; ``begin`` is where the linkage is first closed.  All that places bodies raises AssemblyError.
    """

    driven: tuple[str, ...] | None = None
    held = True
    begin: float
    constant_speed = True  # nothing follows a course
    top_speed = 0.0
    knot_spacing = np.inf  # s

    def __init__(self, assembly: Assembly) -> None:
        self.assembly = assembly

    @abstractmethod
    def inputs(self, at: np.ndarray, beside: np.ndarray | float = 0.0) -> np.ndarray:
        """Inputs (n_inputs, N) at places (N,), each ``beside`` (N,) it by so much of what moves fastest."""

    def near(self, at: np.ndarray) -> Walk | None:
        """The ideal linkage's coordinates at places (N,), where more is known than the inputs say."""
        return None

    def placed(self, at: np.ndarray, gaps: Gaps = NO_GAPS, beside: np.ndarray | float = 0.0) -> Placed:
        """Every moving body at places (N,), with these gaps of its joints."""
        linkage, own = opened(self.assembly, gaps)
        gap = {name: np.full(at.size, value) for name, value in own.items()}
        return placed_at(linkage, self.inputs(at, beside), gap, self.near(at))

    def poses(self, at: float, gaps: Gaps = NO_GAPS, beside: float = 0.0) -> Poses:
        """Every moving body at a place, as if at rest."""
        placed = self.placed(np.array([at]), gaps, beside)
        return {name: Pose(complex(origin[0]), float(angle[0])) for name, (origin, angle) in placed.items()}

    def moving(self, at: float, speed: float, gaps: Gaps = NO_GAPS) -> Poses:
        """The same with rates; ``speed`` (rad/s, or longest bodies/s) is that of the crank, or the fastest drive."""
        if not speed:
            return self.poses(at, gaps)
        return in_motion(
            self.placed(np.full(PLACES_BESIDE.size, at), gaps, TURN_BESIDE * PLACES_BESIDE),
            speed / TURN_BESIDE,
        )

    def drive(self, joint: str, times: np.ndarray, order: int = 0) -> np.ndarray:
        """Position (N,) rad, m of a driven joint, or of the crank, at times (N,) s, or its derivative of that order; 0
        where nothing moves.
        """
        return np.zeros_like(times)

    def said(self, at: float) -> float:
        """What a message calls a place: a crank's angle (rad), or a time (s)."""
        return at

    def turned(self, at: np.ndarray) -> Placed:
        """The ideal linkage at places (N,), however it got there."""
        return self.placed(at)

    def around(self, at: float) -> tuple[Poses, Poses] | None:
        """Where the ideal linkage comes from and where it goes, close by; None where it stands."""
        return self.poses(at, beside=-TURN_ASIDE), self.poses(at, beside=TURN_ASIDE)


class CrankPath(Path):
    """A crank that turns; ``direction`` is its sign, 0 where it stands.  It may be let go, and then is not ``held``."""

    def __init__(self, assembly: Assembly, direction: float = 1.0, held: bool = True) -> None:
        super().__init__(assembly)
        self.direction, self.held, self.begin = direction, held, assembly.start

    @classmethod
    def of(cls, request: Request, assembly: Assembly) -> CrankPath:
        """That of a request, in the direction in which its run begins, or in which friction is to act at rest."""
        if request.schedule.lets_go:
            return cls(assembly, 0.0, held=False)
        motor = request.motor
        return cls(assembly, math.copysign(1.0, request.mechanism.speed or 1.0) if motor is None else direction(motor))

    def inputs(self, at: np.ndarray, beside: np.ndarray | float = 0.0) -> np.ndarray:
        """Crank angles (1, N) rad."""
        return np.atleast_2d(at + beside)

    def around(self, at: float) -> tuple[Poses, Poses] | None:
        """On either side of a crank angle (rad)."""
        if self.direction == 0:
            return None
        h = math.copysign(TURN_ASIDE, self.direction)
        return self.poses(at, beside=-h), self.poses(at, beside=h)


class MotorPath(Path):
    """A crank, told by the time (s) of its motor, which it may lag by a polynomial (rad) in time."""

    def __init__(
        self, assembly: Assembly, motor: DriveMotion, held: bool = True, lag: Polynomial | None = None
    ) -> None:
        super().__init__(assembly)
        self.motor, self.held, self.lag = motor, held, lag
        self.begin, self.top_speed, self.knot_spacing = motor.begin, motor.top_speed, motor.knot_spacing
        self.constant_speed = motor.constant_speed and lag is None

    @classmethod
    def of(cls, request: Request, assembly: Assembly) -> MotorPath:
        """That of a request whose crank moves; one that is let go as it then starts."""
        start = Steady(assembly.start, request.schedule.start_speed(request.mechanism))
        return cls(assembly, request.motor or start, held=not request.schedule.lets_go)

    def behind(self, lag: Polynomial) -> MotorPath:
        """The crank with such a lag (rad) in time (s)."""
        return MotorPath(self.assembly, self.motor, self.held, lag)

    def angles(self, times: np.ndarray, order: int = 0) -> np.ndarray:
        """Crank angles (N,) rad at times (N,) s, or their derivatives of that order."""
        angles = self.motor.positions(times, order)
        return angles if self.lag is None else angles - np.asarray(self.lag.deriv(order)(times))

    def inputs(self, at: np.ndarray, beside: np.ndarray | float = 0.0) -> np.ndarray:
        """Crank angles (1, N) rad."""
        return np.atleast_2d(self.angles(np.asarray(at, float)) + beside)

    def drive(self, joint: str, times: np.ndarray, order: int = 0) -> np.ndarray:
        """The crank's angles."""
        return self.angles(times, order)

    def said(self, at: float) -> float:
        """The crank's angle (rad)."""
        return float(self.angles(np.array([at]))[0])


class CoursePath(Path):
    """Joints that each follow a course, told by the time (s) of a clock that is ``ahead`` (s) of the schedule's; what
    else may move is where the assembly has it at the beginning, and goes on at the rate with which it is let go.

    ``top_speed`` is that of the body that turns fastest, in rad/s, or that goes fastest, in lengths of the longest body
    per second; of what moves freely it knows the beginning.
    """

    def __init__(self, request: Request, assembly: Assembly, ahead: float = 0.0) -> None:
        super().__init__(assembly)
        self.schedule, self.ahead = request.schedule, ahead
        self.motors: dict[str, Course] = self.schedule.courses
        self.driven = tuple(self.motors)
        self.constant_speed = not self.motors
        self.held = len(assembly.positions) == len(self.motors)
        self.let_go = {name: rate for name, rate in self.schedule.rates.items() if rate}
        self.begin = self.schedule.begin + ahead
        self.size = longest(request.mechanism)
        self.top_speed = self._fastest()
        self.knot_spacing = min((motor.knot_spacing for motor in self.motors.values()), default=np.inf)

    def inputs(self, at: np.ndarray, beside: np.ndarray | float = 0.0) -> np.ndarray:
        """Inputs (n_inputs, N) at times (N,) s; beside them all goes on as it does then."""
        time = np.asarray(at, float) - self.ahead
        where = {name: np.full(time.size, home) for name, home in self.assembly.positions.items()}
        where |= {n: where[n] + rate * (time - self.schedule.begin) for n, rate in self.let_go.items()}
        where |= self.schedule.positions(time)
        if np.any(beside):
            where |= {n: where[n] + rate * beside for n, rate in self.let_go.items()}
            where |= {n: where[n] + rate * beside for n, rate in self.schedule.positions(time, 1).items()}
        return self.assembly.inputs_at(where)

    def moving(self, at: float, speed: float = 0.0, gaps: Gaps = NO_GAPS) -> Poses:
        """At a time (s), at the rates that the drives then have."""
        rates = [float(rate[0]) for rate in self.schedule.positions(np.array([at - self.ahead]), 1).values()]
        apart = TURN_BESIDE / max(1.0, *map(abs, (*rates, *self.let_go.values(), 0.0)))
        return in_motion(self.placed(np.full(PLACES_BESIDE.size, at), gaps, apart * PLACES_BESIDE), 1.0 / apart)

    def around(self, at: float) -> tuple[Poses, Poses] | None:
        """At a time (s) and after it: a motion that begins from rest has no other side."""
        return (self.poses(at), self.poses(at + TURN_ASIDE / self.top_speed)) if self.top_speed else None

    def drive(self, joint: str, times: np.ndarray, order: int = 0) -> np.ndarray:
        """The course of a joint."""
        return self.motors[joint].positions(times - self.ahead, order)

    def turned(self, times: np.ndarray) -> Placed:
        """The ideal linkage at times (N,) s, reached along the courses."""
        way = self.schedule.until(times - self.ahead) + self.ahead
        rows, placed = np.searchsorted(way, times), self.placed(way)
        return {name: (origin[rows], angle[rows]) for name, (origin, angle) in placed.items()}

    def _fastest(self) -> float:
        """The top speed up to the last report; where something moves freely, of the motors."""
        last = float(self.schedule.time.max()) + self.ahead
        if not self.held or last <= self.begin:
            self.poses(self.begin)
            slides = {joint.name for joint in self.assembly.mechanism.joints if joint.prismatic}
            own = {name: motor.top_speed for name, motor in self.motors.items()} | self.let_go
            return max((abs(rate) / (self.size if name in slides else 1.0) for name, rate in own.items()), default=0.0)
        finest = max(motor.knots.size for motor in self.motors.values())
        times = np.linspace(self.begin, last, max(COURSE_INSTANTS, 2 * finest))
        self.placed(self.schedule.until(self.schedule.time) + self.ahead)
        placed = self.placed(times).values()
        ways = [
            np.abs(np.diff(part)) / size for both in placed for part, size in zip(both, (self.size, 1.0), strict=True)
        ]
        return float(np.max(ways) / (times[1] - times[0]))


class RestingPath(Path):
    """A linkage at rest that all of its drives hold where their courses have them, told by the time (s) on these.

    The way along the courses says which of its closures a pose is; nothing of it is left in an equilibrium but the
    direction of each joint's motion, against which friction acts.
    """

    def __init__(self, request: Request, assembly: Assembly) -> None:
        super().__init__(assembly)
        self.schedule = request.schedule
        self.driven = tuple(self.schedule.drives)
        size = longest(request.mechanism)
        self.scale = {name: size if request.mechanism.joint(name).prismatic else 1.0 for name in self.driven}
        self.begin = self.schedule.begin
        self.times = self.schedule.until(self.schedule.time)
        self.way = assembly.follow(assembly.inputs_at(self.schedule.positions(self.times))).coordinates

    def inputs(self, at: np.ndarray, beside: np.ndarray | float = 0.0) -> np.ndarray:
        """Inputs (n_inputs, N) at times (N,) s; a drive that stands stays where it is beside them."""
        here = self.assembly.inputs_at(self.schedule.positions(np.asarray(at, float)))
        return here + beside * self.assembly.inputs_at(self.direction(at)) if np.any(beside) else here

    def near(self, at: np.ndarray) -> Walk:
        """The coordinates that the way along the courses leads to."""
        return Walk(np.array([np.interp(at, self.times, row) for row in self.way]))

    def around(self, at: float) -> tuple[Poses, Poses] | None:
        """On either side of where it is at a time (s), as its drives then go on."""
        stands = not any(rate.any() for rate in self.direction(np.array([at])).values())
        return None if stands else super().around(at)

    def direction(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """Rates (N,) of the drives as their courses have them at times (N,) s, the fastest one's being 1 (rad, or
        lengths of the longest body); 0 of those that stand.
        """
        rates = self.schedule.directions(times)
        fastest = np.max([np.abs(rate) / self.scale[name] for name, rate in rates.items()], axis=0)
        return {name: rate / np.where(fastest > 0, fastest, 1.0) for name, rate in rates.items()}

    def leading(self, times: np.ndarray) -> np.ndarray:
        """The crank's angle (N,) rad, or without a crank the position (rad, m) of the first input's joint."""
        s: Structure = self.assembly.structure
        return s.mechanism.crank_sign * self.schedule.positions(times)[s.coordinates[s.inputs[0]].joint]


def seats(row: Mapping[str, float], pins: Iterable[str]) -> dict[str, complex]:
    """The gaps (m) of pins that a run's signals at one instant have."""
    return {name: complex(row[f"clearance_{name}_x"], row[f"clearance_{name}_y"]) for name in pins}


def faced(m: Mechanism, before: Mapping[str, complex], now: Mapping[str, complex]) -> bool:
    """Whether loads that oppose the motion at rest act against that of a linkage with these gaps (m)."""
    opposes = any(load.opposes for load in m.loads)
    return not opposes or all(abs(gap - before.get(name, 0j)) <= FACED * abs(gap) for name, gap in now.items())


def direction(motor: DriveMotion) -> float:
    """Sign of a motor's rate at its start, or of the rate to come; 0 where it stands."""
    if isinstance(motor, Steady):
        return math.copysign(1.0, motor.speed)
    leading = (motor.rate(motor.begin), motor.top_speed), (motor.acceleration(motor.begin), motor.peak(2))
    return next((math.copysign(1.0, x) for x, peak in leading if abs(x) > MOTOR_STANDSTILL * peak), 0.0)


def placed_at(
    linkage: Assembly, inputs: np.ndarray, gaps: Mapping[str, np.ndarray], near: Walk | None = None
) -> Placed:
    """Every moving body of a linkage at inputs (n_inputs, N), its pins off centre by gaps (N,) m.  Raises
    AssemblyError.
    """
    s, u = linkage.structure, linkage.coordinates(inputs, gaps, near)
    origins = s.origins @ linkage.columns(u, gaps)
    angles = [u[list(turned)].sum(axis=0) + held for turned, held in zip(s.turned, s.held_at, strict=True)]
    return {name: (origins[b], angles[b]) for b, name in enumerate(s.bodies) if b}


def assembled(assembly: Assembly) -> Poses:
    """Every moving body as the mechanism's file assembles it, at rest."""
    placed = placed_at(assembly, assembly.inputs[:, None], {})
    return {name: Pose(complex(origin[0]), float(angle[0])) for name, (origin, angle) in placed.items()}


def in_motion(around: Placed, per: float) -> Poses:
    """Poses of bodies at the middle of PLACES_BESIDE places, whose rates are differences by so much (1/s)."""
    weights = SLOPE_OF_QUARTIC * per
    return {
        name: Pose(complex(origin[2]), float(angle[2]), complex(origin @ weights), float(angle @ weights))
        for name, (origin, angle) in around.items()
    }
