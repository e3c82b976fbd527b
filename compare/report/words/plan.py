"""A plan in words: what to do, how often an effect would be told, and what would be taken for what."""

from __future__ import annotations

import math

from analytic.mechanism.one_line import capital, count, enumerated
from compare.diagnose.posterior.prior import CREDIBLE
from compare.quantities import amount, plainly, quantities
from compare.report.words.effects import parameter
from compare.report.words.preview import called
from compare.results.diagnosis import EffectPlace, Estimate
from compare.results.plan import CombinedEffect, Foretold, Plan, PlannedEffect, PlannedRun, PlannedSensor, PlanStep

OF = 20  # cases, of which a probability is said
LISTED = 4  # effects of a group that are named where there is little room
UNSEEN, SENSOR = "too small to be seen", "a fault of a sensor"


def in_twentieths(share: float) -> str:
    """A share of cases in twentieths: ``19 in 20``."""
    times = round(OF * share)
    return {0: "hardly ever", OF: "nearly always"}.get(times, f"{times} in {OF}")


def cases(share: float) -> str:
    """The same within a sentence: ``in 19 of 20 cases``."""
    times = round(OF * share)
    return {0: "hardly ever", OF: "nearly always"}.get(times, f"in {times} of {OF} cases")


def headline(result: Plan) -> str:
    """What to do, and what that brings, in two sentences."""
    sensors = enumerated([spoken(result, sensor.signal) for sensor in result.used])
    bought = [spoken(result, sensor.signal) for sensor in result.used if sensor.price]
    buy = f" Buy the sensor{'s' * (len(bought) > 1)} for {enumerated(bought)}." if bought else ""
    return (
        f"Make {count(len(result.runs), 'run')} and read {sensors}.{buy} If one thing of the rig is then missing from"
        f" the model and is of its usual size, the data name it {cases(result.told_if_usual)}; of any size, small ones"
        f" among them, {cases(result.told)}."
    )


def spoken(result: Plan, signal: str) -> str:
    """A signal as one says it: ``the angle of coupler``."""
    return quantities(result.mechanism)[signal].label


def phrase(result: Plan, place: EffectPlace) -> str:
    """An effect at its place."""
    return called(result, place.name, place.where)


def speed(run: PlannedRun) -> str:
    """How a run turns: ``60 rpm in reverse``."""
    return f"{plainly(abs(run.speed) * 30 / math.pi, 4)} rpm{' in reverse' if run.speed < 0 else ''}"


def loads(run: PlannedRun) -> str:
    """What a run carries."""
    if run.loads is None:
        return "as drawn"
    each = [f"{load.body} {plainly(math.hypot(*load.force))} N" for load in run.loads]
    return f"{run.loading}: {', '.join(each)}" if each else f"{run.loading}: none"


def sampling(run: PlannedRun) -> str:
    """How long a run is, and how often it is sampled."""
    step = run.duration / max(run.samples - 1, 1)
    return f"{plainly(run.duration, 3)} s, {run.samples} samples, one every {amount(step, 's')}"


def sensor_row(result: Plan, sensor: PlannedSensor) -> tuple[str, str, str, str]:
    """A sensor: what it reads, its noise, its price, whether it is used."""
    price = plainly(sensor.price) if sensor.price else "there already"
    return spoken(result, sensor.signal), amount(sensor.noise, sensor.unit), price, "yes" if sensor.used else "no"


def step_row(result: Plan, step: PlanStep) -> tuple[str, str, str, str]:
    """What one more run or sensor brings."""
    name = step.name if step.kind == "run" else f"the sensor for {spoken(result, step.name)}"
    return name, plainly(step.price), f"{step.bits:.2f}", in_twentieths(step.told)


def effect_row(result: Plan, effect: PlannedEffect) -> tuple[str, str, str, str]:
    """An effect: how often it is named at its usual size, what else it is taken for, and how well it is known then."""
    others = [f"{phrase(result, other)} ({in_twentieths(other.share)})" for other in effect.instead]
    for share, what in ((effect.of_sensor, SENSOR), (effect.unseen, UNSEEN)):
        others += [f"{what} ({in_twentieths(share)})"] if share >= CREDIBLE else []
    return (
        capital(phrase(result, effect)),
        in_twentieths(effect.told_if_usual),
        "; ".join(others) or "nothing else",
        "; ".join(precision(name, p) for name, p in effect.parameters.items()) or "it is not foretold how well",
    )


def precision(name: str, p: Foretold) -> str:
    """A parameter of its usual size with how well it would be known, beside errors of careful work in brackets:
    ``length error 1.2 mm ± 0.2 µm (50 µm)``.
    """
    words, value, _ = parameter(name, Estimate(value=p.value, unit=p.unit, low=None, high=None))
    alone, careful = half(p.low, p.high), half(p.careful_low, p.careful_high)
    if alone == 0:
        return f"{words} {value}"
    if alone is None:
        return f"{words} {value}, not known by these data"
    beside = f" ({amount(careful, p.unit, 2)})" if careful is not None else " (open)"
    return f"{words} {value} ± {amount(alone, p.unit, 2)}{beside}"


def half(low: float | None, high: float | None) -> float | None:
    """Half of an interval."""
    return None if low is None or high is None else (high - low) / 2


def group(result: Plan, places: tuple[EffectPlace, ...], most: int | None = None) -> str:
    """Effects that may be taken for each other, in a sentence that names so many of them."""
    told = {e.key: e.told_if_usual for e in result.effects}
    right = sum(told[place.key] for place in places) / len(places)
    names = [phrase(result, place) for place in places[:most]]
    names += [f"{len(places) - len(names)} more"] if len(places) > len(names) else []
    return f"{capital(enumerated(names))}: if one of them is missing, the right one is named {cases(right)}."


def combination(result: Plan, parts: tuple[CombinedEffect, ...]) -> str:
    """Effects that hide each other, with the ratio in which they do."""
    first, *others = (
        f"{phrase(result, part)} ({part.parameter.replace('_', ' ')} {amount(part.value, part.unit, 3, True)})"
        for part in parts
    )
    return capital(f"{first} with {enumerated(others)}")


def notes(result: Plan) -> list[str]:
    """What the numbers are of."""
    spent = f"{plainly(result.spent)} of {plainly(result.budget)} spent"
    return [
        f"{count(len(result.effects), 'effect')} of the rig that may be missing, chosen from"
        f" {count(result.possible_runs, 'run')}; {spent}; {result.bits:.2f} of {result.possible_bits:.2f} bits of what"
        " there is to tell",
        *(f"taken as given, {each}" for each in result.taken),
    ]
