"""A set of the bench by its seed: drawn and recorded, its files and its seal."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import tomli_w

from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism.file import dumps
from analytic.mechanism.signals import named
from compare.diagnose.data.units import dimension, factor
from compare.evidence.scoreboard.bench import coarse, coloured, large, per_run, slightly_off
from compare.evidence.scoreboard.bench.rig import Bench, Recording
from compare.evidence.scoreboard.rigs import Rejected
from compare.evidence.scoreboard.sizes import Planted
from compare.files import output_folder, write_atomically
from compare.results.scoreboard import Kind, Recorder, TrueEffect, TrueFault, Truth
from sim_models.engine import SimulationError, engine, installed_version

ATTEMPTS = 1000
FAMILIES: Mapping[Kind, Callable[[int, np.random.Generator], Bench]] = {
    "slightly-off": slightly_off.draw,
    "coarse": coarse.draw,
    "coloured": coloured.draw,
    "per-run": per_run.draw,
    "large": large.draw,
}


def make_bench(seed: int, kind: Kind, k: int, data: Path, seal: Path) -> Truth:
    """Draw and record the k-th set of a family, and write the data into one folder and the truth into the other.

    Raises Rejected where no attempt made a usable set.
    """
    for attempt in range(ATTEMPTS):
        try:
            made = FAMILIES[kind](k, np.random.default_rng([seed, attempt]))
        except (Rejected, SimulationError, AssemblyError):
            continue
        _write(made, output_folder(data))
        sealed = _truth(seed, attempt, kind, made)
        write_atomically(output_folder(seal) / Truth.file, sealed.to_json(1) + "\n")
        return sealed
    raise Rejected(f"seed {seed}: none of {ATTEMPTS} attempts made a usable set")


def _write(made: Bench, folder: Path) -> None:
    """measured.toml, nominal.toml and a CSV file for each run."""
    entries = []
    for recording in made.recordings:
        _write_run(made, recording, folder / f"{recording.name}.csv")
        entry = {"name": recording.name, "file": f"{recording.name}.csv", **recording.fields}
        if made.noise_stated:
            entry["noise"] = {s: float(f"{sigma:.6g}") for s, sigma in made.noise.items()}
        entries.append(entry)
    write_atomically(folder / "nominal.toml", dumps(made.nominal))
    write_atomically(folder / "measured.toml", tomli_w.dumps({"mechanism": "nominal.toml", "run": entries}))


def _write_run(made: Bench, recording: Recording, path: Path) -> None:
    known = named(made.nominal.bodies, made.nominal.joints)
    units = {s: made.units.get(s, known[s].unit) for s in recording.readings}
    columns = [recording.time, *(v / factor(units[s], dimension(known[s])) for s, v in recording.readings.items())]
    header = ",".join(["time [s]", *(f"{s} [{unit}]" for s, unit in units.items())])
    rows = (",".join(f"{v:.12g}" for v in row) for row in np.column_stack(columns).tolist())
    write_atomically(path, "\n".join([header, *rows]) + "\n")


def _truth(seed: int, attempt: int, kind: Kind, made: Bench) -> Truth:
    return Truth(
        seed=seed,
        attempt=attempt,
        kind=kind,
        case=made.case,
        source=Recorder(name=made.source, version=_version(made.source)),
        simulator=made.simulator,
        effects=tuple(_sized(e) for e in made.dominant),
        slight=tuple(TrueFault(name=e.name, where=e.where, parameters=dict(e.values)) for e in made.slight),
        faults=tuple(TrueFault(name=f.name, where=f.where, parameters=dict(f.values)) for f in made.faults),
        together=made.together,
        noise=dict(made.noise),
        reversed_load=False,
        outside=None,
    )


def _sized(e: Planted) -> TrueEffect:
    return TrueEffect(
        name=e.name,
        where=e.where,
        parameters=dict(e.values),
        total=e.total,
        linear=e.linear,
        distinct=e.distinct,
        rival=e.rival,
    )


def _version(source: str) -> str | None:
    return importlib.metadata.version(source) if source == "scipy" else installed_version(engine(source).package)
