"""Rigs whose pins leave their bearings, and rigs that only seem to.

Drawn: a loaded crank-rocker or slider-crank, five to eight revolutions in each of three or four runs of 150 to 300
samples a revolution, positions, forces and often the torque, with noise.  Of sets that *rattle* one pin has clearance
and flies for 1 to 50 % of the time (by distance), a quarter of the sets in each of four bands of that; its impacts give
back by a law and a restitution that are drawn too, or as the engine's own contact does.  Two in three are recorded by
Exudyn, the third by an ordinary differential equation with event location.  Of *still* ones no pin has any clearance,
but sensors hum, spike, or ring.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.parts import ContactLaw
from analytic.mechanism.signals import named
from analytic.writing import write_atomically
from compare.diagnose.effects.joints import JointClearance
from compare.files import output_folder
from sim_models.engine import Request, SimulationError, engine, installed_version
from tests.evidence import contact_ode
from tests.evidence.results.scoreboard import Kind, Recorder, TrueEffect, TrueFault, Truth
from tests.evidence.scoreboard.files import Readings, Recording, write_files
from tests.evidence.scoreboard.rigs import Plan, Rejected, draw_log, ideal

SOURCES = ("exudyn", "exudyn", "ode")
CASES = ("crank-rocker", "crank-rocker", "crank-rocker", "slider-crank", "slider-crank")
BANDS = ((0.01, 0.05), (0.05, 0.12), (0.12, 0.25), (0.25, 0.5))  # of the time that pins fly, over all runs
RESTITUTIONS = ((0.05, 0.4), (0.05, 0.6), (0.3, 0.8), (0.7, 0.95))  # drawn in each of them
LAWS: tuple[ContactLaw, ...] = ("kelvin-voigt", "lankarani-nikravesh", "flores")
CLEARANCES = ((1e-4, 3e-4), (1.2e-4, 7e-4), (3e-4, 1e-3), (4e-4, 1.5e-3))  # m
SIMULATOR = "mujoco"  # diagnoses
NOISE = {"m": (5e-6, 3e-5), "rad": (3e-5, 2e-4), "N": (0.01, 0.1), "N.m": (5e-4, 3e-3)}  # one sigma
LOADED = {"crank-rocker": "coupler", "slider-crank": "slider"}
PLACES = {
    "crank-rocker": ("follower_angle", "coupler_x", "coupler_y", "coupler_angle"),
    "slider-crank": ("slider_x", "rod_x", "rod_y", "rod_angle"),
}
ATTEMPTS = 200
FAR = 2.0  # times beyond its band: a first run after which no other is made


@dataclass(frozen=True)
class Rig:
    """A nominal linkage, the speeds (rad/s) of its runs, and its sensors with their noise (1-sigma, SI)."""

    case: str
    nominal: Mechanism
    speeds: Sequence[float]
    noise: Mapping[str, float]


@dataclass(frozen=True)
class Rattling:
    """A set as drawn: the rig, which joint has how much clearance (m; None: none has any), who recorded it, and the
    share of the time that its pin flew; its recordings, and what its sensors do.
    """

    rig: Rig
    joint: str | None
    clearance: float
    source: str
    free: float
    recordings: tuple[Recording, ...]
    faults: tuple[str, ...] = ()

    @property
    def noise(self) -> Mapping[str, float]:
        """Of the sensors that there are."""
        return {s: sigma for s, sigma in self.rig.noise.items() if s in self.recordings[0].readings}

    def written(self, folder: Path) -> Path:
        """The set as files; measured.toml's path."""
        write_files(output_folder(folder), self.rig.nominal, self.recordings, {}, self.noise)
        return folder / "measured.toml"


def make_rattling(seed: int, kind: Kind, k: int, data: Path, seal: Path) -> Truth:
    """Draw and record the k-th set that rattles or is still, and write the data into one folder and the truth into the
    other.

    Raises Rejected where no attempt made a usable set.
    """
    attempt, made = drawn(kind, k)
    made.written(data)
    sealed = _truth(seed, attempt, kind, made)
    write_atomically(output_folder(seal) / Truth.file, sealed.to_json(1) + "\n")
    return sealed


def drawn(kind: Kind, k: int) -> tuple[int, Rattling]:
    """The k-th set, and draws that made no usable one before it.  Raises Rejected where none did."""
    draw = rattling if kind == "rattling" else still
    for attempt in range(ATTEMPTS):
        try:
            return attempt, draw(k, attempt)
        except (Rejected, SimulationError):
            continue
    raise Rejected(f"{kind}, set {k}: none of {ATTEMPTS} attempts made a usable set")


def _truth(seed: int, attempt: int, kind: Kind, made: Rattling) -> Truth:
    hidden: tuple[TrueEffect, ...] = ()
    if made.joint is not None:
        size = {JointClearance.parameters[0].name: made.clearance}
        hidden = (
            TrueEffect(
                name=JointClearance.name, where=made.joint, parameters=size,
                total=off_nominal(made), linear=0.0, distinct=0.0, rival=None,
            ),
        )  # fmt: skip
    version = None if made.source == "ode" else installed_version(engine(made.source).package)
    return Truth(
        seed=seed,
        attempt=attempt,
        kind=kind,
        case=made.rig.case,
        source=Recorder(name=made.source, version=version),
        simulator=SIMULATOR,
        effects=hidden,
        faults=tuple(TrueFault(name=fault, where="sensors", parameters={}) for fault in made.faults),
        noise=dict(made.noise),
        reversed_load=False,
        outside=None,
        free=made.free,
    )


def off_nominal(made: Rattling) -> float:
    """Sigmas by which the readings are off those of the nominal linkage, beyond their noise."""
    total, count = 0.0, 0
    for each in made.recordings:
        speed, angle = float(str(each.fields["drive_speed"])), float(str(each.fields["drive_angle"]))
        expected = ideal(made.rig.nominal, Plan(each.name, speed, angle, each.time, None))
        for s, values in each.readings.items():
            off = (values - expected[s]) / made.noise[s]
            total, count = total + float(off @ off), count + off.size
    return math.sqrt(max(total - count, 0.0))


# ---------------------------------------------------------------- drawing


def rattling(k: int, attempt: int) -> Rattling:
    """The k-th set with a pin that flies.  Raises Rejected where this attempt makes none, or SimulationError."""
    rng = np.random.default_rng([k, attempt])
    source, band = SOURCES[k % len(SOURCES)], k % len(BANDS)
    rig = _rig(rng, CASES[k % len(CASES)], 1.0 - band / len(BANDS))
    pins = [joint.name for joint in rig.nominal.joints if not joint.prismatic]
    where = "B" if source == "ode" else pins[int(np.random.default_rng(k).integers(len(pins)))]
    low, high = BANDS[band]
    size = draw_log(rng, *CLEARANCES[band])
    real = rig.nominal.with_joint(where, clearance=size)
    if source == "ode" or rng.random() < 0.5:
        restitution = float(rng.uniform(*RESTITUTIONS[band]))
        real = real.with_joint(where, contact_law=str(rng.choice(LAWS)), restitution=restitution)
    elif band == len(BANDS) - 1:
        raise Rejected("an engine's own contact does not give back enough")
    played: list[Played] = []
    for speed in rig.speeds:
        played.append(_run(rng, real, speed, where, source))
        if not low / FAR < played[0].free < high * FAR:
            raise Rejected("its pin flies too seldom or too often")
    free = float(np.mean([each.free for each in played]))
    recordings = _recorded(rng, rig, played)
    if not low <= free <= high or not any(s.startswith("reaction") for s in recordings[0].readings):
        raise Rejected("its pin flies too seldom or too often, or no force is read")
    return Rattling(rig, where, size, source, free, recordings)


def still(k: int, attempt: int) -> Rattling:
    """The k-th set of such a rig without any clearance, whose sensors hum, spike or ring."""
    rng = np.random.default_rng([k, attempt])
    rig, source = _rig(rng, CASES[k % len(CASES)], 1.0), SOURCES[0]
    played = [_run(rng, rig.nominal, speed, None, source) for speed in rig.speeds]
    faults = tuple(rng.choice(list(FAULTS), rng.integers(1, len(FAULTS) + 1), replace=False).tolist())
    recorded = []
    for each in _recorded(rng, rig, played):
        readings = dict(each.readings)
        for fault in faults:
            fixed = np.random.default_rng([k, 2 + list(FAULTS).index(fault)])
            readings = FAULTS[fault](fixed, rng, each.time, readings, rig.noise)
        recorded.append(Recording(each.name, each.time, readings, each.fields))
    return Rattling(rig, None, 0.0, source, 0.0, tuple(recorded), faults)


def _rig(rng: np.random.Generator, case: str, heavy: float) -> Rig:
    """A rig whose load is up to 3 N and whose gravity acts in most, less often and less the less ``heavy`` it is."""
    turn, push = rng.uniform(0, 2 * math.pi), rng.uniform(0, 3.0 * heavy)
    force = (push * math.cos(turn), push * math.sin(turn))
    gravity = (0.0, -9.81) if rng.random() < 0.7 * heavy else (0.0, 0.0)
    nominal = load(case).rigid().replace(gravity=gravity, loads=(Load(body=LOADED[case], force=force),))
    nominal = nominal.with_joint("B", restitution=None)  # nobody knows what impacts give back
    fastest = rng.uniform(18.0, 42.0)
    speeds = [fastest, -rng.uniform(0.6, 0.95) * fastest, rng.uniform(0.5, 0.9) * fastest]
    speeds += [rng.uniform(0.6, 0.9) * fastest] if rng.random() < 0.3 else []
    places = rng.choice(PLACES[case], rng.integers(1, 4), replace=False).tolist()
    pins = [joint.name for joint in nominal.joints if not joint.prismatic][-3:]
    cells = rng.choice(pins, rng.integers(1, 3), replace=False)
    forces = [f"reaction_{joint}_{axis}" for joint in cells for axis in "xy"]
    sensors = ["crank_angle", *places, *forces, *(["drive_torque"] if rng.random() < 0.7 else [])]
    known = named(nominal.bodies, nominal.joints, nominal.drives, nominal.sensors)
    return Rig(case, nominal, speeds, {s: draw_log(rng, *NOISE[known[s].unit]) for s in sensors})


# ---------------------------------------------------------------- recording


@dataclass(frozen=True)
class Played:
    """A run: times (N,) s, what noiseless sensors would read of it, and the share of the time that its pin flies."""

    time: np.ndarray
    signals: Readings
    free: float


def _run(rng: np.random.Generator, real: Mechanism, speed: float, joint: str | None, source: str) -> Played:
    turns, samples, start = int(rng.integers(5, 9)), int(rng.integers(150, 301)), rng.uniform(0, 2 * math.pi)
    time = np.linspace(0.0, 2 * math.pi * turns / abs(speed), turns * samples)
    assert real.drive is not None
    real = real.replace(drive=real.drive.model_copy(update={"speed": speed}))
    if source == "ode":
        assert joint is not None
        return by_equation(real, joint, time, start)
    angle = start + speed * time
    turned = Schedule.at_angles(real, angle)
    trace = engine(source).simulate(Request(real, "ideal" if joint is None else "contact", turned))
    free = 0.0 if joint is None else float(trace.free_share[joint])
    return Played(time, {**trace.signals, "crank_angle": angle}, free)


def by_equation(real: Mechanism, joint: str, time: np.ndarray, start: float) -> Played:
    """The same by the ordinary differential equation, which has the signals of the two bodies and the pin."""
    loop = contact_ode.loop_of(real, start)
    turn = abs(loop.speed) * float(time[-1])
    found = contact_ode.simulate(real, loop, contact_ode.pressed(real, loop), turn, step=float(time[1]))
    seen, force, who = found.watched, found.watched.force[joint], contact_ode.names_of(real)
    signals = {f"{who.crank}_angle": seen.angle[who.crank], "drive_torque": seen.torque}
    for body in (who.first, who.second):
        place = seen.place[body]
        signals |= {f"{body}_angle": seen.angle[body], f"{body}_x": place.real, f"{body}_y": place.imag}
    signals |= {f"reaction_{joint}_x": force.real, f"reaction_{joint}_y": force.imag}
    return Played(seen.time, signals, float(np.mean(np.abs(found.gap) < real.joint(joint).clearance)))


def _recorded(rng: np.random.Generator, rig: Rig, played: Sequence[Played]) -> tuple[Recording, ...]:
    found = []
    for k, (each, speed) in enumerate(zip(played, rig.speeds, strict=True)):
        noise = {s: sigma for s, sigma in rig.noise.items() if s in each.signals}
        read = {s: each.signals[s] + sigma * rng.standard_normal(each.time.size) for s, sigma in noise.items()}
        fields = {"drive_speed": speed, "drive_angle": float(each.signals["crank_angle"][0])}
        found.append(Recording(f"run-{k + 1}", each.time, read, fields))
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
