"""The verdicts as a JUnit file: a suite for each run, a case for each signal; one for statistics of contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

from compare.quantities import plain
from compare.report.summary import ShownDiscrepancy, ShownRun, Summary
from compare.report.svg import NOT_XML
from compare.report.words.contact import ASCII_UNITS, ContactShown, EnginePair, ShownComparison
from compare.report.words.crosscheck import row_sentence


@dataclass(frozen=True)
class JUnitCase:
    """One case of a JUnit file: what is ``said`` of it, or the ``failure`` or ``error`` (a sentence each) that it has,
    of some ``kind``.
    """

    place: str
    name: str
    said: str = ""
    failure: str = ""
    error: str = ""
    kind: str = ""


@dataclass(frozen=True)
class JUnitSuite:
    """A suite of a JUnit file, and what is ``said`` of it as a whole."""

    title: str
    cases: Sequence[JUnitCase]
    said: str = ""


def junit(summary: Summary) -> str:
    """JUnit XML: a disagreement is a failure with its numbers, and so is a run that is not judged; a known difference
    passes and says so.
    """
    case = summary.result.case
    suites = [
        JUnitSuite(
            f"{shown.run.title}, {shown.run.motion}", _cases(case, shown), _contact(summary.contact, shown.run.title)
        )
        for shown in summary.runs
    ]
    if summary.contact.pairs:
        compared = [_compared(case, pair, row) for pair in summary.contact.pairs for row in pair.rows]
        suites.append(JUnitSuite("contact statistics", compared))
    failed = [
        JUnitCase(f"{case}.simulation", f"failure {i}", error=why, kind="simulation")
        for i, why in enumerate(summary.failures, 1)
    ]
    suites += [JUnitSuite("simulations that failed", failed)] * bool(failed)
    return junit_xml(f"cross-check of {case}", suites)


def junit_xml(name: str, suites: Sequence[JUnitSuite]) -> str:
    """JUnit XML of suites."""
    root = ElementTree.Element("testsuites", _clean({"name": name} | _counts([c for s in suites for c in s.cases])))
    for suite in suites:
        element = ElementTree.SubElement(root, "testsuite", _clean({"name": suite.title} | _counts(suite.cases)))
        for case in suite.cases:
            _add(element, case)
        if suite.said:
            ElementTree.SubElement(element, "system-out").text = NOT_XML.sub("", suite.said)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _add(suite: ElementTree.Element, case: JUnitCase) -> None:
    element = ElementTree.SubElement(suite, "testcase", _clean({"classname": case.place, "name": case.name}))
    for tag, words in (("failure", case.failure), ("error", case.error)):
        if words:
            attributes = _clean({"message": words, "type": case.kind})
            ElementTree.SubElement(element, tag, attributes).text = attributes["message"]
    if case.said and not (case.failure or case.error):
        ElementTree.SubElement(element, "system-out").text = NOT_XML.sub("", case.said)


def _counts(cases: Sequence[JUnitCase]) -> dict[str, str]:
    counts = (len(cases), sum(bool(case.failure) for case in cases), sum(bool(case.error) for case in cases))
    return dict(zip(("tests", "failures", "errors"), map(str, counts), strict=True))


def _cases(case: str, shown: ShownRun) -> list[JUnitCase]:
    """A case for each signal of a run; one where nothing could be compared."""
    run = shown.run
    place = f"{case}.{run.simulator.name}.{run.joint_model}.{run.motion}"
    if not shown.rows:
        return [JUnitCase(place, "anything to compare", failure=run.reason, kind="not judged")]
    return [_case(place, row) for row in shown.rows]


def _case(place: str, row: ShownDiscrepancy) -> JUnitCase:
    if row.verdict in ("disagrees", "unjudged"):
        kind = "disagreement" if row.verdict == "disagrees" else "not judged"
        return JUnitCase(place, row.quantity.signal, failure=row_sentence(row), kind=kind)
    known = "known difference: " if row.verdict == "known" else ""
    return JUnitCase(place, row.quantity.signal, said=known + row_sentence(row))


def _compared(case: str, pair: EnginePair, row: ShownComparison) -> JUnitCase:
    """A statistic of contact of two engines; what is not judged passes, and says why."""
    place = f"{case}.{'-'.join(pair.between)}.{pair.joint_model}.{row.joint}"
    said = row.sentence().translate(ASCII_UNITS)
    if row.verdict == "disagrees":
        return JUnitCase(place, row.measure.key, failure=said, kind="disagreement")
    return JUnitCase(place, row.measure.key, said=f"{said}; not judged: {row.reason}" if row.reason else said)


def _contact(contact: ContactShown, run_title: str) -> str:
    """What contact did in a run, in words and numbers; empty where it was not watched."""
    lines = [run.sentence for run in contact.runs if run.run == run_title]
    for table in (table for table in contact.tables if run_title in table.runs):
        k = table.runs.index(run_title)
        rows = ((measure.title.translate(ASCII_UNITS), values[k].said(plain)) for measure, values in table.rows)
        lines += [f"{table.joint}: {title} {value}" for title, value in rows]
    return "\n".join(lines)


def _clean(attributes: dict[str, str]) -> dict[str, str]:
    """Attributes without the characters that XML cannot hold."""
    return {name: NOT_XML.sub("", value) for name, value in attributes.items()}
