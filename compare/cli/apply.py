"""``compare apply``: an explained mechanism's numbers, written back into somebody's model file."""

from pathlib import Path
from typing import Annotated

from compare.cli.folders import refuse_others
from compare.cli.typed import CommandLine, Overwrite, Shown, command
from compare.questions.listing import ApplyQuestion
from compare.questions.option import Option, Written
from compare.questions.question import Question


class Model(Question):
    """The model file that is to be written."""

    out: Annotated[
        Path | None, Option("Model file to write [that of --to, with -explained in its name].", Written("FILE"))
    ] = None


@command(ApplyQuestion, Model, Overwrite, Shown)
def apply_(line: CommandLine) -> None:
    """Write the numbers of a mechanism, such as explained.toml, into the MuJoCo model (MJCF) that it came from.

    Lengths, masses, centres of mass, inertias, damping, dry friction and springs of joints; nothing else in the file
    changes, and what MJCF has no word for is said.

    Exit status: 0 written, 2 bad input, 3 MuJoCo is missing.
    """
    with line.complaints():
        from analytic.writing import OutputError, write_together
        from compare.applied import apply
        from compare.files import alone_in, made_folder

        question, out = line.asked(ApplyQuestion), line.asked(Model).out
        to = Path(question.to)
        out = out or to.with_name(f"{to.stem}-explained{to.suffix}")
        if out.is_dir():
            raise OutputError(f"--out {out}: it is a folder; name the file to write, such as {out / 'model.xml'}")
        applied = line.ask(apply, ApplyQuestion)
        with made_folder(out.parent) as folder, alone_in(folder):
            refuse_others(line.context, folder, {out.name: applied.text}, line.asked(Overwrite).overwrite)
            write_together(folder, {out.name: applied.text})
        line.show(applied.model_copy(update={"path": str(out)}))
