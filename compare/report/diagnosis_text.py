"""A diagnosis as text: the short verdict for a terminal, and Markdown that fits a pull request."""

from __future__ import annotations

import re
from collections.abc import Sequence

from compare.quantities import DASH, MINUS, SUPERSCRIPT, TIMES, amount, number
from compare.report.diagnosis_words import SIGMA, advice, next_steps, phrase, settings, simulated_by, ties, worst_first
from compare.report.pages import code_block
from compare.report.pages import escape_markdown as md
from compare.results.diagnosis import Diagnosis, Effect, Place
from compare.results.sentences import parameter, quantity, sentence, spoken

SIGNS = {"no gap": "✓", "explained": "✓", "partly explained": "≈", "ambiguous": "?", "unexplained": "✗"}
PLACES_SHOWN = 3  # in a terminal
PLACES_LISTED = 12  # in the Markdown
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
        f"gap: {number(gap.before)} before, {number(gap.after)} after, noise floor {number(gap.noise_floor)}"
        f" ({simulated_by(result)})"
    )
    others = [
        f"{name} {number(g.before)} before, {number(g.after)} after" for name, g in result.other_simulators.items()
    ]
    out += [f"gap elsewhere: {'; '.join(others)}"] if others else []
    places = worst_first(result)
    out += [f"where: {sentence(result, place)} ({number(place.sigmas)} sigma)" for place in places[:PLACES_SHOWN]]
    out += [f"where: {_others(len(places) - PLACES_SHOWN)}"] if len(places) > PLACES_SHOWN else []
    out += [f"data: run {fault.run}, {spoken(result, fault.signal)}: {_line(fault.text)}" for fault in result.faults]
    return [in_ascii(line) for line in out]


def _effect_lines(result: Diagnosis, group: Sequence[Place]) -> list[str]:
    out = []
    for i, effect in enumerate(group):
        rows = of_effect(effect)
        values = ", ".join(f"{name} {value} (95 %: {interval})" for name, value, interval in rows)
        lead = "missing" if len(group) == 1 else "either" if i == 0 else "or"
        out.append(f"{lead}: {phrase(result, effect.name, effect.where)}" + (f", {values}" if values else ""))
    if len(group) > 1:
        words, block = advice(group)
        out.append(
            f"to separate them: {words.rstrip(':') or 'no run of these sensors can'}"
            + (" (as a [[run]] in diagnosis.md)" if block else "")
        )
    return out


def of_effect(effect: Place) -> list[tuple[str, str, str]]:
    """Name, value and interval of each parameter; nothing for an effect that is only tied."""
    return [parameter(*item) for item in effect.parameters.items()] if isinstance(effect, Effect) else []


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
    shrinks = f"{number(gap.before)} before → {number(gap.after)} after (noise floor {number(gap.noise_floor)})"
    out = [
        f"# {SIGNS[result.verdict]} Diagnosis of {md(result.case)}: {result.verdict}",
        "",
        md(result.statement),
        "",
    ]
    out += [f"- Gap (rms of residual over noise): {shrinks}, simulated by {md(simulated_by(result))}"]
    out += [
        f"- In {md(name)}: {number(g.before)} before → {number(g.after)} after"
        for name, g in result.other_simulators.items()
    ]
    out += ["", *_effects(result), *_next(result), *_located(result), *_gaps(result)]
    if result.faults:
        rows = [
            [md(f.run), md(spoken(result, f.signal)), md(f.kind), str(f.samples), md(f.text)] for f in result.faults
        ]
        out += ["## Data faults", "", *_table(["Run", "Signal", "Kind", "Samples", "What"], rows, (3,))]
    versions = ", ".join(f"{md(name)} {md(version)}" for name, version in result.versions.items())
    out += ["## Provenance", "", code_block(result.command, "sh"), "", f"Versions: {versions}", ""]
    rows = [[md(cell) for cell in row] for row in settings(result)]
    out += _table(["Engine", "Setting", "Value (SI)"], rows, ()) if rows else []
    return "\n".join(out)


def _effects(result: Diagnosis) -> list[str]:
    if not result.effects:
        return []
    rows = []
    for group in ties(result):
        rivals = [phrase(result, effect.name, effect.where) for effect in group]
        for i, effect in enumerate(group):
            others = ", ".join(name for k, name in enumerate(rivals) if k != i) if len(group) > 1 else DASH
            rows += [[md(cell) for cell in (rivals[i], *row, _shrinks(effect), others)] for row in _parameters(effect)]
    head = ["Effect", "Parameter", "Value", "95 % interval", "Gap on held-out data", "As good as"]
    return ["## What is missing", "", *_table(head, rows, (2, 3))]


def _parameters(effect: Place) -> list[tuple[str, str, str]]:
    return of_effect(effect) or [(DASH, DASH, DASH)]


def _shrinks(effect: Place) -> str:
    if not isinstance(effect, Effect):
        return DASH
    before, after = effect.held_out_before, effect.held_out_after
    return DASH if before is None or after is None else f"{number(before)} → {number(after)}"


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
    out += [f"- {md(sentence(result, place))} ({number(place.sigmas)} {SIGMA})" for place in places[:PLACES_LISTED]]
    out += [f"- {_others(len(places) - PLACES_LISTED)} (diagnosis.html)"] if len(places) > PLACES_LISTED else []
    return [*out, ""]


def _gaps(result: Diagnosis) -> list[str]:
    rows = []
    for run in result.runs:
        for name, signal in run.signals.items():
            noise = amount(signal.noise, signal.unit) + ("" if signal.noise_given else ", estimated")
            rows.append(
                [
                    md(run.name),
                    md(quantity(result, name).title),
                    noise,
                    number(signal.gap_before),
                    number(signal.gap_after),
                ]
            )
    free = (
        " Runs without a commanded speed are compared over time." if any(run.over_time for run in result.runs) else ""
    )
    head = ["Run", "Signal", f"Noise (1 {SIGMA})", "Gap before", "Gap after"]
    return ["## Gap per run and signal", "", f"1 is the noise floor.{free}", "", *_table(head, rows, (3, 4))]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[int]) -> list[str]:
    rule = ["--:" if i in right else "---" for i in range(len(head))]
    return [*("| " + " | ".join(cells) + " |" for cells in (head, rule, *rows)), ""]
