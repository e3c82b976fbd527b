"""Where the analytic model of a linkage agrees with simulations, over speed and clearance."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Callable, Sequence
from os import PathLike
from pathlib import Path

from pydantic import TypeAdapter

from analytic.mechanism import Mechanism
from compare.arguments import Linkage, Simulators, cores, engines, linkage, noted, rigidly_and_evenly_driven
from compare.domain_map.cell import Task, examine
from compare.domain_map.map import Grid, RealJoint, cells, clearance_joints, summarised
from compare.faults import ArgumentError
from compare.files import output_folder
from compare.judge.discrepancy import load_tolerances
from compare.judge.tolerances import Tolerances
from compare.results.validity import Cell, Failed, Validity
from compare.sweep import sweep
from sim_models.engine import JointModel, Request, SimulatorMissing, Unsupported, check_supported, engine

Progress = Callable[[str, int, int | None], None]
CELL: TypeAdapter[Cell | Failed] = TypeAdapter(Cell | Failed)


def validity(  # noqa: PLR0913 - what a person may ask, by name
    mechanism: Linkage = "paper",
    *,
    speeds: Sequence[float],
    clearances: Sequence[float],
    simulators: Simulators = "mujoco",
    joint_model: JointModel = "contact",
    joints: Sequence[str] | None = None,
    tolerances: Tolerances | str | PathLike[str] | None = None,
    workers: int | None = None,
    dask: str | None = None,
    records: Path | None = None,
    progress: Progress = lambda what, done, total: None,
) -> Validity:
    """At which ``speeds`` (rad/s) and radial ``clearances`` (m) the analytic model holds, where contact is lost, and
    which assumption fails.

    ``joints`` have the clearance: by default the case's, else the one farthest from the ground.  Cells are done in
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
        tolerances=tolerances,
    )
    return mapped(grid, workers=workers, dask=dask, records=records, progress=progress)


def gridded(
    mechanism: Linkage,
    *,
    speeds: Sequence[float],
    clearances: Sequence[float],
    simulators: Simulators,
    joint_model: JointModel,
    joints: Sequence[str] | None,
    tolerances: Tolerances | str | PathLike[str] | None,
) -> Grid:
    """What a map is over.  Warns, and raises, as :func:`validity` does."""
    with noted() as warned:
        m = rigidly_and_evenly_driven(linkage(mechanism))
        if m.speed is None:
            why = f"{m.name} has no drive of constant speed; a map is over its speeds, so give it one"
            raise ArgumentError("mechanism", why)
        at, chosen = clearance_joints(m, joints)
        names, left_out = capable(simulators, joint_model, m)
        path = None if tolerances is None or isinstance(tolerances, Tolerances) else Path(tolerances)
    return Grid(
        m,
        at,
        increasing(speeds, "speeds", "rad/s"),
        increasing(clearances, "clearances", "m"),
        names,
        real(joint_model),
        tolerances if isinstance(tolerances, Tolerances) else load_tolerances(path),
        chosen,
        (*warned, *left_out),
    )


def mapped(
    grid: Grid,
    *,
    workers: int | None = None,
    dask: str | None = None,
    records: Path | None = None,
    progress: Progress = lambda what, done, total: None,
) -> Validity:
    """The map over a grid.  Raises AssemblyError, ClusterError or OutputError."""
    tasks = cells(grid)
    with tempfile.TemporaryDirectory() as scratch:
        found = _swept(tasks, records or Path(scratch) / "runs", workers or cores(), dask, progress)
    return summarised(grid, tasks, found).model_copy(update={"warnings": grid.warnings})


def increasing(values: Sequence[float], called: str, unit: str) -> tuple[float, ...]:
    """Numbers above zero, increasing.  Raises ArgumentError."""
    found = tuple(sorted(float(value) for value in values))
    for value in found:
        if not 0 < value < math.inf:
            raise ArgumentError(called, f"{value:g} cannot be used; give {unit} above 0")
    if not found or len(set(found)) < len(found):
        raise ArgumentError(called, f"give one or more ({unit}), each once")
    return found


def real(joint_model: JointModel) -> RealJoint:
    """A joint model that has clearance.  Raises ArgumentError."""
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
    names, left_out = engines(simulators)
    found = []
    for name in names:
        try:
            check_supported(engine(name), Request(mechanism, joint_model))
        except Unsupported as why:
            if simulators != "all":
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
    output_folder(records)
    found: list[Cell | Failed | None] = [None] * len(tasks)
    lost = False
    runs = [task.model_dump() for task in tasks]

    def told(done: int, total: int | None) -> None:
        progress("cells", done, total)

    for end in sweep(examine, runs, records, workers=workers, dask=dask, progress=told):
        task = tasks[end.index]
        found[end.index] = task.failed(end.failure) if end.failure else CELL.validate_python(end.result)
        lost |= bool(end.failure)
    if not lost:  # else the same command tries again what was lost, and only that
        shutil.rmtree(records)
    return [cell for cell in found if cell is not None]
