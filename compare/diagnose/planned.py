"""Runs of a linkage that one crank moves which nobody has measured: a turn at a speed, or as far as it went in the
data.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.signals import named
from compare.diagnose.ahead import Ahead, runs_ahead
from compare.diagnose.data.recording import Channel, Measured, MeasuredRun
from compare.results.diagnosis import Diagnosis

SAMPLES = 181  # of a turn: one every two degrees


def planned(
    result: Diagnosis,
    mechanism: Mechanism,
    speed: float,
    signals: Sequence[str],
    loads: tuple[Load, ...] | None = None,
    name: str = "prediction",
) -> Ahead | None:
    """A run at a speed (rad/s) with these signals; None where nobody drove the linkage in the data.  Raises
    MeasuredError where the nominal mechanism cannot make it.
    """
    driven = [run for run in result.fitted if run.drive != "free"]
    if not driven:
        return None
    low = min(float(run.crank_angle.min()) for run in driven)
    reach = max(float(np.ptp(run.crank_angle)) for run in driven)
    reach = math.tau if reach > math.tau * (1 - 1 / SAMPLES) else reach
    time = np.linspace(0.0, reach / abs(speed), SAMPLES)
    known = named(mechanism.bodies, mechanism.joints, mechanism.drives)
    nothing = np.full(time.size, math.nan)
    channels = {s: Channel(known[s], nothing, _noise(result, s), True, known[s].unit) for s in signals}
    begin = low if speed > 0 else low + reach
    run = MeasuredRun(name, time, channels, "speed", speed, begin, {}, loads, False, "")
    return runs_ahead(Measured(result.mechanism, (run,), {}, (), name), mechanism)[0]


def _noise(result: Diagnosis, signal: str) -> float:
    """The sensor's smallest noise; of what nobody measured one, which is not looked at."""
    return min((run.signals[signal].noise for run in result.fitted if signal in run.signals), default=1.0)
