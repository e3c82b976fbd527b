"""The diagnosis: which effect a model lacks; and a measured.toml to begin with."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated, Literal

from compare.questions.option import AllOrNone, Files, Option, RepeatedNames, Seconds, Switch, Whole
from compare.questions.question import Question
from compare.questions.shared import ProgressOption

if TYPE_CHECKING:
    from pathlib import Path

    from compare.arguments import Names
    from compare.diagnose.data.recording import Measured
    from compare.diagnose.effects.effect import Effect


class DiagnoseQuestion(Question):
    """Which data are to be explained, and by what."""

    measured: Annotated[
        "Measured | str | Path",
        Option(
            "Runs, their data files and the nominal mechanism; with --init data files.",
            Files("MEASURED.TOML"),
            positional=True,
        ),
    ]
    simulator: Annotated[str, Option("Engine that simulates before and after (see: compare simulators).")] = "mujoco"
    _: KW_ONLY
    only: Annotated["Names", Option("Consider no other effect; may be repeated.", RepeatedNames("EFFECT[@WHERE]"))] = ()
    exclude: Annotated["Names", Option("Rule an effect out; may be repeated.", RepeatedNames("EFFECT[@WHERE]"))] = ()
    own: Annotated["Sequence[Effect]", Option("Effects beside the vocabulary.", typed=False)] = ()
    adopt: Annotated[
        bool, Option("Put the law that is proposed into the model and diagnose again with it.", Switch())
    ] = False
    others: Annotated[
        bool | Literal["all", "none"],
        Option(
            "Engines that simulate the explanation too: every installed one, or none.",
            AllOrNone(choices=("all", "none")),
        ),
    ] = True
    workers: Annotated[
        int | None, Option("Processes for the simulations [2, or the cores that there are].", Whole(least=1))
    ] = None
    budget: Annotated[
        float | None, Option("End the search then, with the best so far [when it is done].", Seconds("SECONDS"))
    ] = None
    progress: ProgressOption = None
