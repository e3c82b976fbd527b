"""``compare accuracy``: what clearance and compliance do to the outputs that a user names, over the whole cycle."""

from __future__ import annotations

import typer

from compare.cli.sweep import answer, is_swept
from compare.cli.typed import CommandLine, Plotted, Shown, Where, command, option_names
from compare.faults import Exit, OptionError
from compare.questions.accuracy import AccuracyQuestion, PlatformQuestion
from compare.questions.sweep import SweepQuestion

OF_A_CRANK = [name for name in option_names(AccuracyQuestion) if name not in option_names(PlatformQuestion)]
OF_SEVERAL = [name for name in option_names(PlatformQuestion) if name not in option_names(AccuracyQuestion)]


@command(AccuracyQuestion, PlatformQuestion, SweepQuestion, Where, Plotted, Shown)
def accuracy(line: CommandLine) -> None:
    """Say how accurate a linkage with clearance can be: nominal, worst case, by joint, Monte Carlo, compliance.

    With several drives: the errors of a platform along a motion, or over its workspace.  With --set fields of the
    mechanism are varied, and a table says what each comes to.

    Exit status: 0 computed, 1 a --limit of the error by clearance is broken or not known to hold, fewer linkages than
    --min-yield are within the limits, or with --set some points have no whole answer, 2 bad input.
    """
    with line.complaints() as caught:
        from analytic.kinematics.assembly import Assembly
        from compare.accuracy import accuracy
        from compare.arguments import linkage
        from compare.platform import platform_accuracy

        files = [
            "accuracy.json",
            "accuracy.csv",
            "accuracy.html",
            *["junit.xml"] * (line.has("limit") or line.has("min_yield")),
        ]
        folder = None if is_swept(line) else line.folder(f"{line.stem}-accuracy", *files)
        if not any(map(line.has, OF_SEVERAL)) and Assembly(linkage(line.case, large=True)).structure.by_crank:
            if folder is None:
                answer(line, "accuracy", AccuracyQuestion, caught)
            result = line.drawn(lambda: line.ask(accuracy, AccuracyQuestion), caught, folder)
            raise typer.Exit(Exit.AGREES if result.holds else Exit.DISAGREES)
        for name in filter(line.has, OF_A_CRANK):
            option = f"--{name.replace('_', '-')}"
            raise OptionError(f"{option} is of linkages that one crank moves, over its angle; leave it out")
        if folder is None:
            answer(line, "platform_accuracy", PlatformQuestion, caught)
        line.drawn(lambda: line.ask(platform_accuracy, PlatformQuestion), caught, folder)
