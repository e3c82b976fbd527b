"""What a diagnosis found, as the document that is written."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest
from typing import TYPE_CHECKING, Literal

import numpy as np

from analytic.mechanism.assumed import assumed
from analytic.mechanism.one_line import count
from analytic.mechanism.tolerances import as_made
from compare.diagnose.beside_torque import beside_torque
from compare.diagnose.data.recording import Fault as RecordedFault
from compare.diagnose.data.recording import MeasuredRun
from compare.diagnose.effects.each_run import repeats
from compare.diagnose.effects.effect import landing_in
from compare.diagnose.experiment_design import would_separate
from compare.diagnose.explanation import Attempt, Explanation, Named
from compare.diagnose.fit import Fit
from compare.diagnose.foretold import Explained
from compare.diagnose.intervals import Covariance, Interval
from compare.diagnose.noise import rms
from compare.diagnose.posterior.infer import probability
from compare.diagnose.predict import Term
from compare.diagnose.residuals import FOLDS, SEGMENTS
from compare.report.words import statement as words
from compare.report.words.effects import REST
from compare.results.crosscheck import Simulator
from compare.results.diagnosis import (
    SIDES,
    CandidateStatus,
    Closing,
    ConsideredEffect,
    DiagnosedRun,
    Diagnosis,
    Effect,
    EffectSet,
    Elsewhere,
    EngineGaps,
    Estimate,
    JointCovariance,
    Kind,
    Located,
    Proposed,
    RecordingFault,
    Repeats,
    Rival,
    SensorGap,
    SensorRecord,
    Side,
    TriedEffect,
)
from sim_models.engine import SettingValue, installed_version

if TYPE_CHECKING:
    from compare.diagnose.locate import Stretch
    from compare.diagnose.problem import Problem, Verified
    from compare.diagnose.residuals import Part
    from compare.diagnose.simulate import Simulated
    from compare.diagnose.validation import Validated, Validation

INSEPARABLE = 0.999  # cosine between two sensitivities
LISTED = 40  # pairs
SETS = 20  # of effects that are listed


def as_document(
    problem: Problem, found: Verified, validation: Validation, proposed: tuple[Proposed, ...] = ()
) -> Diagnosis:
    """Everything found; the command that asked for it is not known here."""
    e = found.explanation
    before, after = (_gap(problem, e, said[problem.simulator]) for said in (found.before, found.after))
    gap = (before if before is not None else e.gap[0], after if after is not None else e.gap[1])
    why = found.after[problem.simulator].skipped
    failure = (
        f"{problem.simulator} could not simulate that ({why}): the gap after is the analytic model's." if why else ""
    )
    sides = _sides(problem, found)
    runs = tuple(_run(problem, e, sides, r, run) for r, run in enumerate(problem.measured.runs))
    landings = _landings(problem, found)
    landed = sum(int(np.sum(landing)) for landing in landings)
    result = Diagnosis(
        case=problem.mechanism.name,
        verdict=e.verdict,
        statement=e.verdict,  # until its sentences can be made of the rest
        simulator=Simulator(name=problem.simulator, version=found.before[problem.simulator].version),
        command="",
        versions=_versions(found),
        located=tuple(_located(stretch) for stretch in found.stretches),
        effects=_effects(problem, e),
        gap=_closing(problem, gap, runs, landings) if e.statistics is None else _closing_by(problem, found, gap),
        other_simulators={
            name: Elsewhere(before=_gap(problem, e, found.before[name]), after=_gap(problem, e, said))
            for name, said in found.after.items()
            if name != problem.simulator and said.readings is not None
        },
        faults=tuple(
            RecordingFault(run=f.run, signal=f.signal, kind=f.kind, samples=f.samples, text=f.text)
            for f in (*_still_faults(problem, e), *validation.faults)
        ),
        candidates=(),
        attempts=tuple(_attempt(e, a) for a in e.attempts),
        proposed=proposed,
        inseparable=_inseparable(problem),
        engines=_engines(problem, found),
        runs=(*runs, *(_validation_run(validated) for validated in validation.runs)),
        mechanism=as_made(problem.measured.mechanism),
        explained=as_made(found.explained),
        steps=(),
        sets=_sets(e),
        covariance=_covariance(e),
        notes=(*problem.notes, *([words.CRANK_LANDS.format(count(landed, "sample"))] if landed else [])),
        assumed=(*assumed(problem.measured.mechanism), *problem.measured.assumed),
        complete=problem.complete,
    )
    if e.verdict == "partly explained":
        explained = Explained(result, problem.mechanism, problem.options.vocabulary)
        result = beside_torque(result, explained, e, problem.rig, problem.fitter.bounds)
    cut = "" if problem.complete else f" {words.BUDGET.format(problem.options.budget)}"
    told = {"statement": words.statement(result, e, failure) + cut, "candidates": _candidates(problem, found, result)}
    result = result.model_copy(update=told)
    return result.model_copy(update={"steps": words.steps(result, e, found.agreement_before, problem.notes)})


def _sets(e: Explanation) -> tuple[EffectSet, ...]:
    """The most probable sets of effects, and how probable all others are together."""
    ranked = sorted(e.sets.items(), key=lambda item: -item[1])[:SETS]
    told = [
        EffectSet(
            effects=tuple(sorted(f"{name}@{where}" for name, where in keys)),
            probability=share,
            values=c.values if (c := e.competing.get(keys)) else None,
            covariance=_joint(c.covariance) if c else None,
        )
        for keys, share in ranked
    ]
    rest = 1.0 - sum(share for _, share in ranked)
    return (*told, EffectSet(effects=(REST,), probability=max(rest, 0.0))) if told else ()


def _covariance(e: Explanation) -> JointCovariance | None:
    """The covariance of all named parameters; none where nothing is named, or a rig rattles."""
    if e.covariance is None or not e.covariance.names:
        return None
    return _joint(e.covariance)


def _joint(known: Covariance) -> JointCovariance:
    rows = tuple(tuple(float(v) if math.isfinite(v) else None for v in row) for row in known.values)
    return JointCovariance(names=known.names, values=rows)


def _still_faults(problem: Problem, e: Explanation) -> list[RecordedFault]:
    """What is wrong with the data: where pins strike, isolated spikes are not."""
    judged = () if e.statistics is None else e.statistics.floor
    return [f for f in problem.measured.faults if f.kind != "outliers" or (f.run, f.signal) not in judged]


def _located(stretch: Stretch) -> Located:
    return Located(
        run=stretch.run,
        signal=stretch.signal,
        crank_angle_from=stretch.begin,
        crank_angle_to=stretch.end,
        size=stretch.size,
        unit=stretch.unit,
        sigmas=stretch.sigmas,
        time_from=stretch.time[0] if stretch.time else None,
        time_to=stretch.time[1] if stretch.time else None,
        every_turn=stretch.time is None,
    )


def _gap(problem: Problem, e: Explanation, said: Simulated) -> float | None:
    return None if said.readings is None else problem.gap(e, said.readings)


def _landings(problem: Problem, found: Verified) -> list[np.ndarray]:
    """At which samples of each run, (N,) bool, the crank lands in the gap of its drive, by what is named."""
    after = found.after[problem.simulator].readings
    still = [np.zeros(run.time.size, bool) for run in problem.measured.runs]
    if after is None:
        return still
    return [
        np.any([s, *(r[landing_in(name)] for name in run.channels if landing_in(name) in r)], axis=0)
        for s, r, run in zip(still, after, problem.measured.runs, strict=True)
    ]


def _closing(
    problem: Problem, gap: tuple[float, float], runs: Sequence[DiagnosedRun], landings: Sequence[np.ndarray]
) -> Closing:
    """The gap in noise, the share of its excess that is explained, and how far each sensor is off in its own unit, but
    for what jumps where the crank lands.
    """
    excess = gap[0] ** 2 - 1
    return Closing(
        before=gap[0],
        after=gap[1],
        noise_floor=problem.noise_floor,
        explained=min((gap[0] ** 2 - gap[1] ** 2) / excess, 1.0) if excess > 0 else None,
        by_signal={
            name: _by_signal(
                [
                    (run.signals[name], ~landing | (not problem.data.sudden[name]))
                    for run, landing in zip(runs, landings, strict=True)
                    if name in run.signals
                ],
                signal.wraps,
            )
            for name, signal in problem.measured.signals.items()
            if any(name in run.signals for run in runs)
        },
    )


def _closing_by(problem: Problem, found: Verified, gap: tuple[float, float]) -> Closing:
    """The same of a rig that rattles, by its statistics."""
    by, excess = found.explanation.statistics, gap[0] ** 2 - 1
    assert by is not None
    sides = [said[problem.simulator].readings for said in (found.before, found.after)]
    off = {
        name: [None if each is None else by.off(name, each) for each in sides]
        for name in dict.fromkeys(signal for _, signal in by.floor)
    }
    return Closing(
        before=gap[0],
        after=gap[1],
        noise_floor=1.0,
        explained=min((gap[0] ** 2 - gap[1] ** 2) / excess, 1.0) if excess > 0 else None,
        by_signal={
            name: SensorGap(unit=problem.measured.signals[name].unit, before=before, after=after)
            for name, (before, after) in off.items()
        },
    )


def _by_signal(channels: Sequence[tuple[SensorRecord, np.ndarray]], wraps: bool) -> SensorGap:
    """How far a sensor is off at the samples (N,) bool of each record that count."""
    off: dict[Side, float | None] = {}
    for side in SIDES:
        residual = np.concatenate([channel.residual(side, wraps)[counts] for channel, counts in channels])
        known = residual[np.isfinite(residual)]
        off[side] = rms(known) if known.size else None
    return SensorGap(unit=channels[0][0].unit, before=off["before"], after=off["after"])


def _kind(term: Term) -> Kind:
    return "sensor" if term.effect.sensor else "rig"


def _attempt(e: Explanation, a: Attempt) -> TriedEffect:
    return TriedEffect(
        name=a.term.effect.name,
        where=a.term.where,
        kind=_kind(a.term),
        parameters={name: as_parameter(interval) for name, interval in a.parameters.items()},
        share=a.share,
        gap_before=a.gap[0],
        gap_after=a.gap[1],
        failed=a.failed or words.unlikely(probability(e.sets, a.term.key)),
    )


def as_parameter(interval: Interval) -> Estimate:
    """A parameter as the document has it; an open end of its interval is no number."""
    return Estimate(value=interval.value, unit=interval.unit, low=interval.low, high=interval.high)


def _effects(problem: Problem, e: Explanation) -> tuple[Effect, ...]:
    noise = {
        (problem.measured.runs[p.run].name, p.signal): float(problem.data.sigma[p.place][0])
        for p in problem.data.parts
        if p.used.size
    }
    return tuple(_effect(problem, e, n, noise) for n in e.named)


def _effect(problem: Problem, e: Explanation, n: Named, noise: dict[tuple[str, str], float]) -> Effect:
    return Effect(
        name=n.term.effect.name,
        where=n.term.where,
        parameters={name: as_parameter(interval) for name, interval in n.parameters.items()},
        gap_before=n.gap[0],
        gap_after=n.gap[1],
        held_out_before=n.held_out[0],
        held_out_after=n.held_out[1],
        ambiguous_with=tuple(
            Rival(name=t.effect.name, where=t.where, odds=odds)
            for (t, _), odds in zip_longest(n.ties, n.odds[: len(n.ties)])
        ),
        would_separate=_separating(problem, e, n, noise),
        kind=_kind(n.term),
        share=n.share,
        evidence=e.statistics.says() if e.statistics is not None else "",
        probability=n.probability,
        repeats=_repeats(n),
    )


def _repeats(n: Named) -> Repeats | None:
    """How an effect of the rig with a value for each run differs from run to run."""
    if not repeats(n.term.effect, n.term.variant):
        return None
    each = list(n.parameters.values())
    values = [p.value for p in each]
    apart = each[0].low > each[-1].high or each[0].high < each[-1].low  # beyond both intervals of 95 %
    steps = np.sign(np.diff(values))
    trend: Literal["", "falling", "rising"] = ""
    if apart and abs(steps.sum()) == steps.size:
        trend = "falling" if steps[0] < 0 else "rising"
    return Repeats(low=min(values), high=max(values), trend=trend)


def _separating(problem: Problem, e: Explanation, n: Named, noise: dict[tuple[str, str], float]) -> str:
    """What would tell an effect from its rivals."""
    if not n.ties:
        return ""
    if e.statistics is not None:
        return words.LONGER_RUN
    return would_separate(problem.model, noise, e.fit, [fit for _, fit in n.ties])


def _candidates(problem: Problem, found: Verified, result: Diagnosis) -> tuple[ConsideredEffect, ...]:
    """Every effect that was considered, what the data thought of it, and why it was not named."""
    e = found.explanation
    chosen = {n.term.key: n for n in e.named}
    tied = {t.key: n for n in e.named for t, _ in n.ties}
    failed = {a.term.key: a.failed for a in e.attempts}
    nearest = _nearest(problem, e.fit, [n.term for n in e.named])
    best: dict[tuple[str, str], Alone] = {}
    for each in alone(problem, e.base):
        if each.term.key not in best or each.gain > best[each.term.key].gain:
            best[each.term.key] = each
    rows: dict[tuple[str, str], ConsideredEffect] = {}
    for term in problem.terms:
        if term.key in rows:
            continue
        status: CandidateStatus
        remaining, rival, sigmas = None, None, 0.0
        if term.key in problem.ruled_out:
            status, why = "excluded", problem.ruled_out[term.key]
        elif term.key not in best:
            status, why = _unseen(result, chosen.get(term.key))
        else:
            shown = best[term.key]
            sigmas = math.sqrt(max(shown.gain, 0.0))
            if term.key in chosen:
                rival, remaining = nearest[chosen[term.key].term]
                status, why = "named", words.named(result, chosen[term.key])
            elif term.key in tied:
                status, why = "tied", words.why_tied(result, tied[term.key])
            elif unphysical := _unphysical(shown, problem):
                status, why = "not physical", unphysical
            else:
                improbable = words.improbable(sigmas, probability(e.sets, term.key) if e.sets else None)
                status, why = "not needed", failed.get(term.key) or improbable
        rows[term.key] = ConsideredEffect(
            name=term.effect.name,
            where=term.where,
            sigmas=sigmas,
            remaining=remaining,
            rival=rival,
            status=status,
            why=why,
        )
    return tuple(rows.values())


def _unseen(result: Diagnosis, n: Named | None) -> tuple[CandidateStatus, str]:
    """What is said of an effect that no sample shows: one that is asked for may be named by statistics."""
    if n is not None and n.term.effect.asked_for:
        return "named", words.named(result, n)
    return "invisible", words.NOT_SHOWN


@dataclass(frozen=True)
class Alone:
    """An effect alone: the decrease of chi^2 that it would bring to first order, and its natural coordinates (n,)."""

    term: Term
    gain: float
    x: np.ndarray


def alone(problem: Problem, base: Fit) -> list[Alone]:
    """Every effect that the data can see, alone beside the nominal mechanism."""
    basis = np.linalg.qr(base.jacobian)[0]
    found = []
    for term, s in problem.signatures.items():
        columns, residual = (v - basis @ (basis.T @ v) for v in (s.columns, base.residual + s.offset))
        coefficients = -np.linalg.lstsq(columns, residual, rcond=1e-10)[0]
        left = residual + columns @ coefficients
        found.append(Alone(term, base.chi2 - float(left @ left), s.start(problem.rig, coefficients)))
    return found


def _unphysical(shown: Alone, problem: Problem) -> str:
    """Why the value that the data want alone is beyond the physical; empty where it is not."""
    low, _ = problem.fitter.bounds(shown.term)
    beyond = shown.x < low - 1e-12 * np.abs(low) if shown.x.size == low.size else np.zeros(0, bool)
    if not beyond.any():
        return ""
    return words.WRONG_SIGN if np.any(low[beyond] == 0) else words.BEYOND


def _nearest(problem: Problem, fit: Fit, named: Sequence[Term]) -> dict[Term, tuple[str | None, float]]:
    """By named effect the rival that resembles it most, and the sigmas of its signature that remain beside that
    rival.
    """
    rivals = {t: s.columns for t, s in problem.signatures.items() if t not in fit.terms}
    columns = np.column_stack([fit.jacobian, *rivals.values()])
    norm = np.linalg.norm(columns, axis=0)
    norm[norm == 0] = 1.0
    columns = columns / norm
    gram = columns.T @ columns
    ends = np.cumsum([fit.jacobian.shape[1], *(c.shape[1] for c in rivals.values())])
    places = {t: np.arange(begin, end) for t, (begin, end) in zip(rivals, pairwise(ends.tolist()), strict=True)}
    found: dict[Term, tuple[str | None, float]] = {}
    for term in named:
        own = fit.columns(fit.terms.index(term))
        amounts = norm[own] * fit.x[fit.terms.index(term)]
        size, pull = float(amounts @ gram[own, own] @ amounts), gram[:, own] @ amounts
        others = np.delete(np.arange(fit.jacobian.shape[1]), own)

        def left(beside: np.ndarray, size: float = size, pull: np.ndarray = pull) -> float:
            inner = gram[np.ix_(beside, beside)] + 1e-10 * np.eye(beside.size)
            return math.sqrt(max(size - float(pull[beside] @ np.linalg.solve(inner, pull[beside])), 0.0))

        remains: dict[str, float] = {}
        for rival, place in places.items():
            if rival.key != term.key:
                alone = left(np.concatenate([others, place]))
                remains[rival.label] = min(remains.get(rival.label, math.inf), alone)
        name = min(remains, key=lambda k: (remains[k], k)) if remains else None
        found[term] = (name, left(others) if name is None else remains[name])
    return found


def _inseparable(problem: Problem) -> tuple[tuple[str, str, float], ...]:
    """Pairs of one-parameter effects whose sensitivities are the same on these data."""
    single = {t: s.columns[:, 0] for t, s in problem.signatures.items() if s.columns.shape[1] == 1 and not t.variant}
    terms = list(single)
    if not terms:
        return ()
    columns = np.column_stack([single[t] / max(float(np.linalg.norm(single[t])), 1e-300) for t in terms])
    cosine = columns.T @ columns
    pairs = [
        (abs(float(cosine[i, j])), i, j) for i in range(len(terms)) for j in range(i) if abs(cosine[i, j]) > INSEPARABLE
    ]
    return tuple(
        (terms[j].label, terms[i].label, float(cosine[i, j]))
        for _, i, j in sorted(pairs, key=lambda p: (-p[0], p[1], p[2]))[:LISTED]
    )


def _engines(problem: Problem, found: Verified) -> tuple[EngineGaps, ...]:
    asked = tuple(
        EngineGaps(
            name=name,
            version=said.version or found.before[name].version,
            agreement=found.agreement[name],
            before=_gap(problem, found.explanation, found.before[name]),
            after=_gap(problem, found.explanation, said),
            skipped=said.skipped,
            added=tuple(said.added),
            settings=_settings(problem, said if said.settings else found.before[name]),
        )
        for name, said in found.after.items()
    )
    absent = tuple(
        EngineGaps(
            name=name,
            version="",
            before=None,
            after=None,
            agreement=None,
            added=(),
            settings={},
            skipped=why,
        )
        for name, why in problem.skipped.items()
    )
    return asked + absent


def _settings(problem: Problem, said: Simulated) -> dict[str, Mapping[str, SettingValue]]:
    """An engine's own settings, by run."""
    runs = zip(problem.measured.runs, said.settings, strict=False)
    return {run.name: found for run, found in runs}


def _sides(problem: Problem, found: Verified) -> Mapping[Side, Sequence[Mapping[str, np.ndarray]]]:
    """What the chosen engine reads in every run before and after; where it fails after, what the analytic model does,
    of which the gap is told then.
    """
    said = {"before": found.before[problem.simulator].readings, "after": found.after[problem.simulator].readings}
    e = found.explanation
    if said["after"] is None and e.statistics is None:
        said["after"] = problem.analytic(e.fit)
    return {side: each for side in SIDES if (each := said[side]) is not None}


def _run(
    problem: Problem, e: Explanation, sides: Mapping[Side, Sequence[Mapping[str, np.ndarray]]], r: int, run: MeasuredRun
) -> DiagnosedRun:
    segment = np.minimum(np.arange(run.time.size) * SEGMENTS // run.time.size, SEGMENTS - 1)
    by, absent = e.statistics, np.full(run.time.size, np.nan)
    residual = {side: problem.data.residual(each) for side, each in sides.items()}
    spread = {} if by is None else {side: by.gaps(each) for side, each in sides.items()}

    def read(side: Side, signal: str) -> np.ndarray:
        return sides[side][r][signal] if side in sides else absent

    def gap(side: Side, part: Part) -> float | None:
        if side not in sides:
            return None
        return rms(residual[side][part.place]) if by is None else spread[side].get((run.name, part.signal))

    signals: dict[str, SensorRecord] = {}
    for part in problem.data.parts:
        if part.run != r:
            continue
        channel = run.channels[part.signal]
        signals[part.signal] = SensorRecord(
            unit=channel.signal.unit,
            noise=_noise(problem, part) if part.used.size else channel.noise,
            noise_given=channel.noise_given,
            measured=channel.values,
            before=read("before", part.signal),
            after=read("after", part.signal),
            gap_before=gap("before", part),
            gap_after=gap("after", part),
        )
    return DiagnosedRun(
        name=run.name,
        file=run.file,
        drive=run.input,
        time=run.time,
        crank_angle=problem.crank_angle(run),
        held_out=tuple(1 if s % FOLDS == 0 else 0 for s in segment),
        signals=signals,
        role="fit",
    )


def _noise(problem: Problem, part: Part) -> float:
    """1-sigma (SI) of a sensor's noise of every kind: white, wandering and hum."""
    colour = problem.data.colours.get(part.signal)
    return float(problem.data.sigma[part.place][0]) * (colour.total if colour else 1.0)


def _validation_run(validated: Validated) -> DiagnosedRun:
    """A validation run as the document has it: its gaps are over its own noise, errors in common left aside."""
    run = validated.run
    absent = np.full(run.time.size, np.nan)
    sides = (("before", validated.before), ("after", validated.after))
    signals: dict[str, SensorRecord] = {}
    for name, channel in run.channels.items():
        if run.drive == "measured" and name in validated.encoders:
            continue
        said = {side: absent if found.readings is None else found.readings[0][name] for side, found in sides}
        off = {side: channel.signal.apart(channel.values, values) / channel.noise for side, values in said.items()}
        gaps = {side: rms(known) if (known := each[np.isfinite(each)]).size else None for side, each in off.items()}
        signals[name] = SensorRecord(
            unit=channel.signal.unit,
            noise=channel.noise,
            noise_given=channel.noise_given,
            measured=channel.values,
            before=said["before"],
            after=said["after"],
            gap_before=gaps["before"],
            gap_after=gaps["after"],
        )
    return DiagnosedRun(
        name=run.name,
        file=run.file,
        drive=run.input,
        time=run.time,
        crank_angle=validated.crank_angle,
        held_out=None,
        signals=signals,
        role="validation",
    )


def _versions(found: Verified) -> dict[str, str]:
    packages = {name: installed_version(name) or "not installed" for name in ("linkage-crosscheck", "numpy", "scipy")}
    return {
        "python": platform.python_version(),
        **packages,
        **{n: s.version for n, s in found.before.items() if s.version},
    }
