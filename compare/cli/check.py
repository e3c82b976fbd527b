"""``compare check``: what another program has computed of a linkage, held against the analytic model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compare.cli.folders import Overwrite, named_after, result_folder
from compare.cli.options import JointChoice, Json, Large, ModelChoice, MotionChoice, Quiet, load_case, place
from compare.cli.publish import finished, publish
from compare.faults import Exit, complaints
from compare.files import made_folder
from compare.progress import progress_bar


def check(
    context: typer.Context,
    results: Annotated[
        list[Path], typer.Argument(help="Files of results (CSV, Parquet, Feather or MAT), one for each program.")
    ],
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    map_: Annotated[
        Path | None, typer.Option("--map", metavar="FILE", help="TOML file that says what the columns are.")
    ] = None,
    simulator: Annotated[
        str | None,
        typer.Option(metavar="NAME,...", help="Engines that simulate the same motion beside, or all."),
    ] = None,
    joint: Annotated[
        JointChoice | None,
        typer.Option(help="What the joints with clearance were [contact; ideal where none has clearance]."),
    ] = None,
    motion: Annotated[
        MotionChoice, typer.Option(help="A motion over time, or an equilibrium in each row.")
    ] = MotionChoice.driven,
    clearance: Annotated[
        str | None, typer.Option(metavar="JOINT=M,...", help="Radial clearances (m) in place of the case's own.")
    ] = None,
    large: Large = False,
    analytic: Annotated[ModelChoice, typer.Option(help="Analytic model to hold the results to.")] = (
        ModelChoice.equilibrium
    ),
    tolerance: Annotated[Path | None, typer.Option(help="Tolerance file laid over the shipped one.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(parser=place, metavar="PATH", help="Folder of the report [reports/<case>-<results>]."),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Check the recorded results of any program against the analytic model, and against engines beside.

    Exit status: 0 agrees, 1 disagrees beyond tolerance or cannot be judged, 2 bad input, 3 a simulator is missing or
    failed.
    """
    with complaints(context) as caught:
        from compare.check import check as asked
        from compare.judge.discrepancy import load_tolerances

        tolerances, mechanism = load_tolerances(tolerance), load_case(case, clearance, large=large)
        stem = "-".join([named_after(case), *(file.stem for file in results[:3])])
        beside = ("junit.xml", "signals.csv")
        with made_folder(result_folder(context, stem, "result.json", out, overwrite, beside)) as folder:
            with progress_bar() as progress:
                found = asked(
                    results,
                    mechanism,
                    map=map_,
                    simulators=simulator,
                    joint_model=joint.value if joint else None,
                    motion=motion.value,
                    large=large,
                    analytic=analytic.value,
                    tolerances=tolerances,
                    progress=progress,
                )
            result = finished(found, caught)
            publish(result, folder, json=json, quiet=quiet, overwrite=overwrite, context=context)
        for failure in result.failures:
            typer.echo(f"compare: {failure.why}", err=True)
        if result.failures:
            raise typer.Exit(Exit.SIMULATOR_FAILED)
    raise typer.Exit(Exit.AGREES if result.verdict == "agrees" else Exit.DISAGREES)
