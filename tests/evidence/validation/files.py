"""Linkages of several drives in files: exported models run without this project, what they write checked, and MJCF
files read again and simulated.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.file import load, shipped_cases
from compare.analyse import analyse
from compare.check import check
from compare.crosscheck import crosscheck
from compare.export import export
from compare.imported import import_mjcf
from compare.results.crosscheck import CrossCheck
from sim_models.engine import SimulationError, declared
from tests.evidence.results.validation import Carried
from tests.evidence.validation.workspaces import digits

TIMES = np.linspace(0.0, 0.4, 81)  # s, at the speeds that the cases have
ALONE = """
import runpy, sys
for name in ("analytic", "sim_models", "compare", "linkage_crosscheck"):
    sys.modules[name] = None  # cannot be imported
runpy.run_path("run.py", run_name="__main__")
"""
LEAST = {"angle": 1.0, "velocity": 1.0, "clearance": 1e-3}  # rad, rad/s, m: what smaller numbers are measured by


def carried(names: Sequence[str]) -> tuple[Carried, ...]:
    """Every shipped case of several drives, exported from each of these engines that can.  Raises SimulationError where
    an exported script fails.
    """
    able = [name for name in names if declared(name).capabilities.export is not None]
    several = [case for case in shipped_cases() if len(load(case).drives) > 1]
    return tuple(_carried(case, name) for case in several for name in able)


def _carried(case: str, name: str) -> Carried:
    m = load(case)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        export(m, name, folder=place, times=TIMES)
        command = [sys.executable, "-I", "-c", ALONE]
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SimulationError(f"{case} exported from {name}: run.py failed: {done.stderr[-300:]}")
        imported, simulated = _mjcf(m, place / "model.xml") if name == "mujoco" else (None, None)
        return Carried(
            case=case,
            simulator=name,
            alone=digits(apart(_table(place / "signals.csv"), _table(place / "expected.csv"))),
            checked=_share(check(place / "signals.csv", m)),
            imported=imported,
            simulated=simulated,
        )


def _mjcf(m: Mechanism, file: Path) -> tuple[float, float]:
    """How far reactions and drives of the linkage that an MJCF file holds are off those of the one that was exported;
    and what the file as an engine uses up of a tolerance, held to the linkage that it holds.
    """
    again = import_mjcf(file).mechanism
    ours, theirs = (
        {n: v for n, v in analyse(x, times=TIMES).signals.items() if n.startswith("drive_") or n.endswith("magnitude")}
        for x in (m, again)
    )
    simulated = crosscheck(again, simulator=f"mjcf:{file}", times=TIMES)
    return digits(apart(theirs, ours)), _share(simulated)


def apart(found: Mapping[str, np.ndarray], truth: Mapping[str, np.ndarray]) -> float:
    """Largest difference of two tables, as a share of the largest true value among a vector's components; at least of
    1 rad, 1 rad/s or a gap of 1 mm.
    """
    worst = 0.0
    for name, values in truth.items():
        scale = max(float(np.abs(truth[n]).max()) for n in truth if n.rstrip("xy") == name.rstrip("xy"))
        scale = max([scale, *(size for kind, size in LEAST.items() if kind in name)])
        worst = max(worst, float(np.abs(found[name] - values).max()) / (scale or 1.0))
    return worst


def _share(result: CrossCheck) -> float:
    """The largest share of a tolerance.  Raises SimulationError where there is none."""
    shares = [d.share or 0.0 for run in result.runs for d in run.discrepancies]
    if not shares or result.failures:
        raise SimulationError(f"{result.case}: nothing could be compared of what was carried in files")
    return digits(max(shares))


def _table(file: Path) -> dict[str, np.ndarray]:
    with file.open(encoding="utf-8", newline="") as lines:
        header, *rows = csv.reader(lines)
    names = [heading.split(" [")[0] for heading in header]
    return dict(zip(names, np.array(rows, float).T, strict=True))
