"""``compare accuracy``: what clearance and compliance do to the outputs that a user names, over the whole cycle."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from compare.cli.folders import Overwrite, named_after, result_folder
from compare.cli.options import (
    CourseFile,
    Json,
    Large,
    MotionChoice,
    PathFile,
    Quiet,
    Times,
    listed_once,
    load_case,
    metres_by_joint,
    place,
    steps_by_joint,
)
from compare.cli.publish import finished, publish
from compare.faults import OptionError, complaints

OF_A_CRANK = ("clearance_tolerance", "motion", "angles", "samples", "seed", "nonlinear")


def accuracy(
    context: typer.Context,
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    clearance: Annotated[
        str | None, typer.Option(metavar="JOINT=M,...", help="Radial clearances (m) in place of the case's own.")
    ] = None,
    large: Large = False,
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
    workspace: Annotated[
        str | None,
        typer.Option(
            metavar="X0:X1:NX,Y0:Y1:NY", help="Map of several drives: places (m) of the first --output, and how many."
        ),
    ] = None,
    angle: Annotated[
        float | None, typer.Option(metavar="DEG", help="Angle of that body over the workspace [as assembled].")
    ] = None,
    encoder_step: Annotated[
        str | None,
        typer.Option(metavar="JOINT=STEP,...", help="Steps of the drives' encoders (rad, or m), of several drives."),
    ] = None,
    times: Times = None,
    course: CourseFile = None,
    path: PathFile = None,
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

    With several drives: the errors of a platform along a motion, or over its workspace.

    Exit status: 0 computed, 2 bad input.
    """
    with complaints(context) as caught:
        from analytic.kinematics.assembly import Assembly
        from compare.accuracy import accuracy as asked
        from compare.judge.grid import parse_angles, parse_workspace
        from compare.schedules import by_angle, parse_times

        mechanism = load_case(case, clearance, large=large)
        folder = result_folder(
            context, f"{named_after(case)}-accuracy", "accuracy.json", out, overwrite, ("accuracy.csv", "accuracy.html")
        )
        named = listed_once(",".join(output), "--output") if output else None
        over_time = any(each is not None for each in (workspace, angle, encoder_step, times, course, path))
        if over_time or not by_angle(Assembly(mechanism)):
            from compare.platform import platform_accuracy

            refuse_of_a_crank(context)
            several = platform_accuracy(
                mechanism,
                large=large,
                encoder_step=steps_by_joint(encoder_step, "--encoder-step", mechanism) if encoder_step else None,
                outputs=named,
                times=parse_times(times) if times is not None else None,
                course=course,
                path=path,
                workspace=parse_workspace(workspace) if workspace is not None else None,
                angle=None if angle is None else math.radians(angle),
            )
            publish(finished(several, caught), folder, json=json, quiet=quiet, overwrite=overwrite, context=context)
            return
        option = "--clearance-tolerance"
        found = asked(
            mechanism,
            large=large,
            clearance_tolerance=metres_by_joint(clearance_tolerance, option, mechanism)
            if clearance_tolerance
            else None,
            outputs=named,
            motion=motion.value if motion else None,
            angles=parse_angles(angles) if angles is not None else None,
            samples=samples,
            seed=seed,
            nonlinear=nonlinear,
        )
        publish(finished(found, caught), folder, json=json, quiet=quiet, overwrite=overwrite, context=context)


def refuse_of_a_crank(context: typer.Context) -> None:
    """Raise OptionError for an option that is of a linkage that one crank moves."""
    for name in OF_A_CRANK:
        source = context.get_parameter_source(name)
        if source is not None and source.name == "COMMANDLINE":
            option = f"--{name.replace('_', '-')}"
            raise OptionError(f"{option} is of linkages that one crank moves, over its angle; leave it out")
