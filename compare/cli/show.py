"""``compare show``: both sides of one number of a cross-check and where each comes from, or what a diagnosis says."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compare.faults import OptionError, complaints

if TYPE_CHECKING:
    from compare.results.crosscheck import CrossCheck
    from compare.results.diagnosis import Diagnosis


def show(
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
) -> None:
    """Print one number of a result: both sides, the equation and the module, the engine and its settings, and the
    verdict.  Of a diagnosis print what it says, or a signal's residual before and after by run.

    Exit status: 0 shown, 2 bad input.
    """
    with complaints():
        from compare.results.crosscheck import CrossCheck
        from compare.results.diagnosis import Diagnosis
        from compare.results.kinds import read_as

        document = read_as(result, (CrossCheck, Diagnosis))
        if isinstance(document, Diagnosis):
            given = {"--at": at, "--joint": joint, "--simulator": simulator}
            typer.echo(_said(document, signal, [name for name, value in given.items() if value is not None]))
        elif isinstance(document, CrossCheck):
            typer.echo(_number(document, signal, at, joint, simulator))


def _number(result: CrossCheck, signal: str | None, at: float | None, joint: str | None, simulator: str | None) -> str:
    from compare.report.provenance import explain

    for option, value, such in (("--signal", signal, "reaction_B_angle"), ("--at", at, "30")):
        if value is None:
            raise OptionError(f"{option} is missing; a number of a result takes {option}, such as {option} {such}")
    return explain(result, signal or "", at or 0.0, joint, simulator)


def _said(result: Diagnosis, signal: str | None, refused: list[str]) -> str:
    from compare.report.diagnosis_text import residual_lines, terminal_lines

    if refused:
        raise OptionError(f"{refused[0]}: a diagnosis takes --signal alone; leave {refused[0]} out")
    return "\n".join(terminal_lines(result) if signal is None else residual_lines(result, signal))
