"""A map of validity, shown: the map, its text, the table for a terminal, and curves of what agrees."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import numpy as np

from compare.presentation import Presentation
from compare.report.curves import MOST_CURVES, legend
from compare.report.tables import html_table
from compare.report.validity_figure import draw
from compare.report.validity_text import markdown, print_table
from compare.report.words.validity import brief, millimetres, panel_title, rpm
from compare.results.validity import Cell, Validity

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def files(result: Validity) -> dict[str, str]:
    """The map, its text, and the cells as a table for other programs."""
    return {"validity.svg": draw(result), "validity.md": markdown(result), "validity.csv": result.to_csv()}


def summary_html(result: Validity) -> str:
    """Each engine's map as a small table."""
    out = [f"<p>{html.escape(repr(result))}</p>"]
    for panel in result.panels():
        cells = result.of(*panel)
        heads = (panel_title(result, *panel), *(f"{rpm(speed)} rpm" for speed in result.speeds))
        rows = [
            (f"{millimetres(gap)} mm", *(brief(cells[speed, gap]) for speed in result.speeds))
            for gap in result.clearances
        ]
        out.append(html_table(rows, heads, named=True))
    return "".join(out)


def plot(result: Validity, figure: Figure) -> None:
    """The share of the crank angles at which model and simulation agree, a line for each of the first six clearances;
    engines, and coefficients of restitution, side by side.
    """
    panels = list(result.panels())
    figure.set_figwidth(max(8.0, 2.5 + 3.0 * len(panels)))
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axis, panel in zip(axes, panels, strict=True):
        of_panel = result.of(*panel)
        for gap in result.clearances[:MOST_CURVES]:
            cells = [of_panel[speed, gap] for speed in result.speeds]
            share = [100 * cell.agreeing_share if isinstance(cell, Cell) else np.nan for cell in cells]
            axis.plot([speed * 30 / np.pi for speed in result.speeds], share, "o-", label=f"{millimetres(gap)} mm")
        axis.set_title(panel[0] if panel[1] is None else f"{panel[0]}, restitution {panel[1]:g}", fontsize="medium")
        axis.set_xlabel("speed (rpm)")
    axes[0].set_ylabel("agreeing (% of the crank angles)")
    legend(axes[-1])
    figure.suptitle(result.case)


PRESENTATION = Presentation(summary_html, print_table, files, plot)
