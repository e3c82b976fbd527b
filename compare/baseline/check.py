"""The baselines of cases in engines: checked, or written where they are not what is found."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import JsonValue

from analytic.kinematics.closure import AssemblyError
from analytic.kinematics.structure import StructureError
from analytic.mechanism import Mechanism
from analytic.mechanism.dotted import by_name
from analytic.mechanism.file import shipped_cases
from analytic.mechanism.one_line import count
from analytic.mechanism.signals import named
from analytic.writing import OutputError, write_atomically
from compare.arguments import Linkage, Names, engines, linkage, modelling, on_request, warn_of_friction
from compare.baseline.comparison import changed, fits, moved, remade
from compare.baseline.file import PLACE_COLUMNS, Baseline, BaselineError, StoredRun, by_itself, owned, read, write
from compare.baseline.runs import of_results, simulated
from compare.check import layout_of, result_files
from compare.faults import ArgumentError, Exit, OptionError
from compare.files import file_name, made_folder, relative
from compare.progress import Progress, progress_bar
from compare.questions.baseline import BASELINES, BaselinesQuestion
from compare.questions.question import answers
from compare.recorded.errors import DataError
from compare.recorded.table import Table, read_table, unused
from compare.results.baselines import Baselines, Entry, Moved, Status
from compare.results.crosscheck import RECORDED
from compare.simulations import Resolve
from sim_models.engine import SimulationError, SimulatorMissing, Unsupported, engine

LOOK = Path("moved")  # a folder for baselines of what is found now, to be compared with those that are stored
if TYPE_CHECKING:
    from compare.questions.check import Results

Made = Callable[[Mechanism, str, Resolve, Sequence[str]], tuple[str, list[StoredRun]]]
Work = Callable[[Path, Mechanism, str, str, Resolve, Made], Entry]
GRAVITY: dict[Status, Exit] = {
    "moved": Exit.DISAGREES,
    "unusable": Exit.BAD_INPUT,
    "failed": Exit.SIMULATOR_FAILED,
}


@answers(BaselinesQuestion)
def check_baselines(question: BaselinesQuestion) -> Baselines:
    """Run every case in every engine, and find all reaction forces that are not where the baseline has them.

    ``cases`` are all shipped ones by default, ``folder`` is where the baseline files are.  A baseline that is missing
    or damaged, and an engine that fails, is an entry with its reason, whatever becomes of the others.  ``results`` are
    files of another program's results of one case, in place of engines; ``map`` says what their columns are.

    Raises MechanismError for a case, Unsupported for an unknown engine, SimulatorMissing where none is installed.
    """
    _one_source(question)
    if question.signals is not None:
        raise ArgumentError("signals", "a baseline has the signals that it was written with; give them to an update")
    folder = Path(question.folder)
    if question.results is not None:
        return _recorded(check_file, question, question.results, folder)
    with progress_bar(question.progress) as progress:
        return _each(check_file, question, folder, progress)


@answers(BaselinesQuestion)
def update_baselines(question: BaselinesQuestion) -> Baselines:
    """Write the baseline of every case in every engine; numbers that have not moved, and files without any that have,
    stay as they are.  Raises OutputError, and what :func:`check_baselines` does.
    """
    _one_source(question)
    update = partial(update_file, signals=question.signals)
    with made_folder(Path(question.folder), "--baselines") as folder, progress_bar(question.progress) as progress:
        if question.results is not None:
            return _recorded(update, question, question.results, folder)
        return _each(update, question, folder, progress)


def _one_source(question: BaselinesQuestion) -> None:
    """Raises ArgumentError for what belongs to engines beside results, or to results that are not given."""
    if question.results is not None and question.simulator != "all":
        raise ArgumentError(
            "simulator", "results are another program's, in place of an engine's; leave one of them out"
        )
    if question.results is None and question.map is not None:
        raise ArgumentError("map", "says what the columns of results are; give them, or leave it out")


def status(baselines: Baselines) -> Exit:
    """The gravest exit status of all entries."""
    return max((GRAVITY.get(entry.status, Exit.AGREES) for entry in baselines.entries), default=Exit.AGREES)


def _each(work: Work, question: BaselinesQuestion, folder: Path, progress: Progress) -> Baselines:
    cases = question.cases
    if cases is None:
        wanted: Sequence[Linkage] = shipped_cases()
    else:
        wanted = [cases] if isinstance(cases, Mechanism | str) or not isinstance(cases, Sequence) else cases
    mechanisms = [
        (linkage(case, large=True), case.name if isinstance(case, Mechanism) else str(case)) for case in wanted
    ]
    installed, left_out = engines(question.simulator)
    names = [modelling(name) for name in installed]
    for mechanism, _ in mechanisms:
        warn_of_friction(mechanism, None, "static")
        on_request(question.signals, mechanism, "driven", usual=True)  # all of them, before a file is written
    entries = []
    for mechanism, typed in mechanisms:
        for name in names:
            entries.append(_safely(work, mechanism, name, folder, ["--case", typed, "--simulator", name]))
            progress("baselines", len(entries), len(mechanisms) * len(names))
    return _baselines(folder, entries, left_out)


def _recorded(work: Work, question: BaselinesQuestion, results: Results, folder: Path) -> Baselines:
    """The baselines of results that another program has recorded of one case."""
    cases, map = question.cases, question.map
    if cases is None or not isinstance(cases, Mechanism | str | Path):
        raise ArgumentError("cases", "results are of one case; give it")
    mechanism = linkage(cases, large=True)
    on_request(question.signals, mechanism, "driven", usual=True)
    files, layout = result_files(results), layout_of(map)
    tables: list[Table] = []

    def made(m: Mechanism, simulator: str, resolve: Resolve, more: Sequence[str]) -> tuple[str, list[StoredRun]]:
        tables.append(read_table(files[simulator], m, layout, timed=False, derived=True))
        return RECORDED, [of_results(m, tables[-1], more)]

    typed = cases.name if isinstance(cases, Mechanism) else str(cases)
    read_by = ["--map", str(map)] if isinstance(map, str | Path) else []
    entries = [
        _safely(work, mechanism, name, folder, ["--case", typed, "--results", str(file), *read_by], made)
        for name, file in files.items()
    ]
    idle = set(layout.columns) - {entry for table in tables for entry in table.used} if tables else set()
    idle = set() if layout.optional else idle
    headings = list(dict.fromkeys(heading for table in tables for heading in table.headings))
    return _baselines(folder, entries, [unused(f"{map}: ", entry, headings) for entry in sorted(idle)])


def _baselines(folder: Path, entries: Sequence[Entry], left_out: Sequence[str]) -> Baselines:
    """What was found, with what differs in sentences."""
    differences = [f"{e.case}, {e.simulator}: {each}" for e in entries if e.status == "moved" for each in e.sentences]
    faults = [e.why for e in entries if e.status in ("unusable", "failed")]
    notes = [
        f"{e.file}: made with {e.simulator} {e.stored_version}, and {e.version} is here"
        for e in entries
        if e.status in ("same", "moved") and e.stored_version != e.version
    ]
    alike = (entry for entry in entries if entry.status == "same" and entry.changed)
    notes += [f"{e.file}: the linkage is another, though no force moved: {e.changed}" for e in alike]
    done = len(entries) - len(faults)
    return Baselines(
        stored=str(folder),
        made_again=f"{done} of {count(len(entries), 'baseline')}",
        differences=tuple(differences),
        notes=tuple(notes),
        left_out=(*left_out, *faults),
        entries=tuple(entries),
    )


def _safely(
    work: Work, mechanism: Mechanism, simulator: str, folder: Path, options: Sequence[str], made: Made = simulated
) -> Entry:
    """The entry of a pair; with the reason in place of an answer where there is a foreseen fault.  ``options`` ask for
    it on a command line.
    """
    path = file_of(folder, mechanism.name, simulator)
    opposite = command("update" if work is check_file else "check", options, folder)
    try:
        entry = work(path, mechanism, simulator, opposite, engine, made)
        if entry.status != "moved":
            return entry
        more = _more(mechanism, read(path, mechanism.name, simulator, opposite))
        asked = [*options, *(["--signals", ",".join(more)] if more else [])]
        return entry.model_copy(update={"look": to_look(path, asked), "accept": opposite})
    except (SimulatorMissing, SimulationError) as error:
        failed: Status = "failed"
        why = error.said(()) if isinstance(error, SimulationError) else str(error)
    except (OptionError, OutputError, Unsupported, AssemblyError, StructureError, DataError) as error:
        failed, why = "unusable", str(error)
    return Entry(case=mechanism.name, simulator=simulator, file=str(path), status=failed, why=why)


def file_of(folder: Path, case: str, simulator: str) -> Path:
    """Where the baseline of a case in an engine is kept."""
    return folder / f"{file_name(case)}-{file_name(simulator)}.toml"


def command(verb: str, options: Sequence[str], folder: Path) -> str:
    """The command line that does this to one baseline, to be pasted into a shell."""
    elsewhere = [] if folder == BASELINES else ["--baselines", str(folder)]
    return relative(shlex.join(["compare", "baseline", verb, *options, *elsewhere]))


def to_look(path: Path, options: Sequence[str]) -> str:
    """The command line that shows every number of a baseline that moved, beside what it is now; it changes none."""
    both = shlex.join(["diff", "-I", "^#", str(path), str(LOOK / path.name)])
    return relative(f"{command('update', options, LOOK)} && {both}")


def check_file(
    path: Path,
    mechanism: Mechanism,
    simulator: str,
    again: str,
    resolve: Resolve = engine,
    made: Made = simulated,
) -> Entry:
    """What moved in the baseline of a file.  ``again`` is the command that writes it anew, ``resolve`` is where the
    engine comes from, ``made`` makes the runs again.

    Raises BaselineError, SimulationError, SimulatorMissing or Unsupported.
    """
    stored = read(path, mechanism.name, simulator, again)
    version, fresh = made(mechanism, simulator, resolve, _more(mechanism, stored))
    misfit = fits(stored.runs, fresh)
    if misfit:
        raise BaselineError(f"{path}: {misfit}; if that is meant, write it anew with: {again}")
    other, moves = remade(stored.runs, fresh), _moved(stored, fresh)
    entry = _entry(path, stored, version, moves, "moved" if moves or other else "same", other)
    return entry.model_copy(update={"changed": changed(stored.linkage, _linkage(mechanism))})


def update_file(
    path: Path,
    mechanism: Mechanism,
    simulator: str,
    checks: str,
    resolve: Resolve = engine,
    made: Made = simulated,
    signals: Names | None = None,
) -> Entry:
    """Write the baseline of a file if anything in it changed; ``checks`` is the command that checks it.  A damaged file
    of the case is replaced.  ``signals`` on request take the place of those that it had.  Raises what
    :func:`check_file` does, and ArgumentError for a signal that the case has not.
    """
    owned(path, mechanism.name, simulator)
    stored = None
    with suppress(BaselineError):
        stored = read(path, mechanism.name, simulator, "")
    asked = on_request(signals, mechanism, "driven", usual=True)
    more = list(dict.fromkeys([*asked, *(_more(mechanism, stored) if signals is None else ())]))
    version, fresh = made(mechanism, simulator, resolve, more)
    lacking = set(asked if signals else ()).difference(c.partition(" [")[0] for run in fresh for c in run.columns)
    if lacking:
        names = ", ".join(sorted(lacking))
        raise ArgumentError(
            "signals", f"no run of {mechanism.name} in {simulator} that moves has {names}; leave it out"
        )
    new = Baseline(mechanism.name, simulator, version, tuple(fresh), linkage=_linkage(mechanism))
    moves: tuple[Moved, ...] = ()
    old, why = new, "written"
    if stored is not None:
        old, why, new = stored, "rewritten: other runs than before", replace(new, tolerance=stored.tolerance)
        if not (fits(stored.runs, fresh) or remade(stored.runs, fresh)):
            moves = _moved(stored, fresh)
            new = replace(new, runs=tuple(_kept(stored, fresh, moves)))
            same = not moves and version == stored.version and not changed(stored.linkage, new.linkage)
            why = "" if same else "rewritten"
    if why:
        write_atomically(path, write(new, checks))
    return _entry(path, old, version, moves, "written" if why else "unchanged", why)


def _linkage(mechanism: Mechanism) -> dict[str, JsonValue]:
    """What a linkage's file says, as a baseline has it."""
    fields = by_name(mechanism)
    return {name: value for name, value in json.loads(json.dumps(fields)).items() if name != "name"}


def _more(mechanism: Mechanism, stored: Baseline | None) -> list[str]:
    """The signals that a baseline has of its case because somebody asked for them."""
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)
    columns = dict.fromkeys(column for run in (stored.runs if stored else ()) for column in run.columns)
    names = [column.partition(" [")[0] for column in columns if by_itself(column)]
    return [name for name in names if name in known]


def _entry(path: Path, stored: Baseline, version: str, moves: tuple[Moved, ...], became: Status, why: str) -> Entry:
    return Entry(
        case=stored.case,
        simulator=stored.simulator,
        file=str(path),
        status=became,
        version=version,
        stored_version=stored.version,
        runs=len(stored.runs),
        signals=sum(len(_signals(run)) for run in stored.runs),
        numbers=sum(run.rows.size for run in stored.runs),
        compared={run.name: tuple(_signals(run)) for run in stored.runs if not run.skipped},
        moved=moves,
        why=why,
    )


def _signals(run: StoredRun) -> list[str]:
    """The names of what a run has, but for the place of each row."""
    return [column.partition(" [")[0] for column in run.columns if column not in PLACE_COLUMNS]


def _moved(stored: Baseline, fresh: Sequence[StoredRun]) -> tuple[Moved, ...]:
    pairs = zip(stored.runs, fresh, strict=True)
    return tuple(each for old, new in pairs for each in moved(old, new, stored.tolerance))


def _kept(stored: Baseline, fresh: Sequence[StoredRun], moves: Sequence[Moved]) -> Iterator[StoredRun]:
    """The old run where nothing in it moved, so that a rewritten file differs in what moved and nothing else."""
    changed = {each.run for each in moves}
    for old, new in zip(stored.runs, fresh, strict=True):
        yield new if new.name in changed else old
