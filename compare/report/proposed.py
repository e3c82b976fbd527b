"""A proposed place and law as a report shows it: what was recovered over what the law is of, and the law through it."""

from __future__ import annotations

import math

import numpy as np

from compare.quantities import fitting
from compare.report.diagnosis_words import percent
from compare.report.figures import Axis, Figure, Series
from compare.results.diagnosis import Diagnosis, Proposed
from compare.results.document import listed
from compare.results.sentences import Row, capital, enumerated, parameter, unknown

HEADING = "Proposed, not named"
MEANING = (
    "A place where one unknown number at each moment would tell what is left, and the law that it looks like. It is"
    " solved for with the analytic model, beside what is named, whose values are fitted again with it. It is a hint for"
    " the engineer: it has no name in the vocabulary, and it changes neither the verdict nor the gap."
)


def sentences(result: Diagnosis, p: Proposed) -> list[str]:
    """What is proposed, how much it would take away, what does as well, and what would tell them apart; of what is
    adopted, that it is.
    """
    out = [p.says]
    if p.adopted:
        return [*out, "It is adopted: an effect like the others, with the gap that every engine leaves with it."]
    if p.share is not None:
        of = "what is left" if result.verdict in ("unexplained", "partly explained") else "the whole gap"
        out.append(f"It would take {percent(min(p.share, 1.0))} of {of} beyond the noise away, on data left out.")
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
    """What was recovered, and the law through it."""
    over, across = fitting(p.curve.unit, *np.abs(p.curve.argument).tolist())
    unit, factor = fitting(p.unit, float(np.nanmax(np.abs(p.curve.recovered))))
    if p.curve.unit == "rad":
        over, across = "deg", math.degrees(1.0)
    x = tuple(listed(across * p.curve.argument))
    series = [Series("recovered", x, tuple(listed(factor * p.curve.recovered)), "contact", "marker")]
    if p.law is not None:
        series.append(Series("law", x, tuple(listed(factor * p.curve.law)), "analytic", "line"))
    title = f"{capital(unknown(result, p))}, recovered at each sample"
    summary = f"{p.says} Shown over the {p.curve.over}, {p.curve.argument.size} samples."
    return Figure(
        name, title, summary, Axis(p.curve.over, over), Axis(unknown(result, p).split(" ")[0], unit), tuple(series)
    )
