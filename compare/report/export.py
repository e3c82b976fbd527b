"""An export, shown: its files, and how to run them."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from rich.console import Console

from compare.results.export import Exported

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def files(result: Exported) -> dict[str, str]:
    """Nothing beside the JSON file."""
    return {}


def print_table(result: Exported, console: Console) -> None:
    """Print each path, and the command that runs the model."""
    how = f"run it in an environment that has {' and '.join(result.needs)}: {result.run}"
    for line in (*result.paths, how):
        console.print(line, soft_wrap=True, highlight=False)


def summary_html(result: Exported) -> str:
    """The files as a table."""
    body = "".join(f"<tr><td>{html.escape(path)}</td></tr>" for path in result.paths)
    return f"<p>{html.escape(repr(result))}</p><table>{body}</table>"


def plot(result: Exported, figure: Figure) -> None:
    """Files have no picture.  Raises TypeError."""
    raise TypeError("Exported is a list of files and has no picture; print it")
