"""The action for GitHub workflows does what it says, as far as a shell can tell."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parent.parent
ACTION: dict[str, Any] = yaml.safe_load((ROOT / "docs" / "github-action" / "action.yml").read_text(encoding="utf-8"))
STEPS: dict[str, dict[str, Any]] = {step["name"]: step for step in ACTION["runs"]["steps"] if "name" in step}
EXPRESSION = re.compile(r"\$\{\{ inputs\.(\w+) \}\}")
pytestmark = [
    pytest.mark.mujoco,
    pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash to run the action's steps"),
]


class Job:
    """A job's folder and the files that GitHub gives it."""

    def __init__(self, folder: Path, **inputs: str) -> None:
        self.folder, self.summary, self.output = folder / "work", folder / "summary.md", folder / "output.txt"
        self.inputs = {name: each["default"] for name, each in ACTION["inputs"].items()} | inputs
        self.folder.mkdir()
        command = folder / "bin" / "compare"
        command.parent.mkdir()
        command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m compare "$@"\n', encoding="utf-8")
        command.chmod(0o755)
        self.environment = os.environ | {
            "GITHUB_STEP_SUMMARY": str(self.summary),
            "GITHUB_OUTPUT": str(self.output),
            "PATH": f"{command.parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")])),
        }

    def filled(self, text: str) -> str:
        """A value with the action's inputs in their places."""
        return EXPRESSION.sub(lambda found: self.inputs[found[1]], text)

    def run(self, name: str) -> int:
        """The exit status of a step, run as the action's runner does."""
        step = STEPS[name]
        assert step["shell"] == "bash"
        own = {variable: self.filled(value) for variable, value in step["env"].items()}
        words = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", step["run"]]
        return subprocess.run(
            words, cwd=self.folder, env=self.environment | own, capture_output=True, timeout=120, check=False
        ).returncode


def test_no_input_is_pasted_into_a_shell() -> None:
    assert not [name for name, step in STEPS.items() if "${{" in step.get("run", "")]


def test_the_report_is_kept_under_its_name_whatever_the_verdict() -> None:
    kept = STEPS["Keep the report"]
    assert kept["if"] == STEPS["Summary on the run's page"]["if"] == "${{ !cancelled() }}"
    assert kept["uses"].startswith("actions/upload-artifact@")
    assert kept["with"]["path"] == "${{ inputs.name }}"


@pytest.mark.slow
def test_a_disagreement_fails_the_job_and_its_summary_and_report_are_there(tmp_path: Path) -> None:
    job = Job(tmp_path, options="--motion static --joint contact --angles 20:60:20 --analytic first_order")
    assert job.run("Cross-check") == 1
    assert job.output.read_text(encoding="utf-8") == "status=1\n"
    assert job.run("Summary on the run's page") == 0
    summary = job.summary.read_text(encoding="utf-8")
    assert summary.startswith("# ")
    assert "disagrees" in summary
    assert "![" not in summary  # pictures beside the report would be broken on that page
    assert {"report.html", "junit.xml", "result.json"} <= {p.name for p in (job.folder / "crosscheck-report").iterdir()}


def test_bad_input_fails_the_job_and_the_summary_says_that_there_is_no_report(tmp_path: Path) -> None:
    job = Job(tmp_path, case="no such case; touch owned", name="gripper")
    assert job.run("Cross-check") == 2
    assert job.output.read_text(encoding="utf-8") == "status=2\n"
    assert job.run("Summary on the run's page") == 0
    assert "No report of gripper" in job.summary.read_text(encoding="utf-8")
    assert not (job.folder / "owned").exists()
