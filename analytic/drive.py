"""How a motor turns its crank: at a commanded speed, unevenly, along a measured course, through a springy transmission.

A crank on a spring lags its motor by torque / stiffness, where the torque depends on how the crank itself moves.  The
steady motion is the fixed point of that; it is found harmonic by harmonic where the crank turns fully, on a grid of
times elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from analytic.assembly import AssemblyError
from analytic.mechanism import Drive

HARMONICS = 40  # of a revolution, kept of a crank's lag
GRID = 256  # points of a revolution, or of a stretch of time
SETTLED = 1e-9  # rad
Torque = Callable[["Turning"], np.ndarray]


@dataclass(frozen=True)
class Turning:
    """A shaft's angle (rad), angular velocity (rad/s) and acceleration (rad/s^2); arrays (N,)."""

    theta: np.ndarray
    omega: np.ndarray
    alpha: np.ndarray


@dataclass(frozen=True)
class Motor:
    """A motor's motion at any time (s): command plus ripple, or a spline through a measured course."""

    speed: float = 0.0  # rad/s
    angle: float = 0.0  # rad at time 0
    drive: Drive | None = None
    course: CubicSpline | None = None

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

        ``torque`` gives the drive torque (N.m) that a motion of the crank needs; ``turns`` says that the crank turns fully.
        Raises AssemblyError where no steady motion is found (a resonance).
        """
        if stiffness is None:
            return self.at(time)
        if turns and self.course is None:
            return self._periodic(time, stiffness, torque)
        return self._stretch(time, stiffness, torque)

    def _periodic(self, time: np.ndarray, stiffness: float, torque: Torque) -> Turning:
        period = 2 * math.pi / abs(self.speed)
        grid = np.arange(GRID) * period / GRID
        motor = self.at(grid)
        order = np.arange(GRID // 2 + 1)
        rate = 1j * order * 2 * math.pi / period
        still = torque(Turning(motor.theta, motor.omega, np.zeros(GRID)))
        inertia = float(np.mean(torque(Turning(motor.theta, motor.omega, np.ones(GRID))) - still))
        own = stiffness + inertia * (rate**2).real  # what the mean inertia leaves of the stiffness, by harmonic
        lag = np.zeros(order.size, complex)
        for _ in range(60):
            back = [np.fft.irfft(lag * rate**n, GRID) for n in range(3)]
            needed = np.fft.rfft(torque(Turning(motor.theta - back[0], motor.omega - back[1], motor.alpha - back[2])))
            new = np.where(order <= HARMONICS, (needed + inertia * (rate**2).real * lag) / own, 0.0)
            change = float(np.abs(np.fft.irfft(new - lag, GRID)).max())
            lag = new
            if change < SETTLED:
                break
            if not change < 1e3:
                raise _no_steady_motion(stiffness)
        else:
            raise _no_steady_motion(stiffness)
        here = self.at(time)
        wave = np.exp(np.multiply.outer(time, rate[: HARMONICS + 1])) * np.where(order[: HARMONICS + 1] == 0, 1, 2) / GRID
        series = [(wave @ (lag * rate**n)[: HARMONICS + 1]).real for n in range(3)]
        return Turning(here.theta - series[0], here.omega - series[1], here.alpha - series[2])

    def _stretch(self, time: np.ndarray, stiffness: float, torque: Torque) -> Turning:
        grid = np.linspace(time.min(), time.max(), min(max(GRID, time.size), 8 * GRID)) if time.size > 3 else time
        motor, here = self.at(grid), self.at(time)
        spline: CubicSpline | None = None
        previous = np.zeros(grid.size)
        for _ in range(8):
            moved = [spline(grid, n) if spline else np.zeros(grid.size) for n in range(3)]
            lag = torque(Turning(motor.theta - moved[0], motor.omega - moved[1], motor.alpha - moved[2])) / stiffness
            change = float(np.abs(lag - previous).max())
            spline, previous = CubicSpline(grid, lag), lag
            if change < SETTLED:
                break
            if not change < 1e3:
                raise _no_steady_motion(stiffness)
        assert spline is not None
        return Turning(here.theta - spline(time), here.omega - spline(time, 1), here.alpha - spline(time, 2))


def _no_steady_motion(stiffness: float) -> AssemblyError:
    return AssemblyError(f"no steady motion of the crank on a drive.stiffness of {stiffness:g} N.m/rad was found; it is near a resonance")
