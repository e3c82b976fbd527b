"""What an unknown may depend on: a small dictionary of laws of the state at its place.

A law has ``shapes``, numbers that it is not linear in (a Stribeck speed, a gap, where a spring rests), each on a grid
that the data refine; its size is a coefficient.  Every law says in which places it makes sense.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from compare.results.diagnosis import Unknown

HARMONICS = range(1, 41)
UNKNOWNS: Mapping[Unknown, str] = {  # what is not known at a place, as a noun
    "torque": "torque in joint {}",
    "give": "give of the bearing of joint {}, along its reaction",
    "length": "change of the length of the {}",
    "bend": "distance of the end of the {} from its axis",
    "lag": "angle of the crank behind its encoder",
    "error": "error of the sensor for {}",
}


@dataclass(frozen=True)
class State:
    """What is known (size,) at every sample: crank angle ``theta`` (rad), time (s), drive torque; where the place is a
    joint, its angle (prismatic: travel), rate, and the size of its reaction; of a link with two pins, the ``pull`` (N)
    in it; of the drive, ``carried`` (N.m.s), the size of its torque summed over the run, in the sense of its turning;
    for a sensor, what it should read.
    """

    theta: np.ndarray
    time: np.ndarray
    torque: np.ndarray
    angle: np.ndarray | None = None
    rate: np.ndarray | None = None
    force: np.ndarray | None = None
    pull: np.ndarray | None = None
    carried: np.ndarray | None = None
    reading: np.ndarray | None = None


Shape = tuple[float, ...]
Argument = Literal["theta", "time", "torque", "angle", "rate", "force", "pull", "carried", "reading"]
Columns = Callable[[State, Shape], np.ndarray]


@dataclass(frozen=True)
class Law:
    """A law: its columns (size, k) of a state and shapes, what each column is called, and the grid of its shapes."""

    name: str
    terms: tuple[str, ...]  # of each column, with {0}, {1} for its shapes
    units: tuple[str, ...]  # of each column, then of each shape; 1 where there is none
    over: Argument  # what it is a function of
    columns: Columns
    grid: Callable[[State], list[list[float]]] = lambda state: []  # of each shape
    places: frozenset[Unknown] = frozenset({"torque", "give", "length", "bend", "lag", "error"})
    steps: Callable[[State], list[float]] = lambda state: []  # by which a shape is refined at first


TORQUE: frozenset[Unknown] = frozenset({"torque"})


def _one(values: np.ndarray) -> np.ndarray:
    return values[:, None]


def _known(values: np.ndarray | None) -> np.ndarray:
    assert values is not None
    return values


def _span(values: np.ndarray | None) -> tuple[float, float]:
    known = _known(values)
    return float(known.min()), float(known.max())


def _fast(state: State) -> float:
    return float(np.abs(_known(state.rate)).max())


def _inside(values: np.ndarray | None, count: int) -> list[float]:
    low, high = _span(values)
    return (low + (high - low) * (np.arange(count) + 0.5) / count).tolist()


def _width(values: np.ndarray | None) -> float:
    low, high = _span(values)
    return high - low


def _dead(q: np.ndarray, middle: float, half: float) -> np.ndarray:
    return np.sign(q - middle) * np.maximum(np.abs(q - middle) - abs(half), 0.0)


def _slip(rate: np.ndarray) -> np.ndarray:
    return np.sign(rate) * (np.abs(rate) > 1e-9 * np.abs(rate).max())


def _waves(k: int) -> Law:
    return Law(
        f"harmonic {k}",
        (f"cos {k} theta", f"sin {k} theta") if k > 1 else ("cos theta", "sin theta"),
        ("1", "1"),
        "theta",
        lambda s, _: np.column_stack([np.cos(k * s.theta), np.sin(k * s.theta)]),
    )


def _bump(state: State, shape: Shape) -> np.ndarray:
    turns = (state.theta - shape[0]) / (2 * np.pi)
    turns -= np.rint(turns)
    return _one(np.exp(-0.5 * (2 * np.pi / shape[1] * turns) ** 2))


LAWS: tuple[Law, ...] = (
    Law("constant", ("1",), ("1",), "theta", lambda s, _: _one(np.ones_like(s.theta))),
    Law("Coulomb friction", ("sign w",), ("1",), "rate", lambda s, _: _one(_slip(_known(s.rate))), places=TORQUE),
    Law("viscous friction", ("w",), ("rad/s",), "rate", lambda s, _: _one(_known(s.rate)), places=TORQUE),
    Law(
        "drag",
        ("w |w|",),
        ("rad2/s2",),
        "rate",
        lambda s, _: _one(_known(s.rate) * np.abs(_known(s.rate))),
        places=TORQUE,
    ),
    Law(
        "Stribeck friction",
        ("sign w", "exp(-(w/{0})^2) sign w"),
        ("1", "1", "rad/s"),
        "rate",
        lambda s, p: (
            np.column_stack([np.ones_like(s.theta), np.exp(-((_known(s.rate) / p[0]) ** 2))])
            * _one(_slip(_known(s.rate)))
        ),
        lambda s: [(_fast(s) * np.array([0.03, 0.06, 0.12, 0.25, 0.5])).tolist()],
        TORQUE,
        lambda s: [0.02 * _fast(s)],
    ),
    Law(
        "friction of the load",
        ("|F| sign w",),
        ("N",),
        "rate",
        lambda s, _: _one(_known(s.force) * _slip(_known(s.rate))),
        places=TORQUE,
    ),
    Law("spring", ("q",), ("rad",), "angle", lambda s, _: _one(_known(s.angle)), places=TORQUE),
    Law(
        "stiffening spring",
        ("(q - {0})^3",),
        ("rad3", "rad"),
        "angle",
        lambda s, p: _one((_known(s.angle) - p[0]) ** 3),
        lambda s: [_inside(s.angle, 5)],
        TORQUE,
        lambda s: [0.1 * _width(s.angle)],
    ),
    Law(
        "spring with a gap",
        ("gap(q - {0}, {1})",),
        ("rad", "rad", "rad"),
        "angle",
        lambda s, p: _one(_dead(_known(s.angle), p[0], p[1])),
        lambda s: [_inside(s.angle, 5), [0.08 * _width(s.angle), 0.2 * _width(s.angle)]],
        TORQUE,
        lambda s: [0.05 * _width(s.angle), 0.03 * _width(s.angle)],
    ),
    Law("load", ("|F|",), ("N",), "force", lambda s, _: _one(_known(s.force)), places=frozenset({"give"})),
    Law(
        "backlash",
        ("sign T",),
        ("1",),
        "torque",
        lambda s, _: _one(np.sign(s.torque)),
        places=frozenset({"lag", "length"}),
    ),
    Law("play", ("sign P",), ("1",), "pull", lambda s, _: _one(np.sign(_known(s.pull))), places=frozenset({"length"})),
    Law("load of the link", ("P",), ("N",), "pull", lambda s, _: _one(_known(s.pull)), places=frozenset({"length"})),
    Law("slip", ("S",), ("N.m.s",), "carried", lambda s, _: _one(_known(s.carried)), places=frozenset({"lag"})),
    Law("drive torque", ("T",), ("N.m",), "torque", lambda s, _: _one(s.torque), places=frozenset({"lag"})),
    Law("gain", ("y",), ("y",), "reading", lambda s, _: _one(_known(s.reading)), places=frozenset({"error"})),
    Law("time", ("t",), ("s",), "time", lambda s, _: _one(s.time)),
    Law(
        "bump",
        ("bump(theta - {0}, {1})",),
        ("1", "rad", "rad"),
        "theta",
        _bump,
        lambda s: [np.arange(-np.pi, np.pi, 0.15).tolist(), [0.08, 0.15, 0.3]],
        frozenset({"torque", "lag", "length", "error"}),
        lambda s: [0.05, 0.03],
    ),
    *(_waves(k) for k in HARMONICS),
)


@dataclass(frozen=True)
class Candidate:
    """A law with its shapes."""

    law: Law
    shape: Shape

    def columns(self, state: State) -> np.ndarray:
        """Columns (size, k) of a state."""
        return self.law.columns(state, self.shape)

    @property
    def terms(self) -> tuple[str, ...]:
        """What each column is called."""
        return tuple(term.format(*(f"{x:.4g}" for x in self.shape)) for term in self.law.terms)


def candidates(unknown: Unknown, state: State) -> Iterator[Candidate]:
    """Every law of a kind of unknown that this state can have, at each of its grid's shapes."""
    for law in LAWS:
        of = getattr(state, law.over)
        if unknown in law.places and of is not None and np.any(of):
            for shape in product(*law.grid(state)):
                yield Candidate(law, tuple(shape))
