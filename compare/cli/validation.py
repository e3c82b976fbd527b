"""``compare validation update`` and ``check``: the project's own validation report, every shipped case in every engine.

``reports/README.md`` is written from ``reports/validation.json``, which keeps each run's verdict and how near it is to
its tolerance; ``check`` makes all runs again and compares them (that no force moves is what the baselines are for).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compare.cli.options import Json, Quiet, place, said
from compare.cli.publish import show
from compare.faults import complaints

validation = typer.Typer(
    help="The validation report of the project itself: every shipped case in every engine.", no_args_is_help=True
)

Folder = Annotated[Path, typer.Option("--reports", parser=place, metavar="DIR", help="Folder of the report.")]
Data = Annotated[
    Path | None,
    typer.Option(
        "--data",
        parser=place,
        metavar="DIR",
        help="Folder of what others recorded (adams-parallel-robot, emps, siconos-slider-crank); left out, it is not"
        " made again.",
    ),
]
WHERE = Path("reports")


@validation.command()
def update(folder: Folder = WHERE, data: Data = None, json: Json = False, quiet: Quiet = False) -> None:
    """Run everything and write README.md, validation.json and figures."""
    with complaints():
        from compare.evidence.stored import asked
        from compare.evidence.validation.check import update_validation

        said(asked("all")[1])
        show(update_validation(folder, _there(data)), json=json, quiet=quiet, place=folder)


@validation.command()
def check(
    folder: Folder = WHERE,
    simulator: Annotated[
        str | None,
        typer.Option(help="Engine whose runs are made again; left out (or all), those of every one."),
    ] = None,
    data: Data = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make every run again, and report what is not as the committed report has it.

    Exit status: 0 nothing differs, 1 something does, 2 the report is missing or damaged, 3 an engine is not installed.
    """
    with complaints():
        from compare.evidence.stored import asked, status
        from compare.evidence.validation.check import check_validation

        names = simulator or "all"
        said(asked(names)[1])
        found = check_validation(names, folder, _there(data))
        show(found, json=json, quiet=quiet)
        said(f"not looked at: {'; '.join(found.left_out)}" for _ in found.left_out[:1])
    raise typer.Exit(status(found, names))


def _there(data: Path | None) -> Path | None:
    """The folder, which exists.  Raises OptionError."""
    from compare.faults import OptionError

    if data is None:
        return None
    if not data.is_dir():
        raise OptionError(f"--data {data}: there is no such folder")
    from compare.evidence.validation.published import FOLDERS

    if not any((data / name).is_dir() for name in FOLDERS):
        raise OptionError(f"--data {data}: has none of {', '.join(FOLDERS)}; give the folder that they are in")
    return data
