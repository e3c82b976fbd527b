"""An engine's own model of a linkage, and a script that runs it without this project."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path

from analytic.errors import warn
from analytic.mechanism import Mechanism
from analytic.writing import OutputError, write_together
from compare.analyse import request
from compare.arguments import (
    linkage,
    noted,
    one_engine,
    rigidly_and_evenly_driven,
    warn_of_friction,
)
from compare.faults import ArgumentError
from compare.files import output_folder
from compare.omissions import Asked, omitted, rigid_walls
from compare.questions.analyse import ExportQuestion
from compare.questions.question import answers
from sim_models.engine import SettingValue, Unsupported, declared, engine, engine_names


@answers(ExportQuestion)
def export(question: ExportQuestion) -> list[Path]:
    """Write an engine's own model of a linkage into a folder, with ``run.py``, which runs it without this project and
    begins with what of the linkage is left out, and ``expected.csv``, what it gave here; the files.

    A linkage that no single crank moves runs at ``times`` (N,) s, its drives at their speeds, along the ``course`` of a
    file or such that a platform follows a ``path``, as in :func:`compare.analyse.simulate`.

    Raises what :func:`compare.analyse.simulate` does, and OutputError.
    """
    texts = exported(question)
    return write_together(output_folder(Path(question.folder), "folder"), texts)


def exported(question: ExportQuestion) -> dict[str, str]:
    """The files of an export: text by name."""
    simulator, joint_model, motion = one_engine(question.simulator), question.joint_model, question.motion
    chosen = engine(simulator)
    if chosen.capabilities.export is None:
        can = ", ".join(name for name in engine_names() if declared(name).capabilities.export is not None)
        raise ArgumentError("simulator", f"{simulator}: its model cannot be exported; that of {can} can")
    with noted() as warned:
        m = rigidly_and_evenly_driven(linkage(question.mechanism, question.clearance, large=question.large))
        warn_of_friction(m, joint_model, motion)
        warned += omitted(m, Asked.of_engines("export", m, motion, joint_model))
        asked = request(m, question)
    try:
        with tempfile.TemporaryDirectory() as draft:  # all of it is there before the first file is put in place
            texts = {file.name: file.read_text(encoding="utf-8") for file in chosen.export(asked, Path(draft))}
            texts |= _mapped(m, Path(draft) / "model.xml")
    except OSError as error:
        raise OutputError(
            f"{tempfile.gettempdir()}, where the files are drafted: cannot be written ({error.strerror}); free space"
            " there, or give TMPDIR another folder"
        ) from None
    for sentence in rigid_walls(m, simulator, joint_model, used_in(texts)):
        warned.append(sentence)
        warn(sentence)
    return texts | {"run.py": "".join(f"# {sentence}\n" for sentence in warned) + texts["run.py"]}


def _mapped(m: Mechanism, model: Path) -> dict[str, str]:
    """A map of the columns that MuJoCo has of an exported model, by its names in it, with what each is of our signals;
    nothing where pins play in their bearings, or the model has units of its own.
    """
    if not model.exists():
        return {}
    from sim_models.mjcf.coordinates import as_map, relations
    from sim_models.mjcf.errors import MjcfError
    from sim_models.mjcf.planar import read

    try:
        found = relations(m, read(model))
    except (MjcfError, Unsupported):
        return {}
    return {"map.toml": as_map(found, model.name, inverse=True)} if found else {}


def used_in(texts: Mapping[str, str]) -> dict[str, SettingValue]:
    """The numbers that the engine used, as an export's files have them."""
    (model,) = [text for name, text in texts.items() if name.endswith(".json")]
    return dict(json.loads(model)["settings"])
