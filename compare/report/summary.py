"""One result as a reader takes it in: the verdict in words, rows in degrees and millimetres, and what goes beside them.

Page, Markdown, JUnit file and terminal all show this summary; none of them looks into the result for numbers of its
own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analytic.mechanism import Mechanism
from analytic.mechanism.one_line import count
from compare.quantities import Quantity, key_signals, plain, quantities, shown
from compare.report.words.contact import Contact, told
from compare.results import crosscheck as results
from compare.results.crosscheck import CrossCheck
from sim_models.engine import SettingValue

REAL = ("contact", "spring-damper", "massless-link", "ideal")  # joint models, the most real first
STEADY = 1e-6  # of a step between samples: steps that differ by less are equal


@dataclass(frozen=True)
class Order:
    """First-order answer minus equilibrium of one signal of one run, in ``quantity.unit``; None where there is none."""

    quantity: Quantity
    maximum: float | None
    rms: float | None
    at: str


@dataclass(frozen=True)
class Row(Order):
    """One signal of one run: simulated minus analytic; None where nothing could be compared."""

    tolerance: float | None
    verdict: str
    reason: str = ""

    @property
    def share(self) -> float | None:
        """Largest difference over tolerance."""
        return abs(self.maximum) / self.tolerance if self.maximum is not None and self.tolerance else None


@dataclass(frozen=True)
class Printed:
    """A number that the paper prints, beside what the two analytic models give there, in ``quantity.unit``."""

    quantity: Quantity
    at: str
    printed: float
    first_order: float
    equilibrium: float
    source: str


@dataclass(frozen=True)
class ShownRun:
    """One simulator with one joint model."""

    index: int
    simulator: str
    version: str
    joint_model: str
    motion: str
    analytic_model: str
    bends: bool  # whether links are beams
    clearance: str
    verdict: str
    rows: tuple[Row, ...]
    flags: tuple[tuple[str, str], ...]  # where, why
    flagged: tuple[tuple[str, str], ...]  # all places of a reason, the reason
    free: tuple[tuple[str, float], ...]  # joint, per cent of the time without contact
    order: tuple[Order, ...]
    settings: Mapping[str, SettingValue]
    span: str  # what was compared: how many samples, from where to where
    reason: str = ""  # why nothing could be compared
    because: str = ""  # why it disagrees
    assumption: str = ""  # and which assumption of the analytic model that is

    @property
    def title(self) -> str:
        """How the run is called everywhere."""
        return f"{self.simulator}, {self.joint_model}"

    def row(self, signal: str) -> Row | None:
        """The row of a signal, if the run has it."""
        return next((row for row in self.rows if row.quantity.signal == signal), None)


@dataclass(frozen=True)
class Summary:
    """A whole result; its verdict is ``failed`` where no run that came to its end speaks against the model."""

    case: str
    verdict: str
    runs: tuple[ShownRun, ...]
    signals: Mapping[str, Quantity]
    joints: tuple[str, ...]  # the joints that the report is about: those with clearance, or all
    spread: tuple[Order, ...]
    between: str  # who stands apart, in words; empty with one engine
    failures: tuple[str, ...]  # runs that have no result, and why
    printed: tuple[Printed, ...]
    contact: Contact  # what it did in the runs that were watched

    def keys(self, all_joints: bool, mechanism: Mechanism) -> list[Quantity]:
        """The signals of a short table: the paper's own, for these joints or for all, what a file of results has, and
        whatever disagrees.
        """
        joints = [j.name for j in mechanism.joints] if all_joints else list(self.joints)
        present = {row.quantity.signal for run in self.runs for row in run.rows}
        more = {
            row.quantity.signal
            for run in self.runs
            for row in run.rows
            if row.verdict in ("disagrees", "unjudged") or run.version == results.RECORDED
        }
        loose = any(run.clearance != "none" for run in self.runs)
        chosen = [s for s in key_signals(mechanism, joints, loose) if s in present]
        return [self.signals[s] for s in [*chosen, *(s for s in self.signals if s in more and s not in chosen)]]


def summarise(result: CrossCheck) -> Summary:
    """Summary of a result."""
    mechanism = result.mechanism
    signals = quantities(mechanism)
    runs = tuple(_run(i, run, mechanism, signals) for i, run in enumerate(result.runs))
    loose = [j.name for j in mechanism.joints if any(run.clearance.get(j.name) for run in result.runs)]
    joints = loose or [j.name for j in mechanism.joints]
    spread = tuple(
        Order(
            signals[name], signals[name].factor * wide.max, None, _where(wide.at_crank_angle, result.runs[0], mechanism)
        )
        for name, wide in result.spread.items()
        if name in signals
    )
    failures = tuple(failure.why for failure in result.failures)
    contact = told(result)
    speaks_against = any(pair.wrong for pair in contact.pairs) or any(run.verdict != "agrees" for run in runs)
    verdict = "failed" if failures and not speaks_against else result.verdict
    printed = tuple(_printed(signals[one.signal], one) for one in result.printed)
    return Summary(
        result.case,
        verdict,
        runs,
        signals,
        tuple(joints),
        spread,
        result.words,
        failures,
        printed,
        contact,
    )


def _printed(quantity: Quantity, one: results.Printed) -> Printed:
    printed, first_order, equilibrium = (
        quantity.factor * value for value in (one.printed, one.first_order, one.equilibrium)
    )
    at = f"{plain(math.degrees(one.crank_angle), 4)} deg"
    return Printed(quantity, at, printed, first_order, equilibrium, one.source)


def released(run: results.Run, mechanism: Mechanism) -> bool:
    """Whether a run swings freely, or follows a course, so that it is compared over time: its crank angle may come back
    to where it was.
    """
    return run.time is not None and mechanism.speed is None


def abscissa(run: results.Run, mechanism: Mechanism) -> tuple[str, str, float, list[float]]:
    """What a run's samples are plotted over: name, unit, factor to it, and the SI values (rad, or s in a free
    drive).
    """
    if released(run, mechanism) and run.time is not None:
        return "time", "s", 1.0, run.time.tolist()
    return "crank angle θ₂", "deg", math.degrees(1.0), run.crank_angle.tolist()


def _run(index: int, run: results.Run, mechanism: Mechanism, signals: Mapping[str, Quantity]) -> ShownRun:
    _, unit, factor, x = abscissa(run, mechanism)
    listed = list(signals)

    def place(row: Row | Order) -> int:
        return listed.index(row.quantity.signal)

    order = tuple(
        _order(signals[s], fields, run, mechanism) for s, fields in run.order_difference.items() if s in signals
    )
    clearance = ", ".join(f"{joint} {plain(1e3 * size)} mm" for joint, size in run.clearance.items() if size)
    return ShownRun(
        index=index,
        simulator=run.simulator.name,
        version=run.simulator.version,
        joint_model=run.joint_model,
        motion=run.motion,
        analytic_model=run.analytic_model,
        bends=run.bends,
        clearance=clearance or "none",
        verdict=run.verdict,
        rows=tuple(sorted((_row(d, run, mechanism, signals) for d in run.discrepancies), key=place)),
        flags=tuple((f"{plain(factor * x[int(i)], 4)} {unit}", reason) for i, reason in run.flags.items()),
        flagged=_flagged(run, [factor * value for value in x], unit),
        free=tuple((joint, 100 * share) for joint, share in run.free_share.items()),
        order=tuple(sorted(order, key=place)),
        settings=run.settings,
        span=_span(run, mechanism),
        reason=run.reason,
        because=run.because.words if run.because else "",
        assumption=run.because.assumption if run.because else "",
    )


def _flagged(run: results.Run, x: Sequence[float], unit: str) -> tuple[tuple[str, str], ...]:
    """Each reason of a run's flags once, with the ranges of ``x`` in which it holds: ``30 to 85 deg, every 5 deg``."""
    by_reason: dict[str, list[int]] = {}
    for i, reason in run.flags.items():
        by_reason.setdefault(reason, []).append(int(i))
    ranges = {reason: list(_ranges(sorted(at), x, unit)) for reason, at in by_reason.items()}
    return tuple((("; " if "," in "".join(at) else ", ").join(at), reason) for reason, at in ranges.items())


def _ranges(samples: list[int], x: Sequence[float], unit: str) -> Iterator[str]:
    """Samples, by their increasing index into ``x``, as ranges of three or more neighbours at equal steps, and as
    single places.
    """
    while samples:
        step = x[samples[1]] - x[samples[0]] if len(samples) > 1 else 0.0
        size = 1
        while size < len(samples) and samples[size] == samples[size - 1] + 1:
            if abs(x[samples[size]] - x[samples[size - 1]] - step) > STEADY * abs(step):
                break
            size += 1
        size = size if size > 2 else 1
        first, last = plain(x[samples[0]], 4), plain(x[samples[size - 1]], 4)
        yield f"{first} {unit}" if size == 1 else f"{first} to {last} {unit}, every {plain(abs(step), 4)} {unit}"
        samples = samples[size:]


def _span(run: results.Run, mechanism: Mechanism) -> str:
    """How many samples a run has, and over what: ``29 crank angles, 20 to 160 deg``."""
    _, unit, factor, x = abscissa(run, mechanism)
    if not x:
        return ""
    samples = count(len(x), "instant" if unit == "s" else "crank angle")
    return f"{samples}, {plain(factor * min(x), 5)} to {plain(factor * max(x), 5)} {unit}"


def _row(d: results.Discrepancy, run: results.Run, mechanism: Mechanism, signals: Mapping[str, Quantity]) -> Row:
    one = _order(signals[d.signal], d, run, mechanism)
    tolerance = None if d.tolerance is None else one.quantity.factor * d.tolerance
    return Row(one.quantity, one.maximum, one.rms, one.at, tolerance, d.verdict, d.reason)


def _order(
    quantity: Quantity, found: results.OrderDifference | results.Discrepancy, run: results.Run, mechanism: Mechanism
) -> Order:
    quantity = _in_unit(quantity, found.unit)
    maximum, rms = (None if value is None else quantity.factor * value for value in (found.max, found.rms))
    return Order(quantity, maximum, rms, _where(found.at_crank_angle, run, mechanism))


def _in_unit(quantity: Quantity, unit: str) -> Quantity:
    """The quantity in the unit that a difference is given in, which need not be the signal's own."""
    name, factor = shown(unit)
    return quantity if name == quantity.unit else replace(quantity, unit=name, factor=factor)


def _where(at: float | None, run: results.Run, mechanism: Mechanism) -> str:
    """Where a largest difference was found, as a person reads it: the crank angle, in a free drive its first time."""
    if at is None:
        return "-"
    if released(run, mechanism) and run.time is not None:
        return f"{plain(float(run.time[np.argmin(np.abs(run.crank_angle - at))]), 4)} s"
    return f"{plain(math.degrees(at), 4)} deg"
