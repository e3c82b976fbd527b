"""How well values are known beside a torque that nobody named, which the residuals of swings show.

The curvature of a fit counts each reading that it leaves as noise of its own.  What a small torque leaves of a swing is
alike over many readings, and most of it the values have taken on before (:mod:`compare.diagnose.stray`).  Along the
axes A of a fit's covariance c, each a standard deviation long, the values have a mean m and a covariance C beside the
torque.  The covariance becomes c + A' (C + m m' - 1)+ A, of the positive part: never less.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from compare.diagnose.data.recording import MeasuredError
from compare.diagnose.effects.effect import Rig
from compare.diagnose.explanation import Explanation, Named
from compare.diagnose.fit import Bounds
from compare.diagnose.foretold import Explained, for_run
from compare.diagnose.mixture import axes
from compare.diagnose.stray import LAWS, Stray
from compare.quantities import plainly
from compare.report.words.statement import WIDER
from compare.results.diagnosis import Diagnosis, Effect, JointCovariance


def beside_torque(result: Diagnosis, explained: Explained, e: Explanation, rig: Rig, bounds: Bounds) -> Diagnosis:
    """A diagnosis of swings alone that are not explained in full, with its values known as well as they are beside what
    may be left of torque.
    """
    told = [c for c in (result.covariance, *(s.covariance for s in result.sets)) if c is not None]
    of_a_run = any("@" in name.rpartition(".")[2] for c in told for name in c.names)
    if result.covariance is None or of_a_run or any(run.drive != "free" for run in result.fitted):
        return result
    try:
        strays = explained.strays
    except MeasuredError:  # a swing that the nominal mechanism does not make
        return result
    known = {
        frozenset(label for label, _, _ in (name.rpartition(".") for name in values)): widened(values, c, torque)
        for (_, values, c), torque in zip(explained.sets, strays, strict=True)
        if c is not None
    }
    named = known.get(frozenset(effect.key for effect in result.effects), result.covariance)
    effects = [
        _effect(effect, n, result.covariance, named, rig, bounds)
        for effect, n in zip(result.effects, e.named, strict=True)
    ]
    sets = [s.model_copy(update={"covariance": known.get(frozenset(s.effects), s.covariance)}) for s in result.sets]
    wider = [_deviation(named, name) / _deviation(result.covariance, name) for name in named.names]
    times = plainly(max((each for each in wider if math.isfinite(each)), default=1.0), 2)
    notes = (*result.notes, WIDER.format(times)) if times != "1" else result.notes
    update = {"effects": tuple(effects), "covariance": named, "sets": tuple(sets), "notes": notes}
    return result.model_copy(update=update)


def widened(values: Mapping[str, float], told: JointCovariance, torque: Stray | None) -> JointCovariance:
    """The covariance of values beside a torque."""
    names, v, c = for_run(values, told, "")
    along = axes(v, c)
    if torque is None or not len(along):
        return told
    mean, covariance = torque.mean[LAWS:], torque.covariance[LAWS:, LAWS:]
    sizes, vectors = np.linalg.eigh(covariance + np.outer(mean, mean) - np.eye(mean.size))
    more = along.T @ vectors * np.sqrt(np.maximum(sizes, 0.0))
    wider = c + more @ more.T
    rows = tuple(tuple(float(x) if math.isfinite(x) else None for x in row) for row in wider)
    return JointCovariance(names=tuple(names), values=rows)


def _effect(
    effect: Effect, n: Named, before: JointCovariance, after: JointCovariance, rig: Rig, bounds: Bounds
) -> Effect:
    """An effect whose intervals are wider as its deviations are, within what it can be."""
    ends = [n.term.effect.values(rig, n.term.where, end, n.term.variant) for end in bounds(n.term)]
    found = {}
    for name, p in effect.parameters.items():
        label = f"{effect.key}.{name}"
        wider = _deviation(after, label) / _deviation(before, label)
        least, most = sorted(end[name] for end in ends)
        low = None if p.low is None else max(p.value - wider * (p.value - p.low), min(least, p.low))
        high = None if p.high is None else min(p.value + wider * (p.high - p.value), max(most, p.high))
        found[name] = p.model_copy(update={"low": low, "high": high} if math.isfinite(wider) else {})
    return effect.model_copy(update={"parameters": found})


def _deviation(told: JointCovariance, name: str) -> float:
    """Standard deviation of a value; NaN where the data leave it open."""
    k = told.names.index(name)
    variance = told.values[k][k]
    return math.sqrt(variance) if variance else math.nan
