"""What tolerances do, for a terminal: how much each number varies, by what, and how many linkages are good."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np
from rich.console import Console

from compare.quantities import plain, shown
from compare.report.tables import say, terminal_table
from compare.results.toleranced import AccuracyByTolerance, ByTolerance, SignalsByTolerance

MOST_NAMED = 2  # sources of a number, the largest first
SHOWN = re.compile(r"drive_.*|reaction_.*_magnitude|(?!reaction_).*_angle")  # signals in the table
LEAST_NAMED = 0.005  # of the variance
OUTPUTS = ("by tolerances", "unit", "sd", "at", "95 % of linkages", "of its variance", "good")
SIGNALS = ("by tolerances", "unit", "sd", "at", "of its variance")


def print_outputs(by: AccuracyByTolerance, console: Console) -> None:
    """Print each output's variation where it is largest, and the share of linkages within limits; ASCII."""
    rows = []
    for name, output in by.outputs.items():
        if not output.by_source and output.limit is None:
            continue
        unit, factor = shown(output.unit)
        k = _worst(output.sd)
        ends = _ends(output, factor, k)
        good = "-"
        if output.within is not None and output.limit is not None:
            good = f"{100 * output.within:.4g} % in {plain(factor * output.limit)}"
        sd = plain(factor * float(output.sd[k]))
        at = f"{math.degrees(output.at):.4g} deg"
        rows.append((name, unit, sd, at, ends, shares(output.by_source, k), good))
    console.print(terminal_table(OUTPUTS, rows, left=(OUTPUTS[0], "unit", "of its variance")))
    lines = ["by tolerances: against the ideal linkage as drawn, pins along their reactions; sd to first order"]
    if by.assembled < 1:
        lines.append(f"{100 * (1 - by.assembled):.3g} % of the linkages do not assemble at every crank angle: not good")
    if by.within is not None:
        lines.append(f"{100 * by.within:.4g} % of the linkages are within the limits at every crank angle")
    say(console, *lines)


def print_signals(by: SignalsByTolerance, theta: np.ndarray, angular: bool, console: Console) -> None:
    """Print how much drives, reactions and angles vary, where they vary most; ASCII."""
    rows = []
    for name, signal in by.signals.items():
        if not SHOWN.fullmatch(name):
            continue
        unit, factor = shown(signal.unit)
        k = _worst(signal.sd)
        at = f"{math.degrees(theta[k]):.4g} deg" if angular else f"{theta[k]:.4g} s"
        sd, drawn = plain(factor * float(signal.sd[k])), (_ends(signal, factor, k),) * bool(by.samples)
        rows.append((name, unit.replace("·", "."), sd, at, shares(signal.by_source, k), *drawn))
    if rows:
        heads = SIGNALS + ("95 % of linkages",) * bool(by.samples)
        console.print(terminal_table(heads, rows, left=(SIGNALS[0], "unit", "of its variance")))
    if by.assembled is not None and by.assembled < 1:
        say(console, f"{100 * (1 - by.assembled):.3g} % of the linkages cannot be analysed")


def shares(by_source: Mapping[str, np.ndarray], k: int) -> str:
    """The sources that do most at an instant, with their shares of the variance."""
    variances = {source: float(np.nan_to_num(part[k]) ** 2) for source, part in by_source.items()}
    every = sum(variances.values())
    if not every:
        return "-"
    ordered = sorted(variances.items(), key=lambda each: -each[1])
    return ", ".join(
        f"{_short(name)} {100 * v / every:.3g} %" for name, v in ordered[:MOST_NAMED] if v >= LEAST_NAMED * every
    )


def _short(source: str) -> str:
    """A source without the word for what kind of part it is of."""
    return source.removeprefix("body.").removeprefix("joint.").removeprefix("ground.points.")


def _ends(by: ByTolerance, factor: float, k: int) -> str:
    """Between which errors 95 % of the samples lie at an instant."""
    if by.monte_carlo is None:
        return "-"
    return " to ".join(plain(factor * float(x[k]), 3, True) for x in (by.monte_carlo.low, by.monte_carlo.high))


def _worst(sd: np.ndarray) -> int:
    return int(np.argmax(np.nan_to_num(sd)))
