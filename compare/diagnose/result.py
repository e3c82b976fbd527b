"""The content of diagnosis.json (schemas/diagnosis.json)."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from compare.diagnose.data.recording import Run
from compare.diagnose.data.units import unit_of
from compare.diagnose.explain import Named, left_of
from compare.diagnose.fit import FOLDS, SEGMENTS, Fit
from compare.diagnose.predict import Term
from compare.diagnose.separate import would_separate
from compare.diagnose.words import finite, named, statement, tied
from compare.diagnose.worth import rms
from compare.report.diagnosis_words import sentence
from sim_models.engine import installed_version

if TYPE_CHECKING:
    from compare.diagnose.bench import Bench, Confirmed
    from compare.diagnose.confirm import Simulated

SCHEMA = 1
INSEPARABLE = 0.999  # cosine between two signatures
LISTED = 40  # pairs


def as_result(bench: Bench, found: Confirmed, command: str) -> dict[str, Any]:
    """Everything found, as plain data."""
    e = found.explanation
    before, after = _gap(bench, found.before[bench.simulator]), _gap(bench, found.after[bench.simulator])
    gap = (before if before is not None else e.gap[0], after if after is not None else e.gap[1])
    why = found.after[bench.simulator].skipped
    failure = (
        f"{bench.simulator} could not simulate that ({why}): the gap after is the analytic model's." if why else ""
    )
    noise = {
        (bench.measured.runs[p.run].name, p.signal): float(bench.data.sigma[p.place][0])
        for p in bench.data.parts
        if p.used.size
    }
    effects = [_effect(bench, e.fit, n, noise) for n in e.named]
    result: dict[str, Any] = {
        "schema": SCHEMA,
        "case": bench.mechanism.name,
        "verdict": e.verdict,
        "statement": statement(e, gap, failure),
        "simulator": {"name": bench.simulator, "version": found.before[bench.simulator].version},
        "command": command,
        "versions": _versions(found),
        "located": [
            {
                "run": s.run,
                "signal": s.signal,
                "crank_angle_from": s.begin,
                "crank_angle_to": s.end,
                "size": s.size,
                "unit": unit_of(s.signal),
                "sigmas": s.sigmas,
            }
            for s in found.stretches
        ],
        "effects": effects,
        "gap": {"before": gap[0], "after": gap[1], "noise_floor": 1.0},
        "other_simulators": {
            name: {"before": _gap(bench, found.before[name]), "after": _gap(bench, said)}
            for name, said in found.after.items()
            if name != bench.simulator and said.readings is not None
        },
        "faults": [
            {"run": f.run, "signal": f.signal, "kind": f.kind, "samples": f.samples, "text": f.text}
            for f in bench.measured.faults
        ],
        "candidates": _candidates(bench, found),
        "inseparable": _inseparable(bench),
        "engines": _engines(bench, found),
        "runs": [_run(bench, found, r, run) for r, run in enumerate(bench.measured.runs)],
        "mechanism": _plain(bench.measured.mechanism),
        "explained": _plain(found.explained),
    }
    result["steps"] = _steps(bench, found, result)
    return result


def _plain(mechanism: Any) -> dict[str, Any]:
    return mechanism.model_dump(by_alias=True, exclude_none=True, exclude_unset=True, mode="json")


def _gap(bench: Bench, said: Any) -> float | None:
    return None if said.readings is None else rms(bench.data.residual(said.readings))


def _effect(bench: Bench, fit: Fit, n: Named, noise: dict[tuple[str, str], float]) -> dict[str, Any]:
    return {
        "name": n.term.effect.name,
        "where": n.term.where,
        "parameters": {
            p: {"value": i.value, "unit": i.unit, "low": finite(i.low), "high": finite(i.high)}
            for p, i in n.parameters.items()
        },
        "gap_before": n.gap[0],
        "gap_after": n.gap[1],
        "held_out_before": n.held_out[0],
        "held_out_after": n.held_out[1],
        "ambiguous_with": [{"name": t.effect.name, "where": t.where} for t, _ in n.ties],
        "would_separate": (
            would_separate(bench.model, noise, fit, n.ties[0][1]) if n.ties else ""
        ),  # from the first of its rivals
    }


def _candidates(bench: Bench, found: Confirmed) -> list[dict[str, Any]]:
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
    rows: list[dict[str, Any]] = []
    for term in bench.terms:
        if any(r["name"] == term.effect.name and r["where"] == term.where for r in rows):
            continue
        row: dict[str, Any] = {
            "name": term.effect.name,
            "where": term.where,
            "sigmas": 0.0,
            "remaining": None,
            "rival": None,
        }
        if term.key in bench.ruled_out:
            row |= {"status": "excluded", "why": bench.ruled_out[term.key]}
        elif term.key not in best:
            row |= {"status": "invisible", "why": "these sensors and runs do not show it"}
        else:
            gain, shown = best[term.key]
            row["sigmas"] = math.sqrt(max(gain, 0.0))
            if term.key in chosen:
                rival, left = _nearest(bench, chosen[term.key].term, e.fit)
                row |= {"status": "named", "why": named(chosen[term.key]), "remaining": left, "rival": rival}
            elif term.key in tied:
                row |= {"status": "tied", "why": f"explains the data as well as {tied[term.key].term.label}"}
            elif _unphysical(screen, shown, bench):
                row |= {"status": "not physical", "why": "it would have to have the wrong sign"}
            else:
                row |= {
                    "status": "not needed",
                    "why": "it brings no more than chance" + " once the rest is in" * bool(e.named),
                }
        rows.append(row)
    return rows


def _unphysical(screen: Any, term: Term, bench: Bench) -> bool:
    """Whether the data want a value beyond the physical."""
    start = screen.starts([screen.terms.index(term)])[term]
    low, _ = bench.fitter.bounds(term)
    return start.size == low.size and bool(np.any(start < low - 1e-12 * np.abs(low)))


def _nearest(bench: Bench, term: Term, fit: Any) -> tuple[str | None, float]:
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


def _inseparable(bench: Bench) -> list[list[Any]]:
    """Pairs of one-parameter effects whose signatures are the same on these data."""
    assert bench.search is not None
    single = {
        t: s.columns[:, 0] for t, s in bench.search.signatures.items() if s.columns.shape[1] == 1 and not t.variant
    }
    terms = list(single)
    if not terms:
        return []
    columns = np.column_stack([single[t] / max(float(np.linalg.norm(single[t])), 1e-300) for t in terms])
    cosine = columns.T @ columns
    pairs = [
        (abs(float(cosine[i, j])), i, j) for i in range(len(terms)) for j in range(i) if abs(cosine[i, j]) > INSEPARABLE
    ]
    return [
        [terms[j].label, terms[i].label, float(cosine[i, j])]
        for _, i, j in sorted(pairs, key=lambda p: (-p[0], p[1], p[2]))[:LISTED]
    ]


def _engines(bench: Bench, found: Confirmed) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = [
        {
            "name": name,
            "version": said.version or found.before[name].version,
            "agreement": finite(found.agreement[name]),
            "before": _gap(bench, found.before[name]),
            "after": _gap(bench, said),
            "skipped": said.skipped,
            "added": list(said.added),
            "settings": _settings(bench, said if said.settings else found.before[name]),
        }
        for name, said in found.after.items()
    ]
    nothing: dict[str, Any] = {
        "version": "",
        "before": None,
        "after": None,
        "agreement": None,
        "added": [],
        "settings": {},
    }
    return rows + [{"name": name, **nothing, "skipped": why} for name, why in bench.skipped.items()]


def _settings(bench: Bench, said: Simulated) -> dict[str, dict[str, Any]]:
    """An engine's own settings, by run."""
    return {run.name: dict(found) for run, found in zip(bench.measured.runs, said.settings, strict=False)}


def _run(bench: Bench, found: Confirmed, r: int, run: Run) -> dict[str, Any]:
    before, after = found.before[bench.simulator].readings, found.after[bench.simulator].readings
    segment = np.minimum(np.arange(run.time.size) * SEGMENTS // run.time.size, SEGMENTS - 1)
    residual = {
        name: bench.data.residual(side) for name, side in (("before", before), ("after", after)) if side is not None
    }
    signals: dict[str, Any] = {}
    for part in bench.data.parts:
        if part.run != r:
            continue
        channel = run.channels[part.signal]
        signals[part.signal] = {
            "unit": unit_of(part.signal),
            "noise": float(bench.data.sigma[part.place][0]) if part.used.size else channel.noise,
            "noise_given": channel.noise_given,
            "measured": _nulls(channel.values),
            "before": _nulls(before[r][part.signal]) if before is not None else [None] * run.time.size,
            "after": _nulls(after[r][part.signal]) if after is not None else [None] * run.time.size,
            "gap_before": rms(residual["before"][part.place]) if "before" in residual else None,
            "gap_after": rms(residual["after"][part.place]) if "after" in residual else None,
        }
    return {
        "name": run.name,
        "drive": run.drive,
        "time": [float(t) for t in run.time],
        "crank_angle": [float(a) for a in bench.crank_angle(run)],
        "held_out": [int(s % FOLDS == 0) for s in segment],
        "signals": signals,
    }


def _nulls(values: np.ndarray) -> list[float | None]:
    return [float(v) if math.isfinite(v) else None for v in values]


def _versions(found: Confirmed) -> dict[str, str]:
    packages = {name: installed_version(name) or "not installed" for name in ("linkage-crosscheck", "numpy", "scipy")}
    return {
        "python": platform.python_version(),
        **packages,
        **{n: s.version for n, s in found.before.items() if s.version},
    }


def _steps(bench: Bench, found: Confirmed, result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The story, step by step."""
    e = found.explanation
    samples = sum(p.used.size for p in bench.data.parts)
    given = sum(c.noise_given for run in bench.measured.runs for c in run.channels.values())
    total = sum(len(run.channels) for run in bench.measured.runs)
    measured = [
        (
            f"{len(bench.measured.runs)} run(s), {total} sensor records, {samples} samples; the noise of {given}"
            f" records is given, of {total - given} estimated from their own scatter."
        ),
        *(f["text"][:1].upper() + f["text"][1:] + "." for f in result["faults"]),
    ]
    places = [sentence(result, place) for place in result["located"][:8]]
    located = [f"{text[:1].upper()}{text[1:]}." for text in places] or ["No sensor leaves its noise floor anywhere."]
    visible = sum(c["status"] not in ("invisible", "excluded") for c in result["candidates"])
    isolated = [
        (
            f"{len(result['candidates'])} effects at their places were considered, {visible} of them would show in"
            f" these data; their signatures come from the analytic model, which agrees with {bench.simulator} on the"
            f" nominal mechanism within {found.agreement_before:.2g} of the noise."
        ),
        *bench.notes,
    ]
    if result["inseparable"]:
        pairs = ", ".join(f"{a} and {b}" for a, b, _ in result["inseparable"][:5])
        isolated.append(
            f"These data cannot tell apart: {pairs}{' and others' if len(result['inseparable']) > 5 else ''}."
        )
    name = []
    for n, effect in zip(e.named, result["effects"], strict=True):
        name.append(
            f"{named(n)} It takes the gap from {n.gap[0]:.3g} to {n.gap[1]:.3g} times the noise, "
            f"on data held out from {n.held_out[0]:.3g} to {n.held_out[1]:.3g}."
        )
        if n.ties:
            name.append(f"As good: {tied(n)}. To tell them apart: {effect['would_separate']}")
    add = [_added(row) for row in result["engines"]]
    return [
        {"title": "Measured data", "text": measured},
        {"title": "Locate", "text": located},
        {"title": "Isolate", "text": isolated},
        {"title": "Name", "text": name or ["No effect earns its place on held-out data."]},
        {"title": "Add", "text": add if e.named else ["Nothing to add."]},
        {"title": "Result", "text": [result["statement"]]},
    ]


def _added(row: Mapping[str, Any]) -> str:
    """What the explanation does to the gap of one engine."""
    if row["before"] is None or row["after"] is None:
        return f"{row['name']}: {row['skipped']}."
    lacking = (
        f"; it has no {', '.join(row['added'])}, and got the difference that the analytic model makes of it"
        if row["added"]
        else ""
    )
    return f"{row['name']}: gap {row['before']:.3g} before, {row['after']:.3g} after{lacking}."
