"""A linkage by itself, shown: its page, the peaks for a terminal or a notebook, the curves."""

from __future__ import annotations

from rich.console import Console

from compare.ci import JUnitCase, JUnitSuite, junit_xml
from compare.presentation import Presentation
from compare.quantities import plain
from compare.report import analysis_page
from compare.report.peaks import GOOD, effective, error_peaks, mean_torque, over, poor, power_ends, strokes, unaveraged
from compare.report.sides import plot, plot_signals, print_peaks, said, summary_html
from compare.report.tables import print_rows, say
from compare.report.toleranced import print_signals
from compare.report.words.limits import Limited, limits
from compare.report.words.validity import RPM
from compare.results.analysis import Analysis

ERROR_HEADS = ("error by clearance", "unit", "largest", "at", "worst case", "at", "by joint, first order")


def files(result: Analysis) -> dict[str, str]:
    """The page with its figures, every signal as a table, and a JUnit file where limits were asked for."""
    tests = {"junit.xml": junit_xml(f"limits of {result.case}", judged(result), result.file)} if result.limits else {}
    return analysis_page.files(result) | tests


def judged(result: Limited) -> list[JUnitSuite]:
    """Each limit that was asked for as a test case."""
    cases = [
        JUnitCase(
            (result.mechanism.name, "limit"),
            name,
            said=sentence,
            failure=sentence if limit.verdict != "holds" else "",
            kind=limit.verdict,
            times=limit.times,
        )
        for name, limit, sentence in limits(result)
    ]
    return [JUnitSuite("limits", cases)] * bool(cases)


def print_table(result: Analysis, console: Console) -> None:
    """Print the peaks with their places, the error of each output by clearance, and what to beware of; ASCII."""
    print_peaks(result, console)
    rows = [
        (e.name, e.unit, plain(e.equilibrium, 3, True), e.at, plain(e.worst), e.worst_at, e.by_joint)
        for e in error_peaks(result)
    ]
    if rows:
        print_rows(console, ERROR_HEADS, rows, left=("error by clearance", "unit", "by joint, first order"))
    if result.tolerances is not None:
        print_signals(result.tolerances, over(result), console)
    told = []
    if result.mechanism.speed is not None:
        speed, mean = result.mechanism.speed, mean_torque(result)
        watts = [end.value for ends in power_ends(result).values() for end in ends]
        power = f", at most {plain(max(watts), 4)} W" if watts else ""
        power += f", in the mean {plain(mean * speed, 4)} W" if power and mean is not None else ""
        told.append(f"{plain(speed / RPM, 5)} rpm ({plain(speed, 4)} rad/s){power}")
    told += [f"RMS of {q.label} {plain(rms, 4)} {q.unit.replace('·', '.')}" for q, rms in effective(result)]
    told += [f"no mean and no RMS of {q.label}: {why}" for q, why in unaveraged(result)]
    if told:
        say(console, f"drive: {', '.join(told)}")
    for joint, stroke in strokes(result):
        say(console, f"stroke of {joint}: {stroke}")
    if poor(result):
        say(console, f"transmission angle below {GOOD:g} deg at {poor(result)}")
    say(console, *said(result), repr(result))


PRESENTATION = Presentation(summary_html, print_table, files, plot, plot_signals, judged=judged)
