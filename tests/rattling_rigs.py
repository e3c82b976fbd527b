"""Hidden sets of rigs whose pins leave their bearings, and of rigs that only seem to: several revolutions in each of
three or four runs, forces and positions with noise, made by another engine than the one that diagnoses, or by an
ordinary differential equation.  One seed is one set.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.signals import named
from compare.evidence import contact_ode
from compare.evidence.scoreboard.files import Readings, Recording, write_files
from sim_models.engine import Request, SimulationError, engine

JOINTS = "DABE"
FREE = (0.01, 0.5)  # share of the time that pins fly, over all runs
NOISE = {"length": (5e-6, 3e-5), "angle": (3e-5, 2e-4), "force": (0.01, 0.1), "torque": (5e-4, 3e-3)}  # one sigma
CELLS = ("reaction_B_x", "reaction_B_y"), ("reaction_E_x", "reaction_E_y"), ("reaction_A_x", "reaction_A_y")
PLACES = ("follower_angle", "coupler_x", "coupler_y", "coupler_angle")
ATTEMPTS = 60


@dataclass(frozen=True)
class Rattling:
    """A set as drawn: the nominal mechanism, which joint has how much clearance (m; None: no clearance at all), what
    made it, and the share of the time (by distance) that its pin flew.
    """

    seed: int
    nominal: Mechanism
    joint: str | None
    clearance: float
    source: str
    free: float
    readings: tuple[Recording, ...]
    noise: Mapping[str, float]
    faults: tuple[str, ...] = ()

    def written(self, folder: Path) -> Path:
        """The set as files; measured.toml's path."""
        folder.mkdir(parents=True, exist_ok=True)
        write_files(folder, self.nominal, self.readings, {}, self.noise)
        return folder / "measured.toml"


def rattling(seed: int, source: str = "exudyn", joint: str | None = None) -> Rattling:
    """A set of a crank-rocker with one joint that rattles, free for 1 to 50 % of the time."""
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, attempt])
        nominal, speeds, noise = _rig(rng)
        where = joint or JOINTS[seed % len(JOINTS)]
        size = float(np.exp(rng.uniform(math.log(1e-4), math.log(1e-3))))
        try:
            played = [_run(rng, nominal, speed, where, size, source) for speed in speeds]
        except SimulationError:
            continue
        free = float(np.mean([share for _, _, share in played]))
        if FREE[0] <= free <= FREE[1]:
            noise = {s: sigma for s, sigma in noise.items() if s in played[0][1]}
            if not any(s.startswith("reaction") for s in noise):
                continue
            readings = _recorded(rng, played, speeds, noise)
            return Rattling(seed, nominal, where, size, source, free, readings, noise)
    raise ValueError(f"seed {seed}: none of {ATTEMPTS} attempts rattles")


def still(seed: int, source: str = "exudyn") -> Rattling:
    """A set of the same rig without any clearance, whose sensors hum, spike or ring."""
    rng = np.random.default_rng([seed, 1])
    nominal, speeds, noise = _rig(rng)
    played = [_run(rng, nominal, speed, None, 0.0, source) for speed in speeds]
    faults = tuple(rng.choice(("hum", "spikes", "resonance"), rng.integers(1, 4), replace=False).tolist())
    recorded = []
    for recording in _recorded(rng, played, speeds, noise):
        readings = dict(recording.readings)
        for fault in faults:
            readings = FAULTS[fault](np.random.default_rng([seed, FAULTY[fault]]), rng, recording.time, readings, noise)
        recorded.append(Recording(recording.name, recording.time, readings, recording.fields))
    return Rattling(seed, nominal, None, 0.0, source, 0.0, tuple(recorded), noise, faults)


# ---------------------------------------------------------------- the rig and its runs

Played = tuple[np.ndarray, Readings, float]


def _rig(rng: np.random.Generator) -> tuple[Mechanism, list[float], dict[str, float]]:
    """A loaded crank-rocker, the speeds (rad/s) of its runs, and its sensors with their noise."""
    turn, push = rng.uniform(0, 2 * math.pi), rng.uniform(0, 3.0)
    force = (push * math.cos(turn), push * math.sin(turn))
    gravity = (0.0, -9.81) if rng.random() < 0.7 else (0.0, 0.0)
    nominal = load("crank-rocker").rigid().replace(gravity=gravity, loads=(Load(body="coupler", force=force),))
    fastest = rng.uniform(18.0, 42.0)
    speeds = [fastest, -rng.uniform(0.6, 0.95) * fastest, rng.uniform(0.5, 0.9) * fastest]
    speeds += [rng.uniform(0.6, 0.9) * fastest] if rng.random() < 0.3 else []
    places = rng.choice(PLACES, rng.integers(1, 4), replace=False).tolist()
    cells = [s for k in rng.choice(len(CELLS), rng.integers(1, 3), replace=False) for s in CELLS[k]]
    sensors = ["crank_angle", *places, *cells, *(["drive_torque"] if rng.random() < 0.7 else [])]
    known = named(nominal.bodies, nominal.joints, nominal.drives)
    kinds = {"rad": "angle", "m": "length", "N": "force", "N.m": "torque"}
    noise = {s: float(np.exp(rng.uniform(*np.log(NOISE[kinds[known[s].unit]])))) for s in sensors}
    return nominal, speeds, noise


def _run(
    rng: np.random.Generator, nominal: Mechanism, speed: float, joint: str | None, size: float, source: str
) -> Played:
    """Times (N,) s, what noiseless sensors read, and the share of the time that the pin is off the wall."""
    turns, samples, start = int(rng.integers(5, 9)), int(rng.integers(150, 301)), rng.uniform(0, 2 * math.pi)
    time = np.linspace(0.0, 2 * math.pi * turns / abs(speed), turns * samples)
    real = nominal if joint is None else nominal.with_clearances({joint: size})
    assert real.drive is not None
    real = real.replace(drive=real.drive.model_copy(update={"speed": speed}))
    angle = start + speed * time
    if source == "ode":
        assert joint == "B"
        return _by_ode(rng, real, joint, time, start)
    model = "ideal" if joint is None else "contact"
    trace = engine(source).simulate(Request(real, model, "driven", crank_angle=angle))
    share = 0.0 if joint is None else float(trace.free_share[joint])
    return time, {**trace.signals, "crank_angle": angle}, share


def _by_ode(rng: np.random.Generator, real: Mechanism, joint: str, time: np.ndarray, start: float) -> Played:
    """The same by the ordinary differential equation, of a pin whose law and restitution are drawn."""
    law = str(rng.choice(("kelvin-voigt", "lankarani-nikravesh", "flores")))
    real = real.with_joint(joint, contact_law=law, restitution=float(rng.uniform(0.1, 0.6)))
    loop = contact_ode.loop_of(real, start)
    begin, step = contact_ode.pressed(real, loop), float(time[1])
    found = contact_ode.simulate(real, loop, begin, abs(loop.speed) * float(time[-1]), step=step)
    seen, force = found.watched, found.watched.force[joint]
    signals = {"crank_angle": seen.angle["crank"], "drive_torque": seen.torque}
    signals |= {f"{body}_angle": seen.angle[body] for body in ("coupler", "follower")}
    signals |= {"coupler_x": seen.place["coupler"].real, "coupler_y": seen.place["coupler"].imag}
    signals |= {f"reaction_{joint}_x": force.real, f"reaction_{joint}_y": force.imag}
    return seen.time, signals, float(np.mean(np.abs(found.gap) < real.joint(joint).clearance))


def _recorded(
    rng: np.random.Generator, played: list[Played], speeds: list[float], noise: Mapping[str, float]
) -> tuple[Recording, ...]:
    found = []
    for k, ((time, signals, _), speed) in enumerate(zip(played, speeds, strict=True)):
        read = {s: signals[s] + sigma * rng.standard_normal(time.size) for s, sigma in noise.items()}
        fields = {"drive_speed": speed, "drive_angle": float(signals["crank_angle"][0])}
        found.append(Recording(f"run-{k + 1}", time, read, fields))
    return tuple(found)


# ---------------------------------------------------------------- sensors' own faults


def _hum(
    fixed: np.random.Generator, rng: np.random.Generator, time: np.ndarray, read: Readings, noise: Mapping[str, float]
) -> Readings:
    """The mains in forces and torque, and sometimes in all."""
    frequency, wide = float(fixed.choice((50.0, 60.0))), fixed.random() < 0.3
    out = dict(read)
    for s in read:
        size = math.exp(fixed.uniform(math.log(2), math.log(40))) * noise[s]
        if s != "crank_angle" and (wide or s.startswith(("reaction", "drive"))):
            out[s] = read[s] + size * np.sin(2 * math.pi * frequency * time + rng.uniform(0, 2 * math.pi))
    return out


def _spikes(
    fixed: np.random.Generator, rng: np.random.Generator, time: np.ndarray, read: Readings, noise: Mapping[str, float]
) -> Readings:
    """Single samples that are wrong, in some channels, each by itself."""
    share = math.exp(fixed.uniform(math.log(2e-3), math.log(2e-2)))
    which = [s for s in read if s != "crank_angle" and fixed.random() < 0.6]
    out = dict(read)
    for s in which:
        hit = rng.random(time.size) < share
        size = noise[s] * np.exp(rng.uniform(math.log(20), math.log(500), time.size))
        out[s] = read[s] + hit * size * rng.choice((-1.0, 1.0), time.size)
    return out


def _resonance(
    fixed: np.random.Generator, rng: np.random.Generator, time: np.ndarray, read: Readings, noise: Mapping[str, float]
) -> Readings:
    """Load cells that ring, knocked now and then or once in a turn."""
    frequency, ratio = fixed.uniform(60, 300), math.exp(fixed.uniform(math.log(0.01), math.log(0.1)))
    step = float(np.median(np.diff(time)))
    omega = 2 * math.pi * min(frequency, 0.35 / step)
    decay, root = math.exp(-ratio * omega * step), math.sqrt(1 - ratio**2)
    a = [1.0, -2 * decay * math.cos(omega * root * step), decay**2]
    knocks = np.zeros(time.size)
    if fixed.random() < 0.5:
        angle, at = np.asarray(read["crank_angle"]), fixed.uniform(0, 2 * math.pi)
        knocks[1:] = np.diff(np.floor((angle - at) / (2 * math.pi))) != 0
        knocks *= rng.uniform(0.5, 1.5, time.size)
    else:
        knocks = (rng.random(time.size) < fixed.uniform(2e-3, 2e-2)) * rng.standard_normal(time.size)
    size = math.exp(fixed.uniform(math.log(10), math.log(300)))
    rung = lfilter([1.0], a, knocks)
    cells = [s for s in read if s.startswith("reaction")]
    return {s: v + (size * noise[s] * fixed.uniform(0.3, 1.0) * rung if s in cells else 0.0) for s, v in read.items()}


FAULTS = {"hum": _hum, "spikes": _spikes, "resonance": _resonance}
FAULTY = {"hum": 2, "spikes": 3, "resonance": 4}
