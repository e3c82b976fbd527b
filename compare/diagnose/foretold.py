"""Runs as a diagnosis foretells them: each sensor with a 95 % band (:mod:`compare.diagnose.mixture`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal, named
from compare.diagnose import prepare
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.diagnose.effects.effect import Effect
from compare.diagnose.mixture import TAIL, Discrepancy, axes, below_it, growth, quantile
from compare.diagnose.predict import Hypothesis, Model, Term
from compare.diagnose.stray import Fitted, Stray, Swing, stray
from compare.judge.metrics import rms
from compare.results.band import Band
from compare.results.diagnosis import DiagnosedRun, Diagnosis, JointCovariance

Readings = Mapping[str, np.ndarray]
UNIFORM = math.sqrt(3)  # half a range over its standard deviation (GUM, 4.3.7)
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
class Explained:
    """A diagnosis as a model of runs that were not fitted."""

    result: Diagnosis
    mechanism: Mechanism
    vocabulary: Mapping[str, Effect] = field(repr=False)

    @cached_property
    def _sets(self) -> list[tuple[float, Mapping[str, float], JointCovariance | None]]:
        """Probability, values and covariance of each set that has values, the named one first."""
        r = self.result
        own = {f"{e.key}.{name}": p.value for e in r.effects for name, p in e.parameters.items()}
        named = {e.key for e in r.effects}
        others = [s for s in r.sets if s.values is not None and set(s.effects) != named]
        share = next((s.probability for s in r.sets if set(s.effects) == named), None)
        if share is None:  # it lost an effect of the likeliest set, and stands for it
            share = max((s.probability for s in r.sets), default=1.0)
            others = [s for s in others if s.probability < share]
        return [(share, own, r.covariance), *((s.probability, s.values or {}, s.covariance) for s in others)]

    @property
    def left_aside(self) -> float:
        """Probability of the sets that have no values."""
        return max(0.0, 1.0 - sum(share for share, *_ in self._sets)) if self.result.sets else 0.0

    def candidates(self, run: str, sensors: bool) -> list[Candidate]:
        """The sets of effects for a run, with the faults of its ``sensors`` or without; their probabilities add up."""
        total = sum(share for share, *_ in self._sets)
        return [self._candidate(share / total, values, told, run, sensors) for share, values, told in self._sets]

    def _candidate(
        self, share: float, values: Mapping[str, float], told: JointCovariance | None, run: str, sensors: bool
    ) -> Candidate:
        names, v, c = for_run(values, told, run)
        own = [_parted(name) for name in names]

        def by_effect(numbers: np.ndarray) -> dict[str, dict[str, float]]:
            found: dict[str, dict[str, float]] = {}
            for (label, parameter), number in zip(own, numbers.tolist(), strict=True):
                found.setdefault(label, {})[parameter] = number
            return found

        terms = [
            Term(self.vocabulary[effect], where)
            for effect, _, where in (label.partition("@") for label in dict.fromkeys(label for label, _ in own))
            if effect in self.vocabulary and (sensors or not self.vocabulary[effect].sensor)
        ]
        at = by_effect(v)
        return Candidate(share, [(t, at[t.label]) for t in terms], [by_effect(axis) for axis in axes(v, c)])

    @cached_property
    def left(self) -> Mapping[str, Discrepancy]:
        """What stays unexplained of each sensor in the fitted runs."""
        r = self.result
        return {
            s: Discrepancy.of([r.residual(run, s, "after") for run in r.fitted if s in run.signals])
            for s in dict.fromkeys(s for run in r.fitted for s in run.signals)
        }

    @cached_property
    def peaks(self) -> Mapping[str, float]:
        """The largest value (SI) of each sensor in the fitted runs."""
        found: dict[str, float] = {}
        for run in self.result.fitted:
            for s, channel in run.signals.items():
                found[s] = max(found.get(s, 0.0), float(np.nanmax(np.abs(channel.measured), initial=0.0)))
        return found

    @cached_property
    def swings(self) -> Sequence[Ahead]:
        """The fitted free runs, each by itself; they start from about where they did."""
        r, runs = self.result, [run for run in self.result.fitted if run.drive == "free"]
        again = tuple(_again(r.mechanism, run) for run in runs)
        return runs_ahead(Measured(r.mechanism, again, {}, (), "diagnosis"), self.mechanism) if again else []

    @cached_property
    def strays(self) -> Sequence[Stray | None]:
        """By set of effects the torque that fitted free runs show beside it; None where there are none that it makes
        again.
        """
        found = []
        for k in range(len(self._sets)):
            each = [_fitted(self, ahead, self.candidates(ahead.run.name, True)[k]) for ahead in self.swings]
            known = [one for one in each if one is not None]
            found.append(stray(known) if known else None)
        return found

    @cached_property
    def speeds(self) -> Sequence[float]:
        """How fast (rad/s, a size) the driven body goes in each fitted run that a motor drives, in the mean."""
        return [float(np.mean(rates)) for rates in self._rates]

    @cached_property
    def paces(self) -> Sequence[float]:
        """The slowest and the fastest (rad/s, sizes) that these runs go: one that follows its encoder goes at many."""
        return [float(np.quantile(rates, share)) for rates in self._rates for share in (AT_REST, 1 - AT_REST)]

    @cached_property
    def _rates(self) -> Sequence[np.ndarray]:
        driven = [run for run in self.result.fitted if run.drive != "free"]
        return [_rates(run.time, run.crank_angle) for run in driven]

    def start(self, ahead: Ahead) -> np.ndarray:
        """How well (2,) angle (rad) and rate (rad/s) are known that a free run starts from: as a reading of them."""
        encoder, channels = ahead.model.rig.mechanism.encoders[0], ahead.run.channels
        names = (encoder.name, f"{encoder.place}_angular_velocity")
        return np.array([math.hypot(channels[s].noise, self._size(s)) if s in channels else 0.0 for s in names])

    def _size(self, signal: str) -> float:
        return self.left[signal].size if signal in self.left else 0.0

    def discrepancy(self, signal: str, peak: float, ahead: Ahead) -> tuple[float, float]:
        """What stays unexplained (SI, 1 sigma) of a signal with this peak in a run at a speed, and by how much it has
        grown.  Of a signal that nobody measured it is the largest share of their peaks that others have.
        """
        wraps = signal in self.result.signals and self.result.signals[signal].wraps
        known, peaks = self.left.get(signal), 0.0 if wraps else self.peaks.get(signal, 0.0)
        factor = max(growth(pace, self.paces, peak, peaks) for pace in (ahead.speed, ahead.fastest))
        if known is None:
            shares = [d.size / self.peaks[s] for s, d in self.left.items() if self.peaks[s]]
            return factor * max(shares, default=0.0) * peak, factor
        return factor * known.size, factor


def for_run(
    values: Mapping[str, float], told: JointCovariance | None, run: str
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names, values (n,) and covariance (n, n; NaN: open) for a run that was not fitted.

    Values that differ from run to run (``offset@run``) are one of their kind there: their mean, with their own scatter.
    """
    if not values:
        return [], np.zeros(0), np.zeros((0, 0))
    names = list(values)
    v, c = np.array([values[name] for name in names]), np.full((len(names), len(names)), math.nan)
    if told is not None and set(names) <= set(told.names):
        at = [told.names.index(name) for name in names]
        c = np.array([[math.nan if (x := told.values[i][j]) is None else x for j in at] for i in at]).reshape(c.shape)
    kinds: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        label, parameter = _parted(name)
        kinds.setdefault(f"{label}.{parameter.partition('@')[0]}" if "@" in parameter else name, []).append(i)
    mean = np.array([[i in own for i in range(len(names))] for own in kinds.values()], float)
    mean /= mean.sum(axis=1, keepdims=True)
    together = mean @ np.where(np.isfinite(c), c, 0.0) @ mean.T
    lost = ~np.isfinite(np.diag(c))
    reduced = []
    for k, own in enumerate(kinds.values()):
        if lost[own].any():
            together[k], together[:, k] = math.nan, math.nan
        if "@" in _parted(names[own[0]])[1]:
            scatter = float(np.var(v[own], ddof=1)) * (1 + 1 / len(own)) if len(own) > 1 else float(v[own[0]] ** 2)
            together[k, k] = scatter
        reduced.append(float(np.mean(v[own])))
    return list(kinds), np.array(reduced), together


def _parted(name: str) -> tuple[str, str]:
    """``effect@where`` and the parameter, which may have a run behind it, of ``effect@where.parameter@run``."""
    effect, _, rest = name.partition("@")
    place, at, run = rest.partition("@")
    where, _, parameter = place.rpartition(".")
    return f"{effect}@{where}", f"{parameter}{at}{run}"


def _rates(time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """The sizes of the rates (N - 1,) of what goes through places (N,) at times (N,) s; 0 of a single one."""
    return np.asarray(np.abs(np.diff(position)) / np.diff(time)) if time.size > 1 else np.zeros(1)


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
        return 0.0 if self.run.drive == "free" else float(np.mean(_rates(self.run.time, self.position)))

    @property
    def fastest(self) -> float:
        """The same at its fastest."""
        rates = np.zeros(1) if self.run.drive == "free" else _rates(self.run.time, self.position)
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


def foretold(
    explained: Explained, ahead: Ahead, sensors: bool, simulated: Sequence[Readings] = ()
) -> dict[str, Band] | None:
    """The sensors of a run with their bands, but for encoders that it follows; None where the named set cannot make it.

    ``simulated`` is what engines make of it with the named set, the one that diagnosed first.
    """
    run, every = ahead.run, explained.candidates(ahead.run.name, sensors)
    answers = [_answer(ahead, candidate) for candidate in every]
    if answers[0] is None:
        return None
    strays = explained.strays if run.drive == "free" else [None] * len(every)
    start = explained.start(ahead)
    told = [
        (c.probability, answer.readings, *answer.variances(torque, start))
        for c, answer, torque in zip(every, answers, strays, strict=True)
        if answer is not None
    ]
    weights = np.array([share for share, *_ in told]) / sum(share for share, *_ in told)
    first, torque = answers[0].swing, strays[0]
    swelled = 1.0 if first is None or torque is None else torque.growth(first.rate)
    followed = ahead.model.rig.encoders if run.drive == "measured" else ()  # they say the motion, and are not foretold
    return {
        s: _band(
            explained,
            ahead,
            s,
            weights,
            [tuple(part[k] for part in rest) for _, *rest in told],
            swelled,
            [r[s] for r in simulated if s in r],
        )
        for k, s in enumerate(run.channels)
        if s not in followed
    }


@dataclass(frozen=True)
class Answer:
    """What a set says of the R sensors of a run (R, N), what a standard deviation along each axis of its values changes
    (m, R, N), and of a free run what else does.
    """

    readings: np.ndarray
    values: np.ndarray
    swing: Swing | None = None

    def variances(self, torque: Stray | None, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of the sensors (R, N) by what the values and a start of these deviations (2,) leave open, and by a torque
        that nobody named.
        """
        spread = np.eye(len(self.values)) if torque is None else torque.spread
        known = np.einsum("irn,ij,jrn->rn", self.values, spread, self.values)
        if self.swing is None:
            return known, np.zeros_like(known)
        known = known + np.einsum("i,irn->rn", start**2, self.swing.start**2)
        return known, np.zeros_like(known) if torque is None else torque.variance(self.swing)


def _answer(ahead: Ahead, candidate: Candidate) -> Answer | None:
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
    return Swing(ahead.run.time, turned.swapaxes(0, 1), inertia[0], float(np.abs(motion[0][1]).max()), start, values)


def _again(mechanism: Mechanism, run: DiagnosedRun) -> MeasuredRun:
    """A free run of a diagnosis as it was measured, which starts from about where it did."""
    known, encoder = named(mechanism.bodies, mechanism.joints, mechanism.drives), mechanism.encoders[0]
    channels = {s: Channel(known[s], each.measured, each.noise, True, known[s].unit) for s, each in run.signals.items()}
    rate = float(np.gradient(run.crank_angle[:3], run.time[:3], edge_order=2)[0])
    start = {encoder.name: float(run.crank_angle[0]), f"{encoder.place}_angular_velocity": rate}
    return MeasuredRun(run.name, run.time, channels, "free", None, None, start, None, False, "")


def _fitted(explained: Explained, ahead: Ahead, candidate: Candidate) -> Fitted | None:
    """A fitted free run as a set makes it from the start that fits best; None where it leaves more than the fit did, as
    with loads of its own.
    """
    run, r = ahead.run, explained.result
    noise = np.array([channel.noise for channel in run.channels.values()])
    for _ in range(REFITS):
        answer = _answer(ahead, replace(candidate, axes=()))
        if answer is None or answer.swing is None:
            return None
        wanted = (_left(ahead, answer) / noise[:, None]).ravel()
        known, columns = np.isfinite(wanted), (answer.swing.start / noise[:, None]).reshape(2, -1).T
        more = np.linalg.lstsq(columns[known], wanted[known], rcond=None)[0]
        ahead = ahead.nudged(dict(zip(NUDGES, more.tolist(), strict=True)))
    answer = _answer(ahead, candidate)
    if answer is None or answer.swing is None:
        return None
    left, document = _left(ahead, answer), next(each for each in r.fitted if each.name == run.name)
    before = np.array([r.residual(document, s, "after") for s in run.channels])
    if np.nanmean((left / noise[:, None]) ** 2) > AS_FITTED**2 * np.nanmean((before / noise[:, None]) ** 2):
        return None
    return Fitted(answer.swing, left, noise.tolist(), tuple(run.channels))


def _left(ahead: Ahead, answer: Answer) -> np.ndarray:
    """What was read less what a set says (R, N)."""
    channels = ahead.run.channels.values()
    return np.array([c.signal.apart(c.values, told) for c, told in zip(channels, answer.readings, strict=True)])


def _band(
    explained: Explained,
    ahead: Ahead,
    name: str,
    weights: np.ndarray,
    told: Sequence[tuple[np.ndarray, ...]],
    swelled: float,
    simulated: Sequence[np.ndarray],
) -> Band:
    channel = ahead.run.channels[name]
    signal: Signal = channel.signal
    means, variances, torques = (np.array(part) for part in zip(*told, strict=True))
    means = means[0] + np.array([signal.apart(m, means[0]) for m in means])  # in one turn
    engines = np.zeros(means.shape[1])
    if simulated:
        off = np.array([np.nan_to_num(signal.apart(each, means[0])) for each in simulated])
        means = means + off[0]
        engines = np.max(np.abs(np.vstack([off - off[0], off[:1]])), axis=0) / UNIFORM
    middle = weights @ means
    size, factor = explained.discrepancy(name, float(np.nanmax(np.abs(middle))), ahead)
    sds = np.sqrt(variances + torques + engines**2 + size**2)
    low, high = (quantile(share, weights, means, sds) for share in (TAIL, 1 - TAIL))
    measured = means[0] + signal.apart(channel.values, means[0])
    place = below_it(measured, weights, means, np.hypot(sds, channel.noise))
    known = np.isfinite(measured) & np.isfinite(middle)
    return Band(
        unit=signal.unit,
        value=middle,
        low=low,
        high=high,
        sd={
            "parameters": rms(np.sqrt(weights @ variances)),
            "sets": rms(np.sqrt(weights @ (means - middle) ** 2)),
            "engines": rms(engines),
            "discrepancy": rms(np.sqrt(weights @ torques + size**2)),
        },
        growth=max(factor, swelled),
        covered=float(np.mean((place > TAIL)[known] & (place < 1 - TAIL)[known])) if known.any() else None,
    )
