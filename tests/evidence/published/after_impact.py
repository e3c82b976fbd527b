"""Siconos' slider-crank with play in its guide (:mod:`tests.evidence.published.flying_block`) after its first impact:
its published runs, Siconos itself where the system's Python has it, and what the same mechanism does by steps that keep
energy.

The published runs take steps of 0.1 ms, of first order where the mass changes.  These gain energy: 1 % before anything
is touched, and the crank ends at 120 rad/s where every method that keeps energy, or finer steps of the same one, end
at 71 rad/s.  So they are evidence of how Siconos steps, not of the mechanism.  Nor is the motion chaotic: starts that
differ by 1e-6 end 1e-5 turns apart.  What sets the two published runs apart is how each puts corners back on the wall.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from analytic.kinematics.schedule import Schedule
from sim_models.engine import Request, declared, engine
from tests.evidence.nonsmooth import Guide, compliant, time_stepping
from tests.evidence.published.flying_block import FOLDER, flying_block
from tests.evidence.results.validation import Ended, Span

GUIDE = Guide(0.153, 0.306, (0.038, 0.038, 0.076), (7.4e-5, 5.9e-4, 2.7e-6), 0.05, 0.025, 0.001, 9.81)
START = np.array([0.0, 0.0, 0.0, 150.0, -75.0, 0.0])
END, RESTITUTION, FRICTION = 0.2, 0.4, 0.01
STEP, TOUCHED = 1e-4, 2.6e-3  # s: of the published runs; until when nothing touches a wall
FREE = 1e-6  # m: every gap above it
NEARBY = 1e-6  # rad, and of the rates' own size: by how much starts differ
KINDS = ("direct", "combined")  # integrators of the published runs
FINER = (5e-5, 2e-5, 1e-5)  # s
KEEPING = 1e-5  # s, of steps that keep energy
WALLS = ((1e7, 1e-6), (1e8, 2e-7))  # N/m, and s of steps through each touch
SYSTEM_PYTHON = "/usr/bin/python3"
PUBLISHED, SICONOS = "published", "Siconos here"  # how rows begin
AS_THEY_STEP = "Siconos' kind of steps, by this project"


class Summary(NamedTuple):
    """How a run ends: turns of the crank, its and the rod's rate (rad/s), share of samples that are free, and energy
    that it has gained before anything is touched and at the end, as shares of that at the start.
    """

    turns: float
    crank: float
    rod: float
    free: float
    touched: float
    gained: float


def read(data: Path, kind: str) -> np.ndarray:
    """Rows (2001, 11) of a published run: time, angles (rad), rates (rad/s) and gaps (m)."""
    rows = np.genfromtxt(data / FOLDER / f"{kind}.csv", delimiter=",", skip_header=1)
    return np.column_stack([rows[:, 0], rows[:, 1] * 2 * np.pi, rows[:, 2:7], rows[:, 13:17]])


def starts(count: int, size: float = NEARBY) -> np.ndarray:
    """Starts (count, 6) that differ by ``size``: rad, and of the rates' own size."""
    spread = np.random.default_rng(0).normal(scale=size, size=(count, 6))
    return START + spread * np.array([1, 1, 1, 150, 75, 1])


def energy(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Of motion and weight, (M,) J."""
    g, (m1, m2, m3) = GUIDE, GUIDE.masses
    joint = (m2 / 2 + m3) * g.crank * g.rod
    own = (g.inertias[0] + (m1 / 4 + m2 + m3) * g.crank**2, g.inertias[1] + (m2 / 4 + m3) * g.rod**2, g.inertias[2])
    motion = (v**2 @ np.array(own)) / 2 + joint * np.cos(q[:, 0] - q[:, 1]) * v[:, 0] * v[:, 1]
    lift = (m1 / 2 + m2 + m3) * g.crank * np.sin(q[:, 0]) + (m2 / 2 + m3) * g.rod * np.sin(q[:, 1])
    return np.asarray(motion + g.gravity * lift)


def summary(time: np.ndarray, q: np.ndarray, v: np.ndarray, gaps: np.ndarray) -> Summary:
    """Of a run's samples: times (M,) s, angles and rates (M, 3), gaps (M, 4) m."""
    kept = energy(q, v) / energy(START[None, :3], START[None, 3:])[0]
    free = float(np.mean(gaps.min(axis=1) > FREE))
    first = int(np.abs(time - TOUCHED).argmin())
    return Summary(
        q[-1, 0] / (2 * np.pi),
        v[-1, 0],
        v[-1, 1],
        free,
        float(kept[first] / kept[0] - 1),
        float(kept[-1] / kept[0] - 1),
    )


def told(data: Path, kind: str) -> Summary:
    """How a published run ends."""
    rows = read(data, kind)
    return summary(rows[:, 0], rows[:, 1:4], rows[:, 4:7], rows[:, 7:])


def ends(
    begins: np.ndarray, step: float, *, linearised: bool = False, foresight: float = 0.5, project: bool = False
) -> list[Summary]:
    """How Moreau and Jean's steps (:func:`tests.evidence.nonsmooth.time_stepping`) end from starts (N, 6)."""
    runs = []
    for begin in begins:
        r = time_stepping(
            GUIDE, begin[:3], begin[3:], step, round(END / step), restitution=RESTITUTION, friction=FRICTION,
            linearised=linearised, foresight=foresight, project=project,
        )  # fmt: skip
        runs.append(summary(r.time, r.q, r.v, r.gap))
    return runs


def as_they_step(begins: np.ndarray) -> list[Summary]:
    """How steps of the published kind end: with early and late activity, corners put back on the wall or not."""
    return [
        end
        for foresight in (0.0, 0.5)
        for project in (False, True)
        for end in ends(begins, STEP, linearised=True, foresight=foresight, project=project)
    ]


def on_walls_that_give(stiffness: float, step: float) -> Summary:
    """How it ends on walls of a stiffness (N/m) that deliver the same restitution."""
    chi = brentq(
        lambda x: x * (1 + RESTITUTION) - math.log((1 + x) / (1 - x * RESTITUTION)), 1e-6, (1 - 1e-12) / RESTITUTION
    )
    every = round(STEP / step)
    states, gaps = compliant(
        GUIDE, 4, START[:3], START[3:], step, round(END / step), every, stiffness, chi, FRICTION, 1e-3
    )
    return summary(every * step * np.arange(len(states)), states[:, :3], states[:, 3:], gaps)


def gaps(q: np.ndarray) -> np.ndarray:
    """Gaps (M, 4) m of corners at angles (M, 3), as a guide (:func:`tests.evidence.nonsmooth.guided`) has them."""
    g = GUIDE
    height = g.crank * np.sin(q[:, 0]) + g.rod * np.sin(q[:, 1])
    return np.column_stack(
        [
            g.half_height + g.play - side * (height + arm * np.sin(q[:, 2]) + side * g.half_height * np.cos(q[:, 2]))
            for side in (1.0, -1.0)
            for arm in (g.half_length, -g.half_length)
        ]
    )


def in_engine(name: str) -> Summary:
    """How it ends in an engine's own contact, on the softer of WALLS."""
    stiffness, step = WALLS[0]
    m = flying_block().with_joint("S", friction=FRICTION, contact_stiffness=stiffness, contact_law="kelvin-voigt")
    time = np.linspace(0.0, END, round(END / STEP) + 1)
    seen = engine(name).simulate(
        Request(m, "contact", Schedule.released(m, time, START[3]), start="centred", step=step)
    )
    bodies = ("crank", "rod", "slider")
    q = np.column_stack([seen.signals[f"{body}_angle"] for body in bodies])
    v = np.column_stack([seen.signals[f"{body}_angular_velocity"] for body in bodies])
    return summary(time, q, v, gaps(q))


@cache
def siconos_here() -> bool:
    """Whether the system's Python has Siconos, and there is a compiler for what it calls."""
    if not (Path(SYSTEM_PYTHON).exists() and shutil.which("cc")):
        return False
    return subprocess.run([SYSTEM_PYTHON, "-c", "import siconos.kernel"], capture_output=True).returncode == 0


def siconos(kind: str, begins: np.ndarray) -> list[Summary]:
    """How Siconos' own runs end from starts (N, 6)."""
    script = Path(__file__).with_name("siconos_run.py")
    lines = "\n".join(" ".join(repr(float(x)) for x in row) for row in begins)
    with tempfile.TemporaryDirectory() as folder:
        ran = subprocess.run(
            [SYSTEM_PYTHON, str(script), kind], input=lines, cwd=folder, capture_output=True, text=True, check=True,
            env={"PATH": os.environ["PATH"], "LD_LIBRARY_PATH": folder},
        )  # fmt: skip
    rows = [np.array(line.split()[1:], float) for line in ran.stdout.splitlines() if line[:3] == "row"]
    found = []
    for begin, row in zip(begins, rows, strict=True):
        at = np.array([begin, row[:6], row[6:12]])
        ended = summary(np.array([0.0, TOUCHED, END]), at[:, :3], at[:, 3:], np.zeros((3, 4)))
        found.append(ended._replace(free=float(row[12])))
    return found


# ---------------------------------------------------------------- in the report


def after_impact(names: Sequence[str], data: Path | None, whole: bool) -> Iterator[Ended]:
    """The published runs, where ``data`` is the folder that has them, and where the mechanism really goes; ``whole``
    what takes longer: steps of the published kind and Siconos itself, from sixty starts each, walls that give, and
    those of these engines whose contact has blocks that rub.
    """
    many = starts(60)
    if data is not None and (data / FOLDER).is_dir():
        for kind in KINDS:
            yield _row(f"{PUBLISHED}, {kind}", STEP, [told(data, kind)])
    if whole:
        for kind in KINDS if siconos_here() else ():
            yield _row(f"{SICONOS}, {kind}", STEP, siconos(kind, many))
        yield _row(AS_THEY_STEP, STEP, as_they_step(many), len(many))
        for step in FINER:
            yield _row(AS_THEY_STEP, step, ends(starts(1, 0.0), step, linearised=True, foresight=0.0))
    yield _row("steps that keep energy", KEEPING, ends(starts(20), KEEPING))
    if whole:
        for stiffness, step in WALLS:
            yield _row(f"walls of {stiffness:.0e} N/m", step, [on_walls_that_give(stiffness, step)])
        rubs = ("guide_clearance", ("contact", "driven")), ("contact_friction", ("contact", "driven"))
        for name in names:
            if set(rubs) <= set(declared(name).capabilities.rigid.features):
                yield _row(f"{name}, contact of {WALLS[0][0]:.0e} N/m", WALLS[0][1], [in_engine(name)])


def _row(by: str, step: float, found: list[Summary], count: int | None = None) -> Ended:
    spans = {
        name: Span(low=_five(min(values)), high=_five(max(values)))
        for name, values in zip(Summary._fields, zip(*found, strict=True), strict=True)
    }
    return Ended(by=by, step=step, starts=count or len(found), **spans)


def _five(value: float) -> float:
    return float(f"{value:.5g}")
