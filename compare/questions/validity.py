"""The map of validity: over speed and clearance, where the analytic model agrees with simulations."""

from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated

from compare.questions.option import (
    Address,
    Choice,
    Clearances,
    IncreasingNumbers,
    NameList,
    Option,
    Speeds,
    Whole,
    Written,
)
from compare.questions.question import Question
from compare.questions.shared import (
    JOINT_MODELS,
    AnyPath,
    CaseOption,
    EnginesOption,
    Large,
    ProgressOption,
    ToleranceOption,
    Workers,
)

if TYPE_CHECKING:
    from compare.arguments import Names, Numbers
    from sim_models.engine import JointModel


class ValidityQuestion(Question):
    """The axes, engines and contact of a map."""

    mechanism: CaseOption = "paper"
    _: KW_ONLY
    speeds: Annotated["Numbers", Option("Speeds of the crank ({unit}).", Speeds("RPM,..."))]
    clearances: Annotated[
        "Numbers",
        Option("Radial clearances ({unit}); half the play of a block.", Clearances("M,...")),
    ]
    simulator: EnginesOption = "mujoco"
    large: Large = False
    joint_model: Annotated["JointModel", Option("Joint model.", Choice(choices=JOINT_MODELS), name="joint")] = "contact"
    joints: Annotated[
        "Names | None",
        Option(
            "Joints with the clearance [the case's, else the farthest from the ground].",
            NameList("JOINT,...", least=1),
            also="--at",
            formerly="at",
        ),
    ] = None
    restitutions: Annotated[
        "Numbers | None",
        Option("Restitutions of the contact, a map for each [the mechanism's own].", IncreasingNumbers("E,...")),
    ] = None
    revolutions: Annotated[
        int, Option("Turns of the crank over which contact is watched, after one that is not.", Whole())
    ] = 1
    tolerances: ToleranceOption = None
    workers: Workers = None
    dask: Annotated[str | None, Option("Scheduler of a Dask cluster that is to do the runs.", Address("ADDRESS"))] = (
        None
    )
    records: Annotated[
        AnyPath | None,
        Option("Folder that keeps the cells that are done, for a map that is interrupted.", Written(), typed=False),
    ] = None
    progress: ProgressOption = None
