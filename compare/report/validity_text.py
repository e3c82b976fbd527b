"""A validity map in words and tables: for a terminal, and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from compare.quantities import assumptions, plain, quantities
from compare.results.validity import Boundary, Cell, Costing, Failed, Validity, Worst

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
        f"{joint} is without contact for {percent(share)} % of the turn that is compared"
        for joint, share in cell.free_share.items()
        if share > 0
    ]
    struck = [_struck(cell)] if cell.watched is not None and cell.watched.impacts else []
    block = any(mechanism.joint(name).prismatic for name in cell.free_share)
    moves = "the block stays in contact and rocks" if block else "the pin stays in contact and swings along the rim"
    another = cell.watched is not None and cell.watched.free > 0
    swing = [f"{'in the turn that is compared ' * another}{moves}"] if cell.swings else []
    silent = sum(cell.flagged_share.values())
    flags = [f"no answer from the model at {percent(silent)} %"] if silent else []
    worst = [f"worst {_worst(cell.worst, mechanism)}"] if cell.worst else []
    return "; ".join(
        [f"agrees at {percent(cell.agreeing_share)} % of the angles", *lost, *struck, *swing, *flags, *worst, costs]
    )


def _struck(cell: Cell) -> str:
    """Impacts, peak and loss of a cell whose pins or corners strike."""
    assert cell.watched is not None
    struck = f"{count(round(cell.watched.impacts), 'impact')} a turn"
    return f"{struck}, peak force {_figure(cell.watched.peak_ratio)} x the ideal one, {cell.watched.lost:.2g} J lost"


def _worst(worst: Worst, mechanism: Mechanism) -> str:
    quantity = quantities(mechanism)[worst.signal]
    at = f"at {math.degrees(worst.at_crank_angle):.4g} deg"
    if worst.max is None or worst.over_tolerance is None:
        return f"{quantity.label} {at}"
    return (
        f"{quantity.label} {plain(worst.max * quantity.factor, 3, True)} {quantity.unit}"
        f" ({plain(worst.over_tolerance, 2)} x) {at}"
    )


# ---------------------------------------------------------------- what contact does


@dataclass(frozen=True)
class Measure:
    """One figure of a cell's contact: what it is, how it is told, and the values from which each shade is darker."""

    name: str
    title: str
    value: Callable[[Cell], float | None]
    text: Callable[[float], str]
    shades: tuple[float, float, float, float]

    def of(self, cell: Cell | Failed) -> float | None:
        """The figure of a cell; None where there is none."""
        return None if isinstance(cell, Failed) else self.value(cell)

    def told(self, cell: Cell | Failed) -> str:
        """The same in words."""
        value = self.of(cell)
        return "-" if value is None else self.text(value)


JOULES = ((1.0, "J"), (1e-3, "mJ"), (1e-6, "uJ"), (1e-9, "nJ"))


def measures(result: Validity) -> tuple[Measure, ...]:
    """The figures of contact that a map has; none where it was not watched."""
    watched = [cell.watched for cell in result.cells if isinstance(cell, Cell) and cell.watched is not None]
    if not watched:
        return ()
    most = max(abs(one.lost) for one in watched)
    factor, unit = next((pair for pair in JOULES if most >= pair[0]), JOULES[-1])
    return (
        Measure(
            "peak",
            "peak force over the ideal peak",
            lambda cell: cell.watched.peak_ratio if cell.watched else None,
            _figure,
            (1.1, 1.5, 3.0, 10.0),
        ),
        Measure(
            "free",
            "share of the time without contact (%)",
            lambda cell: cell.watched.free if cell.watched else None,
            lambda value: percent(value) if value else "-",
            (1e-9, 0.02, 0.1, 0.3),
        ),
        Measure(
            "lost",
            f"energy lost in contact in a turn ({unit})",
            lambda cell: cell.watched.lost if cell.watched else None,
            lambda value: _figure(value / factor) if abs(value) > 1e-4 * most else "-",
            (1e-4 * most, 0.01 * most, 0.1 * most, 0.5 * most),
        ),
    )


def _figure(value: float) -> str:
    """Two figures, and no exponent."""
    return f"{value:.0f}" if abs(value) >= 10 else f"{value:.2g}" if abs(value) >= 1e-3 else f"{value:.1g}"


def panel_title(result: Validity, simulator: str, restitution: float | None) -> str:
    """Engine, its version and the restitution."""
    found = f"{simulator} {result.versions.get(simulator, '')}".strip()
    return found if restitution is None else f"{found}, restitution {restitution:g}"


def edges(result: Validity, restitution: float | None) -> tuple[Boundary, ...]:
    """The predicted boundary of a layer, by speed."""
    return tuple(one for one in result.boundary or () if one.restitution == restitution)


def measured_edge(cells: Cells, speed: float, clearances: Sequence[float]) -> str:
    """Between which clearances (mm) contact is first lost in the simulations at a speed (rad/s)."""
    kept: float | None = None
    for gap in clearances:
        cell = cells[speed, gap]
        if isinstance(cell, Cell) and cell.left:
            return f"below {millimetres(gap)}" if kept is None else f"{millimetres(kept)} to {millimetres(gap)}"
        kept = gap if isinstance(cell, Cell) else kept
    return "kept"


def predicted_edge(edge: float | None, clearances: Sequence[float]) -> str:
    """The clearance (mm) at which contact is first lost by the analytic model."""
    if edge is None:
        return "kept"
    return f"below {millimetres(edge)}" if edge <= clearances[0] else millimetres(float(f"{edge:.3g}"))


def edge_rows(result: Validity) -> list[list[str]]:
    """At which clearance (mm) contact is first lost, by restitution and speed: head, then a row each; none where
    nothing is known of it, and without prediction where there is none, as of a block.
    """
    layer = ["restitution"] * bool(result.restitutions)
    if result.boundary is None and result.of_blocks and measures(result):
        return [[*layer, "rpm", *result.simulators], *_measured_rows(result)]
    out = [[*layer, "rpm", *result.simulators, "predicted", "predicted, rigid walls"]]
    for edge in result.boundary or ():
        found = [
            measured_edge(result.of(name, edge.restitution), edge.speed, result.clearances)
            for name in result.simulators
        ]
        predicted = [predicted_edge(one, result.clearances) for one in (edge.yielding, edge.rigid)]
        layer = [] if edge.restitution is None else [f"{edge.restitution:g}"]
        out.append([*layer, rpm(edge.speed), *found, *predicted])
    return out


def _measured_rows(result: Validity) -> list[list[str]]:
    """At which clearance (mm) contact is first lost in the simulations, by restitution and speed."""
    return [
        [
            *([] if restitution is None else [f"{restitution:g}"]),
            rpm(speed),
            *(measured_edge(result.of(name, restitution), speed, result.clearances) for name in result.simulators),
        ]
        for restitution, speed in product(result.layers, result.speeds)
    ]


def legend(result: Validity) -> list[str]:
    """What the assumptions say."""
    found = result.assumptions
    return [f"{name}: {about.means}" for name, about in found.items()]


def about(result: Validity) -> str:
    """What the map is of, in one line."""
    laws = {
        f"{f'{law.law} of ' * bool(law.law)}{law.stiffness:.3g} N/m"
        + (f" and {law.damping:.3g} N.s/m" if law.damping is not None else "")
        for law in result.contact.values()
    }
    contact = f", contact {' or '.join(sorted(laws))}{_harder(result)}" if laws else ""
    where = f"clearance in {', '.join(result.joints)} ({result.joints_are})"
    return (
        f"{result.case}: {where}, {result.joint_model} joints{contact}, {count(len(result.crank_angle), 'crank angle')}"
    )


def _harder(result: Validity) -> str:
    """How stiff walls are at the speeds at which they are stiffer than at the slowest."""
    cells = [cell for cell in result.cells if isinstance(cell, Cell)]
    given = [value for cell in cells if isinstance(value := cell.settings.get("contact_stiffness"), float)]
    stiffest, slowest = max(given, default=0.0), max(law.stiffness for law in result.contact.values())
    if stiffest <= slowest:
        return ""
    return f" at {rpm(min(result.speeds))} rpm, up to {stiffest:.3g} N/m at higher speeds"


def print_table(result: Validity, console: Console) -> None:
    """Print each engine's map as a small table, then what it comes to; ASCII but for names."""
    from rich.table import Table

    def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        shown = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
        for column in head:
            shown.add_column(column, no_wrap=True)
        for row in rows:
            shown.add_row(*row)
        console.print(shown)

    def show(panel: tuple[str, float | None], what: str, text: Callable[[Cell | Failed], str]) -> None:
        (simulator, restitution), found = panel, result.of(*panel)
        layer = "" if restitution is None else f", restitution {restitution:g}"
        if layer or what:  # too long for a column
            console.print(f"{simulator}{layer}{what}", highlight=False, soft_wrap=True)
        head = "mm \\ rpm" if layer or what else f"{simulator}: mm \\ rpm"
        table(
            [head, *map(rpm, result.speeds)],
            [[millimetres(c), *(text(found[w, c]) for w in result.speeds)] for c in result.clearances],
        )

    for panel in result.panels():
        show(panel, "", brief)
    console.print(
        "share of the crank angles at which model and simulation agree, and what fails of the paper's assumptions",
        soft_wrap=True,
    )
    for panel, (title, text) in product(result.panels(), _contact_tables(result)):
        show(panel, f", {title}", text)
    head, *rows = edge_rows(result)
    if rows:
        console.print("clearance (mm) at which contact is first lost")
        table(head, rows)
    for line in [*legend(result), about(result), *result.words]:
        console.print(line, highlight=False, soft_wrap=True)


def _contact_tables(result: Validity) -> list[tuple[str, Callable[[Cell | Failed], str]]]:
    """What tables say of contact; where it was not watched, only the time without it."""
    shown = measures(result)
    if shown:
        return [(measure.title, measure.told) for measure in shown]
    if any(lost(cell) for cell in result.cells):
        return [("no contact", lambda cell: f"{percent(lost(cell))} %" if lost(cell) else "-")]
    return []


def lost(cell: Cell | Failed) -> float:
    """The largest share of the cycle that a cell's pin or block was without contact; 0 for a cell that failed."""
    return 0.0 if isinstance(cell, Failed) else cell.free


def markdown(result: Validity) -> str:
    """The text of validity.md."""
    out = [f"# Where the analytic model holds: {_md(result.case)}", "", f"{_md(about(result))}.", ""]
    out += [f"- {_md(line)}" for line in result.words]
    out += [f"- **Warning:** {_md(line)}" for line in result.warnings]
    out += ["", "![map of speed and clearance](validity.svg)", ""]
    out += [
        "A cell says at which share of the crank angles the equilibrium and the simulation agree within tolerance, and",
        "which of the paper's assumptions fail, each tested by itself. The equilibrium does not need first-order and",
        "corrects quasi-static once, so it may agree all the same.",
        "",
        *(f"- {_md(line)}" for line in legend(result)),
    ]
    head, *rows = edge_rows(result)
    if rows:
        out += ["", "Clearance (mm) at which contact is first lost, between two of the map in the simulations:", ""]
        out += _rows(head, rows)
    shown = measures(result)
    speeds = ["mm \\ rpm", *(rpm(w) for w in result.speeds)]
    for simulator, restitution in result.panels():
        found = result.of(simulator, restitution)

        def table(text: Callable[[Cell | Failed], str], cells: Cells = found) -> list[str]:
            return _rows(
                speeds, [[millimetres(c), *(text(cells[w, c]) for w in result.speeds)] for c in result.clearances]
            )

        out += ["", f"## {_md(panel_title(result, simulator, restitution))}", "", *table(brief)]
        for measure in shown:
            out += ["", f"{measure.title[0].upper()}{measure.title[1:]}:", "", *table(measure.told)]
        if not shown and any(map(lost, found.values())):
            out += ["", "Share of the cycle without contact:", "", *table(lambda cell: f"{percent(lost(cell))} %")]
        out += ["", "| rpm | mm | what was found |", "|---:|---:|---|"]
        out += [
            f"| {rpm(w)} | {millimetres(c)} | {_md(sentence(found[w, c], result.mechanism))} |"
            for w in result.speeds
            for c in result.clearances
        ]
    if result.assumed:
        out += ["", "The mechanism gives no number for these:", ""]
        out += [f"- {_md(line)}" for line in assumptions(result.assumed)]
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
    "Measure",
    "about",
    "brief",
    "edge_rows",
    "edges",
    "failing",
    "legend",
    "lost",
    "markdown",
    "measures",
    "millimetres",
    "panel_title",
    "percent",
    "print_table",
    "rpm",
    "sentence",
]
