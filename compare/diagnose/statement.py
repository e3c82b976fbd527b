"""What a diagnosis says, in sentences."""

from __future__ import annotations

from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.explain import Explanation, Interval, Named
from compare.diagnose.predict import Term
from compare.results.diagnosis import Diagnosis, Parameter
from compare.results.sentences import (
    called,
    capital,
    enumerated,
    explained_to,
    own_values,
    plainly,
    rows,
    small_errors,
    spoken,
)


def named(result: Diagnosis, n: Named) -> str:
    """A named effect in a sentence, its parameters with their 95 % intervals; values of each run by their range."""
    parameters = {name: as_parameter(interval) for name, interval in n.parameters.items()}
    own = own_values(result, n.term.effect.name, n.term.where, parameters)
    if own is not None:
        text = capital(f"{own.sentence(len(result.fitted))}.")
        kept = enumerated([run.name for run in result.validation])
        return f"{text} It was not applied to {kept}, for which it has no value." if kept else text
    values = [
        f"{name} {value}" + (f" (95 %: {interval})" if i.low < i.high else "")
        for (name, value, interval), i in zip(rows(parameters), n.parameters.values(), strict=True)
    ]
    return capital(f"{meaning(result, n.term)}: {'; '.join(values)}.")


def meaning(result: Diagnosis, term: Term) -> str:
    """What an effect at its place means: ``joint B has clearance``; one outside the vocabulary says it itself."""
    ours = term.effect.name in VOCABULARY and term.effect.place == "signal"
    return term.effect.says(spoken(result, term.where) if ours else term.where)


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
    if e.verdict == "no gap":
        agree = f"Simulation and measurement agree within the noise: they differ by {plainly(before)} times the noise."
        return f"{agree} Nothing is missing that these data could show."
    if e.verdict == "unexplained":
        disagree = f"Simulation and measurement disagree: they differ by {plainly(before)} times the noise."
        nothing = "No effect that is known here explains that; the best attempts are listed with what they failed."
        return " ".join(part for part in (disagree, explained_to(result, "before"), nothing) if part)
    what = " ".join(named(result, n) for n in e.named)
    if e.verdict == "explained":
        return f"{what} {measure}"
    if e.verdict == "ambiguous":
        ties = " ".join(
            f"These data would be explained as well if {tied(result, n)} (instead of {called(result, n.term.label)})."
            for n in e.named
            if n.ties
        )
        small = " ".join(small_errors(result, effect) for effect in result.effects)
        return " ".join(part for part in (what, ties, small.strip(), measure) if part)
    rest = failure or "Something remains that these effects do not explain."
    return " ".join(part for part in (what, measure, explained_to(result), rest) if part)
