"""``compare import``: a mechanism file from somebody's model file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compare.cli.folders import Overwrite, refuse_others
from compare.cli.options import Json, Quiet, place
from compare.cli.publish import show
from compare.faults import complaints


def import_(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="MJCF file of a planar linkage.")],
    out: Annotated[Path, typer.Option(parser=place, metavar="FILE", help="Mechanism file (TOML) to write.")],
    overwrite: Overwrite = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Read a MuJoCo model (MJCF) of a planar linkage, and write it as a mechanism file.

    Bodies, hinges, slides, loops closed by connect or weld, inertia, and what drives it are read; what MJCF has no word
    for, or a mechanism file none, is said in notes or refused.

    Exit status: 0 written, 2 bad input, 3 MuJoCo is missing.
    """
    with complaints(context):
        from compare.files import OutputError, alone_in, made_folder, write_atomically
        from compare.imported import import_mjcf

        found = import_mjcf(file)
        if out.is_dir():
            raise OutputError(f"--out {out}: it is a folder; name the file to write, such as {out / 'linkage.toml'}")
        with made_folder(out.parent) as folder, alone_in(folder):
            refuse_others(context, folder, {out.name: found.text}, overwrite)
            write_atomically(out, found.text)
        show(found.model_copy(update={"path": str(out)}), json=json, quiet=quiet)
