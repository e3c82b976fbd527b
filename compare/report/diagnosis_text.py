"""A diagnosis as text: the short verdict for a terminal, and Markdown that fits a pull request."""

from __future__ import annotations

import re
from collections.abc import Sequence

from analytic.mechanism.one_line import capital
from compare.quantities import DASH, MINUS, SUPERSCRIPT, TIMES, assumptions, plainly
from compare.report.pages import code_block
from compare.report.pages import escape_markdown as md
from compare.report.words import proposals
from compare.report.words.diagnosis import (
    GAP,
    HELD_OUT,
    SIGMA,
    SIGMA_MEANS,
    TIE,
    advice,
    attempts,
    next_steps,
    percent,
    settings,
    simulated_by,
    ties,
    waterfall,
)
from compare.report.words.effects import (
    errors_in_words,
    headline,
    of_effect,
    of_runs,
    phrase,
    quantity,
    rival_odds,
    rival_words,
    small_errors,
    spoken,
    values_of,
)
from compare.report.words.located import located, worst_first
from compare.report.words.measured import NOISE, in_units, off, off_by, validation_sentences
from compare.results.diagnosis import Diagnosis, Effect, Place, Side

SIGNS = {"no gap": "✓", "explained": "✓", "partly explained": "≈", "ambiguous": "?", "unexplained": "✗"}
PLACES_SHOWN = 3  # in a terminal
PLACES_LISTED = 12  # in the Markdown
ATTEMPTS_SHOWN = 3  # in a terminal
NOTHING_TRIED = "Nothing else that was tried takes away a part of the gap that would be worth listing."
SIDES: tuple[Side, ...] = ("before", "after")
ASCII = {MINUS: "-", DASH: "-", "·": ".", "µ": "u", SIGMA: "sigma"} | {
    chr(small): chr(plain) for plain, small in SUPERSCRIPT.items()
}


def terminal_lines(result: Diagnosis) -> list[str]:
    """The verdict in a few lines: what is missing and how much, the gap, where it shows; ASCII but for names and given
    texts.
    """
    settled = result.effects  # whose lines say what the statement says
    out = [f"{result.case}: {result.verdict.upper()}" + ("" if settled else f". {_line(result.statement)}")]
    for group in ties(result):
        out += _effect_lines(result, group)
    gap = result.gap
    out.append(
        f"gap: {plainly(gap.before)} before, {plainly(gap.after)} after, noise floor {plainly(gap.noise_floor)}"
        f" ({simulated_by(result)})"
    )
    others = [
        f"{name} {plainly(g.before)} before, {plainly(g.after)} after" for name, g in result.other_simulators.items()
    ]
    out += [f"gap elsewhere: {'; '.join(others)}"] if others else []
    out += validation_sentences(result)
    out += _tried(result)
    for p in result.proposed:
        out.append(f"proposed ({'adopted' if p.adopted else 'not named'}): {' '.join(proposals.sentences(result, p))}")
    places = worst_first(result)
    lead = "where, before" if settled else "where"  # it is the nominal model that is off there
    out += [f"{lead}: {located(result, place)} ({plainly(place.sigmas)} sigma)" for place in places[:PLACES_SHOWN]]
    out += [f"{lead}: {_others(len(places) - PLACES_SHOWN)}"] if len(places) > PLACES_SHOWN else []
    out += [f"noise: {_line(note)}" for note in result.notes if note.startswith(NOISE)]
    out += [f"data: run {fault.run}, {spoken(result, fault.signal)}: {_line(fault.text)}" for fault in result.faults]
    return [in_ascii(line) for line in out]


def _effect_lines(result: Diagnosis, group: Sequence[Place]) -> list[str]:
    out = []
    for i, effect in enumerate(group):
        lead = "missing" if len(group) == 1 else "either" if i == 0 else "or"
        own = of_runs(result, effect)
        values = ", ".join(values_of(result, effect, intervals=True))
        said = headline(result, effect) if own else phrase(result, effect.name, effect.where)
        odds = rival_odds(result, group, effect)
        tail = [f", {values}"] if values and not own else [f" (odds {odds})"] if i and odds else []
        out.append(f"{lead}: {said}" + "".join(tail))
    small = errors_in_words(result, group[0]) if isinstance(group[0], Effect) else ""
    out += [f"or small errors of the rig together: {small}"] if small else []
    if len(group) > 1:
        words, block = advice(group)
        out.append(
            f"to separate them: {words.rstrip(':') or 'no run of these sensors can'}"
            + (" (as a [[run]] in diagnosis.md)" if block else "")
        )
    return out


def _tried(result: Diagnosis) -> list[str]:
    """The best of what was tried and is not named, where something remains."""
    if result.verdict not in ("partly explained", "unexplained"):
        return []
    return [
        f"tried: {what}, {values}: {share or 'no known share'} of the gap; not named: {_line(failed)}"
        for what, values, share, _, failed in attempts(result)[:ATTEMPTS_SHOWN]
    ]


def _others(count: int) -> str:
    return f"and in {count} other place{'s' if count > 1 else ''}"


def _line(words: str) -> str:
    return re.sub(r"\s+", " ", words).strip()


def in_ascii(words: str) -> str:
    """Words for a terminal: the signs of :data:`ASCII` written out."""
    return "".join(ASCII.get(character, character) for character in words.replace(f"{TIMES}10", "e"))


def diagnosis_md(result: Diagnosis) -> str:
    """The text of diagnosis.md."""
    gap = result.gap
    shrinks = f"{plainly(gap.before)} before → {plainly(gap.after)} after (noise floor {plainly(gap.noise_floor)})"
    out = [
        f"# {SIGNS[result.verdict]} Diagnosis of {md(result.case)}: {result.verdict}",
        "",
        md(result.statement),
        "",
    ]
    out += [f"- Gap: {shrinks}, simulated by {md(simulated_by(result))}. {md(GAP)}"]
    out += [
        f"- In {md(name)}: {plainly(g.before)} before → {plainly(g.after)} after"
        for name, g in result.other_simulators.items()
    ]
    out += [f"- {md(said)}" for said in validation_sentences(result)]
    out += [
        "",
        *_shares(result),
        *_effects(result),
        *_attempts(result),
        *_proposed(result),
        *_next(result),
        *_located(result),
    ]
    out += [*_in_units(result), *_gaps(result)]
    if result.faults:
        rows = [
            [md(f.run), md(spoken(result, f.signal)), md(f.kind), str(f.samples), md(f.text)] for f in result.faults
        ]
        out += ["## Data faults", "", *_table(["Run", "Signal", "Kind", "Samples", "What"], rows, (3,))]
    if result.notes:
        out += ["## Notes", "", *(f"- {md(note)}" for note in result.notes), ""]
    versions = ", ".join(f"{md(name)} {md(version)}" for name, version in result.versions.items())
    out += ["## Provenance", "", code_block(result.command, "sh"), "", f"Versions: {versions}", ""]
    rows = [[md(cell) for cell in row] for row in settings(result)]
    out += _table(["Engine", "Setting", "Value (SI)"], rows, ()) if rows else []
    taken = [f"- {md(line)}" for line in assumptions(result.assumed)]
    out += ["Left out where linkage and runs are described, and assumed:", "", *taken, ""] if taken else []
    return "\n".join(out)


def _shares(result: Diagnosis) -> list[str]:
    """The waterfall as a table."""
    bars = waterfall(result)
    if not bars:
        return []
    rows = [[md(capital(bar.label)), percent(bar.share / 100)] for bar in bars]
    return ["## What takes the gap away", "", *_table(["Step", "Share of the squared gap"], rows, (1,))]


def _effects(result: Diagnosis) -> list[str]:
    if not result.effects:
        return []
    rows, told = [], []
    for group in ties(result):
        for i, effect in enumerate(group):
            others = md(rival_words(result, group, effect)) if i else _rivals(result, group)
            own = of_runs(result, effect)
            told += [capital(md(f"{headline(result, effect)}.")), ""] if own else []
            what = phrase(result, effect.name, effect.where)
            kind = DASH if not isinstance(effect, Effect) else effect.kind
            rows += [
                [md(cell) for cell in (what, kind, *row, _shrinks(effect))] + [others] for row in _parameters(effect)
            ]
    head = ["Effect", "Kind", "Parameter", "Value", "95 % interval", "Gap on held-out data", "As good as"]
    tie = [TIE, ""] if any(len(group) > 1 for group in ties(result)) else []
    small = [md(text) for effect in result.effects if (text := small_errors(result, effect))]
    small = [line for text in small for line in (text, "")]
    return ["## What is missing", "", *told, *_table(head, rows, (3, 4)), HELD_OUT, "", *tie, *small]


def _rivals(result: Diagnosis, group: Sequence[Place]) -> str:
    return md(", ".join(phrase(result, other.name, other.where) for other in group[1:])) or DASH


def _parameters(effect: Place) -> list[tuple[str, str, str]]:
    return of_effect(effect) or [(DASH, DASH, DASH)]


def _shrinks(effect: Place) -> str:
    if not isinstance(effect, Effect):
        return DASH
    before, after = effect.held_out_before, effect.held_out_after
    return DASH if before is None or after is None else f"{plainly(before)} → {plainly(after)}"


def _attempts(result: Diagnosis) -> list[str]:
    """What was tried and is not named; always there where the verdict leaves a question."""
    tried = attempts(result)
    if result.settled and not tried:
        return []
    rows = [[str(i), *map(md, row)] for i, row in enumerate(tried, 1)]
    head = ["", "Effect", "Values", "Share of the squared gap", "Gap without → with", "Not named because"]
    return ["## The best attempts", "", *(_table(head, rows, (0, 3)) if rows else [NOTHING_TRIED, ""])]


def _proposed(result: Diagnosis) -> list[str]:
    if not result.proposed:
        return []
    heading, meaning = proposals.heading(result)
    out = [f"## {heading}", "", meaning, ""]
    for p in result.proposed:
        rows = [[md(cell) for cell in row] for row in proposals.numbers(p)]
        out += [md(" ".join(proposals.sentences(result, p))), ""]
        out += _table(["Number", "Value", "95 % interval"], rows, (1, 2)) if rows else []
    return out


def _next(result: Diagnosis) -> list[str]:
    out = ["## What to do next", "", *(f"- {md(step)}" for step in next_steps(result)), ""]
    for group in ties(result):
        block = advice(group)[1]
        out += [code_block(block, "toml"), ""] if block else []
    return out


def _located(result: Diagnosis) -> list[str]:
    places = worst_first(result)
    if not places:
        return []
    out = ["## Where simulation and measurement disagree", ""]
    out += [
        f"- {md(capital(located(result, place)))} ({plainly(place.sigmas)} {SIGMA})" for place in places[:PLACES_LISTED]
    ]
    out += [f"- {_others(len(places) - PLACES_LISTED)} (diagnosis.html)"] if len(places) > PLACES_LISTED else []
    return [*out, ""]


def _in_units(result: Diagnosis) -> list[str]:
    """How far each sensor is off in its own unit."""
    rows = []
    for sensor in in_units(result):
        sides = [off_by(result, sensor.signal, v) for v in (sensor.before, sensor.after)]
        share = sensor.share()
        rows.append(
            [
                md(quantity(result, sensor.signal).title),
                *sides,
                DASH if share is None else f"{plainly(100 * share, 2)} %",
            ]
        )
    head = ["Signal", "Off before (rms)", "Off after (rms)", "Of its range"]
    return ["## How far each sensor is off", "", *_table(head, rows, (1, 2, 3))] if rows else []


def _gaps(result: Diagnosis) -> list[str]:
    rows = []
    for run in result.runs:
        for name, signal in run.signals.items():
            noise = off_by(result, name, signal.noise) + ("" if signal.noise_given else ", estimated")
            sides = [off_by(result, name, off(result, run, name, side)) for side in SIDES]
            rows.append(
                [
                    md(run.name + " (validation)" * (run.role == "validation")),
                    md(quantity(result, name).title),
                    noise,
                    *sides,
                    plainly(signal.gap_before),
                    plainly(signal.gap_after),
                ]
            )
    free = (
        " Runs without a commanded speed are compared over time." if any(run.over_time for run in result.runs) else ""
    )
    head = ["Run", "Signal", f"Noise (1 {SIGMA})", "Off before (rms)", "Off after (rms)", "Gap before", "Gap after"]
    intro = f"A gap of 1 is the noise floor. {SIGMA_MEANS}{free}"
    return ["## Gap per run and signal", "", intro, "", *_table(head, rows, (3, 4, 5, 6))]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[int]) -> list[str]:
    rule = ["--:" if i in right else "---" for i in range(len(head))]
    return [*("| " + " | ".join(cells) + " |" for cells in (head, rule, *rows)), ""]
