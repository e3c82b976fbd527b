"""Sweeps: the same question where fields of the mechanism take several values."""

from collections.abc import Mapping
from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated

from compare.faults import ArgumentError, unusable
from compare.questions.option import Address, ArgumentKind, Choice, Option
from compare.questions.question import Question
from compare.questions.shared import CaseOption, ProgressOption, Workers

if TYPE_CHECKING:
    from compare.arguments import Values
    from compare.results.sweep import Asks


ASKS = ("analyse", "accuracy", "platform_accuracy", "crosscheck")


class FieldValues(ArgumentKind[list[str]]):
    """Values by dotted field, ``joint.B.clearance=0.1mm,0.2mm``, in an option that may be repeated; that there are such
    fields is for the function to prove.
    """

    repeated = True

    def parse(self, word: list[str], called: str) -> dict[str, str]:
        """The text of the values, each field once."""
        fields: dict[str, str] = {}
        for text in word:
            name, given, values = text.partition("=")
            if not given:
                raise ArgumentError(called, f"{text!r} has no values; give FIELD=START:STOP:STEP or FIELD=VALUE,VALUE")
            if name in fields:
                raise ArgumentError(called, f"{name} is there twice; give each field once")
            fields[name.strip()] = values
        return fields

    def check(self, given: object, called: str) -> object:
        if isinstance(given, Mapping) and given and all(isinstance(name, str) for name in given):
            return given
        raise unusable(called, given, 'values by field, such as {"drive.speed": "30 rpm:300 rpm:30 rpm"}')

    def stands_for(self, argument: object) -> object:
        """None of no fields, which typer cannot show."""
        return argument or None


class SweepQuestion(Question):
    """Which fields take which values, and what is asked at each of them."""

    mechanism: CaseOption
    fields: Annotated[
        "Mapping[str, Values]",
        Option(
            "Vary a field of the mechanism file, dotted as it is nested: drive.speed='30 rpm:300 rpm:30 rpm',"
            " joint.B.clearance=0.1mm,0.2mm; several make a grid.",
            FieldValues("FIELD=VALUES"),
            name="set",
            left_out=None,
        ),
    ]
    asks: Annotated[
        "Asks",
        Option(
            "What is asked at each point.",
            Choice(choices=ASKS),
            typed=False,
        ),
    ] = "analyse"
    _: KW_ONLY
    options: Annotated[
        Mapping[str, object] | None, Option("Its other arguments, as they are for each point.", typed=False)
    ] = None
    workers: Workers = None
    dask: Annotated[str | None, Option("Scheduler of a Dask cluster that is to do the points.", Address("ADDRESS"))] = (
        None
    )
    progress: ProgressOption = None
