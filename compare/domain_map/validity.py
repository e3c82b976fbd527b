"""Where the analytic model of a linkage agrees with simulations, over speed and clearance."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.checks import LEAST_RESTITUTION
from analytic.mechanism.errors import quoted
from compare.arguments import (
    Linkage,
    Names,
    Numbers,
    Simulators,
    ToleranceFile,
    cores,
    engines,
    every_one,
    flag,
    laid_over,
    linkage,
    names,
    noted,
    numbers,
    one_of,
    path,
    processes,
    refuse_large,
    rigidly_and_evenly_driven,
    warn_of_friction,
    whole,
    with_clearance,
)
from compare.crosscheck import OF_TURNS, STRIKING
from compare.domain_map.cell import Task, examine
from compare.domain_map.map import Grid, RealJoint, cells, clearance_joints, summarised
from compare.faults import ArgumentError
from compare.files import made_folder
from compare.judge.grid import turns_fully
from compare.left_out import Asked, omitted
from compare.progress import Progress, progress_bar
from compare.results.validity import Cell, Failed, Validity
from compare.sweep import sweep
from sim_models.common.requests import check_request
from sim_models.engine import JOINT_MODELS, JointModel, Request, SimulatorMissing, Unsupported, check_supported, engine

CELL: TypeAdapter[Cell | Failed] = TypeAdapter(Cell | Failed)


def validity(  # noqa: PLR0913 - what a person may ask, by name
    mechanism: Linkage = "paper",
    *,
    speeds: Numbers,
    clearances: Numbers,
    simulators: Simulators = "mujoco",
    joint_model: JointModel = "contact",
    joints: Names | None = None,
    large: bool = False,
    restitutions: Numbers | None = None,
    revolutions: int = 1,
    tolerances: ToleranceFile | None = None,
    workers: int | None = None,
    dask: str | None = None,
    records: str | PathLike[str] | None = None,
    progress: Progress | None = None,
) -> Validity:
    """At which ``speeds`` (rad/s) and ``clearances`` (m; radial, or half the play of a block) the analytic model holds,
    where contact is lost, and which assumption fails.

    ``joints`` have the clearance: by default the case's, else the one farthest from the ground; one of more than a
    tenth of the shortest body that meets there is refused unless ``large`` ones are meant.  With ``restitutions``
    there is a map for each; left out, contact is the mechanism's own.  What contact does (peak force, time without it,
    energy lost) is watched over so many ``revolutions`` of the crank, after one that is not.  Cells are done in
    ``workers`` processes, one a core by default, or on a Dask cluster whose scheduler is at ``dask``.  A folder of
    ``records`` keeps what is done, so that a map that is interrupted goes on where it stopped; a whole one is removed.

    Raises MechanismError, ArgumentError, ToleranceError, Unsupported, SimulatorMissing, ClusterError or OutputError.
    """
    grid = gridded(
        mechanism,
        speeds=speeds,
        clearances=clearances,
        simulators=simulators,
        joint_model=joint_model,
        joints=joints,
        large=large,
        restitutions=restitutions,
        revolutions=revolutions,
        tolerances=tolerances,
    )
    with progress_bar(progress) as told:
        return mapped(grid, workers=workers, dask=dask, records=records, progress=told)


def gridded(  # noqa: PLR0913 - as validity
    mechanism: Linkage,
    *,
    speeds: Numbers,
    clearances: Numbers,
    simulators: Simulators,
    joint_model: JointModel,
    joints: Names | None,
    tolerances: ToleranceFile | None,
    large: bool = False,
    restitutions: Numbers | None = None,
    revolutions: int = 1,
) -> Grid:
    """What a map is over.  Warns, and raises, as :func:`validity` does."""
    at_speeds, gaps = increasing(speeds, "speeds", "rad/s"), increasing(clearances, "clearances", "m")
    joint_model, read = real(joint_model), laid_over(tolerances)
    watched = whole(revolutions, "revolutions", 0)
    named = None if joints is None else names(joints, "joints", least=1)
    with noted() as warned:
        m = rigidly_and_evenly_driven(linkage(mechanism, large=True))  # its own clearances are not of the map
        if m.speed is None:
            alone = "no drive of constant speed that alone turns a crank"
            why = f"{m.name} has {alone}; a map is over its speeds, so give it one"
            raise ArgumentError("mechanism", why)
        strikes = joint_model in STRIKING
        in_vain = watched > 1 and not (strikes and turns_fully(Assembly(m)))
        unused = [f"{m.name}: revolutions = {watched} is left out; {OF_TURNS}"] if in_vain else []
        at, chosen = clearance_joints(m, named)
        bouncing = None if restitutions is None else _restitutions(restitutions, joint_model)
        widest = with_clearance(m, dict.fromkeys(at, gaps[-1]), "clearances")
        if not flag(large, "large"):
            refuse_large(widest, "clearances")
        blocks = [name for name in at if m.joint(name).prismatic]
        if blocks:
            check_request(Request(widest, joint_model, Schedule.at_angles(widest, np.zeros(1))))
        able, left_out = capable(simulators, joint_model, widest if blocks else m)
        warn_of_friction(widest, joint_model, "driven")
        left_out += omitted(m, replace(Asked.of_engines("validity", m, "driven", joint_model), mapped=at))
    return Grid(
        m,
        at,
        at_speeds,
        gaps,
        able,
        joint_model,
        read,
        chosen,
        (*warned, *left_out, *unused),
        bouncing,
        watched if strikes else 0,
    )


def mapped(
    grid: Grid,
    *,
    workers: int | None = None,
    dask: str | None = None,
    records: str | PathLike[str] | None = None,
    progress: Progress = lambda what, done, total: None,
) -> Validity:
    """The map over a grid.  Raises AssemblyError, ClusterError or OutputError."""
    tasks, spread_over = cells(grid), processes(workers, cores())
    if dask is not None and not isinstance(dask, str):
        raise ArgumentError("dask", f"{quoted(dask)} cannot be used; give its address, such as tcp://localhost:8786")
    kept = None if records is None else path(records, "records")
    with tempfile.TemporaryDirectory() as scratch:
        found = _swept(tasks, kept or Path(scratch) / "runs", spread_over, dask, progress)
    result = summarised(grid, tasks, found)
    return result.model_copy(update={"warnings": (*grid.warnings, *result.warnings)})


def _restitutions(given: Numbers, joint_model: RealJoint) -> tuple[float, ...]:
    """Restitutions that contact can have, increasing.  Raises ArgumentError."""
    if joint_model not in STRIKING:
        raise ArgumentError("restitutions", f"the pins of {joint_model} joints never strike; leave restitutions out")
    found = tuple(sorted(numbers(given, "restitutions", "1").tolist()))
    for value in found:
        if not LEAST_RESTITUTION <= value <= 1:
            endless = ", as it takes endless damping to give back nothing" * (0 <= value < LEAST_RESTITUTION)
            give = f"give restitutions from {LEAST_RESTITUTION:g} to 1{endless}"
            raise ArgumentError("restitutions", f"{value:g} cannot be used; {give}")
    if len(set(found)) < len(found):
        raise ArgumentError("restitutions", f"{quoted(list(found))} has a number twice; give each once")
    return found


def increasing(values: Numbers, called: str, unit: str) -> tuple[float, ...]:
    """Numbers above zero, increasing.  Raises ArgumentError."""
    found = tuple(sorted(numbers(values, called, unit).tolist()))
    for value in found:
        if not 0 < value < math.inf:
            raise ArgumentError(called, f"{value:g} cannot be used; give {unit} above 0")
    if len(set(found)) < len(found):
        raise ArgumentError(called, f"{quoted(list(found))} has a number twice; give each ({unit}) once")
    return found


def real(joint_model: JointModel) -> RealJoint:
    """A joint model that has clearance.  Raises ArgumentError."""
    joint_model = one_of(joint_model, JOINT_MODELS, "joint_model")
    if joint_model == "ideal":
        raise ArgumentError(
            "joint_model", "ideal joints have no clearance; give massless-link, spring-damper or contact"
        )
    return joint_model


def capable(simulators: Simulators, joint_model: JointModel, mechanism: Mechanism) -> tuple[tuple[str, ...], list[str]]:
    """The engines of these names, or for ``all`` every one that is installed and can; and which are left out, and why.

    Raises Unsupported, SimulatorMissing or ArgumentError.
    """
    real(joint_model)
    asked, left_out = engines(simulators)
    found = []
    for name in asked:
        try:
            check_supported(engine(name), Request(mechanism, joint_model, Schedule.at_angles(mechanism, np.zeros(1))))
        except Unsupported as why:
            if not every_one(simulators):
                raise
            left_out.append(f"left out: {why}")
        else:
            found.append(name)
    if not found:
        raise SimulatorMissing(
            f"none of the simulators that are installed has {joint_model} joints; see: compare simulators"
        )
    return tuple(found), left_out


def _swept(
    tasks: Sequence[Task], records: Path, workers: int, dask: str | None, progress: Progress
) -> list[Cell | Failed]:
    """The cells, in order; what an interrupted map has left in the folder is not done again."""
    found: list[Cell | Failed | None] = [None] * len(tasks)
    lost = False
    runs = [task.plain() for task in tasks]

    def told(done: int, total: int | None) -> None:
        progress("cells", done, total)

    with made_folder(records, "records"):
        for end in sweep(examine, runs, records, workers=workers, dask=dask, progress=told):
            task = tasks[end.index]
            found[end.index] = task.failed(end.failure) if end.failure else CELL.validate_python(end.result)
            lost |= bool(end.failure)
        if not lost:  # else the same command tries again what was lost, and only that
            shutil.rmtree(records)
    return [cell for cell in found if cell is not None]
