"""``compare export``: an engine's own model and a script that runs it without this project."""

from __future__ import annotations

import shlex
from pathlib import Path

from compare.cli.folders import refuse_others
from compare.cli.publish import say
from compare.cli.typed import CommandLine, Overwrite, Shown, command
from compare.questions.analyse import ExportQuestion


@command(ExportQuestion, Overwrite, Shown)
def export(line: CommandLine) -> None:
    """Write the engine's own model and a script that runs it without this project, to be checked by anyone.

    ``python DIR/run.py`` needs the bare engine and numpy; it says how far its signals are from those found here.
    Exit status: 0 written, 2 bad input, 3 the simulator is missing or failed.
    """
    with line.complaints():
        from analytic.mechanism.assumed import assumed
        from analytic.writing import write_together
        from compare.arguments import linkage, noted, one_engine
        from compare.export import exported, used_in
        from compare.files import alone_in, made_folder
        from compare.omissions import Asked, omitted
        from compare.results.export import Exported
        from sim_models.common.contact_laws import assumed_of_contact
        from sim_models.engine import declared

        question = line.asked(ExportQuestion)
        joint_model, motion, simulator = question.joint_model, question.motion, one_engine(question.simulator)
        mechanism = linkage(question.mechanism, question.clearance, large=question.large)
        with made_folder(Path(question.folder)) as folder:
            with noted() as warned:
                texts = exported(question)
            settings = used_in(texts)
            with alone_in(folder):
                refuse_others(line.context, folder, texts, line.asked(Overwrite).overwrite)
                paths = tuple(str(path) for path in write_together(folder, texts))
        left_out = tuple(omitted(mechanism, Asked.of_engines("export", mechanism, motion, joint_model)))
        say(left_out)
        document = Exported(
            case=mechanism.name,
            simulator=simulator,
            joint_model=joint_model,
            motion=motion,
            paths=paths,
            needs=(declared(simulator).package, "numpy"),
            run=f"python {shlex.quote(str(folder / 'run.py'))}",
            settings=settings,
            assumed=(*assumed(mechanism), *assumed_of_contact(mechanism, mechanism.clearances, settings)),
            warnings=(*left_out, *warned),
        )
        line.show(document)
