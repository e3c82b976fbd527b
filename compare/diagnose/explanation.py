"""What is said of data: the effects that they show, what else was tried, the verdict, whether what is left is noise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.stats import chi2

from compare.diagnose.competing import Competing
from compare.diagnose.fit import Fit
from compare.diagnose.intervals import Covariance, Interval
from compare.diagnose.noise import CLOSED, rms
from compare.diagnose.predict import Term
from compare.diagnose.rattle.statistics import Statistics
from compare.diagnose.residuals import Data
from compare.results.diagnosis import DiagnosisVerdict

STRUCTURE = 1e-6  # chance of as much structure in noise alone
BINS = 24
SLIGHT = 0.3  # of the noise: structure that is accepted
MODEL = 1.0  # the same beside named effects: models of contact and bending are not exact to the last micrometre


@dataclass(frozen=True)
class Named:
    """An effect that the data show."""

    term: Term
    parameters: dict[str, Interval]
    chi2_gain: float  # decrease of chi^2 that it brings
    gap: tuple[float, float]  # before, after
    held_out: tuple[float, float]
    ties: tuple[tuple[Term, Fit], ...] = ()  # what explains the data as well in its place
    share: float = 0.0  # of the squared gap, before any effect: what it takes away when the effects are added in order
    odds: tuple[float, ...] = ()  # of each tie against this effect, by their evidence
    probability: float | None = None  # summed over the sets of effects that have it


@dataclass(frozen=True)
class Attempt:
    """An effect that takes something of the gap away and is not named; ``failed`` says which test it failed, by how
    much, and nothing where it is only improbable.
    """

    term: Term
    parameters: dict[str, Interval]
    share: float  # of the squared gap, beside the effects that are named
    gap: tuple[float, float]  # without it, with it
    failed: str


@dataclass(frozen=True)
class Explanation:
    """What the data say."""

    base: Fit
    fit: Fit
    named: tuple[Named, ...]
    verdict: DiagnosisVerdict
    weights: np.ndarray = field(repr=False)  # (size,) of each sample
    structured: bool  # whether what is left is more than noise
    attempts: tuple[Attempt, ...] = ()  # what was tried and not named, best first
    statistics: Statistics | None = None  # by which a rig that rattles is judged, in place of its samples
    sets: Mapping[frozenset[tuple[str, str]], float] = field(default_factory=dict)  # how probable sets of effects are
    covariance: Covariance | None = field(default=None, repr=False)  # of all named parameters
    competing: Mapping[frozenset[tuple[str, str]], Competing] = field(default_factory=dict, repr=False)  # likely sets

    @cached_property
    def gap(self) -> tuple[float, float]:
        """Root mean square residual in units of noise, before and after."""
        return rms(self.base.residual), rms(self.fit.residual)


def verdict(fit: Fit, named: Sequence[Named], structured: bool) -> DiagnosisVerdict:
    """One of the five verdicts."""
    closed = rms(fit.residual) <= CLOSED and not structured
    if not named:
        return "no gap" if closed else "unexplained"
    if not closed:
        return "partly explained"
    return "ambiguous" if any(n.ties for n in named) else "explained"


def has_structure(data: Data, residual: np.ndarray, slight: float = SLIGHT) -> bool:
    """Whether the residual's local means are more than noise, and more than ``slight`` of it (rms)."""
    for part in data.parts:
        r = residual[part.place]
        if r.size < 2 * BINS:
            continue
        scale = max(1.0, float(np.std(np.diff(r))) / math.sqrt(2))
        bins = np.array_split(r, BINS)
        means = np.array([b.mean() * math.sqrt(b.size) for b in bins]) / scale
        if chi2.sf(float(means @ means), BINS) < STRUCTURE and rms(np.array([b.mean() for b in bins])) > slight * scale:
            return True
    return False
