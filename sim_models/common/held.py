"""A linkage that all of its drives hold, at the times of their courses: poses at rest, and the way in which it goes on.

The way along the courses says which of its closures a pose is; nothing of it is left in an equilibrium but the
direction of each joint's motion, against which friction acts.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from analytic.kinematics.assembly import Assembly, Followed
from analytic.kinematics.structure import Rest
from sim_models.common.contact_laws import longest
from sim_models.common.guide import opened
from sim_models.common.start import Pose
from sim_models.engine import Request

ASIDE = 1e-3  # rad, or longest bodies, of the fastest drive: from a pose to its neighbours, for rates
BESIDE = np.arange(-2, 3)  # those neighbours
SLOPE = np.array([1, -8, 0, 8, -1]) / 12  # of the rate of the quartic through values there

NO_GAPS: Mapping[str, complex | Rest] = {}


class HeldPath:
    """Poses over the time (s) of courses, of a linkage in which nothing moves freely.

    ``begin`` (s) is where the courses begin, ``names`` are the driven joints.  Raises AssemblyError where the linkage
    cannot follow them up to the last report.
    """

    def __init__(self, request: Request, assembly: Assembly) -> None:
        self.assembly, self.schedule = assembly, request.schedule
        self.names = tuple(self.schedule.drives)
        size = longest(request.mechanism)
        self.scale = {name: size if request.mechanism.joint(name).prismatic else 1.0 for name in self.names}
        self.begin = self.schedule.begin
        self.times = self.schedule.until(self.schedule.time)
        self.way = assembly.follow(self._inputs(self.times)).coordinates

    def place(
        self, times: np.ndarray, gaps: Mapping[str, complex | Rest] = NO_GAPS, beside: np.ndarray | float = 0.0
    ) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Origin (N,) m, complex, and angle (N,) rad of every moving body at times (N,) s with these gaps (m) of its
        joints.  Raises AssemblyError.

        ``beside`` (N,) is how far each is taken on from there: 1 if the fastest drive moves by a radian, or by the
        longest body.
        """
        times = np.asarray(times, float)
        linkage, own = opened(self.assembly, gaps)
        s, near = linkage.structure, np.array([np.interp(times, self.times, row) for row in self.way])
        inputs = self._inputs(times) + beside * self.assembly.inputs_at(self.direction(times))
        gap = {name: np.full(times.size, value) for name, value in own.items()}
        u = linkage.coordinates(inputs, gap, Followed(near))
        origins = s.origins @ linkage.columns(u, gap)
        angles = [u[list(turned)].sum(axis=0) + held for turned, held in zip(s.turned, s.held_at, strict=True)]
        return {name: (origins[b], angles[b]) for b, name in enumerate(s.bodies) if b}

    def poses(self, at: float, gaps: Mapping[str, complex | Rest] = NO_GAPS, beside: float = 0.0) -> dict[str, Pose]:
        """Pose of every moving body at a time (s), as if at rest.  Raises AssemblyError."""
        placed = self.place(np.array([at]), gaps, beside)
        return {name: Pose(complex(origin[0]), float(angle[0])) for name, (origin, angle) in placed.items()}

    def moving(self, at: float, speed: float, gaps: Mapping[str, complex | Rest] = NO_GAPS) -> dict[str, Pose]:
        """The same, going on as the courses then do, the fastest drive at ``speed`` (rad/s, or longest bodies/s)."""
        placed = self.place(np.full(BESIDE.size, at), gaps, ASIDE * BESIDE)
        weights = SLOPE * speed / ASIDE
        return {
            name: Pose(complex(origin[2]), float(angle[2]), complex(origin @ weights), float(angle @ weights))
            for name, (origin, angle) in placed.items()
        }

    def direction(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """Rates (N,) of the drives as their courses have them at times (N,) s, the fastest one's being 1 (rad, or
        lengths of the longest body); 0 of those that stand.
        """
        rates = self.schedule.directions(times)
        fastest = np.max([np.abs(rate) / self.scale[name] for name, rate in rates.items()], axis=0)
        return {name: rate / np.where(fastest > 0, fastest, 1.0) for name, rate in rates.items()}

    def leading(self, times: np.ndarray) -> np.ndarray:
        """The crank's angle (N,) rad, or without a crank the position (rad, m) of the first input's joint, at times
        (N,) s.
        """
        s = self.assembly.structure
        return s.mechanism.crank_sign * self.schedule.positions(times)[s.coordinates[s.inputs[0]].joint]

    def stands(self, at: float) -> bool:
        """Whether all drives stand at a time (s)."""
        return not any(rate.any() for rate in self.direction(np.array([at])).values())

    def _inputs(self, times: np.ndarray) -> np.ndarray:
        """Inputs (n_inputs, N) at times (N,) s."""
        return self.assembly.inputs_at(self.schedule.positions(times))
