"""What a measured channel is worth: its noise, and the faults of sensors and recordings.

Noise is what is left of a channel when its smooth part is taken out by divided differences, which are exact for any
spacing of the samples; of a force that is switched, it is what its samples leave open of when.  A fault is found in
one channel by itself; what only a model can see is :mod:`compare.diagnose.slips`.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from analytic.mechanism.signals import starts_again, turned_near
from compare.diagnose.data.recording import Fault, MeasuredRun
from compare.recorded.quantum import quantum, stretches
from compare.recorded.rounding import decimal
from compare.recorded.text import MIN_ROWS

ORDERS = (3, 4, 6, 8, 10)  # of differences, tried for the noise
FLOOR = 1e-7  # of a channel's range: what a noise-free signal is taken to be good for
SPIKE = 8.0  # sigmas of an outlier
JUDGED = 12  # samples, at least, among which a spike is told
GAP = 5.0  # median intervals
HELD = 0.5  # of a signal's steps from sample to sample that are none, at least, where it is held and jumps
ALONE = 0.9  # of its jumps, at least, before and after which it is held
SWITCHED_LEVELS = 3  # levels: what has no more is switched, as no converter is that coarse
LEAPS = 1.5  # times the step of its numbers that it mostly jumps by, else it may climb a converter's stairs
SHOWN = 0.1  # of a sensor's noise, by which rounded stamps may move it unsaid: it makes half a percent of the noise


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


def switched(values: np.ndarray) -> float:
    """What samples (N,) of a force that is held and jumps leave open of it (rms); 0 of any other.  NaN is absent.

    A jump was anywhere between two samples, so the mean over the time that one stands for is uncertain by a uniform
    share of it.
    """
    steps = np.diff(values[np.isfinite(values)])
    jumps = steps != 0
    if steps.size < JUDGED or not jumps.any() or 1 - jumps.mean() < HELD:
        return 0.0
    edge = np.pad(jumps, 1)
    alone = jumps & ~edge[:-2] & ~edge[2:]
    leaps = float(np.median(np.abs(steps[jumps]))) > LEAPS * quantum(values)
    few = np.unique(values[np.isfinite(values)]).size <= SWITCHED_LEVELS
    if alone.sum() < ALONE * jumps.sum() or not (leaps or few):
        return 0.0
    return math.sqrt(float(np.mean(steps**2)) / 12)


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


def evened(run: MeasuredRun) -> tuple[MeasuredRun, list[Fault]]:
    """A run whose time stamps are rounded so coarsely that a sensor shows it, at the even times that they are rounded
    from, and that fault; as it is where they do not show, or are of no even times.
    """
    step, lines = decimal(run.time), np.arange(run.time.size)
    if not step or lines.size <= MIN_ROWS:
        return run, []
    every, start = np.polyfit(lines, run.time, 1)
    even = start + every * lines
    unsure = 2 * step / math.sqrt(12) * 2 / math.sqrt(lines.size)  # two sigmas of a line's end through rounded stamps
    off = run.time - even
    if np.max(np.abs(off)) > step / 2 + unsure:
        return run, []
    moved = {name: _moved(run.time, off, channel.values) / channel.noise for name, channel in run.channels.items()}
    signal = max(moved, key=lambda name: moved[name])
    if moved[signal] < SHOWN:
        return run, []
    text = (
        f"time of run {run.name!r} is rounded to {step:g} s, in which {signal} moves by {moved[signal]:.2g} times its"
        f" noise (rms); its lines are {every:.9g} s apart within that, and are taken to be: write time with more digits"
    )
    even.flags.writeable = False
    return replace(run, time=even), [Fault(run.name, "time", "stamps", lines.size, text)]


def _moved(time: np.ndarray, off: np.ndarray, values: np.ndarray) -> float:
    """By how much (rms) a signal (N,) moves in what its times (N,) are off."""
    here = np.isfinite(values)
    return float(np.sqrt(np.mean((np.gradient(values[here], time[here]) * off[here]) ** 2)))


def gaps(time: np.ndarray) -> tuple[int, int, float]:
    """Number of gaps in time (N,) s, samples that are missing in them, and the longest (s)."""
    step = np.diff(time)
    usual = float(np.median(step))
    long = step[step > GAP * usual]
    return long.size, int(np.sum(np.round(long / usual) - 1)), float(np.max(long, initial=0.0))


def _scale(d: np.ndarray) -> float:
    """Robust standard deviation about zero: biweight, which loses little to the root mean square on white noise."""
    middle = 1.4826 * float(np.median(np.abs(d)))
    if middle == 0:
        return 0.0
    u = (d / (9 * middle)) ** 2
    d, u = d[u < 1], u[u < 1]
    return math.sqrt(d.size * float(np.sum(d**2 * (1 - u) ** 4))) / abs(float(np.sum((1 - u) * (1 - 5 * u))))
