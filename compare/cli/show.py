"""``compare show``: both sides of one number of a cross-check and where each comes from, or what a diagnosis says."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from compare.cli.options import Json, Quiet
from compare.cli.publish import show as show_document
from compare.faults import complaints


def show(
    context: typer.Context,
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="A result.json or a diagnosis.json.")],
    signal: Annotated[
        str | None,
        typer.Option(help="Name of the signal, such as reaction_B_angle; of a diagnosis it may be left out."),
    ] = None,
    at: Annotated[
        float | None, typer.Option(help="Crank angle (deg) of a result; time (s) where the linkage swings freely.")
    ] = None,
    joint: Annotated[str | None, typer.Option(help="Joint model; left out, all that the result has.")] = None,
    simulator: Annotated[str | None, typer.Option(help="Engine; left out, all that the result has.")] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print one number of a result: both sides, the equation and the module, the engine and its settings, and the
    verdict.  Of a diagnosis print what it says, or a signal's residual before and after by run.

    Exit status: 0 shown, 2 bad input.
    """
    with complaints(context):
        from compare.results.crosscheck import CrossCheck
        from compare.show import read, show

        document = read(result)
        over_time = isinstance(document, CrossCheck) and document.over_time
        where = at if at is None or over_time else math.radians(at)
        found = show(document, signal, at=where, joint_model=joint, simulator=simulator)
        show_document(found, json=json, quiet=quiet)
