"""``compare validation update`` and ``check``: the project's own validation report, every shipped case in every engine.

``reports/README.md`` is written from ``reports/validation.json``, which keeps each run's verdict and how near it is to
its tolerance; ``check`` makes all runs again and compares them (that no force moves is what the baselines are for).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compare.cli.options import said
from compare.faults import Exit, complaints

validation = typer.Typer(
    help="The validation report of the project itself: every shipped case in every engine.", no_args_is_help=True
)

Folder = Annotated[Path, typer.Option("--reports", metavar="DIR", help="Folder of the report.")]
WHERE = Path("reports")


@validation.command()
def update(folder: Folder = WHERE) -> None:
    """Run everything and write README.md, validation.json and figures."""
    with complaints():
        from compare.arguments import engines
        from compare.evidence.validation.page import page
        from compare.evidence.validation.runs import run_all
        from compare.evidence.validation.scales import scales
        from compare.files import output_folder, to_json, write_together

        output_folder(folder / "figures", "--reports")
        names, left_out = engines("all")
        said(left_out)
        found = run_all(names, scales())
        drawings = {f"figures/{name}": drawing for name, drawing in found.pop("figures").items()}
        write_together(
            folder, drawings | {"validation.json": to_json(found, indent=1) + "\n", "README.md": page(found)}
        )
        typer.echo(f"{len(found['runs'])} runs: {folder / 'README.md'}")


@validation.command()
def check(
    folder: Folder = WHERE,
    simulator: Annotated[
        str | None, typer.Option(help="Engine whose runs are made again; left out (or all), those of every one.")
    ] = None,
) -> None:
    """Run everything again and say what is not as in the committed report: verdicts, shares of tolerances, tables, the
    page itself.

    Exit status: 0 all as it was, 1 something differs, 2 the report is damaged, 3 a simulator of the report is missing.
    """
    with complaints():
        from compare.arguments import engines
        from compare.evidence.validation.runs import run_all
        from compare.evidence.validation.scales import checked
        from compare.evidence.validation.stored import differences, looked_at, other_versions, read, stale_page

        stored = read(folder / "validation.json")
        names, not_installed = engines(simulator or "all")
        said(not_installed)
        found = run_all(names, checked())
        changed = [*stale_page(folder / "README.md", stored), *differences(stored, found)]
        for line in [*changed, *other_versions(stored, found)]:
            typer.echo(line)
        done, left_out = looked_at(stored, found)
        typer.echo(
            f"{done}; {len(changed)} {'differs' if len(changed) == 1 else 'differ'} from {folder / 'validation.json'}"
        )
        if left_out:
            typer.echo(f"not looked at: {left_out}", err=True)
    if changed:
        raise typer.Exit(Exit.DISAGREES)
    raise typer.Exit(Exit.SIMULATOR_FAILED if left_out and simulator in (None, "all") else Exit.AGREES)
