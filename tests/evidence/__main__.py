"""``python -m tests.evidence``: what the project says of itself, made again and compared with what is stored.

``validation`` runs every shipped case in every engine: ``reports/README.md`` is written from
``reports/validation.json``, which keeps each run's verdict and how near it is to its tolerance (that no force moves is
what the baselines are for).  ``scoreboard`` says how well the diagnosis does on data whose truth it has not seen.
Heavy imports wait until a command needs them.
"""

from __future__ import annotations

import math
import os
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from compare.cli.pipe import reader_may_go
from compare.cli.publish import resumed, say, show
from compare.faults import OptionError, complaints
from compare.files import made_folder
from compare.progress import progress_bar

app = typer.Typer(
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="What the project says of itself: stored in reports/, made again and compared.",
    no_args_is_help=True,
)
validation = typer.Typer(
    help="The validation report of the project itself: every shipped case in every engine.", no_args_is_help=True
)
scoreboard = typer.Typer(
    help="The diagnosis on data in which effects are hidden: scores and thresholds.", no_args_is_help=True
)
app.add_typer(validation, name="validation")
app.add_typer(scoreboard, name="scoreboard")

Json = Annotated[
    bool, typer.Option("--json", help="Print the result file (JSON) to standard output, and nothing else there.")
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print nothing to standard output; files are written as without it.")
]


def place(text: str | Path) -> Path:
    """The path of an option.  Raises BadParameter for an empty one, which would be the current folder."""
    if not str(text).strip():
        raise typer.BadParameter("it is empty; name a folder, or give . for the current one")
    return Path(text)


Folder = Annotated[Path, typer.Option("--reports", parser=place, metavar="DIR", help="Folder of the report.")]
Data = Annotated[
    Path | None,
    typer.Option(
        parser=place,
        metavar="DIR",
        help="Folder of what others recorded (adams-parallel-robot, emps, siconos-slider-crank); left out, it is not"
        " made again.",
    ),
]
Workers = Annotated[int | None, typer.Option(min=1, help="Processes [one a core].")]
REPORTS = Path("reports")
BOARD = REPORTS / "scoreboard"


@validation.command("update")
def update_validation(folder: Folder = REPORTS, data: Data = None, json: Json = False, quiet: Quiet = False) -> None:
    """Run everything and write README.md, validation.json and figures."""
    with complaints():
        from tests.evidence.stored import asked
        from tests.evidence.validation import check

        say(asked("all")[1])
        show(check.update_validation(folder, _there(data)), json=json, quiet=quiet, place=folder)


@validation.command("figures")
def draw_figures(
    cases: Annotated[list[str] | None, typer.Argument(help="Shipped cases [all].")] = None, folder: Folder = REPORTS
) -> None:
    """Run what the figures show alone, and draw them again."""
    with complaints():
        from analytic.writing import write_atomically
        from compare.judge.tolerances import load_tolerances
        from tests.evidence.pages.validation import drawn
        from tests.evidence.stored import asked
        from tests.evidence.validation.runs import DRAWN, cross_checks

        for case, _, check in cross_checks(asked("all")[0], load_tolerances(), cases or (), (DRAWN,)):
            for name, drawing in drawn(check).items():
                write_atomically(folder / "figures" / f"{case}-{name}.svg", drawing)


@validation.command("check")
def check_validation(
    folder: Folder = REPORTS,
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
        from tests.evidence.stored import asked, status
        from tests.evidence.validation import check

        names = simulator or "all"
        say(asked(names)[1])
        found = check.check_validation(names, folder, _there(data))
        show(found, json=json, quiet=quiet)
        say(f"not looked at: {'; '.join(found.left_out)}" for _ in found.left_out[:1])
    raise typer.Exit(status(found, names))


def _there(data: Path | None) -> Path | None:
    """The folder, which exists.  Raises OptionError."""
    if data is None:
        return None
    if not data.is_dir():
        raise OptionError(f"--data {data}: there is no such folder")
    from tests.evidence.validation.published import FOLDERS

    if not any((data / name).is_dir() for name in FOLDERS):
        raise OptionError(f"--data {data}: has none of {', '.join(FOLDERS)}; give the folder that they are in")
    return data


@scoreboard.command("update")
def update_scoreboard(
    context: typer.Context,
    folder: Folder = BOARD,
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
        from tests.evidence.scoreboard import check
        from tests.evidence.scoreboard.board import FULL

        with resumed(), progress_bar() as bar:
            board = check.update_scoreboard(
                folder,
                {kind: context.params[kind.replace("-", "_")] for kind in FULL},
                minutes=minutes or math.inf,
                workers=workers,
                progress=lambda done, total: bar("sets", done, total),
            )
        show(board, json=json, quiet=quiet, place=folder)


@scoreboard.command("check")
def check_scoreboard(
    folder: Folder = BOARD,
    workers: Workers = None,
    every: Annotated[int, typer.Option(min=1, help="One set in so many.")] = 20,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Do a share of the sets again; exit 1 and say which, where the outcome is worse than in the committed report."""
    with complaints():
        from tests.evidence.scoreboard import check
        from tests.evidence.stored import status

        with progress_bar() as bar:
            found = check.check_scoreboard(
                folder, every=every, workers=workers, progress=lambda done, total: bar("sets", done, total)
            )
        show(found, json=json, quiet=quiet)
    raise typer.Exit(status(found))


@scoreboard.command("show")
def show_set(
    seed: Annotated[int, typer.Argument(min=0, help="Seed of the set.")],
    out: Annotated[
        Path | None, typer.Option(parser=place, metavar="PATH", help="Folder in which to leave the data and the seal.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Make one set, diagnose it, and print what was said beside the truth."""
    with complaints(), tempfile.TemporaryDirectory() as scratch:
        from tests.evidence.results.scoreboard import HiddenSet
        from tests.evidence.scoreboard.board import scored
        from tests.evidence.scoreboard.record import make_set
        from tests.evidence.scoreboard.rigs import Rejected
        from tests.evidence.scoreboard.score import opened

        with made_folder(out or Path(scratch)) as folder:
            try:
                make_set(seed, folder / "data", folder / "seal")
            except Rejected as error:
                raise OptionError(f"{error}; choose another seed") from None
            found = HiddenSet(truth=opened(folder / "seal"), scored=scored(folder / "data", folder / "seal"))
        show(found, json=json, quiet=quiet)


@app.command()
def schemas() -> None:
    """Write the JSON Schema files of the evidence's documents."""
    from compare.results.schemas import write
    from tests.evidence.results import FOLDER, documents

    write(FOLDER, documents())


def main() -> None:
    """Entry point of the command."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as compare does
    with reader_may_go():
        app(prog_name="python -m tests.evidence")


if __name__ == "__main__":
    main()
