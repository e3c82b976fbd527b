"""Hidden sets: an experiment, what is wrong with it, the engine that makes its data and the one that diagnoses them.

One seed is one set.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Turning
from analytic.mechanism import Load, Mechanism
from compare.diagnose.effects.effect import Effect, Rig, Values
from compare.diagnose.effects.joints import JointClearance
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.fit import Fit, Fitter
from compare.diagnose.predict import Term, derived
from compare.diagnose.residuals import Data
from compare.diagnose.sensitivities import sensitivities
from tests.evidence.results.scoreboard import Kind
from tests.evidence.scoreboard import several
from tests.evidence.scoreboard.outside import OUTSIDE, UNNAMED, Course, Outside, draw_outside, resized
from tests.evidence.scoreboard.rigs import (
    CASES,
    SENSORS,
    Experiment,
    Plan,
    Rejected,
    course_grid,
    draw_experiment,
    draw_log,
    ideal,
)
from tests.evidence.scoreboard.sizes import LARGEST, SMALLEST, Drawn, Planted, Sizer, drawn, every_rival, left, solve

# first seed of each kind of set
FIRST: dict[Kind, int] = {
    "effects": 0,
    "none": 100_000,
    "outside": 200_000,
    "alias": 300_000,
    "slightly-off": 400_000,
    "coarse": 410_000,
    "coloured": 420_000,
    "per-run": 430_000,
    "large": 440_000,
    "machines": 450_000,
    "unnamed": 460_000,
    "several": 470_000,
    "rattling": 480_000,
    "still": 490_000,
}
# by seed
DIAGNOSING = ("mujoco", "exudyn", "mujoco", "dart", "mujoco", "pybullet", "mujoco", "mujoco", "mujoco", "mujoco")
ELSE = "mujoco"  # diagnoses where the engine of the seed is the only one that can make the data
COUNTS = (0.6, 0.3, 0.1)  # of sets with one, two, three effects
MAKERS = {"exudyn": 1.0, "mujoco": 1.0, "dart": 1.0, "pybullet": 0.25}  # engines that make data: the slower the rarer
EVERY = 6  # the last of so many sets with several drives is empty
TWO = 0.25  # of those sets, with two effects
KEPT = 0.15  # of its peak: the reaction of a joint with clearance never falls below that
MANY = 8  # sensors, with which the place of what has no name should be found
UNDESCRIBED = (60.0, 160.0)  # sigmas that the best rival leaves of a thing outside the vocabulary
TOGETHER = 4  # effects together leave GAP of it at least
GAP = 0.6  # of the noise's mean square


@dataclass(frozen=True)
class Hidden:
    """A set and its truth.  ``source`` is the engine that makes the data, ``simulator`` the one that diagnoses."""

    seed: int
    kind: Kind
    experiment: Experiment
    source: str
    simulator: str
    truth: tuple[Planted, ...] = ()
    outside: Outside | None = None
    undescribed: float = 0.0  # sigmas of it that no single effect describes
    reversed_load: bool = False  # alias sets: whether a run has it


def kind_of(seed: int) -> Kind:
    """The kind of set that a seed makes."""
    return max((first, kind) for kind, first in FIRST.items() if first <= seed)[1]


def draw(seed: int, attempt: int) -> Hidden:
    """The set of a seed.  Raises Rejected where this attempt makes none; then the next one is tried."""
    rng = np.random.default_rng([seed, attempt])
    kind, simulator = kind_of(seed), DIAGNOSING[seed % len(DIAGNOSING)]
    if kind in ("effects", "machines"):
        return _with_effects(seed, simulator, rng)
    if kind in ("outside", "unnamed"):
        return _with_outside(seed, simulator, rng)
    if kind == "alias":
        return _with_alias(seed, simulator, rng)
    if kind == "several":
        return _with_several(seed, simulator, rng)
    experiment = draw_experiment(rng, list(CASES), (), False, True)
    return Hidden(seed, kind, experiment, draw_source(rng, simulator, ()), simulator)


def makers(effects: Sequence[Effect]) -> dict[str, float]:
    """The engines that make data with all of these effects, and how often each is drawn."""
    weights = dict(MAKERS)
    for effect in effects:
        able = effect.hiding.makers
        if able is not None:
            weights = {name: min(weight, able[name]) for name, weight in weights.items() if name in able}
    return weights


def draw_source(rng: np.random.Generator, simulator: str, effects: Sequence[Effect]) -> str:
    """An engine that has these effects and is not the diagnosing one."""
    weights = makers(effects)
    weights.pop(simulator, None)
    engines = list(weights)
    p = np.array([weights[e] for e in engines])
    return str(rng.choice(engines, p=p / p.sum()))


# ---------------------------------------------------------------- effects of the vocabulary


def hidden_in(kind: Kind) -> list[Effect]:
    """The effects that sets of a kind go through, one after the other."""
    return [effect for effect in VOCABULARY.values() if effect.hiding.sets == kind]


def _with_effects(seed: int, simulator: str, rng: np.random.Generator) -> Hidden:
    """One effect of the kind of set, and beside it others; those of real machines only in their own sets."""
    kind = kind_of(seed)
    own = hidden_in(kind)
    vocabulary = {effect.name: effect for effect in dict.fromkeys([*hidden_in("effects"), *own])}
    effects = [own[(seed - FIRST[kind]) % len(own)]]
    count = 1 + int(rng.choice(3, p=COUNTS))
    while len(effects) < count:
        able = [name for name, effect in vocabulary.items() if _goes_with(effect, effects)]
        effects.append(vocabulary[str(rng.choice(able))])
    hiding = [effect.hiding for effect in effects]
    cases = [case for case in CASES if all(h.cases is None or case in h.cases for h in hiding)]
    sensors = [sensor for h in hiding for sensor in h.sensors]
    may_follow = not any(h.commanded for h in hiding)
    experiment = draw_experiment(rng, cases, sensors, any(h.in_contact for h in hiding), may_follow)
    return _planted(seed, simulator, rng, effects, experiment)


def _planted(
    seed: int, simulator: str, rng: np.random.Generator, effects: Sequence[Effect], experiment: Experiment
) -> Hidden:
    """These effects somewhere in an experiment, as large as a hidden one is.  Raises Rejected."""
    if set(makers(effects)) == {simulator}:
        simulator = ELSE  # no other engine makes the data
    sizer = Sizer(experiment)
    truth: list[tuple[Term, Values]] = []
    for effect in effects:
        one = placed(effect, experiment, sizer.rig, rng, [t for t, _ in truth])
        truth.append((one.term, sizer.grown(one, draw_log(rng, SMALLEST, LARGEST))))
    source, judged = draw_source(rng, simulator, effects), tuple(sizer.judged(truth))
    return Hidden(seed, kind_of(seed), experiment, source, simulator, judged)


def _with_several(seed: int, simulator: str, rng: np.random.Generator) -> Hidden:
    """A rig with several drives: nothing in every sixth set, else one effect, or two."""
    k, names = seed - FIRST["several"], []
    if k % EVERY < EVERY - 1:
        names = [several.EFFECTS[(k - k // EVERY) % len(several.EFFECTS)]]
        names += rng.choice(several.EFFECTS, size=int(rng.random() < TWO)).tolist()
    effects = [VOCABULARY[name] for name in dict.fromkeys(names)]
    if sum(effect.hiding.exclusive for effect in effects) > 1:
        raise Rejected("no engine has both effects")
    hiding = [effect.hiding for effect in effects]
    sensors = [sensor for h in hiding for sensor in h.sensors]
    experiment = several.draw_several(rng, several.CASES, sensors, any(h.in_contact for h in hiding))
    found = _planted(seed, simulator, rng, effects, experiment)
    truth = [(Term(VOCABULARY[each.name], each.where), each.values) for each in found.truth]
    if len(truth) > 1 and Sizer(experiment).together(truth) < SMALLEST:
        raise Rejected("one effect describes both")
    return found


def _goes_with(effect: Effect, effects: Sequence[Effect]) -> bool:
    """Whether an engine can be found that has them all."""
    if effect.hiding.exclusive and any(other.hiding.exclusive for other in effects):
        return False
    together = (effect, *effects)
    return not any(e.hiding.need_beams for e in together) or all(
        e.sensor or e.hiding.with_beams or e.hiding.need_beams for e in together
    )


def placed(effect: Effect, experiment: Experiment, rig: Rig, rng: np.random.Generator, before: Sequence[Term]) -> Drawn:
    """An effect at one of its places; two of real machines are not at the same.  Raises Rejected."""
    taken = {t.key for t in before}
    if effect.hiding.sets == "machines":
        taken |= {(effect.name, t.where) for t in before if t.effect.hiding.sets == "machines"}
    places = [w for w in effect.places(rig) if (effect.name, w) not in taken]
    if effect.hiding.in_contact:
        places = [w for w in places if _stays_in_contact(experiment, w)]
    if not places:
        raise Rejected(f"{effect.name} has no place here")
    return drawn(effect, str(rng.choice(places)), experiment, rig, rng)


def _stays_in_contact(experiment: Experiment, joint: str) -> bool:
    sizes = [ideal(experiment.nominal, p)[f"reaction_{joint}_magnitude"] for p in experiment.plans]
    return all(size.min() > KEPT * size.max() for size in sizes)


# ---------------------------------------------------------------- outside the vocabulary


def _with_outside(seed: int, simulator: str, rng: np.random.Generator) -> Hidden:
    """Something of which the best single effect leaves many sigmas; of what never had a name, in every second set with
    eight sensors at least.
    """
    set_kind, k = kind_of(seed), seed - FIRST[kind_of(seed)]
    things = OUTSIDE if set_kind == "outside" else UNNAMED
    kind, turn = things[k % len(things)], k // len(things)
    anywhere = set_kind == "unnamed" or kind == "periodic torque"
    least = MANY if set_kind == "unnamed" and turn % 2 == 0 else SENSORS[0]
    cases = list(CASES) if anywhere else ["crank-rocker", "six-bar"]
    experiment = draw_experiment(rng, cases, ("torque", "cell"), False, False, least)
    outside = draw_outside(kind, experiment, rng)
    target, undescribed, gap = draw_log(rng, *UNDESCRIBED), 0.0, 0.0
    for _ in range(4):
        undescribed, gap = _undescribed(experiment, outside)
        if undescribed < 1e-6:
            raise Rejected(f"{kind} does not show")
        if abs(undescribed / target - 1) < 0.05 or gap * (target / undescribed) ** 2 < 0.8 * GAP:
            break
        outside = resized(outside, min(target / undescribed, 100.0))
    if abs(undescribed / target - 1) > 0.2 or gap < GAP:
        raise Rejected(f"{kind} at {outside.where} is nearly described by the vocabulary")
    return Hidden(
        seed,
        set_kind,
        experiment,
        draw_source(rng, simulator, ()),
        simulator,
        outside=outside,
        undescribed=undescribed,
    )


def _undescribed(experiment: Experiment, outside: Outside) -> tuple[float, float]:
    """Sigmas of it that the best single effect leaves, and the mean square that the best few leave, found one after the
    other.
    """
    sizer = Sizer(experiment)
    seen = []
    for plan in experiment.plans:
        signals = outside.signals(experiment.nominal, plan, plan.time, analytic)
        seen.append({s: plan.command(plan.time) if s == experiment.encoder else signals[s] for s in experiment.noise})
    measured = experiment.measured(seen)
    data = Data(measured, {(r.name, s): c.noise for r in measured.runs for s, c in r.channels.items()})
    fitter = Fitter(sizer.model([]), data, sizer.rig, sizer.bounds)
    residual = fitter.residuals([], [[]])[0]
    assert residual is not None
    base = Fit((), (), residual, np.zeros((residual.size, 0)), np.zeros(0, bool))
    known = {name: effect for name, effect in VOCABULARY.items() if name not in outside.excluded}
    columns = [s.columns for s in sensitivities(fitter, base, every_rival(sizer.rig, known)).values()]
    rest, after = residual, []
    for _ in range(TOGETHER):
        best = min(columns, key=lambda c: left(rest, c))
        rest = rest + best @ solve(best, rest)
        after.append(float(np.linalg.norm(rest)))
        columns = [c - best @ np.linalg.lstsq(best, c, rcond=None)[0] for c in columns]
    return after[0], after[-1] ** 2 / residual.size


def analytic(mechanism: Mechanism, plan: Plan, time: np.ndarray, course: Course | None) -> Mapping[str, np.ndarray]:
    """Every signal of a plan at times (N,) s, by the analytic model."""
    if course is None:
        theta = plan.command(time)
        turning = Turning(theta, np.full_like(theta, plan.speed), np.zeros_like(theta))
    else:
        grid = course_grid(plan, time)
        spline = CubicSpline(grid, course(grid))
        turning = Turning(spline(time), spline(time, 1), spline(time, 2))
    return derived(Assembly(mechanism), turning)


# ---------------------------------------------------------------- clearance, which may look like a length


def _with_alias(seed: int, simulator: str, rng: np.random.Generator) -> Hidden:
    """Clearance in B of a four-bar whose load never reverses, beside the same with a run in which it does (odd
    seeds).
    """
    experiment = draw_experiment(rng, ["crank-rocker"], ("encoder", "torque"), True, False)
    m = experiment.nominal
    load = Load(body="coupler", force=(0.0, -rng.uniform(35.0, 70.0)))
    m = m.replace(gravity=(0.0, 0.0), loads=(load,))
    first = experiment.plans[0]
    speeds = {"slow": 4.0, "fast": 6.5}
    plans = [
        replace(first, name=name, speed=speed, time=first.time * abs(first.speed / speed), loads=None)
        for name, speed in speeds.items()
    ]
    if seed % 2:
        lifted = load.model_copy(update={"force": (0.0, -load.force[1])})
        plans.append(replace(plans[0], name="slow-lifted", loads=(lifted,)))
    noise = {
        "crank_angle": 4e-5,
        "follower_angle": 6e-5,
        "coupler_angle": 6e-5,
        "coupler_x": 1e-5,
        "drive_torque": 4e-3 * experiment.rig.torque,
    }
    experiment = replace(experiment, nominal=m, plans=tuple(plans), noise=noise, units={})
    if not _stays_in_contact(experiment, "B"):
        raise Rejected("the load on B reverses")
    sizer = Sizer(experiment)
    clearance = drawn(JointClearance(), "B", experiment, sizer.rig, rng)
    truth = [(clearance.term, sizer.grown(clearance, draw_log(rng, 25.0, 100.0)))]
    planted = sizer.judged(truth)
    return Hidden(
        seed,
        "alias",
        experiment,
        draw_source(rng, simulator, [clearance.term.effect]),
        simulator,
        tuple(planted),
        reversed_load=bool(seed % 2),
    )
