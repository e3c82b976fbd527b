"""A cross-check, shown: its report, the table for a terminal, a short one for a notebook, the curves."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from compare.ci import JUnitSuite, junit_xml
from compare.presentation import Presentation
from compare.quantities import plain
from compare.report.contact_figures import contact_figures
from compare.report.crosscheck_figures import figures
from compare.report.crosscheck_page import render
from compare.report.crosscheck_terminal import print_table
from compare.report.junit import suites
from compare.report.linkage import linkage_figure
from compare.report.pages import stem
from compare.report.summary import summarise
from compare.report.svg import draw
from compare.report.tables import html_table
from compare.report.words.crosscheck import VERDICT_WORDS, headline
from compare.results.crosscheck import CrossCheck

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def files(result: CrossCheck) -> dict[str, str]:
    """The report: report.html, report.md, junit.xml, signals.csv and the figures, text by file name."""
    summary = summarise(result)
    shown = [*figures(summary), *contact_figures(result)]
    linkage = linkage_figure(result)
    drawings = {figure.name: draw(figure) for figure in [*([linkage] if linkage else []), *shown]}
    names = {name: f"{stem(name)}.svg" for name in drawings}
    page, markdown = render(summary, shown, linkage, drawings, names)
    tests = junit_xml(f"cross-check of {result.case}", suites(summary), result.file)
    texts = {"report.html": page, "report.md": markdown, "junit.xml": tests, "signals.csv": result.to_csv()}
    return texts | {names[name]: drawing for name, drawing in drawings.items()}


def judged(result: CrossCheck) -> list[JUnitSuite]:
    """Its comparisons as test cases."""
    return suites(summarise(result))


def summary_html(result: CrossCheck) -> str:
    """The verdict, and of each run the signal that takes the largest share of its tolerance."""
    summary = summarise(result)
    rows = []
    for shown in summary.runs:
        worst = max(shown.rows, key=lambda row: row.share or 0.0, default=None)
        said = f"{worst.quantity.label} {plain(worst.maximum, 3, True)} {worst.quantity.unit}" if worst else "-"
        rows.append((shown.run.title, VERDICT_WORDS[shown.run.verdict], said, plain(worst.tolerance) if worst else "-"))
    verdict = f"<b>{html.escape(result.case)}: {VERDICT_WORDS[summary.verdict]}.</b> {html.escape(headline(summary))}"
    return f"<p>{verdict}</p>" + html_table(rows, ("run", "verdict", "closest to its tolerance", "tolerance"))


def plot(result: CrossCheck, figure: Figure) -> None:
    """Direction and size of the reaction at each joint with clearance (else at the last one): both sides."""
    summary = summarise(result)
    joints = summary.joints if len(summary.joints) <= 3 else summary.joints[-1:]
    axes = figure.subplots(2, len(joints), sharex=True, squeeze=False)
    for column, joint in enumerate(joints):
        for row, part in enumerate(("angle", "magnitude")):
            quantity = summary.signals[f"reaction_{joint}_{part}"]
            axis = axes[row, column]
            for shown in summary.runs:
                side = quantity.factor * shown.run.simulated[quantity.signal]
                axis.plot(shown.over.values, side, ".", markersize=4, label=shown.run.title)
            last = summary.runs[-1]
            side = quantity.factor * last.run.analytic[quantity.signal]
            axis.plot(last.over.values, side, "k-", linewidth=0.8, label="analytic")
            axis.set_ylabel(f"{quantity.label} ({quantity.unit})")
        axes[-1, column].set_xlabel("time (s)" if result.swings else "crank angle (deg)")
    axes[0, 0].legend(fontsize="small")
    figure.suptitle(f"{result.case}: {VERDICT_WORDS[summary.verdict]}")


PRESENTATION = Presentation(summary_html, print_table, files, plot, judged=judged)
