"""The cross-check of recorded results: what any program has written of a linkage, held against the analytic model.

A file of columns is the simulated side.  The analytic side follows the crank that the file records, or lets go of the
linkage where the file begins; engines may be asked for the same motion, so that three parties can say who stands apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.mechanism import GROUND, Mechanism
from analytic.mechanism.columns import PLAIN, Layout, read_map
from analytic.mechanism.errors import quoted
from analytic.mechanism.one_line import shown
from analytic.mechanism.signals import Signal, driving, position
from analytic.mechanism.units import dimension
from analytic.paper.clearance import MODELS, Model
from compare.arguments import (
    Linkage,
    Metres,
    Simulators,
    ToleranceFile,
    cores,
    engines,
    laid_over,
    linkage,
    loose,
    noted,
    one_of,
    path,
    processes,
    rigidly_and_evenly_driven,
)
from compare.crosscheck import Job, Progress, Ran, concluded, judged, run_all
from compare.diagnose.data.quality import REVERSED, looks
from compare.faults import ArgumentError
from compare.judge.courses import Courses
from compare.judge.reference import (
    SURE,
    Reference,
    followed_drives_reference,
    followed_reference,
    reference,
    released_reference,
    silenced,
    timed_reference,
)
from compare.left_out import Asked, omitted
from compare.recorded.errors import DataError
from compare.recorded.motion import (
    LEAST,
    Followed,
    FollowedDrives,
    Start,
    encoder_of,
    evenly,
    released_from,
)
from compare.recorded.recording import Recording, recording
from compare.recorded.table import Table, read_table, unused
from compare.results.crosscheck import RECORDED, CrossCheck, Run
from sim_models.engine import JOINT_MODELS, MOTIONS, JointModel, Motion, Request, Trace, engine

Results = str | PathLike[str] | Sequence[str | PathLike[str]] | Mapping[str, str | PathLike[str]]
"""A file of results, several, or several by the name of the program that wrote each."""

COARSE = 0.5  # of what a signal may differ by: where the course leaves it open by more, that is said
SAME = 1e-3  # of a step between samples, by which the same ones may differ
ODD = 0.03  # relative, by which a speed may miss another one in other units


def check(  # noqa: PLR0913 - what a person may ask, by name
    results: Results,
    mechanism: Linkage = "paper",
    *,
    map: str | PathLike[str] | Layout | None = None,
    simulators: Simulators | None = None,
    joint_model: JointModel | None = None,
    motion: Motion = "driven",
    clearance: Metres | None = None,
    analytic: Model = "equilibrium",
    tolerances: ToleranceFile | None = None,
    workers: int | None = None,
    progress: Progress = lambda what, done, total: None,
) -> CrossCheck:
    """Hold the analytic model of a linkage against what another program has computed of it.

    ``results`` are CSV files (also Parquet, Feather, MAT) of signals; ``map`` says what their columns are where their
    headings do not.  In ``driven`` motion the analytic side follows the crank's angle over time; without that column it
    turns at ``drive.speed``; a linkage without a motor is let go in the state that the file begins with.  In ``static``
    motion every row is an equilibrium, of several drives at its time.  ``simulators`` are engines that simulate the
    first file's motion beside.  ``joint_model`` says what the joints with clearance were: ``contact`` if it is left
    out.

    Raises MechanismError, ArgumentError, ToleranceError, MapError, DataError with every fault of the files,
    AssemblyError, Unsupported or SimulatorMissing.
    """
    motion, analytic = one_of(motion, MOTIONS, "motion"), one_of(analytic, MODELS, "analytic")
    chosen = None if joint_model is None else one_of(joint_model, JOINT_MODELS, "joint_model")
    read, layout = laid_over(tolerances), map if isinstance(map, Layout) else layout_of(map)
    with noted() as warned:
        given = rigidly_and_evenly_driven(linkage(mechanism, clearance))
        names, left_out = engines(simulators) if simulators is not None else ((), [])
        loose(given, chosen)
        left_out += omitted(given, Asked("check", motion, (chosen or "contact",)))
        model: JointModel = chosen or ("contact" if given.clearances else "ideal")
        tables = _tables(result_files(results), given, layout, str(map), timed=motion == "driven" or not given.cranked)
        recordings = [recording(name, file, table, given, motion, model) for name, file, table in tables]
    uneven = any(one.kind == "course" for one in recordings)
    m = _followed(given) if uneven and given.speed is not None else given
    job = Job(
        m,
        names,
        read,
        motion,
        joint_model=model,
        model=analytic,
        workers=processes(workers, cores() if len(names) > 1 else 1),
        warnings=(*warned, *left_out, *_warnings(given, recordings)),
    )
    remarks: list[str] = []
    ran = Ran()
    for one in recordings:
        side = _side(one, m, motion, model, analytic)
        found = judged(
            replace(job, theta=one.theta, time=_clock(one, m), courses=_courses(one)),
            _with_rounding(side, one),
            _trace(one, m, model, motion),
        )
        remarks += [*side.remarks, *_units(one, side, m)]
        if motion == "driven":
            remarks += _coarse(one, side, found.rules, m)
        if found.run.verdict == "disagrees" and one.kind == "angles" and motion == "driven" and one.time is None:
            remarks += _at_rest(one, m, model, analytic, job)
        ran += Ran((found,))
    if names:
        ran += _engines(job, recordings[0], model, progress)
    first = ran.judged[0].run
    others = dict.fromkeys(one.run.simulator.name for one in ran.judged if not _alike(one.run, first))
    if others:
        remarks.append(
            f"{', '.join(others)}: has other samples than {first.simulator.name}, so that who stands apart is asked of"
            " the rest; give tables with the same rows"
        )
    job = replace(job, warnings=(*job.warnings, *remarks))
    return concluded(job, ran, lambda run: _alike(run, first))


# ---------------------------------------------------------------- files


def layout_of(given: object) -> Layout:
    """How files are written, as a map says.  Raises ArgumentError or MapError."""
    return PLAIN if given is None else read_map(path(given, "map"), Layout)


def result_files(results: object) -> dict[str, Path]:
    """Files by the name of whoever wrote them: their own names without what is alike.  Raises ArgumentError."""
    if isinstance(results, Mapping) and results:
        unnamed = [name for name in results if not str(name).strip()]
        if unnamed:
            raise ArgumentError("results", f"{quoted(unnamed[0])} is no name of a program; give each file one")
        return {str(name): path(file, "results") for name, file in results.items()}
    several = [results] if isinstance(results, str | PathLike) else results
    if not isinstance(several, Sequence) or not several:
        what = f"{type(results).__name__} {shown(str(results))}"
        raise ArgumentError("results", f"{what} cannot be used; give the path of a file of results, or several")
    files = [path(file, "results") for file in several]
    names = [file.stem for file in files]
    if len(set(names)) < len(names):
        names = [f"{file.absolute().parent.name}/{file.stem}" for file in files]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ArgumentError("results", f"{twice} is there twice; give each file once")
    return dict(zip(names, files, strict=True))


def _tables(
    files: Mapping[str, Path], mechanism: Mechanism, layout: Layout, where: str, *, timed: bool
) -> list[tuple[str, str, Table]]:
    """Every file as a table, by a map that is called ``where``.  Raises DataError with the faults of all of them."""
    timed = timed and mechanism.speed is None  # at a constant speed an angle tells the time
    found: list[tuple[str, str, Table]] = []
    faults: list[str] = []
    for name, file in files.items():
        try:
            found.append((name, str(file), read_table(file, mechanism, layout, timed=timed)))
        except DataError as error:
            faults += error.faults
    used = {entry for _, _, table in found for entry in table.used}
    headings = list(dict.fromkeys(heading for _, _, table in found for heading in table.headings))
    faults += [] if faults else [unused(f"{where}: ", entry, headings) for entry in layout.columns if entry not in used]
    if faults:
        raise DataError(*faults)
    return found


def _warnings(mechanism: Mechanism, recordings: Sequence[Recording]) -> list[str]:
    """What was made of the files, in sentences."""
    found = []
    for one in recordings:
        found += list(one.table.notes)
        if one.kind == "released" and f"{mechanism.driven}_angle" not in one.table.values:
            found.append(f"{one.name}: does not say where the linkage begins; it is let go at rest, as it is assembled")
        if one.kind == "course" and mechanism.speed is not None:
            found.append(f"{one.name}: {_turning(one, mechanism.speed)}; its recorded course is followed")
        for signal, values in one.table.values.items():
            absent = int(np.sum(np.isnan(values)))
            if absent:
                found.append(f"{one.name}: {signal} is absent in {absent} of {values.size} rows, which are left out")
    return found


def _turning(one: Recording, speed: float) -> str:
    """How a crank turns that does not turn evenly at the drive's speed."""
    assert isinstance(one.moved, Followed)
    own = float(np.ptp(one.theta[[0, -1]]) / np.ptp(one.table.time)) * float(np.sign(one.theta[-1] - one.theta[0]))
    steady = evenly(one.table.time, one.theta, own, SURE * one.moved.errors.theta, np.zeros(1))
    if steady is None:
        return f"its crank does not turn evenly at drive.speed = {speed:g} rad/s"
    said = f"its crank turns evenly, but at {own:.5g} rad/s where drive.speed = {speed:g}"
    odd = {
        math.pi / 180: "its angle in degrees, read as radians",
        180 / math.pi: "its angle in radians, read as degrees",
        1e3: "its time in seconds, read as milliseconds",
        1e-3: "its time in milliseconds, read as seconds",
    }
    what = next((what for factor, what in odd.items() if abs(own / speed / factor - 1) < ODD), None)
    return f"{said}: is {what}?" if what else said


# ---------------------------------------------------------------- both sides


def _followed(mechanism: Mechanism) -> Mechanism:
    """The mechanism with a motor that follows a record."""
    drive = mechanism.drive
    assert drive is not None
    return mechanism.replace(drive=drive.model_dump(exclude_unset=True) | {"speed": "measured"})


def _clock(one: Recording, mechanism: Mechanism) -> np.ndarray | None:
    return one.time if one.kind != "angles" or (mechanism.speed is None and one.time is not None) else None


def _courses(one: Recording) -> Courses | None:
    """The courses of several drives in a recording."""
    return Courses(one.moved.knots) if isinstance(one.moved, FollowedDrives) else None


def _side(one: Recording, mechanism: Mechanism, motion: Motion, joint_model: JointModel, model: Model) -> Reference:
    """The analytic side at a recording's samples.  Raises AssemblyError with the file."""
    clearances = {} if joint_model == "ideal" else mechanism.clearances
    assembly = Assembly(mechanism)
    try:
        if isinstance(one.moved, Start):
            since = one.table.time - one.table.time[0]
            return released_reference(assembly, since, (one.moved.angle, one.moved.rate), one.moved.errors)
        if isinstance(one.moved, Followed):
            return followed_reference(assembly, one.moved.moving, one.moved.errors, model, clearances)
        if isinstance(one.moved, FollowedDrives):
            if motion == "static":
                courses = Courses({n: (one.moved.time, each.moving.theta) for n, each in one.moved.drives.items()})
                side = timed_reference(assembly, one.moved.time, courses, motion, model, clearances)
                return silenced(side, _standing(one.moved, mechanism))
            states = {name: (each.moving, each.errors) for name, each in one.moved.drives.items()}
            return followed_drives_reference(assembly, states, model, clearances)
        return reference(assembly, one.theta, motion, model, clearances, one.error)
    except AssemblyError as error:
        raise DataError(f"{Path(one.file).name}: {error}; check the angles, their unit and their sign") from None


def _standing(moved: FollowedDrives, mechanism: Mechanism) -> dict[str, np.ndarray]:
    """Where (N,) a record says no more of a drive than that it stands, by what its motor gives where its joint rubs."""
    given = zip(mechanism.motors, driving(mechanism.motors), strict=True)
    named = {joint.name: signal.name for joint, signal in given if joint.rubs}
    drives = {named[name]: each for name, each in moved.drives.items() if name in named}
    return {name: np.abs(each.moving.omega) <= SURE * each.errors.omega for name, each in drives.items()}


def _with_rounding(side: Reference, one: Recording) -> Reference:
    """A side with what the file's numbers are rounded to as further ignorance."""
    unsure = {name: np.array(values) for name, values in side.unsure.items()}
    table = one.table
    for name in table.values:
        unsure[name] = unsure.get(name, 0.0) + table.rounding(name) / SURE
    for name in [name for name in side.signals if name.endswith("_magnitude")]:
        joint = name.removeprefix("reaction_").removesuffix("_magnitude")
        step = np.hypot(*(table.rounding(Signal("reaction", joint, axis).name) for axis in ("x", "y"))) / SURE
        turned = Signal("reaction", joint, "angle").name
        size = np.fmax(np.abs(side.signals[name]), 1e-300)
        unsure[name] = unsure.get(name, 0.0) + step
        unsure[turned] = unsure.get(turned, 0.0) + step / size
    return replace(side, unsure=unsure)


def _trace(one: Recording, mechanism: Mechanism, joint_model: JointModel, motion: Motion) -> Trace:
    clearance = {} if joint_model == "ideal" else dict(mechanism.clearances)
    settings: dict[str, str | float] = {"file": Path(one.file).name}
    if isinstance(one.moved, Followed):
        settings["acceleration_known_to"] = float(SURE * np.max(one.moved.errors.alpha))
    if isinstance(one.moved, FollowedDrives) and motion == "driven":
        for name, each in one.moved.drives.items():
            settings[f"acceleration_known_to_{name}"] = float(SURE * np.max(each.errors.alpha))
    theta = one.table.values.get(encoder_of(mechanism), one.theta) if one.kind == "released" else one.theta
    time = None if motion == "static" and not isinstance(one.moved, FollowedDrives) else one.time
    return Trace(
        one.name,
        RECORDED,
        joint_model,
        motion,
        np.array(theta),
        time,
        one.table.values,
        clearance,
        settings=settings,
        recorded=True,
    )


def _coarse(one: Recording, side: Reference, rules: Mapping[str, object], mechanism: Mechanism) -> list[str]:
    """A warning where the crank's recorded angles leave a signal open by more than it should differ by."""
    if not isinstance(one.moved, Followed | FollowedDrives) and not one.error:
        return []
    worst, share = "", 0.0
    for name in rules:
        peak = float(np.nanmax(np.abs(side.signals[name]), initial=0.0))
        open_by = SURE * float(np.max(side.unsure.get(name, np.zeros(1))))
        if peak and open_by / peak > share and (one.error or not name.endswith("_angle")):
            worst, share = name, open_by / peak
    if share < 1e-3 * COARSE:
        return []
    left_open = f"{worst} to {100 * share:.2g} % of its peak; that much is allowed on top"
    if not isinstance(one.moved, Followed | FollowedDrives):
        return [
            f"{one.name}: its crank's angles are rounded, by up to {np.degrees(SURE * one.error):.2g} deg, and so tell"
            f" {left_open}: write them with more digits for a closer check"
        ]
    every = float(np.median(np.diff(one.table.time)))
    if isinstance(one.moved, FollowedDrives):
        drives = {f"joint {name}": each for name, each in one.moved.drives.items()}
    else:
        drives = {"its crank": one.moved}
    what, moved = max(drives.items(), key=lambda item: float(np.max(item[1].errors.alpha)))
    slides = {"its crank"} if mechanism.sliding else {f"joint {j.name}" for j in mechanism.joints if j.prismatic}
    unit = "m" if what in slides else "rad"
    known, most = SURE * float(np.max(moved.errors.alpha)), float(np.max(np.abs(moved.moving.alpha)))
    return [
        f"{one.name}: {what} is recorded every {every:.3g} s, which tells its acceleration to {known:.2g} {unit}/s2 (of"
        f" {most:.3g} at most), and so {left_open}: record it more often, or with more digits, for a closer check"
    ]


def _at_rest(one: Recording, mechanism: Mechanism, joint_model: JointModel, model: Model, job: Job) -> list[str]:
    """A warning where rows that have no time are as the linkage is at rest."""
    side = _with_rounding(_side(one, mechanism, "static", joint_model, model), one)
    trace = _trace(one, mechanism, joint_model, "static")
    again = judged(replace(job, theta=one.theta, time=None, motion="static"), side, trace)
    return [f"{one.name}: agrees with the linkage at rest; say --motion static"] * (again.run.verdict == "agrees")


def _drives_read(one: Recording, mechanism: Mechanism) -> Iterator[str]:
    """A warning for each driven pin whose position is not what its bodies' angles say, but in another unit or sign."""
    values = one.table.values
    for joint in mechanism.motors:
        angles = [np.zeros(1) if body == GROUND else values.get(f"{body}_angle") for body in joint.bodies]
        name = position(joint).name
        if joint.prismatic or name not in values or any(each is None for each in angles):
            continue
        turned = np.asarray(angles[1]) - np.asarray(angles[0])
        here = np.isfinite(turned) & np.isfinite(values[name])
        told = looks("angle", turned[here], values[name][here]) if np.sum(here) >= LEAST else None
        if told is not None:
            remedy = "say sign = -1 in a map" if told[1] == REVERSED else "say its unit in its heading, or in a map"
            bodies = " and ".join(body for body in joint.bodies if body != GROUND)
            yield (
                f"{one.name}: {name} is {told[0]:.4g} times what the angle of {bodies} says (second body less first):"
                f" it looks {told[1]}; {remedy}"
            )


def _units(one: Recording, side: Reference, mechanism: Mechanism) -> list[str]:
    """A warning for each signal that is the analytic one in another unit, or of the other sign."""
    found = []
    if isinstance(one.moved, FollowedDrives) and (found := list(_drives_read(one, mechanism))):
        return found  # what follows from them is off as well
    for column in one.table.columns:
        name, kind = column.signal.name, dimension(column.signal)
        values = one.table.values[name]
        here = np.isfinite(values) & np.isfinite(side.signals.get(name, np.full(values.shape, np.nan)))
        if np.sum(here) < LEAST:
            continue
        model, recorded = side.signals[name][here], values[here]
        told = looks(kind, model, recorded)
        if told is not None:
            slope, what = told
            remedy = f", but is read in {column.unit}; say its unit in its heading, or in a map"
            if what == REVERSED:
                body = " or is the force on the other body" if kind == "force" else ""
                remedy = f"{body}; say sign = -1 in a map"
            found.append(f"{one.name}: {name} is {slope:.4g} times the analytic side's: it looks {what}{remedy}")
    return found


# ---------------------------------------------------------------- engines beside


def _engines(job: Job, one: Recording, joint_model: JointModel, progress: Progress) -> Ran:
    """The first file's motion in engines."""
    m = job.mechanism
    if isinstance(one.moved, Followed | FollowedDrives):
        one = replace(one, moved=one.moved.smooth())
    side = _side(one, m, job.motion, joint_model, job.model)
    if isinstance(one.moved, FollowedDrives):
        request = one.moved.request(m, joint_model, job.motion)
    elif isinstance(one.moved, Followed):
        request = one.moved.request(m, joint_model)
    elif isinstance(one.moved, Start):
        let_go = released_from(m.ideal(), one.moved.angle)
        since = one.table.time - one.table.time[0]
        request = Request(let_go, joint_model, time=since, start_speed=one.moved.rate)
    else:
        request = Request(m, joint_model, job.motion, crank_angle=one.theta)
    pair = (joint_model, job.motion)
    tasks = [(name, request) for name in job.simulators if pair in engine(name).capabilities.runs]
    job = replace(job, theta=one.theta, time=_clock(one, m), courses=_courses(one), beside=tuple(one.table.values))
    return run_all(job, tasks, lambda trace: side, engine, progress)


def _alike(run: Run, first: Run) -> bool:
    """Whether two runs have the same samples, but for what their times and angles are rounded to."""
    if (run.time is None) != (first.time is None) or run.crank_angle.size != first.crank_angle.size:
        return False
    one, other = ((r.crank_angle if r.time is None else r.time - r.time[0]) for r in (run, first))
    step = float(np.median(np.abs(np.diff(other)))) if other.size > 1 else 1.0
    return bool(np.max(np.abs(one - other)) <= SAME * step)
