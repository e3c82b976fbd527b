"""Judgements as continuous integration shows them: test cases of a JUnit file, and annotations of GitHub."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from analytic.writing import OutputError, write_atomically
from compare.files import NOT_XML, escape_markdown, made_folder, relative

MOST_ANNOTATIONS = 10  # errors of one step that GitHub shows
NO_ANSWER = "compare without an answer"  # what tests are called where a command had none
SOURCES = ("measured", "results", "case", "rig", "result")  # options that name the file an answer is about, in order


@dataclass(frozen=True)
class JUnitCase:
    """One judgement: what is ``said`` of it, or the ``failure`` or ``error`` (a sentence each) that it has, of some
    ``kind``, or why it was ``skipped``.

    ``place`` is what it belongs to, from large to small.  ``look`` is a command that shows it, with ``{file}`` for the
    result's JSON file, ``times`` how many times its tolerance a difference is (infinite of a verdict on all of them),
    ``file`` the file at fault where that is not the one the command was given.
    """

    place: tuple[str, ...]
    name: str
    said: str = ""
    failure: str = ""
    error: str = ""
    kind: str = ""
    look: str = ""
    times: float = 0.0
    file: str = ""
    skipped: str = ""

    @property
    def title(self) -> str:
        """Its name in a list without its place: ``paper, mujoco, contact, driven: reaction_B_angle``."""
        return f"{', '.join(self.place)}: {self.name}"


@dataclass(frozen=True)
class JUnitSuite:
    """Cases that belong together, and what is ``said`` of them as a whole."""

    title: str
    cases: Sequence[JUnitCase]
    said: str = ""


def junit_xml(name: str, suites: Sequence[JUnitSuite], file: str) -> str:
    """JUnit XML of suites; commands that show a failure read ``file``."""
    root = ElementTree.Element("testsuites", _clean({"name": name} | _counts([c for s in suites for c in s.cases])))
    for suite in suites:
        element = ElementTree.SubElement(root, "testsuite", _clean({"name": suite.title} | _counts(suite.cases)))
        for case in suite.cases:
            _add(element, case, file)
        if suite.said:
            ElementTree.SubElement(element, "system-out").text = _text(suite.said)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def no_answer(command: str, why: str, kind: str) -> str:
    """JUnit XML of a command that has no answer, the one case of it an error."""
    case = JUnitCase((command,), "answer", error=why, kind=kind)
    return junit_xml(NO_ANSWER, [JUnitSuite(command, [case])], "")


def record_no_answer(path: Path, command: str, why: str, kind: str) -> None:
    """Write that into a JUnit file, so that none of an earlier answer is taken for this one; not over another file, and
    not where nothing can be written.
    """
    with suppress(OSError, UnicodeDecodeError, OutputError):
        if os.path.lexists(path) and "<testsuites " not in path.read_text(encoding="utf-8"):
            return
        with made_folder(path.parent):
            write_atomically(path, no_answer(command, why, kind))


def is_no_answer(path: Path) -> bool:
    """Whether a file is such JUnit XML, which the next answer may replace."""
    try:
        return f'name="{NO_ANSWER}"' in path.read_text(encoding="utf-8").partition("<testsuite ")[0]
    except (OSError, UnicodeDecodeError):
        return False


def wrong(suites: Sequence[JUnitSuite]) -> list[JUnitCase]:
    """The cases with a failure or an error, those first that are the most times off their tolerance."""
    cases = (case for suite in suites for case in suite.cases)
    return sorted((case for case in cases if case.failure or case.error), key=lambda case: -case.times)


def annotated(suites: Sequence[JUnitSuite], file: str, kept: str) -> list[str]:
    """A line for GitHub for each case that is wrong, on its own file or this one; nothing where no workflow of GitHub
    runs this.

    GitHub shows so many of a step and leaves the rest out in silence: the last one says how many more there are, and
    where all are ``kept``.
    """
    cases = wrong(suites) if in_workflow() else []
    lines = [annotation(case.failure or case.error, case.title, case.file or file) for case in cases]
    if len(lines) <= MOST_ANNOTATIONS:
        return lines
    more = f"{len(lines) - MOST_ANNOTATIONS + 1} more are wrong; {kept} has them all"
    return [*lines[: MOST_ANNOTATIONS - 1], annotation(more, "and more", file)]


def summed_up(suites: Sequence[JUnitSuite]) -> str:
    """The verdict in a line: how many cases are wrong, and what is the worst or, where none is, the nearest to that;
    empty of what judges nothing.
    """
    cases, bad = [case for suite in suites for case in suite.cases if not case.skipped], wrong(suites)
    if not cases:
        return ""
    first = max(bad or cases, key=lambda case: case.times)
    said = first.failure or first.error or first.said
    of = f"✗ {first.place[0]}: {len(bad)} of {len(cases)} wrong" if bad else f"✓ {first.place[0]}: {len(cases)} right"
    which = "the worst" if bad else "the nearest to wrong"
    return of + (f"; {which}: {', '.join(first.place[1:])}: {said}" if said else "")


def head_summary(line: str) -> None:
    """Put a line on the page of the run, in a workflow of GitHub; nothing where that is not to be written."""
    path = os.environ.get("GITHUB_STEP_SUMMARY", "")
    if in_workflow() and path and line:
        with suppress(OSError), open(path, "a", encoding="utf-8") as file:
            file.write(f"{escape_markdown(relative(line))}\n\n")


def annotation(message: str, title: str, file: str) -> str:
    """The line by which a workflow of GitHub marks a file, or the run as a whole where there is none."""
    properties = {"file": _in_workspace(file)} if file else {}
    named = ",".join(f"{name}={_escaped(value, ':,')}" for name, value in (properties | {"title": title}).items())
    return f"::error {named}::{_escaped(relative(message))}"


def in_workflow() -> bool:
    """Whether a workflow of GitHub runs this."""
    return os.environ.get("GITHUB_ACTIONS") == "true"


def in_ci() -> bool:
    """Whether continuous integration runs this: nearly every one sets CI."""
    return in_workflow() or os.environ.get("CI", "").lower() not in ("", "0", "false")


def source(given: Mapping[str, object]) -> str:
    """The file that a command with these options is about, the data before the linkage; empty for a shipped case."""
    values = (given.get(name) for name in SOURCES)
    files = (str(each) for value in values for each in (value if isinstance(value, list | tuple) else [value]))
    return next(filter(os.path.isfile, files), "")


def _in_workspace(path: str) -> str:
    """A path as a workflow's files have it: from the repository's root, which the workflow says."""
    root = Path(os.environ.get("GITHUB_WORKSPACE") or ".").resolve()
    full = Path(path).resolve()
    return full.relative_to(root).as_posix() if full.is_relative_to(root) else full.name


def _escaped(text: str, more: str = "") -> str:
    """Text of a workflow's command, as GitHub's own toolkit writes it."""
    for character in f"%\r\n{more}":
        text = text.replace(character, f"%{ord(character):02X}")
    return text


def _add(suite: ElementTree.Element, case: JUnitCase, file: str) -> None:
    place = ".".join(part.replace(".", "_") for part in case.place)  # a dot begins a package
    element = ElementTree.SubElement(suite, "testcase", _clean({"classname": place, "name": case.title}))
    for tag, words in (("failure", case.failure), ("error", case.error), ("skipped", case.skipped)):
        if words:
            attributes = _clean({"message": words} | ({} if case.skipped else {"type": case.kind}))
            where = ", in this file's folder" if "{file}" in case.look else ""
            look = f"\nto look at it{where}: {case.look.replace('{file}', file)}" * bool(case.look)
            ElementTree.SubElement(element, tag, attributes).text = _text(words + look)
    if case.said and not (case.failure or case.error):
        ElementTree.SubElement(element, "system-out").text = _text(case.said)


def _counts(cases: Sequence[JUnitCase]) -> dict[str, str]:
    kinds = {"failures": "failure", "errors": "error", "skipped": "skipped"}
    counts = {tag: sum(bool(getattr(case, kind)) for case in cases) for tag, kind in kinds.items()}
    return {name: str(number) for name, number in ({"tests": len(cases)} | counts).items()}


def _clean(attributes: dict[str, str]) -> dict[str, str]:
    return {name: _text(value) for name, value in attributes.items()}


def _text(text: str) -> str:
    """Text that XML can hold, with relative paths."""
    return NOT_XML.sub("", relative(text))
