"""Measured data for tests: a folder with a mechanism, measured.toml and CSV files, written as a rig's logger would."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w


@dataclass(frozen=True)
class RunTable:
    """A run to write: ``time`` (N,) s, ``columns`` of header (``crank_angle [deg]``) to values (N,) in that unit, NaN
    for an empty cell, and ``fields``, the other entries of its ``[[run]]`` (``drive_speed``, ``noise``, ``load``, ...).
    """

    name: str
    time: np.ndarray
    columns: Mapping[str, np.ndarray]
    fields: Mapping[str, Any] = field(default_factory=dict)


def csv_text(time: np.ndarray, columns: Mapping[str, np.ndarray], digits: int = 12) -> str:
    """A data file: ``time [s]`` first, numbers to so many significant digits, NaN as an empty cell."""
    table = np.column_stack([time, *columns.values()])
    rows = [",".join("" if np.isnan(v) else f"{v:.{digits}g}" for v in row) for row in table.tolist()]
    return "\n".join([",".join(["time [s]", *columns]), *rows]) + "\n"


def write_measured(
    folder: Path, mechanism: str, runs: Sequence[RunTable], tolerance: Mapping[str, float] | None = None
) -> Path:
    """Write nominal.toml (``mechanism``, TOML text), a CSV file for each run and measured.toml; returns the path of the
    last.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "nominal.toml").write_text(mechanism, encoding="utf-8")
    entries = []
    for run in runs:
        (folder / f"{run.name}.csv").write_text(csv_text(run.time, run.columns), encoding="utf-8")
        entries.append({"name": run.name, "file": f"{run.name}.csv", **run.fields})
    whole = {"mechanism": "nominal.toml", **({"tolerance": dict(tolerance)} if tolerance else {}), "run": entries}
    path = folder / "measured.toml"
    path.write_text(tomli_w.dumps(whole), encoding="utf-8")
    return path


def written(path: Path, columns: Mapping[str, np.ndarray], digits: int = 17) -> Path:
    """A data file of columns (N,) by heading, ``time [s]`` among them, with numbers of so many significant digits."""
    others = {heading: values for heading, values in columns.items() if heading != "time [s]"}
    path.write_text(csv_text(columns["time [s]"], others, digits), encoding="utf-8")
    return path
