"""``compare analyse`` and ``compare simulate``: one side of a comparison by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compare.cli.folders import Overwrite, named_after, result_folder
from compare.cli.options import (
    CourseFile,
    JointChoice,
    Json,
    Large,
    ModelChoice,
    MotionChoice,
    PathFile,
    Quiet,
    Times,
    load_case,
    place,
)
from compare.cli.publish import finished, publish
from compare.faults import complaints

Case = Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")]
Clearance = Annotated[
    str | None, typer.Option(metavar="JOINT=M,...", help="Radial clearances (m) in place of the case's own.")
]
Angles = Annotated[str | None, typer.Option(metavar="START:STOP:STEP", help="Crank angles (deg).")]
Motion = Annotated[MotionChoice, typer.Option(help="Drives at work, or an equilibrium at each angle or time.")]
Out = Annotated[
    Path | None,
    typer.Option(parser=place, metavar="PATH", help="Folder of the files [reports/<case>-..., then the options]."),
]


def analyse(
    context: typer.Context,
    case: Case = "paper",
    clearance: Clearance = None,
    large: Large = False,
    model: Annotated[ModelChoice, typer.Option(help="First order (Eq. 8) or equilibrium.")] = ModelChoice.equilibrium,
    motion: Motion = MotionChoice.driven,
    compliance: Annotated[bool, typer.Option("--compliance", help="Let links and joints yield as well.")] = False,
    angles: Angles = None,
    times: Times = None,
    course: CourseFile = None,
    path: PathFile = None,
    out: Out = None,
    overwrite: Overwrite = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compute reactions, drive torque, positions and the displacement by clearance; write signals.csv.

    Exit status: 0 computed, 2 bad input.
    """
    with complaints(context) as caught:
        from compare.analyse import analyse as asked
        from compare.judge.grid import parse_angles
        from compare.schedules import parse_times

        mechanism = load_case(case, clearance, large=large)
        folder = result_folder(
            context, f"{named_after(case)}-analysis", "analysis.json", out, overwrite, ("signals.csv",)
        )
        found = asked(
            mechanism,
            large=large,
            angles=parse_angles(angles) if angles is not None else None,
            times=parse_times(times) if times is not None else None,
            course=course,
            path=path,
            model=model.value,
            motion=motion.value,
            compliance=compliance,
        )
        publish(finished(found, caught), folder, json=json, quiet=quiet, overwrite=overwrite, context=context)


def simulate(
    context: typer.Context,
    case: Case = "paper",
    simulator: Annotated[str, typer.Option(help="Engine (see: compare simulators).")] = "mujoco",
    joint: Annotated[JointChoice, typer.Option(help="What the joints with clearance are.")] = JointChoice.ideal,
    motion: Motion = MotionChoice.driven,
    clearance: Clearance = None,
    large: Large = False,
    angles: Angles = None,
    times: Times = None,
    course: CourseFile = None,
    path: PathFile = None,
    out: Out = None,
    overwrite: Overwrite = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Run one engine with one joint model; write signals.csv.

    Exit status: 0 simulated, 2 bad input, 3 the simulator is missing or failed.
    """
    with complaints(context) as caught:
        from compare.analyse import simulate as asked
        from compare.judge.grid import parse_angles
        from compare.schedules import parse_times

        mechanism = load_case(case, clearance, large=large)
        folder = result_folder(
            context, f"{named_after(case)}-simulation", "simulation.json", out, overwrite, ("signals.csv",)
        )
        found = asked(
            mechanism,
            simulator,
            joint_model=joint.value,
            large=large,
            motion=motion.value,
            angles=parse_angles(angles) if angles is not None else None,
            times=parse_times(times) if times is not None else None,
            course=course,
            path=path,
        )
        publish(finished(found, caught), folder, json=json, quiet=quiet, overwrite=overwrite, context=context)
