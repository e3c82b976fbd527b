"""Measured data before a diagnosis, shown: a page of every sensor over time and over the crank angle (of a slide, its
travel), and a table.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from markupsafe import escape
from rich.console import Console

from compare.presentation import Presentation
from compare.quantities import amount, number, quantities, shown
from compare.report.curves import MOST_CURVES, legend, partly
from compare.report.figure import Axis, Figure, Series, scaled
from compare.report.pages import PageSection, charts, figures_context, glimpse, page
from compare.report.svg import draw
from compare.report.tables import print_rows, say
from compare.report.words.preview import DRIVES, called, encoders, facts, reach, spoken, tally, visible
from compare.results.preview import Preview, RunPreview, SensorPreview

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

DRAWN_SAMPLES = 400  # samples of a drawing
SENSOR_HEADS = ("run", "signal", "samples", "noise (1 sigma)", "from nominal")


def files(result: Preview) -> dict[str, str]:
    """The page."""
    drawn_of = {
        run.name: [one for name, sensor in run.signals.items() for one in _figures(result, run, name, sensor)]
        for run in result.runs
    }
    runs = [
        {"title": f"Run {run.name}: {DRIVES[run.drive]}", "facts": facts(result, run), "figures": drawn_of[run.name]}
        for run in result.runs
    ]
    drawn = [figure for figures in drawn_of.values() for figure in figures]
    context = figures_context(drawn, {figure.name: draw(figure) for figure in drawn}) | {
        "result": result,
        "runs": runs,
        "visible": [visible(result, one) for one in result.visible],
        "hidden": ", ".join(called(result, one.name, one.where) for one in result.invisible),
    }
    html = page(
        f"{result.case}: the data",
        PageSection("preview/header.html.j2", context),
        [*_of_sensors(result), *(PageSection(f"preview/{name}.html.j2", context) for name in ("runs", "visible"))],
        script=charts(drawn),
    )
    return {"data.html": html}


def _of_sensors(result: Preview) -> list[PageSection]:
    """The sections on the sensors, and on what was wrong with their data."""
    context: dict[str, object] = {"result": result, "heads": SENSOR_HEADS, "sensors": _sensors(result)}
    return [PageSection(f"preview/{name}.html.j2", context) for name in ("sensors", *["faults"] * bool(result.faults))]


def print_table(result: Preview, console: Console) -> None:
    """Print each sensor with its noise and how far it is from the nominal model, the faults, and what would show."""
    print_rows(console, SENSOR_HEADS, _sensors(result), folded=SENSOR_HEADS)
    faults = [f"data: run {f.run}, {spoken(result, f.signal)}: {f.text}" for f in result.faults]
    say(console, *faults, *(facts(result, run) for run in result.runs), tally(result))


def summary_html(result: Preview) -> str:
    """Each sensor with its noise and how far it is from the nominal model, the faults, and how much would show."""
    return f"<p>{escape(repr(result))}</p>{glimpse(*_of_sensors(result))}<p>{escape(tally(result))}</p>"


def _sensors(result: Preview) -> list[tuple[str, ...]]:
    """A row for each sensor of each run."""
    rows: list[tuple[str, ...]] = []
    for run in result.runs:
        for name, sensor in run.signals.items():
            noise = amount(sensor.noise, sensor.unit) + ("" if sensor.noise_given else ", estimated")
            gap = "followed" if sensor.gap is None else f"{number(sensor.gap, 3)} times the noise"
            rows.append((run.name, spoken(result, name), str(sensor.samples), noise, gap))
    return rows


def _figures(result: Preview, run: RunPreview, name: str, sensor: SensorPreview) -> list[Figure]:
    """A sensor over time, and over the crank angle within a turn (of a slide, its travel), with the nominal model
    behind it; of the crank how far it is off, over the latter.
    """
    what = quantities(result.mechanism)[name]
    unit, factor = shown(sensor.unit)
    every = max(1, -(-run.time.size // DRAWN_SAMPLES))
    title = f"{what.label}, run {run.name}"
    drawn = []
    for axis, values in ((Axis("time", "s"), run.time), *_posture(result, run)):
        order = np.argsort(values, kind="stable")
        x = scaled(values[order])
        both = (
            Series("nominal model", x, scaled(sensor.nominal[order], factor), "analytic", "dashed"),
            Series("measured", x[::every], scaled(sensor.measured[order][::every], factor), "massless-link", "marker"),
        )
        if axis.unit != "s" and np.any(np.diff(run.crank_angle) * np.sign(np.ptp(run.crank_angle)) < 0):
            both = (Series("nominal model", x[::every], both[0].y[::every], "analytic", "marker"), both[1])
        if axis.unit != "s" and name in encoders(result):
            apart = scaled((sensor.measured - sensor.nominal)[order][::every], factor)
            off = (Series("measured minus nominal", x[::every], apart, "massless-link", "marker"),)
            text = f"{title}, measured minus nominal over {axis.label}."
            drawn.append(Figure(f"{run.name}-{name}-off", f"{title}, off", text, axis, Axis(what.name, unit), off))
            continue
        text = f"{title} over {axis.label}: measured {reach(sensor.measured, factor)} {unit}"
        text += f", nominal {reach(sensor.nominal, factor)} {unit}."
        stem = f"{run.name}-{name}-{axis.label.split()[0]}"
        drawn.append(Figure(stem, f"{title}, over {axis.label}", text, axis, Axis(what.name, unit), both))
    return drawn


def _posture(result: Preview, run: RunPreview) -> list[tuple[Axis, np.ndarray]]:
    """Where the linkage is at each sample (N,): the crank angle within a turn, or the travel of a slide; nothing of
    several drives, which no one number tells.
    """
    if result.mechanism.sliding:
        unit, factor = shown("m")
        return [(Axis("travel", unit), run.crank_angle * factor)]
    return [(Axis("crank angle", "deg"), np.degrees(run.crank_angle) % 360.0)] if result.mechanism.cranked else []


def plot(result: Preview, figure: Picture) -> None:
    """The first six sensors of the first run over time, with the nominal model behind them."""
    run = result.runs[0]
    sensors = list(run.signals.items())[:MOST_CURVES]
    figure.set_figheight(1.6 * len(sensors) + 1)
    axes = figure.subplots(len(sensors), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (name, sensor) in zip(axes, sensors, strict=True):
        unit, factor = shown(sensor.unit)
        axis.plot(run.time, factor * sensor.nominal, "--", color="0.6", label="nominal")
        axis.plot(run.time, factor * sensor.measured, ".", markersize=3, label="measured")
        axis.set_title(f"{spoken(result, name)} ({unit})", fontsize="medium", loc="left")
    legend(axes[0])
    axes[-1].set_xlabel("time (s)")
    partly(figure, MOST_CURVES, len(run.signals), "sensors")
    figure.suptitle(f"{result.case}, run {run.name}")


PRESENTATION = Presentation(summary_html, print_table, files, plot)
