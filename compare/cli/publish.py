"""How every command gives its document: files in a folder, and a table, its JSON, or nothing on standard output."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import typer

from compare.ci import annotated, head_summary, is_no_answer, summed_up, wrong
from compare.cli.folders import REMEDY, same_question
from compare.files import check_replaceable, relative

if TYPE_CHECKING:
    from compare.results.document import Document

D = TypeVar("D", bound="Document")


def finished(document: D, warned: Iterable[str]) -> D:
    """A document with the command that asked for it, and with all warnings; those that were not said yet are said."""
    before = list(warned)
    sentences = list(dict.fromkeys([*before, *getattr(document, "warnings", ())]))
    for text in sentences:
        if text not in before:
            typer.echo(text if text.startswith("left out: ") else f"warning: {text}", err=True)
    known = {"warnings": tuple(map(relative, sentences))} if "warnings" in type(document).model_fields else {}
    return document.model_copy(update={"command": relative(shlex.join(["compare", *sys.argv[1:]])), **known})


def put(document: Document, folder: Path, overwrite: bool, context: typer.Context) -> None:
    """Write a document's files into a folder that is held for it.

    Raises OutputError where a file is there that is not of the command of the ``context``, unless it is to
    ``overwrite``.  That command has asked whose the folder is when it began
    (:func:`compare.cli.folders.result_folder`); another one may have come in between.
    """
    from compare.results.document import replace_result

    texts = document.files()
    if not overwrite:
        beside = [name for name in texts if not is_no_answer(folder / name)]
        check_replaceable(folder, document.file, beside, same_question(context), "--out", REMEDY)
    replace_result(folder, texts)


@contextmanager
def resumed() -> Iterator[None]:
    """An interrupt of what keeps what it has done says that it goes on where it stopped."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the same command goes on where it stopped") from None


def show(
    document: Document, *, json: bool, quiet: bool, place: Path | None = None, tests: Path | None = None, file: str = ""
) -> None:
    """Print a document: its JSON, or the table for a terminal, where its files are, and how to look at what is worst in
    it; in a workflow of GitHub, the verdict on the run's page, and annotations of the ``file`` that it is about on
    standard error, with where all are as ``tests``.
    """
    judged = document.judgements()
    say(annotated(judged, file, str(tests or "a file of --junit")))
    head_summary(summed_up(judged))
    if json:
        typer.echo(document.to_json())
        return
    if quiet:
        return
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else 110, markup=False, emoji=False)
    document.print_to(console)
    if place is not None:
        console.print(f"{document.opened}: {place / document.opens}", soft_wrap=True, highlight=False)
        look = next((case.look for case in wrong(judged) if case.look), "")
        if look:
            command = look.replace("{file}", shlex.quote(str(place / document.file)))
            console.print(f"to look at the worst: {command}", soft_wrap=True, highlight=False)


def say(sentences: Iterable[str]) -> None:
    """Sentences on standard error."""
    for sentence in sentences:
        typer.echo(sentence, err=True)
