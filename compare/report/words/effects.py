"""Effects at their places, and their parameters: ``clearance in joint B``, ``0.3 mm longer than drawn``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analytic.mechanism.one_line import enumerated, in_words
from compare.diagnose.effects.effect import Effect as Kind
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.diagnose.propose.laws import UNKNOWNS
from compare.quantities import MINUS, Quantity, fitting, number, plainly, quantities, shown
from compare.results.diagnosis import (
    Diagnosis,
    Effect,
    EffectPlace,
    Estimate,
    Proposed,
    Rival,
    SamePlace,
    TriedEffect,
)

PERCENT = {p.name for effect in VOCABULARY.values() for p in effect.parameters if p.percent}  # parameters read in %
OWN_OF_RUNS = {  # what each run has of its own where an effect has a value for each; {} is the sensor
    "encoder_offset": "encoder zero",
    "sensor_bias": "zero of the sensor for {}",
    "sensor_drift": "drift of the sensor for {}",
    "stamp_jitter": "jitter of the time stamps",
}
ParameterRow = tuple[str, str, str]  # a parameter's name, its value and its 95 % interval
RAREST = 1e-3  # probability that is still told by its number
REST = "rest"  # all sets that are not listed
SETS_LISTED = 8  # of effects, on a page
NEXT_TO_NOTHING = 1e-3  # of the largest in its unit: a value that is no finding where nothing is known of it
FLOOR_SHOWN = 1.05  # of the noise: a floor that is worth a sentence
NEARLY_ODDS, FAINT_ODDS = 0.2, 0.01  # odds below which a tie does nearly as well, or can only not be ruled out


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
    what = quantity(result, signal)
    return f"{what.place[3:]} {what.name}" if what.place.startswith("of ") else what.label


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


def unknown(result: Diagnosis, p: Proposed | SamePlace) -> str:
    """A proposal's unknown at its place as a noun."""
    if p.unknown == "torque" and isinstance(p, Proposed) and p.unit == "N":
        return f"force along joint {p.place}"
    return UNKNOWNS[p.unknown].format(spoken(result, p.place) if p.unknown == "error" else p.place)


def parameter(name: str, estimate: Estimate, like: Sequence[Estimate] = ()) -> ParameterRow:
    """A parameter's name, its value, and its 95 % interval, in one unit and to as many digits as the interval allows.

    The unit fits the values that it is ``like`` too.  A value of one run is called ``offset@run``.
    """
    value, low, high = estimate.value, estimate.low, estimate.high
    what, _, run = name.partition("@")
    unit, factor = _unit(what, (estimate, *like))
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
    words = words.replace("torque", "force") if estimate.unit == "N" else words  # of a slide
    return words + (f" in run {run}" if run else ""), say(value) + suffix, interval


def _unit(what: str, estimates: Sequence[Estimate]) -> tuple[str, float]:
    """The unit in which some parameters of one name are read, and the factor to it."""
    if what in PERCENT:
        return "%", 100.0
    return fitting(estimates[0].unit, *(v for p in estimates for v in (p.value, p.low, p.high)))


def rows(parameters: Mapping[str, Estimate]) -> list[ParameterRow]:
    """Every parameter of an effect; the values of one parameter in several runs in one unit."""
    found = []
    for name, estimate in parameters.items():
        words = parameter(name, estimate, [p for other, p in parameters.items() if _base(other) == _base(name)])
        found.append((words[0], "not known", words[2]) if _left_open(estimate, parameters) else words)
    return found


def _left_open(estimate: Estimate, parameters: Mapping[str, Estimate]) -> bool:
    """Whether the data say nothing of a value, and what is given for it is next to nothing."""
    sizes = [abs(p.value) for p in parameters.values() if p.unit == estimate.unit]
    return estimate.low is estimate.high is None and abs(estimate.value) < NEXT_TO_NOTHING * max(sizes)


def _base(name: str) -> str:
    return name.partition("@")[0]


def values_of(result: Diagnosis, effect: EffectPlace, intervals: bool = False) -> list[str]:
    """Each value of an effect as one says it: ``0.298 mm longer than drawn``, or by its name where no direction has a
    word: ``radial clearance 0.15 mm``; with its 95 % ``intervals`` on request.  Of what the data leave open, and that
    is next to nothing, only that it is.
    """
    kind, parameters, words = VOCABULARY.get(effect.name), _parameters(effect), []
    for key, estimate in parameters.items():
        way = _direction_word(result, kind, effect.where, key, estimate.value)
        like = [p for other, p in parameters.items() if _base(other) == _base(key)]
        called, value, interval = parameter(key, _minus(estimate) if way and estimate.value < 0 else estimate, like)
        run = called.partition(" in run ")[1:] if "@" in key else ("", "")
        open_ended = estimate.low is None or estimate.high is None
        if _left_open(estimate, parameters):
            words.append(f"{called} not known")
            continue
        known = f" (95 %: {interval})" if intervals and (open_ended or estimate.low != estimate.high) else ""
        words.append((f"{value} {way}{''.join(run)}" if way else f"{called} {value}") + known)
    return words


def _direction_word(result: Diagnosis, effect: Kind | None, where: str, key: str, value: float) -> str:
    """What follows the size of a parameter of this sign: ``longer than drawn``; empty where no direction has a word."""
    known = next((p for p in effect.parameters if p.name == _base(key)), None) if effect else None
    if effect is None or known is None:
        return ""
    return known.less if effect.sense(result.mechanism, where) * value < 0 else known.more


def _minus(p: Estimate) -> Estimate:
    """A parameter of the other sign."""
    low, high = (None if end is None else -end for end in (p.high, p.low))
    return p.model_copy(update={"value": -p.value, "low": low, "high": high})


@dataclass(frozen=True)
class OwnValues:
    """The values that a parameter has in each run: ``called`` is what each run has of its own, ``reach`` from the
    smallest to the largest, and ``runs`` the value and interval in each.  What is of the ``rig`` is one thing that
    changes, ``falling`` or ``rising`` (``trend``) from each run to the next, or neither.
    """

    called: str
    reach: str
    runs: tuple[ParameterRow, ...]
    rig: bool = False
    trend: str = ""

    @property
    def elsewhere(self) -> str:
        """What is done in a run that has no value, after "it": ``has the mean of these values``."""
        return "has the mean of these values" if self.rig else "was not applied, as there is no value for it"

    def sentence(self, runs: int) -> str:
        """``each run has its own encoder zero, -1.7 to +3.6 deg``, where there are so many runs; ``viscous friction in
        joint E differs from run to run, 3.1 to 4.4 mN.m.s/rad, falling``.
        """
        if self.rig:
            return f"{self.called} differs from run to run, {self.reach}" + (f", {self.trend}" if self.trend else "")
        whose = (
            "each run has" if len(self.runs) >= runs else f"{in_words(len(self.runs))} of {in_words(runs)} runs have"
        )
        return f"{whose} {'its' if len(self.runs) >= runs else 'their'} own {self.called}, {self.reach}"


def own_values(result: Diagnosis, effect: EffectPlace) -> OwnValues | None:
    """The values for each run of an effect that has such; None of any other."""
    parameters = _parameters(effect)
    by_run = {key.partition("@")[2]: p for key, p in parameters.items() if "@" in key}
    if not by_run or len(by_run) < len(parameters):
        return None
    kind, what = VOCABULARY.get(effect.name), _base(next(iter(parameters)))
    unit, factor = _unit(what, tuple(by_run.values()))
    low, high = (factor * end(p.value for p in by_run.values()) for end in (min, max))
    less, more = (_direction_word(result, kind, effect.where, what, end) for end in (low, high))
    sensor = spoken(result, effect.where) if kind is not None and kind.place == "signal" else effect.where
    name = OWN_OF_RUNS.get(effect.name, effect.name.replace("_", " ") + " of {}")
    name = name.format(sensor) + f" for {sensor}" * (result.mechanism.several and "{}" not in name)
    runs = tuple((run, value, interval) for run, (_, value, interval) in zip(by_run, rows(parameters), strict=True))
    rig = kind is not None and not kind.sensor
    if rig:
        name = phrase(result, effect.name, effect.where)
    trend = effect.repeats.trend if isinstance(effect, Effect) and effect.repeats else ""
    suffix = "" if unit == "1" else f" {unit}"
    if less == more:
        low, high = sorted((abs(low), abs(high))) if more else (low, high)
        return OwnValues(name, f"{plainly(low, 2)} to {plainly(high, 2)}{suffix} {more}".strip(), runs, rig, trend)
    return OwnValues(name, f"{plainly(-low, 2)}{suffix} {less} to {plainly(high, 2)}{suffix} {more}", runs, rig, trend)


def chance(probability: float) -> str:
    """A probability as people say it: ``19 in 20``, ``1 in 500``."""
    rare = min(probability, 1 - probability)
    if rare < RAREST:
        return (
            f"more than {1 / RAREST - 1:.0f} in {1 / RAREST:.0f}"
            if probability > 0.5
            else f"less than 1 in {1 / RAREST:.0f}"
        )
    of = round(1 / rare) if rare < 0.3 else 10
    return f"{round(probability * of)} in {of}"


def how_sure(effect: EffectPlace) -> str:
    """How sure it is that a named effect is there, in a sentence; empty where that is not known."""
    if not isinstance(effect, Effect) or effect.probability is None:
        return ""
    return f"Its chance of being there: {chance(effect.probability)}."


def competing(result: Diagnosis) -> list[tuple[str, str]]:
    """The sets of effects that may be what is missing, the likeliest first, each with its chance, and all others."""
    listed = [each for each in result.sets if each.effects != (REST,)][:SETS_LISTED]
    rows = [
        (enumerated([called(result, key) for key in each.effects]) or "nothing", chance(each.probability))
        for each in listed
        if each.probability >= RAREST
    ]
    rest = 1 - sum(each.probability for each in listed[: len(rows)])
    return [*rows, ("any other set of effects", chance(rest))] if rows else []


def floor_means(result: Diagnosis) -> str:
    """What a noise floor above the noise is, in a sentence; empty where it is the noise."""
    if result.gap.noise_floor < FLOOR_SHOWN:
        return ""
    floor = plainly(result.gap.noise_floor)
    return f"Noise and the small errors that careful work leaves on every rig would make {floor} of these sensors."


def headline(result: Diagnosis, effect: EffectPlace) -> str:
    """What is said of an effect in one line: the phrase, or of one with values for each run that and their range."""
    own = own_values(result, effect)
    return own.sentence(len(result.fitted)) if own else phrase(result, effect.name, effect.where)


def of_effect(effect: EffectPlace) -> list[ParameterRow]:
    """Name, value and interval of each parameter; nothing for an effect that is only tied."""
    return rows(_parameters(effect))


def _parameters(effect: EffectPlace) -> Mapping[str, Estimate]:
    return effect.parameters if isinstance(effect, Effect | TriedEffect) else {}


def rival_odds(result: Diagnosis, group: Sequence[EffectPlace], place: EffectPlace) -> str:
    """The odds between the first of a tie and another of it, in words; empty where they are not known."""
    likely = place.odds if isinstance(place, Rival) else None
    return odds(likely, phrase(result, group[0].name, group[0].where))


def rival_words(result: Diagnosis, group: Sequence[EffectPlace], place: EffectPlace) -> str:
    """How an effect that is only tied stands against the first of its group, with the odds where they are known."""
    chances = rival_odds(result, group, place)
    likely = place.odds if isinstance(place, Rival) else None
    if likely is not None and likely < FAINT_ODDS:
        return f"Cannot be ruled out: odds {chances}."
    nearly = "nearly " * (likely is not None and likely < NEARLY_ODDS)
    return f"Explains these data {nearly}as well{f': odds {chances}' if chances else ''}."


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
