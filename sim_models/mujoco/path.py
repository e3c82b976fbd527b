"""Where a linkage is along the motion that its motors give it: over the angle of its crank, or over the time of several
courses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.structure import Rest
from sim_models.common.contact_laws import longest
from sim_models.common.guide import opened
from sim_models.common.held import HeldPath
from sim_models.common.start import Pose, poses
from sim_models.engine import Request

SIDE = 1e-4  # rad of a crank, or of the body that courses turn fastest, to where it goes next
GLIMPSES = 400  # instants of courses, at least, between which it is looked how fast they turn the bodies


Poses = dict[str, Pose]  # of every moving body
Gaps = Mapping[str, complex | Rest]  # by joint: a pin's gap (m), first minus second, or where a block rests


class Path(Protocol):
    """A motion, told by one number: a crank's angle (rad), or the time (s) on courses."""

    driven: tuple[str, ...] | None  # joints that follow courses, where these are not a crank's
    held: bool  # whether nothing is left to move freely

    def poses(self, at: float, gaps: Gaps | None = None) -> Poses:
        """Pose of every moving body with these gaps of its joints, as if at rest.  Raises AssemblyError."""

    def around(self, at: float) -> tuple[Poses, Poses] | None:
        """Where the ideal linkage comes from and where it goes, close by; None where it stands."""


class CrankPath:
    """A crank that turns: ``direction`` is its sign, 0 at rest."""

    driven: tuple[str, ...] | None = None
    held = True

    def __init__(self, assembly: Assembly, direction: float) -> None:
        self.assembly, self.direction = assembly, direction

    def poses(self, at: float, gaps: Gaps | None = None) -> Poses:
        """At a crank angle (rad)."""
        linkage, own = opened(self.assembly, gaps)
        return poses(linkage, at, gaps=lambda _: own)

    def around(self, at: float) -> tuple[Poses, Poses] | None:
        """At crank angles (rad) on either side."""
        if self.direction == 0:
            return None
        h = math.copysign(SIDE, self.direction)
        return self.poses(at - h), self.poses(at + h)


class CoursePath:
    """Joints that each follow a course; what else may move is where the assembly has it.  Raises AssemblyError where
    the linkage cannot follow them.

    ``top_speed`` is that of the body that turns fastest, in rad/s, or that goes fastest, in lengths of the longest
    body per second; of what moves freely it knows nothing.
    """

    def __init__(self, request: Request, assembly: Assembly) -> None:
        self.assembly, self.motors = assembly, request.schedule.courses
        self.driven: tuple[str, ...] | None = tuple(self.motors)
        self.held = len(assembly.positions) == len(self.motors)
        self.begin = request.schedule.begin
        self.top_speed = self._fastest(request)

    def poses(self, at: float, gaps: Gaps | None = None) -> Poses:
        """At a time (s)."""
        origins, angles = self._placed(np.array([at]), gaps or {})
        bodies = self.assembly.structure.bodies
        return {name: Pose(complex(origins[b, 0]), float(angles[b, 0])) for b, name in enumerate(bodies) if b}

    def around(self, at: float) -> tuple[Poses, Poses] | None:
        """At times (s) of which none is before: a motion that begins from rest has no other side."""
        return (self.poses(at), self.poses(at + SIDE / self.top_speed)) if self.top_speed else None

    def _placed(self, times: np.ndarray, gaps: Gaps) -> tuple[np.ndarray, np.ndarray]:
        """Origins (bodies, N) m, complex, and angles (bodies, N) rad at times (N,) s."""
        still = {name: np.full(times.size, where) for name, where in self.assembly.positions.items()}
        inputs = self.assembly.inputs_at(still | {name: motor.angles(times) for name, motor in self.motors.items()})
        linkage, own = opened(self.assembly, gaps)
        gap = {name: np.full(times.size, value) for name, value in own.items()}
        s, u = linkage.structure, linkage.coordinates(inputs, gap)
        angles = [u[list(turned)].sum(axis=0) + held for turned, held in zip(s.turned, s.held_at, strict=True)]
        return s.origins @ linkage.columns(u, gap), np.array(angles)

    def _fastest(self, request: Request) -> float:
        """The top speed up to the last report; where something moves freely, of the motors."""
        size, reports = longest(request.mechanism), request.schedule.time
        last = float(reports.max())
        if not self.held or last <= self.begin:
            self.poses(self.begin)
            slides = {joint.name for joint in request.mechanism.joints if joint.prismatic}
            own = [motor.top_speed / (size if name in slides else 1.0) for name, motor in self.motors.items()]
            return max(own, default=0.0)
        asked = np.unique(np.concatenate([reports, *(motor.knots for motor in self.motors.values())]))
        self._placed(asked[(asked >= self.begin) & (asked <= last)], {})
        times = np.linspace(self.begin, last, GLIMPSES)
        origins, angles = self._placed(times, {})
        ways = np.concatenate([np.abs(np.diff(origins)) / size, np.abs(np.diff(angles))])
        return float(ways.max() / (times[1] - times[0]))


class RestingPath:
    """A linkage that its drives hold where their courses have them, told by the time (s) on these."""

    held = True

    def __init__(self, request: Request, assembly: Assembly) -> None:
        self.along = HeldPath(request, assembly)
        self.driven: tuple[str, ...] | None = self.along.names

    def poses(self, at: float, gaps: Gaps | None = None) -> Poses:
        """At a time (s)."""
        return self.along.poses(at, gaps or {})

    def around(self, at: float) -> tuple[Poses, Poses] | None:
        """On either side of where it is at a time (s), as its drives then go on."""
        if self.along.stands(at):
            return None
        return self.along.poses(at, beside=-SIDE), self.along.poses(at, beside=SIDE)
