"""A plan shown: a page with the runs to make and what they would tell, a table, and the measured.toml that waits for
the data.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from analytic.mechanism.file import dumps
from compare.presentation import Presentation
from compare.quantities import plainly
from compare.report.curves import legend
from compare.report.figure import Axis, Figure, Series
from compare.report.pages import PageSection, charts, figures_context, page
from compare.report.svg import draw
from compare.report.tables import html_table, print_rows, say
from compare.report.words import plan as words
from compare.results.plan import Plan

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

RUN_HEADS = ("run", "speed", "loads", "sampling", "price")
SENSOR_HEADS = ("sensor", "noise (1 sigma)", "price", "use it")
STEP_HEADS = ("with this too", "price", "bits", "named")
EFFECT_HEADS = ("if this is missing", "it is named", "or taken for", "and known as")


def files(result: Plan) -> dict[str, str]:
    """The page, and what waits for the data."""
    drawn = growth(result)
    context = figures_context([drawn], {drawn.name: draw(drawn)}) | {
        "result": result,
        "words": words,
        "run_heads": RUN_HEADS,
        "runs": _runs(result),
        "sensor_heads": SENSOR_HEADS,
        "sensors": [words.sensor_row(result, sensor) for sensor in result.sensors],
        "step_heads": STEP_HEADS,
        "steps": [words.step_row(result, step) for step in result.steps],
        "effect_heads": EFFECT_HEADS,
        "effects": [
            words.effect_row(result, effect) for effect in sorted(result.effects, key=lambda e: e.told_if_usual)
        ],
        "groups": [words.group(result, group) for group in result.groups],
        "combinations": [words.combination(result, one) for one in result.combinations],
        "hidden": ", ".join(words.phrase(result, place) for place in result.hidden),
        "notes": words.notes(result),
    }
    sections = ("runs", "growth", "effects", "open", "template")
    html = page(
        f"A plan for {result.case}",
        PageSection("plan/header.html.j2", context),
        [PageSection(f"plan/{name}.html.j2", context) for name in sections],
        script=charts([drawn]),
    )
    return {"plan.html": html, "measured.toml": result.template, "nominal.toml": dumps(result.mechanism)}


def growth(result: Plan) -> Figure:
    """Information over what is spent."""
    spent, bits = [0.0], [0.0]
    for step in result.steps:
        spent.append(spent[-1] + step.price)
        bits.append(step.bits)
    told = Series("with these runs and sensors", tuple(spent), tuple(bits), "massless-link")
    marks = Series("", tuple(spent), tuple(bits), "massless-link", "marker")
    ends = (0.0, spent[-1])
    most = Series("if every effect were told for sure", ends, (result.possible_bits,) * 2, "analytic", "dashed")
    text = "; ".join(f"{step.name} {step.bits:.2f} bits" for step in result.steps)
    axes = Axis("price of what is made and bought", ""), Axis("what the data tell", "bits")
    return Figure("growth", "What each run and sensor adds", f"{text}.", *axes, (told, marks, most))


def _runs(result: Plan) -> list[tuple[str, ...]]:
    return [
        (run.name, words.speed(run), words.loads(run), words.sampling(run), plainly(run.price)) for run in result.runs
    ]


def print_table(result: Plan, console: Console) -> None:
    """Print the runs, the sensors, what each adds, and what stays open."""
    print_rows(console, RUN_HEADS, _runs(result), folded=RUN_HEADS)
    rows = [words.sensor_row(result, sensor) for sensor in result.sensors]
    print_rows(console, SENSOR_HEADS, rows, folded=SENSOR_HEADS)
    print_rows(console, STEP_HEADS, [words.step_row(result, step) for step in result.steps])
    say(
        console,
        words.headline(result),
        *(f"hardly told apart: {words.group(result, one, words.LISTED)}" for one in result.groups),
    )
    say(console, *words.notes(result))


def summary_html(result: Plan) -> str:
    """The runs."""
    return html_table(_runs(result), RUN_HEADS, words.headline(result), named=True)


def plot(result: Plan, figure: Picture) -> None:
    """Information over what is spent."""
    shown = growth(result)
    axis = figure.subplots()
    for series, style in zip(shown.series, ("-", "o", "k--"), strict=True):
        axis.plot(np.array(series.x, float), np.array(series.y, float), style, label=series.name or None)
    axis.set_xlabel(shown.x.title)
    axis.set_ylabel(shown.y.title)
    axis.set_title(result.case)
    legend(axis)


PRESENTATION = Presentation(summary_html, print_table, files, plot)
