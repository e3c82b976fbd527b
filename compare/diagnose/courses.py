"""The course that a run follows: a smooth one through its encoder's readings, as stiff as these tell, or what was
measured beside them.

Cross-validation takes each reading's error for its own.  Where an encoder rings, or errs alike for some samples, the
course follows that, and its acceleration makes of it a force that nothing measured: then the reach is chosen by which
the sensors are met best.  A force that is switched makes an acceleration jump, which no smooth course can: both are
smoothed alike.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.sparse import csr_array, diags_array

from analytic.beyond_paper.drive import Motor
from analytic.kinematics.schedule import Steady
from compare.diagnose.data.quality import noise, switched
from compare.diagnose.data.recording import Fault, Measured, MeasuredRun
from compare.diagnose.data.thin import frozen
from compare.diagnose.effects.effect import Rig
from compare.diagnose.predict import Model, Motors
from compare.recorded.smooth import Smoother

FELT = ("drive", "reaction")  # kinds of signals that accelerations make
ROUGHER = 1.5  # times what its noise and a course's white errors leave of a sensor: then the course may err alike
DRAWS = 16  # of when a force was switched, between two samples
UNSURE = 0.03  # of what that leaves open of the force where it is switched: of what is compared it leaves no more
BLURRED = 0.1  # of dry friction, that smoothing may take off where a slide or crank turns back
TOGETHER = 8  # samples over which a course may not miss its encoder
STRAY = 3.0  # sigmas (rms) by which it misses the encoder then


def course(run: MeasuredRun, encoder: str) -> Motor:
    """The motor of a run that follows its encoder: a smooth course through the readings that there are."""
    return Motor(smoothed(run, encoder).course)


def encoder_noise(run: MeasuredRun, encoder: str) -> float:
    """Noise (rad) of the encoder that a course is drawn through: as stated, or what the course leaves, if more."""
    channel = run.channels[encoder]
    return max(channel.noise if channel.noise_given else 0.0, smoothed(run, encoder).sigma)


def course_errors(run: MeasuredRun, encoder: str, slopes: Sequence[np.ndarray], sigma: float) -> np.ndarray:
    """Root mean square error (N,) of what answers with ``slopes`` (N,) to the angle, rate and acceleration of a run's
    course, whose encoder has noise sigma (rad).
    """
    smoother = smoothed(run, encoder)
    answers = sum(diags_array(s) @ a for s, a in zip(slopes, smoother.answers(run.time), strict=True))
    return smoother.uncertainty(csr_array(answers), sigma)


def smoothed(run: MeasuredRun, encoder: str) -> Smoother:
    """The course through an encoder's readings (N,), those that there are, and what it answers to."""
    values = run.channels[encoder].values
    known = np.isfinite(values)
    return _smoother(run.time[known].tobytes(), values[known].tobytes(), run.channels[encoder].reach)


@lru_cache(maxsize=32)
def _smoother(time: bytes, values: bytes, reach: float | None) -> Smoother:
    """Kept, because what follows an encoder and what its errors do are asked for one after the other."""
    return Smoother(np.frombuffer(time), np.frombuffer(values), reach)


def strayed(run: MeasuredRun, encoder: str, motor: Motor) -> Fault | None:
    """Where a course misses the encoder that it should follow by more than the encoder's noise and counts; None if it
    does nowhere.
    """
    channel = run.channels[encoder]
    known = np.flatnonzero(np.isfinite(channel.values))
    time, values = run.time[known], channel.values[known]
    off, unit = motor.at(time).theta - values, channel.signal.unit
    near = np.sqrt(np.convolve(off**2, np.full(TOGETHER, 1 / TOGETHER), "valid"))
    sigma = max(channel.noise, noise(time, values), encoder_noise(run, encoder) if channel.reach else 0.0)
    if near.max() <= STRAY * sigma:
        return None
    first = int(np.argmax(near))
    worst = first + int(np.argmax(np.abs(off[first : first + TOGETHER])))
    text = (
        f"the course that run {run.name!r} replays misses {encoder} by up to {_far(abs(off[worst]), unit, 3)},"
        f" near {time[worst]:.6g} s, and its noise and counts are {_far(sigma, unit, 2)}: it moves too abruptly"
        " there to be followed; do not trust what is found there, sample faster, or leave that part out"
    )
    return Fault(run.name, encoder, "course", int(np.sum(np.abs(off) > STRAY * sigma)), text)


def _far(size: float, unit: str, digits: int) -> str:
    """How far a course is from its encoder (rad, m), in degrees or millimetres."""
    return f"{math.degrees(size):.{digits}g} deg" if unit == "rad" else f"{1e3 * size:.{digits}g} mm"


def nudged(motor: Motor | Motors, of: int, order: int, nudge: float) -> Motor | Motors:
    """A motor, or one of several, of whose course the angle, or a rate, is off."""
    if isinstance(motor, Motor):
        return Motor(Nudged(motor, order, nudge))
    each = [Motor(Nudged(m, order, nudge)) if k == of else m for k, m in enumerate(motor.each)]
    return Motors(tuple(each))


@dataclass(frozen=True)
class Nudged:
    """A course of which the angle, or one of its rates alone, is off by a constant."""

    motor: Motor
    order: int
    nudge: float

    def __call__(self, time: np.ndarray, order: int = 0, /) -> np.ndarray:
        assert not isinstance(self.motor.command, Steady)
        return self.motor.command(time, order) + (self.nudge if order == self.order else 0.0)


# ---------------------------------------------------------------- what other sensors tell of it


def stiffened(measured: Measured, run: MeasuredRun) -> tuple[MeasuredRun, list[Fault]]:
    """A run that follows its encoder, on the course by which its forces and torques are met best, and that said; as it
    is where its own readings tell the course as well.

    Met is what a line through the nominal model's prediction, its motion and dry friction leaves: whatever the model
    lacks is left by every course, the acceleration of what the encoder errs alike by a rough one alone.
    """
    name = measured.mechanism.encoders[0].name
    felt = [s for s, c in run.channels.items() if c.signal.kind in FELT and not switched(c.values)]
    if measured.mechanism.several or not felt:
        return run, []
    smoother, judged = smoothed(run, name), _Judged(measured, run, felt)
    left = judged.left(smoother)
    if left is None or not judged.rough(left, judged.expected(smoother, name)):
        return run, []
    best, least = None, {s: each / ROUGHER for s, each in left.items()}
    reach = smoother.reach * smoother.step
    while (reach := reach * math.sqrt(2)) < float(np.ptp(run.time)) / 2:
        stiffer = replace(run, channels={**run.channels, name: replace(run.channels[name], reach=reach)})
        left = judged.left(smoothed(stiffer, name))
        if left is None or _worse(left, least) > math.log(2.0):
            break
        if _worse(left, least) < 0:
            best, least = stiffer, left
    if best is None:
        return run, []
    text = (
        f"{name} of run {run.name!r} errs alike for some samples, or rings: its course is smoothed over"
        f" {1e3 * (best.channels[name].reach or 0.0):.3g} ms, by which {' and '.join(felt)}"
        f" {'is' if len(felt) == 1 else 'are'} met best, not over {1e3 * smoother.reach * smoother.step:.3g} ms; what"
        " that leaves counts as noise"
    )
    raised = {s: replace(c, noise=max(c.noise, least[s])) if s in felt else c for s, c in best.channels.items()}
    best = replace(best, channels=raised)
    return best, [Fault(run.name, name, "rings", run.time.size, text)]


def _worse(one: Mapping[str, float], other: Mapping[str, float]) -> float:
    """By how much more one leaves than another, in the mean of logarithms."""
    return float(np.mean([math.log(one[s] / other[s]) for s in one]))


class _Judged:
    """The forces and torques of a run beside what the nominal model predicts of them along a course."""

    def __init__(self, measured: Measured, run: MeasuredRun, felt: Sequence[str]) -> None:
        names = (run.name,)
        rig = Rig(measured.mechanism, tuple(run.channels), names, names, names)
        self._run, self._felt = run, felt
        self._model = Model(replace(measured, runs=(run,)), rig, measured.mechanism, {})

    def _said(self, motor: Motor) -> Mapping[str, np.ndarray] | None:
        model = Model(self._model.measured, self._model.rig, self._model.mechanism, {self._run.name: motor})
        said = model([[]])[0]
        return None if said is None else said[0]

    def left(self, smoother: Smoother) -> dict[str, float] | None:
        """What is left (rms, SI) of each while the crank moves; None where the nominal mechanism cannot go there."""
        motor = Motor(smoother.course)
        said, moved, moves = self._said(motor), motor.at(self._run.time), ~turning_back(self._run, smoother)
        if said is None:
            return None
        beside = [moved.alpha, moved.omega, np.sign(moved.omega), np.sin(moved.theta), np.cos(moved.theta)]
        left = {}
        for signal in self._felt:
            values, columns = self._run.channels[signal].values, np.column_stack([said[signal], *beside])
            known = moves & np.isfinite(values) & np.isfinite(columns).all(axis=1)
            columns, values = np.column_stack([np.ones(values.size), columns])[known], values[known]
            off = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
            left[signal] = math.sqrt(float(np.mean(off**2))) if off.size else math.inf
        return left

    def rough(self, left: Mapping[str, float], expected: Mapping[str, float]) -> bool:
        """Whether a sensor is met worse than noise explains, or noise explains more than it reads."""
        spans = {s: float(np.nanstd(self._run.channels[s].values)) for s in expected}
        return any(left[s] > ROUGHER * each or each > spans[s] / 2 for s, each in expected.items())

    def expected(self, smoother: Smoother, encoder: str) -> dict[str, float]:
        """What noise of the sensors and white noise of the encoder leave (rms, SI) of each."""
        motor = Motor(smoother.course)
        found: dict[str, float] = {}
        pace = max(float(np.abs(motor.at(self._run.time).alpha).max()), 1e-12)
        here, there = self._said(motor), self._said(Motor(Nudged(motor, 2, pace)))
        errors = smoother.uncertainty(smoother.answers(self._run.time)[2], encoder_noise(self._run, encoder))
        if here is None or there is None:
            return found
        for signal in self._felt:
            moved = np.nan_to_num((there[signal] - here[signal]) / pace * errors)
            found[signal] = math.hypot(self._run.channels[signal].noise, math.sqrt(float(np.mean(moved**2))))
        return found


def turning_back(run: MeasuredRun, smoother: Smoother) -> np.ndarray:
    """At which samples (N,) bool smoothing takes more than BLURRED off a dry friction that turns with the motion."""
    at = smoother.start + smoother.step * smoother.at
    way = np.sign(smoother.course(at, 1))
    return np.asarray(np.interp(run.time, at, np.abs(smoother.smoothed(way) - way)) > BLURRED)


def smoothed_alike(run: MeasuredRun, encoder: str) -> tuple[MeasuredRun, list[Fault]]:
    """A run whose switched forces and torques are as smooth as the course that it follows, as many samples of them as
    that has freedoms; and that said.
    """
    channels, faults = dict(run.channels), []
    for name, channel in run.channels.items():
        jumps = switched(channel.values) if channel.signal.kind in FELT else 0.0
        known = np.isfinite(channel.values)
        if not jumps or not np.isfinite(run.channels[encoder].values[known]).all():
            continue
        smoother = Smoother(run.time[known], run.channels[encoder].values[known], run.channels[encoder].reach)
        every = max(1, round(known.sum() / smoother.freedom))
        steps = np.diff(channel.values[known], prepend=channel.values[known][0])
        when = np.random.default_rng(0).uniform(-0.5, 0.5, (steps.size, DRAWS)) * steps[:, None]
        unsure = np.sqrt(np.mean(smoother.smoothed(when) ** 2, axis=1))
        sure = np.flatnonzero(unsure <= UNSURE * jumps)
        sure = sure[sure % every == 0]
        values = np.full(run.time.size, math.nan)
        values[np.flatnonzero(known)[sure]] = smoother.smoothed(channel.values[known])[sure]
        size = math.hypot(channel.noise if channel.noise_given else 0.0, float(np.sqrt(np.mean(unsure[sure] ** 2))))
        channels[name] = replace(channel, values=frozen(values), noise=size, noise_given=True)
        text = (
            f"{name} of run {run.name!r} is switched: it is compared as smooth as the course that the run follows, in"
            f" one sample of {every}, and its noise is what samples leave open of when it is switched; drive = 'torque'"
            " takes it as the input instead"
        )
        faults.append(Fault(run.name, name, "switched", run.time.size, text))
        channels[encoder] = replace(run.channels[encoder], reach=smoother.reach * smoother.step)
    return replace(run, channels=channels), faults
