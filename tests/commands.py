"""The commands, as tests give them: in this process, or in one of its own."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from unittest import mock

from compare.cli import app
from tests.evidence import __main__ as of_evidence

ROOT = Path(__file__).parent.parent
Ended = subprocess.CompletedProcess[str]


def compare(*arguments: str, cwd: Path) -> Ended:
    """The command in this process, which saves the time that imports take: its status and all that Python printed."""
    return _here(app.main, ["compare", *arguments], cwd)


def evidence(*arguments: str, cwd: Path) -> Ended:
    """``python -m tests.evidence`` in this process."""
    return _here(of_evidence.main, ["tests.evidence", *arguments], cwd)


def _here(main: Callable[[], None], command: list[str], cwd: Path) -> Ended:
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.chdir(cwd),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        mock.patch.object(sys, "argv", command),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("default")  # as in the command, which tells them
        try:
            main()
            status: object = 0
        except SystemExit as end:
            status = end.code
    assert isinstance(status, int | None), status
    return Ended(command, status or 0, out.getvalue(), err.getvalue())


def assert_refused(done: Ended, *words: str, status: int = 2) -> None:
    """A command ended with this status, and a sentence with these words; Python's own traceback is none."""
    assert done.returncode == status, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr


def compare_alone(*arguments: str, cwd: Path, **environment: str) -> Ended:
    """The command in a process of its own, as a person runs it."""
    return subprocess.run(
        [sys.executable, "-m", "compare", *arguments],
        cwd=cwd,
        env=os.environ | environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


@contextlib.contextmanager
def without(*packages: str):
    """Packages that are not installed, as far as this process looks for them."""
    import importlib.util

    real = importlib.util.find_spec
    with mock.patch(
        "importlib.util.find_spec", lambda name, package=None: None if name in packages else real(name, package)
    ):
        yield
