"""Cost per configuration and per step, printed by pytest-benchmark; nothing here judges time.

Run with ``pytest tests/bench_speed.py``.  ``extra_info`` holds microseconds per configuration or step.
"""

from __future__ import annotations

import subprocess
import sys
import timeit
from collections.abc import Callable

import numpy as np
import pytest

from analytic.compiled.run import CALLS
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics, kinematics_by_numpy
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from analytic.paper.compliance import compliance
from analytic.paper.kinetostatics import kinetostatics, kinetostatics_by_numpy
from asked import request_of
from sim_models.engine import engine


def report(benchmark, work: Callable[[], object], count: int, what: str) -> None:
    benchmark(work)
    each = benchmark.stats.stats.min / count * 1e6
    benchmark.extra_info[what] = each
    print(f"\n{benchmark.name}: {each:.3f} {what}")


@pytest.mark.parametrize("case", ["crank-rocker", "slider-crank", "six-bar"])
@pytest.mark.parametrize("count", [1, 100, 10_000])
def test_kinematics_and_all_reactions(benchmark, case: str, count: int) -> None:
    """By compiled code, and beside it by numpy."""
    m = load(case)
    assembly, theta, speed = Assembly(m), np.linspace(0.0, 6.2, count), m.speed or 0.0
    for _ in range(CALLS):
        kinematics(assembly, theta[:1])  # after so many the compiled code serves
    report(benchmark, lambda: kinetostatics(kinematics(assembly, theta, speed)), count, "us per configuration")
    spent = min(timeit.repeat(lambda: kinetostatics_by_numpy(kinematics_by_numpy(assembly, theta, speed)), number=1))
    benchmark.extra_info["of numpy's"] = ratio = benchmark.stats.stats.min / spent
    print(f"{benchmark.name}: {ratio:.3f} of numpy's")


@pytest.mark.parametrize("case", ["five-bar", "3-rrr", "3-rpr"])
def test_a_trajectory_of_several_drives(benchmark, case: str) -> None:
    """Followed, with all reactions; beside it by numpy, over its first hundredth."""
    m, t = load(case), np.arange(20_000) * 2e-3
    assembly, size = Assembly(m), 0.2 if case != "3-rpr" else 4e-3
    at = assembly.positions
    inputs = assembly.inputs_at({name: at[name] + size * (np.sin(t + k) - np.sin(k)) for k, name in enumerate(at)})
    rates = assembly.inputs_at({name: size * np.cos(t + k) for k, name in enumerate(at)})
    report(benchmark, lambda: kinetostatics(kinematics(assembly, inputs, rates)), t.size, "us per pose")
    few, fast = inputs[:, : t.size // 100], rates[:, : t.size // 100]
    spent = min(timeit.repeat(lambda: kinetostatics_by_numpy(kinematics_by_numpy(assembly, few, fast)), number=1))
    benchmark.extra_info["of numpy's"] = ratio = benchmark.stats.stats.min / (100 * spent)
    print(f"{benchmark.name}: {ratio:.3f} of numpy's")


def test_equilibrium_with_a_finite_gap(benchmark) -> None:
    assembly, theta = Assembly(load("paper")), np.linspace(0.4, 2.7, 10_000)
    report(benchmark, lambda: displaced(assembly, theta, 1.0, inertia=False), 10_000, "us per configuration")


@pytest.mark.parametrize("pins", ["B", "BE"])
def test_equilibrium_of_a_running_crank_rocker(benchmark, pins: str) -> None:
    m = load("crank-rocker")
    assembly, theta, gaps = Assembly(m), np.radians(np.linspace(0.0, 360.0, 721)), dict.fromkeys(pins, 2e-4)
    report(benchmark, lambda: displaced(assembly, theta, m.speed or 0.0, clearances=gaps), 721, "us per configuration")


@pytest.mark.parametrize("case", ["paper", "crank-rocker"])
def test_compliance_of_links_and_joints(benchmark, case: str) -> None:
    m = load(case)
    motion = kinematics(Assembly(m), np.linspace(0.4, 2.7, 721), m.speed or 0.0)
    report(benchmark, lambda: compliance(motion, inertia=True), 721, "us per configuration")


@pytest.mark.parametrize("joint_model", ["ideal", "massless-link", "spring-damper", "contact"])
def test_a_driven_mujoco_run(benchmark, joint_model: str) -> None:
    request = request_of(load("paper"), joint_model, "driven", np.radians(np.arange(20.0, 161.0, 5.0)))
    mujoco = engine("mujoco")
    steps = round(np.radians(140.0) / 1.5707963267948966 / mujoco.simulate(request).settings["step"])
    report(benchmark, lambda: mujoco.simulate(request), steps, "us per step")


def test_writing_the_report_of_two_engines(benchmark, tmp_path) -> None:
    from sample_result import sample_result, write_report

    result = sample_result("crank-rocker", {"B": 2e-4, "E": 1e-4}, ("mujoco", "exudyn"))
    report(benchmark, lambda: write_report(result, tmp_path), 1, "us per report")


@pytest.mark.parametrize("arguments", [["--help"], ["--simulator", "mujoco", "--out", "out"]], ids=["help", "main job"])
def test_the_whole_process(benchmark, arguments: list[str], tmp_path) -> None:
    command = [sys.executable, "-m", "compare", *arguments]
    report(
        benchmark, lambda: subprocess.run(command, cwd=tmp_path, capture_output=True, check=True), 1, "us per process"
    )
