"""Runs as a diagnosis foretells them: each sensor with a 95 % band (:mod:`compare.diagnose.mixture`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.signals import Signal
from compare.diagnose.ahead import AT_REST, Ahead, Candidate, Readings, again, answered, fitted, rates_of, runs_ahead
from compare.diagnose.data.recording import Measured
from compare.diagnose.effects.effect import Effect
from compare.diagnose.mixture import TAIL, Discrepancy, axes, below_it, growth, quantile
from compare.diagnose.predict import Term
from compare.diagnose.stray import Stray, stray
from compare.judge.metrics import rms
from compare.results.band import Band
from compare.results.diagnosis import Diagnosis, JointCovariance

ENDS = 2.0  # times what noise makes of it, that the end of a smooth course is off: 1.4 to 2.1 in swings of known rate
UNIFORM = math.sqrt(3)  # half a range over its standard deviation (GUM, 4.3.7)


@dataclass(frozen=True)
class Explained:
    """A diagnosis as a model of runs that were not fitted."""

    result: Diagnosis
    mechanism: Mechanism
    vocabulary: Mapping[str, Effect] = field(repr=False)

    @cached_property
    def sets(self) -> list[tuple[float, Mapping[str, float], JointCovariance | None]]:
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
        return max(0.0, 1.0 - sum(share for share, *_ in self.sets)) if self.result.sets else 0.0

    def candidates(self, run: str, sensors: bool) -> list[Candidate]:
        """The sets of effects for a run, with the faults of its ``sensors`` or without; their probabilities add up."""
        total = sum(share for share, *_ in self.sets)
        return [self._candidate(share / total, values, told, run, sensors) for share, values, told in self.sets]

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
        same = Measured(r.mechanism, tuple(again(r.mechanism, run) for run in runs), {}, (), "diagnosis")
        return runs_ahead(same, self.mechanism) if runs else []

    @cached_property
    def strays(self) -> Sequence[Stray | None]:
        """By set of effects the torque that fitted free runs show beside it; None where there are none that it makes
        again.
        """
        found, length = list[Stray | None](), None
        for k in range(len(self.sets)):
            each = [fitted(self.result, ahead, self.candidates(ahead.run.name, True)[k]) for ahead in self.swings]
            known = [one for one in each if one is not None]
            torque = stray(known, length) if known else None
            found.append(torque)
            length = length if torque is None else torque.length
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
        return [rates_of(run.time, run.crank_angle) for run in driven]

    def start(self, ahead: Ahead) -> np.ndarray:
        """How well (2,) angle (rad) and rate (rad/s) are known that a free run starts from: as a reading of them, or as
        the end of a smooth course through readings of the other.
        """
        encoder, run = ahead.model.rig.mechanism.encoders[0], ahead.run

        def known(signal: str) -> float:
            if signal not in run.channels:
                return ENDS * run.unsure.get(signal, 0.0)
            return math.hypot(run.channels[signal].noise, self._size(signal))

        return np.array([known(encoder.name), known(f"{encoder.place}_angular_velocity")])

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


def foretold(
    explained: Explained, ahead: Ahead, sensors: bool, simulated: Sequence[Readings] = ()
) -> dict[str, Band] | None:
    """The sensors of a run with their bands, but for encoders that it follows; None where the named set cannot make it.

    ``simulated`` is what engines make of it with the named set, the one that diagnosed first.
    """
    run, every = ahead.run, explained.candidates(ahead.run.name, sensors)
    answers = [answered(ahead, candidate) for candidate in every]
    if answers[0] is None:
        return None
    strays = explained.strays if run.drive == "free" else [None] * len(every)
    likely = [(c.probability, a, t) for c, a, t in zip(every, answers, strays, strict=True) if a is not None]
    start = explained.start(ahead)
    weights = np.array([share for share, *_ in likely]) / sum(share for share, *_ in likely)
    told = [np.array(part) for part in zip(*(a.foretold(t, start) for _, a, t in likely), strict=True)]
    swing, torque = answers[0].swing, strays[0]
    swelled = 1.0 if swing is None or torque is None else torque.growth(swing)
    followed = ahead.model.rig.encoders if run.drive == "measured" else ()  # they say the motion, and are not foretold
    return {
        s: _band(explained, ahead, s, weights, [of[:, k] for of in told], swelled, [r[s] for r in simulated if s in r])
        for k, s in enumerate(run.channels)
        if s not in followed
    }


def _band(
    explained: Explained,
    ahead: Ahead,
    name: str,
    weights: np.ndarray,
    told: Sequence[np.ndarray],
    swelled: float,
    simulated: Sequence[np.ndarray],
) -> Band:
    channel = ahead.run.channels[name]
    signal: Signal = channel.signal
    means, strayed, variances, torques = told
    means = means[0] + np.array([signal.apart(m, means[0]) for m in means])  # in one turn
    engines = np.zeros(means.shape[1])
    if simulated:
        off = np.array([np.nan_to_num(signal.apart(each, means[0])) for each in simulated])
        means = means + off[0]
        engines = np.max(np.abs(np.vstack([off - off[0], off[:1]])), axis=0) / UNIFORM
    means = means + strayed
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
