"""``compare scoreboard update``, ``check`` and ``show``: how well the diagnosis does on data whose truth it has not
seen.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from compare.cli.options import Json, Quiet, place
from compare.cli.publish import resumed
from compare.cli.publish import show as show_document
from compare.faults import OptionError, complaints
from compare.progress import progress_bar

scoreboard = typer.Typer(
    help="The diagnosis on data in which effects are hidden: scores and thresholds.", no_args_is_help=True
)

Folder = Annotated[Path, typer.Option("--reports", parser=place, metavar="DIR", help="Folder of the report.")]
Workers = Annotated[int | None, typer.Option(min=1, help="Processes [one a core].")]
WHERE = Path("reports") / "scoreboard"


@scoreboard.command()
def update(
    folder: Folder = WHERE,
    workers: Workers = None,
    effects: Annotated[int | None, typer.Option(min=0, help="Sets with effects of the vocabulary [220].")] = None,
    none: Annotated[int | None, typer.Option(min=0, help="Sets without any effect [300].")] = None,
    outside: Annotated[int | None, typer.Option(min=0, help="Sets with something outside the vocabulary [30].")] = None,
    alias: Annotated[
        int | None, typer.Option(min=0, help="Sets in which clearance and length may be aliases [8].")
    ] = None,
    machines: Annotated[
        int | None, typer.Option(min=0, help="Sets with effects of real machines [30 for each of them].")
    ] = None,
    unnamed: Annotated[int | None, typer.Option(min=0, help="Sets with something that never had a name [150].")] = None,
    slightly_off: Annotated[int | None, typer.Option(min=0, help="Sets with everything slightly off [60].")] = None,
    coarse: Annotated[int | None, typer.Option(min=0, help="Sets of coarse encoders and few samples [60].")] = None,
    coloured: Annotated[int | None, typer.Option(min=0, help="Sets with drift, hum and filters [60].")] = None,
    per_run: Annotated[int | None, typer.Option(min=0, help="Sets with faults of sensors in each run [60].")] = None,
    large: Annotated[int | None, typer.Option(min=0, help="Sets in which large effects are missing [60].")] = None,
    several: Annotated[int | None, typer.Option(min=0, help="Sets with several drives [60].")] = None,
    rattling: Annotated[int | None, typer.Option(min=0, help="Sets of rigs that rattle [60].")] = None,
    still: Annotated[int | None, typer.Option(min=0, help="Sets of rigs that only seem to rattle [60].")] = None,
    minutes: Annotated[
        float | None,
        typer.Option(min=1.0, help="Stop after about so long; sets not reached keep their scores of other code."),
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make, diagnose and score all sets; write README.md, scoreboard.json and a figure.  What is stored of this very
    code is not done again, and what was interrupted goes on where it stopped.
    """
    with complaints():
        from compare.evidence.scoreboard.check import update_scoreboard

        given = {"effects": effects, "none": none, "outside": outside, "alias": alias}
        given |= {"machines": machines, "unnamed": unnamed}
        given |= {"slightly-off": slightly_off, "coarse": coarse, "coloured": coloured}
        given |= {"per-run": per_run, "large": large, "several": several}
        given |= {"rattling": rattling, "still": still}
        with resumed(), progress_bar() as bar:
            board = update_scoreboard(
                folder,
                given,
                minutes=minutes or math.inf,
                workers=workers,
                progress=lambda done, total: bar("sets", done, total),
            )
        show_document(board, json=json, quiet=quiet, place=folder)


@scoreboard.command()
def check(
    folder: Folder = WHERE,
    workers: Workers = None,
    every: Annotated[int, typer.Option(min=1, help="One set in so many.")] = 20,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Do a share of the sets again; exit 1 and say which, where the outcome is worse than in the committed report."""
    with complaints():
        from compare.evidence.scoreboard.check import check_scoreboard
        from compare.evidence.stored import status

        with progress_bar() as bar:
            found = check_scoreboard(
                folder, every=every, workers=workers, progress=lambda done, total: bar("sets", done, total)
            )
        show_document(found, json=json, quiet=quiet)
    raise typer.Exit(status(found))


@scoreboard.command()
def show(
    seed: Annotated[int, typer.Argument(min=0, help="Seed of the set.")],
    out: Annotated[
        Path | None, typer.Option(parser=place, metavar="PATH", help="Folder in which to leave the data and the seal.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make one set, diagnose it, and print what was said beside the truth."""
    with complaints(), tempfile.TemporaryDirectory() as scratch:
        from compare.evidence.scoreboard.board import scored
        from compare.evidence.scoreboard.record import make_set
        from compare.evidence.scoreboard.rigs import Rejected
        from compare.evidence.scoreboard.score import opened
        from compare.files import made_folder
        from compare.results.scoreboard import HiddenSet

        with made_folder(out or Path(scratch)) as folder:
            try:
                make_set(seed, folder / "data", folder / "seal")
            except Rejected as error:
                raise OptionError(f"{error}; choose another seed") from None
            found = HiddenSet(truth=opened(folder / "seal"), scored=scored(folder / "data", folder / "seal"))
        show_document(found, json=json, quiet=quiet)
