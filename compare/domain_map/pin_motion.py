"""A pin's motion on its wall, step by step: compiled, and kept on disk.

The linkage is there by its reaction alone (:mod:`compare.domain_map.leaving`), which is linear between its crank
angles.  Runge and Kutta's fourth order; a step is a part of the pin's swing, or of its bounce.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit

SWING_STEPS = 6.0  # steps in a radian of a pin's swing along a rigid rim
BOUNCE_STEPS = 3.0  # steps in a radian of a pin's bounce on a wall that yields
LARGEST_TURN = 0.005  # rad of crank in a step, at most
NO_MOTION = 1e-300  # m^2


class CrankWay(NamedTuple):
    """The crank's way, from ``begin`` (rad) by ``turn`` (rad, signed) at ``speed`` (rad/s), and a joint's reaction.

    ``terms`` (7, n) complex are, at crank angles ``spacing`` (rad) apart from ``origin`` on, the ideal linkage's
    reaction F0 (N), and what it gains by x and y of the joint's gap (N/m), of the gap's rate (N.s/m) and of its
    acceleration (kg).
    """

    terms: np.ndarray
    origin: float
    spacing: float
    begin: float
    turn: float
    speed: float


class Wall(NamedTuple):
    """A wall that yields: stiffness (N/m), damping (N.s/m), and damping gained by depth (N.s/m^2)."""

    stiffness: float
    damping: float
    hysteresis: float


def _compiled(function: Callable[..., Any]) -> Any:
    try:
        return njit(cache=True)(function)
    except RuntimeError:  # no place to keep it
        return njit(function)


@_compiled
def _dot(a: Any, b: Any) -> Any:
    return a.real * b.real + a.imag * b.imag


@_compiled
def _at(way: CrankWay, theta: float) -> Any:
    """The terms (7,) at a crank angle (rad); beyond the last they go on as from the first."""
    n = way.terms.shape[1] - 1
    x = (theta - way.origin) / way.spacing
    i = math.floor(x)
    part, i = x - i, i % n
    return way.terms[:, i] * (1 - part) + way.terms[:, i + 1] * part


@_compiled
def _by(terms: Any, order: int, gap: complex) -> Any:
    """What the reaction (N) gains by the gap (order 0), its rate (1) or its acceleration (2)."""
    return terms[1 + 2 * order] * gap.real + terms[2 + 2 * order] * gap.imag


@_compiled
def _swung(terms: Any, clearance: float, angle: float, rate: float) -> Any:
    """Acceleration (rad/s^2) of a pin along its rim, the force (N) that holds it there, and its pace (1/s)."""
    outwards = complex(math.cos(angle), math.sin(angle))
    along = 1j * outwards
    rest = terms[0] + clearance * (
        _by(terms, 0, outwards) + rate * _by(terms, 1, along) - rate**2 * _by(terms, 2, outwards)
    )
    heavy = clearance * _by(terms, 2, along)
    push = -_dot(along, rest) / _dot(along, heavy)
    pace = math.sqrt(abs(terms[0]) / abs(_dot(along, heavy))) + abs(rate)
    return push, _dot(outwards, rest + push * heavy), pace


@_compiled
def on_a_rim(way: CrankWay, clearance: float, angle: float, rate: float) -> float:
    """Crank angle (rad) at which a pin leaves its rim, from an ``angle`` (rad) on, at a ``rate`` (rad/s); NaN: it
    stays.
    """
    time, end, speed = 0.0, way.turn / way.speed, way.speed
    while time < end:
        theta = way.begin + speed * time
        a, push, pace = _swung(_at(way, theta), clearance, angle, rate)
        if push < 0:
            return theta
        h = min(1 / (SWING_STEPS * pace), LARGEST_TURN / abs(speed))
        middle = _at(way, theta + speed * h / 2)
        b = _swung(middle, clearance, angle + rate * h / 2, rate + a * h / 2)[0]
        c = _swung(middle, clearance, angle + rate * h / 2 + a * h**2 / 4, rate + b * h / 2)[0]
        last = _at(way, theta + speed * h)
        d = _swung(last, clearance, angle + rate * h + b * h**2 / 2, rate + c * h)[0]
        angle += rate * h + (a + b + c) * h**2 / 6
        rate += (a + 2 * b + 2 * c + d) * h / 6
        time += h
    return math.nan


@_compiled
def _bounced(terms: Any, wall: Wall, clearance: float, gap: complex, drift: complex) -> Any:
    """Acceleration (m/s^2) of a gap on a wall that yields, and its pace (1/s)."""
    far = abs(gap)
    depth = far - clearance
    outwards = gap / far
    resisting = wall.damping + wall.hysteresis * max(depth, 0.0)
    force = max(0.0, wall.stiffness * depth + resisting * _dot(outwards, drift)) if depth > 0 else 0.0
    left = force * outwards - terms[0] - _by(terms, 0, gap) - _by(terms, 1, drift)
    x, y = terms[5], terms[6]  # M by columns
    area = x.real * y.imag - y.real * x.imag
    light = area / (x.real + y.imag)  # nearly the smaller mass
    pace = math.sqrt(wall.stiffness / abs(light)) + resisting / abs(light)
    return complex(left.real * y.imag - left.imag * y.real, left.imag * x.real - left.real * x.imag) / area, pace


@_compiled
def on_a_wall(way: CrankWay, wall: Wall, clearance: float, gap: complex, drift: complex) -> float:
    """Crank angle (rad) at which a pin leaves a wall that yields, from a ``gap`` (m) on, at a rate (m/s); NaN: it
    stays.
    """
    time, end, speed = 0.0, way.turn / way.speed, way.speed
    while time < end:
        theta = way.begin + speed * time
        a, pace = _bounced(_at(way, theta), wall, clearance, gap, drift)
        h = min(1 / (BOUNCE_STEPS * pace), LARGEST_TURN / abs(speed))
        middle = _at(way, theta + speed * h / 2)
        b = _bounced(middle, wall, clearance, gap + drift * h / 2, drift + a * h / 2)[0]
        c = _bounced(middle, wall, clearance, gap + drift * h / 2 + a * h**2 / 4, drift + b * h / 2)[0]
        last = _at(way, theta + speed * h)
        d = _bounced(last, wall, clearance, gap + drift * h + b * h**2 / 2, drift + c * h)[0]
        moved = drift * h + (a + b + c) * h**2 / 6
        near = min(max(-_dot(gap, moved) / (abs(moved) ** 2 + NO_MOTION), 0.0), 1.0)  # a fast pin crosses in a step
        if abs(gap + near * moved) < clearance:
            return theta + speed * h * near
        gap += moved
        drift += (a + 2 * b + 2 * c + d) * h / 6
        time += h
    return math.nan
