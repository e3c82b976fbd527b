"""Do planned runs tell what was foretold, and more than runs that somebody would choose?

A rig is drawn as the scoreboard draws one, with two or three runs such as an engineer makes.  A plan for it may choose
as many runs, of the same speeds in both directions and with or without the loads, with as many samples.  The same
effect is then hidden in both, played by another engine, and diagnosed.

With ``usual`` the effect is as large as the plan takes it to be, and hidden in the planned runs alone.

With ``pairs`` no engine plays and nothing is diagnosed: it is told how many sigmas of an effect its best rival leaves.

``python -m tests.evidence.planning FIRST COUNT FOLDER [usual | pairs]`` writes a JSON file for each seed.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import tomli_w

from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism.file import dumps
from compare.diagnose import prepare
from compare.diagnose.fit import Fitter
from compare.diagnose.intervals import intervals
from compare.diagnose.plan.bench import read_bench
from compare.diagnose.plan.design import Chooser
from compare.diagnose.plan.information import Products, products
from compare.diagnose.plan.pool import pool
from compare.diagnose.plan.workflow import plan
from compare.diagnose.predict import Term
from compare.diagnose.residuals import Data
from compare.diagnose.workflow import diagnose
from compare.results.plan import Plan as Planned
from compare.results.plan import PlannedRun
from sim_models.engine import SimulationError
from tests.evidence.scoreboard.hidden import Hidden, draw_source, hidden_in, placed
from tests.evidence.scoreboard.record import recorded, with_noise
from tests.evidence.scoreboard.rigs import CASES, Experiment, Plan, Rejected, draw_experiment, draw_log
from tests.evidence.scoreboard.sizes import LARGEST, SMALLEST, Planted, Sizer

ATTEMPTS = 60
DRAWN = 10  # sets of runs at random
CLEAR = (15.0, 150.0)  # sigmas of an effect whose rivals are asked for
DIAGNOSING = "mujoco"
Key = tuple[str, str]


@dataclass(frozen=True)
class Told:
    """What a diagnosis made of some runs: its effects, what explains as well as the true one, and half of the 95 %
    interval of each parameter of the true one: as told, and as the true effect alone fits these data.
    """

    verdict: str
    named: tuple[Key, ...]
    ties: tuple[Key, ...]
    attained: Mapping[str, float]
    fitted: Mapping[str, float]


@dataclass(frozen=True)
class Compared:
    """A rig whose runs were chosen as usual and as planned, with the same effect hidden in both."""

    seed: int
    case: str
    truth: Key
    values: Mapping[str, float]
    source: str
    foretold: Mapping[str, float]
    careful: Mapping[str, float]
    told_if_usual: float
    seconds: float  # that the plan took
    usual: Told | None
    planned: Told
    possible: float | None  # sigmas that its best rival leaves in all runs together that could have been made


def compared(seed: int, of_usual_size: bool = False) -> Compared:
    """The set of a seed.  Raises Rejected where no attempt makes one."""
    for attempt in range(ATTEMPTS):
        try:
            return _attempted(seed, np.random.default_rng([seed, attempt, 36]), of_usual_size)
        except (Rejected, SimulationError, AssemblyError):
            continue
    raise Rejected(f"seed {seed}: none of {ATTEMPTS} attempts made a usable set")


def _attempted(seed: int, rng: np.random.Generator, of_usual_size: bool) -> Compared:
    own = [e for kind in ("effects", "machines") for e in hidden_in(kind) if not e.sensor]
    own = [e for e in own if not (e.leaps and of_usual_size)]  # whose intervals are not foretold
    effect = own[seed % len(own)]
    cases = [case for case in CASES if effect.hiding.cases is None or case in effect.hiding.cases]
    rig = draw_experiment(rng, cases, ("encoder", "torque", *effect.hiding.sensors), effect.hiding.in_contact, False)
    rig = replace(rig, noise_given=True)
    began = time.monotonic()
    planned, every = chosen(rig)
    seconds = time.monotonic() - began
    sizer = Sizer(rig)
    one = placed(effect, rig, sizer.rig, rng, [])
    foretold = next((e for e in planned.effects if (e.name, e.where) == one.term.key), None)
    parameters = foretold.parameters if foretold else {}
    source = draw_source(rng, DIAGNOSING, [effect])
    better = replace(rig, plans=tuple(_run(rig, run) for run in planned.runs))
    usual, possible = None, None
    if of_usual_size:
        if not parameters:
            raise Rejected(f"{one.term.label} is not foretold")
        values: Mapping[str, float] = {name: p.value for name, p in parameters.items()}
        hidden = Planted(effect.name, one.term.where, values)
    else:
        values = sizer.grown(one, draw_log(rng, SMALLEST, LARGEST))
        hidden = Planted(effect.name, one.term.where, values)
        usual = _told(rig, hidden, source, one.term, seed)
        possible = Sizer(replace(rig, plans=every)).judged([(one.term, values)])[0].distinct
    told = _told(better, hidden, source, replace(one.term, variant=values.get("harmonic", one.term.variant)), seed)
    return Compared(
        seed, rig.case, one.term.key, dict(values), source,
        {name: _half(one.term, name, p.low, p.high) for name, p in parameters.items()},
        {name: _half(one.term, name, p.careful_low, p.careful_high) for name, p in parameters.items()},
        foretold.told_if_usual if foretold else 0.0, seconds, usual, told, possible,
    )  # fmt: skip


@dataclass(frozen=True)
class Left:
    """Sigmas of an effect that its best rival leaves, to first order: in as many forward runs with the loads as drawn,
    in as many drawn at random (each of DRAWN draws), in planned ones, and in all that could have been made.
    """

    truth: Key
    plain: float
    random: tuple[float, ...]
    planned: float
    possible: float


def pairs(seed: int) -> list[Left]:
    """What the best rivals of every effect leave of it in a rig, each as large as shows by CLEAR in the plain runs."""
    rng = np.random.default_rng([seed, 37])
    rig = _drawn_rig(rng)
    with tempfile.TemporaryDirectory() as folder:
        bench = read_bench(_written(rig, Path(folder)), None, None, 0.0)
    every = pool(bench)
    best = Chooser(every, lambda *_: None).best()
    count, sensors = len(best.runs), best.sensors
    forward = [i for i, run in enumerate(every.runs) if run.loading.loads is None and (run.run.speed or 0) > 0]
    designs = [forward[-count:], best.runs, range(len(every.runs))]
    designs += [rng.choice(len(every.runs), count, replace=False).tolist() for _ in range(DRAWN)]
    made = [products(every, tuple(design), sensors, careful=0.0) for design in designs]
    found = []
    for key in made[0].keys:
        amounts = {s.term: rng.standard_normal(s.at.size) for s in every.suspects if s.term.key == key and not s.split}
        term = list(amounts)[int(rng.integers(len(amounts)))]
        total, plain = left_of(made[0], term, amounts[term])
        if total > 0:
            size = draw_log(rng, *CLEAR) / total
            planned, possible, *random = (size * left_of(one, term, amounts[term])[1] for one in made[1:])
            found.append(Left(key, size * plain, tuple(random), planned, possible))
    return found


def left_of(these: Products, term: Term, amounts: np.ndarray) -> tuple[float, float]:
    """Sigmas of an amount of an effect, and what the best rival at another place or of another name leaves of it."""
    own = next((i for i, s in enumerate(these.suspects) if s.term == term and not s.split), None)
    if own is None:
        return 0.0, 0.0
    at = these.at[own]
    total, least = float(amounts @ these.gram[np.ix_(at, at)] @ amounts), math.inf
    for i, s in enumerate(these.suspects):
        if s.term.key != term.key and not s.term.extends(term):
            inside = these.gram[np.ix_(these.at[i], these.at[i])]
            inside = inside + 1e-10 * np.diag(np.diag(inside)) + 1e-300 * np.eye(len(inside))
            across = these.gram[np.ix_(these.at[i], at)] @ amounts
            least = min(least, total - float(across @ np.linalg.solve(inside, across)))
    return math.sqrt(max(total, 0.0)), math.sqrt(max(least, 0.0))


def _drawn_rig(rng: np.random.Generator) -> Experiment:
    while True:
        try:
            return draw_experiment(rng, list(CASES), ("encoder", "torque"), False, False)
        except Rejected:
            continue


def chosen(rig: Experiment) -> tuple[Planned, tuple[Plan, ...]]:
    """As many runs as an experiment has, as planned; and every run that could have been made."""
    with tempfile.TemporaryDirectory() as folder:
        found = plan(_written(rig, Path(folder)))
    turns = _turns(rig)
    n = rig.plans[0].time.size
    every = [
        Plan(f"{i}-{way}-{loads is None}", way * speed, 0.3, np.linspace(0, turns * 2 * math.pi / speed, n), loads)
        for i, speed in enumerate(sorted({abs(run.speed) for run in rig.plans}))
        for way in (1, -1)
        for loads in ([None, ()] if rig.nominal.loads else [None])
    ]
    return found, tuple(every)


def _turns(rig: Experiment) -> float:
    """Turns of the crank in a run."""
    return max(1.0, abs(rig.plans[0].speed) * float(rig.plans[0].time[-1]) / (2 * math.pi))


def _written(rig: Experiment, folder: Path) -> Path:
    """A plan.toml of what a rig can do, in a folder."""
    table = {
        "speeds": sorted({abs(run.speed) for run in rig.plans}),
        "turns": _turns(rig),
        "samples": rig.plans[0].time.size,
        "budget": float(len(rig.plans)),
        "sensors": rig.noise,
        **({"loading": [{"name": "no-load", "load": []}]} if rig.nominal.loads else {}),
    }
    (folder / "nominal.toml").write_text(dumps(rig.nominal), encoding="utf-8")
    text = tomli_w.dumps({"mechanism": "nominal.toml", "rig": table})
    (folder / "plan.toml").write_text(text, encoding="utf-8")
    return folder / "plan.toml"


def _run(rig: Experiment, run: PlannedRun) -> Plan:
    time_ = np.linspace(0.0, run.duration, rig.plans[0].time.size)
    return Plan(run.name, run.speed, run.angle, time_, run.loads)


def _told(rig: Experiment, hidden: Planted, source: str, term: Term, seed: int) -> Told:
    """What a diagnosis makes of an effect that is hidden in some runs."""
    made = Hidden(seed, "effects", rig, source, DIAGNOSING, (hidden,))
    clean = [recorded(made, run) for run in rig.plans]
    data = rig.measured(with_noise(made, clean, np.random.default_rng([seed, 1])))
    found = diagnose(data, DIAGNOSING, others=False, workers=1)
    true = next((e for e in found.effects if (e.name, e.where) == term.key), None)
    attained = {n: _half(term, n, p.low, p.high) for n, p in true.parameters.items()} if true else {}
    ties = {(r.name, r.where) for e in found.effects for r in e.ambiguous_with}
    courses, data = prepare.followed(data)
    rigged, model = prepare.nominal(data, data.mechanism, courses)
    noise = {(run.name, s): c.noise for run in data.runs for s, c in run.channels.items()}
    fitter = Fitter(model, Data(data, noise), rigged, prepare.bounds(rigged, {}))
    fit = fitter.fit([term], {term: term.effect.natural(rigged, term.where, hidden.values, term.variant)})
    fitted = intervals(fitter, fit, 0, np.ones(fitter.data.size)) if fit is not None and not term.effect.leaps else {}
    return Told(
        found.verdict,
        tuple((e.name, e.where) for e in found.effects),
        tuple(sorted(ties)),
        attained,
        {n: _half(term, n, i.low, i.high) for n, i in fitted.items()},
    )


def _half(term: Term, name: str, low: float | None, high: float | None) -> float:
    """Half of an interval; of a stiffness or a modulus that of its reciprocal, which the data see."""
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return math.inf
    if name in ("stiffness", "youngs_modulus") and term.effect.name in RECIPROCAL and low > 0:
        return (1 / low - 1 / high) / 2
    return (high - low) / 2


RECIPROCAL = ("joint_compliance", "drive_compliance", "link_flexibility")


if __name__ == "__main__":
    first, count, folder = int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(first, first + count):
        if (folder / f"{k}.json").exists():
            continue
        try:
            if sys.argv[4:] == ["pairs"]:
                text = json.dumps([asdict(each) for each in pairs(k)])
            else:
                text = json.dumps(asdict(compared(k, sys.argv[4:] == ["usual"])), default=str)
        except Rejected as error:
            text = json.dumps({"seed": k, "rejected": str(error)})
        (folder / f"{k}.json").write_text(text, encoding="utf-8")
        print(k, text[:300], flush=True)
