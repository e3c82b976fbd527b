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
from typing import Protocol, runtime_checkable

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.kinematics.schedule import Steady, Turning
from analytic.mechanism import Ripple

# of a revolution at which a lag that repeats is sought; odd, so that every harmonic has a cosine and a sine
LAG_POINTS = 127
MOST_LAG_KNOTS = 1024  # of a lag that does not repeat
MOTOR_LAG_SETTLED = 1e-9  # rad, of a step towards the lag: it is found
NUDGE = 1e-3  # of the fastest motion, by which speeds differ that tell how torque grows with speed
DRY = 1e-6  # of a torque, by which it may differ in a slow motion either way without dry friction
DriveTorque = Callable[[Turning], np.ndarray]  # N.m (N,) that a motion of the crank needs


class TimeFunction(Protocol):
    """A position (N,) rad, m over times (N,) s, or its first or second derivative, as SciPy's splines are called."""

    def __call__(self, time: np.ndarray, order: int = 0, /) -> np.ndarray: ...


@runtime_checkable
class Moved(TimeFunction, Protocol):
    """One that tells position, rate and acceleration (N,) together sooner than one after the other."""

    def moved(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...


@dataclass(frozen=True)
class Motor:
    """A motor's motion: at a constant speed, whose command a ripple may disturb, or along a course."""

    command: Steady | TimeFunction
    ripple: Ripple | None = None

    def at(self, time: np.ndarray) -> Turning:
        """The motor at times (N,) s."""
        course = self.command.positions if isinstance(self.command, Steady) else self.command
        if isinstance(course, Moved):
            command = Turning(*course.moved(time))
        else:
            command = Turning(course(time), course(time, 1), course(time, 2))
        if self.ripple is None:
            return command
        a, h = self.ripple.amplitude, self.ripple.harmonic
        turn = h * command.theta + self.ripple.phase
        slope = 1 + a * h * np.cos(turn)
        return Turning(
            command.theta + a * np.sin(turn), command.omega * slope, -(command.omega**2) * a * h**2 * np.sin(turn)
        )

    def crank(self, time: np.ndarray, stiffness: float | None, torque: DriveTorque, turns: bool) -> Turning:
        """The crank at times (N,) s, behind a transmission of that stiffness (N.m/rad); None is rigid.

        ``torque`` gives the drive torque (N.m) that a motion of the crank needs; ``turns`` says that the crank turns
        fully. Raises AssemblyError where no steady motion is found (a resonance).
        """
        if stiffness is None:
            return self.at(time)
        if turns and isinstance(self.command, Steady):
            return self._periodic(time, self.command.speed, stiffness, torque)
        return self._stretch(time, stiffness, torque)

    def _periodic(self, time: np.ndarray, speed: float, stiffness: float, torque: DriveTorque) -> Turning:
        """The lag that repeats every revolution: Newton's method on its values at points of one, with Fourier
        derivatives.
        """
        period = 2 * math.pi / abs(speed)
        grid = np.arange(LAG_POINTS) * period / LAG_POINTS
        motor = self.at(grid)
        rate = 2j * math.pi * np.fft.fftfreq(LAG_POINTS, 1 / LAG_POINTS) / period
        first, second = (matrix / period**n for n, matrix in enumerate(_derivatives(), 1))
        lag = np.zeros(LAG_POINTS)

        def needed(back: np.ndarray, *nudge: float) -> np.ndarray:
            theta, omega, alpha = nudge or (0.0, 0.0, 0.0)
            return torque(
                Turning(
                    motor.theta - back + theta, motor.omega - first @ back + omega, motor.alpha - second @ back + alpha
                )
            )

        nudges = np.diag([1e-5, 1e-5 * abs(speed), 1e-5 * speed**2])
        for _ in range(20):
            now = needed(lag)
            by_theta, by_omega, by_alpha = ((needed(lag, *n) - now) / n.max() for n in nudges)
            matrix = (
                stiffness * np.eye(LAG_POINTS)
                + np.diag(by_theta)
                + by_omega[:, None] * first
                + by_alpha[:, None] * second
            )
            change = np.linalg.solve(matrix, now - stiffness * lag)
            lag = lag + change
            if not np.abs(lag).max() < math.pi:
                raise _no_steady_motion(stiffness)
            if np.abs(change).max() < MOTOR_LAG_SETTLED:
                break
        else:
            raise _no_steady_motion(stiffness)
        here, waves = self.at(time), np.fft.rfft(lag) / LAG_POINTS
        waves[1:] *= 2
        turns = np.exp(2j * math.pi * np.outer(time / period, np.arange(waves.size)))
        series = [(turns @ (waves * rate[: waves.size] ** n)).real for n in range(3)]
        return Turning(here.theta - series[0], here.omega - series[1], here.alpha - series[2])

    def _stretch(self, time: np.ndarray, stiffness: float, torque: DriveTorque) -> Turning:
        """The crank whose lag follows the torque without swinging.

        Where a motor turns back, a crank with dry friction rests until the spring has gone from what one way asks for
        to what the other does: it plays between the lags of both (Krasnosel'skii and Pokrovskii 1989).
        """
        here, span = self.at(time), float(np.ptp(time))
        slow = 1e-12 * float(np.abs(here.omega).max())
        ways = [torque(Turning(here.theta, np.full(time.size, way), here.alpha)) for way in (-slow, slow)]
        inertia = torque(Turning(here.theta, here.omega, np.ones(time.size)))
        inertia -= torque(Turning(here.theta, here.omega, np.zeros(time.size)))
        faster = NUDGE * float(np.abs(here.omega).max()) * np.where(here.omega < 0, -1.0, 1.0)
        grows = torque(Turning(here.theta, here.omega + faster, here.alpha)) - torque(here)
        damping = np.divide(grows, faster, out=np.zeros(time.size), where=faster != 0)
        swings, creeps = (float(np.abs(each).max()) / stiffness for each in (inertia, damping))
        apart = max(5 * math.sqrt(swings), 8 * creeps, span / MOST_LAG_KNOTS)
        knots = min(MOST_LAG_KNOTS, max(4, 1 + int(span / apart)))  # too far apart to swing or creep between them
        grid = np.linspace(time.min(), time.max() + 1e-9 * span, knots)
        motor, moved = self.at(grid), np.interp(grid, time, inertia)

        def behind(way: float) -> Turning:
            """A crank that goes this way, however slowly; 0: either."""

            def needed(moving: Turning) -> np.ndarray:
                omega = way * np.maximum(way * moving.omega, slow) if way else moving.omega
                return torque(Turning(moving.theta, omega, moving.alpha))

            lag = _lag(motor, grid, needed, moved, stiffness)
            return Turning(here.theta - lag(time), here.omega - lag(time, 1), here.alpha - lag(time, 2))

        if np.abs(ways[1] - ways[0]).max() <= DRY * np.abs(ways).max():
            return behind(0.0)
        ahead, astern = behind(1.0), behind(-1.0)
        theta, low, high = [], ahead.theta.tolist(), astern.theta.tolist()
        rests = low[0] if here.omega[0] > 0 else high[0]
        for least, most in zip(low, high, strict=True):
            rests = max(least, min(most, rests))
            theta.append(rests)
        found = np.array(theta)
        along = [found == ahead.theta, found == astern.theta]  # elsewhere it rests
        rates = np.select(along, [ahead.omega, astern.omega]), np.select(along, [ahead.alpha, astern.alpha])
        return Turning(found, *rates)


def _lag(
    motor: Turning, grid: np.ndarray, torque: DriveTorque, inertia: np.ndarray, stiffness: float
) -> Callable[..., np.ndarray]:
    """The lag of a crank over time as a cubic spline at even times (N,) s, of a motor's motion and an inertia (N,)
    there.
    """
    from scipy.interpolate import CubicSpline  # here: importing it takes a quarter of a second

    spline = CubicSpline(grid, np.zeros(grid.size))
    for _ in range(30):
        back = [spline(grid, n) for n in range(3)]
        needed = torque(Turning(motor.theta - back[0], motor.omega - back[1], motor.alpha - back[2]))
        lag = _on_spline((needed + inertia * back[2]) / stiffness, inertia / stiffness, float(grid[1] - grid[0]))
        change = float(np.abs(lag - back[0]).max())
        spline = CubicSpline(grid, lag)
        if change < MOTOR_LAG_SETTLED:
            return spline
        if not change < math.pi:
            break
    raise _no_steady_motion(stiffness)


def _on_spline(given: np.ndarray, weight: np.ndarray, apart: float) -> np.ndarray:
    """Values y (N,) at even knots whose cubic spline obeys y + w y'' = given: the bends y'' of three neighbours are
    (y1 - 2 y2 + y3) / h^2 = (y1'' + 4 y2'' + y3'') / 6, those at the ends on a line with the next two.
    """
    from scipy.linalg import solve_banded

    share = weight / apart**2
    bands = np.zeros((5, given.size))  # of a matrix with two diagonals on either side
    bands[1, 2:], bands[2, 1:-1], bands[3, :-2] = 1 / 6 + share[2:], 2 / 3 - 2 * share[1:-1], 1 / 6 + share[:-2]
    bands[2, [0, -1]] = bands[0, 2] = bands[4, -3] = 1.0
    bands[1, 1] = bands[3, -2] = -2.0
    bent = np.concatenate([[0.0], np.diff(given, 2) / apart**2, [0.0]])
    return np.asarray(given - weight * solve_banded((2, 2), bands, bent))


@cache
def _derivatives() -> tuple[np.ndarray, np.ndarray]:
    """Matrices (LAG_POINTS, LAG_POINTS) of the first and second Fourier derivative of values over a period of 1."""
    rate = 2j * math.pi * np.fft.fftfreq(LAG_POINTS, 1 / LAG_POINTS)
    unit = np.fft.fft(np.eye(LAG_POINTS), axis=0)
    return np.fft.ifft(unit * rate[:, None], axis=0).real, np.fft.ifft(unit * rate[:, None] ** 2, axis=0).real


def _no_steady_motion(stiffness: float) -> AssemblyError:
    return AssemblyError(
        f"no steady motion of the crank on a drive.stiffness of {stiffness:g} N.m/rad was found; it is near a resonance"
    )
