"""``compare cases``, ``compare simulators`` and ``compare effects``: what there is, and what it supports; ``compare
list``: what was found before.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compare.cli.options import Json, Quiet
from compare.cli.publish import show
from compare.faults import complaints


def cases(json: Json = False, quiet: Quiet = False) -> None:
    """List the mechanisms that ship with the package."""
    with complaints():
        from compare.catalogue import cases as listed

        show(listed(), json=json, quiet=quiet)


def simulators(json: Json = False, quiet: Quiet = False) -> None:
    """List the engines: installed or not, and the joint models, motions and effects that each supports."""
    with complaints():
        from compare.catalogue import simulators as listed

        show(listed(), json=json, quiet=quiet)


def effects(json: Json = False, quiet: Quiet = False) -> None:
    """List the effects that a diagnosis can name: meaning, parameters, units, and which engines simulate each."""
    with complaints():
        from compare.catalogue import effects as listed

        show(listed(), json=json, quiet=quiet)


def runs(
    context: typer.Context,
    folder: Annotated[Path | None, typer.Argument(help="Where reports are [reports].")] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """List earlier results, newest first: cross-checks, diagnoses, accuracy and validity, with the command of each.

    Exit status: 0 listed, 2 there is no such folder.
    """
    with complaints(context):
        from compare.history import WHERE
        from compare.history import runs as listed

        show(listed(WHERE if folder is None else folder), json=json, quiet=quiet)
