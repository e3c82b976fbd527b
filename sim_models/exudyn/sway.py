"""The steady motion of a crank that a compliant drive turns over and over: the one that each revolution repeats.

The rigid linkage behind the drive has one freedom, whose drive torque is linear in the crank's acceleration and
quadratic in its speed.  Exudyn's equilibria give its coefficients around the revolution; a Fourier series solves
stiffness (motor - crank) = torque, resonant harmonics included.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism import Joint
from sim_models.exudyn.equilibria import LAST_CORRECTION, ExudynEquilibria
from sim_models.exudyn.linkage import Inertia
from sim_models.exudyn.motor import RunMotor
from sim_models.run.path import Path

TORQUE_SAMPLES = 96  # crank angles at which the torque is sampled
INSTANTS_OF_REVOLUTION = 192  # instants of a revolution
SPEEDS = (0.9, 1.0, 1.1)  # of the mean speed, through whose torques goes a parabola
REPETITION = 1e-6  # rad, and of the mean speed and its square: how well a course has to repeat itself
SWAY_PASSES = 20


def period(motor: RunMotor) -> float | None:
    """Time (s) of a revolution after which the motor's motion repeats itself; None if it does not.

    MuJoCo's motor compares rates instead: a step of the rate, which the series here smooths, sets its crank swaying.
    """
    if motor.steady:
        return 2 * math.pi / motor.top_speed if motor.top_speed else None
    end = motor.end
    turn = math.copysign(2 * math.pi, float(motor.angle(end) - motor.angle(0.0)))
    if (float(motor.angle(end) - motor.angle(0.0)) - turn) * turn < -REPETITION:
        return None
    beyond = [float((motor.angle(t) - motor.angle(0.0) - turn) * turn) for t in (0.0, end)]
    time = (
        end
        if beyond[1] <= 0
        else float(brentq(lambda t: float(motor.angle(t) - motor.angle(0.0) - turn), 0.0, end, xtol=1e-14))
    )
    speed = 2 * math.pi / time
    again = np.linspace(0.0, end - time, 50)
    if np.abs(motor.angle(again + time) - motor.angle(again) - turn).max() > REPETITION:
        return None
    return time if abs(float(motor.rate(time) - motor.rate(0.0))) < 1e3 * REPETITION * speed else None


def sway(equilibria: ExudynEquilibria, motor: RunMotor, stiffness: float) -> CubicSpline | None:
    """How far (rad) over time (s) a crank in its repeating motion is behind its motor, on a drive of that stiffness
    (N.m/rad); None where nothing repeats itself, or it is not found.
    """
    time = period(motor)
    if time is None:
        return None
    try:
        if any(j.springy and not j.prismatic and _winds(equilibria.path, j) for j in equilibria.m.joints):
            return None
        speed = math.copysign(2 * math.pi / time, float(motor.angle(time) - motor.angle(0.0)))
        coefficients = _coefficients(equilibria, speed)
    except AssemblyError:  # the crank does not turn fully
        return None
    grid = np.arange(INSTANTS_OF_REVOLUTION) * time / INSTANTS_OF_REVOLUTION
    rate = _fourier(INSTANTS_OF_REVOLUTION, time)
    angle, speed, acceleration = (motor.path(grid, n) for n in range(3))
    lag = np.zeros(INSTANTS_OF_REVOLUTION)
    for _ in range(SWAY_PASSES):
        theta, omega, alpha = angle - lag, speed - rate @ lag, acceleration - rate @ (rate @ lag)
        (still, linear, square, inertia), slopes = coefficients(theta).T, coefficients(theta, 1).T
        torque = still + linear * omega + square * omega**2 + inertia * alpha
        by_angle = slopes[0] + slopes[1] * omega + slopes[2] * omega**2 + slopes[3] * alpha
        by_rate = linear + 2 * square * omega
        change = np.linalg.solve(
            stiffness * np.eye(INSTANTS_OF_REVOLUTION)
            + np.diag(by_angle)
            + by_rate[:, None] * rate
            + inertia[:, None] * (rate @ rate),
            torque - stiffness * lag,
        )
        lag = lag + change
        if np.abs(change).max() < LAST_CORRECTION:
            return CubicSpline([*grid, time], [*lag, lag[0]], bc_type="periodic")
    return None


def _coefficients(equilibria: ExudynEquilibria, speed: float) -> CubicSpline:
    """Torque (N.m) without motion, by speed, speed squared and acceleration, over the crank's angle (rad).  Raises
    AssemblyError.
    """
    path, rate = equilibria.path, _fourier(TORQUE_SAMPLES, 2 * np.pi)
    around = path.begin + 2 * np.pi * np.arange(TORQUE_SAMPLES + 1) / TORQUE_SAMPLES
    theta, poses = around[:-1], [path.poses(at) for at in around.tolist()]
    velocity, spin, acceleration, spin_up = (dict[str, np.ndarray]() for _ in range(4))  # by the crank's angle
    for body in equilibria.m.bodies:
        origin, angle = (np.array([getattr(each[body.name], part) for each in poses]) for part in ("origin", "angle"))
        turns = round((angle[-1] - angle[0]) / (2 * np.pi))
        velocity[body.name] = rate @ (origin + body.centre * np.exp(1j * angle))[:-1]
        spin[body.name] = rate @ (angle[:-1] - turns * theta) + turns
        acceleration[body.name], spin_up[body.name] = rate @ velocity[body.name], rate @ spin[body.name]
    rows = []
    for k, at in enumerate(theta.tolist()):
        by_speed = [
            equilibria.at(at, Inertia.of(acceleration, spin_up, k, (s * speed) ** 2), s * speed).drive_torque[0]
            for s in SPEEDS
        ]
        square, linear, still = np.polyfit(np.array(SPEEDS) * speed, by_speed, 2)
        scale = speed**2
        accelerated = equilibria.at(at, Inertia.of(velocity, spin, k, scale), SPEEDS[1] * speed).drive_torque[0]
        rows.append((still, linear, square, (accelerated - still - linear * speed) / scale))
    return CubicSpline(around, [*rows, rows[0]], bc_type="periodic")


def _fourier(n: int, span: float) -> np.ndarray:
    """Matrix (n, n), n even, from a periodic function's values, evenly over its period, to its derivative's."""
    k = np.arange(n)
    apart = k[:, None] - k
    return (
        np.where(apart == 0, 0.0, 0.5 * (-1.0) ** apart / np.tan(np.pi * apart / n + (apart == 0))) * 2 * np.pi / span
    )


def _winds(path: Path, joint: Joint) -> bool:
    """Whether a revolute joint winds up from one revolution to the next.  Raises AssemblyError."""
    placed = path.placed(path.begin + np.array([0.0, 2 * math.pi]))
    first, second = (placed[body][1] if body in placed else np.zeros(2) for body in joint.bodies)
    return bool(abs(np.diff(second - first)[0]) > math.pi)
