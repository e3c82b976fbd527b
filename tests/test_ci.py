"""What continuous integration shows of an answer: annotations of GitHub, test cases, the command that shows more."""

from __future__ import annotations

import csv
import re
import shlex
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from unittest import mock
from xml.etree import ElementTree

import pytest

import commands
from analytic.mechanism.file import dumps, load
from compare.ci import MOST_ANNOTATIONS, JUnitCase, JUnitSuite, annotated, annotation
from compare.files import relative

DISAGREEING = "--simulator mujoco --motion static --joint contact --analytic first_order --clearance B=0.01".split()


@pytest.fixture
def job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout with a linkage in a folder of it, in a workflow of GitHub."""
    (tmp_path / "repo" / "linkages").mkdir(parents=True)
    file = tmp_path / "repo" / "linkages" / "my, linkage.toml"
    file.write_text(dumps(load("paper").replace(name="mine")), encoding="utf-8")
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path / "repo"))
    return tmp_path / "repo"


@pytest.mark.mujoco
def test_a_disagreement_is_annotated_looked_at_and_written_with_relative_paths(job: Path) -> None:
    file, out = str(job / "linkages" / "my, linkage.toml"), job / "out"
    done = commands.compare("--case", file, *DISAGREEING, "--out", str(out), cwd=job)
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if line.startswith("::")]
    head = "::error file=linkages/my%2C linkage.toml,title=mine%2C mujoco%2C contact%2C static%3A reaction_D_angle::"
    assert lines[0].startswith(f"{head}reaction angle at D: +11.3")
    assert len(lines) == MOST_ANNOTATIONS
    assert lines[-1].endswith("4 more are wrong; out/junit.xml has them all")

    cases = list(ElementTree.parse(out / "junit.xml").iter("testcase"))
    failed = [case for case in cases if case.find("failure") is not None]
    assert len(failed) == len(lines) - 1 + 4
    assert len({case.get("name") for case in cases}) == len(cases)

    for name in ("junit.xml", "report.md", "report.html", "result.json", "signals.csv"):
        assert str(job) not in (out / name).read_text(encoding="utf-8"), name

    (look,) = [line for line in done.stdout.splitlines() if line.startswith("to look at the worst: ")]
    shown = commands.compare(*shlex.split(look.partition(": compare ")[2]), cwd=job)
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.startswith("reaction_D_angle: ")
    in_folder = re.search(r"to look at it, in this file's folder: compare (.*)", failed[0].findtext("failure", ""))
    assert in_folder is not None
    assert commands.compare(*shlex.split(in_folder[1]), cwd=out).stdout == shown.stdout

    again = commands.compare(
        "--case", "linkages/my, linkage.toml", *DISAGREEING, "--out", "out", "--json", "-q", cwd=job
    )
    assert again.returncode == 1, again.stderr  # the same question, so that it may replace its own files
    assert again.stdout.startswith("{")  # and nothing else there
    assert again.stderr.count("::error") == MOST_ANNOTATIONS


@pytest.mark.mujoco
def test_what_agrees_and_what_github_does_not_run_is_not_annotated(job: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    agreeing = commands.compare(*DISAGREEING[:6], "--clearance", "B=1e-4", "-q", cwd=job)
    assert agreeing.returncode == 0
    assert "::" not in agreeing.stderr
    monkeypatch.delenv("GITHUB_ACTIONS")
    elsewhere = commands.compare(*DISAGREEING, "-q", cwd=job)
    assert elsewhere.returncode == 1
    assert "::" not in elsewhere.stderr


def test_bad_input_is_annotated_on_its_file(job: Path) -> None:
    done = commands.compare("accuracy", "--case", "linkages/my, linkage.toml", "--clearance", "Q=1", cwd=job)
    assert done.returncode == 2
    said, marked = done.stderr.splitlines()
    assert marked == f"::error file=linkages/my%2C linkage.toml,title=compare::{said.removeprefix('compare: ')}"


def test_a_case_that_there_is_not_leaves_its_error_in_the_folder_that_was_asked_for(job: Path) -> None:
    done = commands.compare("--case", "renamed.toml", "--simulator", "mujoco", "--out", "out", cwd=job)
    assert done.returncode == 2
    assert [file.name for file in (job / "out").iterdir()] == ["junit.xml"]
    (error,) = ElementTree.parse(job / "out" / "junit.xml").iter("error")
    assert "renamed.toml: no such mechanism file or case" in error.get("message", "")


def test_bad_input_leaves_one_error_in_the_junit_file_which_the_next_answer_replaces(job: Path) -> None:
    (job / "bad.toml").write_text("clearence = 1", encoding="utf-8")
    for line in (["baseline", "check", "--junit", "out/junit.xml"], ["check", "theirs.csv", "--out", "out"]):
        done = commands.compare(*line, "--case", "bad.toml", cwd=job)
        assert done.returncode == 2
        (error,) = ElementTree.parse(job / "out" / "junit.xml").iter("error")
        assert error.get("message") == done.stderr.splitlines()[0].removeprefix("compare: ")
    commands.compare("analyse", "--motion", "static", "--out", "one", "-q", cwd=job)
    fine = commands.compare("check", "one/signals.csv", "--motion", "static", "--out", "out", "-q", cwd=job)
    assert fine.returncode == 0, fine.stderr
    assert not list(ElementTree.parse(job / "out" / "junit.xml").iter("error"))


@pytest.mark.parametrize("spoilt", ["another command", "a word", "an interrupt", "no linkage"])
def test_no_earlier_junit_file_is_left_where_a_command_in_a_ci_has_no_answer(spoilt: str, job: Path) -> None:
    line = ["analyse", "--case", "linkages/my, linkage.toml", "--limit", "reaction_B=1GN", "--out", "out", "-q"]
    assert commands.compare(*line, cwd=job).returncode == 0
    fault: AbstractContextManager[object] = nullcontext()
    if spoilt == "an interrupt":
        fault = mock.patch("compare.analyse._side", side_effect=KeyboardInterrupt)
    elif spoilt == "no linkage":
        (job / "linkages" / "my, linkage.toml").write_text("[[joint]]", encoding="utf-8")
    else:
        line += ["--limit", "reaction_D=1GN"] if spoilt == "another command" else ["--nonsense"]
    with fault:
        done = commands.compare(*line, cwd=job)
    assert done.returncode == (130 if spoilt == "an interrupt" else 2)
    (error,) = ElementTree.parse(job / "out" / "junit.xml").iter("error")
    assert error.get("message", "") in done.stderr


def test_a_file_that_is_no_junit_file_keeps_what_it_has_where_a_command_has_no_answer(job: Path) -> None:
    (job / "out").mkdir()
    (job / "out" / "junit.xml").write_text("<model/>", encoding="utf-8")
    assert commands.compare("crank-rocker", "--limit", "reaction_B=1N", "--out", "out", cwd=job).returncode == 2
    assert (job / "out" / "junit.xml").read_text(encoding="utf-8") == "<model/>"


@pytest.mark.parametrize(
    ("line", "why"),
    [
        (["baseline", "check", "--junit", "out/junit.xml", "--nonsense"], "No such option"),
        (["baseline", "check", "--junit=out/junit.xml", "--cases", "paper"], "No such option"),
        (["diagnose", "absent.toml", "--out", "out", "--seed", "one"], "No such option: --seed"),
        (["--simulator", "mujoco", "--out", "out", "--revolutions", "many"], "Invalid value for '--revolutions'"),
    ],
)
def test_words_that_no_command_has_leave_their_error_too(line: list[str], why: str, job: Path) -> None:
    assert commands.compare(*line, cwd=job).returncode == 2
    (error,) = ElementTree.parse(job / "out" / "junit.xml").iter("error")
    assert why in error.get("message", "")
    assert commands.compare("plan", "paper", "--out", "plan", "--nonsense", cwd=job).returncode == 2
    assert not (job / "plan").exists()  # a plan judges nothing


def test_the_page_of_a_run_begins_with_the_verdict_and_the_worst_number(
    job: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = job / "summary.md"
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(page))
    asked = ("crank-rocker", "--out", "out", "-q", "--overwrite", "--limit")
    for limits, status in (
        ("reaction_B=5N,transmission_angle=40deg", 1),
        ("reaction_B=20N,reaction_D=20N", 0),
        ("B=1N", 2),
    ):
        assert commands.compare(*asked, limits, cwd=job).returncode == status
    assert commands.compare("crank-rocker", "-q", cwd=job).returncode == 0  # which judges nothing
    wrong, right, none = page.read_text(encoding="utf-8").replace("\\", "").split("\n\n")[:-1]
    said = "reaction_B is 10.2 N at 15.45 deg, more than its limit of 5 N"
    assert wrong == f"✗ crank-rocker: 2 of 2 wrong; the worst: limit: {said}"
    assert right.startswith("✓ crank-rocker: 2 right; the nearest to wrong: limit: reaction_D is 16.987 N")
    assert none.startswith("✗ no answer: --limit B=1N: B is nothing of crank-rocker")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(job))  # a folder: no page, and no fault of the command
    assert commands.compare(*asked, "reaction_B=5N", cwd=job).returncode == 1


@pytest.mark.mujoco
def test_a_cross_check_puts_its_verdict_before_its_report(job: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(job / "summary.md"))
    commands.compare(*DISAGREEING, "--out", "out", "-q", cwd=job)
    line = (job / "summary.md").read_text(encoding="utf-8")
    worst = "mujoco, contact, static: reaction angle at D: +11.32 deg at 160 deg"
    assert line.startswith(f"✗ paper: 13 of 13 wrong; the worst: {worst}")


def test_results_that_disagree_are_annotated_on_their_file_and_looked_at(job: Path) -> None:
    """Recorded results, one reaction a fifth too large; then a file with two faults, each marked by itself."""
    done = commands.compare("analyse", "--motion", "static", "--out", "one", "-q", cwd=job)
    assert done.returncode == 0, done.stderr
    head, *rows = csv.reader((job / "one" / "signals.csv").read_text(encoding="utf-8").splitlines())
    wrong = head.index("reaction_B_x [N]")
    derived = [k for k, name in enumerate(head) if name.startswith(("reaction_B_angle", "reaction_B_magnitude"))]
    for row in rows:
        row[wrong] = str(1.2 * float(row[wrong]))
    for name, left_out in (("theirs.csv", derived), ("torn.csv", [])):
        lines = ([cell for k, cell in enumerate(row) if k not in left_out] for row in (head, *rows))
        (job / name).write_text("\n".join(map(",".join, lines)) + "\n", encoding="utf-8")
    asked = ["--motion", "static"]
    done = commands.compare("check", "theirs.csv", *asked, "--out", "out", cwd=job)
    assert done.returncode == 1, done.stderr
    marked = [line for line in done.stderr.splitlines() if line.startswith("::")]
    assert marked[0].startswith("::error file=theirs.csv,title=paper%2C theirs%2C contact%2C static%3A reaction_B_")
    (look,) = [line for line in done.stdout.splitlines() if line.startswith("to look at the worst: ")]
    shown = commands.compare(*shlex.split(look.partition(": compare ")[2]), cwd=job)
    assert shown.stdout.startswith("reaction_B_"), shown.stderr

    torn = commands.compare("check", "torn.csv", *asked, cwd=job)
    assert torn.returncode == 2
    assert torn.stderr.startswith("compare: 2 faults:\n")
    marked = [line for line in torn.stderr.splitlines() if line.startswith("::")]
    assert [line.partition("::torn.csv: ")[0] for line in marked] == ["::error file=torn.csv,title=compare"] * 2


def test_github_s_ten_are_those_farthest_off_and_say_how_many_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    cases = [JUnitCase(("a",), f"s{k}", failure=f"off {k}", times=k) for k in range(MOST_ANNOTATIONS + 5)]
    lines = annotated([JUnitSuite("all", [*cases, JUnitCase(("a",), "fine", said="agrees")])], "", "j.xml")
    assert lines[0] == "::error title=a%3A s14::off 14"
    assert len(lines) == MOST_ANNOTATIONS
    assert lines[-1].endswith("6 more are wrong; j.xml has them all")
    assert len(annotated([JUnitSuite("all", cases[:MOST_ANNOTATIONS])], "", "j.xml")) == MOST_ANNOTATIONS


def test_what_a_workflow_s_command_may_not_hold_is_escaped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GITHUB_WORKSPACE", raising=False)
    monkeypatch.chdir(tmp_path)
    assert annotation("100 %\r\nof it", "a:b,c", "") == "::error title=a%3Ab%2Cc::100 %25%0D%0Aof it"
    assert annotation("x", "t", "../elsewhere/f.toml") == "::error file=f.toml,title=t::x"


def test_paths_of_the_working_folder_become_relative_and_no_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given = f"compare {tmp_path}/a.toml --out={tmp_path} mjcf:{tmp_path}/b.xml {tmp_path}-old/c /x{tmp_path}/d"
    assert relative(given) == f"compare a.toml --out=. mjcf:b.xml {tmp_path}-old/c /x{tmp_path}/d"
