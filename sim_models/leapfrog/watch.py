"""Every step of a run of a :class:`~sim_models.leapfrog.bodies.LeapfrogWorld`, as the instants from which it started.

While the run lasts, an engine's own coordinates are kept; places and velocities follow from them afterwards, for all
instants at once.
"""

from __future__ import annotations

import numpy as np

from analytic.mechanism import MASS_CENTRE
from sim_models.common.track import Track
from sim_models.engine import Watched
from sim_models.leapfrog.bodies import LeapfrogWorld
from sim_models.leapfrog.parts import tracks
from sim_models.run.grid import StepGrid


class LeapfrogWatch:
    """What is kept of the (M,) steps of a grid from the first report on."""

    def __init__(self, world: LeapfrogWorld, grid: StepGrid) -> None:
        steps = np.arange(grid.lead, grid.last + 1)
        self.world = world
        self.time = grid.begin + grid.step * steps  # s, at which they start
        # (M + 1, n) the engine's own, there and after the last, velocities half a step before
        self.positions, self.velocities = np.zeros((2, steps.size + 1, world.velocities().size))
        self.forces = np.zeros((steps.size, len(world.loose)), complex)  # N, in joints with clearance
        self.corners = np.zeros((len(world.blocks), 4, steps.size))  # N, of walls on blocks
        self.torque = np.zeros(steps.size)  # N.m

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
        moved = self._tracks()
        centres = {name: track.at(self.world.points[name, MASS_CENTRE]) for name, track in moved.items()}
        return Watched(
            self.time,
            {name: place for name, (place, _, _) in centres.items()},
            {name: velocity for name, (_, velocity, _) in centres.items()},
            {name: track.angle for name, track in moved.items()},
            {name: track.spin for name, track in moved.items()},
            dict(zip(self.world.loose, self.forces.T, strict=True)),
            self.torque,
            dict(zip(self.world.blocks, self.corners, strict=True)),
        )

    def _tracks(self) -> dict[str, Track]:
        """Every moving body's, from the coordinates of its branch."""
        positions, rates = self.positions[:-1], (self.velocities[:-1] + self.velocities[1:]) / 2
        world = self.world
        columns = {branch.child: world.columns(branch.child) for branch in world.branches}
        motions = {body: (positions[:, own].T, rates[:, own].T) for body, own in columns.items()}
        every = tracks(world.points, world.branches, motions, Track.still(self.time.size))
        return {body.name: every[body.name] for body in world.mechanism.bodies}
