"""One cell of a validity map: a simulation at one speed and clearance, held against the model, and the model against
itself.

The simulation is cross-checked with the equilibrium at every crank angle, and each assumption of the paper is tested by
itself (:mod:`compare.judge.assumptions`).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import MechanismWarning
from compare.crosscheck import STRIKING, Job, crosscheck_job
from compare.domain_map.leaving import leaving
from compare.judge.assumptions import Examined, excess
from compare.judge.discrepancy import Comparison
from compare.judge.tolerances import Tolerances
from compare.results.contact import Contact
from compare.results.crosscheck import Run
from compare.results.document import Grid
from compare.results.document import Mechanism as AnyMechanism
from compare.results.validity import Cell, Failed, Pin, Place, Watched, Worst
from sim_models.engine import JointModel


class CellTask(Place):
    """All that a cell's result depends on; the first ``skip`` crank angles (rad) are simulated and not judged.

    Contact is watched over so many ``revolutions``; 0: it is not.
    """

    joint_model: JointModel
    mechanism: AnyMechanism
    crank_angle: Grid
    skip: int
    tolerances: Tolerances
    versions: Mapping[str, str]
    revolutions: int = 0

    def plain(self) -> dict[str, object]:
        """The task as plain data, which says nothing of what it does not ask for: so a map that was begun goes on."""
        return self.model_dump(exclude={name for name in ("restitution", "revolutions") if not getattr(self, name)})

    @property
    def _place(self) -> dict[str, Any]:
        """Which cell it is of."""
        place = {"simulator": self.simulator, "speed": self.speed, "clearance": self.clearance}
        return place if self.restitution is None else place | {"restitution": self.restitution}

    def failed(self, why: str) -> Failed:
        """The cell without a result."""
        return Failed(**self._place, failure=why)


def examine(content: Mapping[str, object]) -> dict[str, object]:
    """A cell of validity.json from the plain data of a :class:`CellTask`, for :func:`compare.sweep.sweep`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechanismWarning)  # said once, where the file was read
        task = CellTask.model_validate(content)
    return examined(task).model_dump(exclude_unset=True)


def examined(task: CellTask) -> Cell | Failed:
    """Simulate and judge one cell.

    Where the simulation fails, or the linkage cannot be assembled with these clearances, there is only why.
    """
    theta, skip = task.crank_angle, task.skip
    schedule = Schedule.at_angles(task.mechanism, theta)
    job = Job(
        task.mechanism,
        (task.simulator,),
        task.tolerances,
        schedule,
        joint_model=task.joint_model,
        as_it_is=True,
        revolutions=task.revolutions,
    )
    try:
        result = crosscheck_job(job)
    except AssemblyError as error:
        return task.failed(str(error))
    if result.failures:
        return task.failed(result.failures[0].why)
    later = Schedule.at_angles(task.mechanism, theta[skip:])
    examination = Examined(task.mechanism, later, _later(result.runs[0], skip), job.tolerances)
    return judged(task, examination).model_copy(update=_contact_fields(task, examination.run.contact))


def _contact_fields(task: CellTask, contact: Contact | None) -> dict[str, object]:
    """What contact did, where it was watched, and what the analytic model says of when it is lost."""
    fields: dict[str, object] = {}
    if contact is not None:
        fields["watched"] = watched(contact)
    left = leaving(task.mechanism, task.crank_angle) if task.revolutions and task.joint_model in STRIKING else None
    return fields if left is None else fields | {"leaving": left}


def watched(contact: Contact) -> Watched:
    """A cell's contact, in short."""
    pins = {}
    for name, joint in contact.joints.items():
        values = {key: figure.value for key, figure in joint.statistics.items() if key in Pin.model_fields}
        highest = joint.statistics["peak_force"].by_revolution.max(initial=0.0)
        pins[name] = Pin(**values | {"peak_force": float(highest)}, peak_ratio=joint.peak_ratio)
    return Watched(revolutions=contact.revolutions, pins=pins)


def judged(task: CellTask, examination: Examined) -> Cell:
    """The cell of a run: whether model and simulation agree, where they differ most, and why."""
    comparisons, agrees = [d for d, _ in examination.verdicts], bool(examination.agreeing.all())
    unsteady = examination.flagged & ~examination.unloaded
    return Cell(
        **task._place,
        verdict="agrees" if agrees else "disagrees",
        cause=None if agrees else examination.cause,
        agreeing_share=float(examination.agreeing.mean()),
        free_share=dict(examination.run.free_share),
        worst=_worst(max(comparisons, key=excess), examination.theta) if comparisons else None,
        fails=tuple(examination.fails),
        cost=dict(examination.costs),
        swings=examination.swings,
        flagged_share={
            "unloaded": float(np.mean(examination.flagged & examination.unloaded)),
            "unsteady": float(np.mean(unsteady)),
        },
        give=examination.give,
        settings={
            name: value
            for name, value in examination.run.settings.items()
            if name in ("contact_law", "contact_stiffness", "contact_damping", "step")
            and not isinstance(value, Mapping)
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


def _worst(comparison: Comparison, theta: np.ndarray) -> Worst:
    return Worst(
        signal=comparison.signal.name,
        unit=comparison.unit,
        max=comparison.max,
        tolerance=comparison.tolerance,
        over_tolerance=excess(comparison),
        at_crank_angle=float(theta[comparison.at]),
    )
