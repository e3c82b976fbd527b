"""An engine's own model of a linkage, and a script that runs it without this project."""

from __future__ import annotations

import tempfile
from pathlib import Path

from compare.analyse import Angles, request
from compare.arguments import Linkage, Metres, linkage, one_engine, path, rigidly_and_evenly_driven
from compare.faults import ArgumentError
from compare.files import OutputError, output_folder, write_together
from sim_models.engine import JointModel, Motion, declared, engine, engine_names


def export(
    mechanism: Linkage = "paper",
    simulator: str = "mujoco",
    *,
    folder: str | Path,
    joint_model: JointModel = "ideal",
    motion: Motion = "driven",
    angles: Angles | None = None,
    clearance: Metres | None = None,
) -> list[Path]:
    """Write an engine's own model of a linkage into a folder, with ``run.py``, which runs it without this project, and
    ``expected.csv``, what it gave here; the files.

    Raises what :func:`compare.analyse.simulate` does, and OutputError.
    """
    place = path(folder, "folder")
    texts = exported(mechanism, simulator, joint_model=joint_model, motion=motion, angles=angles, clearance=clearance)
    return write_together(output_folder(place, "folder"), texts)


def exported(
    mechanism: Linkage,
    simulator: str,
    *,
    joint_model: JointModel,
    motion: Motion,
    angles: Angles | None,
    clearance: Metres | None,
) -> dict[str, str]:
    """The files of an export: text by name."""
    simulator = one_engine(simulator)
    chosen = engine(simulator)
    if chosen.capabilities.export is None:
        can = ", ".join(name for name in engine_names() if declared(name).capabilities.export is not None)
        raise ArgumentError("simulator", f"{simulator}: its model cannot be exported; that of {can} can")
    m = rigidly_and_evenly_driven(linkage(mechanism, clearance))
    asked = request(m, joint_model, motion, angles)
    try:
        with tempfile.TemporaryDirectory() as draft:  # all of it is there before the first file is put in place
            return {file.name: file.read_text(encoding="utf-8") for file in chosen.export(asked, Path(draft))}
    except OSError as error:
        raise OutputError(
            f"{tempfile.gettempdir()}, where the files are drafted: cannot be written ({error.strerror}); free space"
            " there, or give TMPDIR another folder"
        ) from None
