"""Which runs and which sensors would tell what a model lacks, before any data exist."""

from collections.abc import Mapping
from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated

from compare.questions.option import AboveZero, ArgumentKind, BySignal, Option
from compare.questions.question import Question
from compare.questions.shared import ProgressOption

if TYPE_CHECKING:
    from compare.arguments import Linkage
    from compare.diagnose.data.recording import Measured

RUNS = 3.0  # that a plan is of, where nobody gives a budget


class PlanQuestion(Question):
    """What a rig can do, and what its runs and sensors may cost."""

    rig: Annotated[
        "Linkage | Measured",
        Option(
            "Mechanism file, shipped case, or a plan.toml that says what the rig can do.",
            ArgumentKind("NOMINAL.TOML"),
            positional=True,
        ),
    ]
    _: KW_ONLY
    sensors: Annotated[
        Mapping[str, float | str] | str | None,
        Option(
            "Sensors that there are, with their noise (1 sigma, SI or with its unit) [those of the plan.toml].",
            BySignal("SIGNAL=NOISE,...", each="SIGNAL=NOISE, such as drive_torque=0.05 or crank_angle=0.01deg"),
        ),
    ] = None
    budget: Annotated[
        float | None, Option("What runs and sensors may cost; a run costs 1 [3, or the plan.toml's].", AboveZero())
    ] = None
    progress: ProgressOption = None
