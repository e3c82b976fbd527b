"""The example workflow for GitHub Actions does what it says, as far as a shell can tell."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
WORKFLOW = (ROOT / "docs" / "ci-github-actions.yml").read_text(encoding="utf-8")


def step(name: str) -> str:
    """The shell text of a step."""
    found = re.search(
        rf"- name: {re.escape(name)}\n(?: {{8}}if: .*\n)? {{8}}run: (?:\|\n((?: {{10}}.*\n)+)|(.*)\n)", WORKFLOW
    )
    assert found is not None, name
    return found[2] or re.sub(r"(?m)^ {10}", "", found[1])


@pytest.fixture
def runner(tmp_path: Path) -> dict[str, str]:
    """The environment of a job: the workflow's own, a place for the summary, and the command on the path."""
    own = dict(re.findall(r'(?m)^  ([A-Z]+): "?([^"\s]+)"?', WORKFLOW))
    assert set(own) == {"PROJECT", "CASE", "BASELINES"}
    command = tmp_path / "bin" / "compare"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m compare "$@"\n', encoding="utf-8")
    command.chmod(0o755)
    return (
        os.environ
        | own
        | {
            "GITHUB_STEP_SUMMARY": str(tmp_path / "summary.md"),
            "PATH": f"{command.parent}{os.pathsep}{os.environ['PATH']}",
        }
    )


def run(name: str, cwd: Path, runner: dict[str, str]) -> int:
    return subprocess.run(
        ["bash", "-e", "-c", step(name)], cwd=cwd, env=runner, capture_output=True, timeout=120, check=False
    ).returncode


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash to run the workflow's steps")
def test_its_steps_make_the_summary_and_the_folder_and_fail_when_the_command_does(
    tmp_path: Path, runner: dict[str, str]
) -> None:
    work = tmp_path / "work"
    shutil.copytree(ROOT / "reports" / "baselines", work / "reports" / "baselines")
    assert run("Cross-check", work, runner) == 0
    assert run("Reaction forces against the baseline", work, runner) == 0
    assert run("Summary on the run's page", work, runner) == 0
    summary = (tmp_path / "summary.md").read_text(encoding="utf-8")
    assert summary.startswith("# ")
    assert "## Provenance" in summary
    assert "![" not in summary  # pictures beside the report would be broken on that page
    assert "nothing moved" in summary
    assert {"report.html", "junit.xml", "result.json", "baseline.txt"} <= {
        p.name for p in (work / "crosscheck-report").iterdir()
    }
    (work / "reports" / "baselines" / "paper-mujoco.toml").unlink()
    assert run("Reaction forces against the baseline", work, runner) == 2
    assert run("Cross-check", work, runner | {"CASE": "no-such-case"}) == 2
