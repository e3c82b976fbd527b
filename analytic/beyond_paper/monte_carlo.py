"""Monte Carlo of joint clearance: many linkages, each with clearances drawn from their tolerances and contacts of its
own.

A sample is one linkage: its radial clearances (uniform within clearance +- tolerance) and, with contacts ``free``, a
direction of contact in each joint (uniform round the rim) that it keeps over the cycle; with contacts ``along
reactions`` every pin lies where the reaction presses it.  Outputs follow to first order
(:mod:`analytic.paper.envelope`) or, exactly, by closing the linkage again with each sample's gaps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from analytic.kinematics.assembly import Assembly, CrankTable
from analytic.kinematics.motion import Gap, Motion, kinematics
from analytic.kinematics.output import Output
from analytic.mechanism.one_line import angles, count, largest, one_line
from analytic.paper.envelope import rim_spread

Contacts = Literal["free", "along reactions"]
SAMPLES_AT_ONCE = 200_000  # samples times crank angles held at once
TAIL = 0.025  # 95 % of the samples lie between the two tails


@dataclass(frozen=True)
class Samples:
    """S linkages: radial clearances (joints, S) m and directions of contact (joints, S), complex of length 1."""

    clearances: np.ndarray  # (joints,) m
    tolerances: np.ndarray  # (joints,) m
    sizes: np.ndarray
    directions: np.ndarray

    def __repr__(self) -> str:
        joints, linkages = self.sizes.shape
        return one_line(self, count(linkages, "linkage"), count(joints, "joint"), largest(self.sizes, "m"))

    @property
    def variance(self) -> np.ndarray:
        """Variance (joints,) of the clearances, m^2."""
        return self.tolerances**2 / 3


def draw(clearances: np.ndarray, tolerances: np.ndarray, samples: int, seed: int, blocks: int = 0) -> Samples:
    """Draw linkages; ``clearances`` and ``tolerances`` (joints,) are radial, in m, tolerances no larger than
    clearances.  The last so many joints are ``blocks``, which lie in one of four corners.
    """
    rng = np.random.default_rng(seed)
    shape = (clearances.size, samples)
    sizes = clearances[:, None] + tolerances[:, None] * rng.uniform(-1.0, 1.0, shape)
    turns = rng.random(shape)
    turns[len(turns) - blocks :] = np.floor(4 * turns[len(turns) - blocks :]) / 4
    return Samples(clearances, tolerances, sizes, np.exp(2j * np.pi * turns))


@dataclass(frozen=True)
class OutputSpread:
    """Distribution of an output's displacement at N crank angles; arrays are (N,), in the output's unit."""

    mean: np.ndarray
    sigma: np.ndarray
    low: np.ndarray  # 2.5 % of the samples lie below
    high: np.ndarray  # 2.5 % lie above
    formula: np.ndarray  # sigma as first order has it in closed form

    def __repr__(self) -> str:
        return one_line(self, count(self.mean.size, "crank angle"), f"sigma {largest(self.sigma, '')}")


@dataclass(frozen=True)
class Distribution:
    """Spreads by output, and by place the radius (N,) m within which 95 % of the samples displace that point."""

    spreads: Mapping[Output, OutputSpread]
    radius: Mapping[str, np.ndarray]

    def __repr__(self) -> str:
        return one_line(self, count(len(self.spreads), "output"), count(len(self.radius), "point"))


@dataclass(frozen=True)
class Population:
    """What is sampled: an ideal linkage, its unit reactions (joints, N), where its reactions point (joints, N)."""

    assembly: Assembly
    ideal: Motion
    path: CrankTable
    reactions: Mapping[Output, np.ndarray]
    directions: np.ndarray  # complex of length 1; NaN where a reaction has none and its joint has clearance

    def __repr__(self) -> str:
        name, outputs = self.assembly.mechanism.name, count(len(self.reactions), "output")
        return one_line(self, name, angles(self.ideal.theta), outputs)

    def distribution(self, samples: Samples, contacts: Contacts, nonlinear: bool = False) -> Distribution:
        """Displacements over the samples.  Raises AssemblyError if ``nonlinear`` and a sample cannot be closed."""
        displace = self._closed_again if nonlinear else self._first_order
        count = max(1, SAMPLES_AT_ONCE // samples.sizes.shape[1])
        rows: dict[Output, list[np.ndarray]] = {d: [] for d in self.reactions}
        radii: dict[str, list[np.ndarray]] = {d.place: [] for d in self.reactions if d.axis == "y"}
        for k in range(0, self.ideal.theta.size, count):
            values = displace(slice(k, k + count), samples, contacts)
            for d, moved in values.items():
                rows[d].append(np.array([moved.mean(axis=1), moved.std(axis=1), *_quantiles(moved, TAIL, 1 - TAIL)]))
                if d.axis == "y":
                    radii[d.place] += _quantiles(np.hypot(values[replace(d, axis="x")], moved), 1 - 2 * TAIL)
        spreads = {}
        for d in self.reactions:
            mean, sigma, low, high = np.hstack(rows[d])
            spreads[d] = OutputSpread(mean, sigma, low, high, self._formula(d, samples, contacts))
        return Distribution(spreads, {place: np.concatenate(parts) for place, parts in radii.items()})

    def _formula(self, d: Output, samples: Samples, contacts: Contacts) -> np.ndarray:
        if contacts == "free":
            return rim_spread(self.reactions[d], samples.clearances**2 + samples.variance)
        return np.sqrt(samples.variance @ self._along(d) ** 2)

    def _along(self, d: Output) -> np.ndarray:
        """Displacement (joints, N) of an output by a unit gap along each joint's reaction."""
        return (np.conj(self.reactions[d]) * self.directions).real

    def _first_order(self, block: slice, samples: Samples, contacts: Contacts) -> dict[Output, np.ndarray]:
        """Displacements (n, S) by first order."""
        if contacts == "along reactions":
            return {d: _combine(self._along(d)[:, block], samples.sizes) for d in self.reactions}
        gaps = samples.sizes * samples.directions
        parts = np.concatenate([gaps.real, gaps.imag])
        return {
            d: _combine(np.concatenate([r[:, block].real, r[:, block].imag]), parts) for d, r in self.reactions.items()
        }

    def _closed_again(self, block: slice, samples: Samples, contacts: Contacts) -> dict[Output, np.ndarray]:
        """Displacements (n, S) of the linkage closed with the samples' gaps."""
        theta = self.ideal.theta[block]
        n, s = theta.size, samples.sizes.shape[1]
        directions = samples.directions[:, None] if contacts == "free" else self.directions[:, block, None]
        lost = np.isnan(directions).any(axis=(0, 2))
        gaps = np.broadcast_to(samples.sizes[:, None] * np.nan_to_num(directions), (len(samples.sizes), n, s)).reshape(
            -1, n * s
        )
        loose = {pin: Gap(g) for pin, g in zip(self.assembly.structure.pins, gaps, strict=True) if g.any()}
        moved = kinematics(self.assembly, np.repeat(theta, s), gaps=loose, path=self.path)
        apart = {d: d.value(moved).reshape(n, s) - d.value(self.ideal)[block, None] for d in self.reactions}
        return {d: np.where(lost[:, None], np.nan, values) for d, values in apart.items()}


def _combine(weights: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Sums (n, S) of weights (terms, n) times parts (terms, S); with so few terms BLAS threads on busy cores take 15
    times as long.
    """
    return np.einsum("jn,js->ns", weights, parts)


def _quantiles(values: np.ndarray, *shares: float) -> list[np.ndarray]:
    """Values (N,) below which each share of (N, S) samples lies; a sort, for numpy's is faster than its quantiles."""
    ordered = np.sort(values, axis=1)
    return [ordered[:, round(share * (values.shape[1] - 1))] for share in shares]
