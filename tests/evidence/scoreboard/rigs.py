"""Experiments drawn at random: linkages, runs, sensors and their noise, such as an engineer might have."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import turns_fully
from analytic.kinematics.schedule import Turning
from analytic.mechanism import Load, Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.signals import AXES, Signal, SiUnit, named
from compare.diagnose.data.recording import Channel, Drive, Measured, MeasuredRun
from compare.diagnose.effects.effect import STOPS, Rig
from compare.diagnose.predict import as_inputs, derived

CASES = {"crank-rocker": 0.45, "slider-crank": 0.3, "six-bar": 0.25}  # and how often each is drawn
SPEEDS = {"crank-rocker": (4.0, 30.0), "slider-crank": (10.0, 90.0), "six-bar": (4.0, 16.0)}  # rad/s
LOADED = {
    "crank-rocker": ("coupler", 50.0),
    "slider-crank": ("slider", 60.0),
    "six-bar": ("coupler", 30.0),
    "2r-arm": ("forearm", 10.0),
    "five-bar": ("left-arm", 20.0),
    "3-rrr": ("platform", 15.0),
    "3-rpr": ("platform", 15.0),
}  # body and force (N)
SAMPLES = (120, 240)
SENSORS = (5, 9)


class Rejected(ValueError):
    """A draw that makes no usable set; the next one is tried."""


@dataclass(frozen=True)
class Plan:
    """A run to be recorded: ``time`` (N,) s; ``loads`` replace the mechanism's; with ``follows`` it is given as
    ``measured``.
    """

    name: str
    speed: float  # rad/s
    angle: float  # rad at time 0
    time: np.ndarray
    loads: tuple[Load, ...] | None
    follows: bool = False

    def command(self, time: np.ndarray) -> np.ndarray:
        """Commanded angle (rad) at times (N,) s; of several motors (k, N) rad or m, in their order."""
        return self.angle + self.speed * time

    def turning(self, time: np.ndarray) -> Turning:
        """The same with its rates."""
        theta = self.command(time)
        return Turning(theta, np.full_like(theta, self.speed), np.zeros_like(theta))


def course_grid(plan: Plan, time: np.ndarray) -> np.ndarray:
    """Times (s) that are dense enough for a course: 720 a revolution, a little beyond both ends of the plan."""
    period = 2 * math.pi / abs(plan.speed)
    spare = 0.02 * period
    count = math.ceil(720 * (np.ptp(time) + 2 * spare) / period) + 1
    return np.linspace(time.min() - spare, time.max() + spare, count)


def command_fields(plan: Plan) -> dict[str, object]:
    """How a run was driven, as measured.toml has it."""
    fields: dict[str, object] = (
        {"drive": "measured"} if plan.follows else {"drive_speed": plan.speed, "drive_angle": plan.angle}
    )
    if plan.loads is not None:
        fields["load"] = [load.model_dump(mode="json", exclude_unset=True) for load in plan.loads]
    return fields


@dataclass(frozen=True)
class Experiment:
    """A nominal mechanism, the runs made on it, and its sensors' noise (1-sigma, SI, by signal)."""

    case: str
    nominal: Mechanism
    plans: tuple[Plan, ...]
    noise: dict[str, float]
    noise_given: bool
    units: dict[str, str]  # what the data files are written in

    @property
    def encoder(self) -> str:
        """The encoder of the one motor."""
        return f"{self.nominal.driven}_angle"

    def encoded(self, plan: Plan, time: np.ndarray) -> dict[str, np.ndarray]:
        """Where every motor is at times (N,) s, by its encoder."""
        at = np.atleast_2d(plan.command(time))
        return {encoder.name: place for encoder, place in zip(self.nominal.encoders, at, strict=True)}

    @property
    def rig(self) -> Rig:
        """What effects need to know of the experiment."""
        names = tuple(plan.name for plan in self.plans)
        following = tuple(plan.name for plan in self.plans if plan.follows)
        length = max(b.length for b in self.nominal.bodies)
        speed = max(abs(plan.speed) for plan in self.plans)
        force = max(np.abs(f).max() for plan in self.plans for f in _forces(self.nominal, plan).values())
        known = (self.nominal, tuple(self.noise), names, names, following, length, float(force), speed, self.noise)
        return Rig(*known, postures=tuple(_posture(self.nominal, plan) for plan in self.plans if self.nominal.several))

    @cached_property
    def signals(self) -> Mapping[str, Signal]:
        """Every signal that the linkage can have, by name."""
        return named(self.nominal.bodies, self.nominal.joints, self.nominal.drives, self.nominal.sensors)

    def measured(self, values: Sequence[dict[str, np.ndarray]] | None = None) -> Measured:
        """The experiment's measurement with these readings (by run and signal), or zeros."""
        runs = tuple(self._run(p, values[i] if values is not None else None) for i, p in enumerate(self.plans))
        return Measured(self.nominal, runs, {}, (), "")

    def _run(self, p: Plan, values: Mapping[str, np.ndarray] | None) -> MeasuredRun:
        channels = {}
        for name, sigma in self.noise.items():
            signal, read = self.signals[name], np.zeros(p.time.size) if values is None else values[name]
            channels[name] = Channel(signal, read, sigma, True, signal.unit)
        drive: Drive = "measured" if p.follows else "speed"
        speed, angle = (None, None) if p.follows else (p.speed, p.angle)
        return MeasuredRun(p.name, p.time, channels, drive, speed, angle, {}, p.loads, False, f"{p.name}.csv")


def ideal(mechanism: Mechanism, plan: Plan) -> dict[str, np.ndarray]:
    """Every signal (N,) of a nominal run, without sensors."""
    assembly = Assembly(mechanism if plan.loads is None else mechanism.replace(loads=plan.loads))
    turning = plan.turning(plan.time)
    return derived(assembly, as_inputs(assembly, turning) if mechanism.several else turning)


def _posture(mechanism: Mechanism, plan: Plan) -> np.ndarray:
    """Inputs (k, STOPS) of a linkage that several drives move, over a run."""
    stops = np.linspace(plan.time[0], plan.time[-1], STOPS)
    return np.asarray(as_inputs(Assembly(mechanism), plan.turning(stops)).theta)


def _forces(mechanism: Mechanism, plan: Plan) -> dict[str, np.ndarray]:
    signals = ideal(mechanism, plan)
    return {j.name: signals[f"reaction_{j.name}_magnitude"] for j in mechanism.joints}


# ---------------------------------------------------------------- drawing


def draw_experiment(
    rng: np.random.Generator,
    cases: Sequence[str],
    wanted: Sequence[str],
    slow: bool,
    may_follow: bool,
    least: int = SENSORS[0],
) -> Experiment:
    """An experiment with one of the cases whose sensors, so many at ``least``, include the ``wanted`` kinds; ``slow``
    keeps it far from losing contact.

    Raises Rejected where the linkage that was drawn does not turn.
    """
    weights = np.array([CASES[c] for c in cases])
    case = str(rng.choice(list(cases), p=weights / weights.sum()))
    nominal = draw_mechanism(rng, case)
    plans = draw_plans(rng, case, nominal, slow, may_follow)
    peaks: dict[str, float] = {}
    for plan in plans:
        for signal, values in ideal(nominal, plan).items():
            peaks[signal] = max(peaks.get(signal, 0.0), float(np.abs(values).max()))
    signals = draw_sensors(rng, nominal, peaks, [*wanted, *(["encoder"] if plans[0].follows else [])], least)
    noise = {s.name: draw_noise(rng, s, peaks) for s in signals}
    for s in signals:  # the two axes of a load cell are of one kind
        if s.kind == "reaction" and s.component == "y":
            noise[s.name] = noise.get(s.sibling("x").name, noise[s.name])
    units = {s.name: draw_unit(rng, s) for s in signals}
    return Experiment(case, nominal, plans, noise, bool(rng.random() < 0.5), units)


def draw_mechanism(rng: np.random.Generator, case: str) -> Mechanism:
    """A shipped case, scaled, with lengths and masses of its own; rigid.  Raises Rejected where it has a crank that
    does not turn.
    """
    m = load(case).rigid()
    scale, heavier = draw_log(rng, 0.7, 1.6), draw_log(rng, 0.6, 1.65)
    stretch = {b.name: scale * rng.uniform(0.95, 1.05) for b in m.bodies}
    ground = {name: (scale * x, scale * y) for name, (x, y) in m.ground.points.items()}
    bodies = []
    for b in m.bodies:
        k = stretch[b.name]
        fields = b.model_dump(exclude_unset=True)
        fields["points"] = {name: (k * x, k * y) for name, (x, y) in b.points.items()}
        fields["mass"] = b.mass * heavier * rng.uniform(0.8, 1.25)
        if b.com is not None:
            fields["com"] = (k * b.com[0], k * b.com[1])
        if b.inertia is not None:
            fields["inertia"] = b.inertia * k**2 * fields["mass"] / b.mass
        bodies.append(type(b).model_validate(fields))
    body, force = LOADED[case]
    angle = math.pi if case == "slider-crank" else -math.pi / 2 + rng.uniform(-0.6, 0.6)
    push = force * rng.uniform(0.5, 1.5)
    loads = (
        [*m.loads, Load(body=body, force=(push * math.cos(angle), push * math.sin(angle)))]
        if rng.random() < 0.75
        else list(m.loads)
    )
    gravity = (0.0, -9.81) if rng.random() < 0.5 else (0.0, 0.0)
    found = m.replace(ground={"points": ground}, bodies=tuple(bodies), loads=tuple(loads), gravity=gravity)
    if found.cranked and not turns_fully(Assembly(found)):
        raise Rejected(f"{case}: the crank does not turn")
    return found


def draw_plans(
    rng: np.random.Generator, case: str, nominal: Mechanism, slow: bool, may_follow: bool
) -> tuple[Plan, ...]:
    """Two or three runs that differ in speed, and some in direction or load."""
    low, high = SPEEDS[case]
    high = math.sqrt(low * high) if slow else high
    count = int(rng.integers(2, 4))
    speeds = np.exp(np.linspace(math.log(low), math.log(high), count) + rng.uniform(-0.15, 0.15, count))
    signs = np.where(np.arange(count) == (count - 1 if rng.random() < 0.6 else -1), -1, 1)
    follows = may_follow and bool(rng.random() < 0.1)
    n, turns = int(rng.integers(SAMPLES[0], SAMPLES[1] + 1)), 1 if slow else int(rng.integers(1, 3))
    plans = []
    for i, (speed, sign) in enumerate(zip(speeds, signs, strict=True)):
        time = np.linspace(0.0, turns * 2 * math.pi / speed, n)
        loads = None
        if i and nominal.loads and rng.random() < 0.3:
            k = rng.uniform(0.4, 1.3)
            loads = tuple(
                Load(body=x.body, point=x.point, force=(k * x.force[0], k * x.force[1]), torque=x.torque)
                for x in nominal.loads
            )
        pace = ("slow", "middle", "fast")[i] if count == 3 else ("slow", "fast")[i]
        name = f"{pace}-{'forward' if sign > 0 else 'reverse'}"
        plans.append(Plan(name, float(sign * speed), float(rng.uniform(-math.pi, math.pi)), time, loads, follows))
    return tuple(plans)


def draw_sensors(
    rng: np.random.Generator,
    m: Mechanism,
    peaks: dict[str, float],
    wanted: Sequence[str],
    least: int = SENSORS[0],
) -> list[Signal]:
    """Nine signals or fewer, so many at ``least``: most rigs have the encoder and the drive torque, all something of
    motion and of force.
    """
    encoder, torque = Signal.of("pose", m.driven, "angle"), Signal.of("drive", "", "torque")
    cells = [[Signal.of("reaction", j.name, axis) for axis in AXES] for j in m.joints if not j.prismatic]
    rates = [Signal.of("rate", b.name, "angular_velocity") for b in m.bodies if b.name != m.driven]
    rates = [rate for rate in rates if peaks[rate.name] > 1e-9]
    angles = [Signal.of("pose", rate.place, "angle") for rate in rates]
    points = [Signal.of("pose", b.name, axis) for b in m.bodies for axis in AXES]
    motion = angles + [point for point in points if peaks[point.name] > 1e-9]
    chosen = dict.fromkeys([encoder] if "encoder" in wanted or rng.random() < 0.85 else [])
    if "torque" in wanted or rng.random() < 0.85:
        chosen[torque] = None
    if "cell" in wanted or torque not in chosen or rng.random() < 0.6:
        chosen |= dict.fromkeys(cells[int(rng.integers(len(cells)))])
    chosen[motion[int(rng.integers(len(angles)))] if angles else motion[0]] = None
    pool = [*motion, *motion, *rates, *(x for cell in cells for x in cell)]
    target = int(rng.integers(least, SENSORS[1] + 1))
    while len(chosen) < target:
        new = pool[int(rng.integers(len(pool)))]
        pair = [new.sibling(axis) for axis in AXES] if new.kind == "reaction" else [new]
        if len(chosen) + len(pair) <= SENSORS[1]:
            chosen |= dict.fromkeys(pair)
    return list(chosen)


def draw_noise(rng: np.random.Generator, signal: Signal, peaks: dict[str, float]) -> float:
    """A sensor's 1-sigma, SI."""
    if signal.kind in ("pose", "position"):
        return draw_log(rng, 2e-5, 1e-4) if signal.wraps else draw_log(rng, 5e-6, 2e-5)
    axes = [signal.sibling(axis) for axis in AXES] if signal.kind == "reaction" else [signal]
    return max(peaks[axis.name] for axis in axes) * draw_log(rng, 1e-3, 5e-3)


def draw_unit(rng: np.random.Generator, signal: Signal) -> str:
    """A unit that such a sensor's file might be written in."""
    other: dict[SiUnit, str] = {"rad": "deg", "m": "mm", "rad/s": "rpm", "N.m": "N.mm", "N": "N"}
    return other[signal.unit] if rng.random() < 0.3 else signal.unit


def draw_log(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))
