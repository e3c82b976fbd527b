"""``compare plan``: the runs and sensors that would tell what a model lacks, before any data exist."""

from __future__ import annotations

from typing import cast

from compare.cli.folders import named_after
from compare.cli.typed import CommandLine, Shown, Where, command
from compare.questions.plan import PlanQuestion


@command(PlanQuestion, Where, Shown)
def plan(line: CommandLine) -> None:
    """Plan the runs and sensors that would tell which effect a model lacks, before any data exist.

    Exit status: 0 computed, 2 bad input.
    """
    with line.complaints() as caught:
        from compare.diagnose.plan.workflow import plan

        stem = named_after(cast(str, line.words["rig"]))
        files = ("plan.json", "plan.html", "measured.toml", "nominal.toml")
        folder = line.folder(f"{stem}-plan", *files)
        line.answer(lambda: line.ask(plan, PlanQuestion), caught, folder)
