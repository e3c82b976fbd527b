"""What a diagnosis says, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.explain import Explanation, Interval, Named
from compare.diagnose.predict import Term
from compare.results.diagnosis import Diagnosis, Parameter
from compare.results.sentences import (
    amounts,
    called,
    capital,
    enumerated,
    explained_to,
    in_words,
    own_values,
    plainly,
    small_errors,
    spoken,
)

MANY = 4  # effects in a paragraph
SLIGHT = 0.01  # of the squared gap: with a smaller share, an effect among many is told without its values


def named(result: Diagnosis, n: Named) -> str:
    """A named effect in a sentence, its parameters with their 95 % intervals; values of each run by their range."""
    parameters = {name: as_parameter(interval) for name, interval in n.parameters.items()}
    own = own_values(result, n.term.effect.name, n.term.where, parameters)
    if own is not None:
        text = capital(f"{own.sentence(len(result.fitted))}.")
        kept = enumerated([run.name for run in result.validation])
        return f"{text} It was not applied to {kept}, for which it has no value." if kept else text
    values = amounts(result, n.term.effect, n.term.where, parameters, intervals=True)
    return capital(f"{n.term.effect.tells(_place(result, n.term), values)}.")


def meaning(result: Diagnosis, term: Term) -> str:
    """What an effect at its place means: ``joint B has clearance``; one outside the vocabulary says it itself."""
    return term.effect.says(_place(result, term))


def _place(result: Diagnosis, term: Term) -> str:
    """Where an effect is, as its sentences say it."""
    ours = term.effect.name in VOCABULARY and term.effect.place == "signal"
    return spoken(result, term.where) if ours else term.where


def tied(result: Diagnosis, n: Named) -> str:
    """What explains the data as well as a named effect, in words."""
    return "; or ".join(meaning(result, t) for t, _ in n.ties)


def as_parameter(interval: Interval) -> Parameter:
    """A parameter as the document has it; an open end of its interval is no number."""
    return Parameter(value=interval.value, unit=interval.unit, low=interval.low, high=interval.high)


def statement(result: Diagnosis, e: Explanation, failure: str = "") -> str:
    """The verdict in a paragraph; ``failure`` says why the simulator could not confirm it."""
    before, after = result.gap.before, result.gap.after
    measure = f"Measured and simulated differ by {plainly(before)} times the noise before and {plainly(after)} after."
    if e.statistics is not None:
        measure = (
            f"This is known {e.statistics.says()}: those of measurement and simulation are {plainly(before)} times as"
            f" far apart as of two recordings of one rig before, and {plainly(after)} times after."
        )
    if e.verdict == "no gap":
        agree = f"Simulation and measurement agree within the noise: they differ by {plainly(before)} times the noise."
        return f"{agree} Nothing is missing that these data could show."
    if e.verdict == "unexplained":
        disagree = f"Simulation and measurement disagree: they differ by {plainly(before)} times the noise."
        nothing = "No effect that is known here explains that; the best attempts are listed with what they failed."
        return " ".join(part for part in (disagree, explained_to(result, "before"), nothing) if part)
    told, slight = parted(e.named)
    what = " ".join([*(named(result, n) for n in told), *([_slight(result, slight)] if slight else [])])
    if e.verdict in ("explained", "ambiguous"):
        ties = " ".join(
            f"These data would be explained as well if {tied(result, n)} (instead of {called(result, n.term.label)})."
            for n in told
            if n.ties
        )
        of = {n.term.key for n in told}
        small = [small_errors(result, effect) for effect in result.effects if (effect.name, effect.where) in of]
        return " ".join(part for part in (what, ties, *small, measure) if part)
    rest = failure or "Something remains that these effects do not explain."
    return " ".join(part for part in (what, measure, explained_to(result), rest) if part)


def parted(found: Sequence[Named]) -> tuple[list[Named], list[Named]]:
    """The effects that a paragraph tells with their values, and where there are many those that hardly take part in the
    gap.
    """
    slight = [n for n in found[1:] if n.share < SLIGHT] if len(found) > MANY else []
    return [n for n in found if n not in slight], slight


def _slight(result: Diagnosis, slight: Sequence[Named]) -> str:
    which = enumerated([called(result, n.term.label) for n in slight])
    many = f"{in_words(len(slight))} smaller ones are" if len(slight) > 1 else "one smaller is"
    return f"{capital(many)} listed too, with less than {100 * SLIGHT:.0f} % of the squared gap each: {which}."
