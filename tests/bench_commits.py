"""What this checkout takes beside an older commit, in one run: ratios of processor time.

Run ``python tests/bench_commits.py COMMIT``.  The commit is laid out beside this checkout, and each work is done in
fresh processes of both in turn, with the same engines; the least of several counts.  A ratio below 1 is faster now.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

ROOT = Path(__file__).parent.parent
TURNS, MARK = 3, "spent:"
WORKS = {
    "crank-rocker, all reactions, batches of 10 000": """
        a = Assembly(load("crank-rocker")); x = np.linspace(0.0, 6.2, 10_000)
        work(lambda: kinetostatics(kinematics(a, x, 30.0)), 50)""",
    "the same, one configuration": """
        a = Assembly(load("crank-rocker")); x = np.array([0.7])
        work(lambda: kinetostatics(kinematics(a, x, 30.0)), 1000)""",
    "six-bar, all reactions, batches of 10 000": """
        a = Assembly(load("six-bar")); x = np.linspace(0.0, 6.2, 10_000)
        work(lambda: kinetostatics(kinematics(a, x, 30.0)), 20)""",
    "equilibrium with a finite gap, paper, 10 000 angles": """
        a = Assembly(load("paper")); x = np.linspace(0.4, 2.7, 10_000)
        work(lambda: displaced(a, x, 1.0, inertia=False), 5)""",
    "compliance, paper, 721 angles": """
        m = kinematics(Assembly(load("paper")), np.linspace(0.4, 2.7, 721), 1.0)
        work(lambda: compliance(m, inertia=True), 3)""",
    "paper in MuJoCo, contact, driven": """
        r = Request(load("paper"), "contact", "driven", np.radians(np.arange(20.0, 161.0, 5.0)))
        work(lambda: engine("mujoco").simulate(r), 2)""",
    "paper in Exudyn, contact, static": """
        r = Request(load("paper"), "contact", "static", np.radians(np.arange(20.0, 161.0, 5.0)))
        work(lambda: engine("exudyn").simulate(r), 2)""",
    "paper in DART, contact, static": """
        r = Request(load("paper"), "contact", "static", np.radians(np.arange(20.0, 161.0, 5.0)))
        work(lambda: engine("dart").simulate(r), 2)""",
    "cross-check of the paper's case in all engines": """
        work(lambda: lc.crosscheck("paper", simulators="all", workers=1), 1)""",
    "cross-check of the crank-rocker, a loose pin, in MuJoCo": """
        c = {"B": 2e-4}
        work(lambda: lc.crosscheck("crank-rocker", simulators="mujoco", clearance=c, workers=1), 1)""",
    "validity map of the crank-rocker, 18 cells with contact in MuJoCo, as a command": """
        out = Path(tempfile.mkdtemp())
        asked = "--case crank-rocker --speeds 100,200,300,400,600,1000 --clearances 1e-5,1e-4,1e-3 --workers 1".split()
        command = [sys.executable, "-W", "ignore", "-m", "compare", "validity", *asked, "--out"]
        work(lambda: subprocess.run([*command, tempfile.mkdtemp(dir=out) + "/map"], check=True, capture_output=True), 1)
        shutil.rmtree(out)""",
    "import of the command": "pass",
}
BEFORE = """
import time
t = time.process_time()
import linkage_crosscheck as lc
import compare.cli.app
loading = time.process_time() - t
"""
TOOLS = """
import os, shutil, subprocess, sys, tempfile
from pathlib import Path
import numpy as np
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.motion import kinematics
from analytic.mechanism.file import load
from analytic.paper.clearance import displaced
from analytic.paper.compliance import compliance
from analytic.paper.kinetostatics import kinetostatics
from sim_models.engine import Request, engine
spent = []
def work(what, count):
    for _ in range(count // 10 + 1):
        what()
    for _ in range(3):
        t = sum(os.times()[:4])
        for _ in range(count):
            what()
        spent.append((sum(os.times()[:4]) - t) / count)
"""


def seconds(tree: Path, text: str) -> float:
    """Processor time (s) of a work in a tree."""
    body = BEFORE + ("spent = [loading]\n" if text == "pass" else TOOLS + textwrap.dedent(text))
    told = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", f"{body}\nprint({MARK!r}, min(spent))"],
        cwd=tree, env={"PYTHONPATH": str(tree), "PATH": "/usr/bin:/bin"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if told.returncode:
        raise SystemExit(f"{tree}: {told.stderr.strip().splitlines()[-1]}")
    return float(told.stdout.partition(MARK)[2].split()[0])  # engines have words of their own


def main(commit: str) -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        packed = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=packed, check=True)
        print(f"| what | {commit}, ms | now, ms | ratio |\n|---|--:|--:|--:|")
        for name, text in WORKS.items():
            turns = [[seconds(tree, text) for tree in (Path(folder), ROOT)] for _ in range(TURNS)]
            old, new = (1e3 * min(each) for each in zip(*turns, strict=True))
            print(f"| {name} | {old:.3g} | {new:.3g} | {new / old:.2f} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
