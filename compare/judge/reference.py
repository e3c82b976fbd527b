"""The analytic side of a comparison: every signal at the run's crank angles, and where the model has no answer."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from analytic.beyond_paper.free_motion import free_motion
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import Motion as Moving
from analytic.kinematics.motion import along
from analytic.kinematics.reach import usual_angles
from analytic.kinematics.schedule import Schedule, Turning
from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count, one_line
from analytic.mechanism.sensing import read_again, with_sensors
from analytic.mechanism.signals import OF_MOTION, Signal, driving, named, position, wrapped
from analytic.paper.clearance import Displaced, Model, displaced
from analytic.paper.compliance import compliance
from analytic.paper.envelope import condition
from analytic.paper.kinetostatics import Reactions, friction_turns, load_turns
from analytic.paper.superposition import ILL_CONDITIONED, superposed
from compare.judge.discrepancy import difference, largest
from compare.judge.signals import compared, only, with_derived
from compare.results.crosscheck import OrderDifference

SIGMAS = 4.0  # rms errors of a motion that is known no better, by which a signal may be off
NEAR_SINGULAR = (
    "what links that bend change of forces is left out, which is much near a singular posture: the condition number of"
    " the loops is up to"
)
TURNS_BACK = "and its friction has no direction"  # in a flag
AT_EDGE = 1e-3  # rad, or of the longest body, or of the time that is looked at: from where a load begins or ends
REVERSAL = 5e-3  # rad of crank before and after a joint's sliding reverses, where simulations preslide or are in a step


@dataclass(frozen=True)
class Reference:
    """Analytic signals (N,), NaN where flagged; ``ideal_angles`` (rad) are the bodies' without clearance.

    ``order_difference`` says for each compared signal how far the paper's first order is from the equilibrium;
    ``elastic`` (m) is the largest elastic displacement of any point, 0 with rigid links.  ``peaks`` are the signals'
    largest sizes at the linkage's usual crank angles; a signal without one is judged by its peak in the run.
    ``unsure`` (N,) is how far a signal may be off because the motion that it follows is known no better (rms).
    ``undetermined`` are the joints whose reactions statics does not determine: NaN, and compared with nothing.
    ``silent`` says by signal at which samples (N,) it alone has no number.  ``cautions`` are sentences on numbers that
    stand but are not to be relied on.
    """

    signals: Mapping[str, np.ndarray]
    ideal_angles: Mapping[str, np.ndarray]
    order_difference: Mapping[str, OrderDifference]
    flags: Mapping[int, str]
    elastic: float = 0.0
    peaks: Mapping[str, float] = field(default_factory=dict)
    unsure: Mapping[str, np.ndarray] = field(default_factory=dict)
    undetermined: frozenset[str] = frozenset()
    silent: Mapping[str, np.ndarray] = field(default_factory=dict)
    cautions: tuple[str, ...] = ()

    def only(self, mechanism: Mechanism, asked: Iterable[str]) -> Reference:
        """The same with those signals on request alone that are ``asked`` for by name."""
        signals, unsure = (only(each, mechanism, asked) for each in (self.signals, self.unsure))
        return replace(self, signals=signals, unsure=unsure, peaks=only(self.peaks, mechanism, asked))

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for the reader, in sentences."""
        quiet = tuple(
            f"{name} has no number at {int(here.sum())} of {count(here.size, 'sample')}: its joint stands or turns back"
            " there, and its friction takes any part of it"
            for name, here in self.silent.items()
        )
        if not self.undetermined:
            return (*self.cautions, *quiet)
        joints = ", ".join(sorted(self.undetermined))
        return (
            *self.cautions,
            *quiet,
            f"statics does not determine the reactions of {joints}, as the linkage is held more often than it needs:"
            " they have no number, and are not compared; what the drives give is determined",
        )

    def __repr__(self) -> str:
        samples = count(max((values.size for values in self.signals.values()), default=0), "sample")
        flagged = f"{len(self.flags)} flagged" if self.flags else ""
        return one_line(self, count(len(self.signals), "signal"), samples, flagged)


def reference(
    assembly: Assembly,
    schedule: Schedule,
    model: Model,
    clearances: Mapping[str, float],
    moving: Turning | None = None,
    errors: Turning | None = None,
    more: Collection[str] = (),
    alone: bool = False,
) -> Reference:
    """The analytic model at the instants (N,) of a schedule, with these clearances (m; none for ideal joints).

    At rest every drive holds what it moves where the schedule has it, and of its rate only the direction is left,
    against which friction acts; there is none in a drive that never moves.  In driven motion what no drive moves moves
    freely, with ideal joints.

    ``moving`` are the inputs as a record has them, (N,) of a crank or (n_inputs, N), where these are not just what the
    schedule's drives do; of a linkage that is let go, the state (1,) in which it is, and where only some of its
    freedoms are, the inputs (n_inputs, 1) where they begin.  ``errors`` say how exactly they are known (rms, the same
    shapes).  ``more`` are the names of signals on request that are asked for.  Where a joint's sliding, or what a load
    opposes, reverses there is no answer: to either side for a while, as a simulation has none there to be held against,
    unless the model stands ``alone`` and its crank turns evenly; its motion is known there too.  Raises AssemblyError.
    """
    side = _every(assembly, schedule, model, clearances, moving, errors, bool(more), alone)
    return side.only(assembly.mechanism, more) if more else side


def _every(
    assembly: Assembly,
    schedule: Schedule,
    model: Model,
    clearances: Mapping[str, float],
    moving: Turning | None,
    errors: Turning | None,
    rates: bool,
    alone: bool,
) -> Reference:
    """The same with all signals on request, or none."""
    if schedule.lets_go and schedule.crank is not None:
        start = moving or Turning(
            *(np.array([x]) for x in (assembly.start, schedule.start_speed(assembly.mechanism), 0))
        )
        return _let_go(assembly, schedule.time, start, errors, rates)
    if assembly.left_free(schedule):
        return _free(assembly, schedule, None if moving is None else moving.theta[:, 0], rates)
    moving = moving or assembly.inputs_along(schedule)
    still = _still(assembly, schedule) if schedule.at_rest else frozenset()
    side = _side(assembly, moving, schedule, model, clearances, rates, alone, still)
    side = _at_rest(side, assembly.mechanism) if schedule.at_rest else side
    if errors is not None:
        side = replace(side, unsure=_unsure(side, assembly, moving, errors, schedule, model, clearances, rates))
    return _with_usual_peaks(side, assembly, schedule, model, clearances, rates) if schedule.turns_evenly else side


def _with_usual_peaks(
    side: Reference,
    assembly: Assembly,
    schedule: Schedule,
    model: Model,
    clearances: Mapping[str, float],
    rates: bool,
) -> Reference:
    """A side with the peaks that its signals have at a crank's usual angles, as far as the displaced linkage reaches
    them.
    """
    usual, moves = usual_angles(assembly), not schedule.at_rest
    if assembly.mechanism.timed_load is not None:  # what is usual at an angle nobody knows
        return side
    if schedule.crank_angle is not None and np.array_equal(usual, schedule.crank_angle):
        return side
    side, speed = replace(side, peaks={}), schedule.crank_motion(assembly.mechanism).rate(0.0)
    with suppress(AssemblyError):
        at = displaced(assembly, usual, speed, model=model, inertia=moves, clearances=clearances)
        side = replace(side, peaks=largest(_signals(at, assembly.mechanism, rates)))
    return side


def _unsure(
    side: Reference,
    assembly: Assembly,
    moving: Turning,
    errors: Turning,
    schedule: Schedule,
    model: Model,
    clearances: Mapping[str, float],
    rates: bool,
) -> dict[str, np.ndarray]:
    """How far each signal (N,) changes with what the motion's ``errors`` leave open; at rest that is its positions.

    Positions are off by up to what they are rounded to, and all may be by that much at once; of rates and accelerations
    what one leaves open does not depend on another's.
    """
    limits: dict[str, np.ndarray] = {}
    squares: dict[str, np.ndarray] = {}
    known = named(
        assembly.mechanism.bodies, assembly.mechanism.joints, assembly.mechanism.drives, assembly.mechanism.sensors
    )
    for part in ("theta",) if schedule.at_rest else ("theta", "omega", "alpha"):
        error = np.broadcast_to(getattr(errors, part), moving.theta.shape)
        if not error.any():
            continue
        for alone in np.eye(len(np.atleast_2d(error)), dtype=bool):
            off = np.where(alone[:, None], error, 0.0).reshape(error.shape)
            other = replace(moving, **{part: getattr(moving, part) + off})
            changed = displaced(
                assembly, other.theta, other.omega, alpha=other.alpha, model=model, inertia=not schedule.at_rest,
                clearances=clearances, time=None if schedule.at_rest else schedule.time,
            )  # fmt: skip
            for name, values in _signals(changed, assembly.mechanism, rates).items():
                apart = known[name].apart(values, side.signals[name])
                if part == "theta":
                    limits[name] = limits.get(name, 0.0) + np.abs(apart)
                else:
                    squares[name] = squares.get(name, 0.0) + apart**2
    none = np.zeros(moving.theta.shape[-1:])
    return {
        name: np.nan_to_num(np.hypot(limits.get(name, none), np.sqrt(squares.get(name, none)))) for name in side.signals
    }


def _side(
    assembly: Assembly,
    moving: Turning,
    schedule: Schedule,
    model: Model,
    clearances: Mapping[str, float],
    rates: bool,
    alone: bool,
    still: Collection[str] = (),
) -> Reference:
    """The analytic model along a schedule's motion of the crank, or of several inputs, flagged where friction has no
    direction; joints that are ``still`` have none.
    """
    mechanism, near, inertia = assembly.mechanism, assembly.walk(schedule), not schedule.at_rest

    def at(model: Model) -> Displaced:
        return displaced(
            assembly,
            moving.theta,
            moving.omega,
            alpha=moving.alpha,
            model=model,
            inertia=inertia,
            clearances=clearances,
            near=near,
            time=schedule.time if inertia else None,
        )

    models: tuple[Model, ...] = ("equilibrium", "first_order") if clearances else (model,)
    sides = {each: at(each) for each in models}
    answer = sides[model]
    signals = {each: _signals(side, mechanism, rates) for each, side in sides.items()}
    order: dict[str, OrderDifference] = {}
    for signal in compared(mechanism, clearances) if clearances else ():
        apart = signal.apart(*(signals[each][signal.name] for each in ("first_order", "equilibrium")))
        if (most := difference(apart)) is not None:
            unit, where = signal.unit, float(_axis(answer.ideal.motion)[most.at])
            order[signal.name] = OrderDifference(unit=unit, max=most.max, rms=most.rms, at_crank_angle=where)
    ideal = _angles(answer.ideal.motion)
    rough = [name for name in clearances if mechanism.joint(name).friction]
    exact = alone and schedule.turns_evenly  # a course turns back where its samples have it, about
    reversal = REVERSAL if inertia and not exact else 0.0
    turning = friction_turns(answer.ideal.motion, reversal, rough)
    turning = {name: here for name, here in turning.items() if name not in still}
    by_motor = _own_friction(mechanism, turning)
    turning = {name: here for name, here in turning.items() if name not in by_motor}
    loose, peaks = answer.reactions.undetermined, largest(signals[model])
    side = Reference(signals[model], ideal, order, answer.flags, peaks=peaks, undetermined=loose)
    opposed = load_turns(answer.ideal.motion, reversal)
    flags = _reversals(turning) | {
        int(i): f"what the load on {body} opposes stands or turns back here, and it has no direction"
        for body, here in opposed.items()
        for i in np.flatnonzero(here)
    }
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)
    sure = [name for name in side.signals if alone and not clearances and known[name].kind in OF_MOTION]
    side = _without({i: why for i, why in flags.items() if i not in answer.flags}, side, sure)
    return silenced(side, {signal.name: turned for signal, turned in by_motor.values()})


def _free(assembly: Assembly, schedule: Schedule, start: np.ndarray | None, rates: bool) -> Reference:
    """The analytic motion of a linkage of several freedoms, some of which no drive moves, from inputs (n_inputs,)."""
    drives = {name: motor.positions for name, motor in schedule.drives.items()}
    motion = free_motion(assembly, schedule.time, drives, schedule.rates, start)
    signals = _signals(motion, assembly.mechanism, rates)
    return Reference(signals, _angles(motion.motion), {}, {}, peaks=largest(signals), undetermined=motion.undetermined)


def _still(assembly: Assembly, schedule: Schedule) -> frozenset[str]:
    """Joints that no drive ever moves: those of drives that stand, and where all of them do every joint."""
    standing = {name for name, course in schedule.courses.items() if np.ptp(course.values) == 0}
    moves = len(standing) < len(schedule.drives)
    return frozenset(standing if moves else (joint.name for joint in assembly.mechanism.joints))


def without_edges(side: Reference, m: Mechanism, time: np.ndarray) -> Reference:
    """A side at times (N,) s flagged where loads begin or end, or a damped stop is struck: there rounding decides
    whether a simulation has them.
    """
    flags: dict[int, str] = {}
    for stop in m.stops:
        joint = m.joint(stop.joint)
        values = side.signals.get(position(joint).name) if stop.damping else None
        near = AT_EDGE * (max(body.length for body in m.bodies) or 1.0 if joint.prismatic else 1.0)
        for _, depth in stop.depths(values) if values is not None else ():
            flags |= dict.fromkeys(
                np.flatnonzero(np.abs(depth) < near).tolist(), f"joint {joint.name} comes to its stop here"
            )
    for load in m.loads:
        values = m.load_values(load, side.signals, time) if load.over else None
        if load.start is None or load.end is None or values is None:
            continue
        unit = m.load_quantities[load.over].unit
        angular, size = unit == "rad", float(np.ptp(time)) if unit == "s" else max(body.length for body in m.bodies)
        near = AT_EDGE * (1.0 if angular else size or 1.0)
        for end in (load.start, load.end):
            away = np.asarray(values - end)
            for i in np.flatnonzero(np.abs(wrapped(away) if angular else away) < near):
                flags.setdefault(int(i), f"the load on {load.body} begins or ends here")
    return _without({i: why for i, why in flags.items() if i not in side.flags}, side) if flags else side


def _at_rest(side: Reference, m: Mechanism) -> Reference:
    """A side whose bodies do not move: their rates, accelerations and powers are 0."""
    known = named(m.bodies, m.joints, m.drives, m.sensors)
    moves = [name for name in side.signals if (one := known[name]).on_request or one.kind == "rate"]
    still = {**side.signals, **{name: np.zeros(side.signals[name].shape) for name in moves}}
    for sensor in m.sensors:
        still.pop(sensor.name, None)
    return replace(side, signals=with_sensors(m, still, still=True))


def _signals(answer: Displaced | Reactions, mechanism: Mechanism, rates: bool) -> dict[str, np.ndarray]:
    """The signals (N,) of an analytic answer, with ``rates`` those on request too."""
    signals = with_sensors(mechanism, answer.signals() | answer.rates()) if rates else answer.signals()
    return with_derived(signals, mechanism)


def _axis(motion: Moving) -> np.ndarray:
    """What the samples (N,) of a motion are told along: the crank's angle, or the first input's joint's position."""
    s = motion.structure
    return motion.theta if s.mechanism.cranked else s.signs[s.inputs[0]] * motion.theta


def _angles(motion: Moving) -> dict[str, np.ndarray]:
    return {body.name: motion.angle(body.name) for body in motion.structure.mechanism.bodies}


def with_flexible_links(side: Reference, assembly: Assembly, schedule: Schedule) -> Reference:
    """The analytic side of a schedule at rest with the elastic displacement of the ideal linkage added: the paper's
    superposition (Fig. 7c, :func:`analytic.paper.superposition.superposed`).  Reactions keep their values and their
    peaks.
    """
    ideal = along(assembly, schedule)
    m, elastic, worst = ideal.structure.mechanism, compliance(ideal), float(condition(ideal).max())
    known = named(m.bodies, m.joints, m.drives, m.sensors)
    peaks = {name: peak for name, peak in side.peaks.items() if known[name].kind in ("reaction", "drive")}
    return replace(
        side,
        signals=with_derived(read_again(m, superposed(side.signals, elastic), still=True), m),
        peaks=peaks,
        elastic=max(float(np.abs(elastic.displacement(*place)).max()) for place in elastic.motions),
        cautions=(*side.cautions, f"{NEAR_SINGULAR} {worst:.3g}") if worst > ILL_CONDITIONED else side.cautions,
    )


def _let_go(assembly: Assembly, time: np.ndarray, start: Turning, errors: Turning | None, rates: bool) -> Reference:
    """The analytic motion of a linkage of one crank at times (N,) s after its release, and how far what its start's
    ``errors`` leave open moves it.
    """
    angle, rate = float(start.theta[0]), float(start.omega[0])
    side = _released(assembly, time, angle, rate, rates)
    off = (0.0, 0.0) if errors is None else (float(errors.theta[0]), float(errors.omega[0]))
    others = [other for other in ((angle + off[0], rate), (angle, rate + off[1])) if other != (angle, rate)]
    return left_open(side, [_released(assembly, time, *other, rates) for other in others], assembly.mechanism)


def left_open(side: Reference, others: Iterable[Reference], mechanism: Mechanism) -> Reference:
    """A side that is known as exactly as ``others`` leave it, each with another thing off by its rms error."""
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives, mechanism.sensors)
    squares: dict[str, np.ndarray] = {}
    for other in others:
        for name, values in other.signals.items():
            squares[name] = squares.get(name, 0.0) + known[name].apart(values, side.signals[name]) ** 2
    return replace(side, unsure={name: np.nan_to_num(np.sqrt(total)) for name, total in squares.items()})


def _released(assembly: Assembly, time: np.ndarray, angle: float, rate: float, rates: bool) -> Reference:
    motion = released(assembly, time, angle, rate)
    mechanism, reactions = assembly.mechanism, motion.reactions
    ideal = _angles(reactions.motion)
    signals = _signals(reactions, mechanism, rates)
    joints = [joint.name for joint in mechanism.joints if joint.rubs]
    opposed = [load for load in mechanism.loads if load.opposes]
    holds = [f"friction in {' and '.join(joints)}"] if joints else []
    holds += [f"the force of the load on {load.body}" for load in opposed if any(load.force)]
    holds += [f"the torque of the load on {load.body}" for load in opposed if load.torque]
    why = f"at rest, where nothing says how {' and '.join(holds)} share what they hold"
    flags = {int(i): why for i in np.flatnonzero(motion.held)} if len(holds) > 1 or len(joints) > 1 else {}
    if opposed and motion.held[0]:
        flags[0] = "let go here, where engines have a load that opposes the motion from the next step on"
    flags |= {
        int(i): "the linkage turns back here, and its friction has no direction" for i in np.flatnonzero(motion.turning)
    }
    return _without(flags, Reference(signals, ideal, {}, {}))


def _own_friction(mechanism: Mechanism, turning: Mapping[str, np.ndarray]) -> dict[str, tuple[Signal, np.ndarray]]:
    """The motors of joints that turn back, by joint: the signal of what a motor gives, and where (N,).  A motor and its
    joint's friction act between the same two bodies, so that the rest of the linkage does not feel which does what.
    """
    if mechanism.cranked:  # whose samples at a dead centre say nothing, as ever
        return {}
    motors = mechanism.motors
    given = zip(motors, driving(motors) if motors else (), strict=True)
    return {joint.name: (signal, turning[joint.name]) for joint, signal in given if joint.name in turning}


def silenced(side: Reference, where: Mapping[str, np.ndarray]) -> Reference:
    """A side in which these signals have no number at some samples (N,), beside those where they had none."""
    where = {name: here | side.silent.get(name, np.zeros(here.shape, bool)) for name, here in where.items()}
    where = {name: here for name, here in where.items() if here.any()}
    signals = {name: np.where(here, np.nan, side.signals[name]) for name, here in where.items()}
    return replace(side, signals={**side.signals, **signals}, silent={**side.silent, **where})


def _reversals(turning: Mapping[str, np.ndarray]) -> dict[int, str]:
    """Why there is no answer where a joint's friction has no direction, by sample."""
    return {
        int(i): f"the sliding at {joint} stands or reverses here, {TURNS_BACK}"
        for joint, here in turning.items()
        for i in np.flatnonzero(here)
    }


def _without(flags: Mapping[int, str], side: Reference, sure: Collection[str] = ()) -> Reference:
    """A side with NaN at the samples that are flagged, but for signals that are ``sure`` there."""
    if not flags:
        return side
    silent = list(flags)
    signals = {name: np.array(values) for name, values in side.signals.items()}
    for name in signals.keys() - set(sure):
        signals[name][silent] = np.nan
    return replace(side, signals=signals, flags={**side.flags, **flags})
