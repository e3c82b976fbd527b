"""Where the analytic model of a linkage agrees with simulations, over speed and clearance."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import turns_fully
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.checks import LEAST_RESTITUTION
from compare.arguments import (
    Numbers,
    Simulators,
    cores,
    engines,
    every_one,
    laid_over,
    linkage,
    noted,
    numbers,
    refuse_large,
    rigidly_and_evenly_driven,
    warn_of_friction,
    with_clearance,
)
from compare.crosscheck import OF_TURNS, STRIKING
from compare.domain_map.cell import CellTask, examine
from compare.domain_map.map import MapPlan, RealJoint, cells, clearance_joints, summarised
from compare.faults import ArgumentError
from compare.files import made_folder
from compare.omissions import Asked, omitted
from compare.progress import Progress, progress_bar
from compare.questions.question import answers
from compare.questions.validity import ValidityQuestion
from compare.results.validity import Cell, Failed, Validity
from compare.sweep import sweep
from sim_models.common.requests import check_request
from sim_models.engine import JointModel, Request, SimulatorMissing, Unsupported, check_supported, engine

CELL: TypeAdapter[Cell | Failed] = TypeAdapter(Cell | Failed)


@answers(ValidityQuestion)
def validity(question: ValidityQuestion) -> Validity:
    """At which ``speeds`` and ``clearances`` the analytic model holds, where contact is lost, and which assumption
    fails.

    A clearance of more than a tenth of the shortest body that meets in its joint is refused unless ``large`` ones are
    meant.  What contact does (peak force, time without it, energy lost) is watched over so many ``revolutions``.  A
    folder of ``records`` keeps what is done, so that a map that is interrupted goes on where it stopped; a whole one is
    removed.

    Raises MechanismError, ArgumentError, ToleranceError, Unsupported, SimulatorMissing, ClusterError or OutputError.
    """
    plan = plan_of(question)
    with progress_bar(question.progress) as progress:
        return mapped(plan, question, progress)


def plan_of(question: ValidityQuestion) -> MapPlan:
    """The axes of the map that a question asks for.  Warns, and raises, as :func:`validity` does."""
    speeds, clearances = numbers(question.speeds, "speeds", "rad/s"), numbers(question.clearances, "clearances", "m")
    joint_model, tolerances = real(question.joint_model), laid_over(question.tolerances)
    watched = question.revolutions
    with noted() as warned:
        m = rigidly_and_evenly_driven(linkage(question.mechanism, large=True))  # its own clearances are not of the map
        if m.speed is None:
            alone = "no drive of constant speed that alone turns a crank"
            why = f"{m.name} has {alone}; a map is over its speeds, so give it one"
            raise ArgumentError("mechanism", why)
        strikes = joint_model in STRIKING
        in_vain = watched > 1 and not (strikes and turns_fully(Assembly(m)))
        unused = [f"{m.name}: revolutions = {watched} is left out; {OF_TURNS}"] if in_vain else []
        at, chosen = clearance_joints(m, question.joints)
        bouncing = None if question.restitutions is None else _restitutions(question.restitutions, joint_model)
        widest = with_clearance(m, dict.fromkeys(at, clearances[-1]), "clearances")
        if not question.large:
            refuse_large(widest, "clearances")
        blocks = [name for name in at if m.joint(name).prismatic]
        if blocks:
            check_request(Request(widest, joint_model, Schedule.at_angles(widest, np.zeros(1))))
        able, left_out = capable(question.simulator, joint_model, widest if blocks else m)
        warn_of_friction(widest, joint_model, "driven")
        left_out += omitted(m, replace(Asked.of_engines("validity", m, "driven", joint_model), mapped=at))
    return MapPlan(
        m,
        at,
        tuple(speeds.tolist()),
        tuple(clearances.tolist()),
        able,
        joint_model,
        tolerances,
        chosen,
        (*warned, *left_out, *unused),
        bouncing,
        watched if strikes else 0,
    )


def mapped(plan: MapPlan, question: ValidityQuestion, progress: Progress) -> Validity:
    """The map over a grid.  Raises AssemblyError, ClusterError or OutputError."""
    tasks = cells(plan)
    with tempfile.TemporaryDirectory() as scratch:
        records = Path(scratch) / "runs" if question.records is None else Path(question.records)
        results = _swept(tasks, records, question.workers or cores(), question.dask, progress)
    result = summarised(plan, tasks, results)
    return result.model_copy(update={"warnings": (*plan.warnings, *result.warnings)})


def _restitutions(given: Numbers, joint_model: RealJoint) -> tuple[float, ...]:
    """Restitutions that contact can have.  Raises ArgumentError."""
    if joint_model not in STRIKING:
        raise ArgumentError("restitutions", f"the pins of {joint_model} joints never strike; leave restitutions out")
    values = tuple(numbers(given, "restitutions", "").tolist())
    for value in values:
        if not LEAST_RESTITUTION <= value <= 1:
            endless = ", as it takes endless damping to give back nothing" * (0 <= value < LEAST_RESTITUTION)
            give = f"give restitutions from {LEAST_RESTITUTION:g} to 1{endless}"
            raise ArgumentError("restitutions", f"{value:g} cannot be used; {give}")
    return values


def real(joint_model: JointModel) -> RealJoint:
    """A joint model that has clearance.  Raises ArgumentError."""
    if joint_model == "ideal":
        raise ArgumentError(
            "joint_model", "ideal joints have no clearance; give massless-link, spring-damper or contact"
        )
    return joint_model


def capable(simulators: Simulators, joint_model: RealJoint, mechanism: Mechanism) -> tuple[tuple[str, ...], list[str]]:
    """The engines of these names, or for ``all`` every one that is installed and can; and which are left out, and why.

    Raises Unsupported, SimulatorMissing or ArgumentError.
    """
    asked, left_out = engines(simulators)
    able = []
    for name in asked:
        try:
            check_supported(engine(name), Request(mechanism, joint_model, Schedule.at_angles(mechanism, np.zeros(1))))
        except Unsupported as why:
            if not every_one(simulators):
                raise
            left_out.append(f"left out: {why}")
        else:
            able.append(name)
    if not able:
        raise SimulatorMissing(
            f"none of the simulators that are installed has {joint_model} joints; see: compare simulators"
        )
    return tuple(able), left_out


def _swept(
    tasks: Sequence[CellTask], records: Path, workers: int, dask: str | None, progress: Progress
) -> list[Cell | Failed]:
    """The cells, in order; what an interrupted map has left in the folder is not done again."""
    results: list[Cell | Failed | None] = [None] * len(tasks)
    lost = False
    runs = [task.plain() for task in tasks]

    def tell(done: int, total: int | None) -> None:
        progress("cells", done, total)

    with made_folder(records, "records"):
        for end in sweep(examine, runs, records, workers=workers, dask=dask, progress=tell):
            task = tasks[end.index]
            results[end.index] = task.failed(end.failure) if end.failure else CELL.validate_python(end.result)
            lost |= bool(end.failure)
        if not lost:  # else the same command tries again what was lost, and only that
            shutil.rmtree(records)
    return [cell for cell in results if cell is not None]
