"""The files of a hidden set, as a person would have them: measured.toml, nominal.toml and a CSV file for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.file import dumps
from analytic.mechanism.signals import Signal, named
from analytic.mechanism.units import dimension, factor
from analytic.writing import write_atomically

Readings = dict[str, np.ndarray]


@dataclass(frozen=True)
class Recording:
    """A run as it is written: ``time`` (N,) s as stamped, what the sensors read (SI), and the fields of its
    ``[[run]]``.
    """

    name: str
    time: np.ndarray
    readings: Readings
    fields: Mapping[str, object]


def write_files(
    folder: Path,
    nominal: Mechanism,
    recordings: Sequence[Recording],
    units: Mapping[str, str],
    noise: Mapping[str, float] | None,
) -> None:
    """Write a set into a folder; ``units`` are those of columns that are not in SI, ``noise`` is stated (1-sigma, SI,
    by signal) or left out.
    """
    import tomli_w

    known, entries = named(nominal.bodies, nominal.joints, nominal.drives, nominal.sensors), []
    for recording in recordings:
        write_atomically(folder / f"{recording.name}.csv", _table(recording, known, units))
        entry = {"name": recording.name, "file": f"{recording.name}.csv", **recording.fields}
        if noise is not None:
            entry["noise"] = {s: float(f"{sigma:.6g}") for s, sigma in noise.items()}
        entries.append(entry)
    write_atomically(folder / "nominal.toml", dumps(nominal))
    write_atomically(folder / "measured.toml", tomli_w.dumps({"mechanism": "nominal.toml", "run": entries}))


def _table(recording: Recording, known: Mapping[str, Signal], units: Mapping[str, str]) -> str:
    read = {s: units.get(s, known[s].unit) for s in recording.readings}
    columns = [recording.time, *(v / factor(read[s], dimension(known[s])) for s, v in recording.readings.items())]
    header = ",".join(["time [s]", *(f"{s} [{unit}]" for s, unit in read.items())])
    rows = (",".join(f"{v:.12g}" for v in row) for row in np.column_stack(columns).tolist())
    return "\n".join([header, *rows]) + "\n"
