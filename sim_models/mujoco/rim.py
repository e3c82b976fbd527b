"""Journals in their bearings, through MuJoCo's contact solver.

Each joint's contact passes through Python in every step, and is therefore written straight into MuJoCo's memory.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import mujoco

from sim_models.engine import Cause, SimulationError

if TYPE_CHECKING:
    from sim_models.mujoco.model import MujocoLinkage


class Rim:
    """The rim of a joint's bearing: MuJoCo's ``contact`` of the journal with it, and where the places of both are.

    ``depth`` (m) is how far the journal was beyond its gap when it was last looked at; it touches from ``begins`` (m)
    off the middle on.
    """

    def __init__(self, link: MujocoLinkage, name: str, contact: mujoco.MjContact) -> None:
        first, second = link.sites[name]
        self.name, self.contact, self.depth = name, contact, 0.0
        self.clearance, self.reach = link.radii[name]
        self.begins = self.clearance - link.contacts[name].margin
        self._x, self._first, self._second = memoryview(link.data.site_xpos.reshape(-1)), 3 * first, 3 * second
        contact.pos, contact.frame = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        self._pos, self._frame = memoryview(contact.pos), memoryview(contact.frame)
        self._gap = 0.0, 0.0, 0.0

    def meets(self, always: bool = False) -> bool:
        """Look where the journal is; says whether it touches, or (``always``) would if it were pressed."""
        x, first, second = self._x, self._first, self._second
        gx, gy = x[first] - x[second], x[first + 1] - x[second + 1]
        r = math.hypot(gx, gy)
        self._gap, self.depth = (gx, gy, r), r - self.clearance
        return r > self.begins or (always and r > 0)

    def add(self, link: MujocoLinkage) -> None:
        """Add the contact where the journal was seen.  Raises SimulationError."""
        gx, gy, r = self._gap
        nx, ny = gx / r, gy / r
        x, pos, frame = self._x, self._pos, self._frame
        pos[0], pos[1] = x[self._second] + nx * self.reach, x[self._second + 1] + ny * self.reach
        frame[0], frame[1], frame[3], frame[4] = -nx, -ny, ny, -nx
        self.contact.dist = -self.depth
        if mujoco.mj_addContact(link.model, link.data, self.contact):
            where = f"mujoco: no room for the contact of joint {self.name!r}"
            raise SimulationError(where, Cause.FAULTY, "use fewer joints with clearance")
