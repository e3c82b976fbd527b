"""``compare show``: both sides of one number of a cross-check and where each comes from, or what a diagnosis says."""

from __future__ import annotations

import math

from compare.cli.publish import show as show_document
from compare.cli.typed import Line, Shown, command
from compare.questions.show import ShowQuestion


@command(ShowQuestion, Shown)
def show(line: Line) -> None:
    """Print one number of a result: both sides, the equation and the module, the engine and its settings, and the
    verdict.  Of a diagnosis print what it says, or a signal's residual before and after by run.

    Exit status: 0 shown, 2 bad input.
    """
    with line.complaints():
        from compare.results.crosscheck import CrossCheck
        from compare.show import read, show

        arguments = line.arguments(ShowQuestion)
        document = read(arguments["result"])
        if "at" in arguments and not (isinstance(document, CrossCheck) and document.over_time):
            arguments["at"] = math.radians(arguments["at"])
        show_document(show(**arguments | {"result": document}), **line.arguments(Shown))
