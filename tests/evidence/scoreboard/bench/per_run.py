"""Sensors that are wrong in each run in their own way.

Drawn: a linkage with four to six runs, commanded (even sets) or uneven and following their encoder (odd ones); in
each run a zero of the encoder of its own (0.5 to 5 deg at most), a tare of each force and torque channel (3 to 30
sigmas at most), and in half of the commanded sets a late or early clock (up to 2 deg of the crank); one first-order
lag (2 to 10 ms) of the drive torque and the load cells.  One effect of the rig of 40 to 200 sigmas with all that
free; its parameters are known to 1.7 %, one sigma, so that 5 % can be asked for.  Noise is stated in half of the
sets.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from compare.diagnose.effects.vocabulary import VOCABULARY
from tests.evidence.scoreboard.bench.coloured import amplified, lagged
from tests.evidence.scoreboard.bench.nuisances import encoder_zeros, lagging, late_clocks, of_channels
from tests.evidence.scoreboard.bench.rig import (
    DIAGNOSING,
    Bench,
    Fault,
    draw_bench,
    draw_player,
    grown,
    is_empty,
    turn_of,
    uneven,
)
from tests.evidence.scoreboard.bench.sensors import white
from tests.evidence.scoreboard.bench.sigmas import Ruler
from tests.evidence.scoreboard.files import Recording
from tests.evidence.scoreboard.rigs import CASES, Experiment, Plan, Rejected, command_fields, draw_log
from tests.evidence.scoreboard.sizes import Planted

EFFECTS = (
    "link_length", "viscous_friction", "payload", "pivot_position", "coulomb_friction", "com_offset", "joint_spring",
    "external_force",
)  # fmt: skip
REVOLUTE = frozenset({"joint_spring"})  # in revolute joints only
RUNS = (4, 6)
ZERO, TARE, LATE = (0.5, 5.0), (3.0, 30.0), 2.0  # deg at most; sigmas at most; deg of the crank at most
LAG = (2e-3, 1e-2)  # s
LEAST, MOST = 40.0, 200.0  # sigmas that are left with all faults free
KNOWN = 0.017  # of an effect's parameters: their standard error


def draw(k: int, rng: np.random.Generator) -> Bench:
    """The k-th set, recorded.  Raises Rejected, SimulationError or AssemblyError where this draw makes none."""
    simulator, follows = DIAGNOSING[(k // 2) % len(DIAGNOSING)], k % 2 == 1
    experiment = draw_bench(rng, list(CASES), ["torque", "encoder"])
    experiment = replace(experiment, plans=_plans(rng, experiment, follows))
    clocks = not follows and k % 4 == 0
    group = amplified(experiment)
    ruler = Ruler(experiment)
    free = [encoder_zeros(ruler), of_channels(experiment, 0, group), lagging(ruler, group)]
    nuisances = np.column_stack([*free, *([late_clocks(ruler)] if clocks else [])])
    name = EFFECTS[turn_of(k) % len(EFFECTS)]
    revolute = [j.name for j in experiment.nominal.joints if not j.prismatic]
    where = str(rng.choice(revolute)) if name in REVOLUTE else None
    truth = [] if is_empty(k) else [grown(rng, experiment, name, LEAST, 10 * MOST, where)]
    judged = ruler.judged(truth, (), nuisances, LEAST)
    _known(ruler, judged, nuisances)
    source = draw_player(rng, simulator, [VOCABULARY[e.name] for e in judged])
    lag = draw_log(rng, *LAG)
    zeros = _each(rng, experiment, math.radians(rng.uniform(*ZERO)))
    tares = {s: _each(rng, experiment, experiment.noise[s] * rng.uniform(*TARE)) for s in group}
    lates = {
        p.name: float(rng.uniform(-1, 1)) * math.radians(LATE) / abs(p.speed) if clocks else 0.0
        for p in experiment.plans
    }
    recordings = []
    for plan in experiment.plans:
        seen = lagged(source, experiment, plan, judged, dict.fromkeys(group, lag), lates[plan.name])
        seen[experiment.encoder] = seen[experiment.encoder] + zeros[plan.name]
        seen |= {s: seen[s] + tares[s][plan.name] for s in group}
        recordings.append(Recording(plan.name, plan.time, white(rng, experiment, seen), command_fields(plan)))
    faults = _faults(experiment.encoder, zeros, tares, lates if clocks else {}, lag)
    stated = replace(experiment, noise_given=bool(rng.random() < 0.5))
    return Bench.of(stated, (source, simulator), judged, recordings, faults=faults)


def _plans(rng: np.random.Generator, experiment: Experiment, follows: bool) -> tuple[Plan, ...]:
    """Four to six runs at speeds between those of the experiment, some backwards."""
    first, speeds = experiment.plans[0], [abs(p.speed) for p in experiment.plans]
    n, plans = first.time.size, []
    for i in range(int(rng.integers(RUNS[0], RUNS[1] + 1))):
        speed = draw_log(rng, min(speeds), max(speeds))
        even = replace(
            first,
            name=f"run-{i + 1}",
            speed=speed * (-1.0 if i % 3 == 2 else 1.0),
            angle=float(rng.uniform(-math.pi, math.pi)),
            time=np.linspace(0.0, rng.uniform(1.2, 2.2) * 2 * math.pi / speed, n),
        )
        plans.append(uneven(rng, even, 0.01, 0.03) if follows else even)
    return tuple(plans)


def _known(ruler: Ruler, judged: tuple[Planted, ...], nuisances: np.ndarray) -> None:
    """Raises Rejected for an effect that these data do not tell from others, or not well enough."""
    for effect in judged:
        if effect.distinct > MOST:
            raise Rejected(f"{effect.name} is left with {effect.distinct:.3g} sigma")
        if ruler.uncertainty(effect, nuisances) > KNOWN:
            raise Rejected(f"the parameters of {effect.name} are not known well enough")


def _each(rng: np.random.Generator, experiment: Experiment, most: float) -> dict[str, float]:
    return {plan.name: float(most * rng.uniform(-1, 1)) for plan in experiment.plans}


def _faults(
    encoder: str,
    zeros: Mapping[str, float],
    tares: Mapping[str, Mapping[str, float]],
    lates: Mapping[str, float],
    lag: float,
) -> list[Fault]:
    found = [Fault("encoder_offset", encoder, {f"offset@{run}": v for run, v in zeros.items()})]
    found += [Fault("clock_offset", run, {"offset": v}) for run, v in lates.items()]
    for signal, tare in tares.items():
        found.append(Fault("sensor_bias", signal, {f"bias@{run}": v for run, v in tare.items()}))
        found.append(Fault("sensor_lag", signal, {"time_constant": lag}))
        found.append(Fault("sensor_delay", signal, {"delay": lag}))
    return found
