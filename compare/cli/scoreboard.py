"""``compare scoreboard update``, ``check`` and ``show``: how well the diagnosis does on data whose truth it has not
seen.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer

from compare.faults import Exit, OptionError, complaints

scoreboard = typer.Typer(
    help="The diagnosis on data in which effects are hidden: scores and thresholds.", no_args_is_help=True
)

Folder = Annotated[Path, typer.Option("--reports", metavar="DIR", help="Folder of the report.")]
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
) -> None:
    """Make, diagnose and score all sets; write README.md, scoreboard.json and a figure.  What was interrupted goes on
    where it stopped.
    """
    with complaints():
        from compare.arguments import cores
        from compare.cli.progress import progress_bar
        from compare.evidence.scoreboard.board import FULL, run_all, seeds
        from compare.files import output_folder

        given = {"effects": effects, "none": none, "outside": outside, "alias": alias}
        wanted = seeds({kind: FULL[kind] if count is None else count for kind, count in given.items()})
        records = output_folder(output_folder(folder) / "runs")
        with progress_bar() as bar:
            results = run_all(wanted, records, workers or cores(), lambda done, total: bar("sets", done, total))
        board = publish(results, folder)
        shutil.rmtree(records)
        missed = [row["what"] for row in board["thresholds"] if not row["met"]]
        typer.echo(
            f"{len(results)} sets, {len(missed)} of {len(board['thresholds'])} thresholds missed:"
            f" {folder / 'README.md'}"
        )


@scoreboard.command()
def check(
    folder: Folder = WHERE,
    workers: Workers = None,
    every: Annotated[int, typer.Option(min=1, help="One set in so many.")] = 20,
) -> None:
    """Do a share of the sets again; exit 1 and say which, where the outcome is worse than in the committed report."""
    with complaints():
        from compare.arguments import cores
        from compare.evidence.scoreboard.board import digest, run_all

        board = read(folder / "scoreboard.json")
        stored = {r["seed"]: r for r in board["results"]}
        wanted = sorted(stored)[::every]
        found = run_all(wanted, None, workers or cores())
        worse = [r for r in found if stored[r["seed"]]["good"] and not r["good"]]
        for r in worse:
            typer.echo(f"seed {r['seed']}: was {stored[r['seed']]['outcome']}, is {r['outcome']}")
        code = "of this very code" if board.get("code") == digest() else "of other code than this"
        typer.echo(f"{len(found)} sets, {len(worse)} worse than in {folder / 'scoreboard.json'}, which is {code}")
    raise typer.Exit(Exit.DISAGREES if worse else Exit.AGREES)


@scoreboard.command()
def show(
    seed: Annotated[int, typer.Argument(min=0, help="Seed of the set.")],
    out: Annotated[Path | None, typer.Option(help="Folder in which to leave the data and the seal.")] = None,
) -> None:
    """Make one set, diagnose it, and print what was said beside the truth."""
    with complaints(), tempfile.TemporaryDirectory() as scratch:
        from compare.evidence.scoreboard.board import scored
        from compare.evidence.scoreboard.record import make
        from compare.evidence.scoreboard.rigs import Rejected
        from compare.evidence.scoreboard.score import opened
        from compare.files import output_folder, to_json

        folder = output_folder(out or Path(scratch))
        try:
            make(seed, folder / "data", folder / "seal")
        except Rejected as error:
            raise OptionError(f"{error}; choose another seed") from None
        typer.echo(
            to_json({"truth": opened(folder / "seal"), "scored": scored(folder / "data", folder / "seal")}, indent=1)
        )


def publish(results: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
    """Write the report of these results; returns what scoreboard.json holds."""
    from compare.evidence.scoreboard.board import digest, thresholds
    from compare.evidence.scoreboard.page import figure, page
    from compare.files import to_json, write_atomically
    from compare.report.svg import draw
    from sim_models.engine import ENGINES, declared, installed_version

    versions = {name: installed_version(declared(name).package) for name in ENGINES}
    by_simulator = {
        s: thresholds(r for r in results if r.get("simulator") == s)
        for s in ENGINES
        if any(r.get("simulator") == s for r in results)
    }
    board = {
        "schema": 1,
        "versions": versions,
        "code": digest(),
        "thresholds": thresholds(results),
        "by_simulator": by_simulator,
        "results": results,
    }
    plain = json.loads(to_json(board))
    write_atomically(folder / "sizes.svg", draw(figure(plain["results"])))
    write_atomically(folder / "scoreboard.json", to_json(plain, indent=1) + "\n")
    write_atomically(folder / "README.md", page(plain))
    return board


def read(path: Path) -> dict[str, Any]:
    """A stored board.  Raises OptionError where there is none, or it is damaged."""
    from analytic.mechanism.reading import read_json

    try:
        found = read_json(path)
        if found["schema"] != 1 or not all({"seed", "outcome", "good"} <= set(r) for r in found["results"]):
            raise ValueError("not a scoreboard of schema 1")
    except (ValueError, KeyError, TypeError) as error:
        raise OptionError(
            f"--reports: {path} cannot be used ({error}); write it with compare scoreboard update"
        ) from None
    return dict(found)
