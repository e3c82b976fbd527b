"""The steady motion of a crank that a soft drive turns: the one that repeats itself with each revolution.

Equilibria beside each other give rates, and these inertia forces, only as far as the crank follows them at once.  On a
soft drive it also sways at a frequency of its own, which higher harmonics of the load excite for good; and where it
begins off that motion, it sways for ever.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from sim_models.common.start import check_steps, substeps
from sim_models.mujoco.model import MujocoLinkage
from sim_models.mujoco.motor import AlongCourse, AtConstantSpeed
from sim_models.mujoco.state import look, on_track, stiffest_law
from sim_models.run.path import CrankPath, direction

RETURNED = 5e-8  # rad: where it was, a revolution later
LAG_NUDGE = 1e-5  # rad
LAG_STEPS = 8
ANGLES_AROUND = np.arange(-2, 3) * 0.01  # rad, angles whose poses give the rates of an ideal linkage


def derivative(x: np.ndarray) -> np.ndarray:
    """Matrix (n, n) that differentiates the polynomial through values at x."""
    powers = np.arange(x.size)
    scale = np.abs(x).max()
    values = (x[:, None] / scale) ** powers
    slopes = powers[1:] * (x[:, None] / scale) ** (powers[1:] - 1) / scale
    return np.column_stack([np.zeros(x.size), slopes]) @ np.linalg.inv(values)


class Revolution:
    """One revolution of a motor, in ``period`` (s), and of the crank behind it, which begins with a lag of its own.

    A lag is (angle in rad, rate over ``sway``), motor less crank; ``sway`` (rad/s) is about the crank's own frequency.
    """

    def __init__(
        self, link: MujocoLinkage, assembly: Assembly, steering: AtConstantSpeed | AlongCourse, period: float
    ) -> None:
        self.link, self.assembly, self.steering = link, assembly, steering
        self.path = CrankPath(assembly)
        self.theta, self.speed = steering.stencil.start, steering.motor.rate(steering.motor.begin)
        check_steps(f"mujoco: {link.mechanism.name}, a revolution on its drive.stiffness", period, link.setting.step)
        self.count, self.step = substeps(period, link.setting.step)
        self.sway = stiffest_law(link, link.placed(self.path.poses(self.theta)))

    def repeats(self) -> bool:
        """Whether a revolution of the crank is possible, winds up no spring, and meets the same loads."""
        if self.link.mechanism.timed_load is not None:
            return False
        link, ends = self.link, self.theta + np.array([0.0, 2 * math.pi * direction(self.steering.motor)])
        try:
            self.assembly.coordinates(ends)
        except AssemblyError:
            return False
        first, last = (link.placed(self.path.poses(at)) for at in ends)
        springs = [link.between(j) for j in link.mechanism.joints if j.springy]
        return all(abs(float(form @ (last - first))) < 1.0 for form in springs)

    def state(self, lag: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates and velocities at the start."""
        link = self.link
        beside = np.array([link.placed(self.path.poses(at)) for at in self.theta - lag[0] + ANGLES_AROUND])
        q, v = beside[2], (derivative(ANGLES_AROUND) @ beside)[2] * (self.speed - lag[1] * self.sway)
        q[link.motor], v[link.motor] = self.theta, self.speed
        return q, v

    def lag(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The lag in this state."""
        link, crank = self.link, self.link.mechanism.driven
        return np.array(
            [
                q[link.motor] - link.fixed_angle[crank] - link.form[crank] @ q,
                (v[link.motor] - link.form[crank] @ v) / self.sway,
            ]
        )

    def after(self, lag: np.ndarray) -> np.ndarray:
        """The lag a revolution later."""
        m, d = self.link.model, self.link.data
        mujoco.mj_resetData(m, d)
        d.qpos[:], d.qvel[:] = self.state(lag)
        on_track(self.link)
        if self.link.loads:
            look(self.link)
        m.opt.timestep = self.step
        self.steering.turn(self.link, self.steering.motor.begin, self.count)
        return self.lag(d.qpos, d.qvel)

    def steady(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Coordinates and velocities of the motion that repeats itself, near these; None where none is found, as in a
        resonance.
        """
        lag, slope = self.lag(q, v), np.zeros((0, 2))
        for _ in range(LAG_STEPS):
            later = self.after(lag)
            if not np.all(np.isfinite(later)):
                return None
            if np.abs(later - lag).max() < RETURNED:
                return self.state(lag)
            if not slope.size:
                slope = np.array([(self.after(lag + nudge) - later) / LAG_NUDGE for nudge in LAG_NUDGE * np.eye(2)]).T
            try:
                lag = lag + np.linalg.solve(np.eye(2) - slope, later - lag)
            except np.linalg.LinAlgError:
                return None
        return None
