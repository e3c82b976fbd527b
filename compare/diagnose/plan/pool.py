"""Every run that a rig could make, as if it had been recorded without error, and what each effect would do in it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.reach import turns_fully, usual_angles
from analytic.kinematics.structure import StructureError
from analytic.mechanism.signals import named
from compare.diagnose import prepare
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.effects.each_run import in_each_run, repeats
from compare.diagnose.effects.effect import Rig
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.fit import Fitter
from compare.diagnose.plan.bench import A_TURN, FEWEST_SAMPLES, Bench, Loading
from compare.diagnose.posterior.prior import SLIGHT, Prior
from compare.diagnose.predict import Model, Term
from compare.diagnose.problem import silent
from compare.diagnose.residuals import Data
from compare.diagnose.sensitivities import Sensitivity, candidates, sensitivities
from compare.faults import ArgumentError, OptionError
from compare.progress import Progress

DENSE = 60  # samples of a turn, and
MOST_SAMPLES = 239  # of a run, that stand for all of it; a prime number, with which no harmonic of the crank repeats
RUNS = 60  # that a plan chooses from, at most


@dataclass(frozen=True)
class CandidateRun:
    """A run that could be made; ``run`` has the samples that stand for all ``samples`` of it."""

    run: MeasuredRun
    loading: Loading
    price: float
    samples: int

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.run.time[-1])


@dataclass(frozen=True)
class Suspect:
    """What may be missing: a term, ``at`` are the columns of what it does, over its natural size.

    ``odds`` are the prior's; ``positive`` tells which columns' amounts (k,) are never negative.  Where it is ``split``,
    each run has a value of its own, and the column of a run is that of all runs within it.
    """

    term: Term
    at: np.ndarray
    odds: float
    positive: np.ndarray
    split: bool = False

    @property
    def rig(self) -> bool:
        """Whether it is of the rig, not of a sensor."""
        return not self.term.effect.sensor

    def never_negative(self, count: int) -> np.ndarray:
        """Which of so many amounts (count,) are never negative."""
        return np.zeros(count, bool) if self.split else self.positive


@dataclass(frozen=True)
class Pool:
    """All runs that could be made.  ``gram`` has, for each of them and each sensor, the products (n, n) of all columns
    over that sensor's noise: of the suspects, then of the errors that careful work leaves (``slight`` of them).
    """

    bench: Bench
    runs: tuple[CandidateRun, ...]
    suspects: tuple[Suspect, ...]
    gram: Mapping[tuple[int, str], np.ndarray]
    slight: int
    measured: Measured  # the nominal readings
    noise: Mapping[tuple[str, str], float]  # by run and signal, of samples that stand for more
    rig: Rig
    prior: Prior
    hidden: tuple[Term, ...]  # effects of the rig that no sample of any of these runs would show


def pool(bench: Bench, progress: Progress = silent) -> Pool:
    """Every run that a rig could make.  Raises ArgumentError or OptionError where it can make none, or too many."""
    runs = _runs(bench)
    measured, model, rig = _as_if_measured(bench, runs)
    noise = {
        (run.run.name, s.signal): s.noise * math.sqrt(run.run.time.size / run.samples)
        for run in runs
        for s in bench.sensors
    }
    fitter = Fitter(model, Data(measured, noise), rig, prepare.bounds(rig, bench.tolerance))
    terms = prepare.allowed(candidates(rig, VOCABULARY), bench.tolerance, fitter.bounds)
    terms = [t for t in terms if not t.effect.acts_by_itself(t.variant)]
    terms = [t for t in terms if not repeats(t.effect, t.variant)]  # what varies is seen in data
    prior = Prior.of(rig, fitter.bounds, [t for t in terms if t.effect.place != "run" or t.where == rig.runs[0]])
    suspects, columns, slight = _signatures(fitter, prior, terms, progress)
    every = np.hstack([columns, slight])
    gram = {(p.run, p.signal): every[p.place].T @ every[p.place] for p in fitter.data.parts}
    hidden = tuple(s.term for s in suspects if s.rig and not columns[:, s.at].any())
    return Pool(bench, runs, tuple(suspects), gram, slight.shape[1], measured, noise, rig, prior, hidden)


def _signatures(
    fitter: Fitter, prior: Prior, terms: Sequence[Term], progress: Progress
) -> tuple[list[Suspect], np.ndarray, np.ndarray]:
    """The suspects, all their columns (size, n), and what errors of careful work do (size, k)."""
    base, rig = fitter.at((), {}), prior.rig
    assert base is not None  # the nominal mechanism has made the runs
    common = [t for t in terms if not in_each_run(t.effect, t.variant)]
    found: dict[Term, Sensitivity] = {}
    for k, term in enumerate(common):
        progress("what each effect would do in each run", k, len(common))
        found |= sensitivities(fitter, base, [term])
    each_run = {t.key: t for t in terms if in_each_run(t.effect, t.variant)}
    suspects: list[Suspect] = []
    columns, slight = [np.zeros((fitter.data.size, 0))], [np.zeros((fitter.data.size, 0))]

    def add(term: Term, own: np.ndarray, positive: np.ndarray) -> None:
        at = np.arange(own.shape[1]) + sum(c.shape[1] for c in columns)
        columns.append(own)
        odds = prior.log_odds(replace(term, where=rig.runs[0]) if term.effect.place == "run" else term)
        suspects.append(Suspect(term, at, math.exp(odds), positive))
        if (each := each_run.get(term.key)) is not None:
            suspects.append(Suspect(each, at, math.exp(prior.log_odds(each)), positive, split=True))

    for term, seen in found.items():
        effect, answers = term.effect, term.effect.combined(seen.columns)
        amounts = effect.amounts(rig, term.where, prior.size(term), term.variant)
        add(term, answers * amounts, effect.never_negative(rig, term.where, fitter.bounds(term)[0], term.variant))
        if effect.name in SLIGHT:
            small = effect.amounts(rig, term.where, prior.slight(term), term.variant)
            slight.append((answers * small)[:, : effect.sized])
    shown = {term.key for term in found}
    for term in common:  # what nothing shows may be missing all the same
        if not term.effect.sensor and term.key not in shown:
            add(term, np.zeros((fitter.data.size, 1)), np.zeros(1, bool))
    return suspects, np.hstack(columns), np.hstack(slight)


def _runs(bench: Bench) -> tuple[CandidateRun, ...]:
    """Every speed in every direction with every load.  Raises ArgumentError."""
    m = bench.mechanism
    try:
        assembly = Assembly(m)
    except (AssemblyError, StructureError) as error:
        raise OptionError(f"{m.name}: {error}") from None
    around = turns_fully(assembly)
    angles = usual_angles(assembly)
    low, high = (float(angles[0]), float(angles[-1])) if not around else (0.0, 2 * math.pi * bench.turns)
    if not high > low:
        raise OptionError(f"the crank of {m.name} cannot move from where it is assembled")
    start = m.assembly[m.driven]
    directions = (1, -1) if bench.reverse else (1,)
    found = []
    for loading in bench.loadings:
        for speed in bench.speeds:
            for way in directions:
                duration = (high - low) / speed
                rate = bench.rate or A_TURN * speed / (2 * math.pi)
                samples = bench.samples or int(duration * rate + 1e-9) + 1
                if samples < FEWEST_SAMPLES:
                    raise OptionError(
                        f"a run at {speed:g} rad/s takes {duration:.3g} s, and rate = {rate:g} makes {samples} samples"
                        f" of it; give {FEWEST_SAMPLES} or more: a higher rate, or more turns",
                    )
                few = min(samples, MOST_SAMPLES, max(FEWEST_SAMPLES, math.ceil(DENSE * (high - low) / (2 * math.pi))))
                name = "-".join(filter(None, [_pace(speed), "reverse" if way < 0 else "", loading.name]))
                angle = start if around else low if way > 0 else high
                run = MeasuredRun(
                    name, np.linspace(0.0, duration, few), {}, "speed", way * speed, float(angle), {}, loading.loads,
                    False, f"{name}.csv",
                )  # fmt: skip
                found.append(CandidateRun(run, loading, bench.run_price + loading.price, samples))
    if len(found) > RUNS:
        raise OptionError(f"there are {len(found)} runs to choose from; give fewer speeds or loads: {RUNS} runs")
    return tuple(found)


def _pace(speed: float) -> str:
    """A speed (rad/s) in the name of a run: ``60rpm``."""
    rpm = speed * 30 / math.pi
    return f"{rpm:.0f}rpm" if rpm >= 1000 or abs(rpm - round(rpm)) < 1e-6 * rpm else f"{rpm:.4g}rpm"


def _as_if_measured(bench: Bench, runs: Sequence[CandidateRun]) -> tuple[Measured, Model, Rig]:
    """The runs with readings as the nominal mechanism makes them.  Raises ArgumentError, or MeasuredError where it
    cannot.
    """
    m = bench.mechanism.rigid()
    signals = named(m.bodies, m.joints, m.drives, m.sensors)

    def recorded(readings: Sequence[Mapping[str, np.ndarray]]) -> Measured:
        made = []
        for candidate, read in zip(runs, readings, strict=True):
            channels = {
                s.signal: Channel(signals[s.signal], read[s.signal], s.noise, True, signals[s.signal].unit)
                for s in bench.sensors
            }
            made.append(replace(candidate.run, channels=channels))
        return Measured(m, tuple(made), bench.tolerance, (), bench.mechanism.name)

    silent = [{s.signal: np.zeros(r.run.time.size) for s in bench.sensors} for r in runs]
    rig, model = prepare.nominal(recorded(silent), m, {})
    read = model([[]])[0]
    assert read is not None  # prepare.nominal has tried
    for sensor in bench.sensors:
        if not all(np.isfinite(each[sensor.signal]).all() for each in read):
            raise ArgumentError(
                "sensors", f"{sensor.signal} cannot be foretold: statics does not determine it; leave it out"
            )
    measured = recorded(read)
    return measured, Model(measured, rig, m, {}), rig
