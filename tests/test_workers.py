"""Processes that do the runs of a command: gone within seconds of it, however it ends, and without a word on the
terminal.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from marks import slow

HERE = Path(__file__).parent
GONE = 5.0  # s
pytestmark = pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="looks for processes in Linux's /proc")

BUSY = """
import sys
import sweep_work
from compare.sweep import spread
for _ in spread(sweep_work.busy, [60.0] * 4, workers=2):
    pass
"""
ALL = ["-m", "compare", "--simulator", "all", "--case", "crank-rocker", "--clearance", "B=1e-4"]
MAP = ["-m", "compare", "validity", "--case", "crank-rocker", "--speeds", "60,600,900", "--clearances", "1e-4,2e-4"]
BASELINE = ["-m", "compare", "baseline", "update", "--case", "crank-rocker"]
CHATTER = ("leaked", "resource_tracker", "joblib", "loky", "RuntimeWarning", "encountered", "Traceback")
ENDS = {"killed": (signal.SIGKILL, False), "terminated": (signal.SIGTERM, False), "interrupted": (signal.SIGINT, True)}


def heeding_interrupts() -> None:
    """As in a terminal; where the tests run in the background, a child would inherit that interrupts are ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


class Command:
    """A command and all of its processes, however they are related: they carry its mark in their environment."""

    def __init__(self, arguments: list[str], folder: Path) -> None:
        self.mark = f"LINKAGE_MARK={folder}-{time.time_ns()}"
        paths = os.pathsep.join([str(HERE), str(HERE.parent)])
        environment = os.environ | {"PYTHONPATH": paths} | dict([self.mark.split("=")])
        self.said = folder / "said.txt"
        with self.said.open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, *arguments],
                cwd=folder,
                env=environment,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,
                preexec_fn=heeding_interrupts,
            )

    def processes(self) -> dict[int, str]:
        """Number and command line of each that is alive."""
        found = {}
        for place in Path("/proc").iterdir():
            try:
                if place.name.isdigit() and self.mark.encode() in (place / "environ").read_bytes():
                    found[int(place.name)] = (place / "cmdline").read_text(encoding="utf-8").replace("\0", " ")
            except OSError:
                continue
        return found

    def workers(self) -> list[int]:
        """Numbers of the processes that do runs."""
        return [number for number, line in self.processes().items() if "loky.backend.popen" in line]

    def until_workers(self, count: int) -> None:
        """Wait until there are so many workers."""
        until = time.monotonic() + 60
        while len(self.workers()) < count:
            assert self.process.poll() is None, self.said.read_text(encoding="utf-8")
            assert time.monotonic() < until
            time.sleep(0.02)

    def end(self, how: str) -> int:
        """End it; its exit status."""
        sent, everybody = ENDS[how]
        for _ in range(
            3
        ):  # Python drops an interrupt that falls into a callback of its own; a person presses the key again
            if everybody:  # as the keyboard does
                os.killpg(self.process.pid, sent)
            else:
                self.process.send_signal(sent)
            with contextlib.suppress(subprocess.TimeoutExpired):
                return self.process.wait(20)
        raise AssertionError(f"still running: {self.said.read_text(encoding='utf-8')}")

    def left(self) -> dict[int, str]:
        """Those that are still there after a few seconds, which are ended then."""
        until = time.monotonic() + GONE
        while (found := self.processes()) and time.monotonic() < until:
            time.sleep(0.05)
        for number in found:
            os.kill(number, signal.SIGKILL)
        return found


def words(command: Command) -> str:
    """What it said on standard error, but for lines of its own."""
    lines = command.said.read_text(encoding="utf-8").splitlines()
    return "\n".join(line for line in lines if line and not line.startswith(("left out: ", "compare: stopped")))


@pytest.mark.slow
@pytest.mark.parametrize("how", ["killed", *slow("terminated", "interrupted")])
def test_workers_in_the_middle_of_a_long_call_end_with_their_parent(how: str, tmp_path: Path) -> None:
    """They hold the interpreter's lock for a minute, as an engine does: no thread of theirs could look around."""
    command = Command(["-c", BUSY], tmp_path)
    command.until_workers(2)
    time.sleep(1.0)  # into the call
    assert command.end(how) != 0
    assert command.left() == {}
    assert "leaked" not in words(command)
    assert "resource_tracker" not in words(command)


@pytest.mark.slow
@pytest.mark.parametrize("pause", [*slow(0.0, 0.1), 0.3])
def test_workers_that_are_only_starting_end_with_their_parent(pause: float, tmp_path: Path) -> None:
    command = Command(["-c", BUSY], tmp_path)
    command.until_workers(1)
    time.sleep(pause)
    command.end("killed")
    assert command.left() == {}
    assert words(command) == ""


def test_a_sweep_that_comes_to_its_end_leaves_no_process_and_says_nothing(tmp_path: Path) -> None:
    command = Command(["-c", BUSY.replace("60.0", "0.05")], tmp_path)
    assert command.process.wait(60) == 0
    assert command.left() == {}
    assert words(command) == ""


@pytest.mark.slow
@pytest.mark.parametrize("how", ENDS)
@pytest.mark.parametrize("arguments", [ALL, MAP, BASELINE], ids=["cross-check", "validity", "baseline"])
def test_a_command_that_ends_at_any_moment_leaves_no_process_and_no_chatter(
    arguments: list[str], how: str, tmp_path: Path
) -> None:
    moments = random.Random(f"{arguments} {how}")
    for _ in range(2):
        command = Command(arguments, tmp_path)
        time.sleep(moments.uniform(0.3, 6.0))
        command.end(how)
        assert command.left() == {}
        assert words(command) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        [*ALL, "--joint", "contact", "--angles", "20:60:20", "--revolutions", "0"],
        [*MAP[:5], "--speeds", "60,600", "--clearances", "1e-4", "--revolutions", "0"],
        [*MAP[:5], "--speeds", "1e9,1e20", "--clearances", "1e-4,1e-2"],
    ],
    ids=["cross-check", "validity", "beyond all numbers"],
)
def test_a_command_that_is_left_alone_says_nothing_of_its_processes_or_of_numpys(
    arguments: list[str], tmp_path: Path
) -> None:
    command = Command(arguments, tmp_path)
    assert command.process.wait(300) in (0, 1, 3)
    said = command.said.read_text(encoding="utf-8")
    assert [word for word in CHATTER if word in said] == [], said
    assert command.left() == {}
