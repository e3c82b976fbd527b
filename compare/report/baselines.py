"""Baselines, shown: what moved as lines for a terminal, a table for a notebook, and test cases of a CI."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console

from compare.ci import JUnitCase, JUnitSuite, junit_xml
from compare.presentation import LIST_HAS_NO_PICTURE, Presentation
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
    same = entry.status == "same" and entry.changed
    head = f"{head}, though the linkage is another: {entry.changed}" if same else head
    remedies = (("to look at it", entry.look), ("to accept it", entry.accept))
    return [head, *(f"  {each}" for each in entry.sentences), *(f"  {do}: {by}" for do, by in remedies if by)]


def print_table(result: Baselines, console: Console) -> None:
    """Print what became of every baseline."""
    say(console, *(line for entry in result.entries for line in lines(entry)))


def junit(result: Baselines) -> str:
    """Every column of every baseline as a test case, in a JUnit file."""
    return junit_xml("baselines of the reaction forces", judged(result), result.file)


def judged(result: Baselines) -> list[JUnitSuite]:
    """A suite for each case in each engine, a test case for each signal of each run: what moved is a failure, a
    baseline that has no answer is an error.
    """
    return [JUnitSuite(f"{each.case}, {each.simulator}", list(_cases(each))) for each in result.entries]


def _cases(entry: Entry) -> Iterator[JUnitCase]:
    place = (entry.case, entry.simulator)
    if entry.status in ("unusable", "failed"):
        yield JUnitCase(place, "baseline", error=entry.why, kind=entry.status, file=entry.file)
        return
    if entry.status == "moved" and (entry.changed or entry.why):
        yield JUnitCase(place, "linkage", failure=entry.sentences[0], kind="moved", look=entry.look)
    moved = {(each.run, each.signal): each for each in entry.moved}
    for run, signals in entry.compared.items():
        for signal in signals:
            one = moved.get((run, signal))
            of_run = (*place, *run.split(", "))
            if one is None or entry.status != "moved":
                yield JUnitCase(of_run, signal, said="" if one is None else one.sentence)
                continue
            times = abs(one.by or 0.0) / one.tolerance if one.tolerance else 0.0
            yield JUnitCase(of_run, signal, "", one.sentence, "", "moved", entry.look, times)


def summary_html(result: Baselines) -> str:
    """Each baseline and what moved in it."""
    rows = []
    for entry in result.entries:
        said = entry.why if entry.status in ("unusable", "failed") else entry.words
        moved = "; ".join(entry.sentences)
        rows.append((entry.case, entry.simulator, entry.status, said, moved))
    return html_table(rows, ("case", "engine", "status", "compared", "moved"), repr(result))


PRESENTATION = Presentation(summary_html, print_table, files, no_picture=LIST_HAS_NO_PICTURE, judged=judged)
