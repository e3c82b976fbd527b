"""A diagnosis as a terminal shows it: the verdict in a few lines."""

from __future__ import annotations

import re
from collections.abc import Sequence

from compare.quantities import DASH, MINUS, SUPERSCRIPT, TIMES, plainly
from compare.report.words import proposals
from compare.report.words.diagnosis import (
    SIGMA,
    advice,
    attempts,
    others,
    simulated_by,
    ties,
)
from compare.report.words.effects import (
    headline,
    how_sure,
    own_values,
    phrase,
    rival_odds,
    spoken,
    values_of,
)
from compare.report.words.located import located, worst_first
from compare.report.words.measured import NOISE, validation_sentences
from compare.results.diagnosis import Diagnosis, EffectPlace

PLACES_SHOWN = 3  # in a terminal
ATTEMPTS_SHOWN = 3  # in a terminal
ASCII_SIGNS = {MINUS: "-", DASH: "-", "·": ".", "µ": "u", "±": "+-", SIGMA: "sigma"} | {
    chr(small): chr(plain) for plain, small in SUPERSCRIPT.items()
}


def terminal_lines(result: Diagnosis) -> list[str]:
    """The verdict in a few lines: what is missing and how much, the gap, where it shows; ASCII but for names and given
    texts.
    """
    settled = result.effects  # whose lines say what the statement says
    out = [f"{result.case}: {result.verdict.upper()}" + ("" if settled else f". {_line(result.statement)}")]
    out += [result.context.says] if result.context is not None else []
    for group in ties(result):
        out += _effect_lines(result, group)
    gap = result.gap
    out.append(
        f"gap: {plainly(gap.before)} before, {plainly(gap.after)} after, noise floor {plainly(gap.noise_floor)}"
        f" ({simulated_by(result)})"
    )
    elsewhere = [
        f"{name} {plainly(g.before)} before, {plainly(g.after)} after" for name, g in result.other_simulators.items()
    ]
    out += [f"gap elsewhere: {'; '.join(elsewhere)}"] if elsewhere else []
    out += validation_sentences(result)
    out += _tried(result)
    for p in result.proposed:
        out.append(f"proposed ({'adopted' if p.adopted else 'not named'}): {' '.join(proposals.sentences(result, p))}")
    places = worst_first(result)
    lead = "where, before" if settled else "where"  # it is the nominal model that is off there
    out += [f"{lead}: {located(result, place)} ({plainly(place.sigmas)} sigma)" for place in places[:PLACES_SHOWN]]
    out += [f"{lead}: {others(len(places) - PLACES_SHOWN)}"] if len(places) > PLACES_SHOWN else []
    out += [f"noise: {_line(note)}" for note in result.notes if note.startswith(NOISE)]
    out += [f"data: run {fault.run}, {spoken(result, fault.signal)}: {_line(fault.text)}" for fault in result.faults]
    return [in_ascii(line) for line in out]


def _effect_lines(result: Diagnosis, group: Sequence[EffectPlace]) -> list[str]:
    out = []
    for i, effect in enumerate(group):
        lead = "missing" if len(group) == 1 else "either" if i == 0 else "or"
        own = own_values(result, effect)
        values = ", ".join(values_of(result, effect, intervals=True))
        said = headline(result, effect) if own else phrase(result, effect.name, effect.where)
        odds = rival_odds(result, group, effect)
        tail = [f", {values}"] if values and not own else [f" (odds {odds})"] if i and odds else []
        tail += [f"; {sure.rstrip('.').lower()}"] if (sure := how_sure(effect)) else []
        out.append(f"{lead}: {said}" + "".join(tail))
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


def _line(words: str) -> str:
    return re.sub(r"\s+", " ", words).strip()


def in_ascii(words: str) -> str:
    """Words for a terminal: the signs of :data:`ASCII` written out."""
    return "".join(ASCII_SIGNS.get(character, character) for character in words.replace(f"{TIMES}10", "e"))
