"""Cheap loggers: an encoder of few counts, few samples a turn, an uneven hand, and stamps that jitter.

Drawn: two to four runs of 60 to 250 samples that follow their encoder (1000 to 4096 counts a turn, rounded), 5 to
25 deg of crank from sample to sample, speed uneven by 3 to 8 % (one or two harmonics of the crank, and slow waves),
stamps that are up to 2 to 5 % of the interval off, two or three sensors beside the encoder.  One effect of 40 to
200 sigmas, a sigma being white noise and what a rounded encoder makes of it, which can be told from all others by
15 sigmas.  Every third set is a student's slider-crank: six runs at 50 Hz and 6 to 22 deg a sample, the slider to
0.3 mm and in half of them the rod's angle, a length or a pivot wrong by 1.5 to 4 mm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analytic.mechanism.signals import Signal
from compare.diagnose.effects.vocabulary import VOCABULARY
from tests.evidence.scoreboard.bench.rig import (
    DIAGNOSING,
    Bench,
    Fault,
    UnevenPlan,
    draw_player,
    enlarged,
    grown,
    is_empty,
    moved,
    peaks_of,
    uneven,
)
from tests.evidence.scoreboard.bench.sensors import counted, read, white
from tests.evidence.scoreboard.bench.sigmas import Ruler
from tests.evidence.scoreboard.files import Readings, Recording
from tests.evidence.scoreboard.rigs import (
    Experiment,
    Plan,
    command_fields,
    draw_log,
    draw_mechanism,
    draw_sensors,
    ideal,
)
from tests.evidence.scoreboard.sizes import Planted

EFFECTS = (
    "link_length", "payload", "pivot_position", "viscous_friction", "external_force", "joint_spring",
    "load_torque", "coulomb_friction", "sensor_gain", "gravity",
)  # fmt: skip
COUNTS = (1000, 1024, 2000, 2048, 2500, 3600, 4096)  # of encoders, a turn
STEP, STUDENT_STEP = (5.0, 25.0), (6.0, 22.0)  # deg of crank a sample
RATE = 50.0  # Hz, of a student's logger
SAMPLES, RUNS = (60, 250), (2, 4)
JITTER = (0.02, 0.05)  # of the interval, either way
SPEED = {"crank-rocker": (4.0, 15.0), "slider-crank": (5.0, 25.0), "six-bar": (4.0, 9.0)}  # rad/s
LEAST, MOST, TOLD = 40.0, 200.0, 15.0  # sigmas; left after the best rival
FAULT = (1.5e-3, 4e-3)  # m, of a student's rig


def draw(k: int, rng: np.random.Generator) -> Bench:
    """The k-th set, recorded.  Raises Rejected, SimulationError or AssemblyError where this draw makes none."""
    simulator, counts = DIAGNOSING[k % len(DIAGNOSING)], int(rng.choice(COUNTS))
    student = k % 3 == 0 if not is_empty(k) else (k // 6) % 3 == 0
    experiment = _student(rng) if student else _rig(rng)
    rounded = replace(experiment, noise=_with_rounding(experiment, counts))
    truth: list[Planted] = []
    if not is_empty(k):
        truth = [_wrong_length(rng) if student else grown(rng, rounded, effect_of(k), LEAST, MOST)]
    judged = Ruler(rounded).judged(truth, least=TOLD)
    source = draw_player(rng, simulator, [VOCABULARY[e.name] for e in judged])
    jitter = rng.uniform(*JITTER)
    recordings = tuple(_recorded(rng, source, experiment, p, judged, counts, jitter) for p in experiment.plans)
    noise = {s: sigma for s, sigma in experiment.noise.items() if s != experiment.encoder}
    jitters = [Fault("stamp_jitter", experiment.encoder)]
    return Bench.of(replace(experiment, noise=noise), (source, simulator), judged, recordings, faults=jitters)


def effect_of(k: int) -> str:
    """The effect of the k-th set, if it is neither empty nor a student's: they are gone through in order."""
    return EFFECTS[(3 * (k // 6) + k % 6 - 1 - (k % 6 > 3)) % len(EFFECTS)]


def _rig(rng: np.random.Generator) -> Experiment:
    """Any linkage of 0.2 to 0.7 m with two or three sensors beside its encoder."""
    case = str(rng.choice(list(SPEED)))
    nominal = enlarged(draw_mechanism(rng, case), draw_log(rng, 2.0, 4.0))
    count = int(rng.integers(RUNS[0], RUNS[1] + 1))
    plans = [_plan(rng, f"run-{i + 1}", draw_log(rng, *SPEED[case]), None) for i in range(count)]
    peaks = peaks_of(nominal, plans)
    encoder = Signal.of("pose", nominal.driven, "angle")
    sensors = [s for s in draw_sensors(rng, nominal, peaks, ["encoder"]) if s != encoder][: int(rng.integers(2, 4))]
    noise = {encoder.name: 1e-4} | {s.name: _coarse_noise(rng, s, peaks) for s in sensors}
    return Experiment(case, nominal, tuple(plans), noise, bool(rng.random() < 0.5), {})


def _student(rng: np.random.Generator) -> Experiment:
    """A slider-crank of wood or aluminium, turned by hand or a small motor, without any load to speak of."""
    nominal = draw_mechanism(rng, "slider-crank")
    nominal = enlarged(nominal, rng.uniform(0.05, 0.08) / nominal.moving["crank"].length).replace(
        gravity=(0.0, -9.81), loads=()
    )
    plans = [_plan(rng, f"run-{i + 1}", 0.0, RATE) for i in range(6)]
    noise = {"crank_angle": 1e-4, "slider_x": 3e-4}
    if rng.random() < 0.5:
        noise["rod_angle"] = math.radians(rng.uniform(0.1, 0.3))
    units = {"crank_angle": "deg", "rod_angle": "deg", "slider_x": "mm"}
    return Experiment("slider-crank", nominal, tuple(plans), noise, bool(rng.random() < 0.5), units)


def _plan(rng: np.random.Generator, name: str, speed: float, rate: float | None) -> UnevenPlan:
    """A run in which the crank turns 5 to 25 deg a sample, whatever the logger's rate; at ``rate`` (Hz) 6 to 22 deg."""
    step = math.radians(rng.uniform(*(STEP if rate is None else STUDENT_STEP)))
    speed = speed if rate is None else step * rate
    n = int(rng.integers(SAMPLES[0], SAMPLES[1] + 1))
    sign, angle = float(rng.choice([-1, 1])), float(rng.uniform(-math.pi, math.pi))
    return uneven(rng, Plan(name, sign * speed, angle, step / speed * np.arange(n), None))


def _coarse_noise(rng: np.random.Generator, signal: Signal, peaks: dict[str, float]) -> float:
    if signal.kind == "pose":
        return math.radians(rng.uniform(0.02, 0.1)) if signal.wraps else draw_log(rng, 5e-5, 2e-4)
    return peaks[signal.name] * rng.uniform(0.005, 0.01)


def _with_rounding(experiment: Experiment, counts: int) -> dict[str, float]:
    """One sigma of each sensor, white noise and what the crank's rounding makes of it."""
    rounding = 2 * math.pi / counts / math.sqrt(12)
    noise = {}
    for signal, sigma in experiment.noise.items():
        slopes = []
        for plan in experiment.plans:
            even = Plan(plan.name, plan.speed, plan.angle, np.linspace(0, 2 * math.pi / abs(plan.speed), 181), None)
            slopes.append(np.gradient(ideal(experiment.nominal, even)[signal], even.speed * even.time))
        steep = math.sqrt(float(np.mean(np.square(slopes))))
        noise[signal] = rounding if signal == experiment.encoder else math.hypot(sigma, steep * rounding)
    return noise


def _wrong_length(rng: np.random.Generator) -> Planted:
    size = float(rng.choice([-1, 1]) * rng.uniform(*FAULT))
    where = str(rng.choice(["crank", "rod", "O"]))
    if where != "O":
        return Planted("link_length", where, {"length_error": size})
    turn = rng.uniform(-0.5, 0.5)
    return Planted("pivot_position", where, {"x": size * math.cos(turn), "y": size * math.sin(turn)})


def _recorded(
    rng: np.random.Generator,
    source: str,
    experiment: Experiment,
    plan: Plan,
    truth: Sequence[Planted],
    counts: int,
    jitter: float,
) -> Recording:
    signals = moved(source, experiment, plan, truth, plan.time)
    seen: Readings = {s: np.array(signals[s]) for s in experiment.noise}
    for thing in truth:
        seen = read(thing, seen)
    encoder = counted(seen[experiment.encoder], counts)
    stamps = plan.time + jitter * (plan.time[1] - plan.time[0]) * rng.uniform(-1, 1, plan.time.size)
    noisy = {**white(rng, experiment, seen), experiment.encoder: encoder}
    return Recording(plan.name, stamps - stamps[0], noisy, command_fields(plan))
