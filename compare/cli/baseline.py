"""``compare baseline update`` and ``check``: reaction forces stored to be reviewed, and whatever has moved since."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compare.cli.folders import refuse_inputs
from compare.cli.options import Json, Quiet, place, said
from compare.cli.publish import show
from compare.faults import OptionError, complaints, printable
from compare.files import made_folder, write_atomically
from compare.progress import progress_bar

if TYPE_CHECKING:
    from compare.results.baselines import Baselines

baseline = typer.Typer(
    help="Regression on reaction-force angles: store them, and find what has moved.", no_args_is_help=True
)

Case = Annotated[str | None, typer.Option(help="Shipped case or a mechanism file; left out, every shipped case.")]
Simulator = Annotated[str | None, typer.Option(help="Engine; left out (or all), every one that is installed.")]
Folder = Annotated[Path, typer.Option("--baselines", parser=place, metavar="DIR", help="Folder of the baseline files.")]
Junit = Annotated[Path | None, typer.Option("--junit", parser=place, metavar="FILE", help="Write a JUnit file too.")]
ResultFiles = Annotated[
    list[Path] | None,
    typer.Option("--results", metavar="FILE", help="Another program's results of the case in place of an engine's."),
]
Map = Annotated[Path | None, typer.Option("--map", metavar="FILE", help="What the columns of --results are.")]
WHERE = Path("reports") / "baselines"


@baseline.command()
def check(
    context: typer.Context,
    case: Case = None,
    simulator: Simulator = None,
    folder: Folder = WHERE,
    results: ResultFiles = None,
    map_: Map = None,
    junit: Junit = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run every case in every engine, and report all reaction forces that are not where the baseline has them.

    Exit status: 0 nothing moved, 1 something moved, 2 a baseline is missing or damaged, 3 a simulator is missing or
    failed.
    """
    with complaints(context):
        from compare.baseline.check import check_baselines

        refuse_inputs(context, [junit] if junit is not None else [], "--junit")
        with nullcontext() if junit is None else made_folder(junit.parent, "--junit"):
            with progress_bar() as progress:
                found = check_baselines(
                    case, simulator or "all", folder, results=_recorded(results, case), map=map_, progress=progress
                )
            if junit is not None:
                from compare.report.baselines import junit as junit_of

                write_atomically(junit, junit_of(found))
    _end(found, json, quiet)


@baseline.command()
def update(
    context: typer.Context,
    case: Case = None,
    simulator: Simulator = None,
    folder: Folder = WHERE,
    results: ResultFiles = None,
    map_: Map = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write the baseline of every case in every engine; numbers that have not moved, and files without any that have,
    stay as they are.

    Exit status: 0 written, 2 bad input, 3 a simulator is missing or failed.
    """
    with complaints(context):
        from compare.baseline.check import update_baselines

        with progress_bar() as progress:
            found = update_baselines(
                case, simulator or "all", folder, results=_recorded(results, case), map=map_, progress=progress
            )
    _end(found, json, quiet)


def _recorded(results: list[Path] | None, case: str | None) -> list[Path] | None:
    if results and case is None:
        raise OptionError("--results: they are of one case; name it with --case")
    return results or None


def _end(found: Baselines, json: bool, quiet: bool) -> None:
    """Print what was found, say what was not, and leave with the gravest status."""
    from compare.baseline.check import status

    show(found, json=json, quiet=quiet)
    faults = [entry.why for entry in found.entries if entry.status in ("unusable", "failed")]
    said(line for line in found.left_out if line not in faults)
    said(f"compare: {printable(why)}" for why in faults)
    raise typer.Exit(status(found))
