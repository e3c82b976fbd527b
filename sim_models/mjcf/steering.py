"""Motors in somebody's MuJoCo model: they push their armatures as their courses accelerate, and against what the
linkage does to them, and are put on their courses after each step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from analytic.kinematics.schedule import DriveMotion
from sim_models.mjcf.linkage import TheirLinkage

EFFORT_PASSES = 3  # at a state, until the motors' efforts are those of that state


class ModelSteering:
    """A linkage's motors, by position of their joints, from ``begin`` (s) of their clock on, in the model's own steps.

    ``lag`` (s) is how much older MuJoCo's velocities are than its positions.  Without motors nothing is put anywhere.
    """

    def __init__(
        self, link: TheirLinkage, motors: Sequence[DriveMotion] = (), begin: float = 0.0, lag: float = 0.0
    ) -> None:
        self.link, self.motors, self.begin, self.lag = link, motors, begin, lag
        self.step = float(link.model.opt.timestep)
        self.ways = np.array([one.way for one in link.held])
        self.zeros = np.array([one.zero for one in link.held])
        self.armature = link.armature[link.dofs]
        self.effort = self.felt = np.zeros(len(link.held))
        self.touched: Callable[[int], None] = lambda step: None  # told of each step in which geoms are near

    def at(self, steps: np.ndarray, order: int = 0, later: float = 0.0) -> np.ndarray:
        """Coordinates (N, motors) so many steps (N,), and ``later`` (s), after the begin; or their derivatives."""
        times = self.begin + self.step * steps + later
        found = [motor.positions(times, order) for motor in self.motors]
        turned = self.ways * np.array(found).reshape(len(self.motors), times.size).T
        return np.asarray(turned + self.zeros if order == 0 else turned)

    def start(self) -> None:
        """Compute all of MuJoCo's state at the begin, and hold against what the linkage does there."""
        self.effort = self.felt = self.look(0)

    def look(self, step: int) -> np.ndarray:
        """Compute all of MuJoCo's state so many steps after the begin; what the linkage does there against the motors
        (motors,), N.m or N.
        """
        m, d, effort = self.link.model, self.link.data, self.effort
        push = self.armature * self.at(np.array([float(step)]), 2)[0]
        for _ in range(EFFORT_PASSES if self.motors else 1):
            d.qfrc_applied[self.link.dofs] = push + effort
            mujoco.mj_forward(m, d)
            effort = effort + self.missed(push)
        return effort

    def missed(self, push: np.ndarray) -> np.ndarray:
        """What has kept the armatures (motors,) from accelerating as they were pushed, N.m or N."""
        return np.asarray(push - self.armature * self.link.data.qacc[self.link.dofs])

    def advance(self, first: int, last: int) -> None:
        """Take the steps from one number to another."""
        m, d, dofs = self.link.model, self.link.data, self.link.dofs
        if not self.motors:
            at_once = 1 if m.npair or m.geom_contype.any() or m.geom_conaffinity.any() else max(last - first, 1)
            for step in range(first, last, at_once):
                mujoco.mj_step(m, d, nstep=at_once)
                if d.ncon:
                    self.touched(step)
            return
        steps = np.arange(first, last, dtype=float)
        # what takes the velocity from where it is told at the begin of a step to where it is told at its end
        pushes = self.armature * self.at(steps, 2, self.step / 2 - self.lag)
        places, rates = self.at(steps + 1), self.at(steps + 1, 1, -self.lag)
        for step, push, place, rate in zip(range(first, last), pushes, places, rates, strict=True):
            d.qfrc_applied[dofs] = push + self.effort
            mujoco.mj_step(m, d)
            if d.ncon:
                self.touched(step)
            self.hold(self.effort + self.missed(push))
            d.qpos[dofs], d.qvel[dofs] = place, rate

    def hold(self, felt: np.ndarray) -> None:
        """Hold in the next step against what was ``felt`` in this one, as it goes on: what is left is of second order
        in the step.
        """
        self.effort, self.felt = 2.0 * felt - self.felt, felt
