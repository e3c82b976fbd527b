"""Rigs on a bench: linkages of half a metre, what is slightly off in them, and how they are played."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analytic.mechanism import Body, Mechanism
from analytic.mechanism.signals import AXES, Signal
from compare.diagnose.effects.effect import Effect
from compare.diagnose.effects.vocabulary import VOCABULARY
from tests.evidence.scoreboard.files import Recording
from tests.evidence.scoreboard.hidden import makers
from tests.evidence.scoreboard.play import run
from tests.evidence.scoreboard.rigs import (
    Experiment,
    Plan,
    Rejected,
    draw_log,
    draw_mechanism,
    draw_plans,
    draw_sensors,
    draw_unit,
    ideal,
)
from tests.evidence.scoreboard.sizes import Drawn, Planted, Sizer, drawn

DIAGNOSING = ("mujoco", "exudyn")  # by seed
PLAYERS = ("exudyn", "mujoco", "dart")
EVERY = 6  # the last of so many sets is empty: no effect of the rig, only what is unkind in the family
SLOWER = {"crank-rocker": 0.5, "slider-crank": 0.17, "six-bar": 0.6}  # of the speeds of small linkages
SENSORS = (5, 9)


@dataclass(frozen=True)
class Fault:
    """A fault of a sensor, by its name in the vocabulary, or a name that a diagnosis may give to it."""

    name: str
    where: str
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Bench:
    """A set and its truth.

    ``dominant`` are the effects to be named; ``slight`` and ``faults`` are in the data too, and never wrong when named.
    ``source`` made the data, ``simulator`` diagnoses them; ``noise_stated`` says whether measured.toml has
    ``noise``, one sigma of white noise by signal.
    """

    case: str
    nominal: Mechanism
    source: str
    simulator: str
    dominant: tuple[Planted, ...]
    slight: tuple[Planted, ...]
    faults: tuple[Fault, ...]
    noise: Mapping[str, float]
    units: Mapping[str, str]
    noise_stated: bool
    recordings: tuple[Recording, ...]
    together: float = 0.0  # sigmas of all that is slight

    @classmethod
    def of(
        cls,
        experiment: Experiment,
        engines: tuple[str, str],
        dominant: tuple[Planted, ...],
        recordings: Sequence[Recording],
        slight: tuple[Planted, ...] = (),
        faults: Sequence[Fault] = (),
        together: float = 0.0,
    ) -> Bench:
        """A set recorded in an experiment; ``engines`` are the one that made the data and the one that diagnoses."""
        return cls(
            experiment.case,
            experiment.nominal,
            *engines,
            dominant,
            slight,
            tuple(faults),
            experiment.noise,
            experiment.units,
            experiment.noise_given,
            tuple(recordings),
            together,
        )


def is_empty(k: int) -> bool:
    """Whether the k-th set of a family has no effect of the rig."""
    return k % EVERY == EVERY - 1


def turn_of(k: int) -> int:
    """Which of the sets that are not empty the k-th is, so that lists are gone through in order."""
    return k - (k + 1) // EVERY


# ---------------------------------------------------------------- drawing


@dataclass(frozen=True)
class UnevenPlan(Plan):
    """A run whose speed is uneven: shares of its speed by harmonic of the crank, and slow waves over its time.

    ``ripples`` are (harmonic, share, phase), ``waves`` (share, rad/s, phase).
    """

    ripples: tuple[tuple[int, float, float], ...] = ()
    waves: tuple[tuple[float, float, float], ...] = ()

    def command(self, time: np.ndarray) -> np.ndarray:
        """Angle of the motor (rad) at times (N,) s."""
        even = self.angle + self.speed * time
        theta = even.copy()
        for harmonic, share, phase in self.ripples:
            theta += share / harmonic * np.sin(harmonic * even + phase)
        for share, rate, phase in self.waves:
            theta += share * self.speed / rate * np.sin(rate * time + phase)
        return theta


def uneven(rng: np.random.Generator, plan: Plan, low: float = 0.03, high: float = 0.08) -> UnevenPlan:
    """A run of the same speed in the mean, of ``low`` to ``high`` unevenness, that follows its encoder."""
    count = int(rng.integers(1, 3))
    first = rng.uniform(low, high)
    shares = [first] if count == 1 else [0.7 * first, 0.3 * first]
    harmonics = rng.choice([1, 2, 3], size=count, replace=False)
    ripples = tuple(
        (int(h), float(share), float(rng.uniform(0, 2 * math.pi))) for h, share in zip(harmonics, shares, strict=True)
    )
    rates = abs(plan.speed) * rng.uniform(0.03, 0.2, 2)
    waves = tuple((float(rng.uniform(0.003, 0.01)), float(r), float(rng.uniform(0, 2 * math.pi))) for r in rates)
    return UnevenPlan(plan.name, plan.speed, plan.angle, plan.time, plan.loads, True, ripples, waves)


def draw_bench(
    rng: np.random.Generator,
    cases: Sequence[str],
    wanted: Sequence[str] = (),
    slow: bool = False,
    weight_alone: bool = False,
) -> Experiment:
    """A linkage of 0.2 to 0.7 m, two or three commanded runs, and sensors of a bench: angles to 0.01 to 0.03 deg,
    lengths to 20 to 50 um, forces and torques to 0.5 to 1 % of their peak.

    With ``weight_alone`` nothing but gravity and inertia loads the rig.  Raises Rejected where the linkage that was
    drawn does not turn.
    """
    case = str(rng.choice(list(cases)))
    nominal = enlarged(draw_mechanism(rng, case), draw_log(rng, 2.0, 4.0))
    if weight_alone:
        nominal = nominal.replace(loads=(), gravity=(0.0, -9.81))
    slower = SLOWER[case]
    plans = tuple(
        replace(p, speed=slower * p.speed, time=p.time / slower)
        for p in draw_plans(rng, case, nominal, slow, may_follow=False)
    )
    peaks = peaks_of(nominal, plans)
    signals = draw_sensors(rng, nominal, peaks, wanted)
    noise = bench_noise(rng, signals, peaks)
    units = {s.name: draw_unit(rng, s) for s in signals}
    return Experiment(case, nominal, plans, noise, bool(rng.random() < 0.5), units)


def peaks_of(nominal: Mechanism, plans: Sequence[Plan]) -> dict[str, float]:
    """The largest size of every signal in all runs."""
    peaks: dict[str, float] = {}
    for plan in plans:
        for signal, values in ideal(nominal, plan).items():
            peaks[signal] = max(peaks.get(signal, 0.0), float(np.abs(values).max()))
    return peaks


def bench_noise(rng: np.random.Generator, signals: Sequence[Signal], peaks: Mapping[str, float]) -> dict[str, float]:
    """One sigma of white noise (SI) of each sensor; the two axes of a load cell are of one kind."""
    noise: dict[str, float] = {}
    for s in signals:
        if s.kind == "pose":
            noise[s.name] = draw_log(rng, 1.7e-4, 5.2e-4) if s.wraps else draw_log(rng, 2e-5, 5e-5)
            continue
        axes = [s.sibling(axis) for axis in AXES] if s.kind == "reaction" else [s]
        size = max(peaks[axis.name] for axis in axes) * rng.uniform(0.005, 0.01)
        noise[s.name] = noise.get(axes[0].name, size)
    return noise


def enlarged(m: Mechanism, k: float) -> Mechanism:
    """A linkage k times as long, of bars of the same section."""
    bodies = []
    for b in m.bodies:
        fields = b.model_dump(exclude_unset=True)
        fields["points"] = {name: (k * x, k * y) for name, (x, y) in b.points.items()}
        fields["mass"] = k * b.mass
        if b.com is not None:
            fields["com"] = (k * b.com[0], k * b.com[1])
        if b.inertia is not None:
            fields["inertia"] = k**3 * b.inertia
        bodies.append(Body.model_validate(fields))
    ground = {"points": {name: (k * x, k * y) for name, (x, y) in m.ground.points.items()}}
    return m.replace(ground=ground, bodies=tuple(bodies))


def draw_player(rng: np.random.Generator, simulator: str, effects: Sequence[Effect]) -> str:
    """An engine that has these effects and is not the diagnosing one.  Raises Rejected."""
    able = [name for name in PLAYERS if name in makers(effects) and name != simulator]
    if not able:
        raise Rejected("no other engine plays it")
    return str(rng.choice(able))


def grown(
    rng: np.random.Generator, experiment: Experiment, name: str, low: float, high: float, where: str | None = None
) -> Planted:
    """An effect of ``low`` to ``high`` sigmas, at a random place.  Raises Rejected where it does not show so much."""
    effect, sizer = VOCABULARY[name], Sizer(experiment)
    places = list(effect.places(sizer.rig)) if where is None else [where]
    if not places:
        raise Rejected(f"{name} has no place here")
    one: Drawn = drawn(effect, str(rng.choice(places)), experiment, sizer.rig, rng)
    target = draw_log(rng, low, high)
    values = sizer.grown(one, target)
    seen = sizer.total([(one.term, values)], 0)
    if not 0.9 * low < seen < 1.1 * high:
        raise Rejected(f"{name} shows {seen:.3g} sigma")
    return Planted(name, one.term.where, dict(values), total=seen)


# ---------------------------------------------------------------- what is slightly off

MASS, COM, LENGTH = 0.01, 5e-4, (1e-4, 3e-4)  # of its own; m; m
FRICTION = (0.005, 0.02)  # of the drive torque, in all joints together
DRY = 0.2  # of the power that friction takes


def slightly_off(rng: np.random.Generator, experiment: Experiment) -> tuple[Planted, ...]:
    """Every length 0.1 to 0.3 mm off, masses up to 1 %, coms up to 0.5 mm, friction in every joint."""
    m, rig = experiment.nominal, experiment.rig
    found = []
    for b in m.bodies:
        share = float(rng.choice([-1, 1]) * rng.uniform(0.5, 1.0)) * MASS
        found.append(Planted("payload", b.name, {"mass": share * b.mass, "along": 0.0, "normal": 0.0}))
        if b.moment_of_inertia > 0:
            found.append(Planted("moment_of_inertia", b.name, {"inertia_error": share * b.moment_of_inertia}))
        if b.length > 0:
            turn, size = rng.uniform(0, 2 * math.pi), COM * rng.uniform(0.5, 1.0)
            found.append(
                Planted("com_offset", b.name, {"along": size * math.cos(turn), "normal": size * math.sin(turn)})
            )
    for body in VOCABULARY["link_length"].places(rig):
        found.append(Planted("link_length", body, {"length_error": float(rng.choice([-1, 1]) * rng.uniform(*LENGTH))}))
    for point in list(VOCABULARY["pivot_position"].places(rig))[1:]:
        turn, size = rng.uniform(0, 2 * math.pi), rng.uniform(*LENGTH)
        found.append(Planted("pivot_position", point, {"x": size * math.cos(turn), "y": size * math.sin(turn)}))
    return (*found, *_rubbing(rng, experiment))


def _rubbing(rng: np.random.Generator, experiment: Experiment) -> list[Planted]:
    """Friction in every joint that takes a share of the drive's power in the fastest run, most of it viscous."""
    plan = max(experiment.plans, key=lambda p: abs(p.speed))
    signals = ideal(experiment.nominal, plan)
    torque = float(np.sqrt(np.mean(signals["drive_torque"] ** 2)))
    power = rng.uniform(*FRICTION) * torque * abs(plan.speed)
    weights = rng.dirichlet(np.full(len(experiment.nominal.joints), 3.0))
    found = []
    for joint, weight in zip(experiment.nominal.joints, weights, strict=True):
        rate = joint_rate(experiment.nominal, joint.name, signals, plan)
        if np.abs(rate).max() < 1e-9:
            continue
        wet = (1 - DRY) * weight * power / float(np.mean(rate**2))
        dry = DRY * weight * power / float(np.mean(np.abs(rate)))
        found.append(Planted("viscous_friction", joint.name, {"damping": wet}))
        found.append(Planted("coulomb_friction", joint.name, {"friction_torque": dry}))
    return found


def joint_rate(m: Mechanism, name: str, signals: Mapping[str, np.ndarray], plan: Plan) -> np.ndarray:
    """Rate (N,) of a joint: rad/s, or m/s of a prismatic one."""
    joint = m.joint(name)
    first, second = joint.bodies
    if joint.prismatic:
        moving = second if second in m.moving else first
        x, y = (np.gradient(signals[f"{moving}_{axis}"], plan.time) for axis in AXES)
        return np.asarray(np.hypot(x, y) * np.sign(x + y))
    rates = [signals[f"{b}_angular_velocity"] if b in m.moving else 0.0 for b in (first, second)]
    return np.asarray(rates[1] - rates[0])


# ---------------------------------------------------------------- played


def altered(experiment: Experiment, plan: Plan, things: Sequence[Planted]) -> Mechanism:
    """The mechanism of a run with all that is wrong with it."""
    m = experiment.nominal if plan.loads is None else experiment.nominal.replace(loads=plan.loads)
    for thing in things:
        m = VOCABULARY[thing.name].on_mechanism(m, thing.where, thing.values)
    return m


def moved(
    source: str, experiment: Experiment, plan: Plan, things: Sequence[Planted], time: np.ndarray
) -> Mapping[str, np.ndarray]:
    """Every signal (N,) at increasing times (N,) s, the encoder on the motor, by the engine that makes the data."""
    m = altered(experiment, plan, things)
    trace = run(source, m, plan, time, plan.command if isinstance(plan, UnevenPlan) else None)
    return {**trace.signals, experiment.encoder: plan.command(time)}
