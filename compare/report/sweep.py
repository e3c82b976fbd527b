"""A sweep, shown: a page, one table for a terminal, one figure of a panel for each kind of number, the rows as CSV."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from analytic.mechanism.model import as_written
from analytic.mechanism.one_line import count
from compare.ci import JUnitCase, JUnitSuite, junit_xml
from compare.presentation import Presentation
from compare.quantities import DASH, plain, shown
from compare.report.analysis_figures import MOST_CURVES, ROLES
from compare.report.figure import Axis, Series, scaled
from compare.report.figure import Figure as Drawing
from compare.report.pages import PageSection, charts, figures_context, page, warnings_context
from compare.report.svg import HEIGHT, WIDTH, draw, picture
from compare.report.tables import html_table, print_rows, say
from compare.report.words.limits import sentence
from compare.results.analysis import Limit
from compare.results.sweep import FieldValue, Sweep, SweptPoint

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TITLES = {
    "asked": "largest of what is asked for",
    "reaction": "largest reaction",
    "drive": "largest of the drive",
    "rms": "root mean square",
    "mean": "mean",
    "stroke": "stroke",
    "transmission": "least transmission angle",
    "limited": "number with a limit",
    "error": "largest error by clearance",
    "worst_case": "worst case of clearance",
    "yield": "linkages within the limits",
    "limit": "limits broken or not known",
    "share": "largest difference over its tolerance",
}
IN_FILE = ("rms", "mean", "stroke", "transmission")  # not on a terminal, nor drawn, where nothing limits them
ORDER = ("broken", "unknown", "holds")  # verdicts on limits, the worst first
WIDEST = 8  # numbers of a row on a terminal; the others are in the file
NUMBERS = re.compile(r" \([^()]*\)|^no answer at [^:]*: ")  # of a reason
LONGEST_WHY = 60  # characters of a reason in a table


def files(result: Sweep) -> dict[str, str]:
    """The page, the rows for other programs, the figure, and a JUnit file of what is judged."""
    suites = judged(result)
    tests = {"junit.xml": junit_xml(f"{result.case} over {_over(result)}", suites, result.file)} if suites else {}
    return {"sweep.html": _page(result), "sweep.csv": result.to_csv(), "sweep.svg": figure(result)} | tests


def _page(result: Sweep) -> str:
    drawn, (heads, rows) = list(drawings(result)), table(result)
    context = figures_context(drawn, {each.name: draw(each) for each in drawn}) | warnings_context(result.warnings)
    context |= {
        "result": result,
        "fields": _over(result),
        "limits": list(limits(result)),
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


def _over(result: Sweep) -> str:
    return " and ".join(field.name for field in result.fields)


# ---------------------------------------------------------------- what is judged


def judged(result: Sweep) -> list[JUnitSuite]:
    """Each limit at each point as a test case, the yield, a cross-check, and what keeps a point from its whole answer;
    nothing of a sweep that judges nothing.
    """
    cases = [case for point in result.points for case in _cases(result, point)] if result.judges else []
    return [JUnitSuite(f"points of {_over(result)}", cases)] * bool(cases)


def _cases(result: Sweep, point: SweptPoint) -> Iterator[JUnitCase]:
    place = (result.case, _named(result, point.at))
    for name, limit in point.limits.items():
        said, broken = _said(result, name, limit), limit.verdict != "holds"
        yield JUnitCase(place, name, said, said * broken, kind=limit.verdict, times=limit.times)
    least, good = result.least_yield, point.numbers.get("yield")
    if least and good is not None:
        said = f"{100 * good:.4g} % of the linkages are within the limits, of {100 * least:.4g} % asked for"
        yield JUnitCase(place, "yield", said, said * (good < least), kind="yield")
    if point.verdict is not None:
        said = _judgement(point)
        failure, share = said * (point.verdict != "agrees"), point.numbers.get("share")
        yield JUnitCase(place, "cross-check", said, failure, kind=point.verdict, times=share or 0.0)
    if not point.whole:
        yield JUnitCase(place, "answer", failure=point.remark, error=point.failure, kind="no whole answer")


def _judgement(point: SweptPoint) -> str:
    """The verdict of a cross-check, and the comparison nearest to its tolerance or farthest beyond it."""
    verdict, largest, unit, tolerance, where = _judged(point)
    return verdict.lower() + (f": {where}: {largest} {unit}, tolerance {tolerance}" if point.farthest else "")


def limits(result: Sweep) -> Iterator[str]:
    """Of each limit in a sentence: at how many points it is broken, and where it is so the most, or the nearest to it;
    those that are broken first.
    """
    found: dict[str, list[tuple[Limit, SweptPoint]]] = {}
    for point in result.points:
        for name, limit in point.limits.items():
            found.setdefault(name, []).append((limit, point))
    first = {name: min((limit.verdict for limit, _ in those), key=ORDER.index) for name, those in found.items()}
    for name, verdict in sorted(first.items(), key=lambda each: ORDER.index(each[1])):
        those = [(limit, point) for limit, point in found[name] if limit.verdict == verdict]
        limit, point = max(those, key=lambda each: each[0].times)
        where = f"{verdict} at {len(those)} of {count(len(result.points), 'point')}"
        silent = sum(limit.verdict == "unknown" for limit, _ in found[name])
        where += f", not known at {silent}" if silent and verdict == "broken" else ""
        yield f"{where}: {_said(result, name, limit)}, at {_named(result, point.at)}"


def _said(result: Sweep, name: str, limit: Limit) -> str:
    """What there is to say of a limit at a point."""
    timed = any(column.group == "place" and column.unit == "s" for column in result.columns.values())
    at = "" if limit.at is None else f"{plain(limit.at, 4)} s" if timed else f"{plain(np.degrees(limit.at), 4)} deg"
    return sentence(name, limit, at)


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
    say(console, *limits(result))
    say(console, repr(result))


def table(result: Sweep) -> tuple[list[str], list[list[str]]]:
    """The heads and the rows of the table."""
    names = main_columns(result)
    heads = [field.head for field in result.fields]
    if result.asks == "crosscheck":
        heads += ["verdict", "largest difference", "unit", "tolerance", "where"]
    else:
        units = {name: _unit(result.columns[name].unit) for name in names}
        heads += [f"{result.columns[name].label} ({units[name]})".removesuffix(" ()") for name in names]
    missing = [point.failure or point.remark for point in result.points]
    rows = []
    for point, why in zip(result.points, missing, strict=True):
        row = [said(value) for value in result.values(point, written=True).values()]
        row += _judged(point) if result.asks == "crosscheck" else [_cell(result, point, name) for name in names]
        rows.append([*row, *([_brief(why)] if any(missing) else [])])
    return [*heads, *(["missing"] if any(missing) else [])], rows


def main_columns(result: Sweep) -> list[str]:
    """The columns of a terminal: what limits are of, each reaction and drive, the largest if there are too many, and of
    the errors the largest of each unit.
    """
    limited, chosen = _limited(result), list[str]()
    for (group, _), names in kinds(result).items():
        chosen += names[: 1 if group in ("error", "worst_case") else WIDEST]
    largest = [*limited, *sorted({*chosen} - {*limited}, key=list(result.columns).index)]
    return largest if len(largest) <= WIDEST else largest[: WIDEST - 2] + largest[-2:]


def _limited(result: Sweep) -> list[str]:
    """The columns that limits are of."""
    asked = {name for point in result.points for name in point.limits}
    return [name for name in result.columns if {name, name.removesuffix("_magnitude")} & asked]


def kinds(result: Sweep) -> dict[tuple[str, str], list[str]]:
    """The columns of numbers that are not zero throughout, but for a yield, by what they are and their unit, the
    largest first; of what is for the file those with limits.
    """
    by_kind: dict[tuple[str, str], list[str]] = {}
    limited = _limited(result)
    for name, column in result.columns.items():
        if column.group in IN_FILE and name not in limited:
            continue
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


def _named(result: Sweep, at: Mapping[str, int]) -> str:
    fields = {field.name: field for field in result.fields}
    return ", ".join(f"{n} = {said(fields[n].written[k])} {fields[n].written_unit}".strip() for n, k in at.items())


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


PRESENTATION = Presentation(summary_html, print_table, files, plot, judged=judged)
