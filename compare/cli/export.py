"""``compare export``: an engine's own model and a script that runs it without this project."""

from __future__ import annotations

import shlex
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compare.cli.folders import Overwrite, refuse_others
from compare.cli.options import JointChoice, MotionChoice, load_case, rigidly_and_evenly_driven
from compare.faults import OptionError, complaints

if TYPE_CHECKING:
    from analytic.mechanism import Mechanism
    from sim_models.engine import Request


def export(
    simulator: Annotated[str, typer.Option(help="Engine whose model is wanted (see: compare simulators).")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the files.")],
    case: Annotated[str, typer.Option(help="Shipped case (see: compare cases) or a mechanism file.")] = "paper",
    joint: Annotated[JointChoice, typer.Option(help="What the joints with clearance are.")] = JointChoice.ideal,
    motion: Annotated[
        MotionChoice, typer.Option(help="Run the crank at its speed, or equilibrium at each angle.")
    ] = MotionChoice.driven,
    clearance: Annotated[
        str | None, typer.Option(metavar="JOINT=M,...", help="Radial clearances (m) in place of the case's own.")
    ] = None,
    angles: Annotated[str | None, typer.Option(metavar="START:STOP:STEP", help="Crank angles (deg).")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Write the engine's own model and a script that runs it without this project, to be checked by anyone.

    ``python DIR/run.py`` needs the bare engine and numpy; it says how far its signals are from those found here.
    Exit status: 0 written, 2 bad input, 3 the simulator is missing or failed.
    """
    with complaints():
        from compare.files import OutputError, output_folder, write_together
        from sim_models.engine import ENGINES, declared, engine

        mechanism = load_case(case, clearance)
        chosen = engine(simulator)
        write = getattr(chosen, "export", None)
        if write is None:
            can = ", ".join(name for name in ENGINES if hasattr(declared(name), "export"))
            raise OptionError(f"--simulator {simulator}: its model cannot be exported; that of {can} can")
        request = request_of(rigidly_and_evenly_driven(mechanism), joint, motion, angles)
        folder = output_folder(out)
        try:
            with tempfile.TemporaryDirectory() as draft:  # all of it is there before the first file is put in place
                texts = {path.name: path.read_text(encoding="utf-8") for path in write(request, Path(draft))}
        except OSError as error:
            where = f"{tempfile.gettempdir()}, where the files for {folder} are drafted"
            raise OutputError(
                f"{where}: cannot be written ({error.strerror}); free space there, or give TMPDIR another folder"
            ) from None
        refuse_others(folder, texts, overwrite)
        for path in write_together(folder, texts):
            typer.echo(path)
        typer.echo(
            f"run it in an environment that has {chosen.package} and numpy: python"
            f" {shlex.quote(str(folder / 'run.py'))}"
        )


def request_of(mechanism: Mechanism, joint: JointChoice, motion: MotionChoice, angles: str | None) -> Request:
    """The run that a cross-check makes of this joint model.  Raises OptionError, GridError or AssemblyError."""
    from math import tau

    from analytic.kinematics.assembly import Assembly
    from compare.judge.grid import FREE_TIME, chosen_angles, turns_fully
    from sim_models.engine import Request

    if joint is not JointChoice.ideal and not mechanism.clearances:
        raise OptionError(
            f"--joint {joint}: {mechanism.name} has no joint with clearance; give it one with --clearance JOINT=m"
        )
    assembly = Assembly(mechanism)
    if mechanism.speed is None and motion is MotionChoice.driven:
        if angles is not None:
            raise OptionError(
                f"--angles {angles}: {mechanism.name} swings freely and is reported over time; leave --angles out"
            )
        return Request(mechanism, joint.value, time=FREE_TIME)
    theta = chosen_angles(assembly, angles)
    settles = motion is MotionChoice.driven and joint is not JointChoice.ideal and turns_fully(assembly)
    return Request(mechanism, joint.value, motion.value, theta, lead_in=tau if settles else 0.0)
