"""A run of an FMU in a process of its own, so that foreign code that crashes is an error of this run and no more.

What the process is told and what it finds are files in a temporary folder: numbers as arrays, the rest as JSON.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from analytic.mechanism.one_line import shown
from sim_models.engine import Cause, SimulationError
from sim_models.fmu import child
from sim_models.fmu.description import Fmu, FmuError, Variable, unpacked
from sim_models.fmu.mapping import Map, MappedVariable, Moved
from sim_models.fmu.schedule import StepPlan

LONGEST_RUN = 600.0  # s that a run may take
LOOK_IN_ITS_TOOL = "run it in the tool that made it to see why"
TOLD: tuple[Moved, ...] = ("position", "speed", "acceleration")  # in the order of a plan's inputs
QUOTED_FROM_FMU = 300  # characters of what an FMU says of its own failure


def run(
    columns: Map, drives: Sequence[Mapping[Moved, MappedVariable]], plan: StepPlan, signals: Sequence[Variable]
) -> np.ndarray:
    """What an FMU's variables are (N, signals) at the reported points of a plan, in the FMU's units.

    Raises FmuError where the FMU cannot be unpacked or its code not loaded, SimulationError where its run fails.
    """
    fmu = columns.fmu
    with unpacked(fmu.path) as folder, tempfile.TemporaryDirectory(prefix="linkage-fmu-") as own:
        files = Path(own)
        job = {
            "folder": str(folder),
            "library": str(folder / fmu.library),
            "fmi": fmu.fmi,
            "guid": fmu.guid,
            "identifier": fmu.identifier,
            "parameters": [[each.kind, each.reference, value] for each, value in columns.parameters],
            "inputs": [links[name].variable.reference for links in drives for name in TOLD if name in links],
            "kind": signals[0].kind,
            "outputs": [each.reference for each in signals],
            "reported": plan.reported.tolist(),
        }
        job["parameters"] += [
            [
                links["start"].variable.kind,
                links["start"].variable.reference,
                float(links["start"].number(np.array(at))),
            ]
            for links, at in zip(drives, plan.starts, strict=True)
            if "start" in links
        ]
        (files / child.JOB).write_text(json.dumps(job), encoding="utf-8")
        np.save(files / child.POINTS, plan.points)
        np.save(files / child.INPUTS, plan.inputs)
        _wait(fmu, files)
        return _found(fmu, files, plan.points[plan.reported], signals)


def _wait(fmu: Fmu, files: Path) -> None:
    """Let the process do it.  Raises SimulationError where it does not come to its end."""
    with (files / child.SAID).open("wb") as said:
        try:
            done = subprocess.run(
                [sys.executable, "-P", child.__file__, str(files), str(os.getpid())],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=said,
                timeout=LONGEST_RUN,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise SimulationError(
                f"fmu:{fmu.path}: it was not done after {LONGEST_RUN:g} s, while it was {_stage(files)}",
                Cause.TOO_MANY_STEPS,
                "give a larger step in the map, or ask for less",
            ) from None
    if done.returncode and _stage(files) != child.ENDED:
        try:
            name = signal.Signals(-done.returncode).name
        except ValueError:
            name = f"exit status {done.returncode}"
        what = f"its code crashed ({name}) while it was {_stage(files)}{_last_words(files)}"
        raise SimulationError(f"fmu:{fmu.path}: {what}", Cause.FAULTY, LOOK_IN_ITS_TOOL)


def _last_words(files: Path) -> str:
    """The last line that the process wrote to its standard error."""
    with (files / child.SAID).open("rb") as said:
        said.seek(max(0, (files / child.SAID).stat().st_size - 4096))
        lines = said.read().decode("utf-8", errors="replace").split("\n")
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f": {last[:QUOTED_FROM_FMU]}" if last else ""


def _found(fmu: Fmu, files: Path, reported: np.ndarray, signals: Sequence[Variable]) -> np.ndarray:
    """What the process has left (N, signals) at reported times (N,) s.  Raises FmuError or SimulationError."""
    try:
        fault = json.loads((files / child.FAULT).read_text(encoding="utf-8"))
    except FileNotFoundError:
        fault = None
    except ValueError:
        fault = {"words": "its fault cannot be read"}
    if fault:
        words = " ".join(str(fault.get("words", "")).split())[:QUOTED_FROM_FMU].rstrip(".")
        if fault.get("stage") == "loaded":
            raise FmuError(f"{fmu.path}: its code cannot be loaded here ({words}); export it for this platform")
        at = f" at {fault['time']:.6g} s" if isinstance(fault.get("time"), float) else ""
        raise SimulationError(
            f"fmu:{fmu.path}: it failed while it was {fault.get('stage')}{at}: {words}", Cause.FAULTY, LOOK_IN_ITS_TOOL
        )
    try:
        found = np.load(files / child.OUTPUTS, allow_pickle=False)
    except (OSError, ValueError, EOFError):
        found = np.zeros(0)
    if found.shape != (reported.size, len(signals)) or found.dtype != np.float64:
        raise SimulationError(f"fmu:{fmu.path}: its process has left no result", Cause.FAULTY, LOOK_IN_ITS_TOOL)
    if not np.all(np.isfinite(found)):
        k, signal = (int(i) for i in np.argwhere(~np.isfinite(found))[0])
        raise SimulationError(
            f"fmu:{fmu.path}: {shown(signals[signal].name)} is {found[k, signal]} at {reported[k]:.6g} s",
            Cause.FAULTY,
            LOOK_IN_ITS_TOOL,
        )
    return np.asarray(found)


def _stage(files: Path) -> str:
    try:
        return (files / child.STAGE).read_text(encoding="utf-8")[:40] or "started"
    except (OSError, UnicodeDecodeError):
        return "started"
