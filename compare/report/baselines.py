"""Baselines, shown: what moved as lines for a terminal, a table for a notebook, and a JUnit file."""

from __future__ import annotations

from rich.console import Console

from compare.presentation import LIST_HAS_NO_PICTURE, Presentation
from compare.report.junit import JUnitCase, JUnitSuite, junit_xml
from compare.report.tables import html_table, say
from compare.results.baselines import Baselines, Entry


def files(result: Baselines) -> dict[str, str]:
    """A JUnit file, and what moved as a table for other programs."""
    return {"junit.xml": junit(result), "baselines.csv": result.to_csv()}


def lines(entry: Entry) -> list[str]:
    """What became of a baseline, and each column that moved; nothing where there is no answer."""
    if entry.status in ("unusable", "failed"):
        return []
    if entry.status in ("same", "moved"):
        made = f" (the baseline was made with {entry.stored_version})" * (entry.version != entry.stored_version)
        head = f"{entry.case}, {entry.simulator} {entry.version}{made}: {entry.words}"
    else:
        words = f"rewritten: {entry.words}" if entry.why == "rewritten" else entry.why
        head = f"{entry.file}: {words or 'unchanged'}"
    return [head, *(f"  {each.sentence}" for each in entry.moved)]


def print_table(result: Baselines, console: Console) -> None:
    """Print what became of every baseline."""
    say(console, *(line for entry in result.entries for line in lines(entry)))


def junit(result: Baselines) -> str:
    """A suite for each case, a case for each engine: what moved is a failure, what has no answer an error."""
    suites: dict[str, list[JUnitCase]] = {}
    for entry in result.entries:
        error = entry.why if entry.status in ("unusable", "failed") else ""
        failure = "; ".join(each.sentence for each in entry.moved) if entry.status == "moved" else ""
        place = f"{entry.case}.baseline"
        case = JUnitCase(place, entry.simulator, said=entry.words, failure=failure, error=error, kind=entry.status)
        suites.setdefault(entry.case, []).append(case)
    return junit_xml("baselines of the reaction forces", [JUnitSuite(*suite) for suite in suites.items()])


def summary_html(result: Baselines) -> str:
    """Each baseline and what moved in it."""
    rows = []
    for entry in result.entries:
        said = entry.why if entry.status in ("unusable", "failed") else entry.words
        moved = "; ".join(each.sentence for each in entry.moved)
        rows.append((entry.case, entry.simulator, entry.status, said, moved))
    return html_table(rows, ("case", "engine", "status", "compared", "moved"), repr(result))


PRESENTATION = Presentation(summary_html, print_table, files, no_picture=LIST_HAS_NO_PICTURE)
