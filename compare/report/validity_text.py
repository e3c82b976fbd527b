"""A validity map in words and tables: for a terminal, and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from compare.quantities import plain, quantities
from compare.results.validity import Cell, Costing, Failed, Validity, Worst

if TYPE_CHECKING:
    from rich.console import Console

Cells = Mapping[tuple[float, float], Cell | Failed]
TESTED: tuple[Costing, ...] = ("first-order", "quasi-static", "rigid")


def rpm(speed: float) -> str:
    """A speed (rad/s) in rpm."""
    return f"{speed * 30 / math.pi:.5g}"


def millimetres(clearance: float) -> str:
    """A clearance (m) in mm."""
    return f"{clearance * 1e3:.4g}"


def percent(value: float) -> str:
    """A share, never rounded to none or all: 0.4 % of a cycle without contact is not 0 %."""
    near = min(max(100 * value, 0.1 if value > 0 else 0.0), 99.9 if value < 1 else 100.0)
    return f"{near:.1f}" if 0 < near < 1 or 99 < near < 100 else f"{near:.0f}"


def failing(cell: Cell | Failed) -> tuple[str, ...]:
    """The assumptions that fail, by name."""
    return () if isinstance(cell, Failed) else cell.fails


def brief(cell: Cell | Failed) -> str:
    """A cell in a table: ``agrees``, or the share of the cycle at which it does, and which assumptions fail."""
    if isinstance(cell, Failed):
        return "failed"
    found = "agrees" if cell.agrees else f"{percent(cell.agreeing_share)} %"
    return ", ".join([found, *failing(cell)])


def sentence(cell: Cell | Failed, mechanism: Mechanism) -> str:
    """A cell in words."""
    if isinstance(cell, Failed):
        return f"failed: {cell.failure}"
    over = [f"{name} {plain(cell.cost[name], 2)} x" for name in TESTED if cell.cost[name] > 1]
    costs = f"costs over tolerance: {', '.join(over)}" if over else "every other assumption within tolerance"
    if cell.agrees:
        return f"agrees; {costs.replace('other ', '')}"
    lost = [
        f"{joint} is without contact for {percent(share)} % of the cycle"
        for joint, share in cell.free_share.items()
        if share > 0
    ]
    swing = ["the pin stays in contact and swings along the rim"] if cell.swings else []
    silent = sum(cell.flagged_share.values())
    flags = [f"no answer from the model at {percent(silent)} %"] if silent else []
    worst = [f"worst {_worst(cell.worst, mechanism)}"] if cell.worst else []
    return "; ".join(
        [f"agrees at {percent(cell.agreeing_share)} % of the angles", *lost, *swing, *flags, *worst, costs]
    )


def _worst(worst: Worst, mechanism: Mechanism) -> str:
    quantity = quantities(mechanism)[worst.signal]
    at = f"at {math.degrees(worst.at_crank_angle):.4g} deg"
    if worst.max is None or worst.over_tolerance is None:
        return f"{quantity.label} {at}"
    return (
        f"{quantity.label} {plain(worst.max * quantity.factor, 3, True)} {quantity.unit}"
        f" ({plain(worst.over_tolerance, 2)} x) {at}"
    )


def legend(result: Validity) -> list[str]:
    """What the assumptions say."""
    found = result.assumptions
    return [f"{name}: {about.means}" for name, about in found.items()]


def about(result: Validity) -> str:
    """What the map is of, in one line."""
    laws = {f"{law.stiffness:.3g} N/m and {law.damping:.3g} N.s/m" for law in result.contact.values()}
    contact = f", contact {' or '.join(sorted(laws))}" if laws else ""
    where = f"clearance in {', '.join(result.joints)} ({result.joints_are})"
    return (
        f"{result.case}: {where}, {result.joint_model} joints{contact}, {count(len(result.crank_angle), 'crank angle')}"
    )


def print_table(result: Validity, console: Console) -> None:
    """Print each engine's map as a small table, then what it comes to; ASCII but for names."""
    from rich.markup import escape
    from rich.table import Table

    def show(simulator: str, heading: str, text: Callable[[Cell | Failed], str]) -> None:
        found = result.of(simulator)
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
        table.add_column(f"{heading}: mm \\ rpm", no_wrap=True)
        for speed in result.speeds:
            table.add_column(rpm(speed), no_wrap=True)
        for clearance in result.clearances:
            table.add_row(millimetres(clearance), *(text(found[speed, clearance]) for speed in result.speeds))
        console.print(table)

    for simulator in result.simulators:
        show(simulator, simulator, brief)
    console.print(
        "share of the crank angles at which model and simulation agree, and what fails of the paper's assumptions",
        soft_wrap=True,
    )
    if any(lost(cell) for cell in result.cells):
        for simulator in result.simulators:
            show(simulator, f"{simulator}, no contact", lambda cell: f"{percent(lost(cell))} %" if lost(cell) else "-")
    for line in [*legend(result), about(result), *result.words]:
        console.print(escape(line), highlight=False, soft_wrap=True)


def lost(cell: Cell | Failed) -> float:
    """The largest share of the cycle that one of the cell's pins was without contact; 0 for a cell that failed."""
    return 0.0 if isinstance(cell, Failed) else cell.free


def markdown(result: Validity) -> str:
    """The text of validity.md."""
    out = [f"# Where the analytic model holds: {_md(result.case)}", "", f"{_md(about(result))}.", ""]
    out += [f"- {_md(line)}" for line in result.words]
    out += ["", "![map of speed and clearance](validity.svg)", ""]
    out += [
        "A cell says at which share of the crank angles the equilibrium and the simulation agree within tolerance, and",
        "which of the paper's assumptions fail, each tested by itself. The equilibrium does not need first-order and",
        "corrects quasi-static once, so it may agree all the same.",
        "",
        *(f"- {_md(line)}" for line in legend(result)),
    ]
    for simulator in result.simulators:
        found = result.of(simulator)
        out += ["", f"## {_md(simulator)} {_md(result.versions.get(simulator, ''))}".rstrip(), ""]
        rows = [[millimetres(c), *(brief(found[w, c]) for w in result.speeds)] for c in result.clearances]
        out += _rows(["mm \\ rpm", *(rpm(w) for w in result.speeds)], rows)
        if any(map(lost, found.values())):
            rows = [
                [millimetres(c), *(f"{percent(lost(found[w, c]))} %" for w in result.speeds)] for c in result.clearances
            ]
            out += [
                "",
                "Share of the cycle without contact:",
                "",
                *_rows(["mm \\ rpm", *(rpm(w) for w in result.speeds)], rows),
            ]
        out += ["", "| rpm | mm | what was found |", "|---:|---:|---|"]
        out += [
            f"| {rpm(w)} | {millimetres(c)} | {_md(sentence(found[w, c], result.mechanism))} |"
            for w in result.speeds
            for c in result.clearances
        ]
    out += [
        "",
        (
            f"Made by `{result.command}` with"
            f" {', '.join(f'{name} {version}' for name, version in result.versions.items())}."
        ),
        "",
    ]
    return "\n".join(out)


def _rows(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return ["| " + " | ".join(cells) + " |" for cells in (head, ["---:", *["---"] * (len(head) - 1)], *rows)]


def _md(text: str) -> str:
    return text.replace("\\", "\\\\").replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*").replace("\n", " ")


__all__ = [
    "about",
    "brief",
    "failing",
    "legend",
    "lost",
    "markdown",
    "millimetres",
    "percent",
    "print_table",
    "rpm",
    "sentence",
]
