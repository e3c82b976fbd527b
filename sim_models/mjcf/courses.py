"""Runs of somebody's MuJoCo model whose joints follow courses, or that moves freely with more freedom than a crank."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from sim_models.common.failed_starts import own_start
from sim_models.common.travel import told_by, with_positions
from sim_models.engine import Request, SettingValue, Trace
from sim_models.mjcf.planar import Planar
from sim_models.mjcf.runs import BEND, SLOPE, STENCIL, TheirRun
from sim_models.mjcf.start import rest
from sim_models.mjcf.steering import Steering
from sim_models.run.path import CoursePath

WITHIN = 4.0  # the instants of a stencil lie no farther apart than a fourth of the time between knots
SIDE = float(STENCIL[-1] - STENCIL[-2])  # rad
HALVINGS = 8  # of a lead-in that is too long
FASTER = 1.5  # times its top speed: a course that is drawn out too far


class TheirCoursesRun(TheirRun):
    """A request with courses of its driven joints, or with none, where all moves freely.

    Raises AssemblyError where the linkage cannot follow them.
    """

    def __init__(self, name: str, request: Request, planar: Planar) -> None:
        super().__init__(name, request, planar)
        self.path = CoursePath(request, self.link.assembly)
        self.motors = [self.path.motors[one.joint] for one in self.link.held]
        knots = min((motor.knot_spacing for motor in self.motors), default=np.inf)
        # how fast (rad/s) the stencil of a crank's angles is passed, to be one of instants
        self.pace = max(self.path.top_speed, WITHIN * SIDE / knots) or 1.0

    def trace(self) -> Trace:
        """Run the request."""
        times = self.request.schedule.time
        with own_start(self.name, self.request, self.link.assembly):
            if self.request.schedule.at_rest:
                rows, how = self.held_at_rest(times)
            else:
                rows, how = self.along(times)
        trace = self.report(np.zeros(times.size), times, rows, how)
        trace = with_positions(self.request.mechanism, trace)
        return replace(trace, crank_angle=trace.signals[told_by(self.request.mechanism, self.link.assembly.structure)])

    def held_at_rest(self, times: np.ndarray) -> tuple[list[dict[str, float]], dict[str, SettingValue]]:
        """The equilibrium with the motors held where they are at each of the times (N,) s."""
        still, rows = np.zeros(self.model.nv), []
        for time in times.tolist():
            where = f"where its drives are at {time:.4g} s"
            self.found(rest(self.link, self.link.placed(self.path.poses(time)), still, still, 0.0), where)
            self.free_of_others(where)
            self.noted()
            rows.append(self.link.signals(still))
        return rows, {"step": None, "start": "equilibrium"}

    def along(self, times: np.ndarray) -> tuple[list[dict[str, float]], dict[str, SettingValue]]:
        """The motors move from the begin of their courses to the last of the times (N,) s: from a state without
        transients, or where something moves freely from closed loops.
        """
        lead = self.early() if self.path.held else 0.0
        begin = self.path.begin - lead
        state = self.steady_along(begin) if self.path.held else self.ideal_along(begin)[:2]
        rows = self.march(*state, times - begin, Steering(self.link, self.motors, begin, self.lag))
        start = "equilibrium" if self.path.held else "released"
        return rows, {"time_step": self.step, "start": start, "lead_in_time": lead}

    def early(self) -> float:
        """How long (s) before the courses' begin a run begins, on them drawn out backwards: until what its start has
        left in soft rows is gone, as far as motors then move no faster and the linkage can come from there.
        """
        longest = self.settling()
        return next((lead for lead in longest / 2.0 ** np.arange(HALVINGS) if self.can_come(lead)), 0.0)

    def can_come(self, lead: float) -> bool:
        """Whether the motors, and the linkage, can come from so long (s) before the courses' begin."""
        before = self.path.begin - lead * np.array([0.5, 1.0])
        for motor in self.motors:
            if np.abs(motor.positions(before, 1)).max() > FASTER * motor.top_speed:
                return False
        try:
            for time in before.tolist():
                self.path.poses(time - 2 * self.apart)
        except AssemblyError:
            return False
        return True

    def steady_along(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and velocities in which the motors pass a time (s) on their courses without transients."""
        q, v, _ = self.ideal_along(time)
        found = [rest(self.link, *self.ideal_along(time + x), self.lag) for x in self.apart * np.arange(-2, 3)]
        known = [each.q for each in found if each is not None]
        if len(known) < len(found):
            return q, v
        rate = SLOPE @ np.array(known) * self.pace
        rate[self.link.dofs] = v[self.link.dofs]
        return known[2], rate

    @property
    def apart(self) -> float:
        """Time (s) between the instants of the stencil."""
        return SIDE / self.pace

    def ideal_along(self, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coordinates, velocities and accelerations of the ideal linkage at a time (s), as if nothing moved freely."""
        q = np.array([self.link.placed(self.path.poses(time + x)) for x in self.apart * np.arange(-2, 3)])
        v, a = SLOPE @ q * self.pace, BEND @ q * self.pace**2
        steering = Steering(self.link, self.motors, time)
        v[self.link.dofs], a[self.link.dofs] = (steering.at(np.zeros(1), order)[0] for order in (1, 2))
        return q[2], v, a
