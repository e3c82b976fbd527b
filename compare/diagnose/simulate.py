"""The readings of a run by an engine, with real clearance joints, friction and beams: no analytic model is used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analytic.beyond_paper.drive import Motor
from analytic.beyond_paper.freedom import Freedom
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.reach import turns_fully
from analytic.kinematics.schedule import Schedule
from analytic.mechanism import Load, Mechanism
from compare.diagnose.data.recording import MeasuredRun
from compare.diagnose.effects.effect import Rig
from compare.diagnose.predict import (
    Hypothesis,
    Motors,
    State,
    Term,
    ages,
    altered,
    commanded,
    heard,
    jitter_of,
    mixed,
    pieces,
    push_of,
    pushed,
    read_at,
    sensed,
    turned_by,
)
from compare.judge.signals import with_derived
from compare.omissions import untold
from compare.recorded.motion import released_from
from sim_models.common.backlash import TURN_TO_LAND
from sim_models.common.rates import with_rates
from sim_models.engine import (
    Engine,
    JointModel,
    Request,
    SettingValue,
    SimulationError,
    SimulatorMissing,
    Trace,
    Unsupported,
    engine,
)

STEPS = 20  # of an engine to a sample under a motor's torque: dry friction turns back up to a step late in most
EVERYWHERE = 1e-9  # kg, N ...: by so little differ a slide's coefficients that are the same all along
COURSE_STEP = 2e-3  # of a run's length, at most, between the knots of a motor's course


@dataclass(frozen=True)
class Simulated:
    """What an engine says of every run: readings by signal, or why there are none."""

    name: str
    version: str = ""
    readings: Sequence[Mapping[str, np.ndarray]] | None = None
    skipped: str | None = None
    settings: Sequence[Mapping[str, SettingValue]] = field(default_factory=tuple)  # of each run
    added: Sequence[str] = ()  # effects that it lacks and gets as the analytic model's difference


@dataclass(frozen=True)
class Task:
    """One run to be simulated under one hypothesis by one engine."""

    engine: str
    run: MeasuredRun
    mechanism: Mechanism  # nominal
    hypothesis: Hypothesis
    rig: Rig
    course: Motor | Motors | None  # of a run that follows its data
    start: Sequence[State]  # of a free run: angle (rad) and rate (rad/s) at the first sample of each of its pieces


def lacking(name: str, terms: Sequence[Term]) -> list[Term]:
    """Effects that an engine cannot represent."""
    return [t for t in terms if not t.effect.simulated_by(engine(name))]


def simulate(task: Task) -> tuple[dict[str, np.ndarray], str, Mapping[str, SettingValue]] | str:
    """Readings (N,) by signal, the engine's version and settings; or why the engine could not."""
    try:
        chosen = engine(task.engine)
        loaded = task.mechanism if task.run.loads is None else task.mechanism.replace(loads=task.run.loads)
        mechanism = altered(loaded, task.hypothesis, task.run.name)
        echoes = heard(task.hypothesis, task.run)
        course = None if isinstance(task.course, Motors) else task.course
        lines = read_at(task.run, task.rig.encoder, course, jitter_of(task.run, task.hypothesis))
        times = np.unique(np.concatenate([each - age for each in (lines, task.run.time) for age in ages(echoes)]))
        if task.run.drive == "free":
            trace, seen = _free(chosen, mechanism, task, times)
        else:
            trace, seen = _driven(chosen, mechanism, task, times)
        # the encoder tells by its stamps, all others when their line was read
        clock = {s: task.run.time if s == task.rig.encoder else lines for s in echoes}
        by_age = {age: {s: seen[s][np.searchsorted(times, clock[s] - age)] for s in echoes} for age in ages(echoes)}
        readings = sensed(task.hypothesis, task.run, {s: mixed(each, by_age, s) for s, each in echoes.items()})
        return readings, trace.version, dict(trace.settings)
    except SimulationError as error:
        return error.said(())
    except (SimulatorMissing, Unsupported, AssemblyError, ValueError) as error:
        return str(error)


def _joint_model(mechanism: Mechanism) -> JointModel:
    return "contact" if mechanism.clearances else "ideal"


def _driven(chosen: Engine, mechanism: Mechanism, task: Task, times: np.ndarray) -> tuple[Trace, dict[str, np.ndarray]]:
    """Trace and signals at times (N,) s of a run behind a motor."""
    run = task.run
    if isinstance(task.course, Motors):
        return _several(chosen, mechanism, task, task.course, times)
    drive = mechanism.drive
    motor = task.course or commanded(run, mechanism)
    if run.drive == "measured" or (drive is not None and drive.ripple is not None):
        mechanism = mechanism.with_drive(speed="measured", ripple=None)
        knots = _knots(times)
        course = knots, turned_by(run, motor.at(knots), task.hypothesis, task.rig).theta
        if mechanism.sliding:  # times count from the first knot: late readings may ask for some before zero
            courses = {mechanism.input_joint.name: (knots - knots[0], course[1])}
            schedule = Schedule.along(courses, times - knots[0])
        else:
            schedule = Schedule.of_crank(mechanism, course, times)
        request = Request(mechanism, _joint_model(mechanism), schedule)
    else:
        mechanism = mechanism.with_drive(speed=float(run.speed or 0.0), ripple=None)
        lead_in = TURN_TO_LAND if mechanism.half_gap and turns_fully(Assembly(mechanism)) else 0.0
        schedule = Schedule.at_angles(mechanism, motor.at(times).theta)
        request = Request(mechanism, _joint_model(mechanism), schedule, lead_in=lead_in)
    trace = _run(chosen, _clocked(request, times))
    return trace, _signals(mechanism, trace, run) | {
        task.rig.encoder: turned_by(run, motor.at(times), task.hypothesis, task.rig).theta
    }


def _several(
    chosen: Engine, mechanism: Mechanism, task: Task, motors: Motors, times: np.ndarray
) -> tuple[Trace, dict[str, np.ndarray]]:
    """Trace and signals at times (N,) s of a run in which several drives follow their encoders."""
    knots = _knots(times)
    followed = [turned_by(task.run, motors.at(t), task.hypothesis, task.rig).theta for t in (knots, times)]
    moved = dict(zip((joint.name for joint in mechanism.motors), followed[0], strict=True))
    courses = {joint: (knots - knots[0], course) for joint, course in moved.items()}
    request = Request(mechanism, _joint_model(mechanism), Schedule.along(courses, times - knots[0]))
    trace = _run(chosen, _clocked(request, times))
    read = dict(zip(task.rig.encoders, followed[1], strict=True))
    return trace, _signals(mechanism, trace, task.run) | read


def _knots(times: np.ndarray) -> np.ndarray:
    """Times (s) between which a course is the cubic spline, from just before times (N,) to just after."""
    margin = 1e-6 * float(times[-1] - times[0])
    return np.linspace(times[0] - margin, times[-1] + margin, max(2 * times.size, round(1 / COURSE_STEP)))


def _free(chosen: Engine, mechanism: Mechanism, task: Task, times: np.ndarray) -> tuple[Trace, dict[str, np.ndarray]]:
    """Trace and signals of a released run, of its last piece and of all; before a piece's first sample, those of that
    sample.
    """
    parts: list[dict[str, np.ndarray]] = []
    ends = [task.run.time[piece.start] for piece in pieces(task.run.time.size, len(task.start))[1:]]
    for state, here in zip(task.start, np.split(times, np.searchsorted(times, ends)), strict=True):
        begin = task.run.time[0] if not parts else ends[len(parts) - 1]
        distinct, back = np.unique(np.maximum(here - begin, 0.0), return_inverse=True)
        released, off = _let_go(mechanism.ideal(), task, state[0], float(begin), float(distinct[-1]))
        distinct = distinct if distinct.size > 1 else np.array([0.0, task.run.time[-1] - task.run.time[0]])
        if released.sliding:
            schedule = replace(Schedule.along({}, distinct), rates={released.input_joint.name: state[1]})
        else:
            schedule = Schedule.released(released, distinct, state[1])
        step = None if task.run.push is None else float(np.median(np.diff(task.run.time))) / STEPS
        trace = _run(chosen, Request(released, _joint_model(released), schedule, step=step))
        signals = _signals(released, trace, task.run)
        parts.append({name: values[back] + off.get(name, 0.0) for name, values in signals.items()})
    return trace, {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _let_go(
    mechanism: Mechanism, task: Task, place: float, begin: float, length: float
) -> tuple[Mechanism, Mapping[str, float]]:
    """The linkage let go at this angle (rad) or travel (m), its motor's torque a load from a time (s) on, for so long;
    and what its signals are more than the engine's: engines let slides go where they are assembled.
    """
    off: dict[str, float] = {}
    if mechanism.sliding:
        off[mechanism.encoder.name] = place - Assembly(mechanism).positions[mechanism.input_joint.name]
        released = mechanism.with_drive(speed="free")
        if np.ptp(Freedom.of(Assembly(released)).table, axis=1).max() > EVERYWHERE:
            raise ValueError("a slide whose forces change with its travel is let go where it is assembled alone")
    else:
        released = released_from(mechanism, place)
    if task.run.push is None:
        return released, off
    torque = push_of(task.run, *pushed(task.run, task.hypothesis))
    until = min(int(np.searchsorted(task.run.time, begin + length)) + 2, torque.size)
    since = int(np.searchsorted(task.run.time, begin))
    here = zip((task.run.time[since:until] - begin).tolist(), torque[since:until].tolist(), strict=True)
    return released.replace(loads=(*released.loads, _motor(mechanism, tuple(here)))), off


def _motor(mechanism: Mechanism, table: tuple[tuple[float, float], ...]) -> Load:
    """What a motor gives over time (s): pairs of it and N.m, or N."""
    if not mechanism.sliding:
        return Load(body=mechanism.driven, torque=1.0, over="time", table=table)
    joint = mechanism.input_joint
    body = next(name for name in joint.bodies if name != "ground")
    along = complex(*(joint.axis or (1.0, 0.0))) * (1.0 if joint.bodies[1] == body else -1.0)
    force = (along.real / abs(along), along.imag / abs(along))
    return Load(body=body, point=joint.name, force=force, over="time", table=table)


def _signals(mechanism: Mechanism, trace: Trace, run: MeasuredRun) -> dict[str, np.ndarray]:
    """What a trace says, with the signals on request that a run has.  Raises Unsupported where it does not say one."""
    asked = [name for name, channel in run.channels.items() if channel.signal.on_request]
    told = with_rates(mechanism, trace, asked)
    if lacking := untold(trace.simulator, asked, told):
        raise Unsupported(lacking[0])
    return with_derived(told, mechanism)


def _clocked(request: Request, times: np.ndarray) -> Request:
    """A request for times (N,) s of a run's clock, with loads over that clock as loads over its own schedule's."""
    m, by = request.mechanism, float(request.schedule.time[0] - times[0])
    if m.timed_load is None or by == 0:
        return request
    return replace(request, mechanism=m.replace(loads=tuple(load.later(by) for load in m.loads)))


def _run(chosen: Engine, request: Request) -> Trace:
    if not request.mechanism.bends:
        return chosen.simulate(request)
    if chosen.capabilities.beams is None:
        return chosen.simulate(replace(request, mechanism=request.mechanism.rigid()))
    return chosen.simulate_flexible(request)
