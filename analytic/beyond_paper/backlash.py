"""Backlash between a motor and its crank: on which flank of its gap the crank lies, and how it flies to the other.

The crank lies ``half_gap`` behind its motor while the motor drives it, and as far ahead while it drives the motor.
Where the torque changes its sign nothing holds it: it moves freely until it has crossed the gap, or is back.  There it
stays (a plastic impact).  The free motion is reckoned about the motion without a gap, to first order in it, and mended
by the torque that this motion would still need.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from typing import TypeVar

import numpy as np

from analytic.beyond_paper.drive import DriveTorque, Motor
from analytic.kinematics.assembly import AssemblyError
from analytic.kinematics.schedule import Steady, Turning
from analytic.mechanism.parts import TINY

Amount = TypeVar("Amount", float, np.ndarray)  # one, or many (N,)
TORQUE_POINTS = 360  # of a revolution, at which the torque is taken
MOST_TORQUE_POINTS = 20_000  # of all
FIRST_ORDER_GAP = 1e-3  # rad, half of a gap for which first order is good enough
FLIGHT_STEP = 0.08  # of the time that a flight is likely to last, for a step
CHUNK = 16  # steps of a flight whose coefficients are taken at once
MOST_FLIGHTS = 50  # of a revolution: with more the crank hangs between its flanks
MOST_FLIGHT_STEPS = 1000  # steps of a flight: the crank then hangs in its gap
BISECTIONS = 40  # for the end of a flight
EARLY, LATE = 0.1, 0.5  # of a flight, before and after its end: a landing
TURNING_NUDGE = 1e-5  # rad; over the fastest rate, and its square, the same of rate and acceleration


@dataclass(frozen=True)
class Flight:
    """From one flank to another, or back: how far (rad) the crank is ``behind`` its motor, and the rate (rad/s) of
    that, at times (s).
    """

    times: np.ndarray
    behind: np.ndarray
    rates: np.ndarray
    missed: np.ndarray  # N.m, at the same times: torque that first order leaves out
    side: float  # of the flank where it ends: 1 where the motor drives, -1 where it is driven

    @property
    def begin(self) -> float:
        """Time (s) at which it leaves its flank."""
        return float(self.times[0])

    @property
    def end(self) -> float:
        """Time (s) at which it lands."""
        return float(self.times[-1])

    def at(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far behind, and its rate, at times (N,) s within."""
        k = np.clip(np.searchsorted(self.times, time, "right") - 1, 0, self.times.size - 2)
        h = self.times[k + 1] - self.times[k]
        return _hermite(
            (time - self.times[k]) / h, h, self.behind[k], self.behind[k + 1], self.rates[k], self.rates[k + 1]
        )


class Slack:
    """The crank in the gap of its drive, about ``base``: how it moves without one, at times (s).

    ``torque`` gives the drive torque (N.m) that a motion of the crank needs.  It is followed from ``first`` to ``last``
    (s), in which it makes so many ``turns``, and begins on a flank; or else it ``repeats`` itself every so often (s).
    """

    def __init__(
        self,
        base: Callable[[np.ndarray], Turning],
        torque: DriveTorque,
        half_gap: float,
        first: float,
        last: float,
        turns: float,
        repeats: bool,
    ) -> None:
        self.base, self.torque, self.half_gap, self.repeats = base, torque, half_gap, repeats
        count = min(MOST_TORQUE_POINTS, math.ceil(TORQUE_POINTS * max(1.0, turns)))
        self.step = (last - first) / count
        self.grid = first + np.arange(count + 1) * self.step
        from scipy.interpolate import CubicSpline  # here: importing it takes a quarter of a second

        values = _coefficients(base(self.grid), torque)
        if not (values[:, 3] > 0).all():
            raise AssemblyError("a crank without inertia has no motion in the gap of its drive")
        if repeats:  # a round begins with the largest torque, under which it lies on its flank
            values[-1] = values[0]
            start = int(np.argmax(np.abs(values[:, 0])))
            values = np.concatenate([values[start:-1], values[: start + 1]])
            self.grid = self.grid + start * self.step
        self.coefficients = CubicSpline(self.grid, values, bc_type="periodic" if repeats else "not-a-knot")
        self.loads = {side: side * values[:, 0] - values[:, 1] * half_gap for side in (1.0, -1.0)}
        self.side = 1.0 if self.loads[1.0][0] >= 0 else -1.0  # on which it begins
        self.flights = list(islice(self._follow(), math.ceil(MOST_FLIGHTS * max(1.0, turns))))

    @classmethod
    def behind(
        cls, motor: Motor, time: np.ndarray, stiffness: float | None, torque: DriveTorque, turns: bool, half_gap: float
    ) -> Slack:
        """The crank in half a gap (rad) behind a motor, over times (N,) s; else as :meth:`Motor.crank`."""
        first, last, repeats = float(time.min()), float(time.max()), False
        if turns and isinstance(motor.command, Steady):
            last, repeats = first + 2 * math.pi / abs(motor.command.speed), True
        begin, end = motor.at(np.array([first, last])).theta.tolist()

        def base(at: np.ndarray) -> Turning:
            return motor.crank(at, stiffness, torque, turns)

        return cls(base, torque, half_gap, first, last, abs(end - begin) / (2 * math.pi), repeats)

    def _follow(self) -> Iterator[Flight]:
        """All flights in their order."""
        now, side, begin = float(self.grid[0]), self.side, float(self.grid[0])
        while True:
            held = self.loads[side]
            later = max(0, math.ceil((now - begin) / self.step - 1e-9))
            lifted = held[later:] < 0
            k = later + int(np.argmax(lifted)) if lifted.any() else 0
            if not lifted.any():
                return
            share = held[k - 1] / (held[k - 1] - held[k]) if k and held[k - 1] > 0 else 0.0
            begin_of_flight = max(now, float(self.grid[max(k - 1, 0)]) + share * self.step)
            flight = self._flight(begin_of_flight, side)
            if self.half_gap > FIRST_ORDER_GAP:
                flight = self._flight(begin_of_flight, side, self._mended(flight))
            yield flight
            now, side = flight.end, flight.side

    def _mended(self, flight: Flight) -> Flight:
        """A flight with the torque (N.m) that its motion still needs."""
        base, (x, v, a) = self.base(flight.times), self._behind(flight, flight.times)
        return replace(flight, missed=self.torque(Turning(base.theta - x, base.omega - v, base.alpha - a)))

    def _behind(self, flight: Flight, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How far behind its motor (rad) the crank is in a flight at times (N,) s, with its first two rates."""
        x, v = flight.at(time)
        t, by_theta, by_omega, inertia = self.coefficients(time).T
        t = t + np.interp(time, flight.times, flight.missed)
        return x, v, (t - by_theta * x - by_omega * v) / inertia

    def _flight(self, begin: float, side: float, known: Flight | None = None) -> Flight:
        """The flight that begins on a flank at a time (s), with what a known one misses."""
        h, x, v = self._flight_step(begin), side * self.half_gap, 0.0
        path, c = [(x, v)], [[0.0]]
        for k in range(MOST_FLIGHT_STEPS):
            if k % CHUNK == 0:
                now = begin + h * (k + np.arange(2 * CHUNK + 1) / 2)
                values = self.coefficients(now)
                if known is not None:
                    values[:, 0] += np.interp(now, known.times, known.missed)
                c = values.tolist()
            j = 2 * (k % CHUNK)
            x, v = _step(x, v, h, c[j], c[j + 1], c[j + 2])
            path.append((x, v))
            if abs(x) >= self.half_gap:
                break
        times, (behind, rates) = begin + h * np.arange(len(path)), np.array(path).T
        landed = math.copysign(1.0, x)
        back_at_once = landed == side and len(path) == 2
        ends = abs(x) >= self.half_gap and not back_at_once
        share = _crossing(h, landed * self.half_gap, *path[-2], x, v) if ends else 1.0
        rates[-1] = _hermite(share, h, *behind[-2:], *rates[-2:])[1]
        times[-1], behind[-1] = times[-2] + share * h, np.clip(x, -self.half_gap, self.half_gap)
        missed = np.zeros(times.size) if known is None else np.interp(times, known.times, known.missed)
        return Flight(times, behind, rates, missed, landed)

    def _flight_step(self, begin: float) -> float:
        """A step (s) for a flight that begins at a time (s): a small share of what it is likely to last."""
        here, ahead = self.coefficients([begin, begin + self.step])
        slope, gap = abs(ahead[0] - here[0]) / self.step, self.half_gap * here[3]
        lasts = min((12 * gap / max(slope, TINY)) ** (1 / 3), (4 * gap / max(abs(here[0]), TINY)) ** (1 / 2))
        return min(self.step, FLIGHT_STEP * float(lasts))

    def _round(self, time: np.ndarray) -> np.ndarray:
        """Times (N,) s as those in the round that is followed."""
        first, last = self.grid[0], self.grid[-1]
        return first + np.mod(time - first, last - first) if self.repeats else time

    def at(self, time: np.ndarray) -> Turning:
        """The crank at times (N,) s."""
        base, now = self.base(time), self._round(time)
        x, v, a = np.full(time.shape, self.side * self.half_gap), np.zeros(time.shape), np.zeros(time.shape)
        for flight in self.flights:
            x[now >= flight.end] = flight.side * self.half_gap
            here = (now >= flight.begin) & (now < flight.end)
            if here.any():
                x[here], v[here], a[here] = self._behind(flight, now[here])
        return Turning(base.theta - x, base.omega - v, base.alpha - a)

    def landing(self, time: np.ndarray) -> np.ndarray:
        """Whether the crank is about to land, or has just done so, at times (N,) s: then it depends on what its flanks
        are made of how hard it is hit, and whether it bounces.
        """
        now, whole = self._round(time), float(self.grid[-1] - self.grid[0])
        landing = np.zeros(time.shape, bool)
        for flight in self.flights:
            lasted = flight.end - flight.begin
            for turn in (-whole, 0.0, whole) if self.repeats else (0.0,):
                since = now - flight.end - turn
                landing |= (since > -EARLY * lasted) & (since < LATE * lasted)
        return landing


def _coefficients(base: Turning, torque: DriveTorque) -> np.ndarray:
    """The torque (N, 4) along a motion, and its derivatives by angle, rate and acceleration."""
    rate = float(np.abs(base.omega).max()) or 1.0
    sizes = TURNING_NUDGE * np.array([1.0, rate, rate**2])
    shifts = np.vstack([np.zeros(3), np.diag(sizes)])
    beside = [
        np.add.outer(shift, x).ravel() for shift, x in zip(shifts.T, (base.theta, base.omega, base.alpha), strict=True)
    ]
    now, *there = torque(Turning(*beside)).reshape(4, -1)
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


def _hermite(s: Amount, h: Amount, x0: Amount, x1: Amount, v0: Amount, v1: Amount) -> tuple[Amount, Amount]:
    """Value and rate at a share s of a step h (s) with these values and rates at its ends, on a cubic."""
    bend, twist = 3 * (x1 - x0) - h * (2 * v0 + v1), 2 * (x0 - x1) + h * (v0 + v1)
    return x0 + s * (h * v0 + s * (bend + s * twist)), v0 + s * (2 * bend + 3 * s * twist) / h


def _crossing(h: float, level: float, x0: float, v0: float, x1: float, v1: float) -> float:
    """Share of a step h (s) at which such a cubic reaches a level that it has passed at the end."""
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        passed = abs(_hermite(middle, h, x0, x1, v0, v1)[0]) >= abs(level)
        low, high = (low, middle) if passed and middle > 0 else (middle, high)
    return high
