"""What a measured channel is worth: its noise, and the faults of sensors and recordings.

Noise is what is left of a channel when its smooth part is taken out by divided differences, which are exact for any
spacing of the samples.  A fault is found in one channel by itself; two that only a model can see, swapped columns and a
wrong unit, are :func:`suspicious_swaps` and :func:`suspicious_units`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations

import numpy as np

from analytic.mechanism.signals import starts_again, turned_near
from analytic.mechanism.units import OFFERED, QuantityKind, dimension, factor
from compare.diagnose.data.recording import Fault, MeasuredRun
from compare.recorded.quantum import quantum, stretches

ORDERS = (3, 4, 6, 8, 10)  # of differences, tried for the noise
FLOOR = 1e-7  # of a channel's range: what a noise-free signal is taken to be good for
SPIKE = 8.0  # sigmas of an outlier
JUDGED = 12  # samples, at least, among which a spike is told
GAP = 5.0  # median intervals
TELLING = 5.0  # how much better another column's prediction must fit, and by how many sigmas the own one must fail
REVERSED = "of the other sign"
LIKE_UNIT = 0.03  # relative, by which a channel's slope on its prediction may miss a conversion of units


def noise(time: np.ndarray, values: np.ndarray) -> float:
    """Standard deviation of the white noise on a smooth signal (N,) at times (N,) s, increasing; NaN is absent.

    The lowest order of differences that no higher one undercuts by more than chance; never less than the rounding of
    the values allows, nor than FLOOR of their range (or size, for a constant).
    """
    here = np.flatnonzero(np.isfinite(values))
    if here.size == 0:
        return FLOOR
    floor = max(quantum(values) / math.sqrt(12), FLOOR * (np.ptp(values[here]) or np.max(np.abs(values[here])) or 1.0))
    here = here[stretches(here.size)]
    orders = [p for p in ORDERS if here.size > 2 * p + 1] or [1]
    found = [_scale(differences(time[here], values[here], p)) for p in orders]
    for k, estimate in enumerate(found):
        if all(
            estimate <= other * (1 + chance(q, here.size))
            for q, other in zip(orders[k + 1 :], found[k + 1 :], strict=True)
        ):
            return float(max(estimate, floor))
    return float(max(found[-1], floor))


def chance(order: int, samples: int) -> float:
    """Relative standard deviation of a noise estimate by differences of this order, which overlap."""
    correlated = math.comb(4 * order, 2 * order) / math.comb(2 * order, order) ** 2
    return math.sqrt(correlated / (2 * samples))


def differences(time: np.ndarray, values: np.ndarray, order: int) -> np.ndarray:
    """(N - order,) divided differences of values (N,) at times (N,), scaled so that white noise keeps its size
    in them.
    """
    n = values.size - order
    step = (time[order:] - time[:n]) / order
    total, square = np.zeros(n), np.zeros(n)
    for i in range(order + 1):
        weight = np.ones(n)
        for j in range(order + 1):
            if j != i:
                weight *= step / (time[i : i + n] - time[j : j + n])
        total += weight * values[i : i + n]
        square += weight**2
    return total / np.sqrt(square)


def outliers(time: np.ndarray, values: np.ndarray, sigma: float) -> np.ndarray:
    """Indices of isolated spikes (SPIKE sigmas): without such a sample its neighbours are smooth.

    A step, an edge or a steep end stays rough whichever sample is left out; the two samples at either end cannot be
    judged.
    """
    here = np.flatnonzero(np.isfinite(values))
    t, x = time[here], values[here]
    if here.size < JUDGED:
        return here[:0]
    d = np.abs(differences(t, x, 4))
    limit = SPIKE * np.maximum(sigma, _local_median(d))
    peak = (d > limit) & (d >= np.concatenate([[0], d[:-1]])) & (d >= np.concatenate([d[1:], [0]]))
    suspects = np.flatnonzero(peak)
    suspects = suspects[np.argsort(-d[suspects])][: min(max(10, x.size // 50), 5000)]
    kept = np.ones(x.size, bool)
    for window in suspects.tolist():
        roughness = {}
        for k in range(max(2, window), min(window + 5, x.size - 2)):
            near = np.arange(max(0, k - 4), min(x.size, k + 5))
            near = near[kept[near] & (near != k)]
            if kept[k] and near.size > 5:
                roughness[k] = float(np.max(np.abs(differences(t[near], x[near], 4))))
        best = min(roughness, key=lambda k: roughness[k], default=0)
        if roughness and roughness[best] < max(SPIKE / 2 * sigma, d[window] / SPIKE):
            kept[best] = False
    return here[~kept]


def _local_median(d: np.ndarray, block: int = 16) -> np.ndarray:
    """(N,) the largest median of the whole block that a value is in (the last for a rest) and of the blocks
    beside it.
    """
    count = max(1, d.size // block)
    level = np.pad(np.median(d[: count * block].reshape(count, -1), axis=1), 1, mode="edge")
    return np.max([level[:-2], level[1:-1], level[2:]], axis=0)[np.minimum(np.arange(d.size) // block, count - 1)]


def unwrapped(angle: np.ndarray, command: np.ndarray | None = None) -> tuple[np.ndarray, int]:
    """An angle (N,) rad continued where it jumps back by a turn, and the number of jumps; 0 if it was not wrapped.

    ``command`` (N,) rad, if there is one, says which turn a sample belongs to even after a gap.
    """
    if not starts_again(angle):
        return angle, 0
    here = np.flatnonzero(np.isfinite(angle))
    step = np.diff(angle[here])
    jump = np.abs(step) > math.pi
    over = np.abs(np.abs(step) - 2 * math.pi)
    around = np.pad(np.where(jump, over, np.abs(step)), 1, mode="edge")
    usual = np.maximum(max(0.1, 10 * float(np.median(np.abs(step)))), 3 * np.maximum(around[:-2], around[2:]))
    turn = jump & (over < usual)  # another jump is a spike
    out = angle.copy()
    if command is None:
        out[here[1:]] -= 2 * math.pi * np.cumsum(np.where(turn, np.sign(step), 0.0))
    elif np.any(turn):
        out = turned_near(angle, command)
    return out, int(np.sum(turn))


def gaps(time: np.ndarray) -> tuple[int, int, float]:
    """Number of gaps in time (N,) s, samples that are missing in them, and the longest (s)."""
    step = np.diff(time)
    usual = float(np.median(step))
    long = step[step > GAP * usual]
    return long.size, int(np.sum(np.round(long / usual) - 1)), float(np.max(long, initial=0.0))


def suspicious_swaps(run: MeasuredRun, predicted: Mapping[str, np.ndarray]) -> list[Fault]:
    """Pairs of channels each of which fits the other's prediction (N,), SI, far better than its own."""
    faults = []
    for a, b in combinations([s for s in run.channels if s in predicted], 2):
        if dimension(run.channels[a].signal) != dimension(run.channels[b].signal):
            continue
        own = {s: _misfit(run, s, predicted[s]) for s in (a, b)}
        other = {s: _misfit(run, s, predicted[t]) for s, t in ((a, b), (b, a))}
        if all(own[s] > TELLING * max(other[s], run.channels[s].noise) for s in (a, b)):
            samples = int(sum(np.sum(np.isfinite(run.channels[s].values)) for s in (a, b)))
            text = (
                f"{a} and {b} of run {run.name!r} each fit the other's prediction and not their own: the columns look"
                f" swapped in {run.file}"
            )
            faults.append(Fault(run.name, a, "swapped", samples, text))
    return faults


def suspicious_units(run: MeasuredRun, predicted: Mapping[str, np.ndarray]) -> list[Fault]:
    """Channels that are their prediction (N,), SI, times a conversion factor.

    A reaction of the other sign is none of them: that is a load cell mounted upside down (sensor_frame).
    """
    faults = []
    for signal, channel in run.channels.items():
        here = np.flatnonzero(
            np.isfinite(channel.values) & np.isfinite(predicted.get(signal, np.full(channel.values.shape, math.nan)))
        )
        if here.size < 3:
            continue
        kind = dimension(channel.signal)
        found = looks(kind, channel.unit, predicted[signal][here], channel.values[here])
        if found is not None and (kind, found[1]) != ("force", REVERSED):
            slope, what = found
            text = (
                f"{signal} of run {run.name!r} is {slope:.4g} times its prediction: it looks {what}, but {run.file}"
                f" says {channel.unit}"
            )
            faults.append(Fault(run.name, signal, "unit", here.size, text))
    return faults


def looks(kind: QuantityKind, unit: str, model: np.ndarray, measured: np.ndarray) -> tuple[float, str] | None:
    """By what measured values (N,), read in this unit, are the model's (N,), and what they look, if that is a
    conversion of this kind of quantity: in another unit, converted twice, or of the other sign.
    """
    if any(np.std(each) <= each.size * np.finfo(float).eps * np.abs(each).max() for each in (model, measured)):
        return None  # constant, but for rounding
    if abs(np.corrcoef(model, measured)[0, 1]) < 0.99:
        return None
    slope = float(np.polyfit(model, measured, 1)[0])
    if abs(slope - 1) < LIKE_UNIT:
        return None
    others = [(each, factor(each, kind)) for each in (*OFFERED[kind], *("rev/s",) * (kind == "angular velocity"))]
    read = factor(unit, kind)
    conversions = {f"in {each}": read / size for each, size in others} | {REVERSED: -1.0}
    if read == 1:
        conversions |= {f"converted from {each} twice": size for each, size in others}
    alike = (what for what, of in conversions.items() if abs(slope / of - 1) < LIKE_UNIT)
    return next(((slope, what) for what in alike), None)


def _misfit(run: MeasuredRun, signal: str, prediction: np.ndarray) -> float:
    """Root mean square of a channel less a prediction, for angles modulo whole turns."""
    residual = run.channels[signal].values - prediction
    residual = residual[np.isfinite(residual)]
    if residual.size == 0:
        return 0.0
    if run.channels[signal].signal.wraps:
        residual = residual - turned_near(np.zeros(()), np.mean(residual))
    return float(np.sqrt(np.mean(residual**2)))


def _scale(d: np.ndarray) -> float:
    """Robust standard deviation about zero: biweight, which loses little to the root mean square on white noise."""
    middle = 1.4826 * float(np.median(np.abs(d)))
    if middle == 0:
        return 0.0
    u = (d / (9 * middle)) ** 2
    d, u = d[u < 1], u[u < 1]
    return math.sqrt(d.size * float(np.sum(d**2 * (1 - u) ** 4))) / abs(float(np.sum((1 - u) * (1 - 5 * u))))
