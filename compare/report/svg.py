"""A figure as an SVG file: on white, with presentation attributes only, so that any viewer shows it alike.

Every drawing of a report is made of these: the picture with its text alternative, words, boxes and axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from xml.sax.saxutils import escape, quoteattr
from zlib import crc32

import numpy as np

from compare.files import NOT_XML
from compare.quantities import SUPERSCRIPT
from compare.report.figure import Axis, Figure, Mark, Numbers, Series
from compare.report.label_places import Area, Label, along, placed

WIDTH, HEIGHT, TALLEST = 720.0, 420.0, 640.0
LEFT, RIGHT, BOTTOM, LINE = 76.0, 18.0, 52.0, 20.0
PANEL = 220.0  # at least, of several side by side
COLOURS = {  # the page's style sheet has the same, with lighter ones for a dark screen
    "analytic": "#1b1f24",
    "ideal-line": "#6b7280",
    "frame": "#8a919c",
    "ideal": "#9c4f96",
    "massless-link": "#0067a5",
    "spring-damper": "#c2500a",
    "contact": "#00795c",
    "free": "#a9b0ba",  # a pin without contact, and four bands of force (plasma, darker where more)
    "force-1": "#e79a2b",
    "force-2": "#d4546b",
    "force-3": "#8b2d91",
    "force-4": "#251270",
}
DASHES = ("", "7 4", "2 3", "9 3 2 3")  # a simulator each
SHAPES = {"ideal": "plus", "massless-link": "circle", "spring-damper": "square", "contact": "cross", "analytic": "dot"}
GLYPHS = {  # r is half the size
    "circle": "m{r} 0a{r} {r} 0 1 0 -{d} 0a{r} {r} 0 1 0 {d} 0",
    "square": "m-{r} -{r}h{d}v{d}h-{d}z",
    "plus": "m-{r} 0h{d}m-{r} -{r}v{d}",
    "cross": "m-{r} -{r}l{d} {d}m-{d} 0l{d} -{d}",
    "dot": "m-{r} 0h{d}m-{r} -{r}v{d}",
}
INK, PAPER, RULE, GRID = "#1b1f24", "#fff", "#8a919c", "#e4e7eb"


def text(value: str) -> str:
    """Text that is safe in XML: markup escaped, and what XML cannot hold left out."""
    return escape(NOT_XML.sub("", value))


@dataclass(frozen=True)
class Scale:
    """A linear axis: data ``low`` to ``high`` onto pixels ``start`` to ``end``."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        return self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)


def ticks(low: float, high: float, count: int, degrees: bool = False) -> list[float]:
    """Round values in [low, high], about ``count`` of them; angles count in 15, 30, 45, 60, 90 degrees."""
    rough = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    steps = [15, 30, 45, 60, 90, 180, 360] if degrees and rough > 10 else [m * power for m in (1, 2, 5, 10)]
    step = next((s for s in steps if s >= rough * 0.999), steps[-1] * math.ceil(rough / steps[-1]))
    return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def exponent(largest: float) -> int:
    """The power of ten that an axis puts into its title, 0 for ordinary numbers."""
    if 1e-2 <= largest < 1e5 or largest == 0:
        return 0
    return 3 * math.floor(math.log10(largest) / 3)


def extent(values: list[float], margin: float) -> tuple[float, float]:
    """The range of values with a margin, never empty."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    least = 1e-4 * max(abs(low), abs(high)) if margin else 0.0  # what rounding does is no curve
    spare = max(margin * (high - low), least) or margin
    return low - spare, high + spare


def draw(figure: Figure) -> str:
    """The figure as SVG text."""
    if figure.panels:
        return _draw_panels(figure)
    legend = _legend(figure.series)
    top = 44.0 + LINE * len(legend)
    x, y, height = _scales(figure, top)
    body = [label(figure.title, 14, 22, size=15, weight="600"), *_drawn_legend(legend), *_axes(figure, x, y)]
    body += [*_area(figure.name, figure.series, x, y), *_labels(figure, x, y)]
    return picture(WIDTH, height, f"{figure.title}. {figure.summary}", body)


def _draw_panels(figure: Figure) -> str:
    """Its panels side by side, at one scale; a colour is the same in all of them."""
    legend = _legend(figure.roles)
    top, wide = 66.0 + LINE * len(legend), max((WIDTH - LEFT - RIGHT) / len(figure.panels), PANEL)
    x, y, _ = _scales(figure, top)
    body = [label(figure.title, 14, 22, size=15, weight="600"), *_drawn_legend(legend)]
    for k, title in enumerate(figure.panels):
        left = LEFT + k * wide
        across = replace(x, start=left, end=left + wide - RIGHT)
        body += [*_axes(figure, across, y, 4, numbered=k == 0), label(title, across.start, top - 8, weight="600")]
        body += _area(f"{figure.name} {k}", figure.panel(k), across, y)
    return picture(LEFT + wide * len(figure.panels), HEIGHT, f"{figure.title}. {figure.summary}", body)


def _area(name: str, series: Iterable[Series], x: Scale, y: Scale) -> list[str]:
    """Series within the axes."""
    area = f"area-{crc32(name.encode()):x}"  # its own, because a page may hold several drawings
    return [
        f'<clipPath id="{area}"><rect x="{x.start:.1f}" y="{y.end:.1f}" width="{x.end - x.start:.1f}"'
        f' height="{y.start - y.end:.1f}"/></clipPath>',
        f'<g clip-path="url(#{area})" fill="none">',
        *(_series(s, x, y) for s in series),
        "</g>",
    ]


def picture(width: float, height: float, alternative: str, body: Iterable[str]) -> str:
    """A whole drawing (px), with what it shows in words."""
    label = quoteattr(NOT_XML.sub("", alternative))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}"'
        f' height="{height:g}" role="img" aria-label={label} font-family="system-ui, sans-serif" font-size="12"><rect'
        f' width="100%" height="100%" fill="{PAPER}"/>\n' + "\n".join(body) + "\n</svg>\n"
    )


def label(
    said: str,
    x: float,
    y: float,
    anchor: str = "start",
    size: int = 12,
    weight: str = "400",
    fill: str = INK,
    extra: str = "",
) -> str:
    """Words at a place (px)."""
    style = f'text-anchor="{anchor}" font-size="{size}" font-weight="{weight}" fill="{fill}"'
    return f'<text x="{x:.1f}" y="{y:.1f}" {style}{extra}>{text(said)}</text>'


def box(x: float, y: float, width: float, height: float, fill: str) -> str:
    """A filled box (px) with a thin edge."""
    return (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" fill="{fill}" stroke="{RULE}"'
        ' stroke-width="0.6"/>'
    )


@dataclass(frozen=True)
class Marked:
    """An axis as it is drawn: its title, its numbers with their places (px), and how far from the area both are."""

    title: str
    numbers: Sequence[tuple[str, float]]
    away: float
    title_away: float = 0.0
    size: int = 12


def axis_labels(across: Marked, up: Marked, left: float, right: float, top: float, bottom: float) -> list[str]:
    """Numbers and titles of the axes beside an area (px)."""
    out = [label(number, x, bottom + across.away, "middle", across.size) for number, x in across.numbers]
    out += [label(number, left - up.away, y + 4, "end", up.size) for number, y in up.numbers]
    if across.title:
        out.append(label(across.title, (left + right) / 2, bottom + across.title_away, "middle"))
    if up.title:
        x, y = left - up.title_away, (top + bottom) / 2
        out.append(label(up.title, x, y, "middle", extra=f' transform="rotate(-90 {x:g} {y:.1f})"'))
    return out


def _scales(figure: Figure, top: float) -> tuple[Scale, Scale, float]:
    xs = [v for s in figure.series if s.scale for v in s.x if v is not None]
    ys = [v for s in figure.series if s.scale for v in s.y if v is not None]
    if figure.kind == "curves":
        limits = [v for s in figure.series if not s.scale for v in s.y if v is not None]
        reach = 4 * max(map(abs, ys), default=0.0)
        (left, right), (low, high) = extent(xs, 0.015), extent(ys + [v for v in limits if abs(v) <= reach], 0.06)
        return Scale(left, right, LEFT, WIDTH - RIGHT), Scale(low, high, HEIGHT - BOTTOM, top), HEIGHT
    spare = 0.1 * max(max(v, default=1.0) - min(v, default=0.0) for v in (xs, ys)) or 1.0
    (left, right), (low, high) = (
        extent([min(v, default=0.0) - spare, max(v, default=0.0) + spare], 0.0) for v in (xs, ys)
    )
    wide = WIDTH - LEFT - RIGHT
    tall = min(max(wide * (high - low) / (right - left), 160.0), TALLEST - top - BOTTOM)
    per_unit = min(wide / (right - left), tall / (high - low))
    middle, half = (left + right) / 2, wide / per_unit / 2
    centre, rise = (low + high) / 2, tall / per_unit / 2
    height = top + tall + BOTTOM
    return (
        Scale(middle - half, middle + half, LEFT, WIDTH - RIGHT),
        Scale(centre - rise, centre + rise, height - BOTTOM, top),
        height,
    )


def _axes(figure: Figure, x: Scale, y: Scale, count: int = 8, numbered: bool = True) -> list[str]:
    """Grid, frame, numbers and titles of a figure's axes; the upright one ``numbered`` or without words."""
    across, power_x = _marked(figure.x, x, count)
    up, power_y = _marked(figure.y, y, 6)
    out = [f'<path d="M{at:.1f} {y.start:.1f}V{y.end:.1f}" stroke="{GRID}"/>' for _, at in across]
    out += [f'<path d="M{x.start:.1f} {at:.1f}H{x.end:.1f}" stroke="{GRID}"/>' for _, at in up]
    out.append(f'<path d="M{x.start:.1f} {y.end:.1f}V{y.start:.1f}H{x.end:.1f}" fill="none" stroke="{RULE}"/>')
    upright = Marked(_axis_title(figure.y, power_y), up, 8, 60) if numbered else Marked("", (), 8)
    titles = Marked(_axis_title(figure.x, power_x), across, 17, 40), upright
    return out + axis_labels(*titles, x.start, x.end, y.end, y.start)


def _marked(axis: Axis, scale: Scale, count: int) -> tuple[list[tuple[str, float]], int]:
    """About so many numbers along an axis with their places (px), and the power of ten that its title has."""
    power = exponent(max(abs(scale.low), abs(scale.high)))
    marks = ticks(scale.low, scale.high, count, axis.unit == "deg")
    return [(f"{value / 10**power + 0.0:.6g}", scale(value)) for value in marks], power


def _axis_title(axis: Axis, power: int) -> str:
    return f"{axis.label} (10{str(power).translate(SUPERSCRIPT)} {axis.unit})" if power else axis.title


def _legend(all_series: Iterable[Series]) -> list[list[tuple[Series, float]]]:
    """Named series in lines that fit the width, each with its x."""
    lines: list[list[tuple[Series, float]]] = []
    at = WIDTH
    for series in (s for s in all_series if s.name):
        width = 44 + 6.7 * len(series.name)
        if at + width > WIDTH - RIGHT:
            lines.append([])
            at = 14.0
        lines[-1].append((series, at))
        at += width
    return lines


def _drawn_legend(lines: list[list[tuple[Series, float]]]) -> list[str]:
    out = []
    for i, line in enumerate(lines):
        for series, at in line:
            y = 42 + LINE * i
            key = Series("", (at + 12,), (y,), series.role, series.mark, series.level)
            if series.mark != "marker":
                mark: Mark = "link" if series.mark == "band" else series.mark
                key = Series("", (at, at + 24), (y, y), series.role, mark, series.level)
            same = Scale(0, 1, 0, 1)
            out += [f'<g fill="none">{_series(key, same, same)}</g>', label(series.name, at + 30, y + 4)]
    return out


def _series(s: Series, x: Scale, y: Scale) -> str:
    colour = COLOURS.get(s.role, COLOURS["analytic"])
    if s.mark in ("marker", "joint", "pivot"):
        glyph = {"joint": "circle", "pivot": "pivot"}.get(s.mark) or SHAPES.get(s.role, "circle")
        r = {"joint": 5.0, "pivot": 11.0}.get(s.mark) or {"dot": 3.5, "circle": 5.5, "square": 4.0}.get(
            glyph, 4.5
        ) + 1.5 * s.level
        path = (
            f"m0 0l{r:g} {1.5 * r:g}h-{2 * r:g}z"
            if glyph == "pivot"
            else GLYPHS[glyph].format(r=f"{r:g}", d=f"{2 * r:g}")
        )
        points = "".join(
            f"M{x(a):.1f} {y(b):.1f}{path}" for a, b in zip(s.x, s.y, strict=True) if a is not None and b is not None
        )
        inside = "none" if s.mark == "marker" else "#fff"
        return f'<path d="{points}" stroke="{colour}" stroke-width="1.6" fill="{inside}"/>'
    if s.mark == "band":
        return f'<path d="{_line(s.x, s.y, x, y)}Z" fill="{colour}" fill-opacity="0.2"/>'
    width = {"link": 7.0, "dashed": 1.6}.get(s.mark, 2.0 if s.role == "analytic" else 1.7)
    dash = "6 4" if s.mark == "dashed" else DASHES[s.level % len(DASHES)]
    faint = ' stroke-opacity="0.4"' if s.mark == "link" else ""
    dashes = f' stroke-dasharray="{dash}"' if dash else ""
    stroke = f'stroke="{colour}" stroke-width="{width:g}" stroke-linejoin="round" stroke-linecap="round"'
    return f'<path d="{_line(s.x, s.y, x, y)}" {stroke}{dashes}{faint}/>'


def _line(xs: Numbers, ys: Numbers, x: Scale, y: Scale) -> str:
    out, pen = [], "M"
    for a, b in zip(xs, ys, strict=True):
        if a is None or b is None:
            pen = "M"
            continue
        out.append(f"{pen}{x(a):.1f} {y(b):.1f}")
        pen = "L"
    return "".join(out)


def _labels(figure: Figure, x: Scale, y: Scale) -> list[str]:
    """Names of joints, and what peaks are: within the area, where they cover least."""
    points = {s: np.array([_point(a, b, x, y) for a, b in zip(s.x, s.y, strict=True)], complex) for s in figure.series}
    named = [
        Label(name, (6.2 if s.mark == "marker" else 8.6) * len(name), complex(at), s.mark == "marker")
        for s, places in points.items()
        for name, at in zip(s.labels, places, strict=False)
        if np.isfinite(at)
    ]
    if not named:
        return []
    marks = [at for s, places in points.items() if s.mark in ("marker", "joint", "pivot") for at in places]
    lines = [places for s, places in points.items() if s.mark in ("line", "dashed")]
    curves = along(lines if any(label.peak for label in named) else ())
    done = placed(named, Area(x.start, x.end, y.end, y.start), np.array(marks, complex), curves)
    halo = f' paint-order="stroke" stroke="{PAPER}" stroke-width="3"'
    styles = {True: (12, "400"), False: (14, "600")}
    return [label(each.text, each.left, each.base, "start", *styles[each.peak], extra=halo) for each in done]


def _point(a: float | None, b: float | None, x: Scale, y: Scale) -> complex:
    """A point as px, x + iy; NaN of none."""
    return complex(math.nan, math.nan) if a is None or b is None else complex(x(a), y(b))
