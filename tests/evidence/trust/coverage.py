"""Predictions of hidden sets at speeds outside the data, held against what the engine that made them then does."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from compare.diagnose.workflow import diagnose
from sim_models.engine import SimulationError
from tests.evidence.results.trust import Covered
from tests.evidence.scoreboard.hidden import Hidden, draw
from tests.evidence.scoreboard.record import ATTEMPTS, recorded, with_noise
from tests.evidence.scoreboard.rigs import Plan, Rejected

SPEEDS = (1.5, 0.6, 2.0, 0.75)  # of the fastest fitted run, or of the slowest where less than one; by seed
SAMPLES = 121
NAMELESS = 3  # in every third set of effects none of the true ones may be named
BUDGET = 60.0  # s of a search: of what has no name it may go on for minutes


def ahead_of(hidden: Hidden) -> Plan:
    """A turn that is no part of the data: faster than all of them, or slower, in the direction of the first."""
    plans, share = hidden.experiment.plans, SPEEDS[hidden.seed % len(SPEEDS)]
    paces = [abs(plan.speed) for plan in plans]
    speed = share * (max(paces) if share > 1 else min(paces))
    time = np.linspace(0.0, math.tau / speed, SAMPLES)
    way = math.copysign(1.0, plans[0].speed)
    return Plan("ahead", way * speed, plans[0].angle, time, plans[0].loads)


def covered(seed: int) -> Covered:
    """A hidden set, diagnosed, and the run ahead foretold.  Raises Rejected where no attempt makes a usable set."""
    for attempt in range(ATTEMPTS):
        try:
            hidden = draw(seed, attempt)
            plans = (*hidden.experiment.plans, ahead_of(hidden))
            clean = [recorded(hidden, plan) for plan in plans]
        except (Rejected, SimulationError, AssemblyError):
            continue
        rng = np.random.default_rng([seed, attempt, 1])
        return _held(hidden, plans, clean, with_noise(hidden, clean, rng))
    raise Rejected(f"seed {seed}: none of {ATTEMPTS} attempts made a usable set")


def _held(
    hidden: Hidden, plans: tuple[Plan, ...], clean: list[dict[str, np.ndarray]], noisy: list[dict[str, np.ndarray]]
) -> Covered:
    measured = replace(hidden.experiment, plans=plans).measured(noisy)
    runs = (*measured.runs[:-1], replace(measured.runs[-1], role="validation"))
    exclude = () if hidden.outside is None else tuple(hidden.outside.excluded)
    if hidden.seed % NAMELESS == NAMELESS - 1:
        exclude = tuple(dict.fromkeys(e.name for e in hidden.truth))
    data = replace(measured, runs=runs)
    found = diagnose(data, hidden.simulator, others=False, workers=1, exclude=exclude, budget=BUDGET)
    kept, inside, noise = found.runs[-1], list[np.ndarray](), hidden.experiment.noise
    widths = [(band.high - band.low) / noise[s] for s, band in kept.prediction.items()]
    for s, band in kept.prediction.items():
        truth = clean[-1][s]
        truth = truth - math.tau * np.round((truth - band.value) / math.tau) if band.unit == "rad" else truth
        inside.append((band.low <= truth) & (truth <= band.high))
    shares = [band.covered for band in kept.prediction.values() if band.covered is not None]
    return Covered(
        seed=hidden.seed,
        kind=hidden.kind,
        nameless=bool(exclude),
        case=hidden.experiment.case,
        source=hidden.source,
        simulator=hidden.simulator,
        truth=tuple(f"{e.name}@{e.where}" for e in hidden.truth) or ((hidden.outside.kind,) if hidden.outside else ()),
        named=tuple(e.key for e in found.effects),
        verdict=found.verdict,
        speed=abs(plans[-1].speed) / max(abs(plan.speed) for plan in plans[:-1]),
        samples=sum(each.size for each in inside),
        readings=float(np.mean(shares)) if shares else None,
        true_values=float(np.mean(np.concatenate(inside))) if inside else None,
        width=float(np.median(np.concatenate(widths))) if widths else None,
        off=max((c.gap_after or 0.0 for c in kept.signals.values()), default=None),
    )


def coverage(seeds: Iterator[int]) -> Iterator[Covered]:
    """Each set of these seeds that there is."""
    for seed in seeds:
        try:
            yield covered(seed)
        except (Rejected, SimulationError):
            continue
