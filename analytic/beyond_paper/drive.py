"""How a motor turns its crank: at a commanded speed, unevenly, along a measured course, through a springy transmission.

A crank on a spring lags its motor by torque / stiffness, where the torque depends on how the crank itself moves.  The
steady motion is the fixed point of that; it is found as a Fourier series where the crank turns fully, on knots in time
elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Protocol

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.kinematics.schedule import Turning
from analytic.mechanism import Drive

POINTS = (
    127  # of a revolution at which a lag that repeats is sought; odd, so that every harmonic has a cosine and a sine
)
GRID = 256  # knots of a lag that does not repeat: at most four times as many
SETTLED = 1e-9  # rad
Torque = Callable[["Turning"], np.ndarray]


class Course(Protocol):
    """An angle (rad) over time (s), or its first or second derivative, as SciPy's splines are called."""

    def __call__(self, time: np.ndarray, order: int = 0, /) -> np.ndarray: ...


@dataclass(frozen=True)
class Motor:
    """A motor's motion at any time (s): command plus ripple, or a measured course."""

    speed: float = 0.0  # rad/s
    angle: float = 0.0  # rad at time 0
    drive: Drive | None = None
    course: Course | None = None

    def at(self, time: np.ndarray) -> Turning:
        """The motor at times (N,) s."""
        if self.course is not None:
            return Turning(self.course(time), self.course(time, 1), self.course(time, 2))
        command = self.angle + self.speed * time
        ripple = self.drive.ripple if self.drive is not None else None
        if ripple is None:
            return Turning(command, np.full_like(command, self.speed), np.zeros_like(command))
        a, h, turn = ripple.amplitude, ripple.harmonic, ripple.harmonic * command + ripple.phase
        slope = 1 + a * h * np.cos(turn)
        return Turning(command + a * np.sin(turn), self.speed * slope, -(self.speed**2) * a * h**2 * np.sin(turn))

    def crank(self, time: np.ndarray, stiffness: float | None, torque: Torque, turns: bool) -> Turning:
        """The crank at times (N,) s, behind a transmission of that stiffness (N.m/rad); None is rigid.

        ``torque`` gives the drive torque (N.m) that a motion of the crank needs; ``turns`` says that the crank turns
        fully. Raises AssemblyError where no steady motion is found (a resonance).
        """
        if stiffness is None:
            return self.at(time)
        if turns and self.course is None:
            return self._periodic(time, stiffness, torque)
        return self._stretch(time, stiffness, torque)

    def _periodic(self, time: np.ndarray, stiffness: float, torque: Torque) -> Turning:
        """The lag that repeats every revolution: Newton's method on its values at points of one, with Fourier
        derivatives.
        """
        period = 2 * math.pi / abs(self.speed)
        grid = np.arange(POINTS) * period / POINTS
        motor = self.at(grid)
        rate = 2j * math.pi * np.fft.fftfreq(POINTS, 1 / POINTS) / period
        first, second = (matrix / period**n for n, matrix in enumerate(_derivatives(), 1))
        lag = np.zeros(POINTS)

        def needed(back: np.ndarray, *nudge: float) -> np.ndarray:
            theta, omega, alpha = nudge or (0.0, 0.0, 0.0)
            return torque(
                Turning(
                    motor.theta - back + theta, motor.omega - first @ back + omega, motor.alpha - second @ back + alpha
                )
            )

        nudges = np.diag([1e-5, 1e-5 * abs(self.speed), 1e-5 * self.speed**2])
        for _ in range(20):
            now = needed(lag)
            by_theta, by_omega, by_alpha = ((needed(lag, *n) - now) / n.max() for n in nudges)
            matrix = (
                stiffness * np.eye(POINTS) + np.diag(by_theta) + by_omega[:, None] * first + by_alpha[:, None] * second
            )
            change = np.linalg.solve(matrix, now - stiffness * lag)
            lag = lag + change
            if not np.abs(lag).max() < math.pi:
                raise _no_steady_motion(stiffness)
            if np.abs(change).max() < SETTLED:
                break
        else:
            raise _no_steady_motion(stiffness)
        here, waves = self.at(time), np.fft.rfft(lag) / POINTS
        waves[1:] *= 2
        turns = np.exp(2j * math.pi * np.outer(time / period, np.arange(waves.size)))
        series = [(turns @ (waves * rate[: waves.size] ** n)).real for n in range(3)]
        return Turning(here.theta - series[0], here.omega - series[1], here.alpha - series[2])

    def _stretch(self, time: np.ndarray, stiffness: float, torque: Torque) -> Turning:
        """The lag that follows the torque without swinging, on knots too far apart for the crank to swing
        between them.
        """
        from scipy.interpolate import CubicSpline  # here: importing it takes a quarter of a second

        motor = self.at(time)
        still = Turning(motor.theta, motor.omega, np.zeros(time.size))
        inertia = float(np.abs(torque(Turning(motor.theta, motor.omega, np.ones(time.size))) - torque(still)).max())
        span = float(np.ptp(time))
        knots = min(4 * GRID, max(4, 1 + int(span / (5 * math.sqrt(inertia / stiffness)))))
        grid = np.linspace(time.min(), time.max() + 1e-9 * span, knots)
        motor, here = self.at(grid), self.at(time)
        spline = CubicSpline(grid, np.zeros(knots))
        for _ in range(30):
            back = [spline(grid, n) for n in range(3)]
            lag = torque(Turning(motor.theta - back[0], motor.omega - back[1], motor.alpha - back[2])) / stiffness
            change = float(np.abs(lag - back[0]).max())
            spline = CubicSpline(grid, lag)
            if change < SETTLED:
                break
            if not change < math.pi:
                raise _no_steady_motion(stiffness)
        return Turning(here.theta - spline(time), here.omega - spline(time, 1), here.alpha - spline(time, 2))


@cache
def _derivatives() -> tuple[np.ndarray, np.ndarray]:
    """Matrices (POINTS, POINTS) of the first and second Fourier derivative of values over a period of 1."""
    rate = 2j * math.pi * np.fft.fftfreq(POINTS, 1 / POINTS)
    unit = np.fft.fft(np.eye(POINTS), axis=0)
    return np.fft.ifft(unit * rate[:, None], axis=0).real, np.fft.ifft(unit * rate[:, None] ** 2, axis=0).real


def _no_steady_motion(stiffness: float) -> AssemblyError:
    return AssemblyError(
        f"no steady motion of the crank on a drive.stiffness of {stiffness:g} N.m/rad was found; it is near a resonance"
    )
