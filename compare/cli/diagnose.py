"""``compare diagnose``: which effect the model lacks."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from compare.cli.folders import Overwrite, result_folder
from compare.cli.progress import progress_bar
from compare.faults import Exit, complaints
from compare.files import output_folder, to_json, write_atomically

SETTLED = ("no gap", "explained")


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
    out: Annotated[
        Path | None, typer.Option(help="Folder of the report [reports/<mechanism>-diagnosis, then the options].")
    ] = None,
    overwrite: Overwrite = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print diagnosis.json to standard output, and nothing else there.")
    ] = False,
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
        folder = result_folder(context, f"{data.mechanism.name}-diagnosis", "diagnosis.json", out, overwrite)
        with progress_bar() as progress:
            found = run(
                data, simulator, only=only or (), exclude=exclude or (), workers=workers,
                command=shlex.join(["compare", *sys.argv[1:]]), progress=progress,
            )  # fmt: skip
        publish(found.result, found.explained, folder, json)
    raise typer.Exit(Exit.AGREES if found.result["verdict"] in SETTLED else Exit.DISAGREES)


def publish(result: dict[str, Any], explained: Any, folder: Path, json: bool) -> None:
    """Write diagnosis.json, the pages and explained.toml, each whole or not at all; a few lines on the terminal."""
    from analytic.mechanism.file import dumps
    from compare.report.diagnosis_page import diagnosis_html
    from compare.report.diagnosis_text import diagnosis_md, terminal_lines

    text = to_json(result)
    files = {
        "diagnosis.json": text,
        "explained.toml": dumps(explained),
        "diagnosis.md": diagnosis_md(result),
        "diagnosis.html": diagnosis_html(result),
    }
    folder = output_folder(folder)
    for name, content in files.items():
        write_atomically(folder / name, content)
    if json:
        typer.echo(text)
        return
    for line in terminal_lines(result):
        typer.echo(line)
    typer.echo(f"report: {folder / 'diagnosis.html'}")
