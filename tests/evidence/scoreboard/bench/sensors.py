"""What sensors, amplifiers, encoders and clocks make of what is there, from the contract's sentences and not by the
diagnosis' own code.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from compare.diagnose.effects.effect import Values
from tests.evidence.scoreboard.files import Readings
from tests.evidence.scoreboard.rigs import Experiment
from tests.evidence.scoreboard.sizes import Planted


def read(thing: Planted, seen: Readings) -> Readings:
    """What an effect of a sensor, the same in all runs, makes of the readings; effects of the rig leave them."""
    play = READ.get(thing.name)
    return seen if play is None else {**seen, thing.where: play(seen[thing.where], thing.values)}


READ: Mapping[str, Callable[[np.ndarray, Values], np.ndarray]] = {
    "encoder_offset": lambda seen, v: seen + v["offset"],
    "sensor_bias": lambda seen, v: seen + v["bias"],
    "sensor_gain": lambda seen, v: (1 + v["gain_error"]) * seen,
}


def white(rng: np.random.Generator, experiment: Experiment, seen: Readings) -> Readings:
    """Readings with white noise."""
    return {s: v + experiment.noise[s] * rng.standard_normal(v.size) for s, v in seen.items()}


def drifting(rng: np.random.Generator, n: int, interval: float, memory: float) -> np.ndarray:
    """Noise (n,) of rms 1 that forgets itself over ``memory`` (s): autoregressive of first order."""
    keep = math.exp(-interval / memory)
    steps = rng.standard_normal(n)
    found = np.empty(n)
    found[0] = steps[0]
    for k in range(1, n):
        found[k] = keep * found[k - 1] + math.sqrt(1 - keep**2) * steps[k]
    return found


def pink(rng: np.random.Generator, n: int) -> np.ndarray:
    """Noise (n,) of rms 1 in the mean, whose power falls as one over frequency; a run sees a part of a longer one."""
    count = 4 * n
    frequency = np.fft.rfftfreq(count)
    spectrum = rng.standard_normal(frequency.size) + 1j * rng.standard_normal(frequency.size)
    spectrum[0] = 0.0
    spectrum[1:] /= np.sqrt(frequency[1:])
    whole = np.fft.irfft(spectrum, count)
    return np.asarray(whole[:n] / whole.std())


def hum(time: np.ndarray, amplitude: float, phase: float, frequency: float = 50.0) -> np.ndarray:
    """Mains in a channel at times (N,) s, as it is sampled."""
    return np.asarray(amplitude * np.sin(2 * math.pi * frequency * time + phase))


def filtered(time: np.ndarray, values: np.ndarray, time_constant: float) -> np.ndarray:
    """What a filter of first order, at rest at first, makes of values (N,) that are straight between times (N,) s."""
    out = np.empty_like(values)
    out[0] = values[0]
    for k in range(1, values.size):
        h = time[k] - time[k - 1]
        keep = math.exp(-h / time_constant)
        straight = time_constant / h * (1 - keep)
        out[k] = keep * out[k - 1] + (straight - keep) * values[k - 1] + (1 - straight) * values[k]
    return out


def history(asked: np.ndarray, time_constants: Sequence[float]) -> np.ndarray:
    """Times (s), those ``asked`` (N,) among them, for filters of these time constants (s): eight in the shortest, from
    eight of the longest before the first.
    """
    longest, fine = max(time_constants), min(time_constants) / 8
    time = np.union1d(np.arange(asked[0] - 8 * longest, asked[-1], fine), asked)
    return time[np.concatenate([[True], np.diff(time) > 1e-9]) | np.isin(time, asked)]


def counted(angle: np.ndarray, counts: int) -> np.ndarray:
    """Angles (N,) rad as an encoder of so many counts a turn tells them."""
    step = 2 * math.pi / counts
    return np.asarray(step * np.round(angle / step))
