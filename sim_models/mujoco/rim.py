"""Journals in their bearings, through MuJoCo's contact solver.

Each joint's contact passes through Python in every step, and is therefore written straight into MuJoCo's memory.

On a soft wall without friction the contact is of second order in the step h.  MuJoCo's row gives D (aref - a), with the
velocity of half a step ago in aref and the acceleration a of this instant: D = C h/2 makes C d' that of this instant,
too, and the force in the step in which it comes to its wall is a mean, as :mod:`sim_models.mujoco.striking` says.
"""

from __future__ import annotations

import math
from typing import cast

import mujoco
import numpy as np

from analytic.mechanism import Joint
from sim_models.engine import Cause, SimulationError
from sim_models.mujoco.laws import HARD, SOFT, WallContact, spring
from sim_models.mujoco.striking import mean_of_touch


def memory(values: np.ndarray) -> memoryview[float]:
    """The memory of values (N,) of MuJoCo's, one by one: three times as fast as through the array."""
    return cast("memoryview[float]", values.data)


class Rim:
    """The rim of a joint's bearing: MuJoCo's ``contact`` of the journal with it, and where the places of both are.

    ``depth`` (m) is how far the journal was beyond its gap when it was last looked at; it touches from ``begins`` (m)
    off the middle on.  ``second_order`` says whether its wall is.
    """

    def __init__(
        self,
        m: mujoco.MjModel,
        d: mujoco.MjData,
        joint: Joint,
        sites: tuple[int, int],
        law: WallContact,
        contact: mujoco.MjContact,
    ) -> None:
        self.name, self.contact, self.law, self._model, self._data = joint.name, contact, law, m, d
        self.clearance, self.reach = joint.clearance, joint.rim + joint.clearance
        self.begins = self.clearance - law.margin
        self.second_order = not (law.hard or law.named or joint.friction > 0)
        self.depth, self._gap = math.inf, (0.0, 0.0, 0.0)
        self._before, self._time = math.inf, math.nan
        self._x, self._first, self._second = memory(d.site_xpos.reshape(-1)), 3 * sites[0], 3 * sites[1]
        contact.pos, contact.frame = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        self._pos, self._frame = memory(contact.pos), memory(contact.frame)
        self.weight = float(m.body_invweight0[m.geom_bodyid[contact.geom], 0].sum())  # 1/kg, as MuJoCo reckons it
        self._step, self._part = m.opt.timestep, 1.0
        self._changes, self._ways = np.zeros((6, m.nv)), np.zeros(6)
        self._way = memory(self._ways)
        halves = zip((self._changes[:3], self._changes[3:]), sites, strict=True)
        self._seats = [(half, d.site_xpos[site], int(m.site_bodyid[site])) for half, site in halves]
        if self.second_order:
            self._harden(1.0)

    def meets(self, always: bool = False) -> bool:
        """Look where the journal is; says whether it touches, or (``always``) would if it were pressed."""
        if self.second_order and self._data.time != self._time:
            self._before, self._time = self.depth, self._data.time
        x, first, second = self._x, self._first, self._second
        gx, gy = x[first] - x[second], x[first + 1] - x[second + 1]
        r = math.hypot(gx, gy)
        self._gap, self.depth = (gx, gy, r), r - self.clearance
        return r > self.begins or (always and r > 0)

    def follow(self, row: int) -> None:
        """Have the row of a hard contact accelerate the journal from its rim as both go, not along straight lines.

        MuJoCo holds J a to its reference, and leaves out how J changes on the way (J' v): a journal that goes round at
        a speed would lie off its rim by that over the contact's stiffness.  Velocities are those of half a step ago,
        when J was another: what damping makes of that is taken back.
        """
        step = self._model.opt.timestep
        older = float(self._data.efc_KBIP[row, 1]) * step / 2
        self._data.efc_aref[row] += self.bend(step) * (1 - older)

    def bend(self, ago: float = 0.0) -> float:
        """How the journal accelerates towards the middle (m/s^2) if no joint does, but for its swing on the rim; with
        velocities of half a step ``ago`` (s), at this instant: J' v is bilinear in v.

        That swing is left to the wall's spring: reckoned with velocities of half a step ago it would grow.
        """
        gx, gy, r = self._gap
        for change, place, body in self._seats:
            mujoco.mj_jacDot(self._model, self._data, change, None, place, body)
        x = self._way
        x[0], x[1] = gx / r, gy / r
        x[3], x[4] = -x[0], -x[1]
        return float(self._ways @ self._changes @ (self._data.qvel + ago * self._data.qacc))

    def add(self) -> None:
        """Add the contact where the journal was seen.  Raises SimulationError."""
        gx, gy, r = self._gap
        nx, ny = gx / r, gy / r
        x, pos, frame = self._x, self._pos, self._frame
        pos[0], pos[1] = x[self._second] + nx * self.reach, x[self._second + 1] + ny * self.reach
        frame[0], frame[1], frame[3], frame[4] = -nx, -ny, ny, -nx
        self.contact.dist = -(self._share() if self.second_order else self.depth)
        if mujoco.mj_addContact(self._model, self._data, self.contact):
            where = f"mujoco: no room for the contact of joint {self.name!r}"
            raise SimulationError(where, Cause.FAULTY, "use fewer joints with clearance")

    def _share(self) -> float:
        """Let the wall be as hard as its share of this step; how deep (m) the journal is in it in the mean."""
        part, depth = 1.0, self.depth
        if self._before <= 0 < depth:
            depth, part = mean_of_touch(depth, depth / (depth - self._before))
        if part != self._part or self._model.opt.timestep != self._step:
            self._harden(part)
        return depth

    def _harden(self, part: float) -> None:
        """Give the row a part of the law's stiffness and damping."""
        self._part, self._step = part, self._model.opt.timestep
        virtual = self.weight * part * self.law.damping * self._step / 2  # mass, over the lightness
        impedance = min(max(virtual / (1 + virtual), SOFT), HARD)
        self.contact.solref, self.contact.solimp = spring(self.law, part * self.weight, impedance)
