"""Batches in a fresh process, the harness beside the bare engine, one worker beside two: tables of ratios.

Run ``python tests/bench_ratios.py batches``, ``harness`` or ``sweep``.  What is compared is measured in turn, several
times over, and the least of each counts.  Times are the processor's, which other work on the machine lengthens less
than the clock's.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable

import numpy as np

from asked import request_of

COUNTS = (1, 10, 100, 1_000, 10_000, 100_000, 1_000_000)
TURNS = 3
TWO_PI = 2 * np.pi


def seconds(work: Callable[[], object]) -> float:
    """Processor time (s) of one call."""
    start = time.process_time()
    work()
    return time.process_time() - start


# ---------------------------------------------------------------- batches


def batch(count: int) -> None:
    """In a fresh process: microseconds a configuration of the crank-rocker for the first call, for the second, and for
    the best of the next.
    """
    from analytic.kinematics.assembly import Assembly
    from analytic.kinematics.motion import kinematics
    from analytic.mechanism.file import load
    from analytic.paper.kinetostatics import kinetostatics

    m = load("crank-rocker")
    assembly, theta = Assembly(m), np.arange(count) * (TWO_PI / count)
    turns = 2 + max(8, 3000 // count)
    first, second, *others = [
        seconds(lambda: kinetostatics(kinematics(assembly, theta, m.speed or 0.0))) for _ in range(turns)
    ]
    print(*(spent / count * 1e6 for spent in (first, second, min(others))))


def batches() -> None:
    """Kinematics and all reactions, from one configuration to a million."""
    print("| configurations | first call of a process | second | warm |\n|--:|--:|--:|--:|")
    for count in COUNTS:
        runs = [
            subprocess.run([sys.executable, __file__, "batch", str(count)], capture_output=True, text=True, check=True)
            for _ in range(TURNS)
        ]
        best = np.min([[float(x) for x in run.stdout.split()] for run in runs], axis=0)
        print(f"| {count:,} |", " | ".join(f"{x:.3g}" for x in best), "| us per configuration")


# ---------------------------------------------------------------- harness


def harness() -> None:
    """A driven MuJoCo run beside nothing but the steps that it took: same model, same number and sizes of steps."""
    from analytic.mechanism.file import load
    from sim_models.engine import JOINT_MODELS, Request
    from sim_models.mujoco.march import MujocoSteps
    from sim_models.mujoco.runs import MujocoRun
    from sim_models.mujoco.state import advance

    def bare(record: MujocoSteps) -> None:
        m, d = record.link.model, record.link.data
        d.qpos[:], d.qvel[:] = record.q, record.v
        for count, m.opt.timestep, _ in record.stages:
            advance(record.link, count)

    def whole(request: Request) -> MujocoRun:
        run = MujocoRun(request)
        run.trace()
        return run

    m = load("crank-rocker").with_clearances({"B": 2e-4})
    once = np.radians(np.arange(0.0, 360.0, 5.0))
    print(
        "| joint model | revolutions before the reports | steps | all | steps alone | ratio | start, of all"
        " |\n|---|--:|--:|--:|--:|--:|--:|"
    )
    for model in JOINT_MODELS:
        for revolutions in (0, 1, 10):
            request = request_of(m, model, "driven", once, lead_in=revolutions * TWO_PI)
            nowhere = request_of(m, model, "driven", once[:1])  # the start, and no step
            record = whole(request).record
            steps = sum(count for count, *_ in record.stages)
            works = (lambda r=request: whole(r)), (lambda r=record: bare(r)), (lambda r=nowhere: whole(r))
            total, alone, start = np.min([[seconds(work) for work in works] for _ in range(TURNS)], axis=0) * 1e3
            print(
                f"| {model} | {revolutions} | {steps} | {total:.0f} ms | {alone:.0f} ms | {total / alone:.2f} |"
                f" {start:.0f} ms |",
                flush=True,
            )


# ---------------------------------------------------------------- sweep


def sweep() -> None:
    """A validity map's cells on one worker and on two: both new for each turn, as a command's are."""
    from analytic.mechanism.file import load
    from compare.domain_map.cell import examine
    from compare.domain_map.map import MapPlan, cells
    from compare.judge.tolerances import load_tolerances
    from compare.report.words.validity import RPM
    from compare.sweep import sweep as spread

    speeds, sizes = (30, 45, 60, 90, 120, 180, 240, 300), (1e-4, 2e-4, 4e-4)
    grid = MapPlan(
        load("crank-rocker"),
        ("B",),
        tuple(rpm * RPM for rpm in speeds),
        sizes,
        ("mujoco",),
        "contact",
        load_tolerances(None),
    )
    runs = cells(grid)
    list(spread(examine, runs[:1]))  # imports
    clock, processor = {1: np.inf, 2: np.inf}, {1: np.inf, 2: np.inf}
    for _ in range(TURNS):
        for workers in clock:
            start, before = time.perf_counter(), os.times()
            failures = [end.failure for end in spread(examine, runs, workers=workers) if end.failure]
            spent, after = time.perf_counter() - start, os.times()
            assert not failures, failures[0]
            clock[workers] = min(clock[workers], spent)
            processor[workers] = min(processor[workers], sum(after[:4]) - sum(before[:4]))
    for workers, spent in clock.items():
        print(f"{len(runs)} cells, {workers} worker(s): {spent:.1f} s, {processor[workers]:.1f} s of processors")
    print(
        f"ratio {clock[1] / clock[2]:.2f}; at most {2 * processor[1] / processor[2]:.2f} if nothing else ran on two"
        " processors"
    )


if __name__ == "__main__":
    if sys.argv[1] == "batch":
        batch(int(sys.argv[2]))
    else:
        {"batches": batches, "harness": harness, "sweep": sweep}[sys.argv[1]]()
