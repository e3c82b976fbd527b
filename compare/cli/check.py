"""``compare check``: what another program has computed of a linkage, held against the analytic model."""

from __future__ import annotations

from compare.cli.typed import CommandLine, Shown, Where, command
from compare.questions.check import CheckQuestion


@command(CheckQuestion, Where, Shown)
def check(line: CommandLine) -> None:
    """Check the recorded results of any program against the analytic model, and against engines beside.

    Exit status: 0 agrees, 1 disagrees beyond tolerance or cannot be judged, 2 bad input, 3 a simulator is missing or
    failed.
    """
    with line.complaints() as caught:
        from compare.check import check

        stem = "-".join([line.stem, *(file.stem for file in line.files("results")[:3])])
        folder = line.folder(stem, "result.json", "junit.xml", "signals.csv")
        line.judge(lambda: line.ask(check, CheckQuestion), caught, folder)
