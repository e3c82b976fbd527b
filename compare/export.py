"""An engine's own model of a linkage, and a script that runs it without this project."""

from __future__ import annotations

import json
import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path

from compare.analyse import Angles, request
from compare.arguments import (
    Linkage,
    Metres,
    Numbers,
    flag,
    linkage,
    noted,
    one_engine,
    rigidly_and_evenly_driven,
    warn_of_friction,
)
from compare.arguments import path as named
from compare.faults import ArgumentError
from compare.files import OutputError, output_folder, write_together
from compare.left_out import Asked, omitted, rigid_walls
from sim_models.engine import JointModel, Motion, SettingValue, declared, engine, engine_names


def export(  # noqa: PLR0913 - what a person may ask, by name
    mechanism: Linkage = "paper",
    simulator: str = "mujoco",
    *,
    folder: str | Path,
    joint_model: JointModel = "ideal",
    motion: Motion = "driven",
    angles: Angles | None = None,
    times: Numbers | None = None,
    course: str | Path | None = None,
    path: str | Path | None = None,
    clearance: Metres | None = None,
    large: bool = False,
) -> list[Path]:
    """Write an engine's own model of a linkage into a folder, with ``run.py``, which runs it without this project and
    begins with what of the linkage is left out, and ``expected.csv``, what it gave here; the files.

    A linkage that no single crank moves runs at ``times`` (N,) s, its drives at their speeds, along the ``course`` of a
    file or such that a platform follows a ``path``, as in :func:`compare.analyse.simulate`.

    Raises what :func:`compare.analyse.simulate` does, and OutputError.
    """
    place = named(folder, "folder")
    texts = exported(
        mechanism,
        simulator,
        joint_model=joint_model,
        motion=motion,
        angles=angles,
        times=times,
        course=course,
        path=path,
        clearance=clearance,
        large=large,
    )
    return write_together(output_folder(place, "folder"), texts)


def exported(  # noqa: PLR0913 - what a person may ask, by name
    mechanism: Linkage,
    simulator: str,
    *,
    joint_model: JointModel,
    motion: Motion,
    angles: Angles | None,
    times: Numbers | None,
    course: str | Path | None,
    path: str | Path | None,
    clearance: Metres | None,
    large: bool,
) -> dict[str, str]:
    """The files of an export: text by name."""
    simulator = one_engine(simulator)
    chosen = engine(simulator)
    if chosen.capabilities.export is None:
        can = ", ".join(name for name in engine_names() if declared(name).capabilities.export is not None)
        raise ArgumentError("simulator", f"{simulator}: its model cannot be exported; that of {can} can")
    with noted() as warned:
        m = rigidly_and_evenly_driven(linkage(mechanism, clearance, large=flag(large, "large")))
        warn_of_friction(m, joint_model, motion)
        warned += omitted(m, Asked.of_engines("export", m, motion, joint_model))
        asked = request(m, joint_model, motion, angles, times, course, path)
    try:
        with tempfile.TemporaryDirectory() as draft:  # all of it is there before the first file is put in place
            texts = {file.name: file.read_text(encoding="utf-8") for file in chosen.export(asked, Path(draft))}
    except OSError as error:
        raise OutputError(
            f"{tempfile.gettempdir()}, where the files are drafted: cannot be written ({error.strerror}); free space"
            " there, or give TMPDIR another folder"
        ) from None
    for sentence in rigid_walls(m, simulator, joint_model, used_in(texts)):
        warned.append(sentence)
        warnings.warn(sentence, stacklevel=3)
    return texts | {"run.py": "".join(f"# {sentence}\n" for sentence in warned) + texts["run.py"]}


def used_in(texts: Mapping[str, str]) -> dict[str, SettingValue]:
    """The numbers that the engine used, as an export's files have them."""
    (model,) = [text for name, text in texts.items() if name.endswith(".json")]
    return dict(json.loads(model)["settings"])
