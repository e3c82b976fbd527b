"""A validity map as an SVG file: one panel an engine, a cell for each speed and clearance, the boundaries drawn between
cells.
"""

from __future__ import annotations

from collections.abc import Callable
from xml.sax.saxutils import quoteattr

from compare.report.svg import NOT_XML, text
from compare.report.validity_text import about, failing, legend, lost, millimetres, percent, rpm
from compare.results.validity import Cell, Failed, Validity

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
State = Callable[[Cell | Failed], bool | None]  # None where a cell cannot say


def agrees(cell: Cell | Failed) -> bool | None:
    """Whether the equilibrium agrees with the simulation."""
    return None if isinstance(cell, Failed) else cell.agrees


def touches(cell: Cell | Failed) -> bool | None:
    """Whether the pins never leave their bearings."""
    return None if isinstance(cell, Failed) else not any(cell.free_share.values())


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
    ]
    width = max(NARROWEST, LEFT + RIGHT + columns * CELL_WIDTH)
    wrapped = [line for note in notes for line in _wrapped(note, int((width - 28) / 5.6))]
    panel = rows * CELL_HEIGHT + BETWEEN
    height = TOP + panel * len(result.simulators) + 17 * len(wrapped) + 12
    title = f"Where the analytic model holds: {result.case}"
    body = [_text(title, 14, 22, size=15, weight="600"), *_key(14.0, 42.0)]
    for k, simulator in enumerate(result.simulators):
        body += _panel(result, simulator, TOP + k * panel)
    end = TOP + panel * len(result.simulators) + 6
    body += [_text(line, 14, end + 17 * k, size=11) for k, line in enumerate(wrapped)]
    label = quoteattr(NOT_XML.sub("", " ".join([title + ".", *(f"{line}." for line in result.words)])))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}"'
        f' height="{height:g}" role="img" aria-label={label} font-family="system-ui, sans-serif" font-size="12"><rect'
        f' width="100%" height="100%" fill="{PAPER}"/>\n' + "\n".join(body) + "\n</svg>\n"
    )


def _panel(result: Validity, simulator: str, top: float) -> list[str]:
    """One engine's cells, axes and boundaries; clearance grows upwards."""
    found, speeds, clearances = result.of(simulator), result.speeds, result.clearances
    start, bottom = top + 22, top + 22 + len(clearances) * CELL_HEIGHT

    def corner(column: int, row: int) -> tuple[float, float]:
        return LEFT + column * CELL_WIDTH, bottom - (row + 1) * CELL_HEIGHT

    out = [_text(f"{simulator} {result.versions.get(simulator, '')}".strip(), LEFT, top + 14, weight="600")]
    for i, speed in enumerate(speeds):
        out.append(_text(rpm(speed), LEFT + (i + 0.5) * CELL_WIDTH, bottom + 16, "middle"))
        for j, clearance in enumerate(clearances):
            out += _cell(found[speed, clearance], *corner(i, j))
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


def _key(x: float, y: float) -> list[str]:
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
