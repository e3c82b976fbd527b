"""The ``compare`` command.  Heavy imports wait until a command needs them, so that ``compare --help`` answers
at once.
"""

from __future__ import annotations

import os
import traceback
from pathlib import Path
from typing import Annotated

import typer

from compare.cli.accuracy import accuracy
from compare.cli.analyse import analyse, simulate
from compare.cli.baseline import baseline
from compare.cli.check import check
from compare.cli.diagnose import diagnose
from compare.cli.export import export
from compare.cli.folders import Overwrite, named_after, result_folder
from compare.cli.imported import import_
from compare.cli.listing import cases, effects, runs, simulators
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
from compare.cli.pipe import reader_may_go
from compare.cli.publish import finished, publish
from compare.cli.show import show
from compare.cli.validity import validity
from compare.faults import Exit, complaints
from compare.files import made_folder
from compare.progress import progress_bar

TYPED = "COMMANDLINE"  # click's word for an option that is not at its default

app = typer.Typer(
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Entry point of the console command."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # our matrices are small: threads cost more than they bring
    try:
        with reader_may_go():
            app(prog_name="compare")
    except Exception as error:  # noqa: BLE001 - Python's own status, 1, means that the two sides disagree
        traceback.print_exc()
        typer.echo(
            f"compare: unforeseen fault ({type(error).__name__}: {error}); it is this program's: please report it with"
            " the lines above",
            err=True,
        )
        raise SystemExit(Exit.SIMULATOR_FAILED) from None


@app.callback(invoke_without_command=True)
def compare(
    context: typer.Context,
    simulator: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Engines to compare with, or all that are installed (see: compare simulators); mjcf:FILE and fmu:FILE"
            " are your own models.",
        ),
    ] = None,
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    joint: Annotated[
        JointChoice | None, typer.Option(help="One joint model; left out, all that the engine has.")
    ] = None,
    motion: Annotated[
        MotionChoice, typer.Option(help="Run the drives, or an equilibrium at each angle or time.")
    ] = MotionChoice.driven,
    clearance: Annotated[
        str | None, typer.Option(metavar="JOINT=M,...", help="Radial clearances (m) in place of the case's own.")
    ] = None,
    large: Large = False,
    angles: Annotated[str | None, typer.Option(metavar="START:STOP:STEP", help="Crank angles (deg).")] = None,
    times: Times = None,
    course: CourseFile = None,
    path: PathFile = None,
    analytic: Annotated[
        ModelChoice, typer.Option(help="Analytic model to hold the simulation to.")
    ] = ModelChoice.equilibrium,
    flexible: Annotated[
        bool, typer.Option("--flexible", help="Let bodies with youngs_modulus bend; with --motion static.")
    ] = False,
    tolerance: Annotated[Path | None, typer.Option(help="Tolerance file laid over the shipped one.")] = None,
    map: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Map of fmu:FILE [FILE's name with .map.toml].")
    ] = None,
    revolutions: Annotated[
        int,
        typer.Option(
            min=0, help="Most revolutions of a run whose pins strike their walls; it ends once its averages are known."
        ),
    ] = 32,
    out: Annotated[
        Path | None,
        typer.Option(
            parser=place, metavar="PATH", help="Folder of the report [reports/<case>-<simulator>, then the options]."
        ),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
    quiet: Quiet = False,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Cross-check the analytic clearance model of a planar linkage against a multibody simulation.

    Exit status: 0 agrees, 1 disagrees beyond tolerance or cannot be judged, 2 bad input, 3 a simulator is missing or
    failed.
    """
    typed = [name for name in context.params if (said := context.get_parameter_source(name)) and said.name == TYPED]
    if context.invoked_subcommand is not None:
        if typed:
            option, command = f"--{typed[0].replace('_', '-')}", context.invoked_subcommand
            typer.echo(f"compare: {option} stands before {command}, which does not see it; write it after", err=True)
            raise typer.Exit(Exit.BAD_INPUT)
        return
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"linkage-crosscheck {installed('linkage-crosscheck')}")
        return
    if simulator is None:
        if typed:
            typer.echo(
                "compare: no --simulator is given; name one of those that compare simulators lists, or all", err=True
            )
        else:
            typer.echo(context.get_help())
        raise typer.Exit(Exit.BAD_INPUT)
    with complaints(context) as caught:
        from compare.crosscheck import crosscheck_job, question
        from compare.judge.discrepancy import load_tolerances
        from compare.judge.grid import parse_angles
        from compare.schedules import parse_times

        tolerances = load_tolerances(tolerance)
        mechanism = load_case(case, clearance, large=large)
        job = question(
            mechanism,
            simulator,
            joint_model=joint.value if joint else None,
            motion=motion.value,
            large=large,
            angles=parse_angles(angles) if angles is not None else None,
            times=parse_times(times) if times is not None else None,
            course=course,
            path=path,
            analytic=analytic.value,
            flexible=flexible,
            tolerances=tolerances,
            map=map,
            revolutions=revolutions,
        )
        beside = ("junit.xml", "signals.csv")
        with made_folder(result_folder(context, named_after(case), "result.json", out, overwrite, beside)) as folder:
            with progress_bar() as progress:
                found = crosscheck_job(job, progress)
            result = finished(found, caught)
            publish(result, folder, json=json, quiet=quiet, overwrite=overwrite, context=context)
        for failure in result.failures:  # the status is theirs even where the others agree
            typer.echo(f"compare: {failure.why}", err=True)
        if result.failures:
            raise typer.Exit(Exit.SIMULATOR_FAILED)
    raise typer.Exit(Exit.AGREES if result.verdict == "agrees" else Exit.DISAGREES)


app.command()(accuracy)
app.command()(analyse)
app.command()(cases)
app.command()(check)
app.command()(diagnose)
app.command()(effects)
app.command()(export)
app.command("import")(import_)
app.command(name="list")(runs)
app.command()(simulate)
app.command()(simulators)
app.command()(validity)
app.command()(show)
app.add_typer(baseline, name="baseline")
