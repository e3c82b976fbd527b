"""``compare baseline update`` and ``check``: reaction forces stored to be reviewed, and whatever has moved since."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compare.cli.options import load_case, said
from compare.faults import Exit, complaints
from compare.files import file_name, output_folder, write_atomically

if TYPE_CHECKING:
    from analytic.mechanism import Mechanism
    from compare.evidence.baseline.file import Baseline, Run
    from compare.evidence.baseline.moved import Moved
    from compare.runs import Resolve

baseline = typer.Typer(
    help="Regression on reaction-force angles: store them, and find what has moved.", no_args_is_help=True
)

Case = Annotated[str | None, typer.Option(help="Shipped case or a mechanism file; left out, every shipped case.")]
Simulator = Annotated[str | None, typer.Option(help="Engine; left out (or all), every one that is installed.")]
Folder = Annotated[Path, typer.Option("--baselines", metavar="DIR", help="Folder of the baseline files.")]
WHERE = Path("reports") / "baselines"


@baseline.command()
def check(case: Case = None, simulator: Simulator = None, folder: Folder = WHERE) -> None:
    """Run every case in every engine, and report all reaction forces that are not where the baseline has them.

    Exit status: 0 nothing moved, 1 something moved, 2 a baseline is missing or damaged, 3 a simulator is missing or
    failed.
    """
    _each(case, simulator, lambda mechanism, engine: check_one(mechanism, engine, folder, typed=case))


@baseline.command()
def update(case: Case = None, simulator: Simulator = None, folder: Folder = WHERE) -> None:
    """Write the baseline of every case in every engine; numbers that have not moved, and files without any that have,
    stay as they are.

    Exit status: 0 written, 2 bad input, 3 a simulator is missing or failed.
    """
    with complaints():
        output_folder(folder, "--baselines")
    _each(case, simulator, lambda mechanism, engine: update_one(mechanism, engine, folder, typed=case))


def _each(case: str | None, simulator: str | None, work: Callable[[Mechanism, str], bool]) -> None:
    """Work on every pair of case and engine, whatever becomes of the others; leave with the gravest status."""
    with complaints():
        from analytic.mechanism.file import shipped_cases
        from compare.arguments import engines

        mechanisms = [load_case(name) for name in ([case] if case is not None else shipped_cases())]
        names, left_out = engines(simulator or "all")
        said(left_out)
    worst = Exit.AGREES
    for mechanism in mechanisms:
        for engine in names:
            try:
                with complaints():
                    status = Exit.AGREES if work(mechanism, engine) else Exit.DISAGREES
            except typer.Exit as stopped:
                status = Exit(stopped.exit_code)
            worst = max(worst, status)
    raise typer.Exit(worst)


def file_of(folder: Path, case: str, simulator: str) -> Path:
    """Where the baseline of a case in an engine is kept."""
    return folder / f"{file_name(case)}-{simulator}.toml"


def command(verb: str, typed: str, simulator: str, folder: Path) -> str:
    """The command line that does this to one baseline, to be pasted into a shell."""
    elsewhere = [] if folder == WHERE else ["--baselines", str(folder)]
    return shlex.join(["compare", "baseline", verb, "--case", typed, "--simulator", simulator, *elsewhere])


def check_one(
    mechanism: Mechanism, simulator: str, folder: Path, resolve: Resolve | None = None, typed: str | None = None
) -> bool:
    """Whether nothing moved; says what did.  ``resolve`` is where the engine comes from, ``typed`` what names the case
    on a command line.

    Raises BaselineError, SimulationError, SimulatorMissing, Unsupported.
    """
    from compare.evidence.baseline.file import BaselineError, read
    from compare.evidence.baseline.moved import fits

    path = file_of(folder, mechanism.name, simulator)
    again = command("update", typed or mechanism.name, simulator, folder)
    stored = read(path, mechanism.name, simulator, again)
    version, fresh = _simulated(mechanism, simulator, resolve)
    misfit = fits(stored.runs, fresh)
    if misfit:
        raise BaselineError(f"{path}: {misfit}; if that is meant, write it anew with: {again}")
    found = _moved(stored, fresh)
    engine = f"{simulator} {version}" + (
        "" if version == stored.version else f" (the baseline was made with {stored.version})"
    )
    typer.echo(f"{mechanism.name}, {engine}: {_words(found, stored)}")
    for each in found:
        typer.echo(f"  {each}")
    return not found


def update_one(
    mechanism: Mechanism, simulator: str, folder: Path, resolve: Resolve | None = None, typed: str | None = None
) -> bool:
    """Write one baseline if anything in it changed; True.  Raises what check_one does, but a damaged file of the case
    is replaced.
    """
    from compare.evidence.baseline.file import Baseline, BaselineError, owned, read, write
    from compare.evidence.baseline.moved import fits

    path = file_of(folder, mechanism.name, simulator)
    owned(path, mechanism.name, simulator)
    version, fresh = _simulated(mechanism, simulator, resolve)
    made = Baseline(mechanism.name, simulator, version, tuple(fresh))
    found: list[Moved] = []
    try:
        stored = read(path, mechanism.name, simulator, "")
    except BaselineError:
        change = "written"
    else:
        made = replace(made, tolerance=stored.tolerance)
        change = "rewritten: other runs than before"
        if not fits(stored.runs, fresh):
            found = _moved(stored, fresh)
            made = replace(made, runs=tuple(_kept(stored, fresh, found)))
            change = "unchanged" if not found and version == stored.version else f"rewritten: {_words(found, stored)}"
    if change != "unchanged":
        write_atomically(path, write(made, command("check", typed or mechanism.name, simulator, folder)))
    typer.echo(f"{path}: {change}")
    for each in found:
        typer.echo(f"  {each}")
    return True


def _simulated(mechanism: Mechanism, simulator: str, resolve: Resolve | None) -> tuple[str, list[Run]]:
    from compare.evidence.baseline.runs import simulated
    from sim_models.engine import engine

    return simulated(mechanism, simulator, resolve or engine)


def _moved(stored: Baseline, fresh: list[Run]) -> list[Moved]:
    from compare.evidence.baseline.moved import moved

    return [each for old, new in zip(stored.runs, fresh, strict=True) for each in moved(old, new, stored.tolerance)]


def _kept(stored: Baseline, fresh: list[Run], found: list[Moved]) -> Iterator[Run]:
    """The old run where nothing in it moved, so that a rewritten file differs in what moved and nothing else."""
    changed = {each.run for each in found}
    for old, new in zip(stored.runs, fresh, strict=True):
        yield new if new.name in changed else old


def _words(found: list[Moved], stored: Baseline) -> str:
    columns = sum(max(0, len(run.columns) - (run.places is not None)) for run in stored.runs)
    if found:
        return f"{len(found)} of {columns} signals in {len(stored.runs)} runs moved"
    return f"nothing moved ({sum(run.rows.size for run in stored.runs)} numbers in {len(stored.runs)} runs)"
