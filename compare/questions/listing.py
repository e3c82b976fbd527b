"""Earlier results, and the import of a model file as a mechanism."""

from pathlib import Path
from typing import Annotated

from compare.questions.option import Choice, File, Option
from compare.questions.question import Question
from compare.questions.shared import AnyPath

REPORTS = Path("reports")


class RunsQuestion(Question):
    """Which earlier results are meant."""

    folder: Annotated[AnyPath, Option("Where reports are.", File(), positional=True)] = REPORTS


TABLES = (
    "mechanism",
    "ground",
    "body",
    "joint",
    "elasticity",
    "drive",
    "ripple",
    "periodic_torque",
    "spring",
    "stop",
    "load",
    "sensor",
    "tolerance",
)


class FieldsQuestion(Question):
    """Which table of a mechanism file is meant."""

    table: Annotated[str | None, Option(f"One of {', '.join(TABLES)} [all].", positional=True)] = None


KINDS = {
    "four-bar": "crank-rocker",
    "slider-crank": "slider-crank",
    "quick-return": "",
    "six-bar": "six-bar",
    "five-bar": "five-bar",
    "arm": "2r-arm",
    "3-rrr": "3-rrr",
    "3-rpr": "3-rpr",
    "pendulum": "pendulum",
}  # each with the shipped case that it begins as; without one it has a file of its own in compare/kinds


class NewQuestion(Question):
    """Which linkage a mechanism file is to begin with."""

    name: Annotated[str, Option("Name of the linkage; its file is NAME.toml.", positional=True)]
    kind: Annotated[str, Option("What it is.", Choice(choices=tuple(KINDS)))] = "four-bar"


class ImportQuestion(Question):
    """Which model file is to be read."""

    file: Annotated[AnyPath, Option("MJCF or URDF file of a planar linkage.", File("FILE"), positional=True)]


class ApplyQuestion(Question):
    """Which mechanism's numbers are to go into which model file."""

    file: Annotated[AnyPath, Option("Mechanism file, such as explained.toml.", File("FILE"), positional=True)]
    to: Annotated[AnyPath, Option("The MJCF file that it was imported from.", File("FILE"))]
