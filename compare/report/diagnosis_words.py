"""A diagnosis in an engineer's words: names of effects at their places, what is tied, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence

from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.quantities import number, setting
from compare.results.diagnosis import Diagnosis, Effect, Engine, Located, Place
from compare.results.sentences import parameter, separation, spoken

SIGMA = "\N{GREEK SMALL LETTER SIGMA}"


def phrase(result: Diagnosis, name: str, where: str) -> str:
    """An effect at its place: ``clearance in joint B``; one outside the vocabulary by its own name."""
    effect = VOCABULARY.get(name)
    if effect is None:
        return f"{name.replace('_', ' ')} at {where}"
    return effect.called(spoken(result, where) if effect.place == "signal" else where)


def named(result: Diagnosis, key: str) -> str:
    """``joint_clearance@B`` in words."""
    name, _, where = key.partition("@")
    return phrase(result, name, where)


def worst_first(result: Diagnosis) -> list[Located]:
    """Located deviations, the strongest first."""
    return sorted(result.located, key=lambda place: -place.sigmas)


def ties(result: Diagnosis) -> list[list[Place]]:
    """The named effects, each with those that explain the data as well as it does; nobody is listed twice.

    The first of each group is an effect with its numbers.
    """
    full = {effect.key: effect for effect in result.effects}
    groups: list[list[Place]] = []
    listed: set[str] = set()
    for key, effect in full.items():
        if key in listed:
            continue
        groups.append([effect, *(full.get(other.key, other) for other in effect.ambiguous_with)])
        listed |= {key, *(other.key for other in effect.ambiguous_with)}
    return groups


def advice(group: Sequence[Place]) -> tuple[str, str]:
    """What would tell a group's effects apart: in words, and as the ``[[run]]`` to copy; each may be empty."""
    return separation(group[0].would_separate if isinstance(group[0], Effect) else "")


def next_steps(result: Diagnosis) -> list[str]:
    """What the person at the rig does now, a sentence each."""
    steps = [
        f"Check the data of run {fault.run}, {spoken(result, fault.signal)}: {fault.text}." for fault in result.faults
    ]
    if result.verdict == "no gap":
        return [*steps, "Nothing has to be added: the model explains these data down to their noise."]
    for group in ties(result):
        if len(group) > 1:
            words = advice(group)[0].rstrip(":.")
            tied = " and ".join(phrase(result, effect.name, effect.where) for effect in group)
            steps.append(f"Separate {tied}: {words or 'no run of these sensors can'}.")
    if result.verdict in ("explained", "partly explained"):
        steps += [f"Confirm {phrase(result, e.name, e.where)} at the rig: expect {_values(e)}." for e in result.effects]
        if result.explained != result.mechanism:
            steps.append("Use explained.toml in place of the nominal mechanism.")
    if result.verdict in ("partly explained", "unexplained"):
        steps += [f"Look for what is outside the vocabulary: {rest}." for rest in remaining(result)[:3]]
    return steps


def _values(effect: Effect) -> str:
    return ", ".join(f"{name} {value}" for name, value, _ in (parameter(*item) for item in effect.parameters.items()))


def remaining(result: Diagnosis) -> list[str]:
    """The signals whose gap is still above the noise floor, the largest first."""
    floor = 1.1 * result.gap.noise_floor
    rows = [
        (channel.gap_after, run.name, name)
        for run in result.runs
        for name, channel in run.signals.items()
        if channel.gap_after is not None and channel.gap_after > floor
    ]
    return [
        f"{spoken(result, signal)} in run {run} still has a gap of {number(gap)}"
        for gap, run, signal in sorted(rows, reverse=True)
    ]


def simulated_by(result: Diagnosis) -> str:
    """Which engine the gaps are of; where it could not simulate the explanation, that the gap after is not."""
    name = f"{result.simulator.name} {result.simulator.version}".strip()
    failed = any(engine.name == result.simulator.name and engine.skipped for engine in result.engines)
    return f"{name}, after: the analytic model, as {result.simulator.name} failed" if failed else name


def remark(engine: Engine) -> str:
    """What has to be known of an engine's numbers: that it has none, or what it lacks."""
    if engine.skipped:
        return f"skipped: {engine.skipped}"
    if not engine.added:
        return ""
    return f"has no {', '.join(engine.added)}: got the difference that the analytic model makes of it"


def settings(result: Diagnosis) -> list[tuple[str, str, str]]:
    """Engine, setting and value of every number with which an engine was set; one that differs between runs is said for
    each.
    """
    rows = []
    for engine in result.engines:
        for name in dict.fromkeys(name for found in engine.settings.values() for name in found):
            values = {run: setting(found.get(name)) for run, found in engine.settings.items()}
            said = ", ".join(f"{value} in {run}" for run, value in values.items())
            alike = len(set(values.values())) == 1
            rows.append((engine.name, name.replace("_", " "), next(iter(values.values())) if alike else said))
    return rows
