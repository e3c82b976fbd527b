"""``compare analyse`` and ``compare simulate``: one side of a comparison by itself."""

from __future__ import annotations

import typer

from compare.cli.sweep import answer, is_swept
from compare.cli.typed import CommandLine, Plotted, Shown, Where, command
from compare.faults import Exit
from compare.questions.analyse import AnalyseQuestion, SimulateQuestion
from compare.questions.sweep import SweepQuestion


@command(AnalyseQuestion, SweepQuestion, Where, Plotted, Shown)
def analyse(line: CommandLine) -> None:
    """Compute reactions, drive torque, positions and the displacement by clearance; write the linkage's page.

    With --set fields of the mechanism are varied, and a table says what each comes to.

    Exit status: 0 computed, 1 a --limit is broken or not known to hold, or with --set some points
    have no whole answer, 2 bad input.
    """
    with line.complaints() as caught:
        if is_swept(line):
            answer(line, "analyse", AnalyseQuestion, caught)
        from compare.analyse import analyse

        files = ["signals.csv", *["junit.xml"] * line.has("limit")]
        folder = line.folder(f"{line.stem}-analysis", "analysis.json", "analysis.html", *files)
        result = line.drawn(lambda: line.ask(analyse, AnalyseQuestion), caught, folder)
    raise typer.Exit(Exit.AGREES if result.holds else Exit.DISAGREES)


@command(SimulateQuestion, Where, Plotted, Shown)
def simulate(line: CommandLine) -> None:
    """Run one engine with one joint model; write signals.csv.

    Exit status: 0 simulated, 2 bad input, 3 the simulator is missing or failed.
    """
    with line.complaints() as caught:
        from compare.analyse import simulate

        folder = line.folder(f"{line.stem}-simulation", "simulation.json", "signals.csv")
        line.drawn(lambda: line.ask(simulate, SimulateQuestion), caught, folder)
