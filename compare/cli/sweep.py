"""What ``--set`` makes of a command: the same question at each point of a grid of values of the mechanism's fields."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, NoReturn

import typer

from compare.cli.typed import CommandLine
from compare.faults import Exit, OptionError, stop
from compare.questions.question import Question
from compare.questions.sweep import SweepQuestion

if TYPE_CHECKING:
    from compare.results.sweep import Asks


def is_swept(line: CommandLine, alone: Collection[str] = ()) -> bool:
    """Whether fields are varied.  Raises OptionError for what belongs to that and is typed without, but for what is
    ``alone`` of use.
    """
    if line.has("set"):
        return True
    for name in filter(line.has, {"workers", "dask"} - {*alone}):
        raise OptionError(f"--{name}: spreads the points of --set; give that, or leave it out")
    return False


def answer(line: CommandLine, asks: Asks, question: type[Question], caught: Sequence[str]) -> NoReturn:
    """Answer by a table of every point, and leave with a status that says whether all of them succeeded.  Raises
    typer's Exit.
    """
    from compare.parametric import swept

    judges = asks == "crosscheck" or line.has("limit") or line.has("min_yield")
    files = ("sweep.json", "sweep.html", "sweep.csv", "sweep.svg", *["junit.xml"] * judges)
    folder = line.folder(f"{line.stem}-{asks}", *files)
    options = line.arguments(question)
    for name in ("mechanism", "workers"):
        options.pop(name, None)
    asked = line.asked(SweepQuestion, asks=asks, options=options)
    write = line.drawn if "plot" in line.words else line.answer
    result = write(lambda: swept(asked), caught, folder)
    failures = [point for point in result.points if point.failure]
    if len(failures) == len(result.points):
        line.tests.clear()  # they have the reason of each point
        status = Exit.SIMULATOR_FAILED if failures[0].engine_failed else Exit.BAD_INPUT
        raise stop(f"no point has an answer, the first because {failures[0].failure}", status)
    if any(point.engine_failed for point in result.points):
        raise typer.Exit(Exit.SIMULATOR_FAILED)
    raise typer.Exit(Exit.AGREES if result.holds else Exit.DISAGREES)
