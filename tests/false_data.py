"""Data that are not what they say: rigs of the scoreboard with nothing wrong, played by an engine, of which one thing
that a file says is false.  One seed is one set.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism.units import dimension, factor
from sim_models.engine import SimulationError
from tests.evidence.scoreboard.files import Recording, write_files
from tests.evidence.scoreboard.hidden import Hidden, draw_source
from tests.evidence.scoreboard.record import recorded, with_noise
from tests.evidence.scoreboard.rigs import CASES, Experiment, Plan, Rejected, command_fields, draw_experiment

KINDS = ("sign", "swapped", "copy", "speed", "zero", "stamps", "unit")
SHOWS = 10.0  # times its noise that a sensor spans: of another nobody could tell what it is
OTHER = {"rad": "deg", "m": "mm", "rad/s": "rpm", "N.m": "N.mm", "N": "kN"}
Rows = list[dict[str, np.ndarray]]


@dataclass(frozen=True)
class FalseData:
    """A set: what is false in it, of which sensors and runs; none of it where nothing is."""

    kind: str
    path: Path
    signals: Sequence[str]
    runs: Sequence[str]


def make(seed: int, folder: Path, good: bool = False) -> FalseData:
    """The set of a seed in a folder; its kinds take turns.  With ``good`` nothing in it is false."""
    for attempt in range(100):
        try:
            return _made(seed, np.random.default_rng([37, seed, attempt]), folder, good)
        except (Rejected, SimulationError, AssemblyError):
            continue
    raise Rejected(f"seed {seed}: no attempt made a usable set")


def _made(seed: int, rng: np.random.Generator, folder: Path, good: bool) -> FalseData:
    kind = KINDS[seed % len(KINDS)]
    e = draw_experiment(rng, list(CASES), ("encoder", "torque", "cell"), False, False)
    follows = kind == "zero" or (kind not in ("speed", "stamps") and rng.random() < 0.4)
    e = replace(e, plans=tuple(replace(plan, follows=follows) for plan in e.plans), units={})
    digits = 12
    if kind == "stamps" and not good:
        e, digits = _coarse(e, rng)
    hidden = Hidden(seed, "none", e, draw_source(rng, "mujoco", ()), "mujoco")
    rows = with_noise(hidden, [recorded(hidden, plan) for plan in e.plans], rng)
    plans, said, signals, runs = list(e.plans), dict(e.units), [], [plan.name for plan in e.plans]
    if not good and kind != "stamps":
        some = [int(rng.integers(len(plans)))] if rng.random() < 0.5 else list(range(len(plans)))
        runs = [plans[k].name for k in some]
        signals = _spoil(kind, e, rows, plans, some, rng)
    recordings = [
        Recording(p.name, np.round(p.time, digits), row, command_fields(p)) for p, row in zip(plans, rows, strict=True)
    ]
    write_files(folder, e.nominal, recordings, said, e.noise if e.noise_given or kind == "stamps" else None)
    return FalseData("good" if good else kind, folder / "measured.toml", signals, runs)


def _spoil(
    kind: str, e: Experiment, rows: Rows, plans: list[Plan], some: Sequence[int], rng: np.random.Generator
) -> list[str]:
    """Make something false in some runs; the sensors that it is about."""
    spans = {s: min(float(np.std(row[s])) for row in rows) / e.noise[s] for s in e.noise}
    seen = [s for s in e.noise if spans[s] > SHOWS]
    free = [s for s in seen if s != e.encoder]
    if kind == "speed":
        rate = float(np.exp(rng.uniform(math.log(5e-4), math.log(2e-2)))) * (1 if rng.random() < 0.5 else -1)
        for k in some:
            plans[k] = replace(plans[k], speed=plans[k].speed * (1 + rate))
        return ["drive_speed"]
    if kind == "zero":
        zero = math.pi if rng.random() < 0.3 else float(rng.uniform(0.5, 2 * math.pi - 0.5))
        for k in some:
            rows[k][e.encoder] = rows[k][e.encoder] + zero
        return [e.encoder]
    if kind in ("sign", "unit"):
        follows = plans[0].follows
        able = seen if follows else free
        name = str(rng.choice(_able(able)))
        unit = e.signals[name].unit
        by = -1.0 if kind == "sign" else 1 / factor(OTHER[unit], dimension(e.signals[name]))
        for k in some:
            rows[k][name] = rows[k][name] * by
        return [name]
    one = str(rng.choice(_able(seen)))
    others = [s for s in seen if s != one and _apart(rows, some, one, s, e)]
    other = str(rng.choice(_able(others)))
    for k in some:
        row = rows[k]
        row[one], row[other] = (row[other], row[one]) if kind == "swapped" else (row[other].copy(), row[other])
    return [one, other]


def _able(names: Sequence[str]) -> Sequence[str]:
    if not names:
        raise Rejected("no sensor shows it")
    return names


def _apart(rows: Rows, some: Sequence[int], one: str, other: str, e: Experiment) -> bool:
    """Whether two columns have numbers so different that they can be told."""
    noise = max(e.noise[one], e.noise[other])
    return all(float(np.std(rows[k][one] - rows[k][other])) > SHOWS * noise for k in some)


def _coarse(e: Experiment, rng: np.random.Generator) -> tuple[Experiment, int]:
    """One run of many turns at a few samples each, whose time has so few decimals that the encoder shows it."""
    plan, samples = e.plans[0], int(rng.integers(8, 21))
    turns = 300 // samples
    period = 2 * math.pi / abs(plan.speed)
    time = np.arange(samples * turns) * period / samples
    off = e.noise[e.encoder] * float(rng.uniform(0.3, 1.0))  # rad, that rounding moves it by
    digits = round(-math.log10(off * math.sqrt(12) / abs(plan.speed)))
    noise = e.noise | {e.encoder: 10.0**-digits * abs(plan.speed) / math.sqrt(12) / float(rng.uniform(0.3, 1.0))}
    return replace(e, plans=(replace(plan, time=time),), noise=noise), digits
