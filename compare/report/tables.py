"""Tables and lines for a terminal, and tables for a notebook."""

from __future__ import annotations

import html
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Literal

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

GAP = 2  # spaces between columns
LONGEST_WORD = 24  # of a folded column, that is not broken


def say(console: Console, *lines: str) -> None:
    """Print lines as they are, none of them broken."""
    for line in lines:
        console.print(line, soft_wrap=True, highlight=False)


def print_rows(
    console: Console,
    heads: Sequence[str],
    rows: Iterable[Sequence[str | Text]] = (),
    *,
    left: Collection[str] | None = None,
    folded: Collection[str] = (),
    header_style: str = "bold",
) -> None:
    """Print a table without rules, its columns aligned to the right but those that are ``left`` (None: all); ``folded``
    ones may take several lines.

    No number is cut: where a terminal has no room for all columns, the rest comes below, behind the first ones again.
    What is no terminal has room.
    """
    rows = list(rows)
    widths = [_least(head in folded, [head, *(row[k] for row in rows)]) for k, head in enumerate(heads)]
    room = console.width if console.is_terminal else max(console.width, sum(widths) + GAP * len(widths))
    for block in _blocks(heads, widths, room):
        fits = sum(widths[k] + GAP for k in block) - GAP <= room
        table = Table(box=None, pad_edge=False, padding=(0, GAP, 0, 0), header_style=header_style)
        for head in (heads[k] for k in block):
            side: Literal["left", "right"] = "left" if left is None or head in left else "right"
            table.add_column(head, justify=side, no_wrap=fits and head not in folded, overflow="fold")
        for row in rows:
            table.add_row(*(row[k] for k in block))
        shown, console.width = console.width, room
        console.print(table)
        console.width = shown


def _least(folded: bool, cells: Iterable[str | Text]) -> int:
    """The columns of a terminal that these cells need: of a folded one, those of a word."""
    lines = [line for cell in cells for line in (str(cell).split() if folded else str(cell).splitlines())]
    return min(max(map(cell_len, lines), default=0), LONGEST_WORD if folded else sys.maxsize)


def _blocks(heads: Sequence[str], widths: Sequence[int], room: int) -> Iterator[list[int]]:
    """The numbers of the columns that stand beside each other: the name and its unit, and what fits; a number and where
    it is are not parted.
    """
    first = [0, 1] if "unit" in heads[1:2] else [0]
    block = list(first)
    for k in range(len(first), len(heads)):
        together = [k, *([k + 1] if heads[k + 1 : k + 2] and heads[k + 1] == "at" else [])]
        over = sum(widths[j] + GAP for j in dict.fromkeys([*block, *together])) - GAP > room
        if over and len(block) > len(first) and heads[k] != "at":
            yield block
            block = list(first)
        block.append(k)
    yield block


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
