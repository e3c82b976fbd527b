"""A run that is foretold under one set of effects: what its sensors read, and what each thing changes of that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import named
from compare.diagnose import prepare
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.predict import Hypothesis, Model
from compare.diagnose.stray import Fitted, Stray, Swing
from compare.results.diagnosis import DiagnosedRun, Diagnosis

Readings = Mapping[str, np.ndarray]
NUDGES = {"angle": 1e-5, "rate": 1e-4}  # rad, rad/s: of a swing's start
REFITS = 3  # of a start, from about the first readings
AT_REST = 0.05  # of a run's samples, than which it is as good as never slower, or faster
AS_FITTED = 2.0  # times what the fit left: a swing that is made again from the document leaves no more


@dataclass(frozen=True)
class Candidate:
    """A set of effects that may be what is missing: its values, and by effect how these differ along each axis of what
    the data leave open.
    """

    probability: float
    values: Hypothesis
    axes: Sequence[Mapping[str, Mapping[str, float]]] = ()

    def moved(self, axis: Mapping[str, Mapping[str, float]], way: int) -> Hypothesis:
        """Its values one standard deviation along an axis, or the other way."""
        return [
            (term, {name: v + way * axis.get(term.label, {}).get(name, 0.0) for name, v in values.items()})
            for term, values in self.values
        ]


@dataclass(frozen=True)
class Ahead:
    """A run to be foretold: a model of it alone, and where a free one starts."""

    model: Model
    start: Hypothesis

    @property
    def run(self) -> MeasuredRun:
        """The run."""
        return self.model.measured.runs[0]

    def nudged(self, more: Mapping[str, float]) -> Ahead:
        """The same free run from a start that has so much more angle (rad) and rate (rad/s)."""
        ((term, values),) = self.start
        return replace(self, start=[(term, {name: v + more.get(name, 0.0) for name, v in values.items()})])

    @property
    def position(self) -> np.ndarray:
        """Where the motor is (N,) rad or m, of several the first one; in a free run the driven body as it is let go."""
        if self.run.drive == "free":
            return np.full(self.run.time.size, self.model.starts(self.run, self.start)[0][0])
        return np.atleast_2d(self.model.motor(self.run, self.model.mechanism).at(self.run.time).theta)[0]

    @property
    def speed(self) -> float:
        """How fast (rad/s, a size) its driven body goes in the mean; 0 where it is let go."""
        return 0.0 if self.run.drive == "free" else float(np.mean(rates_of(self.run.time, self.position)))

    @property
    def fastest(self) -> float:
        """The same at its fastest."""
        rates = np.zeros(1) if self.run.drive == "free" else rates_of(self.run.time, self.position)
        return float(np.quantile(rates, 1 - AT_REST))


def runs_ahead(measured: Measured, mechanism: Mechanism) -> list[Ahead]:
    """The runs of a measurement, each by itself.  Raises MeasuredError where the nominal mechanism cannot make one."""
    courses, measured = prepare.followed(prepare.thinned(measured))
    found = []
    for run in measured.runs:
        alone = replace(measured, runs=(run,))
        rig, model = prepare.nominal(alone, mechanism, courses)
        starts = prepare.starts(alone)
        start = [(t, t.effect.values(rig, t.where, x)) for t, x in starts.items()]
        if any(np.isfinite(channel.values).any() for channel in run.channels.values()):
            alone = prepare.unturned(alone, model, starts)
        found.append(Ahead(Model(alone, rig, mechanism, courses), start))
    return found


def rates_of(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """The sizes of the rates (N - 1,) of what goes through places (N,) at times (N,) s; 0 of a single one."""
    return np.asarray(np.abs(np.diff(position)) / np.diff(time)) if time.size > 1 else np.zeros(1)


@dataclass(frozen=True)
class Answer:
    """What a set says of the R sensors of a run (R, N), what a standard deviation along each axis of its values changes
    (m, R, N), and of a free run what else does.
    """

    readings: np.ndarray
    values: np.ndarray
    swing: Swing | None = None

    def foretold(self, torque: Stray | None, start: np.ndarray) -> tuple[np.ndarray, ...]:
        """The sensors (R, N) as the set says, what a torque that nobody named makes of that in the mean, and the
        variances by what the values and a start of these deviations (2,) leave open and by that torque.
        """
        known, nothing = np.sum(self.values**2, axis=0), np.zeros_like(self.readings)
        if self.swing is None:
            return self.readings, nothing, known, nothing
        begun = np.einsum("i,irn->rn", start**2, self.swing.start**2)
        if torque is None:
            return self.readings, nothing, known + begun, nothing
        moved, both = torque.foretold(self.swing)
        known = np.minimum(known, both)
        return self.readings, moved, known + begun, both - known


def answered(ahead: Ahead, candidate: Candidate) -> Answer | None:
    """What a set says of a run; None where it cannot be."""
    asked = [candidate.values, *(candidate.moved(axis, way) for axis in candidate.axes for way in (1, -1))]
    middle, *moved = (found[0] if found else None for found in ahead.model([[*ahead.start, *h] for h in asked]))
    if middle is None:
        return None
    readings = np.array([middle[s] for s in ahead.run.channels])
    values = [_half(ahead, middle, up, down) for up, down in zip(moved[::2], moved[1::2], strict=True)]
    values_of = np.array(values).reshape(-1, *readings.shape)
    return Answer(
        readings, values_of, _swing(ahead, candidate, middle, values_of) if ahead.run.drive == "free" else None
    )


def _half(ahead: Ahead, middle: Readings, up: Readings | None, down: Readings | None) -> np.ndarray:
    """Half of what lies between readings (R, N) one way and the other; of one way where the other is none."""
    channels, of = ahead.run.channels.items(), 2.0 if up and down else 1.0
    return np.array([c.signal.apart((up or middle)[s], (down or middle)[s]) / of for s, c in channels])


def _swing(ahead: Ahead, candidate: Candidate, middle: Readings, values: np.ndarray) -> Swing | None:
    """What changes a free run; None where it has no motion nearby, or goes in pieces."""
    if len(ahead.model.starts(ahead.run, ahead.start)) > 1:
        return None
    nudged = [ahead.nudged({name: way * h}) for name, h in NUDGES.items() for way in (1, -1)]
    asked = [[*each.start, *candidate.values] for each in (ahead, *nudged)]
    moved = ahead.model.moving(ahead.run, asked)
    found = [each[0] if each else None for each in ahead.model(asked[1:])]
    if any(each is None for each in (*moved, *found)):
        return None
    motion, inertia = zip(*(each for each in moved if each is not None), strict=True)
    steps = np.array(list(NUDGES.values()))
    turned = np.array([motion[1][:2] - motion[2][:2], motion[3][:2] - motion[4][:2]]) / (2 * steps[:, None, None])
    start = np.array([_half(ahead, middle, *found[k : k + 2]) for k in (0, 2)]) / steps[:, None, None]
    return Swing(ahead.run.time, motion[0][:2], inertia[0], turned.swapaxes(0, 1), start, values)


def fitted(result: Diagnosis, ahead: Ahead, candidate: Candidate) -> Fitted | None:
    """A fitted free run as a set makes it from the start that fits best; None where it leaves more than the fit did, as
    with loads of its own.
    """
    run = ahead.run
    noise = np.array([channel.noise for channel in run.channels.values()])
    for _ in range(REFITS):
        answer = answered(ahead, replace(candidate, axes=()))
        if answer is None or answer.swing is None:
            return None
        wanted = (_left(ahead, answer) / noise[:, None]).ravel()
        known, columns = np.isfinite(wanted), (answer.swing.start / noise[:, None]).reshape(2, -1).T
        more = np.linalg.lstsq(columns[known], wanted[known], rcond=None)[0]
        ahead = ahead.nudged(dict(zip(NUDGES, more.tolist(), strict=True)))
    answer = answered(ahead, candidate)
    if answer is None or answer.swing is None:
        return None
    left, document = _left(ahead, answer), next(each for each in result.fitted if each.name == run.name)
    before = np.array([result.residual(document, s, "after") for s in run.channels])
    if np.nanmean((left / noise[:, None]) ** 2) > AS_FITTED**2 * np.nanmean((before / noise[:, None]) ** 2):
        return None
    return Fitted(answer.swing, left, noise.tolist(), tuple(run.channels))


def _left(ahead: Ahead, answer: Answer) -> np.ndarray:
    """What was read less what a set says (R, N)."""
    channels = ahead.run.channels.values()
    return np.array([c.signal.apart(c.values, told) for c, told in zip(channels, answer.readings, strict=True)])


def again(mechanism: Mechanism, run: DiagnosedRun) -> MeasuredRun:
    """A free run of a diagnosis as it was measured, which starts from about where it did."""
    known, encoder = named(mechanism.bodies, mechanism.joints, mechanism.drives), mechanism.encoders[0]
    channels = {s: Channel(known[s], each.measured, each.noise, True, known[s].unit) for s, each in run.signals.items()}
    rate = float(np.gradient(run.crank_angle[:3], run.time[:3], edge_order=2)[0])
    start = {encoder.name: float(run.crank_angle[0]), f"{encoder.place}_angular_velocity": rate}
    return MeasuredRun(run.name, run.time, channels, "free", None, None, start, None, False, "")
