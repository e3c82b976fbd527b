"""One cell of a validity map: a simulation at one speed and clearance, held against the model, and the model against
itself.

The simulation is cross-checked with the equilibrium at every crank angle, and each assumption of the paper is tested by
itself (:mod:`compare.judge.assumptions`).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism import MechanismWarning
from compare.crosscheck import Job, crosscheck_job
from compare.judge.assumptions import Examined, excess
from compare.judge.discrepancy import Discrepancy
from compare.judge.tolerances import Tolerances
from compare.results.crosscheck import Run
from compare.results.document import Grid
from compare.results.document import Mechanism as AnyMechanism
from compare.results.validity import Cell, Failed, Place, Worst
from sim_models.engine import JointModel


class Task(Place):
    """All that a cell's result depends on; the first ``skip`` crank angles (rad) are simulated and not judged."""

    joint_model: JointModel
    mechanism: AnyMechanism
    crank_angle: Grid
    skip: int
    tolerances: Tolerances
    versions: Mapping[str, str]

    def failed(self, why: str) -> Failed:
        """The cell without a result."""
        return Failed(simulator=self.simulator, speed=self.speed, clearance=self.clearance, failure=why)


def examine(content: Mapping[str, object]) -> dict[str, object]:
    """A cell of validity.json from the plain data of a :class:`Task`, for :func:`compare.sweep.sweep`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechanismWarning)  # said once, where the file was read
        task = Task.model_validate(content)
    return examined(task).model_dump()


def examined(task: Task) -> Cell | Failed:
    """Simulate and judge one cell.

    Where the simulation fails, or the linkage cannot be assembled with these clearances, there is only why.
    """
    theta, skip = task.crank_angle, task.skip
    models = task.joint_model
    job = Job(task.mechanism, (task.simulator,), task.tolerances, theta=theta, joint_model=models, as_it_is=True)
    try:
        result = crosscheck_job(job)
    except AssemblyError as error:
        return task.failed(str(error))
    if result.failures:
        return task.failed(result.failures[0].why)
    return judged(task, Examined(task.mechanism, theta[skip:], _later(result.runs[0], skip), job.tolerances))


def judged(task: Task, held: Examined) -> Cell:
    """What a cell of the map says of a run: whether model and simulation agree, where most they do not, and why."""
    found, agrees = [d for d, _ in held.verdicts], bool(held.agreeing.all())
    unsteady = held.flagged & ~held.unloaded
    return Cell(
        simulator=task.simulator,
        speed=task.speed,
        clearance=task.clearance,
        verdict="agrees" if agrees else "disagrees",
        cause=None if agrees else held.cause,
        agreeing_share=float(held.agreeing.mean()),
        free_share=dict(held.run.free_share),
        worst=_worst(max(found, key=excess), held.theta) if found else None,
        fails=tuple(held.fails),
        cost=dict(held.costs),
        swings=held.swings,
        flagged_share={
            "unloaded": float(np.mean(held.flagged & held.unloaded)),
            "unsteady": float(np.mean(unsteady)),
        },
        give=held.give,
        settings={
            name: value
            for name, value in held.run.settings.items()
            if name in ("contact_law", "step") and not isinstance(value, Mapping)
        },
    )


def _later(run: Run, skip: int) -> Run:
    """A run without its first angles, for what is judged."""
    sides = {
        "analytic": {name: values[skip:] for name, values in run.analytic.items()},
        "simulated": {name: values[skip:] for name, values in run.simulated.items()},
    }
    flags = {str(int(i) - skip): why for i, why in run.flags.items() if int(i) >= skip}
    return run.model_copy(update={**sides, "flags": flags, "crank_angle": run.crank_angle[skip:]})


def _worst(found: Discrepancy, theta: np.ndarray) -> Worst:
    return Worst(
        signal=found.signal.name,
        unit=found.unit,
        max=found.max,
        tolerance=found.tolerance,
        over_tolerance=excess(found),
        at_crank_angle=float(theta[found.at]),
    )
