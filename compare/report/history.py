"""Earlier results, shown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from analytic.mechanism.one_line import count
from compare.report.catalogue import files, plot, summary_html
from compare.results.history import Runs

if TYPE_CHECKING:
    from compare.results.history import EarlierRun

__all__ = ["files", "plot", "print_table", "summary_html"]


def print_table(result: Runs, console: Console) -> None:
    """Print a line for each result, newest first, and one for each file that is none."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for heading in ("date (UTC)", "verdict", "case", "made by"):
        table.add_column(heading, overflow="fold", no_wrap=heading == "date (UTC)")
    for run in result.runs:
        table.add_row(run.date[:16].replace("T", " "), run.verdict or run.kind, Text(run.case), Text(_made_by(run)))
    if result.runs:
        console.print(table)
    for line in result.unreadable:
        console.print(line, soft_wrap=True, highlight=False)
    console.print(f"{result.folder}: {count(len(result.runs), 'result')}", soft_wrap=True, highlight=False)


def _made_by(run: EarlierRun) -> str:
    """The command of a result and where it is."""
    return f"{run.command or 'Python'}\n{run.file}"
