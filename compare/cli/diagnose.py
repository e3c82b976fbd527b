"""``compare diagnose``: which effect the model lacks."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from analytic.writing import OutputError, write_atomically
from compare.cli.folders import named_after, refuse_inputs
from compare.cli.typed import CommandLine, Shown, Where, command
from compare.faults import Exit, OptionError
from compare.files import alone_in, made_folder
from compare.questions.diagnose import DiagnoseQuestion
from compare.questions.option import NameList, Option, Switch
from compare.questions.question import Question


class Instead(Question):
    """Uses of data in place of a diagnosis."""

    check: Annotated[bool, Option("Show the data beside the nominal model; diagnose nothing.", Switch())] = False
    init: Annotated[
        bool, Option("Write a measured.toml for these data files, as far as it can be guessed.", Switch())
    ] = False
    case: Annotated[str | None, Option("With --init: the nominal mechanism, a shipped case or a file.")] = None
    columns: Annotated[
        Sequence[str] | None,
        Option("With --init: headings of data files without a header.", NameList("HEADING,...", least=1)),
    ] = None
    split: Annotated[bool, Option("With --init: each part of a file whose clock starts again is a run.", Switch())] = (
        False
    )


@command(DiagnoseQuestion, Instead, Where, Shown)
def diagnose(line: CommandLine) -> None:
    """Find where simulation and measurement disagree, name the missing effect, add it, and show the gap shrink.

    With --init a measured.toml is written for data files, with --check the data are shown and nothing is diagnosed.
    Exit status: 0 no gap or explained, 1 ambiguous, partly explained or unexplained, 2 bad input, 3 the simulator is
    missing or failed.
    """
    with line.complaints() as caught:
        measured, instead = line.files("measured"), line.asked(Instead)
        case = instead.case
        if instead.init:
            return _init(line, measured, instead)
        if case is not None:
            raise OptionError(f"--case {case}: belongs to --init; a measured.toml names its mechanism itself")
        if instead.columns is not None or instead.split:
            option, said = ("--columns", "headings") if instead.columns is not None else ("--split", "a run's part")
            raise OptionError(f"{option}: belongs to --init; a measured.toml says {said} itself")
        if len(measured) > 1:
            raise OptionError(f"{measured[1]}: one measured.toml at a time; with --init several data files")
        if instead.check:
            return _check(line, measured[0], caught)
        from compare.diagnose.data.measured import load_measured
        from compare.diagnose.workflow import diagnose

        folder = line.folder(f"{named_after(measured[0])}-diagnosis", "diagnosis.json", "junit.xml")
        data = load_measured(measured[0])
        diagnosis = line.answer(lambda: line.ask(diagnose, DiagnoseQuestion, measured=data), caught, folder)
    raise typer.Exit(Exit.AGREES if diagnosis.settled else Exit.DISAGREES)


def _only(line: CommandLine, mode: str, *allowed: str) -> None:
    """Raises OptionError for an option that has no part in ``mode``."""
    for name in filter(line.has, line.words):
        if name not in ("measured", *allowed):
            raise OptionError(f"--{name.replace('_', '-')}: has no part in {mode}; leave it out")


def _check(line: CommandLine, measured: Path, caught: list[str]) -> None:
    """The data alone, on a page."""
    from compare.diagnose.data.measured import load_measured
    from compare.diagnose.preview import preview

    _only(line, "--check", "check", "out", "overwrite", "json", "quiet")
    folder = line.folder(f"{named_after(measured)}-data", "data.json", "data.html")
    data = load_measured(measured)
    line.answer(lambda: preview(data), caught, folder)


def _init(line: CommandLine, files: list[Path], asked: Instead) -> None:
    """A measured.toml to begin with."""
    from compare.diagnose.begin import begin

    case = asked.case
    _only(line, "--init", "init", "case", "columns", "split", "out", "overwrite", "quiet")
    if case is None:
        raise OptionError("--init: give the nominal mechanism with --case, a shipped case or a mechanism file")
    where = line.asked(Where)
    target = where.out or Path()
    target = target if target.suffix == ".toml" else target / "measured.toml"
    refuse_inputs(line.context, [target])
    begun = begin(files, case, target.parent, headings=asked.columns, split=asked.split)
    with made_folder(target.parent) as folder, alone_in(folder):
        if not where.overwrite and target.exists():
            raise OutputError(f"{target}: is there already; choose another with --out, or add --overwrite")
        write_atomically(target, begun.text)
    if not line.asked(Shown).quiet:
        for note in begun.notes:
            typer.echo(note, err=True)
        typer.echo(f"written: {target}")
