"""Arguments that several questions have."""

from os import PathLike
from typing import TYPE_CHECKING, Annotated

from compare.questions.option import (
    Angles,
    ByJoint,
    Choice,
    File,
    Listed,
    NameList,
    Option,
    Switch,
    Times,
    TomlTolerances,
    Whole,
)

if TYPE_CHECKING:
    from analytic.paper.clearance import Model
    from compare.arguments import Linkage, Metres, Names, Numbers, Simulators, ToleranceFile
    from compare.progress import Progress
    from sim_models.engine import JointModel, Motion

JOINT_MODELS = ("ideal", "massless-link", "spring-damper", "contact")
MOTIONS = ("driven", "static")
MODELS = ("first_order", "equilibrium")

AnyPath = str | PathLike[str]
CaseOption = Annotated["Linkage", Option("Shipped case (see: compare cases) or a mechanism file.", name="case")]
HeadingsOption = Annotated[
    "Names | None", Option("Headings of data files without a header.", NameList("HEADING,...", least=1))
]
SplitOption = Annotated[
    bool, Option("Take each part of a file whose clock starts again as a run of its own.", Switch())
]
Large = Annotated[bool, Option("Take clearances of more than a tenth of the shortest body at their joint.", Switch())]
Clearance = Annotated[
    "Metres | None", Option("Radial clearances (m) in place of the case's own.", ByJoint("JOINT=M,..."))
]
OneModel = Annotated[
    "JointModel", Option("What the joints with clearance are.", Choice(choices=JOINT_MODELS), name="joint")
]
Drives = Annotated[
    "Motion", Option("Drives at work, or an equilibrium at each angle or time.", Choice(choices=MOTIONS))
]
ModelOption = Annotated["Model", Option("Analytic model: first order (Eq. 8) or equilibrium.", Choice(choices=MODELS))]
EnginesOption = Annotated[
    "Simulators",
    Option("Engines to compare with, or all that are installed.", Listed("NAME,..."), formerly="simulators"),
]
EngineOption = Annotated[str, Option("Engine (see: compare simulators).")]
ToleranceOption = Annotated[
    "ToleranceFile | None", Option("Tolerance file laid over the shipped one.", TomlTolerances(), name="tolerance")
]
Workers = Annotated[int | None, Option("Processes [one a core].", Whole(least=1))]
RunWorkers = Annotated[
    int | None, Option("Processes [one a core where there are several engines, or points].", Whole(least=1))
]
ProgressOption = Annotated[
    "Progress | None",
    Option(
        "Told what is being done, how many are done and how many there are [a bar on a terminal, or in a notebook].",
        typed=False,
    ),
]
CrankAngles = Annotated[
    "Numbers | None", Option("Crank angles ({unit}) [those of the case].", Angles("START:STOP:STEP"))
]
GivenTimes = Annotated[
    "Numbers | None", Option("Times (s), of several drives or of one that turns no crank.", Times("START:STOP:STEP"))
]
CourseFile = Annotated[AnyPath | None, Option("Course of the drives: time and position_<joint> columns.", File("FILE"))]
MoreSignals = Annotated[
    "Names | None",
    Option(
        "Signals beside the usual ones: velocities, accelerations and drive_power, by name, or all of them.",
        NameList("NAME,..."),
    ),
]
PathFile = Annotated[
    AnyPath | None, Option("Path of a platform: time and its <body>_x, _y, _angle columns.", File("FILE"))
]
