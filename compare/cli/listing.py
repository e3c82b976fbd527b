"""``compare cases``, ``simulators``, ``effects``, ``fields``: what there is, and what it supports.

``compare list``: what was found before.
"""

from __future__ import annotations

from compare.cli.typed import CommandLine, Shown, command
from compare.questions.listing import FieldsQuestion, RunsQuestion


@command(Shown)
def cases(line: CommandLine) -> None:
    """List the mechanisms that ship with the package."""
    with line.complaints():
        from compare.catalogue import cases

        line.show(cases())


@command(Shown)
def simulators(line: CommandLine) -> None:
    """List the engines: installed or not, and the joint models, motions and effects that each supports."""
    with line.complaints():
        from compare.catalogue import simulators

        line.show(simulators())


@command(Shown)
def effects(line: CommandLine) -> None:
    """List the effects that a diagnosis can name: meaning, parameters, units, and which engines simulate each."""
    with line.complaints():
        from compare.catalogue import effects

        line.show(effects())


@command(FieldsQuestion, Shown)
def fields(line: CommandLine) -> None:
    """List what a mechanism file, or a table of it, may hold: unit, default and meaning of each field.

    Exit status: 0 listed, 2 there is no such table.
    """
    with line.complaints():
        from compare.mechanism_fields import fields

        line.show(line.ask(fields, FieldsQuestion))


@command(RunsQuestion, Shown)
def runs(line: CommandLine) -> None:
    """List earlier results, newest first: cross-checks, diagnoses and all others, with the command of each.

    Exit status: 0 listed, 2 there is no such folder.
    """
    with line.complaints():
        from compare.history import runs

        line.show(line.ask(runs, RunsQuestion))
