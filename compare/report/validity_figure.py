"""A validity map as an SVG file: one panel for an engine and restitution, a cell for each speed and clearance, the
boundaries drawn between cells; with it what contact does, in a small map for each figure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product
from xml.sax.saxutils import quoteattr

from compare.report.svg import NOT_XML, text
from compare.report.words.validity import (
    Measure,
    about,
    edges,
    failing,
    legend,
    lost,
    measures,
    millimetres,
    panel_title,
    percent,
    rpm,
)
from compare.results.validity import Boundary, Cell, Failed, Validity

LEFT, RIGHT, TOP, BETWEEN = 76.0, 18.0, 84.0, 74.0
CELL_WIDTH, CELL_HEIGHT, NARROWEST = 78.0, 80.0, 720.0
INK, PAPER, GRID = "#1b1f24", "#fff", "#8a919c"
SHADES = (
    (1.0, "#0b6e4f", PAPER),
    (0.75, "#4f9d7e", INK),
    (0.5, "#93c6ae", INK),
    (0.25, "#cbe3d7", INK),
    (0.0, "#f4f1ea", INK),
)
FAILED = "#d0d4da"
SMALL_WIDTH, SMALL_HEIGHT, SMALL_BETWEEN, BESIDE = 52.0, 24.0, 30.0, 96.0  # of the maps of what contact does
WIDEST = 900.0  # px, up to which these stand beside their panel; else below it, in its columns
HEAT = (("#fff8f0", INK), ("#fde0c4", INK), ("#f6b37f", INK), ("#dd7633", INK), ("#9a3a06", PAPER))
PURPLE = "#a86cc1"
PREDICTED = (
    ("contact lost above, predicted", "yielding", f'stroke="{PURPLE}" stroke-width="2.5"'),
    ("the same with rigid walls", "rigid", f'stroke="{PURPLE}" stroke-width="1.6" stroke-dasharray="2 4"'),
)
State = Callable[[Cell | Failed], bool | None]  # None where a cell cannot say


def agrees(cell: Cell | Failed) -> bool | None:
    """Whether the equilibrium agrees with the simulation."""
    return None if isinstance(cell, Failed) else cell.agrees


def touches(cell: Cell | Failed) -> bool | None:
    """Whether pins and blocks never leave their walls."""
    return None if isinstance(cell, Failed) else not cell.left


def first_order(cell: Cell | Failed) -> bool | None:
    """Whether Eq. 8 is within tolerance of the equilibrium."""
    return None if isinstance(cell, Failed) else "first-order" not in cell.fails


BOUNDARIES: tuple[
    tuple[str, State, str, float], ...
] = (  # name, what changes there, its stroke, and how far beside the edge (px)
    ("equilibrium agrees / disagrees", agrees, f'stroke="{INK}" stroke-width="3.5" stroke-linecap="square"', 0.0),
    ("contact kept / lost", touches, 'stroke="#c2500a" stroke-width="2.5" stroke-dasharray="7 4"', 3.0),
    ("Eq. 8 within tolerance / not", first_order, 'stroke="#0067a5" stroke-width="2.5" stroke-dasharray="2 3"', -3.0),
)


def draw(result: Validity) -> str:
    """The map as SVG text."""
    columns, rows = len(result.speeds), len(result.clearances)
    notes = [
        about(result),
        *result.words,
        *legend(result),
        "in bold: why the equilibrium disagrees; free: share of the cycle without contact",
        *["a predicted boundary that is beyond the map stands at its edge"] * bool(result.boundary),
    ]
    shown = measures(result)
    small = rows * SMALL_HEIGHT + SMALL_BETWEEN
    aside = LEFT + columns * CELL_WIDTH + BESIDE
    beside = aside + columns * SMALL_WIDTH + RIGHT <= WIDEST
    width = max(NARROWEST, LEFT + RIGHT + columns * CELL_WIDTH, aside + columns * SMALL_WIDTH + RIGHT if beside else 0)
    wrapped = [line for note in notes for line in _wrapped(note, int((width - 28) / 5.6))]
    main, maps = rows * CELL_HEIGHT + BETWEEN, len(shown) * small + (40 if shown else 0)
    panel = max(main, maps) if beside else main + maps
    panels = list(result.panels())
    top = TOP + (20 if result.boundary else 0)
    end = top + panel * len(panels) + 6
    height = end + 17 * len(wrapped) + 6
    title = f"Where the analytic model holds: {result.case}"
    body = [_text(title, 14, 22, size=15, weight="600"), *_key(14.0, 42.0, bool(result.boundary))]
    for k, one in enumerate(panels):
        start = top + k * panel
        body += _panel(result, *one, start)
        for j, measure in enumerate(shown):
            place = (aside, start + 22 + j * small) if beside else (LEFT, start + main + 12 + j * small)
            size = SMALL_WIDTH if beside else CELL_WIDTH
            body += _small(result, result.of(*one), measure, place, size, last=j == len(shown) - 1)
    body += [_text(line, 14, end + 17 * k, size=11) for k, line in enumerate(wrapped)]
    label = quoteattr(NOT_XML.sub("", " ".join([title + ".", *(f"{line}." for line in result.words)])))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}"'
        f' height="{height:g}" role="img" aria-label={label} font-family="system-ui, sans-serif" font-size="12"><rect'
        f' width="100%" height="100%" fill="{PAPER}"/>\n' + "\n".join(body) + "\n</svg>\n"
    )


def _panel(result: Validity, simulator: str, restitution: float | None, top: float) -> list[str]:
    """One engine's cells at one restitution, axes and boundaries; clearance grows upwards."""
    found, speeds, clearances = result.of(simulator, restitution), result.speeds, result.clearances
    start, bottom = top + 22, top + 22 + len(clearances) * CELL_HEIGHT

    def corner(column: int, row: int) -> tuple[float, float]:
        return LEFT + column * CELL_WIDTH, bottom - (row + 1) * CELL_HEIGHT

    shades, words = [], []
    for i, j in product(range(len(speeds)), range(len(clearances))):
        shade, *said = _cell(found[speeds[i], clearances[j]], *corner(i, j))
        shades.append(shade)
        words += said
    out = [_text(panel_title(result, simulator, restitution), LEFT, top + 14, weight="600"), *shades]
    out += [*_curves(edges(result, restitution), result, corner), *words]
    for i, speed in enumerate(speeds):
        out.append(_text(rpm(speed), LEFT + (i + 0.5) * CELL_WIDTH, bottom + 16, "middle"))
    for j, clearance in enumerate(clearances):
        out.append(_text(millimetres(clearance), LEFT - 8, corner(0, j)[1] + CELL_HEIGHT / 2 + 4, "end"))
    out.append(_text("speed (rpm)", LEFT + len(speeds) * CELL_WIDTH / 2, bottom + 34, "middle"))
    middle = (start + bottom) / 2
    out.append(_text("clearance (mm)", 20, middle, "middle", extra=f' transform="rotate(-90 20 {middle:.1f})"'))
    grid = [[found[speed, clearance] for clearance in clearances] for speed in speeds]
    for _, state, stroke, beside in BOUNDARIES:
        path = _boundary([[state(cell) for cell in column] for column in grid], corner, beside)
        if path:
            halo = f'<path d="{path}" fill="none" stroke="{PAPER}" stroke-width="4.5"/>' if beside else ""
            out.append(f'{halo}<path d="{path}" fill="none" {stroke}/>')
    return out


def _curves(
    found: Sequence[Boundary], result: Validity, corner: Callable[[int, int], tuple[float, float]]
) -> list[str]:
    """The predicted boundaries, between the rows by the logarithm of the clearance; at the panel's edge where they are
    beyond it.
    """
    places = {speed: i for i, speed in enumerate(result.speeds)}
    bottom, above = corner(0, 0)[1] + CELL_HEIGHT, corner(0, len(result.clearances) - 1)[1]
    middles = [corner(0, j)[1] + CELL_HEIGHT / 2 for j in range(len(result.clearances))]
    logs = [math.log(gap) for gap in result.clearances]

    def height(edge: float | None) -> float:
        if edge is None:
            return above
        if edge <= result.clearances[0]:
            return bottom
        j = next(j for j, log in enumerate(logs) if log >= math.log(edge) - 1e-9)
        return middles[j - 1] + (middles[j] - middles[j - 1]) * (math.log(edge) - logs[j - 1]) / (logs[j] - logs[j - 1])

    out = []
    for _, kind, stroke in reversed(PREDICTED):
        points = [(corner(places[one.speed], 0)[0] + CELL_WIDTH / 2, height(getattr(one, kind))) for one in found]
        if points:
            path = "M" + "L".join(f"{x:g} {y:.1f}" for x, y in points)
            dots = "".join(f"M{x - 3:g} {y:.1f}h6" for x, y in points)
            out.append(f'<path d="{path}" fill="none" {stroke}/>')
            out.append(f'<path d="{dots}" fill="none" stroke="{PURPLE}" stroke-width="5"/>')
    return out


def _small(
    result: Validity,
    found: Mapping[tuple[float, float], Cell | Failed],
    measure: Measure,
    place: tuple[float, float],
    width: float,
    last: bool,
) -> list[str]:
    """One figure of contact over speed and clearance, its axes as the panel's; the speeds below the ``last`` one."""
    x, y = place
    out, count = [_text(measure.title, x, y - 6, size=11, weight="600")], len(result.clearances)
    for j, clearance in enumerate(result.clearances):
        top = y + (count - 1 - j) * SMALL_HEIGHT
        out.append(_text(millimetres(clearance), x - 8, top + 16, "end", size=10))
        for i, speed in enumerate(result.speeds):
            cell = found[speed, clearance]
            value = measure.of(cell)
            fill, ink = (FAILED, INK) if value is None else HEAT[sum(value >= least for least in measure.shades)]
            left = x + i * width
            out.append(
                f'<rect x="{left:g}" y="{top:g}" width="{width:g}" height="{SMALL_HEIGHT:g}" fill="{fill}"'
                f' stroke="{GRID}" stroke-width="0.6"/>'
            )
            out.append(_text(measure.told(cell), left + width / 2, top + 16, "middle", size=11, fill=ink))
    if last:
        for i, speed in enumerate(result.speeds):
            out.append(_text(rpm(speed), x + (i + 0.5) * width, y + count * SMALL_HEIGHT + 14, "middle", size=10))
    return out


def _cell(cell: Cell | Failed, x: float, y: float) -> list[str]:
    """A cell: shaded by the share that agrees; that share, the share without contact, and what fails, the cause in
    bold.
    """
    shade, ink = (
        (FAILED, INK)
        if isinstance(cell, Failed)
        else next((fill, on) for least, fill, on in SHADES if cell.agreeing_share >= least)
    )
    out = [
        f'<rect x="{x:g}" y="{y:g}" width="{CELL_WIDTH:g}" height="{CELL_HEIGHT:g}" fill="{shade}" stroke="{GRID}"'
        ' stroke-width="0.6"/>'
    ]
    middle = x + CELL_WIDTH / 2
    if isinstance(cell, Failed):
        return [*out, _text("failed", middle, y + 44, "middle")]
    out.append(_text(f"{percent(cell.agreeing_share)} %", middle, y + 15, "middle", weight="600", fill=ink))
    if lost(cell):
        out.append(_text(f"free {percent(lost(cell))} %", middle, y + 28, "middle", size=10, fill=ink))
    for k, name in enumerate(failing(cell)):
        weight = "800" if name == cell.cause else "400"
        out.append(_text(name, middle, y + 41 + 11 * k, "middle", size=10, weight=weight, fill=ink))
    return out


def _boundary(states: list[list[bool | None]], corner: Callable[[int, int], tuple[float, float]], beside: float) -> str:
    """Path along every edge between two cells that differ, ``beside`` (px) into the cell that is true."""
    out = []
    for i, column in enumerate(states):
        for j, here in enumerate(column):
            x, y = corner(i, j)
            right = states[i + 1][j] if i + 1 < len(states) else None
            above = column[j + 1] if j + 1 < len(column) else None
            if here is not None and right is not None and here != right:
                at = x + CELL_WIDTH + (-beside if here else beside)
                out.append(f"M{at:g} {y:g}v{CELL_HEIGHT:g}")
            if here is not None and above is not None and here != above:
                at = y + (beside if here else -beside)
                out.append(f"M{x:g} {at:g}h{CELL_WIDTH:g}")
    return "".join(out)


def _key(x: float, y: float, predicted: bool) -> list[str]:
    out, start = [], x
    for least, fill, _ in SHADES:
        out.append(
            f'<rect x="{x:g}" y="{y - 10:g}" width="14" height="12" fill="{fill}" stroke="{GRID}" stroke-width="0.6"/>'
        )
        name = "all" if least == 1 else f"{100 * least:.0f} %" if least else "less"
        out.append(_text(name, x + 18, y, size=11))
        x += 26 + 6.4 * len(name)
    out.append(_text("of the angles agree", x, y, size=11))
    x, y = start, y + 20
    for name, _, stroke, _ in BOUNDARIES:
        out.append(f'<path d="M{x:g} {y - 4:g}h22" fill="none" {stroke}/>')
        out.append(_text(name, x + 27, y, size=11))
        x += 38 + 5.6 * len(name)
    x, y = start, y + 20
    for name, _, stroke in PREDICTED if predicted else ():
        out.append(f'<path d="M{x:g} {y - 4:g}h22" fill="none" {stroke}/>')
        out.append(_text(name, x + 27, y, size=11))
        x += 38 + 5.6 * len(name)
    return out


def _text(
    words: str,
    x: float,
    y: float,
    anchor: str = "start",
    size: int = 12,
    weight: str = "400",
    fill: str = INK,
    extra: str = "",
) -> str:
    style = f'text-anchor="{anchor}" font-size="{size}" font-weight="{weight}" fill="{fill}"'
    return f'<text x="{x:.1f}" y="{y:.1f}" {style}{extra}>{text(words)}</text>'


def _wrapped(note: str, count: int) -> list[str]:
    import textwrap

    return textwrap.wrap(note, count, subsequent_indent="   ") or [""]
