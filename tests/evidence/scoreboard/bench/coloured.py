"""Noise that is not white: drift, hum, and amplifiers with a filter.

Drawn: a linkage with two or three commanded runs (in a third of the sets they are uneven and follow their encoder)
of 200 to 1000 samples at 100 to 400 Hz, each of one and a half turns at least.  Each sensor's noise is white, plus
in most of them 1/f noise or drift with a memory of 0.1 to 1 s, of 0.5 to 3 times the white rms; force and torque
channels have hum at 50 Hz (0.5 to 2 of the white), sampled as it comes; the drive torque and the load cells pass
one first-order filter of 20 to 50 Hz; some channels drift steadily by 2 to 10 sigmas a run.  One effect, in three
of ten sets two, of 40 to 200 white sigmas, which can be told from all others by 15 sigmas with an offset, a slope,
three waves of each channel and run and the filters' lag free.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from compare.diagnose.effects.vocabulary import VOCABULARY
from tests.evidence.scoreboard.bench.nuisances import lagging, of_channels
from tests.evidence.scoreboard.bench.rig import (
    DIAGNOSING,
    Bench,
    Fault,
    draw_bench,
    draw_player,
    grown,
    is_empty,
    moved,
    turn_of,
    uneven,
)
from tests.evidence.scoreboard.bench.sensors import drifting, filtered, history, hum, pink, read
from tests.evidence.scoreboard.bench.sigmas import Ruler
from tests.evidence.scoreboard.files import Readings, Recording
from tests.evidence.scoreboard.rigs import CASES, Experiment, Plan, Rejected, command_fields
from tests.evidence.scoreboard.sizes import Planted

EFFECTS = (
    "payload", "link_length", "viscous_friction", "joint_spring", "pivot_position", "external_force", "com_offset",
    "coulomb_friction", "gravity", "load_torque",
)  # fmt: skip
TURNS = 1.5  # at least, of every run
SAMPLES, RATE, CRANK = (200, 1000), (100.0, 400.0), (4.0, 14.0)  # a run; Hz; rad/s
LEAST, MOST, TOLD = 40.0, 200.0, 15.0  # white sigmas; left after the best rival
TWO = 0.3  # of sets have two effects
COLOURED, COLOUR, MEMORY = 0.7, (0.5, 3.0), (0.1, 1.0)  # share of channels; of the white rms; s
HUM, FILTER = (0.5, 2.0), (20.0, 50.0)  # of the white rms; Hz
STEADY, SLOPE = 0.25, (2.0, 10.0)  # share of channels; sigmas a run
WAVES = 3  # that a slow drift may be made of


@dataclass(frozen=True)
class Colour:
    """The noise of a channel over its white rms: ``pink`` or drift of a ``memory`` (s), hum, and a slope a run."""

    size: float
    memory: float | None
    hum: float
    slope: float


def draw(k: int, rng: np.random.Generator) -> Bench:
    """The k-th set, recorded.  Raises Rejected, SimulationError or AssemblyError where this draw makes none."""
    simulator = DIAGNOSING[k % len(DIAGNOSING)]
    names = [] if is_empty(k) else [EFFECTS[turn_of(k) % len(EFFECTS)]]
    if names and rng.random() < TWO:
        names.append(str(rng.choice([n for n in EFFECTS if n not in names])))
    experiment = draw_bench(rng, list(CASES), ["torque"])
    follows = bool(rng.random() < 1 / 3)
    experiment = replace(experiment, plans=_plans(rng, experiment, follows), noise_given=bool(rng.random() < 1 / 3))
    if follows and experiment.encoder not in experiment.noise:
        raise Rejected("a run that follows its encoder needs one")
    group = amplified(experiment)
    corner = rng.uniform(*FILTER)
    colours = {s: _colour(rng, s in group, follows and s == experiment.encoder) for s in experiment.noise}
    ruler = Ruler(experiment)
    free = np.column_stack([of_channels(experiment, WAVES), lagging(ruler, group)])
    truth = [grown(rng, experiment, name, LEAST, MOST) for name in names]
    judged = ruler.judged(truth, (), free, TOLD)
    source = draw_player(rng, simulator, [VOCABULARY[e.name] for e in judged])
    lag = 1 / (2 * math.pi * corner)
    recordings = tuple(_recorded(rng, source, experiment, p, judged, colours, group, lag) for p in experiment.plans)
    faults = _faults(experiment.encoder, group, lag, colours)
    return Bench.of(experiment, (source, simulator), judged, recordings, faults=faults)


def _plans(rng: np.random.Generator, experiment: Experiment, follows: bool) -> tuple[Plan, ...]:
    """The runs at a logger's rate, of some turns each."""
    plans = []
    slowest = min(abs(p.speed) for p in experiment.plans)
    rate, n = rng.uniform(*RATE), int(rng.integers(SAMPLES[0], SAMPLES[1] + 1))
    faster = rng.uniform(*CRANK) / slowest
    n = max(n, math.ceil(TURNS * 2 * math.pi / (faster * slowest) * rate))
    if n > SAMPLES[1]:
        raise Rejected("too slow for the logger's memory")
    for plan in experiment.plans:
        speed = min(abs(plan.speed) * faster, CRANK[1]) * math.copysign(1.0, plan.speed)
        even = replace(plan, speed=speed, time=np.arange(n) / rate)
        plans.append(uneven(rng, even, 0.01, 0.03) if follows else even)
    return tuple(plans)


def amplified(experiment: Experiment) -> tuple[str, ...]:
    """Sensors of forces and of the drive torque, which one amplifier has."""
    return tuple(s for s in experiment.noise if experiment.signals[s].kind in ("drive", "reaction"))


def _colour(rng: np.random.Generator, hums: bool, encoder: bool) -> Colour:
    """An encoder that the motor follows is white."""
    size = rng.uniform(*COLOUR) if rng.random() < COLOURED else 0.0
    memory = float(np.exp(rng.uniform(*np.log(MEMORY)))) if rng.random() < 0.5 else None
    mains = rng.uniform(*HUM) if hums else 0.0
    slope = float(rng.choice([-1, 1]) * rng.uniform(*SLOPE)) if rng.random() < STEADY else 0.0
    return Colour(0.0, None, 0.0, 0.0) if encoder else Colour(size, memory, mains, slope)


def _faults(encoder: str, group: tuple[str, ...], lag: float, colours: Mapping[str, Colour]) -> list[Fault]:
    """One lag of all amplified channels, and the drift of each that drifts (its mean over a run is a bias)."""
    found = [Fault(name, s, {key: lag}) for s in group for name, key in LATE]
    for signal, colour in colours.items():
        if colour.size or colour.slope:
            bias = "encoder_offset" if signal == encoder else "sensor_bias"
            found += [Fault("sensor_drift", signal), Fault(bias, signal)]
    return found


LATE = (("sensor_lag", "time_constant"), ("sensor_delay", "delay"))


def _recorded(
    rng: np.random.Generator,
    source: str,
    experiment: Experiment,
    plan: Plan,
    truth: tuple[Planted, ...],
    colours: Mapping[str, Colour],
    group: tuple[str, ...],
    lag: float,
) -> Recording:
    seen = lagged(source, experiment, plan, truth, dict.fromkeys(group, lag))
    for thing in truth:
        seen = read(thing, seen)
    n, span = plan.time.size, plan.time[-1]
    noisy: Readings = {}
    for signal, values in seen.items():
        colour, sigma = colours[signal], experiment.noise[signal]
        wander = pink(rng, n) if colour.memory is None else drifting(rng, n, plan.time[1], colour.memory)
        mains = hum(plan.time, colour.hum, rng.uniform(0, 2 * math.pi))
        whole = rng.standard_normal(n) + colour.size * wander + mains + colour.slope * plan.time / span
        noisy[signal] = values + sigma * whole
    return Recording(plan.name, plan.time, noisy, command_fields(plan))


def lagged(
    source: str,
    experiment: Experiment,
    plan: Plan,
    truth: tuple[Planted, ...],
    lags: Mapping[str, float],
    late: float = 0.0,
) -> Readings:
    """What sensors without noise read whose amplifiers have lags (s, by signal) and whose clock is ``late`` (s).

    The filters see the true signal 8 times in a time constant, from eight of them before the run.
    """
    asked = plan.time - late
    if not lags:
        signals = moved(source, experiment, plan, truth, asked)
        return {s: np.array(signals[s]) for s in experiment.noise}
    time = history(asked, list(lags.values()))
    signals, at = moved(source, experiment, plan, truth, time), np.searchsorted(time, asked)
    return {
        s: np.array((filtered(time, signals[s], lags[s]) if s in lags else signals[s])[at]) for s in experiment.noise
    }
