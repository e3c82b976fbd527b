"""A diagnosis in an engineer's words."""

from __future__ import annotations

import math

from compare.diagnose.explain import Explanation, Interval, Named
from compare.diagnose.locate import Stretch

SCALES: dict[str, tuple[tuple[float, str], ...]] = {  # unit in SI -> (size of the unit that is read, its name), largest first
    "m": ((1.0, "m"), (1e-3, "mm"), (1e-6, "um")),
    "rad": ((math.radians(1.0), "deg"), (1e-3, "mrad"), (1e-6, "urad")),
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")),
    "kg": ((1.0, "kg"), (1e-3, "g")),
    "Pa": ((1e9, "GPa"), (1e6, "MPa"), (1.0, "Pa")),
    "N.m": ((1.0, "N.m"), (1e-3, "mN.m")),
    "N": ((1.0, "N"), (1e-3, "mN")),
}
SAYS = {
    "gravity": "gravity acts on the linkage", "payload": "a payload rides on the {where}", "com_offset": "the centre of mass of the {where} is off",
    "moment_of_inertia": "the moment of inertia of the {where} is off", "link_length": "the {where} is not as long as thought",
    "pivot_position": "the ground pivot {where} is not where it is thought to be", "joint_clearance": "joint {where} has clearance",
    "coulomb_friction": "joint {where} has dry friction", "viscous_friction": "joint {where} has viscous friction",
    "joint_spring": "a spring acts in joint {where}", "external_force": "an unknown force acts on the {where}",
    "load_torque": "an unknown torque acts on the {where}", "link_flexibility": "the links bend", "drive_compliance": "the drive is springy",
    "speed_ripple": "the drive turns unevenly", "encoder_offset": "the encoder {where} has an offset", "sensor_bias": "the sensor {where} has a bias",
    "sensor_gain": "the sensor {where} has a wrong gain", "sensor_delay": "the sensor {where} is late",
    "sensor_frame": "the load cell at {where} is mounted turned", "clock_offset": "the clock of run {where} is off against its command",
}  # fmt: skip


def scaled(value: float, unit: str) -> tuple[float, str]:
    """Size and name of the unit in which a person reads a value."""
    scales = SCALES.get(unit, ((1.0, "" if unit == "1" else unit),))
    return next(((size, name) for size, name in scales if abs(value) >= 0.1 * size), scales[-1])


def amount(value: float, unit: str, like: float | None = None) -> str:
    """A value with the unit that a person reads, or that another value is read in."""
    size, name = scaled(value if like is None else like, unit)
    return f"{value / size:.3g} {name}".strip()


def parameter(name: str, interval: Interval, unit: str) -> str:
    """A parameter with its 95 % interval."""
    words = name.replace("_", " ")
    if interval.low == interval.high:
        return f"{words} {amount(interval.value, unit)}"
    if not (math.isfinite(interval.low) and math.isfinite(interval.high)):
        return f"{words} {amount(interval.value, unit)} (these data leave it open)"
    return f"{words} {amount(interval.value, unit)} (95 %: {amount(interval.low, unit, interval.value)} to {amount(interval.high, unit, interval.value)})"


def says(name: str, where: str) -> str:
    """What an effect at a place means."""
    return SAYS.get(name, f"{name.replace('_', ' ')} at {{where}}").format(where=where)


def named(n: Named) -> str:
    """A named effect in a sentence."""
    units = {p.name: p.unit for p in n.term.effect.parameters}
    values = "; ".join(parameter(p, i, units.get(p.partition("@")[0], "")) for p, i in n.parameters.items())
    text = f"{says(*n.term.key)}: {values}."
    return text[0].upper() + text[1:]


def stretch(s: Stretch, unit: str) -> str:
    """Where a sensor is off, in a sentence."""
    way = "above" if s.size > 0 else "below"
    begin, end = sorted((math.degrees(s.begin), math.degrees(s.end)))
    signal = s.signal.replace("_", " ")
    return f"{signal} is {amount(abs(s.size), unit)} {way} the simulation between {begin:.4g} and {end:.4g} deg in run {s.run} ({s.sigmas:.0f} sigma)."


def statement(e: Explanation, gap: tuple[float, float]) -> str:
    """The verdict in a paragraph."""
    before, after = gap
    measure = f"The gap is {before:.3g} times the noise before and {after:.3g} after."
    if e.verdict == "no gap":
        return f"Simulation and measurement agree within the noise (gap {before:.3g} times the noise floor). Nothing is missing that these data could show."
    if e.verdict == "unexplained":
        return f"Simulation and measurement disagree (gap {before:.3g} times the noise floor), and nothing in the vocabulary explains it."
    what = " ".join(named(n) for n in e.named)
    if e.verdict == "explained":
        return f"{what} {measure}"
    if e.verdict == "ambiguous":
        ties = " ".join(
            f"These data cannot tell {n.term.label} from {', '.join(t.label for t, _ in n.ties)}." for n in e.named if n.ties
        )  # fmt: skip
        return f"{what} {ties} {measure}"
    return f"{what} {measure} Something remains that these effects do not explain."
