"""What tolerances do, for a terminal and for pages: how much each number varies, by what, and how many are good."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

import numpy as np
from rich.console import Console

from compare.quantities import plain, shown
from compare.report.summary import Abscissa
from compare.report.tables import print_rows, say
from compare.results.toleranced import AccuracyByTolerance, ByTolerance, SignalsByTolerance, Varied

MOST_NAMED = 2  # sources of a number, the largest first
SHOWN = re.compile(r"drive_.*|reaction_.*_magnitude|(?!reaction_).*_angle")  # signals in the table
LEAST_NAMED = 0.005  # of the variance
OUTPUTS = ("by tolerances", "unit", "sd", "at", "95 % of linkages", "of its variance", "good")
Shares = tuple[tuple[str, float], ...]
SIGNALS = ("by tolerances", "unit", "sd", "at", "of its variance")


def print_outputs(by: AccuracyByTolerance, console: Console) -> None:
    """Print each output's variation where it is largest, and the share of linkages within limits; ASCII."""
    rows = [[name, unit, sd, at, ends, _first(parts), good] for name, unit, sd, at, ends, parts, good in outputs(by)]
    print_rows(console, OUTPUTS, rows, left=(OUTPUTS[0], "unit", "of its variance"))
    say(console, "by tolerances: against the ideal linkage as drawn, pins along their reactions; sd to first order")
    say(console, *yields(by))


def print_signals(by: SignalsByTolerance, x: Abscissa, console: Console) -> None:
    """Print how much drives, reactions and angles vary, where they vary most; ASCII."""
    rows = [
        [name, unit.replace("·", "."), sd, at, _first(parts), *([ends] if by.samples else [])]
        for name, unit, sd, at, ends, parts in signals(by, x)
    ]
    if rows:
        heads = SIGNALS + ("95 % of linkages",) * bool(by.samples)
        print_rows(console, heads, rows, left=(SIGNALS[0], "unit", "of its variance"))
    say(console, *yields(by))


def on_page(by: AccuracyByTolerance | SignalsByTolerance, x: Abscissa) -> dict[str, object]:
    """What a page tells: what varies and how, and what comes of it."""
    if isinstance(by, AccuracyByTolerance):
        rows: list[tuple[str, ...]] = [(*row[:5], _all(row[5]), row[6]) for row in outputs(by)]
    else:
        rows = [(*row[:5], _all(row[5])) for row in signals(by, x)]
    return {
        "sources": [_varied(name, source) for name, source in by.sources.items()],
        "heads": OUTPUTS if isinstance(by, AccuracyByTolerance) else OUTPUTS[:-1],
        "rows": rows,
        "notes": list(yields(by)),
    }


def outputs(by: AccuracyByTolerance) -> Iterator[tuple[str, str, str, str, str, Shares, str]]:
    """Of each output that varies: name, unit, standard deviation where it is largest, crank angle of that, between
    which errors 95 % of the linkages are there, shares of the variance, and the share of linkages within the limit.
    """
    for name, output in by.outputs.items():
        if not output.by_source and output.limit is None:
            continue
        unit, factor = shown(output.unit)
        k = _worst(output.sd)
        good = "-"
        if output.within is not None and output.limit is not None:
            good = f"{100 * output.within:.4g} % in {plain(factor * output.limit)}"
        at = f"{math.degrees(output.at):.4g} deg"
        sd = plain(factor * float(output.sd[k]))
        yield name, unit, sd, at, _ends(output, factor, k), shares(output.by_source, k), good


def signals(by: SignalsByTolerance, x: Abscissa) -> Iterator[tuple[str, str, str, str, str, Shares]]:
    """The same of drives, reactions and angles, without limits."""
    for name, signal in by.signals.items():
        if SHOWN.fullmatch(name):
            unit, factor = shown(signal.unit)
            k = _worst(signal.sd)
            sd = plain(factor * float(signal.sd[k]))
            yield name, unit, sd, x.at(k), _ends(signal, factor, k), shares(signal.by_source, k)


def yields(by: AccuracyByTolerance | SignalsByTolerance) -> Iterator[str]:
    """How many linkages there would be, and how many good ones, in a sentence each."""
    if isinstance(by, SignalsByTolerance):
        if by.assembled is not None and by.assembled < 1:
            yield f"{100 * (1 - by.assembled):.3g} % of the linkages cannot be analysed"
        return
    if by.assembled < 1:
        yield f"{100 * (1 - by.assembled):.3g} % of the linkages do not assemble at every crank angle: not good"
    if by.within is not None:
        more = ""
        if by.min_yield is not None:
            more = f", {'no less' if by.good else 'LESS'} than the {100 * by.min_yield:.4g} % asked for"
        yield f"{100 * by.within:.4g} % of the linkages are within the limits at every crank angle{more}"


def shares(by_source: Mapping[str, np.ndarray], k: int) -> Shares:
    """The sources that do most at an instant, the largest first, with their shares of the variance."""
    variances = {source: float(np.nan_to_num(part[k]) ** 2) for source, part in by_source.items()}
    every = sum(variances.values())
    ordered = sorted(variances.items(), key=lambda each: -each[1])
    return tuple((_short(name), v / every) for name, v in ordered if v and v >= LEAST_NAMED * every)


def _first(parts: Shares) -> str:
    """The first of the shares, for a narrow table."""
    return _all(parts[:MOST_NAMED])


def _all(parts: Shares) -> str:
    return ", ".join(f"{name} {100 * share:.3g} %" for name, share in parts) or "-"


def _varied(name: str, source: Varied) -> tuple[str, ...]:
    """A number that varies: what the file says, its unit, standard deviation, ends and what it varies with."""
    sd, ends = f"{source.sd:.4g}", f"{source.low:.6g} to {source.high:.6g}"
    return name, f"{source.nominal:.6g}", source.unit, source.distribution, sd, ends, source.group or "-"


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
