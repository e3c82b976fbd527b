"""Earlier results, and the import of a model file as a mechanism."""

from pathlib import Path
from typing import Annotated

from compare.questions.option import File, Option
from compare.questions.question import Question
from compare.questions.shared import AnyPath

REPORTS = Path("reports")


class RunsQuestion(Question):
    """Which earlier results are meant."""

    folder: Annotated[AnyPath, Option("Where reports are.", File(), positional=True)] = REPORTS


class ImportQuestion(Question):
    """Which model file is to be read."""

    file: Annotated[AnyPath, Option("MJCF file of a planar linkage.", File("FILE"), positional=True)]
