"""The prediction: an explained model where nothing was measured."""

from collections.abc import Mapping
from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated

from compare.questions.option import ByBody, File, NameList, Option, Source, WithUnit
from compare.questions.question import Question
from compare.questions.shared import AnyPath, ProgressOption

if TYPE_CHECKING:
    from compare.arguments import Names
    from compare.results.diagnosis import Diagnosis


class PredictQuestion(Question):
    """Which runs are to be foretold, from which diagnosis."""

    diagnosis: Annotated[
        "Diagnosis | AnyPath", Option("Result of compare diagnose.", Source("DIAGNOSIS.JSON"), positional=True)
    ]
    run: Annotated[
        AnyPath | None,
        Option("A measured.toml whose runs are foretold, in place of a speed.", File("RUN.TOML"), positional=True),
    ] = None
    _: KW_ONLY
    speed: Annotated[
        "float | str | None",
        Option(
            "Speed of the crank, such as '300 rpm'; a bare number is rad/s [the fastest measured].",
            WithUnit("SPEED", unit="rad/s"),
        ),
    ] = None
    load: Annotated[
        "Mapping[str, tuple[float, float]] | None",
        Option(
            "Force (N) at a body's centre of mass, in place of the mechanism's loads; may be repeated.",
            ByBody("BODY=X:Y"),
        ),
    ] = None
    signals: Annotated[
        "Names | None", Option("Signals to foretell [those that were measured].", NameList("NAME,..."))
    ] = None
    simulator: Annotated[
        str | None, Option("Engine that makes the run beside the analytic model, or none [that of the diagnosis].")
    ] = None
    progress: ProgressOption = None
