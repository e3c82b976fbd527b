"""Runs that a sweep can do, importable wherever its workers are."""

from __future__ import annotations

import ctypes
import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sim_models.engine import Request


def solve(run: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers that depend on every rounding: a product and a solution of a matrix made from the run's seed."""
    matrix = np.random.default_rng(run["seed"]).normal(size=(run["size"], run["size"]))
    return {"solution": np.linalg.solve(matrix @ matrix.T, matrix[0]), "norm": float(np.linalg.norm(matrix, 2))}


def logged(run: Mapping[str, Any]) -> dict[str, Any]:
    """Leave a mark for every time that a run is done, take a while, and say which it was."""
    with open(Path(run["log"]), "a", encoding="utf-8") as log:
        log.write(f"{run['seed']}\n")
    time.sleep(run["seconds"])
    return {"seed": run["seed"], "square": run["seed"] ** 2}


KEPT: list[bytearray] = []


def growing(run: Mapping[str, Any]) -> dict[str, Any]:
    """Keep ever more memory, for longer than it takes a process to look at how much it has."""
    KEPT.append(bytearray(os.urandom(1024) * (run["megabytes"] * 1024)))
    time.sleep(run["seconds"])
    return {"process": os.getpid()}


def troubled(run: Mapping[str, Any]) -> dict[str, Any]:
    """Do what the run says: raise, kill its own process, or return."""
    if run["trouble"] == "raise":
        raise ValueError(f"run {run['seed']} is no good")
    if run["trouble"] == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    return {"seed": run["seed"]}


def threads(run: Mapping[str, Any]) -> dict[str, Any]:
    """How many threads linear algebra may use here."""
    return {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}


def die_on_spring_damper(numbered: tuple[int, str, Request], resolve: object, offers: object) -> Any:
    """In place of a simulation: an engine that crashes in one joint model, and else at once answers with its name."""
    _, _, request = numbered
    if request.joint_model == "spring-damper":
        os.kill(os.getpid(), signal.SIGKILL)
    return request.joint_model, 0.0


def busy(seconds: float) -> None:
    """Hold the interpreter's lock for so long, as an engine in the middle of its steps does."""
    ctypes.PyDLL(None).usleep(int(seconds * 1e6))
