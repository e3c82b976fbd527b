"""Sentences of a diagnosis that stand in its file and on its page: signals, places and parameters as one says them."""

from __future__ import annotations

import math

import numpy as np

from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.quantities import MINUS, Quantity, amount, fitting, number, quantities, shown
from compare.results.diagnosis import DiagnosedRun, Diagnosis, Located, Parameter

TURN = math.tau
PERCENT = {p.name for effect in VOCABULARY.values() for p in effect.parameters if p.percent}  # parameters read in %


def quantity(result: Diagnosis, signal: str) -> Quantity:
    """The quantity of a signal; one that the mechanism does not have (a person's own sensor) goes by its own name."""
    known = quantities(result.mechanism)
    if signal in known:
        return known[signal]
    unit = next((run.signals[signal].unit for run in result.runs if signal in run.signals), "1")
    return Quantity(signal, signal, "", "", *shown(unit))


def spoken(result: Diagnosis, signal: str) -> str:
    """A signal as one says it: ``follower angle``, ``reaction x at B``."""
    found = quantity(result, signal)
    return f"{found.place[3:]} {found.name}" if found.place.startswith("of ") else found.label


def parameter(name: str, found: Parameter) -> tuple[str, str, str]:
    """A parameter's name, its value, and its 95 % interval, in one unit and to as many digits as the interval allows.

    A value of one run is called ``offset@run``.
    """
    value, low, high = found.value, found.low, found.high
    unit, factor = fitting(found.unit, value, low, high)
    what, _, run = name.partition("@")
    if what in PERCENT:
        unit, factor = "%", 100.0
    half = 0.5 * abs(high - low) * factor if low is not None and high is not None else 0.0
    decimals = 1 - math.floor(math.log10(half * (1 + 1e-9))) if half > 0 else None

    def say(v: float) -> str:
        if decimals is None or not 0 <= decimals <= 6:
            return number(v * factor, 4)
        return f"{v * factor + 0.0:.{decimals}f}".replace("-", MINUS)

    suffix = "" if unit == "1" else f" {unit}"
    interval = f"{say(low)} to {say(high)}{suffix}" if low is not None and high is not None else "not known"
    return what.replace("_", " ") + (f" in run {run}" if run else ""), say(value) + suffix, interval


def wrapped(result: Diagnosis) -> bool:
    """Whether the commanded crank angles are shown within one turn, because some run makes a whole one."""
    ends = [(run.crank_angle.min(), run.crank_angle.max()) for run in result.runs if not run.over_time]
    return any(high - low > TURN - 0.1 or low < -TURN or high > TURN for low, high in ends)


def span(result: Diagnosis, place: Located) -> str:
    """Where on the crank a deviation is: ``between 40 and 110 deg``."""
    low, high = sorted((place.crank_angle_from, place.crank_angle_to))
    if high - low >= TURN - 1e-3:
        return "over the whole turn"
    run = _run(result, place.run)
    if wrapped(result) and (run is None or not run.over_time):
        shift = TURN * math.floor(low / TURN + 1e-3)  # what is printed as 360 deg is the next turn's 0
        low, high = low - shift, high - shift
    first, last = (number(float(f"{math.degrees(angle):.1f}") + 0.0, 4) for angle in (low, high))
    return f"between {first} and {last} deg"


def sentence(result: Diagnosis, place: Located) -> str:
    """A located deviation: ``follower angle is late by 0.6 mrad between 40 and 110 deg in run slow-forward``."""
    size = amount(abs(place.size), place.unit, 2)
    what = f"{spoken(result, place.signal)} is {_direction(result, place)} by {size}"
    return f"{what} {span(result, place)} in run {place.run}"


def _direction(result: Diagnosis, place: Located) -> str:
    """``late`` or ``early`` of an angle that moves one way there, otherwise ``too high`` or ``too low``; as in the
    samples.
    """
    run = _run(result, place.run)
    channel = run.signals.get(place.signal) if run else None
    above = place.size > 0
    signal = result.signals.get(place.signal)
    if (
        run is not None
        and channel is not None
        and signal is not None
        and (signal.kind, signal.component)
        == (
            "pose",
            "angle",
        )
    ):
        low, high = sorted((place.crank_angle_from, place.crank_angle_to))
        inside = np.flatnonzero((low <= run.crank_angle) & (run.crank_angle <= high))
        if not inside.size:  # said of another turn
            inside = np.flatnonzero((run.crank_angle - low) % TURN <= high - low)
        way = _way(channel.before, inside)
        if way:
            return "early" if above == (way > 0) else "late"
    return "too high" if above else "too low"


def _way(values: np.ndarray, inside: np.ndarray) -> int:
    """1 or -1 if the values rise or fall at nearly all of these samples, 0 if they do both."""
    inside = inside[inside + 1 < values.size]
    steps = values[inside + 1] - values[inside]
    steps = steps[np.isfinite(steps)]
    rising = int(np.count_nonzero(steps > 0))
    if not steps.size or steps.size * 0.05 < rising < steps.size * 0.95:
        return 0
    return 1 if 2 * rising > steps.size else -1


def _run(result: Diagnosis, name: str) -> DiagnosedRun | None:
    return next((run for run in result.runs if run.name == name), None)
