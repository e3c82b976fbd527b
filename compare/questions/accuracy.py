"""How accurate a linkage can be: over the turn of one crank, or with several drives along a motion or over places."""

from collections.abc import Mapping
from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated

from compare.questions.option import (
    Angle,
    ByJoint,
    Choice,
    Limits,
    Option,
    Part,
    Places,
    RepeatedNames,
    StepByJoint,
    Switch,
    Whole,
)
from compare.questions.question import Question
from compare.questions.shared import (
    MOTIONS,
    CaseOption,
    Clearance,
    CourseFile,
    CrankAngles,
    GivenTimes,
    Large,
    PathFile,
)

if TYPE_CHECKING:
    from compare.arguments import Metres, Names
    from sim_models.engine import Motion

DRAWS = 20_000  # of a Monte Carlo
MOST_SAMPLES = 1_000_000  # what a memory holds
WorkspaceGrid = tuple[tuple[float, float, int], tuple[float, float, int]]
"""Lowest, highest and number of the x and of the y (m) of a workspace."""

Outputs = Annotated[
    "Names | None",
    Option(
        "coupler, coupler.B, follower.angle, ...; left out, every body's com and angle.",
        RepeatedNames("POINT_OR_BODY"),
        name="output",
    ),
]


class AccuracyQuestion(Question):
    """How accurate a linkage is that one crank moves."""

    mechanism: CaseOption = "paper"
    _: KW_ONLY
    clearance: Clearance = None
    large: Large = False
    clearance_tolerance: Annotated[
        "Metres | None",
        Option("Clearances are uniform within +- this (m) in the Monte Carlo [0].", ByJoint("JOINT=M,...")),
    ] = None
    outputs: Outputs = None
    limits: Annotated[
        Mapping[str, float | str] | str | None,
        Option(
            "Largest good error, such as rocker_angle=0.05deg, of the linkages within [tolerances]; without any, and"
            " of worst_rocker_angle (the worst case), of the error by clearance: status 1 where it is more.",
            Limits("OUTPUT=VALUE", "rocker_angle=0.05deg"),
            name="limit",
        ),
    ] = None
    min_yield: Annotated[
        float | None,
        Option("Least share of the linkages that must be within the limits, such as 99%.", Part("PERCENT")),
    ] = None
    motion: Annotated[
        "Motion | None",
        Option("Reactions with inertia forces or without [driven, if the drive has a speed].", Choice(choices=MOTIONS)),
    ] = None
    angles: CrankAngles = None
    samples: Annotated[int, Option("Linkages in the Monte Carlo.", Whole(least=2, most=MOST_SAMPLES))] = DRAWS
    seed: Annotated[int, Option("Of the Monte Carlo's random numbers.", Whole())] = 0
    nonlinear: Annotated[bool, Option("Close the linkage again for every sample.", Switch())] = False


class PlatformQuestion(Question):
    """How accurate a linkage with several drives is."""

    mechanism: CaseOption
    _: KW_ONLY
    clearance: Clearance = None
    large: Large = False
    encoder_step: Annotated[
        Mapping[str, float | str] | None,
        Option(
            "Steps of the drives' encoders (rad, m, or with a unit), of several drives.",
            StepByJoint("JOINT=STEP,...", each="JOINT=rad, or m where the joint slides, such as D=0.01deg"),
        ),
    ] = None
    outputs: Outputs = None
    workspace: Annotated[
        WorkspaceGrid | None,
        Option("Map of several drives: places (m) of the first output, and how many.", Places("X0:X1:NX,Y0:Y1:NY")),
    ] = None
    angle: Annotated[
        float | None, Option("Angle ({unit}) of that body over the workspace [as assembled].", Angle("DEG"))
    ] = None
    times: GivenTimes = None
    course: CourseFile = None
    path: PathFile = None
