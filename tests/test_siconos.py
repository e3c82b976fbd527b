"""Siconos' slider-crank with play in its guide (siconos-tutorials b6c9bfd1, mechanics/SliderCrank; Flores, Leine and
Glocker, Multibody Syst Dyn 23 (2010) 165): its published runs, Siconos itself, and what this mechanism does.

The published runs take steps of 0.1 ms, of first order where the mass changes.  These gain energy: 1 % before anything
is touched, and the crank ends at 120 rad/s where every method that keeps energy, or finer steps of the same one, end
at 71 rad/s.  So they are evidence of how Siconos steps, which is met to eight digits up to the first impact and to a
thousandth of the turns to the end, not of the mechanism.  Nor is the motion chaotic: starts that differ by 1e-6 end
1e-5 turns apart.  What sets the two published runs apart is how each puts corners back on the wall.

The data are not in the repository; the environment variable MEASURED_DATA names the folder that has them.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from marks import slow
from nonsmooth import Guide, compliant, time_stepping

DATA = Path(os.environ.get("MEASURED_DATA", "")) / "siconos-slider-crank"
published = pytest.mark.skipif(
    not (os.environ.get("MEASURED_DATA") and DATA.is_dir()),
    reason="MEASURED_DATA is not set, or has no siconos-slider-crank",
)
GUIDE = Guide(0.153, 0.306, (0.038, 0.038, 0.076), (7.4e-5, 5.9e-4, 2.7e-6), 0.05, 0.025, 0.001, 9.81)
START = np.array([0.0, 0.0, 0.0, 150.0, -75.0, 0.0])
END, RESTITUTION, FRICTION = 0.2, 0.4, 0.01
FREE = 1e-6  # m: every gap above it
SYSTEM_PYTHON = "/usr/bin/python3"


def read(kind: str) -> np.ndarray:
    """Rows of time, angles (rad), rates (rad/s) and gaps (m), (2001, 11)."""
    rows = np.genfromtxt(DATA / f"{kind}.csv", delimiter=",", skip_header=1)
    return np.column_stack([rows[:, 0], rows[:, 1] * 2 * np.pi, rows[:, 2:7], rows[:, 13:17]])


def starts(count: int, size: float) -> np.ndarray:
    """Starts (count, 6) that differ by ``size``: rad, and of the rates' own size."""
    spread = np.random.default_rng(0).normal(scale=size, size=(count, 6))
    return START + spread * np.array([1, 1, 1, 150, 75, 1])


def summary(q: np.ndarray, v: np.ndarray, gaps: np.ndarray) -> tuple[float, float, float, float]:
    """Turns of the crank, its and the rod's rate at the end (rad/s), share of samples that are free."""
    return q[-1, 0] / (2 * np.pi), v[-1, 0], v[-1, 1], float(np.mean(gaps.min(axis=1) > FREE))


def ends(begins: np.ndarray, step: float, **how: object) -> np.ndarray:
    """Summaries (N, 4) of Moreau and Jean's steps from starts (N, 6)."""
    runs = []
    for begin in begins:
        r = time_stepping(
            GUIDE, begin[:3], begin[3:], step, round(END / step), restitution=RESTITUTION, friction=FRICTION, **how
        )
        runs.append(summary(r.q, r.v, r.gap))
    return np.array(runs)


def energy(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Of motion and weight, (M,) J."""
    g, (m1, m2, m3) = GUIDE, GUIDE.masses
    joint = (m2 / 2 + m3) * g.crank * g.rod
    own = (g.inertias[0] + (m1 / 4 + m2 + m3) * g.crank**2, g.inertias[1] + (m2 / 4 + m3) * g.rod**2, g.inertias[2])
    motion = (v**2 @ np.array(own)) / 2 + joint * np.cos(q[:, 0] - q[:, 1]) * v[:, 0] * v[:, 1]
    lift = (m1 / 2 + m2 + m3) * g.crank * np.sin(q[:, 0]) + (m2 / 2 + m3) * g.rod * np.sin(q[:, 1])
    return motion + g.gravity * lift


@published
@pytest.mark.parametrize("kind", ["direct", "combined"])
def test_published_samples_are_met_up_to_the_first_impact(kind: str) -> None:
    """2.7 ms, 28 samples: within 1e-3 is asked for; it is 4e-9 rad, 3e-6 rad/s, 1e-9 m."""
    rows = read(kind)[:28]
    mine = time_stepping(
        GUIDE, START[:3], START[3:], 1e-4, 27, restitution=RESTITUTION, friction=FRICTION, linearised=True
    )
    np.testing.assert_allclose(mine.q, rows[:, 1:4], atol=1e-8)
    np.testing.assert_allclose(mine.v, rows[:, 4:7], atol=1e-5)
    # gaps in the file are of corners front to back in its own order: they are level up to here
    np.testing.assert_allclose(mine.gap, rows[:, 7:], atol=1e-8)
    assert mine.normal.max() == 0


@published
@pytest.mark.parametrize("kind", ["direct", "combined"])
def test_published_runs_gain_energy_that_nothing_gives(kind: str) -> None:
    """Walls and weight give none: it may only fall.  Steps by the midpoint keep it, and so part from the published."""
    rows = read(kind)
    kept = energy(rows[:, 1:4], rows[:, 4:7])
    assert kept[27] / kept[0] == pytest.approx(1.0099, abs=1e-4)
    assert kept[-1] > 1.1 * kept[0]
    mine = time_stepping(GUIDE, START[:3], START[3:], 1e-5, 20000, restitution=RESTITUTION, friction=FRICTION)
    own = energy(mine.q, mine.v)
    assert abs(own[260] / own[0] - 1) < 1e-5  # 2.4e-6 by steps of 0.01 ms
    assert np.diff(own).max() < 1e-6 * own[0]
    assert own[-1] < own[0]


@published
@pytest.mark.slow
def test_published_ends_beside_ensembles_of_the_same_steps() -> None:
    """Sixty starts that differ by 1e-6, with early and late activity, corners put back or not.

    Turns and rates of both published runs are within a thousandth and three hundredths of all of them together; free
    shares lie inside.  The ensembles' own spread is smaller than that: the rest is how corners are put back.
    """
    every = []
    for foresight in (0.0, 0.5):
        for project in (False, True):
            every.append(ends(starts(60, 1e-6), 1e-4, linearised=True, foresight=foresight, project=project))
            assert np.ptp(every[-1][:, 0]) < 2e-3
    low, high = np.vstack(every).min(axis=0), np.vstack(every).max(axis=0)
    for kind in ("direct", "combined"):
        rows = read(kind)
        turns, crank, rod, free = summary(rows[:, 1:4], rows[:, 4:7], rows[:, 7:])
        assert low[0] * (1 - 1e-3) < turns < high[0] * (1 + 1e-3)
        assert low[1] * 0.97 < crank < high[1] * 1.03
        assert low[2] * 1.03 < rod < high[2] * 0.97
        assert low[3] - 2e-3 < free < high[3] + 2e-3


@pytest.mark.parametrize(("step", "count"), slow((1e-4, 5), (1e-5, 20)))
def test_steps_that_keep_energy_agree_with_walls_that_give(step: float, count: int) -> None:
    """Where the mechanism really goes: 2.879 turns and 71 rad/s, by rigid walls and by compliant ones of the same
    restitution delivered, stepped through each touch.
    """
    rigid = ends(starts(count, 1e-6), step)
    chi = brentq(
        lambda x: x * (1 + RESTITUTION) - math.log((1 + x) / (1 - x * RESTITUTION)), 1e-6, (1 - 1e-12) / RESTITUTION
    )
    for stiffness, fine in ((1e7, 1e-6), (1e8, 2e-7))[: 1 if count == 5 else 2]:
        count = round(END / fine)
        states, gaps = compliant(
            GUIDE, 4, START[:3], START[3:], fine, count, round(1e-4 / fine), stiffness, chi, FRICTION, 1e-3
        )
        turns, crank, *_ = summary(states[:, :3], states[:, 3:], gaps)
        assert turns == pytest.approx(rigid[:, 0].mean(), abs=3e-3)
        assert crank == pytest.approx(rigid[:, 1].mean(), rel=0.03)
    assert rigid[:, 0].mean() == pytest.approx(2.879, abs=2e-3)


@pytest.mark.slow
def test_finer_steps_of_the_published_kind_tend_there_in_first_order() -> None:
    """3.053, 2.943, 2.900, 2.889 turns for 0.1, 0.05, 0.02, 0.01 ms."""
    turns = [ends(starts(1, 0.0), h, linearised=True, foresight=0.0)[0, 0] for h in (1e-4, 5e-5, 2e-5, 1e-5)]
    excess = np.array(turns) - 2.879
    assert (excess > 0).all()
    assert (np.diff(excess) < 0).all()
    assert 1.5 < excess[0] / excess[1] < 4
    assert excess[-1] < 0.02


# ---------------------------------------------------------------- Siconos itself


@cache
def siconos_here() -> bool:
    """Whether the system's Python has Siconos, and there is a compiler for what it calls."""
    if not (Path(SYSTEM_PYTHON).exists() and shutil.which("cc")):
        return False
    return subprocess.run([SYSTEM_PYTHON, "-c", "import siconos.kernel"], capture_output=True).returncode == 0


def siconos(kind: str, begins: np.ndarray, folder: Path) -> np.ndarray:
    """Summaries (N, 4) of Siconos' own runs."""
    script = Path(__file__).with_name("siconos_slider_crank.py")
    told = "\n".join(" ".join(repr(float(x)) for x in row) for row in begins)
    ran = subprocess.run(
        [SYSTEM_PYTHON, str(script), kind], input=told, cwd=folder, capture_output=True, text=True, check=True,
        env={"PATH": os.environ["PATH"], "LD_LIBRARY_PATH": str(folder)},
    )  # fmt: skip
    return np.array([[float(x) for x in line.split()[1:]] for line in ran.stdout.splitlines() if line[:3] == "row"])


@published
@pytest.mark.slow
def test_siconos_itself(tmp_path: Path) -> None:
    """4.4 by its Python: the direct integrator meets its published run to 1e-5 turns and lies around it in turns and
    rate of the crank; the combined one has changed since.  Both lie beside this project's own steps.
    """
    if not siconos_here():
        pytest.skip(f"{SYSTEM_PYTHON} has no siconos (Debian: python3-siconos), or there is no cc")
    begins = starts(60, 1e-6)
    direct, combined = (siconos(kind, begins, tmp_path) for kind in ("direct", "combined"))
    assert len(direct) == len(combined) == 60
    rows = read("direct")
    turns, crank, rod, free = summary(rows[:, 1:4], rows[:, 4:7], rows[:, 7:])
    assert direct[:, 0].min() < turns < direct[:, 0].max()
    assert direct[:, 1].min() < crank < direct[:, 1].max()
    assert direct[:, 2].mean() == pytest.approx(rod, abs=0.02)
    assert direct[:, 3].mean() == pytest.approx(free, abs=5e-3)
    assert np.ptp(direct[:, 0]) < 1e-4
    assert np.ptp(combined[:, 0]) < 1e-4
    mine = ends(begins[:10], 1e-4, linearised=True, foresight=0.0, project=True)
    np.testing.assert_allclose(mine[:, 0].mean(), direct[:, 0].mean(), rtol=1e-3)
    np.testing.assert_allclose(mine[:, 1].mean(), direct[:, 1].mean(), rtol=0.02)
    np.testing.assert_allclose(mine[:, 3].mean(), direct[:, 3].mean(), atol=0.01)
    np.testing.assert_allclose(mine[:, 0].mean(), combined[:, 0].mean(), rtol=1e-3)
