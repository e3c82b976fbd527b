"""Tables and lines for a terminal, and tables for a notebook."""

from __future__ import annotations

import html
from collections.abc import Collection, Iterable, Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text


def say(console: Console, *lines: str) -> None:
    """Print lines as they are, none of them broken."""
    for line in lines:
        console.print(line, soft_wrap=True, highlight=False)


def terminal_table(
    heads: Sequence[str],
    rows: Iterable[Sequence[str | Text]] = (),
    *,
    left: Collection[str] | None = None,
    folded: Collection[str] = (),
    header_style: str = "bold",
) -> Table:
    """A table without rules, its columns aligned to the right but those that are ``left`` (None: all); ``folded`` ones
    may take several lines.
    """
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style=header_style)
    for head in heads:
        table.add_column(
            head,
            justify="left" if left is None or head in left else "right",
            no_wrap=head not in folded,
            overflow="fold" if head in folded else "ellipsis",
        )
    for row in rows:
        table.add_row(*row)
    return table


def html_table(
    rows: Iterable[Sequence[str]], heads: Sequence[str] = (), title: str = "", *, named: bool = False
) -> str:
    """A table for a notebook, under its title; all of it text.  The first cell of a row is its name where rows are
    ``named``.
    """
    first = "th" if named else "td"
    head = "<tr>" + "".join(f"<th>{html.escape(cell)}</th>" for cell in heads) + "</tr>" if heads else ""
    lines = ([(first if k == 0 else "td", html.escape(cell)) for k, cell in enumerate(row)] for row in rows)
    body = "".join("<tr>" + "".join(f"<{tag}>{cell}</{tag}>" for tag, cell in line) + "</tr>" for line in lines)
    return f"<p>{html.escape(title)}</p>" * bool(title) + f"<table>{head}{body}</table>"


def html_list(lines: Iterable[str]) -> str:
    """Lines of text for a notebook, none where there is nothing to say."""
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    return f"<ul>{items}</ul>" * bool(items)
