"""Where an engine cannot be used, the tests of the others run, and the summary says what was skipped and why."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from commands import ROOT

SELECTION = [
    "tests/conformance/test_agreement.py",  # an engine a row
    "tests/test_exudyn_beams.py",  # one engine in all of the file
    "tests/test_diagnose.py::test_a_run_that_is_proposed_is_read_back_with_its_loads",  # one that is met on the way
]


@pytest.mark.slow
def test_an_engine_that_cannot_be_imported_is_one_line_of_the_summary_and_no_error(tmp_path: Path) -> None:
    (tmp_path / "exudyn.py").write_text("raise ImportError('hidden')\n", encoding="utf-8")
    paths = os.pathsep.join([str(tmp_path), str(ROOT), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-n", "0", "-q", *SELECTION]
    chosen = ["-k", "beams or proposed or (ideal and static)"]
    done = subprocess.run(
        [*command, *chosen],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": paths, "COLUMNS": "300"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    why = "simulator 'exudyn' is installed but cannot be imported (ImportError: hidden)"
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("SKIPPED") and "exudyn" in line)
    assert why in line
    counts = {word: int(count) for count, word in re.findall(r"(\d+) (\w+)", done.stdout.splitlines()[-1])}
    assert counts["passed"] >= 11  # at least MuJoCo's rows
    assert counts["skipped"] >= 11 + 50  # and most of what is said of beams
    assert not {"failed", "error", "errors"} & set(counts)
