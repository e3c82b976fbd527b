"""What was recorded on a bench: channels in runs, in SI, with the noise of every sensor and what was wrong with the
data.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analytic.mechanism import Load, Mechanism

LARGEST = 1e30  # SI, of any number that is read; nothing on a bench is as large, and its square is still a number
SHOWN = 80  # characters of what a file has, in a message
Drive = Literal["speed", "measured", "free"]


class MeasuredError(ValueError):
    """Measured data cannot be used; the message is one sentence with file, line or field, value and remedy."""


def shown(text: str) -> str:
    """What a file has, quoted for a message: one printable line, not longer than can be read."""
    return repr(text if len(text) <= SHOWN else f"{text[:SHOWN]}...")


@dataclass(frozen=True)
class Fault:
    """Something wrong with the data of a run that was handled; ``samples`` are affected and ``text`` says it in a
    sentence.

    ``kind`` is clipped, outliers, constant, absent, noise, wrapped, course (one signal), gap, thinned (the run,
    ``signal`` is ``time``), swapped or unit.
    """

    run: str
    signal: str
    kind: str
    samples: int
    text: str


@dataclass(frozen=True)
class Channel:
    """One sensor in one run: ``values`` (N,) SI, NaN where absent or faulty, angles continued; ``noise`` is one sigma,
    SI, > 0.

    ``noise_given`` says whether measured.toml gave it (else it is estimated); ``unit`` is the header's, for people.
    """

    signal: str
    values: np.ndarray
    noise: float
    noise_given: bool
    unit: str


@dataclass(frozen=True)
class Run:
    """One recording: ``time`` (N,) s, strictly increasing, and channels by signal.

    ``speed`` (rad/s) and ``angle`` (rad, at time 0) are the command of a ``speed`` run, else None; ``start`` is the
    state at the first sample of a ``free`` one: what was given, and for the driven body at least an estimate.
    ``loads`` replace the mechanism's; None keeps them.
    """

    name: str
    time: np.ndarray
    channels: Mapping[str, Channel]
    drive: Drive
    speed: float | None
    angle: float | None
    start: Mapping[str, float]
    loads: tuple[Load, ...] | None
    from_rest: bool
    file: str


@dataclass(frozen=True)
class Measured:
    """A nominal mechanism, the runs measured on it, what may be blamed at most (``tolerance``, by quantity, parameter
    or effect.parameter, SI), and what was wrong with the data.
    """

    mechanism: Mechanism
    runs: tuple[Run, ...]
    tolerance: Mapping[str, float]
    faults: tuple[Fault, ...]
    source: str
