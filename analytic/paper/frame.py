"""What a flexible link is made of: straight Euler-Bernoulli bars between its points (Eqs. 2-3, with the right
matrix).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analytic.errors import Error
from analytic.mechanism import MASS_CENTRE, Body
from analytic.mechanism.bars import division, shear_modulus


class ComplianceError(Error, ValueError):
    """The linkage is no structure that could carry its loads; the message says where and why."""


@dataclass(frozen=True)
class ElasticBar:
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
        """Saint-Venant's torsion constant (m^4) of a rectangle: Timoshenko & Goodier, Theory of Elasticity,
        art. 109.
        """
        b, a = sorted((self.height, self.depth))
        n = np.arange(1, 40, 2)
        return a * b**3 * (1 / 3 - 64 / np.pi**5 * b / a * float(np.sum(np.tanh(n * np.pi * a / (2 * b)) / n**5)))


def beam_stiffness(bar: ElasticBar) -> np.ndarray:
    """Stiffness (12, 12) of a bar in its own axes (x along it): the Euler-Bernoulli beam that Eqs. 2-3 mean.

    Order: translations x, y, z and rotations about x, y, z of the first end, then of the second.  Source:
    Przemieniecki, Theory of Matrix Structural Analysis, section 5.6, without shear deformation.
    """
    e, length = bar.youngs_modulus, bar.length
    k = np.zeros((12, 12))
    for i, stiffness in ((0, e * bar.area / length), (3, bar.shear_modulus * bar.torsion_constant / length)):
        k[np.ix_([i, i + 6], [i, i + 6])] = stiffness * np.array([[1, -1], [-1, 1]])
    a, b, c = 6 * length, 4 * length**2, 2 * length**2
    bending = e / length**3 * np.array([[12, a, -12, a], [a, b, -a, c], [-12, -a, 12, -a], [a, c, -a, b]])
    for deflection, turn, moment, sign in (
        (1, 5, bar.i_z, 1),
        (2, 4, bar.i_y, -1),
    ):  # the slope of z is minus the turn about y
        ends = np.array([1, sign, 1, sign])
        freedoms = [deflection, turn, deflection + 6, turn + 6]
        k[np.ix_(freedoms, freedoms)] = moment * bending * np.outer(ends, ends)
    return k


@dataclass(frozen=True)
class ElasticFrame:
    """What a body is as a structure (m, body frame): nodes, bars between two of them, and where its points sit.

    ``places`` gives each point, com included, as a node and a rigid arm from that node to the point.
    """

    nodes: tuple[complex, ...]
    bars: tuple[tuple[int, int, ElasticBar], ...]
    places: Mapping[str, tuple[int, complex]]


def frame(body: Body) -> ElasticFrame:
    """A rigid body is one node at its com, a flexible one the bars of :func:`analytic.mechanism.bars.division`, of its
    section and welded at their nodes.

    Raises ComplianceError for bars without a section.
    """
    if body.youngs_modulus is None:
        centre = body.centre
        arms = {name: (0, body.point(name) - centre) for name in (*body.points, "com", MASS_CENTRE)}
        return ElasticFrame((centre,), (), arms)
    parts = division(body)
    bars = tuple((i, j, _bar(body, body.youngs_modulus, abs(parts.nodes[j] - parts.nodes[i]))) for i, j in parts.bars)
    return ElasticFrame(parts.nodes, bars, parts.places)


def _bar(body: Body, youngs_modulus: float, length: float) -> ElasticBar:
    height, depth = body.section
    if not min(height, depth) > 0:
        raise ComplianceError(
            f"body[{body.name}].section = [{height:g}, {depth:g}] m: a body with youngs_modulus ({youngs_modulus:g} Pa)"
            " needs the height and depth of its bar, both above zero; give them, or leave youngs_modulus out for a"
            " rigid body"
        )
    return ElasticBar(length, height, depth, youngs_modulus, shear_modulus(body))
