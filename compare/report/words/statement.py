"""The sentences that diagnosis.json stores: its statement, its steps, and why each candidate was named or not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from analytic.mechanism.one_line import capital, count, enumerated, in_words
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.quantities import plainly
from compare.report.words.diagnosis import SIGMA, separation
from compare.report.words.effects import called, chance, floor_means, own_values, spoken, values_of
from compare.report.words.located import located
from compare.report.words.measured import data_sentences, explained_to, validation_sentences
from compare.results.diagnosis import Diagnosis, EngineGaps, Step

if TYPE_CHECKING:
    from compare.diagnose.explanation import Explanation, Named
    from compare.diagnose.predict import Term

NOT_SHOWN = "these sensors and runs do not show it"
WRONG_SIGN = "it would have to have the wrong sign"
BEYOND = "alone it would have to be larger than its bounds allow"
MOST_IN_PARAGRAPH = 4  # effects in a paragraph
SLIGHT_SHARE = 0.01  # of the squared gap: with a smaller share, an effect among many is told without its values
PLACES_IN_STORY = 3  # told in the story; the page lists all
BUDGET = "The budget of {:g} s ended the search: this is the best so far, and what ties with it was not looked for."
WIDER = (
    "What is left of these swings is alike over many readings: the 95 % intervals take in a small torque without a"
    " name, and are up to {} times as wide as if each reading were off by itself."
)
CRANK_LANDS = (
    "The crank lands in the gap of its drive at {}. How forces and rates jump there nobody foretells: there they count"
    " for little in the gap, and not at all in how far each sensor is off."
)
LONGER_RUN = "more revolutions, or a run so slow or so loaded that pins keep touching: its samples can be foretold"


def statement(result: Diagnosis, e: Explanation, failure: str = "") -> str:
    """The verdict in a paragraph; ``failure`` says why the simulator could not confirm it."""
    before, after = result.gap.before, result.gap.after
    measure = f"Measured and simulated differ by {plainly(before)} times the noise before and {plainly(after)} after."
    measure += f" {floor}" if (floor := floor_means(result)) else ""
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
    main, slight = parted(e.named)
    what = " ".join([*(named(result, n) for n in main), *([_slight(result, slight)] if slight else [])])
    if e.verdict in ("explained", "ambiguous"):
        ties = " ".join(
            f"These data would be explained as well if {tied(result, n)} (instead of {called(result, n.term.label)})."
            for n in main
            if n.ties
        )
        return " ".join(part for part in (what, ties, measure) if part)
    rest = failure or "Something remains that these effects do not explain."
    return " ".join(part for part in (what, measure, explained_to(result), rest) if part)


def named(result: Diagnosis, n: Named) -> str:
    """A named effect in a sentence, its parameters with their 95 % intervals; values of each run by their range."""
    effect = next(effect for effect in result.effects if (effect.name, effect.where) == n.term.key)
    own = own_values(result, effect)
    if own is not None:
        text = capital(f"{own.sentence(len(result.fitted))}.")
        kept = enumerated([run.name for run in result.validation])
        return f"{text} In {kept} it {own.elsewhere}." if kept else text
    values = values_of(result, effect, intervals=True)
    return capital(f"{n.term.effect.tells(_place(result, n.term), values)}.")


def meaning(result: Diagnosis, term: Term) -> str:
    """What an effect at its place means: ``joint B has clearance``; one outside the vocabulary says it itself."""
    return term.effect.says(_place(result, term))


def _place(result: Diagnosis, term: Term) -> str:
    """Where an effect is, as its sentences say it."""
    of_signal = term.effect.name in VOCABULARY and term.effect.place == "signal"
    return spoken(result, term.where) if of_signal else term.where


def tied(result: Diagnosis, n: Named) -> str:
    """What explains the data as well as a named effect, in words."""
    return "; or ".join(meaning(result, t) for t, _ in n.ties)


def parted(effects: Sequence[Named]) -> tuple[list[Named], list[Named]]:
    """The effects that a paragraph tells with their values, and where there are many those that hardly take part in the
    gap.
    """
    slight = [n for n in effects[1:] if n.share < SLIGHT_SHARE] if len(effects) > MOST_IN_PARAGRAPH else []
    return [n for n in effects if n not in slight], slight


def _slight(result: Diagnosis, slight: Sequence[Named]) -> str:
    which = enumerated([called(result, n.term.label) for n in slight])
    many = f"{in_words(len(slight))} smaller ones are" if len(slight) > 1 else "one smaller is"
    return f"{capital(many)} listed too, with less than {100 * SLIGHT_SHARE:.0f} % of the squared gap each: {which}."


def steps(result: Diagnosis, e: Explanation, agreement: float, notes: Sequence[str]) -> tuple[Step, ...]:
    """The story, step by step; the engine agrees with the analytic model within so much of the noise."""
    data = (*data_sentences(result.runs), *(capital(f"{fault.text}.") for fault in result.faults))
    places = [capital(f"{located(result, place)}.") for place in result.located[:PLACES_IN_STORY]]
    more = len(result.located) - PLACES_IN_STORY
    places += [f"And in {count(more, 'other place')}."] if more > 0 else []
    add = tuple(_added(engine) for engine in result.engines)
    return (
        Step(title="Measured data", text=data),
        Step(title="Locate", text=tuple(places) or ("No sensor leaves its noise anywhere.",)),
        Step(title="Isolate", text=_isolated(result, agreement, notes)),
        Step(title="Name", text=_named(e, result) or ("No effect passes the tests that a name has to pass.",)),
        Step(title="Add", text=add if e.named else ("Nothing to add.",)),
        Step(title="Result", text=(result.statement, *validation_sentences(result))),
    )


def _isolated(result: Diagnosis, agreement: float, notes: Sequence[str]) -> tuple[str, ...]:
    visible = sum(c.status not in ("invisible", "excluded") for c in result.candidates)
    considered = (
        f"{len(result.candidates)} effects, each at each place where it can be, were considered, and {visible} of them"
        f" would show in these data. What a little of each would do comes from the analytic model, which agrees with"
        f" {result.simulator.name} on the nominal mechanism within {plainly(agreement, 2)} of the noise."
    )
    if not result.inseparable:
        return (considered, *notes)
    pairs = ", ".join(f"{called(result, a)} and {called(result, b)}" for a, b, _ in result.inseparable[:5])
    others = " and others" if len(result.inseparable) > 5 else ""
    return (considered, *notes, f"These data cannot tell apart: {pairs}{others}.")


def _named(e: Explanation, result: Diagnosis) -> tuple[str, ...]:
    sentences = []
    for n, effect in zip(e.named, result.effects, strict=True):
        sentences.append(
            f"{named(result, n)} By the analytic model the gap is {plainly(n.gap[0])} times the noise without it,"
            f" beside what else is named, and {plainly(n.gap[1])} with it; on held-out data, which its values were not"
            f" fitted to, {plainly(n.held_out[0])} and {plainly(n.held_out[1])}."
        )
        if n.ties:
            words = separation(effect.would_separate)[0].rstrip(":.") or "no run of these sensors can"
            sentences.append(f"As good: {tied(result, n)}. To tell them apart: {words}.")
    return tuple(sentences)


def _added(engine: EngineGaps) -> str:
    """What the explanation does to the gap of one engine."""
    if engine.before is None or engine.after is None:
        return f"{engine.name}: {engine.skipped}."
    lacking = (
        f"; it has no {', '.join(engine.added)}, and got the difference that the analytic model makes of it"
        if engine.added
        else ""
    )
    return f"{engine.name}: gap {plainly(engine.before)} before, {plainly(engine.after)} after{lacking}."


def improbable(alone: float, probability: float | None) -> str:
    """Why an effect that would take so many sigmas ``alone`` is not named: how probable it is among all sets; None
    where no sets were judged sample by sample.
    """
    why = "nothing is named sample by sample here" if probability is None else unlikely(probability)
    return f"alone it would take {plainly(alone, 2)} {SIGMA}; {why}"


def unlikely(probability: float) -> str:
    """Why an effect that no test excludes is still not named."""
    return f"its chance of being there is {chance(probability)}"


def why_tied(result: Diagnosis, n: Named) -> str:
    """Why an effect is only tied with a named one."""
    return f"explains the data as well as {called(result, n.term.label)}"
