"""Stored evidence that was made again, shown: what differs, and how much was looked at."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from rich.console import Console

from tests.evidence.results.remade import Remade

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def files(result: Remade) -> dict[str, str]:
    """Nothing beside the JSON file."""
    return {}


def print_table(result: Remade, console: Console) -> None:
    """Print each difference and note, and how much was made again."""
    for line in (*result.differences, *result.notes):
        console.print(line, soft_wrap=True, highlight=False)
    count = len(result.differences)
    summary = f"{result.made_again}; {count} {'differs' if count == 1 else 'differ'} from {result.stored}"
    console.print(summary, soft_wrap=True, highlight=False)


def summary_html(result: Remade) -> str:
    """The differences as a table."""
    body = "".join(f"<tr><td>{html.escape(line)}</td></tr>" for line in result.differences or ("nothing",))
    return f"<p>{html.escape(repr(result))}</p><table><tr><th>differs</th></tr>{body}</table>"


def plot(result: Remade, figure: Figure) -> None:
    """Differences have no picture.  Raises TypeError."""
    raise TypeError(f"{type(result).__name__} is a list of sentences and has no picture; print it")
