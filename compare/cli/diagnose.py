"""``compare diagnose``: which effect the model lacks."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from compare.cli.folders import Overwrite, named_after, refuse_inputs, result_folder
from compare.cli.options import Json, Quiet, place
from compare.cli.publish import command_line, publish
from compare.faults import Exit, OptionError, complaints
from compare.files import OutputError, alone_in, made_folder, write_atomically
from compare.progress import progress_bar


class Others(StrEnum):
    """The other engines of --others."""

    all = "all"
    none = "none"


def diagnose(
    context: typer.Context,
    measured: Annotated[
        list[Path],
        typer.Argument(
            metavar="MEASURED.TOML", help="Runs, their data files and the nominal mechanism; with --init data files."
        ),
    ],
    check: Annotated[
        bool, typer.Option("--check", help="Show the data beside the nominal model; diagnose nothing.")
    ] = False,
    init: Annotated[
        bool, typer.Option("--init", help="Write a measured.toml for these data files, as far as it can be guessed.")
    ] = False,
    case: Annotated[
        str | None, typer.Option(help="With --init: the nominal mechanism, a shipped case or a file.")
    ] = None,
    simulator: Annotated[
        str, typer.Option(help="Engine that simulates before and after (see: compare simulators).")
    ] = "mujoco",
    only: Annotated[
        list[str] | None, typer.Option(metavar="EFFECT[@WHERE]", help="Consider nothing else; may be repeated.")
    ] = None,
    exclude: Annotated[
        list[str] | None, typer.Option(metavar="EFFECT[@WHERE]", help="Rule an effect out; may be repeated.")
    ] = None,
    adopt: Annotated[
        bool, typer.Option("--adopt", help="Put the law that is proposed into the model and diagnose again with it.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            parser=place, metavar="PATH", help="Folder of the report [reports/<MEASURED>-diagnosis, then the options]."
        ),
    ] = None,
    overwrite: Overwrite = False,
    others: Annotated[
        Others, typer.Option(help="Engines that simulate the explanation too: every installed one, or none.")
    ] = Others.all,
    budget: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="End the search then, with the best so far [when it is done]."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes for the simulations [2, or the cores that there are].")
    ] = None,
) -> None:
    """Find where simulation and measurement disagree, name the missing effect, add it, and show the gap shrink.

    With --init a measured.toml is written for data files, with --check the data are shown and nothing is diagnosed.
    Exit status: 0 no gap or explained, 1 ambiguous, partly explained or unexplained, 2 bad input, 3 the simulator is
    missing or failed.
    """
    with complaints():
        if init:
            return _init(context, measured, case, out, overwrite, quiet)
        if case is not None:
            raise OptionError(f"--case {case}: belongs to --init; a measured.toml names its mechanism itself")
        if len(measured) > 1:
            raise OptionError(f"{measured[1]}: one measured.toml at a time; with --init several data files")
        if check:
            return _check(context, measured[0], out, overwrite, json, quiet)
        from compare.diagnose.data.measured import load_measured
        from compare.diagnose.workflow import diagnose as run

        data = load_measured(measured[0])
        folder = result_folder(
            context, f"{named_after(measured[0])}-diagnosis", "diagnosis.json", out, overwrite, ("junit.xml",)
        )
        with progress_bar() as progress:
            found = run(
                data,
                simulator,
                only=only or (),
                exclude=exclude or (),
                adopt=adopt,
                others=others is Others.all,
                workers=workers,
                budget=budget,
                progress=progress,
            )
        told = found.model_copy(update={"command": command_line()})
        publish(told, folder, json=json, quiet=quiet, overwrite=overwrite, context=context)
    raise typer.Exit(Exit.AGREES if found.settled else Exit.DISAGREES)


def _only(context: typer.Context, mode: str, *allowed: str) -> None:
    """Raises OptionError for an option that has no part in ``mode``."""
    for name in context.params:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE" and name not in ("measured", *allowed):
            raise OptionError(f"--{name.replace('_', '-')}: has no part in {mode}; leave it out")


def _check(context: typer.Context, measured: Path, out: Path | None, overwrite: bool, json: bool, quiet: bool) -> None:
    """The data alone, on a page."""
    from compare.diagnose.data.measured import load_measured
    from compare.diagnose.preview import preview

    _only(context, "--check", "check", "out", "overwrite", "json", "quiet")
    data = load_measured(measured)
    folder = result_folder(context, f"{named_after(measured)}-data", "data.json", out, overwrite, ("data.html",))
    found = preview(data).model_copy(update={"command": command_line()})
    publish(found, folder, json=json, quiet=quiet, overwrite=overwrite, context=context)


def _init(
    context: typer.Context, files: list[Path], case: str | None, out: Path | None, overwrite: bool, quiet: bool
) -> None:
    """A measured.toml to begin with."""
    from compare.diagnose.begin import begin

    _only(context, "--init", "init", "case", "out", "overwrite", "quiet")
    if case is None:
        raise OptionError("--init: give the nominal mechanism with --case, a shipped case or a mechanism file")
    target = (out or Path()) / "measured.toml" if out is None or out.suffix != ".toml" else out
    refuse_inputs(context, [target])
    begun = begin(files, case, target.parent)
    with made_folder(target.parent) as folder, alone_in(folder):
        if not overwrite and target.exists():
            raise OutputError(f"{target}: is there already; choose another with --out, or add --overwrite")
        write_atomically(target, begun.text)
    for note in begun.notes if not quiet else ():
        typer.echo(note, err=True)
    if not quiet:
        typer.echo(f"written: {target}")
