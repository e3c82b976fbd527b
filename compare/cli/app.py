"""The ``compare`` command.  Heavy imports wait until a command needs them, so that ``compare --help`` answers
at once.
"""

from __future__ import annotations

import os
import shlex
import sys
import traceback
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from compare.cli.accuracy import accuracy
from compare.cli.baseline import baseline
from compare.cli.diagnose import diagnose, effects
from compare.cli.export import export
from compare.cli.folders import Overwrite, result_folder
from compare.cli.listing import cases, simulators
from compare.cli.options import (
    JointChoice,
    ModelChoice,
    MotionChoice,
    cores,
    engines_named,
    load_case,
    rigidly_and_evenly_driven,
)
from compare.cli.progress import progress_bar
from compare.cli.scoreboard import scoreboard
from compare.cli.show import show
from compare.cli.validation import validation
from compare.cli.validity import validity
from compare.faults import Exit, OptionError, complaints
from compare.files import alone_in, output_folder, to_json, write_together

if TYPE_CHECKING:
    from analytic.mechanism import Mechanism
    from compare.crosscheck import Job


app = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Entry point of the console command."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # our matrices are small: threads cost more than they bring
    try:
        app(prog_name="compare")
    except Exception as error:  # noqa: BLE001 - Python's own status for it is 1, which means that the two sides disagree
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
        str | None, typer.Option(help="Engine to compare with, or all that are installed (see: compare simulators).")
    ] = None,
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    joint: Annotated[
        JointChoice | None, typer.Option(help="One joint model; left out, all that the engine has.")
    ] = None,
    motion: Annotated[
        MotionChoice, typer.Option(help="Run the crank at its speed, or equilibrium at each angle.")
    ] = MotionChoice.driven,
    clearance: Annotated[
        str | None, typer.Option(metavar="JOINT=M,...", help="Radial clearances (m) in place of the case's own.")
    ] = None,
    angles: Annotated[str | None, typer.Option(metavar="START:STOP:STEP", help="Crank angles (deg).")] = None,
    analytic: Annotated[
        ModelChoice, typer.Option(help="Analytic model to hold the simulation to.")
    ] = ModelChoice.equilibrium,
    flexible: Annotated[
        bool, typer.Option("--flexible", help="Let bodies with youngs_modulus bend; with --motion static.")
    ] = False,
    tolerance: Annotated[Path | None, typer.Option(help="Tolerance file laid over the shipped one.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of the report [reports/<case>-<simulator>, then the options].")
    ] = None,
    overwrite: Overwrite = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print result.json to standard output, and nothing else there.")
    ] = False,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    """Cross-check the analytic clearance model of a planar linkage against a multibody simulation.

    Exit status: 0 agrees, 1 disagrees beyond tolerance or cannot be judged, 2 bad input, 3 a simulator is missing or
    failed.
    """
    if context.invoked_subcommand is not None:
        return
    if version:
        from importlib.metadata import version as installed

        typer.echo(f"linkage-crosscheck {installed('linkage-crosscheck')}")
        return
    if simulator is None:
        sources = (context.get_parameter_source(name) for name in context.params)
        asked = any(source is not None and source.name == "COMMANDLINE" for source in sources)
        if asked:
            typer.echo(
                "compare: no --simulator is given; name one of those that compare simulators lists, or all", err=True
            )
        else:
            typer.echo(context.get_help())
        raise typer.Exit(Exit.BAD_INPUT)
    with complaints() as caught:
        from compare.judge.discrepancy import load_tolerances

        tolerances = load_tolerances(tolerance)
        mechanism = load_case(case, clearance)
        job = _job(mechanism, simulator, joint, motion, angles, analytic, tolerances, caught, flexible)
        folder = output_folder(result_folder(context, mechanism.name, "result.json", out, overwrite))
        result = _run(job)
        for text in result["warnings"][len(job.warnings) :]:
            typer.echo(text if text.startswith("left out: ") else f"warning: {text}", err=True)
        _publish(result, folder, json)
        _announce_failures(result)
    raise typer.Exit(Exit.AGREES if result["verdict"] == "agrees" else Exit.DISAGREES)


def _announce_failures(result: dict[str, Any]) -> None:
    """Runs that failed, on standard error; the status is theirs even where the others agree."""
    for failure in result["failures"]:
        typer.echo(f"compare: {failure['why']}", err=True)
    if result["failures"]:
        raise typer.Exit(Exit.SIMULATOR_FAILED)


app.command()(accuracy)
app.command()(cases)
app.command()(diagnose)
app.command()(effects)
app.command()(export)
app.command()(simulators)
app.command()(validity)
app.command()(show)
app.add_typer(baseline, name="baseline")
app.add_typer(scoreboard, name="scoreboard")
app.add_typer(validation, name="validation")


def _job(
    mechanism: Mechanism,
    simulator: str,
    joint: JointChoice | None,
    motion: MotionChoice,
    angles: str | None,
    analytic: ModelChoice,
    tolerances: dict[str, Any],
    caught: list[str],
    flexible: bool,
) -> Job:
    from analytic.kinematics.assembly import Assembly
    from compare.crosscheck import Job
    from compare.judge.grid import FREE_TIME, chosen_angles

    simulators = engines_named(simulator)
    if flexible:
        simulators = _with_beams(simulators, simulator, mechanism, motion)
    mechanism = rigidly_and_evenly_driven(mechanism)
    assembly = Assembly(mechanism)
    released = mechanism.speed is None and motion is MotionChoice.driven
    if released and angles is not None:
        raise OptionError(
            f"--angles {angles}: {mechanism.name} swings freely and is compared over time; leave --angles out"
        )
    if released:
        _ideal_joints(mechanism, joint)
    theta = chosen_angles(assembly, angles)
    return Job(
        mechanism=mechanism,
        simulators=simulators,
        workers=cores() if len(simulators) > 1 else 1,
        tolerances=tolerances,
        motion=motion.value,
        theta=theta[:0] if released else theta,
        time=FREE_TIME if released else None,
        joint_model=joint.value if joint else None,
        model=analytic.value,
        command=shlex.join(["compare", *sys.argv[1:]]),
        warnings=tuple(caught),
        flexible=flexible,
    )


def _ideal_joints(mechanism: Mechanism, joint: JointChoice | None) -> None:
    """A linkage that swings freely has an analytic side with ideal joints only.  Raises OptionError; warns of clearance
    left out.
    """
    if joint not in (None, JointChoice.ideal):
        why = "the analytic model has no clearance in a free motion; leave --joint out, or give drive.speed in rad/s"
        raise OptionError(
            f"--joint {joint}: {mechanism.name} swings freely and is compared with ideal joints, as {why}"
        )
    if mechanism.clearances:
        text = (
            f"{mechanism.name} swings freely and is compared with ideal joints only: clearance in"
            f" {', '.join(mechanism.clearances)} is left out"
        )
        warnings.warn(text, stacklevel=2)


def _with_beams(simulators: tuple[str, ...], asked: str, mechanism: Mechanism, motion: MotionChoice) -> tuple[str, ...]:
    """Those of the engines that bend links.  Raises OptionError or Unsupported."""
    from compare.judge.flexible import Beams
    from sim_models.engine import Unsupported

    if motion is not MotionChoice.static:
        raise OptionError(f"--flexible --motion {motion}: flexible links are compared at rest; add --motion static")
    if not any(body.youngs_modulus for body in mechanism.bodies):
        raise OptionError(
            f"--flexible: no body of {mechanism.name} has a youngs_modulus (Pa); give the flexible ones theirs, and a"
            " section"
        )
    if asked != "all":
        return tuple(Beams.of(name).name for name in simulators)
    found = []
    for name in simulators:
        try:
            found.append(Beams.of(name).name)
        except Unsupported as why:
            typer.echo(f"left out: {why}", err=True)
    if not found:
        raise OptionError(
            "--flexible: no simulator that is installed bends links; run: pip install 'linkage-crosscheck[exudyn]'"
        )
    return tuple(found)


def _run(job: Job) -> dict[str, Any]:
    from compare.crosscheck import crosscheck

    with progress_bar() as report:
        return crosscheck(job, report)


def _publish(result: dict[str, Any], folder: Path, json: bool) -> None:
    from compare.report import report_files

    text = to_json(result)
    files = {"result.json": text} | report_files(result)
    with alone_in(folder):
        write_together(folder, files)
    if json:
        typer.echo(text)
        return
    from rich.console import Console

    from compare.report.terminal import print_table

    console = Console(width=None if sys.stdout.isatty() else 110)
    print_table(result, console)
    console.print(f"report: {folder / 'report.html'}", soft_wrap=True, highlight=False)
