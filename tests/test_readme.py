"""What the README tells a newcomer to do is there to be done."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from compare.cli.app import app

ROOT = Path(__file__).parent.parent
TITLE = "A general approach for accuracy analysis of parallel manipulator with joint clearance"
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", README, re.DOTALL)
COMMANDS = [
    line.split("#")[0].strip()
    for kind, text in BLOCKS
    if kind == ""
    for line in text.splitlines()
    if line.startswith("compare ")
]


def test_the_python_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (example,) = (text for kind, text in BLOCKS if kind == "python")
    exec(compile(example, "README.md", "exec"), {})
    printed = capsys.readouterr().out
    assert "mujoco, contact" in printed
    assert "paper: agrees." in printed


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_of_the_readme_knows_its_options(command: str) -> None:
    words = shlex.split(command)[1:]
    names = words[
        : next((i for i, word in enumerate(words) if word.startswith("-") or word.endswith(".json")), len(words))
    ]
    shown = CliRunner().invoke(app, [*names, "--help"], terminal_width=200)
    assert shown.exit_code == 0, shown.output
    for option in (word for word in words if word.startswith("--")):
        assert option in shown.output


def test_the_limit_that_it_names_is_broken_by_the_linkage_that_it_has_one_make(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (limit,) = re.findall(r"`(--limit [^`]*)`", README)
    new, look = (line for line in COMMANDS if "my-linkage" in line)
    assert CliRunner().invoke(app, shlex.split(new)[1:]).exit_code == 0
    run = CliRunner().invoke(app, [*shlex.split(look)[1:], *shlex.split(limit)])
    assert run.exit_code == 1
    assert "broken: reaction_B is 2718.7 N at 0 deg, more than its limit of 500 N" in run.output


def test_there_are_commands_to_check() -> None:
    assert len(COMMANDS) >= 4


def test_a_reader_is_through_it_in_a_minute_and_knows_the_paper() -> None:
    assert len(README.splitlines()) <= 90
    assert TITLE in README
    assert len(re.findall(r"!\[", README)) == 1


def test_it_has_five_doors_and_what_is_behind_them_leads_to_every_page() -> None:
    doors = README.partition("## Five doors\n")[2].partition("\n\n`analytic/`")[0]
    assert len(re.findall(r"\]\(", doors)) == 5
    behind = (ROOT / "docs" / "contents.md").read_text(encoding="utf-8")
    for folder in ("tutorial", "how-to", "theory"):
        for page in (ROOT / "docs" / folder).glob("*.md"):
            assert f"({folder}/{page.name})" in behind, page


def test_its_first_three_shell_blocks_are_what_ci_runs() -> None:
    """The continuous integration takes them by number."""
    main, tests, rig = (text.splitlines() for kind, text in BLOCKS if kind == "sh")
    assert main[-1] == ".venv/bin/compare --simulator mujoco"
    assert tests[-1] == ".venv/bin/pytest"
    assert rig == [".venv/bin/compare diagnose docs/example-rig/measured.toml --simulator mujoco"]


# ---------------------------------------------------------------- CITATION.cff


def test_the_citation_file_has_what_its_format_asks_for() -> None:
    """Citation File Format 1.2.0: required fields, and those of a reference."""
    found = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert found["cff-version"] == "1.2.0"
    for part in (found, *found["references"]):
        assert part["title"]
        assert all(set(author) & {"name", "family-names"} for author in part["authors"])
        assert part["authors"]
    assert found["message"]
    assert found["type"] == "software"
    assert all(reference["type"] for reference in found["references"])


def test_the_citation_file_is_of_this_version_and_of_the_paper() -> None:
    found = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert (found["title"], found["version"], found["license"]) == (
        project["name"],
        project["version"],
        project["license"],
    )
    assert TITLE in [reference["title"] for reference in found["references"]]
