"""A mechanism from a model file that exists already."""

from __future__ import annotations

from pathlib import Path

from analytic.mechanism.assumed import assumed
from compare.questions.listing import ImportQuestion
from compare.questions.question import answers
from compare.results.imported import Imported
from sim_models.engine import SimulatorMissing, broken


@answers(ImportQuestion)
def import_mjcf(question: ImportQuestion) -> Imported:
    """Read an MJCF file (MuJoCo's), or a URDF file, as a planar linkage: its mechanism, in notes what of the file is
    left out, taken on or assumed, and how signals relate to the file's coordinates, actuators and sensors.

    Raises MjcfError with file, place, value and remedy, ArgumentError, or SimulatorMissing where MuJoCo, which reads
    the file, is not installed.
    """
    source = Path(question.file)
    fault = broken("mujoco")
    if fault:
        raise SimulatorMissing(f"MuJoCo, which reads MJCF, cannot be imported ({fault}); run: pip install mujoco")
    from sim_models.mjcf.coordinates import as_map
    from sim_models.mjcf.imported import imported

    model = imported(source)
    m = model.mechanism
    return Imported(
        case=m.name,
        source=str(source),
        mechanism=m,
        notes=model.notes,
        relations=tuple(map(str, model.relations)),
        map=as_map(model.relations, source.name),
        assumed=assumed(m),
    )
