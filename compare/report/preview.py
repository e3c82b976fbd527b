"""Measured data before a diagnosis, shown: a page of every sensor over time and over the crank angle (of a slide, its
travel), and a table.
"""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from rich.console import Console
from rich.table import Table

from analytic.mechanism.one_line import count
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.quantities import Quantity, amount, number, quantities, shown
from compare.report.figures import Axis, Figure, Series, scaled
from compare.report.svg import draw
from compare.results.preview import Preview, Seen, SeenRun, Visible

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Picture

DRAWN = 400  # samples of a drawing
LISTED = 4  # effects that look alike, by name; the others are counted
HEADS = ("run", "signal", "samples", "noise (1 sigma)", "from nominal")
DRIVES = {"speed": "at a commanded speed", "measured": "follows its encoder", "free": "let go"}


def files(result: Preview) -> dict[str, str]:
    """The page."""
    return {"data.html": _page(result)}


def _page(result: Preview) -> str:
    environment = Environment(
        loader=PackageLoader("compare.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    return environment.get_template("data.html.j2").render(
        result=result,
        css=Markup(_style()),
        runs=[
            {
                "run": run,
                "title": f"Run {run.name}: {DRIVES[run.drive]}",
                "facts": _facts(result, run),
                "figures": [
                    Markup(draw(figure))
                    for name, seen in run.signals.items()
                    for figure in _figures(result, run, name, seen)
                ],
            }
            for run in result.runs
        ],
        heads=HEADS,
        sensors=_sensors(result),
        visible=[_words(result, one) for one in result.visible],
        hidden=", ".join(_called(result, one.name, one.where) for one in result.invisible),
    )


def _style() -> str:
    from importlib import resources

    return resources.files("compare.report").joinpath("static", "report.css").read_text(encoding="utf-8")


def _quantity(result: Preview, signal: str) -> Quantity:
    return quantities(result.mechanism)[signal]


def _spoken(result: Preview, signal: str) -> str:
    found = quantities(result.mechanism).get(signal)
    return signal if found is None else found.label


def _called(result: Preview, name: str, where: str) -> str:
    effect = VOCABULARY[name]
    return effect.called(_spoken(result, where) if effect.place == "signal" else where)


def _facts(result: Preview, run: SeenRun) -> str:
    """A run in a sentence: samples, rate, span, gaps."""
    if result.mechanism.sliding:
        unit, factor = shown("m")
        span = f"the slide goes from {number(factor * run.crank_from, 4)} to {number(factor * run.crank_to, 4)} {unit}"
    elif not result.mechanism.cranked:
        span = ", ".join(
            f"{_spoken(result, e)} {_span(run.signals[e].measured, shown(run.signals[e].unit)[1])}"
            f" {shown(run.signals[e].unit)[0]}"
            for e in _encoders(result)
            if e in run.signals
        )
    else:
        turned = math.degrees(run.crank_to - run.crank_from)
        span = (
            f"the crank goes from {number(math.degrees(run.crank_from), 4)} to {number(math.degrees(run.crank_to), 4)}°"
            f" ({count(number(turned / 360, 3), 'turn')})"
        )
    longest = f", the longest gap {amount(run.longest_gap, 's')}" if run.longest_gap else ", no gaps"
    role = ", kept back for validation" if run.role == "validation" else ""
    return f"{run.file}: {count(run.samples, 'sample')}, one every {amount(run.step, 's')}{longest}; {span}{role}."


def _sensors(result: Preview) -> list[tuple[str, ...]]:
    """A row for each sensor of each run."""
    rows: list[tuple[str, ...]] = []
    for run in result.runs:
        for name, seen in run.signals.items():
            noise = amount(seen.noise, seen.unit) + ("" if seen.noise_given else ", estimated")
            gap = "followed" if seen.gap is None else f"{number(seen.gap, 3)} times the noise"
            rows.append((run.name, _spoken(result, name), str(seen.samples), noise, gap))
    return rows


def _words(result: Preview, one: Visible) -> tuple[str, str, str]:
    """An effect, the size from which it shows, and what looks like it."""
    if one.size is None:
        size = "a size that the model does not tell"
    else:
        size = f"{one.parameter.replace('_', ' ')} {'up to' if one.at_most else 'from'} {amount(one.size, one.unit)}"
        size += "" if one.at_most else " on"
    names = [_called(result, each.name, each.where) for each in one.like[:LISTED]]
    more = len(one.like) - LISTED
    like = ", ".join(names) + (f" and {more} more" if more > 0 else "")
    return _called(result, one.name, one.where), size, like or "nothing else"


def _figures(result: Preview, run: SeenRun, name: str, seen: Seen) -> list[Figure]:
    """A sensor over time, and over the crank angle within a turn (of a slide, its travel), with the nominal model
    behind it; of the crank how far it is off, over the latter.
    """
    what = _quantity(result, name)
    unit, factor = shown(seen.unit)
    every = max(1, -(-run.time.size // DRAWN))
    title = f"{what.label}, run {run.name}"
    found = []
    for axis, values in ((Axis("time", "s"), run.time), *_posture(result, run)):
        order = np.argsort(values, kind="stable")
        x = scaled(values[order])
        both = (
            Series("nominal model", x, scaled(seen.nominal[order], factor), "analytic", "dashed"),
            Series("measured", x[::every], scaled(seen.measured[order][::every], factor), "massless-link", "marker"),
        )
        if axis.unit != "s" and np.any(np.diff(run.crank_angle) * np.sign(np.ptp(run.crank_angle)) < 0):
            both = (Series("nominal model", x[::every], both[0].y[::every], "analytic", "marker"), both[1])
        if axis.unit != "s" and name in _encoders(result):
            apart = scaled((seen.measured - seen.nominal)[order][::every], factor)
            off = (Series("measured minus nominal", x[::every], apart, "massless-link", "marker"),)
            text = f"{title}, measured minus nominal over {axis.label}."
            found.append(Figure(f"{run.name}-{name}-off", f"{title}, off", text, axis, Axis(what.name, unit), off))
            continue
        text = f"{title} over {axis.label}: measured {_span(seen.measured, factor)} {unit}"
        text += f", nominal {_span(seen.nominal, factor)} {unit}."
        stem = f"{run.name}-{name}-{axis.label.split()[0]}"
        found.append(Figure(stem, f"{title}, over {axis.label}", text, axis, Axis(what.name, unit), both))
    return found


def _encoders(result: Preview) -> list[str]:
    return [encoder.name for encoder in result.mechanism.encoders]


def _posture(result: Preview, run: SeenRun) -> list[tuple[Axis, np.ndarray]]:
    """Where the linkage is at each sample (N,): the crank angle within a turn, or the travel of a slide; nothing of
    several drives, which no one number tells.
    """
    if result.mechanism.sliding:
        unit, factor = shown("m")
        return [(Axis("travel", unit), run.crank_angle * factor)]
    return [(Axis("crank angle", "deg"), np.degrees(run.crank_angle) % 360.0)] if result.mechanism.cranked else []


def _span(values: np.ndarray, factor: float) -> str:
    here = values[np.isfinite(values)] * factor
    return f"{number(here.min(), 4)} to {number(here.max(), 4)}" if here.size else "absent"


def print_table(result: Preview, console: Console) -> None:
    """Print each sensor with its noise and how far it is from the nominal model, the faults, and what would show."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for head in HEADS:
        table.add_column(head)
    for row in _sensors(result):
        table.add_row(*row)
    console.print(table)
    told = [f"data: run {f.run}, {_spoken(result, f.signal)}: {f.text}" for f in result.faults]
    told += [_facts(result, run) for run in result.runs]
    alike = sum(bool(one.like) for one in result.visible)
    told.append(
        f"{count(len(result.visible), 'effect')} would show in these runs, {alike} of them not apart from another;"
        f" {len(result.invisible)} would not show at all: the page lists them"
    )
    for line in told:
        console.print(line, soft_wrap=True, highlight=False)


def summary_html(result: Preview) -> str:
    """Each sensor with its noise and how far it is from the nominal model."""
    head = "".join(f"<th>{head}</th>" for head in HEADS)
    rows = "".join("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in row) + "</tr>" for row in _sensors(result))
    return f"<p>{html.escape(repr(result))}</p><table><tr>{head}</tr>{rows}</table>"


def plot(result: Preview, figure: Picture) -> None:
    """Every sensor of the first run over time, with the nominal model behind it."""
    run = result.runs[0]
    for axis, (name, seen) in zip(
        figure.subplots(len(run.signals), 1, sharex=True, squeeze=False)[:, 0], run.signals.items(), strict=True
    ):
        unit, factor = shown(seen.unit)
        axis.plot(run.time, factor * seen.nominal, "--", color="0.6", label="nominal")
        axis.plot(run.time, factor * seen.measured, ".", markersize=3, label="measured")
        axis.set_ylabel(f"{_spoken(result, name)} ({unit})")
    figure.suptitle(f"{result.case}, run {run.name}")
