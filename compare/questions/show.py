"""The part of a result that is shown: one number of a cross-check, or a signal's residuals of a diagnosis."""

from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated

from compare.questions.option import Moment, Option, Source
from compare.questions.question import Question

if TYPE_CHECKING:
    from pathlib import Path

    from compare.results.crosscheck import CrossCheck
    from compare.results.diagnosis import Diagnosis


class ShowQuestion(Question):
    """Which number of which result."""

    result: Annotated[
        "CrossCheck | Diagnosis | str | Path",
        Option("A result.json or a diagnosis.json.", Source("RESULT"), positional=True),
    ]
    signal: Annotated[
        str | None, Option("Name of the signal, such as reaction_B_angle; of a diagnosis it may be left out.")
    ] = None
    _: KW_ONLY
    at: Annotated[
        float | str | None,
        Option(
            "Crank angle ({unit}) of a result; time (s) where the linkage swings freely.",
            Moment(),
        ),
    ] = None
    joint_model: Annotated[str | None, Option("Joint model; left out, all that the result has.", name="joint")] = None
    simulator: Annotated[str | None, Option("Engine; left out, all that the result has.")] = None
