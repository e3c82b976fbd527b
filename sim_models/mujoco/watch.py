"""Every step of a run of a MuJoCo linkage, kept as plain arrays and put into the mechanism's words afterwards."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from analytic.mechanism.parts import TINY
from sim_models.common.track import Track
from sim_models.engine import Watched
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.state import wall_rows


class MujocoWatch:
    """Steps as they are taken: M instants, of which ``done`` are known.

    A step begins at an instant with the coordinates of that, and ends with velocities that semi-implicit Euler has half
    a step later, as those before were half a step earlier: what is between is the instant's.
    """

    def __init__(self, link: MujocoLinkage, begin: float, stages: Sequence[tuple[int, float]]) -> None:
        """A watch over (steps, their size in s) from a time (s) on."""
        ends = np.cumsum([0.0, *(count * step for count, step in stages)])
        steps = [at + step * np.arange(count) for at, (count, step) in zip(ends, stages, strict=False)]
        self.link, self.done, d = link, 0, link.data
        self._q, self._v, self._acceleration = d.qpos, d.qvel, d.qacc  # MuJoCo's own memory
        self.time = begin + np.concatenate([*steps, ends[-1:]])
        self.coordinates, self.before, self.after = np.zeros((3, self.time.size, link.model.nv))
        self.forces = np.zeros((len(link.contacts), 2, self.time.size))  # N, of each wall: normal, and along it
        self.corners = np.zeros((len(link.blocks), 4, self.time.size))  # N, of walls on blocks' corners
        self.rubbing = np.zeros_like(self.corners)  # N, of friction on them, along their guides
        self.pull = np.zeros(self.time.size)  # rad/s^2, of the motor's armature

    def begin(self) -> None:
        """Take in an instant, before its step."""
        self.coordinates[self.done], self.before[self.done] = self._q, self._v

    def end(self) -> None:
        """Take in what was between it and the next, after its step."""
        self.after[self.done] = self._v
        self._felt()

    def close(self, lag: float) -> None:
        """Take in the last instant, whose velocities are ``lag`` (s) older, of a linkage that was looked at."""
        self.begin()
        self.after[self.done] = self._v + 2 * lag * self._acceleration
        self._felt()

    def _felt(self) -> None:
        link = self.link
        rows = wall_rows(link)
        if rows:
            force = link.data.efc_force
            for j, name in enumerate(link.contacts):
                if (row := rows.get(name)) is not None:
                    self.forces[j, 0, self.done] = force[row]
                    if link.rubs[name]:
                        self.forces[j, 1, self.done] = force[row + 1]
            for j, block in enumerate(link.blocks.values()):
                for k in range(4):
                    if (row := rows.get(block.key(k))) is not None:
                        self.corners[j, k, self.done] = force[row]
                        if block.joint.rough:
                            self.rubbing[j, k, self.done] = block.guide.sides[k] * force[row + 1]
        self.pull[self.done] = self._acceleration[link.motor]
        self.done += 1

    def watched(self) -> Watched:
        """All of it."""
        link, m = self.link, self.link.model
        tracks = self._tracks()
        names = [body.name for body in link.mechanism.bodies]
        middles = {name: tracks[number].at(complex(*m.body_ipos[number, :2])) for name, number in link.body_id.items()}
        spin = (self.before + self.after) / 2
        forces = {}
        for name, (normal, along) in zip(link.contacts, self.forces, strict=True):
            pins = [tracks[m.site_bodyid[site]].at(complex(*m.site_pos[site, :2]))[0] for site in link.sites[name]]
            gap = pins[0] - pins[1]
            forces[name] = (normal + 1j * along) * gap / np.maximum(np.abs(gap), TINY)
        for block, pushed, rubbed in zip(link.blocks.values(), self.corners, self.rubbing, strict=True):
            first = block.joint.bodies[0]
            turned = link.fixed_angle[first] + self.coordinates @ link.form[first]
            across = 1j * block.joint.direction * np.exp(1j * turned)
            forces[block.joint.name] = block.guide.across(pushed) * across
            if block.joint.rough:
                forces[block.joint.name] = forces[block.joint.name] - 1j * across * rubbed.sum(axis=0)
        inertia = m.dof_armature[link.motor]
        if link.description.compliant:  # a shaft of its own
            inertia += m.body_inertia[m.body("drive:motor").id, 2]
        return Watched(
            self.time,
            {name: middles[name][0] for name in names},
            {name: middles[name][1] for name in names},
            {name: link.fixed_angle[name] + self.coordinates @ link.form[name] for name in names},
            {name: spin @ link.form[name] for name in names},
            forces,
            -inertia * self.pull,
            dict(zip(link.blocks, self.corners, strict=True)),
            {name: each for name, each in zip(link.blocks, self.rubbing, strict=True) if link.blocks[name].joint.rough},
        )

    def _tracks(self) -> list[Track]:
        """Every body of MuJoCo's, parents first: its frame on its parent's, moved by its joints one after the other."""
        m = self.link.model
        moved, rates = self.coordinates - m.qpos0, (self.before + self.after) / 2
        tracks = [Track.still(self.time.size)]
        for body in range(1, m.nbody):
            turn = 2 * np.arctan2(m.body_quat[body, 3], m.body_quat[body, 0])
            here = tracks[m.body_parentid[body]].carried(complex(*m.body_pos[body, :2]), 0j, turn)
            for joint in range(m.body_jntadr[body], m.body_jntadr[body] + m.body_jntnum[body]):
                if m.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
                    here = here.slid(complex(*m.jnt_axis[joint, :2]), moved[:, joint], rates[:, joint])
                else:
                    point = complex(*m.jnt_pos[joint, :2])
                    here = here.carried(point, point, moved[:, joint], rates[:, joint])
            tracks.append(here)
        return tracks
