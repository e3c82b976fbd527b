"""``compare cases``, ``compare simulators`` and ``compare effects``: what there is, and what it supports."""

from __future__ import annotations

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
