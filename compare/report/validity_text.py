"""A validity map in tables: for a terminal, and as Markdown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import TYPE_CHECKING

from compare.quantities import assumptions
from compare.report.tables import print_rows, say
from compare.report.words.validity import (
    Cells,
    about,
    brief,
    edge_rows,
    legend,
    lost,
    measures,
    millimetres,
    panel_title,
    percent,
    rpm,
    sentence,
)
from compare.results.validity import Cell, Failed, Validity

if TYPE_CHECKING:
    from rich.console import Console


def print_table(result: Validity, console: Console) -> None:
    """Print each engine's map as a small table, then what it comes to; ASCII but for names."""

    def show(panel: tuple[str, float | None], what: str, text: Callable[[Cell | Failed], str]) -> None:
        (simulator, restitution), cells = panel, result.of(*panel)
        layer = "" if restitution is None else f", restitution {restitution:g}"
        if layer or what:  # too long for a column
            console.print(f"{simulator}{layer}{what}", highlight=False, soft_wrap=True)
        head = "mm \\ rpm" if layer or what else f"{simulator}: mm \\ rpm"
        rows = [[millimetres(c), *(text(cells[w, c]) for w in result.speeds)] for c in result.clearances]
        print_rows(console, [head, *map(rpm, result.speeds)], rows)

    for panel in result.panels():
        show(panel, "", brief)
    console.print(
        "share of the crank angles at which model and simulation agree, and what fails of the paper's assumptions",
        soft_wrap=True,
    )
    for panel, (title, text) in product(result.panels(), _contact_tables(result)):
        show(panel, f", {title}", text)
    head, *rows = edge_rows(result)
    if rows:
        console.print("clearance (mm) at which contact is first lost")
        print_rows(console, head, rows)
    say(console, *legend(result), about(result), *result.words)


def _contact_tables(result: Validity) -> list[tuple[str, Callable[[Cell | Failed], str]]]:
    """What tables say of contact; where it was not watched, only the time without it."""
    shown = measures(result)
    if shown:
        return [(measure.title, measure.words) for measure in shown]
    if any(lost(cell) for cell in result.cells):
        return [("no contact", lambda cell: f"{percent(lost(cell))} %" if lost(cell) else "-")]
    return []


def markdown(result: Validity) -> str:
    """The text of validity.md."""
    out = [f"# Where the analytic model holds: {_md(result.case)}", "", f"{_md(about(result))}.", ""]
    out += [f"- {_md(line)}" for line in result.words]
    out += [f"- **Warning:** {_md(line)}" for line in result.warnings]
    out += ["", "![map of speed and clearance](validity.svg)", ""]
    out += [
        "A cell says at which share of the crank angles the equilibrium and the simulation agree within tolerance, and",
        "which of the paper's assumptions fail, each tested by itself. The equilibrium does not need first-order and",
        "corrects quasi-static once, so it may agree all the same.",
        "",
        *(f"- {_md(line)}" for line in legend(result)),
    ]
    head, *rows = edge_rows(result)
    if rows:
        out += ["", "Clearance (mm) at which contact is first lost, between two of the map in the simulations:", ""]
        out += _rows(head, rows)
    shown = measures(result)
    speeds = ["mm \\ rpm", *(rpm(w) for w in result.speeds)]
    for simulator, restitution in result.panels():
        of_panel = result.of(simulator, restitution)

        def table(text: Callable[[Cell | Failed], str], cells: Cells = of_panel) -> list[str]:
            return _rows(
                speeds, [[millimetres(c), *(text(cells[w, c]) for w in result.speeds)] for c in result.clearances]
            )

        out += ["", f"## {_md(panel_title(result, simulator, restitution))}", "", *table(brief)]
        for measure in shown:
            out += ["", f"{measure.title[0].upper()}{measure.title[1:]}:", "", *table(measure.words)]
        if not shown and any(map(lost, of_panel.values())):
            out += ["", "Share of the cycle without contact:", "", *table(lambda cell: f"{percent(lost(cell))} %")]
        out += ["", "| rpm | mm | what was found |", "|---:|---:|---|"]
        out += [
            f"| {rpm(w)} | {millimetres(c)} | {_md(sentence(of_panel[w, c], result.mechanism))} |"
            for w in result.speeds
            for c in result.clearances
        ]
    if result.assumed:
        out += ["", "The mechanism gives no number for these:", ""]
        out += [f"- {_md(line)}" for line in assumptions(result.assumed)]
    out += [
        "",
        (
            f"Made by `{result.command}` with"
            f" {', '.join(f'{name} {version}' for name, version in result.versions.items())}."
        ),
        "",
    ]
    return "\n".join(out)


def _rows(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return ["| " + " | ".join(cells) + " |" for cells in (head, ["---:", *["---"] * (len(head) - 1)], *rows)]


def _md(text: str) -> str:
    return text.replace("\\", "\\\\").replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*").replace("\n", " ")
