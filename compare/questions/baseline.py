"""Which baselines are checked or written."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from compare.questions.option import ArgumentKind, File, Files, NameList, Option, Written
from compare.questions.question import Question
from compare.questions.shared import AnyPath, ProgressOption

if TYPE_CHECKING:
    from compare.arguments import Linkage, Names, Simulators
    from compare.questions.check import Results

BASELINES = Path("reports") / "baselines"


class BaselinesQuestion(Question):
    """The linkages of baselines, and the engines or results that they are held to."""

    cases: Annotated[
        "Linkage | Sequence[Linkage] | None",
        Option("Shipped case or a mechanism file; left out, every shipped case.", name="case"),
    ] = None
    simulator: Annotated[
        "Simulators",
        Option("Engines; all is every one that is installed.", ArgumentKind("NAME,..."), formerly="simulators"),
    ] = "all"
    folder: Annotated[AnyPath, Option("Folder of the baseline files.", Written("DIR"), name="baselines")] = BASELINES
    _: KW_ONLY
    results: Annotated[
        "Results | None", Option("Another program's results of the case in place of an engine's.", Files("FILE"))
    ] = None
    signals: Annotated[
        "Names | None",
        Option(
            "Signals beside the reactions of runs that move, kept from then on, by name; all is every velocity and"
            " acceleration and drive_power; of an update.",
            NameList("NAME,..."),
        ),
    ] = None
    map: Annotated[AnyPath | None, Option("What the columns of those results are.", File("FILE"))] = None
    progress: ProgressOption = None
