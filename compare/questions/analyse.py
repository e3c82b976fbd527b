"""One side of a comparison by itself: what the analytic model says, what an engine does, its model file."""

from collections.abc import Mapping
from dataclasses import KW_ONLY
from typing import Annotated

from compare.questions.option import LeftOut, Limits, Option, Switch, Whole, Written
from compare.questions.question import Question
from compare.questions.shared import (
    AnyPath,
    CaseOption,
    Clearance,
    CourseFile,
    CrankAngles,
    Drives,
    EngineOption,
    GivenTimes,
    Large,
    ModelOption,
    MoreSignals,
    OneModel,
    PathFile,
)

MOST_MADE = 100_000  # linkages that are analysed one by one: a hundred a second


class AnalyseQuestion(Question):
    """The motion and the model of an analysis."""

    mechanism: CaseOption = "paper"
    _: KW_ONLY
    clearance: Clearance = None
    large: Large = False
    model: ModelOption = "equilibrium"
    motion: Drives = "driven"
    compliance: Annotated[bool, Option("Let links and joints yield as well.", Switch())] = False
    samples: Annotated[
        int, Option("Linkages within [tolerances] that are analysed, each as a whole [none].", Whole(most=MOST_MADE))
    ] = 0
    seed: Annotated[int, Option("Of their random numbers.", Whole())] = 0
    angles: CrankAngles = None
    times: GivenTimes = None
    course: CourseFile = None
    path: PathFile = None
    signals: MoreSignals = None
    limits: Annotated[
        Mapping[str, float | str] | str | None,
        Option(
            "Largest size of a signal (reaction_B=500N, drive_torque=20N.m) or of an error by clearance"
            " (error_rocker_angle=0.05deg in equilibrium, worst_rocker_angle), its RMS (rms_drive_torque=5N.m), least"
            " transmission_angle=40deg, or a range (stroke_rocker=84:87deg; either end may be left out); status 1 where"
            " one is broken.",
            Limits("NAME=VALUE", "reaction_B=500N"),
            name="limit",
        ),
    ] = None


class RunQuestion(Question):
    """The run that an engine is to make."""

    mechanism: CaseOption = "paper"
    simulator: EngineOption = "mujoco"
    _: KW_ONLY
    joint_model: OneModel = "ideal"
    motion: Drives = "driven"
    clearance: Clearance = None
    large: Large = False
    angles: CrankAngles = None
    times: GivenTimes = None
    course: CourseFile = None
    path: PathFile = None


class SimulateQuestion(RunQuestion):
    """The run that an engine is to make, and what is read of it."""

    _: KW_ONLY
    signals: MoreSignals = None


class ExportQuestion(RunQuestion):
    """The run that an engine is to make without this project."""

    simulator: Annotated[
        str, Option("Engine whose model is wanted (see: compare simulators).", left_out=LeftOut.REFUSED)
    ] = "mujoco"
    _: KW_ONLY
    folder: Annotated[AnyPath, Option("Folder for the files.", Written("DIR"), name="out")]
