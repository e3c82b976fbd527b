"""``compare validity``: over speed and clearance, where the analytic model agrees with a simulation, and what fails
where it does not.
"""

from __future__ import annotations

from compare.cli.publish import finished, put, resumed
from compare.cli.typed import CommandLine, Shown, Where, command
from compare.faults import Exit, stop
from compare.files import alone_in, made_folder
from compare.questions.validity import ValidityQuestion


@command(ValidityQuestion, Where, Shown)
def validity(line: CommandLine) -> None:
    """Say at which speeds and clearances the analytic model holds, where contact is lost, and which assumption fails.

    An interrupted map goes on where it stopped.  Exit status: 0 computed, 2 bad input, 3 a simulator is missing or
    fails in every cell.
    """
    with line.complaints() as caught:
        from compare.domain_map.validity import validity
        from compare.results.validity import Failed

        files = ("validity.json", "validity.csv", "validity.md", "validity.svg")
        place = line.folder(f"{line.stem}-validity", *files)
        with made_folder(place) as folder, resumed():
            with alone_in(folder, patience=0.0):  # two maps would take each other's records away
                result = finished(line.ask(validity, ValidityQuestion, records=folder / "runs"), caught)
                put(result, folder, line.asked(Where).overwrite, line.context)
        line.show(result, folder)
        failed = [cell.failure for cell in result.cells if isinstance(cell, Failed)]
        if len(failed) == len(result.cells):
            raise stop(f"every cell failed, the first because {failed[0]}", Exit.SIMULATOR_FAILED)
