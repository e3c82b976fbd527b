"""``compare validity``: over speed and clearance, where the analytic model agrees with a simulation, and what fails
where it does not.
"""

from __future__ import annotations

import math
import shlex
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from compare.cli.folders import Overwrite, result_folder
from compare.cli.options import JointChoice, cores, listed_once, load_case, rigidly_and_evenly_driven
from compare.faults import Exit, OptionError, complaints, stop
from compare.files import alone_in, output_folder, to_json, write_together

if TYPE_CHECKING:
    from analytic.mechanism import Mechanism
    from sim_models.engine import JointModel


def validity(
    context: typer.Context,
    speeds: Annotated[str, typer.Option(metavar="RPM,...", help="Speeds of the crank (rpm).")],
    clearances: Annotated[str, typer.Option(metavar="M,...", help="Radial clearances (m).")],
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    simulator: Annotated[
        str, typer.Option(metavar="NAME,...", help="Engines to compare with, or all that are installed.")
    ] = "mujoco",
    joint: Annotated[JointChoice, typer.Option(help="Joint model.")] = JointChoice.contact,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="JOINT,...", help="Joints with the clearance [the case's, else the farthest from the ground]."
        ),
    ] = None,
    tolerance: Annotated[Path | None, typer.Option(help="Tolerance file laid over the shipped one.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes [one a core].")] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster that is to do the runs.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of validity.json [reports/<case>-validity, then the options].")
    ] = None,
    overwrite: Overwrite = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print validity.json to standard output, and nothing else there.")
    ] = False,
) -> None:
    """Say at which speeds and clearances the analytic model holds, where contact is lost, and which assumption fails.

    An interrupted map goes on where it stopped.  Exit status: 0 computed, 2 bad input, 3 a simulator is missing or
    fails in every cell.
    """
    with complaints() as caught:
        from compare.domain_map.map import RPM, Grid, cells, clearance_joints, summarised
        from compare.judge.discrepancy import load_tolerances

        mechanism = rigidly_and_evenly_driven(load_case(case))
        if mechanism.speed is None:
            raise OptionError(
                f"--case {case}: {mechanism.name} has no drive of constant speed; a map is over its speeds, so give"
                " it one"
            )
        joints, chosen = clearance_joints(mechanism, at)
        grid = Grid(
            mechanism,
            joints,
            tuple(rpm * RPM for rpm in positive(speeds, "--speeds", "rpm")),
            positive(clearances, "--clearances", "m"),
            simulators(simulator, joint.value, mechanism),
            joint.value,
            load_tolerances(tolerance),
        )
        runs = cells(grid)
        folder = output_folder(result_folder(context, f"{mechanism.name}-validity", "validity.json", out, overwrite))
        with alone_in(folder, patience=0.0):  # two maps would take each other's records away
            found = swept(runs, folder, workers or cores(), dask)
            result = summarised(grid, chosen, runs, found) | {
                "command": shlex.join(["compare", *sys.argv[1:]]),
                "warnings": caught,
            }
            publish(result, folder, json)
        if all("failure" in one for one in found):
            raise stop(f"every cell failed, the first because {found[0]['failure']}", Exit.SIMULATOR_FAILED)


def positive(text: str, option: str, unit: str) -> tuple[float, ...]:
    """``60,600`` as increasing numbers above zero.  Raises OptionError."""
    found = set()
    for part in listed_once(text, option):
        try:
            value = float(part)
        except ValueError:
            raise OptionError(f"{option} {text}: {part!r} is not a number; give {unit}, separated by commas") from None
        if not 0 < value < math.inf:
            raise OptionError(f"{option} {text}: {part} cannot be used; give {unit} above 0, separated by commas")
        if value in found:
            raise OptionError(f"{option} {text}: {value:g} is there twice; give each once")
        found.add(value)
    return tuple(sorted(found))


def simulators(names: str, joint_model: JointModel, mechanism: Mechanism) -> tuple[str, ...]:
    """The engines of these names, or for ``all`` every one that is installed and can; says which are left out.

    Raises Unsupported, SimulatorMissing or OptionError.
    """
    from sim_models.engine import ENGINES, Request, SimulatorMissing, Unsupported, check_supported, engine

    if joint_model == "ideal":
        raise OptionError("--joint ideal: ideal joints have no clearance; give massless-link, spring-damper or contact")
    found = []
    for name in ENGINES if names == "all" else listed_once(names, "--simulator"):
        try:
            check_supported(engine(name), Request(mechanism, joint_model))
        except (SimulatorMissing, Unsupported) as why:
            if names != "all":
                raise
            typer.echo(f"left out: {why}", err=True)
        else:
            found.append(name)
    if not found:
        raise SimulatorMissing(
            f"--simulator all: none that is installed simulates {joint_model} joints; see: compare simulators"
        )
    return tuple(found)


def swept(runs: list[dict[str, Any]], folder: Path, workers: int, dask: str | None) -> list[dict[str, Any]]:
    """The results of all runs, in order; what an interrupted sweep has left in the folder is not done again."""
    from compare.cli.progress import progress_bar
    from compare.domain_map.cell import examine
    from compare.sweep import sweep

    records = output_folder(folder / "runs")
    found: list[dict[str, Any]] = [{} for _ in runs]
    lost = False
    with progress_bar() as bar:
        for end in sweep(
            examine, runs, records, workers=workers, dask=dask, progress=lambda done, total: bar("cells", done, total)
        ):
            found[end.index] = {"failure": end.failure} if end.failure else end.result
            lost |= bool(end.failure)
    if not lost:  # else the same command tries again what was lost, and only that
        shutil.rmtree(records)
    return found


def publish(result: Mapping[str, Any], folder: Path, json: bool) -> None:
    """Write validity.json, validity.md and validity.svg; print the one or the table."""
    from compare.report.validity_figure import draw
    from compare.report.validity_text import markdown, print_table

    text = to_json(result, indent=1)
    write_together(folder, {"validity.svg": draw(result), "validity.md": markdown(result), "validity.json": text})
    if json:
        typer.echo(text)
        return
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else 110)
    print_table(result, console)
    console.print(f"map: {folder / 'validity.svg'}", soft_wrap=True, highlight=False)


__all__ = ["validity"]
