"""Lists of cases, engines and effects, shown."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from analytic.mechanism.one_line import count
from compare.results.catalogue import Cases, Effects, Simulators
from sim_models.engine import JOINT_MODELS, SCHEMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Listed = Cases | Simulators | Effects


def files(result: Listed) -> dict[str, str]:
    """The list as a table for other programs."""
    return {result.file.replace(".json", ".csv"): result.to_csv()}


def plot(result: Listed, figure: Figure) -> None:
    """A list has no picture.  Raises TypeError."""
    raise TypeError(f"{type(result).__name__} is a list and has no picture; use to_dataframe()")


def summary_html(result: Listed) -> str:
    """The list as an HTML table."""
    rows = result.rows()
    columns = list(dict.fromkeys(name for row in rows for name in row))
    head = "".join(f"<th>{html.escape(name)}</th>" for name in columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{html.escape(str(row.get(name, '')))}</td>" for name in columns) + "</tr>"
        for row in rows
    )
    return f"<table><tr>{head}</tr>{body}</table>"


def print_table(result: Listed, console: Console) -> None:
    """Print the list, a line or two for each entry."""
    if isinstance(result, Cases):
        for case in result.cases:
            gaps = ", ".join(f"{joint} {c * 1000:g} mm" for joint, c in case.clearance.items()) or "none"
            bodies = f"{len(case.bodies)} {'body' if len(case.bodies) == 1 else 'bodies'}"
            line = f"{case.name:14} {bodies}, {count(len(case.joints), 'joint')}, clearance: {gaps}"
            console.print(line, soft_wrap=True, highlight=False)
    elif isinstance(result, Simulators):
        _print_simulators(result, console)
    else:
        for effect in result.effects:
            values = ", ".join(f"{p.name} [{p.unit}]" for p in effect.parameters)
            said = f"{effect.name:<18} {effect.says}\n{'':<18} {values}; simulated by {', '.join(effect.simulators)}"
            said += f"; tried only with --only {effect.name}" if effect.asked_for else ""
            console.print(said, soft_wrap=True, highlight=False)


def _print_simulators(result: Simulators, console: Console) -> None:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("simulator", "version", *JOINT_MODELS, "effects"):
        table.add_column(heading, overflow="fold")
    known = dict.fromkeys(effect for engine in result.simulators for effect in engine.effects)
    for engine in result.simulators:
        motions = {c.joint_model: ", ".join(c.motions) or "-" for c in engine.supports}
        lacks = [effect for effect in known if effect not in engine.effects]
        effects = f"all but {', '.join(lacks)}" if lacks else "all"
        version = engine.version if engine.status == "installed" else engine.status
        table.add_row(engine.name, version, *(motions.get(model, "-") for model in JOINT_MODELS), effects)
    console.width = max(console.width, 130)
    console.print(table)
    for engine in result.simulators:
        if engine.fault:
            fault = f"{engine.name} is installed but cannot be imported: {engine.fault}"
            console.print(fault, soft_wrap=True, highlight=False)
    console.print(f"effects: {', '.join(known)}; see compare effects", soft_wrap=True, highlight=False)
    console.print(
        f"somebody's own model is one too: {', '.join(f'{each}:FILE' for each in SCHEMES)}",
        markup=False,
        highlight=False,
    )
    console.print(
        "install one with: pip install 'linkage-crosscheck[NAME]' (in a clone: pip install '.[NAME]')",
        markup=False,
        highlight=False,
    )
