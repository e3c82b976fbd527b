"""A cross-check, shown: its report, the table for a terminal, a short one for a notebook, the curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from compare.ci import JUnitSuite, junit_xml
from compare.presentation import Presentation
from compare.quantities import plain
from compare.report.contact_figures import contact_figures
from compare.report.crosscheck_figures import both_sides, figures, shows, simulators
from compare.report.crosscheck_page import render, verdict_html
from compare.report.crosscheck_terminal import print_table
from compare.report.curves import curve, legend
from compare.report.junit import suites
from compare.report.linkage import linkage_figure
from compare.report.pages import stem
from compare.report.summary import summarise
from compare.report.svg import draw
from compare.report.tables import html_list, html_table
from compare.report.words.crosscheck import VERDICT_WORDS
from compare.results.crosscheck import CrossCheck
from sim_models.engine import JOINT_MODELS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANEL = 3.0  # inches of an engine's plot
# of joint models, the same in every panel
COLOURS: dict[str, str] = dict(zip(JOINT_MODELS, ("C0", "C1", "C2", "C3"), strict=True))


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
    """The verdict and why, warnings, of each run the signal that takes the largest share of its tolerance, and what
    contact did.
    """
    summary = summarise(result)
    rows = []
    for shown in summary.runs:
        worst = max(shown.rows, key=lambda row: row.share or 0.0, default=None)
        cells = ("-", "-", "-")
        if worst is not None:
            unit = worst.quantity.unit
            cells = worst.quantity.label, f"{plain(worst.maximum, 3, True)} {unit}", f"{plain(worst.tolerance)} {unit}"
        rows.append((shown.run.title, VERDICT_WORDS[shown.run.verdict], *cells, worst.at if worst else "-"))
    heads = ("run", "verdict", "largest share of its tolerance", "difference", "tolerance", "at")
    contact = [f"{'; '.join(runs)}: {sentence}" for sentence, _, runs in summary.contact.by_sentence]
    contact += [summary.contact.caution] * bool(summary.contact.caution)
    contact += [f"statistics of {pair.title}: {pair.sentence}" for pair in summary.contact.pairs]
    return f"{verdict_html(summary)}{html_table(rows, heads)}{html_list(contact)}"


def plot(result: CrossCheck, figure: Figure) -> None:
    """Direction and size of the reaction at the last joint with clearance (else at the last one) that was simulated;
    where none was, two of the signals that were.
    """
    summary = summarise(result)
    names = [f"reaction_{joint}_{part}" for joint in reversed(summary.joints) for part in ("angle", "magnitude")]
    names += [quantity.signal for quantity in summary.keys()]
    there = [name for name in names if any(shows(run, name) for run in result.runs)]
    plot_signals(result, figure, list(dict.fromkeys(there))[:2])


def plot_signals(result: CrossCheck, figure: Figure, signals: Sequence[str]) -> None:
    """Both sides of signals, one below the other, the engines side by side."""
    summary, names = summarise(result), simulators(result)
    figure.set_figwidth(max(8.0, 2.5 + PANEL * len(names)))
    figure.set_figheight(max(5.0, 2.5 * len(signals)))
    shape = max(1, len(signals)), max(1, len(names))
    axes = figure.subplots(*shape, sharex=True, sharey="row", squeeze=False)
    for row, shown in enumerate(both_sides(summary, signal) for signal in signals):
        for level, axis in enumerate(axes[row]):
            for series in shown.series:
                if series.mark != "marker":
                    style = "k--" if series.mark == "dashed" else "k-"
                    axis.plot(*curve(series), style, linewidth=0.8, label=series.name.replace(" (", "\n("))
                elif series.level == level:
                    axis.plot(*curve(series), ".", markersize=4, color=COLOURS[series.role], label=series.role)
        quantity = summary.signals[signals[row]]
        axes[row, 0].set_ylabel(f"{quantity.label} ({quantity.unit})")
    for axis, name in zip(axes[0], names, strict=False):
        axis.set_title(name, fontsize="medium")
    for axis in axes[-1]:
        axis.set_xlabel("time (s)" if result.swings else "crank angle (deg)")
    legend(*axes[:, -1], *axes[0, :-1])
    figure.suptitle(f"{result.case}: {VERDICT_WORDS[summary.verdict]}")


PRESENTATION = Presentation(summary_html, print_table, files, plot, plot_signals, judged=judged)
