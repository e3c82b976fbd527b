"""A proposed place and law as a report shows it: what was recovered over what the law is of, and the law through it."""

from __future__ import annotations

import numpy as np

from compare.quantities import fitting
from compare.report.diagnosis_words import percent
from compare.report.figures import Axis, Figure, Mark, Series
from compare.results.diagnosis import Diagnosis, Proposed
from compare.results.document import listed
from compare.results.sentences import Row, capital, enumerated, parameter, unknown

HEADING = "Proposed, not named"
ADOPTED = "Proposed, and adopted"
GAP = 0.1  # of what a law is shown over: no line is drawn across more without a sample
SCATTER = 0.02  # of its range, by which a law's samples differ from their neighbours' mean: it is drawn as points
MEANING = (
    "A place where one unknown number at each moment would tell what is left, and the law that it looks like. It is"
    " solved for with the analytic model, beside what is named, whose values are fitted again with it. It is a hint for"
    " the engineer: it has no name in the vocabulary, and it changes neither the verdict nor the gap."
)


def heading(result: Diagnosis) -> tuple[str, str]:
    """The heading of what is proposed, and what it means."""
    if all(p.adopted for p in result.proposed):
        return ADOPTED, "You decided that it is there: it is an effect of the model, and counts in the verdict."
    return HEADING, MEANING


def sentences(result: Diagnosis, p: Proposed) -> list[str]:
    """What is proposed, how much it would take away, what does as well, and what would tell them apart; of what is
    adopted, that it is.
    """
    out = [p.says]
    if p.adopted:
        return [*out, "It is adopted: an effect like the others, with the gap that every engine leaves with it."]
    if p.not_adopted:
        out.append(f"It cannot be adopted: {p.not_adopted}.")
    if p.share is not None:
        of = "what is left" if result.verdict in ("unexplained", "partly explained") else "the whole gap"
        where = ", on data left out" if p.law else ", with a number for each moment"
        out.append(f"It would take {percent(min(p.share, 1.0))} of {of} beyond the noise away{where}.")
    if p.ties:
        nouns = [unknown(result, tie) for tie in p.ties]
        others = enumerated([f"{'an' if noun[0] in 'aeiou' else 'a'} {noun}" for noun in nouns])
        out.append(f"These data would be told as well by {others}.")
        out.append(
            f"{capital(p.would_separate)}." if p.would_separate else "No sensor of this linkage would part them."
        )
    return out


def numbers(p: Proposed) -> list[Row]:
    """Letter, value and 95 % interval of each number of the law."""
    return [parameter(letter, found) for letter, found in p.coefficients.items()]


def figure(result: Diagnosis, p: Proposed, name: str) -> Figure:
    """What was recovered, and the law through it; over one turn where it is over the crank angle."""
    over, across = fitting(p.curve.unit, *np.abs(p.curve.argument).tolist())
    unit, factor = fitting(p.unit, float(np.nanmax(np.abs(p.curve.recovered))))
    argument = across * p.curve.argument
    if p.curve.unit == "rad":
        over, argument = "deg", np.degrees(p.curve.argument)
    if p.curve.over == "crank angle":
        argument = np.mod(argument, 360.0)
    order = np.argsort(argument, kind="stable")
    x, law = argument[order], factor * p.curve.law[order]
    series = [
        Series("recovered", tuple(listed(x)), tuple(listed(factor * p.curve.recovered[order])), "contact", "marker")
    ]
    if p.law is not None:
        mark: Mark = "line" if _is_line(law) else "marker"
        broken = np.flatnonzero((np.diff(x) > GAP * np.ptp(x)) & (mark == "line")) + 1
        at, drawn = (np.insert(values, broken, np.nan) for values in (x, law))
        series.append(Series("law", tuple(listed(at)), tuple(listed(drawn)), "analytic", mark))
    title = f"{capital(unknown(result, p))}, recovered at each sample"
    summary = f"{p.says} Shown over the {p.curve.over}, {p.curve.argument.size} samples."
    return Figure(
        name, title, summary, Axis(p.curve.over, over), Axis(unknown(result, p).split(" ")[0], unit), tuple(series)
    )


def _is_line(law: np.ndarray) -> bool:
    """Whether a law (N,) is one of what it is shown over, and not of something else too that differs from sample to
    sample.
    """
    beside = np.abs(law[1:-1] - 0.5 * (law[:-2] + law[2:]))
    return law.size < 3 or float(np.median(beside)) <= SCATTER * float(np.ptp(law))
