"""``compare export``: an engine's own model and a script that runs it without this project."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from compare.cli.folders import Overwrite, refuse_others
from compare.cli.options import (
    CourseFile,
    JointChoice,
    Json,
    Large,
    MotionChoice,
    PathFile,
    Quiet,
    Times,
    load_case,
    place,
)
from compare.cli.publish import show
from compare.faults import complaints


def export(
    context: typer.Context,
    simulator: Annotated[str, typer.Option(help="Engine whose model is wanted (see: compare simulators).")],
    out: Annotated[Path, typer.Option(parser=place, metavar="DIR", help="Folder for the files.")],
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    joint: Annotated[JointChoice, typer.Option(help="What the joints with clearance are.")] = JointChoice.ideal,
    motion: Annotated[
        MotionChoice, typer.Option(help="Driven, or equilibrium at each angle or time.")
    ] = MotionChoice.driven,
    clearance: Annotated[
        str | None, typer.Option(metavar="JOINT=M,...", help="Radial clearances (m) in place of the case's own.")
    ] = None,
    large: Large = False,
    angles: Annotated[str | None, typer.Option(metavar="START:STOP:STEP", help="Crank angles (deg).")] = None,
    times: Times = None,
    course: CourseFile = None,
    path: PathFile = None,
    overwrite: Overwrite = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write the engine's own model and a script that runs it without this project, to be checked by anyone.

    ``python DIR/run.py`` needs the bare engine and numpy; it says how far its signals are from those found here.
    Exit status: 0 written, 2 bad input, 3 the simulator is missing or failed.
    """
    with complaints(context):
        from analytic.mechanism.assumed import assumed
        from compare.arguments import noted, one_engine
        from compare.export import exported, used_in
        from compare.files import alone_in, made_folder, write_together
        from compare.judge.grid import parse_angles
        from compare.left_out import Asked, omitted
        from compare.results.export import Exported
        from compare.schedules import parse_times
        from sim_models.common.contact_laws import assumed_of_contact
        from sim_models.engine import declared

        mechanism, simulator = load_case(case, clearance, large=large), one_engine(simulator)
        with made_folder(out) as folder:
            with noted() as warned:
                texts = exported(
                    mechanism,
                    simulator,
                    joint_model=joint.value,
                    motion=motion.value,
                    angles=parse_angles(angles) if angles is not None else None,
                    times=parse_times(times) if times is not None else None,
                    course=course,
                    path=path,
                    clearance=None,
                    large=large,
                )
            settings = used_in(texts)
            with alone_in(folder):
                refuse_others(context, folder, texts, overwrite)
                paths = tuple(str(path) for path in write_together(folder, texts))
        left_out = tuple(omitted(mechanism, Asked.of_engines("export", mechanism, motion.value, joint.value)))
        for sentence in left_out:
            typer.echo(sentence, err=True)
        found = Exported(
            case=mechanism.name,
            simulator=simulator,
            joint_model=joint.value,
            motion=motion.value,
            paths=paths,
            needs=(declared(simulator).package, "numpy"),
            run=f"python {shlex.quote(str(folder / 'run.py'))}",
            settings=settings,
            assumed=(*assumed(mechanism), *assumed_of_contact(mechanism, mechanism.clearances, settings)),
            warnings=(*left_out, *warned),
        )
        show(found, json=json, quiet=quiet)
