"""Folders that cannot be written, are full, or are written by two at once: one sentence that names the path, and no
half of anything.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

import commands
from analytic.writing import OutputError, write_atomically, write_together
from compare.files import alone_in, made_folder
from marks import slow

ROOT = Path(__file__).parents[1]
RIG = ROOT / "docs" / "example-rig" / "measured.toml"
CROSSCHECK = ["--simulator", "mujoco", "--joint", "ideal", "--angles", "20:60:20", "--out", "out"]
COMMANDS = {
    "cross-check": CROSSCHECK,
    "accuracy": ["accuracy", "--clearance", "B=1e-4", "--angles", "20:60:20", "--out", "out"],
    "validity": ["validity", "--speeds", "60", "--clearances", "1e-4", "--out", "out", "--workers", "1"],
    "baseline": ["baseline", "update", "--case", "pendulum", "--simulator", "mujoco", "--baselines", "out"],
    "export": ["export", "--simulator", "mujoco", "--angles", "20:60:20", "--out", "out"],
}
LARGE = ("cross-check", "validity", "export")  # those whose files a full disk has no room for
posix = pytest.mark.skipif(os.name != "posix", reason="limits a process as POSIX does")


def first_of(rows: Iterable[Any]) -> list[Any]:
    """The first row, and the others for the long suite."""
    first, *others = rows
    return [first, *slow(*others)]


def compare(folder: Path, arguments: list[str], limit: int | None = None) -> subprocess.CompletedProcess[str]:
    """The command; with a limit no file may be larger than so many bytes, as on a disk that is full then."""

    def limited() -> None:
        import resource

        assert limit is not None
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.run(
        [sys.executable, "-m", "compare", *arguments],
        cwd=folder,
        # Python would cut off its compiled modules at the limit, and everybody after it would read those
        env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        preexec_fn=limited if limit is not None else None,
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def refused(done: subprocess.CompletedProcess[str], path: str) -> None:
    """Status 2 and one sentence with the path."""
    assert done.returncode == 2, done.stderr
    said = [line for line in done.stderr.splitlines() if line.startswith("compare: ")]
    assert len(said) == 1
    assert path in said[0]
    assert "another folder" in said[0]
    assert "Traceback" not in done.stderr


# ---------------------------------------------------------------- a folder in the way


@pytest.mark.mujoco
@pytest.mark.parametrize("what", COMMANDS)
def test_a_file_where_the_folder_should_be(what: str, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("in the way", encoding="utf-8")
    done = commands.compare(*COMMANDS[what], cwd=tmp_path)
    refused(done, "out")
    assert contents(tmp_path) == {"out": b"in the way"}


def test_the_option_that_names_the_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("in the way", encoding="utf-8")
    assert "--baselines out" in commands.compare(*COMMANDS["baseline"], cwd=tmp_path).stderr
    assert "--reports out" in commands.evidence("validation", "update", "--reports", "out", cwd=tmp_path).stderr


@posix
@pytest.mark.parametrize("what", first_of(COMMANDS))
def test_a_folder_that_may_only_be_read(what: str, tmp_path: Path) -> None:
    """A read-only mount, which stops the superuser too; where it takes more rights than we have, the folder's own."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "earlier.txt").write_text("whole", encoding="utf-8")
    mounted = (
        subprocess.run(["mount", "--bind", "-o", "ro", str(out), str(out)], capture_output=True, check=False).returncode
        == 0
    )
    if not mounted:
        out.chmod(0o500)
        if os.access(out, os.W_OK):
            pytest.skip("this user may write anywhere, and cannot mount a folder that nobody may write to")
    try:
        done = compare(tmp_path, COMMANDS[what])
    finally:
        if mounted:
            subprocess.run(["umount", str(out)], check=True)
        out.chmod(0o700)
    refused(done, "out")
    assert contents(tmp_path) == {"out/earlier.txt": b"whole"}


REFUSED = [
    "--simulator mujoco --case crank-rocker --joint contact --out out",
    "accuracy --clearance B=0.05 --out out",
    "analyse --angles 20:200:5 --out out",
    "simulate --simulator mujoco --joint contact --case crank-rocker --out out",
    "validity --speeds 60 --clearances 0.05 --out out",
    "check none.csv --out out",
    "export --simulator mujoco --joint contact --case crank-rocker --out out/deep",
    "import none.xml --out out/linkage.toml",
    "diagnose none.toml --out out",
    "diagnose --init none.csv --case paper --out out",
    "baseline update --case none.toml --baselines out",
    "baseline update --case paper --simulator adams --baselines out/deep",
    "baseline update --case paper --results none.csv --baselines out",
    "baseline check --case none.toml --junit out/junit.xml",
]
EVIDENCE = ["scoreboard update --minutes 0 --reports out", "validation update --data none --reports out"]


@pytest.mark.mujoco
@pytest.mark.parametrize("line", [*REFUSED, *EVIDENCE])
def test_a_command_that_is_refused_leaves_no_folder_but_of_the_junit_file_asked_for(line: str, tmp_path: Path) -> None:
    command = commands.evidence if line in EVIDENCE else commands.compare
    done = command(*line.split(), cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert list(tmp_path.iterdir()) == ([tmp_path / "out"] if "--junit" in line else [])
    assert contents(tmp_path).keys() == ({"out/junit.xml"} if "--junit" in line else set())


# ---------------------------------------------------------------- no room


@posix
@pytest.mark.parametrize("what", first_of(LARGE))
def test_a_disk_that_is_full_from_the_start_leaves_nothing(what: str, tmp_path: Path) -> None:
    done = compare(tmp_path, COMMANDS[what], limit=500)
    refused(done, tempfile.gettempdir() if what == "export" else "out")  # an engine drafts its export's files there
    left = {name: content for name, content in contents(tmp_path).items() if not name.startswith("out/runs/")}
    assert left == {}


@posix
@pytest.mark.slow
@pytest.mark.parametrize("room", [20_000, 1_000, 60_000])
def test_a_disk_that_fills_up_leaves_the_earlier_result_as_it_was(room: int, tmp_path: Path) -> None:
    assert compare(tmp_path, CROSSCHECK).returncode == 0
    before = contents(tmp_path)
    assert max(map(len, before.values())) > room
    other = [*CROSSCHECK[:5], "20:100:20", *CROSSCHECK[6:]]
    other.append("--overwrite")
    refused(compare(tmp_path, other, limit=room), "out")
    assert contents(tmp_path) == before
    assert compare(tmp_path, other).returncode == 0
    assert contents(tmp_path)["out/result.json"] != before["out/result.json"]


@pytest.mark.slow
@posix
def test_a_real_full_file_system_is_said_and_left_without_litter(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(out)], capture_output=True, check=False
    ).returncode:
        pytest.skip("mounting a file system takes more rights than this user has")
    try:
        done = compare(tmp_path, CROSSCHECK)
        left = contents(out)
    finally:
        subprocess.run(["umount", str(out)], check=True)
    refused(done, "out/")
    assert "No space left on device" in done.stderr
    assert left == {}


@posix
@pytest.mark.slow
def test_a_map_whose_records_find_no_room_goes_on_once_there_is(tmp_path: Path) -> None:
    refused(compare(tmp_path, COMMANDS["validity"], limit=500), "out/runs")
    assert compare(tmp_path, COMMANDS["validity"]).returncode == 0
    assert set(contents(tmp_path)) == {f"out/validity.{kind}" for kind in ("csv", "json", "md", "svg")}


# ---------------------------------------------------------------- two at once


def both(folder: Path, first: list[str], second: list[str]) -> list[tuple[int, str]]:
    """Two commands in one folder at once: status and standard error of each."""
    started = [
        subprocess.Popen(
            [sys.executable, "-m", "compare", *arguments],
            cwd=folder,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        for arguments in (first, second)
    ]
    said = [process.communicate(timeout=300)[1] for process in started]
    return [(process.returncode, words) for process, words in zip(started, said, strict=True)]


@pytest.mark.slow
def test_two_cross_checks_into_one_folder_leave_one_of_them_whole(tmp_path: Path) -> None:
    one, other = CROSSCHECK, ["--case", "crank-rocker", *CROSSCHECK]
    whole = {}
    for name, command in (("one", one), ("other", other)):
        (tmp_path / name).mkdir()
        compare(tmp_path / name, command)
        whole[name] = set(contents(tmp_path / name))
    ends = both(tmp_path, one, other)
    assert sorted(status for status, _ in ends) == [0, 2], ends
    assert ["its result.json is of another command" in words for _, words in ends] == [
        status == 2 for status, _ in ends
    ]
    (wrote,) = [name for name, (status, _) in zip(whole, ends, strict=True) if status == 0]
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    case = result["case"]
    assert all(
        case in (tmp_path / "out" / name).read_text(encoding="utf-8")
        for name in ("report.md", "report.html", "junit.xml")
    )
    assert {name for name in contents(tmp_path) if name.startswith("out/")} == whole[wrote]


@pytest.mark.slow
def test_a_second_map_in_the_same_folder_is_refused_and_the_first_is_whole(tmp_path: Path) -> None:
    ends = both(tmp_path, COMMANDS["validity"], COMMANDS["validity"])
    statuses = sorted(status for status, _ in ends)
    assert statuses in ([0, 2], [0, 0])  # the second may come when the first has gone
    for status, words in ends:
        if status == 2:
            assert "--out out: another run is writing there; wait for it, or choose another folder with --out" in words
            assert "Traceback" not in words
    assert set(contents(tmp_path)) == {f"out/validity.{kind}" for kind in ("csv", "json", "md", "svg")}
    json.loads((tmp_path / "out" / "validity.json").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_two_baselines_of_one_case_at_once_are_one_whole_file(tmp_path: Path) -> None:
    ends = both(tmp_path, COMMANDS["baseline"], COMMANDS["baseline"])
    assert [status for status, _ in ends] == [0, 0], ends
    assert set(contents(tmp_path)) == {"out/pendulum-mujoco.toml"}
    assert compare(tmp_path, ["baseline", "check", *COMMANDS["baseline"][2:]]).returncode == 0


@pytest.mark.skipif(os.name != "posix", reason="folders have locks there")
def test_a_folder_is_held_by_one_at_a_time_and_let_go(tmp_path: Path) -> None:
    with alone_in(tmp_path):
        with pytest.raises(OutputError, match="another run is writing there"), alone_in(tmp_path, patience=0.0):
            pytest.fail("two hold the folder at once")
        release = threading.Event()

        def wait() -> None:
            with alone_in(tmp_path, patience=30.0):
                release.set()

        waiting = threading.Thread(target=wait)
        waiting.start()
        time.sleep(0.2)
        assert not release.is_set()
    waiting.join(30)
    assert release.is_set()


@posix
@pytest.mark.parametrize("mask", [0o077, 0o022, 0o002])
def test_who_may_read_a_file_is_left_to_the_umask(mask: int, tmp_path: Path) -> None:
    before = os.umask(mask)
    try:
        write_together(tmp_path, {"new": "1", "old": "1"})
        write_together(tmp_path, {"old": "2"})
        with made_folder(tmp_path / "made" / "deep") as folder:
            write_atomically(folder / "inside", "1")
    finally:
        os.umask(before)
    for path in tmp_path.rglob("*"):
        assert path.stat().st_mode & 0o777 == (0o777 if path.is_dir() else 0o666) & ~mask


def test_files_that_are_written_together_are_never_half_and_never_litter(tmp_path: Path) -> None:
    (tmp_path / "second").mkdir()
    write_atomically(tmp_path / "first", "old")
    with pytest.raises(OutputError, match="second"):
        write_together(tmp_path, {"second": "a folder is in the way", "first": "new"})
    assert contents(tmp_path) == {"first": b"old"}
    write_together(tmp_path, {"first": "new", "third": "new"})
    assert contents(tmp_path) == {"first": b"new", "third": b"new"}
    write_together(tmp_path, {"first": "newer"}, gone=["third", "fourth"])
    assert contents(tmp_path) == {"first": b"newer"}
