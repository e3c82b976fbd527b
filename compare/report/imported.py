"""An import, shown: the mechanism in a line, and what there is to say of it."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from rich.console import Console

from compare.results.imported import Imported

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def files(result: Imported) -> dict[str, str]:
    """The mechanism file."""
    return {"mechanism.toml": result.text}


def print_table(result: Imported, console: Console) -> None:
    """Print the mechanism, the notes, and where the file is."""
    lines = [repr(result.mechanism), *(f"note: {note}" for note in result.notes)]
    for line in (*lines, *([f"written: {result.path}"] if result.path else [])):
        console.print(line, soft_wrap=True, highlight=False)


def summary_html(result: Imported) -> str:
    """The mechanism in a line, and the notes as a list."""
    notes = "".join(f"<li>{html.escape(note)}</li>" for note in result.notes)
    return f"<p>{html.escape(repr(result.mechanism))}</p><ul>{notes}</ul>"


def plot(result: Imported, figure: Figure) -> None:
    """A mechanism file has no picture.  Raises TypeError."""
    raise TypeError("Imported is a mechanism and has no picture; cross-check it, and plot that")
