"""A proposed place and law as a report shows it: what was recovered over what the law is of, and the law through it."""

from __future__ import annotations

import numpy as np

from analytic.mechanism.one_line import capital
from compare.quantities import fitting
from compare.report.figure import Axis, Figure, Mark, Series
from compare.report.words.effects import unknown
from compare.results.diagnosis import Diagnosis, Proposed
from compare.results.document import listed

LONGEST_GAP = 0.1  # of what a law is shown over: no line is drawn across more without a sample
SCATTER = 0.02  # of its range, by which a law's samples differ from their neighbours' mean: it is drawn as points


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
        broken = np.flatnonzero((np.diff(x) > LONGEST_GAP * np.ptp(x)) & (mark == "line")) + 1
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
