"""What a flexible link is made of: straight Euler-Bernoulli bars between its points (Eqs. 2-3, with the right matrix)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from analytic.mechanism import MASS_CENTRE, Body

SAME_PLACE = 1e-3  # of a body's length: nearer points share a node
POISSON = 0.3  # of a body without a shear modulus: G = E / 2.6


class ComplianceError(ValueError):
    """The linkage is no structure that could carry its loads; the message says where and why."""


@dataclass(frozen=True)
class Bar:
    """A straight bar of rectangular section; z is the axis normal to the linkage's plane (SI units)."""

    length: float
    height: float  # in the plane
    depth: float
    youngs_modulus: float
    shear_modulus: float

    @property
    def area(self) -> float:
        """Area of the section (m^2)."""
        return self.height * self.depth

    @property
    def i_z(self) -> float:
        """Second moment of area (m^4) for bending in the linkage's plane."""
        return self.depth * self.height**3 / 12

    @property
    def i_y(self) -> float:
        """Second moment of area (m^4) for bending out of the plane."""
        return self.height * self.depth**3 / 12

    @property
    def torsion_constant(self) -> float:
        """Saint-Venant's torsion constant (m^4) of a rectangle: Timoshenko & Goodier, Theory of Elasticity, art. 109."""
        b, a = sorted((self.height, self.depth))
        n = np.arange(1, 40, 2)
        return a * b**3 * (1 / 3 - 64 / np.pi**5 * b / a * float(np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5)))


def beam_stiffness(bar: Bar) -> np.ndarray:
    """Stiffness (12, 12) of a bar in its own axes (x along it): the Euler-Bernoulli beam that Eqs. 2-3 mean.

    Order: translations x, y, z and rotations about x, y, z of the first end, then of the second.  Source: Przemieniecki,
    Theory of Matrix Structural Analysis, section 5.6, without shear deformation.
    """
    e, length = bar.youngs_modulus, bar.length
    k = np.zeros((12, 12))
    for i, stiffness in ((0, e * bar.area / length), (3, bar.shear_modulus * bar.torsion_constant / length)):
        k[np.ix_([i, i + 6], [i, i + 6])] = stiffness * np.array([[1, -1], [-1, 1]])
    a, b, c = 6 * length, 4 * length**2, 2 * length**2
    bending = e / length**3 * np.array([[12, a, -12, a], [a, b, -a, c], [-12, -a, 12, -a], [a, c, -a, b]])
    for deflection, turn, moment, sign in ((1, 5, bar.i_z, 1), (2, 4, bar.i_y, -1)):  # the slope of z is minus the turn about y
        ends = np.array([1, sign, 1, sign])
        freedoms = [deflection, turn, deflection + 6, turn + 6]
        k[np.ix_(freedoms, freedoms)] = moment * bending * np.outer(ends, ends)
    return k


@dataclass(frozen=True)
class Frame:
    """What a body is as a structure (m, body frame): nodes, bars between two of them, and where its points sit.

    ``places`` gives each point, com included, as a node and a rigid arm from that node to the point.
    """

    nodes: tuple[complex, ...]
    bars: tuple[tuple[int, int, Bar], ...]
    places: Mapping[str, tuple[int, complex]]


def frame(body: Body) -> Frame:
    """A rigid body is one node at its com.  A flexible one is made of bars of its section:

    *straight*: where all points lie within the bar's height of the line through the two farthest, one bar along that
    line, with a node at the foot of every point and of the com;
    *star*: otherwise (a ternary link) a bar from each point to a hub, welded there, at the middle of the points.

    A point beside its bar, and a com that is not on the hub, is carried by a rigid arm, so that an offset adds its
    moment but bends nothing by itself.  Raises ComplianceError for bars without a section.
    """
    points = {name: body.point(name) for name in (*body.points, "com", MASS_CENTRE)}
    if body.youngs_modulus is None:
        return Frame((body.centre,), (), {name: (0, p - body.centre) for name, p in points.items()})
    named = [body.point(name) for name in body.points]
    start, end = max(((p, q) for p in named for q in named), key=lambda ends: abs(ends[1] - ends[0]))
    along = (end - start) / abs(end - start) if end != start else 1 + 0j

    def beyond(p: complex) -> complex:  # x along the line from its start, y beside it
        return (p - start) * along.conjugate()

    if all(abs(beyond(p).imag) <= body.section[0] / 2 for p in named):
        feet = {name: start + along * beyond(p).real for name, p in points.items()}
        nodes = tuple(sorted(_distinct(feet.values(), body.length), key=lambda p: beyond(p).real))
        pairs = list(pairwise(range(len(nodes))))
    else:
        hub = sum(named, 0j) / len(named)
        feet = points | {"com": hub, MASS_CENTRE: hub}
        nodes = _distinct([hub, *named], body.length)
        pairs = [(0, i) for i in range(1, len(nodes))]
    bars = tuple((i, j, _bar(body, body.youngs_modulus, abs(nodes[j] - nodes[i]))) for i, j in pairs)
    nearest = {name: min(range(len(nodes)), key=lambda i: abs(foot - nodes[i])) for name, foot in feet.items()}
    return Frame(nodes, bars, {name: (i, points[name] - nodes[i]) for name, i in nearest.items()})


def _distinct(points: Iterable[complex], length: float) -> tuple[complex, ...]:
    kept: list[complex] = []
    for p in points:
        if all(abs(p - q) > SAME_PLACE * length for q in kept):
            kept.append(p)
    return tuple(kept)


def _bar(body: Body, youngs_modulus: float, length: float) -> Bar:
    height, depth = body.section
    if not min(height, depth) > 0:
        raise ComplianceError(
            f"body[{body.name}].section = [{height:g}, {depth:g}] m: a body with youngs_modulus ({youngs_modulus:g} Pa) needs the height and "
            "depth of its bar, both above zero; give them, or leave youngs_modulus out for a rigid body"
        )
    return Bar(length, height, depth, youngs_modulus, body.shear_modulus or youngs_modulus / (2 * (1 + POISSON)))
