"""The verdicts as a JUnit file: a suite for each run, a case for each signal; one for statistics of contact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree

from compare.quantities import plain
from compare.report.summary import Row, ShownRun, Summary
from compare.report.svg import NOT_XML
from compare.report.words.contact import ASCII, Held, Pair
from compare.report.words.crosscheck import row_sentence


def junit(summary: Summary) -> str:
    """JUnit XML: a disagreement is a failure with its numbers, and so is a run that is not judged; a known difference
    passes and says so.
    """
    suites = [_of_cases(f"{run.title}, {run.motion}", _cases(summary.case, run)) for run in summary.runs]
    if summary.contact.pairs:
        cases = [_held(summary.case, pair, row) for pair in summary.contact.pairs for row in pair.rows]
        suites.append(_of_cases("contact statistics", cases))
    _tell_contact(suites, summary)
    failed = [
        Case(f"{summary.case}.simulation", f"failure {i}", error=why, kind="simulation")
        for i, why in enumerate(summary.failures, 1)
    ]
    suites += [_of_cases("simulations that failed", failed)] * bool(failed)
    return _text(f"cross-check of {summary.case}", suites)


@dataclass(frozen=True)
class Case:
    """One case of a JUnit file: what is ``said`` of it, or the ``failure`` or ``error`` (a sentence each) that it has,
    of some ``kind``.
    """

    place: str
    name: str
    said: str = ""
    failure: str = ""
    error: str = ""
    kind: str = ""


def junit_xml(name: str, suites: Mapping[str, Sequence[Case]]) -> str:
    """JUnit XML of suites by name."""
    return _text(name, [_of_cases(title, cases) for title, cases in suites.items()])


def _of_cases(title: str, cases: Sequence[Case]) -> ElementTree.Element:
    counts = {"tests": len(cases), "failures": sum(bool(c.failure) for c in cases)}
    counts["errors"] = sum(bool(c.error) for c in cases)
    suite = ElementTree.Element("testsuite", _clean({"name": title, **{k: str(v) for k, v in counts.items()}}))
    for case in cases:
        element = ElementTree.SubElement(suite, "testcase", _clean({"classname": case.place, "name": case.name}))
        for tag, words in (("failure", case.failure), ("error", case.error)):
            if words:
                told = _clean({"message": words, "type": case.kind})
                ElementTree.SubElement(element, tag, told).text = told["message"]
        if case.said and not (case.failure or case.error):
            ElementTree.SubElement(element, "system-out").text = NOT_XML.sub("", case.said)
    return suite


def _text(name: str, suites: list[ElementTree.Element]) -> str:
    root = ElementTree.Element("testsuites", _clean({"name": name, **_totals(suites)}))
    root.extend(suites)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _cases(case: str, run: ShownRun) -> list[Case]:
    """A case for each signal of a run; one where nothing could be compared."""
    place = f"{case}.{run.simulator}.{run.joint_model}.{run.motion}"
    if not run.rows:
        return [Case(place, "anything to compare", failure=run.reason, kind="not judged")]
    return [_case(place, row) for row in run.rows]


def _case(place: str, row: Row) -> Case:
    if row.verdict in ("disagrees", "unjudged"):
        kind = "disagreement" if row.verdict == "disagrees" else "not judged"
        return Case(place, row.quantity.signal, failure=row_sentence(row), kind=kind)
    known = "known difference: " if row.verdict == "known" else ""
    return Case(place, row.quantity.signal, said=known + row_sentence(row))


def _held(case: str, pair: Pair, row: Held) -> Case:
    """A statistic of contact of two engines; what is not judged passes, and says why."""
    place = f"{case}.{'-'.join(pair.between)}.{pair.joint_model}.{row.joint}"
    said = row.sentence().translate(ASCII)
    if row.verdict == "disagrees":
        return Case(place, row.measure.key, failure=said, kind="disagreement")
    return Case(place, row.measure.key, said=f"{said}; not judged: {row.reason}" if row.reason else said)


def _tell_contact(suites: Sequence[ElementTree.Element], summary: Summary) -> None:
    """What contact did in each run, in words and numbers, in the output of its suite."""
    by_title = {run.title: suite for run, suite in zip(summary.runs, suites, strict=False)}
    for run in summary.contact.runs:
        lines = [run.sentence]
        for table in (table for table in summary.contact.tables if run.run in table.runs):
            k = table.runs.index(run.run)
            lines += [f"{table.joint}: {m.title.translate(ASCII)} {values[k].said(plain)}" for m, values in table.rows]
        element = ElementTree.SubElement(by_title[run.run], "system-out")
        element.text = NOT_XML.sub("", "\n".join(lines))


def _totals(suites: list[ElementTree.Element]) -> dict[str, str]:
    return {name: str(sum(int(suite.get(name, "0")) for suite in suites)) for name in ("tests", "failures", "errors")}


def _clean(attributes: dict[str, str]) -> dict[str, str]:
    """Attributes without the characters that XML cannot hold."""
    return {name: NOT_XML.sub("", value) for name, value in attributes.items()}
