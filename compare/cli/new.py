"""``compare new``: a mechanism file to begin with."""

from __future__ import annotations

from pathlib import Path

import typer

from compare.cli.typed import CommandLine, Overwrite, command
from compare.questions.listing import NewQuestion


@command(NewQuestion, Overwrite)
def new(line: CommandLine) -> None:
    """Write NAME.toml, a mechanism file of this kind with comments, to change into yours.

    Exit status: 0 written, 2 bad input.
    """
    with line.complaints():
        from analytic.writing import OutputError, write_atomically
        from compare.new import new

        text = line.ask(new, NewQuestion)
        out = Path(f"{line.asked(NewQuestion).name.removesuffix('.toml')}.toml")
        if out.exists() and not line.asked(Overwrite).overwrite:
            raise OutputError(f"{out}: it is there already; choose another name, or add --overwrite")
        write_atomically(out, text)
        typer.echo(f"written: {out}; look at it with: compare {out}")
