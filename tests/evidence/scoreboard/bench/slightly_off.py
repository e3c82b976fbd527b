"""Rigs on which everything is slightly off, and one or two things matter.

Drawn: a linkage of 0.2 to 0.7 m with two or three commanded runs and the noise of a bench; every length (the
ground's too) off by 0.1 to 0.3 mm, masses by up to 1 %, coms by up to 0.5 mm, friction in every joint that takes
0.5 to 2 % of the drive's power.  One effect of ``DOMINANT`` by seed, in three sets of ten a second one: 40 to 300
sigmas each, and at least three times what all the slight things do together; each can be told from its rivals by 8
sigmas and by as many as the slight things make.
"""

from __future__ import annotations

import numpy as np

from compare.diagnose.effects.vocabulary import VOCABULARY
from tests.evidence.scoreboard.bench.rig import (
    DIAGNOSING,
    Bench,
    draw_bench,
    draw_player,
    grown,
    is_empty,
    moved,
    slightly_off,
    turn_of,
)
from tests.evidence.scoreboard.bench.sensors import read, white
from tests.evidence.scoreboard.bench.sigmas import Ruler
from tests.evidence.scoreboard.files import Readings, Recording
from tests.evidence.scoreboard.rigs import CASES, Experiment, Plan, Rejected, command_fields, ideal
from tests.evidence.scoreboard.score import DISTINCT
from tests.evidence.scoreboard.sizes import Planted

DOMINANT = (
    "payload", "link_length", "viscous_friction", "external_force", "encoder_offset", "pivot_position", "joint_spring",
    "com_offset", "coulomb_friction", "load_torque", "sensor_gain", "gravity", "drive_compliance", "joint_clearance",
)  # fmt: skip
SINGLE = ("drive_compliance", "joint_clearance")  # are dominant alone, and never second
LEAST, MOST, TIMES = 40.0, 300.0, 3.0  # sigmas; of all slight things together
TWO = 0.3  # of sets
PRESSED = 0.15  # of its peak: the reaction of a joint with clearance never falls below that


def draw(k: int, rng: np.random.Generator) -> Bench:
    """The k-th set, recorded.  Raises Rejected, SimulationError or AssemblyError where this draw makes none."""
    simulator = DIAGNOSING[k % len(DIAGNOSING)]
    names = [] if is_empty(k) else [DOMINANT[turn_of(k) % len(DOMINANT)]]
    if names and names[0] not in SINGLE and rng.random() < TWO:
        names.append(str(rng.choice([n for n in DOMINANT if n not in (*SINGLE, *names)])))
    effects = [VOCABULARY[name] for name in names]
    wanted = [sensor for effect in effects for sensor in effect.hiding.sensors]
    experiment = draw_bench(
        rng,
        list(CASES),
        ["torque", *wanted],
        slow=any(e.hiding.in_contact for e in effects),
        weight_alone="com_offset" in names,
    )
    source = draw_player(rng, simulator, effects)
    ruler = Ruler(experiment)
    slight = slightly_off(rng, experiment)
    together = float(np.linalg.norm(ruler.signature(slight)))
    if together > MOST / TIMES:
        raise Rejected(f"what is slightly off shows {together:.3g} sigma")
    least = max(LEAST, TIMES * together)
    dominant = [grown(rng, experiment, name, least, MOST, _place(rng, experiment, name)) for name in names]
    judged = ruler.judged(dominant, slight, least=max(DISTINCT, together))
    recordings = tuple(_recorded(rng, source, experiment, plan, (*slight, *judged)) for plan in experiment.plans)
    return Bench.of(experiment, (source, simulator), judged, recordings, slight, together=together)


def _place(rng: np.random.Generator, experiment: Experiment, name: str) -> str | None:
    """The joint of a clearance, whose pin keeps touching its bearing; None: anywhere."""
    if not VOCABULARY[name].hiding.in_contact:
        return None
    sizes = {
        j.name: [ideal(experiment.nominal, p)[f"reaction_{j.name}_magnitude"] for p in experiment.plans]
        for j in experiment.nominal.joints
        if not j.prismatic
    }
    able = [j for j, runs in sizes.items() if all(size.min() > PRESSED * size.max() for size in runs)]
    if not able:
        raise Rejected("no joint stays pressed")
    return str(rng.choice(able))


def _recorded(
    rng: np.random.Generator, source: str, experiment: Experiment, plan: Plan, things: tuple[Planted, ...]
) -> Recording:
    signals = moved(source, experiment, plan, things, plan.time)
    seen: Readings = {s: np.array(signals[s]) for s in experiment.noise}
    for thing in things:
        seen = read(thing, seen)
    return Recording(plan.name, plan.time, white(rng, experiment, seen), command_fields(plan))
