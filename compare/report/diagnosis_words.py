"""A diagnosis in an engineer's words: units that fit a number, names of effects and places, and the sentences about
them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from compare.report.quantities import DASH, MINUS, Quantity, number, quantities, setting, shown

Result = Mapping[str, Any]
TURN = math.tau
SIGMA = "\N{GREEK SMALL LETTER SIGMA}"
READ = {  # SI unit -> (least size, unit that is read from there on, factor), largest first
    "rad": ((0.05, "deg", math.degrees(1.0)), (1e-5, "mrad", 1e3), (0.0, "µrad", 1e6)),
    "rad/s": ((0.1, "rad/s", 1.0), (0.0, "mrad/s", 1e3)),
    "m": ((1e-4, "mm", 1e3), (0.0, "µm", 1e6)),
    "s": ((1.0, "s", 1.0), (1e-4, "ms", 1e3), (0.0, "µs", 1e6)),
    "kg": ((0.1, "kg", 1.0), (0.0, "g", 1e3)),
    "N": ((0.1, "N", 1.0), (0.0, "mN", 1e3)),
    "N.m": ((0.01, "N·m", 1.0), (0.0, "mN·m", 1e3)),
    "N.m.s/rad": ((0.01, "N·m·s/rad", 1.0), (0.0, "mN·m·s/rad", 1e3)),
    "Pa": ((1e9, "GPa", 1e-9), (1e6, "MPa", 1e-6), (0.0, "Pa", 1.0)),
}
EFFECTS = {  # what a person calls an effect, and what it means; {} is where it is
    "gravity": ("gravity", "gravity acts on the linkage"),
    "payload": ("a payload on the {}", "a payload rides on the {}"),
    "com_offset": ("an offset centre of mass of the {}", "the centre of mass of the {} is off"),
    "moment_of_inertia": ("an error in the moment of inertia of the {}", "the moment of inertia of the {} is off"),
    "link_length": ("an error in the length of the {}", "the {} is not as long as thought"),
    "pivot_position": ("a displaced ground pivot {}", "the ground pivot {} is not where it is thought to be"),
    "joint_clearance": ("clearance in joint {}", "joint {} has clearance"),
    "coulomb_friction": ("Coulomb friction in joint {}", "joint {} has dry friction"),
    "viscous_friction": ("viscous friction in joint {}", "joint {} has viscous friction"),
    "joint_spring": ("a spring in joint {}", "a spring acts in joint {}"),
    "external_force": ("an external force on the {}", "an unknown force acts on the {}"),
    "load_torque": ("a load torque on the {}", "an unknown torque acts on the {}"),
    "link_flexibility": ("flexible links", "the links bend"),
    "drive_compliance": ("a compliant drive", "the drive is springy"),
    "speed_ripple": ("a ripple of the drive's speed", "the drive turns unevenly"),
    "encoder_offset": ("an offset of the encoder for {}", "the encoder {} has an offset"),
    "sensor_bias": ("a bias of the sensor for {}", "the sensor {} has a bias"),
    "sensor_gain": ("a gain error of the sensor for {}", "the sensor {} has a wrong gain"),
    "sensor_delay": ("a delay of the sensor for {}", "the sensor {} is late"),
    "sensor_frame": ("a turned load cell at joint {}", "the load cell at {} is mounted turned"),
    "clock_offset": ("a clock offset of run {}", "the clock of run {} is off against its command"),
}
ON_SIGNALS = {"encoder_offset", "sensor_bias", "sensor_gain", "sensor_delay"}
TOML_STARTS = ("[", "#")


def fitting(unit: str, *values: float | None) -> tuple[str, float]:
    """The unit in which the largest of some SI values is read, and the factor to it; a unit without a choice stays."""
    size = max((abs(v) for v in values if v is not None and math.isfinite(v)), default=0.0)
    choices = READ.get(unit)
    if choices is None:
        return unit.replace(".", "·"), 1.0
    return next((name, factor) for least, name, factor in choices if size >= least)


def amount(value: float | None, unit: str, digits: int = 3, sign: bool = False) -> str:
    """An SI value in the unit that fits it: ``0.6 mrad``."""
    if value is None:
        return DASH
    name, factor = fitting(unit, value)
    return number(value * factor, digits, sign) + ("" if name == "1" else f" {name}")


def quantity(result: Result, signal: str) -> Quantity:
    """The quantity of a signal; one that the mechanism does not have (a person's own sensor) goes by its own name."""
    known = quantities(result["mechanism"])
    if signal in known:
        return known[signal]
    unit = next((run["signals"][signal]["unit"] for run in result["runs"] if signal in run["signals"]), "1")
    return Quantity(signal, signal, "", "", *shown(unit))


def spoken(result: Result, signal: str) -> str:
    """A signal as one says it: ``follower angle``, ``reaction x at B``."""
    found = quantity(result, signal)
    return f"{found.place[3:]} {found.name}" if found.place.startswith("of ") else found.label


def phrase(result: Result, name: str, where: str) -> str:
    """An effect at its place: ``clearance in joint B``; one outside the vocabulary by its own name."""
    if name not in EFFECTS:
        return f"{name.replace('_', ' ')} at {where}"
    return EFFECTS[name][0].format(spoken(result, where) if name in ON_SIGNALS else where)


def says(name: str, where: str) -> str:
    """What an effect at a place means: ``joint B has clearance``."""
    return EFFECTS[name][1].format(where) if name in EFFECTS else f"{name.replace('_', ' ')} at {where}"


def named(result: Result, key: str) -> str:
    """``joint_clearance@B`` in words."""
    name, _, where = key.partition("@")
    return phrase(result, name, where)


def parameter(name: str, found: Mapping[str, Any]) -> tuple[str, str, str]:
    """A parameter's name, its value, and its 95 % interval, in one unit and to as many digits as the interval allows.

    A value of one run is called ``offset@run``.
    """
    value, low, high = found["value"], found["low"], found["high"]
    unit, factor = fitting(found["unit"], value, low, high)
    if name.partition("@")[0] == "gain_error":
        unit, factor = "%", 100.0
    what, _, run = name.partition("@")
    half = 0.5 * abs(high - low) * factor if low is not None and high is not None else 0.0
    decimals = 1 - math.floor(math.log10(half * (1 + 1e-9))) if half > 0 else None

    def say(v: float) -> str:
        if decimals is None or not 0 <= decimals <= 6:
            return number(v * factor, 4)
        return f"{v * factor + 0.0:.{decimals}f}".replace("-", MINUS)

    suffix = "" if unit == "1" else f" {unit}"
    interval = f"{say(low)} to {say(high)}{suffix}" if low is not None and high is not None else "not known"
    return what.replace("_", " ") + (f" in run {run}" if run else ""), say(value) + suffix, interval


def over_time(run: Mapping[str, Any]) -> bool:
    """Whether a run is shown over time: its crank does not turn as commanded."""
    return bool(run["drive"] != "speed")


def wrapped(result: Result) -> bool:
    """Whether the commanded crank angles are shown within one turn, because some run makes a whole one."""
    found = [run["crank_angle"] for run in result["runs"] if not over_time(run) and run["crank_angle"]]
    ends = [(min(angles), max(angles)) for angles in found]
    return any(high - low > TURN - 0.1 or low < -TURN or high > TURN for low, high in ends)


def span(result: Result, place: Mapping[str, Any]) -> str:
    """Where on the crank a deviation is: ``between 40 and 110 deg``."""
    low, high = sorted((place["crank_angle_from"], place["crank_angle_to"]))
    if high - low >= TURN - 1e-3:
        return "over the whole turn"
    run = _run(result, place["run"])
    if wrapped(result) and (run is None or not over_time(run)):
        shift = TURN * math.floor(low / TURN + 1e-3)  # what is printed as 360 deg is the next turn's 0
        low, high = low - shift, high - shift
    first, last = (number(float(f"{math.degrees(angle):.1f}") + 0.0, 4) for angle in (low, high))
    return f"between {first} and {last} deg"


def sentence(result: Result, place: Mapping[str, Any]) -> str:
    """A located deviation: ``follower angle is late by 0.6 mrad between 40 and 110 deg in run slow-forward``."""
    what = (
        f"{spoken(result, place['signal'])} is {_direction(result, place)} by"
        f" {amount(abs(place['size']), place['unit'], 2)}"
    )
    return f"{what} {span(result, place)} in run {place['run']}"


def _direction(result: Result, place: Mapping[str, Any]) -> str:
    """``late`` or ``early`` of an angle that moves one way there, otherwise ``too high`` or ``too low``; as in the
    samples.
    """
    run = _run(result, place["run"])
    signal = run["signals"].get(place["signal"]) if run else None
    if run is None or signal is None:
        return "too high" if place["size"] > 0 else "too low"
    low, high = sorted((place["crank_angle_from"], place["crank_angle_to"]))
    inside = [i for i, angle in enumerate(run["crank_angle"]) if low <= angle <= high]
    inside = inside or [
        i for i, angle in enumerate(run["crank_angle"]) if (angle - low) % TURN <= high - low
    ]  # said of another turn
    above = place["size"] > 0
    way = _way(signal["before"], inside) if quantity(result, place["signal"]).name == "angle" else 0
    if way:
        return "early" if above == (way > 0) else "late"
    return "too high" if above else "too low"


def _way(values: Sequence[float | None], inside: Sequence[int]) -> int:
    """1 or -1 if the values rise or fall at nearly all of these samples, 0 if they do both."""
    pairs = [(values[i], values[i + 1]) for i in inside if i + 1 < len(values)]
    steps = [b - a for a, b in pairs if a is not None and b is not None]
    rising = sum(step > 0 for step in steps)
    if not steps or len(steps) * 0.05 < rising < len(steps) * 0.95:
        return 0
    return 1 if 2 * rising > len(steps) else -1


def _run(result: Result, name: str) -> Mapping[str, Any] | None:
    return next((run for run in result["runs"] if run["name"] == name), None)


def worst_first(result: Result) -> list[Mapping[str, Any]]:
    """Located deviations, the strongest first."""
    return sorted(result["located"], key=lambda place: -place["sigmas"])


def ties(result: Result) -> list[list[Mapping[str, Any]]]:
    """The named effects, each with those that explain the data as well as it does; nobody is listed twice."""
    full = {(effect["name"], effect["where"]): effect for effect in result["effects"]}
    groups: list[list[Mapping[str, Any]]] = []
    listed: set[tuple[str, str]] = set()
    for key, effect in full.items():
        if key in listed:
            continue
        others = [(other["name"], other["where"]) for other in effect["ambiguous_with"]]
        groups.append([effect, *(full.get(other, {"name": other[0], "where": other[1]}) for other in others)])
        listed |= {key, *others}
    return groups


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


def next_steps(result: Result) -> list[str]:
    """What the person at the rig does now, a sentence each."""
    verdict = result["verdict"]
    steps = [
        f"Check the data of run {fault['run']}, {spoken(result, fault['signal'])}: {fault['text']}."
        for fault in result["faults"]
    ]
    if verdict == "no gap":
        return [*steps, "Nothing has to be added: the model explains these data down to their noise."]
    for group in ties(result):
        words = separation(group[0].get("would_separate", ""))[0]
        if len(group) > 1:
            tied = " and ".join(phrase(result, effect["name"], effect["where"]) for effect in group)
            steps.append(f"Separate {tied}: {words.rstrip(':.') or 'no run of these sensors can'}.")
    if verdict in ("explained", "partly explained"):
        steps += [
            f"Confirm {phrase(result, e['name'], e['where'])} at the rig: expect {_values(e)}."
            for e in result["effects"]
        ]
        if result["explained"] != result["mechanism"]:
            steps.append("Use explained.toml in place of the nominal mechanism.")
    if verdict in ("partly explained", "unexplained"):
        steps += [f"Look for what is outside the vocabulary: {rest}." for rest in remaining(result)[:3]]
    return steps


def _values(effect: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} {value}" for name, value, _ in (parameter(*item) for item in effect["parameters"].items())
    )


def remaining(result: Result) -> list[str]:
    """The signals whose gap is still above the noise floor, the largest first."""
    floor = 1.1 * result["gap"]["noise_floor"]
    rows = [
        (s["gap_after"], run["name"], name)
        for run in result["runs"]
        for name, s in run["signals"].items()
        if (s["gap_after"] or 0) > floor
    ]
    return [
        f"{spoken(result, signal)} in run {run} still has a gap of {number(gap)}"
        for gap, run, signal in sorted(rows, reverse=True)
    ]


def simulated_by(result: Result) -> str:
    """Which engine the gaps are of; where it could not simulate the explanation, that the gap after is not."""
    name = f"{result['simulator']['name']} {result['simulator']['version']}".strip()
    failed = any(engine["name"] == result["simulator"]["name"] and engine["skipped"] for engine in result["engines"])
    return f"{name}, after: the analytic model, as {result['simulator']['name']} failed" if failed else name


def remark(engine: Mapping[str, Any]) -> str:
    """What has to be known of an engine's numbers: that it has none, or what it lacks."""
    if engine["skipped"]:
        return f"skipped: {engine['skipped']}"
    return (
        f"has no {', '.join(engine['added'])}: got the difference that the analytic model makes of it"
        if engine["added"]
        else ""
    )


def settings(result: Result) -> list[tuple[str, str, str]]:
    """Engine, setting and value of every number with which an engine was set; one that differs between runs is said for
    each.
    """
    rows = []
    for engine in result["engines"]:
        for name in dict.fromkeys(name for found in engine["settings"].values() for name in found):
            values = {run: setting(found.get(name)) for run, found in engine["settings"].items()}
            alike = len(set(values.values())) == 1
            said = (
                next(iter(values.values()))
                if alike
                else ", ".join(f"{value} in {run}" for run, value in values.items())
            )
            rows.append((engine["name"], name.replace("_", " "), said))
    return rows
