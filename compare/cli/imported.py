"""``compare import``: a mechanism file from somebody's model file."""

from pathlib import Path
from typing import Annotated

from compare.cli.folders import refuse_others
from compare.cli.typed import CommandLine, Overwrite, Shown, command
from compare.questions.listing import ImportQuestion
from compare.questions.option import Option, Written
from compare.questions.question import Question


class Target(Question):
    """The file that is to be written."""

    out: Annotated[Path, Option("Mechanism file (TOML) to write.", Written("FILE"))]


@command(ImportQuestion, Target, Overwrite, Shown)
def import_(line: CommandLine) -> None:
    """Read a MuJoCo model (MJCF) of a planar linkage, or a URDF file, and write it as a mechanism file.

    Bodies, hinges, slides, loops closed by connect or weld, inertia, and what drives it are read; what MJCF has no word
    for, or a mechanism file none, is said in notes or refused.

    Exit status: 0 written, 2 bad input, 3 MuJoCo is missing.
    """
    with line.complaints():
        from analytic.writing import OutputError, write_together
        from compare.files import alone_in, made_folder
        from compare.imported import import_mjcf

        out = line.asked(Target).out
        imported = line.ask(import_mjcf, ImportQuestion)
        if out.is_dir():
            raise OutputError(f"--out {out}: it is a folder; name the file to write, such as {out / 'linkage.toml'}")
        with made_folder(out.parent) as folder, alone_in(folder):
            texts = {out.name: imported.text, f"{out.stem}.map.toml": imported.map}
            refuse_others(line.context, folder, texts, line.asked(Overwrite).overwrite)
            write_together(folder, texts)
        beside = out.with_name(f"{out.stem}.map.toml")
        line.show(imported.model_copy(update={"path": str(out), "map_path": str(beside)}))
