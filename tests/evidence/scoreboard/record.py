"""Record a hidden set: run an engine, read its sensors, add noise, and write what a person would have measured; the
truth goes elsewhere.

``python -m tests.evidence.scoreboard.record SEED OUT`` writes OUT/data (measured.toml, nominal.toml, CSV files) and
OUT/seal/truth.json.  What sensors and the encoder do is written here anew, from the contract and not from the
diagnosis' own code: a delay is a question to the engine about another time, a turned load cell has axes of its own.
"""

from __future__ import annotations

import cmath
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism import Mechanism
from analytic.writing import write_atomically
from compare.diagnose.effects.effect import Effect, Values
from compare.diagnose.effects.sensors import EncoderOffset, SensorBias, SensorFrame, SensorGain
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.files import output_folder
from sim_models.common.rates import with_rates
from sim_models.engine import SimulationError, engine, installed_version
from tests.evidence.results.scoreboard import Recorder, TrueOutsider, Truth
from tests.evidence.scoreboard.bench.sensors import filtered, history
from tests.evidence.scoreboard.bench.written import FAMILIES, make_bench
from tests.evidence.scoreboard.files import Readings, Recording, write_files
from tests.evidence.scoreboard.hidden import FIRST, Hidden, draw, kind_of
from tests.evidence.scoreboard.outside import Course
from tests.evidence.scoreboard.play import run
from tests.evidence.scoreboard.rattling import make_rattling
from tests.evidence.scoreboard.rigs import Plan, Rejected, command_fields
from tests.evidence.scoreboard.score import RATTLING
from tests.evidence.scoreboard.sizes import Planted

ATTEMPTS = 200


def make_set(seed: int, data: Path, seal: Path) -> Truth:
    """Draw the set of a seed of any kind, record it, and write the data into one folder and the truth into the other.

    Raises Rejected where no attempt made a usable set.
    """
    kind = kind_of(seed)
    if kind in FAMILIES:
        return make_bench(seed, kind, seed - FIRST[kind], data, seal)
    if kind in RATTLING:
        return make_rattling(seed, kind, seed - FIRST[kind], data, seal)
    make(seed, data, seal)
    return Truth.read(seal / Truth.file)


def make(seed: int, data: Path, seal: Path) -> Hidden:
    """Draw the set of a seed, record it, and write the data into one folder and the truth into the other.

    Raises Rejected where no attempt made a usable set.
    """
    for attempt in range(ATTEMPTS):
        try:
            hidden = draw(seed, attempt)
            clean = [recorded(hidden, plan) for plan in hidden.experiment.plans]
        except (Rejected, SimulationError, AssemblyError):
            continue
        noisy = with_noise(hidden, clean, np.random.default_rng([seed, attempt, 1]))
        write_data(hidden, noisy, output_folder(data))
        write_atomically(output_folder(seal) / "truth.json", truth(hidden, attempt).to_json(1) + "\n")
        return hidden
    raise Rejected(f"seed {seed}: none of {ATTEMPTS} attempts made a usable set")


# ---------------------------------------------------------------- the rig


def recorded(hidden: Hidden, plan: Plan) -> Readings:
    """What noiseless sensors read in a run, by signal."""
    experiment, effects = hidden.experiment, hidden.truth
    age = {s: sum(VOCABULARY[e.name].delay(plan.name, s, e.where, e.values) for e in effects) for s in experiment.noise}
    lag = {s: sum(VOCABULARY[e.name].lag(plan.name, s, e.where, e.values) for e in effects) for s in experiment.noise}
    seen: Readings = {}
    for delay, constant in sorted({(age[s], lag[s]) for s in age}):
        asked = plan.time - delay
        time = history(asked, [constant]) if constant else asked
        signals, at = moved(hidden, plan, time), np.searchsorted(time, asked)
        for s in age:
            if (age[s], lag[s]) == (delay, constant):
                seen[s] = (filtered(time, signals[s], constant) if constant else signals[s])[at]
    for e in effects:
        seen = read(e, seen, plan.name)
        rates = {s: VOCABULARY[e.name].drift(plan.name, s, e.where, e.values) for s in seen}
        seen |= {s: seen[s] + rate * (plan.time - plan.time[0]) for s, rate in rates.items() if rate}
    return seen


def moved(hidden: Hidden, plan: Plan, time: np.ndarray) -> Mapping[str, np.ndarray]:
    """Every signal (N,) at times (N,) s, encoders on their motors, by the engine that makes the data."""

    def simulate(m: Mechanism, plan: Plan, time: np.ndarray, course: Course | None) -> Mapping[str, np.ndarray]:
        trace = run(hidden.source, m, plan, time, course)
        return with_rates(m, trace, (s for s in hidden.experiment.noise if s not in trace.signals))

    motors = hidden.experiment.encoded(plan, time)
    if hidden.outside is not None:
        found = hidden.outside.signals(hidden.experiment.nominal, plan, time, simulate)
        return {**found, **motors}
    m = hidden.experiment.nominal if plan.loads is None else hidden.experiment.nominal.replace(loads=plan.loads)
    for e in hidden.truth:
        effect = VOCABULARY[e.name]
        m = effect.on_mechanism(m, e.where, effect.in_run(e.values, plan.name))
    ripple = m.drives[0].ripple if m.cranked and m.drives else None
    if ripple is None:
        return {**simulate(m, plan, time, None), **motors}
    a, h, p = ripple.amplitude, ripple.harmonic, ripple.phase

    def motor(t: np.ndarray) -> np.ndarray:
        return np.asarray(plan.command(t) + a * np.sin(h * plan.command(t) + p))

    return {**simulate(m, plan, time, motor), hidden.experiment.encoder: motor(time)}


def _offset(seen: Readings, run: str, where: str, v: Values) -> Readings:
    return {**seen, where: seen[where] + v.get("offset", v.get(f"offset@{run}", 0.0))}


def _biased(seen: Readings, run: str, where: str, v: Values) -> Readings:
    return {**seen, where: seen[where] + v.get("bias", v.get(f"bias@{run}", 0.0))}


def _scaled(seen: Readings, run: str, where: str, v: Values) -> Readings:
    return {**seen, where: seen[where] + v["gain_error"] * seen[where]}


def _turned(seen: Readings, run: str, where: str, v: Values) -> Readings:
    x, y = f"reaction_{where}_x", f"reaction_{where}_y"
    axis = cmath.exp(1j * v["rotation"])  # the cell's own x, in the ground frame
    along = seen[x] * axis.real + seen[y] * axis.imag
    across = seen[y] * axis.real - seen[x] * axis.imag
    return {**seen, x: along, y: across}


ANEW: Mapping[type[Effect], Callable[[Readings, str, str, Values], Readings]] = {
    EncoderOffset: _offset,
    SensorBias: _biased,
    SensorGain: _scaled,
    SensorFrame: _turned,
}


def read(planted: Planted, seen: Readings, run: str) -> Readings:
    """What an effect of a sensor makes of the readings (delays, filters, drifts and clocks apart)."""
    effect = VOCABULARY[planted.name]
    play = ANEW.get(type(effect), effect.on_readings)
    return dict(play(seen, run, planted.where, planted.values))


def with_noise(hidden: Hidden, clean: list[Readings], rng: np.random.Generator) -> list[Readings]:
    """Readings with each sensor's noise."""
    return [
        {s: values + hidden.experiment.noise[s] * rng.standard_normal(values.size) for s, values in run.items()}
        for run in clean
    ]


# ---------------------------------------------------------------- files


def write_data(hidden: Hidden, noisy: list[Readings], folder: Path) -> None:
    """measured.toml, nominal.toml and a CSV file for each run."""
    e = hidden.experiment
    recordings = [
        Recording(plan.name, plan.time, readings, command_fields(plan))
        for plan, readings in zip(e.plans, noisy, strict=True)
    ]
    write_files(folder, e.nominal, recordings, e.units, e.noise if e.noise_given else None)


def truth(hidden: Hidden, attempt: int) -> Truth:
    """What is hidden in a set that this attempt drew."""
    return Truth(
        seed=hidden.seed,
        attempt=attempt,
        kind=hidden.kind,
        case=hidden.experiment.case,
        source=Recorder(name=hidden.source, version=installed_version(engine(hidden.source).package)),
        simulator=hidden.simulator,
        effects=tuple(e.sealed() for e in hidden.truth),
        noise=hidden.experiment.noise,
        reversed_load=hidden.reversed_load,
        outside=None if hidden.outside is None else outsider(hidden),
    )


def outsider(hidden: Hidden) -> TrueOutsider:
    """The fault outside the vocabulary that is hidden in a set."""
    fault = hidden.outside
    assert fault is not None
    place = {"kind": fault.kind, "where": fault.where, "size": fault.size, "left": hidden.undescribed}
    found = {"unknown": fault.unknown, "places": fault.places(hidden.experiment.nominal), "excluded": fault.excluded}
    return TrueOutsider.model_validate(place | found | fault.shape)


if __name__ == "__main__":
    if len(sys.argv) != 3 or not sys.argv[1].isdigit():
        kinds = ", ".join(f"{first}.. {kind}" for kind, first in FIRST.items())
        sys.exit(f"usage: python -m tests.evidence.scoreboard.record SEED OUT   ({kinds})")
    out = Path(sys.argv[2])
    made = make_set(int(sys.argv[1]), out / "data", out / "seal")
    print(
        f"{made.kind}: {made.case}, played by {made.source.name}, for {made.simulator} to diagnose:"
        f" {out / 'data' / 'measured.toml'}"
    )
