"""A set of the bench by its seed: drawn and recorded, its files and its seal."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from analytic.kinematics.assembly import AssemblyError
from analytic.mechanism import MechanismError
from analytic.writing import write_atomically
from compare.files import output_folder
from sim_models.engine import SimulationError, engine, installed_version
from tests.evidence.results.scoreboard import Kind, Recorder, TrueFault, Truth
from tests.evidence.scoreboard.bench import coarse, coloured, large, per_run, slightly_off
from tests.evidence.scoreboard.bench.rig import Bench
from tests.evidence.scoreboard.files import write_files
from tests.evidence.scoreboard.rigs import Rejected

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
        except (Rejected, SimulationError, AssemblyError, MechanismError):
            continue
        stated = made.noise if made.noise_stated else None
        write_files(output_folder(data), made.nominal, made.recordings, made.units, stated)
        sealed = _truth(seed, attempt, kind, made)
        write_atomically(output_folder(seal) / Truth.file, sealed.to_json(1) + "\n")
        return sealed
    raise Rejected(f"seed {seed}: none of {ATTEMPTS} attempts made a usable set")


def _truth(seed: int, attempt: int, kind: Kind, made: Bench) -> Truth:
    return Truth(
        seed=seed,
        attempt=attempt,
        kind=kind,
        case=made.case,
        source=Recorder(name=made.source, version=_version(made.source)),
        simulator=made.simulator,
        effects=tuple(e.sealed() for e in made.dominant),
        slight=tuple(TrueFault(name=e.name, where=e.where, parameters=dict(e.values)) for e in made.slight),
        faults=tuple(TrueFault(name=f.name, where=f.where, parameters=dict(f.values)) for f in made.faults),
        together=made.together,
        noise=dict(made.noise),
        reversed_load=False,
        outside=None,
    )


def _version(source: str) -> str | None:
    return importlib.metadata.version(source) if source == "scipy" else installed_version(engine(source).package)
