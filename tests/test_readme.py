"""What the README tells a newcomer to do is there to be done."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from analytic.mechanism_file import dumps, load
from compare.cli import app

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", README, re.DOTALL)
COMMANDS = [line.split("#")[0].strip() for kind, text in BLOCKS if kind == "" for line in text.splitlines() if line.startswith("compare ")]


def test_the_python_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my-linkage.toml").write_text(dumps(load("paper")), encoding="utf-8")
    (example,) = (text for kind, text in BLOCKS if kind == "python")
    exec(compile(example, "README.md", "exec"), {})
    assert "{}" in capsys.readouterr().out  # reactions, and no flagged angle


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_of_the_readme_knows_its_options(command: str) -> None:
    words = shlex.split(command)[1:]
    names = words[: next((i for i, word in enumerate(words) if word.startswith("-") or word.endswith(".json")), len(words))]
    shown = CliRunner().invoke(app, [*names, "--help"], terminal_width=200)
    assert shown.exit_code == 0, shown.output
    for option in (word for word in words if word.startswith("--")):
        assert option in shown.output


@pytest.mark.parametrize("path", re.findall(r"\]\(([^)h][^)]*)\)|`((?:compare|sim_models|analytic|docs|reports)/[\w./-]+\.\w+)`", README))
def test_every_file_that_the_readme_names_exists(path: tuple[str, str]) -> None:
    name = path[0] or path[1]
    if name == "reports/paper-mujoco/report.html":
        pytest.skip("written by the first command")
    assert (Path(__file__).parent.parent / name).exists(), name


def test_there_are_commands_to_check() -> None:
    assert len(COMMANDS) >= 8
