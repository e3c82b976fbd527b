"""Figures of a run over its revolutions: how sure they are, when they have converged, and whether two runs agree.

Where pins strike their walls a motion is chaotic.  Two engines, or one with two step sizes, part from each other after
some impacts, however exact they are; what they share is how often things happen, and how large they are.  So a run goes
on until its averages over revolutions have converged, and runs are compared by these averages and their intervals.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from compare.judge.tolerances import Tolerances
from compare.results.contact import STATISTICS, UNITS, Compared, Contact, Statistic, StatisticName
from compare.results.crosscheck import Run

FEWEST_REVOLUTIONS = 3  # revolutions for an interval
RESAMPLES = 1000
CONFIDENCE = 0.95
NORMAL_95 = 1.96  # standard deviations either way of a normal distribution, within which 95 % of it are
RESAMPLE_SEED = 20
ENGINE_ROUNDING = 1e-6  # of what a contact takes: friction of a frictionless one is an engine's rounding


def statistic(by_revolution: np.ndarray, quantile: float | None = None) -> Statistic:
    """The mean (or a ``quantile``) of a figure over revolutions (n,), with its interval by a moving-block bootstrap.

    Neighbouring revolutions depend on each other: blocks are as long as the cube root of their number (Kunsch 1989).
    For few revolutions the interval is widened as Student's is over the normal one.
    """

    def figure(of: np.ndarray) -> np.ndarray:
        return of.mean(axis=-1) if quantile is None else np.quantile(of, quantile, axis=-1)

    n = by_revolution.size
    value = float(figure(by_revolution)) if n else math.nan
    if n < FEWEST_REVOLUTIONS:
        return Statistic(value=value, low=None, high=None, by_revolution=by_revolution)
    from scipy.special import stdtrit  # here: importing it takes a tenth of a second

    length = max(1, round(n ** (1 / 3)))
    starts = np.random.default_rng(RESAMPLE_SEED).integers(0, n, (RESAMPLES, math.ceil(n / length)))
    index = (starts[..., None] + np.arange(length)).reshape(RESAMPLES, -1)[:, :n] % n
    tail = (1 - CONFIDENCE) / 2
    ends = np.quantile(figure(by_revolution[index]), [tail, 1 - tail])
    wider = math.sqrt(n / (n - 1)) * float(stdtrit(n - 1, 1 - tail) / stdtrit(1e9, 1 - tail))
    low, high = (value + wider * (end - value) for end in ends)
    return Statistic(value=value, low=float(low), high=float(high), by_revolution=by_revolution)


def needed(figure: Statistic, wanted: float) -> float:
    """By how many times as many revolutions the interval would be as narrow as ``wanted`` (half its width)."""
    half = figure.half_width
    return math.inf if half is None else (half / wanted) ** 2 if wanted > 0 else math.inf if half > 0 else 0.0


# ---------------------------------------------------------------- two runs


def compared_statistics(runs: Sequence[Run], tolerances: Tolerances) -> tuple[Compared, ...]:
    """Every statistic of each two runs of one joint model in which pins strike, held against each other."""
    striking = [run for run in runs if run.contact is not None and run.contact.struck]
    pairs = [(one, other) for one, other in combinations(striking, 2) if one.joint_model == other.joint_model]
    return tuple(pair_verdict for one, other in pairs for pair_verdict in _compared(one, other, tolerances))


def _compared(first: Run, second: Run, tolerances: Tolerances) -> Iterator[Compared]:
    assert first.contact is not None
    assert second.contact is not None
    why = _incomparable(first, second)
    for joint in (name for name in first.contact.joints if name in second.contact.joints):
        for name in STATISTICS:
            a, b = (_statistic(contact, joint, name) for contact in (first.contact, second.contact))
            nothing = (
                ENGINE_ROUNDING * _largest_loss(first.contact, second.contact, joint) if UNITS[name] == "J" else 0.0
            )
            allowed = _allowed(a, b, name, tolerances, nothing)
            within = allowed is not None and abs((a.value or 0.0) - (b.value or 0.0)) <= allowed
            yield Compared(
                joint=joint,
                statistic=name,
                unit=UNITS[name],
                joint_model=first.joint_model,
                between=(first.simulator.name, second.simulator.name),
                values=(a.value, b.value),
                allowed=allowed,
                verdict="unjudged" if why or allowed is None else "agrees" if within else "disagrees",
                reason=why or ("" if allowed is not None else "there are too few revolutions for an interval"),
            )


def _statistic(contact: Contact, joint: str, name: StatisticName) -> Statistic:
    return contact.joints[joint].statistics[name]


def _largest_loss(first: Contact, second: Contact, joint: str) -> float:
    """The largest loss (J) of a joint in two runs."""
    names = [name for name in STATISTICS if UNITS[name] == "J"]
    return max(abs(_statistic(contact, joint, name).value or 0.0) for contact in (first, second) for name in names)


def _allowed(
    a: Statistic, b: Statistic, name: StatisticName, tolerances: Tolerances, nothing: float = 0.0
) -> float | None:
    """By how much two values may differ: the tolerance, no less than what is ``nothing``, and what the intervals leave
    open; None without these.
    """
    line, halves = tolerances.statistics[name], (a.half_width, b.half_width)
    if halves[0] is None or halves[1] is None:
        return None
    size = max(abs(a.value or 0.0), abs(b.value or 0.0))
    return max(line.absolute, line.relative * size, nothing) + math.hypot(halves[0], halves[1])


def _incomparable(first: Run, second: Run) -> str:
    """Why the statistics of two runs say nothing of each other; empty where they do."""
    for name, what in (("contact_law", "laws"), ("contact_stiffness", "stiffnesses")):
        a, b = (run.settings.get(name) for run in (first, second))
        if a != b:
            remedy = "; name one for all: contact_law of the joint" if name == "contact_law" else ""
            return f"different {what} of contact ({a} and {b}){remedy}"
    return ""
