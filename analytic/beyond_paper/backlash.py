"""Backlash between a motor and its crank: on which flank of its gap the crank lies, and how it flies to the other.

The crank lies ``half_gap`` behind its motor while the motor drives it, and as far ahead while it drives the motor.
Where the torque changes its sign nothing holds it: it moves freely until it has crossed the gap, or is back.  There it
stays (a plastic impact).  The free motion is reckoned to first order in the gap, about the motion without it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

if TYPE_CHECKING:
    from analytic.beyond_paper.drive import Turning

POINTS = 360  # of a revolution, at which the torque is taken
MOST = 20_000  # of all
CHUNK = 64  # steps of a flight whose coefficients are taken at once
EARLY, LATE = 0.1, 0.5  # of a flight, before and after its end: a landing
NUDGE = 1e-5  # rad; over the fastest rate, and its square, the same of rate and acceleration


@dataclass(frozen=True)
class Flight:
    """From one flank to another, or back: how far (rad) the crank is behind over time (s)."""

    behind: CubicHermiteSpline
    side: float  # of the flank where it ends: 1 where the motor drives, -1 where it is driven

    @property
    def begin(self) -> float:
        """Time (s) at which it leaves its flank."""
        return float(self.behind.x[0])

    @property
    def end(self) -> float:
        """Time (s) at which it lands."""
        return float(self.behind.x[-1])


class Slack:
    """The crank in the gap of its drive, about ``base``: how it moves without one, at times (s).

    ``torque`` gives the drive torque (N.m) that a motion of the crank needs.  With a ``period`` (s) all repeats itself;
    without one the crank begins at ``first`` (s), on a flank, and is followed to ``last`` (s).
    """

    def __init__(
        self,
        base: Callable[[np.ndarray], Turning],
        torque: Callable[[Turning], np.ndarray],
        half_gap: float,
        first: float,
        last: float,
        period: float | None,
    ) -> None:
        self.base, self.half_gap, self.first, self.period = base, half_gap, first, period
        span = last - first if period is None else period
        ends = base(np.array([first, first + span])).theta
        count = min(MOST, max(POINTS, math.ceil(POINTS * abs(ends[1] - ends[0]) / (2 * math.pi))))
        self.grid = first + np.arange(count + 1) * span / count
        values = _coefficients(base(self.grid), torque)
        if period is None:
            self.coefficients = CubicSpline(self.grid, values)
        else:  # two rounds: after the first one it does not matter how it began
            values[-1] = values[0]
            self.coefficients = CubicSpline(self.grid, values, bc_type="periodic")
            self.grid, values = np.append(self.grid, self.grid[1:] + period), np.concatenate([values, values[1:]])
        self.step = span / count
        self.loads = {side: side * values[:, 0] - values[:, 1] * half_gap for side in (1.0, -1.0)}
        self.flights, self.side = self._follow()

    def _follow(self) -> tuple[list[Flight], float]:
        """All flights in their order, and the side on which the crank begins."""
        side = begun = 1.0 if self.loads[1.0][0] >= 0 else -1.0
        flights: list[Flight] = []
        now = float(self.grid[0])
        while True:
            held = self.loads[side]
            later = max(0, math.ceil((now - self.grid[0]) / self.step - 1e-9))
            lifted = later + np.flatnonzero(held[later:] < 0)
            if not lifted.size:
                return flights, begun
            k = int(lifted[0])
            share = held[k - 1] / (held[k - 1] - held[k]) if k and held[k - 1] > 0 else 0.0
            flight = self._flight(max(now, float(self.grid[max(k - 1, 0)]) + share * self.step), side)
            if flight is None:
                return flights, begun
            flights.append(flight)
            now, side = flight.end, flight.side

    def _flight(self, begin: float, side: float) -> Flight | None:
        """The flight that begins on a flank at a time (s), None if its end is not seen."""
        gap, h = self.half_gap, self.step
        x, v = side * gap, 0.0
        times, path = [begin], [(x, v)]
        end = float(self.grid[-1])
        while begin < end:
            c = self.coefficients(begin + h / 2 * np.arange(2 * CHUNK + 1)).tolist()
            for k in range(CHUNK):
                x, v = _step(x, v, h, c[2 * k], c[2 * k + 1], c[2 * k + 2])
                times.append(begin + (k + 1) * h)
                path.append((x, v))
                if abs(x) < gap:
                    continue
                landed = math.copysign(1.0, x)
                curve = CubicHermiteSpline(times, *np.array(path).T)
                return Flight(_until(curve, landed * gap), landed)
            begin += CHUNK * h
        curve = CubicHermiteSpline(times, *np.array(path).T)
        return Flight(curve, side) if len(times) > 2 else None

    def at(self, time: np.ndarray) -> Turning:
        """The crank at times (N,) s."""
        base = self.base(time)
        now = time if self.period is None else self.first + self.period + np.mod(time - self.first, self.period)
        x, v, a = np.full(time.shape, self.side * self.half_gap), np.zeros(time.shape), np.zeros(time.shape)
        for flight in self.flights:
            x[now >= flight.end] = flight.side * self.half_gap
            here = (now >= flight.begin) & (now < flight.end)
            x[here], v[here] = flight.behind(now[here]), flight.behind(now[here], 1)
            t, by_theta, by_omega, inertia = self.coefficients(now[here]).T
            a[here] = (t - by_theta * x[here] - by_omega * v[here]) / inertia
        return type(base)(base.theta - x, base.omega - v, base.alpha - a)

    def landing(self, time: np.ndarray) -> np.ndarray:
        """Whether the crank is about to land, or has just done so, at times (N,) s: then it depends on what its flanks
        are made of how hard it is hit, and whether it bounces.
        """
        found = np.zeros(time.shape, bool)
        rounds = (0.0,) if self.period is None else (-self.period, 0.0, self.period)
        now = time if self.period is None else self.first + self.period + np.mod(time - self.first, self.period)
        for flight in self.flights:
            lasted = flight.end - flight.begin
            for turn in rounds:
                since = now - flight.end - turn
                found |= (since > -EARLY * lasted) & (since < LATE * lasted)
        return found


def _coefficients(base: Turning, torque: Callable[[Turning], np.ndarray]) -> np.ndarray:
    """The torque (N, 4) along a motion, and its derivatives by angle, rate and acceleration."""
    rate = float(np.abs(base.omega).max()) or 1.0
    sizes = NUDGE * np.array([1.0, rate, rate**2])
    shifts = np.vstack([np.zeros(3), np.diag(sizes)])
    beside = [
        np.add.outer(shift, x).ravel() for shift, x in zip(shifts.T, (base.theta, base.omega, base.alpha), strict=True)
    ]
    now, *there = torque(type(base)(*beside)).reshape(4, -1)
    return np.column_stack([now, *((each - now) / size for each, size in zip(there, sizes, strict=True))])


def _step(x: float, v: float, h: float, *stages: list[float]) -> tuple[float, float]:
    """One step of Runge and Kutta (s) of a free crank, with the coefficients at its begin, middle and end."""
    first, middle, last = stages

    def pushed(c: list[float], x: float, v: float) -> float:
        return (c[0] - c[1] * x - c[2] * v) / c[3]

    a1 = pushed(first, x, v)
    v2 = v + h / 2 * a1
    a2 = pushed(middle, x + h / 2 * v, v2)
    v3 = v + h / 2 * a2
    a3 = pushed(middle, x + h / 2 * v2, v3)
    v4 = v + h * a3
    a4 = pushed(last, x + h * v3, v4)
    return x + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def _until(curve: CubicHermiteSpline, level: float) -> CubicHermiteSpline:
    """A curve up to where it last reaches a level, in its last piece."""
    roots = curve.solve(level, extrapolate=False)
    roots = roots[roots > curve.x[-2]]
    end = float(roots[-1]) if roots.size else float(curve.x[-1])
    x = np.append(curve.x[:-1], end)
    return CubicHermiteSpline(x, np.append(curve(x[:-1]), level), curve(x, 1))
