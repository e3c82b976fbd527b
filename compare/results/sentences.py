"""Sentences of a diagnosis that stand in its file and on its page: signals, places, parameters and data as one says
them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from analytic.mechanism.one_line import count
from compare.diagnose.effects.effect import Effect as Kind
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.quantities import DASH, MINUS, Quantity, fitting, number, quantities, shown
from compare.results.diagnosis import DiagnosedRun, Diagnosis, Effect, Located, Parameter, Proposed, SamePlace

TURN = math.tau
PERCENT = {p.name for effect in VOCABULARY.values() for p in effect.parameters if p.percent}  # parameters read in %
MOST_OF_RUN = 0.7  # of its time: a stretch that is there throughout
NOISE = "The noise of"  # begins a note of noise that is not white, which a terminal shows too
ZEROS = {  # what each run has of its own where an effect has a value for each; {} is the sensor
    "encoder_offset": "encoder zero",
    "sensor_bias": "zero of the sensor for {}",
    "sensor_drift": "drift of the sensor for {}",
    "stamp_jitter": "jitter of the time stamps",
}
WORDS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
TOML_STARTS = ("[", "#")
Row = tuple[str, str, str]  # a parameter's name, its value and its 95 % interval

UNKNOWNS = {
    "torque": "torque in joint {}",
    "give": "give of the bearing of joint {}, along its reaction",
    "length": "change of the length of the {}",
    "bend": "distance of the end of the {} from its axis",
    "lag": "angle of the crank behind its encoder",
    "error": "error of the sensor for {}",
}


def plainly(value: float | None, digits: int = 3, sign: bool = False) -> str:
    """A number as one writes it: ``17,400``; powers of ten only beyond a million or below a ten-thousandth."""
    if value is None or not math.isfinite(value):
        return DASH
    short = float(f"{value:.{digits}g}")
    if short and not 1e-4 <= abs(short) < 1e6:
        return number(value, digits, sign)
    decimals = max(0, digits - 1 - (math.floor(math.log10(abs(short))) if short else 0))
    text = f"{short:{'+' if sign else ''},.{decimals}f}"
    return (text.rstrip("0").rstrip(".") if "." in text else text).replace("-", MINUS)


def in_words(number: int) -> str:
    """A count as one says it: ``six``, ``3,000``."""
    return WORDS[number] if 0 <= number < len(WORDS) else f"{number:,}"


def enumerated(names: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join(part for part in (", ".join(names[:-1]), names[-1] if names else "") if part)


def capital(text: str) -> str:
    """A text that begins a sentence."""
    return text[:1].upper() + text[1:]


def quantity(result: Diagnosis, signal: str) -> Quantity:
    """The quantity of a signal; one that the mechanism does not have (a person's own sensor) goes by its own name."""
    known = quantities(result.mechanism)
    if signal in known:
        return known[signal]
    unit = next((run.signals[signal].unit for run in result.runs if signal in run.signals), "1")
    return Quantity(signal, signal, "", "", *shown(unit))


def spoken(result: Diagnosis, signal: str) -> str:
    """A signal as one says it: ``follower angle``, ``reaction x at B``; several joined by + one after the other."""
    if "+" in signal and signal not in result.signals:
        return enumerated([spoken(result, each) for each in signal.split("+")])
    found = quantity(result, signal)
    return f"{found.place[3:]} {found.name}" if found.place.startswith("of ") else found.label


def unknown(result: Diagnosis, p: Proposed | SamePlace) -> str:
    """A proposal's unknown at its place as a noun."""
    if p.unknown == "torque" and isinstance(p, Proposed) and p.unit == "N":
        return f"force along joint {p.place}"
    return UNKNOWNS[p.unknown].format(spoken(result, p.place) if p.unknown == "error" else p.place)


def phrase(result: Diagnosis, name: str, where: str) -> str:
    """An effect at its place: ``clearance in joint B``; one outside the vocabulary by its own name."""
    effect = VOCABULARY.get(name)
    if effect is None:
        return f"{name.replace('_', ' ')} at {where}"
    return effect.called(spoken(result, where) if effect.place == "signal" else where)


def called(result: Diagnosis, key: str) -> str:
    """``joint_clearance@B`` in words."""
    name, _, where = key.partition("@")
    return phrase(result, name, where)


def parameter(name: str, found: Parameter, like: Sequence[Parameter] = ()) -> Row:
    """A parameter's name, its value, and its 95 % interval, in one unit and to as many digits as the interval allows.

    The unit fits the values that it is ``like`` too.  A value of one run is called ``offset@run``.
    """
    value, low, high = found.value, found.low, found.high
    what, _, run = name.partition("@")
    unit, factor = _unit(what, (found, *like))
    half = 0.5 * abs(high - low) * factor if low is not None and high is not None else 0.0
    decimals = min(1 - math.floor(math.log10(half * (1 + 1e-9))), 9) if half > 0 else None

    def say(v: float) -> str:
        if decimals is None or decimals < 0:
            return number(v * factor, 4)
        text = f"{v * factor:.{decimals}f}"
        return text.replace("-", MINUS) if float(text) else "0"

    suffix = "" if unit == "1" else f" {unit}"
    interval = f"{say(low)} to {say(high)}{suffix}" if low is not None and high is not None else "not known"
    words = what.replace("_", " ")
    words = words.replace("torque", "force") if found.unit == "N" else words  # of a slide
    return words + (f" in run {run}" if run else ""), say(value) + suffix, interval


def _unit(what: str, found: Sequence[Parameter]) -> tuple[str, float]:
    """The unit in which some parameters of one name are read, and the factor to it."""
    if what in PERCENT:
        return "%", 100.0
    return fitting(found[0].unit, *(v for p in found for v in (p.value, p.low, p.high)))


def rows(parameters: Mapping[str, Parameter]) -> list[Row]:
    """Every parameter of an effect; the values of one parameter in several runs in one unit."""
    return [
        parameter(name, found, [p for other, p in parameters.items() if _base(other) == _base(name)])
        for name, found in parameters.items()
    ]


def amounts(
    result: Diagnosis,
    effect: Kind | None,
    where: str,
    parameters: Mapping[str, Parameter],
    intervals: bool = False,
) -> list[str]:
    """Each value of an effect (None: one that is not known here) as one says it: ``0.298 mm longer than drawn``, or by
    its name where no direction has a word: ``radial clearance 0.15 mm``; with its 95 % ``intervals`` on request.
    """
    out = []
    for key, found in parameters.items():
        way = _direction_word(result, effect, where, key, found.value)
        like = [p for other, p in parameters.items() if _base(other) == _base(key)]
        called, value, interval = parameter(key, _minus(found) if way and found.value < 0 else found, like)
        run = called.partition(" in run ")[1:] if "@" in key else ("", "")
        open_ended = found.low is None or found.high is None
        known = f" (95 %: {interval})" if intervals and (open_ended or found.low != found.high) else ""
        out.append((f"{value} {way}{''.join(run)}" if way else f"{called} {value}") + known)
    return out


def _direction_word(result: Diagnosis, effect: Kind | None, where: str, key: str, value: float) -> str:
    """What follows the size of a parameter of this sign: ``longer than drawn``; empty where no direction has a word."""
    known = next((p for p in effect.parameters if p.name == _base(key)), None) if effect else None
    if effect is None or known is None:
        return ""
    return known.less if effect.sense(result.mechanism, where) * value < 0 else known.more


def _minus(p: Parameter) -> Parameter:
    """A parameter of the other sign."""
    low, high = (None if end is None else -end for end in (p.high, p.low))
    return p.model_copy(update={"value": -p.value, "low": low, "high": high})


def errors_in_words(result: Diagnosis, effect: Effect) -> str:
    """The small errors of the rig that together would do as well in place of an effect, with their values."""
    said = []
    for error in effect.small_errors:
        values = ", ".join(amounts(result, VOCABULARY.get(error.name), error.where, error.parameters))
        said.append(f"{phrase(result, error.name, error.where)} ({values})")
    return enumerated(said)


def small_errors(result: Diagnosis, effect: Effect) -> str:
    """The same in a sentence; empty where there are none."""
    if not effect.small_errors:
        return ""
    errors, instead = errors_in_words(result, effect), phrase(result, effect.name, effect.where)
    return f"Small errors of the rig together would explain these data as well as {instead}: {errors}."


def _base(name: str) -> str:
    return name.partition("@")[0]


@dataclass(frozen=True)
class OwnValues:
    """The values that a parameter has in each run: ``called`` is what each run has of its own, ``reach`` from the
    smallest to the largest, and ``runs`` the value and interval in each.
    """

    called: str
    reach: str
    runs: tuple[Row, ...]

    def sentence(self, runs: int) -> str:
        """``each run has its own encoder zero, -1.7 to +3.6 deg``, where there are so many runs."""
        whose = (
            "each run has" if len(self.runs) >= runs else f"{in_words(len(self.runs))} of {in_words(runs)} runs have"
        )
        return f"{whose} {'its' if len(self.runs) >= runs else 'their'} own {self.called}, {self.reach}"


def own_values(result: Diagnosis, name: str, where: str, parameters: Mapping[str, Parameter]) -> OwnValues | None:
    """The values for each run of an effect that has such; None of any other."""
    found = {key.partition("@")[2]: p for key, p in parameters.items() if "@" in key}
    if len(found) < len(parameters):
        return None
    what = _base(next(iter(parameters)))
    unit, factor = _unit(what, tuple(found.values()))
    low, high = (factor * end(p.value for p in found.values()) for end in (min, max))
    less, more = (_direction_word(result, VOCABULARY.get(name), where, what, end) for end in (low, high))
    sensor = spoken(result, where) if name in VOCABULARY and VOCABULARY[name].place == "signal" else where
    called = ZEROS.get(name, name.replace("_", " ") + " of {}")
    called = called.format(sensor) + f" for {sensor}" * (result.mechanism.several and "{}" not in called)
    own = tuple((run, value, interval) for run, (_, value, interval) in zip(found, rows(parameters), strict=True))
    suffix = "" if unit == "1" else f" {unit}"
    if less == more:
        low, high = sorted((abs(low), abs(high))) if more else (low, high)
        return OwnValues(called, f"{plainly(low, 2)} to {plainly(high, 2)}{suffix} {more}".strip(), own)
    return OwnValues(called, f"{plainly(-low, 2)}{suffix} {less} to {plainly(high, 2)}{suffix} {more}", own)


def separation(text: str) -> tuple[str, str]:
    """The words of a ``would_separate`` and the ``[[run]]`` to copy from it; the latter may be empty."""
    lines = text.splitlines()
    start = next((i for i, line in enumerate(lines) if line.strip().startswith("[[run]]")), len(lines))
    end = start
    while end < len(lines) and (
        not lines[end].strip() or lines[end].strip().startswith(TOML_STARTS) or "=" in lines[end]
    ):
        end += 1
    words = " ".join(line.strip() for line in (*lines[:start], *lines[end:]) if line.strip())
    return words, "\n".join(lines[start:end]).strip()


def odds(likely: float | None, named: str) -> str:
    """The odds between the ``named`` effect (in words) and one that is ``likely`` times as likely: ``19 to 1 for
    clearance in joint B``, ``3.4 to 1 for it``, ``even``; empty where that is not known.
    """
    if likely is None:
        return ""
    if 0.95 < likely < 1.05:
        return "even"
    high, whom = (likely, "it") if likely > 1 else (1 / max(likely, 1e-300), named)
    return f"{plainly(high, 2) if high < 1000 else 'more than 1,000'} to 1 for {whom}"


# ------------------------------------------------------------------ data


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
    told = [
        capital(f"{in_words(len(fitted))} run{'s' * (len(fitted) > 1)} with {many}{each}, {samples:,} samples."),
        _noise_sentence([channel.noise_given for channel in records]),
    ]
    if kept:
        one = len(kept) == 1
        told.append(
            f"Run{'s' * (not one)} {enumerated(kept)} {'is' if one else 'are'} for validation: nothing was fitted to"
            f" {'it' if one else 'them'}."
        )
    return tuple(told)


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
    told = []
    for run in result.validation:
        before, after = (pooled(run, side) for side in ("before", "after"))
        what = f"Validation run {run.name}, which nothing was fitted to"
        if before is None or after is None:
            told.append(f"{what}: the engine could not simulate it {'before' if before is None else 'after'}.")
            continue
        told.append(f"{what}, differs by {plainly(before)} times the noise before and {plainly(after)} after.")
    return tuple(told)


def pooled(run: DiagnosedRun, side: Literal["before", "after"]) -> float | None:
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
        """Of the range."""
        rest = self.after if side == "after" else self.before
        return None if rest is None or not self.reach else rest / self.reach


def off(result: Diagnosis, run: DiagnosedRun, signal: str, side: Literal["before", "after"]) -> float | None:
    """How far a sensor is off in a run: root mean square, SI."""
    residual = result.residual(run, signal, side)
    known = residual[np.isfinite(residual)]
    return float(np.sqrt(np.mean(known**2))) if known.size else None


def reading(result: Diagnosis, signal: str) -> tuple[str, float]:
    """The one unit in which all that is said of how far a sensor is off is read, and the factor to it."""
    runs = [run for run in result.runs if signal in run.signals]
    found = [off(result, run, signal, side) for run in runs for side in ("before", "after")]
    return fitting(runs[0].signals[signal].unit if runs else "1", *found)


def off_by(result: Diagnosis, signal: str, value: float | None) -> str:
    """How far a sensor is off (SI), in the one unit of that sensor."""
    unit, factor = reading(result, signal)
    return DASH if value is None else f"{plainly(value * factor)} {unit}"


def in_units(result: Diagnosis) -> list[InUnits]:
    """Every sensor of the fitted runs."""
    found = []
    for signal, gap in result.gap.by_signal.items():
        values = [run.signals[signal].measured for run in result.fitted if signal in run.signals]
        known = np.concatenate(values) if values else np.zeros(0)
        known = known[np.isfinite(known)]
        reach = float(np.ptp(known)) if known.size else 0.0
        reach = min(reach, TURN) if result.wraps(signal) else reach
        found.append(InUnits(signal, gap.unit, gap.before, gap.after, reach))
    return found


def explained_to(result: Diagnosis, side: str = "after") -> str:
    """How near the model comes to the sensor that it misses most: ``explained to 1 % of the range: ...``; empty where
    that is not known.
    """
    worst = max(
        (sensor for sensor in in_units(result) if sensor.share(side) is not None),
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


# ------------------------------------------------------------------ places


def wrapped(result: Diagnosis) -> bool:
    """Whether the commanded crank angles are shown within one turn, because some run makes a whole one."""
    ends = [(run.crank_angle.min(), run.crank_angle.max()) for run in result.runs if not run.over_time]
    return any(high - low > TURN - 0.1 or low < -TURN or high > TURN for low, high in ends)


def span(result: Diagnosis, place: Located) -> str:
    """Where in its run a deviation is: ``at 237 to 330 deg, turn 13, 2.8 s``, or ``throughout the run``."""
    run = _run(result, place.run)
    low, high = sorted((place.crank_angle_from, place.crank_angle_to))
    if run is None:
        return f"at {_degrees(low)} to {_degrees(high)} deg"
    if place.every_turn:
        return "throughout the run" if high - low > MOST_OF_RUN * TURN else f"in every turn, {_turned(low, high)}"
    begin, end = _times(run, place)
    if end - begin >= MOST_OF_RUN * float(run.time[-1] - run.time[0]):
        return "throughout the run"
    if run.drive == "free":
        return f"from {plainly(begin, 4)} to {plainly(end, 4)} s, at {_degrees(low)} to {_degrees(high)} deg"
    if not _turns(result, run):
        return f"at {_degrees(low)} to {_degrees(high)} deg, {plainly(begin)} s"
    return _in_turns(run, place, begin, end)


def _in_turns(run: DiagnosedRun, place: Located, begin: float, end: float) -> str:
    """Where in a run of whole turns a deviation is, from ``begin`` to ``end`` (s)."""
    low, high = sorted((place.crank_angle_from, place.crank_angle_to))
    first, last = sorted((_turn(run, low + 1e-3), _turn(run, high - 1e-3)))
    if high - low >= TURN - 1e-3:
        turns = f"over turns {first} to {last}" if last > first else f"over turn {first}"
        return f"{turns}, {plainly(begin)} to {plainly(end)} s"
    turn = f", turn {_turn(run, place.crank_angle_from + 0.5 * _way_of(run) * 1e-3)}" if _several(run) else ""
    return f"{_turned(low, high)}{turn}, {plainly(begin)} s"


def _turned(low: float, high: float) -> str:
    """Between which angles of a turn a deviation is."""
    shift = TURN * math.floor(low / TURN + 1e-3)  # what is printed as 360 deg is the next turn's 0
    low, high = low - shift, high - shift
    high = high - TURN if high > TURN + 1e-3 else high
    return f"at {_degrees(low)} to {_degrees(high)} deg"


def _degrees(angle: float) -> str:
    return plainly(float(f"{math.degrees(angle):.1f}") + 0.0, 4 if abs(angle) < 1 else 3)


def _times(run: DiagnosedRun, place: Located) -> tuple[float, float]:
    """When a deviation begins and ends (s); where its file does not say, when the crank was there first."""
    if place.time_from is not None and place.time_to is not None:
        return place.time_from, place.time_to
    at = [int(np.argmin(np.abs(run.crank_angle - a))) for a in (place.crank_angle_from, place.crank_angle_to)]
    return float(run.time[min(at)]), float(run.time[max(at)])


def _turns(result: Diagnosis, run: DiagnosedRun) -> bool:
    """Whether angles of a run are told within one turn."""
    low, high = float(run.crank_angle.min()), float(run.crank_angle.max())
    return wrapped(result) or high - low > TURN - 0.1 or low < -TURN or high > TURN


def _several(run: DiagnosedRun) -> bool:
    """Whether a run makes more than one turn."""
    return float(np.ptp(run.crank_angle)) > TURN + 1e-3


def _way_of(run: DiagnosedRun) -> float:
    """1 where the crank's angle grows along a run, else -1."""
    return 1.0 if run.crank_angle[-1] >= run.crank_angle[0] else -1.0


def _turn(run: DiagnosedRun, angle: float) -> int:
    """Which turn of a run an angle (rad, continued) is in, 1 at its first sample; each ends where the angle is 0."""
    first = float(run.crank_angle[0]) + 1e-6 * _way_of(run)
    return abs(math.floor(angle / TURN) - math.floor(first / TURN)) + 1


def sentence(result: Diagnosis, place: Located) -> str:
    """A located deviation: ``follower angle in run forward is late by 0.6 mrad at 40 to 110 deg, turn 2, 1.3 s``."""
    alike = (other.size for other in result.located if other.signal == place.signal)
    unit, factor = fitting(place.unit, place.size, *alike)  # one unit for all that is said of a sensor
    much = f"{plainly(abs(place.size) * factor, 2)} {unit}"
    what = f"{spoken(result, place.signal)} in run {place.run} is {_direction(result, place)} by {much}"
    return f"{what} {span(result, place)}"


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
