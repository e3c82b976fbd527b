"""What comes before the search: the rig and the nominal model, the courses that runs follow, the effects that are
considered and their bounds.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, diags_array

from analytic.beyond_paper.drive import Motor
from analytic.beyond_paper.freedom import Freedom
from analytic.kinematics.assembly import Assembly, AssemblyError
from analytic.kinematics.motion import kinematics
from analytic.kinematics.structure import StructureError
from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from analytic.mechanism.signals import turned_near
from analytic.paper.kinetostatics import load_turns
from compare.diagnose.courses import (
    course,
    encoder_noise,
    nudged,
    smoothed,
    smoothed_alike,
    stiffened,
    strayed,
    turning_back,
)
from compare.diagnose.data.quality import switched
from compare.diagnose.data.recording import Channel, Fault, Measured, MeasuredError, MeasuredRun
from compare.diagnose.data.thin import frozen, missed, picked
from compare.diagnose.effects.effect import STOPS, Effect, Parameter, Rig
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.fit import Bounds
from compare.diagnose.predict import Model, Motors, StartOfRun, Term, commanded, pieces
from compare.diagnose.residuals import Data, bridged
from compare.recorded.text import MIN_ROWS

SAMPLES = 60_000  # of all sensors together; of more, evenly spaced ones are used
FOLLOWS = 0.25  # rad, or of half of what an encoder reads, that the nominal mechanism may stray from it in a piece
FEWEST_SAMPLES = 8  # samples of a piece
IMPULSES = 12  # to a piece, at least, by which errors of what pushes it are told
UNTOLD = 0.3  # of an encoder's noise, that they may leave
WITHIN = 0.2  # of n^1.5 steps: by so much (rms) white pushes of n samples, less their mean, move a crank
NUMBERS = 20_000_000  # of the matrix of errors that sensors share, at most
SHORTEST = 1e-6  # m of travel, that a slide makes at least
BESIDE = 2.0  # samples, in which a pin crosses its bearing where a load turns round
MOVING_SIGMAS = 4.0  # sigmas, by which a slide's speed must be known from none


def thinned(measured: Measured) -> Measured:
    """The measurement with about SAMPLES samples at most, one in so many of each run; all of a run whose course needs
    them.
    """
    total = sum(run.time.size * len(run.channels) for run in measured.runs)
    every = math.ceil(total / SAMPLES)
    if every == 1:
        return measured
    runs, faults = [], list(measured.faults)
    for run in measured.runs:
        thin = picked(run, every)
        if run.drive == "measured" and any(missed(run, thin, each.name) for each in measured.mechanism.encoders):
            thin = run
        else:
            text = (
                f"run {run.name!r} has {count(run.time.size, 'sample')} of"
                f" {count(len(run.channels), 'sensor')}, {total} in all runs; one in {every} is used"
            )
            faults.append(
                Fault(
                    run.name,
                    "time",
                    "thinned",
                    run.time.size - thin.time.size,
                    f"{text}, their noise is estimated from all",
                )
            )
        runs.append(thin)
    return replace(measured, runs=tuple(runs), faults=tuple(faults))


def followed(measured: Measured) -> tuple[dict[str, Motor | Motors], Measured]:
    """The motors of the runs that follow their encoders, by run, and the measurement with a fault where a motor strays
    from its encoder, and where other sensors tell how smooth its course is, or are smoothed alike.
    """
    encoders, faults = [encoder.name for encoder in measured.mechanism.encoders], list(measured.faults)
    courses: dict[str, Motor | Motors] = {}
    runs = []
    for run in measured.runs:
        if run.drive == "measured":
            run, said = stiffened(measured, run)
            each = tuple(course(run, encoder) for encoder in encoders)
            strays = [strayed(run, encoder, motor) for encoder, motor in zip(encoders, each, strict=True)]
            courses[run.name] = Motors(each) if measured.mechanism.several else each[0]
            run, alike = smoothed_alike(run, encoders[0])
            faults += [*said, *(fault for fault in strays if fault is not None), *alike]
        elif run.push is not None:
            run = _in_pieces(measured, run)
        runs.append(run)
    measured = replace(measured, runs=tuple(runs), faults=tuple(faults))
    return courses, _while_moving(measured, courses)


def _in_pieces(measured: Measured, run: MeasuredRun) -> MeasuredRun:
    """A run that its motor's torque pushes in as few pieces as the nominal mechanism nearly follows; in as many as its
    samples allow where it follows in none.
    """
    encoder, names = measured.mechanism.encoders[0].name, (run.name,)
    values = bridged(run.channels[encoder].values)
    allowed = FOLLOWS * min(1.0, float(np.ptp(values)) / 2)
    rig = Rig(measured.mechanism, (*run.channels,), names, ())
    while 2 * run.pieces * FEWEST_SAMPLES <= run.time.size:
        alone = replace(measured, runs=(run,))
        said = Model(alone, rig, measured.mechanism, {})(
            [[(t, t.effect.values(rig, t.where, x, t.variant)) for t, x in starts(alone).items()]]
        )[0]
        if said is not None and np.abs(said[0][encoder] - values).max() <= allowed:
            break
        run = replace(run, pieces=2 * run.pieces)
    return run


def _while_moving(measured: Measured, courses: Mapping[str, Motor | Motors]) -> Measured:
    """The measurement without the forces and torques that were read while a slide, or a crank whose course other
    sensors had to tell, rested or turned back: there dry friction may be anything up to its size, either way.  Raises
    MeasuredError where nothing else was read.
    """
    runs, faults = [], list(measured.faults)
    what = "slide" if measured.mechanism.sliding else "crank"
    for run in measured.runs:
        encoder = measured.mechanism.encoders[0].name
        if run.name not in courses or not (measured.mechanism.sliding or run.channels[encoder].reach):
            runs.append(run)
            continue
        still, channels = _still(run, encoder, courses[run.name]), dict(run.channels)
        for name, channel in run.channels.items():
            lost = still & np.isfinite(channel.values)
            if channel.signal.kind not in ("reaction", "drive") or not lost.any():
                continue
            if np.sum(np.isfinite(channel.values) & ~still) < MIN_ROWS:
                raise MeasuredError(
                    f"{run.file}: the {what} of run {run.name!r} rests or turns back in {int(still.sum())} of"
                    f" {run.time.size} samples, as far as its encoder tells; give a run in which it moves"
                )
            channels[name] = _without(channel, lost)
            text = (
                f"{name} of run {run.name!r} is left out in the {count(int(lost.sum()), 'sample')} in which the {what}"
                " rests or turns back: dry friction may be anything there"
            )
            faults.append(Fault(run.name, name, "rest", int(lost.sum()), text))
        runs.append(replace(run, channels=channels))
    return replace(measured, runs=tuple(runs), faults=tuple(faults))


def _without(channel: Channel, lost: np.ndarray) -> Channel:
    """A channel without samples (N,) bool."""
    return replace(channel, values=frozen(np.where(lost, math.nan, channel.values)))


def _past_reversals(measured: Measured, model: Model) -> Measured:
    """The measurement without what a crank's runs read within BESIDE samples of where a load that opposes the motion
    turns round in the nominal linkage: reactions jump there, and pins with clearance cross their bearings.
    """
    runs, faults = [], list(measured.faults)
    for run in measured.runs:
        mechanism = model.altered(run, ())
        if run.drive == "free" or not mechanism.cranked or not any(load.opposes for load in mechanism.loads):
            runs.append(run)
            continue
        turning = model.motor(run, mechanism).at(run.time)
        try:
            motion = kinematics(Assembly(mechanism), turning.theta, turning.omega, turning.alpha)
        except AssemblyError:  # the nominal model's fault, which is told later
            return measured
        within = BESIDE * float(np.median(np.abs(np.diff(turning.theta))))
        lost = np.any(list(load_turns(motion, within).values()), axis=0)
        jumping = {
            name: channel
            for name, channel in run.channels.items()
            if channel.signal.kind == "reaction" or (mechanism.displaced and name != model.rig.encoder)
            if np.sum(np.isfinite(channel.values) & ~lost) >= MIN_ROWS
        }
        if lost.any() and jumping:
            run = replace(run, channels={**run.channels, **{name: _without(c, lost) for name, c in jumping.items()}})
            text = (
                f"run {run.name!r} is without its {', '.join(jumping)} in the {count(int(lost.sum()), 'sample')} in"
                " which a load that opposes the motion turns round: reactions jump there"
                f"{', and pins cross their bearings' * mechanism.displaced}"
            )
            faults.append(Fault(run.name, "time", "rest", int(lost.sum()), text))
        runs.append(run)
    return replace(measured, runs=tuple(runs), faults=tuple(faults))


def _still(run: MeasuredRun, encoder: str, motor: Motor | Motors) -> np.ndarray:
    """At which samples (N,) bool a slide or crank rests or turns back as far as its encoder tells: within half a
    sample, or what its course was to be smoothed over.
    """
    smoother, moving = smoothed(run, encoder), motor.at(run.time)
    unsure = smoother.uncertainty(smoother.answers(run.time)[1], encoder_noise(run, encoder))
    half_sample = float(np.median(np.diff(run.time))) / 2
    turning = np.abs(moving.omega) < MOVING_SIGMAS * unsure + np.abs(moving.alpha) * half_sample
    return turning | turning_back(run, smoother) if run.channels[encoder].reach else turning


def shared(measured: Measured, floor: Mapping[tuple[str, str], float], model: Model) -> np.ndarray:
    """Errors (size, k) that all sensors of a run share because the course it follows is smoothed from a noisy encoder:
    what the errors of its angle, speed and acceleration do to each residual, to first order.

    The covariance of the residuals is 1 + shared shared^T; of too many directions those that matter least are left out.
    """
    whole = Data(measured, floor)
    columns = [np.zeros((whole.size, 0))]
    for r, run in enumerate(measured.runs):
        places = [np.arange(part.place.start, part.place.stop) for part in whole.parts if part.run == r]
        if run.drive == "measured" and places:
            for k in range(len(model.rig.encoders)):
                factor = _strained(replace(measured, runs=(run,)), floor, model, k)
                columns.append(np.zeros((whole.size, factor.shape[1])))
                columns[-1][np.concatenate(places)] = factor
    pushes = starts(measured)
    for r, run in enumerate(measured.runs):
        if run.push is not None:
            columns.append(_unsure_push(whole, model, r, pushes))
    together = np.hstack(columns)
    worth = np.argsort(-np.sum(together**2, axis=0))[: max(1, NUMBERS // whole.size)]
    return np.ascontiguousarray(together[:, np.sort(worth)])


def _unsure_push(data: Data, model: Model, r: int, starts: Mapping[Term, np.ndarray]) -> np.ndarray:
    """The errors (size, k) that the sensors of a pushed run share because what pushes it has noise, or was switched
    between two samples: impulses in some stretches of each of its pieces.
    """
    run, rig = data.measured.runs[r], model.rig
    assert run.push is not None
    each = pieces(run.time.size, run.pieces)
    variance = np.full(run.time.size, run.push.noise**2)
    count = _impulses(run, model, max(piece.stop - piece.start for piece in each))
    stretches = [np.array_split(np.arange(piece.start, piece.stop), count) for piece in each]
    if switched(run.push.values):  # each jump by itself, between the samples before and after it
        jumps = np.nan_to_num(np.diff(run.push.values, prepend=run.push.values[0], append=run.push.values[-1])) ** 2
        variance = (jumps[:-1] + jumps[1:]) / 24
        at = [piece.start + np.flatnonzero(variance[piece]) for piece in each]
        stretches = [np.array_split(here, max(1, here.size)) for here in at]
    hypothesis = [(t, t.effect.values(rig, t.where, x, t.variant)) for t, x in starts.items()]
    origin = Model(data.measured, rig, model.mechanism, model.courses)([hypothesis])[0]
    columns = []
    for k in range(max(len(piece) for piece in stretches)):
        values = run.push.values.copy()
        for stretch in (piece[k] for piece in stretches if k < len(piece)):
            values[stretch] += math.sqrt(float(variance[stretch].sum())) / max(stretch.size, 1)
        other = replace(run, push=replace(run.push, values=frozen(values)))
        runs = tuple(other if q == r else one for q, one in enumerate(data.measured.runs))
        said = Model(replace(data.measured, runs=runs), rig, model.mechanism, model.courses)([hypothesis])[0]
        if said is None or origin is None:
            continue
        change = data.residual(said) - data.residual(origin)
        for piece in each:
            column = np.zeros(data.size)
            for part in (part for part in data.parts if part.run == r):
                inside = (part.used >= piece.start) & (part.used < piece.stop)
                column[part.place][inside] = change[part.place][inside]
            if column.any():
                columns.append(column)
    return np.column_stack(columns) if columns else np.zeros((data.size, 0))


def _impulses(run: MeasuredRun, model: Model, samples: int) -> int:
    """By how many impulses in a piece of so many samples what white noise of a push does is told within a share of the
    encoder's noise: what n samples do within themselves grows with n^1.5.
    """
    assert run.push is not None
    encoder = run.channels[model.rig.encoder]
    freedom = Freedom.of(Assembly(model.altered(run, []).ideal()))
    inertia = float(np.median(freedom.inertia(bridged(encoder.values))))
    shift = run.push.noise / inertia * float(np.median(np.diff(run.time))) ** 2
    stretch = (UNTOLD * encoder.noise / (WITHIN * shift)) ** (2 / 3)
    return int(min(max(IMPULSES, math.ceil(samples / stretch)), samples))


def _strained(measured: Measured, floor: Mapping[tuple[str, str], float], model: Model, of: int) -> np.ndarray:
    """The errors (size, k) that all sensors of a measurement of one run share because of one of its encoders."""
    (run,), encoder = measured.runs, model.rig.encoders[of]
    data, smoother = Data(measured, floor), smoothed(run, encoder)
    origin = Model(measured, model.rig, model.mechanism, model.courses)([[]])[0]
    used = np.concatenate([part.used for part in data.parts])
    answers = csr_array((data.size, smoother.size))
    for order, answer in enumerate(smoother.answers(run.time)):
        nudge = 1e-5 * model.rig.speed**order
        motor = nudged(model.courses[run.name], of, order, nudge)
        found = Model(measured, model.rig, model.mechanism, {run.name: motor})([[]])[0]
        if found is not None and origin is not None:
            slope = (data.residual(found) - data.residual(origin)) / nudge
            answers = answers + diags_array(slope) @ answer[used]
    return smoother.errors(csr_array(answers), encoder_noise(run, encoder))


def starts(measured: Measured) -> dict[Term, np.ndarray]:
    """The unknown starts of free runs."""
    encoder = measured.mechanism.encoders[0]
    found: dict[Term, np.ndarray] = {}
    for run in measured.runs:
        if run.push is not None:
            moved = course(run, encoder.name).at(run.time[[piece.start for piece in pieces(run.time.size, run.pieces)]])
            term = Term(StartOfRun(), run.name, float(run.pieces) if run.pieces > 1 else 0.0)
            found[term] = np.column_stack([moved.theta, moved.omega]).ravel()
        elif run.drive == "free":
            rate = run.start.get(f"{encoder.place}_angular_velocity", 0.0)
            found[Term(StartOfRun(), run.name)] = np.array([run.start[encoder.name], rate])
    return found


def nominal(measured: Measured, mechanism: Mechanism, courses: Mapping[str, Motor | Motors]) -> tuple[Rig, Model]:
    """The rig and the model of the nominal mechanism.  Raises MeasuredError where it cannot make the runs."""
    rig = _rig(measured, mechanism, courses)
    model = Model(measured, rig, mechanism, courses)
    if model([[(t, t.effect.values(rig, t.where, x)) for t, x in starts(measured).items()]])[0] is None:
        _explain_impossible(measured, mechanism, model)
        raise MeasuredError(
            f"{measured.source}: the nominal mechanism cannot make these runs; check drive_angle, start and assembly"
        )
    return rig, model


def _explain_impossible(measured: Measured, mechanism: Mechanism, model: Model) -> None:
    """Raise what stops the nominal mechanism from making a run."""
    for run in measured.runs:
        try:
            if run.drive == "free":
                Freedom.of(Assembly(model.altered(run, []).ideal()))
            else:
                model.signals(run, [], run.time)
        except (AssemblyError, StructureError) as error:
            raise MeasuredError(
                f"{measured.source}: run {run.name!r} cannot be made by the nominal mechanism: {error}"
            ) from None


def _rig(measured: Measured, mechanism: Mechanism, courses: Mapping[str, Motor | Motors]) -> Rig:
    """Sizes of the rig, from its nominal motion."""
    each = [_sensors(run) for run in measured.runs]
    signals = tuple(dict.fromkeys(s for one in each for s in one))
    least = {s: min(one[s].noise for one in each if s in one) for s in signals}
    arms = [abs(b.centre - b.point(name)) for b in mechanism.bodies for name in b.points]
    length = max(b.length for b in mechanism.bodies) or max(arms) or 1.0
    if mechanism.sliding:
        low, high = _reach(measured, courses)
        length = max(high - low, SHORTEST)
    paces = np.array([1.0 if encoder.unit == "rad" else length for encoder in mechanism.encoders])
    speeds = [abs(run.speed) for run in measured.runs if run.speed]
    speeds += [
        float((np.abs(np.atleast_2d(course.at(run.time).omega)) / paces[:, None]).max())
        for run in measured.runs
        if (course := courses.get(run.name))
    ]
    encoder = mechanism.encoders[0].name
    free = [run for run in measured.runs if run.drive == "free" and encoder in run.channels]
    speeds += [_swiftest(run, encoder) / float(paces[0]) for run in free]
    speed = max([*speeds, 1e-3])
    weight = sum(b.mass for b in mechanism.bodies) * abs(complex(*mechanism.gravity))
    given = [load for run in measured.runs for load in (run.loads if run.loads is not None else mechanism.loads)]
    loads = [load.largest * (abs(complex(*load.force)) + abs(load.torque) / length) for load in given]
    inertia = max(b.mass for b in mechanism.bodies) * length * speed**2
    return Rig(
        mechanism,
        signals,
        tuple(r.name for r in measured.runs),
        tuple(r.name for r in measured.runs if r.drive != "free"),
        tuple(r.name for r in measured.runs if r.drive == "measured"),
        length,
        max(weight, inertia, *loads, 1e-9),
        speed,
        least,
        {run.name: tuple(_sensors(run)) for run in measured.runs},
        _postures(measured, mechanism, courses),
        any(load.over == "time" for load in given),
        _turned(measured, mechanism, courses),
    )


def _sensors(run: MeasuredRun) -> dict[str, Channel]:
    """The sensors of a run by signal, that of what pushes it among them."""
    return dict(run.channels) | ({} if run.push is None else {run.push.signal.name: run.push})


def _turned(measured: Measured, mechanism: Mechanism, courses: Mapping[str, Motor | Motors]) -> tuple[np.ndarray, ...]:
    """Where the crank (N,) rad is at the samples of each driven run; none of what no crank moves."""
    if not mechanism.cranked:
        return ()
    driven = [run for run in measured.runs if run.drive != "free"]
    return tuple((courses.get(run.name) or commanded(run, mechanism)).at(run.time).theta for run in driven)


def _postures(
    measured: Measured, mechanism: Mechanism, courses: Mapping[str, Motor | Motors]
) -> tuple[np.ndarray, ...]:
    """Inputs (k, STOPS) of a linkage that no crank moves, evenly over what its drives do in a run, of each run."""
    if mechanism.cranked:
        return ()
    if mechanism.sliding:
        return (np.linspace(*_reach(measured, courses), STOPS),)
    try:
        assembly = Assembly(mechanism)
    except (AssemblyError, StructureError):
        return ()  # what cannot be assembled is told when the nominal mechanism is to move
    found, joints = [], [joint.name for joint in mechanism.motors]
    for run in measured.runs:
        at = courses[run.name].at(np.linspace(run.time[0], run.time[-1], STOPS)).theta
        found.append(assembly.inputs_at(dict(zip(joints, at, strict=True))))
    return tuple(found)


def _reach(measured: Measured, courses: Mapping[str, Motor | Motors]) -> tuple[float, float]:
    """Least and largest travel (m) of a slide in all runs."""
    encoder = measured.mechanism.encoder.name
    travels = np.concatenate(
        [
            courses[run.name].at(run.time).theta if run.name in courses else bridged(run.channels[encoder].values)
            for run in measured.runs
        ]
    )
    return float(travels.min()), float(travels.max())


def _swiftest(run: MeasuredRun, signal: str) -> float:
    """Largest rate of an angle (rad/s), over a hundredth of the run, so that noise does not count."""
    here = np.flatnonzero(np.isfinite(run.channels[signal].values))
    lag = max(1, here.size // 100)
    step = run.channels[signal].values[here[lag:]] - run.channels[signal].values[here[:-lag]]
    return float(np.max(np.abs(step / (run.time[here[lag:]] - run.time[here[:-lag]])), initial=0.0))


def on_one_turn(measured: Measured) -> Measured:
    """Free runs moved by whole turns to about the same angle, within half a turn of zero: an encoder does not know in
    which turn it is, and a spring that a model lacks does.  Validation runs go to the turn of those that are fitted.
    Where the model has a spring, runs stay.
    """
    encoder = measured.mechanism.encoders[0].name
    if any(joint.stiffness for joint in measured.mechanism.joints):
        return measured
    moved, about = {}, 0.0
    for run in sorted(measured.runs, key=lambda run: run.role != "fit"):
        if run.drive == "free" and run.push is None and encoder in run.channels:
            channel = run.channels[encoder]
            middle = float(np.nanmedian(channel.values))
            turns = middle - float(turned_near(np.array(middle), about))
            about = middle - turns if run.role == "fit" else about
            values = channel.values - turns
            start = turned_near(run.start[encoder], values[np.isfinite(values)][0])
            channels = {**run.channels, encoder: replace(channel, values=values)}
            moved[run.name] = replace(run, channels=channels, start={**run.start, encoder: float(start)})
    return replace(measured, runs=tuple(moved.get(run.name, run) for run in measured.runs))


def sorted_out(measured: Measured, rig: Rig, model: Model) -> tuple[Measured, Rig, Model]:
    """The measurement as the nominal model can judge it (:func:`unturned`), with its rig and model.  Raises
    MeasuredError.
    """
    judged = _past_reversals(unturned(measured, model, starts(measured)), model)
    if judged.sensors != measured.sensors:
        rig = _rig(judged, model.mechanism, model.courses)
    return judged, rig, Model(judged, rig, model.mechanism, model.courses)


def unturned(measured: Measured, model: Model, starts: Mapping[Term, np.ndarray]) -> Measured:
    """Measured angles moved by whole turns to where the model has them, without the reactions that it does not
    determine.  Raises MeasuredError where nothing else was read.
    """
    found = model([[(t, t.effect.values(model.rig, t.where, x)) for t, x in starts.items()]])[0]
    if found is None:
        return measured
    measured = _determined(measured, found)
    runs = []
    for run, predicted in zip(measured.runs, found, strict=True):
        channels = {}
        for signal, channel in run.channels.items():
            turns = 0.0
            if run.push is not None and signal == model.rig.encoder:
                pass  # its pieces start where it was read
            elif run.drive == "free" and signal == model.rig.encoder:  # its motion may be another, its start not
                first = channel.values[np.isfinite(channel.values)][:1]
                turns = float(np.sum(turned_near(np.zeros(1), first - run.start[signal])))
            elif channel.signal.kind == "pose" and channel.signal.wraps:
                turns = float(turned_near(np.zeros(()), np.nanmedian(channel.values - predicted[signal])))
            channels[signal] = replace(channel, values=channel.values - turns) if turns else channel
        runs.append(replace(run, channels=channels))
    return replace(measured, runs=tuple(runs))


def _determined(measured: Measured, predicted: Sequence[Mapping[str, np.ndarray]]) -> Measured:
    """The measurement without the reactions that statics does not determine: those of which the model says nothing."""
    runs, faults = [], list(measured.faults)
    for run, said in zip(measured.runs, predicted, strict=True):
        silent = [s for s, c in run.channels.items() if c.signal.kind == "reaction" and not np.isfinite(said[s]).any()]
        for signal in silent:
            text = (
                f"{signal} of run {run.name!r} is left out: the linkage is held more often than it needs, and statics"
                " does not determine this reaction"
            )
            faults.append(Fault(run.name, signal, "absent", run.time.size, text))
        kept = {signal: channel for signal, channel in run.channels.items() if signal not in silent}
        if silent and not set(kept) - {encoder.name for encoder in measured.mechanism.encoders}:
            raise MeasuredError(f"{run.file}: {faults[-1].text}; add another sensor")
        runs.append(replace(run, channels=kept))
    return replace(measured, runs=tuple(runs), faults=tuple(faults))


def check_prior(measured: Measured, terms: Sequence[Term]) -> None:
    """Raises MeasuredError for an entry of [prior] that is no effect of these data."""
    for given in measured.prior:
        if fault := _unknown(terms, given):
            raise MeasuredError(f"{measured.source}: prior.{given}: {fault}")


def considered(
    terms: Sequence[Term], tolerance: Mapping[str, float], bounds: Bounds, only: Sequence[str], exclude: Sequence[str]
) -> tuple[list[Term], dict[tuple[str, str], str]]:
    """The terms without variants that are beyond the tolerances, and why some of them are ruled out, by name and place.

    Raises MeasuredError for names that are none, or that leave nothing.
    """
    possible = allowed(terms, tolerance, bounds)
    room = {t.key for t in possible}
    why = {t.key: "the tolerance leaves it no room" for t in terms if t.key not in room}
    out = ruled_out(terms, only, exclude)
    if only and all(t.key in out for t in terms):
        raise MeasuredError(
            f"only {' and '.join(only)} is asked for: it has no place in these runs, or is excluded; nothing is left"
            " to look for; compare effects says where each may be"
        )
    why |= out
    return [t for t in terms if t in possible or t.key in why], why


def ruled_out(terms: Sequence[Term], only: Sequence[str], exclude: Sequence[str]) -> dict[tuple[str, str], str]:
    """Terms that the engineer rules out.  Raises MeasuredError for names that are none, or on both lists."""
    if fault := next((fault for given in (*only, *exclude) if (fault := _unknown(terms, given))), ""):
        raise MeasuredError(fault)
    if both := [given for given in only if given in exclude]:
        raise MeasuredError(f"{both[0]!r} is both among only and excluded; leave it out of one")
    out = {}
    for t in terms:
        if {t.label, t.effect.name} & set(exclude):
            out[t.key] = "excluded by the engineer"
        elif only and not {t.label, t.effect.name} & set(only):
            out[t.key] = "not among --only"
    return out


def _unknown(terms: Sequence[Term], given: str) -> str:
    """What is wrong with the name of an effect, or name@where, that these data do not have; empty for one of theirs."""
    known = {label for t in terms for label in (t.label, t.effect.name)} | set(VOCABULARY)
    if given in known:
        return ""
    close = difflib.get_close_matches(given, known, n=1)
    remedy = "give each by itself" if "," in given else f"did you mean {close[0]!r}" if close else ""
    return f"{given!r} is not an effect of these data{f'; {remedy}' if remedy else ''}; see: compare effects"


def bounds(rig: Rig, tolerance: Mapping[str, float]) -> Bounds:
    """Natural coordinates' physical bounds, narrowed by the engineer's tolerances."""

    def bounds(term: Term) -> tuple[np.ndarray, np.ndarray]:
        effect = term.effect
        low = np.array(effect.lowest(rig, term.where, term.variant), float)
        high = np.array(effect.highest(rig, term.where, term.variant), float)
        for i in range(low.size):
            p = effect.measured_by(i)
            kind = "length" if p.quantity == "angle" and effect.unit(rig, term.where, p.name) == "m" else p.quantity
            limit = _limit(effect, replace(p, quantity=kind), tolerance)
            if limit is not None and effect.blames(p.name):
                middle = effect.middle(term.variant)
                low[i], high[i] = max(low[i], -limit - middle), min(high[i], limit - middle)
        return low, high

    return bounds


def _limit(effect: Effect, p: Parameter, tolerance: Mapping[str, float]) -> float | None:
    """The tolerance on a parameter: of effect and parameter, or of the parameter, or of its quantity."""
    return next((tolerance[key] for key in (f"{effect.name}.{p.name}", p.name, p.quantity) if key in tolerance), None)


def allowed(terms: Sequence[Term], tolerance: Mapping[str, float], bounds: Bounds) -> list[Term]:
    """The terms that the tolerances leave possible: not an effect whose first parameter must be exact, nor a variant
    beyond its tolerance.
    """

    def has_room(term: Term) -> bool:
        low, high = bounds(term)
        inside = bool(np.all(low <= 0) and np.all(high >= 0))
        return _limit(term.effect, term.effect.parameters[0], tolerance) != 0 and inside and bool(np.any(high > low))

    return [term for term in terms if has_room(term)]
