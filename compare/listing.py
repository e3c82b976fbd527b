"""``compare cases`` and ``compare simulators``: what there is, what is installed, what it supports."""

from __future__ import annotations

import typer


def cases() -> None:
    """List the mechanisms that ship with the package."""
    from analytic.mechanism_file import load, shipped_cases

    for name in shipped_cases():
        m = load(name)
        gaps = ", ".join(f"{joint} {c * 1000:g} mm" for joint, c in m.clearances.items()) or "none"
        typer.echo(f"{name:14} {len(m.bodies)} bodies, {len(m.joints)} joints, clearance: {gaps}")


def simulators() -> None:
    """List the engines: installed or not, and the joint models and motions that each supports."""
    from sim_models.engine import ENGINES, JOINT_MODELS, declared, installed_version

    for name in ENGINES:
        engine = declared(name)
        found = installed_version(engine.package)
        typer.echo(f"{name:10} {found or 'not installed: pip install linkage-crosscheck[' + name + ']'}")
        for model in JOINT_MODELS:
            motions = [motion for motion in ("driven", "static") if (model, motion) in engine.supports]
            typer.echo(f"{'':10}   {model:14} {', '.join(motions) or '-'}")
