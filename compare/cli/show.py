"""``compare show``: both sides of one number of a cross-check and where each comes from, or what a diagnosis says."""

from __future__ import annotations

import math
from pathlib import Path
from typing import cast

from compare.cli.typed import CommandLine, Shown, command
from compare.questions.show import ShowQuestion


@command(ShowQuestion, Shown)
def show(line: CommandLine) -> None:
    """Print one number of a result: both sides, the equation and the module, the engine and its settings, and the
    verdict.  Of a diagnosis print what it says, or a signal's residual before and after by run.

    Exit status: 0 shown, 2 bad input.
    """
    with line.complaints():
        from compare.results.crosscheck import CrossCheck
        from compare.show import read, show

        question = line.asked(ShowQuestion)
        document, at = read(cast(Path, question.result)), question.at
        over_time = isinstance(document, CrossCheck) and document.over_time
        where = at if at is None or over_time else math.radians(float(at))
        line.show(line.ask(show, ShowQuestion, result=document, at=where))
