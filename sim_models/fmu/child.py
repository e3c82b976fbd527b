"""The process in which an FMU runs: ``python child.py FOLDER``, with a job there, and left there what was found.

It imports nothing of this project, and nothing that it does not need: what an FMU does to its process is done here.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np

JOB, POINTS, INPUTS = "job.json", "points.npy", "inputs.npy"
OUTPUTS, FAULT, STAGE, SAID = "outputs.npy", "fault.json", "stage.txt", "said.txt"
ENDED = "ended"  # the stage after the last
WATCH_INTERVAL = 0.5  # s, between two looks at whether the process that waits for this one is still there
SERIOUS = 2  # of an FMU's messages: discard, error, fatal


def watch(parent: int, files: Path) -> None:
    """End this process, and remove what it was given, once the process that started it is gone."""
    unpacked = json.loads((files / JOB).read_text(encoding="utf-8"))["folder"]

    def ended() -> None:
        while os.getppid() == parent:
            sleep(WATCH_INTERVAL)
        for folder in (unpacked, files):
            shutil.rmtree(folder, ignore_errors=True)
        os._exit(1)

    threading.Thread(target=ended, daemon=True).start()


def main(files: Path) -> None:
    """Do the job in a folder; leave the outputs there, or the fault."""
    job = json.loads((files / JOB).read_text(encoding="utf-8"))
    points, inputs = np.load(files / POINTS), np.load(files / INPUTS)
    run = FmuRun(files)
    try:
        np.save(files / OUTPUTS, run.outputs(job, points, inputs))
        run.enter(ENDED)  # what it does from here on, crashes included, is after its result
        run.fmu.terminate()
    except Exception as error:  # noqa: BLE001 - FMPy raises plain exceptions, and whatever it is, it is the FMU's
        if run.stage == ENDED:
            return
        words = run.said or f"{type(error).__name__}: {error}"
        fault = {"stage": run.stage, "time": run.time, "words": words}
        (files / FAULT).write_text(json.dumps(fault), encoding="utf-8")


class FmuRun:
    """How far a run is, and what the FMU last complained of."""

    def __init__(self, files: Path) -> None:
        self.files, self.stage, self.said = files, "", ""
        self.time: float | None = None
        self.fmu: Any = None

    def enter(self, stage: str) -> None:
        """Note what comes, for whoever finds this process dead."""
        self.stage = stage
        (self.files / STAGE).write_text(stage, encoding="utf-8")

    def heard(self, *message: object) -> None:
        """A message of FMI 2 (environment, instance, status, category, text) or 3 (the same without the instance)."""
        status, text = message[-3], message[-1]
        if isinstance(status, int) and status >= SERIOUS and isinstance(text, bytes):
            self.said = text.decode("utf-8", errors="replace")

    def outputs(self, job: dict, points: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Outputs (N, M) at the reported points.  Raises whatever FMPy does."""
        self.enter("loaded")
        fmu = _Fmu2(job, self.heard) if job["fmi"].startswith("2") else _Fmu3(job, self.heard)
        self.fmu = fmu.fmu
        self.enter("instantiated")
        fmu.instantiate()
        self.enter("initialised")
        for kind, reference, value in job["parameters"]:
            fmu.set(kind, [reference], [value])
        fmu.tell(job["inputs"], inputs[0].tolist())
        fmu.initialise()
        fmu.tell(job["inputs"], inputs[0].tolist())
        fmu.begin()
        self.enter("stepped")
        return self.stepped(fmu, job, points, inputs)

    def stepped(self, fmu: _Fmu2 | _Fmu3, job: dict, points: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """The steps: before each, inputs are told as they are at its end."""
        reported, found = set(job["reported"]), []
        for i, time in enumerate(points.tolist()):
            if i:
                before = float(points[i - 1])
                self.time = before
                fmu.tell(job["inputs"], inputs[i].tolist())
                fmu.step(before, time - before)
            if i in reported:
                found.append(fmu.asked(job["outputs"]))
        return np.array(found, float)


class _Fmu2:
    """An instance of FMI 2."""

    def __init__(self, job: dict, heard: Callable[..., None]) -> None:
        from ctypes import byref

        from fmpy import calloc, fmi2, free
        from fmpy.logging import addLoggerProxy

        self.fmu = fmi2.FMU2Slave(**_arguments(job), libraryPath=job["library"])
        self.callbacks = fmi2.fmi2CallbackFunctions()
        self.callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(heard)
        self.callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(byref(self.callbacks))

    def instantiate(self) -> None:
        self.fmu.instantiate(callbacks=self.callbacks, loggingOn=True)

    def set(self, kind: str, references: list[int], values: list[object]) -> None:
        getattr(self.fmu, f"set{kind}")(references, values)

    def tell(self, references: list[int], values: list[float]) -> None:
        self.fmu.setReal(references, values)

    def asked(self, references: list[int]) -> list[float]:
        return list(self.fmu.getReal(references))

    def initialise(self) -> None:
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def begin(self) -> None:
        self.fmu.exitInitializationMode()

    def step(self, time: float, size: float) -> None:
        self.fmu.doStep(time, size)


class _Fmu3:
    """An instance of FMI 3."""

    def __init__(self, job: dict, heard: Callable[..., None]) -> None:
        from fmpy import fmi3

        self.fmu, self.heard = fmi3.FMU3Slave(**_arguments(job)), heard

    def instantiate(self) -> None:
        self.fmu.instantiate(logMessage=self.heard, loggingOn=True)

    def set(self, kind: str, references: list[int], values: list[object]) -> None:
        getattr(self.fmu, f"set{kind}")(references, values)

    def tell(self, references: list[int], values: list[float]) -> None:
        self.fmu.setFloat64(references, values)

    def asked(self, references: list[int]) -> list[float]:
        return list(self.fmu.getFloat64(references))

    def initialise(self) -> None:
        self.fmu.enterInitializationMode(startTime=0.0)

    def begin(self) -> None:
        self.fmu.exitInitializationMode()

    def step(self, time: float, size: float) -> None:
        _, ended, early, _ = self.fmu.doStep(time, size)
        if ended or early:
            raise RuntimeError("it ended the simulation by itself")


def _arguments(job: dict) -> dict[str, str]:
    return {"guid": job["guid"], "modelIdentifier": job["identifier"], "unzipDirectory": job["folder"]}


if __name__ == "__main__":
    watch(int(sys.argv[2]), Path(sys.argv[1]))
    main(Path(sys.argv[1]))
