"""A cross-check as test cases: a suite for each run, a case for each signal; one for statistics of contact."""

from __future__ import annotations

from compare.ci import JUnitCase, JUnitSuite
from compare.quantities import plain
from compare.report.summary import ShownDiscrepancy, ShownRun, Summary
from compare.report.words.contact import ASCII_UNITS, ContactShown, EnginePair, ShownComparison
from compare.report.words.crosscheck import row_sentence, to_look
from compare.results.crosscheck import Run


def suites(summary: Summary) -> list[JUnitSuite]:
    """Every comparison: a disagreement is a failure with its numbers, and so is a run that is not judged; a known
    difference passes and says so.
    """
    case = summary.result.case
    every = [
        JUnitSuite(
            f"{shown.run.title}, {shown.run.motion}", _cases(case, shown), _contact(summary.contact, shown.run.title)
        )
        for shown in summary.runs
    ]
    if summary.contact.pairs:
        compared = [_compared(case, pair, row) for pair in summary.contact.pairs for row in pair.rows]
        every.append(JUnitSuite("contact statistics", compared))
    failed = [
        JUnitCase((case, "simulation"), f"failure {i}", error=why, kind="simulation")
        for i, why in enumerate(summary.failures, 1)
    ]
    stopped = [JUnitCase((case, "simulation"), f"stopped {i}", skipped=why) for i, why in enumerate(summary.stopped, 1)]
    every += [JUnitSuite("simulations that failed", failed)] * bool(failed)
    return every + [JUnitSuite("simulations that were stopped", stopped)] * bool(stopped)


def _cases(case: str, shown: ShownRun) -> list[JUnitCase]:
    """A case for each signal of a run; one where nothing could be compared."""
    run = shown.run
    place = (case, run.simulator.name, run.joint_model, run.motion)
    if not shown.rows:
        return [JUnitCase(place, "anything to compare", failure=run.reason, kind="not judged")]
    return [_case(place, run, row) for row in shown.rows]


def _case(place: tuple[str, ...], run: Run, row: ShownDiscrepancy) -> JUnitCase:
    look, times = to_look(run, row), row.share or 0.0
    if row.verdict in ("disagrees", "unjudged"):
        kind = "disagreement" if row.verdict == "disagrees" else "not judged"
        return JUnitCase(place, row.quantity.signal, failure=row_sentence(row), kind=kind, look=look, times=times)
    if row.verdict == "known":
        return JUnitCase(place, row.quantity.signal, said=f"known difference: {row_sentence(row)}")
    return JUnitCase(place, row.quantity.signal, said=row_sentence(row), times=times)


def _compared(case: str, pair: EnginePair, row: ShownComparison) -> JUnitCase:
    """A statistic of contact of two engines; what is not judged is skipped, and says why."""
    place = (case, "-".join(pair.between), pair.joint_model, row.joint)
    said = row.sentence().translate(ASCII_UNITS)
    if row.verdict == "disagrees":
        return JUnitCase(place, row.measure.key, failure=said, kind="disagreement")
    if row.verdict == "unjudged":
        return JUnitCase(place, row.measure.key, skipped=f"{said}; not judged: {row.reason}")
    return JUnitCase(place, row.measure.key, said=said)


def _contact(contact: ContactShown, run_title: str) -> str:
    """What contact did in a run, in words and numbers; empty where it was not watched."""
    lines = [run.sentence for run in contact.runs if run.run == run_title]
    for table in (table for table in contact.tables if run_title in table.runs):
        k = table.runs.index(run_title)
        rows = ((measure.title.translate(ASCII_UNITS), values[k].said(plain)) for measure, values in table.rows)
        lines += [f"{table.joint}: {title} {value}" for title, value in rows]
    return "\n".join(lines)
