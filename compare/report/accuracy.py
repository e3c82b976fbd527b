"""How accurate a linkage can be, shown: the table for a terminal, a short one for a notebook, and the curves."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from analytic.mechanism.one_line import count
from compare.quantities import plain, shown
from compare.results.accuracy import Accuracy

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROUNDING = 1e-12  # m or rad, below which the table shows nothing


def files(result: Accuracy) -> dict[str, str]:
    """The numbers as a table for other programs."""
    return {"accuracy.csv": result.to_csv()}


def summary_html(result: Accuracy) -> str:
    """The largest displacement of each output, nominal and worst case."""
    rows = []
    for name, output in result.outputs.items():
        unit, factor = shown(output.unit)
        sizes = (factor * float(np.nanmax(np.abs(v), initial=0.0)) for v in (output.equilibrium, output.worst_case))
        cells = "".join(f"<td>{plain(size)} {unit}</td>" for size in sizes)
        rows.append(f"<tr><th>{html.escape(name)}</th>{cells}</tr>")
    head = "<tr><th>output</th><th>equilibrium</th><th>worst case</th></tr>"
    return f"<p>{html.escape(repr(result))}</p><table>{head}{''.join(rows)}</table>"


def plot(result: Accuracy, figure: Figure) -> None:
    """Equilibrium, worst case and the band of 95 % of the samples of each output over the crank angle."""
    theta = np.degrees(result.crank_angle)
    axes = figure.subplots(len(result.outputs), 1, sharex=True, squeeze=False)[:, 0]
    figure.set_figheight(2.2 * len(result.outputs) + 1)
    for axis, (name, output) in zip(axes, result.outputs.items(), strict=True):
        unit, factor = shown(output.unit)
        spread = output.monte_carlo.free
        axis.fill_between(theta, factor * spread.low, factor * spread.high, alpha=0.25, label="95 % of the samples")
        axis.plot(theta, factor * output.equilibrium, label="equilibrium")
        for sign in (-1, 1):
            label = "worst case" if sign > 0 else None
            axis.plot(theta, sign * factor * output.worst_case, "k--", linewidth=0.8, label=label)
        axis.set_ylabel(f"{name} ({unit})")
    axes[0].legend(loc="best", fontsize="small")
    axes[0].set_title(result.case)
    axes[-1].set_xlabel("crank angle (deg)")


def print_table(result: Accuracy, console: Console) -> None:
    """Print each output's largest numbers over the crank angles in millimetres and degrees, then what to beware of;
    ASCII.
    """
    theta = result.crank_angle
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for heading in (
        "output",
        "unit",
        "equilibrium",
        "at",
        "worst case",
        "at",
        "sigma",
        "compliance",
        "total",
        "sensitive to",
    ):
        table.add_column(
            heading, justify="left" if heading in ("output", "unit", "sensitive to") else "right", no_wrap=True
        )
    for name, row in result.outputs.items():
        unit, factor = shown(row.unit)

        def cell(values: np.ndarray, sign: bool = True, factor: float = factor) -> str:
            k = _largest(values)
            return "-" if k is None else plain(float(values[k]) * factor, 3, sign)

        slope, joint = max((float(values.max()), joint) for joint, values in row.sensitivity.items())
        table.add_row(
            name,
            unit,
            cell(row.equilibrium),
            _at(row.equilibrium, theta),
            cell(row.worst_case, False),
            _at(row.worst_case, theta),
            cell(row.monte_carlo.free.sigma, False),
            cell(row.compliance),
            cell(row.total),
            f"{joint} {plain(slope * factor * 1e-3)} {unit}/mm" if slope else "-",
        )
    console.print(table)
    for line in _notes(result):
        console.print(line, highlight=False, soft_wrap=True)


def _largest(values: np.ndarray) -> int | None:
    """Index of the number largest in size; None where there is none but rounding."""
    size = np.nan_to_num(np.abs(values))
    return int(size.argmax()) if size.max() > ROUNDING else None


def _at(values: np.ndarray, theta: np.ndarray) -> str:
    k = _largest(values)
    return "-" if k is None else f"{math.degrees(theta[k]):.4g} deg"


def _notes(result: Accuracy) -> list[str]:
    sizes = ", ".join(f"{joint} {1e3 * c:.4g} mm" for joint, c in result.clearance.items()) or "none"
    closed = "each closed again" if result.nonlinear else "to first order"
    notes = [
        "x and y in the ground frame; largest over the crank angles; worst case to either side;"
        " sigma with contacts anywhere on the rim",
        (
            f"{result.case}: {result.motion}, clearance {sizes}; {count(result.samples, 'sample')} {closed},"
            f" seed {result.seed}"
        ),
    ]
    for what, found in (("flags", result.flags), ("cautions", result.cautions)):
        for first, why in list(found.items())[:1]:
            notes.append(
                f"{count(len(found), 'crank angle')} with {what}, first"
                f" {math.degrees(result.crank_angle[int(first)]):.4g} deg: {why}"
            )
    for change in result.side_changes:
        name = max(change.jump, key=lambda n: (result.outputs[n].unit == "m", abs(change.jump[n])))
        unit, factor = shown(result.outputs[name].unit)
        what = "changes side" if abs(change.turned) > math.pi / 2 else "is hardly loaded"
        where = f"{math.degrees(change.crank_angle):.4g} deg"
        notes.append(
            f"the contact in {change.joint} {what} at {where}: {name} jumps by"
            f" {plain(change.jump[name] * factor)} {unit}"
        )
    return notes
