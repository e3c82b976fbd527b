"""Fewer samples of a run, evenly, without losing a sensor or the motion that a drive follows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compare.diagnose.data.quality import FLOOR, GAP
from compare.diagnose.data.recording import MeasuredRun
from compare.recorded.smooth import Smoother


def picked(run: MeasuredRun, every: int) -> MeasuredRun:
    """A run with one in so many of its samples: the same rows of all sensors, and more where a sensor has few
    in those.
    """
    keep = np.zeros(run.time.size, bool)
    keep[::every] = True
    for channel in run.channels.values():
        here = np.flatnonzero(np.isfinite(channel.values))
        if np.sum(keep[here]) < here.size / every / 2:
            keep[here[::every]] = True
    channels = {s: c.at(keep) for s, c in run.channels.items()}
    return replace(run, time=frozen(run.time[keep]), channels=channels)


def held(time: np.ndarray, encoder: np.ndarray) -> np.ndarray:
    """Samples (N,) bool at which a drive that follows the encoder (N,), NaN where absent, is held by it: not before,
    after, or in a gap.
    """
    known = np.flatnonzero(np.isfinite(encoder))
    if known.size < 2:
        return np.isfinite(encoder)
    step = np.diff(time[known])
    after = np.searchsorted(known, np.arange(time.size))  # the reading at or after a sample
    long = np.concatenate([[True], step > GAP * np.median(step), [True]])
    return np.isfinite(encoder) | ~long[after]


def missed(run: MeasuredRun, thin: MeasuredRun, encoder: str) -> float:
    """By how much (rms, rad) a drive that follows the encoder misses its motion with these samples of it; 0 for no more
    than noise.
    """
    sides = []
    for each in (run, thin):
        values = each.channels[encoder].values
        here = np.flatnonzero(np.isfinite(values))
        sides.append((each.time[here], values[here]))
    (time, values), knots = sides
    within = (time >= knots[0][0]) & (time <= knots[0][-1])
    time, values = time[within], values[within]
    error = float(np.sqrt(np.mean((Smoother(*knots).course(time) - values) ** 2)))
    return error if error > 3 * max(run.channels[encoder].noise, FLOOR * float(np.ptp(values))) else 0.0


def frozen(values: np.ndarray) -> np.ndarray:
    """A copy that cannot be written to."""
    values = np.array(values, float)
    values.flags.writeable = False
    return values
