"""``compare analyse`` and ``compare simulate``: one side of a comparison by itself."""

from __future__ import annotations

from compare.cli.typed import CommandLine, Plotted, Shown, Where, command
from compare.questions.analyse import AnalyseQuestion, SimulateQuestion


@command(AnalyseQuestion, Where, Plotted, Shown)
def analyse(line: CommandLine) -> None:
    """Compute reactions, drive torque, positions and the displacement by clearance; write the linkage's page.

    Exit status: 0 computed, 2 bad input.
    """
    with line.complaints() as caught:
        from compare.analyse import analyse

        folder = line.folder(f"{line.stem}-analysis", "analysis.json", "analysis.html", "signals.csv")
        line.drawn(lambda: line.ask(analyse, AnalyseQuestion), caught, folder)


@command(SimulateQuestion, Where, Plotted, Shown)
def simulate(line: CommandLine) -> None:
    """Run one engine with one joint model; write signals.csv.

    Exit status: 0 simulated, 2 bad input, 3 the simulator is missing or failed.
    """
    with line.complaints() as caught:
        from compare.analyse import simulate

        folder = line.folder(f"{line.stem}-simulation", "simulation.json", "signals.csv")
        line.drawn(lambda: line.ask(simulate, SimulateQuestion), caught, folder)
