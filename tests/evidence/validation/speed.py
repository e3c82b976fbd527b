"""How fast positions, rates and all reactions are computed, and workspaces mapped: figures of one machine and run."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from analytic.compiled.run import CALLS
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics, kinematics_by_numpy
from analytic.mechanism.file import load
from analytic.paper.kinetostatics import kinetostatics, kinetostatics_by_numpy
from compare.platform import platform_accuracy
from tests.evidence.results.validation import Timed
from tests.evidence.validation.workspaces import loose

CRANK, COUPLER, FOLLOWER, GROUND = 0.05, 0.12, 0.10, 0.12  # m, of the shipped crank-rocker
SPEED = 31.41592653589793  # rad/s
BATCH, TRAJECTORY, MAP = 10_000, 100_000, 200
SIDE = 0.2  # m, half of the mapped square
STEP = 1e-4  # rad, of the mapped platform's encoders
Work = Callable[[], object]


def crank_rocker(count: int) -> Work:
    """Positions, velocities, accelerations, all reactions and the drive torque over one revolution."""
    assembly, theta = Assembly(load("crank-rocker")), np.arange(count) * (2 * np.pi / count)
    return lambda: kinetostatics(kinematics(assembly, theta, SPEED))


def by_numpy(count: int) -> Work:
    """The same without the compiled code."""
    assembly, theta = Assembly(load("crank-rocker")), np.arange(count) * (2 * np.pi / count)
    return lambda: kinetostatics_by_numpy(kinematics_by_numpy(assembly, theta, SPEED))


def parallel(count: int) -> Work:
    """A 3-RRR followed along a trajectory of several minutes: positions, rates, all reactions, three torques."""
    assembly, t = Assembly(load("3-rrr")), np.arange(count) * 2e-3
    at = assembly.positions
    inputs = assembly.inputs_at({name: at[name] + 0.2 * (np.sin(t + k) - np.sin(k)) for k, name in enumerate(at)})
    rates = assembly.inputs_at({name: 0.2 * np.cos(t + k) for k, name in enumerate(at)})
    return lambda: kinetostatics(kinematics(assembly, inputs, rates))


def pylinkage(count: int) -> Work:
    """The crank-rocker's positions alone, by that package's compiled solver.  Raises ImportError."""
    from pylinkage import Crank, Ground, RRRDyad
    from pylinkage.simulation import Linkage

    near, far = Ground(0.0, 0.0), Ground(GROUND, 0.0)
    crank = Crank(near, CRANK, 2 * np.pi / count)
    linkage = Linkage([near, far, crank, RRRDyad(crank.output, far, COUPLER, FOLLOWER)])
    linkage.compile()
    return lambda: linkage.step_fast(count)


def best(works: Mapping[str, tuple[Work, int]]) -> dict[str, float]:
    """Microseconds per configuration, the best of five turns of three calls each, all in turn so that they see the same
    machine: a turn's first call has others' memory to clear.
    """
    found = dict.fromkeys(works, np.inf)
    for _ in range(5):
        for name, (work, count) in works.items():
            for _ in range(3):
                start = time.perf_counter()
                work()
                found[name] = min(found[name], (time.perf_counter() - start) / count * 1e6)
    return found


def beyond_results(work: Work) -> float:
    """MB at the most that a call needs beside what it returns."""
    tracemalloc.start()
    kept = work()
    now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del kept
    return (peak - now) / 1e6


def timed() -> tuple[Timed, ...]:
    """The figures, measured now; without pylinkage there is no ratio to it."""
    return tuple(_timed())


def _timed() -> Iterator[Timed]:
    works = {"one": (crank_rocker(1), 1), "batch": (crank_rocker(BATCH), BATCH), "numpy": (by_numpy(BATCH), BATCH)}
    works["3-RRR"] = parallel(TRAJECTORY), TRAJECTORY
    try:
        works["pylinkage"] = pylinkage(BATCH), BATCH
    except ImportError:
        pass
    for _ in range(CALLS):
        works["one"][0]()  # after so many the compiled code serves
    each = best(works)
    every = "positions, rates, all reactions and torque of the crank-rocker"
    batches = f"in batches of {BATCH}"
    yield _row(f"{every}, {batches}", each["batch"], "us")
    if "pylinkage" in works:
        ratio = each["batch"] / each["pylinkage"]
        yield _row(f"the same over pylinkage's compiled positions alone, {batches}", ratio, "", 1.0)
    yield _row("the same over its referee in numpy", each["batch"] / each["numpy"], "")
    yield _row(f"{every}, one configuration", each["one"], "us", 60.0)
    yield _row("3-RRR along a trajectory, all reactions and torques, each pose", each["3-RRR"], "us", 10.0)
    largest = max(beyond_results(works[name][0]) for name in ("batch", "3-RRR"))
    yield _row(f"memory beside the results, {batches} and of {TRAJECTORY}", largest, "MB", 1.0)
    yield _row(f"workspace of a 3-RRR at {MAP} x {MAP} poses with all errors", _map(), "s", 60.0)


def _map() -> float:
    """Seconds that the map of a workspace takes: clearance in every pin, compliance, encoder steps."""
    m = loose(load("3-rrr"))
    steps = {drive.joint: STEP for drive in m.drives}
    start = time.perf_counter()
    platform_accuracy(m, outputs="platform", encoder_step=steps, workspace=((-SIDE, SIDE, MAP), (-SIDE, SIDE, MAP)))
    return time.perf_counter() - start


def _row(what: str, value: float, unit: str, wanted: float | None = None) -> Timed:
    return Timed(what=what, value=float(f"{value:.3g}"), unit=unit, wanted=wanted)
