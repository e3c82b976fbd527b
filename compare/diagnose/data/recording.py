"""What was recorded on a bench: channels in runs, in SI, with the noise of every sensor and what was wrong with the
data.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from analytic.mechanism import Load, Mechanism
from analytic.mechanism.assumed import Assumed
from analytic.mechanism.one_line import count
from analytic.mechanism.signals import Signal, named
from compare.presentation import presentation
from compare.recorded.errors import DataError
from compare.recorded.headings import Column
from compare.recorded.text import MIN_ROWS
from compare.results.document import as_dataframe

if TYPE_CHECKING:
    import pandas

Drive = Literal["speed", "measured", "free"]
Role = Literal["fit", "validation"]


class MeasuredError(DataError):
    """Measured data cannot be used; each fault is one sentence with file, line or field, value and remedy."""


@dataclass(frozen=True)
class Fault:
    """Something wrong with the data of a run that was handled; ``samples`` are affected and ``text`` says it in a
    sentence.

    ``kind`` is clipped, outliers, constant, absent, noise, wrapped, course, rest, rings, switched (one signal), gap,
    thinned, columns, start, stamps (the run, ``signal`` is ``time``), or what :mod:`compare.diagnose.slips` finds.
    """

    run: str
    signal: str
    kind: str
    samples: int
    text: str


@dataclass(frozen=True, repr=False)
class Channel:
    """One sensor in one run: ``values`` (N,) SI, NaN where absent or faulty, angles continued; ``noise`` is one sigma,
    SI, > 0.

    ``noise_given`` says whether measured.toml gave it (else it is estimated); ``unit`` is the header's, for people;
    ``column`` is the file's, where there is one.
    ``spikes`` (N,) are the readings that were left out as isolated spikes, NaN elsewhere: where pins strike, they are
    evidence.  ``reach`` (s) is that of the smooth course through an encoder, where its own readings do not tell it.
    """

    signal: Signal
    values: np.ndarray
    noise: float
    noise_given: bool
    unit: str
    spikes: np.ndarray | None = None
    column: Column | None = None
    reach: float | None = None

    @property
    def raw(self) -> np.ndarray:
        """The values (N,) with the spikes among them."""
        return self.values if self.spikes is None else np.where(np.isfinite(self.spikes), self.spikes, self.values)

    def at(self, rows: np.ndarray | slice) -> Channel:
        """The same sensor at some of the run's samples."""
        values, spikes = self.values[rows].copy(), None if self.spikes is None else self.spikes[rows]
        values.flags.writeable = False
        return replace(self, values=values, spikes=spikes)

    def __repr__(self) -> str:
        known = int(np.count_nonzero(np.isfinite(self.values)))
        return f"Channel({self.signal.name}, {count(known, 'sample')}, noise {self.noise:.3g})"


TWINS = 0.2  # of the smaller noise: two sensors never stay as near to each other, in MIN_ROWS samples or more


def same_numbers(one: Channel, other: Channel) -> bool:
    """Whether two columns have the same numbers: no two sensors have the same noise."""
    a, b = (c.values / (1.0 if c.column is None else c.column.factor) for c in (one, other))
    noise = min(c.noise / (1.0 if c.column is None else c.column.factor) for c in (one, other))
    apart = np.abs(a - b)[np.isfinite(a - b)]
    return apart.size >= MIN_ROWS and bool(apart.max() < TWINS * noise)


@dataclass(frozen=True, repr=False)
class MeasuredRun:
    """One recording: ``time`` (N,) s, strictly increasing, and channels by signal.

    ``speed`` (rad/s) and ``angle`` (rad, at time 0) are the command of a ``speed`` run, else None; ``start`` is the
    state at the first sample of a ``free`` one: what was given, and for the driven body at least an estimate, of which
    ``unsure`` says by how much (1 sigma) noise puts it off.
    ``loads`` replace the mechanism's; None keeps them; ``clock`` is the file's column of time, where there is one.  A
    ``validation`` run is simulated and shown, and nothing is fitted to it.  A free run may have a ``push``: what its
    motor gives, as recorded; it goes in ``pieces``, each from its own start.
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
    role: Role = "fit"
    clock: Column | None = None
    push: Channel | None = None
    pieces: int = 1
    unsure: Mapping[str, float] = field(default_factory=dict)

    @property
    def input(self) -> Literal["speed", "measured", "free", "torque"]:
        """What is given of how it moves."""
        return self.drive if self.push is None else "torque"

    def __repr__(self) -> str:
        span = f"{self.time[-1] - self.time[0]:.3g} s" if self.time.size else "empty"
        return (
            f"Run({self.name}, {self.input}, {count(self.time.size, 'sample')} in {span}: {', '.join(self.channels)})"
        )


@dataclass(frozen=True)
class Wanted:
    """A signal that is to be right within ``required`` (SI), at a ``speed`` (rad/s; None: the fastest measured).

    ``calibration`` is the standard uncertainty (SI) that all readings of a sensor share, by signal (GUM, Type B).
    """

    signal: Signal
    required: float
    question: str = ""
    consequence: str = ""
    speed: float | None = None
    calibration: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, repr=False)
class Measured:
    """A nominal mechanism, the runs measured on it, what may be blamed at most (``tolerance``, by quantity, parameter
    or effect.parameter, SI), what was wrong with the data, what is ``assumed`` of the runs, and how many times as
    likely as usual an effect is (``prior``, by name or name@where).
    """

    mechanism: Mechanism
    runs: tuple[MeasuredRun, ...]
    tolerance: Mapping[str, float]
    faults: tuple[Fault, ...]
    source: str
    assumed: tuple[Assumed, ...] = ()
    prior: Mapping[str, float] = field(default_factory=dict)
    context: Wanted | None = None

    @cached_property
    def sensors(self) -> frozenset[tuple[str, str]]:
        """Every run's sensors, by run and signal."""
        return frozenset((run.name, signal) for run in self.runs for signal in run.channels)

    @cached_property
    def signals(self) -> Mapping[str, Signal]:
        """Every signal that the linkage can have, by name."""
        return named(self.mechanism.bodies, self.mechanism.joints, self.mechanism.drives, self.mechanism.sensors)

    def rows(self) -> list[dict[str, float | str | None]]:
        """A row for each sample of each run: its run, its time (s) and every sensor in SI, None where it is silent."""
        names = dict.fromkeys(name for run in self.runs for name in run.channels)
        found: list[dict[str, float | str | None]] = []
        for run in self.runs:
            for k, time in enumerate(run.time.tolist()):
                row: dict[str, float | str | None] = {"run": run.name, "time": time}
                for name in names:
                    value = float(run.channels[name].values[k]) if name in run.channels else math.nan
                    row[name] = value if math.isfinite(value) else None
                found.append(row)
        return found

    def to_dataframe(self) -> pandas.DataFrame:
        """The rows as a data frame, whose ``attrs["units"]`` has the SI unit of each column.  Raises ImportError with
        the remedy where pandas is not installed.
        """
        return as_dataframe(self.rows(), "to_dataframe", {"time": "s"} | {n: s.unit for n, s in self.signals.items()})

    def __repr__(self) -> str:
        samples = sum(run.time.size for run in self.runs)
        faults = f", {count(len(self.faults), 'fault')}" if self.faults else ""
        names = ", ".join(run.name for run in self.runs[:4]) + (", ..." if len(self.runs) > 4 else "")
        runs = count(len(self.runs), "run")
        return f"Measured({self.mechanism.name}, {runs} ({names}), {count(samples, 'sample')}{faults})"

    def _repr_html_(self) -> str:
        return presentation(self).summary_html(self)
