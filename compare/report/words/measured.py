"""What was measured, and how far each sensor is off before and after, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analytic.mechanism.one_line import capital, count, enumerated, in_words
from compare.quantities import DASH, fitting, plainly, shown
from compare.report.words.effects import spoken
from compare.results.diagnosis import SIDES, DiagnosedRun, Diagnosis, Side

NOISE = "The noise of"  # begins a note of noise that is not white, which a terminal shows too


def data_sentences(runs: Sequence[DiagnosedRun]) -> tuple[str, ...]:
    """What was measured, in plain sentences: runs, sensors, samples, whose noise was given, and which runs are kept for
    validation.
    """
    fitted = [run for run in runs if run.role == "fit"]
    kept = [run.name for run in runs if run.role == "validation"]
    sensors = sorted({len(run.signals) for run in fitted})
    records = [channel for run in fitted for channel in run.signals.values()]
    samples = sum(int(np.isfinite(channel.measured).sum()) for channel in records)
    many = (
        f"{in_words(sensors[0])} to {in_words(sensors[-1])} sensors"
        if len(sensors) > 1
        else f"{in_words(sensors[0])} sensor{'s' * (sensors[0] > 1)}"
    )
    each = " each" if len(fitted) > 1 else ""
    sentences = [
        capital(f"{in_words(len(fitted))} run{'s' * (len(fitted) > 1)} with {many}{each}, {samples:,} samples."),
        _noise_sentence([channel.noise_given for channel in records]),
    ]
    if kept:
        one = len(kept) == 1
        sentences.append(
            f"Run{'s' * (not one)} {enumerated(kept)} {'is' if one else 'are'} for validation: nothing was fitted to"
            f" {'it' if one else 'them'}."
        )
    return tuple(sentences)


def _noise_sentence(given: Sequence[bool]) -> str:
    if all(given):
        return "You gave the noise of every sensor."
    if not any(given):
        return "You gave no noise: it was estimated from the scatter of each sensor."
    return (
        f"You gave the noise of {in_words(sum(given))} of the {count(len(given), 'record')} (a sensor in a run); of the"
        " others it was estimated from their scatter."
    )


def validation_sentences(result: Diagnosis) -> tuple[str, ...]:
    """How near the nominal and the explained mechanism come to each validation run, by its sensors together."""
    sentences = []
    for run in result.validation:
        before, after = (pooled(run, side) for side in SIDES)
        what = f"Validation run {run.name}, which nothing was fitted to"
        if before is None or after is None:
            sentences.append(f"{what}: the engine could not simulate it {'before' if before is None else 'after'}.")
            continue
        sentences.append(f"{what}, differs by {plainly(before)} times the noise before and {plainly(after)} after.")
    return tuple(sentences)


def pooled(run: DiagnosedRun, side: Side) -> float | None:
    """Gap of a run: root mean square of residual over noise, over the samples of all its sensors; None where a sensor
    has none.
    """
    squares, samples = 0.0, 0
    for channel in run.signals.values():
        gap = channel.gap_before if side == "before" else channel.gap_after
        if gap is None:
            return None
        known = int(np.isfinite(channel.measured).sum())
        squares, samples = squares + known * gap**2, samples + known
    return math.sqrt(squares / samples) if samples else None


@dataclass(frozen=True)
class InUnits:
    """How far a sensor is off over all fitted runs, in its own unit: root mean square before and after, and the peak to
    peak range (SI) of what it measured, of an angle at most a turn.
    """

    signal: str
    unit: str
    before: float | None
    after: float | None
    reach: float

    def share(self, side: str = "after") -> float | None:
        """How far it is off, as a share of its range."""
        rest = self.after if side == "after" else self.before
        return None if rest is None or not self.reach else rest / self.reach


def off(result: Diagnosis, run: DiagnosedRun, signal: str, side: Side) -> float | None:
    """How far a sensor is off in a run: root mean square, SI."""
    residual = result.residual(run, signal, side)
    known = residual[np.isfinite(residual)]
    return float(np.sqrt(np.mean(known**2))) if known.size else None


def reading(result: Diagnosis, signal: str) -> tuple[str, float]:
    """The one unit in which all that is said of how far a sensor is off is read, and the factor to it."""
    runs = [run for run in result.runs if signal in run.signals]
    errors = [off(result, run, signal, side) for run in runs for side in SIDES]
    return fitting(runs[0].signals[signal].unit if runs else "1", *errors)


def off_by(result: Diagnosis, signal: str, value: float | None) -> str:
    """How far a sensor is off (SI), in the one unit of that sensor."""
    unit, factor = reading(result, signal)
    return DASH if value is None else f"{plainly(value * factor)} {unit}"


def off_on_both_sides(result: Diagnosis, run: DiagnosedRun, signal: str) -> tuple[str, str]:
    """How far a sensor is off in a run (rms) before and after, in the one unit of that sensor."""
    before, after = (off_by(result, signal, off(result, run, signal, side)) for side in SIDES)
    return before, after


def in_units(result: Diagnosis) -> list[InUnits]:
    """Every sensor of the fitted runs."""
    sensors = []
    for signal, gap in result.gap.by_signal.items():
        values = [run.signals[signal].measured for run in result.fitted if signal in run.signals]
        known = np.concatenate(values) if values else np.zeros(0)
        known = known[np.isfinite(known)]
        reach = float(np.ptp(known)) if known.size else 0.0
        reach = min(reach, math.tau) if result.wraps(signal) else reach
        sensors.append(InUnits(signal, gap.unit, gap.before, gap.after, reach))
    return sensors


def explained_to(result: Diagnosis, side: str = "after") -> str:
    """How near the model comes to the sensor that it misses most: ``explained to 1 % of the range: ...``; empty where
    that is not known.  What is left of others than those that are still off is their noise.
    """
    still = {signal for _, signal in remaining(result)} if side == "after" else set()
    sensors = [sensor for sensor in in_units(result) if sensor.share(side) is not None]
    worst = max(
        [sensor for sensor in sensors if sensor.signal in still] or sensors,
        key=lambda sensor: sensor.share(side) or 0.0,
        default=None,
    )
    if worst is None:
        return ""
    unit, factor = shown(worst.unit)
    rest = worst.after if side == "after" else worst.before
    rms, reach = (f"{plainly((value or 0.0) * factor)} {unit}" for value in (rest, worst.reach))
    share, name = plainly(100 * (worst.share(side) or 0.0), 2), spoken(result, worst.signal)
    if side == "before":
        return f"At worst, {name} is off by {rms} (rms), {share} % of its range of {reach}."
    return (
        f"The data are explained to {share} % of the range: the worst sensor, {name}, is still off by {rms} (rms) of a"
        f" range of {reach}."
    )


def remaining(result: Diagnosis) -> dict[tuple[str, str], str]:
    """The signals of fitted runs whose gap is still above the noise floor, by run and signal, the largest first."""
    floor = 1.1 * result.gap.noise_floor
    unexplained = [
        (channel.gap_after, run, name)
        for run in result.fitted
        for name, channel in run.signals.items()
        if channel.gap_after is not None and channel.gap_after > floor
    ]
    return {
        (run.name, name): f"{spoken(result, name)} in run {run.name} is still off by"
        f" {off_by(result, name, off(result, run, name, 'after'))} (rms), {plainly(gap)} times its noise"
        for gap, run, name in sorted(unexplained, key=lambda row: -row[0])
    }


def run_title(run: DiagnosedRun) -> str:
    """A run's name, and that it is a validation run."""
    return f"{run.name} (validation run: nothing was fitted to it)" if run.role == "validation" else run.name
