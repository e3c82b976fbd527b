"""The real command killed without warning: what is there is whole, old or new, and nothing else looks like output."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from sim_models.engine import declared
from test_broken_engine import break_engine

KILLS = int(os.environ.get("KILLS", "4"))  # of each command; KILLS=20 is the whole evidence
RIG = Path(__file__).parents[1] / "docs" / "example-rig" / "measured.toml"
OVER = {"validity": ["--overwrite"], "diagnose": ["--overwrite"]}
OUTPUT = {".json", ".html", ".md", ".xml", ".svg", ".toml"}
COMMANDS = {
    "report": (
        ["--simulator", "mujoco", "--out", "out", "--overwrite"],
        ["--simulator", "mujoco", "--motion", "static", "--joint", "contact", "--out", "out"],
    ),
    "baseline": (["baseline", "update", "--case", "paper", "--simulator", "mujoco", "--baselines", "out"], []),
    "validity": (
        ["validity", "--case", "crank-rocker", "--speeds", "60,300,600", "--clearances", "1e-4", "--out", "out"],
        ["validity", "--case", "crank-rocker", "--speeds", "60", "--clearances", "1e-4", "--out", "out"],
    ),
    "diagnose": (["diagnose", str(RIG), "--exclude", "link_flexibility", "--out", "out"], []),
}

SLOW_DISK = """
import os, time
renamed = os.replace
def replace(*paths):
    time.sleep(0.02)
    renamed(*paths)
os.replace = replace
"""  # a sitecustomize.py, which Python runs as it starts

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system has no SIGKILL")]


def start(arguments: list[str], cwd: Path) -> subprocess.Popen[bytes]:
    """The command with MuJoCo alone: the others only take time, and are hidden by packages that cannot be imported."""
    cwd.mkdir(exist_ok=True)
    hidden = cwd.parent / "hidden"
    for name in ("exudyn", "pybullet", "dart"):
        if not (hidden / "broken" / declared(name).package).exists():
            break_engine(hidden, declared(name).package, "ImportError('hidden')")
    paths = [cwd.parent / "disk", hidden / "broken", Path(__file__).parents[1]]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, paths))}
    return subprocess.Popen(
        [sys.executable, "-m", "compare", *arguments],
        cwd=cwd,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=environment,
    )


def finished(arguments: list[str], cwd: Path) -> tuple[dict[str, bytes], float]:
    """Every file of an undisturbed run, and how long it took (s)."""
    began = time.perf_counter()
    assert start(arguments, cwd).wait(timeout=600) == 0
    return contents(cwd), time.perf_counter() - began


def contents(cwd: Path) -> dict[str, bytes]:
    return {str(path.relative_to(cwd)): path.read_bytes() for path in cwd.rglob("*") if path.is_file()}


def killed(arguments: list[str], cwd: Path, moment: Callable[[Path], None]) -> bool:
    """Start, wait for the moment, kill; whether it was still running."""
    running = start(arguments, cwd)
    try:
        moment(cwd)
    finally:
        running.kill()
    return running.wait(timeout=60) == -signal.SIGKILL


def check_whole(cwd: Path, *allowed: dict[str, bytes]) -> None:
    for name, content in contents(cwd).items():
        if Path(name).parent.name == "runs":  # a map's record of one cell, whole or still with a temporary name
            assert Path(name).name.startswith(".") or json.loads(content)["result"]
        elif Path(name).name.startswith("."):  # a temporary neighbour that was not yet renamed
            assert Path(name).suffix not in OUTPUT, f"{name} could be taken for output"
        else:
            assert content in [run[name] for run in allowed if name in run], (
                f"{name} is neither the old file nor the new one, whole"
            )


@pytest.mark.parametrize("what", COMMANDS)
def test_kills_at_random_moments_leave_only_whole_files(what: str, tmp_path: Path) -> None:
    command, older = COMMANDS[what]
    whole, first = finished(command, tmp_path / "undisturbed")
    seconds = min(
        first, finished([*command, *OVER.get(what, [])], tmp_path / "undisturbed")[1]
    )  # the first one fills caches
    old = (
        finished(older, tmp_path / "older")[0]
        if older
        else {name: b"# an older one\n" + text for name, text in whole.items()}
    )
    moments = random.Random(what)
    hits = 0
    for k in range(5 * KILLS):
        folder = tmp_path / f"kill-{k}"
        if k % 2:  # over what an earlier run has left
            for name, content in old.items():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_bytes(content)
        delay = moments.uniform(0.0, 1.0) * seconds
        met = killed(command, folder, lambda cwd, delay=delay: time.sleep(delay))
        check_whole(folder, whole, old)
        hits += met
        if hits == KILLS:
            break
        if not met:  # it was over already: the machine is quicker now than when it was timed
            seconds = min(seconds, delay)
    assert hits == KILLS


def test_kills_while_a_report_is_written_leave_only_whole_files(tmp_path: Path) -> None:
    """From the moment the first of its files shows up, which a random moment seldom meets, on a disk that is slow."""
    command, _ = COMMANDS["report"]
    whole, _ = finished(command, tmp_path / "undisturbed")
    (tmp_path / "disk").mkdir()
    (tmp_path / "disk" / "sitecustomize.py").write_text(SLOW_DISK, encoding="utf-8")
    moments = random.Random(4)
    met = 0
    for k in range(5):
        delay = moments.uniform(0.0, 0.1)

        def first_file(cwd: Path, delay: float = delay) -> None:
            until = time.perf_counter() + 60
            while not contents(cwd) and time.perf_counter() < until:
                time.sleep(1e-3)
            time.sleep(delay)

        killed(command, tmp_path / f"kill-{k}", first_file)
        check_whole(tmp_path / f"kill-{k}", whole)
        met += contents(tmp_path / f"kill-{k}") != whole
    assert met >= 3  # most were met between their first file and their last


@pytest.mark.parametrize("what", ["report", "baseline", "validity"])
def test_a_run_after_a_killed_one_succeeds_in_the_same_folder(what: str, tmp_path: Path) -> None:
    command, _ = COMMANDS[what]
    killed(command, tmp_path, lambda cwd: time.sleep(0.8))
    litter = tmp_path / "out" / ".result.json.left-over"
    litter.parent.mkdir(exist_ok=True)
    litter.write_text('{"half', encoding="utf-8")
    whole, _ = finished(command, tmp_path)
    assert not [name for name, content in whole.items() if not content]
    if what == "baseline":
        assert (
            start(
                ["baseline", "check", "--case", "paper", "--simulator", "mujoco", "--baselines", "out"], tmp_path
            ).wait(timeout=60)
            == 0
        )
