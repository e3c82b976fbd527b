"""The cross-check of recorded results: what any program has written of a linkage, held against the analytic model.

A file of columns is the simulated side.  The analytic side follows the crank that the file records, or lets go of the
linkage where the file begins; engines may be asked for the same motion, so that three parties can say who stands apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter1d

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.initial import set_off
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.columns import ANY_LAYOUT, Layout, read_map
from analytic.mechanism.errors import quoted
from analytic.mechanism.one_line import enumerated, shown
from analytic.mechanism.signals import Signal, driving, named, position
from analytic.mechanism.tolerances import Source
from analytic.mechanism.units import dimension
from analytic.paper.clearance import Model
from compare.arguments import (
    cores,
    engines,
    idle,
    laid_over,
    linkage,
    looks_like_degrees,
    loose,
    noted,
    path,
    rigidly_and_evenly_driven,
    warn_of_friction,
)
from compare.crosscheck import STRIKING, Job, Ran, concluded, judged, run_all
from compare.diagnose.data.recording import Measured, MeasuredRun
from compare.faults import ArgumentError
from compare.judge.discrepancy import UNCOMPARED, Rule, difference
from compare.judge.metrics import metrics, rms
from compare.judge.reference import (
    SIGMAS,
    Reference,
    left_open,
    reference,
    silenced,
    without_edges,
)
from compare.judge.reruns import JudgedRun
from compare.judge.signals import prescribed
from compare.omissions import Asked, omitted
from compare.progress import Progress, progress_bar
from compare.questions.check import CheckQuestion
from compare.questions.question import answers
from compare.recorded.alternatives import LIKE_UNIT, REVERSED, TableReading, line, looks, mended, otherwise
from compare.recorded.body_frames import vectors
from compare.recorded.errors import DataError
from compare.recorded.frames import FrameSource, frame_source, is_frame
from compare.recorded.headings import Column
from compare.recorded.motion import (
    LEAST_SAMPLES,
    NEIGHBOURS,
    RecordedDrives,
    RecordedMotion,
    RecordedRelease,
    ReleaseState,
    evenly,
    released_from,
)
from compare.recorded.recording import Recording, recording
from compare.recorded.rounding import rounding
from compare.recorded.table import Table, read_parts, unused
from compare.recorded.turned import looks_late, looks_turned
from compare.results.band import Metrics
from compare.results.crosscheck import RECORDED, CrossCheck
from compare.toleranced import of_signals, states_tolerances, varying
from sim_models.common.contact_laws import contact_parameters
from sim_models.engine import JointModel, Motion, Request, Trace, engine

NAMED = 4  # columns of which something is said, by name
FRAME = "results"  # the name of a frame that is given alone
LEFT_OPEN = 0.5  # of what a signal may differ by: where the course leaves it open by more, that is said


@answers(CheckQuestion)
def check(question: CheckQuestion) -> CrossCheck:
    """Hold the analytic model of a linkage against what another program has computed of it.

    ``map`` says what the columns of ``results`` are where their headings do not; measured data (``lc.measured``) say so
    themselves, and what they are of.  In ``driven`` motion the analytic side follows the crank's angle over time;
    without that column it turns at ``drive.speed``; a linkage without a motor is let go in the state that the file
    begins with, and so are freedoms beside driven ones.  In ``static`` motion every row is an equilibrium, of several
    drives at its time.  ``simulators`` simulate the first file's motion beside, with ``verify`` in shorter steps too.
    Every run states its validation metrics (:mod:`compare.judge.metrics`).

    Raises MechanismError, ArgumentError, ToleranceError, MapError, DataError with every fault of the files,
    ScheduleError, AssemblyError, Unsupported or SimulatorMissing.
    """
    motion, chosen, map = question.motion, question.joint_model, question.map
    tolerances, layout = laid_over(question.tolerances), layout_of(map, question.columns)
    measured = question.results if isinstance(question.results, Measured) else None
    with noted() as warned:
        mechanism = question.mechanism if measured is None else _of_measured(measured, question)
        given = rigidly_and_evenly_driven(linkage(mechanism, question.clearance, large=question.large))
        names, left_out = engines(question.simulator) if question.simulator is not None else ((), [])
        if question.verify and not (names and motion == "driven"):
            left_out.append(f"{given.name}: verify is left out; it is of the steps of engines beside, in driven motion")
        varied, told = varying(given, question.clearance is not None) if states_tolerances(given) else ((), [])
        left_out += told
        loose(given, chosen)
        model: JointModel = chosen or ("contact" if given.clearances else "ideal")
        warn_of_friction(given, model, motion)
        timed = motion == "driven" or not given.cranked
        tables = _tables(result_files(question.results), given, layout, str(map), timed=timed, split=question.split)
        if measured is not None:
            tables = [(*t[:2], _scattered(t[2], run)) for t, run in zip(tables, measured.runs, strict=True)]
        recordings = [recording(name, file, table, given, motion, model) for name, file, table in tables]
        if measured is not None:
            recordings = [replace(r, replaced=run.loads) for r, run in zip(recordings, measured.runs, strict=True)]
        begun = all(each.starts and all(state.recorded for state in each.starts) for each in recordings)
        left_out += omitted(given, Asked("check", motion, (chosen or "contact",), begun=begun))
        set_off(Assembly(given), recordings[0].schedule(given, motion == "static"))  # raises where it has no freedom
        given = given.replace(initial={})  # the recordings have it
    moves = _followed(given, *recordings)
    job = Job(
        _loaded(moves, recordings[0], motion) if len(recordings) == 1 else moves,
        names,
        tolerances,
        Schedule(),
        joint_model=model,
        model=question.analytic,
        workers=question.workers or (cores() if len(names) > 1 else 1),
        warnings=(*warned, *left_out, *idle(given, question.analytic, model), *_warnings(given, recordings, motion)),
        verify=question.verify and motion == "driven",
    )
    asked = _Asked(given, job, model, motion, varied)
    remarks: list[str] = []
    ran = Ran()
    with progress_bar(question.progress) as progress:
        for k, record in enumerate(recordings):
            progress(f"check {record.name}", k, len(recordings))
            judgement, told = _held(asked, record)
            remarks += told
            ran += Ran((judgement,))
        if names:
            ran += _engines(asked, recordings[0], progress)
    first = ran.judged[0]
    others = dict.fromkeys(run.run.simulator.name for run in ran.judged if not _alike(run, first))
    if others:
        remarks.append(
            f"{', '.join(others)}: has other samples than {first.run.simulator.name}, so that who stands apart is asked"
            " of the rest; give tables of one motion with the same rows"
        )
    job = replace(job, warnings=(*job.warnings, *remarks))
    return concluded(job, ran, lambda run: _alike(run, first))


def _held(asked: _Asked, record: Recording) -> tuple[JudgedRun, list[str]]:
    """A recording held to the analytic side, and what there is to say of it.  Raises DataError."""
    try:
        side, judgement = asked.judged(record)
    except AssemblyError as error:
        remedy = asked.meant(record) or "check the angles, their unit and their sign"
        raise DataError(f"{Path(record.file).name}: {error}; {remedy}") from None
    if contradictions := _contradictions(record, judgement):
        remedy = asked.meant(record) or "leave one of them out"
        raise DataError(*(f"{Path(record.file).name}: {each}; {remedy}" for each in contradictions))
    found = asked.metrics(record, side, judgement)
    judgement = replace(judgement, run=judgement.run.model_copy(update={"metrics": found}))
    return judgement, [*side.remarks, *asked.sentences(record, side, judgement)]


# ---------------------------------------------------------------- files


def layout_of(given: object, headings: Sequence[str] | None = None) -> Layout:
    """How files are written, as a map says, and with these headings if they have none.  Raises ArgumentError or
    MapError.
    """
    layout = given if isinstance(given, Layout) else ANY_LAYOUT
    if given is not None and given is not layout:
        layout = read_map(path(given, "map"), Layout)
    return layout if headings is None else layout.model_copy(update={"headings": tuple(headings)})


def result_files(results: object) -> dict[str, Path | FrameSource]:
    """Files and frames by the name of whoever wrote them: files' own names without what is alike.  Raises ArgumentError
    or DataError.
    """
    if isinstance(results, Measured):
        return {run.name: _as_frame(run, results.mechanism) for run in results.runs}
    if is_frame(results) and not isinstance(results, Mapping):
        return {FRAME: frame_source(FRAME, results)}
    if isinstance(results, Mapping) and results:
        unnamed = [name for name in results if not str(name).strip()]
        if unnamed:
            raise ArgumentError("results", f"{quoted(unnamed[0])} is no name of a program; give each file one")
        return {
            str(name): frame_source(str(name), given) if is_frame(given) else path(given, "results")
            for name, given in results.items()
        }
    several = [results] if isinstance(results, str | PathLike) else results
    if not isinstance(several, Sequence) or not several:
        what = f"{type(results).__name__} {shown(str(results))}"
        raise ArgumentError("results", f"{what} cannot be used; give a file of results or a frame, or several by name")
    files = [path(file, "results") for file in several]
    names = [file.stem for file in files]
    if len(set(names)) < len(names):
        names = [f"{file.absolute().parent.name}/{file.stem}" for file in files]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ArgumentError("results", f"{twice} is there twice; give each file once")
    return dict(zip(names, files, strict=True))


def _of_measured(measured: Measured, question: CheckQuestion) -> Mechanism:
    """The mechanism that measured data are of, free where its runs are.  Raises ArgumentError for what they say."""
    m, drives = measured.mechanism, {run.drive for run in measured.runs}
    if question.mechanism != CheckQuestion.mechanism:
        raise ArgumentError("mechanism", f"these data are measured of {m.name}; leave it out, or read them for another")
    if question.map is not None:
        raise ArgumentError("map", "measured data say which signal each column is; leave it out")
    for given, called in ((question.columns, "columns"), (question.split or None, "split")):
        if given is not None:
            raise ArgumentError(called, "it says how a file is read, and measured data are read already; leave it out")
    if drives == {"free"} and m.drive is not None:
        return m.with_drive(speed="free")
    if "free" in drives and len(drives) > 1:
        raise ArgumentError("results", "some runs are free and others driven; give lc.measured runs of one kind")
    return m


def _as_frame(run: MeasuredRun, m: Mechanism) -> FrameSource:
    """A measured run as a frame in SI; one without an encoder has its command for it."""
    columns: dict[str, np.ndarray | str] = {"time [s]": run.time}
    columns |= {f"{name} [{channel.signal.unit}]": channel.values for name, channel in run.channels.items()}
    if run.speed is not None and run.angle is not None and m.encoder.name not in run.channels:
        columns[f"{m.encoder.name} [{m.encoder.unit}]"] = run.angle + run.speed * run.time
    return FrameSource(f"run {run.name!r}", columns)


def _scattered(table: Table, run: MeasuredRun) -> Table:
    """A table of a measured run, whose readings scatter by its sensors' noise."""
    return replace(table, scatter={name: SIGMAS * channel.noise for name, channel in run.channels.items()})


def _tables(
    files: Mapping[str, Path | FrameSource],
    mechanism: Mechanism,
    layout: Layout,
    where: str,
    *,
    timed: bool,
    split: bool,
) -> list[tuple[str, str, Table]]:
    """Every file or frame as a table, by a map that is called ``where``.  Raises DataError with all their faults."""
    timed = timed and mechanism.speed is None  # at a constant speed an angle tells the time
    tables: list[tuple[str, str, Table]] = []
    faults: list[str] = []
    for name, file in files.items():
        try:
            parts = read_parts(file, mechanism, layout, timed=timed, derived=True, split=split)
            names = [name] if len(parts) == 1 else [f"{name} part {k}" for k in range(1, len(parts) + 1)]
            tables += [(each, str(file), table) for each, table in zip(names, parts, strict=True)]
        except DataError as error:
            faults += error.faults
    used = {entry for _, _, table in tables for entry in table.used}
    headings = list(dict.fromkeys(heading for _, _, table in tables for heading in table.headings))
    faults += (
        []
        if faults or layout.optional
        else [unused(f"{where}: ", entry, headings) for entry in layout.columns if entry not in used]
    )
    if faults:
        raise DataError(*faults)
    return tables


def _warnings(mechanism: Mechanism, recordings: Sequence[Recording], motion: Motion) -> list[str]:
    """What was made of the files, in sentences."""
    sentences = []
    for record in recordings:
        sentences += list(record.table.notes)
        if isinstance(record.moved, ReleaseState) and f"{mechanism.driven}_angle" not in record.table.values:
            sentences.append(
                f"{record.name}: does not say where the linkage begins; it is let go as it is assembled,"
                + (f" at {record.moved.rate:.5g} rad/s" if record.moved.rate else " at rest")
            )
        sentences += _not_told(record, mechanism)
        sentences += _off_speed(record, mechanism) if motion == "driven" else []
        if record.moved is None and record.table.time.size and mechanism.encoder.name not in record.table.values:
            where = f"{np.degrees(mechanism.assembly[mechanism.driven]):.4g} deg"
            sentences.append(
                f"{record.name}: does not say where its crank is; at time 0 it is taken to be at {where}, where the"
                " linkage is assembled"
            )
        sentences += _absent(record)
    return sentences


def _not_told(record: Recording, mechanism: Mechanism) -> list[str]:
    """Sentences on freedoms beside others of which the table does not say how they begin."""
    sentences = []
    for joint, state in record.moved.start.items() if isinstance(record.moved, RecordedRelease) else ():
        unit = "m/s" if mechanism.joint(joint).prismatic else "rad/s"
        rate = f"at {state.rate:.5g} {unit}" if state.rate else "at rest"
        how = ", as its positions begin" if state.errors[1] else ""
        what = f"how fast joint {joint} begins; it is let go" if state.placed else f"where joint {joint} begins; it is"
        if not state.recorded or not state.placed:
            as_file = "" if state.placed else " let go as it is assembled,"
            sentences.append(f"{record.name}: does not say {what}{as_file} {rate}{how}")
    return sentences


def _absent(record: Recording) -> list[str]:
    """A sentence on cells without a number, if there are any."""
    absent = {signal: int(np.sum(np.isnan(values))) for signal, values in record.table.values.items()}
    absent = {signal: cells for signal, cells in absent.items() if cells}
    if not absent:
        return []
    low, high = min(absent.values()), max(absent.values())
    cells = f"{low} to {high}" if low < high else f"{low}"
    rows = next(iter(record.table.values.values())).size
    are = "is" if len(absent) == 1 else "are"
    return [f"{record.name}: {_first_named(list(absent))} {are} absent in {cells} of {rows} rows, which are left out"]


def _followed_drives(record: Recording, mechanism: Mechanism) -> dict[Signal, tuple[np.ndarray, float]]:
    """Of each drive with a speed whose recorded course is followed: its encoder, its positions (N,) rad, m, and its
    speed (rad/s, m/s).
    """
    if isinstance(record.moved, RecordedMotion) and mechanism.speed is not None:
        return {mechanism.encoder: (record.theta, mechanism.speed)}
    drives, speeds = record.drives, mechanism.drive_speeds
    return {position(mechanism.joint(n)): (each.moving.theta, speeds[n]) for n, each in drives.items() if n in speeds}


def _off_speed(record: Recording, mechanism: Mechanism) -> list[str]:
    """A sentence on drives that do not move evenly at their speed."""
    off, time = [], record.table.time
    for encoder, (values, speed) in _followed_drives(record, mechanism).items():
        unit, rounded, late = f"{encoder.unit}/s", record.table.rounding(encoder.name), rounding(time)
        if evenly(time, values, speed, rounded, late) is not None:
            continue
        verb = "turn" if encoder.wraps else "move"
        what = "its crank" if isinstance(record.moved, RecordedMotion) else f"joint {encoder.place}"
        mean = float(values[-1] - values[0]) / float(time[-1] - time[0])
        if evenly(time, values, mean, rounded, late) is None:
            off.append(f"{what} does not {verb} evenly at drive.speed = {speed:g} {unit}")
        else:
            off.append(f"{what} {verb}s evenly, but at {mean:.5g} {unit} where drive.speed = {speed:g}")
    its = "its recorded course is" if len(off) == 1 else "their recorded courses are"
    return [f"{record.name}: {', '.join(off)}; {its} followed, and drive.speed left out"] if off else []


def _clocked(record: Recording, mechanism: Mechanism) -> list[str]:
    """A sentence on a clock by which all drives have their speeds, where by the one that is read none has."""
    drives = _followed_drives(record, mechanism)

    def at_speed(table: Table) -> list[bool]:
        time = table.time
        late, first = rounding(time), slice(time.size)
        return [
            evenly(time, values[first], speed, table.rounding(encoder.name)[first], late) is not None
            for encoder, (values, speed) in drives.items()
        ]

    read = TableReading.of(record.table)
    if not drives or any(at_speed(read.table)):
        return []
    meant = next((each for each in read.clocks() if all(at_speed(each.table))), None)
    if meant is None:
        return []
    return [f"{record.name}: with {meant.words} drive.speed holds: say {meant.lines} under [columns] of a map"]


# ---------------------------------------------------------------- both sides


def _followed(mechanism: Mechanism, *recordings: Recording) -> Mechanism:
    """The mechanism, with a motor that follows the record where its crank does not turn evenly in one of these."""
    uneven = any(isinstance(record.moved, RecordedMotion) for record in recordings)
    if not uneven or mechanism.speed is None or mechanism.drive is None:
        return mechanism
    return mechanism.with_drive(speed="measured")


def _loaded(mechanism: Mechanism, record: Recording, motion: Motion) -> Mechanism:
    """A mechanism with the loads of a recording.  Raises DataError."""
    if not record.table.loads and record.replaced is None:
        return mechanism
    return mechanism.replace(loads=record.loads(mechanism, motion == "static"))


def _loaded_otherwise(record: Recording) -> Recording:
    """A recording whose loads are off by what they are rounded to, or, where the motion between samples follows from
    them, are known at every second one alone.
    """
    loads = []
    for column, values in record.table.loads:
        if record.starts:
            row = np.arange(values.size)
            loads.append((column, np.where((row % 2 == 0) | (row == values.size - 1), values, math.nan)))
        else:
            loads.append((column, values + column.step * rounding(column.readings(values))))
    return replace(record, table=replace(record.table, loads=tuple(loads)))


def _with_load_errors(side: Reference, other: Reference) -> Reference:
    """A side with what its loads leave open, by how far it is from another with the ``other`` loads."""
    unsure = {name: np.array(values) for name, values in side.unsure.items()}
    for name in side.signals.keys() & other.signals.keys():
        apart = np.nan_to_num(np.abs(np.asarray(side.signals[name] - other.signals[name])))
        unsure[name] = unsure.get(name, 0.0) + apart / SIGMAS
    return replace(side, unsure=unsure)


@dataclass(frozen=True)
class _Asked:
    """The check of each file: the mechanism as it is given, and the job with the joint model that all have."""

    given: Mechanism
    job: Job
    joint_model: JointModel
    motion: Motion
    varied: tuple[Source, ...] = ()

    def mechanism(self, record: Recording) -> Mechanism:
        """The mechanism as it moves in a recording, with the loads that this has."""
        return _loaded(_followed(self.given, record), record, self.motion)

    def job_of(self, record: Recording) -> Job:
        """The job for the samples of a recording."""
        m = self.mechanism(record)
        return replace(self.job, mechanism=m, schedule=record.schedule(m, self.motion == "static"))

    def side(self, record: Recording, tried: bool = False) -> Reference:
        """The analytic side at a recording's samples, with what its loads leave open unless it is only ``tried``.
        Raises AssemblyError.
        """

        def of(record: Recording) -> Reference:
            return _analytic_side(record, self.mechanism(record), self.motion, self.joint_model, self.job.model)

        exact = tried or not record.table.loads
        return of(record) if exact else _with_load_errors(of(record), of(_loaded_otherwise(record)))

    def judged(self, record: Recording, tried: bool = False) -> tuple[Reference, JudgedRun]:
        """The analytic side of a recording, and the recording held to it.  Raises AssemblyError."""
        side = self.side(record, tried)
        trace = _trace(record, self.mechanism(record), self.joint_model, self.motion)
        judgement = judged(self.job_of(record), _with_rounding(side, record), trace)
        if not judgement.rules and not judgement.run.reason:
            why = (
                "; ".join(_not_judged(record, side, judgement, self.mechanism(record)))
                or "no column has a number to compare"
            )
            judgement = replace(judgement, run=judgement.run.model_copy(update={"reason": why}))
        return side, judgement

    def metrics(self, record: Recording, side: Reference, judgement: JudgedRun) -> dict[str, Metrics]:
        """Validation metrics of what is judged of a recording's columns: of the analytic side, or of an engine that
        made the same motion and states what its steps make.
        """
        run, judged_on = judgement.run, {each.signal for each in judgement.run.discrepancies}
        columns = {c.signal.name: c.signal for c in record.table.columns if _judged_by(c.signal, judged_on)}
        simulated = run.analytic if run.simulator.recorded else {name: run.simulated[name] for name in run.numerical}
        made = self._as_made(record, side)
        found = {}
        for name, signal in columns.items():
            if name not in simulated:
                continue
            read = record.table.values[name]
            u_input = math.hypot(*(rms(of[name]) for of in (side.unsure, made) if name in of))
            steps = run.numerical[name].u_num if name in run.numerical else 0.0
            error = signal.apart(simulated[name], read)
            found[name] = metrics(signal.unit, error, read, _noise(record, name), u_num=steps, u_input=u_input)
        return {name: each for name, each in found.items() if each is not None}

    def _as_made(self, record: Recording, side: Reference) -> dict[str, np.ndarray]:
        """What tolerances do to signals (N,) along a recording, a standard deviation.  Raises MechanismError."""
        if not self.varied:
            return {}
        found = of_signals(
            self.given,
            self.varied,
            side.signals,
            lambda m: replace(self, given=m).side(record, tried=True).signals,
            0,
            0,
        )
        return {name: np.asarray(each.sd) for name, each in found.signals.items()}

    def sentences(self, record: Recording, side: Reference, judgement: JudgedRun) -> list[str]:
        """Remarks on a file for the reader beside its verdict, in sentences."""
        m, rules = self.mechanism(record), judgement.rules
        sentences = [f"{record.name}: {why}" for why in _not_judged(record, side, judgement, m)] if rules else []
        if self.motion == "driven":
            sentences += _coarse(record, side, rules, m)
        off = judgement.run.verdict == "disagrees"
        if off and (meant := self.meant(record)):
            return [*sentences, f"{record.name}: {meant}"]
        if self.motion == "driven":
            sentences += _clocked(record, self.given)
        turned = _turned(record, side, judgement, m)
        sentences += [*filter(None, turned.values()), *_units(record, side, judgement, told=turned)]
        if off and record.moved is None and self.motion == "driven" and record.time is None and self.rests(record):
            sentences.append(f"{record.name}: agrees with the linkage at rest; compare it in static motion")
        return sentences

    def rests(self, record: Recording) -> bool:
        """Whether rows that have no time are as the linkage is at rest; where loads act over it they are not."""
        if record.table.loads:
            return False
        still = replace(self, motion="static")
        return still.judged(record)[1].run.verdict == "agrees"

    def meant(self, record: Recording) -> str:
        """What a map may have to say: by what would agree then, or by angles that look like degrees."""
        return self._meant(record) or _in_degrees(record, self.given)

    def _meant(self, record: Recording) -> str:
        """What a map has to say where most of what disagrees agrees once the clock or an encoder is read otherwise;
        empty where nothing does, and of freedoms that are let go beside others, of which each reading takes too long.

        Where bodies are depends on the encoders alone, so that these are right where no pose disagrees.
        """
        if isinstance(record.moved, RecordedRelease):
            return ""
        best = TableReading.of(record.table)
        as_read = agreeing = self._agreeing(record, best)
        ways: list[Callable[[TableReading], Iterable[TableReading]]] = [
            lambda r: r.encoders(self.given),
            TableReading.clocks,
        ]
        known = named(self.given.bodies, self.given.joints, self.given.drives, self.given.sensors)
        poses = [agrees for name, agrees in as_read.items() if known[name].kind in ("pose", "rotation")]
        for way in ways[1:] if poses and all(poses) else ways:
            for reading in way(best):
                if agreeing and all(agreeing.values()):
                    break
                other = self._agreeing(record, reading)
                if sum(other.values()) > sum(agreeing.values()):
                    best, agreeing = reading, other
        agree, then, compared = sum(as_read.values()), sum(agreeing.values()), len(as_read) or len(agreeing)
        if 2 * (then - agree) <= compared - agree:
            return ""
        now = f"{agree} as it is read" if as_read else "as it is read the linkage does not reach its angles"
        comparisons = f"{then} of {len(agreeing)} comparisons agree with {best.words}, {now}"
        return f"{comparisons}: say {best.lines} under [columns] of a map"

    def _agreeing(self, record: Recording, reading: TableReading) -> dict[str, bool]:
        """Whether each signal agrees; nothing where the linkage does not move so."""
        try:
            again = recording(record.name, record.file, reading.table, self.given, self.motion, self.joint_model)
            discrepancies = self.judged(again, tried=True)[1].run.discrepancies
        except (DataError, AssemblyError):
            return {}
        return {each.signal: each.verdict == "agrees" for each in discrepancies}


def _in_degrees(record: Recording, mechanism: Mechanism) -> str:
    """What to ask about an encoder in radians that goes beyond two turns in steps of degrees: whole and half ones, or
    of a radian and more.
    """
    for column in (c for c in record.table.columns if c.signal in mechanism.encoders and c.unit == "rad"):
        angle = record.table.values[column.signal.name]
        angle = angle[np.isfinite(angle)]
        largest = float(np.max(np.abs(angle), initial=0.0))
        if looks_like_degrees(largest) and (np.median(np.abs(np.diff(angle))) >= 1 or not np.any(2 * angle % 1)):
            how = f"say {line(otherwise(column, 'deg'))} under [columns] of a map"
            return (
                f"{column.signal.name} goes to {largest:.5g} rad, beyond two turns; was it meant in degrees? Then {how}"
            )
    return ""


def _noise(record: Recording, name: str) -> float:
    """The standard uncertainty (SI) of a column's readings: its sensor's noise where that is known, or else rounding,
    uniform (GUM, 4.3.7).
    """
    known = record.table.scatter.get(name)
    return known / SIGMAS if known is not None else rms(record.table.rounding(name)) / math.sqrt(3)


def _analytic_side(
    record: Recording, mechanism: Mechanism, motion: Motion, joint_model: JointModel, model: Model
) -> Reference:
    """The analytic side at a recording's samples, by what is known of its motion.  Raises AssemblyError."""
    clearances = {} if joint_model == "ideal" else mechanism.clearances
    rubs = joint_model in ("ideal", "contact")
    assembly = Assembly(mechanism if rubs else mechanism.without_contact_friction())
    at_rest = motion == "static"
    more = [column.signal.name for column in record.table.columns if column.signal.on_request]

    def moved_as(one: Recording) -> Reference:
        along = one.schedule(mechanism, at_rest)
        return reference(assembly, along, model, clearances, *one.moving(assembly, at_rest), more)

    side = moved_as(record)
    moved = record.moved
    if isinstance(moved, RecordedRelease):
        side = left_open(side, (moved_as(replace(record, moved=other)) for other in moved.others()), mechanism)
        side = replace(side, unsure={name: maximum_filter1d(off, NEIGHBOURS) for name, off in side.unsure.items()})
    side = without_edges(side, mechanism, record.schedule(mechanism, at_rest).time)
    return silenced(side, _standing(moved, mechanism)) if at_rest and isinstance(moved, RecordedDrives) else side


def _standing(moved: RecordedDrives, mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Where (N,) a record says no more of a drive than that it stands, by what its motor gives where its joint rubs."""
    given = zip(mechanism.motors, driving(mechanism.motors), strict=True)
    named = {joint.name: signal.name for joint, signal in given if joint.rubs}
    drives = {named[name]: each for name, each in moved.drives.items() if name in named}
    return {name: np.abs(each.moving.omega) <= SIGMAS * each.errors.omega for name, each in drives.items()}


def _with_rounding(side: Reference, record: Recording) -> Reference:
    """A side with what the file's numbers are rounded to as further ignorance; a signal that has steps of its own, as
    the direction of a force between two walls, is not rounded to them.  Steps that are no more than what the motion
    leaves open are those of its encoders.
    """
    unsure = {name: np.array(values) for name, values in side.unsure.items()}
    table = record.table
    for name in table.values:
        steps = rounding(side.signals[name]) if name in side.signals else np.zeros(1)
        steps = steps if np.max(steps) > SIGMAS * np.max(unsure.get(name, np.zeros(1))) else np.zeros(1)
        unsure[name] = unsure.get(name, 0.0) + np.maximum(table.rounding(name) - steps, 0.0) / SIGMAS
    for name in [name for name in side.signals if name.endswith("_magnitude")]:
        joint = name.removeprefix("reaction_").removesuffix("_magnitude")
        step = np.hypot(*(table.rounding(Signal("reaction", joint, axis).name) for axis in ("x", "y"))) / SIGMAS
        turned = Signal("reaction", joint, "angle").name
        size = np.fmax(np.abs(side.signals[name]), 1e-300)
        unsure[name] = unsure.get(name, 0.0) + step
        unsure[turned] = unsure.get(turned, 0.0) + step / size
    return replace(side, unsure=unsure)


def _trace(record: Recording, mechanism: Mechanism, joint_model: JointModel, motion: Motion) -> Trace:
    clearance = {} if joint_model == "ideal" else dict(mechanism.clearances)
    settings: dict[str, str | float] = {"file": Path(record.file).name}
    if clearance and joint_model in STRIKING:  # no table says how much their walls give: they are taken as ours
        laws = [contact_parameters(mechanism, mechanism.joint(name), motion) for name in clearance]
        settings["contact_stiffness"] = min(law.stiffness for law in laws)
    if isinstance(record.moved, RecordedMotion):
        settings["acceleration_known_to"] = float(SIGMAS * np.max(record.moved.errors.alpha))
    if motion == "driven":
        for name, each in record.drives.items():
            settings[f"acceleration_known_to_{name}"] = float(SIGMAS * np.max(each.errors.alpha))
    time = None if motion == "static" and not isinstance(record.moved, RecordedDrives) else record.time
    return Trace(
        record.name,
        RECORDED,
        joint_model,
        motion,
        record.theta,
        time,
        record.table.values,
        clearance,
        settings=settings,
        recorded=True,
    )


def _not_judged(record: Recording, side: Reference, judgement: JudgedRun, mechanism: Mechanism) -> list[str]:
    """Why columns are held against nothing, in sentences; that encoders are not, as the analytic side follows them,
    goes without saying, and what is empty is said elsewhere.
    """
    judged_on = {each.signal for each in judgement.run.discrepancies}
    full = {name for name, values in record.table.values.items() if np.any(np.isfinite(values))}
    rest = [column.signal for column in record.table.columns if column.signal.name in full]
    rest = [s for s in rest if s not in mechanism.encoders and not _judged_by(s, judged_on)]
    rest = [s for s in rest if s.kind != "reaction" or s.place not in side.undetermined]
    crank = mechanism.driven if mechanism.cranked else ""
    by_motor = prescribed(mechanism) | {Signal("rotation", crank, "angle").name}
    followed = [s.name for s in rest if s.name in by_motor]
    bare = [s.name for s in rest if _judged_by(s, judgement.rules)]
    others = [s.name for s in rest if s.name not in (*followed, *bare)]
    why = f"the motion of the {crank} is prescribed, and the analytic side follows it"
    sentences = (
        [f"{enumerated(followed)} {'is' if len(followed) == 1 else 'are'} not judged: {why}"] if followed else []
    )
    sentences += [f"{', '.join(bare)} {'is' if len(bare) == 1 else 'are'} not judged: {UNCOMPARED}"] if bare else []
    if others:
        sentences.append(
            f"{_first_named(others)} {'is' if len(others) == 1 else 'are'} not judged: a run with"
            f" {judgement.run.joint_model} joints is judged on other signals"
        )
    return sentences


def _first_named(names: Sequence[str]) -> str:
    """The first of some names, and how many more there are."""
    return ", ".join(names[:NAMED]) + (f" and {len(names) - NAMED} more" if len(names) > NAMED else "")


def _judged_by(signal: Signal, judged: Collection[str]) -> list[str]:
    """By which of these signals a column is judged: by itself, or by what is derived of it: a reaction's size and
    direction, a body's rotation.
    """
    derived: list[Signal] = []
    if signal.kind == "reaction":
        derived = [signal.sibling("magnitude"), signal.sibling("angle")]
    elif signal.kind == "pose":
        derived = [Signal("rotation", signal.place, "angle")]
    return [signal.name] if signal.name in judged else [each.name for each in derived if each.name in judged]


def _contradictions(record: Recording, judgement: JudgedRun) -> list[str]:
    """Columns of what follows from others that say something else than these do, in sentences."""
    sentences = []
    for column in record.table.columns:
        signal, rule = column.signal, judgement.rules.get(column.signal.name)
        if rule is None:
            continue
        apart = np.abs(signal.apart(record.table.values[signal.name], judgement.run.simulated[signal.name]))
        if np.any(apart > rule.tolerance(judgement.run.analytic)):
            of = f"reaction_{signal.place}_x and _y" if signal.kind == "reaction" else f"{signal.place}_angle"
            sentences.append(f"{signal.name} is off by {np.nanmax(apart):.3g} {signal.unit} from what {of} make it")
    return sentences


def _coarse(record: Recording, side: Reference, rules: Mapping[str, Rule], mechanism: Mechanism) -> list[str]:
    """A warning where the crank's recorded angles leave a signal open by more than it should differ by."""
    if not isinstance(record.moved, RecordedMotion | RecordedDrives) and not record.error:
        return []
    left_open, share = "", 1e-3 * LEFT_OPEN
    for name, rule in rules.items():
        peak = float(np.nanmax(np.abs(side.signals[name]), initial=0.0))
        open_by = SIGMAS * float(np.max(side.unsure.get(name, np.zeros(1))))
        alone = float(np.nanmax(replace(rule, unsure=0.0).tolerance(side.signals), initial=0.0))
        if open_by > max(share * peak, LEFT_OPEN * alone) and (record.error or not rule.signal.wraps):
            share = open_by / peak if peak else math.inf
            much = (
                f"{100 * share:.2g} % of its peak"
                if share < 1
                else f"{open_by:.2g} {rule.signal.unit}, more than its peak"
            )
            left_open = f"{name} to {much}; that much is allowed on top"
    if not left_open:
        return []
    if not isinstance(record.moved, RecordedMotion | RecordedDrives):
        return [
            f"{record.name}: its crank's angles are rounded, by up to {np.degrees(SIGMAS * record.error):.2g} deg, and"
            f" so tell {left_open}: write them with more digits for a closer check"
        ]
    every = float(np.median(np.diff(record.table.time)))
    if isinstance(record.moved, RecordedDrives):
        drives = {f"joint {name}": each for name, each in record.moved.drives.items()}
    else:
        drives = {"its crank": record.moved}
    what, moved = max(drives.items(), key=lambda item: float(np.max(item[1].errors.alpha)))
    slides = {"its crank"} if mechanism.sliding else {f"joint {j.name}" for j in mechanism.joints if j.prismatic}
    unit = "m" if what in slides else "rad"
    known, most = SIGMAS * float(np.max(moved.errors.alpha)), float(np.max(np.abs(moved.moving.alpha)))
    where = SIGMAS * float(np.max(moved.errors.theta))
    position = f"its position to {where:.2g} {unit} and " if where else ""
    return [
        f"{record.name}: {what} is recorded every {every:.3g} s, which tells {position}its acceleration to {known:.2g}"
        f" {unit}/s2 (of {most:.3g} at most), and so {left_open}: record it more often, or with more digits, for a"
        " closer check"
    ]


def _turned(record: Recording, side: Reference, judged: JudgedRun, m: Mechanism) -> dict[str, str]:
    """By column a warning for each vector that does not agree and is the analytic one in a body's frame, or with axes
    swapped, reversed or turned; and for each column that is it a row earlier or later.
    """
    verdicts = {each.signal: each.verdict for each in judged.run.discrepancies}
    values, model = record.table.values, side.signals
    off = {
        column.signal.name: column
        for column in record.table.columns
        if {verdicts[each] for each in _judged_by(column.signal, verdicts)} - {"agrees"}
    }
    angles = {body.name: model[name] for body in m.bodies if (name := f"{body.name}_angle") in model}
    sentences: dict[str, str] = {}
    for x, y in vectors(record.table.columns):
        first, second = x.signal.name, y.signal.name
        if {first, second} & off.keys() and {first, second} <= model.keys():
            joint = m.joint(x.signal.place) if x.signal.kind == "reaction" else None
            read, meant = values[first] + 1j * values[second], model[first] + 1j * model[second]
            if look := looks_turned((x, y), read, meant, angles, joint):
                sentences |= {first: f"{record.name}: {first} and _y: {look}", second: ""}
    for name in [name for name in off if name in model and name not in sentences]:
        if look := looks_late(values[name], model[name]):
            sentences[name] = f"{record.name}: {name}: {look}"
    return sentences


def _units(record: Recording, side: Reference, judged: JudgedRun, told: Container[str]) -> list[str]:
    """A warning for each signal that is the analytic one in another unit, or of the other sign, and does not agree, but
    for those of which something is ``told``.
    """
    sentences = []
    verdicts = {each.signal: each.verdict for each in judged.run.discrepancies}
    for column in record.table.columns:
        if column.signal.name in told:
            continue
        name, kind = column.signal.name, dimension(column.signal)
        values = record.table.values[name]
        here = np.isfinite(values) & np.isfinite(side.signals.get(name, np.full(values.shape, np.nan)))
        if np.sum(here) < LEAST_SAMPLES or {verdicts[each] for each in _judged_by(column.signal, verdicts)} == {
            "agrees"
        }:
            continue
        model, recorded = side.signals[name][here], values[here]
        if column.signal.wraps and np.std(column.signal.apart(recorded, model)) <= LIKE_UNIT * np.std(model):
            continue  # whole turns apart
        look = looks(kind, column.unit, model, recorded)
        if look is not None:
            slope, what = look
            looked = _remedy(column, what)
            sentences.append(f"{record.name}: {name} is {slope:.4g} times the analytic side's: it looks {looked}")
    return sentences


def _remedy(column: Column, what: str) -> str:
    """The unit or sign in which a column looks like its signal, and the line of a map that mends it."""
    told = what
    if what == REVERSED:
        told += " or is the force on the other body" * (column.signal.kind == "reaction")
    else:
        told += f", but is read in {column.unit}"
    return f"{told}: say {line(mended(column, what))} under [columns] of a map"


# ---------------------------------------------------------------- engines beside


def _engines(asked: _Asked, record: Recording, progress: Progress) -> Ran:
    """The first file's motion in engines."""
    m, joint_model = asked.mechanism(record), asked.joint_model
    if isinstance(record.moved, RecordedMotion | RecordedDrives):
        record = replace(record, moved=record.moved.smooth())
    job = replace(asked.job_of(record), beside=tuple(record.table.values))
    side = _analytic_side(record, m, job.motion, joint_model, job.model)
    let_go = m
    if isinstance(record.moved, ReleaseState):
        let_go = released_from(m.ideal(), record.moved.angle)
    elif isinstance(record.moved, RecordedRelease):
        let_go = record.moved.assembled(m)
    request = Request(let_go, joint_model, record.schedule(let_go, job.schedule.at_rest))
    pair = (joint_model, job.motion)
    tasks = [(name, request) for name in job.simulators if pair in engine(name).capabilities.runs]
    ran = run_all(job, tasks, lambda trace: side, engine, progress)
    return replace(ran, judged=tuple(_with_metrics(asked, record, side, one) for one in ran.judged))


def _with_metrics(asked: _Asked, record: Recording, side: Reference, one: JudgedRun) -> JudgedRun:
    """An engine's run that states what its steps make, with its metrics."""
    found = asked.metrics(record, side, one) if one.run.numerical else {}
    return replace(one, run=one.run.model_copy(update={"metrics": found}))


def _alike(one: JudgedRun, first: JudgedRun) -> bool:
    """Whether the analytic model says the same at the samples of two runs, within what each signal may differ by: only
    then is one held against the other.
    """
    if one.run.crank_angle.size != first.run.crank_angle.size:
        return False
    for name in one.rules.keys() & first.rules.keys():
        allowed = np.fmax(*(each.rules[name].tolerance(each.run.analytic) for each in (one, first)))
        apart = difference(one.rules[name].signal.apart(one.run.analytic[name], first.run.analytic[name]), allowed)
        if apart is not None and apart.share > 1:
            return False
    return True
