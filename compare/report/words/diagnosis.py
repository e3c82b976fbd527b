"""What a diagnosis's page and text say: what is tied, what takes the gap away, what was tried, what to do next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from analytic.mechanism.one_line import enumerated
from compare.diagnose.effects.vocabulary import VOCABULARY
from compare.quantities import plainly, setting
from compare.report.words.effects import called, headline, own_values, phrase, spoken, unknown, values_of
from compare.report.words.measured import remaining
from compare.results.diagnosis import Diagnosis, DiagnosisVerdict, Effect, EffectPlace, EngineGaps, TriedEffect

TOML_STARTS = ("[", "#")
LEAST_BAR = 0.001  # of the squared gap: a smaller share of everything is no bar
SIGMA = "\N{GREEK SMALL LETTER SIGMA}"
DIAGNOSIS_SIGNS: dict[DiagnosisVerdict, str] = {
    "no gap": "✓",
    "explained": "✓",
    "partly explained": "≈",
    "ambiguous": "?",
    "unexplained": "✗",
}
STATUS = {
    "named": "named",
    "tied": "tied",
    "not needed": "not named",
    "not physical": "not physical",
    "invisible": "not visible in these data",
    "excluded": "ruled out",
}
# what a word means, for who does not know it; each stands where the word is first used
GAP_MEANS = (
    "The gap is how far measured and simulated are apart in multiples of the sensors' noise (root mean square over all"
    " samples and signals). 1 means that nothing but noise is left."
)
SIGMA_MEANS = (
    f"{SIGMA} (sigma) is the noise of a sensor, one standard deviation: about two readings in three of a still signal"
    f" lie within ±1 {SIGMA}, nearly all within ±3 {SIGMA}."
)
SURE_MEANS = (
    "How sure: how many times larger the deviation is than chance makes it in a stretch of that length."
    f" Below 3 {SIGMA} it may be luck, beyond 5 {SIGMA} it is not."
)
HELD_OUT_MEANS = (
    "Held-out data are a part of the samples that is left out while the values are fitted, and used to check them;"
    " every part is left out once."
)
SETS_MEAN = (
    "Each row is one answer to what is missing, weighed against all others: how well it explains the data, how many"
    " values it needs for that, and how usual such effects and sizes are before anything is measured. 19 in 20: of 20"
    " rigs with such data, 19 would lack just this. An unknown at a place stands for anything that has no name."
)
TIE_MEANS = "A tie: each of these explains the data about as well as the others, and the data cannot say which it is."
PARTS_MEANS = (
    "By how many sigma a run would part them: how many times larger their difference is there than the noise; 5 or more"
    " decides. To copy into measured.toml:"
)
INTERVAL_MEANS = "95 %: in 95 of 100 repetitions of the measurement the interval would hold the true value."
NOTHING_TRIED = "Nothing else that was tried takes away a part of the gap that would be worth listing."


def ties(result: Diagnosis) -> list[list[EffectPlace]]:
    """The named effects, each with those that explain the data as well as it does; nobody is listed twice.

    The first of each group is an effect with its numbers.
    """
    full = {effect.key: effect for effect in result.effects}
    groups: list[list[EffectPlace]] = []
    listed: set[str] = set()
    for key, effect in full.items():
        if key in listed:
            continue
        groups.append([effect, *(full.get(other.key, other) for other in effect.ambiguous_with)])
        listed |= {key, *(other.key for other in effect.ambiguous_with)}
    return groups


@dataclass(frozen=True)
class Bar:
    """A step from the gap before to the gap after: a share of the squared gap, and where its bar begins; both in per
    cent.
    """

    label: str
    kind: str  # before, sensor, rig or rest
    share: float
    left: float


def waterfall(result: Diagnosis) -> list[Bar]:
    """The gap before, what each named effect takes of it, added as they are listed, and what remains; nothing where no
    share is known.
    """
    effects = [effect for effect in result.effects if effect.share and effect.share > 0]
    if not effects:
        return []
    bars, left = [Bar("before: the nominal model", "before", 100.0, 0.0)], 100.0
    for effect in effects:
        share = min(100 * (effect.share or 0.0), left)
        left -= share
        bars.append(Bar(headline(result, effect), effect.kind, share, left))
    return [*bars, Bar("what remains" + _floor(result), "rest", left, 0.0)]


def _floor(result: Diagnosis) -> str:
    if result.gap.before <= 1:
        return ""
    noise = 100 / result.gap.before**2
    return f" (noise alone would be {plainly(noise, 2)} %)" if noise >= 0.05 else ""


def percent(share: float) -> str:
    """A share of the squared gap: ``4 %``, ``below 0.1 %``."""
    return f"{plainly(100 * share, 2)} %" if abs(share) >= LEAST_BAR else f"below {100 * LEAST_BAR:g} %"


def attempts(result: Diagnosis) -> list[tuple[str, str, str, str, str]]:
    """What was tried and is neither named nor tied, best first: the effect, its values, its share, the gap without and
    with it, and what it failed.  Beyond the best one only those that change the gap.
    """
    tied = {other.key for effect in result.effects for other in effect.ambiguous_with}
    rivals = [attempt for attempt in result.attempts if attempt.key not in tied]
    return [_attempt(result, attempt) for k, attempt in enumerate(rivals) if k == 0 or len(set(_gaps(attempt))) > 1]


def _attempt(result: Diagnosis, attempt: TriedEffect) -> tuple[str, str, str, str, str]:
    own = own_values(result, attempt)
    values = own.reach if own else ", ".join(values_of(result, attempt))
    share = "" if attempt.share is None else percent(attempt.share)
    return phrase(result, attempt.name, attempt.where), values, share, " → ".join(_gaps(attempt)), attempt.failed


def _gaps(attempt: TriedEffect) -> tuple[str, str]:
    """The gap without and with it, as it is printed."""
    return plainly(attempt.gap_before), plainly(attempt.gap_after)


def advice(group: Sequence[EffectPlace]) -> tuple[str, str]:
    """What would tell a group's effects apart: in words, and as the ``[[run]]`` to copy; each may be empty."""
    return separation(group[0].would_separate if isinstance(group[0], Effect) else "")


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


def others(count: int) -> str:
    """How many places are not listed."""
    return f"and in {count} other place{'s' if count > 1 else ''}"


def unsought(result: Diagnosis) -> str:
    """Which effects of the vocabulary were not looked for, in a sentence; empty where all of them were."""
    here = {each.name for each in result.candidates}
    names = [name.replace("_", " ") for name in VOCABULARY if name not in here]
    known = f"Not looked for, as nothing here has, reads or does what it takes: {enumerated(names)}."
    return known if here and names else ""


def next_steps(result: Diagnosis) -> list[str]:
    """What the person at the rig does now, a sentence each."""
    steps = [
        f"Check the data of run {fault.run}, {spoken(result, fault.signal)}: {fault.text}."
        for fault in result.faults
        if fault.kind != "rest"  # which no sensor is to blame for
    ]
    if result.verdict == "no gap":
        return [*steps, "Nothing has to be added: the model explains these data down to their noise."]
    for group in ties(result):
        if len(group) > 1:
            words = advice(group)[0].rstrip(":.")
            tied = " and ".join(phrase(result, effect.name, effect.where) for effect in group)
            steps.append(f"Separate {tied}: {words or 'no run of these sensors can'}.")
    left_open = [p for p in result.proposed if not p.adopted]
    doubtful = {key for p in left_open for key in p.replaces}
    adopted = {f"{p.effect}@{p.place}" for p in result.proposed if p.adopted}
    for p in left_open:
        instead = enumerated([called(result, key) for key in p.replaces])
        steps.append(
            f"Look first for what is proposed: {unknown(result, p)}{f', in place of {instead}' if instead else ''}."
        )
    steps += [f"Look at the rig for what was adopted: {unknown(result, p)}." for p in result.proposed if p.adopted]
    if result.verdict in ("explained", "partly explained"):
        steps += [
            f"Confirm {phrase(result, e.name, e.where)} at the rig: expect {_values(result, e)}."
            for e in result.effects
            if f"{e.name}@{e.where}" not in doubtful | adopted
        ]
        if result.explained != result.mechanism and not doubtful:
            steps.append("Use explained.toml in place of the nominal mechanism.")
    if result.verdict in ("partly explained", "unexplained"):
        left = remaining(result)
        steps += [f"Look for what this program does not know: {rest}." for rest in list(left.values())[:3]]
    return steps


def _values(result: Diagnosis, effect: Effect) -> str:
    own = own_values(result, effect)
    return own.reach if own else ", ".join(values_of(result, effect))


def simulated_by(result: Diagnosis) -> str:
    """Which engine the gaps are of; where it could not simulate the explanation, that the gap after is not."""
    name = f"{result.simulator.name} {result.simulator.version}".strip()
    failed = any(engine.name == result.simulator.name and engine.skipped for engine in result.engines)
    return f"{name}, after: the analytic model, as {result.simulator.name} failed" if failed else name


def remark(engine: EngineGaps) -> str:
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
        for name in dict.fromkeys(name for numbers in engine.settings.values() for name in numbers):
            values = {run: setting(numbers.get(name)) for run, numbers in engine.settings.items()}
            said = ", ".join(f"{value} in {run}" for run, value in values.items())
            alike = len(set(values.values())) == 1
            rows.append((engine.name, name.replace("_", " "), next(iter(values.values())) if alike else said))
    return rows
