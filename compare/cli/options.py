"""What the commands that are no question take, and sentences on standard error."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[
    bool, typer.Option("--json", help="Print the result file (JSON) to standard output, and nothing else there.")
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print nothing to standard output; files are written as without it.")
]


def place(text: str | Path) -> Path:
    """The path of an option.  Raises BadParameter for an empty one, which would be the current folder."""
    if not str(text).strip():
        raise typer.BadParameter("it is empty; name a folder, or give . for the current one")
    return Path(text)


def said(sentences: Iterable[str]) -> None:
    """Sentences on standard error."""
    for sentence in sentences:
        typer.echo(sentence, err=True)
