"""Rigs for the tests of the diagnosis: a believed mechanism, runs, sensors with noise, and an engine that plays what is
wrong.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import shared
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.signals import named as named_signals
from asked import request_of
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.workflow import diagnose
from compare.results.diagnosis import Diagnosis, Estimate, TriedEffect
from sim_models.engine import engine
from tests.evidence.scoreboard.hidden import Hidden
from tests.evidence.scoreboard.record import recorded, with_noise
from tests.evidence.scoreboard.rigs import Experiment, Plan
from tests.evidence.scoreboard.sizes import Planted

Result = dict[str, Any]
START = 0.4  # rad, commanded crank angle at time 0
SENSORS = {
    "crank_angle": 5e-5,
    "follower_angle": 5e-5,
    "coupler_x": 1e-5,
    "drive_torque": 1e-3,
    "reaction_E_x": 0.02,
    "reaction_E_y": 0.02,
}


def four_bar(
    case: str = "crank-rocker",
    gravity: float = 9.81,
    loads: Sequence[Load] = (Load(body="coupler", force=(5.0, -30.0)),),
) -> Mechanism:
    """A shipped case with rigid links, gravity (m/s^2, downwards) and loads."""
    return load(case).rigid().replace(gravity=(0.0, -gravity), loads=tuple(loads))


def turn(
    name: str, speed: float, loads: tuple[Load, ...] | None = None, follows: bool = False, samples: int = 120
) -> Plan:
    """One revolution at a speed (rad/s)."""
    return Plan(name, speed, START, np.linspace(0.0, 2 * math.pi / abs(speed), samples), loads, follows)


def experiment(
    *plans: Plan, mechanism: Mechanism | None = None, sensors: Mapping[str, float] | None = None
) -> Experiment:
    """A rig; left out: the four-bar, slowly forward and three times as fast in reverse."""
    runs = plans or (turn("slow", 4.0), turn("fast-reverse", -12.0))
    return Experiment("crank-rocker", mechanism or four_bar(), runs, dict(sensors or SENSORS), True, {})


def wrong(name: str, where: str, **values: float) -> Planted:
    """Something that the believed mechanism lacks."""
    return Planted(name, where, values)


def played(rig: Experiment, *effects: Planted, source: str = "exudyn", seed: int = 1) -> Measured:
    """What the rig's sensors read, simulated by ``source``, with noise."""
    return rig.measured(readings(rig, *effects, source=source, seed=seed))


def readings(rig: Experiment, *effects: Planted, source: str = "exudyn", seed: int = 1) -> list[dict[str, np.ndarray]]:
    """The same as arrays (N,), SI, by signal, for each run."""
    hidden = Hidden(seed, "effects", rig, source, "mujoco", effects)

    def simulated() -> list[dict[str, np.ndarray]]:
        return with_noise(hidden, [recorded(hidden, plan) for plan in rig.plans], np.random.default_rng(seed))

    plans = [(plan.name, plan.speed, plan.angle, plan.time.tobytes(), plan.loads, plan.follows) for plan in rig.plans]
    believed = rig.nominal.model_dump_json()
    return shared.arrays("readings", simulated, believed, plans, dict(rig.noise), effects, source, seed)


def released(
    believed: Mechanism,
    real: Mechanism,
    noise: Mapping[str, float],
    start: Sequence[tuple[float, float]],
    time: np.ndarray,
    source: str = "exudyn",
) -> Measured:
    """Free runs of the ``real`` mechanism, released at angles (rad) with rates (rad/s), read at times (N,) s, the start
    not told.
    """
    from analytic.kinematics.assembly import Assembly

    runs, rng, known = [], np.random.default_rng(1), named_signals(real.bodies, real.joints, real.drives)
    for k, (angle, rate) in enumerate(start):
        assembly = Assembly(real)
        s, u = assembly.structure, assembly.coordinates(np.array([angle]))
        turns = ((b, u[i, 0]) for i, c in enumerate(s.coordinates) for b in c.bodies if b)
        placed = {s.bodies[b]: float(turned + s.held_at[b]) for b, turned in turns}
        free = real.replace(
            assembly=placed | {real.driven: angle}, drive={"joint": real.drive_joint.name, "speed": "free"}
        )
        signals = engine(source).simulate(request_of(free, time=time, start_speed=rate)).signals
        channels = {
            s: Channel(known[s], signals[s] + sigma * rng.standard_normal(time.size), sigma, True, known[s].unit)
            for s, sigma in noise.items()
        }
        runs.append(
            MeasuredRun(
                f"swing-{k + 1}",
                time,
                channels,
                "free",
                None,
                None,
                _first(channels, believed.driven, time),
                None,
                False,
                "swing.csv",
            )
        )
    return Measured(believed, tuple(runs), {}, (), "rig")


def _first(channels: Mapping[str, Channel], driven: str, time: np.ndarray) -> dict[str, float]:
    """The driven body's state at the first sample, as its own first readings have it."""
    curve = np.polyfit(time[:8], channels[f"{driven}_angle"].values[:8], 2)
    return {f"{driven}_angle": float(curve[2]), f"{driven}_angular_velocity": float(curve[1])}


def diagnosed(measured: Measured, **options: Any) -> Result:
    """The result by MuJoCo alone, in this process."""
    return told(diagnose(measured, "mujoco", others=False, workers=1, **options))


def told(found: Diagnosis) -> Result:
    """What diagnosis.json holds of a diagnosis."""
    return dict(json.loads(found.to_json()))


def named(result: Result) -> list[tuple[str, str]]:
    """Name and place of each effect, the weightiest first."""
    return [(e["name"], e["where"]) for e in result["effects"]]


def assert_recovered(result: Result, *truth: Planted) -> None:
    """The true effects and no other, each value within four standard deviations, and the gap closed."""
    said = {(e["name"], e["where"]): e["parameters"] for e in result["effects"]}
    assert set(said) == {(t.name, t.where) for t in truth}, result["statement"]
    assert result["verdict"] == "explained", result["statement"]
    assert result["gap"]["before"] > 1.2
    assert result["gap"]["after"] <= 1.1
    for t in truth:
        assert set(said[t.name, t.where]) == set(t.values)
        for parameter, value in t.values.items():
            p = said[t.name, t.where][parameter]
            assert p["low"] <= p["value"] <= p["high"]
            assert p["high"] - p["low"] < 0.5 * abs(value) or parameter == "harmonic", (
                f"{parameter} is {p}: the data hardly know it"
            )
            assert abs(p["value"] - value) <= 4 / 1.96 * 0.5 * (p["high"] - p["low"]) + 1e-12, (
                f"{parameter} is {value}, found {p}"
            )


def valued(name: str, where: str, parameters: Mapping[str, Estimate]) -> TriedEffect:
    """An effect with its values, as a result has it."""
    return TriedEffect(
        name=name, where=where, parameters=parameters, kind="rig", share=0.1, gap_before=2.0, gap_after=1.0, failed="it"
    )
