"""The analytic side of a comparison: every signal at the run's crank angles, and where the model has no answer."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from analytic.beyond_paper.drive import Turning
from analytic.beyond_paper.free_motion import free_motion
from analytic.beyond_paper.released import released
from analytic.kinematics.assembly import Assembly, AssemblyError, Followed
from analytic.kinematics.motion import Motion as Moving
from analytic.kinematics.motion import kinematics
from analytic.kinematics.reach import usual_angles
from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count, one_line
from analytic.mechanism.signals import Signal, driving, named
from analytic.paper.clearance import Displaced, Model, displaced
from analytic.paper.compliance import compliance
from analytic.paper.envelope import condition
from analytic.paper.kinetostatics import friction_turns
from analytic.paper.superposition import ILL_CONDITIONED, superposed
from compare.judge.courses import Courses
from compare.judge.discrepancy import difference, largest
from compare.judge.signals import UNITS, compared, kind_of, with_derived
from compare.results.crosscheck import OrderDifference
from sim_models.engine import Motion

SURE = 4.0  # rms errors of a motion that is known no better, by which a signal may be off
MOVED = ("theta", "omega", "alpha")  # parts of a motion
NEAR_SINGULAR = (
    "what links that bend change of forces is left out, which is much near a singular posture: the condition number of"
    " the loops is up to"
)
TURNS_BACK = "and its friction has no direction"  # in a flag
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

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader has to know of it, in sentences."""
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
    theta: np.ndarray,
    motion: Motion,
    model: Model,
    clearances: Mapping[str, float],
    error: float = 0.0,
) -> Reference:
    """The analytic model at crank angles theta (N,) rad, known to ``error`` (rad, rms), with these clearances (m; none
    for ideal joints).
    """
    speed = assembly.mechanism.speed or 1.0  # without a speed only statics is left, where its sign is all that matters
    moving = Turning(theta, np.full(theta.shape, speed), np.zeros(theta.shape))
    inertia = motion == "driven"
    found = _side(assembly, moving, inertia, model, clearances)
    found = found if inertia else _at_rest(found)
    if error:
        moved = {"theta": np.full(theta.shape, error)}
        found = replace(found, unsure=_unsure(found, assembly, moving, moved, inertia, model, clearances))
    usual = usual_angles(assembly)
    if np.array_equal(usual, theta):
        return found
    found = replace(found, peaks={})
    with suppress(AssemblyError):  # the displaced linkage does not reach all of them
        at = displaced(assembly, usual, speed, model=model, inertia=motion == "driven", clearances=clearances)
        found = replace(found, peaks=largest(with_derived(at.signals(), assembly.mechanism)))
    return found


def followed_reference(
    assembly: Assembly, moving: Turning, errors: Turning, model: Model, clearances: Mapping[str, float]
) -> Reference:
    """The analytic model along a motion of the crank with these clearances (m), and how far its signals are unsure
    where the motion is known to these ``errors`` (rms).
    """
    side = _side(assembly, moving, True, model, clearances)
    moved = {part: getattr(errors, part) for part in MOVED}
    return replace(side, unsure=_unsure(side, assembly, moving, moved, True, model, clearances))


def followed_drives_reference(
    assembly: Assembly,
    drives: Mapping[str, tuple[Turning, Turning]],
    model: Model,
    clearances: Mapping[str, float],
) -> Reference:
    """The same along the motions of several drives, by joint: each one's motion, and to which errors (rms) it is known;
    as positions of their joints.  Raises AssemblyError.
    """

    def inputs(part: str, which: int) -> np.ndarray:
        return assembly.inputs_at({name: getattr(drive[which], part) for name, drive in drives.items()})

    moving = Turning(*(inputs(part, 0) for part in MOVED))
    side = _side(assembly, moving, True, model, clearances)
    errors = {part: inputs(part, 1) for part in MOVED}
    return replace(side, unsure=_unsure(side, assembly, moving, errors, True, model, clearances))


def _unsure(
    side: Reference,
    assembly: Assembly,
    moving: Turning,
    errors: Mapping[str, np.ndarray],
    inertia: bool,
    model: Model,
    clearances: Mapping[str, float],
) -> dict[str, np.ndarray]:
    """How far each signal (N,) changes with parts of the motion that are off by these errors, (N,) of a crank or
    (n_inputs, N).

    Positions are off by up to what they are rounded to, and all may be by that much at once; of rates and accelerations
    what one leaves open does not depend on another's.
    """
    limits: dict[str, np.ndarray] = {}
    squares: dict[str, np.ndarray] = {}
    known = named(assembly.mechanism.bodies, assembly.mechanism.joints, assembly.mechanism.drives)
    for part, error in errors.items():
        for own in np.eye(len(np.atleast_2d(error)), dtype=bool):
            off = np.where(own[:, None], error, 0.0).reshape(error.shape)
            other = replace(moving, **{part: getattr(moving, part) + off})
            changed = displaced(
                assembly, other.theta, other.omega, alpha=other.alpha, model=model, inertia=inertia,
                clearances=clearances,
            )  # fmt: skip
            for name, values in with_derived(changed.signals(), assembly.mechanism).items():
                apart = known[name].apart(values, side.signals[name])
                if part == "theta":
                    limits[name] = limits.get(name, 0.0) + np.abs(apart)
                else:
                    squares[name] = squares.get(name, 0.0) + apart**2
    return {name: np.nan_to_num(np.hypot(limit, np.sqrt(squares.get(name, 0.0)))) for name, limit in limits.items()}


def _side(
    assembly: Assembly,
    moving: Turning,
    inertia: bool,
    model: Model,
    clearances: Mapping[str, float],
    held: Collection[str] = (),
    near: Followed | None = None,
) -> Reference:
    """The analytic model along a motion of the crank, or of several inputs, flagged where friction has no direction;
    joints that are ``held`` have none.  ``near`` are the samples' coordinates, where they are known already.
    """
    mechanism = assembly.mechanism

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
        )

    models: tuple[Model, ...] = ("equilibrium", "first_order") if clearances else (model,)
    sides = {each: at(each) for each in models}
    found = sides[model]
    signals = {each: with_derived(side.signals(), mechanism) for each, side in sides.items()}
    order: dict[str, OrderDifference] = {}
    for signal in compared(mechanism, clearances) if clearances else ():
        apart = signal.apart(*(signals[each][signal.name] for each in ("first_order", "equilibrium")))
        if (most := difference(apart)) is not None:
            unit, where = UNITS[kind_of(signal)], float(_told(found.ideal.motion)[most.at])
            order[signal.name] = OrderDifference(unit=unit, max=most.max, rms=most.rms, at_crank_angle=where)
    ideal = _angles(found.ideal.motion)
    rough = [name for name in clearances if mechanism.joint(name).friction]
    turning = friction_turns(found.ideal.motion, REVERSAL if inertia else 0.0, rough)
    turning = {name: here for name, here in turning.items() if name not in held}
    own = _own_friction(mechanism, turning)
    turning = {name: here for name, here in turning.items() if name not in own}
    loose, peaks = found.reactions.undetermined, largest(signals[model])
    side = Reference(signals[model], ideal, order, found.flags, peaks=peaks, undetermined=loose)
    side = _without({i: why for i, why in _reversals(turning).items() if i not in found.flags}, side)
    return silenced(side, {signal.name: turned for signal, turned in own.values()})


def timed_reference(
    assembly: Assembly,
    time: np.ndarray,
    courses: Courses,
    motion: Motion,
    model: Model,
    clearances: Mapping[str, float],
    errors: Mapping[str, np.ndarray] | None = None,
) -> Reference:
    """The analytic model at times (N,) s of a linkage whose drives follow ``courses``, with these clearances (m).

    In ``static`` motion every drive holds what it moves where its course has it, and only the direction of that course
    is left of its rate, against which friction acts; there is none in a drive that never moves.  ``errors`` (N,) by
    joint say how exactly its positions are known then (rms).  In driven motion what no drive moves moves freely, with
    ideal joints.  Raises AssemblyError.
    """
    s, splines = assembly.structure, courses.splines
    if motion == "static":
        moving, near = _resting(assembly, time, courses)
        side = _at_rest(_side(assembly, moving, False, model, clearances, _held(assembly, courses), near))
        if errors is None:
            return side
        off = {"theta": assembly.inputs_at(errors)}
        return replace(side, unsure=_unsure(side, assembly, moving, off, False, model, clearances))
    if s.free:
        found = free_motion(assembly, time, splines)
        signals = with_derived(found.signals(), assembly.mechanism)
        return Reference(
            signals, _angles(found.motion), {}, {}, peaks=largest(signals), undetermined=found.undetermined
        )
    inputs, omega, alpha = (
        assembly.inputs_at({name: spline(time, order) for name, spline in splines.items()}) for order in range(3)
    )
    near = on_the_way(assembly, time, courses)
    return _side(assembly, Turning(inputs, omega, alpha), True, model, clearances, near=near)


def _resting(assembly: Assembly, time: np.ndarray, courses: Courses) -> tuple[Turning, Followed]:
    """The inputs at times (N,) s, with the direction in which they go on, and the coordinates there."""
    inputs, omega = (assembly.inputs_at(each) for each in (courses.at(time), courses.directions(time)))
    return Turning(inputs, omega, np.zeros(inputs.shape)), on_the_way(assembly, time, courses)


def on_the_way(assembly: Assembly, time: np.ndarray, courses: Courses) -> Followed:
    """Coordinates at times (N,) s of the ideal linkage that follows its courses: few samples do not say by which way
    it comes from one to the next.  Raises AssemblyError.
    """
    way = courses.until(time)
    return Followed(assembly.follow(assembly.inputs_at(courses.at(way))).coordinates[:, np.searchsorted(way, time)])


def _held(assembly: Assembly, courses: Courses) -> frozenset[str]:
    """Joints that no course ever moves: those of drives that stand, and where all of them do every joint."""
    standing = {name for name, (_, where) in courses.knots.items() if np.ptp(where) == 0}
    moves = len(standing) < len(courses.knots)
    return frozenset(standing if moves else (joint.name for joint in assembly.mechanism.joints))


def _at_rest(side: Reference) -> Reference:
    """A side whose bodies do not move: their rates are 0."""
    rates = (Signal("rate", body, "angular_velocity").name for body in side.ideal_angles)
    return replace(side, signals={**side.signals, **{name: np.zeros(side.signals[name].shape) for name in rates}})


def _told(motion: Moving) -> np.ndarray:
    """What the samples (N,) of a motion are told along: the crank's angle, or the first input's joint's position."""
    s = motion.structure
    return motion.theta if s.mechanism.cranked else s.signs[s.inputs[0]] * motion.theta


def _angles(motion: Moving) -> dict[str, np.ndarray]:
    return {body.name: motion.angle(body.name) for body in motion.structure.mechanism.bodies}


def with_flexible_links(side: Reference, assembly: Assembly, theta: np.ndarray) -> Reference:
    """The analytic side at rest at crank angles theta (N,) rad, with the elastic displacement of the ideal linkage
    added: the paper's superposition (Fig. 7c, :func:`analytic.paper.superposition.superposed`).  Reactions keep their
    values and their peaks.
    """
    return _bent(side, kinematics(assembly, theta, assembly.mechanism.speed or 1.0))


def timed_with_flexible_links(side: Reference, assembly: Assembly, time: np.ndarray, courses: Courses) -> Reference:
    """The same of a side at rest at times (N,) s of its drives' courses, which hold their joints."""
    resting, near = _resting(assembly, time, courses)
    return _bent(side, kinematics(assembly, resting.theta, resting.omega, path=near))


def _bent(side: Reference, ideal: Moving) -> Reference:
    m, found, worst = ideal.structure.mechanism, compliance(ideal), float(condition(ideal).max())
    known = named(m.bodies, m.joints, m.drives)
    peaks = {name: peak for name, peak in side.peaks.items() if known[name].kind in ("reaction", "drive")}
    return replace(
        side,
        signals=with_derived(superposed(side.signals, found), m),
        peaks=peaks,
        elastic=max(float(np.abs(found.displacement(*place)).max()) for place in found.motions),
        cautions=(*side.cautions, f"{NEAR_SINGULAR} {worst:.3g}") if worst > ILL_CONDITIONED else side.cautions,
    )


def released_reference(
    assembly: Assembly,
    time: np.ndarray,
    start: tuple[float | None, float] = (None, 0.0),
    errors: tuple[float, float] = (0.0, 0.0),
) -> Reference:
    """The analytic motion of a linkage at times (N,) s after its release at an angle (rad; None is the assembly's) and
    rate (rad/s), which are known to ``errors``.
    """
    side = _released(assembly, time, *start)
    angle = assembly.start if start[0] is None else start[0]
    known = named(assembly.mechanism.bodies, assembly.mechanism.joints, assembly.mechanism.drives)
    squares: dict[str, np.ndarray] = {}
    for other in ((angle + errors[0], start[1]), (angle, start[1] + errors[1])):
        if other != (angle, start[1]):
            changed = _released(assembly, time, *other).signals
            for name, values in changed.items():
                squares[name] = squares.get(name, 0.0) + known[name].apart(values, side.signals[name]) ** 2
    return replace(side, unsure={name: np.nan_to_num(np.sqrt(total)) for name, total in squares.items()})


def _released(assembly: Assembly, time: np.ndarray, angle: float | None, rate: float) -> Reference:
    found = released(assembly, time, angle, rate)
    mechanism, reactions = assembly.mechanism, found.reactions
    ideal = _angles(reactions.motion)
    signals = with_derived(reactions.signals(), mechanism)
    rubbing = [joint.name for joint in mechanism.joints if joint.rubs]
    why = f"at rest, where nothing says how friction in {' and '.join(rubbing)} share what they hold"
    flags = {int(i): why for i in np.flatnonzero(found.held)} if len(rubbing) > 1 else {}
    flags |= {
        int(i): "the linkage turns back here, and its friction has no direction" for i in np.flatnonzero(found.turning)
    }
    return _without(flags, Reference(signals, ideal, {}, {}))


def _own_friction(mechanism: Mechanism, turning: Mapping[str, np.ndarray]) -> dict[str, tuple[Signal, np.ndarray]]:
    """Of what turns back, by joint, what a motor drives: what it gives, and where (N,).  A motor and its joint's
    friction act between the same two bodies, so that the rest of the linkage does not feel which of them does what.
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


def _without(flags: Mapping[int, str], side: Reference) -> Reference:
    """A side with NaN at the samples that are flagged."""
    if not flags:
        return side
    silent = list(flags)
    signals = {name: np.array(values) for name, values in side.signals.items()}
    for values in signals.values():
        values[silent] = np.nan
    return replace(side, signals=signals, flags={**side.flags, **flags})
