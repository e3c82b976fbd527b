"""The cross-check: the analytic model of a linkage against simulations of it."""

from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated

from compare.questions.option import ArgumentKind, Choice, File, Option, Switch, Whole
from compare.questions.question import Question
from compare.questions.shared import (
    JOINT_MODELS,
    AnyPath,
    CaseOption,
    Clearance,
    CourseFile,
    CrankAngles,
    Drives,
    GivenTimes,
    Large,
    ModelOption,
    MoreSignals,
    PathFile,
    ProgressOption,
    RunWorkers,
    ToleranceOption,
)

if TYPE_CHECKING:
    from compare.arguments import Simulators
    from sim_models.engine import JointModel

MOST_REVOLUTIONS = 32  # at the utmost, of a run whose pins strike


class CrosscheckQuestion(Question):
    """What to cross-check."""

    mechanism: CaseOption = "paper"
    simulator: Annotated[
        "Simulators",
        Option(
            "Engines to compare with, or all that are installed (see: compare simulators); mjcf:FILE and fmu:FILE are"
            " your own models.",
            ArgumentKind("NAME,..."),
            formerly="simulators",
            left_out=None,
        ),
    ] = "mujoco"
    _: KW_ONLY
    joint_model: Annotated[
        "JointModel | None",
        Option("One joint model; left out, all that the engine has.", Choice(choices=JOINT_MODELS), name="joint"),
    ] = None
    motion: Drives = "driven"
    clearance: Clearance = None
    large: Large = False
    angles: CrankAngles = None
    times: GivenTimes = None
    course: CourseFile = None
    path: PathFile = None
    signals: MoreSignals = None
    analytic: ModelOption = "equilibrium"
    flexible: Annotated[bool, Option("Let bodies with youngs_modulus bend, in static motion.", Switch())] = False
    tolerances: ToleranceOption = None
    map: Annotated[AnyPath | None, Option("Map of fmu:FILE [FILE's name with .map.toml].", File("FILE"))] = None
    revolutions: Annotated[
        int,
        Option(
            "Most revolutions of a run whose pins strike their walls; it ends once its averages are known.", Whole()
        ),
    ] = MOST_REVOLUTIONS
    verify: Annotated[
        bool,
        Option(
            "State each driven run's numerical uncertainty: run it in half and in quarter steps too (7 times as long).",
            Switch(),
        ),
    ] = False
    workers: RunWorkers = None
    progress: ProgressOption = None
