"""Which party stands apart: the analytic model, one engine, or none.

A party stands apart on a signal when all the others agree with each other within the signal's tolerance and it agrees
with none of them.  It takes three parties to say so; the spread between engines is the uncertainty of what they say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from analytic.mechanism.signals import Signal
from compare.judge.discrepancy import Difference, Rule, difference
from compare.results.crosscheck import Run, Spread

ANALYTIC = "analytic"


@dataclass(frozen=True)
class Apart:
    """A party that stands apart on a signal: by how much from the nearest other, and how far the others are spread."""

    party: str
    signal: Signal
    by: float  # in the signal's unit, signed
    share: float  # of the tolerance, unsigned
    others_spread: float


@dataclass(frozen=True)
class Attribution:
    """What several engines say together: their spread by signal, who stands apart (or None), and where most clearly.

    ``differ`` says whether any of them disagrees with the analytic model, ``struck`` whether pins struck in any.
    """

    spread: Mapping[str, Spread]
    odd_one_out: str | None
    clearest: Apart | None
    differ: bool
    struck: bool


def spread(
    signal: Signal, engines: Mapping[str, np.ndarray], tolerance: np.ndarray
) -> tuple[Difference, tuple[str, str]] | None:
    """The largest difference between any two engines on a signal, and which two; None with fewer than two, or no common
    sample.
    """
    pairs = [
        (apart, (a, b))
        for a, b in combinations(engines, 2)
        if (apart := difference(signal.apart(engines[a], engines[b]), tolerance))
    ]
    return max(pairs, key=lambda pair: pair[0].share, default=None)


def stands_apart(signal: Signal, parties: Mapping[str, np.ndarray], tolerance: np.ndarray) -> Apart | None:
    """The one party that stands apart on a signal, or None; ``tolerance`` (N,) is what each sample may differ by."""
    if len(parties) < 3:
        return None
    distance = {}
    for a, b in permutations(parties, 2):
        apart = difference(signal.apart(parties[a], parties[b]), tolerance)
        if apart is None:
            return None
        distance[a, b] = apart
    for party in parties:
        others = [p for p in parties if p != party]
        widest = max((distance[pair] for pair in combinations(others, 2)), key=lambda d: d.share)
        nearest = min((distance[party, other] for other in others), key=lambda d: d.share)
        if widest.share <= 1 < nearest.share:
            return Apart(party, signal, nearest.max, nearest.share, abs(widest.max))
    return None


def odd_one_out(standing_apart: Sequence[Apart]) -> str | None:
    """The party that stands apart on the most signals, if no other party stands apart on any as clearly."""
    parties = {apart.party for apart in standing_apart}
    if len(parties) == 1:
        return parties.pop()
    counts = sorted(((sum(a.party == p for a in standing_apart), p) for p in parties), reverse=True)
    return counts[0][1] if counts and counts[0][0] >= 3 * counts[1][0] else None


def attribute(judged: Sequence[tuple[Run, Mapping[str, Rule]]]) -> Attribution:
    """What only several engines can say: how far they are spread, and which party stands apart.

    ``judged`` are the result's runs with the rules by which each was held to the analytic side; engines are compared
    within each joint model, by the widest rule among them, each by what it is off its own analytic side.
    """
    runs = [run for run, _ in judged]
    widest: dict[str, Spread] = {}
    apart: list[Apart] = []
    for joint_model in dict.fromkeys(run.joint_model for run in runs):
        group = [run for run in runs if run.joint_model == joint_model]
        rules = [rule for run, rule in judged if run.joint_model == joint_model]
        theta, analytic = group[0].crank_angle, group[0].analytic
        alike = np.all([before_impact(run) for run in group], axis=0)
        for name in dict.fromkeys(name for rule in rules for name in rule):
            having = [rule[name] for rule in rules if name in rule]
            signal, tolerance = having[0].signal, np.max([rule.tolerance(analytic) for rule in having], axis=0)
            tolerance = np.where(alike, tolerance, np.nan)
            engines = {
                run.simulator.name: run.simulated[name] - run.analytic[name] + analytic[name]
                for run, rule in zip(group, rules, strict=True)
                if name in rule
            }
            wide = spread(signal, engines, tolerance)
            if wide is None:
                continue
            largest, between = wide
            size, at = abs(largest.max), float(theta[largest.at])
            if name not in widest or size > widest[name].max:
                widest[name] = Spread(max=size, at_crank_angle=at, between=between, joint_model=joint_model)
            alone = stands_apart(signal, {ANALYTIC: analytic[name], **engines}, tolerance)
            if alone is not None:
                apart.append(alone)
    odd = odd_one_out(apart)
    differ = any(run.verdict == "disagrees" for run in runs)
    struck = any(run.contact is not None and run.contact.struck for run in runs)
    clearest = max((a for a in apart if a.party == odd), key=lambda a: a.share, default=None)
    return Attribution(widest, odd, clearest, differ, struck)


def before_impact(run: Run) -> np.ndarray:
    """At which samples (N,) of a run its pins have not struck yet, so that it may be compared sample by sample: at none
    where the crank has made a turn before, in which they struck as well.
    """
    if run.contact is None or not run.contact.struck:
        return np.ones(run.crank_angle.size, bool)
    if run.contact.revolutions >= 1:
        return np.zeros(run.crank_angle.size, bool)
    first = min(
        abs(j.first_impact - run.crank_angle[0]) for j in run.contact.joints.values() if j.first_impact is not None
    )
    return np.abs(run.crank_angle - run.crank_angle[0]) < first
