"""A diagnosis, shown: its page and text, the explained mechanism, a short table for a notebook, the residuals."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from compare.ci import JUnitCase, JUnitSuite, junit_xml
from compare.presentation import Presentation
from compare.quantities import fitting, plainly
from compare.report.curves import partly
from compare.report.diagnosis_page import diagnosis_html, diagnosis_md, summary_html
from compare.report.diagnosis_terminal import terminal_lines
from compare.report.explained import explained_toml
from compare.report.residuals import draw as draw_residuals
from compare.report.tables import say
from compare.report.words.effects import spoken
from compare.report.words.measured import remaining
from compare.results.diagnosis import SIDES, Diagnosis

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLOTTED = 3  # signals, those with the widest gap


def files(result: Diagnosis) -> dict[str, str]:
    """The explained mechanism and the report: text by file name."""
    return {
        "explained.toml": explained_toml(result),
        "diagnosis.md": diagnosis_md(result),
        "diagnosis.html": diagnosis_html(result),
        "junit.xml": junit_xml(f"diagnosis of {result.case}", judged(result), result.file),
    }


def judged(result: Diagnosis) -> list[JUnitSuite]:
    """The verdict as test cases: it fails if it is not settled, and so does each signal that is left unexplained."""
    left = {} if result.settled else remaining(result)
    verdict = JUnitCase(
        (result.case, result.simulator.name, "diagnosis"),
        "verdict",
        said=result.statement,
        failure="" if result.settled else f"{result.verdict}: {result.statement}",
        kind=result.verdict,
        times=inf,
    )
    suites = [JUnitSuite("verdict", [verdict])]
    for run in result.runs:
        cases = []
        for name, channel in run.signals.items():
            gaps = f"gap {plainly(channel.gap_before)} before, {plainly(channel.gap_after)} after"
            failure = left.get((run.name, name), "")
            place, look = (result.case, result.simulator.name, run.name), f"compare show {{file}} --signal {name}"
            gap = channel.gap_after or 0.0
            cases.append(JUnitCase(place, name, said=gaps, failure=failure, kind="gap", look=look, times=gap))
        suites.append(JUnitSuite(f"{'validation ' * (run.role == 'validation')}run {run.name}", cases))
    return suites


def print_table(result: Diagnosis, console: Console) -> None:
    """Print the verdict in a few lines: what is missing, with intervals; the gap; where it shows."""
    say(console, *terminal_lines(result))


def plot(result: Diagnosis, figure: Figure) -> None:
    """Residuals before and after of the signals with the widest gap, each in the run where it is widest."""
    widest: dict[str, tuple[float, int]] = {}
    for i, run in enumerate(result.runs):
        for name, channel in run.signals.items():
            gap = channel.gap_before or 0.0
            if name not in widest or gap > widest[name][0]:
                widest[name] = gap, i
    names = sorted(widest, key=lambda name: -widest[name][0])[:PLOTTED]
    figure.set_figheight(max(4.0, 2.2 * len(names)))
    for axis, name in zip(figure.subplots(len(names), 1, squeeze=False)[:, 0], names, strict=True):
        run = result.runs[widest[name][1]]
        channel = run.signals[name]
        unit, factor = fitting(channel.unit, float(np.nanmax(np.abs(result.residual(run, name, "before")))))
        before, after = (factor * result.residual(run, name, side) for side in SIDES)
        draw_residuals(axis, run, before, after, factor * channel.noise)
        axis.set_ylabel(f"{spoken(result, name)} ({unit})")
    figure.suptitle(f"{result.case}: {result.verdict}; measured minus simulated, noise within two sigmas shaded")
    partly(figure, PLOTTED, len(widest), "signals, those with the widest gap")


PRESENTATION = Presentation(summary_html, print_table, files, plot, judged=judged)
