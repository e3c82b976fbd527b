"""``compare baseline update`` and ``check``: reaction forces stored to be reviewed, and whatever has moved since."""

from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from analytic.writing import write_atomically
from compare.cli.folders import refuse_inputs
from compare.cli.publish import say
from compare.cli.typed import CommandLine, Shown, command
from compare.faults import OptionError, printable
from compare.files import made_folder
from compare.questions.baseline import BaselinesQuestion
from compare.questions.option import Option, Written
from compare.questions.question import Question

if TYPE_CHECKING:
    from compare.results.baselines import Baselines

baseline = typer.Typer(
    help="Regression on reaction-force angles: store them, and find what has moved.", no_args_is_help=True
)


class Junit(Question):
    """For whoever shows tests."""

    junit: Annotated[Path | None, Option("Write a JUnit file too.", Written("FILE"))] = None


@baseline.command()
@command(BaselinesQuestion, Junit, Shown)
def check(line: CommandLine) -> None:
    """Run every case in every engine, and report all reaction forces that are not where the baseline has them.

    Exit status: 0 nothing moved, 1 something moved, 2 a baseline is missing or damaged, 3 a simulator is missing or
    failed.

    In CI: docs/how-to/ci.md has a workflow.
    """
    with line.complaints():
        from compare.baseline.check import check_baselines

        junit = line.asked(Junit).junit
        refuse_inputs(line.context, [junit] if junit is not None else [], "--junit")
        line.tests.extend([junit] if junit is not None else [])
        with nullcontext() if junit is None else made_folder(junit.parent, "--junit"):
            baselines = _asked(line, check_baselines)
            if junit is not None:
                from compare.report.baselines import junit as junit_of

                write_atomically(junit, junit_of(baselines))
    _end(line, baselines)


@baseline.command()
@command(BaselinesQuestion, Shown)
def update(line: CommandLine) -> None:
    """Write the baseline of every case in every engine; numbers that have not moved, and files without any that have,
    stay as they are.

    Commit them: compare baseline check then says what has moved.

    In CI: docs/how-to/ci.md has a workflow.

    Exit status: 0 written, 2 bad input, 3 a simulator is missing or failed.
    """
    with line.complaints():
        from compare.baseline.check import update_baselines

        baselines = _asked(line, update_baselines)
    _end(line, baselines)


def _asked(line: CommandLine, function: Callable[..., "Baselines"]) -> "Baselines":
    """What comes of a command.  Raises OptionError."""
    if line.has("results") and not line.has("case"):
        raise OptionError("--results: they are of one case; name it with --case")
    return line.ask(function, BaselinesQuestion)


def _end(line: CommandLine, baselines: "Baselines") -> None:
    """Print what was found, say what was not, and leave with the gravest status."""
    from compare.baseline.check import status

    line.show(baselines)
    faults = [entry.why for entry in baselines.entries if entry.status in ("unusable", "failed")]
    say(each for each in baselines.left_out if each not in faults)
    say(f"compare: {printable(why)}" for why in faults)
    raise typer.Exit(status(baselines))
