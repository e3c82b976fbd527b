"""Every step of a run of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld`, as the instants from which it started.

While the run lasts, an engine's own coordinates are kept; places and velocities follow from them afterwards, for all
instants at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analytic.mechanism import GROUND, MASS_CENTRE
from sim_models.common.tree import Branch
from sim_models.engine import Watched
from sim_models.leapfrog.bodies import LeapfrogWorld
from sim_models.run.grid import Grid
from sim_models.run.track import Track


@dataclass(frozen=True)
class Watch:
    """What is kept of (M,) steps."""

    world: LeapfrogWorld
    time: np.ndarray  # s, at which they start
    positions: np.ndarray  # (M + 1, n) of the engine's own, there and after the last
    velocities: np.ndarray  # (M + 1, n) half a step before each, and after the last
    forces: np.ndarray  # (M, joints with clearance) N, complex
    corners: np.ndarray  # (blocks, 4, M) N, of walls on them
    torque: np.ndarray  # N.m

    @classmethod
    def of(cls, world: LeapfrogWorld, grid: Grid) -> Watch:
        """A watch over a grid's steps from the first report on."""
        steps = np.arange(grid.lead, grid.last + 1)
        positions, velocities = np.zeros((2, steps.size + 1, world.velocities().size))
        forces = np.zeros((steps.size, len(world.loose)), complex)
        corners = np.zeros((len(world.blocks), 4, steps.size))
        return cls(world, grid.begin + grid.step * steps, positions, velocities, forces, corners, np.zeros(steps.size))

    def begin(self) -> None:
        """Take in where the first step starts."""
        self._note(0)

    def add(self, k: int) -> None:
        """Take in the step that was just made, the k-th."""
        world = self.world
        self.forces[k] = [world.pin_forces[name] for name in world.loose]
        for corners, name in zip(self.corners, world.blocks, strict=True):
            for touch in world.touches[name]:
                corners[touch.corner, k] = abs(touch.force)
        self.torque[k] = world.effort() if world.held else world.motor_torque
        self._note(k + 1)

    def _note(self, k: int) -> None:
        self.positions[k], self.velocities[k] = self.world.positions(), self.world.velocities()
        if self.world.looks_back:
            self.world.before_observing()

    def watched(self) -> Watched:
        """All of it."""
        tracks = self._tracks()
        centres = {name: track.at(self.world.points[name, MASS_CENTRE]) for name, track in tracks.items()}
        return Watched(
            self.time,
            {name: place for name, (place, _) in centres.items()},
            {name: velocity for name, (_, velocity) in centres.items()},
            {name: track.angle for name, track in tracks.items()},
            {name: track.spin for name, track in tracks.items()},
            dict(zip(self.world.loose, self.forces.T, strict=True)),
            self.torque,
            dict(zip(self.world.blocks, self.corners, strict=True)),
        )

    def _tracks(self) -> dict[str, Track]:
        """Every moving body's, from the coordinates of its branch."""
        positions, rates = self.positions[:-1], (self.velocities[:-1] + self.velocities[1:]) / 2
        tracks = {GROUND: Track.still(self.time.size)}
        for branch in self.world.branches:
            own = self.world.columns(branch.child)
            tracks[branch.child] = self._track(branch, tracks[branch.parent], positions[:, own].T, rates[:, own].T)
        return {body.name: tracks[body.name] for body in self.world.mechanism.bodies}

    def _track(self, branch: Branch, base: Track, q: np.ndarray, v: np.ndarray) -> Track:
        """A body's track from its parent's and the coordinates (k, M) of its branch and their rates."""
        if branch.joint is None:
            return base.slid(1.0, q[0] + 1j * q[1], v[0] + 1j * v[1]).carried(0j, 0j, q[2], v[2])
        at, point = (self.world.points[body, branch.joint.name] for body in (branch.parent, branch.child))
        if branch.joint.prismatic:
            return base.carried(at, point, branch.fixed_angle).slid(branch.axis, q[0], v[0])
        return base.carried(at, point, q[0], v[0])
