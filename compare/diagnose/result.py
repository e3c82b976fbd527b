"""What a diagnosis found, as the document that is written."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from typing import TYPE_CHECKING, cast

import numpy as np

from compare.diagnose.data.recording import Run as Recording
from compare.diagnose.data.units import unit_of
from compare.diagnose.explain import Explanation, Named, left_of
from compare.diagnose.fit import FOLDS, SEGMENTS, Fit
from compare.diagnose.predict import Term
from compare.diagnose.separate import would_separate
from compare.diagnose.words import as_parameter, named, statement, tied
from compare.diagnose.worth import rms
from compare.results.crosscheck import Setting, Simulator
from compare.results.diagnosis import (
    Candidate,
    Channel,
    Closing,
    Diagnosis,
    Effect,
    Elsewhere,
    Engine,
    Located,
    Place,
    Run,
    Status,
    Step,
)
from compare.results.diagnosis import Fault as DataFault
from compare.results.sentences import sentence
from sim_models.engine import installed_version

if TYPE_CHECKING:
    from compare.diagnose.bench import Bench, Confirmed
    from compare.diagnose.confirm import Simulated
    from compare.diagnose.isolate import Screen
    from compare.diagnose.locate import Stretch

INSEPARABLE = 0.999  # cosine between two signatures
LISTED = 40  # pairs


def as_document(bench: Bench, found: Confirmed) -> Diagnosis:
    """Everything found; the command that asked for it is not known here."""
    e = found.explanation
    before, after = _gap(bench, found.before[bench.simulator]), _gap(bench, found.after[bench.simulator])
    gap = (before if before is not None else e.gap[0], after if after is not None else e.gap[1])
    why = found.after[bench.simulator].skipped
    failure = (
        f"{bench.simulator} could not simulate that ({why}): the gap after is the analytic model's." if why else ""
    )
    result = Diagnosis(
        case=bench.mechanism.name,
        verdict=e.verdict,
        statement=statement(e, gap, failure),
        simulator=Simulator(name=bench.simulator, version=found.before[bench.simulator].version),
        command="",
        versions=_versions(found),
        located=tuple(_located(stretch) for stretch in found.stretches),
        effects=_effects(bench, e),
        gap=Closing(before=gap[0], after=gap[1], noise_floor=1.0),
        other_simulators={
            name: Elsewhere(before=_gap(bench, found.before[name]), after=_gap(bench, said))
            for name, said in found.after.items()
            if name != bench.simulator and said.readings is not None
        },
        faults=tuple(
            DataFault(run=f.run, signal=f.signal, kind=f.kind, samples=f.samples, text=f.text)
            for f in bench.measured.faults
        ),
        candidates=_candidates(bench, found),
        inseparable=_inseparable(bench),
        engines=_engines(bench, found),
        runs=tuple(_run(bench, found, r, run) for r, run in enumerate(bench.measured.runs)),
        mechanism=bench.measured.mechanism,
        explained=found.explained,
        steps=(),
    )
    return result.model_copy(update={"steps": _steps(bench, found, result)})


def _located(stretch: Stretch) -> Located:
    return Located(
        run=stretch.run,
        signal=stretch.signal,
        crank_angle_from=stretch.begin,
        crank_angle_to=stretch.end,
        size=stretch.size,
        unit=unit_of(stretch.signal),
        sigmas=stretch.sigmas,
    )


def _gap(bench: Bench, said: Simulated) -> float | None:
    return None if said.readings is None else rms(bench.data.residual(said.readings))


def _effects(bench: Bench, e: Explanation) -> tuple[Effect, ...]:
    noise = {
        (bench.measured.runs[p.run].name, p.signal): float(bench.data.sigma[p.place][0])
        for p in bench.data.parts
        if p.used.size
    }
    return tuple(_effect(bench, e.fit, n, noise) for n in e.named)


def _effect(bench: Bench, fit: Fit, n: Named, noise: dict[tuple[str, str], float]) -> Effect:
    return Effect(
        name=n.term.effect.name,
        where=n.term.where,
        parameters={name: as_parameter(interval) for name, interval in n.parameters.items()},
        gap_before=n.gap[0],
        gap_after=n.gap[1],
        held_out_before=n.held_out[0],
        held_out_after=n.held_out[1],
        ambiguous_with=tuple(Place(name=t.effect.name, where=t.where) for t, _ in n.ties),
        would_separate=(
            would_separate(bench.model, noise, fit, n.ties[0][1]) if n.ties else ""
        ),  # from the first of its rivals
    )


def _candidates(bench: Bench, found: Confirmed) -> tuple[Candidate, ...]:
    """Every effect that was considered, what the data thought of it, and why it was not named."""
    search, e = bench.search, found.explanation
    assert search is not None
    screen = search.screen(search.base)
    chosen = {n.term.key: n for n in e.named}
    tied = {t.key: n for n in e.named for t, _ in n.ties}
    best: dict[tuple[str, str], tuple[float, Term]] = {}
    for i, term in enumerate(screen.terms):
        gain = screen.gain([i])[0]
        if term.key not in best or gain > best[term.key][0]:
            best[term.key] = gain, term
    rows: dict[tuple[str, str], Candidate] = {}
    for term in bench.terms:
        if term.key in rows:
            continue
        status: Status
        remaining, rival, sigmas = None, None, 0.0
        if term.key in bench.ruled_out:
            status, why = "excluded", bench.ruled_out[term.key]
        elif term.key not in best:
            status, why = "invisible", "these sensors and runs do not show it"
        else:
            gain, shown = best[term.key]
            sigmas = math.sqrt(max(gain, 0.0))
            if term.key in chosen:
                rival, remaining = _nearest(bench, chosen[term.key].term, e.fit)
                status, why = "named", named(chosen[term.key])
            elif term.key in tied:
                status, why = "tied", f"explains the data as well as {tied[term.key].term.label}"
            elif _unphysical(screen, shown, bench):
                status, why = "not physical", "it would have to have the wrong sign"
            else:
                status, why = "not needed", "it brings no more than chance" + " once the rest is in" * bool(e.named)
        rows[term.key] = Candidate(
            name=term.effect.name,
            where=term.where,
            sigmas=sigmas,
            remaining=remaining,
            rival=rival,
            status=status,
            why=why,
        )
    return tuple(rows.values())


def _unphysical(screen: Screen, term: Term, bench: Bench) -> bool:
    """Whether the data want a value beyond the physical."""
    start = screen.starts([screen.terms.index(term)])[term]
    low, _ = bench.fitter.bounds(term)
    return start.size == low.size and bool(np.any(start < low - 1e-12 * np.abs(low)))


def _nearest(bench: Bench, term: Term, fit: Fit) -> tuple[str | None, float]:
    """The rival that resembles a named effect most, and the sigmas of its signature that remain beside that rival."""
    i = fit.terms.index(term)
    signature = fit.jacobian[:, fit.columns(i)] @ fit.x[i]
    others = np.delete(fit.jacobian, np.arange(fit.jacobian.shape[1])[fit.columns(i)], axis=1)
    weights = np.ones(signature.size)
    left: dict[str, float] = {}
    assert bench.search is not None
    for rival, s in bench.search.signatures.items():
        if rival.key != term.key and rival not in fit.terms:
            left[rival.label] = min(
                left.get(rival.label, math.inf),
                left_of(signature, np.concatenate([others, s.columns], axis=1), weights),
            )
    if not left:
        return None, left_of(signature, others, weights)
    name = min(left, key=lambda k: (left[k], k))
    return name, left[name]


def _inseparable(bench: Bench) -> tuple[tuple[str, str, float], ...]:
    """Pairs of one-parameter effects whose signatures are the same on these data."""
    assert bench.search is not None
    single = {
        t: s.columns[:, 0] for t, s in bench.search.signatures.items() if s.columns.shape[1] == 1 and not t.variant
    }
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


def _engines(bench: Bench, found: Confirmed) -> tuple[Engine, ...]:
    asked = tuple(
        Engine(
            name=name,
            version=said.version or found.before[name].version,
            agreement=found.agreement[name],
            before=_gap(bench, found.before[name]),
            after=_gap(bench, said),
            skipped=said.skipped,
            added=tuple(said.added),
            settings=_settings(bench, said if said.settings else found.before[name]),
        )
        for name, said in found.after.items()
    )
    absent = tuple(
        Engine(
            name=name,
            version="",
            before=None,
            after=None,
            agreement=None,
            added=(),
            settings={},
            skipped=why,
        )
        for name, why in bench.skipped.items()
    )
    return asked + absent


def _settings(bench: Bench, said: Simulated) -> dict[str, Mapping[str, Setting]]:
    """An engine's own settings, by run."""
    runs = zip(bench.measured.runs, said.settings, strict=False)
    return {run.name: cast(Mapping[str, Setting], found) for run, found in runs}


def _run(bench: Bench, found: Confirmed, r: int, run: Recording) -> Run:
    before, after = found.before[bench.simulator].readings, found.after[bench.simulator].readings
    segment = np.minimum(np.arange(run.time.size) * SEGMENTS // run.time.size, SEGMENTS - 1)
    residual = {
        name: bench.data.residual(side) for name, side in (("before", before), ("after", after)) if side is not None
    }
    absent = np.full(run.time.size, np.nan)
    signals: dict[str, Channel] = {}
    for part in bench.data.parts:
        if part.run != r:
            continue
        channel = run.channels[part.signal]
        signals[part.signal] = Channel(
            unit=unit_of(part.signal),
            noise=float(bench.data.sigma[part.place][0]) if part.used.size else channel.noise,
            noise_given=channel.noise_given,
            measured=channel.values,
            before=before[r][part.signal] if before is not None else absent,
            after=after[r][part.signal] if after is not None else absent,
            gap_before=rms(residual["before"][part.place]) if "before" in residual else None,
            gap_after=rms(residual["after"][part.place]) if "after" in residual else None,
        )
    return Run(
        name=run.name,
        drive=run.drive,
        time=run.time,
        crank_angle=bench.crank_angle(run),
        held_out=tuple(1 if s % FOLDS == 0 else 0 for s in segment),
        signals=signals,
    )


def _versions(found: Confirmed) -> dict[str, str]:
    packages = {name: installed_version(name) or "not installed" for name in ("linkage-crosscheck", "numpy", "scipy")}
    return {
        "python": platform.python_version(),
        **packages,
        **{n: s.version for n, s in found.before.items() if s.version},
    }


def _steps(bench: Bench, found: Confirmed, result: Diagnosis) -> tuple[Step, ...]:
    """The story, step by step."""
    e = found.explanation
    samples = sum(p.used.size for p in bench.data.parts)
    given = sum(c.noise_given for run in bench.measured.runs for c in run.channels.values())
    total = sum(len(run.channels) for run in bench.measured.runs)
    measured = (
        f"{len(bench.measured.runs)} run(s), {total} sensor records, {samples} samples; the noise of {given}"
        f" records is given, of {total - given} estimated from their own scatter.",
        *(_capital(f"{fault.text}.") for fault in result.faults),
    )
    places = tuple(_capital(f"{sentence(result, place)}.") for place in result.located[:8])
    add = tuple(_added(engine) for engine in result.engines)
    return (
        Step(title="Measured data", text=measured),
        Step(title="Locate", text=places or ("No sensor leaves its noise floor anywhere.",)),
        Step(title="Isolate", text=_isolated(bench, found, result)),
        Step(title="Name", text=_named(e, result) or ("No effect earns its place on held-out data.",)),
        Step(title="Add", text=add if e.named else ("Nothing to add.",)),
        Step(title="Result", text=(result.statement,)),
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _isolated(bench: Bench, found: Confirmed, result: Diagnosis) -> tuple[str, ...]:
    visible = sum(c.status not in ("invisible", "excluded") for c in result.candidates)
    considered = (
        f"{len(result.candidates)} effects at their places were considered, {visible} of them would show in"
        f" these data; their signatures come from the analytic model, which agrees with {bench.simulator} on the"
        f" nominal mechanism within {found.agreement_before:.2g} of the noise."
    )
    if not result.inseparable:
        return (considered, *bench.notes)
    pairs = ", ".join(f"{a} and {b}" for a, b, _ in result.inseparable[:5])
    others = " and others" if len(result.inseparable) > 5 else ""
    return (considered, *bench.notes, f"These data cannot tell apart: {pairs}{others}.")


def _named(e: Explanation, result: Diagnosis) -> tuple[str, ...]:
    told = []
    for n, effect in zip(e.named, result.effects, strict=True):
        told.append(
            f"{named(n)} It takes the gap from {n.gap[0]:.3g} to {n.gap[1]:.3g} times the noise, "
            f"on data held out from {n.held_out[0]:.3g} to {n.held_out[1]:.3g}."
        )
        if n.ties:
            told.append(f"As good: {tied(n)}. To tell them apart: {effect.would_separate}")
    return tuple(told)


def _added(engine: Engine) -> str:
    """What the explanation does to the gap of one engine."""
    if engine.before is None or engine.after is None:
        return f"{engine.name}: {engine.skipped}."
    lacking = (
        f"; it has no {', '.join(engine.added)}, and got the difference that the analytic model makes of it"
        if engine.added
        else ""
    )
    return f"{engine.name}: gap {engine.before:.3g} before, {engine.after:.3g} after{lacking}."
