"""``compare diagnose``: which effect the model lacks."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from compare.cli.folders import Overwrite, result_folder
from compare.cli.options import Json, Quiet, place
from compare.cli.progress import progress_bar
from compare.cli.publish import command_line, publish
from compare.faults import Exit, complaints


class Others(StrEnum):
    """The other engines of --others."""

    all = "all"
    none = "none"


def diagnose(
    context: typer.Context,
    measured: Annotated[
        Path, typer.Argument(metavar="MEASURED.TOML", help="Runs, their data files and the nominal mechanism.")
    ],
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
            parser=place, metavar="PATH", help="Folder of the report [reports/<mechanism>-diagnosis, then the options]."
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

    Exit status: 0 no gap or explained, 1 ambiguous, partly explained or unexplained, 2 bad input, 3 the simulator is
    missing or failed.
    """
    with complaints():
        from compare.diagnose.data.measured import load_measured
        from compare.diagnose.workflow import diagnose as run

        data = load_measured(measured)
        folder = result_folder(
            context, f"{data.mechanism.name}-diagnosis", "diagnosis.json", out, overwrite, ("junit.xml",)
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
        publish(
            found.model_copy(update={"command": command_line()}), folder, json=json, quiet=quiet, overwrite=overwrite
        )
    raise typer.Exit(Exit.AGREES if found.settled else Exit.DISAGREES)
