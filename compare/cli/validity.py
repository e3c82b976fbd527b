"""``compare validity``: over speed and clearance, where the analytic model agrees with a simulation, and what fails
where it does not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from compare.cli.folders import Overwrite, named_after, result_folder
from compare.cli.options import JointChoice, Json, Large, Quiet, listed_once, load_case, place
from compare.cli.publish import finished, put, resumed, show
from compare.faults import Exit, OptionError, complaints, stop
from compare.files import alone_in, made_folder
from compare.progress import progress_bar


def validity(
    context: typer.Context,
    speeds: Annotated[str, typer.Option(metavar="RPM,...", help="Speeds of the crank (rpm).")],
    clearances: Annotated[str, typer.Option(metavar="M,...", help="Radial clearances (m); half the play of a block.")],
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    simulator: Annotated[
        str, typer.Option(metavar="NAME,...", help="Engines to compare with, or all that are installed.")
    ] = "mujoco",
    large: Large = False,
    joint: Annotated[JointChoice, typer.Option(help="Joint model.")] = JointChoice.contact,
    at: Annotated[
        str | None,
        typer.Option(
            metavar="JOINT,...", help="Joints with the clearance [the case's, else the farthest from the ground]."
        ),
    ] = None,
    restitutions: Annotated[
        str | None,
        typer.Option(metavar="E,...", help="Restitutions of the contact, a map for each [the mechanism's own]."),
    ] = None,
    revolutions: Annotated[
        int, typer.Option(min=0, help="Turns of the crank over which contact is watched, after one that is not.")
    ] = 1,
    tolerance: Annotated[Path | None, typer.Option(help="Tolerance file laid over the shipped one.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes [one a core].")] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster that is to do the runs.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            parser=place, metavar="PATH", help="Folder of validity.json [reports/<case>-validity, then the options]."
        ),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Say at which speeds and clearances the analytic model holds, where contact is lost, and which assumption fails.

    An interrupted map goes on where it stopped.  Exit status: 0 computed, 2 bad input, 3 a simulator is missing or
    fails in every cell.
    """
    with complaints(context) as caught:
        from math import pi

        from compare.domain_map.validity import gridded, mapped
        from compare.judge.tolerances import load_tolerances
        from compare.results.validity import Failed

        mechanism = load_case(case, large=True)  # its own clearances are not of the map
        rpm = positive(speeds, "--speeds", "rpm")
        gaps = positive(clearances, "--clearances", "m")
        grid = gridded(
            mechanism,
            speeds=[each * pi / 30 for each in rpm],
            clearances=gaps,
            simulators="all" if simulator == "all" else listed_once(simulator, "--simulator"),
            joint_model=joint.value,
            large=large,
            joints=listed_once(at, "--at") if at is not None else None,
            restitutions=None if restitutions is None else several(restitutions, "--restitutions"),
            revolutions=revolutions,
            tolerances=load_tolerances(tolerance),
        )
        beside = ("validity.csv", "validity.md", "validity.svg")
        place = result_folder(context, f"{named_after(case)}-validity", "validity.json", out, overwrite, beside)
        with made_folder(place) as folder, resumed():
            with alone_in(folder, patience=0.0), progress_bar() as bar:  # two maps would take each other's records away
                found = mapped(grid, workers=workers, dask=dask, records=folder / "runs", progress=bar)
                result = finished(found, caught)
                put(result, folder, result.files(), overwrite, context)
        show(result, json=json, quiet=quiet, place=folder)
        failed = [cell.failure for cell in found.cells if isinstance(cell, Failed)]
        if len(failed) == len(found.cells):
            raise stop(f"every cell failed, the first because {failed[0]}", Exit.SIMULATOR_FAILED)


def positive(text: str, option: str, unit: str) -> tuple[float, ...]:
    """``60,600`` as increasing numbers above zero.  Raises OptionError."""
    return listed_numbers(text, option, unit, "above 0", lambda value: 0 < value < math.inf)


def several(text: str, option: str) -> tuple[float, ...]:
    """``0.1,0.9`` as increasing numbers, of which contact has to take each.  Raises OptionError."""
    return listed_numbers(text, option, "numbers", "", lambda value: True)


def listed_numbers(
    text: str, option: str, unit: str, accepted: str, accepts: Callable[[float], bool]
) -> tuple[float, ...]:
    """Numbers of an option, increasing.  Raises OptionError."""
    found = set()
    for part in listed_once(text, option):
        try:
            value = float(part)
        except ValueError:
            raise OptionError(f"{option} {text}: {part!r} is not a number; give {unit}, separated by commas") from None
        if not accepts(value):
            raise OptionError(f"{option} {text}: {part} cannot be used; give {unit} {accepted}, separated by commas")
        if value in found:
            raise OptionError(f"{option} {text}: {value:g} is there twice; give each once")
        found.add(value)
    return tuple(sorted(found))
