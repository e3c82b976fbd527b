"""How accurate a linkage can be, shown: the table for a terminal, a short one for a notebook, and the curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console

from compare.ci import JUnitCase, JUnitSuite, junit_xml
from compare.judge.statistics import NORMAL_95
from compare.presentation import Presentation
from compare.quantities import shown
from compare.report import accuracy_page
from compare.report.accuracy_page import LEAST_SHOWN, output_rows, summary_html
from compare.report.analysis import judged as of_limits
from compare.report.curves import MOST_CURVES, legend, partly
from compare.report.tables import print_rows, say
from compare.report.toleranced import print_outputs, yields
from compare.report.words.accuracy import notes
from compare.report.words.limits import limits
from compare.results.accuracy import Accuracy

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def files(result: Accuracy) -> dict[str, str]:
    """The page, the numbers as a table, and a JUnit file where a yield or limits were asked for."""
    judged_so = judged(result)
    kind = "limits" if result.limits else "yield"
    tests = {"junit.xml": junit_xml(f"{kind} of {result.case}", judged_so, result.file)} if judged_so else {}
    return accuracy_page.files(result) | tests


def judged(result: Accuracy) -> list[JUnitSuite]:
    """Each limit of the error by clearance, and the yield, as a test case, where they were asked for."""
    by, suites = result.tolerances, of_limits(result)
    if by is None or by.min_yield is None:
        return suites
    *_, said = yields(by)
    return [
        *suites,
        JUnitSuite("yield", [JUnitCase((result.case,), "yield", said, "" if by.good else said, kind="yield")]),
    ]


CLEARANCE_ALONE = {False: "95 % of the samples", True: "95 % of the samples, by clearance alone"}


def plot(result: Accuracy, figure: Figure) -> None:
    """Equilibrium, worst case and the band of 95 % of the samples of the outputs over the crank angle, and where the
    linkage has tolerances that of 95 % of the linkages: of those that move, the first six.
    """
    theta, by = np.degrees(result.crank_angle), result.tolerances
    varied = {} if by is None else by.outputs
    moving = [
        name
        for name, each in result.outputs.items()
        if np.nanmax(each.worst_case, initial=0) > LEAST_SHOWN
        or (name in varied and np.nanmax(varied[name].sd, initial=0) > LEAST_SHOWN)
    ]
    outputs = {name: result.outputs[name] for name in (moving or list(result.outputs))[:MOST_CURVES]}
    axes = figure.subplots(len(outputs), 1, sharex=True, squeeze=False)[:, 0]
    figure.set_figheight(1.6 * len(outputs) + 1)
    for axis, (name, output) in zip(axes, outputs.items(), strict=True):
        unit, factor = shown(output.unit)
        spread = output.monte_carlo.free
        if name in varied:
            made = varied[name].monte_carlo
            about, aside = np.nan_to_num(output.equilibrium), NORMAL_95 * varied[name].sd
            low, high = (about - aside, about + aside) if made is None else (made.low, made.high)
            axis.fill_between(theta, factor * low, factor * high, color="C2", alpha=0.25, label="95 % of the linkages")
        if result.clearance:
            axis.fill_between(
                theta, factor * spread.low, factor * spread.high, alpha=0.25, label=CLEARANCE_ALONE[bool(by)]
            )
            axis.plot(theta, factor * output.equilibrium, label="equilibrium")
        for sign in (-1, 1) if result.clearance else ():
            label = "worst case to first order" if sign > 0 else None
            axis.plot(theta, sign * factor * output.worst_case, "k--", linewidth=0.8, label=label)
        axis.set_title(f"{name} ({unit})", fontsize="medium", loc="left")
    legend(axes[0])
    figure.suptitle(result.case)
    axes[-1].set_xlabel("crank angle (deg)")
    partly(figure, MOST_CURVES, len(moving), "outputs")


OUTPUTS = ("output", "unit", "equilibrium", "at", "worst case", "at", "sigma", "compliance", "total", "sensitive to")


def print_table(result: Accuracy, console: Console) -> None:
    """Print each output's largest numbers over the crank angles in millimetres and degrees, then what to beware of;
    ASCII.
    """
    print_rows(console, OUTPUTS, output_rows(result), left=("output", "unit", "sensitive to"))
    if result.tolerances is not None:
        print_outputs(result.tolerances, console)
    say(console, *(f"{limit.verdict}: {said}" for _, limit, said in limits(result)), *notes(result))


PRESENTATION = Presentation(summary_html, print_table, files, plot, judged=judged)
