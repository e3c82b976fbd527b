"""A sweep, shown: a page, one table for a terminal, one figure of a panel for each kind of number, the rows as CSV."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from analytic.mechanism.model import as_written
from analytic.mechanism.one_line import count
from compare.presentation import Presentation
from compare.quantities import DASH, plain, shown
from compare.report.analysis_figures import MOST_CURVES, ROLES
from compare.report.figure import Axis, Series, scaled
from compare.report.figure import Figure as Drawing
from compare.report.pages import PageSection, charts, figures_context, page, warnings_context
from compare.report.svg import HEIGHT, WIDTH, draw, picture
from compare.report.tables import html_table, print_rows, say
from compare.results.sweep import FieldValue, Sweep, SweptPoint

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLES = {
    "asked": "largest of what is asked for",
    "reaction": "largest reaction",
    "drive": "largest of the drive",
    "error": "largest error by clearance",
    "worst_case": "worst case of clearance",
    "yield": "linkages within the limits",
    "limit": "limits broken",
    "share": "largest difference over its tolerance",
}
WIDEST = 8  # numbers of a row on a terminal; the others are in the file
NUMBERS = re.compile(r" \([^()]*\)|^no answer at [^:]*: ")  # of a reason
LONGEST_WHY = 60  # characters of a reason in a table


def files(result: Sweep) -> dict[str, str]:
    """The page, the rows for other programs, and the figure."""
    return {"sweep.html": _page(result), "sweep.csv": result.to_csv(), "sweep.svg": figure(result)}


def _page(result: Sweep) -> str:
    drawn, (heads, rows) = list(drawings(result)), table(result)
    context = figures_context(drawn, {each.name: draw(each) for each in drawn}) | warnings_context(result.warnings)
    context |= {
        "result": result,
        "fields": " and ".join(field.name for field in result.fields),
        "headline": repr(result).removeprefix(f"Sweep({result.case}, ").removesuffix(")"),
        "heads": heads,
        "rows": rows,
        "reasons": _reasons(result),
        "assumed": (),
        "mechanism": json.dumps(as_written(result.mechanism), indent=2, ensure_ascii=False),
    }
    return page(
        f"{result.case} {DASH} sweep",
        PageSection("sweep/header.html.j2", context),
        [PageSection(name, context) for name in ("sweep/points.html.j2", "figures.html.j2", "provenance.html.j2")],
        script=charts(drawn),
        skip_to="the points",
        footer=f"All values come from {result.file} beside this page, which needs no network.",
    )


# ---------------------------------------------------------------- the table


def print_table(result: Sweep, console: Console) -> None:
    """Print a row for each point, in degrees and millimetres, what is missing, and where the rest of it is; ASCII."""
    heads, rows = table(result)
    print_rows(console, heads, rows, left=("verdict", "where", "missing"), folded=heads[len(result.fields) :])
    hidden = len(result.columns) - len(main_columns(result))
    if hidden:
        say(console, f"{count(hidden, 'more column')} in sweep.csv")
    for why, points in _reasons(result).items():
        say(console, f"{count(points, 'point')}: {why}")
    say(console, repr(result))


def table(result: Sweep) -> tuple[list[str], list[list[str]]]:
    """The heads and the rows of the table."""
    names = main_columns(result)
    heads = [field.head for field in result.fields]
    if result.asks == "crosscheck":
        heads += ["verdict", "largest difference", "unit", "tolerance", "where"]
    else:
        heads += [f"{result.columns[name].label} ({_unit(result.columns[name].unit)})" for name in names]
    missing = [point.failure or point.remark for point in result.points]
    rows = []
    for point, why in zip(result.points, missing, strict=True):
        row = [said(value) for value in result.values(point, written=True).values()]
        row += _judged(point) if result.asks == "crosscheck" else [_cell(result, point, name) for name in names]
        rows.append([*row, *([_brief(why)] if any(missing) else [])])
    return [*heads, *(["missing"] if any(missing) else [])], rows


def main_columns(result: Sweep) -> list[str]:
    """The columns of a terminal: each reaction and drive, the largest if there are too many, and of the errors the
    largest of each unit.
    """
    chosen: list[str] = []
    for (group, _), names in kinds(result).items():
        chosen += names[: 1 if group in ("error", "worst_case") else WIDEST]
    largest = sorted(chosen, key=lambda name: list(result.columns).index(name))
    return largest if len(largest) <= WIDEST else largest[: WIDEST - 2] + largest[-2:]


def kinds(result: Sweep) -> dict[tuple[str, str], list[str]]:
    """The columns of numbers that are not zero throughout, but for a yield, by what they are and their unit, the
    largest first.
    """
    by_kind: dict[tuple[str, str], list[str]] = {}
    for name, column in result.columns.items():
        if column.group == "yield" or (size(result, name) > 0 and column.group != "place"):
            by_kind.setdefault((column.group, column.unit), []).append(name)
    return {kind: sorted(names, key=lambda name: -size(result, name)) for kind, names in by_kind.items()}


def size(result: Sweep, name: str) -> float:
    """The largest size of a column (SI)."""
    return max((abs(value) for point in result.points if (value := point.numbers.get(name)) is not None), default=0.0)


def said(value: FieldValue) -> str:
    """A field's value as a table has it."""
    return value if isinstance(value, str) else f"{value:.6g}"


def _judged(point: SweptPoint) -> list[str]:
    far = point.farthest
    verdict = (point.verdict or "no answer").replace("unjudged", "not judged")
    verdict = verdict.upper() if verdict in ("disagrees", "no answer") else verdict
    if far is None:
        return [verdict, "-", "", "-", "-"]
    unit, factor = shown(far.unit)
    numbers = (
        "-" if v is None else plain(factor * v, 3, sign) for v, sign in ((far.max, True), (far.tolerance, False))
    )
    largest, tolerance = numbers
    return [verdict, largest, unit.replace("·", "."), tolerance, f"{far.signal}, {far.run}"]


def _cell(result: Sweep, point: SweptPoint, name: str) -> str:
    value = point.numbers.get(name)
    return "-" if value is None else plain(shown(result.columns[name].unit)[1] * value, 4)


def _unit(unit: str) -> str:
    return shown(unit)[0].replace("·", ".")


def _brief(why: str) -> str:
    """What is missing, as a table has it: how much, where that is said first."""
    short = why if len(why) <= LONGEST_WHY else why.partition(": ")[0]
    return short if len(short) <= LONGEST_WHY else f"{why[: LONGEST_WHY - 4]} ..."


def _reasons(result: Sweep) -> dict[str, int]:
    """Each reason that is too long for the table, without its numbers, and at how many points it is."""
    texts = (point.failure or point.remark for point in result.points)
    return dict(Counter(NUMBERS.sub("", why) for why in texts if len(why) > LONGEST_WHY))


def summary_html(result: Sweep) -> str:
    """The table."""
    heads, rows = table(result)
    return html_table(rows, heads, repr(result))


# ---------------------------------------------------------------- the figure


@dataclass(frozen=True)
class Panel:
    """Curves (name, y) over the first field, of one kind of number, in a unit that people read."""

    title: str
    unit: str
    curves: dict[str, list[float | None]]


def places(result: Sweep) -> list[float]:
    """The values of the first field along an axis, as they are written; words one after the other."""
    written = result.fields[0].written
    return [float(value) if not isinstance(value, str) else float(k) for k, value in enumerate(written)]


def panels(result: Sweep) -> Iterator[Panel]:
    """A panel for each kind of number and unit: its largest columns, at most six, or where several fields vary the
    largest one, a curve for each value of the others.
    """
    for (group, si), ordered in kinds(result).items():
        unit, factor = ("", 1.0) if group == "share" else shown(si)
        if len(result.fields) == 1:
            curves = {result.columns[name].label: _curve(result, name, factor, {}) for name in ordered[:MOST_CURVES]}
            yield Panel(TITLES[group], unit, curves)
            continue
        others = {tuple(p.at[f.name] for f in result.fields[1:]): p for p in result.points}
        combinations = _spaced([{n: p.at[n] for n in list(p.at)[1:]} for p in others.values()])
        curves = {_named(result, at): _curve(result, ordered[0], factor, at) for at in combinations}
        label = result.columns[ordered[0]].label
        yield Panel(label if group == "share" else f"largest {label.removeprefix('largest ')}", unit, curves)


def _spaced(combinations: list[dict[str, int]]) -> list[dict[str, int]]:
    """At most six, evenly chosen, the first and the last among them."""
    chosen = np.unique(np.linspace(0, len(combinations) - 1, min(MOST_CURVES, len(combinations))).round().astype(int))
    return [combinations[k] for k in chosen]


def _named(result: Sweep, at: dict[str, int]) -> str:
    fields = {field.name: field for field in result.fields}
    return ", ".join(f"{n} {said(fields[n].written[k])} {fields[n].written_unit}".strip() for n, k in at.items())


def _curve(result: Sweep, name: str, factor: float, at: dict[str, int]) -> list[float | None]:
    along = (point for point in result.points if all(point.at[field] == k for field, k in at.items()))
    values = [point.numbers.get(name) for point in along]
    return [None if value is None else factor * value for value in values]


def plot(result: Sweep, figure: Figure) -> None:
    """A panel for each kind of number over the first field."""
    drawn = list(panels(result))
    axes = figure.subplots(len(drawn) or 1, 1, sharex=True, squeeze=False)[:, 0]
    figure.set_figheight(2.6 * (len(drawn) or 1) + 1)
    x = places(result)
    for axis, panel in zip(axes, drawn, strict=False):
        for name, curve in panel.curves.items():
            values = [np.nan if value is None else value for value in curve]
            axis.plot(x, values, "o-", markersize=3, linewidth=1.2, label=name)
        if panel.title == TITLES["share"]:
            axis.axhline(1.0, color="k", linewidth=0.8, linestyle="--", label="tolerance")
        axis.set_ylabel(f"{panel.title}\n({panel.unit})" if panel.unit else panel.title, fontsize="small")
        axis.legend(fontsize="x-small", loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes[-1].set_xlabel(result.fields[0].head)
    if any(isinstance(value, str) for value in result.fields[0].written):
        axes[-1].set_xticks(x, [said(value) for value in result.fields[0].written])
    figure.suptitle(f"{result.case} over {result.fields[0].name}")


def figure(result: Sweep) -> str:
    """The same as SVG text, one panel below the other."""
    drawn = [draw(each) for each in drawings(result)]
    body = [text.replace("<svg ", f'<svg y="{k * HEIGHT:g}" ', 1) for k, text in enumerate(drawn)]
    return picture(WIDTH, HEIGHT * max(len(body), 1), f"{result.case} over {result.fields[0].name}", body)


def drawings(result: Sweep) -> Iterator[Drawing]:
    """Each panel as a figure of its own."""
    x = scaled(places(result))
    for k, panel in enumerate(panels(result)):
        series = [
            Series(name, x, scaled(curve), role)
            for (name, curve), role in zip(panel.curves.items(), ROLES, strict=False)
        ]
        if panel.title == TITLES["share"]:
            series.append(Series("tolerance", (x[0], x[-1]), (1.0, 1.0), "ideal-line", "dashed"))
        field = result.fields[0]
        title = f"{result.case}: {panel.title}"
        axes = Axis(field.name, field.written_unit), Axis(panel.title, panel.unit)
        yield Drawing(f"sweep_{k}", title, f"Over {field.name}.", *axes, tuple(series))


PRESENTATION = Presentation(summary_html, print_table, files, plot)
