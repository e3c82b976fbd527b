"""Our kinematics with all reactions beside two other Python packages' kinematics alone: ratios in one run.

Run with ``pip install '.[bench]'`` and ``python -m tests.bench_against``.  The linkage is the shipped crank-rocker over
one revolution; each figure is the best of five turns of three calls, all in turn so that they see the same machine.
Beside them a 3-RRR with all reactions along a long trajectory, and the memory that a batch needs beyond its results.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from analytic.compiled.run import CALLS
from tests.evidence.validation.speed import (
    COUPLER,
    CRANK,
    FOLLOWER,
    GROUND,
    SPEED,
    best,
    beyond_results,
    by_numpy,
    crank_rocker,
    parallel,
    pylinkage,
)

COUNTS = (1, 100, 10_000, 1_000_000)


def mechanism(count: int) -> Callable[[], object]:
    """Positions, velocities and accelerations, by fsolve at each angle."""
    from mechanism import Mechanism, Vector, get_joints

    d, a, b, e = get_joints("D A B E")
    crank, coupler, follower = Vector((d, a), r=CRANK), Vector((a, b), r=COUPLER), Vector((e, b), r=FOLLOWER)
    ground = Vector((d, e), r=GROUND, theta=0, style="ground")

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


def main() -> None:
    """Print the table."""
    works = {f"ours, {count}": (crank_rocker(count), count) for count in COUNTS}
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
