"""Which straight bars stand for a link: nodes, bars between two of them, and where the link's points sit on them.

This describes a body, as its mass and points do.  What bars do under load, :mod:`analytic.paper.frame` and each engine
work out for themselves: they share this description only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise

from analytic.mechanism import MASS_CENTRE, Body

SHARED_NODE = 1e-3  # of a body's length: nearer points share a node
POISSON = 0.3  # of a body without a shear modulus: G = E / 2.6


def shear_modulus(body: Body) -> float:
    """Shear modulus (Pa) of a body that bends: as given, or that of an isotropic link; 0 of a rigid one."""
    return body.shear_modulus or (body.youngs_modulus or 0.0) / (2 * (1 + POISSON))


@dataclass(frozen=True)
class Division:
    """A body as bars (m, body frame).

    ``places`` gives each point, com and centre of mass included, as a node and a rigid arm from that node to the point.
    """

    nodes: tuple[complex, ...]
    bars: tuple[tuple[int, int], ...]
    places: Mapping[str, tuple[int, complex]]


def division(body: Body) -> Division:
    """The bars of a body:

    *straight*: where all points lie within the bar's height of the line through the two farthest, one bar along that
    line, with a node at the foot of every point and of the com;
    *star*: otherwise (a ternary link) a bar from each point to a hub at the middle of the points.

    A rigid arm carries each point that lies beside its bar, and a com that is not on the hub: a force there adds its
    moment, and the offset itself bends nothing.
    """
    points = {name: body.point(name) for name in (*body.points, "com", MASS_CENTRE)}
    named = [body.point(name) for name in body.points]
    start, end = max(((p, q) for p in named for q in named), key=lambda ends: abs(ends[1] - ends[0]))
    along = (end - start) / abs(end - start) if end != start else 1 + 0j

    def beyond(p: complex) -> complex:  # x along the line from its start, y beside it
        return (p - start) * along.conjugate()

    if all(abs(beyond(p).imag) <= body.section[0] / 2 for p in named):
        feet = {name: start + along * beyond(p).real for name, p in points.items()}
        nodes = tuple(sorted(_distinct(feet.values(), body.length), key=lambda p: beyond(p).real))
        bars = tuple(pairwise(range(len(nodes))))
    else:
        hub = body.middle
        feet = points | {"com": hub, MASS_CENTRE: hub}
        nodes = _distinct([hub, *named], body.length)
        bars = tuple((0, i) for i in range(1, len(nodes)))
    nearest = {name: min(range(len(nodes)), key=lambda i: abs(foot - nodes[i])) for name, foot in feet.items()}
    return Division(nodes, bars, {name: (i, points[name] - nodes[i]) for name, i in nearest.items()})


def _distinct(points: Iterable[complex], length: float) -> tuple[complex, ...]:
    kept: list[complex] = []
    for p in points:
        if all(abs(p - q) > SHARED_NODE * length for q in kept):
            kept.append(p)
    return tuple(kept)
