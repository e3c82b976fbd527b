"""``compare show``: both sides of one number of a result, and where each comes from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compare.faults import complaints


def show(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="A result.json.")],
    signal: Annotated[str, typer.Option(help="Name of the signal, such as reaction_B_angle.")],
    at: Annotated[float, typer.Option(help="Crank angle (deg); time (s) where the linkage swings freely.")],
    joint: Annotated[str | None, typer.Option(help="Joint model; left out, all that the result has.")] = None,
    simulator: Annotated[str | None, typer.Option(help="Engine; left out, all that the result has.")] = None,
) -> None:
    """Print one number of a result: both sides, the equation and the module, the engine and its settings, and the
    verdict.

    Exit status: 0 shown, 2 bad input.
    """
    with complaints():
        from compare.report.provenance import explain
        from compare.results.crosscheck import CrossCheck

        typer.echo(explain(CrossCheck.read(result), signal, at, joint, simulator))
