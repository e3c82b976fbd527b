"""Every step of a run of a MuJoCo linkage, kept as plain arrays and put into the mechanism's words afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from sim_models.engine import Watched
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.state import wall_rows

TINY = 1e-300  # m, in place of a gap of nothing


@dataclass(frozen=True)
class Place:
    """Where a body is (m, x + iy), its angle (rad), and their rates, at (M,) instants."""

    origin: np.ndarray
    angle: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray

    def at(self, point: complex) -> tuple[np.ndarray, np.ndarray]:
        """Place and velocity of a point in its frame."""
        arm = point * np.exp(1j * self.angle)
        return self.origin + arm, self.velocity + 1j * self.spin * arm


class Watch:
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
        places = self._places()
        names = [body.name for body in link.mechanism.bodies]
        middles = {name: places[number].at(complex(*m.body_ipos[number, :2])) for name, number in link.body_id.items()}
        spin = (self.before + self.after) / 2
        forces = {}
        for name, (normal, along) in zip(link.contacts, self.forces, strict=True):
            pins = [places[m.site_bodyid[site]].at(complex(*m.site_pos[site, :2]))[0] for site in link.sites[name]]
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

    def _places(self) -> list[Place]:
        """Every body of MuJoCo's, parents first: its frame on its parent's, moved by its joints one after the other."""
        m, still = self.link.model, np.zeros(self.time.size)
        moved, rates = self.coordinates - m.qpos0, (self.before + self.after) / 2
        places = [Place(still + 0j, still, still + 0j, still)]
        for body in range(1, m.nbody):
            base, turn = places[m.body_parentid[body]], 2 * np.arctan2(m.body_quat[body, 3], m.body_quat[body, 0])
            origin, velocity = base.at(complex(*m.body_pos[body, :2]))
            here = Place(origin, base.angle + turn, velocity, base.spin)
            for joint in range(m.body_jntadr[body], m.body_jntadr[body] + m.body_jntnum[body]):
                here = _moved(here, m, joint, moved[:, joint], rates[:, joint])
            places.append(here)
        return places


def _moved(here: Place, m: mujoco.MjModel, joint: int, q: np.ndarray, v: np.ndarray) -> Place:
    """A body moved by one of its joints, by q (M,) rad or m at a rate v (M,)."""
    if m.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
        along = complex(*m.jnt_axis[joint, :2]) * np.exp(1j * here.angle)
        velocity = here.velocity + (v + 1j * here.spin * q) * along
        return Place(here.origin + along * q, here.angle, velocity, here.spin)
    point = complex(*m.jnt_pos[joint, :2])
    anchor, carried = here.at(point)
    turned = Place(0j * here.origin, here.angle + q, 0j * here.origin, here.spin + v)
    arm, swung = turned.at(point)
    return Place(anchor - arm, turned.angle, carried - swung, turned.spin)
