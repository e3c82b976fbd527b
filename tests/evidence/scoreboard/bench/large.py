"""What is missing changes the motion, or most of the forces.

By seed, in turn: a released pendulum with a spring of 2 to 8 times m g l and a damper; a payload of 1 to 3 times
its link's mass; a length wrong by 5 to 10 %; friction that takes half of the drive's power; gravity forgotten
altogether; a released pendulum with a spring that rests within 8 deg of +-180 deg; a payload on a released pendulum
whose pin has a load cell; a spring at rest within 8 deg of +-180 deg in a rocking joint.  In three of ten driven
sets there is viscous friction of 5 to 20 % of the drive's power beside it.

Pendulums are integrated by :mod:`pendulum` and not by an engine: two or three releases of 3 to 6 s, angle and rate.
Half of the files have the angle within half a turn, half of measured.toml tell the starts roughly.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import turns_fully
from analytic.mechanism import Body, Mechanism
from analytic.mechanism.file import load
from analytic.mechanism.signals import wrapped
from compare.diagnose.effects.vocabulary import VOCABULARY
from tests.evidence.scoreboard.bench.pendulum import Pendulum, rival_left, turned
from tests.evidence.scoreboard.bench.rig import (
    DIAGNOSING,
    Bench,
    draw_bench,
    draw_player,
    is_empty,
    joint_rate,
    moved,
    turn_of,
)
from tests.evidence.scoreboard.bench.sensors import white
from tests.evidence.scoreboard.bench.sigmas import Ruler
from tests.evidence.scoreboard.files import Readings, Recording
from tests.evidence.scoreboard.rigs import Experiment, Rejected, command_fields, draw_log, ideal
from tests.evidence.scoreboard.score import DISTINCT
from tests.evidence.scoreboard.sizes import Planted

PENDULUM = "pendulum"
FORGOTTEN = "gravity forgotten"
CASES = ("crank-rocker", "slider-crank")
SPRING, DAMPER = (2.0, 8.0), (0.02, 0.12)  # of m g l; of critical damping
PAYLOAD, LENGTH, FRICTION, BESIDE = (1.0, 3.0), (0.05, 0.10), 0.5, (0.05, 0.2)
NEAR = math.radians(8.0)  # of 180 deg
TWO = 0.3  # of driven sets
SPAN, RATE = (3.0, 6.0), (80.0, 200.0)  # s, Hz
STATE = ("pendulum_angle", "pendulum_angular_velocity")
AMPLITUDE = (0.7, 1.6)  # rad, from where the pendulum comes to rest
Drawer = Callable[[np.random.Generator, Experiment], Planted]


def draw(k: int, rng: np.random.Generator) -> Bench:
    """The k-th set, recorded.  Raises Rejected, SimulationError or AssemblyError where this draw makes none."""
    simulator = DIAGNOSING[k % len(DIAGNOSING)]
    if is_empty(k):
        kind = "a spring" if (k // 6) % 2 else "a payload"
    else:
        kind = list(KINDS)[turn_of(k) % len(KINDS)]
    if kind in RELEASED:
        return _released(rng, kind, is_empty(k), simulator)
    return _driven(rng, kind, is_empty(k), simulator)


# ---------------------------------------------------------------- driven linkages


def _driven(rng: np.random.Generator, kind: str, empty: bool, simulator: str) -> Bench:
    experiment = draw_bench(rng, CASES, ["torque", "encoder"])
    true_gravity = (0.0, 0.0) if kind == FORGOTTEN else experiment.nominal.gravity
    experiment = replace(experiment, nominal=experiment.nominal.replace(gravity=true_gravity))
    things: list[Planted] = []
    if not empty:
        things = [KINDS[kind](rng, experiment)]
        if rng.random() < TWO and kind != "friction":
            things.append(_rubs(rng, experiment, "viscous_friction", rng.uniform(*BESIDE)))
    judged = Ruler(experiment).judged(things)
    source = draw_player(rng, simulator, [VOCABULARY[e.name] for e in judged])
    recordings = []
    for plan in experiment.plans:
        signals = moved(source, experiment, plan, judged, plan.time)
        seen: Readings = {s: np.array(signals[s]) for s in experiment.noise}
        recordings.append(Recording(plan.name, plan.time, white(rng, experiment, seen), command_fields(plan)))
    return Bench.of(experiment, (source, simulator), judged, recordings)


def _heavy(rng: np.random.Generator, experiment: Experiment) -> Planted:
    body = experiment.nominal.moving[str(rng.choice([b.name for b in experiment.nominal.bodies if b.name != "crank"]))]
    along, normal = rng.uniform(-0.4, 0.4) * body.length, rng.uniform(-0.2, 0.2) * body.length
    return Planted("payload", body.name, {"mass": rng.uniform(*PAYLOAD) * body.mass, "along": along, "normal": normal})


def _long(rng: np.random.Generator, experiment: Experiment) -> Planted:
    where = str(rng.choice(list(VOCABULARY["link_length"].places(experiment.rig))))
    error = float(rng.choice([-1, 1])) * rng.uniform(*LENGTH) * experiment.nominal.moving[where].length
    planted = Planted("link_length", where, {"length_error": error})
    if not turns_fully(Assembly(VOCABULARY["link_length"].on_mechanism(experiment.nominal, where, planted.values))):
        raise Rejected("the crank does not turn with that length")
    return planted


def _rough(rng: np.random.Generator, experiment: Experiment) -> Planted:
    return _rubs(rng, experiment, str(rng.choice(["viscous_friction", "coulomb_friction"])), FRICTION)


def _rubs(rng: np.random.Generator, experiment: Experiment, name: str, share: float) -> Planted:
    """Friction in a joint that takes a share of rms drive torque times speed in the fastest run."""
    plan = max(experiment.plans, key=lambda p: abs(p.speed))
    signals, joint = ideal(experiment.nominal, plan), str(rng.choice([j.name for j in experiment.nominal.joints]))
    power = share * abs(plan.speed) * float(np.sqrt(np.mean(signals["drive_torque"] ** 2)))
    rate = joint_rate(experiment.nominal, joint, signals, plan)
    parameter, exponent = RUBBING[name]
    return Planted(name, joint, {parameter: power / float(np.mean(np.abs(rate) ** exponent))})


RUBBING = {"viscous_friction": ("damping", 2), "coulomb_friction": ("friction_torque", 1)}  # power over rate to this


def _forgotten(rng: np.random.Generator, experiment: Experiment) -> Planted:
    return Planted("gravity", "linkage", {"x": 0.0, "y": -9.81})


def _wound(rng: np.random.Generator, experiment: Experiment) -> Planted:
    """A spring in a joint that rocks, whose torque in the middle of its travel is about that of the drive."""
    m, plan = experiment.nominal, experiment.plans[0]
    signals = ideal(m, plan)
    travels = {}
    for joint in m.joints:
        first, second = joint.bodies
        if not joint.prismatic:
            q = signals[f"{second}_angle"] - (signals[f"{first}_angle"] if first in m.moving else 0.0)
            if np.ptp(q) < math.pi:
                travels[joint.name] = q
    where = str(rng.choice(list(travels)))
    rest = float(rng.choice([-1, 1])) * (math.pi - rng.uniform(0, NEAR))
    torque = rng.uniform(0.5, 1.5) * float(np.sqrt(np.mean(signals["drive_torque"] ** 2)))
    away = max(abs(float(np.mean(travels[where])) - rest), 0.5)
    return Planted("joint_spring", where, {"stiffness": torque / away, "rest_angle": rest})


# ---------------------------------------------------------------- released pendulums


def _released(rng: np.random.Generator, kind: str, empty: bool, simulator: str) -> Bench:
    nominal = _pendulum(rng)
    believed = Pendulum.of(nominal)
    things = [] if empty else RELEASED[kind](rng, believed)
    true = believed.with_things(things)
    rest = _at_rest(true)
    count, n = int(rng.integers(2, 4)), int(rng.uniform(*SPAN) * (rate := rng.uniform(*RATE)))
    time = np.arange(n) / rate
    amplitudes = float(rng.choice([-1, 1])) * np.linspace(*AMPLITUDE, count) * rng.uniform(0.9, 1.1, count)
    starts = [(float(rest + a), float(rng.uniform(-0.3, 0.3))) for a in amplitudes]
    swings = [true.swing(*start, time) for start in starts]
    fastest = max(float(np.abs(s[1]).max()) for s in swings)
    noise = dict(zip(STATE, (draw_log(rng, 1.7e-4, 5.2e-4), 0.005 * fastest), strict=True))
    pushes = [true.push(*s) for s in swings]
    if kind == "a payload on a pendulum":
        size = rng.uniform(0.005, 0.01) * max(float(np.abs(p).max()) for p in pushes)
        noise |= {"reaction_O_x": size, "reaction_O_y": size}
    recordings, wraps, stated, told = [], rng.random() < 0.5, rng.random() < 0.5, rng.random() < 0.5
    for i, (swing, push) in enumerate(zip(swings, pushes, strict=True)):
        clean = dict(zip(STATE, swing, strict=True)) | {"reaction_O_x": push.real, "reaction_O_y": push.imag}
        seen = {s: clean[s] + sigma * rng.standard_normal(n) for s, sigma in noise.items()}
        if wraps:
            seen["pendulum_angle"] = wrapped(seen["pendulum_angle"])
        start = {s: round(float(seen[s][0]), 2) for s in STATE}
        fields: dict[str, object] = {"drive": "free", **({"start": start} if told else {})}
        recordings.append(Recording(f"swing-{i + 1}", time, seen, fields))
    judged = _judged(things, true, believed, starts, time, noise)
    return Bench(PENDULUM, nominal, "scipy", simulator, judged, (), (), noise, {}, bool(stated), tuple(recordings))


def _pendulum(rng: np.random.Generator) -> Mechanism:
    """A bar of 0.2 to 0.6 m that hangs on one pin."""
    m = load(PENDULUM)
    k = rng.uniform(0.7, 2.0)
    fields = m.bodies[0].model_dump(exclude_unset=True)
    fields["points"] = {name: (k * x, k * y) for name, (x, y) in m.bodies[0].points.items()}
    fields["mass"] = k * m.bodies[0].mass * rng.uniform(0.8, 3.0)
    return m.replace(bodies=(Body.model_validate(fields),))


def _sprung(rng: np.random.Generator, p: Pendulum) -> list[Planted]:
    return _spring(rng, p, float(rng.uniform(-2.4, 0.6)))


def _opposite(rng: np.random.Generator, p: Pendulum) -> list[Planted]:
    return _spring(rng, p, float(rng.choice([-1, 1])) * (math.pi - rng.uniform(0, NEAR)))


def _spring(rng: np.random.Generator, p: Pendulum, rest: float) -> list[Planted]:
    stiffness = draw_log(rng, *SPRING) * p.weight_torque
    damping = 2 * rng.uniform(*DAMPER) * math.sqrt(stiffness * p.inertia)
    spring = Planted("joint_spring", "O", {"stiffness": stiffness, "rest_angle": rest})
    return [spring, Planted("viscous_friction", "O", {"damping": damping})]


def _loaded(rng: np.random.Generator, p: Pendulum) -> list[Planted]:
    size = abs(p.centre)
    along, normal = rng.uniform(-0.5, 0.9) * size, rng.uniform(-0.3, 0.3) * size
    return [Planted("payload", PENDULUM, {"mass": rng.uniform(*PAYLOAD) * p.mass, "along": along, "normal": normal})]


def _at_rest(p: Pendulum) -> float:
    """A stable angle (rad): where a spring holds, near its own rest; without one straight down."""
    angle = p.rest if p.stiffness else turned(float(np.angle(p.gravity) - np.angle(p.centre)))
    for _ in range(50 if p.stiffness else 0):
        angle += float(p.acceleration(np.array(angle), np.array(0.0))) * p.inertia / (p.stiffness + p.weight_torque)
    return angle


def _judged(
    things: Sequence[Planted],
    true: Pendulum,
    believed: Pendulum,
    starts: Sequence[tuple[float, float]],
    time: np.ndarray,
    noise: dict[str, float],
) -> tuple[Planted, ...]:
    """The effects with their sizes, from the same starts; a spring's best rival is fitted, a payload weighs on the
    cell and a damper alone takes energy.
    """
    sigmas = noise[STATE[0]], noise[STATE[1]]
    out = []
    for thing in things:
        without = believed.with_things([t for t in things if t is not thing])
        pairs = [(true.swing(*start, time), without.swing(*start, time)) for start in starts]
        total = math.sqrt(sum(float(np.sum(((a - b) / np.array(sigmas)[:, None]) ** 2)) for a, b in pairs))
        distinct = total
        if "mass" in thing.values:
            parts = [np.abs(true.push(*a) - believed.push(*a)) / noise["reaction_O_x"] for a, _ in pairs]
            distinct = min(total, float(np.linalg.norm(np.concatenate(parts))))
        elif "stiffness" in thing.values:
            distinct = min(total, rival_left(true, believed, starts, time, sigmas))
        if distinct < DISTINCT:
            raise Rejected(f"{thing.name} on the pendulum is not told from others")
        out.append(replace(thing, total=total, linear=distinct, distinct=distinct))
    return tuple(out)


RELEASED: dict[str, Callable[[np.random.Generator, Pendulum], list[Planted]]] = {
    "a spring": _sprung,
    "a spring near 180 deg": _opposite,
    "a payload on a pendulum": _loaded,
}


def _none(rng: np.random.Generator, experiment: Experiment) -> Planted:
    raise LookupError("a pendulum is not driven")


KINDS: dict[str, Drawer] = {
    "a spring": _none,
    "a payload": _heavy,
    "a length": _long,
    "friction": _rough,
    FORGOTTEN: _forgotten,
    "a spring near 180 deg": _none,
    "a payload on a pendulum": _none,
    "a spring near 180 deg in a linkage": _wound,
}
