"""One result as a reader takes it in: the verdict in words, rows in degrees and millimetres, and what goes beside them.

Page, Markdown, JUnit file and terminal all show this summary; none of them looks into the result for numbers of its
own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from analytic.paper.superposition import whole_turn
from compare.quantities import Quantity, key_signals, plain, quantities, shown
from compare.report.words.contact import ContactShown, describe
from compare.results.crosscheck import CrossCheck, Discrepancy, OrderDifference, Run

REAL = ("contact", "spring-damper", "massless-link", "ideal")  # joint models, the most real first
EQUAL_STEPS = 1e-6  # of a step between samples: steps that differ by less are equal


@dataclass(frozen=True)
class Abscissa:
    """What a run's samples are plotted over: crank angles (deg); times (s) where the linkage swings freely or follows a
    course, so that its crank angle may come back to where it was.
    """

    label: str
    unit: str
    values: Sequence[float]

    @property
    def of_time(self) -> bool:
        """Whether samples belong to times."""
        return self.unit == "s"

    @property
    def around(self) -> bool:
        """Whether the step after the last crank angle would close a turn."""
        return not self.of_time and whole_turn(np.radians(self.values))

    def at(self, sample: int) -> str:
        """Where a sample is: ``30 deg``."""
        return f"{plain(self.values[sample], 4)} {self.unit}"


class Sampled(Protocol):
    """What has a value for each crank angle (N,) rad, or time (N,) s."""

    @property
    def crank_angle(self) -> np.ndarray: ...

    @property
    def time(self) -> np.ndarray | None: ...


@dataclass(frozen=True)
class ShownDifference:
    """The largest difference of a signal, its root mean square, both in ``quantity.unit``, and where it is the largest;
    None where there is no number.
    """

    quantity: Quantity
    maximum: float | None
    rms: float | None
    at: str


@dataclass(frozen=True)
class ShownDiscrepancy(ShownDifference):
    """Simulated minus analytic of a signal in a run, with its tolerance and verdict."""

    tolerance: float | None
    verdict: str
    reason: str = ""
    own: float | None = None  # 2 u_num: what the engine's steps alone may make of it
    order: float | None = None  # of the engine, as observed

    @property
    def share(self) -> float | None:
        """Largest difference over tolerance."""
        return abs(self.maximum) / self.tolerance if self.maximum is not None and self.tolerance else None


@dataclass(frozen=True)
class ShownRun:
    """A run, with its rows and its ``order`` (first order minus equilibrium) by signal, in the order of a report."""

    index: int
    run: Run
    over: Abscissa
    rows: tuple[ShownDiscrepancy, ...]
    order: tuple[ShownDifference, ...]

    def row(self, signal: str) -> ShownDiscrepancy | None:
        """The row of a signal, if the run has it."""
        return next((row for row in self.rows if row.quantity.signal == signal), None)

    @property
    def clearance(self) -> str:
        """Radial clearances by joint: ``A 0.1 mm, B 0.2 mm``."""
        return ", ".join(f"{joint} {plain(1e3 * size)} mm" for joint, size in self.run.clearance.items()) or "none"

    @property
    def span(self) -> str:
        """How many samples are compared, and over what: ``29 crank angles, 20 to 160 deg``."""
        samples = count(len(self.over.values), "instant" if self.over.of_time else "crank angle")
        first, last = (plain(end(self.over.values), 5) for end in (min, max))
        return f"{samples}, {first} to {last} {self.over.unit}"

    @property
    def flagged(self) -> tuple[tuple[str, str], ...]:
        """Each reason of its flags once, after the ranges in which it holds: ``30 to 85 deg, every 5 deg``."""
        ranges = {reason: list(_ranges(at, self.over)) for reason, at in by_reason(self.run.flags).items()}
        return tuple((("; " if "," in "".join(at) else ", ").join(at), reason) for reason, at in ranges.items())


@dataclass(frozen=True)
class Summary:
    """A whole result; its verdict is ``failed`` where no run that came to its end speaks against the model."""

    result: CrossCheck
    verdict: str
    runs: tuple[ShownRun, ...]
    signals: Mapping[str, Quantity]
    contact: ContactShown

    @cached_property
    def joints(self) -> list[str]:
        """The joints that the report is about: those with clearance, or all."""
        joints = [joint.name for joint in self.result.mechanism.joints]
        return [name for name in joints if any(run.clearance.get(name) for run in self.result.runs)] or joints

    @property
    def verified(self) -> bool:
        """Whether any run states its numerical uncertainty."""
        return any(run.numerical for run in self.result.runs)

    @property
    def failures(self) -> list[str]:
        """Why runs have no result."""
        return [failure.why for failure in self.result.failures if not failure.stopped]

    @property
    def stopped(self) -> list[str]:
        """What was not waited for."""
        return [failure.why for failure in self.result.failures if failure.stopped]

    @property
    def spread(self) -> list[ShownDifference]:
        """The largest difference between any two engines, by signal."""
        return [
            ShownDifference(
                self.signals[name],
                self.signals[name].factor * spread.max,
                None,
                _where(spread.at_crank_angle, self.runs[0].run, self.runs[0].over),
            )
            for name, spread in self.result.spread.items()
            if name in self.signals
        ]

    def keys(self, all_joints: bool = False) -> list[Quantity]:
        """The signals of a short table: the paper's own, for these joints or for all, what a file of results has, what
        was asked for, and whatever disagrees.
        """
        mechanism = self.result.mechanism
        joints = [j.name for j in mechanism.joints] if all_joints else self.joints
        rows = [(shown.run, row) for shown in self.runs for row in shown.rows]
        present = {row.quantity.signal for _, row in rows}
        more = {
            row.quantity.signal
            for run, row in rows
            if row.verdict in ("disagrees", "unjudged")
            or run.simulator.recorded
            or self.result.signals[row.quantity.signal].on_request
        }
        nearest = max(rows, key=lambda each: (each[1].verdict == "agrees", each[1].share or 0.0), default=None)
        more |= set() if nearest is None else {nearest[1].quantity.signal}  # a headline says it
        loose = any(shown.run.clearance for shown in self.runs)
        chosen = [s for s in key_signals(mechanism, joints, loose) if s in present]
        return [self.signals[s] for s in [*chosen, *(s for s in self.signals if s in more and s not in chosen)]]


def summarise(result: CrossCheck) -> Summary:
    """Summary of a result."""
    signals = quantities(result.mechanism)
    runs = tuple(_shown(i, run, result.mechanism, signals) for i, run in enumerate(result.runs))
    contact = describe(result)
    speaks_against = any(pair.wrong for pair in contact.pairs) or any(run.verdict != "agrees" for run in result.runs)
    failed = any(not failure.stopped for failure in result.failures)
    verdict = "failed" if failed and not speaks_against else result.verdict
    return Summary(result, verdict, runs, signals, contact)


def _shown(index: int, run: Run, mechanism: Mechanism, signals: Mapping[str, Quantity]) -> ShownRun:
    over, names = abscissa(run, mechanism), list(signals)

    def place(row: ShownDifference) -> int:
        return names.index(row.quantity.signal)

    rows = sorted((_row(signals[d.signal], d, run, over) for d in run.discrepancies), key=place)
    order = (_difference(signals[s], d, run, over) for s, d in run.order_difference.items() if s in signals)
    return ShownRun(index, run, over, tuple(rows), tuple(sorted(order, key=place)))


def by_reason(flags: Mapping[str, str]) -> dict[str, list[int]]:
    """Each reason of some flags with the samples that it is of, in order."""
    return {
        why: sorted(int(i) for i, reason in flags.items() if reason == why) for why in dict.fromkeys(flags.values())
    }


def abscissa(run: Sampled, mechanism: Mechanism) -> Abscissa:
    """What a run's samples are plotted over."""
    if run.time is not None and mechanism.speed is None:
        return Abscissa("time", "s", run.time.tolist())
    return Abscissa("crank angle θ₂", "deg", [math.degrees(1.0) * angle for angle in run.crank_angle.tolist()])


def _ranges(samples: list[int], over: Abscissa) -> Iterator[str]:
    """Samples, by increasing index, as ranges of three or more neighbours at equal steps, and as single places."""
    x, unit = over.values, over.unit
    while samples:
        step = x[samples[1]] - x[samples[0]] if len(samples) > 1 else 0.0
        size = 1
        while size < len(samples) and samples[size] == samples[size - 1] + 1:
            if abs(x[samples[size]] - x[samples[size - 1]] - step) > EQUAL_STEPS * abs(step):
                break
            size += 1
        size = size if size > 2 else 1
        first, last = over.at(samples[0]), over.at(samples[size - 1])
        yield first if size == 1 else f"{first.removesuffix(f' {unit}')} to {last}, every {plain(abs(step), 4)} {unit}"
        samples = samples[size:]


def _row(quantity: Quantity, d: Discrepancy, run: Run, over: Abscissa) -> ShownDiscrepancy:
    largest = _difference(quantity, d, run, over)
    tolerance = None if d.tolerance is None else largest.quantity.factor * d.tolerance
    steps = run.numerical.get(d.signal)
    own = None if steps is None else 2 * largest.quantity.factor * steps.u_num
    return ShownDiscrepancy(
        quantity=largest.quantity,
        maximum=largest.maximum,
        rms=largest.rms,
        at=largest.at,
        tolerance=tolerance,
        verdict=d.verdict,
        reason=d.reason,
        own=own,
        order=None if steps is None else steps.order,
    )


def _difference(
    quantity: Quantity, difference: OrderDifference | Discrepancy, run: Run, over: Abscissa
) -> ShownDifference:
    """A difference in the unit in which people read it, which need not be the signal's own."""
    unit, factor = shown(difference.unit)
    quantity = quantity if unit == quantity.unit else replace(quantity, unit=unit, factor=factor)
    maximum, rms = (None if value is None else quantity.factor * value for value in (difference.max, difference.rms))
    return ShownDifference(quantity, maximum, rms, _where(difference.at_crank_angle, run, over))


def _where(angle: float | None, run: Run, over: Abscissa) -> str:
    """A crank angle (rad) as a person reads it; over time the first time at which the crank is there."""
    if angle is None:
        return "-"
    if over.of_time:
        return over.at(int(np.argmin(np.abs(run.crank_angle - angle))))
    return f"{plain(math.degrees(angle), 4)} deg"
