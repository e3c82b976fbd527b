"""How every command gives its document: files in a folder, and a table, its JSON, or nothing on standard output."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import typer

from compare.cli.folders import REMEDY, same_question
from compare.files import alone_in, check_replaceable, made_folder

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
    sentences = list(dict.fromkeys([*before, *getattr(document, "warnings", ())]))
    for text in sentences:
        if text not in before:
            typer.echo(text if text.startswith("left out: ") else f"warning: {text}", err=True)
    known = {"warnings": tuple(sentences)} if "warnings" in type(document).model_fields else {}
    return document.model_copy(update={"command": command_line(), **known})


def publish(
    document: Document,
    folder: Path,
    *,
    json: bool,
    quiet: bool,
    overwrite: bool = False,
    context: typer.Context | None = None,
) -> None:
    """Write a document and its report, and print what was asked for.

    Raises OutputError, also where a file is there that is not of the command of the ``context``, unless it is to
    ``overwrite``.
    """
    texts = document.files()
    with made_folder(folder) as place, alone_in(place):
        put(document, place, texts, overwrite, context)
    show(document, json=json, quiet=quiet, place=folder)


def put(
    document: Document, folder: Path, texts: Mapping[str, str], overwrite: bool, context: typer.Context | None
) -> None:
    """Write a document's files into a folder that is held for it.  Raises OutputError, as :func:`publish` does.

    A command has asked whose the folder is when it began (:func:`compare.cli.folders.result_folder`); another one may
    have come in between.
    """
    from compare.results.document import replace_result

    if not overwrite:
        same = _same_line(document) if context is None else same_question(context)
        check_replaceable(folder, document.file, texts, same, "--out", REMEDY)
    replace_result(folder, texts)


def _same_line(document: Document) -> Callable[[str | None], bool]:
    return lambda line: line == getattr(document, "command", None)


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
    """A console on standard output, which prints names and paths as they are."""
    from rich.console import Console

    return Console(width=width, markup=False, emoji=False)


def say(sentences: Iterable[str]) -> None:
    """Sentences on standard error."""
    for sentence in sentences:
        typer.echo(sentence, err=True)
