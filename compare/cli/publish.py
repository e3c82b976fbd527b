"""How every command gives its document: files in a folder, and a table, its JSON, or nothing on standard output."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import typer

from compare.cli.folders import refuse_strangers
from compare.files import alone_in, output_folder, write_together

if TYPE_CHECKING:
    from rich.console import Console

    from compare.results.document import Document

D = TypeVar("D", bound="Document")


def command_line() -> str:
    """The command as it was typed."""
    return shlex.join(["compare", *sys.argv[1:]])


def finished(document: D, warned: Iterable[str]) -> D:
    """A document with the command that asked for it, and with all warnings; those that were not said yet are said."""
    before = list(warned)
    told = list(dict.fromkeys([*before, *getattr(document, "warnings", ())]))
    for text in told:
        if text not in before:
            typer.echo(text if text.startswith("left out: ") else f"warning: {text}", err=True)
    return document.model_copy(update={"command": command_line(), "warnings": tuple(told)})


def publish(document: Document, folder: Path, *, json: bool, quiet: bool, overwrite: bool = False) -> None:
    """Write a document and its report, and print what was asked for.

    Raises OutputError, also where a file is there that is not this result's, unless it is to ``overwrite``.
    """
    place, texts = output_folder(folder), document.files()
    with alone_in(place):
        refuse_strangers(place, document.file, texts, overwrite)
        write_together(place, texts)
    show(document, json=json, quiet=quiet, place=place)


@contextmanager
def resumed() -> Iterator[None]:
    """An interrupt of what keeps what it has done says that it goes on where it stopped."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the same command goes on where it stopped") from None


def show(document: Document, *, json: bool, quiet: bool, place: Path | None = None) -> None:
    """Print a document: its JSON, or the table for a terminal and where its files are."""
    if json:
        typer.echo(document.to_json())
        return
    if quiet:
        return
    console = console_of(None if sys.stdout.isatty() else 110)
    document.print_to(console)
    if place is not None:
        console.print(f"{document.opened}: {place / document.opens}", soft_wrap=True, highlight=False)


def console_of(width: int | None) -> Console:
    """A console on standard output."""
    from rich.console import Console

    return Console(width=width)
