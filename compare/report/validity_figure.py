"""A validity map as an SVG file: one panel for an engine and restitution, a cell for each speed and clearance, the
boundaries drawn between cells; with it what contact does, in a small map for each figure.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import product

from compare.report.svg import INK, PAPER, Marked, axis_labels, box, label, picture
from compare.report.words.validity import (
    CellMeasure,
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
SHADES = (
    (1.0, "#0b6e4f", PAPER),
    (0.75, "#4f9d7e", INK),
    (0.5, "#93c6ae", INK),
    (0.25, "#cbe3d7", INK),
    (0.0, "#f4f1ea", INK),
)
FAILED = "#d0d4da"
SMALL_WIDTH, SMALL_HEIGHT, SMALL_BETWEEN, BESIDE = 52.0, 24.0, 30.0, 96.0  # of the maps of what contact does
WIDEST_BESIDE = 900.0  # px, up to which these stand beside their panel; else below it, in its columns
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
    beside = aside + columns * SMALL_WIDTH + RIGHT <= WIDEST_BESIDE
    width = max(NARROWEST, LEFT + RIGHT + columns * CELL_WIDTH, aside + columns * SMALL_WIDTH + RIGHT if beside else 0)
    wrapped = [line for note in notes for line in _wrapped(note, int((width - 28) / 5.6))]
    main, maps = rows * CELL_HEIGHT + BETWEEN, len(shown) * small + (40 if shown else 0)
    panel = max(main, maps) if beside else main + maps
    panels = list(result.panels())
    top = TOP + (20 if result.boundary else 0)
    end = top + panel * len(panels) + 6
    height = end + 17 * len(wrapped) + 6
    title = f"Where the analytic model holds: {result.case}"
    body = [label(title, 14, 22, size=15, weight="600"), *_key(14.0, 42.0, bool(result.boundary))]
    for k, one in enumerate(panels):
        start = top + k * panel
        body += _panel(result, *one, start)
        for j, measure in enumerate(shown):
            place = (aside, start + 22 + j * small) if beside else (LEFT, start + main + 12 + j * small)
            size = SMALL_WIDTH if beside else CELL_WIDTH
            body += _small(result, result.of(*one), measure, place, size, last=j == len(shown) - 1)
    body += [label(line, 14, end + 17 * k, size=11) for k, line in enumerate(wrapped)]
    return picture(width, height, " ".join([title + ".", *(f"{line}." for line in result.words)]), body)


def _panel(result: Validity, simulator: str, restitution: float | None, top: float) -> list[str]:
    """One engine's cells at one restitution, axes and boundaries; clearance grows upwards."""
    cells, speeds, clearances = result.of(simulator, restitution), result.speeds, result.clearances
    start, bottom = top + 22, top + 22 + len(clearances) * CELL_HEIGHT

    def corner(column: int, row: int) -> tuple[float, float]:
        return LEFT + column * CELL_WIDTH, bottom - (row + 1) * CELL_HEIGHT

    shades, words = [], []
    for i, j in product(range(len(speeds)), range(len(clearances))):
        shade, *said = _cell(cells[speeds[i], clearances[j]], *corner(i, j))
        shades.append(shade)
        words += said
    out = [label(panel_title(result, simulator, restitution), LEFT, top + 14, weight="600"), *shades]
    out += [*_curves(edges(result, restitution), result, corner), *words]
    across = [(rpm(speed), LEFT + (i + 0.5) * CELL_WIDTH) for i, speed in enumerate(speeds)]
    up = [(millimetres(gap), corner(0, j)[1] + CELL_HEIGHT / 2) for j, gap in enumerate(clearances)]
    right = LEFT + len(speeds) * CELL_WIDTH
    out += axis_labels(
        Marked("speed (rpm)", across, 16, 34), Marked("clearance (mm)", up, 8, 56), LEFT, right, start, bottom
    )
    grid = [[cells[speed, clearance] for clearance in clearances] for speed in speeds]
    for _, state, stroke, beside in BOUNDARIES:
        path = _boundary([[state(cell) for cell in column] for column in grid], corner, beside)
        if path:
            halo = f'<path d="{path}" fill="none" stroke="{PAPER}" stroke-width="4.5"/>' if beside else ""
            out.append(f'{halo}<path d="{path}" fill="none" {stroke}/>')
    return out


def _curves(
    boundary: Sequence[Boundary], result: Validity, corner: Callable[[int, int], tuple[float, float]]
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
        points = [(corner(places[one.speed], 0)[0] + CELL_WIDTH / 2, height(getattr(one, kind))) for one in boundary]
        if points:
            path = "M" + "L".join(f"{x:g} {y:.1f}" for x, y in points)
            dots = "".join(f"M{x - 3:g} {y:.1f}h6" for x, y in points)
            out.append(f'<path d="{path}" fill="none" {stroke}/>')
            out.append(f'<path d="{dots}" fill="none" stroke="{PURPLE}" stroke-width="5"/>')
    return out


def _small(
    result: Validity,
    cells: Mapping[tuple[float, float], Cell | Failed],
    measure: CellMeasure,
    place: tuple[float, float],
    width: float,
    last: bool,
) -> list[str]:
    """One figure of contact over speed and clearance, its axes as the panel's; the speeds below the ``last`` one."""
    x, y = place
    out, count = [label(measure.title, x, y - 6, size=11, weight="600")], len(result.clearances)
    for j, clearance in enumerate(result.clearances):
        top = y + (count - 1 - j) * SMALL_HEIGHT
        for i, speed in enumerate(result.speeds):
            cell = cells[speed, clearance]
            value = measure.of(cell)
            fill, ink = (FAILED, INK) if value is None else HEAT[sum(value >= least for least in measure.shades)]
            left = x + i * width
            out.append(box(left, top, width, SMALL_HEIGHT, fill))
            out.append(label(measure.words(cell), left + width / 2, top + 16, "middle", size=11, fill=ink))
    speeds = enumerate(result.speeds if last else ())
    across = Marked("", [(rpm(speed), x + (i + 0.5) * width) for i, speed in speeds], 14, size=10)
    places = (y + (count - j - 0.5) * SMALL_HEIGHT for j in range(count))
    up = Marked("", list(zip(map(millimetres, result.clearances), places, strict=True)), 8, size=10)
    bottom = y + count * SMALL_HEIGHT
    return out + axis_labels(across, up, x, x + len(result.speeds) * width, y, bottom)


def _cell(cell: Cell | Failed, x: float, y: float) -> list[str]:
    """A cell: shaded by the share that agrees; that share, the share without contact, and what fails, the cause in
    bold.
    """
    shade, ink = (
        (FAILED, INK)
        if isinstance(cell, Failed)
        else next((fill, on) for least, fill, on in SHADES if cell.agreeing_share >= least)
    )
    out = [box(x, y, CELL_WIDTH, CELL_HEIGHT, shade)]
    middle = x + CELL_WIDTH / 2
    if isinstance(cell, Failed):
        return [*out, label("failed", middle, y + 44, "middle")]
    out.append(label(f"{percent(cell.agreeing_share)} %", middle, y + 15, "middle", weight="600", fill=ink))
    if lost(cell):
        out.append(label(f"free {percent(lost(cell))} %", middle, y + 28, "middle", size=10, fill=ink))
    for k, name in enumerate(failing(cell)):
        weight = "800" if name == cell.cause else "400"
        out.append(label(name, middle, y + 41 + 11 * k, "middle", size=10, weight=weight, fill=ink))
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
        out.append(box(x, y - 10, 14, 12, fill))
        name = "all" if least == 1 else f"{100 * least:.0f} %" if least else "less"
        out.append(label(name, x + 18, y, size=11))
        x += 26 + 6.4 * len(name)
    out.append(label("of the angles agree", x, y, size=11))
    boundaries = [(name, stroke) for name, _, stroke, _ in BOUNDARIES]
    for line in (boundaries, [(name, stroke) for name, _, stroke in PREDICTED] if predicted else []):
        x, y = start, y + 20
        for name, stroke in line:
            out.append(f'<path d="M{x:g} {y - 4:g}h22" fill="none" {stroke}/>')
            out.append(label(name, x + 27, y, size=11))
            x += 38 + 5.6 * len(name)
    return out


def _wrapped(note: str, count: int) -> list[str]:
    import textwrap

    return textwrap.wrap(note, count, subsequent_indent="   ") or [""]
