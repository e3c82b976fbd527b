"""Our kinematics with all reactions beside two other Python packages' kinematics alone: ratios in one run.

Run with ``pip install '.[bench]'`` and ``python tests/bench_against.py``.  The linkage is the shipped crank-rocker over
one revolution; each figure is the best of five turns of three calls, all in turn so that they see the same machine.
Beside them a 3-RRR with all reactions along a long trajectory, and the memory that a batch needs beyond its results.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable

import numpy as np

from analytic.compiled.run import CALLS
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics, kinematics_by_numpy
from analytic.mechanism.file import load
from analytic.paper.kinetostatics import kinetostatics, kinetostatics_by_numpy

R2, R3, R4, R1 = 0.05, 0.12, 0.10, 0.12
SPEED = 31.41592653589793
COUNTS = (1, 100, 10_000, 1_000_000)


def ours(count: int) -> Callable[[], object]:
    """Positions, velocities, accelerations, all reactions and the drive torque."""
    assembly, theta = Assembly(load("crank-rocker")), np.arange(count) * (2 * np.pi / count)
    return lambda: kinetostatics(kinematics(assembly, theta, SPEED))


def by_numpy(count: int) -> Callable[[], object]:
    """The same without the compiled code."""
    assembly, theta = Assembly(load("crank-rocker")), np.arange(count) * (2 * np.pi / count)
    return lambda: kinetostatics_by_numpy(kinematics_by_numpy(assembly, theta, SPEED))


def parallel(count: int) -> Callable[[], object]:
    """A 3-RRR followed along a trajectory of several minutes: positions, rates, all reactions, three torques."""
    assembly, t = Assembly(load("3-rrr")), np.arange(count) * 2e-3
    at = assembly.positions
    inputs = assembly.inputs_at({name: at[name] + 0.2 * (np.sin(t + k) - np.sin(k)) for k, name in enumerate(at)})
    rates = assembly.inputs_at({name: 0.2 * np.cos(t + k) for k, name in enumerate(at)})
    return lambda: kinetostatics(kinematics(assembly, inputs, rates))


def beyond_results(work: Callable[[], object]) -> float:
    """MB at the most that a call needs beside what it returns."""
    tracemalloc.start()
    kept = work()
    now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del kept
    return (peak - now) / 1e6


def pylinkage(count: int) -> Callable[[], object]:
    """Positions only, by its compiled solver where numba is installed."""
    from pylinkage import Crank, Ground, RRRDyad
    from pylinkage.simulation import Linkage

    near, far = Ground(0.0, 0.0), Ground(R1, 0.0)
    crank = Crank(near, R2, 2 * np.pi / count)
    linkage = Linkage([near, far, crank, RRRDyad(crank.output, far, R3, R4)])
    linkage.compile()
    return lambda: linkage.step_fast(count)


def mechanism(count: int) -> Callable[[], object]:
    """Positions, velocities and accelerations, by fsolve at each angle."""
    from mechanism import Mechanism, Vector, get_joints

    d, a, b, e = get_joints("D A B E")
    crank, coupler, follower = Vector((d, a), r=R2), Vector((a, b), r=R3), Vector((e, b), r=R4)
    ground = Vector((d, e), r=R1, theta=0, style="ground")

    def loops(x: np.ndarray, i: float) -> np.ndarray:
        return np.asarray(crank(i) + coupler(x[0]) - follower(x[1]) - ground()).flatten()

    theta = np.arange(count) * (2 * np.pi / count)
    found = Mechanism(
        vectors=[crank, coupler, follower, ground],
        origin=d,
        loops=loops,
        pos=theta,
        vel=np.full(count, SPEED),
        acc=np.zeros(count),
        guess=(np.array([0.98, 1.61]), np.array([1.0, 1.0]), np.array([1.0, 1.0])),
    )
    return found.iterate


def best(works: dict[str, tuple[Callable[[], object], int]]) -> dict[str, float]:
    """Microseconds per configuration, the best of five turns of three calls each: a turn's first call has others'
    memory to clear.
    """
    found = dict.fromkeys(works, np.inf)
    for _ in range(5):
        for name, (work, count) in works.items():
            for _ in range(3):
                start = time.perf_counter()
                work()
                found[name] = min(found[name], (time.perf_counter() - start) / count * 1e6)
    return found


def main() -> None:
    """Print the table."""
    works = {f"ours, {count}": (ours(count), count) for count in COUNTS}
    works |= {f"by numpy, {count}": (by_numpy(count), count) for count in COUNTS[:3]}
    works["3-RRR, 100000"] = parallel(100_000), 100_000
    for name in ("ours, 1", "ours, 100"):
        for _ in range(CALLS):
            works[name][0]()  # after so many the compiled code serves
    others = {"pylinkage, 10000": (pylinkage, 10_000), "mechanism, 100": (mechanism, 100)}
    for name, (make, count) in others.items():
        try:
            works[name] = (make(count), count)
        except ImportError as missing:
            print(f"{name}: {missing}; pip install '.[bench]'")
    found = best(works)
    for name, each in found.items():
        print(
            f"{name:20} {each:10.3f} us per configuration, {each / found['ours, 10000']:8.1f} x ours in batches of"
            " 10 000"
        )
    if "pylinkage, 10000" in found:
        ratio = found["ours, 10000"] / found["pylinkage, 10000"]
        print(f"ours with all reactions over pylinkage's positions alone, batches of 10 000: {ratio:.2f}")
    for name in ("ours, 10000", "ours, 1000000", "3-RRR, 100000"):
        print(f"{name:20} {beyond_results(works[name][0]):10.3f} MB beyond its results")


if __name__ == "__main__":
    main()
