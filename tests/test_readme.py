"""What the README tells a newcomer to do is there to be done."""

from __future__ import annotations

import re
import shlex
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from analytic.mechanism.file import dumps, load
from compare.cli.app import app

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", README, re.DOTALL)
COMMANDS = [
    line.split("#")[0].strip()
    for kind, text in BLOCKS
    if kind == ""
    for line in text.splitlines()
    if line.startswith("compare ")
]


def test_the_python_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my-linkage.toml").write_text(dumps(load("paper")), encoding="utf-8")
    (example,) = (text for kind, text in BLOCKS if kind == "python")
    exec(compile(example, "README.md", "exec"), {})
    assert "{}" in capsys.readouterr().out  # reactions, and no flagged angle


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


@pytest.mark.parametrize(
    "path", re.findall(r"\]\(([^)h][^)]*)\)|`((?:compare|sim_models|analytic|docs|reports)/[\w./-]+\.\w+)`", README)
)
def test_every_file_that_the_readme_names_exists(path: tuple[str, str]) -> None:
    name = path[0] or path[1]
    if name == "reports/paper-mujoco/report.html":
        pytest.skip("written by the first command")
    assert (ROOT / name).exists(), name


def tracked() -> set[Path]:
    """The files of the repository; in a copy without git, such as an archive of a release, those of its folders."""
    if (ROOT / ".git").exists():
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        return {ROOT / name for name in listed.split("\0") if name}
    return {path for pattern in ("*", "docs/**/*", "reports/**/*") for path in ROOT.glob(pattern) if path.is_file()}


def test_every_picture_that_a_page_of_the_repository_shows_is_in_the_repository() -> None:
    files = tracked()
    shown = {
        path: re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", path.read_text(encoding="utf-8"))
        for path in files
        if path.suffix == ".md"
    }
    assert len(shown[ROOT / "reports" / "README.md"]) >= 10  # a drawing and the directions of each case
    missing = [
        f"{page.relative_to(ROOT)}: {name}"
        for page, names in shown.items()
        for name in names
        if (page.parent / name).resolve() not in files
    ]
    assert missing == []


def test_there_are_commands_to_check() -> None:
    assert len(COMMANDS) >= 8
