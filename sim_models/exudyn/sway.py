"""The steady motion of a crank that a compliant drive turns over and over: the one that each revolution repeats.

The rigid linkage behind the drive has one freedom, whose drive torque is linear in the crank's acceleration and
quadratic in its speed.  Exudyn's equilibria give its coefficients around the revolution; a Fourier series solves
stiffness (motor - crank) = torque, resonant harmonics included.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from analytic.kinematics.assembly import AssemblyError
from sim_models.exudyn.equilibria import Equilibria
from sim_models.exudyn.linkage import Inertia
from sim_models.exudyn.motor import RunMotor

AROUND = 96  # crank angles at which the torque is sampled
GRID = 192  # instants of a revolution
SPEEDS = (0.9, 1.0, 1.1)  # of the mean speed, through whose torques goes a parabola
REPEATS = 1e-6  # rad, and of the mean speed and its square: how well a course has to repeat itself
FOUND = 1e-12  # rad
ATTEMPTS = 20


@dataclass(frozen=True)
class Sway:
    """A crank's repeating motion: how far (rad) it is behind its motor, over one period (s)."""

    lag: CubicSpline

    def behind(self, time: np.ndarray) -> np.ndarray:
        """Motor's angle minus the crank's (rad) at times (s)."""
        return np.asarray(self.lag(time))


def period(motor: RunMotor) -> float | None:
    """Time (s) of a revolution after which the motor's motion repeats itself; None if it does not.

    MuJoCo's motor compares rates instead: a step of the rate, which the series here smooths, sets its crank swaying.
    """
    if motor.steady:
        return 2 * math.pi / motor.top_speed if motor.top_speed else None
    end = motor.end
    turn = math.copysign(2 * math.pi, float(motor.angle(end) - motor.angle(0.0)))
    if (float(motor.angle(end) - motor.angle(0.0)) - turn) * turn < -REPEATS:
        return None
    beyond = [float((motor.angle(t) - motor.angle(0.0) - turn) * turn) for t in (0.0, end)]
    time = (
        end
        if beyond[1] <= 0
        else float(brentq(lambda t: float(motor.angle(t) - motor.angle(0.0) - turn), 0.0, end, xtol=1e-14))
    )
    speed = 2 * math.pi / time
    again = np.linspace(0.0, end - time, 50)
    if np.abs(motor.angle(again + time) - motor.angle(again) - turn).max() > REPEATS:
        return None
    return time if abs(float(motor.rate(time) - motor.rate(0.0))) < 1e3 * REPEATS * speed else None


def sway(equilibria: Equilibria, motor: RunMotor, stiffness: float) -> Sway | None:
    """The repeating motion behind a drive of that stiffness (N.m/rad); None where nothing repeats itself, or it is not
    found.
    """
    time = period(motor)
    if time is None or any(j.springy and _winds(equilibria, j.name) for j in equilibria.m.joints):
        return None
    try:
        coefficients = _coefficients(
            equilibria, math.copysign(2 * math.pi / time, float(motor.angle(time) - motor.angle(0.0)))
        )
    except AssemblyError:  # the crank does not turn fully
        return None
    grid = np.arange(GRID) * time / GRID
    rate = _fourier(GRID, time)
    angle, speed, acceleration = (motor.path(grid, n) for n in range(3))
    lag = np.zeros(GRID)
    for _ in range(ATTEMPTS):
        theta, omega, alpha = angle - lag, speed - rate @ lag, acceleration - rate @ (rate @ lag)
        (still, linear, square, inertia), slopes = coefficients(theta), coefficients(theta, 1)
        torque = still + linear * omega + square * omega**2 + inertia * alpha
        by_angle = slopes[0] + slopes[1] * omega + slopes[2] * omega**2 + slopes[3] * alpha
        by_rate = linear + 2 * square * omega
        change = np.linalg.solve(
            stiffness * np.eye(GRID) + np.diag(by_angle) + by_rate[:, None] * rate + inertia[:, None] * (rate @ rate),
            torque - stiffness * lag,
        )
        lag = lag + change
        if np.abs(change).max() < FOUND:
            return Sway(CubicSpline([*grid, time], [*lag, lag[0]], bc_type="periodic"))
    return None


def _coefficients(equilibria: Equilibria, speed: float) -> _Coefficients:
    """Torque (N.m) without motion, by speed, speed squared and acceleration, at every crank angle.  Raises
    AssemblyError.
    """
    m, assembly = equilibria.m, equilibria.path.assembly
    theta = assembly.start + 2 * np.pi * np.arange(AROUND) / AROUND
    places = [equilibria.path.poses(float(at)) for at in theta]
    once_more = equilibria.path.poses(float(theta[0] + 2 * np.pi))
    rate = _fourier(AROUND, 2 * np.pi)
    first: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    second: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for body in m.bodies:
        angle = np.array([place[body.name].angle for place in places])
        turns = round((once_more[body.name].angle - angle[0]) / (2 * np.pi))
        centre = np.array([place[body.name].origin for place in places]) + body.centre * np.exp(1j * angle)
        turning = rate @ (angle - turns * theta) + turns
        first[body.name] = rate @ centre, turning
        second[body.name] = rate @ (rate @ centre), rate @ turning
    rows = []
    for k, at in enumerate(theta):
        by_speed = [
            equilibria.at(float(at), _times(second, k, (s * speed) ** 2), s * speed).drive_torque[0] for s in SPEEDS
        ]
        square, linear, still = np.polyfit(np.array(SPEEDS) * speed, by_speed, 2)
        scale = speed**2
        accelerated = equilibria.at(float(at), _times(first, k, scale), SPEEDS[1] * speed).drive_torque[0]
        rows.append((still, linear, square, (accelerated - still - linear * speed) / scale))
    return _Coefficients(CubicSpline([*theta, theta[0] + 2 * np.pi], [*rows, rows[0]], bc_type="periodic"))


@dataclass(frozen=True)
class _Coefficients:
    around: CubicSpline

    def __call__(self, theta: np.ndarray, derivative: int = 0) -> np.ndarray:
        return np.asarray(self.around(theta, derivative)).T


def _times(rates: dict[str, tuple[np.ndarray, np.ndarray]], k: int, factor: float) -> Inertia:
    return Inertia(
        {b: complex(v[k]) * factor for b, (v, _) in rates.items()},
        {b: float(w[k]) * factor for b, (_, w) in rates.items()},
    )


def _fourier(n: int, span: float) -> np.ndarray:
    """Matrix (n, n), n even, from a periodic function's values, evenly over its period, to its derivative's."""
    k = np.arange(n)
    apart = k[:, None] - k
    return (
        np.where(apart == 0, 0.0, 0.5 * (-1.0) ** apart / np.tan(np.pi * apart / n + (apart == 0))) * 2 * np.pi / span
    )


def _winds(equilibria: Equilibria, joint: str) -> bool:
    """Whether a joint's spring winds up from one revolution to the next."""
    start = equilibria.path.begin
    try:
        before, after = (equilibria.path.poses(at) for at in (start, start + 2 * math.pi))
    except AssemblyError:
        return True
    turned = [
        after[body].angle - before[body].angle if body in after else 0.0 for body in equilibria.m.joint(joint).bodies
    ]
    return not equilibria.m.joint(joint).prismatic and abs(turned[1] - turned[0]) > math.pi
