"""The page of a linkage's accuracy: it moves, with who contributes what to each output's error, and its curves."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from compare.quantities import DASH, plain, shown
from compare.report.analysis_figures import Band, error_figures, transmission_figure
from compare.report.figure import Figure, scaled
from compare.report.linkage import both_poses, exaggeration, positions
from compare.report.linkage_page import ERRORS, linkage_page, numbers_of
from compare.report.mover import Column, Mover, Moving, Read, Side, opens
from compare.report.moving_picture import moving_picture
from compare.report.pages import glimpse
from compare.report.peaks import LEAST_PART, NOTHING, over
from compare.report.svg import draw
from compare.report.words import limits
from compare.report.words.accuracy import cautions
from compare.results.accuracy import Accuracy, Output

LEAST_SHOWN = 1e-12  # m or rad, below which a table shows nothing
SECTIONS = (ERRORS, "accuracy/budget.html.j2")
COLUMNS = (
    Column("Equilibrium", "equilibrium", 4),
    Column("First order", "first order", 4),
    Column("Worst ±, first order", "", 4),
)


def files(result: Accuracy) -> dict[str, str]:
    """The page, which has its figures as files to download, and the numbers as a table."""
    drawn, posed = figures(result), Posed.of(result)
    drawings = {figure.name: draw(figure) for figure in drawn}
    moving = moving_picture(posed) if posed else ""
    moved = _mover(result, posed, Markup(moving)) if posed and moving else None
    text = linkage_page(result, "accuracy", _own(result), SECTIONS, drawn, drawings, moved)
    return {"accuracy.html": text, "accuracy.csv": result.to_csv()}


def summary_html(result: Accuracy) -> str:
    """The numbers of the page, for a notebook."""
    return glimpse(*numbers_of(result, _own(result), SECTIONS, {"mover": None, "warnings": list(result.warnings)}))


def _own(result: Accuracy) -> dict[str, object]:
    return {
        "facts": _facts(result),
        "notes": list(cautions(result)),
        "budget": list(_budget(result)),
        "heads": ("sigma", "compliance", "total", "sensitive to"),
        "dash": DASH,
    }


def figures(result: Accuracy) -> list[Figure]:
    """The error of each output, by joint, with the band of the samples and with compliance; the transmission angle."""
    more, bands = dict[str, dict[str, np.ndarray]](), dict[str, Band]()
    for name, output in result.outputs.items():
        if _largest(output.compliance) is not None:
            more[name] = {"compliance": output.compliance}
        spread = output.monte_carlo.free
        bands[name] = ("95 % of the samples", spread.low, spread.high)
    return [*error_figures(result, more, bands), *transmission_figure(result)]


def _facts(result: Accuracy) -> dict[str, str]:
    """What the page is about, in a line."""
    x = over(result)
    sizes = ", ".join(f"{joint} {plain(1e3 * size)} mm" for joint, size in result.clearance.items())
    closed = "each closed again" if result.nonlinear else "to first order"
    return {
        "Motion": "in motion, with inertia forces" if result.motion == "driven" else "at rest in each position",
        x.label.capitalize(): f"{plain(x.values[0], 4)} to {x.at(-1)}, {count(len(x.values), 'sample')}",
        "Radial clearance": sizes or "none",
        "Monte Carlo": f"{count(result.samples, 'sample')} {closed}",
    } | limits.facts(result)


@dataclass(frozen=True)
class Posed:
    """The linkage at the crank angles of an accuracy: where its bodies are by signal (N,), displaced in equilibrium
    where each body's place and angle are among the outputs.
    """

    case: str
    mechanism: Mechanism
    crank_angle: np.ndarray
    clearance: Mapping[str, float]
    signals: Mapping[str, np.ndarray]
    time: None = None

    @classmethod
    def of(cls, result: Accuracy) -> Posed | None:
        """None where the linkage cannot be assembled without clearance."""
        m, theta = result.mechanism, result.crank_angle
        ideal = positions(m, theta)
        if ideal is None:
            return None
        clearance = dict(result.clearance) if set(ideal) <= set(result.outputs) else {}
        moved = {name: values + result.outputs[name].equilibrium for name, values in ideal.items() if clearance}
        return cls(result.case, m, theta, clearance, moved or ideal)


def _mover(result: Accuracy, posed: Posed, still: Markup) -> Mover:
    x, (ideal, displaced) = over(result), both_poses(posed)
    run = Moving(
        over=x,
        opens=opens(x),
        factor=exaggeration(posed.mechanism, posed),
        clearance=posed.clearance,
        flags=dict(result.flags),
        ideal=ideal,
        sides=[Side("analytic", "with clearance, in equilibrium" if posed.clearance else "", "analytic", displaced)],
        columns=COLUMNS,
        readout=[
            _read(name, output) for name, output in result.outputs.items() if _largest(output.worst_case) is not None
        ],
        gaps={},
    )
    boxes = {"paths": "paths of the joints"} | ({"ideal": "linkage without clearance"} if posed.clearance else {})
    return Mover(posed.mechanism, {result.case: run}, boxes, still)


def _read(name: str, output: Output) -> Read:
    unit, factor = shown(output.unit)
    return Read(name, unit, [scaled(factor * v) for v in (output.equilibrium, output.nominal, output.worst_case)])


def _budget(result: Accuracy) -> Iterator[tuple[str, str, list[tuple[str, float, str]], tuple[str, ...]]]:
    """Of each output: name, unit, each joint's part of the worst case and its percentage where that is the largest, and
    the other numbers of the table.
    """
    for row in output_rows(result):
        output = result.outputs[row[0]]
        at, (_, factor) = _largest(output.worst_case), shown(output.unit)
        parts = {} if at is None else {j: c * output.sensitivity[j][at] for j, c in result.clearance.items()}
        whole = sum(parts.values())
        shares = [
            (joint, factor * float(part), f"{100 * part / whole:.0f}")
            for joint, part in sorted(parts.items(), key=lambda item: -item[1])
            if part > LEAST_PART * whole
        ]
        if shares or any(cell != "-" for cell in row[6:]):
            yield row[0], row[1], shares, row[6:]


def output_rows(result: Accuracy) -> list[tuple[str, ...]]:
    """A row of the table for each output that has any: its largest numbers over the crank angles, in millimetres and
    degrees.
    """
    rows = [_row(name, output, result.crank_angle, result.clearance) for name, output in result.outputs.items()]
    return [row for row in rows if set(row[2:]) != {"-"}]


def _row(name: str, output: Output, theta: np.ndarray, loose: Collection[str]) -> tuple[str, ...]:
    unit, factor = shown(output.unit)

    def cell(values: np.ndarray, sign: bool = True) -> str:
        k = _largest(values)
        return "-" if k is None else plain(float(values[k]) * factor, 3, sign)

    slopes = {joint: float(values.max()) for joint, values in output.sensitivity.items()}
    slope, joint = max((slopes[joint], joint) for joint in loose or slopes)
    return (
        name,
        unit,
        cell(output.equilibrium),
        _at(output.equilibrium, theta),
        cell(output.worst_case, False),
        _at(output.worst_case, theta),
        cell(output.monte_carlo.free.sigma, False),
        cell(output.compliance),
        cell(output.total),
        f"{joint} {plain(slope * factor * 1e-3)} {unit}/mm" if slope > NOTHING * max(slopes.values()) else "-",
    )


def _largest(values: np.ndarray) -> int | None:
    """Index of the number largest in size; None where there is none but rounding."""
    size = np.nan_to_num(np.abs(values))
    return int(size.argmax()) if size.max() > LEAST_SHOWN else None


def _at(values: np.ndarray, theta: np.ndarray) -> str:
    k = _largest(values)
    return "-" if k is None else f"{math.degrees(theta[k]):.4g} deg"
