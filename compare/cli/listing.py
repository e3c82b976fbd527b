"""``compare cases`` and ``compare simulators``: what there is, what is installed, what it supports."""

from __future__ import annotations

import typer


def cases() -> None:
    """List the mechanisms that ship with the package."""
    from analytic.mechanism.file import load, shipped_cases

    for name in shipped_cases():
        m = load(name)
        gaps = ", ".join(f"{joint} {c * 1000:g} mm" for joint, c in m.clearances.items()) or "none"
        typer.echo(f"{name:14} {len(m.bodies)} bodies, {len(m.joints)} joints, clearance: {gaps}")


def simulators() -> None:
    """List the engines: installed or not, and the joint models, motions and effects that each supports."""
    from rich.console import Console
    from rich.table import Table

    from sim_models.engine import COMMON_EFFECTS, ENGINES, JOINT_MODELS, broken, declared, installed_version

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("simulator", "version", *JOINT_MODELS, "effects"):
        table.add_column(heading, overflow="fold")
    faults: dict[str, str] = {}
    for name in ENGINES:
        engine = declared(name)
        motions = [
            ", ".join(m for m in ("driven", "static") if (model, m) in engine.supports) or "-" for model in JOINT_MODELS
        ]
        more = sorted(engine.effects - COMMON_EFFECTS)
        less = sorted(COMMON_EFFECTS - engine.effects)
        effects = "all common" + "".join(f" + {e}" for e in more) + "".join(f" - {e}" for e in less)
        version = installed_version(engine.package)
        faults[name] = broken(engine.package) if version else ""
        table.add_row(name, "broken" if faults[name] else version or "not installed", *motions, effects)
    console = Console(width=130, highlight=False)
    console.print(table)
    for name, fault in faults.items():
        if fault:
            console.print(f"{name} is installed but cannot be imported: {fault}", soft_wrap=True, markup=False)
    console.print(f"common effects: {', '.join(sorted(COMMON_EFFECTS))}", soft_wrap=True)
    console.print(
        "install one with: pip install 'linkage-crosscheck[NAME]' (in a clone: pip install '.[NAME]')", markup=False
    )
