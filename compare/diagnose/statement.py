"""What a diagnosis says, in sentences."""

from __future__ import annotations

from compare.diagnose.explain import Explanation, Interval, Named
from compare.results.diagnosis import Parameter
from compare.results.sentences import parameter


def named(n: Named) -> str:
    """A named effect in a sentence, its parameters with their 95 % intervals."""
    values = []
    for p, i in n.parameters.items():
        name, value, interval = parameter(p, as_parameter(i))
        values.append(f"{name} {value}" + (f" (95 %: {interval})" if i.low < i.high else ""))
    text = f"{n.term.effect.says(n.term.where)}: {'; '.join(values)}."
    return text[0].upper() + text[1:]


def tied(n: Named) -> str:
    """What explains the data as well as a named effect, in words."""
    return "; or ".join(t.effect.says(t.where) for t, _ in n.ties)


def as_parameter(interval: Interval) -> Parameter:
    """A parameter as the document has it; an open end of its interval is no number."""
    return Parameter(value=interval.value, unit=interval.unit, low=interval.low, high=interval.high)


def statement(e: Explanation, gap: tuple[float, float], failure: str = "") -> str:
    """The verdict in a paragraph; ``failure`` says why the simulator could not confirm it."""
    before, after = gap
    measure = f"The gap is {before:.3g} times the noise before and {after:.3g} after."
    if e.verdict == "no gap":
        agree = f"Simulation and measurement agree within the noise (gap {before:.3g} times the noise floor)."
        return f"{agree} Nothing is missing that these data could show."
    if e.verdict == "unexplained":
        disagree = f"Simulation and measurement disagree (gap {before:.3g} times the noise floor)"
        return f"{disagree}, and nothing in the vocabulary explains it."
    what = " ".join(named(n) for n in e.named)
    if e.verdict == "explained":
        return f"{what} {measure}"
    if e.verdict == "ambiguous":
        ties = " ".join(
            f"These data would be explained as well if {tied(n)} (instead of {n.term.label})."
            for n in e.named
            if n.ties
        )
        return f"{what} {ties} {measure}"
    if failure:
        return f"{what} {measure} {failure}"
    return f"{what} {measure} Something remains that these effects do not explain."
