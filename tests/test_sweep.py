"""Many runs: the same numbers from any number of workers, nothing lost or repeated after a kill, and one bad run stays
alone.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import weakref
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import linkage_crosscheck as lc
import sweep_work
from analytic.mechanism.file import load
from asked import request_of
from compare.domain_map.cell import examine
from compare.domain_map.map import MapPlan, cells
from compare.judge.tolerances import load_tolerances
from compare.report.words.validity import RPM
from compare.results.crosscheck import Failure
from compare.simulations import simulate_all
from compare.sweep import RUNS_AHEAD, ClusterError, SweepOutcome, sweep
from marks import slow

HERE = Path(__file__).parent
POSIX = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system has no SIGKILL")
MATRICES = [{"seed": seed, "size": 40 + 20 * (seed % 3)} for seed in range(24)]


def in_order(outcomes: Iterator[SweepOutcome]) -> list[SweepOutcome]:
    return sorted(outcomes, key=lambda outcome: outcome.index)


def results(outcomes: Iterator[SweepOutcome]) -> str:
    """Every result to the last bit, in the order of the runs."""
    found = in_order(outcomes)
    assert [outcome.index for outcome in found] == list(range(len(found)))
    assert not [outcome.failure for outcome in found if outcome.failure]
    return json.dumps([outcome.result for outcome in found])


@pytest.mark.slow
def test_a_process_that_grows_is_replaced_and_the_sweep_goes_on() -> None:
    """300 MB are the most that it may grow by; warnings are errors here, as they may be where a user says so."""
    runs = [{"megabytes": 200, "seconds": 1.2, "run": k} for k in range(12)]
    found = in_order(sweep(sweep_work.growing, runs, workers=2))
    assert [outcome.failure for outcome in found] == [""] * len(runs)
    assert len({json.dumps(outcome.result) for outcome in found}) > 2


# ---------------------------------------------------------------- the same numbers


@pytest.mark.slow
@pytest.mark.parametrize("workers", [2, *slow(3)])
def test_the_numbers_are_the_same_whatever_the_number_of_workers(workers: int) -> None:
    assert results(sweep(sweep_work.solve, MATRICES, workers=workers)) == results(sweep(sweep_work.solve, MATRICES))


def test_the_numbers_are_the_same_from_the_folder(tmp_path: Path) -> None:
    fresh = results(sweep(sweep_work.solve, MATRICES, tmp_path))
    again = in_order(sweep(sweep_work.solve, MATRICES, tmp_path))
    assert all(outcome.recorded for outcome in again)
    assert json.dumps([outcome.result for outcome in again]) == fresh


def test_linear_algebra_in_a_worker_uses_one_thread() -> None:
    (outcome,) = sweep(sweep_work.threads, [{"seed": 0}], workers=2)
    assert set(outcome.result.values()) == {"1"}


def test_progress_counts_every_run_recorded_ones_too(tmp_path: Path) -> None:
    list(sweep(sweep_work.solve, MATRICES[:3], tmp_path))
    told: list[tuple[int, int | None]] = []
    list(sweep(sweep_work.solve, MATRICES[:5], tmp_path, progress=lambda done, total: told.append((done, total))))
    assert told == [(k, 5) for k in range(6)]


# ---------------------------------------------------------------- bad runs


def trouble(*kinds: str) -> list[dict[str, Any]]:
    return [{"seed": seed, "trouble": kind} for seed, kind in enumerate(kinds)]


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_run_that_raises_is_reported_and_the_others_are_done(workers: int, tmp_path: Path) -> None:
    found = in_order(sweep(sweep_work.troubled, trouble("no", "raise", "no", "no"), tmp_path, workers=workers))
    assert [outcome.failure for outcome in found] == ["", "ValueError: run 1 is no good", "", ""]
    assert [outcome.result for outcome in found] == [{"seed": 0}, None, {"seed": 2}, {"seed": 3}]
    assert len(list(tmp_path.iterdir())) == 3  # it is tried again the next time
    again = in_order(sweep(sweep_work.troubled, trouble("no", "raise", "no", "no"), tmp_path, workers=workers))
    assert [outcome.recorded for outcome in again] == [True, False, True, True]


@POSIX
@pytest.mark.slow
def test_a_run_that_kills_its_process_is_reported_and_the_others_are_done(tmp_path: Path) -> None:
    kinds = ["no"] * 3 + ["die"] + ["no"] * 4 + ["die"] + ["no"] * 3
    found = in_order(sweep(sweep_work.troubled, trouble(*kinds), tmp_path, workers=2))
    assert ["die" if "died" in outcome.failure else "no" for outcome in found] == kinds
    assert [outcome.result for outcome in found] == [
        None if kind == "die" else {"seed": seed} for seed, kind in enumerate(kinds)
    ]


@POSIX
def test_an_engine_that_kills_its_process_is_a_failed_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("compare.simulations._simulate", sweep_work.die_on_spring_damper)
    tasks = [("mujoco", request_of(load("paper"), model)) for model in ("ideal", "spring-damper", "massless-link")]
    found = dict(simulate_all(tasks, workers=2))
    assert sorted(found) == [0, 1, 2]
    assert isinstance(found[1], Failure)
    assert "mujoco spring-damper driven" in found[1].why
    assert "died" in found[1].why
    assert [found[0], found[2]] == ["ideal", "massless-link"]


# ---------------------------------------------------------------- the folder


def test_a_record_is_of_the_whole_content_and_nothing_else(tmp_path: Path) -> None:
    list(sweep(sweep_work.solve, [{"seed": 1, "size": 5}], tmp_path))
    (other,) = sweep(sweep_work.solve, [{"seed": 1, "size": 6}], tmp_path)
    (same,) = sweep(sweep_work.solve, [{"size": 5, "seed": 1}], tmp_path)
    assert not other.recorded
    assert same.recorded


@pytest.mark.parametrize("text", ["", '{"run": {"seed": 1', '{"run": {"seed": 2, "size": 5}, "result": 0}', "[]"])
def test_a_file_that_is_no_record_of_the_run_is_made_again(text: str, tmp_path: Path) -> None:
    (first,) = sweep(sweep_work.solve, [{"seed": 1, "size": 5}], tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_text(text, encoding="utf-8")
    (again,) = sweep(sweep_work.solve, [{"seed": 1, "size": 5}], tmp_path)
    assert not again.recorded
    assert again.result == first.result
    assert json.loads(path.read_text(encoding="utf-8"))["run"] == {"seed": 1, "size": 5}


class Run(dict[str, Any]):
    """A run whose life can be watched."""


class Alive:
    """How many of the things that were added still exist."""

    def __init__(self) -> None:
        self.count = 0

    def add(self, thing: object) -> None:
        self.count += 1
        weakref.finalize(thing, self.gone).atexit = False

    def gone(self) -> None:
        self.count -= 1


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_memory_holds_only_the_runs_under_way(workers: int, tmp_path: Path) -> None:
    runs, ends = Alive(), Alive()

    def told() -> Iterator[Run]:
        for seed in range(300):
            run = Run(seed=seed, trouble="no")
            runs.add(run)
            yield run

    seen = []
    for _ in range(2):  # made, and then found in the folder
        for outcome in sweep(sweep_work.troubled, told(), tmp_path, workers=workers):
            ends.add(outcome)
            seen.append((runs.count, ends.count))
    assert len(seen) == 600
    assert max(count for count, _ in seen) <= RUNS_AHEAD * workers + 2
    assert max(count for _, count in seen) <= 2


# ---------------------------------------------------------------- interruptions

SCRIPT = """
import sys
import sweep_work
from pathlib import Path
from compare.sweep import sweep
folder, log, workers = sys.argv[1:]
runs = [{"seed": seed, "log": log, "seconds": 0.02} for seed in range(40)]
for outcome in sweep(sweep_work.logged, runs, Path(folder), workers=int(workers)):
    print(outcome.index, outcome.result["square"], outcome.recorded, flush=True)
"""


@pytest.mark.slow
@POSIX
@pytest.mark.parametrize("workers", [*slow(1), 2])
def test_a_killed_sweep_goes_on_where_it_stopped(workers: int, tmp_path: Path) -> None:
    folder, log = tmp_path / "runs", tmp_path / "log.txt"
    folder.mkdir()
    command = [sys.executable, "-c", SCRIPT, str(folder), str(log), str(workers)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(HERE), str(HERE.parent)])}
    running = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
    until = time.monotonic() + 60
    while len(list(folder.glob("*.json"))) < 12 and time.monotonic() < until:
        time.sleep(2e-3)
    running.kill()
    assert running.wait(60) == -signal.SIGKILL
    time.sleep(0.5)  # what its processes were doing, and nothing that they would have done
    kept = {path.name: path.read_bytes() for path in folder.glob("*.json")}
    assert 12 <= len(kept) < 40
    recorded = Counter(json.loads(content)["run"]["seed"] for content in kept.values())
    before = log.read_text(encoding="utf-8").split()
    resumed = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=True)
    lines = [line.split() for line in resumed.stdout.splitlines()]
    assert sorted(int(index) for index, *_ in lines) == list(range(40))  # none lost
    assert all(int(square) == int(index) ** 2 for index, square, _ in lines)
    assert {int(index) for index, _, known in lines if known == "True"} == set(recorded)
    again = log.read_text(encoding="utf-8").split()[len(before) :]
    assert Counter(map(int, again)) == Counter(
        set(range(40)) - set(recorded)
    )  # none that was recorded is repeated, each other once
    assert {name: (folder / name).read_bytes() for name in kept} == kept


# ---------------------------------------------------------------- Dask


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two workers of one thread each, every one a process of its own."""
    pytest.importorskip("dask.distributed", reason="Dask is not installed: pip install 'linkage-crosscheck[dask]'")
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(HERE), str(HERE.parent)])}
    started: list[subprocess.Popen[bytes]] = []

    def start(program: str, *arguments: str) -> None:
        command = [sys.executable, "-m", "dask", program, *arguments]
        started.append(
            subprocess.Popen(
                command, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
        )

    there = tmp_path / "scheduler.json"
    start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(there))
    try:
        until = time.monotonic() + 60
        while not there.exists() and time.monotonic() < until:
            time.sleep(0.05)
        address = json.loads(there.read_text(encoding="utf-8"))["address"]
        for name in ("one", "two"):
            start(
                "worker",
                address,
                "--name",
                name,
                "--nthreads",
                "1",
                "--no-nanny",
                "--no-dashboard",
                "--local-directory",
                str(tmp_path / name),
            )
        yield address, started[1:]
    finally:
        for process in reversed(started):
            process.kill()
            process.wait(60)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
def test_a_cluster_gives_the_same_numbers_though_a_worker_is_killed_half_way(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path
) -> None:
    address, workers = cluster
    log, folder = tmp_path / "log.txt", tmp_path / "runs"
    folder.mkdir()
    runs = [{"seed": seed, "log": str(log), "seconds": 0.05} for seed in range(40)]
    found = []
    for outcome in sweep(sweep_work.logged, runs, folder, dask=address):
        found.append(outcome)
        if len(found) == 20:
            workers[0].kill()
    assert workers[0].wait(60) == -signal.SIGKILL
    assert results(iter(found)) == json.dumps([{"seed": seed, "square": seed**2} for seed in range(40)])
    assert len(list(folder.glob("*.json"))) == 40
    assert all(
        outcome.recorded for outcome in sweep(sweep_work.logged, runs, folder)
    )  # a cluster's records are anybody's


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
def test_cells_of_a_map_are_the_same_to_the_last_bit_on_a_cluster_in_processes_and_here(
    cluster: tuple[str, list[subprocess.Popen[bytes]]],
) -> None:
    paper = load("paper")
    tasks = cells(
        MapPlan(paper, ("B",), (400 * RPM, 600 * RPM), (1e-4, 1e-2), ("mujoco",), "contact", load_tolerances())
    )
    runs = [task.model_dump() for task in tasks]
    here = results(sweep(examine, runs))
    assert results(sweep(examine, runs, workers=2)) == here
    assert results(sweep(examine, runs, dask=cluster[0])) == here


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
def test_points_of_a_sweep_over_fields_are_the_same_on_a_cluster_and_here(
    cluster: tuple[str, list[subprocess.Popen[bytes]]],
) -> None:
    fields = {"drive.speed": "30 rpm,300 rpm", "body.crank.length": [0.2, 0.9]}  # of which one does not assemble
    here = lc.sweep("paper", fields, workers=1)
    assert [bool(point.failure) for point in here.points] == [False, True] * 2
    assert lc.sweep("paper", fields, dask=cluster[0]).points == here.points


def test_a_cluster_that_is_not_there_is_told() -> None:
    pytest.importorskip("dask.distributed", reason="Dask is not installed: pip install 'linkage-crosscheck[dask]'")
    with pytest.raises(ClusterError, match=r"^dask: nowhere://x: no scheduler answers"):
        next(sweep(sweep_work.solve, MATRICES, dask="nowhere://x"))


def test_a_cluster_without_dask_installed_is_told_with_the_install_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    with pytest.raises(ClusterError, match=r"pip install 'linkage-crosscheck\[dask\]'"):
        next(sweep(sweep_work.solve, MATRICES, dask="tcp://localhost:8786"))
