"""``compare accuracy``: what clearance and compliance do to the outputs that a user names, over the whole cycle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compare.cli.folders import Overwrite, result_folder
from compare.cli.options import Json, MotionChoice, Quiet, listed_once, load_case, metres_by_joint, place
from compare.cli.publish import finished, publish
from compare.faults import complaints


def accuracy(
    context: typer.Context,
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    clearance: Annotated[
        str | None, typer.Option(metavar="JOINT=M,...", help="Radial clearances (m) in place of the case's own.")
    ] = None,
    clearance_tolerance: Annotated[
        str | None,
        typer.Option(metavar="JOINT=M,...", help="Clearances are uniform within +- this (m) in the Monte Carlo [0]."),
    ] = None,
    output: Annotated[
        list[str] | None,
        typer.Option(
            metavar="POINT_OR_BODY",
            help="coupler, coupler.B, follower.angle, ...; left out, every body's com and angle.",
        ),
    ] = None,
    motion: Annotated[
        MotionChoice | None,
        typer.Option(help="Reactions with inertia forces or without [driven, if the drive has a speed]."),
    ] = None,
    angles: Annotated[str | None, typer.Option(metavar="START:STOP:STEP", help="Crank angles (deg).")] = None,
    samples: Annotated[int, typer.Option(min=2, max=1_000_000, help="Linkages in the Monte Carlo.")] = 20_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the Monte Carlo's random numbers.")] = 0,
    nonlinear: Annotated[bool, typer.Option("--nonlinear", help="Close the linkage again for every sample.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            parser=place, metavar="PATH", help="Folder of accuracy.json [reports/<case>-accuracy, then the options]."
        ),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Say how accurate a linkage with clearance can be: nominal, worst case, by joint, Monte Carlo, compliance.

    Exit status: 0 computed, 2 bad input.
    """
    with complaints(context) as caught:
        from compare.accuracy import accuracy as asked
        from compare.judge.grid import parse_angles

        mechanism = load_case(case, clearance)
        folder = result_folder(context, f"{mechanism.name}-accuracy", "accuracy.json", out, overwrite)
        option = "--clearance-tolerance"
        found = asked(
            mechanism,
            clearance_tolerance=metres_by_joint(clearance_tolerance, option, mechanism)
            if clearance_tolerance
            else None,
            outputs=listed_once(",".join(output), "--output") if output else None,
            motion=motion.value if motion else None,
            angles=parse_angles(angles) if angles is not None else None,
            samples=samples,
            seed=seed,
            nonlinear=nonlinear,
        )
        publish(finished(found, caught), folder, json=json, quiet=quiet, overwrite=overwrite)
