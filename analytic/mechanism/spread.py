"""How the mass of a bar is spread along it."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from analytic.mechanism.parts import Body


def ends(body: Body) -> tuple[float, float]:
    """Where a bar begins and ends along its x axis (m): at the outermost of its points."""
    along = [x for x, _ in body.points.values()]
    return min(along), max(along)


def mass_between(body: Body, start: float, end: float) -> tuple[float, float, float]:
    """Mass (kg) of a stretch of a bar along its x axis (m), and its first and second moments about x = 0 (kg.m,
    kg.m^2).

    It is spread evenly where the body's centre of mass and inertia are those of a uniform bar; else by the parabola
    that has its mass, centre of mass and moment of inertia.
    """
    low, high = ends(body)
    half, middle = (high - low) / 2, (high + low) / 2
    off = body.centre.real - middle
    second = body.moment_of_inertia / body.mass - body.section[0] ** 2 / 12 + off**2  # about the middle
    lean, bulge = 3 * off / half, 7.5 * (second / half**2 - 1 / 3)
    place = Polynomial([-middle / half, 1 / half])  # -1 to 1 from end to end
    density = body.mass / (2 * half) * (1 + lean * place + bulge * (1.5 * place**2 - 0.5))
    x = Polynomial([0.0, 1.0])
    parts = [(density * x**power).integ() for power in range(3)]
    mass, first, moment = (float(np.diff(part(np.array([start, end])))[0]) for part in parts)
    return mass, first, moment
