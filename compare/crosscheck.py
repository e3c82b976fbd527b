"""The cross-check: the analytic model and the engines' joint models at the same crank angles, and what differs.

:func:`crosscheck` is the question as a person asks it; :class:`Job` is what it comes to, and :func:`crosscheck_job`
does it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from analytic.errors import warn
from analytic.kinematics.assembly import Assembly
from analytic.kinematics.reach import turns_fully
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Mechanism
from analytic.mechanism.assumed import Assumed, assumed
from analytic.mechanism.one_line import count
from analytic.mechanism.signals import Signal, named
from analytic.paper.clearance import Model
from analytic.paper.printed import printed_figures
from compare.arguments import (
    cores,
    engines,
    every_one,
    idle,
    jamming,
    laid_over,
    linkage,
    loose,
    noted,
    on_request,
    rigidly_and_evenly_driven,
    warn_of_friction,
    with_map,
)
from compare.faults import ArgumentError
from compare.judge.assumptions import failing_assumption
from compare.judge.attribution import attribute
from compare.judge.discrepancy import (
    NOT_TOLD_APART,
    Comparison,
    Rule,
    Scales,
    contact_give,
    judge,
    run_rules,
)
from compare.judge.flexible import Beams, softened
from compare.judge.numerical import verified
from compare.judge.reference import (
    SIGMAS,
    Reference,
    reference,
    with_flexible_links,
    without_edges,
)
from compare.judge.reruns import JudgedRun, prolong, settle, span, too_soft
from compare.judge.signals import compared, only, prescribed, recorded, with_derived, with_rotations
from compare.judge.statistics import compared_statistics
from compare.judge.tolerances import Tolerances, checked_known, known_differences
from compare.omissions import Asked, omitted, rigid_walls, untold
from compare.pace import LONG, Pace, foreseen
from compare.progress import Progress, progress_bar
from compare.questions.crosscheck import MOST_REVOLUTIONS, CrosscheckQuestion
from compare.questions.question import answers
from compare.report.words.disagreement import because, between_engines
from compare.results.contact import Compared
from compare.results.crosscheck import (
    CrossCheck,
    Discrepancy,
    Failure,
    PinPath,
    Printed,
    Run,
    Simulator,
    Verdict,
    without,
)
from compare.schedules import scheduled
from compare.simulations import ContactTrace, Resolve, Task, simulate_all
from compare.versions import versions
from sim_models.common.contact_laws import assumed_of_contact
from sim_models.common.rates import with_rates
from sim_models.engine import (
    JOINT_MODELS,
    SEPARATOR,
    TOUCHING,
    Capabilities,
    JointModel,
    Motion,
    Request,
    Trace,
    Unsupported,
    check_supported,
    engine,
)

STRIKING = TOUCHING["contact_law"]  # joint models whose pins and blocks may leave their walls
OF_TURNS = "it is of cranks that turn fully, with pins that may strike their walls"
Outcomes = dict[int, Trace | Failure]
AnalyticSide = Callable[[Assembly, Schedule, Model, Mapping[str, float]], Reference]


@dataclass(frozen=True)
class Job:
    """What to cross-check: a mechanism along a schedule, in engines.

    ``beside`` are signals that are judged too, as a file of results has them.
    ``as_it_is`` takes every run as it comes, where others are looked at more closely (:mod:`compare.judge.reruns`).
    With ``flexible`` bodies that have a modulus of elasticity bend, in static motion; else all are rigid.
    Contact is watched over so many ``revolutions`` at the utmost (0: not at all) as its statistics need to converge;
    ``as_it_is`` over just as many.  With ``verify`` each run that steps states its numerical uncertainty
    (:mod:`compare.judge.numerical`).
    """

    mechanism: Mechanism
    simulators: tuple[str, ...]
    tolerances: Tolerances
    schedule: Schedule
    joint_model: JointModel | None = None
    model: Model = "equilibrium"
    warnings: tuple[str, ...] = ()
    workers: int = 1
    flexible: bool = False
    as_it_is: bool = False
    beside: tuple[str, ...] = ()
    revolutions: int = 0
    verify: bool = False

    @property
    def motion(self) -> Motion:
        """Whether the linkage moves, or rests."""
        return self.schedule.motion

    @property
    def offers(self) -> tuple[str, ...]:
        """Arguments that a remedy may tell a person to change: a map has no motion and no angles to choose."""
        return () if self.as_it_is else ("motion", "angles")


@answers(CrosscheckQuestion)
def crosscheck(question: CrosscheckQuestion) -> CrossCheck:
    """Hold the analytic model of a linkage against simulations of it.

    A clearance of more than a tenth of the shortest body that meets in its joint is refused unless ``large`` ones are
    meant.  A linkage with several drives, or with one that turns no crank, is compared at ``times`` (N,) s: all drives
    start at the assembly's angles and go on at their speeds, or follow a ``course``, or move a platform along a
    ``path``; what has no drive moves freely.  In ``static`` motion it rests, held by all its drives, in each of those
    poses.

    Without a ``joint_model`` every one that an engine has is run, ideal first.  ``tolerances`` are a file's laid over
    the shipped ones, or :class:`~compare.judge.tolerances.Tolerances`.  A run in which pins strike their walls goes on
    for as many revolutions as its statistics need to converge, at most ``revolutions``; engines are then compared by
    these (``result.statistics``).

    Raises MechanismError, ArgumentError, ToleranceError, AssemblyError, Unsupported or SimulatorMissing; a simulation
    that fails is among the result's ``failures``.
    """
    job = job_of(question)
    with progress_bar(question.progress) as progress:
        return crosscheck_job(job, progress)


def job_of(question: CrosscheckQuestion) -> Job:
    """The job that a question comes to.  Warns, and raises, as :func:`crosscheck` does; nothing is simulated yet."""
    joint_model, motion, flexible = question.joint_model, question.motion, question.flexible
    tolerances = laid_over(question.tolerances)
    with noted() as warned:
        given = linkage(question.mechanism, question.clearance, large=question.large)
        simulators = with_map(question.simulator, question.map)
        names, left_out = engines(simulators)
        if flexible:
            names, without = _with_beams(names, every_one(simulators), given, motion)
            left_out += without
        m = rigidly_and_evenly_driven(given)
        warn_of_friction(m, joint_model, motion)
        left_out += omitted(m, Asked.of_engines("compare", m, motion, joint_model, flexible))
        assembly = Assembly(m)
        schedule = scheduled(assembly, question)
        if assembly.left_free(schedule):
            _with_ideal_joints(m, joint_model)
        _with_stiff_rims(m)
        loose(m, joint_model)
    unused = idle(m, question.analytic, joint_model)
    turns = question.revolutions
    strikes = m.clearances and motion == "driven" and joint_model in (None, *STRIKING) and schedule.turns_evenly
    if turns not in (0, MOST_REVOLUTIONS) and not (strikes and turns_fully(assembly)):
        unused.append(f"{m.name}: revolutions = {turns} is left out; {OF_TURNS}, and no run here has that")
    if question.verify and motion == "static":
        unused.append(f"{m.name}: verify is left out; it is of steps, and at rest nothing steps")
    return Job(
        mechanism=m,
        simulators=names,
        workers=question.workers or (cores() if len(names) > 1 else 1),
        tolerances=tolerances,
        schedule=schedule,
        joint_model=joint_model,
        model=question.analytic,
        warnings=(*warned, *left_out, *unused),
        flexible=flexible,
        beside=on_request(question.signals, m, motion),
        revolutions=turns,
        verify=question.verify and motion == "driven",
    )


def _with_jam(failed: Failure, mechanism: Mechanism, motion: Motion) -> Failure:
    """A failure of a run in which a block may have jammed, with what helps then."""
    blocks = jamming(mechanism) if motion == "driven" and failed.joint_model == "contact" else []
    less = "".join(
        f"; or give joint {joint.name} friction below {joint.jams_from:g}, its block's length over its height, from"
        " which on it jams"
        for joint in blocks
    )
    return failed.model_copy(update={"why": failed.why + less}) if less else failed


def _with_ideal_joints(mechanism: Mechanism, joint_model: JointModel | None) -> None:
    """A linkage that swings freely has an analytic side with ideal joints only.  Raises ArgumentError; warns of
    clearance that is left out.
    """
    if joint_model not in (None, "ideal"):
        raise ArgumentError(
            "joint_model",
            f"{mechanism.name} swings freely and is compared with ideal joints, as the analytic"
            " model has no clearance in a free motion; leave the joint model out, or give drive.speed in rad/s",
        )
    for name, stiffness in mechanism.soft_bearings.items():
        raise ArgumentError(
            "mechanism",
            f"{mechanism.name} swings freely, and there is no analytic model of that in soft bearings; leave out"
            f" radial_stiffness = {stiffness:g} of joint {name}, or give drive.speed in rad/s",
        )
    if mechanism.clearances:
        text = f"{mechanism.name} swings freely and is compared with ideal joints only: clearance in"
        warn(f"{text} {', '.join(mechanism.clearances)} is left out")


def _with_stiff_rims(mechanism: Mechanism) -> None:
    """Contact is judged by how little it gives.  Raises ArgumentError where the bearing of a joint with clearance is
    soft.
    """
    for joint in mechanism.joints:
        if joint.clearance and joint.radial_stiffness is not None:
            raise ArgumentError(
                "mechanism",
                f"joint {joint.name} of {mechanism.name} has clearance = {joint.clearance:g} m and radial_stiffness ="
                f" {joint.radial_stiffness:g} N/m; they are compared one at a time, leave one of them out",
            )


def _with_beams(
    names: tuple[str, ...], every: bool, mechanism: Mechanism, motion: Motion
) -> tuple[tuple[str, ...], list[str]]:
    """Those of the engines that bend links; of ``every`` one, the others and why.  Raises ArgumentError or
    Unsupported.
    """
    if motion != "static":
        raise ArgumentError(
            "flexible", f"flexible links are compared at rest, not in {motion} motion; ask for static motion"
        )
    if not mechanism.bends:
        raise ArgumentError(
            "flexible",
            f"no body of {mechanism.name} has a youngs_modulus (Pa); give the flexible ones theirs, and a section",
        )
    if not every:
        return tuple(Beams.of(name).name for name in names), []
    bending, left_out = [], []
    for name in names:
        try:
            bending.append(Beams.of(name).name)
        except Unsupported as why:
            left_out.append(f"left out: {why}")
    if not bending:
        raise ArgumentError(
            "flexible", "no simulator that is installed bends links; run: pip install 'linkage-crosscheck[exudyn]'"
        )
    return tuple(bending), left_out


def crosscheck_job(
    job: Job,
    progress: Progress = lambda what, done, total: None,
    resolve: Resolve | None = None,
    measure: AnalyticSide | None = None,
) -> CrossCheck:
    """Run a job.

    ``resolve`` and ``measure`` are where engines and the analytic side come from; tests plant faults there.  Raises
    SimulatorMissing, Unsupported or AssemblyError, and Interrupted; a simulation that fails is listed under
    ``failures``.
    """
    job = replace(job, tolerances=checked_known(job.tolerances, job.mechanism))
    resolve = resolve or (Beams.of if job.flexible else engine)
    measure = measure or partial(reference, more=job.beside)
    assembly = Assembly(job.mechanism)
    tasks = [(name, request) for name in job.simulators for request in _requests(job, assembly, name, resolve)]
    if job.schedule.crank is None and job.joint_model is None:
        tasks = [
            (name, request) for name, request in tasks if request.joint_model == "ideal" or _supported(name, request)
        ]
    if not tasks:
        block = bool(job.mechanism.loose_guides)
        what = f"{job.joint_model or 'ideal'} joints in {job.motion} motion{' with a block in its guide' * block}"
        does = "; ".join(
            f"{name.partition(SEPARATOR)[0]} has {_pairs(name, resolve, block)}" for name in job.simulators
        )
        raise Unsupported(f"nothing to run with {what}: {does}; use another joint, motion or simulator")
    idle = [name for name in job.simulators if name not in {at for at, _ in tasks}] if job.joint_model else []
    lacks = f"{job.joint_model} joints in {job.motion} motion{' with a block' if job.mechanism.loose_guides else ''}"
    job = replace(job, warnings=(*job.warnings, *(f"left out: {name} has no {lacks}" for name in idle)))
    rough = any(joint.rough for joint in job.mechanism.joints)  # by the friction of contacts, which others leave out
    smooth = {model: rough and model not in ("ideal", "contact") for model in JOINT_MODELS}
    sides = {
        key: _analytic_side(
            job, Assembly(job.mechanism.without_contact_friction()) if key[1] else assembly, key[0], measure
        )
        for key in {(request.joint_model == "ideal", smooth[request.joint_model]) for _, request in tasks}
    }
    job = replace(job, warnings=(*job.warnings, *dict.fromkeys(r for side in sides.values() for r in side.remarks)))
    ran = run_all(
        job, tasks, lambda trace: sides[trace.joint_model == "ideal", smooth[trace.joint_model]], resolve, progress
    )
    if len(ran.left_out) == len(tasks) or (ran.left_out and len(job.simulators) == 1):
        raise Unsupported(ran.left_out[0])
    return concluded(job, ran)


@dataclass(frozen=True)
class Ran:
    """What came of the simulations of a job: runs that were judged, those that failed, and why others are left out;
    ``stopped`` says that somebody did not wait for all of them.
    """

    judged: tuple[JudgedRun, ...] = ()
    failures: tuple[Failure, ...] = ()
    left_out: tuple[str, ...] = ()
    stopped: bool = False

    def __add__(self, other: Ran) -> Ran:
        failures, left_out = self.failures + other.failures, self.left_out + other.left_out
        return Ran(self.judged + other.judged, failures, left_out, self.stopped or other.stopped)


class Interrupted(KeyboardInterrupt):
    """Somebody stopped a cross-check; ``result`` has the runs that had ended, as they came."""

    def __init__(self, result: CrossCheck) -> None:
        super().__init__("the result has the runs that had ended, as they came")
        self.result = result


def run_all(
    job: Job,
    tasks: Sequence[tuple[str, Request]],
    side: Callable[[Trace], Reference],
    resolve: Resolve,
    progress: Progress,
) -> Ran:
    """Simulate the tasks, each an engine's name and what it is asked, and judge each run by its analytic ``side``."""
    pace = Pace(lambda these, took: simulate_all(these, job.workers, resolve, job.offers, took), job.workers, progress)
    longer = job.revolutions > 1 and not job.as_it_is and any(request.watched for _, request in tasks)
    remarks = ["then longer, where pins strike, unless revolutions is 1"] * longer + quicker(job, tasks)
    outcomes: Outcomes = {}
    stopped = False
    try:
        for i, outcome in pace.run(tasks, "; ".join(remarks)):
            outcomes[i] = outcome
    except KeyboardInterrupt:
        stopped = True
        if not any(isinstance(one, Trace) for one in outcomes.values()):
            raise
    traces = [outcomes.get(i) or _not_ended(*task) for i, task in enumerate(tasks)]
    failed = [f for f in traces if isinstance(f, Failure) and not f.unsupported]
    left_out = [f.why for f in traces if isinstance(f, Failure) and f.unsupported]

    def again(remark: str) -> Callable[[Mapping[int, Request]], Outcomes]:
        def simulate_again(requests: Mapping[int, Request]) -> Outcomes:
            order = list(requests)
            reruns = pace.run([(tasks[i][0], requests[i]) for i in order], remark)
            return {order[k]: outcome for k, outcome in reruns}

        return simulate_again

    first = {i: judged(job, side(t), t) for i, t in enumerate(traces) if isinstance(t, Trace)}
    asked = dict(enumerate(request for _, request in tasks))
    settled: Mapping[int, JudgedRun | Failure] = first
    try:
        if not (job.flexible or job.as_it_is or stopped):
            settled, asked = settle(first, asked, again("finer, near a tolerance"), lambda t: judged(job, side(t), t))
            prolonged = again("longer, as pins strike; revolutions 1 would end here")
            settled = prolong(settled, asked, prolonged, lambda t: judged(job, side(t), t), job.revolutions)
        if job.verify and not stopped:
            shorter = again("in shorter steps, to verify")
            settled = verified(job.mechanism, settled, asked, shorter, lambda t: judged(job, side(t), t))
    except KeyboardInterrupt:
        stopped = True
    failed += [one for one in settled.values() if isinstance(one, Failure)]
    failed = [_with_jam(one, job.mechanism, job.motion) for one in failed]
    runs = tuple(one for one in settled.values() if isinstance(one, JudgedRun))
    return Ran(runs, tuple(failed), tuple(left_out), stopped)


def _not_ended(simulator: str, request: Request) -> Failure:
    """A run that was not waited for."""
    why = f"{simulator} {request.joint_model} {request.motion}: stopped before it ended"
    return Failure(simulator=simulator, joint_model=request.joint_model, why=why, stopped=True)


def quicker(job: Job, tasks: Sequence[Task]) -> list[str]:
    """What of a job that takes long is quick, if anything."""
    one = [f"simulator {job.simulators[0]}"] * (len(job.simulators) > 1)
    ideal = ["joint ideal"] * (job.joint_model is None and any(asked.joint_model != "ideal" for _, asked in tasks))
    ways = one + ideal if foreseen(tasks, job.workers) > LONG else []
    return [f"quick: {' or '.join(ways)}"] if ways else []


def concluded(job: Job, ran: Ran, alike: Callable[[JudgedRun], bool] = lambda one: True) -> CrossCheck:
    """The result of a job.  Which engine stands apart is asked of those of its runs that are ``alike``: that have the
    same samples.  Raises Interrupted with the result of a job that somebody stopped.
    """
    runs = tuple(one.run for one in ran.judged)
    statistics = compared_statistics(runs, job.tolerances)
    optional: dict[str, Any] = {"statistics": statistics} if statistics else {}
    printed = printed_figures(job.mechanism)
    if printed:
        optional["printed"] = tuple(Printed(**vars(one) | {"signal": one.signal.name}) for one in printed)
    together = [(one.run, one.rules) for one in ran.judged if alike(one)]
    if len({run.simulator.name for run, _ in together}) > 1:
        apart = attribute(together)
        optional |= {"spread": apart.spread, "odd_one_out": apart.odd_one_out, "words": between_engines(apart)}
    result = CrossCheck(
        case=job.mechanism.name,
        verdict=_verdict(runs, ran.failures, statistics),
        command="",
        versions=versions({run.simulator.name: run.simulator.version for run in runs}),
        mechanism=job.mechanism,
        warnings=(
            *_touching(runs),
            *job.warnings,
            *(f"left out: {why}" for why in ran.left_out),
            *(why for run in runs for why in too_soft(run)),
            *dict.fromkeys(
                why
                for run in runs
                if not run.simulator.recorded
                for why in rigid_walls(job.mechanism, run.simulator.name, run.joint_model, run.settings)
            ),
            *(why for run in runs for why in _not_judged(job, run)),
            *_of_file_models(runs),
        ),
        assumed=tuple(_assumed(job.mechanism, runs)),
        runs=tuple(_explained(job, run) for run in runs),
        failures=ran.failures,
        **optional,
    )
    if ran.stopped:
        raise Interrupted(result)
    return result


def _assumed(mechanism: Mechanism, runs: Sequence[Run]) -> Iterator[Assumed]:
    """What the linkage takes on, and the contact in each of its runs."""
    yield from assumed(mechanism)
    contact = [assumed_of_contact(mechanism, run.clearance, run.settings) for run in runs]
    yield from dict.fromkeys(each for numbers in contact for each in numbers)


def judged(job: Job, side: Reference, trace: Trace) -> JudgedRun:
    """A trace held to its analytic side."""
    return JudgedRun(trace, *_judged_run(job, side, trace))


def _pairs(name: str, resolve: Resolve, block: bool) -> str:
    """The joint models and motions that an engine runs, in words; with a ``block`` in its guide, if there is one."""
    able = resolve(name).capabilities
    runs = [run for run in able.runs if not block or run[0] == "ideal" or _with_block(able, *run)]
    return ", ".join(sorted(f"{model} {motion}" for model, motion in runs))


def _with_block(able: Capabilities, joint_model: JointModel, motion: Motion) -> bool:
    """Whether an engine has blocks with clearance in their guides in this."""
    return ("guide_clearance", (joint_model, motion)) in able.rigid.features


def _requests(job: Job, assembly: Assembly, simulator: str, resolve: Resolve) -> list[Request]:
    """The runs of one engine: ideal first; a joint model that it lacks is left out unless it was asked for by name."""
    free = assembly.left_free(job.schedule)
    models = [m for m in JOINT_MODELS if m == "ideal" or (job.mechanism.clearances and not free)]
    if job.joint_model is not None:
        models = [m for m in models if m == job.joint_model]
    if job.joint_model is None or len(job.simulators) > 1:
        able = resolve(simulator).capabilities
        models = [m for m in models if (m, job.motion) in able.runs]
        if job.mechanism.loose_guides:  # left to those that have blocks; where none has, each says so
            blocks = [m for m in models if m == "ideal" or _with_block(able, m, job.motion)]
            models = blocks if set(blocks) != {"ideal"} else [m for m in models if m != "massless-link"]
    turns_on = job.motion == "driven" and job.schedule.turns_evenly and turns_fully(assembly)
    settle = 2 * np.pi if turns_on else 0.0
    requests = [Request(job.mechanism, m, job.schedule, lead_in=0.0 if m == "ideal" else settle) for m in models]
    turns = (job.revolutions if job.as_it_is else 1) if settle > 0 else 0
    return [watched(r, turns) if job.revolutions and r.joint_model in STRIKING else r for r in requests]


def watched(request: Request, turns: int) -> Request:
    """A request of a driven run with every step of it told, to the end of so many ``turns`` of its crank."""
    if request.motion != "driven" or not request.schedule.turns_evenly:
        return request
    return replace(request, watched=True, beyond=max(math.tau * turns - span(request), 0.0) if turns else 0.0)


def _analytic_side(job: Job, assembly: Assembly, ideal: bool, measure: AnalyticSide) -> Reference:
    side = measure(assembly, job.schedule, job.model, {} if ideal else job.mechanism.clearances)
    side = without_edges(side, job.mechanism, job.schedule.time)
    return with_flexible_links(side, assembly, job.schedule) if job.flexible else side


def _judged_run(job: Job, side: Reference, trace: Trace) -> tuple[Run, dict[str, Rule]]:
    """Both sides of one run, and the verdict on all samples but the flagged ones; and the rules by which it was
    judged.
    """
    told = only(with_rates(job.mechanism, trace, job.beside), job.mechanism, side.signals)
    measured = with_derived(told, job.mechanism)
    if trace.clearance:
        measured = with_rotations(measured, side.ideal_angles)
    if trace.recorded:
        measured |= {name: np.full(trace.crank_angle.shape, np.nan) for name in side.signals if name not in measured}
    for name, here in side.silent.items():
        measured[name][here] = np.nan
    simulated = without(measured, list(side.flags))
    theta = _axis(job, trace)
    rules = _rules(job, side, trace, simulated)
    comparisons = _discrepancies(job, side, trace, simulated, rules)
    optional: dict[str, Any] = {} if trace.time is None else {"time": trace.time}
    if job.schedule.crank is None:
        optional["drive_position"] = job.schedule.positions()
    if isinstance(trace, ContactTrace) and trace.contact is not None:
        optional["contact"] = trace.contact
    if len(side.flags) == theta.size:
        first, *others = dict.fromkeys(why for _, why in sorted(side.flags.items()))
        more = f", and {len(others)} such reasons more" * bool(others)
        where = "time" if trace.time is not None and not job.mechanism.cranked else "crank angle"
        optional["reason"] = f"the analytic model has no answer at any {where}: {first}{more}"
    run = Run(
        simulator=Simulator(name=trace.simulator, version=trace.version),
        joint_model=trace.joint_model,
        motion=trace.motion,
        clearance=dict(trace.clearance),
        analytic_model=job.model,
        settings=dict(trace.settings),
        crank_angle=theta,
        flags={str(i): why for i, why in sorted(side.flags.items())},
        analytic=dict(side.signals),
        simulated=measured,
        discrepancies=tuple(_entry(d, theta) for d in comparisons),
        verdict=_run_verdict(comparisons),
        order_difference=dict(side.order_difference),
        journal={name: PinPath(x=path[:, 0], y=path[:, 1]) for name, path in trace.journal.items()},
        free_share=dict(trace.free_share),
        **optional,
    )
    return run, rules


def _axis(job: Job, trace: Trace) -> np.ndarray:
    """The crank's angle at each sample (N,) rad; where drives follow courses, the first one's position."""
    if job.schedule.crank_angle is not None:
        return job.schedule.crank_angle
    if job.schedule.drives and not job.mechanism.cranked:
        return next(iter(job.schedule.positions().values()))
    return trace.crank_angle


def _run_verdict(comparisons: Sequence[Comparison]) -> Verdict:
    """The verdict on one run: a signal that cannot be told from none does not agree, nor does a run without signals."""
    verdicts = {each.verdict for each in comparisons}
    if "disagrees" in verdicts:
        return "disagrees"
    return "unjudged" if not comparisons or "unjudged" in verdicts else "agrees"


def _verdict(runs: Sequence[Run], failures: Sequence[Failure], statistics: Sequence[Compared] = ()) -> Verdict:
    """The verdict on the whole result: a run that failed or is not judged neither agrees nor disagrees; statistics that
    are not judged do not count.
    """
    verdicts = {run.verdict for run in runs} | {one.verdict for one in statistics if one.verdict == "disagrees"}
    if "disagrees" in verdicts:
        return "disagrees"
    return "unjudged" if failures or not runs or "unjudged" in verdicts else "agrees"


def _explained(job: Job, run: Run) -> Run:
    """A run that disagrees with the assumption that fails in it, where one is known to."""
    if run.verdict != "disagrees" or not run.clearance or job.as_it_is or run.simulator.recorded:
        return run
    failing = failing_assumption(run, job.mechanism, job.tolerances, job.schedule)
    return run.model_copy(update={"because": because(run, job.mechanism, failing)}) if failing else run


def _rules(job: Job, side: Reference, trace: Trace, simulated: Mapping[str, np.ndarray]) -> dict[str, Rule]:
    """What each compared signal of a run may differ by."""
    clearances, m = dict(trace.clearance), job.mechanism
    give, scales = contact_give(trace.settings, clearances, simulated), Scales.of(side.signals, m, side.peaks)
    wanted = None
    if trace.recorded:
        wanted = recorded(m, clearances, (s for s, values in simulated.items() if np.any(np.isfinite(values))))
    elif any(signal.name not in simulated for signal in compared(m, clearances)):
        wanted = _given_signals(m, clearances, simulated)
    if job.beside and not trace.recorded:
        usual = compared(m, clearances) if wanted is None else wanted
        beside = (name for name in job.beside if name in simulated)
        wanted = recorded(m, clearances, (*(s.name for s in usual), *beside))
    if side.undetermined:
        every = compared(m, clearances) if wanted is None else wanted
        wanted = tuple(s for s in every if s.kind != "reaction" or s.place not in side.undetermined)
    rules = run_rules(job.tolerances, m, trace.motion, trace.joint_model, clearances, scales, give, wanted)
    if trace.recorded and give:  # how stiff its contact was nobody knows
        stiff = run_rules(job.tolerances, m, trace.motion, trace.joint_model, clearances, scales, 0.0, wanted)
        given = {s: rules[s].tolerance(side.signals) - rule.tolerance(side.signals) for s, rule in stiff.items()}
        rules = {s: replace(rule, unsure=rule.unsure + np.nan_to_num(given[s])) for s, rule in stiff.items()}
    if side.unsure:
        rules = {s: replace(r, unsure=r.unsure + SIGMAS * side.unsure.get(s, 0.0)) for s, r in rules.items()}
    return softened(rules, side, clearances, job.mechanism) if job.flexible else rules


def _supported(name: str, request: Request) -> bool:
    """Whether an engine runs a request at all, whichever engine it is; what is no engine's is asked to say so."""
    try:
        check_supported(engine(name), request)
    except Unsupported:
        return False
    return True


def _given_signals(
    mechanism: Mechanism, clearances: Mapping[str, float], simulated: Mapping[str, np.ndarray]
) -> tuple[Signal, ...]:
    """The signals of every run that somebody's model gives; of a reaction the one component that it gives alone."""
    signals = [signal for signal in compared(mechanism, clearances) if signal.name in simulated]
    alone = [signal for signal in recorded(mechanism, clearances, simulated) if signal.kind == "reaction"]
    return tuple(dict.fromkeys([*signals, *alone]))


def _discrepancies(
    job: Job, side: Reference, trace: Trace, simulated: Mapping[str, np.ndarray], rules: Mapping[str, Rule]
) -> list[Comparison]:
    known = known_differences(
        job.tolerances, job.mechanism.name, trace.simulator, trace.joint_model, trace.motion, job.model
    )
    theta = job.schedule.crank_angle
    analytic = dict(side.signals)
    if trace.recorded:  # a cell that is empty says nothing
        analytic |= {s: np.where(np.isnan(simulated[s]), np.nan, analytic[s]) for s in rules}
    judged = (judge(rule, simulated, analytic, theta, known.get(name)) for name, rule in rules.items())
    compared = [one for one in judged if one is not None]
    if trace.recorded:
        return compared
    return [one for one in compared if one.verdict != "unjudged" or not one.signal.on_request]  # see _not_judged


def _not_judged(job: Job, run: Run) -> Iterator[str]:
    """Why signals that were asked for beside the usual ones of an engine's run are not judged, in sentences."""
    if run.simulator.recorded:
        return
    known = named(job.mechanism.bodies, job.mechanism.joints, job.mechanism.drives, job.mechanism.sensors)
    asked = [name for name in job.beside if known[name].on_request]
    yield from untold(run.simulator.name, asked, run.simulated)
    told = {each.signal for each in run.discrepancies} | prescribed(job.mechanism)
    small = [name for name in asked if name in run.simulated and name not in told]
    if small:
        yield f"{run.title}: {', '.join(small)} {'is' if len(small) == 1 else 'are'} not judged: {NOT_TOLD_APART}"


def _touching(runs: Sequence[Run]) -> Iterator[str]:
    """A warning for each run of somebody's MuJoCo model in which geoms touch: the mechanism has no such forces."""
    for run in runs:
        if "touching" in run.settings:
            yield (
                f"{run.title}: geoms of the file touch, whose forces no mechanism has: {run.settings['touching']};"
                " before anything else, let them pass each other (contype = conaffinity = 0, or <contact><exclude>)"
            )


def _of_file_models(runs: Sequence[Run]) -> Iterator[str]:
    """A warning for each run of somebody's MuJoCo model that disagrees: its own solver and step may be the cause."""
    for run in runs:
        step, opened = run.settings.get("time_step"), run.settings.get("loops_open_by")
        if run.verdict != "disagrees" or not isinstance(opened, float):
            continue
        how, ways = "", "a smaller solref"
        if isinstance(step, float):
            how, ways = (
                f"in steps of {step:g} s with {run.settings['integrator']}, ",
                "a tenth of its timestep and solref",
            )
        acts = [count(str(run.settings[what]), what[:-1]) for what in ("contacts", "limits") if what in run.settings]
        acting = f"with {' and '.join(acts)} of the file acting, " if acts else ""
        loops = f"its loops open by up to {1e3 * opened:.2g} mm" if opened else "no loop opens"
        yield (
            f"{run.title}: it runs as its file says, {acting}{how}and {loops}; before a mass or a length is blamed, try"
            f" {ways} in the file"
        )


def _entry(d: Comparison, theta: np.ndarray) -> Discrepancy:
    reason: dict[str, Any] = {"reason": d.reason} if d.reason else {}
    return Discrepancy(
        signal=d.signal.name,
        kind=d.kind,
        unit=d.unit,
        max=d.max,
        rms=d.rms,
        at_crank_angle=float(theta[d.at]) if d.at >= 0 else None,
        tolerance=d.tolerance,
        verdict=d.verdict,
        **reason,
    )
