"""The accuracy of a platform, shown: a page on which a pose is picked and drawn, a table, and curves or a map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from analytic.mechanism.one_line import count
from compare.presentation import Presentation
from compare.quantities import plain, shown
from compare.report.curves import legend
from compare.report.figure import Numbers, scaled
from compare.report.linkage import parts
from compare.report.pages import PageSection, Script, page
from compare.report.tables import html_table, print_rows, say
from compare.report.words.accuracy import FIELDS, NOTES, facts
from compare.results.platform import PlatformAccuracy, PoseError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE_DIGITS = 5  # of numbers in the page


def files(result: PlatformAccuracy) -> dict[str, str]:
    """The page, and the numbers as a table for other programs."""
    heads, rows = _table(result)
    context = {"result": result, "facts": facts(result), "notes": NOTES, "heads": heads, "rows": rows}
    sections = ["map", "largest", *["warnings"] * bool(result.warnings)]
    html = page(
        f"{result.case}: accuracy of the platform",
        PageSection("platform/header.html.j2", context),
        [PageSection(f"platform/{name}.html.j2", context) for name in sections],
        styles=("platform.css",),
        script=Script(("platform.js",), _data(result)),
    )
    return {"accuracy.html": html, "accuracy.csv": result.to_csv()}


def _data(result: PlatformAccuracy) -> dict[str, object]:
    """What the page's script draws: places, errors and poses, in a reader's units."""
    point = next(iter(result.points), None)
    grid = result.workspace
    return {
        "parts": parts(result.mechanism),
        "poses": {name: [_short(p.x), _short(p.y), _short(p.angle)] for name, p in result.poses.items()},
        "grid": None
        if grid is None
        else [len(grid.x), len(grid.y), list(map(float, grid.x)), list(map(float, grid.y))],
        "place": _places(result, point),
        "time": None if result.time is None else _short(result.time),
        "drives": {
            f"{name} ({shown(_unit(result, name))[0]})": _short(shown(_unit(result, name))[1] * values)
            for name, values in result.drive_position.items()
        },
        "maps": _maps(result),
        "farthest": None
        if point is None or not result.clearance
        else [_short(result.points[point].farthest), _short(result.points[point].farthest_direction)],
    }


def _unit(result: PlatformAccuracy, joint: str) -> str:
    return "m" if result.mechanism.joint(joint).prismatic else "rad"


def _places(result: PlatformAccuracy, point: str | None) -> list[Numbers]:
    """Where (m) the first point among the outputs is, else the first body."""
    if point is not None:
        return [_short(result.outputs[f"{point}_{axis}"].value) for axis in "xy"]
    first = next(iter(result.poses.values()))
    return [_short(first.x), _short(first.y)]


def _maps(result: PlatformAccuracy) -> list[dict[str, object]]:
    """Every quantity that may be drawn: title, unit, values at the poses, and whether over decades."""
    maps: list[dict[str, object]] = []
    for place, error in result.points.items():
        title = f"{place}: farthest by clearance, in any direction"
        if result.clearance:
            maps.append({"title": title, "unit": "mm", "values": _short(1e3 * error.farthest), "decades": False})
    for name, output in result.outputs.items():
        unit, factor = shown(output.unit)
        for field, what in FIELDS.items():
            values = factor * np.abs(getattr(output, field))
            if np.nanmax(values, initial=0.0) > 0:
                maps.append({"title": f"{name}: {what}", "unit": unit, "values": _short(values), "decades": False})
        apart = factor * np.abs(output.nominal - output.equilibrium)
        if np.nanmax(apart, initial=0.0) > 0:
            title = f"{name}: error of first order"
            maps.append({"title": title, "unit": unit, "values": _short(apart), "decades": False})
    maps += [
        {"title": f"condition number: {what}", "unit": "1", "values": _short(values), "decades": True}
        for what, values in (("dexterity", result.dexterity), ("holding", result.holding))
        if np.isfinite(values).any()
    ]
    return maps


def _short(values: np.ndarray) -> Numbers:
    return scaled(values, digits=PAGE_DIGITS)


ERRORS = ("output", "unit", "equilibrium", "worst case", "resolution", "compliance", "together", "first order off by")


def _table(result: PlatformAccuracy) -> tuple[list[str], list[list[str]]]:
    """Heads and rows of the largest sizes of each output's errors; nothing that is zero throughout."""
    rows = [(name, *_row(output, result.first_order_off.get(name))) for name, output in result.outputs.items()]
    rows = [row for row in rows if set(row[2:]) != {"-"}]
    kept = [k for k in range(len(ERRORS)) if k < 2 or any(row[k] != "-" for row in rows)]
    return [ERRORS[k] for k in kept], [[row[k] for k in kept] for row in rows]


def _row(output: PoseError, off: float | None) -> tuple[str, ...]:
    unit, factor = shown(output.unit)
    fields = (output.equilibrium, output.worst_case, output.resolution, output.compliance, output.total)
    sizes = [float(np.nanmax(np.abs(values), initial=0.0)) * factor for values in fields]
    return unit, *(plain(size) if size else "-" for size in sizes), "-" if off is None else f"{100 * off:.2g} %"


def print_table(result: PlatformAccuracy, console: Console) -> None:
    """Print the largest errors of each output over the poses, then what to beware of; ASCII."""
    print_rows(console, *_table(result), left=("output", "unit"))
    conditions = [f"{what} {value}" for what, value in facts(result).items()]
    say(console, "largest over the poses, to either side; " + "; ".join(conditions))
    for first, why in list(result.flags.items())[:1]:
        say(console, f"{count(len(result.flags), 'pose')} without an equilibrium, first number {first}: {why}")
    say(console, repr(result))


def summary_html(result: PlatformAccuracy) -> str:
    """The largest errors of each output over the poses."""
    heads, rows = _table(result)
    return html_table(rows, heads, repr(result))


def plot(result: PlatformAccuracy, figure: Figure) -> None:
    """What all errors come to together: over time, or over the workspace."""
    outputs = list(result.outputs.items())[:3]
    grid = result.workspace
    axes = figure.subplots(1 if grid else len(outputs), len(outputs) if grid else 1, squeeze=False).ravel()
    for axis, (name, output) in zip(axes, outputs, strict=True):
        unit, factor = shown(output.unit)
        if grid is not None:
            values = factor * output.total.reshape(grid.y.size, grid.x.size)
            drawn = axis.pcolormesh(1e3 * grid.x, 1e3 * grid.y, values)
            figure.colorbar(drawn, ax=axis, label=f"{name} ({unit})")
            axis.set_aspect("equal")
            axis.set_xlabel("x (mm)")
        else:
            axis.plot(result.time, factor * output.total, label="all together")
            axis.plot(result.time, factor * np.abs(output.equilibrium), label="clearance in equilibrium")
            axis.set_ylabel(f"{name} ({unit})")
    if grid is None:
        legend(axes[0])
        axes[-1].set_xlabel("time (s)")
    figure.suptitle(result.case)


PRESENTATION = Presentation(summary_html, print_table, files, plot)
